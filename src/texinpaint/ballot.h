#ifndef TEXINPAINT_BALLOT_H
#define TEXINPAINT_BALLOT_H

#include "search.h"

/* ---- votes --------------------------------------------------------------------------------------

   Each hole pixel is covered by up to 64 patches, whose matches propose a colour. Their weighted
   mean is found, once more with smaller weights for those far from it, and then not the mean but
   the proposal nearest to it is taken, so that nothing is averaged.                           */

enum {
    TXI_WEIGHT_ONE = 4095, /* largest weight of a match                                       */
    TXI_OUTLIER_BINS = 2048,
    TXI_BALLOT_SCRATCH = 3
};

/* Weights exp(-cost / (2 s)) exp(-fade * depth), s = 0.2 times the 75th percentile of the costs. */
static void txi_weigh(txi_canvas *t, double fade, txm_pair *pairs, txm_pair *scratch) {
    const txi_level *l = t->level;
    const size_t n = (size_t)l->anchor_count;
    for (size_t a = 0; a < n; a++) {
        pairs[a].key = t->match[a].cost;
        pairs[a].value = (uint32_t)a;
    }
    txm_sort_pairs(pairs, scratch, n);
    const size_t percentile = n - 1 - (n - 1) / 4;
    const double s = 0.2 * pairs[percentile].key + 1;
    for (size_t a = 0; a < n; a++) {
        const int centre = l->anchor[a] + (TXI_PATCH / 2) * (l->width + 1);
        const double x = t->match[a].cost / (2 * s) + fade * l->depth[centre];
        const double w = x > 12 ? 0 : (double)TXI_WEIGHT_ONE * txm_exp2(-x * TXI_LOG2_E);
        t->weight[a] = (uint16_t)(1 + (int)w);
    }
}

/* What all pixels of a vote share. */
typedef struct txi_ballot {
    txi_canvas *canvas;
    int pull;        /* strength of the plan's strips, 0..256                         */
    uint32_t *scratch; /* TXI_BALLOT_SCRATCH per pixel of the level                         */
    const uint16_t *outlier; /* 4095 (d / 16 + 1)^-0.6 for d = 96 k, a squared distance       */
} txi_ballot;

static void txi_outlier_table(uint16_t *table) {
    for (int k = 0; k < TXI_OUTLIER_BINS; k++)
        table[k] = (uint16_t)(1 + (int)(4094 * pow(1 + 96.0 * k / 16, -0.6)));
}

/* A proposal for a pixel. */
typedef struct txi_proposal {
    const uint8_t *color;
    int anchor;
} txi_proposal;

/* the proposals for pixel p; returns their number */
static int txi_proposals(const txi_canvas *t, int p, txi_proposal *list) {
    const txi_level *l = t->level;
    int count = 0;
    for (int y = 0; y < TXI_PATCH; y++) {
        const int32_t *row = l->slot + p - y * l->width;
        for (int x = 0; x < TXI_PATCH; x++) {
            const int a = row[-x];
            if (a < 0 || t->match[a].pose < 0) continue;
            const txi_match *m = &t->match[a];
            const txi_source *s = &l->source[m->pose];
            list[count].color =
                s->color + 4 * ((size_t)(m->y + y) * (size_t)s->width + (size_t)(m->x + x));
            TXM_ASSERT(count < TXI_PATCH_AREA);
            list[count++].anchor = a;
        }
    }
    return count;
}

static int txi_color_distance(const uint8_t *a, const int *b) {
    const int r = a[0] - b[0], g = a[1] - b[1], u = a[2] - b[2];
    return r * r + g * g + u * u;
}

