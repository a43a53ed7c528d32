/* test_texsyn_relight.c - relighting: changes of light undone, grays, depths, masks, bad input
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texsyn_relight && build/tests/unit/test_texsyn_relight */
#include "synkit.h"

enum { SIDE = 64, COUNT = SIDE * SIDE };

/* ---- pictures and lights ---------------------------------------------------------------- */

/* Soft patches of a few materials; `dull` of 0 has strong colours, of 1 nearly none. */
static void draw_materials(float *p, int which, double dull, double split) {
    static const double colours[4][3] = {
        {0.35, 0.5, 0.2}, {0.62, 0.5, 0.36}, {0.45, 0.44, 0.5}, {0.7, 0.3, 0.2}};
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++, p += 3) {
            const int patch = at_random(x / 6, y / 6, which) * 2 + at_random(x / 3, y / 3, which + 50);
            const double *c = colours[patch < split * 765 ? 0 : 1 + patch % 3];
            const double gray = (c[0] + c[1] + c[2]) / 3;
            const double shade = 0.55 + 0.6 * (at_random(x / 2, y / 2, which + 9) + at_random(x, y, which)) / 510;
            for (int k = 0; k < 3; k++)
                p[k] = (float)(shade * (c[k] + dull * (gray - c[k])));
        }
    }
}

typedef struct light {
    const char *name;
    double tint[3], gamma, contrast, saturation; /* tint in linear light */
} light;

static const light lights[] = {
    {"warm", {1, 0.85, 0.6}, 1, 1, 1},          {"cold", {0.75, 0.9, 1}, 1, 1, 1},
    {"less exposed", {0.5, 0.5, 0.5}, 1, 1, 1}, {"more exposed", {1.5, 1.5, 1.5}, 1, 1, 1},
    {"gamma up", {1, 1, 1}, 1.5, 1, 1},         {"gamma down", {1, 1, 1}, 0.65, 1, 1},
    {"flat", {1, 1, 1}, 1, 0.6, 1},             {"harsh", {1, 1, 1}, 1, 1.3, 1},
    {"overcast", {0.6, 0.68, 0.8}, 1, 0.75, 0.6}, {"sunny", {1.1, 1, 0.8}, 1, 1.2, 1.25}};
enum { LIGHT_COUNT = sizeof lights / sizeof *lights };

/* srgb in the given light, clipped and rounded to 8 bits */
static void shine(const light *l, const float *from, uint8_t *to) {
    for (int i = 0; i < COUNT; i++) {
        double linear[3], gray = 0;
        for (int c = 0; c < 3; c++) {
            linear[c] = (double)txm_srgb_to_linear(from[3 * i + c]);
            gray += linear[c] / 3;
        }
        for (int c = 0; c < 3; c++) {
            double v = (gray + (linear[c] - gray) * l->saturation) * l->tint[c];
            v = (double)txm_linear_to_srgb((float)(v < 0 ? 0 : v > 1 ? 1 : v));
            v = 0.45 + (pow(v, l->gamma) - 0.45) * l->contrast;
            to[3 * i + c] = (uint8_t)(255 * (v < 0 ? 0 : v > 1 ? 1 : v) + 0.5);
        }
    }
}

static void lab_of(const uint8_t *rgb, double lab[3]) {
    static const double m[3][3] = {{0.4339, 0.3762, 0.1899}, {0.2126, 0.7152, 0.0722}, {0.0177, 0.1095, 0.8728}};
    double f[3];
    for (int k = 0; k < 3; k++) {
        double t = 0;
        for (int c = 0; c < 3; c++) t += m[k][c] * (double)txm_srgb_to_linear((float)rgb[c] / 255);
        f[k] = t > 0.008856 ? cbrt(t) : 7.787 * t + 16.0 / 116;
    }
    lab[0] = 116 * f[1] - 16;
    lab[1] = 500 * (f[0] - f[1]);
    lab[2] = 200 * (f[1] - f[2]);
}

static double lab_distance(const uint8_t *a, const uint8_t *b) {
    double sum = 0;
    for (int i = 0; i < COUNT; i++) {
        double p[3], q[3], square = 0;
        lab_of(a + 3 * i, p);
        lab_of(b + 3 * i, q);
        for (int k = 0; k < 3; k++) square += (p[k] - q[k]) * (p[k] - q[k]);
        sum += sqrt(square);
    }
    return sum / COUNT;
}

