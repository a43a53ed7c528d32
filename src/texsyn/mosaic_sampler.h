#ifndef TEXSYN_MOSAIC_SAMPLER_H
#define TEXSYN_MOSAIC_SAMPLER_H

#include "mosaic.h"
#include "sampler.h"

/* ---- sampling a mosaic -------------------------------------------------------------------

   As sampler.h does, with these differences. Only free pixels are visited. They are listed by strip,
   sub-lattice and label, and those of one list are drawn in batches, wherever they lie. Each label
   has its own clique types, tables and histograms, which count cliques with a free tail. Pure pixels
   look at no label; at others an end counts if its guard holds. Beside the types of the labels there
   are crossing ones: VALUES whose tail has one label and whose head another, each in the classes of
   its own model.                                                                             */

/* A clique type across a border. */
typedef struct txs_crossing {
    int tail, head; /* labels */
    txs_type type;  /* VALUES */
} txs_crossing;

enum {
    TXS_MAX_CROSSINGS = 256, /* of one level */
    TXS_CROSS_ENDS = 96,     /* of one label and band */
    TXS_SOFT_CROSSING = 40  /* see txs_soften; ours, by trial */
};

/* What the pixels of one label and parity take part in. */
typedef struct txs_part {
    txs_list list;
    txs_guard guard[TXS_MAX_BANDS][TXS_MAX_ENDS]; /* of the ends   */
    txs_guard tally_guard[TXS_MAX_TYPES];         /* of the tallies */
    txs_end cross[TXS_MAX_BANDS][TXS_CROSS_ENDS]; /* of crossing types */
    txs_guard cross_guard[TXS_MAX_BANDS][TXS_CROSS_ENDS];
    int cross_count[TXS_MAX_BANDS];
} txs_part;

typedef struct txs_brush { /* the sampler */
    const txs_mosaic *mosaic;
    const txs_texture *texture; /* of each label */
    const txs_crossing *crossing;
    int crossings;
    int parities; /* 4 if there are parents, else 1 */
    int refresh;  /* sub-lattices between two looks at the histograms */
    int softness; /* see txs_soften */
    uint64_t seed;
    txs_pick *pick;
    const int16_t *noise;
    txs_part *part;                /* parities for each label */
    int16_t (*single)[TXS_VALUES]; /* TXS_MAX_BANDS for each label */
    /* of each type: its place is base[label] + index; those of crossing types follow */
    int capacity, base[TXS_MAX_LABELS + 1];
    int *active, active_count; /* places in use */
    uint8_t *tables;
    int32_t (*histogram)[TXS_BINS], (*integral)[TXS_BINS];
    int32_t (*counts)[TXS_BINS]; /* TXS_TASKS times all places */
    txs_gain *gain;
    /* pixels: lists in the order of strips, sub-lattices, labels */
    int32_t *pixel;
    txs_pixels *list;
    uint8_t *purity; /* of each pixel of the canvas */
    int *columns;
    size_t pixel_count, list_capacity;
    int top, rows; /* of free pixels */
    int skip[TXS_MAX_LABELS], free_count[TXS_MAX_LABELS];
    int strips, tasks, phase, group, integrate;
    int order[TXS_GRID * TXS_GRID];
    uint64_t pass, sweep;
} txs_brush;

enum { TXS_ALL = TXS_GRID * TXS_GRID };

/* ---- what a pixel takes part in ------------------------------------------------------- */

/* Which member of the clique the ends of txs_type_ends are, by kind. */
static const uint8_t txs_end_member[][4] = {{0, 0, 0, 0}, {1, 0, 0, 0}, {0, 0, 0, 0}, {0, 1, 0, 0},
                                            {1, 2, 0, 0}, {1, 0, 0, 0}, {1, 0, 3, 2}};

