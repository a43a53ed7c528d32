/* test_texsyn.c - synthesis, failing memory, cancelling
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texsyn && build/tests/unit/test_texsyn */
#include "synkit.h"

/* ---- synthesis ---------------------------------------------------------------------------- */

static void test_synth_sizes(void **state) {
    (void)state;
    tk_wide();
    static const int sizes[][2] = {{1, 1},  {2, 2},   {1, 200}, {200, 1}, {17, 33},
                                   {3, 64}, {64, 65}, {7, 129}, {700, 300}};
    static uint8_t out[700 * 300 * 3 + 64];
    for (int levels = 1; levels <= 3; levels++) {
        texsyn_model *model = small_model(3, levels);
        for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
            for (int tileable = 0; tileable < 2; tileable++) {
                const int width = sizes[i][0], height = sizes[i][1];
                if (width == 700 && levels < 3 && !tk_full()) continue;
                const size_t bytes = (size_t)(width * height * 3);
                texsyn_synth_desc d = synth_desc(model, width, height);
                d.tileable = tileable;
                d.quality = -2;
                memset(out, FILL, sizeof out);
                synthesize(&d, view_bytes(out, width, height, 3));
                for (size_t k = bytes; k < bytes + 64; k++) assert_int_equal(out[k], FILL);
            }
        }
        for (int quality = -2; quality <= 2; quality++) {
            texsyn_synth_desc d = synth_desc(model, 20, 20);
            d.quality = quality;
            synthesize(&d, view_bytes(out, 20, 20, 3));
        }
        texsyn_model_free(model);
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
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i += tk_full() ? 1 : 4) {
        const int width = cases[i].width, height = cases[i].height;
        texsyn_learn_desc d = learn_desc(view_bytes(pixels, 128, 128, 1), 5);
        d.levels = cases[i].levels;
        texsyn_model *model = learn(&d);
        memset(border, 0, sizeof border);
        memset(inside, 0, sizeof inside);
        for (uint64_t seed = 0; seed < 5; seed++) {
            texsyn_synth_desc s = synth_desc(model, width, height);
            s.tileable = 1;
            s.seed = seed;
            synthesize(&s, view_bytes(out, width, height, 1));
            add_wrap(out, width, height, border, inside);
        }
        for (int k = 0; k < 2; k++) assert_between(border[k] / inside[k], 0.8, 1.2);
        texsyn_model_free(model);
    }
}

/* Learn and synthesise by these threads; both results to s and out. */
static void run_with(txm_env *env, saved *s, uint8_t *out) {
    static uint8_t pixels[64 * 64 * 3];
    draw_patches(pixels, 64, 64, 3, 20, 12, 8);
    texsyn_learn_desc d = learn_desc(view_bytes(pixels, 64, 64, 3), 4);
    texsyn_model *model = NULL;
    d.levels = 2;
    assert_int_equal(texsyn_learn(&d, env, &model), TXM_OK);
    save(model, s);
    const texsyn_synth_desc t = synth_desc(model, 90, 200);
    assert_int_equal(texsyn_synthesize(&t, env, view_bytes(out, 90, 200, 3)), TXM_OK);
    texsyn_model_free(model);
}

static void test_same_bytes(void **state) {
    (void)state;
    tk_wide();
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
    synthesize(&d, view_bytes(a, 64, 64, 1));
    synthesize(&d, view_bytes(b, 64, 64, 1));
    assert_memory_equal(a, b, sizeof a);
    for (size_t i = 0; i < sizeof seeds / sizeof *seeds; i++) {
        int differ = 0;
        d.seed = seeds[i];
        synthesize(&d, view_bytes(b, 64, 64, 1));
        for (int k = 0; k < 64 * 64; k++) differ += a[k] != b[k];
        assert_true(differ > 64 * 64 / 2);
    }
    texsyn_model_free(model);
}

