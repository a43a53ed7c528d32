#ifndef TEXSYN_COMPOSITE_H
#define TEXSYN_COMPOSITE_H

#include "fill.h"
#include "synthesis.h"
#include "layout_learn.h"

/* ---- composite textures ----------------------------------------------------------------------

   A composite texture is a label map, itself a texture, and a texture for each label [1, section
   4]. All its textures are learned and synthesised in one run, as a mosaic, with crossing types for
   what happens where two of them meet. */
enum {
    TXS_COMPOSITE_TOP = 64,     /* pixels: short side of the coarsest level, about */
    TXS_COMPOSITE_FEW = 256,    /* pixels: a label with fewer cannot be learned    */
    TXS_COMPOSITE_SPARSE = 64,  /* pixels: with fewer a coarse level is left out   */
    TXS_COMPOSITE_CANVAS = 320, /* pixels: a side of what is synthesised to learn  */
    TXS_COMPOSITE_TYPES = 10,   /* clique types per label and level                */
    TXS_COMPOSITE_REFRESH = 4,  /* sub-lattices                                    */
    TXS_COMPOSITE_SOFT = 400,   /* pixels, see txs_soften                          */
    TXS_CROSS_SCALE = 20,       /* steps of the root of a share of a crossing type */
    TXS_CROSS_DOUBT = 2,        /* square steps, added to shares before they are compared */
    TXS_COMPOSITE_COOL = 30     /* percent: temperature of the last sweep          */
};

struct texsyn_composite {
    txm_arena arena; /* holds all of it */
    int channels, labels, levels;
    txs_layout layout;
    texsyn_model *model[TXS_MAX_LABELS];
    txs_crossing *crossing[TXS_MAX_LEVELS]; /* TXS_MAX_CROSSINGS at most */
    int crossings[TXS_MAX_LEVELS];
};

/* What learning works with. */
typedef struct txs_composer {
    const texsyn_composite_learn_desc *desc;
    texsyn_composite *composite;
    txm_image example;
    txs_ground source[TXS_MAX_LEVELS], canvas[TXS_MAX_LEVELS];
    txs_mosaic from, from_above, to, to_above; /* of the source, of the canvas */
    txs_raise_map *maps;
    int16_t *noise, *cool;
} txs_composer;

/* Room for a composite whose models have all their types. */
static texsyn_composite *txs_composite_make(txm_env *env, int channels, int labels) {
    txm_arena arena;
    txm_arena_init(&arena, env);
    texsyn_composite *c = (texsyn_composite *)txm_arena_zero(&arena, 1, sizeof *c);
    if (!c) return NULL;
    c->channels = channels;
    c->labels = labels;
    for (int k = 0; k < labels; k++) c->model[k] = txs_fill_model_make(&arena, channels);
    for (int i = 0; i < TXS_MAX_LEVELS; i++)
        c->crossing[i] =
            (txs_crossing *)txm_arena_zero(&arena, TXS_MAX_CROSSINGS, sizeof(txs_crossing));
    if (arena.failed) {
        txm_arena_free(&arena);
        return NULL;
    }
    c->arena = arena;
    return c;
}

/* ---- learning a composite: the example ------------------------------------------------------- */

/* A level on which a label has too few pixels: it is of one colour there, the mean. */
static void txs_composite_blank(texsyn_model *m, int index) {
    txs_level *l = &m->level[index];
    l->type_count = 0;
    for (int b = 0; b < m->bands; b++) {
        txs_type *t = txs_add_type(l, TEXSYN_SINGLE, b, b, 0, 0);
        l->values[b] = 1;
        l->low[b] = 0;
        l->step[b] = 1;
        t->share[0] = TXS_ONE;
        txs_make_classes(m, l, b);
    }
}

static size_t txs_composite_count(const txs_ground *g, int label) {
    const size_t pixels = (size_t)g->width * (size_t)g->height;
    size_t count = 0;
    for (size_t i = 0; i < pixels; i++) count += g->label[i] == label;
    return count;
}

