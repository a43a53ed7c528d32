/* pillar.c - a photograph of cracked stone in, a pillar of it out, more eroded towards its foot
   SPDX-License-Identifier: MIT OR Unlicense

   pillar WEATHERED OUT.png [STONE]

   What texsyn.h has for weathered stone, in five steps: find where WEATHERED is intact; learn the
   polished stone from there (or from STONE, another photograph); synthesise as much of it as the pillar
   needs; lay cracks like those of WEATHERED over it, at a level for each height; and, which is
   not texsyn.h's, cast a ray for each pixel onto a fluted column that carries the result.        */
#define TEXSYN_IMPLEMENTATION
#include "texsyn.h"

#include <stb/stb_image.h>
#include <stb/stb_image_write.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { WIDTH = 520, HEIGHT = 1040, ACROSS = 480, TALL = 1100, RAYS = 2, FLUTES = 20, STEPS = 80 };
static const double tall = 7.6, margin = 0.35; /* lengths are in radii of the shaft at its foot */

static txm_image image_of(void *pixels, int width, int height, int channels) {
    const txm_image image = {pixels, width, height, channels, TXM_U8, 0};
    return image;
}

static unsigned char *new_pixels(int width, int height, int channels) {
    return calloc((size_t)width * (size_t)height, (size_t)channels);
}

/* ---- the stone ---------------------------------------------------------------------------- */

/* Learn a stone where mask is white (or everywhere) and synthesise a sheet of it. */
static txm_status synthesise(txm_image photo, const txm_image *mask, txm_env *env, txm_image sheet) {
    texsyn_learn_desc learn = {0};
    texsyn_synth_desc synth = {0};
    texsyn_model *model = NULL;
    learn.example = photo;
    if (mask) learn.mask = *mask;
    txm_status status = texsyn_learn(&learn, env, &model);
    synth.model = model;
    synth.width = sheet.width;
    synth.height = sheet.height;
    synth.seed = 1;
    if (status == TXM_OK) status = texsyn_synthesize(&synth, env, sheet);
    texsyn_model_free(model);
    return status;
}

/* Erode a sheet, all of it at the foot, hardly at the top. */
static txm_status erode(const texsyn_erosion_desc *desc, txm_image levels, txm_env *env, txm_image sheet) {
    texsyn_erosion *erosion = NULL;
    txm_status status = texsyn_erosion_make(desc, env, &erosion);
    for (int y = 0; y < levels.height; y++) {
        const double down = (y + 0.5) / levels.height;
        for (int x = 0; x < levels.width; x++)
            txm_image_set(&levels, x, y, 0, (float)(0.03 + 0.97 * pow(down, 2.5)));
    }
    if (status == TXM_OK) status = texsyn_erosion_draw(erosion, 1, &levels, &sheet, env, sheet);
    texsyn_erosion_free(erosion);
    return status;
}

/* ---- the pillar --------------------------------------------------------------------------- */

/* The radius at height h (0 at the foot) in the direction of angle a: a tapering shaft with flutes
   between two mouldings. */
static double radius_at(double h, double a) {
    const double up = h / tall, shaft = 1 - 0.16 * up * up;
    const double foot = h / 0.55, head = (tall - h) / 0.6;
    double flutes = 0.09 * fabs(sin(a * FLUTES / 2)), moulding = 0;
    if (foot < 1) moulding = 0.04 + 0.1 * sqrt(fabs(sin(2 * TXM_PI * foot))); /* two rings */
    if (head < 1) moulding = 0.3 * (1 - head) * (1 - head) + 0.03;             /* spreads out */
    if (foot < 1.3 || head < 1.2) flutes = 0;
    return shaft * (1 - flutes) + moulding;
}

/* how far outside of the stone a point is; z points to the viewer */
static double outside(double x, double h, double z) {
    return sqrt(x * x + z * z) - radius_at(h, atan2(x, z));
}

/* The first point of stone on the ray through (x, h), or 0. */
static int hit(double x, double h, double *z) {
    const double nearest = 1.6, step = nearest / STEPS;
    if (h < 0 || h > tall) return 0;
    for (int k = 1; k <= STEPS; k++) {
        double in = nearest - k * step, out = in + step;
        if (outside(x, h, in) > 0) continue;
        for (int i = 0; i < 12; i++) {
            const double middle = (in + out) / 2;
            if (outside(x, h, middle) > 0) out = middle;
            else in = middle;
        }
        *z = in;
        return 1;
    }
    return 0;
}

