#ifndef TEXSYN_LABELS_H
#define TEXSYN_LABELS_H

#include "regions.h"

/* ---- labels -------------------------------------------------------------------------------

   Boundaries to the pixel: each pixel takes the label under which the textons around it are
   likely and which its neighbours have. */

enum {
    TXS_MOST_LABELS = TEXSYN_MAX_SEGMENTS,
    TXS_REFINEMENTS = 3,
    TXS_SWEEPS = 4,          /* in each refinement                                       */
    TXS_REACH = 6,          /* pixels: reach of the window in which neighbours count    */
    TXS_PATIENCE = 96,       /* costs as much as if no pixel of it had the label         */
    TXS_FINER = 16,          /* steps per step of a cost when both are added             */
    TXS_COST_UNIT = 64,      /* steps of a cost per nat                                  */
    TXS_SPECK = 2048,        /* a smaller part of the picture is a speck                 */
    TXS_UNSEEN_SHARE = 2000  /* of a label's pixels: as if more had each texton          */
};

typedef struct txs_refiner {
    const txs_scene *scene;
    uint8_t *label;             /* of each pixel                                          */
    int count, reach;
    int32_t *colour_cost, *shape_cost; /* of each texton under each label                 */
    int16_t *cost;              /* planes, one a label: mean around each pixel            */
    uint8_t *share;             /* the same: pixels of the label around each pixel        */
    int32_t *work;              /* a line of sums for each label                          */
    uint16_t *counted_around;   /* counted pixels within reach                            */
} txs_refiner;

/* Sums over a window of 2 reach + 1 pixels a side, clipped at the border. */
typedef struct txs_window_sums {
    int width, height, reach;
    int32_t *columns; /* width sums over the rows of the window */
} txs_window_sums;

static void txs_window_row(const txs_window_sums *b, int32_t *out) {
    int32_t sum = 0;
    for (int x = 0; x < b->reach && x < b->width; x++) sum += b->columns[x];
    for (int x = 0; x < b->width; x++) {
        if (x + b->reach < b->width) sum += b->columns[x + b->reach];
        out[x] = sum;
        if (x >= b->reach) sum -= b->columns[x - b->reach];
    }
}

/* -log p of the textons of each label, in TXS_COST_UNIT */
static void txs_texton_costs(txs_refiner *r) {
    const txs_scene *s = r->scene;
    memset(r->colour_cost, 0, sizeof(int32_t) * (size_t)r->count * TXS_COLOURS);
    memset(r->shape_cost, 0, sizeof(int32_t) * (size_t)r->count * TXS_GRAINS);
    for (size_t i = 0; i < s->pixels; i++) {
        if (!s->counted[i]) continue;
        r->colour_cost[r->label[i] * TXS_COLOURS + s->colour[i]]++;
        r->shape_cost[r->label[i] * TXS_GRAINS + s->shape[i]]++;
    }
    for (int k = 0; k < 2 * r->count; k++) {
        const int bins = k & 1 ? TXS_GRAINS : TXS_COLOURS;
        int32_t *bin = k & 1 ? r->shape_cost + (k >> 1) * bins : r->colour_cost + (k >> 1) * bins;
        double total = 0;
        for (int i = 0; i < bins; i++) total += bin[i];
        /* as if each texton had been seen a little more often than it was */
        const double more = total / (double)TXS_UNSEEN_SHARE + 1;
        for (int i = 0; i < bins; i++) {
            const double p = (total + more * bins) / ((double)bin[i] + more);
            bin[i] = (int32_t)(txm_log2(p) * TXS_LN2 * (double)TXS_COST_UNIT + 0.5);
        }
    }
}

static void txs_add_costs(const txs_refiner *r, int label, int y, int sign, int32_t *columns) {
    const txs_scene *s = r->scene;
    const size_t at = (size_t)y * (size_t)s->width;
    const int32_t *colour = r->colour_cost + label * TXS_COLOURS;
    const int32_t *shape = r->shape_cost + label * TXS_GRAINS;
    for (int x = 0; x < s->width; x++) {
        const size_t i = at + (size_t)x;
        if (s->counted[i]) columns[x] += sign * (colour[s->colour[i]] + shape[s->shape[i]]);
    }
}

