#ifndef TEXSYN_ORDER_H
#define TEXSYN_ORDER_H

#include "darkness.h"

/* ---- the order of erosion ---------------------------------------------------------------

   Pixels erode one after the other, the strongest first, so that what is eroded at one level is
   part of what is at the next, and any number of pixels is a level. Erosion finds it easier to go
   on than to begin: a pixel beside an eroded one counts as stronger than it is, so cracks grow
   along their whole length before others begin. And a pixel waits until the cracked region it
   belongs to is long enough, which keeps single dark grains out. As regions only grow, waiting
   changes the order and nothing else; in terms of morphology, this is an attribute opening by the
   larger side of the bounding box, with a larger demand on the first regions than on later ones. */

enum {
    TXS_LONG_FIRST = 80, /* pixels: length of a region at the beginning ...                  */
    TXS_LONG_LAST = 12,  /* ... and from the full share on                                   */
    TXS_LONG_STEPS = 10, /* times at which the demand falls                                  */
    TXS_LONG_PART = 4,   /* and it is at most this part of the shorter side of the picture   */
    TXS_STRENGTHS = 4096, /* steps into which the range of strengths is divided              */
    TXS_ORDER_REPORT = 1 << 17 /* pixels between reports of progress, some hundredths of a second */
};
#define TXS_GO_ON 1.0f /* by how much a pixel beside an eroded one counts as stronger          */

/* A queue of pixels by strength: a list for each step. A pixel enters twice: with its own
   strength, and when it gets its first eroded neighbour. */
typedef struct txs_queue {
    int width, height;
    const float *strength;
    uint32_t *next;  /* 2 per pixel: the next entry in its list; entry / 2 is the pixel      */
    uint8_t *state;  /* of each pixel: TXS_BESIDE, TXS_ERODED                                 */
    uint32_t *first; /* of each list                                                         */
    int step;        /* no list above this one holds anything                                */
} txs_queue;

#define TXS_NO_PIXEL UINT32_MAX
enum { TXS_BESIDE = 1, TXS_ERODED = 2 };

static void txs_enter(txs_queue *q, uint32_t pixel, int is_beside) {
    const float range = TXS_MOST_DARK + TXS_GO_ON - TXS_LEAST_DARK;
    const float strength = q->strength[pixel] + (is_beside ? TXS_GO_ON : 0.0f);
    const float share = (strength - TXS_LEAST_DARK) / range;
    const int step = txm_clampi((int)((double)share * (double)TXS_STRENGTHS), 0, TXS_STRENGTHS - 1);
    const uint32_t entry = 2 * pixel + (uint32_t)is_beside;
    q->next[entry] = q->first[step];
    q->first[step] = entry;
    if (step > q->step) q->step = step;
}

/* the strongest pixel that is not taken yet; there must be one */
static uint32_t txs_take(txs_queue *q) {
    for (;;) {
        while (q->first[q->step] == TXS_NO_PIXEL) q->step--;
        const uint32_t entry = q->first[q->step], pixel = entry / 2;
        q->first[q->step] = q->next[entry];
        if (q->state[pixel] & TXS_ERODED) continue;
        q->state[pixel] |= TXS_ERODED;
        return pixel;
    }
}

/* Take all pixels; the values of order are these. 0: cancelled. */
static int txs_grow_cracks(txs_queue *q, uint32_t count, txm_pair *order, txm_env *env, float at) {
    memset(q->state, 0, count);
    memset(q->first, 0xff, TXS_STRENGTHS * sizeof *q->first);
    q->step = 0;
    for (uint32_t i = count; i-- > 0;) txs_enter(q, i, 0); /* of equal ones the first comes first */
    for (uint32_t k = 0; k < count; k++) {
        if (k % TXS_ORDER_REPORT == 0 && txm_progress(env, at, "order")) return 0;
        const uint32_t p = txs_take(q);
        const int x = (int)(p % (uint32_t)q->width), y = (int)(p / (uint32_t)q->width);
        order[k].value = p;
        for (int v = y > 0 ? y - 1 : y; v <= y + 1 && v < q->height; v++) {
            for (int u = x > 0 ? x - 1 : x; u <= x + 1 && u < q->width; u++) {
                const uint32_t beside = (uint32_t)v * (uint32_t)q->width + (uint32_t)u;
                if (q->state[beside]) continue;
                q->state[beside] = TXS_BESIDE;
                txs_enter(q, beside, 1);
            }
        }
    }
    return 1;
}

