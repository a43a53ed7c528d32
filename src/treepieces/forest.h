#ifndef TREEPIECES_FOREST_H
#define TREEPIECES_FOREST_H

#include "species.h"
#include "assemble.h"
#include "modes.h"

/* ---- a forest ------------------------------------------------------------------------------ */

enum {
    TPC_BLOCK_TREES = 64,      /* trees that grow at a time ...                  */
    TPC_BLOCK_PIECES = 1 << 18 /* ... limited to this many pieces in total       */
};

/* A forest with its memory. */
typedef struct tpc_forest {
    treepieces_forest forest; /* first, so that a pointer to it is one to this */
    txm_arena arena;          /* itself, species, trees and records */
    txm_arena node_arena, cluster_arena;
} tpc_forest;

/* A forest under construction. */
typedef struct tpc_planting {
    const treepieces_forest_desc *desc;
    tpc_forest *made;
    txm_arena scratch, band_arena;
    tpc_growth *slots;
    int slot_count, first; /* tree of slot 0 */
    float spacing;
    treepieces_tree *trees;
    uint32_t (*offsets)[TREEPIECES_MAX_TYPES]; /* by tree: its first record of each type */
    uint32_t type_counts[TREEPIECES_MAX_TYPES];
    uint32_t *words[TREEPIECES_MAX_TYPES];
    /* these grow with the trees */
    treepieces_node *nodes;
    uint32_t *bands;
    treepieces_cluster *clusters;
    size_t node_count, cluster_count, node_capacity, band_capacity, cluster_capacity;
} tpc_planting;

/* The distance of the trees in the grid, metres. */
static float tpc_spacing(const treepieces_forest_desc *desc) {
    float spacing = desc->spacing;
    for (int i = 0; i < desc->species_count && !(desc->spacing > 0); i++)
        spacing = txm_maxf(spacing, 0.6f * desc->species[i].orders[0].length);
    return spacing;
}

/* Where tree i stands if the caller gives no places. */
static treepieces_place tpc_scatter(const treepieces_forest_desc *desc, float spacing, int i) {
    treepieces_place place;
    int side = 1;
    txm_rng rng = txm_rng_make(desc->seed, 0x666f7265u + ((uint64_t)i << 32));
    while (side < 46340 && side * side < desc->tree_count) side++;
    memset(&place, 0, sizeof place);
    if (desc->tree_count > 1) {
        const int column = i % side, row = i / side;
        const float x = (float)column + 0.5f - 0.5f * (float)side;
        const float z = (float)row + 0.5f - 0.5f * (float)side;
        place.position[0] = spacing * (x + 0.6f * (txm_rng_float(&rng) - 0.5f));
        place.position[2] = spacing * (z + 0.6f * (txm_rng_float(&rng) - 0.5f));
        place.scale = 0.8f + 0.4f * txm_rng_float(&rng);
        place.species = (int)txm_rng_below(&rng, (uint32_t)desc->species_count);
    }
    place.turn = 6.2831853f * txm_rng_float(&rng);
    const uint64_t high = txm_rng_next(&rng); /* before the low half: operands have no order */
    place.seed = high << 32 | txm_rng_next(&rng);
    return place;
}

static void tpc_grow_slot(void *context, int i) {
    tpc_planting *p = (tpc_planting *)context;
    tpc_growth *g = &p->slots[i];
    g->index = p->first + i;
    g->place = p->desc->places ? p->desc->places[g->index] : tpc_scatter(p->desc, p->spacing, g->index);
    g->species = &p->desc->species[g->place.species];
    tpc_grow(g);
    tpc_assemble(g);
    if (g->status == TXM_OK) tpc_set_modes(g->nodes, (uint32_t)g->node_count);
}

