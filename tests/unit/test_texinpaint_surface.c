/* test_texinpaint_surface.c - from meshes and pictures to flat windows and back: distances on a surface,
   flattening, windows one after another, gutters
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texinpaint_surface && build/tests/unit/test_texinpaint_surface */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "texinpaint/layout.h"

#include "testkit.h"

static const double pi = 3.14159265358979323846;

/* ---- scenes --------------------------------------------------------------------------------- */

enum { MOST = 20000 };

/* A mesh whose corners each have a texture coordinate, and its texture. */
typedef struct scene {
    texinpaint_desc desc;
    float at[3 * MOST], uv[6 * MOST];
    uint32_t corner[3 * MOST], entry[3 * MOST];
    int side;          /* of the texture, texels                                               */
    uint8_t *truth;    /* RGB                                                                  */
    uint8_t *pixels;   /* what is completed                                                    */
    uint8_t *mask;     /* 255: missing at first                                                */
    txi_domain d;
    txm_arena memory;
} scene;

static scene s;

static void begin(int side) {
    memset(&s, 0, sizeof s);
    s.side = side;
    s.truth = (uint8_t *)calloc((size_t)side * (size_t)side, 3);
    s.pixels = (uint8_t *)calloc((size_t)side * (size_t)side, 3);
    s.mask = (uint8_t *)calloc((size_t)side * (size_t)side, 1);
    s.desc.mesh.positions = s.at;
    s.desc.mesh.indices = s.corner;
    s.desc.uv = s.uv;
    s.desc.uv_indices = s.entry;
}

static void end(void) {
    txm_arena_free(&s.memory);
    free(s.truth);
    free(s.pixels);
    free(s.mask);
    free(s.d.missing);
    free(s.d.usable);
}

static uint32_t vertex(double x, double y, double z) {
    float *p = s.at + 3 * s.desc.mesh.vertex_count;
    assert_true(s.desc.mesh.vertex_count < MOST);
    p[0] = (float)x;
    p[1] = (float)y;
    p[2] = (float)z;
    return (uint32_t)s.desc.mesh.vertex_count++;
}

/* uv: 6 numbers */
static void face(uint32_t a, uint32_t b, uint32_t c, const double *uv) {
    const size_t f = s.desc.mesh.face_count++;
    const uint32_t v[3] = {a, b, c};
    assert_true(f < MOST);
    for (size_t k = 0; k < 3; k++) {
        s.corner[3 * f + k] = v[k];
        s.entry[3 * f + k] = (uint32_t)(3 * f + k);
        s.uv[6 * f + 2 * k] = (float)uv[2 * k];
        s.uv[6 * f + 2 * k + 1] = (float)uv[2 * k + 1];
    }
    s.desc.uv_count = 3 * s.desc.mesh.face_count;
}

/* A quad a b c d, counter-clockwise; its picture is the rectangle from a's (u, v) to c's. */
static void quad(uint32_t a, uint32_t b, uint32_t c, uint32_t d, double ua, double va, double uc, double vc) {
    const double first[6] = {ua, va, uc, va, uc, vc}, second[6] = {ua, va, uc, vc, ua, vc};
    face(a, b, c, first);
    face(a, c, d, second);
}

/* The domain, as the mask says. */
static void domain(void) {
    const size_t count = (size_t)s.side * (size_t)s.side;
    const txm_image image = {s.pixels, s.side, s.side, 3, TXM_U8, 0};
    s.desc.image = image;
    s.d.desc = &s.desc;
    s.d.width = s.d.height = s.side;
    s.d.map_count = 1;
    s.d.maps[0] = txm_image_resolve(image);
    s.d.missing = (uint8_t *)malloc(count);
    s.d.usable = (uint8_t *)malloc(count);
    txm_arena_init(&s.memory, NULL);
    memcpy(s.pixels, s.truth, 3 * count);
    for (size_t i = 0; i < count; i++) {
        s.d.missing[i] = s.mask[i] > 0;
        s.d.usable[i] = !s.mask[i];
        if (s.mask[i]) memset(s.pixels + 3 * i, 128, 3);
    }
    assert_int_equal(txi_surface_make(&s.d, &s.memory, NULL), TXM_OK);
}

/* Go through all windows, with the truth as their completion. Checks what must hold of each; returns how
   many there were. */
