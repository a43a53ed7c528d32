/* tree_copies.c - a forest as instances of a few pieces and leaf clouds
   SPDX-License-Identifier: MIT OR Unlicense

   An instance is placed by translation, rotation and scale, so pieces are rigid: all of one type
   have the mean shape, and where a branch bends more or less than the mean, the rims of adjacent
   pieces do not meet. Every piece therefore begins a little before its root rim, inside the piece
   below.

   A large forest grows part by part, and only where its copies are is kept: 40 bytes of a piece, a third
   of what grown trees and their bones take, which the next part takes over. Which instances the mean is
   of depends on how many there are in all; the trees that have them then grow once more.         */
#include "tree.h"

#include <stdio.h>

enum {
    SAMPLED = 200,          /* instances for the mean shape, at most                              */
    WHOLE_PIECES = 1 << 20, /* a forest that cannot have more pieces grows at once ...            */
    PART_PIECES = 1 << 16,  /* ... others so many at a time, at most                              */
    RUN = 4096,             /* copies that a thread places at a time                              */
    RECORD = 4 + (TREEPIECES_MAX_QUADS + 3) / 4 /* words, at most */
};
static const float SLEEVE_DEPTH = 0.08f; /* of the piece's length */
static const float SLEEVE_RADIUS = 0.94f;

/* Sums over instances of a type of piece, in its own frame. */
typedef struct piece_shape {
    double place[3 * TREEPIECES_MAX_VERTICES], normal[3 * TREEPIECES_MAX_VERTICES], weights;
    uint32_t record[RECORD]; /* of the instance whose tiles all of them show */
} piece_shape;

/* A forest that grows part by part. */
typedef struct gathering {
    tree_job *j;
    tree_copies *copies;
    treepieces_place *places; /* of all trees                                                     */
    int part;                 /* trees that grow at a time, at most                               */
    int types;                /* of pieces                                                        */
    uint16_t *counts;         /* by tree and type: its pieces                                     */
    int *sampled;             /* numbers of the trees that grow once more                         */
    piece_shape *shapes;      /* by type                                                          */
    int has_colors;
    unsigned char factors[MAX_SPECIES][4]; /* from the picture's color to the species' bark       */
    unsigned char *species;                /* by node of the part, if copies have colors          */
    int type;                              /* of the pieces that are being placed                 */
    size_t first;                          /* where the part begins in their list                 */
    float from, share;                     /* of the progress of all parts                        */
    int (*progress)(void *user, float fraction, const char *stage);
    void *progress_user;
} gathering;

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

/* ---- lists of copies ----------------------------------------------------------------------- */

static void *resize(void *block, size_t count, size_t size) {
    size_t bytes;
    return txm_mul(count, size, 1, &bytes) ? realloc(block, bytes ? bytes : 1) : NULL;
}

/* Make room for so many more copies. Memory is asked for as all trees may need, judged by those that are
   done: what is never used of it takes none. */
static int reserve(const gathering *g, copy_list *list, size_t more, int done, int has_colors) {
    const size_t count = list->count + more;
    const double all = 1.05 * (double)count / done * g->j->count + 64;
    void *block;
    if (count <= list->capacity) return CLI_DONE;
    const size_t room = all < 1e9 && all > (double)count ? (size_t)all : count;
    if (!(block = resize(list->translations, room, 3 * sizeof(float)))) return fail_memory(&g->j->run);
    list->translations = (float *)block;
    if (!(block = resize(list->rotations, room, 4 * sizeof(float)))) return fail_memory(&g->j->run);
    list->rotations = (float *)block;
    if (!(block = resize(list->scales, room, 3 * sizeof(float)))) return fail_memory(&g->j->run);
    list->scales = (float *)block;
    if (has_colors && !(block = resize(list->colors, room, 4))) return fail_memory(&g->j->run);
    if (has_colors) list->colors = (unsigned char *)block;
    list->capacity = room;
    return CLI_DONE;
}

static void place_copy(const copy_list *t, size_t i, const float place[3], txm_quat q, float across,
                       float along) {
    const double rotation[4] = {q.x, q.y, q.z, q.w};
    memcpy(t->translations + 3 * i, place, 3 * sizeof(float));
    for (size_t k = 0; k < 4; k++) t->rotations[4 * i + k] = (float)rotation[k];
    t->scales[3 * i] = across;
    t->scales[3 * i + 1] = along;
    t->scales[3 * i + 2] = across;
}

