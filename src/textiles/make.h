#ifndef TEXTILES_MAKE_H
#define TEXTILES_MAKE_H

#include "interior.h"
#include "repair.h"

/* ---- all tiles --------------------------------------------------------------------------- */

enum {
    TXT_BATCH = 8,        /* tiles made at the same time, for any number of threads            */
    TXT_TRIES = 4         /* interiors cut for each tile, of which the best is kept            */
};
#define TXT_BALANCE 0.8       /* weight of use and traits when places are ranked             */

/* The pixels and sources of a finished tile. */
static void txt_store_tile(const txt_canvas *c) {
    const txt_build *b = c->b;
    textiles_set *set = b->set;
    const int side = c->side;
    int32_t *source = set->source + (size_t)c->tile * (size_t)side * (size_t)side;
    for (int p = 0; p < side * side; p++) {
        source[p] = c->inside[p] ? c->shows[p] : -1;
        if (!c->inside[p]) continue;
        const int32_t t = c->shows[p];
        const int e = txt_sheet_of(b->set, t);
        const int at = t - b->sheets[e].first, w = b->sheets[e].width;
        for (int m = 0; m < set->map_count; m++) {
            const char *row = (const char *)txm_image_row_const(&b->sheets[e].maps[m], at / w);
            memcpy(txt_texel(set, m, c->tile, p % side, p / side),
                   row + (size_t)(at % w) * set->maps[m].texel, set->maps[m].texel);
        }
    }
}

typedef struct txt_batch {
    txt_canvas canvas[TXT_BATCH];
    txt_repair repair[TXT_BATCH];
} txt_batch;

static void txt_batch_begin(void *context, int k) {
    txt_canvas *c = &((txt_batch *)context)->canvas[k];
    txt_begin_tile(c, c->tile);
    if (txt_block_side(c->b) >= c->side) txt_find_interiors(c);
    else c->place_count = 0;
}

static void txt_batch_cut(void *context, int k) {
    txt_batch *batch = (txt_batch *)context;
    txt_canvas *c = &batch->canvas[k];
    txt_cut_tile(c);
    txt_fill_gaps(c);
    txt_store_tile(c);
    if (c->b->desc->repair != TEXTILES_REPAIR_NONE) txt_repair_tile(c, &batch->repair[k]);
}

/* memory for making one tile after another; arena->failed if there is none */
static void txt_canvas_make(txt_build *b, txm_arena *arena, txt_canvas *c, txt_repair *r) {
    const size_t n = (size_t)b->set->side * (size_t)b->set->side;
    memset(c, 0, sizeof *c);
    memset(r, 0, sizeof *r);
    c->b = b;
    c->side = b->set->side;
    c->half = b->is_triangle ? 3 : 2;
    c->dx[0] = 1;
    c->dy[1] = 1;
    c->dx[2] = -1;
    c->dy[2] = 1;
    uint8_t *bytes = (uint8_t *)txm_arena_zero(arena, n, 3);
    uint16_t *labels = (uint16_t *)txm_arena_zero(arena, n, 4 * sizeof(uint16_t));
    const int blocks = (c->side + txt_block_side(b) - 1) / txt_block_side(b);
    c->layer_capacity = TXT_FRAME_LAYERS + blocks * blocks + 2 * TXT_MENDS;
    c->layers = (txt_layer *)txm_arena_alloc(arena, (size_t)c->layer_capacity, sizeof(txt_layer));
    c->shows = (int32_t *)txm_arena_alloc(arena, n, 2 * sizeof(int32_t));
    c->gap = (uint16_t *)txm_arena_alloc(arena, n, sizeof(uint16_t));
    c->query.capacity = TXT_SAMPLES;
    c->query.samples = (txt_sample *)txm_arena_alloc(arena, TXT_SAMPLES, sizeof(txt_sample));
    txt_scratch_make(b, arena, &c->scratch);
    txm_flow_make(&c->flow, arena, 2 * c->half, (c->side + 2) * (c->side + 2));
    if (b->desc->repair != TEXTILES_REPAIR_NONE) {
        r->image = (float *)txm_arena_alloc(arena, n, 8 * sizeof(float));
        r->mask = (uint8_t *)txm_arena_alloc(arena, n, 1);
        r->pool.size = txt_pool_bytes(n, (size_t)c->side);
        r->pool.block = (uint8_t *)txm_arena_alloc(arena, r->pool.size, 1);
    }
    if (arena->failed) return;
    if (r->image) r->target = r->image + 4 * n;
    c->inside = bytes;
    c->locked = bytes + n;
    c->border = bytes + 2 * n;
    c->label = labels;
    c->kept = labels + n;
    c->start = labels + 2 * n;
    c->best = labels + 3 * n;
    c->other = c->shows + n;
}

