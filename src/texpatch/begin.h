#ifndef TEXPATCH_BEGIN_H
#define TEXPATCH_BEGIN_H

#include "check.h"
#include "finish.h"

/* ---- beginning, stepping, releasing a job ----------------------------------------------- */

/* A random offset of the lattice. */
static void txp_lattice_start(const txp_source *s, uint64_t seed, double *x, double *y) {
    txm_rng rng = txm_rng_make(seed, 5);
    *x = txm_rng_below(&rng, (uint32_t)s->stack[0].wide[0]);
    *y = txm_rng_below(&rng, (uint32_t)s->stack[0].high[0]);
}

/* A job on a source, with nothing given yet, in `memory`, which it owns in the end. */
static texpatch_job *txp_job_make(const txp_setup *u, txp_source *s, int width, int height,
                                  uint64_t seed, txm_arena *memory, txm_env *env) {
    texpatch_job *job = (texpatch_job *)txm_arena_zero(memory, 1, sizeof *job);
    if (!job) return NULL;
    job->setup = *u;
    job->source = s;
    job->seed = seed;
    job->level = -1;
    job->width = width;
    job->height = height;
    txp_setup_steps(job);
    txm_arena_init(&job->canvas_memory, env);
    txm_arena_init(&job->finish_memory, env);
    txm_arena_init(&job->source_memory, env);
    return job;
}

/* Allocate what is given of a canvas; what is 0 here is not needed. memory->failed tells whether
   there was no memory. */
static void txp_given_make(txp_given *g, const txp_source *s, size_t pixels, int fixed,
                           int free_guide, int places, txm_arena *memory) {
    g->pixels = (uint8_t *)txm_arena_zero(memory, pixels, (size_t)s->bytes);
    if (fixed) g->fixed = (uint8_t *)txm_arena_zero(memory, pixels, 1);
    if (free_guide) g->free_guide = (uint8_t *)txm_arena_zero(memory, pixels, 1);
    if (places) {
        txp_origins *o = &g->from;
        o->at = (txp_place *)txm_arena_alloc(memory, pixels, sizeof *o->at);
        o->bend = (int16_t *)txm_arena_zero(memory, pixels, 2 * sizeof *o->bend);
        o->tone = (int16_t *)txm_arena_zero(memory, pixels, (size_t)s->tones * sizeof *o->tone);
    }
}

/* Copy the guide and its mask to the canvas; the margin repeats the border. mask: a byte for each
   pixel, 0 where the guide does not count; NULL: it counts everywhere. */
static void txp_guide_load(const texpatch_job *job, const txm_image *guide, const uint8_t *mask,
                           const txp_given *g) {
    const txp_source *s = job->source;
    const txp_setup *u = &job->setup;
    uint8_t bytes[TEXPATCH_MAX_CHANNELS];
    for (int y = 0; y < job->height; y++) {
        const int gy = txm_clampi(y - job->margin_y, 0, u->height - 1);
        for (int x = 0; x < job->width; x++) {
            const int gx = txm_clampi(x - job->margin_x, 0, u->width - 1);
            const size_t i = (size_t)y * (size_t)job->width + (size_t)x;
            const size_t tail = (size_t)(s->bytes - s->guide_at);
            txp_features(u, s, NULL, guide, gx, gy, 1, bytes);
            memcpy(g->pixels + i * (size_t)s->bytes + s->guide_at, bytes + s->guide_at, tail);
            if (g->free_guide)
                g->free_guide[i] = mask && !mask[(size_t)gy * (size_t)u->width + (size_t)gx];
        }
    }
}

TEXPATCH_API void texpatch_free(texpatch_job *job) {
    if (!job) return;
    texpatch_free(job->part);
    txm_arena_free(&job->canvas_memory);
    txm_arena_free(&job->finish_memory);
    txm_arena_free(&job->source_memory);
    txm_arena_free(&job->memory); /* the job lies in it */
}