static void txs_part_add_ends(txs_brush *s, txs_part *part, int label, int k, int px, int py,
                              int form) {
    const txs_texture *texture = &s->texture[label];
    const txs_type *t = &texture->level->types[k];
    txs_end ends[4];
    int band[4], forms[4];
    const int n =
        txs_type_ends(texture->level, t, s->tables + (size_t)(s->base[label] + k) * TXS_TABLE,
                      &s->mosaic->canvas, s->mosaic->bands, ends, band, forms);
    for (int i = 0; i < n; i++) {
        int *count = part->list.end_count[band[i]];
        const int at = count[0] + count[1] + count[2] + count[3];
        /* of a pair, end 0 is the head; only pairs have a phase */
        if (forms[i] != form || !txs_is_tail(t, px - (i ? 0 : t->dx), py - (i ? 0 : t->dy)))
            continue;
        if (at == TXS_MAX_ENDS) continue; /* cannot be: models are checked */
        part->list.ends[band[i]][at] = ends[i];
        part->guard[band[i]][at] =
            txs_guard_make(s->mosaic, t, label, txs_end_member[t->kind][i], s->mosaic->label);
        count[form]++;
    }
}

/* Ends and tallies of the pixels of a label with parities px, py. */
static void txs_part_fill(txs_brush *s, txs_part *part, int label, int px, int py) {
    const txs_level *level = s->texture[label].level;
    memset(part, 0, sizeof *part);
    for (int form = 0, filled = 0; form < TXS_FORMS; form++) {
        for (int k = 0; k < level->type_count; k++) {
            const txs_type *t = &level->types[k];
            if (!txs_mosaic_knows(s->mosaic, t)) continue;
            txs_part_add_ends(s, part, label, k, px, py, form);
            txs_tally tally = txs_tally_make(t, level, &s->mosaic->canvas, s->mosaic->bands);
            if (tally.form != form || !txs_is_tail(t, px, py)) continue;
            tally.type = k;
            part->tally_guard[filled] = txs_guard_make(s->mosaic, t, label, 0, s->mosaic->label);
            part->list.tally[filled++] = tally;
            part->list.tally_count[form]++;
        }
    }
}

/* An end of a crossing type at pixels of `label`; the other member has the label `far_`. */
static void txs_part_add_crossing(txs_brush *s, int label, int far_, int band, int far_band,
                                  ptrdiff_t d, const uint8_t *table) {
    for (int parity = 0; parity < s->parities; parity++) {
        txs_part *part = &s->part[label * s->parities + parity];
        const int at = part->cross_count[band];
        if (at == TXS_CROSS_ENDS) return;
        txs_end *e = &part->cross[band][at];
        txs_guard *g = &part->cross_guard[band][at];
        memset(e, 0, sizeof *e);
        memset(g, 0, sizeof *g);
        e->o1 = far_band * s->mosaic->canvas.plane + d;
        e->classes = s->texture[far_].level->classes[far_band];
        e->table = table;
        TEXSYN_ASSERT(g->count < (int)(sizeof g->at / sizeof *g->at));
        g->at[g->count++] = s->mosaic->label + d;
        g->label = far_;
        part->cross_count[band]++;
    }
}

static void txs_parts_fill(txs_brush *s) {
    for (int k = 0; k < s->mosaic->labels; k++)
        for (int parity = 0; parity < s->parities; parity++)
            txs_part_fill(s, &s->part[k * s->parities + parity], k, parity & 1, parity >> 1);
    for (int i = 0; i < s->crossings; i++) {
        const txs_crossing *c = &s->crossing[i];
        const txs_type *t = &c->type;
        const ptrdiff_t d = t->dy * s->mosaic->canvas.stride + t->dx;
        const uint8_t *table = s->tables + (size_t)(s->base[s->mosaic->labels] + i) * TXS_TABLE;
        txs_part_add_crossing(s, c->tail, c->head, t->band, t->other, d, table);
        txs_part_add_crossing(s, c->head, c->tail, t->other, t->band, -d,
                              table + (int)TXS_CLASSES * TXS_VALUES);
    }
}

/* ---- drawing -------------------------------------------------------------------------- */

/* The candidate's energies at one end, as energy.h says. */
static const uint8_t *txs_row(const txs_end *e, int form, const uint8_t *p) {
    switch (form) {
    case 0: return e->table - p[e->o1];
    case 1: return e->table + txs_class(p[e->o2] - p[e->o3]) * TXS_ROW - p[e->o1];
    case 2: return e->table + (p[e->o2] - p[e->o1]) * TXS_ROW - p[e->o1];
    default: return e->table + e->classes[p[e->o1]] * TXS_VALUES;
    }
}

