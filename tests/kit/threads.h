/* threads.h - parallel-for hooks that run the indices backwards or on real threads
   SPDX-License-Identifier: MIT OR Unlicense

   Link with -lpthread where the C library keeps threads apart. */
#ifndef THREADS_H
#define THREADS_H

#include <pthread.h>
#include <stddef.h>
#include <stdint.h>

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

static inline void tk_worker_run(const tk_worker *w) {
    for (int i = w->first; i < w->count; i += w->step) w->body(w->context, i);
}

enum { TK_THREADS = 64 };

/* Threads that wait for work until the program ends: to make new ones for every call takes longer
   than the calls, under the sanitizers many times longer. */
typedef struct tk_pool {
    pthread_mutex_t busy, lock; /* busy: held over a whole call; lock: for what follows */
    pthread_cond_t begin, end;
    long call[TK_THREADS]; /* the number of the last call that each is to work on */
    int left;              /* threads that are not done with this call            */
    tk_worker work[TK_THREADS];
} tk_pool;

static inline tk_pool *tk_the_pool(void) {
    static tk_pool pool = {PTHREAD_MUTEX_INITIALIZER, PTHREAD_MUTEX_INITIALIZER,
                           PTHREAD_COND_INITIALIZER,  PTHREAD_COND_INITIALIZER, {0}, 0, {{0}}};
    return &pool;
}

static inline void *tk_pool_thread(void *number) {
    tk_pool *p = tk_the_pool();
    const long t = (long)(intptr_t)number;
    pthread_mutex_lock(&p->lock);
    for (long done = 0;; done = p->call[t]) {
        while (p->call[t] == done) pthread_cond_wait(&p->begin, &p->lock);
        pthread_mutex_unlock(&p->lock);
        tk_worker_run(&p->work[t]);
        pthread_mutex_lock(&p->lock);
        if (--p->left == 0) pthread_cond_signal(&p->end);
    }
    return NULL;
}

/* Is there a thread of this number? Made when it is first wanted. */
static inline int tk_pool_has(long t) {
    static int made[TK_THREADS]; /* 1: yes, 2: it could not be made */
    pthread_t thread;
    if (!made[t]) {
        made[t] = pthread_create(&thread, NULL, tk_pool_thread, (void *)(intptr_t)t) == 0 ? 1 : 2;
        if (made[t] == 1) pthread_detach(thread);
    }
    return made[t] == 1;
}

/* On real threads, index i on thread i mod n, thread 0 being the caller. user: NULL for 4 threads, or
   int * (1..64). A thread that cannot be started runs its share on the caller. For one call at a
   time: another one that begins meanwhile is run by its caller alone. */
static inline void tk_parallel_threads(void *user, int count, void (*body)(void *, int),
                                       void *context) {
    tk_pool *p = tk_the_pool();
    int n = user ? *(const int *)user : 4, is_pool = pthread_mutex_trylock(&p->busy) == 0;
    if (n < 1 || !is_pool) n = 1;
    if (n > TK_THREADS) n = TK_THREADS;
    tk_worker own[TK_THREADS];
    int count_own = 0;
    pthread_mutex_lock(&p->lock);
    for (int t = 0; t < n && t < count; t++) {
        const tk_worker w = {body, context, t, n, count};
        if (t == 0 || !tk_pool_has(t)) {
            own[count_own++] = w;
            continue;
        }
        p->work[t] = w;
        p->call[t]++;
        p->left++;
    }
    pthread_cond_broadcast(&p->begin);
    pthread_mutex_unlock(&p->lock);
    for (int i = 0; i < count_own; i++) tk_worker_run(&own[i]);
    if (!is_pool) return;
    pthread_mutex_lock(&p->lock);
    while (p->left) pthread_cond_wait(&p->end, &p->lock);
    pthread_mutex_unlock(&p->lock);
    pthread_mutex_unlock(&p->busy);
}

#endif /* THREADS_H */
