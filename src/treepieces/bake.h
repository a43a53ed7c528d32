#ifndef TREEPIECES_BAKE_H
#define TREEPIECES_BAKE_H

#include "bones.h"
#include "tessellation.h"
#include "bark.h"
#include "cloud.h"

/* ---- baked meshes ------------------------------------------------------------------------ */

enum {
    TPC_PATTERN_VERTICES = 4 * 64 + 63 * 63,
    TPC_PATTERN_TRIANGLES = 2 * 64 * 64 + 4 * 64,
    TPC_MESH_TRIANGLES = 0x7fffffff / 3 /* corners fit 31 bits */
};

/* A mesh with its memory. */
typedef struct tpc_mesh {
    treepieces_mesh mesh; /* first, so that a pointer to it is one to this */
    txm_arena arena;
} tpc_mesh;

/* An empty mesh in its own arena; NULL: no memory. */
static tpc_mesh *tpc_make_mesh(const txm_env *env) {
    txm_arena arena;
    txm_arena_init(&arena, env);
    tpc_mesh *made = (tpc_mesh *)txm_arena_zero(&arena, 1, sizeof *made);
    if (made) made->arena = arena;
    return made;
}

/* Allocate the arrays for this many vertices and triangles; 0: no memory. */
static int tpc_alloc_mesh(tpc_mesh *made, size_t vertices, size_t triangles) {
    treepieces_mesh *m = &made->mesh;
    m->positions = (float *)txm_arena_alloc(&made->arena, vertices, 3 * sizeof(float));
    m->normals = (float *)txm_arena_alloc(&made->arena, vertices, 3 * sizeof(float));
    m->joints = (uint32_t *)txm_arena_alloc(&made->arena, vertices, 4 * sizeof(uint32_t));
    m->weights = (float *)txm_arena_alloc(&made->arena, vertices, 4 * sizeof(float));
    m->colors = (uint8_t *)txm_arena_alloc(&made->arena, vertices, 4);
    m->indices = (uint32_t *)txm_arena_alloc(&made->arena, triangles, 3 * sizeof(uint32_t));
    m->uvs = (float *)txm_arena_alloc(&made->arena, triangles, 6 * sizeof(float));
    return !made->arena.failed;
}

TREEPIECES_API void treepieces_mesh_free(treepieces_mesh *mesh) {
    if (!mesh) return;
    txm_arena arena = ((tpc_mesh *)mesh)->arena;
    txm_arena_free(&arena);
}

/* The mesh if all went well; else it is released, and NULL. */
static treepieces_mesh *tpc_finish_mesh(tpc_mesh *made, txm_status status) {
    if (status == TXM_OK) return &made->mesh;
    if (made) treepieces_mesh_free(&made->mesh);
    return NULL;
}

/* A mesh under construction. */
typedef struct tpc_baking {
    const treepieces_bake_desc *desc;
    const treepieces_forest *forest;
    const treepieces_tree *tree;
    treepieces_lod lod;
    int sheet_size, layers;
    treepieces_mesh *out;
    int is_broken; /* a position was not finite */
    uint32_t *table; /* vertex + 1 by hash of its position; 0 = free */
    size_t table_mask;
    /* the current quad */
    float coords[2 * TPC_PATTERN_VERTICES];
    uint16_t indices[3 * TPC_PATTERN_TRIANGLES];
    uint32_t numbers[TPC_PATTERN_VERTICES]; /* in the mesh */
    /* the current piece */
    float positions[3 * TREEPIECES_MAX_VERTICES], normals[3 * TREEPIECES_MAX_VERTICES];
    uint32_t joints[4];
    float radii[4]; /* of the joints' bones, metres */
} tpc_baking;

/* Ours, see docs/choices.md#choices-in-treepiecesh: bark of less than the first radius is young, of more than the
   second it is old; dirt reaches so high. Metres. */
static const float tpc_young_radius = 0.012f, tpc_old_radius = 0.05f, tpc_dirt_height = 0.8f;

static void tpc_put_color(const float color[3], uint8_t out[4]) {
    for (int k = 0; k < 3; k++) out[k] = (uint8_t)(255 * txm_clampf(color[k], 0, 1) + 0.5f);
    out[3] = 255;
}

/* The color of bark by the radius of the stem and the height above the ground: twigs are browner than
   the trunk, above all where that is pale. */
