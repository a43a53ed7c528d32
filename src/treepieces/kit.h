#ifndef TREEPIECES_KIT_H
#define TREEPIECES_KIT_H

#include "builtin.h"

/* ---- the kit ----------------------------------------------------------------------------- */

/* A vertex of a piece in the frame of one of its leaf rims. */
typedef struct tpc_local_vertex {
    float position[3], normal[3];
} tpc_local_vertex;

/* Average height of the quads of a band: along y in lengths, outwards in radii. */
typedef struct tpc_band {
    float rise, spread;
} tpc_band;

/* Four quads whose tiles share one word of a record, one byte each. The byte is 255 in bands[b] if
   the quad belongs to band b, in bottom if it lies at the bottom of its layer, in own if its class
   is one of the caller's. first, last: range of the bands that occur. */
typedef struct tpc_cells {
    uint32_t bands[TREEPIECES_BANDS], bottom, own;
    int first, last;
} tpc_cells;

struct treepieces_kit {
    txm_arena arena; /* holds the kit itself and all it points to */
    int count;
    treepieces_piece pieces[TREEPIECES_MAX_TYPES];
    tpc_local_vertex *local[TREEPIECES_MAX_TYPES]; /* vertex_count for each leaf rim */
    tpc_band bands[TREEPIECES_MAX_TYPES][TREEPIECES_BANDS];
    int band_counts[TREEPIECES_MAX_TYPES]; /* 1 + the highest in use */
    float offsets[TREEPIECES_MAX_TYPES][TREEPIECES_MAX_LEAVES]; /* of leaf rims from the axis */
    tpc_cells *cells[TREEPIECES_MAX_TYPES]; /* (quad_count + 3) / 4 each */
};

/* ---- checking a piece -------------------------------------------------------------------- */

/* Fail because of a piece; number < 0: the fault is not that of one vertex or quad. */
static txm_status tpc_refuse(txm_env *env, const treepieces_piece *p, int index, const char *what,
                             int number, const char *fault) {
    char line[160];
    if (number < 0)
        snprintf(line, sizeof line, "piece %d (%.40s): %s", index, p->name ? p->name : "", fault);
    else
        snprintf(line, sizeof line, "piece %d (%.40s), %s %d: %s", index, p->name ? p->name : "",
                 what, number, fault);
    return txm_fail(env, TXM_BAD_ARGUMENT, line);
}

static int tpc_is_near(const float *a, const float *b, int n, float tolerance) {
    for (int i = 0; i < n; i++)
        if (!(fabsf(a[i] - b[i]) <= tolerance)) return 0;
    return 1;
}

/* Counts and indices, so that the other checks can index. */
static txm_status tpc_check_numbers(const treepieces_piece *p, int index, txm_env *env) {
    if (!p->vertices || p->vertex_count < 7 || p->vertex_count > TREEPIECES_MAX_VERTICES)
        return tpc_refuse(env, p, index, "", -1, "needs 7 to 255 vertices");
    if (!p->quads || p->quad_count < 6 || p->quad_count > TREEPIECES_MAX_QUADS)
        return tpc_refuse(env, p, index, "", -1, "needs 6 to 255 quads");
    if (p->leaf_count < 0 || p->leaf_count > TREEPIECES_MAX_LEAVES)
        return tpc_refuse(env, p, index, "", -1, "leaf_count must be 0 to 3");
    for (int i = 0; i < p->quad_count; i++) {
        const treepieces_quad *q = &p->quads[i];
        for (int k = 0; k < 4; k++) {
            if (q->corners[k] >= p->vertex_count)
                return tpc_refuse(env, p, index, "quad", i, "a corner is not a vertex");
            for (int j = 0; j < k; j++)
                if (q->corners[j] == q->corners[k])
                    return tpc_refuse(env, p, index, "quad", i, "two corners are one vertex");
        }
        if (q->band >= TREEPIECES_BANDS)
            return tpc_refuse(env, p, index, "quad", i, "band must be 0 to 3");
        if (q->tile_class == TREEPIECES_HALVING || q->tile_class >= 64)
            return tpc_refuse(env, p, index, "quad", i, "tile_class must be 0 to 3 or 5 to 63");
    }
    for (int k = -1; k < p->leaf_count; k++) {
        const int *rim = tpc_rim_of(p, k);
        for (int j = 0; j < TREEPIECES_RIM; j++)
            if (rim[j] < 0 || rim[j] >= p->vertex_count)
                return tpc_refuse(env, p, index, "place", j, "of a rim is not a vertex");
    }
    return TXM_OK;
}

