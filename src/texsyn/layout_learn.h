#ifndef TEXSYN_LAYOUT_LEARN_H
#define TEXSYN_LAYOUT_LEARN_H

#include "layout_sampler.h"

/* ---- learning and synthesising label maps ---------------------------------------------------

   As with values [1, section 3]: on every level of a pyramid a map is synthesised with the clique
   types so far, the types whose histograms differ most are added, and so on. */
enum {
    TXS_LAY_ADDED = 20,      /* types that are chosen on the coarsest level */
    TXS_LAY_ADDED_BELOW = 6, /* and on the others                           */
    TXS_LAY_BATCH = 4,       /* of them at once                             */
    TXS_LAY_SETTLE = 6,      /* sweeps before types are compared            */
    TXS_LAY_COOL = 5         /* heat of the last sweep */
};

#define TXS_LAY_DOUBT \
    0.2f /* distance of histograms that means nothing, with a single piece; ours */

/* Weights of labels that make the shares of a coarse map those of the whole: where each block
   takes its most frequent label alone, what is thin or scattered would be lost. */
typedef struct txs_lay_blocks {
    int width, height, labels;
    const float *share; /* of each label in each block */
    double bias[TXS_MAX_LABELS];
} txs_lay_blocks;

static int txs_lay_strongest(const txs_lay_blocks *b, size_t block) {
    const float *share = b->share + block * (size_t)b->labels;
    int best = 0;
    double most = -1e300;
    double known = 0;
    for (int v = 0; v < b->labels; v++) {
        const double weight = (double)share[v] + b->bias[v];
        known += (double)share[v];
        if (share[v] > 0 && weight > most) {
            most = weight;
            best = v;
        }
    }
    return known > 0 ? best : (int)TXS_OUTSIDE;
}

static void txs_lay_balance(txs_lay_blocks *b, const double *wanted) {
    enum { ROUNDS = 24 };
    const size_t blocks = (size_t)b->width * (size_t)b->height;
    double gain = 0.5;
    memset(b->bias, 0, sizeof b->bias);
    for (int round = 0; round < ROUNDS; round++, gain *= 0.85) {
        double count[TXS_MAX_LABELS] = {0}, known = 0;
        for (size_t i = 0; i < blocks; i++) {
            const int label = txs_lay_strongest(b, i);
            if (label == TXS_OUTSIDE) continue;
            count[label]++;
            known++;
        }
        for (int v = 0; v < b->labels && known > 0; v++) {
            /* a label with a small share reacts to a small error */
            const double off = wanted[v] - count[v] / known;
            b->bias[v] += gain * off / (wanted[v] + 0.1);
        }
    }
}

/* The map at 1 / 2^level of its size. */
static txm_status txs_lay_shrink(const txs_lay_plane *full, int labels, const double *wanted,
                                 int level, txs_lay_plane *out, txm_env *env) {
    const int side = 1 << level;
    txs_lay_blocks b;
    txm_arena arena;
    txm_arena_init(&arena, env);
    memset(&b, 0, sizeof b);
    b.width = (full->width + side - 1) / side;
    b.height = (full->height + side - 1) / side;
    b.labels = labels;
    const size_t blocks = (size_t)b.width * (size_t)b.height;
    float *share = (float *)txm_arena_zero(&arena, blocks, (size_t)labels * sizeof *share);
    if (!share || !txs_lay_plane_make(out, env, b.width, b.height, full->wrap_x, full->wrap_y)) {
        txm_arena_free(&arena);
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the label map");
    }
    for (int y = 0; y < full->height; y++) {
        for (int x = 0; x < full->width; x++) {
            const int label = *txs_lay_at(full, x, y);
            const size_t block = (size_t)(y / side) * (size_t)b.width + (size_t)(x / side);
            if (label != TXS_OUTSIDE)
                share[block * (size_t)labels + (size_t)label] += 1.0f / (float)(side * side);
        }
    }
    b.share = share;
    if (level > 0) txs_lay_balance(&b, wanted);
    for (int y = 0; y < b.height; y++)
        for (int x = 0; x < b.width; x++)
            txs_lay_set(out, x, y,
                        (uint8_t)txs_lay_strongest(&b, (size_t)y * (size_t)b.width + (size_t)x));
    txm_arena_free(&arena);
    return TXM_OK;
}

/* A coarse map at twice its size. */
static int txs_lay_double(const txs_lay_plane *coarse, int width, int height, txs_lay_plane *out,
                          const txm_env *env) {
    if (!txs_lay_plane_make(out, env, width, height, coarse->wrap_x, coarse->wrap_y)) return 0;
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) txs_lay_set(out, x, y, *txs_lay_at(coarse, x >> 1, y >> 1));
    return 1;
}

