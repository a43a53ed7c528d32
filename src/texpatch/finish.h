#ifndef TEXPATCH_FINISH_H
#define TEXPATCH_FINISH_H

#include "job.h"
#include "seams.h"

/* ---- pieces warped until lines meet, steps of colour spread ----------------------------- */

enum {
    TXP_FINISH_ROWS = 256, /* rows of a large canvas that are finished at a time ...               */
    TXP_FINISH_REACH = TXP_BAND /* ... with so many before and behind them, TXP_FADE at least       */
};
#define TXP_BEND_SCREEN 0.02  /* bends fade within 7 pixels                                       */
#define TXP_TONE_SCREEN 0.004 /* tones within 16                                                  */
#define TXP_BENT 0.05f        /* pixels and gray levels: kept pixels that are bent or toned more  */
#define TXP_TONED 0.25f       /* act on their surroundings                                        */

/* The two fields over some rows. */
typedef struct txp_fields {
    txp_field bend, tone;
    int tones; /* of the lanes of tone so many are used                                            */
    int measured; /* rows from here on have no seams yet                                          */
} txp_fields;

/* A stored value, and back. */
static inline int16_t txp_code(float value, float unit) {
    return (int16_t)floorf(txm_float(txm_clampf(txm_float(value * unit), -32767, 32767) + 0.5f));
}

/* Set the values of fixed pixels. */
static void txp_fields_fix(const txp_origins *given, txp_fields *f) {
    const txp_canvas *c = f->bend.canvas;
    const size_t lanes = (size_t)f->tone.lanes, tones = (size_t)f->tones;
    if (!given->bend) return;
    for (int y = 0; y < f->bend.height; y++) {
        const int row = txp_field_row(&f->bend, y);
        for (int x = 0; x < c->width && row >= 0; x++) {
            const size_t i = txp_index(c, x, row), at = (size_t)y * (size_t)c->width + (size_t)x;
            const int16_t *b = given->bend + 2 * i, *v = given->tone + tones * i;
            float *bent = f->bend.value + 2 * at, *toned = f->tone.value + lanes * at, most = 0;
            if (!c->fixed[i]) continue;
            for (size_t k = 0; k < 2; k++) bent[k] = txm_float((float)b[k] / TXP_BEND_UNIT);
            for (size_t k = 0; k < tones; k++) {
                toned[k] = txm_float((float)v[k] / TXP_TONE_UNIT);
                most = txm_maxf(most, fabsf(toned[k]));
            }
            if (fabsf(bent[0]) + fabsf(bent[1]) > TXP_BENT) txp_field_mark(&f->bend, x, y);
            if (most > TXP_TONED) txp_field_mark(&f->tone, x, y);
        }
    }
}

/* Measure the seams of the rows that have none yet. A band also writes to the first row of the next
   one: so every second band at a time, and the last one, which may be followed by the first, alone. */
static txm_status txp_fields_measure(const texpatch_job *job, txp_fields *f, txm_env *env) {
    txp_seams seams;
    const int bands = (f->bend.height - f->measured + TXP_BAND - 1) / TXP_BAND;
    seams.source = job->source;
    seams.bend = &f->bend;
    seams.tone = &f->tone;
    for (int turn = 0; turn < 3; turn++) {
        const int end = turn < 2 ? bands - 1 : bands;
        for (int band = turn < 2 ? turn : bands - 1; band < end; band += 2 * TXP_LANES) {
            const int count = (end - band + 1) / 2;
            const txm_status status = txp_report(job, env, "blending");
            if (status != TXM_OK) return status;
            seams.first_row = f->measured + band * TXP_BAND;
            txm_parallel_for(env, count < TXP_LANES ? count : TXP_LANES, txp_measure_band, &seams);
        }
    }
    f->measured = f->bend.height;
    return TXM_OK;
}