/* The pyramid of the example, and how its bands are quantised. */
static txm_status txs_composite_prepare(txs_composer *w, txm_arena *arena, txm_env *env) {
    texsyn_composite *c = w->composite;
    txs_ground *g = w->source;
    const size_t pixels = (size_t)g->width * (size_t)g->height;
    const int side = g->width < g->height ? g->width : g->height;
    uint8_t *bytes = (uint8_t *)txm_arena_alloc(arena, pixels, (size_t)c->channels);
    float *values = (float *)txm_arena_alloc(arena, pixels, (size_t)c->channels * sizeof *values);
    if (arena->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the example");
    for (int k = 0; k < c->labels; k++)
        txs_ground_find_bands(&g[0], &w->example, k, c->model[k], bytes);
    txs_ground_split(&g[0], &w->example, c->model);
    if (!txs_ground_show(&g[0], c->model, c->labels, arena))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the example");
    c->levels = 1;
    while (c->levels < TXS_MAX_LEVELS && side >> c->levels >= TXS_COMPOSITE_TOP) {
        const txs_ground *fine = &g[c->levels - 1];
        if (!txs_ground_make(&g[c->levels], arena, (fine->width + 1) / 2, (fine->height + 1) / 2,
                             c->channels, 1))
            return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the example");
        txs_ground_halve(fine, &g[c->levels++]);
    }
    for (int k = 0; k < c->labels; k++) {
        texsyn_model *m = c->model[k];
        m->levels = c->levels;
        for (int i = 0; i < c->levels; i++) {
            if (txs_composite_count(&g[i], k) < TXS_COMPOSITE_SPARSE) txs_composite_blank(m, i);
            else
                txs_ground_quantise(&g[i], k, m->bands, &m->level[i], values, bytes,
                                    i ? NULL : m->dither);
        }
    }
    return TXM_OK;
}

/* ---- learning a composite: the levels -------------------------------------------------------- */

/* Labels of a ground from a map; all is to be synthesised. */
static int txs_composite_ground(txs_ground *g, txm_arena *arena, const txs_lay_plane *map,
                                int bands) {
    if (!txs_ground_make(g, arena, map->width, map->height, bands, 0)) return 0;
    for (int y = 0; y < g->height; y++) {
        for (int x = 0; x < g->width; x++) {
            const int label = *txs_lay_at(map, x, y);
            const size_t i = (size_t)y * (size_t)g->width + (size_t)x;
            g->label[i] = (uint8_t)(label == TXS_OUTSIDE ? (int)TXS_NO_LABEL : label);
            g->state[i] = TXS_FREE;
        }
    }
    return 1;
}

static int txs_composite_pyramid(txs_ground *g, txm_arena *arena, int levels) {
    for (int i = 1; i < levels; i++) {
        if (!txs_ground_make(&g[i], arena, (g[i - 1].width + 1) / 2, (g[i - 1].height + 1) / 2,
                             g[i - 1].bands, 0))
            return 0;
        txs_ground_halve(&g[i - 1], &g[i]);
    }
    return 1;
}

/* The textures of all labels on a level. */
static void txs_composite_textures(const texsyn_composite *c, int index, txs_texture *texture) {
    for (int k = 0; k < c->labels; k++) {
        texture[k].model = c->model[k];
        texture[k].level = &c->model[k]->level[index];
    }
}

/* The canvas of a level, started from the one above, which is freed. */
static txm_status txs_composite_enter(const texsyn_composite *c, int index, const txs_ground *g,
                                      txs_mosaic *m, txs_mosaic *above, txs_raise_map *maps,
                                      uint64_t seed, txm_env *env) {
    txs_texture texture[TXS_MAX_LABELS], coarser[TXS_MAX_LABELS];
    const int has_parents = above->canvas.pixels != NULL;
    int reach = TXS_NEAR;
    txs_composite_textures(c, index, texture);
    for (int k = 0; k < c->labels; k++)
        for (int i = 0; i < texture[k].level->type_count; i++)
            if (txs_reach(&texture[k].level->types[i]) > reach)
                reach = txs_reach(&texture[k].level->types[i]);
    if (!txs_mosaic_make(m, env, &g[index], c->labels, reach, has_parents))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the canvas");
    txs_mosaic_lay(m, &g[index], texture, seed);
    if (has_parents) {
        txs_composite_textures(c, index + 1, coarser);
        txs_mosaic_raise(m, above, coarser, texture, maps);
        txs_mosaic_free(above, env);
    }
    return TXM_OK;
}

static txm_status txs_composite_level(txs_composer *w, int index, txm_env *env, float from,
                                      float to) {
    texsyn_composite *c = w->composite;
    const uint64_t seed = txm_hash(w->desc->seed + (uint64_t)index);
    const int types = w->desc->max_types ? w->desc->max_types : (int)TXS_COMPOSITE_TYPES;
    const txs_study_plan plan = {6,
                                 3,
                                 10,
                                 types,
                                 6,
                                 TXS_NEAR,
                                 TXS_COMPOSITE_REFRESH,
                                 TXS_COMPOSITE_SOFT,
                                 c->labels > 1 && index < 2,
                                 seed,
                                 w->noise,
                                 NULL,
                                 NULL};
    txm_status status =
        txs_composite_enter(c, index, w->source, &w->from, &w->from_above, w->maps, seed, env);
    if (status == TXM_OK)
        status = txs_composite_enter(c, index, w->canvas, &w->to, &w->to_above, w->maps, seed, env);
    if (status == TXM_OK)
        status = txs_mosaic_learn(&plan, index, c->model, &w->from, &w->to, c->crossing[index],
                                  &c->crossings[index], env, from, to);
    w->from_above = w->from;
    w->to_above = w->to;
    memset(&w->from, 0, sizeof w->from);
    memset(&w->to, 0, sizeof w->to);
    return status;
}

/* What is kept of a crossing type: the roots of its shares, coarsely; no potentials, which the
   control finds again in a few sweeps. */
static void txs_cross_round(txs_type *t) {
    for (int i = 0; i < TXS_BINS; i++)
        t->root[i] = (int16_t)floor(
            sqrt((double)t->share[i] / (double)TXS_ONE) * (double)TXS_CROSS_SCALE + 0.5);
}

/* The inverse, and potentials to start from: half of what the log of a share over that by chance
   says, the rest being said by other types. 0 for an empty histogram. */
static int txs_cross_unround(txs_type *t) {
    const double doubt = TXS_CROSS_DOUBT;
    int32_t total = 0, tail[TXS_CLASSES] = {0}, head[TXS_CLASSES] = {0};
    for (int i = 0; i < TXS_BINS; i++) {
        const int32_t square = t->root[i] * t->root[i];
        total += square;
        tail[i / TXS_CLASSES] += square;
        head[i % TXS_CLASSES] += square;
    }
    for (int i = 0; i < TXS_BINS && total; i++) {
        const double square = t->root[i] * t->root[i];
        const int a = i / TXS_CLASSES, b = i % TXS_CLASSES;
        const double chance = (double)tail[a] * head[b] / total;
        t->share[i] = (int32_t)((int64_t)t->root[i] * t->root[i] * TXS_ONE / total);
        t->potential[i] =
            (int16_t)floor(-log((square + doubt) / (chance + doubt)) * (double)TXS_NAT / 2 + 0.5);
    }
    return total > 0;
}

/* Round what was measured to what a file keeps, and read that again, so that saving loses nothing. */
static txm_status txs_composite_settle(texsyn_composite *c, txm_env *env, texsyn_composite **out) {
    size_t size = 0;
    for (int i = 0; i < c->layout.levels; i++)
        for (int k = 0; k < c->layout.level[i].type_count; k++)
            txs_lay_round(&c->layout, &c->layout.level[i].types[k]);
    for (int i = 0; i < c->levels; i++) {
        for (int k = 0; k < c->labels; k++)
            for (int j = 0; j < c->model[k]->level[i].type_count; j++)
                txs_round_statistics(&c->model[k]->level[i].types[j], i);
        for (int j = 0; j < c->crossings[i]; j++) txs_cross_round(&c->crossing[i][j].type);
    }
    txm_status status = texsyn_composite_save(c, env, NULL, 0, &size);
    if (status != TXM_OK) return status;
    uint8_t *bytes = (uint8_t *)txm_alloc(env, size);
    if (!bytes) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the composite");
    status = texsyn_composite_save(c, env, bytes, size, &size);
    if (status == TXM_OK) status = texsyn_composite_load(bytes, size, env, out);
    txm_free(env, bytes);
    return status;
}

/* The labels of the example: as given, or found. */
static txm_status txs_composite_labels(const texsyn_composite_learn_desc *d, txs_lay_plane *map,
                                       int *labels, txm_env *env) {
    const txm_image given = txm_image_resolve(d->labels);
    int64_t count[TXS_MAX_LABELS] = {0};
    if (!txs_lay_plane_make(map, env, d->example.width, d->example.height, 0, 0))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the label map");
    *labels = 0;
    for (int y = 0; y < map->height; y++) {
        const uint8_t *row = (const uint8_t *)txm_image_row_const(&given, y);
        for (int x = 0; x < map->width; x++) {
            if (row[x] == TXS_NO_LABEL) continue;
            if (row[x] >= TXS_MAX_LABELS)
                return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                        "labels: # occurs; they must be 0 to 15, or 255 for none",
                                        row[x], 0);
            txs_lay_set(map, x, y, row[x]);
            count[row[x]]++;
            if (row[x] >= *labels) *labels = row[x] + 1;
        }
    }
    if (*labels == 0)
        return txm_fail(env, TXM_TOO_SMALL, "labels: 255 everywhere; nothing can be learned");
    for (int k = 0; k < *labels; k++)
        if (count[k] < TXS_COMPOSITE_FEW)
            return txm_fail_numbers(
                env, TXM_TOO_SMALL,
                "label #: has # pixels; at least 256 (16 x 16) are needed to learn from",
                (uint64_t)k, (uint64_t)count[k]);
    return TXM_OK;
}

