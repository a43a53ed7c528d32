#ifndef TEXINPAINT_PRIOR_H
#define TEXINPAINT_PRIOR_H

#include "crest.h"
#include "window.h"

/* ---- prior lines [1, II.C] --------------------------------------------------------------------
   Lines on the surface, crests or the caller's, as polylines in a window. To each belong up to two
   assistant lines on either side, at a constant distance: where the known texture has edges that
   run along the line, as a stripe that follows a crest has. [1] does not say how far away they
   are; here that is measured in the window. */

enum {
    TXI_PRIOR_REACH = 4,   /* window pixels: a line may be so far from the surface; ours        */
    TXI_PRIOR_JUMP = 4,    /* window pixels: farther apart in the window, the line was cut; ours */
    TXI_PRIOR_SHORT = 6,   /* points, about pixels: shorter pieces are left out; ours           */
    TXI_PRIOR_WIDTH = 40,  /* window pixels: the farthest assistant line; ours                  */
    TXI_PRIOR_LEAST = 32,  /* known pixels along a line that a distance is measured at; ours    */
    TXI_PRIOR_NEAR = 12,   /* window pixels: lines that stay farther from the hole are left out;
                              ours                                                               */
    TXI_PRIOR_BLUR = 5,    /* points: radius of the mean that smooths crest lines, thrice; ours:
                              they zigzag from triangle to triangle                             */
    TXI_PRIOR_CHORD = 6,   /* points to either side that give the direction of a line; ours     */
    TXI_PRIOR_STEP = 12,   /* levels of 8 bits: the mean step across an assistant line; ours    */
    TXI_PRIOR_AIDS = 2     /* assistant lines on each side; [1]                                 */
};
#define TXI_PRIOR_SURE 0.7 /* mean step over mean size of the steps: of one sign along the line;
                              ours                                                               */

/* The lines of a window while they are collected. */
typedef struct txi_prior_list {
    txm_vec2 *points;
    int *starts;
    size_t point_room, line_room;
    int count; /* lines                                                                         */
    int open;  /* points so far, those of the line that is being made included                  */
} txi_prior_list;

/* Room for more points in the open line; 0: no memory. */
static int txi_prior_reserve(txi_prior_list *list, size_t more, txm_arena *arena) {
    const size_t wanted = (size_t)list->open + more;
    if (wanted > INT32_MAX) return 0;
    if (wanted > list->point_room) {
        const size_t room = 2 * wanted + 1024;
        txm_vec2 *points = (txm_vec2 *)txm_arena_alloc(arena, room, sizeof(txm_vec2));
        if (!points) return 0;
        if (list->open) memcpy(points, list->points, (size_t)list->open * sizeof *points);
        list->points = points;
        list->point_room = room;
    }
    if ((size_t)list->count + 2 > list->line_room) {
        const size_t room = 2 * list->line_room + 64;
        int *starts = (int *)txm_arena_alloc(arena, room, sizeof(int));
        if (!starts) return 0;
        if (list->count) memcpy(starts, list->starts, (size_t)list->count * sizeof *starts);
        starts[list->count] = list->count ? list->starts[list->count] : 0;
        list->starts = starts;
        list->line_room = room;
    }
    return 1;
}

/* End the open line; it is dropped if it is short. There is room for the next. */
static void txi_prior_close(txi_prior_list *list) {
    const int first = list->starts[list->count];
    if (list->open - first < TXI_PRIOR_SHORT) list->open = first;
    else list->starts[++list->count] = list->open;
}

/* Add a point, at least .75 pixels from the last one; a jump ends the line. */
static int txi_prior_add(txi_prior_list *list, txm_vec2 p, txm_arena *arena) {
    if (!txi_prior_reserve(list, 1, arena)) return 0;
    if (list->open > list->starts[list->count]) {
        const txm_vec2 last = list->points[list->open - 1];
        const double dx = (double)p.x - last.x, dy = (double)p.y - last.y,
                     apart = dx * dx + dy * dy;
        if (apart < 0.5625) return 1;
        if (apart > TXI_PRIOR_JUMP * TXI_PRIOR_JUMP) {
            txi_prior_close(list);
            if (!txi_prior_reserve(list, 1, arena)) return 0;
        }
    }
    TXM_ASSERT((size_t)list->open < list->point_room);
    list->points[list->open++] = p;
    return 1;
}