static texsyn_relight_desc relight_desc(void *image, void *like) {
    texsyn_relight_desc d;
    memset(&d, 0, sizeof d);
    d.image = view_bytes(image, SIDE, SIDE, 3);
    d.like = view_bytes(like, SIDE, SIDE, 3);
    return d;
}

static void relight(const texsyn_relight_desc *d, txm_image out) {
    tk_progress progress = {0};
    txm_env env = tk_env(NULL, &progress);
    const txm_status status = texsyn_relight(d, &env, out);
    if (status != TXM_OK) fail_msg("relight: %d, %s", status, env.message);
    assert_int_equal(progress.errors, 0);
}

/* what is left of the Lab distance for one light, on average over pictures; *most: the worst */
static double what_is_left(const light *l, int like_offset, double split, double like_split, double *most) {
    static float drawn[COUNT * 3], other[COUNT * 3];
    static uint8_t truth[COUNT * 3], like[COUNT * 3], lit[COUNT * 3], out[COUNT * 3];
    const light plain = {"", {1, 1, 1}, 1, 1, 1};
    double sum = 0;
    for (int k = 0; k < 4; k++) {
        draw_materials(drawn, k, 0.2 * k, split);
        draw_materials(other, k + like_offset, 0.2 * k, like_split);
        shine(&plain, drawn, truth);
        shine(&plain, other, like);
        shine(l, drawn, lit);
        const texsyn_relight_desc d = relight_desc(lit, like);
        relight(&d, view_bytes(out, SIDE, SIDE, 3));
        const double left = lab_distance(out, truth) / lab_distance(lit, truth);
        sum += left / 4;
        if (left > *most) *most = left;
    }
    return sum;
}

/* The same picture, then the same materials in other patches: the light is undone. */
static void test_lights_are_undone(void **state) {
    (void)state;
    tk_wide();
    for (int offset = 0; offset <= 100; offset += 100) {
        double mean = 0, most = 0;
        for (int i = 0; i < LIGHT_COUNT; i++) {
            double worst = 0;
            const double left = what_is_left(&lights[i], offset, 0.5, 0.5, &worst);
            mean += left / LIGHT_COUNT;
            if (worst > most) most = worst;
            if (tk_full()) print_message("%s: %.3f, at most %.3f\n", lights[i].name, left, worst);
        }
        print_message("left of the Lab distance: %.3f, at most %.3f\n", mean, most);
        assert_true(mean < (offset ? 0.4 : 0.17));
        assert_true(most < (offset ? 1.2 : 0.4));
    }
}

/* The same materials in other shares: the first has a third of one picture, three fifths of the other.
   That is hard, and for some pictures the light is guessed wrongly; on average it must help. */
static void test_unequal_shares(void **state) {
    (void)state;
    double mean = 0, most = 0;
    for (int i = 0; i < LIGHT_COUNT; i++)
        mean += what_is_left(&lights[i], 100, 0.4, 0.58, &most) / LIGHT_COUNT;
    print_message("left with other shares: %.3f, at most %.3f\n", mean, most);
    assert_true(mean < 0.8);
}

/* ---- grays and depths ------------------------------------------------------------------- */

/* Whatever the light, R = G = B stays R = G = B, in all depths and at all strengths; and brighter stays
   brighter. */
static void test_grays_stay_gray(void **state) {
    (void)state;
    static float drawn[COUNT * 3], ramp[3 * 1024];
    static uint8_t like[COUNT * 3], lit[COUNT * 3];
    static union {
        uint8_t bytes[3 * 1024];
        uint16_t words[3 * 1024];
        float floats[3 * 1024];
    } in, out;
    static const txm_sample samples[3] = {TXM_U8, TXM_U16, TXM_F32};
    const light plain = {"", {1, 1, 1}, 1, 1, 1};
    for (int i = 0; i < 1024; i++) ramp[3 * i] = ramp[3 * i + 1] = ramp[3 * i + 2] = (float)i / 1023;
    draw_materials(drawn, 1, 0.2, 0.5);
    shine(&plain, drawn, like);
    for (int k = 0; k < LIGHT_COUNT; k++) {
        texsyn_light l;
        shine(&lights[k], drawn, lit);
        const texsyn_relight_desc d = relight_desc(lit, like);
        assert_int_equal(texsyn_light_learn(&d, NULL, &l), TXM_OK);
        for (int s = 0; s < 3; s++) {
            const txm_image from = view(&in, 1024, 1, 3, samples[s]), to = view(&out, 1024, 1, 3, samples[s]);
            for (int i = 0; i < 3 * 1024; i++) txm_image_set(&from, i / 3, 0, i % 3, ramp[i]);
            for (int strength = 1; strength <= 4; strength++) {
                float last = 0;
                assert_int_equal(texsyn_light_apply(&l, (float)strength / 4, &from, NULL, to), TXM_OK);
                for (int i = 0; i < 1024; i++) {
                    const float r = txm_image_get(&to, i, 0, 0);
                    assert_true(r == txm_image_get(&to, i, 0, 1) && r == txm_image_get(&to, i, 0, 2));
                    if (s > 0) assert_true(r >= last);
                    last = r;
                }
            }
        }
    }
}

