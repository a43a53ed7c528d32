/* test_texinpaint_crest.c - crest lines of shapes whose ridges are known, and lines in windows
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texinpaint_crest && build/tests/unit/test_texinpaint_crest */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "texinpaint/prior.h"

#include "testkit.h"

static const double pi = 3.14159265358979323846;

/* ---- shapes -------------------------------------------------------------------------------- */

enum { MOST_VERTICES = 45000, MOST_FACES = 84000 };

static float at[3 * MOST_VERTICES];
static uint32_t corner[3 * MOST_FACES];
static size_t vertices, faces;

static void point(double x, double y, double z) {
    float *p = at + 3 * vertices++;
    assert_true(vertices <= MOST_VERTICES);
    p[0] = (float)x;
    p[1] = (float)y;
    p[2] = (float)z;
}

static void face(size_t a, size_t b, size_t c) {
    uint32_t *t = corner + 3 * faces++;
    assert_true(faces <= MOST_FACES);
    t[0] = (uint32_t)a;
    t[1] = (uint32_t)b;
    t[2] = (uint32_t)c;
}

static void clear(void) {
    vertices = faces = 0;
}

/* A sphere of radius 1 over the faces of a cube, n x n squares each; seams have double vertices. */
static void sphere(size_t n) {
    clear();
    for (int side = 0; side < 6; side++) {
        const size_t base = vertices;
        for (size_t i = 0; i <= n; i++) {
            for (size_t j = 0; j <= n; j++) {
                /* from equal angles, so that squares are about equal */
                const double u = tan(pi / 4 * (2.0 * (double)i / (double)n - 1));
                const double v = tan(pi / 4 * (2.0 * (double)j / (double)n - 1));
                const double s = side < 3 ? 1 : -1, length = sqrt(1 + u * u + v * v);
                double p[3];
                p[side % 3] = s / length;
                p[(side + 1) % 3] = s * u / length;
                p[(side + 2) % 3] = v / length;
                for (int k = 0; k < 3; k++) /* the same bits from both sides of a seam */
                    p[k] = floor(p[k] * 8388608 + 0.5) / 8388608;
                point(p[0], p[1], p[2]);
                if (i == n || j == n) continue;
                const size_t a = base + i * (n + 1) + j, b = a + n + 1;
                face(a, b, b + 1);
                face(a, b + 1, a + 1);
            }
        }
    }
}

static void scale(double x, double y, double z) {
    for (size_t i = 0; i < vertices; i++) {
        at[3 * i] = (float)(at[3 * i] * x);
        at[3 * i + 1] = (float)(at[3 * i + 1] * y);
        at[3 * i + 2] = (float)(at[3 * i + 2] * z);
    }
}

static void noise(double size, uint64_t seed) {
    txm_rng rng = txm_rng_make(seed, 1);
    for (size_t i = 0; i < 3 * vertices; i++)
        at[i] = (float)(at[i] + size * (2 * txm_rng_double(&rng) - 1));
}

/* A torus whose section is an ellipse of half axes a (outwards) and b. */
static void torus(double radius, double a, double b, size_t around, size_t section) {
    clear();
    for (size_t i = 0; i < around; i++) {
        for (size_t j = 0; j < section; j++) {
            const double u = 2 * pi * (double)i / (double)around;
            const double v = 2 * pi * ((double)j + 0.25) / (double)section, r = radius + a * cos(v);
            point(r * cos(u), r * sin(u), b * sin(v));
            const size_t in = (i + 1) % around, jn = (j + 1) % section;
            face(i * section + j, in * section + j, in * section + jn);
            face(i * section + j, in * section + jn, i * section + jn);
        }
    }
}

static texinpaint_crests *crests_of(const texinpaint_crest_desc *options) {
    texinpaint_crest_desc desc;
    texinpaint_crests *crests = NULL;
    txm_env env;
    memset(&desc, 0, sizeof desc);
    memset(&env, 0, sizeof env);
    if (options) desc = *options;
    desc.mesh.positions = at;
    desc.mesh.indices = corner;
    desc.mesh.vertex_count = vertices;
    desc.mesh.face_count = faces;
    if (texinpaint_crest(&desc, &env, &crests) != TXM_OK) fail_msg("%s", env.message);
    for (size_t i = 0; i < crests->line_count; i++) {
        double strength = 0;
        assert_true(crests->lines[i].count >= 2);
        assert_true(i == 0 || crests->strengths[i] <= crests->strengths[i - 1]);
        assert_true(crests->kinds[i] == TEXINPAINT_RIDGE || crests->kinds[i] == TEXINPAINT_VALLEY);
        for (int k = 0; k < 3 * crests->lines[i].count; k++)
            strength += fabs((double)crests->lines[i].points[k]);
        assert_true(txm_is_finite(strength));
    }
    return crests;
}

