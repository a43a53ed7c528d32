#ifndef TEXINPAINT_ASSEMBLE_H
#define TEXINPAINT_ASSEMBLE_H

#include "ballot.h"

/* ---- pieces -----------------------------------------------------------------------------------

   Each hole pixel gets a label: the source, and the offset from the target to it. Pixels of equal
   labels are one piece, copied as it is. The labels minimise

       sum over pairs of neighbours p, q with labels A != B:
           |A(p) - B(p)|^2 + |A(q) - B(q)|^2 + joint
     + sum over pixels:  drift * |A(p) - color(p)|^2 + (difference of the guides)^2

   where A(p) is the colour that A copies to p. At the rim of the hole q is known, and the first
   term is rim * |A(q) - known(q)|^2; where a pixel is partly known, |A(p) - known(p)|^2 is added,
   share times. This is minimised by expansion moves [7]: one label at a time, a minimum cut finds
   the best set of pixels that change to it. */

enum {
    TXI_JOINT = 40,       /* ours                                                              */
    TXI_DRIFT = 5,        /* drift, in 1/256: from the vote's colours; ours                      */
    TXI_JOINT_RIM = 2,    /* weight of a joint with what is known; ours                        */
    TXI_JOINT_SHARE = 4,  /* ... and of what is known of the pixel itself; ours                */
    TXI_NOWHERE = 400000, /* what a neighbour costs that a label cannot copy; ours             */
    TXI_NEVER = 20000000, /* what a pixel costs that a label cannot copy; ours                 */
    TXI_LABEL_NONE = -1,  /* not in the hole                                                   */
    TXI_LABEL_STRIP = -2, /* copied by the plan                                                */
    TXI_LABEL_BITS = 13,  /* of an offset: TXI_SIDE_MOST and the edges of a level fit          */
    TXI_LABEL_BIAS = 1 << (TXI_LABEL_BITS - 1),
    TXI_LABEL_MASK = (1 << TXI_LABEL_BITS) - 1
};

/* Labels as numbers: pose * 2^26 + (x offset + bias) * 2^13 + y offset + bias. */
static inline int32_t txi_label(int pose, int dx, int dy) {
    return pose << 2 * TXI_LABEL_BITS | (dx + TXI_LABEL_BIAS) << TXI_LABEL_BITS |
           (dy + TXI_LABEL_BIAS);
}
static inline int txi_label_pose(int32_t label) {
    return label >> 2 * TXI_LABEL_BITS;
}
static inline int txi_label_dx(int32_t label) {
    return (label >> TXI_LABEL_BITS & TXI_LABEL_MASK) - TXI_LABEL_BIAS;
}
static inline int txi_label_dy(int32_t label) {
    return (label & TXI_LABEL_MASK) - TXI_LABEL_BIAS;
}

typedef struct txi_assembly {
    const txi_level *level;
    const uint8_t *color; /* of the canvas                                                     */
    const txi_window *window; /* of the level; NULL: no pixel is known in part                 */
    int32_t *label;       /* one per pixel of the level                                        */
    txm_flow flow;        /* room for all pixels of the hole's bounding box with a margin      */
    int32_t *node;        /* one per pixel of the level: its node in the flow, -1: not in it   */
    int32_t *region;      /* the pixels of the move                                            */
} txi_assembly;

/* the source pixel that a label copies to pixel (x, y), or NULL: it is not usable */
static inline const uint8_t *txi_label_color(const txi_level *l, int32_t label, int x, int y) {
    if (label < 0) {
        const size_t p = (size_t)y * (size_t)l->width + (size_t)x;
        return label == TXI_LABEL_STRIP && l->pull && l->pull[p] ? l->strip + 4 * p : NULL;
    }
    const txi_source *s = &l->source[txi_label_pose(label)];
    const int i = x + txi_label_dx(label), j = y + txi_label_dy(label);
    if (i < 0 || j < 0 || i >= s->width || j >= s->height) return NULL;
    const size_t q = (size_t)j * (size_t)s->width + (size_t)i;
    return s->usable[q] ? s->color + 4 * q : NULL;
}

static inline int txi_rgb_distance(const uint8_t *a, const uint8_t *b) {
    if (!a || !b) return TXI_NOWHERE;
    const int r = a[0] - b[0], g = a[1] - b[1], u = a[2] - b[2];
    return r * r + g * g + u * u;
}

/* What labels a at (x, y) and b at its neighbour (u, v) cost. */
static inline int txi_joint_cost(const txi_level *l, int32_t a, int32_t b, int x, int y, int u,
                                 int v) {
    if (a == b) return 0;
    return txi_rgb_distance(txi_label_color(l, a, x, y), txi_label_color(l, b, x, y)) +
           txi_rgb_distance(txi_label_color(l, a, u, v), txi_label_color(l, b, u, v)) + TXI_JOINT;
}

