/* test_texmath_mask.c - which pixels of a mask count
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texmath_mask && build/tests/unit/test_texmath_mask */
#include "mathkit.h"

enum { SIDE = 96, BYTES = SIDE * SIDE * 4 * 4 };

/* masks of any form, and what was read of them */
static union {
    uint8_t bytes[BYTES];
    uint16_t words[BYTES / 2];
    float floats[BYTES / 4];
} memory;
static uint8_t read[3][SIDE * SIDE]; /* by use */

static const txm_sample samples[3] = {TXM_U8, TXM_U16, TXM_F32};

/* how much of pixel (x, y) a disc of that radius covers, in sixteenths */
static int covered(int x, int y, double radius) {
    int count = 0;
    for (int k = 0; k < 16; k++) {
        const double dx = x + (k % 4 + 0.5) / 4 - 47.3, dy = y + (k / 4 + 0.5) / 4 - 48.6;
        count += dx * dx + dy * dy < radius * radius;
    }
    return count;
}

static void read_all(const txm_image *mask, size_t counts[3]) {
    for (int use = 0; use < 3; use++) counts[use] = txm_mask_read(mask, (txm_mask_use)use, read[use]);
}

/* Gray times alpha, in every form: the same mask. */
static void test_forms(void **state) {
    (void)state;
    for (int channels = 1; channels <= 4; channels++) {
        for (int kind = 0; kind < 3; kind++) {
            for (int in_alpha = 0; in_alpha <= (channels % 2 == 0); in_alpha++) {
                size_t counts[3], white = 0;
                txm_image m = view(&memory, SIDE, SIDE, channels, samples[kind]);
                memset(&memory, 0, sizeof memory);
                for (int y = 0; y < SIDE; y++) {
                    for (int x = 0; x < SIDE; x++) {
                        const float v = x > 20 && y > 30 && x + y < 120 ? 1.0f : 0.0f;
                        white += v > 0;
                        for (int c = 0; c < channels; c++) {
                            const int is_alpha = channels % 2 == 0 && c == channels - 1;
                            txm_image_set(&m, x, y, c, is_alpha == in_alpha ? v : 1.0f);
                        }
                    }
                }
                if (channels == 1) m.channels = 0;
                read_all(&m, counts);
                for (int use = 0; use < 3; use++) assert_int_equal(counts[use], white);
                assert_int_equal(read[0][30 * SIDE + 40], 0);
                assert_int_equal(read[0][31 * SIDE + 40], 255);
                assert_memory_equal(read[1], read[0], sizeof read[0]);
                assert_memory_equal(read[2], read[0], sizeof read[0]);
            }
        }
    }
}

/* The half: 128 of 255, 32768 of 65535, 0.5; colours by their luma; NaN and beyond the range. */
static void test_half(void **state) {
    (void)state;
    static const uint8_t rgba[6][4] = {{255, 0, 0, 255},   {0, 255, 0, 255},   {0, 0, 255, 255},
                                       {255, 255, 255, 127}, {255, 255, 255, 128}, {0, 180, 0, 255}};
    static const int counts[6] = {0, 1, 0, 0, 1, 1};
    txm_image m = view(&memory, 1, 1, 1, TXM_U8);
    for (int v = 0; v < 256; v++) {
        memory.bytes[0] = (uint8_t)v;
        assert_int_equal(txm_mask_at(&m, 0, 0), v >= 128);
        assert_int_equal(txm_mask_read(&m, TXM_MASK_ALLOWS, read[0]), v >= 128);
    }
    m.sample = TXM_U16;
    for (int v = 0; v < 65536; v++) {
        memory.words[0] = (uint16_t)v;
        assert_int_equal(txm_mask_at(&m, 0, 0), v >= 32768);
    }
    m.sample = TXM_F32;
    const float floats[6] = {0.5f, 0.49999997f, 7, -3, NAN, INFINITY};
    const int counted[6] = {1, 0, 1, 0, 0, 1};
    for (int i = 0; i < 6; i++) {
        memory.floats[0] = floats[i];
        assert_int_equal(txm_mask_at(&m, 0, 0), counted[i]);
    }
    m.sample = TXM_U8;
    m.channels = 4;
    for (int i = 0; i < 6; i++) {
        memcpy(memory.bytes, rgba[i], 4);
        assert_int_equal(txm_mask_at(&m, 0, 0), counts[i]);
    }
    memset(memory.bytes, 255, 4);
    assert_near(txm_mask_value(&m, 0, 0), 1, 0);
}

/* An antialiased disc, black or white, in all samples: nothing that is only partly white may be used,
   everything that is partly white is replaced. */
