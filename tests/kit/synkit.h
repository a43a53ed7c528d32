/* synkit.h - what the tests of texsyn.h share: pictures, models, syntheses
   SPDX-License-Identifier: MIT OR Unlicense

   Includes cmocka.h, texsyn.h and testkit.h.                                                  */
#ifndef SYNKIT_H
#define SYNKIT_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "texsyn.h"

#include "images.h"
#include "testkit.h"

enum { FILL = 0x5c }; /* what output pixels hold before a call */

static inline void assert_near(double a, double b, double tolerance) {
    if (!(fabs(a - b) <= tolerance)) fail_msg("%.9g is not %.9g within %g", a, b, tolerance);
}

static inline void assert_between(double x, double low, double high) {
    if (!(x >= low && x <= high)) fail_msg("%.9g is not between %g and %g", x, low, high);
}

static inline txm_image view_bytes(void *pixels, int width, int height, int channels) {
    return view(pixels, width, height, channels, TXM_U8);
}

static inline txm_image view_float(float *pixels, int width, int height, int channels) {
    return view(pixels, width, height, channels, TXM_F32);
}

static inline txm_image view_words(uint16_t *pixels, int width, int height, int channels) {
    return view(pixels, width, height, channels, TXM_U16);
}

/* Patches of one value: a pixel is the one to its left, the one above, or new, of `values` values
   that are `step` apart. The channels repeat each other in part; alpha is one of two values. */
static inline void draw_patches(uint8_t *p, int width, int height, int channels, int values,
                                int step, uint64_t seed) {
    txm_rng rng = txm_rng_make(seed, 0);
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++, p += channels) {
            const uint32_t choice = txm_rng_below(&rng, 10);
            const uint8_t *from = choice < 4 && x ? p - channels
                                  : choice < 8 && y ? p - (ptrdiff_t)width * channels
                                                    : NULL;
            int v = (int)txm_rng_below(&rng, (uint32_t)values) * step;
            for (int c = 0; c < channels; c++) {
                if (c == 3) v = v / 4 * 4 > 60 ? 250 : 20;
                p[c] = from ? from[c] : (uint8_t)v;
                if (c == 1) v = (int)txm_rng_below(&rng, (uint32_t)values) * step;
            }
        }
    }
}

/* Smooth clouds of a few pixels: means of 5 x 5 random values, stretched. */
static inline void draw_smooth(uint8_t *p, int width, int height, uint64_t seed) {
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            int sum = 0;
            for (int v = 0; v < 5; v++)
                for (int u = 0; u < 5; u++)
                    sum += (int)(txm_hash(txm_hash((uint64_t)(x + u) + seed * 977) +
                                          (uint64_t)(y + v)) >>
                                 56);
            *p++ = (uint8_t)txm_clampi(128 + (sum / 25 - 128) * 4, 0, 255);
        }
    }
}

static inline texsyn_learn_desc learn_desc(txm_image example, int max_types) {
    texsyn_learn_desc d;
    memset(&d, 0, sizeof d);
    d.example = example;
    d.max_types = max_types;
    return d;
}

static inline texsyn_model *learn(const texsyn_learn_desc *desc) {
    tk_progress progress = {0};
    txm_env env = tk_env(NULL, &progress);
    texsyn_model *model = NULL;
    const txm_status status = texsyn_learn(desc, &env, &model);
    if (status != TXM_OK) fail_msg("learn: %d, %s", status, env.message);
    assert_non_null(model);
    assert_int_equal(progress.errors, 0);
    return model;
}

/* A small model: 48 x 48 patches, few clique types. */
static inline texsyn_model *small_model(int channels, int levels) {
    static uint8_t pixels[48 * 48 * 4];
    draw_patches(pixels, 48, 48, channels, 8, 30, 3);
    texsyn_learn_desc d = learn_desc(view_bytes(pixels, 48, 48, channels), 3);
    d.levels = levels;
    return learn(&d);
}

static inline texsyn_synth_desc synth_desc(const texsyn_model *model, int width, int height) {
    texsyn_synth_desc d;
    memset(&d, 0, sizeof d);
    d.model = model;
    d.width = width;
    d.height = height;
    return d;
}

static inline void synthesize(const texsyn_synth_desc *desc, txm_image out) {
    tk_progress progress = {0};
    txm_env env = tk_env(NULL, &progress);
    const txm_status status = texsyn_synthesize(desc, &env, out);
    if (status != TXM_OK) fail_msg("synthesize: %d, %s", status, env.message);
    assert_int_equal(progress.errors, 0);
}

typedef struct saved {
    size_t size;
    uint8_t bytes[1 << 15];
} saved;

static inline void save(const texsyn_model *model, saved *s) {
    assert_int_equal(texsyn_save(model, NULL, s->bytes, sizeof s->bytes, &s->size), TXM_OK);
}

static inline void assert_same_saved(const texsyn_model *a, const texsyn_model *b) {
    static saved s, t;
    save(a, &s);
    save(b, &t);
    assert_int_equal(s.size, t.size);
    assert_memory_equal(s.bytes, t.bytes, s.size);
}

static inline uint32_t crc32(const uint8_t *bytes, size_t count) {
    uint32_t crc = 0xffffffffu;
    for (size_t i = 0; i < count; i++) {
        crc ^= bytes[i];
        for (int k = 0; k < 8; k++) crc = crc & 1 ? crc >> 1 ^ 0xedb88320u : crc >> 1;
    }
    return ~crc;
}

static inline void repair_crc(uint8_t *bytes, size_t size) {
    const uint32_t crc = crc32(bytes, size - 4);
    for (int i = 0; i < 4; i++) bytes[size - 4 + (size_t)i] = (uint8_t)(crc >> 8 * i);
}

#endif /* SYNKIT_H */
