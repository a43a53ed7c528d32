/* test_texpatch_refuse.c - bad input, failing memory, cancelling
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texpatch_refuse && build/tests/unit/test_texpatch_refuse */
#include "patchkit.h"

/* ---- bad input -------------------------------------------------------------------------- */

/* A description in which everything is given, and its pictures. */
typedef struct whole {
    txm_image maps[2][5], kept[5], out[5];
    texpatch_map kinds[5];
    texpatch_exemplar exemplars[2];
    texpatch_desc desc;
} whole;

static void make_whole(whole *t) {
    memset(t, 0, sizeof *t);
    for (int i = 0; i < 2; i++) {
        t->maps[i][0] = draw_gravel(36, 32, 3, 20 * i);
        t->maps[i][1] = converted(&t->maps[i][0], TXM_F32, 1, 0);
        t->exemplars[i].maps = t->maps[i];
        t->exemplars[i].guide = new_mask(36, 32, 255 * i);
        t->exemplars[i].mask = new_mask(36, 32, 255);
    }
    t->kinds[0].weight = 1;
    for (int m = 0; m < 2; m++) {
        t->kept[m] = new_image(48, 40, 3, m ? TXM_F32 : TXM_U8);
        t->out[m] = new_image(48, 40, 3, m ? TXM_F32 : TXM_U8);
        for (int i = 0; i < 48 * 40 * 3; i++)
            txm_image_set(&t->kept[m], i / 3 % 48, i / 3 / 48, i % 3, 0.5f);
    }
    t->desc = desc_of(t->exemplars, 2, 2, 48, 40);
    t->desc.maps = t->kinds;
    t->desc.passes = 1;
    t->desc.guide = new_mask(48, 40, 0);
    fill_box(&t->desc.guide, 20, 0, 48, 40, 255);
    t->desc.guide_mask = new_mask(48, 40, 255);
    t->desc.kept = t->kept;
    t->desc.keep = new_mask(48, 40, 0);
    fill_box(&t->desc.keep, 10, 10, 20, 18, 255);
}

/* both: the plane refuses it too, else it ignores it */
static void refuse(whole *t, txm_status expected, int both) {
    txm_env env = {0};
    texpatch_job *job = (texpatch_job *)t;
    texpatch_plane *plane = (texpatch_plane *)t;
    txm_status status = texpatch_make(&t->desc, &env, t->out);
    if (status != expected) fail_msg("make: %d, not %d: %s", status, expected, env.message);
    assert_true(env.message[0] != 0 && is_filled(&t->out[0]) && is_filled(&t->out[1]));
    memset(env.message, 0, sizeof env.message);
    assert_int_equal(texpatch_begin(&t->desc, &env, &job), expected);
    assert_true(env.message[0] != 0 && job == NULL);
    assert_int_equal(texpatch_begin(&t->desc, NULL, &job), expected);
    memset(env.message, 0, sizeof env.message);
    status = texpatch_plane_make(&t->desc, &env, &plane);
    if (status != (both ? expected : TXM_OK)) fail_msg("plane: %d, %s", status, env.message);
    assert_true(both ? env.message[0] != 0 && plane == NULL : plane != NULL);
    texpatch_plane_free(plane);
}

/* Refuse each of some values of a field, and restore it. */
#define REFUSE_EACH(field, type, expected, both, ...)                 \
    do {                                                              \
        type values[] = {__VA_ARGS__};                                \
        type was = t.field;                                           \
        for (size_t k = 0; k < sizeof values / sizeof *values; k++) { \
            t.field = values[k];                                      \
            refuse(&t, expected, both);                               \
        }                                                             \
        t.field = was;                                                \
    } while (0)

