/* test_texmath_light.c - uneven light: taken out, and told from content
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texmath_light && build/tests/unit/test_texmath_light */
#include "mathkit.h"

enum { SIDE = 128, SAMPLES = SIDE * SIDE * 4 };

/* a picture with memory of its own */
typedef struct picture {
    union {
        uint8_t bytes[SAMPLES];
        uint16_t words[SAMPLES];
        float floats[SAMPLES];
    } memory;
    txm_image image;
} picture;

static void start(picture *p, int channels, txm_sample sample) {
    memset(p, 0, sizeof *p);
    p->image = txm_image_resolve(view(&p->memory, SIDE, SIDE, channels, sample));
}

/* ---- scenes: light of a texture, and light that falls on it, both linear -------------------- */

typedef double scene(double x, double y, int c); /* x, y: 0..1 */

static double plain(double x, double y, int c) {
    (void)x, (void)y, (void)c;
    return 0.3;
}
static double grain(double x, double y, int c) {
    return 0.1 + 0.2 * at_random((int)(x * SIDE), (int)(y * SIDE), c) / 255;
}
static double bricks(double x, double y, int c) {
    const int row = (int)(y * 10);
    const double u = x * 5 + row % 2 * 0.5, v = y * 10 - row;
    const double noise = at_random((int)(x * SIDE), (int)(y * SIDE), c) / 2550.0;
    return (u - floor(u) < 0.1 || v < 0.15 ? 0.4 : 0.1 + 0.02 * (((int)u + 3 * row) % 4)) + noise;
}
/* stones of a third of the side, each with a tone of its own */
static double stones(double x, double y, int c) {
    const int stone = at_random((int)(x * 3 + y), (int)(y * 3 - x + 9), 3);
    return 0.05 + 0.3 * stone / 255 + at_random((int)(x * SIDE), (int)(y * SIDE), c) / 2550.0;
}
/* more and more pebbles to the right: their share changes, not the light */
static double pebbles(double x, double y, int c) {
    const double noise = at_random((int)(x * SIDE), (int)(y * SIDE), c) / 2550.0;
    const int chance = at_random((int)(x * SIDE / 3), (int)(y * SIDE / 3), 7);
    return (chance < 255 * (0.2 + 0.6 * x) ? 0.4 : 0.1) + noise;
}
/* sky over ground: bright and without contrast above */
static double horizon(double x, double y, int c) {
    return y < 0.4 ? 0.6 - 0.2 * y : grain(x, y, c) * 0.5;
}

static double even_light(double x, double y, int c) {
    (void)x, (void)y, (void)c;
    return 1;
}
static double falloff(double x, double y, int c) {
    (void)c;
    return 0.5 + 0.8 * x + 0.2 * y;
}
static double corners(double x, double y, int c) {
    const double r = (2 * x - 1) * (2 * x - 1) + (2 * y - 1) * (2 * y - 1);
    (void)c;
    return 1.3 / ((1 + 0.3 * r) * (1 + 0.3 * r));
}
static double cast(double x, double y, int c) {
    (void)y;
    return c == 0 ? 0.7 + 0.6 * x : c == 2 ? 1.3 - 0.6 * x : 1;
}

static void set_light(picture *p, int x, int y, int c, double light) {
    const double code = p->image.sample == TXM_F32 ? light : txm_light_code(light);
    txm_image_set(&p->image, x, y, c, txm_float(code));
}

/* Alpha, if there is one, is 1. */
static void draw(picture *p, scene *texture, scene *light) {
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            const double u = (x + 0.5) / SIDE, v = (y + 0.5) / SIDE;
            for (int c = 0; c < p->image.channels; c++) {
                const int is_alpha = txm_image_has_alpha(&p->image) && c == p->image.channels - 1;
                set_light(p, x, y, c, is_alpha ? 1 : texture(u, v, c) * light(u, v, c));
            }
        }
    }
}

static double light_at(const picture *p, int x, int y, int c) {
    const double code = (double)txm_image_get(&p->image, x, y, c);
    return p->image.sample == TXM_F32 ? code : txm_light_of(code);
}

