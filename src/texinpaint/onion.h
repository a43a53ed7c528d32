#ifndef TEXINPAINT_ONION_H
#define TEXINPAINT_ONION_H

#include "search.h"

/* ---- the coarsest level: ring by ring -----------------------------------------------------------

   Patches at the hole's border, of which enough is known, are compared with the source patches
   everywhere; their matches then fill the outermost ring of the hole, and so on. At this
   resolution this is affordable, and random candidates instead would cost the structure.      */

enum {
    TXI_ONION_SHARE = 55,     /* percent of a patch that must be known                           */
    TXI_ONION_FULL = 85,      /* percent from which patches off the lattice are compared, too    */
    TXI_ONION_RING = 2,       /* pixels filled a pass                                            */
    TXI_ONION_BEST = 8,       /* matches that are refined                                        */
    TXI_ONION_SPREAD = 400,   /* squared levels per pixel: at this cost a patch has weight 1 / e */
    TXI_ONION_REACH = 2,      /* pixels of the refinement                                        */
    TXI_ONION_WORK = 3000000, /* comparisons, about                                            */
    TXI_ONION_LEAST = 4000,   /* places compared at least, for up to three times that work       */
    TXI_ONION_FEWEST = 250    /* places compared for any amount of work                          */
};

typedef struct txi_onion {
    const txi_canvas *canvas;
    uint8_t *known;         /* 4 per pixel: 255 where it is known or filled                     */
    const txi_match *place; /* source patches to compare with                                  */
    int place_count;
    int32_t *todo;    /* anchors of this pass                                             */
    txi_match *found; /* of each anchor of the level; cost as of a full patch             */
    int todo_count;
} txi_onion;

/* As txi_cost, over the pixels known so far. */
static uint32_t txi_onion_cost(const txi_onion *o, int a, int known, int pose, int x, int y,
                               uint32_t limit) {
    const txi_canvas *t = o->canvas;
    const txi_level *l = t->level;
    const txi_source *s = &l->source[pose];
    if (x < 0 || y < 0 || x >= s->width || y >= s->height) return UINT32_MAX;
    const size_t q = (size_t)y * (size_t)s->width + (size_t)x, p = (size_t)l->anchor[a];
    if (!s->worth[q]) return UINT32_MAX;
    const uint32_t short_of = txi_shortfall(t, a, s->worth[q]);
    if (short_of >= limit) return UINT32_MAX;
    const uint32_t rest = limit - short_of;
    const uint32_t most = (uint32_t)((uint64_t)rest * (uint32_t)known / TXI_PATCH_AREA);
    const uint32_t d = txi_ssd(t->color + 4 * p, 4 * (size_t)l->width, o->known + 4 * p,
                               s->color + 4 * q, 4 * (size_t)s->width, most);
    if (d > most) return UINT32_MAX;
    const uint32_t full = d * TXI_PATCH_AREA / (uint32_t)known;
    return full >= rest ? UINT32_MAX : full + short_of;
}

static int txi_onion_known(const txi_onion *o, int p) {
    const int w = o->canvas->level->width;
    int known = 0;
    for (int k = 0; k < TXI_PATCH_AREA; k++)
        known += o->known[4 * (size_t)(p + k / TXI_PATCH * w + k % TXI_PATCH)] != 0;
    return known;
}

/* Keep the best few, the worst last. */
static void txi_onion_keep(txi_match *best, const txi_match *m, uint32_t cost) {
    int k = TXI_ONION_BEST - 1;
    for (; k > 0 && best[k - 1].cost > cost; k--) best[k] = best[k - 1];
    best[k] = *m;
    best[k].cost = cost;
}

/* Compare an anchor's patch with all places, then with the neighbours of the best in all poses. */
static void txi_onion_anchor(void *context, int index) {
    const txi_onion *o = (const txi_onion *)context;
    const txi_level *l = o->canvas->level;
    const int a = o->todo[index], known = txi_onion_known(o, l->anchor[a]);
    txi_match best[TXI_ONION_BEST], top;
    memset(best, 0, sizeof best);
    for (int k = 0; k < TXI_ONION_BEST; k++) {
        best[k].cost = UINT32_MAX;
        best[k].pose = -1;
    }
    for (int k = 0; k < o->place_count; k++) {
        const txi_match *m = &o->place[k];
        const uint32_t cost =
            txi_onion_cost(o, a, known, m->pose, m->x, m->y, best[TXI_ONION_BEST - 1].cost);
        if (cost < best[TXI_ONION_BEST - 1].cost) txi_onion_keep(best, m, cost);
    }
    top = best[0];
    for (int k = 0; k < TXI_ONION_BEST && best[k].pose >= 0; k++) {
        for (int i = 0; i < l->built_count; i++) {
            const txi_source *s = &l->source[l->built[i]];
            const int reach = l->built[i] == best[k].pose ? TXI_ONION_REACH : 0;
            int32_t cx, cy;
            int x0, y0;
            txi_match_centre(&l->source[best[k].pose], best[k].x, best[k].y, &cx, &cy);
            txi_match_at(s, cx, cy, &x0, &y0);
            for (int y = y0 - reach; y <= y0 + reach; y++) {
                for (int x = x0 - reach; x <= x0 + reach; x++) {
                    const uint32_t cost = txi_onion_cost(o, a, known, l->built[i], x, y, top.cost);
                    if (cost >= top.cost) continue;
                    top.cost = cost;
                    top.pose = (int16_t)l->built[i];
                    top.x = (int16_t)x;
                    top.y = (int16_t)y;
                }
            }
        }
    }
    o->found[a] = top;
}

