#ifndef TRIMESH_RELAX_WORK_H
#define TRIMESH_RELAX_WORK_H

#include "mend.h"
#include "mesh.h"
#include "place.h"

/* ---- the work ----------------------------------------------------------------------------- */

enum {
    TMR_CHUNK = 2048, /* vertices or triangles per parallel task; does not change results */
    TMR_TICK = 50000, /* ours: progress is reported after the work of moving so many vertices */
    TMR_TICK_TRIAL = 20 /* ours: so many are what trying something at one edge takes */
};

typedef struct tmr_work {
    const tmr_surface *s;
    const tmr_lines *l;
    const trimesh_desc *desc;
    txm_env *env;
    tmr_mesh m;
    float *size;       /* 1 per vertex of m: edge length there relative to length               */
    double length;     /* edge length aimed at                                                  */
    double line_scale; /* along lines relative to that                                          */
    txm_dvec3 *moved;  /* 1 per vertex: scratch: the place it moves to                          */
    int32_t *landed;   /* 1 per vertex: scratch: the face or segment there                      */
    uint8_t *bad;      /* 1 per vertex: scratch: a mark                                         */
    uint8_t *flag;     /* 1 per triangle: scratch: a mark                                       */
    float *height;     /* 1 per triangle: scratch: height of the surface over it                */
    float (*limit)[2]; /* 1 per vertex: scratch: how far into and out of the surface it may fit */
    uint8_t *mask;     /* of relaxation: NULL, or 1 per vertex: may it move?                    */
    uint8_t *mask_room; /* 1 per vertex: memory for mask */
    double pull;       /* of relaxation: how far triangles pull to the wanted size, 0..1        */
    double step;       /* of relaxation: over-relaxation factor                                 */
    int64_t ticks;     /* work since progress was reported: tmr_tick                            */
    int splinters;     /* of collapsing: also the short sides of much longer triangles          */
} tmr_work;

/* A progress callback that passes on to the caller's what never falls, also where something is done twice. */
typedef struct tmr_rising {
    int (*progress)(void *user, float fraction, const char *stage); /* the caller's */
    void *user;
    float fraction; /* the highest reported */
} tmr_rising;

static int tmr_rise(void *user, float fraction, const char *stage) {
    tmr_rising *r = (tmr_rising *)user;
    if (fraction > r->fraction) r->fraction = fraction;
    return r->progress(r->user, r->fraction, stage);
}

/* Let an environment, a copy of the caller's, report by way of r. */
static void tmr_rise_in(tmr_rising *r, txm_env *env) {
    if (!env->progress) return;
    r->progress = env->progress;
    r->user = env->progress_user;
    env->progress = tmr_rise;
    env->progress_user = r;
}

/* Report progress if the work of moving TMR_TICK vertices was done since the last time: small meshes need
   no reports, and of large ones no pass is too long to be cancelled. Non-zero: cancelled, stop. */
static int tmr_tick(tmr_work *w, int32_t vertices) {
    w->ticks += vertices;
    if (w->ticks < TMR_TICK) return 0;
    w->ticks = 0;
    return txm_progress(w->env, 0, "relax"); /* the fraction stays at the highest so far */
}

/* Does the caller want edges of different lengths? Others are a means: tmr_halve_at_spots. */
static int tmr_wants_sizes(const tmr_work *w) {
    return w->desc->scale != NULL || w->desc->adapt > 0;
}

/* a face of the surface at the vertex */
static int32_t tmr_face_of(const tmr_work *w, int32_t v) {
    const int kind = tmr_kind_of(&w->m, v);
    if (kind == TRIMESH_FREE) return w->m.source[v];
    if (kind == TRIMESH_CORNER) return w->s->corner[w->m.source[v]] / 3;
    return w->l->face[w->m.source[v]];
}

/* Put vertex v at the place. */
static void tmr_put(tmr_work *w, int32_t v, const tmr_place *at) {
    w->m.p[v] = at->p;
    w->m.n[v] = tmr_normal_at(w->s, w->l, at);
    w->m.source[v] = at->face;
    w->size[v] = txm_float(tmr_scale_at(w->s, at));
}

/* Let vertex v stay where it is, unless w->moved is set later. */
static void tmr_keep_place(tmr_work *w, int32_t v) {
    w->moved[v] = w->m.p[v];
    w->landed[v] = w->m.source[v];
}