static double length_of(const texinpaint_line *line) {
    double sum = 0;
    for (int k = 1; k < line->count; k++)
        sum += txm_d3_dist(txm_d3_load(line->points + 3 * k), txm_d3_load(line->points + 3 * k - 3));
    return sum;
}

static int is_closed(const texinpaint_line *line) {
    return memcmp(line->points, line->points + 3 * (line->count - 1), 3 * sizeof(float)) == 0;
}

/* ---- known ridges ---------------------------------------------------------------------------- */

/* The ridge of an ellipsoid of half axes a > b > c: its largest section, z = 0. */
static void test_ellipsoid(void **state) {
    (void)state;
    for (int skew = 0; skew < 2; skew++) {
        sphere(32);
        if (skew) { /* so that no edge lies in the plane of the ridge */
            for (size_t i = 0; i < vertices; i++) {
                const double y = at[3 * i + 1], z = at[3 * i + 2];
                at[3 * i + 1] = (float)(0.96 * y - 0.28 * z);
                at[3 * i + 2] = (float)(0.28 * y + 0.96 * z);
            }
        }
        scale(1.6, 1.25, 0.8);
        texinpaint_crests *c = crests_of(NULL);
        assert_int_equal(c->line_count, 1);
        assert_int_equal(c->kinds[0], TEXINPAINT_RIDGE);
        assert_true(is_closed(&c->lines[0]));
        /* perimeter of the ellipse 1.6, 1.25 */
        assert_true(fabs(length_of(&c->lines[0]) - 8.99) < 0.2);
        for (int k = 0; k < c->lines[0].count; k++) {
            const float *p = c->lines[0].points + 3 * k;
            assert_true(fabsf(p[2]) < 0.02f); /* edges are .05 long */
            assert_true(fabs(p[0] * p[0] / 2.56 + p[1] * p[1] / 1.5625 - 1) < 0.01);
        }
        texinpaint_crests_free(c);
    }
}

/* Turned inside out, the ridge is a valley. */
static void test_kinds(void **state) {
    (void)state;
    texinpaint_crest_desc options;
    memset(&options, 0, sizeof options);
    sphere(24);
    scale(1.6, 1.25, 0.8);
    texinpaint_crests *ridge = crests_of(NULL);
    for (size_t f = 0; f < faces; f++) {
        const uint32_t t = corner[3 * f];
        corner[3 * f] = corner[3 * f + 1];
        corner[3 * f + 1] = t;
    }
    texinpaint_crests *valley = crests_of(NULL);
    assert_int_equal(ridge->line_count, 1);
    assert_int_equal(valley->line_count, 1);
    assert_int_equal(valley->kinds[0], TEXINPAINT_VALLEY);
    assert_true(fabsf(valley->strengths[0] - ridge->strengths[0]) < 1e-4f * ridge->strengths[0]);
    options.kinds = TEXINPAINT_RIDGE;
    texinpaint_crests *none = crests_of(&options);
    assert_int_equal(none->line_count, 0);
    options.kinds = TEXINPAINT_VALLEY;
    texinpaint_crests *same = crests_of(&options);
    assert_int_equal(same->line_count, 1);
    texinpaint_crests_free(ridge);
    texinpaint_crests_free(valley);
    texinpaint_crests_free(none);
    texinpaint_crests_free(same);
    texinpaint_crests_free(NULL);
}

/* A torus of elliptic section has two: outermost and innermost circle, with a known strength. */
static void test_torus(void **state) {
    (void)state;
    torus(3, 1.2, 0.6, 120, 60);
    texinpaint_crests *c = crests_of(NULL);
    assert_int_equal(c->line_count, 2);
    for (size_t i = 0; i < 2; i++) {
        const double radius = i ? 1.8 : 4.2, curvature = 1.2 / 0.36;
        assert_int_equal(c->kinds[i], TEXINPAINT_RIDGE);
        assert_true(is_closed(&c->lines[i]));
        assert_true(fabs((double)c->strengths[i] - 2 * pi * radius * curvature) < 0.05 * 2 * pi * radius * curvature);
        for (int k = 0; k < c->lines[i].count; k++) {
            const float *p = c->lines[i].points + 3 * k;
            assert_true(fabs(sqrt(p[0] * p[0] + p[1] * p[1]) - radius) < 0.02 && fabsf(p[2]) < 0.03f);
        }
    }
    /* with a threshold between the two, one */
    texinpaint_crest_desc options;
    memset(&options, 0, sizeof options);
    options.threshold = (c->strengths[0] + c->strengths[1]) / 2;
    texinpaint_crests *strong = crests_of(&options);
    assert_int_equal(strong->line_count, 1);
    texinpaint_crests_free(c);
    texinpaint_crests_free(strong);
}