static txs_lay_type *txs_lay_add(txs_lay_level *l, int kind, int dx, int dy) {
    TEXSYN_ASSERT(l->type_count < TXS_LAY_TYPES);
    txs_lay_type *t = &l->types[l->type_count++];
    memset(t, 0, sizeof *t);
    t->kind = kind;
    t->dx = dx;
    t->dy = dy;
    return t;
}

/* The types that every level has. */
static void txs_lay_preselect(txs_lay_level *l, const txs_lay_view *source) {
    int32_t count[TXS_LAY_BINS];
    l->type_count = 0;
    txs_lay_add(l, TXS_LAY_FIELD, 0, 0);
    txs_lay_add(l, TXS_LAY_PAIR, 1, 0);
    txs_lay_add(l, TXS_LAY_PAIR, 0, 1);
    txs_lay_add(l, TXS_LAY_PAIR, 1, 1);
    txs_lay_add(l, TXS_LAY_PAIR, -1, 1);
    for (int i = 0; i < TXS_LAY_RINGS; i++) txs_lay_add(l, TXS_LAY_RING, 1 << i, 0);
    for (int i = 0; i < 4 && source->parent; i++) txs_lay_add(l, TXS_LAY_PARENT, i & 1, i >> 1);
    int kept = 0;
    for (int k = 0; k < l->type_count; k++) {
        const int64_t n = txs_lay_count(source, &l->types[k], count);
        txs_lay_normalise(source, &l->types[k], count, l->types[k].share);
        if (n > 0) l->types[kept++] = l->types[k]; /* a small map may have no such clique */
    }
    l->type_count = kept;
}

/* How many connected pieces of one label a map has; -1 without memory. */
static int txs_lay_pieces(const txs_lay_plane *map, txm_arena *arena) {
    const size_t pixels = (size_t)map->width * (size_t)map->height;
    uint8_t *seen = (uint8_t *)txm_arena_zero(arena, pixels, 1);
    int32_t *stack = (int32_t *)txm_arena_alloc(arena, pixels, sizeof *stack);
    int pieces = 0;
    if (arena->failed) return -1;
    for (int i = 0; i < map->width * map->height; i++) {
        int count = 1;
        if (seen[i] || *txs_lay_at(map, i % map->width, i / map->width) == TXS_OUTSIDE) continue;
        pieces++;
        seen[i] = 1;
        stack[0] = i;
        while (count) { /* a pixel is put on the stack once, so it cannot overflow */
            const int x = stack[--count] % map->width, y = stack[count] / map->width;
            for (int k = 0; k < 4; k++) {
                const int nx = x + (k == 0) - (k == 1), ny = y + (k == 2) - (k == 3);
                const int32_t at = ny * map->width + nx;
                if (nx < 0 || ny < 0 || nx >= map->width || ny >= map->height || seen[at] ||
                    *txs_lay_at(map, nx, ny) != *txs_lay_at(map, x, y))
                    continue;
                seen[at] = 1;
                TEXSYN_ASSERT((size_t)count < pixels);
                stack[count++] = at;
            }
        }
    }
    return pieces;
}

/* Does an axis wrap? A border lacks the pairs that lead across it, and so attracts some labels and
   repels others; a torus has none. Not along a field, whose ends differ, nor where pairs would reach
   round. side: of the coarsest level. */
static int txs_lay_wraps(int field, int axis, int side) {
    return field != axis && side > 2 * TXS_LAY_REACH;
}

/* Add the pairs whose histograms differ most from the source's, and by more than threshold; returns
   how many. */
static int txs_lay_add_worst(txs_lay_level *l, const txs_lay_view *source, const txs_lay_view *map,
                             txs_lay_type *candidates, float *distance, int count, int most,
                             float threshold) {
    int32_t counts[TXS_LAY_BINS], share[TXS_LAY_BINS];
    int added = 0;
    for (int i = 0; i < count; i++) {
        txs_lay_type *c = &candidates[i];
        if (txs_lay_count(source, c, counts) == 0) {
            distance[i] = 0;
            continue;
        }
        txs_lay_normalise(source, c, counts, c->share);
        txs_lay_count(map, c, counts);
        txs_lay_normalise(map, c, counts, share);
        double sum = 0;
        for (int k = 0; k < TXS_LAY_BINS; k++) {
            const double off = (double)(share[k] - c->share[k]) / (double)TXS_ONE;
            sum += off * off;
        }
        distance[i] = txm_float(sqrt(sum));
    }
    for (; added < most && l->type_count < TXS_LAY_TYPES; added++) {
        int worst = 0;
        for (int i = 1; i < count; i++)
            if (distance[i] > distance[worst]) worst = i;
        if (count == 0 || !(distance[worst] > threshold)) break;
        const txs_lay_type chosen = candidates[worst];
        TEXSYN_ASSERT(l->type_count < TXS_LAY_TYPES);
        l->types[l->type_count++] = chosen;
        for (int i = 0; i < count; i++) /* its neighbours say the same */
            if (abs(candidates[i].dx - chosen.dx) <= 1 && abs(candidates[i].dy - chosen.dy) <= 1)
                distance[i] = 0;
    }
    return added;
}