/* Put vertex v on segment k of a line. */
static void tmr_put_on_line(tmr_work *w, int32_t v, txm_dvec3 p, int32_t k) {
    const int32_t *a = w->l->a, *b = w->l->b;
    const tmr_place at = tmr_on_face(w->s, w->l->face[k], p);
    w->m.p[v] = p;
    w->m.n[v] = txm_d3_unit(txm_d3_add(w->s->vertex_normal[a[k]], w->s->vertex_normal[b[k]]));
    w->m.source[v] = k;
    w->size[v] = txm_float(tmr_scale_at(w->s, &at));
}

/* the middle of the triangle of these vertices */
static txm_dvec3 tmr_middle(const tmr_mesh *m, const int32_t *v) {
    return txm_d3_scale(txm_d3_add(txm_d3_add(m->p[v[0]], m->p[v[1]]), m->p[v[2]]), 1.0 / 3);
}

/* The place of the surface nearest to p, walking from all its faces at vertex v: beside a crease the
   distance may fall on one side only. */
static tmr_place tmr_project_from(const tmr_work *w, int32_t v, txm_dvec3 p) {
    const tmr_surface *s = w->s;
    const int32_t k = w->m.source[v];
    const int kind = tmr_kind_of(&w->m, v);
    tmr_place at = tmr_project(s, p, tmr_face_of(w, v));
    if (kind == TRIMESH_CORNER) {
        const int32_t first = s->corner[k];
        if (s->fan && s->fan[k] >= 0) {
            const tmr_place other = tmr_project(s, p, tmr_on_fan(s, k, p).face);
            return other.d2 < at.d2 ? other : at;
        }
        for (int32_t c = tmr_ccw(s->opposite, first); c >= 0 && c != first; c = tmr_ccw(s->opposite, c)) {
            const tmr_place other = tmr_project(s, p, c / 3);
            if (other.d2 < at.d2) at = other;
        }
    } else if (kind != TRIMESH_FREE) {
        for (int32_t c = 3 * w->l->face[k], i = 0; i < 3; i++, c++) {
            if (s->vertex[c] == w->l->a[k] || s->vertex[c] == w->l->b[k] || s->opposite[c] < 0) continue;
            const tmr_place other = tmr_project(s, p, s->opposite[c] / 3);
            if (other.d2 < at.d2) at = other;
        }
    }
    return at;
}

/* the place of the surface nearest to it, walking from all three vertices */
static tmr_place tmr_below_middle(const tmr_work *w, const int32_t *v) {
    const txm_dvec3 middle = tmr_middle(&w->m, v);
    tmr_place at = tmr_project_from(w, v[0], middle);
    for (int k = 1; k < 3; k++) {
        const tmr_place other = tmr_project_from(w, v[k], middle);
        if (other.d2 < at.d2) at = other;
    }
    return at;
}

/* the place of the surface nearest to p, a point between the vertices a and b */
static tmr_place tmr_project_between(const tmr_work *w, int32_t a, int32_t b, txm_dvec3 p) {
    if (tmr_kind_of(&w->m, a) == TRIMESH_FREE) return tmr_project(w->s, p, w->m.source[a]);
    if (tmr_kind_of(&w->m, b) == TRIMESH_FREE) return tmr_project(w->s, p, w->m.source[b]);
    const tmr_place one = tmr_project_from(w, a, p), two = tmr_project_from(w, b, p);
    return two.d2 < one.d2 ? two : one;
}

/* The normal that a triangle should have: the mean normal of its free vertices, since normals on
   creases say little; without a free vertex that of the surface below its middle. */
static txm_dvec3 tmr_expected_normal(const tmr_work *w, int32_t a, int32_t b, int32_t c) {
    const tmr_mesh *m = &w->m;
    const int32_t v[3] = {a, b, c};
    txm_dvec3 n = txm_d3(0, 0, 0);
    int any = 0;
    for (int k = 0; k < 3; k++) {
        if (tmr_kind_of(m, v[k]) != TRIMESH_FREE) continue;
        n = txm_d3_add(n, m->n[v[k]]);
        any = 1;
    }
    if (any) return txm_d3_unit(n);
    return w->s->normal[tmr_below_middle(w, v).face];
}

