#ifndef TEXINPAINT_PAIR_H
#define TEXINPAINT_PAIR_H

#include "grow.h"

/* ---- which ends belong together ---------------------------------------------------------------
   The structure of [1, II.B]: lines that end at the hole are continued through it and joined. The
   paper lets lines grow by tensor voting and joins those that come near each other; growth drifts, and
   the order of the joins matters. Here the votes are one of several costs of a pair of ends, and the
   pairs are chosen together, as the matching of least cost.                                         */

enum {
    TXI_STEPS = 24,        /* pieces of the curve of a candidate                                 */
    TXI_PER_END = 12,      /* candidates kept for each end, the best ones; ours                   */
    TXI_MAX_LINKS = 3000,  /* candidates in all; ours                                            */
    TXI_STARTS = 3,        /* of the annealing; one alone differs more between seeds; ours        */
    TXI_MOVES = 30000,     /* from each start; ours                                               */
    TXI_KNOWN_PART = 120   /* pixels of a curve outside of the hole, on each side                */
};

/* A candidate: two ends and the curve between them, or one end and a place where it leaves the hole. */
typedef struct txi_link {
    int a, b;          /* ends; b = -1: no end there                                             */
    int line;          /* the prior line that it follows, or -1                                   */
    float from, to;    /* where on that line, an index and fraction of its points                 */
    float cost, bend, length;
    txm_vec2 leave;    /* with b = -1: where it leaves the hole,                                  */
    txm_vec2 backwards; /* and the direction there, into the hole, unit                           */
    txm_vec2 low, high; /* bounding box                                                          */
    txm_vec2 points[TXI_STEPS + 1];
} txi_link;

/* What a way of joining costs. All without unit; ours, from experiments. */
typedef struct txi_rules {
    double unmatched; /* an end that is not joined                                               */
    double weak;      /* share of that for ends that are not long                                */
    double crossing;  /* two curves that cross                                                   */
    double bend;      /* factor of the bending energy                                            */
    double votes;     /* less for votes that agree with the curve                                */
    double prior;     /* less for lines that follow the same prior line                           */
    double met;       /* less for lines that met when they grew                                  */
    int look_ahead;   /* long ends may leave the hole without another end                        */
} txi_rules;

/* Where a prior line passes an end. */
typedef struct txi_near {
    float at;     /* index and fraction of the line's points; -1: it does not                     */
    float offset; /* of the end, pixels to the right of the line                                  */
} txi_near;

/* What pairs are made from. */
typedef struct txi_pairs {
    const txi_window *w;
    const txi_lines *l;
    const txi_prior *prior; /* or NULL                                                            */
    txi_near *passes;       /* one per end and prior line                                         */
    txi_rules rules;
    txi_grown growth;
    float alpha;
} txi_pairs;

static txi_rules txi_rules_of(int structure) {
    txi_rules picture = {3, 0.8, 0.3, 1, 1, 1.5, 0.25, 1}, pattern = {6, 0.45, 2, 0.6, 1, 1.5, 0.25, 0};
    return structure == TEXINPAINT_PATTERN ? pattern : picture;
}

#define TXI_SIDE_COST 0.015  /* per level of difference of the colours on one side; ours            */
#define TXI_ANGLE_ERROR 1 /* pixels: of a direction, times the length it was measured on; ours    */

/* ---- curves ------------------------------------------------------------------------------ */

/* The cubic from p in direction d to q, where it arrives against direction e (e points back into the
   hole). Speeds at both ends: chord * 2 / (1 + cos of the angle to the chord), which makes a good
   circle of a circle's ends. */
static void txi_hermite(txm_vec2 p, txm_vec2 d, txm_vec2 q, txm_vec2 e, int steps, txm_vec2 *out) {
    const double cx = (double)q.x - p.x, cy = (double)q.y - p.y, chord = sqrt(cx * cx + cy * cy);
    const double n = chord > 0 ? chord : 1;
    const double cd = (d.x * cx + d.y * cy) / n, ce = -(e.x * cx + e.y * cy) / n;
    const double sd = chord * 2 / (1 + (cd > 0 ? cd : 0)), se = chord * 2 / (1 + (ce > 0 ? ce : 0));
    for (int i = 0; i <= steps; i++) {
        const double t = (double)i / steps, u = 1 - t;
        const double h0 = u * u * (1 + 2 * t), h1 = t * u * u * sd, g0 = t * t * (3 - 2 * t);
        const double g1 = t * t * u * se;
        out[i] = txm_v2(txm_float(h0 * p.x + h1 * d.x + g0 * q.x + g1 * e.x),
                        txm_float(h0 * p.y + h1 * d.y + g0 * q.y + g1 * e.y));
    }
}

