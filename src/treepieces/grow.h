#ifndef TREEPIECES_GROW_H
#define TREEPIECES_GROW_H

#include "sketch.h"
#include "space.h"

/* ---- growing: the state of a tree --------------------------------------------------------- */

enum {
    TPC_FRAME = 8,         /* axes that decide how high the tree is                         */
    TPC_BUCKETS = 160,     /* of leaf rims that wait for an axis, by the logarithm of its length */
    TPC_GRID = 16,         /* cells along a side of the shade grid                          */
    TPC_FORK = 2,          /* radii of a stem, up to where it may touch others of its fork  */
    TPC_MAX_BRANCH = 60    /* percent: largest radius of a side branch over that of its stem */
};

/* Ours, see docs/choices.md#choices-in-treepiecesh; how many tiles lie across a quad, how thin twigs
   get, where shade is counted, and where hanging axes end. */
static const float tpc_tile_width = 0.1f;     /* wanted, in base radii of the trunk             */
static const float tpc_halving_width = 0.58f; /* of that: narrower tiles are halved in number   */
static const float tpc_twig_radius = 0.033f;  /* the least, in base radii of the trunk          */
static const float tpc_grid_width = 1.6f;     /* of the shade grid, in trunk lengths            */
static const float tpc_clearance = 0.04f;     /* above the ground, in trunk lengths             */
static const float tpc_cell_steps = 1.25f;    /* of the grid of stems, in steps of the trunk    */

static const float tpc_dome = 0.8f;           /* fall of the dome over crowns, see tpc_limit_rise  */
static const float tpc_slack = 0.8f;          /* more clearance, as tubes cut corners             */
static const float tpc_beyond = 10;          /* importance of reach beyond the crown, over length */
static const float tpc_waiting = 100;        /* of axes in the shade, over the share of pieces above */
static const float tpc_rise = 0.5f;          /* of axes towards the light, over their turn aside     */

/* The open rim where an axis goes on. */
typedef struct tpc_bud {
    uint64_t seed;                /* of all that is drawn for its piece and those beyond it     */
    int32_t parent;               /* segment, or TREEPIECES_NONE                                */
    uint8_t rim, order;
    uint8_t is_forked, is_aimed;  /* after a fork, where `start` no longer applies; `aim` is the
                                     direction of the piece after this one                      */
    uint16_t depth;
    float position[3], rotation[4], axis[3]; /* of the rim, from the foot of the tree, but turned as
                                     in the world; axis: its y axis                             */
    float heading[3];             /* of growth                                                  */
    float aim[3];
    float radius, end_radius;     /* here, and at the end of the axis                           */
    float rest;                   /* of its step, which a short branching piece left over for a
                                     plain one                                                  */
    float along, length, step;    /* of the axis; step: length of a piece                       */
    float roll;                   /* degrees about the axis to the next branch, in the
                                     frame of the rim                                           */
} tpc_bud;

/* A leaf rim that waits for its axis. */
typedef struct tpc_wait {
    int32_t next; /* in its bucket                                                    */
    int32_t segment, rim;
    float length, end[3]; /* what is expected of the axis: how long it is, and where it ends;
                             length is less for those that may leave gaps */
} tpc_wait;

/* A tree while it grows. */
typedef struct tpc_growth {
    const treepieces_forest_desc *desc;
    const treepieces_kit *kit;
    const treepieces_species *species;
    treepieces_place place;
    txm_rng rng;
    txm_status status;
    const char *fault;
    int index; /* of the tree */
    treepieces_node *nodes;
    uint32_t *bands;   /* by node: word 3 of its record        */
    uint32_t *records; /* by node: number of its record, set at the end */
    treepieces_cluster *clusters;
    tpc_sketch sketch;
    tpc_run run; /* of the axis that grows */
    tpc_wait *waits;
    int node_count, cluster_count, wait_count, most, most_segments, bucket;
    int32_t first[TPC_BUCKETS], last[TPC_BUCKETS];
    uint32_t type_counts[TREEPIECES_MAX_TYPES];
    float scale, trunk, foot; /* scale of the place; length and base radius of the trunk, metres  */
    float height;
    float low[3], high[3];          /* of the box about all stems that have grown                 */
    float ceiling;                  /* no later stem grows above this                             */
    float aside[TREEPIECES_MAX_ORDERS][2][2]; /* cosine and sine of angle_base and angle_top        */
    uint16_t shade[TPC_GRID][TPC_GRID][TPC_GRID]; /* x, z, y: pieces in this cell and above       */
    tpc_space space; /* where the species has a clearance */
} tpc_growth;

static float tpc_uniform(tpc_growth *g, float low, float high) {
    return low + (high - low) * txm_rng_float(&g->rng);
}

/* What is drawn at an open rim depends on its seed alone, not on what grew elsewhere before: a tree of
   fewer pieces is part of one of more. */
