#ifndef TRIMESH_RELAX_RELAX_H
#define TRIMESH_RELAX_RELAX_H

#include "work.h"

/* ---- flips -------------------------------------------------------------------------------- */

/* 2 inradius / circumradius, 1 for an equilateral triangle; negative if it disagrees with n */
static double tmr_quality(txm_dvec3 a, txm_dvec3 b, txm_dvec3 c, txm_dvec3 n) {
    const txm_dvec3 cross = txm_d3_area2(a, b, c);
    const double x = txm_d3_dist(b, c), y = txm_d3_dist(c, a), z = txm_d3_dist(a, b);
    const double bottom = (x + y + z) * x * y * z;
    const double area2 = txm_d3_len(cross);
    const double q = bottom > 0 ? 4 * area2 * area2 / bottom : 0; /* 8 A^2 / (s a b c) */
    return txm_d3_dot(cross, n) < TMR_LEAST_AGREEMENT * area2 ? -1 : q;
}

/* neighbours that a vertex should have, including ghosts */
static int tmr_ideal_valence(const tmr_mesh *m, int32_t v) {
    return tmr_kind_of(m, v) == TRIMESH_BORDER ? 5 : 6;
}
/* what it costs to have others: their square, of up to millions */
static int64_t tmr_valence_cost(const tmr_mesh *m, int32_t v, int change) {
    if (tmr_kind_of(m, v) == TRIMESH_CORNER) return 0;
    const int64_t d = (int64_t)m->valence[v] + change - tmr_ideal_valence(m, v);
    return d * d;
}

/* by how much flipping the edge opposite to c would lower the cost of valences */
static int64_t tmr_flip_gain(const tmr_mesh *m, int32_t c) {
    const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
    const int32_t d = m->vertex[c], e = m->vertex[m->opposite[c]];
    return tmr_valence_cost(m, a, 0) + tmr_valence_cost(m, b, 0) + tmr_valence_cost(m, d, 0) +
           tmr_valence_cost(m, e, 0) - tmr_valence_cost(m, a, -1) - tmr_valence_cost(m, b, -1) -
           tmr_valence_cost(m, d, 1) - tmr_valence_cost(m, e, 1);
}

typedef struct tmr_quad {
    int32_t a, b, d, e;        /* as in tmr_flip */
    double before, after;      /* the lower quality of the two triangles */
} tmr_quad;

/* What would flipping the edge opposite to c do? Returns 0 if it cannot be flipped. */
static int tmr_measure_flip(const tmr_work *w, int32_t c, tmr_quad *q) {
    const tmr_mesh *m = &w->m;
    if (!tmr_can_flip(m, c)) return 0;
    const int32_t o = m->opposite[c];
    q->a = m->vertex[tmr_next(c)];
    q->b = m->vertex[tmr_prev(c)];
    q->d = m->vertex[c];
    q->e = m->vertex[o];
    const txm_dvec3 a = m->p[q->a], b = m->p[q->b], d = m->p[q->d], e = m->p[q->e];
    q->before = fmin(tmr_quality(d, a, b, tmr_expected_normal(w, q->d, q->a, q->b)),
                     tmr_quality(e, b, a, tmr_expected_normal(w, q->e, q->b, q->a)));
    q->after = fmin(tmr_quality(d, a, e, tmr_expected_normal(w, q->d, q->a, q->e)),
                    tmr_quality(e, b, d, tmr_expected_normal(w, q->e, q->b, q->d)));
    return 1;
}

/* Is the sum of the two angles opposite to the edge of c over pi? (Delaunay) */
static int tmr_is_wide(const tmr_mesh *m, int32_t c) {
    const txm_dvec3 a = m->p[m->vertex[tmr_next(c)]], b = m->p[m->vertex[tmr_prev(c)]];
    const txm_dvec3 d = m->p[m->vertex[c]], e = m->p[m->vertex[m->opposite[c]]];
    const txm_dvec3 da = txm_d3_sub(a, d), db = txm_d3_sub(b, d), ea = txm_d3_sub(a, e),
                    eb = txm_d3_sub(b, e);
    const double cd = txm_d3_dot(da, db), ce = txm_d3_dot(ea, eb);
    if (cd >= 0 && ce >= 0) return 0;
    const double sd = txm_d3_len(txm_d3_cross(da, db)), se = txm_d3_len(txm_d3_cross(ea, eb));
    /* sin(d + e) < 0, with a margin so that equal diagonals stay */
    return sd * ce + se * cd <
           -1e-6 * sqrt(txm_d3_len2(da) * txm_d3_len2(db) * txm_d3_len2(ea) * txm_d3_len2(eb));
}

