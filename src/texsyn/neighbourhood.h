#ifndef TEXSYN_NEIGHBOURHOOD_H
#define TEXSYN_NEIGHBOURHOOD_H

#include "sampler.h"
#include "example.h"

/* ---- statistics of an image ------------------------------------------------------------- */

enum { TXS_RESPONSES_TOGETHER = 256 };

/* The responses of a filter at count tails from (x, y) on. */
static void txs_responses(const txs_canvas *c, const txs_type *t, int x, int y, int count,
                          int16_t *response) {
    int at[TXS_MAX_MEMBERS][2], weight[TXS_MAX_MEMBERS];
    const int n = txs_shape_pixels(t->shape, at, weight);
    memset(response, 0, (size_t)count * sizeof *response);
    for (int k = 0; k < n; k++) {
        const uint8_t *p = txs_at(c, t->band, x + at[k][0], y + at[k][1]);
        const int w = weight[k];
        for (int i = 0; i < count; i++) response[i] = (int16_t)(response[i] + w * p[i]);
    }
}

/* The tails whose members lie inside an image: x, y of the first, and after the last. */
static void txs_find_tails(int at[TXS_MAX_MEMBERS][2], int members, int width, int height,
                           int inside[4]) {
    const int size[2] = {width, height};
    for (int k = 0; k < 2; k++) {
        inside[k] = 0;
        inside[k + 2] = size[k];
        for (int i = 0; i < members; i++) {
            if (-at[i][k] > inside[k]) inside[k] = -at[i][k];
            if (size[k] - at[i][k] < inside[k + 2]) inside[k + 2] = size[k] - at[i][k];
        }
    }
}

/* Which pixels of an example count: those inside the mask; with weights, by the least weight of a
   clique's members. */
typedef struct txs_stencil {
    const uint8_t *mask, *weight; /* a byte for each pixel; NULL = all are inside, or weigh 1 */
    int width;
} txs_stencil;

/* How much the clique at (x, y) counts. */
static uint32_t txs_clique_weight(const txs_stencil *s, int at[TXS_MAX_MEMBERS][2], int members,
                                  int x, int y) {
    uint32_t least = s->weight ? (uint32_t)TXS_OPAQUE : 1;
    for (int i = 0; i < members; i++) {
        const ptrdiff_t p = (ptrdiff_t)(y + at[i][1]) * s->width + x + at[i][0];
        if (s->mask && !s->mask[p]) least = 0;
        if (s->weight && s->weight[p] < least) least = s->weight[p];
    }
    return s->weight ? txs_counts_of(least) : least;
}

/* Histogram of a clique type over a canvas: of the example (stencil), cliques that lie inside it and
   count; of a synthesised canvas (NULL) all of them. Every step-th row. Returns the number of
   cliques; share[] sums to about TXS_ONE. */
