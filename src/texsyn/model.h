#ifndef TEXSYN_MODEL_H
#define TEXSYN_MODEL_H

#include "config.h"

/* ---- private types ---------------------------------------------------------------------- */

/* A clique type and its statistics. */
typedef struct txs_type {
    int kind, band, other;
    int dx, dy, ex, ey;
    int phase; /* tails counted: 0 all, 1 at even, 2 at odd coordinates; see txs_is_tail */
    int shape, scale; /* of a filter: index in txs_shapes, response with the last class */
    int32_t share[TXS_BINS];     /* the example's histogram, sum about TXS_ONE                  */
    int16_t potential[TXS_BINS]; /* where the synthesis starts, 1/TXS_NAT nat                   */
    int16_t root[TXS_BINS];      /* the two as a model file keeps them: square roots of the     */
    int16_t level[TXS_BINS];     /* shares, potentials in coarse steps                          */
} txs_type;

/* One pyramid level: how bands are quantised, v -> (v - low) / step + 1/2, and what is known. */
typedef struct txs_level {
    int values[TXS_MAX_BANDS];
    float low[TXS_MAX_BANDS], step[TXS_MAX_BANDS];
    uint8_t classes[TXS_MAX_BANDS][TXS_VALUES]; /* of values, by quantiles of the single pixels */
    int gradient_cut[2], curve_cut[2];          /* between the labels, see txs_fill_labels      */
    txs_type *types;                            /* the first ones are the singles of each band  */
    int type_count;
} txs_level;

/* a float with 15 bits of mantissa: what a model file keeps */
static float txs_short_float(float x) {
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    bits &= 0xffffff00u;
    memcpy(&x, &bits, sizeof x);
    return x;
}

enum { TXS_VERSION = 2, TXS_KINDS = TEXSYN_CONTEXT + 1 };

struct texsyn_model {
    txm_arena arena; /* holds the model itself and its types                                  */
    int channels, bands, levels;
    int version; /* of its file                                                               */
    float mean[TXS_MAX_BANDS];                 /* of the channels, 0..255                       */
    float basis[TXS_MAX_BANDS][TXS_MAX_BANDS]; /* band b = sum_c basis[b][c] (x[c] - mean[c])   */
    float dither[TXS_MAX_BANDS];               /* share of a step that the example's values fill */
    txs_level level[TXS_MAX_LEVELS];           /* 0 = full resolution                           */
};

/* Quantised planes with a margin that repeats the opposite border: first the bands, then the
   bands of the coarser level at this resolution ("parent"), which do not change, then the labels,
   which do not either. */
typedef struct txs_canvas {
    int width, height, margin;
    int slip_x, slip_y;      /* from here on odd and even swap, see txs_place; or the size */
    ptrdiff_t stride, plane; /* bytes to the next row, to the next plane */
    uint8_t *pixels;         /* the margin's first corner                */
} txs_canvas;

static int txs_mod(int a, int n) {
    a %= n;
    return a < 0 ? a + n : a;
}

static uint8_t *txs_at(const txs_canvas *c, int plane, int x, int y) {
    return c->pixels + plane * c->plane + (y + c->margin) * c->stride + (x + c->margin);
}

/* 0 if it does not fit the address space or there is no memory */
static int txs_canvas_make(txs_canvas *c, const txm_env *env, int width, int height, int margin,
                           int planes) {
    size_t plane, bytes;
    c->width = width;
    c->height = height;
    c->margin = margin;
    c->slip_x = width;
    c->slip_y = height;
    c->pixels = NULL;
    size_t stride = (size_t)width + 2 * (size_t)margin;
    if (!txm_mul(stride, (size_t)height + 2 * (size_t)margin, 1, &plane) ||
        !txm_mul(plane, (size_t)planes, 1, &bytes) || bytes > PTRDIFF_MAX)
        return 0;
    c->stride = (ptrdiff_t)stride;
    c->plane = (ptrdiff_t)plane;
    bytes += TXS_GRID; /* lanes reach so far beyond the last pixel */
    c->pixels = (uint8_t *)txm_alloc(env, bytes);
    if (c->pixels) memset(c->pixels, 0, bytes);
    return c->pixels != NULL;
}

