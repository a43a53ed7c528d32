/* treepieces.h - v0.2.0 - animated trees made of interlocking pieces
   SPDX-License-Identifier: MIT OR Unlicense                   (full text: end of file)

   WHAT IT DOES
     Grows trees by a small grammar from a few kinds of pieces - tube, forks, side branches, tip,
     root flare - that join at hexagonal rims. A tree is not stored as a mesh but as a list of
     pieces on one connected skeleton: a thousand different trees are drawn with one instanced call
     per kind of piece. They sway in the wind joint by joint, are tessellated without cracks near
     the camera, and have bark textures that continue across every joint. A tree can also be baked
     into an ordinary welded mesh with skinning weights and leaf cards.

   QUICK START                                 (tests build and run this very block)
     // Grow an oak, let the wind blow, write it as OBJ. cc -std=c99 quick.c -lm
     #define TREEPIECES_IMPLEMENTATION        // in exactly one .c or .cpp file
     #include "treepieces.h"                  // texmath.h must lie beside it
     #include <stdio.h>

     int main(void) {
         static treepieces_forest_desc desc;  // static: all zero, the default for every field
         static treepieces_bake_desc bake;
         static treepieces_wind wind;
         static txm_env env;                  // malloc, silent, serial; receives the message
         treepieces_species oak;
         treepieces_kit *kit;
         treepieces_forest *tree;
         treepieces_mesh *mesh;
         float *bones, *sway;                 // the caller owns what changes from frame to frame
         if (treepieces_kit_make(NULL, 0, &env, &kit) != TXM_OK ||
             treepieces_preset("oak", &env, &oak) != TXM_OK)
             return 1;
         desc.kit = kit;
         desc.species = &oak;
         desc.species_count = 1;
         desc.tree_count = 1;                 // or 10000, all different
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
         for (int i = 0; i < 60; i++)         // one second at 60 frames per second
             treepieces_sway(tree, &wind, i / 60.0, 1 / 60.0, NULL, &env, sway, bones);
         // a renderer uploads the bones and draws tree->batches after each step
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
     Pieces are quad meshes whose borders are rims: hexagons of one shape and with one set of
     normals. The root rim is a canonical hexagon; each leaf rim is that hexagon moved by a building
     transform. The vertices of a rim follow a single bone, and a parent piece stores the vertices
     of its leaf rims in the frame of the child: both pieces compute the same numbers, so that no
     pose opens a gap or shows a crease. A child can be attached in six rotations. Each piece has
     one bone of its own, which scales it across and along the stem; its leaf rims follow the bones
     of its children, all in one buffer [1, 4.1 to 4.3].
     A tree is sketched axis by axis, the longest and outermost first, each to its end, until a limit on
     the number of pieces is reached; then pieces are made of the sketch. Where a branch was not reached a
     fork is a tube, and in trees of few pieces tubes in a row become one. So trees of any limit have one
     skeleton, of which small ones lack the twigs: this is the coarse level of detail.
     The fine one is tessellation by distance, symmetric along each edge [1, 4.4]. Wind is a sum of
     gusts that travel across the land; each joint responds as a damped oscillator, solved exactly
     over each time step. The joints of an axis swing together: the trunk with the gusts, about 3
     times in 10 seconds, branches 1 time a second and twigs 2 to 3 times, about as far for their length.
     Bark: all tiles of a set share one frame, so that any tile, and any rectangle of tiles, fits
     beside any other. A quad shows 1 to 16 of them across and 1 to 8 along, depending on its size,
     and blended tiles in the crotches, where directions of growth meet [1, 5].

   CONFIGURATION   (define before the include that has _IMPLEMENTATION)
     TREEPIECES_STATIC     every function static to the including file (set it everywhere)

   MEMORY
     A forest takes about 60 bytes per piece; bones and sway state, which the caller owns, take 64
     more: 20 KB for a tree of 4,000 triangles. treepieces_forest.bytes is exact. Growing takes up to 1,500
     more bytes for each piece of the 64 trees that grow at a time, 4,000 with few pieces, which are
     released afterwards.

   TIME   (one core of 2023; make bench measures yours)
     About 0.4 microseconds to grow a piece that keeps clear of others, 0.25 without clearance, if the
     memory was in use before (in fresh memory up to half as long again), 0.06 to move its bone in the wind. The
     parallel-for hook distributes trees.

   THREADS
     No global state. Calls with different env and outputs may overlap; a kit and a forest may be
     read by many threads.

   SAME BYTES
     Trees are computed by sums, products, quotients and square roots in a fixed order: the same
     bytes on any number of threads and with any compiler that keeps to IEEE 754 (see texmath.h),
     built with -ffp-contract=off. The same holds for bones, skinning and tessellation. (gcc -std=c99
     for s390x takes floats for doubles between two assignments; the implementation tells it not to.)

   LIMITS
     Up to 3 leaf rims, 255 vertices and 255 quads per piece, 16 kinds of pieces, 65,535 pieces per
     tree, 2^31 per forest. Branches keep apart at rest; in the wind they may pass through
     each other. Wind bends joints; leaves move only with their twigs. A stem bends by at most 60
     degrees from one piece to the next.

   REFERENCES
     [1] V. Burkus, A. Karpati, L. Szecsi. Animated trees with interlocking pieces.
     [2] T. Boubekeur, M. Alexa. Phong tessellation. ACM Transactions on Graphics 27(5), 2008.
     [3] G. Szijarto, J. Koloszar. Real-time hardware accelerated rendering of forests at human scale.
         Journal of WSCG 12(1-3), 2004 (2.5D impostors).                                         */
