/* test_texsyn_segment.c - pictures divided into textures
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texsyn_segment && build/tests/unit/test_texsyn_segment */
#include "mosaickit.h"

enum { SIDE = 256, PIXELS = SIDE * SIDE };
static uint8_t pixels[PIXELS * 4], truth[PIXELS], labels[PIXELS], again[PIXELS];

static texsyn_segment_desc segment_desc(txm_image image) {
    texsyn_segment_desc d;
    memset(&d, 0, sizeof d);
    d.image = image;
    return d;
}

/* Segment; labels must be 0..count-1, by area, all of them there, besides the special ones. */
static int segment(const texsyn_segment_desc *d, uint8_t *out) {
    tk_progress progress = {0};
    txm_env env = tk_env(NULL, &progress);
    const int width = d->image.width, height = d->image.height;
    long area[256] = {0};
    int count = -1;
    const txm_status status = texsyn_segment(d, &env, view_bytes(out, width, height, 1), &count);
    if (status != TXM_OK) fail_msg("segment: %d, %s", status, env.message);
    assert_int_equal(progress.errors, 0);
    assert_between(count, 1, TEXSYN_MAX_SEGMENTS);
    for (int i = 0; i < width * height; i++) area[out[i]]++;
    for (int k = 0; k < 254; k++) {
        if (k < count && !area[k]) fail_msg("no pixel has label %d of %d", k, count);
        if (k >= count && area[k]) fail_msg("label %d of %d", k, count);
    }
    if (!d->transition) assert_int_equal(area[TEXSYN_TRANSITION], 0);
    return count;
}

/* ---- what is found ------------------------------------------------------------------------ */

static void test_mosaics(void **state) {
    (void)state;
    const int cases = tk_full() ? 24 : 8;
    double sum = 0;
    int right = 0;
    for (int i = 0; i < cases; i++) {
        const int count = 2 + i % 4;
        draw_mosaic(pixels, truth, SIDE, count, (uint64_t)i);
        const texsyn_segment_desc d = segment_desc(view_bytes(pixels, SIDE, SIDE, 3));
        const int found = segment(&d, labels);
        const double accuracy = mosaic_accuracy(labels, truth, PIXELS, count, found);
        printf("# mosaic %d: %d textures, %d found, accuracy %.3f\n", i, count, found, accuracy);
        sum += accuracy;
        right += found == count;
    }
    assert_true(sum / cases >= 0.95);
    assert_true(right >= cases * 85 / 100);
}

static void test_single_textures(void **state) {
    (void)state;
    tk_wide();
    for (int t = 0; t < MOSAIC_TEXTURES; t++) {
        for (int i = 0; i < PIXELS; i++) mosaic_texel(t, i % SIDE, i / SIDE, pixels + 3 * i);
        const texsyn_segment_desc d = segment_desc(view_bytes(pixels, SIDE, SIDE, 3));
        const int count = segment(&d, labels);
        if (count != 1) fail_msg("texture %d is divided into %d", t, count);
    }
    memset(pixels, 77, sizeof pixels);
    const texsyn_segment_desc d = segment_desc(view_bytes(pixels, SIDE, SIDE, 3));
    assert_int_equal(segment(&d, labels), 1);
}

/* Share of pixels with equal labels. */
static double agreement(const uint8_t *a, const uint8_t *b, int count) {
    int same = 0;
    for (int i = 0; i < count; i++) same += a[i] == b[i];
    return (double)same / count;
}

static void test_turned_and_brighter(void **state) {
    (void)state;
    tk_wide();
    static uint8_t turned[PIXELS * 3], back[PIXELS];
    draw_mosaic(pixels, truth, SIDE, 3, 5);
    texsyn_segment_desc d = segment_desc(view_bytes(pixels, SIDE, SIDE, 3));
    const int count = segment(&d, labels);
    for (int i = 0; i < PIXELS; i++)
        memcpy(turned + 3 * (i % SIDE * SIDE + SIDE - 1 - i / SIDE), pixels + 3 * i, 3);
    d.image.pixels = turned;
    assert_int_equal(segment(&d, again), count);
    for (int i = 0; i < PIXELS; i++) back[i] = again[i % SIDE * SIDE + SIDE - 1 - i / SIDE];
    assert_true(agreement(labels, back, PIXELS) > 0.97);
    for (int i = 0; i < PIXELS * 3; i++) turned[i] = (uint8_t)(pixels[i] * 4 / 5);
    assert_int_equal(segment(&d, again), count);
    assert_true(agreement(labels, again, PIXELS) > 0.97);
}

