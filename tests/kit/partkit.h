/* partkit.h - what the tests of composite textures share: label maps, and pictures that have them
   SPDX-License-Identifier: MIT OR Unlicense                                                     */
#ifndef PARTKIT_H
#define PARTKIT_H

#include "synkit.h"

#include <math.h>

enum { LARGE = 128 };

/* ---- label maps ------------------------------------------------------------------------------ */

typedef int label_at(int x, int y);

/* Noise of a wavelength of some 20 pixels, about -1..1. */
static inline double waves(int x, int y, int which) {
    double sum = 0;
    for (int k = 0; k < 6; k++) {
        const double turn = (at_random(k, which, 7) / 255.0 + k) * 1.0471975512;
        const double length = 15 + at_random(k, which, 8) / 25.0;
        sum += sin((x * cos(turn) + y * sin(turn)) * 6.283185307 / length + at_random(k, which, 9));
    }
    return sum / 3;
}

static inline int patches(int x, int y) {
    return waves(x, y, 1) > 0.25;
}

static inline int three(int x, int y) {
    return waves(x, y, 2) > 0.2 ? 2 : waves(x, y, 3) > 0;
}

static inline int stripes(int x, int y) {
    return sin((x + y / 3.0) * 0.42) + waves(x, y, 4) / 2 > 0;
}

/* A sky above hills with patches. */
static inline int sky(int x, int y) {
    return y < 58 + 5 * waves(x, 0, 5) ? 0 : 1 + patches(x, y);
}

static inline void draw_labels(uint8_t *map, int width, int height, label_at *label) {
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) *map++ = (uint8_t)label(x, y);
}

/* A picture of a label map: each label has its own range of values in each channel, of at most 20;
   alpha is opaque. */
static inline int base_value(int label, int channel) {
    return channel == 3 ? 255 : 20 + (label * 5 + channel * 2) % 8 * 29;
}

static inline void draw_parts(uint8_t *p, const uint8_t *map, int width, int height, int channels) {
    for (int i = 0; i < width * height; i++)
        for (int c = 0; c < channels; c++)
            *p++ = (uint8_t)(base_value(map[i], c) +
                             (c == 3 ? 0 : at_random(i % width / 2, i / width / 2, c) % 20));
}

/* ---- composites ------------------------------------------------------------------------------ */

static inline texsyn_composite_learn_desc parts_desc(txm_image example, txm_image labels) {
    texsyn_composite_learn_desc d;
    memset(&d, 0, sizeof d);
    d.example = example;
    d.labels = labels;
    d.max_types = 2;
    return d;
}

static inline texsyn_composite *learn_parts(const texsyn_composite_learn_desc *d) {
    tk_progress progress = {0};
    txm_env env = tk_env(NULL, &progress);
    texsyn_composite *c = NULL;
    const txm_status status = texsyn_composite_learn(d, &env, &c);
    if (status != TXM_OK) fail_msg("learn: %d, %s", status, env.message);
    assert_non_null(c);
    assert_int_equal(progress.errors, 0);
    return c;
}

/* Learn a label map whose labels have one gray value each. */
static inline texsyn_composite *learn_layout(const uint8_t *map, int width, int height,
                                             texsyn_field field) {
    static uint8_t labels[LARGE * LARGE], gray[LARGE * LARGE];
    assert_true(width * height <= LARGE * LARGE);
    memcpy(labels, map, (size_t)width * (size_t)height);
    for (int i = 0; i < width * height; i++) gray[i] = (uint8_t)(20 + 14 * (map[i] & 15));
    texsyn_composite_learn_desc d =
        parts_desc(view_bytes(gray, width, height, 1), view_bytes(labels, width, height, 1));
    d.field = field;
    d.max_types = 1;
    return learn_parts(&d);
}

static inline texsyn_composite_desc composite_desc(const texsyn_composite *c, int width,
                                                   int height) {
    texsyn_composite_desc d;
    memset(&d, 0, sizeof d);
    d.composite = c;
    d.width = width;
    d.height = height;
    return d;
}

static inline void make_layout(const texsyn_composite *c, int width, int height, uint64_t seed,
                               uint8_t *map) {
    tk_progress progress = {0};
    txm_env env = tk_env(NULL, &progress);
    texsyn_composite_desc d = composite_desc(c, width, height);
    d.seed = seed;
    const txm_status status = texsyn_composite_layout(&d, &env, view_bytes(map, width, height, 1));
    if (status != TXM_OK) fail_msg("layout: %d, %s", status, env.message);
    assert_int_equal(progress.errors, 0);
}

static inline void make_parts(const texsyn_composite_desc *d, txm_image out) {
    tk_progress progress = {0};
    txm_env env = tk_env(NULL, &progress);
    const txm_status status = texsyn_composite_synthesize(d, &env, out);
    if (status != TXM_OK) fail_msg("synthesize: %d, %s", status, env.message);
    assert_int_equal(progress.errors, 0);
}

#endif /* PARTKIT_H */
