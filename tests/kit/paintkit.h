/* paintkit.h - what the tests of texinpaint.h as a whole share: pictures, masks, textured meshes
   SPDX-License-Identifier: MIT OR Unlicense

   Includes cmocka.h, texinpaint.h and testkit.h.                                              */
#ifndef PAINTKIT_H
#define PAINTKIT_H

#include <limits.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "texinpaint.h"

#include "images.h"
#include "testkit.h"

enum { SIDE = 64, PIXELS = SIDE * SIDE, MOST_CORNERS = 3 * 2000, FILL = 0x5c };

/* ---- pictures --------------------------------------------------------------------------------- */

static uint8_t picture[4 * PIXELS], mask[PIXELS], result[4 * PIXELS], other[4 * PIXELS];

static inline texinpaint_desc desc_of(void *pixels, int channels, txm_sample sample) {
    texinpaint_desc d;
    memset(&d, 0, sizeof d);
    d.image = view(pixels, SIDE, SIDE, channels, sample);
    d.mask = view(mask, SIDE, SIDE, 1, TXM_U8);
    d.seed = 1;
    return d;
}

static inline void complete(const texinpaint_desc *d, const txm_image *out) {
    txm_env env = {0};
    const txm_status status = texinpaint_complete(d, &env, out);
    if (status != TXM_OK) fail_msg("complete: %d, %s", status, env.message);
}

/* the same for one picture of 8 bits and this many channels */
static inline void complete_bytes(const texinpaint_desc *d, uint8_t *bytes) {
    const txm_image out = view(bytes, SIDE, SIDE, d->image.channels, TXM_U8);
    complete(d, &out);
}

static inline void no_mask(void) {
    memset(mask, 0, sizeof mask);
}

static inline void add_disk(int cx, int cy, int radius) {
    for (int i = 0; i < PIXELS; i++) {
        const int x = i % SIDE - cx, y = i / SIDE - cy;
        if (x * x + y * y < radius * radius) mask[i] = 255;
    }
}

static inline void disk(int cx, int cy, int radius) {
    no_mask();
    add_disk(cx, cy, radius);
}

/* slanted stripes with soft sides and a little grain, different in each channel */
static inline int stripe_at(int x, int y, int c) {
    const double p = (x + 0.5 * y) / 16 - floor((x + 0.5 * y) / 16), edge = fabs(p - 0.5) - 0.25;
    const double v = edge < -0.05 ? 0 : edge > 0.05 ? 1 : 0.5 + 10 * edge;
    return (int)(60 + 15 * c + v * (130 - 20 * c)) + at_random(x, y, c) % 7;
}

static inline void draw_stripes(uint8_t *pixels, int channels) {
    for (int i = 0; i < PIXELS * channels; i++)
        pixels[i] = (uint8_t)stripe_at(i / channels % SIDE, i / channels / SIDE, i % channels);
}

/* The mean difference from the truth in the hole, in levels of 8 bits. */
static inline double error_in_hole(const uint8_t *made, const uint8_t *truth, int channels) {
    double sum = 0;
    int n = 0;
    for (int i = 0; i < PIXELS * channels; i++) {
        if (!mask[i / channels]) continue;
        sum += abs(made[i] - truth[i]);
        n++;
    }
    return n ? sum / n : 0;
}

/* known pixels as they were */
static inline void check_known(const void *made, const void *from, size_t pixel) {
    for (size_t i = 0; i < PIXELS; i++) {
        if (!mask[i]) assert_memory_equal((const char *)made + i * pixel, (const char *)from + i * pixel, pixel);
    }
}

/* ---- meshes ------------------------------------------------------------------------------------- */

/* A mesh in the making; corners have their own places in the atlas. */
typedef struct surface {
    float at[3 * MOST_CORNERS], uv[2 * MOST_CORNERS];
    uint32_t vertex[MOST_CORNERS], entry[MOST_CORNERS];
    size_t vertices, entries, corners;
} surface;

static surface mesh;

static inline uint32_t add_vertex(double x, double y, double z) {
    assert_true(mesh.vertices < MOST_CORNERS);
    float *p = mesh.at + 3 * mesh.vertices;
    p[0] = (float)x;
    p[1] = (float)y;
    p[2] = (float)z;
    return (uint32_t)mesh.vertices++;
}

