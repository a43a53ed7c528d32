/* terrain.c - three photographs in, mountains covered with texture that never repeats out
   SPDX-License-Identifier: MIT OR Unlicense

   terrain MEADOW ROCK SNOW OUT [SIZE]

   With photographs of the demo:
       make demo && build/examples/terrain out/lawn.png out/rock.png out/snow.png terrain

   A height field of SIZE x SIZE is generated (2048, or 64 to 4096); heights and slopes say where
   meadow, rock and snow lie. Of the photographs 256 x 256 pixels each are learned, side by side, as
   one composite texture of texsyn.h, with a label each; it then covers the field. Writes OUT-map.png,
   the texture seen from above, and OUT.png, the mountains in perspective.                         */
#define TEXSYN_IMPLEMENTATION
#include "texsyn.h"

#include <stb/stb_image.h>
#include <stb/stb_image_write.h>
#include <stdio.h>

enum { MEADOW, ROCK, SNOW, LABELS };
enum { PHOTO = 256 };                /* pixels a side                                  */
enum { WIDTH = 1200, HEIGHT = 600 }; /* of the picture                                 */
enum { QUALITY = -1 };               /* of the texture, -2 to 2                        */
enum { FINE = 2 };                   /* rays per pixel: FINE across, FINE * FINE down  */

typedef struct terrain {
    int size;
    float *height;                 /* in texels               */
    unsigned char *label, *texels; /* 1 and 3 bytes per texel */
    float *lit;                    /* 3 floats, linear light  */
} terrain;

/* the texel at x, y, or the nearest one of the field */
static size_t at(const terrain *t, int x, int y) {
    const int last = t->size - 1;
    return (size_t)txm_clampi(y, 0, last) * (size_t)t->size + (size_t)txm_clampi(x, 0, last);
}

static void need(int holds, const char *message) {
    if (holds) return;
    fprintf(stderr, "terrain: %s\n", message);
    exit(1);
}

static float smooth(float from, float to, float x) {
    const float t = txm_clampf((x - from) / (to - from), 0, 1);
    return t * t * (3 - 2 * t);
}

/* ---- the height field, and what lies where ------------------------------------------------ */

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

static txm_vec3 normal_of(const terrain *t, int x, int y, int reach) {
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

/* ---- the texture -------------------------------------------------------------------------- */

/* Photograph number k goes into the example, whose left part is full; its pixels get label k. */
static void add_photo(const char *name, int k, unsigned char *example, unsigned char *label) {
    int width, height;
    unsigned char *photo = stbi_load(name, &width, &height, NULL, 3);
    need(photo != NULL, "cannot read a photograph");
    need(width >= PHOTO && height >= PHOTO, "a photograph is under 256 x 256");
    for (int y = 0; y < PHOTO; y++) {
        const int to = (y * LABELS + k) * PHOTO;
        memcpy(example + 3 * to, photo + (ptrdiff_t)3 * y * width, (size_t)3 * PHOTO);
        memset(label + to, k, PHOTO);
    }
    stbi_image_free(photo);
}

/* Learn the composite and cover the field with it. */
static void cover(char **names, const terrain *t, txm_env *env) {
    static unsigned char example[3 * LABELS * PHOTO * PHOTO], label[LABELS * PHOTO * PHOTO];
    const txm_image out = {t->texels, t->size, t->size, 3, TXM_U8, 0};
    const texsyn_composite_learn_desc learn = {
        .example = {example, LABELS * PHOTO, PHOTO, 3, TXM_U8, 0},
        .labels = {label, LABELS * PHOTO, PHOTO, 1, TXM_U8, 0}};
    texsyn_composite_desc desc = {.width = t->size,
                                  .height = t->size,
                                  .quality = QUALITY,
                                  .layout = {t->label, t->size, t->size, 1, TXM_U8, 0}};
    texsyn_composite *composite;
    for (int k = 0; k < LABELS; k++) add_photo(names[k], k, example, label);
    need(texsyn_composite_learn(&learn, env, &composite) == TXM_OK, env->message);
    desc.composite = composite;
    need(texsyn_composite_synthesize(&desc, env, out) == TXM_OK, env->message);
    texsyn_composite_free(composite);
}

/* ---- the picture -------------------------------------------------------------------------- */

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

static void render(const terrain *t, const char *path) {
    static txm_vec3 sum[WIDTH * HEIGHT];
    static unsigned char out[WIDTH * HEIGHT][3];
    for (int y = 0; y < t->size; y++) light_row(t, y);
    for (int x = 0; x < WIDTH * FINE; x++)
        render_column(t, ((float)x + 0.5f) / FINE, sum + x / FINE);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        const float light[3] = {sum[i].x, sum[i].y, sum[i].z};
        for (int c = 0; c < 3; c++)
            out[i][c] =
                (unsigned char)(255 * txm_clampf(txm_linear_to_srgb(light[c]), 0, 1) + 0.5f);
    }
    need(stbi_write_png(path, WIDTH, HEIGHT, 3, out, 0), "cannot write the picture");
}

#ifdef _OPENMP
static void on_all_cores(void *user, int count, void (*body)(void *, int), void *context) {
    (void)user;
#pragma omp parallel for schedule(dynamic)
    for (int i = 0; i < count; i++) body(context, i);
}
#endif

int main(int argc, char **argv) {
    const int size = argc == 6 ? atoi(argv[5]) : 2048;
    if (argc < 5 || argc > 6 || size < 64 || size > 4096) {
        fprintf(stderr, "usage: terrain MEADOW ROCK SNOW OUT [SIZE]\n");
        return 2;
    }
    const size_t area = (size_t)size * (size_t)size;
    const terrain t = {size, malloc(area * sizeof(float)), malloc(area), malloc(3 * area),
                       malloc(3 * area * sizeof(float))};
    txm_env env = {0};
    char path[1024];
    need(t.height && t.label && t.texels && t.lit, "no memory");
#ifdef _OPENMP
    env.parallel_for = on_all_cores;
#endif
    for (int i = 0; i < size * size; i++) {
        const int x = i % size, y = i / size;
        t.height[i] = (float)size * height_at((float)x / (float)size, (float)y / (float)size);
    }
    for (int i = 0; i < size * size; i++)
        t.label[i] = (unsigned char)label_of(&t, i % size, i / size);
    cover(argv + 1, &t, &env);
    snprintf(path, sizeof path, "%s-map.png", argv[4]);
    need(stbi_write_png(path, size, size, 3, t.texels, 0), "cannot write the map");
    snprintf(path, sizeof path, "%s.png", argv[4]);
    render(&t, path);
    free(t.height);
    free(t.label);
    free(t.texels);
    free(t.lit);
    return 0;
}
