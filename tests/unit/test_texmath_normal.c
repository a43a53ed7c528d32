/* test_texmath_normal.c - normal maps: samples and vectors, and which pictures look like one
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texmath_normal && build/tests/unit/test_texmath_normal */
#include "mathkit.h"

enum { SIDE = 40 };
static union {
    uint8_t bytes[SIDE * SIDE * 4];
    uint16_t words[SIDE * SIDE * 4];
    float floats[SIDE * SIDE * 4];
} memory;
static const txm_sample samples[3] = {TXM_U8, TXM_U16, TXM_F32};

/* Every sample comes back, and with the opposite sign as far from the middle on the other side. */
static void test_round_trip(void **state) {
    (void)state;
    for (int kind = 0; kind < 2; kind++) {
        const int most = kind ? 65535 : 255, zero = kind ? 32768 : 128;
        const txm_image m = view(&memory, 1, 1, 1, samples[kind]);
        for (int s = 0; s <= most; s++) {
            for (int sign = -1; sign <= 1; sign += 2) {
                if (kind) memory.words[0] = (uint16_t)s;
                else memory.bytes[0] = (uint8_t)s;
                const double n = txm_normal_decode((double)txm_image_get(&m, 0, 0, 0), m.sample);
                assert_true(n >= -1 && n <= 1.0000001);
                txm_image_set(&m, 0, 0, 0, txm_float(txm_normal_encode(sign * n, m.sample)));
                const int back = kind ? memory.words[0] : memory.bytes[0];
                const int want = zero + sign * ((s ? s : 1) - zero);
                assert_int_equal(back, want);
            }
        }
    }
    assert_near(txm_normal_decode(0.5, TXM_F32), 0, 0);
    assert_near(txm_normal_encode(0, TXM_F32), 0.5, 0);
    assert_near(txm_normal_decode(txm_normal_encode(0.3, TXM_F32), TXM_F32), 0.3, 1e-15);
    assert_near(txm_normal_decode(1, TXM_U8), 1, 1e-15);
    assert_near(txm_normal_decode(1, TXM_U16), 1, 1e-15);
}

/* Flat stays exactly flat however it is turned; a quarter turn moves x to y and back. */
static void test_turn(void **state) {
    (void)state;
    for (int kind = 0; kind < 3; kind++) {
        const txm_image m = view(&memory, 1, 1, 3, samples[kind]);
        txm_rng rng = txm_rng_make(3, 1);
        for (int k = 0; k < 200; k++) {
            const double a = (double)random_float(&rng, 0.1f, 2), b = (double)random_float(&rng, -2, 2);
            const double mirror = k % 2 ? 1 : -1, axes[4] = {a, b, -b * mirror, a * mirror};
            for (int c = 0; c < 3; c++)
                txm_image_set(&m, 0, 0, c, txm_float(txm_normal_encode(c == 2, m.sample)));
            float v[3], back[3];
            for (int c = 0; c < 3; c++) v[c] = back[c] = txm_image_get(&m, 0, 0, c);
            txm_normal_turn(axes, k % 3 == 0, m.sample, v);
            for (int c = 0; c < 3; c++) {
                txm_image_set(&m, 0, 0, c, v[c]);
                assert_true(txm_image_get(&m, 0, 0, c) == back[c]);
            }
        }
        const double quarter[4] = {0, 1, -1, 0};
        float v[3];
        for (int c = 0; c < 3; c++)
            v[c] = txm_float(txm_normal_encode(c == 0 ? 0.6 : c == 2 ? 0.8 : 0, m.sample));
        txm_normal_turn(quarter, 1, m.sample, v); /* right is the new up */
        assert_near(txm_normal_decode((double)v[0], m.sample), 0, 1e-6);
        assert_near(txm_normal_decode((double)v[1], m.sample), -0.6, 1e-6);
        assert_near(txm_normal_decode((double)v[2], m.sample), 0.8, 1e-6);
    }
}

/* Bumps look like a normal map in every form; noise, grays, and normals that lie on their side do not. */
static void test_looks(void **state) {
    (void)state;
    for (int kind = 0; kind < 3; kind++) {
        for (int channels = 1; channels <= 4; channels++) {
            for (int what = 0; what < 4; what++) {
                const txm_image m = view(&memory, SIDE, SIDE, channels, samples[kind]);
                txm_rng rng = txm_rng_make((uint64_t)what, 5);
                for (int i = 0; i < SIDE * SIDE; i++) {
                    const int x = i % SIDE, y = i / SIDE;
                    const double u = 0.5 * sin(x * 0.4), v = 0.4 * sin(y * 0.3);
                    const double z = sqrt(1 - u * u - v * v);
                    const double bumps[4] = {u, v, z, 1}, aside[4] = {z, u, v, 1};
                    const double gray = (double)random_float(&rng, -1, 1);
                    for (int c = 0; c < channels; c++) {
                        const double n = what == 0   ? bumps[c]
                                         : what == 1 ? (double)random_float(&rng, -1, 1)
                                         : what == 2 ? gray
                                                     : aside[c];
                        txm_image_set(&m, x, y, c, txm_float(txm_normal_encode(n, m.sample)));
                    }
                }
                assert_int_equal(txm_image_is_normals(&m), channels >= 3 && what == 0);
            }
        }
    }
    /* transparent pixels are not looked at, and nothing is no normal map */
    const txm_image m = view(&memory, SIDE, SIDE, 4, TXM_U8);
    memset(&memory, 0, sizeof memory);
    assert_int_equal(txm_image_is_normals(&m), 0);
    memcpy(memory.bytes + 4 * (SIDE * 20 + 20), "\x80\x80\xff\xff", 4);
    assert_int_equal(txm_image_is_normals(&m), 1);
    const txm_image one = view(memory.bytes + 4 * (SIDE * 20 + 20), 1, 1, 3, TXM_U8);
    assert_int_equal(txm_image_is_normals(&one), 1);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_round_trip), cmocka_unit_test(test_turn),
                                       cmocka_unit_test(test_looks)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