#ifndef TREEPIECES_H
#define TREEPIECES_H

#include "texmath.h"

#include <stdio.h>

#define TREEPIECES_VERSION "0.2.0"

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
    TREEPIECES_BANDS = 4,          /* groups of quads of a piece with the same numbers of tiles  */
    TREEPIECES_BONE = 12           /* floats of a bone: three rows of four, see treepieces_bones */
};

/* The built-in pieces; those of the caller are numbered after them. */
typedef enum treepieces_type {
    TREEPIECES_I = 0,   /* a tube                                                    1 leaf rim  */
    TREEPIECES_Y,       /* a symmetric fork                                          2 leaf rims */
    TREEPIECES_SIDE,    /* a tube (rim 0) with a branch (rim 1)                      2           */
    TREEPIECES_PLANAR,  /* a tube (rim 0) with two opposite branches                 3           */
    TREEPIECES_SPATIAL, /* a fork in three                                           3           */
    TREEPIECES_TIP,     /* a closed end                                              none        */
    TREEPIECES_FLARE,   /* the foot of a trunk, where the roots begin                1           */
    TREEPIECES_BUILTIN  /* number of built-in pieces                                             */
} treepieces_type;

/* Which kind of tile a quad shows. treepieces_bark derives 1 to 4 from tiles of class 0. */
typedef enum treepieces_class {
    TREEPIECES_BARK = 0,   /* neighbours match on all four sides                                 */
    TREEPIECES_FOLD,       /* its south side meets the south side of another folded quad         */
    TREEPIECES_TURN_LEFT,  /* its south side meets the east side of a plain quad                 */
    TREEPIECES_TURN_RIGHT, /* its south side meets the west side of a plain quad                 */
    TREEPIECES_HALVING,    /* half as many tiles across its north side as across its south side;
                              assigned while a tree grows, never by a piece                      */
    TREEPIECES_OWN         /* and above: classes defined by the caller's pieces                  */
} treepieces_class;

/* A vertex of a piece, 48 bytes, laid out for the GPU. Model space: the root rim has radius 1 about
   the origin in the plane y = 0, the stem points up (+y). */
typedef struct treepieces_vertex {
    float position[3];
    int32_t rim;      /* out: 6 leaf + place if on a leaf rim, else -1                           */
    float normal[3];  /* unit length                                                             */
    float reserved;   /* 0                                                                       */
    float weights[4]; /* of the piece's own bone (the root joint), then of the bones of the children
                         at leaf rims 0, 1, 2; each >= 0, sum 1. On the root rim 1 0 0 0; on leaf rim
                         k weights[1 + k] is 1                                                   */
} treepieces_vertex;

/* A quad, seen from outside: the corners nw, sw, se, ne of its tile, counter-clockwise. North is
   towards the leaf rims. */
typedef struct treepieces_quad {
    uint8_t corners[4];
    uint8_t tile_class; /* treepieces_class                                                      */
    uint8_t band;       /* 0..TREEPIECES_BANDS-1: all quads of a band show the same numbers of
                           tiles. Band 0 touches the root rim, band 1 + k leaf rim k (of an I: 0
                           is the lower half, 1 the upper)                                       */
} treepieces_quad;

/* A similarity: p -> translation + scale * rotate(rotation, p). */
typedef struct treepieces_similarity {
    float translation[3];
    float rotation[4]; /* unit quaternion x y z w */
    float scale;       /* > 0                     */
} treepieces_similarity;

/* A piece [1, 4.1 to 4.3]: a quad mesh whose boundary is its rims. Vertex k of a rim lies at
   (cos 60k, 0, -sin 60k) in the rim's frame, with the normal (10 cos 60k, 1, -10 sin 60k) / sqrt(101),
   so that all rims are cross-sections of cones of one opening angle. Seen from outside with y up,
   vertex k + 1 is to the right of vertex k. building maps the root rim's frame to that of a leaf
   rim. */
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