/* The mean cost of a label around each pixel. */
static void txs_average_costs(void *context, int label) {
    const txs_refiner *r = (const txs_refiner *)context;
    const txs_scene *s = r->scene;
    const size_t line = 2 * (size_t)s->width;
    int32_t *columns = r->work + (size_t)label * line, *out = columns + s->width;
    const txs_window_sums box = {s->width, s->height, r->reach, columns};
    memset(columns, 0, sizeof *columns * (size_t)s->width);
    for (int y = 0; y < r->reach && y < s->height; y++) txs_add_costs(r, label, y, 1, columns);
    for (int y = 0; y < s->height; y++) {
        if (y + r->reach < s->height) txs_add_costs(r, label, y + r->reach, 1, columns);
        txs_window_row(&box, out);
        if (y >= r->reach) txs_add_costs(r, label, y - r->reach, -1, columns);
        int16_t *to = r->cost + (size_t)label * s->pixels + (size_t)y * (size_t)s->width;
        const uint16_t *n = r->counted_around + (size_t)y * (size_t)s->width;
        for (int x = 0; x < s->width; x++) to[x] = (int16_t)(n[x] ? out[x] / n[x] : 0);
    }
}

static void txs_count_around(const txs_refiner *r) {
    const txs_scene *s = r->scene;
    int32_t *columns = r->work, *out = columns + s->width;
    const txs_window_sums box = {s->width, s->height, r->reach, columns};
    memset(columns, 0, sizeof *columns * (size_t)s->width);
    for (int y = -r->reach; y < s->height; y++) {
        if (y + r->reach < s->height)
            for (int x = 0; x < s->width; x++)
                columns[x] += s->counted[(size_t)(y + r->reach) * (size_t)s->width + (size_t)x];
        if (y < 0) continue;
        txs_window_row(&box, out);
        for (int x = 0; x < s->width; x++) {
            r->counted_around[(size_t)y * (size_t)s->width + (size_t)x] = (uint16_t)out[x];
            if (y >= r->reach)
                columns[x] -= s->counted[(size_t)(y - r->reach) * (size_t)s->width + (size_t)x];
        }
    }
}

static void txs_add_label(const txs_refiner *r, int label, int y, int sign, int32_t *columns) {
    const txs_scene *s = r->scene;
    const uint8_t *row = r->label + (size_t)y * (size_t)s->width;
    const uint8_t *counted = s->counted + (size_t)y * (size_t)s->width;
    for (int x = 0; x < s->width; x++) columns[x] += sign * ((row[x] == label) & counted[x]);
}

/* How many pixels around each have the label. */
static void txs_share_label(void *context, int label) {
    const txs_refiner *r = (const txs_refiner *)context;
    const txs_scene *s = r->scene;
    const size_t line = 2 * (size_t)s->width;
    int32_t *columns = r->work + (size_t)label * line, *out = columns + s->width;
    const txs_window_sums box = {s->width, s->height, TXS_REACH, columns};
    memset(columns, 0, sizeof *columns * (size_t)s->width);
    for (int y = 0; y < TXS_REACH && y < s->height; y++) txs_add_label(r, label, y, 1, columns);
    for (int y = 0; y < s->height; y++) {
        if (y + TXS_REACH < s->height) txs_add_label(r, label, y + TXS_REACH, 1, columns);
        txs_window_row(&box, out);
        if (y >= TXS_REACH) txs_add_label(r, label, y - TXS_REACH, -1, columns);
        uint8_t *to = r->share + (size_t)label * s->pixels + (size_t)y * (size_t)s->width;
        for (int x = 0; x < s->width; x++) to[x] = (uint8_t)out[x];
    }
}