/* |x|^6 + |y|^6 + |z|^6 = 1, a box with round edges: twelve ridges on the planes of symmetry. */
static void test_rounded_box(void **state) {
    (void)state;
    double edge[3][2][2];
    memset(edge, 0, sizeof edge);
    sphere(60);
    for (size_t i = 0; i < vertices; i++) {
        double sum = 0;
        for (size_t k = 0; k < 3; k++) sum += pow(fabs((double)at[3 * i + k]), 6);
        for (size_t k = 0; k < 3; k++) at[3 * i + k] = (float)(at[3 * i + k] / pow(sum, 1.0 / 6));
    }
    texinpaint_crests *c = crests_of(NULL);
    /* lines go on across corners; pieces of 1.2 in the middle of each edge are all found */
    for (size_t i = 0; i < c->line_count; i++) {
        const texinpaint_line *l = &c->lines[i];
        assert_int_equal(c->kinds[i], TEXINPAINT_RIDGE);
        for (int k = 1; k < l->count; k++) {
            const float *p = l->points + 3 * k - 3, *q = l->points + 3 * k;
            int axis = 0;
            for (int m = 1; m < 3; m++)
                if (fabsf(p[m]) < fabsf(p[axis])) axis = m;
            if (fabsf(p[axis]) > 0.6f) continue;
            const int u = (axis + 1) % 3, v = (axis + 2) % 3;
            assert_true(fabsf(fabsf(p[u]) - fabsf(p[v])) < 0.02f);
            edge[axis][p[u] > 0][p[v] > 0] += txm_d3_dist(txm_d3_load(p), txm_d3_load(q));
        }
    }
    for (int i = 0; i < 12; i++)
        assert_true(fabs(edge[i / 4][i / 2 % 2][i % 2] - 1.2) < 0.1);
    texinpaint_crests_free(c);
}

/* ---- nothing to find ------------------------------------------------------------------------- */

static void expect_none(void) {
    texinpaint_crests *c = crests_of(NULL);
    assert_int_equal(c->line_count, 0);
    texinpaint_crests_free(c);
}

static void test_shapes_without_ridges(void **state) {
    (void)state;
    clear();
    expect_none(); /* no faces */
    for (size_t i = 0; i <= 40; i++) { /* a plane */
        for (size_t j = 0; j <= 40; j++) {
            point((double)i / 40, (double)j / 40, 0.3 * (double)i / 40 + 0.1);
            if (i < 40 && j < 40) {
                face(41 * i + j, 41 * i + 41 + j, 41 * i + 42 + j);
                face(41 * i + j, 41 * i + 42 + j, 41 * i + 1 + j);
            }
        }
    }
    expect_none();
    noise(1e-5, 1);
    expect_none();
    sphere(40);
    expect_none();
    for (size_t i = 0; i < vertices; i++) at[3 * i] += 100; /* coarser floats */
    expect_none();
    torus(3, 1, 1, 100, 48); /* curvature has no extremum on a torus of circular section */
    expect_none();
    clear();
    for (size_t i = 0; i < 60; i++) { /* a cylinder, open */
        for (size_t j = 0; j <= 60; j++) {
            const double u = 2 * pi * (double)i / 60;
            point(cos(u), sin(u), (double)j / 15);
            if (j == 60) continue;
            const size_t a = 61 * i + j, b = 61 * ((i + 1) % 60) + j;
            face(a, b, b + 1);
            face(a, b + 1, a + 1);
        }
    }
    expect_none();
}

