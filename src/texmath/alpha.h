#ifndef TEXMATH_ALPHA_H
#define TEXMATH_ALPHA_H

#include "image.h"

/* ---- colour and alpha ------------------------------------------------------------------- */

/* Alpha is straight: the last of 2 or 4 channels says how much of a pixel shows, and its colour is
   stored as if all of it did. Where alpha is 0 the colour is hidden: whatever a file has there was
   never seen by anybody, so it must not matter. Work on such pictures in three steps:

       in       txm_image_bled: hidden colour is replaced by that of the visible neighbours
       between  txm_mean: averages in which colour counts as much as it shows
       out      txm_image_bleed: so that other programs' filters show no fringe; where pixels are
                kept to the byte, txm_image_bleed_part of the others                          */

/* non-zero if the last channel is alpha: gray + alpha or RGBA */
static inline int txm_image_has_alpha(const txm_image *image) {
    return image->channels == 2 || image->channels == 4;
}

/* the channels of colour, those before alpha: 1 or 3 (2 if the caller says there is no alpha) */
static inline int txm_image_colours(const txm_image *image) {
    return image->channels < 2 ? 1 : image->channels - txm_image_has_alpha(image);
}

/* non-zero if the image has alpha and a pixel whose alpha is 0 (or less, or NaN) */
static inline int txm_image_has_hidden(const txm_image *image) {
    const size_t n = (size_t)image->channels, end = (size_t)image->width * n;
    if (!txm_image_has_alpha(image)) return 0;
    for (int y = 0; y < image->height; y++) {
        const void *row = txm_image_row_const(image, y);
        for (size_t i = n - 1; i < end; i += n) {
            if (!(txm_sample_code(row, image->sample, i) > 0)) return 1;
        }
    }
    return 0;
}

/* A weighted mean of pixels in which colour counts as much as it shows:

       colour = sum w a c / sum w a,   alpha = sum w a / sum w.

   Where nothing shows it is the plain mean of the colours. Of pixels without alpha, and of opaque
   ones, it is the plain mean to the last bit. */
typedef struct txm_mean {
    int channels;            /* 1..4; 2 and 4: the last is alpha                              */
    double weight, shown;    /* sum of w, of w a                                              */
    double sum[4], plain[4]; /* of w a c, of w c                                              */
} txm_mean;

/* An empty mean of pixels with that many channels. */
static inline txm_mean txm_mean_of(int channels) {
    txm_mean m;
    memset(&m, 0, sizeof m);
    m.channels = channels;
    return m;
}

/* Add a pixel with a weight. */
static inline void txm_mean_add(txm_mean *m, const float *pixel, double weight) {
    const int colours = m->channels - (m->channels % 2 == 0);
    double shown = weight;
    if (m->channels % 2 == 0) shown *= pixel[colours] > 0 ? (double)pixel[colours] : 0;
    m->weight += weight;
    m->shown += shown;
    for (int c = 0; c < colours; c++) {
        if (shown != 0) m->sum[c] += shown * (double)pixel[c];
        m->plain[c] += weight * (double)pixel[c];
    }
}

/* The mean; the sum of all weights must not be 0. */
static inline void txm_mean_get(const txm_mean *m, float *pixel) {
    const int colours = m->channels - (m->channels % 2 == 0), shows = m->shown > 0;
    for (int c = 0; c < colours; c++)
        pixel[c] = txm_float(shows ? m->sum[c] / m->shown : m->plain[c] / m->weight);
    if (colours < m->channels) pixel[colours] = txm_float(m->shown / m->weight);
}

/* all channels of pixel (x, y), inside the image, which is resolved */
static inline void txm_image_pixel(const txm_image *image, int x, int y, float *pixel) {
    const void *row = txm_image_row_const(image, y);
    const size_t n = (size_t)image->channels, i = (size_t)x * n;
    for (size_t c = 0; c < n; c++) pixel[c] = txm_sample_get(row, image->sample, i + c);
}

/* ---- kernel: hidden colour from the visible neighbours ---------------------------------- */

