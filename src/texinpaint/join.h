#ifndef TEXINPAINT_JOIN_H
#define TEXINPAINT_JOIN_H

#include "pair.h"

/* ---- matching ---------------------------------------------------------------------------- */

/* The state of the search for the matching of least cost. */
typedef struct txi_pairing {
    const txi_link *links;
    int link_count, end_count;
    double crossing;
    float *saved;      /* one per link: what it saves, as its ends are no longer unmatched        */
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
    TXM_ASSERT(m->active_count < m->link_count);
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

static double txi_remove(txi_pairing *m, int k) {
    const double change = (double)m->saved[k] - txi_link_energy(m, k);
    txi_deactivate(m, k);
    return change;
}

static double txi_insert(txi_pairing *m, int k) {
    const double change = txi_link_energy(m, k) - (double)m->saved[k];
    txi_activate(m, k);
    return change;
}

/* Insert the link of a free end to another free end, or out of the hole, that lowers the energy most. The
   change; 0: there is none, *link is -1 then. */
static double txi_rejoin(txi_pairing *m, int end, int *link) {
    double least = -1e-9;
    *link = -1;
    for (int i = m->of_start[end]; i < m->of_start[end + 1]; i++) {
        const txi_link *k = &m->links[m->of_end[i]];
        const int other = k->a == end ? k->b : k->a;
        if (other >= 0 && m->chosen[other] >= 0) continue;
        const double change = txi_link_energy(m, m->of_end[i]) - (double)m->saved[m->of_end[i]];
        if (change >= least) continue;
        least = change;
        *link = m->of_end[i];
    }
    if (*link < 0) return 0;
    txi_activate(m, *link);
    return least;
}

/* Try link k: it goes if it is there; else it replaces the links of its two ends, and the two ends that
   become free are joined anew if they can be. Kept if the energy changes by less than allowed; returns
   the change, or 0 if it was not kept. */
static double txi_pairing_try(txi_pairing *m, int k, double allowed) {
    int gone[2] = {-1, -1}, free_end[2] = {-1, -1}, anew[2] = {-1, -1};
    double change = 0;
    if (m->slot[k] >= 0) {
        gone[0] = k;
        free_end[0] = m->links[k].a;
        free_end[1] = m->links[k].b;
        change = txi_remove(m, k);
    } else {
        for (int s = 0; s < 2; s++) {
            const int end = s ? m->links[k].b : m->links[k].a;
            const int old = end >= 0 ? m->chosen[end] : -1;
            if (old < 0) continue;
            gone[s] = old;
            free_end[s] = m->links[old].a == end ? m->links[old].b : m->links[old].a;
            change += txi_remove(m, old);
        }
        change += txi_insert(m, k);
    }
    for (int s = 0; s < 2; s++) {
        if (free_end[s] >= 0 && m->chosen[free_end[s]] < 0)
            change += txi_rejoin(m, free_end[s], &anew[s]);
    }
    if (change < allowed) return change;
    for (int s = 1; s >= 0; s--) {
        if (anew[s] >= 0) txi_deactivate(m, anew[s]);
    }
    if (m->slot[k] >= 0) txi_deactivate(m, k);
    for (int s = 0; s < 2; s++) {
        if (gone[s] >= 0) txi_activate(m, gone[s]);
    }
    return 0;
}

static txm_status txi_pairing_make(txi_pairing *m, const txi_pairs *pairs, const txi_link *links,
                                   int count, txm_arena *scratch, txm_env *env) {
    const int ends = pairs->l->end_count;
    const size_t n = (size_t)count, e = (size_t)ends;
    memset(m, 0, sizeof *m);
    m->links = links;
    m->link_count = count;
    m->end_count = ends;
    m->crossing = pairs->rules.crossing;
    m->crosses = (uint8_t *)txm_arena_zero(scratch, n, n);
    m->saved = (float *)txm_arena_alloc(scratch, n, sizeof *m->saved);
    m->chosen = (int *)txm_arena_alloc(scratch, e, sizeof(int));
    m->active = (int *)txm_arena_alloc(scratch, n, sizeof(int));
    m->slot = (int *)txm_arena_alloc(scratch, n, sizeof(int));
    m->of_end = (int *)txm_arena_alloc(scratch, n, 2 * sizeof(int));
    m->of_start = (int *)txm_arena_zero(scratch, e + 2, sizeof(int));
    if (scratch->failed) return txi_no_memory(env);
    for (int i = 0; i < ends; i++) m->chosen[i] = -1;
    for (int k = 0; k < count; k++) {
        m->slot[k] = -1;
        m->saved[k] = txm_float(txi_saved_by(pairs->l, &pairs->rules, &links[k]));
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

/* -ln(u) for 0 < u <= 1, to 1 %: u = 2^-bits v, then a series in 1 - v. */
static double txi_minus_log(double u) {
    double bits = 0;
    while (u < 0.5) {
        u *= 2;
        bits += 1;
    }
    const double x = 1 - u;
    return bits * 0.6931471805599453 + x * (1 + x * (1 / 2.0 + x * (1 / 3.0 + x / 4)));
}

/* Simulated annealing, several times from no joins at all; then, from the best that was met, every link
   is tried until none improves.
   best  room for end_count numbers                                                             */
static void txi_anneal(txi_pairing *m, uint64_t seed, int *best) {
    const int starts = TXI_LEFT_OUT & TXI_MATCHING ? 0 : TXI_STARTS, rounds = starts ? 50 : 1;
    double least = 0;
    for (int i = 0; i < m->end_count; i++) best[i] = -1;
    for (int start = 0; start < starts; start++) {
        txm_rng rng = txm_rng_make(seed, 0x6a6f696e + (uint64_t)start);
        double energy = 0;
        while (m->active_count) txi_deactivate(m, m->active[m->active_count - 1]);
        for (int i = 0; i < TXI_MOVES; i++) {
            const double heat = 1.5 * txm_exp2(-7.0 * i / (double)TXI_MOVES);
            const int k = (int)txm_rng_below(&rng, (uint32_t)m->link_count);
            const double u = txm_rng_double(&rng);
            /* accepted with probability exp(-change / heat)                                      */
            energy += txi_pairing_try(m, k, heat * txi_minus_log(u > 1e-9 ? u : 1e-9));
            if (energy >= least - 1e-9) continue;
            least = energy;
            memcpy(best, m->chosen, (size_t)m->end_count * sizeof *best);
        }
    }
    while (m->active_count) txi_deactivate(m, m->active[m->active_count - 1]);
    for (int i = 0; i < m->end_count; i++) {
        if (best[i] >= 0 && m->slot[best[i]] < 0) txi_activate(m, best[i]);
    }
    for (int round = 0, better = 1; better && round < rounds; round++) {
        better = 0;
        for (int k = 0; k < m->link_count; k++) better |= txi_pairing_try(m, k, -1e-7) < 0;
    }
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
static txm_status txi_curve_make(const txi_pairs *pairs, const txi_link *k, txm_vec2 *dense,
                                 txm_vec2 *fine, int room, txm_arena *arena, txm_env *env,
                                 txi_curve *c) {
    const txi_window *w = pairs->w;
    const txi_lines *l = pairs->l;
    const txi_end *a = &l->ends[k->a], *b = k->b >= 0 ? &l->ends[k->b] : NULL;
    int n = 0, m;
    const int head = txi_known_count(a), tail = b ? txi_known_count(b) : 0;
    for (int s = head; s > 0; s--) dense[n++] = txi_known_point(l, a, s);
    txi_link_curve(pairs, k, 4 * TXI_STEPS, fine);
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
    c->cost = k->cost;
    return TXM_OK;
}

/* ---- junctions --------------------------------------------------------------------------- */

/* Mean colour of a side of an end, 1 to 3 pixels from the line; side 0 left, 1 right. */
static void txi_end_side(const txi_end *e, int side, double color[3]) {
    const int mid = TXI_PROFILE / 2;
    for (int c = 0; c < 3; c++) {
        color[c] = 0;
        for (int k = 2; k <= 6; k++) color[c] += e->profile[side ? mid + k : mid - k][c] / 5.0;
    }
}

static double txi_end_color_distance(const double a[3], const double b[3]) {
    const double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return sqrt((x * x + y * y + z * z) / 3);
}

/* Continue an end that is not joined until it meets a curve: the end of a line at another, a
   T-junction. The colour of one of its sides must be that of the curve on the side where it arrives. 0:
   it meets none within most pixels. */
static int txi_meet_curve(const txi_lines *l, const txi_end *e, const txi_curve *curves, int count,
                          double most, txi_link *k) {
    const double turn = fabs((double)e->curvature) * most < 1 ? e->curvature : 0;
    double x = e->place.x, y = e->place.y, dx = e->heading.x, dy = e->heading.y;
    for (int i = 0; i < (int)most; i++) {
        x += dx;
        y += dy;
        const txm_vec2 d = txi_unit(dx - turn * dy, dy + turn * dx);
        dx = d.x;
        dy = d.y;
        for (int j = 0; j < count && i >= 2; j++) {
            const txi_curve *c = &curves[j];
            for (int n = c->first; n < c->last; n++) {
                const txm_vec2 p = c->points[n], q = c->points[n + 1];
                const double ox = x - p.x, oy = y - p.y;
                if (ox * ox + oy * oy > 1.2) continue;
                const txm_vec2 t = txi_unit((double)q.x - p.x, (double)q.y - p.y);
                const double cross = dx * t.y - dy * t.x; /* positive: it comes from the right       */
                if (fabs(cross) < 0.4) return 0;
                double arrived[3], left[3], right[3];
                txi_end_side(&l->ends[c->ends[0]], cross < 0, arrived);
                txi_end_side(e, 0, left);
                txi_end_side(e, 1, right);
                if (txi_end_color_distance(arrived, left) > 40 && txi_end_color_distance(arrived, right) > 40)
                    return 0;
                k->leave = txm_v2(txm_float(x), txm_float(y));
                k->backwards = txm_v2(txm_float(-dx), txm_float(-dy));
                return 1;
            }
        }
    }
    return 0;
}

/* ---- all of it --------------------------------------------------------------------------- */

/* The chosen candidates as curves, then the ends that meet one of them. */
static txm_status txi_join_curves(const txi_pairs *pairs, const txi_pairing *match, txm_arena *scratch,
                                  txm_arena *arena, txm_env *env, txi_curve *curves, int *count) {
    const txi_window *w = pairs->w;
    const txi_lines *l = pairs->l;
    const int room = 8 * (w->width + w->height) + 2 * TXI_KNOWN_PART + 8;
    txm_vec2 *dense = (txm_vec2 *)txm_arena_alloc(scratch, (size_t)room, 2 * sizeof *dense);
    if (scratch->failed) return txi_no_memory(env);
    for (int k = 0; k < match->link_count; k++) {
        txi_curve c;
        if (match->slot[k] < 0) continue;
        const txm_status status =
            txi_curve_make(pairs, &match->links[k], dense, dense + room, room, arena, env, &c);
        if (status != TXM_OK) return status;
        if (c.first < 0 || c.last <= c.first) continue;
        TXM_ASSERT(*count < l->end_count); /* an end has one curve at most */
        curves[(*count)++] = c;
    }
    const int whole = *count;
    for (int e = 0; e < l->end_count; e++) {
        txi_link k;
        txi_curve c;
        memset(&k, 0, sizeof k);
        k.a = e;
        k.b = k.line = -1;
        if (match->chosen[e] >= 0 || !l->ends[e].is_long) continue;
        if (!txi_meet_curve(l, &l->ends[e], curves, whole, 0.75 * l->width, &k)) continue;
        const txm_status status = txi_curve_make(pairs, &k, dense, dense + room, room, arena, env, &c);
        if (status != TXM_OK) return status;
        if (c.first < 0 || c.last <= c.first) continue;
        TXM_ASSERT(*count < l->end_count);
        curves[(*count)++] = c;
    }
    return TXM_OK;
}

/* Join the lines that end at the hole.

   prior      lines that attract, or NULL
   structure  TEXINPAINT_PICTURE or TEXINPAINT_PATTERN; TEXINPAINT_TEXTURE: no curves
   alpha      the largest distance of two ends that are joined, pixels; 0 = no limit
   beta       rounds over which lines grow by votes; 0 = as many as it takes
   curves     receives *count curves, in the arena
   return     TXM_OK; TXM_OUT_OF_MEMORY; TXM_CANCELLED                                         */
static txm_status txi_join(const txi_window *w, const txi_lines *l, const txi_prior *prior, int structure,
                           float alpha, int beta, uint64_t seed, txm_arena *arena, txm_env *env,
                           txi_curve **curves, int *count) {
    txm_arena scratch;
    txi_pairing match;
    txi_pairs pairs;
    int n = 0;
    *curves = NULL;
    *count = 0;
    if (structure == TEXINPAINT_TEXTURE || l->end_count == 0) return TXM_OK;
    txm_arena_init(&scratch, env);
    txm_status status = txi_pairs_make(&pairs, w, l, prior, structure, alpha, beta, &scratch, env);
    txi_link *links = (txi_link *)txm_arena_alloc(&scratch, TXI_MAX_LINKS, sizeof *links);
    int *best = (int *)txm_arena_alloc(&scratch, (size_t)l->end_count, sizeof *best);
    *curves = (txi_curve *)txm_arena_alloc(arena, (size_t)l->end_count, sizeof **curves);
    if (status == TXM_OK && (scratch.failed || arena->failed)) status = txi_no_memory(env);
    if (status == TXM_OK && txm_progress(env, 0, "lines")) status = txi_stopped(env);
    if (status == TXM_OK) n = txi_candidates(&pairs, links);
    if (n) status = txi_pairing_make(&match, &pairs, links, n, &scratch, env);
    if (status == TXM_OK && txm_progress(env, 0, "lines")) status = txi_stopped(env);
    if (n && status == TXM_OK) {
        txi_anneal(&match, seed, best);
        status = txi_join_curves(&pairs, &match, &scratch, arena, env, *curves, count);
    }
    txm_arena_free(&scratch);
    return status;
}

#endif /* TEXINPAINT_JOIN_H */
