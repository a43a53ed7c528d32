#ifndef TRIMESH_RELAX_TRIAL_H
#define TRIMESH_RELAX_TRIAL_H

#include "collapse.h"

/* ---- operations on trial ------------------------------------------------------------------ */

/* What a triangle lacks to an equilateral one of the wanted size:

       1 / q - 1 + s (x + 1 / x - 2),   q = 4 sqrt(3) area / (sum of the squared sides),
                                        x = area / wanted area

   0 for the wanted triangle; near it, twice the square of its shear and s times the square of the
   error of its area; without bound towards a degenerate one. A triangle that disagrees with the
   surface costs so much that no gain elsewhere outweighs it. */
#define TMR_STRAIN_OF_SIZE 0.25 /* ours: s                                                      */
#define TMR_STRAIN_OF_WANTED 1  /* ours: s where the caller wants different sizes               */
#define TMR_STRAIN_OF_FOLD 1000 /* ours: of a triangle that disagrees with the surface          */

static double tmr_strain(const tmr_work *w, int32_t face) {
    const tmr_mesh *m = &w->m;
    const int32_t *v = m->vertex + 3 * face;
    if (v[0] < 0 || tmr_is_ghost_face(m, face)) return 0;
    const txm_dvec3 a = m->p[v[0]], b = m->p[v[1]], c = m->p[v[2]], cross = txm_d3_area2(a, b, c);
    const double area2 = txm_d3_dot(cross, tmr_expected_normal(w, v[0], v[1], v[2]));
    const double q = 3.4641016151377544 * area2 /
                     (txm_d3_dist2(a, b) + txm_d3_dist2(b, c) + txm_d3_dist2(c, a));
    if (!(q > 0.05) || area2 * area2 < TMR_LEAST_AGREEMENT * TMR_LEAST_AGREEMENT * txm_d3_len2(cross))
        return TMR_STRAIN_OF_FOLD;
    const double size = w->length * (w->size[v[0]] + (double)w->size[v[1]] + w->size[v[2]]) / 3;
    const double x = area2 / (0.86602540378443865 * size * size);
    return 1 / q - 1 + (tmr_wants_sizes(w) ? TMR_STRAIN_OF_WANTED : TMR_STRAIN_OF_SIZE) * (x + 1 / x - 2);
}

/* The part of the mesh around an edge, as it was before a trial: the ends of the edge and the two
   vertices opposite to it, a ring of vertices around these four, which may move, and the rim, which
   stays. All triangles of vertices that may move belong to it, so nothing else can change. A trial that
   promises well goes on in a patch that is one ring wider.

   On a regular mesh there are 4 + 10 + 16 vertices and 46 triangles, or 52 and 82 in the wider one. A
   larger patch than fits is not tried. */
enum { TMR_PATCH_VERTICES = 160, TMR_PATCH_FACES = 280 };

typedef struct tmr_patch_vertex {
    txm_dvec3 p, n;
    int32_t vertex, source, corner, valence;
    float size;
    uint8_t flags;
} tmr_patch_vertex;

typedef struct tmr_patch_face {
    int32_t face, vertex[3], opposite[3], edge[3];
} tmr_patch_face;

typedef struct tmr_patch {
    tmr_patch_vertex vertex[TMR_PATCH_VERTICES];
    tmr_patch_face face[TMR_PATCH_FACES];
    int vertices, faces;
    int bound;      /* triangles that hang on lines: whose normal takes long to find            */
    int core, movable;                                  /* vertices: the four and their ring; those that move */
    int32_t live, live_faces, vertex_count, face_count; /* of the mesh                          */
    int32_t added;  /* vertex that the trial has added, -1 = none                               */
    int lines_too;  /* vertices on lines may move, too                                          */
    double strain;  /* of all triangles before                                                  */
} tmr_patch;

/* Add vertex v, unless it is there. Returns 0 if there is no room. Marks it in w->bad, as
   tmr_patch_add_face marks triangles in w->flag: both are 0 outside of the patch. */
