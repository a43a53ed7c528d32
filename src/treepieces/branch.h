#ifndef TREEPIECES_BRANCH_H
#define TREEPIECES_BRANCH_H

#include "grow.h"

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

/* Turn a frame so that its y axis, `axis`, comes to lie along `heading`, by the shortest rotation. Both are
   unit vectors; the heading is limited to 60 degrees from the axis. out may be the frame. */
static void tpc_turn_to(const float axis[3], float heading[3], const float frame[4], float out[4]) {
    float cosine = tpc_dot(axis, heading), across[3];
    if (cosine < 0.5f) {
        for (int k = 0; k < 3; k++) heading[k] -= cosine * axis[k];
        const float level = sqrtf(tpc_dot(heading, heading));
        const float shrink = level > 0 ? 0.86602540378f / level : 0;
        cosine = level > 0 ? 0.5f : 1;
        for (int k = 0; k < 3; k++) heading[k] = cosine * axis[k] + shrink * heading[k];
    }
    tpc_cross(axis, heading, across);
    const float scale = 1 / sqrtf(tpc_dot(across, across) + (1 + cosine) * (1 + cosine));
    const float arc[4] = {scale * across[0], scale * across[1], scale * across[2], scale * (1 + cosine)};
    tpc_multiply(arc, frame, out);
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

/* How a piece sits on a rim. */
typedef struct tpc_seat {
    float after;       /* what is left of the bud's roll, degrees                       */
    float stem[3];     /* the axis of the piece, unit length                            */
    float rotation[4]; /* in the world                                                  */
} tpc_seat;

/* The piece is turned about the rim's axis, then its stem grows along the direction chosen. A tube of a
   sketch need not turn. */
static void tpc_seat_piece(const tpc_growth *g, const tpc_bud *bud, const treepieces_choice *c, tpc_seat *seat) {
    int turn = c->turn;
    float twist = 0;
    memcpy(seat->stem, c->direction, sizeof seat->stem);
    tpc_unit_or_up(seat->stem);
    if (turn < 0) turn = tpc_nearest_sixth(bud->roll, &twist);
    if (c->type == TREEPIECES_I && !g->sketch.is_rigid) turn = 0;
    seat->after = bud->roll - (60 * (float)turn + twist);
    tpc_turn_to(bud->axis, seat->stem, bud->rotation, seat->rotation);
    if (turn) tpc_multiply(seat->rotation, tpc_turns[turn], seat->rotation);
    if (twist != 0) { /* t: tangent of half the twist, 15 degrees at most */
        const float x = twist * 0.00872664626f, t = x * (1 + x * x * (0.33333333f + 0.13333333f * x * x));
        const float shorter = 1 / sqrtf(1 + t * t), about[4] = {0, t * shorter, 0, shorter};
        tpc_multiply(seat->rotation, about, seat->rotation);
    }
}

/* The stem of a piece that sits so. */
static void tpc_limb_of(const tpc_growth *g, const tpc_bud *bud, const treepieces_choice *c,
                        const tpc_seat *seat, tpc_limb *stem) {
    for (int k = 0; k < 3; k++) {
        stem->from[k] = bud->position[k];
        stem->to[k] = bud->position[k] + c->length * seat->stem[k];
    }
    stem->radius = bud->radius;
    stem->end = g->kit->pieces[c->type].leaf_count ? bud->radius * c->ratios[0] : 0;
    stem->parent = bud->parent;
    tpc_limb_measure(stem);
}

/* The direction from the stem to the middle of leaf rim k, which is not on the axis. */
static void tpc_find_out(const tpc_growth *g, const tpc_segment *from, int k, float out[3]) {
    const float *to = g->kit->pieces[from->type].building[k].translation;
    const float offset = g->kit->offsets[from->type][k];
    out[0] = to[0] / offset;
    out[1] = 0;
    out[2] = to[2] / offset;
    tpc_rotate(from->rotation, out, out);
}

static int tpc_is_fork(int type) {
    return type == TREEPIECES_Y || type == TREEPIECES_SPATIAL;
}

/* The length of an axis that begins at a segment, without what is drawn for it; out: away from the stem
   there. That of a fork counts from the base of the axis that splits. */
static float tpc_expect_length(const tpc_growth *g, const tpc_segment *from, const float out[3]) {
    if (tpc_is_fork(from->type))
        return from->axis_length * tpc_order(g, from->order)->fork_ratio;
    const treepieces_order *o = tpc_order(g, from->order + 1), *parent = tpc_order(g, from->order);
    const float t = from->is_forked || parent->start >= 1
                        ? from->along
                        : txm_clampf((from->along - parent->start) / (1 - parent->start), 0, 1);
    float longer = o->profile[0] * (1 - t) * (1 - 2 * t) + o->profile[1] * 4 * t * (1 - t) +
                   o->profile[2] * t * (2 * t - 1);
    longer *= 1 + o->gravimorphism * out[1];
    return from->axis_length * o->length * txm_clampf(longer, 0.02f, 10);
}

/* 0..1: the digits of a number in reverse behind the binary point. The numbers below any limit are spread
   evenly, and so are those whose result is below one. */
static float tpc_reverse(uint32_t n) {
    float result = 0, bit = 0.5f;
    for (; n; n >>= 1, bit *= 0.5f)
        if (n & 1) result += bit;
    return result;
}

/* Let leaf rim k of a segment wait for its axis; number: of the segment among those of its axis that bear
   any. Among branches side by side every second one is more important, and so on: where some do not
   grow, the others are spread along the stem. */
static void tpc_wait_for_axis(tpc_growth *g, int32_t at, int k, int number) {
    TXM_ASSERT(g->wait_count < (TREEPIECES_MAX_LEAVES - 1) * g->most_segments);
    const tpc_segment *from = &g->sketch.segments[at];
    const float spread = tpc_reverse((uint32_t)number);
    tpc_wait *w = &g->waits[g->wait_count];
    float out[3], ahead = 0.9f, aside = 0.4f; /* of a fork */
    tpc_find_out(g, from, k, out);
    w->segment = at;
    w->rim = k;
    w->length = tpc_expect_length(g, from, out);
    if (tpc_is_fork(from->type)) {
        w->length *= 1 - from->along;
    } else {
        const int order = from->order + 1 < g->species->order_count ? from->order + 1 : from->order;
        ahead = txm_lerpf(g->aside[order][0][0], g->aside[order][1][0], from->along);
        aside = txm_lerpf(g->aside[order][0][1], g->aside[order][1][1], from->along);
    }
    for (int i = 0; i < 3; i++)
        w->end[i] = from->position[i] + from->length * from->stem[i] +
                    w->length * (ahead * from->stem[i] + aside * out[i]);
    if (!tpc_is_fork(from->type)) { /* not only the longest ones */
        const float even = from->axis_length * tpc_order(g, from->order + 1)->length;
        w->length = sqrtf(even * w->length) / (1 + 3 * spread);
    }
    tpc_push(g, g->wait_count++);
}

/* The bud at leaf rim k of a fork: the axis goes on as one of its arms. */
static void tpc_open_arm(tpc_growth *g, const tpc_segment *from, int k, const float out[3], tpc_bud *bud) {
    const treepieces_order *o = tpc_order(g, from->order);
    const int arms = g->kit->pieces[from->type].leaf_count;
    float mean = 0;
    bud->roll = tpc_uniform(g, 60, 120); /* the next fork lies across this one */
    for (int i = 0; i < arms; i++) mean += from->ratios[i] / (float)arms;
    /* the thicker arm is straighter, and the axis itself runs on */
    const float runs_on = k == from->main && !g->sketch.is_rigid ? 0.6f : 1;
    const float straighter = runs_on * txm_clampf(1 - 2.5f * (from->ratios[k] / mean - 1), 0.3f, 1.7f);
    tpc_turn_aside(bud, o->fork_angle * straighter, from->stem, out);
    bud->length = tpc_uniform(g, 0.85f, 1.1f) * tpc_expect_length(g, from, out);
    if (runs_on < 1) bud->length = from->axis_length;
    bud->end_radius =
        txm_maxf(from->end_radius * from->ratios[k], txm_minf(bud->radius, tpc_thinnest(g)));
    bud->is_forked = 1;
    bud->is_aimed = 0;
}

/* The bud at leaf rim k, where a branch begins. */
static void tpc_open_branch(tpc_growth *g, const tpc_segment *from, int k, const float out[3], tpc_bud *bud) {
    const treepieces_order *o = tpc_order(g, from->order + 1);
    if (from->order + 1 < g->species->order_count) bud->order++;
    const float angle = o->angle_base + (o->angle_top - o->angle_base) * from->along +
                        tpc_uniform(g, -1, 1) * o->angle_spread;
    tpc_turn_aside(bud, txm_clampf(angle, 5, 175), from->stem, out);
    bud->heading[1] *= 1 - o->flatten * (1 - from->stem[1] * from->stem[1]);
    tpc_unit_or_up(bud->heading);
    tpc_stand_off(bud, from->stem, out, from->ratios[k], g->kit->offsets[from->type][k]);
    bud->length = tpc_expect_length(g, from, out) * tpc_uniform(g, 1 - o->length_spread, 1 + o->length_spread);
    bud->step = from->axis_length * o->length / o->segments * tpc_uniform(g, 0.9f, 1.1f);
    if (bud->step < 1.5f * bud->radius) bud->step = 1.5f * bud->radius;
    bud->end_radius = txm_maxf(bud->radius * o->taper, txm_minf(bud->radius, tpc_thinnest(g)));
    bud->along = 0;
    bud->is_forked = 0;
    bud->rest = 0;
    bud->roll = tpc_uniform(g, 0, 360);
}

/* Set up the bud at leaf rim k of a segment, where an axis goes on or begins. Where one goes on, bud is,
   on entry, that of the segment. */
static void tpc_open_rim(tpc_growth *g, int32_t at, int k, tpc_bud *bud) {
    const tpc_segment *from = &g->sketch.segments[at];
    const treepieces_similarity *b = &g->kit->pieces[from->type].building[k];
    const float length = k == from->main ? from->length : from->part;
    const float local[3] = {b->translation[0] * from->radius, b->translation[1] * length,
                            b->translation[2] * from->radius};
    bud->seed = txm_hash(from->seed + (uint64_t)(k + 1) * 0x9e3779b97f4a7c15u);
    tpc_draw_for(g, bud->seed, TPC_OPENING);
    bud->rim = (uint8_t)k;
    bud->parent = at;
    bud->order = from->order;
    bud->is_forked = from->is_forked;
    bud->depth = (uint16_t)(from->depth + 1);
    bud->radius = from->radius * from->ratios[k];
    bud->end_radius = from->end_radius;
    bud->length = from->axis_length;
    bud->step = from->step;
    tpc_multiply_by_building(from->rotation, b->rotation, bud->rotation);
    if (g->kit->offsets[from->type][k] > 0) tpc_rotate(from->rotation, local, bud->position);
    else
        for (int i = 0; i < 3; i++) bud->position[i] = from->stem[i] * local[1];
    for (int i = 0; i < 3; i++) bud->position[i] += from->position[i];
    bud->along = from->along + local[1] / from->axis_length;
    if (bud->along > 1) bud->along = 1;
    bud->rest = from->type == TREEPIECES_I ? 0 : from->step - from->length;
    if (bud->rest < bud->radius) bud->rest = 0;
    memcpy(bud->axis, from->stem, sizeof bud->axis);
    if (b->rotation[3] < 1) {
        const float up[3] = {0, 1, 0};
        tpc_rotate(bud->rotation, up, bud->axis);
    }
    if (g->kit->offsets[from->type][k] < 0.3f) { /* the stem itself */
        memcpy(bud->heading, bud->is_aimed ? bud->aim : from->stem, sizeof bud->heading);
        bud->is_aimed = 0;
        tpc_steer(g, bud, local[1]);
        tpc_limit_rise(g, bud);
        return;
    }
    float out[3];
    tpc_find_out(g, from, k, out);
    if (tpc_is_fork(from->type)) tpc_open_arm(g, from, k, out, bud);
    else tpc_open_branch(g, from, k, out, bud);
    tpc_limit_rise(g, bud);
}

#endif /* TREEPIECES_BRANCH_H */
