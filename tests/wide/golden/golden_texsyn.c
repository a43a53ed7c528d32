/* golden_texsyn.c - hashes of models and pictures of texsyn.h; see golden.h
   SPDX-License-Identifier: MIT OR Unlicense                                                      */
#define TEXSYN_IMPLEMENTATION
#include "texsyn.h"

#include "golden.h"

enum { SIDE = 64, WIDTH = 80, HEIGHT = 72 };
static uint8_t exemplar[SIDE * SIDE * 4], mask[SIDE * SIDE], bytes[1 << 17];
static uint8_t picture[WIDTH * HEIGHT * 4 * sizeof(float)];

static uint64_t model_hash(const texsyn_model *model, txm_env *env, uint64_t hash) {
    size_t size = 0;
    golden_need(texsyn_save(model, env, bytes, sizeof bytes, &size), "save", env);
    return tk_hash(hash, bytes, size);
}

static texsyn_learn_desc learning(int channels) {
    texsyn_learn_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.example = golden_image(exemplar, SIDE, SIDE, channels, TXM_U8);
    desc.max_distance = 12;
    desc.max_types = 12;
    return desc;
}

/* A model of one exemplar and a picture made from it. */
static uint64_t both(const texsyn_learn_desc *learn, int channels, txm_sample sample, int tileable,
                     int quality, txm_env *env) {
    texsyn_model *model = NULL;
    texsyn_synth_desc synth;
    golden_need(texsyn_learn(learn, env, &model), "learn", env);
    uint64_t hash = model_hash(model, env, 0);
    memset(&synth, 0, sizeof synth);
    synth.model = model;
    synth.width = WIDTH;
    synth.height = HEIGHT;
    synth.tileable = tileable;
    synth.quality = quality;
    synth.seed = 3;
    const txm_image out = golden_image(picture, WIDTH, HEIGHT, channels, sample);
    golden_need(texsyn_synthesize(&synth, env, out), "synthesize", env);
    const size_t unit = txm_sample_bytes(sample);
    hash = golden_hash(hash, picture, (size_t)WIDTH * HEIGHT * (size_t)channels * unit, unit);
    texsyn_model_free(model);
    return hash;
}

static uint64_t gray(txm_env *env) {
    golden_noise(exemplar, SIDE, SIDE, 1);
    const texsyn_learn_desc desc = learning(1);
    return both(&desc, 1, TXM_U8, 0, 0, env);
}

static uint64_t rgb_tileable(txm_env *env) {
    golden_noise(exemplar, SIDE, SIDE, 3);
    const texsyn_learn_desc desc = learning(3);
    return both(&desc, 3, TXM_U8, 1, -1, env);
}

static uint64_t rgba_deep(txm_env *env) {
    golden_noise(exemplar, SIDE, SIDE, 4);
    texsyn_learn_desc desc = learning(4);
    desc.max_types = 6;
    return both(&desc, 4, TXM_U16, 0, -2, env);
}

/* blobs with soft rims on nothing, which hides noise; learned, and a hole of it filled */
static uint64_t cutout(txm_env *env) {
    static uint8_t alpha[SIDE * SIDE], hole[SIDE * SIDE];
    golden_noise(exemplar, SIDE, SIDE, 4);
    golden_blobs(alpha, SIDE, SIDE, 1);
    for (int i = 0; i < SIDE * SIDE; i++) {
        const int seen = (alpha[i] - 100) * 4;
        exemplar[4 * i + 3] = (uint8_t)(seen < 0 ? 0 : seen > 255 ? 255 : seen);
        hole[i] = i % SIDE > 20 && i % SIDE < 44 && i / SIDE > 30 && i / SIDE < 50 ? 255 : 0;
    }
    texsyn_learn_desc desc = learning(4);
    desc.max_types = 8;
    const uint64_t hash = both(&desc, 4, TXM_U8, 1, -1, env);
    texsyn_fill_desc fill;
    memset(&fill, 0, sizeof fill);
    fill.image = desc.example;
    fill.mask = golden_image(hole, SIDE, SIDE, 1, TXM_U8);
    fill.quality = -1;
    golden_need(texsyn_fill(&fill, env, golden_image(picture, SIDE, SIDE, 4, TXM_U8)), "fill", env);
    return tk_hash(hash, picture, (size_t)SIDE * SIDE * 4);
}

