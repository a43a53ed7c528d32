#ifndef TEXSYN_EXAMPLE_H
#define TEXSYN_EXAMPLE_H

#include "alpha.h"
#include "model.h"

/* ---- the example --------------------------------------------------------------------------

   The example becomes planes of decorrelated bands (principal components of the colours; alpha
   stays by itself), then a pyramid of them, each level quantised to at most 32 values. */

typedef struct txs_source { /* one level of the example */
    int width, height;
    float *value;      /* planes                                               */
    uint8_t *mask;     /* non-zero: belongs to the texture; NULL = all do      */
    uint8_t *weight;   /* of colours, see alpha.h; NULL = all are visible      */
    txs_canvas canvas; /* quantised, margin 0                                  */
    int step;          /* statistics are taken from every step-th row          */
} txs_source;

/* Alpha becomes the first band, the one whose shapes are learned. */
static void txs_put_alpha_first(texsyn_model *m) {
    for (int b = m->bands - 1; b > 0; b--) {
        if (!txs_is_alpha(m, b)) continue;
        float row[TXS_MAX_BANDS];
        memcpy(row, m->basis[b], sizeof row);
        memcpy(m->basis[b], m->basis[b - 1], sizeof row);
        memcpy(m->basis[b - 1], row, sizeof row);
    }
}

/* Principal components of the visible colours inside the mask. Rounded as the model file keeps
   them. Alpha is the last band, if it varies. Returns non-zero if it varies more than any colour. */
static int txs_find_bands(texsyn_model *m, const txm_image *im, const txs_source *s) {
    const int colours = m->channels < 3 ? 1 : 3;
    const size_t pixels = (size_t)s->width * (size_t)s->height;
    double mean[4] = {0, 0, 0, 0}, square[4] = {0, 0, 0, 0}, cov[6] = {0, 0, 0, 0, 0, 0};
    double values[3], vectors[3][3], count = 0, visible = 0;
    for (int pass = 0; pass < 2; pass++) {
        for (size_t i = 0; i < pixels; i++) {
            double x[4];
            if (s->mask && !s->mask[i]) continue;
            const double weight = s->weight ? (double)s->weight[i] : 1;
            for (int c = 0; c < m->channels; c++)
                x[c] = 255.0 * (double)txm_image_get(im, (int)(i % (size_t)s->width),
                                                     (int)(i / (size_t)s->width), c) -
                       mean[c];
            for (int c = 0; c < m->channels && !pass; c++)
                square[c] += c < 3 ? weight * x[c] : x[c];
            count += !pass;
            visible += pass ? 0 : weight;
            for (int c = 0, k = 0; c < 3 && pass && visible > 0; c++)
                for (int d = c; d < 3; d++, k++)
                    if (d < colours) cov[k] += weight * (x[c] * x[d]) / visible;
            if (pass && m->channels == 4) square[3] += x[3] * x[3] / count;
        }
        for (int c = 0; c < m->channels && !pass; c++) {
            const double total = c < 3 ? visible : count;
            m->mean[c] = txs_short_float((float)(total > 0 ? square[c] / total : 0));
            mean[c] = (double)m->mean[c];
            square[c] = 0;
        }
    }
    txm_eigen3(cov, values, vectors);
    m->bands = 0;
    for (int k = 0; k < colours; k++) { /* bands with no visible variance are left out */
        if (values[k] < 0.05 && m->bands > 0) break;
        for (int c = 0; c < colours; c++)
            m->basis[m->bands][c] =
                (float)floor((colours == 1 ? 1 : vectors[k][c]) * 16384 + 0.5) / 16384;
        m->bands++;
    }
    if (m->channels == 4 && square[3] >= 0.05) m->basis[m->bands++][3] = 1;
    return square[3] > values[0];
}

/* The bands of the example at full resolution. */
static void txs_split(const texsyn_model *m, const txm_image *im, txs_source *s) {
    float *out = s->value;
    for (int b = 0; b < m->bands; b++) {
        for (int y = 0; y < s->height; y++) {
            for (int x = 0; x < s->width; x++) {
                double v = 0;
                for (int c = 0; c < m->channels; c++)
                    v += (double)m->basis[b][c] *
                         (255.0 * (double)txm_image_get(im, x, y, c) - (double)m->mean[c]);
                *out++ = txm_float(v);
            }
        }
    }
}

