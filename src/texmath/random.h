#ifndef TEXMATH_RANDOM_H
#define TEXMATH_RANDOM_H

#include "config.h"

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

/* uniform in low..high, both included, low <= high; the whole range of int is allowed */
static inline int txm_rng_range(txm_rng *rng, int low, int high) {
    const uint64_t n = (uint64_t)((int64_t)high - low) + 1; /* 1..2^32 */
    return (int)(low + (int64_t)((txm_rng_next(rng) * n) >> 32));
}

/* uniform multiples of 2^-24 in [0, 1): all are equally likely, 1 is never returned */
static inline float txm_rng_float(txm_rng *rng) {
    return (float)(txm_rng_next(rng) >> 8) * (1.0f / 16777216.0f);
}

/* uniform multiples of 2^-53 in [0, 1); takes two steps of the generator */
static inline double txm_rng_double(txm_rng *rng) {
    const uint64_t high = txm_rng_next(rng) >> 5, low = txm_rng_next(rng) >> 6;
    return (double)((high << 26) | low) * (1.0 / 9007199254740992.0);
}

/* Put the items in random order, all orders equally likely (Fisher and Yates). */
static inline void txm_shuffle(txm_rng *rng, int *items, int count) {
    for (int i = count - 1; i > 0; i--) {
        const int j = (int)txm_rng_below(rng, (uint32_t)i + 1);
        const int item = items[i];
        items[i] = items[j];
        items[j] = item;
    }
}

/* ---- sorting ---------------------------------------------------------------------------- */

typedef struct txm_pair {
    uint32_t key, value;
} txm_pair;

/* A key in the order of the floats: a < b gives key(a) < key(b), and -0 comes before +0. */
static inline uint32_t txm_sort_key(float x) {
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits & 0x80000000u ? ~bits : bits | 0x80000000u;
}

/* Sort by ascending key; pairs with equal keys keep their order (stable).

   Counting sort by each byte of the key, lowest first; a byte that all keys share is skipped.
   scratch  room for count pairs; its contents are lost
   cost     O(count), 8 KiB of stack on 64-bit machines                                    */
static inline void txm_sort_pairs(txm_pair *pairs, txm_pair *scratch, size_t count) {
    size_t next[4][256];
    txm_pair *from = pairs, *to = scratch;
    memset(next, 0, sizeof next);
    for (size_t i = 0; i < count; i++) {
        for (int b = 0; b < 4; b++) next[b][(pairs[i].key >> (8 * b)) & 255]++;
    }
    for (int b = 0; b < 4 && count > 1; b++) {
        size_t sum = 0;
        if (next[b][(pairs[0].key >> (8 * b)) & 255] == count) continue;
        for (int d = 0; d < 256; d++) { /* from how many to where the first goes */
            const size_t n = next[b][d];
            next[b][d] = sum;
            sum += n;
        }
        for (size_t i = 0; i < count; i++) to[next[b][(from[i].key >> (8 * b)) & 255]++] = from[i];
        txm_pair *t = from;
        from = to;
        to = t;
    }
    if (from != pairs) memcpy(pairs, from, count * sizeof *pairs);
}

#endif /* TEXMATH_RANDOM_H */