static int complete(void) {
    const size_t count = (size_t)s.side * (size_t)s.side;
    uint8_t *none = (uint8_t *)calloc(count, 1), *hits = (uint8_t *)calloc(count, 1);
    uint8_t *before = (uint8_t *)malloc(count);
    txi_domain truth = s.d;
    int windows = 0, found = 1;
    truth.maps[0].pixels = s.truth;
    truth.missing = none;
    for (;; windows++) {
        txm_arena arena;
        txi_window w;
        txm_arena_init(&arena, NULL);
        memcpy(before, s.d.missing, count);
        assert_int_equal(txi_windows_next(&s.d, &arena, NULL, &w, &found), TXM_OK);
        assert_memory_equal(before, s.d.missing, count);
        if (!found) {
            txm_arena_free(&arena);
            break;
        }
        assert_true(w.target_count > 0);
        float *values = (float *)malloc((size_t)w.width * (size_t)w.height * 3 * sizeof(float));
        txi_window_read(&truth, &w, 0, values);
        for (size_t i = 0; i < (size_t)w.width * (size_t)w.height; i++) {
            if (w.state[i] == TXI_VOID) continue;
            if (!txm_is_finite(values[3 * i]) || !txm_is_finite(w.place[i].x) ||
                !(fabsf(txm_vec3_length(w.normal[i]) - 1) < 1e-3f))
                fail_msg("pixel %zu: value, place or normal", i);
        }
        for (size_t i = 0; i < w.target_count; i++) {
            const txi_target *t = &w.targets[i];
            if (!s.d.missing[t->texel] || !s.d.covered[t->texel] || hits[t->texel]++)
                fail_msg("texel %u must not be a target", (unsigned)t->texel);
        }
        txi_window_write(&s.d, &w, 0, values);
        txi_window_done(&s.d, &w);
        free(values);
        txm_arena_free(&arena);
    }
    for (size_t i = 0; i < count; i++) {
        if (hits[i] != (s.mask[i] && s.d.covered[i])) fail_msg("texel %zu: written %d times", i, hits[i]);
        if (!s.mask[i] && memcmp(s.pixels + 3 * i, s.truth + 3 * i, 3) != 0)
            fail_msg("texel %zu changed", i);
    }
    free(none);
    free(hits);
    free(before);
    return windows;
}

/* The mean difference of what was completed from the truth, in levels. */
static double error(void) {
    double sum = 0, n = 0;
    for (size_t i = 0; i < (size_t)s.side * (size_t)s.side; i++) {
        if (!s.mask[i] || !s.d.covered[i]) continue;
        for (size_t c = 0; c < 3; c++) sum += fabs((double)s.pixels[3 * i + c] - s.truth[3 * i + c]);
        n += 3;
    }
    return n > 0 ? sum / n : 0;
}

/* Paint a texture that is a function of the place on the surface, and mask what lies within a radius of a
   point, or, radius 0, what fits between two heights. */
static void paint(double x, double y, double z, double radius, double low, double high) {
    s.d.missing = (uint8_t *)calloc((size_t)s.side * (size_t)s.side, 1);
    s.d.width = s.d.height = s.side;
    s.d.desc = &s.desc;
    txm_arena_init(&s.memory, NULL);
    assert_int_equal(txi_surface_make(&s.d, &s.memory, NULL), TXM_OK);
    for (uint32_t i = 0; i < (uint32_t)(s.side * s.side); i++) {
        const uint32_t f = s.d.surface->owner[i];
        if (f == TXI_NO_FACE) continue;
        const txm_dvec3 p = txi_texel_point(&s.d, f, i), q = txm_d3(x, y, z);
        s.truth[3 * i] = (uint8_t)(128 + 100 * sin(9 * p.x + 4 * p.y));
        s.truth[3 * i + 1] = (uint8_t)(128 + 100 * sin(8 * p.y - 5 * p.z));
        s.truth[3 * i + 2] = (uint8_t)(128 + 100 * sin(7 * p.z + 3 * p.x));
        if (radius > 0 ? txm_d3_dist(p, q) < radius : p.y > low && p.y < high) s.mask[i] = 255;
    }
    free(s.d.missing);
    txm_arena_free(&s.memory);
    memset(&s.d, 0, sizeof s.d);
}

/* A sheet of n x n squares of side 1 / n, bent around the y axis by this angle in all; its charts are strips
   of `strip` columns, laid side by side in another order, a margin of 1/16 around each. */
static void sheet(int n, int strip, double angle, int is_closed) {
    const int strips = n / strip, columns = is_closed ? n : n + 1;
    for (int j = 0; j <= n; j++) {
        for (int i = 0; i < columns; i++) {
            const double a = angle * i / n, r = angle > 0 ? 1 / angle : 0;
            if (angle > 0) vertex(r * sin(a), (double)j / n, r * cos(a));
            else vertex((double)i / n, (double)j / n, 0);
        }
    }
    for (int j = 0; j < n; j++) {
        for (int i = 0; i < n; i++) {
            const uint32_t a = (uint32_t)(j * columns + i), b = (uint32_t)(j * columns + (i + 1) % columns);
            const uint32_t d = a + (uint32_t)columns, c = b + (uint32_t)columns;
            const int at = (i / strip * 3 + 1) % strips; /* 3 and strips have no common factor */
            const double wide = 0.875 / strip / strips, left = (at + 0.0625) / strips;
            const double u = left + i % strip * wide, v = 0.9 - 0.8 * j / n;
            quad(a, b, c, d, u, v, u + wide, v - 0.8 / n);
        }
    }
}