/* Draw a value for one pixel and band, given the rows of its ends. */
static void txs_draw_value(const txs_brush *s, int label, int band, const uint8_t **rows, int n,
                           uint8_t *p, txm_rng *rng) {
    const int values = s->texture[label].level->values[band];
    rows[n] = txs_no_energy;
    int v = s->pick(rows, 1, (n + 1) & ~1, s->single[label * TXS_MAX_BANDS + band],
                    s->noise + (txm_rng_next(rng) & (TXS_NOISE - 1)));
    if (v >= values) v = values - 1;
    p[band * s->mosaic->canvas.plane] = (uint8_t)v;
}

/* Draw some pure pixels of a list. */
static void txs_draw_pure(const txs_brush *s, int label, const txs_list *list, const int32_t *at,
                          int count, txm_rng *rng) {
    const uint8_t *rows[TXS_TOGETHER][TXS_MAX_ENDS + 2];
    uint8_t *base = s->mosaic->canvas.pixels;
    for (int b = 0; b < s->texture[label].model->bands; b++) {
        const txs_end *e = list->ends[b], *stop = e + list->end_count[b][0];
        int n = 0;
        for (; e < stop; e++, n++) {
            const uint8_t *p1 = base + e->o1, *table = e->table;
            for (int i = 0; i < count; i++) rows[i][n] = table - p1[at[i]];
        }
        for (stop += list->end_count[b][1]; e < stop; e++, n++) {
            const uint8_t *p1 = base + e->o1, *p2 = base + e->o2, *p3 = base + e->o3;
            for (int i = 0; i < count; i++)
                rows[i][n] = e->table + txs_class(p2[at[i]] - p3[at[i]]) * TXS_ROW - p1[at[i]];
        }
        for (stop += list->end_count[b][2]; e < stop; e++, n++) {
            const uint8_t *p1 = base + e->o1, *p2 = base + e->o2;
            for (int i = 0; i < count; i++)
                rows[i][n] = e->table + (p2[at[i]] - p1[at[i]]) * TXS_ROW - p1[at[i]];
        }
        for (stop += list->end_count[b][3]; e < stop; e++, n++) {
            const uint8_t *p1 = base + e->o1;
            for (int i = 0; i < count; i++)
                rows[i][n] = e->table + e->classes[p1[at[i]]] * TXS_VALUES;
        }
        for (int i = 0; i < count; i++) txs_draw_value(s, label, b, rows[i], n, base + at[i], rng);
    }
}

/* Draw a pixel near another label or the border. */
static void txs_draw_checked(const txs_brush *s, int label, const txs_part *part, uint8_t *p,
                             txm_rng *rng) {
    const uint8_t *rows[TXS_MAX_ENDS + 2];
    for (int b = 0; b < s->texture[label].model->bands; b++) {
        const txs_end *e = part->list.ends[b];
        const txs_guard *g = part->guard[b];
        int n = 0;
        for (int form = 0; form < TXS_FORMS; form++)
            for (int i = part->list.end_count[b][form]; i > 0; i--, e++, g++)
                if (txs_holds(g, p)) rows[n++] = txs_row(e, form, p);
        for (int i = 0; i < part->cross_count[b] && n < TXS_MAX_ENDS; i++)
            if (txs_holds(&part->cross_guard[b][i], p))
                rows[n++] = txs_row(&part->cross[b][i], 3, p);
        txs_draw_value(s, label, b, rows, n, p, rng);
    }
}

/* ---- counting ------------------------------------------------------------------------- */

/* Count the cliques whose tail is p. counts: of all types. */
static void txs_brush_count(const txs_brush *s, int label, const txs_part *part, int is_pure,
                            const uint8_t *p, int32_t (*counts)[TXS_BINS]) {
    if (is_pure) {
        txs_count(&part->list, p, counts + s->base[label]);
        return;
    }
    const int *of = part->list.tally_count, n = of[0] + of[1] + of[2] + of[3];
    for (int i = 0; i < n; i++) {
        const txs_tally *t = &part->list.tally[i];
        if (txs_holds(&part->tally_guard[i], p)) counts[s->base[label] + t->type][txs_bin(t, p)]++;
    }
    for (int i = 0; i < s->crossings; i++) {
        const txs_crossing *c = &s->crossing[i];
        const txs_type *t = &c->type;
        const uint8_t *q = p + t->dy * s->mosaic->canvas.stride + t->dx;
        if (c->tail != label || q[s->mosaic->label] != c->head) continue;
        const int v = p[t->band * s->mosaic->canvas.plane];
        const int w = q[t->other * s->mosaic->canvas.plane];
        counts[s->base[s->mosaic->labels] + i]
              [s->texture[c->tail].level->classes[t->band][v] * TXS_CLASSES +
               s->texture[c->head].level->classes[t->other][w]]++;
    }
}

