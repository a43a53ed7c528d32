#ifndef TEXTILES_EXEMPLAR_H
#define TEXTILES_EXEMPLAR_H

#include "set.h"

/* ---- constants of the cutting ------------------------------------------------------------- */

enum {
    TXT_MAX_FEATURES = 8, /* bytes of a texel that are compared                                */
    TXT_MAX_SEGMENTS = 40, /* pieces of exemplar along an edge                                  */
    TXT_MISSING = 256,    /* difference to a texel beyond the exemplar, quarter gray levels    */
    TXT_LANES = 32,       /* places of a row that are compared side by side                    */
    TXT_CELL = 8,         /* texels a side of a cell in which use is counted                   */
    TXT_SURROUNDINGS = 4  /* texels: half width of the box whose brightness is a feature       */
};

/* macros, as C++20 deprecates arithmetic of enumerators with floating-point numbers */
#define TXT_SCALE 16          /* units of a search's cost per gray level                     */
#define TXT_SURROUND_GAIN 3   /* factor by which surroundings count more                     */

/* ---- sheets: the exemplars as texels ------------------------------------------------------- */

/* One exemplar as a grid of texels. For squares these are its pixels. For triangles it is resampled
   on a triangular lattice: texel k of row j lies at (k + (j odd) / 2, j sqrt(3) / 2); everywhere
   else lattice points have axial coordinates (i, j) with i = k - floor(j / 2), in which turning by
   60 degrees is (i, j) -> (-j, i + j), and shifts are sums. */
typedef struct txt_sheet {
    int width, height;
    int32_t first;                     /* number of its first texel                            */
    txm_image maps[TEXTILES_MAX_MAPS]; /* the caller's, or resampled                           */
} txt_sheet;

/* A piece of exemplar laid over a tile: texel (x, y) shows turned(x, y) + (i, j) of a sheet. */
typedef struct txt_layer {
    int sheet, turn; /* turn: sixths of a circle, 0 for squares     */
    int i, j;
    int is_frame;    /* belongs to an edge or a corner of the set   */
} txt_layer;

/* Traits whose means over the set should be those of the exemplars, in gray levels: the channels of
   the first map, the steps from texel to texel (half of 60 each), and the variance. */
enum { TXT_STEP = 4, TXT_VARIANCE = 6, TXT_TRAITS = 7 }; /* TXT_STEP + 1: the step down */

typedef struct txt_line {
    uint32_t *sum; /* of a value along a line of texels, sum[0] before the first one */
    double mean;   /* over all texels                                                */
} txt_line;

/* The strip of exemplar at an edge, the same in all tiles with its colour. Coordinates: a along the
   joint from the start vertex, u across it. Squares: u < 0 is above or left of the joint;
   triangles: u = 0 lies on it. */
typedef struct txt_seam_strip {
    int axis; /* 0: runs to the right, 1: down */
    int count;
    struct {
        int sheet, i, j; /* texel of the sheet at a = 0, u = 0 */
    } segment[TXT_MAX_SEGMENTS];
    int corner[2];  /* of start and end                                                      */
    uint8_t *which; /* by a, u: 0 the start's corner, 1..count a segment, count + 1 the end's */
} txt_seam_strip;

/* A place of the exemplars where a piece may come from. */
typedef struct txt_place {
    int sheet, turn, i, j;
    uint32_t cost; /* mean difference of a sample and the extra cost, TXT_SCALE per gray level */
} txt_place;

