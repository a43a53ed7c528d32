#ifndef TEXSYN_TEXTONS_H
#define TEXSYN_TEXTONS_H

#include "config.h"

/* ---- textons ------------------------------------------------------------------------------

   What a pixel looks like, as two small numbers: a colour texton, the nearest of at most 32 typical
   colours, and a texture texton, the nearest of 64 typical answers of nine filters. These tell how
   much the lightness changes across, down and as spots (gradient and Laplacian, without signs,
   smoothed) at three scales. A texture is then a histogram of textons [6]. Everything is computed
   in integers, or in floats that hold whole numbers below 2^24: the same everywhere. */

enum {
    TXS_WORK = 1 << 19,      /* pixels: a larger picture is reduced to a half, a third, ...     */
    TXS_COLOURS = 32,        /* colour textons                                                  */
    TXS_GRAINS = 64,         /* texture textons                                                 */
    TXS_SCALES = 3,          /* Gaussians of sigma 1, 2.2, 4.6                                  */
    TXS_FILTERS = 3 * TXS_SCALES,
    TXS_CODES = 255 * 16,    /* a sample, 0..1, in steps of a sixteenth of an 8-bit one         */
    TXS_LAB = 64,            /* steps per unit of L*, a*, b*                                    */
    TXS_CUBE_ROOTS = 1 << 14, /* entries of the table, from 0 to 1                              */
    TXS_ROOT_UNIT = 8192,    /* its entries' unit                                               */
    TXS_LOUD = 8,            /* filter answers are told apart up to so many times their RMS     */
    TXS_ANSWER = 127,        /* the largest answer of a filter                                  */
    TXS_TRAINING = 8192,     /* pixels that the textons are made from                           */
    TXS_ROUNDS = 8,          /* of k-means                                                      */
    TXS_APART = 20           /* first centres of colours: so many quarters of a unit of Lab     */
};

/* The picture at the resolution that is worked at, and its textons. */
typedef struct txs_scene {
    int width, height, factor;  /* a pixel is a square of factor x factor pixels of the picture   */
    size_t pixels;
    uint8_t *counted;           /* non-zero: at least half of the square takes part               */
    int16_t *lab[3];            /* L*, a*, b* in steps of 1 / TXS_LAB                             */
    uint8_t *colour, *shape;    /* the textons of each pixel                                      */
} txs_scene;

/* ---- colour ------------------------------------------------------------------------------- */

/* The root of a, 0..1, by Newton's method from above: the same everywhere, unlike pow. */
static double txs_newton_root(double a, int degree) {
    double t = 1;
    for (int k = 0; k < 60 && a > 0; k++) {
        double power = 1;
        for (int i = 1; i < degree; i++) power *= t;
        const double next = t - (t * power - a) / (degree * power);
        if (!(next < t)) break;
        t = next;
    }
    return a > 0 ? t : 0;
}

typedef struct txs_colours {
    uint16_t linear[TXS_CODES + 1];    /* of an sRGB code, 0..65535         */
    int16_t root[TXS_CUBE_ROOTS + 1];  /* CIE's f of a linear value         */
} txs_colours;

static void txs_colour_tables(txs_colours *t) {
    for (int i = 0; i <= TXS_CODES; i++) {
        const double s = (double)i / (double)TXS_CODES, v = (s + 0.055) / 1.055;
        const double linear = s <= 0.04045 ? s / 12.92 : v * v * txs_newton_root(v * v, 5);
        t->linear[i] = (uint16_t)(linear * 65535 + 0.5);
    }
    for (int i = 0; i <= TXS_CUBE_ROOTS; i++) {
        const double v = (double)i / (double)TXS_CUBE_ROOTS;
        const double f = v > 0.008856 ? txs_newton_root(v, 3) : 7.787 * v + 16.0 / 116;
        t->root[i] = (int16_t)(f * (double)TXS_ROOT_UNIT + 0.5);
    }
}

