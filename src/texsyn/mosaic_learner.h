#ifndef TEXSYN_MOSAIC_LEARNER_H
#define TEXSYN_MOSAIC_LEARNER_H

#include "mosaic_sampler.h"
#include "neighbourhood.h"

/* ---- learning a mosaic -------------------------------------------------------------------

   Greedy selection of clique types on one level as in neighbourhood.h, for all labels at once and
   for the crossings of their borders. Targets are measured at the source pixels of one mosaic, what
   was synthesised at the free pixels of another (or of the same). Crossings may be measured in a
   mosaic of their own.                                                                      */

typedef struct txs_study_plan {
    int first, between, last; /* sweeps: at first, after each batch of types, at the end   */
    int types, batch;         /* added for each label, at once                             */
    int reach;                /* of pairs, in pixels of the level                          */
    int refresh, softness;    /* of the sampler */
    int crosses;              /* non-zero: crossing types as well                          */
    uint64_t seed;
    const int16_t *noise, *last_noise; /* the latter of the last sweep                     */
    const txs_mosaic *border; /* where crossings are measured instead of in the source, or NULL */
} txs_study_plan;

/* A crossing type that could be added. */
typedef struct txs_cross_candidate {
    txs_crossing crossing;
    float weight, noise, distance; /* as of txs_candidate */
} txs_cross_candidate;

typedef struct txs_study {
    const txs_study_plan *plan;
    const txs_mosaic *source, *canvas;
    int index;            /* of the level    */
    int now;              /* label that is measured */
    texsyn_model **model; /* of each label */
    txs_texture texture[TXS_MAX_LABELS];
    txs_learner learner[TXS_MAX_LABELS];
    txs_pixels tails[TXS_MAX_LABELS];      /* of the source, TXS_TAILS at most  */
    txs_pixels free_tails[TXS_MAX_LABELS]; /* of the canvas                     */
    const txs_mosaic *border;              /* where crossings are measured      */
    txs_pixels border_tails[TXS_MAX_LABELS];
    txs_crossing *crossing;
    int crossings;
    txs_cross_candidate *cross;
    int cross_count;
} txs_study;

enum {
    TXS_TAILS = 12000,    /* cliques counted of each type: as many as matter */
    TXS_PRESELECTED = 32, /* types of a label at most, see txs_study_preselect */
    TXS_CROSS_REACH = 5,  /* pixels, between the first bands; ours, by trial */
    TXS_CROSS_BATCH = 4   /* crossing types added for each pair of labels at once */
};

/* ---- measuring ------------------------------------------------------------------------ */

static void txs_normalise(const uint32_t *h, int64_t total, int32_t share[TXS_BINS]) {
    for (int i = 0; i < TXS_BINS; i++)
        share[i] = total ? (int32_t)(((int64_t)h[i] * TXS_ONE + total / 2) / total) : 0;
}

static int txs_is_tail_at(const txs_mosaic *m, const txs_type *t, int32_t at) {
    const int x = (int)(at % m->canvas.stride) - m->canvas.margin;
    const int y = (int)(at / m->canvas.stride) - m->canvas.margin;
    return txs_is_tail(t, x & 1, y & 1);
}

/* Does the type say something of colours only, and are some of them hidden in this mosaic? */
static int txs_is_weighed(const txs_mosaic *m, const texsyn_model *model, const txs_type *t) {
    return m->weight && !txs_is_alpha(model, t->band) && !txs_is_alpha(model, t->other);
}

/* Histogram of a clique type of colours over source pixels: a clique counts with the least weight of
   its members. Returns the number of cliques. */
