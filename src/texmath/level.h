#ifndef TEXMATH_LEVEL_H
#define TEXMATH_LEVEL_H

#include "alpha.h"
#include "normal.h"

/* ---- kernel: levels of detail ----------------------------------------------------------- */

/* What the samples of a picture are; says how they are averaged. */
typedef enum txm_content {
    TXM_COLOR = 0, /* 8 and 16 bits: sRGB, averaged in linear light; float: linear light already.
                      Weighted by alpha, if there is any                                        */
    TXM_DATA,      /* quantities, every channel by itself                                      */
    TXM_NORMALS,   /* 3 or 4 channels, the first three unit vectors (txm_normal_decode): averaged as
                      vectors and brought back to unit length; the fourth as data              */
    TXM_LABELS     /* not averaged: one of them is taken                                       */
} txm_content;

/* Side of level k, 0 or more, of a picture: max(1, floor(side / 2^k)), as in OpenGL, Vulkan and
   Direct3D. */
static inline int txm_level_side(int side, int k) {
    return k > 30 || side >> k < 1 ? 1 : side >> k;
}

/* Which pixels of a row of `side` lie under pixel x of half the side, and how much of them, out of
   *total. Returns their number, 1 to 3: of an odd side 2 n + 1 each covers 2 + 1 / n pixels. */
static inline int txm_level_taps(int side, int x, double weight[3], double *total) {
    const int n = side / 2;
    *total = side > 1 && side % 2 ? side : side > 1 ? 2 : 1;
    if (side == 1) {
        weight[0] = 1;
        return 1;
    }
    weight[0] = side % 2 ? n - x : 1;
    weight[1] = side % 2 ? n : 1;
    weight[2] = x + 1;
    return 2 + side % 2;
}

/* The mean direction of vectors, v in any length, as samples. Those that cancel each other out
   have none: it is (0, 0, 1). */
static inline void txm_level_normal(const double v[3], txm_sample kind, float *sample) {
    const double length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    const int is_none = !(length > 1e-6);
    for (int c = 0; c < 3; c++) {
        const double unit = is_none ? c == 2 : v[c] / length;
        sample[c] = txm_float(txm_normal_encode(unit, kind));
    }
}

typedef struct txm_halving {
    const txm_image *image, *half;
    txm_content content;
    const float
        *linear;       /* linear light of each 8-bit sample; NULL: the samples are taken as they are
                            (or decoded one by one: 16 bits)                                    */
    const float *code; /* linear light at which each 8-bit sample but the first begins        */
} txm_halving;

/* pixel (x, y) as it is averaged */
static inline void txm_level_load(const txm_halving *h, const void *row, int x, float *pixel) {
    const txm_image *im = h->image;
    const int n = im->channels, colours = txm_image_colours(im);
    const size_t i = (size_t)x * (size_t)n;
    for (int c = 0; c < n; c++) {
        const int is_coded = h->content == TXM_COLOR && c < colours;
        if (im->sample == TXM_F32) {
            pixel[c] = ((const float *)row)[i + (size_t)c];
        } else if (im->sample == TXM_U16) {
            pixel[c] = (float)((const uint16_t *)row)[i + (size_t)c] / 65535.0f;
            if (is_coded) pixel[c] = txm_srgb_to_linear(pixel[c]);
        } else {
            const uint8_t sample = ((const uint8_t *)row)[i + (size_t)c];
            pixel[c] = is_coded ? h->linear[sample] : (float)sample / 255.0f;
        }
    }
}

/* the 8-bit sample of linear light, rounded to nearest in sRGB */
static inline uint8_t txm_level_code(const float *code, float light) {
    int low = 0; /* code[s - 1] <= light for all s <= low */
    for (int step = 128; step; step /= 2) {
        if (low + step < 256 && code[low + step - 1] <= light) low += step;
    }
    return (uint8_t)low;
}

static inline void txm_level_store(const txm_halving *h, int x, int y, const float *pixel) {
    const txm_image *to = h->half;
    const int n = to->channels, colours = txm_image_colours(to);
    for (int c = 0; c < n; c++) {
        const int is_coded = h->content == TXM_COLOR && c < colours && to->sample != TXM_F32;
        if (is_coded && to->sample == TXM_U8)
            ((uint8_t *)txm_image_row(to, y))[x * n + c] = txm_level_code(h->code, pixel[c]);
        else txm_image_set(to, x, y, c, is_coded ? txm_linear_to_srgb(pixel[c]) : pixel[c]);
    }
}

