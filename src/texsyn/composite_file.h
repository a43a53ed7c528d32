#ifndef TEXSYN_COMPOSITE_FILE_H
#define TEXSYN_COMPOSITE_FILE_H

#include "composite.h"

/* ---- the composite as bytes ------------------------------------------------------------------

   The same code as that of a model (see file.h), over the layout, the models of the labels one
   after the other, and the crossing types. docs/model-format.md describes the bytes.          */

enum { TXS_LAY_SIDE_BITS = 24 };

/* Contexts: of displacements and histograms of the layout by kind, of those of crossing types. */
typedef struct txs_composite_codec {
    txs_context place[2], share[4][8];
    txs_context cross_place[2], cross_share[8];
    txs_codec model;
} txs_composite_codec;

/* Type k of a level. The histogram of the last one of its kind predicts its own. */
static void txs_code_lay_type(txs_coder *c, txs_composite_codec *z, const txs_layout *layout,
                              int level, int k) {
    const txs_lay_level *l = &layout->level[level];
    txs_lay_type *t = &l->types[k];
    int before = k - 1;
    t->kind = txs_limited(c, 2, TXS_LAY_FIELD, TXS_LAY_RING, t->kind);
    if ((t->kind == TXS_LAY_FIELD) != (k == 0)) c->bad = 1;
    if (t->kind == TXS_LAY_PARENT && level + 1 == layout->levels) c->bad = 1;
    if (t->kind != TXS_LAY_FIELD) {
        t->dx = txs_number(c, &z->place[0], t->dx);
        t->dy = txs_number(c, &z->place[1], t->dy);
    }
    if (t->kind == TXS_LAY_RING && ((t->dx != 1 && t->dx != 2 && t->dx != 4) || t->dy)) c->bad = 1;
    if (t->kind == TXS_LAY_PARENT && (t->dx & ~1 || t->dy & ~1)) c->bad = 1;
    if (t->kind == TXS_LAY_PAIR &&
        ((!t->dx && !t->dy) || abs(t->dx) > TXS_LAY_REACH || abs(t->dy) > TXS_LAY_REACH))
        c->bad = 1;
    if (c->bad) return;
    while (before >= 0 && l->types[before].kind != t->kind) before--;
    txs_sequence(c, z->share[t->kind], t->root, before >= 0 ? l->types[before].root : NULL,
                 txs_lay_rows(layout, t->kind) * layout->labels, 0, TXS_LAY_SCALE, TXS_NONE);
    if (!c->bad && !txs_lay_unround(layout, t)) c->bad = 1;
}

/* Returns 0 if there is no memory. */
static int txs_code_layout(txs_coder *c, txs_composite_codec *z, txs_layout *layout,
                           txm_arena *arena) {
    const int most = (1 << TXS_LAY_SIDE_BITS) - 1;
    layout->field = txs_limited(c, 2, 0, 2, layout->field);
    layout->width = txs_limited(c, TXS_LAY_SIDE_BITS, 1, most, layout->width);
    layout->height = txs_limited(c, TXS_LAY_SIDE_BITS, 1, most, layout->height);
    layout->levels = txs_limited(c, 3, 1, TXS_LAY_LEVELS, layout->levels);
    for (int i = layout->levels - 1; i >= 0 && !c->bad; i--) {
        txs_lay_level *l = &layout->level[i];
        if (layout->width >> i == 0 || layout->height >> i == 0) c->bad = 1;
        l->type_count = txs_limited(c, 6, 1, TXS_LAY_TYPES, l->type_count);
        if (c->bad) break;
        if (c->reading)
            l->types =
                (txs_lay_type *)txm_arena_zero(arena, (size_t)l->type_count, sizeof(txs_lay_type));
        if (!l->types) return 0;
        for (int k = 0; k < l->type_count && !c->bad; k++) txs_code_lay_type(c, z, layout, i, k);
    }
    return 1;
}

