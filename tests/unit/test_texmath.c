/* test_texmath.c - statuses, sizes, memory, numbers, random numbers, sorting
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texmath && build/tests/unit/test_texmath */
#include "mathkit.h"

/* ---- status, environment, sizes ---------------------------------------------------------- */

static void test_status_text(void **state) {
    (void)state;
    for (int i = TXM_OK; i <= TXM_BAD_DATA; i++) {
        const char *text = txm_status_text((txm_status)i);
        assert_true(text[0] != 0);
        assert_string_not_equal(text, "unknown status");
        for (int k = 0; k < i; k++) assert_string_not_equal(text, txm_status_text((txm_status)k));
    }
}

static void test_fail(void **state) {
    (void)state;
    txm_env env;
    char huge[400];
    memset(&env, 0, sizeof env);
    memset(huge, 'x', sizeof huge);
    huge[sizeof huge - 1] = 0;
    assert_int_equal(txm_fail(NULL, TXM_BAD_DATA, "nobody listens"), TXM_BAD_DATA);
    assert_int_equal(txm_fail(&env, TXM_TOO_SMALL, "short"), TXM_TOO_SMALL);
    assert_string_equal(env.message, "short");
    assert_int_equal(txm_fail_at(&env, TXM_TOO_LARGE, "mask", "is big"), TXM_TOO_LARGE);
    assert_string_equal(env.message, "mask: is big");
    txm_fail(&env, TXM_TOO_LARGE, huge);
    assert_int_equal(strlen(env.message), sizeof env.message - 1);
    txm_fail_at(&env, TXM_TOO_LARGE, huge, huge);
    assert_int_equal(strlen(env.message), sizeof env.message - 1);
    assert_int_equal(txm_fail_at(NULL, TXM_TOO_LARGE, huge, huge), TXM_TOO_LARGE);
}

static void test_fail_numbers(void **state) {
    (void)state;
    static const struct {
        const char *text, *line;
        uint64_t a, b;
    } cases[] = {
        {"no number", "no number", 1, 2},
        {"# first", "0 first", 0, 2},
        {"last #", "last 10", 10, 2},
        {"faces # and #", "faces 7 and 1234567", 7, 1234567},
        {"#, #, #", "1, 0, 0", 1, 0},
        {"##", "1844674407370955161518446744073709551614", UINT64_MAX, UINT64_MAX - 1},
    };
    txm_env env;
    char huge[400], line[sizeof env.message + 8];
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        memset(&env, 0, sizeof env);
        assert_int_equal(
            txm_fail_numbers(&env, TXM_TOO_LARGE, cases[i].text, cases[i].a, cases[i].b),
            TXM_TOO_LARGE);
        assert_string_equal(env.message, cases[i].line);
        assert_int_equal(txm_fail_numbers_at(&env, TXM_BAD_DATA, "a #", cases[i].text, cases[i].a,
                                             cases[i].b), TXM_BAD_DATA);
        snprintf(line, sizeof line, "a #: %s", cases[i].line); /* a name is taken as it is */
        assert_string_equal(env.message, line);
        assert_int_equal(txm_fail_numbers(NULL, TXM_TOO_SMALL, cases[i].text, 1, 2), TXM_TOO_SMALL);
    }
    memset(huge, '#', sizeof huge); /* numbers are cut as text is */
    huge[sizeof huge - 1] = 0;
    txm_fail_numbers(&env, TXM_BAD_DATA, huge, 123, 456);
    assert_int_equal(strlen(env.message), sizeof env.message - 1);
    assert_memory_equal(env.message, "123456456456", 12);
}

static void test_sizes(void **state) {
    (void)state;
    static const size_t values[] = {0,
                                    1,
                                    2,
                                    3,
                                    255,
                                    65535,
                                    65536,
                                    SIZE_MAX / 3,
                                    SIZE_MAX / 2,
                                    SIZE_MAX / 2 + 1,
                                    SIZE_MAX - 1,
                                    SIZE_MAX};
    enum { N = sizeof values / sizeof *values };
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            const size_t a = values[i], b = values[j];
            size_t out = 77;
            if (txm_add(a, b, &out)) assert_true(out >= a && out - a == b);
            else assert_true(out == 77 && a + b < a);
            for (int k = 0; k < N; k++) {
                const size_t c = values[k];
                const int zero = a == 0 || b == 0 || c == 0;
                out = 77;
                if (txm_mul(a, b, c, &out)) {
                    if (zero) assert_true(out == 0 || (a && b && c == 0));
                    else assert_true(out / c / b == a && out % c == 0 && out / c % b == 0);
                } else {
                    assert_true(out == 77 && a && b);
                    assert_true(b > SIZE_MAX / a || c > SIZE_MAX / a / b);
                }
            }
        }
    }
}

