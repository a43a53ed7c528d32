#ifndef TEXSYN_MASK_H
#define TEXSYN_MASK_H

#include "config.h"

/* ---- pictures and masks ----------------------------------------------------------------- */

static size_t txs_pixels_of(int width, int height) {
    return (size_t)width * (size_t)height;
}

/* Copy rows from one picture to another of the same form. */
static void txs_copy_picture(const txm_image *from, const txm_image *to) {
    const txm_image a = txm_image_resolve(*from), b = txm_image_resolve(*to);
    const size_t row = (size_t)a.width * (size_t)a.channels * txm_sample_bytes(a.sample);
    for (int y = 0; y < a.height; y++)
        memmove(txm_image_row(&b, y), txm_image_row_const(&a, y), row);
}

/* no float sample is NaN or larger than LIMITS says */
static int txs_image_is_moderate(const txm_image *image) {
    const txm_image im = txm_image_resolve(*image);
    for (int y = 0; y < im.height && im.sample == TXM_F32; y++) {
        const float *row = (const float *)txm_image_row_const(&im, y);
        for (size_t i = 0; i < (size_t)im.width * (size_t)im.channels; i++)
            if (!txm_is_finite((double)row[i]) || !(fabsf(row[i]) <= 1e6f)) return 0;
    }
    return 1;
}

/* A mask that may be left out, of a picture. */
static txm_status txs_check_mask(const txm_image *mask, const txm_image *image, const char *name,
                                 txm_env *env) {
    if (!mask->pixels) return TXM_OK;
    return txm_mask_check(mask, name, image->width, image->height, TEXSYN_MAX_PIXELS, env);
}

/* The bytes of a mask of what may be used, 255 where it counts; *bytes is NULL without a mask. */
static txm_status txs_read_mask(const txm_image *mask, txm_arena *arena, uint8_t **bytes,
                                txm_env *env) {
    *bytes = NULL;
    if (!mask->pixels) return TXM_OK;
    *bytes = (uint8_t *)txm_arena_alloc(arena, txs_pixels_of(mask->width, mask->height), 1);
    if (!*bytes) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the mask");
    txm_mask_read(mask, TXM_MASK_ALLOWS, *bytes);
    return TXM_OK;
}

#endif /* TEXSYN_MASK_H */
