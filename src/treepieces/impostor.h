#ifndef TREEPIECES_IMPOSTOR_H
#define TREEPIECES_IMPOSTOR_H

#include "picture.h"
#include "rim.h"

/* ---- foliage: impostors -------------------------------------------------------------------- */

/* The color of a point p of a card is that of its texel, times

       (0.82 + 0.36 clamp(0.35 + 0.65 n.l) + 0.2 max(0, f.l)) * (0.75 + 0.25 min(1, p.p))

   with the normal n of the card, l towards the light and the forward axis f of the view: wrap
   lighting, light transmitted by leaves when the sun is behind them, and shade in the middle of the
   cloud. The nearest texel is taken, sRGB values are used as they are: a shader does the same in
   three lines. Cards seen at an angle with a sine below 0.1 are skipped: they would be rows of
   dots. */
static float tpc_card_light(const treepieces_impostor_desc *d, const treepieces_card *card) {
    const float direct = txm_clampf(0.35f + 0.65f * tpc_dot(card->normal, d->light), 0, 1);
    return 0.82f + 0.36f * direct + 0.2f * txm_maxf(0, tpc_dot(d->forward, d->light));
}

/* First and last of `count` pixels whose centres lie in low..high, where -1..1 is the image. */
static void tpc_pixels(float low, float high, int count, int *first, int *last) {
    const float n = (float)count;
    *first = (int)txm_clampf((low + 1) * 0.5f * n - 0.5f, 0, n);
    *last = (int)txm_clampf((high + 1) * 0.5f * n + 0.5f, -1, n - 1);
}

/* The texel at (s, t) of a card, each -1..1, to the right and up. */
static const uint8_t *tpc_texel(const txm_image *leaves, float s, float t) {
    const int x = (int)((s + 1) * 0.5f * (float)leaves->width);
    const int y = (int)((1 - t) * 0.5f * (float)leaves->height);
    const void *row = txm_image_row_const(leaves, txm_clampi(y, 0, leaves->height - 1));
    return (const uint8_t *)row + 4 * txm_clampi(x, 0, leaves->width - 1);
}

static void tpc_draw_card(const treepieces_impostor_desc *d, const treepieces_card *card,
                          const txm_image *leaves, const txm_image *color, const txm_image *depth) {
    const float c[3] = {tpc_dot(card->center, d->right), tpc_dot(card->center, d->up),
                        -tpc_dot(card->center, d->forward)};
    const float r[3] = {tpc_dot(card->right, d->right), tpc_dot(card->right, d->up),
                        -tpc_dot(card->right, d->forward)};
    const float u[3] = {tpc_dot(card->up, d->right), tpc_dot(card->up, d->up),
                        -tpc_dot(card->up, d->forward)};
    const float det = r[0] * u[1] - r[1] * u[0], light = tpc_card_light(d, card);
    const float wide = fabsf(r[0]) + fabsf(u[0]), high = fabsf(r[1]) + fabsf(u[1]);
    const float area = tpc_dot(card->right, card->right) * tpc_dot(card->up, card->up);
    int left, right, top, bottom;
    if (!(det * det > 0.01f * area)) return; /* seen edge on */
    if (!(fabsf(c[0]) + fabsf(c[1]) + wide + high < 1e6f)) return; /* too large or not finite */
    tpc_pixels(c[0] - wide, c[0] + wide, color->width, &left, &right);
    tpc_pixels(-c[1] - high, high - c[1], color->height, &top, &bottom);
    for (int row = top; row <= bottom; row++) {
        const float y = 1 - (2 * (float)row + 1) / (float)color->height;
        uint8_t *colors = (uint8_t *)txm_image_row(color, row);
        float *depths = (float *)txm_image_row(depth, row);
        for (int column = left; column <= right; column++) {
            const float x = (2 * (float)column + 1) / (float)color->width - 1;
            const float s = ((x - c[0]) * u[1] - (y - c[1]) * u[0]) / det;
            const float t = ((y - c[1]) * r[0] - (x - c[0]) * r[1]) / det;
            if (!(s >= -1 && s < 1 && t > -1 && t <= 1)) continue;
            const float z = c[2] + s * r[2] + t * u[2];
            if (!(z > depths[column])) continue;
            const uint8_t *texel = tpc_texel(leaves, s, t);
            if (texel[3] < 128) continue;
            const float shade = light * (0.75f + 0.25f * txm_minf(1, x * x + y * y + z * z));
            for (int k = 0; k < 3; k++) {
                const float lit = txm_clampf((float)texel[k] * shade, 0, 255);
                colors[4 * column + k] = (uint8_t)(lit + 0.5f);
            }
            colors[4 * column + 3] = 255;
            depths[column] = z;
        }
    }
}

