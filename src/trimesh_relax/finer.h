#ifndef TRIMESH_RELAX_FINER_H
#define TRIMESH_RELAX_FINER_H

#include "density.h"
#include "validity.h"

/* ---- shorter edges where triangles cross ---------------------------------------------------- */

/* Where two sheets lie closer to each other than triangles stand off a bent surface, these cross. Another
   attempt wants shorter edges there, and only there: a chord of half the length stands off a quarter as
   far. */
enum { TMR_FINER_REACH = 2 }; /* ours: so many rings around the spots */

/* Mark the vertices of triangles that cross or are inverted, and their surroundings, in w->bad. */
static txm_status tmr_mark_spots(tmr_work *w) {
    long crossings, doubtful;
    txm_arena scratch;
    memset(w->bad, 0, (size_t)w->m.vertex_count);
    txm_arena_init(&scratch, w->env);
    const txm_status status = tmr_count_crossings(w, NULL, TMR_COUNT_CROSSING, &scratch, &crossings);
    txm_arena_free(&scratch);
    if (status != TXM_OK) return status;
    tmr_count_inverted(w, &doubtful);
    for (int ring = 0; ring < TMR_FINER_REACH; ring++) tmr_grow_marks(w);
    return TXM_OK;
}

/* Halve the wanted edge lengths where the mesh is not sound. */
static txm_status tmr_halve_at_spots(tmr_work *w, tmr_surface *s, txm_arena *arena) {
    const size_t n = (size_t)s->vertex_count;
    float *scale = (float *)txm_arena_alloc(arena, n, sizeof(float));
    if (!scale) return TXM_OUT_OF_MEMORY;
    const txm_status status = tmr_mark_spots(w);
    if (status != TXM_OK) return status;
    for (size_t v = 0; v < n; v++) scale[v] = s->scale ? s->scale[v] : 1;
    for (int32_t v = 0; v < w->m.vertex_count; v++) {
        if (!w->bad[v] || w->m.corner[v] < 0 || tmr_is_ghost(&w->m, v)) continue;
        const int32_t *k = s->vertex + 3 * tmr_face_of(w, v);
        for (int i = 0; i < 3; i++) scale[k[i]] = txm_float(0.5 * (s->scale ? s->scale[k[i]] : 1));
    }
    tmr_grade_scale(s, w->length, scale);
    s->scale = scale;
    return TXM_OK;
}

#endif /* TRIMESH_RELAX_FINER_H */
