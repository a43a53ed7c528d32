#ifndef TRIMESH_RELAX_VALIDITY_H
#define TRIMESH_RELAX_VALIDITY_H

#include "collapse.h"

/* ---- is the result sound? ----------------------------------------------------------------- */

/* Does the open segment p q cross the interior of triangle a b c? rim: or its boundary. */
static int tmr_crosses(txm_dvec3 p, txm_dvec3 q, txm_dvec3 a, txm_dvec3 b, txm_dvec3 c, int rim) {
    const txm_dvec3 e1 = txm_d3_sub(b, a), e2 = txm_d3_sub(c, a), d = txm_d3_sub(q, p);
    const txm_dvec3 h = txm_d3_cross(d, e2);
    const double det = txm_d3_dot(e1, h), eps = 1e-10, least = rim ? -eps : eps;
    if (fabs(det) <= 1e-10 * txm_d3_len(e1) * txm_d3_len(e2) * txm_d3_len(d)) return 0;
    const txm_dvec3 s = txm_d3_sub(p, a), k = txm_d3_cross(s, e1);
    const double u = txm_d3_dot(s, h) / det, v = txm_d3_dot(d, k) / det,
                 t = txm_d3_dot(e2, k) / det;
    return u > least && v > least && u + v < 1 - least && t > eps && t < 1 - eps;
}

/* Do two triangles, which share at most one vertex, cross each other? rim: also where an edge only
   passes through the boundary of the other triangle, as with cards that cross edge to edge. */
static int tmr_faces_cross(const tmr_mesh *m, int32_t f, int32_t g, int rim) {
    const int32_t *v = m->vertex + 3 * f, *w = m->vertex + 3 * g;
    int shared = 0, kf = 0, kg = 0;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            if (v[i] != w[j]) continue;
            shared++;
            kf = i;
            kg = j;
        }
    }
    if (shared > 1) return 0;
    const txm_dvec3 a[3] = {m->p[v[0]], m->p[v[1]], m->p[v[2]]};
    const txm_dvec3 b[3] = {m->p[w[0]], m->p[w[1]], m->p[w[2]]};
    if (shared == 1)
        return tmr_crosses(a[(kf + 1) % 3], a[(kf + 2) % 3], b[0], b[1], b[2], rim) ||
               tmr_crosses(b[(kg + 1) % 3], b[(kg + 2) % 3], a[0], a[1], a[2], rim);
    const txm_dvec3 n = txm_d3_area2(a[0], a[1], a[2]);
    double low = 0, high = 0; /* of b on either side of a's plane */
    for (int i = 0; i < 3; i++) {
        const double d = txm_d3_dot(n, txm_d3_sub(b[i], a[0]));
        low = i == 0 || d < low ? d : low;
        high = i == 0 || d > high ? d : high;
    }
    if (low > 0 || high < 0) return 0;
    for (int i = 0; i < 3; i++) {
        if (tmr_crosses(a[i], a[(i + 1) % 3], b[0], b[1], b[2], rim)) return 1;
        if (tmr_crosses(b[i], b[(i + 1) % 3], a[0], a[1], a[2], rim)) return 1;
    }
    return 0;
}

#define TMR_TOUCH 1e-6 /* ours: distance, in diagonals, of what touches */

/* squared distance of the segments a b and c d */
static double tmr_segments_dist2(txm_dvec3 a, txm_dvec3 b, txm_dvec3 c, txm_dvec3 d) {
    const txm_dvec3 u = txm_d3_sub(b, a), v = txm_d3_sub(d, c), w = txm_d3_sub(a, c);
    const double uu = txm_d3_len2(u), vv = txm_d3_len2(v), uv = txm_d3_dot(u, v);
    const double uw = txm_d3_dot(u, w), vw = txm_d3_dot(v, w), det = uu * vv - uv * uv;
    double s = det > 1e-12 * uu * vv ? (uv * vw - vv * uw) / det : 0;
    s = fmin(fmax(s, 0), 1);
    double t = vv > 0 ? (uv * s + vw) / vv : 0;
    if (t < 0 || t > 1) { /* beyond an end: that end, and the place on a b nearest to it */
        t = t < 0 ? 0 : 1;
        s = uu > 0 ? fmin(fmax((uv * t - uw) / uu, 0), 1) : 0;
    }
    return txm_d3_dist2(txm_d3_mad(a, u, s), txm_d3_mad(c, v, t));
}

