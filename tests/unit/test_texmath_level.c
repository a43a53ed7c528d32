/* test_texmath_level.c - levels of detail, coverage of cutouts
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texmath_level && build/tests/unit/test_texmath_level */
#include "mathkit.h"

enum { MOST = 40, SAMPLES = MOST * MOST * 4 };

static const txm_sample kinds[3] = {TXM_U8, TXM_U16, TXM_F32};

static double decode(double v) {
    return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}
static double encode(double v) {
    return v <= 0.0031308 ? v * 12.92 : 1.055 * pow(v, 1 / 2.4) - 0.055;
}

static void test_level_side(void **state) {
    (void)state;
    assert_int_equal(txm_level_side(101, 0), 101);
    assert_int_equal(txm_level_side(101, 1), 50);
    assert_int_equal(txm_level_side(87, 2), 21);
    assert_int_equal(txm_level_side(1, 1), 1);
    assert_int_equal(txm_level_side(7, 3), 1);
    assert_int_equal(txm_level_side(INT_MAX, 30), 1);
    assert_int_equal(txm_level_side(INT_MAX, 99), 1);
}

/* Random samples; alpha is often 0 or 1, normals have unit length. */
static void fill(const txm_image *im, txm_content content, txm_rng *rng) {
    const int n = im->channels;
    for (int y = 0; y < im->height; y++) {
        for (int x = 0; x < im->width; x++) {
            float v[4];
            for (int c = 0; c < n; c++) v[c] = txm_rng_float(rng);
            if (content == TXM_NORMALS) {
                const txm_vec3 u = txm_vec3_normalize(txm_v3(v[0] - 0.5f, v[1] - 0.5f, v[2]));
                v[0] = 0.5f + 0.5f * u.x, v[1] = 0.5f + 0.5f * u.y, v[2] = 0.5f + 0.5f * u.z;
            }
            if (content == TXM_COLOR && n % 2 == 0)
                v[n - 1] = txm_clampf(2 * v[n - 1] - 0.5f, 0, 1);
            for (int c = 0; c < n; c++) txm_image_set(im, x, y, c, v[c]);
        }
    }
}

/* How much of pixel u of the finer row lies under pixel x of `half`: the plain definition. */
static double overlap(int side, int half, int x, int u) {
    const double from = (double)x * side / half, to = (double)(x + 1) * side / half;
    return fmax(0, fmin(to, u + 1) - fmax(from, u));
}

/* Sample c of pixel (x, y) of the level, from the definition; 0 if nothing is visible there. */
static int expected(const txm_image *im, const txm_image *half, txm_content content, int x, int y,
                    double out[4]) {
    const int n = im->channels, colours = n % 2 ? n : n - 1;
    const int is_coded = content == TXM_COLOR && im->sample != TXM_F32;
    double sum[4] = {0}, shown = 0, weight = 0, length = 0;
    for (int v = 0; v < im->height; v++) {
        for (int u = 0; u < im->width; u++) {
            double w =
                overlap(im->width, half->width, x, u) * overlap(im->height, half->height, y, v);
            weight += w;
            if (!(w > 0)) continue;
            const double alpha = n % 2 ? 1 : (double)txm_image_get(im, u, v, n - 1);
            shown += w * alpha;
            for (int c = 0; c < n; c++) {
                double g = (double)txm_image_get(im, u, v, c);
                if (content == TXM_NORMALS && c < 3) g = txm_normal_decode(g, im->sample);
                if (is_coded && c < colours) g = decode(g);
                sum[c] += (content == TXM_COLOR && c < colours ? w * alpha : w) * g;
            }
        }
    }
    for (int c = 0; c < n; c++) {
        out[c] = sum[c] / (content == TXM_COLOR && c < colours ? shown : weight);
        if (is_coded && c < colours) out[c] = encode(out[c]);
        if (c < 3) length += sum[c] * sum[c];
    }
    for (int c = 0; c < 3 && content == TXM_NORMALS; c++)
        out[c] = txm_normal_encode(sum[c] / sqrt(length), im->sample);
    return content != TXM_COLOR || shown > 0;
}

