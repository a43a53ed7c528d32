/* test_texmath_vector.c - vectors, matrices, quaternions, colour, eigenvectors
   SPDX-License-Identifier: MIT OR Unlicense

   cc -std=c99 -I. -Itests tests/test_texmath_vector.c -lcmocka -lpthread -lm                 */
#include "mathkit.h"

/* ---- vectors and matrices --------------------------------------------------------------- */

static void test_vectors(void **state) {
    (void)state;
    const txm_vec2 a2 = txm_v2(3, 4), b2 = txm_v2(-1, 2);
    const txm_vec4 a4 = txm_v4(1, 2, 3, 4), b4 = txm_v4(4, 3, 2, 1);
    assert_true(txm_vec2_length(a2) == 5 && txm_vec2_dot(a2, b2) == 5);
    assert_true(txm_vec2_cross(a2, b2) == 10);
    assert_near(txm_vec2_normalize(a2).y, 0.8, 1e-7);
    assert_true(txm_vec2_add(a2, b2).x == 2 && txm_vec2_sub(a2, b2).y == 2);
    assert_true(txm_vec2_mul(a2, b2).y == 8 && txm_vec2_scale(a2, 2).x == 6);
    assert_true(txm_vec2_min(a2, b2).x == -1 && txm_vec2_max(a2, b2).y == 4);
    assert_true(txm_vec2_lerp(a2, b2, 0.5f).x == 1);
    assert_true(txm_vec4_dot(a4, b4) == 20 && txm_vec4_add(a4, b4).w == 5);
    assert_true(txm_vec4_sub(a4, b4).w == 3 && txm_vec4_mul(a4, b4).z == 6);
    assert_true(txm_vec4_scale(a4, -1).w == -4 && txm_vec4_lerp(a4, b4, 1).w == 1);
    assert_true(txm_vec4_min(a4, b4).w == 1 && txm_vec4_max(a4, b4).x == 4);
    assert_near(txm_vec4_length(txm_vec4_normalize(a4)), 1, 1e-6);

    txm_rng rng = txm_rng_make(8, 0);
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
        assert_vec3(txm_vec3_add(txm_vec3_min(a, b), txm_vec3_max(a, b)), txm_vec3_add(a, b), 0);
        assert_true(txm_vec3_mul(a, b).y == a.y * b.y);
    }
    const txm_vec3 zero = txm_v3(0, 0, 0);
    assert_vec3(txm_vec3_normalize(zero), zero, 0);
    assert_true(txm_vec2_length(txm_vec2_normalize(txm_v2(0, 0))) == 0);
    assert_true(txm_vec4_length(txm_vec4_normalize(txm_v4(0, 0, 0, 0))) == 0);
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
    const txm_dvec3 up = txm_d3_area2(txm_d3(0, 0, 0), txm_d3(2, 0, 0), txm_d3(0, 3, 0));
    assert_true(up.x == 0 && up.y == 0 && up.z == 6);
}

static void test_matrix_inverse(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(9, 0);
    const txm_mat3 unit3 = txm_mat3_identity();
    const txm_mat4 unit4 = txm_mat4_identity();
    int done = 0;
    for (int i = 0; i < 5000; i++) {
        txm_mat3 m3, i3;
        txm_mat4 m4, i4;
        const float size = powf(10.0f, random_float(&rng, -8, 8)); /* scale must not matter */
        for (int k = 0; k < 9; k++) m3.m[k] = random_float(&rng, -size, size);
        for (int k = 0; k < 16; k++) m4.m[k] = random_float(&rng, -size, size);
        assert_floats(txm_mat3_mul(m3, unit3).m, m3.m, 9, 0);
        assert_floats(txm_mat4_mul(unit4, m4).m, m4.m, 16, 0);
        assert_int_equal(txm_mat3_inverse(m3, &i3), TXM_OK);
        assert_int_equal(txm_mat4_inverse(m4, &i4), TXM_OK);
        float largest = 0; /* skip the few that are nearly singular */
        for (int k = 0; k < 9; k++) largest = txm_maxf(largest, fabsf(i3.m[k]) * size);
        for (int k = 0; k < 16; k++) largest = txm_maxf(largest, fabsf(i4.m[k]) * size);
        if (largest > 50) continue;
        done++;
        assert_floats(txm_mat3_mul(m3, i3).m, unit3.m, 9, 1e-4);
        assert_floats(txm_mat3_mul(i3, m3).m, unit3.m, 9, 1e-4);
        assert_floats(txm_mat4_mul(m4, i4).m, unit4.m, 16, 1e-4);
        assert_floats(txm_mat4_mul(i4, m4).m, unit4.m, 16, 1e-4);
        assert_floats(txm_mat3_transpose(txm_mat3_transpose(m3)).m, m3.m, 9, 0);
        assert_floats(txm_mat4_transpose(txm_mat4_transpose(m4)).m, m4.m, 16, 0);
        assert_true(txm_mat3_transpose(m3).m[1] == m3.m[3]);
        assert_true(txm_mat4_transpose(m4).m[1] == m4.m[4]);
    }
    assert_true(done > 4000);

    static const txm_mat3 singular[] = {
        {{1, 2, 3, 4, 5, 6, 7, 8, 9}},     {{0}},
        {{1, 0, 0, 0, 0, 0, 0, 0, 1}},     {{1, 1, 1, 2, 2, 2, 0, 1, 5}},
        {{NAN, 0, 0, 0, 1, 0, 0, 0, 1}},   {{1, 0, 0, 0, INFINITY, 0, 0, 0, 1}},
        {{1e-40f, 0, 0, 0, 1, 0, 0, 0, 1}}};
    for (size_t i = 0; i < sizeof singular / sizeof *singular; i++) {
        txm_mat3 out = unit3;
        assert_int_equal(txm_mat3_inverse(singular[i], &out), TXM_BAD_ARGUMENT);
        assert_floats(out.m, unit3.m, 9, 0);
    }
    /* far away and tiny at once is not singular */
    txm_mat4 m = txm_mat4_mul(txm_mat4_translation(txm_v3(1e6f, -1e6f, 1e6f)),
                              txm_mat4_scale(txm_v3(1e-6f, 1e-6f, 1e-6f))),
             out;
    assert_int_equal(txm_mat4_inverse(m, &out), TXM_OK);
    assert_near(out.m[0], 1e6, 1);
    assert_near(out.m[12], -1e12, 1e6);
}