static uint64_t blobs_fine(txm_env *env) {
    golden_blobs(exemplar, SIDE, SIDE, 1);
    texsyn_learn_desc desc = learning(1);
    desc.max_distance = 20;
    desc.max_types = 8;
    desc.levels = 3;
    desc.seed = 9;
    return both(&desc, 3, TXM_F32, 0, 1, env);
}

static uint64_t masked(txm_env *env) {
    golden_blobs(exemplar, SIDE, SIDE, 3);
    for (int i = 0; i < SIDE * SIDE; i++)
        mask[i] = (i % SIDE - 30) * (i % SIDE - 30) + (i / SIDE - 30) * (i / SIDE - 30) < 29 * 29 ? 255 : 0;
    texsyn_learn_desc desc = learning(3);
    desc.mask = golden_image(mask, SIDE, SIDE, 1, TXM_U8);
    desc.threshold = 0.02f;
    desc.levels = 2;
    return both(&desc, 3, TXM_U8, 0, -2, env);
}

/* saved and loaded again, and all that a model tells of itself */
static uint64_t file(txm_env *env) {
    texsyn_model *model = NULL, *again = NULL;
    texsyn_clique clique;
    size_t size = 0;
    float bins[1024];
    golden_bricks(exemplar, SIDE, SIDE, 3);
    texsyn_learn_desc desc = learning(3);
    desc.max_types = 10;
    golden_need(texsyn_learn(&desc, env, &model), "learn", env);
    golden_need(texsyn_save(model, env, bytes, sizeof bytes, &size), "save", env);
    golden_need(texsyn_load(bytes, size, env, &again), "load", env);
    uint64_t hash = model_hash(again, env, 0);
    for (int i = 0; i < texsyn_clique_count(again); i++) {
        const int count = texsyn_clique_at(again, i, &clique, bins, 1024);
        const int numbers[9] = {(int)clique.kind, clique.level, clique.band, clique.other, clique.dx,
                                clique.dy,        clique.ex,    clique.ey,   clique.phase};
        hash = golden_hash(hash, numbers, sizeof numbers, 4);
        hash = golden_hash(hash, bins, (size_t)count * sizeof *bins, 4);
    }
    texsyn_model_free(model);
    texsyn_model_free(again);
    return hash;
}

/* a light learned and applied, in three depths */
static uint64_t relit(txm_env *env) {
    static uint8_t like[SIDE * SIDE * 3];
    uint64_t hash = 0;
    golden_blobs(exemplar, SIDE, SIDE, 3);
    golden_noise(like, SIDE, SIDE, 3);
    for (int s = 0; s < 3; s++) {
        static const txm_sample samples[3] = {TXM_U8, TXM_U16, TXM_F32};
        texsyn_relight_desc desc;
        memset(&desc, 0, sizeof desc);
        desc.image = golden_image(exemplar, SIDE, SIDE, 3, TXM_U8);
        desc.like = golden_image(like, SIDE, SIDE, 3, TXM_U8);
        const txm_image out = golden_image(picture, SIDE, SIDE, 3, samples[s]);
        golden_need(texsyn_relight(&desc, env, out), "relight", env);
        const size_t unit = txm_sample_bytes(samples[s]);
        hash = golden_hash(hash, picture, (size_t)SIDE * SIDE * 3 * unit, unit);
    }
    return hash;
}

/* cracks, drawn at three levels over another picture */
static uint64_t eroded(txm_env *env) {
    texsyn_erosion *erosion = NULL;
    texsyn_erosion_desc desc;
    uint64_t hash = 0;
    static uint8_t stone[WIDTH * HEIGHT * 3];
    golden_bricks(exemplar, SIDE, SIDE, 3);
    golden_noise(stone, WIDTH, HEIGHT, 3);
    memset(&desc, 0, sizeof desc);
    desc.weathered = golden_image(exemplar, SIDE, SIDE, 3, TXM_U8);
    desc.width = WIDTH;
    desc.height = HEIGHT;
    desc.seed = 5;
    golden_need(texsyn_erosion_make(&desc, env, &erosion), "erosion", env);
    const txm_image from = golden_image(stone, WIDTH, HEIGHT, 3, TXM_U8);
    for (int k = 1; k <= 3; k++) {
        const txm_image out = golden_image(picture, WIDTH, HEIGHT, 3, TXM_U8);
        golden_need(texsyn_erosion_draw(erosion, (float)k / 4, NULL, &from, env, out), "draw", env);
        hash = tk_hash(hash, picture, (size_t)WIDTH * HEIGHT * 3);
    }
    texsyn_erosion_free(erosion);
    return hash;
}