static void test_forced(void **state) {
    (void)state;
    tk_wide();
    draw_mosaic(pixels, truth, SIDE, 4, 3);
    texsyn_segment_desc d = segment_desc(view_bytes(pixels, SIDE, SIDE, 3));
    for (int k = 1; k <= TEXSYN_MAX_SEGMENTS; k += k < 4 || tk_full() ? 1 : 6) {
        d.segments = k;
        assert_int_equal(segment(&d, labels), k);
    }
    memset(pixels, 0, sizeof pixels); /* even where there is no reason at all */
    d.segments = 7;
    assert_int_equal(segment(&d, labels), 7);
}

/* ---- masks, formats, sizes ------------------------------------------------------------------ */

static void test_masks_and_alpha(void **state) {
    (void)state;
    static uint8_t mask[PIXELS * 2], rgba[PIXELS * 4];
    draw_mosaic(pixels, truth, SIDE, 3, 5);
    texsyn_segment_desc d = segment_desc(view_bytes(pixels, SIDE, SIDE, 3));
    d.mask = view_bytes(mask, SIDE, SIDE, 2);
    for (int i = 0; i < PIXELS; i++) {
        const int x = i % SIDE - 128, y = i / SIDE - 128, inside = x * x + y * y < 120 * 120;
        mask[2 * i] = inside ? 200 : 100;
        mask[2 * i + 1] = 180; /* 200 * 180 is above half of 255 * 255 */
        memcpy(rgba + 4 * i, pixels + 3 * i, 3);
        rgba[4 * i + 3] = inside ? 255 : 0;
        if (!inside) rgba[4 * i] ^= 255; /* colour that nobody sees */
    }
    const int count = segment(&d, labels);
    for (int i = 0; i < PIXELS; i++)
        assert_int_equal(labels[i] == TEXSYN_NO_LABEL, mask[2 * i] == 100);
    for (int i = 0; i < PIXELS; i++) /* outside the mask colours mean nothing */
        if (mask[2 * i] == 100) memset(pixels + 3 * i, i & 255, 3);
    assert_int_equal(segment(&d, again), count);
    assert_memory_equal(labels, again, PIXELS);
    d = segment_desc(view_bytes(rgba, SIDE, SIDE, 4));
    assert_int_equal(segment(&d, again), count);
    assert_memory_equal(labels, again, PIXELS);
}

static void test_formats(void **state) {
    (void)state;
    tk_wide();
    static uint16_t words[PIXELS * 3];
    static float floats[PIXELS * 3];
    static uint8_t upside_down[PIXELS * 3];
    draw_mosaic(pixels, truth, SIDE, 3, 2);
    for (int i = 0; i < PIXELS * 3; i++) {
        words[i] = (uint16_t)(pixels[i] * 257);
        floats[i] = (float)pixels[i] / 255.0f;
    }
    for (int y = 0; y < SIDE; y++)
        memcpy(upside_down + 3 * SIDE * y, pixels + 3 * SIDE * (SIDE - 1 - y), 3 * SIDE);
    texsyn_segment_desc d = segment_desc(view_bytes(pixels, SIDE, SIDE, 3));
    const int count = segment(&d, labels);
    d.image = view_words(words, SIDE, SIDE, 3);
    assert_int_equal(segment(&d, again), count);
    assert_memory_equal(labels, again, PIXELS);
    d.image = view_float(floats, SIDE, SIDE, 3);
    assert_int_equal(segment(&d, again), count);
    assert_memory_equal(labels, again, PIXELS);
    d.image = view_bytes(upside_down + 3 * SIDE * (SIDE - 1), SIDE, SIDE, 3);
    d.image.stride = -3 * SIDE;
    assert_int_equal(segment(&d, again), count);
    assert_memory_equal(labels, again, PIXELS);
    d.image = view_bytes(pixels, SIDE, SIDE * 3 / 2, 1);
    d.image.height = SIDE;
    segment(&d, again);
}

