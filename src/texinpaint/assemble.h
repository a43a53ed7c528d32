#ifndef TEXINPAINT_ASSEMBLE_H
#define TEXINPAINT_ASSEMBLE_H

#include "ballot.h"

/* ---- assembly: from patches to pieces ------------------------------------------------------------

   At the finest level each hole pixel gets a label: the source, and the offset from the target to
   it. Pixels of equal labels are one piece, copied as it is. The labels minimise

       sum over pairs of neighbours with labels A, B:  |A(p) - B(p)|^2 + |A(q) - B(q)|^2 + joint
     + sum over pixels:  drift * |A(p) - color(p)|^2

   where A(p) is the colour that A copies to p; next to known pixels it is |A(q) - known(q)|^2. */

enum {
    TXI_JOINT = 40,      /* [recipe]                                                           */
    TXI_DRIFT = 5,       /* in 1/256 [recipe: .02]                                             */
    TXI_NOWHERE = 60000, /* what a colour costs that cannot be copied; ours                    */
    TXI_LABEL_NONE = -1, /* not in the hole                                                    */
    TXI_LABEL_STRIP = -2, /* copied by the plan                                                */
    TXI_LABEL_BIAS = 1 << 12
};

/* Labels as numbers: pose * 2^26 + (x offset + bias) * 2^13 + y offset + bias. */
static inline int32_t txi_label(int pose, int dx, int dy) {
    return pose << 26 | (dx + TXI_LABEL_BIAS) << 13 | (dy + TXI_LABEL_BIAS);
}

typedef struct txi_assembly {
    const txi_level *level;
    const uint8_t *color; /* of the canvas                                                     */
    int32_t *label;       /* one per pixel of the level                                        */
} txi_assembly;

/* the source pixel that a label copies to pixel p, or NULL: it is not usable */
static inline const uint8_t *txi_label_color(const txi_assembly *t, int32_t label, int p) {
    const txi_level *l = t->level;
    if (label < 0) return l->pull && l->pull[p] ? l->strip + 4 * (size_t)p : NULL;
    const txi_source *s = &l->source[label >> 26];
    const int x = p % l->width + (label >> 13 & 8191) - TXI_LABEL_BIAS;
    const int y = p / l->width + (label & 8191) - TXI_LABEL_BIAS;
    if (x < 0 || y < 0 || x >= s->width || y >= s->height) return NULL;
    const size_t q = (size_t)y * (size_t)s->width + (size_t)x;
    return s->usable[q] ? s->color + 4 * q : NULL;
}

static inline int txi_rgb_distance(const uint8_t *a, const uint8_t *b) {
    if (!a || !b) return TXI_NOWHERE;
    const int r = a[0] - b[0], g = a[1] - b[1], u = a[2] - b[2];
    return r * r + g * g + u * u;
}

/* What label a at p costs next to q as it is. */
static int txi_joint_cost(const txi_assembly *t, int32_t a, int p, int q) {
    const uint8_t state = t->level->state[q];
    if (state == TXI_VOID) return 0;
    if (state != TXI_HOLE)
        return txi_rgb_distance(txi_label_color(t, a, q), t->level->color + 4 * (size_t)q);
    const int32_t b = t->label[q];
    if (a == b) return 0;
    return txi_rgb_distance(txi_label_color(t, a, p), txi_label_color(t, b, p)) +
           txi_rgb_distance(txi_label_color(t, a, q), txi_label_color(t, b, q)) + TXI_JOINT;
}

static int txi_label_cost(const txi_assembly *t, int32_t a, int p) {
    const int w = t->level->width;
    const uint8_t *own = txi_label_color(t, a, p);
    if (!own) return INT_MAX;
    return txi_rgb_distance(own, t->color + 4 * (size_t)p) * TXI_DRIFT / 256 +
           txi_joint_cost(t, a, p, p - 1) + txi_joint_cost(t, a, p, p + 1) +
           txi_joint_cost(t, a, p, p - w) + txi_joint_cost(t, a, p, p + w);
}

/* One pass of iterated conditional modes: each pixel takes the best of its neighbours' labels. */
static int txi_assembly_pass(txi_assembly *t) {
    const txi_level *l = t->level;
    const int w = l->width;
    const int side[8] = {-w - 1, -w, -w + 1, -1, 1, w - 1, w, w + 1};
    int changed = 0;
    for (int i = 0; i < l->hole_count; i++) {
        const int p = l->hole[i];
        int32_t best = t->label[p];
        if (best == TXI_LABEL_STRIP) continue;
        int cost = best >= 0 ? txi_label_cost(t, best, p) : INT_MAX;
        for (int k = 0; k < 8; k++) {
            const int32_t other = t->label[p + side[k]];
            if (other < 0 || other == best) continue;
            const int c = txi_label_cost(t, other, p);
            if (c >= cost) continue;
            cost = c;
            best = other;
        }
        changed += best != t->label[p];
        t->label[p] = best;
    }
    return changed;
}

/* Number the pieces: connected pixels of equal labels. queue: room for all hole pixels. */
static void txi_assembly_pieces(const txi_assembly *t, int32_t *piece, int32_t *queue) {
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
                if (l->state[q] != TXI_HOLE || piece[q] >= 0 || t->label[q] != t->label[p]) continue;
                piece[q] = count;
                queue[last++] = q;
            }
        }
        count++;
    }
}

#endif /* TEXINPAINT_ASSEMBLE_H */
