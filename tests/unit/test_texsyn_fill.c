/* test_texsyn_fill.c - filling holes: what is known stays, what is missing continues it
   SPDX-License-Identifier: MIT OR Unlicense */
#include "synkit.h"

#include <math.h>

enum { SIDE = 64, MOST = SIDE * SIDE * 4 };

/* ---- pictures with holes ---------------------------------------------------------------------- */

/* Smooth clouds in all channels; alpha is opaque. */
static void draw_clouds(uint8_t *p, int width, int height, int channels) {
    static uint8_t plane[SIDE * SIDE];
    for (int c = 0; c < channels; c++) {
        draw_smooth(plane, width, height, (uint64_t)c / 2 + 5);
        for (int i = 0; i < width * height; i++)
            p[i * channels + c] = (uint8_t)(c == 3 ? 255 : plane[i] / (c + 1) + 20 * c);
    }
}

typedef int shape(int x, int y);

static int square(int x, int y) {
    return x >= 20 && x < 40 && y >= 24 && y < 44;
}

static int scratch(int x, int y) {
    return x >= 2 && abs(y - x / 2 - 10) <= 2;
}

static int corner(int x, int y) {
    return x < 24 && y < 30;
}

static int two(int x, int y) {
    return (x > 5 && x < 15 && y > 5 && y < 15) || (x >= 55 && y >= 50 && y < 60);
}

static int dust(int x, int y) {
    return x % 9 == 4 && y % 11 == 3;
}

static int half(int x, int y) {
    (void)y;
    return x >= SIDE / 2;
}

static int most(int x, int y) {
    return x >= 17 || y >= 17;
}

static int frame(int x, int y) {
    return x < 6 || y < 6 || x >= SIDE - 6 || y >= SIDE - 6;
}

static int checks(int x, int y) {
    return (x + y) & 1;
}

static int dot(int x, int y) {
    return x == 31 && y == 9;
}

static void draw_mask(uint8_t *mask, int width, int height, shape *is_hole) {
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) mask[y * width + x] = is_hole(x, y) ? 255 : 0;
}

static texsyn_fill_desc fill_desc(txm_image image, txm_image mask) {
    texsyn_fill_desc d;
    memset(&d, 0, sizeof d);
    d.image = image;
    d.mask = mask;
    d.quality = -1;
    return d;
}

static void fill(const texsyn_fill_desc *desc, txm_image out) {
    tk_progress progress = {0};
    txm_env env = tk_env(NULL, &progress);
    const txm_status status = texsyn_fill(desc, &env, out);
    if (status != TXM_OK) fail_msg("fill: %d, %s", status, env.message);
    assert_int_equal(progress.errors, 0);
}

/* ---- shapes --------------------------------------------------------------------------------------- */

/* What is known stays; what is missing no longer depends on what was there. */
static void check_shape(shape *is_hole, int channels) {
    static uint8_t image[MOST], other[MOST], mask[SIDE * SIDE], out[MOST], again[MOST];
    draw_clouds(image, SIDE, SIDE, channels);
    draw_mask(mask, SIDE, SIDE, is_hole);
    memcpy(other, image, sizeof other);
    for (int i = 0; i < SIDE * SIDE; i++)
        for (int c = 0; c < channels && mask[i]; c++)
            other[i * channels + c] = (uint8_t)(i * 7 + c);
    texsyn_fill_desc d =
        fill_desc(view_bytes(image, SIDE, SIDE, channels), view_bytes(mask, SIDE, SIDE, 1));
    fill(&d, view_bytes(out, SIDE, SIDE, channels));
    d.image.pixels = other;
    fill(&d, view_bytes(again, SIDE, SIDE, channels));
    for (int i = 0; i < SIDE * SIDE; i++) {
        for (int c = 0; c < channels; c++) {
            const int at = i * channels + c;
            if (!mask[i]) assert_int_equal(out[at], image[at]);
            assert_int_equal(out[at], again[at]);
            if (c == 3) assert_int_equal(out[at], 255);
        }
    }
}

static void test_shapes(void **state) {
    (void)state;
    shape *const shapes[] = {square, scratch, corner, two, dust, half, most, frame, checks, dot};
    for (size_t i = 0; i < sizeof shapes / sizeof *shapes; i++) check_shape(shapes[i], 3);
    check_shape(square, 1);
    check_shape(corner, 4);
}