static void tpc_age_color(const treepieces_species *species, float radius, float height, uint8_t out[4]) {
    static const float brown[3] = {0.76f, 0.69f, 0.64f};
    const float *bark = species->bark_color;
    const float pale = txm_clampf((bark[0] + bark[1] + bark[2] - 1.6f) / 0.6f, 0, 1);
    const float young = tpc_fade((radius - tpc_young_radius) / (tpc_old_radius - tpc_young_radius));
    const float clean = 1 - 0.12f * tpc_fade(height / tpc_dirt_height);
    float color[3];
    for (int k = 0; k < 3; k++)
        color[k] = clean * txm_lerpf(1, brown[k] * (1 - 0.4f * pale), young);
    tpc_put_color(color, out);
}

/* Note the bones that move the vertices of the current piece. */
static void tpc_note_radii(tpc_baking *b) {
    for (int k = 0; k < 4; k++) {
        const float *bone = b->desc->bones + TREEPIECES_BONE * ((size_t)b->tree->first_node + b->joints[k]);
        b->radii[k] = sqrtf(bone[0] * bone[0] + bone[4] * bone[4] + bone[8] * bone[8]);
    }
}

static int tpc_is_tessellated(const tpc_baking *b) {
    return b->lod.max_level > 1;
}

/* The tessellation levels of a quad: returns the inner one. */
static int tpc_quad_levels(const tpc_baking *b, const float positions[12], int edges[4]) {
    for (int k = 0; k < 4; k++) edges[k] = 1;
    if (!tpc_is_tessellated(b)) return 1;
    for (int k = 0; k < 4; k++)
        edges[k] = treepieces_edge_level(&b->lod, positions + 3 * k, positions + 3 * ((k + 1) % 4));
    return treepieces_inner_level(&b->lod, positions);
}

/* The vertex at exactly this position; a new one if there is none. A NaN is refused: its bits are
   not reproducible, so that there could be more vertices than were counted. */
static uint32_t tpc_weld(tpc_baking *b, const float position[3], const float normal[3],
                         const float weights[4]) {
    treepieces_mesh *m = b->out;
    uint32_t bits[3], there[3];
    for (int k = 0; k < 3; k++) {
        const float x = position[k] + 0.0f; /* -0 is 0 */
        memcpy(&bits[k], &x, sizeof x);
        if (!txm_is_finite((double)x)) b->is_broken = 1;
    }
    if (b->is_broken) return 0;
    size_t slot = (size_t)txm_hash(bits[0] ^ (uint64_t)bits[1] << 32 ^ (uint64_t)bits[2] << 16);
    for (;; slot++) {
        const uint32_t found = b->table[slot & b->table_mask];
        if (!found) break;
        memcpy(there, m->positions + 3 * (size_t)(found - 1), sizeof there);
        if (memcmp(there, bits, sizeof bits) == 0) return found - 1;
    }
    const size_t i = m->vertex_count++;
    b->table[slot & b->table_mask] = (uint32_t)i + 1;
    memcpy(m->positions + 3 * i, bits, sizeof bits);
    memcpy(m->normals + 3 * i, normal, 3 * sizeof *normal);
    float radius = 0;
    for (int k = 0; k < 4; k++) {
        m->joints[4 * i + (size_t)k] = weights[k] > 0 ? b->joints[k] : 0;
        m->weights[4 * i + (size_t)k] = weights[k];
        radius += weights[k] * b->radii[k];
    }
    tpc_age_color(&b->forest->species[b->tree->species], radius, position[1] - b->tree->position[1],
                  m->colors + 4 * i);
    return (uint32_t)i;
}

/* How well a triangle faces the direction of the normals; below 0: it faces away. */
static float tpc_facing(const float *a, const float *b, const float *c, const float normals[12]) {
    float u[3], v[3], n[3], cross[3];
    for (int k = 0; k < 3; k++) {
        u[k] = b[k] - a[k];
        v[k] = c[k] - a[k];
        n[k] = (normals[k] + normals[3 + k]) + (normals[6 + k] + normals[9 + k]);
    }
    tpc_cross(u, v, cross);
    const float length = sqrtf(tpc_dot(cross, cross));
    return length > 0 ? tpc_dot(cross, n) / length : 0;
}