/* Make a kit: the built-in pieces and, numbered from TREEPIECES_BUILTIN, copies of the caller's.

   pieces  the caller's pieces, `count` of them, or NULL. Each is checked: counts and indices in range;
           rim vertices within 1e-4 of their radius of the canonical hexagon (they are then moved onto
           it), with its normals; weights; a connected, oriented, manifold surface whose only borders
           are the rims, without unused vertices; a building transform for each leaf rim
   out     receives the kit, or NULL on any error; release it with treepieces_kit_free
   return  TXM_OK; TXM_BAD_ARGUMENT, the message names piece and vertex; TXM_TOO_LARGE;
           TXM_OUT_OF_MEMORY                                                                     */
TREEPIECES_API txm_status treepieces_kit_make(const treepieces_piece *pieces, int count,
                                              txm_env *env, treepieces_kit **out);

/* Release a kit with the allocator it was made with; NULL is allowed. Forests made with it must not
   be used after that. */
TREEPIECES_API void treepieces_kit_free(treepieces_kit *kit);

/* Number of pieces in a kit, the built-in ones included; 0 for NULL. */
TREEPIECES_API int treepieces_kit_count(const treepieces_kit *kit);

/* Piece `type` of a kit; NULL for a number out of range. Valid as long as the kit. */
TREEPIECES_API const treepieces_piece *treepieces_kit_piece(const treepieces_kit *kit, int type);

/* ---- species ----------------------------------------------------------------------------- */

enum {
    TREEPIECES_MAX_ORDERS = 5,
    TREEPIECES_MAX_NAME = 32
};

/* The axes of one order: 0 is the trunk, 1 the branches on it, 2 the branches on those, ... An axis
   is a chain of pieces; a fork splits it into axes of the same order. */
typedef struct treepieces_order {
    float length;         /* order 0: metres; else ratio to the length of the parent axis         */
    float length_spread;  /* 0..1: uniform within length * (1 -+ spread)                          */
    float radius;         /* at the base: order 0: ratio to its length; else to the radius of the
                             parent stem there                                                    */
    float taper;          /* radius at the end over radius at the base, 0.02..1                   */
    float segments;       /* pieces along an axis of full length, 1..64                           */
    float start;          /* 0..1: fraction of the axis, from its base, without branches          */
    float side, pair;     /* probabilities that a piece beyond start bears one or two branches    */
    float fork, triple;   /* probabilities that it splits the axis in two or three                */
    float fork_angle;     /* degrees between an arm of a fork and the axis below                  */
    float fork_ratio;     /* fraction of the remaining length that an arm gets, 0.1..1            */
    float angle_base, angle_top; /* degrees between a branch of this order and its parent stem, at
                             the base and at the end of the stem                                  */
    float angle_spread;   /* degrees, uniform -+                                                  */
    float profile[3];     /* length of a branch of this order at the start, the middle and the end
                             of its parent stem, times `length`; a parabola in between            */
    float roll;           /* degrees about the stem from one branch to the next; pieces turn by
                             multiples of 60, the rest is twist                                   */
    float wander;         /* degrees by which the axis turns at random from piece to piece        */
    float tropism;        /* -1..1: how strongly each piece turns up (> 0) or down (< 0)          */
    float sag;            /* degrees by which the end of a horizontal axis hangs below the
                             direction of its base: weight; < 0 lifts the end                     */
    float gravimorphism;  /* -1..1: branches of this order on the upper (> 0) or lower (< 0) side
                             of a slanting stem grow longer                                       */
    float flatten;        /* 0..1: how much branches of this order are turned to the horizontal   */
    float leaves;         /* 0..1: probability that a piece bears a leaf cloud                    */
    float leaves_start;   /* 0..1: fraction of the axis, from its base, without leaves            */
} treepieces_order;

typedef enum treepieces_envelope {
    TREEPIECES_FREE = 0,  /* none; the others are crown_width wide, from crown_base to crown_top */
    TREEPIECES_ELLIPSOID,
    TREEPIECES_CONE,
    TREEPIECES_CYLINDER
} treepieces_envelope;

typedef enum treepieces_leaf_shape {
    TREEPIECES_LEAF_OVAL = 0,
    TREEPIECES_LEAF_LOBED,  /* oak       */
    TREEPIECES_LEAF_LANCE,  /* willow    */
    TREEPIECES_LEAF_HEART,  /* poplar    */
    TREEPIECES_LEAF_NEEDLE, /* conifers  */
    TREEPIECES_LEAF_BLOSSOM, /* almond   */
    TREEPIECES_LEAF_PALMATE, /* maple    */
    TREEPIECES_LEAF_COMPOUND /* ash: leaflets on both sides of a stalk */
} treepieces_leaf_shape;

/* How the cards of a leaf cloud lie. */
typedef enum treepieces_cloud_kind {
    TREEPIECES_CLOUD_ROUND = 0, /* twigs that grow outwards in all directions, fewer inside      */
    TREEPIECES_CLOUD_LAYERS,    /* flat sprays one above the other                               */
    TREEPIECES_CLOUD_SHOOTS,    /* along shoots that radiate from the centre                     */
    TREEPIECES_CLOUD_STRIPS     /* hanging strips                                                */
} treepieces_cloud_kind;