/* The mean of 2 x 2 colours as far as they are visible. */
static float txs_visible_mean(const float *p, const uint8_t *weight, size_t row) {
    const size_t at[4] = {0, 1, row, row + 1};
    double sum = 0, total = 0;
    for (int k = 0; k < 4; k++) {
        sum += (double)weight[at[k]] * (double)p[at[k]];
        total += weight[at[k]];
    }
    return txm_float(sum / total);
}

/* The weight of a coarser pixel; not 0 where anything is visible. */
static uint8_t txs_mean_weight(const uint8_t *weight, size_t row) {
    const int sum = weight[0] + weight[1] + weight[row] + weight[row + 1];
    return (uint8_t)(sum > 0 && sum < 4 ? 1 : sum / 4);
}

/* The next coarser level: means of 2 x 2; a pixel belongs to the texture if all four do. */
static void txs_halve(const txs_source *fine, txs_source *s, const texsyn_model *m) {
    const size_t w = (size_t)fine->width;
    float *out = s->value;
    for (int b = 0; b < m->bands; b++) {
        const float *plane = fine->value + (size_t)b * w * (size_t)fine->height;
        const uint8_t *weights = txs_is_alpha(m, b) ? NULL : fine->weight;
        for (int y = 0; y < s->height; y++) {
            for (int x = 0; x < s->width; x++) {
                const size_t at = (size_t)(2 * y) * w + 2 * (size_t)x;
                const float *p = plane + at;
                if (weights && txs_mean_weight(weights + at, w))
                    *out++ = txs_visible_mean(p, weights + at, w);
                else
                    *out++ = txm_float(
                        ((double)p[0] + (double)p[1] + (double)p[w] + (double)p[w + 1]) / 4);
            }
        }
    }
    for (int y = 0; y < s->height && s->weight; y++)
        for (int x = 0; x < s->width; x++)
            s->weight[(size_t)y * (size_t)s->width + (size_t)x] =
                txs_mean_weight(fine->weight + (size_t)(2 * y) * w + 2 * (size_t)x, w);
    for (int y = 0; y < s->height && s->mask; y++) {
        for (int x = 0; x < s->width; x++) {
            const uint8_t *p = fine->mask + (size_t)(2 * y) * w + 2 * (size_t)x;
            s->mask[(size_t)y * (size_t)s->width + (size_t)x] = p[0] && p[1] && p[w] && p[w + 1];
        }
    }
}

/* the value's level, 0..values-1 */
static int txs_quantise(const txs_level *l, int band, double value) {
    double q = floor((value - (double)l->low[band]) / (double)l->step[band] + 0.5);
    return q < 0 ? 0 : q >= l->values[band] ? l->values[band] - 1 : (int)q;
}

static double txs_value(const txs_level *l, int band, double q) {
    return (double)l->low[band] + q * (double)l->step[band];
}

/* How much pixel i of a band counts. */
static size_t txs_count_of(const txs_source *s, const uint8_t *weight, size_t i) {
    if (s->mask && !s->mask[i]) return 0;
    return weight ? weight[i] : 1;
}

/* Choose the quantisation of a band: 32 steps between the 0.1 and 99.9 percentiles, but no finer
   than one gray level; and quantise. weight: of the pixels, or NULL. Returns the share of a step
   that the values fill. */