/* Mean difference of neighbours that lie across the border of the hole, or inside it. */
static double gradient(const uint8_t *p, const uint8_t *mask, int inside) {
    double sum = 0, count = 0;
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            for (int k = 0; k < 2; k++) {
                const int i = y * SIDE + x, j = i + (k ? SIDE : 1);
                if ((k ? y : x) == SIDE - 1) continue;
                if (inside ? !mask[i] || !mask[j] : !mask[i] == !mask[j]) continue;
                sum += abs(p[i] - p[j]);
                count++;
            }
        }
    }
    return sum / count;
}

/* No seam, and neither a blur nor noise. */
static void test_no_seam(void **state) {
    (void)state;
    static uint8_t image[SIDE * SIDE], mask[SIDE * SIDE], out[SIDE * SIDE];
    shape *const shapes[] = {square, corner, scratch};
    draw_clouds(image, SIDE, SIDE, 1);
    for (int i = 0; i < 3; i++) {
        draw_mask(mask, SIDE, SIDE, shapes[i]);
        texsyn_fill_desc d =
            fill_desc(view_bytes(image, SIDE, SIDE, 1), view_bytes(mask, SIDE, SIDE, 1));
        d.quality = 0;
        fill(&d, view_bytes(out, SIDE, SIDE, 1));
        assert_between(gradient(out, mask, 0) / gradient(out, mask, 1), 0.7, 1.4);
        assert_between(gradient(out, mask, 1) / gradient(image, mask, 1), 0.7, 1.4);
    }
}

static void test_constant(void **state) {
    (void)state;
    static uint8_t image[SIDE * SIDE * 3], mask[SIDE * SIDE], out[SIDE * SIDE * 3];
    for (int i = 0; i < SIDE * SIDE * 3; i++) image[i] = (uint8_t)(40 + 50 * (i % 3));
    draw_mask(mask, SIDE, SIDE, square);
    const texsyn_fill_desc d =
        fill_desc(view_bytes(image, SIDE, SIDE, 3), view_bytes(mask, SIDE, SIDE, 1));
    fill(&d, view_bytes(out, SIDE, SIDE, 3));
    for (int i = 0; i < SIDE * SIDE * 3; i++) assert_near(out[i], image[i], 1);
}

/* Larger than a window: it is filled in parts, the inner ones with what the outer ones learned. */
static void test_large(void **state) {
    (void)state;
    enum { WIDE = 700, HIGH = 330, KNOWN = 60 };
    static uint8_t image[WIDE * HIGH], mask[WIDE * HIGH], out[WIDE * HIGH];
    int values[256] = {0};
    draw_patches(image, WIDE, HIGH, 1, 8, 30, 3);
    for (int i = 0; i < WIDE * HIGH; i++) {
        mask[i] = i % WIDE >= KNOWN ? 255 : 0;
        if (mask[i]) image[i] = 255; /* never known */
    }
    texsyn_fill_desc d =
        fill_desc(view_bytes(image, WIDE, HIGH, 1), view_bytes(mask, WIDE, HIGH, 1));
    d.quality = -2;
    fill(&d, view_bytes(out, WIDE, HIGH, 1));
    for (int i = 0; i < WIDE * HIGH; i++) {
        if (!mask[i]) assert_int_equal(out[i], image[i]);
        else values[out[i]]++;
    }
    for (int v = 230; v < 256; v++) assert_int_equal(values[v], 0);
    for (int v = 0; v < 8; v++) { /* all values of the example occur, in parts far from it, too */
        int count = 0;
        for (int k = -8; k <= 8; k++) count += v * 30 + k >= 0 ? values[v * 30 + k] : 0;
        assert_true(count > WIDE * HIGH / 40);
    }
}

/* ---- where to learn, and with what ----------------------------------------------------------------- */

