/* test_texsyn_learn.c - learning: arguments, masks, examples of all kinds, the neighbourhood
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texsyn_learn && build/tests/unit/test_texsyn_learn */
#include "synkit.h"

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
    texsyn_learn_desc good = learn_desc(view_bytes(pixels, 32, 32, 3), 1);
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

    good.mask = view_bytes(mask, 32, 32, 1);
    REFUSES(mask.width, 31, TXM_BAD_ARGUMENT);
    REFUSES(mask.width, 0, TXM_BAD_ARGUMENT);
    REFUSES(mask.height, 33, TXM_BAD_ARGUMENT);
    REFUSES(mask.height, -1, TXM_BAD_ARGUMENT);
    REFUSES(mask.channels, 5, TXM_BAD_ARGUMENT);
    REFUSES(mask.channels, -1, TXM_BAD_ARGUMENT);
    REFUSES(mask.stride, 31, TXM_BAD_ARGUMENT);
    REFUSES(mask.sample, (txm_sample)7, TXM_BAD_ARGUMENT);
    static float float_mask[32 * 32];
    good.mask = view_float(float_mask, 32, 32, 1);
    float_mask[99] = NAN;
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
    texsyn_model_free(model);
}

static void test_learn_masks(void **state) {
    (void)state;
    static uint8_t pixels[32 * 32], mask[32 * 32], out[24 * 24];
    draw_patches(pixels, 32, 32, 1, 8, 30, 1);
    texsyn_learn_desc d = learn_desc(view_bytes(pixels, 32, 32, 1), 2);
    d.mask = view_bytes(mask, 32, 32, 0);
    refuses_learn(&d, TXM_TOO_SMALL, "an empty mask");
    memset(mask, 127, sizeof mask);
    memset(mask, 128, 255);
    refuses_learn(&d, TXM_TOO_SMALL, "a mask of 255 pixels");
    mask[255] = 128;
    texsyn_model_free(learn(&d));

    /* irregular: no two neighbours, then no two pixels within 2, then lone columns */
    for (int kind = 0; kind < 3; kind++) {
        for (int i = 0; i < 32 * 32; i++) {
            const int x = i % 32, y = i / 32;
            const int in = kind == 0 ? (x + y) % 2 : kind == 1 ? x % 2 && y % 2 : x % 4 == 1;
            mask[i] = in ? 255 : 0;
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
            synthesize(&s, view_bytes(out, 24, 24, 1));
            texsyn_model_free(model);
        }
    }
}

/* What lies outside the mask does not matter; what is learned looks like the inside. */
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
            mask[y * W + x] = left ? (uint8_t)(128 + x % 128) : 0;
            if (!left) continue;
            mean += pixels[y * W + x] / (W / 2.0 * H);
            histogram[pixels[y * W + x]] += 1 / (W / 2.0 * H);
        }
    }
    texsyn_learn_desc d = learn_desc(view_bytes(pixels, W, H, 1), 6);
    d.mask = view_bytes(mask, W, H, 1);
    for (d.levels = 1; d.levels <= 2; d.levels++) {
        texsyn_model *model = learn(&d);
        const texsyn_synth_desc s = synth_desc(model, 96, 96);
        synthesize(&s, view_bytes(out, 96, 96, 1));
        mean_out = 0;
        memset(histogram_out, 0, sizeof histogram_out);
        for (int i = 0; i < 96 * 96; i++) {
            assert_between(out[i], 98, 192);
            mean_out += out[i] / (96.0 * 96);
            histogram_out[(out[i] + 5) / 10 * 10] += 1 / (96.0 * 96);
        }
        assert_near(mean_out, mean, 3);
        for (int i = 100; i < 200; i += 10) assert_near(histogram_out[i], histogram[i], 0.03);
        texsyn_model_free(model);
    }
    d.levels = 1;
    texsyn_model *a = learn(&d);
    for (int i = 0; i < W * H; i++)
        if (mask[i] < 128) pixels[i] = (uint8_t)(i * 31);
    texsyn_model *b = learn(&d);
    assert_same_saved(a, b);
    texsyn_model_free(a);
    texsyn_model_free(b);
}