/* Split a quad of level 1 along the diagonal whose worse triangle is better. */
static void tpc_choose_diagonal(const float p[12], const float n[12], uint16_t indices[6]) {
    static const uint16_t other[6] = {1, 2, 3, 1, 3, 0};
    const float kept = txm_minf(tpc_facing(p, p + 3, p + 6, n), tpc_facing(p, p + 6, p + 9, n));
    const float turned =
        txm_minf(tpc_facing(p + 3, p + 6, p + 9, n), tpc_facing(p + 3, p + 9, p, n));
    if (turned > kept) memcpy(indices, other, sizeof other);
}

static void tpc_bake_quad(tpc_baking *b, const treepieces_piece *piece, const uint32_t *record,
                          int index) {
    const treepieces_quad *q = &piece->quads[index];
    const int cell = (int)(record[4 + index / 4] >> (8 * (index & 3)) & 255u);
    float positions[12], normals[12], uv[4][2];
    int edges[4], triangles, layer = 0;
    for (int k = 0; k < 4; k++) {
        memcpy(positions + 3 * k, b->positions + 3 * q->corners[k], 3 * sizeof(float));
        memcpy(normals + 3 * k, b->normals + 3 * q->corners[k], 3 * sizeof(float));
        layer = treepieces_quad_uv(q, record[3], cell, b->sheet_size, k, uv[k]);
    }
    const int inner = tpc_quad_levels(b, positions, edges);
    const int vertices = treepieces_pattern(edges, inner, b->coords, b->indices, &triangles);
    if (triangles == 2) tpc_choose_diagonal(positions, normals, b->indices);
    for (int i = 0; i < vertices; i++) {
        const float u = b->coords[2 * i], v = b->coords[2 * i + 1];
        float w[4], position[3], normal[3], weights[4], sum = 0;
        tpc_corner_weights(u, v, w);
        treepieces_patch_point(positions, normals, b->lod.shape, u, v, position, normal);
        for (int k = 0; k < 4; k++) {
            const treepieces_vertex *c = piece->vertices;
            weights[k] = tpc_mix(w, c[q->corners[0]].weights[k], c[q->corners[1]].weights[k],
                                 c[q->corners[2]].weights[k], c[q->corners[3]].weights[k]);
            sum += weights[k];
        }
        for (int k = 0; k < 4; k++) weights[k] /= sum;
        b->numbers[i] = tpc_weld(b, position, normal, weights);
    }
    for (int i = 0; i < 3 * triangles; i++) {
        const size_t at = 3 * b->out->triangle_count + (size_t)i;
        const float u = b->coords[2 * b->indices[i]], v = b->coords[2 * b->indices[i] + 1];
        float w[4];
        tpc_corner_weights(u, v, w);
        b->out->indices[at] = b->numbers[b->indices[i]];
        b->out->uvs[2 * at] = tpc_mix(w, uv[0][0], uv[1][0], uv[2][0], uv[3][0]);
        b->out->uvs[2 * at + 1] =
            ((float)layer + tpc_mix(w, uv[0][1], uv[1][1], uv[2][1], uv[3][1])) / (float)b->layers;
    }
    b->out->triangle_count += (size_t)triangles;
}

/* The first record of a tree in a batch, where its records are contiguous; *count: how many. */
static uint32_t tpc_first_record(const treepieces_batch *batch, const treepieces_tree *tree,
                                 uint32_t *count) {
    uint32_t ends[2];
    for (int e = 0; e < 2; e++) { /* the first record whose bone is not lower */
        const uint32_t bone = tree->first_node + (e ? tree->node_count : 0);
        uint32_t low = 0, high = batch->count;
        while (low < high) {
            const uint32_t middle = low + (high - low) / 2;
            if (batch->words[(size_t)middle * batch->stride] < bone) low = middle + 1;
            else high = middle;
        }
        ends[e] = low;
    }
    *count = ends[1] - ends[0];
    return ends[0];
}

