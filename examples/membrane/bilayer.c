/* bilayer.c - both leaflets of a membrane: calls trimesh_relax.h, trimesh_cover.h
   SPDX-License-Identifier: MIT OR Unlicense  */
#define TRIMESH_COVER_IMPLEMENTATION
#include "trimesh_cover.h"
#define TRIMESH_RELAX_IMPLEMENTATION
#include "trimesh_relax.h"

#include "membrane.h"

/* Append one leaflet. Lipids have a fixed size: with `unit` 1 heights and scales are in Angstrom, and
   `density` thins the patches to one lipid per 50 square Angstrom at the height where the tails begin. */
static txm_status add_leaflet(const trimesh_mesh *mesh, const trimesh_patch *patches, int patch_count,
                              int inside, txm_env *env, membrane *m) {
    trimesh_scatter_desc d = {0};
    float mix[KINDS];
    size_t count;
    for (int k = 0; k < KINDS; k++) mix[k] = lipids[k].share;
    d.mesh = trimesh_as_view(mesh);
    d.normals = mesh->normals;
    d.patches = patches;
    d.patch_count = patch_count;
    d.unit = 1;
    d.height = 13;
    d.inside = inside;
    d.curve = 1;
    d.density = 1 / 50.0f;
    d.spin = 1;
    d.mix = mix;
    d.mix_count = KINDS;
    d.seed = (uint64_t)inside;
    txm_status status = trimesh_scatter(&d, env, NULL, 0, &count);
    if (status != TXM_OK) return status;
    trimesh_instance *more = realloc(m->lipids, (m->count + count) * sizeof *more);
    if (!more) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the lipids");
    m->lipids = more;
    status = trimesh_scatter(&d, env, more + m->count, count, &count);
    if (status == TXM_OK) m->count += count;
    return status;
}

txm_status make_membrane(double (*f)(const double[3]), txm_env *env, membrane *m) {
    enum { PATCHES = 4, MOST_POINTS = 400 };
    static float positions[3 * SURFACE_VERTICES];
    static uint32_t indices[3 * SURFACE_TRIANGLES];
    static trimesh_point points[PATCHES][MOST_POINTS];
    trimesh_patch patches[PATCHES];
    trimesh_mesh *mesh = NULL;
    trimesh_desc desc = {0};
    make_surface(f, positions, indices);
    desc.surface.positions = positions;
    desc.surface.indices = indices;
    desc.surface.vertex_count = SURFACE_VERTICES;
    desc.surface.face_count = SURFACE_TRIANGLES;
    desc.crease_angle = 180;
    /* triangles of 45 Angstrom: 877 square Angstrom, two for each vertex */
    desc.vertices = (size_t)(area_of(&desc.surface) / (2 * 877)) + 2;
    txm_status status = trimesh_retile(&desc, env, &mesh);
    if (status != TXM_OK) return status;
    /* There must be points enough for the largest triangle of either leaflet; else TXM_TOO_SMALL. */
    for (int wanted = 24;; wanted = wanted * 5 / 4) {
        for (int p = 0; p < PATCHES && status == TXM_OK; p++) {
            const trimesh_patch_desc pd = {wanted, 0, 0, (uint64_t)p};
            patches[p].points = points[p];
            status = trimesh_reference_patch(&pd, env, points[p], MOST_POINTS, &patches[p].count);
        }
        m->count = 0;
        for (int inside = 0; inside < 2 && status == TXM_OK; inside++)
            status = add_leaflet(mesh, patches, PATCHES, inside, env, m);
        if (status != TXM_TOO_SMALL) break;
        status = TXM_OK;
    }
    trimesh_mesh_free(mesh);
    return status;
}

/* Leave out the eighth that faces the viewer. */
void cut_away(membrane *m) {
    size_t kept = 0;
    for (size_t i = 0; i < m->count; i++) {
        const float *p = m->lipids[i].position;
        if (!(p[0] > 0 && p[1] > 0 && p[2] > 0)) m->lipids[kept++] = m->lipids[i];
    }
    m->count = kept;
}
