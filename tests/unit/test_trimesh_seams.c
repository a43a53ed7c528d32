/* test_trimesh_seams.c - lines that the caller wants followed: seams of texture coordinates
   SPDX-License-Identifier: MIT OR Unlicense

   The surfaces are balls and boxes of six charts, and a pipe that is cut open once.             */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "trimesh_relax.h"
#include "surfaces.h"
#include "faults.h"
#include "testkit.h"

static uint32_t seams[3 * MOST_TRIANGLES]; /* of `in` */
static const trimesh_method both[2] = {TRIMESH_LATTICE, TRIMESH_REPEL};

static trimesh_desc describe(size_t vertices, trimesh_method method) {
    trimesh_desc d = desc_of_in(vertices);
    d.method = method;
    d.seams = seams;
    return d;
}

/* One of the six sides of a cube, in n x n quads, blown up to a sphere of radius 1; each has vertices of
   its own, as glTF has it, and its number as the entry of all its corners. */
static void make_ball(int n) {
    in.vertices = in.triangles = 0;
    for (int side = 0; side < 6; side++) {
        const uint32_t first = (uint32_t)in.vertices;
        const size_t before = in.triangles;
        for (int i = 0; i <= n; i++) {
            for (int j = 0; j <= n; j++) {
                const double sign = side % 2 ? -1 : 1;
                const double a = tan(TXM_PI / 4 * (2.0 * i / n - 1)) * sign;
                const double b = tan(TXM_PI / 4 * (2.0 * j / n - 1));
                double p[3];
                p[side / 2] = sign;
                p[(side / 2 + 1) % 3] = a;
                p[(side / 2 + 2) % 3] = b;
                const double r = sqrt(1 + a * a + b * b);
                vertex(p[0] / r, p[1] / r, p[2] / r);
            }
        }
        for (int i = 0; i < n; i++) {
            for (int j = 0; j < n; j++) {
                const uint32_t at = first + (uint32_t)(i * (n + 1) + j), up = at + (uint32_t)n + 1;
                quad(at, up, up + 1, at + 1);
            }
        }
        for (size_t c = 3 * before; c < 3 * in.triangles; c++) seams[c] = (uint32_t)side;
    }
}

/* how far the point lies outside of the side of the cube: 0 = in it or on its rim */
static double outside(const float *p, int side) {
    const double own = p[side / 2] * (side % 2 ? -1.0 : 1.0);
    return fmax(0, fmax(fabs(p[(side / 2 + 1) % 3]), fabs(p[(side / 2 + 2) % 3])) - own);
}

static trimesh_mesh *retile(const trimesh_desc *d) {
    txm_env env;
    trimesh_mesh *m = NULL;
    memset(&env, 0, sizeof env);
    if (trimesh_retile(d, &env, &m) != TXM_OK) print_message("%s\n", env.message);
    assert_non_null(m);
    return m;
}

/* Every triangle of the result lies in one chart, from far more vertices than the input has to far
   less; the seam is no crease: it is smooth, and bends as the ball does. */
static void test_ball(void **state) {
    static const size_t counts[] = {200, 600, 3000};
    (void)state;
    make_ball(16);
    for (int k = 0; k < 6; k++) {
        trimesh_report report;
        trimesh_desc d = describe(counts[k / 2], both[k % 2]);
        d.report = &report;
        trimesh_mesh *m = retile(&d);
        size_t on = 0;
        assert_int_equal(report.seam_edges, 12 * 16);
        assert_int_equal(report.crease_edges, 0);
        for (size_t t = 0; t < m->triangle_count; t++) {
            int sides = 0;
            for (int side = 0; side < 6; side++) {
                double most = 0;
                for (size_t i = 0; i < 3; i++)
                    most = fmax(most, outside(m->positions + 3 * m->indices[3 * t + i], side));
                sides += most < 2e-3;
            }
            assert_int_equal(sides, 1);
        }
        for (size_t v = 0; v < m->vertex_count; v++) {
            const float *p = m->positions + 3 * v, *n = m->normals + 3 * v;
            assert_true(p[0] * n[0] + p[1] * n[1] + p[2] * n[2] > 0.98f);
            on += m->kinds[v] == TRIMESH_CREASE;
        }
        assert_true(on > 12);
        trimesh_mesh_free(m);
    }
}

/* Entries that do not differ make no seam: byte for byte the same as without. */
static void test_none(void **state) {
    (void)state;
    make_ball(8);
    for (size_t c = 0; c < 3 * in.triangles; c++) seams[c] = 7;
    trimesh_desc d = describe(300, TRIMESH_LATTICE);
    trimesh_mesh *m = retile(&d);
    d.seams = NULL;
    trimesh_mesh *other = retile(&d);
    assert_int_equal(m->triangle_count, other->triangle_count);
    assert_memory_equal(m->positions, other->positions, 3 * m->vertex_count * sizeof(float));
    assert_memory_equal(m->indices, other->indices, 3 * m->triangle_count * sizeof(uint32_t));
    trimesh_mesh_free(m);
    trimesh_mesh_free(other);
}

