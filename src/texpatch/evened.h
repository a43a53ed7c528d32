#ifndef TEXPATCH_EVENED_H
#define TEXPATCH_EVENED_H

#include "config.h"

/* ---- evened pictures ----------------------------------------------------------------------- */

/* In uneven light the slow part of a photograph is louder than its pattern. A pattern is looked for
   in gray pictures of which at each place the mean of the surroundings is 0 and the deviation 1. */

/* ours, see docs/choices.md */
enum {
    TXP_FINEST = 2600,  /* pixels of the longer side of the largest picture that is searched */
    TXP_COARSEST = 200, /* the same of the smallest one                                      */
    TXP_SIZES = 5,      /* pictures, each half as large as the one before, at most           */
    TXP_EVEN_PART = 8,  /* surroundings reach this part of the longer side ...               */
    TXP_EVEN_MOST = 64  /* ... but not more pixels than this                                 */
};
#define TXP_EVEN_FAINT 0.3 /* of the mean deviation: fainter surroundings are not raised further  */

/* A gray picture. */
typedef struct txp_gray {
    int width, height;
    float *at;    /* evened: 0 where nothing is known                          */
    float *known; /* 0..1: how much of the pixel is visible and not masked     */
} txp_gray;

/* How a photograph is reduced to its first gray picture. */
typedef struct txp_graying {
    const txm_image *image, *mask; /* mask without pixels: none */
    txp_gray *gray;
    int shrink; /* blocks of shrink x shrink pixels become one */
} txp_graying;

/* How much a pixel counts, 0..1. */
static inline double txp_visible(const txm_image *im, const txm_image *mask, int x, int y) {
    if (mask->pixels && !txm_mask_at(mask, x, y)) return 0;
    if (im->channels == 2 || im->channels == 4)
        return (double)txm_clampf(txm_image_get(im, x, y, im->channels - 1), 0, 1);
    return 1;
}

static void txp_gray_row(void *context, int row) {
    const txp_graying *g = (const txp_graying *)context;
    const txm_image *im = g->image;
    const int colours = im->channels < 3 ? 1 : 3, n = g->shrink;
    for (int column = 0; column < g->gray->width; column++) {
        double sum = 0, known = 0;
        int count = 0;
        for (int y = row * n; y < row * n + n && y < im->height; y++) {
            for (int x = column * n; x < column * n + n && x < im->width; x++, count++) {
                const double weight = txp_visible(im, g->mask, x, y);
                double value = 0;
                for (int c = 0; c < colours; c++) value += (double)txm_image_get(im, x, y, c);
                sum += weight * value;
                known += weight;
            }
        }
        const size_t at = (size_t)row * (size_t)g->gray->width + (size_t)column;
        g->gray->at[at] = known > 0 ? txm_float(sum / known) : 0;
        g->gray->known[at] = txm_float(known / count);
    }
}

static int txp_gray_new(txp_gray *g, int width, int height, txm_arena *arena) {
    const size_t count = (size_t)width * (size_t)height;
    g->width = width;
    g->height = height;
    g->at = (float *)txm_arena_alloc(arena, count, sizeof *g->at);
    g->known = (float *)txm_arena_alloc(arena, count, sizeof *g->known);
    return !arena->failed;
}

/* The next smaller picture; to: (width + 1) / 2 x (height + 1) / 2. */
static void txp_gray_halve(const txp_gray *from, txp_gray *to) {
    for (int y = 0; y < to->height; y++) {
        for (int x = 0; x < to->width; x++) {
            double sum = 0, known = 0;
            int count = 0;
            for (int v = 2 * y; v < 2 * y + 2 && v < from->height; v++) {
                for (int u = 2 * x; u < 2 * x + 2 && u < from->width; u++, count++) {
                    const size_t at = (size_t)v * (size_t)from->width + (size_t)u;
                    sum += (double)from->known[at] * (double)from->at[at];
                    known += (double)from->known[at];
                }
            }
            const size_t at = (size_t)y * (size_t)to->width + (size_t)x;
            to->at[at] = known > 0 ? txm_float(sum / known) : 0;
            to->known[at] = txm_float(known / count);
        }
    }
}

/* ---- means of surroundings ----------------------------------------------------------------- */

/* Sums over (2 reach + 1) x (2 reach + 1) pixels, cut off at the border, in place; sums: room for
   width numbers, copy: for width * height. */