/* The drawn bark. */
typedef enum treepieces_bark_kind {
    TREEPIECES_BARK_FURROWED = 0, /* ridges between fissures along the stem: oak, willow          */
    TREEPIECES_BARK_SMOOTH,       /* fine wrinkles: beech                                         */
    TREEPIECES_BARK_LENTICELS,    /* smooth, with marks across: birch (dark), almond (pale)       */
    TREEPIECES_BARK_PLATES        /* plates that flake off: pine                                  */
} treepieces_bark_kind;

/* A kind of tree. For the text form see treepieces_species_parse. */
typedef struct treepieces_species {
    char name[TREEPIECES_MAX_NAME];
    int order_count; /* 1..TREEPIECES_MAX_ORDERS */
    treepieces_order orders[TREEPIECES_MAX_ORDERS];
    float flare;      /* radius at the ground over that of the trunk, 1..4                        */
    int envelope;     /* treepieces_envelope: axes end where they leave it                        */
    float crown_base, crown_top, crown_width; /* in lengths of the trunk; the width is a diameter */
    float shade;      /* pruning by light: axes end where there are more than this many pieces above
                         them per m^2 of ground; 0 = no pruning                                   */
    float phototropism; /* 0..1: how strongly branches turn from where more pieces are above to where
                         fewer are, and how long those in the shade wait for their turn to grow  */
    float clearance;  /* 0..10: branches keep apart by this times the sum of their radii: they turn out
                         of the way of what grew before them, or end. 0 = they may cross, as
                         they may under the caller's rule and those of the paper                  */
    float stiffness;  /* wind bends joints by its inverse; 1 = an average tree                    */
    int leaf_shape;   /* treepieces_leaf_shape                                                    */
    int leaf_count;   /* cards per leaf cloud, 1..256; 0 = no leaves                              */
    float leaf_size;  /* side of a card, in radii of the cloud                                    */
    int cloud_kind;   /* treepieces_cloud_kind                                                    */
    float cloud;      /* radius of a leaf cloud, metres                                           */
    float cloud_flat; /* height of a cloud over its width, 0.1..2                                 */
    int bark_kind;    /* treepieces_bark_kind                                                     */
    float leaf_color[3], bark_color[3]; /* sRGB 0..1: tint of the drawn leaves and bark           */
} treepieces_species;

/* Built-in species, 0..treepieces_preset_count()-1, as text for treepieces_species_parse; NULL for
   a number out of range. */
TREEPIECES_API int treepieces_preset_count(void);
TREEPIECES_API const char *treepieces_preset_text(int index);

/* The built-in species of that name. TXM_BAD_ARGUMENT if there is none; the message lists the
   names. */
TREEPIECES_API txm_status treepieces_preset(const char *name, txm_env *env,
                                            treepieces_species *species);

/* Read a species from text: lines "key value ..."; "order N" begins the keys of that order; "like
   NAME" starts from a built-in species; # begins a comment. The keys are the names of the fields;
   those that are missing keep the values of a small round tree. The text is UTF-8, with or without
   a byte order mark; lines end in \n, \r\n or \r.
   return TXM_OK; TXM_BAD_DATA, the message names line and key; *species is untouched then       */
TREEPIECES_API txm_status treepieces_species_parse(const char *text, size_t size, txm_env *env,
                                                   treepieces_species *species);

/* Write a species as text, cut to fit, with a 0 at the end; returns the length of all of it. */
TREEPIECES_API size_t treepieces_species_print(const treepieces_species *species, char *text,
                                               size_t capacity);

/* ---- growing ----------------------------------------------------------------------------- */

/* An open rim, to which a piece is to be attached. */
typedef struct treepieces_site {
    int depth;               /* pieces between it and the ground                                  */
    int order;               /* of the axis                                                       */
    int parent, rim;         /* type of the parent piece (-1: the ground) and number of its rim   */
    int tree;                /* number of the tree                                                */
    float position[3], direction[3]; /* world space, metres; unit length                          */
    float radius;            /* metres                                                            */
    float along;             /* 0..1: position along its axis                                     */
    float length;            /* of its axis, metres                                               */
} treepieces_site;

/* The piece to attach. */
typedef struct treepieces_choice {
    int type;           /* of the kit; a piece without leaf rims ends the axis                    */
    int turn;           /* 0..5: multiples of 60 degrees about the stem; -1: as the roll of the
                           branches requires                                                      */
    float direction[3]; /* of the stem, world space, of any length; limited to 60 degrees from the
                           direction of the site                                                  */
    float length;       /* of the piece, metres                                                   */
    float ratios[TREEPIECES_MAX_LEAVES]; /* radius at leaf rim k over that of the site, 0.02..1   */
    int leaves;         /* 1: bears a leaf cloud                                                  */
} treepieces_choice;

/* A rule of the caller: change *choice, which holds that of the grammar, or leave it as it is. Must
   depend only on its arguments and on rng, which belongs to the site; with a parallel-for hook it
   is called for several trees at the same time. */
