#ifndef TEXINPAINT_RASTER_H
#define TEXINPAINT_RASTER_H

#include "config.h"

/* ---- rasters: places -------------------------------------------------------------------- */

/* a (1 - t) + b t */
static inline txm_vec2 txi_between(txm_vec2 a, txm_vec2 b, double t) {
    return txm_v2(txm_float(a.x + t * ((double)b.x - a.x)),
                  txm_float(a.y + t * ((double)b.y - a.y)));
}

static inline double txi_distance(txm_vec2 a, txm_vec2 b) {
    const double x = (double)a.x - b.x, y = (double)a.y - b.y;
    return sqrt(x * x + y * y);
}

/* unit length in the same direction; (1, 0) for the zero vector */
static inline txm_vec2 txi_unit(double x, double y) {
    const double n = sqrt(x * x + y * y);
    return n > 0 ? txm_v2(txm_float(x / n), txm_float(y / n)) : txm_v2(1, 0);
}

/* The number of the pixel nearest to a place (pixel centres are whole numbers), -1 outside. */
static inline ptrdiff_t txi_pixel(int width, int height, double x, double y) {
    if (!(x > -0.5 && y > -0.5 && x < width - 0.5 && y < height - 0.5)) return -1;
    const int column = (int)floor(x + 0.5), row = (int)floor(y + 0.5);
    return (ptrdiff_t)row * width + column;
}

/* The weights of Catmull-Rom interpolation at t = 0..1 between the middle two of four samples. */
static void txi_cubic(double t, double weights[4]) {
    weights[0] = 0.5 * t * (t * (2 - t) - 1);
    weights[1] = 0.5 * (t * t * (3 * t - 5) + 2);
    weights[2] = 0.5 * t * (t * (4 - 3 * t) + 1);
    weights[3] = 0.5 * t * t * (t - 1);
}

/* ---- rasters: distances ---------------------------------------------------------------------- */

/* The nearest pixel with a mark, of equally near ones the first in its row, then the upper one.

   First the nearest mark in each column; then along each row the lower envelope of the parabolas
   (x - i)^2 + dy(i)^2 (Meijster, Roerdink, Hesselink 2000): those of the columns that are lowest
   somewhere are kept on a stack. Exact, in integers.

   scratch  3 * width numbers
   nearest  receives one pixel number for each, -1 without any marks
   cost     O(width * height)                                                                  */
static void txi_nearest_marks(const uint8_t *marks, int width, int height, int32_t *scratch,
                              int32_t *nearest) {
    const size_t w = (size_t)width;
    int32_t *row = scratch;      /* of the nearest mark in each column              */
    int32_t *stack = row + w;    /* columns                                         */
    int32_t *from = stack + w;   /* where each of these becomes the nearest          */
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
            TXM_ASSERT(count < width);
            stack[count] = x;
            from[count++] = begin;
        }
        for (int x = 0, k = 0; x < width; x++) {
            while (k + 1 < count && from[k + 1] <= x) k++;
            nearest[(size_t)y * w + (size_t)x] =
                count ? (int32_t)((size_t)row[stack[k]] * w + (size_t)stack[k]) : -1;
        }
    }
}

/* The same, with scratch memory of its own. */
static txm_status txi_nearest(const uint8_t *marks, int width, int height, txm_env *env,
                              int32_t *nearest) {
    txm_arena arena;
    txm_arena_init(&arena, env);
    int32_t *scratch = (int32_t *)txm_arena_alloc(&arena, (size_t)width, 3 * sizeof(int32_t));
    if (scratch) txi_nearest_marks(marks, width, height, scratch, nearest);
    txm_arena_free(&arena);
    return scratch ? TXM_OK : txi_no_memory(env);
}

enum { TXI_FAR = 1 << 28 }; /* squared distance, in pixels, to nothing */

/* Squared Euclidean distances: out[i] = least |i - j|^2 over all pixels j with of[j] != 0, in
   integers; TXI_FAR if there is none, or if it is more.
   scratch  3 * width numbers                                                                  */
static void txi_distances(const uint8_t *of, int width, int height, int32_t *scratch,
                          int32_t *out) {
    txi_nearest_marks(of, width, height, scratch, out);
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            int32_t *at = &out[(size_t)y * (size_t)width + (size_t)x];
            const int64_t dx = *at % width - x, dy = *at / width - y;
            const int64_t most = TXI_FAR, d = *at < 0 ? most : dx * dx + dy * dy;
            *at = (int32_t)(d < most ? d : most);
        }
    }
}

#endif /* TEXINPAINT_RASTER_H */
