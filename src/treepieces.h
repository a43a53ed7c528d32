/* treepieces.h - v0.1.0 - animated trees out of interlocking pieces
   SPDX-License-Identifier: MIT OR Unlicense                   (full text: end of file)

   WHAT IT DOES
     Grows trees by a small grammar out of a handful of pieces - tube, forks, side branches, tip, root
     flare - that meet in hexagonal rims. A tree is no mesh but a list of pieces on one connected
     skeleton: a thousand distinct trees are drawn by one instanced call per kind of piece, sway in the
     wind joint by joint, are tessellated without cracks where the eye is near, and carry bark that
     goes on across every joint. Those who want a mesh get one, welded, with skin and leaves.

   QUICK START                                 (tests build and run this very block)
     // Grow an oak, let the wind blow, write it as OBJ. cc -std=c99 quick.c -lm
     #define TREEPIECES_IMPLEMENTATION        // in exactly one .c or .cpp file
     #include "treepieces.h"                  // texmath.h must lie beside it
     #include <stdio.h>

     int main(void) {
         treepieces_forest_desc desc;
         treepieces_bake_desc bake;
         treepieces_wind wind;
         treepieces_species oak;
         treepieces_kit *kit;
         treepieces_forest *tree;
         treepieces_mesh *mesh;
         txm_env env;
         float *bones, *sway;                 // the caller owns what changes from frame to frame
         memset(&desc, 0, sizeof desc);       // zero = the default, for every field
         memset(&bake, 0, sizeof bake);
         memset(&wind, 0, sizeof wind);
         memset(&env, 0, sizeof env);         // malloc, silent, serial; receives the message
         if (treepieces_kit_make(NULL, 0, &env, &kit) != TXM_OK ||
             treepieces_preset("oak", &env, &oak) != TXM_OK)
             return 1;
         desc.kit = kit;
         desc.species = &oak;
         desc.species_count = 1;
         desc.tree_count = 1;                 // or 10000; each differs
         desc.seed = 7;
         if (treepieces_forest_make(&desc, &env, &tree) != TXM_OK) {
             fprintf(stderr, "tree: %s\n", env.message);
             return 1;
         }
         bones = (float *)malloc(tree->node_count * TREEPIECES_BONE * sizeof *bones);
         sway = (float *)calloc(tree->node_count, 4 * sizeof *sway);
         if (!bones || !sway) return 1;
         wind.speed = 8;
         wind.gusts = 0.6f;
         for (int i = 0; i < 60; i++)         // a second at 60 frames; upload bones, draw batches
             treepieces_sway(tree, &wind, i / 60.0, 1 / 60.0, NULL, &env, sway, bones);
         bake.forest = tree;
         bake.bones = bones;
         if (treepieces_bake(&bake, &env, &mesh) != TXM_OK) {
             fprintf(stderr, "mesh: %s\n", env.message);
             return 1;
         }
         for (size_t i = 0; i < mesh->vertex_count; i++)
             printf("v %g %g %g\n", mesh->positions[3 * i], mesh->positions[3 * i + 1],
                    mesh->positions[3 * i + 2]);
         for (size_t i = 0; i < 3 * mesh->triangle_count; i += 3)
             printf("f %d %d %d\n", (int)mesh->indices[i] + 1, (int)mesh->indices[i + 1] + 1,
                    (int)mesh->indices[i + 2] + 1);
         treepieces_mesh_free(mesh);
         treepieces_forest_free(tree);
         treepieces_kit_free(kit);
         free(bones);
         free(sway);
         return 0;
     }

   HOW IT WORKS
     Pieces are quad meshes whose borders are rims: one hexagon, with one set of normals, at the root and
     one at each leaf rim, moved there by a building transform. A rim belongs to one bone alone, and a
     parent keeps the vertices of its leaf rims in the frame of the child: so both compute the same
     numbers, and no pose opens a gap or shows a crease. A child fits in six rotations. Each piece
     has one bone of its own, which scales it across and along; its leaf rims follow the bones of its
     children, all in one buffer [1, 4.1 to 4.3].
     The thickest rims that wait are served first, so a limit on the pieces of a tree thins out its twigs
     and leaves its shape: it is the coarse level of detail. The fine one is tessellation by distance,
     symmetric along each edge [1, 4.4]. Wind is a sum of gusts that travel over the land; every joint
     answers as a damped oscillator, the thinner the faster, solved exactly over each step.
     Bark: all tiles of a set share one frame, so any of them fits beside any other, and rectangles of
     them fit too. A quad shows 1 to 8 of them a side, as its size asks for, and blended ones in the
     crotches, where the directions of growth meet [1, 5].

   CONFIGURATION   (define before the include that has _IMPLEMENTATION)
     TREEPIECES_STATIC     every function static to the including file (set it everywhere)

   MEMORY
     A forest takes some 60 bytes a piece, and its bones and sway, which the caller owns, 64 more:
     20 KB for a tree of 4,000 triangles. treepieces_forest.bytes is exact. While it grows: 300 bytes
     for each piece of 64 trees.

   TIME   (one core of 2023; make bench measures yours)
     About 0.2 microseconds to grow a piece in memory that is already there (fresh memory may cost as much
     again), 0.06 to move its bone in the wind. The parallel-for hook spreads trees.

   THREADS
     No global state. Calls with different env and outputs may overlap; a kit and a forest may be used by
     many.

   SAME BYTES
     All that shapes a tree is sums, products, quotients and square roots in a fixed order: the same
     bytes on any number of threads and on any compiler that keeps to IEEE 754 (see texmath.h), built
     with -ffp-contract=off. Bones, skin and tessellation as well.

   LIMITS
     Up to 3 leaf rims, 255 vertices and 255 quads a piece, 16 kinds of pieces, 65,535 pieces a tree,
     2^31 a forest. Branches do not avoid each other. Wind bends joints and does not push leaves by
     themselves. Thick limbs should bend by less than 60 degrees from piece to piece, which is the most
     that is done.

   REFERENCES
     [1] V. Burkus, A. Karpati, L. Szecsi. Animated trees with interlocking pieces.
     [2] T. Boubekeur, M. Alexa. Phong tessellation. ACM Transactions on Graphics 27(5), 2008.
     [3] G. Szijarto, J. Koloszar. Real-time hardware accelerated rendering of forests at human scale.
         Journal of WSCG 12(1-3), 2004 (impostors of 2.5 dimensions).                            */