static int txi_vote_pixel(const txi_ballot *v, int p) {
    const txi_canvas *t = v->canvas;
    txi_proposal list[TXI_PATCH_AREA];
    const int n = txi_proposals(t, p, list);
    if (n <= 0) return -1;
    int mean[3] = {0, 0, 0};
    for (int pass = 0; pass < 2; pass++) {
        uint64_t sum[3] = {0, 0, 0}, total = 0;
        for (int k = 0; k < n; k++) {
            uint32_t w = t->weight[list[k].anchor];
            if (pass) {
                const int bin = txi_color_distance(list[k].color, mean) / 96;
                w *= v->outlier[bin < TXI_OUTLIER_BINS ? bin : TXI_OUTLIER_BINS - 1];
            }
            total += w;
            for (int c = 0; c < 3; c++) sum[c] += (uint64_t)w * list[k].color[c];
        }
        if (total == 0) return -1; /* not so: no weight is 0 */
        for (int c = 0; c < 3; c++) mean[c] = (int)((sum[c] + total / 2) / total);
    }
    const int pull = t->level->pull ? t->level->pull[p] * v->pull / 256 : 0;
    const uint8_t *strip = pull ? t->level->strip + 4 * (size_t)p : NULL;
    uint8_t *out = t->color + 4 * (size_t)p;
    for (int c = 0; c < 3 && pull; c++) mean[c] += (strip[c] - mean[c]) * pull / 255;
    int64_t best = INT64_MAX;
    int chosen = -1;
    for (int k = 0; k < n; k++) {
        /* in tenths: 10 d^2 + cost per pixel */
        const int64_t d = (int64_t)10 * txi_color_distance(list[k].color, mean) +
                          t->match[list[k].anchor].cost / TXI_PATCH_AREA;
        if (d >= best) continue;
        best = d;
        chosen = list[k].anchor;
        memcpy(out, list[k].color, 3);
    }
    if (pull >= 128) memcpy(out, strip, 3); /* the strip itself */
    return chosen;
}

static void txi_vote_band(void *context, int index) {
    const txi_ballot *v = (const txi_ballot *)context;
    const txi_level *l = v->canvas->level;
    const int from = txm_clampi(index * TXI_BAND, 0, l->height);
    const int to = txm_clampi(index * TXI_BAND + TXI_BAND, 0, l->height);
    for (int i = l->hole_row[from]; i < l->hole_row[to]; i++) {
        const int chosen = txi_vote_pixel(v, l->hole[i]);
        v->canvas->chosen[i] = chosen;
    }
}

/* Count how often what surrounds each pixel of the level is copied. */
static void txi_count_use(const txi_ballot *v) {
    const txi_canvas *t = v->canvas;
    const txi_level *l = t->level;
    const int w = l->width, half = TXI_PATCH / 2;
    const size_t n = (size_t)w * (size_t)l->height;
    uint32_t *count = v->scratch, *sums = count + n, *columns = sums + n;
    memset(count, 0, n * sizeof *count);
    for (int i = 0; i < l->hole_count; i++) {
        if (t->chosen[i] < 0) continue;
        const txi_match *m = &t->match[t->chosen[i]];
        const int corner = l->anchor[t->chosen[i]], p = l->hole[i];
        int32_t x, y;
        txi_source_place(&l->source[m->pose], m->x + p % w - corner % w, m->y + p / w - corner / w,
                         &x, &y);
        count[(y + TXI_UNIT / 2) / TXI_UNIT * w + (x + TXI_UNIT / 2) / TXI_UNIT] += TXI_USE_ONE;
    }
    txi_patch_sums(count, w, l->height, columns, sums);
    for (int y = half; y < l->height; y++) {
        for (int x = half; x < w; x++) {
            const uint32_t use = sums[(y - half) * w + x - half] / TXI_PATCH_AREA;
            t->use[y * w + x] = (uint16_t)(use < (uint32_t)TXI_USE_MOST ? use : (uint32_t)TXI_USE_MOST);
        }
    }
}

/* Replace the hole's colours by a vote. */
static void txi_vote(txi_ballot *v, txm_env *env) {
    txm_parallel_for(env, v->canvas->level->height / TXI_BAND + 1, txi_vote_band, v);
    txi_count_use(v);
    v->canvas->fresh = 0;
}

#endif /* TEXINPAINT_BALLOT_H */
