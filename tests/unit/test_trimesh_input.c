/* test_trimesh_input.c - the surface of trimesh_relax.h: what is mended, and what is refused
   SPDX-License-Identifier: MIT OR Unlicense

   Every surface that is built is checked as a whole: an oriented manifold, one fan per vertex,
   unit normals, corners where the report of origin and turn says that they are.                */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "trimesh_relax/mend_all.h"
#include "trimesh_relax/relax.h"
#include "surfaces.h"
#include "testkit.h"

/* ---- made meshes ---- */

static trimesh_report report;
static txm_env env;

static void clear(void) {
    in.vertices = in.triangles = 0;
}

/* The cube of side 1 at (x, y, z). */
static void cube(double x, double y, double z) {
    add_box(x, y, z, 1, 1, 1);
}

/* A torus of n * n vertices and 2 n * n triangles, or (open) a wavy sheet. */
static void torus(int n, int open) {
    const int m = open ? n - 1 : n;
    clear();
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) {
            const double u = 2 * TXM_PI * i / n, v = 2 * TXM_PI * j / n;
            if (open) vertex((double)i / n, (double)j / n, 0.1 * sin(u));
            else vertex((2 + cos(u)) * cos(v), (2 + cos(u)) * sin(v), sin(u));
        }
    }
    for (int i = 0; i < m; i++) {
        for (int j = 0; j < m; j++) {
            const int i1 = (i + 1) % n, j1 = (j + 1) % n;
            quad((uint32_t)(i * n + j), (uint32_t)(i * n + j1), (uint32_t)(i1 * n + j1),
                 (uint32_t)(i1 * n + j));
        }
    }
}

static void turn(size_t t) {
    const uint32_t b = in.t[3 * t + 1];
    in.t[3 * t + 1] = in.t[3 * t + 2];
    in.t[3 * t + 2] = b;
}

/* ---- numbers without end ---- */

/* Needles are cut into so many pieces that the square of a valence takes more than 32 bits. */
static void test_valence(void **state) {
    int32_t valence[1] = {500000};
    uint8_t flags[1] = {TRIMESH_FREE};
    tmr_mesh m;
    (void)state;
    memset(&m, 0, sizeof m);
    m.valence = valence;
    m.flags = flags;
    assert_true(tmr_valence_cost(&m, 0, 0) == INT64_C(499994) * 499994);
    assert_true(tmr_valence_cost(&m, 0, 1) == INT64_C(499995) * 499995);
}

/* ---- building and checking ---- */

static trimesh_desc describe(void) {
    trimesh_desc desc = desc_of_in(0);
    return desc;
}

static void check_corners(const tmr_surface *s) {
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        const int32_t o = s->opposite[c];
        assert_in_range(s->vertex[c], 0, s->vertex_count - 1);
        assert_int_not_equal(s->vertex[c], s->vertex[tmr_next(c)]);
        assert_int_equal(s->edge_kind[c], o < 0 ? TMR_BORDER_EDGE : TMR_PLAIN_EDGE);
        if (o < 0) continue;
        assert_int_equal(s->opposite[o], c);
        assert_int_equal(s->vertex[tmr_next(o)], s->vertex[tmr_prev(c)]);
        assert_int_equal(s->vertex[tmr_prev(o)], s->vertex[tmr_next(c)]);
        assert_int_equal(s->component[o / 3], s->component[c / 3]);
    }
}

/* Walking on from s->corner finds every corner of a vertex, and each corner is found once. */
static void check_vertices(const tmr_surface *s) {
    int32_t found = 0;
    for (int32_t i = 0; i < s->vertex_count; i++) {
        int32_t k = s->corner[i];
        do {
            assert_int_equal(s->vertex[k], i);
            found++;
            k = tmr_ccw(s->opposite, k);
        } while (k >= 0 && k != s->corner[i]);
        assert_true(fabs(txm_d3_len(s->vertex_normal[i]) - 1) < 1e-9);
        assert_true(txm_d3_len(s->point[i]) < 0.500001);
    }
    assert_int_equal(found, 3 * s->face_count);
}

