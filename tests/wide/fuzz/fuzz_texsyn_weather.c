/* fuzz_texsyn_weather.c - pictures and masks of all kinds into relighting and erosion
   SPDX-License-Identifier: MIT OR Unlicense; fuzzkit.h says how to run it

   The bytes choose sizes, strides, channels, depths, values, masks and options.
   What is refused must have a message and leave the output alone. What is eroded at one level must be
   part of the next; grays must stay gray.                                                       */
#define TEXSYN_IMPLEMENTATION
#include "texsyn.h"

#define FUZZ_BYTES 1024
#include "fuzzkit.h"

static float some_number(source *s) {
    static const float odd[8] = {NAN, INFINITY, -1, 1e6f, 2e6f, -1e6f, 1e-30f, 2};
    return pick(s, 40) == 0 ? odd[pick(s, 8)] : (float)pick(s, 1001) / 1000;
}

/* An image of its own block, exactly as large as it must be; pixels NULL now and then. */
static txm_image some_image(source *s, int width, int height, int channels) {
    static const txm_sample samples[4] = {TXM_U8, TXM_U8, TXM_U16, TXM_F32};
    txm_image im = {0};
    im.width = width;
    im.height = height;
    im.channels = channels ? channels : pick(s, 30) ? pick(s, 5) : 6;
    im.sample = pick(s, 60) ? samples[pick(s, 4)] : (txm_sample)5;
    const int n = im.channels ? im.channels : 1;
    const size_t bytes = txm_sample_bytes(im.sample), row = (size_t)width * (size_t)n * bytes;
    const size_t stride = row + (size_t)pick(s, 3) * bytes;
    char *block = (char *)calloc(stride * (size_t)(height - 1) + row, 1);
    const int down = pick(s, 2);
    if (!block) exit(1);
    im.stride = down ? (ptrdiff_t)stride : -(ptrdiff_t)stride;
    im.pixels = down ? block : block + stride * (size_t)(height - 1);
    const int flat = pick(s, 6) == 0, period = 2 + pick(s, 9), is_valid = im.channels < 5 && im.sample < 3;
    for (int y = 0; y < height && is_valid; y++) {
        for (int x = 0; x < width; x++) {
            for (int c = 0; c < n; c++)
                txm_image_set(&im, x, y, c, flat ? 0.5f : x % period && y % period ? some_number(s) : 0.1f);
        }
    }
    return im;
}

static void drop(txm_image *im) {
    if (!im->pixels) return;
    free(im->stride < 0 ? (char *)im->pixels + im->stride * (im->height - 1) : (char *)im->pixels);
}

static txm_image some_mask(source *s, const txm_image *like) {
    txm_image none = {0};
    if (pick(s, 2)) return none;
    return some_image(s, like->width + (pick(s, 20) == 0), like->height, 0);
}

static void judge(txm_status status, const txm_env *env) {
    if (status == TXM_OK) fuzz_succeeded++;
    else if (!env->message[0]) abort();
}

static void fuzz_relight(source *s) {
    texsyn_relight_desc d = {0};
    txm_env env = {0};
    d.image = some_image(s, 1 + pick(s, 40), 1 + pick(s, 40), 0);
    d.like = some_image(s, 1 + pick(s, 40), 1 + pick(s, 40), 0);
    d.mask = some_mask(s, &d.image);
    d.like_mask = some_mask(s, &d.like);
    d.strength = pick(s, 4) ? 0 : some_number(s);
    txm_image out = some_image(s, d.image.width, d.image.height, d.image.channels < 5 ? d.image.channels : 1);
    texsyn_light light;
    judge(texsyn_relight(&d, &env, out), &env);
    if (texsyn_light_learn(&d, &env, &light) == TXM_OK) {
        uint16_t gray[3] = {0, 0, 0}, lit[3];
        gray[0] = gray[1] = gray[2] = (uint16_t)pick(s, 65536);
        const txm_image from = {gray, 1, 1, 3, TXM_U16, 0}, to = {lit, 1, 1, 3, TXM_U16, 0};
        if (texsyn_light_apply(&light, 1, &from, &env, to) != TXM_OK) abort();
        if (lit[0] != lit[1] || lit[0] != lit[2]) abort();
    }
    drop(&d.image);
    drop(&d.like);
    drop(&d.mask);
    drop(&d.like_mask);
    drop(&out);
}

static void fuzz_erosion(source *s) {
    texsyn_erosion_desc d = {0};
    txm_env env = {0};
    texsyn_erosion *erosion = NULL;
    d.weathered = some_image(s, 25 + pick(s, 60), 25 + pick(s, 60), 0);
    d.mask = some_mask(s, &d.weathered);
    d.share = pick(s, 3) ? 0 : 0.6f * some_number(s);
    d.width = pick(s, 70);
    d.height = pick(s, 70);
    d.seed = (uint64_t)pick(s, 65536);
    txm_image intact = some_image(s, d.weathered.width, d.weathered.height, pick(s, 9) ? 1 : 0);
    judge(texsyn_erosion_make(&d, &env, &erosion), &env);
    judge(texsyn_erosion_intact(&d, &env, intact), &env);
    if (erosion) {
        uint8_t *mask[2] = {(uint8_t *)calloc((size_t)d.width, (size_t)d.height),
                            (uint8_t *)calloc((size_t)d.width, (size_t)d.height)};
        if (!mask[0] || !mask[1]) exit(1);
        const float a = (float)pick(s, 1001) / 1000, b = (float)pick(s, 1001) / 1000;
        txm_image levels = some_mask(s, &(const txm_image){NULL, d.width, d.height, 1, TXM_U8, 0});
        const txm_image *given = levels.pixels ? &levels : NULL;
        int ok = 1;
        for (int k = 0; k < 2; k++) {
            const txm_image out = {mask[k], d.width, d.height, 1, TXM_U8, 0};
            const txm_status status = texsyn_erosion_mask(erosion, (a < b) == (k == 0) ? a : b, given, &env, out);
            judge(status, &env);
            ok = ok && status == TXM_OK;
        }
        for (int i = 0; i < d.width * d.height && ok; i++)
            if (mask[0][i] > mask[1][i]) abort();
        txm_image from = some_image(s, d.width, d.height, 0);
        txm_image out = some_image(s, d.width, d.height, from.channels < 5 ? from.channels : 1);
        judge(texsyn_erosion_draw(erosion, some_number(s), given, &from, &env, out), &env);
        drop(&levels);
        drop(&from);
        drop(&out);
        free(mask[0]);
        free(mask[1]);
    }
    texsyn_erosion_free(erosion);
    drop(&d.weathered);
    drop(&d.mask);
    drop(&intact);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    source s = source_of(data, size);
    if (pick(&s, 2)) fuzz_relight(&s);
    else fuzz_erosion(&s);
    return 0;
}
