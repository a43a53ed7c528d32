/* testkit.h - what the unit tests of every texkit header share
   SPDX-License-Identifier: MIT OR Unlicense

   WHAT IT DOES
     Environments that misbehave on purpose: an allocator that counts, poisons and fails at a
     chosen call, a progress callback that cancels at a chosen call, parallel-for hooks that run
     the indices backwards or on real threads. And the test that builds and runs a quick start.

   HOW TO USE IT
     #include the four headers cmocka wants, cmocka.h, then this file. Everything is static inline.
     Link with -lpthread where the C library keeps threads apart. Run tests from the root folder.

     Every allocation in turn made to fail, alone and from there on:

       for (int onward = 0; onward < 2; onward++) {
           for (long k = 1;; k++) {
               tk_memory memory = {0};
               tk_progress progress = {0};
               memory.fail_at = k;
               memory.fail_onward = onward;
               txm_env env = tk_env(&memory, &progress);
               txm_status status = the_call(&env);
               if (memory.calls < k) { assert_int_equal(status, TXM_OK); break; } // never failed
               assert_int_equal(status, TXM_OUT_OF_MEMORY);
               assert_int_equal(tk_leaks(&memory), 0);
           }
       }

     Every cancel point: the same with progress.cancel_at, progress.calls and TXM_CANCELLED.  */
#ifndef TESTKIT_H
#define TESTKIT_H

#include "texmath.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- memory ----------------------------------------------------------------------------- */

/* An allocator that counts. All zero = never fails. For one thread at a time. */
typedef struct tk_memory {
    long fail_at;       /* the call of this number fails, from 1; 0 = none                     */
    int fail_onward;    /* non-zero: every later call fails too                                */
    size_t limit;       /* bytes: requests that take live_bytes above this fail; 0 = none      */
    long calls;         /* out: allocations asked for, the failed ones too                     */
    long failed;        /* out: allocations refused                                            */
    long blocks;        /* out: blocks not yet released                                        */
    size_t live_bytes;  /* out: bytes not yet released                                         */
    size_t peak_bytes;  /* out: highest live_bytes so far                                      */
    size_t total_bytes; /* out: sum over all granted requests                                  */
    long errors;        /* out: releases of blocks that are not ours, or overrun at either end */
} tk_memory;

/* Before and after each block: the guards tell an overrun and a foreign or repeated release. */
enum { TK_HEAD = 16, TK_TAIL = 8, TK_GUARD = 0x5a, TK_FRESH = 0xa5, TK_DEAD = 0xdd };

/* allocate hook; fills with a pattern, so that nobody may count on zeros */
static inline void *tk_allocate(void *user, size_t bytes) {
    tk_memory *m = (tk_memory *)user;
    m->calls++;
    int refuse =
        m->fail_at && (m->calls == m->fail_at || (m->fail_onward && m->calls > m->fail_at));
    if (m->limit && (bytes > m->limit || m->live_bytes > m->limit - bytes)) refuse = 1;
    unsigned char *p = NULL;
    if (!refuse && bytes <= SIZE_MAX - TK_HEAD - TK_TAIL)
        p = (unsigned char *)malloc(TK_HEAD + bytes + TK_TAIL);
    if (!p) {
        m->failed++;
        return NULL;
    }
    memset(p, TK_GUARD, TK_HEAD);
    memcpy(p, &bytes, sizeof bytes);
    memset(p + TK_HEAD, TK_FRESH, bytes);
    memset(p + TK_HEAD + bytes, TK_GUARD, TK_TAIL);
    m->blocks++;
    m->live_bytes += bytes;
    m->total_bytes += bytes;
    if (m->live_bytes > m->peak_bytes) m->peak_bytes = m->live_bytes;
    return p + TK_HEAD;
}

/* release hook */
static inline void tk_release(void *user, void *block) {
    tk_memory *m = (tk_memory *)user;
    if (!block) { /* the contract of txm_env: never with NULL */
        m->errors++;
        return;
    }
    unsigned char *p = (unsigned char *)block - TK_HEAD;
    size_t bytes, i;
    memcpy(&bytes, p, sizeof bytes);
    for (i = sizeof bytes; i < TK_HEAD; i++) {
        if (p[i] != TK_GUARD) { /* the size cannot be trusted: leave it alone */
            m->errors++;
            return;
        }
    }
    for (i = 0; i < TK_TAIL; i++) m->errors += p[TK_HEAD + bytes + i] != TK_GUARD;
    m->blocks--;
    m->live_bytes -= bytes;
    memset(p, TK_DEAD, TK_HEAD + bytes);
    free(p);
}

/* 0 if everything allocated was released, once, intact */
static inline long tk_leaks(const tk_memory *m) {
    return m->errors ? -m->errors : m->blocks;
}

/* ---- progress --------------------------------------------------------------------------- */

/* A progress callback that watches its contract and cancels at a chosen call. All zero = never. */
typedef struct tk_progress {
    long cancel_at; /* the call of this number, and all later ones, cancel; from 1; 0 = none   */
    long calls;     /* out: calls so far                                                       */
    long late;      /* out: calls after the one that cancelled; a good module makes none       */
    long errors;    /* out: fractions outside 0..1 (NaN too), falling ones, missing stage names */
    float last;     /* out: the last fraction                                                  */
} tk_progress;

