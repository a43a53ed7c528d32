#ifndef TEXINPAINT_STROKE_H
#define TEXINPAINT_STROKE_H

#include "trace.h"

/* ---- strokes -----------------------------------------------------------------------------------
   Two curves that run along each other with the same colour between them are the sides of one stroke:
   a bar, a stripe, a joint. A stroke is completed as a whole, and covers what it crosses.         */

enum {
    TXI_STROKE_WIDEST = 40, /* pixels; ours                                                       */
    TXI_STROKE_KNOWN = 24,  /* points of a curve's known part, next to the hole, that are looked at */
    TXI_STROKE_LEAST = 6    /* so many of them must lie beside the other curve                      */
};

/* The colours on both sides of a curve in its known part, at each end of the hole. */
typedef struct txi_sides {
    double color[2][2][3]; /* end (0 in front of the hole), side (0 left), RGB                     */
    int hits[2][2];
} txi_sides;

/* The direction of a curve at point i, over 5 points. */
static txm_vec2 txi_curve_along(const txi_curve *c, int i) {
    const txm_vec2 a = c->points[i > 2 ? i - 2 : 0];
    const txm_vec2 b = c->points[i + 2 < c->count ? i + 2 : c->count - 1];
    return txi_unit((double)b.x - a.x, (double)b.y - a.y);
}

/* The known points next to the hole: before it (end 0) or behind it; from > to: none. */
static void txi_curve_known(const txi_curve *c, int end, int *from, int *to) {
    *from = end ? c->last + 1 : c->first > TXI_STROKE_KNOWN ? c->first - TXI_STROKE_KNOWN : 0;
    *to = end ? c->last + TXI_STROKE_KNOWN : c->first - 1;
    if (*to > c->count - 1) *to = c->count - 1;
}

static void txi_sides_make(const txi_window *w, const txi_curve *c, double away, txi_sides *s) {
    memset(s, 0, sizeof *s);
    for (int end = 0; end < 2; end++) {
        int from, to;
        txi_curve_known(c, end, &from, &to);
        for (int i = from; i <= to; i++) {
            const txm_vec2 t = txi_curve_along(c, i), p = c->points[i];
            for (int side = 0; side < 2; side++) {
                const double u = side ? away : -away; /* right is (-t.y, t.x) */
                const ptrdiff_t at = txi_pixel(w->width, w->height, (double)p.x - u * (double)t.y,
                                               (double)p.y + u * (double)t.x);
                if (at < 0 || (w->state[at] != TXI_KNOWN && w->state[at] != TXI_FOREIGN)) continue;
                for (int k = 0; k < 3; k++) s->color[end][side][k] += w->color[4 * at + k];
                s->hits[end][side]++;
            }
        }
        for (int side = 0; side < 2; side++)
            for (int k = 0; k < 3 && s->hits[end][side]; k++)
                s->color[end][side][k] /= s->hits[end][side];
    }
}

static double txi_sides_distance(const double a[3], const double b[3]) {
    double sum = 0;
    for (int c = 0; c < 3; c++) sum += (a[c] - b[c]) * (a[c] - b[c]);
    return sqrt(sum);
}

/* Where curve b lies beside point i of curve a: signed distance to the right, and b's point; 0 if it has
   no point beside it. */
static int txi_beside(const txi_curve *a, int i, const txi_curve *b, double *across, int *point) {
    const txm_vec2 t = txi_curve_along(a, i), p = a->points[i];
    double best = 1e30, ahead = 1e30;
    for (int k = 0; k < b->count; k++) {
        const double x = (double)b->points[k].x - p.x, y = (double)b->points[k].y - p.y;
        const double square = x * x + y * y;
        if (square >= best) continue;
        best = square;
        ahead = x * (double)t.x + y * (double)t.y;
        *across = y * (double)t.x - x * (double)t.y;
        *point = k;
    }
    return ahead < 2 && ahead > -2;
}

/* The mean signed width between a and b at one end of a's hole, and which end of b that is. 0: they do
   not run along each other there. */
