/* fuzz_trimesh_relax.c - meshes of all kinds and all options into trimesh_relax.h
   SPDX-License-Identifier: MIT OR Unlicense; fuzzkit.h says how to run it

   A result must have the number of vertices asked for, be a manifold of finite points near the surface
   that know where they come from; jobs go step by step; after an error there is none, nor any memory. */
#include "trimesh_relax.h"

#define FUZZ_BYTES 200
#include "soupkit.h"

enum { MOST_RESULT = 300 };

static float any_number(source *s, float low, float high) {
    static const float odd[8] = {NAN, INFINITY, -1, 1e-30f, 1e30f, -1e-30f, 1e9f, -INFINITY};
    if (pick(s, 60) == 0) return odd[pick(s, 8)];
    if (pick(s, 3) == 0) return 0;
    return pick(s, 8) ? low + (high - low) * unit(s) : pick(s, 2) ? low : high;
}

static trimesh_desc make_desc(pool *p, source *s, const soup *m, trimesh_report *report) {
    trimesh_desc d;
    memset(&d, 0, sizeof d);
    d.surface = view_of(m, p);
    if (pick(s, 90) == 0) d.surface.corners = 3 + pick(s, 2);
    d.vertices = pick(s, 60) ? 4 + (size_t)pick(s, pick(s, 3) ? 60 : MOST_RESULT) : (size_t)pick(s, 4);
    if (pick(s, 300) == 0) d.vertices = SIZE_MAX;
    d.method = (trimesh_method)(pick(s, 90) ? pick(s, 3) / 2 : 2);
    if (pick(s, 6) == 0 && m->vertices) {
        const int kind = pick(s, 4);
        float *scale = (float *)(void *)take(p, m->vertices * sizeof *scale);
        for (size_t v = 0; v < m->vertices; v++) scale[v] = kind < 3 ? 0.1f + unit(s) : 1.0f + 900 * unit(s);
        if (kind == 2) scale[pick(s, (int)m->vertices)] = any_number(s, 0, 2000);
        d.scale = scale;
    }
    if (pick(s, 4) == 0) { /* seams at random, or along lines */
        const int kind = pick(s, 3);
        uint32_t *seams = (uint32_t *)(void *)take(p, 3 * m->faces * sizeof *seams);
        for (size_t i = 0; i < 3 * m->faces; i++)
            seams[i] = kind == 0 ? (uint32_t)pick(s, 65536) : kind == 1 ? (uint32_t)(i / 60) : m->indices[i] / 5;
        d.seams = seams;
    }
    if (pick(s, 3) == 0) d.adapt = any_number(s, 0, 1);
    if (pick(s, 3) == 0) d.crease_angle = any_number(s, 1, 180);
    if (pick(s, 4) == 0) d.line_spacing = any_number(s, 0.25f, 4);
    if (pick(s, 3) == 0) d.weld = any_number(s, 0, 0.01f);
    if (pick(s, 3) == 0) d.iterations = pick(s, 30) ? 1 + pick(s, 12) : pick(s, 3) * 1000 - 1;
    d.seed = (uint64_t)pick(s, 256);
    if (pick(s, 2)) d.report = report;
    return d;
}

/* ---- what a result has to keep to --------------------------------------------------------- */

static void look_at_edges(const trimesh_mesh *mesh) {
    const txm_mesh view = trimesh_as_view(mesh);
    const size_t sides = 3 * mesh->triangle_count;
    uint32_t *sorted = (uint32_t *)malloc(2 * sides * sizeof *sorted);
    if (!sorted) exit(1);
    txm_mesh_sort_sides(&view, sorted);
    for (size_t i = 0, end; i < sides; i = end) {
        end = txm_mesh_edge_end(&view, sorted, i);
        must(end - i <= 2 && txm_mesh_low(&view, sorted[i]) != txm_mesh_high(&view, sorted[i]));
        must(end - i == 1 || view.indices[sorted[i]] != view.indices[sorted[i + 1]]);
    }
    free(sorted);
}

/* The box about the corners of all faces, but for spoilt indices. Returns its diagonal. */
static double box_of(const txm_mesh *surface, float low[3], float high[3]) {
    double square = 0;
    for (size_t k = 0; k < 3; k++) {
        low[k] = 3e38f;
        high[k] = -3e38f;
        for (size_t i = 0; i < 3 * surface->face_count; i++) {
            if (surface->indices[i] >= surface->vertex_count) continue;
            const float x = surface->positions[3 * (size_t)surface->indices[i] + k];
            low[k] = txm_minf(low[k], x);
            high[k] = txm_maxf(high[k], x);
        }
        square += ((double)high[k] - low[k]) * ((double)high[k] - low[k]);
    }
    return sqrt(square);
}