/* ---- learning: examples of all kinds ----------------------------------------------------- */

/* the mean of a channel; of colours as far as they are visible */
static double mean_of(const uint8_t *pixels, int count, int channels, int c) {
    double sum = 0, weights = 0;
    for (int i = 0; i < count; i++) {
        const double weight = channels == 4 && c < 3 ? pixels[i * channels + 3] : 1;
        sum += weight * pixels[i * channels + c];
        weights += weight;
    }
    return sum / weights;
}

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
        texsyn_learn_desc d = learn_desc(view_bytes(pixels, 40, 32, channels), 4);
        texsyn_model *model = learn(&d);
        assert_int_equal(texsyn_channels(model), channels);
        assert_int_equal(texsyn_level_count(model), 1);
        assert_between(texsyn_band_count(model), channels > 1 ? 2 : 1, channels);
        const texsyn_synth_desc s = synth_desc(model, 50, 40);
        synthesize(&s, view_bytes(out, 50, 40, channels));

        for (int c = 0; c < channels; c++)
            assert_near(mean_of(out, 50 * 40, channels, c), mean_of(pixels, 40 * 32, channels, c),
                        12);

        /* the same samples as floats or with 16 bits: the same model */
        for (int i = 0; i < 2; i++) {
            d.example =
                i ? view_words(words, 40, 32, channels) : view_float(floats, 40, 32, channels);
            texsyn_model *other = learn(&d);
            assert_same_saved(model, other);
            texsyn_model_free(other);
        }
        texsyn_model_free(model);
    }
    assert_int_equal(texsyn_channels(NULL), 0);
    assert_int_equal(texsyn_level_count(NULL), 0);
    assert_int_equal(texsyn_band_count(NULL), 0);
    assert_int_equal(texsyn_clique_count(NULL), 0);
    assert_int_equal(texsyn_clique_at(NULL, 0, NULL, NULL, 0), 0);
    texsyn_model_free(NULL);
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
            const texsyn_learn_desc d = learn_desc(view_bytes(pixels, 24, 20, channels), 2);
            texsyn_model *model = learn(&d);
            const texsyn_synth_desc s = synth_desc(model, 33, 17);
            synthesize(&s, view_bytes(out, 33, 17, channels));
            for (int i = 0; i < 33 * 17 * channels; i++)
                assert_int_equal(out[i], colours[k][i % channels]);
            texsyn_model_free(model);
        }
    }
}

static void test_learn_two_values(void **state) {
    (void)state;
    static uint8_t pixels[64 * 64], out[100 * 80];
    draw_patches(pixels, 64, 64, 1, 2, 255, 4);
    const texsyn_learn_desc d = learn_desc(view_bytes(pixels, 64, 64, 1), 6);
    texsyn_model *model = learn(&d);
    for (int tileable = 0; tileable < 2; tileable++) {
        texsyn_synth_desc s = synth_desc(model, 100, 80);
        double white = 0;
        s.tileable = tileable;
        synthesize(&s, view_bytes(out, 100, 80, 1));
        for (int i = 0; i < 100 * 80; i++) {
            if (out[i] != 0 && out[i] != 255) fail_msg("pixel %d is %d", i, out[i]);
            white += out[i] / (255.0 * 100 * 80);
        }
        assert_between(white, 0.4, 0.6);
    }
    texsyn_model_free(model);
}

static void test_learn_constant_alpha(void **state) {
    (void)state;
    static uint8_t pixels[32 * 32 * 4], out[40 * 40 * 4];
    draw_patches(pixels, 32, 32, 4, 8, 30, 4);
    for (int i = 0; i < 32 * 32; i++) pixels[4 * i + 3] = 200;
    const texsyn_learn_desc d = learn_desc(view_bytes(pixels, 32, 32, 4), 2);
    texsyn_model *model = learn(&d);
    assert_between(texsyn_band_count(model), 1, 3); /* alpha needs none */
    const texsyn_synth_desc s = synth_desc(model, 40, 40);
    synthesize(&s, view_bytes(out, 40, 40, 4));
    for (int i = 0; i < 40 * 40; i++) assert_int_equal(out[4 * i + 3], 200);
    texsyn_model_free(model);
}

