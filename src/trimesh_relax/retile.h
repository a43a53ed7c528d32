#ifndef TRIMESH_RELAX_RETILE_H
#define TRIMESH_RELAX_RETILE_H

#include "fields.h"
#include "count.h"
#include "subdivide.h"
#include "sound.h"

/* ---- retiling ----------------------------------------------------------------------------- */

#define TMR_CREASE_ANGLE 50 /* ours: degrees, see docs/choices.md#creases */

enum {
    TMR_CUT_FROM = 20000 /* ours: from so many vertices on at a quarter of them, then cut in four */
};

/* Rounds of relaxation and flips. A strong pull brings the density into balance, a weak one the
   angles. */
static txm_status tmr_improve(tmr_work *w, int rounds, int relaxations, double pull, double step) {
    w->pull = pull;
    w->step = step;
    for (int round = 0; round < rounds; round++) {
        /* the fraction stays at the highest so far: tmr_job_report */
        if (txm_progress(w->env, 0, "relax")) return TXM_CANCELLED;
        w->length = tmr_ideal_length(w);
        for (int k = 0; k < relaxations; k++) tmr_relax(w);
        tmr_flip_delaunay(w, 3);
        tmr_flip_valences(w, 3, 0.4);
    }
    return TXM_OK;
}

/* Even out the resampled copy a little, and set the lattice spacing for so many vertices: that of as
   many equilateral triangles on the area there is, somewhat less (ours, measured), since taking
   vertices away mends the pattern later, and putting more in harms it. */
static void tmr_set_spacing(tmr_work *w, int32_t target) {
    const double faces = w->m.live_faces;
    w->pull = 0.5;
    w->step = 1;
    w->length = tmr_ideal_length(w);
    for (int k = 0; k < 3; k++) {
        tmr_relax(w);
        tmr_flip_delaunay(w, 2);
    }
    w->length =
        0.982 * tmr_ideal_length(w) * sqrt(faces / (faces + 2.0 * (target - w->m.live)));
}

/* Directions, lattice points, and the mesh collapsed onto them. */
static txm_status tmr_solve_lattice(tmr_work *w, uint64_t seed, txm_arena *arena) {
    tmr_fields f;
    const txm_status status = tmr_fields_build(w, &f, arena);
    if (status != TXM_OK) return status;
    tmr_solve_directions(&f, seed);
    tmr_solve_points(&f);
    return tmr_collapse_lattice(w, &f, arena);
}

/* Bring w->m, a copy of the surface, to a lattice of so many vertices. */
static txm_status tmr_make_lattice(tmr_work *w, int32_t target, uint64_t seed) {
    txm_arena arena;
    int32_t missing = 0;
    txm_status status = tmr_resample(w);
    if (status != TXM_OK) return status;
    txm_arena_init(&arena, w->env);
    status = tmr_thin_lines(w, &arena);
    if (status == TXM_OK) {
        tmr_even_lines(w);
        tmr_set_spacing(w, target);
        status = tmr_solve_lattice(w, seed, &arena);
    }
    for (int round = 0; round < 4 && status == TXM_OK; round++) { /* what the lattice left undone */
        tmr_flip_delaunay(w, 4);
        tmr_flip_valences(w, 4, 0.3);
        for (int k = 0; k < 3; k++) tmr_relax(w);
        tmr_split_long(w, 1.5, 1.6);
        tmr_collapse_short(w, 0.55, 0.5, 1.5, 1);
    }
    if (status == TXM_OK) status = tmr_fix_count(w, target, 2, &arena, &missing);
    if (status == TXM_OK) status = tmr_improve(w, 6, 3, 1.5, 0.8);
    txm_arena_free(&arena);
    return status;
}

/* The last part of every method: the exact number, and as much regularity as pays. */
static txm_status tmr_polish(tmr_work *w, int32_t target, txm_arena *scratch) {
    int32_t missing;
    txm_status status = tmr_fix_count(w, target, 2, scratch, &missing);
    if (status == TXM_OK) status = tmr_improve(w, 1, 2, 1.5, 0.8);
    if (status == TXM_OK) status = tmr_improve(w, 2, 2, 1.2, 1);
    if (status != TXM_OK) return status;
    tmr_improve_spots(w, 3);
    if (w->m.live != target)
        return txm_fail_numbers(w->env, TXM_TOO_SMALL, "reached # vertices instead of #",
                                (uint64_t)w->m.live, (uint64_t)target);
    if ((status = tmr_fit_surface(w, 2, scratch)) != TXM_OK) return status;
    for (int round = 0; round < 8; round++)
        if (tmr_open_folds(w, 0.06) == 0) break;
    return TXM_OK;
}

/* ---- public ------------------------------------------------------------------------------- */

/* where vertex v lies in the caller's triangles */
static txm_mesh_place tmr_source_of(const tmr_work *w, int32_t v) {
    const tmr_surface *s = w->s;
    const int32_t face = tmr_face_of(w, v);
    const tmr_place at = tmr_on_face(s, face, w->m.p[v]);
    return tmr_surface_source(s, w->desc, &at);
}

/* Hand the result over in the caller's units. */
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
        number[v] = (int32_t)k;
        mesh->positions[3 * k] = txm_float(p.x);
        mesh->positions[3 * k + 1] = txm_float(p.y);
        mesh->positions[3 * k + 2] = txm_float(p.z);
        mesh->normals[3 * k] = txm_float(m->n[v].x);
        mesh->normals[3 * k + 1] = txm_float(m->n[v].y);
        mesh->normals[3 * k + 2] = txm_float(m->n[v].z);
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
