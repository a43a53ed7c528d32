#ifndef TEXSYN_LAYOUT_H
#define TEXSYN_LAYOUT_H

#include "ground.h"
#include "potential.h"

/* ---- label maps as textures ---------------------------------------------------------------

   A label map is a texture whose values have no order, so its clique types are joint histograms of
   labels, not histograms of differences [1, section 4]:

     FIELD    band of the picture x label: what lies above stays above. One band = the shares alone.
     PAIR     label at p + d x label at p. Head and tail differ, so order is kept (Fig. 13).
     PARENT   label of the coarser level x label at p; d = (1, 0) is the coarse pixel beside p's own
              on the side that p is nearer to.
     RING     how many of the 8 pixels at a distance carry the label of p, x label: pairs fix how
              long borders are, rings how they bend, and whether there are specks.

   A histogram has a row for each value of the first and a column for each label of p.            */
enum {
    TXS_OUTSIDE = TXS_MAX_LABELS, /* label of what is unknown or outside     */
    TXS_BANDS_OF_FIELD = 16,      /* along the side of the picture           */
    TXS_LAY_AROUND = 8,           /* pixels of a ring                        */
    TXS_LAY_BINS =
        TXS_MAX_LABELS * TXS_MAX_LABELS,    /* of a histogram; rows of TXS_MAX_LABELS bins */
    TXS_LAY_ROWS = (int)TXS_MAX_LABELS + 1, /* of a table: TXS_OUTSIDE has no energy   */
    TXS_LAY_TYPES = 48,                     /* clique types of one level               */
    TXS_LAY_LEVELS = 6,
    TXS_LAY_TOP = 48,                        /* pixels: short side of the coarsest level */
    TXS_LAY_REACH = 20,                      /* pixels: longest pair on the coarsest level */
    TXS_LAY_NEAR = 5,                        /* the same on the others                  */
    TXS_LAY_MARGIN = 2 * (int)TXS_LAY_REACH, /* of a plane                              */
    TXS_LAY_RINGS = 3                        /* of distances 1, 2, 4                    */
};

enum { TXS_LAY_ROWS_FIELD = 1, TXS_LAY_COLUMNS = 2 }; /* along which a field changes */

enum { TXS_LAY_FIELD, TXS_LAY_PAIR, TXS_LAY_PARENT, TXS_LAY_RING };

typedef struct txs_lay_type {
    int kind, dx, dy; /* of a ring, dx is the distance */
    int32_t share[TXS_LAY_BINS];
    int16_t root[TXS_LAY_BINS]; /* as a file keeps it, see txs_lay_round */
} txs_lay_type;

typedef struct txs_lay_level {
    txs_lay_type *types; /* the first is the field */
    int type_count;
} txs_lay_level;

typedef struct txs_layout {
    int labels, levels;
    int field;                           /* 0 none, 1 bands are rows, 2 columns           */
    int width, height;                   /* of the example                                */
    txs_lay_level level[TXS_LAY_LEVELS]; /* 0 = full resolution                           */
} txs_layout;

/* A plane of labels with a margin: opposite sides repeated where an axis wraps, else outside. */
typedef struct txs_lay_plane {
    int width, height, wrap_x, wrap_y;
    ptrdiff_t stride;
    uint8_t *pixels; /* the margin's first corner */
} txs_lay_plane;

static uint8_t *txs_lay_at(const txs_lay_plane *p, int x, int y) {
    return p->pixels + (y + TXS_LAY_MARGIN) * p->stride + (x + TXS_LAY_MARGIN);
}

static size_t txs_lay_bytes(const txs_lay_plane *p) {
    return (size_t)p->stride * ((size_t)p->height + 2 * TXS_LAY_MARGIN);
}

/* All outside. 0 without memory. */
static int txs_lay_plane_make(txs_lay_plane *p, const txm_env *env, int width, int height,
                              int wrap_x, int wrap_y) {
    const size_t stride = (size_t)width + 2 * TXS_LAY_MARGIN;
    size_t bytes;
    p->width = width;
    p->height = height;
    p->wrap_x = wrap_x;
    p->wrap_y = wrap_y;
    p->stride = (ptrdiff_t)stride;
    p->pixels = NULL;
    if (!txm_mul(stride, (size_t)height + 2 * TXS_LAY_MARGIN, 1, &bytes)) return 0;
    p->pixels = (uint8_t *)txm_alloc(env, bytes);
    if (p->pixels) memset(p->pixels, TXS_OUTSIDE, bytes);
    return p->pixels != NULL;
}

static void txs_lay_plane_free(txs_lay_plane *p, const txm_env *env) {
    txm_free(env, p->pixels);
    p->pixels = NULL;
}

