#ifndef TEXSYN_SAMPLER_H
#define TEXSYN_SAMPLER_H

#include "model.h"
#include "energy.h"

/* ---- the sampler --------------------------------------------------------------------------

   Gibbs sampling of a canvas whose potentials are controlled: every potential is

       V = integral + proportional gain * (h - h_ref),

   h the current histogram of the canvas, h_ref the example's, so that the energy of values that are
   too frequent rises; the integral part follows the error once a sweep. [1] derives the potentials
   from the statistics; controlling them needs far fewer sweeps.

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
    txs_pick *pick;
    txs_list list[4]; /* for pixels of each parity, (x & 1) + 2 (y & 1)   */
    int16_t single[TXS_MAX_BANDS][TXS_VALUES];
    uint8_t *tables;                /* TXS_TABLE bytes a type               */
    int32_t (*histogram)[TXS_BINS]; /* TXS_WINDOW times the counts of the last sweep */
    int32_t (*integral)[TXS_BINS];  /* 1/(TXS_NAT TXS_PRECISE) nat          */
    int32_t (*counts)[TXS_BINS];    /* TXS_TASKS times all types            */
    const int16_t *noise;
    int strips, tasks, skip;          /* layout; one pixel in skip is counted */
    int sublattice[TXS_GROUP], phase; /* of the pass                          */
    uint64_t pass, sweep;
} txs_sampler;

/* Minus a Gumbel variable, shuffled: entries i..i+31 for a random i are a noise row. */
static void txs_noise_table(int16_t *noise) {
    txm_rng rng = txm_rng_make(1, 2);
    for (int i = 0; i < TXS_NOISE; i++) {
        double gumbel = log(-log((i + 0.5) / (double)TXS_NOISE));
        int j = (int)txm_rng_below(&rng, (uint32_t)i + 1);
        noise[i] = noise[j];
        noise[j] = (int16_t)floor(gumbel * (TXS_NAT * TXS_FINE) + 0.5);
    }
    memcpy(noise + TXS_NOISE, noise, TXS_VALUES * sizeof *noise);
}

/* The ends of clique type k, each with the band it lies in and its form; returns how many. */
static int txs_type_ends(const txs_sampler *s, int k, txs_end ends[4], int band[4], int form[4]) {
    const txs_type *t = &s->level->types[k];
    const txs_canvas *c = s->canvas;
    const ptrdiff_t tail = t->band * c->plane, head = t->other * c->plane;
    const ptrdiff_t parent = (s->bands + t->other) * c->plane;
    const ptrdiff_t d = t->dy * c->stride + t->dx, e = t->ey * c->stride + t->ex;
    const uint8_t *table = s->tables + (size_t)k * TXS_TABLE + 31;
    const ptrdiff_t block = TXS_CLASSES * TXS_ROW;
    for (int i = 0; i < 4; i++) {
        memset(&ends[i], 0, sizeof ends[i]);
        band[i] = t->band;
        form[i] = 1;
        ends[i].table = table + i * block;
    }
    switch (t->kind) {
    case TEXSYN_SINGLE: return 0;
    case TEXSYN_PAIR: /* the head, the tail */
        form[0] = form[1] = 0;
        band[0] = t->other;
        ends[0].o1 = tail - d;
        ends[1].o1 = head + d;
        ends[1].table = table + TXS_ROW;
        return 2;
    case TEXSYN_PARENT:
        form[0] = 0;
        ends[0].o1 = parent;
        ends[0].table = table + TXS_ROW;
        return 1;
    case TEXSYN_VALUES:
        form[0] = form[1] = 3;
        ends[0].o1 = head + d;
        ends[0].classes = s->level->classes[t->other];
        ends[0].table = table - 31;
        band[1] = t->other;
        ends[1].o1 = tail - d;
        ends[1].classes = s->level->classes[t->band];
        ends[1].table = table - 31 + TXS_CLASSES * TXS_VALUES;
        return 2;
    case TEXSYN_CORNER: /* the arms, the corner */
        ends[0].o1 = ends[0].o3 = tail - d;
        ends[0].o2 = tail + e - d;
        ends[1].o1 = ends[1].o3 = tail - e;
        ends[1].o2 = tail + d - e;
        form[2] = 2;
        ends[2].o1 = tail + d;
        ends[2].o2 = tail + e;
        ends[2].table = table + 2 * block + 31 * TXS_ROW;
        return 3;
    case TEXSYN_SCALE: /* the head, the tail */
        ends[0].o1 = tail - d;
        ends[0].o2 = parent + e - d;
        ends[0].o3 = parent - e;
        ends[1].o1 = tail + d;
        ends[1].o2 = parent + e;
        ends[1].o3 = parent + d - e;
        return 2;
    default: /* TEXSYN_PARALLEL: head and tail of the one difference, of the other */
        ends[0].o1 = tail - d;
        ends[0].o2 = head + e;
        ends[0].o3 = head + e - d;
        ends[1].o1 = tail + d;
        ends[1].o2 = head + e + d;
        ends[1].o3 = head + e;
        band[2] = band[3] = t->other;
        ends[2].o1 = head - d;
        ends[2].o2 = tail - e;
        ends[2].o3 = tail - e - d;
        ends[3].o1 = head + d;
        ends[3].o2 = tail - e + d;
        ends[3].o3 = tail - e;
        return 4;
    }
}