static void txp_box_sums(float *at, int width, int height, int reach, double *sums, float *copy) {
    const size_t w = (size_t)width;
    for (int y = 0; y < height; y++) {
        const float *row = at + (size_t)y * w;
        double sum = 0;
        for (int x = 0; x < reach && x < width; x++) sum += (double)row[x];
        for (int x = 0; x < width; x++) {
            if (x + reach < width) sum += (double)row[x + reach];
            if (x - reach - 1 >= 0) sum -= (double)row[x - reach - 1];
            copy[(size_t)y * w + (size_t)x] = txm_float(sum);
        }
    }
    for (size_t x = 0; x < w; x++) sums[x] = 0;
    for (int y = 0; y < reach && y < height; y++)
        for (size_t x = 0; x < w; x++) sums[x] += (double)copy[(size_t)y * w + x];
    for (int y = 0; y < height; y++) {
        if (y + reach < height)
            for (size_t x = 0; x < w; x++) sums[x] += (double)copy[(size_t)(y + reach) * w + x];
        if (y - reach - 1 >= 0)
            for (size_t x = 0; x < w; x++) sums[x] -= (double)copy[(size_t)(y - reach - 1) * w + x];
        for (size_t x = 0; x < w; x++) at[(size_t)y * w + x] = txm_float(sums[x]);
    }
}

/* An evened copy of a gray picture: means over 2 reach + 1 pixels taken out. 0: no memory. */
static int txp_even(const txp_gray *from, int reach, txm_arena *arena, txm_env *env, txp_gray *to) {
    const size_t count = (size_t)from->width * (size_t)from->height;
    txm_arena scratch;
    txm_arena_init(&scratch, env);
    float *copy = (float *)txm_arena_alloc(&scratch, count, sizeof *copy);
    float *weight = (float *)txm_arena_alloc(&scratch, count, sizeof *weight);
    float *square = (float *)txm_arena_alloc(&scratch, count, sizeof *square);
    double *sums = (double *)txm_arena_alloc(&scratch, (size_t)from->width, sizeof *sums);
    if (!txp_gray_new(to, from->width, from->height, arena) || scratch.failed) {
        txm_arena_free(&scratch);
        return 0;
    }
    memcpy(to->known, from->known, count * sizeof *to->known);
    memcpy(weight, from->known, count * sizeof *weight);
    for (size_t i = 0; i < count; i++) to->at[i] = from->at[i] * from->known[i];
    txp_box_sums(weight, from->width, from->height, reach, sums, copy);
    txp_box_sums(to->at, from->width, from->height, reach, sums, copy);
    double all = 0, seen = 0;
    for (size_t i = 0; i < count; i++) {
        const double mean = weight[i] > 1e-3f ? (double)to->at[i] / (double)weight[i] : 0;
        to->at[i] = txm_float((double)from->known[i] * ((double)from->at[i] - mean));
        square[i] = txm_float((double)to->at[i] * (double)to->at[i]);
        all += (double)square[i];
        seen += (double)from->known[i];
    }
    txp_box_sums(square, from->width, from->height, reach, sums, copy);
    const double faint = seen > 0 ? TXP_EVEN_FAINT * sqrt(all / seen) : 0;
    for (size_t i = 0; i < count; i++) {
        const double mean = weight[i] > 1e-3f ? (double)square[i] / (double)weight[i] : 0;
        const double deviation = sqrt(mean > 0 ? mean : 0) + faint;
        to->at[i] = deviation > 0 ? txm_float((double)to->at[i] / deviation) : 0;
    }
    txm_arena_free(&scratch);
    return 1;
}

/* The evened pictures of a photograph, largest first. Returns their number; 0: no memory. */
static int txp_evened_sizes(const txm_image *image, const txm_image *mask, txm_arena *arena,
                            txm_env *env, txp_gray *sizes) {
    txp_graying g;
    txp_gray gray[TXP_SIZES];
    txm_arena scratch;
    const int longer = image->width > image->height ? image->width : image->height;
    int count = 0;
    txm_arena_init(&scratch, env);
    g.image = image;
    g.mask = mask;
    g.gray = &gray[0];
    g.shrink = (longer + TXP_FINEST - 1) / TXP_FINEST;
    int w = (image->width + g.shrink - 1) / g.shrink, h = (image->height + g.shrink - 1) / g.shrink;
    while (count < TXP_SIZES && (!count || (w > h ? w : h) >= TXP_COARSEST)) {
        if (!txp_gray_new(&gray[count], w, h, &scratch)) break;
        if (count) txp_gray_halve(&gray[count - 1], &gray[count]);
        else txm_parallel_for(env, h, txp_gray_row, &g);
        const int reach = (w > h ? w : h) / TXP_EVEN_PART;
        if (!txp_even(&gray[count], txm_clampi(reach, 4, TXP_EVEN_MOST), arena, env, &sizes[count]))
            break;
        count++;
        w = (w + 1) / 2;
        h = (h + 1) / 2;
    }
    if (scratch.failed || arena->failed) count = 0;
    txm_arena_free(&scratch);
    return count;
}

#endif /* TEXPATCH_EVENED_H */