/* A smooth ramp of 16 bits has no step much larger than the curve's slope; and no noise. */
static void test_no_bands(void **state) {
    (void)state;
    static float drawn[COUNT * 3];
    static uint8_t like[COUNT * 3], lit[COUNT * 3], bytes[4096];
    static uint16_t in[4096], out[4096];
    texsyn_light l;
    const light plain = {"", {1, 1, 1}, 1, 1, 1};
    draw_materials(drawn, 2, 0.2, 0.5);
    shine(&plain, drawn, like);
    shine(&lights[6], drawn, lit); /* flat: the curve is steep */
    const texsyn_relight_desc d = relight_desc(lit, like);
    assert_int_equal(texsyn_light_learn(&d, NULL, &l), TXM_OK);
    for (int i = 0; i < 4096; i++) in[i] = (uint16_t)(20000 + 4 * i);
    const txm_image from = view_words(in, 4096, 1, 1);
    assert_int_equal(texsyn_light_apply(&l, 1, &from, NULL, view_words(out, 4096, 1, 1)), TXM_OK);
    for (int i = 1; i < 4096; i++) assert_true(out[i] >= out[i - 1] && out[i] - out[i - 1] <= 20);
    /* 8 bits: a flat area lies between two values, and its mean is right */
    for (int i = 0; i < 4096; i++) in[i] = 30000;
    assert_int_equal(texsyn_light_apply(&l, 1, &from, NULL, view_bytes(bytes, 4096, 1, 1)), TXM_OK);
    assert_int_equal(texsyn_light_apply(&l, 1, &from, NULL, view_words(out, 4096, 1, 1)), TXM_OK);
    double sum = 0;
    for (int i = 0; i < 4096; i++) sum += bytes[i] / 4096.0;
    assert_near(sum, out[0] / 257.0, 0.05);
}

static void test_strength(void **state) {
    (void)state;
    static float drawn[COUNT * 3];
    static uint8_t like[COUNT * 3], lit[COUNT * 3], whole[COUNT * 3], half[COUNT * 3], out[COUNT * 3];
    const light plain = {"", {1, 1, 1}, 1, 1, 1};
    texsyn_light l;
    draw_materials(drawn, 3, 0.2, 0.5);
    shine(&plain, drawn, like);
    shine(&lights[8], drawn, lit);
    texsyn_relight_desc d = relight_desc(lit, like);
    const txm_image im = d.image;
    relight(&d, view_bytes(whole, SIDE, SIDE, 3));
    d.strength = 0.5f;
    relight(&d, view_bytes(half, SIDE, SIDE, 3));
    for (int i = 0; i < 3 * COUNT; i++) assert_near(half[i], (lit[i] + whole[i]) / 2.0, 1.6);
    assert_int_equal(texsyn_light_learn(&d, NULL, &l), TXM_OK);
    assert_int_equal(texsyn_light_apply(&l, 0, &im, NULL, view_bytes(out, SIDE, SIDE, 3)), TXM_OK);
    assert_memory_equal(out, lit, sizeof lit);
    assert_int_equal(texsyn_light_apply(&l, 1, &im, NULL, view_bytes(out, SIDE, SIDE, 3)), TXM_OK);
    assert_memory_equal(out, whole, sizeof lit);
    d.strength = 0;
    relight(&d, d.image); /* in place */
    assert_memory_equal(lit, whole, sizeof lit);
    d.like = d.image; /* nothing to do */
    relight(&d, view_bytes(out, SIDE, SIDE, 3));
    for (int i = 0; i < 3 * COUNT; i++) assert_near(out[i], lit[i], 3);
}

/* ---- masks, alpha, channels ------------------------------------------------------------- */

