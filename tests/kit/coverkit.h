/* coverkit.h - meshes, places and patches made by the tests of trimesh_cover.h
   SPDX-License-Identifier: MIT OR Unlicense

   Include cmocka.h and trimesh_cover.h first.                                                    */
#ifndef COVERKIT_H
#define COVERKIT_H

#include "testkit.h"

/* ---- meshes ---- */

typedef struct shape {
    float *positions;
    uint32_t *indices;
    size_t vertices, triangles;
    txm_mesh view;
} shape;

static inline void shape_alloc(shape *s, size_t vertices, size_t triangles) {
    s->vertices = vertices;
    s->triangles = triangles;
    s->positions = (float *)calloc(vertices, 3 * sizeof(float));
    s->indices = (uint32_t *)calloc(triangles, 3 * sizeof(uint32_t));
    assert_true(s->positions && s->indices);
    memset(&s->view, 0, sizeof s->view);
    s->view.positions = s->positions;
    s->view.indices = s->indices;
    s->view.vertex_count = vertices;
    s->view.face_count = triangles;
}

static inline void shape_free(shape *s) {
    free(s->positions);
    free(s->indices);
}

static inline void put(shape *s, size_t v, double x, double y, double z) {
    s->positions[3 * v] = (float)x;
    s->positions[3 * v + 1] = (float)y;
    s->positions[3 * v + 2] = (float)z;
}

static inline void face(shape *s, size_t t, size_t a, size_t b, size_t c) {
    s->indices[3 * t] = (uint32_t)a;
    s->indices[3 * t + 1] = (uint32_t)b;
    s->indices[3 * t + 2] = (uint32_t)c;
}

/* columns x rows squares, each cut in two; wrap: a torus's connectivity */
static inline void grid_faces(shape *s, size_t columns, size_t rows, int wrap) {
    const size_t width = wrap ? columns : columns + 1, height = wrap ? rows : rows + 1;
    size_t t = 0;
    for (size_t y = 0; y < rows; y++) {
        for (size_t x = 0; x < columns; x++) {
            const size_t right = (x + 1) % width, up = (y + 1) % height;
            face(s, t++, y * width + x, y * width + right, up * width + x);
            face(s, t++, up * width + x, y * width + right, up * width + right);
        }
    }
}

/* A flat lattice of equilateral triangles of side 1, with borders. */
static inline void make_plane(shape *s, size_t columns, size_t rows) {
    shape_alloc(s, (columns + 1) * (rows + 1), 2 * columns * rows);
    for (size_t y = 0; y <= rows; y++) {
        for (size_t x = 0; x <= columns; x++)
            put(s, y * (columns + 1) + x, (double)x + 0.5 * (double)y, (double)y * sqrt(0.75), 0);
    }
    grid_faces(s, columns, rows, 0);
}

static inline void make_torus(shape *s, size_t columns, size_t rows, double thin) {
    shape_alloc(s, columns * rows, 2 * columns * rows);
    for (size_t y = 0; y < rows; y++) {
        for (size_t x = 0; x < columns; x++) {
            const double a = 2 * TXM_PI * (double)x / (double)columns;
            const double b = 2 * TXM_PI * (double)y / (double)rows, r = 1 + thin * cos(b);
            put(s, y * columns + x, r * cos(a), r * sin(a), thin * sin(b));
        }
    }
    grid_faces(s, columns, rows, 1);
}

