/* edgekit.h - what the tests of edges and strokes share: pictures, layers, strokes
   SPDX-License-Identifier: MIT OR Unlicense

   Includes cmocka.h, texedges.h and testkit.h.                                                */
#ifndef EDGEKIT_H
#define EDGEKIT_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <limits.h>
#include <stdint.h>

#include <cmocka.h>

#include "texedges.h"

#include "images.h"
#include "testkit.h"

/* ---- helpers ---------------------------------------------------------------------------- */

enum { SIDE = 256, FILL = 0x5c };

static inline txm_image gray(uint8_t *pixels, int width, int height) {
    return view(pixels, width, height, 1, TXM_U8);
}

/* thresholds for pictures whose gray is the number of the layer */
static const float by_number[15] = {0.5f / 255,  1.5f / 255,  2.5f / 255,  3.5f / 255,
                                    4.5f / 255,  5.5f / 255,  6.5f / 255,  7.5f / 255,
                                    8.5f / 255,  9.5f / 255,  10.5f / 255, 11.5f / 255,
                                    12.5f / 255, 13.5f / 255, 14.5f / 255};

static inline texedges_desc desc_of(txm_image image, int levels, const float *thresholds) {
    texedges_desc d;
    memset(&d, 0, sizeof d);
    d.image = image;
    d.levels = levels;
    d.thresholds = thresholds;
    return d;
}

static inline texedges_set *find(const texedges_desc *desc) {
    txm_env env = {0};
    texedges_set *e = NULL;
    const txm_status status = texedges_find(desc, &env, &e);
    if (status != TXM_OK) fail_msg("find: %d, %s", status, env.message);
    return e;
}

/* edges of a picture that holds the numbers of its layers */
static inline texedges_set *find_numbers(uint8_t *pixels, int width, int height, int levels) {
    const texedges_desc d = desc_of(gray(pixels, width, height), levels, by_number);
    return find(&d);
}

static inline double area_of(const texedges_set *e, const texedges_polyline *line) {
    double sum = 0;
    for (size_t j = 0; j < line->count; j++) {
        const txm_vec2 p = e->points[line->first + j];
        const txm_vec2 q = e->points[line->first + (j + 1) % line->count];
        sum += (double)p.x * q.y - (double)q.x * p.y;
    }
    return sum / 2;
}

/* ---- pictures --------------------------------------------------------------------------- */

/* smooth noise, 0..1: a lattice of this many pixels, interpolated */
static inline double noise(uint64_t seed, double pitch, int x, int y) {
    const int i = (int)(x / pitch), j = (int)(y / pitch);
    double corner[4], u = x / pitch - i, v = y / pitch - j;
    for (int k = 0; k < 4; k++) {
        const uint64_t at = (uint64_t)(i + k % 2) * 1000 + (uint64_t)(j + k / 2);
        corner[k] = (double)(txm_hash(txm_hash(at + 1) + seed) >> 11) / 9007199254740992.0;
    }
    u *= u * (3 - 2 * u);
    v *= v * (3 - 2 * v);
    return (corner[0] * (1 - u) + corner[1] * u) * (1 - v) +
           (corner[2] * (1 - u) + corner[3] * u) * v;
}

/* blobs with rough borders */
static inline void draw_blobs(uint8_t *pixels, int side, uint64_t seed, double rough) {
    for (int y = 0; y < side; y++) {
        for (int x = 0; x < side; x++) {
            const double g = noise(seed, 48, x, y) + rough * (noise(seed + 1, 11, x, y) - 0.5) +
                             0.5 * rough * (noise(seed + 2, 5, x, y) - 0.5);
            pixels[y * side + x] = (uint8_t)(255 * (g < 0 ? 0 : g > 1 ? 1 : g));
        }
    }
}

static inline int is_untouched(const void *bytes, size_t count) {
    const unsigned char *p = (const unsigned char *)bytes;
    for (size_t i = 0; i < count; i++) {
        if (p[i] != FILL) return 0;
    }
    return 1;
}

/* ---- strokes ---------------------------------------------------------------------------- */

enum { CIRCLE = 400, WIDE = 512 };

/* A circle, a clover, a wave: gentle strokes of this layer. */
static inline int draw_strokes(texedges_stroke strokes[3], int layer) {
    static txm_vec2 circle[CIRCLE], clover[CIRCLE], wave[CIRCLE];
    for (int i = 0; i < CIRCLE; i++) {
        const double a = 2 * TXM_PI * i / CIRCLE, r = 95 + 22 * sin(3 * a), t = i / (CIRCLE - 1.0);
        circle[i] = txm_v2((float)(150 + 110 * cos(a)), (float)(150 + 110 * sin(a)));
        clover[i] = txm_v2((float)(380 + r * cos(a)), (float)(160 + r * sin(a)));
        wave[i] = txm_v2((float)(40 + 430 * t), (float)(390 + 60 * sin(7 * t)));
    }
    memset(strokes, 0, 3 * sizeof *strokes);
    for (int i = 0; i < 3; i++) {
        strokes[i].points = i == 0 ? circle : i == 1 ? clover : wave;
        strokes[i].count = CIRCLE;
        strokes[i].is_closed = i < 2;
        strokes[i].layer = layer;
        strokes[i].width = 24;
    }
    return 3;
}

static inline texedges_control control_of(const texedges_set *edges, const texedges_stroke *strokes,
                                          int count) {
    texedges_control c;
    memset(&c, 0, sizeof c);
    c.edges = edges;
    c.strokes = strokes;
    c.stroke_count = count;
    return c;
}

static inline texedges_set *disturb(const texedges_control *control, int width, int height) {
    txm_env env = {0};
    texedges_set *e = NULL;
    const txm_status status = texedges_disturb(control, width, height, &env, &e);
    if (status != TXM_OK) fail_msg("disturb: %d, %s", status, env.message);
    return e;
}

static inline void guide_of(const texedges_control *control, const texedges_set *lines,
                            uint8_t *guide, uint8_t *mask) {
    txm_env env = {0};
    const txm_image g = gray(guide, lines->width, lines->height);
    const txm_image m = gray(mask, lines->width, lines->height);
    const txm_status status = texedges_guide(control, lines, &env, &g, &m);
    if (status != TXM_OK) fail_msg("guide: %d, %s", status, env.message);
}

#endif /* EDGEKIT_H */