static txm_status txs_composite_check(const texsyn_composite_learn_desc *d, txm_env *env) {
    txm_status status;
    if (!d) return txm_fail(env, TXM_BAD_ARGUMENT, "composite: desc is NULL");
    if ((status = txm_image_check(&d->example, "example", TEXSYN_MAX_PIXELS, env)) != TXM_OK)
        return status;
    if (d->example.channels == 2)
        return txm_fail(env, TXM_BAD_ARGUMENT, "example: 2 channels; give 1, 3 or 4");
    if (d->example.width < 32 || d->example.height < 32)
        return txm_fail(env, TXM_TOO_SMALL, "example: smaller than 32 x 32");
    if ((status = txm_image_check(&d->labels, "labels", TEXSYN_MAX_PIXELS, env)) != TXM_OK)
        return status;
    if (d->labels.width != d->example.width || d->labels.height != d->example.height ||
        d->labels.channels > 1 || d->labels.sample != TXM_U8)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "labels: must have 1 channel of 8 bits and the size of the example");
    if (d->max_types < 0 || d->max_types > (int)TXS_MAX_TYPES - (int)TXS_PRESELECTED)
        return txm_fail(env, TXM_BAD_ARGUMENT, "max_types must be 0 to 64");
    if (d->field < TEXSYN_FIELD_AUTO || d->field > TEXSYN_FIELD_COLUMNS)
        return txm_fail(env, TXM_BAD_ARGUMENT, "field is not one of texsyn_field");
    if (d->example.sample == TXM_F32 && !txm_image_is_finite(&d->example))
        return txm_fail(env, TXM_BAD_ARGUMENT, "example: a sample is not finite");
    return TXM_OK;
}