static int64_t txs_measure(const txs_canvas *c, const txs_stencil *stencil, int step, int bands,
                           const txs_level *level, const txs_type *t, int32_t share[TXS_BINS]) {
    const int is_partial = stencil && (stencil->mask || stencil->weight);
    int at[TXS_MAX_MEMBERS][2], inside[4] = {0, 0, c->width, c->height};
    const int members = txs_footprint(t, at);
    uint32_t h[2][TXS_BINS + 15];
    const txs_tally y = txs_tally_make(t, level, c, bands);
    int64_t total = 0;
    memset(h, 0, sizeof h);
    if (stencil) txs_find_tails(at, members, c->width, c->height, inside);
    const int x0 = inside[0], y0 = inside[1], x1 = inside[2], y1 = inside[3];
    uint8_t class_of[2 * TXS_MAX_RESPONSE + 1];
    if (t->kind == TEXSYN_FILTER) txs_response_classes(t->scale, class_of);
    for (int row = y0; row < y1; row += step) {
        const uint8_t *p = txs_at(c, 0, 0, row);
        if (is_partial || t->phase) {
            for (int x = x0; x < x1; x++) {
                if (!txs_is_tail(t, x, row)) continue;
                const uint32_t weight =
                    is_partial ? txs_clique_weight(stencil, at, members, x, row) : 1;
                if (!weight) continue;
                if (t->kind == TEXSYN_FILTER) {
                    int16_t r;
                    txs_responses(c, t, x, row, 1, &r);
                    h[0][class_of[r + TXS_MAX_RESPONSE]] += weight;
                } else {
                    h[0][txs_bin(&y, p + x)] += weight;
                }
            }
        } else if (t->kind == TEXSYN_FILTER) {
            int16_t r[TXS_RESPONSES_TOGETHER];
            for (int x = x0, n; x < x1; x += n) {
                n = x1 - x < TXS_RESPONSES_TOGETHER ? x1 - x : (int)TXS_RESPONSES_TOGETHER;
                txs_responses(c, t, x, row, n, r);
                for (int i = 0; i < n; i++) h[i & 1][class_of[r[i] + TXS_MAX_RESPONSE]]++;
            }
        } else if (y.form == 1) {
            const uint8_t *a = p + y.a, *b = p + y.b;
            for (int x = x0; x < x1; x++) h[x & 1][a[x] - b[x] + 31]++;
        } else if (y.form == 2) {
            const uint8_t *a = p + y.a, *b = p + y.b;
            for (int x = x0; x < x1; x++) h[x & 1][y.ca[a[x]] * TXS_CLASSES + y.cb[b[x]]]++;
        } else {
            for (int x = x0; x < x1; x++) h[x & 1][txs_bin(&y, p + x)]++;
        }
    }
    for (int i = 0; i < TXS_BINS; i++) total += h[0][i] + h[1][i];
    for (int i = 0; i < TXS_BINS; i++)
        share[i] =
            total ? (int32_t)(((int64_t)(h[0][i] + h[1][i]) * TXS_ONE + total / 2) / total) : 0;
    return stencil && stencil->weight ? (total + TXS_OPAQUE - 1) / TXS_OPAQUE : total;
}

/* Euclidean distance of two normalised histograms (step 4 of [1]) */
static float txs_distance(const int32_t *a, const int32_t *b) {
    int64_t sum = 0;
    for (int i = 0; i < TXS_BINS; i++) sum += (int64_t)(a[i] - b[i]) * (a[i] - b[i]);
    return txm_float(sqrt((double)sum) / (double)TXS_ONE);
}

/* ---- learning: the neighbourhood system ------------------------------------------------- */

/* One clique type that could be added. */
typedef struct txs_candidate {
    txs_type type;
    float weight;   /* of its distance                                    */
    float noise;    /* distance of two samples of this size from one source */
    float distance; /* now; 0 = not to be taken                           */
} txs_candidate;

typedef struct txs_learner {
    const texsyn_learn_desc *desc;
    texsyn_model *model;
    int index; /* of the level */
    txs_level *level;
    const txs_source *source;
    const txs_canvas *canvas;
    txs_candidate *candidates;
    int candidate_count, capacity;
    int step;   /* the canvas is measured on every step-th row */
    int shapes; /* filters and labels may be chosen too        */
} txs_learner;

/* What counts in the example for a type: cliques that alpha is part of count whole. */
static txs_stencil txs_stencil_of(const txs_learner *a, const txs_type *t) {
    const int has_alpha = txs_is_alpha(a->model, t->band) || txs_is_alpha(a->model, t->other);
    const txs_stencil s = {a->source->mask, has_alpha ? NULL : a->source->weight,
                           a->source->width};
    return s;
}

static txs_type *txs_add_type(txs_level *l, int kind, int band, int other, int dx, int dy) {
    TEXSYN_ASSERT(l->type_count < TXS_MAX_TYPES);
    txs_type *t = &l->types[l->type_count++];
    memset(t, 0, sizeof *t);
    t->kind = kind;
    t->band = band;
    t->other = other;
    t->dx = dx;
    t->dy = dy;
    return t;
}