/* A chart that is too small for three vertices around it leaves no line. */
static void test_small_chart(void **state) {
    (void)state;
    make_ball(16);
    for (size_t c = 0; c < 3 * in.triangles; c++) seams[c] = c / 3 == 100;
    trimesh_report report;
    trimesh_desc d = describe(300, TRIMESH_LATTICE);
    d.report = &report;
    trimesh_mesh *m = retile(&d);
    assert_int_equal(report.seam_edges, 0);
    trimesh_mesh_free(m);
    d.vertices = 8000;
    m = retile(&d);
    assert_int_equal(report.seam_edges, 3);
    trimesh_mesh_free(m);
}

/* A pipe of n x n quads about z, whose texture is cut along y = 0: the cut runs within one chart. */
static void make_pipe(int n) {
    in.vertices = in.triangles = 0;
    for (int i = 0; i <= n; i++) {
        for (int j = 0; j < n; j++)
            vertex(cos(2 * TXM_PI * j / n), sin(2 * TXM_PI * j / n), 4.0 * i / n);
    }
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) {
            const uint32_t low = (uint32_t)(i * n), high = low + (uint32_t)n;
            const uint32_t a = (uint32_t)j, b = (uint32_t)((j + 1) % n);
            const size_t first = in.triangles;
            quad(low + a, low + b, high + b, high + a);
            for (size_t c = 3 * first; c < 3 * in.triangles; c++)
                seams[c] = in.t[c] + (j == n - 1 && in.t[c] % (uint32_t)n == 0 ? 100000u : 0);
        }
    }
}

/* does one of the mesh's edges cross the half plane y = 0, x > 0? */
static int crosses_cut(const trimesh_mesh *m) {
    for (size_t c = 0; c < 3 * m->triangle_count; c++) {
        const float *p = m->positions + 3 * m->indices[c];
        const float *q = m->positions + 3 * m->indices[c % 3 == 2 ? c - 2 : c + 1];
        if (p[0] > 0 && q[0] > 0 && ((p[1] > 1e-4f && q[1] < -1e-4f) || (p[1] < -1e-4f && q[1] > 1e-4f)))
            return 1;
    }
    return 0;
}

static void test_cut(void **state) {
    (void)state;
    make_pipe(40);
    for (int k = 0; k < 2; k++) {
        trimesh_desc d = describe(700, both[k]);
        trimesh_mesh *m = retile(&d);
        assert_false(crosses_cut(m));
        trimesh_mesh_free(m);
        d.seams = NULL;
        m = retile(&d);
        assert_true(crosses_cut(m));
        trimesh_mesh_free(m);
    }
}

/* A globe of n x n quads, whose triangles at a pole have entries of their own there: of the seams only
   the cut from pole to pole is kept. */
static void test_globe(void **state) {
    enum { N = 24 };
    (void)state;
    in.vertices = in.triangles = 0;
    for (int i = 1; i < N; i++) {
        for (int j = 0; j < N; j++) {
            const double a = TXM_PI * i / N, b = 2 * TXM_PI * j / N;
            vertex(sin(a) * cos(b), sin(a) * sin(b), cos(a));
        }
    }
    const uint32_t top = vertex(0, 0, 1), bottom = vertex(0, 0, -1);
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            const uint32_t up = (uint32_t)((i - 1) * N), low = up + N;
            const uint32_t a = (uint32_t)j, b = (uint32_t)((j + 1) % N);
            const size_t first = in.triangles;
            if (i == 0) triangle(top, a, b);
            else if (i == N - 1) triangle(up + a, bottom, up + b);
            else quad(up + a, low + a, low + b, up + b);
            for (size_t c = 3 * first; c < 3 * in.triangles; c++)
                seams[c] = in.t[c] >= top ? 100000 + (uint32_t)c
                           : j == N - 1 && in.t[c] % N == 0 ? 50000 + in.t[c] : in.t[c];
        }
    }
    for (int k = 0; k < 2; k++) {
        trimesh_report report;
        trimesh_desc d = describe(300, both[k]);
        d.report = &report;
        trimesh_mesh *m = retile(&d);
        assert_int_equal(report.seam_edges, N);
        assert_false(crosses_cut(m));
        trimesh_mesh_free(m);
    }
}