/* Visit all quads: count vertices and triangles (out NULL), or bake them. */
static txm_status tpc_bake_tree(tpc_baking *b, txm_env *env, size_t *vertices, size_t *triangles) {
    uint32_t done = 0;
    for (int t = 0; t < b->forest->type_count; t++) {
        const treepieces_piece *piece = &b->forest->kit->pieces[t];
        const treepieces_batch *batch = &b->forest->batches[t];
        uint32_t count;
        const uint32_t first = tpc_first_record(batch, b->tree, &count);
        for (uint32_t i = first; i < first + count; i++, done++) {
            const uint32_t *record = batch->words + (size_t)i * batch->stride;
            const uint32_t own = record[0] - b->tree->first_node;
            if ((done & 63) == 0 &&
                txm_progress(env, (b->out ? 0.3f : 0) + (b->out ? 0.7f : 0.3f) * (float)done /
                                      (float)b->tree->node_count, "bake"))
                return txm_fail(env, TXM_CANCELLED, "cancelled");
            if (*triangles > TPC_MESH_TRIANGLES)
                return txm_fail(env, TXM_TOO_LARGE, "more than 2^31 corners");
            if (!b->out && !tpc_is_tessellated(b)) {
                *vertices += (size_t)piece->vertex_count;
                *triangles += 2 * (size_t)piece->quad_count;
                continue;
            }
            treepieces_skin(b->forest, b->desc->bones, t, i, b->positions, b->normals);
            tpc_children(record, b->joints + 1);
            b->joints[0] = own;
            for (int k = 1; k < 4; k++) b->joints[k] += own;
            tpc_note_radii(b);
            for (int k = 0; k < piece->quad_count; k++) {
                float positions[12];
                int edges[4], more;
                if (b->out) {
                    tpc_bake_quad(b, piece, record, k);
                    continue;
                }
                for (int c = 0; c < 4; c++)
                    memcpy(positions + 3 * c, b->positions + 3 * piece->quads[k].corners[c],
                           3 * sizeof(float));
                const int inner = tpc_quad_levels(b, positions, edges);
                *vertices += (size_t)treepieces_pattern(edges, inner, NULL, NULL, &more);
                *triangles += (size_t)more;
            }
            if (b->is_broken)
                return txm_fail(env, TXM_BAD_ARGUMENT, "bones are not finite, or flat");
        }
    }
    return TXM_OK;
}

/* The vertices along the root rim and at its centre: their numbers in the mesh, and their positions
   in the plane of the rim. */
typedef struct tpc_cap {
    uint32_t numbers[TREEPIECES_RIM * 64 + 1];
    float places[TREEPIECES_RIM * 64 + 1][2];
    int count; /* without the centre */
} tpc_cap;

static void tpc_find_cap(tpc_baking *b, const treepieces_piece *piece, tpc_cap *cap) {
    const float own[4] = {1, 0, 0, 0};
    cap->count = 0;
    for (int j = 0; j < TREEPIECES_RIM; j++) { /* side j as the edge from corner 0 to 1 of a quad */
        float p[12], normals[12], from[3], to[3], at[3], normal[3];
        for (int k = 0; k < 4; k++) {
            const int vertex = piece->root_rim[(j + (k == 1)) % TREEPIECES_RIM];
            memcpy(p + 3 * k, b->positions + 3 * vertex, 3 * sizeof(float));
            memcpy(normals + 3 * k, b->normals + 3 * vertex, 3 * sizeof(float));
        }
        tpc_rim_vertex(j, from, normal);
        tpc_rim_vertex((j + 1) % TREEPIECES_RIM, to, normal);
        const int level = tpc_is_tessellated(b) ? treepieces_edge_level(&b->lod, p, p + 3) : 1;
        for (int i = 0; i < level; i++, cap->count++) {
            const float t = tpc_fraction(i, level);
            treepieces_patch_point(p, normals, b->lod.shape, 0, t, at, normal);
            cap->numbers[cap->count] = tpc_weld(b, at, normal, own);
            cap->places[cap->count][0] = (1 - t) * from[0] + t * to[0];
            cap->places[cap->count][1] = (1 - t) * from[2] + t * to[2];
        }
    }
}

/* Close the base: a hexagon by a fan of four triangles, a finer rim, which need not be convex, by a
   fan about its centre. */
