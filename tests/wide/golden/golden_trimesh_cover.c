/* golden_trimesh_cover.c - hashes of what is put on meshes: attributes, textures, instances; golden.h
   SPDX-License-Identifier: MIT OR Unlicense

   The meshes are the surfaces of golden.h themselves, not retiled ones, so that a change of the
   retiling shows in that module's lines alone.                                                   */
#define TRIMESH_COVER_IMPLEMENTATION
#include "trimesh_cover.h"

#include "golden.h"

enum { CORNERS = 3 * GOLDEN_TRIANGLES, THINGS = 1 << 15 };
static golden_surface surface;
static float values[6 * CORNERS];
static int numbers[CORNERS], more_numbers[CORNERS];

static txm_mesh view(void) {
    txm_mesh v;
    memset(&v, 0, sizeof v);
    v.positions = surface.positions;
    v.indices = surface.indices;
    v.vertex_count = surface.vertex_count;
    v.face_count = surface.triangle_count;
    return v;
}

static uint64_t normals(txm_env *env) {
    uint64_t hash = 0;
    for (int open = 0; open < 2; open++) {
        golden_ring(&surface, open);
        const txm_mesh v = view();
        golden_need(trimesh_normals(&v, env, values), "normals", env);
        hash = golden_hash(hash, values, 3 * v.vertex_count * sizeof(float), 4);
    }
    return hash;
}

/* Points spread over a surface: one in each triangle. */
static size_t strew(txm_mesh_place *sources) {
    txm_rng rng = txm_rng_make(21, 4);
    for (size_t t = 0; t < surface.triangle_count; t++) {
        sources[t].triangle = (uint32_t)t;
        sources[t].u = 0.6f * txm_rng_float(&rng);
        sources[t].v = 0.4f * txm_rng_float(&rng);
    }
    return surface.triangle_count;
}

static uint64_t transfer(txm_env *env) {
    static txm_mesh_place sources[GOLDEN_TRIANGLES];
    static float in[4 * GOLDEN_VERTICES];
    trimesh_values v;
    golden_ring(&surface, 0);
    txm_rng rng = txm_rng_make(2, 2);
    for (size_t i = 0; i < 4 * surface.vertex_count; i++) in[i] = txm_rng_float(&rng);
    const size_t count = strew(sources);
    const txm_mesh input = view();
    memset(&v, 0, sizeof v);
    v.values = in;
    v.count = surface.vertex_count;
    v.channels = 4;
    golden_need(trimesh_transfer(&input, &v, sources, count, env, values), "transfer", env);
    return golden_hash(0, values, 4 * count * sizeof(float), 4);
}