/* Directions are known to some degrees only, the less the shorter the piece is that they were measured
   on. Within that, turn both ends towards an arc, whose ends have opposite angles to the chord, and if
   that is nearly straight towards the chord. So two edges of a bar stay parallel. */
static void txi_straighten(const txi_end *a, const txi_end *b, txm_vec2 *d, txm_vec2 *e) {
    const txm_vec2 c = txi_unit((double)b->place.x - a->place.x, (double)b->place.y - a->place.y);
    const double fa = a->fit_length > 6 ? a->fit_length : 6, fb = b->fit_length > 6 ? b->fit_length : 6;
    const double va = TXI_ANGLE_ERROR / fa, vb = TXI_ANGLE_ERROR / fb; /* largest errors              */
    const double ca = (double)c.x * a->heading.x + (double)c.y * a->heading.y;
    const double cb = -((double)c.x * b->heading.x + (double)c.y * b->heading.y);
    *d = a->heading;
    *e = b->heading;
    if (ca < 0.7 || cb < 0.7) return;
    /* sines of the angles from the chord: of the start, and of the direction in which it arrives     */
    double sa = (double)c.x * a->heading.y - (double)c.y * a->heading.x;
    double sb = -((double)c.x * b->heading.y - (double)c.y * b->heading.x);
    const double excess = sa + sb, most = va + vb; /* 0 for an arc                                  */
    const double share = excess > most ? 1 : excess < -most ? -1 : excess / most;
    sa -= share * va;
    sb -= share * vb;
    const double mean = 0.5 * (sa - sb), least = va < vb ? va : vb;
    const double less = mean > least ? least : mean < -least ? -least : mean;
    sa -= less;
    sb += less;
    const double da = sqrt(1 - sa * sa), db = sqrt(1 - sb * sb);
    *d = txi_unit(c.x * da - c.y * sa, c.y * da + c.x * sa);
    *e = txi_unit(-(c.x * db - c.y * sb), -(c.y * db + c.x * sb));
}

/* Length of a line, and its bending energy: length times the integral of squared curvature, which is
   the squared angle for an arc, whatever its size. */
static void txi_bend(const txm_vec2 *p, int count, double *length, double *bend) {
    double sum = 0, energy = 0;
    for (int i = 1; i < count; i++) {
        const double step = txi_distance(p[i], p[i - 1]);
        sum += step;
        if (i < 2 || step <= 0) continue;
        const double before = txi_distance(p[i - 1], p[i - 2]);
        if (before <= 0) continue;
        const double dot = ((double)p[i].x - p[i - 1].x) * ((double)p[i - 1].x - p[i - 2].x) +
                           ((double)p[i].y - p[i - 1].y) * ((double)p[i - 1].y - p[i - 2].y);
        /* squared angle, to second order 2 (1 - cos); over a half turn it is 4, enough          */
        energy += 2 * (1 - dot / (step * before)) / (0.5 * (step + before));
    }
    *length = sum;
    *bend = energy > 0 ? sum * energy : 0;
}

/* How far a line runs outside of the hole, more than a pixel from it, as a share of its length. */
static double txi_outside(const txi_window *w, const txi_lines *l, const txm_vec2 *p, int count) {
    int out = 0;
    for (int i = 0; i < count; i++) {
        const ptrdiff_t at = txi_pixel(w->width, w->height, p[i].x, p[i].y);
        out += at < 0 || (w->state[at] != TXI_HOLE && l->away[at] > 4);
    }
    return (double)out / count;
}

/* ---- prior lines ------------------------------------------------------------------------- */

enum { TXI_PRIOR_CATCH = 12 }; /* pixels; ends as near as that to a prior line follow it; ours     */

static int txi_prior_points(const txi_prior *prior, int line, const txm_vec2 **points) {
    *points = prior->points + prior->starts[line];
    return prior->starts[line + 1] - prior->starts[line];
}

