#ifndef TEXINPAINT_RASTER_H
#define TEXINPAINT_RASTER_H

#include "config.h"

/* ---- places in a window -------------------------------------------------------------------- */

static inline txm_vec2 txi_between(txm_vec2 a, txm_vec2 b, double t) {
    return txm_v2(txm_float(a.x + t * ((double)b.x - a.x)), txm_float(a.y + t * ((double)b.y - a.y)));
}

static inline double txi_distance(txm_vec2 a, txm_vec2 b) {
    const double x = (double)a.x - b.x, y = (double)a.y - b.y;
    return sqrt(x * x + y * y);
}

static inline txm_vec2 txi_unit(double x, double y) {
    const double n = sqrt(x * x + y * y);
    return n > 0 ? txm_v2(txm_float(x / n), txm_float(y / n)) : txm_v2(1, 0);
}

/* The pixel of a place, or -1 outside of the window. */
static inline ptrdiff_t txi_pixel(int width, int height, double x, double y) {
    if (!(x > -0.5 && y > -0.5 && x < width - 0.5 && y < height - 0.5)) return -1;
    const int column = (int)floor(x + 0.5), row = (int)floor(y + 0.5);
    return (ptrdiff_t)row * width + column;
}

/* ---- distances --------------------------------------------------------------------------- */

enum { TXI_FAR = 1 << 28 }; /* squared distance to nothing                                       */

/* Squared Euclidean distances: out[i] = least |i - j|^2 over all pixels j with of[j] != 0, exact, in
   integers; TXI_FAR if there is none. Columns first, then the lower envelope of parabolas along each
   row (Meijster, Roerdink, Hesselink 2000).
   scratch  3 * max(width, height) numbers
   cost     O(width * height)                                                                     */
static void txi_distances(const uint8_t *of, int width, int height, int32_t *scratch, int32_t *out) {
    int32_t *row = scratch, *hull = row + width, *from = hull + width;
    const int beyond = 16384; /* pixels; its square is TXI_FAR                                    */
    for (int x = 0; x < width; x++) {
        for (int pass = 0; pass < 2; pass++) {
            int d = beyond;
            for (int k = 0; k < height; k++) {
                const size_t i = (size_t)(pass ? height - 1 - k : k) * (size_t)width + (size_t)x;
                d = of[i] ? 0 : d < beyond ? d + 1 : beyond;
                if (!pass || d < out[i]) out[i] = d;
            }
        }
    }
    for (int y = 0; y < height; y++) {
        int32_t *o = out + (size_t)y * (size_t)width;
        int top = 0;
        for (int x = 0; x < width; x++) row[x] = o[x] >= beyond ? TXI_FAR : o[x] * o[x];
        hull[0] = from[0] = 0;
        for (int x = 1; x < width; x++) {
            /* the parabola of x is the lowest from here on, compared with that on top of the hull */
            for (; top >= 0; top--) {
                const int h = hull[top], t = from[top];
                if ((int64_t)(t - h) * (t - h) + row[h] <= (int64_t)(t - x) * (t - x) + row[x]) break;
            }
            if (top < 0) {
                top = 0;
                hull[0] = x;
                from[0] = 0;
                continue;
            }
            const int64_t h = hull[top];
            const int64_t up = (int64_t)x * x - h * h + row[x] - row[h], down = 2 * (x - h);
            const int64_t at = up >= 0 ? up / down + 1 : -((-up - 1) / down);
            if (at < width) {
                hull[++top] = x;
                from[top] = (int32_t)at;
            }
        }
        for (int x = width - 1; x >= 0; x--) {
            const int h = hull[top];
            const int64_t d = (int64_t)(x - h) * (x - h) + row[h];
            o[x] = d < TXI_FAR ? (int32_t)d : TXI_FAR;
            if (x == from[top] && top > 0) top--;
        }
    }
}

/* The nearest texel with a mark, of equally near ones the first in its row, then the upper one.

   First the nearest mark in each column; then along each row the lower envelope of the parabolas
   (x - i)^2 + dy(i)^2: those of the columns that come first somewhere are kept on a stack.

   nearest  receives one texel number for each, -1 without any marks
   cost     O(width * height); 4 bytes for each texel of a row and each row               */
static txm_status txi_nearest(const uint8_t *marks, int width, int height, txm_env *env,
                              int32_t *nearest) {
    txm_arena scratch;
    const size_t w = (size_t)width;
    txm_arena_init(&scratch, env);
    int32_t *row = (int32_t *)txm_arena_alloc(&scratch, w, sizeof(int32_t)); /* row of the mark */
    int *stack = (int *)txm_arena_alloc(&scratch, w, sizeof(int));
    int *from = (int *)txm_arena_alloc(&scratch, w, sizeof(int)); /* where each becomes nearest  */
    if (scratch.failed) {
        txm_arena_free(&scratch);
        return txi_no_memory(env);
    }
    for (int x = 0; x < width; x++) {
        int32_t last = -1;
        for (int y = 0; y < height; y++) {
            if (marks[(size_t)y * w + (size_t)x]) last = y;
            nearest[(size_t)y * w + (size_t)x] = last;
        }
        last = -1;
        for (int y = height - 1; y >= 0; y--) {
            int32_t *n = &nearest[(size_t)y * w + (size_t)x];
            if (marks[(size_t)y * w + (size_t)x]) last = y;
            if (last >= 0 && (*n < 0 || last - y < y - *n)) *n = last;
        }
    }
    for (int y = 0; y < height; y++) {
        int count = 0;
        memcpy(row, nearest + (size_t)y * w, w * sizeof *row);
        for (int x = 0; x < width; x++) {
            const int64_t dy = row[x] - y;
            if (row[x] < 0) continue;
            int begin = 0;
            while (count > 0) { /* first place at which x is nearer than the top of the stack */
                const int i = stack[count - 1];
                const int64_t di = row[i] - y;
                const int64_t sum = (int64_t)x * x + dy * dy - (int64_t)i * i - di * di;
                const int64_t place = sum < 0 ? 0 : sum / (2 * (int64_t)(x - i)) + 1;
                if (place > from[count - 1]) {
                    begin = place < width ? (int)place : width;
                    break;
                }
                count--;
            }
            if (begin >= width) continue;
            stack[count] = x;
            from[count++] = begin;
        }
        for (int x = 0, k = 0; x < width; x++) {
            while (k + 1 < count && from[k + 1] <= x) k++;
            nearest[(size_t)y * w + (size_t)x] =
                count ? (int32_t)((size_t)row[stack[k]] * w + (size_t)stack[k]) : -1;
        }
    }
    txm_arena_free(&scratch);
    return TXM_OK;
}

#endif /* TEXINPAINT_RASTER_H */
