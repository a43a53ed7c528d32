#ifndef TEXMATH_IMAGE_H
#define TEXMATH_IMAGE_H

#include "env.h"
#include "number.h"

/* ---- images ----------------------------------------------------------------------------- */

typedef enum txm_sample {
    TXM_U8 = 0,  /* 0..255, sRGB-encoded unless a function says otherwise         */
    TXM_F32 = 1, /* nominally 0..1                                                */
    TXM_U16 = 2  /* uint16_t, 0..65535, sRGB-encoded unless a function says otherwise */
} txm_sample;

/* A view of pixels that the caller owns: rows from top to bottom, channels interleaved. */
typedef struct txm_image {
    void *pixels;      /* first sample of the top row: uint8_t, uint16_t or float, aligned    */
    int width, height; /* pixels, 1 or more                                                   */
    int channels;      /* 1..4: gray, gray + alpha, RGB, RGBA; 0 = 1                          */
    txm_sample sample; /* sample type; 0 = 8 bit                                              */
    ptrdiff_t stride;  /* bytes from one row to the next; 0 = packed rows; negative: the rows lie
                          bottom-up in memory, pixels still points at the top one             */
} txm_image;

/* bytes of one sample */
static inline size_t txm_sample_bytes(txm_sample sample) {
    return sample == TXM_F32 ? sizeof(float) : sample == TXM_U16 ? sizeof(uint16_t) : 1;
}

/* Is this a valid view? Everything but the samples themselves is checked.

   name        what the caller calls the image, for the message: "mask: pixels is NULL; ..."
   max_pixels  refuse larger images; 0 = whatever the address space holds
   return      TXM_OK, TXM_BAD_ARGUMENT, TXM_TOO_LARGE                                    */
static inline txm_status txm_image_check(const txm_image *image, const char *name,
                                         size_t max_pixels, txm_env *env) {
    if (!image || !image->pixels)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name,
                           "pixels is NULL; point it at the first sample of the top row");
    if (image->width < 1 || image->height < 1)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name, "width and height must be 1 or more");
    if (image->channels < 0 || image->channels > 4)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name, "channels must be 1 to 4 (0 means 1)");
    if (image->sample != TXM_U8 && image->sample != TXM_U16 && image->sample != TXM_F32)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name,
                           "sample must be TXM_U8, TXM_U16 or TXM_F32");

    const size_t channels = image->channels ? (size_t)image->channels : 1;
    const size_t width = (size_t)image->width, height = (size_t)image->height;
    const size_t bytes = txm_sample_bytes(image->sample);
    size_t row, span;
    if (max_pixels && height > max_pixels / width)
        return txm_fail_at(env, TXM_TOO_LARGE, name,
                           "too many pixels; make it smaller or raise the limit");
    if (!txm_mul(width, channels, bytes, &row)) row = SIZE_MAX;
    /* the magnitude, also of PTRDIFF_MIN */
    size_t stride = image->stride < 0 ? 0 - (size_t)image->stride : (size_t)image->stride;
    if (stride == 0) stride = row;
    if (stride < row && row <= PTRDIFF_MAX)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name,
                           "stride is shorter than a row; give bytes per row, or 0 if packed");
    if (!txm_mul(stride, height - 1, 1, &span) || !txm_add(span, row, &span) || span > PTRDIFF_MAX)
        return txm_fail_at(env, TXM_TOO_LARGE, name,
                           "width * height * channels is beyond the address space; use tiles");
    if ((uintptr_t)image->pixels % bytes || stride % bytes)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name,
                           bytes == 2 ? "16-bit pixels and stride must be multiples of 2 bytes"
                                      : "float pixels and stride must be multiples of 4 bytes");
    return TXM_OK;
}

/* The same view, with channels and stride set where they were 0. The functions below do this
   themselves; it is for loops that access the samples directly. */
static inline txm_image txm_image_resolve(txm_image image) {
    if (image.channels == 0) image.channels = 1;
    if (image.stride == 0)
        image.stride = (ptrdiff_t)((size_t)image.width * (size_t)image.channels *
                                   txm_sample_bytes(image.sample));
    return image;
}

/* first sample of row y, 0..height-1; cast it to uint8_t *, uint16_t * or float * */
static inline void *txm_image_row(const txm_image *image, int y) {
    return (char *)image->pixels + txm_image_resolve(*image).stride * y;
}
static inline const void *txm_image_row_const(const txm_image *image, int y) {
    return txm_image_row(image, y);
}

