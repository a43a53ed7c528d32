#ifndef TEXINPAINT_JOIN_H
#define TEXINPAINT_JOIN_H

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
    TXI_MOVES = 60000,     /* of the annealing; ours                                             */
    TXI_KNOWN_PART = 120   /* pixels of a curve outside of the hole, on each side                */
};

/* A candidate: two ends and the curve between them, or one end and a place where it leaves the hole. */
typedef struct txi_link {
    int a, b;          /* ends; b = -1: no end there                                             */
    float cost, bend, length;
    txm_vec2 leave;    /* with b = -1: where it leaves the hole,                                  */
    txm_vec2 backwards; /* and the direction there, into the hole, unit                           */
    txm_vec2 low, high; /* bounding box                                                          */
    txm_vec2 points[TXI_STEPS + 1];
} txi_link;

/* What a way of joining costs. All without unit; ours, from the recipe's experiments. */
typedef struct txi_rules {
    double unmatched; /* an end that is not joined                                               */
    double crossing;  /* two curves that cross                                                   */
    double bend;      /* factor of the bending energy                                            */
    double votes;     /* less for votes that agree with the curve                                */
    double met;       /* less for lines that met when they grew                                  */
    int look_ahead;   /* long ends may leave the hole without another end                        */
} txi_rules;

static txi_rules txi_rules_of(int structure) {
    txi_rules picture = {3, 0.3, 1, 1, 0.25, 1}, pattern = {6, 2, 0.6, 1, 0.25, 0};
    return structure == TEXINPAINT_PATTERN ? pattern : picture;
}

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

/* The candidate of ends a and b; 0 if they cannot belong together. */
static int txi_link_ends(const txi_window *w, const txi_lines *l, const txi_rules *rules, int a, int b,
                         txi_link *k) {
    const txi_end *p = &l->ends[a], *q = &l->ends[b];
    double correlation, mismatch, sides[2], length, bend;
    txi_compare(p, q, &correlation, &mismatch, sides);
    if (correlation < 0.3 && sides[0] > 30 && sides[1] > 30) return 0;
    if (correlation < -0.2) return 0;
    txi_hermite(p->place, p->heading, q->place, q->heading, TXI_STEPS, k->points);
    txi_bend(k->points, TXI_STEPS + 1, &length, &bend);
    if (length < 2 || txi_outside(w, l, k->points, TXI_STEPS + 1) > 0.12) return 0;
    k->a = a;
    k->b = b;
    k->length = txm_float(length);
    k->bend = txm_float(bend);
    const double turn = txi_turn(k);
    const double curvature = (fabs(p->curvature - turn) + fabs(-q->curvature - turn)) * 0.5 * length;
    const double u = (double)p->contrast + 2, v = (double)q->contrast + 2;
    k->cost = txm_float(rules->bend * bend + 3 * (1 - correlation) + 1.5 * (mismatch < 2 ? mismatch : 2) +
                        0.6 * fabs(u - v) / (u + v) + 0.6 * length / (l->width > 8 ? l->width : 8) +
                        0.3 * (curvature < 3 ? curvature : 3) + 0.3 * !p->is_long + 0.3 * !q->is_long);
    txi_link_box(k);
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
    return sum / (TXI_STEPS / 2 - 1);
}

/* ---- looking ahead ----------------------------------------------------------------------- */

/* Continue end a straight on (along its fitted curve) to the other side of the hole, and look for a
   line there that could be its continuation although it does not end at the hole, as other lines
   cross it there: at least 10 of 45 pixels on which a point lies within 6 pixels, in its direction and
   with the same polarity. 0: there is none. */
