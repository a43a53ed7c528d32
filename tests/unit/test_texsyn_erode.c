/* test_texsyn_erode.c - erosion: levels within levels, shares, pictures, masks, bad input, faults
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texsyn_erode && build/tests/unit/test_texsyn_erode */
#include "synkit.h"

enum { STONE = 96, WIDTH = 120, HEIGHT = 90, PIXELS = WIDTH * HEIGHT };

/* Light grain with dark lines across it, one of them slanting. */
static void draw_stone(uint8_t *p, int width, int height, int channels) {
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            const int is_crack = (y + x / 3) % 31 < 2 || (x + y / 5) % 43 < 2;
            const int v = (is_crack ? 60 : 190) + at_random(x, y, 1) % 20;
            for (int c = 0; c < channels; c++)
                *p++ = (uint8_t)(channels % 2 == 0 && c == channels - 1 ? 255 : v - 12 * c);
        }
    }
}

static texsyn_erosion_desc stone_desc(uint8_t *pixels, int channels) {
    texsyn_erosion_desc d;
    memset(&d, 0, sizeof d);
    draw_stone(pixels, STONE, STONE, channels);
    d.weathered = view_bytes(pixels, STONE, STONE, channels);
    d.width = WIDTH;
    d.height = HEIGHT;
    d.seed = 3;
    return d;
}

static texsyn_erosion *make(const texsyn_erosion_desc *d) {
    tk_progress progress = {0};
    txm_env env = tk_env(NULL, &progress);
    texsyn_erosion *e = NULL;
    const txm_status status = texsyn_erosion_make(d, &env, &e);
    if (status != TXM_OK) fail_msg("make: %d, %s", status, env.message);
    assert_non_null(e);
    assert_int_equal(progress.errors, 0);
    return e;
}

static int count_white(const uint8_t *mask, int count) {
    int n = 0;
    for (int i = 0; i < count; i++) {
        assert_true(mask[i] == 0 || mask[i] == 255);
        n += mask[i] == 255;
    }
    return n;
}

/* ---- levels ----------------------------------------------------------------------------- */

enum { LEVELS = 21 };

static void test_levels_nest(void **state) {
    (void)state;
    static uint8_t stone[STONE * STONE * 3], mask[LEVELS][PIXELS];
    static const float shares[3] = {0, 0.031f, 0.5f};
    for (int k = 0; k < 3; k++) {
        texsyn_erosion_desc d = stone_desc(stone, 3);
        d.share = shares[k];
        texsyn_erosion *e = make(&d);
        const double share = (double)texsyn_erosion_share(e);
        assert_near(share, k ? (double)shares[k] : 0.1, 1e-7);
        for (int l = 0; l < LEVELS; l++) {
            const float level = (float)l / (LEVELS - 1);
            assert_int_equal(texsyn_erosion_mask(e, level, NULL, NULL,
                                                 view_bytes(mask[l], WIDTH, HEIGHT, 1)),
                             TXM_OK);
            assert_int_equal(count_white(mask[l], PIXELS),
                             (int)floor((double)level * (share * PIXELS) + 0.5));
            for (int m = 0; m < l; m++)
                for (int i = 0; i < PIXELS; i++) assert_true(mask[m][i] <= mask[l][i]);
        }
        texsyn_erosion_free(e);
    }
}

