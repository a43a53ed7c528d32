#ifndef TEXINPAINT_PICTURE_H
#define TEXINPAINT_PICTURE_H

#include "config.h"

#if defined(__SSE2__) && !defined(TEXINPAINT_NO_SIMD)
#include <emmintrin.h>
#define TXI_SSE2 1
#endif

/* ---- levels of a window -------------------------------------------------------------------- */

enum {
    TXI_PATCH = 8, /* pixels: side of the square patches that are compared               */
    TXI_PATCH_AREA = TXI_PATCH * TXI_PATCH,
    TXI_EDGE = 8, /* pixels of void around each level, so that all patches lie inside   */
    TXI_MAX_LEVELS = 8,
    TXI_MAX_POSES = 16,
    TXI_LEAST_PATCHES = 48, /* source patches that a coarse level must have; ours              */
    TXI_LEAST_FILLED = 24   /* pixels that are not void in a patch to be matched; ours         */
};

/* How a pixel may be copied: not; by itself; interpolated with its neighbour to the right, below
   and below right; by four pixels a direction. */
enum { TXI_TAP_NONE = 0, TXI_TAP_ONE, TXI_TAP_LINEAR, TXI_TAP_CUBIC };

/* A window at one level in one pose: what patches are copied from. Its pixel (i, j) is the level's
   pixel (x + a i + c j, y + b i + d j), in units of 2^-16 pixels, so that all of it is integers. */
typedef struct txi_source {
    int width, height;
    int32_t x, y, a, b, c, d;
    uint8_t *color;  /* 4 per pixel; NULL: not made                                            */
    uint8_t *usable; /* 1 where there is colour                                                */
    uint16_t *worth; /* of the patch whose upper left corner the pixel is: 0 = not all of it may be
                        copied, else 1 + its detail, see detail.h                              */
} txi_source;

/* A window at half, a quarter, ... of its resolution. Pixel (x, y) of level l has its centre at
   ((x + 1/2) 2^l - 1/2, ...) in the window. All arrays are rasters of width * height pixels with
   TXI_EDGE pixels of void on all sides, or lists of numbers of pixels in these. */
typedef struct txi_level {
    int width, height;
    uint8_t *state; /* TXI_VOID .. TXI_FOREIGN                                            */
    uint8_t *color; /* 4 per pixel; 0 where there is nothing known. The fourth is the guide */
    uint8_t *mask;  /* 4 per pixel: 255 where the pixel is not void                       */
    uint8_t *taps;  /* how the pixel and those right of and below it may be copied: TXI_TAP_ */
    uint8_t *guide; /* the plan's guide, strips and their pull, at this level; see fill.h  */
    uint8_t *strip, *pull;
    uint8_t *depth; /* of hole pixels: pixels to the nearest known one, at most 255       */
    int32_t *hole;  /* the hole's pixels                                                  */
    int hole_count;
    int32_t *hole_row; /* height + 1: the first of them in each row                          */
    int32_t *anchor;   /* upper left corners of the patches that touch the hole              */
    int anchor_count;
    int32_t *anchor_row; /* height + 1                                                         */
    int32_t *slot;       /* the pixel's number as an anchor, -1: it is none                    */
    uint8_t *filled;     /* of each anchor: pixels of its patch that are not void, 1..64       */
    uint32_t *want;      /* of each anchor: expected detail of its patch, as txi_source.worth - 1 */
    uint32_t clamp;      /* largest detail of a pixel that counts                              */
    double grain;        /* (median + 1/2) / (mean + 1/2) of the detail of known pixels        */
    txi_source source[TXI_MAX_POSES];
    int built[TXI_MAX_POSES]; /* numbers of the sources that are made                          */
    int built_count;
} txi_level;