/* sample c of pixel (x, y), all inside; 8 bit: value / 255; 16 bit: value / 65535 */
static inline float txm_image_get(const txm_image *image, int x, int y, int c) {
    const void *row = txm_image_row_const(image, y);
    const size_t i = (size_t)x * (size_t)(image->channels ? image->channels : 1) + (size_t)c;
    if (image->sample == TXM_F32) return ((const float *)row)[i];
    if (image->sample == TXM_U16) return (float)((const uint16_t *)row)[i] / 65535.0f;
    return (float)((const uint8_t *)row)[i] / 255.0f;
}

/* Store a sample. 8 and 16 bit: clamped to 0..1 (NaN to 0), times 255 or 65535, rounded; float: as
   it is. */
static inline void txm_image_set(const txm_image *image, int x, int y, int c, float value) {
    void *row = txm_image_row(image, y);
    const size_t i = (size_t)x * (size_t)(image->channels ? image->channels : 1) + (size_t)c;
    const double unit = (double)txm_clampf(value, 0, 1);
    if (image->sample == TXM_F32) ((float *)row)[i] = value;
    else if (image->sample == TXM_U16) ((uint16_t *)row)[i] = (uint16_t)(unit * 65535.0 + 0.5);
    else ((uint8_t *)row)[i] = (uint8_t)(unit * 255.0 + 0.5);
}

/* non-zero if no sample is infinite or NaN (8- and 16-bit samples never are) */
static inline int txm_image_is_finite(const txm_image *image) {
    const txm_image im = txm_image_resolve(*image);
    const size_t count = (size_t)im.width * (size_t)im.channels;
    if (im.sample != TXM_F32) return 1;
    for (int y = 0; y < im.height; y++) {
        const float *row = (const float *)txm_image_row_const(&im, y);
        for (size_t i = 0; i < count; i++) {
            if (!txm_is_finite(row[i])) return 0;
        }
    }
    return 1;
}

/* ---- colour ----------------------------------------------------------------------------- */

/* sRGB code value to linear light and back [5]; 0..1 to 0..1. Outside, the same curves are
   extrapolated (below 0: the linear part); nothing is clamped. */
static inline float txm_srgb_to_linear(float s) {
    return txm_float(s <= 0.04045f ? s / 12.92 : pow((s + 0.055) / 1.055, 2.4));
}
static inline float txm_linear_to_srgb(float l) {
    return txm_float(l <= 0.0031308f ? 12.92 * l : 1.055 * pow(l, 1 / 2.4) - 0.055);
}

/* ---- kernel: half size ------------------------------------------------------------------ */

/* One step of an image pyramid: each pixel of half is the mean of 2x2 pixels of image. If the
   width is odd the last column is averaged by itself, if the height is odd the last row, so that no
   pixel is lost. Samples are averaged as they are, so they should be linear.

   image, half  float, the same channels, not overlapping; half is (width + 1) / 2 x
                (height + 1) / 2 and receives the result, or is untouched after an error
   return       TXM_OK, TXM_BAD_ARGUMENT, TXM_TOO_LARGE                                    */
static inline txm_status txm_image_halve(const txm_image *image, const txm_image *half,
                                         txm_env *env) {
    txm_status status = txm_image_check(image, "image", 0, env);
    if (status == TXM_OK) status = txm_image_check(half, "half", 0, env);
    if (status != TXM_OK) return status;
    const txm_image from = txm_image_resolve(*image), to = txm_image_resolve(*half);
    if (from.sample != TXM_F32 || to.sample != TXM_F32 || from.channels != to.channels)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "half",
                           "image and half must both be TXM_F32 with the same channels");
    if (to.width != from.width / 2 + from.width % 2 ||
        to.height != from.height / 2 + from.height % 2)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "half",
                           "its sides must be half those of image, rounded up");
    const size_t n = (size_t)from.channels;
    for (int y = 0; y < to.height; y++) {
        const int rows = 2 * y + 1 < from.height ? 2 : 1;
        const float *upper = (const float *)txm_image_row_const(&from, 2 * y);
        const float *lower = (const float *)txm_image_row_const(&from, 2 * y + rows - 1);
        float *out = (float *)txm_image_row(&to, y);
        for (int x = 0; x < to.width; x++) {
            /* at an odd border the same pixel is simply taken twice */
            const size_t left = 2 * (size_t)x * n, right = 2 * x + 1 < from.width ? left + n : left;
            for (size_t c = 0; c < n; c++) {
                const double sum = ((double)upper[left + c] + upper[right + c]) +
                                   ((double)lower[left + c] + lower[right + c]);
                out[(size_t)x * n + c] = txm_float(sum * 0.25);
            }
        }
    }
    return TXM_OK;
}

#endif /* TEXMATH_IMAGE_H */
