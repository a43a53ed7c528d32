#ifndef TEXINPAINT_DETAIL_H
#define TEXINPAINT_DETAIL_H

#include "picture.h"

/* ---- detail: how rough the texture is, and is expected to be ------------------------------------

   In noise of variance v, a patch differs from a smooth one by v per pixel and from another rough
   one by 2 v. So distances alone prefer smooth patches, and grain is smeared. Therefore patches
   with less detail than expected pay the difference. The detail of a pixel is

       e(p) = min(clamp, sum over RGB of (p - mean of the usable pixels of 5x5)^2),

   that of a patch the sum over its pixels. The expected one is the mean of its logarithm over the
   known patches around, less a multiple of the standard deviation.                             */

enum {
    TXI_DETAIL_RADIUS = 2,  /* pixels: of the mean                                             */
    TXI_DETAIL_BINS = 4096, /* of the histogram                                                */
    TXI_REACHES = 7,        /* radii that the expectation is collected in                      */
    TXI_WORTH_MOST = 65535, /* detail of a patch whose pixels all have the level's clamp        */
    TXI_WANT_FLOOR = 64     /* added to the detail of a patch under the logarithm              */
};

/* e of each usable pixel, 0 of others, not clamped.
   columns  room for 4 * width numbers                                                         */
static void txi_detail(const uint8_t *color, const uint8_t *usable, int width, int height,
                       int32_t *columns, uint32_t *e) {
    const int r = TXI_DETAIL_RADIUS;
    const size_t w = (size_t)width;
    memset(columns, 0, 4 * w * sizeof *columns);
    for (int y = -r; y < height; y++) {
        for (int side = 0; side < 2; side++) { /* a row enters the sums, another one leaves them */
            const int row = side ? y - r - 1 : y + r;
            if (row < 0 || row >= height) continue;
            const int sign = side ? -1 : 1;
            for (size_t x = 0; x < w; x++) {
                const size_t p = (size_t)row * w + x;
                if (!usable[p]) continue;
                for (size_t c = 0; c < 3; c++) columns[4 * x + c] += sign * color[4 * p + c];
                columns[4 * x + 3] += sign;
            }
        }
        if (y < 0) continue;
        int32_t sum[4] = {0, 0, 0, 0};
        for (int x = -r; x < width; x++) {
            for (int c = 0; c < 4; c++) {
                if (x + r < width) sum[c] += columns[4 * (x + r) + c];
                if (x - r - 1 >= 0) sum[c] -= columns[4 * (x - r - 1) + c];
            }
            if (x < 0) continue;
            const size_t p = (size_t)y * w + (size_t)x;
            e[p] = 0;
            if (!usable[p]) continue;
            const int32_t n = sum[3];
            uint32_t total = 0;
            for (size_t c = 0; c < 3; c++) {
                const int32_t d = color[4 * p + c] * n - sum[c];
                total += (uint32_t)(d * d);
            }
            e[p] = total / (uint32_t)(n * n);
        }
    }
}

/* Sums over the 8x8 pixels right of and below each pixel, those beyond the raster being 0.
   columns  room for width numbers                                                             */
static void txi_patch_sums(const uint32_t *value, int width, int height, uint32_t *columns,
                           uint32_t *sums) {
    const size_t w = (size_t)width;
    memset(columns, 0, w * sizeof *columns);
    for (int y = height - 1; y >= 0; y--) {
        uint32_t sum = 0;
        for (size_t x = 0; x < w; x++) {
            columns[x] += value[(size_t)y * w + x];
            if (y + TXI_PATCH < height) columns[x] -= value[(size_t)(y + TXI_PATCH) * w + x];
        }
        for (int x = width - 1; x >= 0; x--) {
            sum += columns[x];
            if (x + TXI_PATCH < width) sum -= columns[x + TXI_PATCH];
            sums[(size_t)y * w + (size_t)x] = sum;
        }
    }
}

/* Median and mean of the detail of the known pixels; sets grain and clamp of the level.
   strength  the clamp is its square times (median + 2)                                        */
static void txi_detail_clamp(txi_level *l, const uint32_t *e, float strength, uint32_t *bins) {
    const int n = l->width * l->height;
    uint32_t known = 0, below = 0, median = 0;
    double sum = 0;
    memset(bins, 0, TXI_DETAIL_BINS * sizeof *bins);
    for (int p = 0; p < n; p++) {
        if (l->state[p] != TXI_KNOWN) continue;
        known++;
        sum += e[p];
        bins[e[p] < TXI_DETAIL_BINS ? e[p] : TXI_DETAIL_BINS - 1]++;
    }
    while (median < TXI_DETAIL_BINS - 1 && (below += bins[median]) * 2 < known) median++;
    l->grain = known ? (median + 0.5) / (sum / known + 0.5) : 0;
    const double most = (double)strength * strength * (median + 2.0);
    l->clamp = (uint32_t)(most < 16 ? 16 : most > 195075 ? 195075 : most);
}

/* a box filter along one direction of a grid, of values step apart, in place */
static void txi_box_line(float *v, int count, size_t step, int radius, float *copy) {
    double sum = 0;
    for (int i = 0; i < count; i++) copy[i] = v[(size_t)i * step];
    for (int i = -radius; i < count; i++) {
        if (i + radius < count) sum += copy[i + radius];
        if (i - radius - 1 >= 0) sum -= copy[i - radius - 1];
        if (i >= 0) v[(size_t)i * step] = txm_float(sum / (2 * radius + 1));
    }
}

/* The expectation is collected on a coarser grid: weight, mean and mean square of the logarithms
   of known patches. */