/* Regions of pixels that have been reached, as trees with their root as the name. Pixels of a
   region that waits are linked in a ring. */
typedef struct txs_regions {
    int width, height;
    uint32_t *parent;   /* of each pixel; itself at a root; none: not reached yet             */
    uint32_t *ring;     /* the next pixel of the same waiting region                         */
    int32_t *box;       /* 4 per pixel, valid at roots: least x, y, largest x, y; least x is
                           TXS_RELEASED once a region no longer waits                        */
    txm_pair *order;    /* key: when a pixel was released                                    */
    uint32_t *place;    /* of each pixel in order                                            */
} txs_regions;

enum { TXS_RELEASED = -1 };

static uint32_t txs_root_of(txs_regions *r, uint32_t p) {
    while (r->parent[p] != p) {
        r->parent[p] = r->parent[r->parent[p]];
        p = r->parent[p];
    }
    return p;
}

static int txs_region_waits(const txs_regions *r, uint32_t root) {
    return r->box[4 * (size_t)root] != TXS_RELEASED;
}

/* All pixels of a waiting region are released at a time. */
static void txs_release(txs_regions *r, uint32_t root, uint32_t time) {
    uint32_t p = root;
    do {
        r->order[r->place[p]].key = time;
        p = r->ring[p];
    } while (p != root);
    r->box[4 * (size_t)root] = TXS_RELEASED;
}

static int txs_region_length(const txs_regions *r, uint32_t root) {
    const int32_t *b = r->box + 4 * (size_t)root;
    return 1 + (b[2] - b[0] > b[3] - b[1] ? b[2] - b[0] : b[3] - b[1]);
}

/* Join two regions. If only one of them waits, its wait is over. */
static void txs_join_regions(txs_regions *r, uint32_t a, uint32_t b, uint32_t time) {
    a = txs_root_of(r, a);
    b = txs_root_of(r, b);
    if (a == b) return;
    const int a_waits = txs_region_waits(r, a), b_waits = txs_region_waits(r, b);
    if (a_waits && !b_waits) txs_release(r, a, time);
    if (b_waits && !a_waits) txs_release(r, b, time);
    if (a_waits && b_waits) {
        int32_t *to = r->box + 4 * (size_t)a;
        const int32_t *from = r->box + 4 * (size_t)b;
        for (int k = 0; k < 2; k++) {
            if (from[k] < to[k]) to[k] = from[k];
            if (from[2 + k] > to[2 + k]) to[2 + k] = from[2 + k];
        }
        const uint32_t next = r->ring[a];
        r->ring[a] = r->ring[b];
        r->ring[b] = next;
    }
    r->parent[b] = a;
}

/* Reach one more pixel. */
static void txs_reach_pixel(txs_regions *r, uint32_t p, uint32_t time) {
    const int x = (int)(p % (uint32_t)r->width), y = (int)(p / (uint32_t)r->width);
    int32_t *box = r->box + 4 * (size_t)p;
    r->parent[p] = r->ring[p] = p;
    box[0] = box[2] = x;
    box[1] = box[3] = y;
    for (int v = y > 0 ? y - 1 : y; v <= y + 1 && v < r->height; v++) {
        for (int u = x > 0 ? x - 1 : x; u <= x + 1 && u < r->width; u++) {
            const uint32_t q = (uint32_t)v * (uint32_t)r->width + (uint32_t)u;
            if (q != p && r->parent[q] != TXS_NO_PIXEL) txs_join_regions(r, q, p, time);
        }
    }
}

