#ifndef TRIMESH_RELAX_SEAMS_H
#define TRIMESH_RELAX_SEAMS_H

#include "mend_all.h"

/* ---- seams ------------------------------------------------------------------------------- */

#define TMR_SAME_CORNER 1e-4 /* ours: of the longest side; nearer vertices are a triangle's own corners */

#define TMR_SHORTEST_SEAM 3 /* ours: in edge lengths; connected seams need as many vertices       */

/* The corners of a triangle of the caller, scaled as the surface is. */
static void tmr_caller_corners(const tmr_surface *s, const trimesh_desc *desc, uint32_t triangle,
                               txm_dvec3 p[3]) {
    for (size_t k = 0; k < 3; k++) {
        const size_t v = desc->surface.indices[3 * (size_t)triangle + k];
        const float *q = desc->surface.positions + 3 * v;
        p[k] = txm_d3_scale(txm_d3_sub(txm_d3(q[0], q[1], q[2]), s->centre), 1 / s->diagonal);
    }
}

/* The entry of desc->seams at corner c of the surface. Where mending has changed a face, its vertices
   are looked for among the corners of the caller's triangle that it came from. Returns 0 if it is
   none of them, as a vertex in the middle of a side of that triangle. */
static int tmr_seam_entry(const tmr_surface *s, const trimesh_desc *desc, int32_t c,
                          uint32_t *entry) {
    const int32_t f = c / 3;
    const int turn = s->turn[f], k = (int)(c % 3);
    const uint32_t *entries = desc->seams + 3 * (size_t)s->origin[f];
    txm_dvec3 p[3];
    double longest = 0;
    int best = 0;
    if (turn < TMR_MAPPED) {
        *entry = entries[turn < 4 ? (k + turn) % 3 : (turn - 4 - k + 3) % 3];
        return 1;
    }
    tmr_caller_corners(s, desc, s->origin[f], p);
    const txm_dvec3 own = s->point[s->vertex[c]];
    for (int i = 0; i < 3; i++) {
        longest = fmax(longest, txm_d3_dist2(p[i], p[(i + 1) % 3]));
        if (txm_d3_dist2(p[i], own) < txm_d3_dist2(p[best], own)) best = i;
    }
    *entry = entries[best];
    return txm_d3_dist2(p[best], own) <= TMR_SAME_CORNER * TMR_SAME_CORNER * longest;
}

/* Do the two triangles at the edge opposite to c have different entries at one of its ends? */
static int tmr_is_seam(const tmr_surface *s, const trimesh_desc *desc, int32_t c) {
    const int32_t o = s->opposite[c];
    const int32_t here[2] = {tmr_next(c), tmr_prev(c)}, there[2] = {tmr_prev(o), tmr_next(o)};
    uint32_t one = 0, two = 0;
    for (int end = 0; end < 2; end++) {
        if (tmr_seam_entry(s, desc, here[end], &one) && tmr_seam_entry(s, desc, there[end], &two) &&
            one != two)
            return 1;
    }
    return 0;
}

/* Mark the seams in s->edge_kind, beside what is there already. */
static void tmr_mark_seams(tmr_surface *s, const trimesh_desc *desc) {
    for (int32_t c = 0; c < 3 * s->face_count && desc->seams; c++) {
        const int32_t o = s->opposite[c];
        if (o < c || !tmr_is_seam(s, desc, c)) continue;
        s->edge_kind[c] |= TMR_SEAM_EDGE;
        s->edge_kind[o] |= TMR_SEAM_EDGE;
    }
}

/* What makes a line: border, seam or crease. A seam that is a crease in part is one line. */
static int tmr_line_class(int edge_kind) {
    return edge_kind & TMR_SEAM_EDGE ? TMR_SEAM_EDGE : edge_kind;
}

#endif /* TRIMESH_RELAX_SEAMS_H */