static int txi_look_ahead(const txi_window *w, const txi_lines *l, const txi_rules *rules, int a,
                          txi_link *k) {
    const txi_end *e = &l->ends[a];
    const double turn = fabs(e->curvature) * l->width < 1.5 ? e->curvature : 0;
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
    double length, bend;
    txi_hermite(e->place, e->heading, k->leave, k->backwards, TXI_STEPS, k->points);
    txi_bend(k->points, TXI_STEPS + 1, &length, &bend);
    k->length = txm_float(length);
    k->bend = txm_float(bend);
    k->cost = txm_float(rules->bend * bend + 0.6 * length / (l->width > 8 ? l->width : 8) +
                        0.9 - 0.02 * hits + 0.05 * fabs(offset));
    txi_link_box(k);
    return 1;
}

/* ---- matching ---------------------------------------------------------------------------- */

/* The state of the search for the matching of least cost. */
typedef struct txi_pairing {
    const txi_link *links;
    int link_count, end_count;
    double unmatched, crossing;
    uint8_t *crosses;  /* link_count squared: 0 not known yet, 1 no, 2 yes                         */
    int *chosen;       /* one per end: its link, or -1                                           */
    int *active;       /* the chosen links                                                       */
    int *slot;         /* one per link: where it is in active, or -1                             */
    int active_count;
    int *of_end, *of_start; /* links of end i: of_end[of_start[i]] .. of_end[of_start[i + 1] - 1]    */
} txi_pairing;

static int txi_segments_cross(txm_vec2 a, txm_vec2 b, txm_vec2 c, txm_vec2 d) {
    const double ux = (double)b.x - a.x, uy = (double)b.y - a.y;
    const double vx = (double)d.x - c.x, vy = (double)d.y - c.y;
    const double s = ux * ((double)c.y - a.y) - uy * ((double)c.x - a.x);
    const double t = ux * ((double)d.y - a.y) - uy * ((double)d.x - a.x);
    const double p = vx * ((double)a.y - c.y) - vy * ((double)a.x - c.x);
    const double q = vx * ((double)b.y - c.y) - vy * ((double)b.x - c.x);
    return ((s < 0) != (t < 0)) && ((p < 0) != (q < 0));
}

static int txi_links_cross(const txi_link *a, const txi_link *b) {
    if (a->low.x > b->high.x || b->low.x > a->high.x || a->low.y > b->high.y || b->low.y > a->high.y)
        return 0;
    for (int i = 0; i < TXI_STEPS; i++) {
        const float x0 = txm_minf(a->points[i].x, a->points[i + 1].x);
        const float x1 = txm_maxf(a->points[i].x, a->points[i + 1].x);
        const float y0 = txm_minf(a->points[i].y, a->points[i + 1].y);
        const float y1 = txm_maxf(a->points[i].y, a->points[i + 1].y);
        if (x0 > b->high.x || x1 < b->low.x || y0 > b->high.y || y1 < b->low.y) continue;
        for (int j = 0; j < TXI_STEPS; j++) {
            if (txi_segments_cross(a->points[i], a->points[i + 1], b->points[j], b->points[j + 1]))
                return 1;
        }
    }
    return 0;
}

static int txi_crosses(txi_pairing *m, int a, int b) {
    const size_t n = (size_t)m->link_count;
    uint8_t *c = &m->crosses[(size_t)a * n + (size_t)b];
    if (!*c) {
        *c = txi_links_cross(&m->links[a], &m->links[b]) ? 2 : 1;
        m->crosses[(size_t)b * n + (size_t)a] = *c;
    }
    return *c == 2;
}

/* What link k costs beside the active ones, apart from being matched or not. */
static double txi_link_energy(txi_pairing *m, int k) {
    double sum = m->links[k].cost;
    for (int i = 0; i < m->active_count; i++) {
        if (m->active[i] != k && txi_crosses(m, k, m->active[i])) sum += m->crossing;
    }
    return sum;
}

static void txi_activate(txi_pairing *m, int k) {
    m->slot[k] = m->active_count;
    m->active[m->active_count++] = k;
    m->chosen[m->links[k].a] = k;
    if (m->links[k].b >= 0) m->chosen[m->links[k].b] = k;
}

