/* fuzz_trimesh_cover.c - meshes, values, patches and options of all kinds into trimesh_cover.h
   SPDX-License-Identifier: MIT OR Unlicense; fuzzkit.h says how to run it

   Every call, with arrays that end where they must: what is refused has a message and leaves its output
   alone; what succeeds is finite, in range, and keeps what the call promises.                     */
#include "trimesh_cover.h"

#define FUZZ_BYTES 160
#include "soupkit.h"

enum { MOST_POINTS = 40, MOST_THINGS = 30000, MOST_ENTRIES = 900 };

/* An array of the caller's, fresh. */
#define FRESH_ARRAY(type, count) ((type *)(void *)take(p, (size_t)(count) * sizeof(type)))

static int is_left_alone(const void *array, size_t bytes) {
    const uint8_t *b = (const uint8_t *)array;
    for (size_t i = 0; i < bytes; i++)
        if (b[i] != FRESH) return 0;
    return 1;
}

/* After a call: an error has left its output alone; but for one that was cancelled. */
static int done(txm_status status, const trouble *t, const txm_env *env, const void *out, size_t bytes) {
    const int success = succeeded(status, t, env);
    must(success || status == TXM_CANCELLED || is_left_alone(out, bytes));
    fuzz_succeeded += success;
    return success;
}

static void must_be_finite(const float *values, size_t count) {
    for (size_t i = 0; i < count; i++) must(txm_is_finite((double)values[i]));
}

/* ---- attributes --------------------------------------------------------------------------- */

static void normals(const txm_mesh *mesh, pool *p, source *s) {
    trouble t;
    txm_env env = troubled(&t, s);
    float *out = FRESH_ARRAY(float, 3 * mesh->vertex_count);
    if (done(trimesh_normals(mesh, &env, out), &t, &env, out, 3 * mesh->vertex_count * sizeof *out))
        for (size_t v = 0; v < mesh->vertex_count; v++) {
            const double length = txm_d3_len(txm_d3_load(out + 3 * v));
            must(length == 0 || fabs(length - 1) < 1e-4);
        }
    must(t.memory.blocks == 0);
}

static trimesh_values any_values(const txm_mesh *mesh, pool *p, source *s) {
    trimesh_values v;
    const int by_corner = pick(s, 2), entries = 1 + pick(s, MOST_ENTRIES);
    memset(&v, 0, sizeof v);
    v.channels = pick(s, 40) ? 1 + pick(s, 4) : pick(s, 80) - 2;
    v.count = by_corner ? (size_t)entries : mesh->vertex_count;
    if (pick(s, 60) == 0) v.count++;
    const size_t channels = v.channels < 1 ? 1 : (size_t)v.channels;
    float *values = FRESH_ARRAY(float, v.count * channels);
    const int flat = pick(s, 3);
    for (size_t i = 0; i < v.count * channels; i++) values[i] = flat ? (float)(i % 3) : unit(s);
    if (v.count && pick(s, 40) == 0) values[pick(s, (int)(v.count * channels))] = pick(s, 2) ? NAN : 3e38f;
    v.values = pick(s, 90) ? values : NULL;
    if (by_corner) {
        uint32_t *indices = FRESH_ARRAY(uint32_t, 3 * mesh->face_count);
        for (size_t i = 0; i < 3 * mesh->face_count; i++)
            indices[i] = pick(s, 3) ? (uint32_t)(mesh->indices[i] % v.count) : (uint32_t)pick(s, (int)v.count);
        if (mesh->face_count && pick(s, 60) == 0) indices[pick(s, (int)(3 * mesh->face_count))] = (uint32_t)v.count;
        v.indices = indices;
    }
    return v;
}

static txm_mesh_place *any_places(const txm_mesh *mesh, size_t count, pool *p, source *s) {
    txm_mesh_place *places = FRESH_ARRAY(txm_mesh_place, count);
    const int corners = pick(s, 3) == 0;
    for (size_t i = 0; i < count; i++) {
        const int k = pick(s, 3);
        places[i].triangle = mesh->face_count ? (uint32_t)pick(s, (int)mesh->face_count) : 0;
        places[i].u = corners ? (float)(k == 1) : unit(s);
        places[i].v = corners ? (float)(k == 2) : (1 - places[i].u) * unit(s);
    }
    if (count && pick(s, 30) == 0) places[pick(s, (int)count)].u = pick(s, 2) ? NAN : 2;
    if (count && pick(s, 30) == 0) places[pick(s, (int)count)].triangle = (uint32_t)mesh->face_count;
    return places;
}

