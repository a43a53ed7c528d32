#ifndef TEXEDGES_GUIDE_H
#define TEXEDGES_GUIDE_H

#include "layers.h"

/* ---- the guide ------------------------------------------------------------------------- */

/* The map that a guide is drawn from: layer + 1 of each pixel, 0 = nothing. */
typedef struct txe_guide {
    int width, height;
    uint8_t *at;
} txe_guide;

/* Fixed-point coordinates of 1/256 pixel: all that follows is exact. */
static int64_t txe_fixed(float x) {
    return (int64_t)floor((double)x * 256 + 0.5);
}

/* a / b rounded up, b > 0 */
static int64_t txe_ceil(int64_t a, int64_t b) {
    return a / b + (a % b > 0);
}

/* The rows first..end-1 whose centre lines a segment crosses, and where. Its upper end counts, its
   lower one does not: a corner counts once, a horizontal segment not at all. */
typedef struct txe_slope {
    int64_t x, y, dx, dy; /* of the upper end, and from there to the lower one */
    int first, end, down; /* down: 1 if the segment runs downwards, else 0      */
} txe_slope;

static txe_slope txe_slope_of(txm_vec2 p, txm_vec2 q, int height) {
    const int64_t px = txe_fixed(p.x), py = txe_fixed(p.y);
    const int64_t qx = txe_fixed(q.x), qy = txe_fixed(q.y);
    txe_slope s;
    s.down = py < qy;
    s.x = s.down ? px : qx;
    s.y = s.down ? py : qy;
    s.dx = s.down ? qx - px : px - qx;
    s.dy = s.down ? qy - py : py - qy;
    const int64_t first = txe_ceil(s.y - 128, 256), end = txe_ceil(s.y + s.dy - 128, 256);
    s.first = first < 0 ? 0 : first > height ? height : (int)first;
    s.end = end < s.first ? s.first : end > height ? height : (int)end;
    return s;
}

/* The first pixel of a row whose centre lies on the segment or to its right, 0..width. */
static uint32_t txe_column(const txe_slope *s, int row, int width) {
    const int64_t down = 256 * (int64_t)row + 128 - s->y;
    const int64_t column = txe_ceil((s->x - 128) * s->dy + down * s->dx, 256 * s->dy);
    return (uint32_t)(column < 0 ? 0 : column > width ? width : column);
}

/* Fill the inside of a line (winding number not 0) with value: its crossings with the centre lines
   of rows are listed row by row, sorted by column, and the spans between them are filled. */
static txm_status txe_fill(const txe_guide *g, const txm_vec2 *p, size_t n, int value,
                           txm_arena *arena, txe_progress *bar, txm_env *env) {
    int top = g->height, bottom = 0;
    size_t total = 0, longest = 0;
    for (size_t i = 0; i < n; i++) {
        const txe_slope s = txe_slope_of(p[i], p[i + 1 < n ? i + 1 : 0], g->height);
        if (s.first < s.end && s.first < top) top = s.first;
        if (s.first < s.end && s.end > bottom) bottom = s.end;
        total += (size_t)(s.end - s.first);
        if (txe_advance(bar, 4)) return txe_stopped(env);
    }
    if (total == 0) return TXM_OK;
    /* next[r]: index of the next crossing of row top + r; in the end, where the row ends */
    const size_t rows = (size_t)(bottom - top);
    size_t *next = (size_t *)txm_arena_zero(arena, rows + 1, sizeof *next);
    txm_pair *list = (txm_pair *)txm_arena_alloc(arena, total, sizeof *list);
    if (arena->failed) return txe_no_memory(env);
    for (int pass = 0; pass < 2; pass++) {
        for (size_t i = 0; i < n; i++) {
            const txe_slope s = txe_slope_of(p[i], p[i + 1 < n ? i + 1 : 0], g->height);
            for (int y = s.first; y < s.end; y++) {
                size_t *at = &next[y - top];
                if (pass) {
                    list[*at].key = txe_column(&s, y, g->width);
                    list[*at].value = (uint32_t)s.down;
                }
                ++*at;
                if (txe_advance(bar, 4)) return txe_stopped(env);
            }
            if (txe_advance(bar, 1)) return txe_stopped(env);
        }
        for (size_t r = 0, sum = 0; r < rows && pass == 0; r++) { /* counts become indices */
            const size_t count = next[r];
            if (count > longest) longest = count;
            next[r] = sum;
            sum += count;
        }
    }
    txm_pair *scratch = (txm_pair *)txm_arena_alloc(arena, longest, sizeof *scratch);
    if (!scratch) return txe_no_memory(env);
    for (size_t r = 0; r < rows; r++) {
        const size_t from = r ? next[r - 1] : 0, count = next[r] - from;
        uint8_t *row = g->at + (size_t)(top + (int)r) * (size_t)g->width;
        int64_t winding = 0;
        txm_sort_pairs(list + from, scratch, count);
        for (size_t i = from; i + 1 < from + count; i++) {
            winding += list[i].value ? 1 : -1;
            if (winding) memset(row + list[i].key, value, list[i + 1].key - list[i].key);
        }
        if (txe_advance(bar, (size_t)g->width / 16 + 8 * count + 512)) return txe_stopped(env);
    }
    return TXM_OK;
}