static void txi_deactivate(txi_pairing *m, int k) {
    const int s = m->slot[k], last = m->active[--m->active_count];
    m->active[s] = last;
    m->slot[last] = s;
    m->slot[k] = -1;
    m->chosen[m->links[k].a] = -1;
    if (m->links[k].b >= 0) m->chosen[m->links[k].b] = -1;
}

/* How much matching link k saves: its ends are no longer unmatched. */
static double txi_saved(const txi_pairing *m, int k) {
    return m->unmatched * (m->links[k].b >= 0 ? 2 : 1);
}

static double txi_remove(txi_pairing *m, int k) {
    const double change = txi_saved(m, k) - txi_link_energy(m, k);
    txi_deactivate(m, k);
    return change;
}

static double txi_insert(txi_pairing *m, int k) {
    const double change = txi_link_energy(m, k) - txi_saved(m, k);
    txi_activate(m, k);
    return change;
}

/* The link between two ends, or -1. */
static int txi_link_between(const txi_pairing *m, int a, int b) {
    for (int i = m->of_start[a]; i < m->of_start[a + 1]; i++) {
        const txi_link *k = &m->links[m->of_end[i]];
        if ((k->a == a && k->b == b) || (k->b == a && k->a == b)) return m->of_end[i];
    }
    return -1;
}

/* Try link k: it goes if it is there; else it replaces the links of its two ends, and the two ends that
   become free are joined if they can be. Kept if the energy changes by less than allowed; returns the
   change, or 0 if it was not kept. */
static double txi_pairing_try(txi_pairing *m, int k, double allowed) {
    int gone[2] = {-1, -1}, free_end[2] = {-1, -1}, extra = -1;
    double change = 0;
    if (m->slot[k] >= 0) {
        change = txi_remove(m, k);
        if (change < allowed) return change;
        txi_activate(m, k);
        return 0;
    }
    for (int s = 0; s < 2; s++) {
        const int end = s ? m->links[k].b : m->links[k].a;
        const int old = end >= 0 ? m->chosen[end] : -1;
        if (old < 0) continue;
        gone[s] = old;
        free_end[s] = m->links[old].a == end ? m->links[old].b : m->links[old].a;
        change += txi_remove(m, old);
    }
    change += txi_insert(m, k);
    if (free_end[0] >= 0 && free_end[1] >= 0) {
        extra = txi_link_between(m, free_end[0], free_end[1]);
        if (extra >= 0) {
            const double more = txi_insert(m, extra);
            if (more < 0) change += more;
            else {
                txi_deactivate(m, extra);
                extra = -1;
            }
        }
    }
    if (change < allowed) return change;
    if (extra >= 0) txi_deactivate(m, extra);
    txi_deactivate(m, k);
    for (int s = 0; s < 2; s++) {
        if (gone[s] >= 0) txi_activate(m, gone[s]);
    }
    return 0;
}

/* Simulated annealing from no joins at all; then every link is tried until none improves. best: room
   for end_count numbers. */
static void txi_anneal(txi_pairing *m, uint64_t seed, int *best) {
    txm_rng rng = txm_rng_make(seed, 0x6a6f696e);
    double energy = 0, least = 0;
    for (int i = 0; i < m->end_count; i++) best[i] = -1;
    for (int i = 0; i < TXI_MOVES && m->link_count; i++) {
        const double heat = 1.5 * txm_exp2(-7.0 * i / TXI_MOVES);
        const int k = (int)txm_rng_below(&rng, (uint32_t)m->link_count);
        const double u = txm_rng_double(&rng);
        /* accepted with probability exp(-change / heat): a change below -heat log(u)             */
        double bits = 0, v = u > 1e-9 ? u : 1e-9;
        while (v < 0.5) {
            v *= 2;
            bits += 1;
        }
        const double allowed = heat * (bits * 0.6931471805599453 + 1.4 * (1 - v) * (1.5 - 0.5 * v));
        energy += txi_pairing_try(m, k, allowed);
        if (energy < least - 1e-9) {
            least = energy;
            memcpy(best, m->chosen, (size_t)m->end_count * sizeof *best);
        }
    }
    while (m->active_count) txi_deactivate(m, m->active[m->active_count - 1]);
    for (int i = 0; i < m->end_count; i++) {
        if (best[i] >= 0 && m->slot[best[i]] < 0) txi_activate(m, best[i]);
    }
    for (int round = 0, better = 1; better && round < 50; round++) {
        better = 0;
        for (int k = 0; k < m->link_count; k++) better |= txi_pairing_try(m, k, -1e-7) < 0;
    }
}