#ifndef TREEPIECES_H
#define TREEPIECES_H

#include "texmath.h"

#include <stdio.h>

#define TREEPIECES_VERSION "0.1.0"

#if defined(TREEPIECES_STATIC) && defined(__GNUC__)
#define TREEPIECES_API __attribute__((unused)) static
#elif defined(TREEPIECES_STATIC)
#define TREEPIECES_API static
#else
#define TREEPIECES_API extern
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* ---- pieces ------------------------------------------------------------------------------ */

enum {
    TREEPIECES_RIM = 6,            /* vertices of a rim                                          */
    TREEPIECES_MAX_LEAVES = 3,     /* leaf rims of a piece                                       */
    TREEPIECES_MAX_VERTICES = 255, /* of a piece                                                 */
    TREEPIECES_MAX_QUADS = 255,    /* of a piece                                                 */
    TREEPIECES_MAX_TYPES = 16,     /* of a kit, the built-in ones included                       */
    TREEPIECES_BANDS = 4,          /* groups of quads of a piece that are textured alike         */
    TREEPIECES_BONE = 12           /* floats of a bone: three rows of four, see treepieces_bones */
};

/* The built-in pieces; those registered by the user follow. */
typedef enum treepieces_type {
    TREEPIECES_I = 0,   /* a tube                                                    1 leaf rim  */
    TREEPIECES_Y,       /* a symmetric fork                                          2 leaf rims */
    TREEPIECES_SIDE,    /* a tube (rim 0) with a branch (rim 1)                      2           */
    TREEPIECES_PLANAR,  /* a tube (rim 0) with two branches across from each other   3           */
    TREEPIECES_SPATIAL, /* a fork in three                                           3           */
    TREEPIECES_TIP,     /* a closed end                                              none        */
    TREEPIECES_FLARE,   /* the foot of a trunk, with the beginnings of roots         1           */
    TREEPIECES_BUILTIN  /* how many these are                                                    */
} treepieces_type;

/* What lies on a quad. The library derives 1 to 4 from tiles of class 0; see treepieces_bark. */
typedef enum treepieces_class {
    TREEPIECES_BARK = 0,   /* neighbours match on all four sides                                 */
    TREEPIECES_FOLD,       /* its south side meets the south side of a quad that is folded too   */
    TREEPIECES_TURN_LEFT,  /* its south side meets the east side of a plain quad                 */
    TREEPIECES_TURN_RIGHT, /* its south side meets the west side of a plain quad                 */
    TREEPIECES_HALVING,    /* half as many tiles across its north side as across its south side;
                              set by the assembly, not by pieces                                 */
    TREEPIECES_OWN         /* and up: own classes of user pieces                                 */
} treepieces_class;

/* A vertex of a piece, 48 bytes, as the GPU gets it. Model space: the root rim has radius 1 about
   the origin in the plane y = 0, the stem goes up (+y). */