/* The left half is dark, the right one bright; a hole in the bright half filled from the dark one. */
static void test_source(void **state) {
    (void)state;
    static uint8_t image[SIDE * SIDE], mask[SIDE * SIDE], source[SIDE * SIDE], out[SIDE * SIDE];
    double mean = 0;
    draw_clouds(image, SIDE, SIDE, 1);
    for (int i = 0; i < SIDE * SIDE; i++) {
        source[i] = i % SIDE < 28 ? 255 : 0;
        image[i] = (uint8_t)(image[i] / 4 + (source[i] ? 20 : 180));
        mask[i] = i % SIDE >= 34 && i % SIDE < 62 && i / SIDE > 6 && i / SIDE < 60 ? 255 : 0;
    }
    texsyn_fill_desc d =
        fill_desc(view_bytes(image, SIDE, SIDE, 1), view_bytes(mask, SIDE, SIDE, 1));
    d.source = view_bytes(source, SIDE, SIDE, 1);
    d.quality = 0;
    fill(&d, view_bytes(out, SIDE, SIDE, 1));
    for (int y = 20; y < 46; y++)
        for (int x = 44; x < 52; x++) mean += out[y * SIDE + x] / (26.0 * 8);
    assert_true(mean < 110);
}

static void test_model(void **state) {
    (void)state;
    tk_wide();
    for (int channels = 1; channels <= 4; channels += channels == 1 ? 2 : 1) {
        static uint8_t image[MOST], mask[SIDE * SIDE], out[MOST];
        texsyn_model *model = small_model(channels, 3);
        draw_patches(image, SIDE, SIDE, channels, 8, 30, 9);
        draw_mask(mask, SIDE, SIDE, half);
        texsyn_fill_desc d =
            fill_desc(view_bytes(image, SIDE, SIDE, channels), view_bytes(mask, SIDE, SIDE, 1));
        d.model = model;
        fill(&d, view_bytes(out, SIDE, SIDE, channels));
        for (int i = 0; i < SIDE * SIDE * channels; i++)
            if (!mask[i / channels]) assert_int_equal(out[i], image[i]);
        texsyn_model_free(model);
    }
}

/* A texture that was learned in the dark becomes as bright and as rich in contrast as its new
   surroundings. */
static void test_relight(void **state) {
    (void)state;
    enum { LEFT = SIDE / 2 * SIDE }; /* pixels of the hole */
    static uint8_t bright[SIDE * SIDE], dark[SIDE * SIDE], mask[SIDE * SIDE], out[SIDE * SIDE];
    double known[2] = {0, 0}, filled[2] = {0, 0};
    draw_clouds(bright, SIDE, SIDE, 1);
    for (int i = 0; i < SIDE * SIDE; i++) dark[i] = (uint8_t)(bright[i] / 3);
    texsyn_learn_desc learn;
    texsyn_model *model;
    memset(&learn, 0, sizeof learn);
    learn.example = view_bytes(dark, SIDE, SIDE, 1);
    assert_int_equal(texsyn_learn(&learn, NULL, &model), TXM_OK);
    draw_mask(mask, SIDE, SIDE, half);
    texsyn_fill_desc d =
        fill_desc(view_bytes(bright, SIDE, SIDE, 1), view_bytes(mask, SIDE, SIDE, 1));
    d.model = model;
    d.relight = 1;
    fill(&d, view_bytes(out, SIDE, SIDE, 1));
    texsyn_model_free(model);
    for (int i = 0; i < SIDE * SIDE; i++) {
        double *sum = mask[i] ? filled : known;
        sum[0] += out[i] / (double)LEFT;
        sum[1] += (double)out[i] * out[i] / (double)LEFT;
    }
    const double deviation = sqrt(known[1] - known[0] * known[0]);
    assert_true(fabs(filled[0] - known[0]) < 0.5 * deviation);
    const double ratio = sqrt(filled[1] - filled[0] * filled[0]) / deviation;
    assert_true(ratio > 0.6 && ratio < 1.5);
}

