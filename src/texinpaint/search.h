#ifndef TEXINPAINT_SEARCH_H
#define TEXINPAINT_SEARCH_H

#include "pose.h"

/* ---- matches --------------------------------------------------------------------------------- */

enum {
    TXI_BAND = 16,       /* rows of anchors or pixels that are worked on one after the other   */
    TXI_MEND = 4,        /* pixels: how far a match that cannot be copied may be moved; ours   */
    TXI_ANY_TRIES = 100, /* random patches, before all are gone through; ours                 */
    TXI_USE_ONE = 64,    /* of txi_canvas.use: copied once, on average                         */
    TXI_USE_MOST = 16 * TXI_USE_ONE, /* more counts as this                                    */
    TXI_RANDOM_TRIES = 4 /* per anchor and sweep, besides those at falling distances; ours */
};

#define TXI_REPEAT_WEIGHT 1.0 /* of the expected detail of a patch: what each use but the first costs;
                                 see docs/choices.md                                            */

/* Which source patch an anchor's patch is like. */
typedef struct txi_match {
    int16_t x, y; /* upper left corner in the source                                          */
    int16_t pose; /* number of the source; -1: none                                           */
    int16_t spare; /* 0                                                                        */
    uint32_t cost; /* squared differences of a full patch, and what missing detail costs       */
} txi_match;

/* The state of a completion at one level. */
typedef struct txi_canvas {
    const txi_level *level;
    uint8_t *color;   /* 4 per pixel: the level's, and in the hole the current guess         */
    txi_match *match; /* one per anchor                                                      */
    txi_match *old;   /* as it was before the sweep                                          */
    uint16_t *weight; /* of each anchor's vote                                               */
    uint32_t price;   /* of one unit of missing detail, in 1/65536                           */
    uint64_t seed;
    int sweep;  /* counts the sweeps                                                   */
    int fresh;  /* the costs are up to date                                            */
    int radius; /* pixels: where random tries begin                                    */
    uint16_t *use;   /* of each pixel of the level: how often the patch around it is copied, in
                        1/TXI_USE_ONE                                                        */
    int32_t *chosen; /* of each hole pixel: the anchor whose proposal it has, -1: none       */
    int reach;       /* pixels: sources nearer to their target are as if used up to once more */
    uint32_t toll;   /* for each further use of a patch, per unit of expected detail, in 1/65536 */
} txi_canvas;

/* What the missing detail of a source patch costs. */
static inline uint32_t txi_shortfall(const txi_canvas *t, int a, uint32_t worth) {
    const uint32_t want = t->level->want[a];
    return want >= worth ? (uint32_t)(((uint64_t)(want - worth + 1) * t->price) >> 16) : 0;
}

/* where the centre of a source patch lies in the level, in units */
static void txi_match_centre(const txi_source *s, int x, int y, int32_t *cx, int32_t *cy) {
    txi_source_place(s, x, y, cx, cy);
    *cx += (s->a + s->c) * (TXI_PATCH - 1) / 2;
    *cy += (s->b + s->d) * (TXI_PATCH - 1) / 2;
}

/* What a source patch costs because the eye sees that it repeats: for each use but the first, and for
   lying near the place that it is copied to. Relative to the expected detail, so that it counts as
   much in smooth texture as in rough one. */
static uint32_t txi_repeated(const txi_canvas *t, int a, const txi_source *s, int x, int y) {
    const int width = t->level->width, p = t->level->anchor[a], half = TXI_PATCH / 2;
    int32_t cx, cy;
    txi_match_centre(s, x, y, &cx, &cy);
    cx /= TXI_UNIT;
    cy /= TXI_UNIT;
    const int dx = cx - p % width - half, dy = cy - p / width - half;
    const int64_t square = (int64_t)dx * dx + (int64_t)dy * dy;
    const int64_t most = (int64_t)t->reach * t->reach;
    int64_t uses = t->use[cy * width + cx] - TXI_USE_ONE;
    if (uses < 0) uses = 0;
    if (square < most) uses += TXI_USE_ONE * (most - square) / most;
    return (uint32_t)((t->level->want[a] * (uint64_t)uses / TXI_USE_ONE * t->toll) >> 16);
}