/* the length demanded of a region when `step` of TXS_LONG_STEPS are over */
static int txs_demand(const txs_regions *r, int step) {
    const int side = r->width < r->height ? r->width : r->height;
    const int length = TXS_LONG_FIRST -
                       (TXS_LONG_FIRST - TXS_LONG_LAST) * step / TXS_LONG_STEPS;
    return length < side / TXS_LONG_PART ? length : side / TXS_LONG_PART;
}

/* Reach all pixels in order and note when each is released. 0: cancelled. */
static int txs_reach_all(txs_regions *r, uint32_t count, double share, txm_env *env, float at) {
    const double span = share * (double)count / (double)TXS_LONG_STEPS;
    int step = 0, demand = txs_demand(r, 0);
    memset(r->parent, 0xff, (size_t)count * sizeof *r->parent);
    for (uint32_t k = 0; k < count; k++) r->place[r->order[k].value] = k;
    for (uint32_t k = 0; k < count; k++) {
        if (k % TXS_ORDER_REPORT == 0 && txm_progress(env, at, "order")) return 0;
        if (step < TXS_LONG_STEPS && (double)k >= span * (step + 1)) { /* the demand falls */
            demand = txs_demand(r, ++step);
            for (uint32_t i = 0; i < k; i++) {
                const uint32_t p = r->order[i].value;
                if (r->parent[p] == p && txs_region_waits(r, p) &&
                    txs_region_length(r, p) >= demand)
                    txs_release(r, p, k);
            }
        }
        const uint32_t p = r->order[k].value;
        r->order[k].key = count; /* for those that are never released */
        txs_reach_pixel(r, p, k);
        const uint32_t root = txs_root_of(r, p);
        if (txs_region_waits(r, root) && txs_region_length(r, root) >= demand)
            txs_release(r, root, k);
    }
    return 1;
}

/* rank receives for each pixel how many erode before it; memory for the work is taken from arena. */
static txm_status txs_find_ranks(const float *strength, int width, int height, double share,
                                 txm_arena *arena, uint32_t *rank, txm_env *env, float at) {
    const size_t n = txs_pixels_of(width, height);
    txs_regions r;
    txs_queue q;
    q.next = (uint32_t *)txm_arena_alloc(arena, n, 2 * sizeof(uint32_t));
    q.state = (uint8_t *)txm_arena_alloc(arena, n, 1);
    q.first = (uint32_t *)txm_arena_alloc(arena, TXS_STRENGTHS, sizeof(uint32_t));
    r.width = width;
    r.height = height;
    r.order = (txm_pair *)txm_arena_alloc(arena, n, 2 * sizeof(txm_pair));
    r.parent = (uint32_t *)txm_arena_alloc(arena, n, sizeof(uint32_t));
    r.ring = (uint32_t *)txm_arena_alloc(arena, n, sizeof(uint32_t));
    r.place = (uint32_t *)txm_arena_alloc(arena, n, sizeof(uint32_t));
    r.box = (int32_t *)txm_arena_alloc(arena, n, 4 * sizeof(int32_t));
    if (arena->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the order of erosion");
    q.width = width;
    q.height = height;
    q.strength = strength;
    if (!txs_grow_cracks(&q, (uint32_t)n, r.order, env, at) ||
        !txs_reach_all(&r, (uint32_t)n, share, env, at))
        return txm_fail(env, TXM_CANCELLED, "cancelled");
    txm_sort_pairs(r.order, r.order + n, n); /* stable: pixels of a region stay in order */
    for (size_t k = 0; k < n; k++) rank[r.order[k].value] = (uint32_t)k;
    return TXM_OK;
}

#endif /* TEXSYN_ORDER_H */