/* Relax rows from..to-1. Of other rows only those that still act on them in the sweeps to come. */
static txm_status txp_fields_relax(const texpatch_job *job, txp_fields *f, int from, int to,
                                   txm_env *env) {
    const int height = f->bend.height;
    txp_field_spread(&f->bend);
    txp_field_spread(&f->tone);
    for (int left = 2 * TXP_SWEEPS - 1; left >= 0; left--) {
        const int first = from - left > 0 ? from - left : 0;
        const int end = to + left < height ? to + left : height;
        const int is_all = f->bend.closed, colour = (left + 1) % 2;
        const txm_status status = colour ? TXM_OK : txp_report(job, env, "blending");
        if (status != TXM_OK) return status;
        txp_relax_field(&f->bend, is_all ? 0 : first, is_all ? height : end, colour, env);
        txp_relax_field(&f->tone, is_all ? 0 : first, is_all ? height : end, colour, env);
    }
    return TXM_OK;
}

/* Store rows from..to-1 of the fields. */
static void txp_fields_store(const txp_fields *f, int from, int to, int16_t *bend, int16_t *tone) {
    const txp_canvas *c = f->bend.canvas;
    const size_t width = (size_t)c->width, lanes = (size_t)f->tone.lanes, tones = (size_t)f->tones;
    const size_t first = (size_t)(f->bend.top + from) * width, at = (size_t)from * width;
    const size_t count = (size_t)(to - from) * width;
    TXM_ASSERT(f->bend.top + from >= 0 && f->bend.top + to <= c->height);
    for (size_t i = 0; i < 2 * count; i++)
        bend[2 * first + i] = txp_code(f->bend.value[2 * at + i], TXP_BEND_UNIT);
    for (size_t i = 0; i < count; i++) {
        const float *value = f->tone.value + lanes * (at + i);
        for (size_t k = 0; k < tones; k++) tone[tones * (first + i) + k] = txp_code(value[k], TXP_TONE_UNIT);
    }
}

/* Compute how the pieces of a canvas are bent and toned. A large one is done `step` rows at a time, a
   multiple of TXP_BAND: the fields take 40 bytes a pixel of RGB, what is stored of them 10. */
static txm_status txp_finish(const texpatch_job *job, const txp_canvas *c, int step, txm_arena *memory,
                             txp_origins *out, txm_env *env) {
    const int lanes = (job->source->tones + 3) / 4 * 4, reach = TXP_FINISH_REACH;
    const int is_whole = c->height <= step + 2 * reach, rows = is_whole ? c->height : step + 2 * reach;
    const size_t pixels = (size_t)c->width * (size_t)c->height;
    txm_arena scratch;
    txp_fields f;
    txm_status status = TXM_OK;
    TXM_ASSERT(reach >= TXP_FADE && step % TXP_BAND == 0);
    memset(&f, 0, sizeof f);
    f.tones = job->source->tones;
    txm_arena_init(&scratch, env);
    txp_field_make(&f.bend, c, rows, 2, TXP_BEND_SCREEN, &scratch);
    txp_field_make(&f.tone, c, rows, lanes, TXP_TONE_SCREEN, &scratch);
    out->bend = (int16_t *)txm_arena_alloc(memory, pixels, 2 * sizeof *out->bend);
    out->tone = (int16_t *)txm_arena_alloc(memory, pixels, (size_t)f.tones * sizeof *out->tone);
    if (memory->failed || scratch.failed)
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to finish the picture");
    if (!is_whole) f.bend.top = f.tone.top = -reach;
    for (int y = 0; y < c->height && status == TXM_OK; y += step) {
        const int from = is_whole ? 0 : reach, left = c->height - y;
        const int to = is_whole ? rows : from + (left < step ? left : step);
        txp_fields_fix(&job->given.from, &f);
        status = txp_fields_measure(job, &f, env);
        if (status == TXM_OK) status = txp_fields_relax(job, &f, from, to, env);
        if (status != TXM_OK) break;
        txp_fields_store(&f, from, to, out->bend, out->tone);
        if (is_whole) break;
        txp_field_move(&f.bend, step);
        txp_field_move(&f.tone, step);
        f.measured = rows - step;
    }
    txm_arena_free(&scratch);
    return status;
}

#endif /* TEXPATCH_FINISH_H */