/* Pixel (x, y) of half: the mean of what it covers. */
static inline void txm_level_pixel(const txm_halving *h, int x, int y) {
    const txm_image *im = h->image;
    const int n = im->channels;
    double wx[3], wy[3], across, along, sum[4] = {0, 0, 0, 0};
    const int columns = txm_level_taps(im->width, x, wx, &across);
    const int rows = txm_level_taps(im->height, y, wy, &along);
    const int weighs_alpha = h->content == TXM_COLOR && n % 2 == 0;
    txm_mean mean = txm_mean_of(n);
    float pixel[4];
    for (int v = 0; v < rows; v++) {
        const void *row = txm_image_row_const(im, 2 * y + v);
        for (int u = 0; u < columns; u++) {
            const double weight = wx[u] * wy[v];
            txm_level_load(h, row, 2 * x + u, pixel);
            if (weighs_alpha) txm_mean_add(&mean, pixel, weight);
            for (int c = 0; c < n && !weighs_alpha; c++) {
                const int is_vector = h->content == TXM_NORMALS && c < 3;
                const double sample = (double)pixel[c];
                sum[c] += weight * (is_vector ? txm_normal_decode(sample, im->sample) : sample);
            }
        }
    }
    if (weighs_alpha) txm_mean_get(&mean, pixel);
    for (int c = 0; c < n && !weighs_alpha; c++) pixel[c] = txm_float(sum[c] / (across * along));
    if (h->content == TXM_NORMALS) txm_level_normal(sum, im->sample, pixel);
    txm_level_store(h, x, y, pixel);
}

static inline void txm_level_row(void *context, int y) {
    const txm_halving *h = (const txm_halving *)context;
    const txm_image *im = h->image, *to = h->half;
    const size_t bytes = txm_sample_bytes(im->sample) * (size_t)im->channels;
    if (h->content != TXM_LABELS) {
        for (int x = 0; x < to->width; x++) txm_level_pixel(h, x, y);
        return;
    }
    const char *from = (const char *)txm_image_row_const(im, 2 * y);
    char *out = (char *)txm_image_row(to, y);
    for (int x = 0; x < to->width; x++)
        memcpy(out + (size_t)x * bytes, from + (size_t)(2 * x) * bytes, bytes);
}

/* The next coarser level of detail: each pixel is the mean of what it covers, which is 2 x 2 pixels,
   or 3 along sides that are odd, the outer ones in part (so that no pixel is lost or counts
   twice). No pixel is taken from beyond the border, so the levels of a picture that tiles tile too.

   image    1 pixel or more
   content  how samples are averaged
   wrap     TXM_WRAP_X | TXM_WRAP_Y: the picture tiles that way (matters for hidden colour only)
   half     txm_level_side(side, 1) for both sides, channels and sample of image, not overlapping.
            The colour of its transparent pixels is that of visible neighbours, see txm_image_bleed;
            untouched after an error
   return   TXM_OK, TXM_BAD_ARGUMENT, TXM_TOO_LARGE, TXM_OUT_OF_MEMORY (only if colour is hidden)
   cost     about 30 ns per pixel of image on one thread                                   */
static inline txm_status txm_image_halve(const txm_image *image, txm_content content, int wrap,
                                         const txm_image *half, txm_env *env) {
    txm_status status = txm_image_check(image, "image", 0, env);
    if (status == TXM_OK) status = txm_image_check(half, "half", 0, env);
    if (status != TXM_OK) return status;
    const txm_image from = txm_image_resolve(*image), to = txm_image_resolve(*half);
    if (from.sample != to.sample || from.channels != to.channels)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "half",
                           "must have the channels and samples of image");
    if (to.width != txm_level_side(from.width, 1) || to.height != txm_level_side(from.height, 1))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "half",
                           "its sides must be half those of image, rounded down, and 1 at least");
    if (content == TXM_NORMALS && from.channels < 3)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "image", "a normal map has 3 or 4 channels");
    float linear[256], code[255];
    txm_halving h = {&from, &to, content, linear, code};
    txm_bleed bleed;
    txm_arena arena;
    const int may_hide = content == TXM_COLOR && txm_image_has_hidden(&from);
    txm_arena_init(&arena, env);
    if (may_hide) txm_bleed_begin(&bleed, &to, wrap, &arena);
    if (arena.failed) {
        txm_arena_free(&arena);
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to continue visible colours");
    }
    for (int i = 0; i < 256; i++) {
        linear[i] = txm_srgb_to_linear((float)i / 255.0f);
        if (i) code[i - 1] = txm_srgb_to_linear(((float)i - 0.5f) / 255.0f);
    }
    txm_parallel_for(env, to.height, txm_level_row, &h);
    if (may_hide && txm_image_has_hidden(&to)) {
        txm_env quiet; /* half is complete or untouched: it cannot be cancelled */
        memset(&quiet, 0, sizeof quiet);
        if (env) quiet = *env;
        quiet.progress = NULL;
        status = txm_bleed_run(&bleed, &quiet);
    }
    txm_arena_free(&arena);
    return status;
}