static void test_transforms(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(10, 0);
    for (int i = 0; i < 1000; i++) {
        const txm_vec3 p = random_vec3(&rng, 5), t = random_vec3(&rng, 5);
        const txm_vec3 s = txm_v3(1.5f, -2, 3);
        const txm_quat q = random_quat(&rng);
        const txm_mat4 m = txm_mat4_mul(txm_mat4_translation(t),
                                        txm_mat4_mul(txm_quat_mat4(q), txm_mat4_scale(s)));
        const txm_vec3 linear = txm_quat_rotate(q, txm_vec3_mul(p, s));
        assert_vec3(txm_mat4_point(m, p), txm_vec3_add(linear, t), 1e-4);
        assert_vec3(txm_mat4_vector(m, p), linear, 1e-4);
        assert_vec3(txm_mat3_vec(txm_mat4_mat3(m), p), linear, 1e-4);

        /* the camera */
        const txm_vec3 eye = random_vec3(&rng, 5), target = random_vec3(&rng, 5);
        const txm_mat4 view_matrix = txm_mat4_look_at(eye, target, txm_v3(0, 1, 0));
        const txm_vec3 seen = txm_mat4_point(view_matrix, target);
        const txm_vec3 above = txm_mat4_vector(view_matrix, txm_v3(0, 1, 0));
        assert_vec3(txm_mat4_point(view_matrix, eye), txm_v3(0, 0, 0), 1e-5);
        assert_vec3(seen, txm_v3(0, 0, -txm_vec3_length(txm_vec3_sub(target, eye))), 1e-5);
        assert_near(above.x, 0, 1e-6);
        assert_true(above.y >= 0);
        const txm_mat3 r = txm_mat4_mat3(view_matrix);
        assert_floats(txm_mat3_mul(r, txm_mat3_transpose(r)).m, txm_mat3_identity().m, 9, 1e-5);
    }
    /* degenerate cameras still give rotations */
    const txm_vec3 o = txm_v3(0, 0, 0), y = txm_v3(0, 1, 0);
    const txm_mat4 odd[3] = {txm_mat4_look_at(o, y, y), txm_mat4_look_at(y, y, y),
                             txm_mat4_look_at(o, y, o)};
    for (int i = 0; i < 3; i++) {
        const txm_mat3 r = txm_mat4_mat3(odd[i]);
        assert_floats(txm_mat3_mul(r, txm_mat3_transpose(r)).m, txm_mat3_identity().m, 9, 1e-6);
    }
    const txm_mat4 lens = txm_mat4_perspective((float)(TXM_PI / 2), 2, 0.5f, 100);
    assert_vec3(txm_mat4_point(lens, txm_v3(0, 0, -0.5f)), txm_v3(0, 0, -1), 1e-5);
    assert_vec3(txm_mat4_point(lens, txm_v3(0, 0, -100)), txm_v3(0, 0, 1), 1e-5);
    assert_vec3(txm_mat4_point(lens, txm_v3(20, 10, -10)), txm_v3(1, 1, 0.909547f), 1e-5);
    assert_vec3(txm_mat4_point(lens, txm_v3(1, 2, 0)), txm_v3(0.5f, 2, -1.0050251f), 1e-5);
}

