/* test_texsyn_composite.c - composite textures: learned, saved, loaded, synthesised
   SPDX-License-Identifier: MIT OR Unlicense */
#include "partkit.h"

enum { SIDE = 64, MOST = SIDE * SIDE * 4 };

static texsyn_composite *small_composite(int channels) {
    static uint8_t map[SIDE * SIDE], pixels[MOST];
    draw_labels(map, SIDE, SIDE, patches);
    draw_parts(pixels, map, SIDE, SIDE, channels);
    const texsyn_composite_learn_desc d =
        parts_desc(view_bytes(pixels, SIDE, SIDE, channels), view_bytes(map, SIDE, SIDE, 1));
    return learn_parts(&d);
}

/* ---- pictures -------------------------------------------------------------------------------- */

/* A drawn layout is obeyed: in each channel a label has values of its own source region only. */
static void test_drawn(void **state) {
    (void)state;
    static uint8_t drawn[60 * 44], out[60 * 44 * 4];
    for (int i = 0; i < 60 * 44; i++)
        drawn[i] = (uint8_t)((i % 60 - 30) * (i % 60 - 30) + (i / 60 - 22) * (i / 60 - 22) < 300);
    for (int channels = 1; channels <= 4; channels += channels == 1 ? 2 : 1) {
        texsyn_composite *c = small_composite(channels);
        texsyn_composite_desc d = composite_desc(c, 60, 44);
        int outside = 0;
        d.layout = view_bytes(drawn, 60, 44, 1);
        make_parts(&d, view_bytes(out, 60, 44, channels));
        for (int i = 0; i < 60 * 44 * channels; i++) {
            const int k = i % channels;
            const int v = out[i] - base_value(drawn[i / channels], k);
            if (k == 3) assert_int_equal(out[i], 255);
            else outside += v < -3 || v > 22;
        }
        assert_true(outside < 60 * 44 * channels / 50); /* combinations of bands, a little */
        texsyn_composite_free(c);
    }
}

/* Without a drawing: the map that texsyn_composite_layout gives. */
static void test_layout_is_used(void **state) {
    (void)state;
    static uint8_t map[50 * 40], out[50 * 40], again[50 * 40];
    texsyn_composite *c = small_composite(1);
    texsyn_composite_desc d = composite_desc(c, 50, 40);
    d.seed = 5;
    make_layout(c, 50, 40, 5, map);
    make_parts(&d, view_bytes(out, 50, 40, 1));
    d.layout = view_bytes(map, 50, 40, 1);
    make_parts(&d, view_bytes(again, 50, 40, 1));
    assert_memory_equal(out, again, sizeof out);
    texsyn_composite_free(c);
}

/* The same with 16 bits and as floats, bottom-up; gray into RGB and RGBA. */
static void test_formats(void **state) {
    (void)state;
    tk_wide();
    static uint8_t bytes[40 * 30], wide[40 * 30 * 4];
    static uint16_t words[40 * 30];
    static float floats[40 * 30];
    texsyn_composite *c = small_composite(1);
    const texsyn_composite_desc d = composite_desc(c, 40, 30);
    make_parts(&d, view_bytes(bytes, 40, 30, 1));
    make_parts(&d, view_words(words, 40, 30, 1));
    txm_image turned = view_float(floats + 29 * 40, 40, 30, 1);
    turned.stride = -(ptrdiff_t)(40 * sizeof(float));
    make_parts(&d, turned);
    make_parts(&d, view_bytes(wide, 40, 30, 4));
    for (int i = 0; i < 40 * 30; i++) {
        const float v = floats[(29 - i / 40) * 40 + i % 40];
        assert_near(words[i] / 257.0, bytes[i], 0.51);
        assert_near((double)v * 255, bytes[i], 0.51);
        for (int k = 0; k < 4; k++) assert_int_equal(wide[4 * i + k], k == 3 ? 255 : bytes[i]);
    }
    texsyn_composite_free(c);
}

/* Colours under transparent pixels make no difference. */
static void test_alpha(void **state) {
    (void)state;
    static uint8_t map[SIDE * SIDE], pixels[MOST], out[2][40 * 30 * 4];
    draw_labels(map, SIDE, SIDE, patches);
    for (int turn = 0; turn < 2; turn++) {
        draw_parts(pixels, map, SIDE, SIDE, 4);
        for (int i = 0; i < SIDE * SIDE; i++) {
            if (i / 5 % 4) continue;
            pixels[4 * i + 3] = 0;
            if (turn) memset(pixels + 4 * i, i * 7, 3);
        }
        const texsyn_composite_learn_desc l =
            parts_desc(view_bytes(pixels, SIDE, SIDE, 4), view_bytes(map, SIDE, SIDE, 1));
        texsyn_composite *c = learn_parts(&l);
        const texsyn_composite_desc d = composite_desc(c, 40, 30);
        make_parts(&d, view_bytes(out[turn], 40, 30, 4));
        texsyn_composite_free(c);
    }
    assert_memory_equal(out[0], out[1], sizeof out[0]);
}

