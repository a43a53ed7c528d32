/* ground.c - a height field, and which of the textures lies where
   SPDX-License-Identifier: MIT OR Unlicense */
#include "terrain.h"

static float lattice(int x, int y) {
    return (float)(txm_hash((uint64_t)(uint32_t)x << 32 | (uint32_t)y) >> 40) / (float)(1 << 24);
}

/* Smooth random values 0..1, one per unit square. */
static float value_noise(float x, float y) {
    const int i = (int)floorf(x), j = (int)floorf(y);
    const float s = smooth(0, 1, x - (float)i), t = smooth(0, 1, y - (float)j);
    return txm_lerpf(txm_lerpf(lattice(i, j), lattice(i + 1, j), s),
                     txm_lerpf(lattice(i, j + 1), lattice(i + 1, j + 1), s), t);
}

/* Height at x, y, all in sides of the field. Ridges lie where the noise passes its middle, and are
   rough where they are high; each octave is turned against the others. In front, y = 0, a valley. */
static float height_at(float x, float y) {
    float sum = 0, weight = 1, scale = 0.5f, u = 3.2f * x + 7, v = 3.2f * y + 3;
    for (int k = 0; k < 9; k++) {
        const float off = 2 * value_noise(u, v) - 1;
        const float crest = 1.02f - sqrtf(off * off + 0.0004f); /* rounded a little */
        const float ridge = crest * crest * weight;
        sum += ridge * scale;
        weight = txm_clampf(1.8f * ridge, 0, 1);
        scale *= 0.5f;
        const float turned = 1.6f * u - 1.2f * v;
        v = 1.2f * u + 1.6f * v;
        u = turned;
    }
    return sum * (0.04f + 0.21f * smooth(0.1f, 0.8f, y) * (1 - smooth(0.85f, 1, y)));
}

txm_vec3 normal_of(const terrain *t, int x, int y, int reach) {
    const float dx = t->height[at(t, x + reach, y)] - t->height[at(t, x - reach, y)];
    const float dy = t->height[at(t, x, y + reach)] - t->height[at(t, x, y - reach)];
    return txm_vec3_normalize(txm_v3(-dx, -dy, 2 * (float)reach));
}

/* Snow lies high up, slopes are bare, meadow is below; noise makes their borders ragged. */
static int label_of(const terrain *t, int x, int y) {
    const float u = 100 * (float)x / (float)t->size, v = 100 * (float)y / (float)t->size;
    const float ragged = value_noise(u, v) + 0.6f * value_noise(3 * u, 3 * v) +
                         0.3f * value_noise(9 * u, 9 * v) - 0.95f;
    const float steep = 1 - normal_of(t, x, y, 1 + t->size / 250).z + 0.06f * ragged;
    const float high = t->height[at(t, x, y)] / (float)t->size + 0.03f * ragged;
    if (high > 0.08f) return steep > 0.34f ? ROCK : SNOW;
    return steep > 0.12f || high > 0.072f ? ROCK : MEADOW;
}

void make_ground(terrain *t) {
    const float side = (float)t->size;
    for (int y = 0; y < t->size; y++)
        for (int x = 0; x < t->size; x++)
            t->height[at(t, x, y)] = side * height_at((float)x / side, (float)y / side);
    for (int y = 0; y < t->size; y++)
        for (int x = 0; x < t->size; x++)
            t->label[at(t, x, y)] = (unsigned char)label_of(t, x, y);
}
