#ifndef TREEPIECES_SPACE_H
#define TREEPIECES_SPACE_H

#include "rim.h"

/* ---- space: which stems are near --------------------------------------------------------- */

enum {
    TPC_SPACE_CELLS = 8 /* a stem is entered in at most so many; longer ones in a list of their own */
};

/* The axis of a piece, which is thought to be a straight cone with round ends. */
typedef struct tpc_limb {
    float from[3], to[3];
    float radius, end; /* at its ends, metres */
    int32_t parent;    /* of its segment      */
    float middle[3], half; /* half its length */
} tpc_limb;

/* Set the middle of a limb and half its length. */
static void tpc_limb_measure(tpc_limb *limb) {
    float half[3];
    for (int k = 0; k < 3; k++) {
        half[k] = 0.5f * (limb->to[k] - limb->from[k]);
        limb->middle[k] = limb->from[k] + half[k];
    }
    limb->half = sqrtf(tpc_dot(half, half));
}

/* A stem in a cell. */
typedef struct tpc_entry {
    int32_t next, limb;
} tpc_entry;

/* The stems of a tree that grows, found by cells of a grid. */
typedef struct tpc_space {
    tpc_limb *limbs;    /* by node; as many as the tree may have                                */
    tpc_entry *entries; /* TPC_SPACE_CELLS for each                                             */
    int32_t *heads;     /* of lists of entries, by a hash of cells: 2^bits                      */
    int32_t long_ones;
    int limb_count, entry_count, capacity, bits; /* capacity: of stems */
    float per_metre;                             /* cells              */
} tpc_space;

/* Room for a tree of so many pieces; 0 if there is no memory. */
static int tpc_space_make(tpc_space *s, int capacity, txm_arena *arena) {
    s->capacity = capacity;
    s->bits = 3;
    while (1 << s->bits < capacity) s->bits++;
    s->limbs = (tpc_limb *)txm_arena_alloc(arena, (size_t)capacity, sizeof *s->limbs);
    s->entries = (tpc_entry *)txm_arena_alloc(arena, (size_t)capacity * TPC_SPACE_CELLS, sizeof *s->entries);
    s->heads = (int32_t *)txm_arena_alloc(arena, (size_t)1 << s->bits, sizeof *s->heads);
    return !arena->failed;
}

/* cell: its side in metres, > 0 */
static void tpc_space_clear(tpc_space *s, float cell) {
    s->limb_count = s->entry_count = 0;
    s->long_ones = -1;
    s->per_metre = 1 / cell;
    for (int i = 0; i < 1 << s->bits; i++) s->heads[i] = -1;
}

/* The cells that a stem may reach into: the least and the greatest along each axis. */
static int tpc_space_range(const tpc_space *s, const tpc_limb *limb, int least[3], int most[3]) {
    const float r = txm_maxf(limb->radius, limb->end);
    int cells = 1;
    for (int k = 0; k < 3; k++) {
        const float low = (txm_minf(limb->from[k], limb->to[k]) - r) * s->per_metre;
        const float high = (txm_maxf(limb->from[k], limb->to[k]) + r) * s->per_metre;
        least[k] = (int)txm_clampf(low, -1e8f, 1e8f) - (low < 0);
        most[k] = (int)txm_clampf(high, -1e8f, 1e8f) - (high < 0);
        const int across = most[k] - least[k] + 1;
        cells = across > TPC_SPACE_CELLS ? TPC_SPACE_CELLS + 1 : cells * across;
        if (cells > TPC_SPACE_CELLS) return cells;
    }
    return cells;
}

static int32_t *tpc_space_head(tpc_space *s, int x, int y, int z) {
    const uint32_t h = (uint32_t)x * 0x9e3779b1u ^ (uint32_t)y * 0x85ebca77u ^ (uint32_t)z * 0xc2b2ae3du;
    return &s->heads[h >> (32 - s->bits)];
}

static void tpc_space_enter(tpc_space *s, int32_t *head) {
    TXM_ASSERT(s->entry_count < s->capacity * TPC_SPACE_CELLS);
    tpc_entry *e = &s->entries[s->entry_count];
    e->next = *head;
    e->limb = s->limb_count;
    *head = s->entry_count++;
}

/* Add the stem of the next node. */
static void tpc_space_add(tpc_space *s, const tpc_limb *limb) {
    int least[3], most[3];
    TXM_ASSERT(s->limb_count < s->capacity);
    s->limbs[s->limb_count] = *limb;
    if (tpc_space_range(s, limb, least, most) > TPC_SPACE_CELLS) {
        tpc_space_enter(s, &s->long_ones);
    } else {
        for (int x = least[0]; x <= most[0]; x++)
            for (int y = least[1]; y <= most[1]; y++)
                for (int z = least[2]; z <= most[2]; z++)
                    tpc_space_enter(s, tpc_space_head(s, x, y, z));
    }
    s->limb_count++;
}

/* ---- space: do stems touch ---------------------------------------------------------------- */

