#ifndef TEXMATH_LIGHT_H
#define TEXMATH_LIGHT_H

#include "alpha.h"
#include "mask.h"

/* ---- kernel: uneven light --------------------------------------------------------------- */

/* A photograph is lit unevenly: a lens darkens its corners, a lamp or a window is nearer to one
   side. The eye does not mind, but where such a picture is cut up and put together again, the
   pieces have different light, and it shows as patches and crescents. Light multiplies: what a
   camera sees is i(x) = l(x) r(x), in linear light, with l slow and r the texture. txm_even estimates
   l as what is left of i once everything narrower is averaged out, and divides by it;
   txm_uneven tells whether a picture needs that.                                           */
typedef struct txm_even_desc {
    txm_image image; /* colours: 8 and 16 bits sRGB-encoded, float linear light; alpha says how much
                        each pixel counts                                                         */
    txm_image mask;  /* the size of the image: only pixels where it counts (txm_mask_at) are looked
                        at, though all are changed; pixels NULL: all are                          */
    float radius;    /* pixels, TXM_EVEN_LEAST..TXM_EVEN_MOST: changes of light wider than this are
                        taken out; a wave of twice this length loses half its height. 0 = half the
                        smaller side of the image                                                 */
} txm_even_desc;

#define TXM_EVEN_LEAST 8.0f
#define TXM_EVEN_MOST 1e6f
#define TXM_EVEN_BRIGHTER 8.0 /* dark parts become brighter by at most this factor: 3 stops, so that
                                 their noise does not become texture                              */

enum {
    TXM_LIGHT_CELLS = 4,  /* cells of the grid for each radius ...                                */
    TXM_LIGHT_LEAST = 8,  /* ... and at least for each side, so that there are planes to fit      */
    TXM_LIGHT_RING = 2,   /* nodes beyond the outer cells on each side, for the splines           */
    TXM_LIGHT_BANDS = 64, /* into which the rows are divided for threads                          */
    TXM_LIGHT_REACH = 3   /* deviations of the window after which it ends                         */
};

/* a Gaussian of this deviation, in radii, halves waves of two radii: sqrt(2 ln 2) / pi          */
#define TXM_LIGHT_DEVIATION 0.375
/* of the cells' boxes and of the cubic splines between nodes, in cells: 1/12 + 1/3              */
#define TXM_LIGHT_SMOOTH (5.0 / 12.0)
#define TXM_LIGHT_RIDGE 0.001 /* of the window's variance: no slopes where all known cells lie on a line */

/* The grid of one picture. Nodes are cell centres, and a ring beyond: node k lies on cell k - 2. */
typedef struct txm_light {
    txm_image image, mask, out;
    int colours, wide, high; /* cells                                                             */
    int across, down;        /* nodes: wide and high and both rings                               */
    int reach[2];            /* of the window, cells                                              */
    double *window[2];       /* its weights, 2 reach + 1, for x and y                             */
    float *decoded;          /* light of each code of 8 or 16 bits; NULL: float samples           */
    double *sums;            /* of each cell: weight, then weighted light of each colour          */
    double *moments;         /* of each row of cells at each node: 3 of weight, 2 of each colour  */
    double *nodes;           /* of each node and colour: gain in light to the power 1 / 2.4       */
    double *lines;           /* of each band: nodes of one row of pixels                          */
    double mean[3];
} txm_light;

/* the same without libm, whose pow is not the same everywhere */
static inline double txm_light_of(double code) {
    return code <= 0.04045 ? code / 12.92 : txm_pow((code + 0.055) / 1.055, 2.4);
}
static inline double txm_light_code(double light) {
    return light <= 0.0031308 ? 12.92 * light : 1.055 * txm_pow(light, 1 / 2.4) - 0.055;
}

/* The code of a sample in light that is power^2.4 times brighter. On the curve's upper part, where
   nearly all samples are, no power of it is needed: (code + 0.055) power - 0.055.               */
static inline double txm_light_scale(double code, double power) {
    if (code > 0.04045) {
        const double scaled = (code + 0.055) * power - 0.055;
        if (scaled > 0.04045) return scaled;
    }
    return txm_light_code(txm_light_of(code) * txm_pow(power, 2.4));
}

/* first pixel of cell k of count, along a side */
static inline int txm_light_edge(int side, int k, int count) {
    return (int)((int64_t)side * k / count);
}

