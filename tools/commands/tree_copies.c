/* tree_copies.c - a forest as instances of a few pieces and leaf clouds
   SPDX-License-Identifier: MIT OR Unlicense

   An instance is placed by translation, rotation and scale, so pieces are rigid: all of one type
   have the mean shape, and where a branch bends more or less than the mean, the rims of adjacent
   pieces do not meet. Every piece therefore begins a little before its root rim, inside the piece
   below.                                                                                         */
#include "tree.h"

#include <stdio.h>

enum { SAMPLED = 200 }; /* instances for the mean shape, at most */
static const float SLEEVE_DEPTH = 0.08f; /* of the piece's length */
static const float SLEEVE_RADIUS = 0.94f;

static const float *bone_of(const tree_job *j, uint32_t node) {
    return j->posed + TREEPIECES_BONE * (size_t)node;
}

static float column_length(const float *bone, int c) {
    return sqrtf(bone[c] * bone[c] + bone[4 + c] * bone[4 + c] + bone[8 + c] * bone[8 + c]);
}

static int new_mesh(tree_job *j, size_t vertices, size_t triangles, mesh_data *m) {
    m->vertex_count = vertices;
    m->triangle_count = triangles;
    m->positions = (float *)new_array(vertices, 3 * sizeof(float));
    m->normals = (float *)new_array(vertices, 3 * sizeof(float));
    m->indices = (uint32_t *)new_array(triangles, 3 * sizeof(uint32_t));
    m->uvs = (float *)new_array(triangles, 6 * sizeof(float));
    return m->positions && m->normals && m->indices && m->uvs ? CLI_DONE : fail_memory(&j->run);
}

/* The next entry, with room for so many copies. */
static mesh_instances *new_copies(tree_job *j, tree_copies *copies, size_t count,
                                  const mesh_material *material, const char *name) {
    const int i = copies->count;
    mesh_instances *t = &copies->list[i];
    float *block = (float *)new_array(count, 10 * sizeof(float));
    if (!block) {
        fail_memory(&j->run);
        return NULL;
    }
    copies->blocks[i] = block;
    copies->count++;
    snprintf(copies->names[i], sizeof copies->names[i], "%.39s", name);
    t->mesh = &copies->meshes[i];
    t->count = count;
    t->translations = block;
    t->rotations = block + 3 * count;
    t->scales = block + 7 * count;
    t->material = material;
    t->name = copies->names[i];
    return t;
}

static void place_copy(const mesh_instances *t, size_t i, const float place[3], txm_quat q,
                       float across, float along) {
    const double rotation[4] = {q.x, q.y, q.z, q.w};
    float *block = (float *)t->translations; /* ours, see new_copies */
    memcpy(block + 3 * i, place, 3 * sizeof(float));
    for (size_t k = 0; k < 4; k++) block[3 * t->count + 4 * i + k] = (float)rotation[k];
    block[7 * t->count + 3 * i] = across;
    block[7 * t->count + 3 * i + 1] = along;
    block[7 * t->count + 3 * i + 2] = across;
}

/* ---- pieces -------------------------------------------------------------------------------- */

/* Add a corner of a triangle with its texture coordinates. */
static void put_corner(mesh_data *m, size_t *corner, uint32_t vertex, const float uv[2]) {
    m->indices[*corner] = vertex;
    memcpy(m->uvs + 2 * *corner, uv, 2 * sizeof(float));
    ++*corner;
}

/* The mean shape of a type of piece in its own frame, weighted by thickness. It includes the mean
   direction of its branches, so that their rims fit approximately. */
static void mean_shape(const tree_job *j, int type, int vertices, mesh_data *m) {
    const treepieces_batch *b = &j->forest->batches[type];
    const uint32_t step = b->count / SAMPLED + 1;
    float positions[3 * TREEPIECES_MAX_VERTICES], normals[3 * TREEPIECES_MAX_VERTICES];
    double place[3 * TREEPIECES_MAX_VERTICES] = {0}, normal[3 * TREEPIECES_MAX_VERTICES] = {0};
    double weights = 0;
    for (uint32_t i = 0; i < b->count; i += step) {
        const float *bone = bone_of(j, b->words[(size_t)i * b->stride]);
        const double weight = (double)column_length(bone, 0);
        treepieces_skin(j->forest, j->posed, type, i, positions, normals);
        for (int v = 0; v < 3 * vertices; v++) {
            const int first = v - v % 3, c = v % 3; /* along column c of the bone */
            double square = 0, along = 0, facing = 0;
            for (int r = 0; r < 3; r++) {
                const double axis = (double)bone[4 * r + c];
                square += axis * axis;
                along += axis * ((double)positions[first + r] - (double)bone[4 * r + 3]);
                facing += axis * (double)normals[first + r];
            }
            place[v] += weight * along / square;
            normal[v] += facing; /* weighted by the size of the piece */
        }
        weights += weight;
    }
    for (int v = 0; v < vertices; v++) {
        double *n = normal + 3 * v;
        const double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        for (int c = 0; c < 3; c++) {
            m->positions[3 * v + c] = (float)(place[3 * v + c] / weights);
            m->normals[3 * v + c] = length > 0 ? (float)(n[c] / length) : (float)(c == 1);
        }
    }
}

