#ifndef TREEPIECES_GROW_H
#define TREEPIECES_GROW_H

#include "kit.h"
#include "space.h"

/* ---- growing: the state of a tree --------------------------------------------------------- */

enum {
    TPC_BUCKETS = 160,     /* of open rims, by the logarithm of their radius                */
    TPC_GRID = 16,         /* cells along a side of the shade grid                          */
    TPC_CLASSES = 16,      /* of oscillators                                                */
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

/* An open rim. */
typedef struct tpc_bud {
    int32_t next;                 /* in its bucket                                              */
    int32_t parent;               /* node, or TREEPIECES_NONE                                   */
    uint64_t seed;                /* of all that is drawn for its piece and those beyond it     */
    uint8_t rim, order, across;   /* across: log2 of the tiles across an edge of the rim        */
    uint8_t is_forked, is_aimed;  /* after a fork, where `start` no longer applies; `aim` is the
                                     direction of the piece after this one                      */
    uint16_t depth;
    float position[3], rotation[4], heading[3]; /* rotation: of the rim; heading: of growth     */
    float aim[3];
    float radius, end_radius;     /* here, and at the end of the axis                           */
    float rest;                   /* of its step, which a short branching piece left over for a
                                     plain one                                                  */
    float along, length, step;    /* of the axis; step: length of a piece                       */
    float roll;                   /* degrees about the axis to the next branch, in the
                                     frame of the rim                                           */
} tpc_bud;

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
    tpc_bud *buds;
    int node_count, cluster_count, bud_count, waiting, most, bucket;
    int32_t first[TPC_BUCKETS], last[TPC_BUCKETS];
    uint32_t type_counts[TREEPIECES_MAX_TYPES];
    float scale, trunk, foot; /* scale of the place; length and base radius of the trunk, metres  */
    float height;
    uint16_t shade[TPC_GRID][TPC_GRID][TPC_GRID]; /* x, z, y: pieces in this cell and above       */
    tpc_space space; /* where the species has a clearance */
} tpc_growth;

static float tpc_uniform(tpc_growth *g, float low, float high) {
    return low + (high - low) * txm_rng_float(&g->rng);
}

/* What is drawn at an open rim depends on its seed alone, not on what grew elsewhere before: a tree of
   fewer pieces is part of one of more. */
enum { TPC_OPENING = 1, TPC_ATTACHING }; /* streams */

static void tpc_draw_for(tpc_growth *g, uint64_t seed, uint64_t stream) {
    g->rng = txm_rng_make(seed, stream);
}

/* ---- growing: open rims by radius ---------------------------------------------------------- */