typedef struct txi_wish {
    int width, height, step; /* cells; pixels per cell                                         */
    float *weight, *first, *second; /* of the known patches                                    */
    float *blur[3]; /* the same, filtered                                             */
    float *copy;
    float *result; /* expected detail; below 0: not yet                              */
} txi_wish;

static void txi_wish_reach(txi_wish *g, int radius, float offset) {
    const size_t w = (size_t)g->width, n = w * (size_t)g->height;
    float *from[3];
    from[0] = g->weight;
    from[1] = g->first;
    from[2] = g->second;
    for (int k = 0; k < 3; k++) {
        memcpy(g->blur[k], from[k], n * sizeof(float));
        for (int pass = 0; pass < 2; pass++) {
            for (int y = 0; y < g->height; y++)
                txi_box_line(g->blur[k] + (size_t)y * w, g->width, 1, radius, g->copy);
            for (int x = 0; x < g->width; x++)
                txi_box_line(g->blur[k] + x, g->height, w, radius, g->copy);
        }
    }
    for (size_t i = 0; i < n; i++) {
        if (g->result[i] >= 0 || g->blur[0][i] < 0.12f) continue;
        const double mean = (double)g->blur[1][i] / g->blur[0][i];
        const double square = (double)g->blur[2][i] / g->blur[0][i] - mean * mean;
        const double level = exp(mean - (double)offset * sqrt(square > 0 ? square : 0));
        g->result[i] =
            txm_float(level > (double)TXI_WANT_FLOOR ? level - (double)TXI_WANT_FLOOR : 0);
    }
}

/* The expected detail of all anchors. sums: detail of all patches (void and hole: 0).
   offset  standard deviations below the mean                                                  */
static int txi_level_want(txi_level *l, const uint32_t *sums, float offset, txm_arena *scratch) {
    txi_wish g;
    memset(&g, 0, sizeof g);
    g.step = l->width * l->height > 100000 ? 4 : 2;
    g.width = (l->width + g.step - 1) / g.step;
    g.height = (l->height + g.step - 1) / g.step;
    const size_t n = (size_t)g.width * (size_t)g.height;
    const int longer = g.width > g.height ? g.width : g.height;
    float *block = (float *)txm_arena_zero(scratch, n, 7 * sizeof(float));
    g.copy = (float *)txm_arena_alloc(scratch, (size_t)longer, sizeof(float));
    if (scratch->failed) return 0;
    g.weight = block;
    g.first = block + n;
    g.second = block + 2 * n;
    for (size_t k = 0; k < 3; k++) g.blur[k] = block + (3 + k) * n;
    g.result = block + 6 * n;
    for (size_t i = 0; i < n; i++) {
        const int x = (int)(i % (size_t)g.width) * g.step, y = (int)(i / (size_t)g.width) * g.step;
        const int p = y * l->width + x;
        g.result[i] = -1;
        if (x > l->width - TXI_PATCH || y > l->height - TXI_PATCH || l->slot[p] >= 0) continue;
        int known = 1;
        for (int k = 0; known && k < TXI_PATCH_AREA; k++)
            known = l->state[p + k / TXI_PATCH * l->width + k % TXI_PATCH] != TXI_VOID;
        if (!known) continue;
        const double value = log((double)sums[p] + (double)TXI_WANT_FLOOR);
        g.weight[i] = 1;
        g.first[i] = txm_float(value);
        g.second[i] = txm_float(value * value);
    }
    double radius = 4;
    for (int i = 0; i < TXI_REACHES; i++, radius *= 1.8)
        txi_wish_reach(&g, (int)(radius / g.step + 0.5), offset);
    for (int a = 0; a < l->anchor_count; a++) {
        const int x = l->anchor[a] % l->width / g.step, y = l->anchor[a] / l->width / g.step;
        const float r = g.result[(size_t)y * (size_t)g.width + (size_t)x];
        l->want[a] =
            r > 0
                ? (uint32_t)((double)r * (double)TXI_WORTH_MOST / (double)TXI_PATCH_AREA / l->clamp)
                : 0;
    }
    return 1;
}

/* Detail of a level: grain, clamp and the expectation of its anchors. want_it 0: the first two
   only. */
static int txi_level_detail(txi_level *l, float clamp, float offset, int want_it,
                            txm_arena *scratch) {
    const size_t n = (size_t)l->width * (size_t)l->height;
    uint8_t *usable = (uint8_t *)txm_arena_alloc(scratch, n, 1);
    uint32_t *e = (uint32_t *)txm_arena_alloc(scratch, n, 2 * sizeof(uint32_t));
    int32_t *columns = (int32_t *)txm_arena_alloc(scratch, (size_t)l->width, 4 * sizeof(int32_t));
    uint32_t *bins = (uint32_t *)txm_arena_alloc(scratch, TXI_DETAIL_BINS, sizeof(uint32_t));
    if (scratch->failed) return 0;
    for (size_t p = 0; p < n; p++)
        usable[p] = l->state[p] == TXI_KNOWN || l->state[p] == TXI_FOREIGN;
    txi_detail(l->color, usable, l->width, l->height, columns, e);
    txi_detail_clamp(l, e, clamp, bins);
    if (!want_it) return 1;
    for (size_t p = 0; p < n; p++) {
        if (e[p] > l->clamp) e[p] = l->clamp;
    }
    txi_patch_sums(e, l->width, l->height, (uint32_t *)(void *)columns, e + n);
    return txi_level_want(l, e + n, offset, scratch);
}

#endif /* TEXINPAINT_DETAIL_H */