/* What is masked or transparent on either side does not count; alpha is kept. */
static void test_masks(void **state) {
    (void)state;
    static float drawn[COUNT * 3];
    static uint8_t rgb[COUNT * 3], lit[COUNT * 3], image[COUNT * 4], like[COUNT * 4], mask[COUNT * 2];
    static uint8_t a[COUNT * 4], b[COUNT * 4];
    const light plain = {"", {1, 1, 1}, 1, 1, 1};
    draw_materials(drawn, 5, 0.2, 0.5);
    shine(&plain, drawn, rgb);
    shine(&lights[0], drawn, lit);
    for (int k = 0; k < 3; k++) { /* transparent; masked; masked, in other colours */
        texsyn_relight_desc d = relight_desc(image, like);
        d.image.channels = d.like.channels = 4;
        for (int i = 0; i < COUNT; i++) {
            const int hidden = i % SIDE >= 40;
            for (int c = 0; c < 3; c++) {
                image[4 * i + c] = hidden ? (uint8_t)(k * 50 + i) : lit[3 * i + c];
                like[4 * i + c] = hidden ? (uint8_t)(k * 90) : rgb[3 * i + c];
            }
            image[4 * i + 3] = like[4 * i + 3] = hidden && !k ? 100 : 255;
            mask[2 * i] = 255;
            mask[2 * i + 1] = hidden ? 127 : 128;
        }
        if (k) d.mask = d.like_mask = view_bytes(mask, SIDE, SIDE, 2);
        relight(&d, view_bytes(a, SIDE, SIDE, 4));
        for (int i = 0; i < COUNT; i++) {
            assert_int_equal(a[4 * i + 3], image[4 * i + 3]);
            if (k && i % SIDE < 40) assert_memory_equal(a + 4 * i, b + 4 * i, 4);
        }
        memcpy(b, a, sizeof a);
    }
}

static void test_channels(void **state) {
    (void)state;
    static float image[COUNT * 4], like[COUNT * 4], out[COUNT * 4];
    for (int channels = 1; channels <= 4; channels++) {
        for (int other = 1; other <= 4; other++) {
            double mean = 0, wanted = 0;
            texsyn_relight_desc d;
            memset(&d, 0, sizeof d);
            d.image = view_float(image, SIDE, SIDE, channels);
            d.like = view_float(like, SIDE, SIDE, other);
            for (int i = 0; i < COUNT * 4; i++) {
                image[i] = 0.2f + 0.3f * (float)at_random(i, 1, 1) / 255;
                like[i] = 0.4f + 0.3f * (float)at_random(i / other, 2, 1) / 255; /* gray */
            }
            for (int i = 0; i < COUNT; i++) {
                if (channels % 2 == 0) image[i * channels + channels - 1] = 1;
                if (other % 2 == 0) like[i * other + other - 1] = 0.5f;
            }
            relight(&d, view_float(out, SIDE, SIDE, channels));
            for (int i = 0; i < COUNT; i++) {
                mean += (double)out[i * channels] / COUNT;
                wanted += (double)like[i * other] / COUNT;
                if (channels % 2 == 0) assert_true(out[i * channels + channels - 1] == 1);
            }
            assert_near(mean, wanted, 0.06);
        }
    }
}

/* One colour only, black, white, floats far beyond 1: numbers stay finite. */
static void test_plain_pictures(void **state) {
    (void)state;
    tk_wide();
    static float image[COUNT * 3], like[COUNT * 3], out[COUNT * 3];
    static const float values[6] = {0, 1, 0.5f, 1e6f, -1e6f, 1e-6f};
    texsyn_relight_desc d;
    memset(&d, 0, sizeof d);
    d.image = view_float(image, SIDE, SIDE, 3);
    d.like = view_float(like, SIDE, SIDE, 3);
    for (int a = 0; a < 6; a++) {
        for (int b = 0; b < 6; b++) {
            for (int i = 0; i < 3 * COUNT; i++) {
                image[i] = i % 7 ? values[a] : values[(a + 1) % 6];
                like[i] = i % 5 || b % 2 ? values[b] : 0.25f;
            }
            relight(&d, view_float(out, SIDE, SIDE, 3));
            for (int i = 0; i < 3 * COUNT; i++) assert_true(txm_is_finite((double)out[i]));
        }
    }
}

