#ifndef TEXTILES_TILE_H
#define TEXTILES_TILE_H

#include "frame.h"

/* ---- one tile ---------------------------------------------------------------------------- */

enum {
    TXT_FRAME_LAYERS = 4 * (TXT_MAX_SEGMENTS + 2), /* pieces at the frame of a tile              */
    TXT_PLACES = 32,      /* found for the interior of a tile                                  */
    TXT_BIAS = 400        /* energy of a texel of the frame, per row away from the joint       */
};

/* A tile being made. Every texel has the number of the layer that it shows. */
typedef struct txt_canvas {
    const txt_build *b;
    int tile, side, half; /* half: directions in which neighbours are counted, 2 or 3 */
    int dx[3], dy[3];
    uint8_t *inside, *locked;
    uint16_t *label, *kept, *start, *best; /* kept, start, best: copies to restore */
    uint8_t *border;      /* rows to the nearest joint, at most 255 */
    int32_t *shows;       /* number of the texel shown, -1 beyond the exemplar */
    int32_t *other;       /* what the layer being tried would show */
    uint16_t *gap;        /* difference of the two */
    txt_layer *layers;
    int layer_capacity;
    int layer_count, frame_count; /* the first frame_count belong to edges and corners */
    txm_flow flow;
    txt_query query;
    txt_scratch scratch;
    txt_place places[TXT_PLACES]; /* found for the interior */
    int place_count, tries; /* how many of them are cut */
    int best_place;
} txt_canvas;

/* The cost of a cut between two neighbours: the squared sum of the differences that the layers on
   its two sides have at one and at the other texel [8]. */
static int32_t txt_seam(int at_p, int at_q) {
    return (at_p + at_q) * (at_p + at_q);
}

/* the cost of the cut between neighbouring texels p = (x, y) and q with their present labels */
static int32_t txt_cut_cost(const txt_canvas *c, int p, int q, int x, int y, int dx, int dy) {
    if (c->label[p] == c->label[q]) return 0;
    const txt_layer *a = &c->layers[c->label[p]], *d = &c->layers[c->label[q]];
    const int at_p = txt_difference(c->b, c->shows[p], txt_shown(c->b, d, x, y));
    const int at_q = txt_difference(c->b, c->shows[q], txt_shown(c->b, a, x + dx, y + dy));
    return txt_seam(at_p, at_q);
}

/* An edge's strip is the same in all tiles with its colour: the less of it shows, the less repeats.
   So it costs energy, more the further from the border. */
static int32_t txt_bias(const txt_canvas *c, int label, int p) {
    if (!c->layers[label].is_frame || c->border[p] < 3) return 0;
    const int depth = c->border[p] < 24 ? c->border[p] - 2 : 22;
    return TXT_BIAS * depth;
}

/* Energy of all cuts that touch the rectangle, and of the layers that its texels show. */
static int64_t txt_energy(const txt_canvas *c, int x0, int y0, int x1, int y1) {
    const int side = c->side;
    int64_t sum = 0;
    for (int y = y0 - 1; y < y1; y++) {
        for (int x = x0 - 1; x <= x1; x++) {
            if (x < 0 || y < 0 || x >= side) continue;
            const int p = y * side + x;
            if (!c->inside[p]) continue;
            if (x >= x0 && x < x1 && y >= y0) sum += txt_bias(c, c->label[p], p);
            for (int k = 0; k < c->half; k++) {
                const int qx = x + c->dx[k], qy = y + c->dy[k];
                if (qx < 0 || qy < 0 || qx >= side || qy >= side) continue;
                const int q = qy * side + qx;
                if (c->inside[q] && c->label[p] != c->label[q])
                    sum += txt_cut_cost(c, p, q, x, y, c->dx[k], c->dy[k]);
            }
        }
    }
    return sum;
}

/* One expansion move [7]: layer l takes those texels of the rectangle that minimise the energy.
   Returns by how much the energy fell; if it would not fall, nothing changes. */