static void look_at_mesh(const trimesh_mesh *mesh, const txm_mesh *surface) {
    float low[3], high[3];
    const double size = box_of(surface, low, high);
    uint8_t *used = (uint8_t *)calloc(mesh->vertex_count, 1);
    if (!used) exit(1);
    must(mesh->vertex_count >= 3 && mesh->triangle_count >= 1 && mesh->edge_length > 0);
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        const txm_mesh_place at = mesh->sources[v];
        const txm_dvec3 n = txm_d3_load(mesh->normals + 3 * v);
        for (size_t k = 0; k < 3; k++) {
            const double x = mesh->positions[3 * v + k];
            must(x >= low[k] - size && x <= high[k] + size);
        }
        must(at.triangle < surface->face_count && mesh->kinds[v] <= TRIMESH_CORNER);
        must(at.u >= 0 && at.v >= 0 && (double)at.u + (double)at.v <= 1.000001);
        must(fabs(txm_d3_len(n) - 1) < 1e-3);
    }
    for (size_t i = 0; i < 3 * mesh->triangle_count; i++) {
        must(mesh->indices[i] < mesh->vertex_count);
        used[mesh->indices[i]] = 1;
    }
    for (size_t v = 0; v < mesh->vertex_count; v++)
        must(used[v]);
    free(used);
    look_at_edges(mesh);
}

static int look(txm_status status, const trimesh_mesh *mesh, const trimesh_desc *d, const trouble *t, const txm_env *env) {
    must((status == TXM_OK) == (mesh != NULL));
    if (!succeeded(status, t, env)) return 0;
    must(!d->vertices || mesh->vertex_count == d->vertices);
    look_at_mesh(mesh, &d->surface);
    fuzz_succeeded++;
    return 1;
}

/* ---- calls ------------------------------------------------------------------------------------ */

static void look_at_state(const trimesh_state *state) {
    double sum = 0;
    for (size_t i = 0; i < 3 * state->points; i++) sum += (double)state->positions[i];
    for (size_t i = 0; i < 3 * state->triangles; i++)
        must(state->indices[i] < state->points);
    must(txm_is_finite(sum));
}

static trimesh_mesh *step_by_step(const trimesh_desc *d, trouble *t, txm_env *env, source *s) {
    trimesh_job *job = NULL;
    trimesh_mesh *mesh = NULL;
    int more = 1;
    txm_status status = trimesh_begin(d, env, &job);
    must((status == TXM_OK) == (job != NULL));
    if (!succeeded(status, t, env)) return NULL;
    while (more) {
        trimesh_state state;
        status = trimesh_step(job, env, &more);
        must(succeeded(status, t, env) || !more);
        if (pick(s, 4)) continue;
        if (succeeded(trimesh_get_state(job, env, &state), t, env)) look_at_state(&state);
        if (pick(s, 30) == 0) break;
    }
    const txm_status got = trimesh_get_mesh(job, env, &mesh);
    must(more || status == TXM_OK || got == status);
    look(got, mesh, d, t, env);
    trimesh_free(job);
    return mesh;
}

static void update(pool *p, source *s, soup *m, const trimesh_mesh *old) {
    trimesh_report report;
    trimesh_update_desc u;
    trimesh_mesh *mesh = NULL;
    trouble t;
    const int changes = pick(s, 3);
    memset(&u, 0, sizeof u);
    if (pick(s, 12) == 0) make_soup(m, s);
    for (int k = 0; k < changes; k++) spoil(m, s);
    u.desc = make_desc(p, s, m, &report);
    /* at the density of the old mesh, but not by the million where a spoilt corner is far away */
    float low[3], high[3];
    if (pick(s, 3) && box_of(&u.desc.surface, low, high) < 300 * (double)old->edge_length) u.desc.vertices = 0;
    if (pick(s, 3) == 0) u.radius = any_number(s, 1, 20);
    if (pick(s, 3) == 0) u.tolerance = any_number(s, 0, 0.5f);
    txm_env env = troubled(&t, s);
    const txm_status status = trimesh_update(old, &u, &env, &mesh);
    if (look(status, mesh, &u.desc, &t, &env))
        for (size_t v = 0; v < mesh->vertex_count; v++)
            must(mesh->old_vertices[v] >= -1 && mesh->old_vertices[v] < (int32_t)old->vertex_count);
    trimesh_mesh_free(mesh);
    must(t.memory.blocks == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static pool p;
    static soup m;
    source s = source_of(data, size);
    trimesh_report report;
    trimesh_mesh *mesh = NULL;
    trouble t;
    make_soup(&m, &s);
    const trimesh_desc d = make_desc(&p, &s, &m, &report);
    txm_env env = troubled(&t, &s);
    if (pick(&s, 4)) {
        const txm_status status = trimesh_retile(&d, &env, &mesh);
        look(status, mesh, &d, &t, &env);
    } else {
        mesh = step_by_step(&d, &t, &env, &s);
    }
    if (mesh && pick(&s, 2)) update(&p, &s, &m, mesh);
    trimesh_mesh_free(mesh);
    must(t.memory.blocks == 0);
    drain(&p);
    return 0;
}