/* how much pixel (x, y) counts, 0..1 */
static inline double txm_light_weight(const txm_image *image, const txm_image *mask, int x, int y) {
    if (mask->pixels && !txm_mask_at(mask, x, y)) return 0;
    if (!txm_image_has_alpha(image)) return 1;
    return (double)txm_clampf(txm_image_get(image, x, y, image->channels - 1), 0, 1);
}

/* light of sample c of pixel (x, y); decoded as in txm_light */
static inline double txm_light_get(const txm_image *image, const float *decoded, int x, int y,
                                   int c) {
    const void *row = txm_image_row_const(image, y);
    const size_t i = (size_t)x * (size_t)image->channels + (size_t)c;
    const float code = txm_sample_code(row, image->sample, i);
    return (double)(decoded ? decoded[(int)code] : code);
}

/* The light of each code of 8 or 16 bits; NULL for float samples, or without memory. */
static inline float *txm_light_decode(const txm_image *image, txm_arena *arena) {
    const int codes = image->sample == TXM_U8 ? 256 : 65536;
    if (image->sample == TXM_F32) return NULL;
    float *decoded = (float *)txm_arena_alloc(arena, (size_t)codes, sizeof(float));
    for (int k = 0; k < codes && decoded; k++)
        decoded[k] = txm_float(txm_light_of((double)k / (codes - 1)));
    return decoded;
}

/* Sum up the cells of one row. */
static inline void txm_light_sum(void *context, int row) {
    const txm_light *l = (const txm_light *)context;
    const int lanes = 1 + l->colours;
    double *sums = l->sums + (size_t)row * (size_t)l->wide * (size_t)lanes;
    memset(sums, 0, (size_t)l->wide * (size_t)lanes * sizeof *sums);
    const int bottom = txm_light_edge(l->image.height, row + 1, l->high);
    for (int y = txm_light_edge(l->image.height, row, l->high); y < bottom; y++) {
        double *cell = sums;
        for (int k = 0; k < l->wide; k++, cell += lanes) {
            const int end = txm_light_edge(l->image.width, k + 1, l->wide);
            for (int x = txm_light_edge(l->image.width, k, l->wide); x < end; x++) {
                const double weight = txm_light_weight(&l->image, &l->mask, x, y);
                if (!(weight > 0)) continue;
                cell[0] += weight;
                for (int c = 0; c < l->colours; c++)
                    cell[1 + c] += weight * txm_light_get(&l->image, l->decoded, x, y, c);
            }
        }
    }
}

/* Along one row of cells, at each node: the window's sums of weight times 1, u, u^2 and of light times
   1, u, where u is the distance to the cell. */
static inline void txm_light_across(void *context, int row) {
    const txm_light *l = (const txm_light *)context;
    const int lanes = 1 + l->colours, count = 3 + 2 * l->colours, reach = l->reach[0];
    const double *sums = l->sums + (size_t)row * (size_t)l->wide * (size_t)lanes;
    double *m = l->moments + (size_t)row * (size_t)l->across * (size_t)count;
    for (int node = 0; node < l->across; node++, m += count) {
        for (int i = 0; i < count; i++) m[i] = 0;
        for (int u = -reach; u <= reach; u++) {
            const int k = node - TXM_LIGHT_RING + u;
            if (k < 0 || k >= l->wide) continue;
            const double *cell = sums + (size_t)k * (size_t)lanes, w = l->window[0][u + reach];
            m[0] += w * cell[0];
            m[1] += w * u * cell[0];
            m[2] += w * u * u * cell[0];
            for (int c = 0; c < l->colours; c++) {
                m[3 + 2 * c] += w * cell[1 + c];
                m[4 + 2 * c] += w * u * cell[1 + c];
            }
        }
    }
}

/* The value at (0, 0) of the plane a + b u + c v that fits best: weights w, values z.
   s: sums of w times 1, u, v, u^2, u v, v^2;  z: sums of w z times 1, u, v;  ridge: added to the
   variances of u and v. */
static inline double txm_light_plane(const double s[6], const double z[3], const double ridge[2]) {
    const double a = s[3] - s[1] * s[1] / s[0] + ridge[0] * s[0], b = s[4] - s[1] * s[2] / s[0];
    const double d = s[5] - s[2] * s[2] / s[0] + ridge[1] * s[0];
    const double p = z[1] - s[1] * z[0] / s[0], q = z[2] - s[2] * z[0] / s[0];
    const double det = a * d - b * b; /* above 0: a and d are ridged                              */
    const double du = (d * p - b * q) / det, dv = (a * q - b * p) / det;
    return (z[0] - du * s[1] - dv * s[2]) / s[0];
}

