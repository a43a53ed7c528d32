#ifndef TEXSYN_ALPHA_H
#define TEXSYN_ALPHA_H

#include "mask.h"

/* ---- alpha of an example ------------------------------------------------------------------

   The colour of a transparent pixel is unknown, so it must not enter any statistics. A pixel's
   weight is its alpha in steps; cliques of colours are counted with the least weight of their
   pixels. Cliques of colours and alpha are counted everywhere, and there hidden pixels borrow the
   colour of a visible one that lies elsewhere: then colour and transparency are independent, the
   statistics of colour are the same all over the picture, and a synthesised picture has the texture
   of what is visible everywhere, of which its alpha shows a part.                             */

enum {
    TXS_OPAQUE = 15,  /* the largest weight: small, so that 32 bits hold the counts */
    TXS_LENDERS = 24  /* places that are tried before any visible pixel will do     */
};

static double txs_alpha_at(const txm_image *im, int x, int y) {
    return im->channels == 4 ? (double)txm_clampf(txm_image_get(im, x, y, 3), 0, 1) : 1;
}

/* The weights of the colours of a picture's pixels: alpha, of which the largest is TXS_OPAQUE.
   mask: NULL, or a byte for each pixel, 0 where it does not count; its weight is 0.
   Returns 0 if all that count are equal and visible, so that they need not be looked at. */
static int txs_weigh(const txm_image *im, const uint8_t *mask, uint8_t *weight) {
    const size_t width = (size_t)im->width, pixels = width * (size_t)im->height;
    double most = 0;
    int differ = 0;
    if (im->channels != 4) return 0;
    for (size_t i = 0; i < pixels; i++) {
        const double alpha = txs_alpha_at(im, (int)(i % width), (int)(i / width));
        if ((!mask || mask[i]) && alpha > most) most = alpha;
    }
    for (size_t i = 0; i < pixels; i++) {
        const int counts = most > 0 && (!mask || mask[i]);
        const double alpha = txs_alpha_at(im, (int)(i % width), (int)(i / width));
        weight[i] = (uint8_t)(counts ? floor(alpha / most * TXS_OPAQUE + 0.5) : 0);
        if ((!mask || mask[i]) && weight[i] != TXS_OPAQUE) differ = 1;
    }
    return differ;
}

/* Where hidden pixel i borrows its colour: the first visible one of some places that are the same
   for all, so that neighbours mostly borrow neighbours; else any visible one. */
static size_t txs_lender(const uint8_t *weight, int width, int height, size_t i,
                         size_t (*place)[2], const uint32_t *visible,
                         uint32_t count) {
    const size_t w = (size_t)width, h = (size_t)height;
    for (int k = 0; k < TXS_LENDERS; k++) {
        const size_t x = (i % w + place[k][0]) % w, y = (i / w + place[k][1]) % h;
        if (weight[y * w + x]) return y * w + x;
    }
    txm_rng rng = txm_rng_make(i, 1);
    return visible[txm_rng_below(&rng, count)];
}

/* Give the hidden pixels of a plane of colours those of visible ones, or 0 if there are none.
   visible: scratch, a number for each pixel. Returns how many are visible. */
static uint32_t txs_borrow(float *plane, const uint8_t *weight, int width, int height,
                           uint32_t *visible) {
    const size_t pixels = txs_pixels_of(width, height);
    size_t place[TXS_LENDERS][2];
    txm_rng rng = txm_rng_make(1, 0);
    uint32_t count = 0;
    for (size_t i = 0; i < pixels; i++)
        if (weight[i]) visible[count++] = (uint32_t)i;
    for (int k = 0; k < TXS_LENDERS; k++) {
        place[k][0] = txm_rng_below(&rng, (uint32_t)width);
        place[k][1] = txm_rng_below(&rng, (uint32_t)height);
    }
    for (size_t i = 0; i < pixels; i++) {
        if (weight[i]) continue;
        plane[i] = count ? plane[txs_lender(weight, width, height, i, place, visible, count)] : 0;
    }
    return count;
}

#endif /* TEXSYN_ALPHA_H */