static void txs_add_candidate(txs_learner *a, int kind, int band, int other, const int *d,
                              float weight) {
    const int ex = kind >= TEXSYN_CORNER ? d[2] : 0, ey = kind >= TEXSYN_CORNER ? d[3] : 0;
    for (int k = 0; k < a->level->type_count; k++) {
        const txs_type *t = &a->level->types[k];
        if (t->kind == kind && t->band == band && t->other == other && t->dx == d[0] &&
            t->dy == d[1])
            return;
    }
    if (a->candidate_count == a->capacity) return;
    txs_candidate *c = &a->candidates[a->candidate_count++];
    memset(c, 0, sizeof *c);
    c->type.kind = kind;
    c->type.band = band;
    c->type.other = other;
    c->type.dx = d[0];
    c->type.dy = d[1];
    c->type.ex = ex;
    c->type.ey = ey;
    c->weight = weight;
}

/* What a filter's last classes begin at: the example's 99.5th percentile. */
static int txs_find_scale(const txs_learner *a, const txs_type *t) {
    const txs_source *s = a->source;
    int at[TXS_MAX_MEMBERS][2], inside[4];
    const int members = txs_footprint(t, at);
    uint32_t h[TXS_MAX_RESPONSE + 1] = {0}, count = 0, seen = 0;
    int16_t r[TXS_RESPONSES_TOGETHER];
    const txs_stencil stencil = txs_stencil_of(a, t);
    const int is_partial = stencil.mask || stencil.weight;
    txs_find_tails(at, members, s->width, s->height, inside);
    for (int y = inside[1]; y < inside[3]; y += s->step) {
        for (int x = inside[0], n; x < inside[2]; x += n) {
            n = inside[2] - x < TXS_RESPONSES_TOGETHER ? inside[2] - x
                                                       : (int)TXS_RESPONSES_TOGETHER;
            txs_responses(&s->canvas, t, x, y, n, r);
            for (int i = 0; i < n; i++) {
                const uint32_t weight =
                    is_partial ? txs_clique_weight(&stencil, at, members, x + i, y) : 1;
                h[abs(r[i])] += weight;
                count += weight;
            }
        }
    }
    int scale = TXS_MAX_RESPONSE;
    while (scale > 1 && (seen += h[scale]) <= count / 200) scale--;
    return scale;
}

/* Filters, and differences beside the labels of the level above. */
static void txs_list_shapes(txs_learner *a, const float *seen) {
    static const int contexts[][4] = {{0, 0, 0, 0},   {1, 0, 0, 0}, {0, 1, 0, 0}, {1, 1, 0, 0},
                                      {-1, 1, 0, 0},  {2, 0, 1, 0}, {0, 2, 0, 1}, {2, 2, 1, 1},
                                      {-2, 2, -1, 1}, {3, 0, 1, 0}, {0, 3, 0, 1}, {3, 3, 1, 1},
                                      {-3, 3, -1, 1}, {4, 0, 2, 0}, {0, 4, 0, 2}};
    if (a->index + 1 < a->model->levels)
        for (size_t i = 0; i < sizeof contexts / sizeof *contexts; i++)
            txs_add_candidate(a, TEXSYN_CONTEXT, 0, 0, contexts[i], TXS_CONTOUR_WEIGHT * seen[0]);
    for (int i = 0; i < TXS_SHAPES; i++) {
        const int d[4] = {txs_shapes[i].dx, txs_shapes[i].dy, txs_shapes[i].ex, txs_shapes[i].ey};
        if (a->candidate_count == a->capacity) return;
        txs_candidate *c = &a->candidates[a->candidate_count++];
        memset(c, 0, sizeof *c);
        c->type.kind = TEXSYN_FILTER;
        c->type.dx = d[0];
        c->type.dy = d[1];
        c->type.ex = d[2];
        c->type.ey = d[3];
        c->type.shape = i;
        c->type.scale = txs_find_scale(a, &c->type);
        c->weight = TXS_CONTOUR_WEIGHT * seen[0];
    }
}