/* One row of nodes: light there, from a plane fitted in the window, and the gain that it takes. */
static inline void txm_light_down(void *context, int row) {
    const txm_light *l = (const txm_light *)context;
    const int count = 3 + 2 * l->colours, reach = l->reach[1];
    double ridge[2], *to = l->nodes + (size_t)row * (size_t)l->across * (size_t)l->colours;
    for (int axis = 0; axis < 2; axis++) {
        const double deviation = (double)l->reach[axis] / (int)TXM_LIGHT_REACH;
        ridge[axis] = TXM_LIGHT_RIDGE * deviation * deviation;
    }
    for (int node = 0; node < l->across; node++, to += l->colours) {
        double s[6] = {0}, z[3][3] = {{0}};
        for (int v = -reach; v <= reach; v++) {
            const int k = row - TXM_LIGHT_RING + v;
            if (k < 0 || k >= l->high) continue;
            const size_t place = (size_t)k * (size_t)l->across + (size_t)node;
            const double *m = l->moments + place * (size_t)count;
            const double w = l->window[1][v + reach];
            s[0] += w * m[0];
            s[1] += w * m[1];
            s[2] += w * v * m[0];
            s[3] += w * m[2];
            s[4] += w * v * m[1];
            s[5] += w * v * v * m[0];
            for (int c = 0; c < l->colours; c++) {
                z[c][0] += w * m[3 + 2 * c];
                z[c][1] += w * m[4 + 2 * c];
                z[c][2] += w * v * m[3 + 2 * c];
            }
        }
        for (int c = 0; c < l->colours; c++) {
            const double mean = l->mean[c], least = mean / TXM_EVEN_BRIGHTER;
            double light = mean;
            if (s[0] > 0) light = txm_light_plane(s, z[c], ridge);
            if (!(light >= least)) light = least;
            to[c] = mean > 0 ? txm_pow(mean / light, 1 / 2.4) : 1;
        }
    }
}

/* Weights of the four nodes around a place between the second and the third, at t from 0 to 1: the
   cubic B-spline. */
static inline void txm_light_spline(double t, double w[4]) {
    const double u = 1 - t, tt = t * t, ttt = tt * t;
    w[0] = u * u * u / 6;
    w[1] = (3 * ttt - 6 * tt + 4) / 6;
    w[2] = (-3 * ttt + 3 * tt + 3 * t + 1) / 6;
    w[3] = ttt / 6;
}

/* The first of the four nodes around pixel x of a side of so many cells, and their weights. */
static inline int txm_light_place(int x, int side, int cells, double w[4]) {
    const double at = (x + 0.5) * cells / side - 0.5 + (int)TXM_LIGHT_RING; /* 1.5 or more             */
    const int node = (int)at;
    txm_light_spline(at - node, w);
    return node - 1;
}

/* the nodes of one row of pixels */
static inline void txm_light_line(const txm_light *l, int y, double *line) {
    double w[4];
    const size_t count = (size_t)l->across * (size_t)l->colours;
    const double *from =
        l->nodes + (size_t)txm_light_place(y, l->image.height, l->high, w) * count;
    for (size_t i = 0; i < count; i++)
        line[i] = w[0] * from[i] + w[1] * from[i + count] + w[2] * from[i + 2 * count] +
                  w[3] * from[i + 3 * count];
}

/* Apply the gains to one band of rows. */
static inline void txm_light_apply(void *context, int band) {
    const txm_light *l = (const txm_light *)context;
    const int n = l->colours, last = txm_light_edge(l->image.height, band + 1, TXM_LIGHT_BANDS);
    double *line = l->lines + (size_t)band * (size_t)l->across * (size_t)n, w[4];
    for (int y = txm_light_edge(l->image.height, band, TXM_LIGHT_BANDS); y < last; y++) {
        txm_light_line(l, y, line);
        for (int x = 0; x < l->image.width; x++) {
            const int node = txm_light_place(x, l->image.width, l->wide, w);
            const double *p = line + (size_t)node * (size_t)n;
            for (int c = 0; c < l->image.channels; c++) {
                const float code = txm_image_get(&l->image, x, y, c);
                if (c >= n) { /* alpha */
                    txm_image_set(&l->out, x, y, c, code);
                    continue;
                }
                const double power = w[0] * p[c] + w[1] * p[c + n] + w[2] * p[c + 2 * n] +
                                     w[3] * p[c + 3 * n];
                const double scaled = l->decoded ? txm_light_scale((double)code, power)
                                                 : (double)code * txm_pow(power, 2.4);
                txm_image_set(&l->out, x, y, c, txm_float(scaled));
            }
        }
    }
}

