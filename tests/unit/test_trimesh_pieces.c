/* test_trimesh_pieces.c - trimesh_relax.h: small pieces, and hints that are right
   SPDX-License-Identifier: MIT OR Unlicense

   A surface of many pieces: which are dropped, and what the body gets. A refusal names a number of
   vertices, which must then be enough.                                                          */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "trimesh_relax.h"
#include "surfaces.h"
#include "testkit.h"

static trimesh_report report;
static txm_env env;

/* A sphere of 2 n * n quads. */
static void ball(int n, double x, double radius) {
    const uint32_t top = vertex(x, 0, radius), bottom = vertex(x, 0, -radius);
    const uint32_t first = (uint32_t)in.vertices, m = (uint32_t)(2 * n);
    for (int i = 1; i < n; i++) {
        for (int j = 0; j < 2 * n; j++) {
            const double u = TXM_PI * i / n, v = TXM_PI * j / n;
            vertex(x + radius * sin(u) * cos(v), radius * sin(u) * sin(v), radius * cos(u));
        }
    }
    for (uint32_t j = 0; j < m; j++) {
        const uint32_t a = first + j, b = first + (j + 1) % m, last = m * (uint32_t)(n - 2);
        triangle(top, a, b);
        triangle(bottom, last + b, last + a);
        for (uint32_t i = 0; i < last; i += m) quad(a + i, a + i + m, b + i + m, b + i);
    }
}

static void crumbs(int count, double size) {
    txm_rng rng = txm_rng_make(3, 3);
    for (int i = 0; i < count; i++) {
        const double x = 2 + txm_rng_double(&rng), y = 3 * txm_rng_double(&rng);
        triangle(vertex(x, y, 0), vertex(x + size, y, 0), vertex(x, y + size, 0));
    }
}

static trimesh_desc describe(size_t vertices) {
    trimesh_desc desc = desc_of_in(vertices);
    desc.report = &report;
    return desc;
}

static txm_status retile(const trimesh_desc *desc, size_t *vertices) {
    trimesh_mesh *mesh = NULL;
    memset(&env, 0, sizeof env);
    const txm_status status = trimesh_retile(desc, &env, &mesh);
    if (vertices) *vertices = mesh ? mesh->vertex_count : 0;
    trimesh_mesh_free(mesh);
    return status;
}

static void test_crumbs(void **state) {
    size_t vertices;
    (void)state;
    in.vertices = in.triangles = 0;
    ball(12, 0, 1);
    crumbs(700, 0.001);
    trimesh_desc desc = describe(1000);
    assert_int_equal(retile(&desc, &vertices), TXM_OK);
    assert_int_equal(vertices, 1000);
    assert_in_range(report.dropped, 650, 700);
    assert_true(report.dropped_area < 0.001);
    assert_int_equal(report.components, 701 - report.dropped);
    assert_int_equal(report.loops, 700 - report.dropped);

    desc.drop_below = 0.001f; /* all of them */
    assert_int_equal(retile(&desc, &vertices), TXM_OK);
    assert_int_equal(report.dropped, 700);
    assert_int_equal(report.components, 1);
    assert_int_equal(report.euler, 2);

    in.vertices = in.triangles = 0; /* a few stay */
    ball(12, 0, 1);
    ball(5, 1.2, 0.03);
    ball(5, 1.4, 0.03);
    desc = describe(1000);
    assert_int_equal(retile(&desc, &vertices), TXM_OK);
    assert_int_equal(report.dropped, 0);
    assert_int_equal(report.components, 3);
    desc.drop_below = 2; /* out of range */
    assert_int_equal(retile(&desc, NULL), TXM_BAD_ARGUMENT);
}

/* The number that the message names is enough. */
static void check_hint(trimesh_desc desc) {
    assert_int_equal(retile(&desc, NULL), TXM_TOO_SMALL);
    const char *give = strstr(env.message, "; give ");
    assert_non_null(give);
    desc.vertices = (size_t)atol(give + 7);
    assert_true(desc.vertices > 4);
    assert_int_equal(retile(&desc, NULL), TXM_OK);
}

static void test_hints(void **state) {
    (void)state;
    in.vertices = in.triangles = 0; /* cubes: eight corners each */
    for (int i = 0; i < 40; i++) add_box(2 * (i % 8), 2 * (i / 8), 0, 1, 1, 1);
    for (int method = 0; method < 2; method++) {
        for (size_t n = 4; n < 320; n += 90) {
            trimesh_desc desc = describe(n);
            desc.method = method ? TRIMESH_REPEL : TRIMESH_LATTICE;
            check_hint(desc);
        }
    }
    in.vertices = in.triangles = 0; /* triangles apart */
    crumbs(90, 0.5);
    check_hint(describe(100));
}

/* Cards that cross exactly at an edge or a corner, and sheets that lie on each other. */
static void test_touching(void **state) {
    (void)state;
    for (int n = 2; n < 8; n++) {
        in.vertices = in.triangles = 0;
        const uint32_t low = vertex(0, 0, 0), high = vertex(0, 0, 1);
        for (int i = 0; i < 2 * n; i++) {
            const double u = TXM_PI * i / n;
            quad(low, vertex(cos(u), sin(u), 0), vertex(cos(u), sin(u), 1), high);
        }
        trimesh_desc desc = describe(600);
        assert_int_equal(retile(&desc, NULL), TXM_OK);
        assert_int_equal(report.overfull, 1);
        assert_int_equal(report.components, n);
    }
    in.vertices = in.triangles = 0;
    add_box(0, 0, 0, 1, 1, 1);
    add_box(1, 0.25, 0.25, 0.5, 0.5, 0.5);
    trimesh_desc desc = describe(600);
    assert_int_equal(retile(&desc, NULL), TXM_OK);
}

static txm_status sweep(void *context, txm_env *given) {
    trimesh_mesh *mesh = NULL;
    const txm_status status = trimesh_retile((const trimesh_desc *)context, given, &mesh);
    trimesh_mesh_free(mesh);
    return status;
}

static void test_faults(void **state) {
    (void)state;
    in.vertices = in.triangles = 0;
    ball(5, 0, 1);
    crumbs(40, 0.001);
    trimesh_desc desc = describe(60);
    desc.report = NULL;
    assert_true(tk_sweep(sweep, &desc, TK_ALLOCATION) > 10);
    assert_true(tk_sweep(sweep, &desc, TK_CANCEL) > 4);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_crumbs),   cmocka_unit_test(test_hints),
        cmocka_unit_test(test_touching), cmocka_unit_test(test_faults),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