/* The cracks are the dark lines, which are far longer than wide; and the seed changes where they are. */
static void test_cracks_are_long(void **state) {
    (void)state;
    static uint8_t stone[STONE * STONE * 3], mask[PIXELS], other[PIXELS];
    texsyn_erosion_desc d = stone_desc(stone, 3);
    texsyn_erosion *e = make(&d);
    for (int l = 0; l < 3; l++) {
        static const float levels[3] = {0.2f, 0.5f, 1};
        int with = 0, count;
        texsyn_erosion_mask(e, levels[l], NULL, NULL, view_bytes(mask, WIDTH, HEIGHT, 1));
        count = count_white(mask, PIXELS);
        for (int i = 0; i < PIXELS; i++) { /* at least two eroded neighbours: a line goes on */
            int neighbours = 0;
            const int x = i % WIDTH, y = i / WIDTH;
            if (!mask[i]) continue;
            for (int v = y - 1; v <= y + 1; v++)
                for (int u = x - 1; u <= x + 1; u++)
                    neighbours += u >= 0 && v >= 0 && u < WIDTH && v < HEIGHT && (u != x || v != y) &&
                                  mask[v * WIDTH + u];
            with += neighbours >= 2;
        }
        assert_true(with > 0.85 * count);
    }
    d.seed = 4;
    texsyn_erosion *again = make(&d);
    texsyn_erosion_mask(again, 1, NULL, NULL, view_bytes(other, WIDTH, HEIGHT, 1));
    assert_int_equal(count_white(other, PIXELS), count_white(mask, PIXELS));
    assert_memory_not_equal(mask, other, PIXELS);
    texsyn_erosion_free(e);
    texsyn_erosion_free(again);
}

static void test_level_per_pixel(void **state) {
    (void)state;
    static uint8_t stone[STONE * STONE * 3], whole[PIXELS], half[PIXELS], mask[PIXELS], gray[2 * PIXELS];
    const texsyn_erosion_desc d = stone_desc(stone, 3);
    texsyn_erosion *e = make(&d);
    const txm_image out = view_bytes(mask, WIDTH, HEIGHT, 1);
    txm_image levels = view_bytes(gray, WIDTH, HEIGHT, 2);
    texsyn_erosion_mask(e, 0.8f, NULL, NULL, view_bytes(whole, WIDTH, HEIGHT, 1));
    texsyn_erosion_mask(e, 0.8f * (float)(51 / 255.0), NULL, NULL, view_bytes(half, WIDTH, HEIGHT, 1));
    for (int i = 0; i < PIXELS; i++) { /* full, a fifth, and none where it is transparent */
        gray[2 * i] = i % WIDTH < 40 ? 255 : 51;
        gray[2 * i + 1] = i % WIDTH < 80 ? 255 : 0;
    }
    assert_int_equal(texsyn_erosion_mask(e, 0.8f, &levels, NULL, out), TXM_OK);
    for (int i = 0; i < PIXELS; i++)
        assert_int_equal(mask[i], i % WIDTH < 40 ? whole[i] : i % WIDTH < 80 ? half[i] : 0);
    texsyn_erosion_free(e);
}

/* ---- pictures --------------------------------------------------------------------------- */

/* Level 0 copies; higher levels darken what is eroded, and touch nothing that is two pixels away. */
static void test_pictures(void **state) {
    (void)state;
    static uint8_t stone[STONE * STONE * 4], mask[PIXELS];
    static float from[PIXELS * 4], to[PIXELS * 4];
    static const txm_sample samples[3] = {TXM_U8, TXM_U16, TXM_F32};
    for (int channels = 1; channels <= 4; channels++) {
        texsyn_erosion_desc d = stone_desc(stone, channels);
        texsyn_erosion *e = make(&d);
        texsyn_erosion_mask(e, 0.7f, NULL, NULL, view_bytes(mask, WIDTH, HEIGHT, 1));
        for (int s = 0; s < 3; s++) {
            const txm_image in = view(from, WIDTH, HEIGHT, channels, samples[s]);
            const txm_image out = view(to, WIDTH, HEIGHT, channels, samples[s]);
            const size_t bytes = (size_t)PIXELS * (size_t)channels * txm_sample_bytes(samples[s]);
            double ratio = 0, count = 0;
            for (int i = 0; i < PIXELS * channels; i++)
                txm_image_set(&in, i / channels % WIDTH, i / channels / WIDTH, i % channels,
                              0.6f + 0.3f * (float)at_random(i, s, 4) / 255.0f);
            assert_int_equal(texsyn_erosion_draw(e, 0, NULL, &in, NULL, out), TXM_OK);
            assert_memory_equal(from, to, bytes);
            assert_int_equal(texsyn_erosion_draw(e, 0.7f, NULL, &in, NULL, out), TXM_OK);
            for (int i = 0; i < PIXELS; i++) {
                const int x = i % WIDTH, y = i / WIDTH;
                int near_ = 0;
                for (int v = y - 1; v <= y + 1; v++)
                    for (int u = x - 1; u <= x + 1; u++)
                        near_ += u >= 0 && v >= 0 && u < WIDTH && v < HEIGHT && mask[v * WIDTH + u];
                for (int c = 0; c < channels; c++) {
                    const float p = txm_image_get(&in, x, y, c), q = txm_image_get(&out, x, y, c);
                    if (!near_ || c == 3 || (c == 1 && channels == 2)) assert_true(p == q);
                    if (mask[i] && c == 0) ratio += (double)q / (double)p, count++;
                }
            }
            assert_between(ratio / count, 0.25, 0.8); /* the lines are 60 of 190 */
            assert_int_equal(texsyn_erosion_draw(e, 0.7f, NULL, &in, NULL, in), TXM_OK); /* in place */
            assert_memory_equal(from, to, bytes);
        }
        texsyn_erosion_free(e);
    }
}

