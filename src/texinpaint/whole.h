#ifndef TEXINPAINT_WHOLE_H
#define TEXINPAINT_WHOLE_H

#include "join.h"
#include "strip.h"

/* ---- whole strokes ------------------------------------------------------------------------------
   Where bars cross near the border of the hole, one of them hides an edge of the other, and that
   edge has no end to join. The other edge is enough: it is joined from border to border, and on
   both sides of the hole the bar has the same width and the same colour. So the hidden edge is the
   joined one, moved by the width. Curves that were found for its ends without that knowledge are
   taken away. */

enum {
    TXI_FLANK_KNOWN =
        64,              /* pixels of the known part of a curve that a width is measured on; ours */
    TXI_FLANK_SKIP = 1,  /* pixels next to the hole that are left out                           */
    TXI_FLANK_COLOR = 7, /* of these so many for the colour                                     */
    TXI_FLANK_LEAST = 7, /* so many of them must agree about the width; ours                    */
    TXI_CROSS_STEP = 3,  /* points of a curve from one to the next that is tested for crossings */
    TXI_FLANK_STEPS = 2 * (TXI_STROKE_WIDEST + 2)
};
#define TXI_FLANK_FROM 2.0    /* pixels from the curve at which the colour beside it is taken     */
#define TXI_FLANK_TONE 32.0   /* levels; colours that differ more are never the same one; ours    */
#define TXI_FLANK_CATCH 3.0  /* pixels; ends as near as that to the other edge belong to it; ours */
#define TXI_FLANK_DIFFER \
    0.25 /* share by which the widths on both sides of the hole may differ; ours */

/* What lies beside a curve in its known part on one side of the hole. */
typedef struct txi_flank {
    double width;    /* pixels to the opposite edge; 0: not known                                 */
    double color[3]; /* up to there, RGB                                                          */
} txi_flank;

/* RGB at a distance to the right of point i of a curve; 0: not known. */
static int txi_flank_pixel(const txi_window *w, const txi_curve *c, int i, double away,
                           int rgb[3]) {
    const txm_vec2 t = txi_curve_along(c, i), p = c->points[i];
    return txi_strip_pixel(w, (double)p.x - away * (double)t.y, (double)p.y + away * (double)t.x,
                           rgb);
}

static double txi_flank_distance(const double color[3], const int rgb[3]) {
    const double other[3] = {(double)rgb[0], (double)rgb[1], (double)rgb[2]};
    return txi_end_color_distance(color, other);
}

/* The point of a curve that lies i pixels outwards from one end of the hole; -1: there is none. */
static int txi_flank_point(const txi_curve *c, int end, int i) {
    const int k = end ? c->last + 1 + i : c->first - 1 - i;
    return k >= 0 && k < c->count ? k : -1;
}

/* The median of each channel beside the curve near the hole; side 1 right, -1 left. 0: too little
   is known. */
static int txi_flank_color(const txi_window *w, const txi_curve *c, int end, int side,
                           double color[3]) {
    int n = 0, values[3][TXI_FLANK_COLOR];
    for (int i = TXI_FLANK_SKIP; n < TXI_FLANK_COLOR; i++) {
        const int point = txi_flank_point(c, end, i);
        int rgb[3];
        if (point < 0 || i >= TXI_FLANK_KNOWN) break;
        if (!txi_flank_pixel(w, c, point, TXI_FLANK_FROM * side, rgb)) continue;
        for (int k = 0; k < 3; k++) {
            int at = n; /* insertion sort */
            for (; at > 0 && values[k][at - 1] > rgb[k]; at--) values[k][at] = values[k][at - 1];
            values[k][at] = rgb[k];
        }
        n++;
    }
    const int middle = n / 2;
    for (int k = 0; k < 3 && n; k++) color[k] = values[k][middle];
    return n >= 4;
}

/* How far the colour beside point i reaches: to where half of the step to the next colour is done.
   0: to something that is not known; -1: it is another colour. */