/* a composite of two textures: its file, a layout made for it, and pictures of that and of a drawn
   layout */
static uint64_t composite(txm_env *env) {
    static uint8_t labels[WIDTH * HEIGHT], bricks[SIDE * SIDE * 3];
    texsyn_composite *made = NULL;
    texsyn_composite_learn_desc learn;
    texsyn_composite_desc synth;
    size_t size = 0;
    golden_noise(exemplar, SIDE, SIDE, 3);
    golden_bricks(bricks, SIDE, SIDE, 3);
    for (int i = 0; i < SIDE * SIDE; i++) {
        labels[i] = (uint8_t)(i / SIDE + i % SIDE / 4 > 40);
        if (labels[i]) memcpy(exemplar + 3 * i, bricks + 3 * i, 3);
    }
    memset(&learn, 0, sizeof learn);
    learn.example = golden_image(exemplar, SIDE, SIDE, 3, TXM_U8);
    learn.labels = golden_image(labels, SIDE, SIDE, 1, TXM_U8);
    learn.max_types = 6;
    golden_need(texsyn_composite_learn(&learn, env, &made), "learn", env);
    golden_need(texsyn_composite_save(made, env, bytes, sizeof bytes, &size), "save", env);
    uint64_t hash = tk_hash(0, bytes, size);
    memset(&synth, 0, sizeof synth);
    synth.composite = made;
    synth.width = WIDTH;
    synth.height = HEIGHT;
    synth.quality = -2;
    synth.seed = 6;
    for (int drawn = 0; drawn < 2; drawn++) {
        const txm_image map = golden_image(labels, WIDTH, HEIGHT, 1, TXM_U8);
        for (int i = 0; drawn && i < WIDTH * HEIGHT; i++) labels[i] = (uint8_t)(i % WIDTH > 30);
        if (drawn) synth.layout = map;
        else golden_need(texsyn_composite_layout(&synth, env, map), "layout", env);
        const txm_image out = golden_image(picture, WIDTH, HEIGHT, 3, TXM_U8);
        golden_need(texsyn_composite_synthesize(&synth, env, out), "synthesize", env);
        hash = tk_hash(hash, labels, sizeof labels);
        hash = tk_hash(hash, picture, (size_t)WIDTH * HEIGHT * 3);
    }
    texsyn_composite_free(made);
    return hash;
}

/* textures side by side, found and forced */
static uint64_t segments(txm_env *env) {
    enum { SEGMENT_SIDE = 160 };
    static uint8_t pixels[SEGMENT_SIDE * SEGMENT_SIDE * 3], labels[SEGMENT_SIDE * SEGMENT_SIDE];
    static uint8_t bricks[SEGMENT_SIDE * SEGMENT_SIDE * 3];
    texsyn_segment_desc desc;
    int count = 0;
    memset(&desc, 0, sizeof desc);
    golden_noise(pixels, SEGMENT_SIDE, SEGMENT_SIDE, 3);
    golden_bricks(bricks, SEGMENT_SIDE, SEGMENT_SIDE, 3);
    for (int i = 0; i < SEGMENT_SIDE * SEGMENT_SIDE; i++)
        if (i % SEGMENT_SIDE > i / SEGMENT_SIDE) memcpy(pixels + 3 * i, bricks + 3 * i, 3);
    desc.image = golden_image(pixels, SEGMENT_SIDE, SEGMENT_SIDE, 3, TXM_U8);
    uint64_t hash = 0;
    for (int forced = 0; forced <= 4; forced += 4) {
        desc.segments = forced;
        desc.transition = forced > 0;
        golden_need(texsyn_segment(&desc, env, golden_image(labels, SEGMENT_SIDE, SEGMENT_SIDE, 1,
                                                            TXM_U8), &count), "segment", env);
        hash = golden_hash(hash, &count, sizeof count, 4);
        hash = tk_hash(hash, labels, sizeof labels);
    }
    return hash;
}