/* sRGB codes to L*a*b* under D65 */
static void txs_code_to_lab(const txs_colours *t, const int code[3], int lab[3]) {
    static const uint32_t weights[3][3] = { /* of R, G, B in X, Y, Z over white, of 32768 */
        {14218, 12327, 6223}, {6966, 23436, 2366}, {580, 3588, 28600}};
    int f[3];
    for (int k = 0; k < 3; k++) {
        uint32_t sum = 0;
        for (int c = 0; c < 3; c++) sum += weights[k][c] * t->linear[code[c]];
        f[k] = t->root[(sum >> 15) * TXS_CUBE_ROOTS / 65535];
    }
    lab[0] = 116 * f[1] * TXS_LAB / TXS_ROOT_UNIT - 16 * TXS_LAB;
    lab[1] = 500 * (f[0] - f[1]) / (TXS_ROOT_UNIT / TXS_LAB);
    lab[2] = 200 * (f[1] - f[2]) / (TXS_ROOT_UNIT / TXS_LAB);
}

static int txs_sample_code(const txm_image *im, int x, int y, int c) {
    const void *row = txm_image_row_const(im, y);
    const size_t i = (size_t)x * (size_t)im->channels + (size_t)c;
    if (im->sample == TXM_U8) return 16 * ((const uint8_t *)row)[i];
    if (im->sample == TXM_U16)
        return (int)(((uint32_t)((const uint16_t *)row)[i] * TXS_CODES + 32767) / 65535);
    return (int)((double)txm_clampf(((const float *)row)[i], 0, 1) * (double)TXS_CODES + 0.5);
}

/* ---- the picture at working resolution ------------------------------------------------------ */

/* Does the pixel take part? By the bytes of the mask, where there is one, and by its own alpha. */
static int txs_takes_part(const txm_image *im, const uint8_t *mask, int x, int y) {
    const int alpha = im->channels == 2 || im->channels == 4;
    if (alpha && txs_sample_code(im, x, y, im->channels - 1) < TXS_CODES / 2) return 0;
    return !mask || mask[(size_t)y * (size_t)im->width + (size_t)x];
}

/* One pixel of the scene: the mean of those of its square that take part, weighted by alpha. */
static void txs_reduce(txs_scene *s, const txm_image *im, const uint8_t *mask,
                       const txs_colours *tables, int x, int y) {
    const int f = s->factor, colours = im->channels < 3 ? 1 : 3;
    const int right = txm_clampi((x + 1) * f, 0, im->width);
    const int bottom = txm_clampi((y + 1) * f, 0, im->height);
    const size_t at = (size_t)y * (size_t)s->width + (size_t)x;
    const int alpha = txm_image_has_alpha(im);
    int64_t sum[3] = {0, 0, 0}, weights = 0, parts = 0, all = 0;
    for (int v = y * f; v < bottom; v++) {
        for (int u = x * f; u < right; u++, all++) {
            if (!txs_takes_part(im, mask, u, v)) continue;
            const int weight = alpha ? txs_sample_code(im, u, v, im->channels - 1) : 1;
            for (int c = 0; c < colours; c++)
                sum[c] += (int64_t)weight * txs_sample_code(im, u, v, c);
            weights += weight;
            parts++;
        }
    }
    s->counted[at] = (uint8_t)(parts > 0 && 2 * parts >= all);
    if (!weights) weights = 1;
    int code[3], lab[3];
    for (int c = 0; c < 3; c++) code[c] = (int)(sum[colours == 1 ? 0 : c] / weights);
    txs_code_to_lab(tables, code, lab);
    for (int c = 0; c < 3; c++) s->lab[c][at] = (int16_t)lab[c];
}

/* ---- filters ------------------------------------------------------------------------------ */

/* Five taps of a Gaussian, `step` apart, along a row or a column of count values that lie `by`
   apart; the border is repeated. line: room for count + 4 * step values. */
