#ifndef TEXSYN_LAYING_H
#define TEXSYN_LAYING_H

#include "darkness.h"

/* ---- laying pieces ----------------------------------------------------------------------

   The cracks of a picture of another size: square pieces of the exemplar's are laid in rows, each
   over the borders of its neighbours to the left and above, and joined to them along minimum-error
   cuts [5]. What is compared is the strength along lines, so that cracks meet. Clique statistics do
   not keep thin long lines; pieces do. They are mirrored and turned as far as the exemplar
   has no direction that this would change. A crack that is seen again and again, mirrored or not,
   is conspicuous, so a part of the exemplar costs more the more often it has been used and the
   nearer. Its cells count by their cracks: intact stone may recur. */

enum {
    TXS_PIECE = 192,       /* pixels: side of a piece                                           */
    TXS_PIECE_PARTS = 5,   /* and at most two fifths of the exemplar's shorter side             */
    TXS_OVERLAP_PART = 5,  /* of a piece lies over the one before                               */
    TXS_TRIES = 768,       /* random places that are compared for each piece                    */
    TXS_TRY_STEP = 3,      /* pixels between those of their overlaps that are compared          */
    TXS_FINALISTS = 8,     /* places that are moved a little and compared closely               */
    TXS_MOVES = 3,         /* pixels each way                                                   */
    TXS_MOVED = (2 * TXS_MOVES + 1) * (2 * TXS_MOVES + 1),
    TXS_TRY_SHARES = 16,   /* into which the comparisons are divided for threads                */
    TXS_CELL = 16,         /* pixels: side of a cell of the exemplar whose uses are counted     */
    TXS_NEAR_PIECES = 4,   /* pieces each way in which the same cracks would be noticed         */
    TXS_TURNS = 8          /* ways to lay a square: bit 0 mirrors x, 1 mirrors y, 2 swaps them  */
};
#define TXS_SAME_DIRECTION 0.2  /* the structure of an exemplar without direction is below this */
#define TXS_USED_WEIGHT 2.0     /* of the square of uses over the average, in the cost          */
#define TXS_NEAR_WEIGHT 32.0    /* of a piece all of whose cracks are laid beside it            */
#define TXS_INTACT_CONTENT 0.02 /* of an intact pixel, compared with a crack of strength 1      */
#define TXS_CRACK_WEIGHT 3.0    /* of a crack of strength 1 in the error, compared with 1        */

typedef struct txs_place_of { /* a piece of the exemplar */
    int x, y, turn;
} txs_place_of;

typedef struct txs_laying {
    const txs_stone *stone;
    int width, height;              /* of the picture                                           */
    int side, overlap;
    int32_t *source;                /* for each pixel of the picture one of the exemplar; -1    */
    uint32_t *used;                 /* per cell of the exemplar                                 */
    double *content;                /* of all cells to the left of and above each corner of one */
    int cells_x, cells_y;
    txs_place_of *laid;             /* the pieces laid so far, row by row                       */
    int rows, columns, row, column; /* of pieces, and of the one that is being laid             */
    int turns[TXS_TURNS], turn_count;
    int left, top;                  /* of the piece that is being laid, in the picture          */
    int piece_width, piece_height;  /* the part of it inside the picture                        */
    txs_place_of tries[TXS_TRIES];
    double costs[TXS_TRIES];
    int try_count, try_step;        /* of those that are being compared                         */
    float *error;                   /* of an overlap                                            */
    double *scratch;
    int *path[2];                   /* where the new piece begins: along the left, along the top */
} txs_laying;

/* The exemplar's pixel under pixel (u, v) of a piece. */
static size_t txs_under(const txs_laying *l, const txs_place_of *p, int u, int v) {
    int x = p->turn & 4 ? v : u, y = p->turn & 4 ? u : v;
    if (p->turn & 1) x = l->side - 1 - x;
    if (p->turn & 2) y = l->side - 1 - y;
    return (size_t)(p->y + y) * (size_t)l->stone->width + (size_t)(p->x + x);
}

/* Which turns keep the directions of the exemplar, by its structure tensor: the mirrored one differs
   in the sign of the mixed term, the one turned by a quarter in that of the difference. */