/* Mark the next pixels to fill in ring: those at most TXI_ONION_RING from what is known. */
static int txi_onion_ring(const txi_onion *o, uint8_t *ring) {
    const txi_level *l = o->canvas->level;
    const int w = l->width;
    int count = 0;
    for (int i = 0; i < l->hole_count; i++) {
        const int p = l->hole[i];
        ring[p] = 0;
        if (o->known[4 * (size_t)p]) continue;
        for (int y = -TXI_ONION_RING; y <= TXI_ONION_RING && !ring[p]; y++)
            for (int x = -TXI_ONION_RING; x <= TXI_ONION_RING; x++)
                ring[p] |= o->known[4 * (size_t)(p + y * w + x)] != 0;
        count += ring[p];
    }
    return count;
}

/* The anchors of this pass: they cover a pixel of the ring, and enough of them is known. */
static void txi_onion_list(txi_onion *o, const uint8_t *ring, int share) {
    const txi_level *l = o->canvas->level;
    o->todo_count = 0;
    for (int a = 0; a < l->anchor_count; a++) {
        const int p = l->anchor[a], known = txi_onion_known(o, p);
        const int lattice = (p % l->width) % 2 == 0 && (p / l->width) % 2 == 0;
        const int most = known * 100 / l->filled[a];
        if (known == 0 || most < (lattice ? share : TXI_ONION_FULL)) continue;
        int covers = 0;
        for (int k = 0; !covers && k < TXI_PATCH_AREA; k++)
            covers = ring[p + k / TXI_PATCH * l->width + k % TXI_PATCH];
        if (!covers) continue;
        TXM_ASSERT(o->todo_count < l->anchor_count);
        o->todo[o->todo_count++] = a;
    }
}

/* Fill the ring's pixels that a patch of this pass covers; returns their number. */
static int txi_onion_fill(const txi_onion *o, const uint8_t *ring, uint8_t *current) {
    const txi_canvas *t = o->canvas;
    const txi_level *l = t->level;
    int filled = 0;
    memset(current, 0, (size_t)l->anchor_count);
    for (int k = 0; k < o->todo_count; k++) current[o->todo[k]] = o->found[o->todo[k]].pose >= 0;
    for (int i = 0; i < l->hole_count; i++) {
        const int p = l->hole[i];
        const uint8_t *color[TXI_PATCH_AREA];
        double weight[TXI_PATCH_AREA], sum[3] = {0, 0, 0}, total = 0;
        int n = 0;
        for (int k = 0; ring[p] && k < TXI_PATCH_AREA; k++) {
            const int y = k / TXI_PATCH, x = k % TXI_PATCH, a = l->slot[p - y * l->width - x];
            if (a < 0 || !current[a]) continue;
            const txi_match *m = &o->found[a];
            const txi_source *s = &l->source[m->pose];
            color[n] = s->color + 4 * ((size_t)(m->y + y) * (size_t)s->width + (size_t)(m->x + x));
            const double fit = m->cost / ((double)TXI_ONION_SPREAD * (double)TXI_PATCH_AREA);
            weight[n] = txm_exp2(-(fit < 500 ? fit : 500) * TXI_LOG2_E) + 1e-30;
            total += weight[n];
            for (int c = 0; c < 3; c++) sum[c] += weight[n] * color[n][c];
            n++;
        }
        double least = 1e30;
        for (int k = 0; k < n; k++) {
            double d = 0;
            for (int c = 0; c < 3; c++) {
                const double off = color[k][c] - sum[c] / total;
                d += off * off;
            }
            if (d >= least) continue;
            least = d;
            memcpy(t->color + 4 * (size_t)p, color[k], 3);
        }
        if (!n) continue;
        TXM_ASSERT(filled < l->hole_count);
        o->todo[l->anchor_count + filled++] = p;
    }
    for (int k = 0; k < filled; k++)
        memset(o->known + 4 * (size_t)o->todo[l->anchor_count + k], 255, 4);
    return filled;
}