/* ---- candidates -------------------------------------------------------------------------- */

/* Candidates of all ends into links (room for TXI_MAX_LINKS): of each end the best TXI_PER_END, if
   they are better than no join. Returns how many. */
static int txi_candidates(const txi_window *w, const txi_lines *l, const txi_rules *rules, float alpha,
                          const txi_grown *growth, txi_link *links) {
    int count = 0;
    for (int a = 0; a < l->end_count; a++) {
        int kept = 0;
        const int start = count;
        for (int b = a + 1; b <= l->end_count && count < TXI_MAX_LINKS; b++) {
            txi_link k;
            memset(&k, 0, sizeof k);
            if (b < l->end_count) {
                if (alpha > 0 && txi_distance(l->ends[a].place, l->ends[b].place) > alpha) continue;
                if (!txi_link_ends(w, l, rules, a, b, &k)) continue;
            } else if (!rules->look_ahead || !l->ends[a].is_long ||
                       !txi_look_ahead(w, l, rules, a, &k)) {
                continue;
            }
            k.cost = txm_float(k.cost - rules->votes * txi_affinity(growth, &k) -
                               (k.b >= 0 && growth->met[a * l->end_count + k.b] ? rules->met : 0));
            if (k.cost >= rules->unmatched * (k.b >= 0 ? 2 : 1)) continue;
            if (kept < TXI_PER_END) {
                links[count++] = k;
                kept++;
                continue;
            }
            int worst = start;
            for (int i = start; i < count; i++) {
                if (links[i].cost > links[worst].cost) worst = i;
            }
            if (k.cost < links[worst].cost) links[worst] = k;
        }
    }
    return count;
}

static txm_status txi_pairing_make(txi_pairing *m, const txi_link *links, int count, int ends,
                                 const txi_rules *rules, txm_arena *scratch, txm_env *env) {
    const size_t n = (size_t)count, e = (size_t)ends;
    memset(m, 0, sizeof *m);
    m->links = links;
    m->link_count = count;
    m->end_count = ends;
    m->unmatched = rules->unmatched;
    m->crossing = rules->crossing;
    m->crosses = (uint8_t *)txm_arena_zero(scratch, n, n);
    m->chosen = (int *)txm_arena_alloc(scratch, e, sizeof(int));
    m->active = (int *)txm_arena_alloc(scratch, n, sizeof(int));
    m->slot = (int *)txm_arena_alloc(scratch, n, sizeof(int));
    m->of_end = (int *)txm_arena_alloc(scratch, n, 2 * sizeof(int));
    m->of_start = (int *)txm_arena_zero(scratch, e + 2, sizeof(int));
    if (scratch->failed) return txi_no_memory(env);
    for (int i = 0; i < ends; i++) m->chosen[i] = -1;
    for (int k = 0; k < count; k++) {
        m->slot[k] = -1;
        m->of_start[links[k].a + 2]++;
        if (links[k].b >= 0) m->of_start[links[k].b + 2]++;
    }
    for (int i = 0; i < ends; i++) m->of_start[i + 2] += m->of_start[i + 1];
    for (int k = 0; k < count; k++) {
        m->of_end[m->of_start[links[k].a + 1]++] = k;
        if (links[k].b >= 0) m->of_end[m->of_start[links[k].b + 1]++] = k;
    }
    return TXM_OK;
}