/* Learn everything once the label map is known. */
static txm_status txs_composite_run(txs_composer *w, const txs_lay_plane *map, txm_arena *arena,
                                    txm_env *env) {
    texsyn_composite *c = w->composite;
    const size_t entries = (size_t)TXS_NOISE + TXS_VALUES;
    const int width = txm_clampi(map->width, 1, TXS_COMPOSITE_CANVAS);
    const int height = txm_clampi(map->height, 1, TXS_COMPOSITE_CANVAS);
    txs_lay_plane drawn;
    float total = 0, from = 0.2f;
    w->noise = (int16_t *)txm_arena_alloc(arena, entries, sizeof *w->noise);
    w->maps = (txs_raise_map *)txm_arena_alloc(arena, (size_t)c->labels, sizeof *w->maps);
    if (arena->failed || !txs_composite_ground(&w->source[0], arena, map, c->channels))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the example");
    w->source[0].value = (float *)txm_arena_zero(arena, (size_t)map->width * (size_t)map->height,
                                                 sizeof(float) * (size_t)c->channels);
    if (arena->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the example");
    memset(w->source[0].state, TXS_SOURCE, (size_t)map->width * (size_t)map->height);
    txs_noise_table(w->noise);
    txm_status status = txs_composite_prepare(w, arena, env);
    if (status == TXM_OK)
        status = txs_layout_learn(map, c->labels, (int)w->desc->field - TEXSYN_FIELD_NONE, w->noise,
                                  w->desc->seed, &c->arena, &c->layout, env, 0, 0.15f);
    if (status == TXM_OK)
        status = txs_layout_make(&c->layout, width, height, 0, w->noise, w->desc->seed, &drawn, env,
                                 0.15f, 0.2f);
    if (status != TXM_OK) return status;
    const int room = txs_composite_ground(&w->canvas[0], arena, &drawn, c->channels) &&
                     txs_composite_pyramid(w->canvas, arena, c->levels);
    txs_lay_plane_free(&drawn, env);
    if (!room) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the canvas");
    for (int i = 0; i < c->levels; i++) total += 1.0f / (float)(1 << 2 * i);
    for (int i = c->levels - 1; i >= 0 && status == TXM_OK; i--) {
        const float next = from + 0.8f / (float)(1 << 2 * i) / total;
        status = txs_composite_level(w, i, env, from, i ? next : 1);
        from = next;
    }
    return status;
}

TEXSYN_API txm_status texsyn_composite_learn(const texsyn_composite_learn_desc *desc, txm_env *env,
                                             texsyn_composite **out) {
    if (out) *out = NULL;
    else return txm_fail(env, TXM_BAD_ARGUMENT, "composite: out is NULL");
    txs_lay_plane map;
    txs_composer w;
    txm_arena arena;
    int labels;
    txm_status status = txs_composite_check(desc, env);
    if (status != TXM_OK) return status;
    memset(&w, 0, sizeof w);
    txm_arena_init(&arena, env);
    w.desc = desc;
    w.example = txm_image_resolve(desc->example);
    status = txs_composite_labels(desc, &map, &labels, env);
    if (status == TXM_OK) {
        w.composite = txs_composite_make(env, w.example.channels, labels);
        if (!w.composite) status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the composite");
    }
    if (status == TXM_OK) status = txs_composite_run(&w, &map, &arena, env);
    txs_mosaic_free(&w.from, env);
    txs_mosaic_free(&w.from_above, env);
    txs_mosaic_free(&w.to, env);
    txs_mosaic_free(&w.to_above, env);
    txs_lay_plane_free(&map, env);
    txm_arena_free(&arena);
    if (status == TXM_OK) status = txs_composite_settle(w.composite, env, out);
    texsyn_composite_free(w.composite);
    return status;
}

TEXSYN_API void texsyn_composite_free(texsyn_composite *composite) {
    if (composite) txm_arena_free(&composite->arena);
}

TEXSYN_API int texsyn_composite_label_count(const texsyn_composite *composite) {
    return composite ? composite->labels : 0;
}

TEXSYN_API const texsyn_model *texsyn_composite_model(const texsyn_composite *composite,
                                                      int label) {
    return composite && label >= 0 && label < composite->labels ? composite->model[label] : NULL;
}

/* ---- synthesising a composite ---------------------------------------------------------------- */

static int txs_composite_sweeps(int level, int quality) {
    static const int sweeps[5][3] = {
        {3, 4, 10}, {5, 7, 16}, {9, 12, 24}, {13, 18, 32}, {20, 28, 44}};
    return sweeps[quality + 2][level > 2 ? 2 : level];
}

static txm_status txs_composite_check_desc(const texsyn_composite_desc *d, int channels,
                                           const txm_image *out, txm_env *env) {
    txm_status status;
    if (!d || !d->composite)
        return txm_fail(env, TXM_BAD_ARGUMENT, "composite: desc or composite is NULL");
    if (d->width < 1 || d->height < 1)
        return txm_fail(env, TXM_BAD_ARGUMENT, "width and height must be 1 or more");
    if (d->height > TEXSYN_MAX_PIXELS / d->width)
        return txm_fail(env, TXM_TOO_LARGE, "more than TEXSYN_MAX_PIXELS pixels; make tiles");
    if (d->quality < -2 || d->quality > 2)
        return txm_fail(env, TXM_BAD_ARGUMENT, "quality must be -2 to 2");
    if ((status = txm_image_check(out, "out", 0, env)) != TXM_OK) return status;
    const int has = out->channels ? out->channels : 1;
    if (out->width != d->width || out->height != d->height)
        return txm_fail(env, TXM_BAD_ARGUMENT, "out: must have the size of the synthesis");
    if (channels == 0 && (has != 1 || out->sample != TXM_U8))
        return txm_fail(env, TXM_BAD_ARGUMENT, "out: must have 1 channel of 8 bits");
    if (has == 2 || has < channels)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "out: must have the channels of the composite, or 3 or 4");
    if (!d->layout.pixels) return TXM_OK;
    if ((status = txm_image_check(&d->layout, "layout", TEXSYN_MAX_PIXELS, env)) != TXM_OK)
        return status;
    if (d->layout.width != d->width || d->layout.height != d->height || d->layout.channels > 1 ||
        d->layout.sample != TXM_U8)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "layout: must have 1 channel of 8 bits and the size of the synthesis");
    const txm_image layout = txm_image_resolve(d->layout);
    for (int y = 0; y < d->height; y++) {
        const uint8_t *row = (const uint8_t *)txm_image_row_const(&layout, y);
        for (int x = 0; x < d->width; x++)
            if (row[x] >= d->composite->labels)
                return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                        "layout: label # occurs; the composite has # of them",
                                        row[x], (uint64_t)d->composite->labels);
    }
    return TXM_OK;
}