static int64_t txs_study_weigh(const txs_mosaic *m, const txs_pixels *tails, int label,
                               const txs_level *level, const txs_type *t, int32_t share[TXS_BINS]) {
    const txs_tally y = txs_tally_make(t, level, &m->canvas, m->bands);
    const txs_guard guard = txs_guard_make(m, t, label, 0, m->sample);
    int at[4][2], drawn = txs_members(t, at);
    uint32_t h[TXS_BINS];
    int64_t total = 0;
    if (t->kind == TEXSYN_SCALE) drawn = 2; /* the others are of the coarser level */
    memset(h, 0, sizeof h);
    for (int i = 0; i < tails->count; i++) {
        const uint8_t *p = m->canvas.pixels + tails->at[i];
        if (!txs_holds(&guard, p) || (t->phase && !txs_is_tail_at(m, t, tails->at[i]))) continue;
        uint32_t least = TXS_OPAQUE;
        for (int k = 0; k < drawn; k++) {
            const uint32_t weight = p[m->weight + at[k][1] * m->canvas.stride + at[k][0]];
            least = weight < least ? weight : least;
        }
        h[txs_bin(&y, p)] += txs_counts_of(least);
        total += txs_counts_of(least);
    }
    txs_normalise(h, total, share);
    return (total + TXS_OPAQUE - 1) / TXS_OPAQUE;
}

/* Histogram of a clique type over its tails, whose label is asked of the plane `labels`. Returns the
   number of cliques. */
static int64_t txs_study_measure(const txs_mosaic *m, ptrdiff_t labels, const txs_pixels *tails,
                                 int label, const txs_level *level, const txs_type *t,
                                 int32_t share[TXS_BINS]) {
    const txs_tally y = txs_tally_make(t, level, &m->canvas, m->bands);
    const txs_guard guard = txs_guard_make(m, t, label, 0, labels);
    const uint8_t *base = m->canvas.pixels;
    uint32_t h[TXS_BINS];
    int64_t total = 0;
    int i = 0;
    memset(h, 0, sizeof h);
    if (t->phase) {
        for (; i < tails->pure; i++)
            if (txs_is_tail_at(m, t, tails->at[i])) h[txs_bin(&y, base + tails->at[i])]++;
    } else if (y.form == 1) {
        for (; i < tails->pure; i++) h[base[tails->at[i] + y.a] - base[tails->at[i] + y.b] + 31]++;
    } else if (y.form == 2) {
        for (; i < tails->pure; i++)
            h[y.ca[base[tails->at[i] + y.a]] * TXS_CLASSES + y.cb[base[tails->at[i] + y.b]]]++;
    } else {
        for (; i < tails->pure; i++) h[txs_bin(&y, base + tails->at[i])]++;
    }
    for (; i < tails->count; i++) {
        const uint8_t *p = base + tails->at[i];
        if (txs_holds(&guard, p) && (!t->phase || txs_is_tail_at(m, t, tails->at[i])))
            h[txs_bin(&y, p)]++;
    }
    for (i = 0; i < TXS_BINS; i++) total += h[i];
    txs_normalise(h, total, share);
    return total;
}

/* The same of source pixels, and of colours that are visible. */
static int64_t txs_study_target(const txs_study *s, int label, const txs_type *t,
                                int32_t share[TXS_BINS]) {
    const txs_level *level = &s->model[label]->level[s->index];
    const txs_pixels *tails = &s->tails[label];
    if (txs_is_weighed(s->source, s->model[label], t)) {
        const int64_t n = txs_study_weigh(s->source, tails, label, level, t, share);
        if (n || t->kind != TEXSYN_SINGLE) return n;
        /* no tail is visible; what they have borrowed will do, since there must be a histogram */
    }
    return txs_study_measure(s->source, s->source->sample, tails, label, level, t, share);
}

/* The same of a crossing type. Colours are counted where they are visible. */
static int64_t txs_study_measure_crossing(const txs_study *s, const txs_mosaic *m, ptrdiff_t labels,
                                          const txs_pixels *tails, const txs_crossing *c,
                                          int32_t share[TXS_BINS]) {
    const txs_type *t = &c->type;
    const ptrdiff_t d = t->dy * m->canvas.stride + t->dx, plane = m->canvas.plane;
    const uint8_t *tail = s->texture[c->tail].level->classes[t->band];
    const uint8_t *head = s->texture[c->head].level->classes[t->other];
    const int is_weighed = m->weight && labels == m->sample;
    const int tail_is_colour = is_weighed && !txs_is_alpha(s->model[c->tail], t->band);
    const int head_is_colour = is_weighed && !txs_is_alpha(s->model[c->head], t->other);
    uint32_t h[TXS_BINS];
    int64_t total = 0;
    memset(h, 0, sizeof h);
    for (int i = tails->pure; i < tails->count; i++) {
        const uint8_t *p = m->canvas.pixels + tails->at[i], *q = p + d;
        if (q[labels] != c->head || (tail_is_colour && !p[m->weight]) ||
            (head_is_colour && !q[m->weight]))
            continue;
        h[tail[p[t->band * plane]] * TXS_CLASSES + head[q[t->other * plane]]]++;
        total++;
    }
    txs_normalise(h, total, share);
    return total;
}

