#ifndef TEXSYN_LAYOUT_SAMPLER_H
#define TEXSYN_LAYOUT_SAMPLER_H

#include "layout.h"

/* ---- Gibbs sampling of labels ---------------------------------------------------------------

   As in the sampler of values the potentials are controlled (see potential.h), here with histograms
   that are exact: a pixel that changes its label takes its cliques out and puts them in again. */
enum {
    TXS_LAY_GRID = 8,           /* sub-lattices a side                                     */
    TXS_LAY_GROUP = 4,          /* of them are visited before potentials are set anew      */
    TXS_LAY_PROPORTIONAL = 100, /* gains, nats per unit of histogram error             */
    TXS_LAY_INTEGRAL = 20,
    TXS_LAY_STEEPEST = 8,             /* nats: the largest potential of a clique                 */
    TXS_LAY_NAT = TXS_NAT * TXS_FINE, /* steps of a potential per nat, as in the noise */
    TXS_LAY_UNSEEN = 3,               /* nats: where a pair has no clique in the example          */
    TXS_LAY_HOT = 16,                 /* noise of a draw from the Gibbs distribution            */
    TXS_LAY_FINE = 256,               /* steps of an integral per step of a potential            */
    TXS_LAY_NEVER = 40,               /* nats: where it has none although there would be many     */
    TXS_LAY_MUCH = TXS_ONE / 50,      /* share that is many                                  */
    TXS_LAY_TABLE = (int)TXS_LAY_ROWS * (int)TXS_MAX_LABELS
};

typedef struct txs_lay_sampler {
    const txs_lay_level *level;
    txs_lay_view view;
    int labels;
    const int16_t *noise;
    uint64_t seed;
    txs_lay_plane alike[TXS_LAY_RINGS]; /* of each ring: how many pixels are like their middle, or
                                           TXS_OUTSIDE                                   */
    uint8_t *plain;                     /* see txs_lay_find_plain; NULL on the coarsest level */
    int heat;                           /* of the noise, 0..TXS_LAY_HOT */
    int32_t (*count)[TXS_LAY_BINS];    /* of each type, now                                       */
    int32_t (*integral)[TXS_LAY_BINS]; /* steps / TXS_LAY_FINE                                    */
    int16_t (*table)[2][TXS_LAY_TABLE]; /* potentials by row: of the tail, of a pair's head       */
} txs_lay_sampler;

/* Set a type's potentials from its error; integrate as well if it is time. */
static void txs_lay_control(txs_lay_sampler *s, int k, int integrate) {
    const txs_lay_type *t = &s->level->types[k];
    const int32_t limit = TXS_LAY_STEEPEST * TXS_LAY_NAT * TXS_LAY_FINE;
    int32_t share[TXS_LAY_BINS];
    txs_lay_normalise(&s->view, t, s->count[k], share);
    for (int row = 0; row < TXS_MAX_LABELS; row++) {
        for (int label = 0; label < s->labels; label++) {
            const int i = row * TXS_MAX_LABELS + label;
            const int64_t pull =
                (int64_t)(share[i] - t->share[i]) * (TXS_LAY_NAT * TXS_LAY_FINE) / TXS_ONE;
            int32_t *sum = &s->integral[k][i];
            if (integrate && *sum <= limit)
                *sum = txm_clampi(*sum + (int32_t)(TXS_LAY_INTEGRAL * pull), -limit, limit);
            const int16_t v =
                (int16_t)((*sum > limit ? *sum
                                        : txm_clampi(*sum + (int32_t)(TXS_LAY_PROPORTIONAL * pull),
                                                     -limit, limit)) /
                          TXS_LAY_FINE);
            s->table[k][0][i] = v;
            if (row < s->labels) s->table[k][1][label * TXS_MAX_LABELS + row] = v;
        }
    }
}

static void txs_lay_add_row(int32_t *energy, const int16_t *row, int labels) {
    enum { HALF = TXS_MAX_LABELS / 2 }; /* loops of fixed length become a few vector instructions */
    for (int v = 0; v < HALF; v++) energy[v] += row[v];
    if (labels <= HALF) return;
    for (int v = HALF; v < TXS_MAX_LABELS; v++) energy[v] += row[v];
}

