/* test_texmath_vector.c - vectors, quaternions, eigenvectors
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texmath_vector && build/tests/unit/test_texmath_vector */
#include "mathkit.h"

/* ---- vectors ---------------------------------------------------------------------------- */

static void test_vectors(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(8, 0);
    assert_true(txm_v2(3, 4).x == 3 && txm_v2(3, 4).y == 4);
    for (int i = 0; i < 2000; i++) {
        const txm_vec3 a = random_vec3(&rng, 10), b = random_vec3(&rng, 10);
        const txm_vec3 c = txm_vec3_cross(a, b), p = txm_vec3_perpendicular(a);
        assert_near(txm_vec3_dot(a, c), 0, 2e-4);
        assert_near(txm_vec3_dot(b, c), 0, 2e-4);
        /* |a x b|^2 + (a b)^2 = |a|^2 |b|^2 */
        assert_near(txm_vec3_dot(c, c) + (double)txm_vec3_dot(a, b) * txm_vec3_dot(a, b),
                    (double)txm_vec3_dot(a, a) * txm_vec3_dot(b, b), 0.05);
        assert_near(txm_vec3_length(txm_vec3_normalize(a)), 1, 1e-6);
        assert_near(txm_vec3_length(p), 1, 1e-6);
        assert_near(txm_vec3_dot(txm_vec3_normalize(a), p), 0, 1e-6);
        assert_vec3(txm_vec3_add(txm_vec3_sub(a, b), b), a, 1e-5);
        assert_vec3(txm_vec3_lerp(a, b, 0.25f),
                    txm_vec3_add(txm_vec3_scale(a, 0.75f), txm_vec3_scale(b, 0.25f)), 1e-5);
    }
    const txm_vec3 zero = txm_v3(0, 0, 0);
    assert_vec3(txm_vec3_normalize(zero), zero, 0);
    assert_vec3(txm_vec3_perpendicular(zero), txm_v3(1, 0, 0), 0);
    /* neither overflow nor underflow on the way */
    assert_vec3(txm_vec3_normalize(txm_v3(3e38f, 0, 0)), txm_v3(1, 0, 0), 0);
    assert_vec3(txm_vec3_normalize(txm_v3(0, 1e-44f, 0)), txm_v3(0, 1, 0), 0);
    assert_near(txm_vec3_length(txm_vec3_perpendicular(txm_v3(3e38f, 1e38f, 0))), 1, 1e-6);
}

static void test_double_vectors(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(8, 8);
    for (int i = 0; i < 1000; i++) {
        const txm_vec3 fa = random_vec3(&rng, 10), fb = random_vec3(&rng, 10);
        const float three[3] = {fa.x, fa.y, fa.z};
        const txm_dvec3 a = txm_d3_load(three), b = txm_d3(fb.x, fb.y, fb.z);
        const txm_dvec3 c = txm_d3_cross(a, b), unit = txm_d3_unit(a), back = txm_d3_sub(b, a);
        assert_true(a.x == fa.x && a.y == fa.y && a.z == fa.z);
        assert_near(txm_d3_dot(a, c), 0, 1e-12);
        assert_near(txm_d3_dot(b, c), 0, 1e-12);
        assert_near(txm_d3_len2(c), txm_d3_len2(a) * txm_d3_len2(b) -
                                        txm_d3_dot(a, b) * txm_d3_dot(a, b), 1e-9);
        assert_near(txm_d3_len(unit), 1, 1e-15);
        assert_near(txm_d3_dot(unit, a), txm_d3_len(a), 1e-12);
        assert_near(txm_d3_dist(a, b), txm_d3_len(back), 0);
        assert_near(txm_d3_dist2(a, b), txm_d3_len2(back), 0);
        assert_near(txm_d3_dist(txm_d3_add(a, back), b), 0, 1e-13);
        assert_near(txm_d3_dist(txm_d3_mad(a, back, 1), b), 0, 1e-13);
        assert_near(txm_d3_dist(txm_d3_mad(a, b, -3), txm_d3_sub(a, txm_d3_scale(b, 3))), 0, 1e-13);
        /* the same as the vectors in float, rounded */
        assert_near(txm_vec3_length(fa), txm_d3_len(a), 1e-5);
        assert_near(txm_vec3_dot(fa, fb), txm_d3_dot(a, b), 1e-4);
        const txm_dvec3 corner = txm_d3(1, 2, 3);
        const txm_dvec3 area = txm_d3_area2(corner, txm_d3_add(corner, a), txm_d3_add(corner, b));
        assert_near(txm_d3_dist(area, c), 0, 1e-11);
    }
    const txm_dvec3 zero = txm_d3_unit(txm_d3(0, 0, 0));
    assert_true(zero.x == 0 && zero.y == 0 && zero.z == 0);
    for (double size = 1e-320; size < 1e308; size *= 1e4) { /* also where its square is 0 or infinite */
        const txm_dvec3 unit = txm_d3_unit(txm_d3(size, -size, 0));
        assert_near(txm_d3_dist(unit, txm_d3(sqrt(0.5), -sqrt(0.5), 0)), 0, 1e-15);
    }
    const txm_dvec3 up = txm_d3_area2(txm_d3(0, 0, 0), txm_d3(2, 0, 0), txm_d3(0, 3, 0));
    assert_true(up.x == 0 && up.y == 0 && up.z == 6);
}