static void txs_blur_line(int16_t *values, int count, ptrdiff_t by, int step, int16_t *line) {
    const int pad = 2 * step;
    for (int i = 0; i < count; i++) line[pad + i] = values[i * by];
    for (int i = 0; i < pad; i++) {
        line[i] = line[pad];
        line[pad + count + i] = line[pad + count - 1];
    }
    for (int i = 0; i < count; i++) {
        const int16_t *p = line + i;
        const int sum = p[0] + 4 * p[step] + 6 * p[2 * step] + 4 * p[3 * step] + p[4 * step];
        values[i * by] = (int16_t)((sum + 8 + (1 << 20)) / 16 - (1 << 16));
    }
}

typedef struct txs_blurring {
    int16_t *plane, *lines;
    int width, height, step, room; /* room: values a line has in lines */
} txs_blurring;

static void txs_blur_rows(void *context, int share) {
    const txs_blurring *b = (const txs_blurring *)context;
    const int from = (int)((int64_t)b->height * share / TXS_TASKS);
    const int to = (int)((int64_t)b->height * (share + 1) / TXS_TASKS);
    for (int y = from; y < to; y++)
        txs_blur_line(b->plane + (ptrdiff_t)y * b->width, b->width, 1, b->step,
                      b->lines + (ptrdiff_t)share * b->room);
}

static void txs_blur_columns(void *context, int share) {
    const txs_blurring *b = (const txs_blurring *)context;
    const int from = (int)((int64_t)b->width * share / TXS_TASKS);
    const int to = (int)((int64_t)b->width * (share + 1) / TXS_TASKS);
    for (int x = from; x < to; x++)
        txs_blur_line(b->plane + x, b->height, b->width, b->step,
                      b->lines + (ptrdiff_t)share * b->room);
}

static void txs_blur_plane(const txs_scene *s, int16_t *plane, int step, int16_t *lines, int room,
                     txm_env *env) {
    txs_blurring b = {plane, lines, s->width, s->height, step, room};
    TEXSYN_ASSERT(room >= s->width + 4 * step && room >= s->height + 4 * step);
    txm_parallel_for(env, TXS_TASKS, txs_blur_rows, &b);
    txm_parallel_for(env, TXS_TASKS, txs_blur_columns, &b);
}

/* Filter 0, 1: gradients, 2: Laplacian, by differences of pixels `step` apart. */
static int txs_answer(const txs_scene *s, const int16_t *plane, int filter, int step, int x,
                      int y) {
    const ptrdiff_t w = s->width;
    const int left = x < step ? 0 : x - step, right = x + step < s->width ? x + step : s->width - 1;
    const int up = y < step ? 0 : y - step, down = y + step < s->height ? y + step : s->height - 1;
    const int dx = plane[y * w + right] - plane[y * w + left];
    if (filter == 0) return dx;
    if (filter == 1) return plane[down * w + x] - plane[up * w + x];
    return plane[y * w + right] + plane[y * w + left] + plane[down * w + x] + plane[up * w + x] -
           4 * plane[y * w + x];
}

/* One filter over the scene: the magnitudes of its answers, smoothed, relative to their root mean
   square r: 127 a / sqrt(r^2 + a^2), which lets no contour drown the rest. */
static void txs_run_filter(const txs_scene *s, const int16_t *plane, int filter, int step,
                           int16_t *raw, int8_t *out, int16_t *lines, int room, txm_env *env) {
    enum { LEVELS = 256 }; /* of |a|, up to TXS_LOUD times r */
    int8_t level[LEVELS + 1];
    uint64_t square = 0, count = 0;
    for (int y = 0; y < s->height; y++) {
        for (int x = 0; x < s->width; x++) {
            const size_t i = (size_t)y * (size_t)s->width + (size_t)x;
            const int a = txs_answer(s, plane, filter, step, x, y);
            raw[i] = (int16_t)txm_clampi(abs(a), 0, INT16_MAX);
        }
    }
    txs_blur_plane(s, raw, step, lines, room, env);
    for (size_t i = 0; i < s->pixels; i++) {
        if (!s->counted[i]) continue;
        square += (uint64_t)((int64_t)raw[i] * raw[i]);
        count++;
    }
    const double least = (double)TXS_LAB / 4; /* weaker answers are noise of the 8-bit samples */
    double rms = sqrt((double)square / (double)(count ? count : 1));
    if (rms < least) rms = least;
    for (int i = 0; i <= LEVELS; i++) {
        const double v = (double)(i * TXS_LOUD) / (double)LEVELS;
        level[i] = (int8_t)((double)TXS_ANSWER * v / sqrt(1 + v * v) + 0.5);
    }
    const int scale = (int)((double)(LEVELS << 12) / ((double)TXS_LOUD * rms) + 0.5);
    for (size_t i = 0; i < s->pixels; i++) {
        const int64_t at = ((int64_t)raw[i] * scale + (1 << 11)) >> 12;
        out[i] = level[at < (int64_t)LEVELS ? at : (int64_t)LEVELS];
    }
}