/* The mean light of each colour; in cell order, so that threads do not matter. 0: nothing counts. */
static inline int txm_light_mean(txm_light *l) {
    const size_t lanes = 1 + (size_t)l->colours, cells = (size_t)l->wide * (size_t)l->high;
    double total[4] = {0};
    for (size_t i = 0; i < cells; i++)
        for (size_t k = 0; k < lanes; k++) total[k] += l->sums[i * lanes + k];
    for (int c = 0; c < l->colours && total[0] > 0; c++) l->mean[c] = total[1 + c] / total[0];
    return total[0] > 0;
}

/* what the splines make of colour c of the nodes at the centre of a cell, whose node this is */
static inline double txm_light_centre(const txm_light *l, const double *node, size_t c) {
    static const double w[3] = {1.0 / 6, 4.0 / 6, 1.0 / 6};
    const size_t n = (size_t)l->colours, row = (size_t)l->across * n;
    double sum = 0;
    for (size_t y = 0; y < 3; y++)
        for (size_t x = 0; x < 3; x++) sum += w[y] * w[x] * node[c + y * row + x * n - row - n];
    return sum;
}

/* Scale all gains so that the mean light of each colour stays what it is. */
static inline void txm_light_keep_mean(txm_light *l) {
    const size_t n = (size_t)l->colours, lanes = 1 + n, row = (size_t)l->across * n;
    double before[3] = {0}, after[3] = {0};
    for (int y = 0; y < l->high; y++) {
        for (int x = 0; x < l->wide; x++) {
            const double *cell = l->sums + ((size_t)y * (size_t)l->wide + (size_t)x) * lanes;
            const double *node = l->nodes + (size_t)(y + TXM_LIGHT_RING) * row +
                                 (size_t)(x + TXM_LIGHT_RING) * n;
            for (size_t c = 0; c < n; c++) {
                before[c] += cell[1 + c];
                after[c] += cell[1 + c] * txm_pow(txm_light_centre(l, node, c), 2.4);
            }
        }
    }
    for (size_t c = 0; c < n; c++) {
        if (!(before[c] > 0 && after[c] > 0)) continue;
        const double power = txm_pow(before[c] / after[c], 1 / 2.4);
        for (size_t i = c; i < row * (size_t)l->down; i += n) l->nodes[i] *= power;
    }
}

/* The window along one axis, and room for it. */
static inline void txm_light_window(txm_light *l, int axis, double radius, txm_arena *arena) {
    const int side = axis ? l->image.height : l->image.width, cells = axis ? l->high : l->wide;
    const double wide = TXM_LIGHT_DEVIATION * radius * cells / side;
    const double variance = fmax(wide * wide - TXM_LIGHT_SMOOTH, 0.25);
    const double reach = ceil((int)TXM_LIGHT_REACH * sqrt(variance));
    /* further cells than these there are not */
    l->reach[axis] = reach < cells + TXM_LIGHT_RING ? (int)reach : cells + TXM_LIGHT_RING;
    const int size = 2 * l->reach[axis] + 1;
    l->window[axis] = (double *)txm_arena_alloc(arena, (size_t)size, sizeof(double));
    for (int i = 0; i < size && l->window[axis]; i++) {
        const double u = i - l->reach[axis], ln2 = 0.69314718055994530942;
        l->window[axis][i] = txm_exp2(-fmin(u * u / (2 * variance * ln2), 900));
    }
}

/* how many cells of about this size a side is divided into */
static inline int txm_light_count(int side, double cell) {
    const int least = side < TXM_LIGHT_LEAST ? side : TXM_LIGHT_LEAST;
    return (int)fmax(side / cell + 0.5, least);
}

