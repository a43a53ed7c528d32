#ifndef TRIMESH_RELAX_DENSITY_H
#define TRIMESH_RELAX_DENSITY_H

#include "surface.h"

/* ---- density ------------------------------------------------------------------------------ */

enum { TMR_GRADE_SWEEPS = 12 };   /* ours: for the limit on how fast the edge length may change   */
#define TMR_TURN_PER_EDGE 0.6     /* ours: radians that one edge may turn where density adapts    */
#define TMR_LEAST_SIZE 0.2        /* ours: the shortest edges where it adapts fully               */

/* The edge length, where the scale is 1, of a mesh of so many vertices: a triangle of edge L has
   the area sqrt(3) / 4 L^2, and there are two triangles per vertex. */
static double tmr_spacing(const tmr_surface *s, double vertices) {
    double sum = 0;
    for (int32_t f = 0; f < s->face_count && s->scale; f++) {
        const int32_t *v = s->vertex + 3 * f;
        const double scale = (s->scale[v[0]] + (double)s->scale[v[1]] + s->scale[v[2]]) / 3;
        const txm_dvec3 n = txm_d3_area2(s->point[v[0]], s->point[v[1]], s->point[v[2]]);
        sum += 0.5 * txm_d3_len(n) / (scale * scale);
    }
    return sqrt((s->scale ? sum : s->area) / vertices * 1.1547005383792515);
}

/* Normalize the scale: the same number of vertices shall give the same spacing where it is 1 as
   without a scale. */
static void tmr_normalize_scale(tmr_surface *s) {
    if (!s->scale) return;
    const double factor = tmr_spacing(s, 1) / sqrt(s->area * 1.1547005383792515);
    for (int32_t v = 0; v < s->vertex_count; v++) s->scale[v] = txm_float(s->scale[v] * factor);
}

/* Curvature at every vertex: the largest change of the normal per unit of length along an edge. */
static void tmr_curvature(const tmr_surface *s, float *curvature) {
    for (int32_t v = 0; v < s->vertex_count; v++) curvature[v] = 0;
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        const int32_t a = s->vertex[tmr_next(c)], b = s->vertex[tmr_prev(c)];
        const double length = txm_d3_dist(s->point[a], s->point[b]);
        if (length <= 0) continue;
        const float k = txm_float(txm_d3_dist(s->vertex_normal[a], s->vertex_normal[b]) / length);
        curvature[a] = txm_maxf(curvature[a], k);
        curvature[b] = txm_maxf(curvature[b], k);
    }
}

/* Shorten the wanted edge lengths until they grow by no more than d / 3 over a distance d. */
static void tmr_grade_scale(const tmr_surface *s, double spacing, float *scale) {
    for (int sweep = 0; sweep < TMR_GRADE_SWEEPS; sweep++) {
        for (int32_t i = 0; i < 3 * s->face_count; i++) {
            const int32_t c = sweep % 2 ? 3 * s->face_count - 1 - i : i;
            const int32_t a = s->vertex[tmr_next(c)], b = s->vertex[tmr_prev(c)];
            const double d = txm_d3_dist(s->point[a], s->point[b]) / spacing / 3;
            scale[a] = txm_minf(scale[a], txm_float(scale[b] + d));
            scale[b] = txm_minf(scale[b], txm_float(scale[a] + d));
        }
    }
}

/* Shorten the wanted edge lengths where the surface bends, fully or in part (adapt), so that an
   edge turns by no more than TMR_TURN_PER_EDGE. */
static txm_status tmr_adapt_scale(tmr_surface *s, double spacing, double adapt, txm_arena *arena,
                                  txm_arena *scratch) {
    const size_t n = (size_t)s->vertex_count;
    float *curvature = (float *)txm_arena_alloc(scratch, n, sizeof(float));
    float *scale = (float *)txm_arena_alloc(arena, n, sizeof(float));
    if (!curvature || !scale) return TXM_OUT_OF_MEMORY;
    tmr_curvature(s, curvature);
    for (size_t v = 0; v < n; v++) {
        const double wanted = curvature[v] > 0 ? TMR_TURN_PER_EDGE / curvature[v] / spacing : 1;
        const double limited = wanted < TMR_LEAST_SIZE ? TMR_LEAST_SIZE : wanted > 1 ? 1 : wanted;
        scale[v] = txm_float((s->scale ? s->scale[v] : 1) * (1 - adapt + adapt * limited));
    }
    tmr_grade_scale(s, spacing, scale);
    s->scale = scale;
    return TXM_OK;
}

#endif /* TRIMESH_RELAX_DENSITY_H */