static float txs_quantise_band(txs_level *l, int band, txs_source *s, const uint8_t *weight) {
    enum { FINE = 4096 };
    const size_t pixels = (size_t)s->width * (size_t)s->height;
    const float *v = s->value + (size_t)band * pixels;
    uint8_t *q = s->canvas.pixels + band * s->canvas.plane;
    double low = 1e300, high = -1e300;
    size_t count = 0, seen = 0, histogram[FINE] = {0};
    for (size_t i = 0; i < pixels; i++) {
        const size_t counts = txs_count_of(s, weight, i);
        if (!counts) continue;
        low = (double)v[i] < low ? (double)v[i] : low;
        high = (double)v[i] > high ? (double)v[i] : high;
        count += counts;
    }
    const double bin = (high - low) / (double)FINE;
    for (size_t i = 0; i < pixels && bin > 0; i++) {
        const size_t counts = txs_count_of(s, weight, i);
        if (counts)
            histogram[txm_clampi((int)(((double)v[i] - low) / bin), 0, FINE - 1)] += counts;
    }
    double from = low, to = high;
    for (int i = 0; i < FINE && bin > 0; i++) {
        if (seen <= count / 1000) from = low + bin * i;
        if (seen < count - count / 1000) to = low + bin * (i + 1);
        seen += histogram[i];
    }
    double step = (to - from) / (TXS_VALUES - 1);
    if (step < 1) step = 1;
    l->values[band] = txm_clampi((int)ceil((to - from) / step - 1e-6) + 1, 1, TXS_VALUES);
    l->step[band] = txs_short_float((float)step);
    l->low[band] = txs_short_float((float)((from + to - step * (l->values[band] - 1)) / 2));

    double spread = 0;
    for (size_t i = 0; i < pixels; i++) {
        q[i] = (uint8_t)txs_quantise(l, band, (double)v[i]);
        double off = ((double)v[i] - txs_value(l, band, q[i])) / (double)l->step[band];
        if (fabs(off) <= 0.5) spread += (double)txs_count_of(s, weight, i) * (off * off);
    }
    double fill = sqrt(12 * spread / (double)count); /* 1 if evenly spread over the steps */
    return (float)floor((fill > 1 ? 1 : fill) * 255 + 0.5) / 255;
}

/* Where pixel x of a row of `fine` lies on a row of `coarse` that is half as long: the nearest
   pixel, its neighbour on the other side, and as the result the weight of the latter in quarters. A
   torus of odd width lies on a coarse one that is half a pixel too long, so positions are
   compressed by a quarter of a pixel at each of two places far from the border, which avoids a seam
   there. From the first of these places on, parities swap. */
static int txs_place(int x, int fine, int coarse, int wrap, int where[2]) {
    int at = 2 * x + 1; /* in quarters of a coarse pixel, from the border */
    if (fine == 2 * coarse - 1) at = (int)(((int64_t)at * 2 * coarse + coarse - 1) / fine);
    const int off = at % 4 - 2; /* -2..1 */
    where[0] = wrap ? at / 4 % coarse : txm_clampi(at / 4, 0, coarse - 1);
    where[1] = where[0] + (off > 0 ? 1 : -1);
    if (!wrap) where[1] = txm_clampi(where[1], 0, coarse - 1);
    return abs(off);
}

/* Fill the parent planes of a canvas with the coarser level above, bilinearly, in this level's
   steps. At the borders the coarse canvas wraps if it has a margin, else its last row is
   repeated. */
static void txs_fill_parent(const txs_level *above, const txs_canvas *coarse,
                            const txs_level *level, txs_canvas *canvas, int bands) {
    if (canvas->width == 2 * coarse->width - 1) canvas->slip_x = coarse->width / 2;
    if (canvas->height == 2 * coarse->height - 1) canvas->slip_y = coarse->height / 2;
    for (int b = 0; b < bands; b++) {
        uint8_t map[16 * TXS_VALUES];
        for (int q = 0; q < 16 * TXS_VALUES; q++)
            map[q] = (uint8_t)txs_quantise(level, b, txs_value(above, b, q / 16.0));
        for (int y = 0; y < canvas->height; y++) {
            const int wrap = coarse->margin > 0;
            int cy[2], cx[2];
            const int v = txs_place(y, canvas->height, coarse->height, wrap, cy), w = 4 - v;
            const uint8_t *near_ = txs_at(coarse, b, 0, cy[0]), *far_ = txs_at(coarse, b, 0, cy[1]);
            uint8_t *to = txs_at(canvas, bands + b, 0, y);
            for (int x = 0; x < canvas->width; x++) {
                const int u = txs_place(x, canvas->width, coarse->width, wrap, cx), t = 4 - u;
                to[x] = map[w * (t * near_[cx[0]] + u * near_[cx[1]]) +
                            v * (t * far_[cx[0]] + u * far_[cx[1]])];
            }
        }
        txs_wrap(canvas, bands + b);
    }
}

/* How the first band of the level above changes and curves at p: the squared gradient by Sobel's
   filter, the Laplacian, both of pixels that are `step` apart in x and `row` in y. */