static void txs_canvas_free(txs_canvas *c, const txm_env *env) {
    txm_free(env, c->pixels);
    c->pixels = NULL;
}

/* Fill the margin of a plane from the opposite sides. */
static void txs_wrap(const txs_canvas *c, int plane) {
    for (int y = 0; y < c->height; y++) {
        uint8_t *row = txs_at(c, plane, 0, y);
        for (int x = 1; x <= c->margin; x++) row[-x] = row[txs_mod(-x, c->width)];
        for (int x = 0; x < c->margin; x++) row[c->width + x] = row[txs_mod(x, c->width)];
    }
    for (int y = -c->margin; y < c->height + c->margin; y++) {
        if (y < 0 || y >= c->height)
            memcpy(txs_at(c, plane, -c->margin, y),
                   txs_at(c, plane, -c->margin, txs_mod(y, c->height)), (size_t)c->stride);
    }
}

/* Set a pixel and its copies in the margin. */
static void txs_set(const txs_canvas *c, int plane, int x, int y, uint8_t value) {
    *txs_at(c, plane, x, y) = value;
    if (x >= c->margin && x < c->width - c->margin && y >= c->margin && y < c->height - c->margin)
        return;
    int left = x - (x + c->margin) / c->width * c->width;
    int top = y - (y + c->margin) / c->height * c->height;
    for (int yy = top; yy < c->height + c->margin; yy += c->height)
        for (int xx = left; xx < c->width + c->margin; xx += c->width)
            *txs_at(c, plane, xx, yy) = value;
}

/* ---- clique types ----------------------------------------------------------------------- */

/* Filters: the pixels p + i e + j d, i < length, weighed by the profile's j-th entry. */
typedef struct txs_shape {
    int dx, dy, ex, ey, length, profile;
} txs_shape;

static const struct {
    int width, weight[6];
} txs_profiles[] = {{2, {-1, 1}}, {4, {-1, 1, 1, -1}}, {6, {-1, -1, -1, 1, 1, 1}}};

enum { TXS_SHAPES = 8 };

/* seven pixels against their parallels, bars, squares against their neighbours */
static const txs_shape txs_shapes[TXS_SHAPES] = {
    {0, 1, 1, 0, 7, 0}, {1, 0, 0, 1, 7, 0}, {1, -1, 1, 1, 7, 0}, {1, 1, -1, 1, 7, 0},
    {0, 1, 1, 0, 3, 1}, {1, 0, 0, 1, 3, 1}, {0, 1, 1, 0, 3, 2},  {1, 0, 0, 1, 3, 2}};

/* Where the pixels of a shape lie, and their weights, 1 or -1; returns how many. */
static int txs_shape_pixels(int shape, int at[TXS_MAX_MEMBERS][2], int weight[TXS_MAX_MEMBERS]) {
    const txs_shape *s = &txs_shapes[shape];
    int n = 0;
    for (int i = 0; i < s->length; i++) {
        for (int j = 0; j < txs_profiles[s->profile].width; j++, n++) {
            at[n][0] = i * s->ex + j * s->dx;
            at[n][1] = i * s->ey + j * s->dy;
            weight[n] = txs_profiles[s->profile].weight[j];
        }
    }
    return n;
}

/* Classes of all responses -TXS_MAX_RESPONSE..: 13 + sign(r) floor(13 (|r| / scale)^0.7 + 1/2), 0
   and 26 beyond the scale. The limits are |r| / scale in 1/4096. */
