#ifndef TEXSYN_LIGHT_H
#define TEXSYN_LIGHT_H

#include "mask.h"

/* ---- a change of light ------------------------------------------------------------------

   One curve for the brightness V, the largest of R, G and B, which is applied to all three, and a
   linear map of the chroma. The chroma of a colour is a vector that is 0 for grays and has the
   direction of the hue,

       c = (R - (G + B) / 2, sqrt(3)/2 (G - B)),   s = c / V,   s' = z s + cast * fade(|s|)

   with a complex z, that is, a gain and a rotation. The cast, what another colour of the light adds,
   fades to 0 for grays, so that R = G = B stays so exactly. */

enum { TXS_BINS_OF_LIGHT = 15 }; /* quantiles of brightness that are matched, without the extremes */
#define TXS_FLATTEST 0.25        /* slopes of the curve between two of them                     */
#define TXS_STEEPEST_CURVE 4.0
#define TXS_NEXT_KNOT 0.004      /* quantiles closer than a gray level of 255 become one        */
#define TXS_DIM 0.02             /* V that s is at least divided by                             */
#define TXS_FADE 0.02f           /* |s| from which on the whole cast is added                   */

typedef struct txs_chroma {
    double x, y;
} txs_chroma;

/* The curve at v: a cubic between two knots, straight beyond the ends. */
static double txs_curve_at(const texsyn_light *l, double v) {
    const int n = l->knots;
    if (v <= (double)l->from[0]) return (double)l->to[0] + (double)l->slope[0] * (v - (double)l->from[0]);
    if (v >= (double)l->from[n - 1])
        return (double)l->to[n - 1] + (double)l->slope[n - 1] * (v - (double)l->from[n - 1]);
    int k = 0;
    while (v >= (double)l->from[k + 1]) k++;
    const double h = (double)l->from[k + 1] - (double)l->from[k], t = (v - (double)l->from[k]) / h;
    const double rise = (double)l->to[k + 1] - (double)l->to[k];
    const double a = (double)l->slope[k] * h, b = (double)l->slope[k + 1] * h;
    return (double)l->to[k] + t * (a + t * (3 * rise - 2 * a - b + t * (a + b - 2 * rise)));
}

static double txs_brightest(const double rgb[3]) {
    const double v = rgb[0] > rgb[1] ? rgb[0] : rgb[1];
    return v > rgb[2] ? v : rgb[2];
}

/* s of a colour, and its V */
static txs_chroma txs_chroma_of(const double rgb[3], double *v) {
    txs_chroma c;
    *v = txs_brightest(rgb);
    const double divisor = *v > TXS_DIM ? *v : TXS_DIM;
    c.x = (rgb[0] - 0.5 * (rgb[1] + rgb[2])) / divisor;
    c.y = 0.86602540378443865 * (rgb[1] - rgb[2]) / divisor;
    return c;
}

/* The colour of brightness v and chroma s; too large a chroma is reduced until no channel is below 0. */
static void txs_colour_of(double v, txs_chroma s, double rgb[3]) {
    const double third = 1.0 / 3, root = 0.57735026918962576; /* 1 / sqrt(3) */
    const double size = v > TXS_DIM ? v : TXS_DIM;
    const double d[3] = {2 * third * s.x * size, (root * s.y - third * s.x) * size,
                         (-root * s.y - third * s.x) * size};
    const double high = txs_brightest(d);
    double low = d[0] < d[1] ? d[0] : d[1];
    low = low < d[2] ? low : d[2];
    const double scale = v <= 0 ? 0 : high - low > v ? v / (high - low) : 1;
    for (int c = 0; c < 3; c++) rgb[c] = v + scale * (d[c] - high);
}

/* What the light makes of a colour. */
static void txs_light_at(const texsyn_light *l, const double from[3], double to[3]) {
    double curved[3], v;
    for (int c = 0; c < 3; c++) {
        curved[c] = txs_curve_at(l, from[c]);
        if (curved[c] < 0) curved[c] = 0;
    }
    const txs_chroma s = txs_chroma_of(curved, &v);
    const double size = sqrt(s.x * s.x + s.y * s.y) / (double)l->fade;
    const double t = size < 1 ? size * size * (3 - 2 * size) : 1;
    txs_chroma lit;
    lit.x = (double)l->gain[0] * s.x - (double)l->gain[1] * s.y + t * (double)l->cast[0];
    lit.y = (double)l->gain[1] * s.x + (double)l->gain[0] * s.y + t * (double)l->cast[1];
    txs_colour_of(v, lit, to);
}

/* No change at all. */
static texsyn_light txs_no_light(void) {
    texsyn_light l;
    memset(&l, 0, sizeof l);
    l.knots = 2;
    l.from[1] = l.to[1] = 1;
    l.slope[0] = l.slope[1] = 1;
    l.gain[0] = 1;
    l.fade = TXS_FADE;
    return l;
}