static void test_threads(void **state) {
    (void)state;
    tk_wide();
    static uint8_t map[SIDE * SIDE], pixels[MOST], first[MOST], out[MOST];
    draw_labels(map, SIDE, SIDE, patches);
    draw_parts(pixels, map, SIDE, SIDE, 3);
    const texsyn_composite_learn_desc l =
        parts_desc(view_bytes(pixels, SIDE, SIDE, 3), view_bytes(map, SIDE, SIDE, 1));
    static const int counts[] = {1, 2, 8, 0};
    for (int i = 0; i < 4; i++) {
        texsyn_composite *c = NULL;
        txm_env env;
        int count = counts[i];
        memset(&env, 0, sizeof env);
        env.parallel_for = count ? tk_parallel_threads : tk_parallel_reverse;
        env.parallel_user = &count;
        assert_int_equal(texsyn_composite_learn(&l, &env, &c), TXM_OK);
        const texsyn_composite_desc d = composite_desc(c, SIDE, SIDE);
        assert_int_equal(texsyn_composite_synthesize(&d, &env, view_bytes(out, SIDE, SIDE, 3)), TXM_OK);
        if (i == 0) memcpy(first, out, sizeof out);
        assert_memory_equal(first, out, SIDE * SIDE * 3);
        texsyn_composite_free(c);
    }
}

/* ---- bytes ------------------------------------------------------------------------------------ */