static void count_index(void *context, int index) {
    ((int *)context)[index]++;
}

static void test_parallel_for(void **state) {
    (void)state;
    int threads = 3;
    txm_env envs[4];
    memset(envs, 0, sizeof envs);
    envs[1].parallel_for = tk_parallel_reverse;
    envs[2].parallel_for = tk_parallel_threads;
    envs[3].parallel_for = tk_parallel_threads;
    envs[3].parallel_user = &threads;
    for (int e = -1; e < 4; e++) {
        for (int count = 0; count < 40; count += 13) {
            int seen[40] = {0};
            txm_parallel_for(e < 0 ? NULL : &envs[e], count, count_index, seen);
            for (int i = 0; i < 40; i++) assert_int_equal(seen[i], i < count);
        }
    }
}

static void test_allocation(void **state) {
    (void)state;
    tk_memory memory;
    memset(&memory, 0, sizeof memory);
    txm_env env = tk_env(&memory, NULL);
    assert_null(txm_alloc(&env, 0));
    txm_free(&env, NULL);
    assert_int_equal(memory.calls, 0);
    void *block = txm_alloc(&env, 10);
    assert_non_null(block);
    assert_int_equal(memory.blocks, 1);
    txm_free(&env, block);
    assert_int_equal(tk_leaks(&memory), 0);
    block = txm_alloc(NULL, 10);
    assert_non_null(block);
    txm_free(NULL, block);
}

/* ---- arena ------------------------------------------------------------------------------ */

static void test_arena(void **state) {
    (void)state;
    tk_memory memory;
    memset(&memory, 0, sizeof memory);
    txm_env env = tk_env(&memory, NULL);
    txm_arena arena;
    volatile size_t huge = SIZE_MAX; /* the compiler must not warn of what we test */
    for (int round = 0; round < 3; round++) {
        const txm_env *from = round == 2 ? NULL : &env; /* round 2: malloc */
        txm_arena_init(&arena, from);
        for (size_t n = 1; n < 300; n += 7) {
            unsigned char *block = (unsigned char *)txm_arena_alloc(&arena, n, 3);
            assert_non_null(block);
            assert_int_equal((uintptr_t)block % 64, 0);
            memset(block, 0xff, 3 * n);
            block = (unsigned char *)txm_arena_zero(&arena, 1, n);
            assert_non_null(block);
            assert_int_equal((uintptr_t)block % 64, 0);
            for (size_t i = 0; i < n; i++) assert_int_equal(block[i], 0);
            memset(block, 0xff, n);
        }
        const long calls = memory.calls;
        assert_null(txm_arena_alloc(&arena, 0, 8));
        assert_null(txm_arena_alloc(&arena, 8, 0));
        assert_null(txm_arena_zero(&arena, 0, 0));
        assert_null(txm_arena_alloc(&arena, huge, 2));
        assert_null(txm_arena_alloc(&arena, huge / 2 + 1, 2));
        assert_null(txm_arena_alloc(&arena, huge - 70, 1));
        assert_null(txm_arena_zero(&arena, huge - 8, 1));
        assert_int_equal(memory.calls, calls); /* refused before anybody was asked */
        txm_arena_free(&arena);
        assert_null(arena.blocks);
        txm_arena_free(&arena); /* a second time does nothing */
        assert_int_equal(tk_leaks(&memory), 0);
        assert_non_null(txm_arena_alloc(&arena, 5, 5)); /* and it may be used again */
        txm_arena_free(&arena);
        assert_int_equal(tk_leaks(&memory), 0);
    }
}