static const txs_pixels *txs_brush_list(const txs_brush *s, int strip, int sublattice, int label) {
    return &s->list[((size_t)strip * TXS_ALL + (size_t)sublattice) * (size_t)s->mosaic->labels +
                    (size_t)label];
}

static const txs_part *txs_brush_part(const txs_brush *s, int label, int sublattice) {
    const int parity = s->parities == 1 ? 0 : (sublattice & 1) + 2 * (sublattice / TXS_GRID & 1);
    return &s->part[label * s->parities + parity];
}

/* Count every skip-th pixel of a list. */
static void txs_count_list(const txs_brush *s, int strip, int sublattice, int label,
                           int32_t (*counts)[TXS_BINS]) {
    const txs_pixels *list = txs_brush_list(s, strip, sublattice, label);
    const txs_part *part = txs_brush_part(s, label, sublattice);
    const int skip = s->skip[label];
    for (int i = (strip + 5 * sublattice) % skip; i < list->count; i += skip)
        txs_brush_count(s, label, part, i < list->pure, s->mosaic->canvas.pixels + list->at[i],
                        counts);
}

/* ---- a sweep -------------------------------------------------------------------------- */

static void txs_draw_list(const txs_brush *s, int strip, int sublattice, int label, uint64_t pass) {
    const txs_pixels *list = txs_brush_list(s, strip, sublattice, label);
    const txs_part *part = txs_brush_part(s, label, sublattice);
    txm_rng rng =
        txm_rng_make(s->seed ^ pass << 24, (uint64_t)strip * TXS_MAX_LABELS + (uint64_t)label);
    for (int i = 0; i < list->pure; i += TXS_TOGETHER) {
        const int n = list->pure - i;
        txs_draw_pure(s, label, &part->list, list->at + i, n < TXS_TOGETHER ? n : (int)TXS_TOGETHER,
                      &rng);
    }
    for (int i = list->pure; i < list->count; i++)
        txs_draw_checked(s, label, part, s->mosaic->canvas.pixels + list->at[i], &rng);
}

/* One share of a pass: some of the strips of this phase, the group's sub-lattices in turn. */
static void txs_brush_work(void *context, int task) {
    const txs_brush *s = (const txs_brush *)context;
    const int half = s->strips > 1 ? s->strips / 2 : 1;
    int32_t(*counts)[TXS_BINS] = s->counts + (size_t)task * (size_t)s->capacity;
    for (int i = half * task / s->tasks; i < half * (task + 1) / s->tasks; i++) {
        const int strip = s->strips > 1 ? 2 * i + s->phase : 0;
        for (int j = 0; j < s->refresh; j++) {
            const int sublattice = s->order[s->group * s->refresh + j];
            const uint64_t pass = s->pass * TXS_ALL + (uint64_t)j;
            for (int k = 0; k < s->mosaic->labels; k++) {
                txs_draw_list(s, strip, sublattice, k, pass);
                txs_count_list(s, strip, sublattice, k, counts);
            }
        }
    }
}

/* The clique type at a place. */
static const txs_type *txs_brush_type(const txs_brush *s, int place, int *label) {
    const int labels = s->mosaic->labels;
    *label = place < s->base[labels] ? place / s->base[1] : labels;
    return *label < labels ? &s->texture[*label].level->types[place - s->base[*label]]
                           : &s->crossing[place - s->base[labels]].type;
}

/* Spread the potential of a crossing type over the tables of its ends. */
static void txs_publish_crossing(const txs_brush *s, const txs_crossing *c, const int32_t *v,
                                 uint8_t *table) {
    const uint8_t *tail = s->texture[c->tail].level->classes[c->type.band];
    const uint8_t *head = s->texture[c->head].level->classes[c->type.other];
    enum { N = TXS_CLASSES };
    uint8_t row[TXS_BINS];
    for (int i = 0; i < TXS_BINS; i++)
        row[i] = (uint8_t)((v[i] + TXS_ZERO * TXS_PRECISE) / TXS_PRECISE);
    for (int q = 0; q < N; q++) {
        for (int i = 0; i < TXS_VALUES; i++) {
            table[q * TXS_VALUES + i] = row[tail[i] * N + q];
            table[(N + q) * TXS_VALUES + i] = row[q * N + head[i]];
        }
    }
}

