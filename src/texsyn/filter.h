#ifndef TEXSYN_FILTER_H
#define TEXSYN_FILTER_H

#include "potential.h"

/* ---- filters ------------------------------------------------------------------------------

   A filter's response at its tail is a sum over many pixels, so it is kept. A pixel that changes
   changes the responses at the tails of all filters that contain it.

   Neighbouring tails say nearly the same, so at a time only those of one parity (x & 1, y & 1) are
   considered, a quarter of all, and another quarter in the next sweep. Their responses form a plane
   of words with half the canvas's rows and columns, so TXS_GRID pixels are 64 bits there as well.

   The canvas's margin has responses too. Parities go on counting there, so on a torus of odd size a
   pixel and its copies have different tails, and all are kept up to date.                   */

typedef struct txs_filter {
    int type;           /* index in the level */
    uint16_t *response; /* plus TXS_MAX_RESPONSE */
    uint8_t class_of[2 * TXS_MAX_RESPONSE + 1];
} txs_filter;

/* A pixel of a filter that has its tail at (x - dx, y - dy). */
typedef struct txs_tap {
    int dx, dy, weight;
    ptrdiff_t tail; /* from (x, y) to the tail in the plane of responses */
    uint16_t *response;
    const uint8_t *table; /* row of the response -TXS_MAX_RESPONSE if the pixel is 0 */
} txs_tap;

enum {
    TXS_EDGE = 8, /* pixels around the canvas that have responses: even, as far as shapes reach */
    TXS_RESPONSE_GRID = TXS_GRID / 2,
    TXS_MAX_TAPS = 8 * TXS_MAX_FILTERS, /* at one pixel */
    TXS_RESPONSE_ROWS = 16              /* rows of responses computed by one task */
};

/* Rows for TXS_TOGETHER pixels at `now`, TXS_GRID apart, `tails` being their responses without the
   taps' own offsets: as txs_aim does it. */
typedef void txs_aim_taps(const txs_tap *taps, int count, const uint8_t *now, ptrdiff_t tails,
                            int pixels, const uint8_t **rows);

/* Add the changes of these pixels to the responses. */
typedef void txs_add_taps(const txs_tap *taps, int count, ptrdiff_t tails, int pixels,
                          const int *delta);

typedef struct txs_filters {
    const txs_canvas *canvas;
    const txs_level *level;
    int count, parity;
    int reach; /* of the filters along an axis; as much of the margin has copies that count */
    ptrdiff_t stride; /* responses in a row */
    int rows;
    txs_aim_taps *aim;
    txs_add_taps *add;
    txs_filter filter[TXS_MAX_FILTERS];
    txs_tap tap[TXS_MAX_BANDS][4][TXS_MAX_TAPS]; /* for pixels of each parity */
    int tap_count[TXS_MAX_BANDS][4];
} txs_filters;

static int txs_parity(int x, int y) {
    return (x & 1) + 2 * (y & 1);
}

/* Pixel (x, y) in the plane of responses, which begins at (-TXS_EDGE, -TXS_EDGE). */
static ptrdiff_t txs_response_index(const txs_filters *f, int x, int y) {
    return ((y + TXS_EDGE) >> 1) * f->stride + ((x + TXS_EDGE) >> 1);
}

/* The smallest rectangle around the pixels of a shape, the tail included: x0, y0, x1, y1. */
static void txs_shape_box(int at[TXS_MAX_MEMBERS][2], int count, int box[4]) {
    memset(box, 0, 4 * sizeof *box);
    for (int i = 0; i < count; i++) {
        for (int k = 0; k < 2; k++) {
            if (at[i][k] < box[k]) box[k] = at[i][k];
            if (at[i][k] > box[k + 2]) box[k + 2] = at[i][k];
        }
    }
}

