#ifndef TEXPATCH_QUILT_H
#define TEXPATCH_QUILT_H

#include "canvas.h"
#include "courses.h"

/* ---- first pass: patches and cuts -------------------------------------------------------- */

/* How often the exemplar is used: pixels of the canvas that come from each cell of the stack. */
typedef struct txp_use {
    int columns, rows;
    uint32_t *count;
    uint32_t *sums; /* (columns + 1) x (rows + 1): of all cells above and left                  */
    /* for each number of cells: 1 / (their mean sum once the canvas is full) */
    double share[(4 * TXP_BLOCK / TXP_CELL + 2) * (4 * TXP_BLOCK / TXP_CELL + 2)];
} txp_use;

typedef struct txp_quilt {
    const txp_source *source;
    const txp_stack *stack;
    txp_canvas canvas;
    uint8_t *known; /* as canvas.pixels: 255 where a byte is to be compared              */
    uint8_t *done;  /* of each pixel of the canvas                                       */
    txp_use use;
    int block, overlap;
    double shift_x, shift_y; /* the lattice offset of the canvas                                */
    double use_weight, lattice_weight;
    txm_rng rng;
    double cost;            /* of all cuts                                                      */
    int failed;             /* no piece of the exemplar fits                                    */
    float *error;           /* block^2                                                          */
    double *scratch;        /* block * overlap                                                  */
    txp_place *near_places; /* candidates within the tolerance                                 */
    float *near_costs;
} txp_quilt;

enum { TXP_CANDIDATES = 256 };

/* Sum of |canvas - stack| over the known bytes of a block; span: first and last 16 bytes of each
   row that hold any. */
static uint32_t txp_sad_known(const txp_quilt *q, const uint8_t *a, const uint8_t *known,
                              const uint8_t *b, const int (*span)[2], uint32_t limit) {
    uint32_t total = 0;
    for (int y = 0; y < q->block && total <= limit; y++) {
#ifdef TXP_SSE2
        __m128i sum = _mm_setzero_si128();
        for (int i = span[y][0]; i < span[y][1]; i += 16) {
            const __m128i m = _mm_loadu_si128((const __m128i *)(const void *)(known + i));
            const __m128i u = _mm_loadu_si128((const __m128i *)(const void *)(a + i));
            const __m128i v = _mm_loadu_si128((const __m128i *)(const void *)(b + i));
            sum = _mm_add_epi32(sum, _mm_sad_epu8(_mm_and_si128(u, m), _mm_and_si128(v, m)));
        }
        total += txp_sad_sum(sum);
#else
        for (int i = span[y][0]; i < span[y][1]; i++) {
            const int d = (a[i] & known[i]) - (b[i] & known[i]);
            total += (uint32_t)(d < 0 ? -d : d);
        }
#endif
        a += q->canvas.pitch;
        known += q->canvas.pitch;
        b += q->stack->pitch;
    }
    return total;
}

/* Store a pixel, and its copies beyond the ends of a torus. */
static void txp_quilt_put(txp_quilt *q, int x, int y, txp_place at) {
    const txp_canvas *c = &q->canvas;
    const size_t n = (size_t)q->source->bytes, i = txp_index(c, x, y);
    const size_t guide = (size_t)q->source->guide_at;
    const int bind = !(c->free_guide && c->free_guide[i]);
    const uint8_t *in = txp_stack_at(q->source, q->stack, at.x, at.y);
    c->at[i] = at;
    q->done[i] = 1;
    for (int yy = y; yy < c->height + (c->wrap & TEXPATCH_TILE_Y ? TXP_PAD : 0); yy += c->height) {
        for (int xx = x; xx < c->width + (c->wrap & TEXPATCH_TILE_X ? TXP_PAD : 0);
             xx += c->width) {
            const size_t k = (size_t)yy * c->pitch + (size_t)xx * n;
            memcpy(c->pixels + k, in, bind ? guide : n);
            memset(q->known + k, 255, guide);
        }
    }
}

/* total: pixels of the full canvas */
static void txp_use_mean(txp_use *u, double total) {
    const double mean = total / (u->columns * u->rows);
    for (size_t i = 1; i < sizeof u->share / sizeof *u->share; i++)
        u->share[i] = 1 / (mean * (double)i);
}