/* The point of a line at an index and fraction, and its direction there. */
static txm_vec2 txi_prior_at(const txm_vec2 *p, int count, double at, txm_vec2 *along) {
    const int i = txm_clampi((int)at, 0, count - 2);
    const int low = i > 2 ? i - 2 : 0, high = i + 3 < count ? i + 3 : count - 1;
    *along = txi_unit((double)p[high].x - p[low].x, (double)p[high].y - p[low].y);
    return txi_between(p[i], p[i + 1], at - i);
}

/* Where a line passes an end: within 12 pixels and 45 degrees. */
static txi_near txi_prior_near(const txi_prior *prior, int line, const txi_end *e) {
    const txm_vec2 *p;
    const int count = txi_prior_points(prior, line, &p);
    double best = TXI_PRIOR_CATCH * TXI_PRIOR_CATCH;
    txi_near near_end = {-1, 0};
    for (int i = 0; i + 1 < count; i++) {
        const double ux = (double)p[i + 1].x - p[i].x, uy = (double)p[i + 1].y - p[i].y;
        const double vx = (double)e->place.x - p[i].x, vy = (double)e->place.y - p[i].y;
        const double uu = ux * ux + uy * uy;
        double t = uu > 0 ? (ux * vx + uy * vy) / uu : 0;
        t = t < 0 ? 0 : t > 1 ? 1 : t;
        const double dx = vx - t * ux, dy = vy - t * uy, d = dx * dx + dy * dy;
        if (d >= best) continue;
        best = d;
        near_end.at = txm_float(i + t);
    }
    if (near_end.at < 0) return near_end;
    txm_vec2 along;
    const txm_vec2 foot = txi_prior_at(p, count, near_end.at, &along);
    const double x = (double)e->place.x - foot.x, y = (double)e->place.y - foot.y;
    near_end.offset = txm_float(y * along.x - x * along.y);
    if (fabs((double)along.x * e->heading.x + (double)along.y * e->heading.y) < 0.7) near_end.at = -1;
    return near_end;
}

/* The curve of a candidate that follows a prior line from place p, direction d, to place q, direction
   e (into the hole both): the line, moved by the distance of the ends from it, and the cubic near the
   ends. */
static void txi_prior_curve(const txi_prior *prior, const txi_link *k, txm_vec2 p, txm_vec2 d,
                            txm_vec2 q, txm_vec2 e, int steps, txm_vec2 *out) {
    const txm_vec2 *line;
    const int count = txi_prior_points(prior, k->line, &line);
    txm_vec2 along;
    txi_hermite(p, d, q, e, steps, out);
    const txm_vec2 a = txi_prior_at(line, count, k->from, &along);
    const double oa = ((double)p.y - a.y) * along.x - ((double)p.x - a.x) * along.y;
    const txm_vec2 b = txi_prior_at(line, count, k->to, &along);
    const double ob = ((double)q.y - b.y) * along.x - ((double)q.x - b.x) * along.y;
    const double chord = txi_distance(p, q), length = chord > 1 ? chord : 1;
    for (int i = 1; i < steps; i++) {
        const double t = (double)i / steps, offset = oa + (ob - oa) * t;
        txm_vec2 at = txi_prior_at(line, count, k->from + ((double)k->to - k->from) * t, &along);
        at = txm_v2(txm_float(at.x - offset * along.y), txm_float(at.y + offset * along.x));
        double s = (t < 0.5 ? t : 1 - t) * length / (double)TXI_PRIOR_CATCH; /* 1: the line alone          */
        s = s > 1 ? 1 : s * s * (3 - 2 * s);
        out[i] = txi_between(out[i], at, s);
    }
}

/* The curve of a candidate, steps + 1 points. */
static void txi_link_curve(const txi_pairs *pairs, const txi_link *k, int steps, txm_vec2 *out) {
    const txi_end *a = &pairs->l->ends[k->a], *b = k->b >= 0 ? &pairs->l->ends[k->b] : NULL;
    const txm_vec2 q = b ? b->place : k->leave;
    txm_vec2 d = a->heading, e = b ? b->heading : k->backwards;
    if (b) txi_straighten(a, b, &d, &e);
    if (k->line >= 0) txi_prior_curve(pairs->prior, k, a->place, d, q, e, steps, out);
    else txi_hermite(a->place, d, q, e, steps, out);
}