static int tmr_patch_add(tmr_work *w, tmr_patch *patch, int32_t v) {
    const tmr_mesh *m = &w->m;
    if (w->bad[v]) return 1;
    if (patch->vertices == TMR_PATCH_VERTICES) return 0;
    tmr_patch_vertex *k = &patch->vertex[patch->vertices++];
    w->bad[v] = 1;
    k->vertex = v;
    k->p = m->p[v];
    k->n = m->n[v];
    k->source = m->source[v];
    k->corner = m->corner[v];
    k->valence = m->valence[v];
    k->size = w->size[v];
    k->flags = m->flags[v];
    return 1;
}

/* Are all vertices of the triangle on lines? */
static int tmr_is_bound(const tmr_mesh *m, int32_t face) {
    const int32_t *v = m->vertex + 3 * face;
    return tmr_kind_of(m, v[0]) != TRIMESH_FREE && tmr_kind_of(m, v[1]) != TRIMESH_FREE &&
           tmr_kind_of(m, v[2]) != TRIMESH_FREE;
}

static int tmr_patch_add_face(tmr_work *w, tmr_patch *patch, int32_t face) {
    const tmr_mesh *m = &w->m;
    if (w->flag[face]) return 1;
    if (patch->faces == TMR_PATCH_FACES) return 0;
    tmr_patch_face *k = &patch->face[patch->faces++];
    w->flag[face] = 1;
    k->face = face;
    patch->bound += tmr_is_bound(m, face);
    for (int j = 0; j < 3; j++) {
        k->vertex[j] = m->vertex[3 * face + j];
        k->opposite[j] = m->opposite[3 * face + j];
        k->edge[j] = m->edge[3 * face + j];
    }
    patch->strain += tmr_strain(w, face);
    return 1;
}

/* Add the neighbours of the vertices from..to-1, and if wanted their triangles. Returns 0 if there is
   no room. */
static int tmr_patch_grow(tmr_work *w, tmr_patch *patch, int from, int to, int faces_too) {
    const tmr_mesh *m = &w->m;
    for (int i = from; i < to; i++) {
        const int32_t v = patch->vertex[i].vertex, first = m->corner[v];
        int32_t c = first;
        if (first < 0 || tmr_is_ghost(m, v)) continue;
        do {
            if (!tmr_patch_add(w, patch, m->vertex[tmr_next(c)])) return 0;
            if (faces_too && !tmr_patch_add_face(w, patch, c / 3)) return 0;
            c = tmr_swing(m, c);
        } while (c != first);
    }
    return 1;
}

static void tmr_patch_mark(tmr_work *w, const tmr_patch *patch, uint8_t mark) {
    for (int i = 0; i < patch->vertices; i++) w->bad[patch->vertex[i].vertex] = mark;
    for (int i = 0; i < patch->faces; i++) w->flag[patch->face[i].face] = mark;
    for (int32_t f = patch->face_count; f < w->m.face_count; f++) w->flag[f] = mark;
    if (patch->added >= 0) w->bad[patch->added] = mark;
}

/* Keep the state around the edge opposite to c. Returns 0 if the patch is too large. */
static int tmr_patch_keep(tmr_work *w, tmr_patch *patch, int32_t c) {
    const tmr_mesh *m = &w->m;
    const int32_t core[4] = {m->vertex[tmr_next(c)], m->vertex[tmr_prev(c)], m->vertex[c],
                             m->vertex[m->opposite[c]]};
    patch->vertices = patch->faces = patch->bound = 0;
    patch->strain = 0;
    patch->live = m->live;
    patch->live_faces = m->live_faces;
    patch->vertex_count = m->vertex_count;
    patch->face_count = m->face_count;
    patch->added = -1;
    for (int k = 0; k < 4; k++) tmr_patch_add(w, patch, core[k]);
    int fits = tmr_patch_grow(w, patch, 0, patch->vertices, 0);
    patch->core = patch->movable = patch->vertices;
    fits = fits && tmr_patch_grow(w, patch, 0, patch->movable, 1);
    tmr_patch_mark(w, patch, 0);
    return fits;
}

/* During a trial: let the rim move, too, within a rim around it. Up to now nothing beyond it has
   changed. Where that does not fit, the patch stays as it is. */