TEXPATCH_API txm_status texpatch_begin(const texpatch_desc *desc, txm_env *env,
                                       texpatch_job **out) {
    txp_setup setup;
    txp_source source, *s;
    txm_arena memory, source_memory, masks;
    uint8_t *keep = NULL, *counts = NULL;
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    if (!desc) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL; pass a texpatch_desc");
    txm_status status = txp_check_exemplars(desc, &setup, &source, env);
    if (status == TXM_OK) status = txp_check_output(desc, &setup, &source, env);
    if (status != TXM_OK) return status;
    txm_arena_init(&memory, env);
    txm_image guide = txm_image_resolve(desc->guide);
    status = txp_show_all(&setup, &memory, env);
    if (status == TXM_OK && guide.pixels) status = txp_show(&guide, 0, desc->tileable, &memory, env);
    if (status == TXM_OK) status = txp_source_make(&setup, &source, &s, &source_memory, env);
    if (status != TXM_OK) {
        txm_arena_free(&memory);
        return status;
    }

    const int wx = desc->tileable & TEXPATCH_TILE_X, wy = desc->tileable & TEXPATCH_TILE_Y;
    const int room = 2 * TXP_WINDOW << (s->levels - 1); /* for a few patches */
    int width = desc->width + (wx ? 0 : 2 * TXP_MARGIN);
    int height = desc->height + (wy ? 0 : 2 * TXP_MARGIN);
    if (!wx && width < room) width = room;
    if (!wy && height < room) height = room;
    const size_t pixels = (size_t)width * (size_t)height;
    txm_arena_init(&masks, env);
    texpatch_job *job = txp_job_make(&setup, s, width, height, desc->seed, &memory, env);
    if (!job) goto no_memory;
    job->margin_x = wx ? 0 : TXP_MARGIN;
    job->margin_y = wy ? 0 : TXP_MARGIN;
    txp_lattice_start(s, desc->seed, &job->shift_x, &job->shift_y);
    if (s->guide_bytes || desc->kept) {
        txp_given_make(&job->given, s, pixels, desc->kept != NULL, s->guide_bytes > 0, 0, &memory);
        if (memory.failed ||
            (desc->kept &&
             txp_read_mask(&desc->keep, TXM_MASK_ALLOWS, &masks, &keep, env) != TXM_OK) ||
            (s->guide_bytes &&
             txp_read_mask(&desc->guide_mask, TXM_MASK_ALLOWS, &masks, &counts, env) != TXM_OK))
            goto no_memory;
        for (int y = 0; y < desc->height && desc->kept; y++) {
            for (int x = 0; x < desc->width; x++) {
                const size_t i =
                    (size_t)(y + job->margin_y) * (size_t)width + (size_t)(x + job->margin_x);
                if (!keep[(size_t)y * (size_t)desc->width + (size_t)x]) continue;
                job->given.fixed[i] = 1;
                txp_features(&setup, s, setup.kept, NULL, x, y, 1,
                             job->given.pixels + i * (size_t)s->bytes);
            }
        }
        if (s->guide_bytes) {
            txp_guide_load(job, &guide, counts, &job->given);
        }
    }
    txm_arena_free(&masks);
    job->memory = memory;
    job->source_memory = source_memory;
    *out = job;
    return TXM_OK;
no_memory:
    txm_arena_free(&masks);
    txm_arena_free(&memory);
    txm_arena_free(&source_memory);
    return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a job");
}

/* Every pixel of the canvas may take another place; all at a time, at the end. */
static txm_status txp_step_choose(const texpatch_job *job, const txp_step *t, const txp_canvas *c,
                                  txm_env *env) {
    const size_t pixels = (size_t)c->width * (size_t)c->height;
    txp_canvas with = *c;
    txm_arena scratch;
    txm_status status;
    txm_arena_init(&scratch, env);
    with.next = (txp_place *)txm_arena_alloc(&scratch, pixels, sizeof *with.next);
    if (scratch.failed) status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a pass");
    else if (t->kind == TXP_STEP_PASS) status = txp_run_pass(job, t, &with, env);
    else status = txp_run_polish(job, &with, env);
    if (status == TXM_OK) {
        memcpy(c->at, with.next, pixels * sizeof *c->at);
        txp_canvas_fill(job->source, &job->source->stack[t->level], c, 0, c->height);
    }
    txm_arena_free(&scratch);
    return status;
}