static inline void txm_light_make_room(txm_light *l, double radius, txm_arena *arena) {
    const double cell = radius / (int)TXM_LIGHT_CELLS;
    const int n = l->colours;
    l->wide = txm_light_count(l->image.width, cell);
    l->high = txm_light_count(l->image.height, cell);
    l->across = l->wide + 2 * TXM_LIGHT_RING;
    l->down = l->high + 2 * TXM_LIGHT_RING;
    for (int axis = 0; axis < 2; axis++) txm_light_window(l, axis, radius, arena);
    const size_t wide = (size_t)l->wide, high = (size_t)l->high, across = (size_t)l->across;
    l->sums = (double *)txm_arena_alloc(arena, wide * high, (size_t)(1 + n) * sizeof(double));
    const size_t nodes = across * (size_t)l->down, colours = (size_t)n * sizeof(double);
    l->moments = (double *)txm_arena_alloc(arena, across * high, (size_t)(3 + 2 * n) * sizeof(double));
    l->nodes = (double *)txm_arena_alloc(arena, nodes, colours);
    l->lines = (double *)txm_arena_alloc(arena, across * TXM_LIGHT_BANDS, colours);
    l->decoded = txm_light_decode(&l->image, arena);
}

static inline txm_status txm_light_check(const txm_even_desc *desc, txm_env *env) {
    if (!desc) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL");
    txm_status status = txm_image_check(&desc->image, "image", 0, env);
    if (status != TXM_OK) return status;
    if (!txm_image_is_finite(&desc->image))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "image", "has samples that are infinite or NaN");
    if (!(desc->radius == 0 || (desc->radius >= TXM_EVEN_LEAST && desc->radius <= TXM_EVEN_MOST)))
        return txm_fail_numbers(env, TXM_BAD_ARGUMENT, "radius must be 0 (default) or # to #",
                                (uint64_t)TXM_EVEN_LEAST, (uint64_t)TXM_EVEN_MOST);
    if (!desc->mask.pixels) return TXM_OK;
    return txm_mask_check(&desc->mask, "mask", desc->image.width, desc->image.height, 0, env);
}

/* the radius that is meant */
static inline double txm_even_radius(const txm_even_desc *desc) {
    const int w = desc->image.width, h = desc->image.height;
    return desc->radius > 0 ? (double)desc->radius : fmax((w < h ? w : h) / 2.0, TXM_EVEN_LEAST);
}

/* Take out slow changes of light and colour. In linear light, in each channel of colour,

       out(x) = image(x) min(mean / l(x), 8)

   where l(x) is the value at x of a plane that is fitted to all that counts, by a Gaussian window
   around x: unlike a mean, it is right next to borders and holes too. All is scaled so that the
   mean light of each channel stays. Local contrast, as a ratio of light, is kept.

   out     the same size, channels and samples as the image, which it may be; all pixels are
           changed, alpha is not. Integer samples are clamped: what was nearly white in a dark
           part becomes white. Where nothing counts at all, the image as it is
   env     progress "even light"
   return  TXM_OK; TXM_BAD_ARGUMENT, TXM_TOO_LARGE, TXM_OUT_OF_MEMORY, TXM_CANCELLED: out is untouched
   cost    about 30 ns for each sample on one thread, any radius; 1200 bytes for each square of
           radius x radius pixels                                                          */
static inline txm_status txm_even(const txm_even_desc *desc, txm_env *env, const txm_image *out) {
    txm_light l;
    txm_arena arena;
    txm_status status = txm_light_check(desc, env);
    if (status == TXM_OK) status = txm_image_check(out, "out", 0, env);
    if (status != TXM_OK) return status;
    memset(&l, 0, sizeof l);
    l.image = txm_image_resolve(desc->image);
    l.out = txm_image_resolve(*out);
    if (desc->mask.pixels) l.mask = txm_image_resolve(desc->mask);
    if (l.out.width != l.image.width || l.out.height != l.image.height ||
        l.out.channels != l.image.channels || l.out.sample != l.image.sample)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "out",
                           "must have size, channels and samples of the image");
    l.colours = txm_image_colours(&l.image);
    txm_arena_init(&arena, env);
    txm_light_make_room(&l, txm_even_radius(desc), &arena);
    if (arena.failed) status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to even the light");
    else if (txm_progress(env, 0, "even light")) status = txm_fail(env, TXM_CANCELLED, "cancelled");
    if (status == TXM_OK) {
        txm_parallel_for(env, l.high, txm_light_sum, &l);
        if (!txm_light_mean(&l)) l.mean[0] = l.mean[1] = l.mean[2] = 0; /* gains of 1             */
        txm_parallel_for(env, l.high, txm_light_across, &l);
        txm_parallel_for(env, l.down, txm_light_down, &l);
        txm_light_keep_mean(&l);
        if (txm_progress(env, 0.5f, "even light"))
            status = txm_fail(env, TXM_CANCELLED, "cancelled");
    }
    if (status == TXM_OK) txm_parallel_for(env, TXM_LIGHT_BANDS, txm_light_apply, &l);
    txm_arena_free(&arena);
    return status;
}

