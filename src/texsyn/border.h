#ifndef TEXSYN_BORDER_H
#define TEXSYN_BORDER_H

#include "mask.h"
#include "model.h"

/* ---- the border of a knit ----------------------------------------------------------------

   Two pictures, and for each pixel the label of the one that it is taken from: 0 or 1. The border
   as drawn is displaced: where the first material is bright it reaches further into the second one
   and the other way round, so that whole grains and stones stay together and stand out; noise as
   coarse as the grain does the rest. How coarse that is is asked of the materials.          */

enum {
    TXS_NEXT = 5, /* distances are in fifths of a pixel: to the next pixel in a row, */
    TXS_CORNERWISE = 7,
    TXS_KNIGHT = 11,     /* diagonally, and 2 along and 1 across                     */
    TXS_FARTHEST = 60000,     /* no other label seen yet                                  */
    TXS_KNIT_CELL = 256,      /* pixels: a side of what is worked on at once              */
    TXS_SURVEY = 100000, /* pixels of a picture that are looked at                   */
    TXS_LAGS = 24,       /* pixels: the longest correlation that is looked for       */
    TXS_TRAITS = 7,      /* histograms that tell textures apart                      */
    TXS_TRAIT_BINS = 32,
    TXS_COATS = 4 /* fields that displace the border: brightness of both, noise, fine noise */
};

#define TXS_FINEST_GRAIN 1.5  /* pixels: standard deviation of the blur of the fields */
#define TXS_COARSEST_GRAIN 5.0
#define TXS_ROUGH 2.2         /* displacement in units of the grain                   */
#define TXS_ROUGHEST 2.5      /* the largest displacement in units of the usual one   */

typedef struct txs_pair_of_pictures { /* all of one form; the second one is repeated by reflection */
    txm_image picture[2];
    int width, height; /* of the first */
} txs_pair_of_pictures;

/* A coordinate reflected into 0..size-1. */
static int txs_reflect(int x, int size) {
    const int turn = txs_mod(x, 2 * size);
    return turn < size ? turn : 2 * size - 1 - turn;
}

static float txs_pair_get(const txs_pair_of_pictures *p, int label, int x, int y, int c) {
    const txm_image *im = &p->picture[label];
    return txm_image_get(im, txs_reflect(x, im->width), txs_reflect(y, im->height), c);
}

/* Brightness 0..1; what cannot be seen is neither bright nor dark. */
static double txs_pair_luma(const txs_pair_of_pictures *p, int label, int x, int y) {
    const int channels = p->picture[label].channels;
    if (channels == 4 && !(txs_pair_get(p, label, x, y, 3) > 0)) return 0.5;
    if (channels < 3) return (double)txs_pair_get(p, label, x, y, 0);
    return (54 * (double)txs_pair_get(p, label, x, y, 0) +
            183 * (double)txs_pair_get(p, label, x, y, 1) +
            19 * (double)txs_pair_get(p, label, x, y, 2)) /
           256;
}

/* ---- distances ------------------------------------------------------------------------ */

/* The distance of a pixel from the nearest one of another label, by way of one neighbour. */
static int txs_border_step(const uint8_t *label, const uint16_t *distance, int width, int height,
                           int x, int y, int dx, int dy, int step) {
    const int nx = x + dx, ny = y + dy;
    if (nx < 0 || ny < 0 || nx >= width || ny >= height) return TXS_FARTHEST;
    const size_t at = (size_t)y * (size_t)width + (size_t)x;
    const size_t next = (size_t)ny * (size_t)width + (size_t)nx;
    return label[next] != label[at] ? step : distance[next] + step;
}

/* Distances of all pixels from the other label, in fifths of a pixel, at most TXS_FARTHEST. */
static void txs_border_distances(const uint8_t *label, int width, int height, uint16_t *distance) {
    static const int8_t way[8][3] = {
        {-1, 0, TXS_NEXT},      {0, -1, TXS_NEXT},      {-1, -1, TXS_CORNERWISE},
        {1, -1, TXS_CORNERWISE},  {-2, -1, TXS_KNIGHT},   {-1, -2, TXS_KNIGHT},
        {1, -2, TXS_KNIGHT},    {2, -1, TXS_KNIGHT}};
    const size_t pixels = txs_pixels_of(width, height);
    for (size_t i = 0; i < pixels; i++) distance[i] = TXS_FARTHEST;
    for (int sign = 1; sign >= -1; sign -= 2) { /* from the first pixel on, then from the last */
        for (size_t i = 0; i < pixels; i++) {
            const size_t at = sign > 0 ? i : pixels - 1 - i;
            const int x = (int)(at % (size_t)width), y = (int)(at / (size_t)width);
            int least = distance[at];
            for (int k = 0; k < 8; k++) {
                const int d = txs_border_step(label, distance, width, height, x, y,
                                              sign * way[k][0], sign * way[k][1], way[k][2]);
                if (d < least) least = d;
            }
            distance[at] = (uint16_t)least;
        }
    }
}

