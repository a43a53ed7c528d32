#ifndef TRIMESH_RELAX_MEND_DOUBLES_H
#define TRIMESH_RELAX_MEND_DOUBLES_H

#include "surface.h"
#include "mend_thin.h"

/* ---- mending: several edges between two vertices ------------------------------------------ */

/* Where the faces of an edge were paired, or a one-sided surface was cut, both edges may still run
   between the same two vertices. The mesh that changes tells edges by their ends, so such edges get a
   vertex in the middle. (Two border edges of that kind would also be a loop of two.) */

/* Mark the corners of such edges, 1 each in mark. Returns how many corners. */
static size_t tmr_find_doubles(const tmr_mend *m, const tmr_surface *s, uint8_t *mark) {
    txm_mesh mesh;
    size_t count = 0;
    memset(&mesh, 0, sizeof mesh);
    mesh.indices = (const uint32_t *)s->vertex;
    mesh.vertex_count = (size_t)s->vertex_count;
    mesh.face_count = (size_t)s->face_count;
    txm_mesh_sort_sides(&mesh, m->sides);
    memset(mark, 0, 3 * (size_t)s->face_count);
    for (size_t i = 0, end; i < txm_mesh_sides(&mesh); i = end) {
        const int32_t c = tmr_opposite_corner(m, (int32_t)i);
        end = txm_mesh_edge_end(&mesh, m->sides, i);
        if (end - i == 1 || (end - i == 2 && s->opposite[c] >= 0)) continue;
        for (size_t k = i; k < end; k++) mark[tmr_opposite_corner(m, (int32_t)k)] = 1;
        count += end - i;
    }
    return count;
}

/* Split face (p, a, b) of corner c at p into (p, a, v), which stays, and a new one, (p, v, b). Returns
   the corner at p of the new one. */
static int32_t tmr_halve_face(tmr_surface *s, int32_t c, int32_t v, uint8_t *mark) {
    const int32_t f = c / 3, n = 3 * s->face_count++, next = tmr_next(c), prev = tmr_prev(c);
    s->vertex[n] = s->vertex[c];
    s->vertex[n + 1] = v;
    s->vertex[n + 2] = s->vertex[prev];
    s->vertex[prev] = v;
    s->opposite[n + 1] = s->opposite[next]; /* from b to p */
    if (s->opposite[next] >= 0) s->opposite[s->opposite[next]] = n + 1;
    s->opposite[next] = n + 2; /* from p to v */
    s->opposite[n + 2] = next;
    mark[n + 1] = mark[next];
    mark[c] = mark[next] = mark[n] = mark[n + 2] = 0;
    s->origin[n / 3] = s->origin[f];
    s->turn[n / 3] = s->turn[f] = TMR_MAPPED;
    return n;
}

/* Put a vertex into the middle of the edge of corner c. */
static void tmr_halve_edge(tmr_surface *s, int32_t c, uint8_t *mark) {
    const int32_t o = s->opposite[c], v = s->vertex_count++;
    const int32_t a = s->vertex[tmr_next(c)], b = s->vertex[tmr_prev(c)];
    s->point[v] = txm_d3_scale(txm_d3_add(s->point[a], s->point[b]), 0.5);
    if (s->scale) s->scale[v] = txm_float(0.5 * (s->scale[a] + (double)s->scale[b]));
    const int32_t c2 = tmr_halve_face(s, c, v, mark); /* c: a to v, c2: v to b */
    s->opposite[c] = s->opposite[c2] = -1;
    if (o < 0) return;
    const int32_t o2 = tmr_halve_face(s, o, v, mark); /* o: b to v, o2: v to a */
    s->opposite[c] = o2;
    s->opposite[o2] = c;
    s->opposite[c2] = o;
    s->opposite[o] = c2;
}