/* ---- tails ---------------------------------------------------------------------------- */

/* Is the pixel one that tails lie at: a source pixel, or a free one? */
static int txs_is_tail_of(const txs_mosaic *m, ptrdiff_t labels, int label, int x, int y) {
    if (txs_pixel(m, x, y)[labels] != label) return 0;
    return labels == m->sample || txs_is_free(m, x, y);
}

/* Evenly spread tails of a label, TXS_TAILS at most of either purity; tails->at has room for twice
   as many. */
static void txs_tails_find(const txs_mosaic *m, ptrdiff_t labels, int label, const uint8_t *purity,
                           txs_pixels *tails) {
    const int width = m->canvas.width, height = m->canvas.height;
    tails->count = tails->pure = 0;
    for (int pure = 1; pure >= 0; pure--) {
        int64_t found = 0, seen = 0;
        for (int pass = 0; pass < (found ? 2 : 1); pass++) {
            for (int y = 0; y < height; y++) {
                for (int x = 0; x < width; x++) {
                    if (purity[(size_t)y * (size_t)width + (size_t)x] != pure ||
                        !txs_is_tail_of(m, labels, label, x, y))
                        continue;
                    if (!pass) {
                        found++;
                        continue;
                    }
                    const int64_t wanted = found < TXS_TAILS ? found : (int)TXS_TAILS;
                    if (seen * wanted / found != (seen + 1) * wanted / found)
                        tails->at[tails->count++] = (int32_t)txs_pixel_offset(m, x, y);
                    seen++;
                }
            }
        }
        if (pure) tails->pure = tails->count;
    }
    TEXSYN_ASSERT(tails->count <= 2 * TXS_TAILS);
}

/* Room for the tails of all labels, and what they are; 0 if there is no memory. */
static int txs_tails_make(txm_arena *arena, const txs_mosaic *m, ptrdiff_t labels, int reach,
                          txs_pixels *tails) {
    const size_t width = (size_t)m->canvas.width, height = (size_t)m->canvas.height;
    size_t room = width * height < TXS_TAILS ? width * height : (size_t)TXS_TAILS;
    uint8_t *purity = (uint8_t *)txm_arena_alloc(arena, width, height);
    int *columns = (int *)txm_arena_alloc(arena, width, sizeof *columns);
    for (int k = 0; k < m->labels; k++)
        tails[k].at = (int32_t *)txm_arena_alloc(arena, 2 * room, sizeof *tails[k].at);
    if (arena->failed) return 0;
    txs_find_pure(m, labels, reach, purity, columns);
    for (int k = 0; k < m->labels; k++) txs_tails_find(m, labels, k, purity, &tails[k]);
    return 1;
}

/* ---- the clique types of a label ------------------------------------------------------ */

/* The preselected clique types, as txs_preselect has them; those that the source does not contain
   are left out. */