/* variant 0 of a tile */
static int txt_base(const txt_build *b, int tile) {
    return tile - b->set->tiles[tile].variant;
}

/* Are two places closer than `reach`? */
static int txt_places_agree(const txt_place *a, const txt_place *b, int reach) {
    return a->sheet == b->sheet && a->turn == b->turn && abs(a->i - b->i) < reach &&
           abs(a->j - b->j) < reach;
}

/* The cost of a place, in gray levels, for being shown by other tiles: variants of one tile must
   not show the same, and no two tiles exactly the same. */
static double txt_sharing_cost(const txt_build *b, const txt_batch *batch, int k,
                               const txt_place *place) {
    const int reach = b->set->size / 3, apart = b->set->size / 8, tile = batch->canvas[k].tile;
    const int first = txt_base(b, tile), begun = batch->canvas[0].tile;
    double cost = 0;
    for (int t = 0; t < begun; t++) {
        if (txt_places_agree(&b->inside[t], place, t >= first ? apart : 3)) cost += 300;
    }
    for (int o = 0; o < k; o++) {
        const txt_canvas *other = &batch->canvas[o];
        for (int q = 0; q < other->place_count && q < other->tries; q++) {
            const int variant = other->tile >= first;
            if (!txt_places_agree(&other->places[q], place, variant ? apart : reach)) continue;
            cost += variant ? 300 : TXT_USE / (q ? 2 : 1);
        }
    }
    return cost;
}

/* Sort the places found for the interiors of a batch: those that another tile shows or tries come
   later, those that bring the traits of the set closer to the means of the exemplars earlier. */
static void txt_rank_places(const txt_build *b, txt_batch *batch, int count) {
    double surplus[TXT_TRAITS], more[TXT_TRAITS];
    memcpy(surplus, b->surplus, sizeof surplus);
    for (int k = 0; k < count; k++) {
        txt_canvas *c = &batch->canvas[k];
        int same = 1; /* variants of one tile that are in the batch share the places */
        for (int o = 0; o < count; o++)
            same += o != k && txt_base(b, batch->canvas[o].tile) == txt_base(b, c->tile);
        c->tries = txm_clampi(c->place_count / same, 1, TXT_TRIES - b->is_triangle);
        for (int p = 0; p < c->place_count; p++) {
            double cost = txt_sharing_cost(b, batch, k, &c->places[p]);
            txt_piece_traits(b, &c->places[p], more);
            for (int t = 0; t < TXT_TRAITS; t++) cost += fabs(surplus[t] + more[t]);
            for (int t = TXT_STEP; t < TXT_STEP + 2; t++) {
                /* joints have typical roughness and would be visible beside a smooth interior */
                const double rough = b->usual[t] > 0 ? 1 + more[t] / b->usual[t] : 1;
                if (rough < 0.9) cost += 600 * (0.9 - rough);
            }
            c->places[p].cost += (uint32_t)(cost * TXT_SCALE * TXT_BALANCE);
        }
        for (int p = 1; p < c->place_count; p++) { /* a stable sort */
            const txt_place place = c->places[p];
            int at = p;
            for (; at > 0 && c->places[at - 1].cost > place.cost; at--)
                c->places[at] = c->places[at - 1];
            c->places[at] = place;
        }
        if (c->place_count) {
            txt_piece_traits(b, &c->places[0], more);
            for (int t = 0; t < TXT_TRAITS; t++) surplus[t] += more[t];
        }
    }
}

static txm_status txt_make_tiles(txt_build *b) {
    txm_status status = TXM_OK;
    txm_arena arena;
    const int count = b->set->count;
    const int slots = count < TXT_BATCH ? count : TXT_BATCH;
    txm_arena_init(&arena, b->env);
    txt_batch *batch = (txt_batch *)txm_arena_zero(&arena, 1, sizeof *batch);
    b->inside = (txt_place *)txm_arena_zero(&arena, (size_t)count, sizeof(txt_place));
    for (int k = 0; k < slots && batch; k++)
        txt_canvas_make(b, &arena, &batch->canvas[k], &batch->repair[k]);
    if (arena.failed) {
        status = txm_fail(b->env, TXM_OUT_OF_MEMORY, "no memory to cut tiles");
        goto done;
    }
    for (int t = 0; t < count; t++) b->inside[t].sheet = -1;
    for (int first = 0; first < count; first += TXT_BATCH) {
        const int n = count - first < TXT_BATCH ? count - first : TXT_BATCH;
        if (txm_progress(b->env, 0.1f + 0.9f * (float)first / (float)count, "tiles")) {
            status = txm_fail(b->env, TXM_CANCELLED, "cancelled while cutting tiles");
            goto done;
        }
        txt_sum_use(b);
        for (int k = 0; k < n; k++) batch->canvas[k].tile = first + k;
        txm_parallel_for(b->env, n, txt_batch_begin, batch);
        txt_rank_places(b, batch, n);
        txm_parallel_for(b->env, n, txt_batch_cut, batch);
        for (int k = 0; k < n; k++) {
            txt_count_use(b, &batch->canvas[k]);
            txt_count_traits(b, &batch->canvas[k]);
            const int best = batch->canvas[k].best_place;
            if (best >= 0) b->inside[first + k] = batch->canvas[k].places[best];
        }
    }
done:
    txm_arena_free(&arena);
    return status;
}