static void txs_find_turns(txs_laying *l) {
    const txs_stone *s = l->stone;
    double xx = 0, xy = 0, yy = 0;
    for (int y = 1; y < s->height; y++) {
        for (int x = 1; x < s->width; x++) {
            const float *p = s->strength + (size_t)y * (size_t)s->width + (size_t)x;
            const double gx = (double)p[0] - (double)p[-1];
            const double gy = (double)p[0] - (double)p[-s->width];
            xx += gx * gx;
            xy += gx * gy;
            yy += gy * gy;
        }
    }
    const double sum = xx + yy;
    const int mirror = 2 * fabs(xy) <= TXS_SAME_DIRECTION * sum;
    const int quarter = fabs(xx - yy) <= TXS_SAME_DIRECTION * sum;
    l->turn_count = 0;
    for (int t = 0; t < TXS_TURNS; t++) {
        const int mirrors = (t & 1) + (t >> 1 & 1), swaps = t >> 2 & 1;
        /* an odd number of reflections negates the mixed term; a swap, the difference */
        const int keeps_mixed = mirror || (mirrors % 2 == 0);
        const int keeps_difference = quarter || !swaps;
        if (keeps_mixed && keeps_difference) l->turns[l->turn_count++] = t;
    }
}

/* What cells from..to (not included) hold of cracks. */
static double txs_content_of(const txs_laying *l, int from_x, int from_y, int to_x, int to_y) {
    const size_t stride = (size_t)l->cells_x + 1;
    const double *above = l->content + (size_t)from_y * stride;
    const double *below = l->content + (size_t)to_y * stride;
    return below[to_x] - below[from_x] - above[to_x] + above[from_x];
}

static void txs_find_content(txs_laying *l) {
    const txs_stone *s = l->stone;
    const size_t stride = (size_t)l->cells_x + 1;
    for (int y = 0; y < s->height; y++) {
        for (int x = 0; x < s->width; x++) {
            const size_t i = (size_t)y * (size_t)s->width + (size_t)x;
            const double crack = s->strength[i] > 0 ? (double)s->strength[i] : 0;
            l->content[(size_t)(y / TXS_CELL + 1) * stride + (size_t)(x / TXS_CELL + 1)] +=
                TXS_INTACT_CONTENT + crack * crack;
        }
    }
    for (size_t y = 1; y <= (size_t)l->cells_y; y++) {
        for (size_t x = 1; x < stride; x++) {
            double *p = l->content + y * stride + x;
            *p += p[-1] + *(p - stride) - *(p - stride - 1);
        }
    }
}

/* The cell border nearest to coordinate x. */
static int txs_cell_border(int x) { return (x + TXS_CELL / 2) / TXS_CELL; }

/* What two pieces share, as a part of what the first one holds. */
static double txs_shared(const txs_laying *l, const txs_place_of *p, const txs_place_of *q) {
    const int left = txs_cell_border(p->x > q->x ? p->x : q->x);
    const int top = txs_cell_border(p->y > q->y ? p->y : q->y);
    const int right = txs_cell_border((p->x < q->x ? p->x : q->x) + l->side);
    const int bottom = txs_cell_border((p->y < q->y ? p->y : q->y) + l->side);
    if (left >= right || top >= bottom) return 0;
    const int end_x = txm_clampi(right, 0, l->cells_x), end_y = txm_clampi(bottom, 0, l->cells_y);
    if (left >= end_x || top >= end_y) return 0;
    const int most_x = txm_clampi(txs_cell_border(p->x + l->side), 0, l->cells_x);
    const int most_y = txm_clampi(txs_cell_border(p->y + l->side), 0, l->cells_y);
    return txs_content_of(l, left, top, end_x, end_y) /
           txs_content_of(l, txs_cell_border(p->x), txs_cell_border(p->y), most_x, most_y);
}

/* How much of a piece is laid near by already, the nearer the more. */
static double txs_seen_near(const txs_laying *l, const txs_place_of *p) {
    double sum = 0;
    for (int row = txm_clampi(l->row - TXS_NEAR_PIECES, 0, l->row); row <= l->row; row++) {
        const int from = l->column - TXS_NEAR_PIECES, to = l->column + TXS_NEAR_PIECES + 1;
        const int end = row == l->row ? l->column : to < l->columns ? to : l->columns;
        for (int column = from > 0 ? from : 0; column < end; column++) {
            const int across = column - l->column, down = row - l->row;
            const double nearness =
                1 - sqrt((double)(across * across + down * down)) / (TXS_NEAR_PIECES + 1);
            if (nearness <= 0) continue;
            sum += nearness * nearness * txs_shared(l, p, &l->laid[row * l->columns + column]);
        }
    }
    return sum;
}

/* Mean uses of the cells under a piece, by their contents, over what they would be if all cells were
   used alike. */
static double txs_uses_of(const txs_laying *l, const txs_place_of *p) {
    double sum = 0, content = 0;
    for (int y = p->y / TXS_CELL; y <= (p->y + l->side - 1) / TXS_CELL; y++) {
        for (int x = p->x / TXS_CELL; x <= (p->x + l->side - 1) / TXS_CELL; x++) {
            const double c = txs_content_of(l, x, y, x + 1, y + 1);
            sum += c * (double)l->used[(size_t)y * (size_t)l->cells_x + (size_t)x];
            content += c;
        }
    }
    const double per_piece = (double)(l->side + TXS_CELL) * (double)(l->side + TXS_CELL) /
                             ((double)l->stone->width * (double)l->stone->height);
    return sum / content / (1 + (double)(l->row * l->columns + l->column) * per_piece);
}