/* The source patches to compare with: every step-th, so that the work is limited. */
static int txi_onion_places(const txi_level *l, txi_match *place, int most) {
    int total = 0, count = 0, at = 0;
    for (int k = 0; k < l->built_count; k++) total += txi_source_patches(&l->source[l->built[k]]);
    for (int k = 0; k < l->built_count; k++) {
        const txi_source *s = &l->source[l->built[k]];
        for (int q = 0; q < s->width * s->height; q++) {
            if (!s->worth[q]) continue;
            /* the i-th of total is taken if the whole part of i most / total grows */
            const int64_t i = at++;
            if (total > most && i * most / total == (i + 1) * most / total) continue;
            if (count == most) break;
            memset(&place[count], 0, sizeof place[count]);
            place[count].pose = (int16_t)l->built[k];
            place[count].x = (int16_t)(q % s->width);
            place[count++].y = (int16_t)(q / s->width);
        }
    }
    return count;
}

/* Matches of the anchors that had none: those of the nearest anchor that has one, shifted. */
static void txi_onion_rest(const txi_onion *o, txi_canvas *t) {
    const txi_level *l = t->level;
    for (int a = 0; a < l->anchor_count; a++) {
        const int p = l->anchor[a];
        txi_match best = o->found[a];
        for (int r = 1; best.pose < 0 && r <= 3; r++) {
            for (int k = 0; best.pose < 0 && k < (2 * r + 1) * (2 * r + 1); k++) {
                const int dx = k % (2 * r + 1) - r, dy = k / (2 * r + 1) - r;
                const int x = p % l->width + dx, y = p / l->width + dy;
                if (x < 0 || y < 0 || x >= l->width || y >= l->height) continue;
                const int b = l->slot[y * l->width + x];
                if (b < 0 || o->found[b].pose < 0) continue;
                txi_match m = o->found[b];
                m.x = (int16_t)(m.x - dx);
                m.y = (int16_t)(m.y - dy);
                if (txi_match_holds(l, &m)) best = m;
            }
        }
        t->match[a] = best;
    }
    t->fresh = 0;
}

/* Fill the hole of the coarsest level, and give its anchors matches. */
static txm_status txi_onion_peel(txi_canvas *t, txm_env *env) {
    const txi_level *l = t->level;
    const size_t n = (size_t)l->width * (size_t)l->height, anchors = (size_t)l->anchor_count;
    /* a hole that is long and thin has many anchors even at the coarsest level                   */
    const int share_of_work = TXI_ONION_WORK / (l->anchor_count / 2 + 1);
    int most = 3 * share_of_work;
    if (most > TXI_ONION_LEAST) most = TXI_ONION_LEAST;
    if (most < share_of_work) most = share_of_work;
    if (most < TXI_ONION_FEWEST) most = TXI_ONION_FEWEST;
    txm_arena scratch;
    txi_onion o;
    txm_status status = TXM_OK;
    txm_arena_init(&scratch, env);
    memset(&o, 0, sizeof o);
    o.canvas = t;
    o.known = (uint8_t *)txm_arena_zero(&scratch, n, 4);
    o.todo = (int32_t *)txm_arena_alloc(&scratch, anchors + (size_t)l->hole_count, sizeof(int32_t));
    o.found = (txi_match *)txm_arena_zero(&scratch, anchors, sizeof(txi_match));
    uint8_t *ring = (uint8_t *)txm_arena_zero(&scratch, n, 1);
    uint8_t *current = (uint8_t *)txm_arena_zero(&scratch, anchors, 1);
    txi_match *place = (txi_match *)txm_arena_alloc(&scratch, (size_t)most, sizeof(txi_match));
    if (scratch.failed) {
        txm_arena_free(&scratch);
        return txi_no_memory(env);
    }
    o.place = place;
    o.place_count = txi_onion_places(l, place, most);
    for (size_t a = 0; a < anchors; a++) o.found[a].pose = -1;
    for (size_t p = 0; p < n; p++) {
        if (l->state[p] == TXI_KNOWN || l->state[p] == TXI_FOREIGN) memset(o.known + 4 * p, 255, 4);
    }
    int share = TXI_ONION_SHARE;
    while (status == TXM_OK && txi_onion_ring(&o, ring) > 0) {
        txi_onion_list(&o, ring, share);
        txm_parallel_for(env, o.todo_count, txi_onion_anchor, &o);
        if (txi_onion_fill(&o, ring, current) == 0) {
            if (share <= 0) break; /* what is left is surrounded by void */
            share = share > 10 ? share - 10 : 0;
        }
        if (txm_progress(env, 0, "matching")) status = txi_stopped(env);
    }
    txi_onion_rest(&o, t);
    txm_arena_free(&scratch);
    return status;
}

#endif /* TEXINPAINT_ONION_H */