enum { TPC_OPENING = 1, TPC_ATTACHING, TPC_LEAFING }; /* streams */

static void tpc_draw_for(tpc_growth *g, uint64_t seed, uint64_t stream) {
    g->rng = txm_rng_make(seed, stream);
}

/* ---- growing: light --------------------------------------------------------------------------- */

/* the shade cell of a position; returns the side of a cell */
static float tpc_cell(const tpc_growth *g, const float position[3], int cell[3]) {
    const float side = tpc_grid_width * g->trunk / (float)TPC_GRID;
    for (int k = 0; k < 3; k++) {
        const float middle = k == 1 ? 0 : (float)TPC_GRID / 2;
        const float at = position[k] / side + middle;
        cell[k] = at > 0 ? at < (float)TPC_GRID ? (int)at : TPC_GRID - 1 : 0;
    }
    return side;
}

static int tpc_casts_shade(const treepieces_species *species) {
    return species->shade > 0 || species->phototropism > 0;
}

static void tpc_cast_shade(tpc_growth *g, const float position[3]) {
    int c[3];
    if (!tpc_casts_shade(g->species)) return;
    tpc_cell(g, position, c);
    uint16_t *column = g->shade[c[0]][c[2]];
    for (int y = 0; y <= c[1]; y++) column[y] = (uint16_t)(column[y] + (column[y] < UINT16_MAX));
}

/* The part of all pieces that lies above a position. */
static float tpc_shade_share(const tpc_growth *g, const float position[3]) {
    int c[3];
    tpc_cell(g, position, c);
    return (float)g->shade[c[0]][c[2]][c[1]] / (float)g->sketch.segment_count;
}

/* Towards the light: from where more pieces are above to where fewer are; each component -1..1. */
static void tpc_find_light(const tpc_growth *g, const float position[3], float towards[3]) {
    int c[3];
    tpc_cell(g, position, c);
    for (int k = 0; k < 3; k++) {
        int before[3] = {c[0], c[1], c[2]}, after[3] = {c[0], c[1], c[2]};
        if (before[k] > 0) before[k]--;
        if (after[k] + 1 < TPC_GRID) after[k]++;
        const int low = g->shade[before[0]][before[2]][before[1]], high = g->shade[after[0]][after[2]][after[1]];
        towards[k] = (float)(low - high) / (float)(low + high + 1);
    }
}

/* ---- growing: rims by the importance of their axes ------------------------------------------ */

