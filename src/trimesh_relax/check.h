#ifndef TRIMESH_RELAX_CHECK_H
#define TRIMESH_RELAX_CHECK_H

#include "config.h"

/* ---- using a mesh: what all functions share ------------------------------------------------ */

enum {
    TMR_TX_BLOCK = 1024,  /* triangles or values that a thread takes at a time                    */
    TMR_TX_NONE = 0xff    /* no corner                                                            */
};
#define TMR_TX_BATCHES 16 /* rounds of a long loop, between which the caller may cancel           */
#define TMR_TX_SNAP 1e-6  /* of an edge: points of a patch nearer to a side lie on it             */
#define TMR_TX_H 0.86602540378443864676 /* height of the reference triangle, sqrt(3) / 2          */

/* The message may have two #, which stand for a and b. */
static txm_status tmr_tx_fail(txm_env *env, txm_status status, const char *text, uint64_t a,
                              uint64_t b) {
    char line[160], digits[20];
    size_t n = 0;
    for (; *text && n + 1 < sizeof line; text++) {
        if (*text != '#') {
            line[n++] = *text;
            continue;
        }
        int count = 0;
        for (; a || !count; a /= 10) digits[count++] = (char)('0' + a % 10);
        while (count && n + 1 < sizeof line) line[n++] = digits[--count];
        a = b;
    }
    line[n] = 0;
    return txm_fail(env, status, line);
}

static txm_status tmr_tx_no_memory(txm_env *env) {
    return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the work on the mesh");
}

static txm_status tmr_tx_report(txm_env *env, double fraction, const char *stage) {
    if (!txm_progress(env, txm_float(fraction), stage)) return TXM_OK;
    return txm_fail(env, TXM_CANCELLED, "cancelled");
}

static int tmr_tx_are_finite(const float *values, size_t count) {
    for (size_t i = 0; i < count; i++) {
        if (!txm_is_finite(values[i])) return 0;
    }
    return 1;
}

/* Refuse a mesh whose numbers cannot be trusted. positions: are they needed? */
static txm_status tmr_tx_check(const trimesh_view *mesh, int positions, txm_env *env) {
    if (!mesh) return txm_fail(env, TXM_BAD_ARGUMENT, "the mesh is NULL");
    if (mesh->vertex_count > TRIMESH_MAX_VERTICES || mesh->triangle_count > TRIMESH_MAX_VERTICES)
        return txm_fail(env, TXM_TOO_LARGE, "more than TRIMESH_MAX_VERTICES vertices or triangles");
    if (mesh->triangle_count && !mesh->indices)
        return txm_fail(env, TXM_BAD_ARGUMENT, "indices of the mesh is NULL");
    if (positions && mesh->vertex_count && !mesh->positions)
        return txm_fail(env, TXM_BAD_ARGUMENT, "positions of the mesh is NULL");
    for (size_t i = 0; i < 3 * mesh->triangle_count; i++) {
        if (mesh->indices[i] >= mesh->vertex_count)
            return tmr_tx_fail(env, TXM_BAD_ARGUMENT,
                               "triangle # names vertex #, which is not below vertex_count", i / 3,
                               mesh->indices[i]);
    }
    for (size_t i = 0; positions && i < mesh->vertex_count; i++) {
        if (!tmr_tx_are_finite(mesh->positions + 3 * i, 3))
            return tmr_tx_fail(env, TXM_BAD_ARGUMENT, "the position of vertex # is not finite", i,
                               0);
    }
    return TXM_OK;
}

static txm_dvec3 tmr_tx_vec(const float *p) {
    return txm_d3(p[0], p[1], p[2]);
}

static void tmr_tx_corners(const trimesh_view *mesh, size_t triangle, txm_dvec3 p[3]) {
    for (size_t k = 0; k < 3; k++)
        p[k] = tmr_tx_vec(mesh->positions + 3 * (size_t)mesh->indices[3 * triangle + k]);
}

/* A loop over count things, of which each block writes its own: what a thread is given. */
typedef struct tmr_tx_loop {
    void (*body)(const void *job, size_t first, size_t end);
    const void *job;
    size_t count, first_block;
} tmr_tx_loop;

static void tmr_tx_block(void *context, int index) {
    const tmr_tx_loop *l = (const tmr_tx_loop *)context;
    const size_t first = (l->first_block + (size_t)index) * TMR_TX_BLOCK;
    const size_t end = first + TMR_TX_BLOCK;
    l->body(l->job, first, end < l->count ? end : l->count);
}

/* body(job, first, end) for all of count, spread over threads; progress goes from..to. */
static txm_status tmr_tx_spread(void (*body)(const void *, size_t, size_t), const void *job,
                                size_t count, double from, double to, const char *stage,
                                txm_env *env) {
    tmr_tx_loop l;
    const size_t blocks = (count + TMR_TX_BLOCK - 1) / TMR_TX_BLOCK;
    l.body = body;
    l.job = job;
    l.count = count;
    for (size_t b = 0; b < TMR_TX_BATCHES; b++) {
        const size_t end = blocks * (b + 1) / TMR_TX_BATCHES;
        l.first_block = blocks * b / TMR_TX_BATCHES;
        if (end == l.first_block) continue;
        const txm_status status =
            tmr_tx_report(env, from + (to - from) * (double)b / TMR_TX_BATCHES, stage);
        if (status != TXM_OK) return status;
        txm_parallel_for(env, (int)(end - l.first_block), tmr_tx_block, &l);
    }
    return TXM_OK;
}