static void check_faces(const tmr_surface *s, double weld) {
    double area = 0;
    for (int32_t f = 0; f < s->face_count; f++) {
        const int32_t *v = s->vertex + 3 * f;
        const int turned = s->turn[f] >= 4;
        area += 0.5 * txm_d3_len(txm_d3_area2(s->point[v[0]], s->point[v[1]], s->point[v[2]]));
        assert_true(fabs(txm_d3_len(s->normal[f]) - 1) < 1e-9);
        assert_in_range(s->component[f], 0, s->component_count - 1);
        assert_true(s->origin[f] < in.triangles);
        if (s->turn[f] == TMR_MAPPED) continue;
        for (int k = 0; k < 3; k++) {
            const int theirs = turned ? (s->turn[f] - 4 - k + 3) % 3 : (k + s->turn[f]) % 3;
            const float *p = in.at + 3 * (size_t)in.t[3 * s->origin[f] + (uint32_t)theirs];
            const txm_dvec3 at = txm_d3_mad(s->centre, s->point[v[k]], s->diagonal);
            assert_true(txm_d3_dist(at, txm_d3(p[0], p[1], p[2])) <=
                        (2e-5 + 2 * fmax(weld, 0)) * s->diagonal);
        }
    }
    assert_true(fabs(area - s->area) < 1e-9);
}

static void check_surface(const tmr_surface *s, double weld) {
    check_corners(s);
    check_vertices(s);
    check_faces(s, weld);
    assert_int_equal(report.vertices, s->vertex_count);
    assert_int_equal(report.triangles, s->face_count);
    assert_int_equal(report.components, s->component_count);
}

/* Build what `in` holds; check it if it is a surface, and give it back. */
static txm_status build_desc(const trimesh_desc *desc) {
    tk_memory memory = {0};
    txm_arena arena;
    tmr_surface s;
    env = tk_env(&memory, NULL);
    txm_arena_init(&arena, &env);
    const txm_status status = tmr_surface_build(desc, &env, &arena, &report, &s);
    if (status == TXM_OK) check_surface(&s, desc->weld);
    else assert_true(strlen(env.message) > 10);
    txm_arena_free(&arena);
    assert_int_equal(tk_leaks(&memory), 0);
    return status;
}
static txm_status build(float weld) {
    trimesh_desc desc = describe();
    desc.weld = weld;
    return build_desc(&desc);
}

#define assert_report(v, t, e)                                                                     \
    do {                                                                                           \
        assert_int_equal(report.vertices, v);                                                      \
        assert_int_equal(report.triangles, t);                                                     \
        assert_int_equal(report.euler, e);                                                         \
    } while (0)

/* ---- clean surfaces ---- */

static void test_clean(void **state) {
    (void)state;
    clear();
    cube(0, 0, 0);
    assert_int_equal(build(0), TXM_OK);
    assert_report(8, 12, 2);
    assert_int_equal(report.welded + report.unused + report.degenerate + report.duplicate, 0);
    assert_int_equal(report.fins + report.turned + report.split + report.loops, 0);
    torus(12, 0);
    assert_int_equal(build(0), TXM_OK);
    assert_report(144, 288, 0);
    torus(12, 1);
    assert_int_equal(build(0), TXM_OK);
    assert_report(144, 242, 1);
    assert_int_equal(report.loops, 1);
    clear();
    triangle(vertex(0, 0, 0), vertex(1, 0, 0), vertex(0, 1, 0));
    assert_int_equal(build(0), TXM_OK);
    assert_report(3, 1, 1);
}

static void test_units(void **state) { /* from denormal to almost infinite, and far away */
    static const double scale[4] = {1e30, 1e37, 1e-30, 1e-43};
    (void)state;
    for (int k = 0; k < 4; k++) {
        torus(12, 0);
        for (size_t i = 0; i < 3 * in.vertices; i++) in.at[i] = (float)(in.at[i] * scale[k]);
        assert_int_equal(build(0), TXM_OK);
        assert_report(144, 288, 0);
    }
    torus(12, 0);
    for (size_t i = 0; i < in.vertices; i++) in.at[3 * i] += 1e5f;
    assert_int_equal(build(0), TXM_OK);
    assert_report(144, 288, 0);
}

/* Area, normals and the mapping of scale, on a cube where they are known. */
static void test_measures(void **state) {
    trimesh_desc desc;
    txm_arena arena;
    tmr_surface s;
    (void)state;
    clear();
    vertex(7, 7, 7); /* unused: must not count for the box */
    cube(1, 2, 3);
    for (size_t i = 0; i < in.vertices; i++) in.scale[i] = (float)(i + 1);
    desc = describe();
    desc.scale = in.scale;
    assert_int_equal(build_desc(&desc), TXM_OK);
    assert_int_equal(report.unused, 1);
    txm_arena_init(&arena, NULL);
    assert_int_equal(tmr_surface_build(&desc, NULL, &arena, NULL, &s), TXM_OK);
    assert_true(fabs(s.diagonal - sqrt(3.0)) < 1e-12);
    assert_true(txm_d3_dist(s.centre, txm_d3(1.5, 2.5, 3.5)) < 1e-12);
    assert_true(fabs(s.area - 6 / 3.0) < 1e-12);
    for (int32_t i = 0; i < 8; i++) {
        assert_true(s.scale[i] == in.scale[i + 1]);
        /* weighted by angles, they point away from the centre, however the sides are cut */
        assert_true(txm_d3_dist(s.vertex_normal[i], txm_d3_unit(s.point[i])) < 1e-9);
    }
    for (int32_t f = 0; f < 12; f++)
        assert_true(txm_d3_dot(s.normal[f], s.point[s.vertex[3 * f]]) > 0.2);
    txm_arena_free(&arena);
}

