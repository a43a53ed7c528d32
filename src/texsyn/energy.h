#ifndef TEXSYN_ENERGY_H
#define TEXSYN_ENERGY_H

#include "config.h"

/* ---- energy of a pixel -------------------------------------------------------------------

   The Gibbs energy of a candidate value v at a pixel is the sum of the potentials of all cliques
   that end there. Once the other members are known, the potentials for v = 0..31 lie side by
   side in a table prepared for that end ("row"): for a difference n - v, for example, in the
   reversed potential from entry 31 - n on. A byte per entry, 1/16 nat, 64 for none.

     form 0   row = table - p[o1]                                     one difference
     form 1   row = table + class(p[o2] - p[o3]) * 64 - p[o1]         two, the other one known
     form 2   row = table + (p[o2] - p[o1]) * 64 - p[o1]              two, v in both
     form 3   row = table + classes[p[o1]] * 32                       a value beside a known one */
typedef struct txs_end {
    ptrdiff_t o1, o2, o3;
    const uint8_t *table, *classes;
} txs_end;

enum { TXS_FORMS = 4 };

static const uint8_t txs_no_energy[TXS_VALUES] = {
    TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO,
    TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO,
    TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO,
    TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO};

/* The value with the lowest energy

       e(v) = TXS_FINE * (sum of rows at v - TXS_ZERO count) + single(v) + noise

   With noise of Gumbel's distribution that is a draw from exp(-e) / sum exp(-e), the Gibbs
   sampler's step [4]. Values are kept even ones first, single[] and noise[] in that order, since
   adding bytes as the halves of 16-bit words yields them so. count is even, rows hold 1..127. */
typedef int txs_pick(const uint8_t *const *rows, int count, const int16_t *single,
                     const int16_t *noise);

static int txs_slot_value(int slot) {
    return (slot & 15) * 2 + (slot >> 4);
}

#ifndef TXS_SSE2
static int txs_pick_plain(const uint8_t *const *rows, int count, const int16_t *single,
                          const int16_t *noise) {
    int sum[TXS_VALUES] = {0}, best = 0;
    for (int i = 0; i < count; i++)
        for (int v = 0; v < TXS_VALUES; v++) sum[v] += rows[i][v];
    for (int slot = 0, least = INT_MAX; slot < TXS_VALUES; slot++) {
        int e =
            TXS_FINE * (sum[txs_slot_value(slot)] - TXS_ZERO * count) + single[slot] + noise[slot];
        if (e < least) {
            least = e;
            best = slot;
        }
    }
    return txs_slot_value(best);
}

#else
static __m128i txs_load(const void *p) {
    return _mm_loadu_si128((const __m128i *)p);
}

/* the least of 8 words, in all 8 */
static __m128i txs_least(__m128i m) {
    m = _mm_min_epi16(m, _mm_shuffle_epi32(m, 0x4e));
    m = _mm_min_epi16(m, _mm_shuffle_epi32(m, 0xb1));
    return _mm_min_epi16(m, _mm_shufflehi_epi16(_mm_shufflelo_epi16(m, 0xb1), 0xb1));
}

static int txs_pick_sse2(const uint8_t *const *rows, int count, const int16_t *single,
                         const int16_t *noise) {
    const __m128i low = _mm_set1_epi16(255);
    __m128i e0 = _mm_set1_epi16((short)(-TXS_ZERO * count)), e1 = e0, e2 = e0, e3 = e0;
    for (int i = 0; i < count; i += 2) {
        __m128i a = _mm_add_epi8(txs_load(rows[i]), txs_load(rows[i + 1]));
        __m128i b = _mm_add_epi8(txs_load(rows[i] + 16), txs_load(rows[i + 1] + 16));
        e0 = _mm_add_epi16(e0, _mm_and_si128(a, low));
        e1 = _mm_add_epi16(e1, _mm_and_si128(b, low));
        e2 = _mm_add_epi16(e2, _mm_srli_epi16(a, 8));
        e3 = _mm_add_epi16(e3, _mm_srli_epi16(b, 8));
    }
#define TXS_FINISH(e, k) \
    _mm_add_epi16(_mm_slli_epi16(e, 2), _mm_add_epi16(txs_load(single + (k)), txs_load(noise + (k))))
    e0 = TXS_FINISH(e0, 0);
    e1 = TXS_FINISH(e1, 8);
    e2 = TXS_FINISH(e2, 16);
    e3 = TXS_FINISH(e3, 24);
#undef TXS_FINISH
    __m128i m = txs_least(_mm_min_epi16(_mm_min_epi16(e0, e1), _mm_min_epi16(e2, e3)));
    int first = _mm_movemask_epi8(_mm_packs_epi16(_mm_cmpeq_epi16(e0, m), _mm_cmpeq_epi16(e1, m)));
    int last = _mm_movemask_epi8(_mm_packs_epi16(_mm_cmpeq_epi16(e2, m), _mm_cmpeq_epi16(e3, m)));
    return txs_slot_value(txm_lowest_bit((unsigned)first | (unsigned)last << 16));
}
#endif

#ifdef TXS_AVX2
__attribute__((target("avx2"))) static int
txs_pick_avx2(const uint8_t *const *rows, int count, const int16_t *single, const int16_t *noise) {
    const __m256i low = _mm256_set1_epi16(255);
    __m256i e0 = _mm256_set1_epi16((short)(-TXS_ZERO * count)), e1 = e0;
    for (int i = 0; i < count; i += 2) {
        __m256i a = _mm256_add_epi8(_mm256_loadu_si256((const __m256i *)(const void *)rows[i]),
                                    _mm256_loadu_si256((const __m256i *)(const void *)rows[i + 1]));
        e0 = _mm256_add_epi16(e0, _mm256_and_si256(a, low));
        e1 = _mm256_add_epi16(e1, _mm256_srli_epi16(a, 8));
    }
    const __m256i *s = (const __m256i *)(const void *)single,
                  *n = (const __m256i *)(const void *)noise;
    e0 = _mm256_add_epi16(_mm256_slli_epi16(e0, 2),
                          _mm256_add_epi16(_mm256_loadu_si256(s), _mm256_loadu_si256(n)));
    e1 = _mm256_add_epi16(_mm256_slli_epi16(e1, 2),
                          _mm256_add_epi16(_mm256_loadu_si256(s + 1), _mm256_loadu_si256(n + 1)));
    __m256i w = _mm256_min_epi16(e0, e1);
    __m128i m = _mm_min_epi16(_mm256_castsi256_si128(w), _mm256_extracti128_si256(w, 1));
    m = _mm_min_epi16(m, _mm_shuffle_epi32(m, 0x4e));
    m = _mm_min_epi16(m, _mm_shuffle_epi32(m, 0xb1));
    m = _mm_min_epi16(m, _mm_shufflehi_epi16(_mm_shufflelo_epi16(m, 0xb1), 0xb1));
    w = _mm256_broadcastsi128_si256(m);
    w = _mm256_packs_epi16(_mm256_cmpeq_epi16(e0, w), _mm256_cmpeq_epi16(e1, w));
    w = _mm256_permute4x64_epi64(w, 0xd8);
    return txs_slot_value(__builtin_ctz((unsigned)_mm256_movemask_epi8(w)));
}
#endif

static txs_pick *txs_best_pick(void) {
#ifdef TXS_AVX2
    if (__builtin_cpu_supports("avx2")) return txs_pick_avx2;
#endif
#ifdef TXS_SSE2
    return txs_pick_sse2;
#else
    return txs_pick_plain;
#endif
}

#endif /* TEXSYN_ENERGY_H */