TRIMESH_API trimesh_view trimesh_as_view(const trimesh_mesh *mesh) {
    trimesh_view view;
    view.positions = mesh->positions;
    view.indices = mesh->indices;
    view.vertex_count = mesh->vertex_count;
    view.triangle_count = mesh->triangle_count;
    return view;
}

/* The sum of the weighted normals at each vertex; sum holds 3 zeros for each. */
static void tmr_tx_sum_normals(const trimesh_view *mesh, double *sum) {
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        txm_dvec3 p[3];
        tmr_tx_corners(mesh, t, p);
        const txm_dvec3 n = txm_d3_area2(p[0], p[1], p[2]);
        const double d[3] = {txm_d3_dist2(p[0], p[1]), txm_d3_dist2(p[1], p[2]),
                             txm_d3_dist2(p[2], p[0])};
        for (size_t k = 0; k < 3; k++) {
            const double weight = d[k] * d[(k + 2) % 3];
            double *to = sum + 3 * (size_t)mesh->indices[3 * t + k];
            if (!(weight > 0)) continue;
            to[0] += n.x / weight;
            to[1] += n.y / weight;
            to[2] += n.z / weight;
        }
    }
}

TRIMESH_API txm_status trimesh_normals(const trimesh_view *mesh, txm_env *env, float *normals) {
    txm_arena arena;
    txm_status status = tmr_tx_check(mesh, 1, env);
    if (status != TXM_OK) return status;
    if (mesh->vertex_count == 0) return TXM_OK;
    if (!normals) return txm_fail(env, TXM_BAD_ARGUMENT, "normals is NULL");
    if (tmr_tx_report(env, 0, "normals") != TXM_OK) return TXM_CANCELLED;
    txm_arena_init(&arena, env);
    double *sum = (double *)txm_arena_zero(&arena, mesh->vertex_count, 3 * sizeof(double));
    if (!sum) {
        status = tmr_tx_no_memory(env);
    } else {
        tmr_tx_sum_normals(mesh, sum);
        for (size_t v = 0; v < mesh->vertex_count; v++) {
            const txm_dvec3 n = txm_d3_unit(txm_d3(sum[3 * v], sum[3 * v + 1], sum[3 * v + 2]));
            normals[3 * v] = txm_float(n.x);
            normals[3 * v + 1] = txm_float(n.y);
            normals[3 * v + 2] = txm_float(n.z);
        }
    }
    txm_arena_free(&arena);
    return status;
}

/* ---- using a mesh: which sides share an edge ----------------------------------------------- */

/* Side i of a mesh is that from corner i to the next corner of its triangle. */
static size_t tmr_tx_end(size_t side) {
    return side % 3 == 2 ? side - 2 : side + 1;
}
static uint32_t tmr_tx_low(const uint32_t *vertex, size_t side) {
    const uint32_t a = vertex[side], b = vertex[tmr_tx_end(side)];
    return a < b ? a : b;
}
static uint32_t tmr_tx_high(const uint32_t *vertex, size_t side) {
    const uint32_t a = vertex[side], b = vertex[tmr_tx_end(side)];
    return a < b ? b : a;
}

/* The sides in the order of their edges, those of one edge by number. NULL without memory; pairs lies
   in the arena, and as much scratch. */
static txm_pair *tmr_tx_sort_sides(const uint32_t *vertex, size_t sides, txm_arena *arena) {
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(arena, sides, 2 * sizeof(txm_pair));
    if (!pairs) return NULL;
    for (size_t i = 0; i < sides; i++) {
        pairs[i].key = tmr_tx_high(vertex, i);
        pairs[i].value = (uint32_t)i;
    }
    txm_sort_pairs(pairs, pairs + sides, sides);
    for (size_t i = 0; i < sides; i++) pairs[i].key = tmr_tx_low(vertex, pairs[i].value);
    txm_sort_pairs(pairs, pairs + sides, sides);
    return pairs;
}

/* The end of the run of sides that share the edge of pairs[i]. */
static size_t tmr_tx_run_end(const uint32_t *vertex, const txm_pair *pairs, size_t i, size_t sides) {
    const uint32_t low = pairs[i].key, high = tmr_tx_high(vertex, pairs[i].value);
    do i++;
    while (i < sides && pairs[i].key == low && tmr_tx_high(vertex, pairs[i].value) == high);
    return i;
}

/* Link the sides of each edge into a ring, lowest first: a side without another has itself as next.
   Sides from a vertex to itself stay alone. 0 without memory. */
static int tmr_tx_link(const uint32_t *vertex, size_t sides, uint32_t *next, const txm_env *env) {
    txm_arena scratch;
    txm_arena_init(&scratch, env);
    const txm_pair *pairs = tmr_tx_sort_sides(vertex, sides, &scratch);
    for (size_t i = 0; pairs && i < sides;) {
        const size_t end = tmr_tx_run_end(vertex, pairs, i, sides);
        const int alone = vertex[pairs[i].value] == vertex[tmr_tx_end(pairs[i].value)];
        for (size_t k = i; k < end; k++) {
            const size_t other = k + 1 < end ? k + 1 : i;
            next[pairs[k].value] = pairs[alone ? k : other].value;
        }
        i = end;
    }
    txm_arena_free(&scratch);
    return pairs != NULL;
}

#endif /* TRIMESH_RELAX_CHECK_H */
