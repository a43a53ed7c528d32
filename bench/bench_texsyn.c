/* bench_texsyn.c - seconds, memory and model sizes of texsyn.h: bench_texsyn EXEMPLAR...
   SPDX-License-Identifier: MIT OR Unlicense

   The first table sweeps the size of the exemplar and of the output for the first picture, so that
   the growth is visible; the second has one line per picture. Times are wall-clock seconds, the
   better of two runs. "per pixel" is peak memory over the pixels of the exemplar or the output.  */
#define _XOPEN_SOURCE 700 /* clock_gettime */
#define TEXSYN_IMPLEMENTATION
#include "image_io.h"
#include "texsyn.h"

#include <stdio.h>
#include <time.h>

enum { RUNS = 2, MAX_OUT = 2048 };

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void give_up(const char *what, const char *why) {
    fprintf(stderr, "bench_texsyn: %s: %s\n", what, why);
    exit(1);
}

/* ---- the environment: counted memory, a given number of threads --------------------------- */

typedef union block_head {
    size_t bytes;
    long double align_1;
    void *align_2;
} block_head;

static size_t live_bytes, peak_bytes;

static void *allocate(void *user, size_t bytes) {
    (void)user;
    block_head *head = (block_head *)malloc(sizeof *head + bytes);
    if (!head) return NULL;
    head->bytes = bytes;
#ifdef _OPENMP
#pragma omp critical(memory)
#endif
    {
        live_bytes += bytes;
        if (live_bytes > peak_bytes) peak_bytes = live_bytes;
    }
    return head + 1;
}

static void release(void *user, void *block) {
    (void)user;
    block_head *head = (block_head *)block - 1;
#ifdef _OPENMP
#pragma omp critical(memory)
#endif
    live_bytes -= head->bytes;
    free(head);
}

static void parallel_for(void *user, int count, void (*body)(void *context, int index),
                         void *context) {
    int threads = *(const int *)user;
    (void)threads;
#ifdef _OPENMP
#pragma omp parallel for schedule(dynamic) num_threads(threads)
#endif
    for (int i = 0; i < count; i++) body(context, i);
}

static txm_env make_env(int *threads) {
    txm_env env;
    memset(&env, 0, sizeof env);
    env.allocate = allocate;
    env.release = release;
    if (*threads > 1) env.parallel_for = parallel_for;
    env.parallel_user = threads;
    return env;
}

/* ---- one measurement --------------------------------------------------------------------- */

typedef struct result {
    double seconds;
    size_t peak;
} result;

static texsyn_model *learn(txm_image exemplar, int threads, result *r) {
    texsyn_model *model = NULL;
    txm_env env = make_env(&threads);
    r->seconds = 1e30;
    for (int i = 0; i < RUNS; i++) {
        texsyn_learn_desc desc;
        memset(&desc, 0, sizeof desc);
        desc.example = exemplar;
        texsyn_free(model);
        size_t before = peak_bytes = live_bytes;
        double start = now();
        if (texsyn_learn(&desc, &env, &model) != TXM_OK) give_up("learn", env.message);
        double seconds = now() - start;
        if (seconds < r->seconds) r->seconds = seconds;
        r->peak = peak_bytes - before;
    }
    return model;
}

static void synthesise(const texsyn_model *model, int side, int threads, void *pixels, result *r) {
    txm_env env = make_env(&threads);
    texsyn_synth_desc desc;
    txm_image out;
    memset(&desc, 0, sizeof desc);
    memset(&out, 0, sizeof out);
    desc.model = model;
    desc.width = desc.height = out.width = out.height = side;
    desc.seed = 1;
    out.channels = texsyn_channels(model);
    out.pixels = pixels;
    r->seconds = 1e30;
    for (int i = 0; i < RUNS; i++) {
        size_t before = peak_bytes = live_bytes;
        double start = now();
        if (texsyn_synthesize(&desc, &env, out) != TXM_OK) give_up("synthesize", env.message);
        double seconds = now() - start;
        if (seconds < r->seconds) r->seconds = seconds;
        r->peak = peak_bytes - before;
    }
}

