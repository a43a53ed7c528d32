#ifndef TEXSYN_DARKNESS_H
#define TEXSYN_DARKNESS_H

#include "mask.h"

/* ---- darkness ---------------------------------------------------------------------------

   What erosion sees in its exemplar. Cracks and pits are darker than their surroundings, and
   cracks are also long. So each pixel has a darkness, its difference from the local mean in units
   of the local deviation, and a strength, the darkness averaged along the best of a dozen
   directions. Averaging along a crack bridges its interruptions and removes single dark pixels,
   but does not widen it. */

enum {
    TXS_NEARBY = 11,         /* pixels: radius of the local mean, three box filters of it        */
    TXS_AROUND = 24,         /* of the local deviation                                           */
    TXS_STEADY = 4,          /* gray levels of 255 added to the deviation: even areas stay even  */
    TXS_DIRECTIONS = 12,     /* of line segments                                                 */
    TXS_HALF_LINE = 8,       /* pixels on either side of a segment's middle                      */
    TXS_LINE = 2 * TXS_HALF_LINE + 1,
    TXS_RATIO_ONE = 160      /* stored ratio of a pixel as light as its surroundings             */
};
#define TXS_LEAST_DARK (-1.0f) /* darkness is limited to this range before it is averaged: one */
#define TXS_MOST_DARK 3.0f     /* black pixel makes no line                                    */
#define TXS_ALONG 0.75         /* weight of the line in the strength; the rest is the pixel's  */
#define TXS_INTACT 0.5f        /* less dark pixels count as intact surroundings                */

typedef struct txs_stone {
    int width, height;
    float *dark;     /* limited to TXS_LEAST_DARK..TXS_MOST_DARK; 0 where unknown             */
    float *strength; /* the same along lines                                                 */
    uint8_t *ratio;  /* 3 per pixel: colour over that of the intact surroundings             */
    uint8_t *known;  /* non-zero: opaque and inside the mask                                 */
} txs_stone;

/* One box filter along a line of count values that are step apart; zero beyond its ends. */
static void txs_box(float *p, size_t count, size_t step, size_t radius, float *line) {
    double sum = 0;
    for (size_t i = 0; i < count; i++) line[i] = p[i * step];
    for (size_t i = 0; i < radius && i < count; i++) sum += (double)line[i];
    for (size_t i = 0; i < count; i++) {
        if (i + radius < count) sum += (double)line[i + radius];
        p[i * step] = txm_float(sum / (double)(2 * radius + 1));
        if (i >= radius) sum -= (double)line[i - radius];
    }
}

/* Three box filters each way, nearly a Gaussian of sigma sqrt(radius (radius + 1)); line has room
   for the longer side. */
static void txs_blur(float *plane, int width, int height, int radius, float *line) {
    for (int pass = 0; pass < 3; pass++) {
        for (size_t y = 0; y < (size_t)height; y++)
            txs_box(plane + y * (size_t)width, (size_t)width, 1, (size_t)radius, line);
        for (size_t x = 0; x < (size_t)width; x++)
            txs_box(plane + x, (size_t)height, (size_t)width, (size_t)radius, line);
    }
}

/* sum / weight where there is weight */
static double txs_mean_at(const float *sum, const float *weight, size_t i) {
    return weight[i] > 1e-4f ? (double)sum[i] / (double)weight[i] : 0;
}

/* What pixel i of an image looks like, in gray levels of 255. */
static double txs_colour_at(const txm_image *im, size_t i, int c) {
    const int x = (int)(i % (size_t)im->width), y = (int)(i / (size_t)im->width);
    return 255 * (double)txm_image_get(im, x, y, im->channels < 3 ? 0 : c);
}
static double txs_luma_at(const txm_image *im, size_t i) {
    return 0.299 * txs_colour_at(im, i, 0) + 0.587 * txs_colour_at(im, i, 1) +
           0.114 * txs_colour_at(im, i, 2);
}

/* Four planes for the filters, and a line. */
typedef struct txs_filter_room {
    float *weight, *mean, *wide, *square, *line;
} txs_filter_room;

/* Darkness: (local mean - luma) / (local deviation + TXS_STEADY). */
static void txs_find_dark(txs_stone *s, const txm_image *im, const txs_filter_room *r) {
    const size_t n = txs_pixels_of(s->width, s->height);
    for (size_t i = 0; i < n; i++) {
        r->weight[i] = r->wide[i] = s->known[i] ? 1.0f : 0.0f;
        r->mean[i] = s->known[i] ? txm_float(txs_luma_at(im, i)) : 0.0f;
    }
    txs_blur(r->weight, s->width, s->height, TXS_NEARBY, r->line);
    txs_blur(r->mean, s->width, s->height, TXS_NEARBY, r->line);
    for (size_t i = 0; i < n; i++) {
        const double off = txs_mean_at(r->mean, r->weight, i) - txs_luma_at(im, i);
        s->dark[i] = s->known[i] ? txm_float(off) : 0.0f;
        r->square[i] = s->known[i] ? txm_float(off * off) : 0.0f;
    }
    txs_blur(r->wide, s->width, s->height, TXS_AROUND, r->line);
    txs_blur(r->square, s->width, s->height, TXS_AROUND, r->line);
    for (size_t i = 0; i < n; i++) {
        const double deviation = sqrt(txs_mean_at(r->square, r->wide, i));
        s->dark[i] = txm_clampf(txm_float((double)s->dark[i] / (deviation + (double)TXS_STEADY)),
                                TXS_LEAST_DARK, TXS_MOST_DARK);
    }
}

