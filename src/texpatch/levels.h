#ifndef TEXPATCH_LEVELS_H
#define TEXPATCH_LEVELS_H

#include "config.h"

/* ---- levels of detail ------------------------------------------------------------------- */

TEXPATCH_API txm_status texpatch_half(const txm_image *image, const texpatch_map *map, int tileable,
                                      txm_env *env, const txm_image *half) {
    txm_content content = TXM_COLOR;
    if (!image || !half) return txm_fail(env, TXM_BAD_ARGUMENT, "image or half is NULL");
    txm_status status = txm_image_check(image, "image", TEXPATCH_MAX_PIXELS, env);
    if (status == TXM_OK) status = txm_image_check(half, "half", TEXPATCH_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    if (tileable < 0 || tileable > 3)
        return txm_fail(env, TXM_BAD_ARGUMENT, "tileable must be a sum of TEXPATCH_TILE_X and _Y");
    if (map && map->is_label) content = TXM_LABELS;
    else if (map && map->is_normal) content = TXM_NORMALS;
    else if (map && map->is_data) content = TXM_DATA;
    return txm_image_halve(image, content, tileable, half, env);
}

#endif /* TEXPATCH_LEVELS_H */
