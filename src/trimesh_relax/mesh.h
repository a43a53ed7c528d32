#ifndef TRIMESH_RELAX_MESH_H
#define TRIMESH_RELAX_MESH_H

#include "config.h"

/* ---- the mesh that changes ---------------------------------------------------------------- */

/* Flags of a vertex besides the trimesh_kind in the lowest two bits. */
enum {
    TMR_KIND = 3,
    TMR_GHOST = 4,
    TMR_MARK = 8,
    TMR_PINNED = 16 /* for updates: this vertex, and edges between such, must stay      */
};

enum { TMR_VALENCE = 60 }; /* no operation gives a vertex more neighbours               */

/* A closed manifold at every moment: each border loop is closed by a ghost vertex joined to all of
   the loop, so that the operators need no special case for borders. Corners as in tmr_surface; a
   dead triangle has vertex -1 in its first corner, a dead vertex corner -1.

                        ghost
                       /  |  \          ghost triangles, which stay out of all geometry
                 -----a---b---c-----    the border, each with the number of its line            */
typedef struct tmr_mesh {
    int32_t vertex_count, face_count; /* slots in use, including dead ones                      */
    int32_t vertex_limit, face_limit; /* slots allocated                                        */
    int32_t live, ghosts;             /* live vertices without ghosts; ghosts                   */
    int32_t live_faces;               /* live triangles, including ghost triangles              */
    txm_dvec3 *p;                     /* position                                               */
    txm_dvec3 *n;                     /* normal of the surface there, smooth                    */
    int32_t *source; /* face of the surface that p lies in; of a vertex on a line its segment;
                        of a vertex that never moves: its vertex of the surface                */
    int32_t *corner;                  /* one corner                                             */
    uint8_t *flags;
    int32_t *valence; /* neighbours, including ghosts                                           */
    int32_t *vertex, *opposite; /* of corners                                                   */
    int32_t *edge;              /* of corners: 0, or 1 + the line that their edge is part of    */
} tmr_mesh;

/* the corner at the same vertex in the next triangle counter-clockwise */
static int32_t tmr_swing(const tmr_mesh *m, int32_t c) {
    return tmr_next(m->opposite[tmr_next(c)]);
}
static int tmr_is_dead(const tmr_mesh *m, int32_t face) {
    return m->vertex[3 * face] < 0;
}
static int tmr_is_ghost(const tmr_mesh *m, int32_t v) {
    return m->flags[v] & TMR_GHOST;
}
static int tmr_is_ghost_face(const tmr_mesh *m, int32_t face) {
    const int32_t *v = m->vertex + 3 * face;
    return (m->flags[v[0]] | m->flags[v[1]] | m->flags[v[2]]) & TMR_GHOST;
}
static int tmr_kind_of(const tmr_mesh *m, int32_t v) {
    return m->flags[v] & TMR_KIND;
}

static void tmr_link(tmr_mesh *m, int32_t a, int32_t b, int32_t line) {
    m->opposite[a] = b;
    m->opposite[b] = a;
    m->edge[a] = m->edge[b] = line;
}
/* the corner at a of the triangle in which b comes next; -1 if a and b are not neighbours */
static int32_t tmr_find_edge(const tmr_mesh *m, int32_t a, int32_t b) {
    const int32_t first = m->corner[a];
    int32_t c = first;
    do {
        if (m->vertex[tmr_next(c)] == b) return c;
        c = tmr_swing(m, c);
    } while (c != first);
    return -1;
}

/* Are a and b neighbours? Looks around the one that is not a ghost. */
static int tmr_are_neighbors(const tmr_mesh *m, int32_t a, int32_t b) {
    if (tmr_is_ghost(m, a)) return tmr_is_ghost(m, b) ? 0 : tmr_find_edge(m, b, a) >= 0;
    return tmr_find_edge(m, a, b) >= 0;
}

/* May the edge opposite to c be flipped? Looks at the topology only. */
static int tmr_can_flip(const tmr_mesh *m, int32_t c) {
    const int32_t o = m->opposite[c], d = m->vertex[c], e = m->vertex[o];
    const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
    if (m->edge[c] != 0) return 0;
    if ((m->flags[a] | m->flags[b] | m->flags[d] | m->flags[e]) & TMR_GHOST) return 0;
    if (m->flags[a] & m->flags[b] & m->flags[d] & m->flags[e] & TMR_PINNED) return 0;
    if (m->valence[a] <= 3 || m->valence[b] <= 3) return 0;
    if (m->valence[d] >= TMR_VALENCE || m->valence[e] >= TMR_VALENCE) return 0;
    return !tmr_are_neighbors(m, d, e);
}