static void test_arena_inside_itself(void **state) {
    (void)state;
    tk_memory memory;
    memset(&memory, 0, sizeof memory);
    txm_env env = tk_env(&memory, NULL);
    txm_arena arena, *inside;
    txm_arena_init(&arena, &env);
    inside = (txm_arena *)txm_arena_alloc(&arena, 1, sizeof arena);
    txm_arena_alloc(&arena, 100, 1);
    memset(&env, 0, sizeof env); /* the env need not outlive the arena */
    *inside = arena;
    assert_non_null(txm_arena_alloc(inside, 100, 1));
    txm_arena_free(inside);
    assert_int_equal(memory.calls, 3);
    assert_int_equal(tk_leaks(&memory), 0);
}

static void test_arena_failing(void **state) {
    (void)state;
    for (int onward = 0; onward < 2; onward++) {
        for (long k = 1; k <= 9; k++) {
            tk_memory memory;
            memset(&memory, 0, sizeof memory);
            memory.fail_at = k;
            memory.fail_onward = onward;
            txm_env env = tk_env(&memory, NULL);
            txm_arena arena;
            txm_arena_init(&arena, &env);
            for (long i = 1; i <= 8; i++) {
                void *block =
                    i % 2 ? txm_arena_alloc(&arena, 10, 10) : txm_arena_zero(&arena, 9, 9);
                assert_int_equal(block == NULL, i == k || (onward && i > k));
                assert_int_equal(arena.failed != 0, i >= k); /* and later successes leave it */
            }
            txm_arena_free(&arena);
            assert_int_equal(arena.failed, 0);
            assert_int_equal(tk_leaks(&memory), 0);
        }
    }
}

static void test_arena_failed(void **state) {
    (void)state;
    tk_memory memory;
    memset(&memory, 0, sizeof memory);
    txm_env env = tk_env(&memory, NULL);
    txm_arena arena;
    volatile size_t huge = SIZE_MAX;
    memset(&arena, 0xff, sizeof arena);
    txm_arena_init(&arena, &env);
    assert_int_equal(arena.failed, 0);
    txm_arena_alloc(&arena, 0, 8); /* nothing was asked for: no failure */
    txm_arena_alloc(&arena, 8, 0);
    txm_arena_zero(&arena, 0, huge);
    assert_int_equal(arena.failed, 0);
    txm_arena_alloc(&arena, huge / 2 + 1, 2);
    assert_int_equal(arena.failed, 1);
    txm_arena_free(&arena);
    assert_int_equal(arena.failed, 0);
    txm_arena_zero(&arena, huge - 8, 1);
    assert_int_equal(arena.failed, 1);
    txm_arena_init(&arena, &env);
    assert_int_equal(arena.failed, 0);
    assert_int_equal(memory.calls, 0);
}

/* ---- numbers ---------------------------------------------------------------------------- */

static void test_sincos(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(5, 5);
    for (int i = -4000; i <= 4000; i++) {
        const double angle = i % 8 ? (txm_rng_double(&rng) - 0.5) * 4000 : i * (TXM_PI / 32);
        double s = 7, c = 7;
        txm_sincos(angle, &s, &c);
        assert_near(s, sin(angle), 1e-10);
        assert_near(c, cos(angle), 1e-10);
        assert_near(s * s + c * c, 1, 1e-10);
    }
    double s, c;
    txm_sincos(0, &s, &c);
    assert_true(s == 0 && c == 1);
}

static void test_atan2(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(9, 9);
    for (int i = 0; i < 4000; i++) {
        const double flat = i % 3 ? 1 : 1e-9, steep = i % 5 ? 1 : 1e-6;
        const double y = (txm_rng_double(&rng) - 0.5) * flat, x = (txm_rng_double(&rng) - 0.5) * steep;
        assert_near(txm_atan2(y, x), atan2(y, x), 1e-14);
        assert_near(txm_atan2(1e200 * y, 1e200 * x), atan2(y, x), 1e-14);
    }
    assert_near(txm_atan2(0, -1), TXM_PI, 1e-15);
    assert_near(txm_atan2(1, 0), TXM_PI / 2, 1e-15);
    assert_near(txm_atan2(-1, 0), -TXM_PI / 2, 1e-15);
    assert_true(txm_atan2(0, 0) == 0 && txm_atan2(0, 3) == 0);
    assert_true(txm_cos(0) == 1);
}

static void test_exp2(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(6, 6);
    for (int i = -1000; i <= 1000; i++) {
        const double x = txm_rng_double(&rng) * 2000 - 1000;
        assert_true(txm_exp2(i) == ldexp(1, i)); /* whole powers have no error */
        assert_near(txm_exp2(x) / pow(2, x), 1, 1e-11);
    }
}

