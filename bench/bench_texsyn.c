/* bench_texsyn.c - seconds, memory and model sizes of texsyn.h: bench_texsyn EXEMPLAR...
   SPDX-License-Identifier: MIT OR Unlicense

   The first table sweeps the size of the exemplar and of the output for the first picture, so that
   the growth is visible; the second has a line for each picture; the third compares this build with
   one for TEXSYN_NO_SIMD, which lies in plain/ beside it. What is compared is run in turn, and of
   several runs the fastest counts, so that other work on the machine has little effect.

   bench_texsyn --once EXEMPLAR does one picture once and prints the CPU seconds of both stages. */
#define _XOPEN_SOURCE 700 /* clock_gettime, popen, setenv */
#define TEXSYN_IMPLEMENTATION
#include "files/image_io.h"
#include "texsyn.h"

#include "bench.h"

#include <stdio.h>

enum { RUNS = 2, MAX_OUT = 2048, COMPARED = 3 };

/* ---- measuring --------------------------------------------------------------------------- */

typedef struct result {
    double seconds, cpu; /* of the fastest run; processor time of all threads */
    size_t peak;         /* bytes that the library held at most, besides what it got */
} result;

static const result nothing_yet = {1e30, 1e30, 0};

typedef struct stopwatch {
    double wall, cpu;
    size_t held;
} stopwatch;

static stopwatch start(void) {
    stopwatch w = {clock_of(CLOCK_MONOTONIC), clock_of(CLOCK_PROCESS_CPUTIME_ID),
                   memory.live_bytes};
    memory.peak_bytes = memory.live_bytes;
    return w;
}

static void stop(const stopwatch *w, result *r) {
    double wall = clock_of(CLOCK_MONOTONIC) - w->wall;
    double cpu = clock_of(CLOCK_PROCESS_CPUTIME_ID) - w->cpu;
    if (wall < r->seconds) r->seconds = wall;
    if (cpu < r->cpu) r->cpu = cpu;
    r->peak = memory.peak_bytes - w->held;
}