/* ---- the curves -------------------------------------------------------------------------- */

/* Points about a pixel apart along a line into out; returns how many, at most room. */
static int txi_resample(const txm_vec2 *p, int count, txm_vec2 *out, int room) {
    double length = 0, at = 0;
    for (int i = 1; i < count; i++) length += txi_distance(p[i], p[i - 1]);
    int n = (int)(length + 0.5) + 1;
    n = n < 2 ? 2 : n > room ? room : n;
    const double step = length / (n - 1);
    int k = 0;
    for (int i = 0; i < n; i++) {
        const double target = i * step;
        double piece = k + 1 < count ? txi_distance(p[k], p[k + 1]) : 0;
        while (k + 2 < count && at + piece < target) {
            at += piece;
            k++;
            piece = txi_distance(p[k], p[k + 1]);
        }
        const double t = piece > 0 ? (target - at) / piece : 0;
        out[i] = k + 1 < count ? txi_between(p[k], p[k + 1], t < 0 ? 0 : t > 1 ? 1 : t) : p[k];
    }
    return n;
}

/* The known part of the line of an end: point s pixels outwards from the border. First the fitted
   curve, so that it goes into the hole without a kink, further out the points as traced. */
static txm_vec2 txi_known_point(const txi_lines *l, const txi_end *e, int s) {
    const txm_vec2 *p = l->points + e->first;
    const double gap = txi_distance(p[0], e->place); /* the first traced point is that far out     */
    const double x = (double)e->fit[0] + e->fit[1] * (double)s + e->fit[2] * (double)s * s;
    const double y = (double)e->fit[3] + e->fit[4] * (double)s + e->fit[5] * (double)s * s;
    const double at = s - gap;
    int i = at > 0 ? (int)at : 0;
    if (i > e->count - 2) i = e->count - 2;
    const txm_vec2 traced = txi_between(p[i], p[i + 1], at - i < 0 ? 0 : at - i > 1 ? 1 : at - i);
    const double t = s < 4 ? 0 : s > 12 ? 1 : (s - 4) / 8.0;
    return txi_between(txm_v2(txm_float(x), txm_float(y)), traced, t * t * (3 - 2 * t));
}

static int txi_known_count(const txi_end *e) {
    const int n = e->count - 1;
    return n < TXI_KNOWN_PART ? n : TXI_KNOWN_PART;
}

/* A chosen link as a curve with its known parts. dense, fine: room for room points */
static txm_status txi_curve_make(const txi_window *w, const txi_lines *l, const txi_link *k,
                                 txm_vec2 *dense, txm_vec2 *fine, int room, txm_arena *arena,
                                 txm_env *env, txi_curve *c) {
    const txi_end *a = &l->ends[k->a], *b = k->b >= 0 ? &l->ends[k->b] : NULL;
    int n = 0, m;
    const int head = txi_known_count(a), tail = b ? txi_known_count(b) : 0;
    for (int s = head; s > 0; s--) dense[n++] = txi_known_point(l, a, s);
    txi_hermite(a->place, a->heading, b ? b->place : k->leave, b ? b->heading : k->backwards, 4 * TXI_STEPS,
              fine);
    m = txi_resample(fine, 4 * TXI_STEPS + 1, dense + n, room - n - TXI_KNOWN_PART);
    n += m;
    for (int s = 1; s <= tail; s++) dense[n++] = txi_known_point(l, b, s);
    c->points = (txm_vec2 *)txm_arena_alloc(arena, (size_t)n, sizeof *c->points);
    if (!c->points) return txi_no_memory(env);
    memcpy(c->points, dense, (size_t)n * sizeof *dense);
    c->count = n;
    c->first = -1;
    c->last = -1;
    for (int i = 0; i < n; i++) {
        const ptrdiff_t at = txi_pixel(w->width, w->height, dense[i].x, dense[i].y);
        if (at < 0 || w->state[at] != TXI_HOLE) continue;
        if (c->first < 0) c->first = i;
        c->last = i;
    }
    c->ends[0] = k->a;
    c->ends[1] = k->b;
    c->strength = b ? 0.5f * (a->contrast + b->contrast) : a->contrast;
    c->partner = -1;
    return TXM_OK;
}