static txm_status tpc_make_slots(tpc_planting *p, txm_env *env) {
    const int most = p->desc->max_pieces ? p->desc->max_pieces : 600;
    int count = TPC_BLOCK_PIECES / most;
    count = txm_clampi(count, 4, TPC_BLOCK_TREES);
    if (count > p->desc->tree_count) count = p->desc->tree_count;
    p->slots = (tpc_growth *)txm_arena_zero(&p->scratch, (size_t)count, sizeof *p->slots);
    if (!p->slots) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to grow trees");
    for (p->slot_count = 0; p->slot_count < count; p->slot_count++) {
        tpc_growth *g = &p->slots[p->slot_count];
        g->desc = p->desc;
        g->kit = p->desc->kit;
        g->most = most;
        g->most_segments = most * tpc_most_joined(tpc_stretch(most));
        /* a tree has at most `most` nodes, each of some segments and with one cluster at most */
        g->nodes = (treepieces_node *)txm_arena_alloc(&p->scratch, (size_t)most, sizeof *g->nodes);
        g->bands = (uint32_t *)txm_arena_alloc(&p->scratch, (size_t)most, sizeof *g->bands);
        g->records = (uint32_t *)txm_arena_alloc(&p->scratch, (size_t)most, sizeof *g->records);
        const size_t segments = (size_t)g->most_segments;
        g->sketch.axes = (tpc_axis *)txm_arena_alloc(&p->scratch, (size_t)most, sizeof *g->sketch.axes);
        g->sketch.segments = (tpc_segment *)txm_arena_alloc(&p->scratch, segments, sizeof *g->sketch.segments);
        g->waits = (tpc_wait *)txm_arena_alloc(&p->scratch, segments * (TREEPIECES_MAX_LEAVES - 1),
                                               sizeof *g->waits);
        g->clusters = (treepieces_cluster *)txm_arena_alloc(&p->scratch, (size_t)most,
                                                            sizeof *g->clusters);
        if (!tpc_space_make(&g->space, g->most_segments, &p->scratch))
            return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to grow trees");
    }
    return TXM_OK;
}

/* Make room for `more` items after the first `count` of a block. What is allocated is an estimate
   for all trees from those that are done. Returns the block, or NULL if there is no memory. */
static void *tpc_reserve(const tpc_planting *p, int done, txm_arena *arena, void *block, size_t count,
                         size_t more, size_t size, size_t *capacity) {
    size_t wanted = count + more;
    if (block && wanted <= *capacity) return block;
    const double all = 1.05 * (double)wanted / done * p->desc->tree_count + 64;
    if (all < 4e9 && (size_t)all > wanted) wanted = (size_t)all;
    txm_arena larger_arena = *arena;
    larger_arena.blocks = NULL;
    void *larger = txm_arena_alloc(&larger_arena, wanted, size);
    if (!larger) return NULL;
    if (block) memcpy(larger, block, count * size);
    txm_arena_free(arena);
    *arena = larger_arena;
    *capacity = wanted;
    return larger;
}

/* Copy what grew in slot i to the place in the forest that its tree has. */
static void tpc_copy_slot(void *context, int i) {
    const tpc_planting *p = (const tpc_planting *)context;
    const tpc_growth *g = &p->slots[i];
    const treepieces_tree *t = &p->trees[p->first + i];
    memcpy(p->nodes + t->first_node, g->nodes, t->node_count * sizeof *p->nodes);
    memcpy(p->bands + t->first_node, g->bands, t->node_count * sizeof *p->bands);
    for (uint32_t k = 0; k < t->cluster_count; k++) {
        treepieces_cluster *c = &p->clusters[t->first_cluster + k];
        *c = g->clusters[k];
        c->node += t->first_node;
    }
}

