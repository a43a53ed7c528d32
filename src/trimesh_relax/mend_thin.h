#ifndef TRIMESH_RELAX_MEND_THIN_H
#define TRIMESH_RELAX_MEND_THIN_H

#include "surface.h"
#include "mend_turn.h"

/* ---- mending: triangles without area ------------------------------------------------------ */

/* Without area there are needles, with two corners in almost one place, and caps, with a corner
   almost on the edge opposite to it:

         ._____________            ___.___
         '-------------         .-----'-----.          a T-junction is filled with a cap: its long
         needle: collapse       cap: flip             edge is flipped, and both halves have area */
static int tmr_is_needle(const tmr_mend *m, int32_t f, int32_t *shortest, int32_t *longest) {
    double least = 0, most = 0;
    txm_dvec3 p[3];
    tmr_face_points(m, f, p);
    for (int32_t k = 0; k < 3; k++) {
        const double length = txm_d3_dist(p[(k + 1) % 3], p[(k + 2) % 3]);
        if (k == 0 || length < least) {
            least = length;
            *shortest = 3 * f + k;
        }
        if (k == 0 || length > most) {
            most = length;
            *longest = 3 * f + k;
        }
    }
    return least <= 1e-6 * most || (least <= m->noise && least <= 1e-3 * most);
}

/* The corners at the vertex of c, and its neighbours: as many, or on the border (*open) one more.
   Returns how many corners, or 0 if they are more than TMR_FAN_LIMIT. */
static int32_t tmr_ring(const tmr_mend *m, int32_t c, int32_t *corner, int32_t *around, int *open) {
    int32_t n = 0, k = c;
    for (int32_t back = tmr_cw(m->opposite, c); back >= 0 && back != c; n++) {
        if (n == TMR_FAN_LIMIT) return 0;
        k = back;
        back = tmr_cw(m->opposite, back);
    }
    *open = tmr_cw(m->opposite, k) < 0;
    c = k; /* first of the fan, or any */
    for (n = 0; k >= 0 && (n == 0 || k != c); k = tmr_ccw(m->opposite, k)) {
        if (n == TMR_FAN_LIMIT) return 0;
        around[n] = m->vertex[tmr_next(k)];
        corner[n++] = k;
    }
    if (*open) around[n] = m->vertex[tmr_prev(corner[n - 1])];
    return n;
}

static int tmr_has_neighbor(const tmr_mend *m, int32_t c, int32_t v) {
    int32_t corner[TMR_FAN_LIMIT], around[TMR_FAN_LIMIT + 1];
    int open = 0;
    const int32_t n = tmr_ring(m, c, corner, around, &open);
    for (int32_t k = 0; k < n + open; k++) {
        if (around[k] == v) return 1;
    }
    return n == 0; /* too many to look at: "yes" prevents the flip       */
}

static void tmr_join(tmr_mend *m, int32_t a, int32_t b) {
    m->opposite[a] = b;
    if (b >= 0) m->opposite[b] = a;
}

/* Height over longest edge. */
static double tmr_slimness(txm_dvec3 a, txm_dvec3 b, txm_dvec3 c) {
    const double longest2 = fmax(txm_d3_dist2(a, b), fmax(txm_d3_dist2(b, c), txm_d3_dist2(c, a)));
    return longest2 > 0 ? txm_d3_len(txm_d3_area2(a, b, c)) / longest2 : 0;
}

/* Flip the edge of corner c if the worse of the two triangles gets better and none is inverted. As
   this triangle has no area, both new ones lie in the triangle beyond. */
