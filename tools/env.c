/* env.c - memory that is counted, threads of OpenMP; env.h tells how it is used
   SPDX-License-Identifier: MIT OR Unlicense */
#define _XOPEN_SOURCE 700 /* POSIX: setenv, execv */
#include "env.h"

#include <unistd.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif
#ifdef _OPENMP
#include <omp.h>
#endif

/* Each block is preceded by its size. */
typedef union block_head {
    size_t bytes;
    long double align_1;
    void *align_2;
} block_head;

static void *allocate(void *user, size_t bytes) {
    env_memory *memory = (env_memory *)user;
    if (bytes > SIZE_MAX - sizeof(block_head)) return NULL;
    block_head *head = (block_head *)malloc(sizeof *head + bytes);
    if (!head) return NULL;
    head->bytes = bytes;
#ifdef _OPENMP
#pragma omp critical(memory)
#endif
    {
        memory->live_bytes += bytes;
        if (memory->live_bytes > memory->peak_bytes) memory->peak_bytes = memory->live_bytes;
    }
    return head + 1;
}

static void release(void *user, void *block) {
    env_memory *memory = (env_memory *)user;
    block_head *head = (block_head *)block - 1;
#ifdef _OPENMP
#pragma omp critical(memory)
#endif
    memory->live_bytes -= head->bytes;
    free(head);
}

#ifdef _OPENMP
static void parallel_for(void *user, int count, void (*body)(void *context, int index),
                         void *context) {
    const int threads = *(const int *)user;
#pragma omp parallel for schedule(dynamic) num_threads(threads)
    for (int i = 0; i < count; i++) body(context, i);
}
#endif

void env_fill(txm_env *env, env_memory *memory, int *threads) {
    env->allocate = allocate;
    env->release = release;
    env->memory_user = memory;
#ifdef _OPENMP
    if (*threads > 1) {
        env->parallel_for = parallel_for;
        env->parallel_user = threads;
    }
#else
    (void)threads;
#endif
}

int env_cores(void) {
#ifdef _OPENMP
    return omp_get_num_procs();
#else
    return 1;
#endif
}

void env_let_threads_sleep(char **argv) {
#ifdef _OPENMP
    /* GNU's OpenMP knows the second word: some microseconds of spinning before they sleep */
    if (!getenv("OMP_WAIT_POLICY") && setenv("OMP_WAIT_POLICY", "passive", 0) == 0 &&
        setenv("GOMP_SPINCOUNT", "20000", 0) == 0)
        execv("/proc/self/exe", argv);
#endif
    (void)argv;
}

void env_keep_memory(void) {
#ifdef __GLIBC__
    mallopt(M_MMAP_THRESHOLD, 64 << 20); /* larger blocks still are on their own */
    mallopt(M_TRIM_THRESHOLD, 256 << 20);
#endif
}
