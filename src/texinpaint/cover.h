#ifndef TEXINPAINT_COVER_H
#define TEXINPAINT_COVER_H

#include "strip.h"

/* ---- strokes that cross -------------------------------------------------------------------------
   Where two strokes cross in the hole one covers the other, and what lies beside one of them is not
   its own. Such strokes are laid bare: as wide as they are and not with their surroundings. Which
   is on top is seen where they cross in the known part, near the hole; where they do not, the
   narrower and stronger one is: in pictures thin things lie before thick ones more often than
   behind them. */

enum {
    TXI_COVER_COLUMNS = 28, /* known columns on each side of the hole that are looked at; ours    */
    TXI_COVER_TONE = 32,  /* levels; colours that differ more are never those of one stroke; ours */
    TXI_COVER_BEYOND = 3,   /* pixels that a stroke reaches beyond its last column                */
    TXI_COVER_VOTES = 6     /* places of a known crossing that decide about it; ours              */
};

/* How far four of five colours inside of a stroke are from the usual ones at most, in columns
   from..to; texture, or something that covers it. 255: nothing is known. */
static int txi_cover_spread(const txi_strip *s, int from, int to) {
    int counts[256] = {0}, n = 0, value = 0;
    for (int i = from; i <= to; i++) {
        for (int j = TXI_STRIP_MARGIN + 1; j < TXI_STRIP_MARGIN + s->inside; j++) {
            const size_t at = (size_t)i * (size_t)s->rows + (size_t)j;
            if (!s->known[at]) continue;
            counts[txm_clampi((int)txi_typical_distance(s, j, s->color + 3 * at), 0, 255)]++;
            n++;
        }
    }
    if (n == 0) return 255;
    for (int sum = counts[0]; 5 * sum < 4 * n && value < 255; sum += counts[value]) value++;
    return value;
}

/* The usual colour of each row of a stroke: the median of its known columns near the hole. */
static txm_status txi_cover_typical(txi_strip *s, const txi_curve *curve, txm_arena *arena,
                                    txm_env *env) {
    const int from = s->first > TXI_COVER_COLUMNS ? s->first - TXI_COVER_COLUMNS : 0;
    const int behind = s->tail ? s->last : s->last + TXI_COVER_COLUMNS;
    const int to = behind < s->line.count - 1 ? behind : s->line.count - 1;
    s->typical = (uint8_t *)txm_arena_zero(arena, (size_t)s->rows, 3);
    if (!s->typical) return txi_no_memory(env);
    for (int k = 0; k < 3 * s->rows; k++) {
        int counts[256] = {0}, n = 0, value = 0;
        for (int i = from; i <= to; i++) {
            const size_t at = (size_t)i * (size_t)s->rows + (size_t)(k / 3);
            if ((i >= s->first && i <= s->last) || !s->known[at]) continue;
            counts[s->color[3 * at + (size_t)(k % 3)]]++;
            n++;
        }
        for (int sum = counts[0]; 2 * sum < n && value < 255; sum += counts[value]) value++;
        s->typical[k] = (uint8_t)value;
    }
    const int before = txi_cover_spread(s, from, s->first - 1),
              after = txi_cover_spread(s, s->last + 1, to);
    const float spread = 1.25f * (float)(before < after ? before : after);
    s->tolerance =
        txm_maxf(txm_clampf(0.5f * curve->strength, 12, TXI_COVER_TONE), spread < 255 ? spread : 0);
    return TXM_OK;
}

/* Where a place lies in a stroke: its distance from the middle in half widths (1 and more: beside
   it); a large number beyond its ends. */
static double txi_cover_across(const txi_strip *s, double x, double y) {
    double best = 1e30;
    int column = 0;
    for (int i = 0; i < s->line.count; i += 2) {
        const double dx = x - s->line.place[i].x, dy = y - s->line.place[i].y;
        if (dx * dx + dy * dy >= best) continue;
        best = dx * dx + dy * dy;
        column = i;
    }
    const txm_vec2 t = s->line.along[column], p = s->line.place[column];
    const double dx = x - p.x, dy = y - p.y, half = s->line.half[column];
    const double ahead = dx * t.x + dy * t.y, across = dy * t.x - dx * t.y;
    if (fabs(ahead) > (double)TXI_COVER_BEYOND || half <= 0) return 1e9;
    return (across < 0 ? -across : across) / half;
}

/* The box of a strip's columns and the width of its stroke: x0, y0, x1, y1, window pixels. */
static void txi_cover_box(const txi_strip *s, double box[4]) {
    box[0] = box[1] = 1e30;
    box[2] = box[3] = -1e30;
    for (int i = 0; i < s->line.count; i++) {
        const double x = s->line.place[i].x, y = s->line.place[i].y, half = s->line.half[i];
        box[0] = fmin(box[0], x - half);
        box[1] = fmin(box[1], y - half);
        box[2] = fmax(box[2], x + half);
        box[3] = fmax(box[3], y + half);
    }
}