static int tmr_flip_thin(tmr_mend *m, int32_t c) {
    const int32_t o = m->opposite[c];
    if (o < 0 || m->vertex[o] == m->vertex[c]) return 0;
    const int32_t next = tmr_next(c), prev = tmr_prev(c), beyond = tmr_next(o);
    const txm_dvec3 p = m->point[m->vertex[c]], q = m->point[m->vertex[o]];
    const txm_dvec3 a = m->point[m->vertex[next]], b = m->point[m->vertex[prev]];
    const txm_dvec3 n = txm_d3_add(txm_d3_area2(p, a, b), txm_d3_area2(q, b, a));
    const double before = fmin(tmr_slimness(p, a, b), tmr_slimness(q, b, a));
    const double after = fmin(tmr_slimness(p, a, q), tmr_slimness(q, b, p));
    if (!(after > before) || !(txm_d3_dot(txm_d3_area2(p, a, q), n) >= 0) ||
        !(txm_d3_dot(txm_d3_area2(q, b, p), n) >= 0) || tmr_has_neighbor(m, c, m->vertex[o]))
        return 0;
    const int32_t aq = m->opposite[beyond], bp = m->opposite[next];
    m->vertex[prev] = m->vertex[o];
    m->vertex[tmr_prev(o)] = m->vertex[c];
    tmr_join(m, c, aq);
    tmr_join(m, o, bp);
    tmr_join(m, next, beyond);
    m->origin[c / 3] = m->origin[o / 3];
    m->turn[c / 3] = m->turn[o / 3] = TMR_MAPPED;
    return 1;
}

/* Detach a face and flag it for removal. */
static void tmr_drop_face(tmr_mend *m, int32_t f) {
    for (int32_t c = 3 * f; c < 3 * f + 3; c++) {
        if (m->opposite[c] >= 0) m->opposite[m->opposite[c]] = -1;
        m->opposite[c] = -1;
    }
    m->flag[f] = 1;
}

/* Flip the longest edge of a thin face, or remove the face if that edge is on the border. Needles
   are left as they are. Returns non-zero if something changed. */
static int tmr_flip_cap(tmr_mend *m, int32_t f) {
    int32_t shortest = 0, longest = 0;
    if (m->flag[f] || !tmr_face_is_thin(m, f) || tmr_is_needle(m, f, &shortest, &longest)) return 0;
    if (m->opposite[longest] < 0) {
        tmr_drop_face(m, f);
        return 1;
    }
    if (!tmr_flip_thin(m, longest)) return 0;
    m->report.degenerate++;
    return 1;
}

/* Go over the count thin faces of m->list, back and forth, so that a row of them along one edge is
   undone from either end. m->list keeps those that are still thin. Returns how many. */
static int32_t tmr_flip_caps(tmr_mend *m, int32_t count) {
    int done = 1;
    for (int sweep = 0; done && sweep < TMR_FLIP_SWEEPS; sweep++) {
        int32_t kept = 0;
        done = 0;
        for (int32_t i = 0; i < count; i++)
            done |= tmr_flip_cap(m, m->list[sweep % 2 ? count - 1 - i : i]);
        for (int32_t i = 0; i < count; i++) {
            const int32_t f = m->list[i];
            if (!m->flag[f] && tmr_face_is_thin(m, f)) m->list[kept++] = f;
        }
        count = kept;
    }
    return count;
}

/* Would moving the vertex of these corners to point p invert a face that has an area? */
static int tmr_move_inverts(const tmr_mend *m, const int32_t *corner, int32_t n, int32_t other,
                            txm_dvec3 p) {
    for (int32_t k = 0; k < n; k++) {
        const int32_t i = m->vertex[tmr_next(corner[k])], j = m->vertex[tmr_prev(corner[k])];
        if (i == other || j == other || tmr_face_is_thin(m, corner[k] / 3)) continue;
        const txm_dvec3 before =
            txm_d3_area2(m->point[m->vertex[corner[k]]], m->point[i], m->point[j]);
        if (!(txm_d3_dot(txm_d3_area2(p, m->point[i], m->point[j]), before) > 0)) return 1;
    }
    return 0;
}

/* Merge the ends of the edge of corner c, if that leaves a manifold: their only common neighbours
   are the apices of the edge's faces, and the edge does not join two borders. Neighbours are not
   touched for the rest of the round (degree 0). */