/* ---- prior lines: from the surface into the window ------------------------------------------- */

/* The pixels of a window by their place on the surface: chains for cells of a grid. */
typedef struct txi_places {
    const txi_window *w;
    uint32_t *head, *next; /* pixels, UINT32_MAX ends a chain; head: 1 per slot, next: per pixel */
    size_t slots;          /* a power of two                                                    */
    double low[3], high[3]; /* a box around all places, with the reach, in window pixels        */
} txi_places;

static size_t txi_places_slot(const txi_places *s, int64_t x, int64_t y, int64_t z) {
    const uint64_t xy = ((uint64_t)x & 0xffffffffu) << 32 | ((uint64_t)y & 0xffffffffu);
    return (size_t)txm_hash(txm_hash(xy) + (uint64_t)z) & (s->slots - 1);
}

static int64_t txi_places_cell(double x) {
    return (int64_t)floor(x / (double)TXI_PRIOR_REACH);
}

/* 0: no memory. */
static int txi_places_make(const txi_window *w, txm_arena *arena, txi_places *s) {
    const size_t pixels = (size_t)w->width * (size_t)w->height;
    memset(s, 0, sizeof *s);
    s->w = w;
    for (s->slots = 64; s->slots < pixels / 4;) s->slots *= 2;
    s->head = (uint32_t *)txm_arena_alloc(arena, s->slots, sizeof(uint32_t));
    s->next = (uint32_t *)txm_arena_alloc(arena, pixels, sizeof(uint32_t));
    if (!s->head || !s->next) return 0;
    memset(s->head, 0xff, s->slots * sizeof *s->head);
    for (int k = 0; k < 3; k++) {
        s->low[k] = 1e30;
        s->high[k] = -1e30;
    }
    for (size_t i = pixels; i-- > 0;) { /* backwards, so that chains run forwards */
        if (w->state[i] == TXI_VOID) continue;
        const double p[3] = {(double)w->place[i].x, (double)w->place[i].y, (double)w->place[i].z};
        if (!(fabs(p[0]) < 1e9 && fabs(p[1]) < 1e9 && fabs(p[2]) < 1e9)) continue;
        const size_t slot = txi_places_slot(s, txi_places_cell(p[0]), txi_places_cell(p[1]),
                                            txi_places_cell(p[2]));
        s->next[i] = s->head[slot];
        s->head[slot] = (uint32_t)i;
        for (int k = 0; k < 3; k++) {
            s->low[k] = fmin(s->low[k], p[k] - (double)TXI_PRIOR_REACH);
            s->high[k] = fmax(s->high[k], p[k] + (double)TXI_PRIOR_REACH);
        }
    }
    return 1;
}

/* Is the place in the box? Clipped lines of huge numbers may end anywhere. */
static int txi_places_hold(const txi_places *s, txm_dvec3 p) {
    return p.x >= s->low[0] && p.x <= s->high[0] && p.y >= s->low[1] && p.y <= s->high[1] &&
           p.z >= s->low[2] && p.z <= s->high[2];
}

/* The pixel nearest to a place in the box, within reach; -1: none. */
static int64_t txi_places_nearest(const txi_places *s, txm_dvec3 p) {
    const int64_t x = txi_places_cell(p.x), y = txi_places_cell(p.y), z = txi_places_cell(p.z);
    double least = TXI_PRIOR_REACH * TXI_PRIOR_REACH;
    int64_t best = -1;
    for (int k = 0; k < 27; k++) {
        const size_t slot = txi_places_slot(s, x + k % 3 - 1, y + k / 3 % 3 - 1, z + k / 9 - 1);
        for (uint32_t i = s->head[slot]; i != UINT32_MAX; i = s->next[i]) {
            const txm_vec3 q = s->w->place[i];
            const double apart = txm_d3_dist2(p, txm_d3(q.x, q.y, q.z));
            if (apart > least || (best >= 0 && (apart >= least && (int64_t)i >= best))) continue;
            least = apart;
            best = i;
        }
    }
    return best;
}