static void txs_study_preselect(txs_study *s, int label) {
    texsyn_model *model = s->model[label];
    txs_level *level = &model->level[s->index];
    const int bands = model->bands, has_parents = s->source->parent != 0;
    int kept = bands;
    level->type_count = 0;
    for (int b = 0; b < bands; b++) {
        txs_type *t = txs_add_type(level, TEXSYN_SINGLE, b, b, 0, 0);
        txs_study_target(s, label, t, t->share);
        txs_make_classes(model, level, b);
    }
    for (int b = 0; b < bands; b++) {
        for (int phase = has_parents; phase <= 2 * has_parents; phase++) {
            txs_add_type(level, TEXSYN_PAIR, b, b, 1, 0)->phase = phase;
            txs_add_type(level, TEXSYN_PAIR, b, b, 0, 1)->phase = phase;
        }
        if (has_parents) txs_add_type(level, TEXSYN_PARENT, b, b, 0, 0);
        for (int o = b + 1; o < bands; o++) txs_add_type(level, TEXSYN_VALUES, b, o, 0, 0);
    }
    for (int k = bands; k < level->type_count; k++) {
        txs_type t = level->types[k];
        if (txs_study_target(s, label, &t, t.share) > 0) level->types[kept++] = t;
    }
    level->type_count = kept;
    TEXSYN_ASSERT(kept <= TXS_PRESELECTED);
}

/* Would two members of a clique be drawn together, being of one sub-lattice? */
static int txs_draws_together(const txs_type *t) {
    int at[4][2], n = t->kind == TEXSYN_SCALE ? 2 : txs_members(t, at);
    txs_members(t, at);
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < i; j++) {
            const int x = at[i][0] - at[j][0], y = at[i][1] - at[j][1];
            if ((x || y) && x % TXS_GRID == 0 && y % TXS_GRID == 0) return 1;
        }
    }
    return 0;
}

/* The candidates of a label: those of neighbourhood.h that a mosaic knows. */
static void txs_study_list(txs_study *s, int label) {
    txs_learner *a = &s->learner[label];
    float seen[TXS_MAX_BANDS];
    int kept = 0;
    for (int b = 0; b < a->model->bands; b++) seen[b] = txs_visibility(a->level, b);
    txs_list_candidates(a, s->plan->reach, seen);
    for (int i = 0; i < a->candidate_count; i++)
        if (txs_mosaic_knows(s->source, &a->candidates[i].type) &&
            !txs_draws_together(&a->candidates[i].type))
            a->candidates[kept++] = a->candidates[i];
    a->candidate_count = kept;
}

/* Parallel bodies: measure a candidate in the source, on the canvas. */
static void txs_study_source(void *context, int i) {
    txs_study *s = (txs_study *)context;
    txs_learner *a = &s->learner[s->now];
    txs_candidate *c = &a->candidates[i];
    const int64_t n = txs_study_target(s, s->now, &c->type, c->type.share);
    const int64_t m = s->free_tails[s->now].count + 1;
    c->noise = n ? txm_float(sqrt(1.0 / (double)n + 1.0 / (double)m)) : 0;
    if (!n) c->weight = 0;
}

static void txs_study_canvas(void *context, int i) {
    txs_study *s = (txs_study *)context;
    txs_learner *a = &s->learner[s->now];
    txs_candidate *c = &a->candidates[i];
    int32_t share[TXS_BINS];
    const int64_t n = txs_study_measure(s->canvas, s->canvas->label, &s->free_tails[s->now], s->now,
                                        a->level, &c->type, share);
    c->distance = n ? txs_distance(share, c->type.share) : 0;
}

/* ---- crossing types ------------------------------------------------------------------- */

static void txs_cross_add(txs_study *s, int tail, int head, int band, int other, int dx, int dy,
                          int capacity) {
    if (s->cross_count == capacity) return;
    txs_cross_candidate *c = &s->cross[s->cross_count++];
    memset(c, 0, sizeof *c);
    c->crossing.tail = tail;
    c->crossing.head = head;
    c->crossing.type.kind = TEXSYN_VALUES;
    c->crossing.type.band = band;
    c->crossing.type.other = other;
    c->crossing.type.dx = dx;
    c->crossing.type.dy = dy;
    c->weight = 1;
}

/* Within this distance are the candidates of a pair of bands. */
static int txs_cross_reach(int band, int other) {
    return band == 0 && other == 0 ? TXS_CROSS_REACH : 1;
}

