/* tree.c - a tree with bark and leaves, as files that any modelling program reads
   SPDX-License-Identifier: MIT OR Unlicense

   tree SPECIES NAME [SEED]

   SPECIES is one of oak, beech, maple, birch, poplar, willow, almond, pine, spruce, dead. Writes
   NAME.obj and NAME.mtl, NAME-bark.png and NAME-leaf.png. treepieces.h grows the tree, bends it by
   the wind, joins its pieces to one mesh and draws both pictures; the rest is writing files.    */
#define TREEPIECES_IMPLEMENTATION
#include "treepieces.h"

#include <stb/stb_image_write.h>
#include <stdio.h>
#include <stdlib.h>

enum {
    TILES = 16,     /* of bark: the more, the less it repeats                                   */
    TILE_SIDE = 64, /* pixels                                                                   */
    LEAF_SIDE = 256 /* pixels of the picture of leaves                                          */
};

static txm_image image_of(void *pixels, int width, int height, int channels) {
    const txm_image image = {pixels, width, height, channels, TXM_U8, 0};
    return image;
}

/* ---- pictures: no photograph needed ---- */

/* Tiles of bark, and the sheet of them that the texture coordinates point into. */
static const char *write_bark(const treepieces_species *species, uint64_t seed, txm_env *env,
                              const char *path) {
    static uint8_t block[TILES][TILE_SIDE * TILE_SIDE * 3];
    txm_image tiles[TILES];
    for (int i = 0; i < TILES; i++) tiles[i] = image_of(block[i], TILE_SIDE, TILE_SIDE, 3);
    treepieces_bark_desc desc = {0};
    desc.tiles = tiles;
    desc.tile_count = TILES;
    desc.seed = seed;
    const int side = TREEPIECES_SHEET * TILE_SIDE, height = side * treepieces_bark_layers(&desc);
    uint8_t *pixels = malloc((size_t)side * (size_t)height * 3);
    const txm_image sheet = image_of(pixels, side, height, 3);
    const char *failed = pixels ? NULL : "no memory";
    if (!failed && (treepieces_draw_bark(species, seed, env, tiles, TILES) != TXM_OK ||
                    treepieces_bark(&desc, env, sheet) != TXM_OK))
        failed = env->message;
    if (!failed && !stbi_write_png(path, side, height, 3, pixels, 0)) failed = "cannot write the bark";
    free(pixels);
    return failed;
}

static const char *write_leaves(const treepieces_species *species, uint64_t seed, txm_env *env,
                                const char *path) {
    static uint8_t pixels[LEAF_SIDE * LEAF_SIDE * 4];
    if (treepieces_draw_leaves(species, seed, env, image_of(pixels, LEAF_SIDE, LEAF_SIDE, 4)) != TXM_OK)
        return env->message;
    return stbi_write_png(path, LEAF_SIDE, LEAF_SIDE, 4, pixels, 0) ? NULL : "cannot write the leaves";
}

/* ---- the mesh ---- */

/* Append a mesh whose first vertex and first corner have these numbers. OBJ counts from 1, and v of
   its texture coordinates goes upwards. */
static void put_mesh(FILE *file, const char *material, const treepieces_mesh *m, size_t vertex,
                     size_t corner) {
    fprintf(file, "usemtl %s\n", material);
    for (size_t i = 0; i < 3 * m->vertex_count; i += 3) {
        const float *p = m->positions + i, *n = m->normals + i;
        fprintf(file, "v %g %g %g\nvn %g %g %g\n", (double)p[0], (double)p[1], (double)p[2],
                (double)n[0], (double)n[1], (double)n[2]);
    }
    for (size_t i = 0; i < 3 * m->triangle_count; i++)
        fprintf(file, "vt %g %g\n", (double)m->uvs[2 * i], 1 - (double)m->uvs[2 * i + 1]);
    for (size_t i = 0; i < 3 * m->triangle_count; i++) {
        const unsigned long v = (unsigned long)(vertex + m->indices[i]) + 1;
        fprintf(file, "%s%lu/%lu/%lu%s", i % 3 == 0 ? "f " : " ", v, (unsigned long)(corner + i) + 1, v,
                i % 3 == 2 ? "\n" : "");
    }
}