static int tmr_collapse_needle(tmr_mend *m, int32_t c, int32_t stamp) {
    int32_t from[TMR_FAN_LIMIT], to[TMR_FAN_LIMIT], near_from[TMR_FAN_LIMIT + 1];
    int32_t near_to[TMR_FAN_LIMIT + 1], common = 0, u = m->vertex[tmr_next(c)];
    int open_u = 0, open_v = 0;
    const int32_t v = m->vertex[tmr_prev(c)];
    const int32_t nu = tmr_ring(m, tmr_next(c), to, near_to, &open_u);
    const int32_t nv = tmr_ring(m, tmr_prev(c), from, near_from, &open_v);
    /* also for vertices with several fans, and for long rings */
    if (nu == 0 || nv == 0 || nu != m->degree[u] || nv != m->degree[v]) return 0;
    if (m->opposite[c] >= 0 && open_u && open_v) return 0;
    if (!open_u && !open_v && (nu == 3 || nv == 3)) return 0; /* might be a tetrahedron */
    for (int32_t k = 0; k < nu + open_u; k++) m->stamp[near_to[k]] = stamp;
    for (int32_t k = 0; k < nv + open_v; k++) common += m->stamp[near_from[k]] == stamp;
    if (common != (m->opposite[c] >= 0 ? 2 : 1)) return 0;
    /* the border stays where it is; else the lower number stays */
    const int keep_u = open_u != open_v ? open_u : u < v;
    if (keep_u ? tmr_move_inverts(m, from, nv, u, m->point[u])
               : tmr_move_inverts(m, to, nu, v, m->point[v]))
        return 0;
    m->rename[keep_u ? v : u] = keep_u ? u : v;
    for (int32_t k = 0; k < nu + open_u; k++) m->degree[near_to[k]] = 0;
    for (int32_t k = 0; k < nv + open_v; k++) m->degree[near_from[k]] = 0;
    return 1;
}

/* Choose and collapse needles among the count faces of m->list. Returns how many. Opposites must be
   found again afterwards. */
static int32_t tmr_collapse_needles(tmr_mend *m, int32_t count) {
    int32_t done = 0, shortest = 0, longest = 0;
    for (int32_t i = 0; i < m->vertex_count; i++) {
        m->rename[i] = i;
        m->degree[i] = 0;
        m->stamp[i] = -1;
    }
    for (int32_t c = 0; c < 3 * m->face_count; c++) m->degree[m->vertex[c]] += !m->flag[c / 3];
    for (int32_t i = 0; i < count; i++) {
        if (tmr_is_needle(m, m->list[i], &shortest, &longest))
            done += tmr_collapse_needle(m, shortest, i);
    }
    for (int32_t c = 0; c < 3 * m->face_count && done; c++) m->vertex[c] = m->rename[m->vertex[c]];
    return done;
}

/* Flip and collapse until no face without area is left, or nothing changes. */
static txm_status tmr_mend_thin(tmr_mend *m) {
    txm_status status = TXM_OK;
    for (int round = 0; status == TXM_OK && round < TMR_MEND_ROUNDS; round++) {
        int32_t count = 0;
        for (int32_t f = 0; f < m->face_count; f++) {
            m->flag[f] = 0;
            if (tmr_face_is_thin(m, f)) m->list[count++] = f;
        }
        if (count == 0) break;
        if (count == m->face_count)
            return txm_fail(m->env, TXM_TOO_SMALL, "the surface has no area");
        count = tmr_flip_caps(m, count);
        const int32_t collapsed = count > 0 ? tmr_collapse_needles(m, count) : 0;
        const size_t cut = tmr_cut_flagged(m);
        m->report.degenerate += cut;
        if (collapsed == 0 && cut == 0) break;
        status = tmr_mend_faces(m);
    }
    return status;
}

/* ---- mending: vertices where fans meet, and numbering ------------------------------------- */

/* Mark the fan around the vertex of corner c as seen, and set its vertex to v unless that is
   negative. Returns the first corner counter-clockwise, which has the border on its right; without
   border c. */