static int64_t txt_expand(txt_canvas *c, int l, int x0, int y0, int x1, int y1) {
    const txt_build *b = c->b;
    txm_flow *g = &c->flow;
    const int side = c->side, half = c->half, width = x1 - x0 + 2, height = y1 - y0 + 2;
    g->count = width * height;
    for (int k = 0; k < half; k++) {
        g->step[k] = c->dy[k] * width + c->dx[k];
        g->step[k + half] = -g->step[k];
    }
    for (int k = 0; k < 2 * half; k++) memset(g->arc[k], 0, (size_t)g->count * sizeof(int32_t));
    memset(g->excess, 0, (size_t)g->count * sizeof(int32_t));

    /* what the layer would show, one texel beyond the rectangle too */
    int any = 0;
    for (int y = y0 - 1; y <= y1; y++) {
        for (int x = x0 - 1; x <= x1; x++) {
            if (x < 0 || y < 0 || x >= side || y >= side) continue;
            const int p = y * side + x;
            if (!c->inside[p]) continue;
            c->other[p] = txt_shown(b, &c->layers[l], x, y);
            c->gap[p] = (uint16_t)txt_difference(b, c->shows[p], c->other[p]);
        }
    }
#define TXT_MAY(p, x, y) \
    ((x) >= x0 && (x) < x1 && (y) >= y0 && (y) < y1 && !c->locked[p] && c->other[p] >= 0 && \
     c->label[p] != l)
    for (int y = y0 - 1; y < y1; y++) {
        for (int x = x0 - 1; x <= x1; x++) {
            if (x < 0 || y < 0 || x >= side) continue;
            const int p = y * side + x, node = (y - y0 + 1) * width + (x - x0 + 1);
            if (!c->inside[p]) continue;
            const int may_p = TXT_MAY(p, x, y), is_p = c->label[p] == l;
            if (may_p) {
                any = 1;
                /* to change costs on the source's side, to stay on the sink's */
                g->excess[node] += txt_bias(c, l, p) - txt_bias(c, c->label[p], p);
            }
            for (int k = 0; k < half; k++) {
                const int qx = x + c->dx[k], qy = y + c->dy[k];
                if (qx < 0 || qy < 0 || qx >= side || qy >= side) continue;
                const int q = qy * side + qx;
                if (!c->inside[q]) continue;
                const int may_q = TXT_MAY(q, qx, qy), is_q = c->label[q] == l;
                if (!may_p && !may_q) continue;
                /* p and q stay; p stays, q changes; p changes, q stays; both change: 0 */
                int32_t ss, sc, cs;
                if (c->label[p] == c->label[q]) {
                    ss = 0;
                    sc = cs = txt_seam(c->gap[p], c->gap[q]);
                } else {
                    const txt_layer *lp = &c->layers[c->label[p]], *lq = &c->layers[c->label[q]];
                    const int32_t pq = txt_shown(b, lp, qx, qy), qp = txt_shown(b, lq, x, y);
                    ss = txt_seam(txt_difference(b, c->shows[p], qp),
                                  txt_difference(b, c->shows[q], pq));
                    sc = txt_seam(c->gap[p], txt_difference(b, c->other[q], pq));
                    cs = txt_seam(c->gap[q], txt_difference(b, c->other[p], qp));
                }
                const int other = node + g->step[k];
                if (may_p && may_q) {
                    if (ss > sc + cs) ss = sc + cs; /* no negative arcs; the energy is checked */
                    g->excess[node] += cs - ss;
                    g->excess[other] -= cs;
                    g->arc[k][node] += sc + cs - ss;
                } else if (may_p) {
                    g->excess[node] += is_q ? -sc : cs - ss;
                } else {
                    g->excess[other] += is_p ? -cs : sc - ss;
                }
            }
        }
    }
    if (!any) return 0;
    const int64_t before = txt_energy(c, x0, y0, x1, y1);
    txm_flow_solve(g);
    for (int y = y0; y < y1; y++)
        memcpy(c->kept + y * side + x0, c->label + y * side + x0,
               (size_t)(x1 - x0) * sizeof *c->label);
    for (int y = y0; y < y1; y++) {
        for (int x = x0; x < x1; x++) {
            const int p = y * side + x, node = (y - y0 + 1) * width + (x - x0 + 1);
            if (!c->inside[p] || !TXT_MAY(p, x, y)) continue;
            if (g->tree[node] == TXM_FLOW_SINK) {
                c->label[p] = (uint16_t)l;
                const int32_t t = c->shows[p];
                c->shows[p] = c->other[p];
                c->other[p] = t; /* to undo it */
            }
        }
    }
#undef TXT_MAY
    const int64_t after = txt_energy(c, x0, y0, x1, y1);
    if (after < before) return before - after;
    for (int y = y0; y < y1; y++) {
        for (int x = x0; x < x1; x++) {
            const int p = y * side + x;
            if (!c->inside[p] || c->label[p] == c->kept[p]) continue;
            c->label[p] = c->kept[p];
            c->shows[p] = c->other[p];
        }
    }
    return 0;
}

