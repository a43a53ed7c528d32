/* test_texmath.c - the common ground: known answers, properties, bad input, failing memory
   SPDX-License-Identifier: MIT OR Unlicense

   cc -std=c99 -I. -Itests tests/test_texmath.c -lcmocka -lpthread -lm                        */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "testkit.h"

/* ---- helpers ---------------------------------------------------------------------------- */

static void assert_near(double a, double b, double tolerance) {
    if (!(fabs(a - b) <= tolerance)) fail_msg("%.9g is not %.9g within %g", a, b, tolerance);
}

static float random_float(txm_rng *rng, float low, float high) {
    return txm_lerpf(low, high, txm_rng_float(rng));
}

static txm_vec3 random_vec3(txm_rng *rng, float size) {
    const float x = random_float(rng, -size, size), y = random_float(rng, -size, size);
    return txm_v3(x, y, random_float(rng, -size, size));
}

static txm_quat random_quat(txm_rng *rng) {
    txm_quat q;
    do {
        q.x = random_float(rng, -1, 1);
        q.y = random_float(rng, -1, 1);
        q.z = random_float(rng, -1, 1);
        q.w = random_float(rng, -1, 1);
    } while (txm_quat_dot(q, q) < 0.01);
    return txm_quat_normalize(q);
}

static void assert_vec3(txm_vec3 a, txm_vec3 b, double tolerance) {
    assert_near(a.x, b.x, tolerance);
    assert_near(a.y, b.y, tolerance);
    assert_near(a.z, b.z, tolerance);
}

static void assert_floats(const float *a, const float *b, int count, double tolerance) {
    for (int i = 0; i < count; i++) assert_near(a[i], b[i], tolerance);
}

static txm_image view(void *pixels, int width, int height, int channels, txm_sample sample) {
    txm_image im;
    memset(&im, 0, sizeof im);
    im.pixels = pixels;
    im.width = width;
    im.height = height;
    im.channels = channels;
    im.sample = sample;
    return im;
}

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