/* Set a pixel and its copies in the margin. */
static void txs_lay_set(const txs_lay_plane *p, int x, int y, uint8_t label) {
    const int m = TXS_LAY_MARGIN;
    *txs_lay_at(p, x, y) = label;
    if (x >= m && x < p->width - m && y >= m && y < p->height - m) return;
    const int left = p->wrap_x ? x - (x + m) / p->width * p->width : x;
    const int top = p->wrap_y ? y - (y + m) / p->height * p->height : y;
    const int right = p->wrap_x ? p->width + m : x + 1, bottom = p->wrap_y ? p->height + m : y + 1;
    for (int yy = top; yy < bottom; yy += p->height)
        for (int xx = left; xx < right; xx += p->width) *txs_lay_at(p, xx, yy) = label;
}

static const int txs_lay_around[TXS_LAY_AROUND][2] = {{1, 0},  {1, 1},   {0, 1},  {-1, 1},
                                                      {-1, 0}, {-1, -1}, {0, -1}, {1, -1}};

/* How many pixels of the ring carry the label of the middle; -1 if not all are known. */
static int txs_lay_alike(const txs_lay_plane *p, int x, int y, int distance) {
    const uint8_t *at = txs_lay_at(p, x, y);
    int alike = 0;
    for (int i = 0; i < TXS_LAY_AROUND; i++) {
        const uint8_t label =
            at[distance * (txs_lay_around[i][1] * p->stride + txs_lay_around[i][0])];
        if (label == TXS_OUTSIDE) return -1;
        alike += label == *at;
    }
    return alike;
}

/* ---- statistics of a label map ------------------------------------------------------------- */

/* A map, the one of the coarser level at this resolution, and which band a pixel lies in. */
typedef struct txs_lay_view {
    const txs_lay_plane *map, *parent; /* parent NULL on the coarsest level */
    int field;
} txs_lay_view;

static int txs_lay_band(const txs_lay_view *v, int x, int y) {
    if (v->field == 0) return 0;
    return v->field == 1 ? (int)((int64_t)y * TXS_BANDS_OF_FIELD / v->map->height)
                         : (int)((int64_t)x * TXS_BANDS_OF_FIELD / v->map->width);
}

/* the coarse pixel that a PARENT type looks at, at this resolution */
static ptrdiff_t txs_lay_parent(const txs_lay_type *t, const txs_lay_plane *parent, int x, int y) {
    const int sx = x & 1 ? 2 : -2, sy = y & 1 ? 2 : -2;
    return sy * t->dy * parent->stride + sx * t->dx;
}

/* The row that a type's histogram has for the pixel; TXS_OUTSIDE if it has none. */
static int txs_lay_row(const txs_lay_view *v, const txs_lay_type *t, int x, int y) {
    int alike;
    switch (t->kind) {
    case TXS_LAY_FIELD: return txs_lay_band(v, x, y);
    case TXS_LAY_PAIR: return txs_lay_at(v->map, x, y)[t->dy * v->map->stride + t->dx];
    case TXS_LAY_PARENT: return txs_lay_at(v->parent, x, y)[txs_lay_parent(t, v->parent, x, y)];
    default:
        alike = txs_lay_alike(v->map, x, y, t->dx);
        return alike < 0 ? (int)TXS_OUTSIDE : alike;
    }
}

/* Count the cliques of a type; returns how many there are. */
static int64_t txs_lay_count(const txs_lay_view *v, const txs_lay_type *t,
                             int32_t count[TXS_LAY_BINS]) {
    int64_t total = 0;
    memset(count, 0, TXS_LAY_BINS * sizeof *count);
    for (int y = 0; y < v->map->height; y++) {
        for (int x = 0; x < v->map->width; x++) {
            const int label = *txs_lay_at(v->map, x, y), row = txs_lay_row(v, t, x, y);
            if (label == TXS_OUTSIDE || row == TXS_OUTSIDE) continue;
            count[row * TXS_MAX_LABELS + label]++;
            total++;
        }
    }
    return total;
}

/* Normalise to a sum of about TXS_ONE. The bands of a field are normalised one by one and share
   that sum, so that a band of which little is known counts like the others. */
static void txs_lay_normalise(const txs_lay_view *v, const txs_lay_type *t, const int32_t *count,
                              int32_t *share) {
    const int parts = t->kind == TXS_LAY_FIELD && v->field ? (int)TXS_BANDS_OF_FIELD : 1;
    const int bins = TXS_LAY_BINS / parts;
    for (int part = 0; part < parts; part++) {
        int64_t total = 0;
        for (int i = 0; i < bins; i++) total += count[part * bins + i];
        for (int i = 0; i < bins; i++)
            share[part * bins + i] =
                total ? (int32_t)((int64_t)count[part * bins + i] * (TXS_ONE / parts) / total) : 0;
    }
}