static void test_quaternions(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(12, 0);
    const txm_quat quarter = txm_quat_axis_angle(txm_v3(0, 0, 5), (float)(TXM_PI / 2));
    assert_vec3(txm_quat_rotate(quarter, txm_v3(1, 0, 0)), txm_v3(0, 1, 0), 1e-6);
    assert_vec3(
        txm_mat4_vector(txm_mat4_rotation(txm_v3(1, 0, 0), (float)(TXM_PI / 2)), txm_v3(0, 1, 0)),
        txm_v3(0, 0, 1), 1e-6);
    assert_true(txm_quat_axis_angle(txm_v3(0, 0, 0), 0).w == 1);
    for (int i = 0; i < 3000; i++) {
        const txm_quat a = random_quat(&rng), b = random_quat(&rng);
        const txm_vec3 v = random_vec3(&rng, 2), axis = random_vec3(&rng, 1);
        const txm_mat3 ma = txm_quat_mat3(a), mb = txm_quat_mat3(b);
        assert_vec3(txm_quat_rotate(a, v), txm_mat3_vec(ma, v), 2e-6);
        assert_floats(txm_quat_mat3(txm_quat_mul(a, b)).m, txm_mat3_mul(ma, mb).m, 9, 2e-6);
        assert_vec3(txm_quat_rotate(txm_quat_conjugate(a), txm_quat_rotate(a, v)), v, 2e-6);
        const txm_quat back = txm_quat_from_mat3(ma);
        assert_true(back.w >= 0);
        assert_near(fabs(txm_quat_dot(a, back)), 1, 1e-6);

        /* the axis stays where it is; half way is half the angle, from either sign */
        const float angle = random_float(&rng, -3, 3), t = txm_rng_float(&rng);
        const txm_quat turn = txm_quat_axis_angle(axis, angle);
        assert_vec3(txm_quat_rotate(turn, axis), axis, 2e-6);
        const txm_quat part = txm_quat_axis_angle(axis, t * angle), none = {0, 0, 0, 1};
        txm_quat minus = {-turn.x, -turn.y, -turn.z, -turn.w};
        assert_near(fabs(txm_quat_dot(txm_quat_slerp(none, turn, t), part)), 1, 1e-6);
        assert_near(fabs(txm_quat_dot(txm_quat_slerp(none, minus, t), part)), 1, 1e-6);
        assert_near(fabs(txm_quat_dot(txm_quat_nlerp(none, turn, t), part)), 1, 0.01);
        for (int k = 0; k < 2; k++) {
            assert_near(fabs(txm_quat_dot(txm_quat_slerp(a, b, (float)k), k ? b : a)), 1, 1e-6);
            assert_near(fabs(txm_quat_dot(txm_quat_nlerp(a, b, (float)k), k ? b : a)), 1, 1e-6);
        }
        assert_near(txm_quat_dot(txm_quat_slerp(a, b, t), txm_quat_slerp(a, b, t)), 1, 1e-6);
    }
    /* half turns, where w = 0 and three of Shepperd's four ways divide by zero */
    for (int k = 0; k < 3; k++) {
        const txm_vec3 axis = txm_v3(k == 0, k == 1, k == 2);
        const txm_quat half =
            txm_quat_from_mat3(txm_quat_mat3(txm_quat_axis_angle(axis, (float)TXM_PI)));
        assert_near(fabs((double)half.x * axis.x + half.y * axis.y + half.z * axis.z), 1, 1e-6);
    }
    const txm_quat zero = {0, 0, 0, 0};
    assert_true(txm_quat_normalize(zero).w == 1);
}

/* ---- colour ----------------------------------------------------------------------------- */

