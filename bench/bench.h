/* bench.h - what the benchmarks share: clocks, and an environment that counts memory
   SPDX-License-Identifier: MIT OR Unlicense

   Include a texkit header first, and define _XOPEN_SOURCE before that.                          */
#ifndef BENCH_H
#define BENCH_H

#include "env.h"

#include <stdio.h>
#include <time.h>
#include <unistd.h>

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

static env_memory memory;

static inline txm_env make_env(int *threads) {
    txm_env env;
    memset(&env, 0, sizeof env);
    env_fill(&env, &memory, threads);
    return env;
}

#endif /* BENCH_H */