/* The derivative of the place along x (axis 0) or y, from the neighbours that there are. */
static txm_dvec3 txi_places_slope(const txi_window *w, size_t i, int axis) {
    const size_t step = axis ? (size_t)w->width : 1;
    const size_t at = axis ? i / (size_t)w->width : i % (size_t)w->width;
    const size_t end = axis ? (size_t)w->height : (size_t)w->width;
    const int before = at > 0 && w->state[i - step] != TXI_VOID;
    const int after = at + 1 < end && w->state[i + step] != TXI_VOID;
    const txm_vec3 a = w->place[before ? i - step : i], b = w->place[after ? i + step : i];
    const txm_dvec3 d = txm_d3((double)b.x - a.x, (double)b.y - a.y, (double)b.z - a.z);
    return before && after ? txm_d3_scale(d, 0.5) : d;
}

/* Where a place of the surface lies in the window. 0: outside. */
static int txi_places_find(const txi_places *s, txm_dvec3 p, txm_vec2 *out) {
    const int64_t i = txi_places_hold(s, p) ? txi_places_nearest(s, p) : -1;
    if (i < 0) return 0;
    const txm_vec3 q = s->w->place[i];
    const txm_dvec3 u = txi_places_slope(s->w, (size_t)i, 0),
                    v = txi_places_slope(s->w, (size_t)i, 1);
    const txm_dvec3 d = txm_d3_sub(p, txm_d3(q.x, q.y, q.z));
    const double e = txm_d3_len2(u), f = txm_d3_dot(u, v), g = txm_d3_len2(v);
    const double det = e * g - f * f, a = txm_d3_dot(d, u), b = txm_d3_dot(d, v);
    double x = 0, y = 0;
    if (det > 0.01) {
        x = (g * a - f * b) / det;
        y = (e * b - f * a) / det;
    }
    if (fabs(x) > 1.5 || fabs(y) > 1.5) return 0; /* beyond the edge of what the window shows */
    const int column = (int)(i % s->w->width), row = (int)(i / s->w->width);
    *out = txm_v2(txm_float(column + x), txm_float(row + y));
    return 1;
}

/* The part of a segment, from..to of 0..1, in the box. 0: none. */
static int txi_places_clip(const txi_places *s, txm_dvec3 a, txm_dvec3 d, double *from,
                           double *to) {
    const double p[3] = {a.x, a.y, a.z}, q[3] = {d.x, d.y, d.z};
    *from = 0;
    *to = 1;
    for (int k = 0; k < 3; k++) {
        if (!(fabs(q[k]) > 1e-12)) {
            if (p[k] < s->low[k] || p[k] > s->high[k]) return 0;
            continue;
        }
        const double u = (s->low[k] - p[k]) / q[k], v = (s->high[k] - p[k]) / q[k];
        *from = fmax(*from, fmin(u, v));
        *to = fmin(*to, fmax(u, v));
    }
    return *from < *to;
}

/* Lay a line of the surface into the window, in steps of half a pixel. 0: no memory. */
static int txi_prior_lay(const txi_places *s, const texinpaint_line *line, txi_prior_list *list,
                         txm_arena *arena) {
    const double unit = 1 / s->w->spacing;
    if (!txi_prior_reserve(list, 1, arena)) return 0;
    for (int k = 0; k + 1 < line->count; k++) {
        const float *p = line->points + 3 * (size_t)k;
        const txm_dvec3 a = txm_d3_scale(txm_d3_sub(txm_d3_load(p), s->w->origin), unit);
        const txm_dvec3 b = txm_d3_scale(txm_d3_sub(txm_d3_load(p + 3), s->w->origin), unit);
        const txm_dvec3 d = txm_d3_sub(b, a);
        double from, to;
        if (!txi_places_clip(s, a, d, &from, &to)) {
            txi_prior_close(list);
            continue;
        }
        const int steps = 1 + (int)fmin(2 * (to - from) * txm_d3_len(d), 1e6);
        for (int i = 0; i <= steps; i++) {
            txm_vec2 at;
            if (!txi_places_find(s, txm_d3_mad(a, d, from + (to - from) * i / steps), &at)) {
                txi_prior_close(list);
            } else if (!txi_prior_add(list, at, arena)) {
                return 0;
            }
            if (!txi_prior_reserve(list, 1, arena)) return 0;
        }
    }
    txi_prior_close(list);
    return 1;
}

