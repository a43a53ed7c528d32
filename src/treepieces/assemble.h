#ifndef TREEPIECES_ASSEMBLE_H
#define TREEPIECES_ASSEMBLE_H

#include "axes.h"

/* ---- assembling: pieces of the sketch ------------------------------------------------------- */

enum { TPC_CLASSES = 16 }; /* of oscillators */

/* A piece to be placed on a rim. */
typedef struct tpc_part {
    const tpc_segment *first; /* of those that it stands for */
    int type;
    float radius, ratio, length; /* ratio: of its stem's radius above to that below */
    float foliage;               /* clouds that it stands for */
} tpc_part;

/* Word 3 of a record: log2 of the number of tiles along and across the quads of each band. Where tiles
   would be too narrow, the number across is halved. across: its log2 below; receives that above. */
static uint32_t tpc_bands(const tpc_growth *g, const tpc_part *part, int *across) {
    static const uint8_t halvable[TREEPIECES_BUILTIN] = {3, 1, 1, 1, 1, 0, 2};
    const float tile = tpc_tile_width * g->foot;
    const tpc_band *band = g->kit->bands[part->type];
    const int may = part->type < TREEPIECES_BUILTIN ? halvable[part->type] : 0;
    int now = *across;
    uint32_t word = 0;
    for (int b = 0; b < g->kit->band_counts[part->type]; b++) {
        /* the stem's radius above the band; bands of branches begin as wide as band 0 ends */
        const float share = part->type == TREEPIECES_I && b == 0 ? 0.5f : 1;
        const float radius = part->radius * (1 + (part->ratio - 1) * share);
        int halve = 0;
        const int is_as_before = b == 1 && part->type != TREEPIECES_I && part->type != TREEPIECES_FLARE;
        const float least = tpc_halving_width * tile * (float)(1 << now);
        if (!is_as_before && (may >> b & 1) && now > 0 && radius < least) {
            halve = 1;
            now--;
        }
        const float width = part->radius / (float)(1 << now);
        const float dy = band[b].rise * part->length, dr = band[b].spread * part->radius;
        const float height = sqrtf(dy * dy + dr * dr);
        int along = 0;
        while (along < 3 && height > 1.41f * width * (float)(1 << along)) along++;
        word |= (uint32_t)(now | along << 3 | halve << 5) << (8 * b);
    }
    *across = now;
    return word;
}

/* The multiple of 60 degrees about y that is nearest to a rotation, as 0..5. */
static int tpc_nearest_turn(const float q[4]) {
    int best = 0;
    float most = -1;
    for (int k = 0; k < TREEPIECES_RIM; k++) {
        const float match = fabsf(q[1] * tpc_turns[k][1] + q[3] * tpc_turns[k][3]);
        if (match > most + 1e-6f) {
            most = match;
            best = k;
        }
    }
    return best;
}

/* How many clouds belong to a segment: its own, and those of the branches that have not grown there. */
static float tpc_foliage(const tpc_growth *g, const tpc_segment *t) {
    float clouds = t->leaves, out[3];
    if (!(g->species->leaf_count > 0)) return 0;
    if (t->type == TREEPIECES_TIP) /* all that would have grown there */
        return clouds * txm_maxf(1, 0.125f * (1 - t->along) * t->axis_length / (g->species->cloud * g->scale));
    if (!tpc_is_elastic(&g->sketch, t->type)) return clouds;
    for (int k = 0; k < g->kit->pieces[t->type].leaf_count; k++) {
        const int order = t->order + !tpc_is_fork(t->type);
        if (k == t->main || (t->grown >> k & 1) || !(tpc_order(g, order)->leaves > 0)) continue;
        tpc_find_out(g, t, k, out);
        clouds += 0.5f * tpc_expect_length(g, t, out) / (g->species->cloud * g->scale);
    }
    return clouds;
}

/* The clouds of a piece as one. */
static void tpc_add_cluster(tpc_growth *g, const tpc_part *part) {
    const tpc_segment *t = part->first;
    TXM_ASSERT(g->cluster_count < g->most);
    treepieces_cluster *c = &g->clusters[g->cluster_count++];
    tpc_draw_for(g, t->seed, TPC_LEAFING);
    c->node = (uint32_t)(g->node_count - 1);
    c->along = part->type == TREEPIECES_TIP ? 0.7f : tpc_uniform(g, 0.2f, 1);
    c->radius = g->species->cloud * g->scale * tpc_uniform(g, 0.75f, 1.2f);
    c->look = txm_rng_next(&g->rng);
    c->radius *= txm_clampf(sqrtf(part->foliage), 1, 1.8f);
}

/* Append a piece: parent is the node below, rotation that of its rim in the world, and joint the
   rotation of the piece from there. */
