/* fuzz_texpatch.c - random exemplars, maps, guides, masks and descriptions into texpatch.h
   SPDX-License-Identifier: MIT OR Unlicense; fuzzkit.h says how to run it

   Textures in one call and in steps, parts of them again, windows of the plane, levels of detail. After
   an error results are untouched, rows are never left, sources lie inside the exemplar.             */
#define TEXPATCH_IMPLEMENTATION
#include "texpatch.h"

#define FUZZ_BYTES 300
#include "fuzzkit.h"

enum { MOST_MAPS = 3, MOST_WINDOW = 90 };

typedef struct input {
    texpatch_desc desc;
    texpatch_exemplar exemplars[2];
    texpatch_map maps[MOST_MAPS];
    txm_image pictures[2][MOST_MAPS], kept[MOST_MAPS];
    int channels[MOST_MAPS];
    txm_sample samples[MOST_MAPS];
} input;

static float some_weight(source *s) {
    return pick(s, 24) ? (float)pick(s, 5) / 2 : pick(s, 2) ? NAN : 17;
}

static void make_maps(input *in, source *s) {
    in->desc.map_count = 1 + pick(s, 4) % MOST_MAPS;
    for (int m = 0; m < in->desc.map_count; m++) {
        in->channels[m] = 1 + pick(s, 4);
        in->samples[m] = any_sample(s);
        in->maps[m].weight = some_weight(s);
        in->maps[m].is_normal = in->channels[m] > 2 && pick(s, 3) == 0 ? 1 + pick(s, 2) : 0;
        in->maps[m].is_label = !in->maps[m].is_normal && pick(s, 6) == 0;
        in->maps[m].is_data = pick(s, 4) == 0;
    }
    if (pick(s, 2)) in->desc.maps = in->maps;
}

static void make_exemplars(input *in, pool *p, source *s, int guide_channels) {
    in->desc.exemplar_count = pick(s, 4) ? 1 : 2;
    in->desc.exemplars = in->exemplars;
    for (int e = 0; e < in->desc.exemplar_count; e++) {
        const int width = (pick(s, 30) ? 32 : 20) + pick(s, 40), height = 32 + pick(s, 40);
        for (int m = 0; m < in->desc.map_count; m++)
            in->pictures[e][m] = any_image(p, s, width + (pick(s, 60) == 0), height, in->channels[m],
                                           in->samples[m]);
        in->exemplars[e].maps = in->pictures[e];
        if (guide_channels)
            in->exemplars[e].guide = any_image(p, s, width, height, guide_channels, TXM_U8);
        if (pick(s, 3) == 0)
            in->exemplars[e].mask = any_mask(p, s, width, height, 1 + pick(s, 8) / 7, TXM_U8);
    }
}

static void make_desc(input *in, pool *p, source *s) {
    texpatch_desc *d = &in->desc;
    memset(in, 0, sizeof *in);
    const int guide_channels = pick(s, 4) ? 0 : 1 + pick(s, 3);
    make_maps(in, s);
    make_exemplars(in, p, s, guide_channels);
    d->width = 1 + pick(s, pick(s, 3) ? MOST_WINDOW : 8);
    d->height = 1 + pick(s, MOST_WINDOW);
    d->tileable = pick(s, 4);
    d->patch = pick(s, 3) ? 0 : pick(s, 50) - 1;
    d->passes = pick(s, 4) - 2 + (pick(s, 40) == 0);
    d->turns = pick(s, 3) ? 0 : pick(s, 6);
    d->mirror = pick(s, 5) == 0;
    d->novelty = pick(s, 3) ? 0 : (float)pick(s, 11) / 10;
    d->lattice = pick(s, 3) ? 0 : pick(s, 3) - 1;
    for (int i = 0; i < 4; i++) d->lattice_vectors[i] = (float)(pick(s, 41) - 10) * (i % 3 ? 0.1f : 1.0f);
    if (guide_channels) d->guide = any_image(p, s, d->width, d->height, guide_channels, TXM_U8);
    if (guide_channels && pick(s, 2)) d->guide_mask = any_mask(p, s, d->width, d->height, 1, TXM_U8);
    d->guide_weight = some_weight(s);
    if (pick(s, 4) == 0) {
        for (int m = 0; m < d->map_count; m++)
            in->kept[m] = any_image(p, s, d->width, d->height, in->channels[m], in->samples[m]);
        d->kept = in->kept;
        d->keep = any_mask(p, s, d->width, d->height, 1, TXM_U8);
    }
    d->seed = (uint64_t)pick(s, 65536);
}

static void results(const input *in, pool *p, source *s, int width, int height, txm_image *out) {
    for (int m = 0; m < in->desc.map_count; m++)
        out[m] = fresh_image(p, s, width, height, in->channels[m], in->samples[m]);
}

static void look_at_source(const input *in, const texpatch_source *from) {
    if (from->exemplar == -1) return;
    if (from->exemplar < 0 || from->exemplar >= in->desc.exemplar_count) abort();
    const txm_image *im = &in->pictures[from->exemplar][0];
    if (!(from->x > -1 && from->y > -1 && from->x < (float)im->width && from->y < (float)im->height)) abort();
    if (from->turn < 0 || from->turn > 7) abort();
}

