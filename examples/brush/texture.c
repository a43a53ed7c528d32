/* texture.c - the exemplar, and the job that makes the texture between frames
   SPDX-License-Identifier: MIT OR Unlicense  */
#define TEXPATCH_IMPLEMENTATION
#include "texpatch.h"
#define TEXEDGES_IMPLEMENTATION
#include "texedges.h"

#include "brush.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int check(brush *b, txm_status status) {
    if (status != TXM_OK) b->failed = b->env.message;
    return status == TXM_OK;
}

static txm_image square(uint8_t *pixels, int channels) {
    const txm_image image = {pixels, SIDE, SIDE, channels, TXM_U8, 0};
    return image;
}

/* The layers of the exemplar, and a job whose guide is still empty. */
void begin_texture(brush *b) {
    texedges_desc find = {0};
    find.image = b->photo;
    find.levels = LEVELS;
    find.smooth = 2;
    find.least = 32;
    b->layers = b->photo;
    b->layers.channels = 1;
    b->layers.pixels = malloc((size_t)b->photo.width * (size_t)b->photo.height);
    if (!b->layers.pixels) b->failed = "no memory";
    if (b->failed || !check(b, texedges_find(&find, &b->env, &b->edges)) ||
        !check(b, texedges_layers(&find, b->edges, &b->env, &b->layers)))
        return;
    for (int k = 0; k < LEVELS; k++)
        printf("layer %d: gray %.0f to %.0f\n", k,
               k ? 255 * (double)b->edges->thresholds[k - 1] : 0.0,
               k < LEVELS - 1 ? 255 * (double)b->edges->thresholds[k] : 255.0);

    texpatch_desc desc = {0}; /* zeros mean the defaults */
    b->exemplar.maps = &b->photo;
    b->exemplar.guide = b->layers;
    desc.exemplars = &b->exemplar;
    desc.exemplar_count = 1;
    desc.map_count = 1;
    desc.width = desc.height = SIDE;
    desc.guide = square(b->guide, 1);
    desc.guide_mask = square(b->mask, 1);
    desc.seed = b->seed;
    if (!check(b, texpatch_begin(&desc, &b->env, &b->job))) return;
    b->box.w = b->box.h = SIDE;
    b->more = 1;
}

/* The guide of all strokes, and the mask of where it counts. */
static int make_guide(brush *b, const txm_image *guide, const txm_image *mask) {
    texedges_set *disturbed;
    texedges_control control = {0};
    control.edges = b->edges;
    control.strokes = b->strokes;
    control.stroke_count = b->stroke_count;
    control.background = -1; /* away from the strokes the texture is free */
    control.seed = b->seed;
    if (!check(b, texedges_disturb(&control, SIDE, SIDE, &b->env, &disturbed))) return 0;
    const int is_made = check(b, texedges_guide(&control, disturbed, &b->env, guide, mask));
    texedges_set_free(disturbed);
    return is_made;
}

/* Set `again` where the guide differs from the present one (or everywhere), and MARGIN pixels around,
   so that there is room for good cuts. Returns the bounding box. */
static SDL_Rect mark_changes(const brush *b, const uint8_t *guide, const uint8_t *mask, int everywhere,
                             uint8_t *again) {
    const SDL_Rect all = {0, 0, SIDE, SIDE};
    SDL_Rect box = {0, 0, 0, 0};
    memset(again, 0, SIDE * SIDE);
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0, end; x < SIDE; x = end) { /* x..end-1 change */
            for (end = x; end < SIDE; end++) {
                const int i = SIDE * y + end;
                if (!everywhere && mask[i] == b->mask[i] && (!mask[i] || guide[i] == b->guide[i]))
                    break;
            }
            SDL_Rect around = {x - MARGIN, y - MARGIN, end - x + 2 * MARGIN, 2 * MARGIN + 1};
            if (end++ == x) continue;
            SDL_IntersectRect(&around, &all, &around);
            for (int v = 0; v < around.h; v++)
                memset(again + SIDE * (around.y + v) + around.x, 255, (size_t)around.w);
            SDL_UnionRect(&around, &box, &box); /* an empty one does not count */
        }
    }
    return box;
}

/* The strokes or the seed have changed: make the texture again where the guide changes, or everywhere. */
void follow_strokes(brush *b, int everywhere) {
    static uint8_t guide[SIDE * SIDE], mask[SIDE * SIDE], again[SIDE * SIDE];
    const txm_image guide_image = square(guide, 1), mask_image = square(mask, 1);
    const txm_image where = square(again, 1);
    if (!make_guide(b, &guide_image, &mask_image)) return;
    SDL_Rect box = mark_changes(b, guide, mask, everywhere, again);
    memcpy(b->guide, guide, sizeof guide);
    memcpy(b->mask, mask, sizeof mask);
    /* this does the remaining steps of an earlier stroke; they are shown together with the new ones */
    if (box.w > 0 && !check(b, texpatch_again(b->job, &where, &guide_image, &mask_image, b->seed,
                                              &b->env)))
        return;
    if (b->more) SDL_UnionRect(&b->box, &box, &box);
    b->box = box;
    b->more |= box.w > 0;
}

/* Do as many steps as a frame has time for. After each of them there is a picture to show. */
void advance_texture(brush *b) {
    const Uint32 start = SDL_GetTicks();
    while (b->more && SDL_GetTicks() - start < FRAME)
        if (!check(b, texpatch_step(b->job, &b->env, &b->more))) return;
    uint8_t *corner = b->picture + 3 * (SIDE * b->box.y + b->box.x);
    const txm_image part = {corner, b->box.w, b->box.h, 3, TXM_U8, 3 * SIDE};
    if (!check(b, texpatch_draw(b->job, 0, b->box.x, b->box.y, &b->env, part))) return;
    SDL_UpdateTexture(b->texture, &b->box, corner, 3 * SIDE);
}
