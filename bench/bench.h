/* bench.h - what the benchmarks share: clocks, and an environment that counts memory
   SPDX-License-Identifier: MIT OR Unlicense

   Include a texkit header first, and define _XOPEN_SOURCE before that.                          */
#ifndef BENCH_H
#define BENCH_H

#include <stdio.h>
#include <time.h>
#include <unistd.h>
#ifdef _OPENMP
#include <omp.h>
#endif

static inline double clock_of(clockid_t which) {
    struct timespec t;
    clock_gettime(which, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static inline void give_up(const char *what, const char *why) {
    fprintf(stderr, "bench: %s: %s\n", what, why);
    exit(1);
}

/* ---- the environment: counted memory, a given number of threads --------------------------- */

typedef union block_head {
    size_t bytes;
    long double align_1;
    void *align_2;
} block_head;

static size_t live_bytes, peak_bytes;

static inline void *allocate(void *user, size_t bytes) {
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

static inline void release(void *user, void *block) {
    (void)user;
    block_head *head = (block_head *)block - 1;
#ifdef _OPENMP
#pragma omp critical(memory)
#endif
    live_bytes -= head->bytes;
    free(head);
}

static inline void parallel_for(void *user, int count, void (*body)(void *context, int index),
                         void *context) {
    int threads = *(const int *)user;
    (void)threads;
#ifdef _OPENMP
#pragma omp parallel for schedule(dynamic) num_threads(threads)
#endif
    for (int i = 0; i < count; i++) body(context, i);
}

static inline int all_threads(void) {
#ifdef _OPENMP
    return omp_get_num_procs();
#else
    return 1;
#endif
}

/* Start the program again with threads of OpenMP that sleep while they wait: it reads this before
   main. They would spin, which costs much where other programs run too, and count as CPU seconds. */
static inline void wait_asleep(char **argv) {
    if (getenv("OMP_WAIT_POLICY")) return;
    setenv("OMP_WAIT_POLICY", "passive", 1);
    execv(argv[0], argv);
}

static inline txm_env make_env(int *threads) {
    txm_env env;
    memset(&env, 0, sizeof env);
    env.allocate = allocate;
    env.release = release;
    if (*threads > 1) env.parallel_for = parallel_for;
    env.parallel_user = threads;
    return env;
}

#endif /* BENCH_H */