static int txi_stroke_end(const txi_curve *a, const txi_curve *b, int end, double *width, int *of_b) {
    double sum = 0, squares = 0;
    int n = 0, from, to, votes = 0;
    txi_curve_known(a, end, &from, &to);
    for (int i = from; i <= to; i += 2) {
        double across;
        int point;
        if (!txi_beside(a, i, b, &across, &point)) continue;
        sum += across;
        squares += across * across;
        votes += point < b->first ? -1 : point > b->last ? 1 : 0;
        n++;
    }
    if (2 * n < TXI_STROKE_LEAST) return 0;
    const double mean = sum / n, spread = squares / n - mean * mean, size = mean < 0 ? -mean : mean;
    *width = mean;
    *of_b = votes > 0;
    return size >= 2 && size <= (double)TXI_STROKE_WIDEST && spread <= 0.04 * size * size + 1;
}

/* The width of the stroke between two curves; 0: they are not its sides. Both must end alike. */
static double txi_stroke(const txi_window *w, const txi_curve *a, const txi_curve *b) {
    double width[2] = {0, 0};
    int of_b[2] = {0, 1}, ends = 0;
    for (int end = 0; end < 2; end++) {
        if (a->ends[end] < 0) continue;
        if (!txi_stroke_end(a, b, end, &width[end], &of_b[end])) return 0;
        if (b->ends[of_b[end]] < 0) return 0;
        ends++;
    }
    if (ends == 0 || (ends == 2 && of_b[0] == of_b[1])) return 0;
    if (ends != (b->ends[0] >= 0) + (b->ends[1] >= 0)) return 0;
    if (ends == 2 && (width[0] > 0) != (width[1] > 0)) return 0;
    const double known = width[0] + width[1], mean = (known < 0 ? -known : known) / ends;
    const int right = known > 0;
    for (int i = a->first; i <= a->last; i += 2) { /* through the hole, too */
        double across = 0;
        int point;
        if (!txi_beside(a, i, b, &across, &point)) continue;
        if (!right) across = -across;
        if (across < 0.4 * mean || across > 2.5 * mean) return 0;
    }
    txi_sides sa, sb;
    const double away = mean < 6 ? 0.5 * mean : 3;
    txi_sides_make(w, a, away, &sa);
    txi_sides_make(w, b, away, &sb);
    for (int end = 0; end < 2; end++) {
        const int e = of_b[end], same_way = of_b[0] == 0 && of_b[1] == 1;
        const int inside_a = right, inside_b = same_way ? !right : right;
        if (a->ends[end] < 0) continue;
        if (!sa.hits[end][0] || !sa.hits[end][1] || !sb.hits[e][0] || !sb.hits[e][1]) return 0;
        const double contrast_a = txi_sides_distance(sa.color[end][0], sa.color[end][1]);
        const double contrast_b = txi_sides_distance(sb.color[e][0], sb.color[e][1]);
        const double least = contrast_a < contrast_b ? contrast_a : contrast_b;
        if (txi_sides_distance(sa.color[end][inside_a], sb.color[e][inside_b]) > 0.35 * least + 4)
            return 0;
    }
    return mean;
}

/* Find the strokes among curves whose partner is not set yet. partners receives the other side of
   each, or -1: of all pairs the narrowest first. width: room for count * count floats.
   cost    O(pairs of curves near each other * points^2)                                          */
static void txi_find_strokes(const txi_window *w, const txi_curve *curves, int count, int *partners,
                             float *width) {
    const size_t n = (size_t)count;
    for (int i = 0; i < count; i++) {
        const int p = curves[i].partner;
        partners[i] = p >= 0 && p < count && p != i ? p : -1;
    }
    for (int i = 0; i < count; i++) {
        for (int j = 0; j < count; j++) {
            width[(size_t)i * n + (size_t)j] = 0;
            if (j == i || partners[i] >= 0 || partners[j] >= 0) continue;
            if (curves[i].count < 2 || curves[j].count < 2) continue;
            width[(size_t)i * n + (size_t)j] = txm_float(txi_stroke(w, &curves[i], &curves[j]));
        }
    }
    for (;;) {
        int a = -1, b = -1;
        float least = 0;
        for (int i = 0; i < count; i++) {
            for (int j = i + 1; j < count; j++) {
                const float u = width[(size_t)i * n + (size_t)j], v = width[(size_t)j * n + (size_t)i];
                if (partners[i] >= 0 || partners[j] >= 0 || u <= 0 || v <= 0) continue;
                if (a >= 0 && u + v >= least) continue;
                least = u + v;
                a = i;
                b = j;
            }
        }
        if (a < 0) return;
        partners[a] = b;
        partners[b] = a;
    }
}

#endif /* TEXINPAINT_STROKE_H */
