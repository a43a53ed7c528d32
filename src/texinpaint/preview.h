#ifndef TEXINPAINT_PREVIEW_H
#define TEXINPAINT_PREVIEW_H

#include "harmonic.h"
#include "join.h"
#include "lay.h"

/* ---- preview ------------------------------------------------------------------------------------
   What a user sees first: smooth colours in the holes, and through the first hole its lines,
   drawn as the mean colours across them. The texels stay missing. */

/* Paint the targets of a window in the picture. Pictures with alpha keep what they have, as colours
   of a window lie over gray.
   color  4 per window pixel                                                                      */
static txm_status txi_paint(txi_domain *d, const txi_window *w, const uint8_t *color,
                            txm_env *env) {
    const size_t pixels = (size_t)w->width * (size_t)w->height;
    const size_t channels = (size_t)d->maps[0].channels;
    size_t bytes;
    if (channels == 2 || channels == 4) return TXM_OK;
    if (!txm_mul(pixels, channels, sizeof(float), &bytes)) return txi_no_memory(env);
    float *values = (float *)txm_alloc(env, bytes);
    if (!values) return txi_no_memory(env);
    for (size_t i = 0; i < pixels; i++) {
        for (size_t c = 0; c < channels; c++)
            values[i * channels + c] = (float)color[4 * i + c] / 255.0f;
    }
    txi_window_write(d, w, 0, values);
    txm_free(env, values);
    return TXM_OK;
}

/* Does a target lie on the lines of a plan? */
static int txi_is_on_line(const txi_window *w, const txi_plan *plan, const txi_target *t) {
    const int x = txm_clampi((int)floor((double)t->x + 0.5), 0, w->width - 1);
    const int y = txm_clampi((int)floor((double)t->y + 0.5), 0, w->height - 1);
    return plan->pull[(size_t)y * (size_t)w->width + (size_t)x] >= TXI_PULL_KEPT;
}

/* The lines through a window's hole, painted.
   on_lines  receives the window with those targets only that lie on the lines                 */
static txm_status txi_paint_lines(txi_domain *d, const txi_window *w, const txi_lines *lines,
                                  txm_arena *arena, txm_env *env, txi_window *on_lines) {
    txi_curve *curves = NULL;
    txi_plan plan;
    int count = 0;
    *on_lines = *w;
    on_lines->target_count = 0;
    txm_status status = txi_join(w, lines, NULL, TEXINPAINT_PICTURE, d->desc->alpha, d->desc->beta,
                                 d->desc->seed, arena, env, &curves, &count);
    if (status != TXM_OK || count == 0) return status;
    status = txi_cartoon(w, lines, curves, count, arena, env, &plan);
    if (status != TXM_OK) return status;
    on_lines->targets =
        (txi_target *)txm_arena_alloc(arena, w->target_count, sizeof *on_lines->targets);
    if (arena->failed) return txi_no_memory(env);
    for (size_t i = 0; i < w->target_count; i++) {
        if (txi_is_on_line(w, &plan, &w->targets[i]))
            on_lines->targets[on_lines->target_count++] = w->targets[i];
    }
    return txi_paint(d, on_lines, plan.color, env);
}

/* Fill all holes smoothly, around the lines of one window, which keep their colours.
   w      the window, whose texels are missing, and its lines; NULL: no lines                  */
static txm_status txi_preview(txi_domain *d, const txi_window *w, const txi_lines *lines,
                              txm_env *env) {
    txi_window painted;
    txm_arena arena;
    txi_stage stage;
    txm_status status = TXM_OK;
    txm_arena_init(&arena, env);
    memset(&painted, 0, sizeof painted);
    if (w) {
        txi_stage_begin(&stage, env, 0, 0.5f);
        status =
            txi_stage_end(&stage, txi_paint_lines(d, w, lines, &arena, &stage.env, &painted));
    }
    for (size_t i = 0; i < painted.target_count; i++) d->missing[painted.targets[i].texel] = 0;
    if (status == TXM_OK) {
        txi_stage_begin(&stage, env, 0.5f, 1);
        status = txi_stage_end(&stage, txi_harmonic_fill(d, &stage.env));
    }
    for (size_t i = 0; i < painted.target_count; i++) d->missing[painted.targets[i].texel] = 1;
    txm_arena_free(&arena);
    return status;
}

/* ---- counting holes -------------------------------------------------------------------------- */

/* How many parts of the missing texels are connected: on the surface face by face, in a picture by
   the sides and corners of pixels.
   cost  O(faces), for a picture O(pixels); 5 bytes each while it runs */
static txm_status txi_count_holes(const txi_domain *d, txm_env *env, int *holes) {
    const txi_surface *s = d->surface;
    const size_t count = s ? s->face_count : (size_t)d->width * (size_t)d->height;
    txm_arena arena;
    txm_arena_init(&arena, env);
    uint32_t *parent = (uint32_t *)txm_arena_alloc(&arena, count, sizeof *parent);
    uint8_t *is_hole = (uint8_t *)txm_arena_zero(&arena, count, 1);
    *holes = 0;
    if (!parent || !is_hole) {
        txm_arena_free(&arena);
        return txi_no_memory(env);
    }
    for (size_t i = 0; i < count; i++) {
        parent[i] = (uint32_t)i;
        is_hole[i] =
            s ? s->hole_first[i + 1] > s->hole_first[i] || d->missing[txi_face_texel(d, s, i)]
              : d->missing[i];
    }
    for (size_t i = 0; i < count; i++) {
        for (size_t k = 0; k < 3 && s && is_hole[i]; k++) {
            const uint32_t other = s->opposite[3 * i + k];
            if (other != TXM_NO_SIDE && is_hole[other / 3])
                txi_join_sets(parent, (uint32_t)i, other / 3);
        }
        if (s || !is_hole[i]) continue;
        const int x = (int)(i % (size_t)d->width), y = (int)(i / (size_t)d->width);
        static const int dx[4] = {-1, -1, 0, 1}, dy[4] = {0, -1, -1, -1};
        for (int k = 0; k < 4; k++) {
            if (x + dx[k] < 0 || x + dx[k] >= d->width || y + dy[k] < 0) continue;
            const size_t other = (size_t)(y + dy[k]) * (size_t)d->width + (size_t)(x + dx[k]);
            if (is_hole[other]) txi_join_sets(parent, (uint32_t)i, (uint32_t)other);
        }
    }
    for (size_t i = 0; i < count; i++) *holes += is_hole[i] && parent[i] == i;
    txm_arena_free(&arena);
    return TXM_OK;
}

#endif /* TEXINPAINT_PREVIEW_H */
