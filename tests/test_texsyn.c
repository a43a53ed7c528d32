/* test_texsyn.c - clique models: learning, files, synthesis; bad input, failing memory, cancelling
   SPDX-License-Identifier: MIT OR Unlicense

   cc -std=c99 -I. -Itests tests/test_texsyn.c -lcmocka -lpthread -lm                         */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define TEXSYN_IMPLEMENTATION
#include "texsyn.h"

#include "testkit.h"

/* ---- helpers ---------------------------------------------------------------------------- */

enum { FILL = 0x5c }; /* what output pixels hold before a call */

static void assert_near(double a, double b, double tolerance) {
    if (!(fabs(a - b) <= tolerance)) fail_msg("%.9g is not %.9g within %g", a, b, tolerance);
}

static void assert_between(double x, double low, double high) {
    if (!(x >= low && x <= high)) fail_msg("%.9g is not between %g and %g", x, low, high);
}

static txm_image view(void *pixels, int width, int height, int channels) {
    txm_image im;
    memset(&im, 0, sizeof im);
    im.pixels = pixels;
    im.width = width;
    im.height = height;
    im.channels = channels;
    return im;
}

static txm_image view_float(float *pixels, int width, int height, int channels) {
    txm_image im = view(pixels, width, height, channels);
    im.sample = TXM_F32;
    return im;
}

static txm_image view_words(uint16_t *pixels, int width, int height, int channels) {
    txm_image im = view(pixels, width, height, channels);
    im.sample = TXM_U16;
    return im;
}

/* Patches of one value: a pixel is the one to its left, the one above, or new, of `values` values
   that are `step` apart. The channels repeat each other in part; alpha is one of two values. */
static void draw_patches(uint8_t *p, int width, int height, int channels, int values, int step,
                         uint64_t seed) {
    txm_rng rng = txm_rng_make(seed, 0);
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++, p += channels) {
            const uint32_t choice = txm_rng_below(&rng, 10);
            const uint8_t *from = choice < 4 && x ? p - channels
                                  : choice < 8 && y ? p - (ptrdiff_t)width * channels
                                                    : NULL;
            int v = (int)txm_rng_below(&rng, (uint32_t)values) * step;
            for (int c = 0; c < channels; c++) {
                if (c == 3) v = v / 4 * 4 > 60 ? 250 : 20;
                p[c] = from ? from[c] : (uint8_t)v;
                if (c == 1) v = (int)txm_rng_below(&rng, (uint32_t)values) * step;
            }
        }
    }
}

/* Smooth clouds of a few pixels: means of 5 x 5 random values, stretched. */
static void draw_smooth(uint8_t *p, int width, int height, uint64_t seed) {
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            int sum = 0;
            for (int v = 0; v < 5; v++)
                for (int u = 0; u < 5; u++)
                    sum += (int)(txm_hash(txm_hash((uint64_t)(x + u) + seed * 977) +
                                          (uint64_t)(y + v)) >>
                                 56);
            *p++ = (uint8_t)txm_clampi(128 + (sum / 25 - 128) * 4, 0, 255);
        }
    }
}

static texsyn_learn_desc learn_desc(txm_image example, int max_types) {
    texsyn_learn_desc d;
    memset(&d, 0, sizeof d);
    d.example = example;
    d.max_types = max_types;
    return d;
}

static texsyn_model *learn(const texsyn_learn_desc *desc) {
    tk_progress progress = {0};
    txm_env env = tk_env(NULL, &progress);
    texsyn_model *model = NULL;
    const txm_status status = texsyn_learn(desc, &env, &model);
    if (status != TXM_OK) fail_msg("learn: %d, %s", status, env.message);
    assert_non_null(model);
    assert_int_equal(progress.errors, 0);
    return model;
}

/* A small model: 48 x 48 patches, few clique types. */
static texsyn_model *small_model(int channels, int levels) {
    static uint8_t pixels[48 * 48 * 4];
    draw_patches(pixels, 48, 48, channels, 8, 30, 3);
    texsyn_learn_desc d = learn_desc(view(pixels, 48, 48, channels), 3);
    d.levels = levels;
    return learn(&d);
}

static texsyn_synth_desc synth_desc(const texsyn_model *model, int width, int height) {
    texsyn_synth_desc d;
    memset(&d, 0, sizeof d);
    d.model = model;
    d.width = width;
    d.height = height;
    return d;
}

static void synthesize(const texsyn_synth_desc *desc, txm_image out) {
    tk_progress progress = {0};
    txm_env env = tk_env(NULL, &progress);
    const txm_status status = texsyn_synthesize(desc, &env, out);
    if (status != TXM_OK) fail_msg("synthesize: %d, %s", status, env.message);
    assert_int_equal(progress.errors, 0);
}

typedef struct saved {
    size_t size;
    uint8_t bytes[1 << 15];
} saved;

static void save(const texsyn_model *model, saved *s) {
    assert_int_equal(texsyn_save(model, NULL, s->bytes, sizeof s->bytes, &s->size), TXM_OK);
}

static void assert_same_saved(const texsyn_model *a, const texsyn_model *b) {
    static saved s, t;
    save(a, &s);
    save(b, &t);
    assert_int_equal(s.size, t.size);
    assert_memory_equal(s.bytes, t.bytes, s.size);
}

static uint32_t crc32(const uint8_t *bytes, size_t count) {
    uint32_t crc = 0xffffffffu;
    for (size_t i = 0; i < count; i++) {
        crc ^= bytes[i];
        for (int k = 0; k < 8; k++) crc = crc & 1 ? crc >> 1 ^ 0xedb88320u : crc >> 1;
    }
    return ~crc;
}

static void repair_crc(uint8_t *bytes, size_t size) {
    const uint32_t crc = crc32(bytes, size - 4);
    for (int i = 0; i < 4; i++) bytes[size - 4 + (size_t)i] = (uint8_t)(crc >> 8 * i);
}

/* ---- learning: arguments ---------------------------------------------------------------- */

static void refuses_learn(const texsyn_learn_desc *desc, txm_status expected, const char *what) {
    tk_memory memory = {0};
    tk_progress progress = {0};
    txm_env env = tk_env(&memory, &progress);
    texsyn_model *model = (texsyn_model *)&memory;
    const txm_status status = texsyn_learn(desc, &env, &model);
    if (status != expected) fail_msg("%s: status %d, not %d", what, status, expected);
    if (model) fail_msg("%s: *out is not NULL", what);
    if (!env.message[0]) fail_msg("%s: no message", what);
    assert_int_equal(tk_leaks(&memory), 0);
    assert_int_equal(progress.calls, 0);
    assert_int_equal(texsyn_learn(desc, NULL, &model), expected);
}