/* ---- the frame of a tile ----------------------------------------------------------------- */

/* side k of a tile: its strip, and how strip coordinates come from the tile's: (a, u) or, of
   triangles, axial (i, j) = turned(x, y) + (di, dj) */
typedef struct txt_side {
    const txt_seam_strip *strip;
    int turn, di, dj;
    int layer[TXT_MAX_SEGMENTS + 2]; /* of the canvas, by the number of the strip's piece */
} txt_side;

/* Sides of a square: north, east, south, west; of a triangle 0, 1, 2. */
static void txt_find_side(const txt_build *b, const textiles_tile *t, int k, txt_side *s) {
    const int size = b->set->size, is_corner = b->set->kind == TEXTILES_CORNER;
    s->turn = s->di = s->dj = 0;
    if (b->is_triangle) {
        /* side k runs in direction 1, 5, 3 (sixths of a circle), the strip in direction 0 */
        const int run[3] = {1, 5, 3};
        const int corner[3][2] = {{0, 0}, {0, size}, {size, 0}};
        int i, j;
        s->strip = &b->strips[t->edges[k]];
        s->turn = (6 - run[k] + (t->directions[k] < 0 ? 3 : 0)) % 6;
        txt_turn(s->turn, corner[k][0], corner[k][1], &i, &j);
        s->di = (t->directions[k] < 0 ? size : 0) - i;
        s->dj = -j;
        return;
    }
    const int axis = k & 1;                         /* east and west run down */
    const int ends[4][2] = {{0, 1}, {1, 2}, {3, 2}, {0, 3}}; /* of corners nw, ne, se, sw */
    s->strip = &b->strips[is_corner ? txt_strip_index(b, axis, t->edges[ends[k][0]],
                                                      t->edges[ends[k][1]])
                                    : txt_strip_index(b, axis, t->edges[k], 0)];
    s->di = k == 1 ? -size : 0;
    s->dj = k == 2 ? -size : 0;
}

/* (a, u) of a texel on a side; u is 0, 1, .. or, from the other side, -1, -2, .. (triangles: 0, -1,
   .. for + and 0, 1, .. for -) */
static void txt_side_place(const txt_build *b, const txt_side *s, int x, int y, int *a, int *u) {
    int i, j;
    txt_turn(s->turn, x, y, &i, &j);
    i += s->di;
    j += s->dj;
    if (b->is_triangle) {
        *a = i + txt_half(j);
        *u = j;
    } else {
        *a = s->strip->axis ? j : i;
        *u = s->strip->axis ? i : j;
    }
}

/* The layers of a side: its start's corner, its segments, its end's corner. */
static void txt_add_side_layers(txt_canvas *c, txt_side *s) {
    const txt_build *b = c->b;
    for (int w = 0; w < s->strip->count + 2; w++) {
        txt_layer *l = &c->layers[c->layer_count];
        int i = s->di, j = s->dj;
        l->turn = s->turn;
        l->is_frame = 1;
        if (w >= 1 && w <= s->strip->count) {
            l->sheet = s->strip->segment[w - 1].sheet;
            i += s->strip->segment[w - 1].i;
            j += s->strip->segment[w - 1].j;
        } else {
            const int corner = s->strip->corner[w != 0], size = b->set->size;
            l->sheet = b->corner[corner].sheet;
            i += b->corner[corner].i;
            j += b->corner[corner].j;
            if (w && b->is_triangle) { /* seen from the end, turned by half a circle */
                l->turn = (s->turn + 3) % 6;
                i = b->corner[corner].i + size - s->di;
                j = b->corner[corner].j - s->dj;
            } else if (w) {
                if (s->strip->axis) j -= size;
                else i -= size;
            }
        }
        l->i = i;
        l->j = j;
        s->layer[w] = 0;
        while (memcmp(&c->layers[s->layer[w]], l, sizeof *l) != 0) s->layer[w]++;
        if (s->layer[w] == c->layer_count) c->layer_count++; /* else two sides share a corner */
    }
}