/* mean light of a window */
static double mean_of(const picture *p, int left, int top, int width, int height, int c) {
    double sum = 0;
    for (int y = top; y < top + height; y++)
        for (int x = left; x < left + width; x++) sum += light_at(p, x, y, c);
    return sum / width / height;
}

static void even(picture *p, float radius) {
    txm_even_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.image = p->image;
    desc.radius = radius;
    assert_int_equal(txm_even(&desc, NULL, &p->image), TXM_OK);
}

/* ---- taking it out ------------------------------------------------------------------------ */

/* Falloff, dark corners and a cast vanish; the mean light and the texture's contrast stay. */
static void test_even(void **state) {
    static picture p, flat;
    static scene *const lights[] = {falloff, corners, cast};
    static const txm_sample samples[] = {TXM_U8, TXM_U16, TXM_F32};
    (void)state;
    for (int i = 0; i < 9; i++) {
        start(&p, 3, samples[i / 3]);
        start(&flat, 3, samples[i / 3]);
        draw(&p, grain, lights[i % 3]);
        draw(&flat, grain, even_light);
        double before[3];
        for (int c = 0; c < 3; c++) before[c] = mean_of(&p, 0, 0, SIDE, SIDE, c);
        even(&p, 0);
        for (int c = 0; c < 3; c++) {
            const double mean = mean_of(&p, 0, 0, SIDE, SIDE, c);
            assert_near(mean / before[c], 1, 0.01);
            for (int k = 0; k < 16; k++) {
                const int x = k % 4 * 32, y = k / 4 * 32;
                const double own =
                    mean_of(&flat, x, y, 32, 32, c) / mean_of(&flat, 0, 0, SIDE, SIDE, c);
                assert_near(mean_of(&p, x, y, 32, 32, c) / mean / own, 1, 0.06);
            }
            for (int k = 1; k < 8; k++) { /* neighbours: the same ratio as in even light */
                const int x = 16 * k, y = 128 - 15 * k;
                const double want = light_at(&flat, x, y, c) / light_at(&flat, x - 1, y, c);
                assert_near(light_at(&p, x, y, c) / light_at(&p, x - 1, y, c) / want, 1, 0.05);
            }
        }
    }
}

/* A wave of two radii loses half its height, a long one nearly all, a short one nothing. */
static void test_width(void **state) {
    static picture p;
    static const struct {
        int length;
        double low, high;
    } waves[] = {{8, 0.99, 1.03}, {32, 0.45, 0.55}, {64, 0.1, 0.25}, {128, 0, 0.08}};
    (void)state;
    for (int k = 0; k < 4; k++) {
        double height[2] = {0, 0};
        start(&p, 1, TXM_F32);
        for (int after = 0; after < 2; after++) {
            for (int x = 0; x < SIDE && !after; x++) {
                const double v = 0.3 * (1 + 0.1 * cos(2 * TXM_PI * (x + 0.5) / waves[k].length));
                for (int y = 0; y < SIDE; y++) set_light(&p, x, y, 0, v);
            }
            if (after) even(&p, 16);
            for (int x = 32; x < 96; x++) /* away from the borders */
                height[after] = fmax(height[after], fabs(light_at(&p, x, 64, 0) - 0.3));
        }
        assert_true(height[1] >= waves[k].low * height[0] && height[1] <= waves[k].high * height[0]);
    }
}

/* A straight falloff vanishes up to the very borders, whatever the radius. */
static void test_borders(void **state) {
    static picture p;
    static const float radii[] = {8, 16, 50, 64, 500, 1e6f};
    (void)state;
    for (int k = 0; k < 6; k++) {
        start(&p, 1, TXM_F32);
        draw(&p, plain, falloff);
        const double mean = mean_of(&p, 0, 0, SIDE, SIDE, 0);
        even(&p, radii[k]);
        for (int i = 0; i < SIDE * SIDE; i++)
            assert_near(light_at(&p, i % SIDE, i / SIDE, 0) / mean, 1, 0.02);
    }
}