/* What a label costs at (x, y) whatever the neighbours in the hole have. */
static int txi_own_cost(const txi_assembly *t, int32_t label, int x, int y) {
    const txi_level *l = t->level;
    const size_t p = (size_t)y * (size_t)l->width + (size_t)x;
    const uint8_t *own = txi_label_color(l, label, x, y);
    if (!own) return TXI_NEVER;
    const int guide = label >= 0 ? own[3] - l->color[4 * p + 3] : 0;
    int cost = txi_rgb_distance(own, t->color + 4 * p) * TXI_DRIFT / 256 + guide * guide;
    if (t->window && t->window->share) {
        const size_t i = (size_t)(y - TXI_EDGE) * (size_t)t->window->width + (size_t)(x - TXI_EDGE);
        const int share = t->window->share[i] * TXI_JOINT_SHARE;
        if (share) cost += txi_rgb_distance(own, t->window->color + 4 * i) / 256 * share;
    }
    for (int k = 0; k < 4; k++) {
        const int u = x + (k == 0) - (k == 1), v = y + (k == 2) - (k == 3);
        const size_t q = (size_t)v * (size_t)l->width + (size_t)u;
        if (l->state[q] != TXI_KNOWN && l->state[q] != TXI_FOREIGN) continue;
        cost += TXI_JOINT_RIM * txi_rgb_distance(txi_label_color(l, label, u, v), l->color + 4 * q);
    }
    return cost;
}

/* The pixels within reach of those that have the label, reach < 0: all; sets their nodes, in a grid
   of the bounding box with a margin. Returns their number. */
static int txi_expansion_region(txi_assembly *t, int32_t alpha, int reach) {
    const txi_level *l = t->level;
    int low[2] = {INT_MAX, INT_MAX}, high[2] = {0, 0}, count = 0;
    for (int i = 0; i < l->hole_count; i++) {
        const int p = l->hole[i];
        if (reach >= 0 && t->label[p] != alpha) continue;
        const int x0 = p % l->width - (reach < 0 ? 0 : reach),
                  y0 = p / l->width - (reach < 0 ? 0 : reach);
        const int side = reach < 0 ? 1 : 2 * reach + 1;
        for (int y = y0 < 0 ? 0 : y0; y < y0 + side && y < l->height; y++) {
            for (int x = x0 < 0 ? 0 : x0; x < x0 + side && x < l->width; x++) {
                const int q = y * l->width + x;
                if (l->state[q] != TXI_HOLE || t->node[q] >= 0 || t->label[q] == TXI_LABEL_STRIP)
                    continue;
                t->node[q] = 0;
                TXM_ASSERT(count < l->hole_count);
                t->region[count++] = q;
                if (x < low[0]) low[0] = x;
                if (y < low[1]) low[1] = y;
                if (x > high[0]) high[0] = x;
                if (y > high[1]) high[1] = y;
            }
        }
    }
    if (!count) return 0;
    const int w = high[0] - low[0] + 3;
    t->flow.count = w * (high[1] - low[1] + 3);
    t->flow.step[0] = 1;
    t->flow.step[1] = w;
    t->flow.step[2] = -1;
    t->flow.step[3] = -w;
    for (int k = 0; k < count; k++) {
        const int p = t->region[k];
        t->node[p] = (p / l->width - low[1] + 1) * w + p % l->width - low[0] + 1;
    }
    return count;
}

/* Add the costs of a pair of pixels, p in the region: e00 if both keep their labels, e01 if q
   changes, e10 if p does; 0 if both do. */
static void txi_expansion_pair(txi_assembly *t, int32_t alpha, int p, int q, int d) {
    const txi_level *l = t->level;
    const int x = p % l->width, y = p / l->width, u = q % l->width, v = q / l->width;
    const int32_t a = t->label[p], b = t->label[q];
    const int e00 = txi_joint_cost(l, a, b, x, y, u, v),
              e10 = txi_joint_cost(l, alpha, b, x, y, u, v);
    const int np = t->node[p], nq = t->node[q];
    if (nq < 0) { /* q keeps its label */
        t->flow.excess[np] += e10 - e00;
        return;
    }
    const int e01 = txi_joint_cost(l, a, alpha, x, y, u, v);
    const int link = e01 + e10 - e00;
    t->flow.excess[np] += e10 - e00;
    t->flow.excess[nq] -= e10;
    if (link > 0) t->flow.arc[d][np] += link; /* else it is cut off: labels may get worse there */
}