/* An icosahedron, every face cut into steps^2, its points on the unit sphere. */
static inline void make_sphere(shape *s, size_t steps) {
    static const int faces[20][3] = {
        {0, 11, 5}, {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
        {11, 10, 2}, {10, 7, 6}, {7, 1, 8}, {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
        {3, 8, 9},  {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
    const double g = 0.5 * (1 + sqrt(5.0));
    const double at[12][3] = {{-1, g, 0}, {1, g, 0}, {-1, -g, 0}, {1, -g, 0},
                              {0, -1, g}, {0, 1, g}, {0, -1, -g}, {0, 1, -g},
                              {g, 0, -1}, {g, 0, 1}, {-g, 0, -1}, {-g, 0, 1}};
    const size_t n = steps, inside = n > 1 ? (n - 1) * (n - 2) / 2 : 0;
    size_t edges = 0, t = 0;
    int edge[30][2];
    shape_alloc(s, 10 * n * n + 2, 20 * n * n);
    for (size_t v = 0; v < 12; v++) put(s, v, at[v][0], at[v][1], at[v][2]);
    for (int f = 0; f < 60; f++) {
        const int a = faces[f / 3][f % 3], b = faces[f / 3][(f + 1) % 3];
        if (a > b) continue;
        edge[edges][0] = a;
        edge[edges++][1] = b;
    }
    for (size_t f = 0; f < 20; f++) {
        uint32_t *number = (uint32_t *)malloc((n + 1) * (n + 1) * sizeof(uint32_t));
        size_t next = 12 + 30 * (n - 1) + f * inside;
        assert_non_null(number);
        for (size_t j = 0; j <= n; j++) {
            for (size_t i = 0; i + j <= n; i++) {
                const size_t w[3] = {n - i - j, i, j};
                size_t v = 0, zero = 3;
                double p[3] = {0, 0, 0};
                for (size_t k = 0; k < 3; k++) {
                    for (size_t c = 0; c < 3; c++)
                        p[c] += (double)w[k] * at[faces[f][k]][c] / (double)n;
                    if (w[k] == 0) zero = k;
                }
                if (w[0] == n || w[1] == n || w[2] == n) {
                    v = (size_t)faces[f][w[0] == n ? 0 : w[1] == n ? 1 : 2];
                } else if (zero < 3) { /* on an edge: steps from its lower end */
                    const int a = faces[f][(zero + 1) % 3], b = faces[f][(zero + 2) % 3];
                    const size_t step = a < b ? w[(zero + 2) % 3] : w[(zero + 1) % 3];
                    size_t e = 0;
                    while (edge[e][0] != (a < b ? a : b) || edge[e][1] != (a < b ? b : a)) e++;
                    v = 12 + e * (n - 1) + step - 1;
                } else {
                    v = next++;
                }
                put(s, v, p[0], p[1], p[2]);
                number[j * (n + 1) + i] = (uint32_t)v;
            }
        }
        for (size_t j = 0; j < n; j++) {
            for (size_t i = 0; i + j < n; i++) {
                const uint32_t *q = number + j * (n + 1) + i;
                face(s, t++, q[0], q[1], q[n + 1]);
                if (i + j + 1 < n) face(s, t++, q[n + 1], q[1], q[n + 2]);
            }
        }
        free(number);
    }
    assert_int_equal(t, s->triangles);
    for (size_t v = 0; v < s->vertices; v++) {
        float *p = s->positions + 3 * v;
        const double r = sqrt((double)p[0] * p[0] + (double)p[1] * p[1] + (double)p[2] * p[2]);
        put(s, v, p[0] / r, p[1] / r, p[2] / r);
    }
}

static inline double dot3(const float *a, const float *b) {
    return (double)a[0] * b[0] + (double)a[1] * b[1] + (double)a[2] * b[2];
}

static inline double length3(const float *a) {
    return sqrt(dot3(a, a));
}

/* random sources on the input, as many as `count` */
static inline txm_mesh_place *random_places(const shape *s, size_t count) {
    txm_mesh_place *sources = (txm_mesh_place *)malloc(count * sizeof *sources);
    txm_rng rng = txm_rng_make(5, 5);
    assert_non_null(sources);
    for (size_t i = 0; i < count; i++) {
        float u = txm_rng_float(&rng), v = txm_rng_float(&rng);
        if (u + v > 1) {
            u = 1 - u;
            v = 1 - v;
        }
        sources[i].triangle = txm_rng_below(&rng, (uint32_t)s->triangles);
        sources[i].u = u;
        sources[i].v = v;
    }
    return sources;
}

/* A coarse plane over a fine one: its triangles, and the sources of its vertices. */
static inline txm_mesh_place *lay_over(const shape *fine, size_t columns, shape *coarse) {
    txm_mesh_place *sources;
    make_plane(coarse, 6, 6);
    sources = (txm_mesh_place *)malloc(coarse->vertices * sizeof *sources);
    for (size_t v = 0; v < coarse->vertices; v++) {
        /* lattice coordinates on the fine plane, on odd places */
        const double y = 1.31 + 2.9 * (double)(v / 7), x = 1.77 + 2.9 * (double)(v % 7);
        const size_t i = (size_t)x, j = (size_t)y;
        const double fx = x - (double)i, fy = y - (double)j;
        const int upper = fx + fy > 1;
        sources[v].triangle = (uint32_t)(2 * (j * columns + i) + (size_t)upper);
        /* lower: corners (0,0), (1,0), (0,1); upper: (0,1), (1,0), (1,1) */
        sources[v].u = (float)(upper ? 1 - fy : fx);
        sources[v].v = (float)(upper ? fx + fy - 1 : fy);
        put(coarse, v, x + 0.5 * y, y * sqrt(0.75), 0);
    }
    assert_true(fine->triangles >= 2 * columns * 19);
    return sources;
}

static inline void make_patch(int points, int hexagonal, uint64_t seed, trimesh_patch *patch) {
    trimesh_patch_desc d = {points, hexagonal, 0, seed};
    size_t count = 0;
    assert_int_equal(trimesh_reference_patch(&d, NULL, NULL, 0, &count), TXM_OK);
    trimesh_point *p = (trimesh_point *)malloc(count * sizeof *p);
    assert_int_equal(trimesh_reference_patch(&d, NULL, p, count, &patch->count), TXM_OK);
    assert_int_equal(count, patch->count);
    patch->points = p;
}

static inline trimesh_instance *scatter(const trimesh_scatter_desc *d, txm_env *env, size_t *count) {
    trimesh_instance *out;
    assert_int_equal(trimesh_scatter(d, env, NULL, 0, count), TXM_OK);
    out = (trimesh_instance *)malloc((*count + 1) * sizeof *out);
    assert_int_equal(trimesh_scatter(d, env, out, *count, count), TXM_OK);
    return out;
}

#endif /* COVERKIT_H */