/* ---- distances ------------------------------------------------------------------------------ */

static void test_distance_on_a_plane(void **state) {
    enum { N = 40 };
    static double distance[MOST];
    txm_rng rng = txm_rng_make(1, 2);
    (void)state;
    begin(4);
    for (int y = 0; y < N; y++) {
        for (int x = 0; x < N; x++) {
            const int inner = x > 0 && y > 0 && x < N - 1 && y < N - 1;
            const double dx = inner ? 0.5 * (double)txm_rng_float(&rng) : 0;
            const double dy = inner ? 0.5 * (double)txm_rng_float(&rng) : 0;
            vertex(x + dx, 3 * (y + dy), 0); /* three times as high as wide: obtuse triangles */
        }
    }
    for (uint32_t y = 0; y + 1 < N; y++)
        for (uint32_t x = 0; x + 1 < N; x++)
            quad(y * N + x, y * N + x + 1, y * N + N + x + 1, y * N + N + x, 0, 0, 1, 1);
    domain();
    const uint32_t source = N * N / 2 + N / 3;
    assert_int_equal(txi_geodesic(s.d.surface, &source, NULL, 1, 1e9, NULL, distance), TXM_OK);
    for (uint32_t v = 0; v < N * N; v++) {
        const double truth = txm_d3_dist(s.d.surface->point[v], s.d.surface->point[source]);
        assert_true(fabs(distance[v] - truth) <= 1e-6 * truth);
    }
    /* not beyond the limit; from two sources; from a whole edge */
    assert_int_equal(txi_geodesic(s.d.surface, &source, NULL, 1, 10, NULL, distance), TXM_OK);
    for (uint32_t v = 0; v < N * N; v++) {
        const double truth = txm_d3_dist(s.d.surface->point[v], s.d.surface->point[source]);
        if (fabs(truth - 10) > 1e-6) assert_int_equal(distance[v] < TXI_UNREACHED, truth < 10);
    }
    uint32_t row[N];
    for (uint32_t x = 0; x < N; x++) row[x] = x;
    assert_int_equal(txi_geodesic(s.d.surface, row, NULL, N, 1e9, NULL, distance), TXM_OK);
    for (uint32_t v = 0; v < N * N; v++)
        assert_true(fabs(distance[v] - s.d.surface->point[v].y) <= 0.02 * distance[v]);
    end();
}

/* the octahedron, its faces divided into n^2, on the unit sphere */
static void ball(int n) {
    static const int sign[2] = {1, -1};
    for (int side = 0; side < 8; side++) {
        const int sx = sign[side & 1], sy = sign[side >> 1 & 1], sz = sign[side >> 2];
        uint32_t index[65][65];
        for (int i = 0; i <= n; i++) {
            for (int j = 0; i + j <= n; j++) {
                const double x = i, y = j, z = n - i - j, r = sqrt(x * x + y * y + z * z);
                index[i][j] = vertex(sx * x / r, sy * y / r, sz * z / r);
            }
        }
        for (int i = 0; i < n; i++) {
            for (int j = 0; i + j < n; j++) {
                const int flip = sx * sy * sz < 0;
                const int column = side % 3, row = side / 3; /* of charts */
                const double u0 = column / 3.0 + 0.02, v0 = row / 3.0 + 0.02, h = 0.29 / n;
                const double lower[6] = {u0 + i * h, v0 + j * h, u0 + (i + 1) * h, v0 + j * h,
                                         u0 + i * h, v0 + (j + 1) * h};
                const double upper[6] = {u0 + (i + 1) * h, v0 + (j + 1) * h, u0 + i * h, v0 + (j + 1) * h,
                                         u0 + (i + 1) * h, v0 + j * h};
                const double lower2[6] = {lower[0], lower[1], lower[4], lower[5], lower[2], lower[3]};
                const double upper2[6] = {upper[0], upper[1], upper[4], upper[5], upper[2], upper[3]};
                if (flip) face(index[i][j], index[i][j + 1], index[i + 1][j], lower2);
                else face(index[i][j], index[i + 1][j], index[i][j + 1], lower);
                if (i + j + 1 >= n) continue;
                if (flip) face(index[i + 1][j + 1], index[i + 1][j], index[i][j + 1], upper2);
                else face(index[i + 1][j + 1], index[i][j + 1], index[i + 1][j], upper);
            }
        }
    }
}

static void test_distance_on_a_sphere(void **state) {
    static double distance[MOST];
    (void)state;
    begin(4);
    ball(48);
    domain();
    const txi_surface *sphere = s.d.surface;
    assert_int_equal(sphere->vertex_count, 4 * 48 * 48 + 2); /* seams are welded */
    for (uint32_t source = 5; source < 3000; source += 1000) {
        double mean = 0;
        assert_int_equal(txi_geodesic(sphere, &source, NULL, 1, 1e9, NULL, distance), TXM_OK);
        for (uint32_t v = 0; v < sphere->vertex_count; v++) {
            const double dot = txm_d3_dot(sphere->point[v], sphere->point[source]);
            const double truth = acos(dot > 1 ? 1 : dot < -1 ? -1 : dot);
            if (truth < 0.1) continue;
            assert_true(fabs(distance[v] - truth) < 0.01 * truth);
            mean += fabs(distance[v] - truth) / truth / (double)sphere->vertex_count;
        }
        assert_true(mean < 0.003);
    }
    end();
}