/* A list becomes instances of the next mesh. */
static mesh_data *add_instances(tree_copies *copies, const copy_list *list, const mesh_material *material,
                                const char *name) {
    const int i = copies->count++;
    mesh_instances *t = &copies->list[i];
    snprintf(copies->names[i], sizeof copies->names[i], "%.39s", name);
    t->mesh = &copies->meshes[i];
    t->count = list->count;
    t->translations = list->translations;
    t->rotations = list->rotations;
    t->scales = list->scales;
    t->colors = list->colors;
    t->material = material;
    t->name = copies->names[i];
    return &copies->meshes[i];
}

/* ---- pieces -------------------------------------------------------------------------------- */

/* Add a corner of a triangle with its texture coordinates. */
static void put_corner(mesh_data *m, size_t *corner, uint32_t vertex, const float uv[2]) {
    m->indices[*corner] = vertex;
    memcpy(m->uvs + 2 * *corner, uv, 2 * sizeof(float));
    ++*corner;
}

/* Add an instance of the part to the sums, weighted by thickness. They include the mean direction of its
   branches, so that their rims fit approximately. */
static void add_shape(const tree_job *j, int type, uint32_t instance, piece_shape *shape) {
    const treepieces_batch *b = &j->forest->batches[type];
    const int vertices = treepieces_kit_piece(j->kit, type)->vertex_count;
    const float *bone = bone_of(j, b->words[(size_t)instance * b->stride]);
    const double weight = (double)column_length(bone, 0);
    float positions[3 * TREEPIECES_MAX_VERTICES], normals[3 * TREEPIECES_MAX_VERTICES];
    treepieces_skin(j->forest, j->posed, type, instance, positions, normals);
    for (int v = 0; v < 3 * vertices; v++) {
        const int first = v - v % 3, c = v % 3; /* along column c of the bone */
        double square = 0, along = 0, facing = 0;
        for (int r = 0; r < 3; r++) {
            const double axis = (double)bone[4 * r + c];
            square += axis * axis;
            along += axis * ((double)positions[first + r] - (double)bone[4 * r + 3]);
            facing += axis * (double)normals[first + r];
        }
        shape->place[v] += weight * along / square;
        shape->normal[v] += facing; /* weighted by the size of the piece */
    }
    shape->weights += weight;
}

/* The mean shape. */
static void finish_shape(const piece_shape *shape, int vertices, mesh_data *m) {
    for (int v = 0; v < vertices; v++) {
        const double *n = shape->normal + 3 * v;
        const double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        for (int c = 0; c < 3; c++) {
            m->positions[3 * v + c] = (float)(shape->place[3 * v + c] / shape->weights);
            m->normals[3 * v + c] = length > 0 ? (float)(n[c] / length) : (float)(c == 1);
        }
    }
}