static void transfer(const txm_mesh *mesh, pool *p, source *s) {
    static soup other;
    trouble t;
    const trimesh_values values = any_values(mesh, p, s);
    const size_t channels = values.channels < 1 ? 1 : (size_t)values.channels;
    if (pick(s, 2)) {
        const size_t count = (size_t)pick(s, 60);
        const txm_mesh_place *places = any_places(mesh, count, p, s);
        float *out = FRESH_ARRAY(float, count * channels);
        txm_env env = troubled(&t, s);
        done(trimesh_transfer(mesh, &values, places, count, &env, out), &t, &env, out, count * channels * sizeof *out);
    } else {
        if (pick(s, 2)) make_soup(&other, s);
        const txm_mesh result = other.faces && pick(s, 2) ? view_of(&other, p) : *mesh;
        const txm_mesh_place *places = any_places(mesh, result.vertex_count, p, s);
        float *out = FRESH_ARRAY(float, 3 * result.face_count * channels);
        txm_env env = troubled(&t, s);
        const txm_status status = trimesh_transfer_corners(mesh, &values, &result, places, &env, out);
        if (done(status, &t, &env, out, 3 * result.face_count * channels * sizeof *out))
            must_be_finite(out, 3 * result.face_count * channels);
    }
    must(t.memory.blocks == 0);
}

static void split(const txm_mesh *mesh, pool *p, source *s) {
    const size_t corners = 3 * mesh->face_count;
    const int channels = pick(s, 40) ? 1 + pick(s, 3) : pick(s, 70) - 1, kinds = 1 + pick(s, 4);
    float *values = FRESH_ARRAY(float, corners * (size_t)(channels < 1 ? 1 : channels));
    uint32_t *indices = FRESH_ARRAY(uint32_t, corners), *from = FRESH_ARRAY(uint32_t, corners);
    size_t count = 7, again = 7;
    trouble t;
    for (size_t i = 0; channels > 0 && i < corners * (size_t)channels; i++) values[i] = (float)pick(s, kinds) - 1;
    txm_env env = troubled(&t, s);
    if (done(trimesh_split_corners(mesh, values, channels, &env, indices, from, &count), &t, &env, indices,
             corners * sizeof *indices)) {
        plan_none(&t);
        must(trimesh_split_corners(mesh, values, channels, &env, NULL, NULL, &again) == TXM_OK && again == count);
        must(count <= corners);
        for (size_t i = 0; i < corners; i++) {
            must(indices[i] < count);
            must(mesh->indices[from[indices[i]]] == mesh->indices[i]);
        }
    }
    must(t.memory.blocks == 0);
}

/* ---- textures ----------------------------------------------------------------------------------- */

static void texture(const txm_mesh *mesh, pool *p, source *s) {
    trimesh_choose_desc d;
    trimesh_atlas atlas;
    trouble t;
    memset(&d, 0, sizeof d);
    d.patches = pick(s, 30) ? pick(s, 6) : pick(s, 65540) - 1;
    d.rotations = pick(s, 30) ? (pick(s, 2) ? 3 : pick(s, 2)) : pick(s, 6) - 1;
    d.repeat = pick(s, 3) == 0;
    d.seed = (uint64_t)pick(s, 256);
    int *patches = FRESH_ARRAY(int, mesh->face_count), *rotations = pick(s, 6) ? FRESH_ARRAY(int, mesh->face_count) : NULL;
    txm_env env = troubled(&t, s);
    const txm_status status = trimesh_choose(mesh, pick(s, 20) ? &d : NULL, &env, patches, rotations);
    if (done(status, &t, &env, patches, mesh->face_count * sizeof *patches)) {
        const int count = d.patches < 4 ? 4 : d.patches;
        for (size_t f = 0; f < mesh->face_count; f++) {
            must(patches[f] >= 0 && patches[f] < count);
            must(!rotations || (rotations[f] >= 0 && rotations[f] < 3));
        }
        plan_none(&t);
        const int cells = pick(s, 20) ? txm_clampi(count, 1, 256) : pick(s, 300) - 1;
        const int made = trimesh_atlas_make(cells, pick(s, 20000) - 1, pick(s, 30) - 2, &env, &atlas) == TXM_OK;
        if (made) {
            float *tile_uv = FRESH_ARRAY(float, 6 * atlas.count), *uv = FRESH_ARRAY(float, 6 * mesh->face_count);
            must(trimesh_atlas_uv(&atlas, -1, tile_uv) && !trimesh_atlas_uv(&atlas, atlas.count, tile_uv));
            const txm_status placed = trimesh_place_tiles(mesh->face_count, patches, rotations, tile_uv,
                                                          (size_t)atlas.count, &env, uv);
            if (done(placed, &t, &env, uv, 6 * mesh->face_count * sizeof *uv)) must_be_finite(uv, 6 * mesh->face_count);
        }
    }
    must(t.memory.blocks == 0);
}

