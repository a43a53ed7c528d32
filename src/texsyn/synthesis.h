#ifndef TEXSYN_SYNTHESIS_H
#define TEXSYN_SYNTHESIS_H

#include "sampler.h"
#include "example.h"

/* ---- public: synthesis ------------------------------------------------------------------ */

struct texsyn_job {
    texsyn_synth_desc desc;
    txm_env memory;  /* the allocator of texsyn_begin                         */
    txm_arena arena; /* holds the job; what a level needs lies in level_arena */
    txm_arena level_arena;
    int16_t *noise;
    txs_canvas canvas; /* of the current level, or of the finished level 0      */
    txs_sampler *sampler;
    int level, sweep;  /* current ones; level -1: finished                      */
    double work, done; /* pixel visits in all, so far                           */
};

/* sweeps of a level: the coarser ones cost little and matter more */
static int txs_sweeps(const texsyn_synth_desc *d, int level) {
    static const int sweeps[5][3] = {{2, 4, 8}, {3, 6, 10}, {5, 8, 16}, {6, 12, 24}, {10, 20, 32}};
    return sweeps[d->quality + 2][level > 2 ? 2 : level];
}

/* Size of a level's canvas. A canvas is always a torus. Where the result need not tile, it is a
   crop of one that is not too small to have statistics and halves evenly. Returns 0 if the finest
   is larger than TEXSYN_MAX_PIXELS. */
static int txs_canvas_size(const texsyn_synth_desc *d, int level, int *width, int *height) {
    const int64_t even = (int64_t)1 << (d->model->levels - 1);
    int64_t w = d->width, h = d->height;
    if (!d->tileable) {
        w = ((w < TXS_SMALLEST ? (int)TXS_SMALLEST : w) + even - 1) / even * even;
        h = ((h < TXS_SMALLEST ? (int)TXS_SMALLEST : h) + even - 1) / even * even;
    }
    *width = (int)((w + (1 << level) - 1) >> level);
    *height = (int)((h + (1 << level) - 1) >> level);
    return h <= TEXSYN_MAX_PIXELS / w;
}

/* Make canvas and sampler of the next finer level. */
static txm_status txs_enter_level(texsyn_job *job, txm_env *env) {
    const texsyn_model *m = job->desc.model;
    const int i = job->level;
    const txs_level *l = &m->level[i];
    int width, height, margin = TXS_LABEL_REACH, filters = 0;
    txs_canvas coarse = job->canvas;
    txs_canvas_size(&job->desc, i, &width, &height);
    for (int k = 0; k < l->type_count; k++) {
        int reach = txs_reach(&l->types[k]);
        if (reach > margin) margin = reach;
        filters += l->types[k].kind == TEXSYN_FILTER;
    }
    txm_arena_free(&job->level_arena);
    job->sampler = NULL;
    if (!txs_canvas_make(&job->canvas, &job->memory, width, height, margin, 2 * m->bands + 1)) {
        job->canvas = coarse;
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the canvas");
    }
    job->sampler =
        txs_sampler_make(&job->level_arena, l, l->type_count, filters, &job->canvas, m->bands,
                         job->noise, txm_hash(job->desc.seed) + 128 + (uint64_t)i);
    if (!job->sampler) {
        txs_canvas_free(&job->canvas, &job->memory);
        job->canvas = coarse;
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the sampler");
    }
    if (coarse.pixels) {
        txs_fill_parent(l + 1, &coarse, l, &job->canvas, m->bands);
        txs_fill_labels(l, &job->canvas, m->bands);
    }
    txs_start_canvas(l, &job->canvas, m->bands, coarse.pixels != NULL,
                     txm_hash(job->desc.seed) + (uint64_t)i);
    txs_canvas_free(&coarse, &job->memory);
    txs_sampler_start(job->sampler, env);
    return TXM_OK;
}