/* A type of piece with the tiles of one of its instances, and the sleeve below its root rim. */
static int make_piece(tree_job *j, int type, const piece_shape *shape, mesh_data *m) {
    static const int order[6] = {0, 1, 2, 0, 2, 3};
    const treepieces_piece *p = treepieces_kit_piece(j->kit, type);
    const uint32_t n = (uint32_t)p->vertex_count, rim = TREEPIECES_RIM;
    const int status = new_mesh(j, n + rim, 2 * ((size_t)p->quad_count + rim), m);
    size_t corner = 0;
    if (status) return status;
    finish_shape(shape, p->vertex_count, m);
    for (uint32_t i = 0; i < rim; i++) {
        const uint32_t from = 3 * (uint32_t)p->root_rim[i], to = 3 * (n + i);
        m->positions[to] = SLEEVE_RADIUS * m->positions[from];
        m->positions[to + 1] = -SLEEVE_DEPTH;
        m->positions[to + 2] = SLEEVE_RADIUS * m->positions[from + 2];
        memcpy(m->normals + to, m->normals + from, 3 * sizeof(float));
    }
    for (int i = 0; i < p->quad_count; i++) {
        const treepieces_quad *q = &p->quads[i];
        const int cell = (int)(shape->record[4 + i / 4] >> 8 * (i % 4) & 255);
        float uv[4][2];
        for (int k = 0; k < 4; k++) {
            const int layer = treepieces_quad_uv(q, shape->record[3], cell, j->bark[0].width, k, uv[k]);
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

/* The species of each node of the part. 0: no memory. */
static int list_species(gathering *g) {
    const treepieces_forest *f = g->j->forest;
    free(g->species);
    g->species = (unsigned char *)new_array(f->node_count, 1);
    for (int t = 0; t < f->tree_count && g->species; t++)
        memset(g->species + f->trees[t].first_node, f->trees[t].species, f->trees[t].node_count);
    return g->species != NULL;
}

/* A run of the copies of a type. */
static void place_pieces(void *context, int run) {
    const gathering *g = (const gathering *)context;
    const treepieces_batch *b = &g->j->forest->batches[g->type];
    const copy_list *list = &g->copies->lists[g->type];
    const uint32_t start = (uint32_t)run * RUN, end = b->count - start < RUN ? b->count : start + RUN;
    for (uint32_t i = start; i < end; i++) {
        const uint32_t node = b->words[(size_t)i * b->stride];
        const float *bone = bone_of(g->j, node), place[3] = {bone[3], bone[7], bone[11]};
        place_copy(list, g->first + i, place, tree_bone_rotation(bone), column_length(bone, 0),
                   column_length(bone, 1));
        if (g->has_colors) memcpy(list->colors + 4 * (g->first + i), g->factors[g->species[node]], 4);
    }
}

static int copy_pieces(gathering *g, int type, int done) {
    const uint32_t count = g->j->forest->batches[type].count;
    copy_list *list = &g->copies->lists[type];
    const int status = reserve(g, list, count, done, g->has_colors);
    if (status) return status;
    g->type = type;
    g->first = list->count;
    txm_parallel_for(&g->j->run.env, (int)((count + RUN - 1) / RUN), place_pieces, g);
    list->count += count;
    return CLI_DONE;
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

/* How many different clouds a species has. */
static uint32_t count_looks(const tree_job *j) {
    return j->species_count == 1 ? CLOUDS : 1;
}

/* The list of a cloud. */
static copy_list *list_of_cloud(tree_copies *copies, uint32_t looks, int species, uint32_t look) {
    return &copies->lists[TREEPIECES_MAX_TYPES + (uint32_t)species * looks + look % looks];
}

/* A cloud is placed as in treepieces_bake_leaves, and turned about y by one of eight turns, since
   there are fewer different clouds here. */
static void place_cloud(const tree_job *j, const treepieces_cluster *c, copy_list *list) {
    static const double eighths[8] = {0, 0.38268343236508977, 0.70710678118654752, 0.92387953251128676,
                                      1, 0.92387953251128676, 0.70710678118654752, 0.38268343236508977};
    const float *bone = bone_of(j, c->node);
    const int turn = (int)(c->look >> 29);
    const txm_quat q = {0, eighths[turn], 0, turn < 4 ? eighths[4 - turn] : -eighths[turn - 4]};
    const float center[3] = {bone[3] + c->along * bone[1], bone[7] + c->along * bone[5],
                             bone[11] + c->along * bone[9]};
    place_copy(list, list->count++, center, q, c->radius, c->radius);
}

static int copy_clouds(gathering *g, int done) {
    const treepieces_forest *f = g->j->forest;
    const uint32_t looks = count_looks(g->j);
    size_t more[MAX_SPECIES][CLOUDS] = {{0}};
    int status = CLI_DONE;
    for (int pass = 0; pass < 2 && !status; pass++) {
        for (int t = 0; t < f->tree_count; t++) {
            const treepieces_tree *tree = &f->trees[t];
            if (g->j->species[tree->species].leaf_count == 0) continue;
            for (uint32_t i = 0; i < tree->cluster_count; i++) {
                const treepieces_cluster *c = &f->clusters[tree->first_cluster + i];
                if (pass) place_cloud(g->j, c, list_of_cloud(g->copies, looks, tree->species, c->look));
                else more[tree->species][c->look % looks]++;
            }
        }
        for (int s = 0; s < g->j->species_count && !pass; s++)
            for (uint32_t look = 0; look < looks && !status; look++)
                status = reserve(g, list_of_cloud(g->copies, looks, s, look), more[s][look], done, 0);
    }
    return status;
}

/* ---- part by part --------------------------------------------------------------------------- */

/* The progress of the part becomes that of all. */
static int report(void *user, float fraction, const char *stage) {
    const gathering *g = (const gathering *)user;
    return g->progress(g->progress_user, g->from + g->share * fraction, stage);
}

/* Grow a part, and let its progress be that from `from` on, of that share. */
static int grow_part(gathering *g, const treepieces_place *places, int count, float from, float share) {
    g->from = from;
    g->share = share;
    return tree_grow_places(g->j, places, count);
}

/* Note how many pieces of each type each tree of the part has. */
static void count_pieces(const gathering *g, int first) {
    const treepieces_forest *f = g->j->forest;
    for (int t = 0; t < f->tree_count; t++) {
        uint16_t *counts = g->counts + (size_t)(first + t) * (size_t)g->types;
        const treepieces_node *nodes = f->nodes + f->trees[t].first_node;
        for (uint32_t i = 0; i < f->trees[t].node_count; i++) counts[nodes[i].type]++;
    }
}

/* All trees, of which only the copies are kept; the last part stays. */
static int copy_trees(gathering *g) {
    const int trees = g->j->count;
    int status = CLI_DONE;
    for (int first = 0; first < trees && !status; first += g->part) {
        const int left = trees - first, count = left < g->part ? left : g->part;
        status = grow_part(g, g->places + first, count, 0.9f * (float)first / (float)trees,
                           0.9f * (float)count / (float)trees);
        cli_stage(&g->j->run, "build");
        if (!status && g->has_colors && !list_species(g)) status = fail_memory(&g->j->run);
        if (status) return status;
        tree_count(g->j);
        count_pieces(g, first);
        for (int type = 0; type < g->types && !status; type++) status = copy_pieces(g, type, first + count);
        if (!status) status = copy_clouds(g, first + count);
    }
    return status;
}

/* Is instance i of so many of a type one of those for the mean shape? */
static int is_sampled(size_t count, size_t i) {
    return i % (count / SAMPLED + 1) == 0;
}

/* Does tree t have an instance for the mean shape, or one whose tiles show? before: instances by type
   that earlier trees have. */
static int has_sample(const gathering *g, int t, const size_t before[TREEPIECES_MAX_TYPES]) {
    for (int type = 0; type < g->types; type++) {
        const size_t all = g->copies->lists[type].count, step = all / SAMPLED + 1;
        const size_t next = (before[type] + step - 1) / step * step;
        const size_t end = before[type] + g->counts[(size_t)t * (size_t)g->types + (size_t)type];
        if (next < end || (all / 2 >= before[type] && all / 2 < end)) return 1;
    }
    return 0;
}

/* Add the samples of a part, whose trees have these numbers, to the shapes. *next: the first tree of the
   forest whose instances are not in `before`. */
static void add_samples(gathering *g, const int *trees, int count, int *next, size_t before[TREEPIECES_MAX_TYPES]) {
    uint32_t instance[TREEPIECES_MAX_TYPES] = {0}; /* in the part */
    for (int t = 0; t < count; t++) {
        for (; *next <= trees[t]; ++*next) {
            for (int type = 0; type < g->types; type++) {
                const size_t all = g->copies->lists[type].count;
                const treepieces_batch *b = &g->j->forest->batches[type];
                const uint16_t own = g->counts[(size_t)*next * (size_t)g->types + (size_t)type];
                for (uint16_t i = 0; i < own && *next == trees[t]; i++, instance[type]++) {
                    if (is_sampled(all, before[type] + i)) add_shape(g->j, type, instance[type], &g->shapes[type]);
                    if (before[type] + i == all / 2)
                        memcpy(g->shapes[type].record, b->words + (size_t)instance[type] * b->stride,
                               b->stride * sizeof(uint32_t));
                }
                before[type] += own;
            }
        }
    }
}

/* The sums for the mean shapes. The trees with samples grow once more unless all are there. */
static int gather_shapes(gathering *g) {
    tree_job *j = g->j;
    size_t before[TREEPIECES_MAX_TYPES] = {0};
    int count = 0, next = 0, status = CLI_DONE;
    for (int t = 0; t < j->count; t++) {
        if (j->count <= g->part || has_sample(g, t, before)) g->sampled[count++] = t;
        for (int type = 0; type < g->types; type++)
            before[type] += g->counts[(size_t)t * (size_t)g->types + (size_t)type];
    }
    memset(before, 0, sizeof before);
    for (int first = 0; first < count && !status; first += g->part) {
        const int left = count - first, trees = left < g->part ? left : g->part;
        if (j->count > g->part) {
            for (int t = 0; t < trees; t++) g->places[t] = g->places[g->sampled[first + t]];
            status = grow_part(g, g->places, trees, 0.9f + 0.1f * (float)first / (float)count,
                               0.1f * (float)trees / (float)count);
            cli_stage(&j->run, "build");
        }
        if (!status) add_samples(g, g->sampled + first, trees, &next, before);
    }
    return status;
}

/* ---- all of it ----------------------------------------------------------------------------- */

static int prepare(gathering *g, const float tint[3]) {
    tree_job *j = g->j;
    const size_t count = (size_t)j->count;
    const int most = j->pieces ? j->pieces : 600;
    int status = tree_make_kit(j);
    if (status) return status;
    g->types = treepieces_kit_count(j->kit);
    g->part = PART_PIECES / most > 1 ? PART_PIECES / most : 1;
    if (j->count <= WHOLE_PIECES / most) g->part = j->count;
    g->has_colors = j->species_count > 1 && !j->tiles;
    for (int s = 0; s < j->species_count; s++) bark_factor(&j->species[s], tint, g->factors[s]);
    g->places = (treepieces_place *)new_array(count, sizeof *g->places);
    g->counts = (uint16_t *)new_array(count, (size_t)g->types * sizeof *g->counts);
    g->sampled = (int *)new_array(count, sizeof *g->sampled);
    g->shapes = (piece_shape *)new_array((size_t)g->types, sizeof *g->shapes);
    if (!g->places || !g->counts || !g->sampled || !g->shapes) return fail_memory(&j->run);
    const treepieces_forest_desc desc = tree_forest_desc(j);
    return check_result(&j->run, treepieces_scatter(&desc, &j->run.env, g->places), j->species[0].name);
}

static int make_meshes(gathering *g) {
    tree_job *j = g->j;
    tree_copies *copies = g->copies;
    const uint32_t looks = count_looks(j);
    char name[48];
    int status = CLI_DONE;
    for (int type = 0; type < g->types && !status; type++) {
        if (copies->lists[type].count == 0) continue;
        mesh_data *m = add_instances(copies, &copies->lists[type], &j->bark_materials[0],
                                     treepieces_kit_piece(j->kit, type)->name);
        status = make_piece(j, type, &g->shapes[type], m);
    }
    for (int s = 0; s < j->species_count; s++) {
        for (uint32_t look = 0; look < looks && !status; look++) {
            const copy_list *list = list_of_cloud(copies, looks, s, look);
            if (list->count == 0) continue;
            snprintf(name, sizeof name, "leaves %d", copies->count);
            status = make_cloud(j, &j->species[s], look,
                                add_instances(copies, list, &j->leaf_materials[s], name));
        }
    }
    return status;
}

int tree_make_copies(tree_job *j, const float tint[3], tree_copies *copies) {
    gathering g;
    env_keep_memory();
    memset(&g, 0, sizeof g);
    memset(copies, 0, sizeof *copies);
    g.j = j;
    g.copies = copies;
    g.progress = j->run.env.progress;
    g.progress_user = j->run.env.progress_user;
    int status = prepare(&g, tint);
    j->run.env.progress = report;
    j->run.env.progress_user = &g;
    if (!status) status = copy_trees(&g);
    if (!status) status = gather_shapes(&g);
    j->run.env.progress = g.progress;
    j->run.env.progress_user = g.progress_user;
    if (!status) tree_report(j);
    if (!status) status = make_meshes(&g);
    free(g.places);
    free(g.counts);
    free(g.sampled);
    free(g.shapes);
    free(g.species);
    tree_fell(j);
    return status;
}

void tree_free_copies(tree_copies *copies) {
    for (int i = 0; i < copies->count; i++) mesh_free(&copies->meshes[i]);
    for (int i = 0; i < MAX_COPIED; i++) {
        free(copies->lists[i].translations);
        free(copies->lists[i].rotations);
        free(copies->lists[i].scales);
        free(copies->lists[i].colors);
    }
}