/* On a box of six charts all seams are creases, too: the corners stay sharp, and normals differ. */
static void test_box(void **state) {
    (void)state;
    in.vertices = in.triangles = 0;
    add_box(0, 0, 0, 3, 2, 1);
    for (size_t c = 0; c < 3 * in.triangles; c++) seams[c] = (uint32_t)(c / 6);
    trimesh_report report;
    trimesh_desc d = describe(400, TRIMESH_LATTICE);
    d.report = &report;
    trimesh_mesh *m = retile(&d);
    assert_int_equal(report.seam_edges, 12);
    assert_int_equal(report.crease_edges, 12);
    float low[3] = {9, 9, 9}, high[3] = {0, 0, 0};
    for (size_t v = 0; v < m->vertex_count; v++) {
        for (size_t k = 0; k < 3; k++) {
            low[k] = txm_minf(low[k], m->positions[3 * v + k]);
            high[k] = txm_maxf(high[k], m->positions[3 * v + k]);
        }
    }
    for (int k = 0; k < 3; k++) {
        assert_true(fabs((double)low[k]) < 1e-6);
        assert_true(fabs((double)high[k] - (3 - k)) < 1e-6);
    }
    trimesh_mesh_free(m);
}

/* Triangles that are turned, and T-junctions filled with triangles of no area, along a seam. */
static void test_mended(void **state) {
    (void)state;
    make_ball(16);
    for (size_t t = 0; t < in.triangles; t += 3) { /* every third is wound the other way */
        const uint32_t v = in.t[3 * t + 1], e = seams[3 * t + 1];
        in.t[3 * t + 1] = in.t[3 * t + 2];
        in.t[3 * t + 2] = v;
        seams[3 * t + 1] = seams[3 * t + 2];
        seams[3 * t + 2] = e;
    }
    trimesh_report report;
    trimesh_desc d = describe(600, TRIMESH_LATTICE);
    d.report = &report;
    trimesh_mesh *m = retile(&d);
    assert_int_equal(report.seam_edges, 12 * 16);
    assert_true(report.turned > 0);
    trimesh_mesh_free(m);

    /* two squares of different charts; the left one has no vertex in the middle of their common edge,
       but a cap there */
    in.vertices = in.triangles = 0;
    const uint32_t a = vertex(0, 0, 0), b = vertex(1, 0, 0), c = vertex(1, 1, 0), e = vertex(0, 1, 0);
    const uint32_t f = vertex(2, 0, 0), g = vertex(2, 1, 0), h = vertex(1, 0.5, 0);
    quad(a, b, c, e);
    triangle(b, h, c); /* the cap */
    triangle(b, f, h);
    triangle(h, f, g);
    triangle(h, g, c);
    for (size_t k = 0; k < 3 * in.triangles; k++) seams[k] = k >= 9;
    d = describe(300, TRIMESH_LATTICE);
    d.report = &report;
    m = retile(&d);
    assert_int_equal(report.degenerate, 1);
    assert_int_equal(report.seam_edges, 2);
    trimesh_mesh_free(m);
}

static txm_status retile_it(void *context, txm_env *env) {
    trimesh_mesh *m = NULL;
    const txm_status status = trimesh_retile((const trimesh_desc *)context, env, &m);
    assert_true((status == TXM_OK) == (m != NULL));
    trimesh_mesh_free(m);
    return status;
}

static void test_faults(void **state) {
    (void)state;
    make_ball(4);
    trimesh_desc d = describe(100, TRIMESH_LATTICE);
    assert_true(tk_sweep(retile_it, &d, TK_ALLOCATION) > 60);
    assert_true(tk_sweep(retile_it, &d, TK_CANCEL) > 20);
}

/* After an edit the lines are found again: old points on them stay. */
static void test_update(void **state) {
    (void)state;
    make_ball(16);
    trimesh_desc d = describe(600, TRIMESH_LATTICE);
    trimesh_mesh *old = retile(&d), *m = NULL;
    trimesh_update_desc u;
    memset(&u, 0, sizeof u);
    u.desc = d;
    u.desc.vertices = 0;
    assert_int_equal(trimesh_update(old, &u, NULL, &m), TXM_OK);
    size_t kept = 0, on = 0;
    for (size_t v = 0; v < m->vertex_count; v++) {
        if (m->kinds[v] != TRIMESH_CREASE) continue;
        on++;
        kept += m->old_vertices[v] >= 0;
    }
    assert_true(on > 12 && kept == on);
    trimesh_mesh_free(old);
    trimesh_mesh_free(m);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_ball),   cmocka_unit_test(test_none),
        cmocka_unit_test(test_small_chart), cmocka_unit_test(test_cut), cmocka_unit_test(test_globe),
        cmocka_unit_test(test_box),    cmocka_unit_test(test_mended),
        cmocka_unit_test(test_faults), cmocka_unit_test(test_update),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
