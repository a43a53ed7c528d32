/* golden_treepieces.c - hashes of what treepieces.h grows, bends, bakes and draws; see golden.h
   SPDX-License-Identifier: MIT OR Unlicense                                                      */
#define TREEPIECES_IMPLEMENTATION
#include "treepieces.h"

#include "golden.h"
#include "treekit.h"

enum { TREES = 4, PICTURE = 48, NODES = 4 * 300 };
static treepieces_species species;
static float bones[NODES * TREEPIECES_BONE], sway[4 * NODES];

static treepieces_kit *make_kit(txm_env *env) {
    treepieces_kit *kit = NULL;
    golden_need(treepieces_kit_make(NULL, 0, env, &kit), "kit", env);
    return kit;
}

static void read_species(int preset, txm_env *env) {
    const char *text = treepieces_preset_text(preset);
    golden_need(treepieces_species_parse(text, strlen(text), env, &species), "species", env);
}

static treepieces_forest *grow(const treepieces_kit *kit, int trees, int rule, txm_env *env) {
    treepieces_forest *forest = NULL;
    treepieces_forest_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.kit = kit;
    desc.species = &species;
    desc.species_count = 1;
    desc.tree_count = trees;
    desc.max_pieces = 250;
    desc.rule = rule;
    desc.seed = 11;
    golden_need(treepieces_forest_make(&desc, env, &forest), "forest", env);
    if (forest->node_count > NODES) golden_need(TXM_TOO_LARGE, "nodes", env);
    return forest;
}

static uint64_t forest_hash(const treepieces_forest *forest, uint64_t hash) {
    for (size_t i = 0; i < forest->node_count; i++) {
        const treepieces_node *node = &forest->nodes[i];
        const size_t numbers = offsetof(treepieces_node, type);
        hash = golden_hash(hash, node, numbers, 4);
        hash = tk_hash(hash, &node->type, sizeof *node - numbers);
    }
    hash = golden_hash(hash, forest->clusters, forest->cluster_count * sizeof *forest->clusters, 4);
    for (int t = 0; t < forest->type_count; t++) {
        const treepieces_batch *b = &forest->batches[t];
        if (b->count) hash = golden_hash(hash, b->words, (size_t)b->count * b->stride * 4, 4);
    }
    return hash;
}

static uint64_t mesh_hash(const treepieces_mesh *mesh, uint64_t hash) {
    hash = golden_hash(hash, mesh->positions, 3 * mesh->vertex_count * sizeof(float), 4);
    hash = golden_hash(hash, mesh->normals, 3 * mesh->vertex_count * sizeof(float), 4);
    hash = golden_hash(hash, mesh->joints, 4 * mesh->vertex_count * sizeof(uint32_t), 4);
    hash = golden_hash(hash, mesh->weights, 4 * mesh->vertex_count * sizeof(float), 4);
    hash = tk_hash(hash, mesh->colors, 4 * mesh->vertex_count);
    hash = golden_hash(hash, mesh->indices, 3 * mesh->triangle_count * sizeof(uint32_t), 4);
    return golden_hash(hash, mesh->uvs, 6 * mesh->triangle_count * sizeof(float), 4);
}

/* the built-in pieces, each skinned by bones of its own tree below */
static uint64_t pieces(txm_env *env) {
    treepieces_kit *kit = make_kit(env);
    uint64_t hash = 0;
    for (int t = 0; t < treepieces_kit_count(kit); t++) {
        const treepieces_piece *p = treepieces_kit_piece(kit, t);
        hash = golden_hash(hash, p->vertices, (size_t)p->vertex_count * sizeof *p->vertices, 4);
        hash = tk_hash(hash, p->quads, (size_t)p->quad_count * sizeof *p->quads);
        for (int k = 0; k < p->leaf_count; k++) {
            hash = golden_hash(hash, p->leaf_rims[k], sizeof p->leaf_rims[k], 4);
            hash = golden_hash(hash, &p->building[k], sizeof p->building[k], 4);
        }
    }
    treepieces_kit_free(kit);
    return hash;
}

/* every built-in species: its text, and trees of it */
static uint64_t presets(txm_env *env) {
    static char text[1 << 15];
    treepieces_kit *kit = make_kit(env);
    uint64_t hash = 0;
    for (int preset = 0; preset < treepieces_preset_count(); preset++) {
        read_species(preset, env);
        const size_t length = treepieces_species_print(&species, text, sizeof text);
        hash = tk_hash(hash, text, length < sizeof text ? length : sizeof text - 1);
        treepieces_forest *forest = grow(kit, TREES, TREEPIECES_GRAMMAR, env);
        hash = forest_hash(forest, hash);
        treepieces_forest_free(forest);
    }
    treepieces_kit_free(kit);
    return hash;
}

