/* test_trimesh_cover.c - trimesh_cover.h: attributes and texturing
   SPDX-License-Identifier: MIT OR Unlicense

   On meshes made here, so that nothing of the retiling itself matters.                          */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#define TRIMESH_COVER_IMPLEMENTATION
#include "trimesh_cover.h"
#include "textiles.h"
#include "coverkit.h"

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

static void test_transfer(void **state) {
    enum { COUNT = 3000 };
    shape s;
    (void)state;
    make_plane(&s, 20, 10);
    txm_mesh_place *sources = random_places(&s, COUNT);
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

/* A mesh that follows the seams: then every triangle has the values of its own side, exactly. `how`: charts
   of 3 x 3 quads; one chart, cut along one column; a fan around every vertex of one row, as at the pole
   of a globe; a chart for every triangle. */
static void test_transfer_along_seams(void **state) {
    enum { COLUMNS = 12, ROWS = 9 };
    shape s;
    (void)state;
    make_plane(&s, COLUMNS, ROWS);
    const size_t corners = 3 * s.triangles;
    txm_mesh_place *sources = (txm_mesh_place *)malloc(s.vertices * sizeof *sources);
    float *value = (float *)malloc(2 * corners * sizeof(float));
    float *out = (float *)malloc(2 * corners * sizeof(float));
    uint32_t *entry = (uint32_t *)malloc(corners * sizeof(uint32_t));
    const trimesh_values values = {value, corners, entry, 2};
    for (size_t c = 0; c < corners; c++) entry[c] = (uint32_t)c;
    for (int how = 0; how < 4; how++) {
        for (size_t c = 0; c < corners; c++) {
            const float *p = s.positions + 3 * s.indices[c];
            const size_t column = c / 6 % COLUMNS, row = c / 6 / COLUMNS;
            float step = 0;
            if (how == 0) step = (float)(100 * (column / 3) + 1000 * (row / 3));
            if (how == 1) step = column >= 6 && row >= 3 ? 100.0f : 0.0f;
            if (how == 2) step = (float)(20 * (c / 3 % 5)) * (row == 4 ? 1.0f : 0.0f);
            if (how == 3) step = (float)(20 * (c / 3));
            value[2 * c] = p[0] + step;
            value[2 * c + 1] = p[1];
        }
        for (int last = 0; last < 2; last++) { /* sources name the first or the last triangle there */
            for (size_t i = 0; i < corners; i++) {
                const size_t c = last ? i : corners - 1 - i;
                txm_mesh_place *o = &sources[s.indices[c]];
                o->triangle = (uint32_t)(c / 3);
                o->u = c % 3 == 1;
                o->v = c % 3 == 2;
            }
            assert_int_equal(trimesh_transfer_corners(&s.view, &values, &s.view, sources, NULL, out),
                             TXM_OK);
            for (size_t i = 0; i < 2 * corners; i++) assert_float_equal(out[i], value[i], 1e-3);
        }
    }
    free(entry);
    free(out);
    free(value);
    free(sources);
    shape_free(&s);
}

/* Sources in the middle of sides, where two charts meet: triangles cut in four. */
static void test_transfer_on_sides(void **state) {
    enum { N = 6 };
    shape s, fine;
    (void)state;
    make_plane(&s, N, N);
    const size_t corners = 3 * s.triangles;
    shape_alloc(&fine, corners * 2, 4 * s.triangles); /* a corner and a middle, for each corner */
    txm_mesh_place *sources = (txm_mesh_place *)malloc(2 * corners * sizeof *sources);
    float *value = (float *)malloc(2 * corners * sizeof(float));
    float *out = (float *)malloc(8 * corners * sizeof(float));
    uint32_t *entry = (uint32_t *)malloc(corners * sizeof(uint32_t));
    const trimesh_values values = {value, corners, entry, 2};
    for (size_t c = 0; c < corners; c++) {
        const float *p = s.positions + 3 * s.indices[c];
        const size_t next = c % 3 == 2 ? c - 2 : c + 1;
        const float at[2][2] = {{(float)(c % 3 == 1), (float)(c % 3 == 2)},
                                {0.5f * (float)(c % 3 != 2), 0.5f * (float)(c % 3 != 0)}};
        entry[c] = (uint32_t)c;
        value[2 * c] = p[0] + (float)(100 * (c / 3));
        value[2 * c + 1] = p[1];
        for (size_t k = 0; k < 2; k++) {
            sources[2 * c + k].triangle = (uint32_t)(c / 3);
            sources[2 * c + k].u = at[k][0];
            sources[2 * c + k].v = at[k][1];
        }
        for (size_t other = 0; other < c; other++) { /* the middle as the other triangle has it */
            const size_t end = other % 3 == 2 ? other - 2 : other + 1;
            if (s.indices[other] != s.indices[next] || s.indices[end] != s.indices[c]) continue;
            sources[2 * c + 1] = sources[2 * other + 1];
        }
    }
    for (size_t t = 0; t < s.triangles; t++) {
        const size_t c = 6 * t;
        face(&fine, 4 * t, c, c + 1, c + 5);
        face(&fine, 4 * t + 1, c + 1, c + 2, c + 3);
        face(&fine, 4 * t + 2, c + 5, c + 3, c + 4);
        face(&fine, 4 * t + 3, c + 1, c + 3, c + 5);
    }
    assert_int_equal(trimesh_transfer_corners(&s.view, &values, &fine.view, sources, NULL, out), TXM_OK);
    for (size_t i = 0; i < 3 * fine.triangles; i++) {
        const size_t t = i / 12, k = fine.indices[i] - 6 * t, c = 3 * t + k / 2;
        const size_t next = k / 2 == 2 ? 3 * t : c + 1;
        for (size_t x = 0; x < 2; x++) {
            const float want = k % 2 ? 0.5f * (value[2 * c + x] + value[2 * next + x]) : value[2 * c + x];
            assert_float_equal(out[2 * i + x], want, 1e-3);
        }
    }
    free(entry);
    free(out);
    free(value);
    free(sources);
    shape_free(&fine);
    shape_free(&s);
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
    assert_int_equal(tmc_link(&s->view, NULL, next), TXM_OK);
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
    assert_int_equal(tmc_link(&s.view, NULL, next), TXM_OK);
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

typedef struct everything {
    const shape *s, *input;
    const txm_mesh_place *sources;
    uint64_t hash;
} everything;

static txm_status run_swept(void *context, txm_env *env) {
    everything *all = (everything *)context;
    return run_all(all->s, all->input, all->sources, env, &all->hash);
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
    everything all = {&s, &input, sources, 0};
    assert_true(tk_sweep(run_swept, &all, TK_ALLOCATION) > 20);
    assert_true(tk_sweep(run_swept, &all, TK_ONWARD) > 20);
    assert_true(tk_sweep(run_swept, &all, TK_CANCEL) > 20);
    free(sources);
    shape_free(&s);
    shape_free(&input);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_normals),
        cmocka_unit_test(test_transfer),
        cmocka_unit_test(test_transfer_corners),
        cmocka_unit_test(test_transfer_along_seams),
        cmocka_unit_test(test_transfer_on_sides),
        cmocka_unit_test(test_transfer_identity),
        cmocka_unit_test(test_split),
        cmocka_unit_test(test_atlas),
        cmocka_unit_test(test_choose),
        cmocka_unit_test(test_colors),
        cmocka_unit_test(test_tiles),
        cmocka_unit_test(test_same_bytes_and_failures),
    };
    return cmocka_run_group_tests_name("trimesh_cover", tests, NULL, NULL);
}