/* One pixel, narrow strips, all sizes near those of pieces. */
static void test_sizes(void **state) {
    (void)state;
    static uint8_t stone[STONE * STONE * 3], mask[200 * 200];
    static const int sizes[12][2] = {{1, 1}, {1, 200}, {200, 1}, {2, 3}, {37, 38}, {38, 37},
                                     {31, 31}, {62, 62}, {70, 69}, {199, 5}, {5, 199}, {150, 149}};
    texsyn_erosion_desc d = stone_desc(stone, 3);
    for (int i = 0; i < 12; i++) {
        d.width = sizes[i][0];
        d.height = sizes[i][1];
        texsyn_erosion *e = make(&d);
        assert_int_equal(texsyn_erosion_mask(e, 1, NULL, NULL, view_bytes(mask, d.width, d.height, 1)),
                         TXM_OK);
        assert_int_equal(count_white(mask, d.width * d.height),
                         (int)floor((double)0.1f * d.width * d.height + 0.5));
        texsyn_erosion_free(e);
    }
}

/* ---- exemplars -------------------------------------------------------------------------- */

/* Transparent and masked pixels of the exemplar do not matter. */
static void test_unknown_pixels(void **state) {
    (void)state;
    static uint8_t clear[STONE * STONE * 4], dirty[STONE * STONE * 4], mask[STONE * STONE];
    static uint8_t a[PIXELS], b[PIXELS];
    texsyn_erosion_desc d = stone_desc(clear, 4), m;
    for (int i = 0; i < STONE * STONE; i++) {
        mask[i] = i % STONE < 70 ? 200 : 100;
        if (i % STONE >= 70) clear[4 * i + 3] = 90;
    }
    memcpy(dirty, clear, sizeof dirty);
    for (int i = 0; i < STONE * STONE; i++) {
        for (int c = 0; c < 3 && i % STONE >= 70; c++) dirty[4 * i + c] = (uint8_t)(i * 7);
    }
    texsyn_erosion *e = make(&d);
    texsyn_erosion_mask(e, 1, NULL, NULL, view_bytes(a, WIDTH, HEIGHT, 1));
    texsyn_erosion_free(e);
    for (int k = 0; k < 2; k++) { /* other colours there; opaque, but masked */
        m = d;
        m.weathered.pixels = dirty;
        if (k) m.mask = view_bytes(mask, STONE, STONE, 1);
        for (int i = 0; i < STONE * STONE && k; i++) dirty[4 * i + 3] = 255;
        e = make(&m);
        texsyn_erosion_mask(e, 1, NULL, NULL, view_bytes(b, WIDTH, HEIGHT, 1));
        texsyn_erosion_free(e);
        assert_memory_equal(a, b, PIXELS);
    }
}