/* One row of the responses of filter k, of all tails whose pixels lie on the canvas. */
static void txs_filters_row(const txs_filters *f, int k, int y) {
    const txs_canvas *c = f->canvas;
    const txs_type *t = &f->level->types[f->filter[k].type];
    int at[TXS_MAX_MEMBERS][2], weight[TXS_MAX_MEMBERS], box[4];
    const int n = txs_shape_pixels(t->shape, at, weight), m = c->margin;
    txs_shape_box(at, n, box);
    if (y + box[1] < -m || y + box[3] >= c->height + m) return;
    int x0 = -(m + box[0] < TXS_EDGE ? m + box[0] : (int)TXS_EDGE);
    const int x1 = c->width + (m - box[2] < TXS_EDGE ? m - box[2] : (int)TXS_EDGE);
    x0 += (x0 ^ f->parity) & 1;
    if (x1 <= x0) return;
    const int count = (x1 - x0 + 1) / 2;
    uint16_t *row = f->filter[k].response + txs_response_index(f, x0, y);
    for (int i = 0; i < count; i++) row[i] = TXS_MAX_RESPONSE;
    for (int j = 0; j < n; j++) {
        const uint8_t *p = txs_at(c, t->band, x0 + at[j][0], y + at[j][1]);
        if (weight[j] > 0)
            for (int i = 0; i < count; i++) row[i] = (uint16_t)(row[i] + p[2 * i]);
        else
            for (int i = 0; i < count; i++) row[i] = (uint16_t)(row[i] - p[2 * i]);
    }
}

static void txs_filters_rows(void *context, int share) {
    const txs_filters *f = (const txs_filters *)context;
    for (int i = share * TXS_RESPONSE_ROWS; i < (share + 1) * TXS_RESPONSE_ROWS && i < f->rows; i++)
        for (int k = 0; k < f->count; k++)
            txs_filters_row(f, k, 2 * i - TXS_EDGE + (f->parity >> 1));
}

/* Consider the tails of another parity. */
static void txs_filters_turn(txs_filters *f, txm_env *env, int parity, const uint8_t *tables) {
    f->parity = parity;
    memset(f->tap_count, 0, sizeof f->tap_count);
    for (int k = 0; k < f->count; k++) {
        const txs_type *t = &f->level->types[f->filter[k].type];
        int at[TXS_MAX_MEMBERS][2], weight[TXS_MAX_MEMBERS];
        const int n = txs_shape_pixels(t->shape, at, weight);
        const uint8_t *table = tables + (size_t)f->filter[k].type * TXS_TABLE + TXS_VALUES - 1;
        for (int i = 0; i < n; i++) {
            const int own = txs_parity(at[i][0], at[i][1]) ^ parity;
            int *count = &f->tap_count[t->band][own];
            if (*count == TXS_MAX_TAPS) continue; /* cannot be: see txs_shape_ends */
            txs_tap *tap = &f->tap[t->band][own][(*count)++];
            tap->dx = at[i][0];
            tap->dy = at[i][1];
            tap->weight = weight[i];
            tap->response = f->filter[k].response;
            tap->table = table + (weight[i] < 0 ? TXS_RESPONSE_ROW + 2 * TXS_MAX_RESPONSE : 0);
            /* a halved coordinate loses its parity, so these are even */
            tap->tail = ((own >> 1) - (parity >> 1) - at[i][1]) / 2 * f->stride +
                        ((own & 1) - (parity & 1) - at[i][0]) / 2;
        }
    }
    if (f->count)
        txm_parallel_for(env, (f->rows + TXS_RESPONSE_ROWS - 1) / TXS_RESPONSE_ROWS,
                         txs_filters_rows, f);
}

static void txs_aim_taps_plain(const txs_tap *taps, int count, const uint8_t *now,
                                 ptrdiff_t tails, int pixels, const uint8_t **rows) {
    for (int k = 0; k < count; k++, rows += TXS_TOGETHER) {
        const uint16_t *r = taps[k].response + taps[k].tail + tails;
        for (int i = 0; i < pixels; i++)
            rows[i] = taps[k].table + taps[k].weight * r[i * TXS_RESPONSE_GRID] - now[i * TXS_GRID];
    }
}

static void txs_add_taps_plain(const txs_tap *taps, int count, ptrdiff_t tails, int pixels,
                               const int *delta) {
    for (int k = 0; k < count; k++) {
        uint16_t *r = taps[k].response + taps[k].tail + tails;
        for (int i = 0; i < pixels; i++, r += TXS_RESPONSE_GRID)
            *r = (uint16_t)(*r + taps[k].weight * delta[i]);
    }
}