/* The colour of each pixel over the mean colour of the intact pixels around it. */
static void txs_find_ratios(txs_stone *s, const txm_image *im, const txs_filter_room *r) {
    const size_t n = txs_pixels_of(s->width, s->height);
    for (size_t i = 0; i < n; i++)
        r->weight[i] = s->known[i] && s->dark[i] < TXS_INTACT ? 1.0f : 0.0f;
    for (int c = 0; c < 3; c++) {
        for (size_t i = 0; i < n; i++)
            r->mean[i] = r->weight[i] > 0.5f ? txm_float(txs_colour_at(im, i, c)) : 0.0f;
        for (size_t i = 0; i < n && c == 0; i++) r->wide[i] = r->weight[i];
        if (c == 0) txs_blur(r->wide, s->width, s->height, TXS_NEARBY, r->line);
        txs_blur(r->mean, s->width, s->height, TXS_NEARBY, r->line);
        for (size_t i = 0; i < n; i++) {
            const double around = txs_mean_at(r->mean, r->wide, i);
            const double ratio = s->known[i] && around > 0.5 ? txs_colour_at(im, i, c) / around : 1;
            const double stored = floor(ratio * (double)TXS_RATIO_ONE + 0.5);
            s->ratio[3 * i + (size_t)c] = (uint8_t)(stored > 255 ? 255 : stored < 0 ? 0 : stored);
        }
    }
}

/* ---- strength along lines -------------------------------------------------------------- */

typedef struct txs_line_filter {
    const float *dark;
    float *strength;
    int width, height;
    int first, rows; /* where this part of the work begins, and rows of one share of it */
    int dx[TXS_DIRECTIONS][TXS_LINE], dy[TXS_DIRECTIONS][TXS_LINE];
} txs_line_filter;

static void txs_make_lines(txs_line_filter *f) {
    for (int d = 0; d < TXS_DIRECTIONS; d++) {
        double sine, cosine;
        txm_sincos(TXM_PI * d / (double)TXS_DIRECTIONS, &sine, &cosine);
        for (int k = 0; k < TXS_LINE; k++) {
            f->dx[d][k] = (int)floor((k - TXS_HALF_LINE) * cosine + 0.5);
            f->dy[d][k] = (int)floor((k - TXS_HALF_LINE) * sine + 0.5);
        }
    }
}

/* The largest of the sums along the lines through a pixel; beyond the border the nearest pixel
   stands for what is not there. */
static float txs_best_line(const txs_line_filter *f, int x, int y) {
    const int inside = x >= TXS_HALF_LINE && x < f->width - TXS_HALF_LINE && y >= TXS_HALF_LINE &&
                       y < f->height - TXS_HALF_LINE;
    float best = (float)TXS_LINE * TXS_LEAST_DARK;
    for (int d = 0; d < TXS_DIRECTIONS; d++) {
        double sum = 0;
        for (int k = 0; k < TXS_LINE; k++) {
            int u = x + f->dx[d][k], v = y + f->dy[d][k];
            if (!inside) {
                u = txm_clampi(u, 0, f->width - 1);
                v = txm_clampi(v, 0, f->height - 1);
            }
            sum += (double)f->dark[(size_t)v * (size_t)f->width + (size_t)u];
        }
        best = txm_maxf(best, txm_float(sum));
    }
    return best;
}

static void txs_filter_rows(void *context, int share) {
    const txs_line_filter *f = (const txs_line_filter *)context;
    const int from = f->first + share * f->rows;
    for (int y = from; y < from + f->rows && y < f->height; y++) {
        for (int x = 0; x < f->width; x++) {
            const size_t i = (size_t)y * (size_t)f->width + (size_t)x;
            f->strength[i] = txm_float(TXS_ALONG * (double)txs_best_line(f, x, y) / (double)TXS_LINE +
                                       (1 - TXS_ALONG) * (double)f->dark[i]);
        }
    }
}

/* strength of a plane of darkness, on the threads of env; reports from..to */
static txm_status txs_find_strength(const float *dark, float *strength, int width, int height,
                                    txm_env *env, float from, float to) {
    enum { SHARES = 16, PARTS = 8 }; /* a report after each part */
    txs_line_filter f;
    f.width = width;
    f.height = height;
    f.rows = 1 + (height - 1) / (SHARES * PARTS);
    f.dark = dark;
    f.strength = strength;
    txs_make_lines(&f);
    for (f.first = 0; f.first < height; f.first += SHARES * f.rows) {
        const float done = (float)f.first / (float)height;
        if (txm_progress(env, txm_lerpf(from, to, done), "find cracks"))
            return txm_fail(env, TXM_CANCELLED, "cancelled");
        txm_parallel_for(env, SHARES, txs_filter_rows, &f);
    }
    return TXM_OK;
}

#endif /* TEXSYN_DARKNESS_H */