/* A type of piece with the tiles of one of its instances, and the sleeve below its root rim. */
static int make_piece(tree_job *j, int type, mesh_data *m) {
    static const int order[6] = {0, 1, 2, 0, 2, 3};
    const treepieces_piece *p = treepieces_kit_piece(j->kit, type);
    const treepieces_batch *b = &j->forest->batches[type];
    const uint32_t *record = b->words + (size_t)(b->count / 2) * b->stride;
    const uint32_t n = (uint32_t)p->vertex_count, rim = TREEPIECES_RIM;
    const int status = new_mesh(j, n + rim, 2 * ((size_t)p->quad_count + rim), m);
    size_t corner = 0;
    if (status) return status;
    mean_shape(j, type, p->vertex_count, m);
    for (uint32_t i = 0; i < rim; i++) {
        const uint32_t from = 3 * (uint32_t)p->root_rim[i], to = 3 * (n + i);
        m->positions[to] = SLEEVE_RADIUS * m->positions[from];
        m->positions[to + 1] = -SLEEVE_DEPTH;
        m->positions[to + 2] = SLEEVE_RADIUS * m->positions[from + 2];
        memcpy(m->normals + to, m->normals + from, 3 * sizeof(float));
    }
    for (int i = 0; i < p->quad_count; i++) {
        const treepieces_quad *q = &p->quads[i];
        const int cell = (int)(record[4 + i / 4] >> 8 * (i % 4) & 255);
        float uv[4][2];
        for (int k = 0; k < 4; k++) {
            const int layer = treepieces_quad_uv(q, record[3], cell, j->bark[0].width, k, uv[k]);
            uv[k][1] = ((float)layer + uv[k][1]) / TREEPIECES_OWN;
        }
        for (int k = 0; k < 6; k++) put_corner(m, &corner, q->corners[order[k]], uv[order[k]]);
        for (uint32_t k = 0; k < rim; k++) { /* is its south side on the root rim? */
            const uint32_t next = (k + 1) % rim;
            if (q->corners[1] != p->root_rim[k] || q->corners[2] != p->root_rim[next]) continue;
            const uint32_t corners[4] = {q->corners[1], n + k, n + next, q->corners[2]};
            for (int c = 0; c < 6; c++)
                put_corner(m, &corner, corners[order[c]], uv[order[c] < 2 ? 1 : 2]);
        }
    }
    m->triangle_count = corner / 3;
    return CLI_DONE;
}

/* The species of each node of the forest; NULL without memory. */
static unsigned char *list_species(const tree_job *j) {
    const treepieces_forest *f = j->forest;
    unsigned char *species = (unsigned char *)new_array(f->node_count, 1);
    for (int t = 0; t < f->tree_count && species; t++)
        memset(species + f->trees[t].first_node, f->trees[t].species, f->trees[t].node_count);
    return species;
}

/* The factor from the picture's color to the species' bark. */
static void bark_factor(const treepieces_species *species, const float tint[3],
                        unsigned char factor[4]) {
    for (int k = 0; k < 3; k++) {
        const float want = txm_srgb_to_linear(species->bark_color[k]);
        const float have = txm_srgb_to_linear(tint[k]);
        const float ratio = have > 0 ? txm_clampf(want / have, 0, 1) : 1;
        factor[k] = (unsigned char)(255 * txm_linear_to_srgb(ratio) + 0.5f);
    }
    factor[3] = 255;
}

static int copy_pieces(tree_job *j, int type, const unsigned char *species, const float tint[3],
                       tree_copies *copies) {
    const treepieces_batch *b = &j->forest->batches[type];
    const int own = copies->count;
    mesh_instances *t = new_copies(j, copies, b->count, &j->bark_materials[0],
                                   treepieces_kit_piece(j->kit, type)->name);
    if (!t) return CLI_FAILED;
    if (j->species_count > 1 && !j->tiles) {
        copies->colors[own] = (unsigned char *)new_array(b->count, 4);
        if (!copies->colors[own]) return fail_memory(&j->run);
        t->colors = copies->colors[own];
    }
    for (uint32_t i = 0; i < b->count; i++) {
        const uint32_t node = b->words[(size_t)i * b->stride];
        const float *bone = bone_of(j, node), place[3] = {bone[3], bone[7], bone[11]};
        place_copy(t, i, place, tree_bone_rotation(bone), column_length(bone, 0),
                   column_length(bone, 1));
        if (t->colors)
            bark_factor(&j->species[species[node]], tint, copies->colors[own] + 4 * (size_t)i);
    }
    return make_piece(j, type, &copies->meshes[own]);
}