/* A window of the result; where its pixels come from. */
static void look_at_job(const input *in, const texpatch_job *job, pool *p, source *s) {
    const texpatch_desc *d = &in->desc;
    const int m = pick(s, d->map_count), width = 1 + pick(s, d->width), height = 1 + pick(s, d->height);
    const int x = pick(s, d->width - width + 1), y = pick(s, d->height - height + 1 + (pick(s, 20) == 0));
    txm_env env;
    memset(&env, 0, sizeof env);
    const txm_image out = fresh_image(p, s, width, height, in->channels[m], in->samples[m]);
    look_at_results(texpatch_draw(job, m, x, y, &env, out) == TXM_OK, &out, 1);
    const texpatch_source from = texpatch_source_at(job, pick(s, d->width), pick(s, d->height));
    look_at_source(in, &from);
}

/* All steps; one that fails may be tried again. */
static int run(texpatch_job *job, trouble *t, txm_env *env, source *s) {
    int more = 1;
    for (int tries = 0; more && tries < 3;) {
        plan_trouble(t, s);
        if (!succeeded(texpatch_step(job, env, &more), t, env)) tries++;
    }
    plan_none(t);
    return !more;
}

static void in_steps(const input *in, pool *p, source *s) {
    texpatch_job *job = NULL;
    trouble t;
    txm_env env = troubled(&t, s);
    float vectors[4];
    if (succeeded(texpatch_begin(&in->desc, &env, &job), &t, &env) != (job != NULL)) abort();
    if (job) {
        texpatch_lattice(job, vectors);
        int done = run(job, &t, &env, s);
        if (done) look_at_job(in, job, p, s);
        for (int i = pick(s, 3); i > 0 && done; i--) {
            const txm_image again = any_mask(p, s, in->desc.width, in->desc.height, 1, TXM_U8);
            const int guided = in->desc.guide.pixels && pick(s, 2);
            txm_image guide = in->desc.guide;
            if (guided)
                guide = any_image(p, s, guide.width, guide.height, guide.channels ? guide.channels : 1, TXM_U8);
            plan_trouble(&t, s);
            if (!succeeded(texpatch_again(job, &again, guided ? &guide : NULL, NULL, 5, &env), &t, &env)) break;
            done = run(job, &t, &env, s);
            if (done) look_at_job(in, job, p, s);
        }
        fuzz_succeeded += done;
        texpatch_free(job);
    }
    if (t.memory.blocks) abort();
}

static void at_once(const input *in, pool *p, source *s) {
    txm_image out[MOST_MAPS];
    trouble t;
    txm_env env = troubled(&t, s);
    results(in, p, s, in->desc.width, in->desc.height, out);
    const int success = succeeded(texpatch_make(&in->desc, &env, out), &t, &env);
    look_at_results(success, out, in->desc.map_count);
    fuzz_succeeded += success;
    if (t.memory.blocks) abort();
}

static void endless(const input *in, pool *p, source *s) {
    texpatch_plane *plane = NULL;
    txm_image out[MOST_MAPS];
    trouble t;
    txm_env env = troubled(&t, s);
    if (succeeded(texpatch_plane_make(&in->desc, &env, &plane), &t, &env) != (plane != NULL)) abort();
    if (plane) {
        const int width = 1 + pick(s, 40), height = 1 + pick(s, 40), far_off = pick(s, 3);
        const int64_t origin = far_off == 2 ? (int64_t)1 << 40 : far_off ? -1000000007 : 0;
        texpatch_source *sources = (texpatch_source *)(void *)take(p, (size_t)(width * height) * sizeof *sources);
        results(in, p, s, width, height, out);
        const txm_status status =
            texpatch_plane_draw(plane, origin - pick(s, 90), pick(s, 200) - 100, &env, out, sources);
        const int success = succeeded(status, &t, &env);
        look_at_results(success, out, in->desc.map_count);
        for (int i = 0; i < width * height && success; i++) look_at_source(in, &sources[i]);
        fuzz_succeeded += success;
    }
    texpatch_plane_free(plane);
    if (t.memory.blocks) abort();
}

static void halved(pool *p, source *s) {
    const int channels = 1 + pick(s, 4), width = 1 + pick(s, 40), height = 1 + pick(s, 40);
    const txm_sample sample = any_sample(s);
    const int up = pick(s, 8) == 0; /* not the size that is wanted */
    texpatch_map map;
    txm_env env;
    memset(&map, 0, sizeof map);
    memset(&env, 0, sizeof env);
    map.is_normal = pick(s, 3) == 0 ? 1 + pick(s, 2) : 0;
    map.is_label = pick(s, 4) == 0;
    map.is_data = pick(s, 2);
    const txm_image from = any_image(p, s, width, height, channels, sample);
    const int w = width > 1 ? width / 2 : 1, h = height > 1 ? height / 2 : 1;
    const txm_image half = fresh_image(p, s, w + up, h, channels, sample);
    const txm_status status = texpatch_half(&from, pick(s, 2) ? &map : NULL, pick(s, 4), &env, &half);
    if (status != TXM_OK && !env.message[0]) abort();
    look_at_results(status == TXM_OK, &half, 1);
    fuzz_succeeded += status == TXM_OK;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static input in;
    static pool p;
    source s = source_of(data, size);
    const int way = pick(&s, 8);
    if (way == 0) {
        halved(&p, &s);
    } else {
        make_desc(&in, &p, &s);
        if (way < 3) at_once(&in, &p, &s);
        else if (way < 7) in_steps(&in, &p, &s);
        else endless(&in, &p, &s);
    }
    drain(&p);
    return 0;
}
