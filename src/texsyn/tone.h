#ifndef TEXSYN_TONE_H
#define TEXSYN_TONE_H

#include "mosaic.h"

/* ---- values within their steps -----------------------------------------------------------

   A sampled value is a step of the quantisation. Where within the step? Smooth shades want the
   place that the neighbours suggest, grain a random one. What is taken is

       mix * smooth + (1 - mix) * random,

   with mix such that the mean difference of neighbours is that of the source. Positions are in
   steps of the band, so a value is q + position.                                            */

typedef struct txs_tone {
    const txs_mosaic *mosaic;
    const txs_ground *ground;
    const txs_level *level;
    int label, band;
    float *at;    /* value of each pixel in steps: known ones, and the smooth of the free ones */
    float *grain; /* the random place within the step                                          */
    float spread; /* of it: the share of a step                                                */
} txs_tone;

/* A number -1/2..1/2 that belongs to a pixel and band. */
static float txs_tone_noise(uint64_t seed, int x, int y, int band) {
    const uint64_t bits =
        txm_hash(((uint64_t)(unsigned)y << 32 | (unsigned)x) ^ txm_hash(seed + (uint64_t)band));
    return (float)(bits >> 40) / 16777216.0f - 0.5f;
}

static size_t txs_tone_index(const txs_tone *t, int x, int y) {
    return (size_t)y * (size_t)t->ground->width + (size_t)x;
}

/* Has the pixel the label, and is it there at all? */
static int txs_tone_has(const txs_tone *t, int x, int y) {
    return x >= 0 && y >= 0 && x < t->ground->width && y < t->ground->height &&
           t->ground->label[txs_tone_index(t, x, y)] == t->label;
}

/* Known values in steps; free ones start at the middle of theirs. */
static void txs_tone_start(txs_tone *t, uint64_t seed) {
    const size_t pixels = (size_t)t->ground->width * (size_t)t->ground->height;
    const double low = (double)t->level->low[t->band], step = (double)t->level->step[t->band];
    for (int y = 0; y < t->ground->height; y++) {
        for (int x = 0; x < t->ground->width; x++) {
            const size_t i = txs_tone_index(t, x, y);
            if (t->ground->label[i] != t->label) continue;
            if (t->ground->state[i] == TXS_FREE) {
                t->at[i] = txs_pixel(t->mosaic, x, y)[t->band * t->mosaic->canvas.plane];
                t->grain[i] = t->spread * txs_tone_noise(seed, x, y, t->band);
            } else {
                const double value = (double)t->ground->value[(size_t)t->band * pixels + i];
                t->at[i] = txm_float((value - low) / step);
            }
        }
    }
}

/* Sweeps of Gauss and Seidel: free pixels move towards the mean of their neighbours, within that
   share of their step that the source's values fill. */
static void txs_tone_smooth(txs_tone *t, int sweeps) {
    const float limit = t->spread / 2;
    for (int sweep = 0; sweep < sweeps; sweep++) {
        for (int y = 0; y < t->ground->height; y++) {
            for (int x = 0; x < t->ground->width; x++) {
                const size_t i = txs_tone_index(t, x, y);
                double sum = 0;
                int count = 0;
                if (t->ground->state[i] != TXS_FREE || t->ground->label[i] != t->label) continue;
                for (int k = 0; k < 4; k++) {
                    const int nx = x + (k == 0) - (k == 1), ny = y + (k == 2) - (k == 3);
                    if (!txs_tone_has(t, nx, ny)) continue;
                    sum += (double)t->at[txs_tone_index(t, nx, ny)];
                    count++;
                }
                if (!count) continue;
                const float q = txs_pixel(t->mosaic, x, y)[t->band * t->mosaic->canvas.plane];
                t->at[i] = txm_clampf(txm_float(sum / count), q - limit, q + limit);
            }
        }
    }
}

/* A free pixel's value for a mix, or a known one's. */
static double txs_tone_value(const txs_tone *t, int x, int y, double mix) {
    const size_t i = txs_tone_index(t, x, y);
    if (t->ground->state[i] != TXS_FREE) return (double)t->at[i];
    const double q = txs_pixel(t->mosaic, x, y)[t->band * t->mosaic->canvas.plane];
    return q + mix * ((double)t->at[i] - q) + (1 - mix) * (double)t->grain[i];
}

/* Does the pixel have the state, and is it not a hidden colour? */
static int txs_tone_counts(const txs_tone *t, int x, int y, int state) {
    const txs_ground *g = t->ground;
    const size_t i = txs_tone_index(t, x, y);
    if (g->state[i] != state) return 0;
    return state == TXS_FREE || !g->weight || g->alpha[t->label] == t->band || g->weight[i];
}

/* Mean difference of neighbours that both have a state; negative if there are none. */
static double txs_tone_roughness(const txs_tone *t, int state, double mix) {
    double sum = 0;
    int64_t count = 0;
    for (int y = 0; y < t->ground->height; y++) {
        for (int x = 0; x < t->ground->width; x++) {
            if (!txs_tone_has(t, x, y) || !txs_tone_counts(t, x, y, state)) continue;
            const double value = txs_tone_value(t, x, y, mix);
            for (int k = 0; k < 2; k++) {
                const int nx = x + !k, ny = y + k;
                if (!txs_tone_has(t, nx, ny) || !txs_tone_counts(t, nx, ny, state)) continue;
                sum += fabs(txs_tone_value(t, nx, ny, mix) - value);
                count++;
            }
        }
    }
    return count ? sum / (double)count : -1;
}

/* The mix that gives the free pixels the source's roughness. */
static double txs_tone_mix(const txs_tone *t) {
    enum { HALVINGS = 6 };
    const double wanted = txs_tone_roughness(t, TXS_SOURCE, 0);
    double low = 0, high = 1;
    if (wanted < 0) return 1;
    for (int i = 0; i < HALVINGS; i++) { /* more mix, less roughness */
        const double mix = (low + high) / 2;
        if (txs_tone_roughness(t, TXS_FREE, mix) > wanted) low = mix;
        else high = mix;
    }
    return (low + high) / 2;
}

/* Give the free pixels of a label their values in one band of the ground, from the canvas.
   at, grain: a number for each pixel. spread: the share of a step that the source's values fill. */
static void txs_tone_apply(const txs_mosaic *m, txs_ground *g, const txs_texture *texture,
                           int label, int band, float spread, uint64_t seed, float *at,
                           float *grain) {
    enum { SWEEPS = 8 };
    const size_t pixels = (size_t)g->width * (size_t)g->height;
    txs_tone t = {m, g, texture[label].level, label, band, at, grain, spread};
    txs_tone_start(&t, seed);
    txs_tone_smooth(&t, SWEEPS);
    const double mix = txs_tone_mix(&t);
    for (int y = 0; y < g->height; y++) {
        for (int x = 0; x < g->width; x++) {
            const size_t i = txs_tone_index(&t, x, y);
            if (g->state[i] != TXS_FREE || g->label[i] != label) continue;
            const float steps = txm_float(txs_tone_value(&t, x, y, mix));
            g->value[(size_t)band * pixels + i] =
                txm_float(txs_value(t.level, band, (double)steps));
        }
    }
}

#endif /* TEXSYN_TONE_H */