/* Pairs within the reach, and the kinds that take three or four pixels, of few shapes. */
static void txs_list_candidates(txs_learner *a, int reach, const float *seen) {
    static const int corners[][4] = {{1, 0, 0, 1},   {-1, 0, 0, 1},  {1, 0, -1, 0}, {0, 1, 0, -1},
                                     {2, 0, 0, 2},   {-2, 0, 0, 2},  {2, 0, -2, 0}, {0, 2, 0, -2},
                                     {1, 1, -1, -1}, {-1, 1, 1, -1}, {1, 1, -1, 1}, {1, 1, 1, -1},
                                     {3, 0, 0, 3},   {-3, 0, 0, 3},  {3, 0, -3, 0}, {0, 3, 0, -3},
                                     {2, 2, -2, -2}, {-2, 2, 2, -2}, {2, 2, -2, 2}, {2, 2, 2, -2},
                                     {4, 0, 0, 4},   {-4, 0, 0, 4},  {3, 0, -4, 0}, {0, 4, 0, -4},
                                     {1, 0, 2, 0},   {0, 1, 0, 2},   {2, 0, 4, 0},  {0, 2, 0, 4}};
    static const int scales[][4] = {{1, 0, 2, 0},  {0, 1, 0, 2},  {1, 1, 2, 2}, {-1, 1, -2, 2},
                                    {2, 0, 2, 0},  {0, 2, 0, 2},  {2, 2, 2, 2}, {-2, 2, -2, 2},
                                    {1, 0, 3, 0},  {0, 1, 0, 3},  {1, 0, 0, 2}, {0, 1, 2, 0},
                                    {1, 1, -2, 2}, {-1, 1, 2, 2}, {2, 0, 0, 2}, {0, 2, 2, 0}};
    const int bands = a->model->bands;
    a->candidate_count = 0;
    for (int b = 0; b < bands; b++) {
        for (int o = b; o < bands; o++) {
            const float weight = seen[b] < seen[o] ? seen[b] : seen[o];
            for (int y = -reach; y <= reach; y++) {
                for (int x = -reach; x <= reach; x++) {
                    const int d[4] = {x, y, 0, 0}, square = x * x + y * y,
                              half = y > 0 || (y == 0 && x > 0);
                    if (square > reach * reach || (y == 0 && x % TXS_GRID == 0)) continue;
                    if (b == o && half) {
                        txs_add_candidate(a, TEXSYN_PAIR, b, b, d, weight);
                        txs_add_candidate(a, TEXSYN_VALUES, b, b, d, weight);
                    }
                    if (b != o && square <= 9 && square)
                        txs_add_candidate(a, TEXSYN_PAIR, b, o, d, weight);
                    if (b == 0 && o && half && square <= 5)
                        txs_add_candidate(a, TEXSYN_PARALLEL, b, o, d, weight);
                }
            }
        }
    }
    static const int edges[][4] = {{1, 0, 0, 1},  {0, 1, 1, 0},  {1, 0, 0, 2},  {0, 1, 2, 0},
                                   {1, 0, 0, 3},  {0, 1, 3, 0},  {1, 1, -1, 1}, {-1, 1, 1, 1},
                                   {1, 1, -2, 2}, {-1, 1, 2, 2}, {1, 0, 2, 0},  {0, 1, 0, 2},
                                   {1, 0, 3, 0},  {0, 1, 0, 3},  {2, 0, 0, 2},  {0, 2, 2, 0},
                                   {2, 0, 0, 4},  {0, 2, 4, 0},  {2, 2, -2, 2}, {-2, 2, 2, 2}};
    for (size_t i = 0; i < sizeof edges / sizeof *edges; i++)
        txs_add_candidate(a, TEXSYN_PARALLEL, 0, 0, edges[i], TXS_EDGE_WEIGHT * seen[0]);
    for (size_t i = 0; i < sizeof corners / sizeof *corners; i++)
        txs_add_candidate(a, TEXSYN_CORNER, 0, 0, corners[i], TXS_CORNER_WEIGHT * seen[0]);
    if (a->index + 1 < a->model->levels)
        for (size_t i = 0; i < sizeof scales / sizeof *scales; i++)
            txs_add_candidate(a, TEXSYN_SCALE, 0, 0, scales[i], TXS_EDGE_WEIGHT * seen[0]);
}