static void tpc_bake_cap(tpc_baking *b) {
    const float own[4] = {1, 0, 0, 0}, middle[3] = {0, 0, 0}, down[3] = {0, -1, 0};
    const int type = b->forest->nodes[b->tree->first_node].type;
    const float *bone = b->desc->bones + TREEPIECES_BONE * (size_t)b->tree->first_node;
    treepieces_mesh *m = b->out;
    uint32_t records;
    tpc_cap cap;
    const uint32_t first = tpc_first_record(&b->forest->batches[type], b->tree, &records);
    treepieces_skin(b->forest, b->desc->bones, type, first, b->positions, b->normals);
    memset(b->joints, 0, sizeof b->joints);
    tpc_note_radii(b);
    tpc_find_cap(b, &b->forest->kit->pieces[type], &cap);
    const int is_fine = cap.count > TREEPIECES_RIM, hub = is_fine ? cap.count : 0;
    if (is_fine) {
        float at[3], normal[3];
        tpc_move_point(bone, middle, at);
        tpc_move_normal(bone, down, normal);
        tpc_unit(normal);
        cap.numbers[hub] = tpc_weld(b, at, normal, own);
        memset(cap.places[hub], 0, sizeof cap.places[hub]);
    }
    for (int i = !is_fine; i < cap.count - !is_fine; i++) {
        const int corners[3] = {hub, (i + 1) % cap.count, i}; /* seen from below */
        for (int k = 0; k < 3; k++) {
            const size_t at = 3 * m->triangle_count + (size_t)k;
            const float *place = cap.places[corners[k]]; /* covers layer 0 */
            m->indices[at] = cap.numbers[corners[k]];
            m->uvs[2 * at] = 0.5f + 0.49f * place[0];
            m->uvs[2 * at + 1] = (0.5f - 0.49f * place[1]) / (float)b->layers;
        }
        m->triangle_count++;
    }
}

static txm_status tpc_bake_into(tpc_baking *b, tpc_mesh *made, txm_env *env) {
    size_t vertices = 0, triangles = 0, slots = 64;
    txm_status status = tpc_bake_tree(b, env, &vertices, &triangles);
    if (status != TXM_OK) return status;
    if (b->desc->capped) {
        vertices++;
        triangles += TREEPIECES_RIM * 64;
    }
    if (triangles > TPC_MESH_TRIANGLES)
        return txm_fail(env, TXM_TOO_LARGE, "more than 2^31 corners");
    while (slots < 2 * vertices) slots *= 2;
    b->table = (uint32_t *)txm_alloc(env, slots * sizeof(uint32_t));
    if (!tpc_alloc_mesh(made, vertices, triangles) || !b->table)
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the mesh");
    memset(b->table, 0, slots * sizeof(uint32_t));
    b->table_mask = slots - 1;
    b->out = &made->mesh;
    status = tpc_bake_tree(b, env, &vertices, &triangles);
    if (status == TXM_OK && b->desc->capped) tpc_bake_cap(b);
    return status;
}

static int tpc_has_tree(const treepieces_forest *forest, int tree) {
    return forest && tree >= 0 && tree < forest->tree_count;
}

TREEPIECES_API txm_status treepieces_bake(const treepieces_bake_desc *desc, txm_env *env,
                                          treepieces_mesh **out) {
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    if (!desc || !desc->bones || !tpc_has_tree(desc->forest, desc->tree))
        return txm_fail(env, TXM_BAD_ARGUMENT, "desc or bones is NULL, or there is no such tree");
    if (desc->sheet_size < 0 || desc->sheet_layers < 0 || desc->sheet_layers > 64)
        return txm_fail(env, TXM_BAD_ARGUMENT, "sheet_size or sheet_layers is out of range");
    if (desc->lod && (!(desc->lod->max_level >= 0 && desc->lod->max_level <= 64) ||
                      !(desc->lod->half_distance >= 0) || !(desc->lod->shape <= 1)))
        return txm_fail(env, TXM_BAD_ARGUMENT, "lod: a field is out of range");
    tpc_mesh *made = tpc_make_mesh(env);
    tpc_baking *b = (tpc_baking *)txm_alloc(env, sizeof *b);
    txm_status status = TXM_OK;
    if (!made || !b) {
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the mesh");
    } else {
        memset(b, 0, sizeof *b);
        b->desc = desc;
        b->forest = desc->forest;
        b->tree = &desc->forest->trees[desc->tree];
        if (desc->lod) b->lod = *desc->lod;
        b->sheet_size = desc->sheet_size ? desc->sheet_size : 512;
        b->layers = desc->sheet_layers ? desc->sheet_layers : TREEPIECES_OWN;
        status = tpc_bake_into(b, made, env);
        txm_free(env, b->table);
    }
    txm_free(env, b);
    *out = tpc_finish_mesh(made, status);
    return status;
}

