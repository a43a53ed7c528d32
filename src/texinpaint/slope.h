#ifndef TEXINPAINT_SLOPE_H
#define TEXINPAINT_SLOPE_H

#include "raster.h"

/* ---- gradients --------------------------------------------------------------------------- */

enum {
    TXI_GRADIENT_UNIT = 64, /* stored gradients are in 1/64 of a level per pixel               */
    TXI_GRADIENT_TAPS = 3,  /* pixels; radius of the derivative of a Gaussian of sigma 1.2       */
    TXI_TENSOR_TAPS = 3,    /* pixels; radius of the Gaussian of sigma 1.5 over the tensor      */
    TXI_BAND_ROWS = 32,     /* rows that one call of a parallel loop computes                   */
    TXI_BANDS = 8,          /* calls of one loop                                                */
};

/* Gradients of a window. */
typedef struct txi_slopes {
    int width, height;
    const uint8_t *color; /* 4 per pixel                                                        */
    uint8_t *known;      /* 1: the colour counts                                                */
    int32_t *gap;        /* squared distance to the nearest pixel that is not known; this and tensor
                            only while lines are followed                                       */
    int16_t *gradient;   /* 6 per pixel: x and y of R, G, B; 0 where unknown                     */
    float *strength;     /* root of the sum of their squares, levels per pixel                  */
    int32_t *tensor;     /* sums of xx, xy, yy over RGB, smoothed, (1/16 level per pixel)^2       */
} txi_slopes;

/* 64 exp(-k^2 / 2 / 1.2^2): the derivative of a Gaussian is the slope of the plane that fits best
   with these weights. Next to pixels that are not known the plane is fitted to the known ones, so
   that the borders of the hole and of the surface are no edges. */
static const int txi_gradient_weight[TXI_GRADIENT_TAPS + 1] = {64, 45, 16, 3};

/* The slopes of the planes through the known pixels around (x, y): 6 numbers, levels per pixel. */
static void txi_slope(const txi_slopes *f, int x, int y, double slope[6]) {
    double m[6] = {0, 0, 0, 0, 0, 0}, v[3][3] = {{0}}; /* 1, x, y, xx, xy, yy; per channel 1, x,
                                                          y                                      */
    for (int j = -TXI_GRADIENT_TAPS; j <= TXI_GRADIENT_TAPS; j++) {
        for (int i = -TXI_GRADIENT_TAPS; i <= TXI_GRADIENT_TAPS; i++) {
            const int px = x + i, py = y + j;
            if (px < 0 || py < 0 || px >= f->width || py >= f->height) continue;
            const size_t at = (size_t)py * (size_t)f->width + (size_t)px;
            if (!f->known[at]) continue;
            const double w =
                txi_gradient_weight[i < 0 ? -i : i] * txi_gradient_weight[j < 0 ? -j : j];
            m[0] += w;
            m[1] += w * i;
            m[2] += w * j;
            m[3] += w * i * i;
            m[4] += w * i * j;
            m[5] += w * j * j;
            for (int c = 0; c < 3; c++) {
                const double value = w * f->color[4 * at + (size_t)c];
                v[c][0] += value;
                v[c][1] += value * i;
                v[c][2] += value * j;
            }
        }
    }
    for (int c = 0; c < 6; c++) slope[c] = 0;
    if (m[0] <= 0) return;
    const double xx = m[3] - m[1] * m[1] / m[0], xy = m[4] - m[1] * m[2] / m[0];
    const double yy = m[5] - m[2] * m[2] / m[0], det = xx * yy - xy * xy;
    if (det < 0.05 * m[0] * m[0]) return; /* pixels in one line, or too few: no slope             */
    for (int c = 0; c < 3; c++) {
        const double gx = v[c][1] - m[1] * v[c][0] / m[0], gy = v[c][2] - m[2] * v[c][0] / m[0];
        slope[2 * c] = (yy * gx - xy * gy) / det;
        slope[2 * c + 1] = (xx * gy - xy * gx) / det;
    }
}

static int16_t txi_gradient_round(double slope) {
    const double v = slope * (double)TXI_GRADIENT_UNIT;
    return (int16_t)(v < -32000 ? -32000 : v > 32000 ? 32000 : v < 0 ? v - 0.5 : v + 0.5);
}

/* The job of one band of rows. rows: scratch of this band, 6 * width * (TXI_BAND_ROWS + 6) ints */
typedef struct txi_slopes_job {
    txi_slopes *field;
    const int32_t *away; /* gradients are computed where this is at most reach; NULL: everywhere  */
    int32_t reach;
    int32_t *rows;
    int first;           /* band of index 0                                                     */
    int smooth;          /* 0: the gradients, 1: the tensor                                     */
} txi_slopes_job;

