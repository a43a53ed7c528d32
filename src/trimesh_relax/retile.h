#ifndef TRIMESH_RELAX_RETILE_H
#define TRIMESH_RELAX_RETILE_H

#include "fields.h"
#include "renumber.h"
#include "count.h"
#include "defects.h"
#include "slivers.h"
#include "subdivide.h"
#include "validity.h"
#include "ridges.h"

/* ---- retiling ----------------------------------------------------------------------------- */

#define TMR_CREASE_ANGLE 50 /* ours: degrees, see docs/choices.md#creases */

/* All numbers here are ours, see docs/choices.md#tuning. Lengths are in wanted edge lengths. */
enum {
    TMR_CUT_FROM = 20000,   /* from so many vertices on a quarter of them, then cut in four       */
    TMR_SPACING_ROUNDS = 3, /* of relaxation before the lattice spacing is set                   */
    TMR_CLEAN_ROUNDS = 4,   /* of splits and collapses after the lattice                          */
    TMR_FOLD_ROUNDS = 8     /* of opening folds, at most                                          */
};
#define TMR_LATTICE_SPACING 0.982 /* lattice spacing over edge length: see tmr_set_spacing       */
#define TMR_LONG 1.5              /* cleaning splits edges longer than this,                     */
#define TMR_LONG_ON_LINES 1.6     /* on creases and borders                                      */
#define TMR_SHORT 0.55            /* and collapses those shorter than this,                      */
#define TMR_SHORT_ON_LINES 0.5    /* on creases and borders,                                     */
#define TMR_LONGEST 1.5           /* if no edge around gets longer than this                     */
#define TMR_FAIR_FLIP 0.4         /* flips for the valences leave triangles of this quality,     */
#define TMR_FAIR_FLIP_CLEAN 0.3   /* while cleaning of this, or better ones than before          */
#define TMR_FOLD_STEP 0.06        /* how far the edge of a fold moves in a round                 */

/* How much tmr_improve does. */
typedef struct tmr_effort {
    int rounds, relaxations; /* in each round */
    double pull, step;       /* as in tmr_work */
} tmr_effort;
static const tmr_effort tmr_after_lattice = {2, 3, 1.5, 0.8};
static const tmr_effort tmr_after_repulsion = {10, 2, 0.8, 1}; /* which is less regular          */
static const tmr_effort tmr_after_cut = {2, 2, 1, 1};
static const tmr_effort tmr_polish_density = {1, 2, 1.5, 0.8};
static const tmr_effort tmr_polish_angles = {3, 2, 0.5, 1};
static const tmr_effort tmr_polish_sizes = {3, 2, 1.2, 1}; /* where the caller wants different ones */

/* Rounds of relaxation and flips. A strong pull evens out the density, a weak one the angles. */
static txm_status tmr_improve(tmr_work *w, const tmr_effort *effort) {
    w->pull = effort->pull;
    w->step = effort->step;
    for (int round = 0; round < effort->rounds; round++) {
        /* the fraction stays at the highest so far: tmr_rise */
        if (txm_progress(w->env, 0, "relax")) return TXM_CANCELLED;
        w->length = tmr_ideal_length(w);
        for (int k = 0; k < effort->relaxations; k++) {
            tmr_relax(w);
            if (tmr_tick(w, w->m.live)) return TXM_CANCELLED;
        }
        tmr_flip_delaunay(w, 3);
        if (tmr_tick(w, w->m.live)) return TXM_CANCELLED;
        tmr_flip_valences(w, 3, TMR_FAIR_FLIP);
    }
    return TXM_OK;
}

/* Even out the resampled copy a little, and set the lattice spacing for so many vertices: that of
   as many equilateral triangles on the area there is, times TMR_LATTICE_SPACING. So the lattice has
   a few vertices too many: removing vertices improves the pattern, adding some disturbs it. */
static txm_status tmr_set_spacing(tmr_work *w, int32_t target) {
    const double faces = w->m.live_faces;
    w->pull = 0.5;
    w->step = 1;
    w->length = tmr_ideal_length(w);
    for (int k = 0; k < TMR_SPACING_ROUNDS; k++) {
        tmr_relax(w);
        tmr_flip_delaunay(w, 2);
        if (tmr_tick(w, w->m.live)) return TXM_CANCELLED;
    }
    w->length = TMR_LATTICE_SPACING * tmr_ideal_length(w) *
                sqrt(faces / (faces + 2.0 * (target - w->m.live)));
    return TXM_OK;
}