TEXSYN_API txm_status texsyn_begin(const texsyn_synth_desc *desc, txm_env *env, texsyn_job **out) {
    int width, height;
    if (out) *out = NULL;
    if (!desc || !out || !desc->model)
        return txm_fail(env, TXM_BAD_ARGUMENT, "begin: desc, model or out is NULL");
    if (desc->width < 1 || desc->height < 1)
        return txm_fail(env, TXM_BAD_ARGUMENT, "width and height must be 1 or more");
    if (!txs_canvas_size(desc, 0, &width, &height))
        return txm_fail(env, TXM_TOO_LARGE, "more than TEXSYN_MAX_PIXELS pixels; make tiles");
    if (desc->quality < -2 || desc->quality > 2)
        return txm_fail(env, TXM_BAD_ARGUMENT, "quality must be -2 to 2");

    txm_arena arena;
    txm_arena_init(&arena, env);
    texsyn_job *job = (texsyn_job *)txm_arena_zero(&arena, 1, sizeof *job);
    int16_t *noise = (int16_t *)txm_arena_alloc(&arena, TXS_NOISE + TXS_VALUES, sizeof *noise);
    if (arena.failed) {
        txm_arena_free(&arena);
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the job");
    }
    txs_noise_table(noise);
    job->arena = arena;
    job->noise = noise;
    txm_arena_init(&job->level_arena, env);
    if (env) {
        job->memory.allocate = env->allocate;
        job->memory.release = env->release;
        job->memory.memory_user = env->memory_user;
    }
    job->desc = *desc;
    job->level = desc->model->levels - 1;
    for (int i = 0; i <= job->level; i++) {
        txs_canvas_size(desc, i, &width, &height);
        job->work += (double)width * height * txs_sweeps(desc, i);
    }
    txm_status status = txs_enter_level(job, env);
    if (status == TXM_OK) *out = job;
    else texsyn_free(job);
    return status;
}

TEXSYN_API txm_status texsyn_step(texsyn_job *job, txm_env *env, int *more) {
    if (!job) return txm_fail(env, TXM_BAD_ARGUMENT, "step: job is NULL");
    txm_status status = TXM_OK;
    if (job->level >= 0) {
        if (job->sweep == txs_sweeps(&job->desc, job->level)) { /* failed here the last time? */
            job->level--;
            if ((status = txs_enter_level(job, env)) != TXM_OK) {
                job->level++;
                return status;
            }
            job->sweep = 0;
        }
        const double visits = (double)job->canvas.width * job->canvas.height;
        status = txs_sweep(job->sampler, env, "synthesise", (float)(job->done / job->work),
                           (float)((job->done + visits) / job->work));
        if (status != TXM_OK) return status;
        job->done += visits;
        job->sweep++;
        if (job->level == 0 && job->sweep == txs_sweeps(&job->desc, 0)) {
            job->level = -1;
            txm_arena_free(&job->level_arena);
        }
    }
    if (more) *more = job->level >= 0;
    return TXM_OK;
}

/* A canvas as pixels: back from bands to channels. Within its quantisation step a value is placed
   by its neighbours where these are smooth, at random where they are not. */
typedef struct txs_painter {
    const texsyn_job *job;
    const txm_image *out;
    int level;
} txs_painter;

enum { TXS_PAINT_ROWS = 16 };

