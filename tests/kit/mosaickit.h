/* mosaickit.h - mosaics of drawn textures and how well a segmentation fits them
   SPDX-License-Identifier: MIT OR Unlicense

   Includes synkit.h.                                                                          */
#ifndef MOSAICKIT_H
#define MOSAICKIT_H

#include "synkit.h"

enum { MOSAIC_TEXTURES = 8, MOSAIC_MOST = 5, MOSAIC_SITES = 2 * MOSAIC_MOST };

static inline int mosaic_noise(int x, int y, int which) {
    return at_random(x, y, 100 + which) - 128;
}

/* a value -128..127 that changes smoothly over cells of `size` pixels */
static inline int mosaic_cloud(int x, int y, int size, int which) {
    const int u = x / size, v = y / size, a = x % size, b = y % size;
    const int top = mosaic_noise(u, v, which) * (size - a) + mosaic_noise(u + 1, v, which) * a;
    const int below =
        mosaic_noise(u, v + 1, which) * (size - a) + mosaic_noise(u + 1, v + 1, which) * a;
    return (top * (size - b) + below * b) / (size * size);
}

/* Textures that differ in colour, in grain, or in both. */
static inline void mosaic_texel(int texture, int x, int y, uint8_t *rgb) {
    static const uint8_t colours[MOSAIC_TEXTURES][3] = {
        {120, 110, 100}, {90, 110, 60}, {150, 130, 90}, {120, 112, 104},
        {60, 70, 90},    {170, 90, 70}, {200, 195, 185}, {100, 80, 60}};
    int v = 0;
    switch (texture) {
    case 0: v = mosaic_noise(x, y, 0) / 3; break;                                /* sand    */
    case 1: v = mosaic_noise(x, y / 6, 1) / 3; break;                            /* grass   */
    case 2: v = mosaic_cloud(x, y, 5, 2) / 2; break;                             /* grains  */
    case 3: v = mosaic_cloud(x, y, 16, 3) / 2 + mosaic_noise(x, y, 9) / 12; break; /* boulders */
    case 4: v = mosaic_noise(x, y, 4) / 12; break;                               /* slate   */
    case 5: /* bricks */
        v = y % 12 < 2 || (x + y / 12 % 2 * 12) % 24 < 2 ? 50 : mosaic_noise(x, y, 5) / 12;
        break;
    case 6: v = (x / 4 + y / 4) % 2 * 40 - 20 + mosaic_noise(x, y, 6) / 16; break; /* weave  */
    default: v = mosaic_cloud(x / 3, y, 7, 7) / 2 + mosaic_noise(x, y, 8) / 8; break; /* wood */
    }
    for (int c = 0; c < 3; c++) rgb[c] = (uint8_t)txm_clampi(colours[texture][c] + v, 0, 255);
}

/* `count` textures in Voronoi cells round random sites; truth receives 0..count-1. */
static inline void draw_mosaic(uint8_t *pixels, uint8_t *truth, int side, int count,
                               uint64_t seed) {
    txm_rng rng = txm_rng_make(seed, 11);
    int texture[MOSAIC_TEXTURES], x[MOSAIC_SITES], y[MOSAIC_SITES];
    const int sites = count + (int)txm_rng_below(&rng, (uint32_t)count + 1), apart = side / 5;
    for (int i = 0; i < MOSAIC_TEXTURES; i++) texture[i] = i;
    txm_shuffle(&rng, texture, MOSAIC_TEXTURES);
    for (int i = 0; i < sites; i++) {
        for (int tries = 0, near_ = 1; near_ && tries < 1000; tries++) {
            x[i] = (int)txm_rng_below(&rng, (uint32_t)side);
            y[i] = (int)txm_rng_below(&rng, (uint32_t)side);
            near_ = 0;
            for (int j = 0; j < i; j++) {
                const int u = x[i] - x[j], v = y[i] - y[j];
                near_ |= u * u + v * v < apart * apart;
            }
        }
    }
    for (int k = 0; k < side * side; k++) {
        int best = 0, least = INT_MAX;
        for (int i = 0; i < sites; i++) {
            const int u = k % side - x[i], v = k / side - y[i];
            if (u * u + v * v >= least) continue;
            least = u * u + v * v;
            best = i % count;
        }
        truth[k] = (uint8_t)best;
        mosaic_texel(texture[best], k % side, k / side, pixels + 3 * k);
    }
}

/* The share of pixels whose label is the one that is matched with the truth, in the best of all
   matchings one to one. Pixels of TEXSYN_TRANSITION and TEXSYN_NO_LABEL do not count. */
static inline double mosaic_accuracy(const uint8_t *labels, const uint8_t *truth, int pixels,
                                     int count, int found) {
    static long together[TEXSYN_MAX_SEGMENTS][MOSAIC_MOST];
    long best[1 << MOSAIC_MOST] = {0}, all = 0;
    memset(together, 0, sizeof together);
    for (int i = 0; i < pixels; i++) {
        if (labels[i] >= found) continue;
        together[labels[i]][truth[i]]++;
        all++;
    }
    for (int l = 0; l < found; l++) /* more of the truth is matched in sets with higher numbers */
        for (int set = (1 << count) - 1; set > 0; set--)
            for (int t = 0; t < count; t++) {
                const long with = set >> t & 1 ? best[set ^ 1 << t] + together[l][t] : 0;
                if (with > best[set]) best[set] = with;
            }
    return all ? (double)best[(1 << count) - 1] / (double)all : 0;
}

#endif /* MOSAICKIT_H */
