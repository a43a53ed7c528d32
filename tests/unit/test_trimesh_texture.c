/* test_trimesh_texture.c - trimesh_relax.h: attributes, texturing and geometry on triangles
   SPDX-License-Identifier: MIT OR Unlicense

   On meshes made here, so that nothing of the retiling itself matters.                          */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#define TRIMESH_COVER_IMPLEMENTATION
#include "trimesh_cover.h"
#define TEXTILES_IMPLEMENTATION
#include "textiles.h"
#include "testkit.h"

/* ---- meshes ---- */

typedef struct shape {
    float *positions;
    uint32_t *indices;
    size_t vertices, triangles;
    txm_mesh view;
} shape;

static void shape_alloc(shape *s, size_t vertices, size_t triangles) {
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

static void shape_free(shape *s) {
    free(s->positions);
    free(s->indices);
}

static void put(shape *s, size_t v, double x, double y, double z) {
    s->positions[3 * v] = (float)x;
    s->positions[3 * v + 1] = (float)y;
    s->positions[3 * v + 2] = (float)z;
}

static void face(shape *s, size_t t, size_t a, size_t b, size_t c) {
    s->indices[3 * t] = (uint32_t)a;
    s->indices[3 * t + 1] = (uint32_t)b;
    s->indices[3 * t + 2] = (uint32_t)c;
}

/* columns x rows squares, each cut in two; wrap: a torus's connectivity */
static void grid_faces(shape *s, size_t columns, size_t rows, int wrap) {
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
static void make_plane(shape *s, size_t columns, size_t rows) {
    shape_alloc(s, (columns + 1) * (rows + 1), 2 * columns * rows);
    for (size_t y = 0; y <= rows; y++) {
        for (size_t x = 0; x <= columns; x++)
            put(s, y * (columns + 1) + x, (double)x + 0.5 * (double)y, (double)y * sqrt(0.75), 0);
    }
    grid_faces(s, columns, rows, 0);
}

static void make_torus(shape *s, size_t columns, size_t rows, double thin) {
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
static void make_sphere(shape *s, size_t steps) {
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

static double dot3(const float *a, const float *b) {
    return (double)a[0] * b[0] + (double)a[1] * b[1] + (double)a[2] * b[2];
}

static double length3(const float *a) {
    return sqrt(dot3(a, a));
}

/* ---- attributes ---- */

static void test_normals(void **state) {
    shape s;
    (void)state;
    make_sphere(&s, 7);
    float *n = (float *)malloc(3 * s.vertices * sizeof(float));
    assert_int_equal(trimesh_normals(&s.view, NULL, n), TXM_OK);
    for (size_t i = 0; i < 3 * s.vertices; i++) assert_float_equal(n[i], s.positions[i], 1e-6);
    free(n);
    shape_free(&s);
}

/* random sources on the input, as many as `count` */
static txm_mesh_place *strew(const shape *s, size_t count) {
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

static void test_transfer(void **state) {
    enum { COUNT = 3000 };
    shape s;
    (void)state;
    make_plane(&s, 20, 10);
    txm_mesh_place *sources = strew(&s, COUNT);
    /* a linear function of the place, once per vertex and once per corner */
    float *value = (float *)malloc(2 * s.vertices * sizeof(float));
    float *out = (float *)malloc(4 * COUNT * sizeof(float));
    for (size_t v = 0; v < s.vertices; v++) {
        value[2 * v] = 3 * s.positions[3 * v] - 2 * s.positions[3 * v + 1] + 7;
        value[2 * v + 1] = 0.25f;
    }
    trimesh_values values = {value, s.vertices, NULL, 2};
    assert_int_equal(trimesh_transfer(&s.view, &values, sources, COUNT, NULL, out), TXM_OK);
    values.indices = s.indices;
    assert_int_equal(trimesh_transfer(&s.view, &values, sources, COUNT, NULL, out + 2 * COUNT),
                     TXM_OK);
    assert_memory_equal(out, out + 2 * COUNT, 2 * COUNT * sizeof(float));
    for (size_t i = 0; i < COUNT; i++) {
        const uint32_t *c = s.indices + 3 * sources[i].triangle;
        const double u = sources[i].u, v = sources[i].v;
        double p[2];
        for (size_t k = 0; k < 2; k++)
            p[k] = (1 - u - v) * s.positions[3 * c[0] + k] + u * s.positions[3 * c[1] + k] +
                   v * s.positions[3 * c[2] + k];
        assert_float_equal(out[2 * i], 3 * p[0] - 2 * p[1] + 7, 1e-5);
        assert_true(out[2 * i + 1] == 0.25f);
    }
    values.channels = 0;
    assert_int_equal(trimesh_transfer(&s.view, &values, sources, COUNT, NULL, out),
                     TXM_BAD_ARGUMENT);
    values.channels = 2;
    values.count--;
    assert_int_equal(trimesh_transfer(&s.view, &values, sources, COUNT, NULL, out),
                     TXM_BAD_ARGUMENT);
    values.count++;
    sources[5].triangle = (uint32_t)s.triangles;
    assert_int_equal(trimesh_transfer(&s.view, &values, sources, COUNT, NULL, out),
                     TXM_BAD_ARGUMENT);
    sources[5].triangle = 0;
    sources[5].u = 0.8f;
    sources[5].v = 0.8f;
    assert_int_equal(trimesh_transfer(&s.view, &values, sources, COUNT, NULL, out),
                     TXM_BAD_ARGUMENT);
    free(value);
    free(out);
    free(sources);
    shape_free(&s);
}

/* A coarse plane over a fine one: its triangles, and the sources of its vertices. */
static txm_mesh_place *lay_over(const shape *fine, size_t columns, shape *coarse) {
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

static void test_transfer_corners(void **state) {
    enum { COLUMNS = 24 };
    shape fine, coarse;
    (void)state;
    make_plane(&fine, COLUMNS, COLUMNS);
    txm_mesh_place *sources = lay_over(&fine, COLUMNS, &coarse);
    const size_t corners = 3 * coarse.triangles;
    float *out = (float *)malloc(2 * corners * sizeof(float));
    float *value = (float *)malloc(4 * fine.vertices * sizeof(float));
    uint32_t *entry = (uint32_t *)malloc(3 * fine.triangles * sizeof(uint32_t));
    trimesh_values values = {value, fine.vertices, NULL, 2};
    for (size_t v = 0; v < fine.vertices; v++) {
        for (size_t k = 0; k < 2; k++) {
            value[2 * v + k] = fine.positions[3 * v + k];
            value[2 * (fine.vertices + v) + k] = fine.positions[3 * v + k] + 1000;
        }
    }
    /* no seams: linear functions are exact */
    assert_int_equal(trimesh_transfer_corners(&fine.view, &values, &coarse.view, sources, NULL, out),
                     TXM_OK);
    for (size_t c = 0; c < corners; c++) {
        for (size_t k = 0; k < 2; k++)
            assert_float_equal(out[2 * c + k], coarse.positions[3 * coarse.indices[c] + k], 1e-4);
    }
    /* a seam along lattice column 10: the right half has values 1000 larger */
    for (size_t c = 0; c < 3 * fine.triangles; c++) {
        const size_t column = c / 6 % COLUMNS;
        entry[c] = fine.indices[c] + (uint32_t)(column >= 10 ? fine.vertices : 0);
    }
    values.indices = entry;
    values.count = 2 * fine.vertices;
    assert_int_equal(trimesh_transfer_corners(&fine.view, &values, &coarse.view, sources, NULL, out),
                     TXM_OK);
    int clamped = 0, charts[2] = {0, 0};
    for (size_t t = 0; t < coarse.triangles; t++) {
        const int chart = out[6 * t] > 500;
        double middle = 0; /* column of the middle */
        for (size_t c = 3 * t; c < 3 * t + 3; c++) {
            const float *p = coarse.positions + 3 * coarse.indices[c];
            middle += (p[0] - p[1] / sqrt(3.0)) / 3;
        }
        assert_int_equal(chart, middle >= 10);
        charts[chart]++;
        for (size_t c = 3 * t; c < 3 * t + 3; c++) {
            const float *p = coarse.positions + 3 * coarse.indices[c];
            const double x = out[2 * c] - (chart ? 1000 : 0), y = out[2 * c + 1] - (chart ? 1000 : 0);
            const double column = p[0] - p[1] / sqrt(3.0);
            assert_int_equal(out[2 * c] > 500, chart); /* one chart per triangle */
            if (chart ? column >= 10 : column <= 10) { /* on its own side: exact */
                assert_float_equal(x, p[0], 2e-4);
                assert_float_equal(y, p[1], 2e-4);
            } else { /* beyond: on the seam */
                assert_float_equal(x - y / sqrt(3.0), 10, 2e-4);
                clamped++;
            }
        }
    }
    assert_true(clamped > 3 && charts[0] > 10 && charts[1] > 10);
    /* a mesh that is cut along the seam, as in glTF: the same */
    shape cut;
    float *again = (float *)malloc(2 * corners * sizeof(float));
    shape_alloc(&cut, 2 * fine.vertices, fine.triangles);
    memcpy(cut.positions, fine.positions, 3 * fine.vertices * sizeof(float));
    memcpy(cut.positions + 3 * fine.vertices, fine.positions, 3 * fine.vertices * sizeof(float));
    memcpy(cut.indices, entry, 3 * fine.triangles * sizeof(uint32_t));
    values.indices = NULL;
    assert_int_equal(trimesh_transfer_corners(&cut.view, &values, &coarse.view, sources, NULL, again),
                     TXM_OK);
    assert_memory_equal(out, again, 2 * corners * sizeof(float));
    shape_free(&cut);
    free(again);
    free(entry);
    free(value);
    free(out);
    free(sources);
    shape_free(&coarse);
    shape_free(&fine);
}

/* The input retiled by itself: every source lies in a corner of a triangle, the hardest place. */
static void test_transfer_identity(void **state) {
    shape s;
    (void)state;
    make_sphere(&s, 6);
    txm_mesh_place *sources = (txm_mesh_place *)malloc(s.vertices * sizeof *sources);
    float *out = (float *)malloc(9 * s.triangles * sizeof(float));
    for (size_t i = 0; i < 3 * s.triangles; i++) {
        txm_mesh_place *o = &sources[s.indices[i]];
        o->triangle = (uint32_t)(i / 3);
        o->u = i % 3 == 1;
        o->v = i % 3 == 2;
    }
    const trimesh_values values = {s.positions, s.vertices, NULL, 3};
    assert_int_equal(trimesh_transfer_corners(&s.view, &values, &s.view, sources, NULL, out), TXM_OK);
    for (size_t i = 0; i < 3 * s.triangles; i++) {
        for (size_t k = 0; k < 3; k++)
            assert_float_equal(out[3 * i + k], s.positions[3 * s.indices[i] + k], 1e-5);
    }
    free(out);
    free(sources);
    shape_free(&s);
}

static void test_split(void **state) {
    shape s;
    (void)state;
    make_torus(&s, 12, 8, 0.4);
    const size_t n = 3 * s.triangles;
    float *uv = (float *)malloc(2 * n * sizeof(float));
    uint32_t *indices = (uint32_t *)malloc(n * sizeof *indices);
    uint32_t *corners = (uint32_t *)malloc(n * sizeof *corners);
    size_t count = 0, again = 0;
    for (size_t c = 0; c < n; c++) { /* equal everywhere: nothing is doubled */
        uv[2 * c] = (float)s.indices[c];
        uv[2 * c + 1] = c % 2 ? 0.0f : -0.0f;
    }
    assert_int_equal(trimesh_split_corners(&s.view, uv, 2, NULL, indices, corners, &count), TXM_OK);
    assert_int_equal(count, s.vertices);
    for (size_t c = 0; c < n; c++) assert_int_equal(indices[c], s.indices[c]);
    for (size_t c = 0; c < n; c++) uv[2 * c + 1] = (float)(c / 3 % 5); /* five charts */
    assert_int_equal(trimesh_split_corners(&s.view, uv, 2, NULL, NULL, NULL, &again), TXM_OK);
    assert_int_equal(trimesh_split_corners(&s.view, uv, 2, NULL, indices, corners, &count), TXM_OK);
    assert_int_equal(count, again);
    assert_true(count > s.vertices && count <= n);
    uint32_t last = 0;
    for (size_t i = 0; i < count; i++) {
        assert_true(s.indices[corners[i]] >= last);
        last = s.indices[corners[i]];
    }
    for (size_t c = 0; c < n; c++) {
        assert_true(indices[c] < count);
        assert_int_equal(s.indices[corners[indices[c]]], s.indices[c]);
        assert_memory_equal(uv + 2 * corners[indices[c]], uv + 2 * c, 2 * sizeof(float));
    }
    /* and no more than needed: pairs (vertex, value) are all different */
    for (size_t i = 1; i < count; i++) {
        for (size_t k = 0; k < i; k++) {
            if (s.indices[corners[i]] == s.indices[corners[k]])
                assert_true(memcmp(uv + 2 * corners[i], uv + 2 * corners[k], 2 * sizeof(float)) != 0);
        }
    }
    free(uv);
    free(indices);
    free(corners);
    shape_free(&s);
}

/* ---- texturing ---- */

static void test_atlas(void **state) {
    trimesh_atlas a;
    float uv[24], one[6];
    (void)state;
    assert_int_equal(trimesh_atlas_make(0, 100, -1, NULL, &a), TXM_OK);
    assert_int_equal(a.count, 4);
    assert_int_equal(a.width, 4 * 116);
    assert_int_equal(a.height, 87 + 16);
    assert_true(trimesh_atlas_uv(&a, -1, uv));
    for (int p = 0; p < 4; p++) {
        assert_true(trimesh_atlas_uv(&a, p, one));
        assert_memory_equal(one, uv + 6 * p, sizeof one);
        for (int k = 0; k < 3; k++) { /* equilateral, in its cell, the gutter kept */
            const int n = (k + 1) % 3;
            const double x = one[2 * k] * a.width, y = one[2 * k + 1] * a.height;
            const double dx = one[2 * n] * a.width - x, dy = one[2 * n + 1] * a.height - y;
            assert_float_equal(sqrt(dx * dx + dy * dy), 100, 1e-3);
            assert_true(x > p * 116 + 7.99 && x < p * 116 + 108.01 && y > 7.99 && y < 95.01);
        }
        /* counter-clockwise as seen, v downwards */
        assert_true((one[2] - one[0]) * (one[5] - one[1]) < 0);
    }
    assert_false(trimesh_atlas_uv(&a, 4, uv));
    assert_int_equal(trimesh_atlas_make(257, 0, 0, NULL, &a), TXM_BAD_ARGUMENT);
    assert_int_equal(trimesh_atlas_make(1, 1, 0, NULL, &a), TXM_BAD_ARGUMENT);
    assert_int_equal(trimesh_atlas_make(1, 100, 101, NULL, &a), TXM_BAD_ARGUMENT);
}

/* pairs of triangles at an edge with equal patch, and with equal patch and rotation */
static void count_equal(const shape *s, const int *patch, const int *rotation, int equal[2]) {
    uint32_t *next = (uint32_t *)malloc(3 * s->triangles * sizeof *next);
    assert_true(tmc_link(&s->view, next, NULL));
    equal[0] = equal[1] = 0;
    for (size_t i = 0; i < 3 * s->triangles; i++) {
        if (next[i] <= i) continue;
        const size_t t = i / 3, other = next[i] / 3;
        equal[0] += patch[t] == patch[other];
        equal[1] += patch[t] == patch[other] && rotation[t] == rotation[other];
    }
    free(next);
}

static void test_choose(void **state) {
    static const int wanted[4] = {4, 2, 1, 3};
    shape s;
    int equal[2];
    (void)state;
    make_sphere(&s, 20);
    int *patch = (int *)malloc(s.triangles * sizeof(int));
    int *rotation = (int *)malloc(s.triangles * sizeof(int));
    int *again = (int *)malloc(s.triangles * sizeof(int));
    for (int i = 0; i < 4; i++) {
        trimesh_choose_desc d = {wanted[i], 0, 0, 7};
        int used[4] = {0, 0, 0, 0};
        assert_int_equal(trimesh_choose(&s.view, &d, NULL, patch, rotation), TXM_OK);
        count_equal(&s, patch, rotation, equal);
        assert_true(equal[1] <= (d.patches == 1)); /* the last triangle alone may fail */
        if (d.patches >= 4) assert_int_equal(equal[0], 0);
        for (size_t t = 0; t < s.triangles; t++) {
            assert_in_range(rotation[t], 0, 2);
            assert_in_range(patch[t], 0, d.patches - 1);
            used[patch[t]]++;
        }
        for (int p = 0; p < d.patches; p++) /* all about equally often */
            assert_true(fabs((double)used[p] * d.patches / (double)s.triangles - 1) < 0.2);
        assert_int_equal(trimesh_choose(&s.view, &d, NULL, again, rotation), TXM_OK);
        assert_memory_equal(again, patch, s.triangles * sizeof(int));
        d.seed++;
        assert_int_equal(trimesh_choose(&s.view, &d, NULL, again, rotation), TXM_OK);
        if (d.patches > 1) assert_true(memcmp(again, patch, s.triangles * sizeof(int)) != 0);
    }
    trimesh_choose_desc d = {4, 3, 1, 7};
    assert_int_equal(trimesh_choose(&s.view, &d, NULL, patch, rotation), TXM_OK);
    count_equal(&s, patch, rotation, equal);
    assert_true(fabs(equal[0] / (1.5 * (double)s.triangles) - 0.25) < 0.03); /* pure chance */
    assert_int_equal(trimesh_choose(&s.view, NULL, NULL, patch, rotation), TXM_OK);
    d.rotations = 2;
    assert_int_equal(trimesh_choose(&s.view, &d, NULL, patch, rotation), TXM_BAD_ARGUMENT);
    free(patch);
    free(rotation);
    free(again);
    shape_free(&s);
}

static void test_colors(void **state) {
    shape s[3];
    static const int most[3] = {6, 7, 6};
    (void)state;
    make_sphere(&s[0], 15);
    make_torus(&s[1], 7, 5, 0.3);
    make_plane(&s[2], 9, 9);
    for (int i = 0; i < 3; i++) {
        int *color = (int *)malloc(s[i].vertices * sizeof(int));
        int count = 0, seen = 0;
        assert_int_equal(trimesh_proper_colors(&s[i].view, NULL, color, &count), TXM_OK);
        assert_in_range(count, 3, most[i]);
        for (size_t c = 0; c < 3 * s[i].triangles; c++) {
            const uint32_t a = s[i].indices[c], b = s[i].indices[c % 3 == 2 ? c - 2 : c + 1];
            assert_true(color[a] != color[b]);
        }
        for (size_t v = 0; v < s[i].vertices; v++) {
            assert_in_range(color[v], 0, count - 1);
            seen |= 1 << color[v];
        }
        assert_int_equal(seen, (1 << count) - 1);
        print_message("# %d colours\n", count);
        free(color);
    }
    int random[3000], share[3] = {0, 0, 0};
    assert_int_equal(trimesh_random_colors(3000, 0, 3, NULL, random), TXM_OK);
    for (int v = 0; v < 3000; v++) {
        assert_in_range(random[v], 0, 2);
        share[random[v]]++;
    }
    for (int c = 0; c < 3; c++) assert_in_range(share[c], 900, 1100);
    assert_int_equal(trimesh_random_colors(3000, -1, 3, NULL, random), TXM_BAD_ARGUMENT);
    for (int i = 0; i < 3; i++) shape_free(&s[i]);
}

/* ---- edge-matching tiles, with textiles.h ---- */

static void test_tiles(void **state) {
    enum { SIZE = 32 };
    shape s;
    textiles_desc desc;
    textiles_set *set = NULL;
    textiles_layout layout;
    txm_env env;
    (void)state;
    make_sphere(&s, 5);
    memset(&env, 0, sizeof env);
    memset(&desc, 0, sizeof desc);
    desc.kind = TEXTILES_TRIANGLE;
    desc.size = SIZE;
    desc.colors = 3;
    const int tiles = ((2 * 3) * (2 * 3) * (2 * 3) + 4 * 3) / 3;
    txm_image *pictures = (txm_image *)calloc((size_t)tiles, sizeof *pictures);
    static uint8_t black[(SIZE + 1) * (SIZE + 1)];
    for (int i = 0; i < tiles; i++) {
        pictures[i].pixels = black;
        pictures[i].width = pictures[i].height = SIZE + 1;
        pictures[i].channels = 1;
    }
    assert_int_equal(textiles_import(&desc, pictures, tiles, 1, &env, &set), TXM_OK);
    assert_int_equal(textiles_layout_make(set, TEXTILES_PACKED, 2, &env, &layout), TXM_OK);
    float *tile_uv = (float *)malloc((size_t)tiles * 6 * sizeof(float));
    for (int i = 0; i < tiles; i++) {
        float uv[4][2];
        assert_true(textiles_place(&layout, i, NULL, NULL, NULL, uv));
        memcpy(tile_uv + 6 * i, uv, 6 * sizeof(float));
    }
    const size_t n = s.triangles;
    int *color = (int *)malloc(3 * n * sizeof(int)), *way = (int *)malloc(3 * n * sizeof(int));
    int *tile = (int *)malloc(n * sizeof(int)), *turn = (int *)malloc(n * sizeof(int));
    int *tile2 = (int *)malloc(n * sizeof(int)), *turn2 = (int *)malloc(n * sizeof(int));
    float *uv = (float *)malloc(6 * n * sizeof(float));
    assert_int_equal(trimesh_edge_colors(&s.view, 3, 11, NULL, color, way), TXM_OK);
    int equal = 0;
    for (size_t t = 0; t < n; t++) {
        const int edges[4] = {color[3 * t], color[3 * t + 1], color[3 * t + 2], 0};
        assert_true(abs(way[3 * t] + way[3 * t + 1] + way[3 * t + 2]) == 1);
        tile[t] = textiles_find(set, edges, way + 3 * t, &turn[t]);
        assert_true(tile[t] >= 0);
    }
    /* the same edges on both sides: colours equal, directions opposite */
    uint32_t *next = (uint32_t *)malloc(3 * n * sizeof *next);
    assert_true(tmc_link(&s.view, next, NULL));
    for (size_t i = 0; i < 3 * n; i++) {
        assert_int_equal(color[i], color[next[i]]);
        assert_int_equal(way[i], -way[next[i]]);
    }
    free(next);
    assert_int_equal(trimesh_place_tiles(n, tile, turn, tile_uv, (size_t)tiles, NULL, uv), TXM_OK);
    for (size_t t = 0; t < n; t++) {
        float there[4][2];
        assert_int_equal(textiles_face_uv(&layout, tile[t], turn[t], there), 3);
        assert_memory_equal(uv + 6 * t, there, 6 * sizeof(float));
    }
    /* textiles begins with these edges and recolours a few */
    assert_int_equal(textiles_assign_triangles(set, s.indices, n, s.vertices, 11, &env, tile2, turn2),
                     TXM_OK);
    for (size_t t = 0; t < n; t++) equal += tile[t] == tile2[t] && turn[t] == turn2[t];
    print_message("# %d of %d tiles are those of textiles_assign_triangles\n", equal, (int)n);
    assert_true(equal > (int)n * 8 / 10);
    assert_int_equal(trimesh_place_tiles(n, tile2, turn2, tile_uv, (size_t)tiles, NULL, uv), TXM_OK);
    tile2[3] = tiles;
    assert_int_equal(trimesh_place_tiles(n, tile2, turn2, tile_uv, (size_t)tiles, NULL, uv),
                     TXM_BAD_ARGUMENT);
    textiles_set_free(set);
    free(pictures);
    free(tile_uv);
    free(color);
    free(way);
    free(tile);
    free(turn);
    free(tile2);
    free(turn2);
    free(uv);
    shape_free(&s);
}

/* ---- geometry ---- */

static void make_patch(int points, int hexagonal, uint64_t seed, trimesh_patch *patch) {
    trimesh_patch_desc d = {points, hexagonal, 0, seed};
    size_t count = 0;
    assert_int_equal(trimesh_reference_patch(&d, NULL, NULL, 0, &count), TXM_OK);
    trimesh_point *p = (trimesh_point *)malloc(count * sizeof *p);
    assert_int_equal(trimesh_reference_patch(&d, NULL, p, count, &patch->count), TXM_OK);
    assert_int_equal(count, patch->count);
    patch->points = p;
}

static trimesh_instance *scatter(const trimesh_scatter_desc *d, txm_env *env, size_t *count) {
    trimesh_instance *out;
    assert_int_equal(trimesh_scatter(d, env, NULL, 0, count), TXM_OK);
    out = (trimesh_instance *)malloc((*count + 1) * sizeof *out);
    assert_int_equal(trimesh_scatter(d, env, out, *count, count), TXM_OK);
    return out;
}

/* Points on every side and corner: each edge and vertex of the mesh shows them once, whatever the
   rotations; the hexagonal patch gives the vertices of the subdivided mesh. */
static void test_owned_once(void **state) {
    enum { STEPS = 4 };
    shape s[3];
    (void)state;
    make_sphere(&s[0], 6);
    make_torus(&s[1], 11, 6, 0.35);
    make_plane(&s[2], 8, 5);
    for (int i = 0; i < 3; i++) {
        const size_t v = s[i].vertices, f = s[i].triangles;
        const size_t border = i == 2 ? 2 * (8 + 5) : 0, e = (3 * f + border) / 2;
        trimesh_patch patch;
        trimesh_scatter_desc d;
        size_t count;
        make_patch(STEPS * STEPS / 2, 1, 0, &patch);
        assert_int_equal(patch.count, (STEPS + 1) * (STEPS + 2) / 2);
        memset(&d, 0, sizeof d);
        d.mesh = s[i].view;
        d.patches = &patch;
        d.patch_count = 1;
        trimesh_instance *out = scatter(&d, NULL, &count);
        assert_int_equal(count, v + e * (STEPS - 1) + f * ((STEPS - 1) * (STEPS - 2) / 2));
        for (size_t a = 0; a < count; a++) { /* no two in one place */
            for (size_t b = 0; b < a; b++) {
                double gap = 0;
                for (int k = 0; k < 3; k++)
                    gap += fabs((double)out[a].position[k] - out[b].position[k]);
                assert_true(gap > 1e-3);
            }
        }
        for (size_t a = 0; a < count; a++) { /* frames: unit quaternions, z the normal */
            const float *q = out[a].rotation, up[3] = {0, 0, 1}, right[3] = {1, 0, 0};
            float z[3], x[3];
            trimesh_instance turn = out[a];
            assert_float_equal(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3], 1, 1e-6);
            assert_true(q[3] >= 0);
            memset(turn.position, 0, sizeof turn.position);
            turn.scale = 1;
            trimesh_instance_apply(&turn, up, z);
            trimesh_instance_apply(&turn, right, x);
            assert_float_equal(dot3(z, x), 0, 1e-6);
            if (i == 0) assert_true(dot3(z, out[a].position) > 0.99 * length3(out[a].position));
            if (i == 2) assert_float_equal(z[2], 1, 1e-6);
            if (i == 2) { /* x lies at a multiple of 60 degrees */
                const double angle = atan2(x[1], x[0]) / (TXM_PI / 3);
                assert_float_equal(angle, floor(angle + 0.5), 1e-5);
                assert_float_equal(out[a].scale, 1, 1e-5);
            }
        }
        free(out);
        free((void *)(uintptr_t)patch.points);
        shape_free(&s[i]);
    }
}

/* Where the point of a patch comes to lie, which way it looks, and what the options do to it. */
static void test_placing(void **state) {
    shape s;
    trimesh_scatter_desc d;
    trimesh_point point;
    trimesh_patch patch;
    int rotation = 0, choice = 0;
    trimesh_instance out;
    size_t count;
    const float right[3] = {1, 0, 0};
    float x[3];
    (void)state;
    make_plane(&s, 1, 1);
    memset(&d, 0, sizeof d);
    memset(&point, 0, sizeof point);
    point.u = 0.5f;
    point.v = 0.125f;
    point.height = 0.25f;
    point.prototype = 9;
    patch.points = &point;
    patch.count = 1;
    d.mesh = s.view;
    d.mesh.face_count = 1;
    d.patches = &patch;
    d.patch_count = 1;
    d.rotations = &rotation;
    d.choices = &choice;
    assert_int_equal(trimesh_scatter(&d, NULL, &out, 1, &count), TXM_OK);
    assert_int_equal(count, 1);
    assert_float_equal(out.position[0], 0.5625, 1e-6);
    assert_float_equal(out.position[1], 0.125 * sqrt(0.75), 1e-6);
    assert_float_equal(out.position[2], 0.25, 1e-6);
    assert_float_equal(out.rotation[3], 1, 1e-6);
    assert_int_equal(out.prototype, 9);
    rotation = 1; /* corner 0 of the triangle is corner 1 of the patch: turned by -120 degrees */
    assert_int_equal(trimesh_scatter(&d, NULL, &out, 1, &count), TXM_OK);
    assert_float_equal(out.position[0], 0.5 * 0 + 0.375 * 0.5 + 0.125 * 1, 1e-6);
    memset(out.position, 0, sizeof out.position);
    trimesh_instance_apply(&out, right, x);
    assert_float_equal(x[0], -0.5, 1e-6);
    assert_float_equal(x[1], -sqrt(0.75), 1e-6);
    rotation = 0;
    d.inside = 1;
    d.height = 1;
    d.unit = 2;
    point.scale = 3;
    assert_int_equal(trimesh_scatter(&d, NULL, &out, 1, &count), TXM_OK);
    assert_float_equal(out.position[2], -2.5, 1e-6);
    assert_float_equal(out.scale, 6, 1e-6);
    memset(out.position, 0, sizeof out.position);
    const float up[3] = {0, 0, 1};
    trimesh_instance_apply(&out, up, x);
    assert_float_equal(x[2], -6, 1e-5);
    trimesh_instance_apply(&out, right, x);
    assert_float_equal(x[0], 6, 1e-5);
    /* the point's own turn comes on top: a quarter about z */
    d.inside = 0;
    d.unit = d.height = 0;
    point.scale = 0;
    point.rotation[2] = point.rotation[3] = 5;
    assert_int_equal(trimesh_scatter(&d, NULL, &out, 1, &count), TXM_OK);
    memset(out.position, 0, sizeof out.position);
    trimesh_instance_apply(&out, right, x);
    assert_float_equal(x[1], 1, 1e-6);
    shape_free(&s);
    /* on a sphere with curve 1 things stand on the sphere */
    make_sphere(&s, 8);
    memset(point.rotation, 0, sizeof point.rotation);
    point.height = 0;
    memset(&d, 0, sizeof d);
    d.mesh = s.view;
    d.normals = s.positions;
    d.patches = &patch;
    d.patch_count = 1;
    double worst[2] = {0, 0};
    for (int c = 0; c < 2; c++) {
        d.curve = (float)c;
        trimesh_instance *all = scatter(&d, NULL, &count);
        for (size_t i = 0; i < count; i++)
            worst[c] = fmax(worst[c], fabs(length3(all[i].position) - 1));
        free(all);
    }
    print_message("# distance to the sphere: flat %.2g, curved %.2g\n", worst[0], worst[1]);
    assert_true(worst[1] < 0.02 * worst[0]);
    shape_free(&s);
}

static void test_mix_and_spin(void **state) {
    shape s;
    trimesh_patch patch;
    trimesh_scatter_desc d;
    size_t count;
    const float mix[3] = {3, 0, 1}, right[3] = {1, 0, 0};
    double used[3] = {0, 0, 0}, sum[2] = {0, 0};
    (void)state;
    make_plane(&s, 20, 20);
    make_patch(20, 0, 4, &patch);
    memset(&d, 0, sizeof d);
    d.mesh = s.view;
    d.patches = &patch;
    d.patch_count = 1;
    d.mix = mix;
    d.mix_count = 3;
    d.spin = 1;
    trimesh_instance *out = scatter(&d, NULL, &count);
    for (size_t i = 0; i < count; i++) {
        float x[3];
        assert_in_range(out[i].prototype, 0, 2);
        used[out[i].prototype] += 1 / (double)count;
        memset(out[i].position, 0, sizeof out[i].position);
        out[i].scale = 1;
        trimesh_instance_apply(&out[i], right, x);
        sum[0] += x[0] / (double)count;
        sum[1] += x[1] / (double)count;
    }
    assert_float_equal(used[0], 0.75, 0.02);
    assert_true(used[1] == 0);
    assert_true(fabs(sum[0]) < 0.03 && fabs(sum[1]) < 0.03); /* all ways alike */
    free(out);
    free((void *)(uintptr_t)patch.points);
    shape_free(&s);
}

/* ---- patches ---- */

/* least and mean distance to the nearest neighbour of instances on a flat mesh, away from its border,
   in units of that of the hexagonal lattice of their number */
static void spacing(const trimesh_instance *out, size_t count, double density, double gap[2]) {
    const double ideal = sqrt(2 / sqrt(3.0) / density);
    size_t inside = 0;
    gap[0] = 1e9;
    gap[1] = 0;
    for (size_t i = 0; i < count; i++) {
        const double y = out[i].position[1], x = out[i].position[0] - y / sqrt(3.0);
        double nearest = 1e9;
        if (x < 1 || y < 1 || x > 7 || y > 6) continue;
        for (size_t k = 0; k < count; k++) {
            const double dx = (double)out[k].position[0] - out[i].position[0];
            const double dy = (double)out[k].position[1] - out[i].position[1];
            if (k != i) nearest = fmin(nearest, dx * dx + dy * dy);
        }
        nearest = sqrt(nearest) / ideal;
        gap[0] = fmin(gap[0], nearest);
        gap[1] += nearest;
        inside++;
    }
    gap[1] /= (double)inside;
}

static void test_reference_patch(void **state) {
    static const int sizes[5] = {1, 7, 32, 50, 200};
    shape s;
    (void)state;
    make_plane(&s, 8, 8);
    for (int i = 0; i < 5; i++) {
        for (int share = 10; share >= 7; share -= 3) { /* of the points, by thinning */
            trimesh_patch patch[3];
            trimesh_scatter_desc d;
            size_t count;
            double gap[2];
            for (int k = 0; k < 3; k++) make_patch(sizes[i], 0, (uint64_t)k, &patch[k]);
            memset(&d, 0, sizeof d);
            d.mesh = s.view;
            d.patches = patch;
            d.patch_count = 3;
            const double density = 0.1 * share * sizes[i] / (0.5 * sqrt(0.75));
            if (share < 10) d.density = (float)density;
            trimesh_instance *out = scatter(&d, NULL, &count);
            spacing(out, count, density, gap);
            print_message("# %d points, %d %%: nearest neighbour mean %.3f, least %.3f of ideal\n",
                          sizes[i], 10 * share, gap[1], gap[0]);
            if (sizes[i] >= 7) assert_true(gap[0] > (share < 10 ? 0.5 : 0.6));
            free(out);
            for (int k = 0; k < 3; k++) free((void *)(uintptr_t)patch[k].points);
        }
    }
    trimesh_patch_desc d = {5000, 0, 0, 0};
    size_t count;
    assert_int_equal(trimesh_reference_patch(&d, NULL, NULL, 0, &count), TXM_BAD_ARGUMENT);
    shape_free(&s);
}

/* ---- density ---- */

/* Relative error of the number of instances in discs of `area` around the centres of triangles, on the
   sphere of radius r: root mean square and worst. */
static void disc_error(const trimesh_instance *out, size_t count, const shape *s, double r,
                       double area, double density, double error[2]) {
    /* a cap of this area on the sphere: area = 2 pi r^2 (1 - cos) */
    const double cosine = 1 - area / (2 * TXM_PI * r * r);
    size_t discs = 0;
    error[0] = error[1] = 0;
    for (size_t t = 0; t < s->triangles; t += s->triangles / 100, discs++) {
        float c[3];
        size_t inside = 0;
        const uint32_t *v = s->indices + 3 * t;
        for (size_t k = 0; k < 3; k++)
            c[k] = s->positions[3 * v[0] + k] + s->positions[3 * v[1] + k] +
                   s->positions[3 * v[2] + k];
        for (size_t i = 0; i < count; i++)
            inside += dot3(c, out[i].position) > cosine * length3(c) * length3(out[i].position);
        const double e = (double)inside / (area * density) - 1;
        error[0] += e * e;
        error[1] = fmax(error[1], fabs(e));
    }
    error[0] = sqrt(error[0] / (double)discs);
}

/* Two leaflets on a sphere whose triangles differ by a factor of 1.7 in area. */
static void test_density(void **state) {
    shape s;
    trimesh_patch patch[4];
    (void)state;
    make_sphere(&s, 12);
    for (int k = 0; k < 4; k++) make_patch(160, 0, (uint64_t)k + 50, &patch[k]);
    const double mean = 4 * TXM_PI / (double)s.triangles, edge2 = mean / sqrt(0.1875);
    for (int inside = 0; inside < 2; inside++) {
        trimesh_scatter_desc d;
        size_t count;
        double thin[2], full[2];
        memset(&d, 0, sizeof d);
        d.mesh = s.view;
        d.normals = s.positions;
        d.patches = patch;
        d.patch_count = 4;
        d.inside = inside;
        d.unit = 1;
        d.height = 0.1f;
        const double r = inside ? 0.9 : 1.1, area = 10 * edge2 * r * r, density = 100 / mean;
        trimesh_instance *out = scatter(&d, NULL, &count);
        disc_error(out, count, &s, r, area, (double)count / (4 * TXM_PI * r * r), full);
        free(out);
        d.density = (float)density;
        out = scatter(&d, NULL, &count);
        const double there = 4 * TXM_PI * r * r * density;
        disc_error(out, count, &s, r, area, density, thin);
        print_message("# %s: %d instances, %.1f wanted; error in discs rms %.4f worst %.4f; without "
                      "thinning %.4f %.4f\n", inside ? "inside" : "outside", (int)count, there,
                      thin[0], thin[1], full[0], full[1]);
        assert_true(fabs((double)count / there - 1) < 0.01);
        assert_true(thin[0] < 0.015 && thin[1] < 0.03);
        assert_true(full[1] > 0.1);
        free(out);
    }
    /* too dense for the patch: how many the largest triangle needs */
    trimesh_scatter_desc d;
    txm_env env;
    size_t count;
    memset(&d, 0, sizeof d);
    memset(&env, 0, sizeof env);
    d.mesh = s.view;
    d.patches = patch;
    d.patch_count = 4;
    d.density = (float)(300 / mean);
    assert_int_equal(trimesh_scatter(&d, &env, NULL, 0, &count), TXM_TOO_SMALL);
    print_message("# %s\n", env.message);
    for (int k = 0; k < 4; k++) free((void *)(uintptr_t)patch[k].points);
    shape_free(&s);
}

/* ---- same bytes, failures, bad arguments ---- */

/* Everything on one mesh; a number that stands for all results. */
static txm_status run_all(const shape *s, const shape *input, const txm_mesh_place *sources,
                          txm_env *env, uint64_t *hash) {
    const size_t n = s->triangles, v = s->vertices;
    float *out = (float *)malloc(9 * n * sizeof(float));
    int *a = (int *)malloc(3 * n * sizeof(int)), *b = (int *)malloc(3 * n * sizeof(int));
    uint32_t *x = (uint32_t *)malloc(3 * n * sizeof *x), *y = (uint32_t *)malloc(3 * n * sizeof *y);
    trimesh_point *points = (trimesh_point *)calloc(100, sizeof *points);
    trimesh_instance *instances = NULL;
    const trimesh_values values = {input->positions, input->vertices, NULL, 3};
    trimesh_patch patch;
    trimesh_patch_desc pd = {30, 0, 3, 1};
    trimesh_scatter_desc d;
    size_t count = 0;
    int colors = 0;
    txm_status status = trimesh_normals(&s->view, env, out);
    *hash = tk_hash(0, out, 3 * v * sizeof(float));
#define NEXT(call, data, bytes)                                                                     \
    if (status == TXM_OK) {                                                                         \
        if (env && env->progress == tk_report) ((tk_progress *)env->progress_user)->last = 0;      \
        status = call;                                                                              \
        if (status == TXM_OK) *hash = tk_hash(*hash, data, bytes);                                  \
    }
    NEXT(trimesh_transfer(&input->view, &values, sources, v, env, out), out, 3 * v * sizeof(float))
    NEXT(trimesh_transfer_corners(&input->view, &values, &s->view, sources, env, out), out,
         9 * n * sizeof(float))
    NEXT(trimesh_split_corners(&s->view, out, 3, env, x, y, &count), x, 3 * n * sizeof *x)
    NEXT(trimesh_choose(&s->view, NULL, env, a, b), a, n * sizeof *a)
    NEXT(trimesh_edge_colors(&s->view, 5, 3, env, a, b), b, 3 * n * sizeof *b)
    NEXT(trimesh_proper_colors(&s->view, env, a, &colors), a, v * sizeof *a)
    patch.points = points;
    NEXT(trimesh_reference_patch(&pd, env, points, 100, &patch.count), points,
         patch.count * sizeof *points)
    NEXT(trimesh_order_patch(points, patch.count, env), points, patch.count * sizeof *points)
    memset(&d, 0, sizeof d);
    d.mesh = s->view;
    d.patches = &patch;
    d.patch_count = 1;
    d.density = 5;
    d.curve = 0.7f;
    d.spin = 1;
    d.mix = (const float[]){1, 2};
    d.mix_count = 2;
    NEXT(trimesh_scatter(&d, env, NULL, 0, &count), &count, sizeof count)
    if (status == TXM_OK) instances = (trimesh_instance *)malloc(count * sizeof *instances);
    NEXT(trimesh_scatter(&d, env, instances, count, &count), instances, count * sizeof *instances)
#undef NEXT
    free(out);
    free(a);
    free(b);
    free(x);
    free(y);
    free(points);
    free(instances);
    return status;
}

static void test_same_bytes_and_failures(void **state) {
    shape s, input;
    (void)state;
    make_plane(&input, 24, 24);
    txm_mesh_place *sources = lay_over(&input, 24, &s);
    uint64_t first, hash;
    assert_int_equal(run_all(&s, &input, sources, NULL, &first), TXM_OK);
    print_message("# hash %016llx\n", (unsigned long long)first);
    for (int i = 0; i < 2; i++) {
        txm_env env = tk_env(NULL, NULL);
        env.parallel_for = i ? tk_parallel_threads : tk_parallel_reverse;
        assert_int_equal(run_all(&s, &input, sources, &env, &hash), TXM_OK);
        assert_true(hash == first);
    }
    for (int onward = 0; onward < 2; onward++) {
        for (long k = 1;; k++) {
            tk_memory memory;
            memset(&memory, 0, sizeof memory);
            memory.fail_at = k;
            memory.fail_onward = onward;
            txm_env env = tk_env(&memory, NULL);
            const txm_status status = run_all(&s, &input, sources, &env, &hash);
            assert_int_equal(tk_leaks(&memory), 0);
            if (memory.calls < k) {
                assert_int_equal(status, TXM_OK);
                break;
            }
            assert_int_equal(status, TXM_OUT_OF_MEMORY);
        }
    }
    for (long k = 1;; k++) {
        tk_memory memory;
        tk_progress progress;
        memset(&memory, 0, sizeof memory);
        memset(&progress, 0, sizeof progress);
        progress.cancel_at = k;
        txm_env env = tk_env(&memory, &progress);
        const txm_status status = run_all(&s, &input, sources, &env, &hash);
        assert_int_equal(tk_leaks(&memory), 0);
        assert_int_equal(progress.errors, 0);
        assert_int_equal(progress.late, 0);
        if (progress.calls < k) {
            assert_int_equal(status, TXM_OK);
            assert_true(k > 20);
            break;
        }
        assert_int_equal(status, TXM_CANCELLED);
    }
    free(sources);
    shape_free(&s);
    shape_free(&input);
}

/* A big mesh by threads: many blocks. */
static void test_threads(void **state) {
    shape s;
    trimesh_patch patch;
    trimesh_scatter_desc d;
    size_t count;
    uint64_t hash[3];
    (void)state;
    make_torus(&s, 150, 60, 0.4);
    make_patch(8, 0, 3, &patch);
    memset(&d, 0, sizeof d);
    d.mesh = s.view;
    d.patches = &patch;
    d.patch_count = 1;
    for (int i = 0; i < 3; i++) {
        txm_env env = tk_env(NULL, NULL);
        if (i) env.parallel_for = i == 1 ? tk_parallel_threads : tk_parallel_reverse;
        trimesh_instance *out = scatter(&d, &env, &count);
        hash[i] = tk_hash(0, out, count * sizeof *out);
        free(out);
    }
    assert_true(hash[0] == hash[1] && hash[0] == hash[2]);
    free((void *)(uintptr_t)patch.points);
    shape_free(&s);
}

/* Every field of a scatter out of its range in turn. */
static void test_bad_scatter(void **state) {
    enum { CASES = 20 };
    shape s;
    (void)state;
    make_plane(&s, 2, 2);
    const float y = s.positions[4];
    for (int i = 0; i <= CASES; i++) {
        trimesh_point point;
        trimesh_patch patch;
        trimesh_scatter_desc d;
        const float mix[2] = {1, i == 14 ? -1.0f : 1.0f};
        const float normals[27] = {i == 15 ? (float)NAN : 0.0f};
        int wrong[8] = {0, 0, 0, 0, 0, 0, 0, 3};
        size_t count = 77;
        trimesh_instance out;
        const int turns[8] = {0, 0, 0, 0, 0, 0, 0, 0};
        memset(&out, 0, sizeof out);
        memset(&point, 0, sizeof point);
        memset(&d, 0, sizeof d);
        point.u = point.v = 0.25f;
        patch.points = &point;
        patch.count = 1;
        d.mesh = s.view;
        d.patches = &patch;
        d.patch_count = 1;
        d.rotations = turns;
        txm_status status = TXM_BAD_ARGUMENT;
        switch (i) {
        case 0: d.patches = NULL; break;
        case 1: d.patch_count = 0; break;
        case 2: d.unit = -1; break;
        case 3: d.height = (float)NAN; break;
        case 4: d.curve = 1.1f; break;
        case 5: d.density = (float)INFINITY; break;
        case 6: d.mix = mix; break;
        case 7: d.rotations = wrong; break;
        case 8: d.choices = wrong; break;
        case 9: point.u = 1.1f; break;
        case 10: point.v = (float)NAN; break;
        case 11: point.height = 1001; break;
        case 12: point.scale = -1; break;
        case 13: point.rotation[1] = (float)INFINITY; break;
        case 14:
            d.mix = mix;
            d.mix_count = 2;
            break;
        case 15: d.normals = normals; break;
        case 16: d.mesh.indices = NULL; break;
        case 17: s.indices[4] = 9; break;
        case 18: s.positions[4] = (float)INFINITY; break;
        case 19: patch.count = (1 << 20) + 1; break;
        default: status = TXM_TOO_LARGE; /* no room */
        }
        assert_int_equal(trimesh_scatter(&d, NULL, &out, 1, &count), status);
        assert_int_equal(count, i == CASES ? 8 : 77);
        assert_int_equal(out.triangle, 0);
        s.indices[4] = 4;
        s.positions[4] = y;
    }
    assert_int_equal(trimesh_scatter(NULL, NULL, NULL, 0, NULL), TXM_BAD_ARGUMENT);
    shape_free(&s);
}

/* Triangles without area, in all possible ways, harm nobody. */
static void test_degenerate(void **state) {
    shape s;
    trimesh_patch patch;
    trimesh_scatter_desc d;
    size_t count;
    (void)state;
    make_plane(&s, 4, 4);
    face(&s, 0, 3, 3, 3);
    face(&s, 1, 3, 3, 4);
    face(&s, 2, 5, 6, 7);
    face(&s, 3, 5, 6, 7);
    put(&s, 6, s.positions[15], s.positions[16], 0);
    make_patch(12, 0, 1, &patch);
    memset(&d, 0, sizeof d);
    d.mesh = s.view;
    d.patches = &patch;
    d.patch_count = 1;
    for (int i = 0; i < 4; i++) {
        d.density = i & 1 ? 5.0f : 0.0f;
        d.curve = i & 2 ? 1.0f : 0.0f;
        trimesh_instance *out = scatter(&d, NULL, &count);
        for (size_t k = 0; k < count; k++) {
            double length = 0;
            for (int c = 0; c < 4; c++) length += (double)out[k].rotation[c] * out[k].rotation[c];
            assert_float_equal(length, 1, 1e-6);
            for (int c = 0; c < 3; c++) assert_true(txm_is_finite(out[k].position[c]));
        }
        free(out);
    }
    txm_mesh_place *sources = strew(&s, s.vertices);
    const trimesh_values values = {s.positions, s.vertices, NULL, 3};
    float *out = (float *)malloc(9 * s.triangles * sizeof(float));
    assert_int_equal(trimesh_transfer_corners(&s.view, &values, &s.view, sources, NULL, out), TXM_OK);
    for (size_t i = 0; i < 9 * s.triangles; i++) assert_true(txm_is_finite(out[i]));
    int *color = (int *)malloc(s.triangles * sizeof(int));
    int *turn = (int *)malloc(s.triangles * sizeof(int));
    assert_int_equal(trimesh_proper_colors(&s.view, NULL, color, NULL), TXM_OK);
    assert_int_equal(trimesh_choose(&s.view, NULL, NULL, color, turn), TXM_OK);
    free(color);
    free(turn);
    free(out);
    free(sources);
    free((void *)(uintptr_t)patch.points);
    shape_free(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_normals),
        cmocka_unit_test(test_transfer),
        cmocka_unit_test(test_transfer_corners),
        cmocka_unit_test(test_transfer_identity),
        cmocka_unit_test(test_split),
        cmocka_unit_test(test_atlas),
        cmocka_unit_test(test_choose),
        cmocka_unit_test(test_colors),
        cmocka_unit_test(test_tiles),
        cmocka_unit_test(test_owned_once),
        cmocka_unit_test(test_placing),
        cmocka_unit_test(test_mix_and_spin),
        cmocka_unit_test(test_reference_patch),
        cmocka_unit_test(test_density),
        cmocka_unit_test(test_same_bytes_and_failures),
        cmocka_unit_test(test_threads),
        cmocka_unit_test(test_bad_scatter),
        cmocka_unit_test(test_degenerate),
    };
    return cmocka_run_group_tests_name("trimesh_texture", tests, NULL, NULL);
}