typedef struct txt_build {
    textiles_set *set;
    const textiles_desc *desc;
    txm_env *env;
    txm_arena arena;
    int is_triangle;
    int features, stride; /* compared bytes of a texel; bytes from one to the next: 4 or 8   */
    int feature_map[TXT_MAX_FEATURES], feature_channel[TXT_MAX_FEATURES];
    txt_sheet sheets[TEXTILES_MAX_EXEMPLARS];
    int sheet_count;
    size_t texels;
    uint8_t *texel;         /* texels * stride: what is compared                              */
    uint8_t *plane;         /* features * texels: the same, blurred a little, for searches    */
    txt_line cross[2];      /* by axis: differences across a joint there                      */
    txt_line along[2];      /* differences along a line                                       */
    txt_line salience[2];   /* how conspicuous a place is, along both axes                    */
    txt_line color[2][4];   /* the first map's channels                                       */
    uint8_t *salient;       /* the same of a texel, see txt_fill_salience                     */
    uint16_t *line_cost[2]; /* by axis: the cost of a joint of line_length texels from there  */
    int line_length[2];
    double line_step[2];    /* the mean step that it should have                              */
    uint32_t *use[TEXTILES_MAX_EXEMPLARS];  /* by cell: how much of it interiors show          */
    uint32_t *used[TEXTILES_MAX_EXEMPLARS]; /* sums over all cells above and to the left       */
    double *traits[TEXTILES_MAX_EXEMPLARS]; /* the same of TXT_TRAITS traits                   */
    double usual[TXT_TRAITS];               /* their means over the exemplars                  */
    double surplus[TXT_TRAITS];             /* sum over the tiles so far of what exceeds these  */
    struct {
        int sheet, i, j;
    } corner[TEXTILES_MAX_COLORS];
    int corner_count;
    txt_seam_strip *strips;
    int strip_count;
    txt_place *inside; /* by tile: where its interior comes from; sheet -1: not made yet */
    int lock_from, lock_count; /* u of a strip's first line, how many                         */
    double step_mean;          /* from texel to texel, both axes                               */
    double wanted_step;        /* of joints, in units of the mean step of the exemplars       */
    int corners_are_final;     /* edges then compensate for the corners                        */
} txt_build;

static const int txt_turns[6][4] = {{1, 0, 0, 1},   {0, -1, 1, 1}, {-1, -1, 1, 0},
                                    {-1, 0, 0, -1}, {0, 1, -1, -1}, {1, 1, -1, 0}};

static void txt_turn(int turn, int x, int y, int *i, int *j) {
    const int *m = txt_turns[turn];
    *i = m[0] * x + m[1] * y;
    *j = m[2] * x + m[3] * y;
}

/* floor(j / 2), also below zero */
static int txt_half(int j) {
    return (j - (j & 1)) / 2;
}

/* number of the texel at (i, j) of a sheet; -1 beyond its borders */
static int32_t txt_number(const txt_build *b, int sheet, int i, int j) {
    const txt_sheet *s = &b->sheets[sheet];
    const int k = b->is_triangle ? i + txt_half(j) : i;
    if (k < 0 || k >= s->width || j < 0 || j >= s->height) return -1;
    return s->first + j * s->width + k;
}

/* number of the texel that a layer shows at (x, y) of a tile; -1: none */
static int32_t txt_shown(const txt_build *b, const txt_layer *l, int x, int y) {
    int i, j;
    txt_turn(l->turn, x, y, &i, &j);
    return txt_number(b, l->sheet, i + l->i, j + l->j);
}

/* difference of two texels in quarters of a gray level, 0..1020, the mean over all features */
static int txt_difference(const txt_build *b, int32_t s, int32_t t) {
    int sum = 0;
    if (s == t) return 0;
    if (s < 0 || t < 0) return TXT_MISSING;
    const uint8_t *p = b->texel + (size_t)s * (size_t)b->stride;
    const uint8_t *q = b->texel + (size_t)t * (size_t)b->stride;
    for (int c = 0; c < 4; c++) sum += p[c] > q[c] ? p[c] - q[c] : q[c] - p[c];
    for (int c = 4; c < b->stride; c++) sum += p[c] > q[c] ? p[c] - q[c] : q[c] - p[c];
    return 4 * sum / b->features;
}

