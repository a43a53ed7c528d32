#ifndef TEXTILES_SEARCH_H
#define TEXTILES_SEARCH_H

#include "config.h"
#include "exemplar.h"

/* ---- searching the exemplars ------------------------------------------------------------- */

enum {
    TXT_POSITIONS = 1 << 17, /* places of one exemplar looked at in one search, about          */
    TXT_SAMPLES = 2048    /* texels compared at one place of a search, at most                 */
};

/* A texel that a piece should show, and its offset from the place of the piece, turned already. */
typedef struct txt_sample {
    int i, j;
    uint8_t value[TXT_MAX_FEATURES]; /* blurred */
} txt_sample;

/* What to search for: samples to match, and additional costs of a place. */
typedef struct txt_query {
    txt_sample *samples;
    int count, capacity;
    /* add to cost[0..n-1] for the places (i, j), (i + 1, j) ... of a sheet; NULL: nothing */
    void (*extra)(const void *context, int sheet, int i, int j, int n, uint32_t *cost);
    const void *context;
    int apart;  /* places closer than this count as one */
    int coarse; /* look at one row in so many more      */
    int need[4][2], need_count; /* texels that must lie in the sheet besides the samples */
} txt_query;

/* memory of one search at a time */
typedef struct txt_scratch {
    uint32_t *sum32; /* costs of a row of places                             */
    size_t *starts;  /* where the samples of the row's first place lie       */
    txm_pair *pairs, *spare; /* best place of each piece of a row       */
    txt_place *places;
    int capacity;
} txt_scratch;

enum { TXT_RUN = 16 }; /* places of a row of which only the best is kept */

static void txt_sample_add(const txt_build *b, txt_query *q, int i, int j, int32_t shows) {
    if (q->count == q->capacity || shows < 0) return;
    txt_sample *s = &q->samples[q->count++];
    s->i = i;
    s->j = j;
    for (int f = 0; f < b->features && f < TXT_MAX_FEATURES; f++)
        s->value[f] = b->plane[(size_t)f * b->texels + (size_t)shows];
}

/* The range of i for which all samples of places (i, j) lie in the sheet; 0: none. */
static int txt_row_range(const txt_build *b, const txt_query *q, int sheet, int j, int *from,
                         int *to) {
    const txt_sheet *s = &b->sheets[sheet];
    int low = INT_MIN / 2, high = INT_MAX / 2;
    for (int k = 0; k < q->count; k++) {
        const int row = j + q->samples[k].j;
        if (row < 0 || row >= s->height) return 0;
        const int shift = q->samples[k].i + (b->is_triangle ? txt_half(row) : 0);
        if (-shift > low) low = -shift;
        if (s->width - shift < high) high = s->width - shift;
    }
    for (int k = 0; k < q->need_count; k++) {
        const int row = j + q->need[k][1];
        if (row < 0 || row >= s->height) return 0;
        const int shift = q->need[k][0] + (b->is_triangle ? txt_half(row) : 0);
        if (-shift > low) low = -shift;
        if (s->width - shift < high) high = s->width - shift;
    }
    *from = low;
    *to = high;
    return high > low;
}

/* Sums of the differences of samples first..last-1 at TXT_LANES places side by side, added to sum.
   One group has at most 256 differences, so that 16 bits suffice. */
#ifdef TXT_AVX2
__attribute__((target("avx2"))) static void txt_add_lanes_avx2(const txt_build *b,
                                                               const txt_query *q,
                                                               const size_t *starts, int first,
                                                               int last, int at, uint32_t *sum) {
    const __m256i zero = _mm256_setzero_si256();
    __m256i low = zero, high = zero; /* places 0-7 and 16-23, 8-15 and 24-31 */
    for (int k = first; k < last; k++) {
        const uint8_t *line = b->plane + starts[k] + at;
        for (int f = 0; f < b->features; f++, line += b->texels) {
            const __m256i want = _mm256_set1_epi8((char)q->samples[k].value[f]);
            const __m256i v = _mm256_loadu_si256((const __m256i *)(const void *)line);
            const __m256i d = _mm256_or_si256(_mm256_subs_epu8(v, want), _mm256_subs_epu8(want, v));
            low = _mm256_add_epi16(low, _mm256_unpacklo_epi8(d, zero));
            high = _mm256_add_epi16(high, _mm256_unpackhi_epi8(d, zero));
        }
    }
    uint16_t sums[TXT_LANES];
    _mm256_storeu_si256((__m256i *)(void *)sums, low);
    _mm256_storeu_si256((__m256i *)(void *)(sums + 16), high);
    for (int i = 0; i < TXT_LANES; i++) sum[i] += sums[(i & 7) | (i & 16) >> 1 | (i & 8) << 1];
}
#endif