/* a corner of a triangle: vertex, and texels from the upper left corner of the texture */
static inline void add_corner(uint32_t vertex, double u, double v) {
    assert_true(mesh.corners < MOST_CORNERS);
    mesh.vertex[mesh.corners] = vertex;
    mesh.entry[mesh.corners++] = (uint32_t)mesh.entries;
    mesh.uv[2 * mesh.entries] = (float)(u / SIDE);
    mesh.uv[2 * mesh.entries++ + 1] = (float)(v / SIDE);
}

static inline void use_mesh(texinpaint_desc *d) {
    d->mesh.positions = mesh.at;
    d->mesh.vertex_count = mesh.vertices;
    d->mesh.indices = mesh.vertex;
    d->mesh.face_count = mesh.corners / 3;
    d->uv = mesh.uv;
    d->uv_count = mesh.entries;
    d->uv_indices = mesh.entry;
}

/* A grid of n x m squares: corner (i, j) has the vertex vertices[j (n + 1) + i] and lies in the atlas at
   the place + i / n * right + j / m * down, in texels. */
static inline void add_chart(const uint32_t *vertices, int n, int m, const double place[2],
                             const double right[2], const double down[2]) {
    static const int di[6] = {0, 0, 1, 0, 1, 1}, dj[6] = {0, 1, 1, 0, 1, 0};
    for (int k = 0; k < 6 * n * m; k++) {
        const int i = k / 6 % n + di[k % 6], j = k / 6 / n + dj[k % 6];
        const double a = (double)i / n, b = (double)j / m;
        add_corner(vertices[j * (n + 1) + i], place[0] + a * right[0] + b * down[0],
                   place[1] + a * right[1] + b * down[1]);
    }
}

/* vertices of a flat grid in the plane z = 0, from (x, y) on */
static inline void grid_vertices(uint32_t *vertices, int n, int m, double x, double y, double w, double h) {
    for (int k = 0; k < (n + 1) * (m + 1); k++)
        vertices[k] = add_vertex(x + w * (k % (n + 1)) / n, y + h * (k / (n + 1)) / m, 0);
}

/* A plane of 56 x 28 in two charts, cut in the middle: the left one upright from (2, 2) on, the right one
   below it, turned by 90 degrees. One texel is one unit. */
static inline void plane_of_two(void) {
    uint32_t v[2][25];
    const double left[2] = {2, 2}, right[2] = {2, 62}, x[2] = {28, 0}, y[2] = {0, 28}, up[2] = {0, -28};
    memset(&mesh, 0, sizeof mesh);
    grid_vertices(v[0], 4, 4, 0, 0, 28, 28);
    grid_vertices(v[1], 4, 4, 28, 0, 28, 28);
    add_chart(v[0], 4, 4, left, x, y);
    add_chart(v[1], 4, 4, right, up, x);
}

/* Where the centre of a texel lies on that plane; 0: in no chart. */
static inline int on_plane(int x, int y, double place[2]) {
    const double u = x + 0.5, v = y + 0.5;
    place[0] = u - 2;
    place[1] = v - 2;
    if (u >= 2 && u <= 30 && v >= 2 && v <= 30) return 1;
    place[0] = 28 + 62 - v;
    place[1] = u - 2;
    return u >= 2 && u <= 30 && v >= 34 && v <= 62;
}

/* Stripes on the plane, a hole about the middle of its cut; gutters are 9, masked ones too. */
static inline void draw_plane(uint8_t *pixels, double cx, double cy, double radius) {
    no_mask();
    for (int i = 0; i < PIXELS; i++) {
        double p[2];
        const int inside = on_plane(i % SIDE, i / SIDE, p);
        for (int c = 0; c < 3; c++)
            pixels[3 * i + c] = (uint8_t)(inside ? stripe_at((int)floor(p[0]), (int)floor(p[1]), c) : 9);
        const double dx = p[0] - cx, dy = p[1] - cy;
        mask[i] = dx * dx + dy * dy < radius * radius ? 255 : 0;
        if (!inside && i % SIDE < 32) mask[i] = 255; /* the gutters of both charts */
    }
}

#endif /* PAINTKIT_H */