/* The label map of a synthesis: as drawn, or synthesised. Fraction 0..to of the whole. */
static txm_status txs_composite_map(const texsyn_composite_desc *d, const int16_t *noise,
                                    txs_lay_plane *map, txm_env *env, float to) {
    if (!d->layout.pixels)
        return txs_layout_make(&d->composite->layout, d->width, d->height, d->quality, noise,
                               txm_hash(d->seed), map, env, 0, to);
    const txm_image layout = txm_image_resolve(d->layout);
    if (!txs_lay_plane_make(map, env, d->width, d->height, 0, 0))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the label map");
    for (int y = 0; y < d->height; y++)
        for (int x = 0; x < d->width; x++)
            txs_lay_set(map, x, y, ((const uint8_t *)txm_image_row_const(&layout, y))[x]);
    return TXM_OK;
}

/* The value of a pixel in steps: within its step it is placed by its neighbours where these are
   smooth, at random where they are not, as in synthesis.h. Neighbours of other labels are left out:
   their steps are others. noise: 16 random bits. */
static float txs_composite_value(const txs_mosaic *m, const uint8_t *p, int band, float spread,
                                 unsigned noise) {
    static const int weight[3][3] = {{1, 2, 1}, {2, 4, 2}, {1, 2, 1}};
    const ptrdiff_t plane = band * m->canvas.plane;
    const int label = p[m->label], value = p[plane];
    int smooth = 1, sum = 0, total = 0;
    for (int i = 0; i < 9; i++) {
        const uint8_t *q = p + (i / 3 - 1) * m->canvas.stride + i % 3 - 1;
        if (q[m->label] != label) continue;
        smooth &= abs(q[plane] - value) <= 1;
        sum += weight[i / 3][i % 3] * (q[plane] - value);
        total += weight[i / 3][i % 3];
    }
    const double off = smooth ? sum / (double)total : noise / 65536.0 - 0.5;
    return txm_float(value + txm_clampf(txm_float(off), -0.5f, 0.5f) * (double)spread);
}