/* ---- samples ---------------------------------------------------------------------------- */

enum {
    TXS_SWATCHES = 8192,    /* pixels of a picture that are looked at                        */
    TXS_LEAST_SWATCHES = 16 /* pixels: fewer say nothing of the light                        */
};

typedef struct txs_swatches {
    int count;
    double (*rgb)[3]; /* count each                                                       */
    double *weight;   /* of materials; see below                                          */
    double *value;    /* room for a quantity ...                                          */
    txm_pair *order;  /* ... and for its order, twice                                     */
} txs_swatches;

/* The weighted quantile p of value, whose order is known; sum: of all weights. */
static double txs_quantile(const txs_swatches *s, double sum, double p) {
    double seen = 0, before = 0, last = s->value[s->order[0].value];
    for (int i = 0; i < s->count; i++) {
        const uint32_t k = s->order[i].value;
        if (!(s->weight[k] > 0)) continue;
        const double at = (seen + 0.5 * s->weight[k]) / sum, v = s->value[k];
        if (at >= p) return before <= 0 || at <= before ? v : last + (v - last) * (p - before) / (at - before);
        before = at;
        last = v;
        seen += s->weight[k];
    }
    return last;
}

/* All quantiles of the brightness that the curve matches. */
static void txs_find_quantiles(txs_swatches *s, double quantile[TXS_BINS_OF_LIGHT + 2]) {
    double sum = 0;
    for (int i = 0; i < s->count; i++) {
        s->value[i] = txs_brightest(s->rgb[i]);
        s->order[i].key = txm_sort_key(txm_float(s->value[i]));
        s->order[i].value = (uint32_t)i;
        sum += s->weight[i];
    }
    txm_sort_pairs(s->order, s->order + s->count, (size_t)s->count);
    quantile[0] = txs_quantile(s, sum, 0.005);
    for (int k = 0; k < TXS_BINS_OF_LIGHT; k++)
        quantile[k + 1] = txs_quantile(s, sum, (k + 0.5) / (double)TXS_BINS_OF_LIGHT);
    quantile[TXS_BINS_OF_LIGHT + 1] = txs_quantile(s, sum, 0.995);
}

/* ---- fitting ---------------------------------------------------------------------------- */

static double txs_limit(double x, double low, double high) {
    return x < low ? low : x > high ? high : x;
}

static void txs_add_knot(texsyn_light *l, double from, double to) {
    TEXSYN_ASSERT(l->knots < (int)(sizeof l->from / sizeof *l->from));
    l->from[l->knots] = txm_float(from);
    l->to[l->knots++] = txm_float(to);
}

/* Slopes that keep the curve monotone: harmonic means of those on either side. */
static void txs_find_slopes(texsyn_light *l) {
    double steep[TEXSYN_LIGHT_KNOTS] = {0};
    const int n = l->knots;
    for (int k = 0; k + 1 < n; k++)
        steep[k] = ((double)l->to[k + 1] - (double)l->to[k]) /
                   ((double)l->from[k + 1] - (double)l->from[k]);
    l->slope[0] = txm_float(steep[0]);
    l->slope[n - 1] = txm_float(steep[n - 2]);
    for (int k = 1; k + 1 < n; k++) {
        const double sum = steep[k - 1] + steep[k]; /* 0 where knots round to one value */
        l->slope[k] = sum > 0 ? txm_float(2 * steep[k - 1] * steep[k] / sum) : 0;
    }
}

/* The curve: quantiles of the one become those of the other, within the limits of its slope. Below
   them it goes on as before or, where light is not `raised`, towards black: more exposure leaves
   black as it is, haze raises it. Above them it goes on as before. */