/* The same for a line of a plain picture, whose window is a part of it: points are x, y in
   pixels, pixel centres at one half. */
static int txi_prior_copy(const txi_window *w, const texinpaint_line *line, txi_prior_list *list,
                          txm_arena *arena) {
    const double left = (double)w->place[0].x + 0.5, top = (double)w->place[0].y + 0.5;
    txi_places box;
    memset(&box, 0, sizeof box);
    box.low[2] = -1;
    box.high[0] = w->width - 1;
    box.high[1] = w->height - 1;
    box.high[2] = 1;
    if (!txi_prior_reserve(list, 1, arena)) return 0;
    for (int k = 0; k + 1 < line->count; k++) {
        const float *p = line->points + 3 * (size_t)k;
        const txm_dvec3 a = txm_d3(p[0] - left, p[1] - top, 0);
        const txm_dvec3 d = txm_d3((double)p[3] - p[0], (double)p[4] - p[1], 0);
        double from, to;
        if (!txi_places_clip(&box, a, d, &from, &to)) {
            txi_prior_close(list);
            continue;
        }
        const int steps = 1 + (int)fmin((to - from) * txm_d3_len(d), 1e6);
        for (int i = 0; i <= steps; i++) {
            const txm_dvec3 q = txm_d3_mad(a, d, from + (to - from) * i / steps);
            if (!txi_places_hold(&box, q)) continue;
            if (!txi_prior_add(list, txm_v2(txm_float(q.x), txm_float(q.y)), arena)) return 0;
        }
    }
    txi_prior_close(list);
    return 1;
}

/* ---- prior lines: assistants ----------------------------------------------------------------- */

/* the unit vector to the left of a line at point k of n, as y runs downwards; 0, 0: it has no
   direction */
static txm_vec2 txi_prior_left(const txm_vec2 *points, int n, int k) {
    const txm_vec2 a = points[k > TXI_PRIOR_CHORD ? k - TXI_PRIOR_CHORD : 0];
    const txm_vec2 b = points[k + TXI_PRIOR_CHORD < n ? k + TXI_PRIOR_CHORD : n - 1];
    const double dx = (double)b.x - a.x, dy = (double)b.y - a.y, length = sqrt(dx * dx + dy * dy);
    return length > 0 ? txm_v2(txm_float(dy / length), txm_float(-dx / length)) : txm_v2(0, 0);
}

/* the known pixel at a place, or -1 */
static int64_t txi_prior_known(const txi_window *w, double x, double y) {
    const int px = (int)floor(x + 0.5), py = (int)floor(y + 0.5);
    if (px < 0 || py < 0 || px >= w->width || py >= w->height) return -1;
    const int64_t i = (int64_t)py * w->width + px;
    return w->state[i] == TXI_KNOWN || w->state[i] == TXI_FOREIGN ? i : -1;
}

/* How strong an edge runs along the line at a distance to its left (negative: right): the mean step
   across, summed over the colours, in levels; 0 where it is not of one sign. */
static double txi_prior_edge(const txi_window *w, const txm_vec2 *points, int n, int distance) {
    double sum[3] = {0, 0, 0}, size = 0;
    int count = 0;
    for (int k = 0; k < n; k++) {
        const txm_vec2 left = txi_prior_left(points, n, k);
        const double x = points[k].x + (double)left.x * distance;
        const double y = points[k].y + (double)left.y * distance;
        const int64_t a = txi_prior_known(w, x + 1.5 * (double)left.x, y + 1.5 * (double)left.y);
        const int64_t b = txi_prior_known(w, x - 1.5 * (double)left.x, y - 1.5 * (double)left.y);
        if (a < 0 || b < 0) continue;
        count++;
        for (int c = 0; c < 3; c++) {
            const int step = w->color[4 * a + c] - w->color[4 * b + c];
            sum[c] += step;
            size += step < 0 ? -step : step;
        }
    }
    const double mean = fabs(sum[0]) + fabs(sum[1]) + fabs(sum[2]);
    if (count < TXI_PRIOR_LEAST || mean < TXI_PRIOR_STEP * count || mean < TXI_PRIOR_SURE * size)
        return 0;
    return mean / count;
}