typedef void treepieces_rule_function(void *user, const treepieces_site *site, txm_rng *rng,
                                      treepieces_choice *choice);

typedef enum treepieces_rule {
    TREEPIECES_GRAMMAR = 0, /* the probabilities of the species                                   */
    TREEPIECES_ALTERNATE,   /* I and Y alternate [1, 8]                                           */
    TREEPIECES_RANDOM       /* I or Y with equal probability [1, 8]                               */
} treepieces_rule;

/* Where a tree stands. */
typedef struct treepieces_place {
    float position[3]; /* metres                                                                  */
    float turn;        /* radians about y                                                         */
    float scale;       /* 0.001..1000; 0 = 1                                                      */
    int species;
    uint64_t seed;
} treepieces_place;

typedef struct treepieces_forest_desc {
    const treepieces_kit *kit;         /* must outlive the forest                                 */
    const treepieces_species *species; /* species_count of them; copied                           */
    int species_count;
    const treepieces_place *places; /* tree_count of them; NULL = a jittered grid about the origin,
                                       with random species and sizes                              */
    int tree_count;
    float spacing;  /* of that grid, metres; 0 = 0.6 times the trunk length of the tallest species */
    int max_pieces; /* per tree, 8..65535; 0 = 600. The most important axes grow first: trees of
                       the same seed and fewer pieces are sparser, with the same height and shape */
    int rule;       /* treepieces_rule                                                            */
    treepieces_rule_function *own_rule; /* NULL, or called for each open rim                      */
    void *own_user; /* its first argument                                                         */
    uint64_t seed;
} treepieces_forest_desc;

enum { TREEPIECES_NONE = -1 };

/* One piece of a tree: a joint of its skeleton, 32 bytes. Its bone is

       B = T(position) R diag(radius, length, radius),
       position = B_parent * translation of the parent's building transform,
       R = R_parent * rotation, rotation = building rotation * turn * joint transform  [1, 4.2, 4.3]

   so that the scale of a piece does not affect its children. For the first node of a tree, position and
   rotation are those of the tree. */
typedef struct treepieces_node {
    float rotation[4];    /* from the parent's frame, unit quaternion                             */
    float radius, length; /* metres                                                               */
    int32_t parent;       /* node number within its tree, lower than its own; TREEPIECES_NONE for
                             the first                                                            */
    uint8_t type;
    uint8_t joint;        /* 8 * leaf rim of the parent + turn                                    */
    uint8_t order;        /* of its axis                                                          */
    uint8_t sway;         /* how its axis swings, see treepieces_sway: bits 0..3 the class of its
                             oscillator, 4..6 its phase                                           */
} treepieces_node;

/* A leaf cloud: a sphere of foliage about a point on the axis of a piece, 16 bytes. */
typedef struct treepieces_cluster {
    uint32_t node; /* number in the forest, which is that of the bone                             */
    float along;   /* 0..1 of the length of the piece                                             */
    float radius;  /* metres                                                                      */
    uint32_t look; /* random bits: which cloud is shown and how it is turned                      */
} treepieces_cluster;

typedef struct treepieces_tree {
    uint32_t first_node, node_count;
    uint32_t first_cluster, cluster_count;
    float position[3], turn, scale;
    int species;
    uint32_t seed;
    float height; /* of its highest joint above its base, metres                                  */
} treepieces_tree;

/* All pieces of one type, for one instanced draw call: `count` records of `stride` 32-bit words:

       word 0    number of the piece's own bone
       word 1    bone of the child at leaf rim 0, minus word 0; the same for rim 1, << 16
       word 2    the same for rim 2; turns of the children << 16, 4 bits each
       word 3    one byte per band, band 0 lowest: bits 0..2 log2 of the tiles across a quad (0..4),
                 3..4 log2 of those along it, 5: halving
       word 4... one byte per quad, lowest first: column + 8 * row of its first tile in the sheet */
typedef struct treepieces_batch {
    const uint32_t *words;
    uint32_t count, stride;
    int quad_count;
} treepieces_batch;

/* A forest, or a single tree: arrays that can be uploaded as they are. Read only. */
typedef struct treepieces_forest {
    const treepieces_kit *kit;
    const treepieces_species *species;
    const treepieces_tree *trees;
    const treepieces_node *nodes;       /* tree after tree, parents before children               */
    const treepieces_cluster *clusters; /* tree after tree                                        */
    treepieces_batch batches[TREEPIECES_MAX_TYPES]; /* by type                                    */
    int species_count, tree_count, type_count;
    uint32_t node_count, cluster_count;
    size_t bytes; /* allocated for all this                                                       */
} treepieces_forest;

/* Grow trees, each from its own seed: a tree is the same whatever other trees are in the forest and
   however many threads are used.

   return TXM_OK; TXM_BAD_ARGUMENT for a field out of range (the message names it), or an invalid choice
          of own_rule; TXM_TOO_LARGE above 2^31 pieces; TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost   O(pieces); about 130 bytes per piece with its bone and sway state                      */
