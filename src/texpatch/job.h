#ifndef TEXPATCH_JOB_H
#define TEXPATCH_JOB_H

#include "sheets.h"
#include "refine.h"

/* ---- jobs --------------------------------------------------------------------------------- */

/* cost of the squared distance from the lattice, in gray levels per pixel */
#define TXP_LATTICE 20.0

enum { TXP_MAX_STEPS = 2 * TXP_MAX_LEVELS * 16 + 8 };
typedef enum txp_kind { TXP_STEP_QUILT, TXP_STEP_PASS, TXP_STEP_POLISH, TXP_STEP_FINISH } txp_kind;
typedef struct txp_step {
    txp_kind kind;
    int level, size, stride, round, rounds;
    float cost; /* approximate, relative to other steps */
} txp_step;

/* Where pixels come from, and what is done to them. */
typedef struct txp_origins {
    txp_place *at;
    int16_t *bend; /* x, y by which each pixel's place is moved, times TXP_BEND_UNIT             */
    int16_t *tone; /* what is added to each of the tones of a source, times TXP_TONE_UNIT         */
} txp_origins;
#define TXP_BEND_UNIT 2048.0f /* of a pixel; pieces are bent by some pixels                        */
#define TXP_TONE_UNIT 256.0f  /* of a gray level; tones change by up to TXP_LARGE_STEP             */

/* What is known of a canvas before the work begins, per pixel of its full size; NULL: nothing. */
typedef struct txp_given {
    uint8_t *pixels;     /* compared bytes: of fixed pixels, and the guide of all                */
    uint8_t *fixed;      /* 1 = it does not change                                               */
    uint8_t *free_guide; /* 1 = the guide does not count                                         */
    txp_origins from;    /* of fixed pixels                                                      */
} txp_given;

struct texpatch_job {
    txm_arena memory;        /* of the job, which lies in it                                      */
    txm_arena source_memory; /* of the source; empty if another job or a plane owns that         */
    txp_setup setup;
    txp_source *source;
    int width, height;       /* of the canvas at full size, margin included                       */
    int margin_x, margin_y;  /* where pixel (0, 0) of the output lies on it                       */
    double shift_x, shift_y; /* lattice offset at full size                                      */
    txp_step steps[TXP_MAX_STEPS];
    int step_count, next_step;
    int level; /* that the canvas has now; -1: none yet                             */
    txm_arena canvas_memory, finish_memory; /* of the canvas; of bend and tone                   */
    txp_canvas canvas;
    int16_t *bend, *tone; /* as in txp_origins; NULL: not yet                          */
    txp_given given;
    uint64_t seed;
    /* a part that is being made again lies at (part_x, part_y) of the canvas */
    texpatch_job *part;
    int part_x, part_y;
};

/* of a finished job */
static inline txp_origins txp_origins_of(const texpatch_job *job) {
    txp_origins from;
    from.at = job->canvas.at;
    from.bend = job->bend;
    from.tone = job->tone;
    return from;
}

/* Copy count pixels, from pixel k of `from` to pixel i of `to`. */
static inline void txp_copy_origins(const txp_origins *to, size_t i, const txp_origins *from,
                                    size_t k, size_t count, int tones) {
    const size_t n = (size_t)tones;
    memcpy(to->at + i, from->at + k, count * sizeof *to->at);
    memcpy(to->bend + 2 * i, from->bend + 2 * k, count * 2 * sizeof *to->bend);
    memcpy(to->tone + n * i, from->tone + n * k, count * n * sizeof *to->tone);
}

/* The next step; there is room for two windows on all levels, 16 passes each, the quilt, polishing twice
   and the finish. */
static txp_step *txp_add_step(texpatch_job *job) {
    TXM_ASSERT(job->step_count < TXP_MAX_STEPS);
    return &job->steps[job->step_count++];
}

static void txp_setup_steps(texpatch_job *job) {
    const txp_source *s = job->source;
    const int top = s->levels - 1, passes = job->setup.passes;
    job->step_count = job->next_step = 0;
    txp_step *t = txp_add_step(job);
    t->kind = TXP_STEP_QUILT;
    t->level = top;
    t->cost = 1;
    for (int l = top; l >= 0 && passes > 0; l--) {
        for (int half = 0; half < 2; half++) {
            const int count = l == 0 && job->setup.is_default ? 2 : passes;
            for (int i = 0; i < count; i++) {
                t = txp_add_step(job);
                t->kind = TXP_STEP_PASS;
                t->level = l;
                t->round = i;
                t->rounds = count;
                t->size = TXP_WINDOW >> half;
                t->stride = half && l < top ? 2 : 4;
                t->cost = txm_float(1.0 / (double)(1 << 2 * l));
            }
        }
    }
    for (int i = 0; i < 2 && passes > 0; i++) {
        t = txp_add_step(job);
        t->kind = TXP_STEP_POLISH;
        t->level = 0;
        t->round = i;
        t->cost = 0.2f;
    }
    t = txp_add_step(job);
    t->kind = TXP_STEP_FINISH;
    t->level = 0;
    t->cost = 0.5f;
}