/* Finite, unit normals, weights. */
static txm_status tpc_check_vertices(const treepieces_piece *p, int index, txm_env *env) {
    for (int i = 0; i < p->vertex_count; i++) {
        const treepieces_vertex *v = &p->vertices[i];
        float sum = 0;
        for (int k = 0; k < 3; k++)
            if (!txm_is_finite((double)v->position[k]) || !txm_is_finite((double)v->normal[k]))
                return tpc_refuse(env, p, index, "vertex", i, "is not finite");
        if (!(fabsf(tpc_dot(v->normal, v->normal) - 1) <= 1e-3f))
            return tpc_refuse(env, p, index, "vertex", i, "the normal's length is not 1");
        for (int k = 0; k < 4; k++) {
            if (!(v->weights[k] >= 0) || (k > p->leaf_count && v->weights[k] != 0))
                return tpc_refuse(env, p, index, "vertex", i,
                                  "a weight is negative, or of a joint that does not exist");
            sum += v->weights[k];
        }
        if (!(fabsf(sum - 1) <= 1e-4f))
            return tpc_refuse(env, p, index, "vertex", i, "the sum of the weights is not 1");
    }
    return TXM_OK;
}

/* Rim k (-1: the root rim) is the canonical hexagon, bound to its joint alone. */
static txm_status tpc_check_rim(const treepieces_piece *p, int index, int k, txm_env *env) {
    const treepieces_similarity root = {{0, 0, 0}, {0, 0, 0, 1}, 1};
    const treepieces_similarity *b = k < 0 ? &root : &p->building[k];
    const int *rim = tpc_rim_of(p, k);
    float length = 0;
    for (int i = 0; i < 4; i++) length += b->rotation[i] * b->rotation[i];
    if (!(fabsf(length - 1) <= 1e-4f))
        return tpc_refuse(env, p, index, "leaf rim", k,
                          "the building rotation is not a unit quaternion");
    if (!(b->scale > 0) || !txm_is_finite((double)b->scale))
        return tpc_refuse(env, p, index, "leaf rim", k, "the building scale is not above 0");
    for (int j = 0; j < TREEPIECES_RIM; j++) {
        const treepieces_vertex *v = &p->vertices[rim[j]];
        float position[3], normal[3];
        tpc_leaf_vertex(b, j, position, normal);
        if (!tpc_is_near(v->position, position, 3, 1e-4f * b->scale))
            return tpc_refuse(env, p, index, "vertex", rim[j],
                              k < 0 ? "is not at its place on the root rim"
                                    : "is not at its place on a leaf rim, which the building "
                                      "transform gives");
        if (!tpc_is_near(v->normal, normal, 3, 1e-3f))
            return tpc_refuse(env, p, index, "vertex", rim[j],
                              "the normal is not that of the rim's cone");
        if (!(v->weights[1 + k] >= 1 - 1e-4f))
            return tpc_refuse(env, p, index, "vertex", rim[j],
                              k < 0 ? "on the root rim, is not bound to the own bone alone"
                                    : "on a leaf rim, is not bound to its terminal joint alone");
        for (int i = -1; i < k; i++) {
            const int *other = tpc_rim_of(p, i);
            for (int m = 0; m < TREEPIECES_RIM; m++)
                if (other[m] == rim[j])
                    return tpc_refuse(env, p, index, "vertex", rim[j], "is on two rims");
        }
    }
    return TXM_OK;
}

/* side[a * n + b]: number of quads with the side from a to b */
static int tpc_has_side(const uint8_t *side, int n, int a, int b) {
    return side[(size_t)a * (size_t)n + (size_t)b];
}