/* Update the summed-area table. */
static void txp_use_integrate(const txp_use *u) {
    const int w = u->columns + 1;
    for (int j = 0; j < u->rows; j++) {
        uint32_t row = 0;
        for (int i = 0; i < u->columns; i++) {
            row += u->count[j * u->columns + i];
            u->sums[(j + 1) * w + i + 1] = u->sums[j * w + i + 1] + row;
        }
    }
}

/* Mean use of the cells that a piece of size x size pixels at (x, y) covers; 1 is the average. */
static inline double txp_use_at(const txp_use *u, int x, int y, int size) {
    const int x0 = x / TXP_CELL, y0 = y / TXP_CELL, w = u->columns + 1;
    const int x1 = (x + size - 1) / TXP_CELL + 1, y1 = (y + size - 1) / TXP_CELL + 1;
    const uint32_t sum =
        u->sums[y1 * w + x1] - u->sums[y1 * w + x0] - u->sums[y0 * w + x1] + u->sums[y0 * w + x0];
    return sum * u->share[(x1 - x0) * (y1 - y0)];
}

/* The piece for the block at (bx, by). */
static int txp_quilt_find(txp_quilt *q, int bx, int by, txp_place *found) {
    const txp_source *s = q->source;
    const txp_stack *k = q->stack;
    const txp_canvas *c = &q->canvas;
    const int size = q->block, bytes = size * s->bytes;
    int span[4 * TXP_BLOCK][2], count = 0;
    uint32_t known = 0;
    const txp_goal goal = txp_goal_make(k, &s->courses, bx + q->shift_x, by + q->shift_y, size);
    txp_use_integrate(&q->use);
    const uint8_t *a = txp_canvas_at(s, c, bx, by), *m = q->known + (a - c->pixels);
    for (int y = 0; y < size; y++) {
        const uint8_t *row = m + (size_t)y * c->pitch;
        span[y][0] = bytes;
        span[y][1] = 0;
        for (int i = 0; i < bytes; i++) {
            if (!row[i]) continue;
            known++;
            if (span[y][0] == bytes) span[y][0] = i / 16 * 16;
            span[y][1] = i / 16 * 16 + 16;
        }
    }
    /* costs are gray levels summed over known bytes; the first block has no such bytes */
    const double unit = known ? (double)known : 1;
    double best = 1e30;
    const double tolerance = 1.02; /* ours: candidates of costs this near the least are as good */
    const uint32_t start = txm_rng_next(&q->rng);
    /* once more without the lattice, if no place of the exemplar lies on it */
    for (int n = 0, strict = s->has_lattice; n < s->sheets || (strict && !count); n++) {
        if (n == s->sheets) n = strict = 0;
        const int rows = k->high[n] - size + 1, columns = k->wide[n] - size + 1;
        for (int j = 0; j < rows; j++) {
            for (int i = 0; i < columns; i++) {
                const int x = i, y = k->first[n] + j;
                double extra = 0;
                if (s->has_lattice) {
                    const double d = txp_off_bond(k, &s->courses, &goal, x, y);
                    if (d > (double)TXP_OFF_LATTICE && strict) continue;
                    extra += q->lattice_weight * fmin(d, TXP_OFF_LATTICE);
                }
                if (k->bad && !txp_fits(s, k, x, y, size, size)) continue;
                if (!known)
                    extra += (double)(txm_hash(start + (uint64_t)(y * k->width + x)) >> 40) * 1e-5;
                extra = (extra + q->use_weight * txp_use_at(&q->use, x, y, size)) * unit;
                const double limit = best * tolerance - extra;
                if (limit < 0) continue;
                const uint32_t sad =
                    known ? txp_sad_known(q, a, m, txp_stack_at(s, k, x, y), (const int(*)[2])span,
                                          limit < 4e9 ? (uint32_t)limit : 4000000000u)
                          : 0;
                const double cost = sad + extra;
                if (cost > best * tolerance) continue;
                if (cost < best) {
                    best = cost;
                    int kept = 0;
                    for (int t = 0; t < count; t++) {
                        if (q->near_costs[t] > best * tolerance) continue;
                        q->near_costs[kept] = q->near_costs[t];
                        q->near_places[kept++] = q->near_places[t];
                    }
                    count = kept;
                }
                if (count < TXP_CANDIDATES) {
                    q->near_costs[count] = txm_float(cost);
                    q->near_places[count].x = x;
                    q->near_places[count++].y = y;
                }
            }
        }
    }
    if (!count) return 0;
    *found = q->near_places[txm_rng_below(&q->rng, (uint32_t)count)];
    return 1;
}