/* Parallel bodies: measure a candidate in the example, in the canvas. */
static void txs_measure_example(void *context, int i) {
    txs_learner *a = (txs_learner *)context;
    txs_candidate *c = &a->candidates[i];
    const txs_stencil stencil = txs_stencil_of(a, &c->type);
    int64_t n = txs_measure(&a->source->canvas, &stencil, a->source->step, a->model->bands,
                            a->level, &c->type, c->type.share);
    int64_t m = (int64_t)a->canvas->width * a->canvas->height / a->step;
    c->noise = n ? txm_float(sqrt(1.0 / (double)n + 1.0 / (double)m)) : 0;
    if (!n) c->weight = 0;
}

static void txs_measure_canvas(void *context, int i) {
    txs_learner *a = (txs_learner *)context;
    txs_candidate *c = &a->candidates[i];
    int32_t share[TXS_BINS];
    txs_measure(a->canvas, NULL, a->step, a->model->bands, a->level, &c->type, share);
    c->distance = txs_distance(share, c->type.share);
}

/* Steps 4 and 5 of [1]: move the count worst clique types into the level. Returns how many. */
static int txs_add_worst(txs_learner *a, int count, float threshold) {
    int added = 0;
    for (; added < count; added++) {
        int worst = -1;
        for (int i = 0; i < a->candidate_count; i++) {
            const txs_candidate *c = &a->candidates[i];
            if (c->distance > txm_maxf(threshold, TXS_NOISE_SHARE * c->noise) && c->weight > 0 &&
                (worst < 0 || c->distance * c->weight >
                                  a->candidates[worst].distance * a->candidates[worst].weight))
                worst = i;
        }
        if (worst < 0 || a->level->type_count == TXS_MAX_TYPES) break;
        const txs_type chosen = a->candidates[worst].type;
        a->level->types[a->level->type_count++] = chosen;
        if (txs_most_ends(a->level, a->model->bands) > TXS_MAX_ENDS) {
            a->level->type_count--;
            break;
        }
        a->candidates[worst] = a->candidates[--a->candidate_count];
        for (int i = 0; i < a->candidate_count; i++) { /* its neighbours are redundant */
            txs_type *t = &a->candidates[i].type;
            if (t->kind == chosen.kind && t->kind < TEXSYN_CORNER && t->band == chosen.band &&
                t->other == chosen.other && abs(t->dx - chosen.dx) <= 1 &&
                abs(t->dy - chosen.dy) <= 1)
                a->candidates[i].distance = 0;
        }
    }
    return added;
}
/* A share h is kept as its square root in steps of 1/scale: the sampling noise of the root is the
   same for all shares, and the step about as large. */
static int txs_root_scale(int kind, int level) {
    return kind == TEXSYN_SINGLE ? 160 : level == 0 ? 48 : level == 1 ? 36 : 26;
}

/* Round what was measured to what is kept. */
static void txs_round_statistics(txs_type *t, int level) {
    const int scale = txs_root_scale(t->kind, level);
    for (int i = 0; i < TXS_BINS; i++) {
        t->root[i] = (int16_t)floor(sqrt((double)t->share[i] / (double)TXS_ONE) * scale + 0.5);
        t->level[i] = (int16_t)floor((double)t->potential[i] / (double)TXS_COARSE + 0.5);
    }
}