/* Let the label grow where that costs less; returns how many pixels have changed. */
static int txi_expand(txi_assembly *t, int32_t alpha, int reach) {
    const txi_level *l = t->level;
    const int count = txi_expansion_region(t, alpha, reach), w = l->width;
    if (!count) return 0;
    const size_t bytes = (size_t)t->flow.count * sizeof(int32_t);
    for (int d = 0; d < 4; d++) memset(t->flow.arc[d], 0, bytes);
    memset(t->flow.excess, 0, bytes);
    for (int k = 0; k < count; k++) {
        const int p = t->region[k], x = p % w, y = p / w;
        t->flow.excess[t->node[p]] +=
            txi_own_cost(t, alpha, x, y) - txi_own_cost(t, t->label[p], x, y);
        if (l->state[p + 1] == TXI_HOLE) txi_expansion_pair(t, alpha, p, p + 1, 0);
        if (l->state[p + w] == TXI_HOLE) txi_expansion_pair(t, alpha, p, p + w, 1);
        if (l->state[p - 1] == TXI_HOLE && t->node[p - 1] < 0)
            txi_expansion_pair(t, alpha, p, p - 1, 0);
        if (l->state[p - w] == TXI_HOLE && t->node[p - w] < 0)
            txi_expansion_pair(t, alpha, p, p - w, 0);
    }
    txm_flow_solve(&t->flow);
    int changed = 0;
    for (int k = 0; k < count; k++) {
        const int p = t->region[k];
        if (t->flow.tree[t->node[p]] == TXM_FLOW_SINK && t->label[p] != alpha) {
            t->label[p] = alpha;
            changed++;
        }
        t->node[p] = -1;
    }
    return changed;
}

/* The labels in use, the most frequent first, no more than `most`; returns how many.
   labels  room for one per hole pixel
   pairs   room for 2 per hole pixel                                                           */
static int txi_labels_used(const txi_assembly *t, int32_t *labels, int most, txm_pair *pairs) {
    const txi_level *l = t->level;
    const size_t n = (size_t)l->hole_count;
    size_t kinds = 0;
    for (size_t i = 0; i < n; i++) {
        const int32_t label = t->label[l->hole[i]];
        pairs[i].key = label >= 0 ? (uint32_t)label : UINT32_MAX;
        pairs[i].value = 0;
    }
    txm_sort_pairs(pairs, pairs + n, n);
    for (size_t i = 0; i < n && pairs[i].key != UINT32_MAX;) {
        size_t j = i;
        while (j < n && pairs[j].key == pairs[i].key) j++;
        pairs[kinds].value = pairs[i].key;
        pairs[kinds++].key = UINT32_MAX - (uint32_t)(j - i);
        i = j;
    }
    txm_sort_pairs(pairs, pairs + n, kinds);
    const int count = kinds < (size_t)most ? (int)kinds : most;
    for (int k = 0; k < count; k++) labels[k] = (int32_t)pairs[k].value;
    return count;
}

/* Memory of an assembly on a level. 0: there is none. */
static int txi_assembly_make(txi_assembly *t, const txi_level *l, txm_arena *arena) {
    const size_t n = (size_t)l->width * (size_t)l->height;
    memset(t, 0, sizeof *t);
    t->level = l;
    t->label = (int32_t *)txm_arena_alloc(arena, n, sizeof(int32_t));
    t->node = (int32_t *)txm_arena_alloc(arena, n, sizeof(int32_t));
    t->region = (int32_t *)txm_arena_alloc(arena, (size_t)l->hole_count, sizeof(int32_t));
    if (!txm_flow_make(&t->flow, arena, 4, (int)n) || arena->failed) return 0;
    for (size_t p = 0; p < n; p++) t->label[p] = t->node[p] = -1;
    return 1;
}

/* Number the pieces: connected pixels of equal labels. queue: room for all hole pixels. Returns how
   many there are. */
static int txi_assembly_pieces(const txi_assembly *t, int32_t *piece, int32_t *queue) {
    const txi_level *l = t->level;
    const int w = l->width;
    const int side[4] = {-1, 1, -w, w};
    int count = 0;
    for (int p = 0; p < w * l->height; p++) piece[p] = -1;
    for (int i = 0; i < l->hole_count; i++) {
        int first = 0, last = 0;
        if (piece[l->hole[i]] >= 0) continue;
        queue[last++] = l->hole[i];
        piece[l->hole[i]] = count;
        while (first < last) {
            const int p = queue[first++];
            for (int k = 0; k < 4; k++) {
                const int q = p + side[k];
                if (l->state[q] != TXI_HOLE || piece[q] >= 0 || t->label[q] != t->label[p])
                    continue;
                piece[q] = count;
                queue[last++] = q;
            }
        }
        count++;
    }
    return count;
}

#endif /* TEXINPAINT_ASSEMBLE_H */