static double txi_flank_width(const txi_window *w, const txi_curve *c, int i, int side,
                              const double color[3], double differs) {
    int rgb[3];
    for (int k = 0; k < TXI_FLANK_STEPS; k++) {
        const double away = TXI_FLANK_FROM + 0.5 * k;
        if (!txi_flank_pixel(w, c, i, away * side, rgb)) return 0;
        if (txi_flank_distance(color, rgb) <= differs) continue;
        if (k == 0) return -1;
        if (!txi_flank_pixel(w, c, i, (away + 1.5) * side, rgb)) return 0;
        const double next = txi_flank_distance(color, rgb);
        for (int m = -1; m < 3; m++) {
            if (!txi_flank_pixel(w, c, i, (away + 0.5 * m) * side, rgb)) return 0;
            if (txi_flank_distance(color, rgb) > 0.5 * next) return away + 0.5 * m - 0.25;
        }
        return away;
    }
    return 0;
}

/* Measure what lies on one side of a curve (1 right, -1 left) at one end of the hole: its colour,
   and how far that reaches by most of the points, as far as the curve has it at its side. 0: not
   even the colour is known. */
static int txi_flank_make(const txi_window *w, const txi_curve *c, int end, int side,
                          txi_flank *f) {
    double widths[TXI_FLANK_KNOWN], across[3];
    int n = 0, most = 0, others = 0;
    f->width = 0;
    if (!txi_flank_color(w, c, end, side, f->color)) return 0;
    if (!txi_flank_color(w, c, end, -side, across)) return 0;
    const double contrast = txi_end_color_distance(f->color, across);
    if (contrast < 8) return 0;
    const double differs = contrast < 2 * TXI_FLANK_TONE ? 0.5 * contrast : TXI_FLANK_TONE;
    for (int i = TXI_FLANK_SKIP; i < TXI_FLANK_KNOWN && others < 4; i++) {
        const int point = txi_flank_point(c, end, i);
        if (point < 0) break;
        const double width = txi_flank_width(w, c, point, side, f->color, differs);
        TXM_ASSERT(n < TXI_FLANK_KNOWN);
        if (width > 0) widths[n++] = width;
        others = width < 0 ? others + 1 : 0;
    }
    for (int i = 0; i < n; i++) {
        double sum = 0;
        int agree = 0;
        for (int k = 0; k < n; k++) {
            if (fabs(widths[k] - widths[i]) > 0.06 * widths[i] + 0.75) continue;
            sum += widths[k];
            agree++;
        }
        if (agree <= most) continue;
        most = agree;
        f->width = sum / agree;
    }
    if (most < TXI_FLANK_LEAST || 5 * most < 3 * n || f->width > (double)TXI_STROKE_WIDEST)
        f->width = 0;
    return 1;
}

/* The other edge of a stroke of which c is one: its points moved by the width, which changes evenly
   from one side of the hole to the other. */
static txm_status txi_other_edge(const txi_window *w, const txi_curve *c, const txi_flank f[2],
                                 int side, txm_arena *arena, txm_env *env, txi_curve *other) {
    *other = *c;
    other->points = (txm_vec2 *)txm_arena_alloc(arena, (size_t)c->count, sizeof *other->points);
    if (!other->points) return txi_no_memory(env);
    other->first = other->last = -1;
    for (int i = 0; i < c->count; i++) {
        const double part = (double)(i - c->first) / (c->last - c->first);
        const double t = part < 0 ? 0 : part > 1 ? 1 : part;
        const double away = side * (f[0].width + t * (f[1].width - f[0].width));
        const txm_vec2 along = txi_curve_along(c, i), p = c->points[i];
        const double x = (double)p.x - away * (double)along.y,
                     y = (double)p.y + away * (double)along.x;
        const ptrdiff_t at = txi_pixel(w->width, w->height, x, y);
        other->points[i] = txm_v2(txm_float(x), txm_float(y));
        if (at < 0 || w->state[at] != TXI_HOLE) continue;
        if (other->first < 0) other->first = i;
        other->last = i;
    }
    return TXM_OK;
}

