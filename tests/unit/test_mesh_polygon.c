/* test_mesh_polygon.c - polygons of all shapes and sizes become triangles
   SPDX-License-Identifier: MIT OR Unlicense

   Built with: tools/files/mesh*.c tools/files/image_io.c tools/files/stb.c                       */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "meshkit.h"

#include <time.h>

/* ---- helpers ------------------------------------------------------------------------------- */

enum { MOST = 100000 };

static double flat[MOST][2]; /* the polygon of a test */
static size_t count;

static void begin(void) {
    count = 0;
}

static void add(double x, double y) {
    assert_true(count < MOST);
    flat[count][0] = x;
    flat[count++][1] = y;
}

/* As a mesh, seen after a turn: 0 flat on z, 1 aslant, 2 aslant and bent. */
static void make_mesh(int view, mesh_data *m) {
    char *text = (char *)malloc(count * 90 + 100);
    size_t n = 0;
    assert_non_null(text);
    for (size_t i = 0; i < count; i++) {
        const double x = flat[i][0], y = flat[i][1], z = view == 2 ? 0.1 * sin(x) * cos(y) : 0;
        const double c = view ? 0.8 : 1, s = view ? 0.6 : 0;
        const double u = c * x + s * z, w = c * z - s * x;
        n += (size_t)sprintf(text + n, "v %.17g %.17g %.17g\n", u, c * y + s * w, c * w - s * y);
    }
    n += (size_t)sprintf(text + n, "f");
    for (size_t i = 0; i < count; i++) n += (size_t)sprintf(text + n, " %lu", (unsigned long)i + 1);
    text[n] = 0;
    read_text(text, m);
    free(text);
}

static double area2(size_t a, size_t b, size_t c) {
    return (flat[b][0] - flat[a][0]) * (flat[c][1] - flat[a][1]) -
           (flat[b][1] - flat[a][1]) * (flat[c][0] - flat[a][0]);
}

/* Two triangles less than corners, none of them turned over, all together as large as the polygon:
   then they cover it, each place once. Returns the share that have a height of less than 1/1000 of
   their longest side. */
static double check_polygon(int view) {
    mesh_data m;
    double sum = 0, wanted = 0, longest = 0;
    size_t slivers = 0;
    make_mesh(view, &m);
    assert_int_equal(m.triangle_count, count - 2);
    for (size_t i = 0; i < count; i++) {
        const size_t k = (i + 1) % count;
        wanted += flat[i][0] * flat[k][1] - flat[i][1] * flat[k][0];
        longest = fmax(longest, fmax(fabs(flat[i][0]), fabs(flat[i][1])));
    }
    for (size_t t = 0; t < m.triangle_count; t++) {
        const uint32_t *v = m.indices + 3 * t;
        const double area = area2(v[0], v[1], v[2]);
        double side = 0;
        for (int k = 0; k < 3; k++) {
            const double *p = flat[v[k]], *q = flat[v[(k + 1) % 3]];
            side = fmax(side, hypot(p[0] - q[0], p[1] - q[1]));
        }
        if (area < -1e-9 * longest * side) fail_msg("triangle %d: %g", (int)t, area);
        slivers += area < 1e-3 * side * side;
        sum += area;
    }
    assert_float_equal(sum / wanted, 1, 1e-9);
    mesh_free(&m);
    return (double)slivers / (double)count;
}

static void check_views(void) {
    for (int view = 0; view < 3; view++) check_polygon(view);
}

static const double TURN = 6.283185307179586;

/* ---- shapes -------------------------------------------------------------------------------- */

static void gears_and_stars(void **state) {
    (void)state;
    static const int teeth[] = {3, 5, 12, 90, 270, 5000};
    for (size_t i = 0; i < sizeof teeth / sizeof teeth[0]; i++) {
        begin();
        for (int t = 0; t < 4 * teeth[i]; t++) { /* as gears are drawn */
            const double angle = TURN * t / (4.0 * teeth[i]), r = t % 4 < 2 ? 1 : 0.9;
            add(r * cos(angle), r * sin(angle));
        }
        check_views();
        begin();
        for (int t = 0; t < 2 * teeth[i]; t++) {
            const double angle = TURN * t / (2.0 * teeth[i]), r = t % 2 ? 0.1 : 1;
            add(r * cos(angle), r * sin(angle));
        }
        check_views();
    }
}

/* Combs, spirals, zigzags, and random radii. */
static void long_and_thin(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(5, 0);
    begin();
    for (int i = 0; i < 500; i++) { /* a comb with teeth downwards */
        add(i, 0);
        add(i + 0.4, -300);
        add(i + 0.5, 0);
    }
    add(500, 1);
    add(0, 1);
    check_polygon(0);
    check_polygon(1);
    begin();
    for (int i = 0; i < 3000; i++) /* the outer arm first, then the inner one back */
        add((1.5 + i * 0.01) * cos(i * 0.05), (1.5 + i * 0.01) * sin(i * 0.05));
    for (int i = 3000; i-- > 0;) add((1 + i * 0.01) * cos(i * 0.05), (1 + i * 0.01) * sin(i * 0.05));
    check_polygon(0);
    check_polygon(1);
    for (int n = 5; n <= 5000; n *= 10) {
        begin();
        for (int i = 0; i < n; i++) {
            const double angle = TURN * i / n, r = 0.05 + txm_rng_double(&rng);
            add(r * cos(angle), r * sin(angle));
        }
        check_polygon(0);
        check_polygon(1);
    }
}