/* ---- quaternions ------------------------------------------------------------------------ */

static double quat_dot(txm_quat a, txm_quat b) {
    return a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w;
}

/* counter-clockwise about a unit axis, seen from its tip */
static txm_quat about(txm_dvec3 axis, double angle) {
    const double s = sin(angle / 2);
    const txm_quat q = {s * axis.x, s * axis.y, s * axis.z, cos(angle / 2)};
    return q;
}

static void assert_dvec3(txm_dvec3 a, txm_dvec3 b, double tolerance) {
    assert_near(a.x, b.x, tolerance);
    assert_near(a.y, b.y, tolerance);
    assert_near(a.z, b.z, tolerance);
}

/* the images of the three axes, and the rotation they give */
static txm_quat there_and_back(txm_quat q) {
    return txm_quat_from_axes(txm_quat_rotate(q, txm_d3(1, 0, 0)),
                              txm_quat_rotate(q, txm_d3(0, 1, 0)),
                              txm_quat_rotate(q, txm_d3(0, 0, 1)));
}

static void test_quaternions(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(12, 0);
    const txm_quat quarter = about(txm_d3(0, 0, 1), TXM_PI / 2), zero = {0, 0, 0, 0};
    assert_dvec3(txm_quat_rotate(quarter, txm_d3(1, 0, 0)), txm_d3(0, 1, 0), 1e-15);
    assert_dvec3(txm_quat_rotate(quarter, txm_d3(0, 1, 0)), txm_d3(-1, 0, 0), 1e-15);
    assert_true(txm_quat_unit(zero).w == 1 && txm_quat_unit(zero).x == 0);
    for (int i = 0; i < 3000; i++) {
        const txm_quat a = txm_quat_unit(random_quat(&rng)), b = txm_quat_unit(random_quat(&rng));
        const txm_vec3 f = random_vec3(&rng, 2), g = random_vec3(&rng, 1);
        const txm_dvec3 v = txm_d3(f.x, f.y, f.z), axis = txm_d3_unit(txm_d3(g.x, g.y, g.z));
        assert_near(quat_dot(a, a), 1, 1e-15);
        assert_near(quat_dot(txm_quat_mul(a, b), txm_quat_mul(a, b)), 1, 1e-14);
        assert_near(txm_d3_len(txm_quat_rotate(a, v)), txm_d3_len(v), 1e-14);
        assert_dvec3(txm_quat_rotate(txm_quat_mul(a, b), v),
                     txm_quat_rotate(a, txm_quat_rotate(b, v)), 1e-14);
        assert_dvec3(txm_quat_rotate(txm_quat_conjugate(a), txm_quat_rotate(a, v)), v, 1e-14);
        /* by the axes that it makes; the length is 4 times the largest component */
        const txm_quat back = there_and_back(a);
        const double size = sqrt(quat_dot(back, back)), part[4] = {a.x, a.y, a.z, a.w};
        double largest = 0;
        for (int k = 0; k < 4; k++) largest = fmax(largest, fabs(part[k]));
        assert_near(size, 4 * largest, 1e-13);
        assert_near(fabs(quat_dot(a, txm_quat_unit(back))), 1, 1e-14);

        /* the axis stays where it is; a vector across it turns by the angle, to the left */
        const double angle = random_float(&rng, -3, 3);
        const txm_quat turn = about(axis, angle);
        const txm_dvec3 across = txm_d3_unit(txm_d3_cross(axis, v));
        assert_dvec3(txm_quat_rotate(turn, axis), axis, 1e-14);
        assert_dvec3(txm_quat_rotate(turn, across),
                     txm_d3_mad(txm_d3_scale(across, cos(angle)), txm_d3_cross(axis, across),
                                sin(angle)), 1e-14);
    }
    /* half turns, where w = 0 and three of Shepperd's four ways divide by zero */
    for (int k = 0; k < 3; k++) {
        const txm_dvec3 axis = txm_d3(k == 0, k == 1, k == 2);
        const txm_quat half = txm_quat_unit(there_and_back(about(axis, TXM_PI)));
        assert_near(fabs(half.x * axis.x + half.y * axis.y + half.z * axis.z), 1, 1e-15);
    }
}