#ifdef TXS_LANES
enum { /* from the first pixel of a batch to the second half of it */
    TXS_HALF_PIXELS = TXS_TOGETHER / 2 * TXS_GRID,
    TXS_HALF_RESPONSES = TXS_HALF_PIXELS / 2
};

TXS_FOR_AVX2 void txs_aim_taps_avx2(const txs_tap *taps, int count, const uint8_t *now,
                                      ptrdiff_t tails, int pixels, const uint8_t **rows) {
    const __m256i byte = _mm256_set1_epi64x(255), word = _mm256_set1_epi64x(65535);
    if (pixels < TXS_TOGETHER) {
        txs_aim_taps_plain(taps, count, now, tails, pixels, rows);
        return;
    }
    const __m256i first = _mm256_and_si256(TXS_LOAD4(now), byte);
    const __m256i last = _mm256_and_si256(TXS_LOAD4(now + TXS_HALF_PIXELS), byte);
    for (int k = 0; k < count; k++, rows += TXS_TOGETHER) {
        const uint16_t *r = taps[k].response + taps[k].tail + tails;
        const __m256i table = _mm256_set1_epi64x((long long)(intptr_t)taps[k].table);
        const __m256i a = _mm256_and_si256(TXS_LOAD4(r), word);
        const __m256i b = _mm256_and_si256(TXS_LOAD4(r + TXS_HALF_RESPONSES), word);
        __m256i u = _mm256_sub_epi64(table, first), v = _mm256_sub_epi64(table, last);
        if (taps[k].weight > 0) {
            u = _mm256_add_epi64(u, a);
            v = _mm256_add_epi64(v, b);
        } else {
            u = _mm256_sub_epi64(u, a);
            v = _mm256_sub_epi64(v, b);
        }
        _mm256_storeu_si256((__m256i *)(void *)rows, u);
        _mm256_storeu_si256((__m256i *)(void *)(rows + TXS_TOGETHER / 2), v);
    }
}

/* The other words of a lane are responses that stay as they are: another pixel's change is added to
   them by the same thread, before or after. */
TXS_FOR_AVX2 void txs_add_taps_avx2(const txs_tap *taps, int count, ptrdiff_t tails, int pixels,
                                    const int *delta) {
    if (pixels < TXS_TOGETHER) {
        txs_add_taps_plain(taps, count, tails, pixels, delta);
        return;
    }
    const __m256i word = _mm256_set1_epi64x(65535);
    const __m256i d = _mm256_loadu_si256((const __m256i *)(const void *)delta);
    const __m256i a = _mm256_and_si256(_mm256_cvtepi32_epi64(_mm256_castsi256_si128(d)), word);
    const __m256i b = _mm256_and_si256(_mm256_cvtepi32_epi64(_mm256_extracti128_si256(d, 1)), word);
    for (int k = 0; k < count; k++) {
        uint16_t *r = taps[k].response + taps[k].tail + tails;
        uint16_t *q = r + TXS_HALF_RESPONSES;
        const __m256i u = TXS_LOAD4(r), v = TXS_LOAD4(q);
        const int plus = taps[k].weight > 0;
        _mm256_storeu_si256((__m256i *)(void *)r,
                            plus ? _mm256_add_epi16(u, a) : _mm256_sub_epi16(u, a));
        _mm256_storeu_si256((__m256i *)(void *)q,
                            plus ? _mm256_add_epi16(v, b) : _mm256_sub_epi16(v, b));
    }
}
#endif

/* Rows of the filters' ends at pixels (x, y), (x + TXS_GRID, y), ... of a band; returns how many. */
static int txs_filters_aim(const txs_filters *f, int band, int x, int y, int pixels,
                             const uint8_t **rows) {
    const int own = txs_parity(x, y), count = f->tap_count[band][own];
    if (count)
        f->aim(f->tap[band][own], count, txs_at(f->canvas, band, x, y),
                 txs_response_index(f, x, y), pixels, rows);
    return count;
}