/* ---- what the materials are like ------------------------------------------------------ */

typedef struct txs_material {
    double grain;                             /* pixels: half the length of correlation */
    double trait[TXS_TRAITS][TXS_TRAIT_BINS]; /* normalised histograms                  */
} txs_material;

/* Every how many pixels, in both directions, a picture is looked at. */
static int txs_survey_step(int width, int height) {
    int step = 1;
    while ((int64_t)width * height / step / step > TXS_SURVEY) step++;
    return step;
}

static void txs_add_trait(txs_material *m, int trait, double value) {
    m->trait[trait][txm_clampi((int)floor(value * (double)TXS_TRAIT_BINS), 0,
                               (int)TXS_TRAIT_BINS - 1)] += 1;
}

/* Brightness, two differences of channels, and differences of neighbours near and far. */
static void txs_survey_pixel(const txs_pair_of_pictures *p, int label, int x, int y,
                             txs_material *m) {
    enum { FAR_ = 4 }; /* pixels */
    const double luma = txs_pair_luma(p, label, x, y);
    txs_add_trait(m, 0, luma);
    for (int k = 0; k < 4; k++) {
        const int step = k < 2 ? 1 : FAR_;
        const double other = txs_pair_luma(p, label, x + (k % 2 ? 0 : step), y + (k % 2 ? step : 0));
        txs_add_trait(m, 1 + k, sqrt(fabs(other - luma))); /* small ones are resolved better */
    }
    if (p->picture[label].channels < 3) return;
    const double green = (double)txs_pair_get(p, label, x, y, 1);
    txs_add_trait(m, 5, 0.5 + 2 * ((double)txs_pair_get(p, label, x, y, 0) - green));
    txs_add_trait(m, 6, 0.5 + 2 * ((double)txs_pair_get(p, label, x, y, 2) - green));
}

/* The length of correlation of the brightness: where it falls under 1/e. */
static double txs_correlation(const txs_pair_of_pictures *p, const uint8_t *own, int label,
                              int step) {
    double count = 0, sum = 0, square = 0;
    double differing[TXS_LAGS + 1] = {0}, pairs[TXS_LAGS + 1] = {0};
    for (int y = 0; y < p->height; y += step) {
        for (int x = 0; x < p->width; x += step) {
            if (own[(size_t)y * (size_t)p->width + (size_t)x] != label) continue;
            const double v = txs_pair_luma(p, label, x, y);
            count++;
            sum += v;
            square += txm_float(v * v);
            for (int lag = 1; lag <= TXS_LAGS; lag++) {
                for (int k = 0; k < 2; k++) {
                    const int nx = x + (k ? 0 : lag), ny = y + (k ? lag : 0);
                    if (nx >= p->width || ny >= p->height ||
                        own[(size_t)ny * (size_t)p->width + (size_t)nx] != label)
                        continue;
                    const double d = txs_pair_luma(p, label, nx, ny) - v;
                    differing[lag] += txm_float(d * d);
                    pairs[lag]++;
                }
            }
        }
    }
    const double mean = count > 0 ? sum / count : 0;
    const double variance = count > 0 ? square / count - txm_float(mean * mean) : 0;
    for (int lag = 1; lag <= TXS_LAGS; lag++)
        if (!(pairs[lag] > 0) ||
            differing[lag] / pairs[lag] > 2 * variance * (1 - 0.36787944117144233))
            return lag;
    return TXS_LAGS;
}

/* Look at a picture where it is its own side. */
static void txs_survey(const txs_pair_of_pictures *p, const uint8_t *own, int label,
                       txs_material *m) {
    const int step = txs_survey_step(p->width, p->height);
    double count = 0;
    memset(m, 0, sizeof *m);
    for (int y = 0; y < p->height; y += step) {
        for (int x = 0; x < p->width; x += step) {
            if (own[(size_t)y * (size_t)p->width + (size_t)x] != label) continue;
            txs_survey_pixel(p, label, x, y, m);
            count++;
        }
    }
    for (int k = 0; k < TXS_TRAITS; k++)
        for (int i = 0; i < TXS_TRAIT_BINS && count > 0; i++) m->trait[k][i] /= count;
    m->grain = txs_correlation(p, own, label, step) / 2;
}

