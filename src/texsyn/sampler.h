#ifndef TEXSYN_SAMPLER_H
#define TEXSYN_SAMPLER_H

#include "filter.h"

/* ---- the sampler --------------------------------------------------------------------------

   Gibbs sampling of a canvas, which is a torus, with controlled potentials.

   Order and threads. A sweep visits one sub-lattice (x, y modulo 8) after another. The canvas is
   divided into an even number of strips at least as high as a clique; all even strips are processed
   in parallel, then all odd ones, so that no pixel changes while another thread reads it, and the
   result does not depend on the number of threads.                                          */

/* The ends of cliques at a pixel, and the clique types that have a tail there. */
typedef struct txs_list {
    txs_end ends[TXS_MAX_BANDS][TXS_MAX_ENDS]; /* sorted by form */
    int end_count[TXS_MAX_BANDS][TXS_FORMS];
    txs_tally tally[TXS_MAX_TYPES]; /* sorted by form */
    int tally_count[TXS_FORMS];
} txs_list;

typedef struct txs_sampler {
    const txs_level *level;
    const txs_canvas *canvas;
    int bands;
    uint64_t seed;
    txs_aim *aim;
    txs_pick *pick;
    txs_list list[4]; /* for pixels of each parity, (x & 1) + 2 (y & 1)   */
    int16_t single[TXS_MAX_BANDS][TXS_VALUES];
    uint8_t *tables;                /* TXS_TABLE bytes a type               */
    int32_t (*histogram)[TXS_BINS]; /* TXS_WINDOW times the counts of the last sweep */
    int32_t (*integral)[TXS_BINS];  /* 1/(TXS_NAT TXS_PRECISE) nat          */
    int32_t (*counts)[TXS_BINS];    /* TXS_TASKS times all types            */
    const int16_t *noise;
    txs_filters filters;
    int strips, tasks, skip;          /* layout; one pixel in skip is counted */
    int sublattice[TXS_GROUP], phase; /* of the pass                          */
    uint64_t pass, sweep;
} txs_sampler;

/* Set all tables from the histograms' errors; integrate as well if it is time. */
static void txs_control(txs_sampler *s, int integrate) {
    const txs_gain gain = {(int)TXS_PROPORTIONAL * TXS_WHOLE, (int)TXS_INTEGRAL * TXS_WHOLE};
    for (int k = 0; k < s->level->type_count; k++) {
        const txs_type *t = &s->level->types[k];
        int32_t v[TXS_BINS];
        txs_steer(t, gain, integrate, s->histogram[k], s->integral[k], v);
        txs_publish(s->level, t, v, s->single[t->band], s->tables + (size_t)k * TXS_TABLE);
    }
}

/* Count the cliques whose tail is p. */
static void txs_count(const txs_list *list, const uint8_t *p, int32_t (*counts)[TXS_BINS]) {
    const txs_tally *t = list->tally, *stop = t + list->tally_count[0];
    for (; t < stop; t++) counts[t->type][p[t->a]]++;
    for (stop += list->tally_count[1]; t < stop; t++) counts[t->type][p[t->a] - p[t->b] + 31]++;
    for (stop += list->tally_count[2]; t < stop; t++)
        counts[t->type][t->ca[p[t->a]] * TXS_CLASSES + t->cb[p[t->b]]]++;
    for (stop += list->tally_count[3]; t < stop; t++)
        counts[t->type]
              [txs_class(p[t->a] - p[t->b]) * TXS_CLASSES + txs_class(p[t->c] - p[t->d])]++;
    for (stop += list->tally_count[4]; t < stop; t++)
        counts[t->type][p[t->c] * TXS_CLASSES + txs_class(p[t->a] - p[t->b])]++;
}

static const txs_list *txs_list_at(const txs_sampler *s, int x, int y) {
    const int px = x + (x >= s->canvas->slip_x), py = y + (y >= s->canvas->slip_y);
    return &s->list[(px & 1) + 2 * (py & 1)];
}

static int txs_is_counted(const txs_sampler *s, int x, int y) {
    return s->skip == 1 || (unsigned)(x / TXS_GRID + 3 * (y / TXS_GRID)) % (unsigned)s->skip == 0;
}

/* Draw new values for count pixels of a row, TXS_GRID apart. No clique contains two of them
   (except across the border of a torus whose width is not a multiple of the grid), so the result
   is the same as drawing one after another; drawing them together keeps the data of an end in
   registers. */