static void tpc_append_node(tpc_growth *g, const tpc_part *part, int32_t parent, int rim,
                            const float joint[4], int turn, int *across) {
    TXM_ASSERT(g->node_count < g->most);
    treepieces_node *node = &g->nodes[g->node_count];
    /* node rotations are relative to the parent, rim frames include the building rotation */
    if (parent >= 0)
        tpc_multiply_building(g->kit->pieces[g->nodes[parent].type].building[rim].rotation, joint,
                              node->rotation);
    else memcpy(node->rotation, joint, sizeof node->rotation);
    node->radius = part->radius;
    node->length = part->length;
    node->parent = parent;
    node->type = (uint8_t)part->type;
    node->joint = (uint8_t)(rim * 8 + turn);
    node->order = part->first->order;
    /* the thinner the faster: two classes per octave, plus one at random */
    const int sway = (int)(tpc_float_bits(g->foot) >> 22) - (int)(tpc_float_bits(part->radius) >> 22) +
                     (int)(txm_hash(part->first->seed) >> 63);
    node->sway = (uint8_t)txm_clampi(sway, 0, TPC_CLASSES - 1);
    g->bands[g->node_count] = tpc_bands(g, part, across);
    g->type_counts[part->type]++;
    g->node_count++;
    g->height = txm_maxf(g->height, part->first->position[1]);
    if (part->foliage > 0) tpc_add_cluster(g, part);
}

/* The kind of piece that a segment with some of its branches is; seen from the other side, if only the
   second branch of a pair has grown. */
static void tpc_reduce(const tpc_sketch *s, tpc_segment *t) {
    static const float half_turn[4] = {0, 1, 0, 0};
    if (s->is_rigid || t->type != TREEPIECES_PLANAR || t->grown == 6) return;
    t->type = TREEPIECES_SIDE;
    if (t->grown == 2) return;
    tpc_multiply(t->rotation, half_turn, t->rotation);
    t->ratios[1] = t->ratios[2];
}

/* Make the pieces of one axis. */
static void tpc_assemble_axis(tpc_growth *g, const tpc_axis *axis) {
    tpc_sketch *s = &g->sketch;
    int32_t parent = TREEPIECES_NONE;
    int rim = axis->rim, across = 4;
    float frame[4] = {0, 0, 0, 1}; /* of the rim where the next piece sits */
    if (axis->parent >= 0) {
        const tpc_segment *from = &s->segments[axis->parent];
        parent = from->node;
        if (rim >= g->kit->pieces[from->type].leaf_count) rim = 1;
        across = from->across;
        tpc_multiply_by_building(from->rotation, g->kit->pieces[from->type].building[rim].rotation, frame);
    }
    for (int32_t i = axis->first, end; i < axis->end; i = end) {
        tpc_segment *t = &s->segments[i];
        tpc_part part = {t, t->type, t->radius, t->ratios[t->main], t->length, tpc_foliage(g, t)};
        const float back[4] = {-frame[0], -frame[1], -frame[2], frame[3]};
        const float up[3] = {0, 1, 0};
        float rotation[4], joint[4], y[3];
        int turn;
        for (end = i + 1; end < axis->end && !s->segments[end].begins; end++)
            part.foliage += tpc_foliage(g, &s->segments[end]);
        if (tpc_is_plain(s, t)) {
            const tpc_segment *next = &s->segments[end];
            float chord[3];
            tpc_rotate(frame, up, y);
            for (int k = 0; k < 3; k++) chord[k] = next->position[k] - t->position[k];
            part.type = TREEPIECES_I;
            part.length = sqrtf(tpc_dot(chord, chord));
            part.ratio = next->radius / t->radius;
            if (part.length > 0)
                for (int k = 0; k < 3; k++) chord[k] /= part.length;
            else { /* too short for its square */
                part.length = t->length;
                memcpy(chord, t->stem, sizeof chord);
            }
            turn = (int)((t->seed >> 32) % TREEPIECES_RIM);
            tpc_turn_to(y, chord, frame, rotation);
            tpc_multiply(rotation, tpc_turns[turn], rotation);
            tpc_multiply(back, rotation, joint);
        } else {
            tpc_reduce(s, t);
            part.type = t->type;
            part.length = t->part;
            if (t->part < t->length) part.ratio = 1 + (part.ratio - 1) * t->part / t->length;
            memcpy(rotation, t->rotation, sizeof rotation);
            tpc_multiply(back, rotation, joint);
            turn = tpc_nearest_turn(joint);
        }
        tpc_append_node(g, &part, parent, rim, joint, turn, &across);
        t->node = parent = g->node_count - 1;
        t->across = (uint8_t)across;
        if (part.length < t->length && part.type != TREEPIECES_I) { /* and the rest of its stem */
            static const float straight[4] = {0, 0, 0, 1};
            part.type = TREEPIECES_I;
            part.radius *= part.ratio;
            part.ratio = t->radius * t->ratios[0] / part.radius;
            part.length = t->length - t->part;
            part.foliage = 0;
            tpc_append_node(g, &part, parent, 0, straight, 0, &across);
            parent++;
        }
        rim = part.type == TREEPIECES_I ? 0 : t->main;
        if (end < axis->end)
            tpc_multiply_by_building(rotation, g->kit->pieces[part.type].building[rim].rotation, frame);
    }
}

/* Make the pieces of the sketch: axis after axis, so parents come first. */
static void tpc_assemble(tpc_growth *g) {
    for (int i = 0; i < g->sketch.axis_count && g->status == TXM_OK; i++)
        tpc_assemble_axis(g, &g->sketch.axes[i]);
    TXM_ASSERT(g->status != TXM_OK || g->node_count == g->sketch.pieces);
}

#endif /* TREEPIECES_ASSEMBLE_H */