/* Bring the canvas to the level of a step: each level takes the place of the one before. */
static txm_status txp_step_reach(texpatch_job *job, const txp_step *t, txm_env *env) {
    while (job->level < 0 || job->level > t->level) {
        const int level = job->level < 0 ? t->level : job->level - 1;
        txm_arena memory;
        txp_canvas canvas;
        txm_arena_init(&memory, env);
        const txm_status status = job->level < 0
                                      ? txp_step_quilt(job, &memory, &canvas, env)
                                      : txp_refine(job, &job->canvas, level, &memory, &canvas, env);
        if (status != TXM_OK) {
            txm_arena_free(&memory);
            return status;
        }
        txm_arena_free(&job->canvas_memory);
        job->canvas_memory = memory;
        job->canvas = canvas;
        job->level = level;
    }
    return TXM_OK;
}

static txm_status txp_step_finish(texpatch_job *job, txm_env *env) {
    txm_arena stored;
    txp_origins made;
    txm_arena_init(&stored, env);
    const txm_status status = txp_finish(job, &job->canvas, TXP_FINISH_ROWS, &stored, &made, env);
    if (status != TXM_OK) {
        txm_arena_free(&stored);
        return status;
    }
    job->finish_memory = stored;
    job->bend = made.bend;
    job->tone = made.tone;
    return TXM_OK;
}

/* A step of a job without a part. The first one, the quilt, is done once its level is reached. */
static txm_status txp_step_run(texpatch_job *job, txm_env *env) {
    const txp_step *t = &job->steps[job->next_step];
    txm_status status = txp_step_reach(job, t, env);
    if (status == TXM_OK && (t->kind == TXP_STEP_PASS || t->kind == TXP_STEP_POLISH))
        status = txp_step_choose(job, t, &job->canvas, env);
    if (status == TXM_OK && t->kind == TXP_STEP_FINISH) status = txp_step_finish(job, env);
    if (status == TXM_OK) job->next_step++;
    return status;
}

/* Copy the part that was made again into the whole. */
static void txp_part_join(texpatch_job *job) {
    texpatch_job *part = job->part;
    const txp_source *s = job->source;
    const size_t n = (size_t)s->bytes;
    const txp_origins from = txp_origins_of(part), to = txp_origins_of(job);
    for (int y = 0; y < part->height; y++) {
        for (int x = 0; x < part->width; x++) {
            const size_t i = txp_index(&part->canvas, x, y);
            const size_t k = txp_index(&job->canvas, job->part_x + x, job->part_y + y);
            if (part->given.fixed[i]) continue;
            txp_copy_origins(&to, k, &from, i, 1, s->tones);
            memcpy(txp_canvas_at(s, &job->canvas, job->part_x + x, job->part_y + y),
                   txp_canvas_at(s, &part->canvas, x, y), n);
        }
    }
    texpatch_free(part);
    job->part = NULL;
}

TEXPATCH_API txm_status texpatch_step(texpatch_job *job, txm_env *env, int *more) {
    txm_status status = TXM_OK;
    if (!job) return txm_fail(env, TXM_BAD_ARGUMENT, "job is NULL");
    texpatch_job *at = job->part ? job->part : job;
    if (at->next_step < at->step_count) status = txp_step_run(at, env);
    if (status == TXM_OK && job->part && at->next_step == at->step_count) txp_part_join(job);
    if (more) *more = job->part || job->next_step < job->step_count;
    return status;
}

TEXPATCH_API int texpatch_lattice(const texpatch_job *job, float vectors[4]) {
    for (int i = 0; i < 4 && vectors; i++) vectors[i] = 0;
    if (!job || !job->source->has_lattice) return 0;
    for (int i = 0; i < 4 && vectors; i++) vectors[i] = txm_float(job->source->stack[0].lattice[i]);
    return 1;
}

#endif /* TEXPATCH_BEGIN_H */