/* ---- parts -------------------------------------------------------------------------------- */

static void test_angles(void **state) {
    (void)state;
    for (int i = 0; i <= 1000; i++) {
        const double a = pi * i / 1000, x = cos(a), y = fabs(sin(a));
        assert_true(fabs(txi_angle(7 * x, 7 * y) - a) < 1e-8);
    }
    assert_true(fabs(txi_angle(0, 0)) <= 0);
    begin(4);
    ball(8);
    domain();
    double sum = 0;
    for (uint32_t v = 0; v < s.d.surface->vertex_count; v++) sum += txi_angle_lack(s.d.surface, v);
    assert_true(fabs(sum - 4 * pi) < 1e-6); /* Gauss and Bonnet */
    end();
}

/* A grid's Laplacian with random weights: the solution must satisfy it. */
static void test_factor(void **state) {
    enum { N = 40, COUNT = N * N, EDGES = 2 * N * (N - 1) };
    static txm_dvec3 point[COUNT];
    static uint32_t low[EDGES], high[EDGES];
    static double weight[EDGES], diagonal[COUNT], right[2 * COUNT], x[2 * COUNT], back[2 * COUNT];
    txm_rng rng = txm_rng_make(3, 4);
    txm_arena arena;
    txi_factor factor;
    size_t edges = 0;
    (void)state;
    for (uint32_t i = 0; i < COUNT; i++) {
        const uint32_t column = i % N, row = i / N;
        point[i] = txm_d3(column, row, (double)txm_rng_float(&rng));
        diagonal[i] = 0.01 + (double)txm_rng_float(&rng);
        right[2 * i] = x[2 * i] = (double)txm_rng_float(&rng);
        right[2 * i + 1] = x[2 * i + 1] = (double)txm_rng_float(&rng);
        if (i % N + 1 < N) {
            low[edges] = i;
            high[edges++] = i + 1;
        }
        if (i / N + 1 < N) {
            low[edges] = i;
            high[edges++] = i + N;
        }
    }
    assert_int_equal(edges, EDGES);
    for (size_t e = 0; e < edges; e++) {
        weight[e] = 0.05 + (double)txm_rng_float(&rng);
        diagonal[low[e]] += weight[e];
        diagonal[high[e]] += weight[e];
    }
    txm_arena_init(&arena, NULL);
    assert_int_equal(txi_factor_plan(&factor, COUNT, point, edges, low, high, &arena, NULL), TXM_OK);
    assert_true(factor.first[COUNT] < 40 * COUNT); /* few entries: rows come in a good order */
    for (int pass = 0; pass < 2; pass++) { /* a plan may be used again */
        memcpy(x, right, sizeof x);
        txi_factor_make(&factor, weight, diagonal);
        txi_factor_solve(&factor, x);
    }
    for (size_t i = 0; i < 2 * COUNT; i++) back[i] = diagonal[i / 2] * x[i];
    for (size_t e = 0; e < edges; e++) {
        for (size_t k = 0; k < 2; k++) {
            back[2 * low[e] + k] -= weight[e] * x[2 * high[e] + k];
            back[2 * high[e] + k] -= weight[e] * x[2 * low[e] + k];
        }
    }
    for (size_t i = 0; i < 2 * COUNT; i++) assert_true(fabs(back[i] - right[i]) < 1e-9);
    txm_arena_free(&arena);
}

static void test_nearest(void **state) {
    static uint8_t marks[40 * 40];
    static int32_t nearest[40 * 40];
    (void)state;
    for (uint64_t seed = 0; seed < 30; seed++) {
        txm_rng rng = txm_rng_make(seed, 1);
        const int w = txm_rng_range(&rng, 1, 40), h = txm_rng_range(&rng, 1, 40);
        const uint32_t rare = txm_rng_below(&rng, 200) + 1;
        int any = 0;
        for (int i = 0; i < w * h; i++) any |= marks[i] = txm_rng_below(&rng, rare) == 0;
        assert_int_equal(txi_nearest(marks, w, h, NULL, nearest), TXM_OK);
        for (int i = 0; i < w * h; i++) {
            int best = -1, least = 0;
            for (int k = 0; k < w * h; k++) {
                const int dx = k % w - i % w, dy = k / w - i / w;
                if (!marks[k] || (best >= 0 && dx * dx + dy * dy >= least)) continue;
                best = k;
                least = dx * dx + dy * dy;
            }
            assert_int_equal(nearest[i] >= 0, any);
            if (!any) continue;
            const int dx = nearest[i] % w - i % w, dy = nearest[i] / w - i / w;
            assert_true(marks[nearest[i]]);
            assert_int_equal(dx * dx + dy * dy, least);
        }
    }
}

