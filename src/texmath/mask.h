#ifndef TEXMATH_MASK_H
#define TEXMATH_MASK_H

#include "image.h"

/* ---- masks ------------------------------------------------------------------------------ */

/* One rule for all masks of the suite. A mask is a picture of any sample type with 1 to 4 channels
   and the size of what it masks. Its value is gray times alpha, 0 (black or transparent) to 1
   (white and opaque), and a pixel counts where that is at least half. So the noise of a JPEG, and
   what an eraser left under its alpha, do not matter.

   The rim of a smooth (antialiased, blurred) mask is a mixture: its pixels may show a little of what
   was masked although they are more white than black. So where a mask is smooth, the rim goes to the
   side that does no harm: not used where the mask allows, replaced where it replaces. */
typedef enum txm_mask_use {
    TXM_MASK_DIVIDES = 0,  /* both sides are alike, as in a layout: at least half, no more        */
    TXM_MASK_ALLOWS = 1,   /* what counts may be used or kept: the rim does not count             */
    TXM_MASK_REPLACES = 2  /* what counts is replaced: all of the rim counts                      */
} txm_mask_use;

enum {
    TXM_MASK_RIM = 8,   /* pixels: what is farther from the other side is no rim; ours            */
    TXM_MASK_TILE = 64, /* pixels: smooth or sharp is decided for squares of that side, by        */
    TXM_MASK_ROUND = 32 /* what is in them and so far around; ours                                */
};
#define TXM_MASK_FEW (1.0 / 32) /* of the pixels at the border: a smooth mask has more that lie between
                                   their neighbours, at a quarter to three quarters (antialiased
                                   shapes a quarter, a JPEG of quality 50 or more at most 1/40);
                                   ours                                                           */

/* What a mask says at (x, y), inside: gray times alpha, 0..1. Gray of RGB is (54 R + 183 G + 19 B) /
   256; samples beyond 0..1 are clamped, NaN is 0. */
static inline double txm_mask_value(const txm_image *mask, int x, int y) {
    const int n = mask->channels ? mask->channels : 1;
    double v[4] = {0, 0, 0, 0};
    for (int c = 0; c < n; c++) v[c] = (double)txm_clampf(txm_image_get(mask, x, y, c), 0, 1);
    const double gray = n < 3 ? v[0] : (54 * v[0] + 183 * v[1] + 19 * v[2]) / 256;
    return n % 2 ? gray : gray * v[n - 1];
}

/* Does the mask count at (x, y)? At least half, without regard to rims. */
static inline int txm_mask_at(const txm_image *mask, int x, int y) {
    return txm_mask_value(mask, x, y) >= 0.5;
}

/* Is this a valid mask of a picture of that size?

   name        what the caller calls it, for the message: "mask: is 30 x 20 pixels, ..."
   max_pixels  as for txm_image_check
   return      TXM_OK, TXM_BAD_ARGUMENT, TXM_TOO_LARGE                                    */
static inline txm_status txm_mask_check(const txm_image *mask, const char *name, int width,
                                        int height, size_t max_pixels, txm_env *env) {
    char line[sizeof env->message], rest[sizeof env->message];
    const txm_status status = txm_image_check(mask, name, max_pixels, env);
    if (status != TXM_OK) return status;
    if (mask->width != width || mask->height != height) {
        txm_put_numbers(line, sizeof line, "is # x # pixels, ", (uint64_t)mask->width,
                        (uint64_t)mask->height);
        txm_put_numbers(rest, sizeof rest, "its picture # x #; give them the same size",
                        (uint64_t)width, (uint64_t)height);
        const size_t n = strlen(line);
        for (size_t i = 0; n + i + 1 < sizeof line; i++) {
            line[n + i] = rest[i];
            line[n + i + 1] = 0;
            if (!rest[i]) break;
        }
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name, line);
    }
    if (!txm_image_is_finite(mask))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name, "samples must be finite");
    return TXM_OK;
}

/* What txm_mask_read is doing. A byte is 255 where the mask counts, 0 where not, or the step by which
   the rim has reached the pixel. The rim grows from the side `from` into the other one. */
typedef struct txm_mask_reader {
    txm_image mask;
    uint8_t *bytes;
    int from, to;
} txm_mask_reader;

static inline uint8_t *txm_mask_byte(const txm_mask_reader *r, int x, int y) {
    return r->bytes + (size_t)y * (size_t)r->mask.width + (size_t)x;
}

/* the pixels with at least half */
static inline void txm_mask_halves(const txm_mask_reader *r) {
    for (int y = 0; y < r->mask.height; y++) {
        uint8_t *to = txm_mask_byte(r, 0, y);
        const uint8_t *row = (const uint8_t *)txm_image_row_const(&r->mask, y);
        const int is_plain = r->mask.sample == TXM_U8 && r->mask.channels == 1;
        for (int x = 0; x < r->mask.width; x++)
            to[x] = (uint8_t)((is_plain ? row[x] >= 128 : txm_mask_at(&r->mask, x, y)) ? 255 : 0);
    }
}

/* Has (x, y) a neighbour to the left, right, above or below on the other side? What the rim has
   reached still is on the side where it was. */
static inline int txm_mask_is_border(const txm_mask_reader *r, int x, int y) {
    const uint8_t *p = txm_mask_byte(r, x, y);
    const size_t width = (size_t)r->mask.width;
    const int side = *p == r->from;
    return (x > 0 && (p[-1] == r->from) != side) ||
           (x + 1 < r->mask.width && (p[1] == r->from) != side) ||
           (y > 0 && (*(p - width) == r->from) != side) ||
           (y + 1 < r->mask.height && (p[width] == r->from) != side);
}