/* Join the lines that end at the hole.

   prior      lines that attract, or NULL
   structure  TEXINPAINT_PICTURE or TEXINPAINT_PATTERN; TEXINPAINT_TEXTURE: no curves
   alpha      the largest distance of two ends that are joined, pixels; 0 = no limit
   beta       rounds over which lines grow by votes; 0 = as many as it takes
   curves     receives *count curves, in the arena                                             */
static txm_status txi_join(const txi_window *w, const txi_lines *l, const txi_prior *prior, int structure,
                           float alpha, int beta, uint64_t seed, txm_arena *arena, txm_env *env,
                           txi_curve **curves, int *count) {
    const txi_rules rules = txi_rules_of(structure);
    const int room = 8 * (w->width + w->height) + 2 * TXI_KNOWN_PART + 8;
    txm_arena scratch;
    txi_pairing match;
    txi_grown growth;
    txm_status status = TXM_OK;
    (void)prior;
    *curves = NULL;
    *count = 0;
    if (structure == TEXINPAINT_TEXTURE || l->end_count == 0) return TXM_OK;
    txm_arena_init(&scratch, env);
    txi_link *links = (txi_link *)txm_arena_alloc(&scratch, TXI_MAX_LINKS, sizeof *links);
    int *best = (int *)txm_arena_alloc(&scratch, (size_t)l->end_count, sizeof *best);
    txm_vec2 *dense = (txm_vec2 *)txm_arena_alloc(&scratch, (size_t)room, 2 * sizeof *dense);
    if (scratch.failed) status = txi_no_memory(env);
    if (status == TXM_OK) status = txi_grow(&growth, w, l, alpha, beta, &scratch, env);
    if (status == TXM_OK) {
        const int n = txi_candidates(w, l, &rules, alpha, &growth, links);
        status = n ? txi_pairing_make(&match, links, n, l->end_count, &rules, &scratch, env) : TXM_OK;
        if (status == TXM_OK && n) {
            txi_anneal(&match, seed, best);
            *curves = (txi_curve *)txm_arena_alloc(arena, (size_t)match.active_count, sizeof **curves);
            if (arena->failed) status = txi_no_memory(env);
            for (int k = 0; k < n && status == TXM_OK; k++) {
                if (match.slot[k] < 0) continue;
                txi_curve c;
                status = txi_curve_make(w, l, &links[k], dense, dense + room, room, arena, env, &c);
                if (status == TXM_OK && c.first >= 0) (*curves)[(*count)++] = c;
            }
        }
    }
    txm_arena_free(&scratch);
    return status;
}

/* ---- what a result keeps of the lines ---------------------------------------------------- */

enum { TXI_GO_ON = 8 }; /* pixels inside of the hole over which a line should go on                */

/* Over how many of 8 pixels inside of the hole a line of the result follows the continuation of an end:
   no farther than 2.5 pixels, within 25 degrees, with the same polarity and 0.45 to 2.2 times the
   strength. */