enum { TXM_WRAP_X = 1, TXM_WRAP_Y = 2 }; /* left meets right, top meets bottom                 */

enum {
    TXM_BLEED_LEVELS = 32,     /* an int has 31 bits                                           */
    TXM_BLEED_PIXELS = 1 << 20 /* between two reports of progress                              */
};

/* One level of the pyramid, lanes numbers a pixel: its colour, and how much that counts, 0..1. */
typedef struct txm_bleed_level {
    int width, height;
    float *pixels;
} txm_bleed_level;

typedef struct txm_bleed {
    txm_image image;
    const uint8_t *part; /* NULL, or a byte for each pixel: 0 where its colour stays            */
    int wrap, lanes, levels;
    int at, is_up, first;  /* the level that is made now, which way, and from which row on       */
    double done, pixels;   /* of all levels, both ways                                          */
    float from, to;        /* what is reported at the beginning and at the end                  */
    txm_bleed_level level[TXM_BLEED_LEVELS]; /* 0: unused, it is the image                      */
} txm_bleed;

/* pixel (x, y) of a level: colour and weight */
static inline void txm_bleed_get(const txm_bleed *b, int level, int x, int y, float *pixel) {
    if (level == 0) {
        txm_image_pixel(&b->image, x, y, pixel);
        return;
    }
    const txm_bleed_level *from = &b->level[level];
    memcpy(pixel, from->pixels + ((size_t)y * (size_t)from->width + (size_t)x) * (size_t)b->lanes,
           (size_t)b->lanes * sizeof(float));
}

/* One row of level `at` from the level below it: of 2 x 2 pixels, colour weighted by weight; a
   single visible pixel is enough for the full weight. */
static inline void txm_bleed_pull(void *context, int y) {
    const txm_bleed *b = (const txm_bleed *)context;
    const txm_bleed_level *to = &b->level[b->at];
    const int colours = b->lanes - 1;
    const int width = b->at > 1 ? b->level[b->at - 1].width : b->image.width;
    const int height = b->at > 1 ? b->level[b->at - 1].height : b->image.height;
    float *out = to->pixels + (size_t)y * (size_t)to->width * (size_t)b->lanes;
    for (int x = 0; x < to->width; x++, out += b->lanes) {
        double sum[3] = {0, 0, 0}, weight = 0;
        for (int v = 2 * y; v < 2 * y + 2 && v < height; v++) {
            for (int u = 2 * x; u < 2 * x + 2 && u < width; u++) {
                float pixel[4];
                txm_bleed_get(b, b->at - 1, u, v, pixel);
                if (!(pixel[colours] > 0)) continue;
                weight += (double)pixel[colours];
                for (int c = 0; c < colours; c++)
                    sum[c] += (double)pixel[colours] * (double)pixel[c];
            }
        }
        for (int c = 0; c < colours; c++) out[c] = weight > 0 ? txm_float(sum[c] / weight) : 0.0f;
        out[colours] = weight < 1 ? txm_float(weight) : 1.0f;
    }
}

/* the coarser pixel next to that of x, on the side where x lies, and x's own: 1/4 and 3/4 */
static inline void txm_bleed_sides(int x, int size, int wraps, int side[2]) {
    side[0] = x / 2;
    side[1] = side[0] + (x % 2 ? 1 : -1);
    if (side[1] < 0) side[1] = wraps ? size - 1 : 0;
    if (side[1] >= size) side[1] = wraps ? 0 : size - 1;
}

/* The colour of the level above `at` at pixel (x, y) of this one: linear between 2 x 2 pixels. */
static inline void txm_bleed_above(const txm_bleed *b, int x, int y, double *colour) {
    const txm_bleed_level *from = &b->level[b->at + 1];
    const int colours = b->lanes - 1;
    int u[2], v[2];
    txm_bleed_sides(x, from->width, b->wrap & TXM_WRAP_X, u);
    txm_bleed_sides(y, from->height, b->wrap & TXM_WRAP_Y, v);
    for (int c = 0; c < colours; c++) colour[c] = 0;
    for (int k = 0; k < 4; k++) {
        const double weight = (k % 2 ? 0.25 : 0.75) * (k / 2 ? 0.25 : 0.75);
        float pixel[4];
        txm_bleed_get(b, b->at + 1, u[k % 2], v[k / 2], pixel);
        for (int c = 0; c < colours; c++) colour[c] += weight * (double)pixel[c];
    }
}