/* ---- mended ---- */

static void test_weld(void **state) {
    txm_rng rng = txm_rng_make(1, 1);
    float corners[9 * 288];
    (void)state;
    torus(12, 0);
    for (size_t i = 0; i < 3 * in.triangles; i++) memcpy(corners + 3 * i, in.at + 3 * in.t[i], 12);
    clear();
    for (size_t i = 0; i < 288; i++) {
        uint32_t v[3];
        for (size_t k = 0; k < 3; k++) {
            const float *p = corners + 9 * i + 3 * k;
            v[k] = vertex(p[0], p[1], p[2] == 0 && k == 1 ? -0.0 : p[2]);
        }
        triangle(v[0], v[1], v[2]);
    }
    assert_int_equal(build(0), TXM_OK);
    assert_report(144, 288, 0);
    assert_int_equal(report.welded, 9 * 288 / 3 - 144);
    for (size_t i = 0; i < 3 * in.vertices; i++) in.at[i] += 1e-5f * txm_rng_float(&rng);
    assert_int_equal(build(-1), TXM_OK); /* 288 triangles, each alone */
    assert_int_equal(report.components, 288);
    assert_int_equal(build(0), TXM_OK); /* their borders are close */
    assert_report(144, 288, 0);
    assert_true(report.closed > 400);
    assert_int_equal(build(1e-4f), TXM_OK);
    assert_report(144, 288, 0);
}

static void test_winding(void **state) {
    (void)state;
    clear();
    cube(0, 0, 0);
    turn(3);
    turn(7);
    assert_int_equal(build(0), TXM_OK);
    assert_report(8, 12, 2);
    assert_int_equal(report.turned, 2);
    for (size_t i = 0; i < 12; i += 2) turn(i); /* half and half: as the first face */
    turn(3);
    turn(7);
    assert_int_equal(build(0), TXM_OK);
    assert_int_equal(report.turned, 6);
}

static void test_duplicates(void **state) {
    (void)state;
    for (int turned = 0; turned < 2; turned++) {
        torus(12, 0);
        for (size_t i = 0; i < 288; i += 3) {
            triangle(in.t[3 * i + 1], in.t[3 * i + 2], in.t[3 * i]);
            if (turned) turn(in.triangles - 1);
        }
        assert_int_equal(build(0), TXM_OK);
        assert_report(144, 288, 0);
        assert_int_equal(report.duplicate, 96);
    }
    torus(12, 1); /* a sheet with two sides becomes one */
    for (size_t i = 0; i < 242; i++) {
        triangle(in.t[3 * i], in.t[3 * i + 1], in.t[3 * i + 2]);
        turn(in.triangles - 1);
    }
    assert_int_equal(build(0), TXM_OK);
    assert_report(144, 242, 1);
    clear(); /* two cubes share a wall that each of them has: it goes */
    cube(0, 0, 0);
    cube(1, 0, 0);
    assert_int_equal(build(0), TXM_OK);
    assert_report(12, 20, 2);
    assert_int_equal(report.duplicate, 4);
    clear(); /* and so do all walls inside a block of cubes */
    for (int i = 0; i < 125; i++) cube(i % 5, i / 5 % 5, i / 25);
    assert_int_equal(build(0), TXM_OK);
    assert_report(6 * 25 + 2, 2 * 6 * 25, 2);
    assert_int_equal(report.components, 1);
}

/* A solid that touches itself along an edge; first one end of that is free, then none. */
static void test_pinch(void **state) {
    (void)state;
    clear();
    cube(0, 0, 0);
    cube(1, 1, 0);
    cube(0, 0, 1);
    cube(1, 0, 1);
    cube(1, 1, 1);
    assert_int_equal(build(0), TXM_OK);
    assert_int_equal(report.components, 1);
    assert_int_equal(report.split, 1);
    assert_int_equal(report.euler, 2);
    cube(0, 0, -1);
    cube(1, 0, -1);
    cube(1, 1, -1);
    assert_int_equal(build(0), TXM_OK);
    assert_int_equal(report.components, 1);
    assert_int_equal(report.split, 0);
    assert_int_equal(report.euler, 0);
}