static void test_antialiased(void **state) {
    (void)state;
    for (int kind = 0; kind < 3; kind++) {
        for (int inverted = 0; inverted < 2; inverted++) {
            size_t counts[3], all = 0, some = 0, half = 0;
            const txm_image m = view(&memory, SIDE, SIDE, 1, samples[kind]);
            for (int i = 0; i < SIDE * SIDE; i++) {
                int c = covered(i % SIDE, i / SIDE, 31.4);
                if (inverted) c = 16 - c;
                txm_image_set(&m, i % SIDE, i / SIDE, 0, (float)c / 16);
                all += c == 16;
                some += c > 0;
                half += txm_image_get(&m, i % SIDE, i / SIDE, 0) >= 0.5f;
            }
            read_all(&m, counts);
            assert_true(all < half && half < some);
            assert_int_equal(counts[TXM_MASK_DIVIDES], half);
            assert_int_equal(counts[TXM_MASK_ALLOWS], all);
            assert_int_equal(counts[TXM_MASK_REPLACES], some);
            for (int i = 0; i < SIDE * SIDE; i++) {
                const float v = txm_image_get(&m, i % SIDE, i / SIDE, 0);
                assert_int_equal(read[TXM_MASK_ALLOWS][i], v >= 1 ? 255 : 0);
                assert_int_equal(read[TXM_MASK_REPLACES][i], v > 0 ? 255 : 0);
            }
        }
    }
}

/* A blurred disc: the rim goes on while the values rise, but not farther than the limit. */
static void test_blurred(void **state) {
    (void)state;
    for (int wide = 6; wide <= 60; wide += 27) {
        size_t counts[3], half = 0;
        const txm_image m = view(&memory, SIDE, SIDE, 1, TXM_F32);
        for (int i = 0; i < SIDE * SIDE; i++) {
            const double dx = i % SIDE - 47.3, dy = i / SIDE - 48.6;
            const double v = (sqrt(dx * dx + dy * dy) - 24) / wide + 0.5;
            memory.floats[i] = txm_clampf((float)v, 0, 1);
            half += memory.floats[i] >= 0.5f;
        }
        read_all(&m, counts);
        assert_int_equal(counts[0], half);
        for (int i = 0; i < SIDE * SIDE; i++) {
            const double dx = i % SIDE - 47.3, dy = i / SIDE - 48.6;
            const double out = sqrt(dx * dx + dy * dy) - 24; /* pixels beyond the half */
            const int reach = wide == 6 ? 3 : TXM_MASK_RIM; /* all of a narrow blur */
            if (out < -1.6 * TXM_MASK_RIM || out > 1.6 * TXM_MASK_RIM) {
                assert_int_equal(read[1][i], read[0][i]);
                assert_int_equal(read[2][i], read[0][i]);
            } else if (out > 0 && out < 0.7 * reach) {
                assert_int_equal(read[1][i], 0);
            } else if (out < 0 && out > -0.7 * reach) {
                assert_int_equal(read[2][i], 255);
            }
        }
    }
}

/* A sharp mask with noise, as JPEG leaves it: neither the noise nor a rim. */
static void test_noise(void **state) {
    (void)state;
    for (uint64_t seed = 0; seed < 20; seed++) {
        size_t counts[3], white = 0;
        txm_rng rng = txm_rng_make(seed, 0);
        const txm_image m = view(&memory, SIDE, SIDE, 1, TXM_U8);
        for (int i = 0; i < SIDE * SIDE; i++) {
            const int is_white = covered(i % SIDE, i / SIDE, 30) >= 8;
            const int noise = txm_rng_range(&rng, 0, 40);
            memory.bytes[i] = (uint8_t)(is_white ? 255 - noise : noise);
            white += (size_t)is_white;
        }
        read_all(&m, counts);
        for (int use = 0; use < 3; use++) assert_int_equal(counts[use], white);
    }
}

/* A sharp mask in two grays, such as paint of 60 %: no rim either. */
static void test_grays(void **state) {
    (void)state;
    size_t counts[3], light = 0;
    const txm_image m = view(&memory, SIDE, SIDE, 1, TXM_U16);
    for (int i = 0; i < SIDE * SIDE; i++) {
        memory.words[i] = covered(i % SIDE, i / SIDE, 30) >= 8 ? 40000 : 20000;
        light += memory.words[i] == 40000;
    }
    read_all(&m, counts);
    for (int use = 0; use < 3; use++) assert_int_equal(counts[use], light);
}