/* Start a level's map: from the coarser one, or at random by the field. */
static void txs_lay_start(const txs_lay_view *v, const txs_lay_level *l, int labels,
                          uint64_t seed) {
    txm_rng rng = txm_rng_make(seed, 5);
    for (int y = 0; y < v->map->height; y++) {
        for (int x = 0; x < v->map->width; x++) {
            if (v->parent) {
                txs_lay_set(v->map, x, y, *txs_lay_at(v->parent, x, y));
                continue;
            }
            const int32_t *share = l->types[0].share + txs_lay_band(v, x, y) * TXS_MAX_LABELS;
            int32_t total = 0;
            int label = 0;
            for (int k = 0; k < labels; k++) total += share[k];
            int32_t left = total > 0 ? (int32_t)txm_rng_below(&rng, (uint32_t)total) : 0;
            while (label < labels - 1 && left >= share[label]) left -= share[label++];
            txs_lay_set(v->map, x, y, (uint8_t)label);
        }
    }
}

/* Learn one level: source is the example's map, with the true coarser map as its parent. at: the
   fraction of the whole that is done. */
static txm_status txs_lay_learn_level(txs_lay_level *l, int labels, const txs_lay_view *source,
                                      const int16_t *noise, uint64_t seed, txm_env *env, float at) {
    const int side =
        source->map->width < source->map->height ? source->map->width : source->map->height;
    const int reach = source->parent ? (int)TXS_LAY_NEAR : txm_clampi(side / 3, 2, TXS_LAY_REACH);
    const int most = source->parent ? (int)TXS_LAY_ADDED_BELOW : (int)TXS_LAY_ADDED;
    const size_t capacity = (size_t)(2 * reach + 1) * (size_t)(reach + 1); /* half a square */
    txs_lay_plane map;
    txs_lay_view view = *source;
    txm_status status = TXM_OK;
    txm_arena arena;
    int candidate_count = 0, sweep = 0;
    txm_arena_init(&arena, env);
    txs_lay_type *candidates = (txs_lay_type *)txm_arena_zero(&arena, capacity, sizeof *candidates);
    float *distance = (float *)txm_arena_zero(&arena, capacity, sizeof *distance);
    const int pieces = txs_lay_pieces(source->map, &arena);
    /* a map of few pieces has little to say about where they lie */
    const float doubt = TXS_LAY_DOUBT / txm_float(sqrt((double)(pieces > 0 ? pieces : 1)));
    const float threshold = txm_maxf(doubt, TXS_THRESHOLD);
    const int wraps = !source->parent;
    const int room = txs_lay_plane_make(
        &map, env, source->map->width, source->map->height,
        wraps && txs_lay_wraps(source->field, TXS_LAY_COLUMNS, source->map->width),
        wraps && txs_lay_wraps(source->field, TXS_LAY_ROWS_FIELD, source->map->height));
    view.map = &map;
    txs_lay_sampler *s = txs_lay_sampler_make(&arena, l, &view, labels, TXS_LAY_TYPES, noise, seed);
    if (!room || !s || arena.failed) {
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to learn the label map");
        goto done;
    }
    txs_lay_preselect(l, source);
    for (int y = 0; y <= reach; y++) {
        for (int x = -reach; x <= reach; x++) {
            if ((y == 0 && x <= 0) || x * x + y * y > reach * reach || abs(x) + y <= 1) continue;
            TEXSYN_ASSERT((size_t)candidate_count < capacity);
            candidates[candidate_count].kind = TXS_LAY_PAIR;
            candidates[candidate_count].dx = x;
            candidates[candidate_count++].dy = y;
        }
    }
    txs_lay_start(&view, l, labels, seed);
    for (int left = most; left > 0;) {
        txs_lay_sampler_start(s);
        for (int i = 0; i < TXS_LAY_SETTLE; i++) {
            if (txm_progress(env, at, "layout")) {
                status = txm_fail(env, TXM_CANCELLED, "stopped by the progress callback");
                goto done;
            }
            txs_lay_sweep(s, sweep++);
        }
        const int added =
            txs_lay_add_worst(l, source, &view, candidates, distance, candidate_count,
                              left < TXS_LAY_BATCH ? left : (int)TXS_LAY_BATCH, threshold);
        if (added == 0) break;
        left -= added;
    }
done:
    txs_lay_plane_free(&map, env);
    txm_arena_free(&arena);
    return status;
}