static const txs_lay_plane *txs_lay_ring(const txs_lay_sampler *s, const txs_lay_type *t) {
    return &s->alike[t->dx >> 1]; /* distances 1, 2, 4 */
}

/* What a ring says: p's own, and those of the 8 pixels that have p in theirs. */
static void txs_lay_add_ring(const txs_lay_sampler *s, int k, int x, int y, int32_t *energy) {
    const txs_lay_plane *map = s->view.map, *ring = txs_lay_ring(s, &s->level->types[k]);
    const uint8_t *at = txs_lay_at(map, x, y), *alike = txs_lay_at(ring, x, y);
    const int16_t *table = s->table[k][0];
    const int distance = s->level->types[k].dx, now = *at;
    int same[TXS_MAX_LABELS + 1] = {0};
    for (int i = 0; i < TXS_LAY_AROUND; i++) {
        const ptrdiff_t d = distance * (txs_lay_around[i][1] * map->stride + txs_lay_around[i][0]);
        const int label = at[d];
        same[label]++;
        if (alike[d] == TXS_OUTSIDE) continue;
        const int others = alike[d] - (label == now); /* without p */
        energy[label] +=
            table[(others + 1) * TXS_MAX_LABELS + label] - table[others * TXS_MAX_LABELS + label];
    }
    for (int v = 0; v < s->labels && *alike != TXS_OUTSIDE; v++)
        energy[v] += table[same[v] * TXS_MAX_LABELS + v];
}

/* Give a pixel another label, and the rings it lies in their counts. */
static void txs_lay_change(txs_lay_sampler *s, int x, int y, uint8_t label) {
    const txs_lay_plane *map = s->view.map;
    const int before = *txs_lay_at(map, x, y);
    txs_lay_set(map, x, y, label);
    for (int r = 0; r < TXS_LAY_RINGS; r++) {
        const txs_lay_plane *ring = &s->alike[r];
        const int distance = 1 << r;
        int same = 0;
        for (int i = 0; i < TXS_LAY_AROUND; i++) {
            int qx = x + distance * txs_lay_around[i][0], qy = y + distance * txs_lay_around[i][1];
            const int there = *txs_lay_at(map, qx, qy);
            same += there == label;
            if (there != before && there != label) continue;
            if (map->wrap_x) qx = txs_mod(qx, map->width);
            if (map->wrap_y) qy = txs_mod(qy, map->height);
            const int count = *txs_lay_at(ring, qx, qy);
            if (count != TXS_OUTSIDE)
                txs_lay_set(ring, qx, qy, (uint8_t)(count + (there == label ? 1 : -1)));
        }
        if (*txs_lay_at(ring, x, y) != TXS_OUTSIDE) txs_lay_set(ring, x, y, (uint8_t)same);
    }
}

static int txs_lay_sampler_row(const txs_lay_sampler *s, const txs_lay_type *t, int x, int y) {
    return t->kind == TXS_LAY_RING ? *txs_lay_at(txs_lay_ring(s, t), x, y)
                                   : txs_lay_row(&s->view, t, x, y);
}

/* Take the cliques of a pixel out of the histograms (by -1) or put them in (by 1). */
static void txs_lay_tally(txs_lay_sampler *s, int x, int y, int by) {
    const txs_lay_plane *map = s->view.map;
    const uint8_t *at = txs_lay_at(map, x, y);
    const int label = *at;
    for (int k = 0; k < s->level->type_count; k++) {
        const txs_lay_type *t = &s->level->types[k];
        const ptrdiff_t d = t->dy * map->stride + t->dx;
        const int row = txs_lay_sampler_row(s, t, x, y);
        if (row != TXS_OUTSIDE) s->count[k][row * TXS_MAX_LABELS + label] += by;
        if (t->kind == TXS_LAY_PAIR && at[-d] != TXS_OUTSIDE)
            s->count[k][label * TXS_MAX_LABELS + at[-d]] += by;
        for (int i = 0; i < TXS_LAY_AROUND && t->kind == TXS_LAY_RING; i++) {
            const txs_lay_plane *ring = txs_lay_ring(s, t);
            const ptrdiff_t q = t->dx * (txs_lay_around[i][1] * map->stride + txs_lay_around[i][0]);
            const int alike = txs_lay_at(ring, x, y)[q];
            if (alike != TXS_OUTSIDE) s->count[k][alike * TXS_MAX_LABELS + at[q]] += by;
        }
    }
}