/* What is nearly black stays dark: brightened 8 times, not 100 times. */
static void test_dark(void **state) {
    static picture p;
    (void)state;
    start(&p, 1, TXM_F32);
    draw(&p, grain, even_light);
    for (int i = 0; i < SIDE * SIDE; i++) {
        if (i % SIDE < SIDE / 2) p.memory.floats[i] *= 0.01f;
    }
    const double before = mean_of(&p, 0, 0, 16, SIDE, 0);
    even(&p, 16);
    assert_true(mean_of(&p, 0, 0, 16, SIDE, 0) < 18 * before); /* 8, and what the mean gains */
    start(&p, 3, TXM_U8); /* black stays black */
    even(&p, 16);
    for (int i = 0; i < SIDE * SIDE * 3; i++) assert_int_equal(p.memory.bytes[i], 0);
}

/* Neither masked nor transparent pixels have any part in the others. */
static void test_hidden(void **state) {
    static picture p[2], mask;
    (void)state;
    for (int with_alpha = 0; with_alpha < 2; with_alpha++) {
        for (int k = 0; k < 2; k++) {
            txm_even_desc desc;
            memset(&desc, 0, sizeof desc);
            start(&p[k], 3 + with_alpha, TXM_U8);
            start(&mask, 1, with_alpha ? TXM_U8 : TXM_U16);
            draw(&p[k], grain, falloff);
            for (int i = 0; i < SIDE * SIDE; i++) {
                const int x = i % SIDE, y = i / SIDE, is_hidden = x > 20 && x < 70 && y > 60;
                txm_image_set(&mask.image, x, y, 0, is_hidden ? 0.3f : 0.6f);
                if (!is_hidden) continue;
                for (int c = 0; c < 3; c++) txm_image_set(&p[k].image, x, y, c, (float)k);
                if (with_alpha) txm_image_set(&p[k].image, x, y, 3, 0);
            }
            desc.image = p[k].image;
            desc.radius = 24;
            if (!with_alpha) desc.mask = mask.image;
            assert_int_equal(txm_even(&desc, NULL, &p[k].image), TXM_OK);
        }
        for (int i = 0; i < SIDE * SIDE; i++) {
            const int x = i % SIDE, y = i / SIDE;
            if (!(txm_image_get(&mask.image, x, y, 0) >= 0.5f)) continue;
            for (int c = 0; c < 3 + with_alpha; c++)
                assert_true(txm_image_get(&p[0].image, x, y, c) ==
                            txm_image_get(&p[1].image, x, y, c));
        }
        for (int y = 64; y < 128; y += 8) /* and the falloff beside the hole is gone */
            assert_near(mean_of(&p[0], 71, y, 16, 8, 0) / mean_of(&p[0], 4, y, 16, 8, 0), 1, 0.2);
    }
    start(&p[0], 2, TXM_U8); /* nothing shows at all: nothing changes */
    for (int i = 0; i < SIDE * SIDE; i++) p[0].memory.bytes[2 * i] = (uint8_t)(i % 251);
    p[1] = p[0];
    even(&p[0], 16);
    assert_memory_equal(p[0].memory.bytes, p[1].memory.bytes, SIDE * SIDE * 2);
}

/* 16 bits stay 16 bits: the same as in float, and more than 8 bits can tell apart. */
static void test_depth(void **state) {
    static picture p[3];
    static const txm_sample samples[] = {TXM_F32, TXM_U16, TXM_U8};
    (void)state;
    for (int k = 0; k < 3; k++) {
        start(&p[k], 3, samples[k]);
        draw(&p[k], bricks, corners);
        even(&p[k], 30);
    }
    int between = 0;
    for (int i = 0; i < SIDE * SIDE * 3; i++) {
        const double code = txm_light_code((double)txm_clampf(p[0].memory.floats[i], 0, 1));
        assert_near(p[1].memory.words[i] / 65535.0, code, 3e-5);
        assert_near(p[2].memory.bytes[i] / 255.0, code, 5e-3);
        between += p[1].memory.words[i] % 257 != 0;
    }
    assert_true(between > SIDE * SIDE * 2);
}