/* How much the band tells about the label: mutual information over the labels' entropy. */
static double txs_lay_order(const txs_lay_plane *map, int field, int labels) {
    int32_t count[TXS_LAY_BINS];
    const txs_lay_view view = {map, NULL, field};
    const txs_lay_type type = {TXS_LAY_FIELD, 0, 0, {0}, {0}};
    const double total = (double)txs_lay_count(&view, &type, count);
    double mutual = 0, entropy = 0, share[TXS_MAX_LABELS] = {0};
    for (int i = 0; i < TXS_LAY_BINS; i++) share[i % TXS_MAX_LABELS] += count[i] / total;
    for (int v = 0; v < labels; v++)
        if (share[v] > 0) entropy -= share[v] * log(share[v]);
    for (int row = 0; row < TXS_MAX_LABELS; row++) {
        double band = 0;
        for (int v = 0; v < labels; v++) band += count[row * TXS_MAX_LABELS + v] / total;
        for (int v = 0; v < labels; v++) {
            const double joint = count[row * TXS_MAX_LABELS + v] / total;
            if (joint > 0) mutual += joint * log(joint / (band * share[v]));
        }
    }
    return entropy > 0 ? mutual / entropy : 0;
}

/* ---- synthesis of a label map ---------------------------------------------------------------- */

static int txs_lay_sweeps(int level, int quality) {
    static const int sweeps[5][3] = {
        {4, 6, 16}, {6, 8, 24}, {9, 12, 40}, {12, 18, 60}, {18, 24, 90}};
    return sweeps[quality + 2][level > 2 ? 2 : level];
}

/* The types of a level for a picture of this size. 0 without memory. */
static int txs_lay_fit(const txs_layout *layout, int index, int width, int height, txm_arena *arena,
                       txs_lay_level *fitted) {
    const txs_lay_level *l = &layout->level[index];
    const int side = layout->field == 1 ? height : width;
    const int side_then = (layout->field == 1 ? layout->height : layout->width) >> index;
    *fitted = *l;
    fitted->types = (txs_lay_type *)txm_arena_alloc(arena, (size_t)l->type_count, sizeof *l->types);
    if (!fitted->types) return 0;
    memcpy(fitted->types, l->types, sizeof *l->types * (size_t)l->type_count);
    if (!layout->field || side == side_then) return 1;
    for (int k = 0; k < l->type_count; k++) {
        txs_lay_type *t = &fitted->types[k];
        const int d = layout->field == 1 ? t->dy : t->dx;
        if (t->kind == TXS_LAY_PAIR && d != 0)
            txs_lay_fit_pair(t, l->types[0].share, layout->labels,
                             (double)(d * (int)TXS_BANDS_OF_FIELD) / side_then,
                             (double)(d * (int)TXS_BANDS_OF_FIELD) / side);
    }
    return 1;
}

