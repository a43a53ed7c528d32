#ifndef TREEPIECES_AXES_H
#define TREEPIECES_AXES_H

#include "branch.h"

/* ---- growing: axis by axis --------------------------------------------------------------------- */

/* Call the caller's rule and check its choice; 0 if that is invalid. */
static int tpc_call_rule(tpc_growth *g, const tpc_bud *bud, treepieces_choice *c) {
    treepieces_site site;
    site.depth = bud->depth;
    site.order = bud->order;
    site.parent = bud->parent < 0 ? -1 : g->sketch.segments[bud->parent].type;
    site.rim = bud->rim;
    site.tree = g->index;
    for (int k = 0; k < 3; k++) site.position[k] = bud->position[k] + g->place.position[k];
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

/* What is the same for all trees of a limit: how far the pieces of a tree of few are stretched. */
static void tpc_begin_sketch(tpc_growth *g) {
    tpc_sketch *s = &g->sketch;
    s->segment_count = s->axis_count = s->pieces = 0;
    s->is_rigid = g->desc->rule != TREEPIECES_GRAMMAR || g->desc->own_rule;
    s->stretch = tpc_stretch(g->most);
    s->most_joined = tpc_most_joined(s->stretch);
    s->taper = txm_minf(0.65f, 0.65f * (float)g->most / 150);
    s->deviation = tpc_deviation(g->most) * g->foot;
}

/* Reset a slot and open the first rim, on the ground. */
static void tpc_begin_tree(tpc_growth *g, tpc_bud *bud) {
    const treepieces_order *o = &g->species->orders[0];
    memset(bud, 0, sizeof *bud);
    g->node_count = g->cluster_count = g->wait_count = 0;
    g->bucket = 0;
    g->height = 0;
    g->status = TXM_OK;
    memset(g->type_counts, 0, sizeof g->type_counts);
    for (int b = 0; b < TPC_BUCKETS; b++) g->first[b] = g->last[b] = -1;
    if (tpc_casts_shade(g->species)) memset(g->shade, 0, sizeof g->shade);
    tpc_draw_for(g, g->place.seed, 0x7265657069656365u);
    g->scale = g->place.scale > 0 ? g->place.scale : 1;
    g->trunk = o->length * g->scale * tpc_uniform(g, 1 - o->length_spread, 1 + o->length_spread);
    g->foot = g->trunk * o->radius;
    bud->parent = TREEPIECES_NONE;
    bud->seed = g->place.seed;
    double sine, cosine;
    txm_sincos(0.5 * (double)g->place.turn, &sine, &cosine);
    bud->rotation[1] = txm_float(sine);
    bud->rotation[3] = txm_float(cosine);
    bud->axis[1] = bud->heading[1] = 1;
    bud->radius = g->foot * (g->species->flare > 1 ? g->species->flare : 1);
    bud->end_radius = txm_maxf(g->foot * o->taper, tpc_thinnest(g));
    bud->length = g->trunk;
    bud->step = g->trunk / o->segments;
    bud->roll = tpc_uniform(g, 0, 360);
    g->ceiling = 1e30f;
    for (int k = 0; k < 3; k++) g->low[k] = g->high[k] = bud->position[k];
    for (int i = 0; i < g->species->order_count; i++) {
        const treepieces_order *a = tpc_order(g, i);
        for (int top = 0; top < 2; top++) {
            txm_sincos((double)(top ? a->angle_top : a->angle_base) * (TXM_PI / 180), &sine, &cosine);
            g->aside[i][top][0] = txm_float(cosine);
            g->aside[i][top][1] = txm_float(sine);
        }
    }
    tpc_begin_sketch(g);
    if (g->species->clearance > 0)
        tpc_space_clear(&g->space, tpc_cell_steps * bud->step + 2 * bud->radius);
}

/* End the axis here. */
static void tpc_end_axis(const tpc_growth *g, const tpc_bud *bud, treepieces_choice *c) {
    c->type = TREEPIECES_TIP;
    c->turn = 0;
    memcpy(c->direction, bud->heading, sizeof c->direction);
    c->length = tpc_choose_length(g, bud, TREEPIECES_TIP);
    c->leaves = g->species->leaf_count > 0 && bud->order > 0;
}

/* Seat the piece, which gives its stem. Returns the segment that is in the way, or TREEPIECES_NONE; away: out
   of that. */
static int32_t tpc_find_obstacle(tpc_growth *g, const tpc_bud *bud, const treepieces_choice *c,
                                 tpc_seat *seat, tpc_limb *limb, float away[3]) {
    tpc_seat_piece(g, bud, c, seat);
    tpc_limb_of(g, bud, c, seat, limb);
    if (bud->parent < 0) return TREEPIECES_NONE;
    return tpc_space_touches(&g->space, limb, g->species->clearance + tpc_slack, (float)TPC_FORK * bud->radius, away);
}

/* Does a segment belong to the axis that grows, or to that where it began? */
static int tpc_is_own_stem(const tpc_growth *g, const tpc_bud *bud, int is_first, int32_t other) {
    const tpc_sketch *s = &g->sketch;
    const int32_t own = s->segments[bud->parent].axis, begins = s->axes[own].parent;
    if (s->segments[other].axis == own) return 1;
    return !is_first && begins >= 0 && s->segments[other].axis == s->segments[begins].axis;
}

/* Seat the piece where it comes too near to no other stem: as chosen, or turned out of the way, or as
   the end of its axis, the shortest if need be; and take the room. A branch does not bend about the stem
   from which it comes. One that has no room even to begin is refused: returns 0. */
static int tpc_take_room(tpc_growth *g, const tpc_bud *bud, int is_first, int is_refusable,
                         treepieces_choice *c, tpc_seat *seat) {
    static const float turns[] = {0.4f, 0.9f, 1.8f}; /* tangents, of further and further aside */
    enum { TURNS = sizeof turns / sizeof turns[0] };
    const treepieces_choice chosen = *c;
    tpc_limb limb;
    float away[3];
    for (int t = 0;; t++) {
        const int32_t other = tpc_find_obstacle(g, bud, c, seat, &limb, away);
        if (other < 0) break;
        if (t == TURNS || tpc_is_own_stem(g, bud, is_first, other)) {
            if (is_refusable) return 0;
            *c = chosen;
            if (c->type != TREEPIECES_TIP) tpc_end_axis(g, bud, c);
            c->length = tpc_shortest(TREEPIECES_TIP) * bud->radius;
            tpc_seat_piece(g, bud, c, seat);
            tpc_limb_of(g, bud, c, seat, &limb);
            break;
        }
        tpc_unit_or_up(away);
        for (int k = 0; k < 3; k++) c->direction[k] = bud->heading[k] + turns[t] * away[k];
    }
    tpc_space_add(&g->space, &limb);
    return 1;
}

/* The leaf rim where the axis goes on: that on it, or the thickest. */
static int tpc_main_rim(const tpc_growth *g, const treepieces_choice *c) {
    int thickest = 0;
    if (g->kit->offsets[c->type][0] < 0.3f) return 0;
    for (int k = 1; k < g->kit->pieces[c->type].leaf_count; k++)
        if (c->ratios[k] > c->ratios[thickest]) thickest = k;
    return thickest;
}

/* Append a segment; the branches that may begin at it wait for their turn. */
static void tpc_append_segment(tpc_growth *g, const tpc_bud *bud, const treepieces_choice *c,
                               const tpc_seat *seat) {
    tpc_sketch *s = &g->sketch;
    const int32_t at = s->segment_count++;
    const int leaves = g->kit->pieces[c->type].leaf_count;
    TXM_ASSERT(s->segment_count <= g->most_segments);
    tpc_segment *t = &s->segments[at];
    t->seed = bud->seed;
    memcpy(t->position, bud->position, sizeof t->position);
    memcpy(t->rotation, seat->rotation, sizeof t->rotation);
    memcpy(t->stem, seat->stem, sizeof t->stem);
    t->radius = bud->radius;
    t->length = c->length;
    t->longest = tpc_tallest(g, bud->radius, TREEPIECES_I) * bud->radius * txm_maxf(0.8f, 120 / (float)g->most);
    t->part = c->length;
    if (tpc_bears_branches(s, c->type)) {
        const float part = tpc_tallest(g, bud->radius, c->type) * bud->radius;
        if (t->length > part + bud->radius) t->part = part;
    }
    memcpy(t->ratios, c->ratios, sizeof t->ratios);
    t->along = bud->along;
    t->axis_length = bud->length;
    t->step = bud->step;
    t->end_radius = bud->end_radius;
    t->axis = s->axis_count - 1;
    t->depth = bud->depth;
    t->type = (uint8_t)c->type;
    t->order = bud->order;
    t->is_forked = bud->is_forked;
    t->leaves = c->leaves != 0;
    t->main = (uint8_t)tpc_main_rim(g, c);
    t->grown = 0;
    s->axes[t->axis].end = s->segment_count;
    t->begins = (uint8_t)tpc_run_take(s, &g->run, t);
    s->pieces += t->begins;
    if (!tpc_is_elastic(s, c->type) && leaves) s->pieces += leaves - 1; /* each has a tip at least */
    tpc_cast_shade(g, bud->position);
    for (int k = 0; k < 3; k++) {
        const float end = t->position[k] + t->length * t->stem[k];
        if (end < g->low[k]) g->low[k] = end;
        if (end > g->high[k]) g->high[k] = end;
    }
}

/* Grow the axis that begins with the bud, at the price of so many pieces to begin with. */
static void tpc_grow_axis(tpc_growth *g, tpc_bud *bud, int price, int is_refusable) {
    tpc_sketch *s = &g->sketch;
    const int is_crowded = g->species->clearance > 0 && !s->is_rigid;
    treepieces_choice choice;
    tpc_seat seat;
    int is_first = 1;
    const int32_t first = s->segment_count;
    g->run.first = NULL;
    do {
        tpc_draw_for(g, bud->seed, TPC_ATTACHING);
        tpc_choose(g, bud, &choice);
        if (g->desc->own_rule && !tpc_call_rule(g, bud, &choice)) return;
        const int leaves = g->kit->pieces[choice.type].leaf_count;
        const int tips = tpc_is_elastic(s, choice.type) ? 1 : leaves;
        if (leaves && s->pieces + (is_first ? price : 0) + 1 + tips > g->most) tpc_end_axis(g, bud, &choice);
        if (!is_crowded) tpc_seat_piece(g, bud, &choice, &seat);
        else if (!tpc_take_room(g, bud, is_first, is_first && is_refusable, &choice, &seat)) return;
        if (is_first) {
            tpc_axis *axis = &s->axes[s->axis_count++];
            TXM_ASSERT(s->axis_count <= g->most);
            axis->first = s->segment_count;
            axis->parent = bud->parent;
            axis->rim = bud->rim;
            s->pieces += price;
            if (bud->parent >= 0) {
                tpc_split(s, bud->parent, 1);
                s->segments[bud->parent].grown |= (uint8_t)(1 << bud->rim);
            }
            is_first = 0;
        }
        tpc_append_segment(g, bud, &choice, &seat);
        if (!g->kit->pieces[choice.type].leaf_count) break;
        const tpc_segment *t = &s->segments[s->segment_count - 1];
        bud->roll = seat.after;
        tpc_open_rim(g, s->segment_count - 1, t->main, bud);
        if (choice.type == TREEPIECES_SIDE || choice.type == TREEPIECES_PLANAR)
            bud->roll = seat.after + tpc_order(g, t->order + 1)->roll; /* of the next branch */
    } while (g->status == TXM_OK);
    int number = 0;
    for (int32_t i = first; i < s->segment_count; i++) {
        const int leaves = g->kit->pieces[s->segments[i].type].leaf_count;
        for (int k = 0; k < leaves; k++)
            if (k != s->segments[i].main) tpc_wait_for_axis(g, i, k, number);
        number += leaves > 1;
    }
}

/* Sketch one tree: axis after axis, until the limit is reached. Leaf rims of pieces that lose none need
   at least a tip. */
static void tpc_grow(tpc_growth *g) {
    tpc_sketch *s = &g->sketch;
    tpc_bud bud;
    int is_full = 0;
    tpc_begin_tree(g, &bud);
    tpc_grow_axis(g, &bud, 0, 0);
    for (const tpc_wait *w; g->status == TXM_OK && (w = tpc_pop(g)) != NULL;) {
        const int is_elastic = tpc_is_elastic(s, s->segments[w->segment].type);
        if (is_full && is_elastic) continue;
        const int price = tpc_split(s, w->segment, 0);
        is_full = is_full || s->pieces + price + 2 > g->most;
        if (is_full && is_elastic) continue;
        memset(&bud, 0, sizeof bud);
        tpc_open_rim(g, w->segment, w->rim, &bud);
        tpc_grow_axis(g, &bud, price, is_elastic);
        if (s->axis_count == TPC_FRAME && !s->is_rigid)
            g->ceiling = g->high[1] + 0.004f * (g->high[1] - g->low[1]);
    }
}

#endif /* TREEPIECES_AXES_H */