/* Which corners' edges are wide? Bits 0 to 2 of w->flag, one byte per triangle. */
static void tmr_wide_chunk(void *context, int index) {
    tmr_work *w = (tmr_work *)context;
    const tmr_mesh *m = &w->m;
    const int32_t from = index * TMR_CHUNK;
    const int32_t to = from + TMR_CHUNK < m->face_count ? from + TMR_CHUNK : m->face_count;
    for (int32_t f = from; f < to; f++) {
        w->flag[f] = 0;
        for (int32_t c = 3 * f; c < 3 * f + 3; c++) {
            if (m->vertex[c] < 0 || m->opposite[c] < c || m->edge[c] || !tmr_is_wide(m, c)) continue;
            w->flag[f] |= (uint8_t)(1 << (c - 3 * f));
        }
    }
}

/* Flip edges until the mesh is Delaunay, as far as the normals allow. */
static void tmr_flip_delaunay(tmr_work *w, int rounds) {
    tmr_mesh *m = &w->m;
    tmr_quad q;
    for (int round = 0; round < rounds; round++) {
        int32_t turned = 0;
        txm_parallel_for(w->env, (m->face_count + TMR_CHUNK - 1) / TMR_CHUNK, tmr_wide_chunk, w);
        for (int32_t f = 0; f < m->face_count; f++) {
            for (int32_t c = 3 * f; w->flag[f] && c < 3 * f + 3; c++) {
                if (!((w->flag[f] >> (c - 3 * f)) & 1) || m->edge[c]) continue;
                if (!tmr_is_wide(m, c) || !tmr_measure_flip(w, c, &q)) continue;
                if (q.after <= 0 && q.after <= q.before) continue;
                tmr_flip(m, c);
                turned++;
            }
        }
        if (turned == 0) break;
    }
}

/* Flip edges where that brings valences nearer to 6 and the triangles stay fair. */
static void tmr_flip_valences(tmr_work *w, int rounds, double least) {
    tmr_mesh *m = &w->m;
    tmr_quad q;
    for (int round = 0; round < rounds; round++) {
        int32_t turned = 0;
        for (int32_t c = 0; c < 3 * m->face_count; c++) {
            if (m->vertex[c] < 0 || m->opposite[c] < c || m->edge[c]) continue;
            if (tmr_flip_gain(m, c) <= 0 || !tmr_measure_flip(w, c, &q)) continue;
            if (q.after < least && q.after <= q.before) continue;
            tmr_flip(m, c);
            turned++;
        }
        if (turned == 0) break;
    }
}

/* ---- relaxation --------------------------------------------------------------------------- */

/* The target of a triangle: the equilateral triangle that fits it best, around its *centre,
   perpendicular to the normal *n expected there, part of the way to the wanted size. Its corner 0 is
   at centre + pull, which is returned, the others are rotated by 120 degrees. The fit is the mean of
   the three corners rotated back onto the first:
       pull = (A + R^-1 B + R^-2 C) / 3 = A / 2 + sqrt(3) / 6 n x (C - B)                        */
static txm_dvec3 tmr_fit(const tmr_work *w, const int32_t *v, txm_dvec3 *centre, txm_dvec3 *n) {
    const tmr_mesh *m = &w->m;
    const txm_dvec3 a = m->p[v[0]], b = m->p[v[1]], c = m->p[v[2]];
    *centre = txm_d3_scale(txm_d3_add(txm_d3_add(a, b), c), 1.0 / 3);
    *n = tmr_expected_normal(w, v[0], v[1], v[2]);
    txm_dvec3 arm = txm_d3_sub(a, *centre);
    arm = txm_d3_mad(arm, *n, -txm_d3_dot(arm, *n));
    txm_dvec3 pull =
        txm_d3_add(txm_d3_scale(arm, 0.5),
                   txm_d3_scale(txm_d3_cross(*n, txm_d3_sub(c, b)), 0.28867513459481287));
    const double size = w->length * (w->size[v[0]] + (double)w->size[v[1]] + w->size[v[2]]) / 3;
    const double radius = size * 0.57735026918962576, length = txm_d3_len(pull);
    if (length < 0.1 * radius) { /* inverted or flat: start from its first corner    */
        const double arm_length = txm_d3_len(arm);
        return arm_length > 0 ? txm_d3_scale(arm, radius / arm_length) : pull;
    }
    return txm_d3_scale(pull, ((1 - w->pull) * length + w->pull * radius) / length);
}