#define TMR_THIN 0.02 /* twice the area over the squared longest edge of a triangle without a direction */

/* how well a triangle at these points agrees with the normals of its vertices: -1..1, -1 also for
   one without area */
static double tmr_agreement(const tmr_work *w, int32_t a, int32_t b, int32_t c, txm_dvec3 pa,
                            txm_dvec3 pb, txm_dvec3 pc) {
    const txm_dvec3 n = txm_d3_area2(pa, pb, pc);
    const double length = txm_d3_len(n);
    const double longest =
        fmax(txm_d3_dist2(pa, pb), fmax(txm_d3_dist2(pb, pc), txm_d3_dist2(pc, pa)));
    if (length <= TMR_THIN * longest) return -1;
    return txm_d3_dot(n, tmr_expected_normal(w, a, b, c)) / length;
}

#define TMR_LEAST_AGREEMENT 0.4 /* cosine of the steepest angle to the surface that is accepted   */

/* ---- setting up --------------------------------------------------------------------------- */

/* Arrays for so many vertices and triangles; the mesh in them is empty. */
static txm_status tmr_alloc_mesh(tmr_work *w, int32_t vertices, int32_t faces, txm_arena *arena) {
    tmr_mesh *m = &w->m;
    const size_t nv = (size_t)vertices, nc = 3 * (size_t)faces;
    m->vertex_limit = vertices;
    m->face_limit = faces;
    m->vertex_count = m->live = m->face_count = m->live_faces = 0;
    m->p = (txm_dvec3 *)txm_arena_alloc(arena, nv, sizeof(txm_dvec3));
    m->n = (txm_dvec3 *)txm_arena_alloc(arena, nv, sizeof(txm_dvec3));
    m->source = (int32_t *)txm_arena_alloc(arena, nv, sizeof(int32_t));
    m->corner = (int32_t *)txm_arena_alloc(arena, nv, sizeof(int32_t));
    m->flags = (uint8_t *)txm_arena_zero(arena, nv, 1);
    m->valence = (int32_t *)txm_arena_zero(arena, nv, sizeof(int32_t));
    m->vertex = (int32_t *)txm_arena_alloc(arena, nc, sizeof(int32_t));
    m->opposite = (int32_t *)txm_arena_alloc(arena, nc, sizeof(int32_t));
    m->edge = (int32_t *)txm_arena_zero(arena, nc, sizeof(int32_t));
    w->size = (float *)txm_arena_alloc(arena, nv, sizeof(float));
    w->moved = (txm_dvec3 *)txm_arena_alloc(arena, nv, sizeof(txm_dvec3));
    w->landed = (int32_t *)txm_arena_alloc(arena, nv, sizeof(int32_t));
    w->bad = (uint8_t *)txm_arena_zero(arena, nv, 1);
    w->mask_room = (uint8_t *)txm_arena_alloc(arena, nv, 1);
    w->flag = (uint8_t *)txm_arena_alloc(arena, (size_t)faces, 1);
    return tmr_check_memory(arena);
}

/* Copy the surface into w->m, its border loops closed by ghosts, with room for `more` vertices.

   The copy has one ghost vertex for each border loop and one ghost triangle for each border edge.
   Every operation that makes a vertex makes two triangles (tmr_split, tmr_split_face), and slots are
   never used twice, except by trials that give them back:

       vertices = V + loops + more
       faces    = F + border edges + 2 more

   return  TXM_OK; TXM_TOO_LARGE if corners could not be numbered; TXM_OUT_OF_MEMORY               */