/* With a free background: the surroundings of strokes get the layer that borders most on that of
   the nearest stroke. An exact distance transform: first the distance to the nearest stroke in the
   same row, then the least sum of squares over the rows above and below; of equals the left, then
   the upper one.
   off, what: two bytes for each pixel, the distance and the stroke's layer + 1. 0 = cancelled */
static int txe_fill_around(const txe_guide *g, const int *beside, uint8_t *off, uint8_t *what,
                           txe_progress *bar) {
    const size_t w = (size_t)g->width;
    for (int y = 0; y < g->height; y++) {
        const uint8_t *row = g->at + (size_t)y * w;
        uint8_t *distance = off + (size_t)y * w, *mark = what + (size_t)y * w;
        int since = TXE_AROUND + 1, last = 0; /* pixels since the last stroke, and its mark */
        for (size_t x = 0; x < w; x++) {
            since = row[x] ? 0 : since <= TXE_AROUND ? since + 1 : since;
            if (row[x]) last = row[x];
            distance[x] = (uint8_t)since;
            mark[x] = (uint8_t)last;
            if (txe_advance(bar, 1)) return 0;
        }
        since = TXE_AROUND + 1;
        for (size_t x = w; x-- > 0;) {
            since = row[x] ? 0 : since <= TXE_AROUND ? since + 1 : since;
            if (row[x]) last = row[x];
            if (since < distance[x]) {
                distance[x] = (uint8_t)since;
                mark[x] = (uint8_t)last;
            }
            if (txe_advance(bar, 1)) return 0;
        }
    }
    for (int y = 0; y < g->height; y++) {
        const int low = y > TXE_AROUND ? y - TXE_AROUND : 0;
        const int high = y + TXE_AROUND < g->height ? y + TXE_AROUND : g->height - 1;
        for (size_t x = 0; x < w; x++) {
            uint8_t *at = g->at + (size_t)y * w + x;
            int least = TXE_AROUND * TXE_AROUND + 1, mark = 0;
            if (txe_advance(bar, 2)) return 0;
            if (off[(size_t)y * w + x] == 0) continue; /* inside a stroke */
            for (int v = low; v <= high; v++) {
                const int dx = off[(size_t)v * w + x], dy = v - y;
                if (dx * dx + dy * dy >= least) continue;
                least = dx * dx + dy * dy;
                mark = what[(size_t)v * w + x];
            }
            *at = (uint8_t)(mark ? beside[mark - 1] + 1 : 0);
            if (txe_advance(bar, 8)) return 0;
        }
    }
    return 1;
}

/* Draw all lines and their surroundings. mask, what: with a free background two more bytes for each
   pixel, else NULL. In the end g holds grays, and mask where they count. */