static int txi_goes_on(const txi_window *w, const txi_slopes *f, const txi_end *e) {
    txi_walk k;
    int n = 0;
    k.x = (double)e->fit[0] + 2.0 * e->fit[1] + 4.0 * e->fit[2];
    k.y = (double)e->fit[3] + 2.0 * e->fit[4] + 4.0 * e->fit[5];
    const txm_vec2 d = txi_unit(-e->fit[1] - 4.0 * e->fit[2], -e->fit[4] - 4.0 * e->fit[5]);
    k.dx = d.x;
    k.dy = d.y;
    txi_centre(f, -k.dy, k.dx, &k.x, &k.y);
    const ptrdiff_t from = txi_pixel(w->width, w->height, k.x, k.y);
    if (from < 0) return 0;
    txi_change_at(f, (size_t)from, -k.dy, k.dx, k.change);
    for (int i = 0; i < 12 && n < TXI_GO_ON; i++) {
        if (!txi_walk_on(f, &k, 1, 0.45 * e->strength)) break;
        const ptrdiff_t at = txi_pixel(w->width, w->height, k.x, k.y);
        if (w->state[at] != TXI_HOLE) continue;
        const double s = -(n + 0.5), dx = -(e->fit[1] + 2 * e->fit[2] * s);
        const double dy = -(e->fit[4] + 2 * e->fit[5] * s), speed = sqrt(dx * dx + dy * dy);
        const double ox = k.x - (e->fit[0] + e->fit[1] * s + e->fit[2] * s * s);
        const double oy = k.y - (e->fit[3] + e->fit[4] * s + e->fit[5] * s * s);
        if (speed <= 0 || fabs(ox * dy - oy * dx) > 2.5 * speed) break;
        if (k.dx * dx + k.dy * dy < 0.906 * speed || f->strength[at] > 2.2f * e->strength) break;
        n++;
    }
    return n;
}

/* The mean share of 8 pixels over which the line ends go on in a picture of the window with its hole
   filled; 1 if there are no ends.
   color  4 per pixel
   share  receives 0..1
   cost   O(pixels)                                                                            */
static txm_status txi_continued(const txi_window *w, const txi_lines *l, const uint8_t *color,
                                txm_env *env, double *share) {
    const size_t count = (size_t)w->width * (size_t)w->height;
    const int longer = w->width > w->height ? w->width : w->height;
    txi_slopes f;
    txm_arena arena;
    double sum = 0;
    txm_arena_init(&arena, env);
    memset(&f, 0, sizeof f);
    f.width = w->width;
    f.height = w->height;
    f.color = color;
    f.known = (uint8_t *)txm_arena_alloc(&arena, count, 1);
    f.gap = (int32_t *)txm_arena_alloc(&arena, count, sizeof *f.gap);
    int32_t *from = (int32_t *)txm_arena_alloc(&arena, count, sizeof *from);
    int32_t *row = (int32_t *)txm_arena_alloc(&arena, (size_t)longer, 3 * sizeof *row);
    uint8_t *mark = (uint8_t *)txm_arena_alloc(&arena, count, 1);
    txm_status status = arena.failed ? txi_no_memory(env) : TXM_OK;
    if (status == TXM_OK) {
        for (size_t i = 0; i < count; i++) {
            f.known[i] = w->state[i] != TXI_VOID;
            mark[i] = !f.known[i];
            from[i] = w->state[i] == TXI_HOLE ? l->depth[i] : l->away[i];
        }
        txi_distances(mark, w->width, w->height, row, f.gap);
        status = txi_slopes_make(&f, from, 15 * 15, &arena, env);
    }
    for (int i = 0; i < l->end_count && status == TXM_OK; i++)
        sum += txi_goes_on(w, &f, &l->ends[i]) / (double)TXI_GO_ON;
    *share = l->end_count && status == TXM_OK ? sum / l->end_count : 1;
    txm_arena_free(&arena);
    return status;
}