#define REFUSES(field, value, expected)                   \
    do {                                                  \
        texsyn_learn_desc d = good;                       \
        d.field = value;                                  \
        refuses_learn(&d, expected, #field " = " #value); \
    } while (0)

static void test_learn_bad_arguments(void **state) {
    (void)state;
    static uint8_t pixels[32 * 32 * 4], mask[32 * 32];
    texsyn_learn_desc good = learn_desc(view(pixels, 32, 32, 3), 1);
    txm_env env;
    memset(&env, 0, sizeof env);
    memset(mask, 255, sizeof mask);
    assert_int_equal(texsyn_learn(&good, &env, NULL), TXM_BAD_ARGUMENT);
    assert_true(env.message[0] != 0);
    refuses_learn(NULL, TXM_BAD_ARGUMENT, "desc NULL");
    REFUSES(example.pixels, NULL, TXM_BAD_ARGUMENT);
    REFUSES(example.width, 0, TXM_BAD_ARGUMENT);
    REFUSES(example.width, -1, TXM_BAD_ARGUMENT);
    REFUSES(example.width, INT_MIN, TXM_BAD_ARGUMENT);
    REFUSES(example.height, 0, TXM_BAD_ARGUMENT);
    REFUSES(example.height, -1, TXM_BAD_ARGUMENT);
    REFUSES(example.width, INT_MAX, TXM_TOO_LARGE);
    REFUSES(example.height, INT_MAX, TXM_TOO_LARGE);
    REFUSES(example.height, TEXSYN_MAX_PIXELS / 32 + 1, TXM_TOO_LARGE);
    REFUSES(example.width, 15, TXM_TOO_SMALL);
    REFUSES(example.height, 15, TXM_TOO_SMALL);
    REFUSES(example.height, 1, TXM_TOO_SMALL);
    REFUSES(example.channels, -1, TXM_BAD_ARGUMENT);
    REFUSES(example.channels, 2, TXM_BAD_ARGUMENT);
    REFUSES(example.channels, 5, TXM_BAD_ARGUMENT);
    REFUSES(example.sample, (txm_sample)7, TXM_BAD_ARGUMENT);
    REFUSES(example.stride, 95, TXM_BAD_ARGUMENT);
    REFUSES(example.stride, -95, TXM_BAD_ARGUMENT);
    REFUSES(example.stride, PTRDIFF_MAX, TXM_TOO_LARGE);
    REFUSES(max_distance, -1, TXM_BAD_ARGUMENT);
    REFUSES(max_distance, 1, TXM_BAD_ARGUMENT);
    REFUSES(max_distance, 61, TXM_BAD_ARGUMENT);
    REFUSES(max_types, -1, TXM_BAD_ARGUMENT);
    REFUSES(max_types, 61, TXM_BAD_ARGUMENT);
    REFUSES(levels, -1, TXM_BAD_ARGUMENT);
    REFUSES(levels, 7, TXM_BAD_ARGUMENT);
    REFUSES(threshold, -0.001f, TXM_BAD_ARGUMENT);
    REFUSES(threshold, (float)NAN, TXM_BAD_ARGUMENT);
    REFUSES(threshold, (float)INFINITY, TXM_BAD_ARGUMENT);

    good.mask = view(mask, 32, 32, 1);
    REFUSES(mask.width, 31, TXM_BAD_ARGUMENT);
    REFUSES(mask.width, 0, TXM_BAD_ARGUMENT);
    REFUSES(mask.height, 33, TXM_BAD_ARGUMENT);
    REFUSES(mask.height, -1, TXM_BAD_ARGUMENT);
    REFUSES(mask.channels, 2, TXM_BAD_ARGUMENT);
    REFUSES(mask.channels, -1, TXM_BAD_ARGUMENT);
    REFUSES(mask.stride, 31, TXM_BAD_ARGUMENT);
    REFUSES(mask.sample, (txm_sample)7, TXM_BAD_ARGUMENT);
    static float float_mask[32 * 32];
    static uint16_t deep_mask[32 * 32];
    good.mask = view_float(float_mask, 32, 32, 1);
    REFUSES(max_types, 0, TXM_BAD_ARGUMENT);
    good.mask = view_words(deep_mask, 32, 32, 1);
    REFUSES(max_types, 0, TXM_BAD_ARGUMENT);
}

static void test_learn_bad_floats(void **state) {
    (void)state;
    static float pixels[16 * 16];
    const texsyn_learn_desc good = learn_desc(view_float(pixels, 16, 16, 1), 1);
    const float bad[] = {(float)NAN, (float)INFINITY, -(float)INFINITY, 2e6f, -2e6f, 3e38f};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        for (int at = 0; at < 256; at += 51) {
            pixels[at] = bad[i];
            refuses_learn(&good, TXM_BAD_ARGUMENT, "a float sample");
            pixels[at] = 0;
        }
    }
    REFUSES(example.stride, 66, TXM_BAD_ARGUMENT); /* not a multiple of 4 */
    for (int i = 0; i < 256; i++) pixels[i] = (float)(i % 7) * 1e6f / 6; /* the largest allowed */
    texsyn_model *model = learn(&good);
    static float out[20 * 20];
    const texsyn_synth_desc d = synth_desc(model, 20, 20);
    synthesize(&d, view_float(out, 20, 20, 1));
    for (int i = 0; i < 400; i++) assert_between((double)out[i], -2e4, 1.02e6);
    texsyn_free(model);
}

static void test_learn_masks(void **state) {
    (void)state;
    static uint8_t pixels[32 * 32], mask[32 * 32], out[24 * 24];
    draw_patches(pixels, 32, 32, 1, 8, 30, 1);
    texsyn_learn_desc d = learn_desc(view(pixels, 32, 32, 1), 2);
    d.mask = view(mask, 32, 32, 0);
    refuses_learn(&d, TXM_TOO_SMALL, "an empty mask");
    memset(mask, 1, 255);
    refuses_learn(&d, TXM_TOO_SMALL, "a mask of 255 pixels");
    mask[255] = 1;
    texsyn_free(learn(&d));

    /* ragged: no two neighbours, then no two pixels within 2, then lone columns */
    for (int kind = 0; kind < 3; kind++) {
        for (int i = 0; i < 32 * 32; i++) {
            const int x = i % 32, y = i / 32;
            mask[i] = kind == 0 ? (x + y) % 2 : kind == 1 ? x % 2 && y % 2 : x % 4 == 1;
        }
        for (int levels = 1; levels <= 2; levels++) {
            d.levels = levels;
            texsyn_model *model = learn(&d);
            texsyn_clique clique;
            assert_int_equal(texsyn_level_count(model), 1);
            for (int i = 0; i < texsyn_clique_count(model); i++) {
                assert_true(texsyn_clique_at(model, i, &clique, NULL, 0) > 0);
                if (kind == 0 && clique.kind == TEXSYN_PAIR)
                    assert_int_equal((clique.dx + clique.dy) % 2, 0);
            }
            const texsyn_synth_desc s = synth_desc(model, 24, 24);
            synthesize(&s, view(out, 24, 24, 1));
            texsyn_free(model);
        }
    }
}

/* What lies outside the mask has no say; what is learned looks like the inside. */
static void test_learn_half(void **state) {
    (void)state;
    enum { W = 128, H = 64 };
    static uint8_t pixels[W * H], half[W / 2 * H], mask[W * H], out[96 * 96];
    double mean = 0, mean_out = 0, histogram[256] = {0}, histogram_out[256] = {0};
    draw_patches(half, W / 2, H, 1, 10, 10, 5);
    for (int y = 0; y < H; y++) {
        for (int x = 0; x < W; x++) {
            const int left = x < W / 2;
            pixels[y * W + x] = (uint8_t)(left ? 100 + half[y * W / 2 + x] : (x + y) % 5 * 12);
            mask[y * W + x] = left ? (uint8_t)(1 + x % 255) : 0;
            if (!left) continue;
            mean += pixels[y * W + x] / (W / 2.0 * H);
            histogram[pixels[y * W + x]] += 1 / (W / 2.0 * H);
        }
    }
    texsyn_learn_desc d = learn_desc(view(pixels, W, H, 1), 6);
    d.mask = view(mask, W, H, 1);
    for (d.levels = 1; d.levels <= 2; d.levels++) {
        texsyn_model *model = learn(&d);
        const texsyn_synth_desc s = synth_desc(model, 96, 96);
        synthesize(&s, view(out, 96, 96, 1));
        mean_out = 0;
        memset(histogram_out, 0, sizeof histogram_out);
        for (int i = 0; i < 96 * 96; i++) {
            assert_between(out[i], 98, 192);
            mean_out += out[i] / (96.0 * 96);
            histogram_out[(out[i] + 5) / 10 * 10] += 1 / (96.0 * 96);
        }
        assert_near(mean_out, mean, 3);
        for (int i = 100; i < 200; i += 10) assert_near(histogram_out[i], histogram[i], 0.03);
        texsyn_free(model);
    }
    d.levels = 1;
    texsyn_model *a = learn(&d);
    for (int i = 0; i < W * H; i++)
        if (!mask[i]) pixels[i] = (uint8_t)(i * 31);
    texsyn_model *b = learn(&d);
    assert_same_saved(a, b);
    texsyn_free(a);
    texsyn_free(b);
}

/* ---- learning: examples of all kinds ----------------------------------------------------- */