static void test_fins(void **state) {
    (void)state;
    torus(12, 0);
    triangle(in.t[0], in.t[1], vertex(5, 5, 5));
    triangle(in.t[60], in.t[61], vertex(5, 5, 6));
    triangle(in.t[60], in.t[61], vertex(5, 5, 7));
    assert_int_equal(build(0), TXM_OK);
    assert_report(144, 288, 0);
    assert_int_equal(report.fins, 3);
}

static void test_touching(void **state) {
    (void)state;
    for (int where = 0; where < 2; where++) { /* along an edge; in a corner */
        clear();
        cube(0, 0, 0);
        cube(1, 1, where);
        assert_int_equal(build(0), TXM_OK);
        assert_report(16, 24, 4);
        assert_int_equal(report.components, 2);
        assert_int_equal(report.split, where ? 1 : 2);
    }
    clear(); /* two triangles of a sheet that meet in a point */
    const uint32_t v = vertex(0, 0, 0);
    triangle(v, vertex(1, 0, 0), vertex(0, 1, 0));
    triangle(v, vertex(-1, 0, 0), vertex(0, -1, 0));
    assert_int_equal(build(0), TXM_OK);
    assert_report(6, 2, 2);
    assert_int_equal(report.loops, 2);
}

/* ---- triangles without area ---- */

/* An edge with a big triangle on one side, n + 1 small ones on the other, and between them n of no
   area: a fan, from one end of the edge or from its first vertex inside. */
static void junction(int n) {
    clear();
    const uint32_t a = vertex(0, 0, 0.1), b = vertex(1, 0, 0.1);
    const uint32_t top = vertex(0.5, 1, 0.37), bottom = vertex(0.4, -1, 0.2);
    uint32_t last = a;
    triangle(a, b, top);
    for (int i = 0; i <= n; i++) {
        const uint32_t next = i < n ? vertex((i + 1.0) / (n + 1), 0, 0.1) : b;
        triangle(next, last, bottom);
        if (i > 0) triangle(a, last, next);
        last = next;
    }
}

static void test_caps(void **state) {
    static const int many[4] = {1, 2, 10, 300};
    (void)state;
    for (int k = 0; k < 4; k++) {
        const int n = many[k];
        txm_arena arena;
        tmr_surface s;
        junction(n);
        assert_int_equal(build(0), TXM_OK);
        assert_report((size_t)n + 4, 2 * (size_t)n + 2, 1);
        assert_int_equal(report.degenerate, n);
        const trimesh_desc desc = describe();
        txm_arena_init(&arena, NULL);
        assert_int_equal(tmr_surface_build(&desc, NULL, &arena, NULL, &s), TXM_OK);
        for (int32_t f = 0; f < s.face_count; f++) {
            const int32_t *v = s.vertex + 3 * f;
            assert_true(tmr_slimness(s.point[v[0]], s.point[v[1]], s.point[v[2]]) > 1e-3);
        }
        txm_arena_free(&arena);
    }
    clear(); /* with its long edge on the border */
    const uint32_t a = vertex(0, 0, 0), b = vertex(1, 0, 0), c = vertex(0.5, 1, 0);
    const uint32_t m = vertex(0.5, 0, 0);
    triangle(a, m, c);
    triangle(m, b, c);
    triangle(a, b, m);
    assert_int_equal(build(0), TXM_OK);
    assert_report(4, 2, 1);
    assert_int_equal(report.degenerate, 1);
}

static void test_needles(void **state) { /* a torus where a vertex is two, a hair apart */
    (void)state;
    torus(12, 0);
    const float *p = in.at + 3 * 30;
    const uint32_t twin = vertex(p[0] + 2e-7, p[1], p[2]);
    /* the faces on one side of the way 18-30-42 go to the twin; two needles fill the gap */
    for (size_t i = 0; i < 3 * 288; i++) {
        const uint32_t *t = in.t + i / 3 * 3;
        int side = 0;
        for (int k = 0; k < 3; k++) side += (int)(t[k] % 12) - 6;
        if (in.t[i] == 30 && side > 0) in.t[i] = twin;
    }
    triangle(30, twin, 18);
    triangle(twin, 30, 42);
    assert_int_equal(build(0), TXM_OK);
    assert_report(144, 288, 0);
    assert_int_equal(report.degenerate, 2);
}

/* ---- refused ---- */