static void test_noisy_sphere(void **state) {
    (void)state;
    texinpaint_crest_desc options;
    memset(&options, 0, sizeof options);
    sphere(40);
    /* duplicates must stay where they are one: noise from the place */
    for (size_t i = 0; i < vertices; i++) {
        uint64_t h = 0;
        for (size_t k = 0; k < 3; k++) h = txm_hash(h + (uint64_t)(int64_t)lround(at[3 * i + k] * 1e5));
        const double f = 1 + 0.002 * ((double)(h >> 40) / 16777216 - 0.5);
        for (size_t k = 0; k < 3; k++) at[3 * i + k] = (float)(at[3 * i + k] * f);
    }
    texinpaint_crests *c = crests_of(NULL);
    assert_true(c->line_count < 8);
    for (size_t i = 0; i < c->line_count; i++) assert_true(c->strengths[i] < 3);
    options.rings = 4;
    texinpaint_crests *smooth = crests_of(&options);
    assert_true(smooth->line_count == 0);
    texinpaint_crests_free(c);
    texinpaint_crests_free(smooth);
}

/* ---- any mesh -------------------------------------------------------------------------------- */

/* Lines are the same whatever the numbering of vertices in equal places and the sense of faces. */
static void test_soup(void **state) {
    (void)state;
    static float soup[9 * 6 * 2 * 576];
    static uint32_t order[3 * 6 * 2 * 576];
    texinpaint_crest_desc desc;
    texinpaint_crests *crests = NULL;
    sphere(24);
    scale(1.6, 1.25, 0.8);
    assert_true(faces == 6 * 2 * 576);
    texinpaint_crests *welded = crests_of(NULL);
    for (size_t f = 0; f < faces; f++) {
        const int turned = f % 3 == 1; /* fewer than half */
        for (size_t k = 0; k < 3; k++) {
            memcpy(soup + 9 * f + 3 * k, at + 3 * corner[3 * f + k], 3 * sizeof(float));
            order[3 * f + k] = (uint32_t)(3 * f + (turned ? 2 - k : k));
        }
    }
    memset(&desc, 0, sizeof desc);
    desc.mesh.positions = soup;
    desc.mesh.indices = order;
    desc.mesh.vertex_count = 3 * faces;
    desc.mesh.face_count = faces;
    assert_int_equal(texinpaint_crest(&desc, NULL, &crests), TXM_OK);
    assert_int_equal(crests->line_count, welded->line_count);
    assert_int_equal(crests->kinds[0], TEXINPAINT_RIDGE);
    assert_true(fabsf(crests->strengths[0] - welded->strengths[0]) < 1e-3f);
    texinpaint_crests_free(welded);
    texinpaint_crests_free(crests);
}

/* Random soups with repeated corners, equal places, edges of many faces, huge and tiny numbers. */
static void test_random_meshes(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(9, 1);
    for (int round = 0; round < 300; round++) {
        texinpaint_crest_desc options;
        memset(&options, 0, sizeof options);
        options.threshold = round % 3 ? 1e-6f : 0;
        options.rings = round % 9;
        clear();
        const uint32_t n = 3 + txm_rng_below(&rng, 60), count = txm_rng_below(&rng, 200);
        const double size = round % 5 == 3 ? 1e37 : round % 5 == 4 ? 1e-38 : 1;
        for (uint32_t i = 0; i < n; i++) {
            const double grid = round % 2 ? 4 : 1e6;
            point(size * floor(grid * txm_rng_double(&rng)) / grid,
                  size * floor(grid * txm_rng_double(&rng)) / grid,
                  size * (round % 4 ? 0.1 : 0) * txm_rng_double(&rng));
        }
        for (uint32_t i = 0; i < count; i++)
            face(txm_rng_below(&rng, n), txm_rng_below(&rng, n), txm_rng_below(&rng, n));
        texinpaint_crests_free(crests_of(&options));
    }
}

static void test_refusals(void **state) {
    (void)state;
    texinpaint_crest_desc desc;
    texinpaint_crests *crests = (texinpaint_crests *)&desc;
    memset(&desc, 0, sizeof desc);
    assert_int_equal(texinpaint_crest(NULL, NULL, &crests), TXM_BAD_ARGUMENT);
    assert_null(crests);
    assert_int_equal(texinpaint_crest(&desc, NULL, NULL), TXM_BAD_ARGUMENT);
    sphere(4);
    desc.mesh.positions = at;
    desc.mesh.vertex_count = vertices;
    desc.mesh.face_count = faces;
    assert_int_equal(texinpaint_crest(&desc, NULL, &crests), TXM_BAD_ARGUMENT);
    desc.mesh.indices = corner;
    desc.threshold = -1;
    assert_int_equal(texinpaint_crest(&desc, NULL, &crests), TXM_BAD_ARGUMENT);
    desc.threshold = 0;
    desc.rings = 9;
    assert_int_equal(texinpaint_crest(&desc, NULL, &crests), TXM_BAD_ARGUMENT);
    desc.rings = 0;
    desc.kinds = 4;
    assert_int_equal(texinpaint_crest(&desc, NULL, &crests), TXM_BAD_ARGUMENT);
    desc.kinds = 0;
    at[5] = (float)INFINITY;
    assert_int_equal(texinpaint_crest(&desc, NULL, &crests), TXM_BAD_ARGUMENT);
    assert_null(crests);
}