/* ---- windows of surfaces ---------------------------------------------------------------------- */

/* On flat charts pixels and texels coincide, but for where charts meet. */
static void test_sheet(void **state) {
    (void)state;
    begin(256);
    sheet(28, 7, 0, 0);
    paint(0.5, 0.5, 0, 0.2, 0, 0);
    domain();
    assert_int_equal(complete(), 1);
    assert_true(error() < 1);
    end();
}

/* Across a border of the mesh: nothing is cut there. */
static void test_border(void **state) {
    (void)state;
    begin(256);
    sheet(28, 7, 0, 0);
    paint(0.1, 0.5, 0, 0.2, 0, 0);
    domain();
    assert_int_equal(complete(), 1);
    assert_true(error() < 1);
    end();
}

/* On a ball, over the corner where four of its charts meet. */
static void test_ball(void **state) {
    (void)state;
    begin(256);
    ball(24);
    paint(0, 0, 1, 0.4, 0, 0);
    domain();
    assert_int_equal(complete(), 1);
    assert_true(error() < 1.5);
    end();
}

/* All round a limb: the disk's cut must not stay without a window that steps across it. */
static void test_limb(void **state) {
    txm_arena arena;
    txi_window w;
    int found;
    (void)state;
    begin(256);
    sheet(28, 7, 2 * pi, 1);
    paint(0, 0, 0, 0, 0.4, 0.6);
    domain();
    txm_arena_init(&arena, NULL);
    assert_int_equal(txi_windows_next(&s.d, &arena, NULL, &w, &found), TXM_OK);
    size_t holes = 0, total = 0;
    for (size_t i = 0; i < (size_t)s.side * (size_t)s.side; i++) total += s.mask[i] && s.d.covered[i];
    for (int i = 0; i < w.width * w.height; i++) holes += w.state[i] == TXI_HOLE;
    /* the window shows the whole hole, but does not complete what lies at its cut */
    assert_true(holes > total * 9 / 10);
    assert_true(w.target_count < total && w.target_count > total / 2);
    txm_arena_free(&arena);
    const int windows = complete();
    assert_true(windows == 2 || windows == 3);
    assert_true(error() < 1);
    end();
}

/* Nearly everything is missing. */
static void test_large_hole(void **state) {
    (void)state;
    begin(256);
    ball(24);
    paint(0, 0, 1, 1.8, 0, 0);
    domain();
    const int windows = complete();
    assert_true(windows > 1 && windows < 30);
    assert_true(error() < 3);
    end();
}

static void test_all_or_nothing(void **state) {
    (void)state;
    begin(64);
    ball(8);
    memset(s.mask, 255, 64 * 64);
    domain();
    assert_true(complete() > 0);
    end();
    begin(64);
    ball(8);
    domain();
    assert_int_equal(complete(), 0);
    end();
}

/* Many specks do not take a window each. */
static void test_specks(void **state) {
    (void)state;
    begin(256);
    sheet(28, 7, 0, 0);
    paint(9, 9, 9, 0.1, 0, 0);
    for (size_t i = 0; i < 256 * 256; i++) s.mask[i] = i % 16 < 2 && i / 256 % 16 < 2 ? 255 : 0;
    domain();
    assert_true(complete() < 10);
    assert_true(error() < 1);
    end();
}

/* Two quads that share their texels, one of them mirrored: each texel is written once, for the first of
   them, and then both are complete. */
static void test_mirrored(void **state) {
    txm_arena arena;
    txi_window w;
    int found, mirrored = 0, plain = 0;
    (void)state;
    begin(64);
    for (int i = 0; i < 3; i++) vertex(i, 0, 0);
    for (int i = 0; i < 3; i++) vertex(i, 1, 0);
    quad(0, 1, 4, 3, 0, 1, 1, 0);
    quad(1, 2, 5, 4, 1, 1, 0, 0);
    for (size_t i = 0; i < 64 * 64; i++) {
        const int x = (int)(i % 64), y = (int)(i / 64);
        for (size_t c = 0; c < 3; c++) s.truth[3 * i + c] = (uint8_t)(3 * x + y / 2);
        if (x > 40 && y > 20 && y < 40) s.mask[i] = 255;
    }
    domain();
    for (size_t i = 0; i < 64 * 64; i++) assert_true(s.d.surface->owner[i] < 2);
    assert_int_equal(s.d.surface->chart[0], s.d.surface->chart[2]);
    txm_arena_init(&arena, NULL);
    assert_int_equal(txi_windows_next(&s.d, &arena, NULL, &w, &found), TXM_OK);
    for (int i = 0; i < w.width * w.height; i++) {
        if (w.state[i] != TXI_HOLE) continue;
        mirrored += w.mirrored[i];
        plain += !w.mirrored[i];
    }
    assert_true(abs(mirrored - plain) < 80 && plain > 300);
    for (size_t i = 0; i < w.target_count; i++) assert_false(w.targets[i].mirrored);
    txm_arena_free(&arena);
    assert_int_equal(complete(), 1);
    assert_true(error() < 1);
    end();
}