static void test_refused(void **state) {
    trimesh_desc desc;
    float bad[3] = {0, 0, 0};
    (void)state;
    clear();
    assert_int_equal(build(0), TXM_TOO_SMALL);
    cube(0, 0, 0);
    assert_int_equal(build(0.02f), TXM_BAD_ARGUMENT);
    assert_int_equal(build((float)NAN), TXM_BAD_ARGUMENT);
    desc = describe();
    desc.surface.positions = NULL;
    assert_int_equal(build_desc(&desc), TXM_BAD_ARGUMENT);
    desc = describe();
    desc.surface.indices = NULL;
    assert_int_equal(build_desc(&desc), TXM_BAD_ARGUMENT);
    desc = describe();
    desc.surface.face_count = SIZE_MAX;
    assert_int_equal(build_desc(&desc), TXM_TOO_LARGE);
    bad[0] = (float)NAN;
    bad[1] = (float)INFINITY;
    for (int k = 0; k < 2; k++) {
        clear();
        cube(0, 0, 0);
        in.at[16] = bad[k];
        assert_int_equal(build(0), TXM_BAD_ARGUMENT);
        assert_non_null(strstr(env.message, "vertex 5 "));
    }
    clear();
    cube(0, 0, 0);
    in.t[20] = 8;
    assert_int_equal(build(0), TXM_BAD_ARGUMENT);
    assert_non_null(strstr(env.message, "face 6 "));
}

static void test_scale(void **state) {
    static const float bad[5] = {0, -1, 1001, (float)NAN, (float)INFINITY};
    (void)state;
    clear();
    cube(0, 0, 0);
    trimesh_desc desc = describe();
    desc.scale = in.scale;
    for (int k = 0; k < 5; k++) {
        for (int i = 0; i < 8; i++) in.scale[i] = i == 6 ? bad[k] : 1;
        assert_int_equal(build_desc(&desc), TXM_BAD_ARGUMENT);
        assert_non_null(strstr(env.message, "scale"));
    }
    in.scale[6] = 1000;
    assert_int_equal(build_desc(&desc), TXM_OK);
}

static void test_no_area(void **state) {
    (void)state;
    clear();
    for (int i = 0; i < 4; i++) vertex(1, 2, 3);
    triangle(0, 1, 2);
    triangle(1, 2, 3);
    assert_int_equal(build(0), TXM_TOO_SMALL);
    clear();
    for (int i = 0; i < 4; i++) vertex(i, 2 * i, 3 * i);
    triangle(0, 1, 2);
    triangle(1, 2, 3);
    assert_int_equal(build(0), TXM_TOO_SMALL);
    clear();
    triangle(vertex(0, 0, 0), vertex(1, 0, 0), 0);
    assert_int_equal(build(0), TXM_TOO_SMALL);
}

/* Two cubes with one wall between them: the wall becomes a sheet of its own. */
static void test_inner_wall(void **state) {
    (void)state;
    clear();
    cube(0, 0, 0);
    const uint32_t a = vertex(2, 0, 0), b = vertex(2, 1, 0);
    const uint32_t c = vertex(2, 0, 1), d = vertex(2, 1, 1);
    quad(a, b, d, c);
    quad(1, a, c, 5);
    quad(3, 7, d, b);
    quad(1, 3, b, a);
    quad(5, c, d, 7);
    assert_int_equal(build(0), TXM_OK);
    assert_int_equal(report.overfull, 4);
    assert_int_equal(report.opened, 4);
    assert_int_equal(report.components, 2);
    assert_int_equal(report.loops, 1);
    assert_int_equal(report.euler, 3);
    assert_int_equal(report.cut, 0);
}

/* n sheets that meet in a line of three edges, each of 3 * 2 squares; some are turned over. */
static void star(int n, int turned) {
    clear();
    for (int k = 0; k < 4; k++) vertex(0, 0, k);
    for (int i = 0; i < n; i++) {
        const double u = 2 * TXM_PI * i / n;
        const uint32_t first = (uint32_t)in.vertices;
        for (int k = 0; k < 4; k++) {
            vertex(cos(u), sin(u), k);
            vertex(2 * cos(u), 2 * sin(u), k);
        }
        for (uint32_t k = 0; k < 3; k++) {
            const uint32_t p = first + 2 * k, t = (uint32_t)in.triangles;
            quad(k, p, p + 2, k + 1);
            quad(p, p + 1, p + 3, p + 2);
            for (uint32_t f = t; f < t + 4 && turned && i % 3 == 1; f++) turn(f);
        }
    }
}

/* Any number of sheets at an edge: they go on in pairs, the same ones all along the line, and an odd
   one has a border there. */