/* Synthesise a map of any size into out, which the caller frees. Fraction from..to of the whole. */
static txm_status txs_layout_make(const txs_layout *layout, int width, int height, int quality,
                                  const int16_t *noise, uint64_t seed, txs_lay_plane *out,
                                  txm_env *env, float from, float to) {
    float work = 0, done = 0;
    for (int i = 0; i < layout->levels; i++) work += 1.0f / (float)(1 << 2 * i);
    txs_lay_plane coarse, parent;
    const int top_level = layout->levels - 1;
    const int wrap_x = txs_lay_wraps(layout->field, TXS_LAY_COLUMNS, width >> top_level);
    const int wrap_y = txs_lay_wraps(layout->field, TXS_LAY_ROWS_FIELD, height >> top_level);
    memset(&coarse, 0, sizeof coarse);
    memset(out, 0, sizeof *out);
    for (int i = layout->levels - 1; i >= 0; i--) {
        txs_lay_level fitted;
        const int w = (width + (1 << i) - 1) >> i, h = (height + (1 << i) - 1) >> i;
        const int top = i + 1 == layout->levels;
        txm_arena arena;
        txm_status status = TXM_OK;
        memset(&parent, 0, sizeof parent);
        txm_arena_init(&arena, env);
        int room = txs_lay_plane_make(out, env, w, h, wrap_x, wrap_y);
        if (room && !top) room = txs_lay_double(&coarse, w, h, &parent, env);
        const txs_lay_view view = {out, top ? NULL : &parent, layout->field};
        if (room) room = txs_lay_fit(layout, i, w, h, &arena, &fitted);
        txs_lay_sampler *s =
            room ? txs_lay_sampler_make(&arena, &fitted, &view, layout->labels, fitted.type_count,
                                        noise, txm_hash(seed + (uint64_t)i))
                 : NULL;
        if (!s) status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the label map");
        else {
            txs_lay_start(&view, &fitted, layout->labels, seed);
            txs_lay_sampler_start(s);
        }
        const int sweeps = txs_lay_sweeps(top ? 2 : i > 0, quality);
        for (int k = 0; k < sweeps && status == TXM_OK; k++) {
            const float part = (done + (float)k / (float)sweeps / (float)(1 << 2 * i)) / work;
            if (txm_progress(env, from + (to - from) * part, "layout"))
                status = txm_fail(env, TXM_CANCELLED, "stopped by the progress callback");
            else {
                if (k + 1 == sweeps) s->heat = TXS_LAY_COOL;
                txs_lay_sweep(s, k);
            }
        }
        txm_arena_free(&arena);
        txs_lay_plane_free(&parent, env);
        txs_lay_plane_free(&coarse, env);
        if (status != TXM_OK) {
            txs_lay_plane_free(out, env);
            return status;
        }
        coarse = *out;
        done += 1.0f / (float)(1 << 2 * i);
    }
    return TXM_OK;
}

/* Learn a label map; the layout's types lie in the arena. field: 0 to 2 as in the layout, or -1 to
   find it out. Fraction from..to of the whole. */
static txm_status txs_layout_learn(const txs_lay_plane *full, int labels, int field,
                                   const int16_t *noise, uint64_t seed, txm_arena *arena,
                                   txs_layout *layout, txm_env *env, float from, float to) {
    const double ordered = 0.25; /* of a label's entropy that its band explains */
    const int side = full->width < full->height ? full->width : full->height;
    txs_lay_plane map[TXS_LAY_LEVELS], parent;
    txm_status status = TXM_OK;
    double known = 0, share[TXS_MAX_LABELS] = {0};
    memset(layout, 0, sizeof *layout);
    memset(map, 0, sizeof map);
    memset(&parent, 0, sizeof parent);
    layout->labels = labels;
    layout->width = full->width;
    layout->height = full->height;
    layout->levels = 1;
    while (layout->levels < TXS_LAY_LEVELS && side >> layout->levels >= TXS_LAY_TOP)
        layout->levels++;
    for (int y = 0; y < full->height; y++) {
        for (int x = 0; x < full->width; x++) {
            const int label = *txs_lay_at(full, x, y);
            if (label == TXS_OUTSIDE) continue;
            share[label]++;
            known++;
        }
    }
    for (int v = 0; v < labels; v++) share[v] /= known;
    if (field < 0) {
        const double rows = txs_lay_order(full, 1, labels),
                     columns = txs_lay_order(full, 2, labels);
        layout->field = rows >= columns && rows > ordered ? 1 : columns > ordered ? 2 : 0;
    } else layout->field = field;

    for (int i = 0; i < layout->levels && status == TXM_OK; i++)
        status = txs_lay_shrink(full, labels, share, i, &map[i], env);
    for (int i = layout->levels - 1; i >= 0 && status == TXM_OK; i--) {
        const int top = i + 1 == layout->levels;
        const txs_lay_view source = {&map[i], top ? NULL : &parent, layout->field};
        layout->level[i].types =
            (txs_lay_type *)txm_arena_zero(arena, TXS_LAY_TYPES, sizeof(txs_lay_type));
        if (!layout->level[i].types ||
            (!top && !txs_lay_double(&map[i + 1], map[i].width, map[i].height, &parent, env)))
            status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to learn the label map");
        else
            status = txs_lay_learn_level(&layout->level[i], labels, &source, noise,
                                         txm_hash(seed + (uint64_t)i), env,
                                         from + (to - from) / (float)(1 << 2 * i));
        txs_lay_plane_free(&parent, env);
    }
    for (int i = 0; i < TXS_LAY_LEVELS; i++) txs_lay_plane_free(&map[i], env);
    return status;
}

#endif /* TEXSYN_LAYOUT_LEARN_H */