static int tmr_point_touches(txm_dvec3 p, const txm_dvec3 t[3]) {
    double u, v;
    int part;
    return txm_d3_dist2(p, tmr_nearest(p, t[0], t[1], t[2], &u, &v, &part)) < TMR_TOUCH * TMR_TOUCH;
}

/* Do two triangles touch away from the vertices that they share? So do cards and boxes that stand on
   one another, sheets that lie on each other, and what was separated along an edge. */
static int tmr_faces_touch(const tmr_mesh *m, int32_t f, int32_t g) {
    txm_dvec3 p[2][3];
    int alone[2][3] = {{1, 1, 1}, {1, 1, 1}}; /* not shared */
    for (int i = 0; i < 3; i++) {
        p[0][i] = m->p[m->vertex[3 * f + i]];
        p[1][i] = m->p[m->vertex[3 * g + i]];
        for (int j = 0; j < 3; j++)
            if (m->vertex[3 * f + i] == m->vertex[3 * g + j]) alone[0][i] = alone[1][j] = 0;
    }
    for (int k = 0; k < 2; k++) { /* a triangle without area touches its neighbours anyway */
        const double longest = fmax(txm_d3_dist2(p[k][0], p[k][1]),
                                    fmax(txm_d3_dist2(p[k][1], p[k][2]),
                                         txm_d3_dist2(p[k][2], p[k][0])));
        if (txm_d3_len(txm_d3_area2(p[k][0], p[k][1], p[k][2])) <= 10 * TMR_TOUCH * sqrt(longest))
            return 0;
    }
    for (int k = 0; k < 2; k++)
        for (int i = 0; i < 3; i++)
            if (alone[k][i] && tmr_point_touches(p[k][i], p[1 - k])) return 1;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) { /* edges without a shared end */
            const int i2 = (i + 1) % 3, j2 = (j + 1) % 3;
            const int32_t a = m->vertex[3 * f + i], b = m->vertex[3 * f + i2];
            const int32_t c = m->vertex[3 * g + j], d = m->vertex[3 * g + j2];
            if (a == c || a == d || b == c || b == d) continue;
            if (tmr_segments_dist2(p[0][i], p[0][i2], p[1][j], p[1][j2]) < TMR_TOUCH * TMR_TOUCH)
                return 1;
        }
    }
    return 0;
}

/* Triangles by the cells of a grid that their bounding boxes touch: hashed cells, sorted. */
typedef struct tmr_cells {
    double cell;
    txm_pair *entry, *spare;
    size_t count, limit;
    int overflow;
} tmr_cells;

/* The cell of a coordinate. Where one vertex lies extremely far out, edges may be so short beside the
   diagonal that cells cannot be counted; then those of the outer ones are the same. */
static int32_t tmr_cell_at(double x, double cell) {
    const double at = floor(x / cell);
    return !(at > -1e9) ? -1000000000 : at < 1e9 ? (int32_t)at : 1000000000;
}

static uint32_t tmr_cell_key(int32_t x, int32_t y, int32_t z) {
    return (uint32_t)(txm_hash((uint64_t)(uint32_t)x * 0x9e3779b1u + (uint64_t)(uint32_t)y *
                               0x85ebca77u * 65537u + ((uint64_t)(uint32_t)z << 40)) >> 32);
}

static void tmr_face_box(const tmr_mesh *m, int32_t f, txm_dvec3 *low, txm_dvec3 *high) {
    *low = *high = m->p[m->vertex[3 * f]];
    for (int k = 1; k < 3; k++) {
        const txm_dvec3 p = m->p[m->vertex[3 * f + k]];
        *low = txm_d3(fmin(low->x, p.x), fmin(low->y, p.y), fmin(low->z, p.z));
        *high = txm_d3(fmax(high->x, p.x), fmax(high->y, p.y), fmax(high->z, p.z));
    }
}