/* ---- k-means ------------------------------------------------------------------------------ */

enum { TXS_MOST_CENTRES = 64, TXS_MOST_AXES = TXS_FILTERS };

/* Centres, axis by axis, whole numbers. The distance of x from centre c, up to |x|^2, is
   |c|^2 - 2 x.c: products and sums stay below 2^24, so float holds them exactly. */
typedef struct txs_clusters {
    int count, axes;
    float centre[TXS_MOST_AXES][TXS_MOST_CENTRES], square[TXS_MOST_CENTRES];
} txs_clusters;

static void txs_set_centre(txs_clusters *k, int c, const int *x) {
    float square = 0;
    for (int a = 0; a < k->axes; a++) {
        k->centre[a][c] = (float)x[a];
        square += (float)(x[a] * x[a]);
    }
    k->square[c] = square;
}

/* the nearest centre, the first of several */
static int txs_nearest(const txs_clusters *k, const int *x) {
    float d[TXS_MOST_CENTRES];
    int best = 0;
    for (int c = 0; c < TXS_MOST_CENTRES; c++) d[c] = k->square[c];
    for (int a = 0; a < k->axes; a++) {
        const float v = (float)(-2 * x[a]);
        const float *centre = k->centre[a];
        for (int c = 0; c < TXS_MOST_CENTRES; c++) d[c] += v * centre[c];
    }
    for (int c = 1; c < k->count; c++)
        if (d[c] < d[best]) best = c;
    return best;
}

static int64_t txs_distance2(const int *x, const int *y, int axes) {
    int64_t sum = 0;
    for (int a = 0; a < axes; a++) sum += (int64_t)(x[a] - y[a]) * (x[a] - y[a]);
    return sum;
}

/* First centres: each sample with a chance in proportion to its squared distance from the centres
   so far (k-means++), less `apart`: samples that are nearer to a centre are as good as it. */
static void txs_seed_centres(txs_clusters *k, const int *samples, int n, int64_t apart,
                             int64_t *far_, uint64_t seed) {
    txm_rng rng = txm_rng_make(seed, 7);
    const int axes = k->axes;
    int chosen = (int)txm_rng_below(&rng, (uint32_t)n);
    for (int i = 0; i < n; i++) far_[i] = INT64_MAX;
    for (int c = 0; c < k->count; c++) {
        int64_t sum = 0;
        txs_set_centre(k, c, samples + (ptrdiff_t)chosen * axes);
        for (int i = 0; i < n; i++) {
            const int64_t d = txs_distance2(samples + (ptrdiff_t)i * axes,
                                            samples + (ptrdiff_t)chosen * axes, axes);
            if (d - apart < far_[i]) far_[i] = d > apart ? d - apart : 0;
            sum += far_[i];
        }
        if (sum == 0) { /* no sample differs enough from all centres */
            k->count = c + 1;
            return;
        }
        uint64_t at = ((uint64_t)txm_rng_next(&rng) << 20) % (uint64_t)sum;
        for (chosen = 0; chosen + 1 < n && at >= (uint64_t)far_[chosen]; chosen++)
            at -= (uint64_t)far_[chosen];
    }
}

