/* test_trimesh_capacity.c - surfaces that are mostly border, or mostly handles: enough room for them
   SPDX-License-Identifier: MIT OR Unlicense

   Every border edge gets a ghost triangle, and a surface of many handles has many more triangles
   than vertices. These inputs need all the room that is set aside; the sanitizers see to the rest. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "trimesh_relax.h"
#include "surfaces.h"
#include "testkit.h"

static trimesh_desc describe(size_t vertices, trimesh_method method) {
    trimesh_desc d = desc_of_in(vertices);
    d.method = method;
    return d;
}

/* As many cards as given, standing on the same place and crossing each other. */
static void make_cross(int cards) {
    in.vertices = in.triangles = 0;
    for (int i = 0; i < cards; i++) {
        const double x = cos(TXM_PI * i / cards), y = sin(TXM_PI * i / cards);
        const uint32_t a = vertex(-x, -y, 0), b = vertex(x, y, 0);
        quad(a, b, vertex(x, y, 1), vertex(-x, -y, 1));
    }
}

/* Triangles of a torus, no vertex shared and each a little off its place. */
static void make_soup(uint64_t seed, double off) {
    enum { N = 18, M = 9 };
    txm_rng rng = txm_rng_make(seed, 1);
    in.vertices = in.triangles = 0;
    for (int i = 0; i < N * M * 2; i++) {
        uint32_t v[3];
        for (int k = 0; k < 3; k++) {
            static const int over[2][3] = {{0, 1, 1}, {0, 1, 0}}, up[2][3] = {{0, 0, 1}, {0, 1, 1}};
            const double s = 2 * TXM_PI * (i / 2 % N + over[i % 2][k]) / N;
            const double t = 2 * TXM_PI * (i / 2 / N + up[i % 2][k]) / M;
            const double r = 1 + 0.4 * cos(t);
            v[k] = vertex(r * cos(s) + off * txm_rng_double(&rng),
                          r * sin(s) + off * txm_rng_double(&rng),
                          0.4 * sin(t) + off * txm_rng_double(&rng));
        }
        triangle(v[0], v[1], v[2]);
    }
}

/* Triangles of three vertices of their own, anywhere. */
static void make_confetti(uint64_t seed, int triangles) {
    txm_rng rng = txm_rng_make(seed, 2);
    in.vertices = in.triangles = 0;
    for (int i = 0; i < triangles; i++) {
        uint32_t v[3];
        for (int k = 0; k < 3; k++)
            v[k] = vertex(txm_rng_double(&rng), txm_rng_double(&rng), txm_rng_double(&rng));
        triangle(v[0], v[1], v[2]);
    }
}

/* The complete graph between three times n vertices, a b c, drawn on a surface: triangles a_i b_j c_i+j
   and b_j a_i c_i+j+1, so that every vertex has 2 n neighbours. V = 3 n, F = 2 n^2. */
static void make_handles(int n) {
    txm_rng rng = txm_rng_make(3, 3);
    in.vertices = in.triangles = 0;
    for (int i = 0; i < 3 * n; i++)
        vertex(txm_rng_double(&rng), txm_rng_double(&rng), txm_rng_double(&rng));
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) {
            const uint32_t a = (uint32_t)i, b = (uint32_t)(n + j);
            triangle(a, b, (uint32_t)(2 * n + (i + j) % n));
            triangle(b, a, (uint32_t)(2 * n + (i + j + 1) % n));
        }
    }
}

/* Retile `in` with both methods; how many of them made a mesh. The others must have said why. */
static int retile_both(size_t vertices) {
    int made = 0;
    for (int method = 0; method < 2; method++) {
        trimesh_desc d = describe(vertices, method ? TRIMESH_REPEL : TRIMESH_LATTICE);
        txm_env env;
        trimesh_mesh *mesh = NULL;
        trimesh_report report;
        memset(&env, 0, sizeof env);
        d.report = &report;
        const txm_status status = trimesh_retile(&d, &env, &mesh);
        assert_true(report.loops > 0);
        if (status == TXM_OK) {
            made++;
            assert_int_equal(mesh->vertex_count, vertices);
        } else {
            assert_int_equal(status, TXM_TOO_SMALL);
            assert_null(mesh);
            assert_true(env.message[0] != 0);
        }
        trimesh_mesh_free(mesh);
    }
    return made;
}

static void test_crosses(void **state) {
    (void)state;
    static const int cards[] = {2, 5, 10};
    for (int i = 0; i < 3; i++) {
        make_cross(cards[i]);
        assert_int_equal(retile_both(300), 2);
    }
}

static void test_soup(void **state) {
    (void)state;
    make_soup(1, 1e-3);
    retile_both(1000);
}

static void test_confetti(void **state) {
    (void)state;
    for (uint64_t seed = 0; seed < 4; seed++) {
        make_confetti(seed, 5 + 20 * (int)seed);
        retile_both(300 + 100 * (size_t)seed);
    }
}

/* Only as far as sampling: to be retiled such a surface would need many more vertices. */
static void test_handles(void **state) {
    (void)state;
    make_handles(70);
    for (int method = 0; method < 2; method++) {
        trimesh_desc d = describe(210, method ? TRIMESH_REPEL : TRIMESH_LATTICE);
        trimesh_report report;
        trimesh_job *job = NULL;
        d.report = &report;
        assert_int_equal(trimesh_begin(&d, NULL, &job), TXM_OK);
        assert_int_equal(report.components, 1);
        assert_int_equal(report.euler, 210 - 70 * 70);
        if (method) assert_int_equal(trimesh_step(job, NULL, NULL), TXM_OK);
        trimesh_free(job);
    }
}

/* Many narrow blades: their borders take more vertices than their area, so lines get longer edges. */
static void test_blades(void **state) {
    (void)state;
    in.vertices = in.triangles = 0;
    for (int i = 0; i < 100; i++) {
        const double x = i % 10, y = 0.7 * i;
        const uint32_t a = vertex(x, y, 0), b = vertex(x + 0.01, y, 0), c = vertex(x + 0.01, y, 1);
        quad(a, b, c, vertex(x, y, 1));
    }
    retile_both(1000);
}

/* Two triangles folded onto each other: along the fold their normals cancel out, but a result has unit
   normals everywhere. */
static void test_fold(void **state) {
    (void)state;
    in.vertices = in.triangles = 0;
    const uint32_t a = vertex(0, 0, 0), b = vertex(1, 0, 0);
    triangle(a, b, vertex(0.3, 1, 0));
    triangle(b, a, vertex(0.7, 1, 0));
    const trimesh_desc d = describe(60, TRIMESH_LATTICE);
    trimesh_mesh *mesh = NULL;
    assert_int_equal(trimesh_retile(&d, NULL, &mesh), TXM_OK);
    for (size_t v = 0; v < mesh->vertex_count; v++)
        assert_true(fabs(txm_d3_len(txm_d3_load(mesh->normals + 3 * v)) - 1) < 1e-6);
    trimesh_mesh_free(mesh);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_crosses),
        cmocka_unit_test(test_soup),
        cmocka_unit_test(test_confetti),
        cmocka_unit_test(test_handles),
        cmocka_unit_test(test_blades),
        cmocka_unit_test(test_fold),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