/* Pixel (x, y) of a band and its copies in the margin have changed by delta. */
static void txs_filters_change_one(const txs_filters *f, int band, int x, int y, int delta) {
    const int w = f->canvas->width, h = f->canvas->height, reach = f->reach;
    for (int yy = y - (y + reach) / h * h; yy < h + reach; yy += h) {
        for (int xx = x - (x + reach) / w * w; xx < w + reach; xx += w) {
            const int own = txs_parity(xx, yy);
            const txs_tap *t = f->tap[band][own], *stop = t + f->tap_count[band][own];
            for (; t < stop; t++) {
                const int tx = xx - t->dx, ty = yy - t->dy;
                if (tx >= -TXS_EDGE && tx < w + TXS_EDGE && ty >= -TXS_EDGE && ty < h + TXS_EDGE)
                    txs_add_taps_plain(t, 1, txs_response_index(f, xx, yy), 1, &delta);
            }
        }
    }
}

/* Pixels (x, y), (x + TXS_GRID, y), ... of a band have changed by delta[]. */
static void txs_filters_change(const txs_filters *f, int band, int x, int y, int pixels,
                               const int *delta) {
    const int own = txs_parity(x, y), reach = f->reach;
    if (f->count == 0) return;
    if (y >= reach && y < f->canvas->height - reach && x >= reach &&
        x + (pixels - 1) * TXS_GRID < f->canvas->width - reach) /* no copies */
        f->add(f->tap[band][own], f->tap_count[band][own], txs_response_index(f, x, y), pixels,
               delta);
    else
        for (int i = 0; i < pixels; i++)
            if (delta[i]) txs_filters_change_one(f, band, x + i * TXS_GRID, y, delta[i]);
}

/* Count the filters whose tail is (x, y). */
static void txs_filters_count(const txs_filters *f, int x, int y, int32_t (*counts)[TXS_BINS]) {
    if (txs_parity(x, y) != f->parity) return;
    const ptrdiff_t at = txs_response_index(f, x, y);
    for (int k = 0; k < f->count; k++) {
        const txs_filter *filter = &f->filter[k];
        counts[filter->type][filter->class_of[filter->response[at]]]++;
    }
}

/* Take the filters among the level's types; there must be as many planes. */
static void txs_filters_find(txs_filters *f) {
    f->count = f->reach = 0;
    for (int k = 0; k < f->level->type_count; k++) {
        const txs_type *t = &f->level->types[k];
        if (t->kind != TEXSYN_FILTER || f->count == TXS_MAX_FILTERS) continue;
        txs_filter *filter = &f->filter[f->count++];
        filter->type = k;
        txs_response_classes(t->scale, filter->class_of);
        if (txs_reach(t) > f->reach) f->reach = txs_reach(t);
    }
}

/* Planes for so many filters; sets arena->failed if there is no memory. */
static void txs_filters_make(txs_filters *f, txm_arena *arena, const txs_level *level,
                             const txs_canvas *canvas, int count) {
    enum { ROUND = 2, LANE = TXS_RESPONSE_GRID }; /* lanes reach so far beyond the last response */
    const size_t stride = ((size_t)canvas->width + 2 * TXS_EDGE + 1) / ROUND;
    const size_t rows = ((size_t)canvas->height + 2 * TXS_EDGE + 1) / ROUND;
    f->canvas = canvas;
    f->level = level;
    f->stride = (ptrdiff_t)stride;
    f->rows = (int)rows;
    f->aim = txs_aim_taps_plain;
    f->add = txs_add_taps_plain;
#ifdef TXS_LANES
    if (__builtin_cpu_supports("avx2")) {
        f->aim = txs_aim_taps_avx2;
        f->add = txs_add_taps_avx2;
    }
#endif
    for (int k = 0; k < count && k < TXS_MAX_FILTERS; k++)
        f->filter[k].response =
            (uint16_t *)txm_arena_zero(arena, stride * rows + LANE, sizeof(uint16_t));
}

#endif /* TEXSYN_FILTER_H */