static void tmr_cells_add(const tmr_mesh *m, tmr_cells *g, int32_t f) {
    txm_dvec3 low, high;
    tmr_face_box(m, f, &low, &high);
    const int32_t x1 = tmr_cell_at(high.x, g->cell), y1 = tmr_cell_at(high.y, g->cell);
    const int32_t z1 = tmr_cell_at(high.z, g->cell);
    for (int32_t x = tmr_cell_at(low.x, g->cell); x <= x1; x++) {
        for (int32_t y = tmr_cell_at(low.y, g->cell); y <= y1; y++) {
            for (int32_t z = tmr_cell_at(low.z, g->cell); z <= z1; z++) {
                if (g->count == g->limit) {
                    g->overflow = 1;
                    return;
                }
                g->entry[g->count].key = tmr_cell_key(x, y, z);
                g->entry[g->count++].value = (uint32_t)f;
            }
        }
    }
}

enum {
    TMR_NEAR_CELLS = 1 << 16
}; /* coarse cells by hash: near a marked vertex?                    */

static uint32_t tmr_near_key(txm_dvec3 p, double cell, int dx, int dy, int dz) {
    return tmr_cell_key(tmr_cell_at(p.x, cell) + dx, tmr_cell_at(p.y, cell) + dy,
                        tmr_cell_at(p.z, cell) + dz) % TMR_NEAR_CELLS;
}

/* Set near for the coarse cells around the vertices marked in w->bad. */
static void tmr_mark_near(const tmr_work *w, uint8_t *nearby) {
    memset(nearby, 0, TMR_NEAR_CELLS);
    for (int32_t v = 0; v < w->m.vertex_count; v++) {
        if (!w->bad[v]) continue;
        for (int k = 0; k < 27; k++)
            nearby[tmr_near_key(w->m.p[v], 3 * w->length, k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1)] = 1;
    }
}

/* The cells of all triangles, or of those near, in order. */
static txm_status tmr_cells_make(const tmr_work *w, const uint8_t *nearby, tmr_cells *g,
                                 txm_arena *arena) {
    const tmr_mesh *m = &w->m;
    memset(g, 0, sizeof *g);
    g->cell = w->length * 0.65;
    g->limit = (size_t)m->live_faces * 10 + 1000;
    g->entry = (txm_pair *)txm_arena_alloc(arena, g->limit, sizeof(txm_pair));
    g->spare = (txm_pair *)txm_arena_alloc(arena, g->limit, sizeof(txm_pair));
    if (!g->entry || !g->spare) return TXM_OUT_OF_MEMORY;
    do { /* use coarser cells if there are many large triangles */
        g->cell *= 2;
        g->count = 0;
        g->overflow = 0;
        for (int32_t f = 0; f < m->face_count && !g->overflow; f++) {
            if (tmr_is_dead(m, f) || tmr_is_ghost_face(m, f)) continue;
            if (nearby && !nearby[tmr_near_key(m->p[m->vertex[3 * f]], 3 * w->length, 0, 0, 0)])
                continue;
            tmr_cells_add(m, g, f);
        }
    } while (g->overflow);
    txm_sort_pairs(g->entry, g->spare, g->count);
    return TXM_OK;
}

/* Is this the cell in which the boxes of two triangles, with these low corners, overlap first? There
   are others, where the pair need not be looked at again. */
static int tmr_is_first_cell(const tmr_cells *g, uint32_t key, txm_dvec3 a, txm_dvec3 b) {
    return key == tmr_cell_key(tmr_cell_at(fmax(a.x, b.x), g->cell),
                               tmr_cell_at(fmax(a.y, b.y), g->cell),
                               tmr_cell_at(fmax(a.z, b.z), g->cell));
}

enum { TMR_COUNT_CROSSING, TMR_ANY_CROSSING, TMR_ANY_TOUCHING }; /* what tmr_count_crossings does */

/* Count the pairs of triangles that cross each other in *found, and mark their vertices in w->bad.
   near: where to look, as tmr_mark_near has it; NULL = everywhere. what: TMR_ANY_CROSSING stops at the
   first one, TMR_ANY_TOUCHING also at the first that touch. Linear in the number of triangles. */