static txm_status txe_guide_make(const texedges_control *c, const texedges_set *lines,
                                 const txe_guide *g, uint8_t *mask, uint8_t *what,
                                 txe_progress *bar, txm_env *env) {
    const size_t count = (size_t)g->width * (size_t)g->height;
    for (size_t i = 0; i < lines->line_count; i++) {
        const texedges_polyline *line = &lines->lines[i];
        txm_arena work;
        txm_arena_init(&work, env);
        const txm_status status = txe_fill(g, lines->points + line->first, line->count,
                                           line->layer + 1, &work, bar, env);
        txm_arena_free(&work);
        if (status != TXM_OK) return status;
    }
    txe_stage(bar, "surroundings", 1, (mask ? 12 : 2) * (double)count);
    if (mask) {
        int beside[TEXEDGES_MAX_LEVELS];
        for (int k = 0; k < lines->levels; k++) { /* without a neighbour: any other layer */
            beside[k] = c->edges->beside[k];
            if (beside[k] < 0) beside[k] = k ? k - 1 : 1;
        }
        if (!txe_fill_around(g, beside, mask, what, bar)) return txe_stopped(env);
    }
    for (size_t i = 0; i < count; i++) {
        const int layer = g->at[i] ? g->at[i] - 1 : mask ? 0 : c->background;
        if (mask) mask[i] = g->at[i] ? 255 : 0;
        g->at[i] = (uint8_t)layer;
        if (txe_advance(bar, 1)) return txe_stopped(env);
    }
    return txe_layers_to_gray(g->at, count, lines->levels, bar) ? TXM_OK : txe_stopped(env);
}

TEXEDGES_API txm_status texedges_guide(const texedges_control *control,
                                       const texedges_set *disturbed, txm_env *env,
                                       const txm_image *guide, const txm_image *mask) {
    txe_progress bar = txe_progress_of(env);
    txm_status status = txe_check_image(guide, "guide", 1, env);
    if (status == TXM_OK) status = txe_check_image(mask, "mask", 1, env);
    txe_stage(&bar, "edges", 0.2, txe_points_of(control));
    if (status == TXM_OK) status = txe_check_control(control, &bar, env);
    if (status == TXM_OK) status = txe_check_edges(disturbed, "disturbed", 0, &bar, env);
    if (status != TXM_OK) return status;
    if (guide->width != disturbed->width || guide->height != disturbed->height ||
        mask->width != disturbed->width || mask->height != disturbed->height)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "guide and mask must have the size that texedges_disturb was given");
    int same = disturbed->levels == control->edges->levels &&
               disturbed->line_count == (size_t)control->stroke_count;
    for (int i = 0; i < control->stroke_count && same; i++)
        same = disturbed->lines[i].layer == control->strokes[i].layer;
    if (!same)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "disturbed",
                           "was made of other strokes than control holds");

    const size_t w = (size_t)guide->width, count = w * (size_t)guide->height;
    const int is_free = control->background < 0;
    txm_arena arena;
    txe_guide g;
    txe_stage(&bar, "strokes", 0.5, 30 * (double)disturbed->point_count);
    txm_arena_init(&arena, env);
    g.width = guide->width;
    g.height = guide->height;
    g.at = (uint8_t *)txm_arena_zero(&arena, count, is_free ? 3 : 1);
    uint8_t *counts = g.at && is_free ? g.at + count : NULL; /* the mask */
    status =
        g.at ? txe_guide_make(control, disturbed, &g, counts, counts ? counts + count : NULL, &bar,
                              env)
             : txe_no_memory(env);
    for (int y = 0; y < g.height && g.at && status == TXM_OK; y++) {
        uint8_t *row = (uint8_t *)txm_image_row(mask, y);
        memcpy(txm_image_row(guide, y), g.at + (size_t)y * w, w);
        if (counts) memcpy(row, counts + (size_t)y * w, w);
        else memset(row, 255, w);
    }
    txm_arena_free(&arena);
    return status;
}

#endif /* TEXEDGES_GUIDE_H */