/* The bending energy of the part of a curve in the hole: the squared angle for an arc. */
static double txi_curve_bend(const txi_curve *c) {
    double length, bend;
    txm_vec2 coarse[TXI_STEPS + 1];
    const int n = c->last - c->first;
    if (n < 2) return 0;
    for (int i = 0; i <= TXI_STEPS; i++) /* coarse, so that steps of a pixel do not count           */
        coarse[i] = c->points[c->first + (n * i + TXI_STEPS / 2) / TXI_STEPS];
    if (n <= TXI_STEPS) txi_bend(c->points + c->first, n + 1, &length, &bend);
    else txi_bend(coarse, TXI_STEPS + 1, &length, &bend);
    return bend;
}

/* Share of the line ends on curves that are nearly straight (bending energy below 0.15); 0 without
   ends. */
static double txi_straight_share(const txi_lines *l, const txi_curve *curves, int count) {
    int ends = 0;
    for (int i = 0; i < count; i++) {
        if (txi_curve_bend(&curves[i]) < 0.15) ends += 1 + (curves[i].ends[1] >= 0);
    }
    return l->end_count ? (double)ends / l->end_count : 0;
}

/* The mean bending energy of the curves, each counted as at most 4; 0 without curves. */
static double txi_mean_bend(const txi_curve *curves, int count) {
    double sum = 0;
    for (int i = 0; i < count; i++) {
        const double b = txi_curve_bend(&curves[i]);
        sum += b < 4 ? b : 4;
    }
    return count ? sum / count : 0;
}

/* ---- pictures ---------------------------------------------------------------------------- */

static void txi_dot(const txi_window *w, int scale, double x, double y, const uint8_t ink[3],
                    uint8_t *rgb) {
    const double px = (x + 0.5) * scale, py = (y + 0.5) * scale;
    const int width = w->width * scale;
    if (!(px >= 0 && py >= 0 && px < width && py < w->height * scale)) return;
    memcpy(rgb + 3 * ((size_t)(int)py * (size_t)width + (size_t)(int)px), ink, 3);
}

/* Draw what was found over the colours of the window, enlarged scale times: points of lines in orange;
   the traced ends in cyan (long) or yellow; curves in green, in red where they end in the hole.
   rgb  3 * width * height * scale^2 bytes                                                      */
static void txi_draw_lines(const txi_window *w, const txi_lines *l, const txi_curve *curves, int count,
                           int scale, uint8_t *rgb) {
    static const uint8_t orange[3] = {255, 150, 0}, cyan[3] = {0, 220, 255}, yellow[3] = {255, 255, 0};
    static const uint8_t green[3] = {0, 255, 0}, red[3] = {255, 0, 0};
    for (int y = 0; y < w->height * scale; y++) {
        for (int x = 0; x < w->width * scale; x++) {
            const size_t i = (size_t)(y / scale) * (size_t)w->width + (size_t)(x / scale);
            uint8_t *p = rgb + 3 * ((size_t)y * (size_t)w->width * (size_t)scale + (size_t)x);
            for (int c = 0; c < 3; c++) p[c] = w->state[i] == TXI_VOID ? 0 : w->color[4 * i + (size_t)c];
        }
    }
    for (int i = 0; i < l->thin_count; i++)
        txi_dot(w, scale, l->thin[i].place.x, l->thin[i].place.y, orange, rgb);
    for (int i = 0; i < l->end_count; i++) {
        const txi_end *e = &l->ends[i];
        for (int k = 0; k < e->count; k++) {
            const txm_vec2 p = l->points[e->first + k];
            txi_dot(w, scale, p.x, p.y, e->is_long ? cyan : yellow, rgb);
        }
    }
    for (int i = 0; i < count; i++) {
        for (int k = curves[i].first; k < curves[i].last; k++) {
            for (int s = 0; s < 2 * scale; s++) {
                const txm_vec2 p = txi_between(curves[i].points[k], curves[i].points[k + 1],
                                               0.5 * s / scale);
                txi_dot(w, scale, p.x, p.y, curves[i].ends[1] < 0 ? red : green, rgb);
            }
        }
    }
}

#endif /* TEXINPAINT_JOIN_H */