/* Memory of a level with these inner sides. 0: there is none. */
static int txi_level_make(txi_level *l, int width, int height, txm_arena *arena) {
    memset(l, 0, sizeof *l);
    l->width = width + 2 * TXI_EDGE;
    l->height = height + 2 * TXI_EDGE;
    const size_t n = (size_t)l->width * (size_t)l->height;
    l->state = (uint8_t *)txm_arena_zero(arena, n, 1);
    l->color = (uint8_t *)txm_arena_zero(arena, n, 4);
    l->mask = (uint8_t *)txm_arena_zero(arena, n, 4);
    l->taps = (uint8_t *)txm_arena_zero(arena, n, 1);
    l->depth = (uint8_t *)txm_arena_zero(arena, n, 1);
    l->slot = (int32_t *)txm_arena_alloc(arena, n, sizeof(int32_t));
    l->hole_row = (int32_t *)txm_arena_zero(arena, (size_t)l->height + 1, sizeof(int32_t));
    l->anchor_row = (int32_t *)txm_arena_zero(arena, (size_t)l->height + 1, sizeof(int32_t));
    return !arena->failed;
}

/* The finest level: the window itself. */
static void txi_level_load(txi_level *l, const txi_window *w) {
    for (int y = 0; y < w->height; y++) {
        for (int x = 0; x < w->width; x++) {
            const size_t from = (size_t)y * (size_t)w->width + (size_t)x;
            const size_t to = (size_t)(y + TXI_EDGE) * (size_t)l->width + (size_t)(x + TXI_EDGE);
            l->state[to] = w->state[from];
            if (w->state[from] == TXI_KNOWN || w->state[from] == TXI_FOREIGN)
                memcpy(l->color + 4 * to, w->color + 4 * from, 3);
        }
    }
}

/* Half the resolution. A pixel is missing if one of the four that it covers is, foreign if one is
   foreign; its colour is the mean of those that are not void. */
static void txi_level_halve(const txi_level *f, txi_level *l) {
    for (int y = TXI_EDGE; y < l->height - TXI_EDGE; y++) {
        for (int x = TXI_EDGE; x < l->width - TXI_EDGE; x++) {
            const size_t to = (size_t)y * (size_t)l->width + (size_t)x;
            int count[4] = {0, 0, 0, 0}, sum[3] = {0, 0, 0};
            for (int k = 0; k < 4; k++) {
                const int fx = 2 * x - TXI_EDGE + (k & 1), fy = 2 * y - TXI_EDGE + (k >> 1);
                if (fx >= f->width || fy >= f->height) continue;
                const size_t from = (size_t)fy * (size_t)f->width + (size_t)fx;
                count[f->state[from]]++;
                for (int c = 0; c < 3; c++) sum[c] += f->color[4 * from + (size_t)c];
            }
            const int known = count[TXI_KNOWN] + count[TXI_FOREIGN];
            l->state[to] = count[TXI_HOLE]      ? TXI_HOLE
                           : count[TXI_FOREIGN] ? TXI_FOREIGN
                           : known              ? TXI_KNOWN
                                                : TXI_VOID;
            if (l->state[to] == TXI_HOLE || !known) continue;
            for (int c = 0; c < 3; c++)
                l->color[4 * to + (size_t)c] = (uint8_t)((sum[c] + known / 2) / known);
        }
    }
}

/* The colours of the hole at half resolution, from those of the finer level; the rest is not
   touched. */
static void txi_color_halve(const txi_level *f, const uint8_t *from, const txi_level *l,
                            uint8_t *to) {
    for (int i = 0; i < l->hole_count; i++) {
        const int x = l->hole[i] % l->width, y = l->hole[i] / l->width;
        int sum[4] = {0, 0, 0, 0}, count = 0;
        for (int k = 0; k < 4; k++) {
            const int fx = 2 * x - TXI_EDGE + (k & 1), fy = 2 * y - TXI_EDGE + (k >> 1);
            if (fx >= f->width || fy >= f->height) continue;
            const size_t p = (size_t)fy * (size_t)f->width + (size_t)fx;
            if (f->state[p] == TXI_VOID) continue;
            for (int c = 0; c < 4; c++) sum[c] += from[4 * p + (size_t)c];
            count++;
        }
        for (int c = 0; c < 4 && count; c++)
            to[4 * (size_t)l->hole[i] + (size_t)c] = (uint8_t)((sum[c] + count / 2) / count);
    }
}

