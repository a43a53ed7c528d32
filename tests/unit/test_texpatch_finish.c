/* test_texpatch_finish.c - a large canvas is finished some rows at a time, as if it were done at once
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texpatch_finish && build/tests/unit/test_texpatch_finish */
#define TEXPATCH_IMPLEMENTATION
#include "patchkit.h"

enum { SIDE = 64, WIDTH = 96, ALL_ROWS = 1 << 20 };

/* A job whose next step is to finish. */
static texpatch_job *unfinished(const txm_image *exemplar, int height, int tileable) {
    const texpatch_exemplar e = exemplar_of(exemplar);
    texpatch_desc d = desc_of(&e, 1, 1, WIDTH, height);
    texpatch_job *job = NULL;
    d.tileable = tileable;
    d.passes = -1; /* large pieces: seams lie apart */
    d.patch = SIDE;
    assert_int_equal(texpatch_begin(&d, NULL, &job), TXM_OK);
    while (job->steps[job->next_step].kind != TXP_STEP_FINISH)
        assert_int_equal(texpatch_step(job, NULL, NULL), TXM_OK);
    return job;
}

static txp_origins finished(const texpatch_job *job, int step, txm_arena *arena) {
    txp_origins made;
    memset(&made, 0, sizeof made);
    assert_int_equal(txp_finish(job, &job->canvas, step, arena, &made, NULL), TXM_OK);
    return made;
}

static int largest(const int16_t *values, size_t count) {
    int most = 0;
    for (size_t i = 0; i < count; i++) most = abs(values[i]) > most ? abs(values[i]) : most;
    return most;
}

static void test_some_rows_at_a_time(void **state) {
    (void)state;
    static const int heights[] = {576, 500, 576}, tileable[] = {0, TEXPATCH_TILE_X, 3};
    const txm_image gravel = draw_gravel(2 * SIDE, 2 * SIDE, 3, 0);
    for (int k = 0; k < 3; k++) {
        texpatch_job *job = unfinished(&gravel, heights[k], tileable[k]);
        const size_t pixels = (size_t)job->canvas.width * (size_t)job->canvas.height;
        const size_t tones = (size_t)job->source->tones;
        txm_arena arena;
        txm_arena_init(&arena, NULL);
        const txp_origins whole = finished(job, ALL_ROWS, &arena);
        const int bent = largest(whole.bend, 2 * pixels), toned = largest(whole.tone, tones * pixels);
        assert_between("pixels bent at most", bent / 2048.0, 0.5, 8);
        assert_between("gray levels toned at most", toned / 256.0, 1, 64);
        for (int step = TXP_BAND; step <= 8 * TXP_BAND; step *= 8) {
            const txp_origins parts = finished(job, step, &arena);
            assert_memory_equal(whole.bend, parts.bend, 2 * pixels * sizeof *whole.bend);
            assert_memory_equal(whole.tone, parts.tone, tones * pixels * sizeof *whole.tone);
        }
        txm_arena_free(&arena);
        texpatch_free(job);
    }
}

static void test_codes(void **state) {
    (void)state;
    for (int code = -32767; code <= 32767; code++)
        assert_int_equal(txp_code(txm_float((float)code / TXP_BEND_UNIT), TXP_BEND_UNIT), code);
    assert_int_equal(txp_code(1e9f, TXP_TONE_UNIT), 32767);
    assert_int_equal(txp_code(-1e9f, TXP_TONE_UNIT), -32767);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(test_some_rows_at_a_time, release_all),
        cmocka_unit_test(test_codes),
    };
    return cmocka_run_group_tests_name("texpatch finish", tests, NULL, NULL);
}