/* The intact stone is everything but the lines and what is beside them. */
static void test_intact(void **state) {
    (void)state;
    static uint8_t stone[STONE * STONE * 3], mask[STONE * STONE];
    texsyn_erosion_desc d = stone_desc(stone, 3);
    d.width = d.height = -1; /* not used */
    assert_int_equal(texsyn_erosion_intact(&d, NULL, view_bytes(mask, STONE, STONE, 1)), TXM_OK);
    int intact = 0, cracked = 0, lines = 0;
    for (int i = 0; i < STONE * STONE; i++) {
        const int is_crack = stone[3 * i] < 100;
        intact += mask[i] == 255;
        lines += is_crack;
        cracked += is_crack && mask[i] == 255;
    }
    assert_true(cracked < 0.15 * lines);
    assert_between((double)intact / (STONE * STONE), 0.5, 0.9);
    texsyn_learn_desc learning = learn_desc(d.weathered, 2);
    learning.mask = view_bytes(mask, STONE, STONE, 1);
    texsyn_model_free(learn(&learning));
}

/* An exemplar without any cracks, and a white one: something is chosen, nothing breaks. */
static void test_plain_exemplars(void **state) {
    (void)state;
    static uint8_t stone[STONE * STONE], mask[PIXELS];
    texsyn_erosion_desc d = stone_desc(stone, 1);
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < STONE * STONE; i++) stone[i] = (uint8_t)(k == 0 ? 255 : k == 1 ? 0 : i);
        texsyn_erosion *e = make(&d);
        texsyn_erosion_mask(e, 1, NULL, NULL, view_bytes(mask, WIDTH, HEIGHT, 1));
        assert_int_equal(count_white(mask, PIXELS), PIXELS / 10);
        texsyn_erosion_free(e);
    }
}

/* ---- bad input, faults ------------------------------------------------------------------ */

static void refuses(const texsyn_erosion_desc *d, txm_status expected, const char *what) {
    static uint8_t mask[STONE * STONE];
    tk_memory memory = {0};
    txm_env env = tk_env(&memory, NULL);
    texsyn_erosion *e = (texsyn_erosion *)&memory;
    const txm_status status = texsyn_erosion_make(d, &env, &e);
    if (status != expected) fail_msg("%s: status %d, not %d", what, status, expected);
    assert_null(e);
    assert_true(env.message[0] != 0);
    assert_int_equal(tk_leaks(&memory), 0);
    if (d && d->width > 0 && d->height > 0 && expected != TXM_TOO_LARGE) {
        memset(mask, FILL, sizeof mask);
        assert_int_equal(texsyn_erosion_intact(d, NULL, view_bytes(mask, STONE, STONE, 1)), expected);
        for (int i = 0; i < STONE * STONE; i++) assert_int_equal(mask[i], FILL);
    }
}