static void test_log2(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(7, 7);
    for (int i = -1000; i <= 1000; i++) {
        const double x = txm_rng_double(&rng) + 1e-9, y = txm_rng_double(&rng) * 4;
        assert_true(txm_log2(ldexp(1, i)) == i);
        assert_near(txm_log2(ldexp(x, i)), log2(x) + i, 1e-11);
        assert_near(txm_pow(x, y) / pow(x, y), 1, 1e-10);
    }
    assert_true(txm_pow(0, 2.4) == 0);
}

static void test_lowest_bit(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(7, 7);
    for (int i = 0; i < 64; i++) {
        assert_int_equal(txm_lowest_bit((uint64_t)1 << i), i);
        const uint64_t above = (uint64_t)txm_rng_next(&rng) << 32 | txm_rng_next(&rng);
        assert_int_equal(txm_lowest_bit((above | 1) << i), i);
    }
}

static void test_numbers(void **state) {
    (void)state;
    assert_true(txm_is_finite(0) && txm_is_finite(-1e300) && txm_is_finite(1e-310));
    assert_false(txm_is_finite(INFINITY) || txm_is_finite(-INFINITY) || txm_is_finite(NAN));
    assert_true(txm_clampf(NAN, 2, 3) == 2 && txm_clampf(5, 2, 3) == 3 && txm_clampf(1, 2, 3) == 2);
    assert_true(txm_clampi(-5, 0, 9) == 0 && txm_clampi(10, 0, 9) == 9 && txm_clampi(4, 0, 9) == 4);
    assert_true(txm_minf(1, 2) == 1 && txm_maxf(1, 2) == 2);
    /* neighbours that are rounded and widened again: gcc 12 forgets to round plain casts */
    volatile double input[4] = {0.1, 0.2, 0.3, 0.4};
    double wide[4], round[4];
    for (int i = 0; i < 4; i++) wide[i] = input[i];
    round[0] = txm_float(wide[0]), round[1] = txm_float(wide[1]);
    round[2] = txm_float(wide[2]), round[3] = txm_float(wide[3]);
    for (int i = 0; i < 4; i++) assert_true(round[i] != wide[i]);
    txm_rng rng = txm_rng_make(1, 1);
    for (int i = 0; i < 100000; i++) {
        const float a = random_float(&rng, -1e6f, 1e6f), b = random_float(&rng, -1, 1);
        const float t = txm_rng_float(&rng);
        assert_true(txm_lerpf(a, b, 0) == a && txm_lerpf(a, b, 1) == b && txm_lerpf(a, a, t) == a);
        assert_near(txm_lerpf(a, b, t), a * (1.0 - t) + (double)b * t, 0.1);
    }
}

/* ---- random numbers --------------------------------------------------------------------- */

static void test_rng_known(void **state) {
    (void)state;
    /* computed apart from this code, with big integers */
    static const uint32_t stream[8] = {0x718bd88du, 0x0be6ee3au, 0xb874c76bu, 0x239ea061u,
                                       0xa1919358u, 0x5a22109cu, 0xb4d7d544u, 0xc9e682dcu};
    txm_rng rng = txm_rng_make(1, 2);
    for (int i = 0; i < 8; i++) assert_int_equal(txm_rng_next(&rng), stream[i]);
    assert_true(txm_hash(1) == 0x5692161d100b05e5u && txm_hash(0) == 0);
    assert_true(txm_rng_make(1, 2).state != txm_rng_make(2, 1).state);
}

static void test_rng_ranges(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(11, 0);
    int bins[16] = {0}, die[7] = {0};
    double sum = 0, squares = 0;
    enum { N = 160000 };
    for (int i = 0; i < N; i++) {
        const float f = txm_rng_float(&rng);
        const double d = txm_rng_double(&rng);
        const int r = txm_rng_range(&rng, -3, 3);
        assert_true(f >= 0 && f < 1 && d >= 0 && d < 1 && r >= -3 && r <= 3);
        assert_true(f * 16777216.0f == floorf(f * 16777216.0f));
        bins[(int)(f * 16)]++;
        die[r + 3]++;
        sum += d;
        squares += d * d;
        assert_int_equal(txm_rng_range(&rng, 5, 5), 5);
        txm_rng_range(&rng, INT_MIN, INT_MAX);
        assert_true(txm_rng_range(&rng, INT_MIN, INT_MIN + 1) <= INT_MIN + 1);
    }
    for (int i = 0; i < 16; i++) assert_near(bins[i], N / 16.0, 5 * sqrt(N / 16.0));
    for (int i = 0; i < 7; i++) assert_near(die[i], N / 7.0, 5 * sqrt(N / 7.0));
    assert_near(sum / N, 0.5, 5 * sqrt(1.0 / 12 / N));
    assert_near(squares / N, 1 / 3.0, 5 * sqrt(4.0 / 45 / N));
    /* the ends: all bits set is still below 1 */
    assert_true((float)(UINT32_MAX >> 8) * (1.0f / 16777216.0f) < 1.0f);
}