/* Bring the counts of a pass into the running histogram of a type, which forgets at the same rate,
   and set the type's tables from its error. */
static void txs_brush_control(txs_brush *s, int place) {
    const int passes = TXS_ALL / s->refresh;
    const int64_t keep = TXS_ONE - TXS_ONE / passes;
    int32_t v[TXS_BINS], *histogram = s->histogram[place];
    int label;
    const txs_type *t = txs_brush_type(s, place, &label);
    uint8_t *table = s->tables + (size_t)place * TXS_TABLE;
    for (int i = 0; i < TXS_BINS; i++) histogram[i] = (int32_t)((histogram[i] * keep) >> 16);
    for (int task = 0; task < s->tasks; task++) {
        int32_t *count = s->counts[(size_t)task * (size_t)s->capacity + (size_t)place];
        for (int i = 0; i < TXS_BINS; i++) histogram[i] += count[i] * TXS_WINDOW;
        memset(count, 0, sizeof *s->counts);
    }
    txs_steer(t, s->gain[place], s->integrate, histogram, s->integral[place], v);
    if (label == s->mosaic->labels)
        txs_publish_crossing(s, &s->crossing[place - s->base[label]], v, table);
    else
        txs_publish(s->texture[label].level, t, v, s->single[label * TXS_MAX_BANDS + t->band],
                    table);
}

enum { TXS_CONTROL_TASKS = 8 };

static void txs_brush_control_some(void *context, int task) {
    txs_brush *s = (txs_brush *)context;
    for (int i = task; i < s->active_count; i += TXS_CONTROL_TASKS)
        txs_brush_control(s, s->active[i]);
}

/* Visit every free pixel once. Progress from..to of the whole work. */
static txm_status txs_brush_sweep(txs_brush *s, txm_env *env, const char *stage, float from,
                                  float to) {
    const int phases = s->strips > 1 ? 2 : 1, groups = TXS_ALL / s->refresh;
    txm_rng rng = txm_rng_make(s->seed, ~s->sweep++);
    for (int i = 0; i < TXS_ALL; i++) s->order[i] = i;
    txm_shuffle(&rng, s->order, TXS_ALL);
    for (s->group = 0; s->group < groups; s->group++, s->pass++) {
        if (txm_progress(env, from + (to - from) * (float)s->group / (float)groups, stage))
            return txm_fail(env, TXM_CANCELLED, "stopped by the progress callback");
        for (s->phase = 0; s->phase < phases; s->phase++)
            txm_parallel_for(env, s->tasks, txs_brush_work, s);
        s->integrate = s->group + 1 == groups;
        txm_parallel_for(env, TXS_CONTROL_TASKS, txs_brush_control_some, s);
    }
    return TXM_OK;
}

/* ---- laying out the work -------------------------------------------------------------- */

static int txs_strip_of(const txs_brush *s, int y) {
    return (int)(((int64_t)(y - s->top + 1) * s->strips - 1) / s->rows);
}

static txs_pixels *txs_list_of(txs_brush *s, int x, int y, int label) {
    const int sublattice = x % TXS_GRID + y % TXS_GRID * TXS_GRID;
    return &s->list[((size_t)txs_strip_of(s, y) * TXS_ALL + (size_t)sublattice) *
                        (size_t)s->mosaic->labels +
                    (size_t)label];
}

/* Call visit-like code for each free pixel: first count the pixels of each list, then fill them. */
static void txs_list_pixels(txs_brush *s, int is_filling) {
    const txs_mosaic *m = s->mosaic;
    const int width = m->canvas.width;
    for (int pure = 1; pure >= 0; pure--) {
        for (int y = s->top; y < s->top + s->rows; y++) {
            for (int x = 0; x < width; x++) {
                if (!txs_is_free(m, x, y) ||
                    s->purity[(size_t)y * (size_t)width + (size_t)x] != pure)
                    continue;
                txs_pixels *list = txs_list_of(s, x, y, txs_pixel(m, x, y)[m->label]);
                if (is_filling) list->at[list->count] = (int32_t)txs_pixel_offset(m, x, y);
                list->count++;
                list->pure += pure;
            }
        }
    }
}