static void txs_fit_curve(txs_swatches *a, txs_swatches *b, int raised, texsyn_light *l) {
    double x[TXS_BINS_OF_LIGHT + 2], y[TXS_BINS_OF_LIGHT + 2], to;
    txs_find_quantiles(a, x);
    txs_find_quantiles(b, y);
    l->knots = 0;
    if (x[0] > TXS_NEXT_KNOT) {
        const double rise = raised && x[3] - x[0] > TXS_NEXT_KNOT ? (y[3] - y[0]) / (x[3] - x[0])
                                                                  : y[0] / x[0];
        const double slope = txs_limit(rise, TXS_FLATTEST, TXS_STEEPEST_CURVE);
        txs_add_knot(l, 0, y[0] > slope * x[0] ? y[0] - slope * x[0] : 0);
    }
    if (!l->knots || (double)l->to[0] + TXS_FLATTEST * x[0] < y[0]) txs_add_knot(l, x[0], y[0]);
    else txs_add_knot(l, x[0], (double)l->to[0] + TXS_FLATTEST * x[0]);
    to = (double)l->to[l->knots - 1];
    for (int k = 1; k < TXS_BINS_OF_LIGHT + 2; k++) {
        const double step = x[k] - (double)l->from[l->knots - 1];
        if (step <= TXS_NEXT_KNOT || !(txm_float(x[k]) > l->from[l->knots - 1])) continue;
        to = txs_limit(y[k], to + TXS_FLATTEST * step, to + TXS_STEEPEST_CURVE * step);
        txs_add_knot(l, x[k], to);
    }
    const int n = l->knots, back = n > 4 ? 4 : n;
    const double last = (double)l->from[n - 1], rise = to - (double)l->to[n - back];
    const double run = last - (double)l->from[n - back];
    const double slope = run > 0 ? txs_limit(rise / run, TXS_FLATTEST, TXS_STEEPEST_CURVE) : 1;
    if (n < 2 || last < 1 - TXS_NEXT_KNOT) {
        const double step = last < 1 - TXS_NEXT_KNOT ? 1 - last : 1;
        txs_add_knot(l, last + step, to + slope * step);
    }
    txs_find_slopes(l);
}

/* Mean of s, and its variance as a complex number and as a real one. */
typedef struct txs_moments {
    txs_chroma mean, square;
    double variance;
} txs_moments;

static txs_moments txs_find_moments(const txs_swatches *s, const texsyn_light *curve) {
    txs_moments m;
    double sum = 0, v;
    memset(&m, 0, sizeof m);
    for (int pass = 0; pass < 2; pass++) {
        for (int i = 0; i < s->count; i++) {
            double rgb[3];
            for (int c = 0; c < 3; c++) {
                rgb[c] = curve ? txs_curve_at(curve, s->rgb[i][c]) : s->rgb[i][c];
                if (rgb[c] < 0) rgb[c] = 0;
            }
            const txs_chroma t = txs_chroma_of(rgb, &v);
            const double w = s->weight[i], x = t.x - m.mean.x, y = t.y - m.mean.y;
            if (pass) {
                m.square.x += w * (x * x - y * y) / sum;
                m.square.y += w * 2 * x * y / sum;
                m.variance += w * (x * x + y * y) / sum;
            } else {
                m.square.x += w * t.x; /* the sums of the first pass, for now */
                m.square.y += w * t.y;
                m.variance += w;
            }
        }
        if (pass) break;
        sum = m.variance;
        m.mean.x = m.square.x / sum;
        m.mean.y = m.square.y / sum;
        m.square.x = m.square.y = m.variance = 0;
    }
    return m;
}

/* The rotation between the longer axes of two distributions of chroma, as a unit vector: half the
   angle between the complex variances, at most TXS_MOST_TURN, less where an axis is indistinct. */
static txs_chroma txs_find_turn(const txs_moments *a, const txs_moments *b, double noise) {
    const double most_cosine = 0.8253356149; /* of 0.6 rad */
    txs_chroma q, turn;
    q.x = a->square.x * b->square.x + a->square.y * b->square.y;
    q.y = a->square.x * b->square.y - a->square.y * b->square.x;
    const double size = sqrt(q.x * q.x + q.y * q.y);
    const double distinct = size / ((a->variance + noise) * (b->variance + noise));
    turn.x = 1;
    turn.y = 0;
    if (!(size > 0)) return turn;
    double cosine = sqrt((1 + txs_limit(q.x / size, -1, 1)) / 2);
    if (cosine < most_cosine) cosine = most_cosine;
    const double sine = sqrt(1 - cosine * cosine);
    const double x = 1 - distinct + distinct * cosine, y = distinct * (q.y < 0 ? -sine : sine);
    turn.x = x / sqrt(x * x + y * y);
    turn.y = y / sqrt(x * x + y * y);
    return turn;
}

/* The light that turns the distribution of a into that of b. */
static texsyn_light txs_fit_light(txs_swatches *a, txs_swatches *b, int raised) {
    const double noise = 0.01; /* of s, in either picture */
    texsyn_light l = txs_no_light();
    txs_fit_curve(a, b, raised, &l);
    const txs_moments p = txs_find_moments(a, &l), q = txs_find_moments(b, NULL);
    const double gain = txs_limit((sqrt(q.variance) + noise) / (sqrt(p.variance) + noise), 0.3, 3);
    const txs_chroma turn = txs_find_turn(&p, &q, noise * noise);
    l.gain[0] = txm_float(gain * turn.x);
    l.gain[1] = txm_float(gain * turn.y);
    l.cast[0] = txm_float(q.mean.x - gain * (turn.x * p.mean.x - turn.y * p.mean.y));
    l.cast[1] = txm_float(q.mean.y - gain * (turn.y * p.mean.x + turn.x * p.mean.y));
    return l;
}

#endif /* TEXSYN_LIGHT_H */