/* The prior line that passes both ends nearest, into the candidate; 0: none. b = -1: any line near a. */
static int txi_prior_choose(const txi_pairs *pairs, int a, int b, txi_link *k) {
    const int lines = pairs->prior ? pairs->prior->line_count : 0;
    double best = 1e9;
    k->line = -1;
    for (int i = 0; i < lines; i++) {
        const txi_near *p = &pairs->passes[(size_t)a * (size_t)lines + (size_t)i];
        const txi_near *q = b >= 0 ? &pairs->passes[(size_t)b * (size_t)lines + (size_t)i] : p;
        if (p->at < 0 || q->at < 0) continue;
        if (b >= 0 && fabs((double)p->at - q->at) < 2) continue;
        const double d = fabs((double)p->offset) + fabs((double)q->offset) + 2 * fabs((double)p->offset - q->offset);
        if (d >= best) continue;
        best = d;
        k->line = i;
        k->from = p->at;
        k->to = q->at;
    }
    return k->line >= 0;
}

/* ---- costs ------------------------------------------------------------------------------- */

/* How well the colours of two ends go together: one enters the hole where the other leaves it, so
   left is right. correlation -1..1; mismatch: difference over contrast; sides: difference of the
   colours left and right, levels. */
static void txi_compare(const txi_end *a, const txi_end *b, double *correlation, double *mismatch,
                        double sides[2]) {
    const int mid = TXI_PROFILE / 2;
    double mean[2][3] = {{0}}, aa = 0, bb = 0, ab = 0, difference = 0, total = 0;
    double side[2][3] = {{0}};
    for (int k = 0; k < TXI_PROFILE; k++) {
        const double o = 0.5 * (k - mid), w = 1 / (1 + o * o / 6); /* less far from the line       */
        total += w;
        for (int c = 0; c < 3; c++) {
            mean[0][c] += w * a->profile[k][c];
            mean[1][c] += w * b->profile[TXI_PROFILE - 1 - k][c];
        }
    }
    for (int k = 0; k < TXI_PROFILE; k++) {
        const double o = 0.5 * (k - mid), w = 1 / (1 + o * o / 6);
        for (int c = 0; c < 3; c++) {
            const double p = a->profile[k][c], q = b->profile[TXI_PROFILE - 1 - k][c];
            const double u = p - mean[0][c] / total, v = q - mean[1][c] / total;
            aa += w * u * u;
            bb += w * v * v;
            ab += w * u * v;
            difference += w * fabs(p - q);
            if (k < mid - 1 && k > mid - 8) side[0][c] += (p - q) / 6;
            if (k > mid + 1 && k < mid + 8) side[1][c] += (p - q) / 6;
        }
    }
    *correlation = aa > 0 && bb > 0 ? ab / sqrt(aa * bb) : 0;
    *mismatch = difference / (3 * total) / (0.5 * ((double)a->contrast + b->contrast) + 10);
    for (int s = 0; s < 2; s++)
        sides[s] = sqrt((side[s][0] * side[s][0] + side[s][1] * side[s][1] + side[s][2] * side[s][2]) / 3);
}

/* The mean curvature of an arc from a to b, to compare with the curvatures of the ends. */
static double txi_turn(const txi_link *k) {
    const txm_vec2 *p = k->points;
    double sum = 0;
    for (int i = 2; i <= TXI_STEPS; i++) {
        const double ax = (double)p[i - 1].x - p[i - 2].x, ay = (double)p[i - 1].y - p[i - 2].y;
        const double bx = (double)p[i].x - p[i - 1].x, by = (double)p[i].y - p[i - 1].y;
        const double n = sqrt((ax * ax + ay * ay) * (bx * bx + by * by));
        if (n > 0) sum += (ax * by - ay * bx) / n; /* sine of the angle                            */
    }
    return k->length > 0 ? sum / k->length : 0;
}

static void txi_link_box(txi_link *k) {
    k->low = k->high = k->points[0];
    for (int i = 1; i <= TXI_STEPS; i++) {
        k->low.x = txm_minf(k->low.x, k->points[i].x);
        k->low.y = txm_minf(k->low.y, k->points[i].y);
        k->high.x = txm_maxf(k->high.x, k->points[i].x);
        k->high.y = txm_maxf(k->high.y, k->points[i].y);
    }
}