/* ---- cutouts ---------------------------------------------------------------------------- */

/* alpha of a pixel in 65535ths, rounded; 65535 without alpha */
static inline int txm_alpha_code(const txm_image *image, int x, int y) {
    if (!txm_image_has_alpha(image)) return 65535;
    const float alpha = txm_image_get(image, x, y, image->channels - 1);
    return (int)((double)txm_clampf(alpha, 0, 1) * 65535 + 0.5);
}

/* the smallest alpha, in 65535ths, that a test against threshold, 0..1, lets pass */
static inline int txm_alpha_limit(float threshold) {
    return (int)ceil((double)txm_clampf(threshold, 0, 1) * 65535);
}

/* The share of pixels, 0..1, whose alpha is threshold, 0..1, or more. */
static inline double txm_image_coverage(const txm_image *image, float threshold) {
    const txm_image im = txm_image_resolve(*image);
    const int limit = txm_alpha_limit(threshold);
    double count = 0;
    for (int y = 0; y < im.height; y++) {
        for (int x = 0; x < im.width; x++) count += txm_alpha_code(&im, x, y) >= limit;
    }
    return count / im.width / im.height;
}

/* Scale the alpha of a level of a cutout (leaves, fences) so that a test against threshold lets
   the same share of pixels pass as in the picture itself; means alone let thin parts vanish and
   gaps close [10]. Make all levels first, from each other, then scale each of them: coarser levels
   made from scaled ones would be wrong.

   image      in place; 2 or 4 channels, else untouched
   coverage   txm_image_coverage of the picture, 0..1: the nearest that any factor gives is taken
   threshold  above 0, up to 1; that of the test, mostly 0.5
   return     TXM_OK, TXM_BAD_ARGUMENT, TXM_TOO_LARGE, TXM_OUT_OF_MEMORY (untouched)       */
static inline txm_status txm_image_set_coverage(const txm_image *image, double coverage,
                                                float threshold, txm_env *env) {
    enum { CODES = 65536 };
    txm_status status = txm_image_check(image, "image", 0, env);
    if (status != TXM_OK) return status;
    if (!(coverage >= 0 && coverage <= 1 && threshold > 0 && threshold <= 1))
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "coverage must be 0 to 1, threshold above 0 and up to 1");
    const txm_image im = txm_image_resolve(*image);
    if (!txm_image_has_alpha(&im)) return TXM_OK;
    size_t *count = (size_t *)txm_alloc(env, CODES * sizeof *count);
    if (!count) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to count alphas");
    memset(count, 0, CODES * sizeof *count);
    for (int y = 0; y < im.height; y++) {
        for (int x = 0; x < im.width; x++) count[txm_alpha_code(&im, x, y)]++;
    }
    /* The limits that let a share nearest to coverage pass are those from first to last, for they
       lie between two alphas that occur; the pass must hold after the new alphas are rounded, so
       the middle is taken, unless the limit that there is will do. */
    const int limit = txm_alpha_limit(threshold);
    const double want = coverage * im.width * im.height;
    double nearest = want, passed = 0; /* of the limits from 65536 on, which nothing passes */
    int first = CODES, last = 2 * CODES;
    for (int t = CODES - 1; t > 0; t--) {
        passed += (double)count[t];
        const double miss = fabs(passed - want);
        if (miss < nearest) {
            nearest = miss;
            last = first = t;
        } else if (count[t] == 0 && first == t + 1) {
            first = t;
        }
    }
    txm_free(env, count);
    if (limit >= first && limit <= last) return TXM_OK;
    const int middle = first + (last - first) / 2;
    const double factor = (double)limit / middle;
    for (int y = 0; y < im.height; y++) {
        for (int x = 0; x < im.width; x++) {
            const float alpha = txm_image_get(&im, x, y, im.channels - 1);
            txm_image_set(&im, x, y, im.channels - 1,
                          txm_minf(txm_float((double)alpha * factor), 1));
        }
    }
    return TXM_OK;
}

#endif /* TEXMATH_LEVEL_H */
