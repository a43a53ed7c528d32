#ifndef TEXMATH_ENV_H
#define TEXMATH_ENV_H

#include "config.h"

/* ---- status ---------------------------------------------------------------------------- */

/* What every call that can fail returns. Zero is success. */
typedef enum txm_status {
    TXM_OK = 0,
    TXM_BAD_ARGUMENT,  /* NULL, a field outside its range, NaN            */
    TXM_TOO_SMALL,     /* the input holds too little to work on           */
    TXM_TOO_LARGE,     /* sizes overflow or exceed a stated limit         */
    TXM_OUT_OF_MEMORY, /* the allocator returned NULL                     */
    TXM_CANCELLED,     /* the progress callback asked to stop             */
    TXM_BAD_DATA       /* bytes that are not a valid file of their kind   */
} txm_status;

/* What a status means, a few English words without a full stop. */
static inline const char *txm_status_text(txm_status status) {
    switch (status) {
    case TXM_OK: return "success";
    case TXM_BAD_ARGUMENT: return "bad argument";
    case TXM_TOO_SMALL: return "too small to work on";
    case TXM_TOO_LARGE: return "too large";
    case TXM_OUT_OF_MEMORY: return "out of memory";
    case TXM_CANCELLED: return "cancelled";
    case TXM_BAD_DATA: return "damaged or foreign data";
    }
    return "unknown status";
}

/* ---- environment ------------------------------------------------------------------------ */

/* How a call allocates, reports progress and runs in parallel. All zero (or a NULL pointer) means
   malloc/free, silent, serial. An env may be used by only one call at a time. A model or
   job copies the allocator, so the env need not outlive it, but what memory_user points to must. */
typedef struct txm_env {
    void *(*allocate)(void *user, size_t bytes); /* NULL = malloc; may return NULL           */
    void (*release)(void *user, void *block);    /* NULL = free; never called with NULL      */
    void *memory_user;                           /* first argument of the two                */
    /* Called from the calling thread only. fraction 0..1 of the whole call, never decreasing;
       stage: one or two short English words. Returning non-zero cancels. NULL = silent.     */
    int (*progress)(void *user, float fraction, const char *stage);
    void *progress_user;
    /* Must call body(context, i) once for each i in 0..count-1, in any order, on any threads,
       and return when all are done. Results do not depend on the order. NULL = serial.      */
    void (*parallel_for)(void *user, int count, void (*body)(void *context, int index),
                         void *context);
    void *parallel_user;
    char message[160]; /* out: after a failure one English line that says what and why       */
} txm_env;

/* Record a failure: copy the message into env (if there is one), return the status. */
static inline txm_status txm_fail(txm_env *env, txm_status status, const char *message) {
    if (env) {
        size_t i = 0;
        for (; message[i] && i + 1 < sizeof env->message; i++) env->message[i] = message[i];
        env->message[i] = 0;
    }
    return status;
}

/* The same, preceded by the name of what is wrong: "name: message". */
static inline txm_status txm_fail_at(txm_env *env, txm_status status, const char *name,
                                     const char *message) {
    char line[sizeof env->message];
    const char *part[3] = {name, ": ", message};
    size_t n = 0;
    for (int k = 0; k < 3; k++) {
        for (const char *s = part[k]; *s && n + 1 < sizeof line; s++) line[n++] = *s;
    }
    line[n] = 0;
    return txm_fail(env, status, line);
}

/* text into line, each # replaced by a number: the first by a, all others by b; cut to fit */
static inline void txm_put_numbers(char *line, size_t capacity, const char *text, uint64_t a,
                                   uint64_t b) {
    size_t n = 0;
    for (; *text && n + 1 < capacity; text++) {
        char digits[20];
        int count = 0;
        if (*text != '#') {
            line[n++] = *text;
            continue;
        }
        for (; a || !count; a /= 10) digits[count++] = (char)('0' + a % 10);
        while (count && n + 1 < capacity) line[n++] = digits[--count];
        a = b;
    }
    line[n] = 0;
}

/* Record a failure whose message has numbers: the first # of text stands for a, the next for b. */
static inline txm_status txm_fail_numbers(txm_env *env, txm_status status, const char *text,
                                          uint64_t a, uint64_t b) {
    char line[sizeof env->message];
    txm_put_numbers(line, sizeof line, text, a, b);
    return txm_fail(env, status, line);
}

/* The same, preceded by the name of what is wrong: "name: text". */
static inline txm_status txm_fail_numbers_at(txm_env *env, txm_status status, const char *name,
                                             const char *text, uint64_t a, uint64_t b) {
    char line[sizeof env->message];
    txm_put_numbers(line, sizeof line, text, a, b);
    return txm_fail_at(env, status, name, line);
}

