#ifndef TRIMESH_RELAX_COLLAPSE_H
#define TRIMESH_RELAX_COLLAPSE_H

#include "relax.h"

/* ---- splitting and collapsing ------------------------------------------------------------- */

/* length of the edge opposite to c relative to what is wanted there */
static double tmr_edge_size(const tmr_work *w, int32_t c) {
    const int32_t a = w->m.vertex[tmr_next(c)], b = w->m.vertex[tmr_prev(c)];
    const double wanted = w->length * 0.5 * (w->size[a] + (double)w->size[b]);
    return txm_d3_dist(w->m.p[a], w->m.p[b]) / (w->m.edge[c] ? wanted * w->line_scale : wanted);
}

static int tmr_is_real_edge(const tmr_mesh *m, int32_t c) {
    return m->vertex[c] >= 0 && m->opposite[c] > c && !tmr_is_ghost(m, m->vertex[tmr_next(c)]) &&
           !tmr_is_ghost(m, m->vertex[tmr_prev(c)]);
}

#define TMR_SPLINTER 0.02 /* ours: shortest over longest edge of triangles whose short side is merged
                             however long the others are: split, they would fill the mesh,     */
#define TMR_SPLINTER_BEND 0.05 /* ours: if that turns them by no more than this                 */

/* Does moving its corner from p to `to` leave the triangle p x y in its plane? */
static int tmr_stays_flat(txm_dvec3 p, txm_dvec3 to, txm_dvec3 x, txm_dvec3 y) {
    const txm_dvec3 n = txm_d3_area2(p, x, y), way = txm_d3_sub(to, p);
    const double off = txm_d3_dot(n, way);
    return off * off <= TMR_SPLINTER_BEND * TMR_SPLINTER_BEND * txm_d3_len2(n) * txm_d3_len2(way);
}

/* Does that make it, too thin to agree with anything, no thinner, without turning it over? */
static int tmr_widens_thin(txm_dvec3 p, txm_dvec3 to, txm_dvec3 x, txm_dvec3 y) {
    const txm_dvec3 before = txm_d3_area2(p, x, y), after = txm_d3_area2(to, x, y);
    const double longest2 = fmax(txm_d3_dist2(p, x), fmax(txm_d3_dist2(x, y), txm_d3_dist2(y, p)));
    return txm_d3_len(before) <= TMR_THIN * longest2 &&
           txm_d3_dot(before, after) > 0.9 * txm_d3_len2(before);
}

/* Would all triangles of b be fair after b is merged into a at position to? reach: no edge may
   become longer than this, relative to the wanted length, but with w->splinters for those of
   splinters, which are longer already; 0 = any. */
static int tmr_collapse_is_fair(const tmr_work *w, int32_t c, txm_dvec3 to, double reach) {
    const tmr_mesh *m = &w->m;
    const int32_t o = m->opposite[c];
    const double merged2 = txm_d3_dist2(m->p[m->vertex[tmr_next(c)]], m->p[m->vertex[tmr_prev(c)]]);
    for (int end = 0; end < 2; end++) {
        const int32_t first = end ? tmr_next(c) : tmr_prev(c), v = m->vertex[first];
        if (end && txm_d3_dist2(m->p[v], to) <= 0) break; /* a stays */
        int32_t i = first;
        do {
            const int32_t x = m->vertex[tmr_next(i)], y = m->vertex[tmr_prev(i)];
            if (i / 3 != c / 3 && i / 3 != o / 3 && !tmr_is_ghost(m, x) && !tmr_is_ghost(m, y)) {
                const double after = tmr_agreement(w, v, x, y, to, m->p[x], m->p[y]);
                const double wanted = w->length * 0.5 * (w->size[v] + (double)w->size[x]);
                const double most2 = reach * reach * wanted * wanted;
                const double vx2 = txm_d3_dist2(m->p[v], m->p[x]), vy2 = txm_d3_dist2(m->p[v], m->p[y]);
                const double long2 = fmax(most2, merged2 / (TMR_SPLINTER * TMR_SPLINTER));
                const int splinter = w->splinters && fmax(vx2, vy2) > long2 &&
                                     tmr_stays_flat(m->p[v], to, m->p[x], m->p[y]);
                const int longer = splinter && vx2 > long2;
                const int thin = splinter && tmr_widens_thin(m->p[v], to, m->p[x], m->p[y]);
                if (after < TMR_LEAST_AGREEMENT && !thin &&
                    after <= tmr_agreement(w, v, x, y, m->p[v], m->p[x], m->p[y]))
                    return 0;
                if (reach > 0 && !longer && txm_d3_dist2(to, m->p[x]) > most2) return 0;
            }
            i = tmr_swing(m, i);
        } while (i != first);
    }
    return 1;
}