static int32_t tmr_mark_fan(tmr_mend *m, int32_t c, uint8_t *seen, int32_t v) {
    int32_t first = c;
    for (int32_t k = c; k >= 0;) {
        seen[k] = 1;
        if (v >= 0) m->vertex[k] = v;
        k = tmr_ccw(m->opposite, k);
        if (k == c) return c;
    }
    for (int32_t k = tmr_cw(m->opposite, c); k >= 0; k = tmr_cw(m->opposite, k)) {
        seen[k] = 1;
        if (v >= 0) m->vertex[k] = v;
        first = k;
    }
    return first;
}

/* Count the fans; set degree = 1 for vertices in use. */
static int32_t tmr_count_fans(tmr_mend *m, uint8_t *seen) {
    int32_t fans = 0;
    memset(m->degree, 0, (size_t)m->vertex_count * sizeof *m->degree);
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        if (seen[c]) continue;
        m->degree[m->vertex[c]] = 1;
        tmr_mark_fan(m, c, seen, -1);
        fans++;
    }
    return fans;
}

/* Number the vertices in use in the caller's order, one per fan; further fans of a vertex come
   after all others. Fills corner, point and scale of the surface. */
static void tmr_number_fans(tmr_mend *m, tmr_surface *s, uint8_t *seen) {
    int32_t used = 0;
    for (int32_t i = 0; i < m->vertex_count; i++) m->rename[i] = m->degree[i] ? used++ : -1;
    m->report.split = (size_t)(s->vertex_count - used);
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        if (seen[c]) continue;
        const int32_t old = m->vertex[c];
        int32_t v = used;
        if (m->degree[old]) {
            m->degree[old] = 0;
            v = m->rename[old];
        } else used++;
        TRIMESH_ASSERT(v < s->vertex_count); /* as many as tmr_count_fans has counted */
        s->point[v] = m->point[old];
        if (s->scale) s->scale[v] = m->desc->scale[old];
        s->corner[v] = tmr_mark_fan(m, c, seen, v);
    }
}

/* Store the mended faces in the surface, with vertices split and numbered. */
static txm_status tmr_mend_finish(tmr_mend *m, txm_arena *arena, tmr_surface *s) {
    const size_t f = (size_t)m->face_count;
    s->face_count = m->face_count;
    s->vertex = m->vertex;
    s->opposite = m->opposite;
    s->origin = m->origin;
    s->turn = m->turn;
    s->centre = m->centre;
    s->diagonal = m->diagonal;
    s->edge_kind = (uint8_t *)txm_arena_zero(arena, 3 * f, 1);
    if (!s->edge_kind) return txm_fail(m->env, TXM_OUT_OF_MEMORY, "no memory for the surface");
    /* edge_kind, which is not needed yet, marks the corners that were visited */
    s->vertex_count = tmr_count_fans(m, s->edge_kind);
    const size_t v = (size_t)s->vertex_count;
    s->point = (txm_dvec3 *)txm_arena_alloc(arena, v, sizeof(txm_dvec3));
    s->corner = (int32_t *)txm_arena_alloc(arena, v, sizeof(int32_t));
    if (m->desc->scale) s->scale = (float *)txm_arena_alloc(arena, v, sizeof(float));
    if (arena->failed) return txm_fail(m->env, TXM_OUT_OF_MEMORY, "no memory for the surface");
    memset(s->edge_kind, 0, 3 * f);
    tmr_number_fans(m, s, s->edge_kind);
    for (size_t c = 0; c < 3 * f; c++)
        s->edge_kind[c] = (uint8_t)(s->opposite[c] < 0 ? TMR_BORDER_EDGE : TMR_PLAIN_EDGE);
    for (size_t i = 0; i < f; i++) m->report.turned += (s->turn[i] & 4) != 0;
    m->report.vertices = v;
    m->report.triangles = f;
    return TXM_OK;
}

#endif /* TRIMESH_RELAX_MEND_THIN_H */
