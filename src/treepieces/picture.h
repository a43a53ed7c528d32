#ifndef TREEPIECES_PICTURE_H
#define TREEPIECES_PICTURE_H

#include "../treepieces.h"

/* ---- pictures with hidden colours ---------------------------------------------------------- */

/* A picture of the form of out in the arena, to be drawn and then delivered. */
static txm_status tpc_new_picture(const txm_image *out, txm_arena *arena, txm_env *env,
                                  txm_image *picture) {
    *picture = *out;
    picture->stride = 0;
    *picture = txm_image_resolve(*picture);
    picture->pixels = txm_arena_alloc(arena, (size_t)picture->height, (size_t)picture->stride);
    return picture->pixels ? TXM_OK : txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a picture");
}

static void tpc_copy_picture(const txm_image *picture, const txm_image *out) {
    for (int y = 0; y < picture->height; y++)
        memcpy(txm_image_row(out, y), txm_image_row_const(picture, y), (size_t)picture->stride);
}

/* Bleed hidden colours and copy the picture to out, which is untouched after an error. */
static txm_status tpc_deliver(const txm_image *picture, const txm_image *out, txm_env *env) {
    const txm_status status = txm_image_bleed(picture, 0, env);
    if (status == TXM_OK) tpc_copy_picture(picture, out);
    return status;
}

#endif /* TREEPIECES_PICTURE_H */