static void test_learn_kinds(void **state) {
    (void)state;
    static uint8_t pixels[40 * 32 * 4], out[50 * 40 * 4];
    static uint16_t words[40 * 32 * 4];
    static float floats[40 * 32 * 4];
    for (int channels = 1; channels <= 4; channels++) {
        if (channels == 2) continue;
        draw_patches(pixels, 40, 32, channels, 16, 12, 9);
        for (int i = 0; i < 40 * 32 * channels; i++) {
            words[i] = (uint16_t)(257 * pixels[i]);
            floats[i] = (float)pixels[i] / 255.0f;
        }
        texsyn_learn_desc d = learn_desc(view(pixels, 40, 32, channels), 4);
        texsyn_model *model = learn(&d);
        assert_int_equal(texsyn_channels(model), channels);
        assert_int_equal(texsyn_level_count(model), 1);
        assert_between(texsyn_band_count(model), channels > 1 ? 2 : 1, channels);
        const texsyn_synth_desc s = synth_desc(model, 50, 40);
        synthesize(&s, view(out, 50, 40, channels));

        /* means of the channels */
        for (int c = 0; c < channels; c++) {
            double mean = 0, mean_out = 0;
            for (int i = 0; i < 40 * 32; i++) mean += pixels[i * channels + c] / (40.0 * 32);
            for (int i = 0; i < 50 * 40; i++) mean_out += out[i * channels + c] / (50.0 * 40);
            assert_near(mean_out, mean, 12);
        }

        /* the same samples as floats or with 16 bits: the same model */
        for (int i = 0; i < 2; i++) {
            d.example = i ? view_words(words, 40, 32, channels) : view_float(floats, 40, 32, channels);
            texsyn_model *other = learn(&d);
            assert_same_saved(model, other);
            texsyn_free(other);
        }
        texsyn_free(model);
    }
    assert_int_equal(texsyn_channels(NULL), 0);
    assert_int_equal(texsyn_level_count(NULL), 0);
    assert_int_equal(texsyn_band_count(NULL), 0);
    assert_int_equal(texsyn_clique_count(NULL), 0);
    assert_int_equal(texsyn_clique_at(NULL, 0, NULL, NULL, 0), 0);
    texsyn_free(NULL);
}

static void test_learn_flat(void **state) {
    (void)state;
    static const uint8_t colours[][4] = {{77, 200, 33, 128}, {0, 0, 0, 0}, {255, 255, 255, 255},
                                         {1, 254, 3, 200}};
    static uint8_t pixels[24 * 20 * 4], out[33 * 17 * 4];
    for (size_t k = 0; k < sizeof colours / sizeof *colours; k++) {
        for (int channels = 1; channels <= 4; channels++) {
            if (channels == 2) continue;
            for (int i = 0; i < 24 * 20 * channels; i++) pixels[i] = colours[k][i % channels];
            const texsyn_learn_desc d = learn_desc(view(pixels, 24, 20, channels), 2);
            texsyn_model *model = learn(&d);
            const texsyn_synth_desc s = synth_desc(model, 33, 17);
            synthesize(&s, view(out, 33, 17, channels));
            for (int i = 0; i < 33 * 17 * channels; i++)
                assert_int_equal(out[i], colours[k][i % channels]);
            texsyn_free(model);
        }
    }
}

static void test_learn_two_values(void **state) {
    (void)state;
    static uint8_t pixels[64 * 64], out[100 * 80];
    draw_patches(pixels, 64, 64, 1, 2, 255, 4);
    const texsyn_learn_desc d = learn_desc(view(pixels, 64, 64, 1), 6);
    texsyn_model *model = learn(&d);
    for (int tileable = 0; tileable < 2; tileable++) {
        texsyn_synth_desc s = synth_desc(model, 100, 80);
        double white = 0;
        s.tileable = tileable;
        synthesize(&s, view(out, 100, 80, 1));
        for (int i = 0; i < 100 * 80; i++) {
            if (out[i] != 0 && out[i] != 255) fail_msg("pixel %d is %d", i, out[i]);
            white += out[i] / (255.0 * 100 * 80);
        }
        assert_between(white, 0.4, 0.6);
    }
    texsyn_free(model);
}

static void test_learn_constant_alpha(void **state) {
    (void)state;
    static uint8_t pixels[32 * 32 * 4], out[40 * 40 * 4];
    draw_patches(pixels, 32, 32, 4, 8, 30, 4);
    for (int i = 0; i < 32 * 32; i++) pixels[4 * i + 3] = 200;
    const texsyn_learn_desc d = learn_desc(view(pixels, 32, 32, 4), 2);
    texsyn_model *model = learn(&d);
    assert_between(texsyn_band_count(model), 1, 3); /* alpha needs none */
    const texsyn_synth_desc s = synth_desc(model, 40, 40);
    synthesize(&s, view(out, 40, 40, 4));
    for (int i = 0; i < 40 * 40; i++) assert_int_equal(out[4 * i + 3], 200);
    texsyn_free(model);
}

static void test_learn_strides(void **state) {
    (void)state;
    static uint8_t packed[40 * 32 * 3], padded[140 * 32], mask[40 * 32], mask_padded[50 * 32];
    draw_patches(packed, 40, 32, 3, 8, 30, 6);
    texsyn_learn_desc d = learn_desc(view(packed, 40, 32, 3), 2);
    for (int i = 0; i < 40 * 32; i++) mask[i] = i % 40 < 30;
    d.mask = view(mask, 40, 32, 1);
    texsyn_model *model = learn(&d);
    for (int flip = 0; flip < 2; flip++) {
        memset(padded, 99, sizeof padded);
        memset(mask_padded, 1, sizeof mask_padded);
        for (int y = 0; y < 32; y++) {
            const int row = flip ? 31 - y : y;
            memcpy(padded + 140 * row, packed + 120 * y, 120);
            memcpy(mask_padded + 50 * row, mask + 40 * y, 40);
        }
        d.example.pixels = padded + (flip ? 140 * 31 : 0);
        d.example.stride = flip ? -140 : 140;
        d.mask.pixels = mask_padded + (flip ? 50 * 31 : 0);
        d.mask.stride = flip ? -50 : 50;
        texsyn_model *other = learn(&d);
        assert_same_saved(model, other);
        texsyn_free(other);
    }

    /* and on the way out: the bytes between the rows stay as they are */
    static uint8_t plain[21 * 10 * 3], out[80 * 10];
    const texsyn_synth_desc s = synth_desc(model, 21, 10);
    synthesize(&s, view(plain, 21, 10, 3));
    for (int flip = 0; flip < 2; flip++) {
        txm_image im = view(out + (flip ? 80 * 9 : 0), 21, 10, 3);
        im.stride = flip ? -80 : 80;
        memset(out, FILL, sizeof out);
        synthesize(&s, im);
        for (int y = 0; y < 10; y++) {
            const uint8_t *row = out + 80 * (flip ? 9 - y : y);
            assert_memory_equal(row, plain + 63 * y, 63);
            for (int x = 63; x < 80; x++) assert_int_equal(row[x], FILL);
        }
    }
    texsyn_free(model);
}

/* ---- learning: the neighbourhood system -------------------------------------------------- */

/* The clique types of a level in the order of the model; counts of the preselected. */
static void check_preselected(const texsyn_model *model, int level, int *others) {
    const int bands = texsyn_band_count(model), top = level + 1 == texsyn_level_count(model);
    int single[4] = {0}, right[4] = {0}, down[4] = {0}, parent[4] = {0}, between[4][4] = {{0}};
    *others = 0;
    for (int i = 0; i < texsyn_clique_count(model); i++) {
        texsyn_clique c;
        assert_true(texsyn_clique_at(model, i, &c, NULL, 0) > 0);
        assert_between(c.level, 0, texsyn_level_count(model) - 1);
        assert_between(c.band, 0, bands - 1);
        assert_between(c.other, 0, bands - 1);
        if (c.level != level) continue;
        const int same = c.band == c.other;
        if (c.kind == TEXSYN_SINGLE) single[c.band]++;
        else if (c.kind == TEXSYN_PAIR && same && c.dx == 1 && c.dy == 0) right[c.band]++;
        else if (c.kind == TEXSYN_PAIR && same && c.dx == 0 && c.dy == 1) down[c.band]++;
        else if (c.kind == TEXSYN_PARENT) parent[c.band]++;
        else if (c.kind == TEXSYN_VALUES && !same && !c.dx && !c.dy) between[c.band][c.other]++;
        else ++*others;
        if (top) assert_true(c.kind != TEXSYN_PARENT && c.kind != TEXSYN_SCALE);
    }
    for (int b = 0; b < bands; b++) {
        assert_int_equal(single[b], 1);
        assert_int_equal(right[b], top ? 1 : 2); /* within and across pixels of the level above */
        assert_int_equal(down[b], top ? 1 : 2);
        assert_int_equal(parent[b], !top);
        for (int o = 0; o < bands; o++) assert_int_equal(between[b][o], b < o);
    }
}