static void txs_look(const uint8_t *p, const ptrdiff_t x[2], const ptrdiff_t y[2], int *gradient,
                     int *curve) {
    const int gx = p[y[0] + x[1]] + 2 * p[x[1]] + p[y[1] + x[1]] - p[y[0] + x[0]] - 2 * p[x[0]] -
                   p[y[1] + x[0]];
    const int gy = p[y[1] + x[0]] + 2 * p[y[1]] + p[y[1] + x[1]] - p[y[0] + x[0]] - 2 * p[y[0]] -
                   p[y[0] + x[1]];
    *gradient = gx * gx + gy * gy;
    *curve = p[x[0]] + p[x[1]] + p[y[0]] + p[y[1]] - 4 * p[0];
}

/* Visit the labels' arguments; at a border without margin the last pixel is repeated. */
static void txs_look_at(const txs_canvas *c, int bands, int x, int y, int *gradient, int *curve) {
    enum { R = TXS_LABEL_REACH };
    const int wrap = c->margin >= R;
    const ptrdiff_t dx[2] = {wrap || x >= R ? -R : -x,
                             wrap || x + R < c->width ? R : c->width - 1 - x};
    const ptrdiff_t dy[2] = {c->stride * (wrap || y >= R ? -R : -y),
                             c->stride * (wrap || y + R < c->height ? R : c->height - 1 - y)};
    txs_look(txs_at(c, bands, x, y), dx, dy, gradient, curve);
}

/* Fill the plane of labels from the parent plane of the first band: by thirds of the gradient, 0 to
   2, plus 3 times thirds of the curvature. */
static void txs_fill_labels(const txs_level *level, txs_canvas *canvas, int bands) {
    for (int y = 0; y < canvas->height; y++) {
        uint8_t *label = txs_at(canvas, 2 * bands, 0, y);
        for (int x = 0; x < canvas->width; x++) {
            int gradient, curve;
            txs_look_at(canvas, bands, x, y, &gradient, &curve);
            label[x] =
                (uint8_t)((gradient > level->gradient_cut[0]) +
                          (gradient > level->gradient_cut[1]) +
                          3 * ((curve > level->curve_cut[0]) + (curve > level->curve_cut[1])));
        }
    }
    txs_wrap(canvas, 2 * bands);
}

/* Choose the limits of the labels: thirds of the example. weight: of the first band, or NULL.
   Returns 0 if there is no memory. */
static int txs_cut_labels(txs_level *level, const txs_source *s, const uint8_t *weight, int bands,
                          txm_arena *arena) {
    enum { CURVES = 8 * TXS_VALUES + 1 };
    uint32_t *gradients =
        (uint32_t *)txm_arena_zero(arena, TXS_MAX_GRADIENT + 1, sizeof *gradients);
    uint32_t curves[CURVES] = {0}, count = 0;
    if (!gradients) return 0;
    for (int y = 0; y < s->height; y++) {
        for (int x = 0; x < s->width; x++) {
            int gradient, curve;
            const size_t i = (size_t)y * (size_t)s->width + (size_t)x;
            if ((s->mask && !s->mask[i]) || (weight && !weight[i])) continue;
            txs_look_at(&s->canvas, bands, x, y, &gradient, &curve);
            gradients[gradient]++;
            curves[curve + CURVES / 2]++;
            count++;
        }
    }
    for (uint32_t i = 0; i < 2; i++) {
        const uint32_t part = (i + 1) * (count / 3);
        uint32_t seen = 0;
        int g = 0, k = 0;
        while (g < TXS_MAX_GRADIENT && (seen += gradients[g]) < part) g++;
        for (seen = 0; k < CURVES - 1 && (seen += curves[k]) < part;) k++;
        level->gradient_cut[i] = g;
        level->curve_cut[i] = k - CURVES / 2;
    }
    return 1;
}

/* Start the synthesis of a level: from what is above, or from even noise (step 2 of [1]). */
static void txs_start_canvas(const txs_level *level, const txs_canvas *canvas, int bands,
                             int has_parent, uint64_t seed) {
    txm_rng rng = txm_rng_make(seed, 3);
    for (int b = 0; b < bands; b++) {
        for (int y = 0; y < canvas->height; y++) {
            uint8_t *row = txs_at(canvas, b, 0, y);
            for (int x = 0; x < canvas->width; x++)
                row[x] = has_parent ? row[bands * canvas->plane + x]
                                    : (uint8_t)txm_rng_below(&rng, (uint32_t)level->values[b]);
        }
        txs_wrap(canvas, b);
    }
}

#endif /* TEXSYN_EXAMPLE_H */