/* Crossing type k of a level; the last one of the same bands predicts its histogram. */
static void txs_code_crossing(txs_coder *c, txs_composite_codec *z, const texsyn_composite *m,
                              int level, int k) {
    txs_crossing *x = &m->crossing[level][k];
    txs_type *t = &x->type;
    int before = k - 1;
    x->tail = txs_limited(c, 4, 0, m->labels - 1, x->tail);
    x->head = txs_limited(c, 4, 0, m->labels - 1, x->head);
    if (c->bad || x->tail >= x->head) {
        c->bad = 1;
        return;
    }
    t->kind = TEXSYN_VALUES;
    t->band = txs_limited(c, 2, 0, m->model[x->tail]->bands - 1, t->band);
    t->other = txs_limited(c, 2, 0, m->model[x->head]->bands - 1, t->other);
    t->dx = txs_number(c, &z->cross_place[0], t->dx);
    t->dy = txs_number(c, &z->cross_place[1], t->dy);
    if (c->bad || (!t->dx && !t->dy) || abs(t->dx) > TXS_CROSS_REACH ||
        abs(t->dy) > TXS_CROSS_REACH) {
        c->bad = 1;
        return;
    }
    while (before >= 0) {
        const txs_crossing *o = &m->crossing[level][before];
        if (o->tail == x->tail && o->head == x->head && o->type.band == t->band &&
            o->type.other == t->other)
            break;
        before--;
    }
    txs_sequence(c, z->cross_share, t->root,
                 before >= 0 ? m->crossing[level][before].type.root : NULL, TXS_BINS, 0,
                 TXS_CROSS_SCALE, TXS_NONE);
    if (!c->bad && !txs_cross_unround(t)) c->bad = 1;
}

/* May the ends of a level's crossing types be added up at one pixel? */
static int txs_crossings_fit(const texsyn_composite *m, int level) {
    int ends[TXS_MAX_LABELS][TXS_MAX_BANDS] = {{0}};
    for (int i = 0; i < m->crossings[level]; i++) {
        const txs_crossing *x = &m->crossing[level][i];
        if (++ends[x->tail][x->type.band] > TXS_CROSS_ENDS ||
            ++ends[x->head][x->type.other] > TXS_CROSS_ENDS)
            return 0;
    }
    return 1;
}

/* The whole composite, to or from the coder; what reading allocates goes to its arena. Returns 0 if
   there is no memory. */
static int txs_code_composite(txs_coder *c, texsyn_composite *m, txs_composite_codec *z) {
    txs_contexts_init(z->place, 2);
    txs_contexts_init(&z->share[0][0], 4 * 8);
    txs_contexts_init(z->cross_place, 2);
    txs_contexts_init(z->cross_share, 8);
    m->labels = m->layout.labels = txs_limited(c, 5, 1, TXS_MAX_LABELS, m->labels);
    if (c->bad) return 1;
    if (!txs_code_layout(c, z, &m->layout, &m->arena)) return 0;
    for (int k = 0; k < m->labels && !c->bad; k++) {
        if (c->reading) {
            m->model[k] = (texsyn_model *)txm_arena_zero(&m->arena, 1, sizeof *m->model[k]);
            if (!m->model[k]) return 0;
            m->model[k]->arena = m->arena;
        }
        const int room = txs_code_model(c, m->model[k], &z->model);
        if (c->reading) m->arena = m->model[k]->arena;
        if (!room) return 0;
        if (m->model[k]->channels != m->model[0]->channels ||
            m->model[k]->levels != m->model[0]->levels)
            c->bad = 1;
    }
    if (c->bad) return 1;
    m->channels = m->model[0]->channels;
    m->levels = m->model[0]->levels;
    for (int i = 0; i < m->levels && !c->bad; i++) {
        m->crossings[i] = txs_limited(c, 9, 0, TXS_MAX_CROSSINGS, m->crossings[i]);
        if (c->bad) break;
        if (c->reading)
            m->crossing[i] = (txs_crossing *)txm_arena_zero(
                &m->arena, (size_t)(m->crossings[i] ? m->crossings[i] : 1), sizeof(txs_crossing));
        if (!m->crossing[i]) return 0;
        for (int k = 0; k < m->crossings[i] && !c->bad; k++) txs_code_crossing(c, z, m, i, k);
        if (!c->bad && !txs_crossings_fit(m, i)) c->bad = 1;
    }
    return 1;
}

/* ---- public: composites ---------------------------------------------------------------------- */

