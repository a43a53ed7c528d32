#ifndef TRIMESH_RELAX_REPEL_H
#define TRIMESH_RELAX_REPEL_H

#include "join.h"

/* ---- repulsion ------------------------------------------------------------------------------ */

/* The points within reach of v that are connected to it by edges between such points; v itself
   first. */
static int tmr_find_near(const tmr_work *w, int32_t v, int32_t nearby[TMR_NEAR]) {
    const tmr_mesh *m = &w->m;
    const double reach = TMR_REACH * w->length * w->size[v];
    int count = 1;
    nearby[0] = v;
    for (int i = 0; i < count; i++) {
        int32_t c = m->corner[nearby[i]];
        const int32_t first = c;
        do {
            const int32_t x = m->vertex[tmr_next(c)];
            int known = tmr_is_ghost(m, x) || txm_d3_dist2(m->p[x], m->p[v]) > reach * reach;
            for (int k = 0; k < count && !known; k++) known = nearby[k] == x;
            if (!known && count < TMR_NEAR) nearby[count++] = x;
            c = tmr_swing(m, c);
        } while (c != first);
    }
    return count;
}

/* Length of an arc over its chord, by the cosine of the angle between the normals of its ends:
   (angle / 2) / sin(angle / 2), as a polynomial that is right at 0, 90 and 180 degrees. */
static double tmr_arc(double cosine) {
    const double x = 1 - cosine;
    return 1 + x * (0.0833 + x * (-0.0463 + x * 0.0737));
}

/* Equation 3.1: pos += (r - |d|) f d / |d|, d the way from another point to this one, over all that
   are nearer than the radius of influence r. */
static void tmr_repel_vertex(tmr_work *w, int32_t v) {
    const tmr_mesh *m = &w->m;
    const int kind = tmr_kind_of(m, v);
    int32_t nearby[TMR_NEAR];
    txm_dvec3 push = txm_d3(0, 0, 0);
    tmr_keep_place(w, v);
    if (m->corner[v] < 0 || kind == TRIMESH_CORNER || tmr_is_ghost(m, v)) return;
    const int count = tmr_find_near(w, v, nearby);
    for (int i = 1; i < count; i++) {
        const int32_t x = nearby[i];
        if (kind != TRIMESH_FREE && tmr_kind_of(m, x) == TRIMESH_FREE) continue;
        txm_dvec3 d = txm_d3_sub(m->p[v], m->p[x]);
        const double r = TMR_REACH * w->length * 0.5 * (w->size[v] + (double)w->size[x]);
        const double chord = txm_d3_len(d), length = chord * tmr_arc(txm_d3_dot(m->n[v], m->n[x]));
        if (length >= r) continue;
        if (chord > 0) d = txm_d3_scale(d, 1 / chord);
        else
            d = txm_d3_scale(txm_d3_unit(txm_d3_cross(m->n[v], txm_d3(0.6, 0.64, 0.48))),
                             v < x ? 1 : -1);
        push = txm_d3_mad(push, d, w->step * (r - length));
    }
    /* no farther than to where other points push back */
    const double limit = 0.5 * w->length * w->size[v], way = txm_d3_len(push);
    if (way > limit) push = txm_d3_scale(push, limit / way);
    const txm_dvec3 to = txm_d3_add(m->p[v], push);
    if (kind != TRIMESH_FREE) {
        w->moved[v] = tmr_project_line(w->s, w->l, to, &w->landed[v]);
        return;
    }
    const tmr_place at = tmr_project(w->s, to, m->source[v]);
    w->moved[v] = at.p;
    w->landed[v] = at.face;
}

static void tmr_repel_chunk(void *context, int index) {
    tmr_work *w = (tmr_work *)context;
    const int32_t from = index * TMR_CHUNK;
    const int32_t to = from + TMR_CHUNK < w->m.vertex_count ? from + TMR_CHUNK : w->m.vertex_count;
    for (int32_t v = from; v < to; v++) tmr_repel_vertex(w, v);
}

/* Would a triangle be inverted that is not so now? tmr_settle does not see this for slivers, which
   it takes for spoilt already. */
static int tmr_would_invert(const tmr_work *w, int32_t face) {
    const int32_t *v = w->m.vertex + 3 * face;
    if (v[0] < 0 || tmr_is_ghost_face(&w->m, face)) return 0;
    const txm_dvec3 *p = w->moved, *q = w->m.p;
    const txm_dvec3 after = txm_d3_area2(p[v[0]], p[v[1]], p[v[2]]);
    const txm_dvec3 before = txm_d3_area2(q[v[0]], q[v[1]], q[v[2]]);
    if (txm_d3_dot(after, before) > 0) return 0;
    const txm_dvec3 n = tmr_expected_normal(w, v[0], v[1], v[2]);
    return txm_d3_dot(after, n) <= 0 && txm_d3_dot(before, n) >= 0;
}

static void tmr_hold_inverting(tmr_work *w) {
    tmr_mesh *m = &w->m;
    for (int round = 0; round < 8; round++) {
        int32_t found = 0;
        for (int32_t f = 0; f < m->face_count; f++) {
            if (!tmr_would_invert(w, f)) continue;
            found++;
            for (int k = 0; k < 3; k++) {
                const int32_t v = m->vertex[3 * f + k];
                tmr_keep_place(w, v);
            }
        }
        if (found == 0) break;
    }
}

/* f in round 0..rounds - 1 */
static double tmr_repel_force(int round, int rounds) {
    const double left = 1 - round / (rounds > 1 ? rounds - 1.0 : 1.0);
    return TMR_LAST_FORCE + (TMR_FORCE - TMR_LAST_FORCE) * left * left;
}

/* One round: move all points at once (so that the result does not depend on threads), then flip
   edges. mean and largest movement, in wanted edge lengths. */
static void tmr_repel_round(tmr_work *w, double force, double *mean, double *largest) {
    const tmr_mesh *m = &w->m;
    const int chunks = (m->vertex_count + TMR_CHUNK - 1) / TMR_CHUNK;
    double sum = 0, most = 0;
    w->step = force;
    txm_parallel_for(w->env, chunks, tmr_repel_chunk, w);
    for (int32_t v = 0; v < m->vertex_count; v++) {
        if (m->corner[v] < 0 || tmr_is_ghost(m, v)) continue;
        const double d = txm_d3_dist(w->moved[v], m->p[v]) / (w->length * w->size[v]);
        sum += d;
        if (d > most) most = d;
    }
    *mean = m->live ? sum / m->live : 0;
    *largest = most;
    tmr_hold_inverting(w);
    tmr_settle(w);
    tmr_flip_delaunay(w, 2);
}

#define TMR_CALM 0.002 /* ours: mean movement, in edge lengths, at which it stops              */

#endif /* TRIMESH_RELAX_REPEL_H */