TREEPIECES_API txm_status treepieces_forest_make(const treepieces_forest_desc *desc, txm_env *env,
                                                 treepieces_forest **out);

/* Where the trees of a forest stand: desc->places, or the jittered grid. For programs that draw the
   same few trees in many places.
   places  out, desc->tree_count of them, untouched after an error
   return  TXM_OK; TXM_BAD_ARGUMENT as of treepieces_forest_make                                 */
TREEPIECES_API txm_status treepieces_scatter(const treepieces_forest_desc *desc, txm_env *env,
                                             treepieces_place *places);

/* Release a forest; NULL is allowed. */
TREEPIECES_API void treepieces_forest_free(treepieces_forest *forest);

/* ---- poses and wind ---------------------------------------------------------------------- */

/* A pose: additional rotations of the joints. All zero is the tree as it grew. */
typedef struct treepieces_pose {
    uint64_t seed;
    float amount;        /* radians: each joint turns by up to this about a random axis across it,
                            which depends on both seeds, this one and the tree's                  */
    const float *joints; /* NULL, or a unit quaternion per node, applied to it in addition        */
} treepieces_pose;

/* The bones of all trees: TREEPIECES_BONE floats for each node of the forest, the rows of the 3 x 4
   matrix [X Y Z T] from the frame of the piece's root rim to the world (std430: vec4[3]).
   return TXM_OK; TXM_BAD_ARGUMENT                                                               */
TREEPIECES_API txm_status treepieces_bones(const treepieces_forest *forest,
                                           const treepieces_pose *pose, txm_env *env, float *bones);

/* Wind: a mean speed, and gusts that travel with it across the land. */
typedef struct treepieces_wind {
    float direction; /* radians from +x towards -z: where it blows to                             */
    float speed;     /* metres per second, 0..100; bends by its square, above 15 m/s by less     */
    float gusts;     /* 0..1: how much the pressure varies; 0 = steady                            */
    uint32_t seed;
    float period;    /* 0..10^6 seconds after which all of it repeats itself, so that animations can
                        loop: a tree that sways for long in steps of a part of this does so too. 0 =
                        never. With short periods the gusts are faster                            */
} treepieces_wind;

/* The pressure of the wind at a position and time (seconds), gusts included; 1 = that of 10 m/s. 0
   if an argument is out of range. */
TREEPIECES_API float treepieces_gust(const treepieces_wind *wind, const float position[3],
                                     double time);

/* Advance the sway of all trees by one time step and compute their bones. Each joint is a damped
   oscillator in two directions, driven by the wind and solved exactly over the step, so that steps of
   any length are stable.

   time   seconds at the end of the step; dt: its length, >= 0
   pose   NULL, or the pose about which the trees sway
   state  4 floats per node, all 0 at the start; in and out
   bones  out, as of treepieces_bones                                                            */
TREEPIECES_API txm_status treepieces_sway(const treepieces_forest *forest,
                                          const treepieces_wind *wind, double time, double dt,
                                          const treepieces_pose *pose, txm_env *env, float *state,
                                          float *bones);

/* ---- skinning ---------------------------------------------------------------------------- */

/* The vertices of one instance in world space by linear blend skinning; the reference for shaders.
   Vertex j of leaf rim k is vertex (j - turn) mod 6 of the child's root rim, moved by the child's bone
   alone: the same expression of the same numbers as in the child, so that both are equal to the bit.
   Other vertices blend: their position in model space moved by its own bone, and their position in the
   frame of each child moved by the child's bone, with the stretch of its own piece.

   type, instance      one record of forest->batches[type]
   positions, normals  3 floats per vertex of the piece; normals (may be NULL) of unit length     */
TREEPIECES_API void treepieces_skin(const treepieces_forest *forest, const float *bones, int type,
                                    uint32_t instance, float *positions, float *normals);

/* ---- level of detail --------------------------------------------------------------------- */

typedef struct treepieces_lod {
    float eye[3];
    float max_level;     /* tessellation level at the eye, 1..64; 0 = 1: no tessellation          */
    float half_distance; /* metres over which the level halves; 0 = 10                            */
    float shape;         /* of Phong tessellation, 0..1; 0 = 0.6, which rounds hexagons; < 0: flat  */
} treepieces_lod;

/* The tessellation level of an edge and of the inside of a quad (corner after corner):
   ceil(max_level * 2^(-d / half_distance)), at least 1, where d is the distance from the eye to the
   middle of the edge or quad. Symmetric in a and b to the bit [1, 4.4]. */
TREEPIECES_API int treepieces_edge_level(const treepieces_lod *lod, const float a[3],
                                         const float b[3]);
TREEPIECES_API int treepieces_inner_level(const treepieces_lod *lod, const float corners[12]);