static void txs_brush_list_all(txs_brush *s) {
    const size_t lists = (size_t)s->strips * TXS_ALL * (size_t)s->mosaic->labels;
    size_t filled = 0;
    TEXSYN_ASSERT(lists <= s->list_capacity);
    memset(s->list, 0, lists * sizeof *s->list);
    memset(s->free_count, 0, sizeof s->free_count);
    txs_list_pixels(s, 0);
    for (size_t i = 0; i < lists; i++) {
        s->list[i].at = s->pixel + filled;
        filled += (size_t)s->list[i].count;
        s->free_count[i % (size_t)s->mosaic->labels] += s->list[i].count;
        s->list[i].count = s->list[i].pure = 0;
    }
    TEXSYN_ASSERT(filled == s->pixel_count);
    txs_list_pixels(s, 1);
}

/* The largest distance between members of a clique of this level; at least what is worth a strip. */
static int txs_brush_reach(const txs_brush *s) {
    int reach = 1;
    for (int i = 0; i < s->active_count; i++) {
        int label, r = txs_reach(txs_brush_type(s, s->active[i], &label));
        if (r > reach) reach = r;
    }
    return reach;
}

/* The gain of a type whose histogram counts n cliques: few cliques have noisy histograms, and
   surroundings that are fixed. */
static txs_gain txs_soften(int64_t n, int softness) {
    txs_gain gain;
    gain.proportional = (int)((int)TXS_PROPORTIONAL * TXS_WHOLE * n / (n + softness));
    gain.integral = (int)((int)TXS_INTEGRAL * TXS_WHOLE * n / (n + softness));
    return gain;
}

/* Which places are in use. */
static void txs_brush_activate(txs_brush *s) {
    const int labels = s->mosaic->labels;
    s->active_count = 0;
    for (int k = 0; k < labels; k++)
        for (int i = 0; i < s->texture[k].level->type_count; i++)
            if (txs_mosaic_knows(s->mosaic, &s->texture[k].level->types[i]))
                s->active[s->active_count++] = s->base[k] + i;
    for (int i = 0; i < s->crossings; i++) s->active[s->active_count++] = s->base[labels] + i;
    TEXSYN_ASSERT(s->active_count <= s->capacity);
}

/* Lay out the work for the types as they are now, and count the canvas as it is. */
static void txs_brush_start(txs_brush *s) {
    enum { STRIP = 16 }; /* a strip is at least this high: less is too little work for a thread */
    const int labels = s->mosaic->labels;
    txs_brush_activate(s);
    txs_parts_fill(s);
    int reach = txs_brush_reach(s);
    txs_find_pure(s->mosaic, s->mosaic->label, reach, s->purity, s->columns);
    if (reach < STRIP) reach = STRIP;
    s->strips = s->rows / reach & ~1;
    if (s->strips < 2) s->strips = 1;
    s->tasks = s->strips > 1 ? s->strips / 2 : 1;
    if (s->tasks > TXS_TASKS) s->tasks = TXS_TASKS;
    txs_brush_list_all(s);
    for (int k = 0; k < labels; k++) s->skip[k] = s->free_count[k] / TXS_SAMPLES + 1;

    for (int i = 0; i < s->active_count; i++) {
        memset(s->histogram[s->active[i]], 0, sizeof *s->histogram);
        for (int task = 0; task < TXS_TASKS; task++)
            memset(s->counts[(size_t)task * (size_t)s->capacity + (size_t)s->active[i]], 0,
                   sizeof *s->counts);
    }
    for (int strip = 0; strip < s->strips; strip++)
        for (int sublattice = 0; sublattice < TXS_ALL; sublattice++)
            for (int k = 0; k < labels; k++) txs_count_list(s, strip, sublattice, k, s->counts);
    for (int i = 0; i < s->active_count; i++) {
        const int place = s->active[i];
        int64_t cliques = 0;
        for (int j = 0; j < TXS_BINS; j++) cliques += s->counts[place][j];
        s->gain[place] = place < s->base[labels]
                             ? txs_soften(s->free_count[place / s->base[1]], s->softness)
                             : txs_soften(cliques, TXS_SOFT_CROSSING);
    }
    s->integrate = 0;
    for (int i = 0; i < s->active_count; i++) txs_brush_control(s, s->active[i]);
}