/* Texture coordinates anywhere: the picture repeats. */
static void test_repeats(void **state) {
    (void)state;
    begin(64);
    for (int j = 0; j < 3; j++)
        for (int i = 0; i < 3; i++) vertex(i, j, 0);
    for (uint32_t j = 0; j < 2; j++)
        for (uint32_t i = 0; i < 2; i++)
            quad(3 * j + i, 3 * j + i + 1, 3 * j + i + 4, 3 * j + i + 3, i - 7.5, 3.25 - j, i - 6.5, 2.25 - j);
    for (size_t i = 0; i < 64 * 64; i++) {
        const double a = 2 * pi * (double)i / 64;
        for (size_t c = 0; c < 3; c++) s.truth[3 * i + c] = (uint8_t)(128 + 100 * sin(a));
        if (i % 64 > 20 && i % 64 < 36 && i / 64 > 26 && i / 64 < 36) s.mask[i] = 255;
    }
    domain();
    for (size_t i = 0; i < 64 * 64; i++) assert_int_equal(s.d.covered[i], 1);
    assert_true(complete() >= 1);
    assert_true(error() < 1);
    end();
}

/* Three sheets at one edge, a face that runs the other way, faces without area, in space or in the atlas. */
static void test_bad_meshes(void **state) {
    const double a[6] = {0, 0, 0.5, 0, 0.5, 0.5}, b[6] = {0.5, 0.5, 1, 0.5, 1, 1};
    const double line[6] = {0.1, 0.9, 0.2, 0.9, 0.3, 0.9};
    (void)state;
    begin(64);
    vertex(0, 0, 0);
    vertex(1, 0, 0);
    vertex(0, 1, 0);
    vertex(0, -1, 0);
    vertex(0, 0, 1);
    vertex(0, 0, 0); /* where vertex 0 is */
    face(0, 1, 2, a);
    face(1, 0, 3, b);
    face(0, 1, 4, a);
    face(5, 1, 2, b);
    face(2, 3, 4, line);
    face(2, 2, 4, b);
    face(0, 5, 0, a);
    face(1, 2, 3, b);
    memset(s.mask, 255, 64 * 64 / 2);
    domain();
    complete();
    end();
    /* all in one point */
    begin(64);
    for (int i = 0; i < 4; i++) vertex(1, 1, 1);
    quad(0, 1, 2, 3, 0.2, 0.2, 0.7, 0.7);
    memset(s.mask, 255, 64 * 64 / 2);
    domain();
    assert_true(complete() >= 1);
    end();
}

/* Random triangles with random coordinates: complete() checks that all that is covered is written once and
   nothing else changes. */
static void test_random_meshes(void **state) {
    (void)state;
    for (uint64_t seed = 0; seed < 40; seed++) {
        txm_rng rng = txm_rng_make(seed, 9);
        const uint32_t points = 3 + txm_rng_below(&rng, 20);
        const double scale = txm_rng_below(&rng, 3) ? 1 : 5;
        begin(txm_rng_range(&rng, 1, 40));
        for (uint32_t i = 0; i < points; i++)
            vertex(txm_rng_below(&rng, 3), txm_rng_below(&rng, 3), txm_rng_below(&rng, 4) * 0.5);
        for (uint32_t i = txm_rng_below(&rng, 40) + 1; i > 0; i--) {
            double uv[6];
            for (int k = 0; k < 6; k++) uv[k] = scale * ((double)txm_rng_float(&rng) - 0.3);
            face(txm_rng_below(&rng, points), txm_rng_below(&rng, points), txm_rng_below(&rng, points), uv);
        }
        for (int i = 0; i < s.side * s.side; i++) s.mask[i] = txm_rng_below(&rng, 4) ? 0 : 255;
        domain();
        complete();
        end();
    }
}