/* The quads about each vertex form one fan: walking over shared sides reaches all of them. */
static txm_status tpc_check_fans(const treepieces_piece *p, int index, txm_env *env) {
    for (int v = 0; v < p->vertex_count; v++) {
        int from[TREEPIECES_MAX_QUADS], to[TREEPIECES_MAX_QUADS], count = 0, met = 1;
        for (int i = 0; i < p->quad_count; i++) {
            const uint8_t *c = p->quads[i].corners;
            for (int k = 0; k < 4; k++) {
                if (c[k] != v) continue;
                TXM_ASSERT(count < TREEPIECES_MAX_QUADS);
                from[count] = c[(k + 1) % 4];
                to[count++] = c[(k + 3) % 4];
            }
        }
        if (!count) return tpc_refuse(env, p, index, "vertex", v, "is unused");
        int first = from[0], last = to[0];
        for (int grown = 1; grown;) {
            grown = 0;
            for (int i = 1; i < count; i++) {
                if (from[i] < 0 || (from[i] != last && to[i] != first)) continue;
                if (from[i] == last) last = to[i];
                else first = from[i];
                from[i] = -1;
                met++;
                grown = 1;
            }
        }
        if (met < count)
            return tpc_refuse(env, p, index, "vertex", v, "the surface touches itself there");
    }
    return TXM_OK;
}

/* The representative of the connected vertices to which this one belongs (union-find). */
static int tpc_find_root(const int *root, int vertex) {
    while (root[vertex] != vertex) vertex = root[vertex];
    return vertex;
}

/* Oriented, manifold, connected, and the rims are its only borders. */
static txm_status tpc_check_surface(const treepieces_piece *p, int index, uint8_t *side,
                                    txm_env *env) {
    const int n = p->vertex_count;
    int root[TREEPIECES_MAX_VERTICES], borders = 0;
    memset(side, 0, (size_t)n * (size_t)n);
    for (int i = 0; i < n; i++) root[i] = i;
    for (int i = 0; i < p->quad_count; i++) {
        for (int k = 0; k < 4; k++) {
            const int a = p->quads[i].corners[k], b = p->quads[i].corners[(k + 1) % 4];
            if (side[(size_t)a * (size_t)n + (size_t)b]++)
                return tpc_refuse(env, p, index, "vertex", a,
                                  "a side from it belongs to two quads of opposite orientation");
            root[tpc_find_root(root, a)] = tpc_find_root(root, b);
        }
    }
    for (int k = -1; k < p->leaf_count; k++) {
        const int *rim = tpc_rim_of(p, k);
        for (int j = 0; j < TREEPIECES_RIM; j++) {
            const int a = rim[j], b = rim[(j + 1) % TREEPIECES_RIM];
            const int ahead = tpc_has_side(side, n, a, b), back = tpc_has_side(side, n, b, a);
            if (ahead != (k < 0) || back != (k >= 0))
                return tpc_refuse(env, p, index, "vertex", a,
                                  "the edge of the rim from it is no border, or runs the wrong way");
        }
    }
    for (int a = 0; a < n; a++) {
        for (int b = 0; b < n; b++) {
            if (!tpc_has_side(side, n, a, b) || tpc_has_side(side, n, b, a)) continue;
            if (++borders > TREEPIECES_RIM * (1 + p->leaf_count))
                return tpc_refuse(env, p, index, "", -1, "has a border that is not a rim");
        }
    }
    const txm_status status = tpc_check_fans(p, index, env);
    if (status != TXM_OK) return status;
    for (int i = 1; i < n; i++)
        if (tpc_find_root(root, i) != tpc_find_root(root, 0))
            return tpc_refuse(env, p, index, "vertex", i, "is not connected to vertex 0");
    return TXM_OK;
}

static txm_status tpc_check_piece(const treepieces_piece *p, int index, uint8_t *side,
                                  txm_env *env) {
    txm_status status = tpc_check_numbers(p, index, env);
    if (status == TXM_OK) status = tpc_check_vertices(p, index, env);
    for (int k = -1; status == TXM_OK && k < p->leaf_count; k++)
        status = tpc_check_rim(p, index, k, env);
    if (status == TXM_OK) status = tpc_check_surface(p, index, side, env);
    return status;
}

