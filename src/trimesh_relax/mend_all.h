#ifndef TRIMESH_RELAX_MEND_ALL_H
#define TRIMESH_RELAX_MEND_ALL_H

#include "mend_gaps.h"
#include "mend_doubles.h"

/* ---- the surface: normals and topology ---------------------------------------------------- */

/* Normals of faces without area: the mean of their neighbours', from the rim of such a region
   inwards. */
static void tmr_fill_normals(tmr_surface *s, const int32_t *thin, int32_t count) {
    int left = count > 0;
    for (int round = 0; left && round < TMR_FLIP_SWEEPS; round++) {
        left = 0;
        for (int32_t i = 0; i < count; i++) {
            const int32_t f = thin[i];
            txm_dvec3 sum = txm_d3(0, 0, 0);
            if (txm_d3_len2(s->normal[f]) > 0) continue;
            for (int32_t c = 3 * f; c < 3 * f + 3; c++) {
                if (s->opposite[c] >= 0) sum = txm_d3_add(sum, s->normal[s->opposite[c] / 3]);
            }
            s->normal[f] = txm_d3_unit(sum);
            left |= !(txm_d3_len2(sum) > 0);
        }
    }
    for (int32_t i = 0; i < count; i++) { /* no face nearby has a normal: use its own, or any */
        const int32_t *v = s->vertex + 3 * thin[i];
        txm_dvec3 *n = s->normal + thin[i];
        if (txm_d3_len2(*n) > 0) continue;
        *n = txm_d3_unit(txm_d3_area2(s->point[v[0]], s->point[v[1]], s->point[v[2]]));
        if (!(txm_d3_len2(*n) > 0)) *n = txm_d3(0, 0, 1);
    }
}

/* Normals of faces; *count faces of no area are listed in thin. */
static void tmr_face_normals(const tmr_mend *m, tmr_surface *s, int32_t *thin, int32_t *count) {
    s->area = s->volume = 0;
    *count = 0;
    for (int32_t f = 0; f < s->face_count; f++) {
        txm_dvec3 p[3];
        for (int k = 0; k < 3; k++) p[k] = s->point[s->vertex[3 * f + k]];
        const txm_dvec3 n = txm_d3_area2(p[0], p[1], p[2]);
        s->area += 0.5 * txm_d3_len(n);
        s->volume += txm_d3_dot(p[0], n) / 6;
        s->normal[f] = txm_d3_unit(n);
        if (tmr_is_thin(m, p)) {
            s->normal[f] = txm_d3(0, 0, 0);
            TRIMESH_ASSERT(*count < s->face_count);
            thin[(*count)++] = f;
        }
    }
}

/* Vertex normals: the sum over the corners of angle times normal. */
static void tmr_vertex_normals(tmr_surface *s) {
    memset(s->vertex_normal, 0, (size_t)s->vertex_count * sizeof *s->vertex_normal);
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        const txm_dvec3 p = s->point[s->vertex[c]];
        const txm_dvec3 a = txm_d3_sub(s->point[s->vertex[tmr_next(c)]], p);
        const txm_dvec3 b = txm_d3_sub(s->point[s->vertex[tmr_prev(c)]], p);
        const double angle = txm_atan2(txm_d3_len(txm_d3_cross(a, b)), txm_d3_dot(a, b));
        txm_dvec3 *n = s->vertex_normal + s->vertex[c];
        *n = txm_d3_mad(*n, s->normal[c / 3], angle);
    }
    for (int32_t i = 0; i < s->vertex_count; i++) {
        txm_dvec3 *n = s->vertex_normal + i;
        *n = txm_d3_unit(*n);
        if (!(txm_d3_len2(*n) > 0)) *n = s->normal[s->corner[i] / 3];
    }
}

/* Number the connected pieces by their first face. queue: scratch, 1 per face. */
static void tmr_find_components(tmr_surface *s, int32_t *queue) {
    s->component_count = 0;
    for (int32_t f = 0; f < s->face_count; f++) s->component[f] = -1;
    for (int32_t f = 0; f < s->face_count; f++) {
        int32_t count = 0;
        if (s->component[f] >= 0) continue;
        s->component[f] = s->component_count;
        queue[count++] = f;
        for (int32_t i = 0; i < count; i++) {
            for (int32_t c = 3 * queue[i]; c < 3 * queue[i] + 3; c++) {
                const int32_t g = s->opposite[c] / 3;
                if (s->opposite[c] < 0 || s->component[g] >= 0) continue;
                s->component[g] = s->component_count;
                TRIMESH_ASSERT(count < s->face_count);
                queue[count++] = g;
            }
        }
        s->component_count++;
    }
}

/* The border edge that follows the one of corner c, with the surface on the left. */
static int32_t tmr_next_border(const tmr_surface *s, int32_t c) {
    int32_t k = tmr_next(c);
    while (s->opposite[k] >= 0) k = tmr_next(s->opposite[k]);
    return k;
}