static void test_gutter(void **state) {
    txm_arena arena;
    size_t count;
    (void)state;
    for (int gutter = -1; gutter < 6; gutter += 3) { /* none, 2, 5 */
        begin(64);
        for (int i = 0; i < 4; i++) vertex(i % 3 > 0, i > 1, 0);
        quad(0, 1, 2, 3, 0.25, 0.25, 0.75, 0.75);
        for (size_t i = 0; i < 3 * 64 * 64; i++) s.truth[i] = (uint8_t)(i * 7);
        for (size_t i = 0; i < 64 * 64; i++) s.mask[i] = i / 64 >= 30 ? 255 : 0;
        s.desc.gutter = gutter;
        domain();
        complete();
        txm_arena_init(&arena, NULL);
        assert_int_equal(txi_gutter(&s.d, &arena, NULL, &count), TXM_OK);
        assert_true(gutter > 0 ? count > 0 : count == 0);
        txm_arena_free(&arena);
        for (int y = 0; y < 64; y++) {
            for (int x = 0; x < 64; x++) {
                const int cx = txm_clampi(x, 16, 47), cy = txm_clampi(y, 16, 47);
                const int apart = (x - cx) * (x - cx) + (y - cy) * (y - cy);
                const size_t i = (size_t)(64 * y + x), from = (size_t)(64 * cy + cx);
                const int filled = y >= 30 && apart > 0 && gutter > 0 && apart <= gutter * gutter;
                if (y < 30) assert_memory_equal(s.pixels + 3 * i, s.truth + 3 * i, 3);
                else if (filled) assert_memory_equal(s.pixels + 3 * i, s.pixels + 3 * from, 3);
                else if (apart > 0) assert_int_equal(s.pixels[3 * i], 128);
                assert_int_equal(s.d.missing[i], y >= 30 && apart > 0 && !filled);
            }
        }
        end();
    }
}

/* ---- windows of pictures ---------------------------------------------------------------------- */

static void test_pictures(void **state) {
    (void)state;
    for (int kind = 0; kind < 4; kind++) {
        const int side = kind == 3 ? 1100 : 300;
        begin(side);
        for (int i = 0; i < side * side; i++) {
            const int x = i % side, y = i / side;
            for (int c = 0; c < 3; c++) s.truth[3 * i + c] = (uint8_t)(x * 3 + y * 7 + c);
            if (kind == 0) s.mask[i] = x > 280 && y > 100 && y < 160 ? 255 : 0;
            if (kind == 1) s.mask[i] = x % 30 == 7 && y % 30 == 9 ? 255 : 0;
            if (kind == 2) s.mask[i] = 255;
            if (kind == 3) s.mask[i] = x > 100 && y > 100 ? 255 : 0; /* more than a window holds */
        }
        domain();
        const int windows = complete();
        assert_int_equal(windows > 1, kind == 3);
        assert_true(windows < 20);
        assert_true(error() <= 0); /* pixels are texels */
        end();
    }
}

/* A window grows until it has enough to copy from. */
static void test_source(void **state) {
    static uint8_t source[600 * 600];
    txm_arena arena;
    txi_window w;
    int found, usable = 0, foreign = 0;
    (void)state;
    begin(600);
    for (int i = 0; i < 600 * 600; i++) {
        s.mask[i] = i % 600 < 30 && i / 600 < 30 ? 255 : 0;
        source[i] = i % 600 > 400 && i / 600 > 400 ? 255 : 0;
    }
    const txm_image from = {source, 600, 600, 1, TXM_U8, 0};
    s.desc.source = from;
    domain();
    for (int i = 0; i < 600 * 600; i++) s.d.usable[i] = source[i] > 0;
    txm_arena_init(&arena, NULL);
    assert_int_equal(txi_windows_next(&s.d, &arena, NULL, &w, &found), TXM_OK);
    for (int i = 0; i < w.width * w.height; i++) {
        usable += w.state[i] == TXI_KNOWN;
        foreign += w.state[i] == TXI_FOREIGN;
    }
    assert_true(usable >= 10000 && foreign >= 10000);
    txi_window_done(&s.d, &w);
    assert_int_equal(s.d.usable[0], 0); /* and what it completes is not copied from */
    assert_int_equal(s.d.missing[0], 0);
    txm_arena_free(&arena);
    end();
}

/* What may be copied from lies on another piece of the mesh: a part of it is laid out beside the hole. */
static void test_source_apart(void **state) {
    static uint8_t source[128 * 128];
    txm_arena arena;
    txi_window w;
    int found, usable = 0, foreign = 0, holes = 0;
    (void)state;
    begin(128);
    for (int k = 0; k < 2; k++) {
        for (int i = 0; i < 4; i++) vertex(i % 3 > 0, i > 1, k);
        quad((uint32_t)(4 * k), (uint32_t)(4 * k + 1), (uint32_t)(4 * k + 2), (uint32_t)(4 * k + 3),
             k * 0.5 + 0.02, 0.02, k * 0.5 + 0.48, 0.98);
    }
    for (int i = 0; i < 128 * 128; i++) {
        const int x = i % 128, y = i / 128;
        s.mask[i] = x > 20 && x < 40 && y > 50 && y < 80 ? 255 : 0;
        source[i] = x > 64 ? 255 : 0;
    }
    const txm_image from = {source, 128, 128, 1, TXM_U8, 0};
    s.desc.source = from;
    domain();
    for (int i = 0; i < 128 * 128; i++) s.d.usable[i] = source[i] > 0;
    txm_arena_init(&arena, NULL);
    assert_int_equal(txi_windows_next(&s.d, &arena, NULL, &w, &found), TXM_OK);
    for (int i = 0; i < w.width * w.height; i++) {
        usable += w.state[i] == TXI_KNOWN;
        foreign += w.state[i] == TXI_FOREIGN;
        holes += w.state[i] == TXI_HOLE;
    }
    assert_true(usable > 3000 && foreign > 3000);
    assert_int_equal(w.target_count, 19 * 29);
    assert_true(abs(holes - 19 * 29) < 120);
    txm_arena_free(&arena);
    assert_int_equal(complete(), 1);
    end();
}

