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

/* sample i of a row as it is stored: 0 to 255, 0 to 65535, or a float */
static inline float txm_sample_code(const void *row, txm_sample sample, size_t i) {
    if (sample == TXM_F32) return ((const float *)row)[i];
    if (sample == TXM_U16) return (float)((const uint16_t *)row)[i];
    return (float)((const uint8_t *)row)[i];
}

/* sample i of a row; 8 bit: value / 255; 16 bit: value / 65535 */
static inline float txm_sample_get(const void *row, txm_sample sample, size_t i) {
    const float code = txm_sample_code(row, sample, i);
    return sample == TXM_F32 ? code : code / (sample == TXM_U16 ? 65535.0f : 255.0f);
}

/* sample c of pixel (x, y), all inside, as txm_sample_get gives it */
static inline float txm_image_get(const txm_image *image, int x, int y, int c) {
    const size_t i = (size_t)x * (size_t)(image->channels ? image->channels : 1) + (size_t)c;
    return txm_sample_get(txm_image_row_const(image, y), image->sample, i);
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

/* The n-th root of x > 0, n 2 or more, to an ulp or two: a guess from the exponent, then Newton. Sums,
   products and quotients only, so that the bits are the same everywhere, unlike those of pow. */
static inline double txm_root(double x, int n) {
    const uint64_t one = (uint64_t)1023 << 52;
    uint64_t bits;
    double y;
    if (!txm_is_finite(x)) return x;
    memcpy(&bits, &x, sizeof bits);
    bits = bits / (uint64_t)n + (one - one / (uint64_t)n); /* within 6 % */
    memcpy(&y, &bits, sizeof y);
    for (int i = 0; i < 5; i++) {
        double power = y;
        for (int k = 2; k < n; k++) power *= y;
        y += (x / power - y) / n;
    }
    return y;
}

/* sRGB code value to linear light and back [5]; 0..1 to 0..1. Outside, the same curves are
   extrapolated (below 0: the linear part); nothing is clamped. x^2.4 is x^2 times the fifth root of
   x^2, and x^(1/2.4) the twelfth root of x^5. */
static inline float txm_srgb_to_linear(float s) {
    if (s <= 0.04045f) return txm_float(s / 12.92);
    const double x = ((double)s + 0.055) / 1.055, xx = x * x;
    return txm_float(xx * txm_root(xx, 5));
}
static inline float txm_linear_to_srgb(float l) {
    if (l <= 0.0031308f) return txm_float(12.92 * (double)l);
    const double x = (double)l, xx = x * x;
    return txm_float(1.055 * txm_root(sqrt(sqrt(xx * xx * x)), 3) - 0.055);
}

#endif /* TEXMATH_IMAGE_H */