/* Does an end lie on a curve? 1: at its front, 2: at its back, 0: not. */
static int txi_end_on_curve(const txi_end *e, const txi_curve *c) {
    double best = TXI_FLANK_CATCH * TXI_FLANK_CATCH;
    int found = 0;
    for (int i = 0; i < c->count; i++) {
        const double x = (double)e->place.x - c->points[i].x,
                     y = (double)e->place.y - c->points[i].y;
        const txm_vec2 t = txi_curve_along(c, i);
        const double dot = (double)t.x * e->heading.x + (double)t.y * e->heading.y;
        if (x * x + y * y > best || (dot < 0.85 && dot > -0.85)) continue;
        best = x * x + y * y;
        found = dot > 0 ? 1 : 2;
    }
    return found;
}

/* Which curves give way to a new edge: those of its ends. Marks them in gone; 0: one of them is
   surer than the new one, or none of them was seen to go on behind the hole without an end
   there. */
static int txi_edge_replaces(const txi_lines *l, const txi_curve *curves, int count, int from,
                             const int *partners, txi_curve *edge, uint8_t *gone) {
    int found[2] = {-1, -1}, hidden = 0;
    for (int i = 0; i < l->end_count; i++) {
        const int on = txi_end_on_curve(&l->ends[i], edge);
        if (!on || i == curves[from].ends[0] || i == curves[from].ends[1]) continue;
        if (found[on - 1] < 0 || l->ends[i].length > l->ends[found[on - 1]].length)
            found[on - 1] = i;
    }
    if (found[0] < 0 && found[1] < 0) return 0;
    for (int k = 0; k < count; k++) {
        gone[k] = 0;
        for (int s = 0; s < 4; s++) {
            const int e = found[s / 2];
            if (e < 0 || curves[k].ends[s % 2] != e || k == from) continue;
            if (partners[k] >= 0) return 0;
            if (curves[k].ends[1] >= 0 && curves[k].cost < curves[from].cost) return 0;
            gone[k] = 1;
            hidden |= curves[k].ends[1] < 0;
        }
    }
    if (!hidden) return 0;
    edge->ends[0] = found[0] >= 0 ? found[0] : found[1];
    edge->ends[1] = found[0] >= 0 ? found[1] : -1;
    return 1;
}

/* What lies on one side of a curve at both ends of the hole. 0: it is not the same, or its width is
   not known. A width that is known at one end only counts for both. */
static int txi_stroke_flanks(const txi_window *w, const txi_curve *c, int side, txi_flank f[2]) {
    if (!txi_flank_make(w, c, 0, side, &f[0]) || !txi_flank_make(w, c, 1, side, &f[1])) return 0;
    if (f[0].width <= 0) f[0].width = f[1].width;
    if (f[1].width <= 0) f[1].width = f[0].width;
    if (f[0].width <= 0) return 0;
    const double mean = 0.5 * (f[0].width + f[1].width);
    if (fabs(f[0].width - f[1].width) > TXI_FLANK_DIFFER * mean) return 0;
    return txi_end_color_distance(f[0].color, f[1].color) <= 0.25 * (double)c->strength + 4;
}

/* Make a whole stroke of curve i, if it is one edge of it; *edge receives the other one. 0: it is
   not. */
static int txi_whole_stroke(const txi_window *w, const txi_lines *l, const txi_curve *curves,
                            int count, int i, const int *partners, txm_arena *arena, txm_env *env,
                            uint8_t *gone, txi_curve *edge, txm_status *status) {
    const txi_curve *c = &curves[i];
    txi_flank f[2][2]; /* left and right, both ends */
    int usable[2];
    for (int k = 0; k < 2; k++) usable[k] = txi_stroke_flanks(w, c, k ? 1 : -1, f[k]);
    const int first =
        usable[1] && (!usable[0] || f[1][0].width < f[0][0].width); /* the narrower one */
    for (int n = 0; n < 2; n++) {
        const int k = n ? !first : first;
        if (!usable[k]) continue;
        *status = txi_other_edge(w, c, f[k], k ? 1 : -1, arena, env, edge);
        if (*status != TXM_OK) return 0;
        if (edge->first >= 0 && txi_edge_replaces(l, curves, count, i, partners, edge, gone))
            return 1;
    }
    return 0;
}