static void tpc_draw_cloud(const treepieces_impostor_desc *d, const txm_image *leaves,
                           const txm_image *color, const txm_image *depth) {
    memset(color->pixels, 0, 4 * (size_t)color->width * (size_t)color->height);
    for (int y = 0; y < depth->height; y++) {
        float *row = (float *)txm_image_row(depth, y);
        for (int x = 0; x < depth->width; x++) row[x] = -2;
    }
    for (int i = 0; i < d->card_count; i++) tpc_draw_card(d, &d->cards[i], leaves, color, depth);
}

/* Are the axes orthogonal unit vectors, and is light of unit length? */
static int tpc_is_view(const treepieces_impostor_desc *d) {
    const float *v[4] = {d->right, d->up, d->forward, d->light};
    for (int i = 0; i < 4; i++) {
        if (!(fabsf(tpc_dot(v[i], v[i]) - 1) < 1e-3f)) return 0;
        if (i < 3 && !(fabsf(tpc_dot(v[i], v[(i + 1) % 3])) < 1e-3f)) return 0;
    }
    return 1;
}

TREEPIECES_API txm_status treepieces_impostor(const treepieces_impostor_desc *desc, txm_env *env,
                                              txm_image color, txm_image depth) {
    if (!desc || (desc->card_count && !desc->cards) || desc->card_count < 0)
        return txm_fail(env, TXM_BAD_ARGUMENT, "desc or cards is NULL, or card_count below 0");
    txm_status status = txm_image_check(&desc->leaves, "leaves", 0, env);
    if (status == TXM_OK) status = txm_image_check(&color, "color", 0, env);
    if (status == TXM_OK) status = txm_image_check(&depth, "depth", 0, env);
    if (status != TXM_OK) return status;
    const txm_image leaves = txm_image_resolve(desc->leaves);
    const txm_image c = txm_image_resolve(color), d = txm_image_resolve(depth);
    if (leaves.channels != 4 || leaves.sample != TXM_U8 || c.channels != 4 || c.sample != TXM_U8)
        return txm_fail(env, TXM_BAD_ARGUMENT, "leaves and color must have 4 channels of 8 bits");
    if (d.channels != 1 || d.sample != TXM_F32 || d.width != c.width || d.height != c.height)
        return txm_fail(env, TXM_BAD_ARGUMENT, "depth must be float, 1 channel, of color's size");
    if (!tpc_is_view(desc))
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "right, up, forward and light must be unit vectors, the first three "
                        "orthogonal");
    txm_image colors, depths;
    txm_arena arena;
    txm_arena_init(&arena, env);
    status = tpc_new_picture(&c, &arena, env, &colors);
    if (status == TXM_OK) status = tpc_new_picture(&d, &arena, env, &depths);
    if (status == TXM_OK) {
        tpc_draw_cloud(desc, &leaves, &colors, &depths);
        status = tpc_deliver(&colors, &c, env);
    }
    if (status == TXM_OK) tpc_copy_picture(&depths, &d);
    txm_arena_free(&arena);
    return status;
}

#endif /* TREEPIECES_IMPOSTOR_H */