static void test_learn_options(void **state) {
    (void)state;
    static uint8_t pixels[64 * 64 * 3];
    draw_patches(pixels, 64, 64, 3, 20, 12, 8);
    static const struct {
        int distance, types, levels;
    } cases[] = {{2, 3, 1}, {4, 7, 2}, {16, 1, 3}, {5, 12, 2}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        texsyn_learn_desc d = learn_desc(view(pixels, 64, 64, 3), cases[i].types);
        d.max_distance = cases[i].distance;
        d.levels = cases[i].levels;
        texsyn_model *model = learn(&d);
        assert_int_equal(texsyn_level_count(model), cases[i].levels);
        for (int level = 0; level < cases[i].levels; level++) {
            int others = 0;
            check_preselected(model, level, &others);
            assert_between(others, 1, cases[i].types);
        }
        for (int k = 0; k < texsyn_clique_count(model); k++) {
            texsyn_clique c;
            texsyn_clique_at(model, k, &c, NULL, 0);
            const int reach = cases[i].distance >> c.level < 2 ? 2 : cases[i].distance >> c.level;
            if (c.kind == TEXSYN_PAIR || c.kind == TEXSYN_VALUES)
                assert_between(c.dx * c.dx + c.dy * c.dy, 0, reach * reach);
        }
        texsyn_free(model);
    }

    /* as many levels as the example has room for; a threshold that nothing passes */
    texsyn_learn_desc d = learn_desc(view(pixels, 32, 32, 1), 5);
    d.levels = 6;
    d.threshold = 2;
    texsyn_model *model = learn(&d);
    assert_int_equal(texsyn_level_count(model), 3);
    for (int level = 0; level < 3; level++) {
        int others = 0;
        check_preselected(model, level, &others);
        assert_int_equal(others, 0);
    }
    texsyn_free(model);

    /* the default number of levels leaves the short side at 64 or more */
    static uint8_t large[256 * 128];
    draw_smooth(large, 256, 128, 1);
    d = learn_desc(view(large, 256, 128, 1), 1);
    model = learn(&d);
    assert_int_equal(texsyn_level_count(model), 2);
    texsyn_free(model);

    /* the seed counts, and only the seed */
    d = learn_desc(view(large, 64, 64, 1), 2);
    d.example.stride = 256;
    texsyn_model *a = learn(&d), *b = learn(&d);
    static saved s, t;
    assert_same_saved(a, b);
    save(a, &s);
    texsyn_free(b);
    d.seed = UINT64_MAX;
    b = learn(&d);
    save(b, &t);
    assert_true(s.size != t.size || memcmp(s.bytes, t.bytes, s.size) != 0);
    texsyn_free(a);
    texsyn_free(b);
}

/* ---- statistics --------------------------------------------------------------------------- */

/* Differences, in steps of 8, of pixels (dx, dy) apart inside an image: 63 bins. */
static void count_differences(const uint8_t *p, int width, int height, int dx, int dy,
                              double bins[63]) {
    double total = 0;
    memset(bins, 0, 63 * sizeof *bins);
    for (int y = 0; y + dy < height; y++) {
        for (int x = dx < 0 ? -dx : 0; x < width && x + dx < width; x++, total++) {
            const int difference = p[(y + dy) * width + x + dx] - p[y * width + x];
            bins[txm_clampi((int)floor(difference / 8.0 + 0.5) + 31, 0, 62)]++;
        }
    }
    for (int i = 0; i < 63; i++) bins[i] /= total;
}

static double bins_distance(const double *a, const double *b, int count) {
    double sum = 0;
    for (int i = 0; i < count; i++) sum += (a[i] - b[i]) * (a[i] - b[i]);
    return sqrt(sum);
}

/* A file keeps square roots of shares in steps of 1/scale. */
static void check_bins(const float *bins, const double *counted, int count, double scale) {
    double sum = 0;
    for (int i = 0; i < count; i++) {
        assert_between((double)bins[i], 0, 1);
        assert_near(sqrt((double)bins[i]), sqrt(counted[i]), 0.8 / scale);
        sum += (double)bins[i];
    }
    assert_near(sum, 1, 0.002);
}

static void test_statistics(void **state) {
    (void)state;
    enum { SIDE = 96, OUT = 128 };
    static uint8_t pixels[SIDE * SIDE], out[OUT * OUT];
    static const int displacements[][2] = {{1, 0}, {0, 1}, {1, 1}, {-1, 1}, {2, 0}, {0, 2}};
    draw_patches(pixels, SIDE, SIDE, 1, 32, 8, 12); /* quantised as it is: 32 values, 8 apart */
    texsyn_learn_desc d = learn_desc(view(pixels, SIDE, SIDE, 1), 12);
    d.levels = 1;
    texsyn_model *model = learn(&d);

    /* the model's figures are the example's, which we count ourselves */
    int singles = 0, pairs = 0;
    for (int i = 0; i < texsyn_clique_count(model); i++) {
        texsyn_clique c;
        float bins[100];
        double counted[81] = {0};
        for (int k = 0; k < 100; k++) bins[k] = -7;
        const int n = texsyn_clique_at(model, i, &c, bins, 100);
        for (int k = n; k < 100; k++) assert_true(bins[k] < -6);
        assert_int_equal(c.level, 0);
        if (c.kind == TEXSYN_SINGLE) {
            assert_int_equal(n, 32);
            for (int k = 0; k < SIDE * SIDE; k++)
                counted[pixels[k] / 8] += 1 / (double)(SIDE * SIDE);
            check_bins(bins, counted, 32, 160);
            singles++;
        } else if (c.kind == TEXSYN_PAIR) {
            assert_int_equal(n, 63);
            count_differences(pixels, SIDE, SIDE, c.dx, c.dy, counted);
            check_bins(bins, counted, 63, 48);
            pairs++;
        } else {
            double sum = 0;
            assert_int_equal(n, 81);
            for (int k = 0; k < n; k++) sum += (double)bins[k];
            assert_near(sum, 1, 0.002);
        }
        float few[4] = {-7, -7, -7, -7}; /* no more bins than asked for */
        assert_int_equal(texsyn_clique_at(model, i, NULL, few, 2), n);
        assert_true(few[1] >= 0 && few[2] < -6);
    }
    assert_int_equal(singles, 1);
    assert_true(pairs >= 2);
    assert_int_equal(texsyn_clique_at(model, -1, NULL, NULL, 0), 0);
    assert_int_equal(texsyn_clique_at(model, texsyn_clique_count(model), NULL, NULL, 0), 0);
    assert_int_equal(texsyn_clique_at(model, INT_MAX, NULL, NULL, 0), 0);

    /* so are the synthesised image's; a shuffled one has the same pixels and fails by far */
    const texsyn_synth_desc s = synth_desc(model, OUT, OUT);
    synthesize(&s, view(out, OUT, OUT, 1));
    double example[63], made[63];
    for (size_t i = 0; i < sizeof displacements / sizeof *displacements; i++) {
        const int *v = displacements[i];
        count_differences(pixels, SIDE, SIDE, v[0], v[1], example);
        count_differences(out, OUT, OUT, v[0], v[1], made);
        if (!(bins_distance(example, made, 63) < 0.04))
            fail_msg("(%d, %d): distance %g", v[0], v[1], bins_distance(example, made, 63));
    }
    txm_rng rng = txm_rng_make(1, 1);
    for (int i = OUT * OUT - 1; i > 0; i--) {
        const uint32_t j = txm_rng_below(&rng, (uint32_t)i + 1);
        const uint8_t pixel = out[i];
        out[i] = out[j];
        out[j] = pixel;
    }
    for (size_t i = 0; i < sizeof displacements / sizeof *displacements; i++) {
        const int *v = displacements[i];
        count_differences(pixels, SIDE, SIDE, v[0], v[1], example);
        count_differences(out, OUT, OUT, v[0], v[1], made);
        assert_true(bins_distance(example, made, 63) > 0.08);
    }
    texsyn_free(model);
}