static void test_exp2(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(6, 6);
    for (int i = -1000; i <= 1000; i++) {
        const double x = txm_rng_double(&rng) * 2000 - 1000;
        assert_true(txm_exp2(i) == ldexp(1, i)); /* whole powers have no error */
        assert_near(txm_exp2(x) / pow(2, x), 1, 1e-11);
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

/* ---- images ----------------------------------------------------------------------------- */

static void assert_refused(txm_image im, size_t most, txm_status status, const char *word) {
    txm_env env;
    memset(&env, 0, sizeof env);
    assert_int_equal(txm_image_check(&im, "picture", most, &env), status);
    assert_int_equal(txm_image_check(&im, "picture", most, NULL), status);
    assert_memory_equal(env.message, "picture: ", 9);
    if (!strstr(env.message, word)) fail_msg("no '%s' in '%s'", word, env.message);
    assert_true(strlen(env.message) < sizeof env.message - 1);
}

static void test_image_check(void **state) {
    (void)state;
    static float pixels[64];
    txm_env env;
    memset(&env, 0, sizeof env);
    txm_image good = view(pixels, 4, 4, 4, TXM_F32), im;
    assert_int_equal(txm_image_check(&good, "picture", 16, &env), TXM_OK);
    assert_int_equal(env.message[0], 0);
    assert_int_equal(txm_image_check(NULL, "picture", 0, &env), TXM_BAD_ARGUMENT);
    assert_non_null(strstr(env.message, "NULL"));

    for (int c = 0; c <= 4; c++) {
        im = good;
        im.channels = c;
        assert_int_equal(txm_image_check(&im, "picture", 0, NULL), TXM_OK);
    }
    im = good, im.pixels = NULL;
    assert_refused(im, 0, TXM_BAD_ARGUMENT, "pixels is NULL");
    im = good, im.width = 0;
    assert_refused(im, 0, TXM_BAD_ARGUMENT, "width");
    im = good, im.width = INT_MIN;
    assert_refused(im, 0, TXM_BAD_ARGUMENT, "width");
    im = good, im.height = 0;
    assert_refused(im, 0, TXM_BAD_ARGUMENT, "height");
    im = good, im.height = -1;
    assert_refused(im, 0, TXM_BAD_ARGUMENT, "height");
    im = good, im.channels = 5;
    assert_refused(im, 0, TXM_BAD_ARGUMENT, "channels");
    im = good, im.channels = -1;
    assert_refused(im, 0, TXM_BAD_ARGUMENT, "channels");
    im = good, im.sample = (txm_sample)3;
    assert_refused(im, 0, TXM_BAD_ARGUMENT, "sample");
    assert_refused(good, 15, TXM_TOO_LARGE, "too many pixels");
    im = good, im.stride = 63;
    assert_refused(im, 0, TXM_BAD_ARGUMENT, "stride is shorter");
    im = good, im.stride = -60;
    assert_refused(im, 0, TXM_BAD_ARGUMENT, "stride is shorter");
    im = good, im.stride = 66;
    assert_refused(im, 0, TXM_BAD_ARGUMENT, "multiples of 4");
    im = good, im.pixels = (char *)pixels + 2;
    assert_refused(im, 0, TXM_BAD_ARGUMENT, "multiples of 4");
    im = good, im.sample = TXM_U16, im.stride = 34, im.pixels = (char *)pixels + 2;
    assert_int_equal(txm_image_check(&im, "picture", 0, NULL), TXM_OK);
    im.stride = 31;
    assert_refused(im, 0, TXM_BAD_ARGUMENT, "stride is shorter");
    im.stride = 33;
    assert_refused(im, 0, TXM_BAD_ARGUMENT, "multiples of 2");
    im.stride = 0, im.pixels = (char *)pixels + 1;
    assert_refused(im, 0, TXM_BAD_ARGUMENT, "multiples of 2");
    im = good, im.stride = PTRDIFF_MAX - 3;
    assert_refused(im, 0, TXM_TOO_LARGE, "address space");
    im = good, im.stride = PTRDIFF_MIN;
    assert_refused(im, 0, TXM_TOO_LARGE, "address space");
    im = good, im.width = im.height = INT_MAX;
    assert_refused(im, 0, TXM_TOO_LARGE, "address space");
    assert_refused(im, 1u << 26, TXM_TOO_LARGE, "too many pixels");
    im = good, im.stride = -64, im.pixels = pixels + 48;
    assert_int_equal(txm_image_check(&im, "picture", 0, NULL), TXM_OK);
    im = view((char *)pixels + 1, 3, 3, 3, TXM_U8), im.stride = 11; /* bytes need no alignment */
    assert_int_equal(txm_image_check(&im, "picture", 0, NULL), TXM_OK);
}

static void test_image_samples(void **state) {
    (void)state;
    uint8_t bytes[64];
    uint16_t words[64];
    float floats[64];
    for (int flip = 0; flip < 2; flip++) {
        for (int f = 0; f < 3; f++) {
            txm_image im = f == TXM_F32   ? view(floats, 3, 4, 2, TXM_F32)
                           : f == TXM_U16 ? view(words, 3, 4, 2, TXM_U16)
                                          : view(bytes, 3, 4, 2, TXM_U8);
            char *const memory = (char *)im.pixels;
            const ptrdiff_t step = 8 * (ptrdiff_t)txm_sample_bytes(im.sample);
            im.stride = flip ? -step : step;
            if (flip) im.pixels = (char *)im.pixels + 3 * step;
            memset(bytes, 0, sizeof bytes);
            memset(words, 0, sizeof words);
            memset(floats, 0, sizeof floats);
            for (int y = 0; y < 4; y++) {
                for (int x = 0; x < 3; x++) {
                    for (int c = 0; c < 2; c++)
                        txm_image_set(&im, x, y, c, (float)(16 * y + 4 * x + c) / 255.0f);
                }
            }
            for (int y = 0; y < 4; y++) {
                const int line = flip ? 3 - y : y; /* where the row lies in memory */
                assert_ptr_equal(txm_image_row_const(&im, y), memory + line * step);
                for (int x = 0; x < 3; x++) {
                    for (int c = 0; c < 2; c++) {
                        const int value = 16 * y + 4 * x + c, i = 8 * line + 2 * x + c;
                        if (f == TXM_U8) assert_int_equal(bytes[i], value);
                        if (f == TXM_U16) assert_int_equal(words[i], 257 * value);
                        assert_near(txm_image_get(&im, x, y, c), value / 255.0, 1e-7);
                    }
                }
            }
        }
    }
    txm_image one = view(bytes, 1, 1, 0, TXM_U8), real = view(floats, 1, 1, 0, TXM_F32);
    txm_image deep = view(words, 1, 1, 0, TXM_U16);
    for (int v = 0; v < 256; v++) { /* there and back for each value; rounding at the half */
        bytes[0] = (uint8_t)v;
        const float value = txm_image_get(&one, 0, 0, 0);
        txm_image_set(&one, 0, 0, 0, value);
        assert_int_equal(bytes[0], v);
        txm_image_set(&one, 0, 0, 0, ((float)v + 0.49f) / 255.0f);
        assert_int_equal(bytes[0], v);
        txm_image_set(&one, 0, 0, 0, ((float)v - 0.49f) / 255.0f);
        assert_int_equal(bytes[0], v);
    }
    words[1] = 77;
    for (int v = 0; v < 65536; v++) {
        words[0] = (uint16_t)v;
        const float value = txm_image_get(&deep, 0, 0, 0);
        txm_image_set(&deep, 0, 0, 0, value);
        assert_int_equal(words[0], v);
        for (int k = -1; k <= 1; k += 2) {
            txm_image_set(&deep, 0, 0, 0, (float)((v + k * 0.49) / 65535));
            assert_int_equal(words[0], v);
        }
        bytes[0] = (uint8_t)(v / 257); /* 8 bits made wider have the very same value */
        if (v % 257 == 0) assert_true(txm_image_get(&one, 0, 0, 0) == value);
    }
    txm_image_set(&deep, 0, 0, 0, -7), assert_int_equal(words[0], 0);
    txm_image_set(&deep, 0, 0, 0, 7), assert_int_equal(words[0], 65535);
    txm_image_set(&deep, 0, 0, 0, -INFINITY), assert_int_equal(words[0], 0);
    txm_image_set(&deep, 0, 0, 0, NAN), assert_int_equal(words[0], 0);
    assert_int_equal(words[1], 77); /* its neighbour was left alone */
    txm_image_set(&one, 0, 0, 0, -7), assert_int_equal(bytes[0], 0);
    txm_image_set(&one, 0, 0, 0, 7), assert_int_equal(bytes[0], 255);
    txm_image_set(&one, 0, 0, 0, INFINITY), assert_int_equal(bytes[0], 255);
    txm_image_set(&one, 0, 0, 0, NAN), assert_int_equal(bytes[0], 0);
    txm_image_set(&real, 0, 0, 0, -7), assert_true(floats[0] == -7.0f);
}

static void test_image_finite(void **state) {
    (void)state;
    static float floats[48];
    static const float bad[3] = {INFINITY, -INFINITY, NAN};
    txm_image im = view(floats, 3, 4, 3, TXM_F32);
    im.stride = 12 * (ptrdiff_t)sizeof(float); /* three floats of padding a row, not looked at */
    for (int i = 0; i < 48; i++) {
        for (int k = 0; k < 3; k++) {
            floats[i] = bad[k];
            assert_int_equal(txm_image_is_finite(&im), i % 12 >= 9);
        }
        floats[i] = 0;
    }
    assert_true(txm_image_is_finite(&im));
    memset(floats, 0xff, sizeof floats);
    im = view(floats, 3, 4, 3, TXM_U8);
    assert_true(txm_image_is_finite(&im));
    im = view(floats, 3, 4, 3, TXM_U16);
    assert_true(txm_image_is_finite(&im));
    im = txm_image_resolve(view(floats, 3, 4, 0, TXM_F32));
    assert_int_equal(im.channels, 1);
    assert_int_equal(im.stride, 12);
    im = txm_image_resolve(view(floats, 3, 4, 2, TXM_U16));
    assert_int_equal(im.stride, 12);
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

/* ---- cut -------------------------------------------------------------------------------- */

/* The cheapest sum over all paths from line i, column j on. */
static double brute_cut(const float *error, int length, int width, int i, int j) {
    double best = INFINITY;
    if (i == length - 1) return error[i * width + j];
    for (int k = j - 1; k <= j + 1; k++) {
        if (k >= 0 && k < width) best = fmin(best, brute_cut(error, length, width, i + 1, k));
    }
    return error[i * width + j] + best;
}

static void test_cut(void **state) {
    (void)state;
    enum { L = 7, W = 5 };
    txm_rng rng = txm_rng_make(15, 0);
    for (int round = 0; round < 1500; round++) {
        const int length = txm_rng_range(&rng, 1, L), width = txm_rng_range(&rng, 1, W);
        float error[L * W], turned[L * W];
        double scratch[L * W], best = INFINITY, sum = 0, sum_turned;
        int path[L], other[L];
        for (int i = 0; i < length; i++) {
            for (int j = 0; j < width; j++) {
                /* integers, so that sums are exact in any order, and tie often */
                const float e = (float)txm_rng_below(&rng, round % 2 ? 3 : 1000);
                error[i * width + j] = turned[j * length + i] = e;
            }
        }
        for (int j = 0; j < width; j++) best = fmin(best, brute_cut(error, length, width, 0, j));
        const double total = txm_cut(error, length, width, width, 1, path, scratch);
        sum_turned = txm_cut(turned, length, width, 1, length, other, scratch);
        for (int i = 0; i < length; i++) {
            assert_in_range(path[i], 0, width - 1);
            if (i) assert_true(abs(path[i] - path[i - 1]) <= 1);
            sum += error[i * width + path[i]];
            assert_int_equal(path[i], other[i]);
        }
        assert_true(total == best && sum == best && sum_turned == best);
    }
    /* ties: straight on, and from the smallest index */
    float flat[L * W] = {0};
    double scratch[L * W];
    int path[L];
    txm_cut(flat, L, W, W, 1, path, scratch);
    for (int i = 0; i < L; i++) assert_int_equal(path[i], 0);
    flat[(L - 1) * W] = 1;
    txm_cut(flat, L, W, W, 1, path, scratch);
    for (int i = 0; i < L; i++) assert_int_equal(path[i], 1);
    /* a wall of INFINITY with one hole */
    for (int j = 0; j < W; j++) flat[3 * W + j] = j == 3 ? 0.5f : INFINITY;
    assert_true(txm_cut(flat, L, W, W, 1, path, scratch) == 0.5);
    assert_int_equal(path[3], 3);
    /* NaN breaks the optimum but never the bounds */
    for (int i = 0; i < L * W; i++) flat[i] = i % 3 ? NAN : 1;
    txm_cut(flat, L, W, W, 1, path, scratch);
    for (int i = 0; i < L; i++) assert_in_range(path[i], 0, W - 1);
    path[0] = 77;
    assert_true(txm_cut(flat, 0, W, W, 1, path, scratch) == 0);
    assert_true(txm_cut(flat, L, 0, W, 1, path, scratch) == 0);
    assert_int_equal(path[0], 77);
}

/* ---- half size -------------------------------------------------------------------------- */

static void test_halve(void **state) {
    (void)state;
    enum { MOST = 9 };
    static float pixels[MOST * MOST * 4], small[5 * 5 * 4];
    txm_rng rng = txm_rng_make(16, 0);
    for (int w = 1; w <= MOST; w++) {
        for (int h = 1; h <= MOST; h++) {
            for (int c = 1; c <= 4; c++) {
                txm_image im = view(pixels, w, h, c, TXM_F32);
                txm_image half = view(small, (w + 1) / 2, (h + 1) / 2, c, TXM_F32);
                for (int i = 0; i < w * h * c; i++) pixels[i] = txm_rng_float(&rng);
                assert_int_equal(txm_image_halve(&im, &half, NULL), TXM_OK);
                for (int y = 0; y < half.height; y++) {
                    for (int x = 0; x < half.width; x++) {
                        for (int k = 0; k < c; k++) {
                            double sum = 0, n = 0;
                            for (int v = 2 * y; v < h && v < 2 * y + 2; v++) {
                                for (int u = 2 * x; u < w && u < 2 * x + 2; u++) {
                                    sum += txm_image_get(&im, u, v, k);
                                    n++;
                                }
                            }
                            assert_near(txm_image_get(&half, x, y, k), sum / n, 1e-7);
                        }
                    }
                }
            }
        }
    }
    txm_env env;
    memset(&env, 0, sizeof env);
    const txm_image im = view(pixels, 9, 8, 1, TXM_F32), good = view(small, 5, 4, 1, TXM_F32);
    memset(small, 0, sizeof small);
    txm_image bad[8];
    for (int i = 0; i < 8; i++) bad[i] = good;
    bad[0].pixels = NULL;
    bad[1].width = 4;
    bad[2].height = 5;
    bad[3].channels = 2;
    bad[4].sample = TXM_U16;
    bad[5].width = 6;
    bad[6].stride = 4;
    bad[7].channels = 9;
    for (int i = 0; i < 8; i++) {
        env.message[0] = 0;
        assert_int_equal(txm_image_halve(&im, &bad[i], &env), TXM_BAD_ARGUMENT);
        assert_memory_equal(env.message, "half: ", 6);
    }
    assert_int_equal(txm_image_halve(NULL, &good, &env), TXM_BAD_ARGUMENT);
    assert_int_equal(txm_image_halve(&im, NULL, &env), TXM_BAD_ARGUMENT);
    for (int i = 0; i < 20; i++) assert_true(small[i] == 0);
}

/* ---- Poisson ---------------------------------------------------------------------------- */

enum { SIDE = 48 };
typedef struct poisson_case {
    float pixels[SIDE * SIDE * 3], target[SIDE * SIDE * 3];
    uint8_t mask[SIDE * SIDE];
    txm_poisson_desc desc;
} poisson_case;

/* u = x^2 - y^2, x y and x + 2 y: harmonic, and solutions of the five-point equation exactly */
static float harmonic(int x, int y, int c) {
    const double u = x / 16.0 - 1, v = y / 16.0 - 2;
    return (float)(c == 0 ? u * u - v * v : c == 1 ? u * v : u + 2 * v);
}

static void poisson_setup(poisson_case *p, int channels, uint64_t seed) {
    txm_rng rng = txm_rng_make(seed, 0);
    memset(p, 0, sizeof *p);
    p->desc.image = view(p->pixels, SIDE, SIDE, channels, TXM_F32);
    p->desc.mask = view(p->mask, SIDE, SIDE, 1, TXM_U8);
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            /* a ragged disc, islands of known pixels in it, and lone unknowns outside */
            const int dx = x - 24, dy = y - 22, border = x % (SIDE - 1) == 0 || y % (SIDE - 1) == 0;
            const int inside = dx * dx + dy * dy < 300 + txm_rng_range(&rng, 0, 60);
            int unknown = inside ? txm_rng_below(&rng, 100) > 0 : txm_rng_below(&rng, 40) == 0;
            if (border) unknown = 0; /* the natural border would not be harmonic */
            p->mask[y * SIDE + x] = (uint8_t)(unknown ? 1 + txm_rng_below(&rng, 255) : 0);
            for (int c = 0; c < channels; c++)
                txm_image_set(&p->desc.image, x, y, c, unknown ? 0 : harmonic(x, y, c));
        }
    }
}

static void test_poisson_harmonic(void **state) {
    (void)state;
    static poisson_case p, before;
    for (int channels = 1; channels <= 3; channels++) {
        for (uint64_t seed = 0; seed < 5; seed++) {
            tk_memory memory;
            tk_progress progress;
            memset(&memory, 0, sizeof memory);
            memset(&progress, 0, sizeof progress);
            txm_env env = tk_env(&memory, &progress);
            poisson_setup(&p, channels, seed);
            before = p;
            assert_int_equal(txm_poisson(&p.desc, &env), TXM_OK);
            assert_int_equal(tk_leaks(&memory), 0);
            assert_true(progress.calls > 0 && progress.errors == 0);
            assert_true(progress.calls < 60 * channels); /* the preconditioner does its work */
            for (int i = 0; i < SIDE * SIDE * channels; i++) {
                const int pixel = i / channels, c = i % channels;
                if (p.mask[pixel]) {
                    assert_near(p.pixels[i], harmonic(pixel % SIDE, pixel / SIDE, c), 2e-5);
                } else {
                    assert_true(p.pixels[i] == before.pixels[i]);
                }
            }
        }
    }
}

/* With a target the solution has that Laplacian, whatever the guess; with screen it obeys the
   screened equation, also where everything is unknown and at the natural border. */
static void test_poisson_equation(void **state) {
    (void)state;
    static poisson_case p, before;
    for (int round = 0; round < 8; round++) {
        const int channels = 1 + round % 3, all = round & 4;
        txm_rng rng = txm_rng_make(17, (uint64_t)round);
        poisson_setup(&p, channels, (uint64_t)round);
        p.desc.target = view(p.target, SIDE, SIDE, channels, TXM_F32);
        p.desc.screen = round % 2 || all ? 0.125f : 0;
        p.desc.tolerance = 1e-9f;
        for (int i = 0; i < SIDE * SIDE; i++) {
            if (all) p.mask[i] = 1;
            else if (txm_rng_below(&rng, 50) == 0) p.mask[i] ^= 255; /* the border too */
        }
        for (int i = 0; i < SIDE * SIDE * channels; i++) {
            p.pixels[i] = txm_rng_float(&rng);
            p.target[i] = random_float(&rng, -0.1f, 0.1f);
        }
        before = p;
        assert_int_equal(txm_poisson(&p.desc, NULL), TXM_OK);
        for (int y = 0; y < SIDE; y++) {
            for (int x = 0; x < SIDE; x++) {
                for (int c = 0; c < channels; c++) {
                    const int i = (y * SIDE + x) * channels + c;
                    if (!p.mask[y * SIDE + x]) {
                        assert_true(p.pixels[i] == before.pixels[i]);
                        continue;
                    }
                    double laplacian = 0;
                    for (int k = 0; k < 4; k++) {
                        const int u = x + (k == 0) - (k == 1), v = y + (k == 2) - (k == 3);
                        if (u < 0 || v < 0 || u >= SIDE || v >= SIDE) continue;
                        laplacian += (double)txm_image_get(&p.desc.image, u, v, c) - p.pixels[i];
                    }
                    assert_near((double)p.desc.screen * (p.pixels[i] - before.pixels[i]) -
                                    laplacian,
                                -p.target[i], 1e-5);
                }
            }
        }
    }
}

static void test_poisson_simple(void **state) {
    (void)state;
    static poisson_case p, before;
    /* nothing to do: not even the allocator is asked */
    tk_memory memory;
    memset(&memory, 0, sizeof memory);
    txm_env env = tk_env(&memory, NULL);
    poisson_setup(&p, 1, 0);
    memset(p.mask, 0, sizeof p.mask);
    before = p;
    assert_int_equal(txm_poisson(&p.desc, &env), TXM_OK);
    assert_memory_equal(p.pixels, before.pixels, sizeof p.pixels);
    assert_int_equal(memory.calls, 0);
    /* one known pixel holds all others */
    memset(p.mask, 1, sizeof p.mask);
    memset(p.pixels, 0, sizeof p.pixels);
    p.mask[100] = 0;
    p.pixels[100] = 3;
    p.desc.tolerance = 1e-8f;
    assert_int_equal(txm_poisson(&p.desc, &env), TXM_OK);
    for (int i = 0; i < SIDE * SIDE; i++) assert_near(p.pixels[i], 3, 1e-3);
    /* a perfect guess is taken as it is; one iteration is one iteration */
    assert_int_equal(txm_poisson(&p.desc, &env), TXM_OK);
    tk_progress progress;
    memset(&progress, 0, sizeof progress);
    env = tk_env(&memory, &progress);
    p.pixels[5] = 100;
    p.desc.max_iterations = 1;
    p.desc.progress_from = 0.25f;
    p.desc.progress_to = 0.5f;
    assert_int_equal(txm_poisson(&p.desc, &env), TXM_OK);
    assert_int_equal(progress.calls, 1);
    assert_near(progress.last, 0.25, 1e-7);
    assert_int_equal(tk_leaks(&memory), 0);
    /* views with padding and upside down give the same */
    static float padded[SIDE * (SIDE + 5)], flipped[SIDE * SIDE];
    poisson_setup(&p, 1, 3);
    before = p;
    for (int y = 0; y < SIDE; y++) {
        memcpy(padded + y * (SIDE + 5), p.pixels + y * SIDE, SIDE * sizeof(float));
        memcpy(flipped + (SIDE - 1 - y) * SIDE, p.pixels + y * SIDE, SIDE * sizeof(float));
    }
    assert_int_equal(txm_poisson(&p.desc, NULL), TXM_OK);
    before.desc.mask.pixels = before.mask;
    before.desc.image.pixels = padded;
    before.desc.image.stride = (SIDE + 5) * (ptrdiff_t)sizeof(float);
    assert_int_equal(txm_poisson(&before.desc, NULL), TXM_OK);
    before.desc.image.pixels = flipped + (SIDE - 1) * SIDE;
    before.desc.image.stride = -SIDE * (ptrdiff_t)sizeof(float);
    assert_int_equal(txm_poisson(&before.desc, NULL), TXM_OK);
    for (int y = 0; y < SIDE; y++) {
        assert_memory_equal(padded + y * (SIDE + 5), p.pixels + y * SIDE, SIDE * sizeof(float));
        assert_memory_equal(flipped + (SIDE - 1 - y) * SIDE, p.pixels + y * SIDE,
                            SIDE * sizeof(float));
    }
}

static void test_poisson_bad(void **state) {
    (void)state;
    static poisson_case p, before;
    enum { CASES = 23 };
    assert_int_equal(txm_poisson(NULL, NULL), TXM_BAD_ARGUMENT);
    for (int i = 0; i < CASES; i++) {
        tk_memory memory;
        memset(&memory, 0, sizeof memory);
        txm_env env = tk_env(&memory, NULL);
        poisson_setup(&p, 2, 1);
        txm_poisson_desc *d = &p.desc;
        d->target = view(p.target, SIDE, SIDE, 2, TXM_F32);
        const char *name = "";
        switch (i) {
        case 0: d->image.pixels = NULL, name = "image"; break;
        case 1: d->image.channels = 7, name = "image"; break;
        case 2: d->image.sample = TXM_U8, name = "image"; break;
        case 3: p.pixels[9] = NAN, name = "image"; break;
        case 4: p.pixels[22 * SIDE * 2 + 48] = INFINITY, name = "image"; break;
        case 5: d->mask.pixels = NULL, name = "mask"; break;
        case 6: d->mask.channels = 2, d->mask.width /= 2, name = "mask"; break;
        case 7: d->mask.sample = TXM_F32, d->mask.width /= 4, name = "mask"; break;
        case 8: d->mask.width--, name = "mask"; break;
        case 9: d->mask.height--, name = "mask"; break;
        case 10: memset(p.mask, 1, sizeof p.mask), name = "mask"; break;
        case 11: d->target.width--, name = "target"; break;
        case 12: d->target.height--, name = "target"; break;
        case 13: d->target.channels = 1, name = "target"; break;
        case 14: d->target.sample = TXM_U8, name = "target"; break;
        case 15: p.target[11] = NAN, name = "target"; break;
        case 16: d->target.stride = 1, name = "target"; break;
        case 17: d->screen = -1, name = "screen"; break;
        case 18: d->screen = NAN, name = "screen"; break;
        case 19: d->tolerance = -1e-3f, name = "tolerance"; break;
        case 20: d->tolerance = 1e-13f, name = "tolerance"; break;
        case 21: d->max_iterations = -1, name = "max_iterations"; break;
        case 22: d->progress_from = 0.5f, name = "progress"; break;
        }
        before = p;
        assert_int_equal(txm_poisson(d, &env), TXM_BAD_ARGUMENT);
        if (strncmp(env.message, name, strlen(name)) != 0)
            fail_msg("case %d: '%s' does not start with '%s'", i, env.message, name);
        assert_memory_equal(p.pixels, before.pixels, sizeof p.pixels);
        assert_int_equal(memory.calls, 0);
    }
}

static void test_poisson_memory(void **state) {
    (void)state;
    static poisson_case p, before;
    poisson_setup(&before, 3, 2);
    for (int onward = 0; onward < 2; onward++) {
        for (long k = 1;; k++) {
            tk_memory memory;
            memset(&memory, 0, sizeof memory);
            memory.fail_at = k;
            memory.fail_onward = onward;
            txm_env env = tk_env(&memory, NULL);
            p = before;
            p.desc.image.pixels = p.pixels;
            p.desc.mask.pixels = p.mask;
            const txm_status status = txm_poisson(&p.desc, &env);
            assert_int_equal(tk_leaks(&memory), 0);
            if (memory.calls < k) {
                assert_int_equal(status, TXM_OK);
                assert_true(k > 2);
                /* what the manual says: 64 + 4 * channels bytes per unknown, and little else */
                size_t unknown = 0;
                for (int i = 0; i < SIDE * SIDE; i++) unknown += p.mask[i] != 0;
                assert_true(memory.peak_bytes <= unknown * (64 + 12) + 4 * SIDE + 4 * 72);
                break;
            }
            assert_int_equal(status, TXM_OUT_OF_MEMORY);
            assert_true(strstr(env.message, "memory") != NULL);
            assert_memory_equal(p.pixels, before.pixels, sizeof p.pixels);
        }
    }
}

static void test_poisson_cancel(void **state) {
    (void)state;
    static poisson_case p, before;
    poisson_setup(&before, 3, 2);
    for (long k = 1;; k++) {
        tk_memory memory;
        tk_progress progress;
        memset(&memory, 0, sizeof memory);
        memset(&progress, 0, sizeof progress);
        progress.cancel_at = k;
        txm_env env = tk_env(&memory, &progress);
        p = before;
        p.desc.image.pixels = p.pixels;
        p.desc.mask.pixels = p.mask;
        const txm_status status = txm_poisson(&p.desc, &env);
        assert_int_equal(tk_leaks(&memory), 0);
        assert_int_equal(progress.errors, 0);
        assert_int_equal(progress.late, 0);
        if (progress.calls < k) {
            assert_int_equal(status, TXM_OK);
            assert_true(k > 10);
            break;
        }
        assert_int_equal(status, TXM_CANCELLED);
        assert_true(strstr(env.message, "cancelled") != NULL);
        assert_memory_equal(p.pixels, before.pixels, sizeof p.pixels);
    }
}

/* ---- same bytes, quick start ------------------------------------------------------------ */

/* A hash over results that do not depend on the C library: integers, products, square roots. */
static void test_same_bytes(void **state) {
    (void)state;
    static poisson_case p;
    txm_rng rng = txm_rng_make(99, 1);
    uint64_t hash = 0;
    for (int i = 0; i < 1000; i++) {
        const txm_vec3 a = random_vec3(&rng, 3), b = random_vec3(&rng, 3);
        const txm_quat q = random_quat(&rng);
        const txm_mat4 m = txm_mat4_mul(txm_mat4_translation(a), txm_quat_mat4(q));
        const txm_vec3 v[5] = {txm_vec3_cross(a, b), txm_vec3_normalize(a), txm_quat_rotate(q, a),
                               txm_mat4_point(m, b), txm_rgb_to_opponent(a)};
        const double s[6] = {a.x, a.y, a.z, b.x, b.y, b.z};
        double values[3], vectors[3][3];
        txm_mat4 inverse;
        txm_eigen3(s, values, vectors);
        txm_mat4_inverse(m, &inverse);
        hash = tk_hash(hash, v, sizeof v);
        hash = tk_hash(hash, &inverse, sizeof inverse);
        hash = tk_hash(hash, values, sizeof values);
        hash = tk_hash(hash, vectors, sizeof vectors);
    }
    poisson_setup(&p, 1, 4);
    assert_int_equal(txm_poisson(&p.desc, NULL), TXM_OK);
    hash = tk_hash(hash, p.pixels, sizeof p.pixels);
    if (hash != 0xb2baf780e6ad5d97u) fail_msg("hash is 0x%016llxu", (unsigned long long)hash);
}

static void test_quick_start(void **state) {
    (void)state;
    char line[80] = "";
    assert_int_equal(tk_quick_start("texmath.h", "texmath"), 0);
    FILE *file = fopen("build/tests/texmath_quick.txt", "r");
    assert_non_null(file);
    const char *got = fgets(line, sizeof line, file);
    fclose(file);
    assert_non_null(got);
    assert_string_equal(line, "centre of the ramp: 0.5079\n");
}

/* ---- minimum cut of a grid ---- */

enum { FLOW_W = 4, FLOW_H = 3, FLOW_STRIDE = FLOW_W + 2, FLOW_NODES = (FLOW_W + 2) * (FLOW_H + 2) };

static int flow_node(int i) {
    return (i / FLOW_W + 1) * FLOW_STRIDE + i % FLOW_W + 1;
}

/* Capacities cut when the nodes of the mask are the sink's. */
static long flow_cut(int directions, const int step[6], int32_t arc[6][FLOW_NODES],
                     const int32_t excess[FLOW_NODES], unsigned mask) {
    long sum = 0;
    int is_sink[FLOW_NODES] = {0};
    for (int i = 0; i < FLOW_W * FLOW_H; i++) is_sink[flow_node(i)] = (int)(mask >> i & 1);
    for (int i = 0; i < FLOW_W * FLOW_H; i++) {
        const int p = flow_node(i);
        if (excess[p] > 0 && is_sink[p]) sum += excess[p];
        if (excess[p] < 0 && !is_sink[p]) sum -= excess[p];
        for (int d = 0; d < directions; d++) {
            if (!is_sink[p] && is_sink[p + step[d]]) sum += arc[d][p];
        }
    }
    return sum;
}

/* On random grids the cut is as cheap as the cheapest of all 2^12. */
static void test_flow(void **state) {
    (void)state;
    txm_arena arena;
    txm_flow g;
    txm_arena_init(&arena, NULL);
    for (int directions = 4; directions <= 6; directions += 2) {
        assert_true(txm_flow_make(&g, &arena, directions, FLOW_NODES));
        for (int trial = 0; trial < 150; trial++) {
            static int32_t arc[6][FLOW_NODES], excess[FLOW_NODES];
            txm_rng rng = txm_rng_make(5, (uint64_t)(trial * 10 + directions));
            const int most = trial % 3 == 0 ? 3 : 1000; /* small ones give ties */
            const int half = directions / 2;
            const int step[3] = {1, FLOW_STRIDE, FLOW_STRIDE - 1};
            memset(arc, 0, sizeof arc);
            memset(excess, 0, sizeof excess);
            for (int d = 0; d < half; d++) {
                g.step[d] = step[d];
                g.step[d + half] = -step[d];
            }
            for (int i = 0; i < FLOW_W * FLOW_H; i++) {
                const int p = flow_node(i);
                excess[p] = txm_rng_range(&rng, -most, most);
                for (int k = 0; k < FLOW_W * FLOW_H; k++) {
                    for (int d = 0; d < directions; d++) {
                        if (flow_node(k) == p + g.step[d])
                            arc[d][p] = txm_rng_range(&rng, 0, most);
                    }
                }
            }
            g.count = FLOW_NODES;
            for (int d = 0; d < directions; d++) memcpy(g.arc[d], arc[d], sizeof arc[d]);
            memcpy(g.excess, excess, sizeof excess);
            txm_flow_solve(&g);
            unsigned mask = 0;
            for (int i = 0; i < FLOW_W * FLOW_H; i++)
                mask |= (unsigned)(g.tree[flow_node(i)] == TXM_FLOW_SINK) << i;
            long least = LONG_MAX;
            for (unsigned m = 0; m < 1u << (FLOW_W * FLOW_H); m++) {
                const long cut = flow_cut(directions, g.step, arc, excess, m);
                if (cut < least) least = cut;
            }
            assert_int_equal(flow_cut(directions, g.step, arc, excess, mask), least);
        }
    }
    txm_arena_free(&arena);
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
        cmocka_unit_test(test_sincos),
        cmocka_unit_test(test_exp2),
        cmocka_unit_test(test_numbers),
        cmocka_unit_test(test_image_check),
        cmocka_unit_test(test_image_samples),
        cmocka_unit_test(test_image_finite),
        cmocka_unit_test(test_rng_known),
        cmocka_unit_test(test_rng_ranges),
        cmocka_unit_test(test_shuffle),
        cmocka_unit_test(test_sort),
        cmocka_unit_test(test_vectors),
        cmocka_unit_test(test_double_vectors),
        cmocka_unit_test(test_matrix_inverse),
        cmocka_unit_test(test_transforms),
        cmocka_unit_test(test_quaternions),
        cmocka_unit_test(test_colour_known),
        cmocka_unit_test(test_colour_back),
        cmocka_unit_test(test_eigen),
        cmocka_unit_test(test_cut),
        cmocka_unit_test(test_flow),
        cmocka_unit_test(test_halve),
        cmocka_unit_test(test_poisson_harmonic),
        cmocka_unit_test(test_poisson_equation),
        cmocka_unit_test(test_poisson_simple),
        cmocka_unit_test(test_poisson_bad),
        cmocka_unit_test(test_poisson_memory),
        cmocka_unit_test(test_poisson_cancel),
        cmocka_unit_test(test_same_bytes),
        cmocka_unit_test(test_quick_start),
    };
    return cmocka_run_group_tests_name("texmath", tests, NULL, NULL);
}
