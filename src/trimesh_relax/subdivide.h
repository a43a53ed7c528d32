#ifndef TRIMESH_RELAX_SUBDIVIDE_H
#define TRIMESH_RELAX_SUBDIVIDE_H

#include "collapse.h"

/* ---- subdividing -------------------------------------------------------------------------- */

/* Is the mesh near enough to the surface for each triangle to be cut in four? */
static int tmr_may_subdivide(const tmr_work *w) {
    const tmr_mesh *m = &w->m;
    int32_t edges = 0, bent = 0;
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        if (!tmr_is_real_edge(m, c) || m->edge[c]) continue;
        const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
        edges++;
        /* the height of the arc over the chord is about length * tan(angle / 4) / 2 */
        bent += txm_d3_dot(m->n[a], m->n[b]) < -0.2;
    }
    return bent * 100.0 <= edges;
}

/* Copy the living part of w->m into new arrays, each triangle cut in four if wanted, with room for
   1000 vertices more.

   Every live vertex and ghost stays. A cut adds at most one vertex per edge, of which there are 3/2
   live_faces, and makes four triangles of one, of a ghost triangle two. */
static txm_status tmr_rebuild(tmr_work *w, int cut, txm_arena *arena, txm_arena *scratch) {
    enum { MORE = 1000 };
    const tmr_mesh old = w->m;
    const double vertices =
        (double)MORE + old.live + (double)old.ghosts + (cut ? 1.5 * old.live_faces : 0);
    const double faces = (cut ? 4.0 : 1.0) * old.live_faces + 4 * MORE;
    const float *old_size = w->size;
    tmr_mesh *m = &w->m;
    int32_t *number = (int32_t *)txm_arena_alloc(scratch, (size_t)old.vertex_count, sizeof(int32_t));
    int32_t *middle = (int32_t *)txm_arena_alloc(scratch, 3 * (size_t)old.face_count, sizeof(int32_t));
    int32_t *where = (int32_t *)txm_arena_alloc(scratch, (size_t)old.face_count, sizeof(int32_t));
    if (vertices > (double)TMR_MOST_SLOTS || faces > (double)TMR_MOST_SLOTS)
        return txm_fail(w->env, TXM_TOO_LARGE, "too many triangles");
    txm_status status = tmr_check_memory(scratch);
    if (status == TXM_OK) status = tmr_alloc_mesh(w, (int32_t)vertices, (int32_t)faces, arena);
    if (status != TXM_OK) return status;
    for (int32_t v = 0; v < old.vertex_count; v++) {
        if (old.corner[v] < 0) continue;
        TRIMESH_ASSERT(m->vertex_count < m->vertex_limit);
        const int32_t k = number[v] = m->vertex_count++;
        m->p[k] = old.p[v];
        m->n[k] = old.n[v];
        m->source[k] = old.source[v];
        m->flags[k] = old.flags[v];
        w->size[k] = old_size[v];
        m->live += !(old.flags[v] & TMR_GHOST);
    }
    /* triangles: one each, or corner 0, 1, 2 and the middle; ghost triangles (ghost, b, a) are cut
       in two across the border edge: (ghost, b, m) and (ghost, m, a) */
    for (int32_t f = 0; f < old.face_count; f++) {
        if (old.vertex[3 * f] < 0) continue;
        const int ghost = cut ? tmr_is_ghost_face(&old, f) : 0;
        where[f] = m->face_count;
        m->face_count += !cut ? 1 : ghost ? 2 : 4;
    }
    TRIMESH_ASSERT(m->face_count <= m->face_limit);
    m->live_faces = m->face_count;
    for (int32_t c = 0; c < 3 * old.face_count && cut; c++) {
        if (old.vertex[c] < 0 || old.opposite[c] < c) continue;
        const int32_t a = old.vertex[tmr_next(c)], b = old.vertex[tmr_prev(c)];
        middle[c] = middle[old.opposite[c]] = -1;
        if ((old.flags[a] | old.flags[b]) & TMR_GHOST) continue;
        TRIMESH_ASSERT(m->vertex_count < m->vertex_limit);
        middle[c] = middle[old.opposite[c]] = m->vertex_count;
        const int32_t v = m->vertex_count++;
        m->live++;
        m->flags[v] = 0;
        /* where an arc with these normals at its ends would have its middle */
        const txm_dvec3 d = txm_d3_sub(old.p[b], old.p[a]);
        txm_dvec3 p = txm_d3_scale(txm_d3_add(old.p[a], old.p[b]), 0.5);
        const double na = txm_d3_dot(old.n[a], d), nb = txm_d3_dot(old.n[b], d);
        p = txm_d3_add(
            p, txm_d3_scale(txm_d3_sub(txm_d3_scale(old.n[a], -na), txm_d3_scale(old.n[b], -nb)),
                            0.125));
        const int32_t x = number[a], y = number[b];
        if (old.edge[c]) {
            const int32_t id = old.edge[c] - 1;
            int32_t k;
            m->flags[v] = w->l->border[id] ? TRIMESH_BORDER : TRIMESH_CREASE;
            p = tmr_line_middle(w, id, x, y, &k);
            tmr_put_on_line(w, v, p, k);
        } else {
            const tmr_place at = tmr_project_between(w, x, y, p);
            tmr_put(w, v, &at);
        }
    }
    for (int32_t f = 0; f < old.face_count; f++) {
        const int32_t *v = old.vertex + 3 * f, c = 3 * f, to = 3 * (old.vertex[c] < 0 ? 0 : where[f]);
        if (v[0] < 0) continue;
        if (!cut) {
            for (int k = 0; k < 3; k++) {
                const int32_t o = old.opposite[c + k];
                m->vertex[to + k] = number[v[k]];
                m->opposite[to + k] = 3 * where[o / 3] + o % 3;
                m->edge[to + k] = old.edge[c + k];
            }
            continue;
        }
        int g = -1;
        for (int k = 0; k < 3; k++)
            if (old.flags[v[k]] & TMR_GHOST) g = k;
        if (g >= 0) { /* (g, b, a) */
            const int32_t b = c + (g + 1) % 3, a = c + (g + 2) % 3, mid = middle[c + g];
            const int32_t corners[6] = {number[v[g]], number[old.vertex[b]], mid,
                                        number[v[g]], mid, number[old.vertex[a]]};
            for (int k = 0; k < 6; k++) m->vertex[to + k] = corners[k];
            tmr_link(m, to + 1, to + 5, 0); /* ghost - middle */
            continue;
        }
        for (int k = 0; k < 3; k++) { /* corner k: (v, middle of the next edge, of the previous) */
            m->vertex[to + 3 * k] = number[v[k]];
            m->vertex[to + 3 * k + 1] = middle[tmr_prev(c + k)];
            m->vertex[to + 3 * k + 2] = middle[tmr_next(c + k)];
            m->vertex[to + 9 + k] = middle[c + k];
        }
        /* the middle one: its corner k, on the edge opposite to corner k, looks at that corner's
           triangle across the edge between the two other middles */
        for (int k = 0; k < 3; k++) tmr_link(m, to + 9 + k, to + 3 * k, 0);
    }
    for (int32_t c = 0; c < 3 * old.face_count && cut; c++) {
        if (old.vertex[c] < 0 || old.opposite[c] < c) continue;
        const int32_t o = old.opposite[c], f = 3 * where[c / 3], g = 3 * where[o / 3];
        const int fg = tmr_is_ghost_face(&old, c / 3), gg = tmr_is_ghost_face(&old, o / 3);
        const int32_t a = tmr_next(c), b = tmr_prev(c);      /* edge a b; in o's triangle: */
        const int32_t oa = tmr_prev(o), ob = tmr_next(o);    /* the same vertices */
        if (middle[c] < 0) { /* a ghost edge: ghost - x, one whole edge of one half each */
            int32_t side[2];
            for (int k = 0; k < 2; k++) {
                const int32_t i = k ? o : c, base = k ? g : f;
                int ghost = 0;
                for (int j = 0; j < 3; j++)
                    if (old.flags[old.vertex[i / 3 * 3 + j]] & TMR_GHOST) ghost = j;
                /* of (ghost, b, a) = (0, 1, 2): i is b or a, its edge ghost - the other one */
                const int which = (i % 3 - ghost + 3) % 3;
                /* i is b (1): edge a - ghost: half (ghost, m, a) opposite m; a (2): half 1 opp. m */
                side[k] = which == 1 ? base + 4 : base + 2;
            }
            tmr_link(m, side[0], side[1], 0);
            continue;
        }
        /* two halves: at a and at b */
        int32_t at_a[2], at_b[2];
        for (int k = 0; k < 2; k++) {
            const int32_t i = k ? o : c, base = k ? g : f, ia = k ? oa : a, ib = k ? ob : b;
            if (k ? gg : fg) {
                /* i is the ghost; (ghost, next, m), (ghost, m, prev): opposite to the ghost */
                at_a[k] = ia == tmr_next(i) ? base : base + 3;
                at_b[k] = ib == tmr_next(i) ? base : base + 3;
            } else {
                /* the triangle at corner x is (x, m of prev edge.. ) */
                at_a[k] = base + 3 * (ia % 3) + (ia == tmr_next(i) ? 2 : 1);
                at_b[k] = base + 3 * (ib % 3) + (ib == tmr_next(i) ? 2 : 1);
            }
        }
        tmr_link(m, at_a[0], at_a[1], old.edge[c]);
        tmr_link(m, at_b[0], at_b[1], old.edge[c]);
    }
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        m->corner[m->vertex[c]] = c;
        m->valence[m->vertex[c]]++;
    }
    return TXM_OK;
}