/* Colours under transparent pixels make no difference; alpha is continued. */
static void test_alpha(void **state) {
    (void)state;
    static uint8_t image[MOST], mask[SIDE * SIDE], out[MOST], again[MOST];
    int values[256] = {0};
    draw_clouds(image, SIDE, SIDE, 4);
    for (int i = 0; i < SIDE * SIDE; i++)
        if (i / 3 % 5 == 0) image[4 * i + 3] = 0;
    draw_mask(mask, SIDE, SIDE, square);
    const texsyn_fill_desc d =
        fill_desc(view_bytes(image, SIDE, SIDE, 4), view_bytes(mask, SIDE, SIDE, 1));
    fill(&d, view_bytes(out, SIDE, SIDE, 4));
    for (int i = 0; i < SIDE * SIDE; i++) {
        values[out[4 * i + 3]] += mask[i] != 0;
        if (image[4 * i + 3] == 0) memset(image + 4 * i, i * 5, 3);
    }
    assert_true(values[0] > 20 && values[255] > 100);
    fill(&d, view_bytes(again, SIDE, SIDE, 4));
    for (int i = 0; i < SIDE * SIDE; i++)
        if (mask[i]) assert_memory_equal(out + 4 * i, again + 4 * i, 4);
    for (int i = 0; i < SIDE * SIDE; i++) image[4 * i + 3] = 0; /* nothing is visible */
    fill(&d, view_bytes(out, SIDE, SIDE, 4));
    for (int i = 0; i < SIDE * SIDE; i++) assert_int_equal(out[4 * i + 3], 0);
}

/* ---- formats ------------------------------------------------------------------------------------------- */

/* The same picture with 16 bits and as floats, bottom-up and with gaps between the rows; NaN where
   nothing is known. */
static void test_formats(void **state) {
    (void)state;
    static uint8_t image[SIDE * SIDE * 3], mask[SIDE * SIDE], bytes[SIDE * SIDE * 3];
    static uint16_t words[SIDE * SIDE * 3], words_out[SIDE * SIDE * 3];
    static float floats[SIDE * (SIDE * 3 + 5)], floats_out[SIDE * SIDE * 3];
    draw_clouds(image, SIDE, SIDE, 3);
    draw_mask(mask, SIDE, SIDE, square);
    for (int i = 0; i < SIDE * SIDE * 3; i++) {
        const int row = SIDE - 1 - i / (SIDE * 3);
        words[i] = (uint16_t)(image[i] * 257);
        floats[row * (SIDE * 3 + 5) + i % (SIDE * 3)] =
            mask[i / 3] ? (float)NAN : (float)image[i] / 255.0f;
    }
    texsyn_fill_desc d =
        fill_desc(view_bytes(image, SIDE, SIDE, 3), view_bytes(mask, SIDE, SIDE, 1));
    fill(&d, view_bytes(bytes, SIDE, SIDE, 3));
    d.image = view_words(words, SIDE, SIDE, 3);
    fill(&d, view_words(words_out, SIDE, SIDE, 3));
    d.image = view_float(floats + (SIDE - 1) * (SIDE * 3 + 5), SIDE, SIDE, 3);
    d.image.stride = -(ptrdiff_t)((SIDE * 3 + 5) * sizeof(float));
    fill(&d, view_float(floats_out, SIDE, SIDE, 3));
    for (int i = 0; i < SIDE * SIDE * 3; i++) {
        if (!mask[i / 3]) {
            assert_int_equal(words_out[i], words[i]);
            assert_true(floats_out[i] == (float)image[i] / 255.0f);
        }
        assert_near(words_out[i] / 257.0, bytes[i], 0.51);
        assert_near((double)txm_clampf(floats_out[i], 0, 1) * 255, bytes[i], 0.51);
    }
}

/* One rule for masks of all channels: gray times alpha. */
static void test_masks(void **state) {
    (void)state;
    static uint8_t image[SIDE * SIDE], mask[MOST], out[SIDE * SIDE], first[SIDE * SIDE];
    draw_clouds(image, SIDE, SIDE, 1);
    for (int channels = 1; channels <= 4; channels++) {
        for (int i = 0; i < SIDE * SIDE; i++) {
            uint8_t *m = mask + i * channels;
            const int is_hole = square(i % SIDE, i / SIDE);
            memset(m, is_hole || channels % 2 == 0 ? 255 : 100, (size_t)channels);
            if (channels % 2 == 0) m[channels - 1] = is_hole ? 128 : 127;
        }
        const texsyn_fill_desc d =
            fill_desc(view_bytes(image, SIDE, SIDE, 1), view_bytes(mask, SIDE, SIDE, channels));
        fill(&d, view_bytes(channels == 1 ? first : out, SIDE, SIDE, 1));
        if (channels > 1) assert_memory_equal(out, first, sizeof out);
    }
}