/* Length and bending energy of a candidate whose ends are set, and its box. 0: it runs outside of the
   hole. */
static int txi_link_measure(const txi_pairs *pairs, txi_link *k) {
    double length, bend;
    txi_link_curve(pairs, k, TXI_STEPS, k->points);
    txi_bend(k->points, TXI_STEPS + 1, &length, &bend);
    k->length = txm_float(length);
    k->bend = txm_float(bend);
    txi_link_box(k);
    return length >= 2 && txi_outside(pairs->w, pairs->l, k->points, TXI_STEPS + 1) <= 0.12;
}

/* The candidate of ends a and b; 0 if they cannot belong together. */
static int txi_link_ends(const txi_pairs *pairs, int a, int b, txi_link *k) {
    const txi_lines *l = pairs->l;
    const txi_end *p = &l->ends[a], *q = &l->ends[b];
    double correlation, mismatch, sides[2], shape;
    txi_compare(p, q, &correlation, &mismatch, sides);
    if (correlation < 0.3 && sides[0] > 30 && sides[1] > 30) return 0;
    if (correlation < -0.2) return 0;
    k->a = a;
    k->b = b;
    if (txi_prior_choose(pairs, a, b, k) && !txi_link_measure(pairs, k)) k->line = -1;
    if (k->line < 0 && !txi_link_measure(pairs, k)) return 0;
    if (k->line < 0) {
        const double turn = txi_turn(k);
        const double misfit =
            (fabs(p->curvature - turn) + fabs(-q->curvature - turn)) * 0.5 * k->length;
        shape = pairs->rules.bend * k->bend + 0.3 * (misfit < 3 ? misfit : 3);
    } else { /* it bends as the prior line does                                                    */
        const int lines = pairs->prior->line_count;
        const txi_near *u = &pairs->passes[(size_t)a * (size_t)lines + (size_t)k->line];
        const txi_near *v = &pairs->passes[(size_t)b * (size_t)lines + (size_t)k->line];
        shape = 0.1 * fabs((double)u->offset - v->offset) - pairs->rules.prior;
    }
    const double u = (double)p->contrast + 2, v = (double)q->contrast + 2;
    k->cost = txm_float(shape + 3 * (1 - correlation) + 2 * (mismatch < 2 ? mismatch : 2) +
                        TXI_SIDE_COST * (sides[0] > sides[1] ? sides[0] : sides[1]) +
                        0.6 * fabs(u - v) / (u + v) + 0.6 * k->length / (l->width > 8 ? l->width : 8) +
                        0.3 * !p->is_long + 0.3 * !q->is_long);
    return 1;
}

/* What the votes say about a candidate, -1..1: how far they agree with its curve, on average. */
static double txi_affinity(const txi_grown *g, const txi_link *k) {
    double sum = 0;
    for (int i = 2; i <= TXI_STEPS - 2; i += 2) {
        const txm_vec2 p = k->points[i - 1], q = k->points[i + 1];
        const txm_vec2 d = txi_unit((double)q.x - p.x, (double)q.y - p.y);
        sum += txi_votes_agree(g, k->points[i].x, k->points[i].y, d.x, d.y);
    }
    return sum / ((TXI_STEPS - 2) * 0.5);
}

/* ---- looking ahead ----------------------------------------------------------------------- */

/* Does a line of the same colours end where end e would leave the hole? Then the two can be joined. */
static int txi_end_there(const txi_lines *l, const txi_end *e, const txi_link *k) {
    for (int i = 0; i < l->end_count; i++) {
        const txi_end *o = &l->ends[i];
        double correlation, mismatch, sides[2];
        const double d = (double)o->heading.x * k->backwards.x + (double)o->heading.y * k->backwards.y;
        if (o == e || d < 0.8 || txi_distance(o->place, k->leave) > 8) continue;
        txi_compare(e, o, &correlation, &mismatch, sides);
        if (correlation > 0.7 && mismatch < 0.3) return 1;
    }
    return 0;
}

/* Continue end a straight on (along its fitted curve) to the other side of the hole, and look for a
   line there that could be its continuation although it does not end at the hole, as other lines
   cross it there: at least 10 of 45 pixels on which a point lies within 6 pixels, in its direction and
   with the same polarity. 0: there is none. */