/* texture coordinates with seams, from a ring to a coarser one that lies across its triangles */
static uint64_t transfer_corners(txm_env *env) {
    enum { N = 20, M = 10 };
    static float uvs[2 * (N + 1) * (M + 1)];
    static uint32_t entries[CORNERS], new_indices[CORNERS], corners[CORNERS];
    static txm_mesh_place sources[GOLDEN_VERTICES];
    static uint32_t coarse[CORNERS];
    trimesh_values v;
    size_t count = 0;
    golden_ring(&surface, 0);
    const txm_mesh input = view();
    for (int i = 0; i < (N + 1) * (M + 1); i++) {
        uvs[2 * i] = (float)(i / (M + 1)) / N;
        uvs[2 * i + 1] = (float)(i % (M + 1)) / M;
    }
    for (int c = 0; c < 3 * 2 * N * M; c++) { /* a chart that ends where the ring closes */
        static const int di[6] = {0, 1, 1, 0, 1, 0}, dj[6] = {0, 0, 1, 0, 1, 1};
        const int cell = c / 6, i = cell / M + di[c % 6], j = cell % M + dj[c % 6];
        entries[c] = (uint32_t)(i * (M + 1) + j);
    }
    memset(&v, 0, sizeof v);
    v.values = uvs;
    v.count = (N + 1) * (M + 1);
    v.indices = entries;
    v.channels = 2;
    size_t triangles = 0;
    for (int i = 0; i < N; i += 2) { /* every second vertex */
        for (int j = 0; j < M; j += 2) {
            const int i2 = (i + 2) % N, j2 = (j + 2) % M;
            const int quad[6] = {i * M + j, i2 * M + j, i2 * M + j2, i * M + j, i2 * M + j2, i * M + j2};
            for (int k = 0; k < 6; k++) coarse[3 * triangles + (size_t)k] = (uint32_t)quad[k];
            triangles += 2;
        }
    }
    for (int i = 0; i < N * M; i++) {
        sources[i].triangle = (uint32_t)(2 * i); /* whose corner 0 the vertex is */
        sources[i].u = sources[i].v = 0.05f;
    }
    txm_mesh mesh = input;
    mesh.indices = coarse;
    mesh.face_count = triangles;
    golden_need(trimesh_transfer_corners(&input, &v, &mesh, sources, env, values), "corners", env);
    uint64_t hash = golden_hash(0, values, 6 * triangles * sizeof(float), 4);
    golden_need(trimesh_split_corners(&mesh, values, 2, env, new_indices, corners, &count), "split",
                env);
    hash = golden_hash(hash, new_indices, 3 * triangles * sizeof *new_indices, 4);
    return golden_hash(hash, corners, count * sizeof *corners, 4);
}

/* patches of an atlas chosen for all triangles */
static uint64_t textured(txm_env *env) {
    static float atlas_uv[6 * 5];
    trimesh_choose_desc choose;
    trimesh_atlas atlas;
    uint64_t hash = 0;
    golden_ring(&surface, 0);
    const txm_mesh v = view();
    golden_need(trimesh_atlas_make(5, 100, -1, env, &atlas), "atlas", env);
    hash = golden_hash(hash, &atlas, sizeof atlas, 4);
    trimesh_atlas_uv(&atlas, -1, atlas_uv);
    for (int repeat = 0; repeat < 2; repeat++) {
        memset(&choose, 0, sizeof choose);
        choose.patches = 5;
        choose.repeat = repeat;
        choose.seed = 12;
        golden_need(trimesh_choose(&v, &choose, env, numbers, more_numbers), "choose", env);
        hash = golden_hash(hash, numbers, v.face_count * sizeof *numbers, 4);
        hash = golden_hash(hash, more_numbers, v.face_count * sizeof *more_numbers, 4);
        golden_need(
            trimesh_place_tiles(v.face_count, numbers, more_numbers, atlas_uv, 5, env, values),
            "place", env);
        hash = golden_hash(hash, values, 6 * v.face_count * sizeof *values, 4);
    }
    return hash;
}

static uint64_t colors(txm_env *env) {
    uint64_t hash = 0;
    int count = 0;
    golden_ring(&surface, 0);
    const txm_mesh v = view();
    golden_need(trimesh_edge_colors(&v, 3, 8, env, numbers, more_numbers), "edge colours", env);
    hash = golden_hash(hash, numbers, 3 * v.face_count * sizeof *numbers, 4);
    hash = golden_hash(hash, more_numbers, 3 * v.face_count * sizeof *more_numbers, 4);
    golden_need(trimesh_random_colors(v.vertex_count, 0, 8, env, numbers), "random colours", env);
    hash = golden_hash(hash, numbers, v.vertex_count * sizeof *numbers, 4);
    golden_need(trimesh_proper_colors(&v, env, numbers, &count), "proper colours", env);
    hash = golden_hash(hash, numbers, v.vertex_count * sizeof *numbers, 4);
    return golden_hash(hash, &count, sizeof count, 4);
}