/* Cubic convolution over six points, of fourth order [10]: nearly as sharp as the exemplar. */
static double txt_keys(double x) {
    x = fabs(x);
    if (x < 1) return (4.0 / 3 * x - 7.0 / 3) * x * x + 1;
    if (x < 2) return ((-7.0 / 12 * x + 3) * x - 59.0 / 12) * x + 2.5;
    if (x < 3) return ((1.0 / 12 * x - 2.0 / 3) * x + 1.75) * x - 1.5;
    return 0;
}

/* Is a pixel of an image with alpha not fully opaque? */
static int txt_is_translucent(const txm_image *im) {
    for (int y = 0; y < im->height; y++) {
        for (int x = 0; x < im->width; x++) {
            if (txm_image_get(im, x, y, im->channels - 1) < 1) return 1;
        }
    }
    return 0;
}

/* One row of a lattice sheet: interpolate six rows of the picture, then along the row. by_alpha:
   colours are weighted by alpha; where so little shows that the weights below 0 count, they are
   those of the nearest pixel. */
static void txt_resample_row(const txm_image *in, const txm_image *out, int row, int by_alpha,
                             double *line) {
    const double y = row * 0.86602540378443864676;
    const int top = (int)floor(y), n = in->channels;
    double weight[6], half[6];
    for (int k = 0; k < 6; k++) {
        weight[k] = txt_keys(y - (top - 2 + k));
        half[k] = txt_keys(0.5 - (k - 2));
    }
    for (int x = 0; x < in->width; x++) {
        for (int c = 0; c < n; c++) {
            double sum = 0;
            for (int k = 0; k < 6; k++) {
                const int v = txm_clampi(top - 2 + k, 0, in->height - 1);
                double value = txm_image_get(in, x, v, c);
                if (by_alpha && c + 1 < n)
                    value *= (double)txm_clampf(txm_image_get(in, x, v, n - 1), 0, 1);
                sum += weight[k] * value;
            }
            line[x * n + c] = sum;
        }
    }
    const int nearest = txm_clampi((int)floor(y + 0.5), 0, in->height - 1);
    for (int x = 0; x < out->width; x++) {
        double shown = 1;
        for (int c = n - 1; c >= 0; c--) { /* alpha first */
            double value = line[x * n + c];
            if (row & 1) {
                value = 0;
                for (int k = 0; k < 6; k++)
                    value += half[k] * line[txm_clampi(x - 2 + k, 0, in->width - 1) * n + c];
            }
            if (by_alpha && c == n - 1) shown = value;
            else if (by_alpha && shown > 0.25) value /= shown;
            else if (by_alpha) value = txm_image_get(in, x, nearest, c);
            txm_image_set(out, x, row, c, txm_float(value));
        }
    }
}

/* Turn the exemplars into sheets. */
static txm_status txt_make_sheets(txt_build *b) {
    const textiles_desc *d = b->desc;
    b->sheet_count = d->exemplar_count;
    for (int e = 0; e < d->exemplar_count; e++) {
        txt_sheet *s = &b->sheets[e];
        const txm_image *first = &d->exemplars[e].maps[0];
        s->width = first->width;
        s->height = first->height;
        if (b->is_triangle) {
            s->width = first->width - 1;
            s->height = (int)((first->height - 1) / 0.86602540378443864676) + 1;
        }
        s->first = (int32_t)b->texels;
        b->texels += (size_t)s->width * (size_t)s->height;
        if (b->texels > TEXTILES_MAX_PIXELS)
            return txm_fail(b->env, TXM_TOO_LARGE, "exemplars: more than TEXTILES_MAX_PIXELS");
        for (int m = 0; m < b->set->map_count; m++) {
            txm_image in = txm_image_resolve(d->exemplars[e].maps[m]);
            const int has_alpha = b->set->maps[m].has_alpha;
            const txm_status status =
                has_alpha ? txm_image_bled(&in, 0, &b->arena, b->env, &in) : TXM_OK;
            if (status != TXM_OK) return status;
            s->maps[m] = in;
            if (!b->is_triangle) continue;
            const int by_alpha = has_alpha && txt_is_translucent(&in);
            txm_image *out = &s->maps[m];
            out->width = s->width;
            out->height = s->height;
            out->stride = (ptrdiff_t)((size_t)s->width * b->set->maps[m].texel);
            out->pixels = txm_arena_alloc(
                &b->arena, (size_t)s->width * (size_t)s->height, b->set->maps[m].texel);
            double *line = (double *)txm_alloc(b->env, (size_t)in.width * 4 * sizeof(double));
            if (!out->pixels || !line) {
                txm_free(b->env, line);
                return txm_fail(b->env, TXM_OUT_OF_MEMORY, "no memory for the exemplars");
            }
            for (int y = 0; y < s->height; y++) txt_resample_row(&in, out, y, by_alpha, line);
            txm_free(b->env, line);
        }
        b->set->sheets[e].first = s->first;
        b->set->sheets[e].width = s->width;
        b->set->sheets[e].height = s->height;
    }
    b->set->exemplar_count = d->exemplar_count;
    return TXM_OK;
}

