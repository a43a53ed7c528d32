/* wall.c - the maps of a material in, a larger tileable material out
   SPDX-License-Identifier: MIT OR Unlicense

   wall OUT COLOR.png [MAP.png ...]

   The short way through texpatch.h: one descriptor, one call. COLOR is a photograph; MAPs (height,
   roughness, ...) have its size and stay in register with it. OUT-0.png, OUT-1.png, ... are the maps
   of a texture of 512 x 512 pixels that repeats without seams.                                  */
#define TEXPATCH_IMPLEMENTATION
#include "texpatch.h"

#include <stb/stb_image.h>
#include <stb/stb_image_write.h>
#include <stdio.h>
#include <stdlib.h>

enum { SIDE = 512 }; /* pixels of the result */

static txm_image image_of(void *pixels, int width, int height, int channels) {
    const txm_image image = {pixels, width, height, channels, TXM_U8, 0};
    return image;
}

int main(int argc, char **argv) {
    const int count = argc - 2;
    if (count < 1 || count > TEXPATCH_MAX_MAPS) {
        fprintf(stderr, "usage: wall OUT COLOR.png [MAP.png ...]\n");
        return 2;
    }
    txm_env env = {0}; /* malloc, silent, one thread; receives the message after a failure */
    txm_image maps[TEXPATCH_MAX_MAPS] = {{0}}, out[TEXPATCH_MAX_MAPS] = {{0}};
    texpatch_map kinds[TEXPATCH_MAX_MAPS] = {{0}};
    const char *failed = NULL;

    for (int i = 0; i < count && !failed; i++) {
        int width, height, channels;
        unsigned char *pixels = stbi_load(argv[2 + i], &width, &height, &channels, 0);
        if (!pixels) failed = stbi_failure_reason();
        maps[i] = pixels ? image_of(pixels, width, height, channels) : maps[i];
        out[i] = image_of(malloc((size_t)SIDE * SIDE * 4), SIDE, SIDE, maps[i].channels);
        if (!out[i].pixels) failed = "no memory";
        kinds[i].is_data = i > 0; /* heights are averaged as they are, colours in linear light */
    }
    kinds[0].weight = 1; /* pieces are matched by colour; the other maps follow */

    /* what is left at zero takes its default: here the size of the pieces, the number of passes, and
       that a lattice, such as that of bricks, is looked for and kept */
    texpatch_exemplar exemplar = {0};
    exemplar.maps = maps;
    texpatch_desc desc = {0};
    desc.exemplars = &exemplar;
    desc.exemplar_count = 1;
    desc.map_count = count;
    desc.maps = kinds;
    desc.width = desc.height = SIDE;
    desc.tileable = TEXPATCH_TILE_X | TEXPATCH_TILE_Y;
    desc.seed = 1; /* another seed, another texture */
    if (!failed && texpatch_make(&desc, &env, out) != TXM_OK) failed = env.message;

    for (int i = 0; i < count && !failed; i++) {
        char path[1024];
        snprintf(path, sizeof path, "%s-%d.png", argv[1], i);
        if (!stbi_write_png(path, SIDE, SIDE, out[i].channels, out[i].pixels, 0))
            failed = "cannot write a picture";
    }
    if (failed) fprintf(stderr, "wall: %s\n", failed);
    for (int i = 0; i < count; i++) {
        stbi_image_free(maps[i].pixels);
        free(out[i].pixels);
    }
    return failed != NULL;
}