/* The preselected clique types: singles, the 4-neighbourhood within the bands, the bands against
   each other at the same pixel [1], and each band against the level above. */
static void txs_preselect(txs_learner *a) {
    const int bands = a->model->bands;
    a->level->type_count = 0;
    for (int b = 0; b < bands; b++) {
        txs_type *t = txs_add_type(a->level, TEXSYN_SINGLE, b, b, 0, 0);
        const txs_stencil stencil = txs_stencil_of(a, t);
        txs_measure(&a->source->canvas, &stencil, 1, bands, a->level, t, t->share);
        txs_make_classes(a->model, a->level, b);
    }
    for (int b = 0; b < bands; b++) {
        const int top = a->index + 1 == a->model->levels;
        for (int phase = !top; phase <= 2 * !top; phase++) {
            txs_add_type(a->level, TEXSYN_PAIR, b, b, 1, 0)->phase = phase;
            txs_add_type(a->level, TEXSYN_PAIR, b, b, 0, 1)->phase = phase;
        }
        if (!top) txs_add_type(a->level, TEXSYN_PARENT, b, b, 0, 0);
        for (int o = b + 1; o < bands; o++) txs_add_type(a->level, TEXSYN_VALUES, b, o, 0, 0);
    }
    int kept = bands;
    for (int k = bands; k < a->level->type_count; k++) {
        txs_type t = a->level->types[k];
        const txs_stencil stencil = txs_stencil_of(a, &t);
        if (txs_measure(&a->source->canvas, &stencil, a->source->step, bands, a->level, &t,
                        t.share) > 0)
            a->level->types[kept++] = t; /* an irregular mask may contain none of them */
    }
    a->level->type_count = kept;
}

/* How much a band's histograms count: its standard deviation in gray levels against 4, and less
   if it has few values, whose histograms have few bins and so larger distances. */
static float txs_visibility(const txs_level *l, int band) {
    const int32_t *share = l->types[band].share;
    double mean = 0, square = 0;
    for (int v = 0; v < TXS_VALUES; v++) {
        mean += (double)share[v] * v / (double)TXS_ONE;
        square += (double)share[v] * v * v / (double)TXS_ONE;
    }
    double deviation =
        sqrt(square - mean * mean > 0 ? square - mean * mean : 0) * (double)l->step[band];
    return txm_float(deviation / (deviation + 4) * sqrt(l->values[band] / (double)TXS_VALUES));
}

/* The model's potentials: the mean over some sweeps, which varies less than the last value. They
   are arbitrary up to a constant, and where the example has no clique. */
static void txs_keep_potentials(txs_level *l, int64_t (*sum)[TXS_BINS], int sweeps) {
    for (int k = 0; k < l->type_count; k++) {
        txs_type *t = &l->types[k];
        int64_t mean = 0, total = 1;
        for (int i = 0; i < TXS_BINS; i++) {
            mean += sum[k][i] / sweeps * t->share[i];
            total += t->share[i];
        }
        mean /= total;
        for (int i = 0; i < TXS_BINS; i++)
            t->potential[i] =
                (int16_t)txm_clampi((int)((sum[k][i] / sweeps - mean) / TXS_PRECISE),
                                    -TXS_STEEPEST * TXS_COARSE, TXS_STEEPEST * TXS_COARSE);
    }
}

