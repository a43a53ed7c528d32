/* test_texmath_alpha.c - hidden colour from the visible neighbours, means weighted by alpha
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texmath_alpha && build/tests/unit/test_texmath_alpha */
#include "mathkit.h"

enum { SIDE = 37, BYTES = SIDE * SIDE * 4 * 4 };

/* a picture with memory of its own */
typedef struct picture {
    union {
        uint8_t bytes[BYTES];
        uint16_t words[BYTES / 2];
        float floats[BYTES / 4];
    } memory;
    txm_image image;
} picture;

static void start(picture *p, int width, int height, int channels, int kind, int flip) {
    static const txm_sample samples[3] = {TXM_U8, TXM_U16, TXM_F32};
    memset(p, 0, sizeof *p);
    p->image = txm_image_resolve(view(&p->memory, width, height, channels, samples[kind]));
    if (!flip) return;
    p->image.pixels = txm_image_row(&p->image, height - 1);
    p->image.stride = -p->image.stride;
}

/* Blobs of alpha over slowly changing colours; what is hidden depends on `hidden`. */
static void draw(picture *p, uint64_t seed, uint64_t hidden) {
    txm_rng rng = txm_rng_make(seed, 0), noise = txm_rng_make(hidden, 1);
    const int last = p->image.channels - 1;
    for (int y = 0; y < p->image.height; y++) {
        for (int x = 0; x < p->image.width; x++) {
            const int blob = (x + (int)seed) / 5 % 2 ^ y / 7 % 2;
            const float alpha = blob ? 0 : random_float(&rng, -0.3f, 1.6f);
            const float shown = txm_clampf(alpha, 0, 1);
            txm_image_set(&p->image, x, y, last, shown);
            for (int c = 0; c < last; c++) {
                const float colour = random_float(&rng, 0.2f, 0.3f) + 0.1f * (float)c;
                const float junk = random_float(&noise, 0, 1);
                const int shows = txm_image_get(&p->image, x, y, last) > 0;
                txm_image_set(&p->image, x, y, c, shows ? colour : junk);
            }
        }
    }
}

/* The visible colours of a channel lie in *low..*high. */
static void visible_range(const txm_image *im, int c, float *low, float *high) {
    *low = 2, *high = -1;
    for (int y = 0; y < im->height; y++) {
        for (int x = 0; x < im->width; x++) {
            if (!(txm_image_get(im, x, y, im->channels - 1) > 0)) continue;
            *low = txm_minf(*low, txm_image_get(im, x, y, c));
            *high = txm_maxf(*high, txm_image_get(im, x, y, c));
        }
    }
}

/* Whatever is hidden, the result is the same; it stays within what shows, and what shows stays. */
static void test_bleed_hidden(void **state) {
    (void)state;
    static picture a, b, before;
    static const int sides[6][2] = {{37, 37}, {1, 37}, {36, 1}, {8, 16}, {3, 2}, {31, 20}};
    for (int round = 0; round < 6 * 3 * 2 * 4; round++) {
        const int size = round % 6, kind = round / 6 % 3, channels = round / 18 % 2 ? 4 : 2;
        const int wrap = round / 36 % 4;
        start(&a, sides[size][0], sides[size][1], channels, kind, round % 5 == 0);
        start(&b, sides[size][0], sides[size][1], channels, kind, round % 7 == 0);
        draw(&a, (uint64_t)round, 1);
        draw(&b, (uint64_t)round, 2);
        before = a;
        txm_env env;
        memset(&env, 0, sizeof env);
        env.parallel_for = tk_parallel_reverse;
        assert_int_equal(txm_image_bleed(&a.image, wrap, NULL), TXM_OK);
        assert_int_equal(txm_image_bleed(&b.image, wrap, &env), TXM_OK);
        const size_t row =
            (size_t)a.image.width * (size_t)channels * txm_sample_bytes(a.image.sample);
        for (int y = 0; y < a.image.height; y++)
            assert_memory_equal(txm_image_row(&a.image, y), txm_image_row(&b.image, y), row);
        /* the first picture, as it was; its pixels point into a */
        txm_image old = before.image;
        old.pixels = (char *)&before + ((char *)a.image.pixels - (char *)&a);
        for (int c = 0; c < channels; c++) {
            float low, high;
            visible_range(&old, c, &low, &high);
            for (int y = 0; y < old.height; y++) {
                for (int x = 0; x < old.width; x++) {
                    const float was = txm_image_get(&old, x, y, c),
                                is = txm_image_get(&a.image, x, y, c);
                    const int shows = txm_image_get(&old, x, y, channels - 1) > 0;
                    if (shows || c == channels - 1) assert_true(was == is);
                    else if (low <= high) assert_true(is >= low - 1e-6f && is <= high + 1e-6f);
                }
            }
        }
        if (kind) continue;
        memcpy(&b, &a, sizeof a); /* a second time nothing changes */
        assert_int_equal(txm_image_bleed(&a.image, wrap, NULL), TXM_OK);
        assert_memory_equal(&b, &a, sizeof a);
    }
}

