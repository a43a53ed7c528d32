/* floor.c - a photograph in, a picture of an endless floor out
   SPDX-License-Identifier: MIT OR Unlicense

   floor PHOTO OUT.png

   How a game or a renderer uses textiles.h: a set of Wang tiles is cut out of the photograph and laid
   out as one small texture with mipmaps. Each lookup computes which tile lies at that place of the
   floor, so the floor never repeats. On a graphics card shaders/textiles.glsl does the lookups; here
   the CPU does, so that the example runs anywhere.                                               */
#define TEXTILES_IMPLEMENTATION
#include "textiles.h"

#include <stb/stb_image.h>
#include <stb/stb_image_write.h>
#include <stdio.h>

enum {
    WIDTH = 960, /* pixels of the picture                                              */
    HEIGHT = 540,
    TILE = 128, /* pixels a side: a power of two, so that mipmaps halve it evenly      */
    LEVELS = 8, /* from tiles of 128 pixels to tiles of one                            */
    SAMPLES = 8 /* lookups per pixel, one above the other: the floor is foreshortened  */
};

typedef struct floor_texture {
    textiles_plane plane;
    textiles_layout layout;
    txm_image level[LEVELS]; /* linear floats, RGB */
} floor_texture;

/* One mipmap level at (x, y), in its pixels; bilinear, wrapping around at the borders. */
static txm_vec3 sample_level(const txm_image *im, double x, double y) {
    const double fx = x - floor(x), fy = y - floor(y);
    txm_vec3 sum = txm_v3(0, 0, 0);
    for (int k = 0; k < 4; k++) {
        const int u = ((int)floor(x) + k % 2 + im->width) % im->width;
        const int v = ((int)floor(y) + k / 2 + im->height) % im->height;
        const float weight = (float)((k % 2 ? fx : 1 - fx) * (k / 2 ? fy : 1 - fy));
        const float *p = (const float *)txm_image_row_const(im, v) + 3 * u;
        sum = txm_vec3_add(sum, txm_vec3_scale(txm_v3(p[0], p[1], p[2]), weight));
    }
    return sum;
}

/* The floor at (x, y), in texels, as a pixel of the picture sees it that covers `extent` texels. */
static txm_vec3 sample_floor(const floor_texture *t, double x, double y, double extent) {
    const int column = (int)floor(x / TILE), row = (int)floor(y / TILE);
    int px, py;
    textiles_place(&t->layout, textiles_plane_tile(&t->plane, column, row), &px, &py, NULL, NULL);
    const double u = px + x - column * TILE, v = py + y - row * TILE;

    const double lod = txm_clampf((float)log2(extent), 0, LEVELS - 1);
    const int fine = (int)lod, coarse = fine + 1 < LEVELS ? fine + 1 : fine;
    const double a = 1.0 / (1 << fine), b = 1.0 / (1 << coarse);
    return txm_vec3_lerp(sample_level(&t->level[fine], u * a - 0.5, v * a - 0.5),
                         sample_level(&t->level[coarse], u * b - 0.5, v * b - 0.5),
                         (float)(lod - fine));
}

/* The atlas of a set in linear light, and its mipmaps. Returns NULL, or what went wrong. */
static const char *make_texture(const textiles_set *set, txm_env *env, floor_texture *t) {
    /* in the torus layout neighbouring tiles match, so filters need no gutters */
    if (textiles_plane_make(set, 1, env, &t->plane) != TXM_OK ||
        textiles_layout_make(set, TEXTILES_TORUS, 0, env, &t->layout) != TXM_OK)
        return env->message;
    const int width = t->layout.width, height = t->layout.height;
    txm_image atlas = {NULL, width, height, 3, TXM_U8, 0};
    for (int k = 0; k < LEVELS; k++) {
        const txm_image level = {NULL, width >> k, height >> k, 3, TXM_F32, 0};
        t->level[k] = level;
        t->level[k].pixels = malloc(sizeof(float) * 3 * (size_t)level.width * (size_t)level.height);
        if (!t->level[k].pixels) return "no memory";
    }
    const char *failed = NULL;
    unsigned char *bytes = atlas.pixels = malloc((size_t)width * (size_t)height * 3);
    if (!bytes) return "no memory";
    if (textiles_draw_atlas(set, &t->layout, 0, env, atlas) != TXM_OK) failed = env->message;
    for (size_t i = 0; !failed && i < (size_t)width * (size_t)height * 3; i++)
        ((float *)t->level[0].pixels)[i] = txm_srgb_to_linear((float)bytes[i] / 255.0f);
    for (int k = 1; !failed && k < LEVELS; k++) {
        if (txm_image_halve(&t->level[k - 1], TXM_COLOR, 0, &t->level[k], env) != TXM_OK)
            failed = env->message;
    }
    free(bytes);
    return failed;
}