static void txs_choose_labels(void *context, int share) {
    const txs_refiner *r = (const txs_refiner *)context;
    const txs_scene *s = r->scene;
    const int window = (2 * TXS_REACH + 1) * (2 * TXS_REACH + 1);
    const int gain = (TXS_PATIENCE * TXS_FINER + window / 2) / window;
    const size_t from = s->pixels * (size_t)share / TXS_TASKS;
    const size_t to = s->pixels * ((size_t)share + 1) / TXS_TASKS;
    for (size_t i = from; i < to; i++) {
        int best = 0, least = INT_MAX;
        for (int k = 0; k < r->count; k++) {
            const size_t at = (size_t)k * s->pixels + i;
            const int cost = TXS_FINER * r->cost[at] - gain * r->share[at];
            if (cost >= least) continue;
            least = cost;
            best = k;
        }
        r->label[i] = (uint8_t)best;
    }
}

static const int txs_reaches[TXS_REFINEMENTS] = {12, 8, 5};

static txm_status txs_refine_labels(txs_refiner *r, txm_env *env, float from, float to) {
    for (int i = 0; i < TXS_REFINEMENTS; i++) {
        r->reach = txs_reaches[i];
        txs_texton_costs(r);
        txs_count_around(r);
        txm_parallel_for(env, r->count, txs_average_costs, r);
        for (int k = 0; k < TXS_SWEEPS; k++) {
            txm_parallel_for(env, r->count, txs_share_label, r);
            txm_parallel_for(env, TXS_TASKS, txs_choose_labels, r);
        }
        const float done = (float)(i + 1) / (float)TXS_REFINEMENTS;
        if (txm_progress(env, from + (to - from) * done, "refine"))
            return txm_fail(env, TXM_CANCELLED, "cancelled");
    }
    return TXM_OK;
}

/* ---- specks and thin parts ----------------------------------------------------------------- */

typedef struct txs_cleaner {
    int width, height;
    uint8_t *label;
    uint8_t *seen;
    uint32_t *part;    /* pixels of the connected part that is looked at */
} txs_cleaner;

/* The connected part at pixel i; its size. */
static size_t txs_find_part(const txs_cleaner *c, size_t i) {
    const size_t w = (size_t)c->width, pixels = w * (size_t)c->height;
    size_t count = 0;
    c->part[count++] = (uint32_t)i;
    c->seen[i] = 1;
    for (size_t k = 0; k < count; k++) {
        const size_t at = c->part[k], x = at % w;
        const size_t beside[4] = {x ? at - 1 : at, x + 1 < w ? at + 1 : at, at >= w ? at - w : at,
                                  at + w < pixels ? at + w : at};
        for (int n = 0; n < 4; n++) {
            if (c->seen[beside[n]] || c->label[beside[n]] != c->label[i]) continue;
            TEXSYN_ASSERT(count < pixels);
            c->seen[beside[n]] = 1;
            c->part[count++] = (uint32_t)beside[n];
        }
    }
    return count;
}

/* The label that most pixels beside the part have; its own if there are none. */
static int txs_label_around(const txs_cleaner *c, size_t count) {
    const size_t w = (size_t)c->width, pixels = w * (size_t)c->height;
    const int own = c->label[c->part[0]];
    size_t votes[256] = {0};
    int best = own;
    for (size_t k = 0; k < count; k++) {
        const size_t at = c->part[k], x = at % w;
        votes[c->label[x ? at - 1 : at]]++;
        votes[c->label[x + 1 < w ? at + 1 : at]]++;
        votes[c->label[at >= w ? at - w : at]]++;
        votes[c->label[at + w < pixels ? at + w : at]]++;
    }
    votes[own] = 0;
    for (int l = 0; l < 256; l++)
        if (votes[l] > votes[best]) best = l;
    return best;
}

/* Parts of fewer than `least` pixels take the label around them, or `transition` if that is not
   negative; but the largest part of each label stays. */
