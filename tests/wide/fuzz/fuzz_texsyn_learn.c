/* fuzz_texsyn_learn.c - random exemplars, masks, labels and descriptions into learning and synthesis
   SPDX-License-Identifier: MIT OR Unlicense; fuzzkit.h says how to run it

   Models and composites are learned, saved, loaded, looked into and synthesised from. What is loaded
   must save to the same bytes; after an error results are untouched, and nothing is leaked.         */
#define TEXSYN_IMPLEMENTATION
#include "texsyn.h"

#define FUZZ_BYTES 200
#include "fuzzkit.h"

enum { MOST_BYTES = 1 << 20 };

static const int channels_of[4] = {1, 3, 4, 2};

static int some_channels(source *s) {
    return channels_of[pick(s, 24) ? pick(s, 3) : 3];
}

static txm_image result(pool *p, source *s, int width, int height, int channels) {
    const int wide = pick(s, 4) ? channels : 1 + pick(s, 4);
    return fresh_image(p, s, width + (pick(s, 40) == 0), height, wide, any_sample(s));
}

/* Save, load, save again. */
static void look_at_model(const texsyn_model *model) {
    static uint8_t first[MOST_BYTES], second[MOST_BYTES];
    size_t size = 0, again = 0;
    texsyn_model *copy = NULL;
    txm_env env;
    float bins[40];
    memset(&env, 0, sizeof env);
    if (texsyn_save(model, &env, first, sizeof first, &size) != TXM_OK) abort();
    if (texsyn_load(first, size, &env, &copy) != TXM_OK) abort();
    if (texsyn_save(copy, &env, second, sizeof second, &again) != TXM_OK) abort();
    if (size != again || memcmp(first, second, size) != 0) abort();
    for (int i = -1; i <= texsyn_clique_count(copy); i++) {
        texsyn_clique clique;
        const int bin_count = texsyn_clique_at(copy, i, &clique, bins, 40);
        for (int k = 0; k < bin_count && k < 40; k++)
            if (!(bins[k] >= 0 && bins[k] <= 1)) abort();
    }
    texsyn_model_free(copy);
}

static void synthesise(const texsyn_model *model, pool *p, source *s) {
    texsyn_synth_desc d;
    texsyn_job *job = NULL;
    trouble t;
    memset(&d, 0, sizeof d);
    d.model = model;
    d.width = 1 + pick(s, 50);
    d.height = 1 + pick(s, 50);
    d.tileable = pick(s, 2);
    d.quality = pick(s, 12) ? -2 : pick(s, 7) - 3;
    d.seed = (uint64_t)pick(s, 256);
    const txm_image out = result(p, s, d.width, d.height, texsyn_channels(model));
    txm_env env = troubled(&t, s);
    if (pick(s, 2)) {
        const int success = succeeded(texsyn_synthesize(&d, &env, out), &t, &env);
        look_at_results(success, &out, 1);
        fuzz_succeeded += success;
    } else if (succeeded(texsyn_begin(&d, &env, &job), &t, &env)) {
        int more = 1;
        for (int tries = 0; more && tries < 3;) {
            plan_trouble(&t, s);
            if (!succeeded(texsyn_step(job, &env, &more), &t, &env)) tries++;
        }
        plan_none(&t);
        look_at_results(texsyn_draw(job, &env, out) == TXM_OK, &out, 1);
        fuzz_succeeded++;
    }
    texsyn_free(job);
    if (t.memory.blocks) abort();
}

static void learn(pool *p, source *s) {
    texsyn_learn_desc d;
    texsyn_model *model = NULL;
    trouble t;
    const int width = (pick(s, 20) ? 16 : 1) + pick(s, 48), height = 16 + pick(s, 48);
    memset(&d, 0, sizeof d);
    d.example = any_image(p, s, width, height, some_channels(s), any_sample(s));
    if (pick(s, 2))
        d.mask = any_mask(p, s, width + (pick(s, 30) == 0), height, pick(s, 4) ? 1 : 1 + pick(s, 4), any_sample(s));
    d.max_distance = 2 + pick(s, 14) + (pick(s, 40) ? 0 : 60);
    d.max_types = 1 + pick(s, 6);
    d.levels = pick(s, 8);
    d.threshold = pick(s, 8) ? 0 : (float)pick(s, 3) - 1;
    d.seed = (uint64_t)pick(s, 256);
    txm_env env = troubled(&t, s);
    if (succeeded(texsyn_learn(&d, &env, &model), &t, &env) != (model != NULL)) abort();
    plan_none(&t);
    if (model) {
        fuzz_succeeded++;
        look_at_model(model);
        synthesise(model, p, s);
    }
    texsyn_model_free(model);
    if (t.memory.blocks) abort();
}

/* Labels in stripes or blocks; now and then one that is none. */
static txm_image some_labels(pool *p, source *s, int width, int height, int count) {
    const txm_image labels = fresh_image(p, s, width, height, 1, TXM_U8);
    const int across = 1 + pick(s, 3), kind = pick(s, 3);
    const int foreign = pick(s, 10) ? 255 : 16 + pick(s, 200), every = 7 + pick(s, 60);
    for (int y = 0; y < height; y++) {
        uint8_t *row = (uint8_t *)txm_image_row(&labels, y);
        for (int x = 0; x < width; x++) {
            const int place = kind == 0   ? x * count * across / width
                              : kind == 1 ? y * count / height
                                          : x * across / width + y * count / height;
            row[x] = (uint8_t)((x + y) % every == 0 ? foreign : place % count);
        }
    }
    return labels;
}

static void compose(pool *p, source *s) {
    static uint8_t bytes[MOST_BYTES];
    texsyn_composite_learn_desc learned;
    texsyn_composite_desc d;
    texsyn_composite *composite = NULL, *copy = NULL;
    trouble t;
    const int side = (pick(s, 20) ? 36 : 20) + pick(s, 30), count = 1 + pick(s, 3);
    memset(&learned, 0, sizeof learned);
    memset(&d, 0, sizeof d);
    learned.example = any_image(p, s, side, side, some_channels(s), any_sample(s));
    learned.labels = some_labels(p, s, side, side, count);
    learned.field = (texsyn_field)pick(s, 4);
    learned.max_types = 1 + pick(s, 4);
    txm_env env = troubled(&t, s);
    if (succeeded(texsyn_composite_learn(&learned, &env, &composite), &t, &env) != (composite != NULL)) abort();
    if (composite) {
        size_t size = 0;
        plan_none(&t);
        if (texsyn_composite_save(composite, &env, bytes, sizeof bytes, &size) != TXM_OK ||
            texsyn_composite_load(bytes, size, &env, &copy) != TXM_OK)
            abort();
        d.composite = copy;
        d.width = 1 + pick(s, 50);
        d.height = 1 + pick(s, 50);
        d.quality = -2;
        if (pick(s, 2)) d.layout = some_labels(p, s, d.width, d.height, count);
        const txm_image out = result(p, s, d.width, d.height, texsyn_channels(texsyn_composite_model(copy, 0)));
        const int success = succeeded(texsyn_composite_synthesize(&d, &env, out), &t, &env);
        look_at_results(success, &out, 1);
        fuzz_succeeded += success;
    }
    texsyn_composite_free(composite);
    texsyn_composite_free(copy);
    if (t.memory.blocks) abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static pool p;
    source s = source_of(data, size);
    if (pick(&s, 3)) learn(&p, &s);
    else compose(&p, &s);
    drain(&p);
    return 0;
}