static void test_synth_steps(void **state) {
    (void)state;
    static uint8_t whole[70 * 50 * 3], out[70 * 50 * 3], last[70 * 50 * 3];
    for (int levels = 1; levels <= 3; levels++) {
        texsyn_model *model = small_model(3, levels);
        texsyn_synth_desc d = synth_desc(model, 70, 50);
        synthesize(&d, view_bytes(whole, 70, 50, 3));
        texsyn_job *job = NULL;
        tk_progress progress = {0};
        txm_env env = tk_env(NULL, &progress);
        float before = -1;
        int steps = 0;
        assert_int_equal(texsyn_begin(&d, NULL, &job), TXM_OK);
        memset(&d, 0xff, sizeof d); /* the job has its own copy */
        assert_int_equal(texsyn_draw(job, NULL, view_bytes(last, 70, 50, 3)), TXM_OK);
        for (int more = 7; more;) {
            assert_int_equal(texsyn_step(job, &env, &more), TXM_OK);
            assert_true(more == 0 || more == 1);
            assert_true(progress.last > before && progress.last < 1);
            assert_int_equal(progress.errors, 0); /* one bar over all steps that never falls */
            before = progress.last;
            steps++;
            assert_int_equal(texsyn_draw(job, NULL, view_bytes(out, 70, 50, 3)), TXM_OK);
            assert_true(memcmp(out, last, sizeof out) != 0);
            memcpy(last, out, sizeof out);
        }
        assert_true(steps > 4);
        assert_true(before > 0.9f);
        assert_memory_equal(out, whole, sizeof whole);

        /* at the end nothing more happens */
        int more = 7;
        const long calls = progress.calls;
        assert_int_equal(texsyn_step(job, &env, &more), TXM_OK);
        assert_int_equal(texsyn_step(job, &env, NULL), TXM_OK);
        assert_int_equal(more, 0);
        assert_int_equal(progress.calls, calls);
        assert_int_equal(texsyn_draw(job, NULL, view_bytes(out, 70, 50, 3)), TXM_OK);
        assert_memory_equal(out, whole, sizeof whole);
        texsyn_free(job);
        texsyn_model_free(model);
    }
    texsyn_free(NULL);
    int more = 7;
    assert_int_equal(texsyn_step(NULL, NULL, &more), TXM_BAD_ARGUMENT);
    assert_int_equal(more, 7);
    memset(out, FILL, sizeof out);
    memset(last, FILL, sizeof last);
    assert_int_equal(texsyn_draw(NULL, NULL, view_bytes(out, 70, 50, 3)), TXM_BAD_ARGUMENT);
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
        const txm_image small = view_bytes(out, d.width, d.height, 3);
        assert_int_equal(texsyn_synthesize(&d, &env, small), expected);
        assert_true(env.message[0] != 0);
        for (size_t k = 0; k < sizeof out; k++) assert_int_equal(out[k], FILL);
        assert_int_equal(memory.calls, 0);
    }
    texsyn_job *job = (texsyn_job *)&large;
    assert_int_equal(texsyn_begin(NULL, NULL, &job), TXM_BAD_ARGUMENT);
    assert_null(job);
    assert_int_equal(texsyn_begin(&good, NULL, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(texsyn_synthesize(NULL, NULL, view_bytes(out, 10, 10, 3)), TXM_BAD_ARGUMENT);

    /* the picture does not fit: refused before any work, and when looking at a job */
    txm_image wrong[10];
    for (int i = 0; i < 10; i++) wrong[i] = view_bytes(out, 10, 10, 3);
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
        assert_int_equal(texsyn_draw(job, &env, wrong[i]), TXM_BAD_ARGUMENT);
        assert_true(env.message[0] != 0);
        env.message[0] = 0;
        assert_int_equal(texsyn_synthesize(&good, &env, wrong[i]), TXM_BAD_ARGUMENT);
        assert_true(env.message[0] != 0);
        assert_int_equal(progress.calls, 0);
        assert_int_equal(tk_leaks(&memory), 0);
        for (size_t k = 0; k < sizeof out; k++) assert_int_equal(out[k], FILL);
    }
    texsyn_free(job);
    texsyn_model_free(model);
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
        synthesize(&d, view_bytes(plain, W, H, channels));
        if (channels == 1) { /* 0 means 1 */
            synthesize(&d, view_bytes(out, W, H, 0));
            assert_memory_equal(out, plain, W * H);
        }
        for (int wider = channels < 3 ? 3 : channels; wider <= 4; wider++) {
            synthesize(&d, view_bytes(out, W, H, wider));
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
        texsyn_model_free(model);
    }
}

/* ---- memory and cancelling ---------------------------------------------------------------- */

static txm_status try_learn(void *context, txm_env *env) {
    texsyn_model *model = (texsyn_model *)env;
    const txm_status status = texsyn_learn((const texsyn_learn_desc *)context, env, &model);
    assert_int_equal(model != NULL, status == TXM_OK);
    texsyn_model_free(model);
    return status;
}

/* Learning reports some 1500 times: every 12th report is passed on, so that a sweep over all of
   them stays short. */
typedef struct thinned {
    txm_env *env;
    long calls;
} thinned;

static int report_thinned(void *user, float fraction, const char *stage) {
    thinned *t = (thinned *)user;
    return t->calls++ % 12 == 0 ? txm_progress(t->env, fraction, stage) : 0;
}

static txm_status try_learn_thinned(void *context, txm_env *env) {
    thinned reports = {env, 0};
    txm_env other = *env;
    other.progress = report_thinned;
    other.progress_user = &reports;
    const txm_status status = try_learn(context, &other);
    memcpy(env->message, other.message, sizeof env->message);
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
    texsyn_model_free(model);
    return status;
}

static txm_status try_synthesize(void *context, txm_env *env) {
    static uint8_t out[33 * 40 * 3];
    memset(out, FILL, sizeof out);
    const txm_status status =
        texsyn_synthesize((const texsyn_synth_desc *)context, env, view_bytes(out, 33, 40, 3));
    for (size_t i = 0; i < sizeof out && status != TXM_OK; i++) assert_int_equal(out[i], FILL);
    return status;
}