/* All candidates of all pairs of labels; returns how many there can be. With no room only counts. */
static int txs_cross_list(txs_study *s, int capacity) {
    int count = 0;
    s->cross_count = 0;
    for (int k = 0; k < s->source->labels; k++) {
        for (int l = k + 1; l < s->source->labels; l++) {
            for (int b = 0; b < s->model[k]->bands; b++) {
                for (int o = 0; o < s->model[l]->bands; o++) {
                    const int r = txs_cross_reach(b, o);
                    for (int y = -r; y <= r; y++) {
                        for (int x = -r; x <= r; x++) {
                            if (x * x + y * y > r * r || (!x && !y)) continue;
                            count++;
                            txs_cross_add(s, k, l, b, o, x, y, capacity);
                        }
                    }
                }
            }
        }
    }
    return count;
}

static void txs_cross_source(void *context, int i) {
    txs_study *s = (txs_study *)context;
    txs_cross_candidate *c = &s->cross[i];
    const int64_t n =
        txs_study_measure_crossing(s, s->border, s->border->sample,
                                   &s->border_tails[c->crossing.tail], &c->crossing,
                                   c->crossing.type.share);
    enum { FEW = 30 }; /* cliques: less is no statistic */
    c->noise = n ? txm_float(sqrt(2.0 / (double)n)) : 0;
    if (n < FEW) c->weight = 0;
}

static void txs_cross_canvas(void *context, int i) {
    txs_study *s = (txs_study *)context;
    txs_cross_candidate *c = &s->cross[i];
    int32_t share[TXS_BINS];
    const int64_t n = txs_study_measure_crossing(
        s, s->canvas, s->canvas->label, &s->free_tails[c->crossing.tail], &c->crossing, share);
    c->distance = n ? txs_distance(share, c->crossing.type.share) : 0;
}

/* Take candidate i into the level. */
static void txs_cross_take(txs_study *s, int i) {
    if (s->crossings == TXS_MAX_CROSSINGS) return;
    s->crossing[s->crossings++] = s->cross[i].crossing;
    s->cross[i] = s->cross[--s->cross_count];
}

/* The preselected crossing types: the four neighbours, in each band. */
static void txs_cross_preselect(txs_study *s) {
    for (int i = s->cross_count - 1; i >= 0; i--) {
        const txs_cross_candidate *c = &s->cross[i];
        const txs_type *t = &c->crossing.type;
        if (c->weight > 0 && t->band == t->other && abs(t->dx) + abs(t->dy) == 1)
            txs_cross_take(s, i);
    }
}

/* The worst types of a pair of labels; returns how many. */
static int txs_cross_add_worst(txs_study *s, int tail, int head) {
    int added = 0;
    for (; added < TXS_CROSS_BATCH; added++) {
        int worst = -1;
        for (int i = 0; i < s->cross_count; i++) {
            const txs_cross_candidate *c = &s->cross[i];
            if (c->crossing.tail != tail || c->crossing.head != head || c->weight <= 0 ||
                !(c->distance > TXS_NOISE_SHARE * c->noise))
                continue;
            if (worst < 0 || c->distance > s->cross[worst].distance) worst = i;
        }
        if (worst < 0 || s->crossings == TXS_MAX_CROSSINGS) break;
        txs_cross_take(s, worst);
    }
    return added;
}

/* ---- a level -------------------------------------------------------------------------- */