/* Order of tasks, threads and buffers make no difference; seeds do. */
static void test_same_bytes(void **state) {
    (void)state;
    static uint8_t image[MOST], mask[SIDE * SIDE], first[MOST], out[MOST];
    draw_clouds(image, SIDE, SIDE, 3);
    draw_mask(mask, SIDE, SIDE, half);
    texsyn_fill_desc d =
        fill_desc(view_bytes(image, SIDE, SIDE, 3), view_bytes(mask, SIDE, SIDE, 1));
    fill(&d, view_bytes(first, SIDE, SIDE, 3));
    for (int threads = 0; threads <= 4; threads += 2) {
        txm_env env;
        int count = threads;
        memset(&env, 0, sizeof env);
        env.parallel_for = threads ? tk_parallel_threads : tk_parallel_reverse;
        env.parallel_user = &count;
        assert_int_equal(texsyn_fill(&d, &env, view_bytes(out, SIDE, SIDE, 3)), TXM_OK);
        assert_memory_equal(out, first, SIDE * SIDE * 3);
    }
    memcpy(out, image, sizeof out);
    d.image.pixels = out; /* in place */
    fill(&d, view_bytes(out, SIDE, SIDE, 3));
    assert_memory_equal(out, first, SIDE * SIDE * 3);
    d.image.pixels = image;
    d.seed = 1;
    fill(&d, view_bytes(out, SIDE, SIDE, 3));
    assert_memory_not_equal(out, first, SIDE * SIDE * 3);
}

/* ---- what is refused -------------------------------------------------------------------------------------- */

static void refuses(txm_status expected, const char *word, const texsyn_fill_desc *d,
                    txm_image out) {
    static uint8_t before[MOST];
    txm_env env;
    memset(&env, 0, sizeof env);
    if (out.pixels) memcpy(before, out.pixels, SIDE * SIDE);
    assert_int_equal(texsyn_fill(d, &env, out), expected);
    if (!strstr(env.message, word)) fail_msg("'%s' lacks '%s'", env.message, word);
    if (out.pixels) assert_memory_equal(before, out.pixels, SIDE * SIDE);
}

static void test_bad_arguments(void **state) {
    (void)state;
    static uint8_t image[SIDE * SIDE * 3], mask[SIDE * SIDE], pixels[SIDE * SIDE * 3];
    static float floats[SIDE * SIDE];
    const txm_image out = view_bytes(pixels, SIDE, SIDE, 1);
    draw_clouds(image, SIDE, SIDE, 1);
    draw_mask(mask, SIDE, SIDE, square);
    const texsyn_fill_desc good =
        fill_desc(view_bytes(image, SIDE, SIDE, 1), view_bytes(mask, SIDE, SIDE, 1));
    texsyn_fill_desc d = good;
    refuses(TXM_BAD_ARGUMENT, "desc is NULL", NULL, out);
    d.image.pixels = NULL;
    refuses(TXM_BAD_ARGUMENT, "image: pixels", &d, out);
    d = good, d.image.channels = 2;
    refuses(TXM_BAD_ARGUMENT, "image: 2 channels", &d, out);
    d = good, d.mask.pixels = NULL;
    refuses(TXM_BAD_ARGUMENT, "mask: pixels", &d, out);
    d = good, d.mask.width--;
    refuses(TXM_BAD_ARGUMENT, "mask: is 63 x 64 pixels", &d, out);
    d = good, d.mask.sample = TXM_F32, d.mask.pixels = floats, floats[77] = NAN;
    refuses(TXM_BAD_ARGUMENT, "mask: samples must be finite", &d, out);
    floats[77] = 0;
    d = good, d.source = d.mask, d.source.height--;
    refuses(TXM_BAD_ARGUMENT, "its picture 64 x 64", &d, out);
    for (int quality = -3; quality <= 3; quality += 6) {
        d = good, d.quality = quality;
        refuses(TXM_BAD_ARGUMENT, "quality", &d, out);
    }
    refuses(TXM_BAD_ARGUMENT, "out: pixels", &good, view_bytes(NULL, SIDE, SIDE, 1));
    refuses(TXM_BAD_ARGUMENT, "out", &good, view_bytes(pixels, SIDE - 1, SIDE, 1));
    refuses(TXM_BAD_ARGUMENT, "out", &good, view_bytes(pixels, SIDE, SIDE, 3));
    refuses(TXM_BAD_ARGUMENT, "out", &good, view_float(floats, SIDE, SIDE, 1));
    texsyn_model *model = small_model(3, 1);
    d = good, d.model = model;
    refuses(TXM_BAD_ARGUMENT, "model", &d, out);
    texsyn_model_free(model);
    for (int i = 0; i < SIDE * SIDE; i++) floats[i] = (float)image[i];
    d = good, d.image = view_float(floats, SIDE, SIDE, 1);
    floats[0] = (float)NAN;
    refuses(TXM_BAD_ARGUMENT, "image: a known sample", &d, view_float(floats, SIDE, SIDE, 1));
    floats[0] = 2e6f;
    refuses(TXM_BAD_ARGUMENT, "image: a known sample", &d, view_float(floats, SIDE, SIDE, 1));
}

