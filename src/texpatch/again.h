#ifndef TEXPATCH_AGAIN_H
#define TEXPATCH_AGAIN_H

#include "draw.h"

/* ---- a part made again ------------------------------------------------------------------ */

/* Is pixel (x, y) of the canvas in the part? The margin is where the border is. */
static inline int txp_is_in_part(const texpatch_job *job, const uint8_t *again, int x, int y) {
    x = txm_clampi(x - job->margin_x, 0, job->setup.width - 1);
    y = txm_clampi(y - job->margin_y, 0, job->setup.height - 1);
    return again[(size_t)y * (size_t)job->setup.width + (size_t)x] != 0;
}

/* One axis of the box around a part: with context, large enough for the coarsest level and in steps
   of its pixels; all of an axis that wraps if the context reaches over its end. */
static void txp_part_extent(int low, int high, int extent, int wraps, int level, int *from,
                            int *size) {
    const int context = 2 * TXP_WINDOW, room = 2 * TXP_WINDOW << level, unit = 1 << level;
    int a = low - context, b = high + context;
    if (wraps && (a < 0 || b > extent)) {
        *from = 0;
        *size = extent;
        return;
    }
    if (b - a < room) {
        a -= (room - (b - a)) / 2;
        b = a + room;
    }
    if (a < 0) {
        b = b - a < extent ? b - a : extent;
        a = 0;
    }
    if (b > extent) {
        a = a - (b - extent) > 0 ? a - (b - extent) : 0;
        b = extent;
    }
    a = a / unit * unit;
    *from = a;
    *size = b - a;
}

TEXPATCH_API txm_status texpatch_again(texpatch_job *job, const txm_image *again,
                                       const txm_image *guide, const txm_image *guide_mask,
                                       uint64_t seed, txm_env *env) {
    txm_status status;
    txm_arena memory, masks;
    uint8_t *mask, *counts;
    txp_given new_guide;
    txp_origins from;
    int low_x, low_y, high_x = -1, high_y = -1;
    int x0 = 0, y0 = 0, wide = 0, high = 0;
    if (!job || !again) return txm_fail(env, TXM_BAD_ARGUMENT, "job or again is NULL");
    const txp_source *s = job->source;
    const txp_setup *u = &job->setup;
    const size_t n = (size_t)s->bytes, all = (size_t)job->width * (size_t)job->height;
    const size_t tail = n - (size_t)s->guide_at;
    status = txm_mask_check(again, "again", u->width, u->height, TEXPATCH_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    if (guide) {
        if (!s->guide_bytes)
            return txm_fail(env, TXM_BAD_ARGUMENT, "the job was begun without a guide");
        status = txp_check_guide(guide, guide_mask, u, u->width, u->height, env);
        if (status != TXM_OK) return status;
    }
    status = txp_run(job, env);
    if (status != TXM_OK) return status;
    memset(&new_guide, 0, sizeof new_guide);
    txm_arena_init(&memory, env);
    txm_arena_init(&masks, env);
    texpatch_job *part = NULL;
    if (txp_read_mask(again, TXM_MASK_REPLACES, &masks, &mask, env) != TXM_OK ||
        txp_read_mask(guide ? guide_mask : NULL, TXM_MASK_ALLOWS, &masks, &counts, env) != TXM_OK)
        goto no_memory;

    low_x = job->width;
    low_y = job->height;
    for (int y = 0; y < job->height; y++) {
        for (int x = 0; x < job->width; x++) {
            if (!txp_is_in_part(job, mask, x, y)) continue;
            low_x = x < low_x ? x : low_x;
            high_x = x > high_x ? x : high_x;
            low_y = y < low_y ? y : low_y;
            high_y = y;
        }
    }
    if (guide) {
        txp_given_make(&new_guide, s, all, 0, 1, 0, &memory);
        if (memory.failed) goto no_memory;
        txm_image to = txm_image_resolve(*guide);
        status = txp_show(&to, 0, u->tileable, &memory, env);
        if (status != TXM_OK) {
            txm_arena_free(&memory);
            txm_arena_free(&masks);
            return status;
        }
        txp_guide_load(job, &to, counts, &new_guide);
    }
    if (high_x >= 0) {
        const int top = s->levels - 1;
        txm_arena own;
        txm_arena_init(&own, env);
        txp_part_extent(low_x, high_x + 1, job->width, u->tileable & TEXPATCH_TILE_X, top, &x0,
                        &wide);
        txp_part_extent(low_y, high_y + 1, job->height, u->tileable & TEXPATCH_TILE_Y, top, &y0,
                        &high);
        part =
            txp_job_make(u, job->source, wide, high, txm_hash(seed ^ (job->seed + 1)), &own, env);
        if (part)
            txp_given_make(&part->given, s, (size_t)wide * (size_t)high, 1, s->guide_bytes > 0, 1,
                           &own);
        if (own.failed) {
            txm_arena_free(&own);
            goto no_memory;
        }
        part->memory = own;
    }

    /* from here on nothing can fail */
    for (size_t i = 0; i < all && guide; i++) {
        uint8_t *shown = job->canvas.pixels + i / (size_t)job->width * job->canvas.pitch +
                         i % (size_t)job->width * n;
        const txp_place at = job->canvas.at[i];
        memcpy(job->given.pixels + i * n + s->guide_at, new_guide.pixels + i * n + s->guide_at,
               tail);
        job->given.free_guide[i] = new_guide.free_guide[i];
        job->canvas.free_guide[i] = new_guide.free_guide[i];
        if (!new_guide.free_guide[i])
            memcpy(shown + s->guide_at, new_guide.pixels + i * n + s->guide_at, tail);
        else if (at.x >= 0)
            memcpy(shown + s->guide_at, txp_stack_at(s, &s->stack[0], at.x, at.y) + s->guide_at,
                   tail);
    }
    txm_arena_free(&memory);
    if (!part) {
        txm_arena_free(&masks);
        return TXM_OK;
    }
    part->setup.tileable = 0;
    if (wide == job->width) part->setup.tileable |= u->tileable & TEXPATCH_TILE_X;
    if (high == job->height) part->setup.tileable |= u->tileable & TEXPATCH_TILE_Y;
    part->shift_x = job->shift_x + x0;
    part->shift_y = job->shift_y + y0;
    from = txp_origins_of(job);
    for (int y = 0; y < high; y++) {
        for (int x = 0; x < wide; x++) {
            const size_t i = (size_t)y * (size_t)wide + (size_t)x;
            const size_t k = txp_index(&job->canvas, x0 + x, y0 + y);
            part->given.fixed[i] = !txp_is_in_part(job, mask, x0 + x, y0 + y) ||
                                   (job->given.fixed && job->given.fixed[k]);
            memcpy(part->given.pixels + i * n, txp_canvas_at(s, &job->canvas, x0 + x, y0 + y), n);
            if (part->given.free_guide) part->given.free_guide[i] = job->given.free_guide[k];
            txp_copy_origins(&part->given.from, i, &from, k, 1, s->tones);
        }
    }
    job->part = part;
    job->part_x = x0;
    job->part_y = y0;
    txm_arena_free(&masks);
    return TXM_OK;
no_memory:
    txm_arena_free(&masks);
    txm_arena_free(&memory);
    return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a part");
}

#endif /* TEXPATCH_AGAIN_H */