/* Flip the edge opposite to c:

          d (c)                 d
         /   \                / | \
        a --- b     ->       a  |  b
         \   /                \ | /
          e (o)                 e                                                              */
static void tmr_flip(tmr_mesh *m, int32_t c) {
    const int32_t o = m->opposite[c];
    const int32_t cn = tmr_next(c), cp = tmr_prev(c), on = tmr_next(o), op = tmr_prev(o);
    const int32_t a = m->vertex[cn], b = m->vertex[cp], d = m->vertex[c], e = m->vertex[o];
    /* outer edges: opposite to cn is b d, to cp is d a, to on is a e, to op is e b */
    const int32_t bd = m->opposite[cn], ae = m->opposite[on];
    const int32_t bd_line = m->edge[cn], ae_line = m->edge[on];
    /* c's triangle becomes d a e: c = d, cn = a, cp = e; o's becomes e b d */
    m->vertex[cp] = e;
    m->vertex[op] = d;
    /* in (d, a, e): opposite to d is a e, to a is e d, to e is d a (as before) */
    tmr_link(m, c, ae, ae_line);
    tmr_link(m, o, bd, bd_line);
    tmr_link(m, cn, on, 0);
    m->corner[a] = cn;
    m->corner[b] = on;
    m->corner[d] = c;
    m->corner[e] = o;
    m->valence[a]--;
    m->valence[b]--;
    m->valence[d]++;
    m->valence[e]++;
}

static int32_t tmr_new_vertex(tmr_mesh *m) {
    const int32_t v = m->vertex_count++;
    m->live++;
    return v;
}

/* Put a new vertex on the edge opposite to c, without its geometry. Returns -1 if there is no room.

          d (c)                 d
         /   \                / | \
        a --- b     ->       a--v--b
         \   /                \ | /
          e (o)                 e                                                              */
static int32_t tmr_split(tmr_mesh *m, int32_t c) {
    if (m->vertex_count >= m->vertex_limit || m->face_count + 2 > m->face_limit) return -1;
    const int32_t o = m->opposite[c], kind = m->edge[c];
    const int32_t cn = tmr_next(c), op = tmr_prev(o);
    const int32_t b = m->vertex[tmr_prev(c)], d = m->vertex[c], e = m->vertex[o];
    const int32_t v = tmr_new_vertex(m), f = 3 * m->face_count, g = f + 3;
    const int32_t bd = m->opposite[cn], eb = m->opposite[op];
    const int32_t bd_line = m->edge[cn], eb_line = m->edge[op];
    m->face_count += 2;
    m->live_faces += 2;
    /* c's triangle (d, a, b) becomes (d, a, v), o's (e, b, a) becomes (e, v, a);
       new ones f = (d, v, b) and g = (e, b, v) */
    m->vertex[f] = d;
    m->vertex[f + 1] = v;
    m->vertex[f + 2] = b;
    m->vertex[g] = e;
    m->vertex[g + 1] = b;
    m->vertex[g + 2] = v;
    m->vertex[tmr_prev(c)] = v;
    m->vertex[tmr_next(o)] = v;
    tmr_link(m, c, o, kind);
    tmr_link(m, f, g, kind);
    tmr_link(m, f + 1, bd, bd_line); /* opposite to v in f: b d */
    tmr_link(m, g + 2, eb, eb_line); /* opposite to v in g: e b */
    tmr_link(m, f + 2, cn, 0); /* opposite to b in f: d v; to a in c's triangle: v d */
    tmr_link(m, g + 1, op, 0); /* opposite to b in g: v e; to a in o's triangle: e v */
    m->corner[v] = f + 1;
    m->corner[b] = f + 2;
    m->corner[d] = c;
    m->corner[e] = o;
    m->corner[m->vertex[cn]] = cn;
    m->valence[v] = 4;
    m->flags[v] = 0;
    m->valence[d]++;
    m->valence[e]++;
    return v;
}