/* What is compared: all channels of the first map, then those of the others at half weight as long
   as there is room. Colours count as much as they are opaque. Floats are scaled to their range. */
static void txt_list_features(txt_build *b) {
    for (int m = 0; m < b->set->map_count; m++) {
        const int n = b->set->maps[m].channels;
        if (m && b->features + n > TXT_MAX_FEATURES) continue;
        for (int c = 0; c < n; c++) {
            TXM_ASSERT(b->features < TXT_MAX_FEATURES);
            b->feature_map[b->features] = m;
            b->feature_channel[b->features++] = c;
        }
    }
    if (b->features < TXT_MAX_FEATURES) b->feature_map[b->features++] = -1; /* surroundings */
    b->stride = b->features <= 4 ? 4 : 8;
}

/* The last feature: the brightness of the surroundings, which depends on where in an element (a
   stone, a leaf) a texel lies. So cuts and searches do not join parts of different elements just
   because they have the same colour. */
static txm_status txt_fill_surroundings(txt_build *b, int f) {
    for (int e = 0; e < b->sheet_count; e++) {
        const txt_sheet *s = &b->sheets[e];
        const int n = s->width * s->height, r = TXT_SURROUNDINGS;
        int32_t *gray = (int32_t *)txm_alloc(b->env, (size_t)n * 2 * sizeof(int32_t));
        if (!gray) return txm_fail(b->env, TXM_OUT_OF_MEMORY, "no memory for the exemplars");
        int32_t *row = gray + n;
        const int colors = b->set->maps[0].channels < 3 ? 1 : 3;
        double mean = 0;
        for (int t = 0; t < n; t++) {
            const uint8_t *p = b->texel + ((size_t)s->first + (size_t)t) * (size_t)b->stride;
            gray[t] = 0;
            for (int c = 0; c < colors; c++) gray[t] += p[c];
            gray[t] = gray[t] * 16 / colors;
            mean += gray[t];
        }
        mean /= n;
        for (int pass = 0; pass < 2; pass++) { /* two boxes make a tent */
            for (int y = 0; y < s->height; y++) {
                for (int x = 0; x < s->width; x++) {
                    int32_t sum = 0;
                    for (int k = -r; k <= r; k++)
                        sum += gray[y * s->width + txm_clampi(x + k, 0, s->width - 1)];
                    row[y * s->width + x] = sum / (2 * r + 1);
                }
            }
            for (int y = 0; y < s->height; y++) {
                for (int x = 0; x < s->width; x++) {
                    int32_t sum = 0;
                    for (int k = -r; k <= r; k++)
                        sum += row[txm_clampi(y + k, 0, s->height - 1) * s->width + x];
                    gray[y * s->width + x] = sum / (2 * r + 1);
                }
            }
        }
        for (int t = 0; t < n; t++)
            b->texel[((size_t)s->first + (size_t)t) * (size_t)b->stride + (size_t)f] =
                (uint8_t)txm_clampi((int)(128 + (gray[t] - mean) * TXT_SURROUND_GAIN / 16), 0, 255);
        txm_free(b->env, gray);
    }
    return TXM_OK;
}