/* ---- models as bytes ---------------------------------------------------------------------- */

static void test_save_and_load(void **state) {
    (void)state;
    static saved s, again;
    static uint8_t a[40 * 30 * 4], b[40 * 30 * 4];
    for (int channels = 1; channels <= 4; channels++) {
        if (channels == 2) continue;
        texsyn_model *model = small_model(channels, channels == 1 ? 1 : 2), *loaded = NULL;
        size_t size = 0;
        assert_int_equal(texsyn_save(model, NULL, NULL, 0, &size), TXM_OK);
        save(model, &s);
        assert_int_equal(s.size, size);
        assert_int_equal(crc32(s.bytes, size - 4), (uint32_t)s.bytes[size - 4] |
                                                       (uint32_t)s.bytes[size - 3] << 8 |
                                                       (uint32_t)s.bytes[size - 2] << 16 |
                                                       (uint32_t)s.bytes[size - 1] << 24);
        uint8_t *exact = (uint8_t *)malloc(size); /* the sanitizer sees any read beyond */
        assert_non_null(exact);
        memcpy(exact, s.bytes, size);
        assert_int_equal(texsyn_load(exact, size, NULL, &loaded), TXM_OK);
        free(exact);
        save(loaded, &again);
        assert_int_equal(again.size, size);
        assert_memory_equal(again.bytes, s.bytes, size);

        /* all that one can see is the same */
        assert_int_equal(texsyn_channels(loaded), channels);
        assert_int_equal(texsyn_level_count(loaded), texsyn_level_count(model));
        assert_int_equal(texsyn_band_count(loaded), texsyn_band_count(model));
        assert_int_equal(texsyn_clique_count(loaded), texsyn_clique_count(model));
        for (int i = 0; i < texsyn_clique_count(model); i++) {
            texsyn_clique c, e;
            float bins[81] = {0}, others[81] = {0};
            assert_int_equal(texsyn_clique_at(model, i, &c, bins, 81),
                             texsyn_clique_at(loaded, i, &e, others, 81));
            assert_memory_equal(&c, &e, sizeof c);
            assert_memory_equal(bins, others, sizeof bins);
        }
        texsyn_synth_desc d = synth_desc(model, 40, 30);
        synthesize(&d, view(a, 40, 30, channels));
        d.model = loaded;
        synthesize(&d, view(b, 40, 30, channels));
        assert_memory_equal(a, b, (size_t)(40 * 30 * channels));

        /* a buffer that is too small keeps its neighbours */
        for (size_t capacity = 0; capacity < size; capacity += capacity < 12 ? 1 : 37) {
            uint8_t *buffer = (uint8_t *)malloc(capacity + 1);
            assert_non_null(buffer);
            buffer[capacity] = FILL;
            size_t needed = 0;
            txm_env env;
            memset(&env, 0, sizeof env);
            assert_int_equal(texsyn_save(model, &env, buffer, capacity, &needed), TXM_TOO_SMALL);
            assert_true(env.message[0] != 0);
            assert_int_equal(needed, size);
            assert_int_equal(buffer[capacity], FILL);
            free(buffer);
        }
        uint8_t *buffer = (uint8_t *)malloc(size);
        assert_int_equal(texsyn_save(model, NULL, buffer, size, &size), TXM_OK);
        assert_memory_equal(buffer, s.bytes, size);
        free(buffer);

        assert_int_equal(texsyn_save(NULL, NULL, NULL, 0, &size), TXM_BAD_ARGUMENT);
        assert_int_equal(texsyn_save(model, NULL, NULL, 0, NULL), TXM_BAD_ARGUMENT);
        texsyn_model *none = model;
        assert_int_equal(texsyn_load(NULL, 10, NULL, &none), TXM_BAD_ARGUMENT);
        assert_null(none);
        assert_int_equal(texsyn_load(s.bytes, size, NULL, NULL), TXM_BAD_ARGUMENT);
        texsyn_free(loaded);
        texsyn_free(model);
    }
}

static void refuses_load(const uint8_t *bytes, size_t size) {
    tk_memory memory = {0};
    txm_env env = tk_env(&memory, NULL);
    texsyn_model *model = (texsyn_model *)&memory;
    uint8_t *exact = (uint8_t *)malloc(size ? size : 1);
    assert_non_null(exact);
    memcpy(exact, bytes, size);
    assert_int_equal(texsyn_load(exact, size, &env, &model), TXM_BAD_DATA);
    assert_null(model);
    assert_true(env.message[0] != 0);
    assert_int_equal(tk_leaks(&memory), 0);
    free(exact);
}

static void test_load_damaged(void **state) {
    (void)state;
    static saved s;
    texsyn_model *model = small_model(3, 2);
    save(model, &s);
    texsyn_free(model);
    for (size_t size = 0; size < s.size; size++) refuses_load(s.bytes, size);
    for (size_t at = 0; at < s.size; at++) {
        for (int bit = 0; bit < 9; bit++) { /* each bit, then all of them */
            const uint8_t flip = (uint8_t)(bit < 8 ? 1 << bit : 255);
            s.bytes[at] ^= flip;
            refuses_load(s.bytes, s.size);
            s.bytes[at] ^= flip;
        }
    }
    s.bytes[s.size] = 0;
    refuses_load(s.bytes, s.size + 1); /* something behind the end */
    repair_crc(s.bytes, s.size + 1);
    refuses_load(s.bytes, s.size + 1); /* even under a good checksum */
    static uint8_t noise[4096];
    txm_rng rng = txm_rng_make(5, 5);
    for (int i = 0; i < 4096; i++) noise[i] = (uint8_t)txm_rng_next(&rng);
    memcpy(noise, "TXS1", 4);
    for (size_t size = 9; size < 4096; size += size < 200 ? 1 : 97) {
        repair_crc(noise, size);
        refuses_load(noise, size);
    }
}

/* Behind a repaired checksum anything may stand: it is refused, or it is a model that works. */
static void test_load_mutated(void **state) {
    (void)state;
    static saved s, again;
    static uint8_t bytes[1 << 15], out[32 * 32 * 4];
    enum { RUNS = 1000, SYNTHESES = 4 }; /* runs; one in so many that load synthesises */
    int loaded = 0, refused = 0;
    for (int channels = 1; channels <= 4; channels++) {
        if (channels == 2) continue;
        texsyn_model *model = small_model(channels, channels);
        txm_rng rng = txm_rng_make(77, (uint64_t)channels);
        save(model, &s);
        texsyn_free(model);
        for (int run = 0; run < RUNS; run++) {
            tk_memory memory = {0};
            txm_env env = tk_env(&memory, NULL);
            size_t size = s.size;
            memcpy(bytes, s.bytes, size);
            for (uint32_t n = 1 + txm_rng_below(&rng, 3); n > 0; n--) {
                /* the header, the middle, the last bytes: those change little */
                size_t at = txm_rng_below(&rng, (uint32_t)size - 4);
                const uint32_t where = txm_rng_below(&rng, 3);
                if (where == 0) at = 5 + at % 40;
                if (where == 1) at = size - 5 - at % 12;
                bytes[at] = (uint8_t)(txm_rng_below(&rng, 2)
                                          ? txm_rng_next(&rng)
                                          : bytes[at] ^ 1u << txm_rng_below(&rng, 8));
            }
            repair_crc(bytes, size);
            model = (texsyn_model *)&memory;
            const txm_status status = texsyn_load(bytes, size, &env, &model);
            if (status != TXM_OK) {
                assert_true(status == TXM_BAD_DATA || status == TXM_OUT_OF_MEMORY);
                assert_null(model);
                assert_true(env.message[0] != 0);
                refused++;
            } else {
                size_t written = 0;
                texsyn_clique c;
                for (int i = 0; i < texsyn_clique_count(model); i++)
                    assert_true(texsyn_clique_at(model, i, &c, NULL, 0) > 0);
                assert_int_equal(
                    texsyn_save(model, NULL, again.bytes, sizeof again.bytes, &written), TXM_OK);
                texsyn_synth_desc d = synth_desc(model, 32, 32);
                d.quality = -2;
                d.tileable = 1;
                if (loaded++ % SYNTHESES == 0)
                    assert_int_equal(
                        texsyn_synthesize(&d, NULL, view(out, 32, 32, texsyn_channels(model))),
                        TXM_OK);
                texsyn_free(model);
            }
            assert_int_equal(tk_leaks(&memory), 0);
            assert_true(memory.peak_bytes < 4u << 20);
        }
    }
    assert_true(loaded > 100); /* else the test tests nothing */
    assert_true(refused > 100);
}