/* One row of level `at`: what counts less than fully is completed from the level above. */
static inline void txm_bleed_push(void *context, int y) {
    const txm_bleed *b = (const txm_bleed *)context;
    const int colours = b->lanes - 1;
    double colour[3];
    if (b->at == 0) {
        for (int x = 0; x < b->image.width; x++) {
            if (txm_image_get(&b->image, x, y, colours) > 0) continue;
            if (b->part && !b->part[(size_t)y * (size_t)b->image.width + (size_t)x]) continue;
            txm_bleed_above(b, x, y, colour);
            for (int c = 0; c < colours; c++)
                txm_image_set(&b->image, x, y, c, txm_float(colour[c]));
        }
        return;
    }
    const txm_bleed_level *to = &b->level[b->at];
    float *out = to->pixels + (size_t)y * (size_t)to->width * (size_t)b->lanes;
    for (int x = 0; x < to->width; x++, out += b->lanes) {
        if (out[colours] >= 1) continue;
        const double own = (double)out[colours];
        txm_bleed_above(b, x, y, colour);
        for (int c = 0; c < colours; c++)
            out[c] = txm_float(own * (double)out[c] + (1 - own) * colour[c]);
    }
}

/* Make room for the pyramid of an image, which is resolved; arena->failed tells if there was none. */
static inline void txm_bleed_begin(txm_bleed *b, const txm_image *image, int wrap,
                                   txm_arena *arena) {
    int width = image->width, height = image->height;
    memset(b, 0, sizeof *b);
    b->image = *image;
    b->wrap = wrap;
    b->lanes = image->channels;
    b->pixels = (double)width * height;
    do {
        TXM_ASSERT(b->levels + 1 < TXM_BLEED_LEVELS);
        txm_bleed_level *to = &b->level[++b->levels];
        to->width = width = width / 2 + width % 2;
        to->height = height = height / 2 + height % 2;
        to->pixels = (float *)txm_arena_alloc(arena, (size_t)width * (size_t)height,
                                              (size_t)b->lanes * sizeof(float));
        b->pixels += 2.0 * width * height;
    } while (width > 1 || height > 1);
}

static inline void txm_bleed_row(void *context, int row) {
    const txm_bleed *b = (const txm_bleed *)context;
    if (b->is_up) txm_bleed_pull(context, b->first + row);
    else txm_bleed_push(context, b->first + row);
}

/* Make one level, some rows at a time. b->done counts pixels of all levels, of b->pixels. */
static inline txm_status txm_bleed_level_run(txm_bleed *b, int level, int is_up, txm_env *env) {
    const int width = level ? b->level[level].width : b->image.width;
    const int height = level ? b->level[level].height : b->image.height;
    const int some = TXM_BLEED_PIXELS / width + 1;
    b->at = level;
    b->is_up = is_up;
    for (b->first = 0; b->first < height; b->first += some) {
        const int rows = height - b->first < some ? height - b->first : some;
        if (txm_progress(env, txm_lerpf(b->from, b->to, (float)(b->done / b->pixels)), "colours"))
            return txm_fail(env, TXM_CANCELLED, "cancelled");
        txm_parallel_for(env, rows, txm_bleed_row, b);
        b->done += (double)rows * width;
    }
    return TXM_OK;
}

/* All levels. After a cancellation an unknown part of what is hidden is as it was. */
static inline txm_status txm_bleed_run(txm_bleed *b, txm_env *env) {
    txm_status status = TXM_OK;
    for (int l = 1; l <= b->levels && status == TXM_OK; l++)
        status = txm_bleed_level_run(b, l, 1, env);
    for (int l = b->levels - 1; l >= 0 && status == TXM_OK; l--)
        status = txm_bleed_level_run(b, l, 0, env);
    return status;
}