/* ---- public: making ---------------------------------------------------------------------- */

static txm_status txt_check_exemplars(const textiles_desc *d, txt_map maps[TEXTILES_MAX_MAPS],
                                      txm_env *env) {
    if (!d->exemplars || d->exemplar_count < 1 || d->exemplar_count > TEXTILES_MAX_EXEMPLARS)
        return txm_fail(env, TXM_BAD_ARGUMENT, "exemplars: give 1 to 8");
    const int count = d->exemplars[0].map_count;
    const int colors = d->colors ? d->colors : 2;
    for (int e = 0; e < d->exemplar_count; e++) {
        const textiles_exemplar *x = &d->exemplars[e];
        if (!x->maps || x->map_count < 1 || x->map_count > TEXTILES_MAX_MAPS ||
            x->map_count != count)
            return txm_fail(env, TXM_BAD_ARGUMENT,
                            "exemplars: each needs the same number of maps, 1 to 8");
        for (int m = 0; m < count; m++) {
            const txm_image *im = &x->maps[m];
            const txm_status status = txm_image_check(im, "exemplars", TEXTILES_MAX_PIXELS, env);
            if (status != TXM_OK) return status;
            const int channels = im->channels ? im->channels : 1;
            if (im->width != x->maps[0].width || im->height != x->maps[0].height)
                return txm_fail(env, TXM_BAD_ARGUMENT,
                                "exemplars: the maps of one must have the same size");
            if (e && (channels != maps[m].channels || im->sample != maps[m].sample))
                return txm_fail(env, TXM_BAD_ARGUMENT,
                                "exemplars: all must have the same channels and sample type");
            if (!txm_image_is_finite(im))
                return txm_fail(env, TXM_BAD_ARGUMENT, "exemplars: a sample is not finite");
            if (im->width < 64 || im->height < 64)
                return txm_fail(env, TXM_TOO_SMALL, "exemplars: both sides need 64 pixels or more");
            maps[m].channels = channels;
            maps[m].sample = im->sample;
        }
    }
    if (d->edge_exemplars) {
        if (d->kind == TEXTILES_CORNER)
            return txm_fail(env, TXM_BAD_ARGUMENT, "edge_exemplars: corner sets have no edge colors");
        for (int c = 0; c < colors; c++) {
            if (d->edge_exemplars[c] < 0 || d->edge_exemplars[c] >= d->exemplar_count)
                return txm_fail(env, TXM_BAD_ARGUMENT, "edge_exemplars: no such exemplar");
        }
    }
    if ((int)d->repair < 0 || d->repair > TEXTILES_REPAIR_POISSON)
        return txm_fail(env, TXM_BAD_ARGUMENT, "repair is none of textiles_repair");
    return TXM_OK;
}

TEXTILES_API txm_status textiles_make(const textiles_desc *desc, txm_env *env, textiles_set **out) {
    txt_map maps[TEXTILES_MAX_MAPS];
    txt_build b;
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    if (!desc) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL; pass a textiles_desc");
    memset(maps, 0, sizeof maps);
    memset(&b, 0, sizeof b);
    txm_status status = txt_check_kind(desc, env);
    if (status == TXM_OK) status = txt_check_exemplars(desc, maps, env);
    if (status == TXM_OK && txm_progress(env, 0, "exemplars"))
        status = txt_cancelled(env);
    if (status == TXM_OK)
        status = txt_set_make(desc, maps, desc->exemplars[0].map_count, 1, env, &b.set);
    if (status != TXM_OK) return status;
    b.desc = desc;
    b.env = env;
    b.is_triangle = desc->kind == TEXTILES_TRIANGLE;
    b.wanted_step = b.is_triangle ? 0.99 : 1; /* cuts inside triangles are a little rougher */
    txm_arena_init(&b.arena, env);
    status = txt_prepare(&b);
    if (status == TXM_OK) status = txt_make_frames(&b);
    if (status == TXM_OK) status = txt_make_tiles(&b);
    if (status == TXM_OK && txm_progress(env, 1, "tiles"))
        status = txt_cancelled(env);
    txm_arena_free(&b.arena);
    if (status != TXM_OK) textiles_set_free(b.set);
    else *out = b.set;
    return status;
}

#endif /* TEXTILES_MAKE_H */