static texsyn_model *learn(txm_image exemplar, int threads, result *r) {
    texsyn_model *model;
    txm_env env = make_env(&threads);
    texsyn_learn_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.example = exemplar;
    stopwatch w = start();
    if (texsyn_learn(&desc, &env, &model) != TXM_OK) give_up("learn", env.message);
    stop(&w, r);
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
    stopwatch w = start();
    if (texsyn_synthesize(&desc, &env, out) != TXM_OK) give_up("synthesize", env.message);
    stop(&w, r);
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

static void line(const char *stage, int side, const result *one, const result *two, int bytes) {
    double pixels = (double)side * (double)side;
    printf("%-6s %4d x %-4d %8.3f %9.3f %8.2f %12.2f %12.1f", stage, side, side, one->seconds,
           two->seconds, one->seconds / two->seconds, one->cpu / (pixels * 1e-6),
           (double)one->peak / pixels);
    if (bytes) printf(" %10d", bytes);
    printf("\n");
    fflush(stdout);
}

static void sweep(const char *path, const txm_image *picture, void *pixels) {
    printf("%s, %d channels: seconds by size, on 1 and on 2 threads\n\n", file_name(path),
           picture->channels);
    printf("stage  size        1 thread 2 threads  speedup  CPU s/Mpixel peak B/pixel  model B\n");
    texsyn_model *model = NULL;
    for (int side = 64; side <= 512; side *= 2) {
        txm_image exemplar = resized(picture, side);
        result one = nothing_yet, two = nothing_yet;
        int bytes = 0;
        for (int i = 0; i < RUNS; i++) {
            texsyn_model_free(model);
            model = learn(exemplar, 1, &one);
            bytes = (int)model_bytes(model);
            texsyn_model_free(model);
            model = learn(exemplar, 2, &two);
        }
        line("learn", side, &one, &two, bytes);
        free(exemplar.pixels);
    }
    texsyn_model_free(model);
    result unused = nothing_yet;
    model = learn(*picture, 2, &unused);
    for (int side = 256; side <= MAX_OUT; side *= 2) {
        result one = nothing_yet, two = nothing_yet;
        for (int i = 0; i < RUNS; i++) {
            synthesise(model, side, 1, pixels, &one);
            synthesise(model, side, 2, pixels, &two);
        }
        line("synth", side, &one, &two, 0);
    }
    texsyn_model_free(model);
}

static void one_line(const char *path, const txm_image *picture, void *pixels) {
    result learned = nothing_yet, made = nothing_yet;
    texsyn_model *model = learn(*picture, 1, &learned);
    synthesise(model, 512, 1, pixels, &made);
    printf("%-16s %4d x %-4d %d %11.2f %13.2f %12d %6d %8lu\n", file_name(path), picture->width,
           picture->height, picture->channels, learned.cpu, made.cpu / (512.0 * 512.0 * 1e-6),
           texsyn_clique_count(model), texsyn_level_count(model),
           (unsigned long)model_bytes(model));
    fflush(stdout);
    texsyn_model_free(model);
}

/* ---- this build against the one without SIMD --------------------------------------------- */

static int once(const char *program, const char *path, double best[2]) {
    char command[4096];
    double got[2] = {0, 0};
    snprintf(command, sizeof command, "'%s' --once '%s'", program, path);
    FILE *pipe = popen(command, "r");
    int ok = pipe && fscanf(pipe, "%lf %lf", &got[0], &got[1]) == 2;
    if (pipe && pclose(pipe) != 0) ok = 0;
    for (int i = 0; i < 2 && ok; i++)
        if (best[i] <= 0 || got[i] < best[i]) best[i] = got[i];
    return ok;
}

static void compare(const char *program, const char *path) {
    char plain[2048];
    double simd[2] = {0, 0}, scalar[2] = {0, 0};
    snprintf(plain, sizeof plain, "%.*s/plain/%s", (int)(file_name(program) - program - 1), program,
             file_name(program));
    if (access(plain, X_OK) != 0) return;
    for (int i = 0; i < COMPARED; i++)
        if (!once(program, path, simd) || !once(plain, path, scalar)) give_up(plain, "failed");
    printf("\nCPU seconds for %s on one thread\n\n", file_name(path));
    printf("stage              SIMD  TEXSYN_NO_SIMD  ratio\n");
    printf("learn          %8.2f %15.2f %6.1f\n", simd[0], scalar[0], scalar[0] / simd[0]);
    printf("synth 512x512  %8.2f %15.2f %6.1f\n", simd[1], scalar[1], scalar[1] / simd[1]);
}

int main(int argc, char **argv) {
    const char *why;
    const int is_once = argc == 3 && !strcmp(argv[1], "--once");
    void *pixels = malloc((size_t)MAX_OUT * MAX_OUT * 4);
    if (argc < 2) give_up("usage", "bench_texsyn [--once] EXEMPLAR...");
    if (!pixels) give_up("output", "out of memory");
    env_let_threads_sleep(argv);
    for (int i = is_once ? 2 : 0; i < argc; i++) { /* picture 1 twice: as 0 for the sweep */
        const char *path = argv[i ? i : 1];
        txm_image picture;
        if (!image_read(path, 0, &picture, &why)) give_up(path, why);
        if (is_once) {
            result learned = nothing_yet, made = nothing_yet;
            texsyn_model *model = learn(picture, 1, &learned);
            synthesise(model, 512, 1, pixels, &made);
            printf("%f %f\n", learned.cpu, made.cpu);
            texsyn_model_free(model);
        } else if (i == 0) {
            sweep(path, &picture, pixels);
            printf("\none thread, synthesis of 512 x 512\n\n"
                   "exemplar         size        ch learn CPU s  CPU s/Mpixel clique types levels"
                   "    bytes\n");
        } else {
            one_line(path, &picture, pixels);
        }
        image_free(&picture);
    }
    if (!is_once) compare(argv[0], argv[1]);
    free(pixels);
    return 0;
}