/* Cost of the patch (x, y) of a source for anchor a, UINT32_MAX if it cannot be copied or costs
   limit or more. */
static uint32_t txi_cost(const txi_canvas *t, int a, int pose, int x, int y, uint32_t limit) {
    const txi_level *l = t->level;
    const txi_source *s = &l->source[pose];
    if (x < 0 || y < 0 || x > s->width - TXI_PATCH || y > s->height - TXI_PATCH) return UINT32_MAX;
    const size_t q = (size_t)y * (size_t)s->width + (size_t)x, p = (size_t)l->anchor[a];
    const uint32_t worth = s->worth[q];
    if (!worth) return UINT32_MAX;
    const uint32_t short_of = txi_shortfall(t, a, worth), filled = l->filled[a];
    if (short_of >= limit) return UINT32_MAX;
    const uint32_t rest = limit - short_of;
    uint32_t d;
    if (filled == TXI_PATCH_AREA) {
        d = txi_ssd(t->color + 4 * p, 4 * (size_t)l->width, NULL, s->color + 4 * q,
                    4 * (size_t)s->width, rest);
    } else { /* the void part is like the mean of the rest */
        const uint32_t part = txi_ssd(t->color + 4 * p, 4 * (size_t)l->width, l->mask + 4 * p,
                                      s->color + 4 * q, 4 * (size_t)s->width, rest);
        d = part * TXI_PATCH_AREA / filled;
    }
    if (d >= rest) return UINT32_MAX;
    d += short_of + txi_repeated(t, a, s, x, y);
    return d >= limit ? UINT32_MAX : d;
}

/* Take the patch if it is better. */
static inline void txi_try(const txi_canvas *t, int a, int pose, int x, int y, txi_match *best) {
    const uint32_t cost = txi_cost(t, a, pose, x, y, best->cost);
    if (cost >= best->cost) return;
    best->x = (int16_t)x;
    best->y = (int16_t)y;
    best->pose = (int16_t)pose;
    best->cost = cost;
}

/* the patch of a source whose centre is nearest to a place of its level */
static void txi_match_at(const txi_source *s, int32_t cx, int32_t cy, int *x, int *y) {
    txi_source_pixel(s, cx - (s->a + s->c) * (TXI_PATCH - 1) / 2,
                     cy - (s->b + s->d) * (TXI_PATCH - 1) / 2, x, y);
}

/* The same place in another pose. */
static void txi_try_pose(const txi_canvas *t, int a, int pose, txi_match *best) {
    const txi_level *l = t->level;
    int32_t cx, cy;
    int x, y;
    txi_match_centre(&l->source[best->pose], best->x, best->y, &cx, &cy);
    txi_match_at(&l->source[pose], cx, cy, &x, &y);
    txi_try(t, a, pose, x, y, best);
}

/* Some patch that may be copied: random ones, else the first one there is. */
static txi_match txi_match_any(const txi_level *l, txm_rng *rng) {
    txi_match m;
    memset(&m, 0, sizeof m);
    m.cost = UINT32_MAX;
    for (int k = 0; k < TXI_ANY_TRIES; k++) {
        const int pose = l->built[txm_rng_below(rng, (uint32_t)l->built_count)];
        const txi_source *s = &l->source[pose];
        m.pose = (int16_t)pose;
        m.x = (int16_t)txm_rng_below(rng, (uint32_t)s->width);
        m.y = (int16_t)txm_rng_below(rng, (uint32_t)s->height);
        if (s->worth[(size_t)m.y * (size_t)s->width + (size_t)m.x]) return m;
    }
    for (int k = 0; k < l->built_count; k++) {
        const txi_source *s = &l->source[l->built[k]];
        const size_t n = (size_t)s->width * (size_t)s->height;
        for (size_t q = 0; q < n; q++) {
            if (!s->worth[q]) continue;
            m.pose = (int16_t)l->built[k];
            m.x = (int16_t)(q % (size_t)s->width);
            m.y = (int16_t)(q / (size_t)s->width);
            return m;
        }
    }
    m.pose = -1;
    return m;
}