static void test_stars(void **state) {
    (void)state;
    for (int n = 3; n <= 70; n += n < 10 ? 1 : 15) {
        for (int turned = 0; turned < 2; turned++) {
            star(n, turned);
            assert_int_equal(build(0), TXM_OK);
            assert_int_equal(report.overfull, 3);
            assert_int_equal(report.opened, 3 * (n % 2));
            assert_int_equal(report.components, (n + 1) / 2);
            assert_int_equal(report.loops, (n + 1) / 2);
            assert_int_equal(report.euler, (n + 1) / 2);
            assert_int_equal(report.cut, 0);
        }
    }
}

/* A band of n pairs of triangles with so many half turns. */
static void band(int n, int half_turns) {
    clear();
    for (int i = 0; i < n; i++) {
        const double u = 2 * TXM_PI * i / n, v = 0.5 * half_turns * u;
        for (int side = -1; side <= 1; side += 2) {
            const double r = 2 + 0.5 * side * cos(v);
            vertex(r * cos(u), r * sin(u), 0.5 * side * sin(v));
        }
    }
    for (uint32_t i = 0; i < (uint32_t)n; i++) {
        const int last = i + 1 == (uint32_t)n, swaps = last && half_turns % 2;
        const uint32_t p = 2 * i, next = last ? 0 : p + 2;
        const uint32_t q = swaps ? next + 1 : next, r = swaps ? next : next + 1;
        triangle(p, q, p + 1);
        triangle(p + 1, q, r);
    }
}

/* One-sided surfaces are cut: a band straight across. */
static void test_one_sided(void **state) {
    (void)state;
    for (int half_turns = 0; half_turns < 5; half_turns++) {
        for (int n = 8; n < 40; n += 7) {
            band(n, half_turns);
            for (size_t t = 0; t < in.triangles && n % 2; t += 3) turn(t);
            assert_int_equal(build(0), TXM_OK);
            assert_int_equal(report.cut, half_turns % 2);
            assert_int_equal(report.loops, half_turns % 2 ? 1 : 2);
            assert_int_equal(report.euler, half_turns % 2);
        }
    }
    static const uint8_t plane[10][3] = {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 5}, {0, 5, 1},
                                         {1, 2, 4}, {2, 3, 5}, {3, 4, 1}, {4, 5, 2}, {5, 1, 3}};
    clear(); /* the projective plane, of six vertices */
    for (int i = 0; i < 6; i++) vertex(cos(i), sin(i), 0.3 * i * i);
    for (int i = 0; i < 10; i++) triangle(plane[i][0], plane[i][1], plane[i][2]);
    assert_int_equal(build(0), TXM_OK);
    assert_int_equal(report.loops, 1);
    assert_int_equal(report.euler, 1);
    assert_true(report.cut >= 3);
}

/* Two pairs of faces between the same vertices, with one fan at either end: both edges are split. */
static void test_double_edge(void **state) {
    (void)state;
    torus(12, 0);
    for (int i = 0; i < 2; i++) { /* pinch a tube, so that an edge of either side coincides */
        const uint32_t keep = (uint32_t)(12 * i), gone = (uint32_t)(72 + 12 * i);
        for (size_t c = 0; c < 3 * in.triangles; c++)
            if (in.t[c] == gone) in.t[c] = keep;
    }
    assert_int_equal(build(0), TXM_OK);
    assert_int_equal(report.euler, 0);
    assert_int_equal(report.components, 1);
}

/* ---- gaps ---- */

/* A box whose sides are cut into squares of their own numbers, unwelded. */
static void patchwork(const int *parts, double off) {
    clear();
    for (int side = 0; side < 6; side++) {
        const int n = parts[side], axis = side / 2;
        for (int k = 0; k < n * n; k++) {
            uint32_t v[4];
            for (int corner = 0; corner < 4; corner++) {
                double p[3];
                p[axis] = side % 2;
                p[(axis + 1) % 3] = (k % n + (corner == 1 || corner == 2)) / (double)n;
                p[(axis + 2) % 3] = (k / n + corner / 2) / (double)n;
                v[corner] = vertex(p[0] + off * sin(7.0 * k + corner), p[1] + off * cos(5.0 * k),
                                   p[2] + off * sin(3.0 * k + side));
            }
            if (side % 2) quad(v[0], v[1], v[2], v[3]);
            else quad(v[3], v[2], v[1], v[0]);
        }
    }
}