/* Replace the colour of fully transparent pixels, where alpha is 0, by a smooth continuation of
   the visible pixels, so that filters which average straight colours show no fringe. Nearest are
   the colours of the visible neighbours, further away those of wider surroundings (pull and push
   [9], weighted by alpha); all lie within the range of the visible colours. If nothing shows the
   colour becomes 0. Visible pixels and alpha are untouched, so pictures that differ in hidden
   colour alone become equal.

   image   in place; 1 or 3 channels, or nothing hidden: left as it is. Samples of any type; float
           ones must be finite where they show
   part    NULL: everywhere; or width * height bytes, row after row: 0 where even hidden colours stay
   wrap    TXM_WRAP_X | TXM_WRAP_Y: the picture tiles that way
   from, to  progress is reported as a fraction in this range, 0..1, stage "colours"
   return  TXM_OK; TXM_BAD_ARGUMENT, TXM_TOO_LARGE, TXM_OUT_OF_MEMORY: image is untouched;
           TXM_CANCELLED: a part of the hidden colours is replaced
   cost    a look at alpha if nothing is hidden; else about 50 ns per pixel on one thread, and
           (channels) * 4 / 3 bytes per pixel                                              */
static inline txm_status txm_image_bleed_part(const txm_image *image, const uint8_t *part, int wrap,
                                              float from, float to, txm_env *env) {
    txm_bleed b;
    txm_arena arena;
    txm_status status = txm_image_check(image, "image", 0, env);
    if (status != TXM_OK) return status;
    const txm_image im = txm_image_resolve(*image);
    if (!txm_image_has_hidden(&im)) return TXM_OK;
    txm_arena_init(&arena, env);
    txm_bleed_begin(&b, &im, wrap, &arena);
    if (arena.failed)
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to continue visible colours");
    else {
        b.part = part;
        b.from = from;
        b.to = to;
        status = txm_bleed_run(&b, env);
    }
    txm_arena_free(&arena);
    return status;
}

/* The same, everywhere, as the last thing that a call does: 1 is reported. */
static inline txm_status txm_image_bleed(const txm_image *image, int wrap, txm_env *env) {
    return txm_image_bleed_part(image, NULL, wrap, 1, 1, env);
}

/* The image as it is if nothing is hidden in it, else a copy whose hidden colour is bled: what a
   function that takes a picture should go on with, so that hidden colour cannot matter. It is the first
   thing that a call does: 0 is reported.

   wrap    as above
   arena   receives the copy
   out     receives the image, resolved, or the copy, with packed rows; untouched after an error
   return  TXM_OK, TXM_BAD_ARGUMENT, TXM_TOO_LARGE, TXM_OUT_OF_MEMORY, TXM_CANCELLED       */
static inline txm_status txm_image_bled(const txm_image *image, int wrap, txm_arena *arena,
                                        txm_env *env, txm_image *out) {
    txm_status status = txm_image_check(image, "image", 0, env);
    if (status != TXM_OK) return status;
    const txm_image from = txm_image_resolve(*image);
    if (!txm_image_has_hidden(&from)) {
        *out = from;
        return TXM_OK;
    }
    txm_image copy = from;
    const size_t row = (size_t)from.width * (size_t)from.channels * txm_sample_bytes(from.sample);
    copy.stride = (ptrdiff_t)row;
    copy.pixels = txm_arena_alloc(arena, (size_t)from.height, row);
    if (!copy.pixels)
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a copy of the picture");
    for (int y = 0; y < from.height; y++)
        memcpy(txm_image_row(&copy, y), txm_image_row_const(&from, y), row);
    status = txm_image_bleed_part(&copy, NULL, wrap, 0, 0, env);
    if (status == TXM_OK) *out = copy;
    return status;
}

#endif /* TEXMATH_ALPHA_H */