/* The bits of a positive float, which grow about as its logarithm, by 2^23 per octave. */
static uint32_t tpc_float_bits(float x) {
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

/* Eight buckets per octave, the thickest first. */
static int tpc_bucket(float radius) {
    return txm_clampi((int)(0x43000000u >> 20) - (int)(tpc_float_bits(radius) >> 20), 0, TPC_BUCKETS - 1);
}

/* Put the bud after the last one into its bucket. */
static void tpc_push(tpc_growth *g) {
    const int i = g->bud_count++, b = tpc_bucket(g->buds[i].radius);
    g->buds[i].next = -1;
    if (g->first[b] < 0) g->first[b] = i;
    else g->buds[g->last[b]].next = i;
    g->last[b] = i;
    g->waiting++;
    if (b < g->bucket) g->bucket = b; /* a rule of the caller may let a stem grow thicker */
}

/* Take out the thickest open rim; there must be one. */
static tpc_bud *tpc_pop(tpc_growth *g) {
    while (g->first[g->bucket] < 0) g->bucket++;
    tpc_bud *bud = &g->buds[g->first[g->bucket]];
    g->first[g->bucket] = bud->next;
    g->waiting--;
    return bud;
}

/* ---- growing: pruning ---------------------------------------------------------------------- */

static int tpc_is_outside(const tpc_growth *g, const tpc_bud *bud) {
    const treepieces_species *s = g->species;
    if (s->envelope == TREEPIECES_FREE) return 0;
    const float x = bud->position[0] - g->place.position[0];
    const float z = bud->position[2] - g->place.position[2];
    const float y = (bud->position[1] - g->place.position[1]) / g->trunk;
    const float h = (y - s->crown_base) / (s->crown_top - s->crown_base);
    if (h > 1) return 1;
    if (bud->order == 0) return 0;
    if (h < 0) return 1;
    float r = 0.5f * s->crown_width * g->trunk;
    if (s->envelope == TREEPIECES_CONE) r *= 1 - h;
    if (s->envelope == TREEPIECES_ELLIPSOID) r *= sqrtf(1 - (2 * h - 1) * (2 * h - 1));
    return x * x + z * z > r * r;
}

/* the shade cell of a position; returns the side of a cell */
static float tpc_cell(const tpc_growth *g, const float position[3], int cell[3]) {
    const float side = tpc_grid_width * g->trunk / (float)TPC_GRID;
    for (int k = 0; k < 3; k++) {
        const float middle = k == 1 ? 0 : (float)TPC_GRID / 2;
        const float at = (position[k] - g->place.position[k]) / side + middle;
        cell[k] = at > 0 ? at < (float)TPC_GRID ? (int)at : TPC_GRID - 1 : 0;
    }
    return side;
}

static int tpc_is_shaded(const tpc_growth *g, const tpc_bud *bud) {
    if (!(g->species->shade > 0) || bud->order == 0) return 0;
    int c[3];
    const float side = tpc_cell(g, bud->position, c) / g->scale;
    if (c[1] + 1 >= TPC_GRID) return 0;
    return (float)g->shade[c[0]][c[2]][c[1] + 1] > g->species->shade * side * side;
}

static void tpc_cast_shade(tpc_growth *g, const float position[3]) {
    int c[3];
    if (!(g->species->shade > 0)) return;
    tpc_cell(g, position, c);
    for (int y = 0; y <= c[1]; y++) g->shade[c[0]][c[2]][y]++;
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
        tpc_is_shaded(g, bud))
        return TREEPIECES_TIP;
    /* a hanging axis ends before it reaches the ground */
    if (bud->heading[1] < 0 && bud->position[1] - g->place.position[1] < tpc_clearance * g->trunk)
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

/* The length of the next piece, limited to a range of radii so that its type keeps its proportions. */
static float tpc_choose_length(const tpc_bud *bud, int type) {
    const float low = tpc_shortest(type);
    static const float high[TREEPIECES_BUILTIN] = {40, 2.5f, 3, 3, 2.5f, 18, 1.4f};
    const float left = (1 - bud->along) * bud->length;
    const float step = bud->rest > 0 ? bud->rest : bud->step;
    float length = step < left ? step : left;
    if (type == TREEPIECES_TIP && length < 0.7f * bud->step) length = 0.7f * bud->step;
    /* at most 8 tiles lie along a quad, so one with many across must not be long */
    const float most = txm_minf(high[type], (type == TREEPIECES_I ? 64.0f : 20.0f) / (float)(1 << bud->across));
    return txm_clampf(length, low * bud->radius, txm_maxf(most, low) * bud->radius);
}

static void tpc_choose(tpc_growth *g, const tpc_bud *bud, treepieces_choice *c) {
    const treepieces_order *o = tpc_order(g, bud->order);
    const int type = tpc_choose_type(g, bud);
    memset(c, 0, sizeof *c);
    c->type = type;
    memcpy(c->direction, bud->heading, sizeof c->direction);
    c->length = tpc_choose_length(bud, type);
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

/* Turn the axis a little: wander, tropism, sag. */
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
    const float up = o->tropism, rise = h[1];
    h[0] -= up * rise * h[0];
    h[1] += up * (1 - rise * rise);
    h[2] -= up * rise * h[2];
    if (o->sag != 0) {
        const float at = bud->along + 0.5f * length / bud->length;
        const float fall = o->sag * degree * 2 * at * (length / bud->length);
        h[1] -= fall * sqrtf(h[0] * h[0] + h[2] * h[2] + 0.02f);
    }
    tpc_unit_or_up(h);
}

/* ---- growing: a piece on a rim ------------------------------------------------------------- */

static const float tpc_turns[TREEPIECES_RIM][4] = {
    {0, 0, 0, 1},           {0, 0.5f, 0, 0.86602540378f},  {0, 0.86602540378f, 0, 0.5f},
    {0, 1, 0, 0},           {0, 0.86602540378f, 0, -0.5f}, {0, 0.5f, 0, -0.86602540378f},
};

/* out = a b, where the building rotation is skipped when it is the identity, the usual case */
static void tpc_multiply_building(const float building[4], const float b[4], float out[4]) {
    if (building[3] < 1) tpc_multiply(building, b, out);
    else memcpy(out, b, 4 * sizeof *b);
}
static void tpc_multiply_by_building(const float a[4], const float building[4], float out[4]) {
    if (building[3] < 1) tpc_multiply(a, building, out);
    else memcpy(out, a, 4 * sizeof *a);
}

/* The nearest multiple of 60 degrees, as 0..5, and the rest, -30..30 degrees. */
static int tpc_nearest_sixth(float degrees, float *rest) {
    const float turns = degrees / 60;
    const int whole = (int)(turns + (turns < 0 ? -0.5f : 0.5f));
    *rest = degrees - 60 * (float)whole;
    return (whole % TREEPIECES_RIM + TREEPIECES_RIM) % TREEPIECES_RIM;
}

/* The joint rotation that lets the stem grow along `heading` (world space) from the frame of a rim
   turned by `turn`: a twist in degrees, then the shortest rotation of y to the heading. */
static void tpc_joint(const float rim[4], int turn, const float heading[3], float twist,
                      float joint[4]) {
    const float back[4] = {-rim[0], -rim[1], -rim[2], rim[3]};
    float h[3];
    tpc_rotate(back, heading, h);
    tpc_turn((TREEPIECES_RIM - turn) % TREEPIECES_RIM, h, h);
    if (h[1] < 0.5f) { /* limited to 60 degrees */
        const float level = sqrtf(h[0] * h[0] + h[2] * h[2]);
        const float shrink = level > 0 ? 0.86602540378f / level : 0;
        h[0] *= shrink;
        h[2] *= shrink;
        h[1] = level > 0 ? 0.5f : 1;
    }
    const float scale = 1 / sqrtf(h[2] * h[2] + h[0] * h[0] + (1 + h[1]) * (1 + h[1]));
    joint[0] = h[2] * scale;
    joint[1] = 0;
    joint[2] = -h[0] * scale;
    joint[3] = (1 + h[1]) * scale;
    if (twist != 0) { /* t: tangent of half the twist, 15 degrees at most */
        const float x = twist * 0.00872664626f, t = x * (1 + x * x * (0.33333333f + 0.13333333f * x * x));
        const float shorter = 1 / sqrtf(1 + t * t), about[4] = {0, t * shorter, 0, shorter};
        tpc_multiply(joint, about, joint);
    }
}

/* Word 3 of a record: log2 of the number of tiles along and across the quads of each band. Where tiles
   would be too narrow, the number across is halved. across: receives its log2 at each leaf rim. */
static uint32_t tpc_bands(const tpc_growth *g, const tpc_bud *bud, const treepieces_choice *c,
                          int across[TREEPIECES_MAX_LEAVES]) {
    static const uint8_t halvable[TREEPIECES_BUILTIN] = {3, 1, 1, 1, 1, 0, 2};
    const float tile = tpc_tile_width * g->foot;
    const tpc_band *band = g->kit->bands[c->type];
    const int may = c->type < TREEPIECES_BUILTIN ? halvable[c->type] : 0;
    const int leaves = g->kit->pieces[c->type].leaf_count;
    int now = bud->across;
    uint32_t word = 0;
    for (int b = 0; b < g->kit->band_counts[c->type]; b++) {
        /* the stem's radius above the band; bands of branches begin as wide as band 0 ends */
        const float part = c->type == TREEPIECES_I && b == 0 ? 0.5f : 1;
        const float radius = bud->radius * (1 + (c->ratios[0] - 1) * part);
        int halve = 0;
        const int is_as_before = b == 1 && c->type != TREEPIECES_I && c->type != TREEPIECES_FLARE;
        const float least = tpc_halving_width * tile * (float)(1 << now);
        if (!is_as_before && (may >> b & 1) && now > 0 && radius < least) {
            halve = 1;
            now--;
        }
        const float width = bud->radius / (float)(1 << now);
        const float dy = band[b].rise * c->length, dr = band[b].spread * bud->radius;
        const float height = sqrtf(dy * dy + dr * dr);
        int along = 0;
        while (along < 3 && height > 1.41f * width * (float)(1 << along)) along++;
        word |= (uint32_t)(now | along << 3 | halve << 5) << (8 * b);
    }
    for (int k = 0; k < leaves; k++) across[k] = now;
    return word;
}

/* A thick branch at a small angle to its stem would have its rim inside the stem, and a pocket
   above it. Its first piece therefore leads away from the stem as far as necessary, and the next
   one takes the intended direction. */
static void tpc_stand_off(tpc_bud *bud, const float stem[3], const float out[3], float ratio,
                          float offset) {
    const float most = txm_clampf((offset - 1.1f) / ratio, 0, 0.68f), cosine = tpc_dot(bud->heading, stem);
    bud->is_aimed = cosine > most;
    if (!bud->is_aimed) return;
    memcpy(bud->aim, bud->heading, sizeof bud->aim);
    const float sine = sqrtf(1 - most * most);
    for (int i = 0; i < 3; i++) bud->heading[i] = most * stem[i] + sine * out[i];
}

/* The heading at so many degrees from the stem, towards `out`. */
static void tpc_turn_aside(tpc_bud *bud, float degrees, const float stem[3], const float out[3]) {
    double sine, cosine;
    txm_sincos((double)degrees * (TXM_PI / 180), &sine, &cosine);
    const float ahead = txm_float(cosine), aside = txm_float(sine);
    for (int i = 0; i < 3; i++) bud->heading[i] = ahead * stem[i] + aside * out[i];
}

/* The bud at leaf rim k of a fork: the axis goes on as one of its arms. */
static void tpc_open_arm(tpc_growth *g, const tpc_bud *from, const treepieces_choice *c, int k,
                         const float stem[3], const float out[3], tpc_bud *bud) {
    const treepieces_order *o = tpc_order(g, from->order);
    const int arms = g->kit->pieces[c->type].leaf_count;
    float mean = 0;
    bud->roll = tpc_uniform(g, 60, 120); /* the next fork lies across this one */
    for (int i = 0; i < arms; i++) mean += c->ratios[i] / (float)arms;
    /* the thicker arm is straighter */
    const float straighter = txm_clampf(1 - 2.5f * (c->ratios[k] / mean - 1), 0.3f, 1.7f);
    tpc_turn_aside(bud, o->fork_angle * straighter, stem, out);
    bud->length *= o->fork_ratio * tpc_uniform(g, 0.85f, 1.1f);
    bud->end_radius =
        txm_maxf(bud->end_radius * c->ratios[k], txm_minf(bud->radius, tpc_thinnest(g)));
    bud->is_forked = 1;
    bud->is_aimed = 0;
}

/* The bud at leaf rim k, at this distance from the stem's axis, where a branch begins. */
static void tpc_open_branch(tpc_growth *g, const tpc_bud *from, const treepieces_choice *c, int k,
                            float offset, const float stem[3], const float out[3], tpc_bud *bud) {
    const treepieces_order *o = tpc_order(g, from->order + 1), *parent = tpc_order(g, from->order);
    if (from->order + 1 < g->species->order_count) bud->order++;
    const float angle = o->angle_base + (o->angle_top - o->angle_base) * from->along +
                        tpc_uniform(g, -1, 1) * o->angle_spread;
    tpc_turn_aside(bud, txm_clampf(angle, 5, 175), stem, out);
    bud->heading[1] *= 1 - o->flatten * (1 - stem[1] * stem[1]);
    tpc_unit_or_up(bud->heading);
    tpc_stand_off(bud, stem, out, c->ratios[k], offset);
    const float t = from->is_forked || parent->start >= 1
                        ? from->along
                        : txm_clampf((from->along - parent->start) / (1 - parent->start), 0, 1);
    float longer = o->profile[0] * (1 - t) * (1 - 2 * t) + o->profile[1] * 4 * t * (1 - t) +
                   o->profile[2] * t * (2 * t - 1);
    longer *= 1 + o->gravimorphism * out[1];
    bud->length = from->length * o->length * txm_clampf(longer, 0.02f, 10) *
                  tpc_uniform(g, 1 - o->length_spread, 1 + o->length_spread);
    bud->step = from->length * o->length / o->segments * tpc_uniform(g, 0.9f, 1.1f);
    if (bud->step < 1.5f * bud->radius) bud->step = 1.5f * bud->radius;
    bud->end_radius = txm_maxf(bud->radius * o->taper, txm_minf(bud->radius, tpc_thinnest(g)));
    bud->along = 0;
    bud->is_forked = 0;
    bud->rest = 0;
    bud->roll = tpc_uniform(g, 0, 360);
}

/* Set up the bud at leaf rim k of the piece just attached, where an axis continues or begins; on
   entry bud is a copy of from. */
static void tpc_open_rim(tpc_growth *g, const tpc_bud *from, const treepieces_choice *c, int k,
                         const float rotation[4], tpc_bud *bud) {
    const treepieces_similarity *b = &g->kit->pieces[c->type].building[k];
    const float offset = g->kit->offsets[c->type][k];
    const float local[3] = {b->translation[0] * from->radius, b->translation[1] * c->length,
                            b->translation[2] * from->radius};
    const float up[3] = {0, 1, 0};
    float stem[3], out[3];
    bud->rim = (uint8_t)k;
    bud->parent = g->node_count - 1;
    bud->depth = (uint16_t)(from->depth + 1);
    bud->radius = from->radius * c->ratios[k];
    tpc_multiply_by_building(rotation, b->rotation, bud->rotation);
    tpc_rotate(rotation, up, stem);
    for (int i = 0; i < 3; i++) bud->position[i] = stem[i] * local[1];
    if (offset > 0) tpc_rotate(rotation, local, bud->position);
    for (int i = 0; i < 3; i++) bud->position[i] += from->position[i];
    memcpy(bud->heading, stem, sizeof stem);
    bud->along = from->along + local[1] / from->length;
    if (bud->along > 1) bud->along = 1;
    bud->rest = c->type == TREEPIECES_I ? 0 : from->step - c->length;
    if (bud->rest < bud->radius) bud->rest = 0;
    if (offset < 0.3f) { /* the stem itself */
        if (from->is_aimed) memcpy(bud->heading, from->aim, sizeof from->aim);
        bud->is_aimed = 0;
        tpc_steer(g, bud, local[1]);
        return;
    }
    const float radial[3] = {b->translation[0] / offset, 0, b->translation[2] / offset};
    tpc_rotate(rotation, radial, out);
    if (c->type == TREEPIECES_Y || c->type == TREEPIECES_SPATIAL)
        tpc_open_arm(g, from, c, k, stem, out, bud);
    else tpc_open_branch(g, from, c, k, offset, stem, out, bud);
}

static void tpc_add_cluster(tpc_growth *g, int type) {
    TXM_ASSERT(g->cluster_count < g->most);
    treepieces_cluster *c = &g->clusters[g->cluster_count++];
    c->node = (uint32_t)(g->node_count - 1);
    c->along = type == TREEPIECES_TIP ? 0.7f : tpc_uniform(g, 0.2f, 1);
    c->radius = g->species->cloud * g->scale * tpc_uniform(g, 0.75f, 1.2f);
    c->look = txm_rng_next(&g->rng);
}

/* How a piece sits on a rim. */
typedef struct tpc_seat {
    int turn;
    float after;                 /* what is left of the bud's roll, degrees */
    float joint[4], rotation[4]; /* rotation: in the world                  */
} tpc_seat;

static void tpc_seat_piece(const tpc_bud *bud, const treepieces_choice *c, tpc_seat *seat) {
    float heading[3] = {c->direction[0], c->direction[1], c->direction[2]}, twist = 0;
    seat->turn = c->turn;
    tpc_unit_or_up(heading);
    if (c->turn < 0) seat->turn = tpc_nearest_sixth(bud->roll, &twist);
    seat->after = bud->roll - (60 * (float)seat->turn + twist);
    tpc_joint(bud->rotation, seat->turn, heading, twist, seat->joint);
    if (seat->turn) tpc_multiply(tpc_turns[seat->turn], seat->joint, seat->joint);
    tpc_multiply(bud->rotation, seat->joint, seat->rotation);
}

/* The stem of a piece that sits so. */
static void tpc_limb_of(const tpc_growth *g, const tpc_bud *bud, const treepieces_choice *c,
                        const tpc_seat *seat, tpc_limb *stem) {
    const float up[3] = {0, 1, 0};
    float direction[3];
    tpc_rotate(seat->rotation, up, direction);
    for (int k = 0; k < 3; k++) {
        stem->from[k] = bud->position[k];
        stem->to[k] = bud->position[k] + c->length * direction[k];
    }
    stem->radius = bud->radius;
    stem->end = g->kit->pieces[c->type].leaf_count ? bud->radius * c->ratios[0] : 0;
    stem->parent = bud->parent;
}

/* Attach the chosen piece to the rim; its leaf rims become open. */
static void tpc_attach(tpc_growth *g, const tpc_bud *bud, const treepieces_choice *c,
                       const tpc_seat *seat) {
    const treepieces_piece *p = &g->kit->pieces[c->type];
    treepieces_node *node = &g->nodes[g->node_count];
    int across[TREEPIECES_MAX_LEAVES] = {0, 0, 0};
    /* node rotations are relative to the parent, rim frames include the building rotation */
    if (bud->parent >= 0) {
        const int type = g->nodes[bud->parent].type;
        tpc_multiply_building(g->kit->pieces[type].building[bud->rim].rotation, seat->joint,
                              node->rotation);
    } else {
        memcpy(node->rotation, seat->rotation, sizeof seat->rotation);
    }
    node->radius = bud->radius;
    node->length = c->length;
    node->parent = bud->parent;
    node->type = (uint8_t)c->type;
    node->joint = (uint8_t)(bud->rim * 8 + seat->turn);
    node->order = bud->order;
    /* the thinner the faster: two classes per octave, plus one at random */
    const int sway = (int)(tpc_float_bits(g->foot) >> 22) - (int)(tpc_float_bits(bud->radius) >> 22) +
                     (int)(txm_rng_next(&g->rng) >> 31);
    node->sway = (uint8_t)txm_clampi(sway, 0, TPC_CLASSES - 1);
    g->bands[g->node_count] = tpc_bands(g, bud, c, across);
    g->type_counts[c->type]++;
    g->node_count++;
    if (c->leaves) tpc_add_cluster(g, c->type);
    tpc_cast_shade(g, bud->position);
    if (bud->position[1] - g->place.position[1] > g->height)
        g->height = bud->position[1] - g->place.position[1];
    if (!p->leaf_count) return;

    for (int k = 0; k < p->leaf_count; k++) {
        TXM_ASSERT(g->bud_count < g->most); /* each becomes a node, see tpc_grow */
        tpc_bud *next = &g->buds[g->bud_count];
        *next = *bud;
        next->seed = txm_hash(bud->seed + (uint64_t)(k + 1) * 0x9e3779b97f4a7c15u);
        next->roll = seat->after;
        next->across = (uint8_t)across[k];
        tpc_draw_for(g, next->seed, TPC_OPENING);
        tpc_open_rim(g, bud, c, k, seat->rotation, next);
        if (k == 0 && (c->type == TREEPIECES_SIDE || c->type == TREEPIECES_PLANAR))
            next->roll = seat->after + tpc_order(g, bud->order + 1)->roll; /* of the next branch */
        tpc_push(g);
    }
}

/* ---- growing: one tree --------------------------------------------------------------------- */

/* Call the caller's rule and check its choice; 0 if that is invalid. */
static int tpc_call_rule(tpc_growth *g, const tpc_bud *bud, treepieces_choice *c) {
    treepieces_site site;
    site.depth = bud->depth;
    site.order = bud->order;
    site.parent = bud->parent < 0 ? -1 : g->nodes[bud->parent].type;
    site.rim = bud->rim;
    site.tree = g->index;
    memcpy(site.position, bud->position, sizeof site.position);
    memcpy(site.direction, bud->heading, sizeof site.direction);
    site.radius = bud->radius;
    site.along = bud->along;
    site.length = bud->length;
    g->desc->own_rule(g->desc->own_user, &site, &g->rng, c);
    g->fault = NULL;
    if (c->type < 0 || c->type >= g->kit->count)
        g->fault = "own_rule chose a type that the kit does not have";
    else if (c->turn < -1 || c->turn >= TREEPIECES_RIM)
        g->fault = "own_rule chose a turn that is not -1 to 5";
    else if (!(c->length > 0) || !txm_is_finite((double)c->length))
        g->fault = "own_rule chose a length that is not above 0";
    else if (!txm_is_finite((double)c->direction[0] + (double)c->direction[1] + (double)c->direction[2]))
        g->fault = "own_rule chose a direction that is not finite";
    else
        for (int k = 0; k < g->kit->pieces[c->type].leaf_count; k++)
            if (!(c->ratios[k] >= 0.02f && c->ratios[k] <= 1))
                g->fault = "own_rule chose a ratio that is not 0.02 to 1";
    if (g->fault) g->status = TXM_BAD_ARGUMENT;
    return g->status == TXM_OK;
}

/* Reset a slot and open the first rim, on the ground. */
static void tpc_begin_tree(tpc_growth *g) {
    const treepieces_order *o = &g->species->orders[0];
    tpc_bud *bud = &g->buds[0];
    memset(bud, 0, sizeof *bud);
    g->node_count = g->cluster_count = g->bud_count = g->waiting = 0;
    g->bucket = 0;
    g->height = 0;
    g->status = TXM_OK;
    memset(g->type_counts, 0, sizeof g->type_counts);
    for (int b = 0; b < TPC_BUCKETS; b++) g->first[b] = g->last[b] = -1;
    if (g->species->shade > 0) memset(g->shade, 0, sizeof g->shade);
    tpc_draw_for(g, g->place.seed, 0x7265657069656365u);
    g->scale = g->place.scale > 0 ? g->place.scale : 1;
    g->trunk = o->length * g->scale * tpc_uniform(g, 1 - o->length_spread, 1 + o->length_spread);
    g->foot = g->trunk * o->radius;
    bud->parent = TREEPIECES_NONE;
    bud->seed = g->place.seed;
    memcpy(bud->position, g->place.position, sizeof bud->position);
    double sine, cosine;
    txm_sincos(0.5 * (double)g->place.turn, &sine, &cosine);
    bud->rotation[1] = txm_float(sine);
    bud->rotation[3] = txm_float(cosine);
    bud->heading[1] = 1;
    bud->radius = g->foot * (g->species->flare > 1 ? g->species->flare : 1);
    bud->end_radius = txm_maxf(g->foot * o->taper, tpc_thinnest(g));
    bud->length = g->trunk;
    bud->step = g->trunk / o->segments;
    bud->across = 4;
    bud->roll = tpc_uniform(g, 0, 360);
    tpc_push(g);
    if (g->species->clearance > 0)
        tpc_space_clear(&g->space, tpc_cell_steps * bud->step + 2 * bud->radius);
}

/* End the axis here. */
static void tpc_end_axis(const tpc_growth *g, const tpc_bud *bud, treepieces_choice *c) {
    c->type = TREEPIECES_TIP;
    c->turn = 0;
    memcpy(c->direction, bud->heading, sizeof c->direction);
    c->length = tpc_choose_length(bud, TREEPIECES_TIP);
    c->leaves = g->species->leaf_count > 0 && bud->order > 0;
}

/* Seat the piece, which gives its stem; is another one in the way? away: out of that. */
static int tpc_is_in_the_way(tpc_growth *g, const tpc_bud *bud, const treepieces_choice *c,
                             tpc_seat *seat, tpc_limb *limb, float away[3]) {
    const float fork = (float)TPC_FORK * bud->radius;
    tpc_seat_piece(bud, c, seat);
    tpc_limb_of(g, bud, c, seat, limb);
    return bud->parent >= 0 &&
           tpc_space_touches(&g->space, limb, g->species->clearance, fork, away);
}

/* Would a branch of the piece, seated so, begin within another stem? */
static int tpc_is_branch_blocked(tpc_growth *g, const tpc_bud *bud, const treepieces_choice *c,
                                 const tpc_seat *seat) {
    const treepieces_piece *p = &g->kit->pieces[c->type];
    float away[3];
    for (int k = 1; k < p->leaf_count; k++) {
        const float *to = p->building[k].translation, offset = g->kit->offsets[c->type][k];
        const float radius = bud->radius * c->ratios[k];
        float rim[3] = {to[0] * bud->radius, to[1] * c->length, to[2] * bud->radius};
        float out[3] = {to[0] / offset, 0, to[2] / offset};
        tpc_limb stub;
        tpc_rotate(seat->rotation, rim, rim);
        tpc_rotate(seat->rotation, out, out);
        for (int i = 0; i < 3; i++) {
            stub.from[i] = bud->position[i] + rim[i];
            stub.to[i] = stub.from[i] + tpc_shortest(TREEPIECES_TIP) * radius * out[i];
        }
        stub.radius = stub.end = radius;
        stub.parent = bud->parent;
        if (tpc_space_touches(&g->space, &stub, g->species->clearance, 0, away)) return 1;
    }
    return 0;
}

/* Seat the piece where it comes too near to no other stem: as chosen, or turned out of the way, or as
   the end of its axis, the shortest if need be; and take the room. */
static void tpc_take_room(tpc_growth *g, const tpc_bud *bud, treepieces_choice *c, tpc_seat *seat) {
    static const float turns[] = {0.4f, 0.9f, 1.8f}; /* tangents, of further and further aside */
    enum { TURNS = sizeof turns / sizeof turns[0] };
    const treepieces_choice chosen = *c;
    tpc_limb limb;
    float away[3];
    for (int t = 0; tpc_is_in_the_way(g, bud, c, seat, &limb, away); t++) {
        if (t == TURNS) {
            *c = chosen;
            if (c->type != TREEPIECES_TIP) tpc_end_axis(g, bud, c);
            c->length = tpc_shortest(TREEPIECES_TIP) * bud->radius;
            tpc_seat_piece(bud, c, seat);
            tpc_limb_of(g, bud, c, seat, &limb);
            break;
        }
        tpc_unit_or_up(away);
        for (int k = 0; k < 3; k++) c->direction[k] = bud->heading[k] + turns[t] * away[k];
    }
    const int has_branch = c->type == TREEPIECES_SIDE || c->type == TREEPIECES_PLANAR;
    if (has_branch && bud->parent >= 0 && tpc_is_branch_blocked(g, bud, c, seat)) c->type = TREEPIECES_I;
    tpc_space_add(&g->space, &limb);
}

/* Grow one tree. Every open rim needs at least one more piece, so near the limit they all get tips. */
static void tpc_grow(tpc_growth *g) {
    tpc_begin_tree(g);
    const int is_crowded =
        g->species->clearance > 0 && g->desc->rule == TREEPIECES_GRAMMAR && !g->desc->own_rule;
    while (g->waiting && g->status == TXM_OK) {
        const tpc_bud *bud = tpc_pop(g);
        treepieces_choice choice;
        tpc_seat seat;
        tpc_draw_for(g, bud->seed, TPC_ATTACHING);
        tpc_choose(g, bud, &choice);
        if (g->desc->own_rule && !tpc_call_rule(g, bud, &choice)) return;
        const int leaves = g->kit->pieces[choice.type].leaf_count;
        const int is_full = leaves && g->node_count + 1 + g->waiting + leaves > g->most;
        if (is_full) tpc_end_axis(g, bud, &choice);
        if (is_crowded) tpc_take_room(g, bud, &choice, &seat);
        else tpc_seat_piece(bud, &choice, &seat);
        const float left = (1 - bud->along) * bud->length;
        tpc_attach(g, bud, &choice, &seat);
        if (is_full && choice.leaves) /* its cloud represents the whole pruned branch */
            g->clusters[g->cluster_count - 1].radius *=
                txm_clampf(0.35f * left / (g->species->cloud * g->scale), 1, 1.8f);
    }
}

#endif /* TREEPIECES_GROW_H */
