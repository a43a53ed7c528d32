/* texmath.h - v0.1.0 - the common ground of the texkit headers
   SPDX-License-Identifier: MIT                                (full text: end of file)

   WHAT IT DOES
     Small things that every texkit header needs: status codes, the environment (allocator,
     progress and cancel, parallel-for), checked size arithmetic, image views, a random number
     generator, vectors, matrices, quaternions and colour spaces.

   (head comment to be completed)                                                        */
#ifndef TEXMATH_H
#define TEXMATH_H

#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define TEXMATH_VERSION "0.1.0"

#ifdef __cplusplus
extern "C" {
#endif

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

/* ---- environment ------------------------------------------------------------------------ */

/* How a call allocates, reports and spreads its work. All zero (or a NULL pointer) means
   malloc/free, silent, serial. An env belongs to one call at a time; a model or job copies
   what it needs of the allocator, so the env need not outlive it, the user pointer must. */
typedef struct txm_env {
    void *(*allocate)(void *user, size_t bytes); /* NULL = malloc; may return NULL           */
    void (*release)(void *user, void *block);    /* NULL = free; never called with NULL      */
    void *memory_user;                           /* first argument of the two                */
    /* Called from the calling thread only. fraction 0..1 of the whole call, never falling;
       stage: a short English word or two. Returning non-zero cancels. NULL = silent.        */
    int (*progress)(void *user, float fraction, const char *stage);
    void *progress_user;
    /* Must call body(context, i) once for each i in 0..count-1, in any order, on any threads,
       and return when all are done. Results do not depend on how. NULL = serial.            */
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

/* bytes of the environment's memory, not cleared; NULL if there is none or bytes is 0 */
static inline void *txm_alloc(const txm_env *env, size_t bytes) {
    if (bytes == 0) return NULL;
    return env && env->allocate ? env->allocate(env->memory_user, bytes) : malloc(bytes);
}

/* Give back what txm_alloc returned; NULL is allowed. */
static inline void txm_free(const txm_env *env, void *block) {
    if (!block) return;
    if (env && env->release) env->release(env->memory_user, block);
    else free(block);
}

/* Report progress; non-zero: stop, the caller wants no more. */
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

/* ---- images ----------------------------------------------------------------------------- */

typedef enum txm_sample {
    TXM_U8 = 0, /* 0..255, sRGB-encoded unless a function says otherwise */
    TXM_F32 = 1 /* nominally 0..1                                        */
} txm_sample;

/* A view of pixels that the caller owns: rows from top to bottom, channels interleaved. */
typedef struct txm_image {
    void *pixels;      /* uint8_t or float, first sample of the top row; aligned for its type */
    int width, height; /* pixels, 1 or more                                                   */
    int channels;      /* 1..4: gray, gray + alpha, RGB, RGBA; 0 = 1                          */
    txm_sample sample; /* sample type; 0 = 8 bit                                              */
    ptrdiff_t stride;  /* bytes from one row to the next; 0 = packed rows                     */
} txm_image;

/* ---- random numbers --------------------------------------------------------------------- */

/* PCG32 (O'Neill 2014): 64 bits of state, the same stream on every machine. */
typedef struct txm_rng {
    uint64_t state;
} txm_rng;

/* Mix 64 bits into 64 bits, bijectively (the finaliser of SplitMix64). */
static inline uint64_t txm_hash(uint64_t x) {
    x ^= x >> 30;
    x *= 0xbf58476d1ce4e5b9u;
    x ^= x >> 27;
    x *= 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

/* A generator for (seed, stream): different pairs give unrelated streams. */
static inline txm_rng txm_rng_make(uint64_t seed, uint64_t stream) {
    txm_rng rng;
    rng.state = txm_hash(seed + 0x9e3779b97f4a7c15u * (txm_hash(stream) | 1u));
    return rng;
}

/* 32 uniform bits */
static inline uint32_t txm_rng_next(txm_rng *rng) {
    uint64_t s = rng->state;
    rng->state = s * 6364136223846793005u + 1442695040888963407u;
    uint32_t x = (uint32_t)(((s >> 18) ^ s) >> 27), r = (uint32_t)(s >> 59);
    return (x >> r) | (x << ((32u - r) & 31u));
}

/* uniform in 0..n-1, n >= 1 (bias below n / 2^32) */
static inline uint32_t txm_rng_below(txm_rng *rng, uint32_t n) {
    return (uint32_t)(((uint64_t)txm_rng_next(rng) * n) >> 32);
}

#ifdef __cplusplus
}
#endif
#endif /* TEXMATH_H */