/* ---- is it light? ----------------------------------------------------------------------- */

/* What tells uneven light from content (a stone, courses of brick, a meadow beside rock): light is
   slower than all else, and it changes everything alike. Of each of 16 x 16 cells the mean, the
   quartiles and the deviation of light are taken, in stops (log2). Polynomials of degree 1 and 2 in x
   and y fit the means (falloff to a side, dark corners). They are light if

     - they are large: 0.35 stops or more between the brightest and the darkest cell;
     - they are alone: each of these five polynomials holds on average 20 times as much of the
       variance as each of the next 22, of degrees 3 to 6. Content has large parts and smaller ones;
     - they are everywhere: the quartiles of the cells, so dark and bright pixels, follow them, and
       so does the deviation. Where there is more rock than grass, only their shares change. */
enum {
    TXM_UNEVEN_SIDE = 16,
    TXM_UNEVEN_COUNT = TXM_UNEVEN_SIDE * TXM_UNEVEN_SIDE,
    TXM_UNEVEN_DEGREE = 6,                /* of the polynomials that are compared                 */
    TXM_UNEVEN_SLOW = 2,                  /* of those that are slow                               */
    TXM_UNEVEN_BASIS = 28,                /* polynomials of degree 0 to 6                         */
    TXM_UNEVEN_LEAST_CELL = 4,            /* pixels a side                                        */
    TXM_UNEVEN_LEAST_CELLS = TXM_UNEVEN_COUNT / 2, /* that must be known                          */
    TXM_UNEVEN_LOOK = 2048,               /* pixels of a side that are looked at                  */
    TXM_UNEVEN_BINS = 256,
    TXM_UNEVEN_FIGURES = 5                /* mean, three quartiles, deviation                     */
};
#define TXM_UNEVEN_STOPS 0.35             /* a smaller change does not show among texture         */
#define TXM_UNEVEN_RATIO 20.0
#define TXM_UNEVEN_FOLLOW 0.5             /* quartiles follow by 1 +- so much ...                 */
#define TXM_UNEVEN_DEVIATION 0.6          /* ... and deviations by so much                        */
#define TXM_UNEVEN_BLACK (1.0 / 512)      /* light that is nothing, lest the log2 of noise counts */

typedef struct txm_uneven_grid {
    txm_image image, mask;
    const float *decoded;
    int colours, step_x, step_y;
    double known[TXM_UNEVEN_COUNT]; /* share of the cell's pixels that counts                      */
    double stops[3][TXM_UNEVEN_FIGURES][TXM_UNEVEN_COUNT];
    double bins[TXM_UNEVEN_SIDE][3][TXM_UNEVEN_BINS];
    double basis[TXM_UNEVEN_BASIS][TXM_UNEVEN_COUNT];
    int degree[TXM_UNEVEN_BASIS], cells, functions;
} txm_uneven_grid;

/* the bin of a sample: its code in 8 bits */
static inline int txm_uneven_bin(const txm_image *image, int x, int y, int c) {
    double code = (double)txm_clampf(txm_image_get(image, x, y, c), 0, 1);
    if (image->sample == TXM_F32) code = txm_light_code(code);
    return (int)(code * (TXM_UNEVEN_BINS - 1) + 0.5);
}

/* The light below which this share of the bins lies, linear within a bin. */
static inline double txm_uneven_quantile(const double *bins, double total, double share) {
    double below = 0;
    int k = 0;
    while (k < TXM_UNEVEN_BINS - 1 && below + bins[k] <= share * total) below += bins[k++];
    const double within = bins[k] > 0 ? (share * total - below) / bins[k] : 0.5;
    return txm_light_of(fmax(k - 0.5 + within, 0) / (TXM_UNEVEN_BINS - 1));
}

