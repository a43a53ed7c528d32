#ifndef TEXTILES_INTERIOR_H
#define TEXTILES_INTERIOR_H

#include "tile.h"

/* ---- interiors: what the tiles so far show ----------------------------------------------- */

enum {
    TXT_MENDS = 12,       /* bad places of a tile for which another piece is sought            */
    TXT_WINDOW = 12,      /* half width of such a place                                        */
    TXT_USE = 20,         /* gray levels that a place costs which another interior shows       */
    TXT_PLACE_WEIGHT = 60 /* energy per search unit of a place and texel of a tile's side      */
};

/* For the extra cost of places that other interiors show already, in search units. */
typedef struct txt_use_query {
    const txt_build *b;
    int turn, size;
} txt_use_query;

/* approximately the rectangle of a sheet that a piece laid over the interior shows */
static void txt_piece_box(const txt_build *b, int turn, int size, int i, int j, int box[4]) {
    if (!b->is_triangle) {
        box[0] = i;
        box[1] = j;
        box[2] = i + size;
        box[3] = j + size;
        return;
    }
    int ci, cj; /* a square of the triangle's area around its centre */
    txt_turn(turn, size / 3, size / 3, &ci, &cj);
    const int x = i + ci + txt_half(j + cj), y = j + cj, r = size / 3;
    box[0] = x - r;
    box[1] = y - r;
    box[2] = x + r;
    box[3] = y + r;
}

/* Approximately the cells that a piece shows: receives their bounds, returns how many. */
static int txt_piece_cells(const txt_build *b, int sheet, int turn, int size, int i, int j,
                           int cells[4]) {
    const int across = b->sheets[sheet].width / TXT_CELL + 2;
    const int down = b->sheets[sheet].height / TXT_CELL + 2;
    int box[4];
    txt_piece_box(b, turn, size, i, j, box);
    for (int k = 0; k < 4; k++)
        cells[k] = txm_clampi((box[k] + TXT_CELL / 2) / TXT_CELL, 0, (k & 1 ? down : across) - 1);
    return (cells[2] - cells[0]) * (cells[3] - cells[1]);
}

/* By how much the traits of a piece exceed the means of the exemplars. */
static void txt_piece_traits(const txt_build *b, const txt_place *p, double more[TXT_TRAITS]) {
    int c[4];
    const int across = b->sheets[p->sheet].width / TXT_CELL + 2;
    const int area = txt_piece_cells(b, p->sheet, p->turn, b->set->size, p->i, p->j, c);
    const double *sum = b->traits[p->sheet];
    for (int k = 0; k < TXT_TRAITS; k++) {
        more[k] = 0;
        if (area <= 0) continue;
        more[k] = (sum[(c[3] * across + c[2]) * TXT_TRAITS + k] -
                   sum[(c[1] * across + c[2]) * TXT_TRAITS + k] -
                   sum[(c[3] * across + c[0]) * TXT_TRAITS + k] +
                   sum[(c[1] * across + c[0]) * TXT_TRAITS + k]) / area - b->usual[k];
    }
}

static void txt_use_extra(const void *context, int sheet, int i, int j, int n, uint32_t *cost) {
    const txt_use_query *q = (const txt_use_query *)context;
    const txt_build *b = q->b;
    const int across = b->sheets[sheet].width / TXT_CELL + 2;
    const uint32_t *sum = b->used[sheet];
    for (int k = 0; k < n; k++) {
        int c[4];
        const int area = txt_piece_cells(b, sheet, q->turn, q->size, i + k, j, c);
        if (area <= 0) continue;
        const uint32_t use = sum[c[3] * across + c[2]] - sum[c[1] * across + c[2]] -
                             sum[c[3] * across + c[0]] + sum[c[1] * across + c[0]];
        cost[k] += use / (uint32_t)area;
    }
}

/* Add to the surplus by how much the traits of a tile exceed the means of the exemplars. */
static void txt_count_traits(txt_build *b, const txt_canvas *c) {
    double sum[TXT_TRAITS] = {0}, one[TXT_TRAITS];
    int count = 0;
    for (int p = 0; p < c->side * c->side; p++) {
        if (!c->inside[p]) continue;
        txt_texel_traits(b, c->shows[p], one);
        for (int k = 0; k < TXT_TRAITS; k++) sum[k] += one[k];
        count++;
    }
    for (int k = 0; k < TXT_TRAITS; k++) b->surplus[k] += sum[k] / count - b->usual[k];
}