/* How much of a job's steps is done, 0..1: reported before each stage of a step. */
static txm_status txp_report(const texpatch_job *job, txm_env *env, const char *stage) {
    double all = 0, done = 0;
    for (int i = 0; i < job->step_count; i++) {
        all += (double)job->steps[i].cost;
        if (i < job->next_step) done += (double)job->steps[i].cost;
    }
    return txm_progress(env, txm_float(done / all), stage)
               ? txm_fail(env, TXM_CANCELLED, "cancelled")
               : TXM_OK;
}

/* a size at full resolution, at a level, rounded up */
static inline int txp_level_size(int x, int level) {
    return (x + (1 << level) - 1) >> level;
}

/* A place one level finer: of the four pixels the one with this parity. */
static inline txp_place txp_refine_place(const txp_source *s, int level, txp_place p, int px,
                                         int py) {
    const txp_stack *c = &s->stack[level], *f = &s->stack[level - 1];
    const int n = s->sheets > 1 && p.x >= 0 ? c->sheet[p.y] : 0;
    txp_place q = p;
    if (p.x < 0) return q;
    q.x = 2 * p.x + px;
    q.y = f->first[n] + 2 * (p.y - c->first[n]) + py;
    return q;
}

/* The empty canvas of a level, with what is kept and the guide in place. */
static txm_status txp_canvas_make(const texpatch_job *job, int level, txm_arena *arena,
                                  txp_canvas *c, txm_env *env) {
    const txp_source *s = job->source;
    const size_t n = (size_t)s->bytes;
    const int side = 1 << level;
    memset(c, 0, sizeof *c);
    c->width = txp_level_size(job->width, level);
    c->height = txp_level_size(job->height, level);
    c->wrap = job->setup.tileable;
    c->pitch = (size_t)(c->width + TXP_PAD) * n;
    const size_t pixels = (size_t)c->width * (size_t)c->height;
    c->pixels = (uint8_t *)txm_arena_zero(arena, (size_t)(c->height + TXP_PAD) + 1, c->pitch);
    c->at = (txp_place *)txm_arena_alloc(arena, pixels, sizeof *c->at);
    if (job->given.fixed) c->fixed = (uint8_t *)txm_arena_zero(arena, pixels, 1);
    if (job->given.free_guide) c->free_guide = (uint8_t *)txm_arena_zero(arena, pixels, 1);
    if (arena->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the canvas");
    memset(c->at, 255, pixels * sizeof *c->at);
    if (!job->given.pixels) return TXM_OK;
    for (int y = 0; y < c->height; y++) {
        for (int x = 0; x < c->width; x++) {
            const size_t i = txp_index(c, x, y);
            uint32_t sum[TEXPATCH_MAX_CHANNELS] = {0};
            int count = 0, kept = 0, unbound = 0;
            for (int v = y * side; v < (y + 1) * side && v < job->height; v++) {
                for (int u = x * side; u < (x + 1) * side && u < job->width; u++) {
                    const size_t k = (size_t)v * (size_t)job->width + (size_t)u;
                    count++;
                    if (job->given.fixed) kept += job->given.fixed[k];
                    if (job->given.free_guide) unbound += job->given.free_guide[k];
                    for (size_t b = 0; b < n; b++) sum[b] += job->given.pixels[k * n + b];
                }
            }
            uint8_t *out = txp_canvas_at(s, c, x, y);
            for (size_t b = 0; b < n && count > 0; b++)
                out[b] = (uint8_t)((sum[b] + (uint32_t)count / 2) / (uint32_t)count);
            if (c->free_guide) c->free_guide[i] = unbound * 2 > count;
            if (c->fixed && kept == count) {
                const size_t k = (size_t)(y * side) * (size_t)job->width + (size_t)(x * side);
                c->fixed[i] = 1;
                if (job->given.from.at) {
                    txp_place p = job->given.from.at[k];
                    const int sheet = s->sheets > 1 && p.x >= 0 ? s->stack[0].sheet[p.y] : 0;
                    if (p.x >= 0) {
                        const txp_stack *t = &s->stack[level];
                        p.x = txm_clampi(p.x >> level, 0, t->wide[sheet] - 1);
                        p.y = t->first[sheet] + txm_clampi((p.y - s->stack[0].first[sheet]) >> level,
                                                           0, t->high[sheet] - 1);
                    }
                    c->at[i] = p;
                }
            }
        }
    }
    return TXM_OK;
}

/* The cost of the average use of a place in the first pass, in gray levels per pixel: half the
   contrast. It is lower for a torus, whose ends must fit as well. */
static double txp_use_weight(const texpatch_job *job) {
    return fmin(0.5 * job->source->contrast, job->setup.tileable ? 16 : 32);
}

/* The counts of use, all 0. */
static void txp_use_make(const txp_stack *k, txp_use *u, txm_arena *arena) {
    u->columns = (k->width + TXP_CELL - 1) / TXP_CELL;
    u->rows = (k->height + TXP_CELL - 1) / TXP_CELL;
    u->count =
        (uint32_t *)txm_arena_zero(arena, (size_t)u->columns * (size_t)u->rows, sizeof *u->count);
    u->sums = (uint32_t *)txm_arena_zero(arena, (size_t)(u->columns + 1) * (size_t)(u->rows + 1),
                                         sizeof *u->sums);
}

static void txp_quilt_one(void *context, int index) {
    txp_quilt *q = (txp_quilt *)context + index;
    txp_quilt_run(q);
}

/* The side of a patch on the coarsest canvas: the caller's or the default for the exemplar, limited
   by the sizes of sheets and canvas; a multiple of 4, 8 or more. */
static int txp_patch_side(const texpatch_job *job, const txp_canvas *c, int level) {
    const txp_source *s = job->source;
    const txp_stack *k = &s->stack[level];
    const int wanted = job->setup.patch ? ((job->setup.patch >> level) + 2) / 4 * 4
                       : s->is_random   ? TXP_SMALL_BLOCK
                                        : TXP_BLOCK;
    int most = c->width < c->height ? c->width : c->height;
    if (c->wrap) most = most * 2 / 3 < TXP_PAD ? most * 2 / 3 : TXP_PAD;
    for (int n = 0; n < s->sheets; n++) {
        const int side = k->wide[n] < k->high[n] ? k->wide[n] : k->high[n];
        if (most > side * 2 / 3) most = side * 2 / 3;
    }
    return txm_clampi(wanted < most ? wanted : most / 4 * 4, 8, 4 * TXP_BLOCK);
}

/* The first pass. On a small canvas it is run several times, and the result with the cheapest cuts
   is kept. */
static txm_status txp_step_quilt(texpatch_job *job, txm_arena *memory, txp_canvas *out,
                                 txm_env *env) {
    txp_source *s = job->source;
    const int level = s->levels - 1;
    const txp_stack *k = &s->stack[level];
    txm_arena scratch;
    txp_quilt q[TXP_STARTS];
    txm_status status = TXM_OK;
    int starts = s->is_random || s->bytes > 4 ? 1 : TXP_STARTS, best = -1;
    memset(q, 0, sizeof q);
    status = txp_canvas_make(job, level, memory, out, env);
    if (status != TXM_OK) return status;
    const size_t pixels = (size_t)out->width * (size_t)out->height;
    const size_t bytes = out->pitch * ((size_t)(out->height + TXP_PAD) + 1);
    const int block = txp_patch_side(job, out, level);
    txm_arena_init(&scratch, env);
    if (pixels > 300 * 300 || job->given.from.at) starts = 1;
    for (int i = 0; i < starts; i++) {
        txp_quilt *t = &q[i];
        t->source = s;
        t->stack = k;
        t->canvas = *out;
        t->block = block;
        t->overlap = t->block / 2;
        t->use_weight = txp_use_weight(job);
        t->lattice_weight = TXP_LATTICE;
        t->rng = txm_rng_make(job->seed, (uint64_t)(1000 + i));
        t->shift_x = job->shift_x / (1 << level);
        t->shift_y = job->shift_y / (1 << level);
        t->canvas.pixels = (uint8_t *)txm_arena_alloc(&scratch, bytes, 1);
        t->canvas.at = (txp_place *)txm_arena_alloc(&scratch, pixels, sizeof(txp_place));
        t->known = (uint8_t *)txm_arena_zero(&scratch, bytes, 1);
        t->done = (uint8_t *)txm_arena_zero(&scratch, pixels, 1);
        t->error = (float *)txm_arena_alloc(&scratch, (size_t)(t->block * t->block), sizeof(float));
        t->scratch =
            (double *)txm_arena_alloc(&scratch, (size_t)(t->block * t->overlap), sizeof(double));
        t->near_places = (txp_place *)txm_arena_alloc(&scratch, TXP_CANDIDATES, sizeof(txp_place));
        t->near_costs = (float *)txm_arena_alloc(&scratch, TXP_CANDIDATES, sizeof(float));
        txp_use_make(k, &t->use, &scratch);
        if (scratch.failed) {
            status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the first pass");
            goto done;
        }
        txp_use_mean(&t->use, (double)pixels);
        memcpy(t->canvas.pixels, out->pixels, bytes);
        memcpy(t->canvas.at, out->at, pixels * sizeof(txp_place));
        const size_t n = (size_t)s->bytes, guide = (size_t)s->guide_at;
        for (int y = 0; y < out->height; y++) {
            for (int x = 0; x < out->width; x++) {
                const size_t p = txp_index(out, x, y);
                uint8_t *known = t->known + (size_t)y * out->pitch + (size_t)x * n;
                if (out->fixed && out->fixed[p]) {
                    t->done[p] = 1;
                    memset(known, 255, guide);
                }
                if (guide < n && !(out->free_guide && out->free_guide[p]))
                    memset(known + guide, 255, n - guide);
            }
        }
        txp_canvas_repeat(s, &t->canvas, t->known);
        txp_canvas_repeat(s, &t->canvas, t->canvas.pixels);
    }
    status = txp_report(job, env, "patches");
    if (status != TXM_OK) goto done;
    txm_parallel_for(env, starts, txp_quilt_one, q);
    for (int i = 0; i < starts; i++) {
        if (q[i].failed) {
            status = txm_fail(env, TXM_TOO_SMALL,
                              "no piece of the exemplar is free of masked pixels; "
                              "mask less, or make smaller patches");
            goto done;
        }
        if (best < 0 || q[i].cost < q[best].cost) best = i;
    }
    memcpy(out->at, q[best].canvas.at, pixels * sizeof(txp_place));
    txp_canvas_fill(s, k, out, 0, out->height);
done:
    txm_arena_free(&scratch);
    return status;
}

/* The canvas one level finer. */
static txm_status txp_refine(const texpatch_job *job, const txp_canvas *from, int level,
                             txm_arena *memory, txp_canvas *c, txm_env *env) {
    const txp_source *s = job->source;
    txm_status status = txp_canvas_make(job, level, memory, c, env);
    if (status != TXM_OK) return status;
    for (int y = 0; y < c->height; y++) {
        for (int x = 0; x < c->width; x++) {
            const size_t i = txp_index(c, x, y);
            if (c->fixed && c->fixed[i]) continue;
            txp_place p = from->at[txp_index(from, x / 2, y / 2)];
            if (p.x < 0) { /* next to kept pixels: take another neighbour */
                const int tx[4] = {x / 2 + 1, x / 2 - 1, x / 2, x / 2},
                          ty[4] = {y / 2, y / 2, y / 2 + 1, y / 2 - 1};
                for (int d = 0; d < 4 && p.x < 0; d++) {
                    if (tx[d] >= 0 && ty[d] >= 0 && tx[d] < from->width && ty[d] < from->height)
                        p = from->at[txp_index(from, tx[d], ty[d])];
                }
            }
            c->at[i] = txp_refine_place(s, level + 1, p, x & 1, y & 1);
        }
    }
    txp_canvas_fill(s, &s->stack[level], c, 0, c->height);
    return TXM_OK;
}

static int txp_grid(int extent, int size, int step, int wraps, int *at) {
    int n = 0;
    if (wraps) {
        for (int x = 0; x < extent; x += step) at[n++] = x;
        return n;
    }
    for (int x = 0; x < extent - size; x += step) at[n++] = x;
    at[n++] = extent - size;
    return n;
}

/* Allocate what a pass over c needs; scratch->failed: no memory. */
static void txp_pass_make(txp_pass *p, const txp_canvas *c, txm_arena *scratch) {
    p->xs = (int *)txm_arena_alloc(scratch, (size_t)(c->width / p->step + 2), sizeof(int));
    p->ys = (int *)txm_arena_alloc(scratch, (size_t)(c->height / p->step + 2), sizeof(int));
    if (scratch->failed) return;
    p->columns = txp_grid(c->width, p->size, p->step, c->wrap & TEXPATCH_TILE_X, p->xs);
    p->rows = txp_grid(c->height, p->size, p->step, c->wrap & TEXPATCH_TILE_Y, p->ys);
    const size_t windows = (size_t)p->columns * (size_t)p->rows;
    p->match = (txp_place *)txm_arena_alloc(scratch, windows, sizeof *p->match);
    p->sad = (uint32_t *)txm_arena_alloc(scratch, windows, sizeof *p->sad);
    p->weight = (int32_t *)txm_arena_alloc(scratch, windows, sizeof *p->weight);
    p->grain = (uint32_t *)txm_arena_zero(scratch, windows, sizeof *p->grain);
    txp_use_make(p->stack, &p->use, scratch);
    const size_t n = (size_t)p->source->bytes, band = (size_t)c->width * TXP_BAND;
    for (int i = 0; i < TXP_LANES && i * TXP_BAND < c->height; i++) {
        txp_band *b = &p->bands[i];
        b->sums = (int32_t *)txm_arena_alloc(scratch, band, (n + 2) * sizeof(int32_t));
        b->mean = (uint8_t *)txm_arena_alloc(scratch, band, n);
        if (scratch->failed) return;
        b->total = b->sums + band * n;
        b->nearest = b->total + band;
    }
}

/* One pass of the optimisation over c; the places it chooses go into c->next. */
static txm_status txp_run_pass(const texpatch_job *job, const txp_step *t, const txp_canvas *c,
                               txm_env *env) {
    const txp_source *s = job->source;
    const int bands = (c->height + TXP_BAND - 1) / TXP_BAND;
    txm_arena scratch;
    txp_pass p;
    txm_status status = TXM_OK;
    memset(&p, 0, sizeof p);
    txm_arena_init(&scratch, env);
    p.source = s;
    p.stack = &s->stack[t->level];
    p.canvas = c;
    p.size = t->size;
    p.step = t->stride;
    p.shift_x = job->shift_x / (1 << t->level);
    p.shift_y = job->shift_y / (1 << t->level);
    p.use_weight = txp_use_weight(job) / 2;
    p.lattice_weight = TXP_LATTICE / 5;
    p.exhaustive = t->level == s->levels - 1 && t->round == 0 && p.size == TXP_WINDOW;
    p.most_same = 8;
    p.skip = p.exhaustive ? 2 : 1;
    if (job->setup.novelty > 0 && t->level == (s->levels > 1 ? 1 : 0) && p.size < TXP_WINDOW &&
        t->round == t->rounds - 1) {
        p.most_same = (int)(7.5f - 3.5f * job->setup.novelty);
        p.exhaustive = 1;
        p.skip = 2;
    }
    p.seed = txm_hash(job->seed + (uint64_t)(job->next_step + 1) * 7919);
    txp_bell(p.size, p.bell);
    txp_pass_make(&p, c, &scratch);
    if (scratch.failed) {
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a pass");
        goto done;
    }
    txp_count_use(c, &p.use);
    txp_canvas_repeat(s, c, c->pixels);
    for (p.first_row = 0; p.first_row < p.rows; p.first_row += 32) {
        status = txp_report(job, env, "optimising");
        if (status != TXM_OK) goto done;
        txm_parallel_for(env, p.rows - p.first_row < 32 ? p.rows - p.first_row : 32, txp_match_row,
                         &p);
    }
    txp_set_weights(&p);
    memcpy(c->next, c->at, (size_t)c->width * (size_t)c->height * sizeof *c->next);
    for (p.first_band = 0; p.first_band < bands; p.first_band += TXP_LANES) {
        status = txp_report(job, env, "optimising");
        if (status != TXM_OK) goto done;
        txm_parallel_for(env, bands - p.first_band < TXP_LANES ? bands - p.first_band : TXP_LANES,
                         txp_choose_band, &p);
    }
done:
    txm_arena_free(&scratch);
    return status;
}

static txm_status txp_run_polish(const texpatch_job *job, const txp_canvas *c, txm_env *env) {
    txp_polish p;
    p.source = job->source;
    p.stack = &job->source->stack[0];
    p.canvas = c;
    txp_canvas_repeat(p.source, c, c->pixels);
    const int bands = (c->height + TXP_BAND - 1) / TXP_BAND;
    for (p.first_band = 0; p.first_band < bands; p.first_band += TXP_LANES) {
        const txm_status status = txp_report(job, env, "polishing");
        if (status != TXM_OK) return status;
        txm_parallel_for(env, bands - p.first_band < TXP_LANES ? bands - p.first_band : TXP_LANES,
                         txp_polish_band, &p);
    }
    return TXM_OK;
}

#endif /* TEXPATCH_JOB_H */