/* The figures of the cells of one row. */
static inline void txm_uneven_row(void *context, int row) {
    txm_uneven_grid *g = (txm_uneven_grid *)context;
    const int n = TXM_UNEVEN_SIDE, bottom = txm_light_edge(g->image.height, row + 1, n);
    for (int k = 0; k < n; k++) {
        const int end = txm_light_edge(g->image.width, k + 1, n), cell = row * n + k;
        double weight = 0, seen = 0, sum[3] = {0}, square[3] = {0};
        memset(g->bins[row], 0, sizeof g->bins[row]);
        for (int y = txm_light_edge(g->image.height, row, n); y < bottom; y += g->step_y) {
            for (int x = txm_light_edge(g->image.width, k, n); x < end; x += g->step_x) {
                const double w = txm_light_weight(&g->image, &g->mask, x, y);
                seen += 1;
                if (!(w > 0)) continue;
                weight += w;
                for (int c = 0; c < g->colours; c++) {
                    const double light = txm_light_get(&g->image, g->decoded, x, y, c);
                    sum[c] += w * light;
                    square[c] += w * light * light;
                    g->bins[row][c][txm_uneven_bin(&g->image, x, y, c)] += w;
                }
            }
        }
        g->known[cell] = weight / seen;
        for (int c = 0; c < g->colours && weight > 0; c++) {
            const double mean = sum[c] / weight;
            double figure[TXM_UNEVEN_FIGURES];
            figure[0] = mean;
            for (int q = 1; q < 4; q++)
                figure[q] = txm_uneven_quantile(g->bins[row][c], weight, 0.25 * q);
            figure[4] = sqrt(fmax(square[c] / weight - mean * mean, 0));
            for (int f = 0; f < TXM_UNEVEN_FIGURES; f++)
                g->stops[c][f][cell] = txm_log2(fmax(figure[f], 0) + TXM_UNEVEN_BLACK);
        }
    }
}

/* Leave the cells of which at least a quarter counts: known becomes 1 or 0. */
static inline void txm_uneven_choose(txm_uneven_grid *g) {
    g->cells = 0;
    for (int i = 0; i < TXM_UNEVEN_COUNT; i++) {
        g->known[i] = g->known[i] >= 0.25;
        g->cells += g->known[i] > 0;
    }
}

/* the sum over known cells of a b */
static inline double txm_uneven_dot(const txm_uneven_grid *g, const double *a, const double *b) {
    double sum = 0;
    for (int i = 0; i < TXM_UNEVEN_COUNT; i++) sum += g->known[i] * a[i] * b[i];
    return sum;
}

/* Polynomials of x and y that are orthogonal over the known cells, of mean square 1: Gram-Schmidt in
   order of degree, each twice. Those that the others can express there are left out. */
static inline void txm_uneven_basis(txm_uneven_grid *g) {
    g->functions = 0;
    for (int degree = 0; degree <= TXM_UNEVEN_DEGREE; degree++) {
        for (int p = 0; p <= degree; p++) {
            double *f = g->basis[g->functions];
            for (int i = 0; i < TXM_UNEVEN_COUNT; i++) {
                const double x = (i % TXM_UNEVEN_SIDE * 2 + 1.0) / (int)TXM_UNEVEN_SIDE - 1;
                const double y = ((int)(i / TXM_UNEVEN_SIDE) * 2 + 1.0) / (int)TXM_UNEVEN_SIDE - 1;
                f[i] = 1;
                for (int k = 0; k < degree; k++) f[i] *= k < p ? x : y;
            }
            const double before = txm_uneven_dot(g, f, f);
            for (int k = 0; k < 2 * g->functions; k++) {
                const double *other = g->basis[k % g->functions];
                const double part = txm_uneven_dot(g, f, other) / g->cells;
                for (int i = 0; i < TXM_UNEVEN_COUNT; i++) f[i] -= part * other[i];
            }
            const double after = txm_uneven_dot(g, f, f);
            if (!(after > 1e-9 * before)) continue;
            const double scale = sqrt(g->cells / after);
            for (int i = 0; i < TXM_UNEVEN_COUNT; i++) f[i] *= scale;
            TXM_ASSERT(g->functions < (int)(sizeof g->degree / sizeof *g->degree));
            g->degree[g->functions++] = degree;
        }
    }
}

/* The slow part of a figure: its value in each cell. Returns how much more of the variance each of
   its polynomials holds than each of the others, on average. */