/* bytes of the environment's memory, not cleared; NULL if there is none or bytes is 0 */
static inline void *txm_alloc(const txm_env *env, size_t bytes) {
    if (bytes == 0) return NULL;
    return env && env->allocate ? env->allocate(env->memory_user, bytes) : malloc(bytes);
}

/* Free what txm_alloc returned; NULL is allowed. */
static inline void txm_free(const txm_env *env, void *block) {
    if (!block) return;
    if (env && env->release) env->release(env->memory_user, block);
    else free(block);
}

/* Report progress; non-zero: the caller has cancelled, stop. */
static inline int txm_progress(const txm_env *env, float fraction, const char *stage) {
    return env && env->progress ? env->progress(env->progress_user, fraction, stage) : 0;
}

/* body(context, 0..count-1), on the environment's threads if it has any */
static inline void txm_parallel_for(const txm_env *env, int count,
                                    void (*body)(void *context, int index), void *context) {
    if (env && env->parallel_for && count > 1) {
        env->parallel_for(env->parallel_user, count, body, context);
    } else {
        for (int i = 0; i < count; i++) body(context, i);
    }
}

/* *bytes = a * b * c; 0 (and *bytes untouched) if that does not fit a size_t */
static inline int txm_mul(size_t a, size_t b, size_t c, size_t *bytes) {
    if (a && b > SIZE_MAX / a) return 0;
    if (a && b && c > SIZE_MAX / a / b) return 0;
    *bytes = a * b * c;
    return 1;
}

/* *sum = a + b; 0 (and *sum untouched) if that does not fit a size_t */
static inline int txm_add(size_t a, size_t b, size_t *sum) {
    if (b > SIZE_MAX - a) return 0;
    *sum = a + b;
    return 1;
}

/* ---- arena ------------------------------------------------------------------------------ */

/* Blocks that are freed together, so that one exit path frees all allocations so far. Keeps
   a copy of the allocator, so it may outlive the env and may lie in one of its own blocks.

       raw block:  | link to the older block | padding | 64-byte aligned result ...        */
typedef struct txm_arena {
    void *(*allocate)(void *user, size_t bytes); /* as in txm_env                 */
    void (*release)(void *user, void *block);
    void *memory_user;
    void *blocks; /* the newest block, which links to the older ones; NULL = none */
    int failed;   /* non-zero: an allocation has failed since the arena was empty, so that a
                     caller can make several and check once                      */
} txm_arena;

enum { TXM_ALIGN = 64 }; /* bytes; a cache line, and enough for any vector unit   */

/* An empty arena on the memory of env (NULL = malloc and free). */
static inline void txm_arena_init(txm_arena *arena, const txm_env *env) {
    arena->allocate = env ? env->allocate : NULL;
    arena->release = env ? env->release : NULL;
    arena->memory_user = env ? env->memory_user : NULL;
    arena->blocks = NULL;
    arena->failed = 0;
}

/* count * size bytes, not cleared, aligned to 64. NULL if that is 0, or if it overflows or there is
   no memory, which also sets arena->failed. Each is one allocation, larger by 64 bytes and a
   pointer. */
static inline void *txm_arena_alloc(txm_arena *arena, size_t count, size_t size) {
    size_t bytes, total;
    void *raw = NULL;
    if (count == 0 || size == 0) return NULL;
    if (txm_mul(count, size, 1, &bytes) && txm_add(bytes, TXM_ALIGN + sizeof(void *), &total))
        raw = arena->allocate ? arena->allocate(arena->memory_user, total) : malloc(total);
    if (!raw) {
        arena->failed = 1;
        return NULL;
    }
    memcpy(raw, &arena->blocks, sizeof(void *));
    arena->blocks = raw;
    unsigned char *first = (unsigned char *)raw + sizeof(void *);
    return first + (TXM_ALIGN - (uintptr_t)first % TXM_ALIGN) % TXM_ALIGN;
}

/* The same, all bytes 0. */
static inline void *txm_arena_zero(txm_arena *arena, size_t count, size_t size) {
    void *block = txm_arena_alloc(arena, count, size);
    if (block) memset(block, 0, count * size);
    return block;
}

/* Free all blocks; the arena is then empty and may be used again (unless it was in one of them). */
static inline void txm_arena_free(txm_arena *arena) {
    const txm_arena copy = *arena;
    void *block = arena->blocks;
    arena->blocks = NULL;
    arena->failed = 0;
    while (block) {
        void *older;
        memcpy(&older, block, sizeof(void *));
        if (copy.release) copy.release(copy.memory_user, block);
        else free(block);
        block = older;
    }
}

#endif /* TEXMATH_ENV_H */