static void test_refuses(void **state) {
    (void)state;
    whole t;
    make_whole(&t);
    made(&t.desc, NULL); /* nothing is wrong with it */
    REFUSE_EACH(desc.exemplars, const texpatch_exemplar *, TXM_BAD_ARGUMENT, 1, NULL);
    REFUSE_EACH(desc.exemplar_count, int, TXM_BAD_ARGUMENT, 1, 0, -1, 9, INT_MAX, INT_MIN);
    REFUSE_EACH(desc.map_count, int, TXM_BAD_ARGUMENT, 1, 0, -1, 17, INT_MAX);
    REFUSE_EACH(desc.width, int, TXM_BAD_ARGUMENT, 0, 0, -1, INT_MIN);
    REFUSE_EACH(desc.height, int, TXM_BAD_ARGUMENT, 0, 0, -1, INT_MIN);
    REFUSE_EACH(desc.width, int, TXM_TOO_LARGE, 0, INT_MAX, TEXPATCH_MAX_PIXELS / 40 + 1);
    REFUSE_EACH(desc.tileable, int, TXM_BAD_ARGUMENT, 0, -1, 4, INT_MAX);
    REFUSE_EACH(desc.patch, int, TXM_BAD_ARGUMENT, 1, -1, 16385, INT_MAX, INT_MIN);
    REFUSE_EACH(desc.passes, int, TXM_BAD_ARGUMENT, 1, -2, 17, INT_MAX, INT_MIN);
    REFUSE_EACH(desc.turns, int, TXM_BAD_ARGUMENT, 1, -1, 3, 5, 8, INT_MAX);
    REFUSE_EACH(desc.novelty, float, TXM_BAD_ARGUMENT, 1, -0.1f, 1.1f, NAN, INFINITY);
    REFUSE_EACH(desc.guide_weight, float, TXM_BAD_ARGUMENT, 1, -1, 16.5f, NAN, INFINITY);
    REFUSE_EACH(desc.lattice, int, TXM_BAD_ARGUMENT, 1, -2, 2, INT_MAX);
    t.desc.lattice = 1;
    refuse(&t, TXM_BAD_ARGUMENT, 1); /* steps of length 0 */
    t.desc.lattice_vectors[0] = 10;
    t.desc.lattice_vectors[3] = 10;
    REFUSE_EACH(desc.lattice_vectors[2], float, TXM_BAD_ARGUMENT, 1, NAN, INFINITY, 1e6f);
    REFUSE_EACH(desc.lattice_vectors[3], float, TXM_BAD_ARGUMENT, 1, 0, 1.5f, NAN);
    t.desc.lattice = 0;
    REFUSE_EACH(kinds[0].weight, float, TXM_BAD_ARGUMENT, 1, 0, -1, 16.5f, NAN, INFINITY);
    REFUSE_EACH(kinds[1].weight, float, TXM_BAD_ARGUMENT, 1, -1, 17, NAN);

    /* pictures that do not match, or are invalid */
    for (int i = 0; i < 2; i++) {
        REFUSE_EACH(exemplars[i].maps, const txm_image *, TXM_BAD_ARGUMENT, 1, NULL);
        for (int m = 0; m < 2; m++) {
            REFUSE_EACH(maps[i][m].pixels, void *, TXM_BAD_ARGUMENT, 1, NULL);
            REFUSE_EACH(maps[i][m].channels, int, TXM_BAD_ARGUMENT, 1, 5, -1);
            REFUSE_EACH(maps[i][m].stride, ptrdiff_t, TXM_BAD_ARGUMENT, 1, 20, -20);
            REFUSE_EACH(maps[i][m].sample, txm_sample, TXM_BAD_ARGUMENT, 1, (txm_sample)3);
            if (m) REFUSE_EACH(maps[i][m].width, int, TXM_BAD_ARGUMENT, 1, 35, 0);
            if (m) REFUSE_EACH(maps[i][m].height, int, TXM_BAD_ARGUMENT, 1, 31, -1);
            if (i) REFUSE_EACH(maps[i][m].channels, int, TXM_BAD_ARGUMENT, 1, 1, 2);
            if (i && m) REFUSE_EACH(maps[i][m].sample, txm_sample, TXM_BAD_ARGUMENT, 1, TXM_U8);
        }
        REFUSE_EACH(exemplars[i].guide.pixels, void *, TXM_BAD_ARGUMENT, 0, NULL);
        REFUSE_EACH(exemplars[i].guide.width, int, TXM_BAD_ARGUMENT, 0, 35, 0);
        REFUSE_EACH(exemplars[i].guide.height, int, TXM_BAD_ARGUMENT, 0, 16);
        REFUSE_EACH(exemplars[i].mask.width, int, TXM_BAD_ARGUMENT, 1, 35, 0);
        REFUSE_EACH(exemplars[i].mask.height, int, TXM_BAD_ARGUMENT, 1, 31, -1);
        REFUSE_EACH(exemplars[i].mask.channels, int, TXM_BAD_ARGUMENT, 1, -1, 5);
        float *sample = (float *)t.maps[i][1].pixels + 777, was = *sample;
        for (int k = 0; k < 3; k++) {
            *sample = k == 0 ? NAN : k == 1 ? INFINITY : -INFINITY;
            refuse(&t, TXM_BAD_ARGUMENT, 1);
        }
        *sample = was;
    }
    REFUSE_EACH(desc.guide.pixels, void *, TXM_BAD_ARGUMENT, 0, NULL);
    REFUSE_EACH(desc.guide.width, int, TXM_BAD_ARGUMENT, 0, 47, 0);
    REFUSE_EACH(desc.guide.height, int, TXM_BAD_ARGUMENT, 0, 39);
    REFUSE_EACH(desc.guide_mask.width, int, TXM_BAD_ARGUMENT, 0, 47, 0);
    REFUSE_EACH(desc.keep.pixels, void *, TXM_BAD_ARGUMENT, 0, NULL);
    REFUSE_EACH(desc.keep.width, int, TXM_BAD_ARGUMENT, 0, 47, 0);
    REFUSE_EACH(kept[1].pixels, void *, TXM_BAD_ARGUMENT, 0, NULL);
    REFUSE_EACH(kept[1].width, int, TXM_BAD_ARGUMENT, 0, 47, 0);
    REFUSE_EACH(kept[1].channels, int, TXM_BAD_ARGUMENT, 0, 1, 2);
    REFUSE_EACH(kept[1].sample, txm_sample, TXM_BAD_ARGUMENT, 0, TXM_U8);
    ((float *)t.kept[1].pixels)[5] = NAN;
    refuse(&t, TXM_BAD_ARGUMENT, 0);
    ((float *)t.kept[1].pixels)[5] = 0;

    /* too small, too large */
    for (int i = 0; i < 2; i++) {
        const whole was = t;
        for (int m = 0; m < 2; m++) t.maps[i][m].height = 31;
        t.exemplars[i].guide.height = t.exemplars[i].mask.height = 31;
        refuse(&t, TXM_TOO_SMALL, 1);
        memcpy(&t, &was, sizeof t);
    }
    whole plain;
    memset(&plain, 0, sizeof plain);
    plain.maps[0][0] = draw_gravel(32, 32, 1, 0);
    plain.exemplars[0].maps = plain.maps[0];
    plain.desc = desc_of(plain.exemplars, 1, 1, 40, 31);
    plain.out[0] = plain.out[1] = new_image(40, 31, 1, TXM_U8);
    plain.desc.tileable = TEXPATCH_TILE_Y;
    refuse(&plain, TXM_TOO_SMALL, 0);
    plain.desc.tileable = TEXPATCH_TILE_X;
    made(&plain.desc, NULL);
    plain.kinds[0].weight = 1;
    plain.kinds[0].is_normal = 1; /* of one channel */
    plain.desc.maps = plain.kinds;
    refuse(&plain, TXM_BAD_ARGUMENT, 1);
    plain.desc.maps = NULL;
    plain.maps[0][0] = new_image(16385, 32, 1, TXM_U8);
    refuse(&plain, TXM_TOO_LARGE, 1);
    plain.maps[0][0] = new_image(32, 16385, 1, TXM_U8);
    refuse(&plain, TXM_TOO_LARGE, 1);
    for (int m = 0; m < 5; m++) {
        plain.maps[0][m] = new_image(32, 32, 4, TXM_U8);
        plain.kinds[m].weight = 1;
        plain.kinds[m].is_normal = 0;
    }
    plain.desc.map_count = 5;
    plain.desc.maps = plain.kinds;
    refuse(&plain, TXM_TOO_LARGE, 1); /* 20 channels */

    /* the output */
    txm_image good = t.out[1];
    for (int k = 0; k < 6; k++) {
        txm_env env = {0};
        t.out[1] = good;
        if (k == 0) t.out[1].pixels = NULL;
        if (k == 1) t.out[1].width = 47;
        if (k == 2) t.out[1].height = 39;
        if (k == 3) t.out[1].channels = 1;
        if (k == 4) t.out[1].sample = TXM_U8;
        if (k == 5) t.out[1].stride = 8;
        assert_int_equal(texpatch_make(&t.desc, &env, t.out), TXM_BAD_ARGUMENT);
        assert_true(env.message[0] != 0 && is_filled(&t.out[0]) && is_filled(&good));
    }
    assert_int_equal(texpatch_make(&t.desc, NULL, NULL), TXM_BAD_ARGUMENT);
    t.out[1] = good;
    assert_int_equal(texpatch_make(NULL, NULL, t.out), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_begin(&t.desc, NULL, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_plane_make(&t.desc, NULL, NULL), TXM_BAD_ARGUMENT);
}

static void test_job_refuses(void **state) {
    (void)state;
    whole t;
    make_whole(&t);
    texpatch_job *job = begin(&t.desc), *free_one;
    txm_image out = t.out[0];
    assert_int_equal(texpatch_draw(job, 0, 0, 0, NULL, out), TXM_BAD_ARGUMENT); /* no step yet */
    assert_int_equal(texpatch_draw(NULL, 0, 0, 0, NULL, out), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_step(NULL, NULL, NULL), TXM_BAD_ARGUMENT);
    run(job);
    static const int places[6][2] = {{-1, 0}, {0, -1}, {1, 0}, {0, 1}, {INT_MAX, 0}, {0, INT_MIN}};
    for (int k = 0; k < 6; k++)
        assert_int_equal(texpatch_draw(job, 0, places[k][0], places[k][1], NULL, out),
                         TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_draw(job, 2, 0, 0, NULL, out), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_draw(job, -1, 0, 0, NULL, out), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_draw(job, 1, 0, 0, NULL, out), TXM_BAD_ARGUMENT); /* 8 bit */
    out.channels = 1;
    assert_int_equal(texpatch_draw(job, 0, 0, 0, NULL, out), TXM_BAD_ARGUMENT);
    out.channels = 3;
    out.pixels = NULL;
    assert_int_equal(texpatch_draw(job, 0, 0, 0, NULL, out), TXM_BAD_ARGUMENT);
    assert_true(is_filled(&t.out[0]));

    const txm_image before = drawn(job, 0, &t.maps[0][0], 48, 40);
    const txm_image all = new_mask(48, 40, 255), guide = new_mask(48, 40, 0);
    for (int k = 0; k < 8; k++) {
        txm_env env = {0};
        txm_image mask = all, g = guide, m = all;
        if (k == 0) mask.width = 47;
        if (k == 1) mask.pixels = NULL;
        if (k == 2) mask.height = 20;
        if (k == 3) mask.channels = 5;
        if (k == 4) g.width = 47;
        if (k == 5) g = new_image(48, 40, 2, TXM_U8);
        if (k == 6) g.pixels = NULL;
        if (k == 7) m.height = 39;
        assert_int_equal(texpatch_again(job, &mask, &g, &m, 1, &env), TXM_BAD_ARGUMENT);
        assert_true(env.message[0] != 0);
    }
    assert_int_equal(texpatch_again(NULL, &all, NULL, NULL, 1, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_again(job, NULL, NULL, NULL, 1, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(run(job), 1);
    const txm_image after = drawn(job, 0, &t.maps[0][0], 48, 40);
    assert_true(is_same(&before, &after));
    texpatch_free(job);

    /* a guide for a job that was begun without one */
    const texpatch_exemplar e = exemplar_of(t.maps[0]);
    const texpatch_desc d = desc_of(&e, 1, 2, 48, 40);
    free_one = begin(&d);
    assert_int_equal(texpatch_again(free_one, &all, &guide, NULL, 1, NULL), TXM_BAD_ARGUMENT);
    out = t.out[0]; /* it has not taken a step */
    assert_int_equal(texpatch_draw(free_one, 0, 0, 0, NULL, out), TXM_BAD_ARGUMENT);
    texpatch_free(free_one);
    texpatch_free(NULL);
}

/* ---- failing memory, cancelling --------------------------------------------------------- */

static txm_status make_it(void *context, txm_env *env) {
    const whole *t = (const whole *)context;
    return texpatch_make(&t->desc, env, t->out);
}

static void test_make_misfortune(void **state) {
    (void)state;
    whole t;
    make_whole(&t);
    assert_int_equal(make_it(&t, NULL), TXM_OK);
    assert_true(!is_filled(&t.out[0]) && !is_filled(&t.out[1]));
    const tk_output outputs[2] = {{t.out[0].pixels, bytes_of(&t.out[0])},
                                  {t.out[1].pixels, bytes_of(&t.out[1])}};
    for (int kind = 0; kind < 3; kind++)
        assert_true(tk_sweep_outputs(make_it, &t, (tk_kind)kind, outputs, 2) > 10);
}

/* A step of a job, or with `again` texpatch_again, that fails in many ways before it succeeds. */
static int stumble(texpatch_job *job, tk_memory *memory, int failing, const txm_image *again,
                   const txm_image *guide) {
    for (long k = 1;; k = tk_places(k, LONG_MAX)) {
        tk_progress progress = {0};
        const long blocks = memory->blocks, calls = memory->calls;
        int more = 1;
        if (!failing) progress.cancel_at = k;
        else memory->fail_at = calls + k;
        txm_env env = tk_env(memory, &progress);
        const txm_status status = again ? texpatch_again(job, again, guide, NULL, 4, &env)
                                        : texpatch_step(job, &env, &more);
        assert_true(progress.errors == 0 && progress.late == 0 && memory->errors == 0);
        if (failing ? memory->calls - calls < k : progress.calls < k) {
            assert_int_equal(status, TXM_OK);
            memory->fail_at = 0;
            return more;
        }
        assert_int_equal(status, failing ? TXM_OUT_OF_MEMORY : TXM_CANCELLED);
        assert_true(env.message[0] != 0);
        assert_int_equal(memory->blocks, blocks); /* as before the step */
    }
}

/* The same for single steps, and for a part made again: the result is as without faults. */
static void test_step_misfortune(void **state) {
    (void)state;
    whole t;
    make_whole(&t);
    /* two levels, so that steps refine too */
    const txm_image gravel = draw_gravel(98, 96, 1, 0);
    const texpatch_exemplar e = exemplar_of(&gravel);
    const texpatch_desc large = desc_of(&e, 1, 1, 70, 50);
    for (int which = 0; which < 2; which++) {
        texpatch_desc d = which ? large : t.desc;
        d.passes = 1;
        const int w = d.width, h = d.height;
        const txm_image mask = new_mask(w, h, 0), guide = new_mask(w, h, 0);
        fill_box(&mask, 12, 5, 40, 30, 255);
        const txm_image *new_guide = which ? NULL : &guide;
        texpatch_job *job = begin(&d);
        const int steps = run(job);
        assert_int_equal(texpatch_again(job, &mask, new_guide, NULL, 4, NULL), TXM_OK);
        const int part_steps = run(job);
        const txm_image wanted = drawn(job, 0, &d.exemplars[0].maps[0], w, h);
        texpatch_free(job);
        for (int failing = 0; failing < 2; failing++) {
            tk_memory memory = {0};
            txm_env env = tk_env(&memory, NULL);
            job = NULL;
            for (long k = 1; failing && !job; k = tk_places(k, LONG_MAX)) {
                memory.fail_at = memory.calls + k;
                const txm_status status = texpatch_begin(&d, &env, &job);
                assert_int_equal(status, job ? TXM_OK : TXM_OUT_OF_MEMORY);
                if (!job) assert_int_equal(tk_leaks(&memory), 0);
            }
            memory.fail_at = 0;
            if (!job) assert_int_equal(texpatch_begin(&d, &env, &job), TXM_OK);
            int done = 1; /* steps: one that fails does not count */
            while (stumble(job, &memory, failing, NULL, NULL)) done++;
            assert_int_equal(done, steps);
            stumble(job, &memory, failing, &mask, new_guide);
            for (done = 1; stumble(job, &memory, failing, NULL, NULL);) done++;
            assert_int_equal(done, part_steps);
            const txm_image out = drawn(job, 0, &d.exemplars[0].maps[0], w, h);
            assert_true(is_same(&out, &wanted));
            texpatch_free(job);
            assert_int_equal(tk_leaks(&memory), 0);
        }
    }
}

/* What is reported rises from 0 towards 1 from step to step; so it does for a part. */
static void test_progress(void **state) {
    (void)state;
    const txm_image gravel = draw_gravel(96, 98, 3, 0);
    const texpatch_exemplar e = exemplar_of(&gravel);
    const texpatch_desc d = desc_of(&e, 1, 1, 96, 100);
    texpatch_job *job = begin(&d);
    const txm_image mask = new_mask(96, 100, 0);
    fill_box(&mask, 40, 40, 60, 70, 255);
    for (int part = 0; part < 2; part++) {
        tk_progress progress = {0};
        txm_env env = tk_env(NULL, &progress);
        float last = -1;
        for (int more = 1; more; last = progress.last) {
            assert_int_equal(texpatch_step(job, &env, &more), TXM_OK);
            assert_true(last < 0 ? progress.last == 0 : progress.last > last);
        }
        assert_true(last > 0.8f && last < 1);
        assert_int_equal(progress.errors, 0);
        assert_true(progress.calls > 20);
        if (!part) assert_int_equal(texpatch_again(job, &mask, NULL, NULL, 2, NULL), TXM_OK);
    }
    texpatch_free(job);
}

/* ---- all tests -------------------------------------------------------------------------- */

/* ---- all tests -------------------------------------------------------------------------- */

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(test_refuses, release_all),
        cmocka_unit_test_teardown(test_job_refuses, release_all),
        cmocka_unit_test_teardown(test_make_misfortune, release_all),
        cmocka_unit_test_teardown(test_step_misfortune, release_all),
        cmocka_unit_test_teardown(test_progress, release_all),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