/* Directions, lattice points, and the mesh collapsed onto them. */
static txm_status tmr_solve_lattice(tmr_work *w, uint64_t seed, txm_arena *arena) {
    tmr_fields f;
    txm_status status = tmr_tick(w, w->m.live) ? TXM_CANCELLED : tmr_fields_build(w, &f, arena);
    if (status == TXM_OK) status = tmr_solve_directions(w, &f, seed);
    if (status == TXM_OK) status = tmr_solve_points(w, &f);
    return status == TXM_OK ? tmr_collapse_lattice(w, &f, arena) : status;
}

/* Turn w->m, a copy of the surface, into a lattice of target vertices. */
static txm_status tmr_make_lattice(tmr_work *w, int32_t target, uint64_t seed) {
    txm_arena arena;
    int32_t missing = 0;
    txm_status status = tmr_resample(w);
    if (status == TXM_OK) status = tmr_renumber(w);
    if (status != TXM_OK) return status;
    txm_arena_init(&arena, w->env);
    status = tmr_thin_lines(w, &arena);
    if (status == TXM_OK) {
        tmr_even_lines(w);
        status = tmr_set_spacing(w, target);
        if (status == TXM_OK) status = tmr_solve_lattice(w, seed, &arena);
        if (status == TXM_OK) status = tmr_renumber(w);
    }
    for (int round = 0; round < TMR_CLEAN_ROUNDS && status == TXM_OK; round++) {
        tmr_flip_delaunay(w, 4);
        tmr_flip_valences(w, 4, TMR_FAIR_FLIP_CLEAN);
        for (int k = 0; k < 3 && status == TXM_OK; k++) {
            tmr_relax(w);
            if (tmr_tick(w, w->m.live)) status = TXM_CANCELLED;
        }
        if (status != TXM_OK) break;
        tmr_split_long(w, TMR_LONG, TMR_LONG_ON_LINES);
        tmr_collapse_short(w, TMR_SHORT, TMR_SHORT_ON_LINES, TMR_LONGEST, 1);
    }
    if (status == TXM_OK) status = tmr_fix_count(w, target, 2, &arena, &missing);
    if (status == TXM_OK) status = tmr_improve(w, &tmr_after_lattice);
    if (status == TXM_OK) status = tmr_mend_defects(w, target, &arena);
    txm_arena_free(&arena);
    return status;
}

/* The worst triangles. Then there may be too few vertices or too many. */
static txm_status tmr_mend_worst(tmr_work *w, int32_t target, txm_arena *scratch) {
    int32_t missing;
    txm_status status = tmr_mend_slivers(w, 1, scratch);
    if (status != TXM_OK) return status;
    if ((status = tmr_improve_spots(w, 1)) != TXM_OK) return status;
    status = tmr_mend_slivers(w, 1, scratch);
    if (status != TXM_OK || w->m.live == target) return status;
    status = tmr_count_beside_defects(w, target, scratch);
    if (status == TXM_OK) status = tmr_fix_count(w, target, 2, scratch, &missing);
    return status == TXM_OK ? tmr_mend_slivers(w, 0, scratch) : status;
}

/* The last part of every method: the exact number, and more regularity. */
static txm_status tmr_polish(tmr_work *w, int32_t target, txm_arena *scratch) {
    int32_t missing;
    txm_status status = tmr_fix_count(w, target, 2, scratch, &missing);
    if (status == TXM_OK) status = tmr_improve(w, &tmr_polish_density);
    if (status == TXM_OK) status = tmr_improve(w, w->s->scale ? &tmr_polish_sizes : &tmr_polish_angles);
    if (status != TXM_OK) return status;
    if ((status = tmr_improve_spots(w, 3)) != TXM_OK) return status;
    if ((status = tmr_mend_worst(w, target, scratch)) != TXM_OK) return status;
    if (w->m.live != target)
        return txm_fail_numbers(w->env, TXM_TOO_SMALL, "reached # vertices instead of #",
                                (uint64_t)w->m.live, (uint64_t)target);
    if ((status = tmr_fit_surface(w, 2, scratch)) != TXM_OK) return status;
    for (int round = 0; round < TMR_FOLD_ROUNDS; round++) {
        if (tmr_tick(w, w->m.live)) return TXM_CANCELLED;
        if (tmr_open_folds(w, TMR_FOLD_STEP) == 0) break;
    }
    tmr_return_volume(w);
    return TXM_OK;
}

/* ---- public ------------------------------------------------------------------------------- */

/* where vertex v lies in the caller's triangles */
static txm_mesh_place tmr_source_of(const tmr_work *w, int32_t v) {
    const tmr_surface *s = w->s;
    tmr_place at = tmr_on_face(s, tmr_face_of(w, v), w->m.p[v]);
    if (tmr_kind_of(&w->m, v) == TRIMESH_CREASE && tmr_is_smooth_segment(w->l, w->m.source[v])) {
        int32_t k = w->m.source[v]; /* fitting has taken it off the line */
        const txm_dvec3 p = tmr_project_line(s, w->l, w->m.p[v], &k);
        at = tmr_on_face(s, w->l->face[k], p);
    }
    return tmr_surface_source(s, w->desc, &at);
}

