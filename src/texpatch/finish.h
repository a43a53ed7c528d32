#ifndef TEXPATCH_FINISH_H
#define TEXPATCH_FINISH_H

#include "job.h"
#include "seams.h"

/* ---- pieces warped until lines meet, steps of colour spread ----------------------------- */

#define TXP_BEND_SCREEN 0.02  /* bends fade within 7 pixels                                       */
#define TXP_TONE_SCREEN 0.004 /* tones within 16                                                  */

/* Compute the two fields of a canvas. */
static txm_status txp_finish(texpatch_job *job, txp_canvas *c, txm_arena *memory, float **bent,
                             float **toned, txm_env *env) {
    const txp_source *s = job->source;
    const txp_origins *given = &job->given.from;
    const int lanes = txp_lanes(s), bands = (c->height + TXP_BAND - 1) / TXP_BAND;
    const size_t pixels = (size_t)c->width * (size_t)c->height;
    txm_arena scratch;
    txp_field bend, tone;
    txp_seams seams;
    txm_status status = TXM_OK;
    memset(&bend, 0, sizeof bend);
    memset(&tone, 0, sizeof tone);
    txm_arena_init(&scratch, env);
    txp_field_make(&bend, c, 2, TXP_BEND_SCREEN, memory, &scratch);
    txp_field_make(&tone, c, lanes, TXP_TONE_SCREEN, memory, &scratch);
    if (memory->failed || scratch.failed) {
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to finish the picture");
        goto done;
    }
    for (size_t i = 0; i < pixels && given->bend; i++) {
        if (!job->given.fixed[i]) continue;
        const float *b = given->bend + 2 * i, *v = given->tone + (size_t)lanes * i;
        const int x = (int)(i % (size_t)c->width), y = (int)(i / (size_t)c->width);
        float most = 0;
        memcpy(bend.value + 2 * i, b, 2 * sizeof(float));
        memcpy(tone.value + (size_t)lanes * i, v, (size_t)lanes * sizeof(float));
        for (int k = 0; k < lanes; k++) most = txm_maxf(most, fabsf(v[k]));
        if (fabsf(b[0]) + fabsf(b[1]) > 0.05f) txp_field_mark(&bend, x, y);
        if (most > 0.25f) txp_field_mark(&tone, x, y);
    }
    seams.source = s;
    seams.canvas = c;
    seams.bend = &bend;
    seams.tone = &tone;
    /* A band also writes to the first row of the next one: so every second band at a time, and the
       last one, which may be followed by the first, alone. */
    for (int turn = 0; turn < 3; turn++) {
        const int end = turn < 2 ? bands - 1 : bands, from = turn < 2 ? turn : bands - 1;
        for (seams.first_band = from; seams.first_band < end; seams.first_band += 2 * TXP_LANES) {
            const int count = (end - seams.first_band + 1) / 2;
            status = txp_report(job, env, "blending");
            if (status != TXM_OK) goto done;
            txm_parallel_for(env, count < TXP_LANES ? count : TXP_LANES, txp_measure_band, &seams);
        }
    }
    txp_field_spread(&bend);
    txp_field_spread(&tone);
    for (int i = 0; i < TXP_SWEEPS; i++) {
        status = txp_report(job, env, "blending");
        if (status != TXM_OK) goto done;
        txp_relax_field(&bend, env);
        txp_relax_field(&tone, env);
    }
    *bent = bend.value;
    *toned = tone.value;
done:
    txm_arena_free(&scratch);
    return status;
}

#endif /* TEXPATCH_FINISH_H */