typedef struct treepieces_vertex {
    float position[3];
    int32_t rim;      /* out: 6 leaf + place if on a leaf rim, else -1                           */
    float normal[3];  /* unit length                                                             */
    float reserved;   /* 0                                                                       */
    float weights[4]; /* of the piece's own bone (the root joint), then of the terminal joints at
                         leaf rims 0, 1, 2; each >= 0, sum 1. Root rim: 1 0 0 0; leaf rim k: 1 at
                         place 1 + k                                                             */
} treepieces_vertex;

/* A quad, seen from outside: corners nw, sw, se, ne of its tile, that is counter-clockwise. North is
   towards the leaves. */
typedef struct treepieces_quad {
    uint8_t corners[4];
    uint8_t tile_class; /* treepieces_class                                                      */
    uint8_t band;       /* 0..TREEPIECES_BANDS-1: quads of one band have as many tiles each. Band 0
                           touches the root rim, band 1 + k leaf rim k (an I: 0 below, 1 above)  */
} treepieces_quad;

/* A similarity: p -> translation + scale * rotate(rotation, p). */
typedef struct treepieces_similarity {
    float translation[3];
    float rotation[4]; /* unit quaternion x y z w */
    float scale;       /* > 0                     */
} treepieces_similarity;

/* A piece [1, 4.1 to 4.3]: a quad mesh whose boundary is its rims. Place k of a rim lies at
   (cos 60k, 0, -sin 60k) of the rim's frame, with the normal (10 cos 60k, 1, -10 sin 60k) / sqrt(101):
   all rims are the mouths of cones of one aperture. Seen from outside with y up, k + 1 is to the
   right of k. building maps the root rim's frame to that of a leaf rim (section 4.2). */
typedef struct treepieces_piece {
    const char *name;
    const treepieces_vertex *vertices;
    const treepieces_quad *quads;
    int vertex_count, quad_count, leaf_count;
    int root_rim[TREEPIECES_RIM]; /* vertex numbers */
    int leaf_rims[TREEPIECES_MAX_LEAVES][TREEPIECES_RIM];
    treepieces_similarity building[TREEPIECES_MAX_LEAVES];
} treepieces_piece;

/* A set of pieces; never changed after it is made. */
typedef struct treepieces_kit treepieces_kit;

/* The built-in pieces and, numbered from TREEPIECES_BUILTIN, own ones. Everything is copied.

   pieces  count own pieces, or NULL. What a piece must be is checked: counts and numbers in range;
           rims where the canonical hexagon says, to 1e-4 of their radius (they are then moved onto
           it), with its normals; weights; a surface of one component, oriented, manifold, its only
           borders the rims, no vertex unused; a building transform of each leaf rim
   out     receives the kit, or NULL on any error; release it with treepieces_kit_free
   return  TXM_OK; TXM_BAD_ARGUMENT, the message naming piece and vertex; TXM_TOO_LARGE;
           TXM_OUT_OF_MEMORY                                                                     */
TREEPIECES_API txm_status treepieces_kit_make(const treepieces_piece *pieces, int count,
                                              txm_env *env, treepieces_kit **out);

/* Release a kit by the allocator it was made with; NULL is allowed. No forest may use it any more. */
TREEPIECES_API void treepieces_kit_free(treepieces_kit *kit);

TREEPIECES_API int treepieces_kit_count(const treepieces_kit *kit);

/* Piece `type` as the kit has it; NULL for a bad number. Valid as long as the kit. */
TREEPIECES_API const treepieces_piece *treepieces_kit_piece(const treepieces_kit *kit, int type);

/* ---- species ----------------------------------------------------------------------------- */

enum {
    TREEPIECES_MAX_ORDERS = 5,
    TREEPIECES_MAX_NAME = 32
};

/* The axes of one order: 0 the trunk, 1 the branches on it, 2 those on them, ... An axis is a chain
   of pieces; a fork splits it into axes of the same order. */
typedef struct treepieces_order {
    float length;         /* order 0: metres; else as a ratio to the length of the parent axis     */
    float length_spread;  /* 0..1: uniform within length * (1 -+ spread)                           */
    float radius;         /* at its foot: order 0 as a ratio to its length; else to the radius of the
                             stem there                                                            */
    float taper;          /* radius at its end over that at its foot, 0.02..1                      */
    float segments;       /* pieces along an axis of full length, 1..64                            */
    float start;          /* 0..1: how much of the axis is bare of branches                        */
    float side, pair;     /* probabilities of a piece beyond start to bear one or two branches     */
    float fork, triple;   /* ... to split the axis in two or three                                 */
    float fork_angle;     /* degrees between a fork's arm and the axis below                       */
    float fork_ratio;     /* how much of the remaining length an arm has, 0.1..1                   */
    float angle_base, angle_top; /* degrees between a branch of this order and its stem, at the foot
                             and at the end of the stem                                            */
    float angle_spread;   /* degrees, uniform -+                                                   */
    float profile[3];     /* length of a branch of this order that stands at the start, in the middle
                             or at the end of its stem, times `length`; parabola through the three */
    float roll;           /* degrees about the stem from one branch on it to the next; pieces turn by
                             60, the rest is twist                                                 */
    float wander;         /* degrees, by which the axis turns at random from piece to piece        */
    float tropism;        /* -1..1: share by which a piece turns to the sky (> 0) or the ground    */
    float sag;            /* degrees that the axis's end would hang below its foot's direction if it
                             were level: weight; < 0 lifts the end                                 */
    float gravimorphism;  /* -1..1: branches of this order on the upper (> 0) or lower side of a
                             slanting stem grow longer                                             */
    float flatten;        /* 0..1: how far branches of this order keep to the horizontal plane     */
    float leaves;         /* 0..1: probability of a piece to bear a leaf cloud                     */
    float leaves_start;   /* 0..1: how much of the axis is bare of leaves                          */
} treepieces_order;