/* Is the map of one label about the pixel, here and a level above? Then no other label is drawn: a
   border may move, but what has no border on either level stays as it is. */
static int txs_lay_is_plain(const txs_lay_sampler *s, int x, int y) {
    return s->plain && *txs_lay_at(&s->alike[0], x, y) == TXS_LAY_AROUND &&
           s->plain[(ptrdiff_t)y * s->view.map->width + x] == *txs_lay_at(s->view.map, x, y);
}

/* Labels of the pixels about which the parent has but one label, else TXS_OUTSIDE. */
static void txs_lay_find_plain(const txs_lay_plane *parent, uint8_t *plain) {
    for (int y = 0; y < parent->height; y++) {
        for (int x = 0; x < parent->width; x++) {
            const uint8_t label = *txs_lay_at(parent, x, y);
            const int alone = txs_lay_alike(parent, x, y, 2) == TXS_LAY_AROUND;
            *plain++ = (uint8_t)(alone ? label : (int)TXS_OUTSIDE);
        }
    }
}

/* Draw a new label for a pixel. */
static void txs_lay_visit(txs_lay_sampler *s, int x, int y, txm_rng *rng) {
    const txs_lay_plane *map = s->view.map;
    const uint8_t *at = txs_lay_at(map, x, y);
    const int16_t *noise = s->noise + (txm_rng_next(rng) & (TXS_NOISE - 1));
    int32_t energy[TXS_MAX_LABELS];
    if (txs_lay_is_plain(s, x, y)) return;
    for (int v = 0; v < TXS_MAX_LABELS; v++) energy[v] = noise[v] * s->heat / TXS_LAY_HOT;
    for (int k = 0; k < s->level->type_count; k++) {
        const txs_lay_type *t = &s->level->types[k];
        if (t->kind == TXS_LAY_RING) {
            txs_lay_add_ring(s, k, x, y, energy);
            continue;
        }
        txs_lay_add_row(energy, s->table[k][0] + txs_lay_row(&s->view, t, x, y) * TXS_MAX_LABELS,
                        s->labels);
        if (t->kind == TXS_LAY_PAIR)
            txs_lay_add_row(energy,
                            s->table[k][1] + at[-(t->dy * map->stride + t->dx)] * TXS_MAX_LABELS,
                            s->labels);
    }
    int best = 0;
    for (int v = 1; v < s->labels; v++)
        if (energy[v] < energy[best]) best = v;
    if (best == *at) return;
    txs_lay_tally(s, x, y, -1);
    txs_lay_change(s, x, y, (uint8_t)best);
    txs_lay_tally(s, x, y, 1);
}

/* Visit every pixel once. */
static void txs_lay_sweep(txs_lay_sampler *s, int sweep) {
    enum { ALL = TXS_LAY_GRID * TXS_LAY_GRID };
    int order[ALL];
    txm_rng rng = txm_rng_make(s->seed, (uint64_t)sweep);
    for (int i = 0; i < ALL; i++) order[i] = i;
    txm_shuffle(&rng, order, ALL);
    for (int i = 0; i < ALL; i += TXS_LAY_GROUP) {
        for (int top = 0; top < s->view.map->height; top += TXS_LAY_GRID) {
            for (int j = i; j < i + TXS_LAY_GROUP; j++) {
                const int y = top + order[j] / TXS_LAY_GRID;
                if (y >= s->view.map->height) continue;
                for (int x = order[j] % TXS_LAY_GRID; x < s->view.map->width; x += TXS_LAY_GRID)
                    txs_lay_visit(s, x, y, &rng);
            }
        }
        for (int k = 0; k < s->level->type_count; k++)
            txs_lay_control(s, k, i + TXS_LAY_GROUP == ALL);
    }
}