static void test_sizes(void **state) {
    (void)state;
    tk_wide();
    static const int sizes[][2] = {{16, 16}, {17, 33}, {16, 4000},
                                   {9000, 16}, {130, 31}, {1000, 800}};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        const int width = sizes[i][0], height = sizes[i][1];
        const size_t count = (size_t)width * (size_t)height;
        uint8_t *p = (uint8_t *)malloc(3 * count), *out = (uint8_t *)malloc(count + 16);
        assert_non_null(p);
        assert_non_null(out);
        for (int y = 0; y < height; y++)
            for (int x = 0; x < width; x++)
                mosaic_texel(2 * x > width ? 5 : 1, x, y, p + 3 * (y * width + x));
        memset(out, FILL, count + 16);
        texsyn_segment_desc d = segment_desc(view_bytes(p, width, height, 3));
        const int found = segment(&d, out);
        for (size_t k = count; k < count + 16; k++) assert_int_equal(out[k], FILL);
        if (width >= 500 && height >= 500) { /* larger than what is worked at */
            assert_true(out[400 * 1000 + 200] != out[400 * 1000 + 800]);
            assert_int_equal(found, 2); /* the boundary is none */
        }
        free(p);
        free(out);
    }
}

static void test_transition(void **state) {
    (void)state;
    texsyn_segment_desc d = segment_desc(view_bytes(pixels, SIDE, SIDE, 3));
    draw_mosaic(pixels, truth, SIDE, 4, 3);
    d.transition = 1;
    segment(&d, labels);
    int transitions = 0;
    for (int i = 0; i < PIXELS; i++) transitions += labels[i] == TEXSYN_TRANSITION;
    assert_between(transitions, 1, PIXELS / 10); /* tips of cells */
}

/* ---- threads, faults, refusals -------------------------------------------------------------- */

static void test_threads(void **state) {
    (void)state;
    tk_wide();
    draw_mosaic(pixels, truth, SIDE, 4, 9);
    texsyn_segment_desc d = segment_desc(view_bytes(pixels, SIDE, SIDE, 3));
    d.transition = 1;
    const int count = segment(&d, labels);
    int threads = 5, found = 0;
    txm_env env = tk_env(NULL, NULL);
    env.parallel_for = tk_parallel_reverse;
    assert_int_equal(texsyn_segment(&d, &env, view_bytes(again, SIDE, SIDE, 1), &found), TXM_OK);
    assert_int_equal(found, count);
    assert_memory_equal(labels, again, PIXELS);
    env.parallel_for = tk_parallel_threads;
    env.parallel_user = &threads;
    assert_int_equal(texsyn_segment(&d, &env, view_bytes(again, SIDE, SIDE, 1), &found), TXM_OK);
    assert_memory_equal(labels, again, PIXELS);
}

typedef struct fault_case {
    texsyn_segment_desc desc;
    txm_image out;
    int count;
} fault_case;

static txm_status try_segment(void *context, txm_env *env) {
    fault_case *c = (fault_case *)context;
    return texsyn_segment(&c->desc, env, c->out, &c->count);
}

static void test_failing(void **state) {
    (void)state;
    draw_mosaic(pixels, truth, 64, 3, 1);
    fault_case c = {segment_desc(view_bytes(pixels, 64, 64, 3)), view_bytes(labels, 64, 64, 1), 0};
    c.desc.segments = 3;
    c.desc.transition = 1;
    const tk_output outputs[2] = {{labels, 64 * 64}, {&c.count, sizeof c.count}};
    assert_true(tk_sweep_outputs(try_segment, &c, TK_ALLOCATION, outputs, 2) > 20);
    assert_true(tk_sweep_outputs(try_segment, &c, TK_ONWARD, outputs, 2) > 20);
    assert_true(tk_sweep_outputs(try_segment, &c, TK_CANCEL, outputs, 2) > 5);
}

static void refuses(const texsyn_segment_desc *d, txm_image out, txm_status expected,
                    const char *what) {
    tk_memory memory = {0};
    txm_env env = tk_env(&memory, NULL);
    int count = 1234;
    memset(labels, FILL, sizeof labels);
    const txm_status status = texsyn_segment(d, &env, out, &count);
    if (status != expected) fail_msg("%s: status %d, not %d", what, status, expected);
    if (!env.message[0]) fail_msg("%s: no message", what);
    assert_int_equal(count, 1234);
    assert_int_equal(tk_leaks(&memory), 0);
    for (int i = 0; i < PIXELS; i++) assert_int_equal(labels[i], FILL);
    assert_int_equal(texsyn_segment(d, NULL, out, &count), expected);
}