static void test_save_and_load(void **state) {
    (void)state;
    tk_wide();
    static uint8_t bytes[1 << 16], again[1 << 16], out[2][40 * 30 * 4];
    for (int channels = 1; channels <= 4; channels += channels == 1 ? 2 : 1) {
        texsyn_composite *c = small_composite(channels), *loaded = NULL;
        size_t size = 0, needed = 0;
        assert_int_equal(texsyn_composite_save(c, NULL, NULL, 0, &size), TXM_OK);
        assert_true(size < sizeof bytes);
        memset(bytes, FILL, sizeof bytes);
        assert_int_equal(texsyn_composite_save(c, NULL, bytes, size - 1, &needed), TXM_TOO_SMALL);
        for (size_t i = 0; i < size; i++) assert_int_equal(bytes[i], FILL);
        assert_int_equal(texsyn_composite_save(c, NULL, bytes, size, &needed), TXM_OK);
        assert_int_equal(needed, size);
        assert_int_equal(texsyn_composite_load(bytes, size, NULL, &loaded), TXM_OK);
        assert_int_equal(texsyn_composite_label_count(loaded), 2);
        assert_int_equal(texsyn_channels(texsyn_composite_model(loaded, 1)), channels);
        assert_null(texsyn_composite_model(loaded, 2));
        assert_null(texsyn_composite_model(loaded, -1));
        assert_int_equal(texsyn_composite_save(loaded, NULL, again, size, &needed), TXM_OK);
        assert_memory_equal(bytes, again, size);
        for (int k = 0; k < 2; k++) {
            const texsyn_composite_desc d = composite_desc(k ? loaded : c, 40, 30);
            make_parts(&d, view_bytes(out[k], 40, 30, channels));
        }
        assert_memory_equal(out[0], out[1], (size_t)(40 * 30 * channels));
        texsyn_composite_free(c);
        texsyn_composite_free(loaded);
        for (size_t at = 0; at < size; at += at < 16 ? 1 : 41) { /* cut short, then damaged */
            assert_int_equal(texsyn_composite_load(bytes, at, NULL, &loaded), TXM_BAD_DATA);
            bytes[at] ^= 16;
            assert_int_equal(texsyn_composite_load(bytes, size, NULL, &loaded), TXM_BAD_DATA);
            assert_null(loaded);
            bytes[at] ^= 16;
        }
    }
    texsyn_composite *none = (texsyn_composite *)bytes;
    size_t size;
    assert_int_equal(texsyn_composite_load(NULL, 9, NULL, &none), TXM_BAD_ARGUMENT);
    assert_null(none);
    assert_int_equal(texsyn_composite_load(bytes, 9, NULL, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(texsyn_composite_save(NULL, NULL, NULL, 0, &size), TXM_BAD_ARGUMENT);
    texsyn_composite_free(NULL);
}

/* ---- what is refused ------------------------------------------------------------------------------ */

static void refuses_learn(txm_status expected, const char *word,
                          const texsyn_composite_learn_desc *d) {
    txm_env env;
    texsyn_composite *c = (texsyn_composite *)&env;
    memset(&env, 0, sizeof env);
    assert_int_equal(texsyn_composite_learn(d, &env, &c), expected);
    assert_null(c);
    if (!strstr(env.message, word)) fail_msg("'%s' lacks '%s'", env.message, word);
}

static void test_bad_examples(void **state) {
    (void)state;
    static uint8_t map[SIDE * SIDE], pixels[MOST];
    static float floats[SIDE * SIDE];
    draw_labels(map, SIDE, SIDE, patches);
    draw_parts(pixels, map, SIDE, SIDE, 1);
    const texsyn_composite_learn_desc good =
        parts_desc(view_bytes(pixels, SIDE, SIDE, 1), view_bytes(map, SIDE, SIDE, 1));
    texsyn_composite_learn_desc d = good;
    refuses_learn(TXM_BAD_ARGUMENT, "desc is NULL", NULL);
    assert_int_equal(texsyn_composite_learn(&good, NULL, NULL), TXM_BAD_ARGUMENT);
    d.example.pixels = NULL;
    refuses_learn(TXM_BAD_ARGUMENT, "example: pixels", &d);
    d = good, d.example.channels = 2;
    refuses_learn(TXM_BAD_ARGUMENT, "2 channels", &d);
    d = good, d.example.height = 31;
    refuses_learn(TXM_TOO_SMALL, "32 x 32", &d);
    d = good, d.labels.pixels = NULL;
    refuses_learn(TXM_BAD_ARGUMENT, "labels: pixels", &d);
    d = good, d.labels.width--;
    refuses_learn(TXM_BAD_ARGUMENT, "labels: must have", &d);
    d = good, d.labels.sample = TXM_U16, d.labels.height /= 2, d.example.height /= 2;
    refuses_learn(TXM_BAD_ARGUMENT, "labels: must have", &d);
    d = good, d.max_types = 65;
    refuses_learn(TXM_BAD_ARGUMENT, "max_types", &d);
    d = good, d.field = (texsyn_field)4;
    refuses_learn(TXM_BAD_ARGUMENT, "field", &d);
    floats[7] = (float)NAN;
    d = good, d.example = view_float(floats, SIDE, SIDE, 1);
    refuses_learn(TXM_BAD_ARGUMENT, "not finite", &d);
    map[3] = 16;
    refuses_learn(TXM_BAD_ARGUMENT, "16 occurs", &good);
    map[3] = 5;
    refuses_learn(TXM_TOO_SMALL, "label 2: has 0 pixels", &good);
    map[3] = 2;
    refuses_learn(TXM_TOO_SMALL, "label 2: has 1 pixels", &good);
    memset(map, 255, sizeof map);
    refuses_learn(TXM_TOO_SMALL, "255 everywhere", &good);
}

static void refuses(txm_status expected, const char *word, const texsyn_composite_desc *d,
                    txm_image out) {
    txm_env env;
    memset(&env, 0, sizeof env);
    if (out.pixels) memset(out.pixels, FILL, 40 * 30);
    assert_int_equal(texsyn_composite_synthesize(d, &env, out), expected);
    if (!strstr(env.message, word)) fail_msg("'%s' lacks '%s'", env.message, word);
    for (int i = 0; i < 40 * 30 && out.pixels; i++)
        assert_int_equal(((uint8_t *)out.pixels)[i], FILL);
}

static void test_bad_syntheses(void **state) {
    (void)state;
    static uint8_t drawn[40 * 30], pixels[40 * 30 * 4];
    const txm_image out = view_bytes(pixels, 40, 30, 1);
    texsyn_composite *c = small_composite(1), *colour = small_composite(3);
    const texsyn_composite_desc good = composite_desc(c, 40, 30);
    texsyn_composite_desc d = good;
    txm_env env;
    memset(&env, 0, sizeof env);
    refuses(TXM_BAD_ARGUMENT, "NULL", NULL, out);
    d.composite = NULL;
    refuses(TXM_BAD_ARGUMENT, "NULL", &d, out);
    d = good, d.width = 0;
    refuses(TXM_BAD_ARGUMENT, "1 or more", &d, out);
    d = good, d.height = -3;
    refuses(TXM_BAD_ARGUMENT, "1 or more", &d, out);
    d = good, d.width = d.height = 1 << 20;
    refuses(TXM_TOO_LARGE, "TEXSYN_MAX_PIXELS", &d, out);
    d = good, d.quality = 3;
    refuses(TXM_BAD_ARGUMENT, "quality", &d, out);
    refuses(TXM_BAD_ARGUMENT, "out", &good, view_bytes(NULL, 40, 30, 1));
    refuses(TXM_BAD_ARGUMENT, "out", &good, view_bytes(pixels, 39, 30, 1));
    refuses(TXM_BAD_ARGUMENT, "out", &good, view_bytes(pixels, 40, 30, 2));
    d = good, d.composite = colour;
    refuses(TXM_BAD_ARGUMENT, "channels", &d, out);
    d = good, d.layout = view_bytes(drawn, 30, 40, 1);
    refuses(TXM_BAD_ARGUMENT, "layout", &d, out);
    d.layout = view_bytes(drawn, 40, 30, 1);
    drawn[40 * 30 - 1] = 2;
    refuses(TXM_BAD_ARGUMENT, "label 2 occurs", &d, out);
    assert_int_equal(texsyn_composite_layout(&good, &env, view_bytes(pixels, 40, 30, 3)),
                     TXM_BAD_ARGUMENT);
    texsyn_composite_free(c);
    texsyn_composite_free(colour);
}

/* ---- memory and cancelling ---------------------------------------------------------------------- */

static txm_status try_learn(void *context, txm_env *env) {
    texsyn_composite *c = (texsyn_composite *)env;
    const txm_status status =
        texsyn_composite_learn((const texsyn_composite_learn_desc *)context, env, &c);
    if (status != TXM_OK) assert_null(c);
    texsyn_composite_free(c);
    return status;
}

static txm_status try_make(void *context, txm_env *env) {
    static uint8_t out[24 * 20 * 3];
    memset(out, FILL, sizeof out);
    const txm_status status = texsyn_composite_synthesize((const texsyn_composite_desc *)context,
                                                          env, view_bytes(out, 24, 20, 3));
    for (size_t i = 0; i < sizeof out && status != TXM_OK; i++) assert_int_equal(out[i], FILL);
    return status;
}

static txm_status try_bytes(void *context, txm_env *env) {
    static uint8_t bytes[1 << 16];
    texsyn_composite *c = NULL;
    size_t size = 0;
    txm_status status =
        texsyn_composite_save((const texsyn_composite *)context, env, bytes, sizeof bytes, &size);
    if (status == TXM_OK) status = texsyn_composite_load(bytes, size, env, &c);
    texsyn_composite_free(c);
    return status;
}

static void test_failing(void **state) {
    (void)state;
    static uint8_t map[40 * 36], pixels[40 * 36 * 3];
    for (int i = 0; i < 40 * 36; i++) map[i] = i % 40 / 4 % 5 < 2;
    draw_parts(pixels, map, 40, 36, 3);
    texsyn_composite_learn_desc l =
        parts_desc(view_bytes(pixels, 40, 36, 3), view_bytes(map, 40, 36, 1));
    l.max_types = 1;
    assert_true(tk_sweep(try_learn, &l, TK_ALLOCATION) > 20);
    assert_true(tk_sweep(try_learn, &l, TK_ONWARD) > 20);
    assert_true(tk_sweep(try_learn, &l, TK_CANCEL) > 20);
    texsyn_composite *c = learn_parts(&l);
    texsyn_composite_desc d = composite_desc(c, 24, 20);
    d.quality = -2;
    assert_true(tk_sweep(try_make, &d, TK_ALLOCATION) > 10);
    assert_true(tk_sweep(try_make, &d, TK_ONWARD) > 10);
    assert_true(tk_sweep(try_make, &d, TK_CANCEL) > 10);
    assert_true(tk_sweep(try_bytes, c, TK_ALLOCATION) > 10);
    assert_true(tk_sweep(try_bytes, c, TK_ONWARD) > 10);
    texsyn_composite_free(c);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_drawn),         cmocka_unit_test(test_layout_is_used),
        cmocka_unit_test(test_formats),       cmocka_unit_test(test_alpha),
        cmocka_unit_test(test_threads),       cmocka_unit_test(test_save_and_load),
        cmocka_unit_test(test_bad_examples),  cmocka_unit_test(test_bad_syntheses),
        cmocka_unit_test(test_failing),
    };
    return cmocka_run_group_tests_name("texsyn_composite", tests, NULL, NULL);
}