static void test_shuffle(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(3, 0);
    int count[24] = {0};
    enum { N = 48000 };
    for (int i = 0; i < N; i++) { /* all 24 orders of four items, equally often */
        int items[4] = {0, 1, 2, 3}, seen = 0, code = 0;
        txm_shuffle(&rng, items, 4);
        for (int k = 0; k < 4; k++) {
            int smaller = 0;
            seen |= 1 << items[k];
            for (int j = k + 1; j < 4; j++) smaller += items[j] < items[k];
            code = code * (4 - k) + smaller;
        }
        assert_int_equal(seen, 15);
        count[code]++;
    }
    for (int i = 0; i < 24; i++) assert_near(count[i], N / 24.0, 5 * sqrt(N / 24.0));
    int one = 9;
    txm_shuffle(&rng, &one, 1);
    txm_shuffle(&rng, NULL, 0);
    assert_int_equal(one, 9);
}

/* ---- sorting ---------------------------------------------------------------------------- */

static void test_sort(void **state) {
    (void)state;
    enum { MOST = 300 };
    static txm_pair pairs[MOST], expected[MOST], scratch[MOST];
    static const uint32_t masks[] = {0, 1, 0xff, 0xff00, 0xff00ff, 0xf0f0f0f0u, 0xffffffffu};
    txm_rng rng = txm_rng_make(5, 0);
    for (int round = 0; round < 700; round++) {
        const size_t n = round < 8 ? (size_t)round : txm_rng_below(&rng, MOST + 1);
        const uint32_t mask = masks[round % 7];
        for (size_t i = 0; i < n; i++) {
            txm_pair p;
            p.key = txm_rng_next(&rng) & mask;
            p.value = (uint32_t)i;
            pairs[i] = p;
            size_t k = i; /* insertion sort, stable */
            for (; k > 0 && expected[k - 1].key > p.key; k--) expected[k] = expected[k - 1];
            expected[k] = p;
        }
        txm_sort_pairs(pairs, scratch, n);
        for (size_t i = 0; i < n; i++) {
            assert_int_equal(pairs[i].key, expected[i].key);
            assert_int_equal(pairs[i].value, expected[i].value);
        }
    }
    static const float rising[] = {-INFINITY, -1e30f, -2, -1.5f, -1e-40f, -0.0f,
                                   0.0f,      1e-40f, 1,  2,     1e30f,   INFINITY};
    for (size_t i = 1; i < sizeof rising / sizeof *rising; i++)
        assert_true(txm_sort_key(rising[i - 1]) < txm_sort_key(rising[i]));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_status_text),
        cmocka_unit_test(test_fail),
        cmocka_unit_test(test_fail_numbers),
        cmocka_unit_test(test_sizes),
        cmocka_unit_test(test_parallel_for),
        cmocka_unit_test(test_allocation),
        cmocka_unit_test(test_arena),
        cmocka_unit_test(test_arena_inside_itself),
        cmocka_unit_test(test_arena_failing),
        cmocka_unit_test(test_arena_failed),
        cmocka_unit_test(test_sincos), cmocka_unit_test(test_atan2),
        cmocka_unit_test(test_exp2),
        cmocka_unit_test(test_log2),
        cmocka_unit_test(test_lowest_bit),
        cmocka_unit_test(test_numbers),
        cmocka_unit_test(test_rng_known),
        cmocka_unit_test(test_rng_ranges),
        cmocka_unit_test(test_shuffle),
        cmocka_unit_test(test_sort),
    };
    return cmocka_run_group_tests_name("texmath", tests, NULL, NULL);
}
