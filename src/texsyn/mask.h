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

/* gray times alpha is at least half: the rule for masks */
static int txs_is_white(const txm_image *mask, int x, int y) {
    const txm_image m = txm_image_resolve(*mask);
    double v = (double)txm_image_get(&m, x, y, 0);
    if (m.channels >= 3)
        v = (v + (double)txm_image_get(&m, x, y, 1) + (double)txm_image_get(&m, x, y, 2)) / 3;
    if (m.channels % 2 == 0) v *= (double)txm_image_get(&m, x, y, m.channels - 1);
    return v >= 0.5;
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

static txm_status txs_check_mask(const txm_image *mask, const txm_image *image, const char *name,
                                 txm_env *env) {
    if (!mask->pixels) return TXM_OK;
    const txm_status status = txm_image_check(mask, name, TEXSYN_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    if (mask->width != image->width || mask->height != image->height)
        return txm_fail_numbers_at(env, TXM_BAD_ARGUMENT, name, "must be # x # like its picture",
                                   (uint64_t)image->width, (uint64_t)image->height);
    if (!txm_image_is_finite(mask))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name, "has samples that are not finite");
    return TXM_OK;
}

#endif /* TEXSYN_MASK_H */