static txm_status tmr_count_crossings(tmr_work *w, const uint8_t *nearby, int what,
                                      txm_arena *scratch, long *found) {
    const tmr_mesh *m = &w->m;
    const int rim = what == TMR_ANY_TOUCHING;
    const double slack = rim ? TMR_TOUCH : 0;
    tmr_cells g;
    *found = 0;
    if (tmr_tick(w, m->live)) return TXM_CANCELLED;
    const txm_status status = tmr_cells_make(w, nearby, &g, scratch);
    if (status != TXM_OK) return status;
    if (tmr_tick(w, m->live)) return TXM_CANCELLED;
    for (size_t i = 0; i < g.count;) {
        size_t end = i + 1;
        while (end < g.count && g.entry[end].key == g.entry[i].key) end++;
        if (tmr_tick(w, 1)) return TXM_CANCELLED;
        for (size_t x = i; x < end; x++) {
            const int32_t f = (int32_t)g.entry[x].value;
            txm_dvec3 low, high;
            tmr_face_box(m, f, &low, &high);
            for (size_t y = x + 1; y < end; y++) {
                const int32_t h = (int32_t)g.entry[y].value;
                txm_dvec3 low2, high2;
                if (f == h) continue;
                tmr_face_box(m, h, &low2, &high2);
                if (low.x > high2.x + slack || low2.x > high.x + slack ||
                    low.y > high2.y + slack || low2.y > high.y + slack ||
                    low.z > high2.z + slack || low2.z > high.z + slack)
                    continue;
                if (what != TMR_COUNT_CROSSING &&
                    !tmr_is_first_cell(&g, g.entry[i].key, low, low2))
                    continue;
                if (!tmr_faces_cross(m, f, h, rim) && !(rim && tmr_faces_touch(m, f, h))) continue;
                ++*found;
                if (what != TMR_COUNT_CROSSING) return TXM_OK;
                for (int k = 0; k < 3; k++)
                    w->bad[m->vertex[3 * f + k]] = w->bad[m->vertex[3 * h + k]] = 1;
            }
        }
        i = end;
    }
    return TXM_OK;
}

enum { TMR_SPOT_FACES = 256 }; /* of the surface that are looked at around one spot */

/* Does the surface face along n anywhere near the place? Looks at the faces that are connected to
   it within a ball around p. */
static int tmr_faces_along(const tmr_surface *s, txm_dvec3 n, int32_t face, txm_dvec3 p,
                           double radius) {
    int32_t list[TMR_SPOT_FACES];
    int count = 1;
    list[0] = face;
    for (int i = 0; i < count; i++) {
        if (txm_d3_dot(n, s->normal[list[i]]) > 0.3) return 1;
        for (int k = 0; k < 3 && count < TMR_SPOT_FACES; k++) {
            const int32_t o = s->opposite[3 * list[i] + k];
            int known = o < 0;
            for (int j = 0; j < count && !known; j++) known = list[j] == o / 3;
            if (known || tmr_on_face(s, o / 3, p).d2 > radius * radius) continue;
            list[count++] = o / 3;
        }
    }
    return 0;
}

/* Count the triangles that have no area, or whose normal is opposite to that of all of the surface
   nearby. Those that are only opposite to the nearest place, as happens on thin sheets, are counted
   in *doubtful. Marks their vertices. */
static long tmr_count_inverted(tmr_work *w, long *doubtful) {
    const tmr_mesh *m = &w->m;
    long found = 0;
    *doubtful = 0;
    for (int32_t f = 0; f < m->face_count; f++) {
        const int32_t *v = m->vertex + 3 * f;
        if (v[0] < 0 || tmr_is_ghost_face(m, f)) continue;
        const txm_dvec3 n = txm_d3_area2(m->p[v[0]], m->p[v[1]], m->p[v[2]]);
        const double longest =
            fmax(txm_d3_dist2(m->p[v[0]], m->p[v[1]]),
                 fmax(txm_d3_dist2(m->p[v[1]], m->p[v[2]]), txm_d3_dist2(m->p[v[2]], m->p[v[0]])));
        const double area2 = txm_d3_len(n);
        int turned = area2 < 1e-4 * longest, doubt = 0;
        if (!turned && tmr_agreement(w, v[0], v[1], v[2], m->p[v[0]], m->p[v[1]], m->p[v[2]]) < 0.2) {
            const tmr_place at = tmr_below_middle(w, v);
            doubt = txm_d3_dot(n, w->s->normal[at.face]) < 0 &&
                    txm_d3_dot(n, tmr_normal_at(w->s, w->l, &at)) < 0;
            turned = doubt && !tmr_faces_along(w->s, txm_d3_scale(n, 1 / area2), at.face,
                                               tmr_middle(m, v), sqrt(at.d2) + 0.45 * w->length);
        }
        if (!turned && !doubt) continue;
        found += turned;
        *doubtful += !turned;
        for (int k = 0; k < 3; k++) w->bad[v[k]] = 1;
    }
    return found;
}