/* Learn one level on a canvas whose parent planes are filled. Fraction from..to of the whole. */
static txm_status txs_learn_level(txs_learner *a, const int16_t *noise, txm_env *env, float from,
                                  float to) {
    const int max_types = a->desc->max_types     ? a->desc->max_types
                          : a->model->bands == 1 ? TXS_TYPES_GRAY
                          : a->source->weight    ? TXS_TYPES_CUTOUT
                                                 : TXS_TYPES;
    const float threshold = a->desc->threshold > 0 ? a->desc->threshold : TXS_THRESHOLD;
    const int max_distance = a->desc->max_distance ? a->desc->max_distance : 40;
    enum { FIRST = 6, BETWEEN = 3, LAST = 15, KEPT = 8, BATCH = 6 };
    const int bands = a->model->bands, top = a->index + 1 == a->model->levels;
    const int rounds = (max_types + BATCH - 1) / BATCH;
    const float sweep = (to - from) / (float)(FIRST + rounds * (BETWEEN + 2) + LAST);
    const int side = a->source->width < a->source->height ? a->source->width : a->source->height;
    int left = max_types, sweeps = FIRST;
    txm_arena arena;
    float seen[TXS_MAX_BANDS];
    txm_status status = TXM_OK;

    txm_arena_init(&arena, env);
    a->step = (int)((int64_t)a->canvas->width * a->canvas->height / 24576) | 1;
    int reach = max_distance >> a->index;
    if (!top && reach > TXS_NEAR) reach = TXS_NEAR;
    if (reach > side / 4) reach = side / 4;
    if (reach > a->canvas->margin) reach = a->canvas->margin;
    if (reach < 2) reach = 2;

    a->capacity = (2 * reach + 1) * (2 * reach + 1) * bands + 400;
    a->candidates =
        (txs_candidate *)txm_arena_alloc(&arena, (size_t)a->capacity, sizeof *a->candidates);
    int64_t(*sum)[TXS_BINS] =
        (int64_t(*)[TXS_BINS])txm_arena_zero(&arena, TXS_MAX_TYPES, sizeof *sum);
    txs_sampler *s = txs_sampler_make(&arena, a->level, TXS_MAX_TYPES, TXS_SHAPES, a->canvas, bands,
                                      noise, txm_hash(a->desc->seed) + 64 + (uint64_t)a->index);
    if (arena.failed) {
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to learn the model");
        goto done;
    }

    txs_preselect(a);
    for (int b = 0; b < bands; b++) seen[b] = txs_visibility(a->level, b);
    txs_list_candidates(a, reach, seen);
    if (a->shapes) txs_list_shapes(a, seen);
    txm_parallel_for(env, a->candidate_count, txs_measure_example, a);
    txs_start_canvas(a->level, a->canvas, bands, !top,
                     txm_hash(a->desc->seed) + (uint64_t)a->index);

    /* steps 3 to 6 of [1]; what was synthesised so far, and its potentials, are kept */
    for (;;) {
        txs_sampler_start(s, env);
        for (int i = 0; i < sweeps; i++, from += sweep)
            if ((status = txs_sweep(s, env, "learn", from, from + sweep)) != TXM_OK) goto done;
        if (left == 0) break;
        txm_parallel_for(env, a->candidate_count, txs_measure_canvas, a);
        int added = txs_add_worst(a, left < BATCH ? left : BATCH, threshold);
        if (added == 0) break;
        left -= added;
        sweeps = BETWEEN;
        from += 2 * sweep; /* about what the measuring takes */
    }
    for (int i = 0; i < LAST; i++, from += sweep) {
        if ((status = txs_sweep(s, env, "learn", from, from + sweep)) != TXM_OK) goto done;
        for (int k = 0; k < a->level->type_count && i >= LAST - KEPT; k++)
            for (int j = 0; j < TXS_BINS; j++) sum[k][j] += s->integral[k][j];
    }
    txs_keep_potentials(a->level, sum, KEPT);
    for (int k = 0; k < a->level->type_count; k++)
        txs_round_statistics(&a->level->types[k], a->index);
done:
    txm_arena_free(&arena);
    return status;
}

#endif /* TEXSYN_NEIGHBOURHOOD_H */