static void test_levels(void **state) {
    (void)state;
    static const int sizes[9][2] = {{1, 1}, {7, 5},  {8, 6}, {1, 9},  {10, 1},
                                    {3, 3}, {31, 1}, {2, 3}, {40, 39}};
    static float pixels[SAMPLES], small[SAMPLES];
    txm_rng rng = txm_rng_make(16, 0);
    for (int i = 0; i < 9 * 3 * 4 * 4; i++) {
        const int *size = sizes[i % 9], channels = i / 27 % 4 + 1;
        const txm_content content = (txm_content)(i / 108);
        if (content == TXM_NORMALS && channels < 3) continue;
        txm_image im =
            txm_image_resolve(view(pixels, size[0], size[1], channels, kinds[i / 9 % 3]));
        const txm_image half = view(small, txm_level_side(size[0], 1), txm_level_side(size[1], 1),
                                    channels, im.sample);
        if (i % 4 == 1) im.pixels = txm_image_row(&im, im.height - 1), im.stride = -im.stride;
        fill(&im, content, &rng);
        txm_env env;
        memset(&env, 0, sizeof env);
        env.parallel_for = tk_parallel_reverse;
        assert_int_equal(txm_image_halve(&im, content, 0, &half, &env), TXM_OK);
        const double unit = im.sample == TXM_U8 ? 255 : im.sample == TXM_U16 ? 65535 : 1e6;
        for (int p = 0; p < half.width * half.height; p++) {
            const int x = p % half.width, y = p / half.width;
            double want[4] = {0};
            const int shows = expected(&im, &half, content, x, y, want);
            for (int c = 0; c < channels; c++) {
                const double got = (double)txm_image_get(&half, x, y, c);
                if (content == TXM_LABELS) want[c] = (double)txm_image_get(&im, 2 * x, 2 * y, c);
                if (!shows && c < channels - 1) continue;
                if (!(fabs(got - want[c]) * unit <= 0.51 + (im.sample == TXM_F32 ? 1 : 0)))
                    fail_msg("case %d, (%d, %d) %d: %.8g, not %.8g", i, x, y, c, got, want[c]);
            }
        }
    }
}

/* A whole chain of an odd picture keeps its mean. */
static void test_level_mean(void **state) {
    (void)state;
    static float a[SAMPLES], b[SAMPLES];
    txm_rng rng = txm_rng_make(17, 0);
    txm_image from = view(a, 27, 39, 1, TXM_F32), to = view(b, 13, 19, 1, TXM_F32);
    double mean = 0;
    for (int i = 0; i < 27 * 39; i++) mean += a[i] = txm_rng_float(&rng);
    mean /= 27 * 39;
    for (int k = 1; k < 7; k++) {
        to.width = txm_level_side(from.width, 1), to.height = txm_level_side(from.height, 1);
        assert_int_equal(txm_image_halve(&from, TXM_COLOR, 0, &to, NULL), TXM_OK);
        const txm_image old = from;
        from = to, to = old;
    }
    assert_int_equal(from.width * from.height, 1);
    assert_near(((const float *)from.pixels)[0], mean, 1e-6);
}

/* Flat stays flat to the last bit; opposed normals, exactly or nearly, are flat, not noise. */
static void test_level_normals(void **state) {
    (void)state;
    static uint8_t bytes[SAMPLES], half_bytes[SAMPLES];
    static uint16_t words[SAMPLES], half_words[SAMPLES];
    for (int i = 0; i < 31 * 20; i++) {
        bytes[3 * i] = bytes[3 * i + 1] = 128, bytes[3 * i + 2] = 255;
        words[3 * i] = words[3 * i + 1] = 32768, words[3 * i + 2] = 65535;
    }
    const txm_image flat = view(bytes, 31, 20, 3, TXM_U8), deep = view(words, 31, 20, 3, TXM_U16);
    const txm_image half = view(half_bytes, 15, 10, 3, TXM_U8);
    const txm_image half_deep = view(half_words, 15, 10, 3, TXM_U16);
    assert_int_equal(txm_image_halve(&flat, TXM_NORMALS, 0, &half, NULL), TXM_OK);
    assert_int_equal(txm_image_halve(&deep, TXM_NORMALS, 0, &half_deep, NULL), TXM_OK);
    assert_memory_equal(half_bytes, bytes, 15 * 10 * 3);
    assert_memory_equal(half_words, words, 15 * 10 * 3 * 2);

    static const float opposed[2][6] = {{1, 0.5f, 0.5f, 0, 0.5f, 0.5f},
                                        {0.9f, 0.8f, 0.5f, 0.1f, 0.2f, 0.49999997f}};
    for (int k = 0; k < 2; k++) {
        static float pixels[6], one[3];
        memcpy(pixels, opposed[k], sizeof pixels);
        const txm_image two = view(pixels, 2, 1, 3, TXM_F32), to = view(one, 1, 1, 3, TXM_F32);
        assert_int_equal(txm_image_halve(&two, TXM_NORMALS, 0, &to, NULL), TXM_OK);
        assert_true(one[0] == 0.5f && one[1] == 0.5f && one[2] == 1);
    }
}