/* Forget what the control has found; start from the potentials of the types. */
static void txs_brush_reset(txs_brush *s) {
    txs_brush_activate(s);
    for (int i = 0; i < s->active_count; i++) {
        int label;
        const txs_type *t = txs_brush_type(s, s->active[i], &label);
        for (int j = 0; j < TXS_BINS; j++)
            s->integral[s->active[i]][j] = t->potential[j] * TXS_PRECISE;
    }
}

/* What txs_brush_make is told. */
typedef struct txs_brush_plan {
    int max_types; /* of one label, at most TXS_MAX_TYPES */
    int max_crossings;
    int refresh;  /* sub-lattices between two looks at the histograms: divides 64 */
    int softness; /* the gains are those of sampler.h times n / (n + softness), n free pixels */
    uint64_t seed;
} txs_brush_plan;

/* A sampler in the arena's memory; NULL if there is none. texture: one for each label. Call
   txs_brush_reset before the first, txs_brush_start before each use with other types or labels. */
static txs_brush *txs_brush_make(txm_arena *arena, const txs_mosaic *mosaic,
                                 const txs_texture *texture, const txs_brush_plan *plan,
                                 const int16_t *noise) {
    const txs_canvas *c = &mosaic->canvas;
    const size_t labels = (size_t)mosaic->labels;
    txs_brush *s = (txs_brush *)txm_arena_zero(arena, 1, sizeof *s);
    if (!s) return NULL;
    s->mosaic = mosaic;
    s->texture = texture;
    s->parities = mosaic->parent ? 4 : 1;
    s->refresh = plan->refresh;
    s->softness = plan->softness;
    s->seed = txm_hash(plan->seed);
    s->pick = txs_best_pick();
    s->noise = noise;
    for (int k = 0; k <= mosaic->labels; k++) s->base[k] = k * plan->max_types;
    s->capacity = s->base[mosaic->labels] + plan->max_crossings;
    s->top = c->height;
    for (int y = 0, bottom = 0; y < c->height; y++) {
        for (int x = 0; x < c->width; x++) {
            if (!txs_is_free(mosaic, x, y)) continue;
            if (y < s->top) s->top = y;
            bottom = y + 1;
            s->rows = bottom - s->top;
            s->pixel_count++;
        }
    }
    if (!s->rows) s->top = 0, s->rows = 1;
    s->list_capacity = ((size_t)s->rows / 16 + 1) * TXS_ALL * labels;
    const size_t places = (size_t)s->capacity;
    s->part = (txs_part *)txm_arena_alloc(arena, labels * (size_t)s->parities, sizeof *s->part);
    s->single =
        (int16_t(*)[TXS_VALUES])txm_arena_zero(arena, labels * TXS_MAX_BANDS, sizeof *s->single);
    s->active = (int *)txm_arena_alloc(arena, places, sizeof *s->active);
    s->tables = (uint8_t *)txm_arena_zero(arena, places, TXS_TABLE);
    s->histogram = (int32_t(*)[TXS_BINS])txm_arena_zero(arena, places, sizeof *s->histogram);
    s->integral = (int32_t(*)[TXS_BINS])txm_arena_zero(arena, places, sizeof *s->integral);
    s->counts = (int32_t(*)[TXS_BINS])txm_arena_zero(arena, places * TXS_TASKS, sizeof *s->counts);
    s->gain = (txs_gain *)txm_arena_zero(arena, places, sizeof *s->gain);
    s->pixel = (int32_t *)txm_arena_alloc(arena, s->pixel_count + 1, sizeof *s->pixel);
    s->list = (txs_pixels *)txm_arena_alloc(arena, s->list_capacity, sizeof *s->list);
    s->purity = (uint8_t *)txm_arena_alloc(arena, (size_t)c->width, (size_t)c->height);
    s->columns = (int *)txm_arena_alloc(arena, (size_t)c->width, sizeof *s->columns);
    return arena->failed ? NULL : s;
}

/* The noise of a lower temperature: percent of it. Both have TXS_NOISE + TXS_VALUES entries. */
static void txs_cool_noise(const int16_t *noise, int percent, int16_t *cool) {
    for (int i = 0; i < (int)TXS_NOISE + TXS_VALUES; i++)
        cool[i] = (int16_t)(noise[i] * percent / 100);
}

#endif /* TEXSYN_MOSAIC_SAMPLER_H */