/* A few samples a million away: knots of the curve round to one value, and it is still a curve. */
static void test_far_samples(void **state) {
    (void)state;
    static float image[COUNT * 3], like[COUNT * 3], out[COUNT * 3];
    texsyn_relight_desc d;
    txm_rng rng = txm_rng_make(5, 0);
    memset(&d, 0, sizeof d);
    d.image = view_float(image, SIDE, SIDE, 3);
    d.like = view_float(like, SIDE, SIDE, 3);
    for (int far_one = -1; far_one <= 1; far_one += 2) {
        for (int which = 0; which < 2; which++) {
            texsyn_light light;
            for (int i = 0; i < 3 * COUNT; i++) {
                image[i] = txm_rng_float(&rng);
                like[i] = txm_rng_float(&rng);
                if (i / 3 % 40 == 0) (which ? image : like)[i] = 1e6f * (float)far_one;
            }
            assert_int_equal(texsyn_light_learn(&d, NULL, &light), TXM_OK);
            for (int k = 0; k < light.knots; k++) {
                assert_true(txm_is_finite((double)light.slope[k]) && light.slope[k] >= 0);
                if (k) assert_true(light.from[k] > light.from[k - 1] && light.to[k] >= light.to[k - 1]);
            }
            assert_int_equal(texsyn_light_apply(&light, 1, &d.image, NULL, view_float(out, SIDE, SIDE, 3)),
                             TXM_OK);
            relight(&d, view_float(out, SIDE, SIDE, 3));
            for (int i = 0; i < 3 * COUNT; i++) assert_true(txm_is_finite((double)out[i]));
        }
    }
}

/* ---- bad input, faults ------------------------------------------------------------------ */

static void refuses(const texsyn_relight_desc *d, txm_status expected, const char *what) {
    static uint8_t out[COUNT * 3];
    texsyn_light l;
    tk_memory memory = {0};
    txm_env env = tk_env(&memory, NULL);
    memset(out, FILL, sizeof out);
    memset(&l, FILL, sizeof l);
    const txm_status status = texsyn_relight(d, &env, view_bytes(out, SIDE, SIDE, 3));
    if (status != expected) fail_msg("%s: status %d, not %d", what, status, expected);
    assert_true(env.message[0] != 0);
    assert_int_equal(texsyn_light_learn(d, NULL, &l), expected);
    assert_int_equal(tk_leaks(&memory), 0);
    for (size_t i = 0; i < sizeof out; i++) assert_int_equal(out[i], FILL);
    assert_int_equal(((uint8_t *)&l)[0], FILL);
}