/* The nearest places of two axes, 0..1 along each; returns the square of their distance. away: from
   the place on b to that on a. */
static float tpc_nearest(const tpc_limb *a, const tpc_limb *b, float *along_a, float *along_b,
                         float away[3]) {
    float u[3], v[3], w[3];
    for (int k = 0; k < 3; k++) {
        u[k] = a->to[k] - a->from[k];
        v[k] = b->to[k] - b->from[k];
        w[k] = a->from[k] - b->from[k];
    }
    const float uu = tpc_dot(u, u), vv = tpc_dot(v, v), uv = tpc_dot(u, v);
    const float uw = tpc_dot(u, w), vw = tpc_dot(v, w), area = uu * vv - uv * uv;
    const float tiny = 1e-20f;
    float s = area > 1e-6f * uu * vv ? txm_clampf((uv * vw - uw * vv) / area, 0, 1) : 0;
    float t = (uv * s + vw) / (vv > tiny ? vv : tiny);
    if (t < 0 || t > 1) {
        t = t < 0 ? 0 : 1;
        s = txm_clampf((t * uv - uw) / (uu > tiny ? uu : tiny), 0, 1);
    }
    for (int k = 0; k < 3; k++) away[k] = w[k] + (s * u[k] - t * v[k]);
    *along_a = s;
    *along_b = t;
    return tpc_dot(away, away);
}

/* Do the stems come nearer to each other than `clearance` times the sum of their radii there? along:
   receives how far along the axis of `a`, metres. */
static int tpc_limbs_touch(const tpc_limb *a, const tpc_limb *b, float clearance, float *along, float away[3]) {
    float s, t, square = tpc_nearest(a, b, &s, &t, away);
    const float radii = txm_lerpf(a->radius, a->end, s) + txm_lerpf(b->radius, b->end, t);
    if (square >= clearance * clearance * radii * radii) return 0;
    const float axis[3] = {a->to[0] - a->from[0], a->to[1] - a->from[1], a->to[2] - a->from[2]};
    *along = s * sqrtf(tpc_dot(axis, axis));
    return 1;
}

/* Do the stem of a node to come and that of a node that is there come from one fork a few pieces below? */
static int tpc_is_kin(const tpc_space *s, int32_t parent, int32_t other) {
    enum { GENERATIONS = 6 };
    for (int up = 0; up < GENERATIONS && parent != other; up++) {
        if (parent > other) parent = s->limbs[parent].parent;
        else other = s->limbs[other].parent;
    }
    return parent == other;
}

/* Is a stem, not yet added, too near to another one? Its parent, that one's parent and its other
   children do not count; neither do kin near the fork, up to a distance of `fork` along the stem. */
static int tpc_limb_hits(const tpc_space *s, const tpc_limb *limb, int32_t other, float clearance,
                         float fork, float away[3]) {
    const int32_t up = limb->parent;
    const tpc_limb *b = &s->limbs[other];
    const float between[3] = {limb->middle[0] - b->middle[0], limb->middle[1] - b->middle[1],
                              limb->middle[2] - b->middle[2]};
    const float thick = txm_maxf(limb->radius, limb->end) + txm_maxf(b->radius, b->end);
    const float reach = limb->half + b->half + clearance * thick;
    if (tpc_dot(between, between) > reach * reach) return 0; /* the usual case */
    float along;
    if (other == up || other == s->limbs[up].parent || s->limbs[other].parent == up) return 0;
    return tpc_limbs_touch(limb, &s->limbs[other], clearance, &along, away) &&
           (along > fork || !tpc_is_kin(s, up, other));
}

/* The number of a stem to which one with a parent, not yet added, comes too near, or TREEPIECES_NONE. away:
   receives the direction out of it, not normalized. fork: see tpc_limb_hits. */
static int32_t tpc_space_touches(tpc_space *s, const tpc_limb *limb, float clearance, float fork, float away[3]) {
    int least[3], most[3];
    tpc_limb wide = *limb;
    wide.radius *= clearance;
    wide.end *= clearance;
    const int cells = tpc_space_range(s, &wide, least, most);
    if (cells > TPC_SPACE_CELLS) { /* rare: look at all */
        for (int32_t i = 0; i < s->limb_count; i++)
            if (tpc_limb_hits(s, limb, i, clearance, fork, away)) return i;
        return TREEPIECES_NONE;
    }
    for (int32_t e = s->long_ones; e >= 0; e = s->entries[e].next)
        if (tpc_limb_hits(s, limb, s->entries[e].limb, clearance, fork, away)) return s->entries[e].limb;
    for (int x = least[0]; x <= most[0]; x++)
        for (int y = least[1]; y <= most[1]; y++)
            for (int z = least[2]; z <= most[2]; z++)
                for (int32_t e = *tpc_space_head(s, x, y, z); e >= 0; e = s->entries[e].next)
                    if (tpc_limb_hits(s, limb, s->entries[e].limb, clearance, fork, away)) return s->entries[e].limb;
    return TREEPIECES_NONE;
}

#endif /* TREEPIECES_SPACE_H */