/* Count for each cell what the interior of a tile shows of it. */
static void txt_count_use(txt_build *b, const txt_canvas *c) {
    for (int y = 0; y < c->side; y++) {
        for (int x = 0; x < c->side; x++) {
            const int p = y * c->side + x;
            if (!c->inside[p] || c->layers[c->label[p]].is_frame) continue;
            const int32_t t = c->shows[p];
            const int e = txt_sheet_of(b->set, t);
            const int w = b->sheets[e].width, at = t - b->sheets[e].first;
            const int across = w / TXT_CELL + 2;
            const uint32_t weight = 8 + b->salient[t] / 2; /* 16 for mean salience */
            b->use[e][at / w / TXT_CELL * across + at % w / TXT_CELL] += weight;
        }
    }
}

/* Summed area table of the use, in search units: a cell that is used once more than the others
   costs TXT_USE gray levels at first, and less the more all of them are used. */
static void txt_sum_use(txt_build *b) {
    uint64_t total = 0;
    for (int e = 0; e < b->sheet_count; e++) {
        const int cells = (b->sheets[e].width / TXT_CELL + 2) * (b->sheets[e].height / TXT_CELL + 2);
        for (int k = 0; k < cells; k++) total += b->use[e][k];
    }
    const uint64_t one = 16 * (uint64_t)b->texels; /* everything used once */
    for (int e = 0; e < b->sheet_count; e++) {
        const int across = b->sheets[e].width / TXT_CELL + 2;
        const int down = b->sheets[e].height / TXT_CELL + 2;
        for (int y = 1; y < down; y++) {
            uint32_t row = 0;
            for (int x = 1; x < across; x++) {
                const uint64_t use = b->use[e][(y - 1) * across + x - 1];
                row += (uint32_t)(use * TXT_USE * TXT_SCALE * b->texels /
                                  (TXT_CELL * TXT_CELL * (one + total)));
                b->used[e][y * across + x] = b->used[e][(y - 1) * across + x] + row;
            }
        }
    }
}

/* ---- interiors: finding and cutting them ------------------------------------------------- */

/* Give layer l all texels of the rectangle that show the frame and lie at least `depth` rows from
   every joint. */
static void txt_fill_interior(txt_canvas *c, int l, int x0, int y0, int x1, int y1, int depth) {
    for (int y = y0; y < y1; y++) {
        for (int x = x0; x < x1; x++) {
            const int p = y * c->side + x;
            if (!c->inside[p] || c->border[p] < depth || !c->layers[c->label[p]].is_frame) continue;
            const int32_t t = txt_shown(c->b, &c->layers[l], x, y);
            if (t < 0) continue;
            c->label[p] = (uint16_t)l;
            c->shows[p] = t;
        }
    }
}

/* Find places of the exemplars that continue the frame inwards. */
static void txt_find_interiors(txt_canvas *c) {
    const txt_build *b = c->b;
    const int side = c->side, turns = b->is_triangle ? 6 : 1;
    txt_use_query use = {b, 0, b->set->size};
    c->place_count = 0;
    c->query.extra = txt_use_extra;
    c->query.context = &use;
    c->query.apart = 1 + b->set->size / (b->set->variants > 1 ? 8 : 12);
    c->query.coarse = turns > 1 ? 3 : 0;
    for (int turn = 0; turn < turns; turn++) {
        c->query.count = 0;
        use.turn = turn;
        for (int y = 0; y < side; y++) {
            for (int x = 0; x < side; x++) {
                const int p = y * side + x;
                if (!c->inside[p] || c->border[p] < 2 || c->border[p] > 10) continue;
                if (c->border[p] % 3 != 2 || (x + y) % 3 || (turns > 1 && (x ^ y) & 1)) continue;
                int i, j;
                txt_turn(turn, x, y, &i, &j);
                txt_sample_add(b, &c->query, i, j, c->shows[p]);
            }
        }
        for (int e = 0; e < b->sheet_count; e++)
            c->place_count = txt_search(b, &c->query, e, turn, &c->scratch, c->places,
                                        c->place_count, TXT_PLACES);
    }
}

/* The layer of a place, new or existing; -1: too many layers. */
static int txt_add_layer(txt_canvas *c, const txt_place *p) {
    const txt_layer layer = {p->sheet, p->turn, p->i, p->j, 0};
    for (int l = 0; l < c->layer_count; l++) {
        txt_layer *old = &c->layers[l];
        if (!old->is_frame && old->sheet == layer.sheet && old->turn == layer.turn &&
            old->i == layer.i && old->j == layer.j)
            return l;
    }
    if (c->layer_count == c->layer_capacity) return -1;
    c->layers[c->layer_count] = layer;
    return c->layer_count++;
}