/* Count the map as it is; to be called whenever the level has got types. */
static void txs_lay_sampler_start(txs_lay_sampler *s) {
    for (int r = 0; r < TXS_LAY_RINGS; r++) {
        for (int y = 0; y < s->view.map->height; y++) {
            for (int x = 0; x < s->view.map->width; x++) {
                const int alike = txs_lay_alike(s->view.map, x, y, 1 << r);
                txs_lay_set(&s->alike[r], x, y, (uint8_t)(alike < 0 ? (int)TXS_OUTSIDE : alike));
            }
        }
    }
    for (int k = 0; k < s->level->type_count; k++) {
        txs_lay_count(&s->view, &s->level->types[k], s->count[k]);
        txs_lay_control(s, k, 0);
    }
}

/* Where the potentials of a type start. What the example does not have although there would be
   much of it by chance has a high potential that stays: a label in a band of the field in which it
   has no neighbour, two labels that never touch, or only one way round. So a sky stays above the
   ground. Shares alone would allow it a little, for the sake of other shares. */
static void txs_lay_forbid(const txs_lay_type *t, int labels, int field, int32_t *integral) {
    const int32_t nat = TXS_LAY_NAT * TXS_LAY_FINE;
    const int bands = field ? (int)TXS_BANDS_OF_FIELD : 1;
    const int touching = abs(t->dx) + abs(t->dy) == 1;
    int64_t in_row[TXS_MAX_LABELS] = {0}, in_column[TXS_MAX_LABELS] = {0};
    for (int i = 0; i < TXS_LAY_BINS; i++) {
        in_row[i / TXS_MAX_LABELS] += t->share[i];
        in_column[i % TXS_MAX_LABELS] += t->share[i];
    }
    for (int row = 0; row < TXS_MAX_LABELS; row++) {
        for (int label = 0; label < labels; label++) {
            const int i = row * TXS_MAX_LABELS + label;
            const int64_t by_chance = in_row[row] * in_column[label] / TXS_ONE;
            int32_t about = t->share[i];
            if (t->kind == TXS_LAY_PAIR && row < labels && about == 0)
                integral[i] = (touching && by_chance > TXS_LAY_MUCH ? (int)TXS_LAY_NEVER
                                                                    : (int)TXS_LAY_UNSEEN) *
                              nat;
            if (t->kind != TXS_LAY_FIELD || row >= bands) continue;
            if (row > 0) about += t->share[i - TXS_MAX_LABELS];
            if (row + 1 < bands) about += t->share[i + TXS_MAX_LABELS];
            if (about == 0) integral[i] = TXS_LAY_NEVER * nat;
        }
    }
}

static txs_lay_sampler *txs_lay_sampler_make(txm_arena *arena, const txs_lay_level *level,
                                             const txs_lay_view *view, int labels, int max_types,
                                             const int16_t *noise, uint64_t seed) {
    const size_t n = (size_t)max_types;
    txs_lay_sampler *s = (txs_lay_sampler *)txm_arena_zero(arena, 1, sizeof *s);
    if (!s) return NULL;
    s->level = level;
    s->view = *view;
    s->labels = labels;
    s->noise = noise;
    s->seed = seed;
    s->heat = TXS_LAY_HOT;
    s->count = (int32_t(*)[TXS_LAY_BINS])txm_arena_zero(arena, n, sizeof *s->count);
    s->integral = (int32_t(*)[TXS_LAY_BINS])txm_arena_zero(arena, n, sizeof *s->integral);
    s->table = (int16_t(*)[2][TXS_LAY_TABLE])txm_arena_zero(arena, n, sizeof *s->table);
    for (int k = 0; k < level->type_count && s->integral; k++)
        txs_lay_forbid(&level->types[k], labels, view->field, s->integral[k]);
    for (int r = 0; r < TXS_LAY_RINGS; r++) {
        txs_lay_plane *p = &s->alike[r];
        *p = *view->map;
        p->pixels = (uint8_t *)txm_arena_alloc(arena, txs_lay_bytes(p), 1);
        if (p->pixels) memset(p->pixels, TXS_OUTSIDE, txs_lay_bytes(p));
    }
    if (view->parent) {
        s->plain =
            (uint8_t *)txm_arena_alloc(arena, (size_t)view->map->width, (size_t)view->map->height);
        if (s->plain) txs_lay_find_plain(view->parent, s->plain);
    }
    return arena->failed ? NULL : s;
}

#endif /* TEXSYN_LAYOUT_SAMPLER_H */