/* Collapse the edge opposite to c, to the end that must stay, or else to its middle or either end.
   Returns 0 if that is not possible. */
static int tmr_try_collapse(tmr_work *w, int32_t c, double reach, int middle) {
    tmr_mesh *m = &w->m;
    const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
    /* the more constrained one stays: corner, line, free */
    const int rank_a = tmr_kind_of(m, a) == TRIMESH_CORNER ? 2 : tmr_kind_of(m, a) != TRIMESH_FREE;
    const int rank_b = tmr_kind_of(m, b) == TRIMESH_CORNER ? 2 : tmr_kind_of(m, b) != TRIMESH_FREE;
    if (rank_b > rank_a) c = m->opposite[c];
    const int32_t keep = m->vertex[tmr_next(c)];
    if (!tmr_can_collapse(m, c)) return 0;
    if (rank_a == 0 && rank_b == 0 && middle) {
        const tmr_place at =
            tmr_project(w->s, txm_d3_scale(txm_d3_add(m->p[a], m->p[b]), 0.5), m->source[keep]);
        if (tmr_collapse_is_fair(w, c, at.p, reach)) {
            tmr_collapse(m, c);
            tmr_put(w, keep, &at);
            return 1;
        }
    }
    if (!tmr_collapse_is_fair(w, c, m->p[keep], reach)) {
        if (rank_a != rank_b) return 0;
        c = m->opposite[c];
        if (!tmr_can_collapse(m, c)) return 0;
        if (!tmr_collapse_is_fair(w, c, m->p[m->vertex[tmr_next(c)]], reach)) return 0;
    }
    tmr_collapse(m, c);
    return 1;
}

/* Would the four triangles around a vertex at p on the edge of c be fair? */
static int tmr_split_is_fair(const tmr_work *w, int32_t c, txm_dvec3 p, txm_dvec3 n) {
    const tmr_mesh *m = &w->m;
    const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
    const double length2 = txm_d3_dist2(m->p[a], m->p[b]);
    if (fmax(txm_d3_dist2(p, m->p[a]), txm_d3_dist2(p, m->p[b])) > 0.6 * length2) return 0;
    for (int side = 0; side < 2; side++) {
        const int32_t i = side ? m->opposite[c] : c, d = m->vertex[i];
        const int32_t x = m->vertex[tmr_next(i)], y = m->vertex[tmr_prev(i)];
        if (tmr_is_ghost(m, d)) continue;
        const txm_dvec3 one = txm_d3_area2(m->p[d], m->p[x], p),
                        two = txm_d3_area2(m->p[d], p, m->p[y]);
        const double before = tmr_agreement(w, d, x, y, m->p[d], m->p[x], m->p[y]);
        const txm_dvec3 whole = txm_d3_area2(m->p[d], m->p[x], m->p[y]);
        if (before < TMR_LEAST_AGREEMENT) continue;
        if (txm_d3_dot(one, whole) <= 0 || txm_d3_dot(two, whole) <= 0) return 0;
        if (m->edge[c]) continue;
        if (txm_d3_dot(one, n) < 0.2 * txm_d3_len(one) ||
            txm_d3_dot(two, n) < 0.2 * txm_d3_len(two))
            return 0;
    }
    return 1;
}

/* The place on the line half-way between two neighbours on it, a and b; *k: its segment. Between two
   corners, which may belong to other lines too, that is the middle of the whole line. */