/* Append the trees that grew in the slots to the forest. */
static txm_status tpc_append_trees(tpc_planting *p, int count, txm_env *env) {
    size_t nodes = 0, clusters = 0;
    for (int i = 0; i < count; i++) {
        if (p->slots[i].status != TXM_OK) return txm_fail(env, p->slots[i].status, p->slots[i].fault);
        nodes += (size_t)p->slots[i].node_count;
        clusters += (size_t)p->slots[i].cluster_count;
    }
    if (nodes > 0x7fffffffu - p->node_count)
        return txm_fail(env, TXM_TOO_LARGE, "more than 2^31 pieces");
    const int done = p->first + count;
    void *n = tpc_reserve(p, done, &p->made->node_arena, p->nodes, p->node_count, nodes,
                          sizeof *p->nodes, &p->node_capacity);
    if (n) p->nodes = (treepieces_node *)n;
    void *b = tpc_reserve(p, done, &p->band_arena, p->bands, p->node_count, nodes, sizeof *p->bands,
                          &p->band_capacity);
    if (b) p->bands = (uint32_t *)b;
    void *c = tpc_reserve(p, done, &p->made->cluster_arena, p->clusters, p->cluster_count, clusters,
                          sizeof *p->clusters, &p->cluster_capacity);
    if (c) p->clusters = (treepieces_cluster *)c;
    if (!n || !b || !c) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the forest");
    for (int i = 0; i < count; i++) {
        const tpc_growth *g = &p->slots[i];
        treepieces_tree *t = &p->trees[p->first + i];
        t->first_node = (uint32_t)p->node_count;
        t->node_count = (uint32_t)g->node_count;
        t->first_cluster = (uint32_t)p->cluster_count;
        t->cluster_count = (uint32_t)g->cluster_count;
        memcpy(t->position, g->place.position, sizeof t->position);
        t->turn = g->place.turn;
        t->scale = g->scale;
        t->species = g->place.species;
        t->seed = (uint32_t)txm_hash(g->place.seed);
        t->height = g->height;
        p->node_count += t->node_count;
        p->cluster_count += t->cluster_count;
        for (int k = 0; k < TREEPIECES_MAX_TYPES; k++) {
            p->offsets[p->first + i][k] = p->type_counts[k];
            p->type_counts[k] += g->type_counts[k];
        }
    }
    txm_parallel_for(env, count, tpc_copy_slot, p);
    return TXM_OK;
}

/* Choose a random tile for every quad, four at a time: column r (9 - tiles across) / 16 for random
   r of 0..15 (0 for 16 tiles), the row likewise; quads at the bottom of their layer get the last
   row. */
static void tpc_fill_cells(const tpc_cells *cells, int words, uint32_t bands, txm_rng *rng,
                           uint32_t *word) {
    const uint32_t low = 0x0f0f0f0fu;
    for (int i = 0; i < words; i++) {
        const tpc_cells *c = &cells[i];
        const uint32_t bits = txm_rng_next(rng), across = bits & low, down = bits >> 4 & low;
        word[i] = 0;
        for (int b = c->first; b <= c->last; b++) {
            const uint32_t band = bands >> (8 * b) & 255u, last = 8u - (1u << (band >> 3 & 3));
            const uint32_t columns = band & 4 ? 1 : 9u - (1u << (band & 3)), rows = last + 1;
            const uint32_t bottom = band & 32 ? ~0u : c->bottom;
            const uint32_t column = across * columns >> 4 & low, row = down * rows >> 4 & low;
            const uint32_t chosen = (row & ~bottom) | (last * 0x01010101u & bottom);
            word[i] |= (column | chosen << 3) & c->bands[b];
        }
        word[i] &= ~c->own | 0x36363636u; /* the caller's classes lie on 2 x 2 cells */
    }
}

/* Fill the records of tree p->first + i. A child enters itself in the record of its parent. */
static void tpc_fill_tree(void *context, int i) {
    tpc_planting *p = (tpc_planting *)context;
    const treepieces_kit *kit = p->desc->kit;
    const treepieces_tree *t = &p->trees[p->first + i];
    uint32_t *records = p->slots[i].records, next[TREEPIECES_MAX_TYPES];
    txm_rng rng = txm_rng_make(t->seed, 0x63656c6cu);
    memcpy(next, p->offsets[p->first + i], sizeof next);
    for (uint32_t n = 0; n < t->node_count; n++) {
        const treepieces_node *node = &p->nodes[t->first_node + n];
        const uint32_t stride = p->made->forest.batches[node->type].stride;
        uint32_t *w = p->words[node->type] + (size_t)(records[n] = next[node->type]++) * stride;
        w[0] = t->first_node + n;
        w[1] = w[2] = 0;
        w[3] = p->bands[t->first_node + n];
        tpc_fill_cells(kit->cells[node->type], (int)stride - 4, w[3], &rng, w + 4);
        if (node->parent < 0) continue;
        const int type = p->nodes[t->first_node + (uint32_t)node->parent].type, rim = node->joint >> 3;
        uint32_t *up = p->words[type] +
                       (size_t)records[node->parent] * p->made->forest.batches[type].stride;
        up[1 + rim / 2] |= (n - (uint32_t)node->parent) << (16 * (rim & 1));
        up[2] |= (uint32_t)(node->joint & 7) << (16 + 4 * rim);
    }
}