/* A copy that the coder may write to; NULL without memory. */
static texsyn_composite *txs_composite_copy(const texsyn_composite *from, txm_env *env) {
    texsyn_composite *c = txs_composite_make(env, from->channels, from->labels);
    if (!c) return NULL;
    c->levels = from->levels;
    c->layout = from->layout;
    for (int i = 0; i < from->layout.levels; i++) {
        txs_lay_level *l = &c->layout.level[i];
        const size_t count = (size_t)l->type_count;
        l->types = (txs_lay_type *)txm_arena_alloc(&c->arena, count, sizeof *l->types);
        if (!l->types) {
            texsyn_composite_free(c);
            return NULL;
        }
        memcpy(l->types, from->layout.level[i].types, count * sizeof *l->types);
    }
    for (int k = 0; k < from->labels; k++) {
        texsyn_model *m = c->model[k];
        const texsyn_model *old = from->model[k];
        for (int i = 0; i < TXS_MAX_LEVELS; i++) {
            txs_type *types = m->level[i].types;
            const size_t count = i < old->levels ? (size_t)old->level[i].type_count : 0;
            if (count) memcpy(types, old->level[i].types, count * sizeof *types);
            m->level[i] = old->level[i];
            m->level[i].types = types;
        }
        m->channels = old->channels;
        m->bands = old->bands;
        m->levels = old->levels;
        memcpy(m->mean, old->mean, sizeof m->mean);
        memcpy(m->basis, old->basis, sizeof m->basis);
        memcpy(m->dither, old->dither, sizeof m->dither);
    }
    for (int i = 0; i < from->levels; i++) {
        c->crossings[i] = from->crossings[i];
        memcpy(c->crossing[i], from->crossing[i], sizeof(txs_crossing) * (size_t)c->crossings[i]);
    }
    return c;
}

typedef struct txs_described_composite {
    texsyn_composite *composite;
    txs_composite_codec *codec;
} txs_described_composite;

static void txs_describe_composite(txs_coder *c, void *what) {
    txs_described_composite *m = (txs_described_composite *)what;
    txs_code_composite(c, m->composite, m->codec);
}

TEXSYN_API txm_status texsyn_composite_save(const texsyn_composite *composite, txm_env *env,
                                            void *buffer, size_t capacity, size_t *size) {
    if (!composite || !size)
        return txm_fail(env, TXM_BAD_ARGUMENT, "save: composite or size is NULL");
    txm_status status = TXM_OK;
    txs_composite_codec *z = (txs_composite_codec *)txm_alloc(env, sizeof *z);
    texsyn_composite *copy = z ? txs_composite_copy(composite, env) : NULL;
    if (!copy) status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to save the composite");
    txs_described_composite what = {copy, z};
    if (copy) /* version 1 is that of the labels' models too, which have no filters */
        status = txs_write("TXC", 1, txs_describe_composite, &what, env, buffer, capacity, size);
    texsyn_composite_free(copy);
    txm_free(env, z);
    return status;
}

TEXSYN_API txm_status texsyn_composite_load(const void *data, size_t size, txm_env *env,
                                            texsyn_composite **out) {
    const uint8_t *bytes = (const uint8_t *)data;
    if (out) *out = NULL;
    if (!data || !out) return txm_fail(env, TXM_BAD_ARGUMENT, "load: data or out is NULL");
    if (size < TXS_MAGIC_BYTES + TXS_CRC_BYTES || memcmp(bytes, "TXC1", TXS_MAGIC_BYTES) != 0)
        return txm_fail(env, TXM_BAD_DATA, "not a texsyn composite");
    if (!txs_is_intact(bytes, size))
        return txm_fail(env, TXM_BAD_DATA, "the composite is damaged or cut short");

    txm_arena arena;
    txm_arena_init(&arena, env);
    texsyn_composite *m = (texsyn_composite *)txm_arena_zero(&arena, 1, sizeof *m);
    txs_composite_codec *z = (txs_composite_codec *)txm_alloc(env, sizeof *z);
    txs_coder c = txs_reader(bytes, size);
    int enough = m && z;
    if (m) m->arena = arena;
    if (enough) {
        enough = txs_code_composite(&c, m, z);
        c.bad |= c.at != c.size; /* the coder reads just what was written */
    }
    txm_free(env, z);
    if (enough && !c.bad) {
        *out = m;
        return TXM_OK;
    }
    texsyn_composite_free(m);
    return enough ? txm_fail(env, TXM_BAD_DATA, "the composite's contents contradict each other")
                  : txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to load the composite");
}

#endif /* TEXSYN_COMPOSITE_FILE_H */
