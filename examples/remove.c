/* remove.c - a photograph in, the same without an object out
   SPDX-License-Identifier: MIT OR Unlicense

   remove PHOTO OUT.png X,Y,W,H [X,Y,W,H ...]

   The short way through texinpaint.h for plain pictures: a picture, a mask, one call. Each X,Y,W,H is
   the box around an object in pixels; the ellipse in it is what is removed, so make the box a little
   larger than the object. Lines that end at the ellipse are continued behind the object.          */
#define TEXINPAINT_IMPLEMENTATION
#include "texinpaint.h"

#include <stb/stb_image.h>
#include <stb/stb_image_write.h>
#include <stdio.h>
#include <stdlib.h>

static txm_image image_of(void *pixels, int width, int height, int channels) {
    const txm_image image = {pixels, width, height, channels, TXM_U8, 0};
    return image;
}

/* White in the ellipse of the box. */
static void draw_ellipse(unsigned char *mask, int width, int height, const int box[4]) {
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            const double u = (x + 0.5 - box[0]) / box[2] * 2 - 1;
            const double v = (y + 0.5 - box[1]) / box[3] * 2 - 1;
            if (u * u + v * v < 1) mask[(size_t)y * (size_t)width + (size_t)x] = 255;
        }
    }
}

int main(int argc, char **argv) {
    int width = 0, height = 0, channels = 0;
    const char *failed = NULL;
    if (argc < 4) {
        fprintf(stderr, "usage: remove PHOTO OUT.png X,Y,W,H [X,Y,W,H ...]\n");
        return 2;
    }
    txm_env env = {0}; /* malloc, silent, one thread; receives the message after a failure */
    unsigned char *photo = stbi_load(argv[1], &width, &height, &channels, 0);
    if (!photo) failed = stbi_failure_reason();
    unsigned char *mask = calloc((size_t)width + 1, (size_t)height + 1);
    if (!mask) failed = "no memory";
    for (int i = 3; i < argc && !failed; i++) {
        int box[4];
        if (sscanf(argv[i], "%d,%d,%d,%d", &box[0], &box[1], &box[2], &box[3]) != 4 ||
            box[2] <= 0 || box[3] <= 0)
            failed = "a box is X,Y,W,H, such as 40,60,120,80";
        else draw_ellipse(mask, width, height, box);
    }

    /* what is left at zero takes its default. The result may go where the photograph is: after a failure
       that is unchanged */
    texinpaint_desc desc = {0};
    desc.image = image_of(photo, width, height, channels);
    desc.mask = image_of(mask, width, height, 1);
    desc.seed = 1; /* another seed, another completion */
    if (!failed && texinpaint_complete(&desc, &env, &desc.image) != TXM_OK) failed = env.message;
    if (!failed && !stbi_write_png(argv[2], width, height, channels, photo, 0))
        failed = "cannot write the picture";

    if (failed) fprintf(stderr, "remove: %s\n", failed);
    stbi_image_free(photo);
    free(mask);
    return failed != NULL;
}