static void txs_visit(const txs_sampler *s, int x, int y, int count, txm_rng *rng) {
    const uint8_t *rows[(TXS_MAX_ENDS + 2) * TXS_TOGETHER];
    const uint8_t *p = txs_at(s->canvas, 0, x, y);
    const txs_list *list = txs_list_at(s, x, y);
    for (int b = 0; b < s->bands; b++) {
        const txs_end *e = list->ends[b];
        const uint8_t *now = p + b * s->canvas->plane;
        int n = 0;
        for (int form = 0; form < TXS_FORMS; form++) {
            const int ends = list->end_count[b][form];
            s->aim(e, ends, form, p, count, rows + n * TXS_TOGETHER);
            e += ends;
            n += ends;
        }
        n += txs_filters_aim(&s->filters, b, x, y, count, rows + n * TXS_TOGETHER);
        int delta[TXS_TOGETHER] = {0}, any = 0;
        for (int i = 0; i < count; i++) {
            rows[n * TXS_TOGETHER + i] = txs_no_energy;
            int v = s->pick(rows + i, TXS_TOGETHER, (n + 1) & ~1, s->single[b],
                            s->noise + (txm_rng_next(rng) & (TXS_NOISE - 1)));
            if (v >= s->level->values[b]) v = s->level->values[b] - 1;
            delta[i] = v - now[i * TXS_GRID];
            any |= delta[i];
            txs_set(s->canvas, b, x + i * TXS_GRID, y, (uint8_t)v);
        }
        if (any) txs_filters_change(&s->filters, b, x, y, count, delta);
    }
}

/* One share of a pass: some of the strips of this phase, the group's sub-lattices in turn. */
static void txs_work(void *context, int task) {
    const txs_sampler *s = (const txs_sampler *)context;
    const int height = s->canvas->height, width = s->canvas->width;
    const int half = s->strips > 1 ? s->strips / 2 : 1;
    int32_t(*counts)[TXS_BINS] = s->counts + task * s->level->type_count;
    for (int i = half * task / s->tasks; i < half * (task + 1) / s->tasks; i++) {
        int strip = s->strips > 1 ? 2 * i + s->phase : 0;
        int top = (int)((int64_t)height * strip / s->strips);
        int bottom = (int)((int64_t)height * (strip + 1) / s->strips);
        for (int j = 0; j < TXS_GROUP; j++) {
            int sx = s->sublattice[j] % TXS_GRID, sy = s->sublattice[j] / TXS_GRID;
            for (int y = top + txs_mod(sy - top, TXS_GRID); y < bottom; y += TXS_GRID) {
                txm_rng rng =
                    txm_rng_make(s->seed ^ (s->pass * TXS_GROUP + (uint64_t)j) << 24, (uint64_t)y);
                for (int x = sx, n; x < width; x += n * TXS_GRID) {
                    const int stop = x < s->canvas->slip_x ? s->canvas->slip_x : width;
                    n = (stop - x + TXS_GRID - 1) / TXS_GRID; /* all of one parity */
                    if (n > TXS_TOGETHER) n = TXS_TOGETHER;
                    txs_visit(s, x, y, n, &rng);
                }
                for (int x = sx; x < width; x += TXS_GRID) {
                    if (!txs_is_counted(s, x, y)) continue;
                    txs_count(txs_list_at(s, x, y), txs_at(s->canvas, 0, x, y), counts);
                    txs_filters_count(&s->filters, x, y, counts);
                }
            }
        }
    }
}

/* Bring the counts of a pass into the running histograms, which forget at the same rate. */
static void txs_gather(txs_sampler *s, int passes) {
    const int types = s->level->type_count;
    const int64_t keep = TXS_ONE - TXS_ONE / passes;
    for (int task = 1; task < s->tasks; task++)
        for (int k = 0; k < types; k++)
            for (int i = 0; i < TXS_BINS; i++) s->counts[k][i] += s->counts[task * types + k][i];
    for (int k = 0; k < types; k++)
        for (int i = 0; i < TXS_BINS; i++)
            s->histogram[k][i] =
                (int32_t)((s->histogram[k][i] * keep) >> 16) + s->counts[k][i] * TXS_WINDOW;
    memset(s->counts, 0, sizeof *s->counts * (size_t)(types * s->tasks));
}

static const int txs_turns[4] = {0, 3, 1, 2}; /* parities of filters' tails, sweep by sweep */

/* Visit every pixel once. Progress from..to of the whole work. */
static txm_status txs_sweep(txs_sampler *s, txm_env *env, const char *stage, float from, float to) {
    enum { ALL = TXS_GRID * TXS_GRID };
    const int phases = s->strips > 1 ? 2 : 1, groups = (int)ALL / TXS_GROUP;
    int order[ALL];
    txs_filters_turn(&s->filters, env, txs_turns[s->sweep % 4], s->tables);
    txm_rng rng = txm_rng_make(s->seed, ~s->sweep++);
    for (int i = 0; i < ALL; i++) order[i] = i;
    txm_shuffle(&rng, order, ALL);
    for (int group = 0; group < groups; group++, s->pass++) {
        if (txm_progress(env, from + (to - from) * (float)group / (float)groups, stage))
            return txm_fail(env, TXM_CANCELLED, "stopped by the progress callback");
        memcpy(s->sublattice, order + group * TXS_GROUP, sizeof s->sublattice);
        /* Both phases use the same potentials: if they were updated in between, even and odd strips
           would compensate for each other and could drift apart permanently. */
        for (s->phase = 0; s->phase < phases; s->phase++)
            txm_parallel_for(env, s->tasks, txs_work, s);
        txs_gather(s, groups);
        txs_control(s, group + 1 == groups);
    }
    return TXM_OK;
}