/* The normal at vertex v: where those around cancel out, as on a sheet folded onto itself, that of the
   face in which it lies. */
static txm_dvec3 tmr_normal_of(const tmr_work *w, int32_t v) {
    const txm_dvec3 n = w->m.n[v];
    return n.x != 0 || n.y != 0 || n.z != 0 ? n : w->s->normal[tmr_face_of(w, v)];
}

/* Make the result, in the caller's units. */
static txm_status tmr_write(const tmr_work *w, trimesh_mesh **out) {
    const tmr_mesh *m = &w->m;
    txm_arena arena, scratch;
    txm_arena_init(&arena, w->env);
    txm_arena_init(&scratch, w->env);
    trimesh_mesh *mesh = (trimesh_mesh *)txm_arena_zero(&arena, 1, sizeof *mesh);
    int32_t *number = (int32_t *)txm_arena_alloc(&scratch, (size_t)m->vertex_count, sizeof(int32_t));
    size_t faces = 0;
    for (int32_t f = 0; f < m->face_count; f++)
        faces += !tmr_is_dead(m, f) && !tmr_is_ghost_face(m, f);
    if (mesh) {
        const size_t n = (size_t)m->live;
        mesh->positions = (float *)txm_arena_alloc(&arena, n, 3 * sizeof(float));
        mesh->normals = (float *)txm_arena_alloc(&arena, n, 3 * sizeof(float));
        mesh->sources = (txm_mesh_place *)txm_arena_alloc(&arena, n, sizeof(txm_mesh_place));
        mesh->kinds = (uint8_t *)txm_arena_alloc(&arena, n, 1);
        mesh->indices = (uint32_t *)txm_arena_alloc(&arena, faces, 3 * sizeof(uint32_t));
    }
    if (!mesh || arena.failed || scratch.failed) {
        txm_arena_free(&arena);
        txm_arena_free(&scratch);
        return TXM_OUT_OF_MEMORY;
    }
    const tmr_surface *s = w->s;
    for (int32_t v = 0; v < m->vertex_count; v++) {
        if (m->corner[v] < 0 || tmr_is_ghost(m, v)) continue;
        TRIMESH_ASSERT(mesh->vertex_count < (size_t)m->live);
        const size_t k = mesh->vertex_count++;
        const txm_dvec3 p = txm_d3_add(txm_d3_scale(m->p[v], s->diagonal), s->centre);
        const txm_dvec3 normal = tmr_normal_of(w, v);
        number[v] = (int32_t)k;
        mesh->positions[3 * k] = txm_float(p.x);
        mesh->positions[3 * k + 1] = txm_float(p.y);
        mesh->positions[3 * k + 2] = txm_float(p.z);
        mesh->normals[3 * k] = txm_float(normal.x);
        mesh->normals[3 * k + 1] = txm_float(normal.y);
        mesh->normals[3 * k + 2] = txm_float(normal.z);
        mesh->kinds[k] = (uint8_t)tmr_kind_of(m, v);
        mesh->sources[k] = tmr_source_of(w, v);
    }
    for (int32_t f = 0; f < m->face_count; f++) {
        if (tmr_is_dead(m, f) || tmr_is_ghost_face(m, f)) continue;
        for (int k = 0; k < 3; k++)
            mesh->indices[3 * mesh->triangle_count + (size_t)k] =
                (uint32_t)number[m->vertex[3 * f + k]];
        mesh->triangle_count++;
    }
    mesh->edge_length = w->length * s->diagonal;
    if (s->loop_count == 0 && s->volume > 0)
        mesh->volume_change = tmr_mesh_volume(m, m->p) / s->volume - 1;
    mesh->memory = arena;
    txm_arena_free(&scratch);
    *out = mesh;
    return TXM_OK;
}

TRIMESH_API txm_mesh trimesh_as_view(const trimesh_mesh *mesh) {
    txm_mesh view;
    view.corners = 3;
    view.positions = mesh->positions;
    view.indices = mesh->indices;
    view.vertex_count = mesh->vertex_count;
    view.face_count = mesh->triangle_count;
    return view;
}

TRIMESH_API void trimesh_mesh_free(trimesh_mesh *mesh) {
    if (!mesh) return;
    txm_arena arena = mesh->memory; /* the mesh lies in it */
    txm_arena_free(&arena);
}

#endif /* TRIMESH_RELAX_RETILE_H */