static void colors(const txm_mesh *mesh, pool *p, source *s) {
    const int count = pick(s, 20) ? 1 + pick(s, 8) : pick(s, 65540) - 2;
    const size_t sides = 3 * mesh->face_count;
    int *edges = FRESH_ARRAY(int, sides), *ways = pick(s, 6) ? FRESH_ARRAY(int, sides) : NULL;
    int *vertices = FRESH_ARRAY(int, mesh->vertex_count), *drawn = FRESH_ARRAY(int, mesh->vertex_count), used = -1;
    trouble t;
    txm_env env = troubled(&t, s);
    if (done(trimesh_edge_colors(mesh, count, 3, &env, edges, ways), &t, &env, edges, sides * sizeof *edges))
        for (size_t f = 0; f < mesh->face_count; f++) {
            for (size_t k = 0; k < 3; k++) must(edges[3 * f + k] >= 0 && edges[3 * f + k] < count);
            must(!ways || abs(ways[3 * f] + ways[3 * f + 1] + ways[3 * f + 2]) == 1);
        }
    plan_trouble(&t, s);
    if (done(trimesh_random_colors(mesh->vertex_count, count, 4, &env, drawn), &t, &env, drawn, mesh->vertex_count * sizeof *drawn))
        for (size_t v = 0; v < mesh->vertex_count; v++) must(drawn[v] >= 0 && drawn[v] < (count ? count : 3));
    plan_trouble(&t, s);
    if (done(trimesh_proper_colors(mesh, &env, vertices, &used), &t, &env, vertices, mesh->vertex_count * sizeof *vertices)) {
        for (size_t v = 0; v < mesh->vertex_count; v++) must(vertices[v] >= 0 && (!used || vertices[v] < used));
        for (size_t i = 0; i < sides; i++) {
            const uint32_t a = mesh->indices[i], b = mesh->indices[txm_mesh_next(mesh, i)];
            must(a == b || vertices[a] != vertices[b]);
        }
    }
    must(t.memory.blocks == 0);
}

/* ---- instances ------------------------------------------------------------------------------------ */

static float any_number(source *s, float low, float high) {
    static const float odd[6] = {NAN, INFINITY, -1, 1e-30f, 1e30f, 2000};
    if (pick(s, 60) == 0) return odd[pick(s, 6)];
    return pick(s, 3) ? low + (high - low) * unit(s) : 0;
}

static size_t fill_patch(trimesh_point *points, source *s) {
    const int kind = pick(s, 3), count = pick(s, 8) ? pick(s, MOST_POINTS + 1) : 0;
    for (int i = 0; i < count; i++) {
        trimesh_point *q = &points[i];
        memset(q, 0, sizeof *q);
        q->u = kind ? unit(s) : 0.25f * (float)pick(s, 5);
        q->v = kind ? (1 - q->u) * unit(s) : 0.25f * (float)pick(s, 5 - (int)(4 * q->u));
        if (kind == 2 && pick(s, 3) == 0) q->v = pick(s, 2) ? 0 : 1 - q->u;
        q->height = any_number(s, -1, 1);
        q->scale = any_number(s, 0, 2);
        for (int k = 0; k < 4; k++) q->rotation[k] = any_number(s, -1, 1);
        q->prototype = (uint32_t)pick(s, 4);
    }
    return (size_t)count;
}