/* ---- fitting ------------------------------------------------------------------------------ */

/* Chords lie inside a round surface, so a mesh with its vertices on the surface has too little
   volume. Each free vertex moves along its normal by the mean height of the surface over the
   triangles around it. The mean height over one triangle is 3/4 of that at its centre plus 1/4 of
   the mean of those at its corners, which is exact for a paraboloid. It moves off the
   surface by no more than TMR_FIT_OUT, except where the surface is round all around: beside a fillet
   it would stick out. On a flat it stays. */
#define TMR_FIT_OUT 0.02    /* ours: in edge lengths                                           */
#define TMR_FIT_MOST 0.15   /* ours: where it is round                                         */
#define TMR_FIT_EVEN 1e-4   /* ours: triangles of lower height lie in a flat                   */
#define TMR_FIT_ROUND 0.3   /* ours: it is, if the second lowest height is this part of the mean */

static double tmr_height_over(const tmr_work *w, int32_t face) {
    const tmr_mesh *m = &w->m;
    const int32_t *v = m->vertex + 3 * face;
    const txm_dvec3 n = txm_d3_unit(txm_d3_area2(m->p[v[0]], m->p[v[1]], m->p[v[2]]));
    const txm_dvec3 centre = tmr_middle(m, v);
    double sum = 0;
    int32_t from = v[0];
    for (int k = 0; k < 3; k++) {
        if (tmr_kind_of(m, v[k]) != TRIMESH_FREE) continue;
        from = v[k];
        const tmr_place at = tmr_on_face(w->s, m->source[v[k]], m->p[v[k]]);
        sum += txm_d3_dot(txm_d3_sub(at.p, m->p[v[k]]), n);
    }
    const tmr_place at = tmr_project(w->s, centre, tmr_face_of(w, from));
    return 0.75 * txm_d3_dot(txm_d3_sub(at.p, centre), n) + 0.25 * sum / 3;
}