/* Prepare everything that does not change while types are added. */
static txm_status txs_study_begin(txs_study *s, txm_arena *arena, txm_env *env) {
    const int labels = s->source->labels, reach = s->plan->reach;
    for (int k = 0; k < labels; k++) {
        txs_learner *a = &s->learner[k];
        s->texture[k].model = s->model[k];
        s->texture[k].level = &s->model[k]->level[s->index];
        memset(a, 0, sizeof *a);
        a->model = s->model[k];
        a->index = s->source->parent ? s->index : s->model[k]->levels - 1;
        a->level = &s->model[k]->level[s->index];
        a->capacity = (2 * reach + 1) * (2 * reach + 1) * s->model[k]->bands + 400;
        a->candidates =
            (txs_candidate *)txm_arena_alloc(arena, (size_t)a->capacity, sizeof *a->candidates);
    }
    s->crossing = (txs_crossing *)txm_arena_zero(arena, TXS_MAX_CROSSINGS, sizeof *s->crossing);
    const int crosses = s->plan->crosses ? txs_cross_list(s, 0) : 0;
    if (crosses)
        s->cross = (txs_cross_candidate *)txm_arena_alloc(arena, (size_t)crosses, sizeof *s->cross);
    if (arena->failed || !txs_tails_make(arena, s->source, s->source->sample, reach, s->tails) ||
        !txs_tails_make(arena, s->canvas, s->canvas->label, reach, s->free_tails) ||
        (s->plan->border &&
         !txs_tails_make(arena, s->border, s->border->sample, reach, s->border_tails)))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to learn from the picture");
    for (int k = 0; k < labels && !s->plan->border; k++) s->border_tails[k] = s->tails[k];
    for (int k = 0; k < labels; k++) {
        s->now = k;
        txs_study_preselect(s, k);
        txs_study_list(s, k);
        txm_parallel_for(env, s->learner[k].candidate_count, txs_study_source, s);
    }
    if (crosses) {
        txs_cross_list(s, crosses);
        txm_parallel_for(env, s->cross_count, txs_cross_source, s);
        txs_cross_preselect(s);
    }
    return TXM_OK;
}

/* Add the worst types of all labels and pairs of labels, `left` for each label at most; returns how
   many. */
static int txs_study_add(txs_study *s, int left, txm_env *env) {
    const int labels = s->source->labels, batch = left < s->plan->batch ? left : s->plan->batch;
    int added = 0;
    for (int k = 0; k < labels; k++) {
        s->now = k;
        txm_parallel_for(env, s->learner[k].candidate_count, txs_study_canvas, s);
        added += txs_add_worst(&s->learner[k], batch, TXS_THRESHOLD);
    }
    if (!s->plan->crosses) return added;
    txm_parallel_for(env, s->cross_count, txs_cross_canvas, s);
    for (int k = 0; k < labels; k++)
        for (int l = k + 1; l < labels; l++) added += txs_cross_add_worst(s, k, l);
    return added;
}

/* The mean of the controlled potentials over some sweeps is what a model keeps. */
static void txs_study_keep(txs_study *s, const txs_brush *brush, int64_t (*sum)[TXS_BINS],
                           int sweeps) {
    const int labels = s->source->labels;
    for (int k = 0; k < labels; k++)
        txs_keep_potentials(&s->model[k]->level[s->index], sum + brush->base[k], sweeps);
    for (int i = 0; i < s->crossings; i++) {
        txs_level one; /* a level of this type only */
        memset(&one, 0, sizeof one);
        one.types = &s->crossing[i].type;
        one.type_count = 1;
        txs_keep_potentials(&one, sum + brush->base[labels] + i, sweeps);
    }
}

/* The rounds of synthesis and of adding types, then the last sweeps. Fraction from..to of the whole. */
static txm_status txs_study_run(txs_study *s, txs_brush *brush, int64_t (*sum)[TXS_BINS],
                                txm_env *env, float from, float to) {
    const txs_study_plan *plan = s->plan;
    const int rounds = (plan->types + plan->batch - 1) / plan->batch;
    const int kept = (plan->last + 1) / 2; /* of the last sweeps, half make the potentials */
    const float sweep =
        (to - from) / (float)(plan->first + rounds * (plan->between + 2) + plan->last);
    int left = plan->types, sweeps = plan->first;
    txm_status status;
    for (;;) { /* what was synthesised so far, and its potentials, are kept */
        brush->crossings = s->crossings;
        txs_brush_start(brush);
        for (int i = 0; i < sweeps; i++, from += sweep)
            if ((status = txs_brush_sweep(brush, env, "learn", from, from + sweep)) != TXM_OK)
                return status;
        if (left <= 0 || !txs_study_add(s, left, env)) break;
        left -= plan->batch;
        sweeps = plan->between;
        from += 2 * sweep; /* about what the measuring takes */
    }
    for (int i = 0; i < plan->last; i++, from += sweep) {
        if (i + 1 == plan->last && plan->last_noise) brush->noise = plan->last_noise;
        if ((status = txs_brush_sweep(brush, env, "learn", from, from + sweep)) != TXM_OK)
            return status;
        for (int k = 0; k < brush->active_count && i >= plan->last - kept; k++)
            for (int j = 0; j < TXS_BINS; j++)
                sum[brush->active[k]][j] += brush->integral[brush->active[k]][j];
    }
    txs_study_keep(s, brush, sum, kept);
    return TXM_OK;
}

