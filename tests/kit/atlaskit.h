/* atlaskit.h - what the tests of atlases and of the drawn plane share: sets of numbered pixels
   SPDX-License-Identifier: MIT OR Unlicense

   Includes cmocka.h, textiles.h and testkit.h. Most sets here are of pictures whose pixels say which
   they are: (tile, x, y) as floats. So every pixel of an atlas can be asked where it comes from. */
#ifndef ATLASKIT_H
#define ATLASKIT_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "textiles.h"

#include "testkit.h"

/* ---- helpers ---------------------------------------------------------------------------- */

enum { N = 32, FILL = 0x5c };

static inline void assert_near(double a, double b, double tolerance) {
    if (!(fabs(a - b) <= tolerance)) fail_msg("%.9g is not %.9g within %g", a, b, tolerance);
}

typedef struct kind_of {
    textiles_kind kind;
    int colors, variants, reduced, count;
} kind_of;

static const kind_of kinds[] = {
    {TEXTILES_WANG, 2, 1, 0, 16},     {TEXTILES_WANG, 2, 2, 0, 32},
    {TEXTILES_WANG, 3, 1, 0, 81},     {TEXTILES_WANG, 2, 3, 1, 24},
    {TEXTILES_CORNER, 2, 1, 0, 16},   {TEXTILES_CORNER, 2, 3, 0, 48},
    {TEXTILES_CORNER, 3, 1, 0, 81},   {TEXTILES_TRIANGLE, 2, 1, 0, 24},
    {TEXTILES_TRIANGLE, 2, 3, 0, 72}, {TEXTILES_TRIANGLE, 3, 1, 0, 76},
    {TEXTILES_TRIANGLE, 2, 1, 1, 16}, {TEXTILES_FRAME, 3, 1, 0, 3},
    {TEXTILES_FRAME, 2, 2, 0, 4},
};
enum { KINDS = sizeof kinds / sizeof kinds[0] };

static inline textiles_desc desc_of(const kind_of *k, int size) {
    textiles_desc d;
    memset(&d, 0, sizeof d);
    d.kind = k->kind;
    d.size = size;
    d.colors = k->colors;
    d.variants = k->variants;
    d.reduced = k->reduced;
    return d;
}

/* Import pictures: map 0 is (tile, x, y) in floats, map 1 random bytes of 4 channels. */
static inline textiles_set *import_desc(const textiles_desc *d, int count) {
    const int side = d->size + (d->kind == TEXTILES_TRIANGLE);
    const size_t texels = (size_t)side * (size_t)side;
    txm_image *maps = (txm_image *)calloc((size_t)count * 2, sizeof *maps);
    float *where = (float *)malloc((size_t)count * texels * 3 * sizeof *where);
    uint8_t *bytes = (uint8_t *)malloc((size_t)count * texels * 4);
    assert_true(maps && where && bytes);
    txm_rng rng = txm_rng_make(5, 5);
    for (size_t i = 0; i < (size_t)count * texels * 4; i++) bytes[i] = (uint8_t)txm_rng_next(&rng);
    for (int t = 0; t < count; t++) {
        float *p = where + (size_t)t * texels * 3;
        for (int m = 0; m < 2; m++) {
            maps[2 * t + m].width = maps[2 * t + m].height = side;
            maps[2 * t + m].channels = 3 + m;
        }
        maps[2 * t].pixels = p;
        maps[2 * t].sample = TXM_F32;
        maps[2 * t + 1].pixels = bytes + (size_t)t * texels * 4;
        for (int y = 0; y < side; y++) {
            for (int x = 0; x < side; x++) {
                *p++ = (float)t;
                *p++ = (float)x;
                *p++ = (float)y;
            }
        }
    }
    textiles_set *set = NULL;
    txm_env env = {0};
    const txm_status status = textiles_import(d, maps, count, 2, &env, &set);
    if (status != TXM_OK) fail_msg("import: %d, %s", status, env.message);
    free(maps);
    free(where);
    free(bytes);
    return set;
}

static inline textiles_set *import(const kind_of *k, int size) {
    const textiles_desc d = desc_of(k, size);
    return import_desc(&d, k->count);
}

/* a refusal, with a message */
#define refused(call)                                                                              \
    do {                                                                                           \
        txm_env env = {0};                                                                         \
        assert_int_equal(call, TXM_BAD_ARGUMENT);                                                  \
        assert_true(strlen(env.message) > 10);                                                     \
    } while (0)

static inline txm_image picture(int width, int height, int channels, txm_sample sample) {
    txm_image im;
    memset(&im, 0, sizeof im);
    im.width = width;
    im.height = height;
    im.channels = channels;
    im.sample = sample;
    const size_t bytes = (size_t)width * (size_t)height * (size_t)channels * txm_sample_bytes(sample);
    im.pixels = malloc(bytes);
    assert_non_null(im.pixels);
    memset(im.pixels, FILL, bytes);
    return im;
}

/* the bytes of a packed picture */
static inline size_t bytes_of(const txm_image *im) {
    return (size_t)im->width * (size_t)im->height * (size_t)im->channels *
           txm_sample_bytes(im->sample);
}

static inline int untouched(const txm_image *im) {
    const uint8_t *p = (const uint8_t *)im->pixels;
    for (size_t i = 0; i < bytes_of(im); i++) {
        if (p[i] != FILL) return 0;
    }
    return 1;
}

static inline textiles_layout lay_out(const textiles_set *set, textiles_packing packing, int gutter) {
    textiles_layout l;
    txm_env env = {0};
    const txm_status status = textiles_layout_make(set, packing, gutter, &env, &l);
    if (status != TXM_OK) fail_msg("layout: %d, %s", status, env.message);
    return l;
}

static inline txm_image atlas_of(const textiles_set *set, const textiles_layout *l, int map) {
    txm_image im = picture(l->width, l->height, map ? 4 : 3, map ? TXM_U8 : TXM_F32);
    txm_env env = {0};
    const txm_status status = textiles_draw_atlas(set, l, map, &env, im);
    if (status != TXM_OK) fail_msg("atlas: %d, %s", status, env.message);
    return im;
}

/* which pixel of which tile (x, y) of a picture shows */
typedef struct where {
    int tile, x, y;
} where;

static inline where look(const txm_image *im, int x, int y) {
    const float *p = (const float *)txm_image_row_const(im, y) + 3 * x;
    const where w = {(int)p[0], (int)p[1], (int)p[2]};
    assert_true((float)w.tile == p[0] && (float)w.x == p[1] && (float)w.y == p[2]);
    return w;
}

static inline int torus_allowed(const kind_of *k) {
    return !k->reduced && (k->kind == TEXTILES_WANG || k->kind == TEXTILES_CORNER);
}

/* Is u right of t, or below it, as it should be? By the rules of the declaration. */
static inline int matches(const textiles_set *set, int t, int u, int down) {
    textiles_tile a, b;
    assert_true(textiles_tile_at(set, t, &a) && textiles_tile_at(set, u, &b));
    if (textiles_kind_of(set) == TEXTILES_CORNER) {
        return down ? a.edges[3] == b.edges[0] && a.edges[2] == b.edges[1]
                    : a.edges[1] == b.edges[0] && a.edges[2] == b.edges[3];
    }
    return down ? a.edges[2] == b.edges[0] : a.edges[1] == b.edges[3];
}

#endif /* ATLASKIT_H */
