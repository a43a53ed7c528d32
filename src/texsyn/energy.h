#ifndef TEXSYN_ENERGY_H
#define TEXSYN_ENERGY_H

#include "model.h"

/* ---- energy of a pixel -------------------------------------------------------------------

   The Gibbs energy of a candidate value v at a pixel is the sum of the potentials of all cliques
   that end there. Once the other members are known, the potentials for v = 0..31 lie side by
   side in a table prepared for that end ("row"): for a difference n - v, for example, in the
   reversed potential from entry 31 - n on. A byte per entry, 1/16 nat, 64 for none.

     form 0   row = table - p[o1]                                     one difference
     form 1   row = table + class(p[o2] - p[o3]) * 64 - p[o1]         two, the other one known
     form 2   row = table + (p[o2] - p[o1]) * 64 - p[o1]              two, v in both
     form 3   row = table + classes[p[o1]] * 32                       a value beside a known one
     form 4   row = table + p[o2] * 64 - p[o1]                        one difference, at a label

   For a filter with the response r, a pixel of weight w and value p has the row
   table + w r - p.                                                                         */
typedef struct txs_end {
    ptrdiff_t o1, o2, o3;
    const uint8_t *table, *classes;
} txs_end;

enum { TXS_FORMS = 5 };

static const uint8_t txs_no_energy[TXS_VALUES] = {
    TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO,
    TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO,
    TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO,
    TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO};

/* Write the rows of count ends of one form, for TXS_TOGETHER pixels p, p + TXS_GRID, ...: that of
   end k for pixel i goes to rows[k * TXS_TOGETHER + i]. Only the first `pixels` are wanted. */
typedef void txs_aim(const txs_end *ends, int count, int form, const uint8_t *p, int pixels,
                       const uint8_t **rows);

/* The value with the lowest energy

       e(v) = TXS_FINE * (sum of rows at v - TXS_ZERO count) + single(v) + noise

   With noise of Gumbel's distribution that is a draw from exp(-e) / sum exp(-e), the Gibbs
   sampler's step [4]. Values are kept even ones first, single[] and noise[] in that order, since
   adding bytes as the halves of 16-bit words yields them so. The rows are those at rows[0],
   rows[apart], ...; their count is even, they hold 1..127. Energies saturate at 16 bits. */
typedef int txs_pick(const uint8_t *const *rows, int apart, int count, const int16_t *single,
                     const int16_t *noise);

static int txs_slot_value(int slot) {
    return (slot & 15) * 2 + (slot >> 4);
}

static void txs_aim_plain(const txs_end *ends, int count, int form, const uint8_t *p, int pixels,
                            const uint8_t **rows) {
    for (int k = 0; k < count; k++, rows += TXS_TOGETHER) {
        const txs_end *e = &ends[k];
        const uint8_t *p1 = p + e->o1, *p2 = p + e->o2, *p3 = p + e->o3, *table = e->table;
        const int stop = pixels * TXS_GRID;
        const uint8_t **row = rows;
        switch (form) {
        case 0:
            for (int x = 0; x < stop; x += TXS_GRID) *row++ = table - p1[x];
            break;
        case 1:
            for (int x = 0; x < stop; x += TXS_GRID)
                *row++ = table + txs_class(p2[x] - p3[x]) * TXS_ROW - p1[x];
            break;
        case 2:
            for (int x = 0; x < stop; x += TXS_GRID)
                *row++ = table + (p2[x] - p1[x]) * TXS_ROW - p1[x];
            break;
        case 3:
            for (int x = 0; x < stop; x += TXS_GRID)
                *row++ = table + e->classes[p1[x]] * TXS_VALUES;
            break;
        default:
            for (int x = 0; x < stop; x += TXS_GRID) *row++ = table + p2[x] * TXS_ROW - p1[x];
        }
    }
}

