#ifndef TEXINPAINT_ANNEAL_H
#define TEXINPAINT_ANNEAL_H

#include "onion.h"

/* ---- the coarsest level: annealed labelling -----------------------------------------------------

   Patches on a lattice of half their side cover the hole; each has a label, the source patch that
   it shows. The labelling of largest probability [1, III.B]

       P(Psi | W) P(W)                                                                      (5)
       P(Psi | W) ~ exp(- sum over patches: D(p(x), known part) / (2 sigma(x)^2))           (6)
       P(W) ~ exp(- sum over overlapping pairs: D(p(x), p(y)) / (2 sigma(x, y)^2))          (7)

   is sought by simulated annealing with Metropolis moves. sigma^2 is the context: the detail that
   is expected of a patch per pixel (detail.h), so that rough texture may differ more. Missing
   detail counts under (6), as everywhere else. The start is the onion's result, not a random
   labelling: from a random one the structure is not found in reasonable time. Moves propose a
   neighbour's label (shifted), the own one nearby, or any; they are not weighted for symmetry, as
   only the maximum is
   wanted.                                                                                     */

enum {
    TXI_ANNEAL_STEP = TXI_PATCH / 2, /* pixels between patches                                 */
    TXI_ANNEAL_MOVES = 600, /* per patch                                                       */
    TXI_ANNEAL_PAIRS = 8    /* patches that a patch overlaps                                   */
};
#define TXI_ANNEAL_HOT 6.0 /* the first temperature, in units of the exponents of (6) and (7)     */
#define TXI_ANNEAL_FALL (-2.9957322735539913) /* ln(0.3 / HOT): the last temperature is 0.3. Not
                               computed, as C libraries differ in the last bit                 */

typedef struct txi_site {
    int anchor;
    int pair[TXI_ANNEAL_PAIRS]; /* the site in each direction, -1: none                        */
    double precision;           /* 1 / (2 sigma^2)                                             */
    txi_match match;
} txi_site;

/* directions of neighbours: the step in x and in y */
static int txi_anneal_dx(int k) {
    return ((k < 4 ? k : k + 1) % 3 - 1) * TXI_ANNEAL_STEP;
}
static int txi_anneal_dy(int k) {
    return ((k < 4 ? k : k + 1) / 3 - 1) * TXI_ANNEAL_STEP;
}

/* D of (7): what two labels differ by where their patches, (dx, dy) apart, overlap. */
static uint32_t txi_anneal_overlap(const txi_level *l, const txi_match *a, const txi_match *b,
                                   int dx, int dy) {
    const txi_source *s = &l->source[a->pose], *t = &l->source[b->pose];
    const int x0 = dx > 0 ? dx : 0, y0 = dy > 0 ? dy : 0;
    const int w = TXI_PATCH - (dx > 0 ? dx : -dx), h = TXI_PATCH - (dy > 0 ? dy : -dy);
    uint32_t sum = 0;
    for (int y = y0; y < y0 + h; y++) {
        const uint8_t *u =
            s->color + 4 * ((size_t)(a->y + y) * (size_t)s->width + (size_t)(a->x + x0));
        const uint8_t *v =
            t->color + 4 * ((size_t)(b->y + y - dy) * (size_t)t->width + (size_t)(b->x + x0 - dx));
        for (int i = 0; i < 4 * w; i++) {
            const int d = u[i] - v[i];
            sum += (uint32_t)(d * d);
        }
    }
    return sum;
}

/* The exponents of a site with a label. known: mask of what the hole does not cover. */
static double txi_anneal_energy(const txi_canvas *t, const txi_site *sites, int i,
                                const txi_match *m, const uint8_t *known) {
    const txi_level *l = t->level;
    const txi_site *site = &sites[i];
    const txi_source *s = &l->source[m->pose];
    const size_t q = (size_t)m->y * (size_t)s->width + (size_t)m->x;
    const size_t p = (size_t)l->anchor[site->anchor];
    const double data = (double)txi_ssd(l->color + 4 * p, 4 * (size_t)l->width, known + 4 * p,
                                        s->color + 4 * q, 4 * (size_t)s->width, UINT32_MAX) +
                        txi_shortfall(t, site->anchor, s->worth[q]);
    double sum = data * site->precision;
    for (int k = 0; k < TXI_ANNEAL_PAIRS; k++) {
        if (site->pair[k] < 0) continue;
        const txi_site *other = &sites[site->pair[k]];
        const double d =
            txi_anneal_overlap(l, m, &other->match, txi_anneal_dx(k), txi_anneal_dy(k));
        sum += d * 0.5 * (site->precision + other->precision);
    }
    return sum;
}

/* A proposal for a site; 0: it cannot be copied. */
static int txi_anneal_propose(const txi_level *l, const txi_site *sites, int i, txm_rng *rng,
                              txi_match *m) {
    const uint32_t kind = txm_rng_below(rng, 4);
    *m = sites[i].match;
    if (kind < 2) {
        const int k = (int)txm_rng_below(rng, TXI_ANNEAL_PAIRS), j = sites[i].pair[k];
        if (j < 0) return 0;
        *m = sites[j].match;
        m->x = (int16_t)(m->x - txi_anneal_dx(k));
        m->y = (int16_t)(m->y - txi_anneal_dy(k));
    } else if (kind == 2) {
        m->x = (int16_t)(m->x + txm_rng_range(rng, -2, 2));
        m->y = (int16_t)(m->y + txm_rng_range(rng, -2, 2));
    } else {
        *m = txi_match_any(l, rng);
    }
    return txi_match_holds(l, m);
}