static void test_colour_known(void **state) {
    (void)state;
    assert_near(txm_srgb_to_linear(0.5f), 0.21404114, 1e-7);
    assert_near(txm_srgb_to_linear(0.02f), 0.00154799, 1e-8);
    assert_near(txm_linear_to_srgb(0.18f), 0.46135613, 1e-6);
    assert_near(txm_linear_to_srgb(0.001f), 0.01292, 1e-7);
    assert_true(txm_srgb_to_linear(0) == 0 && txm_srgb_to_linear(1) == 1);
    assert_true(txm_linear_to_srgb(0) == 0);
    assert_near(txm_linear_to_srgb(1), 1, 1e-7);

    /* L*a*b* of sRGB colours under D65, from B. Lindbloom's calculator; the Macbeth chart's
       "foil" value by its sRGB code */
    static const struct {
        txm_vec3 rgb, lab;
    } known[] = {{{1, 1, 1}, {100, 0, 0}},
                 {{0, 0, 0}, {0, 0, 0}},
                 {{1, 0, 0}, {53.2408f, 80.0925f, 67.2032f}},
                 {{0, 1, 0}, {87.7347f, -86.1827f, 83.1793f}},
                 {{0, 0, 1}, {32.2970f, 79.1875f, -107.8602f}},
                 {{0, 1, 1}, {91.1132f, -48.0875f, -14.1312f}},
                 {{1, 0, 1}, {60.3242f, 98.2343f, -60.8249f}},
                 {{1, 1, 0}, {97.1393f, -21.5537f, 94.4780f}},
                 {{0.5f, 0.5f, 0.5f}, {53.3890f, 0, 0}}};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
        const txm_vec3 linear = txm_srgb_to_linear3(known[i].rgb);
        assert_vec3(txm_rgb_to_lab(linear), known[i].lab, 2e-3);
        assert_vec3(txm_linear_to_srgb3(txm_lab_to_rgb(known[i].lab)), known[i].rgb, 1e-4);
    }
    assert_vec3(txm_rgb_to_xyz(txm_v3(1, 1, 1)), txm_v3(0.95047f, 1, 1.08883f), 1e-6);
    assert_vec3(txm_rgb_to_hsv(txm_v3(0.25f, 0.5f, 0.125f)), txm_v3(5 / 18.0f, 0.75f, 0.5f), 1e-6);
    assert_vec3(txm_rgb_to_hsv(txm_v3(1, 0, 1)), txm_v3(5 / 6.0f, 1, 1), 1e-6);
    assert_vec3(txm_rgb_to_hsv(txm_v3(0.3f, 0.3f, 0.3f)), txm_v3(0, 0, 0.3f), 1e-7);
    assert_vec3(txm_rgb_to_hsv(txm_v3(0, 0, 0)), txm_v3(0, 0, 0), 0);
    assert_true(txm_rgb_to_hsv(txm_v3(1, 0, 1e-9f)).x < 1);
    assert_vec3(txm_hsv_to_rgb(txm_v3(-1 / 3.0f, 1, 1)), txm_v3(0, 0, 1), 1e-5);
    assert_vec3(txm_rgb_to_opponent(txm_v3(1, 0, 0)), txm_v3(1 / 3.0f, 0.5f, -0.25f), 1e-7);
    assert_vec3(txm_rgb_to_opponent(txm_v3(0, 1, 0)), txm_v3(1 / 3.0f, 0, 0.5f), 1e-7);
}

static void test_colour_back(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(13, 0);
    for (int i = 0; i < 20000; i++) {
        const txm_vec3 half = txm_v3(0.5f, 0.5f, 0.5f);
        const txm_vec3 c = txm_vec3_add(random_vec3(&rng, 0.5f), half);
        const txm_vec3 lab = txm_rgb_to_lab(txm_srgb_to_linear3(c)), hsv = txm_rgb_to_hsv(c);
        const txm_vec3 opponent = txm_rgb_to_opponent(c);
        assert_vec3(txm_linear_to_srgb3(txm_srgb_to_linear3(c)), c, 1e-6);
        assert_vec3(txm_xyz_to_rgb(txm_rgb_to_xyz(c)), c, 1e-6);
        assert_vec3(txm_linear_to_srgb3(txm_lab_to_rgb(lab)), c, 1e-4);
        assert_vec3(txm_hsv_to_rgb(hsv), c, 1e-6);
        assert_vec3(txm_opponent_to_rgb(opponent), c, 1e-6);
        assert_true(lab.x >= 0 && lab.x <= 100.01f && lab.y > -86.3f && lab.y < 98.4f);
        assert_true(lab.z > -108 && lab.z < 94.6f);
        assert_true(hsv.x >= 0 && hsv.x < 1 && hsv.y >= 0 && hsv.y <= 1);
        assert_true(fabsf(opponent.y) <= 0.5f && fabsf(opponent.z) <= 0.5f);
    }
    for (int v = 0; v < 256; v++) { /* every code value survives linear light */
        const float s = (float)v / 255.0f;
        assert_int_equal((int)(txm_linear_to_srgb(txm_srgb_to_linear(s)) * 255 + 0.5f), v);
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
        cmocka_unit_test(test_matrix_inverse),
        cmocka_unit_test(test_transforms),
        cmocka_unit_test(test_quaternions),
        cmocka_unit_test(test_colour_known),
        cmocka_unit_test(test_colour_back),
        cmocka_unit_test(test_eigen),
    };
    return cmocka_run_group_tests_name("texmath vectors", tests, NULL, NULL);
}
