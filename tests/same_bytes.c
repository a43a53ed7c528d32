/* same_bytes.c - print one hash over models and pictures: same_bytes THREADS
   SPDX-License-Identifier: MIT OR Unlicense

   test_same_bytes.sh builds this with each compiler and optimisation level and runs it on several
   numbers of threads; all must print the same line. Everything here is in integers.            */
#define TEXSYN_IMPLEMENTATION
#include "texsyn.h"
#include "testkit.h"

enum { SIDE = 64, WIDTH = 96, HEIGHT = 80 };

static void give_up(const char *what, const txm_env *env) {
    fprintf(stderr, "%s: %s\n", what, env->message);
    exit(1);
}

/* Hash over the model and the synthesis of one drawn exemplar. */
static uint64_t run(int channels, int tileable, txm_env *env, uint64_t hash) {
    static uint8_t pixels[SIDE * SIDE * 4], out[WIDTH * HEIGHT * 4], bytes[1 << 16];
    txm_rng rng = txm_rng_make(7, (uint64_t)channels);
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            for (int c = 0; c < channels; c++) {
                int v = ((x * 5 + y * 3 + c * 40) % 64) * 2 + ((x / 4 + y / 4) % 3) * 20;
                v += (int)txm_rng_below(&rng, 60);
                pixels[(y * SIDE + x) * channels + c] = (uint8_t)v;
            }
        }
    }

    texsyn_learn_desc learn;
    texsyn_synth_desc synth;
    texsyn_model *model = NULL;
    size_t size = 0;
    memset(&learn, 0, sizeof learn);
    learn.example.pixels = pixels;
    learn.example.width = learn.example.height = SIDE;
    learn.example.channels = channels;
    learn.max_distance = 12;
    if (texsyn_learn(&learn, env, &model) != TXM_OK) give_up("learn", env);
    if (texsyn_save(model, env, bytes, sizeof bytes, &size) != TXM_OK) give_up("save", env);
    hash = tk_hash(hash, bytes, size);

    memset(&synth, 0, sizeof synth);
    synth.model = model;
    synth.width = WIDTH;
    synth.height = HEIGHT;
    synth.tileable = tileable;
    synth.seed = 3;
    txm_image image = {out, WIDTH, HEIGHT, channels, TXM_U8, 0};
    if (texsyn_synthesize(&synth, env, image) != TXM_OK) give_up("synthesize", env);
    hash = tk_hash(hash, out, (size_t)WIDTH * HEIGHT * (size_t)channels);
    texsyn_free(model);
    return hash;
}

int main(int argc, char **argv) {
    int threads = argc > 1 ? atoi(argv[1]) : 1;
    txm_env env;
    memset(&env, 0, sizeof env);
    if (threads == 0) env.parallel_for = tk_parallel_reverse; /* one thread, backwards */
    if (threads > 1) {
        env.parallel_for = tk_parallel_threads;
        env.parallel_user = &threads;
    }
    uint64_t hash = run(1, 0, &env, 0);
    hash = run(3, 1, &env, hash);
    hash = run(4, 0, &env, hash);
    printf("%08lx%08lx\n", (unsigned long)(hash >> 32), (unsigned long)(hash & 0xffffffffu));
    return 0;
}