/* Wood and leaves of a tree in a moderate wind. */
static const char *write_tree(const treepieces_forest *tree, txm_env *env, const char *name) {
    const treepieces_wind wind = {0.4f, 6, 0.5f, 1, 0}; /* direction, m/s, gusts, seed */
    treepieces_bake_desc bake = {0};
    treepieces_mesh *wood = NULL, *leaves = NULL;
    float *bones = malloc(tree->node_count * TREEPIECES_BONE * sizeof *bones);
    float *sway = calloc(tree->node_count, 4 * sizeof *sway);
    const char *failed = bones && sway ? NULL : "no memory";
    char path[1024];

    /* two seconds of wind; a program that draws takes the bones of each step */
    for (int i = 0; i < 120 && !failed; i++)
        if (treepieces_sway(tree, &wind, i / 60.0, 1 / 60.0, NULL, env, sway, bones) != TXM_OK)
            failed = env->message;
    bake.forest = tree;
    bake.bones = bones;
    bake.sheet_size = TREEPIECES_SHEET * TILE_SIDE;
    if (!failed && (treepieces_bake(&bake, env, &wood) != TXM_OK ||
                    treepieces_bake_leaves(tree, 0, bones, 8, env, &leaves) != TXM_OK))
        failed = env->message;
    snprintf(path, sizeof path, "%s.obj", name);
    FILE *file = failed ? NULL : fopen(path, "w");
    if (!failed && !file) failed = "cannot write the mesh";
    if (file) {
        const char *slash = strrchr(name, '/'); /* files name each other as neighbours */
        fprintf(file, "mtllib %s.mtl\n", slash ? slash + 1 : name);
        put_mesh(file, "bark", wood, 0, 0);
        put_mesh(file, "leaf", leaves, wood->vertex_count, 3 * wood->triangle_count);
        if (fclose(file) != 0) failed = "cannot write the mesh";
        else printf("%s: %u pieces, %lu triangles\n", path, tree->node_count,
                    (unsigned long)(wood->triangle_count + leaves->triangle_count));
    }
    treepieces_mesh_free(wood);
    treepieces_mesh_free(leaves);
    free(bones);
    free(sway);
    return failed;
}

static const char *write_materials(const char *name) {
    char path[1024];
    const char *slash = strrchr(name, '/'), *short_name = slash ? slash + 1 : name;
    snprintf(path, sizeof path, "%s.mtl", name);
    FILE *file = fopen(path, "w");
    if (!file) return "cannot write the materials";
    fprintf(file, "newmtl bark\nmap_Kd %s-bark.png\n\nnewmtl leaf\nmap_Kd %s-leaf.png\nmap_d %s-leaf.png\n",
            short_name, short_name, short_name);
    return fclose(file) == 0 ? NULL : "cannot write the materials";
}

int main(int argc, char **argv) {
    if (argc < 3 || argc > 4) {
        fprintf(stderr, "usage: tree SPECIES NAME [SEED]\n");
        return 2;
    }
    txm_env env = {0}; /* malloc, silent, one thread */
    treepieces_species species = {0};
    treepieces_kit *kit = NULL;
    treepieces_forest *tree = NULL;
    treepieces_forest_desc desc = {0}; /* zeros mean the defaults */
    const treepieces_place origin = {{0, 0, 0}, 0, 0, 0, argc > 3 ? strtoull(argv[3], NULL, 10) : 1};
    char bark[1024], leaf[1024];
    const char *failed = NULL;
    desc.species = &species;
    desc.species_count = desc.tree_count = 1;
    desc.places = &origin;
    desc.max_pieces = 800; /* fewer pieces: the same shape with fewer twigs */
    snprintf(bark, sizeof bark, "%s-bark.png", argv[2]);
    snprintf(leaf, sizeof leaf, "%s-leaf.png", argv[2]);

    if (treepieces_preset(argv[1], &env, &species) != TXM_OK ||
        treepieces_kit_make(NULL, 0, &env, &kit) != TXM_OK)
        failed = env.message;
    desc.kit = kit;
    if (!failed && treepieces_forest_make(&desc, &env, &tree) != TXM_OK) failed = env.message;
    if (!failed) failed = write_tree(tree, &env, argv[2]);
    if (!failed) failed = write_materials(argv[2]);
    if (!failed) failed = write_bark(&species, origin.seed, &env, bark);
    if (!failed) failed = write_leaves(&species, origin.seed, &env, leaf);
    if (failed) fprintf(stderr, "tree: %s\n", failed);
    treepieces_forest_free(tree);
    treepieces_kit_free(kit);
    return failed != NULL;
}