static void test_learn_strides(void **state) {
    (void)state;
    static uint8_t packed[40 * 32 * 3], padded[140 * 32], mask[40 * 32], mask_padded[50 * 32];
    draw_patches(packed, 40, 32, 3, 8, 30, 6);
    texsyn_learn_desc d = learn_desc(view_bytes(packed, 40, 32, 3), 2);
    for (int i = 0; i < 40 * 32; i++) mask[i] = i % 40 < 30 ? 255 : 0;
    d.mask = view_bytes(mask, 40, 32, 1);
    texsyn_model *model = learn(&d);
    for (int flip = 0; flip < 2; flip++) {
        memset(padded, 99, sizeof padded);
        memset(mask_padded, 255, sizeof mask_padded);
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
        texsyn_model_free(other);
    }

    /* and on the way out: the bytes between the rows stay as they are */
    static uint8_t plain[21 * 10 * 3], out[80 * 10];
    const texsyn_synth_desc s = synth_desc(model, 21, 10);
    synthesize(&s, view_bytes(plain, 21, 10, 3));
    for (int flip = 0; flip < 2; flip++) {
        txm_image im = view_bytes(out + (flip ? 80 * 9 : 0), 21, 10, 3);
        im.stride = flip ? -80 : 80;
        memset(out, FILL, sizeof out);
        synthesize(&s, im);
        for (int y = 0; y < 10; y++) {
            const uint8_t *row = out + 80 * (flip ? 9 - y : y);
            assert_memory_equal(row, plain + 63 * y, 63);
            for (int x = 63; x < 80; x++) assert_int_equal(row[x], FILL);
        }
    }
    texsyn_model_free(model);
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
        if (top)
            assert_true(c.kind != TEXSYN_PARENT && c.kind != TEXSYN_SCALE &&
                        c.kind != TEXSYN_CONTEXT);
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
        texsyn_learn_desc d = learn_desc(view_bytes(pixels, 64, 64, 3), cases[i].types);
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
        texsyn_model_free(model);
    }

    /* as many levels as the example has room for; a threshold that nothing passes */
    texsyn_learn_desc d = learn_desc(view_bytes(pixels, 32, 32, 1), 5);
    d.levels = 6;
    d.threshold = 2;
    texsyn_model *model = learn(&d);
    assert_int_equal(texsyn_level_count(model), 3);
    for (int level = 0; level < 3; level++) {
        int others = 0;
        check_preselected(model, level, &others);
        assert_int_equal(others, 0);
    }
    texsyn_model_free(model);

    /* the default number of levels leaves the short side at 64 or more */
    static uint8_t large[256 * 128];
    draw_smooth(large, 256, 128, 1);
    d = learn_desc(view_bytes(large, 256, 128, 1), 1);
    model = learn(&d);
    assert_int_equal(texsyn_level_count(model), 2);
    texsyn_model_free(model);

    /* the seed counts, and only the seed */
    d = learn_desc(view_bytes(large, 64, 64, 1), 2);
    d.example.stride = 256;
    texsyn_model *a = learn(&d), *b = learn(&d);
    static saved s, t;
    assert_same_saved(a, b);
    save(a, &s);
    texsyn_model_free(b);
    d.seed = UINT64_MAX;
    b = learn(&d);
    save(b, &t);
    assert_true(s.size != t.size || memcmp(s.bytes, t.bytes, s.size) != 0);
    texsyn_model_free(a);
    texsyn_model_free(b);
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
    texsyn_learn_desc d = learn_desc(view_bytes(pixels, SIDE, SIDE, 1), 12);
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
            assert_int_equal(n, c.kind == TEXSYN_FILTER ? 27 : 81);
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
    synthesize(&s, view_bytes(out, OUT, OUT, 1));
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
    texsyn_model_free(model);
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
    };
    return cmocka_run_group_tests_name("texsyn learning", tests, NULL, NULL);
}