#ifndef TXS_SSE2
static int txs_pick_plain(const uint8_t *const *rows, int apart, int count, const int16_t *single,
                          const int16_t *noise) {
    int sum[TXS_VALUES] = {0}, best = 0;
    for (int i = 0; i < count; i++)
        for (int v = 0; v < TXS_VALUES; v++) sum[v] += rows[i * apart][v];
    for (int slot = 0, least = INT_MAX; slot < TXS_VALUES; slot++) {
        int e = TXS_FINE * (sum[txs_slot_value(slot)] - TXS_ZERO * count);
        e = txm_clampi(e, INT16_MIN, INT16_MAX) + single[slot] + noise[slot];
        e = txm_clampi(e, INT16_MIN, INT16_MAX);
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

/* TXS_FINE times the summed rows, and the rest */
static __m128i txs_finish(__m128i e, const int16_t *single, const int16_t *noise) {
    e = _mm_adds_epi16(e, e);
    return _mm_adds_epi16(_mm_adds_epi16(e, e), _mm_add_epi16(txs_load(single), txs_load(noise)));
}

/* Sums of words: `all` of the words that two bytes make, `high` of their upper bytes; the sum of the
   lower ones follows. */
static int txs_pick_sse2(const uint8_t *const *rows, int apart, int count, const int16_t *single,
                         const int16_t *noise) {
    __m128i all0 = _mm_setzero_si128(), all1 = all0, high0 = all0, high1 = all0;
    for (int i = 0; i < count; i += 2, rows += 2 * apart) {
        const uint8_t *r = rows[0], *q = rows[apart];
        __m128i a = _mm_add_epi8(txs_load(r), txs_load(q));
        __m128i b = _mm_add_epi8(txs_load(r + 16), txs_load(q + 16));
        all0 = _mm_add_epi16(all0, a);
        all1 = _mm_add_epi16(all1, b);
        high0 = _mm_add_epi16(high0, _mm_srli_epi16(a, 8));
        high1 = _mm_add_epi16(high1, _mm_srli_epi16(b, 8));
    }
    const __m128i zero = _mm_set1_epi16((short)(TXS_ZERO * count));
    __m128i e0 = _mm_sub_epi16(_mm_sub_epi16(all0, _mm_slli_epi16(high0, 8)), zero);
    __m128i e1 = _mm_sub_epi16(_mm_sub_epi16(all1, _mm_slli_epi16(high1, 8)), zero);
    __m128i e2 = _mm_sub_epi16(high0, zero), e3 = _mm_sub_epi16(high1, zero);
    e0 = txs_finish(e0, single, noise);
    e1 = txs_finish(e1, single + 8, noise + 8);
    e2 = txs_finish(e2, single + 16, noise + 16);
    e3 = txs_finish(e3, single + 24, noise + 24);
    __m128i m = txs_least(_mm_min_epi16(_mm_min_epi16(e0, e1), _mm_min_epi16(e2, e3)));
    int first = _mm_movemask_epi8(_mm_packs_epi16(_mm_cmpeq_epi16(e0, m), _mm_cmpeq_epi16(e1, m)));
    int last = _mm_movemask_epi8(_mm_packs_epi16(_mm_cmpeq_epi16(e2, m), _mm_cmpeq_epi16(e3, m)));
    return txs_slot_value(txm_lowest_bit((unsigned)first | (unsigned)last << 16));
}
#endif

#ifdef TXS_AVX2
#define TXS_FOR_AVX2 __attribute__((target("avx2"))) static

TXS_FOR_AVX2 int txs_pick_avx2(const uint8_t *const *rows, int apart, int count,
                               const int16_t *single, const int16_t *noise) {
    __m256i all = _mm256_setzero_si256(), high = all;
    for (int i = 0; i < count; i += 2, rows += 2 * apart) {
        __m256i a = _mm256_add_epi8(_mm256_loadu_si256((const __m256i *)(const void *)rows[0]),
                                    _mm256_loadu_si256((const __m256i *)(const void *)rows[apart]));
        all = _mm256_add_epi16(all, a);
        high = _mm256_add_epi16(high, _mm256_srli_epi16(a, 8));
    }
    const __m256i zero = _mm256_set1_epi16((short)(TXS_ZERO * count));
    const __m256i *s = (const __m256i *)(const void *)single,
                  *n = (const __m256i *)(const void *)noise;
    __m256i e0 = _mm256_sub_epi16(_mm256_sub_epi16(all, _mm256_slli_epi16(high, 8)), zero);
    __m256i e1 = _mm256_sub_epi16(high, zero);
    e0 = _mm256_adds_epi16(e0, e0); /* times TXS_FINE */
    e1 = _mm256_adds_epi16(e1, e1);
    e0 = _mm256_adds_epi16(_mm256_adds_epi16(e0, e0),
                           _mm256_add_epi16(_mm256_loadu_si256(s), _mm256_loadu_si256(n)));
    e1 = _mm256_adds_epi16(_mm256_adds_epi16(e1, e1),
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

#ifdef TXS_LANES
/* TXS_GRID pixels are as many bytes as a 64-bit lane has, so that a lane's lowest byte is the pixel
   of its row, and four rows' addresses are computed at once. */
#define TXS_LOAD4(p) _mm256_loadu_si256((const __m256i *)(const void *)(p))

TXS_FOR_AVX2 void txs_aim_avx2(const txs_end *ends, int count, int form, const uint8_t *p,
                                 int pixels, const uint8_t **rows) {
    const __m256i low = _mm256_set1_epi64x(255);
    /* classes 4 to 8 of differences 0 to 15 without the 4 */
    const __m256i class_of =
        _mm256_broadcastsi128_si256(_mm_setr_epi8(0, 1, 1, 2, 2, 2, 3, 3, 3, 3, 3, 4, 4, 4, 4, 4));
    const __m256i most = _mm256_set1_epi8(15), middle = _mm256_set1_epi8(TXS_CLASSES / 2);
    if (pixels < TXS_TOGETHER) { /* the others may lie beyond the canvas */
        txs_aim_plain(ends, count, form, p, pixels, rows);
        return;
    }
    for (int k = 0; k < count; k++, ends++) {
        const __m256i table = _mm256_set1_epi64x((long long)(intptr_t)ends->table);
        for (int half = 0; half < 2; half++, rows += TXS_TOGETHER / 2) {
            const uint8_t *q = p + half * (TXS_TOGETHER / 2 * TXS_GRID);
            const __m256i p1 = _mm256_and_si256(TXS_LOAD4(q + ends->o1), low);
            __m256i row = _mm256_sub_epi64(table, p1);
            if (form == 1) {
                const __m256i d = _mm256_sub_epi8(TXS_LOAD4(q + ends->o2), TXS_LOAD4(q + ends->o3));
                __m256i known =
                    _mm256_shuffle_epi8(class_of, _mm256_min_epu8(_mm256_abs_epi8(d), most));
                known = _mm256_add_epi8(_mm256_sign_epi8(known, d), middle);
                known = _mm256_and_si256(known, low);
                row = _mm256_add_epi64(row, _mm256_slli_epi64(known, TXS_ROW_BITS));
            } else if (form == 2) {
                const __m256i p2 = _mm256_and_si256(TXS_LOAD4(q + ends->o2), low);
                row = _mm256_add_epi64(row,
                                       _mm256_slli_epi64(_mm256_sub_epi64(p2, p1), TXS_ROW_BITS));
            } else if (form == 3) {
                const __m256i *c = (const __m256i *)(const void *)ends->classes;
                const __m256i both = _mm256_loadu_si256(c);
                const __m256i first = _mm256_permute2x128_si256(both, both, 0x00);
                const __m256i last = _mm256_permute2x128_si256(both, both, 0x11);
                /* an index with its highest bit set gives 0 */
                const __m256i class_ = _mm256_or_si256(
                    _mm256_shuffle_epi8(first, _mm256_add_epi8(p1, _mm256_set1_epi64x(0x70))),
                    _mm256_shuffle_epi8(last, _mm256_sub_epi8(p1, _mm256_set1_epi64x(16))));
                row = _mm256_add_epi64(
                    table, _mm256_slli_epi64(_mm256_and_si256(class_, low), TXS_VALUE_BITS));
            } else if (form == 4) {
                const __m256i label = _mm256_and_si256(TXS_LOAD4(q + ends->o2), low);
                row = _mm256_add_epi64(row, _mm256_slli_epi64(label, TXS_ROW_BITS));
            }
            _mm256_storeu_si256((__m256i *)(void *)rows, row);
        }
    }
}
#endif

static txs_aim *txs_best_aim(void) {
#ifdef TXS_LANES
    if (__builtin_cpu_supports("avx2")) return txs_aim_avx2;
#endif
    return txs_aim_plain;
}

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