typedef enum treepieces_envelope {
    TREEPIECES_FREE = 0,
    TREEPIECES_ELLIPSOID, /* of crown_width, between crown_base and crown_top */
    TREEPIECES_CONE,
    TREEPIECES_CYLINDER
} treepieces_envelope;

typedef enum treepieces_leaf_shape {
    TREEPIECES_LEAF_OVAL = 0,
    TREEPIECES_LEAF_LOBED,  /* oak       */
    TREEPIECES_LEAF_LANCE,  /* willow    */
    TREEPIECES_LEAF_HEART,  /* poplar    */
    TREEPIECES_LEAF_NEEDLE, /* conifers  */
    TREEPIECES_LEAF_BLOSSOM /* almond    */
} treepieces_leaf_shape;

/* A kind of tree. The text form is documented at treepieces_species_parse. */
typedef struct treepieces_species {
    char name[TREEPIECES_MAX_NAME];
    int order_count; /* 1..TREEPIECES_MAX_ORDERS */
    treepieces_order orders[TREEPIECES_MAX_ORDERS];
    float flare;      /* radius at the ground over that of the trunk, 1..4                         */
    int envelope;     /* treepieces_envelope: axes end where they leave it                         */
    float crown_base, crown_top, crown_width; /* of the trunk's length; the width as a diameter    */
    float shade;      /* 0 = none; else axes end at places with more than so much foliage and wood
                         above them, in pieces per m^2 of sky: pruning by light                    */
    float stiffness;  /* 1 = as most trees; wind bends by its inverse                              */
    int leaf_shape;   /* treepieces_leaf_shape                                                     */
    int leaf_count;   /* cards of a leaf cloud, 1..256; 0 = bare                                   */
    float leaf_size;  /* side of a card, in radii of the cloud                                     */
    float cloud;      /* radius of a leaf cloud, metres                                            */
    float cloud_flat; /* height of a cloud over its width, 0.1..2                                  */
    float leaf_color[3], bark_color[3]; /* sRGB 0..1: the built-in pictures are tinted so          */
} treepieces_species;

/* Built-in species: 0..treepieces_preset_count()-1. The text is in the form that
   treepieces_species_parse reads; NULL for a bad number. */
TREEPIECES_API int treepieces_preset_count(void);
TREEPIECES_API const char *treepieces_preset_text(int index);

/* The built-in species of that name. TXM_BAD_ARGUMENT (message: the names) if there is none. */
TREEPIECES_API txm_status treepieces_preset(const char *name, txm_env *env,
                                            treepieces_species *species);

/* Read a species from text: lines "key value ..."; "order N" begins the keys of that order; "like
   NAME" starts from a built-in species; # begins a comment. Keys are the fields' names.
   return TXM_OK; TXM_BAD_DATA, the message with line and key; *species untouched then          */
TREEPIECES_API txm_status treepieces_species_parse(const char *text, size_t size, txm_env *env,
                                                   treepieces_species *species);

/* The text of a species, with a 0 at the end if it fits; returns its length without. */
TREEPIECES_API size_t treepieces_species_print(const treepieces_species *species, char *text,
                                               size_t capacity);

/* ---- growing ----------------------------------------------------------------------------- */

/* A rim that waits for a piece. */
typedef struct treepieces_site {
    int depth;               /* pieces between it and the ground                                    */
    int order;               /* of the axis                                                         */
    int parent, rim;         /* type of the piece that it belongs to (-1: the ground) and leaf rim  */
    int tree;                /* number of the tree                                                  */
    float position[3], direction[3]; /* metres, as the tree stands; unit length                     */
    float radius;            /* metres                                                              */
    float along;             /* 0..1: how much of its axis lies behind it                           */
    float length;            /* of its axis, metres                                                 */
} treepieces_site;