/* A job that is drawn between the steps, and continues after a failed one. */
static txm_status try_steps(void *context, txm_env *env) {
    static uint8_t out[33 * 40 * 3];
    texsyn_job *job = (texsyn_job *)env;
    txm_status first = texsyn_begin((const texsyn_synth_desc *)context, env, &job);
    int more = 1;
    if (first != TXM_OK) {
        assert_null(job);
        return first;
    }
    while (more) {
        more = 7;
        const txm_status status = texsyn_step(job, env, &more);
        assert_int_equal(texsyn_draw(job, env, view_bytes(out, 33, 40, 3)), TXM_OK);
        if (status == TXM_OK) continue;
        assert_int_equal(more, 7); /* untouched */
        if (first != TXM_OK || status == TXM_CANCELLED) {
            first = status;
            break;
        }
        first = status;
    }
    if (!more) { /* the failure had no effect */
        static uint8_t whole[33 * 40 * 3];
        synthesize((const texsyn_synth_desc *)context, view_bytes(whole, 33, 40, 3));
        assert_memory_equal(out, whole, sizeof whole);
    }
    texsyn_free(job);
    return first;
}

static void test_learn_failing(void **state) {
    (void)state;
    static uint8_t pixels[32 * 32], mask[32 * 32];
    draw_patches(pixels, 32, 32, 1, 8, 30, 4);
    memset(mask, 255, sizeof mask);
    texsyn_learn_desc d = learn_desc(view_bytes(pixels, 32, 32, 1), 1);
    d.mask = view_bytes(mask, 32, 32, 1);
    d.levels = 2;
    assert_true(tk_sweep(try_learn, &d, TK_ALLOCATION) > 10);
    assert_true(tk_sweep(try_learn, &d, TK_ONWARD) > 10);
    assert_true(tk_sweep(try_learn_thinned, &d, TK_CANCEL) > 100);
}

static void test_model_failing(void **state) {
    (void)state;
    static saved s;
    texsyn_model *model = small_model(3, 2);
    save(model, &s);
    assert_true(tk_sweep(try_save, model, TK_ALLOCATION) > 2);
    assert_true(tk_sweep(try_save, model, TK_ONWARD) > 2);
    assert_true(tk_sweep(try_load, &s, TK_ALLOCATION) > 2);
    assert_true(tk_sweep(try_load, &s, TK_ONWARD) > 2);
    texsyn_model_free(model);
}

static void test_synth_failing(void **state) {
    (void)state;
    texsyn_model *model = small_model(3, 3);
    texsyn_synth_desc d = synth_desc(model, 33, 40);
    d.quality = -2;
    assert_true(tk_sweep(try_synthesize, &d, TK_ALLOCATION) > 10);
    assert_true(tk_sweep(try_synthesize, &d, TK_ONWARD) > 10);
    assert_true(tk_sweep(try_steps, &d, TK_ALLOCATION) > 10);
    assert_true(tk_sweep(try_steps, &d, TK_ONWARD) > 10);
    assert_true(tk_sweep(try_synthesize, &d, TK_CANCEL) > 200);
    assert_true(tk_sweep(try_steps, &d, TK_CANCEL) > 200);
    texsyn_model_free(model);
}

static void test_synth_peak_memory(void **state) {
    (void)state;
    static uint8_t out[512 * 512 * 3];
    tk_memory memory = {0};
    txm_env env = tk_env(&memory, NULL);
    texsyn_model *model = small_model(3, 2);
    texsyn_synth_desc d = synth_desc(model, 512, 512);
    d.quality = -2;
    assert_int_equal(texsyn_synthesize(&d, &env, view_bytes(out, 512, 512, 3)), TXM_OK);
    assert_int_equal(tk_leaks(&memory), 0);
    assert_true(memory.peak_bytes <= 64u * 512 * 512 + (4u << 20));
    texsyn_model_free(model);
}

/* The allocator that made a model releases it, also when the env is long gone. */
static void test_env_goes_first(void **state) {
    (void)state;
    static uint8_t pixels[16 * 16], out[20 * 20];
    tk_memory memory = {0}, other = {0};
    txm_env env = tk_env(&memory, NULL);
    draw_patches(pixels, 16, 16, 1, 8, 30, 4);
    const texsyn_learn_desc d = learn_desc(view_bytes(pixels, 16, 16, 1), 1);
    texsyn_model *model = NULL;
    texsyn_job *job = NULL;
    int more = 1;
    assert_int_equal(texsyn_learn(&d, &env, &model), TXM_OK);
    const texsyn_synth_desc s = synth_desc(model, 20, 20);
    assert_int_equal(texsyn_begin(&s, &env, &job), TXM_OK);
    memset(&env, 0xff, sizeof env);
    txm_env another = tk_env(&other, NULL);
    while (more) assert_int_equal(texsyn_step(job, &another, &more), TXM_OK);
    assert_int_equal(texsyn_draw(job, &another, view_bytes(out, 20, 20, 1)), TXM_OK);
    assert_int_equal(other.calls, 0);
    texsyn_free(job);
    texsyn_model_free(model);
    assert_int_equal(tk_leaks(&memory), 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
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
    };
    return cmocka_run_group_tests_name("texsyn", tests, NULL, NULL);
}