/* ---- search -------------------------------------------------------------------------------------

   One sweep over the anchors [8], forwards or backwards: each tries the matches of the neighbours
   that were there before it, shifted by one pixel, then random patches at falling distances from
   its match, then other poses of the same place and random places. Bands of rows are independent:
   what lies beyond the band is taken as it was before the sweep, so that the result does not
   depend on the threads; the bands are shifted from sweep to sweep.                           */

/* the match of the anchor at pixel p, shifted by (dx, dy), if there is one */
static inline void txi_try_neighbour(const txi_canvas *t, int a, int p, int dx, int dy, int first,
                                     int last, txi_match *best) {
    const int b = t->level->slot[p];
    if (b < 0) return;
    const txi_match *m = b >= first && b < last ? &t->match[b] : &t->old[b];
    if (m->pose >= 0) txi_try(t, a, m->pose, m->x + dx, m->y + dy, best);
}

static void txi_search_anchor(const txi_canvas *t, int a, int first, int last) {
    const txi_level *l = t->level;
    const int p = l->anchor[a], s = t->sweep & 1 ? -1 : 1;
    txi_match best = t->match[a];
    txm_rng rng = txm_rng_make(t->seed + (uint64_t)t->sweep, (uint64_t)a);
    if (best.pose < 0) best = txi_match_any(l, &rng);
    if (!t->fresh || best.cost == UINT32_MAX)
        best.cost = txi_cost(t, a, best.pose, best.x, best.y, UINT32_MAX);
    txi_try_neighbour(t, a, p - s, s, 0, first, last, &best);
    txi_try_neighbour(t, a, p - s * l->width, 0, s, first, last, &best);
    for (int r = t->radius; r >= 1; r /= 2) {
        const int x = best.x + txm_rng_range(&rng, -r, r), y = best.y + txm_rng_range(&rng, -r, r);
        txi_try(t, a, best.pose, x, y, &best);
    }
    for (int k = 0; k < TXI_RANDOM_TRIES; k++) {
        const int pose = l->built[txm_rng_below(&rng, (uint32_t)l->built_count)];
        if (k & 1) {
            if (pose != best.pose) txi_try_pose(t, a, pose, &best);
            continue;
        }
        const txi_source *source = &l->source[pose];
        const int x = (int)txm_rng_below(&rng, (uint32_t)source->width);
        const int y = (int)txm_rng_below(&rng, (uint32_t)source->height);
        txi_try(t, a, pose, x, y, &best);
    }
    t->match[a] = best;
}

static void txi_search_band(void *context, int index) {
    const txi_canvas *t = (const txi_canvas *)context;
    const txi_level *l = t->level;
    const int shift = t->sweep & 2 ? TXI_BAND / 2 : 0;
    const int from = txm_clampi(index * TXI_BAND - shift, 0, l->height);
    const int to = txm_clampi(index * TXI_BAND - shift + TXI_BAND, 0, l->height);
    const int first = l->anchor_row[from], last = l->anchor_row[to];
    for (int k = 0; k < last - first; k++)
        txi_search_anchor(t, t->sweep & 1 ? last - 1 - k : first + k, first, last);
}

static void txi_search(txi_canvas *t, txm_env *env) {
    memcpy(t->old, t->match, (size_t)t->level->anchor_count * sizeof *t->old);
    txm_parallel_for(env, t->level->height / TXI_BAND + 2, txi_search_band, t);
    t->sweep++;
    t->fresh = 1;
}

/* ---- from level to level -------------------------------------------------------------------- */

/* The match of anchor a that the coarser level's match m of the anchor at (cx, cy) means. All
   coordinates in the finer level's pixels are twice those in the coarser one's, plus one half. */