/* Leaves on a ground that hides any colour: no level shows it, nor does a filter between pixels. */
static void test_level_hidden(void **state) {
    (void)state;
    static uint8_t a[SAMPLES], b[SAMPLES], other[6][SAMPLES];
    for (int hidden = 0; hidden < 2; hidden++) {
        txm_image from = view(a, 39, 30, 4, TXM_U8), to = view(b, 1, 1, 4, TXM_U8);
        txm_rng rng = txm_rng_make(5, 0);
        for (int i = 0; i < 39 * 30; i++) {
            const int x = i % 39, y = i / 39, shows = (x / 6 + y / 5) % 3 == 0;
            const int alpha = shows ? txm_rng_range(&rng, 1, 255) : 0;
            const uint8_t leaf[4] = {90, 140, 40, (uint8_t)alpha};
            for (int c = 0; c < 4; c++)
                a[4 * i + c] = shows || c == 3 ? leaf[c] : (uint8_t)(hidden ? 255 : 0);
        }
        for (int k = 1; k < 6; k++) {
            to.width = txm_level_side(from.width, 1), to.height = txm_level_side(from.height, 1);
            assert_int_equal(txm_image_halve(&from, TXM_COLOR, 3, &to, NULL), TXM_OK);
            const uint8_t *pixel = (const uint8_t *)to.pixels;
            for (int i = 0; i < to.width * to.height; i++, pixel += 4)
                assert_true(pixel[0] == 90 && pixel[1] == 140 && pixel[2] == 40);
            const size_t size = 4 * (size_t)to.width * (size_t)to.height;
            if (!hidden) memcpy(other[k], to.pixels, size);
            else assert_memory_equal(other[k], to.pixels, size);
            const txm_image old = from;
            from = to, to = old;
        }
    }
}

typedef struct fault_call {
    uint16_t pixels[SAMPLES], half[20 * 19 * 2];
    int is_coverage;
} fault_call;

static txm_status halve_under_faults(void *context, txm_env *env) {
    fault_call *call = (fault_call *)context;
    const txm_image im = view(call->pixels, 40, 39, 2, TXM_U16);
    const txm_image half = view(call->half, 20, 19, 2, TXM_U16);
    for (int i = 0; i < 40 * 39; i++) {
        call->pixels[2 * i] = (uint16_t)(i * 40);
        call->pixels[2 * i + 1] = (uint16_t)(i / 160 % 2 ? 40000 : 0);
    }
    return call->is_coverage ? txm_image_set_coverage(&half, 0.25, 0.5f, env)
                             : txm_image_halve(&im, TXM_COLOR, 0, &half, env);
}

static void test_level_memory(void **state) {
    (void)state;
    static fault_call call;
    const tk_output outputs[1] = {{call.half, sizeof call.half}};
    assert_true(tk_sweep_outputs(halve_under_faults, &call, TK_ALLOCATION, outputs, 1) > 4);
    call.is_coverage = 1;
    assert_true(tk_sweep_outputs(halve_under_faults, &call, TK_ALLOCATION, outputs, 1) == 1);
}

static void test_level_refused(void **state) {
    (void)state;
    static float pixels[SAMPLES], small[SAMPLES];
    txm_env env;
    memset(&env, 0, sizeof env);
    const txm_image im = view(pixels, 9, 8, 2, TXM_F32), good = view(small, 4, 4, 2, TXM_F32);
    txm_image bad[8];
    for (int i = 0; i < 8; i++) bad[i] = good;
    bad[0].pixels = NULL;
    bad[1].width = 5;
    bad[2].height = 3;
    bad[3].channels = 1;
    bad[4].sample = TXM_U16;
    bad[5].width = 0;
    bad[6].stride = 4;
    bad[7].channels = 9;
    for (int i = 0; i < 8; i++) {
        env.message[0] = 0;
        assert_int_equal(txm_image_halve(&im, TXM_DATA, 0, &bad[i], &env), TXM_BAD_ARGUMENT);
        assert_memory_equal(env.message, "half: ", 6);
    }
    assert_int_equal(txm_image_halve(NULL, TXM_DATA, 0, &good, &env), TXM_BAD_ARGUMENT);
    assert_int_equal(txm_image_halve(&im, TXM_DATA, 0, NULL, &env), TXM_BAD_ARGUMENT);
    assert_int_equal(txm_image_halve(&im, TXM_NORMALS, 0, &good, &env), TXM_BAD_ARGUMENT);
    assert_int_equal(txm_image_set_coverage(NULL, 0.5, 0.5f, &env), TXM_BAD_ARGUMENT);
    assert_int_equal(txm_image_set_coverage(&good, 1.5, 0.5f, &env), TXM_BAD_ARGUMENT);
    assert_int_equal(txm_image_set_coverage(&good, (double)NAN, 0.5f, &env), TXM_BAD_ARGUMENT);
    assert_int_equal(txm_image_set_coverage(&good, 0.5, 0, &env), TXM_BAD_ARGUMENT);
    for (int i = 0; i < SAMPLES; i++) assert_true(small[i] == 0);
}