/* What is put on it. */
typedef struct treepieces_choice {
    int type;         /* of the kit; one without leaf rims ends the axis                            */
    int turn;         /* 0..5: the piece turned by so many sixths about its stem; -1: as the roll of
                         the branches wants it                                                      */
    float direction[3]; /* of the stem, as the tree stands; need not have unit length. Held within 60
                         degrees of the site's                                                      */
    float length;     /* of the piece, metres                                                       */
    float ratios[TREEPIECES_MAX_LEAVES]; /* radius at leaf rim k over that of the site, 0.02..1     */
    int leaves;       /* 1: bears a leaf cloud                                                      */
} treepieces_choice;

/* A rule of the user: fill *choice, which holds that of the grammar, or leave it. Must depend on its
   arguments and rng alone, which is the tree's; is called for different trees at once if env has
   threads. */
typedef void treepieces_rule_function(void *user, const treepieces_site *site, txm_rng *rng,
                                      treepieces_choice *choice);

typedef enum treepieces_rule {
    TREEPIECES_GRAMMAR = 0, /* the species' probabilities                                           */
    TREEPIECES_ALTERNATE,   /* I and Y in turn [1, 8]                                               */
    TREEPIECES_RANDOM       /* I and Y with equal chances [1, 8]                                    */
} treepieces_rule;

/* Where a tree stands. */
typedef struct treepieces_place {
    float position[3]; /* metres                                                                    */
    float turn;        /* radians about y                                                           */
    float scale;       /* 0 = 1                                                                     */
    int species;
    uint64_t seed;
} treepieces_place;

typedef struct treepieces_forest_desc {
    const treepieces_kit *kit;         /* must outlive the forest                                   */
    const treepieces_species *species; /* species_count of them; copied                             */
    int species_count;
    const treepieces_place *places; /* tree_count of them; NULL = on a jittered grid about the origin,
                                       species in turn by the seed                                  */
    int tree_count;
    float spacing;  /* of that grid, metres; 0 = 0.6 times the height of the tallest species        */
    int max_pieces; /* of a tree, 8..65535; 0 = 600. The thickest grow first, so that fewer pieces
                       make a sparser tree of the same shape                                        */
    int rule;       /* treepieces_rule                                                              */
    treepieces_rule_function *own_rule; /* NULL, or is asked at every site                          */
    void *own_user;
    uint64_t seed;
} treepieces_forest_desc;

enum { TREEPIECES_NONE = -1 };

/* One piece of a tree: a joint of its skeleton, 32 bytes. Its bone is

       B = T(position) R diag(radius, length, radius),
       position = B_parent * translation of the parent's building transform,
       R = R_parent * rotation, rotation = building rotation * turn * joint transform  [1, 4.2, 4.3]

   so that neither radius nor length of a piece pass on to its children. Of the first node position and
   rotation are the tree's. */
typedef struct treepieces_node {
    float rotation[4];     /* from the parent's frame, unit quaternion                              */
    float radius, length;  /* metres                                                                */
    int32_t parent;        /* node number in its tree, less than its own; the first: TREEPIECES_NONE */
    uint8_t type;
    uint8_t joint;         /* leaf rim of the parent * 8 + turn                                     */
    uint8_t order;         /* of its axis                                                           */
    uint8_t sway;          /* class of its oscillator, see treepieces_sway                          */
} treepieces_node;

/* A leaf cloud: a sphere of foliage about a point of a piece's axis, 16 bytes. */
typedef struct treepieces_cluster {
    uint32_t node; /* of the forest, as the bones are numbered                                      */
    float along;   /* 0..1 of the piece's length                                                    */
    float radius;  /* metres                                                                        */
    uint32_t look; /* random bits: which of the clouds is shown and how it is turned                */
} treepieces_cluster;

typedef struct treepieces_tree {
    uint32_t first_node, node_count;
    uint32_t first_cluster, cluster_count;
    float position[3], turn, scale;
    int species;
    uint32_t seed;
    float height; /* of its highest joint above its foot, metres                                    */
} treepieces_tree;

/* All pieces of one type: `count` records of `stride` 32-bit words each. A record:

       word 0    number of the piece's own bone
       word 1    bone of the child at leaf rim 0, less the own; that of rim 1 << 16
       word 2    bone at rim 2, less the own; turns of the children << 16, 4 bits each
       word 3    one byte per band, band 0 lowest: bits 0..2 log2 of the tiles across a quad (0..4),
                 3..4 log2 of those along it, 5: halving
       word 4... one byte per quad, lowest first: column + 8 row of its first tile in the sheet     */
typedef struct treepieces_batch {
    const uint32_t *words;
    uint32_t count, stride;
    int quad_count;
} treepieces_batch;

