#ifndef TRIMESH_COVER_CHECK_H
#define TRIMESH_COVER_CHECK_H

#include "../trimesh_cover.h"

/* ---- what all functions share -------------------------------------------------------------- */

enum {
    TMC_BLOCK = 1024, /* triangles or values that a thread takes at a time                    */
    TMC_NONE = 0xff   /* no corner                                                            */
};
#define TMC_BATCHES 16 /* rounds of a long loop, between which the caller may cancel           */
#define TMC_SNAP 1e-6  /* of an edge: points of a patch nearer to a side lie on it             */
#define TMC_H 0.86602540378443864676 /* height of the reference triangle, sqrt(3) / 2          */

/* Have all requests to the arena been met? Functions ask for all they need, then look once. */
static txm_status tmc_check_memory(const txm_arena *arena, txm_env *env) {
    if (!arena->failed) return TXM_OK;
    return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the work on the mesh");
}

static txm_status tmc_report(txm_env *env, double fraction, const char *stage) {
    if (!txm_progress(env, txm_float(fraction), stage)) return TXM_OK;
    return txm_fail(env, TXM_CANCELLED, "cancelled");
}

static int tmc_are_finite(const float *values, size_t count) {
    for (size_t i = 0; i < count; i++) {
        if (!txm_is_finite(values[i])) return 0;
    }
    return 1;
}

/* A loop over count things; each block of them writes only its own results. */
typedef struct tmc_loop {
    void (*body)(const void *job, size_t first, size_t end);
    const void *job;
    size_t count, first_block;
} tmc_loop;

static void tmc_block(void *context, int index) {
    const tmc_loop *l = (const tmc_loop *)context;
    const size_t first = (l->first_block + (size_t)index) * TMC_BLOCK;
    const size_t end = first + TMC_BLOCK;
    l->body(l->job, first, end < l->count ? end : l->count);
}

/* body(job, first, end) for all of count, spread over threads; progress goes from..to. */
static txm_status tmc_run_blocks(void (*body)(const void *, size_t, size_t), const void *job,
                                 size_t count, double from, double to, const char *stage,
                                 txm_env *env) {
    tmc_loop l;
    const size_t blocks = (count + TMC_BLOCK - 1) / TMC_BLOCK;
    l.body = body;
    l.job = job;
    l.count = count;
    for (size_t b = 0; b < TMC_BATCHES; b++) {
        const size_t end = blocks * (b + 1) / TMC_BATCHES;
        l.first_block = blocks * b / TMC_BATCHES;
        if (end == l.first_block) continue;
        const txm_status status =
            tmc_report(env, from + (to - from) * (double)b / TMC_BATCHES, stage);
        if (status != TXM_OK) return status;
        txm_parallel_for(env, (int)(end - l.first_block), tmc_block, &l);
    }
    return TXM_OK;
}

/* The sum of the weighted normals at each vertex; sum holds 3 zeros for each. */
static void tmc_sum_normals(const txm_mesh *mesh, double *sum) {
    for (size_t t = 0; t < mesh->face_count; t++) {
        txm_dvec3 p[3];
        txm_mesh_triangle(mesh, t, p);
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

TRIMESH_COVER_API txm_status trimesh_normals(const txm_mesh *mesh, txm_env *env, float *normals) {
    txm_arena arena;
    txm_status status = txm_mesh_check(mesh, "mesh", 3, 1, TRIMESH_MAX_VERTICES, env);
    if (status != TXM_OK) return status;
    if (mesh->vertex_count == 0) return TXM_OK;
    if (!normals) return txm_fail(env, TXM_BAD_ARGUMENT, "normals is NULL");
    if (tmc_report(env, 0, "normals") != TXM_OK) return TXM_CANCELLED;
    txm_arena_init(&arena, env);
    double *sum = (double *)txm_arena_zero(&arena, mesh->vertex_count, 3 * sizeof(double));
    if ((status = tmc_check_memory(&arena, env)) == TXM_OK) {
        tmc_sum_normals(mesh, sum);
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

/* ---- which sides share an edge -------------------------------------------------------------- */

/* The sides of a mesh in the order of their edges, allocated in the arena, with as much scratch. */
static txm_status tmc_sort_sides(const txm_mesh *mesh, txm_arena *arena, txm_env *env,
                                 uint32_t **sorted) {
    *sorted = (uint32_t *)txm_arena_alloc(arena, txm_mesh_sides(mesh), 2 * sizeof(uint32_t));
    const txm_status status = tmc_check_memory(arena, env);
    if (status == TXM_OK) txm_mesh_sort_sides(mesh, *sorted);
    return status;
}

/* Link the sides of each edge into a ring, as txm_mesh_link does. */
static txm_status tmc_link(const txm_mesh *mesh, txm_env *env, uint32_t *next) {
    txm_arena scratch;
    uint32_t *sorted;
    txm_arena_init(&scratch, env);
    const txm_status status = tmc_sort_sides(mesh, &scratch, env, &sorted);
    if (status == TXM_OK) txm_mesh_link(mesh, sorted, 0, next);
    txm_arena_free(&scratch);
    return status;
}

#endif /* TRIMESH_COVER_CHECK_H */