static txm_status run(void *context, txm_env *env) {
    texinpaint_crests *crests = (texinpaint_crests *)env;
    const txm_status status = texinpaint_crest((const texinpaint_crest_desc *)context, env, &crests);
    if (status != TXM_OK) assert_null(crests);
    texinpaint_crests_free(crests);
    return status;
}

static void test_faults(void **state) {
    (void)state;
    texinpaint_crest_desc desc;
    memset(&desc, 0, sizeof desc);
    sphere(16);
    scale(1.6, 1.25, 0.8);
    desc.mesh.positions = at;
    desc.mesh.indices = corner;
    desc.mesh.vertex_count = vertices;
    desc.mesh.face_count = faces;
    assert_true(tk_sweep(run, &desc, TK_ALLOCATION) > 20);
    assert_true(tk_sweep(run, &desc, TK_ONWARD) > 20);
    assert_true(tk_sweep(run, &desc, TK_CANCEL) >= 4);
}

/* The same lines whatever the order of the work. */
static void test_threads(void **state) {
    (void)state;
    texinpaint_crest_desc desc;
    texinpaint_crests *serial = NULL, *reverse = NULL;
    txm_env env;
    memset(&desc, 0, sizeof desc);
    memset(&env, 0, sizeof env);
    sphere(30);
    scale(1.6, 1.25, 0.8);
    noise(1e-3, 4);
    desc.mesh.positions = at;
    desc.mesh.indices = corner;
    desc.mesh.vertex_count = vertices;
    desc.mesh.face_count = faces;
    assert_int_equal(texinpaint_crest(&desc, &env, &serial), TXM_OK);
    env.parallel_for = tk_parallel_reverse;
    assert_int_equal(texinpaint_crest(&desc, &env, &reverse), TXM_OK);
    assert_int_equal(serial->line_count, reverse->line_count);
    for (size_t i = 0; i < serial->line_count; i++) {
        assert_int_equal(serial->lines[i].count, reverse->lines[i].count);
        assert_memory_equal(serial->lines[i].points, reverse->lines[i].points,
                            3 * sizeof(float) * (size_t)serial->lines[i].count);
    }
    texinpaint_crests_free(serial);
    texinpaint_crests_free(reverse);
}

/* ---- prior lines in windows -------------------------------------------------------------------- */

enum { WIDTH = 90, HEIGHT = 60, WINDOW = WIDTH * HEIGHT };

static uint8_t state_of[WINDOW], color[4 * WINDOW];
static txm_vec3 place[WINDOW];

/* A window of a cylinder of radius 40 pixels, 90 pixels around and 60 along, with a hole in the middle;
   one pixel is half a unit of the mesh. */
static txi_window window_make(void) {
    txi_window w;
    memset(&w, 0, sizeof w);
    for (int i = 0; i < WINDOW; i++) {
        const int x = i % WIDTH, y = i / WIDTH, dx = x - 45, dy = y - 30;
        place[i] = txm_v3((float)(40 * sin(dx / 40.0)), (float)y, (float)(40 * cos(dx / 40.0)));
        state_of[i] = x < 4                       ? TXI_VOID
                      : dx * dx + dy * dy < 15 * 15 ? TXI_HOLE
                                                    : TXI_KNOWN;
        memset(color + 4 * i, 90, 4);
    }
    w.width = WIDTH;
    w.height = HEIGHT;
    w.state = state_of;
    w.color = color;
    w.place = place;
    w.spacing = 0.5;
    return w;
}

