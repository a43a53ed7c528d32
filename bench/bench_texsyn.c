/* bench_texsyn.c - seconds, memory and model sizes of texsyn.h: bench_texsyn EXEMPLAR...
   SPDX-License-Identifier: MIT OR Unlicense

   The first table sweeps the size of the exemplar and of the output for the first picture, so that
   the growth is visible; the second has a line for each picture; the third compares this build with
   one for TEXSYN_NO_SIMD, which lies in plain/ beside it. What is compared is run in turn, and of
   several runs the fastest counts, so that other work on the machine has little effect.

   bench_texsyn --once EXEMPLAR does one picture once and prints the CPU seconds of both stages. */
#define _XOPEN_SOURCE 700 /* clock_gettime, popen */
#define TEXSYN_IMPLEMENTATION
#include "texsyn.h"

#include "bench.h"

enum { RUNS = 2, MAX_OUT = 2048 };
static uint8_t output[MAX_OUT * MAX_OUT * 4];

/* ---- measuring --------------------------------------------------------------------------- */

static texsyn_model *learn(txm_image exemplar, int threads, result *r) {
    texsyn_model *model;
    txm_env env = make_env(&threads);
    texsyn_learn_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.example = exemplar;
    const watch w = start();
    if (texsyn_learn(&desc, &env, &model) != TXM_OK) give_up("learn", env.message);
    stop(&w, r);
    return model;
}

static void synthesise(const texsyn_model *model, int side, int threads, result *r) {
    txm_env env = make_env(&threads);
    texsyn_synth_desc desc;
    txm_image out;
    memset(&desc, 0, sizeof desc);
    memset(&out, 0, sizeof out);
    desc.model = model;
    desc.width = desc.height = out.width = out.height = side;
    desc.seed = 1;
    out.channels = texsyn_channels(model);
    out.pixels = output;
    const watch w = start();
    if (texsyn_synthesize(&desc, &env, out) != TXM_OK) give_up("synthesize", env.message);
    stop(&w, r);
}

static size_t model_bytes(const texsyn_model *model) {
    size_t size = 0;
    texsyn_save(model, NULL, NULL, 0, &size);
    return size;
}

/* ---- the tables -------------------------------------------------------------------------- */

static void line(const char *stage, int side, const result *one, const result *two, int bytes) {
    double pixels = (double)side * (double)side;
    printf("%-6s %4d x %-4d %8.3f %9.3f %8.2f %12.2f %12.1f", stage, side, side, one->seconds,
           two->seconds, one->seconds / two->seconds, one->cpu / (pixels * 1e-6),
           (double)one->peak / pixels);
    if (bytes) printf(" %10d", bytes);
    printf("\n");
    fflush(stdout);
}

static void sweep(const char *path, const txm_image *picture) {
    printf("%s, %d channels: seconds by size, on 1 and on 2 threads\n\n", file_name(path),
           picture->channels);
    printf("stage  size        1 thread 2 threads  speedup  CPU s/Mpixel peak B/pixel  model B\n");
    texsyn_model *model = NULL;
    for (int side = 64; side <= 512; side *= 2) {
        txm_image exemplar = resized(picture, side);
        result one = no_result, two = no_result;
        int bytes = 0;
        for (int i = 0; i < RUNS; i++) {
            texsyn_model_free(model);
            model = learn(exemplar, 1, &one);
            bytes = (int)model_bytes(model);
            texsyn_model_free(model);
            model = learn(exemplar, 2, &two);
        }
        line("learn", side, &one, &two, bytes);
        image_free(&exemplar);
    }
    texsyn_model_free(model);
    result unused = no_result;
    model = learn(*picture, 2, &unused);
    for (int side = 256; side <= MAX_OUT; side *= 2) {
        result one = no_result, two = no_result;
        for (int i = 0; i < RUNS; i++) {
            synthesise(model, side, 1, &one);
            synthesise(model, side, 2, &two);
        }
        line("synth", side, &one, &two, 0);
    }
    texsyn_model_free(model);
}

static void one_line(const char *path, const txm_image *picture) {
    result learned = no_result, made = no_result;
    texsyn_model *model = learn(*picture, 1, &learned);
    synthesise(model, 512, 1, &made);
    print_picture(path, picture);
    printf(" %11.2f %13.2f %12d %6d %8lu\n", learned.cpu, made.cpu / (512.0 * 512.0 * 1e-6),
           texsyn_clique_count(model), texsyn_level_count(model),
           (unsigned long)model_bytes(model));
    texsyn_model_free(model);
}

/* ---- this build against the one without SIMD --------------------------------------------- */

static void once(const txm_image *picture, double seconds[STAGES]) {
    result learned = no_result, made = no_result;
    texsyn_model *model = learn(*picture, 1, &learned);
    synthesise(model, 512, 1, &made);
    seconds[0] = learned.cpu;
    seconds[1] = made.cpu;
    texsyn_model_free(model);
}

int main(int argc, char **argv) {
    static const tables t = {
        "bench_texsyn",
        sweep,
        "one thread, synthesis of 512 x 512\n\n"
        "exemplar         size        ch learn CPU s  CPU s/Mpixel clique types levels"
        "    bytes\n",
        one_line,
        once,
        3,
        "one thread, CPU, model and texture of",
        {"learn", "synth 512 x 512"},
        "TEXSYN_NO_SIMD"};
    return run_tables(&t, argc, argv);
}