/* At the worst places along the cuts, search for a piece that matches the surroundings, and expand
   it. */
static void txt_mend(txt_canvas *c) {
    const txt_build *b = c->b;
    const int side = c->side, r = TXT_WINDOW;
    int done_x[TXT_MENDS] = {0}, done_y[TXT_MENDS] = {0};
    c->query.extra = NULL;
    c->query.apart = 3;
    c->query.coarse = 2;
    const int mends = b->is_triangle ? TXT_MENDS * 2 / 3 : TXT_MENDS; /* half the area */
    for (int n = 0; n < mends; n++) {
        /* the window of the highest cost, on a grid */
        int64_t worst = 0;
        int wx = -1, wy = -1;
        for (int y = 2; y + 2 < side; y += 4) {
            for (int x = 2; x + 2 < side; x += 4) {
                if (!c->inside[y * side + x]) continue;
                int again = 0;
                for (int k = 0; k < n; k++)
                    again |= abs(done_x[k] - x) < 6 && abs(done_y[k] - y) < 6;
                if (again) continue;
                int64_t sum = 0;
                for (int dy = -5; dy <= 5; dy++) {
                    for (int dx = -5; dx <= 5; dx++) {
                        const int px = x + dx, py = y + dy;
                        if (px < 0 || py < 0 || px + 1 >= side || py + 1 >= side) continue;
                        const int p = py * side + px;
                        if (!c->inside[p]) continue;
                        for (int k = 0; k < c->half; k++) {
                            const int qx = px + c->dx[k], qy = py + c->dy[k];
                            if (qx < 0) continue;
                            const int q = qy * side + qx;
                            if (c->inside[q] && c->label[p] != c->label[q])
                                sum += txt_cut_cost(c, p, q, px, py, c->dx[k], c->dy[k]);
                        }
                    }
                }
                if (sum > worst) {
                    worst = sum;
                    wx = x;
                    wy = y;
                }
            }
        }
        if (wx < 0) return;
        done_x[n] = wx;
        done_y[n] = wy;
        const int x0 = txm_clampi(wx - r, 0, side), x1 = txm_clampi(wx + r + 1, 0, side);
        const int y0 = txm_clampi(wy - r, 0, side), y1 = txm_clampi(wy + r + 1, 0, side);
        txt_place found[2];
        int count = 0;
        int turn = c->layers[c->label[wy * side + wx]].turn;
        c->query.count = 0;
        for (int y = y0; y < y1; y += 2) {
            for (int x = x0 + (y / 2 & 1); x < x1; x += 2) {
                const int p = y * side + x;
                if (!c->inside[p] || (abs(x - wx) < 6 && abs(y - wy) < 6 && !c->locked[p]))
                    continue;
                int i, j;
                txt_turn(turn, x, y, &i, &j);
                txt_sample_add(b, &c->query, i, j, c->shows[p]);
            }
        }
        for (int e = 0; e < b->sheet_count; e++)
            count = txt_search(b, &c->query, e, turn, &c->scratch, found, count, 2);
        for (int k = 0; k < count; k++) {
            const int before = c->layer_count, l = txt_add_layer(c, &found[k]);
            if (l < 0) return;
            if (txt_expand(c, l, x0, y0, x1, y1) == 0) c->layer_count = before;
        }
    }
}

/* Compute from the labels what the texels show. */
static void txt_show(txt_canvas *c) {
    for (int y = 0; y < c->side; y++) {
        for (int x = 0; x < c->side; x++) {
            const int p = y * c->side + x;
            if (c->inside[p]) c->shows[p] = txt_shown(c->b, &c->layers[c->label[p]], x, y);
        }
    }
}

/* side of the blocks in which the interior is filled: that of the tile, or less if the exemplars
   are smaller */
static int txt_block_side(const txt_build *b) {
    int most = 0;
    for (int e = 0; e < b->sheet_count; e++) {
        const txt_sheet *s = &b->sheets[e];
        const int least = s->width < s->height ? s->width : s->height;
        if (least > most) most = least;
    }
    if (b->set->side + 8 <= most) return b->set->side;
    most = most * 5 / 8 - 16;
    return most > 8 ? most : 8;
}

/* Fill the interior block by block, as the exemplar is too small to fill it at once; each block
   continues the frame and the blocks before it. */