/* One row of the picture: the camera is `eye` above the floor and looks slightly downwards. */
static void render_row(const floor_texture *t, int row, unsigned char *out) {
    const double eye = 3.5 * TILE, focus = 0.8 * WIDTH, horizon = 0.12 * HEIGHT;
    for (int x = 0; x < WIDTH; x++) {
        txm_vec3 sum = txm_v3(0, 0, 0);
        for (int k = 0; k < SAMPLES; k++) {
            const double below = row + (k + 0.5) / SAMPLES - horizon;
            const txm_vec3 sky = txm_v3(0.55f, 0.66f, 0.78f);
            txm_vec3 color = sky;
            if (below > 0.5) {
                const double far = eye * focus / below, right = (x - 0.5 * WIDTH) * far / focus;
                /* the footprint of the pixel on the floor */
                const double across = far / focus, along = across * far / eye / SAMPLES;
                color = sample_floor(t, 0.8 * right + 0.6 * far, 0.6 * right - 0.8 * far,
                                     along > across ? along : across);
                color = txm_vec3_lerp(sky, color, (float)exp(-far / (150.0 * TILE))); /* haze */
            }
            sum = txm_vec3_add(sum, color);
        }
        const float light[3] = {sum.x / SAMPLES, sum.y / SAMPLES, sum.z / SAMPLES};
        for (int c = 0; c < 3; c++) {
            const float shown = txm_clampf(txm_linear_to_srgb(light[c]), 0, 1);
            out[3 * x + c] = (unsigned char)(shown * 255.0f + 0.5f);
        }
    }
}

int main(int argc, char **argv) {
    if (argc != 3) {
        fprintf(stderr, "usage: floor PHOTO OUT.png\n");
        return 2;
    }
    txm_env env = {0};
    textiles_set *set = NULL;
    floor_texture texture = {0};
    txm_image photo = {NULL, 0, 0, 3, TXM_U8, 0};
    unsigned char *out = malloc((size_t)WIDTH * HEIGHT * 3);
    const char *failed = out ? NULL : "no memory";

    photo.pixels = stbi_load(argv[1], &photo.width, &photo.height, NULL, 3);
    if (!photo.pixels) failed = stbi_failure_reason();

    /* two edge colours: 16 tiles, each in two variants with different interiors; zeros = defaults */
    const textiles_exemplar exemplar = {&photo, 1};
    textiles_desc desc = {0};
    desc.exemplars = &exemplar;
    desc.exemplar_count = 1;
    desc.size = TILE;
    desc.variants = 2;
    if (!failed && textiles_make(&desc, &env, &set) != TXM_OK) failed = env.message;
    if (!failed) failed = make_texture(set, &env, &texture);
    for (int y = 0; !failed && y < HEIGHT; y++) render_row(&texture, y, out + (size_t)y * WIDTH * 3);
    if (!failed && !stbi_write_png(argv[2], WIDTH, HEIGHT, 3, out, 0))
        failed = "cannot write the picture";

    if (failed) fprintf(stderr, "floor: %s\n", failed);
    for (int k = 0; k < LEVELS; k++) free(texture.level[k].pixels);
    textiles_set_free(set);
    stbi_image_free(photo.pixels);
    free(out);
    return failed != NULL;
}