static txi_match txi_match_refine(const txi_level *coarse, const txi_level *fine, int a,
                                  const txi_match *m, int coarse_anchor) {
    txi_match out = *m;
    const txi_source *from = &coarse->source[m->pose];
    const int p = fine->anchor[a];
    /* from the coarse patch's corner to the fine one's centre, in quarters of coarse pixels */
    const int dx =
        2 * (p % fine->width - TXI_EDGE) + 7 - 1 - 4 * (coarse_anchor % coarse->width - TXI_EDGE);
    const int dy =
        2 * (p / fine->width - TXI_EDGE) + 7 - 1 - 4 * (coarse_anchor / coarse->width - TXI_EDGE);
    const int32_t edge = (int32_t)TXI_EDGE * TXI_UNIT;
    int32_t wx, wy;
    txi_source_place(from, m->x, m->y, &wx, &wy);
    wx += from->a / 4 * dx + from->c / 4 * dy;
    wy += from->b / 4 * dx + from->d / 4 * dy;
    wx = 2 * (wx - edge) + TXI_UNIT / 2 + edge;
    wy = 2 * (wy - edge) + TXI_UNIT / 2 + edge;
    int pose = m->pose, x, y;
    if (!fine->source[pose].color) { /* the pose that is turned least against it */
        int64_t most = INT64_MIN;
        for (int k = 0; k < fine->built_count; k++) {
            const txi_source *s = &fine->source[fine->built[k]];
            const int64_t like = (int64_t)s->a * from->a + (int64_t)s->b * from->b +
                                 (int64_t)s->c * from->c + (int64_t)s->d * from->d;
            if (like <= most) continue;
            most = like;
            pose = fine->built[k];
        }
    }
    txi_match_at(&fine->source[pose], wx, wy, &x, &y);
    out.pose = (int16_t)pose;
    out.x = (int16_t)x;
    out.y = (int16_t)y;
    return out;
}

/* is the match a patch that may be copied? */
static int txi_match_holds(const txi_level *l, const txi_match *m) {
    if (m->pose < 0 || !l->source[m->pose].color) return 0;
    const txi_source *s = &l->source[m->pose];
    return m->x >= 0 && m->y >= 0 && m->x < s->width && m->y < s->height &&
           s->worth[(size_t)m->y * (size_t)s->width + (size_t)m->x];
}

/* Move a match to the nearest patch that may be copied, at most TXI_MEND pixels away. */
static int txi_match_mend(const txi_level *l, txi_match *m) {
    for (int r = 0; r <= TXI_MEND; r++) {
        for (int y = -r; y <= r; y++) {
            for (int x = -r; x <= r; x++) {
                txi_match near_one = *m;
                if (x > -r && x < r && y > -r && y < r) continue;
                near_one.x = (int16_t)(m->x + x);
                near_one.y = (int16_t)(m->y + y);
                if (!txi_match_holds(l, &near_one)) continue;
                *m = near_one;
                return 1;
            }
        }
    }
    return 0;
}

/* Matches of a level from those of the next coarser one. */
static void txi_upsample(const txi_level *coarse, const txi_match *from, txi_canvas *t) {
    const txi_level *l = t->level;
    for (int a = 0; a < l->anchor_count; a++) {
        const int p = l->anchor[a];
        /* the coarse patch with the nearest centre, else one next to it: its corner is 2 pixels
           nearer to the centre; 16 / 2 - 8 rounds down where the difference is negative */
        const int x = (p % l->width - TXI_EDGE + 16) / 2 - 8 - 2 + TXI_EDGE;
        const int y = (p / l->width - TXI_EDGE + 16) / 2 - 8 - 2 + TXI_EDGE;
        txm_rng rng = txm_rng_make(t->seed - 1, (uint64_t)a);
        int found = -1;
        for (int r = 0; r <= 4 && found < 0; r++) {
            for (int k = 0; k < (2 * r + 1) * (2 * r + 1) && found < 0; k++) {
                const int qx = x + k % (2 * r + 1) - r, qy = y + k / (2 * r + 1) - r;
                if (qx < 0 || qy < 0 || qx >= coarse->width || qy >= coarse->height) continue;
                const int b = coarse->slot[qy * coarse->width + qx];
                if (b >= 0 && from[b].pose >= 0) found = b;
            }
        }
        txi_match m;
        memset(&m, 0, sizeof m);
        m.pose = -1;
        if (found >= 0) m = txi_match_refine(coarse, l, a, &from[found], coarse->anchor[found]);
        if (m.pose < 0 || !txi_match_mend(l, &m)) m = txi_match_any(l, &rng);
        if (found >= 0) m.cost = from[found].cost;
        t->match[a] = m;
    }
    t->fresh = 0;
}

#endif /* TEXINPAINT_SEARCH_H */
