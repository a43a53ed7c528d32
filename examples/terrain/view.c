/* view.c - light on the field, and a picture of it in perspective
   SPDX-License-Identifier: MIT OR Unlicense */
#include "terrain.h"

enum { FINE = 2 }; /* rays per pixel: FINE across, FINE * FINE down */

/* A low sun in the west casts shadows to the east; the sky lights what faces it. */
static void light_row(const terrain *t, int y) {
    const txm_vec3 sun = txm_vec3_normalize(txm_v3(-1, -0.25f, 0.75f));
    float shadow = 0; /* height up to which the ground lies in it; it falls by 0.7 a texel */
    for (int x = 0; x < t->size; x++) {
        const txm_vec3 n = normal_of(t, x, y, 1);
        const float ground = t->height[at(t, x, y)], facing = txm_vec3_dot(n, sun);
        const float open = 1 - smooth(0, 0.006f * (float)t->size, shadow - ground);
        const float light = 0.11f * (1 + n.z) + 1.15f * open * (facing > 0 ? facing : 0);
        for (size_t c = 3 * at(t, x, y), end = c + 3; c < end; c++)
            t->lit[c] = light * txm_srgb_to_linear((float)t->texels[c] / 255);
        shadow = (shadow > ground ? shadow : ground) - 0.7f;
    }
}

/* A field of floats between its texels; step: from one texel to the next. */
static float between(const terrain *t, const float *field, size_t step, float x, float y) {
    const int i = (int)x, j = (int)y;
    const float *p = field + step * at(t, i, j), *q = field + step * at(t, i, j + 1),
                s = x - (float)i;
    return txm_lerpf(txm_lerpf(p[0], p[step], s), txm_lerpf(q[0], q[step], s), y - (float)j);
}

/* One column of rays, from near to far: each piece of ground covers the rows above those that are
   covered already; what is left is sky. `sum` is a column of the picture, whose rows are WIDTH
   apart. The camera stands before the field and above it. */
static void render_column(const terrain *t, float column, txm_vec3 *sum) {
    const float size = (float)t->size, focus = 1.3f * WIDTH, horizon = 0.25f * HEIGHT;
    const float eye = 0.17f * size, back = 0.2f * size, aside = (column - 0.5f * WIDTH) / focus;
    const txm_vec3 haze = txm_v3(0.50f, 0.60f, 0.74f), zenith = txm_v3(0.14f, 0.27f, 0.58f);
    int covered = HEIGHT * FINE * FINE;
    for (float z = back; covered > 0; z += z / 1500) {
        const float x = 0.5f * size + aside * z, y = z - back;
        const int sky = y > size - 2;
        txm_vec3 color = haze;
        int top = 0;
        if (!sky) {
            if (x < 0 || x > size - 2) continue;
            const float high = between(t, t->height, 1, x, y);
            top = (int)((horizon - (high - eye) * focus / z) * FINE * FINE);
            if (top >= covered) continue;
            const txm_vec3 lit =
                txm_v3(between(t, t->lit, 3, x, y), between(t, t->lit + 1, 3, x, y),
                       between(t, t->lit + 2, 3, x, y));
            color = txm_vec3_lerp(haze, lit, txm_clampf(1.1f - 0.25f * z / size, 0, 1));
        }
        for (; covered > top && covered > 0; covered--) {
            const float up = 1 - (float)covered / (horizon * FINE * FINE);
            if (sky) color = txm_vec3_lerp(haze, zenith, txm_clampf(up, 0, 1));
            txm_vec3 *p = sum + (size_t)((covered - 1) / (FINE * FINE)) * WIDTH;
            *p = txm_vec3_add(*p, txm_vec3_scale(color, 1.0f / (FINE * FINE * FINE)));
        }
    }
}

void render(const terrain *t, unsigned char *out) {
    static txm_vec3 sum[WIDTH * HEIGHT];
    for (int y = 0; y < t->size; y++) light_row(t, y);
    for (int x = 0; x < WIDTH * FINE; x++)
        render_column(t, ((float)x + 0.5f) / FINE, sum + x / FINE);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        const float light[3] = {sum[i].x, sum[i].y, sum[i].z};
        for (int c = 0; c < 3; c++)
            out[3 * i + c] =
                (unsigned char)(255 * txm_clampf(txm_linear_to_srgb(light[c]), 0, 1) + 0.5f);
    }
}