/* How much two materials differ: 0..1, the largest of the distances of their histograms. */
static double txs_material_distance(const txs_material *a, const txs_material *b) {
    double most = 0;
    for (int k = 0; k < TXS_TRAITS; k++) {
        double sum = 0;
        for (int i = 0; i < TXS_TRAIT_BINS; i++) sum += fabs(a->trait[k][i] - b->trait[k][i]);
        if (sum / 2 > most) most = sum / 2;
    }
    return most;
}

/* ---- fields --------------------------------------------------------------------------- */

enum {
    TXS_PASSES = 3, /* of moving means: about a Gaussian                       */
    TXS_WIDER = 4   /* times as wide a blur is what brightness is compared with */
};

/* What displaces the border, in a cell of the picture. */
typedef struct txs_coats {
    const txs_pair_of_pictures *pair;
    uint64_t seed;
    int radius;                /* of the blur                                   */
    int left, top;             /* of the cell                                   */
    int side;                  /* of the cell with the rim that blurring needs  */
    double *plane, *wide;      /* side x side each                              */
    double *line;              /* side                                          */
    double *field[TXS_COATS];  /* TXS_KNIT_CELL x TXS_KNIT_CELL each                      */
    double square[TXS_COATS];  /* sums over the pixels that are near the border */
    double count;
} txs_coats;

/* One pass of a moving mean over count values that are step apart; at the ends the last value is
   repeated. */
static void txs_mean_line(double *v, ptrdiff_t step, int count, int radius, double *line) {
    double sum = 0;
    for (int i = 0; i < count; i++) line[i] = v[i * step];
    for (int i = -radius; i <= radius; i++) sum += line[txm_clampi(i, 0, count - 1)];
    for (int i = 0; i < count; i++) {
        v[i * step] = sum / (2 * radius + 1);
        sum += line[txm_clampi(i + radius + 1, 0, count - 1)] -
               line[txm_clampi(i - radius, 0, count - 1)];
    }
}

static void txs_coats_blur(const txs_coats *c, double *plane, int side, int radius) {
    for (int pass = 0; pass < TXS_PASSES; pass++) {
        for (int y = 0; y < side; y++)
            txs_mean_line(plane + (ptrdiff_t)y * side, 1, side, radius, c->line);
        for (int x = 0; x < side; x++) txs_mean_line(plane + x, side, side, radius, c->line);
    }
}

/* The radius of moving means whose passes blur with this standard deviation. */
static int txs_blur_radius(double deviation) {
    const double d = (double)txm_float(deviation); /* its square is exact */
    return txm_clampi((int)floor(sqrt(d * d + 0.25)), 1, 1 << 10);
}

static int txs_coats_rim(int radius) {
    return TXS_PASSES * (1 + TXS_WIDER) * radius;
}

/* Room for the fields of a cell; 0 if there is no memory. */
static int txs_coats_make(txs_coats *c, txm_arena *arena, const txs_pair_of_pictures *pair,
                          double grain, uint64_t seed) {
    memset(c, 0, sizeof *c);
    c->pair = pair;
    c->seed = seed;
    c->radius = txs_blur_radius(grain);
    c->side = TXS_KNIT_CELL + 2 * txs_coats_rim(c->radius);
    const size_t side = (size_t)c->side;
    c->plane = (double *)txm_arena_alloc(arena, side * side, sizeof(double));
    c->wide = (double *)txm_arena_alloc(arena, side * side, sizeof(double));
    c->line = (double *)txm_arena_alloc(arena, side, sizeof(double));
    for (int k = 0; k < TXS_COATS; k++)
        c->field[k] =
            (double *)txm_arena_alloc(arena, (size_t)TXS_KNIT_CELL * TXS_KNIT_CELL, sizeof(double));
    return !arena->failed;
}

/* White noise that belongs to the place. */
static double txs_coat_noise(uint64_t seed, int x, int y) {
    const uint64_t place = (uint64_t)(uint32_t)y << 32 | (uint32_t)x;
    return (double)(txm_hash(place ^ txm_hash(seed)) >> 40) / 16777216.0 - 0.5;
}

/* Brightness less that of the surroundings, of picture k. */
static void txs_coat_brightness(txs_coats *c, int k) {
    const int rim = txs_coats_rim(c->radius);
    const size_t size = (size_t)c->side * (size_t)c->side;
    for (int y = 0; y < c->side; y++)
        for (int x = 0; x < c->side; x++)
            c->plane[(size_t)y * (size_t)c->side + (size_t)x] =
                txs_pair_luma(c->pair, k, c->left + x - rim, c->top + y - rim);
    txs_coats_blur(c, c->plane, c->side, c->radius);
    memcpy(c->wide, c->plane, size * sizeof *c->wide);
    txs_coats_blur(c, c->wide, c->side, TXS_WIDER * c->radius);
    for (int y = 0; y < TXS_KNIT_CELL; y++) {
        for (int x = 0; x < TXS_KNIT_CELL; x++) {
            const size_t at = (size_t)(y + rim) * (size_t)c->side + (size_t)(x + rim);
            c->field[k][y * TXS_KNIT_CELL + x] = c->plane[at] - c->wide[at];
        }
    }
}