static void txs_count_use(txs_laying *l, const txs_place_of *p) {
    for (int y = p->y / TXS_CELL; y <= (p->y + l->side - 1) / TXS_CELL; y++) {
        for (int x = p->x / TXS_CELL; x <= (p->x + l->side - 1) / TXS_CELL; x++)
            l->used[(size_t)y * (size_t)l->cells_x + (size_t)x]++;
    }
    TEXSYN_ASSERT(l->row < l->rows && l->column < l->columns);
    l->laid[l->row * l->columns + l->column] = *p;
}

/* Squared difference of strengths where a piece lies on what is there; cracks count more than what is
   between them. */
static double txs_error_at(const txs_laying *l, const txs_place_of *p, int u, int v) {
    const size_t at = (size_t)(l->top + v) * (size_t)l->width + (size_t)(l->left + u);
    const double a = (double)l->stone->strength[txs_under(l, p, u, v)];
    const double b = (double)l->stone->strength[l->source[at]];
    const double crack = a > b ? a : b;
    return (a - b) * (a - b) * (crack > 0 ? 1 + TXS_CRACK_WEIGHT * crack : 1);
}

/* Mean error over every try_step-th row and column of the overlap; unknown pixels of the exemplar count as
   the largest error. */
static double txs_try_cost(const txs_laying *l, const txs_place_of *p) {
    double sum = 0, count = 1e-6, unknown = 0, seen = 0;
    for (int v = 0; v < l->piece_height; v += l->try_step) {
        for (int u = 0; u < l->piece_width; u += l->try_step) {
            seen++;
            unknown += !l->stone->known[txs_under(l, p, u, v)];
            if (!((l->left && u < l->overlap) || (l->top && v < l->overlap))) continue;
            sum += txs_error_at(l, p, u, v);
            count++;
        }
    }
    const double steep = (double)(TXS_MOST_DARK - TXS_LEAST_DARK);
    const double base = 0.02; /* so that uses count among places of equal error */
    const double uses = txs_uses_of(l, p);
    const double again = TXS_USED_WEIGHT * uses * uses + TXS_NEAR_WEIGHT * txs_seen_near(l, p);
    return (base + sum / count) * (1 + again) +
           steep * steep * unknown / seen;
}

static void txs_try_share(void *context, int share) {
    txs_laying *l = (txs_laying *)context;
    for (int i = share; i < l->try_count; i += TXS_TRY_SHARES)
        l->costs[i] = txs_try_cost(l, &l->tries[i]);
}

/* Compare the tries, every step-th pixel each way. Returns the best one. */
static int txs_compare_tries(txs_laying *l, int count, int step, txm_env *env) {
    int best = 0;
    l->try_count = count;
    l->try_step = step;
    txm_parallel_for(env, TXS_TRY_SHARES, txs_try_share, l);
    for (int i = 1; i < count; i++)
        if (l->costs[i] < l->costs[best]) best = i;
    return best;
}

/* Replace the tries by the best of them, each moved by up to TXS_MOVES pixels. Returns how many. */
static int txs_move_tries(txs_laying *l) {
    txs_place_of finalists[TXS_FINALISTS];
    int count = 0;
    for (int k = 0; k < TXS_FINALISTS; k++) {
        int best = 0;
        for (int i = 1; i < l->try_count; i++)
            if (l->costs[i] < l->costs[best]) best = i;
        finalists[k] = l->tries[best];
        l->costs[best] = 1e300;
    }
    for (int k = 0; k < TXS_FINALISTS; k++) {
        for (int i = 0; i < TXS_MOVED; i++) {
            TEXSYN_ASSERT(count < TXS_TRIES);
            txs_place_of *p = &l->tries[count++];
            const int side = 2 * TXS_MOVES + 1;
            *p = finalists[k];
            p->x = txm_clampi(p->x + i % side - TXS_MOVES, 0, l->stone->width - l->side);
            p->y = txm_clampi(p->y + i / side - TXS_MOVES, 0, l->stone->height - l->side);
        }
    }
    return count;
}

/* The best place for the piece at (left, top): of many random ones, then near the best of these. */
static const txs_place_of *txs_choose_place(txs_laying *l, txm_rng *rng, txm_env *env) {
    for (int i = 0; i < TXS_TRIES; i++) {
        txs_place_of *p = &l->tries[i];
        p->x = txm_rng_range(rng, 0, l->stone->width - l->side);
        p->y = txm_rng_range(rng, 0, l->stone->height - l->side);
        p->turn = l->turns[txm_rng_below(rng, (uint32_t)l->turn_count)];
    }
    txs_compare_tries(l, TXS_TRIES, TXS_TRY_STEP, env);
    return &l->tries[txs_compare_tries(l, txs_move_tries(l), 2, env)];
}