static void txs_response_classes(int scale, uint8_t class_of[2 * TXS_MAX_RESPONSE + 1]) {
    static const int limit[TXS_RESPONSES / 2] = {39,   187,  389,  628,  900,  1199, 1522,
                                                 1867, 2232, 2617, 3019, 3438, 3873};
    for (int r = 0, k = 0; r <= TXS_MAX_RESPONSE; r++) {
        while (k < TXS_RESPONSES / 2 && r * 4096 >= limit[k] * scale) k++;
        class_of[TXS_MAX_RESPONSE + r] = (uint8_t)(TXS_RESPONSES / 2 + k);
        class_of[TXS_MAX_RESPONSE - r] = (uint8_t)(TXS_RESPONSES / 2 - k);
    }
}

/* Where the members of a clique of the kinds up to TEXSYN_PARALLEL lie, seen from its tail; returns
   how many. */
static int txs_members(const txs_type *t, int at[4][2]) {
    const int s = t->kind == TEXSYN_PARALLEL ? 1 : -1;
    const int x[4] = {0, t->dx, t->ex, t->dx + s * t->ex};
    const int y[4] = {0, t->dy, t->ey, t->dy + s * t->ey};
    static const int counts[] = {1, 2, 1, 2, 3, 4, 4}; /* by texsyn_kind */
    for (int i = 0; i < counts[t->kind]; i++) {
        at[i][0] = x[i];
        at[i][1] = y[i];
    }
    return counts[t->kind];
}

/* The same of all kinds. A label is known where all pixels are that it looks at. */
static int txs_footprint(const txs_type *t, int at[TXS_MAX_MEMBERS][2]) {
    int weight[TXS_MAX_MEMBERS], n = 2;
    if (t->kind == TEXSYN_FILTER) return txs_shape_pixels(t->shape, at, weight);
    if (t->kind != TEXSYN_CONTEXT) return txs_members(t, at);
    at[0][0] = at[0][1] = 0;
    at[1][0] = t->dx;
    at[1][1] = t->dy;
    for (int y = -TXS_LABEL_REACH; y <= TXS_LABEL_REACH; y += TXS_LABEL_REACH) {
        for (int x = -TXS_LABEL_REACH; x <= TXS_LABEL_REACH; x += TXS_LABEL_REACH, n++) {
            at[n][0] = t->ex + x;
            at[n][1] = t->ey + y;
        }
    }
    return n;
}

/* May a pixel with these parities (x & 1, y & 1) be the tail? The neighbours (1, 0) and (0, 1) are
   two clique types each below the coarsest level: within a pixel of the coarser level, and across
   its border. In a photograph they have the same histogram; were they one type, a synthesised
   level would be smoother within than across, and show the grid of the one above. */
static int txs_is_tail(const txs_type *t, int px, int py) {
    return t->phase == 0 || ((t->dx & 1 ? px : py) & 1) == t->phase - 1;
}

/* the largest distance along an axis between two members */
static int txs_reach(const txs_type *t) {
    int at[TXS_MAX_MEMBERS][2], n = txs_footprint(t, at), reach = 0;
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < i; j++) {
            for (int k = 0; k < 2; k++) {
                int d = abs(at[i][k] - at[j][k]);
                if (d > reach) reach = d;
            }
        }
    }
    return reach;
}

static int txs_bin_count(int kind) {
    return kind == TEXSYN_SINGLE                          ? TXS_VALUES
           : kind == TEXSYN_PAIR || kind == TEXSYN_PARENT ? TXS_DIFFERENCES
           : kind == TEXSYN_FILTER                        ? TXS_RESPONSES
                                                          : TXS_BINS;
}

/* How to find the bin of a clique from its tail's address p (in plane 0):
     value       p[a]
     difference  p[a] - p[b] + 31
     values      ca[p[a]] * 9 + cb[p[b]]
     two         class(p[a] - p[b]) * 9 + class(p[c] - p[d])
     labelled    p[c] * 9 + class(p[a] - p[b])
   Filters are counted otherwise.                                                           */
