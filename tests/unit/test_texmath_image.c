/* test_texmath_image.c - image views, sRGB, the Poisson equation on a mask
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texmath_image && build/tests/unit/test_texmath_image */
#include "mathkit.h"

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
}

/* roots to an ulp or two, and with them both curves as pow gives them */
static void test_colour_roots(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(14, 0);
    for (int i = 0; i < 20000; i++) {
        const double x = exp(txm_rng_double(&rng) * 600 - 300);
        for (int n = 2; n < 8; n++) {
            double power = 1;
            const double root = txm_root(x, n);
            for (int k = 0; k < n; k++) power *= root;
            assert_near(power / x, 1, 1e-14);
        }
        const float s = random_float(&rng, 0, i % 2 ? 1 : 100);
        const double linear = s <= 0.04045f ? s / 12.92 : pow((s + 0.055) / 1.055, 2.4);
        const double code = s <= 0.0031308f ? 12.92 * s : 1.055 * pow(s, 1 / 2.4) - 0.055;
        assert_near(txm_srgb_to_linear(s) / linear, 1, 1e-7);
        assert_near(txm_linear_to_srgb(s) / code, 1, 1e-7);
    }
    assert_true(txm_root(1, 5) == 1 && txm_root(1, 3) == 1);
    assert_true(txm_srgb_to_linear(INFINITY) == INFINITY &&
                txm_linear_to_srgb(INFINITY) == INFINITY);
    assert_true(txm_srgb_to_linear(NAN) != txm_srgb_to_linear(NAN));
}

static void test_colour_back(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(13, 0);
    for (int i = 0; i < 20000; i++) {
        const float c = random_float(&rng, 0, 1);
        assert_near(txm_linear_to_srgb(txm_srgb_to_linear(c)), c, 1e-6);
    }
    for (int v = 0; v < 256; v++) { /* every code value survives linear light */
        const float s = (float)v / 255.0f;
        assert_int_equal((int)(txm_linear_to_srgb(txm_srgb_to_linear(s)) * 255 + 0.5f), v);
    }
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
            p->mask[y * SIDE + x] = (uint8_t)(unknown ? 255 - txm_rng_below(&rng, 255) / 2 : 0);
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
            if (all) p.mask[i] = 255;
            else if (txm_rng_below(&rng, 50) == 0) p.mask[i] = p.mask[i] ? 0 : 255; /* the border too */
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
    memset(p.mask, 255, sizeof p.mask);
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
        case 6: d->mask.channels = 5, name = "mask"; break;
        case 7: d->mask.stride = SIDE - 1, name = "mask"; break;
        case 8: d->mask.width--, name = "mask"; break;
        case 9: d->mask.height--, name = "mask"; break;
        case 10: memset(p.mask, 255, sizeof p.mask), name = "mask"; break;
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

/* Solve a copy of the case; after a failure nothing of it may have changed. */
static txm_status try_poisson(void *context, txm_env *env) {
    static poisson_case p;
    const poisson_case *before = (const poisson_case *)context;
    p = *before;
    p.desc.image.pixels = p.pixels;
    p.desc.mask.pixels = p.mask;
    const txm_status status = txm_poisson(&p.desc, env);
    if (status == TXM_OK) return status;
    assert_memory_equal(p.pixels, before->pixels, sizeof p.pixels);
    assert_non_null(strstr(env->message, status == TXM_CANCELLED ? "cancelled" : "memory"));
    return status;
}

static void test_poisson_memory(void **state) {
    (void)state;
    static poisson_case p;
    poisson_setup(&p, 3, 2);
    assert_true(tk_sweep(try_poisson, &p, TK_ALLOCATION) > 2);
    assert_true(tk_sweep(try_poisson, &p, TK_ONWARD) > 2);
    /* what the manual says: 64 + 4 * channels bytes per unknown, and little else */
    tk_memory memory;
    size_t unknown = 0;
    memset(&memory, 0, sizeof memory);
    txm_env env = tk_env(&memory, NULL);
    assert_int_equal(try_poisson(&p, &env), TXM_OK);
    for (int i = 0; i < SIDE * SIDE; i++) unknown += p.mask[i] != 0;
    assert_true(memory.peak_bytes <= unknown * (64 + 12) + 4 * SIDE + 4 * 72);
}

static void test_poisson_cancel(void **state) {
    (void)state;
    static poisson_case p;
    poisson_setup(&p, 3, 2);
    assert_true(tk_sweep(try_poisson, &p, TK_CANCEL) > 10);
}

/* ---- same bytes -------------------------------------------------------------------------- */

/* A hash over results that do not depend on the C library: integers, products, square roots. */
static void test_same_bytes(void **state) {
    (void)state;
    static poisson_case p;
    txm_rng rng = txm_rng_make(99, 1);
    uint64_t hash = 0;
    for (int i = 0; i < 1000; i++) {
        const txm_vec3 a = random_vec3(&rng, 3), b = random_vec3(&rng, 3);
        const txm_quat q = random_quat(&rng);
        const txm_dvec3 turned = txm_quat_rotate(q, txm_d3(a.x, a.y, a.z));
        const txm_vec3 v[3] = {
            txm_vec3_cross(a, b), txm_vec3_normalize(a),
            txm_v3(txm_float(turned.x), txm_float(turned.y), txm_float(turned.z))};
        const double s[6] = {a.x, a.y, a.z, b.x, b.y, b.z};
        double values[3], vectors[3][3];
        txm_eigen3(s, values, vectors);
        hash = tk_hash(hash, v, sizeof v);
        hash = tk_hash(hash, values, sizeof values);
        hash = tk_hash(hash, vectors, sizeof vectors);
    }
    poisson_setup(&p, 1, 4);
    assert_int_equal(txm_poisson(&p.desc, NULL), TXM_OK);
    hash = tk_hash(hash, p.pixels, sizeof p.pixels);
    if (hash != 0x430b5669bed5f7cdu) fail_msg("hash is 0x%016llxu", (unsigned long long)hash);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_image_check),      cmocka_unit_test(test_image_samples),
        cmocka_unit_test(test_image_finite),     cmocka_unit_test(test_colour_known),
        cmocka_unit_test(test_colour_roots),     cmocka_unit_test(test_colour_back),
        cmocka_unit_test(test_poisson_harmonic), cmocka_unit_test(test_poisson_equation),
        cmocka_unit_test(test_poisson_simple),   cmocka_unit_test(test_poisson_bad),
        cmocka_unit_test(test_poisson_memory),   cmocka_unit_test(test_poisson_cancel),
        cmocka_unit_test(test_same_bytes),
    };
    return cmocka_run_group_tests_name("texmath images", tests, NULL, NULL);
}