static void test_junctions(void **state) {
    static const int parts[5][6] = {
        {1, 1, 1, 1, 1, 2}, {1, 2, 1, 2, 1, 2}, {1, 8, 1, 8, 1, 8}, {3, 1, 2, 6, 1, 5}, {1, 2, 3, 4, 5, 6}};
    (void)state;
    for (int i = 0; i < 5; i++) {
        for (int off = 0; off < 2; off++) {
            patchwork(parts[i], off ? 1e-7 : 0);
            assert_int_equal(build(0), TXM_OK);
            assert_int_equal(report.loops, 0);
            assert_int_equal(report.components, 1);
            assert_int_equal(report.euler, 2);
            assert_true(report.stitched > 0);
            assert_int_equal(report.closed > 0, off);
            assert_int_equal(build(-1), TXM_OK); /* nothing is welded */
            assert_int_equal(report.components, in.triangles / 2);
            assert_int_equal(report.welded + report.stitched + report.closed, 0);
        }
    }
    clear(); /* a corner that only touches a side stays apart */
    triangle(vertex(0, 0, 0), vertex(2, 0, 0), vertex(1, -1, 0));
    triangle(vertex(1, 0, 0), vertex(2, 1, 0), vertex(0, 1, 0));
    assert_int_equal(build(0), TXM_OK);
    assert_int_equal(report.stitched, 0);
    assert_int_equal(report.components, 2);
}

/* ---- large fans ---- */

/* A cone of n faces, and as many below unless it is open. */
static void cone(int n, int open) {
    clear();
    const uint32_t tip = vertex(0, 0, 1), centre = open ? tip : vertex(0, 0, 0);
    const uint32_t rim = (uint32_t)in.vertices;
    for (int k = 0; k < n; k++) vertex(cos(2 * TXM_PI * k / n), sin(2 * TXM_PI * k / n), 0);
    for (int k = 0; k < n; k++) {
        const uint32_t a = rim + (uint32_t)k, b = rim + (uint32_t)((k + 1) % n);
        triangle(tip, a, b);
        if (!open) triangle(centre, b, a);
    }
}

/* Searching a large fan from coarse to fine finds about the place that looking at all faces does. */
static void test_large_fans(void **state) {
    static const int sizes[4] = {TMR_FAN_SMALL, TMR_FAN_SMALL + 1, 200, 3001};
    txm_rng rng = txm_rng_make(7, 7);
    (void)state;
    for (int i = 0; i < 8; i++) {
        const int n = sizes[i / 2], large = n > TMR_FAN_SMALL;
        txm_arena arena;
        tmr_surface s;
        cone(n, i % 2);
        const trimesh_desc desc = describe();
        txm_arena_init(&arena, NULL);
        assert_int_equal(tmr_surface_build(&desc, NULL, &arena, &report, &s), TXM_OK);
        assert_int_equal(tmr_find_fans(&s, &arena, &arena), TXM_OK);
        assert_int_equal(s.fan != NULL, large);
        for (int32_t v = 0; v < s.vertex_count && large; v++)
            assert_int_equal(s.fan[v] >= 0, v < (i % 2 ? 1 : 2));
        tmr_surface plain = s;
        plain.fan = NULL;
        for (int k = 0; k < 200; k++) {
            const txm_dvec3 p = txm_d3(txm_rng_float(&rng) - 0.5, txm_rng_float(&rng) - 0.5,
                                       txm_rng_float(&rng) - 0.5);
            const tmr_place at = tmr_on_fan(&s, 0, p), all = tmr_on_fan(&plain, 0, p);
            /* positions are floats, so that the distances along the fan have shallow minima */
            assert_true(sqrt(at.d2) <= sqrt(all.d2) + 1e-6);
            /* walking ends as near, from any face */
            const int32_t from = (int32_t)txm_rng_below(&rng, (uint32_t)s.face_count);
            assert_true(tmr_project(&s, p, from).d2 <= tmr_project(&plain, p, from).d2 + 1e-6);
        }
        txm_arena_free(&arena);
    }
}

/* ---- anything at all ---- */

/* Random triangles of few vertices, some of which coincide or nearly so: a surface or a refusal. */
static void test_soup(void **state) {
    txm_rng rng = txm_rng_make(5, 5);
    int built = 0;
    (void)state;
    for (int round = 0; round < 4000; round++) {
        const uint32_t n = 3 + txm_rng_below(&rng, 12), triangles = 1 + txm_rng_below(&rng, 24);
        clear();
        for (uint32_t i = 0; i < n; i++) {
            const double x = txm_rng_below(&rng, 4), y = txm_rng_below(&rng, 3);
            const double z = txm_rng_float(&rng);
            vertex(x, y, round % 2 ? z : 1e-7 * z);
        }
        for (uint32_t i = 0; i < 3 * triangles; i++) in.t[i] = txm_rng_below(&rng, n);
        in.triangles = triangles;
        const txm_status status = build(round % 3 ? 0 : 0.01f);
        assert_true(status == TXM_OK || status == TXM_TOO_SMALL);
        built += status == TXM_OK;
    }
    assert_true(built > 1000);
}