static txm_status tmr_copy_surface(tmr_work *w, double more, txm_arena *arena) {
    const tmr_surface *s = w->s;
    tmr_mesh *m = &w->m;
    const double vertices = (double)s->vertex_count + s->loop_count + more;
    const double faces = (double)s->face_count + s->border_count + 2 * more;
    memset(m, 0, sizeof *m);
    if (vertices > (double)TMR_MOST_SLOTS || faces > (double)TMR_MOST_SLOTS)
        return txm_fail(w->env, TXM_TOO_LARGE, "the surface and its borders are too large");
    const txm_status status = tmr_alloc_mesh(w, (int32_t)vertices, (int32_t)faces, arena);
    if (status != TXM_OK) return status;
    m->vertex_count = m->live = s->vertex_count;
    m->face_count = m->live_faces = s->face_count;
    const size_t corners = 3 * (size_t)s->face_count;
    memcpy(m->vertex, s->vertex, corners * sizeof(int32_t));
    memcpy(m->opposite, s->opposite, corners * sizeof(int32_t));
    memcpy(m->edge, w->l->edge, corners * sizeof(int32_t));
    for (int32_t v = 0; v < s->vertex_count; v++) {
        const int kind = w->l->kind[v];
        m->p[v] = s->point[v];
        m->n[v] = s->vertex_normal[v];
        m->corner[v] = s->corner[v];
        m->source[v] = kind == TRIMESH_FREE     ? s->corner[v] / 3
                       : kind == TRIMESH_CORNER ? v
                                                : w->l->segment[v];
        m->flags[v] = (uint8_t)kind;
        w->size[v] = s->scale ? s->scale[v] : 1;
    }
    for (size_t c = 0; c < corners; c++) m->valence[m->vertex[c]]++;

    /* Ghosts: walk each border loop, one ghost triangle per border edge. From the border edge of
       corner c, which runs from u = next(c) to v = prev(c), the next one begins at v. */
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        if (m->opposite[c] >= 0) continue;
        TRIMESH_ASSERT(m->vertex_count < m->vertex_limit);
        const int32_t ghost = m->vertex_count++, first_face = m->face_count;
        m->flags[ghost] = TMR_GHOST;
        m->p[ghost] = m->n[ghost] = txm_d3(0, 0, 0);
        m->source[ghost] = -1;
        m->corner[ghost] = 3 * first_face;
        m->valence[ghost] = 0;
        w->size[ghost] = 1;
        m->ghosts++;
        int32_t e = c;
        do {
            TRIMESH_ASSERT(m->face_count < m->face_limit);
            const int32_t f = 3 * m->face_count++;
            m->live_faces++;
            m->vertex[f] = ghost;
            m->vertex[f + 1] = m->vertex[tmr_prev(e)];
            m->vertex[f + 2] = m->vertex[tmr_next(e)];
            tmr_link(m, f, e, w->l->edge[e]);
            m->valence[ghost]++;
            m->valence[m->vertex[tmr_prev(e)]]++;
            m->valence[m->vertex[tmr_next(e)]]++;
            int32_t at = tmr_prev(e); /* turn clockwise about v to the next border edge */
            while (s->opposite[tmr_prev(at)] >= 0) at = tmr_prev(s->opposite[tmr_prev(at)]);
            e = tmr_prev(at);
        } while (e != c);
        for (int32_t f = first_face; f < m->face_count; f++) {
            const int32_t next = f + 1 < m->face_count ? f + 1 : first_face;
            /* f = (ghost, v, u): its edge ghost v, opposite to u, is the next one's ghost u */
            tmr_link(m, 3 * f + 2, 3 * next + 1, 0);
        }
    }
    TRIMESH_ASSERT(m->ghosts == s->loop_count);
    TRIMESH_ASSERT(m->face_count == s->face_count + s->border_count);
    return TXM_OK;
}

/* ---- back to the caller's triangles ------------------------------------------------------- */

/* The place in the caller's triangle. Where mending has flipped an edge, a face is not one of the
   caller's: then the nearest point of the triangle that it came from. */
static txm_mesh_place tmr_surface_source(const tmr_surface *s, const trimesh_desc *desc,
                                         const tmr_place *at) {
    txm_mesh_place source;
    double weight[3] = {0, 0, 0};
    const double own[3] = {1 - at->u - at->v, at->u, at->v};
    const int turn = s->turn[at->face];
    source.triangle = s->origin[at->face];
    if (turn < TMR_MAPPED) {
        for (int k = 0; k < 3; k++)
            weight[turn < 4 ? (k + turn) % 3 : (turn - 4 - k + 3) % 3] = own[k];
    } else {
        txm_dvec3 p[3];
        int part;
        tmr_caller_corners(s, desc, source.triangle, p);
        tmr_nearest(at->p, p[0], p[1], p[2], &weight[1], &weight[2], &part);
    }
    source.u = txm_clampf(txm_float(weight[1]), 0, 1);
    source.v = txm_clampf(txm_float(weight[2]), 0, txm_float(1.0 - source.u));
    return source;
}

#endif /* TRIMESH_RELAX_WORK_H */
