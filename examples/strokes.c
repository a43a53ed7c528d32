/* strokes.c - a photograph and two strokes in, a texture whose edges follow the strokes out
   SPDX-License-Identifier: MIT OR Unlicense

   strokes PHOTO OUT.png

   How texedges.h and texpatch.h work together. The gray values of the photograph are divided into
   layers. A dark path and a bright spot, drawn as smooth lines, become as rough as the edges of those
   layers are in the photograph, and then a guide picture: which layer belongs where. The texture is
   made to follow the guide. brush does the same in a window, as you draw.                       */
#define TEXEDGES_IMPLEMENTATION
#include "texedges.h"
#define TEXPATCH_IMPLEMENTATION
#include "texpatch.h"

#include <stb/stb_image.h>
#include <stb/stb_image_write.h>
#include <stdio.h>
#include <stdlib.h>

enum { SIDE = 512, LEVELS = 4 }; /* pixels of the result; layers, 0 is the darkest */

static const txm_vec2 path[] = {{-10, 430}, {60, 410}, {120, 360}, {150, 290}, {165, 210}, {200, 150},
                                {260, 130}, {310, 165}, {325, 230}, {335, 300}, {370, 350}, {430, 350},
                                {480, 300}, {525, 260}};
static const txm_vec2 spot[] = {{180, 330}, {230, 290}, {280, 330}, {285, 400}, {230, 440}, {180, 410}};
static const texedges_stroke strokes[] = {
    {path, sizeof path / sizeof *path, 0, 0, 26},         /* open, layer 0, 26 pixels wide */
    {spot, sizeof spot / sizeof *spot, 1, LEVELS - 1, 0}, /* closed: filled with layer 3   */
};

static txm_image image_of(void *pixels, int width, int height, int channels) {
    const txm_image image = {pixels, width, height, channels, TXM_U8, 0};
    return image;
}

/* The layer of each pixel of the photograph, and the guide of the result. */
static txm_status make_guide(txm_image photo, txm_image layers, txm_image guide, txm_image mask,
                             txm_env *env) {
    texedges_set *edges = NULL, *rough = NULL;
    texedges_desc find = {0}; /* zeros mean the defaults */
    find.image = photo;
    find.levels = LEVELS;
    find.smooth = 1.5f; /* pixels: single grains are no edges */
    find.least = 40;    /* nor are regions with shorter boundaries */
    texedges_control control = {0};
    control.strokes = strokes;
    control.stroke_count = sizeof strokes / sizeof *strokes;
    control.background = -1; /* away from the strokes the texture is free */
    control.seed = 1;

    txm_status status = texedges_find(&find, env, &edges);
    if (status == TXM_OK) status = texedges_layers(&find, edges, env, &layers);
    control.edges = edges;
    if (status == TXM_OK) status = texedges_disturb(&control, SIDE, SIDE, env, &rough);
    if (status == TXM_OK) status = texedges_guide(&control, rough, env, &guide, &mask);
    texedges_set_free(rough);
    texedges_set_free(edges);
    return status;
}

int main(int argc, char **argv) {
    static unsigned char guide[SIDE * SIDE], mask[SIDE * SIDE], pixels[3 * SIDE * SIDE];
    if (argc != 3) {
        fprintf(stderr, "usage: strokes PHOTO OUT.png\n");
        return 2;
    }
    txm_env env = {0}; /* malloc, silent, one thread; receives the message after a failure */
    const char *failed = NULL;
    int width = 0, height = 0;
    unsigned char *photo = stbi_load(argv[1], &width, &height, NULL, 3);
    unsigned char *layers = malloc((size_t)width * (size_t)height + 1);
    if (!photo) failed = stbi_failure_reason();
    else if (!layers) failed = "no memory";

    const txm_image photo_image = image_of(photo, width, height, 3);
    const txm_image out = image_of(pixels, SIDE, SIDE, 3);
    texpatch_exemplar exemplar = {0};
    exemplar.maps = &photo_image;
    exemplar.guide = image_of(layers, width, height, 1);
    texpatch_desc desc = {0};
    desc.exemplars = &exemplar;
    desc.exemplar_count = desc.map_count = 1;
    desc.width = desc.height = SIDE;
    desc.guide = image_of(guide, SIDE, SIDE, 1);
    desc.guide_mask = image_of(mask, SIDE, SIDE, 1);
    if (!failed &&
        (make_guide(photo_image, exemplar.guide, desc.guide, desc.guide_mask, &env) != TXM_OK ||
         texpatch_make(&desc, &env, &out) != TXM_OK))
        failed = env.message;
    if (!failed && !stbi_write_png(argv[2], SIDE, SIDE, 3, pixels, 0))
        failed = "cannot write the picture";

    if (failed) fprintf(stderr, "strokes: %s\n", failed);
    stbi_image_free(photo);
    free(layers);
    return failed != NULL;
}