typedef struct txs_composite_painter {
    const texsyn_composite_desc *desc;
    const txs_mosaic *mosaic;
    const txm_image *out;
} txs_composite_painter;

/* From the canvas to the picture: some rows of it. */
static void txs_composite_paint(void *context, int share) {
    const txs_composite_painter *w = (const txs_composite_painter *)context;
    const texsyn_composite *c = w->desc->composite;
    const int end = txm_clampi((share + 1) * TXS_PAINT_ROWS, 0, w->out->height);
    for (int y = share * TXS_PAINT_ROWS; y < end; y++) {
        for (int x = 0; x < w->out->width; x++) {
            const uint8_t *p = txs_pixel(w->mosaic, x, y);
            const texsyn_model *t = c->model[p[w->mosaic->label]];
            const txs_level *l = &t->level[0];
            uint64_t noise =
                txm_hash(((uint64_t)(unsigned)y << 32 | (unsigned)x) ^ txm_hash(w->desc->seed));
            double v[4] = {(double)t->mean[0], (double)t->mean[1], (double)t->mean[2],
                           (double)t->mean[3]};
            for (int b = 0; b < t->bands; b++, noise >>= 16) {
                const float at =
                    txs_composite_value(w->mosaic, p, b, t->dither[b], (unsigned)(noise & 0xffff));
                /* a product of two floats is exact in double, contracted or not */
                const float value = txm_float(txs_value(l, b, (double)at));
                for (int k = 0; k < t->channels; k++)
                    v[k] += (double)value * (double)t->basis[b][k];
            }
            for (int k = 0; k < w->out->channels; k++) {
                const double sample = k == 3 && t->channels < 4 ? 255 : v[t->channels == 1 ? 0 : k];
                txm_image_set(w->out, x, y, k, txm_float(sample / 255));
            }
        }
    }
}