/* Allocate the records, as their numbers are known now. */
static txm_status tpc_make_arrays(tpc_planting *p, txm_env *env) {
    treepieces_forest *out = &p->made->forest;
    size_t bytes = sizeof *p->made + (size_t)out->tree_count * sizeof *p->trees +
                   (size_t)out->species_count * sizeof *out->species +
                   p->node_capacity * sizeof *p->nodes + p->cluster_capacity * sizeof *p->clusters;
    for (int k = 0; k < out->type_count; k++) {
        treepieces_batch *b = &out->batches[k];
        b->quad_count = out->kit->pieces[k].quad_count;
        b->stride = 4 + ((uint32_t)b->quad_count + 3) / 4;
        b->count = p->type_counts[k];
        if (!b->count) continue;
        p->words[k] = (uint32_t *)txm_arena_alloc(&p->made->arena, b->count,
                                                  b->stride * sizeof(uint32_t));
        if (!p->words[k]) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the forest");
        b->words = p->words[k];
        bytes += (size_t)b->count * b->stride * sizeof(uint32_t);
    }
    out->nodes = p->nodes;
    out->clusters = p->clusters;
    out->node_count = (uint32_t)p->node_count;
    out->cluster_count = (uint32_t)p->cluster_count;
    out->bytes = bytes;
    return TXM_OK;
}

/* Grow all trees, block after block; then, as the sizes of the batches are known, fill the records. */
static txm_status tpc_grow_trees(tpc_planting *p, txm_env *env) {
    const int trees = p->desc->tree_count;
    p->trees = (treepieces_tree *)txm_arena_zero(&p->made->arena, (size_t)trees, sizeof *p->trees);
    p->offsets = (uint32_t(*)[TREEPIECES_MAX_TYPES])txm_arena_alloc(&p->scratch, (size_t)trees,
                                                                   sizeof *p->offsets);
    if (p->made->arena.failed || p->scratch.failed)
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the forest");
    p->made->forest.trees = p->trees;
    txm_status status = tpc_make_slots(p, env);
    for (int pass = 0; pass < 2 && status == TXM_OK; pass++) {
        if (pass) status = tpc_make_arrays(p, env);
        for (p->first = 0; status == TXM_OK && p->first < trees; p->first += p->slot_count) {
            const int left = trees - p->first, count = left < p->slot_count ? left : p->slot_count;
            if (txm_progress(env, 0.7f * (float)pass + (pass ? 0.3f : 0.7f) * (float)p->first / (float)trees,
                             pass ? "assemble" : "grow"))
                return txm_fail(env, TXM_CANCELLED, "cancelled");
            txm_parallel_for(env, count, pass ? tpc_fill_tree : tpc_grow_slot, p);
            if (!pass) status = tpc_append_trees(p, count, env);
        }
    }
    return status;
}

