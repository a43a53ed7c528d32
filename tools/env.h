/* env.h - an environment for the libraries: memory that is counted, threads of OpenMP
   SPDX-License-Identifier: MIT OR Unlicense                                                     */
#ifndef ENV_H
#define ENV_H

#include "texmath.h"

/* What a library holds through an environment. */
typedef struct env_memory {
    size_t live_bytes, peak_bytes; /* not yet released; the most that ever were */
} env_memory;

/* The allocator and the threads of env. memory and threads must outlive it. */
void env_fill(txm_env *env, env_memory *memory, int *threads);

/* Cores of this machine; 1 without OpenMP. */
int env_cores(void);

/* OpenMP's threads spin for milliseconds while they wait, which is bad when something else wants the
   cores. This starts the program again with threads that sleep: OpenMP reads how they wait before
   main begins. Returns when they do so already, or where the program cannot be started again. */
void env_let_threads_sleep(char **argv);

/* Work that allocates the same amounts again and again: what is released, up to a quarter of a gigabyte, stays
   with the program, as fresh memory takes longer to come by than many a thing takes to compute. Does
   nothing where the C library cannot. */
void env_keep_memory(void);

#endif /* ENV_H */