/* A forest, or a single tree: arrays ready for the GPU. Read only. */
typedef struct treepieces_forest {
    const treepieces_kit *kit;
    const treepieces_species *species;
    const treepieces_tree *trees;
    const treepieces_node *nodes;       /* tree after tree, parents before children                 */
    const treepieces_cluster *clusters; /* tree after tree                                          */
    treepieces_batch batches[TREEPIECES_MAX_TYPES]; /* by type                                      */
    int species_count, tree_count, type_count;
    uint32_t node_count, cluster_count;
    size_t bytes; /* memory of all this                                                             */
} treepieces_forest;

/* Grow trees. Each from its own seed, so that a tree is the same in any company and on any number of
   threads.

   return TXM_OK; TXM_BAD_ARGUMENT for a field outside its range (the message names it), or a choice of
          own_rule that cannot be; TXM_TOO_LARGE above 2^31 pieces; TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost   O(pieces); about 130 bytes a piece with its bone and sway                              */
TREEPIECES_API txm_status treepieces_forest_make(const treepieces_forest_desc *desc, txm_env *env,
                                                 treepieces_forest **out);
TREEPIECES_API void treepieces_forest_free(treepieces_forest *forest);

/* ---- poses and wind ---------------------------------------------------------------------- */

/* A pose: every joint turned further. All zero is the tree as it grew. */
typedef struct treepieces_pose {
    uint64_t seed;
    float amount;        /* radians: each joint turns by up to so much about a random level axis    */
    const float *joints; /* NULL, or a unit quaternion per node that turns it further               */
} treepieces_pose;

/* The bones of all trees: TREEPIECES_BONE floats for each node of the forest, the rows of the 3 x 4
   matrix [X Y Z T] from the frame of the piece's root rim to the world (std430: vec4[3]).
   return TXM_OK; TXM_BAD_ARGUMENT                                                               */
TREEPIECES_API txm_status treepieces_bones(const treepieces_forest *forest,
                                           const treepieces_pose *pose, txm_env *env, float *bones);

/* Wind: a mean and gusts, waves that travel over the land with it. */
typedef struct treepieces_wind {
    float direction; /* radians from +x towards -z, where it blows to                               */
    float speed;     /* metres a second; bends by its square                                        */
    float gusts;     /* 0..1: how much it rises and falls; 0 = steady                               */
    uint32_t seed;
} treepieces_wind;

/* The pressure of the wind, 1 = that of 10 m/s, at a place and time (seconds): the sum of travelling
   gusts. */
TREEPIECES_API float treepieces_gust(const treepieces_wind *wind, const float position[3],
                                     double time);

/* One step of the trees' sway: each joint is a damped oscillator in two directions that the wind
   drives, solved exactly over the step, so that any step is stable; then the bones.

   time   seconds at the end of the step; dt: its length, >= 0
   state  4 floats per node, all 0 at the start; in and out
   bones  as treepieces_bones; pose (may be NULL) is what the trees sway about                   */
TREEPIECES_API txm_status treepieces_sway(const treepieces_forest *forest,
                                          const treepieces_wind *wind, double time, double dt,
                                          const treepieces_pose *pose, txm_env *env, float *state,
                                          float *bones);

/* ---- skinning ---------------------------------------------------------------------------- */

/* The vertices of one instance in the world, by linear blend skinning; the reference for shaders. A
   vertex at place j of leaf rim k is place (j - turn) mod 6 of the child's own rim, moved by the
   child's bone alone: the same expression of the same numbers as the child's, so that both are equal
   to the bit. Others blend: their position in model space by the own bone, and their position in the
   frame of terminal joint k by the child's bone with the own piece's stretch.

   positions, normals  3 floats per vertex of the piece; normals (may be NULL) of unit length     */
TREEPIECES_API void treepieces_skin(const treepieces_forest *forest, const float *bones, int type,
                                    uint32_t instance, float *positions, float *normals);

/* ---- level of detail --------------------------------------------------------------------- */

typedef struct treepieces_lod {
    float eye[3];
    float max_level;     /* at the eye, 1..64; 0 = 1: no tessellation                               */
    float half_distance; /* metres over which levels halve; 0 = 10                                  */
    float shape;         /* of Phong tessellation, 0..1; 0 = 0.6, which rounds hexagons; < 0: flat  */
} treepieces_lod;

/* ceil(max_level * 2^(-d / half_distance)), at least 1, with d from the eye to the middle of the edge:
   symmetric in a and b to the bit [1, 4.4]; and the same for the middle of a quad, corner after
   corner. */
TREEPIECES_API int treepieces_edge_level(const treepieces_lod *lod, const float a[3],
                                         const float b[3]);
TREEPIECES_API int treepieces_inner_level(const treepieces_lod *lod, const float corners[12]);