static void txs_paint(void *context, int share) {
    const txs_painter *painter = (const txs_painter *)context;
    const texsyn_model *m = painter->job->desc.model;
    const txs_level *l = &m->level[painter->level];
    const txs_canvas *c = &painter->job->canvas;
    const txm_image *out = painter->out;
    const uint64_t seed = txm_hash(painter->job->desc.seed);
    int end =
        (share + 1) * TXS_PAINT_ROWS < out->height ? (share + 1) * TXS_PAINT_ROWS : out->height;
    for (int y = share * TXS_PAINT_ROWS; y < end; y++) {
        for (int x = 0; x < out->width; x++) {
            double v[4] = {(double)m->mean[0], (double)m->mean[1], (double)m->mean[2],
                           (double)m->mean[3]};
            const uint8_t *p = txs_at(c, 0, x >> painter->level, y >> painter->level);
            uint64_t noise = txm_hash(((uint64_t)(unsigned)y << 32 | (unsigned)x) ^ seed);
            for (int b = 0; b < m->bands; b++, p += c->plane, noise >>= 16) {
                const uint8_t *q = p - c->stride, *r = p + c->stride;
                const int n[8] = {q[-1], q[0], q[1], p[-1], p[1], r[-1], r[0], r[1]};
                int smooth = 1, sum = 4 * p[0];
                for (int i = 0; i < 8; i++) smooth &= abs(n[i] - p[0]) <= 1;
                sum += n[0] + n[2] + n[5] + n[7] + 2 * (n[1] + n[3] + n[4] + n[6]);
                double off =
                    smooth ? (sum - 16 * p[0]) / 16.0 : (double)(noise & 0xffff) / 65536 - 0.5;
                off = off < -0.5 ? -0.5 : off > 0.5 ? 0.5 : off;
                /* a product of two floats is exact in double, contracted or not */
                const float at = txm_float(p[0] + off * (double)m->dither[b]);
                const float value = txm_float(txs_value(l, b, (double)at));
                for (int i = 0; i < m->channels; i++)
                    v[i] += (double)value * (double)m->basis[b][i];
            }
            for (int i = 0; i < out->channels; i++) {
                double sample = i == 3 && m->channels < 4 ? 255 : v[m->channels == 1 ? 0 : i];
                txm_image_set(out, x, y, i, txm_float(sample / 255));
            }
        }
    }
}

/* All of the picture; out is untouched after an error. */
static txm_status txs_paint_picture(const texsyn_job *job, txm_env *env, const txm_image *out) {
    const int can_hide = job->desc.model->channels == TXS_MAX_BANDS;
    const int wrap = job->desc.tileable ? TXM_WRAP_X | TXM_WRAP_Y : 0;
    txm_arena arena;
    txm_image to;
    txm_arena_init(&arena, env);
    txm_status status = txs_easel(out, can_hide, &arena, env, &to);
    if (status == TXM_OK) {
        txs_painter painter = {job, &to, job->level < 0 ? 0 : job->level};
        txm_parallel_for(env, (to.height + TXS_PAINT_ROWS - 1) / TXS_PAINT_ROWS, txs_paint,
                         &painter);
        status = txs_hang(&to, out, wrap, env);
    }
    txm_arena_free(&arena);
    return status;
}

/* Can the picture go there? */
static txm_status txs_check_out(const texsyn_synth_desc *desc, const txm_image *out, txm_env *env) {
    const txm_status status = txm_image_check(out, "out", 0, env);
    const int channels = out->channels ? out->channels : 1;
    if (status != TXM_OK) return status;
    if (out->width != desc->width || out->height != desc->height)
        return txm_fail(env, TXM_BAD_ARGUMENT, "out: must have the size of the synthesis");
    if (channels == 2 || channels < desc->model->channels)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "out: must have the channels of the model, or 3 or 4");
    return TXM_OK;
}

TEXSYN_API txm_status texsyn_draw(const texsyn_job *job, txm_env *env, txm_image out) {
    if (!job) return txm_fail(env, TXM_BAD_ARGUMENT, "draw: job is NULL");
    const txm_status status = txs_check_out(&job->desc, &out, env);
    if (status != TXM_OK) return status;
    return txs_paint_picture(job, env, &out);
}

TEXSYN_API void texsyn_free(texsyn_job *job) {
    if (!job) return;
    txs_canvas_free(&job->canvas, &job->memory);
    txm_arena_free(&job->level_arena);
    txm_arena_free(&job->arena);
}

TEXSYN_API txm_status texsyn_synthesize(const texsyn_synth_desc *desc, txm_env *env,
                                        txm_image out) {
    texsyn_job *job;
    txm_status status = texsyn_begin(desc, env, &job);
    if (status == TXM_OK) status = txs_check_out(desc, &out, env); /* before the work, not after */
    for (int more = 1; more && status == TXM_OK;) status = texsyn_step(job, env, &more);
    if (status == TXM_OK) status = texsyn_draw(job, env, out);
    texsyn_free(job);
    return status;
}

#endif /* TEXSYN_SYNTHESIS_H */
