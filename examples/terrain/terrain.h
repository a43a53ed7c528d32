/* terrain.h - the field, and the functions of each file
   SPDX-License-Identifier: MIT OR Unlicense */
#ifndef TERRAIN_H
#define TERRAIN_H

#include "texmath.h"

#include <stdio.h>
#include <stdlib.h>

enum { MEADOW, ROCK, SNOW, LABELS };
enum { WIDTH = 1200, HEIGHT = 600 }; /* of the picture */

typedef struct terrain {
    int size;
    float *height;                 /* in texels               */
    unsigned char *label, *texels; /* 1 and 3 bytes per texel */
    float *lit;                    /* 3 floats, linear light  */
} terrain;

/* the texel at x, y, or the nearest one of the field */
static inline size_t at(const terrain *t, int x, int y) {
    const int last = t->size - 1;
    return (size_t)txm_clampi(y, 0, last) * (size_t)t->size + (size_t)txm_clampi(x, 0, last);
}

static inline float smooth(float from, float to, float x) {
    const float t = txm_clampf((x - from) / (to - from), 0, 1);
    return t * t * (3 - 2 * t);
}

static inline void need(int holds, const char *message) {
    if (holds) return;
    fprintf(stderr, "terrain: %s\n", message);
    exit(1);
}

/* ---- ground.c ---- */
void make_ground(terrain *t); /* heights, and what lies where */
txm_vec3 normal_of(const terrain *t, int x, int y, int reach);

/* ---- view.c: WIDTH x HEIGHT pixels of 3 bytes ---- */
void render(const terrain *t, unsigned char *out);

#endif /* TERRAIN_H */