/* Noise, blurred, to field k. */
static void txs_coat_clouds(txs_coats *c, int k, int radius) {
    const int rim = TXS_PASSES * radius, side = TXS_KNIT_CELL + 2 * rim;
    for (int y = 0; y < side; y++)
        for (int x = 0; x < side; x++)
            c->plane[(size_t)y * (size_t)side + (size_t)x] =
                txs_coat_noise(c->seed + (uint64_t)k, c->left + x - rim, c->top + y - rim);
    txs_coats_blur(c, c->plane, side, radius);
    for (int y = 0; y < TXS_KNIT_CELL; y++)
        for (int x = 0; x < TXS_KNIT_CELL; x++)
            c->field[k][y * TXS_KNIT_CELL + x] =
                c->plane[(size_t)(y + rim) * (size_t)side + (size_t)(x + rim)];
}

/* All fields in the cell whose first pixel is left, top. */
static void txs_coats_lay(txs_coats *c, int left, int top) {
    c->left = left;
    c->top = top;
    txs_coat_brightness(c, 0);
    txs_coat_brightness(c, 1);
    txs_coat_clouds(c, 2, c->radius);
    txs_coat_clouds(c, 3, (c->radius + 1) / 2);
}

/* ---- displacing ----------------------------------------------------------------------- */

typedef struct txs_frayed { /* a border to be displaced */
    uint8_t *label;
    const uint16_t *distance; /* of the border as drawn */
    int width, height;
    int limit;  /* of the displacement, in fifths of a pixel */
    float rough; /* the usual displacement, pixels */
} txs_frayed;

/* The field that displaces the border, about of standard deviation 1: positive towards picture 0. */
static double txs_coats_at(const txs_coats *c, int at) {
    static const float weight[TXS_COATS] = {-0.5f, 0.5f, 0.65f, 0.3f};
    double sum = 0;
    for (int k = 0; k < TXS_COATS; k++) {
        const double deviation = c->count > 0 ? sqrt(c->square[k] / c->count) : 0;
        if (deviation > 1e-4) /* not of a picture that is flat */
            sum += (double)txm_float((double)weight[k] * c->field[k][at] / deviation);
    }
    return sum;
}

/* Add up the squares of the fields in this cell, or (is_last) displace the border in it. */
static void txs_fray_cell(const txs_frayed *f, txs_coats *c, int is_last) {
    for (int y = 0; y < TXS_KNIT_CELL && c->top + y < f->height; y++) {
        for (int x = 0; x < TXS_KNIT_CELL && c->left + x < f->width; x++) {
            const size_t i = (size_t)(c->top + y) * (size_t)f->width + (size_t)(c->left + x);
            const int at = y * TXS_KNIT_CELL + x, from = f->distance[i];
            if (from > f->limit) continue;
            if (is_last) {
                const double edge = from / (double)TXS_NEXT - 0.5;
                const double off = (double)txm_float(txs_coats_at(c, at) * (double)f->rough);
                f->label[i] = (f->label[i] ? edge : -edge) + off > 0;
                continue;
            }
            for (int k = 0; k < TXS_COATS; k++)
                c->square[k] += (double)txm_float(c->field[k][at] * c->field[k][at]);
            c->count++;
        }
    }
}

static int txs_fray_reaches(const txs_frayed *f, int left, int top) {
    for (int y = top; y < top + TXS_KNIT_CELL && y < f->height; y++)
        for (int x = left; x < left + TXS_KNIT_CELL && x < f->width; x++)
            if (f->distance[(size_t)y * (size_t)f->width + (size_t)x] <= f->limit) return 1;
    return 0;
}

/* Displace the border, cell by cell. Fraction 0..to of the whole. */
static txm_status txs_fray(const txs_frayed *f, txs_coats *c, txm_env *env, float to) {
    for (int pass = 0; pass < 2; pass++) {
        for (int top = 0; top < f->height; top += TXS_KNIT_CELL) {
            const float part = (float)(pass * f->height + top) / (2 * (float)f->height);
            if (txm_progress(env, to * part, "border"))
                return txm_fail(env, TXM_CANCELLED, "cancelled");
            for (int left = 0; left < f->width; left += TXS_KNIT_CELL) {
                if (!txs_fray_reaches(f, left, top)) continue;
                txs_coats_lay(c, left, top);
                txs_fray_cell(f, c, pass);
            }
        }
    }
    return TXM_OK;
}

#endif /* TEXSYN_BORDER_H */