/* The lattice's sites, in the order of their anchors; returns their number. */
static int txi_anneal_sites(const txi_canvas *t, txi_site *sites, int32_t *at) {
    const txi_level *l = t->level;
    const double unit = (double)l->clamp * (double)TXI_PATCH_AREA / (double)TXI_WORTH_MOST;
    int count = 0;
    for (int p = 0; p < l->width * l->height; p++) {
        const int a = l->slot[p];
        at[p] = -1;
        if (a < 0 || p % l->width % TXI_ANNEAL_STEP || p / l->width % TXI_ANNEAL_STEP ||
            !txi_match_holds(l, &t->match[a]))
            continue;
        sites[count].anchor = a;
        sites[count].match = t->match[a];
        sites[count].precision = 0.5 / (l->want[a] * unit / (double)TXI_PATCH_AREA + 16);
        at[p] = count++;
    }
    for (int i = 0; i < count; i++) {
        const int p = l->anchor[sites[i].anchor];
        for (int k = 0; k < TXI_ANNEAL_PAIRS; k++) {
            const int x = p % l->width + txi_anneal_dx(k), y = p / l->width + txi_anneal_dy(k);
            sites[i].pair[k] =
                x < 0 || y < 0 || x >= l->width || y >= l->height ? -1 : at[y * l->width + x];
        }
    }
    return count;
}

/* The sites' labels become the matches of all anchors, and the colours of the hole. */
static void txi_anneal_apply(txi_canvas *t, const txi_site *sites, const int32_t *at) {
    const txi_level *l = t->level;
    for (int a = 0; a < l->anchor_count; a++) {
        const int p = l->anchor[a], half = TXI_ANNEAL_STEP / 2;
        const int x = p % l->width, y = p / l->width;
        const int sx = (x + half) / TXI_ANNEAL_STEP * TXI_ANNEAL_STEP;
        const int sy = (y + half) / TXI_ANNEAL_STEP * TXI_ANNEAL_STEP;
        const int i = sx < l->width && sy < l->height ? at[sy * l->width + sx] : -1;
        if (i < 0) continue;
        txi_match m = sites[i].match;
        const txi_source *s = &l->source[m.pose];
        m.x = (int16_t)(m.x + x - sx);
        m.y = (int16_t)(m.y + y - sy);
        if (txi_match_holds(l, &m)) t->match[a] = m;
        /* the pixel in the middle of the anchor's patch, as the site's patch shows it */
        const int u = x + TXI_PATCH / 2, v = y + TXI_PATCH / 2;
        const size_t q = (size_t)(sites[i].match.y + v - sy) * (size_t)s->width +
                         (size_t)(sites[i].match.x + u - sx);
        if (l->state[v * l->width + u] == TXI_HOLE)
            memcpy(t->color + 4 * (size_t)(v * l->width + u), s->color + 4 * q, 3);
    }
    t->fresh = 0;
}

/* Improve the onion's labelling of the coarsest level. */
static txm_status txi_anneal_labels(txi_canvas *t, txm_env *env) {
    const txi_level *l = t->level;
    const size_t n = (size_t)l->width * (size_t)l->height;
    txm_arena scratch;
    txm_arena_init(&scratch, env);
    txi_site *sites =
        (txi_site *)txm_arena_alloc(&scratch, (size_t)l->anchor_count, sizeof(txi_site));
    int32_t *at = (int32_t *)txm_arena_alloc(&scratch, n, sizeof(int32_t));
    uint8_t *known = (uint8_t *)txm_arena_zero(&scratch, n, 4);
    txm_status status = scratch.failed ? txi_no_memory(env) : TXM_OK;
    const int count = status == TXM_OK ? txi_anneal_sites(t, sites, at) : 0;
    for (size_t p = 0; p < n && count; p++) {
        if (l->state[p] == TXI_KNOWN || l->state[p] == TXI_FOREIGN) memset(known + 4 * p, 255, 4);
    }
    txm_rng rng = txm_rng_make(t->seed, 4242);
    const int moves = TXI_ANNEAL_MOVES;
    double heat = TXI_ANNEAL_HOT;
    const double cool = txm_exp2(TXI_ANNEAL_FALL / moves * TXI_LOG2_E);
    for (int round = 0; round < moves && count && status == TXM_OK; round++, heat *= cool) {
        for (int k = 0; k < count; k++) {
            const int i = (int)txm_rng_below(&rng, (uint32_t)count);
            txi_match m;
            if (!txi_anneal_propose(l, sites, i, &rng, &m)) continue;
            const double rise = txi_anneal_energy(t, sites, i, &m, known) -
                                txi_anneal_energy(t, sites, i, &sites[i].match, known);
            const double power = rise / heat * TXI_LOG2_E;
            if (rise > 0 && (power > 60 || txm_rng_double(&rng) >= txm_exp2(-power))) continue;
            sites[i].match = m;
        }
        if (round % 64 == 0 && txm_progress(env, 0, "annealing")) status = txi_stopped(env);
    }
    if (status == TXM_OK && count) txi_anneal_apply(t, sites, at);
    txm_arena_free(&scratch);
    return status;
}

#endif /* TEXINPAINT_ANNEAL_H */