static txm_status txt_fill_features(txt_build *b) {
    for (int f = 0; f < b->features; f++) {
        const int m = b->feature_map[f], c = b->feature_channel[f];
        if (m < 0) return txt_fill_surroundings(b, f);
        const int n = b->set->maps[m].channels;
        double low = 0, high = 1;
        if (b->set->maps[m].sample == TXM_F32) {
            low = DBL_MAX;
            high = -DBL_MAX;
            for (int e = 0; e < b->sheet_count; e++) {
                const txm_image *im = &b->sheets[e].maps[m];
                for (int y = 0; y < im->height; y++) {
                    for (int x = 0; x < im->width; x++) {
                        const double v = txm_image_get(im, x, y, c);
                        low = fmin(low, v);
                        high = fmax(high, v);
                    }
                }
            }
        }
        const double scale = (m ? 127.5 : 255.0) / (high > low ? high - low : 1);
        for (int e = 0; e < b->sheet_count; e++) {
            const txm_image *im = &b->sheets[e].maps[m];
            uint8_t *to = b->texel + (size_t)b->sheets[e].first * (size_t)b->stride + f;
            for (int y = 0; y < im->height; y++) {
                for (int x = 0; x < im->width; x++, to += b->stride) {
                    double v = (txm_image_get(im, x, y, c) - low) * scale;
                    if (b->set->maps[m].has_alpha && c + 1 < n)
                        v *= txm_clampf(txm_image_get(im, x, y, n - 1), 0, 1);
                    *to = (uint8_t)txm_clampi((int)(v + 0.5), 0, 255);
                }
            }
        }
    }
    return TXM_OK;
}

/* Planes of the features, each texel averaged with its neighbours: searches compare only a part of
   the texels, and noise in single ones must not decide. */
static void txt_fill_planes(txt_build *b) {
    for (int e = 0; e < b->sheet_count; e++) {
        const txt_sheet *s = &b->sheets[e];
        for (int y = 0; y < s->height; y++) {
            for (int x = 0; x < s->width; x++) {
                int sum[TXT_MAX_FEATURES] = {0}, n = 0;
                for (int dy = -1; dy <= 1; dy++) {
                    for (int dx = -1; dx <= 1; dx++) {
                        if (x + dx < 0 || x + dx >= s->width || y + dy < 0 || y + dy >= s->height)
                            continue;
                        const uint8_t *p = b->texel + (size_t)(s->first + (y + dy) * s->width +
                                                               x + dx) * (size_t)b->stride;
                        for (int f = 0; f < b->features; f++) sum[f] += p[f];
                        n++;
                    }
                }
                const size_t t = (size_t)(s->first + y * s->width + x);
                for (int f = 0; f < b->features; f++)
                    b->plane[(size_t)f * b->texels + t] = (uint8_t)((sum[f] + n / 2) / n);
            }
        }
    }
}

/* Sums of a value along the lines of an axis: value(b, which, sheet, x, y) at (x, y) as stored. */
static void txt_sum_lines(txt_build *b, txt_line *line, int axis, int which,
                          int (*value)(const txt_build *b, int which, int sheet, int x, int y)) {
    double total = 0, count = 0;
    for (int e = 0; e < b->sheet_count; e++) {
        const txt_sheet *s = &b->sheets[e];
        const int lines = axis ? s->width : s->height, length = axis ? s->height : s->width;
        for (int l = 0; l < lines; l++) {
            uint32_t sum = 0;
            for (int k = 0; k < length; k++) {
                const int x = axis ? l : k, y = axis ? k : l;
                const int v = value(b, which, e, x, y);
                if (v >= 0) {
                    total += v;
                    count += 1;
                    sum += (uint32_t)v;
                }
                line->sum[s->first + y * s->width + x] = sum;
            }
        }
    }
    line->mean = count > 0 ? total / count : 0;
}