/* Copies of the arrays of the surface with room for more faces and vertices. */
static txm_status tmr_surface_grow(tmr_surface *s, size_t faces, size_t vertices,
                                   txm_arena *arena) {
    const tmr_surface old = *s;
    const size_t f = (size_t)s->face_count, v = (size_t)s->vertex_count;
    s->vertex = (int32_t *)txm_arena_alloc(arena, 3 * (f + faces), sizeof(int32_t));
    s->opposite = (int32_t *)txm_arena_alloc(arena, 3 * (f + faces), sizeof(int32_t));
    s->origin = (uint32_t *)txm_arena_alloc(arena, f + faces, sizeof(uint32_t));
    s->turn = (uint8_t *)txm_arena_alloc(arena, f + faces, 1);
    s->edge_kind = (uint8_t *)txm_arena_zero(arena, 3 * (f + faces), 1);
    s->point = (txm_dvec3 *)txm_arena_alloc(arena, v + vertices, sizeof(txm_dvec3));
    s->corner = (int32_t *)txm_arena_alloc(arena, v + vertices, sizeof(int32_t));
    if (s->scale) s->scale = (float *)txm_arena_alloc(arena, v + vertices, sizeof(float));
    if (arena->failed) return TXM_OUT_OF_MEMORY;
    memcpy(s->vertex, old.vertex, 3 * f * sizeof *s->vertex);
    memcpy(s->opposite, old.opposite, 3 * f * sizeof *s->opposite);
    memcpy(s->origin, old.origin, f * sizeof *s->origin);
    memcpy(s->turn, old.turn, f);
    memcpy(s->point, old.point, v * sizeof *s->point);
    if (s->scale) memcpy(s->scale, old.scale, v * sizeof *s->scale);
    return TXM_OK;
}

/* One corner of each vertex, and the kinds of edges, as tmr_surface has them. */
static void tmr_surface_corners(tmr_surface *s) {
    for (int32_t v = 0; v < s->vertex_count; v++) s->corner[v] = -1;
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        s->edge_kind[c] = (uint8_t)(s->opposite[c] < 0 ? TMR_BORDER_EDGE : TMR_PLAIN_EDGE);
        if (s->corner[s->vertex[c]] < 0 || tmr_cw(s->opposite, c) < 0)
            s->corner[s->vertex[c]] = c;
    }
}

/* Split the edges of which there are several between two vertices of the numbered surface. */
static txm_status tmr_split_doubles(tmr_mend *m, txm_arena *arena, tmr_surface *s) {
    static const char no_memory[] = "no memory for the surface";
    uint8_t *mark = (uint8_t *)txm_arena_alloc(m->scratch, 3 * (size_t)s->face_count, 1);
    if (!mark) return txm_fail(m->env, TXM_OUT_OF_MEMORY, no_memory);
    /* each corner that is marked gets a face more, and each edge, which has one or two, a vertex */
    const size_t more = tmr_find_doubles(m, s, mark), f = (size_t)s->face_count;
    if (more == 0) return TXM_OK;
    if (f + more > TMR_MOST_SLOTS || (size_t)s->vertex_count + more > TMR_MOST_SLOTS)
        return txm_fail(m->env, TXM_TOO_LARGE, "the surface has too many edges of several faces");
    uint8_t *marks = (uint8_t *)txm_arena_zero(m->scratch, 3 * (f + more), 1);
    if (!marks || tmr_surface_grow(s, more, more, arena) != TXM_OK)
        return txm_fail(m->env, TXM_OUT_OF_MEMORY, no_memory);
    memcpy(marks, mark, 3 * f);
    for (int32_t c = 0; c < 3 * s->face_count; c++)
        if (marks[c]) tmr_halve_edge(s, c, marks);
    TRIMESH_ASSERT((size_t)s->face_count == f + more);
    tmr_surface_corners(s);
    m->report.vertices = (size_t)s->vertex_count;
    m->report.triangles = (size_t)s->face_count;
    return TXM_OK;
}

#endif /* TRIMESH_RELAX_MEND_DOUBLES_H */