/* Learn level `index` of the models, one for each label, whose bands and quantisation are set and
   whose level has room for TXS_MAX_TYPES types. The source and the canvas have been laid (and
   raised); the latter's free pixels are synthesised. Crossing types go to crossing[], room for
   TXS_MAX_CROSSINGS of them, and *crossings, unless these are NULL. Fraction from..to of the
   whole. */
static txm_status txs_mosaic_learn(const txs_study_plan *plan, int index, texsyn_model **model,
                                   const txs_mosaic *source, txs_mosaic *canvas,
                                   txs_crossing *crossing, int *crossings, txm_env *env, float from,
                                   float to) {
    const txs_brush_plan brush_plan = {TXS_PRESELECTED + plan->types,
                                       plan->crosses ? (int)TXS_MAX_CROSSINGS : 0, plan->refresh,
                                       plan->softness, plan->seed};
    const size_t places =
        (size_t)(canvas->labels * brush_plan.max_types + brush_plan.max_crossings);
    txm_status status = TXM_OUT_OF_MEMORY;
    txm_arena arena;
    txm_arena_init(&arena, env);
    txs_study *s = (txs_study *)txm_arena_zero(&arena, 1, sizeof *s);
    if (s) {
        s->plan = plan;
        s->source = source;
        s->canvas = canvas;
        s->border = plan->border ? plan->border : source;
        s->index = index;
        s->model = model;
        status = txs_study_begin(s, &arena, env);
    }
    if (status == TXM_OK) {
        txs_brush *brush = txs_brush_make(&arena, canvas, s->texture, &brush_plan, plan->noise);
        int64_t(*sum)[TXS_BINS] = (int64_t(*)[TXS_BINS])txm_arena_zero(&arena, places, sizeof *sum);
        status = TXM_OUT_OF_MEMORY;
        if (!arena.failed) {
            brush->crossing = s->crossing;
            status = txs_study_run(s, brush, sum, env, from, to);
        }
    }
    if (status == TXM_OK && crossing) {
        memcpy(crossing, s->crossing, sizeof *crossing * (size_t)s->crossings);
        *crossings = s->crossings;
    }
    if (status == TXM_OUT_OF_MEMORY) txm_fail(env, status, "no memory to learn from the picture");
    txm_arena_free(&arena);
    return status;
}

/* Synthesise the free pixels of a canvas, which has been laid (and raised), with models that are
   known. */
static txm_status txs_mosaic_run(txs_mosaic *canvas, const txs_texture *texture,
                                 const txs_brush_plan *plan, const txs_crossing *crossing,
                                 int crossings, int sweeps, const int16_t *noise,
                                 const int16_t *last_noise, txm_env *env, float from, float to) {
    txm_status status = TXM_OK;
    txm_arena arena;
    txm_arena_init(&arena, env);
    txs_brush *brush = txs_brush_make(&arena, canvas, texture, plan, noise);
    if (!brush) {
        txm_arena_free(&arena);
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to synthesise");
    }
    brush->crossing = crossing;
    brush->crossings = crossings;
    txs_brush_reset(brush);
    txs_brush_start(brush);
    for (int i = 0; i < sweeps && status == TXM_OK; i++) {
        const float at = from + (to - from) * (float)i / (float)sweeps;
        if (i + 1 == sweeps && last_noise) brush->noise = last_noise;
        status = txs_brush_sweep(brush, env, "synthesise", at,
                                 from + (to - from) * (float)(i + 1) / (float)sweeps);
    }
    txm_arena_free(&arena);
    return status;
}

#endif /* TEXSYN_MOSAIC_LEARNER_H */