/* May fitting take v off the surface? Creases and borders stay where they are. */
static int tmr_may_fit(const tmr_work *w, int32_t v) {
    const int kind = tmr_kind_of(&w->m, v);
    return kind == TRIMESH_FREE ||
           (kind == TRIMESH_CREASE && tmr_is_smooth_segment(w->l, w->m.source[v]));
}

/* How far may vertex v move out of the surface (sign 1) or into it (-1)? Not at all if triangles
   around it lie in a flat. On a smooth surface the heights over the triangles around are nearly
   equal; the second lowest one tells such places from those beside a fillet, where some are high. */
static float tmr_fit_limit(const tmr_work *w, int32_t v, double sign) {
    const tmr_mesh *m = &w->m;
    const double unit = w->length * w->size[v];
    double low[2] = {0, 0}, sum = 0; /* the lowest heights, in rising order */
    int count = 0, flat = 0;
    int32_t c = m->corner[v];
    const int32_t first = c;
    do {
        if (!tmr_is_ghost_face(m, c / 3)) {
            double h = sign * (double)w->height[c / 3];
            flat += fabs(h) < TMR_FIT_EVEN * unit;
            sum += h;
            for (int k = 0; k < 2; k++) {
                const double old = low[k];
                if (k < count && old <= h) continue;
                low[k] = h;
                h = old;
                if (k >= count) break;
            }
            count++;
        }
        c = tmr_swing(m, c);
    } while (c != first);
    if (flat >= 2 || count == 0) return 0;
    const double second = low[count > 1 ? 1 : 0];
    const int is_round = second * count >= TMR_FIT_ROUND * sum;
    return txm_float((is_round ? TMR_FIT_MOST : TMR_FIT_OUT) * unit);
}