/* Mean of a line's value over n texels from storage place (x, y) on, in units of the mean over all;
   what lies beyond the sheet is left out. */
static double txt_line_mean(const txt_build *b, const txt_line *line, int axis, int sheet, int x,
                            int y, int n) {
    const txt_sheet *s = &b->sheets[sheet];
    int from = (axis ? y : x) - 1, to = from + n;
    const int length = axis ? s->height : s->width, other = axis ? x : y;
    if (from < 0) from = 0;
    if (to >= length) to = length - 1;
    if (to <= from || other < 0 || other >= (axis ? s->width : s->height) || line->mean <= 0)
        return 1;
    const size_t first = (size_t)s->first;
    const size_t p = axis ? (size_t)from * (size_t)s->width + (size_t)other
                          : (size_t)other * (size_t)s->width + (size_t)from;
    const size_t q = axis ? (size_t)to * (size_t)s->width + (size_t)other
                          : (size_t)other * (size_t)s->width + (size_t)to;
    return (double)(line->sum[first + q] - line->sum[first + p]) / (to - from) / line->mean;
}

/* The difference of two texels as textiles_measure has it: the channels of the first map only. */
static int txt_step(const txt_build *b, int32_t s, int32_t t) {
    const uint8_t *p = b->texel + (size_t)s * (size_t)b->stride;
    const uint8_t *q = b->texel + (size_t)t * (size_t)b->stride;
    int sum = 0;
    for (int c = 0; c < b->set->maps[0].channels; c++) sum += abs(p[c] - q[c]);
    return 4 * sum;
}

/* Step across a joint that runs along the axis: for squares of the two pixels on either side,
   for triangles of an edge texel and the four beside it. First map only; -1 at the border. */
static int txt_cross_value(const txt_build *b, int axis, int sheet, int x, int y) {
    const txt_sheet *s = &b->sheets[sheet];
    const int32_t t = s->first + y * s->width + x;
    if (!b->is_triangle) {
        if (axis ? x == 0 : y == 0) return -1;
        return txt_step(b, t, t - (axis ? 1 : s->width));
    }
    const int odd = y & 1, left = x - 1 + odd;
    if (y == 0 || y + 1 >= s->height || left < 0 || left + 1 >= s->width) return -1;
    int sum = 0;
    for (int k = 0; k < 2; k++) {
        sum += txt_step(b, t, s->first + (y - 1) * s->width + left + k);
        sum += txt_step(b, t, s->first + (y + 1) * s->width + left + k);
    }
    return sum / 4;
}

/* Step along a line of the axis; -1 at its start. */
static int txt_along_value(const txt_build *b, int axis, int sheet, int x, int y) {
    const txt_sheet *s = &b->sheets[sheet];
    const int32_t t = s->first + y * s->width + x;
    if (axis ? y == 0 : x == 0) return -1;
    return txt_step(b, t, t - (axis ? s->width : 1));
}

static int txt_color_value(const txt_build *b, int channel, int sheet, int x, int y) {
    const txt_sheet *s = &b->sheets[sheet];
    return b->texel[(size_t)(s->first + y * s->width + x) * (size_t)b->stride + (size_t)channel];
}

/* salience as far as it exceeds 28, where 16 is the mean */
static int txt_salience_value(const txt_build *b, int axis, int sheet, int x, int y) {
    (void)axis;
    const txt_sheet *s = &b->sheets[sheet];
    const int v = b->salient[s->first + y * s->width + x];
    return v > 28 ? v - 28 : 0;
}

/* Salience: the squared deviation from the mean colour in units of the variance, mean 16, averaged
   over a neighbourhood. Rare elements far from the mean, a white stone for example, are conspicuous
   where they repeat. */