/* ---- foliage: baked leaf cards ------------------------------------------------------------- */

/* A cloud where it is in a tree: turned about y by bits of its look, so that those of one kind differ. */
typedef struct tpc_placed_cloud {
    float center[3], radius;
    float sine, cosine;
    float crown[3]; /* a point below the middle of the crown, from which its surface is seen */
    uint32_t joint;
    uint8_t color[4];
} tpc_placed_cloud;

/* The middle of a crown and, along each axis, about half its width. */
typedef struct tpc_crown {
    float middle[3], reach[3];
} tpc_crown;

static void tpc_cluster_center(const treepieces_cluster *c, const float *bones, float center[3]) {
    const float *bone = bones + (size_t)c->node * TREEPIECES_BONE;
    for (int k = 0; k < 3; k++) center[k] = bone[4 * k + 3] + c->along * bone[4 * k + 1];
}

static void tpc_place_cloud(const treepieces_cluster *c, const float *bones, uint32_t first_node,
                            const tpc_crown *crown, tpc_placed_cloud *cloud) {
    double sine, cosine;
    float off[3], color[3];
    txm_sincos((double)(c->look >> 8 & 255u) * (TXM_PI / 128), &sine, &cosine);
    tpc_cluster_center(c, bones, cloud->center);
    cloud->radius = c->radius;
    cloud->sine = txm_float(sine);
    cloud->cosine = txm_float(cosine);
    memcpy(cloud->crown, crown->middle, sizeof cloud->crown);
    cloud->crown[1] -= 0.5f * crown->reach[1];
    cloud->joint = c->node - first_node;
    /* darker inside; lighter or darker, yellower or bluer at random */
    for (int k = 0; k < 3; k++) off[k] = (cloud->center[k] - crown->middle[k]) / crown->reach[k];
    const float inside = tpc_fade(tpc_dot(off, off));
    const float warm = (float)(c->look >> 16 & 255u) / 255 - 0.5f, light = (float)(c->look >> 24) / 255 - 0.5f;
    for (int k = 0; k < 3; k++) {
        static const float tints[3] = {0.1f, 0, -0.12f};
        color[k] = (0.96f - 0.3f * inside) * (1 + 0.1f * light) * (1 + tints[k] * warm);
    }
    tpc_put_color(color, cloud->color);
}

static void tpc_turn_cloud(const tpc_placed_cloud *cloud, const float v[3], float out[3]) {
    out[0] = cloud->cosine * v[0] + cloud->sine * v[2];
    out[1] = v[1];
    out[2] = cloud->cosine * v[2] - cloud->sine * v[0];
}

/* Write card number `index` of the mesh. Its normal is bent outwards, so that light runs round the
   crown and not round each cloud; its front is turned to those who
   look at the tree, mirrored if need be, as renderers turn the normals of backs round. */
static void tpc_bake_card(treepieces_mesh *m, size_t index, const treepieces_card *card,
                          const tpc_placed_cloud *cloud) {
    static const float sides[4][2] = {{-1, 1}, {-1, -1}, {1, -1}, {1, 1}}; /* nw, sw, se, ne */
    static const uint32_t corners[6] = {0, 1, 2, 0, 2, 3};
    float center[3], right[3], up[3], normal[3], face[3];
    tpc_turn_cloud(cloud, card->center, center);
    tpc_turn_cloud(cloud, card->right, right);
    tpc_turn_cloud(cloud, card->up, up);
    for (int a = 0; a < 3; a++) {
        center[a] = cloud->center[a] + cloud->radius * center[a];
        normal[a] = center[a] - cloud->crown[a];
    }
    const float aside[3] = {normal[0], 0.1f * normal[1], normal[2]}; /* most are seen from there */
    tpc_unit_or(normal, 0, 1, 0);
    tpc_cross(right, up, face);
    tpc_unit_or(face, 0, 1, 0);
    if (tpc_dot(face, aside) < 0) {
        for (int k = 0; k < 3; k++) {
            right[k] = -right[k];
            face[k] = -face[k];
        }
    }
    for (int a = 0; a < 3; a++) normal[a] = 0.8f * normal[a] + 0.4f * face[a];
    tpc_unit_or(normal, 0, 1, 0);
    for (size_t k = 0; k < 4; k++) {
        const size_t vertex = 4 * index + k;
        for (size_t a = 0; a < 3; a++) {
            const float across = sides[k][0] * right[a] + sides[k][1] * up[a];
            m->positions[3 * vertex + a] = center[a] + cloud->radius * across;
            m->normals[3 * vertex + a] = normal[a];
        }
        for (size_t j = 0; j < 4; j++) {
            m->joints[4 * vertex + j] = j ? 0 : cloud->joint;
            m->weights[4 * vertex + j] = j ? 0 : 1;
            m->colors[4 * vertex + j] = cloud->color[j];
        }
    }
    for (size_t k = 0; k < 6; k++) {
        m->indices[6 * index + k] = (uint32_t)(4 * index) + corners[k];
        m->uvs[12 * index + 2 * k] = sides[corners[k]][0] > 0 ? 1.0f : 0.0f;
        m->uvs[12 * index + 2 * k + 1] = sides[corners[k]][1] > 0 ? 0.0f : 1.0f;
    }
}