/* The line at a distance to the left of line k, where that lies in the window. 0: no memory. */
static int txi_prior_offset(const txi_window *w, txi_prior_list *list, int k, int distance,
                            txm_arena *arena) {
    const int first = list->starts[k], n = list->starts[k + 1] - first;
    if (!txi_prior_reserve(list, 1, arena)) return 0;
    for (int i = 0; i < n; i++) {
        const txm_vec2 p = list->points[first + i];
        const txm_vec2 left = txi_prior_left(list->points + first, n, i);
        const txm_vec2 q = txm_v2(txm_float(p.x + (double)left.x * distance),
                                  txm_float(p.y + (double)left.y * distance));
        const int x = (int)floor((double)q.x + 0.5), y = (int)floor((double)q.y + 0.5);
        const int inside = x >= 0 && y >= 0 && x < w->width && y < w->height &&
                           w->state[(size_t)y * (size_t)w->width + (size_t)x] != TXI_VOID;
        const int open = list->open > list->starts[list->count];
        if (!inside) {
            txi_prior_close(list);
            if (!txi_prior_reserve(list, 1, arena)) return 0;
            continue;
        }
        if (open) { /* where the line bends more than the distance allows, its parallel turns
                       back                                                                      */
            const txm_vec2 last = list->points[list->open - 1];
            if (((double)q.x - last.x) * -left.y + ((double)q.y - last.y) * left.x <= 0) continue;
        }
        if (!txi_prior_add(list, q, arena)) return 0;
    }
    txi_prior_close(list);
    return 1;
}

/* The assistant lines of line k on one side (1 left, -1 right): at the strongest edges. 0: no
   memory. */
static int txi_prior_assist(const txi_window *w, txi_prior_list *list, int k, int side,
                            txm_arena *arena) {
    enum { FIRST = 2, SLOTS = TXI_PRIOR_WIDTH - FIRST };
    double edge[SLOTS];
    const txm_vec2 *points = list->points + list->starts[k];
    const int n = list->starts[k + 1] - list->starts[k];
    for (int i = 0; i < SLOTS; i++) edge[i] = txi_prior_edge(w, points, n, side * (FIRST + i));
    for (int found = 0; found < TXI_PRIOR_AIDS; found++) {
        int best = 0, first, last;
        for (int i = 1; i < SLOTS; i++) {
            if (edge[i] > edge[best]) best = i;
        }
        if (!(edge[best] > 0)) return 1;
        /* an edge is some pixels wide: its middle */
        for (first = best; first > 0 && edge[first - 1] > 0.9 * edge[best];) first--;
        for (last = best; last + 1 < SLOTS && edge[last + 1] > 0.9 * edge[best];) last++;
        if (!txi_prior_offset(w, list, k, side * (FIRST + (first + last) / 2), arena)) return 0;
        for (; first > 0 && edge[first - 1] <= edge[first]; first--) edge[first] = 0;
        for (; last + 1 < SLOTS && edge[last + 1] <= edge[last]; last++) edge[last] = 0;
        for (int i = first; i <= last; i++) edge[i] = 0;
    }
    return 1;
}

/* Smooth a line; its ends stay where they are. scratch: room for n points. */
static void txi_prior_smooth(txm_vec2 *points, int n, txm_vec2 *scratch) {
    for (int pass = 0; pass < 3; pass++) {
        memcpy(scratch, points, (size_t)n * sizeof *points);
        for (int k = 1; k + 1 < n; k++) {
            const int most = k < n - 1 - k ? k : n - 1 - k;
            const int r = most < TXI_PRIOR_BLUR ? most : TXI_PRIOR_BLUR;
            double x = 0, y = 0;
            for (int i = k - r; i <= k + r; i++) {
                x += (double)scratch[i].x;
                y += (double)scratch[i].y;
            }
            points[k] = txm_v2(txm_float(x / (2 * r + 1)), txm_float(y / (2 * r + 1)));
        }
    }
}