static txm_status txt_fill_salience(txt_build *b) {
    double mean[TXT_MAX_FEATURES] = {0}, variance[TXT_MAX_FEATURES] = {0};
    for (size_t t = 0; t < b->texels; t++) {
        for (int f = 0; f < b->features; f++) {
            const double v = b->texel[t * (size_t)b->stride + (size_t)f];
            mean[f] += v;
            variance[f] += v * v;
        }
    }
    double total = 0;
    for (int f = 0; f < b->features; f++) {
        mean[f] /= (double)b->texels;
        total += variance[f] / (double)b->texels - mean[f] * mean[f];
    }
    if (total < 1) total = 1;
    enum { REACH = 3 };
    for (int e = 0; e < b->sheet_count; e++) {
        const txt_sheet *s = &b->sheets[e];
        const size_t n = (size_t)s->width * (size_t)s->height;
        float *row = (float *)txm_alloc(b->env, 2 * n * sizeof(float));
        if (!row) return txm_fail(b->env, TXM_OUT_OF_MEMORY, "no memory for the exemplars");
        float *raw = row + n;
        for (size_t t = 0; t < n; t++) {
            double z = 0;
            const uint8_t *p = b->texel + ((size_t)s->first + t) * (size_t)b->stride;
            for (int f = 0; f < b->features; f++) z += (p[f] - mean[f]) * (p[f] - mean[f]);
            raw[t] = txm_float(fmin(16 * z / total, 160));
        }
        for (int y = 0; y < s->height; y++) {
            for (int x = 0; x < s->width; x++) {
                double sum = 0;
                for (int k = -REACH; k <= REACH; k++)
                    sum += raw[y * s->width + txm_clampi(x + k, 0, s->width - 1)];
                row[y * s->width + x] = txm_float(sum);
            }
        }
        for (int y = 0; y < s->height; y++) {
            for (int x = 0; x < s->width; x++) {
                double sum = 0;
                for (int k = -REACH; k <= REACH; k++)
                    sum += row[txm_clampi(y + k, 0, s->height - 1) * s->width + x];
                sum /= (2 * REACH + 1) * (2 * REACH + 1);
                b->salient[s->first + y * s->width + x] = (uint8_t)txm_clampi((int)sum, 0, 255);
            }
        }
        txm_free(b->env, row);
    }
    return TXM_OK;
}

/* Traits of one texel; 0 for steps at the border and for channels that the map does not have. */
static void txt_texel_traits(const txt_build *b, int32_t t, double traits[TXT_TRAITS]) {
    const int e = txt_sheet_of(b->set, t);
    const txt_sheet *s = &b->sheets[e];
    const int at = t - s->first, x = at % s->width, y = at / s->width;
    for (int k = 0; k < TXT_TRAITS; k++) traits[k] = 0;
    for (int c = 0; c < b->set->maps[0].channels; c++) traits[c] = txt_color_value(b, c, e, x, y);
    const double scale = 60 / (b->step_mean > 0 ? b->step_mean : 1);
    if (x) traits[TXT_STEP] = scale * txt_step(b, t, t - 1);
    if (y) traits[TXT_STEP + 1] = scale * txt_step(b, t, t - s->width);
    traits[TXT_VARIANCE] = b->salient[t] * (20 / 16.0);
}