/* The triangles of a quad with levels 1..64 for the edges from corner 0 to 1, 1 to 2, 2 to 3, 3 to 0
   and for the inside; vertices are spaced as by OpenGL's equal_spacing.
   coords   u, v of each vertex: corner 0 (0, 0), 1 (0, 1), 2 (1, 1), 3 (1, 0); may be NULL
   indices  3 per triangle; may be NULL
   return   the number of vertices; *triangles receives that of triangles                         */
TREEPIECES_API int treepieces_pattern(const int edges[4], int inner, float *coords,
                                      uint16_t *indices, int *triangles);

/* Phong tessellation [2] of a quad instead of a triangle: the bilinear point p = sum w_i p_i with
   w = (1-u)(1-v), (1-u)v, uv, u(1-v), moved towards the mean of its projections onto the tangent
   planes of the corners: (1 - shape) p + shape * sum w_i (p - n_i . (p - p_i) n_i). Corner after
   corner; normal may be NULL. */
TREEPIECES_API void treepieces_patch_point(const float positions[12], const float normals[12],
                                           float shape, float u, float v, float position[3],
                                           float normal[3]);

/* ---- baked meshes ------------------------------------------------------------------------ */

/* Triangles with skinning weights. Neighbouring quads and pieces share their vertices. */
typedef struct treepieces_mesh {
    size_t vertex_count, triangle_count;
    float *positions, *normals; /* 3 per vertex                                                   */
    uint32_t *joints;           /* 4 per vertex: nodes of the tree; 0 where the weight is 0       */
    float *weights;             /* 4 per vertex, sum 1                                            */
    uint8_t *colors;            /* 4 per vertex, R G B and 255: sRGB factors of the picture. Young bark is
                                   darker, as are leaves inside the crown                         */
    uint32_t *indices;          /* 3 per triangle, counter-clockwise from outside                 */
    float *uvs;                 /* 2 per corner, so 6 per triangle; v downwards. Into the sheet of
                                   treepieces_bark, or into the leaf image                        */
} treepieces_mesh;

typedef struct treepieces_bake_desc {
    const treepieces_forest *forest;
    int tree;                  /* which of them                                                   */
    const float *bones;        /* of the whole forest                                             */
    const treepieces_lod *lod; /* NULL = no tessellation                                          */
    int capped;                /* non-zero: close the base as well                                */
    int sheet_size;            /* width of the bark sheet in pixels, as v stays half a pixel inside the
                                  tiles; 0 = 512                                                  */
    int sheet_layers;          /* 0 = TREEPIECES_OWN                                              */
} treepieces_bake_desc;

/* One tree of a forest as a welded mesh: bark only, see treepieces_bake_leaves.
   out     receives the mesh, or NULL on any error; release it with treepieces_mesh_free
   return  TXM_OK; TXM_BAD_ARGUMENT, also for bones that are not finite; TXM_TOO_LARGE;
           TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost    O(vertices); nothing stays allocated but the mesh                                      */
TREEPIECES_API txm_status treepieces_bake(const treepieces_bake_desc *desc, txm_env *env,
                                          treepieces_mesh **out);

/* Release a mesh; NULL is allowed. */
TREEPIECES_API void treepieces_mesh_free(treepieces_mesh *mesh);

/* ---- bark -------------------------------------------------------------------------------- */

enum { TREEPIECES_SHEET = 8 }; /* tiles across and down a layer of the sheet */

/* Bark sheets made of framed tiles [1, 5]. All tiles of class 0 have the same frame, so that any
   rectangle of adjoining tiles fits beside any other. Layer 0 is 8 x 8 of them and repeats
   seamlessly both ways; a quad shows a rectangle of 1 to 16 tiles across (16 go round the sheet
   twice) and 1 to 8 along, so that texels have about the same size on the trunk and on twigs. The
   lowest rows of layers FOLD to HALVING are blended so that they match the sides that
   treepieces_class says; the south side of a quad of these classes lies at the bottom of its layer.
   Each layer from OWN holds one class: 4 x 4 tiles, each in the middle of 2 x 2 cells and extended
   around by its own border; a quad shows one of them. */
typedef struct treepieces_bark_desc {
    const txm_image *tiles; /* square, all of one size, sample type and number of channels        */
    const int *classes;     /* of each tile: 0, or from TREEPIECES_OWN; NULL = all 0              */
    int tile_count;         /* at least one of class 0                                            */
    uint64_t seed;
} treepieces_bark_desc;

/* Number of layers: TREEPIECES_OWN and one for each class above, up to the highest in use. */
TREEPIECES_API int treepieces_bark_layers(const treepieces_bark_desc *desc);

/* Draw the sheet. out is 8 tiles wide and 8 tiles per layer high, the layers one below the other,
   with the channels and sample type of the tiles. The last of 2 or 4 channels is alpha: colours are
   blended as far as they show, and hidden ones are bled from visible neighbours. */