/* the two neighbours of a vertex on its line; returns 0 if there are not exactly two */
static int tmr_line_neighbors(const tmr_mesh *m, int32_t v, int32_t two[2]) {
    int count = 0;
    int32_t c = m->corner[v];
    const int32_t first = c;
    do { /* the edge from v to next(c) is opposite to prev(c) */
        if (m->edge[tmr_prev(c)]) {
            if (count < 2) two[count] = m->vertex[tmr_next(c)];
            count++;
        }
        c = tmr_swing(m, c);
    } while (c != first);
    return count == 2;
}

/* Where relaxation puts the free vertex v: the mean of the targets of its triangles, on the surface.
   Returns 0 if it has no triangles. */
static int tmr_relaxed_place(const tmr_work *w, int32_t v, tmr_place *at) {
    const tmr_mesh *m = &w->m;
    txm_dvec3 sum = txm_d3(0, 0, 0);
    int count = 0;
    int32_t c = m->corner[v];
    const int32_t first = c;
    do {
        const int32_t corners[3] = {v, m->vertex[tmr_next(c)], m->vertex[tmr_prev(c)]};
        if (!tmr_is_ghost(m, corners[1]) && !tmr_is_ghost(m, corners[2])) {
            txm_dvec3 centre, n;
            const txm_dvec3 pull = tmr_fit(w, corners, &centre, &n);
            sum = txm_d3_add(sum, txm_d3_add(centre, pull));
            count++;
        }
        c = tmr_swing(m, c);
    } while (c != first);
    if (count == 0) return 0;
    const txm_dvec3 to =
        txm_d3_mad(m->p[v], txm_d3_sub(txm_d3_scale(sum, 1.0 / count), m->p[v]), w->step);
    *at = tmr_project(w->s, to, m->source[v]);
    return 1;
}

/* Find the new place of vertex v; store it in w->moved and w->landed. */
static void tmr_relax_vertex(tmr_work *w, int32_t v) {
    const tmr_mesh *m = &w->m;
    const int kind = tmr_kind_of(m, v);
    tmr_place at;
    tmr_keep_place(w, v);
    if (w->mask && !w->mask[v]) return;
    if (m->corner[v] < 0 || kind == TRIMESH_CORNER || (m->flags[v] & (TMR_GHOST | TMR_PINNED)))
        return;
    if (kind != TRIMESH_FREE) {
        int32_t two[2];
        if (!tmr_line_neighbors(m, v, two)) return;
        const double a = 1 / (double)w->size[two[0]], b = 1 / (double)w->size[two[1]];
        const txm_dvec3 p = txm_d3_scale(
            txm_d3_add(txm_d3_scale(m->p[two[0]], a), txm_d3_scale(m->p[two[1]], b)), 1 / (a + b));
        w->moved[v] =
            tmr_project_line(w->s, w->l, txm_d3_scale(txm_d3_add(m->p[v], p), 0.5), &w->landed[v]);
    } else if (tmr_relaxed_place(w, v, &at)) {
        w->moved[v] = at.p;
        w->landed[v] = at.face;
    }
}

static void tmr_relax_chunk(void *context, int index) {
    tmr_work *w = (tmr_work *)context;
    const int32_t from = index * TMR_CHUNK;
    const int32_t to = from + TMR_CHUNK < w->m.vertex_count ? from + TMR_CHUNK : w->m.vertex_count;
    for (int32_t v = from; v < to; v++) tmr_relax_vertex(w, v);
}

static int tmr_has_moved(const tmr_work *w, int32_t v) {
    const txm_dvec3 a = w->moved[v], b = w->m.p[v];
    return a.x < b.x || a.x > b.x || a.y < b.y || a.y > b.y || a.z < b.z || a.z > b.z;
}