/* A torus or a sheet with a few random faults. */
static void test_damage(void **state) {
    txm_rng rng = txm_rng_make(6, 6);
    (void)state;
    for (int round = 0; round < 1000; round++) {
        torus(6 + round % 6, round / 6 % 2);
        for (uint32_t faults = txm_rng_below(&rng, 6); faults > 0; faults--) {
            uint32_t *t = in.t + 3 * txm_rng_below(&rng, (uint32_t)in.triangles);
            float *p = in.at + 3 * t[0], *q = in.at + 3 * t[1];
            uint32_t v;
            switch (txm_rng_below(&rng, 7)) {
            case 0: turn((size_t)(t - in.t) / 3); break;
            case 1: triangle(t[0], t[2], t[1]); break;
            case 2: memcpy(p, q, 3 * sizeof *p); break;
            case 3: p[0] = q[0] * 1.0000002f, p[1] = q[1], p[2] = q[2]; break;
            case 4: memcpy(t, in.t + 3 * --in.triangles, 3 * sizeof *t); break;
            case 5: v = vertex(1.5, 1.5, 1.5), triangle(t[0], t[1], v); break;
            default: /* a vertex on an edge that the face beyond knows nothing of */
                v = vertex(0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1]), 0.5 * (p[2] + q[2]));
                triangle(v, t[1], t[2]);
                triangle(t[0], t[1], v);
                t[1] = v;
            }
        }
        const txm_status status = build(round % 2 ? 0 : 1e-5f);
        assert_int_equal(status, TXM_OK);
    }
}

/* ---- memory and cancelling ---- */

static txm_status mend(void *context, txm_env *given) {
    txm_arena arena;
    tmr_surface s;
    txm_arena_init(&arena, given);
    const txm_status status =
        tmr_surface_build((const trimesh_desc *)context, given, &arena, NULL, &s);
    txm_arena_free(&arena);
    return status;
}

static void test_faults(void **state) {
    (void)state;
    junction(10);
    for (size_t i = 0; i < in.vertices; i++) in.scale[i] = 1;
    trimesh_desc desc = describe();
    desc.scale = in.scale;
    assert_true(tk_sweep(mend, &desc, TK_ALLOCATION) > 10);
    assert_true(tk_sweep(mend, &desc, TK_ONWARD) > 10);
    assert_true(tk_sweep(mend, &desc, TK_CANCEL) > 4);
}

static void test_progress(void **state) {
    tk_progress progress = {0};
    (void)state;
    junction(10);
    trimesh_desc desc = describe();
    txm_env reporting = tk_env(NULL, &progress);
    assert_int_equal(mend(&desc, &reporting), TXM_OK);
    assert_true(progress.last <= 0.05f);
}

/* What is held at most, and what is kept. */
static void test_memory(void **state) {
    tk_memory memory = {0};
    txm_arena arena;
    tmr_surface s;
    (void)state;
    torus(60, 0);
    const trimesh_desc desc = describe();
    env = tk_env(&memory, NULL);
    txm_arena_init(&arena, &env);
    assert_int_equal(tmr_surface_build(&desc, &env, &arena, &report, &s), TXM_OK);
    assert_true(memory.peak_bytes < 140 * in.triangles);
    assert_true(memory.live_bytes < 90 * in.triangles);
    txm_arena_free(&arena);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_clean),       cmocka_unit_test(test_units),
        cmocka_unit_test(test_valence),
        cmocka_unit_test(test_measures),    cmocka_unit_test(test_weld),
        cmocka_unit_test(test_winding),     cmocka_unit_test(test_duplicates),
        cmocka_unit_test(test_pinch),       cmocka_unit_test(test_fins),
        cmocka_unit_test(test_touching),    cmocka_unit_test(test_caps),
        cmocka_unit_test(test_needles),     cmocka_unit_test(test_refused),
        cmocka_unit_test(test_scale),       cmocka_unit_test(test_no_area),
        cmocka_unit_test(test_inner_wall),  cmocka_unit_test(test_stars),
        cmocka_unit_test(test_one_sided),   cmocka_unit_test(test_double_edge),
        cmocka_unit_test(test_junctions),   cmocka_unit_test(test_soup),
        cmocka_unit_test(test_large_fans),
        cmocka_unit_test(test_damage),      cmocka_unit_test(test_faults),
        cmocka_unit_test(test_progress),    cmocka_unit_test(test_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