static void txs_clean_labels(const txs_cleaner *c, size_t least, int transition) {
    const size_t pixels = (size_t)c->width * (size_t)c->height;
    size_t largest[256] = {0}, keep[256] = {0};
    memset(c->seen, 0, pixels);
    for (size_t i = 0; i < pixels; i++) {
        if (c->seen[i]) continue;
        const size_t count = txs_find_part(c, i);
        if (count <= largest[c->label[i]]) continue;
        largest[c->label[i]] = count;
        keep[c->label[i]] = i;
    }
    memset(c->seen, 0, pixels);
    for (size_t i = 0; i < pixels; i++) {
        if (c->seen[i]) continue;
        const size_t count = txs_find_part(c, i);
        if (count >= least || keep[c->label[i]] == i) continue;
        const int label = transition >= 0 ? transition : txs_label_around(c, count);
        for (size_t k = 0; k < count; k++) c->label[c->part[k]] = (uint8_t)label;
    }
}

/* With a transition class: what no square of 2 TXS_REACH + 1 pixels of its label covers becomes a
   transition, unless nothing would be left of the label. share: a plane. */
static void txs_mark_thin(txs_refiner *r, int label, uint8_t transition) {
    const txs_scene *s = r->scene;
    size_t left = 0;
    r->reach = TXS_REACH;
    txs_share_label(r, label);
    uint8_t *share = r->share + (size_t)label * s->pixels;
    for (size_t i = 0; i < s->pixels; i++)
        share[i] = (uint8_t)(s->counted[i] && share[i] == r->counted_around[i]);
    /* the squares' centres, widened to the squares: in columns, then in rows */
    for (int pass = 0; pass < 2; pass++) {
        const int lines = pass ? s->height : s->width, length = pass ? s->width : s->height;
        const size_t by = pass ? 1 : (size_t)s->width, next = pass ? (size_t)s->width : 1;
        for (int k = 0; k < lines; k++) {
            uint8_t *line = share + (size_t)k * next;
            int last = -1;
            for (int i = 0; i < length; i++) {
                if (line[(size_t)i * by] & 1) last = i;
                if (last >= 0 && i - last <= TXS_REACH) line[(size_t)i * by] |= 2;
            }
            last = -1;
            for (int i = length - 1; i >= 0; i--) {
                if (line[(size_t)i * by] & 1) last = i;
                if (last >= 0 && last - i <= TXS_REACH) line[(size_t)i * by] |= 2;
            }
            for (int i = 0; i < length; i++) line[(size_t)i * by] >>= 1;
        }
    }
    for (size_t i = 0; i < s->pixels; i++) left += r->label[i] == label && share[i];
    for (size_t i = 0; i < s->pixels && left; i++)
        if (r->label[i] == label && !share[i]) r->label[i] = transition;
}

/* ---- labels of the picture ------------------------------------------------------------------ */

/* The label at a pixel of the picture: a vote of the nine pixels of the scene around it, with the
   weights of a quadratic spline, which makes smooth boundaries of steps. */
static uint8_t txs_vote(const txs_scene *s, const uint8_t *label, int x, int y) {
    const int f = s->factor, at[2] = {x / f, y / f};
    const int off[2] = {2 * (x % f) + 1 - f, 2 * (y % f) + 1 - f}; /* of 2 f */
    uint8_t found[9];
    int64_t weight[9];
    int best = 0, same = 1;
    for (int k = 0; k < 9; k++) {
        const int u = txm_clampi(at[0] + k % 3 - 1, 0, s->width - 1);
        const int v = txm_clampi(at[1] + k / 3 - 1, 0, s->height - 1);
        int64_t w = 1;
        for (int c = 0; c < 2; c++) {
            const int64_t side = (c ? k / 3 : k % 3) - 1, a = off[c];
            w *= side ? (f + side * a) * (f + side * a) : 6 * (int64_t)f * f - 2 * a * a;
        }
        found[k] = label[(size_t)v * (size_t)s->width + (size_t)u];
        weight[k] = w;
        same &= found[k] == found[0];
    }
    if (same) return found[0];
    for (int k = 0; k < 9; k++) {
        for (int j = 0; j < k; j++) {
            if (found[j] != found[k]) continue;
            weight[j] += weight[k]; /* the first of a label counts for all */
            weight[k] = 0;
            break;
        }
    }
    for (int k = 1; k < 9; k++)
        if (weight[k] > weight[best] || (weight[k] == weight[best] && found[k] < found[best]))
            best = k;
    return found[best];
}

#endif /* TEXSYN_LABELS_H */