/* Rows backwards, in another place, on threads: the same bytes. */
static void test_same(void **state) {
    static picture p, copy;
    (void)state;
    for (int channels = 1; channels <= 4; channels++) {
        txm_even_desc desc;
        memset(&desc, 0, sizeof desc);
        start(&p, channels, TXM_U8);
        start(&copy, channels, TXM_U8);
        draw(&p, grain, falloff);
        desc.image = p.image;
        desc.radius = 20;
        txm_image flipped = copy.image;
        flipped.pixels = txm_image_row(&copy.image, SIDE - 1);
        flipped.stride = -flipped.stride;
        txm_env env = tk_env(NULL, NULL);
        env.parallel_for = tk_parallel_reverse;
        assert_int_equal(txm_even(&desc, &env, &flipped), TXM_OK);
        even(&p, 20);
        for (int y = 0; y < SIDE; y++)
            assert_memory_equal(txm_image_row(&p.image, y), txm_image_row(&flipped, y),
                                (size_t)(SIDE * channels));
    }
}

/* ---- is it light? ------------------------------------------------------------------------- */

static double stops_of(picture *p, scene *texture, scene *light) {
    txm_even_desc desc;
    float stops = 7;
    memset(&desc, 0, sizeof desc);
    draw(p, texture, light);
    desc.image = p->image;
    assert_int_equal(txm_uneven(&desc, NULL, &stops), TXM_OK);
    return (double)stops;
}

static void test_uneven(void **state) {
    static picture p;
    static const txm_sample samples[] = {TXM_U8, TXM_U16, TXM_F32};
    (void)state;
    for (int k = 0; k < 3; k++) {
        start(&p, 3, samples[k]);
        assert_near(stops_of(&p, grain, falloff), log2(1.5 / 0.5), 0.3);
        assert_near(stops_of(&p, grain, corners), 2 * log2(1.6), 0.4);
        assert_near(stops_of(&p, grain, cast), log2(1.3 / 0.7), 0.2);
        assert_true(stops_of(&p, bricks, falloff) > 1);
        /* content is not light */
        assert_true(stops_of(&p, plain, even_light) == 0);
        assert_true(stops_of(&p, grain, even_light) == 0);
        assert_true(stops_of(&p, bricks, even_light) == 0);
        assert_true(stops_of(&p, stones, even_light) == 0);
        assert_true(stops_of(&p, pebbles, even_light) == 0);
        assert_true(stops_of(&p, horizon, even_light) == 0);
        draw(&p, grain, corners);
        even(&p, 0); /* once evened it is even */
        txm_even_desc desc;
        float stops = 7;
        memset(&desc, 0, sizeof desc);
        desc.image = p.image;
        assert_int_equal(txm_uneven(&desc, NULL, &stops), TXM_OK);
        assert_true(stops == 0);
    }
}

/* Only what counts is measured; too little of it tells nothing. */
static void test_uneven_mask(void **state) {
    static picture p, mask;
    txm_even_desc desc;
    float stops = 7;
    (void)state;
    memset(&desc, 0, sizeof desc);
    start(&p, 4, TXM_U8);
    start(&mask, 1, TXM_U8);
    draw(&p, grain, falloff);
    for (int i = 0; i < SIDE * SIDE; i++) {
        const int x = i % SIDE - 90, y = i / SIDE - 80, is_object = x * x + y * y < 700;
        mask.memory.bytes[i] = is_object ? 0 : 255;
        if (is_object) memset(&p.memory.bytes[4 * i], i % 7 ? 0 : 255, 3);
    }
    desc.image = p.image;
    assert_int_equal(txm_uneven(&desc, NULL, &stops), TXM_OK);
    assert_true(stops == 0); /* the object is too much */
    desc.mask = mask.image;
    assert_int_equal(txm_uneven(&desc, NULL, &stops), TXM_OK);
    assert_near((double)stops, log2(1.5 / 0.5), 0.3);
    memset(&desc.mask, 0, sizeof desc.mask);
    for (int i = 0; i < SIDE * SIDE; i++) p.memory.bytes[4 * i + 3] = mask.memory.bytes[i];
    assert_int_equal(txm_uneven(&desc, NULL, &stops), TXM_OK);
    assert_near((double)stops, log2(1.5 / 0.5), 0.3);
    for (int i = 0; i < SIDE * SIDE; i++) p.memory.bytes[4 * i + 3] = i % SIDE < 40 ? 255 : 0;
    assert_int_equal(txm_uneven(&desc, NULL, &stops), TXM_OK);
    assert_true(stops == 0);
    draw(&p, grain, falloff);
    desc.image.width = desc.image.height = 63;
    assert_int_equal(txm_uneven(&desc, NULL, &stops), TXM_OK);
    assert_true(stops == 0);
}