/* The mean of the centres of the leaf clouds, and how far they spread. */
static void tpc_measure_crown(const treepieces_forest *forest, const treepieces_tree *t,
                              const float *bones, tpc_crown *crown) {
    double sum[3] = {0, 0, 0}, square[3] = {0, 0, 0};
    const double count = t->cluster_count ? t->cluster_count : 1;
    float center[3];
    for (uint32_t i = 0; i < t->cluster_count; i++) {
        tpc_cluster_center(&forest->clusters[t->first_cluster + i], bones, center);
        for (int k = 0; k < 3; k++) {
            const double off = (double)(center[k] - t->position[k]);
            sum[k] += off;
            square[k] += off * off;
        }
    }
    for (int k = 0; k < 3; k++) {
        const double mean = sum[k] / count, spread = square[k] / count - mean * mean;
        crown->middle[k] = t->position[k] + txm_float(mean);
        crown->reach[k] = 1.9f * sqrtf(txm_maxf(txm_float(spread), 0)) + 0.01f;
    }
}

TREEPIECES_API txm_status treepieces_bake_leaves(const treepieces_forest *forest, int tree,
                                                 const float *bones, int looks, txm_env *env,
                                                 treepieces_mesh **out) {
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    if (!bones || !tpc_has_tree(forest, tree))
        return txm_fail(env, TXM_BAD_ARGUMENT, "forest or bones is NULL, or there is no such tree");
    if (looks < 1 || looks > 64) return txm_fail(env, TXM_BAD_ARGUMENT, "looks must be 1 to 64");
    const treepieces_tree *t = &forest->trees[tree];
    const treepieces_species *species = &forest->species[t->species];
    const size_t count = (size_t)treepieces_cloud(species, 0, NULL);
    if (count * t->cluster_count > 0x7fffffffu / 6)
        return txm_fail(env, TXM_TOO_LARGE, "more than 2^31 corners");
    const size_t all = count * t->cluster_count;
    txm_arena scratch;
    txm_arena_init(&scratch, env);
    tpc_mesh *made = tpc_make_mesh(env);
    treepieces_card *cards =
        (treepieces_card *)txm_arena_alloc(&scratch, (size_t)looks * (count + 1), sizeof *cards);
    txm_status status = TXM_OK;
    if (!made || !cards || !tpc_alloc_mesh(made, 4 * all, 2 * all)) {
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the mesh");
    } else {
        made->mesh.vertex_count = 4 * all;
        made->mesh.triangle_count = 2 * all;
    }
    for (int k = 0; k < looks && status == TXM_OK; k++)
        treepieces_cloud(species, (uint32_t)k, cards + (size_t)k * count);
    tpc_crown crown;
    tpc_measure_crown(forest, t, bones, &crown);
    for (uint32_t i = 0; i < t->cluster_count && status == TXM_OK; i++) {
        const treepieces_cluster *c = &forest->clusters[t->first_cluster + i];
        const treepieces_card *look = cards + (size_t)(c->look % (uint32_t)looks) * count;
        tpc_placed_cloud cloud;
        tpc_place_cloud(c, bones, t->first_node, &crown, &cloud);
        for (size_t k = 0; k < count; k++) tpc_bake_card(&made->mesh, count * i + k, &look[k], &cloud);
    }
    txm_arena_free(&scratch);
    *out = tpc_finish_mesh(made, status);
    return status;
}

#endif /* TREEPIECES_BAKE_H */