static void test_bad_masks(void **state) {
    (void)state;
    static uint8_t image[SIDE * SIDE], mask[SIDE * SIDE], source[SIDE * SIDE], pixels[SIDE * SIDE];
    const txm_image out = view_bytes(pixels, SIDE, SIDE, 1);
    draw_clouds(image, SIDE, SIDE, 1);
    texsyn_fill_desc d =
        fill_desc(view_bytes(image, SIDE, SIDE, 1), view_bytes(mask, SIDE, SIDE, 1));
    memset(mask, 127, sizeof mask);
    refuses(TXM_BAD_ARGUMENT, "mask: is empty", &d, out);
    memset(mask, 128, sizeof mask);
    refuses(TXM_BAD_ARGUMENT, "mask: covers the whole picture", &d, out);
    memset(mask, 0, 255); /* one too few */
    refuses(TXM_TOO_SMALL, "256", &d, out);
    memset(mask, 0, 256);
    fill(&d, out);
    draw_mask(mask, SIDE, SIDE, square);
    d.source = view_bytes(source, SIDE, SIDE, 1);
    refuses(TXM_TOO_SMALL, "256", &d, out);
    memcpy(source, mask, sizeof source); /* only what is missing */
    refuses(TXM_TOO_SMALL, "256", &d, out);
}

/* ---- memory and cancelling --------------------------------------------------------------------------------- */

static txm_status try_fill(void *context, txm_env *env) {
    static uint8_t out[40 * 36 * 3];
    memset(out, FILL, sizeof out);
    const txm_status status =
        texsyn_fill((const texsyn_fill_desc *)context, env, view_bytes(out, 40, 36, 3));
    for (size_t i = 0; i < sizeof out && status != TXM_OK; i++) assert_int_equal(out[i], FILL);
    return status;
}

static void test_failing(void **state) {
    (void)state;
    static uint8_t image[40 * 36 * 3], mask[40 * 36];
    draw_clouds(image, 40, 36, 3);
    draw_mask(mask, 40, 36, square);
    texsyn_fill_desc d = fill_desc(view_bytes(image, 40, 36, 3), view_bytes(mask, 40, 36, 1));
    texsyn_model *model = small_model(3, 2);
    for (int known = 0; known < 2; known++) {
        d.model = known ? model : NULL;
        d.quality = known ? 0 : -2;
        assert_true(tk_sweep(try_fill, &d, TK_ALLOCATION) > 20);
        assert_true(tk_sweep(try_fill, &d, TK_ONWARD) > 20);
        assert_true(tk_sweep(try_fill, &d, TK_CANCEL) > 20);
    }
    texsyn_model_free(model);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_shapes),     cmocka_unit_test(test_no_seam),
        cmocka_unit_test(test_constant),   cmocka_unit_test(test_large),
        cmocka_unit_test(test_source),     cmocka_unit_test(test_model),
        cmocka_unit_test(test_relight),    cmocka_unit_test(test_alpha),
        cmocka_unit_test(test_formats),    cmocka_unit_test(test_masks),
        cmocka_unit_test(test_same_bytes), cmocka_unit_test(test_bad_arguments),
        cmocka_unit_test(test_bad_masks),  cmocka_unit_test(test_failing),
    };
    return cmocka_run_group_tests_name("texsyn_fill", tests, NULL, NULL);
}