/* Open folds, that is, edges at which two triangles nearly lie on each other (the mesh turns by
   more than 120 degrees): move such an edge towards the middle between the two far corners. Returns
   how many there were. */
static long tmr_open_folds(tmr_work *w, double share) {
    tmr_mesh *m = &w->m;
    long found = 0;
    for (int32_t v = 0; v < m->vertex_count; v++) {
        tmr_keep_place(w, v);
    }
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        if (!tmr_is_real_edge(m, c)) continue;
        const int32_t o = m->opposite[c], d = m->vertex[c], e = m->vertex[o];
        if (tmr_is_ghost(m, d) || tmr_is_ghost(m, e)) continue;
        const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
        const txm_dvec3 n = txm_d3_unit(txm_d3_area2(m->p[d], m->p[a], m->p[b]));
        if (txm_d3_dot(n, txm_d3_unit(txm_d3_area2(m->p[e], m->p[b], m->p[a]))) >= -0.47) continue;
        found++;
        const txm_dvec3 distant = txm_d3_scale(txm_d3_add(m->p[d], m->p[e]), 0.5);
        const txm_dvec3 nearby = txm_d3_scale(txm_d3_add(m->p[a], m->p[b]), 0.5);
        const txm_dvec3 to =
            txm_d3_scale(txm_d3_unit(txm_d3_sub(distant, nearby)), share * w->length);
        if (tmr_kind_of(m, a) == TRIMESH_FREE)
            w->moved[a] = txm_d3_add(w->moved[a], txm_d3_scale(to, w->size[a]));
        if (tmr_kind_of(m, b) == TRIMESH_FREE)
            w->moved[b] = txm_d3_add(w->moved[b], txm_d3_scale(to, w->size[b]));
    }
    if (found) tmr_settle(w);
    return found;
}

/* Extend the marks in w->bad to all neighbours of marked vertices. */
static void tmr_grow_marks(tmr_work *w) {
    const tmr_mesh *m = &w->m;
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        if (m->vertex[c] < 0) continue;
        const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
        if (w->bad[a] == 1 && !w->bad[b]) w->bad[b] = 2;
        if (w->bad[b] == 1 && !w->bad[a]) w->bad[a] = 2;
    }
    for (int32_t v = 0; v < m->vertex_count; v++) w->bad[v] = w->bad[v] != 0;
}

/* Move every marked vertex half-way to the mean of its neighbours, off the surface: detail that is
   too fine for the triangles is smoothed away there. Creases are moved only if lines_too is set. */
static void tmr_smooth_marked(tmr_work *w, int lines_too) {
    tmr_mesh *m = &w->m;
    for (int32_t v = 0; v < m->vertex_count; v++) {
        const int kind = tmr_kind_of(m, v);
        if (!w->bad[v] || m->corner[v] < 0 || (m->flags[v] & (TMR_GHOST | TMR_PINNED))) continue;
        if (kind == TRIMESH_BORDER || (kind != TRIMESH_FREE && !lines_too)) continue;
        txm_dvec3 sum = txm_d3(0, 0, 0);
        int32_t count = 0, c = m->corner[v];
        const int32_t first = c;
        do {
            const int32_t to = m->vertex[tmr_next(c)];
            if (!tmr_is_ghost(m, to)) {
                sum = txm_d3_add(sum, m->p[to]);
                count++;
            }
            c = tmr_swing(m, c);
        } while (c != first);
        if (count == 0) continue;
        m->p[v] = txm_d3_add(txm_d3_scale(m->p[v], 0.5), txm_d3_scale(sum, 0.5 / count));
        if (kind != TRIMESH_FREE) continue;
        const tmr_place at = tmr_project(w->s, m->p[v], m->source[v]);
        m->source[v] = at.face;
    }
}

#define TMR_FAIR 0.85 /* ours: quality of triangles that gets no further attention */

