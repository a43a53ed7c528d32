/* golden_trimesh_relax.c - hashes of meshes that trimesh_relax.h retiles; see golden.h
   SPDX-License-Identifier: MIT OR Unlicense                                                      */
#define TRIMESH_RELAX_IMPLEMENTATION
#include "trimesh_relax.h"

#include "golden.h"

static golden_surface surface;
static float scale[GOLDEN_VERTICES];

static trimesh_desc describe(size_t vertices, trimesh_method method) {
    trimesh_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.surface.positions = surface.positions;
    desc.surface.indices = surface.indices;
    desc.surface.vertex_count = surface.vertex_count;
    desc.surface.face_count = surface.triangle_count;
    desc.vertices = vertices;
    desc.method = method;
    return desc;
}

static uint64_t mesh_hash(const trimesh_mesh *mesh, uint64_t hash) {
    hash = golden_hash(hash, mesh->positions, 3 * mesh->vertex_count * sizeof(float), 4);
    hash = golden_hash(hash, mesh->normals, 3 * mesh->vertex_count * sizeof(float), 4);
    hash = golden_hash(hash, mesh->indices, 3 * mesh->triangle_count * sizeof(uint32_t), 4);
    hash = golden_hash(hash, mesh->sources, mesh->vertex_count * sizeof(txm_mesh_place), 4);
    return tk_hash(hash, mesh->kinds, mesh->vertex_count);
}

static uint64_t report_hash(const trimesh_report *r, uint64_t hash) {
    const uint64_t numbers[13] = {r->vertices,   r->triangles, r->welded,         r->unused,
                                  r->degenerate, r->duplicate, r->fins,           r->turned,
                                  r->split,      r->components, r->loops,
                                  (uint64_t)(r->euler + 1000), r->crease_edges};
    return golden_hash(hash, numbers, sizeof numbers, 8);
}

static uint64_t retile(trimesh_desc *desc, txm_env *env) {
    trimesh_mesh *mesh = NULL;
    trimesh_report report;
    desc->report = &report;
    golden_need(trimesh_retile(desc, env, &mesh), "retile", env);
    const uint64_t hash = report_hash(&report, mesh_hash(mesh, 0));
    trimesh_mesh_free(mesh);
    return hash;
}

static uint64_t lattice_ring(txm_env *env) {
    golden_ring(&surface, 0);
    trimesh_desc desc = describe(401, TRIMESH_LATTICE);
    desc.crease_angle = 60;
    return retile(&desc, env);
}

static uint64_t lattice_sheet(txm_env *env) {
    golden_ring(&surface, 1);
    trimesh_desc desc = describe(400, TRIMESH_LATTICE);
    desc.adapt = 0.5f;
    desc.line_spacing = 1.5f;
    return retile(&desc, env);
}

static uint64_t repel_ring(txm_env *env) {
    golden_ring(&surface, 0);
    trimesh_desc desc = describe(401, TRIMESH_REPEL);
    desc.crease_angle = 60;
    return retile(&desc, env);
}

static uint64_t repel_sheet(txm_env *env) {
    golden_ring(&surface, 1);
    for (int i = 0; i < GOLDEN_VERTICES; i++) scale[i] = i % 10 < 5 ? 1.0f : 1.8f;
    trimesh_desc desc = describe(350, TRIMESH_REPEL);
    desc.scale = scale;
    desc.iterations = 15;
    desc.seed = 5;
    return retile(&desc, env);
}

/* sharp edges, and vertices that must be welded first */
static uint64_t creases(txm_env *env) {
    static const int cells[3] = {4, 6, 3};
    memset(&surface, 0, sizeof surface);
    golden_box(&surface, cells, 0, 0, 0);
    trimesh_desc desc = describe(300, TRIMESH_LATTICE);
    return retile(&desc, env);
}

static uint64_t creases_repelled(txm_env *env) {
    static const int cells[3] = {5, 5, 5};
    memset(&surface, 0, sizeof surface);
    golden_box(&surface, cells, -1, -1, -1);
    trimesh_desc desc = describe(250, TRIMESH_REPEL);
    desc.iterations = 10;
    return retile(&desc, env);
}

/* two boxes with everything in them that is mended: turned, doubled and thin triangles, a fin, an
   unused vertex, vertices nearly in one place */
static uint64_t mended(txm_env *env) {
    static const int large[3] = {4, 4, 4}, flat[3] = {6, 6, 1};
    memset(&surface, 0, sizeof surface);
    golden_box(&surface, large, 0, 0, 0);
    golden_box(&surface, flat, 6, 0.5, 0);
    for (size_t t = 0; t < surface.triangle_count; t += 5) { /* turned */
        const uint32_t b = surface.indices[3 * t + 1];
        surface.indices[3 * t + 1] = surface.indices[3 * t + 2];
        surface.indices[3 * t + 2] = b;
    }
    memcpy(surface.indices + 3 * surface.triangle_count, surface.indices + 30, 12 * sizeof(uint32_t));
    surface.triangle_count += 4;
    const uint32_t a = golden_vertex(&surface, 2, 2, 6), b = golden_vertex(&surface, 2, 3, 6);
    golden_vertex(&surface, -3, -3, -3);
    golden_quad(&surface, surface.indices[60], surface.indices[61], a, b);
    surface.triangle_count--; /* a fin alone */
    golden_quad(&surface, 7, 7, 8, 8);
    for (size_t i = 0; i < surface.vertex_count; i += 3) surface.positions[3 * i] += 1e-5f;
    trimesh_desc desc = describe(500, TRIMESH_LATTICE);
    desc.weld = 1e-4f;
    return retile(&desc, env);
}

/* a ring that is cut open after it was retiled */
static uint64_t updated(txm_env *env) {
    trimesh_mesh *old = NULL, *mesh = NULL;
    trimesh_update_desc update;
    trimesh_report report;
    golden_ring(&surface, 0);
    const trimesh_desc desc = describe(400, TRIMESH_LATTICE);
    golden_need(trimesh_retile(&desc, env, &old), "retile", env);
    surface.triangle_count -= 60; /* three rows of cells */
    memset(&update, 0, sizeof update);
    update.desc = describe(0, TRIMESH_LATTICE);
    update.desc.report = &report;
    golden_need(trimesh_update(old, &update, env, &mesh), "update", env);
    uint64_t hash = report_hash(&report, mesh_hash(mesh, 0));
    hash = golden_hash(hash, mesh->old_vertices, mesh->vertex_count * sizeof *mesh->old_vertices, 4);
    trimesh_mesh_free(mesh);
    trimesh_mesh_free(old);
    return hash;
}

static const golden_case cases[] = {
    {"lattice-ring", lattice_ring}, {"lattice-sheet", lattice_sheet}, {"repel-ring", repel_ring},
    {"repel-sheet", repel_sheet},   {"creases", creases},             {"creases-repelled", creases_repelled},
    {"mended", mended},             {"updated", updated}};
GOLDEN_MAIN("trimesh_relax")