/* Horizontal sums of row y: smoothed and derived, RGB each. */
static void txi_gradient_row(const txi_slopes *f, int y, int32_t *out) {
    const uint8_t *c = f->color + 4 * (size_t)y * (size_t)f->width;
    for (int x = TXI_GRADIENT_TAPS; x < f->width - TXI_GRADIENT_TAPS; x++) {
        const uint8_t *p = c + 4 * x;
        for (int k = 0; k < 3; k++) {
            out[6 * x + k] = 64 * p[k] + 45 * (p[k - 4] + p[k + 4]) + 16 * (p[k - 8] + p[k + 8]) +
                             3 * (p[k - 12] + p[k + 12]);
            out[6 * x + 3 + k] = 45 * (p[k + 4] - p[k - 4]) + 32 * (p[k + 8] - p[k - 8]) +
                                 9 * (p[k + 12] - p[k - 12]);
        }
    }
}

static void txi_gradient_pixel(txi_slopes *f, int x, int y, const int32_t *row0, size_t pitch) {
    const size_t i = (size_t)y * (size_t)f->width + (size_t)x;
    const int taps = TXI_GRADIENT_TAPS;
    double slope[6], sum = 0;
    if (f->gap[i] > 2 * taps * taps && x >= taps && y >= taps && x < f->width - taps &&
        y < f->height - taps) {
        /* the sum of the weights is 192, that of weight * k^2 is 272                             */
        for (int c = 0; c < 3; c++) {
            int gx = 0, gy = 0;
            for (int k = -taps; k <= taps; k++) {
                const int32_t *r = row0 + (size_t)(k + taps) * pitch + 6 * (size_t)x;
                const int w = txi_gradient_weight[k < 0 ? -k : k];
                gx += w * r[3 + c];
                gy += w * k * r[c];
            }
            slope[2 * c] = gx / (192.0 * 272.0);
            slope[2 * c + 1] = gy / (192.0 * 272.0);
        }
    } else {
        txi_slope(f, x, y, slope);
    }
    for (int c = 0; c < 6; c++) {
        const int16_t g = txi_gradient_round(slope[c]);
        f->gradient[6 * i + (size_t)c] = g;
        sum += (double)g * g;
    }
    f->strength[i] = txm_float(sqrt(sum) / (double)TXI_GRADIENT_UNIT);
}

static void txi_gradient_band(const txi_slopes_job *job, int y0, int y1, int32_t *rows) {
    txi_slopes *f = job->field;
    const size_t pitch = 6 * (size_t)f->width;
    const int taps = TXI_GRADIENT_TAPS;
    for (int y = y0 - taps; y < y1 + taps; y++) {
        if (y >= 0 && y < f->height)
            txi_gradient_row(f, y, rows + (size_t)(y - y0 + taps) * pitch);
    }
    for (int y = y0; y < y1; y++) {
        for (int x = 0; x < f->width; x++) {
            const size_t i = (size_t)y * (size_t)f->width + (size_t)x;
            if (f->known[i] && (!job->away || job->away[i] <= job->reach))
                txi_gradient_pixel(f, x, y, rows + (size_t)(y - y0) * pitch, pitch);
        }
    }
}

/* xx, xy, yy of one row, smoothed horizontally by {18, 14, 7, 2} / 64. */
static void txi_tensor_row(const txi_slopes *f, int y, int32_t *out, int32_t *raw) {
    const int16_t *g = f->gradient + 6 * (size_t)y * (size_t)f->width;
    for (int x = 0; x < f->width; x++) {
        int32_t *t = raw + 3 * x;
        t[0] = t[1] = t[2] = 0;
        for (int c = 0; c < 3; c++) {
            const int gx = g[6 * x + 2 * c] / 4, gy = g[6 * x + 2 * c + 1] / 4;
            t[0] += gx * gx;
            t[1] += gx * gy;
            t[2] += gy * gy;
        }
        for (int k = 0; k < 3; k++) t[k] = t[k] > 16000000 ? 16000000 : t[k];
    }
    for (int x = 0; x < f->width; x++) {
        for (int k = 0; k < 3; k++) {
            int sum = 18 * raw[3 * x + k];
            if (x >= 1) sum += 14 * raw[3 * (x - 1) + k];
            if (x >= 2) sum += 7 * raw[3 * (x - 2) + k];
            if (x >= 3) sum += 2 * raw[3 * (x - 3) + k];
            if (x + 1 < f->width) sum += 14 * raw[3 * (x + 1) + k];
            if (x + 2 < f->width) sum += 7 * raw[3 * (x + 2) + k];
            if (x + 3 < f->width) sum += 2 * raw[3 * (x + 3) + k];
            out[3 * x + k] = sum / 64;
        }
    }
}