/* Does a line come near the hole? */
static int txi_prior_is_near(const txi_window *w, const txm_vec2 *points, int n) {
    for (int k = 0; k < n; k++) {
        const int x = (int)floor((double)points[k].x + 0.5),
                  y = (int)floor((double)points[k].y + 0.5);
        for (int dy = -TXI_PRIOR_NEAR; dy <= TXI_PRIOR_NEAR; dy += 4) {
            for (int dx = -TXI_PRIOR_NEAR; dx <= TXI_PRIOR_NEAR; dx += 4) {
                const int u = x + dx, v = y + dy;
                if (u < 0 || v < 0 || u >= w->width || v >= w->height) continue;
                if (w->state[(size_t)v * (size_t)w->width + (size_t)u] == TXI_HOLE) return 1;
            }
        }
    }
    return 0;
}

/* Leave out the lines that stay away from the hole. */
static void txi_prior_filter(const txi_window *w, txi_prior_list *list) {
    int lines = 0, points = 0;
    for (int k = 0; k < list->count; k++) {
        const int first = list->starts[k], n = list->starts[k + 1] - first;
        if (!txi_prior_is_near(w, list->points + first, n)) continue;
        memmove(list->points + points, list->points + first, (size_t)n * sizeof *list->points);
        list->starts[lines++] = points;
        points += n;
    }
    list->count = lines;
    if (list->starts) list->starts[lines] = points;
}

/* The prior lines of a window that come near its hole: first all lines themselves, in pieces, then
   their assistants.
   crests  NULL: the lines of the description
   prior   lies in the arena
   return  TXM_OK, TXM_OUT_OF_MEMORY, TXM_CANCELLED
   cost    O(pixels of the window + length of the lines in it)                              */
static txm_status txi_prior_make(const txi_domain *d, const texinpaint_crests *crests,
                                 const txi_window *w, txm_arena *arena, txm_env *env,
                                 txi_prior *prior) {
    const texinpaint_line *lines = crests ? crests->lines : d->desc->lines;
    const size_t count = crests ? crests->line_count : (size_t)d->desc->line_count;
    txi_prior_list list;
    txi_places places;
    txm_arena scratch;
    int ok = 1;
    memset(prior, 0, sizeof *prior);
    memset(&list, 0, sizeof list);
    if (count == 0 || !(w->spacing > 0)) return TXM_OK;
    if (txm_progress(env, 0, "prior lines")) return txi_stopped(env);
    txm_arena_init(&scratch, env);
    if (d->surface) ok = txi_places_make(w, &scratch, &places);
    for (size_t i = 0; i < count && ok; i++) {
        if (d->surface) ok = txi_prior_lay(&places, &lines[i], &list, arena);
        else ok = txi_prior_copy(w, &lines[i], &list, arena);
    }
    const int own = list.count;
    if (own > 0 && crests && ok) {
        txm_vec2 *copy =
            (txm_vec2 *)txm_arena_alloc(&scratch, (size_t)list.open, sizeof(txm_vec2));
        ok = copy != NULL;
        for (int k = 0; k < own && ok; k++)
            txi_prior_smooth(list.points + list.starts[k], list.starts[k + 1] - list.starts[k],
                             copy);
    }
    for (int k = 0; k < own && ok; k++)
        ok = txi_prior_assist(w, &list, k, 1, arena) && txi_prior_assist(w, &list, k, -1, arena);
    txm_arena_free(&scratch);
    if (!ok) return txi_no_memory(env);
    txi_prior_filter(w, &list);
    prior->points = list.points;
    prior->starts = list.starts;
    prior->line_count = list.count;
    return TXM_OK;
}

#endif /* TEXINPAINT_PRIOR_H */