static inline double txm_uneven_slow(const txm_uneven_grid *g, const double *figure, double *slow) {
    double held[2] = {0, 0};
    int count[2] = {0, 0};
    for (int i = 0; i < TXM_UNEVEN_COUNT; i++) slow[i] = 0;
    for (int k = 0; k < g->functions; k++) {
        if (g->degree[k] == 0) continue;
        const double part = txm_uneven_dot(g, g->basis[k], figure) / g->cells;
        const int is_fast = g->degree[k] > TXM_UNEVEN_SLOW;
        held[is_fast] += part * part;
        count[is_fast]++;
        for (int i = 0; i < TXM_UNEVEN_COUNT && !is_fast; i++) slow[i] += part * g->basis[k][i];
    }
    if (!count[0] || !count[1]) return 0;
    return held[0] / count[0] / fmax(held[1] / count[1], 1e-12);
}

/* The stops of uneven light in one colour, or 0 if it is not light. */
static inline double txm_uneven_colour(const txm_uneven_grid *g, int colour) {
    double slow[TXM_UNEVEN_FIGURES][TXM_UNEVEN_COUNT], low = 0, high = 0;
    const double ratio = txm_uneven_slow(g, g->stops[colour][0], slow[0]);
    for (int i = 0; i < TXM_UNEVEN_COUNT; i++) {
        if (!(g->known[i] > 0)) continue;
        low = fmin(low, slow[0][i]);
        high = fmax(high, slow[0][i]);
    }
    if (!(ratio >= TXM_UNEVEN_RATIO && high - low >= TXM_UNEVEN_STOPS)) return 0;
    const double own = txm_uneven_dot(g, slow[0], slow[0]);
    for (int f = 1; f < TXM_UNEVEN_FIGURES; f++) {
        txm_uneven_slow(g, g->stops[colour][f], slow[f]);
        const double follows = txm_uneven_dot(g, slow[0], slow[f]) / own;
        const double most = f == 4 ? TXM_UNEVEN_DEVIATION : TXM_UNEVEN_FOLLOW;
        if (!(fabs(follows - 1) <= most)) return 0;
    }
    return high - low;
}

/* How uneven is the light of a picture?

   desc    its radius does not matter
   stops   receives the difference between its brightest and its darkest part, log2 of light, in the
           colour where it is largest; 0 if it is even enough, if the change is one of content, or
           if the picture is too small to tell (less than 64 pixels a side, or most of it masked)
   env     progress "measure light"
   return  TXM_OK; TXM_BAD_ARGUMENT, TXM_TOO_LARGE, TXM_OUT_OF_MEMORY, TXM_CANCELLED: *stops is 0
   cost    about 30 ns for each sample on one thread, of at most 2048 x 2048 pixels; 200 kB */
static inline txm_status txm_uneven(const txm_even_desc *desc, txm_env *env, float *stops) {
    txm_arena arena;
    if (!stops) return txm_fail(env, TXM_BAD_ARGUMENT, "stops is NULL");
    *stops = 0;
    txm_status status = txm_light_check(desc, env);
    if (status != TXM_OK) return status;
    const int least = TXM_UNEVEN_SIDE * TXM_UNEVEN_LEAST_CELL;
    if (desc->image.width < least || desc->image.height < least) return TXM_OK;
    txm_arena_init(&arena, env);
    txm_uneven_grid *g = (txm_uneven_grid *)txm_arena_zero(&arena, 1, sizeof *g);
    if (g) {
        g->image = txm_image_resolve(desc->image);
        if (desc->mask.pixels) g->mask = txm_image_resolve(desc->mask);
        g->decoded = txm_light_decode(&g->image, &arena);
    }
    if (arena.failed || !g)
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to measure the light");
    else if (txm_progress(env, 0, "measure light"))
        status = txm_fail(env, TXM_CANCELLED, "cancelled");
    if (status == TXM_OK) {
        g->colours = txm_image_colours(&g->image);
        g->step_x = (g->image.width - 1) / TXM_UNEVEN_LOOK + 1;
        g->step_y = (g->image.height - 1) / TXM_UNEVEN_LOOK + 1;
        txm_parallel_for(env, TXM_UNEVEN_SIDE, txm_uneven_row, g);
        txm_uneven_choose(g);
        if (g->cells >= TXM_UNEVEN_LEAST_CELLS) {
            txm_uneven_basis(g);
            for (int c = 0; c < g->colours; c++)
                *stops = txm_maxf(*stops, txm_float(txm_uneven_colour(g, c)));
        }
    }
    txm_arena_free(&arena);
    return status;
}

#endif /* TEXMATH_LIGHT_H */