/* ---- leaf clouds --------------------------------------------------------------------------- */

/* Cloud number `look` of a species as two triangles a card. */
static int make_cloud(tree_job *j, const treepieces_species *species, uint32_t look, mesh_data *m) {
    static const float sides[4][2] = {{-1, 1}, {-1, -1}, {1, -1}, {1, 1}};
    static const float uv[4][2] = {{0, 0}, {0, 1}, {1, 1}, {1, 0}};
    static const int order[6] = {0, 1, 2, 0, 2, 3};
    const int count = treepieces_cloud(species, look, NULL);
    treepieces_card *cards = (treepieces_card *)new_array((size_t)count, sizeof *cards);
    int status =
        cards ? new_mesh(j, 4 * (size_t)count, 2 * (size_t)count, m) : fail_memory(&j->run);
    size_t corner = 0;
    if (!status) treepieces_cloud(species, look, cards);
    for (int i = 0; i < count && !status; i++) {
        const treepieces_card *c = &cards[i];
        const size_t first = 4 * (size_t)i;
        for (size_t k = 0; k < 4; k++) {
            for (size_t a = 0; a < 3; a++)
                m->positions[3 * (first + k) + a] =
                    c->center[a] + sides[k][0] * c->right[a] + sides[k][1] * c->up[a];
            memcpy(m->normals + 3 * (first + k), c->normal, sizeof c->normal);
        }
        for (int k = 0; k < 6; k++)
            put_corner(m, &corner, (uint32_t)first + (uint32_t)order[k], uv[order[k]]);
    }
    free(cards);
    return status;
}

/* A cloud is placed as in treepieces_bake_leaves, and turned about y by one of eight turns, since
   there are fewer different clouds here. */
static void place_cloud(const tree_job *j, const treepieces_cluster *c, const mesh_instances *t,
                        size_t i) {
    static const double eighths[8] = {0, 0.38268343236508977, 0.70710678118654752, 0.92387953251128676,
                                      1, 0.92387953251128676, 0.70710678118654752, 0.38268343236508977};
    const float *bone = bone_of(j, c->node);
    const int turn = (int)(c->look >> 29);
    const txm_quat q = {0, eighths[turn], 0, turn < 4 ? eighths[4 - turn] : -eighths[turn - 4]};
    const float center[3] = {bone[3] + c->along * bone[1], bone[7] + c->along * bone[5],
                             bone[11] + c->along * bone[9]};
    place_copy(t, i, center, q, c->radius, c->radius);
}

static int copy_cloud(tree_job *j, int s, uint32_t look, uint32_t looks,
                      const unsigned char *species, tree_copies *copies) {
    const treepieces_forest *f = j->forest;
    const int own = copies->count;
    char name[48];
    size_t count = 0;
    for (int fill = 0; fill < 2; fill++) {
        mesh_instances *t = NULL;
        if (fill) {
            snprintf(name, sizeof name, "leaves %d", own);
            t = count ? new_copies(j, copies, count, &j->leaf_materials[s], name) : NULL;
            if (!t) return count ? CLI_FAILED : CLI_DONE;
            count = 0;
        }
        for (uint32_t i = 0; i < f->cluster_count; i++) {
            const treepieces_cluster *c = &f->clusters[i];
            if (species[c->node] != s || c->look % looks != look) continue;
            if (fill) place_cloud(j, c, t, count);
            count++;
        }
    }
    return make_cloud(j, &j->species[s], look, &copies->meshes[own]);
}

/* ---- all of it ----------------------------------------------------------------------------- */

int tree_make_copies(tree_job *j, const float tint[3], tree_copies *copies) {
    unsigned char *species = list_species(j);
    int status = species ? CLI_DONE : fail_memory(&j->run);
    memset(copies, 0, sizeof *copies);
    for (int type = 0; type < j->forest->type_count && !status; type++)
        if (j->forest->batches[type].count) status = copy_pieces(j, type, species, tint, copies);
    for (int s = 0; s < j->species_count; s++) {
        const uint32_t looks = j->species_count == 1 ? CLOUDS : 1;
        for (uint32_t look = 0; look < looks && j->species[s].leaf_count && !status; look++)
            status = copy_cloud(j, s, look, looks, species, copies);
    }
    free(species);
    return status;
}

void tree_free_copies(tree_copies *copies) {
    for (int i = 0; i < copies->count; i++) {
        mesh_free(&copies->meshes[i]);
        free(copies->blocks[i]);
        if (i < TREEPIECES_MAX_TYPES) free(copies->colors[i]);
    }
}