/* Colour comes from near: hidden pixels inside the left half continue that, and so on. */
static void test_bleed_near_colour(void **state) {
    (void)state;
    static picture p;
    start(&p, 32, 32, 4, 0, 0);
    for (int y = 0; y < 32; y++) {
        for (int x = 0; x < 32; x++) {
            const int side = x >= 16;
            for (int c = 0; c < 3; c++) txm_image_set(&p.image, x, y, c, 1);
            if ((x - 3) % 5 && (y - 2) % 6) continue; /* holes of 4 x 5 pixels in a grid */
            txm_image_set(&p.image, x, y, 0, side ? 0.8f : 0.0f);
            txm_image_set(&p.image, x, y, 1, side ? 0.0f : 0.4f);
            txm_image_set(&p.image, x, y, 2, 0);
            txm_image_set(&p.image, x, y, 3, 1);
        }
    }
    assert_int_equal(txm_image_bleed(&p.image, 0, NULL), TXM_OK);
    for (int y = 0; y < 32; y++) {
        for (int x = 0; x < 32; x++) {
            assert_true(txm_image_get(&p.image, x, y, 2) == 0);
            if (x >= 10 && x < 22) continue; /* where both halves are near */
            assert_near(txm_image_get(&p.image, x, y, 0), x >= 16 ? 0.8 : 0, 1e-6);
            assert_near(txm_image_get(&p.image, x, y, 1), x >= 16 ? 0 : 0.4, 1e-6);
        }
    }
}

/* A red column at the right, a green row at the bottom, a blue pixel between: with a torus red and
   green are next to the left column and the top row. */
static void test_bleed_torus(void **state) {
    (void)state;
    static picture p;
    float red[4], green[4];
    for (int wrap = 0; wrap < 4; wrap++) {
        start(&p, 33, 32, 4, 2, 0);
        for (int i = 0; i < 31; i++) {
            txm_image_set(&p.image, 32, i, 0, 1), txm_image_set(&p.image, 32, i, 3, 1);
            txm_image_set(&p.image, i, 31, 1, 1), txm_image_set(&p.image, i, 31, 3, 1);
        }
        txm_image_set(&p.image, 8, 8, 2, 1), txm_image_set(&p.image, 8, 8, 3, 1);
        assert_int_equal(txm_image_bleed(&p.image, wrap, NULL), TXM_OK);
        red[wrap] = txm_image_get(&p.image, 0, 16, 0);
        green[wrap] = txm_image_get(&p.image, 16, 0, 1);
    }
    assert_true(red[TXM_WRAP_X] > red[0] + 0.2f && red[3] > red[TXM_WRAP_Y] + 0.2f);
    assert_true(green[TXM_WRAP_Y] > green[0] + 0.2f && green[3] > green[TXM_WRAP_X] + 0.2f);
}

/* Nothing shows: black; nothing is hidden: not even memory is asked for. */
static void test_bleed_simple(void **state) {
    (void)state;
    static picture p, before;
    tk_memory memory;
    memset(&memory, 0, sizeof memory);
    txm_env env = tk_env(&memory, NULL);
    for (int channels = 1; channels <= 4; channels++) {
        start(&p, 9, 7, channels, 2, 0);
        for (int i = 0; i < 63 * channels; i++)
            p.memory.floats[i] = i % channels == channels - 1 && channels % 2 == 0 ? 0.5f : 0.25f;
        before = p;
        memory.calls = 0;
        assert_int_equal(txm_image_bleed(&p.image, 0, &env), TXM_OK);
        assert_memory_equal(&p.memory, &before.memory, sizeof p.memory);
        assert_int_equal(memory.calls, 0);
        if (channels % 2) continue;
        for (int i = channels - 1; i < 63 * channels; i += channels) p.memory.floats[i] = 0;
        p.memory.floats[0] = NAN; /* hidden: anything may be there */
        assert_int_equal(txm_image_bleed(&p.image, 0, &env), TXM_OK);
        assert_int_equal(tk_leaks(&memory), 0);
        for (int i = 0; i < 63 * channels; i++) assert_true(p.memory.floats[i] == 0);
    }
    p.image.channels = 9;
    assert_int_equal(txm_image_bleed(&p.image, 0, &env), TXM_BAD_ARGUMENT);
    assert_int_equal(txm_image_bleed(NULL, 0, &env), TXM_BAD_ARGUMENT);
}

typedef struct bled_call {
    picture *p;
    int is_copy;
} bled_call;