/* ---- synthesis ---------------------------------------------------------------------------- */

static void test_synth_sizes(void **state) {
    (void)state;
    static const int sizes[][2] = {{1, 1},  {2, 2},   {1, 200}, {200, 1}, {17, 33},
                                   {3, 64}, {64, 65}, {7, 129}, {700, 300}};
    static uint8_t out[700 * 300 * 3 + 64];
    for (int levels = 1; levels <= 3; levels++) {
        texsyn_model *model = small_model(3, levels);
        for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
            for (int tileable = 0; tileable < 2; tileable++) {
                const int width = sizes[i][0], height = sizes[i][1];
                const size_t bytes = (size_t)(width * height * 3);
                texsyn_synth_desc d = synth_desc(model, width, height);
                d.tileable = tileable;
                d.quality = -2;
                memset(out, FILL, sizeof out);
                synthesize(&d, view(out, width, height, 3));
                for (size_t k = bytes; k < bytes + 64; k++) assert_int_equal(out[k], FILL);
            }
        }
        for (int quality = -2; quality <= 2; quality++) {
            texsyn_synth_desc d = synth_desc(model, 20, 20);
            d.quality = quality;
            synthesize(&d, view(out, 20, 20, 3));
        }
        texsyn_free(model);
    }
}

/* Mean difference across the border over the mean difference inside, summed over pictures. */
static void add_wrap(const uint8_t *p, int width, int height, double border[2], double inside[2]) {
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            const int right = x + 1 == width, bottom = y + 1 == height;
            const int v = p[y * width + x], u = p[y * width + (x + 1) % width];
            const int w = p[(y + 1) % height * width + x];
            *(right ? &border[0] : &inside[0]) += abs(u - v) / (double)(right ? 1 : width - 1);
            *(bottom ? &border[1] : &inside[1]) += abs(w - v) / (double)(bottom ? 1 : height - 1);
        }
    }
}

static void test_synth_tileable(void **state) {
    (void)state;
    static const struct {
        int levels, width, height; /* sides that halve evenly, and others */
    } cases[] = {{1, 131, 117}, {2, 132, 118}, {2, 131, 117}, {3, 120, 132}, {3, 129, 126}};
    static uint8_t pixels[128 * 128], out[132 * 132];
    draw_smooth(pixels, 128, 128, 2);
    double border[2] = {0, 0}, inside[2] = {0, 0};
    add_wrap(pixels, 128, 128, border, inside); /* the example does not tile, so it would show */
    assert_true(border[0] > 1.5 * inside[0] && border[1] > 1.5 * inside[1]);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const int width = cases[i].width, height = cases[i].height;
        texsyn_learn_desc d = learn_desc(view(pixels, 128, 128, 1), 5);
        d.levels = cases[i].levels;
        texsyn_model *model = learn(&d);
        memset(border, 0, sizeof border);
        memset(inside, 0, sizeof inside);
        for (uint64_t seed = 0; seed < 5; seed++) {
            texsyn_synth_desc s = synth_desc(model, width, height);
            s.tileable = 1;
            s.seed = seed;
            synthesize(&s, view(out, width, height, 1));
            add_wrap(out, width, height, border, inside);
        }
        for (int k = 0; k < 2; k++) assert_between(border[k] / inside[k], 0.8, 1.2);
        texsyn_free(model);
    }
}

/* Learn and synthesise by these threads; both results to s and out. */
static void run_with(txm_env *env, saved *s, uint8_t *out) {
    static uint8_t pixels[64 * 64 * 3];
    draw_patches(pixels, 64, 64, 3, 20, 12, 8);
    texsyn_learn_desc d = learn_desc(view(pixels, 64, 64, 3), 4);
    texsyn_model *model = NULL;
    d.levels = 2;
    assert_int_equal(texsyn_learn(&d, env, &model), TXM_OK);
    save(model, s);
    const texsyn_synth_desc t = synth_desc(model, 90, 200);
    assert_int_equal(texsyn_synthesize(&t, env, view(out, 90, 200, 3)), TXM_OK);
    texsyn_free(model);
}

static void test_same_bytes(void **state) {
    (void)state;
    enum { BYTES = 90 * 200 * 3 };
    static saved s[4];
    static uint8_t out[4][BYTES];
    int threads = 3;
    for (int i = 0; i < 4; i++) {
        txm_env env;
        memset(&env, 0, sizeof env);
        if (i == 1) env.parallel_for = tk_parallel_reverse;
        if (i > 1) env.parallel_for = tk_parallel_threads;
        if (i == 3) env.parallel_user = &threads;
        run_with(&env, &s[i], out[i]);
        assert_int_equal(s[i].size, s[0].size);
        assert_memory_equal(s[i].bytes, s[0].bytes, s[0].size);
        assert_memory_equal(out[i], out[0], BYTES);
    }
}

static void test_synth_seeds(void **state) {
    (void)state;
    static uint8_t a[64 * 64], b[64 * 64];
    static const uint64_t seeds[] = {1, 2, 1u << 31, (uint64_t)1 << 32, UINT64_MAX};
    texsyn_model *model = small_model(1, 1);
    texsyn_synth_desc d = synth_desc(model, 64, 64);
    synthesize(&d, view(a, 64, 64, 1));
    synthesize(&d, view(b, 64, 64, 1));
    assert_memory_equal(a, b, sizeof a);
    for (size_t i = 0; i < sizeof seeds / sizeof *seeds; i++) {
        int differ = 0;
        d.seed = seeds[i];
        synthesize(&d, view(b, 64, 64, 1));
        for (int k = 0; k < 64 * 64; k++) differ += a[k] != b[k];
        assert_true(differ > 64 * 64 / 2);
    }
    texsyn_free(model);
}

static void test_synth_steps(void **state) {
    (void)state;
    static uint8_t whole[70 * 50 * 3], out[70 * 50 * 3], last[70 * 50 * 3];
    for (int levels = 1; levels <= 3; levels++) {
        texsyn_model *model = small_model(3, levels);
        texsyn_synth_desc d = synth_desc(model, 70, 50);
        synthesize(&d, view(whole, 70, 50, 3));
        texsyn_job *job = NULL;
        float done = 0, before = 0;
        int steps = 0;
        assert_int_equal(texsyn_begin(&d, NULL, &job), TXM_OK);
        memset(&d, 0xff, sizeof d); /* the job has its own copy */
        assert_int_equal(texsyn_image(job, NULL, view(last, 70, 50, 3)), TXM_OK);
        while (done < 1) {
            assert_int_equal(texsyn_step(job, NULL, &done), TXM_OK);
            assert_true(done > before && done <= 1);
            before = done;
            steps++;
            assert_int_equal(texsyn_image(job, NULL, view(out, 70, 50, 3)), TXM_OK);
            assert_true(memcmp(out, last, sizeof out) != 0);
            memcpy(last, out, sizeof out);
        }
        assert_true(steps > 4);
        assert_memory_equal(out, whole, sizeof whole);

        /* at the end nothing more happens */
        assert_int_equal(texsyn_step(job, NULL, &done), TXM_OK);
        assert_int_equal(texsyn_step(job, NULL, NULL), TXM_OK);
        assert_true(done >= 1);
        assert_int_equal(texsyn_image(job, NULL, view(out, 70, 50, 3)), TXM_OK);
        assert_memory_equal(out, whole, sizeof whole);
        texsyn_end(job);
        texsyn_free(model);
    }
    texsyn_end(NULL);
    float done = -1;
    assert_int_equal(texsyn_step(NULL, NULL, &done), TXM_BAD_ARGUMENT);
    assert_true(done < 0);
    memset(out, FILL, sizeof out);
    memset(last, FILL, sizeof last);
    assert_int_equal(texsyn_image(NULL, NULL, view(out, 70, 50, 3)), TXM_BAD_ARGUMENT);
    assert_memory_equal(out, last, sizeof out);
}