/* Would the triangle be worse than allowed after its corners have moved? */
static int tmr_is_spoilt(const tmr_work *w, int32_t face) {
    const tmr_mesh *m = &w->m;
    const int32_t *v = m->vertex + 3 * face;
    if (v[0] < 0 || tmr_is_ghost_face(m, face)) return 0;
    if (!tmr_has_moved(w, v[0]) && !tmr_has_moved(w, v[1]) && !tmr_has_moved(w, v[2])) return 0;
    const double after =
        tmr_agreement(w, v[0], v[1], v[2], w->moved[v[0]], w->moved[v[1]], w->moved[v[2]]);
    if (after >= TMR_LEAST_AGREEMENT) return 0;
    return after < tmr_agreement(w, v[0], v[1], v[2], m->p[v[0]], m->p[v[1]], m->p[v[2]]);
}

static void tmr_spoilt_chunk(void *context, int index) {
    tmr_work *w = (tmr_work *)context;
    const int32_t from = index * TMR_CHUNK;
    const int32_t to = from + TMR_CHUNK < w->m.face_count ? from + TMR_CHUNK : w->m.face_count;
    for (int32_t f = from; f < to; f++) w->flag[f] = (uint8_t)tmr_is_spoilt(w, f);
}

/* Mark the vertices of all spoilt triangles in w->bad. Returns how many such triangles there are. */
static int32_t tmr_find_spoilt(tmr_work *w) {
    tmr_mesh *m = &w->m;
    int32_t found = 0;
    txm_parallel_for(w->env, (m->face_count + TMR_CHUNK - 1) / TMR_CHUNK, tmr_spoilt_chunk, w);
    for (int32_t f = 0; f < m->face_count; f++) {
        if (!w->flag[f]) continue;
        found++;
        for (int k = 0; k < 3; k++) w->bad[m->vertex[3 * f + k]] = 1;
    }
    return found;
}

static void tmr_settle_chunk(void *context, int index) {
    tmr_work *w = (tmr_work *)context;
    tmr_mesh *m = &w->m;
    const int32_t from = index * TMR_CHUNK;
    const int32_t to = from + TMR_CHUNK < m->vertex_count ? from + TMR_CHUNK : m->vertex_count;
    for (int32_t v = from; v < to; v++) {
        if (m->corner[v] < 0 || tmr_is_ghost(m, v) || w->bad[v] || !tmr_has_moved(w, v)) continue;
        const int kind = tmr_kind_of(m, v);
        if (kind == TRIMESH_CORNER) continue;
        if (kind == TRIMESH_FREE) {
            tmr_place at = tmr_on_face(w->s, w->landed[v], w->moved[v]);
            at.p = w->moved[v]; /* fitting takes vertices off the surface */
            tmr_put(w, v, &at);
        } else {
            tmr_put_on_line(w, v, w->moved[v], w->landed[v]);
        }
    }
}

/* Move all vertices to w->moved, except those that would invert a triangle. */
static void tmr_settle(tmr_work *w) {
    tmr_mesh *m = &w->m;
    const int chunks = (m->vertex_count + TMR_CHUNK - 1) / TMR_CHUNK;
    memset(w->bad, 0, (size_t)m->vertex_count);
    for (int round = 0; round < 12; round++) {
        if (tmr_find_spoilt(w) == 0) break;
        for (int32_t v = 0; v < m->vertex_count; v++)
            if (w->bad[v]) w->moved[v] = m->p[v];
    }
    txm_parallel_for(w->env, chunks, tmr_settle_chunk, w);
}

static void tmr_relax(tmr_work *w) {
    const int chunks = (w->m.vertex_count + TMR_CHUNK - 1) / TMR_CHUNK;
    txm_parallel_for(w->env, chunks, tmr_relax_chunk, w);
    tmr_settle(w);
}

/* The edge length that as many equilateral triangles of the same total area would have, areas taken
   relative to the wanted sizes. */
static double tmr_ideal_length(const tmr_work *w) {
    const tmr_mesh *m = &w->m;
    double sum = 0;
    int32_t count = 0;
    for (int32_t f = 0; f < m->face_count; f++) {
        const int32_t *v = m->vertex + 3 * f;
        if (v[0] < 0 || tmr_is_ghost_face(m, f)) continue;
        const double size = (w->size[v[0]] + (double)w->size[v[1]] + w->size[v[2]]) / 3;
        sum += 0.5 * txm_d3_len(txm_d3_area2(m->p[v[0]], m->p[v[1]], m->p[v[2]])) / (size * size);
        count++;
    }
    return count ? sqrt(sum / count * 2.3094010767585034) : 0; /* area = sqrt(3) / 4 L^2 */
}

#endif /* TRIMESH_RELAX_RELAX_H */