/* Light from the upper left, light from everywhere, less of it deep in the flutes. */
static double light_at(double x, double h, double z) {
    const double d = 0.008, away = outside(x, h, z);
    const double nx = outside(x + d, h, z) - away, ny = outside(x, h + d, z) - away;
    const double nz = outside(x, h, z + d) - away, length = sqrt(nx * nx + ny * ny + nz * nz) + 1e-9;
    const double sun = (-0.62 * nx + 0.45 * ny + 0.64 * nz) / length;
    double open = 0;
    for (int k = 1; k <= 4; k++) { /* how fast the stone falls back along the normal */
        const double t = 0.05 * k;
        open += outside(x + t * nx / length, h + t * ny / length, z + t * nz / length) / t / 4;
    }
    return (0.34 + 0.2 * nz / length) * (open > 1 ? 1 : open) + 0.85 * (sun > 0 ? sun : 0);
}

/* The colour that one ray sees. */
static void cast(const txm_image *sheet, double x, double h, double colour[3]) {
    double z;
    if (!hit(x, h, &z)) {
        for (int c = 0; c < 3; c++) colour[c] = (c == 2 ? 0.86 : c ? 0.8 : 0.74) + 0.012 * (c - 1) * h;
        return;
    }
    const double light = light_at(x, h, z);
    const int u = txm_clampi((int)((atan2(x, z) / TXM_PI + 0.5) * sheet->width), 0, sheet->width - 1);
    const int v = txm_clampi((int)((1 - h / tall) * sheet->height), 0, sheet->height - 1);
    for (int c = 0; c < 3; c++) {
        const float stone = txm_image_get(sheet, u, v, sheet->channels < 3 ? 0 : c);
        colour[c] = (double)txm_linear_to_srgb((float)(light * (double)txm_srgb_to_linear(stone)));
    }
}

static void render(const txm_image *sheet, txm_image out) {
    const double pixel = (tall + 2 * margin) / out.height;
    for (int y = 0; y < out.height; y++) {
        for (int x = 0; x < out.width; x++) {
            double sum[3] = {0, 0, 0}, colour[3];
            for (int ray = 0; ray < RAYS * RAYS; ray++) {
                const int column = ray % RAYS, row = ray / RAYS;
                const double u = x + (column + 0.5) / RAYS, v = y + (row + 0.5) / RAYS;
                cast(sheet, (u - 0.5 * out.width) * pixel, tall + margin - v * pixel, colour);
                for (int c = 0; c < 3; c++) sum[c] += colour[c] / (RAYS * RAYS);
            }
            for (int c = 0; c < 3; c++) txm_image_set(&out, x, y, c, (float)sum[c]);
        }
    }
}

int main(int argc, char **argv) {
    int width = 0, height = 0, stone_width = 0, stone_height = 0;
    if (argc < 3 || argc > 4) {
        fprintf(stderr, "usage: pillar WEATHERED OUT.png [STONE]\n");
        return 2;
    }
    txm_env env = {0}; /* malloc, silent, one thread; receives the message after a failure */
    txm_status status = TXM_OK;
    unsigned char *weathered = stbi_load(argv[1], &width, &height, NULL, 3), *stone = NULL;
    if (argc == 4) stone = stbi_load(argv[3], &stone_width, &stone_height, NULL, 3);
    const char *failed = !weathered || (argc == 4 && !stone) ? stbi_failure_reason() : NULL;
    unsigned char *mask = failed ? NULL : new_pixels(width, height, 1);
    unsigned char *pixels = new_pixels(ACROSS, TALL, 3), *levels = new_pixels(ACROSS, TALL, 1);
    unsigned char *picture = new_pixels(WIDTH, HEIGHT, 3);
    if (!failed && (!mask || !pixels || !levels || !picture)) failed = "no memory";

    if (!failed) {
        texsyn_erosion_desc desc = {0}; /* what is left at zero takes its default */
        const txm_image intact = image_of(mask, width, height, 1);
        const txm_image sheet = image_of(pixels, ACROSS, TALL, 3);
        desc.weathered = image_of(weathered, width, height, 3);
        desc.width = ACROSS;
        desc.height = TALL;
        desc.share = 0.15f; /* of the foot */
        desc.seed = 1; /* another seed, other cracks */
        if (stone) {
            status = synthesise(image_of(stone, stone_width, stone_height, 3), NULL, &env, sheet);
        } else {
            status = texsyn_erosion_intact(&desc, &env, intact);
            if (status == TXM_OK) status = synthesise(desc.weathered, &intact, &env, sheet);
        }
        if (status == TXM_OK) status = erode(&desc, image_of(levels, ACROSS, TALL, 1), &env, sheet);
        if (status != TXM_OK) failed = env.message;
        else render(&sheet, image_of(picture, WIDTH, HEIGHT, 3));
    }
    if (!failed && !stbi_write_png(argv[2], WIDTH, HEIGHT, 3, picture, 0)) failed = "cannot write the picture";
    if (failed) fprintf(stderr, "pillar: %s\n", failed);
    stbi_image_free(weathered);
    stbi_image_free(stone);
    free(mask);
    free(pixels);
    free(levels);
    free(picture);
    return failed != NULL;
}