static int txi_look_ahead(const txi_pairs *pairs, int a, txi_link *k) {
    const txi_window *w = pairs->w;
    const txi_lines *l = pairs->l;
    const txi_end *e = &l->ends[a];
    const double turn = fabs((double)e->curvature) * l->width < 1.5 ? e->curvature : 0;
    double x = e->place.x, y = e->place.y, dx = e->heading.x, dy = e->heading.y, change[3];
    double offset = 0, offsets[TXI_LOOK_AHEAD];
    int inside = 0, beyond = 0, hits = 0, first = 0;
    txm_vec2 exit = e->place, direction = e->heading;
    for (int c = 0; c < 3; c++) change[c] = (double)e->profile[13][c] - e->profile[7][c];
    for (int i = 0; i < 4 * (w->width + w->height) && beyond < TXI_LOOK_AHEAD; i++) {
        x += dx;
        y += dy;
        const txm_vec2 d = txi_unit(dx - turn * dy, dy + turn * dx);
        dx = d.x;
        dy = d.y;
        const ptrdiff_t at = txi_pixel(w->width, w->height, x, y);
        if (at < 0 || w->state[at] == TXI_VOID) break;
        if (w->state[at] == TXI_HOLE) {
            if (beyond) break;
            inside++;
            exit = txm_v2(txm_float(x), txm_float(y));
            direction = d;
            continue;
        }
        if (inside < 4) {
            if (i > 4) return 0;
            continue;
        }
        double best = 6.5;
        for (int o = 0; o <= 12; o++) { /* the nearest fitting point to either side                 */
            const int s = o & 1 ? -(o + 1) / 2 : o / 2;
            const ptrdiff_t i2 = txi_pixel(w->width, w->height, x - s * dy, y + s * dx);
            if (i2 < 0 || l->thin_at[i2] < 0 || fabs(best) < 6.5) continue;
            const txi_thin *t = &l->thin[l->thin_at[i2]];
            double other[3];
            txi_change_at(&l->field, (size_t)i2, -dy, dx, other);
            if (fabs(t->along.x * dx + t->along.y * dy) < 0.94 || txi_agree(change, other) < 0.7) continue;
            best = (t->place.x - x) * -dy + (t->place.y - y) * dx;
        }
        if (fabs(best) < 6.5) {
            if (!hits) first = beyond;
            TXM_ASSERT(hits < TXI_LOOK_AHEAD);
            offsets[hits++] = best;
        }
        beyond++;
    }
    if (hits < 10 || first > 25 || inside < 6) return 0;
    for (int i = 0; i < hits; i++) offset += offsets[i] / hits;
    k->a = a;
    k->b = -1;
    k->leave = txm_v2(txm_float(exit.x - offset * direction.y), txm_float(exit.y + offset * direction.x));
    k->backwards = txm_v2(-direction.x, -direction.y);
    k->line = -1;
    if (txi_end_there(l, e, k) || !txi_link_measure(pairs, k)) return 0;
    k->cost = txm_float(pairs->rules.bend * k->bend + 0.6 * k->length / (l->width > 8 ? l->width : 8) +
                        0.75 - 0.02 * hits + 0.05 * fabs(offset));
    return 1;
}

/* Let end a follow a prior line to where it leaves the hole, without an end there. 0: there is none. */
static int txi_follow_prior(const txi_pairs *pairs, int a, txi_link *k) {
    const txi_window *w = pairs->w;
    const txi_end *e = &pairs->l->ends[a];
    const txm_vec2 *line;
    txm_vec2 along;
    int inside = 0;
    if (!txi_prior_choose(pairs, a, -1, k)) return 0;
    const int count = txi_prior_points(pairs->prior, k->line, &line);
    const double offset =
        pairs->passes[(size_t)a * (size_t)pairs->prior->line_count + (size_t)k->line].offset;
    txi_prior_at(line, count, k->from, &along);
    const int step = (double)along.x * e->heading.x + (double)along.y * e->heading.y > 0 ? 1 : -1;
    for (int i = (int)k->from + step; i >= 0 && i < count; i += step) {
        const txm_vec2 p = txi_prior_at(line, count, i, &along);
        const double x = p.x - offset * along.y, y = p.y + offset * along.x;
        const ptrdiff_t at = txi_pixel(w->width, w->height, x, y);
        if (at < 0 || w->state[at] != TXI_HOLE) {
            if (inside || at < 0 || abs(i - (int)k->from) > 8) break;
            continue;
        }
        inside++;
        k->to = (float)i;
        k->leave = txm_v2(txm_float(x), txm_float(y));
        k->backwards = txm_v2(-(float)step * along.x, -(float)step * along.y);
    }
    k->a = a;
    k->b = -1;
    if (inside < 6 || !txi_link_measure(pairs, k)) return 0;
    k->cost = txm_float(0.9 + 0.6 * k->length / (pairs->l->width > 8 ? pairs->l->width : 8) -
                        0.5 * pairs->rules.prior);
    return 1;
}