/* Ends that a level's types put into one band, at most; a model must stay within TXS_MAX_ENDS. */
static int txs_most_ends(const txs_level *level, int bands) {
    int count[TXS_MAX_BANDS] = {0}, most = 0;
    for (int k = 0; k < level->type_count; k++) {
        const txs_type *t = &level->types[k];
        static const int tail[] = {0, 1, 1, 1, 3, 2, 2}, head[] = {0, 1, 0, 1, 0, 0, 2};
        count[t->band] += tail[t->kind];
        count[t->other] += head[t->kind];
    }
    for (int b = 0; b < bands; b++)
        if (count[b] > most) most = count[b];
    return most;
}

/* Spread the potential v of type k (as bytes of rows) over the tables of its ends. */
static void txs_expand(txs_sampler *s, int k, const uint8_t *v) {
    const txs_type *t = &s->level->types[k];
    const uint8_t *class_of = txs_difference_class;
    uint8_t *table = s->tables + (size_t)k * TXS_TABLE;
    enum { N = TXS_CLASSES, ROW = TXS_ROW, BLOCK = TXS_CLASSES * TXS_ROW };
    switch (t->kind) {
    case TEXSYN_PAIR:
    case TEXSYN_PARENT:
        for (int i = 0; i < TXS_DIFFERENCES; i++) {
            table[i] = v[i];
            table[ROW + i] = v[TXS_DIFFERENCES - 1 - i];
        }
        break;
    case TEXSYN_VALUES:
        for (int q = 0; q < N; q++) {
            for (int i = 0; i < TXS_VALUES; i++) {
                table[q * TXS_VALUES + i] = v[s->level->classes[t->band][i] * N + q];
                table[(N + q) * TXS_VALUES + i] = v[q * N + s->level->classes[t->other][i]];
            }
        }
        break;
    case TEXSYN_CORNER:
        for (int q = 0; q < N; q++) {
            for (int i = 0; i < TXS_DIFFERENCES; i++) {
                table[q * ROW + i] = v[class_of[i] * N + q];
                table[BLOCK + q * ROW + i] = v[q * N + class_of[i]];
            }
        }
        for (int delta = -31; delta <= 31; delta++) { /* difference 31 - i on one arm, delta more
                                                         on the other */
            uint8_t *row = table + 2 * BLOCK + (delta + 31) * ROW;
            for (int i = 0; i < TXS_DIFFERENCES; i++)
                row[i] = v[class_of[62 - i] * N + class_of[txm_clampi(62 - i + delta, 0, 62)]];
        }
        break;
    default: /* TEXSYN_SCALE and, with the ends of the other difference, TEXSYN_PARALLEL */
        for (int q = 0; q < N; q++) {
            for (int i = 0; i < TXS_DIFFERENCES; i++) {
                table[q * ROW + i] = v[class_of[i] * N + q];
                table[BLOCK + q * ROW + i] = v[class_of[62 - i] * N + q];
                if (t->kind == TEXSYN_SCALE) continue;
                table[2 * BLOCK + q * ROW + i] = v[q * N + class_of[i]];
                table[3 * BLOCK + q * ROW + i] = v[q * N + class_of[62 - i]];
            }
        }
    }
}