/* ---- cutouts ---------------------------------------------------------------------------- */

/* Thin wires: without help they vanish in coarse levels; with it each passes the test as often. */
static void test_coverage(void **state) {
    (void)state;
    static float memory[2][64 * 64 * 4], scaled[64 * 64 * 4];
    for (int kind = 0; kind < 3; kind++) {
        for (int channels = 2; channels <= 4; channels += 2) {
            txm_image from = view(memory[0], 64, 63, channels, kinds[kind]), to = from;
            to.pixels = memory[1];
            for (int p = 0; p < 64 * 63; p++) {
                const int x = p % 64, y = p / 64;
                const int wire = at_random(x, 1, 2) < 60 || (x + 2 * y) % 9 == 0;
                for (int c = 0; c < channels; c++) txm_image_set(&from, x, y, c, 0.5f);
                const float bright = (float)at_random(x, y, 3) / 500 + 0.5f;
                txm_image_set(&from, x, y, channels - 1, wire ? bright : 0);
            }
            const double want = txm_image_coverage(&from, 0.5f);
            assert_true(want > 0.2 && want < 0.5);
            for (int k = 1; k < 5; k++) {
                to.width = txm_level_side(from.width, 1),
                to.height = txm_level_side(from.height, 1);
                assert_int_equal(txm_image_halve(&from, TXM_COLOR, 0, &to, NULL), TXM_OK);
                txm_image level = to;
                level.pixels = scaled;
                memcpy(scaled, to.pixels, sizeof scaled);
                assert_int_equal(txm_image_set_coverage(&level, want, 0.5f, NULL), TXM_OK);
                const double got = txm_image_coverage(&level, 0.5f), n = to.width * to.height;
                assert_near(got, want, 4 / n + 0.005);
                for (int p = 0; p < to.width * to.height; p++) { /* order and colour are kept */
                    const int x = p % to.width, y = p / to.width, last = channels - 1;
                    const float a = txm_image_get(&to, x, y, last);
                    const float s = txm_image_get(&level, x, y, last);
                    assert_true((a > 0 || s <= 0) && s <= 1);
                    assert_true(txm_image_get(&to, x, y, 0) == txm_image_get(&level, x, y, 0));
                }
                const txm_image old = from;
                from = to, to = old;
            }
        }
    }
}

static void test_coverage_simple(void **state) {
    (void)state;
    uint8_t pixels[8] = {1, 0, 2, 100, 3, 200, 4, 255}, before[8];
    const txm_image im = view(pixels, 2, 2, 2, TXM_U8), gray = view(pixels, 4, 2, 1, TXM_U8);
    memcpy(before, pixels, 8);
    assert_true(txm_image_coverage(&im, 0.5f) == 0.5 && txm_image_coverage(&gray, 0.5f) == 1);
    assert_int_equal(txm_image_set_coverage(&im, 0.5, 0.5f, NULL), TXM_OK); /* it is so already */
    assert_memory_equal(pixels, before, 8);
    assert_int_equal(txm_image_set_coverage(&gray, 0.1, 0.5f, NULL), TXM_OK); /* no alpha */
    assert_memory_equal(pixels, before, 8);
    for (int k = 0; k <= 4; k++) { /* what is 0 stays 0 */
        memcpy(pixels, before, 8);
        assert_int_equal(txm_image_set_coverage(&im, k / 4.0, 0.5f, NULL), TXM_OK);
        assert_true(txm_image_coverage(&im, 0.5f) == (k < 3 ? k : 3) / 4.0);
        assert_int_equal(pixels[1], 0);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_level_side),      cmocka_unit_test(test_levels),
        cmocka_unit_test(test_level_mean),      cmocka_unit_test(test_level_normals),
        cmocka_unit_test(test_level_hidden),    cmocka_unit_test(test_level_refused),
        cmocka_unit_test(test_level_memory),    cmocka_unit_test(test_coverage),
        cmocka_unit_test(test_coverage_simple),
    };
    return cmocka_run_group_tests_name("texmath levels", tests, NULL, NULL);
}
