/* synthesise.c - a photograph in, a model and new texture out
   SPDX-License-Identifier: MIT OR Unlicense

   synthesise PHOTO MODEL.txs OUT.png

   All that a program needs to embed texsyn.h. Images are read and written by stb_image and
   stb_image_write, linked from tools/files/stb.c; any other library will do.                    */
#define TEXSYN_IMPLEMENTATION
#include "texsyn.h"

#include <stb/stb_image.h>
#include <stb/stb_image_write.h>
#include <stdio.h>

enum { SIZE = 512 }; /* pixels a side of the result */

/* The library calls this from time to time; a result other than 0 cancels it. */
static int show_progress(void *user, float fraction, const char *stage) {
    (void)user;
    fprintf(stderr, "\r%s %3.0f %%  ", stage, 100.0 * (double)fraction);
    return 0;
}

int main(int argc, char **argv) {
    if (argc != 4) {
        fprintf(stderr, "usage: synthesise PHOTO MODEL.txs OUT.png\n");
        return 2;
    }
    txm_env env = {0}; /* malloc, one thread */
    env.progress = show_progress;
    texsyn_model *model = NULL;
    unsigned char *bytes = NULL, *pixels = NULL;
    size_t size = 0;
    const char *failed = NULL;

    /* learn: zeros in the descriptor mean the defaults */
    texsyn_learn_desc learn = {0};
    learn.example.pixels = stbi_load(argv[1], &learn.example.width, &learn.example.height, NULL, 3);
    learn.example.channels = 3;
    if (!learn.example.pixels) failed = stbi_failure_reason();
    else if (texsyn_learn(&learn, &env, &model) != TXM_OK) failed = env.message;

    /* keep the model: a few thousand bytes that make this texture in any size */
    if (!failed) {
        texsyn_save(model, &env, NULL, 0, &size); /* how many bytes? */
        bytes = malloc(size);
        FILE *file = fopen(argv[2], "wb");
        if (!bytes || !file || texsyn_save(model, &env, bytes, size, &size) != TXM_OK ||
            fwrite(bytes, 1, size, file) != size)
            failed = "cannot write the model";
        if (file && fclose(file) != 0) failed = "cannot write the model";
    }

    /* synthesise: another seed makes another picture */
    texsyn_synth_desc synth = {model, SIZE, SIZE, 1, 0, 1}; /* tileable, default quality, seed 1 */
    txm_image out = {NULL, SIZE, SIZE, 3, TXM_U8, 0};
    if (!failed && !(out.pixels = pixels = malloc(SIZE * SIZE * 3))) failed = "no memory";
    if (!failed && texsyn_synthesize(&synth, &env, out) != TXM_OK) failed = env.message;
    if (!failed && !stbi_write_png(argv[3], SIZE, SIZE, 3, pixels, 0))
        failed = "cannot write the picture";

    if (failed) fprintf(stderr, "\nsynthesise: %s\n", failed);
    else fprintf(stderr, "\n%s: %lu bytes\n", argv[2], (unsigned long)size);
    free(pixels);
    free(bytes);
    texsyn_model_free(model);
    stbi_image_free(learn.example.pixels);
    return failed != NULL;
}