static uint64_t patches(txm_env *env) {
    static trimesh_point points[600];
    uint64_t hash = 0;
    for (int k = 0; k < 4; k++) {
        trimesh_patch_desc desc;
        size_t count = 0;
        memset(&desc, 0, sizeof desc);
        desc.points = k == 3 ? 200 : 12 + 30 * k;
        desc.hexagonal = k == 1;
        desc.iterations = k == 2 ? 20 : 0;
        desc.seed = (uint64_t)k;
        golden_need(trimesh_reference_patch(&desc, env, points, 600, &count), "patch", env);
        hash = golden_hash(hash, points, count * sizeof *points, 4);
        for (size_t i = 0; i < count / 2; i++) {
            const trimesh_point p = points[i];
            points[i] = points[count - 1 - i];
            points[count - 1 - i] = p;
        }
        golden_need(trimesh_order_patch(points, count, env), "order", env);
        hash = golden_hash(hash, points, count * sizeof *points, 4);
    }
    return hash;
}

static uint64_t scatter_hash(const trimesh_scatter_desc *desc, txm_env *env, uint64_t hash) {
    static trimesh_instance things[THINGS];
    static const float corner[3] = {0.5f, -0.25f, 1};
    size_t count = 0;
    golden_need(trimesh_scatter(desc, env, things, THINGS, &count), "scatter", env);
    hash = golden_hash(hash, things, count * sizeof *things, 4);
    for (size_t i = 0; i < count; i += 17) {
        float at[3];
        trimesh_instance_apply(&things[i], corner, at);
        hash = golden_hash(hash, at, sizeof at, 4);
    }
    return hash;
}

static uint64_t scattered(txm_env *env) {
    static trimesh_point points[64];
    trimesh_scatter_desc desc;
    trimesh_patch patch;
    trimesh_patch_desc spread;
    uint64_t hash = 0;
    memset(&spread, 0, sizeof spread);
    spread.points = 12;
    golden_need(trimesh_reference_patch(&spread, env, points, 64, &patch.count), "patch", env);
    patch.points = points;
    for (int open = 0; open < 2; open++) {
        golden_ring(&surface, open);
        memset(&desc, 0, sizeof desc);
        desc.mesh = view();
        desc.patches = &patch;
        desc.patch_count = 1;
        desc.inside = open;
        hash = scatter_hash(&desc, env, hash);
    }
    return hash;
}

/* thinned by density, on the curved surface, mixed and turned */
static uint64_t scattered_by_density(txm_env *env) {
    static const float mix[3] = {1, 2, 0.5f};
    static trimesh_point points[2][128];
    trimesh_scatter_desc desc;
    trimesh_patch patch[2];
    trimesh_patch_desc spread;
    golden_ring(&surface, 0);
    memset(&spread, 0, sizeof spread);
    spread.points = 60;
    for (int k = 0; k < 2; k++) {
        spread.seed = (uint64_t)k;
        golden_need(trimesh_reference_patch(&spread, env, points[k], 128, &patch[k].count), "patch",
                    env);
        for (size_t i = 0; i < patch[k].count; i++) {
            points[k][i].height = 0.1f * (float)(i % 3);
            points[k][i].scale = 0.3f + 0.1f * (float)(i % 5);
            points[k][i].rotation[1] = 0.2f * (float)(i % 4);
            points[k][i].rotation[3] = 1;
        }
        patch[k].points = points[k];
    }
    memset(&desc, 0, sizeof desc);
    desc.mesh = view();
    desc.patches = patch;
    desc.patch_count = 2;
    desc.curve = 0.7f;
    desc.density = 20;
    desc.height = 0.05f;
    desc.unit = 0.5f;
    desc.spin = 1;
    desc.mix = mix;
    desc.mix_count = 3;
    desc.seed = 4;
    return scatter_hash(&desc, env, 0);
}

static const golden_case cases[] = {{"normals", normals},
                                    {"transfer", transfer},
                                    {"transfer-corners", transfer_corners},
                                    {"textured", textured},
                                    {"colors", colors},
                                    {"patches", patches},
                                    {"scattered", scattered},
                                    {"scattered-by-density", scattered_by_density}};
GOLDEN_MAIN("trimesh_cover")