#define REFUSES(field, value, expected)                    \
    do {                                                   \
        texsyn_segment_desc d = good;                      \
        d.field = value;                                   \
        refuses(&d, out, expected, #field " = " #value);   \
    } while (0)

#define REFUSES_OUT(field, value, expected)                      \
    do {                                                         \
        txm_image o = out;                                       \
        o.field = value;                                         \
        refuses(&good, o, expected, "out." #field " = " #value); \
    } while (0)

static void test_bad_arguments(void **state) {
    (void)state;
    static uint8_t mask[64 * 64];
    static float floats[64 * 64];
    texsyn_segment_desc good = segment_desc(view_bytes(pixels, 64, 64, 3));
    const txm_image out = view_bytes(labels, 64, 64, 1);
    txm_env env = tk_env(NULL, NULL);
    good.mask = view_bytes(mask, 64, 64, 1);
    memset(mask, 255, sizeof mask);
    assert_int_equal(texsyn_segment(&good, &env, out, NULL), TXM_BAD_ARGUMENT);
    refuses(NULL, out, TXM_BAD_ARGUMENT, "desc NULL");
    REFUSES(image.pixels, NULL, TXM_BAD_ARGUMENT);
    REFUSES(image.width, 0, TXM_BAD_ARGUMENT);
    REFUSES(image.height, -1, TXM_BAD_ARGUMENT);
    REFUSES(image.width, 15, TXM_TOO_SMALL);
    REFUSES(image.height, 15, TXM_TOO_SMALL);
    REFUSES(image.channels, 2, TXM_BAD_ARGUMENT);
    REFUSES(image.channels, 5, TXM_BAD_ARGUMENT);
    REFUSES(image.stride, 17, TXM_BAD_ARGUMENT);
    REFUSES(image.width, INT_MAX, TXM_TOO_LARGE);
    REFUSES(image.sample, (txm_sample)9, TXM_BAD_ARGUMENT);
    REFUSES(mask.width, 63, TXM_BAD_ARGUMENT);
    REFUSES(mask.height, 65, TXM_BAD_ARGUMENT);
    REFUSES(mask.channels, 5, TXM_BAD_ARGUMENT);
    REFUSES(segments, -1, TXM_BAD_ARGUMENT);
    REFUSES(segments, 17, TXM_BAD_ARGUMENT);
    REFUSES_OUT(pixels, NULL, TXM_BAD_ARGUMENT);
    REFUSES_OUT(width, 63, TXM_BAD_ARGUMENT);
    REFUSES_OUT(height, 63, TXM_BAD_ARGUMENT);
    REFUSES_OUT(channels, 3, TXM_BAD_ARGUMENT);
    REFUSES_OUT(sample, TXM_F32, TXM_BAD_ARGUMENT);
    memset(mask, 127, sizeof mask);
    refuses(&good, out, TXM_TOO_SMALL, "a dark mask");
    memset(mask, 128, 255);
    refuses(&good, out, TXM_TOO_SMALL, "255 pixels");
    memset(mask, 128, 256);
    good.segments = 16; /* a strip of four rows */
    memset(mask + 256, 0, sizeof mask - 256);
    int count = 0;
    assert_int_equal(texsyn_segment(&good, &env, out, &count), TXM_OK);
    assert_int_equal(count, 16);
    floats[100] = (float)INFINITY;
    good.image = view_float(floats, 64, 64, 1);
    refuses(&good, out, TXM_BAD_ARGUMENT, "infinite");
}

/* A picture of one kind of block only has fewer regions than asked for. */
static void test_too_many_segments(void **state) {
    (void)state;
    memset(pixels, 9, sizeof pixels);
    texsyn_segment_desc d = segment_desc(view_bytes(pixels, 256, 256, 3));
    memset(truth, 0, sizeof truth);
    for (int i = 0; i < 16 * 32; i++) truth[i / 32 * 256 + i % 32] = 255;
    d.mask = view_bytes(truth, 256, 256, 1);
    d.segments = 9; /* blocks of 8 x 8: there are eight */
    refuses(&d, view_bytes(labels, 256, 256, 1), TXM_TOO_SMALL, "9 segments");
    d.segments = 8;
    assert_int_equal(segment(&d, labels), 8);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_mosaics),        cmocka_unit_test(test_single_textures),
        cmocka_unit_test(test_turned_and_brighter), cmocka_unit_test(test_forced),
        cmocka_unit_test(test_masks_and_alpha), cmocka_unit_test(test_formats),
        cmocka_unit_test(test_sizes),          cmocka_unit_test(test_transition),
        cmocka_unit_test(test_threads),        cmocka_unit_test(test_failing),
        cmocka_unit_test(test_bad_arguments),  cmocka_unit_test(test_too_many_segments),
    };
    return cmocka_run_group_tests_name("texsyn_segment", tests, NULL, NULL);
}