/* Where the piece begins in each row of its left overlap (top = 0) or column of its upper one. */
static void txs_cut_overlap(txs_laying *l, const txs_place_of *p, int top) {
    const int length = top ? l->piece_width : l->piece_height;
    const int across = top ? l->piece_height : l->piece_width;
    const int width = l->overlap < across ? l->overlap : across;
    for (int i = 0; i < length; i++) {
        for (int j = 0; j < width; j++)
            l->error[i * width + j] =
                txm_float(1e-3 + (top ? txs_error_at(l, p, i, j) : txs_error_at(l, p, j, i)));
    }
    txm_cut(l->error, length, width, width, 1, l->path[top], l->scratch);
}

static void txs_lay_piece(txs_laying *l, const txs_place_of *p) {
    if (l->left) txs_cut_overlap(l, p, 0);
    if (l->top) txs_cut_overlap(l, p, 1);
    for (int v = 0; v < l->piece_height; v++) {
        for (int u = 0; u < l->piece_width; u++) {
            if ((l->left && u < l->path[0][v]) || (l->top && v < l->path[1][u])) continue;
            l->source[(size_t)(l->top + v) * (size_t)l->width + (size_t)(l->left + u)] =
                (int32_t)txs_under(l, p, u, v);
        }
    }
}

/* Pieces that cover a length of the picture, each but the first `overlap` over the one before. */
static int txs_count_pieces(int length, int overlap, int step) {
    return length <= overlap ? 1 : (length - overlap - 1) / step + 1;
}

/* Fill source; memory for the work is taken from arena. Reports from..to. */
static txm_status txs_lay_all(const txs_stone *stone, int width, int height, uint64_t seed,
                              txm_arena *arena, int32_t *source, txm_env *env, float from,
                              float to) {
    const int shorter = stone->width < stone->height ? stone->width : stone->height;
    txs_laying *l = (txs_laying *)txm_arena_zero(arena, 1, sizeof *l);
    if (!l) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the cracks");
    l->stone = stone;
    l->width = width;
    l->height = height;
    l->source = source;
    l->side = 2 * shorter / TXS_PIECE_PARTS;
    if (l->side > TXS_PIECE) l->side = TXS_PIECE;
    l->overlap = l->side / TXS_OVERLAP_PART;
    l->cells_x = (stone->width - 1) / TXS_CELL + 1;
    l->cells_y = (stone->height - 1) / TXS_CELL + 1;
    l->used = (uint32_t *)txm_arena_zero(arena, txs_pixels_of(l->cells_x, l->cells_y),
                                         sizeof(uint32_t));
    l->content = (double *)txm_arena_zero(arena, txs_pixels_of(l->cells_x + 1, l->cells_y + 1),
                                          sizeof(double));
    const int step = l->side - l->overlap;
    l->rows = txs_count_pieces(height, l->overlap, step);
    l->columns = txs_count_pieces(width, l->overlap, step);
    l->laid = (txs_place_of *)txm_arena_alloc(arena, txs_pixels_of(l->columns, l->rows),
                                              sizeof(txs_place_of));
    const size_t strip = (size_t)l->side * (size_t)l->overlap;
    l->error = (float *)txm_arena_alloc(arena, strip, sizeof(float));
    l->scratch = (double *)txm_arena_alloc(arena, strip, sizeof(double));
    l->path[0] = (int *)txm_arena_alloc(arena, (size_t)l->side, sizeof(int));
    l->path[1] = (int *)txm_arena_alloc(arena, (size_t)l->side, sizeof(int));
    if (arena->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the cracks");
    txs_find_turns(l);
    txs_find_content(l);
    txm_rng rng = txm_rng_make(seed, 1);
    for (l->row = 0; l->row < l->rows; l->row++) {
        l->top = l->row * step;
        if (txm_progress(env, txm_lerpf(from, to, (float)l->top / (float)height), "lay cracks"))
            return txm_fail(env, TXM_CANCELLED, "cancelled");
        l->piece_height = l->side < height - l->top ? l->side : height - l->top;
        for (l->column = 0; l->column < l->columns; l->column++) {
            l->left = l->column * step;
            l->piece_width = l->side < width - l->left ? l->side : width - l->left;
            const txs_place_of *p = txs_choose_place(l, &rng, env);
            txs_lay_piece(l, p);
            txs_count_use(l, p);
        }
    }
    return TXM_OK;
}

#endif /* TEXSYN_LAYING_H */