static void txt_fill_blocks(txt_canvas *c, int forced) {
    const txt_build *b = c->b;
    const int side = c->side, block = txt_block_side(b), reach = 8;
    const int count = (side + block - 1) / block, size = (side + count - 1) / count;
    txt_use_query use = {b, 0, size};
    c->query.extra = txt_use_extra;
    c->query.context = &use;
    c->query.apart = 1 + size / 6;
    for (int n = 0; n < count * count; n++) {
        const int x0 = txm_clampi(n % count * size - reach, 0, side);
        const int x1 = txm_clampi(n % count * size + size + reach, 0, side);
        const int y0 = txm_clampi(n / count * size - reach, 0, side);
        const int y1 = txm_clampi(n / count * size + size + reach, 0, side);
        txt_place place[4];
        int found = 0;
        c->query.count = 0;
        for (int y = y0; y < y1; y += 2) {
            for (int x = x0 + (y / 2 & 1); x < x1; x += 2) {
                const int p = y * side + x;
                if (!c->inside[p] || (c->layers[c->label[p]].is_frame && c->border[p] > 10))
                    continue;
                txt_sample_add(b, &c->query, x, y, c->shows[p]);
            }
        }
        if (c->query.count == 0) { /* nothing to continue: any place that is little used so far */
            const int32_t any = b->sheets[0].first;
            for (int k = 0; k < 4; k++)
                txt_sample_add(b, &c->query, k & 1 ? x0 : x1 - 1, k & 2 ? y0 : y1 - 1, any);
        }
        for (int e = 0; e < b->sheet_count; e++)
            found = txt_search(b, &c->query, e, 0, &c->scratch, place, found, 4);
        /* not always the best, which is the same for all tiles with these edges */
        txm_rng rng = txm_rng_make(b->desc->seed, (uint64_t)c->tile * 4096 + (uint64_t)n);
        const int l =
            found ? txt_add_layer(c, &place[txm_rng_below(&rng, (uint32_t)found)]) : -1;
        if (l < 0) continue;
        txt_fill_interior(c, l, x0, y0, x1, y1, forced);
        txt_expand(c, l, x0, y0, x1, y1);
    }
}

/* Where no piece reaches (only with an exemplar much smaller than the tile) show the texel of the
   sheet that is nearest to the one of the label. */
static void txt_fill_gaps(txt_canvas *c) {
    const txt_build *b = c->b;
    for (int p = 0; p < c->side * c->side; p++) {
        if (!c->inside[p] || c->shows[p] >= 0) continue;
        const txt_layer *l = &c->layers[c->label[p]];
        const txt_sheet *s = &b->sheets[l->sheet];
        int i, j;
        txt_turn(l->turn, p % c->side, p / c->side, &i, &j);
        j = txm_clampi(j + l->j, 0, s->height - 1);
        i = txm_clampi(i + l->i + (b->is_triangle ? txt_half(j) : 0), 0, s->width - 1);
        c->shows[p] = s->first + j * s->width + i;
    }
}

/* Cut one interior after the other into the frame, keep the best, and mend it. */
static void txt_cut_tile(txt_canvas *c) {
    const txt_build *b = c->b;
    const int side = c->side, size = b->set->size;
    const size_t bytes = (size_t)side * (size_t)side * sizeof *c->label;
    const int depth = b->is_triangle ? size / 6 : size / 5;
    const int forced = depth > TXT_LOCK ? depth : TXT_LOCK; /* what tiles share stays */
    int64_t least = 0;
    c->best_place = -1;
    if (txt_block_side(b) < side || c->place_count == 0) {
        txt_fill_blocks(c, forced);
        txt_expand_all(c);
        txt_mend(c);
        return;
    }
    memcpy(c->start, c->label, bytes);
    for (int k = 0; k < c->place_count && k < c->tries; k++) {
        c->layer_count = c->frame_count;
        memcpy(c->label, c->start, bytes);
        txt_show(c);
        txt_add_layer(c, &c->places[k]);
        txt_fill_interior(c, c->frame_count, 0, 0, side, side, forced);
        txt_expand(c, c->frame_count, 0, 0, side, side);
        txt_expand_all(c);
        const int64_t energy = txt_energy(c, 0, 0, side, side) +
                               (int64_t)c->places[k].cost * TXT_PLACE_WEIGHT * side;
        if (c->best_place >= 0 && energy >= least) continue;
        least = energy;
        c->best_place = k;
        memcpy(c->best, c->label, bytes);
    }
    c->layer_count = c->frame_count;
    txt_add_layer(c, &c->places[c->best_place]);
    memcpy(c->label, c->best, bytes);
    txt_show(c);
    txt_mend(c);
}

#endif /* TEXTILES_INTERIOR_H */