static void tmr_limit_chunk(void *context, int index) {
    tmr_work *w = (tmr_work *)context;
    const tmr_mesh *m = &w->m;
    const int32_t from = index * TMR_CHUNK;
    const int32_t to = from + TMR_CHUNK < m->vertex_count ? from + TMR_CHUNK : m->vertex_count;
    for (int32_t v = from; v < to; v++) {
        w->limit[v][0] = w->limit[v][1] = 0;
        if (m->corner[v] < 0 || tmr_is_ghost(m, v) || !tmr_may_fit(w, v)) continue;
        w->limit[v][0] = -tmr_fit_limit(w, v, -1);
        w->limit[v][1] = tmr_fit_limit(w, v, 1);
    }
}

/* Move vertex v by the mean height around it, within its limits. */
static void tmr_fit_vertex(tmr_work *w, int32_t v) {
    const tmr_mesh *m = &w->m;
    double sum = 0;
    int count = 0;
    int32_t c = m->corner[v];
    const int32_t first = c;
    do {
        if (!tmr_is_ghost_face(m, c / 3)) {
            sum += w->height[c / 3];
            count++;
        }
        c = tmr_swing(m, c);
    } while (c != first);
    if (count == 0) return;
    const tmr_place at = tmr_on_face(w->s, tmr_face_of(w, v), m->p[v]);
    const double now = txm_d3_dot(txm_d3_sub(m->p[v], at.p), m->n[v]), to = now + sum / count;
    const double least = w->limit[v][0], most = w->limit[v][1];
    w->moved[v] = txm_d3_mad(m->p[v], m->n[v], (to < least ? least : to > most ? most : to) - now);
}

static void tmr_fit_chunk(void *context, int index) {
    tmr_work *w = (tmr_work *)context;
    const tmr_mesh *m = &w->m;
    const int32_t from = index * TMR_CHUNK;
    const int32_t to = from + TMR_CHUNK < m->vertex_count ? from + TMR_CHUNK : m->vertex_count;
    for (int32_t v = from; v < to; v++) {
        tmr_keep_place(w, v);
        if (m->corner[v] < 0 || tmr_is_ghost(m, v) || !tmr_may_fit(w, v)) continue;
        tmr_fit_vertex(w, v);
    }
}

static void tmr_height_chunk(void *context, int index) {
    tmr_work *w = (tmr_work *)context;
    const tmr_mesh *m = &w->m;
    const int32_t from = index * TMR_CHUNK;
    const int32_t to = from + TMR_CHUNK < m->face_count ? from + TMR_CHUNK : m->face_count;
    for (int32_t f = from; f < to; f++)
        w->height[f] = tmr_is_dead(m, f) || tmr_is_ghost_face(m, f) ? 0 : (float)tmr_height_over(w, f);
}

static txm_status tmr_fit_surface(tmr_work *w, int rounds, txm_arena *scratch) {
    w->height = (float *)txm_arena_alloc(scratch, (size_t)w->m.face_count, sizeof(float));
    w->limit = (float(*)[2])txm_arena_alloc(scratch, (size_t)w->m.vertex_count, 2 * sizeof(float));
    if (!w->height || !w->limit) return TXM_OUT_OF_MEMORY;
    for (int round = 0; round < rounds; round++) {
        txm_parallel_for(w->env, (w->m.face_count + TMR_CHUNK - 1) / TMR_CHUNK, tmr_height_chunk, w);
        if (tmr_tick(w, w->m.live)) return TXM_CANCELLED;
        const int chunks = (w->m.vertex_count + TMR_CHUNK - 1) / TMR_CHUNK;
        if (round == 0) txm_parallel_for(w->env, chunks, tmr_limit_chunk, w);
        if (tmr_tick(w, w->m.live)) return TXM_CANCELLED;
        txm_parallel_for(w->env, chunks, tmr_fit_chunk, w);
        tmr_settle(w);
        if (tmr_tick(w, w->m.live)) return TXM_CANCELLED;
    }
    return TXM_OK;
}

#endif /* TRIMESH_RELAX_SUBDIVIDE_H */
