/* fuzzkit.h - what the fuzz programs of texsyn.h share: memory that fails, pictures of random form
   SPDX-License-Identifier: MIT OR Unlicense */
#ifndef FUZZKIT_H
#define FUZZKIT_H

#include "texsyn.h"

/* ---- bytes that choose ------------------------------------------------------------------- */

typedef struct source { /* bytes, then zeros */
    const uint8_t *data;
    size_t size, at;
} source;

/* A number below count. */
static inline int pick(source *s, int count) {
    const int high = s->at < s->size ? s->data[s->at++] : 0;
    const int low = s->at < s->size ? s->data[s->at++] : 0;
    return (256 * high + low) % count;
}

/* ---- memory ------------------------------------------------------------------------------- */

typedef struct memory { /* an allocator whose call fail_at fails */
    long calls, fail_at, blocks;
} memory;

static inline void *allocate(void *user, size_t bytes) {
    memory *m = (memory *)user;
    if (++m->calls == m->fail_at) return NULL;
    void *block = malloc(bytes);
    if (block) {
        memset(block, 0xa5, bytes);
        m->blocks++;
    }
    return block;
}

static inline void release(void *user, void *block) {
    ((memory *)user)->blocks--;
    free(block);
}

/* ---- pictures ----------------------------------------------------------------------------- */

/* A picture of random form over bytes of its own; bottom-up for every other one. */
static inline txm_image image_over(uint8_t *bytes, int width, int height, int channels,
                                   txm_sample sample, int choice) {
    const size_t unit = txm_sample_bytes(sample);
    const size_t row = ((size_t)width * (size_t)channels + (size_t)(choice / 2 % 3)) * unit;
    txm_image im;
    memset(&im, 0, sizeof im);
    im.width = width;
    im.height = height;
    im.channels = channels;
    im.sample = sample;
    im.stride = choice % 2 ? -(ptrdiff_t)row : (ptrdiff_t)row;
    im.pixels = choice % 2 ? bytes + row * (size_t)(height - 1) : bytes;
    return im;
}

/* A mask of one of several kinds: specks, lines, a box, half, dust, or noise. */
static inline int is_masked(int kind, int x, int y, int a, int b, txm_rng *rng) {
    switch (kind % 7) {
    case 0: return txm_rng_below(rng, 20) == 0;
    case 1: return abs(x - y - a + 20) < 1 + b % 5;
    case 2: return x >= a && y >= b && x < a + b && y < a + b;
    case 3: return x > a;
    case 4: return x % (2 + a) == 0 && y % (2 + b) == 0;
    case 5: return x > 16 || y > 16;
    default: return txm_rng_below(rng, 2) == 0;
    }
}

static inline void draw_mask(const txm_image *mask, int kind, int a, int b, txm_rng *rng) {
    for (int y = 0; y < mask->height; y++)
        for (int x = 0; x < mask->width; x++) {
            const float value = is_masked(kind, x, y, a, b, rng) ? 1.0f : 0.0f;
            for (int c = 0; c < mask->channels; c++) txm_image_set(mask, x, y, c, value);
        }
}

static inline void draw_image(const txm_image *im, int kind, txm_rng *rng) {
    for (int y = 0; y < im->height; y++)
        for (int x = 0; x < im->width; x++)
            for (int c = 0; c < im->channels; c++) {
                float v = kind % 3 == 0   ? 0.5f
                          : kind % 3 == 1 ? txm_rng_float(rng)
                                          : (float)((x * 7 + y * 3 + c * 11) % 32) / 31.0f;
                if (c == 3 && kind % 2) v = (x / 4 + y / 4) % 2 ? 1.0f : 0.0f;
                txm_image_set(im, x, y, c, v);
            }
}

#endif /* FUZZKIT_H */
