#ifndef TEXSYN_ALPHA_H
#define TEXSYN_ALPHA_H

#include "mask.h"

/* ---- alpha of an example ------------------------------------------------------------------

   The colour of a transparent pixel is unknown, so it must not enter any statistics. The weight of
   a colour is its alpha in steps; cliques of colours are counted with the least weight of their
   pixels. Cliques of colours and alpha are counted everywhere, and there hidden pixels borrow the
   colour of a visible one that lies elsewhere: then colour and transparency are independent, the
   statistics of colour are the same all over the picture, and a synthesised picture has the texture
   of what is visible everywhere, of which its alpha shows a part.                             */

enum {
    TXS_OPAQUE = 15,  /* the largest weight: small, so that 32 bits hold the counts */
    TXS_LENDERS = 24  /* places that are tried before any visible pixel will do     */
};

/* The weight of a colour whose alpha is that: 0 only if it is hidden. */
static uint8_t txs_weight_of(double alpha) {
    return (uint8_t)(alpha > 0 ? (alpha < 1 ? ceil(alpha * (double)TXS_OPAQUE) : (int)TXS_OPAQUE) : 0);
}

/* How often a clique is counted whose least weight is that: fully from a quarter of the opacity on.
   Colours of thin veils belong to their alpha, with which they are counted in full; only what is
   faint is left out gradually. */
static uint32_t txs_counts_of(uint32_t least) {
    return 4 * least < TXS_OPAQUE ? 4 * least : (uint32_t)TXS_OPAQUE;
}

/* The weights of a picture's pixels. mask: NULL, or a byte for each pixel, 0 where it does not
   count; its weight is 0. Returns 0 if all that count are opaque, so that there is no need of
   weights. */
static int txs_weigh(const txm_image *im, const uint8_t *mask, uint8_t *weight) {
    int differ = 0;
    if (im->channels != 4) return 0;
    for (int y = 0; y < im->height; y++) {
        for (int x = 0; x < im->width; x++) {
            const size_t i = (size_t)y * (size_t)im->width + (size_t)x;
            weight[i] = txs_weight_of((double)txm_image_get(im, x, y, 3));
            if (mask && !mask[i]) weight[i] = 0;
            else differ |= weight[i] != TXS_OPAQUE;
        }
    }
    return differ;
}

/* ---- hidden colour of results ------------------------------------------------------------ */

/* Where a picture is to be painted: out itself, or a picture of that form in the arena if alpha can
   hide colours, which then are bled; *to receives it. */
static txm_status txs_easel(const txm_image *out, int can_hide, txm_arena *arena, txm_env *env,
                            txm_image *to) {
    *to = txm_image_resolve(*out);
    if (!can_hide) return TXM_OK;
    to->stride = 0;
    *to = txm_image_resolve(*to);
    to->pixels = txm_arena_alloc(arena, (size_t)to->height, (size_t)to->stride);
    return to->pixels ? TXM_OK : txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a picture");
}

/* What was painted becomes the result: hidden colours are bled. */
static txm_status txs_hang(const txm_image *painted, const txm_image *out, int wrap, txm_env *env) {
    if (painted->pixels == out->pixels) return TXM_OK;
    const txm_status status = txm_image_bleed(painted, wrap, env);
    if (status == TXM_OK) txs_copy_picture(painted, out);
    return status;
}

/* ---- borrowed colours -------------------------------------------------------------------- */

/* Who lends colours: visible pixels, and some places that are the same for all that borrow. */
typedef struct txs_lenders {
    const uint8_t *weight; /* of each pixel, not 0 where it can lend */
    int width, height;
    const uint32_t *visible; /* those that can lend */
    uint32_t count;
    size_t place[TXS_LENDERS][2];
} txs_lenders;

static txs_lenders txs_lenders_of(const uint8_t *weight, int width, int height,
                                  const uint32_t *visible, uint32_t count) {
    txs_lenders l;
    txm_rng rng = txm_rng_make(1, 0);
    memset(&l, 0, sizeof l);
    l.weight = weight;
    l.width = width;
    l.height = height;
    l.visible = visible;
    l.count = count;
    for (int k = 0; k < TXS_LENDERS; k++) {
        l.place[k][0] = txm_rng_below(&rng, (uint32_t)width);
        l.place[k][1] = txm_rng_below(&rng, (uint32_t)height);
    }
    return l;
}

/* Where hidden pixel i borrows its colour: the first visible one of the places, so that neighbours
   mostly borrow neighbours; else any visible one. There must be one. */
static size_t txs_lender(const txs_lenders *l, size_t i) {
    const size_t w = (size_t)l->width, h = (size_t)l->height;
    for (int k = 0; k < TXS_LENDERS; k++) {
        const size_t x = (i % w + l->place[k][0]) % w, y = (i / w + l->place[k][1]) % h;
        if (l->weight[y * w + x]) return y * w + x;
    }
    txm_rng rng = txm_rng_make(i, 1);
    return l->visible[txm_rng_below(&rng, l->count)];
}

/* Give the hidden pixels of a plane of colours those of visible ones, or 0 if there are none.
   visible: scratch, a number for each pixel. Returns how many are visible. */
static uint32_t txs_borrow(float *plane, const uint8_t *weight, int width, int height,
                           uint32_t *visible) {
    const size_t pixels = txs_pixels_of(width, height);
    uint32_t count = 0;
    for (size_t i = 0; i < pixels; i++)
        if (weight[i]) visible[count++] = (uint32_t)i;
    const txs_lenders lenders = txs_lenders_of(weight, width, height, visible, count);
    for (size_t i = 0; i < pixels; i++)
        if (!weight[i]) plane[i] = count ? plane[txs_lender(&lenders, i)] : 0;
    return count;
}

#endif /* TEXSYN_ALPHA_H */