static void txt_add_lanes(const txt_build *b, const txt_query *q, const size_t *starts, int first,
                          int last, int at, uint32_t *sum) {
#ifdef TXT_SSE2
    const __m128i zero = _mm_setzero_si128();
    __m128i sums[4] = {zero, zero, zero, zero};
    for (int k = first; k < last; k++) {
        const uint8_t *line = b->plane + starts[k] + at;
        for (int f = 0; f < b->features; f++, line += b->texels) {
            const __m128i want = _mm_set1_epi8((char)q->samples[k].value[f]);
            for (int h = 0; h < 2; h++) {
                const __m128i v = _mm_loadu_si128((const __m128i *)(const void *)(line + 16 * h));
                const __m128i d = _mm_or_si128(_mm_subs_epu8(v, want), _mm_subs_epu8(want, v));
                sums[2 * h] = _mm_add_epi16(sums[2 * h], _mm_unpacklo_epi8(d, zero));
                sums[2 * h + 1] = _mm_add_epi16(sums[2 * h + 1], _mm_unpackhi_epi8(d, zero));
            }
        }
    }
    for (int h = 0; h < 4; h++) {
        __m128i *to = (__m128i *)(void *)(sum + 8 * h);
        const __m128i low = _mm_unpacklo_epi16(sums[h], zero);
        const __m128i high = _mm_unpackhi_epi16(sums[h], zero);
        _mm_storeu_si128(to, _mm_add_epi32(_mm_loadu_si128(to), low));
        _mm_storeu_si128(to + 1, _mm_add_epi32(_mm_loadu_si128(to + 1), high));
    }
#else
    uint16_t sums[TXT_LANES] = {0};
    for (int k = first; k < last; k++) {
        const uint8_t *line = b->plane + starts[k] + at;
        for (int f = 0; f < b->features; f++, line += b->texels) {
            const uint8_t want = q->samples[k].value[f];
            for (int i = 0; i < TXT_LANES; i++) {
                const uint8_t v = line[i];
                sums[i] = (uint16_t)(sums[i] + ((v > want ? v : want) - (v > want ? want : v)));
            }
        }
    }
    for (int i = 0; i < TXT_LANES; i++) sum[i] += sums[i];
#endif
}

/* Costs of the places (from, j) .. (from + n - 1, j). The planes end in TXT_LANES spare bytes, so
   that whole groups of lanes can be read; results beyond n are ignored. */
static void txt_row_costs(const txt_build *b, const txt_query *q, int sheet, int j, int from, int n,
                          txt_scratch *m) {
    const txt_sheet *s = &b->sheets[sheet];
    const int group = 256 / b->features;
    const int lanes = (n + TXT_LANES - 1) / TXT_LANES * TXT_LANES;
    memset(m->sum32, 0, (size_t)lanes * sizeof(uint32_t));
    for (int k = 0; k < q->count; k++) {
        const int row = j + q->samples[k].j;
        const int column = from + q->samples[k].i + (b->is_triangle ? txt_half(row) : 0);
        m->starts[k] = (size_t)(s->first + row * s->width + column);
    }
    void (*add)(const txt_build *, const txt_query *, const size_t *, int, int, int, uint32_t *) =
        txt_add_lanes;
#ifdef TXT_AVX2
    if (__builtin_cpu_supports("avx2")) add = txt_add_lanes_avx2;
#endif
    for (int i = 0; i < lanes; i += TXT_LANES) {
        for (int k = 0; k < q->count; k += group)
            add(b, q, m->starts, k, k + group < q->count ? k + group : q->count, i, m->sum32 + i);
    }
    const uint32_t parts = (uint32_t)(q->count * b->features);
    for (int i = 0; i < n; i++) m->sum32[i] = m->sum32[i] * TXT_SCALE / parts;
    if (q->extra) q->extra(q->context, sheet, from, j, n, m->sum32);
}

