#ifndef TEXEDGES_CHECK_H
#define TEXEDGES_CHECK_H

#include "config.h"

/* ---- checks of what the caller gives --------------------------------------------------- */

/* Any picture of a valid size, or (bytes) one of TXM_U8 with 1 channel. */
static txm_status txe_check_image(const txm_image *image, const char *name, int bytes,
                                  txm_env *env) {
    const size_t most = TEXEDGES_MAX_PIXELS < TXE_MAX_PIXELS ? TEXEDGES_MAX_PIXELS : TXE_MAX_PIXELS;
    const txm_status status = txm_image_check(image, name, most, env);
    if (status != TXM_OK) return status;
    if (image->width > TXE_MAX_SIDE || image->height > TXE_MAX_SIDE)
        return txm_fail_at(env, TXM_TOO_LARGE, name, "a side is longer than 2^20 pixels");
    if (bytes && (image->sample != TXM_U8 || image->channels > 1))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name, "must be TXM_U8 with 1 channel");
    return TXM_OK;
}

static int txe_thresholds_are_good(const float *thresholds, int levels) {
    for (int k = 0; k < levels - 1; k++) {
        if (!(thresholds[k] >= 0 && thresholds[k] <= 1)) return 0;
        if (k > 0 && !(thresholds[k] > thresholds[k - 1])) return 0;
    }
    return 1;
}

static txm_status txe_check_desc(const texedges_desc *desc, txm_env *env) {
    if (!desc) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL");
    if (!(desc->smooth >= 0 && desc->smooth <= 16))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "smooth", "must be 0 to 16 pixels");
    if (desc->least < 0)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "least", "must be 0 or more pixels");
    return txe_check_image(&desc->image, "image", 0, env);
}

/* A set as one of the functions here makes it. is_found: as texedges_find does, with steps of one
   pixel from corner to corner. */
static txm_status txe_check_edges(const texedges_set *edges, const char *name, int is_found,
                                  txe_progress *bar, txm_env *env) {
    const char *foreign = "is not as texedges_find or texedges_disturb made it";
    if (!edges || edges->levels < 2 || edges->levels > TEXEDGES_MAX_LEVELS || edges->width < 1 ||
        edges->height < 1 || edges->width > TXE_MAX_SIDE || edges->height > TXE_MAX_SIDE ||
        !txe_thresholds_are_good(edges->thresholds, edges->levels) ||
        (edges->line_count && !edges->lines) || (edges->point_count && !edges->points))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name, foreign);
    for (int k = 0; k < edges->levels; k++) {
        if (edges->beside[k] < -1 || edges->beside[k] >= edges->levels || edges->beside[k] == k)
            return txm_fail_at(env, TXM_BAD_ARGUMENT, name, foreign);
    }
    for (size_t i = 0; i < edges->line_count; i++) {
        const texedges_polyline *line = &edges->lines[i];
        if (line->layer < 0 || line->layer >= edges->levels || line->count < 2 ||
            line->first > edges->point_count || line->count > edges->point_count - line->first)
            return txm_fail_at(env, TXM_BAD_ARGUMENT, name, foreign);
        txm_vec2 p = edges->points[line->first + line->count - 1];
        for (size_t j = 0; j < line->count; j++) {
            const txm_vec2 q = edges->points[line->first + j];
            const float most = (float)(2 * TXE_MAX_SIDE);
            int good = q.x >= -most && q.x <= most && q.y >= -most && q.y <= most;
            if (good && is_found) {
                const float dx = q.x - p.x, dy = q.y - p.y;
                good = q.x >= 0 && q.x <= (float)edges->width && q.y >= 0 &&
                       q.y <= (float)edges->height && dx * dx + dy * dy == 1 && dx * dy == 0 &&
                       q.x == (float)(int)q.x && q.y == (float)(int)q.y;
            }
            if (!good) return txm_fail_at(env, TXM_BAD_ARGUMENT, name, foreign);
            if (txe_advance(bar, 1)) return txe_stopped(env);
            p = q;
        }
    }
    return TXM_OK;
}

static txm_status txe_check_stroke(const texedges_stroke *s, int levels, double *length,
                                   txe_progress *bar, txm_env *env) {
    if (!s->points || s->count < (s->is_closed ? 3 : 2))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "stroke", "needs 2 points or more, closed 3");
    if (s->layer < 0 || s->layer >= levels)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "stroke", "layer must be 0 to levels - 1");
    if (s->width != 0 && !(s->width >= 2 && s->width <= 256))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "stroke", "width must be 0 or 2 to 256 pixels");
    const float most = (float)TXE_MAX_SIDE;
    double own = 0;
    for (int i = 0; i < s->count; i++) {
        const txm_vec2 p = s->points[i], q = s->points[i ? i - 1 : 0];
        const double dx = (double)p.x - q.x, dy = (double)p.y - q.y;
        if (!(p.x >= -most && p.x <= most && p.y >= -most && p.y <= most))
            return txm_fail_at(env, TXM_BAD_ARGUMENT, "stroke",
                               "a coordinate is not finite or beyond 2^20 pixels");
        own += sqrt(dx * dx + dy * dy);
        if (txe_advance(bar, 1)) return txe_stopped(env);
    }
    if (!(own > 1e-3))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "stroke",
                           "has no length: all its points are the same");
    *length += own;
    if (*length > (double)TXE_MAX_LENGTH)
        return txm_fail_at(env, TXM_TOO_LARGE, "strokes", "are longer than 2^26 pixels");
    return TXM_OK;
}

static double txe_points_of(const texedges_control *c) {
    return c && c->edges ? (double)c->edges->point_count : 0;
}

/* Everything that texedges_disturb and texedges_guide read. */
static txm_status txe_check_control(const texedges_control *c, txe_progress *bar, txm_env *env) {
    double length = 0;
    if (!c) return txm_fail(env, TXM_BAD_ARGUMENT, "control is NULL");
    if (c->stroke_count < 0 || (c->stroke_count && !c->strokes))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "strokes", "are NULL, or their count negative");
    if (!(c->disturb == -1 || (c->disturb >= 0 && c->disturb <= 4)))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "disturb", "must be -1 or 0 to 4");
    txm_status status = txe_check_edges(c->edges, "edges", 1, bar, env);
    if (status == TXM_OK && (c->background < -1 || c->background >= c->edges->levels))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "background", "must be -1 to levels - 1");
    for (int i = 0; i < c->stroke_count && status == TXM_OK; i++)
        status = txe_check_stroke(&c->strokes[i], c->edges->levels, &length, bar, env);
    return status;
}

#endif /* TEXEDGES_CHECK_H */