/* Count border loops and edges; fill in components, loops and Euler characteristic. */
static void tmr_count_loops(tmr_surface *s, trimesh_report *report, uint8_t *seen) {
    int32_t loops = 0, border = 0;
    memset(seen, 0, 3 * (size_t)s->face_count);
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        if (s->opposite[c] >= 0) continue;
        border++;
        if (seen[c]) continue;
        for (int32_t k = c; !seen[k]; k = tmr_next_border(s, k)) seen[k] = 1;
        loops++;
    }
    s->loop_count = loops;
    s->border_count = border;
    report->loops = (size_t)loops;
    report->components = (size_t)s->component_count;
    report->euler = (long)s->vertex_count + s->face_count - (3 * (long)s->face_count + border) / 2;
}

/* Normals, components, loops, area; temporary memory of its own. */
static txm_status tmr_surface_measure(tmr_mend *m, txm_arena *arena, txm_arena *scratch,
                                      tmr_surface *s) {
    const size_t f = (size_t)s->face_count, v = (size_t)s->vertex_count;
    int32_t count = 0;
    s->normal = (txm_dvec3 *)txm_arena_alloc(arena, f, sizeof(txm_dvec3));
    s->vertex_normal = (txm_dvec3 *)txm_arena_alloc(arena, v, sizeof(txm_dvec3));
    s->component = (int32_t *)txm_arena_alloc(arena, f, sizeof(int32_t));
    int32_t *list = (int32_t *)txm_arena_alloc(scratch, f, sizeof(int32_t));
    if (arena->failed || scratch->failed)
        return txm_fail(m->env, TXM_OUT_OF_MEMORY, "no memory for the surface");
    tmr_face_normals(m, s, list, &count);
    if (count == s->face_count || !(s->area > 0))
        return txm_fail(m->env, TXM_TOO_SMALL, "the surface has no area");
    tmr_fill_normals(s, list, count);
    tmr_vertex_normals(s);
    tmr_find_components(s, list);
    tmr_count_loops(s, &m->report, (uint8_t *)list);
    return TXM_OK;
}

/* ---- the input, mended: the whole --------------------------------------------------------- */

static txm_status tmr_mend_all(tmr_mend *m, txm_arena *arena, txm_arena *places,
                               txm_arena *scratch, tmr_surface *s) {
    txm_status status = tmr_check_surface(m->desc, m->env);
    if (status != TXM_OK) return status;
    m->vertex_count = (int32_t)m->desc->surface.vertex_count;
    m->face_count = (int32_t)m->desc->surface.face_count;
    m->arena = arena;
    m->scratch = scratch;
    m->point = (txm_dvec3 *)txm_arena_alloc(places, (size_t)m->vertex_count, sizeof(txm_dvec3));
    if (!m->point) return txm_fail(m->env, TXM_OUT_OF_MEMORY, "no memory to mend the surface");
    if ((status = tmr_mend_alloc(m)) != TXM_OK) return status;
    if ((status = tmr_mend_cancel(m, 0)) != TXM_OK) return status;
    if ((status = tmr_mend_scale(m)) != TXM_OK) return status;
    if (m->desc->weld >= 0) tmr_weld(m, m->desc->weld, NULL);
    if ((status = tmr_mend_cancel(m, 0.01f)) != TXM_OK) return status;
    tmr_mend_load(m);
    if ((status = tmr_mend_gaps(m)) != TXM_OK) return status;
    if ((status = tmr_mend_faces(m)) != TXM_OK) return status;
    if ((status = tmr_mend_thin(m)) != TXM_OK) return status;
    if ((status = tmr_mend_cancel(m, 0.03f)) != TXM_OK) return status;
    if ((status = tmr_mend_finish(m, arena, s)) != TXM_OK) return status;
    if ((status = tmr_split_doubles(m, arena, s)) != TXM_OK) return status;
    txm_arena_free(scratch);
    txm_arena_free(places);
    if ((status = tmr_mend_cancel(m, 0.04f)) != TXM_OK) return status;
    return tmr_surface_measure(m, arena, scratch, s);
}

/* Check, weld and mend the caller's surface.

   arena   receives what the surface keeps, also part of it after an error: free it then
   report  NULL, or receives what was found, also after an error
   return  TXM_OK; TXM_BAD_ARGUMENT; TXM_TOO_SMALL without area or faces;
           TXM_TOO_LARGE; TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost    O(n) time; about 130 bytes per triangle of a closed mesh, 85 of them kept         */
static txm_status tmr_surface_build(const trimesh_desc *desc, txm_env *env, txm_arena *arena,
                                    trimesh_report *report, tmr_surface *s) {
    txm_arena places, scratch;
    tmr_mend m;
    memset(&m, 0, sizeof m);
    memset(s, 0, sizeof *s);
    m.desc = desc;
    m.env = env;
    txm_arena_init(&places, env);
    txm_arena_init(&scratch, env);
    const txm_status status = tmr_mend_all(&m, arena, &places, &scratch, s);
    txm_arena_free(&scratch);
    txm_arena_free(&places);
    if (report) *report = m.report;
    return status;
}

#endif /* TRIMESH_RELAX_MEND_ALL_H */