/* Start a tile: texels at its edges are fixed, all others show the strip of the nearest edge. */
static void txt_begin_tile(txt_canvas *c, int tile) {
    const txt_build *b = c->b;
    const int side = c->side, size = b->set->size, sides = b->is_triangle ? 3 : 4;
    txt_side list[4];
    c->tile = tile;
    c->layer_count = 0;
    for (int k = 0; k < sides; k++) {
        txt_find_side(b, &b->set->tiles[tile], k, &list[k]);
        txt_add_side_layers(c, &list[k]);
    }
    c->frame_count = c->layer_count;
    for (int y = 0; y < side; y++) {
        for (int x = 0; x < side; x++) {
            const int p = y * side + x;
            c->inside[p] = (uint8_t)(!b->is_triangle || x + y <= size);
            if (!c->inside[p]) continue;
            int nearest = 0, depth = INT_MAX, na = 0, nu = 0, locks = 0;
            for (int k = 0; k < sides; k++) {
                int a, u;
                txt_side_place(b, &list[k], x, y, &a, &u);
                /* rows from the joint: 0 touches it */
                const int row = b->is_triangle ? abs(u) : u < 0 ? -1 - u : u;
                if (row < TXT_LOCK + b->is_triangle &&
                    (!b->is_triangle || row == 0 || (a >= 6 && a <= size - 6)))
                    locks = 1;
                if (row < depth) {
                    nearest = k;
                    depth = row;
                    na = a;
                    nu = u;
                }
            }
            const txt_seam_strip *s = list[nearest].strip;
            const int line = txm_clampi(nu, b->lock_from, b->lock_from + b->lock_count - 1);
            const int at = txm_clampi(na, 0, size - 1 + b->is_triangle);
            const int w = s->which[at * b->lock_count + line - b->lock_from];
            c->border[p] = (uint8_t)txm_clampi(depth, 0, 255);
            c->locked[p] = (uint8_t)locks;
            c->label[p] = (uint16_t)list[nearest].layer[w];
            c->shows[p] = txt_shown(b, &c->layers[c->label[p]], x, y);
            /* a segment or corner that does not reach here: another segment of the same edge */
            for (int v = 1; v <= s->count && c->shows[p] < 0; v++) {
                c->label[p] = (uint16_t)list[nearest].layer[v];
                c->shows[p] = txt_shown(b, &c->layers[c->label[p]], x, y);
            }
        }
    }
}

/* One more expansion move for every layer, limited to the surroundings of what it has. */
static void txt_expand_all(txt_canvas *c) {
    const int reach = 20;
    for (int l = 0; l < c->layer_count; l++) {
        int x0 = INT_MAX, y0 = INT_MAX, x1 = 0, y1 = 0;
        for (int y = 0; y < c->side; y++) {
            for (int x = 0; x < c->side; x++) {
                if (!c->inside[y * c->side + x] || c->label[y * c->side + x] != l) continue;
                if (x < x0) x0 = x;
                if (x >= x1) x1 = x + 1;
                if (y < y0) y0 = y;
                y1 = y + 1;
            }
        }
        if (x1 == 0) continue;
        txt_expand(c, l, txm_clampi(x0 - reach, 0, c->side), txm_clampi(y0 - reach, 0, c->side),
                   txm_clampi(x1 + reach, 0, c->side), txm_clampi(y1 + reach, 0, c->side));
    }
}

#endif /* TEXTILES_TILE_H */