#define REFUSES(field, value, expected)              \
    do {                                             \
        texsyn_relight_desc d = good;                \
        d.field = value;                             \
        refuses(&d, expected, #field " = " #value); \
    } while (0)

static void test_refuses(void **state) {
    (void)state;
    static uint8_t image[COUNT * 3], like[COUNT * 3], mask[COUNT];
    static float nan[COUNT * 3];
    texsyn_relight_desc good = relight_desc(image, like);
    refuses(NULL, TXM_BAD_ARGUMENT, "desc NULL");
    REFUSES(image.pixels, NULL, TXM_BAD_ARGUMENT);
    REFUSES(like.pixels, NULL, TXM_BAD_ARGUMENT);
    REFUSES(image.channels, 5, TXM_BAD_ARGUMENT);
    REFUSES(like.width, 0, TXM_BAD_ARGUMENT);
    REFUSES(image.height, INT_MAX, TXM_TOO_LARGE);
    REFUSES(like.height, INT_MAX, TXM_TOO_LARGE);
    REFUSES(strength, -0.1f, TXM_BAD_ARGUMENT);
    REFUSES(strength, 1.1f, TXM_BAD_ARGUMENT);
    REFUSES(strength, (float)NAN, TXM_BAD_ARGUMENT);
    good.mask = view_bytes(mask, SIDE, SIDE, 1);
    REFUSES(mask.width, SIDE - 1, TXM_BAD_ARGUMENT);
    REFUSES(mask.channels, 9, TXM_BAD_ARGUMENT);
    refuses(&good, TXM_TOO_SMALL, "an empty mask");
    good.mask.pixels = NULL;
    good.like_mask = view_bytes(mask, SIDE, SIDE, 1);
    memset(mask, 128, 15);
    refuses(&good, TXM_TOO_SMALL, "a mask of 15 pixels");
    good = relight_desc(image, nan);
    good.like.sample = TXM_F32;
    nan[77] = NAN;
    refuses(&good, TXM_BAD_ARGUMENT, "NaN");
    nan[77] = 2e6f;
    refuses(&good, TXM_BAD_ARGUMENT, "two million");
    nan[77] = 0;
    txm_env env = {0};
    assert_int_equal(texsyn_relight(&good, &env, view_bytes(image, SIDE, SIDE - 1, 3)), TXM_BAD_ARGUMENT);
    assert_int_equal(texsyn_relight(&good, &env, view_bytes(image, SIDE, SIDE, 1)), TXM_BAD_ARGUMENT);
    assert_int_equal(texsyn_light_learn(&good, &env, NULL), TXM_BAD_ARGUMENT);
}

static void test_apply_refuses(void **state) {
    (void)state;
    static uint8_t image[COUNT * 3], like[COUNT * 3], out[COUNT * 3];
    texsyn_light good, l;
    for (int i = 0; i < 3 * COUNT; i++) image[i] = (uint8_t)(like[i] = (uint8_t)at_random(i, 0, 0)) / 2;
    const texsyn_relight_desc d = relight_desc(image, like);
    const txm_image to = view_bytes(out, SIDE, SIDE, 3);
    assert_int_equal(texsyn_light_learn(&d, NULL, &good), TXM_OK);
    assert_between(good.knots, 4, TEXSYN_LIGHT_KNOTS);
    assert_int_equal(texsyn_light_apply(&good, 1, &d.image, NULL, to), TXM_OK);
    memset(out, FILL, sizeof out);
    assert_int_equal(texsyn_light_apply(NULL, 1, &d.image, NULL, to), TXM_BAD_ARGUMENT);
    assert_int_equal(texsyn_light_apply(&good, 1, NULL, NULL, to), TXM_BAD_ARGUMENT);
    assert_int_equal(texsyn_light_apply(&good, 1.5f, &d.image, NULL, to), TXM_BAD_ARGUMENT);
    assert_int_equal(texsyn_light_apply(&good, (float)NAN, &d.image, NULL, to), TXM_BAD_ARGUMENT);
    for (int k = 0; k < 9; k++) { /* not of our making */
        l = good;
        if (k == 0) l.knots = 1;
        if (k == 1) l.knots = TEXSYN_LIGHT_KNOTS + 1;
        if (k == 2) l.from[2] = l.from[1];
        if (k == 3) l.to[2] = l.to[1] - 0.1f;
        if (k == 4) l.slope[1] = -1;
        if (k == 5) l.gain[0] = NAN;
        if (k == 6) l.cast[1] = INFINITY;
        if (k == 7) l.fade = 0;
        if (k == 8) l.to[0] = NAN;
        assert_int_equal(texsyn_light_apply(&l, 1, &d.image, NULL, to), TXM_BAD_ARGUMENT);
    }
    for (size_t i = 0; i < sizeof out; i++) assert_int_equal(out[i], FILL);
}

static uint8_t swept[COUNT * 3];

static txm_status sweep(void *context, txm_env *env) {
    return texsyn_relight((const texsyn_relight_desc *)context, env, view_bytes(swept, SIDE, SIDE, 3));
}

static void test_faults_and_threads(void **state) {
    (void)state;
    static float drawn[COUNT * 3];
    static uint8_t image[COUNT * 3], like[COUNT * 3], serial[COUNT * 3];
    const light plain = {"", {1, 1, 1}, 1, 1, 1};
    const tk_output output = {swept, sizeof swept};
    draw_materials(drawn, 6, 0.2, 0.5);
    shine(&plain, drawn, like);
    shine(&lights[9], drawn, image);
    const texsyn_relight_desc d = relight_desc(image, like);
    texsyn_relight_desc context = d;
    assert_int_equal(tk_sweep_outputs(sweep, &context, TK_ALLOCATION, &output, 1), 12);
    assert_int_equal(tk_sweep_outputs(sweep, &context, TK_ONWARD, &output, 1), 12);
    assert_int_equal(tk_sweep_outputs(sweep, &context, TK_CANCEL, &output, 1), 7);
    relight(&d, view_bytes(serial, SIDE, SIDE, 3));
    txm_env env = {0};
    env.parallel_for = tk_parallel_reverse;
    assert_int_equal(texsyn_relight(&d, &env, view_bytes(swept, SIDE, SIDE, 3)), TXM_OK);
    assert_memory_equal(serial, swept, sizeof serial);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_lights_are_undone), cmocka_unit_test(test_unequal_shares),
        cmocka_unit_test(test_grays_stay_gray),   cmocka_unit_test(test_no_bands),
        cmocka_unit_test(test_strength),          cmocka_unit_test(test_masks),
        cmocka_unit_test(test_channels), cmocka_unit_test(test_plain_pictures),
        cmocka_unit_test(test_far_samples),
        cmocka_unit_test(test_refuses),           cmocka_unit_test(test_apply_refuses),
        cmocka_unit_test(test_faults_and_threads)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