/* A sharp square far from an antialiased disc keeps its edges: each is judged by itself. */
static void test_mixed(void **state) {
    (void)state;
    enum { WIDE = 400 };
    static uint8_t pixels[WIDE * SIDE], bytes[WIDE * SIDE];
    const txm_image m = view(pixels, WIDE, SIDE, 1, TXM_U8);
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < WIDE; x++) {
            const int c = x < SIDE ? covered(x, y, 9) : 0;
            const int noise = x >= SIDE && (x + y) % 3 == 0 ? 30 : 0;
            pixels[y * WIDE + x] = (uint8_t)(x > 220 && y > 2 && y < 90 ? 255 - noise : noise);
            if (x < SIDE) pixels[y * WIDE + x] = (uint8_t)(c * 255 / 16);
        }
    }
    txm_mask_read(&m, TXM_MASK_REPLACES, bytes);
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < WIDE; x++) {
            const int want = x < SIDE ? covered(x, y, 9) > 0 : x > 220 && y > 2 && y < 90;
            assert_int_equal(bytes[y * WIDE + x], want ? 255 : 0);
        }
    }
}

static void test_check(void **state) {
    (void)state;
    txm_env env;
    memset(&env, 0, sizeof env);
    txm_image m = view(&memory, 30, 20, 3, TXM_F32);
    memset(&memory, 0, sizeof memory);
    assert_int_equal(txm_mask_check(&m, "keep", 30, 20, 0, &env), TXM_OK);
    assert_int_equal(txm_mask_check(&m, "keep", 31, 20, 0, &env), TXM_BAD_ARGUMENT);
    assert_string_equal(env.message,
                        "keep: is 30 x 20 pixels, its picture 31 x 20; give them the same size");
    assert_int_equal(txm_mask_check(&m, "keep", 30, 21, 0, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(txm_mask_check(&m, "keep", 30, 20, 599, &env), TXM_TOO_LARGE);
    memory.floats[77] = NAN;
    assert_int_equal(txm_mask_check(&m, "keep", 30, 20, 0, &env), TXM_BAD_ARGUMENT);
    m.pixels = NULL;
    assert_int_equal(txm_mask_check(&m, "keep", 30, 20, 0, &env), TXM_BAD_ARGUMENT);
}

/* Any picture, upside down or padded: only the bytes are written, and no use counts less than it
   should. */
static void test_random(void **state) {
    (void)state;
    for (uint64_t seed = 0; seed < 300; seed++) {
        static uint8_t guarded[SIDE * SIDE + 2];
        txm_rng rng = txm_rng_make(seed, 3);
        const int width = txm_rng_range(&rng, 1, SIDE - 1), height = txm_rng_range(&rng, 1, SIDE);
        const int kind = txm_rng_range(&rng, 0, 2), channels = txm_rng_range(&rng, 1, 4);
        txm_image m = view(&memory, width, height, channels, samples[kind]);
        m.stride = (ptrdiff_t)((size_t)SIDE * (size_t)channels * txm_sample_bytes(m.sample));
        for (size_t i = 0; i < sizeof memory.words / 2; i++) {
            if (kind == 2) memory.floats[i % (BYTES / 4)] = random_float(&rng, -0.5f, 1.5f);
            else memory.words[i] = (uint16_t)txm_rng_next(&rng);
        }
        if (seed % 2) {
            m.pixels = txm_image_row(&m, height - 1);
            m.stride = -m.stride;
        }
        const size_t n = (size_t)width * (size_t)height;
        for (int use = 0; use < 3; use++) {
            size_t count = 0;
            memset(guarded, 77, sizeof guarded);
            const size_t said = txm_mask_read(&m, (txm_mask_use)use, guarded + 1);
            assert_int_equal(guarded[0], 77);
            assert_int_equal(guarded[n + 1], 77);
            for (size_t i = 0; i < n; i++) {
                const int half = txm_mask_at(&m, (int)(i % (size_t)width), (int)(i / (size_t)width));
                const int is = guarded[i + 1] == 255;
                assert_true(is || guarded[i + 1] == 0);
                if (use == TXM_MASK_DIVIDES) assert_int_equal(is, half);
                if (use == TXM_MASK_ALLOWS) assert_true(!is || half);
                if (use == TXM_MASK_REPLACES) assert_true(is || !half);
                count += (size_t)is;
            }
            assert_int_equal(said, count);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_forms),  cmocka_unit_test(test_half),  cmocka_unit_test(test_antialiased),
        cmocka_unit_test(test_blurred), cmocka_unit_test(test_noise), cmocka_unit_test(test_mixed),
        cmocka_unit_test(test_grays),
        cmocka_unit_test(test_check),  cmocka_unit_test(test_random),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