/* ---- candidates -------------------------------------------------------------------------- */

/* Let lines grow, and find out which prior lines pass which ends. */
static txm_status txi_pairs_make(txi_pairs *pairs, const txi_window *w, const txi_lines *l,
                                 const txi_prior *prior, int structure, float alpha, int beta,
                                 txm_arena *scratch, txm_env *env) {
    const int lines = prior ? prior->line_count : 0;
    memset(pairs, 0, sizeof *pairs);
    pairs->w = w;
    pairs->l = l;
    pairs->prior = lines > 0 ? prior : NULL;
    pairs->rules = txi_rules_of(structure);
    pairs->alpha = alpha;
    if (lines > 0) {
        pairs->passes = (txi_near *)txm_arena_alloc(scratch, (size_t)l->end_count * (size_t)lines,
                                                    sizeof *pairs->passes);
        if (!pairs->passes) return txi_no_memory(env);
        for (int i = 0; i < l->end_count * lines; i++)
            pairs->passes[i] = txi_prior_near(prior, i % lines, &l->ends[i / lines]);
    }
    return txi_grow(&pairs->growth, w, l, alpha, beta, scratch, env);
}

/* What is saved by a candidate, as its ends are no longer unmatched. */
static double txi_saved_by(const txi_lines *l, const txi_rules *rules, const txi_link *k) {
    double sum = l->ends[k->a].is_long ? 1 : rules->weak;
    if (k->b >= 0) sum += l->ends[k->b].is_long ? 1 : rules->weak;
    return rules->unmatched * sum;
}

/* Another candidate of an end, which has those from start on: the best TXI_PER_END are kept. */
static void txi_keep_link(const txi_pairs *pairs, const txi_link *k, txi_link *links, int start,
                          int *count) {
    if (k->cost >= txi_saved_by(pairs->l, &pairs->rules, k)) return;
    if (*count - start < TXI_PER_END) {
        if (*count < TXI_MAX_LINKS) links[(*count)++] = *k;
        return;
    }
    int worst = start;
    for (int i = start; i < *count; i++) {
        if (links[i].cost > links[worst].cost) worst = i;
    }
    if (k->cost < links[worst].cost) links[worst] = *k;
}

/* Candidates of all ends into links (room for TXI_MAX_LINKS), if they are better than no join. Returns
   how many. */
static int txi_candidates(const txi_pairs *pairs, txi_link *links) {
    const txi_lines *l = pairs->l;
    int count = 0;
    for (int a = 0; a < l->end_count; a++) {
        const int start = count;
        txi_link k;
        memset(&k, 0, sizeof k);
        for (int b = a + 1; b < l->end_count; b++) {
            const double d = txi_distance(l->ends[a].place, l->ends[b].place);
            if ((pairs->alpha > 0 && d > pairs->alpha) || !txi_link_ends(pairs, a, b, &k)) continue;
            const int met = pairs->growth.met[(size_t)a * (size_t)l->end_count + (size_t)b];
            k.cost = txm_float(k.cost - pairs->rules.votes * txi_affinity(&pairs->growth, &k) -
                               (met ? pairs->rules.met : 0));
            txi_keep_link(pairs, &k, links, start, &count);
        }
        if (pairs->rules.look_ahead && l->ends[a].is_long && txi_look_ahead(pairs, a, &k)) {
            k.cost = txm_float(k.cost - pairs->rules.votes * txi_affinity(&pairs->growth, &k));
            txi_keep_link(pairs, &k, links, start, &count);
        }
        if (pairs->prior && txi_follow_prior(pairs, a, &k))
            txi_keep_link(pairs, &k, links, start, &count);
    }
    return count;
}

#endif /* TEXINPAINT_PAIR_H */