/* The best places of one sheet, cheapest first, at least q->apart from each other: appended to
   best[], which keeps the cheapest of most. Tries every second row or fewer, then the rows left out
   next to what it found. */
static int txt_search(const txt_build *b, const txt_query *q, int sheet, int turn, txt_scratch *m,
                      txt_place *best, int count, int most) {
    const txt_sheet *s = &b->sheets[sheet];
    int top = INT_MAX, bottom = INT_MIN, found = 0, from, to;
    if (q->count == 0) return count;
    for (int k = 0; k < q->count; k++) {
        if (q->samples[k].j < top) top = q->samples[k].j;
        if (q->samples[k].j > bottom) bottom = q->samples[k].j;
    }
    const int rows = s->height - (bottom - top);
    if (rows < 1) return count;
    int step = (int)((int64_t)rows * s->width / TXT_POSITIONS) + 1;
    if (step < 2) step = rows > 8 ? 2 : 1;
    step += q->coarse;
    for (int j = -top; j + bottom < s->height; j += step) {
        if (!txt_row_range(b, q, sheet, j, &from, &to)) continue;
        txt_row_costs(b, q, sheet, j, from, to - from, m);
        for (int i = from; i < to; i += TXT_RUN) {
            int at = i;
            for (int k = i + 1; k < to && k < i + TXT_RUN; k++) {
                if (m->sum32[k - from] < m->sum32[at - from]) at = k;
            }
            if (found == m->capacity) break;
            const txt_place place = {sheet, turn, at, j, m->sum32[at - from]};
            m->places[found] = place;
            m->pairs[found].key = place.cost;
            m->pairs[found].value = (uint32_t)found;
            found++;
        }
    }
    txm_sort_pairs(m->pairs, m->spare, (size_t)found);

    int taken = 0;
    for (int k = 0; k < found && taken < most; k++) {
        txt_place p = m->places[m->pairs[k].value];
        for (int j = p.j - step + 1; j < p.j + step && step > 1; j++) { /* rows left out */
            if (j == m->places[m->pairs[k].value].j || !txt_row_range(b, q, sheet, j, &from, &to))
                continue;
            const int low = p.i - 1 > from ? p.i - 1 : from, high = p.i + 2 < to ? p.i + 2 : to;
            if (high <= low) continue;
            txt_row_costs(b, q, sheet, j, low, high - low, m);
            for (int i = low; i < high; i++) {
                if (m->sum32[i - low] >= p.cost) continue;
                p.i = i;
                p.j = j;
                p.cost = m->sum32[i - low];
            }
        }
        int keep = 1;
        for (int c = 0; c < count && keep; c++) {
            keep = best[c].sheet != sheet || best[c].turn != turn ||
                   abs(best[c].i - p.i) >= q->apart || abs(best[c].j - p.j) >= q->apart;
        }
        if (!keep) continue;
        int at = count < most ? count : most - 1;
        if (count == most && best[at].cost <= p.cost) break;
        if (count < most) count++;
        for (; at > 0 && best[at - 1].cost > p.cost; at--) best[at] = best[at - 1];
        best[at] = p;
        taken++;
    }
    return count;
}

/* memory for searches; arena->failed if there is none */
static void txt_scratch_make(const txt_build *b, txm_arena *arena, txt_scratch *m) {
    int width = 0;
    m->capacity = 0;
    for (int e = 0; e < b->sheet_count; e++) {
        const txt_sheet *s = &b->sheets[e];
        /* rows and, of each, pieces; lattice rows shift against each other, thus some more */
        const int n = (s->width / TXT_RUN + 2) * ((int)(TXT_POSITIONS / s->width) + 2) * 2;
        if (s->width > width) width = s->width;
        if (n > m->capacity) m->capacity = n;
    }
    m->sum32 = (uint32_t *)txm_arena_alloc(arena, (size_t)width + TXT_LANES, sizeof(uint32_t));
    m->starts = (size_t *)txm_arena_alloc(arena, TXT_SAMPLES, sizeof(size_t));
    m->pairs = (txm_pair *)txm_arena_alloc(arena, (size_t)m->capacity, 2 * sizeof(txm_pair));
    m->spare = m->pairs ? m->pairs + m->capacity : NULL;
    m->places = (txt_place *)txm_arena_alloc(arena, (size_t)m->capacity, sizeof(txt_place));
}

#endif /* TEXTILES_SEARCH_H */