static void scatter(const txm_mesh *mesh, pool *p, source *s) {
    trimesh_scatter_desc d;
    trimesh_patch patches[3];
    trouble t;
    size_t count = 0, again = 0;
    memset(&d, 0, sizeof d);
    d.mesh = *mesh;
    d.patch_count = pick(s, 40) ? 1 + pick(s, 3) : 0;
    for (int k = 0; k < 3; k++) {
        trimesh_point *points = FRESH_ARRAY(trimesh_point, MOST_POINTS);
        patches[k].count = fill_patch(points, s);
        if (pick(s, 3) == 0) trimesh_order_patch(points, patches[k].count, NULL);
        patches[k].points = points;
    }
    d.patches = patches;
    if (pick(s, 4) == 0) {
        float *n = FRESH_ARRAY(float, 3 * mesh->vertex_count);
        for (size_t i = 0; i < 3 * mesh->vertex_count; i++) n[i] = (float)(i % 3 == 2);
        if (mesh->vertex_count && pick(s, 20) == 0) n[pick(s, (int)mesh->vertex_count)] = any_number(s, -1, 1);
        d.normals = n;
    }
    int *choices = FRESH_ARRAY(int, mesh->face_count), *rotations = FRESH_ARRAY(int, mesh->face_count);
    for (size_t f = 0; f < mesh->face_count; f++) {
        choices[f] = pick(s, d.patch_count + (pick(s, 400) == 0 || !d.patch_count));
        rotations[f] = pick(s, 3 + (pick(s, 400) == 0));
    }
    if (pick(s, 2)) d.choices = choices;
    if (pick(s, 2)) d.rotations = rotations;
    d.unit = any_number(s, 0, 2);
    d.height = any_number(s, -1, 1);
    d.inside = pick(s, 2);
    d.curve = any_number(s, 0, 1);
    if (pick(s, 2)) d.density = any_number(s, 0, 50);
    d.spin = pick(s, 2);
    float mix[3] = {unit(s), pick(s, 2) ? 0 : unit(s), any_number(s, 0, 1)};
    if (pick(s, 3) == 0) {
        d.mix = mix;
        d.mix_count = pick(s, 30) ? 1 + pick(s, 3) : 0;
    }
    txm_env env = troubled(&t, s);
    const txm_status counted = trimesh_scatter(&d, &env, NULL, 0, &count);
    if (succeeded(counted, &t, &env) && count <= MOST_THINGS) {
        const size_t room = pick(s, 20) || !count ? count : count - 1;
        trimesh_instance *out = FRESH_ARRAY(trimesh_instance, room);
        plan_trouble(&t, s);
        t.reports = 0;
        t.cancel_at = 0;
        if (done(trimesh_scatter(&d, &env, out, room, &again), &t, &env, out, room * sizeof *out)) {
            must(again == count);
            for (size_t i = 0; i < count; i++) {
                must(out[i].triangle < mesh->face_count && out[i].rotation[3] >= 0);
                must_be_finite(out[i].position, 3);
                must_be_finite(out[i].rotation, 4);
            }
        }
    }
    must(t.memory.blocks == 0);
}

static void patch(pool *p, source *s) {
    trimesh_patch_desc d;
    trouble t;
    size_t count = 0, again = 0;
    memset(&d, 0, sizeof d);
    d.points = pick(s, 40) ? pick(s, 80) : pick(s, 2) ? -1 : 4097;
    d.hexagonal = pick(s, 3) == 0;
    d.iterations = pick(s, 40) ? pick(s, 12) : pick(s, 2) ? -1 : 1001;
    d.seed = (uint64_t)pick(s, 256);
    txm_env env = troubled(&t, s);
    if (succeeded(trimesh_reference_patch(&d, &env, NULL, 0, &count), &t, &env)) {
        const size_t room = pick(s, 20) ? count : count - 1;
        trimesh_point *points = FRESH_ARRAY(trimesh_point, room);
        t.reports = t.cancel_at = 0;
        const txm_status status = trimesh_reference_patch(&d, &env, points, room, &again);
        if (done(status, &t, &env, points, room * sizeof *points)) {
            must(again == count);
            for (size_t i = 0; i < count; i++) must(points[i].u >= 0 && points[i].v >= 0 && points[i].u + points[i].v <= 1.00001f);
        }
    }
    must(t.memory.blocks == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static pool p;
    static soup m;
    source s = source_of(data, size);
    make_soup(&m, &s);
    const txm_mesh mesh = view_of(&m, &p);
    switch (pick(&s, 8)) {
    case 0: normals(&mesh, &p, &s); break;
    case 1:
    case 2: transfer(&mesh, &p, &s); break;
    case 3: split(&mesh, &p, &s); break;
    case 4: texture(&mesh, &p, &s); break;
    case 5: colors(&mesh, &p, &s); break;
    case 6: scatter(&mesh, &p, &s); break;
    default:
        if (pick(&s, 3)) scatter(&mesh, &p, &s);
        else patch(&p, &s);
    }
    drain(&p);
    return 0;
}
