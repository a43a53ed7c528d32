/* same_bytes.c - print one hash over models, pictures and tile sets: same_bytes THREADS
   SPDX-License-Identifier: MIT OR Unlicense

   test_same_bytes.sh builds this with each compiler and optimisation level and runs it on several
   numbers of threads; all must print the same line. Everything here is in integers, but for what
   lies between the pixels of an exemplar in triangles, and repair.                              */
#define TEXSYN_IMPLEMENTATION
#include "texsyn.h"
#define TEXTILES_IMPLEMENTATION
#include "textiles.h"
#include "testkit.h"

enum { SIDE = 64, WIDTH = 96, HEIGHT = 80 };

static void give_up(const char *what, const txm_env *env) {
    fprintf(stderr, "%s: %s\n", what, env->message);
    exit(1);
}

/* The exemplar: slopes, patches and noise. */
static void draw_exemplar(uint8_t *pixels, int channels) {
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
}

/* Hash over the model and the synthesis of one drawn exemplar. */
static uint64_t run(int channels, int tileable, txm_env *env, uint64_t hash) {
    static uint8_t pixels[SIDE * SIDE * 4], out[WIDTH * HEIGHT * 4], bytes[1 << 16];
    draw_exemplar(pixels, channels);

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

/* Hash over a tile set of the exemplar: its pixels, and where they come from. A second map, of floats,
   goes along. */
static uint64_t run_tiles(textiles_kind kind, int channels, txm_env *env, uint64_t hash) {
    enum { TILE = 32 };
    static uint8_t pixels[SIDE * SIDE * 4], bytes[(TILE + 1) * (TILE + 1) * 4];
    static float floats[SIDE * SIDE], values[(TILE + 1) * (TILE + 1)];
    draw_exemplar(pixels, channels);
    for (int i = 0; i < SIDE * SIDE; i++) floats[i] = (float)pixels[i * channels] / 3.0f;

    const txm_image maps[2] = {{pixels, SIDE, SIDE, channels, TXM_U8, 0},
                               {floats, SIDE, SIDE, 1, TXM_F32, 0}};
    const textiles_exemplar exemplar = {maps, 2};
    textiles_desc desc;
    textiles_set *set = NULL;
    memset(&desc, 0, sizeof desc);
    desc.kind = kind;
    desc.exemplars = &exemplar;
    desc.exemplar_count = 1;
    desc.size = TILE;
    desc.reduced = 1;
    desc.seed = 3;
    if (textiles_make(&desc, env, &set) != TXM_OK) give_up("tiles", env);
    const int side = TILE + (kind == TEXTILES_TRIANGLE);
    for (int t = 0; t < textiles_count(set); t++) {
        const txm_image out[2] = {{bytes, side, side, channels, TXM_U8, 0},
                                  {values, side, side, 1, TXM_F32, 0}};
        for (int m = 0; m < 2; m++) {
            if (textiles_draw_tile(set, t, 0, m, env, out[m]) != TXM_OK) give_up("draw", env);
        }
        for (int y = 0; y < side; y++) {
            for (int x = 0; x < (kind == TEXTILES_TRIANGLE ? side - y : side); x++) {
                float from[2] = {0, 0};
                const int e = textiles_source(set, t, x, y, from);
                if (e != 0) give_up("source", env);
                hash = tk_hash(hash, from, sizeof from);
                hash = tk_hash(hash, bytes + (y * side + x) * channels, (size_t)channels);
                hash = tk_hash(hash, values + y * side + x, sizeof(float));
            }
        }
    }
    textiles_free(set);
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
    hash = run_tiles(TEXTILES_WANG, 3, &env, hash);
    hash = run_tiles(TEXTILES_TRIANGLE, 1, &env, hash);
    printf("%08lx%08lx\n", (unsigned long)(hash >> 32), (unsigned long)(hash & 0xffffffffu));
    return 0;
}