/* Put a new vertex into a triangle, without its geometry. Returns -1 if there is no room. */
static int32_t tmr_split_face(tmr_mesh *m, int32_t face) {
    if (m->vertex_count >= m->vertex_limit || m->face_count + 2 > m->face_limit) return -1;
    const int32_t i = 3 * face, f = 3 * m->face_count, g = f + 3;
    const int32_t a = m->vertex[i], b = m->vertex[i + 1], c = m->vertex[i + 2];
    const int32_t v = tmr_new_vertex(m);
    const int32_t ca = m->opposite[i + 1], ab = m->opposite[i + 2];
    const int32_t ca_line = m->edge[i + 1], ab_line = m->edge[i + 2];
    m->face_count += 2;
    m->live_faces += 2;
    /* (a, b, c) becomes (v, b, c); new ones f = (a, v, c), g = (a, b, v) */
    m->vertex[i] = v;
    m->vertex[f] = a;
    m->vertex[f + 1] = v;
    m->vertex[f + 2] = c;
    m->vertex[g] = a;
    m->vertex[g + 1] = b;
    m->vertex[g + 2] = v;
    tmr_link(m, f + 1, ca, ca_line);
    tmr_link(m, g + 2, ab, ab_line);
    tmr_link(m, f, i + 1, 0);     /* v c */
    tmr_link(m, f + 2, g + 1, 0); /* a v */
    tmr_link(m, g, i + 2, 0);     /* b v */
    m->corner[v] = i;
    m->corner[a] = f;
    m->corner[b] = i + 1;
    m->corner[c] = i + 2;
    m->valence[v] = 3;
    m->flags[v] = 0;
    m->valence[a]++;
    m->valence[b]++;
    m->valence[c]++;
    return v;
}

/* May b = vertex[prev(c)] be merged into a = vertex[next(c)], so that the mesh stays a manifold of
   the same topology, with the same creases and borders? The link condition: a and b have only the
   two neighbours d and e in common. Costs O(valence). */
static int tmr_can_collapse(tmr_mesh *m, int32_t c) {
    const int32_t o = m->opposite[c], cn = tmr_next(c), cp = tmr_prev(c);
    const int32_t a = m->vertex[cn], b = m->vertex[cp], d = m->vertex[c], e = m->vertex[o];
    const int on = m->edge[c] != 0, kind = tmr_kind_of(m, b);
    int common = 0;
    if ((m->flags[a] | m->flags[b]) & TMR_GHOST) return 0;
    if (kind == TRIMESH_CORNER || ((m->flags[a] | m->flags[b]) & TMR_PINNED)) return 0;
    if (kind != TRIMESH_FREE && !on) return 0;
    /* two lines must not become one: d's two sides merge */
    if (m->edge[cn] != 0 && m->edge[cp] != 0) return 0;
    if (m->edge[tmr_next(o)] != 0 && m->edge[tmr_prev(o)] != 0) return 0;
    if (m->valence[d] <= 3 || m->valence[e] <= 3) return 0;
    if (m->valence[a] + m->valence[b] - 4 > TMR_VALENCE) return 0;
    int32_t i = cn;
    do {
        m->flags[m->vertex[tmr_next(i)]] |= TMR_MARK;
        i = tmr_swing(m, i);
    } while (i != cn);
    i = cp;
    do {
        common += (m->flags[m->vertex[tmr_next(i)]] & TMR_MARK) != 0;
        i = tmr_swing(m, i);
    } while (i != cp);
    i = cn;
    do {
        m->flags[m->vertex[tmr_next(i)]] &= (uint8_t)~TMR_MARK;
        i = tmr_swing(m, i);
    } while (i != cn);
    return common == 2;
}

static void tmr_kill_face(tmr_mesh *m, int32_t face) {
    for (int k = 0; k < 3; k++) m->vertex[3 * face + k] = -1;
    m->live_faces--;
}

/* Merge b = vertex[prev(c)] into a = vertex[next(c)]; a keeps its place. */
static void tmr_collapse(tmr_mesh *m, int32_t c) {
    const int32_t o = m->opposite[c], cn = tmr_next(c), cp = tmr_prev(c);
    const int32_t on = tmr_next(o), op = tmr_prev(o);
    const int32_t a = m->vertex[cn], b = m->vertex[cp], d = m->vertex[c], e = m->vertex[o];
    const int32_t bd = m->opposite[cn], da = m->opposite[cp]; /* beyond the edges b d, d a */
    const int32_t ae = m->opposite[on], eb = m->opposite[op];
    const int32_t line_d = m->edge[cn] ? m->edge[cn] : m->edge[cp];
    const int32_t line_e = m->edge[on] ? m->edge[on] : m->edge[op];
    int32_t i = cp;
    do { /* b's corners become a's */
        m->vertex[i] = a;
        i = tmr_swing(m, i);
    } while (i != cp);
    tmr_kill_face(m, c / 3);
    tmr_kill_face(m, o / 3);
    tmr_link(m, bd, da, line_d);
    tmr_link(m, ae, eb, line_e);
    m->corner[b] = -1;
    m->live--;
    m->corner[a] = tmr_next(da);
    m->corner[d] = tmr_prev(da);
    m->corner[e] = tmr_next(ae);
    m->valence[a] += m->valence[b] - 4;
    m->valence[d]--;
    m->valence[e]--;
}

#endif /* TRIMESH_RELAX_MESH_H */