static void txi_tensor_band(const txi_slopes_job *job, int y0, int y1, int32_t *rows) {
    static const int weight[TXI_TENSOR_TAPS + 1] = {18, 14, 7, 2};
    txi_slopes *f = job->field;
    const size_t pitch = 3 * (size_t)f->width;
    const int taps = TXI_TENSOR_TAPS;
    int32_t *raw = rows + (size_t)(TXI_BAND_ROWS + 2 * taps) * pitch;
    for (int y = y0 - taps; y < y1 + taps; y++) {
        int32_t *out = rows + (size_t)(y - y0 + taps) * pitch;
        if (y >= 0 && y < f->height) txi_tensor_row(f, y, out, raw);
        else memset(out, 0, pitch * sizeof *out);
    }
    for (int y = y0; y < y1; y++) {
        int32_t *t = f->tensor + (size_t)y * pitch;
        for (size_t i = 0; i < pitch; i++) {
            int sum = 0;
            for (int k = -taps; k <= taps; k++)
                sum += weight[k < 0 ? -k : k] * rows[(size_t)(y - y0 + taps + k) * pitch + i];
            t[i] = sum / 64;
        }
    }
}

static void txi_slopes_body(void *context, int index) {
    const txi_slopes_job *job = (const txi_slopes_job *)context;
    const int y0 = (job->first + index) * TXI_BAND_ROWS;
    const int y1 =
        y0 + TXI_BAND_ROWS < job->field->height ? y0 + TXI_BAND_ROWS : job->field->height;
    int32_t *rows = job->rows + (size_t)index * 6 * (size_t)job->field->width * (TXI_BAND_ROWS + 6);
    if (job->smooth) txi_tensor_band(job, y0, y1, rows);
    else txi_gradient_band(job, y0, y1, rows);
}

/* The gradients of a picture where it is known; away and reach as in txi_slopes_job. The
   tensor's memory is that of brief, it is not needed once lines have been followed. */
static txm_status txi_slopes_make(txi_slopes *f, const int32_t *away, int32_t reach,
                                  txm_arena *arena, txm_arena *brief, txm_env *env) {
    const size_t count = (size_t)f->width * (size_t)f->height;
    const int bands = (f->height + TXI_BAND_ROWS - 1) / TXI_BAND_ROWS;
    const int most = bands < TXI_BANDS ? bands : TXI_BANDS;
    txi_slopes_job job;
    f->gradient = (int16_t *)txm_arena_zero(arena, count, 6 * sizeof *f->gradient);
    f->strength = (float *)txm_arena_zero(arena, count, sizeof *f->strength);
    f->tensor = (int32_t *)txm_arena_zero(brief, count, 3 * sizeof *f->tensor);
    job.rows = (int32_t *)txm_arena_zero(brief, (size_t)most * 6 * (size_t)f->width,
                                         (TXI_BAND_ROWS + 6) * sizeof *job.rows);
    if (arena->failed || brief->failed) return txi_no_memory(env);
    job.field = f;
    job.away = away;
    job.reach = reach;
    for (job.smooth = 0; job.smooth < 2; job.smooth++) {
        for (job.first = 0; job.first < bands; job.first += most)
            txm_parallel_for(env, bands - job.first < most ? bands - job.first : most,
                             txi_slopes_body, &job);
    }
    return TXM_OK;
}

/* The direction across the edge at a pixel, unit, and how clear it is, 0..1. */
static double txi_across(const txi_slopes *f, size_t i, double *nx, double *ny) {
    const double a = f->tensor[3 * i], b = f->tensor[3 * i + 1], c = f->tensor[3 * i + 2];
    const double half = 0.5 * (a - c), r = sqrt(half * half + b * b);
    double x = r + half, y = b;
    if (half < 0) {
        x = b;
        y = r - half;
    }
    const double n = sqrt(x * x + y * y);
    *nx = n > 0 ? x / n : 1;
    *ny = n > 0 ? y / n : 0;
    return a + c > 0 ? 2 * r / (a + c) : 0;
}

/* Bilinear gradient strength; 0 outside of the window. */
static double txi_strength_at(const txi_slopes *f, double x, double y) {
    if (!(x >= 0 && y >= 0 && x < f->width - 1 && y < f->height - 1)) return 0;
    const int ix = (int)x, iy = (int)y;
    const float *p = f->strength + (size_t)iy * (size_t)f->width + (size_t)ix;
    const double u = x - ix, v = y - iy;
    return (p[0] * (1 - u) + p[1] * u) * (1 - v) +
           (p[f->width] * (1 - u) + p[f->width + 1] * u) * v;
}

#endif /* TEXINPAINT_SLOPE_H */
