#ifndef TEXINPAINT_WELD_H
#define TEXINPAINT_WELD_H

#include "config.h"

/* ---- a mesh without duplicates ---------------------------------------------------------------
   Meshes with texture coordinates often repeat a vertex for each chart that it lies in. Geometry is
   computed on a mesh in which vertices in equal places are one.                                */

typedef struct txi_welded {
    uint32_t *vertex; /* 1 per vertex of the input: the first vertex in the same place          */
    txm_mesh mesh;    /* the positions of the input, faces of welded vertices                   */
    uint32_t *face;   /* 1 per face of mesh: its number in the input                            */
} txi_welded;

/* For each vertex the lowest one in the same place (-0 is 0). pairs: room for 2 per vertex. */
static void txi_weld_vertices(const txm_mesh *input, txm_pair *pairs, uint32_t *first) {
    const size_t n = input->vertex_count;
    for (size_t i = 0; i < n; i++) pairs[i].value = (uint32_t)i;
    for (size_t axis = 3; axis-- > 0;) {
        for (size_t i = 0; i < n; i++) /* + 0: -0 becomes 0 */
            pairs[i].key = txm_sort_key(input->positions[3 * (size_t)pairs[i].value + axis] + 0.0f);
        txm_sort_pairs(pairs, pairs + n, n); /* stable: equal places stay in order of number */
    }
    for (size_t i = 0; i < n; i++) {
        const size_t v = pairs[i].value, before = i ? pairs[i - 1].value : v;
        const float *p = input->positions + 3 * v, *q = input->positions + 3 * before;
        int equal = i > 0;
        for (int k = 0; k < 3; k++) equal &= p[k] >= q[k] && p[k] <= q[k];
        first[v] = equal ? first[before] : (uint32_t)v;
    }
}

/* Weld a checked mesh of triangles; faces of which two corners are in one place are left out.
   return  TXM_OK, TXM_TOO_LARGE or TXM_OUT_OF_MEMORY
   cost    O(vertices + faces)                                                              */
static txm_status txi_welded_make(const txm_mesh *input, txm_arena *arena, txm_env *env,
                                txi_welded *weld) {
    const size_t n = input->vertex_count;
    size_t count = 0;
    txm_arena scratch;
    txm_arena_init(&scratch, env);
    memset(weld, 0, sizeof *weld);
    weld->mesh = *input;
    weld->mesh.face_count = 0;
    if (input->face_count == 0) return TXM_OK;
    if (n > UINT32_MAX) return txm_fail(env, TXM_TOO_LARGE, "mesh: more than 2^32 - 1 vertices");
    uint32_t *indices = (uint32_t *)txm_arena_alloc(arena, input->face_count, 3 * sizeof(uint32_t));
    weld->face = (uint32_t *)txm_arena_alloc(arena, input->face_count, sizeof(uint32_t));
    weld->vertex = (uint32_t *)txm_arena_alloc(arena, n, sizeof(uint32_t));
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(&scratch, n, 2 * sizeof(txm_pair));
    if (arena->failed || !pairs) {
        txm_arena_free(&scratch);
        return txi_no_memory(env);
    }
    txi_weld_vertices(input, pairs, weld->vertex);
    txm_arena_free(&scratch);
    for (size_t f = 0; f < input->face_count; f++) {
        uint32_t *t = indices + 3 * count;
        for (size_t k = 0; k < 3; k++) t[k] = weld->vertex[input->indices[3 * f + k]];
        if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) continue;
        weld->face[count++] = (uint32_t)f;
    }
    weld->mesh.indices = indices;
    weld->mesh.face_count = count;
    return TXM_OK;
}

#endif /* TEXINPAINT_WELD_H */