/* The bits of a positive float, which grow about as its logarithm, by 2^23 per octave. */
static uint32_t tpc_float_bits(float x) {
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

/* Eight buckets per octave, the most important first: from 2, in lengths of the trunk. */
static int tpc_bucket(float importance) {
    return txm_clampi((int)(0x40000000u >> 20) - (int)(tpc_float_bits(importance) >> 20), 0, TPC_BUCKETS - 1);
}

/* The longer an axis is, and the further it leads out of the box about what has grown so far, the more
   does the tree lose without it; the less light its end gets, the less. */
static float tpc_importance(const tpc_growth *g, const tpc_wait *w) {
    float beyond = 0;
    for (int k = 0; k < 3; k++) {
        beyond = txm_maxf(beyond, (k == 1 ? 2.0f : 1.0f) * (w->end[k] - g->high[k]));
        if (k != 1) beyond = txm_maxf(beyond, g->low[k] - w->end[k]);
    }
    float length = w->length;
    const float light = g->species->phototropism;
    if (light > 0) length /= 1 + tpc_waiting * light * tpc_shade_share(g, w->end);
    return (length + tpc_beyond * beyond) / g->trunk;
}

/* Put a rim after the last one into its bucket. */
static void tpc_push(tpc_growth *g, int32_t i) {
    tpc_wait *w = &g->waits[i];
    const int b = tpc_bucket(tpc_importance(g, w));
    w->next = -1;
    if (g->first[b] < 0) g->first[b] = i;
    else g->waits[g->last[b]].next = i;
    g->last[b] = i;
    if (b < g->bucket) g->bucket = b;
}

/* Take out the most important one, or NULL. Where the tree has grown meanwhile, it waits again. */
static const tpc_wait *tpc_pop(tpc_growth *g) {
    for (;;) {
        while (g->bucket < TPC_BUCKETS && g->first[g->bucket] < 0) g->bucket++;
        if (g->bucket == TPC_BUCKETS) return NULL;
        const int b = g->bucket;
        const int32_t i = g->first[b];
        g->first[b] = g->waits[i].next;
        if (tpc_bucket(tpc_importance(g, &g->waits[i])) <= b) return &g->waits[i];
        tpc_push(g, i);
    }
}

/* ---- growing: pruning ---------------------------------------------------------------------- */

static int tpc_is_outside(const tpc_growth *g, const tpc_bud *bud) {
    const treepieces_species *s = g->species;
    if (s->envelope == TREEPIECES_FREE) return 0;
    const float x = bud->position[0], z = bud->position[2];
    const float y = bud->position[1] / g->trunk;
    const float h = (y - s->crown_base) / (s->crown_top - s->crown_base);
    if (h > 1) return 1;
    if (bud->order == 0) return 0;
    if (h < 0) return 1;
    float r = 0.5f * s->crown_width * g->trunk;
    if (s->envelope == TREEPIECES_CONE) r *= 1 - h;
    if (s->envelope == TREEPIECES_ELLIPSOID) r *= sqrtf(1 - (2 * h - 1) * (2 * h - 1));
    return x * x + z * z > r * r;
}

static int tpc_is_shaded(const tpc_growth *g, const tpc_bud *bud) {
    if (!(g->species->shade > 0) || bud->order == 0) return 0;
    int c[3];
    const float side = tpc_cell(g, bud->position, c) / g->scale;
    if (c[1] + 1 >= TPC_GRID) return 0;
    return (float)g->shade[c[0]][c[2]][c[1] + 1] > g->species->shade * side * side;
}

/* ---- growing: the grammar ------------------------------------------------------------------ */

static const treepieces_order *tpc_order(const tpc_growth *g, int order) {
    return &g->species->orders[order < g->species->order_count ? order : g->species->order_count - 1];
}

/* Choose the type of the next piece. */
static int tpc_choose_type(tpc_growth *g, const tpc_bud *bud) {
    const treepieces_order *o = tpc_order(g, bud->order);
    if (bud->depth == 0 && g->species->flare > 1) return TREEPIECES_FLARE;
    if ((1 - bud->along) * bud->length < 0.5f * bud->step || tpc_is_outside(g, bud) ||
        tpc_is_shaded(g, bud) || bud->position[1] > g->ceiling)
        return TREEPIECES_TIP;
    /* a hanging axis ends before it reaches the ground */
    if (bud->heading[1] < 0 && bud->position[1] < tpc_clearance * g->trunk)
        return TREEPIECES_TIP;
    if (g->desc->rule == TREEPIECES_ALTERNATE) return bud->depth & 1 ? TREEPIECES_Y : TREEPIECES_I;
    if (g->desc->rule == TREEPIECES_RANDOM)
        return txm_rng_next(&g->rng) >> 31 ? TREEPIECES_Y : TREEPIECES_I;
    float dice = txm_rng_float(&g->rng);
    if ((!bud->is_forked && bud->along < o->start) || (bud->along == 0 && bud->order > 0))
        return TREEPIECES_I; /* a branch's first piece does not twist */
    if (bud->rest > 0) return TREEPIECES_I;
    if (bud->order + 1 < g->species->order_count) {
        if ((dice -= o->side) < 0) return TREEPIECES_SIDE;
        if ((dice -= o->pair) < 0) return TREEPIECES_PLANAR;
    }
    if ((dice -= o->fork) < 0) return TREEPIECES_Y;
    if (dice < o->triple) return TREEPIECES_SPATIAL;
    return TREEPIECES_I;
}

/* The smallest radius of twigs, so that texels are not much smaller on them than on the trunk. */
static float tpc_thinnest(const tpc_growth *g) {
    return tpc_twig_radius * g->foot;
}

/* The least length of a piece, in radii, at which its type keeps its proportions. */
static float tpc_shortest(int type) {
    static const float low[TREEPIECES_BUILTIN] = {1, 1, 2, 2, 1, 1.2f, 1};
    return low[type];
}

/* log2 of the tiles across an edge of a rim, as tpc_bands comes to it. */
static int tpc_tiles_across(const tpc_growth *g, float radius) {
    int across = 0;
    while (across < 4 && radius >= tpc_halving_width * tpc_tile_width * g->foot * (float)(2 << across))
        across++;
    return across;
}

/* The most length of a piece, in radii: at most 8 tiles lie along a quad, so one with many across must not be
   long. */
static float tpc_tallest(const tpc_growth *g, float radius, int type) {
    static const float high[TREEPIECES_BUILTIN] = {40, 2.5f, 3, 3, 2.5f, 18, 1.4f};
    const int across = tpc_tiles_across(g, radius);
    return txm_minf(high[type], (type == TREEPIECES_I ? 64.0f : 20.0f) / (float)(1 << across));
}

/* The length of the next segment, limited to a range of radii so that its type keeps its proportions. */
static float tpc_choose_length(const tpc_growth *g, const tpc_bud *bud, int type) {
    const float low = tpc_shortest(type);
    const float left = (1 - bud->along) * bud->length;
    const float step = bud->rest > 0 ? bud->rest : bud->step;
    float length = step < left ? step : left;
    if (type == TREEPIECES_TIP && length < 0.7f * bud->step) length = 0.7f * bud->step;
    const int as = tpc_bears_branches(&g->sketch, type) ? (int)TREEPIECES_I : type;
    const float most = tpc_tallest(g, bud->radius, as);
    return txm_clampf(length, low * bud->radius, txm_maxf(most, low) * bud->radius);
}

static void tpc_choose(tpc_growth *g, const tpc_bud *bud, treepieces_choice *c) {
    const treepieces_order *o = tpc_order(g, bud->order);
    const int type = tpc_choose_type(g, bud);
    memset(c, 0, sizeof *c);
    c->type = type;
    memcpy(c->direction, bud->heading, sizeof c->direction);
    c->length = tpc_choose_length(g, bud, type);
    c->turn = type == TREEPIECES_I ? (int)txm_rng_below(&g->rng, TREEPIECES_RIM) : -1;
    const float left = (1 - bud->along) * bud->length;
    const float share = left > c->length ? c->length / left : 1;
    const float on = 1 + (bud->end_radius / bud->radius - 1) * share; /* the taper of the stem */
    c->ratios[0] = txm_clampf(on, 0.3f, 1);
    if (type == TREEPIECES_FLARE) c->ratios[0] = 1 / g->species->flare;
    if (type == TREEPIECES_Y) {
        const float uneven = tpc_uniform(g, -0.14f, 0.14f);
        c->ratios[0] = 0.76f + uneven;
        c->ratios[1] = 0.76f - uneven;
    } else if (type == TREEPIECES_SPATIAL) {
        for (int k = 0; k < 3; k++) c->ratios[k] = tpc_uniform(g, 0.54f, 0.72f);
    }
    if (type == TREEPIECES_Y || type == TREEPIECES_SPATIAL) {
        const float least = txm_minf(1, tpc_thinnest(g) / bud->radius);
        for (int k = 0; k < 3; k++) c->ratios[k] = txm_maxf(c->ratios[k], least);
    } else if (type == TREEPIECES_SIDE || type == TREEPIECES_PLANAR) {
        const float ratio = tpc_order(g, bud->order + 1)->radius, thinnest = tpc_thinnest(g);
        for (int k = 1; k < 3; k++)
            c->ratios[k] = txm_clampf(txm_maxf(ratio * tpc_uniform(g, 0.85f, 1.15f), thinnest / bud->radius),
                                      0.05f, (float)TPC_MAX_BRANCH / 100);
    }
    c->leaves = g->species->leaf_count > 0 && bud->along >= o->leaves_start && o->leaves > 0 &&
                txm_rng_float(&g->rng) < o->leaves;
}

/* The first axes decide how high the tree is: others rise less and less under a dome as high, and end there. */
static void tpc_limit_rise(const tpc_growth *g, tpc_bud *bud) {
    const float x = bud->position[0], z = bud->position[2];
    const float room = g->ceiling - bud->position[1] - tpc_dome * (x * x + z * z) / g->trunk;
    if (bud->heading[1] * 3 * bud->step <= room || bud->heading[1] <= 0) return;
    bud->heading[1] = txm_maxf(room / (3 * bud->step), 0);
    tpc_unit_or_up(bud->heading);
    if (room < 0.5f * bud->step) bud->along = 1;
}

/* Turn the axis a little: wander, tropism, light, sag. */
static void tpc_steer(tpc_growth *g, tpc_bud *bud, float length) {
    const treepieces_order *o = tpc_order(g, bud->order);
    float *h = bud->heading;
    const float degree = 0.0174532925f;
    if (o->wander > 0) {
        float aside[3] = {tpc_uniform(g, -1, 1) * o->wander * degree, 0, 0};
        aside[2] = tpc_uniform(g, -1, 1) * o->wander * degree;
        tpc_rotate(bud->rotation, aside, aside);
        for (int k = 0; k < 3; k++) h[k] += aside[k];
    }
    /* the component of "up" orthogonal to the heading is the sine of the angle between them */
    const float up = o->tropism, rise = h[1], light = bud->order > 0 ? g->species->phototropism : 0;
    h[0] -= up * rise * h[0];
    h[1] += up * (1 - rise * rise);
    h[2] -= up * rise * h[2];
    if (light > 0) {
        float towards[3];
        tpc_find_light(g, bud->position, towards);
        for (int k = 0; k < 3; k++) h[k] += (k == 1 ? tpc_rise : 1) * light * towards[k];
    }
    if (o->sag != 0) {
        const float at = bud->along + 0.5f * length / bud->length;
        const float fall = o->sag * degree * 2 * at * (length / bud->length);
        h[1] -= fall * sqrtf(h[0] * h[0] + h[2] * h[2] + 0.02f);
    }
    tpc_unit_or_up(h);
}

#endif /* TREEPIECES_GROW_H */
