#ifndef TEXPATCH_CANVAS_H
#define TEXPATCH_CANVAS_H

#include "config.h"

/* ---- sums of absolute differences -------------------------------------------------------- */

/* Sum of |a - b| over rows of bytes, bytes a multiple of 4. Once it exceeds limit, any value above
   limit may be returned. */
#ifdef TXP_SSE2
static inline uint32_t txp_sad_sum(__m128i sum) {
    return (uint32_t)_mm_cvtsi128_si32(sum) + (uint32_t)_mm_cvtsi128_si32(_mm_srli_si128(sum, 8));
}

static inline __m128i txp_sad16(const uint8_t *a, const uint8_t *b) {
    return _mm_sad_epu8(_mm_loadu_si128((const __m128i *)(const void *)a),
                        _mm_loadu_si128((const __m128i *)(const void *)b));
}

static inline __m128i txp_sad4(const uint8_t *a, const uint8_t *b) {
    int32_t u, v;
    memcpy(&u, a, 4);
    memcpy(&v, b, 4);
    return _mm_sad_epu8(_mm_cvtsi32_si128(u), _mm_cvtsi32_si128(v));
}

/* words: 16-byte pieces of a row, tails: 4-byte pieces after them; constants at the calls */
static inline uint32_t txp_sad_fixed(const uint8_t *a, size_t a_pitch, const uint8_t *b,
                                     size_t b_pitch, int words, int tails, int rows,
                                     uint32_t limit) {
    uint32_t total = 0;
    for (int y = 0; y < rows;) {
        __m128i sum = _mm_setzero_si128();
        const int stop = y + 4 < rows ? y + 4 : rows;
        for (; y < stop; y++, a += a_pitch, b += b_pitch) {
            for (int i = 0; i < words; i++)
                sum = _mm_add_epi32(sum, txp_sad16(a + 16 * i, b + 16 * i));
            for (int i = 0; i < tails; i++)
                sum = _mm_add_epi32(sum, txp_sad4(a + 16 * words + 4 * i, b + 16 * words + 4 * i));
        }
        total += txp_sad_sum(sum);
        if (total > limit) break;
    }
    return total;
}

static uint32_t txp_sad(const uint8_t *a, size_t a_pitch, const uint8_t *b, size_t b_pitch,
                        int bytes, int rows, uint32_t limit) {
    switch (bytes) { /* unrolled for RGB */
    case 64: return txp_sad_fixed(a, a_pitch, b, b_pitch, 4, 0, rows, limit);
    case 32: return txp_sad_fixed(a, a_pitch, b, b_pitch, 2, 0, rows, limit);
    case 20: return txp_sad_fixed(a, a_pitch, b, b_pitch, 1, 1, rows, limit);
    default: return txp_sad_fixed(a, a_pitch, b, b_pitch, bytes / 16, bytes % 16 / 4, rows, limit);
    }
}
#else
static uint32_t txp_sad(const uint8_t *a, size_t a_pitch, const uint8_t *b, size_t b_pitch,
                        int bytes, int rows, uint32_t limit) {
    uint32_t total = 0;
    for (int y = 0; y < rows && total <= limit; y++, a += a_pitch, b += b_pitch) {
        for (int i = 0; i < bytes; i++)
            total += (uint32_t)(a[i] > b[i] ? a[i] - b[i] : b[i] - a[i]);
    }
    return total;
}
#endif

/* ---- the canvas -------------------------------------------------------------------------- */

static inline const uint8_t *txp_stack_at(const txp_source *s, const txp_stack *k, int x, int y) {
    return k->pixels + (size_t)y * k->pitch + (size_t)x * (size_t)s->bytes;
}

static inline uint8_t *txp_canvas_at(const txp_source *s, const txp_canvas *c, int x, int y) {
    return c->pixels + (size_t)y * c->pitch + (size_t)x * (size_t)s->bytes;
}

static inline size_t txp_index(const txp_canvas *c, int x, int y) {
    return (size_t)y * (size_t)c->width + (size_t)x;
}

/* x in 0..n-1 for x in 0..2n-1 and beyond */
static inline int txp_wrap(int x, int n) {
    return x < n ? x : x % n;
}

/* Does a piece of wide x high pixels at (x, y) lie inside one sheet, on usable pixels? */
static inline int txp_fits(const txp_source *s, const txp_stack *k, int x, int y, int wide,
                           int high) {
    if (x < 0 || y < 0 || y >= k->height) return 0;
    const int n = s->sheets > 1 ? k->sheet[y] : 0;
    if (x + wide > k->wide[n] || y + high > k->first[n] + k->high[n]) return 0;
    if (k->bad) {
        const size_t w = (size_t)k->width + 1, top = (size_t)y * w, low = (size_t)(y + high) * w;
        const size_t l = (size_t)x, r = (size_t)(x + wide);
        if (k->bad[low + r] - k->bad[low + l] - k->bad[top + r] + k->bad[top + l]) return 0;
    }
    return 1;
}

/* Fill rows from..to-1 of the canvas with the compared bytes of their places. Fixed pixels keep
   their own bytes, and so does the guide where it counts. */
static void txp_canvas_fill(const txp_source *s, const txp_stack *k, const txp_canvas *c, int from,
                            int to) {
    const size_t n = (size_t)s->bytes, guide = (size_t)s->guide_at;
    for (int y = from; y < to; y++) {
        uint8_t *out = txp_canvas_at(s, c, 0, y);
        const size_t row = txp_index(c, 0, y);
        for (int x = 0; x < c->width; x++, out += n) {
            const txp_place at = c->at[row + (size_t)x];
            if (at.x < 0 || (c->fixed && c->fixed[row + (size_t)x])) continue;
            const uint8_t *in = txp_stack_at(s, k, at.x, at.y);
            if (n == 4 && guide == 4) memcpy(out, in, 4);
            else memcpy(out, in, c->free_guide && c->free_guide[row + (size_t)x] ? n : guide);
        }
    }
}

/* Repeat the first columns and rows beyond the ends of the axes that wrap. */
static void txp_canvas_repeat(const txp_source *s, const txp_canvas *c, uint8_t *pixels) {
    const size_t n = (size_t)s->bytes;
    if (c->wrap & TEXPATCH_TILE_X) {
        for (int y = 0; y < c->height; y++) {
            uint8_t *row = pixels + (size_t)y * c->pitch;
            for (int x = 0; x < TXP_PAD; x++)
                memcpy(row + (size_t)(c->width + x) * n, row + (size_t)x * n, n);
        }
    }
    if (c->wrap & TEXPATCH_TILE_Y) {
        for (int y = 0; y < TXP_PAD; y++)
            memcpy(pixels + (size_t)(c->height + y) * c->pitch, pixels + (size_t)y * c->pitch,
                   c->pitch);
    }
}

/* May any pixel of the size x size ones at (x, y) be changed? */
static int txp_has_free_pixel(const txp_canvas *c, int x, int y, int size) {
    if (!c->fixed) return 1;
    for (int v = 0; v < size; v++) {
        for (int u = 0; u < size; u++) {
            if (!c->fixed[txp_index(c, txp_wrap(x + u, c->width), txp_wrap(y + v, c->height))])
                return 1;
        }
    }
    return 0;
}

#endif /* TEXPATCH_CANVAS_H */