/* More rounds of relaxation and flips around the triangles that are still poor. */
static txm_status tmr_improve_spots(tmr_work *w, int rounds) {
    tmr_mesh *m = &w->m;
    w->pull = w->step = 1;
    for (int round = 0; round < rounds; round++) {
        int32_t poor = 0;
        memset(w->bad, 0, (size_t)m->vertex_count);
        for (int32_t f = 0; f < m->face_count; f++) {
            const int32_t *v = m->vertex + 3 * f;
            if (v[0] < 0 || tmr_is_ghost_face(m, f)) continue;
            if (tmr_quality(m->p[v[0]], m->p[v[1]], m->p[v[2]],
                            tmr_expected_normal(w, v[0], v[1], v[2])) >= TMR_FAIR)
                continue;
            poor++;
            for (int k = 0; k < 3; k++) w->bad[v[k]] = 1;
        }
        if (poor == 0) break;
        for (int k = 0; k < 3; k++) tmr_grow_marks(w);
        memcpy(w->mask_room, w->bad, (size_t)m->vertex_count);
        w->mask = w->mask_room;
        for (int k = 0; k < 3; k++) tmr_relax(w);
        w->mask = NULL;
        if (tmr_tick(w, m->live)) return TXM_CANCELLED;
        tmr_flip_valences(w, 2, 0.4);
        tmr_flip_delaunay(w, 2);
        if (tmr_tick(w, m->live)) return TXM_CANCELLED;
    }
    return TXM_OK;
}

enum { TMR_SPOT_ROUNDS = 16 };

/* Smooth around the spots where triangles cross or are inverted, in growing neighbourhoods; the
   best state found stays. *faults receives how many are left. */
static txm_status tmr_mend_spots(tmr_work *w, long *faults) {
    const size_t count = (size_t)w->m.vertex_count;
    txm_arena arena;
    long best = -1;
    txm_dvec3 *kept = NULL;
    int32_t *kept_source = NULL;
    txm_arena_init(&arena, w->env);
    uint8_t *nearby = (uint8_t *)txm_arena_alloc(&arena, TMR_NEAR_CELLS, 1);
    txm_status status = tmr_check_memory(&arena);
    for (int round = 0; round <= TMR_SPOT_ROUNDS && status == TXM_OK; round++) {
        txm_arena scratch;
        long crossings, doubtful;
        if (round > 0) tmr_mark_near(w, nearby); /* w->bad: what was moved */
        memset(w->bad, 0, count);
        txm_arena_init(&scratch, w->env);
        status = tmr_count_crossings(w, round > 0 ? nearby : NULL, TMR_COUNT_CROSSING, &scratch,
                                     &crossings);
        txm_arena_free(&scratch);
        if (status != TXM_OK) break;
        if (tmr_tick(w, w->m.live)) {
            status = TXM_CANCELLED;
            break;
        }
        const long turned = tmr_count_inverted(w, &doubtful);
        const long score = 1000 * (crossings + turned) + doubtful;
        if (best < 0 || score < best) {
            if (score > 0 && !kept) {
                kept = (txm_dvec3 *)txm_arena_alloc(&arena, count, sizeof(txm_dvec3));
                kept_source = (int32_t *)txm_arena_alloc(&arena, count, sizeof(int32_t));
                if ((status = tmr_check_memory(&arena)) != TXM_OK) break;
            }
            best = score;
            if (kept) memcpy(kept, w->m.p, count * sizeof(txm_dvec3));
            if (kept) memcpy(kept_source, w->m.source, count * sizeof(int32_t));
        }
        if (score == 0 || (best < 1000 && round >= 4)) break;
        if (50 * (crossings + turned) > (long)w->m.live_faces + 2000) break; /* too many to mend */
        for (int k = 0; k < 1 + round / 6; k++) tmr_grow_marks(w);
        tmr_smooth_marked(w, round >= 6);
    }
    if (status == TXM_OK && best > 0) {
        memcpy(w->m.p, kept, count * sizeof(txm_dvec3));
        memcpy(w->m.source, kept_source, count * sizeof(int32_t));
    }
    *faults = best / 1000;
    txm_arena_free(&arena);
    return status;
}

#endif /* TRIMESH_RELAX_VALIDITY_H */
