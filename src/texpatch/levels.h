#ifndef TEXPATCH_LEVELS_H
#define TEXPATCH_LEVELS_H

#include "config.h"

/* ---- levels of detail ------------------------------------------------------------------- */

typedef struct txp_halving {
    const txm_image *image, *half;
    const texpatch_map *map;
    const float *linear; /* of the 256 bytes; NULL: samples are linear already                  */
} txp_halving;

static void txp_half_row(void *context, int y) {
    const txp_halving *h = (const txp_halving *)context;
    const txm_image *im = h->image, *to = h->half;
    const int n = im->channels;
    const int colours = n == 2 ? 1 : n == 4 ? 3 : n; /* the last of 2 or 4 is alpha */
    for (int x = 0; x < to->width; x++) {
        float out[4] = {0, 0, 0, 0};
        int count = 0;
        for (int v = 2 * y; v < 2 * y + 2 && v < im->height; v++) {
            for (int u = 2 * x; u < 2 * x + 2 && u < im->width; u++, count++) {
                for (int c = 0; c < n; c++) {
                    float g = txm_image_get(im, u, v, c);
                    if (h->map->is_normal && c < 3) g = 2 * g - 1;
                    else if (h->linear && c < colours)
                        g = im->sample == TXM_U8 ? h->linear[((const uint8_t *)txm_image_row_const(
                                                       im, v))[u * n + c]]
                                                 : txm_srgb_to_linear(g);
                    out[c] += g;
                }
            }
        }
        if (h->map->is_label) {
            for (int c = 0; c < n; c++)
                txm_image_set(to, x, y, c, txm_image_get(im, 2 * x, 2 * y, c));
            continue;
        }
        for (int c = 0; c < n; c++) out[c] = txm_float(out[c] / (float)count);
        if (h->map->is_normal) {
            const txm_vec3 v = txm_vec3_normalize(txm_v3(out[0], out[1], out[2]));
            const int is_none = !(txm_vec3_length(v) > 0.5f);
            out[0] = is_none ? 0.5f : 0.5f + 0.5f * v.x;
            out[1] = is_none ? 0.5f : 0.5f + 0.5f * v.y;
            out[2] = is_none ? 1.0f : 0.5f + 0.5f * v.z;
        } else if (h->linear) {
            for (int c = 0; c < colours; c++) out[c] = txm_linear_to_srgb(out[c]);
        }
        for (int c = 0; c < n; c++) txm_image_set(to, x, y, c, out[c]);
    }
}

TEXPATCH_API txm_status texpatch_half(const txm_image *image, const texpatch_map *map, txm_env *env,
                                      const txm_image *half) {
    static const texpatch_map plain = {1, 0, 0, 0};
    float linear[256];
    txp_halving h;
    if (!image || !half) return txm_fail(env, TXM_BAD_ARGUMENT, "image or half is NULL");
    txm_status status = txm_image_check(image, "image", TEXPATCH_MAX_PIXELS, env);
    if (status == TXM_OK) status = txm_image_check(half, "half", TEXPATCH_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    const txm_image from = txm_image_resolve(*image), to = txm_image_resolve(*half);
    if (to.width != (from.width + 1) / 2 || to.height != (from.height + 1) / 2 ||
        to.channels != from.channels || to.sample != from.sample)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "half",
                           "must have half the size of image, rounded up, and its format");
    h.image = &from;
    h.half = &to;
    h.map = map ? map : &plain;
    if (h.map->is_normal && from.channels < 3)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "image", "a normal map has 3 or 4 channels");
    h.linear = NULL;
    if (from.sample != TXM_F32 && !h.map->is_normal && !h.map->is_label && !h.map->is_data) {
        for (int i = 0; i < 256; i++) linear[i] = txm_srgb_to_linear((float)i / 255);
        h.linear = linear;
    }
    txm_parallel_for(env, to.height, txp_half_row, &h);
    return TXM_OK;
}

#endif /* TEXPATCH_LEVELS_H */
