#ifndef TEXSYN_SEAM_H
#define TEXSYN_SEAM_H

#include "border.h"

/* ---- the border between pictures of one texture -------------------------------------------

   It moves to where the two pictures agree: the minimum cut in a band along the border as drawn,
   cell by cell. A cell looks a little beyond itself; what earlier cells have decided is fixed. */

enum {
    TXS_SEAM_RIM = 16,                                     /* pixels that a cell looks beyond itself */
    TXS_SEAM_SIDE = TXS_KNIT_CELL + 2 * TXS_SEAM_RIM + 2,  /* nodes: with the margin of txm_flow */
    TXS_SEAM_HARD = 1 << 20,                               /* more than all arcs of a pixel */
    TXS_SEAM_ROUGHEST = 255                                /* the largest mismatch of a pixel */
};

typedef struct txs_seam {
    const txs_pair_of_pictures *pair;
    const txs_frayed *border;
    txm_flow flow;
    int left, top;     /* of the cell                                   */
    uint8_t *mismatch; /* of each node; those outside the picture have 0 */
} txs_seam;

/* By how much the pictures differ at a pixel, 0..255; colours as far as they are visible. */
static uint8_t txs_mismatch(const txs_pair_of_pictures *p, int x, int y) {
    const int channels = p->picture[0].channels;
    double sum = 0, shown[2] = {1, 1};
    for (int k = 0; k < 2 && channels == 4; k++)
        shown[k] = (double)txm_clampf(txs_pair_get(p, k, x, y, 3), 0, 1);
    for (int c = 0; c < channels; c++) {
        const double a = (double)txs_pair_get(p, 0, x, y, c);
        const double b = (double)txs_pair_get(p, 1, x, y, c);
        sum += c < 3 ? fabs(shown[0] * a - shown[1] * b) : fabs(a - b);
    }
    const double share = sum / channels;
    return (uint8_t)(share < 1 ? (int)floor(share * 255) : (int)TXS_SEAM_ROUGHEST);
}

/* The pixel of a node; 0 if it is in the margin or outside the picture. */
static int txs_seam_pixel(const txs_seam *s, int node, int *x, int *y) {
    const int u = node % TXS_SEAM_SIDE, v = node / TXS_SEAM_SIDE;
    *x = s->left + u - TXS_SEAM_RIM - 1;
    *y = s->top + v - TXS_SEAM_RIM - 1;
    return u > 0 && v > 0 && u < TXS_SEAM_SIDE - 1 && v < TXS_SEAM_SIDE - 1 && *x >= 0 && *y >= 0 &&
           *x < s->border->width && *y < s->border->height;
}

static size_t txs_seam_index(const txs_seam *s, int x, int y) {
    return (size_t)y * (size_t)s->border->width + (size_t)x;
}

/* Arcs to the next pixels, and what is fixed: pixels beyond the band and those of earlier cells. */
static void txs_seam_lay(txs_seam *s) {
    const txs_frayed *f = s->border;
    txm_flow *g = &s->flow;
    int x, y;
    for (int p = 0; p < g->count; p++) {
        for (int d = 0; d < 4; d++) g->arc[d][p] = 0;
        g->excess[p] = 0;
        s->mismatch[p] =
            (uint8_t)(txs_seam_pixel(s, p, &x, &y) ? txs_mismatch(s->pair, x, y) : 0);
    }
    for (int p = 0; p < g->count; p++) {
        if (!txs_seam_pixel(s, p, &x, &y)) continue;
        const size_t i = txs_seam_index(s, x, y);
        const int is_earlier = y < s->top || (y < s->top + TXS_KNIT_CELL && x < s->left);
        if (f->distance[i] > f->limit || is_earlier)
            g->excess[p] = f->label[i] ? -TXS_SEAM_HARD : (int)TXS_SEAM_HARD;
        for (int d = 0; d < 2; d++) {
            const int q = p + g->step[d];
            if (!txs_seam_pixel(s, q, &x, &y)) continue;
            g->arc[d][p] = g->arc[d + 2][q] = 1 + s->mismatch[p] + s->mismatch[q];
        }
    }
}

/* Cut a cell. */
static void txs_seam_cut(txs_seam *s, int left, int top) {
    const txs_frayed *f = s->border;
    s->left = left;
    s->top = top;
    txs_seam_lay(s);
    txm_flow_solve(&s->flow);
    for (int p = 0; p < s->flow.count; p++) {
        int x, y;
        if (!txs_seam_pixel(s, p, &x, &y) || x < left || y < top || x >= left + TXS_KNIT_CELL ||
            y >= top + TXS_KNIT_CELL)
            continue;
        const size_t i = txs_seam_index(s, x, y);
        if (f->distance[i] <= f->limit) f->label[i] = s->flow.tree[p] == TXM_FLOW_SINK;
    }
}

/* Move the border, cell by cell. Fraction 0..to of the whole. */
static txm_status txs_seam_find(const txs_pair_of_pictures *pair, const txs_frayed *border,
                                txm_env *env, float to) {
    const int nodes = TXS_SEAM_SIDE * TXS_SEAM_SIDE;
    txm_status status = TXM_OK;
    txm_arena arena;
    txs_seam s;
    memset(&s, 0, sizeof s);
    s.pair = pair;
    s.border = border;
    txm_arena_init(&arena, env);
    s.mismatch = (uint8_t *)txm_arena_alloc(&arena, (size_t)nodes, 1);
    if (!txm_flow_make(&s.flow, &arena, 4, nodes) || arena.failed)
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to move the border");
    s.flow.count = nodes;
    s.flow.step[0] = 1;
    s.flow.step[1] = TXS_SEAM_SIDE;
    s.flow.step[2] = -1;
    s.flow.step[3] = -TXS_SEAM_SIDE;
    for (int top = 0; top < border->height && status == TXM_OK; top += TXS_KNIT_CELL) {
        if (txm_progress(env, to * (float)top / (float)border->height, "border"))
            status = txm_fail(env, TXM_CANCELLED, "cancelled");
        for (int left = 0; left < border->width && status == TXM_OK; left += TXS_KNIT_CELL)
            if (txs_fray_reaches(border, left, top)) txs_seam_cut(&s, left, top);
    }
    txm_arena_free(&arena);
    return status;
}

#endif /* TEXSYN_SEAM_H */