/* The pattern of a quad with levels 1..64 for the edges from corner 0 to 1, 1 to 2, 2 to 3, 3 to 0 and
   the inside, as OpenGL's equal_spacing has it. coords: u v pairs, corner 0 (0, 0), 1 (0, 1), 2 (1, 1),
   3 (1, 0); both may be NULL to count only.
   return the vertices; *triangles receives how many there are                                    */
TREEPIECES_API int treepieces_pattern(const int edges[4], int inner, float *coords,
                                      uint16_t *indices, int *triangles);

/* Phong tessellation of a quad [2, here bilinear]: p = sum w_i p_i with w = (1-u)(1-v), (1-u)v, uv,
   u(1-v), moved towards the mean of its projections onto the corners' tangent planes:
   (1 - shape) p + shape * sum w_i (p - n_i . (p - p_i) n_i). Corner after corner; normal may be NULL. */
TREEPIECES_API void treepieces_patch_point(const float positions[12], const float normals[12],
                                           float shape, float u, float v, float position[3],
                                           float normal[3]);

/* ---- baked meshes ------------------------------------------------------------------------ */

/* Plain triangles. Vertices are welded: those of neighbouring quads and pieces are the same. */
typedef struct treepieces_mesh {
    size_t vertex_count, triangle_count;
    float *positions, *normals; /* 3 per vertex                                                     */
    uint32_t *joints;           /* 4 per vertex: node numbers in the tree; weight 0: joint 0        */
    float *weights;             /* 4 per vertex, sum 1                                              */
    uint32_t *indices;          /* 3 per triangle, counter-clockwise from outside                   */
    float *uvs;                 /* 2 per corner, so 6 per triangle; v downwards. Into the sheet of
                                   treepieces_bark, or into the leaf picture                        */
} treepieces_mesh;

typedef struct treepieces_bake_desc {
    const treepieces_forest *forest;
    int tree;
    const float *bones;       /* of the forest                                                      */
    const treepieces_lod *lod; /* NULL = no tessellation                                            */
    int capped;               /* close the foot as well                                             */
    int sheet_size;           /* pixels across the sheet, which uvs keep half a pixel inside of; 0 = 512 */
    int sheet_layers;         /* 0 = TREEPIECES_OWN                                                 */
} treepieces_bake_desc;

TREEPIECES_API txm_status treepieces_bake(const treepieces_bake_desc *desc, txm_env *env,
                                          treepieces_mesh **out);
TREEPIECES_API void treepieces_mesh_free(treepieces_mesh *mesh);

/* ---- bark -------------------------------------------------------------------------------- */

enum { TREEPIECES_SHEET = 8 }; /* tiles across and down a layer of the sheet */

/* Sheets of bark out of framed tiles [1, 5]: as all tiles of class 0 have one frame, any rectangle of
   tiles laid side by side fits any other. Layer 0 is 8 x 8 of them, without end in both directions;
   a quad shows a rectangle of 1 to 16 tiles across, round the sheet twice if need be, and 1 to 8
   along, so that texels are about as large on the trunk as on twigs. The lowest rows of layers FOLD to HALVING are blended so that they meet what
   their names say; quads on them lie on the bottom. Layers from OWN have one class each: 4 x 4 tiles, each in
   the middle of 2 x 2 cells and continued around it by its own border; a quad shows one of them. */
typedef struct treepieces_bark_desc {
    const txm_image *tiles; /* square, one size, sample type and number of channels                 */
    const int *classes;     /* of each: 0, or from TREEPIECES_OWN; NULL = all 0                     */
    int tile_count;         /* one of class 0 at least                                              */
    uint64_t seed;
} treepieces_bark_desc;

/* Layers of the sheet: TREEPIECES_OWN and one for each own class, up to the highest. */
TREEPIECES_API int treepieces_bark_layers(const treepieces_bark_desc *desc);

/* Draw the sheet: out is 8 tiles wide and 8 per layer high, layers one under the other, of the tiles'
   channels and sample type. */
TREEPIECES_API txm_status treepieces_bark(const treepieces_bark_desc *desc, txm_env *env,
                                          txm_image out);

/* Where a quad's corner (0..3) lies in its layer, 0..1, v downwards; returns the layer. bands: word 3
   of its record, cell: its byte, pixels: across the sheet, of which half a one is kept away. */
TREEPIECES_API int treepieces_quad_uv(const treepieces_quad *quad, uint32_t bands, int cell,
                                      int pixels, int corner, float uv[2]);

/* A bark of our own, for those who have no photograph: `tile_count` tiles that share a frame. */
TREEPIECES_API txm_status treepieces_draw_bark(const treepieces_species *species, uint64_t seed,
                                               txm_env *env, const txm_image *tiles,
                                               int tile_count);

/* ---- foliage ----------------------------------------------------------------------------- */