/* Corners in a line, along an axis and aslant, where rounding moves them a little. */
static void corners_in_a_line(void **state) {
    (void)state;
    for (int n = 2; n <= 200; n *= 10) {
        for (int slant = 0; slant < 3; slant++) {
            const double c = slant ? cos(0.3 * slant) : 1, s = slant ? sin(0.3 * slant) : 0;
            begin();
            for (int side = 0; side < 4; side++) {
                for (int i = 0; i < n; i++) {
                    const double t = (double)i / n;
                    const double x = side == 0 ? t : side == 1 ? 1 : side == 2 ? 1 - t : 0;
                    const double y = side == 0 ? 0 : side == 1 ? t : side == 2 ? 1 : 1 - t;
                    add((double)(float)(c * x - s * y), (double)(float)(s * x + c * y));
                }
            }
            check_polygon(0);
            check_polygon(1);
        }
    }
    begin(); /* only one corner is off the line */
    for (int i = 0; i <= 1000; i++) add(i * 0.7, i * 0.1);
    add(0, 300);
    check_polygon(0);
    assert_float_equal(check_polygon(1), 0, 0.5);
}

/* A plate with a hole that a doubled edge joins on; polygons that touch themselves. */
static void keyholes(void **state) {
    (void)state;
    for (int n = 4; n <= 4000; n *= 10) {
        begin();
        for (int i = 0; i <= n; i++) add(2 * cos(TURN * i / n), i % n ? 2 * sin(TURN * i / n) : 0);
        for (int i = n; i >= 0; i--) add(cos(TURN * i / n), i % n ? sin(TURN * i / n) : 0);
        flat[n][0] = flat[0][0];
        check_polygon(0);
        check_polygon(1);
    }
    begin(); /* two squares that touch at 1 1 */
    add(0, 0), add(1, 0), add(1, 1), add(2, 1), add(2, 2), add(1, 2), add(1, 1), add(0, 1);
    check_views();
}

/* No slivers where there need be none; long polygons are halved. */
static void triangles_are_no_fans(void **state) {
    (void)state;
    mesh_data m;
    static int valence[MOST];
    int most = 0;
    begin();
    for (int i = 0; i < 1024; i++) add(cos(TURN * i / 1024), sin(TURN * i / 1024));
    check_views();
    make_mesh(0, &m);
    memset(valence, 0, sizeof valence);
    for (size_t c = 0; c < 3 * m.triangle_count; c++) valence[m.indices[c]]++;
    for (size_t i = 0; i < count; i++) most = valence[i] > most ? valence[i] : most;
    assert_true(most <= 2 * 10 + 2); /* two more each time */
    mesh_free(&m);
    begin();
    for (int i = 0; i < 50; i++) add(i, 0);
    for (int i = 50; i-- > 0;) add(i, 1);
    assert_float_equal(check_polygon(0), 0, 0);
    /* quads: the better diagonal where the first is bad */
    begin();
    add(0, 0), add(1, 1e-9), add(2, 0), add(1, 5);
    assert_float_equal(check_polygon(0) * 4, 0, 2);
}

/* Any triangles, as many as there must be. */
static void polygons_that_are_none(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(9, 0);
    for (int n = 4; n <= 400; n *= 10) {
        mesh_data m;
        begin();
        for (int i = 0; i < n; i++) add(txm_rng_double(&rng), txm_rng_double(&rng));
        make_mesh(1, &m);
        assert_int_equal(m.triangle_count, n - 2);
        mesh_free(&m);
        begin();
        for (int i = 0; i < n; i++) add(i % 7, 0);
        make_mesh(2, &m);
        assert_int_equal(m.triangle_count, n - 2);
        mesh_free(&m);
        begin();
        for (int i = 0; i < n; i++) add(0.5, 0.25);
        make_mesh(1, &m);
        assert_int_equal(m.triangle_count, n - 2);
        mesh_free(&m);
    }
}

/* Twenty times the corners take not much more than twenty times as long. */
static void time_grows_as_it_should(void **state) {
    (void)state;
    double seconds[2];
    for (int large = 0; large < 2; large++) {
        const int n = large ? 80000 : 4000;
        begin();
        for (int t = 0; t < n; t++) {
            const double angle = TURN * t / n, r = t % 4 < 2 ? 1 : 0.9;
            add(r * cos(angle), r * sin(angle));
        }
        const clock_t start = clock();
        check_polygon(0);
        seconds[large] = (double)(clock() - start) / CLOCKS_PER_SEC;
    }
    if (seconds[1] > 100 * (seconds[0] + 0.01)) fail_msg("%g s, %g s", seconds[0], seconds[1]);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(gears_and_stars),
        cmocka_unit_test(long_and_thin),
        cmocka_unit_test(corners_in_a_line),
        cmocka_unit_test(keyholes),
        cmocka_unit_test(triangles_are_no_fans),
        cmocka_unit_test(polygons_that_are_none),
        cmocka_unit_test(time_grows_as_it_should),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