static txm_dvec3 tmr_line_middle(const tmr_work *w, int32_t id, int32_t a, int32_t b, int32_t *k) {
    const tmr_mesh *m = &w->m;
    const int bound_a = tmr_kind_of(m, a) == TRIMESH_CORNER;
    const int bound_b = tmr_kind_of(m, b) == TRIMESH_CORNER;
    if (bound_a && bound_b) return tmr_line_at(w->s, w->l, id, 0.5 * w->l->length[id], k);
    *k = m->source[bound_a ? b : a];
    return tmr_project_line(w->s, w->l, txm_d3_scale(txm_d3_add(m->p[a], m->p[b]), 0.5), k);
}

/* Split the edge opposite to c at its middle, on the surface. Returns the new vertex; -1 if there
   is no room or the triangles would not be fair. */
static int32_t tmr_split_edge(tmr_work *w, int32_t c) {
    tmr_mesh *m = &w->m;
    const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
    const int32_t line = m->edge[c];
    const txm_dvec3 middle = txm_d3_scale(txm_d3_add(m->p[a], m->p[b]), 0.5);
    if (line) {
        const int32_t id = line - 1;
        int32_t k;
        const txm_dvec3 p = tmr_line_middle(w, id, a, b, &k);
        if (!tmr_split_is_fair(w, c, p, txm_d3(0, 0, 0))) return -1;
        const int32_t v = tmr_split(m, c);
        if (v < 0) return v;
        m->flags[v] = w->l->border[id] ? TRIMESH_BORDER : TRIMESH_CREASE;
        tmr_put_on_line(w, v, p, k);
        return v;
    }
    const tmr_place at = tmr_project_between(w, a, b, middle);
    if (!tmr_split_is_fair(w, c, at.p, tmr_normal_at(w->s, w->l, &at))) return -1;
    const int32_t v = tmr_split(m, c);
    if (v >= 0) tmr_put(w, v, &at);
    return v;
}

/* an edge's length relative to what is allowed; above 1 it must be split */
static double tmr_excess(const tmr_work *w, int32_t c, double limit, double line_limit) {
    return tmr_edge_size(w, c) / (w->m.edge[c] ? line_limit : limit);
}

/* Is no other edge of the two triangles longer? (always true on lines) */
static int tmr_is_longest(const tmr_work *w, int32_t c) {
    const tmr_mesh *m = &w->m;
    const int32_t o = m->opposite[c];
    const int32_t other[4] = {tmr_next(c), tmr_prev(c), tmr_next(o), tmr_prev(o)};
    const double size = tmr_edge_size(w, c);
    if (m->edge[c]) return 1;
    for (int k = 0; k < 4; k++) {
        if (tmr_edge_size(w, other[k]) > size * (1 + 1e-9)) return 0;
    }
    return 1;
}

/* Split all edges longer than limit, on lines longer than line_limit. Returns how many. The longest
   first, and only where an edge is the longest of its triangles: otherwise slivers arise. */
static int32_t tmr_split_long(tmr_work *w, double limit, double line_limit) {
    tmr_mesh *m = &w->m;
    int32_t count = 0;
    double least = 0;
    for (int32_t c = 0; c < 3 * m->face_count; c++)
        if (tmr_is_real_edge(m, c)) least = fmax(least, tmr_excess(w, c, limit, line_limit));
    for (int round = 0; round < 100 && least > 1; round++) {
        const int32_t before = count, corners = 3 * m->face_count;
        least = fmax(1, 0.8 * least);
        for (int32_t c = 0; c < corners; c++) {
            if (!tmr_is_real_edge(m, c) || tmr_excess(w, c, limit, line_limit) < least) continue;
            if (!tmr_is_longest(w, c)) continue;
            count += tmr_split_edge(w, c) >= 0;
        }
        if (count != before) tmr_flip_delaunay(w, 2);
    }
    return count;
}

static int32_t tmr_collapse_short(tmr_work *w, double limit, double line_limit, double reach,
                                  int middle) {
    tmr_mesh *m = &w->m;
    int32_t count = 0;
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        if (!tmr_is_real_edge(m, c)) continue;
        if (tmr_edge_size(w, c) >= (m->edge[c] ? line_limit : limit)) continue;
        count += tmr_try_collapse(w, c, reach, middle);
    }
    return count;
}

#endif /* TRIMESH_RELAX_COLLAPSE_H */