/* ---- eigensystem ------------------------------------------------------------------------ */

static void check_eigen(const double a[6], double size) {
    double values[3], vectors[3][3];
    const double m[3][3] = {{a[0], a[1], a[2]}, {a[1], a[3], a[4]}, {a[2], a[4], a[5]}};
    assert_int_equal(txm_eigen3(a, values, vectors), TXM_OK);
    assert_true(values[0] >= values[1] && values[1] >= values[2]);
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 3; i++) {
            double sum = 0, dot = 0;
            for (int j = 0; j < 3; j++) {
                sum += m[i][j] * vectors[k][j];
                dot += vectors[k][j] * vectors[i][j];
            }
            assert_near(sum, values[k] * vectors[k][i], 1e-14 * size);
            assert_near(dot, i == k, 1e-14);
        }
        /* right-handed */
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        assert_near(vectors[2][k], vectors[0][i] * vectors[1][j] - vectors[0][j] * vectors[1][i],
                    1e-14);
        /* the sign: the component of largest magnitude is positive */
        if (k == 2) continue;
        double most = 0, least = 0;
        for (int x = 0; x < 3; x++) {
            most = fmax(most, vectors[k][x]);
            least = fmin(least, vectors[k][x]);
        }
        assert_true(most >= -least * (1 - 2e-9));
    }
}

static void test_eigen(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(14, 0);
    for (int i = 0; i < 20000; i++) {
        const double size = pow(10, txm_rng_double(&rng) * 40 - 20);
        double a[6];
        for (int k = 0; k < 6; k++) {
            a[k] = (txm_rng_double(&rng) * 2 - 1) * size;
            if (i % 3 == 1) a[k] = txm_rng_range(&rng, -1, 1) * size;    /* many equal, many zero */
            if (i % 3 == 2) a[k] *= pow(10, -txm_rng_double(&rng) * 20); /* graded             */
        }
        check_eigen(a, size * 4);
    }
    /* known: 3, 1 and 0 of this one; and equal values, zero, rank 1 */
    static const double known[6] = {2, 1, 0, 2, 0, 0};
    double values[3], vectors[3][3];
    assert_int_equal(txm_eigen3(known, values, vectors), TXM_OK);
    assert_near(values[0], 3, 1e-15);
    assert_near(values[1], 1, 1e-15);
    assert_near(values[2], 0, 1e-15);
    assert_near(vectors[0][0], sqrt(0.5), 1e-15);
    assert_near(vectors[1][0], sqrt(0.5), 1e-15); /* a tie of magnitudes: the first is positive */
    static const double odd[4][6] = {
        {0, 0, 0, 0, 0, 0}, {5, 0, 0, 5, 0, 5}, {1, 1, 1, 1, 1, 1}, {1e300, 1e300, 0, 1e300, 0, 1}};
    for (int i = 0; i < 4; i++) check_eigen(odd[i], i == 3 ? 4e300 : 10);
    for (int k = 0; k < 6; k++) {
        double bad[6] = {1, 2, 3, 4, 5, 6};
        bad[k] = k % 2 ? NAN : INFINITY;
        values[0] = 77;
        assert_int_equal(txm_eigen3(bad, values, vectors), TXM_BAD_ARGUMENT);
        assert_true(values[0] == 77);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_vectors),
        cmocka_unit_test(test_double_vectors),
        cmocka_unit_test(test_quaternions),
        cmocka_unit_test(test_eigen),
    };
    return cmocka_run_group_tests_name("texmath vectors", tests, NULL, NULL);
}