typedef struct txs_tally {
    int form; /* 0 value, 1 difference, 2 values, 3 two, 4 labelled; -1 none */
    int type; /* index in the level */
    ptrdiff_t a, b, c, d;
    const uint8_t *ca, *cb;
} txs_tally;

static txs_tally txs_tally_make(const txs_type *t, const txs_level *level, const txs_canvas *c,
                                int bands) {
    const ptrdiff_t tail = t->band * c->plane, head = t->other * c->plane;
    const ptrdiff_t parent = (bands + t->other) * c->plane;
    const ptrdiff_t d = t->dy * c->stride + t->dx, e = t->ey * c->stride + t->ex;
    txs_tally y = {3, 0, tail + d, tail, 0, 0, NULL, NULL};
    switch (t->kind) {
    case TEXSYN_SINGLE:
        y.form = 0;
        y.a = tail;
        break;
    case TEXSYN_PAIR:
        y.form = 1;
        y.a = head + d;
        break;
    case TEXSYN_PARENT:
        y.form = 1;
        y.a = parent;
        break;
    case TEXSYN_VALUES:
        y.form = 2;
        y.a = tail;
        y.b = head + d;
        y.ca = level->classes[t->band];
        y.cb = level->classes[t->other];
        break;
    case TEXSYN_CORNER:
        y.c = tail + e;
        y.d = tail;
        break;
    case TEXSYN_SCALE:
        y.c = parent + e;
        y.d = parent + d - e;
        break;
    case TEXSYN_CONTEXT:
        y.form = 4;
        if (t->dx == 0 && t->dy == 0) y.a = parent;
        y.c = 2 * bands * c->plane + e;
        break;
    case TEXSYN_FILTER: y.form = -1; break;
    default: /* TEXSYN_PARALLEL */ y.c = head + d + e; y.d = head + e;
    }
    return y;
}

static int txs_class(int difference) {
    return txs_difference_class[difference + 31];
}

static int txs_bin(const txs_tally *y, const uint8_t *p) {
    switch (y->form) {
    case 0: return p[y->a];
    case 1: return p[y->a] - p[y->b] + 31;
    case 2: return y->ca[p[y->a]] * TXS_CLASSES + y->cb[p[y->b]];
    case 4: return p[y->c] * TXS_CLASSES + txs_class(p[y->a] - p[y->b]);
    default: return txs_class(p[y->a] - p[y->b]) * TXS_CLASSES + txs_class(p[y->c] - p[y->d]);
    }
}

/* Is it the band of alpha? */
static int txs_is_alpha(const texsyn_model *m, int band) {
    return m->channels == 4 && m->basis[band][3] != 0;
}

/* Classes of alpha's values: hidden, opaque, and evenly what lies between. */
static void txs_make_alpha_classes(txs_level *level, int band) {
    const int last = level->values[band] - 1, between = TXS_CLASSES - 2;
    for (int v = 0; v < TXS_VALUES; v++) {
        const int k = v == 0 ? 0 : v >= last ? between + 1 : 1 + (v - 1) * between / (last - 1);
        level->classes[band][v] = (uint8_t)k;
    }
}

/* Classes of a band's values: quantiles with narrow tails, so that rare values keep their say. Where
   alpha is the first band, quantiles would not tell its soft rims from what is opaque. */
static void txs_make_classes(const texsyn_model *m, txs_level *level, int band) {
    static const int cut[TXS_CLASSES - 1] = {655, 3277, 13107, 26214, 39322, 52429, 62259, 64881};
    const int32_t *share = level->types[band].share;
    int64_t below = 0;
    if (band == 0 && txs_is_alpha(m, band)) {
        txs_make_alpha_classes(level, band);
        return;
    }
    for (int v = 0; v < TXS_VALUES; v++) {
        int k = 0;
        while (k < TXS_CLASSES - 1 && below + share[v] / 2 > cut[k]) k++;
        level->classes[band][v] = (uint8_t)k;
        below += share[v];
    }
}

#endif /* TEXSYN_MODEL_H */
