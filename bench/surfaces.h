/* surfaces.h - surfaces that the benchmarks retile
   SPDX-License-Identifier: MIT OR Unlicense */
#ifndef SURFACES_H
#define SURFACES_H

#include "bench.h"

/* ---- surfaces ------------------------------------------------------------------------------ */

typedef struct surface {
    const char *name;
    float *positions;
    uint32_t *indices;
    txm_mesh view;
} surface;

static inline void make_room(surface *s, size_t vertices, size_t triangles) {
    s->positions = (float *)malloc(3 * vertices * sizeof(float));
    s->indices = (uint32_t *)malloc(3 * triangles * sizeof(uint32_t));
    if (!s->positions || !s->indices) give_up(s->name, "out of memory");
    memset(&s->view, 0, sizeof s->view);
    s->view.positions = s->positions;
    s->view.indices = s->indices;
    s->view.vertex_count = vertices;
    s->view.face_count = triangles;
}

static inline void put_triangle(uint32_t **to, size_t a, size_t b, size_t c) {
    (*to)[0] = (uint32_t)a;
    (*to)[1] = (uint32_t)b;
    (*to)[2] = (uint32_t)c;
    *to += 3;
}

/* A torus of n * m vertices. */
static inline surface make_torus(size_t n, size_t m) {
    surface s;
    s.name = "torus";
    make_room(&s, n * m, 2 * n * m);
    float *p = s.positions;
    uint32_t *t = s.indices;
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < m; j++) {
            const double u = 2 * TXM_PI * (double)i / (double)n;
            const double v = 2 * TXM_PI * (double)j / (double)m;
            *p++ = (float)((1 + 0.4 * cos(v)) * cos(u));
            *p++ = (float)((1 + 0.4 * cos(v)) * sin(u));
            *p++ = (float)(0.4 * sin(v));
            const size_t i1 = (i + 1) % n, j1 = (j + 1) % m;
            put_triangle(&t, i * m + j, i1 * m + j, i1 * m + j1);
            put_triangle(&t, i * m + j, i1 * m + j1, i * m + j1);
        }
    }
    return s;
}

/* A ball of n circles of 2 n vertices and two poles, with soft bumps. */
static inline surface make_ball(size_t n) {
    const size_t m = 2 * n, south = n * m, north = south + 1;
    surface s;
    s.name = "bumpy ball";
    make_room(&s, n * m + 2, 2 * n * m);
    float *p = s.positions;
    uint32_t *t = s.indices;
    for (size_t i = 0; i <= n * m + 1; i++) {
        const size_t ring = i / m + 1;
        const double v = i == south   ? -TXM_PI / 2
                         : i == north ? TXM_PI / 2
                                      : TXM_PI * ((double)ring / (double)(n + 1) - 0.5);
        const double u = i < south ? 2 * TXM_PI * (double)(i % m) / (double)m : 0;
        const double x = cos(u) * cos(v), y = sin(u) * cos(v), z = sin(v);
        const double r = 1 + 0.06 * (sin(7 * x) + sin(8 * y) + sin(6 * z));
        *p++ = (float)(r * x);
        *p++ = (float)(r * y);
        *p++ = (float)(r * z);
    }
    for (size_t j = 0; j < m; j++) {
        const size_t j1 = (j + 1) % m;
        put_triangle(&t, south, j1, j);
        for (size_t i = 0; i + 1 < n; i++) {
            put_triangle(&t, i * m + j, i * m + j1, (i + 1) * m + j1);
            put_triangle(&t, i * m + j, (i + 1) * m + j1, (i + 1) * m + j);
        }
        put_triangle(&t, north, (n - 1) * m + j, (n - 1) * m + j1);
    }
    return s;
}

static inline void free_surface(surface *s) {
    free(s->positions);
    free(s->indices);
}

#endif /* SURFACES_H */