/* Sums of the traits over cells above and to the left, and their means. */
static void txt_fill_traits(txt_build *b) {
    double sum = 0;
    for (int e = 0; e < b->sheet_count; e++) {
        const txt_sheet *s = &b->sheets[e];
        for (int y = 1; y < s->height; y++) {
            for (int x = 1; x < s->width; x++) {
                const int32_t t = s->first + y * s->width + x;
                sum += txt_step(b, t, t - 1) + txt_step(b, t, t - s->width);
            }
        }
    }
    b->step_mean = sum / (double)b->texels;
    for (int e = 0; e < b->sheet_count; e++) {
        const txt_sheet *s = &b->sheets[e];
        const int across = s->width / TXT_CELL + 2, down = s->height / TXT_CELL + 2;
        for (int y = 0; y < s->height; y++) {
            for (int x = 0; x < s->width; x++) {
                double one[TXT_TRAITS];
                double *cell =
                    b->traits[e] + ((y / TXT_CELL + 1) * across + x / TXT_CELL + 1) * TXT_TRAITS;
                txt_texel_traits(b, s->first + y * s->width + x, one);
                for (int k = 0; k < TXT_TRAITS; k++) {
                    cell[k] += one[k] / (TXT_CELL * TXT_CELL);
                    b->usual[k] += one[k] / (double)b->texels;
                }
            }
        }
        for (int y = 1; y < down; y++) {
            double row[TXT_TRAITS] = {0};
            for (int x = 1; x < across; x++) {
                double *cell = b->traits[e] + (y * across + x) * TXT_TRAITS;
                for (int k = 0; k < TXT_TRAITS; k++) {
                    row[k] += cell[k];
                    cell[k] = cell[k - across * TXT_TRAITS] + row[k];
                }
            }
        }
    }
}

/* Everything that is computed once from the exemplars. */
static txm_status txt_prepare(txt_build *b) {
    txt_list_features(b);
    txm_status status = txt_make_sheets(b);
    if (status != TXM_OK) return status;
    b->texel = (uint8_t *)txm_arena_zero(&b->arena, b->texels, (size_t)b->stride);
    b->plane = (uint8_t *)txm_arena_zero(&b->arena, b->texels * (size_t)b->features + TXT_LANES, 1);
    b->salient = (uint8_t *)txm_arena_alloc(&b->arena, b->texels, 1);
    const int axes = b->is_triangle ? 1 : 2;
    for (int a = 0; a < axes; a++) {
        b->cross[a].sum = (uint32_t *)txm_arena_alloc(&b->arena, b->texels, sizeof(uint32_t));
        b->salience[a].sum = (uint32_t *)txm_arena_alloc(&b->arena, b->texels, sizeof(uint32_t));
        b->line_cost[a] = (uint16_t *)txm_arena_alloc(&b->arena, b->texels, sizeof(uint16_t));
        b->along[a].sum = (uint32_t *)txm_arena_alloc(&b->arena, b->texels, sizeof(uint32_t));
        for (int c = 0; c < b->set->maps[0].channels; c++)
            b->color[a][c].sum =
                (uint32_t *)txm_arena_alloc(&b->arena, b->texels, sizeof(uint32_t));
    }
    for (int e = 0; e < b->sheet_count; e++) {
        const txt_sheet *s = &b->sheets[e];
        const size_t cells = ((size_t)s->width / TXT_CELL + 2) * ((size_t)s->height / TXT_CELL + 2);
        b->use[e] = (uint32_t *)txm_arena_zero(&b->arena, cells, sizeof(uint32_t));
        b->used[e] = (uint32_t *)txm_arena_zero(&b->arena, cells, sizeof(uint32_t));
        b->traits[e] = (double *)txm_arena_zero(&b->arena, cells, TXT_TRAITS * sizeof(double));
    }
    if (b->arena.failed) return txm_fail(b->env, TXM_OUT_OF_MEMORY, "no memory for the exemplars");
    status = txt_fill_features(b);
    if (status != TXM_OK) return status;
    txt_fill_planes(b);
    status = txt_fill_salience(b);
    if (status != TXM_OK) return status;
    txt_fill_traits(b);
    for (int a = 0; a < axes; a++) {
        txt_sum_lines(b, &b->cross[a], a, a, txt_cross_value);
        txt_sum_lines(b, &b->along[a], a, a, txt_along_value);
        txt_sum_lines(b, &b->salience[a], a, a, txt_salience_value);
        for (int c = 0; c < b->set->maps[0].channels; c++)
            txt_sum_lines(b, &b->color[a][c], a, c, txt_color_value);
    }
    return TXM_OK;
}

#endif /* TEXTILES_EXEMPLAR_H */