static void tpc_measure_bands(const treepieces_piece *p, tpc_band bands[TREEPIECES_BANDS]) {
    int counts[TREEPIECES_BANDS] = {0, 0, 0, 0};
    for (int i = 0; i < p->quad_count; i++) {
        const treepieces_quad *q = &p->quads[i];
        float side[3] = {0, 0, 0};
        for (int k = 0; k < 3; k++)
            for (int c = 0; c < 2; c++) /* west, then east */
                side[k] += 0.5f * (p->vertices[q->corners[3 * c]].position[k] -
                                   p->vertices[q->corners[1 + c]].position[k]);
        bands[q->band].rise += fabsf(side[1]);
        bands[q->band].spread += sqrtf(side[0] * side[0] + side[2] * side[2]);
        counts[q->band]++;
    }
    for (int b = 0; b < TREEPIECES_BANDS; b++) {
        if (!counts[b]) continue;
        bands[b].rise /= (float)counts[b];
        bands[b].spread /= (float)counts[b];
    }
}

static void tpc_sort_cells(const treepieces_piece *p, tpc_cells *cells) {
    for (int i = 0; i < p->quad_count; i++) {
        const treepieces_quad *q = &p->quads[i];
        tpc_cells *c = &cells[i / 4];
        const uint32_t byte = 255u << (8 * (i & 3));
        if ((i & 3) == 0) c->first = c->last = q->band;
        if (q->band < c->first) c->first = q->band;
        if (q->band > c->last) c->last = q->band;
        c->bands[q->band] |= byte;
        if (q->tile_class != TREEPIECES_BARK && q->tile_class < TREEPIECES_OWN) c->bottom |= byte;
        if (q->tile_class >= TREEPIECES_OWN) c->own |= byte;
    }
}

/* Move the rims to their exact places and bind them to their joints alone. */
static void tpc_place_rims(const treepieces_piece *p, treepieces_vertex *v) {
    const float own[4] = {1, 0, 0, 0};
    for (int i = 0; i < p->vertex_count; i++) {
        v[i].rim = -1;
        v[i].reserved = 0;
    }
    for (int j = 0; j < TREEPIECES_RIM; j++) {
        treepieces_vertex *r = &v[p->root_rim[j]];
        tpc_rim_vertex(j, r->position, r->normal);
        memcpy(r->weights, own, sizeof own);
        for (int k = 0; k < p->leaf_count; k++) {
            treepieces_vertex *l = &v[p->leaf_rims[k][j]];
            tpc_leaf_vertex(&p->building[k], j, l->position, l->normal);
            memset(l->weights, 0, sizeof l->weights);
            l->weights[1 + k] = 1;
            l->rim = TREEPIECES_RIM * k + j;
        }
    }
}

/* All vertices of a piece, moved into the frame of a leaf rim. */
static void tpc_move_into_rim(const treepieces_vertex *v, size_t count,
                             const treepieces_similarity *b, tpc_local_vertex *local) {
    const float back[4] = {-b->rotation[0], -b->rotation[1], -b->rotation[2], b->rotation[3]};
    for (size_t i = 0; i < count; i++) {
        float moved[3];
        for (int c = 0; c < 3; c++)
            moved[c] = (v[i].position[c] - b->translation[c]) / b->scale;
        tpc_rotate(back, moved, local[i].position);
        tpc_rotate(back, v[i].normal, local[i].normal);
    }
}