static txm_status bleed_under_faults(void *context, txm_env *env) {
    const bled_call *call = (const bled_call *)context;
    txm_arena arena;
    txm_image out;
    picture *const p = call->p;
    static picture before;
    txm_status status;
    start(p, 20, 31, 4, 1, 0);
    draw(p, 5, 6);
    before = *p;
    txm_arena_init(&arena, env);
    if (call->is_copy) status = txm_image_bled(&p->image, 0, &arena, env, &out);
    else status = txm_image_bleed(&p->image, 0, env);
    if ((status != TXM_OK && status != TXM_CANCELLED) || call->is_copy)
        assert_memory_equal(&p->memory, &before.memory, sizeof before.memory);
    if (call->is_copy && status == TXM_OK) {
        assert_int_equal(txm_image_bleed(&p->image, 0, NULL), TXM_OK);
        for (int y = 0; y < 31; y++)
            assert_memory_equal(txm_image_row(&p->image, y), txm_image_row(&out, y), 20 * 8);
    }
    txm_arena_free(&arena);
    return status;
}

static void test_bleed_memory(void **state) {
    (void)state;
    static picture p;
    bled_call call = {&p, 0};
    assert_true(tk_sweep(bleed_under_faults, &call, TK_ALLOCATION) > 4);
    call.is_copy = 1;
    assert_true(tk_sweep(bleed_under_faults, &call, TK_ALLOCATION) > 5);
    txm_image out;
    txm_arena arena;
    txm_arena_init(&arena, NULL);
    start(&p, 20, 31, 3, 1, 1); /* nothing is hidden: the picture itself */
    assert_int_equal(txm_image_bled(&p.image, 0, &arena, NULL, &out), TXM_OK);
    assert_ptr_equal(out.pixels, p.image.pixels);
    assert_null(arena.blocks);
    assert_int_equal(txm_image_bled(NULL, 0, &arena, NULL, &out), TXM_BAD_ARGUMENT);
}

/* A large picture can be cancelled; a smaller one is made between two reports of each level. */
static void test_bleed_cancel(void **state) {
    (void)state;
    static picture p;
    bled_call call = {&p, 0};
    assert_true(tk_sweep(bleed_under_faults, &call, TK_CANCEL) > 4);
    call.is_copy = 1;
    assert_true(tk_sweep(bleed_under_faults, &call, TK_CANCEL) > 4);
    txm_image tall = {calloc(2 * TXM_BLEED_PIXELS, 2), 1, 2 * TXM_BLEED_PIXELS, 2, TXM_U8, 0};
    tk_progress progress = {0};
    txm_env env = tk_env(NULL, &progress);
    assert_non_null(tall.pixels);
    ((uint8_t *)tall.pixels)[1] = 255;
    assert_int_equal(txm_image_bleed(&tall, 0, &env), TXM_OK);
    assert_true(progress.calls > 8 && progress.errors == 0);
    free(tall.pixels);
}

/* ---- means ------------------------------------------------------------------------------ */

static void test_mean(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(3, 0);
    for (int round = 0; round < 2000; round++) {
        const int channels = 1 + round % 4, has_alpha = channels % 2 == 0;
        const int kind = round / 4 % 3; /* opaque, nothing shows, anything */
        double sum[4] = {0}, shown = 0, weight = 0, plain[4] = {0};
        txm_mean m = txm_mean_of(channels);
        float pixel[4], out[4];
        for (int i = 0; i < 5; i++) {
            const double w = (double)random_float(&rng, 0.1f, 2);
            for (int c = 0; c < channels; c++) pixel[c] = txm_rng_float(&rng);
            if (has_alpha && kind < 2) pixel[channels - 1] = kind == 0 ? 1.0f : 0.0f;
            const double a = has_alpha ? (double)pixel[channels - 1] : 1;
            for (int c = 0; c < channels; c++) {
                sum[c] += w * a * (double)pixel[c];
                plain[c] += w * (double)pixel[c];
            }
            shown += w * a;
            weight += w;
            txm_mean_add(&m, pixel, w);
        }
        txm_mean_get(&m, out);
        for (int c = 0; c < channels; c++) {
            if (has_alpha && c == channels - 1) assert_near(out[c], shown / weight, 1e-6);
            else if (!(shown > 0)) assert_near(out[c], plain[c] / weight, 1e-6);
            else assert_near(out[c], sum[c] / shown, 1e-6);
            if (kind == 0) assert_true(out[c] == txm_float(plain[c] / weight));
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_bleed_hidden), cmocka_unit_test(test_bleed_near_colour),
        cmocka_unit_test(test_bleed_torus),  cmocka_unit_test(test_bleed_simple),
        cmocka_unit_test(test_bleed_memory),
        cmocka_unit_test(test_bleed_cancel), cmocka_unit_test(test_mean),
    };
    return cmocka_run_group_tests_name("texmath alpha", tests, NULL, NULL);
}