/* Does curve i cross another one in the hole? Only then an edge can be hidden by a stroke. */
static int txi_curve_crosses(const txi_curve *curves, int count, int i) {
    const txi_curve *a = &curves[i];
    for (int k = 0; k < count; k++) {
        const txi_curve *b = &curves[k];
        if (k == i || b->count < 2) continue;
        for (int m = a->first; m + TXI_CROSS_STEP <= a->last; m += TXI_CROSS_STEP) {
            for (int n = b->first; n + TXI_CROSS_STEP <= b->last; n += TXI_CROSS_STEP) {
                if (txi_segments_cross(a->points[m], a->points[m + TXI_CROSS_STEP], b->points[n],
                                       b->points[n + TXI_CROSS_STEP]))
                    return 1;
            }
        }
    }
    return 0;
}

/* Complete strokes of which only one edge was joined.

   curves  *count curves in the arena, replaced by an array with the new edges, which are partners
   of the
           joined ones; curves that were found for their ends are gone
   cost    O(curves * ends * points)                                                            */
static txm_status txi_whole_strokes(const txi_window *w, const txi_lines *l, txm_arena *arena,
                                    txm_env *env, txi_curve **curves, int *count) {
    const int most = 2 * *count;
    int n = *count, kept = 0;
    txm_arena scratch;
    txm_status status = TXM_OK;
    if (n == 0) return TXM_OK;
    txm_arena_init(&scratch, env);
    txi_curve *c = (txi_curve *)txm_arena_alloc(arena, (size_t)most, sizeof *c);
    int *partners = (int *)txm_arena_alloc(&scratch, (size_t)most, sizeof *partners);
    int *place = (int *)txm_arena_alloc(&scratch, (size_t)most, sizeof *place);
    uint8_t *done = (uint8_t *)txm_arena_zero(&scratch, (size_t)most, 2);
    float *widths = (float *)txm_arena_alloc(&scratch, (size_t)n, (size_t)n * sizeof *widths);
    if (scratch.failed || arena->failed) status = txi_no_memory(env);
    if (status == TXM_OK) {
        memcpy(c, *curves, (size_t)n * sizeof *c);
        txi_find_strokes(w, c, n, partners, widths);
    }
    for (int round = 0; round < *count && status == TXM_OK; round++) {
        uint8_t *gone = done + most;
        int i = -1;
        for (int k = 0; k < *count; k++) {
            if (done[k] || partners[k] >= 0 || c[k].ends[1] < 0 || c[k].last <= c[k].first)
                continue;
            if (i < 0 || c[k].cost < c[i].cost) i = k;
        }
        if (i < 0) break;
        done[i] = 1;
        if (!txi_curve_crosses(c, n, i)) continue;
        if (!txi_whole_stroke(w, l, c, n, i, partners, arena, env, gone, &c[n], &status)) continue;
        for (int k = 0; k < n; k++) {
            if (!gone[k]) continue;
            c[k].count = 0;
            c[k].ends[0] = c[k].ends[1] = -1;
            done[k] = 1;
        }
        c[n].partner = partners[n] = i;
        c[i].partner = partners[i] = n;
        n++;
        if (txm_progress(env, 0, "lines")) status = txi_stopped(env);
    }
    for (int k = 0; k < n && status == TXM_OK; k++) place[k] = c[k].count ? kept++ : -1;
    for (int k = 0; k < n && status == TXM_OK; k++) {
        if (place[k] < 0) continue;
        c[place[k]] = c[k];
        if (c[k].partner >= 0) c[place[k]].partner = place[c[k].partner];
    }
    txm_arena_free(&scratch);
    if (status != TXM_OK) return status;
    *curves = c;
    *count = kept;
    return TXM_OK;
}

#endif /* TEXINPAINT_WHOLE_H */
