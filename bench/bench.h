/* bench.h - what the benchmarks share: watches, counted memory, runs over pictures, with and without
   SIMD
   SPDX-License-Identifier: MIT OR Unlicense

   Define _XOPEN_SOURCE before the first include. Link with env.c and image_io.c.                */
#ifndef BENCH_H
#define BENCH_H

#include "env.h"
#include "files/image_io.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

static inline void give_up(const char *what, const char *why) {
    fprintf(stderr, "bench: %s: %s\n", what, why);
    exit(1);
}

/* ---- clocks; two threads on paper --------------------------------------------------------- */

static inline double clock_of(clockid_t which) {
    struct timespec t;
    clock_gettime(which, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* What two cores would save, from the times that one takes: a hook that runs index after index, each
   counted for the thread that would be free first. Other work on the machine does not change it. */
static double saved_by_two; /* seconds of the processor */

static inline void parallel_on_paper(void *user, int count, void (*body)(void *context, int index),
                                     void *context) {
    double busy[2] = {0, 0};
    (void)user;
    for (int i = 0; i < count; i++) {
        const double began = clock_of(CLOCK_PROCESS_CPUTIME_ID);
        body(context, i);
        busy[busy[1] < busy[0]] += clock_of(CLOCK_PROCESS_CPUTIME_ID) - began;
    }
    saved_by_two += busy[0] < busy[1] ? busy[0] : busy[1];
}

enum { ON_PAPER = -2 }; /* as the number of threads: run them so */

/* ---- the environment: counted memory, a given number of threads --------------------------- */

static env_memory memory;

static inline txm_env make_env(int *threads) {
    txm_env env;
    memset(&env, 0, sizeof env);
    env_fill(&env, &memory, threads);
    if (*threads == ON_PAPER) env.parallel_for = parallel_on_paper;
    return env;
}

/* ---- measuring ---------------------------------------------------------------------------- */

/* Of one run, or of the fastest of several. */
typedef struct result {
    double seconds, cpu; /* of the clock; processor time of all threads                      */
    double saved;        /* of cpu, by two threads: of the last run with ON_PAPER            */
    size_t peak;         /* bytes that the library held at most, the result included         */
} result;

static const result no_result = {1e30, 1e30, 0, 0};

typedef struct watch {
    double wall, cpu, saved;
    size_t held;
} watch;

static inline watch start(void) {
    const watch w = {clock_of(CLOCK_MONOTONIC), clock_of(CLOCK_PROCESS_CPUTIME_ID),
                     saved_by_two, memory.live_bytes};
    memory.peak_bytes = memory.live_bytes;
    return w;
}

/* Enter a run in r, which begins as no_result. */
static inline void stop(const watch *w, result *r) {
    const double wall = clock_of(CLOCK_MONOTONIC) - w->wall;
    const double cpu = clock_of(CLOCK_PROCESS_CPUTIME_ID) - w->cpu;
    if (wall < r->seconds) r->seconds = wall;
    if (cpu < r->cpu) r->cpu = cpu;
    r->saved = saved_by_two - w->saved;
    r->peak = memory.peak_bytes - w->held;
}

/* bytes as MiB */
static inline double mebibytes(size_t bytes) {
    return (double)bytes / 1048576;
}

/* ---- benchmarks of pictures --------------------------------------------------------------- */

/* the file's name without its folders */
static inline const char *file_name(const char *path) {
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

/* the first columns of a line for a picture: its name and size */
static inline void print_picture(const char *path, const txm_image *picture) {
    printf("%-16s %4d x %-4d %d", file_name(path), picture->width, picture->height,
           picture->channels);
}

/* The picture, continued by reflection to side x side pixels; for image_free(). */
static inline txm_image resized(const txm_image *in, int side) {
    txm_image out;
    const size_t pixel = (size_t)in->channels * txm_sample_bytes(in->sample);
    if (!image_new(side, side, in->channels, in->sample, &out)) give_up("picture", "no memory");
    for (int y = 0; y < side; y++) {
        const int v = y % (2 * in->height), row = v < in->height ? v : 2 * in->height - 1 - v;
        for (int x = 0; x < side; x++) {
            const int u = x % (2 * in->width), column = u < in->width ? u : 2 * in->width - 1 - u;
            memcpy((uint8_t *)txm_image_row(&out, y) + (size_t)x * pixel,
                   (const uint8_t *)txm_image_row_const(in, row) + (size_t)column * pixel, pixel);
        }
    }
    return out;
}

enum { STAGES = 2 }; /* what --once times: at most so many stages */

/* The tables of one benchmark. */
typedef struct tables {
    const char *program;
    void (*first)(const char *path, const txm_image *picture); /* tables of the first picture */
    const char *head; /* of the table that has a line for each picture                      */
    void (*line)(const char *path, const txm_image *picture);
    /* Do it once on one thread; seconds receives the time of each stage. */
    void (*once)(const txm_image *picture, double seconds[STAGES]);
    int runs;                   /* of each program, of which the fastest counts             */
    const char *compared;       /* "one thread, ... of": title of the comparison            */
    const char *stages[STAGES]; /* their names; NULL: there is none                         */
    const char *plain;          /* the macro that leaves SIMD out                           */
} tables;

/* Let a program do it once, and keep the fastest seconds of each stage. */
static inline void run_once(const tables *t, const char *program, const char *path,
                            double best[STAGES]) {
    char command[4096];
    double got[STAGES];
    snprintf(command, sizeof command, "'%s' --once '%s'", program, path);
    FILE *pipe = popen(command, "r");
    int ok = pipe != NULL;
    for (int i = 0; i < STAGES && t->stages[i] && ok; i++) ok = fscanf(pipe, "%lf", &got[i]) == 1;
    if (pipe && pclose(pipe) != 0) ok = 0;
    if (!ok) give_up(program, "failed");
    for (int i = 0; i < STAGES && t->stages[i]; i++)
        if (best[i] <= 0 || got[i] < best[i]) best[i] = got[i];
}

/* This build against the one without SIMD, which lies in plain/ beside it, if it is there. They run
   in turn, so that other work on the machine slows both. */
static inline void compare(const tables *t, const char *program, const char *path) {
    char plain[2048];
    double simd[STAGES] = {0}, scalar[STAGES] = {0};
    snprintf(plain, sizeof plain, "%.*splain/%s", (int)(file_name(program) - program), program,
             file_name(program));
    if (access(plain, X_OK) != 0) return;
    for (int i = 0; i < t->runs; i++) {
        run_once(t, program, path, simd);
        run_once(t, plain, path, scalar);
    }
    printf("\n%s %s: seconds\n\n%-32s SIMD %17s  ratio\n", t->compared, file_name(path), "", t->plain);
    for (int i = 0; i < STAGES && t->stages[i]; i++)
        printf("%-27s %9.3f %17.3f %6.1f\n", t->stages[i], simd[i], scalar[i],
               scalar[i] / simd[i]);
}

/* main of a benchmark: PROGRAM [--once] EXEMPLAR... */
static inline int run_tables(const tables *t, int argc, char **argv) {
    const char *why;
    const int is_once = argc == 3 && !strcmp(argv[1], "--once");
    if (argc < 2) {
        fprintf(stderr, "usage: %s [--once] EXEMPLAR...\n", t->program);
        return 1;
    }
    env_let_threads_sleep(argv);
    for (int i = is_once ? 2 : 1; i < argc; i++) {
        txm_image picture;
        if (!image_read(argv[i], 0, &picture, &why)) give_up(argv[i], why);
        if (is_once) {
            double seconds[STAGES] = {0};
            t->once(&picture, seconds);
            for (int k = 0; k < STAGES && t->stages[k]; k++) printf("%f\n", seconds[k]);
        } else {
            if (i == 1) {
                t->first(argv[i], &picture);
                printf("\n%s", t->head);
            }
            t->line(argv[i], &picture);
            fflush(stdout);
        }
        image_free(&picture);
    }
    if (!is_once) compare(t, argv[0], argv[1]);
    return 0;
}

#endif /* BENCH_H */