/* ---- refusals and faults ------------------------------------------------------------------ */

static void test_bad(void **state) {
    static picture p, other;
    txm_even_desc good, desc;
    float stops = 7;
    (void)state;
    start(&p, 3, TXM_F32);
    start(&other, 3, TXM_U8);
    memset(&good, 0, sizeof good);
    good.image = p.image;
    static const float radii[] = {-1, 1, 7.5f, 2e6f, NAN, INFINITY};
    for (int k = 0; k < 6; k++) {
        desc = good;
        desc.radius = radii[k];
        assert_int_equal(txm_even(&desc, NULL, &p.image), TXM_BAD_ARGUMENT);
        assert_int_equal(txm_uneven(&desc, NULL, &stops), TXM_BAD_ARGUMENT);
        assert_true(stops == 0);
    }
    assert_int_equal(txm_even(NULL, NULL, &p.image), TXM_BAD_ARGUMENT);
    assert_int_equal(txm_even(&good, NULL, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(txm_even(&good, NULL, &other.image), TXM_BAD_ARGUMENT);
    assert_int_equal(txm_uneven(NULL, NULL, &stops), TXM_BAD_ARGUMENT);
    assert_int_equal(txm_uneven(&good, NULL, NULL), TXM_BAD_ARGUMENT);
    desc = good;
    desc.mask = other.image;
    desc.mask.channels = 5;
    assert_int_equal(txm_even(&desc, NULL, &p.image), TXM_BAD_ARGUMENT);
    desc.mask.channels = 1;
    desc.mask.height--;
    assert_int_equal(txm_even(&desc, NULL, &p.image), TXM_BAD_ARGUMENT);
    p.memory.floats[5] = INFINITY;
    assert_int_equal(txm_even(&good, NULL, &p.image), TXM_BAD_ARGUMENT);
    assert_int_equal(txm_uneven(&good, NULL, &stops), TXM_BAD_ARGUMENT);
}

typedef struct fault_case {
    txm_even_desc desc;
    picture from, to;
} fault_case;

static txm_status try_even(void *context, txm_env *env) {
    const fault_case *f = (const fault_case *)context;
    return txm_even(&f->desc, env, &f->to.image);
}

static txm_status try_uneven(void *context, txm_env *env) {
    const fault_case *f = (const fault_case *)context;
    float stops = 7;
    const txm_status status = txm_uneven(&f->desc, env, &stops);
    assert_true(status == TXM_OK || stops == 0);
    return status;
}

static void test_faults(void **state) {
    static fault_case f;
    (void)state;
    start(&f.from, 3, TXM_U16);
    start(&f.to, 3, TXM_U16);
    draw(&f.from, grain, falloff);
    f.desc.image = f.from.image;
    const tk_output outputs[1] = {{&f.to.memory, sizeof f.to.memory}};
    assert_true(tk_sweep_outputs(try_even, &f, TK_ALLOCATION, outputs, 1) > 5);
    assert_true(tk_sweep_outputs(try_even, &f, TK_ONWARD, outputs, 1) > 5);
    assert_true(tk_sweep_outputs(try_even, &f, TK_CANCEL, outputs, 1) > 1);
    assert_true(tk_sweep(try_uneven, &f, TK_ALLOCATION) > 1);
    assert_true(tk_sweep(try_uneven, &f, TK_CANCEL) > 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_even),        cmocka_unit_test(test_width),
        cmocka_unit_test(test_borders),     cmocka_unit_test(test_dark),
        cmocka_unit_test(test_hidden),      cmocka_unit_test(test_depth),
        cmocka_unit_test(test_same),        cmocka_unit_test(test_uneven),
        cmocka_unit_test(test_uneven_mask), cmocka_unit_test(test_bad),
        cmocka_unit_test(test_faults),
    };
    return cmocka_run_group_tests_name("texmath light", tests, NULL, NULL);
}