/* How the pixels may be resampled. At the finest level a pixel may be copied only if its 3x3
   neighbours are known, so that the caller can interpolate there. */
static int txi_level_taps(txi_level *l, int finest, txm_arena *scratch) {
    const size_t n = (size_t)l->width * (size_t)l->height, w = (size_t)l->width;
    uint8_t *solid = (uint8_t *)txm_arena_zero(scratch, n, 1);
    if (!solid) return 0;
    for (size_t p = w + 1; p + w + 1 < n; p++) {
        int all = l->state[p] == TXI_KNOWN;
        for (size_t q = p - w; finest && all && q <= p + w; q += w)
            all = l->state[q - 1] == TXI_KNOWN && l->state[q] == TXI_KNOWN &&
                  l->state[q + 1] == TXI_KNOWN;
        solid[p] = (uint8_t)all;
    }
    for (size_t p = w + 1; p + 2 * w + 2 < n; p++) {
        if (!solid[p]) continue;
        l->taps[p] = TXI_TAP_ONE;
        if (!(solid[p + 1] && solid[p + w] && solid[p + w + 1])) continue;
        l->taps[p] = TXI_TAP_LINEAR;
        int all = 1;
        for (size_t q = p - w - 1; all && q <= p + 2 * w - 1; q += w)
            for (size_t k = 0; k < 4; k++) all &= l->state[q + k] == TXI_KNOWN;
        if (all) l->taps[p] = TXI_TAP_CUBIC;
    }
    return 1;
}

/* Distances of hole pixels to the known part in pixels, by two passes with steps of 5 and 7 fifths.
   Void counts as nothing, so a hole on the border of the window is deepest there. */
static int txi_level_depth(txi_level *l, txm_arena *scratch) {
    const int w = l->width, n = l->width * l->height;
    int32_t *far5 = (int32_t *)txm_arena_alloc(scratch, (size_t)n, sizeof(int32_t));
    if (!far5) return 0;
    for (int p = 0; p < n; p++)
        far5[p] = l->state[p] == TXI_KNOWN || l->state[p] == TXI_FOREIGN ? 0 : 1 << 20;
    for (int pass = 0; pass < 2; pass++) {
        const int s = pass ? -1 : 1;
        for (int i = w + 1; i < n - w - 1; i++) {
            const int p = pass ? n - 1 - i : i;
            const int side[4] = {p - s, p - s * w, p - s * (w + 1), p - s * (w - 1)};
            for (int k = 0; k < 4; k++) {
                const int32_t through = far5[side[k]] + (k < 2 ? 5 : 7);
                if (through < far5[p]) far5[p] = through;
            }
        }
    }
    for (int p = 0; p < n; p++) {
        const int d = (far5[p] + 2) / 5;
        l->depth[p] = (uint8_t)(l->state[p] != TXI_HOLE ? 0 : d > 255 ? 255 : d < 1 ? 1 : d);
    }
    return 1;
}