/* A scratch along a panorama: its windows are no longer than offsets within them can be. */
static void test_long_picture(void **state) {
    enum { WIDTH = 9000, HEIGHT = 24 };
    static uint8_t missing[WIDTH * HEIGHT], usable[WIDTH * HEIGHT], pixels[WIDTH * HEIGHT];
    const txm_image image = {pixels, WIDTH, HEIGHT, 1, TXM_U8, 0};
    texinpaint_desc desc;
    txi_domain d;
    txm_arena memory;
    int left = 1;
    (void)state;
    memset(&desc, 0, sizeof desc);
    memset(&d, 0, sizeof d);
    desc.image = image;
    d.desc = &desc;
    d.width = WIDTH;
    d.height = HEIGHT;
    d.map_count = 1;
    d.maps[0] = txm_image_resolve(image);
    d.missing = missing;
    d.usable = usable;
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        missing[i] = i / WIDTH > 7 && i / WIDTH < 16 && i % WIDTH > 50 && i % WIDTH < WIDTH - 50;
        usable[i] = !missing[i];
    }
    txm_arena_init(&memory, NULL);
    assert_int_equal(txi_surface_make(&d, &memory, NULL), TXM_OK);
    for (int count = 0; left; count++) {
        txm_arena arena;
        txi_window w;
        txm_arena_init(&arena, NULL);
        assert_int_equal(txi_windows_next(&d, &arena, NULL, &w, &left), TXM_OK);
        assert_true(count < 40);
        if (left) {
            assert_true(w.width <= TXI_SIDE_MOST && w.target_count > 0);
            txi_window_done(&d, &w);
        }
        txm_arena_free(&arena);
    }
    txm_arena_free(&memory);
}

/* ---- faults --------------------------------------------------------------------------------- */

static txm_status all_of_it(void *context, txm_env *env) {
    txm_arena domain_arena, arena;
    txi_window w;
    int found;
    size_t filled;
    txi_domain d = s.d;
    (void)context;
    txm_arena_init(&domain_arena, env);
    txm_arena_init(&arena, env);
    txm_status status = txi_surface_make(&d, &domain_arena, env);
    if (status == TXM_OK) status = txi_windows_next(&d, &arena, env, &w, &found);
    if (status == TXM_OK) status = txi_gutter(&d, &arena, env, &filled);
    txm_arena_free(&arena);
    txm_arena_free(&domain_arena);
    return status;
}

static void test_faults(void **state) {
    (void)state;
    begin(64);
    sheet(14, 7, 2 * pi, 1);
    paint(0, 0, 0, 0, 0.4, 0.6);
    domain();
    uint8_t *missing = s.d.missing, copy[64 * 64];
    memcpy(copy, missing, sizeof copy);
    assert_true(tk_sweep(all_of_it, NULL, TK_ALLOCATION) > 20);
    assert_true(tk_sweep(all_of_it, NULL, TK_ONWARD) > 20);
    end();
    begin(64); /* a picture: its marks are taken back */
    for (size_t i = 0; i < 64 * 64; i++) s.mask[i] = i % 7 == 0 && i / 64 % 5 < 3 ? 255 : 0;
    domain();
    missing = s.d.missing;
    memcpy(copy, missing, sizeof copy);
    assert_true(tk_sweep(all_of_it, NULL, TK_ALLOCATION) > 5);
    assert_memory_equal(copy, missing, sizeof copy);
    end();
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_distance_on_a_plane), cmocka_unit_test(test_distance_on_a_sphere),
        cmocka_unit_test(test_angles),              cmocka_unit_test(test_factor),
        cmocka_unit_test(test_nearest),             cmocka_unit_test(test_sheet),
        cmocka_unit_test(test_border),              cmocka_unit_test(test_ball),
        cmocka_unit_test(test_limb),                cmocka_unit_test(test_large_hole),
        cmocka_unit_test(test_all_or_nothing),      cmocka_unit_test(test_specks),
        cmocka_unit_test(test_mirrored),            cmocka_unit_test(test_repeats),
        cmocka_unit_test(test_bad_meshes),          cmocka_unit_test(test_random_meshes),
        cmocka_unit_test(test_gutter),              cmocka_unit_test(test_pictures),
        cmocka_unit_test(test_source),              cmocka_unit_test(test_source_apart),
        cmocka_unit_test(test_long_picture),        cmocka_unit_test(test_faults),
    };
    return cmocka_run_group_tests_name("texinpaint: surfaces and windows", tests, NULL, NULL);
}