TREEPIECES_API txm_status treepieces_bark(const treepieces_bark_desc *desc, txm_env *env,
                                          txm_image out);

/* Texture coordinates of corner 0..3 of a quad in its layer, 0..1, v downwards; returns the layer.
   bands: word 3 of its record; cell: its byte in word 4 or later; pixels: width of the sheet, as v
   stays half a pixel inside the tiles. */
TREEPIECES_API int treepieces_quad_uv(const treepieces_quad *quad, uint32_t bands, int cell,
                                      int pixels, int corner, float uv[2]);

/* Draw bark procedurally: tile_count tiles that share a frame, square, of 3 or 4 channels. */
TREEPIECES_API txm_status treepieces_draw_bark(const treepieces_species *species, uint64_t seed,
                                               txm_env *env, const txm_image *tiles,
                                               int tile_count);

/* ---- foliage ----------------------------------------------------------------------------- */

/* A leaf card of a cloud with radius 1 about the origin. */
typedef struct treepieces_card {
    float center[3];
    float right[3], up[3]; /* half the width and height of the card                               */
    float normal[3];       /* for shading: mostly away from the centre of the cloud               */
} treepieces_card;

/* Leaf cloud number `look` of a species: species->leaf_count cards. Returns that count; cards may
   be NULL. */
TREEPIECES_API int treepieces_cloud(const treepieces_species *species, uint32_t look,
                                    treepieces_card *cards);

/* Draw a spray of leaves procedurally, as the RGBA image of the cards. out: any size, 4 channels of
   8 bits, untouched after an error; where it is transparent it has the colour of the leaves near
   by, so that filters show no fringe. */
TREEPIECES_API txm_status treepieces_draw_leaves(const treepieces_species *species, uint64_t seed,
                                                 txm_env *env, txm_image out);

/* 2.5D impostor [3; 1, 6]: colour and depth of a leaf cloud in an orthographic view.

   cards      card_count of them
   leaves     their image, RGBA, 8 bits; texels with alpha below 1/2 are transparent
   right, up, forward  axes of the view: orthogonal unit vectors; forward points away from the eye
   color      RGBA, 8 bits: sRGB, shaded by `light` (unit vector towards the light); alpha 0 or 255.
              Covers -1..1 along right and up. Where alpha is 0 the colour is that of cards near by,
              for filters
   depth      float, 1 channel, size of color: distance from the centre of the cloud towards the eye, in
              radii of the cloud; -2 where there is nothing                                      */
typedef struct treepieces_impostor_desc {
    const treepieces_card *cards;
    int card_count;
    txm_image leaves;
    float right[3], up[3], forward[3];
    float light[3];
} treepieces_impostor_desc;
TREEPIECES_API txm_status treepieces_impostor(const treepieces_impostor_desc *desc, txm_env *env,
                                              txm_image color, txm_image depth);

/* The leaf cards of a tree as a mesh, for renderers without impostors: two triangles per card,
   bound to the bone of its cluster. joints and weights as in treepieces_bake. looks: how many
   different clouds are used, 1..64; a cluster takes cloud number look mod looks, turned about y by
   2 pi (look >> 8 & 255) / 256. Normals point out of the crown, more or less. */
TREEPIECES_API txm_status treepieces_bake_leaves(const treepieces_forest *forest, int tree,
                                                 const float *bones, int looks, txm_env *env,
                                                 treepieces_mesh **out);

#ifdef __cplusplus
}
#endif
#endif /* TREEPIECES_H */

#if defined(TREEPIECES_IMPLEMENTATION) && !defined(TREEPIECES_IMPLEMENTED)
#define TREEPIECES_IMPLEMENTED

/* Where float expressions are evaluated in double (gcc -std=c99 for s390x), trees would get other
   bytes: round after every operation. */
#include <float.h>
#if FLT_EVAL_METHOD == 1 && defined(__GNUC__) && !defined(__clang__)
#pragma GCC push_options
#pragma GCC optimize("excess-precision=fast")
#define TPC_POP_OPTIONS
#endif

#include "treepieces/rim.h"
#include "treepieces/builtin.h"
#include "treepieces/kit.h"
#include "treepieces/species.h"
#include "treepieces/presets.h"
#include "treepieces/text.h"
#include "treepieces/space.h"
#include "treepieces/sketch.h"
#include "treepieces/grow.h"
#include "treepieces/branch.h"
#include "treepieces/axes.h"
#include "treepieces/assemble.h"
#include "treepieces/modes.h"
#include "treepieces/forest.h"
#include "treepieces/wind.h"
#include "treepieces/bones.h"
#include "treepieces/tessellation.h"
#include "treepieces/picture.h"
#include "treepieces/bark.h"
#include "treepieces/cloud.h"
#include "treepieces/spray.h"
#include "treepieces/impostor.h"
#include "treepieces/bake.h"

#ifdef TPC_POP_OPTIONS
#pragma GCC pop_options
#undef TPC_POP_OPTIONS
#endif
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