/* The lists of the hole's pixels and of the patches that touch it. */
static int txi_level_lists(txi_level *l, txm_arena *arena) {
    const int w = l->width, n = l->width * l->height;
    uint8_t *touch = (uint8_t *)txm_arena_zero(arena, (size_t)n, 1);
    if (!touch) return 0;
    for (int p = 0; p < n; p++) {
        l->slot[p] = -1;
        if (l->state[p] != TXI_VOID) memset(l->mask + 4 * (size_t)p, 255, 4);
        if (l->state[p] != TXI_HOLE) continue;
        l->hole_count++;
        for (int y = 0; y < TXI_PATCH; y++)
            for (int x = 0; x < TXI_PATCH; x++) touch[p - y * w - x] = 1;
    }
    for (int p = 0; p < n; p++) {
        if (!touch[p]) continue;
        int filled = 0;
        for (int y = 0; y < TXI_PATCH; y++)
            for (int x = 0; x < TXI_PATCH; x++) filled += l->state[p + y * w + x] != TXI_VOID;
        const int centre = p + (TXI_PATCH / 2) * (w + 1);
        touch[p] =
            (uint8_t)(filled >= TXI_LEAST_FILLED || l->state[centre] == TXI_HOLE ? filled : 0);
        l->anchor_count += touch[p] != 0;
    }
    l->hole = (int32_t *)txm_arena_alloc(arena, (size_t)l->hole_count, sizeof(int32_t));
    l->anchor = (int32_t *)txm_arena_alloc(arena, (size_t)l->anchor_count, sizeof(int32_t));
    l->filled = (uint8_t *)txm_arena_alloc(arena, (size_t)l->anchor_count, 1);
    l->want = (uint32_t *)txm_arena_zero(arena, (size_t)l->anchor_count, sizeof(uint32_t));
    if (arena->failed) return 0;
    int h = 0, a = 0;
    for (int p = 0; p < n; p++) {
        if (p % w == 0) {
            l->hole_row[p / w] = h;
            l->anchor_row[p / w] = a;
        }
        if (l->state[p] == TXI_HOLE) {
            TXM_ASSERT(h < l->hole_count);
            l->hole[h++] = p;
        }
        if (!touch[p]) continue;
        l->slot[p] = a;
        l->filled[a] = touch[p];
        TXM_ASSERT(a < l->anchor_count);
        l->anchor[a++] = p;
    }
    l->hole_row[l->height] = h;
    l->anchor_row[l->height] = a;
    return 1;
}

/* twice the largest depth: the width of the hole, in pixels */
static int txi_level_hole_width(const txi_level *l) {
    int deepest = 0;
    for (int i = 0; i < l->hole_count; i++) {
        const int d = l->depth[l->hole[i]];
        if (d > deepest) deepest = d;
    }
    return 2 * deepest;
}

/* ---- distances of patches -------------------------------------------------------------------- */

/* Sum of squared differences of the four bytes of the pixels of two patches; a and b point to their
   first bytes, mask to that of a's mask or NULL if all count. Stops once the sum exceeds limit. */
static uint32_t txi_ssd(const uint8_t *a, size_t a_pitch, const uint8_t *mask, const uint8_t *b,
                        size_t b_pitch, uint32_t limit) {
    uint32_t total = 0;
    for (int y = 0; y < TXI_PATCH; y++) {
#ifdef TXI_SSE2
        static const int step = 16;
        __m128i sum = _mm_setzero_si128();
        for (int i = 0; i < 4 * TXI_PATCH; i += step) {
            const __m128i zero = _mm_setzero_si128();
            const __m128i u = _mm_loadu_si128((const __m128i *)(const void *)(a + i));
            const __m128i v = _mm_loadu_si128((const __m128i *)(const void *)(b + i));
            __m128i d = _mm_or_si128(_mm_subs_epu8(u, v), _mm_subs_epu8(v, u));
            if (mask)
                d = _mm_and_si128(d, _mm_loadu_si128((const __m128i *)(const void *)(mask + i)));
            const __m128i low = _mm_unpacklo_epi8(d, zero), high = _mm_unpackhi_epi8(d, zero);
            sum = _mm_add_epi32(sum, _mm_madd_epi16(low, low));
            sum = _mm_add_epi32(sum, _mm_madd_epi16(high, high));
        }
        sum = _mm_add_epi32(sum, _mm_shuffle_epi32(sum, 0x4e));
        sum = _mm_add_epi32(sum, _mm_shuffle_epi32(sum, 0xb1));
        total += (uint32_t)_mm_cvtsi128_si32(sum);
#else
        for (int i = 0; i < 4 * TXI_PATCH; i++) {
            const int d = a[i] - b[i];
            if (!mask || mask[i]) total += (uint32_t)(d * d);
        }
#endif
        if (total > limit) return total;
        a += a_pitch;
        b += b_pitch;
        if (mask) mask += a_pitch;
    }
    return total;
}

#endif /* TEXINPAINT_PICTURE_H */
