/* tree.h - what the files of 'texkit tree' and 'texkit forest' share
   SPDX-License-Identifier: MIT OR Unlicense

   tree_job.c reads the species, grows and poses. Above it are tree_looks.c, the pictures of bark
   and leaves; tree_rig.c, the skeleton and its animation; tree_pivots.c, what moves a tree without
   one; tree_copies.c, the instances of a forest; and tree_variants.c, where its trees stand if they
   are a few different ones. At the top tree.c bakes, writes and holds the commands. Calls only run
   downward.                                                                                     */
#ifndef TREE_H
#define TREE_H

#include "command.h"
#include "files/mesh_io.h"
#include "treepieces.h"

enum {
    MAX_SPECIES = 8, /* of a forest                                                         */
    MAX_LEVELS = 6,  /* of detail, the file itself included                                 */
    HULL_PIECES = 48, /* of a tree for collisions                                           */
    MOST_JOINTS = 128, /* of a tree without --bones                                         */
    MAX_VARIANTS = 256, /* different trees of a forest of plain nodes                       */
    CLOUDS = 3,      /* different leaf clouds of a forest of one species                    */
    BARK_TILES = 8,  /* drawn if the user gives none                                        */
    WARM_UP = 300    /* tenths of a second until the swaying no longer depends on its start */
};

/* A picture that goes with the mesh, as PNG. */
typedef struct picture {
    unsigned char *png;
    size_t size;
    int width;
    char name[32];       /* of the material              */
    char path[MAX_PATH]; /* of the file beside the mesh  */
} picture;

typedef struct tree_job {
    cli run;
    char extension[8];

    /* options */
    const char *species_list, *tiles, *leaf;
    int count, pieces, bare, level, capped, bones, rate, sheet, variants, wind_attributes, lods, collision;
    int is_forest;
    double wind, seconds, pose, spacing;

    treepieces_species species[MAX_SPECIES];
    int species_count;
    treepieces_kit *kit;
    treepieces_forest *forest; /* or a part of it */
    float *rest, *posed; /* bones; posed: by --pose and, if baked, by --wind */
    struct {
        size_t pieces, clusters, bytes;
        float height; /* of the highest tree */
    } grown;          /* of all trees, though not all may be in memory */

    char mtl_path[MAX_PATH]; /* beside an .obj */

    int lod; /* the level that is made; 0: OUT */
    struct {
        unsigned char *bytes;
        size_t size;
        char path[MAX_PATH];
    } levels[MAX_LEVELS]; /* the coarser ones, from 1 on; 0: for collisions */

    /* one bark of all species, or one of each */
    picture bark[MAX_SPECIES], leaves[MAX_SPECIES]; /* png NULL: none */
    picture relief[MAX_SPECIES];                    /* normal map of the bark, only in GLB */
    mesh_material bark_materials[MAX_SPECIES], leaf_materials[MAX_SPECIES];
} tree_job;

/* ---- tree_job.c ---- */

/* The defaults of both commands; NULL after a message. */
tree_job *new_tree_job(int is_forest);
void free_tree_job(tree_job *j);

int tree_is_glb(const tree_job *j);

/* Does the file hold no pictures, as .ply and .stl? */
int tree_is_bare(const tree_job *j);

/* Is it a forest of instances? */
int tree_is_copied(const tree_job *j);

/* Read all species of --species. */
int tree_read_species(tree_job *j);

/* All trees of the forest, on the grid. */
treepieces_forest_desc tree_forest_desc(const tree_job *j);

/* Grow the trees and compute their bones. With --variants these alone grow, at the origin: number k is
   of species k mod species_count, and the tree of seed --seed + k. */
int tree_grow(tree_job *j);

/* The pieces, if there are none yet. */
int tree_make_kit(tree_job *j);

/* Grow these trees in place of those that there are; each is the same whatever the others are. */
int tree_grow_places(tree_job *j, const treepieces_place *places, int count);

/* What a job has grown, for --stats; and the trees that there are are part of it. */
void tree_report(tree_job *j);
void tree_count(tree_job *j);

/* Let go of the trees, to grow them again with fewer pieces. */
void tree_fell(tree_job *j);

/* The steady and the gusty part of --wind. */
treepieces_wind tree_wind(const tree_job *j);

/* Rotation of a bone as a unit quaternion. */
txm_quat tree_bone_rotation(const float *bone);

/* ---- tree_looks.c ---- */

/* Do all species have the bark of the first? */
int tree_has_one_bark(const tree_job *j);

/* Is a picture made of the bark of species s? */
int tree_has_bark(const tree_job *j, int s);

/* Bark and leaves, but for files that show none. tint: the color of one bark for all. */
int tree_dress(tree_job *j, float tint[3]);

/* ---- tree_rig.c ---- */

/* The joints of a tree and how the wind moves them. */
typedef struct tree_rig {
    mesh_skeleton skeleton;
    char name[64];
    mesh_joint *joints;
    float *times, *turns;
    uint32_t *joint_of; /* per node: the joint that moves it */
} tree_rig;

int tree_make_rig(tree_job *j, tree_rig *rig);
void tree_free_rig(tree_rig *rig);

/* Joints and weights of a baked mesh, with the joint numbers of the rig. */
int tree_bind_mesh(tree_job *j, const tree_rig *rig, const treepieces_mesh *from, mesh_data *to);

/* ---- tree_pivots.c ---- */

/* Give the last from->vertex_count vertices of a mesh, those of a tree's bark or leaves, the numbers
   for a shader's wind: how far they go with the tree, and with their branch, 0..1 each; the place that
   the branch turns about; its phase, 0..1. */
int tree_add_pivots(tree_job *j, int tree, const treepieces_mesh *from, mesh_data *to);

/* ---- tree_copies.c ---- */

/* Where the copies of a mesh are, a list that grows. */
typedef struct copy_list {
    float *translations, *rotations, *scales; /* as in mesh_instances */
    unsigned char *colors;
    size_t count, capacity;
} copy_list;

/* A forest as instances of pieces and leaf clouds. */
enum { MAX_COPIED = TREEPIECES_MAX_TYPES + MAX_SPECIES + CLOUDS };
typedef struct tree_copies {
    copy_list lists[MAX_COPIED]; /* by type of the piece; then by species or cloud */
    mesh_instances list[MAX_COPIED];
    mesh_data meshes[MAX_COPIED];
    char names[MAX_COPIED][40];
    int count; /* of those with copies, in list, meshes and names */
} tree_copies;

/* Grow the forest, some trees at a time, and keep of it where its pieces and leaf clouds are.
   tint: sRGB 0..1, the color that the bark's picture was drawn with */
int tree_make_copies(tree_job *j, const float tint[3], tree_copies *copies);
void tree_free_copies(tree_copies *copies);

/* ---- tree_variants.c ---- */

/* Where the trees of a forest of variants stand, variant after variant. */
typedef struct tree_places {
    size_t first[MAX_VARIANTS + 1]; /* places of variant k: first[k] .. first[k + 1] - 1 */
    float *translations, *rotations, *scales; /* as in mesh_object */
} tree_places;

int tree_make_places(tree_job *j, tree_places *places);
void tree_free_places(tree_places *places);

#endif /* TREE_H */