/* All levels, coarse first; the finest stays in *m. */
static txm_status txs_composite_sweep(const texsyn_composite_desc *d, txs_ground *ground,
                                      txs_mosaic *m, const int16_t *noise, const int16_t *cool,
                                      txs_raise_map *maps, txm_env *env) {
    const texsyn_composite *c = d->composite;
    txs_texture texture[TXS_MAX_LABELS];
    txs_mosaic above;
    txm_status status = TXM_OK;
    double work = 0, done = 0;
    memset(&above, 0, sizeof above);
    for (int i = 0; i < c->levels; i++)
        work += (double)txs_composite_sweeps(i, d->quality) / (double)(1 << 2 * i);
    for (int i = c->levels - 1; i >= 0 && status == TXM_OK; i--) {
        const int sweeps = txs_composite_sweeps(i, d->quality);
        const double next = done + (double)sweeps / (double)(1 << 2 * i);
        const txs_brush_plan plan = {TXS_MAX_TYPES, TXS_MAX_CROSSINGS, TXS_COMPOSITE_REFRESH,
                                     TXS_COMPOSITE_SOFT, txm_hash(d->seed + (uint64_t)i)};
        status = txs_composite_enter(c, i, ground, m, &above, maps, txm_hash(d->seed) + (uint64_t)i,
                                     env);
        txs_composite_textures(c, i, texture);
        if (status == TXM_OK)
            status = txs_mosaic_run(m, texture, &plan, c->crossing[i], c->crossings[i], sweeps,
                                    noise, i ? NULL : cool, env, (float)(0.2 + 0.8 * done / work),
                                    (float)(0.2 + 0.8 * next / work));
        done = next;
        if (i == 0 || status != TXM_OK) continue;
        above = *m;
        memset(m, 0, sizeof *m);
    }
    txs_mosaic_free(&above, env);
    return status;
}