/* a hole and a corner of a picture filled; known: with a model */
static uint64_t fill_as(int channels, txm_sample sample, int known, txm_env *env) {
    static uint16_t deep[SIDE * SIDE * 4], out[SIDE * SIDE * 4];
    texsyn_model *model = NULL;
    texsyn_fill_desc desc;
    memset(&desc, 0, sizeof desc);
    for (int i = 0; i < SIDE * SIDE; i++) {
        const int x = i % SIDE, y = i / SIDE;
        mask[i] = (x > 20 && x < 50 && y > 12 && y < 44) || x + y < 15 ? 255 : 0;
    }
    for (int i = 0; i < SIDE * SIDE * channels; i++) deep[i] = (uint16_t)(exemplar[i] * 257);
    desc.image = golden_image(sample == TXM_U16 ? (void *)deep : (void *)exemplar, SIDE, SIDE,
                              channels, sample);
    desc.mask = golden_image(mask, SIDE, SIDE, 1, TXM_U8);
    desc.quality = known ? 1 : 0;
    if (known) {
        const texsyn_learn_desc learn = learning(channels);
        golden_need(texsyn_learn(&learn, env, &model), "learn", env);
        desc.model = model;
    }
    golden_need(texsyn_fill(&desc, env, golden_image(out, SIDE, SIDE, channels, sample)), "fill",
                env);
    texsyn_model_free(model);
    const size_t unit = txm_sample_bytes(sample);
    return golden_hash(0, out, (size_t)SIDE * SIDE * (size_t)channels * unit, unit);
}

static uint64_t fill_rgb(txm_env *env) {
    golden_blobs(exemplar, SIDE, SIDE, 3);
    return fill_as(3, TXM_U8, 0, env);
}

static uint64_t fill_deep(txm_env *env) {
    golden_noise(exemplar, SIDE, SIDE, 4);
    return fill_as(4, TXM_U16, 0, env);
}

static uint64_t fill_known(txm_env *env) {
    golden_blobs(exemplar, SIDE, SIDE, 1);
    return fill_as(1, TXM_U8, 1, env);
}

/* two pictures joined: of different textures, with and without an example of their border, and of one */
static uint64_t knitted(txm_env *env) {
    static uint8_t other[SIDE * SIDE * 3], layout[SIDE * SIDE], out[SIDE * SIDE * 3];
    uint64_t hash = 0;
    golden_blobs(exemplar, SIDE, SIDE, 3);
    golden_noise(other, SIDE, SIDE, 3);
    for (int i = 0; i < SIDE * SIDE; i++) {
        const int x = i % SIDE, y = i / SIDE;
        layout[i] = x + y / 2 > 45 || (x < 20 && y < 20) ? 255 : 0;
    }
    for (int k = 0; k < 3; k++) {
        texsyn_knit_desc desc;
        memset(&desc, 0, sizeof desc);
        desc.a = golden_image(exemplar, SIDE, SIDE, 3, TXM_U8);
        desc.b = golden_image(other, SIDE, SIDE, 3, TXM_U8);
        desc.layout = golden_image(layout, SIDE, SIDE, 1, TXM_U8);
        desc.likeness = k == 2 ? TEXSYN_LIKENESS_SAME : TEXSYN_LIKENESS_DIFFERENT;
        desc.quality = -1;
        desc.seed = 4;
        if (k == 1) {
            desc.border = desc.a;
            desc.border_layout = desc.layout;
        }
        golden_need(texsyn_knit(&desc, env, golden_image(out, SIDE, SIDE, 3, TXM_U8)), "knit", env);
        hash = tk_hash(hash, out, sizeof out);
    }
    return hash;
}

static const golden_case cases[] = {{"gray", gray},
                                    {"rgb-tileable", rgb_tileable},
                                    {"rgba-16-bits", rgba_deep},
                                    {"cutout", cutout},
                                    {"blobs-fine-float", blobs_fine},
                                    {"masked", masked},
                                    {"file", file},
                                    {"knitted", knitted},
                                    {"relit", relit},
                                    {"eroded", eroded},
                                    {"composite", composite},
                                    {"segments", segments},
                                    {"fill", fill_rgb},
                                    {"fill-rgba-16-bits", fill_deep},
                                    {"fill-model", fill_known}};
GOLDEN_MAIN("texsyn")