/* Copy a piece into the kit; its rims are moved to their exact places. */
static txm_status tpc_add_piece(treepieces_kit *kit, const treepieces_piece *from, txm_env *env) {
    const size_t vertices = (size_t)from->vertex_count, quads = (size_t)from->quad_count;
    const size_t name = from->name ? strlen(from->name) : 0;
    treepieces_vertex *v =
        (treepieces_vertex *)txm_arena_alloc(&kit->arena, vertices, sizeof *v);
    treepieces_quad *q = (treepieces_quad *)txm_arena_alloc(&kit->arena, quads, sizeof *q);
    char *text = (char *)txm_arena_alloc(&kit->arena, name + 1, 1);
    tpc_local_vertex *local = (tpc_local_vertex *)txm_arena_alloc(
        &kit->arena, vertices * (size_t)(from->leaf_count + 1), sizeof *local);
    tpc_cells *cells = (tpc_cells *)txm_arena_zero(&kit->arena, (quads + 3) / 4, sizeof *cells);
    if (kit->arena.failed)
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a piece");
    TXM_ASSERT(kit->count < TREEPIECES_MAX_TYPES);
    treepieces_piece *p = &kit->pieces[kit->count];
    *p = *from;
    memcpy(v, from->vertices, vertices * sizeof *v);
    memcpy(q, from->quads, quads * sizeof *q);
    if (name) memcpy(text, from->name, name);
    text[name] = 0;
    tpc_place_rims(p, v);
    for (int k = 0; k < p->leaf_count; k++) {
        const treepieces_similarity *b = &p->building[k];
        kit->offsets[kit->count][k] = sqrtf(b->translation[0] * b->translation[0] +
                                            b->translation[2] * b->translation[2]);
        tpc_move_into_rim(v, vertices, b, local + (size_t)k * vertices);
    }
    p->vertices = v;
    p->quads = q;
    p->name = text;
    tpc_measure_bands(p, kit->bands[kit->count]);
    tpc_sort_cells(p, cells);
    for (size_t i = 0; i < quads; i++)
        if (q[i].band >= kit->band_counts[kit->count]) kit->band_counts[kit->count] = q[i].band + 1;
    kit->cells[kit->count] = cells;
    kit->local[kit->count++] = local;
    return TXM_OK;
}

TREEPIECES_API void treepieces_kit_free(treepieces_kit *kit) {
    if (!kit) return;
    txm_arena arena = kit->arena;
    txm_arena_free(&arena);
}

TREEPIECES_API txm_status treepieces_kit_make(const treepieces_piece *pieces, int count,
                                              txm_env *env, treepieces_kit **out) {
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    if (count < 0 || (count > 0 && !pieces))
        return txm_fail(env, TXM_BAD_ARGUMENT, "pieces is NULL, or count below 0");
    if (count > TREEPIECES_MAX_TYPES - (int)TREEPIECES_BUILTIN)
        return txm_fail(env, TXM_TOO_LARGE, "more pieces than TREEPIECES_MAX_TYPES");
    txm_arena arena;
    txm_arena_init(&arena, env);
    treepieces_kit *kit = (treepieces_kit *)txm_arena_zero(&arena, 1, sizeof *kit);
    tpc_shape *shape = (tpc_shape *)txm_alloc(env, sizeof *shape);
    uint8_t *side = (uint8_t *)txm_alloc(env, TREEPIECES_MAX_VERTICES * TREEPIECES_MAX_VERTICES);
    txm_status status = TXM_OK;
    if (kit) kit->arena = arena;
    if (!kit || !shape || !side) {
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the kit");
    } else {
        for (int i = 0; status == TXM_OK && i < TREEPIECES_BUILTIN; i++) {
            tpc_make_builtin(i, shape);
            status = tpc_add_piece(kit, &shape->piece, env);
        }
        for (int i = 0; status == TXM_OK && i < count; i++) {
            status = tpc_check_piece(&pieces[i], i, side, env);
            if (status == TXM_OK) status = tpc_add_piece(kit, &pieces[i], env);
        }
    }
    txm_free(env, shape);
    txm_free(env, side);
    if (status == TXM_OK) *out = kit;
    else treepieces_kit_free(kit);
    return status;
}

TREEPIECES_API int treepieces_kit_count(const treepieces_kit *kit) {
    return kit ? kit->count : 0;
}

TREEPIECES_API const treepieces_piece *treepieces_kit_piece(const treepieces_kit *kit, int type) {
    return kit && type >= 0 && type < kit->count ? &kit->pieces[type] : NULL;
}

#endif /* TREEPIECES_KIT_H */