static void tmr_patch_widen(tmr_work *w, tmr_patch *patch) {
    const int vertices = patch->vertices, faces = patch->faces;
    const double strain = patch->strain;
    tmr_patch_mark(w, patch, 1);
    const int fits = tmr_patch_grow(w, patch, patch->movable, vertices, 1);
    tmr_patch_mark(w, patch, 0);
    if (fits) {
        patch->movable = vertices;
    } else {
        patch->vertices = vertices;
        patch->faces = faces;
        patch->strain = strain;
    }
}

/* Take the trial back. */
static void tmr_patch_restore(tmr_work *w, const tmr_patch *patch) {
    tmr_mesh *m = &w->m;
    for (int i = 0; i < patch->vertices; i++) {
        const tmr_patch_vertex *k = &patch->vertex[i];
        const int32_t v = k->vertex;
        m->p[v] = k->p;
        m->n[v] = k->n;
        m->source[v] = k->source;
        m->corner[v] = k->corner;
        m->valence[v] = k->valence;
        w->size[v] = k->size;
        m->flags[v] = k->flags;
    }
    for (int i = 0; i < patch->faces; i++) {
        const tmr_patch_face *k = &patch->face[i];
        for (int j = 0; j < 3; j++) {
            m->vertex[3 * k->face + j] = k->vertex[j];
            m->opposite[3 * k->face + j] = k->opposite[j];
            m->edge[3 * k->face + j] = k->edge[j];
        }
    }
    m->live = patch->live;
    m->live_faces = patch->live_faces;
    m->vertex_count = patch->vertex_count;
    m->face_count = patch->face_count;
}

/* strain of the patch as it is now: of its old triangles that live, and of the new ones */
static double tmr_patch_strain(const tmr_work *w, const tmr_patch *patch) {
    double sum = 0;
    for (int i = 0; i < patch->faces; i++) sum += tmr_strain(w, patch->face[i].face);
    for (int32_t f = patch->face_count; f < w->m.face_count; f++) sum += tmr_strain(w, f);
    return sum;
}

static void tmr_patch_relax_vertex(tmr_work *w, const tmr_patch *patch, int32_t v) {
    const tmr_mesh *m = &w->m;
    tmr_place at;
    if (m->corner[v] < 0 || m->flags[v] & (TMR_GHOST | TMR_PINNED)) return;
    if (tmr_kind_of(m, v) == TRIMESH_FREE) {
        if (tmr_relaxed_place(w, v, &at)) tmr_put(w, v, &at);
    } else if (patch->lines_too) {
        tmr_relax_vertex(w, v);
        if (tmr_has_moved(w, v)) tmr_put_on_line(w, v, w->moved[v], w->landed[v]);
    }
}

/* Relax the vertices of the patch, each from where the others are now. */
static void tmr_patch_relax(tmr_work *w, const tmr_patch *patch) {
    if (patch->added >= 0) tmr_patch_relax_vertex(w, patch, patch->added);
    for (int i = 0; i < patch->movable; i++) tmr_patch_relax_vertex(w, patch, patch->vertex[i].vertex);
}

enum { TMR_TRIAL_SWEEPS = 8, TMR_TRIAL_WIDE = 2 }; /* ours: of relaxation; after which it is widened */

/* Relax what an operation has left, and let it stay if that lowers the strain by more than the price;
   otherwise take it back. Sweeps converge like a geometric series: once there is more left to gain
   than the last one has gained, there is no hope. */
static int tmr_patch_judge(tmr_work *w, tmr_patch *patch, double price) {
    double before = tmr_patch_strain(w, patch);
    for (int sweep = 0; sweep < TMR_TRIAL_SWEEPS; sweep++) {
        const double then = patch->strain;
        if (sweep == TMR_TRIAL_WIDE) tmr_patch_widen(w, patch);
        before += patch->strain - then;
        tmr_patch_relax(w, patch);
        const double now = tmr_patch_strain(w, patch), excess = now + price - patch->strain;
        if (excess < -1e-9) return 1;
        if (excess > before - now) break;
        before = now;
    }
    tmr_patch_restore(w, patch);
    return 0;
}

#endif /* TRIMESH_RELAX_TRIAL_H */