/* Can two strokes cross: are their boxes no farther apart than a stroke reaches beyond its ends? */
static int txi_cover_near(const txi_strip *a, const txi_strip *b) {
    double p[4], q[4];
    const double reach = TXI_COVER_BEYOND;
    txi_cover_box(a, p);
    txi_cover_box(b, q);
    return p[0] <= q[2] + reach && q[0] <= p[2] + reach && p[1] <= q[3] + reach &&
           q[1] <= p[3] + reach;
}

/* How many places in the known part, near the hole, where a and b cross show the colour of a, less
   those that show the colour of b. *inside: how many lie in both in the hole. */
static int txi_cover_votes(const txi_window *w, const txi_strip *a, const txi_strip *b,
                           int *inside) {
    const int middle = TXI_STRIP_MARGIN + a->inside / 2, other = TXI_STRIP_MARGIN + b->inside / 2;
    int votes = 0;
    *inside = 0;
    for (int i = a->first - TXI_COVER_COLUMNS; i <= a->last + TXI_COVER_COLUMNS; i++) {
        if (i < 0 || i >= a->line.count) continue;
        const txm_vec2 n = txi_normal_of(a->line.along[i]), p = a->line.place[i];
        for (int k = -2; k <= 2; k++) {
            const double away = 0.4 * k * (double)a->line.half[i];
            const double x = (double)p.x + away * (double)n.x, y = (double)p.y + away * (double)n.y;
            const ptrdiff_t at = txi_pixel(w->width, w->height, x, y);
            int rgb[3];
            if (at < 0 || w->state[at] == TXI_VOID || txi_cover_across(b, x, y) > 0.8) continue;
            if (w->state[at] == TXI_HOLE) ++*inside;
            if (!txi_strip_pixel(w, x, y, rgb)) continue;
            double of_a = 0, of_b = 0;
            for (int c = 0; c < 3; c++) {
                const double u = rgb[c] - a->typical[3 * middle + c],
                             v = rgb[c] - b->typical[3 * other + c];
                of_a += u * u / 3;
                of_b += v * v / 3;
            }
            if (of_a < of_b && of_a < (double)(a->tolerance * a->tolerance)) votes++;
            if (of_b < of_a && of_b < (double)(b->tolerance * b->tolerance)) votes--;
        }
    }
    return votes;
}

/* Is a row of a bare stroke part of it? One row beside it is, too. */
static int txi_cover_row(const txi_strip *s, int j) {
    return j >= TXI_STRIP_MARGIN - 1 && j <= TXI_STRIP_MARGIN + s->inside + 1;
}

/* A stroke that crosses others: only what has its usual colours counts as known. */
static void txi_cover_bare(txi_strip *s) {
    s->is_bare = 1;
    for (int i = 0; i < s->line.count; i++) {
        for (int j = 0; j < s->rows; j++) {
            const size_t at = (size_t)i * (size_t)s->rows + (size_t)j;
            if (!txi_cover_row(s, j) ||
                txi_typical_distance(s, j, s->color + 3 * at) > (double)s->tolerance)
                s->known[at] = 0;
        }
    }
}

/* Find the strokes that cross in the hole, and what covers what.
   above  count^2: 1 where stroke i lies on stroke j, seen in the known part
   cost   O(strokes^2 * points^2), of those whose boxes overlap                                 */
static txm_status txi_cover_find(const txi_window *w, txi_strip *strips, const txi_curve *curves,
                                 int count, uint8_t *above, txm_arena *arena, txm_env *env) {
    for (int i = 0; i < count; i++) {
        if (strips[i].partner < 0) continue;
        const txm_status status =
            txi_cover_typical(&strips[i], &curves[strips[i].curve], arena, env);
        if (status != TXM_OK) return status;
    }
    for (int i = 0; i < count; i++) {
        for (int j = i + 1; j < count; j++) {
            int inside;
            if (strips[i].partner < 0 || strips[j].partner < 0) continue;
            if (!txi_cover_near(&strips[i], &strips[j])) continue;
            const int votes = txi_cover_votes(w, &strips[i], &strips[j], &inside);
            if (inside < 3) continue;
            strips[i].is_bare = strips[j].is_bare = 1;
            above[i * count + j] = votes >= TXI_COVER_VOTES;
            above[j * count + i] = votes <= -TXI_COVER_VOTES;
        }
        if (txm_progress(env, 0, "strips")) return txi_stopped(env);
    }
    for (int i = 0; i < count; i++)
        if (strips[i].is_bare) txi_cover_bare(&strips[i]);
    return TXM_OK;
}

#endif /* TEXINPAINT_COVER_H */