/* k-means over n samples of `axes` numbers each. */
static void txs_find_centres(txs_clusters *k, const int *samples, int n, int64_t apart,
                              int64_t *far_, uint64_t seed) {
    txs_seed_centres(k, samples, n, apart, far_, seed);
    for (int c = k->count; c < TXS_MOST_CENTRES; c++) k->square[c] = 0; /* computed, never chosen */
    for (int round = 0; round < TXS_ROUNDS; round++) {
        int64_t sum[TXS_MOST_CENTRES][TXS_MOST_AXES] = {{0}}, members[TXS_MOST_CENTRES] = {0};
        for (int i = 0; i < n; i++) {
            const int *x = samples + (ptrdiff_t)i * k->axes;
            const int c = txs_nearest(k, x);
            for (int a = 0; a < k->axes; a++) sum[c][a] += x[a];
            members[c]++;
        }
        for (int c = 0; c < k->count; c++) {
            int mean[TXS_MOST_AXES];
            if (!members[c]) continue;
            for (int a = 0; a < k->axes; a++) {
                const int64_t half = sum[c][a] < 0 ? -members[c] / 2 : members[c] / 2;
                mean[a] = (int)((sum[c][a] + half) / members[c]);
            }
            txs_set_centre(k, c, mean);
        }
    }
}

/* ---- the textons of a scene ---------------------------------------------------------------- */

typedef struct txs_features {
    const txs_scene *scene;
    int16_t *smooth[3];            /* lab, blurred once */
    int8_t *answers[TXS_FILTERS];
    txs_clusters colours, shapes;
} txs_features;

/* (L, 1.5 a, 1.5 b) in steps of a quarter */
static void txs_colour_features(const txs_features *f, size_t i, int *x) {
    x[0] = f->smooth[0][i] / (TXS_LAB / 4);
    for (int c = 1; c < 3; c++) x[c] = f->smooth[c][i] * 3 / (TXS_LAB / 2);
}

static void txs_shape_features(const txs_features *f, size_t i, int *x) {
    for (int a = 0; a < TXS_FILTERS; a++) x[a] = 0 + f->answers[a][i];
}

static void txs_name_textons(void *context, int share) {
    const txs_features *f = (const txs_features *)context;
    const txs_scene *s = f->scene;
    const size_t from = s->pixels * (size_t)share / TXS_TASKS;
    const size_t to = s->pixels * ((size_t)share + 1) / TXS_TASKS;
    for (size_t i = from; i < to; i++) {
        int x[TXS_MOST_AXES];
        if (!s->counted[i]) continue;
        txs_colour_features(f, i, x);
        s->colour[i] = (uint8_t)txs_nearest(&f->colours, x);
        txs_shape_features(f, i, x);
        s->shape[i] = (uint8_t)txs_nearest(&f->shapes, x);
    }
}

/* Make both vocabularies from a sample of the counted pixels, evenly spread over them. */
static void txs_find_textons(txs_features *f, int *samples, int64_t *far_, uint64_t seed) {
    const txs_scene *s = f->scene;
    size_t counted = 0;
    for (size_t i = 0; i < s->pixels; i++) counted += s->counted[i];
    const size_t step = counted / TXS_TRAINING + 1;
    for (int pass = 0; pass < 2; pass++) {
        txs_clusters *k = pass ? &f->shapes : &f->colours;
        k->count = pass ? TXS_GRAINS : TXS_COLOURS;
        k->axes = pass ? TXS_FILTERS : 3;
        size_t seen = 0, next = step / 2;
        int n = 0;
        for (size_t i = 0; i < s->pixels; i++) {
            if (!s->counted[i] || seen++ != next) continue;
            TEXSYN_ASSERT(n < TXS_TRAINING);
            if (pass) txs_shape_features(f, i, samples + n * k->axes);
            else txs_colour_features(f, i, samples + n * k->axes);
            n++;
            next = (size_t)n * step + (size_t)(txm_hash((uint64_t)n) % step);
        }
        TEXSYN_ASSERT(n > 0);
        const int64_t apart = pass ? 0 : TXS_APART * TXS_APART;
        txs_find_centres(k, samples, n, apart, far_, seed + (uint64_t)pass);
    }
}

#endif /* TEXSYN_TEXTONS_H */