/* a rule of the caller's own, which asks for all that a site tells */
static void own_rule(void *user, const treepieces_site *site, txm_rng *rng,
                     treepieces_choice *choice) {
    any_piece(user, site, rng, choice);
    choice->leaves = site->depth % 3 == 2;
}

static uint64_t rules(txm_env *env) {
    treepieces_kit *kit = make_kit(env);
    uint64_t hash = 0;
    read_species(0, env);
    for (int rule = TREEPIECES_ALTERNATE; rule <= TREEPIECES_RANDOM; rule++) {
        treepieces_forest *forest = grow(kit, 2, rule, env);
        hash = forest_hash(forest, hash);
        treepieces_forest_free(forest);
    }
    treepieces_forest *forest = NULL;
    treepieces_forest_desc desc;
    const treepieces_place places[2] = {{{1, 2, 3}, 0.5f, 0, 0, 4}, {{-5, 0, 9}, 4, 1.5f, 0, 8}};
    memset(&desc, 0, sizeof desc);
    desc.kit = kit;
    desc.species = &species;
    desc.species_count = 1;
    desc.places = places;
    desc.tree_count = 2;
    desc.max_pieces = 200;
    desc.own_rule = own_rule;
    golden_need(treepieces_forest_make(&desc, env, &forest), "forest", env);
    hash = forest_hash(forest, hash);
    treepieces_forest_free(forest);
    treepieces_kit_free(kit);
    return hash;
}

/* poses and wind, and the pieces as the bones bend them */
static uint64_t wind(txm_env *env) {
    static float positions[3 * 4096], normals[3 * 4096];
    const treepieces_wind blow = {0.3f, 9, 0.7f, 5, 0};
    const treepieces_pose pose = {6, 0.2f, NULL};
    treepieces_kit *kit = make_kit(env);
    read_species(1, env);
    treepieces_forest *forest = grow(kit, TREES, TREEPIECES_GRAMMAR, env);
    const size_t floats = forest->node_count * TREEPIECES_BONE;
    golden_need(treepieces_bones(forest, &pose, env, bones), "bones", env);
    uint64_t hash = golden_hash(0, bones, floats * sizeof *bones, 4);
    memset(sway, 0, sizeof sway);
    for (int i = 0; i < 9; i++)
        golden_need(treepieces_sway(forest, &blow, 0.1 * i, 0.1, i < 5 ? NULL : &pose, env, sway, bones),
                    "sway", env);
    hash = golden_hash(hash, bones, floats * sizeof *bones, 4);
    hash = golden_hash(hash, sway, 4 * forest->node_count * sizeof *sway, 4);
    for (int t = 0; t < forest->type_count; t++) {
        const size_t vertices = (size_t)treepieces_kit_piece(kit, t)->vertex_count;
        for (uint32_t i = 0; i < forest->batches[t].count; i += 9) {
            treepieces_skin(forest, bones, t, i, positions, normals);
            hash = golden_hash(hash, positions, 3 * vertices * sizeof(float), 4);
            hash = golden_hash(hash, normals, 3 * vertices * sizeof(float), 4);
        }
    }
    treepieces_forest_free(forest);
    treepieces_kit_free(kit);
    return hash;
}

/* one tree as a mesh: plain, and finer near the eye; its leaf cards */
static uint64_t baked(txm_env *env) {
    const treepieces_lod lod = {{1, 2, 3}, 3, 4, 0};
    treepieces_kit *kit = make_kit(env);
    uint64_t hash = 0;
    for (int preset = 0; preset < 2; preset++) {
        treepieces_mesh *mesh = NULL;
        treepieces_bake_desc bake;
        read_species(preset, env);
        treepieces_forest *forest = grow(kit, 2, TREEPIECES_GRAMMAR, env);
        golden_need(treepieces_bones(forest, NULL, env, bones), "bones", env);
        memset(&bake, 0, sizeof bake);
        bake.forest = forest;
        bake.bones = bones;
        bake.tree = preset;
        bake.lod = preset ? &lod : NULL;
        bake.capped = preset;
        golden_need(treepieces_bake(&bake, env, &mesh), "bake", env);
        hash = mesh_hash(mesh, hash);
        treepieces_mesh_free(mesh);
        golden_need(treepieces_bake_leaves(forest, preset, bones, 5, env, &mesh), "leaves", env);
        hash = mesh_hash(mesh, hash);
        treepieces_mesh_free(mesh);
        treepieces_forest_free(forest);
    }
    treepieces_kit_free(kit);
    return hash;
}