#define REFUSES(field, value, expected)              \
    do {                                             \
        texsyn_erosion_desc d = good;                \
        d.field = value;                             \
        refuses(&d, expected, #field " = " #value); \
    } while (0)

static void test_make_refuses(void **state) {
    (void)state;
    static uint8_t stone[STONE * STONE * 3], mask[STONE * STONE];
    static float samples[STONE * STONE];
    texsyn_erosion_desc good = stone_desc(stone, 3);
    assert_int_equal(texsyn_erosion_make(&good, NULL, NULL), TXM_BAD_ARGUMENT);
    refuses(NULL, TXM_BAD_ARGUMENT, "desc NULL");
    REFUSES(weathered.pixels, NULL, TXM_BAD_ARGUMENT);
    REFUSES(weathered.width, 31, TXM_TOO_SMALL);
    REFUSES(weathered.height, 31, TXM_TOO_SMALL);
    REFUSES(weathered.height, 0, TXM_BAD_ARGUMENT);
    REFUSES(weathered.channels, 5, TXM_BAD_ARGUMENT);
    REFUSES(weathered.height, INT_MAX, TXM_TOO_LARGE);
    REFUSES(share, -0.1f, TXM_BAD_ARGUMENT);
    REFUSES(share, 0.51f, TXM_BAD_ARGUMENT);
    REFUSES(share, (float)NAN, TXM_BAD_ARGUMENT);
    REFUSES(width, 0, TXM_BAD_ARGUMENT);
    REFUSES(height, -5, TXM_BAD_ARGUMENT);
    REFUSES(width, INT_MAX, TXM_TOO_LARGE);
    good.mask = view_bytes(mask, STONE, STONE, 1);
    REFUSES(mask.width, STONE - 1, TXM_BAD_ARGUMENT);
    REFUSES(mask.channels, 7, TXM_BAD_ARGUMENT);
    refuses(&good, TXM_TOO_SMALL, "an empty mask");
    memset(mask, 255, 1023);
    refuses(&good, TXM_TOO_SMALL, "a mask of 1023 pixels");
    good.mask.pixels = NULL;
    good.weathered = view_float(samples, STONE, STONE, 1);
    samples[5] = NAN;
    refuses(&good, TXM_BAD_ARGUMENT, "NaN");
    samples[5] = 2e6f;
    refuses(&good, TXM_BAD_ARGUMENT, "two million");
}

static void test_draw_refuses(void **state) {
    (void)state;
    static uint8_t stone[STONE * STONE * 3], from[PIXELS * 3], to[PIXELS * 3];
    static float samples[PIXELS];
    const texsyn_erosion_desc d = stone_desc(stone, 3);
    texsyn_erosion *e = make(&d);
    const txm_image in = view_bytes(from, WIDTH, HEIGHT, 3), out = view_bytes(to, WIDTH, HEIGHT, 3);
    const txm_image one = view_bytes(to, WIDTH, HEIGHT, 1);
    txm_image bad = view_bytes(from, WIDTH - 1, HEIGHT, 1), rgb = in, nan = view_float(samples, WIDTH, HEIGHT, 1);
    samples[PIXELS - 1] = NAN;
    memset(to, FILL, sizeof to);
    static const float levels[4] = {-0.01f, 1.01f, (float)NAN, (float)INFINITY};
    for (int i = 0; i < 4; i++) {
        assert_int_equal(texsyn_erosion_draw(e, levels[i], NULL, &in, NULL, out), TXM_BAD_ARGUMENT);
        assert_int_equal(texsyn_erosion_mask(e, levels[i], NULL, NULL, one), TXM_BAD_ARGUMENT);
    }
    assert_int_equal(texsyn_erosion_draw(NULL, 1, NULL, &in, NULL, out), TXM_BAD_ARGUMENT);
    assert_int_equal(texsyn_erosion_draw(e, 1, NULL, NULL, NULL, out), TXM_BAD_ARGUMENT);
    assert_int_equal(texsyn_erosion_draw(e, 1, &bad, &in, NULL, out), TXM_BAD_ARGUMENT);
    assert_int_equal(texsyn_erosion_draw(e, 1, &rgb, &in, NULL, out), TXM_BAD_ARGUMENT);
    assert_int_equal(texsyn_erosion_draw(e, 1, &nan, &in, NULL, out), TXM_BAD_ARGUMENT);
    assert_int_equal(texsyn_erosion_draw(e, 1, NULL, &in, NULL, one), TXM_BAD_ARGUMENT);
    assert_int_equal(texsyn_erosion_draw(e, 1, NULL, &nan, NULL, one), TXM_BAD_ARGUMENT);
    assert_int_equal(texsyn_erosion_draw(e, 1, NULL, &bad, NULL, out), TXM_BAD_ARGUMENT);
    assert_int_equal(texsyn_erosion_mask(NULL, 1, NULL, NULL, one), TXM_BAD_ARGUMENT);
    assert_int_equal(texsyn_erosion_mask(e, 1, &nan, NULL, one), TXM_BAD_ARGUMENT);
    assert_int_equal(texsyn_erosion_mask(e, 1, NULL, NULL, out), TXM_BAD_ARGUMENT);
    assert_int_equal(texsyn_erosion_intact(&d, NULL, one), TXM_BAD_ARGUMENT);
    for (size_t i = 0; i < sizeof to; i++) assert_int_equal(to[i], FILL);
    texsyn_erosion_free(e);
    texsyn_erosion_free(NULL);
    assert_true(texsyn_erosion_share(NULL) == 0);
}

static txm_status sweep_make(void *context, txm_env *env) {
    texsyn_erosion *e = (texsyn_erosion *)env;
    const txm_status status = texsyn_erosion_make((const texsyn_erosion_desc *)context, env, &e);
    if (status != TXM_OK) assert_null(e);
    texsyn_erosion_free(e);
    return status;
}

static uint8_t swept[PIXELS];

static txm_status sweep_intact(void *context, txm_env *env) {
    return texsyn_erosion_intact((const texsyn_erosion_desc *)context, env,
                                 view_bytes(swept, STONE, STONE, 1));
}

static txm_status sweep_draw(void *context, txm_env *env) {
    static uint8_t from[PIXELS];
    return texsyn_erosion_draw((const texsyn_erosion *)context, 1, NULL,
                               &(const txm_image){from, WIDTH, HEIGHT, 1, TXM_U8, 0}, env,
                               view_bytes(swept, WIDTH, HEIGHT, 1));
}

static void test_faults(void **state) {
    (void)state;
    static uint8_t stone[STONE * STONE * 3];
    const tk_output output = {swept, sizeof swept};
    texsyn_erosion_desc d = stone_desc(stone, 3);
    d.width = 50;
    d.height = 40;
    assert_true(tk_sweep(sweep_make, &d, TK_ALLOCATION) > 20);
    assert_true(tk_sweep(sweep_make, &d, TK_ONWARD) > 20);
    assert_true(tk_sweep(sweep_make, &d, TK_CANCEL) > 8);
    assert_true(tk_sweep_outputs(sweep_intact, &d, TK_ALLOCATION, &output, 1) > 10);
    assert_true(tk_sweep_outputs(sweep_intact, &d, TK_CANCEL, &output, 1) > 4);
    d.width = WIDTH;
    d.height = HEIGHT;
    texsyn_erosion *e = make(&d);
    assert_int_equal(tk_sweep(sweep_draw, e, TK_ALLOCATION), 1);
    texsyn_erosion_free(e);
}

static void test_threads(void **state) {
    (void)state;
    static uint8_t stone[STONE * STONE * 3], a[PIXELS * 3], b[PIXELS * 3];
    const texsyn_erosion_desc d = stone_desc(stone, 3);
    texsyn_erosion *e = make(&d), *t;
    txm_env env = {0};
    env.parallel_for = tk_parallel_reverse;
    assert_int_equal(texsyn_erosion_make(&d, &env, &t), TXM_OK);
    memset(b, 200, sizeof b);
    const txm_image in = view_bytes(b, WIDTH, HEIGHT, 3);
    assert_int_equal(texsyn_erosion_draw(e, 1, NULL, &in, NULL, view_bytes(a, WIDTH, HEIGHT, 3)), TXM_OK);
    assert_int_equal(texsyn_erosion_draw(t, 1, NULL, &in, NULL, in), TXM_OK);
    assert_memory_equal(a, b, sizeof a);
    texsyn_erosion_free(e);
    texsyn_erosion_free(t);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_levels_nest),     cmocka_unit_test(test_cracks_are_long),
        cmocka_unit_test(test_level_per_pixel), cmocka_unit_test(test_pictures),
        cmocka_unit_test(test_sizes),           cmocka_unit_test(test_unknown_pixels),
        cmocka_unit_test(test_intact),          cmocka_unit_test(test_plain_exemplars),
        cmocka_unit_test(test_make_refuses),    cmocka_unit_test(test_draw_refuses),
        cmocka_unit_test(test_faults),          cmocka_unit_test(test_threads)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