/* A leaf card of a cloud whose sphere has radius 1 about the origin. */
typedef struct treepieces_card {
    float center[3];
    float right[3], up[3]; /* half the card's width and height                                      */
    float normal[3];       /* for shading: mostly away from the cloud's middle                      */
} treepieces_card;

/* The leaf cloud number `look` of a species: species->leaf_count cards. Returns how many; cards may be
   NULL. */
TREEPIECES_API int treepieces_cloud(const treepieces_species *species, uint32_t look,
                                    treepieces_card *cards);

/* A picture of a spray of leaves for the cards, RGBA, drawn for those who have none. out: any size,
   4 channels of 8 bits; partly drawn after TXM_CANCELLED. */
TREEPIECES_API txm_status treepieces_draw_leaves(const treepieces_species *species, uint64_t seed,
                                                 txm_env *env, txm_image out);

/* 2.5D impostor [1, 6]: a leaf cloud as seen along a direction, by parallel rays.

   cards      card_count of them
   leaves     their picture, RGBA, 8 bits; alpha below 1/2 is not there
   right, up, forward  unit vectors of the view, at right angles; forward away from the eye
   color      RGBA, 8 bits: sRGB, shaded by `light` (unit vector towards the light); alpha 0 or 255. Its
              square shows -1..1 along right and up
   depth      float, 1 channel, size of color: along -forward, that is towards the eye, from the
              cloud's middle in its radii; -2 where there is nothing                               */
typedef struct treepieces_impostor_desc {
    const treepieces_card *cards;
    int card_count;
    txm_image leaves;
    float right[3], up[3], forward[3];
    float light[3];
} treepieces_impostor_desc;
TREEPIECES_API txm_status treepieces_impostor(const treepieces_impostor_desc *desc, txm_env *env,
                                              txm_image color, txm_image depth);

/* Plain leaf cards for those without impostors: the clouds of a tree as a mesh of two triangles a card,
   each bound to its cluster's bone. joints and weights as in bake. looks: how many different clouds
   are in use, 1..64; cluster.look mod looks chooses. */
TREEPIECES_API txm_status treepieces_bake_leaves(const treepieces_forest *forest, int tree,
                                                 const float *bones, int looks, txm_env *env,
                                                 treepieces_mesh **out);

#ifdef __cplusplus
}
#endif
#endif /* TREEPIECES_H */

#if defined(TREEPIECES_IMPLEMENTATION) && !defined(TREEPIECES_IMPLEMENTED)
#define TREEPIECES_IMPLEMENTED

#include "treepieces/rim.h"
#include "treepieces/builtin.h"
#include "treepieces/kit.h"
#include "treepieces/species.h"
#include "treepieces/presets.h"
#include "treepieces/text.h"
#include "treepieces/grow.h"
#include "treepieces/forest.h"
#include "treepieces/wind.h"
#include "treepieces/bones.h"
#include "treepieces/tessellation.h"
#include "treepieces/bark.h"
#include "treepieces/cloud.h"
#include "treepieces/spray.h"
#include "treepieces/impostor.h"
#include "treepieces/bake.h"
#endif /* TREEPIECES_IMPLEMENTATION */

/* ---- licence ----------------------------------------------------------------------------

   This file may be used under either of two licences, whichever you like better.

   1. MIT

   Copyright (c) 2026 the texkit authors

   Permission is hereby granted, free of charge, to any person obtaining a copy of this software
   and associated documentation files (the "Software"), to deal in the Software without
   restriction, including without limitation the rights to use, copy, modify, merge, publish,
   distribute, sublicense, and/or sell copies of the Software, and to permit persons to whom the
   Software is furnished to do so, subject to the following conditions:

   The above copyright notice and this permission notice shall be included in all copies or
   substantial portions of the Software.

   THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING
   BUT NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY, FITNESS FOR A PARTICULAR PURPOSE AND
   NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS OR COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM,
   DAMAGES OR OTHER LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM,
   OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE SOFTWARE.

   2. Public domain (Unlicense, unlicense.org)

   This is free and unencumbered software released into the public domain.

   Anyone is free to copy, modify, publish, use, compile, sell, or distribute this software,
   either in source code form or as a compiled binary, for any purpose, commercial or non-
   commercial, and by any means.

   In jurisdictions that recognize copyright laws, the author or authors of this software dedicate
   any and all copyright interest in the software to the public domain. We make this dedication
   for the benefit of the public at large and to the detriment of our heirs and successors. We
   intend this dedication to be an overt act of relinquishment in perpetuity of all present and
   future rights to this software under copyright law.

   THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING
   BUT NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY, FITNESS FOR A PARTICULAR PURPOSE AND
   NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER
   LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM, OUT OF OR IN
   CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE SOFTWARE.
*/