/* Copy the piece into the block, along minimum-error cuts through the overlaps. */
static void txp_quilt_lay(txp_quilt *q, int bx, int by, txp_place at) {
    const txp_source *s = q->source;
    const txp_canvas *c = &q->canvas;
    const int size = q->block, o = q->overlap, n = s->guide_at;
    int cut[4][4 * TXP_BLOCK], is_cut[4], seen[4] = {0, 0, 0, 0};
    for (int y = 0; y < size; y++) {
        const uint8_t *a = txp_canvas_at(s, c, bx, by + y);
        const uint8_t *b = txp_stack_at(s, q->stack, at.x, at.y + y);
        for (int x = 0; x < size; x++, a += s->bytes, b += s->bytes) {
            const size_t i = txp_index(c, txp_wrap(bx + x, c->width), txp_wrap(by + y, c->height));
            int e = 0;
            if (q->done[i]) {
                for (int b1 = 0; b1 < n; b1++) e += (a[b1] - b[b1]) * (a[b1] - b[b1]);
                if (x < o) seen[0]++;
                if (y < o) seen[1]++;
                if (x >= size - o) seen[2]++;
                if (y >= size - o) seen[3]++;
            }
            q->error[y * size + x] = (float)e;
        }
    }
    /* sides: left, top, right, bottom; cut[][line] is the first pixel of the new piece, or the
       last */
    for (int k = 0; k < 4; k++) {
        is_cut[k] = seen[k] * 4 > 3 * size * o;
        if (!is_cut[k]) continue;
        const float *e = q->error + (k == 2 ? size - o : k == 3 ? (size - o) * size : 0);
        q->cost += txm_cut(e, size, o, k % 2 ? 1 : size, k % 2 ? size : 1, cut[k], q->scratch);
    }
    for (int y = 0; y < size; y++) {
        for (int x = 0; x < size; x++) {
            const int cx = txp_wrap(bx + x, c->width), cy = txp_wrap(by + y, c->height);
            const size_t i = txp_index(c, cx, cy);
            if (c->fixed && c->fixed[i]) continue;
            if (q->done[i] && ((is_cut[0] && x < cut[0][y]) || (is_cut[1] && y < cut[1][x]) ||
                               (is_cut[2] && x - (size - o) > cut[2][y]) ||
                               (is_cut[3] && y - (size - o) > cut[3][x])))
                continue;
            txp_place p;
            p.x = at.x + x;
            p.y = at.y + y;
            uint32_t *use = q->use.count + p.y / TXP_CELL * q->use.columns + p.x / TXP_CELL;
            if (q->done[i]) {
                const txp_place old = c->at[i];
                if (old.x >= 0)
                    q->use.count[old.y / TXP_CELL * q->use.columns + old.x / TXP_CELL]--;
            }
            ++*use;
            txp_quilt_put(q, cx, cy, p);
        }
    }
}

/* The whole canvas in scan order (section 3.4 of [1], N = 2 D). */
static void txp_quilt_run(txp_quilt *q) {
    const txp_canvas *c = &q->canvas;
    const int size = q->block, step = size - q->overlap;
    const int wx = c->wrap & TEXPATCH_TILE_X, wy = c->wrap & TEXPATCH_TILE_Y;
    const int columns = wx ? (c->width + step - 1) / step : 1 + (c->width - size + step - 1) / step;
    const int rows = wy ? (c->height + step - 1) / step : 1 + (c->height - size + step - 1) / step;
    for (int j = 0; j < rows && !q->failed; j++) {
        int y = wy ? j * c->height / rows : j * step;
        if (!wy && y > c->height - size) y = c->height - size;
        for (int i = 0; i < columns && !q->failed; i++) {
            int x = wx ? i * c->width / columns : i * step;
            txp_place at;
            if (!wx && x > c->width - size) x = c->width - size;
            if (!txp_has_free_pixel(c, x, y, size)) continue;
            if (!txp_quilt_find(q, x, y, &at)) q->failed = 1;
            else txp_quilt_lay(q, x, y, at);
        }
    }
}

#endif /* TEXPATCH_QUILT_H */