/* Is there a pixel of either side in the square at (x0, y0) and the pixels next to it? */
static inline int txm_mask_is_mixed(const txm_mask_reader *r, int x0, int y0) {
    const int left = txm_clampi(x0 - 1, 0, x0), top = txm_clampi(y0 - 1, 0, y0);
    const int side = *txm_mask_byte(r, x0, y0) == r->from;
    for (int y = top; y < r->mask.height && y - y0 <= TXM_MASK_TILE; y++) {
        const uint8_t *row = txm_mask_byte(r, 0, y);
        for (int x = left; x < r->mask.width && x - x0 <= TXM_MASK_TILE; x++)
            if ((row[x] == r->from) != side) return 1;
    }
    return 0;
}

/* Is the value at (x, y) near the half and between those of neighbours? That of an evenly gray area is
   not. */
static inline int txm_mask_is_between(const txm_mask_reader *r, int x, int y) {
    const double here = txm_mask_value(&r->mask, x, y);
    int lower = 0, higher = 0;
    if (here < 0.25 || here > 0.75) return 0;
    for (int v = txm_clampi(y - 1, 0, y); v - y <= 1 && v < r->mask.height; v++) {
        for (int u = txm_clampi(x - 1, 0, x); u - x <= 1 && u < r->mask.width; u++) {
            const double there = txm_mask_value(&r->mask, u, v);
            lower |= there < here;
            higher |= there > here;
        }
    }
    return lower && higher;
}

/* Is the mask smooth in and around the square at (x0, y0)? */
static inline int txm_mask_is_smooth(const txm_mask_reader *r, int x0, int y0) {
    const int left = txm_clampi(x0 - TXM_MASK_ROUND, 0, x0);
    const int top = txm_clampi(y0 - TXM_MASK_ROUND, 0, y0);
    const int reach = TXM_MASK_TILE + TXM_MASK_ROUND;
    size_t border = 0, between = 0;
    for (int y = top; y < r->mask.height && y - y0 < reach; y++) {
        for (int x = left; x < r->mask.width && x - x0 < reach; x++) {
            if (!txm_mask_is_border(r, x, y)) continue;
            border++;
            between += (size_t)txm_mask_is_between(r, x, y);
        }
    }
    return (double)between > TXM_MASK_FEW * (double)border;
}

/* Give this step to the neighbours of (x, y) that the rim reaches from there: those on the other
   side whose value is farther from this side's, but not at the end of the range. */
static inline void txm_mask_step(const txm_mask_reader *r, int x, int y, int step) {
    double here = -1;
    for (int v = txm_clampi(y - 1, 0, y); v - y <= 1 && v < r->mask.height; v++) {
        for (int u = txm_clampi(x - 1, 0, x); u - x <= 1 && u < r->mask.width; u++) {
            uint8_t *p = txm_mask_byte(r, u, v);
            if (*p != r->to) continue;
            const double there = txm_mask_value(&r->mask, u, v);
            if (here < 0) here = txm_mask_value(&r->mask, x, y);
            if (r->from ? there < here && there > 0 : there > here && there < 1) *p = (uint8_t)step;
        }
    }
}

/* Mark the rim in bytes: first in the squares where the mask is smooth, then on from there. */
static inline void txm_mask_grow(const txm_mask_reader *r) {
    const int width = r->mask.width, height = r->mask.height;
    for (int j = 0; j <= (height - 1) / TXM_MASK_TILE; j++) {
        for (int i = 0; i <= (width - 1) / TXM_MASK_TILE; i++) {
            const int x0 = i * TXM_MASK_TILE, y0 = j * TXM_MASK_TILE;
            if (!txm_mask_is_mixed(r, x0, y0) || !txm_mask_is_smooth(r, x0, y0)) continue;
            for (int y = y0; y < height && y - y0 < TXM_MASK_TILE; y++)
                for (int x = x0; x < width && x - x0 < TXM_MASK_TILE; x++)
                    if (*txm_mask_byte(r, x, y) == r->from) txm_mask_step(r, x, y, 1);
        }
    }
    for (int step = 2; step <= TXM_MASK_RIM; step++) {
        for (int y = 0; y < height; y++) {
            const uint8_t *row = txm_mask_byte(r, 0, y);
            for (int x = 0; x < width; x++)
                if (row[x] == step - 1) txm_mask_step(r, x, y, step);
        }
    }
}

/* Read a mask by the rule above.

   mask   one that txm_mask_check has found good
   bytes  width * height of them, row after row without gaps: receives 255 where the mask counts,
          else 0
   return how many count
   cost   some 10 ns a pixel, of smooth masks twice that; no memory                        */
static inline size_t txm_mask_read(const txm_image *mask, txm_mask_use use, uint8_t *bytes) {
    txm_mask_reader r;
    r.mask = txm_image_resolve(*mask);
    r.bytes = bytes;
    r.from = use == TXM_MASK_REPLACES ? 255 : 0;
    r.to = 255 - r.from;
    txm_mask_halves(&r);
    if (use != TXM_MASK_DIVIDES) txm_mask_grow(&r);
    size_t count = 0;
    const size_t pixels = (size_t)r.mask.width * (size_t)r.mask.height;
    for (size_t i = 0; i < pixels; i++) {
        if (bytes[i] != r.to) bytes[i] = (uint8_t)r.from; /* the rim joins the side it came from */
        count += bytes[i] != 0;
    }
    return count;
}

#endif /* TEXMATH_MASK_H */