static txm_status tpc_check_forest(const treepieces_forest_desc *d, txm_env *env) {
    if (!d || !d->kit) return txm_fail(env, TXM_BAD_ARGUMENT, "desc or kit is NULL");
    if (!d->species || d->species_count < 1)
        return txm_fail(env, TXM_BAD_ARGUMENT, "species: at least one is needed");
    if (d->tree_count < 1) return txm_fail(env, TXM_BAD_ARGUMENT, "tree_count must be 1 or more");
    if (d->max_pieces && (d->max_pieces < 8 || d->max_pieces > 65535))
        return txm_fail(env, TXM_BAD_ARGUMENT, "max_pieces must be 8 to 65535, or 0 for 600");
    if (d->rule < TREEPIECES_GRAMMAR || d->rule > TREEPIECES_RANDOM)
        return txm_fail(env, TXM_BAD_ARGUMENT, "rule is not a treepieces_rule");
    if (!(d->spacing >= 0) || !txm_is_finite((double)d->spacing))
        return txm_fail(env, TXM_BAD_ARGUMENT, "spacing must be 0 or more");
    for (int i = 0; i < d->species_count; i++) {
        const txm_status status = tpc_species_check(&d->species[i], env);
        if (status != TXM_OK) return status;
    }
    for (int i = 0; d->places && i < d->tree_count; i++) {
        const treepieces_place *p = &d->places[i];
        for (int k = 0; k < 3; k++)
            if (!(fabsf(p->position[k]) <= 1e6f))
                return txm_fail(env, TXM_BAD_ARGUMENT, "places: a position is beyond 1000 km");
        if (!(fabsf(p->turn) <= 1e4f) || !(p->scale == 0 || (p->scale >= 1e-3f && p->scale <= 1000)))
            return txm_fail(env, TXM_BAD_ARGUMENT, "places: a turn or scale is out of range");
        if (p->species < 0 || p->species >= d->species_count)
            return txm_fail(env, TXM_BAD_ARGUMENT, "places: a species number is out of range");
    }
    return TXM_OK;
}

TREEPIECES_API txm_status treepieces_scatter(const treepieces_forest_desc *desc, txm_env *env,
                                             treepieces_place *places) {
    const txm_status status = tpc_check_forest(desc, env);
    if (status != TXM_OK) return status;
    if (!places) return txm_fail(env, TXM_BAD_ARGUMENT, "places is NULL");
    const float spacing = tpc_spacing(desc);
    for (int i = 0; i < desc->tree_count; i++)
        places[i] = desc->places ? desc->places[i] : tpc_scatter(desc, spacing, i);
    return TXM_OK;
}

TREEPIECES_API void treepieces_forest_free(treepieces_forest *forest) {
    if (!forest) return;
    tpc_forest *f = (tpc_forest *)forest;
    txm_arena arena = f->arena;
    txm_arena_free(&f->node_arena);
    txm_arena_free(&f->cluster_arena);
    txm_arena_free(&arena);
}

TREEPIECES_API txm_status treepieces_forest_make(const treepieces_forest_desc *desc, txm_env *env,
                                                 treepieces_forest **out) {
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    txm_status status = tpc_check_forest(desc, env);
    if (status != TXM_OK) return status;
    txm_arena arena;
    tpc_planting p;
    memset(&p, 0, sizeof p);
    p.desc = desc;
    p.spacing = tpc_spacing(desc);
    txm_arena_init(&p.scratch, env);
    txm_arena_init(&p.band_arena, env);
    txm_arena_init(&arena, env);
    tpc_forest *f = (tpc_forest *)txm_arena_zero(&arena, 1, sizeof *f);
    treepieces_species *species = (treepieces_species *)txm_arena_alloc(
        &arena, (size_t)desc->species_count, sizeof *species);
    if (f) {
        f->arena = arena;
        txm_arena_init(&f->node_arena, env);
        txm_arena_init(&f->cluster_arena, env);
    }
    if (arena.failed) {
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the forest");
    } else {
        memcpy(species, desc->species, (size_t)desc->species_count * sizeof *species);
        f->forest.kit = desc->kit;
        f->forest.species = species;
        f->forest.species_count = desc->species_count;
        f->forest.tree_count = desc->tree_count;
        f->forest.type_count = desc->kit->count;
        p.made = f;
        status = tpc_grow_trees(&p, env);
    }
    txm_arena_free(&p.scratch);
    txm_arena_free(&p.band_arena);
    if (status == TXM_OK) *out = &f->forest;
    else if (f) treepieces_forest_free(&f->forest);
    else txm_arena_free(&arena);
    return status;
}

#endif /* TREEPIECES_FOREST_H */