TEXSYN_API txm_status texsyn_composite_synthesize(const texsyn_composite_desc *desc, txm_env *env,
                                                  txm_image out) {
    txm_status status = txs_composite_check_desc(
        desc, desc && desc->composite ? desc->composite->channels : 1, &out, env);
    if (status != TXM_OK) return status;
    const texsyn_composite *c = desc->composite;
    const size_t entries = (size_t)TXS_NOISE + TXS_VALUES;
    txs_ground ground[TXS_MAX_LEVELS];
    txs_lay_plane map;
    txs_mosaic m;
    txm_arena arena;
    memset(&map, 0, sizeof map);
    memset(&m, 0, sizeof m);
    out = txm_image_resolve(out);
    txm_arena_init(&arena, env);
    int16_t *noise = (int16_t *)txm_arena_alloc(&arena, entries, sizeof *noise);
    int16_t *cool = (int16_t *)txm_arena_alloc(&arena, entries, sizeof *cool);
    txs_raise_map *maps = (txs_raise_map *)txm_arena_alloc(&arena, (size_t)c->labels, sizeof *maps);
    if (arena.failed) status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to synthesise");
    if (status == TXM_OK) {
        txs_noise_table(noise);
        txs_cool_noise(noise, TXS_COMPOSITE_COOL, cool);
        status = txs_composite_map(desc, noise, &map, env, 0.2f);
    }
    if (status == TXM_OK && (!txs_composite_ground(&ground[0], &arena, &map, c->channels) ||
                             !txs_composite_pyramid(ground, &arena, c->levels)))
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to synthesise");
    txs_lay_plane_free(&map, env);
    if (status == TXM_OK) status = txs_composite_sweep(desc, ground, &m, noise, cool, maps, env);
    if (status == TXM_OK) {
        txm_image to;
        status = txs_easel(&out, c->channels == TXS_MAX_BANDS, &arena, env, &to);
        if (status == TXM_OK) {
            txs_composite_painter painter = {desc, &m, &to};
            txm_parallel_for(env, (to.height + TXS_PAINT_ROWS - 1) / TXS_PAINT_ROWS,
                             txs_composite_paint, &painter);
            status = txs_hang(&to, &out, 0, env);
        }
    }
    txs_mosaic_free(&m, env);
    txm_arena_free(&arena);
    return status;
}

TEXSYN_API txm_status texsyn_composite_layout(const texsyn_composite_desc *desc, txm_env *env,
                                              txm_image out) {
    txs_lay_plane map;
    txm_arena arena;
    txm_status status = txs_composite_check_desc(desc, 0, &out, env);
    if (status != TXM_OK) return status;
    memset(&map, 0, sizeof map);
    out = txm_image_resolve(out);
    txm_arena_init(&arena, env);
    int16_t *noise = (int16_t *)txm_arena_alloc(&arena, TXS_NOISE + TXS_VALUES, sizeof *noise);
    if (!noise) status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the label map");
    else {
        txs_noise_table(noise);
        status = txs_composite_map(desc, noise, &map, env, 1);
    }
    for (int y = 0; y < out.height && status == TXM_OK; y++)
        memcpy(txm_image_row(&out, y), txs_lay_at(&map, 0, y), (size_t)out.width);
    txs_lay_plane_free(&map, env);
    txm_arena_free(&arena);
    return status;
}

#endif /* TEXSYN_COMPOSITE_H */