static inline int tk_report(void *user, float fraction, const char *stage) {
    tk_progress *p = (tk_progress *)user;
    p->late += p->cancel_at && p->calls >= p->cancel_at;
    p->calls++;
    if (!(fraction >= p->last && fraction <= 1.0f) || !stage || !stage[0]) p->errors++;
    p->last = fraction;
    return p->cancel_at && p->calls >= p->cancel_at;
}

/* ---- parallel for ----------------------------------------------------------------------- */

/* Backwards: finds results that depend on the order of the indices. */
static inline void tk_parallel_reverse(void *user, int count, void (*body)(void *, int),
                                       void *context) {
    (void)user;
    for (int i = count - 1; i >= 0; i--) body(context, i);
}

typedef struct tk_worker {
    void (*body)(void *, int);
    void *context;
    int first, step, count;
} tk_worker;

static inline void *tk_worker_run(void *arg) {
    const tk_worker *w = (const tk_worker *)arg;
    for (int i = w->first; i < w->count; i += w->step) w->body(w->context, i);
    return NULL;
}

/* On real threads, index i on thread i mod n. user: NULL for 4 threads, or int * (1..64).
   A thread that cannot be started runs its share on the caller. */
static inline void tk_parallel_threads(void *user, int count, void (*body)(void *, int),
                                       void *context) {
    enum { MOST = 64 };
    pthread_t threads[MOST];
    tk_worker workers[MOST];
    int started[MOST], n = user ? *(const int *)user : 4;
    if (n < 1) n = 1;
    if (n > MOST) n = MOST;
    for (int t = 0; t < n; t++) {
        workers[t].body = body;
        workers[t].context = context;
        workers[t].first = t;
        workers[t].step = n;
        workers[t].count = count;
        started[t] = t && pthread_create(&threads[t], NULL, tk_worker_run, &workers[t]) == 0;
    }
    for (int t = 0; t < n; t++) {
        if (!started[t]) tk_worker_run(&workers[t]);
    }
    for (int t = 0; t < n; t++) {
        if (started[t]) pthread_join(threads[t], NULL);
    }
}

/* ---- environments ----------------------------------------------------------------------- */

/* An env with these hooks; each may be NULL. Add .parallel_for afterwards if wanted. */
static inline txm_env tk_env(tk_memory *memory, tk_progress *progress) {
    txm_env env;
    memset(&env, 0, sizeof env);
    if (memory) {
        env.allocate = tk_allocate;
        env.release = tk_release;
        env.memory_user = memory;
    }
    if (progress) {
        env.progress = tk_report;
        env.progress_user = progress;
    }
    return env;
}

/* ---- comparing -------------------------------------------------------------------------- */

/* FNV-1a over bytes: one number that stands for a whole output; chain by passing the last one
   as start, first 0. */
static inline uint64_t tk_hash(uint64_t start, const void *bytes, size_t count) {
    const unsigned char *p = (const unsigned char *)bytes;
    uint64_t h = start ? start : 14695981039346656037u;
    for (size_t i = 0; i < count; i++) h = (h ^ p[i]) * 1099511628211u;
    return h;
}

/* ---- the quick start of a header -------------------------------------------------------- */

/* Copy the QUICK START block of a head comment into a file. The block runs from the line after
   the heading to the next heading, a line with a capital letter after three spaces or fewer.
   0 if there was one. */
static inline int tk_extract_quick_start(const char *header, const char *source) {
    char line[512];
    int inside = 0, lines = 0;
    FILE *in = fopen(header, "rb");
    FILE *out = in ? fopen(source, "wb") : NULL;
    while (out && fgets(line, sizeof line, in)) {
        size_t indent = strspn(line, " ");
        int heading = indent <= 3 && line[indent] >= 'A' && line[indent] <= 'Z';
        if (heading && inside) break;
        if (inside) lines += fputs(line, out) >= 0;
        if (heading && strncmp(line + indent, "QUICK START", 11) == 0) inside = 1;
    }
    if (in) fclose(in);
    if (out && fclose(out) != 0) lines = 0;
    return lines ? 0 : -1;
}

/* Build the quick start of e.g. ("texmath.h", "texmath") in build/tests and run it; the compiler is
   $CC or cc, the headers are found in the current folder. 0 if it built without a warning and its
   main returned 0. The program's output is left in build/tests/NAME_quick.txt. */
static inline int tk_quick_start(const char *header, const char *name) {
    char source[256], command[1024];
    const char *cc = getenv("CC");
    if (!cc || !cc[0]) cc = "cc";
    if (strlen(name) > 64 || strlen(cc) > 128) return -1;
    if (system("mkdir -p build/tests") != 0) return -1;
    snprintf(source, sizeof source, "build/tests/%s_quick.c", name);
    if (tk_extract_quick_start(header, source) != 0) return -1;
    snprintf(command, sizeof command,
             "cd build/tests && %s -std=c99 -Wall -Wextra -Wpedantic -Werror -I../.. "
             "%s_quick.c -o %s_quick -lm && ./%s_quick > %s_quick.txt",
             cc, name, name, name, name);
    return system(command);
}

#endif /* TESTKIT_H */