/* Set all tables from the histograms' errors; integrate as well if it is time. */
static void txs_control(txs_sampler *s, int integrate) {
    const int gain = TXS_NAT * TXS_PRECISE;
    for (int k = 0; k < s->level->type_count; k++) {
        const txs_type *t = &s->level->types[k];
        const int bins = txs_bin_count(t->kind);
        const int32_t limit = (t->kind == TEXSYN_SINGLE ? 10 * TXS_NAT : 63) * TXS_PRECISE;
        uint8_t row[TXS_BINS];
        int64_t total = 1;
        for (int i = 0; i < bins; i++) total += s->histogram[k][i];
        const int64_t scale = ((int64_t)TXS_ONE << 24) / total;
        for (int i = 0; i < bins; i++) {
            int32_t error = (int32_t)((s->histogram[k][i] * scale) >> 24) - t->share[i];
            int32_t pull = error * gain / TXS_ONE; /* for a gain of 1 nat per unit of error */
            if (integrate)
                s->integral[k][i] =
                    txm_clampi(s->integral[k][i] + TXS_INTEGRAL * pull, -limit, limit);
            int32_t v = txm_clampi(s->integral[k][i] + TXS_PROPORTIONAL * pull, -limit, limit);
            if (t->kind == TEXSYN_SINGLE)
                s->single[t->band][(i >> 1) + (i & 1) * 16] =
                    (int16_t)(i < s->level->values[t->band] ? v / (TXS_PRECISE / TXS_FINE) : 1600);
            else row[i] = (uint8_t)((v + TXS_ZERO * TXS_PRECISE) / TXS_PRECISE);
        }
        if (t->kind != TEXSYN_SINGLE) txs_expand(s, k, row);
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
    const uint8_t *rows[TXS_TOGETHER][TXS_MAX_ENDS + 2];
    const uint8_t *p = txs_at(s->canvas, 0, x, y);
    const txs_list *list = txs_list_at(s, x, y);
    for (int b = 0; b < s->bands; b++) {
        const txs_end *e = list->ends[b], *stop = e + list->end_count[b][0];
        int n = 0;
        for (; e < stop; e++, n++) {
            const uint8_t *p1 = p + e->o1, *table = e->table;
            for (int i = 0; i < count; i++) rows[i][n] = table - p1[i * TXS_GRID];
        }
        for (stop += list->end_count[b][1]; e < stop; e++, n++) {
            const uint8_t *p1 = p + e->o1, *p2 = p + e->o2, *p3 = p + e->o3, *table = e->table;
            for (int i = 0; i < count; i++) {
                int known = txs_class(p2[i * TXS_GRID] - p3[i * TXS_GRID]);
                rows[i][n] = table + known * TXS_ROW - p1[i * TXS_GRID];
            }
        }
        for (stop += list->end_count[b][2]; e < stop; e++, n++) {
            const uint8_t *p1 = p + e->o1, *p2 = p + e->o2, *table = e->table;
            for (int i = 0; i < count; i++) {
                int arm = p1[i * TXS_GRID];
                rows[i][n] = table + (p2[i * TXS_GRID] - arm) * TXS_ROW - arm;
            }
        }
        for (stop += list->end_count[b][3]; e < stop; e++, n++) {
            const uint8_t *p1 = p + e->o1, *classes = e->classes, *table = e->table;
            for (int i = 0; i < count; i++)
                rows[i][n] = table + classes[p1[i * TXS_GRID]] * TXS_VALUES;
        }
        for (int i = 0; i < count; i++) {
            rows[i][n] = txs_no_energy;
            int v = s->pick(rows[i], (n + 1) & ~1, s->single[b],
                            s->noise + (txm_rng_next(rng) & (TXS_NOISE - 1)));
            if (v >= s->level->values[b]) v = s->level->values[b] - 1;
            txs_set(s->canvas, b, x + i * TXS_GRID, y, (uint8_t)v);
        }
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
                for (int x = sx; x < width; x += TXS_GRID)
                    if (txs_is_counted(s, x, y))
                        txs_count(txs_list_at(s, x, y), txs_at(s->canvas, 0, x, y), counts);
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

/* Visit every pixel once. Progress from..to of the whole work. */
static txm_status txs_sweep(txs_sampler *s, txm_env *env, const char *stage, float from, float to) {
    enum { ALL = TXS_GRID * TXS_GRID };
    const int phases = s->strips > 1 ? 2 : 1, groups = (int)ALL / TXS_GROUP;
    int order[ALL];
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
            int band[4], forms[4], n = txs_type_ends(s, k, ends, band, forms);
            for (int i = 0; i < n; i++) {
                int *count = list->end_count[band[i]];
                /* of a pair, end 0 is the head; only pairs have a phase */
                if (forms[i] != form || !txs_is_tail(t, px - (i ? 0 : t->dx), py - (i ? 0 : t->dy)))
                    continue;
                list->ends[band[i]][count[0] + count[1] + count[2] + count[3]] = ends[i];
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
static void txs_sampler_start(txs_sampler *s) {
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

    memset(s->histogram, 0, sizeof *s->histogram * (size_t)types);
    memset(s->counts, 0, sizeof *s->counts * (size_t)(types * s->tasks));
    for (int y = 0; y < c->height; y++)
        for (int x = 0; x < c->width; x++)
            if (txs_is_counted(s, x, y))
                txs_count(txs_list_at(s, x, y), txs_at(c, 0, x, y), s->histogram);
    for (int k = 0; k < types; k++)
        for (int i = 0; i < TXS_BINS; i++) s->histogram[k][i] *= TXS_WINDOW;
    txs_control(s, 0);
}

/* A sampler in the arena's memory; NULL if there is none. Call txs_sampler_start before use. */
static txs_sampler *txs_sampler_make(txm_arena *arena, const txs_level *level, int max_types,
                                     const txs_canvas *canvas, int bands, const int16_t *noise,
                                     uint64_t seed) {
    const size_t n = (size_t)max_types;
    txs_sampler *s = (txs_sampler *)txm_arena_zero(arena, 1, sizeof *s);
    if (!s) return NULL;
    s->level = level;
    s->canvas = canvas;
    s->bands = bands;
    s->seed = txm_hash(seed);
    s->pick = txs_best_pick();
    s->noise = noise;
    s->tables = (uint8_t *)txm_arena_zero(arena, n, TXS_TABLE);
    s->histogram = (int32_t(*)[TXS_BINS])txm_arena_zero(arena, n, sizeof *s->histogram);
    s->integral = (int32_t(*)[TXS_BINS])txm_arena_zero(arena, n, sizeof *s->integral);
    s->counts = (int32_t(*)[TXS_BINS])txm_arena_zero(arena, n * TXS_TASKS, sizeof *s->counts);
    if (arena->failed) return NULL;
    for (int k = 0; k < level->type_count; k++)
        for (int i = 0; i < TXS_BINS; i++)
            s->integral[k][i] = level->types[k].potential[i] * TXS_PRECISE;
    return s;
}

#endif /* TEXSYN_SAMPLER_H */