/* Ends and tallies of the pixels with parities px, py. */
static void txs_list_fill(txs_sampler *s, int px, int py) {
    txs_list *list = &s->list[px + 2 * py];
    for (int form = 0, filled = 0; form < TXS_FORMS; form++) {
        for (int k = 0; k < s->level->type_count; k++) {
            const txs_type *t = &s->level->types[k];
            txs_tally tally = txs_tally_make(t, s->level, s->canvas, s->bands);
            txs_end ends[4];
            int band[4], forms[4],
                n = txs_type_ends(s->level, t, s->tables + (size_t)k * TXS_TABLE, s->canvas,
                                  s->bands, ends, band, forms);
            for (int i = 0; i < n; i++) {
                int *count = list->end_count[band[i]];
                /* of a pair, end 0 is the head; only pairs have a phase */
                if (forms[i] != form || !txs_is_tail(t, px - (i ? 0 : t->dx), py - (i ? 0 : t->dy)))
                    continue;
                list->ends[band[i]][count[0] + count[1] + count[2] + count[3] + count[4]] = ends[i];
                count[form]++;
            }
            if (tally.form != form || !txs_is_tail(t, px, py)) continue;
            tally.type = k;
            list->tally[filled++] = tally;
            list->tally_count[form]++;
        }
    }
}

/* Lay out the work for the level's types as they are now, and count the canvas as it is. */
static void txs_sampler_start(txs_sampler *s, txm_env *env) {
    const txs_canvas *c = s->canvas;
    const int types = s->level->type_count;
    int reach = 16; /* a strip is at least this high: less is too little work for a thread */
    for (int k = 0; k < types; k++)
        if (txs_reach(&s->level->types[k]) > reach) reach = txs_reach(&s->level->types[k]);
    memset(s->list, 0, sizeof s->list);
    for (int parity = 0; parity < 4; parity++) txs_list_fill(s, parity & 1, parity >> 1);
    const int64_t pixels = (int64_t)c->width * c->height;
    s->strips = c->height / reach & ~1;
    if (s->strips < 2) s->strips = 1;
    s->tasks = s->strips > 1 ? s->strips / 2 : 1;
    if (s->tasks > TXS_TASKS) s->tasks = TXS_TASKS;
    s->skip = pixels > TXS_SAMPLES ? (int)(pixels / TXS_SAMPLES) : 1;
    if (s->skip > 2048) s->skip = 2048; /* else txs_is_counted would find almost none */

    txs_filters_find(&s->filters);
    txs_filters_turn(&s->filters, env, txs_turns[s->sweep % 4], s->tables);
    memset(s->histogram, 0, sizeof *s->histogram * (size_t)types);
    memset(s->counts, 0, sizeof *s->counts * (size_t)(types * s->tasks));
    for (int y = 0; y < c->height; y++) {
        for (int x = 0; x < c->width; x++) {
            if (!txs_is_counted(s, x, y)) continue;
            txs_count(txs_list_at(s, x, y), txs_at(c, 0, x, y), s->histogram);
            txs_filters_count(&s->filters, x, y, s->histogram);
        }
    }
    for (int k = 0; k < types; k++)
        for (int i = 0; i < TXS_BINS; i++) s->histogram[k][i] *= TXS_WINDOW;
    txs_control(s, 0);
}

/* A sampler in the arena's memory for so many types and filters among them; NULL if there is none.
   Call txs_sampler_start before use. */
static txs_sampler *txs_sampler_make(txm_arena *arena, const txs_level *level, int max_types,
                                     int max_filters, const txs_canvas *canvas, int bands,
                                     const int16_t *noise, uint64_t seed) {
    const size_t n = (size_t)max_types;
    txs_sampler *s = (txs_sampler *)txm_arena_zero(arena, 1, sizeof *s);
    if (!s) return NULL;
    s->level = level;
    s->canvas = canvas;
    s->bands = bands;
    s->seed = txm_hash(seed);
    s->aim = txs_best_aim();
    s->pick = txs_best_pick();
    s->noise = noise;
    s->tables = (uint8_t *)txm_arena_zero(arena, n, TXS_TABLE);
    s->histogram = (int32_t(*)[TXS_BINS])txm_arena_zero(arena, n, sizeof *s->histogram);
    s->integral = (int32_t(*)[TXS_BINS])txm_arena_zero(arena, n, sizeof *s->integral);
    s->counts = (int32_t(*)[TXS_BINS])txm_arena_zero(arena, n * TXS_TASKS, sizeof *s->counts);
    txs_filters_make(&s->filters, arena, level, canvas, max_filters);
    if (arena->failed) return NULL;
    for (int k = 0; k < level->type_count; k++)
        for (int i = 0; i < TXS_BINS; i++)
            s->integral[k][i] = level->types[k].potential[i] * TXS_PRECISE;
    return s;
}

#endif /* TEXSYN_SAMPLER_H */