/* How often two labels would lie d bands apart if the field alone decided, given the share of each
   label in each band: added to pairs, which has a row for the label at p + d, times `by`. */
static void txs_lay_field_pairs(const int32_t *field, int labels, double d, double by,
                                double pairs[TXS_LAY_BINS]) {
    const int last = TXS_BANDS_OF_FIELD - 1, steps = 8; /* of a band */
    double sum[TXS_LAY_BINS] = {0}, total = 0;
    for (int i = 0; i <= last * steps; i++) {
        const double t = (double)i / steps, u = t + d;
        if (u < 0 || u > last) continue;
        const int32_t *f = field + (int)t * TXS_MAX_LABELS, *g = field + (int)u * TXS_MAX_LABELS;
        const double wt = t - (int)t, wu = u - (int)u;
        const int nt = t < last ? (int)TXS_MAX_LABELS : 0, nu = u < last ? (int)TXS_MAX_LABELS : 0;
        for (int a = 0; a < labels; a++) {
            const double tail = f[a] * (1 - wt) + f[a + nt] * wt;
            for (int b = 0; b < labels; b++)
                sum[b * TXS_MAX_LABELS + a] += tail * (g[b] * (1 - wu) + g[b + nu] * wu);
        }
    }
    for (int i = 0; i < TXS_LAY_BINS; i++) total += sum[i];
    for (int i = 0; i < TXS_LAY_BINS && total > 0; i++) pairs[i] += by * sum[i] / total;
}

/* A pair's histogram for a picture of another size along the field. The field spreads with the
   picture, the pairs do not: there is one horizon, however high the picture is. So what the field
   explains is exchanged, and only what goes beyond it is kept; pairs
   that the example does not have stay away. bands_then, bands_now: how many
   bands of the field the displacement spans in the example and in the picture. */
static void txs_lay_fit_pair(txs_lay_type *t, const int32_t *field, int labels, double bands_then,
                             double bands_now) {
    double pairs[TXS_LAY_BINS], total = 0;
    for (int i = 0; i < TXS_LAY_BINS; i++) pairs[i] = t->share[i];
    txs_lay_field_pairs(field, labels, bands_then, -(double)TXS_ONE, pairs);
    txs_lay_field_pairs(field, labels, bands_now, (double)TXS_ONE, pairs);
    for (int i = 0; i < TXS_LAY_BINS; i++) {
        if (!(pairs[i] > 0.5) || t->share[i] == 0) pairs[i] = 0;
        total += pairs[i];
    }
    for (int i = 0; i < TXS_LAY_BINS && total > 0; i++)
        t->share[i] = (int32_t)floor(pairs[i] / total * (double)TXS_ONE + 0.5);
}

/* ---- what is kept of a label map's statistics ------------------------------------------------ */

enum { TXS_LAY_SCALE = 60 }; /* steps of the root of a share */

/* Rows of a layout's histogram. */
static int txs_lay_rows(const txs_layout *layout, int kind) {
    if (kind == TXS_LAY_FIELD) return layout->field ? (int)TXS_BANDS_OF_FIELD : 1;
    return kind == TXS_LAY_RING ? TXS_LAY_AROUND + 1 : layout->labels;
}

/* Round shares to what is kept: roots in steps, beside each other without the empty columns. */
static void txs_lay_round(const txs_layout *layout, txs_lay_type *t) {
    const int rows = txs_lay_rows(layout, t->kind);
    for (int i = 0; i < rows * layout->labels; i++) {
        const int32_t share = t->share[i / layout->labels * TXS_MAX_LABELS + i % layout->labels];
        t->root[i] =
            (int16_t)floor(sqrt((double)share / (double)TXS_ONE) * (double)TXS_LAY_SCALE + 0.5);
    }
}

/* The inverse, normalised as txs_lay_normalise has it; 0 for an empty histogram. */
static int txs_lay_unround(const txs_layout *layout, txs_lay_type *t) {
    const txs_lay_view view = {NULL, NULL, layout->field};
    const int rows = txs_lay_rows(layout, t->kind);
    int32_t square[TXS_LAY_BINS] = {0}, total = 0;
    for (int i = 0; i < rows * layout->labels; i++) {
        square[i / layout->labels * TXS_MAX_LABELS + i % layout->labels] = t->root[i] * t->root[i];
        total += t->root[i] * t->root[i];
    }
    txs_lay_normalise(&view, t, square, t->share);
    return total > 0;
}

#endif /* TEXSYN_LAYOUT_H */