static size_t model_bytes(const texsyn_model *model) {
    size_t size = 0;
    texsyn_save(model, NULL, NULL, 0, &size);
    return size;
}

/* side x side pixels of the picture, mirrored at its borders where it is too small */
static txm_image resized(const txm_image *in, int side) {
    txm_image out = *in;
    size_t c = (size_t)in->channels;
    out.width = out.height = side;
    uint8_t *to = (uint8_t *)malloc((size_t)side * (size_t)side * c);
    if (!to) give_up("exemplar", "out of memory");
    out.pixels = to;
    for (int y = 0; y < side; y++) {
        int v = y % (2 * in->height);
        if (v >= in->height) v = 2 * in->height - 1 - v;
        for (int x = 0; x < side; x++) {
            int u = x % (2 * in->width);
            if (u >= in->width) u = 2 * in->width - 1 - u;
            size_t from = ((size_t)v * (size_t)in->width + (size_t)u) * c;
            memcpy(to, (const uint8_t *)in->pixels + from, c);
            to += c;
        }
    }
    return out;
}

/* ---- the tables -------------------------------------------------------------------------- */

static const char *file_name(const char *path) {
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

static void line(const char *stage, int side, const result one, const result two) {
    double pixels = (double)side * (double)side;
    printf("%-6s %4d x %-4d %9.3f %9.3f %7.2f %12.2f %10.0f\n", stage, side, side, one.seconds,
           two.seconds, one.seconds / two.seconds, one.seconds / (pixels * 1e-6),
           (double)one.peak / pixels);
    fflush(stdout);
}

static void sweep(const char *path, const txm_image *picture, void *pixels) {
    result one, two;
    printf("%s, %d channels\n\n", file_name(path), picture->channels);
    printf("stage  size          1 thread 2 threads speedup s/megapixel bytes/pixel\n");
    for (int side = 128; side <= 512; side *= 2) {
        txm_image exemplar = resized(picture, side);
        texsyn_free(learn(exemplar, 1, &one));
        texsyn_free(learn(exemplar, 2, &two));
        line("learn", side, one, two);
        free(exemplar.pixels);
    }
    texsyn_model *model = learn(*picture, 2, &one);
    for (int side = 256; side <= MAX_OUT; side *= 2) {
        synthesise(model, side, 1, pixels, &one);
        synthesise(model, side, 2, pixels, &two);
        line("synth", side, one, two);
    }
    texsyn_free(model);
}

static void one_line(const char *path, const txm_image *picture, void *pixels) {
    result learned, made;
    texsyn_model *model = learn(*picture, 1, &learned);
    synthesise(model, 512, 1, pixels, &made);
    printf("%-18s %4d x %-4d %d %8.2f %10d %6d %8lu %12.2f\n", file_name(path), picture->width,
           picture->height, picture->channels, learned.seconds, texsyn_clique_count(model),
           texsyn_level_count(model), (unsigned long)model_bytes(model),
           made.seconds / (512.0 * 512.0 * 1e-6));
    fflush(stdout);
    texsyn_free(model);
}

int main(int argc, char **argv) {
    const char *why;
    void *pixels = malloc((size_t)MAX_OUT * MAX_OUT * 4);
    if (argc < 2) give_up("usage", "bench_texsyn EXEMPLAR...");
    if (!pixels) give_up("output", "out of memory");
    for (int i = 0; i < argc; i++) { /* picture 1 twice: as 0 for the sweep */
        const char *path = argv[i ? i : 1];
        txm_image picture;
        if (!image_read(path, 0, &picture, &why)) give_up(path, why);
        if (i == 0) {
            sweep(path, &picture, pixels);
            printf("\none thread, synthesis of 512 x 512\n\n"
                   "exemplar            size       ch  learn s    cliques levels    bytes"
                   " s/megapixel\n");
        } else {
            one_line(path, &picture, pixels);
        }
        image_free(&picture);
    }
    free(pixels);
    return 0;
}