static void test_synth_bad_arguments(void **state) {
    (void)state;
    texsyn_model *model = small_model(3, 1);
    const texsyn_synth_desc good = synth_desc(model, 10, 10);
    const int large = 1 << 15;
    static uint8_t out[12 * 12 * 4];
    static const struct {
        int width, height, quality;
        txm_status status;
    } bad[] = {{0, 10, 0, TXM_BAD_ARGUMENT},       {10, 0, 0, TXM_BAD_ARGUMENT},
               {-1, 10, 0, TXM_BAD_ARGUMENT},      {10, -1, 0, TXM_BAD_ARGUMENT},
               {INT_MIN, 10, 0, TXM_BAD_ARGUMENT}, {10, 10, -3, TXM_BAD_ARGUMENT},
               {10, 10, 3, TXM_BAD_ARGUMENT},      {INT_MAX, INT_MAX, 0, TXM_TOO_LARGE},
               {INT_MAX, 1, 0, TXM_TOO_LARGE},     {1, TEXSYN_MAX_PIXELS + 1, 0, TXM_TOO_LARGE},
               {1 << 15, 1 << 14, 0, TXM_TOO_LARGE}};
    for (size_t i = 0; i <= sizeof bad / sizeof *bad; i++) {
        tk_memory memory = {0};
        txm_env env = tk_env(&memory, NULL);
        texsyn_synth_desc d = good;
        txm_status expected = TXM_BAD_ARGUMENT;
        if (i < sizeof bad / sizeof *bad) {
            d.width = bad[i].width;
            d.height = bad[i].height;
            d.quality = bad[i].quality;
            expected = bad[i].status;
        } else {
            d.model = NULL;
        }
        texsyn_job *job = (texsyn_job *)&memory;
        assert_int_equal(texsyn_begin(&d, &env, &job), expected);
        assert_null(job);
        assert_true(env.message[0] != 0);
        env.message[0] = 0;
        memset(out, FILL, sizeof out);
        assert_int_equal(texsyn_synthesize(&d, &env, view(out, d.width, d.height, 3)), expected);
        assert_true(env.message[0] != 0);
        for (size_t k = 0; k < sizeof out; k++) assert_int_equal(out[k], FILL);
        assert_int_equal(memory.calls, 0);
    }
    texsyn_job *job = (texsyn_job *)&large;
    assert_int_equal(texsyn_begin(NULL, NULL, &job), TXM_BAD_ARGUMENT);
    assert_null(job);
    assert_int_equal(texsyn_begin(&good, NULL, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(texsyn_synthesize(NULL, NULL, view(out, 10, 10, 3)), TXM_BAD_ARGUMENT);

    /* the picture does not fit: refused before any work, and when looking at a job */
    txm_image wrong[10];
    for (int i = 0; i < 10; i++) wrong[i] = view(out, 10, 10, 3);
    wrong[0].pixels = NULL;
    wrong[1].width = 9;
    wrong[2].height = 11;
    wrong[3].channels = 1;
    wrong[4].channels = 2;
    wrong[5].channels = 0;
    wrong[6].channels = 5;
    wrong[7].stride = 29;
    wrong[8].sample = (txm_sample)3;
    wrong[9].width = 0;
    assert_int_equal(texsyn_begin(&good, NULL, &job), TXM_OK);
    for (int i = 0; i < 10; i++) {
        tk_memory memory = {0};
        tk_progress progress = {0};
        txm_env env = tk_env(&memory, &progress);
        memset(out, FILL, sizeof out);
        assert_int_equal(texsyn_image(job, &env, wrong[i]), TXM_BAD_ARGUMENT);
        assert_true(env.message[0] != 0);
        env.message[0] = 0;
        assert_int_equal(texsyn_synthesize(&good, &env, wrong[i]), TXM_BAD_ARGUMENT);
        assert_true(env.message[0] != 0);
        assert_int_equal(progress.calls, 0);
        assert_int_equal(tk_leaks(&memory), 0);
        for (size_t k = 0; k < sizeof out; k++) assert_int_equal(out[k], FILL);
    }
    texsyn_end(job);
    texsyn_free(model);
}

static void test_synth_formats(void **state) {
    (void)state;
    enum { W = 40, H = 30 };
    static uint8_t plain[W * H * 4], out[W * H * 4];
    static uint16_t words[W * H * 4];
    static float floats[W * H * 4];
    for (int channels = 1; channels <= 4; channels++) {
        if (channels == 2) continue;
        texsyn_model *model = small_model(channels, 1);
        const texsyn_synth_desc d = synth_desc(model, W, H);
        synthesize(&d, view(plain, W, H, channels));
        if (channels == 1) { /* 0 means 1 */
            synthesize(&d, view(out, W, H, 0));
            assert_memory_equal(out, plain, W * H);
        }
        for (int wider = channels < 3 ? 3 : channels; wider <= 4; wider++) {
            synthesize(&d, view(out, W, H, wider));
            for (int i = 0; i < W * H; i++) {
                for (int c = 0; c < wider; c++) {
                    const int opaque = c == 3 && channels < 4;
                    const int v = plain[i * channels + (channels == 1 ? 0 : c < channels ? c : 0)];
                    assert_int_equal(out[i * wider + c], opaque ? 255 : v);
                }
            }
        }
        synthesize(&d, view_float(floats, W, H, channels));
        synthesize(&d, view_words(words, W, H, channels));
        for (int i = 0; i < W * H * channels; i++) {
            const double v = (double)txm_clampf(floats[i], 0, 1);
            assert_near(v * 255, plain[i], 0.501);
            assert_near(v * 65535, words[i], 0.501);
        }
        texsyn_free(model);
    }
}

/* ---- memory and cancelling ---------------------------------------------------------------- */

/* Work on an env; must leave nothing behind, whatever happens. */
typedef txm_status attempt(void *context, txm_env *env);

/* Each allocation in turn fails, alone and from there on. */
static void sweep_memory(attempt *work, void *context) {
    for (int onward = 0; onward < 2; onward++) {
        for (long k = 1;; k++) {
            tk_memory memory = {0};
            tk_progress progress = {0};
            memory.fail_at = k;
            memory.fail_onward = onward;
            txm_env env = tk_env(&memory, &progress);
            const txm_status status = work(context, &env);
            assert_int_equal(tk_leaks(&memory), 0);
            assert_int_equal(progress.errors, 0);
            if (memory.calls < k) {
                assert_int_equal(status, TXM_OK);
                assert_true(k > 1);
                break;
            }
            if (status != TXM_OUT_OF_MEMORY) fail_msg("allocation %ld: status %d", k, status);
            assert_true(env.message[0] != 0);
        }
    }
}

/* Cancelled at each call of the progress callback, or at `most` of them, first and last too. */
static void sweep_cancel(attempt *work, void *context, long most) {
    tk_memory memory = {0};
    tk_progress progress = {0};
    txm_env env = tk_env(&memory, &progress);
    assert_int_equal(work(context, &env), TXM_OK);
    assert_int_equal(progress.errors, 0);
    const long calls = progress.calls, count = calls < most ? calls : most;
    assert_true(calls > 1);
    for (long i = 0; i < count; i++) {
        tk_memory used = {0};
        tk_progress stop = {0};
        stop.cancel_at = 1 + i * (calls - 1) / (count - 1);
        txm_env other = tk_env(&used, &stop);
        const txm_status status = work(context, &other);
        if (status != TXM_CANCELLED) fail_msg("call %ld: status %d", stop.cancel_at, status);
        assert_int_equal(tk_leaks(&used), 0);
        assert_int_equal(stop.late, 0);
        assert_int_equal(stop.calls, stop.cancel_at);
        assert_int_equal(stop.errors, 0);
        assert_true(other.message[0] != 0);
    }
}

static txm_status try_learn(void *context, txm_env *env) {
    texsyn_model *model = (texsyn_model *)env;
    const txm_status status = texsyn_learn((const texsyn_learn_desc *)context, env, &model);
    assert_int_equal(model != NULL, status == TXM_OK);
    texsyn_free(model);
    return status;
}

static txm_status try_save(void *context, txm_env *env) {
    static saved s;
    return texsyn_save((const texsyn_model *)context, env, s.bytes, sizeof s.bytes, &s.size);
}

static txm_status try_load(void *context, txm_env *env) {
    const saved *s = (const saved *)context;
    texsyn_model *model = (texsyn_model *)env;
    const txm_status status = texsyn_load(s->bytes, s->size, env, &model);
    assert_int_equal(model != NULL, status == TXM_OK);
    texsyn_free(model);
    return status;
}

static txm_status try_synthesize(void *context, txm_env *env) {
    static uint8_t out[33 * 40 * 3];
    memset(out, FILL, sizeof out);
    const txm_status status =
        texsyn_synthesize((const texsyn_synth_desc *)context, env, view(out, 33, 40, 3));
    for (size_t i = 0; i < sizeof out && status != TXM_OK; i++) assert_int_equal(out[i], FILL);
    return status;
}

/* A job that is looked at between the steps, and goes on after a failed one. */
static txm_status try_steps(void *context, txm_env *env) {
    static uint8_t out[33 * 40 * 3];
    texsyn_job *job = (texsyn_job *)env;
    txm_status first = texsyn_begin((const texsyn_synth_desc *)context, env, &job);
    float done = 0;
    if (first != TXM_OK) {
        assert_null(job);
        return first;
    }
    while (done < 1) {
        const float before = done;
        const txm_status status = texsyn_step(job, env, &done);
        assert_int_equal(texsyn_image(job, env, view(out, 33, 40, 3)), TXM_OK);
        if (status == TXM_OK) continue;
        assert_true(done <= before && done >= before); /* untouched */
        if (first != TXM_OK || status == TXM_CANCELLED) {
            first = status;
            break;
        }
        first = status;
    }
    if (done >= 1) { /* the failure left no trace */
        static uint8_t whole[33 * 40 * 3];
        synthesize((const texsyn_synth_desc *)context, view(whole, 33, 40, 3));
        assert_memory_equal(out, whole, sizeof whole);
    }
    texsyn_end(job);
    return first;
}

static void test_learn_failing(void **state) {
    (void)state;
    static uint8_t pixels[32 * 32], mask[32 * 32];
    draw_patches(pixels, 32, 32, 1, 8, 30, 4);
    memset(mask, 1, sizeof mask);
    texsyn_learn_desc d = learn_desc(view(pixels, 32, 32, 1), 1);
    d.mask = view(mask, 32, 32, 1);
    d.levels = 2;
    sweep_memory(try_learn, &d);
    sweep_cancel(try_learn, &d, 12);
}

static void test_model_failing(void **state) {
    (void)state;
    static saved s;
    texsyn_model *model = small_model(3, 2);
    save(model, &s);
    sweep_memory(try_save, model);
    sweep_memory(try_load, &s);
    texsyn_free(model);
}

static void test_synth_failing(void **state) {
    (void)state;
    texsyn_model *model = small_model(3, 3);
    texsyn_synth_desc d = synth_desc(model, 33, 40);
    d.quality = -2;
    sweep_memory(try_synthesize, &d);
    sweep_memory(try_steps, &d);
    sweep_cancel(try_synthesize, &d, 120);
    sweep_cancel(try_steps, &d, 30);
    texsyn_free(model);
}

static void test_synth_peak_memory(void **state) {
    (void)state;
    static uint8_t out[512 * 512 * 3];
    tk_memory memory = {0};
    txm_env env = tk_env(&memory, NULL);
    texsyn_model *model = small_model(3, 2);
    texsyn_synth_desc d = synth_desc(model, 512, 512);
    d.quality = -2;
    assert_int_equal(texsyn_synthesize(&d, &env, view(out, 512, 512, 3)), TXM_OK);
    assert_int_equal(tk_leaks(&memory), 0);
    assert_true(memory.peak_bytes <= 64u * 512 * 512 + (4u << 20));
    texsyn_free(model);
}

/* The allocator that made a model releases it, also when the env is long gone. */
static void test_env_goes_first(void **state) {
    (void)state;
    static uint8_t pixels[16 * 16], out[20 * 20];
    tk_memory memory = {0}, other = {0};
    txm_env env = tk_env(&memory, NULL);
    draw_patches(pixels, 16, 16, 1, 8, 30, 4);
    const texsyn_learn_desc d = learn_desc(view(pixels, 16, 16, 1), 1);
    texsyn_model *model = NULL;
    texsyn_job *job = NULL;
    float done = 0;
    assert_int_equal(texsyn_learn(&d, &env, &model), TXM_OK);
    const texsyn_synth_desc s = synth_desc(model, 20, 20);
    assert_int_equal(texsyn_begin(&s, &env, &job), TXM_OK);
    memset(&env, 0xff, sizeof env);
    txm_env another = tk_env(&other, NULL);
    while (done < 1) assert_int_equal(texsyn_step(job, &another, &done), TXM_OK);
    assert_int_equal(texsyn_image(job, &another, view(out, 20, 20, 1)), TXM_OK);
    assert_int_equal(other.calls, 0);
    texsyn_end(job);
    texsyn_free(model);
    assert_int_equal(tk_leaks(&memory), 0);
}

static void test_quick_start(void **state) {
    (void)state;
    char line[80] = "";
    int types = 0, value = -1;
    assert_int_equal(tk_quick_start("texsyn.h", "texsyn"), 0);
    FILE *file = fopen("build/tests/texsyn_quick.txt", "r");
    assert_non_null(file);
    const char *got = fgets(line, sizeof line, file);
    fclose(file);
    assert_non_null(got);
    assert_int_equal(sscanf(line, "%d clique types, pixel (5, 7) is %d", &types, &value), 2);
    assert_between(types, 3, 60);
    assert_between(value, 0, 255);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_learn_bad_arguments),
        cmocka_unit_test(test_learn_bad_floats),
        cmocka_unit_test(test_learn_masks),
        cmocka_unit_test(test_learn_half),
        cmocka_unit_test(test_learn_kinds),
        cmocka_unit_test(test_learn_flat),
        cmocka_unit_test(test_learn_two_values),
        cmocka_unit_test(test_learn_constant_alpha),
        cmocka_unit_test(test_learn_strides),
        cmocka_unit_test(test_learn_options),
        cmocka_unit_test(test_statistics),
        cmocka_unit_test(test_save_and_load),
        cmocka_unit_test(test_load_damaged),
        cmocka_unit_test(test_load_mutated),
        cmocka_unit_test(test_synth_sizes),
        cmocka_unit_test(test_synth_tileable),
        cmocka_unit_test(test_same_bytes),
        cmocka_unit_test(test_synth_seeds),
        cmocka_unit_test(test_synth_steps),
        cmocka_unit_test(test_synth_bad_arguments),
        cmocka_unit_test(test_synth_formats),
        cmocka_unit_test(test_learn_failing),
        cmocka_unit_test(test_model_failing),
        cmocka_unit_test(test_synth_failing),
        cmocka_unit_test(test_synth_peak_memory),
        cmocka_unit_test(test_env_goes_first),
        cmocka_unit_test(test_quick_start),
    };
    return cmocka_run_group_tests_name("texsyn", tests, NULL, NULL);
}