static void test_prior_on_a_surface(void **state) {
    (void)state;
    float points[3 * 3];
    const texinpaint_line line = {points, 3};
    const txi_window w = window_make();
    txi_surface surface;
    texinpaint_desc desc;
    txi_domain d;
    txi_prior prior;
    txm_arena arena;
    memset(&desc, 0, sizeof desc);
    memset(&surface, 0, sizeof surface);
    memset(&d, 0, sizeof d);
    d.desc = &desc;
    d.surface = &surface;
    desc.lines = &line;
    desc.line_count = 1;
    /* across the window along the axis of the cylinder, at x = 61, .3 pixels above the surface */
    const double a = 16 / 40.0, r = 40.3 * 0.5;
    for (int k = 0; k < 3; k++) {
        points[3 * k] = (float)(r * sin(a));
        points[3 * k + 1] = (float)(-20 + 40 * k);
        points[3 * k + 2] = (float)(r * cos(a));
    }
    txm_arena_init(&arena, NULL);
    assert_int_equal(txi_prior_make(&d, NULL, &w, &arena, NULL, &prior), TXM_OK);
    assert_int_equal(prior.line_count, 1); /* no texture: no assistants */
    const int n = prior.starts[1] - prior.starts[0];
    assert_true(n >= 50 && n <= 80);
    assert_true(prior.points[0].y < 1.5f && prior.points[n - 1].y > HEIGHT - 2.5f);
    for (int k = 0; k < n; k++) assert_true(fabsf(prior.points[k].x - 61) < 0.05f);
    txm_arena_free(&arena);

    /* a stripe along it: an edge 6 pixels to one side, another 9 to the other */
    for (int i = 0; i < WINDOW; i++) {
        if (i % WIDTH >= 55 && i % WIDTH < 70) memset(color + 4 * i, 200, 4);
    }
    assert_int_equal(txi_prior_make(&d, NULL, &w, &arena, NULL, &prior), TXM_OK);
    assert_int_equal(prior.line_count, 3);
    for (int l = 1; l < 3; l++) {
        assert_true(prior.starts[l + 1] - prior.starts[l] > 45);
        for (int k = prior.starts[l]; k < prior.starts[l + 1]; k++)
            assert_true(fabs((double)prior.points[k].x - (prior.points[k].x < 61 ? 54.5 : 69.5)) < 1.1);
    }
    txm_arena_free(&arena);

    /* far from the window, behind the cylinder, of no length */
    for (int k = 0; k < 9; k++) points[k] = 1e30f * (float)(k % 2);
    assert_int_equal(txi_prior_make(&d, NULL, &w, &arena, NULL, &prior), TXM_OK);
    for (int k = 0; k < 9; k++) points[k] = 3;
    assert_int_equal(txi_prior_make(&d, NULL, &w, &arena, NULL, &prior), TXM_OK);
    assert_int_equal(prior.line_count, 0);
    txm_arena_free(&arena);
}

static void test_prior_in_a_picture(void **state) {
    (void)state;
    float points[3 * 2] = {0, 110, 0, 1000, 110, 0};
    const texinpaint_line line = {points, 2};
    txi_window w = window_make();
    texinpaint_desc desc;
    txi_domain d;
    txi_prior prior;
    txm_arena arena;
    memset(&desc, 0, sizeof desc);
    memset(&d, 0, sizeof d);
    d.desc = &desc;
    desc.lines = &line;
    desc.line_count = 1;
    w.spacing = 1;
    for (int i = 0; i < WINDOW; i++) { /* the window begins at pixel 200, 80 of the picture */
        place[i] = txm_v3((float)(200 + i % WIDTH), (float)(80 + i / WIDTH), 0);
        state_of[i] = i % WIDTH == 45 ? TXI_HOLE : TXI_KNOWN;
    }
    txm_arena_init(&arena, NULL);
    assert_int_equal(txi_prior_make(&d, NULL, &w, &arena, NULL, &prior), TXM_OK);
    assert_int_equal(prior.line_count, 1);
    assert_true(prior.starts[1] >= WIDTH - 3);
    for (int k = 0; k < prior.starts[1]; k++) {
        assert_true(fabsf(prior.points[k].y - 29.5f) < 1e-3f);
        assert_true(prior.points[k].x >= 0 && prior.points[k].x <= WIDTH - 1);
    }
    txm_arena_free(&arena);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_ellipsoid),
        cmocka_unit_test(test_kinds),
        cmocka_unit_test(test_torus),
        cmocka_unit_test(test_rounded_box),
        cmocka_unit_test(test_shapes_without_ridges),
        cmocka_unit_test(test_noisy_sphere),
        cmocka_unit_test(test_soup),
        cmocka_unit_test(test_random_meshes),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_faults),
        cmocka_unit_test(test_threads),
        cmocka_unit_test(test_prior_on_a_surface),
        cmocka_unit_test(test_prior_in_a_picture),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