static uint64_t tessellation(txm_env *env) {
    static float coords[2 * 65 * 65 * 2];
    static uint16_t indices[3 * 65 * 65 * 4];
    static const int levels[4][5] = {{1, 1, 1, 1, 1}, {3, 4, 5, 6, 4}, {2, 2, 7, 2, 5}, {9, 1, 9, 8, 16}};
    txm_rng rng = txm_rng_make(1, 2);
    uint64_t hash = 0;
    (void)env;
    for (int k = 0; k < 4; k++) {
        int triangles = 0;
        const int count = treepieces_pattern(levels[k], levels[k][4], coords, indices, &triangles);
        hash = golden_hash(hash, coords, 2 * (size_t)count * sizeof(float), 4);
        hash = golden_hash(hash, indices, 3 * (size_t)triangles * sizeof(uint16_t), 2);
    }
    for (int k = 0; k < 50; k++) {
        float p[12], n[12], at[3], normal[3];
        const treepieces_lod lod = {{0.5f, 0.2f, 0.1f}, 20, 0.5f, 0};
        for (int i = 0; i < 12; i++) {
            p[i] = txm_rng_float(&rng);
            n[i] = txm_rng_float(&rng) - 0.5f;
        }
        const float u = txm_rng_float(&rng), v = txm_rng_float(&rng);
        treepieces_patch_point(p, n, 0.6f, u, v, at, normal);
        const int level[2] = {treepieces_edge_level(&lod, p, p + 3), treepieces_inner_level(&lod, p)};
        hash = golden_hash(hash, at, sizeof at, 4);
        hash = golden_hash(hash, normal, sizeof normal, 4);
        hash = golden_hash(hash, level, sizeof level, 4);
    }
    return hash;
}

/* a bark of our own and the sheet that is laid out of it */
static uint64_t bark(txm_env *env) {
    enum { TILE = 16, TILES = 5 };
    static uint8_t pixels[TILES][TILE * TILE * 3], sheet[8 * TILE * 8 * TILE * 8 * 3];
    static const int classes[TILES] = {0, 0, 0, TREEPIECES_OWN, TREEPIECES_OWN + 1};
    treepieces_bark_desc desc;
    txm_image tiles[TILES];
    uint64_t hash = 0;
    for (int preset = 0; preset < 2; preset++) {
        read_species(preset, env);
        for (int t = 0; t < TILES; t++) tiles[t] = golden_image(pixels[t], TILE, TILE, 3, TXM_U8);
        golden_need(treepieces_draw_bark(&species, 5, env, tiles, TILES), "draw", env);
        hash = tk_hash(hash, pixels, sizeof pixels);
        memset(&desc, 0, sizeof desc);
        desc.tiles = tiles;
        desc.classes = classes;
        desc.tile_count = TILES;
        desc.seed = 6;
        const int high = 8 * TILE * treepieces_bark_layers(&desc);
        const size_t bytes = (size_t)(8 * TILE * high * 3);
        if (bytes > sizeof sheet) golden_need(TXM_TOO_LARGE, "sheet", env);
        golden_need(treepieces_bark(&desc, env, golden_image(sheet, 8 * TILE, high, 3, TXM_U8)),
                    "bark", env);
        hash = tk_hash(hash, sheet, bytes);
    }
    return hash;
}

/* leaf clouds, their pictures, and a cloud as seen from three sides */
static uint64_t leaves(txm_env *env) {
    static treepieces_card cards[256];
    static uint8_t picture[PICTURE * PICTURE * 4], color[PICTURE * PICTURE * 4];
    static float depth[PICTURE * PICTURE];
    uint64_t hash = 0;
    for (int preset = 0; preset < treepieces_preset_count(); preset++) {
        read_species(preset, env);
        const int count = treepieces_cloud(&species, 3, cards);
        hash = golden_hash(hash, cards, (size_t)count * sizeof *cards, 4);
        if (count < 1) continue;
        treepieces_impostor_desc desc;
        memset(&desc, 0, sizeof desc);
        desc.cards = cards;
        desc.card_count = count;
        desc.leaves = golden_image(picture, PICTURE, PICTURE, 4, TXM_U8);
        golden_need(treepieces_draw_leaves(&species, 1, env, desc.leaves), "draw", env);
        hash = tk_hash(hash, picture, sizeof picture);
        const int axis = preset % 3;
        desc.right[(axis + 1) % 3] = desc.up[(axis + 2) % 3] = desc.light[(axis + 2) % 3] = 1;
        desc.forward[axis] = -1;
        golden_need(treepieces_impostor(&desc, env, golden_image(color, PICTURE, PICTURE, 4, TXM_U8),
                                        golden_image(depth, PICTURE, PICTURE, 1, TXM_F32)),
                    "impostor", env);
        hash = tk_hash(hash, color, sizeof color);
        hash = golden_hash(hash, depth, sizeof depth, 4);
    }
    return hash;
}

static const golden_case cases[] = {{"pieces", pieces}, {"presets", presets}, {"rules", rules},
                                    {"wind", wind},     {"baked", baked},
                                    {"tessellation", tessellation},
                                    {"bark", bark},     {"leaves", leaves}};
GOLDEN_MAIN("treepieces")
