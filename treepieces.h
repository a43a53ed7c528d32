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

/* ---- vectors and rotations --------------------------------------------------------------- */

/* Everything that shapes a tree is computed by sums, products, quotients and square roots, so that
   it is the same everywhere. In float, not rounded from double as vectors of texmath.h are: a
   forest takes millions of these operations. */

/* q v q* for a unit quaternion q = x y z w; out may be v */
static void tpc_rotate(const float q[4], const float v[3], float out[3]) {
    const float tx = 2 * (q[1] * v[2] - q[2] * v[1]), ty = 2 * (q[2] * v[0] - q[0] * v[2]);
    const float tz = 2 * (q[0] * v[1] - q[1] * v[0]);
    const float x = v[0] + q[3] * tx + (q[1] * tz - q[2] * ty);
    const float y = v[1] + q[3] * ty + (q[2] * tx - q[0] * tz);
    const float z = v[2] + q[3] * tz + (q[0] * ty - q[1] * tx);
    out[0] = x;
    out[1] = y;
    out[2] = z;
}

/* out = a b: b first, then a; out may be one of them. Leave the order of the terms, and every term
   added, some with the sign inverted: from neighbouring a - b c and a + b c gcc 12 makes one
   instruction that rounds only once, even with contraction off. */
static void tpc_multiply(const float a[4], const float b[4], float out[4]) {
    const float back[3] = {-a[0], -a[1], -a[2]};
    const float x = a[3] * b[0] + a[0] * b[3] + a[1] * b[2] + back[2] * b[1];
    const float y = a[3] * b[1] + back[0] * b[2] + a[1] * b[3] + a[2] * b[0];
    const float z = a[3] * b[2] + a[0] * b[1] + back[1] * b[0] + a[2] * b[3];
    const float w = a[3] * b[3] + back[0] * b[0] + back[1] * b[1] + back[2] * b[2];
    out[0] = x;
    out[1] = y;
    out[2] = z;
    out[3] = w;
}

static float tpc_dot(const float a[3], const float b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void tpc_cross(const float a[3], const float b[3], float out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* Scale v to unit length. It must not be the zero vector. */
static void tpc_unit(float v[3]) {
    const float length = sqrtf(tpc_dot(v, v));
    for (int k = 0; k < 3; k++) v[k] /= length;
}

/* The same, a little faster; the zero vector becomes +y. */
static void tpc_unit_or_up(float v[3]) {
    const float square = tpc_dot(v, v), scale = 1 / sqrtf(square);
    if (square > 0)
        for (int k = 0; k < 3; k++) v[k] *= scale;
    else v[1] = 1;
}

/* The same; a vector shorter than 1e-6 becomes (x, y, z). */
static void tpc_unit_or(float v[3], float x, float y, float z) {
    const float length = sqrtf(tpc_dot(v, v)), other[3] = {x, y, z};
    for (int k = 0; k < 3; k++) v[k] = length > 1e-6f ? v[k] / length : other[k];
}

/* ---- the canonical rim ------------------------------------------------------------------- */

/* cos and sin of 60 k degrees */
static const float tpc_cos6[TREEPIECES_RIM] = {1.0f, 0.5f, -0.5f, -1.0f, -0.5f, 0.5f};
static const float tpc_sin6[TREEPIECES_RIM] = {0.0f,  0.86602540378f,  0.86602540378f,
                                               0.0f, -0.86602540378f, -0.86602540378f};

static const float tpc_cone_out = 0.99503719021f; /* normals at a rim: 10 / sqrt(101) outwards, */
static const float tpc_cone_up = 0.09950371902f;  /* 1 / sqrt(101) upwards                      */

static void tpc_rim_vertex(int place, float position[3], float normal[3]) {
    position[0] = tpc_cos6[place];
    position[1] = 0;
    position[2] = -tpc_sin6[place];
    normal[0] = tpc_cone_out * tpc_cos6[place];
    normal[1] = tpc_cone_up;
    normal[2] = -tpc_cone_out * tpc_sin6[place];
}

/* v rotated about y by 60 k degrees, which moves vertex j of a rim to vertex j + k */
static void tpc_turn(int k, const float v[3], float out[3]) {
    const float c = tpc_cos6[k], s = tpc_sin6[k], x = v[0], z = v[2];
    out[0] = c * x + s * z;
    out[1] = v[1];
    out[2] = c * z - s * x;
}

static void tpc_building_point(const treepieces_similarity *b, const float p[3], float out[3]) {
    tpc_rotate(b->rotation, p, out);
    for (int i = 0; i < 3; i++) out[i] = b->translation[i] + b->scale * out[i];
}

/* Vertex `place` of a leaf rim in model space of the piece. */
static void tpc_leaf_vertex(const treepieces_similarity *b, int place, float position[3],
                            float normal[3]) {
    tpc_rim_vertex(place, position, normal);
    tpc_building_point(b, position, position);
    tpc_rotate(b->rotation, normal, normal);
}

/* The vertex numbers of leaf rim k; of the root rim for k = -1. */
static const int *tpc_rim_of(const treepieces_piece *p, int k) {
    return k < 0 ? p->root_rim : p->leaf_rims[k];
}

/* ---- the built-in pieces ----------------------------------------------------------------- */

/* A piece under construction. */
typedef struct tpc_shape {
    treepieces_piece piece;
    treepieces_vertex vertices[64];
    treepieces_quad quads[64];
} tpc_shape;

/* A vertex with weight `own` for the piece's own bone; the rest is shared evenly by the leaf rims
   of the bit mask `leaves`. */
static int tpc_add_vertex(tpc_shape *s, float x, float y, float z, float own, int leaves) {
    TXM_ASSERT(s->piece.vertex_count < (int)(sizeof s->vertices / sizeof *s->vertices));
    treepieces_vertex *v = &s->vertices[s->piece.vertex_count];
    const int count = (leaves & 1) + (leaves >> 1 & 1) + (leaves >> 2 & 1);
    memset(v, 0, sizeof *v);
    v->position[0] = x;
    v->position[1] = y;
    v->position[2] = z;
    v->weights[0] = count ? own : 1;
    for (int k = 0; k < TREEPIECES_MAX_LEAVES; k++)
        if (leaves >> k & 1) v->weights[1 + k] = (1 - own) / (float)count;
    return s->piece.vertex_count++;
}

/* Six vertices about the axis; radius `even` for vertices 0, 2, 4, `odd` for the others. */
static void tpc_add_ring(tpc_shape *s, float y, float even, float odd, float own, int leaves,
                         int ring[TREEPIECES_RIM]) {
    for (int k = 0; k < TREEPIECES_RIM; k++) {
        const float r = k & 1 ? odd : even;
        ring[k] = tpc_add_vertex(s, r * tpc_cos6[k], y, -r * tpc_sin6[k], own, leaves);
    }
}

static void tpc_begin(tpc_shape *s, const char *name) {
    memset(s, 0, sizeof *s);
    s->piece.name = name;
    tpc_add_ring(s, 0, 1, 1, 1, 0, s->piece.root_rim);
}

/* Add the vertices of the next leaf rim, whose building transform is set already; return them. */
static const int *tpc_add_rim(tpc_shape *s) {
    treepieces_piece *p = &s->piece;
    const int k = p->leaf_count++;
    for (int j = 0; j < TREEPIECES_RIM; j++) {
        float at[3], normal[3];
        tpc_leaf_vertex(&p->building[k], j, at, normal);
        p->leaf_rims[k][j] = tpc_add_vertex(s, at[0], at[1], at[2], 0, 1 << k);
    }
    return p->leaf_rims[k];
}

/* A leaf rim at (x, y, z), its axis inclined by `lean` degrees towards azimuth `turn` (degrees
   about y from +x to -z), its vertex 0 at that azimuth. */
static const int *tpc_add_leaf_rim(tpc_shape *s, float x, float y, float z, double turn, double lean,
                               float scale) {
    treepieces_similarity *b = &s->piece.building[s->piece.leaf_count];
    const double degree = TXM_PI / 180;
    double st, ct, sl, cl;
    txm_sincos(turn * degree / 2, &st, &ct);
    txm_sincos(lean * degree / 2, &sl, &cl);
    b->translation[0] = x;
    b->translation[1] = y;
    b->translation[2] = z;
    b->rotation[0] = txm_float(-st * sl); /* -lean about z, then turn about y */
    b->rotation[1] = txm_float(st * cl);
    b->rotation[2] = txm_float(-ct * sl);
    b->rotation[3] = txm_float(ct * cl);
    b->scale = scale;
    return tpc_add_rim(s);
}

static void tpc_add_quad(tpc_shape *s, int nw, int sw, int se, int ne, treepieces_class c,
                         int band) {
    TXM_ASSERT(s->piece.quad_count < (int)(sizeof s->quads / sizeof *s->quads));
    treepieces_quad *q = &s->quads[s->piece.quad_count++];
    q->corners[0] = (uint8_t)nw;
    q->corners[1] = (uint8_t)sw;
    q->corners[2] = (uint8_t)se;
    q->corners[3] = (uint8_t)ne;
    q->tile_class = (uint8_t)c;
    q->band = (uint8_t)band;
}

/* `count` quads between two loops of six vertices, from vertex `first` on. */
static void tpc_add_row(tpc_shape *s, const int *below, const int *above, int first, int count,
                        treepieces_class c, int band) {
    for (int i = first; i < first + count; i++) {
        const int k = i % TREEPIECES_RIM, n = (i + 1) % TREEPIECES_RIM;
        tpc_add_quad(s, above[k], below[k], below[n], above[n], c, band);
    }
}

static void tpc_make_i(tpc_shape *s) {
    int middle[TREEPIECES_RIM];
    tpc_begin(s, "I");
    tpc_add_ring(s, 0.5f, 0.95f, 0.95f, 0.5f, 1, middle);
    const int *top = tpc_add_leaf_rim(s, 0, 1, 0, 0, 0, 0.9f);
    tpc_add_row(s, s->piece.root_rim, middle, 0, 6, TREEPIECES_BARK, 0);
    tpc_add_row(s, middle, top, 0, 6, TREEPIECES_BARK, 1);
}

/* The crotch runs from vertex 0 over m1 and m2 to vertex 3; arm 0 leans to -z, arm 1 to +z:

        2 - 1          the loop of an arm is half of the ring, and the crotch
       /     \
      3-m2-m1-0  --> x                                                                       */
static void tpc_make_y(tpc_shape *s) {
    int a[TREEPIECES_RIM];
    tpc_begin(s, "Y");
    for (int k = 0; k < TREEPIECES_RIM; k++) {
        const int side = k % 3 == 0; /* an end of the crotch */
        const int leaves = side ? 3 : k < 3 ? 1 : 2;
        a[k] = tpc_add_vertex(s, (side ? 0.97f : 0.98f) * tpc_cos6[k], side ? 0.66f : 0.5f,
                              -1.08f * tpc_sin6[k], 0.6f, leaves);
    }
    const int m1 = tpc_add_vertex(s, 0.4f, 0.94f, 0, 0.5f, 3);
    const int m2 = tpc_add_vertex(s, -0.4f, 0.94f, 0, 0.5f, 3);
    /* inclined about x, which keeps vertex 0 at +x */
    for (int arm = 0; arm < 2; arm++) {
        const float to = arm ? 1.0f : -1.0f;
        double sine, cosine;
        treepieces_similarity *b = &s->piece.building[arm];
        txm_sincos(13 * TXM_PI / 180, &sine, &cosine);
        b->translation[1] = 1.3f;
        b->translation[2] = 0.7f * to;
        b->rotation[0] = txm_float(to * sine);
        b->rotation[3] = txm_float(cosine);
        b->scale = 0.75f;
        tpc_add_rim(s);
    }
    const int loop0[TREEPIECES_RIM] = {a[0], a[1], a[2], a[3], m2, m1};
    const int loop1[TREEPIECES_RIM] = {a[0], m1, m2, a[3], a[4], a[5]};
    tpc_add_row(s, s->piece.root_rim, a, 0, 6, TREEPIECES_BARK, 0);
    tpc_add_row(s, loop0, s->piece.leaf_rims[0], 0, 3, TREEPIECES_BARK, 1);
    tpc_add_row(s, loop0, s->piece.leaf_rims[0], 3, 3, TREEPIECES_FOLD, 1);
    tpc_add_row(s, loop1, s->piece.leaf_rims[1], 3, 3, TREEPIECES_BARK, 2);
    tpc_add_row(s, loop1, s->piece.leaf_rims[1], 0, 3, TREEPIECES_FOLD, 2);
}

/* A tube of three rows of quads; each branch replaces two quads of the middle row, left and right
   of vertex v = 0 (and 3). The loop around the hole, seen from the branch: bottom, bottom right,
   top right, top, top left, bottom left. */
static void tpc_make_branched(tpc_shape *s, const char *name, int branches) {
    int b[TREEPIECES_RIM], c[TREEPIECES_RIM];
    tpc_begin(s, name);
    tpc_add_ring(s, 0.28f, 0.99f, 0.99f, 0.8f, 1, b);
    tpc_add_ring(s, 0.74f, 0.96f, 0.96f, 0.4f, 1, c);
    const int *top = tpc_add_leaf_rim(s, 0, 1, 0, 0, 0, 0.93f);
    tpc_add_row(s, s->piece.root_rim, b, 0, 6, TREEPIECES_BARK, 0);
    for (int k = 0; k < TREEPIECES_RIM; k++) {
        const int at_first = k == 5 || k == 0, at_second = branches > 1 && (k == 2 || k == 3);
        const int open = at_first || at_second;
        if (!open) tpc_add_row(s, b, c, k, 1, TREEPIECES_BARK, 1);
        tpc_add_row(s, c, top, k, 1, open ? TREEPIECES_FOLD : TREEPIECES_BARK, 1);
    }
    for (int i = 0; i < branches; i++) {
        const int v = 3 * i, left = (v + 5) % 6, right = v + 1;
        const float side = i ? -1.0f : 1.0f;
        const int loop[TREEPIECES_RIM] = {b[v], b[right], c[right], c[v], c[left], b[left]};
        const int *rim = tpc_add_leaf_rim(s, 1.4f * side, 0.55f, 0, 180 * i, 60, 0.45f);
        tpc_add_row(s, loop, rim, 0, 1, TREEPIECES_BARK, 2 + i);
        tpc_add_row(s, loop, rim, 1, 1, TREEPIECES_TURN_RIGHT, 2 + i);
        tpc_add_row(s, loop, rim, 2, 2, TREEPIECES_FOLD, 2 + i);
        tpc_add_row(s, loop, rim, 4, 1, TREEPIECES_TURN_LEFT, 2 + i);
        tpc_add_row(s, loop, rim, 5, 1, TREEPIECES_BARK, 2 + i);
    }
}

/* Three crotches meet in the middle; arm k leans towards vertex 1 + 2 k. */
static void tpc_make_spatial(tpc_shape *s) {
    int a[TREEPIECES_RIM], p[TREEPIECES_RIM];
    tpc_begin(s, "spatial trifurcation");
    for (int k = 0; k < TREEPIECES_RIM; k++) {
        const int arm = k / 2, before = (arm + 2) % 3; /* even ones lie between two arms */
        const int leaves = k & 1 ? 1 << arm : 1 << arm | 1 << before;
        const float r = k & 1 ? 1.06f : 0.97f;
        a[k] = tpc_add_vertex(s, r * tpc_cos6[k], k & 1 ? 0.5f : 0.64f, -r * tpc_sin6[k], 0.6f,
                              leaves);
        p[k] = 0;
        if (!(k & 1))
            p[k] = tpc_add_vertex(s, 0.5f * tpc_cos6[k], 0.88f, -0.5f * tpc_sin6[k], 0.5f, leaves);
    }
    const int middle = tpc_add_vertex(s, 0, 1, 0, 0.4f, 7);
    tpc_add_row(s, s->piece.root_rim, a, 0, 6, TREEPIECES_BARK, 0);
    for (int arm = 0; arm < 3; arm++) {
        const int to = 1 + 2 * arm, next = (to + 1) % 6, before = to - 1;
        const int loop[TREEPIECES_RIM] = {a[to], a[next], p[next], middle, p[before], a[before]};
        const int *rim = tpc_add_leaf_rim(s, 0.78f * tpc_cos6[to], 1.3f, -0.78f * tpc_sin6[to],
                                      60 * to, 32, 0.62f);
        tpc_add_row(s, loop, rim, 5, 2, TREEPIECES_BARK, 1 + arm);
        tpc_add_row(s, loop, rim, 1, 4, TREEPIECES_FOLD, 1 + arm);
    }
}

static void tpc_make_tip(tpc_shape *s) {
    int ring[TREEPIECES_RIM];
    tpc_begin(s, "tip");
    tpc_add_ring(s, 0.92f, 0.5f, 0.5f, 1, 0, ring);
    const int end = tpc_add_vertex(s, 0, 1, 0, 1, 0);
    tpc_add_row(s, s->piece.root_rim, ring, 0, 6, TREEPIECES_BARK, 0);
    for (int k = 0; k < TREEPIECES_RIM; k += 2)
        tpc_add_quad(s, end, ring[k], ring[k + 1], ring[(k + 2) % 6], TREEPIECES_BARK, 1);
}

static void tpc_make_flare(tpc_shape *s) {
    int low[TREEPIECES_RIM], high[TREEPIECES_RIM];
    tpc_begin(s, "root flare");
    tpc_add_ring(s, 0.2f, 0.92f, 0.7f, 1, 0, low);
    tpc_add_ring(s, 0.55f, 0.74f, 0.64f, 0.6f, 1, high);
    const int *top = tpc_add_leaf_rim(s, 0, 1, 0, 0, 0, 0.62f);
    tpc_add_row(s, s->piece.root_rim, low, 0, 6, TREEPIECES_BARK, 0);
    tpc_add_row(s, low, high, 0, 6, TREEPIECES_BARK, 0);
    tpc_add_row(s, high, top, 0, 6, TREEPIECES_BARK, 1);
}

/* Normals of all vertices: the mean of the adjacent quads, weighted by area. Those of rims are
   replaced when the piece is added to the kit. */
static void tpc_smooth(tpc_shape *s) {
    float sums[64][3];
    memset(sums, 0, sizeof sums);
    for (int i = 0; i < s->piece.quad_count; i++) {
        const uint8_t *c = s->quads[i].corners;
        const float *p[4];
        float d[2][3], normal[3];
        for (int k = 0; k < 4; k++) p[k] = s->vertices[c[k]].position;
        for (int k = 0; k < 3; k++) {
            d[0][k] = p[2][k] - p[0][k];
            d[1][k] = p[3][k] - p[1][k];
        }
        tpc_cross(d[0], d[1], normal);
        for (int k = 0; k < 4; k++)
            for (int a = 0; a < 3; a++) sums[c[k]][a] += normal[a];
    }
    for (int i = 0; i < s->piece.vertex_count; i++) {
        tpc_unit(sums[i]);
        memcpy(s->vertices[i].normal, sums[i], sizeof sums[i]);
    }
    s->piece.vertices = s->vertices;
    s->piece.quads = s->quads;
}

static void tpc_make_builtin(int type, tpc_shape *s) {
    switch (type) {
    case TREEPIECES_I: tpc_make_i(s); break;
    case TREEPIECES_Y: tpc_make_y(s); break;
    case TREEPIECES_SIDE: tpc_make_branched(s, "side branch", 1); break;
    case TREEPIECES_PLANAR: tpc_make_branched(s, "planar trifurcation", 2); break;
    case TREEPIECES_SPATIAL: tpc_make_spatial(s); break;
    case TREEPIECES_TIP: tpc_make_tip(s); break;
    default: tpc_make_flare(s); break;
    }
    tpc_smooth(s);
}

/* ---- the kit ----------------------------------------------------------------------------- */

/* A vertex of a piece in the frame of one of its leaf rims. */
typedef struct tpc_local_vertex {
    float position[3], normal[3];
} tpc_local_vertex;

/* Average height of the quads of a band: along y in lengths, outwards in radii. */
typedef struct tpc_band {
    float rise, spread;
} tpc_band;

/* Four quads whose tiles share one word of a record, one byte each. The byte is 255 in bands[b] if
   the quad belongs to band b, in bottom if it lies at the bottom of its layer, in own if its class
   is one of the caller's. first, last: range of the bands that occur. */
typedef struct tpc_cells {
    uint32_t bands[TREEPIECES_BANDS], bottom, own;
    int first, last;
} tpc_cells;

struct treepieces_kit {
    txm_arena arena; /* holds the kit itself and all it points to */
    int count;
    treepieces_piece pieces[TREEPIECES_MAX_TYPES];
    tpc_local_vertex *local[TREEPIECES_MAX_TYPES]; /* vertex_count for each leaf rim */
    tpc_band bands[TREEPIECES_MAX_TYPES][TREEPIECES_BANDS];
    int band_counts[TREEPIECES_MAX_TYPES]; /* 1 + the highest in use */
    float offsets[TREEPIECES_MAX_TYPES][TREEPIECES_MAX_LEAVES]; /* of leaf rims from the axis */
    tpc_cells *cells[TREEPIECES_MAX_TYPES]; /* (quad_count + 3) / 4 each */
};

/* ---- checking a piece -------------------------------------------------------------------- */

/* Fail because of a piece; number < 0: the fault is not that of one vertex or quad. */
static txm_status tpc_refuse(txm_env *env, const treepieces_piece *p, int index, const char *what,
                             int number, const char *fault) {
    char line[160];
    if (number < 0)
        snprintf(line, sizeof line, "piece %d (%.40s): %s", index, p->name ? p->name : "", fault);
    else
        snprintf(line, sizeof line, "piece %d (%.40s), %s %d: %s", index, p->name ? p->name : "",
                 what, number, fault);
    return txm_fail(env, TXM_BAD_ARGUMENT, line);
}

static int tpc_is_near(const float *a, const float *b, int n, float tolerance) {
    for (int i = 0; i < n; i++)
        if (!(fabsf(a[i] - b[i]) <= tolerance)) return 0;
    return 1;
}

/* Counts and indices, so that the other checks can index. */
static txm_status tpc_check_numbers(const treepieces_piece *p, int index, txm_env *env) {
    if (!p->vertices || p->vertex_count < 7 || p->vertex_count > TREEPIECES_MAX_VERTICES)
        return tpc_refuse(env, p, index, "", -1, "needs 7 to 255 vertices");
    if (!p->quads || p->quad_count < 6 || p->quad_count > TREEPIECES_MAX_QUADS)
        return tpc_refuse(env, p, index, "", -1, "needs 6 to 255 quads");
    if (p->leaf_count < 0 || p->leaf_count > TREEPIECES_MAX_LEAVES)
        return tpc_refuse(env, p, index, "", -1, "leaf_count must be 0 to 3");
    for (int i = 0; i < p->quad_count; i++) {
        const treepieces_quad *q = &p->quads[i];
        for (int k = 0; k < 4; k++) {
            if (q->corners[k] >= p->vertex_count)
                return tpc_refuse(env, p, index, "quad", i, "a corner is not a vertex");
            for (int j = 0; j < k; j++)
                if (q->corners[j] == q->corners[k])
                    return tpc_refuse(env, p, index, "quad", i, "two corners are one vertex");
        }
        if (q->band >= TREEPIECES_BANDS)
            return tpc_refuse(env, p, index, "quad", i, "band must be 0 to 3");
        if (q->tile_class == TREEPIECES_HALVING || q->tile_class >= 64)
            return tpc_refuse(env, p, index, "quad", i, "tile_class must be 0 to 3 or 5 to 63");
    }
    for (int k = -1; k < p->leaf_count; k++) {
        const int *rim = tpc_rim_of(p, k);
        for (int j = 0; j < TREEPIECES_RIM; j++)
            if (rim[j] < 0 || rim[j] >= p->vertex_count)
                return tpc_refuse(env, p, index, "place", j, "of a rim is not a vertex");
    }
    return TXM_OK;
}

/* Finite, unit normals, weights. */
static txm_status tpc_check_vertices(const treepieces_piece *p, int index, txm_env *env) {
    for (int i = 0; i < p->vertex_count; i++) {
        const treepieces_vertex *v = &p->vertices[i];
        float sum = 0;
        for (int k = 0; k < 3; k++)
            if (!txm_is_finite((double)v->position[k]) || !txm_is_finite((double)v->normal[k]))
                return tpc_refuse(env, p, index, "vertex", i, "is not finite");
        if (!(fabsf(tpc_dot(v->normal, v->normal) - 1) <= 1e-3f))
            return tpc_refuse(env, p, index, "vertex", i, "the normal's length is not 1");
        for (int k = 0; k < 4; k++) {
            if (!(v->weights[k] >= 0) || (k > p->leaf_count && v->weights[k] != 0))
                return tpc_refuse(env, p, index, "vertex", i,
                                  "a weight is negative, or of a joint that does not exist");
            sum += v->weights[k];
        }
        if (!(fabsf(sum - 1) <= 1e-4f))
            return tpc_refuse(env, p, index, "vertex", i, "the sum of the weights is not 1");
    }
    return TXM_OK;
}

/* Rim k (-1: the root rim) is the canonical hexagon, bound to its joint alone. */
static txm_status tpc_check_rim(const treepieces_piece *p, int index, int k, txm_env *env) {
    const treepieces_similarity root = {{0, 0, 0}, {0, 0, 0, 1}, 1};
    const treepieces_similarity *b = k < 0 ? &root : &p->building[k];
    const int *rim = tpc_rim_of(p, k);
    float length = 0;
    for (int i = 0; i < 4; i++) length += b->rotation[i] * b->rotation[i];
    if (!(fabsf(length - 1) <= 1e-4f))
        return tpc_refuse(env, p, index, "leaf rim", k,
                          "the building rotation is not a unit quaternion");
    if (!(b->scale > 0) || !txm_is_finite((double)b->scale))
        return tpc_refuse(env, p, index, "leaf rim", k, "the building scale is not above 0");
    for (int j = 0; j < TREEPIECES_RIM; j++) {
        const treepieces_vertex *v = &p->vertices[rim[j]];
        float position[3], normal[3];
        tpc_leaf_vertex(b, j, position, normal);
        if (!tpc_is_near(v->position, position, 3, 1e-4f * b->scale))
            return tpc_refuse(env, p, index, "vertex", rim[j],
                              k < 0 ? "is not at its place on the root rim"
                                    : "is not at its place on a leaf rim, which the building "
                                      "transform gives");
        if (!tpc_is_near(v->normal, normal, 3, 1e-3f))
            return tpc_refuse(env, p, index, "vertex", rim[j],
                              "the normal is not that of the rim's cone");
        if (!(v->weights[1 + k] >= 1 - 1e-4f))
            return tpc_refuse(env, p, index, "vertex", rim[j],
                              k < 0 ? "on the root rim, is not bound to the own bone alone"
                                    : "on a leaf rim, is not bound to its terminal joint alone");
        for (int i = -1; i < k; i++) {
            const int *other = tpc_rim_of(p, i);
            for (int m = 0; m < TREEPIECES_RIM; m++)
                if (other[m] == rim[j])
                    return tpc_refuse(env, p, index, "vertex", rim[j], "is on two rims");
        }
    }
    return TXM_OK;
}

/* side[a * n + b]: number of quads with the side from a to b */
static int tpc_has_side(const uint8_t *side, int n, int a, int b) {
    return side[(size_t)a * (size_t)n + (size_t)b];
}

/* The quads about each vertex form one fan: walking over shared sides reaches all of them. */
static txm_status tpc_check_fans(const treepieces_piece *p, int index, txm_env *env) {
    for (int v = 0; v < p->vertex_count; v++) {
        int from[TREEPIECES_MAX_QUADS], to[TREEPIECES_MAX_QUADS], count = 0, met = 1;
        for (int i = 0; i < p->quad_count; i++) {
            const uint8_t *c = p->quads[i].corners;
            for (int k = 0; k < 4; k++) {
                if (c[k] != v) continue;
                TXM_ASSERT(count < TREEPIECES_MAX_QUADS);
                from[count] = c[(k + 1) % 4];
                to[count++] = c[(k + 3) % 4];
            }
        }
        if (!count) return tpc_refuse(env, p, index, "vertex", v, "is unused");
        int first = from[0], last = to[0];
        for (int grown = 1; grown;) {
            grown = 0;
            for (int i = 1; i < count; i++) {
                if (from[i] < 0 || (from[i] != last && to[i] != first)) continue;
                if (from[i] == last) last = to[i];
                else first = from[i];
                from[i] = -1;
                met++;
                grown = 1;
            }
        }
        if (met < count)
            return tpc_refuse(env, p, index, "vertex", v, "the surface touches itself there");
    }
    return TXM_OK;
}

/* The representative of the connected vertices to which this one belongs (union-find). */
static int tpc_find_root(const int *root, int vertex) {
    while (root[vertex] != vertex) vertex = root[vertex];
    return vertex;
}

/* Oriented, manifold, connected, and the rims are its only borders. */
static txm_status tpc_check_surface(const treepieces_piece *p, int index, uint8_t *side,
                                    txm_env *env) {
    const int n = p->vertex_count;
    int root[TREEPIECES_MAX_VERTICES], borders = 0;
    memset(side, 0, (size_t)n * (size_t)n);
    for (int i = 0; i < n; i++) root[i] = i;
    for (int i = 0; i < p->quad_count; i++) {
        for (int k = 0; k < 4; k++) {
            const int a = p->quads[i].corners[k], b = p->quads[i].corners[(k + 1) % 4];
            if (side[(size_t)a * (size_t)n + (size_t)b]++)
                return tpc_refuse(env, p, index, "vertex", a,
                                  "a side from it belongs to two quads of opposite orientation");
            root[tpc_find_root(root, a)] = tpc_find_root(root, b);
        }
    }
    for (int k = -1; k < p->leaf_count; k++) {
        const int *rim = tpc_rim_of(p, k);
        for (int j = 0; j < TREEPIECES_RIM; j++) {
            const int a = rim[j], b = rim[(j + 1) % TREEPIECES_RIM];
            const int ahead = tpc_has_side(side, n, a, b), back = tpc_has_side(side, n, b, a);
            if (ahead != (k < 0) || back != (k >= 0))
                return tpc_refuse(env, p, index, "vertex", a,
                                  "the edge of the rim from it is no border, or runs the wrong way");
        }
    }
    for (int a = 0; a < n; a++) {
        for (int b = 0; b < n; b++) {
            if (!tpc_has_side(side, n, a, b) || tpc_has_side(side, n, b, a)) continue;
            if (++borders > TREEPIECES_RIM * (1 + p->leaf_count))
                return tpc_refuse(env, p, index, "", -1, "has a border that is not a rim");
        }
    }
    const txm_status status = tpc_check_fans(p, index, env);
    if (status != TXM_OK) return status;
    for (int i = 1; i < n; i++)
        if (tpc_find_root(root, i) != tpc_find_root(root, 0))
            return tpc_refuse(env, p, index, "vertex", i, "is not connected to vertex 0");
    return TXM_OK;
}

static txm_status tpc_check_piece(const treepieces_piece *p, int index, uint8_t *side,
                                  txm_env *env) {
    txm_status status = tpc_check_numbers(p, index, env);
    if (status == TXM_OK) status = tpc_check_vertices(p, index, env);
    for (int k = -1; status == TXM_OK && k < p->leaf_count; k++)
        status = tpc_check_rim(p, index, k, env);
    if (status == TXM_OK) status = tpc_check_surface(p, index, side, env);
    return status;
}

static void tpc_measure_bands(const treepieces_piece *p, tpc_band bands[TREEPIECES_BANDS]) {
    int counts[TREEPIECES_BANDS] = {0, 0, 0, 0};
    for (int i = 0; i < p->quad_count; i++) {
        const treepieces_quad *q = &p->quads[i];
        float side[3] = {0, 0, 0};
        for (int k = 0; k < 3; k++)
            for (int c = 0; c < 2; c++) /* west, then east */
                side[k] += 0.5f * (p->vertices[q->corners[3 * c]].position[k] -
                                   p->vertices[q->corners[1 + c]].position[k]);
        bands[q->band].rise += fabsf(side[1]);
        bands[q->band].spread += sqrtf(side[0] * side[0] + side[2] * side[2]);
        counts[q->band]++;
    }
    for (int b = 0; b < TREEPIECES_BANDS; b++) {
        if (!counts[b]) continue;
        bands[b].rise /= (float)counts[b];
        bands[b].spread /= (float)counts[b];
    }
}

static void tpc_sort_cells(const treepieces_piece *p, tpc_cells *cells) {
    for (int i = 0; i < p->quad_count; i++) {
        const treepieces_quad *q = &p->quads[i];
        tpc_cells *c = &cells[i / 4];
        const uint32_t byte = 255u << (8 * (i & 3));
        if ((i & 3) == 0) c->first = c->last = q->band;
        if (q->band < c->first) c->first = q->band;
        if (q->band > c->last) c->last = q->band;
        c->bands[q->band] |= byte;
        if (q->tile_class != TREEPIECES_BARK && q->tile_class < TREEPIECES_OWN) c->bottom |= byte;
        if (q->tile_class >= TREEPIECES_OWN) c->own |= byte;
    }
}

/* Move the rims to their exact places and bind them to their joints alone. */
static void tpc_place_rims(const treepieces_piece *p, treepieces_vertex *v) {
    const float own[4] = {1, 0, 0, 0};
    for (int i = 0; i < p->vertex_count; i++) {
        v[i].rim = -1;
        v[i].reserved = 0;
    }
    for (int j = 0; j < TREEPIECES_RIM; j++) {
        treepieces_vertex *r = &v[p->root_rim[j]];
        tpc_rim_vertex(j, r->position, r->normal);
        memcpy(r->weights, own, sizeof own);
        for (int k = 0; k < p->leaf_count; k++) {
            treepieces_vertex *l = &v[p->leaf_rims[k][j]];
            tpc_leaf_vertex(&p->building[k], j, l->position, l->normal);
            memset(l->weights, 0, sizeof l->weights);
            l->weights[1 + k] = 1;
            l->rim = TREEPIECES_RIM * k + j;
        }
    }
}

/* All vertices of a piece, moved into the frame of a leaf rim. */
static void tpc_move_into_rim(const treepieces_vertex *v, size_t count,
                             const treepieces_similarity *b, tpc_local_vertex *local) {
    const float back[4] = {-b->rotation[0], -b->rotation[1], -b->rotation[2], b->rotation[3]};
    for (size_t i = 0; i < count; i++) {
        float moved[3];
        for (int c = 0; c < 3; c++)
            moved[c] = (v[i].position[c] - b->translation[c]) / b->scale;
        tpc_rotate(back, moved, local[i].position);
        tpc_rotate(back, v[i].normal, local[i].normal);
    }
}

/* Copy a piece into the kit; its rims are moved to their exact places. */
static txm_status tpc_add_piece(treepieces_kit *kit, const treepieces_piece *from, txm_env *env) {
    const size_t vertices = (size_t)from->vertex_count, quads = (size_t)from->quad_count;
    const size_t name = from->name ? strlen(from->name) : 0;
    treepieces_vertex *v =
        (treepieces_vertex *)txm_arena_alloc(&kit->arena, vertices, sizeof *v);
    treepieces_quad *q = (treepieces_quad *)txm_arena_alloc(&kit->arena, quads, sizeof *q);
    char *text = (char *)txm_arena_alloc(&kit->arena, name + 1, 1);
    tpc_local_vertex *local = (tpc_local_vertex *)txm_arena_alloc(
        &kit->arena, vertices * (size_t)(from->leaf_count + 1), sizeof *local);
    tpc_cells *cells = (tpc_cells *)txm_arena_zero(&kit->arena, (quads + 3) / 4, sizeof *cells);
    if (kit->arena.failed)
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a piece");
    TXM_ASSERT(kit->count < TREEPIECES_MAX_TYPES);
    treepieces_piece *p = &kit->pieces[kit->count];
    *p = *from;
    memcpy(v, from->vertices, vertices * sizeof *v);
    memcpy(q, from->quads, quads * sizeof *q);
    if (name) memcpy(text, from->name, name);
    text[name] = 0;
    tpc_place_rims(p, v);
    for (int k = 0; k < p->leaf_count; k++) {
        const treepieces_similarity *b = &p->building[k];
        kit->offsets[kit->count][k] = sqrtf(b->translation[0] * b->translation[0] +
                                            b->translation[2] * b->translation[2]);
        tpc_move_into_rim(v, vertices, b, local + (size_t)k * vertices);
    }
    p->vertices = v;
    p->quads = q;
    p->name = text;
    tpc_measure_bands(p, kit->bands[kit->count]);
    tpc_sort_cells(p, cells);
    for (size_t i = 0; i < quads; i++)
        if (q[i].band >= kit->band_counts[kit->count]) kit->band_counts[kit->count] = q[i].band + 1;
    kit->cells[kit->count] = cells;
    kit->local[kit->count++] = local;
    return TXM_OK;
}

TREEPIECES_API void treepieces_kit_free(treepieces_kit *kit) {
    if (!kit) return;
    txm_arena arena = kit->arena;
    txm_arena_free(&arena);
}

TREEPIECES_API txm_status treepieces_kit_make(const treepieces_piece *pieces, int count,
                                              txm_env *env, treepieces_kit **out) {
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    if (count < 0 || (count > 0 && !pieces))
        return txm_fail(env, TXM_BAD_ARGUMENT, "pieces is NULL, or count below 0");
    if (count > TREEPIECES_MAX_TYPES - (int)TREEPIECES_BUILTIN)
        return txm_fail(env, TXM_TOO_LARGE, "more pieces than TREEPIECES_MAX_TYPES");
    txm_arena arena;
    txm_arena_init(&arena, env);
    treepieces_kit *kit = (treepieces_kit *)txm_arena_zero(&arena, 1, sizeof *kit);
    tpc_shape *shape = (tpc_shape *)txm_alloc(env, sizeof *shape);
    uint8_t *side = (uint8_t *)txm_alloc(env, TREEPIECES_MAX_VERTICES * TREEPIECES_MAX_VERTICES);
    txm_status status = TXM_OK;
    if (kit) kit->arena = arena;
    if (!kit || !shape || !side) {
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the kit");
    } else {
        for (int i = 0; status == TXM_OK && i < TREEPIECES_BUILTIN; i++) {
            tpc_make_builtin(i, shape);
            status = tpc_add_piece(kit, &shape->piece, env);
        }
        for (int i = 0; status == TXM_OK && i < count; i++) {
            status = tpc_check_piece(&pieces[i], i, side, env);
            if (status == TXM_OK) status = tpc_add_piece(kit, &pieces[i], env);
        }
    }
    txm_free(env, shape);
    txm_free(env, side);
    if (status == TXM_OK) *out = kit;
    else treepieces_kit_free(kit);
    return status;
}

TREEPIECES_API int treepieces_kit_count(const treepieces_kit *kit) {
    return kit ? kit->count : 0;
}

TREEPIECES_API const treepieces_piece *treepieces_kit_piece(const treepieces_kit *kit, int type) {
    return kit && type >= 0 && type < kit->count ? &kit->pieces[type] : NULL;
}

/* ---- species: fields --------------------------------------------------------------------- */

/* One table drives reading, printing and checking. */
typedef enum tpc_kind { TPC_REAL, TPC_WHOLE, TPC_ENVELOPE, TPC_LEAF, TPC_CLOUD, TPC_BARK } tpc_kind;

typedef struct tpc_field {
    const char *key;
    size_t offset;
    tpc_kind kind;
    int count; /* of values */
    float low, high;
} tpc_field;

#define TPC_FIELD(key, kind, count, low, high) \
    { #key, offsetof(treepieces_species, key), kind, count, low, high }
#define TPC_ORDER(key, count, low, high) \
    { #key, offsetof(treepieces_order, key), TPC_REAL, count, low, high }

/* all but the name and the orders, which are read separately */
static const tpc_field tpc_fields[] = {
    TPC_FIELD(order_count, TPC_WHOLE, 1, 1, TREEPIECES_MAX_ORDERS),
    TPC_FIELD(flare, TPC_REAL, 1, 1, 4),
    TPC_FIELD(envelope, TPC_ENVELOPE, 1, 0, TREEPIECES_CYLINDER),
    TPC_FIELD(crown_base, TPC_REAL, 1, 0, 2),
    TPC_FIELD(crown_top, TPC_REAL, 1, 0.01f, 3),
    TPC_FIELD(crown_width, TPC_REAL, 1, 0.01f, 10),
    TPC_FIELD(shade, TPC_REAL, 1, 0, 1e6f),
    TPC_FIELD(phototropism, TPC_REAL, 1, 0, 1),
    TPC_FIELD(clearance, TPC_REAL, 1, 0, 10),
    TPC_FIELD(stiffness, TPC_REAL, 1, 0.01f, 100),
    TPC_FIELD(leaf_shape, TPC_LEAF, 1, 0, TREEPIECES_LEAF_COMPOUND),
    TPC_FIELD(leaf_count, TPC_WHOLE, 1, 0, 256),
    TPC_FIELD(leaf_size, TPC_REAL, 1, 0.01f, 4),
    TPC_FIELD(cloud_kind, TPC_CLOUD, 1, 0, TREEPIECES_CLOUD_STRIPS),
    TPC_FIELD(cloud, TPC_REAL, 1, 0.001f, 20),
    TPC_FIELD(cloud_flat, TPC_REAL, 1, 0.1f, 2),
    TPC_FIELD(bark_kind, TPC_BARK, 1, 0, TREEPIECES_BARK_PLATES),
    TPC_FIELD(leaf_color, TPC_REAL, 3, 0, 1),
    TPC_FIELD(bark_color, TPC_REAL, 3, 0, 1),
};

static const tpc_field tpc_order_fields[] = {
    TPC_ORDER(length, 1, 0.01f, 200),
    TPC_ORDER(length_spread, 1, 0, 1),
    TPC_ORDER(radius, 1, 0.001f, 1),
    TPC_ORDER(taper, 1, 0.02f, 1),
    TPC_ORDER(segments, 1, 1, 64),
    TPC_ORDER(start, 1, 0, 1),
    TPC_ORDER(side, 1, 0, 1),
    TPC_ORDER(pair, 1, 0, 1),
    TPC_ORDER(fork, 1, 0, 1),
    TPC_ORDER(triple, 1, 0, 1),
    TPC_ORDER(fork_angle, 1, 0, 90),
    TPC_ORDER(fork_ratio, 1, 0.1f, 1),
    TPC_ORDER(angle_base, 1, 0, 180),
    TPC_ORDER(angle_top, 1, 0, 180),
    TPC_ORDER(angle_spread, 1, 0, 180),
    TPC_ORDER(profile, 3, 0, 10),
    TPC_ORDER(roll, 1, -360, 360),
    TPC_ORDER(wander, 1, 0, 90),
    TPC_ORDER(tropism, 1, -1, 1),
    TPC_ORDER(sag, 1, -360, 360),
    TPC_ORDER(gravimorphism, 1, -1, 1),
    TPC_ORDER(flatten, 1, 0, 1),
    TPC_ORDER(leaves, 1, 0, 1),
    TPC_ORDER(leaves_start, 1, 0, 1),
};

#undef TPC_FIELD
#undef TPC_ORDER

enum {
    TPC_FIELDS = (int)(sizeof tpc_fields / sizeof tpc_fields[0]),
    TPC_ORDER_FIELDS = (int)(sizeof tpc_order_fields / sizeof tpc_order_fields[0]),
    TPC_NUMBER = 24 /* room for a number as text */
};

/* by treepieces_envelope, treepieces_leaf_shape, treepieces_cloud_kind and treepieces_bark_kind */
static const char *const tpc_envelope_names[] = {"free", "ellipsoid", "cone", "cylinder", NULL};
static const char *const tpc_leaf_names[] = {"oval",   "lobed",   "lance",   "heart",   "needle",
                                             "blossom", "palmate", "compound", NULL};
static const char *const tpc_cloud_names[] = {"round", "layers", "shoots", "strips", NULL};
static const char *const tpc_bark_names[] = {"furrowed", "smooth", "lenticels", "plates", NULL};

/* The names of the values of a field; NULL: they are numbers. */
static const char *const *tpc_names_of(const tpc_field *f) {
    return f->kind == TPC_ENVELOPE ? tpc_envelope_names
           : f->kind == TPC_LEAF   ? tpc_leaf_names
           : f->kind == TPC_CLOUD  ? tpc_cloud_names
           : f->kind == TPC_BARK   ? tpc_bark_names
                                   : NULL;
}

static float tpc_get(const tpc_field *f, const void *base, int i) {
    const char *at = (const char *)base + f->offset;
    float x;
    int n;
    if (f->kind != TPC_REAL) {
        memcpy(&n, at, sizeof n);
        return (float)n;
    }
    memcpy(&x, at + (size_t)i * sizeof x, sizeof x);
    return x;
}

static void tpc_set(const tpc_field *f, void *base, int i, float x) {
    char *at = (char *)base + f->offset;
    const int n = (int)x;
    if (f->kind == TPC_REAL) memcpy(at + (size_t)i * sizeof x, &x, sizeof x);
    else memcpy(at, &n, sizeof n);
}

/* ---- species: numbers as text ------------------------------------------------------------ */

/* x * 10^e, the powers up to 10^22 exact */
static double tpc_scale10(double x, int e) {
    for (; e >= 22; e -= 22) x *= 1e22;
    for (; e <= -22; e += 22) x /= 1e22;
    double power = 1;
    for (int k = e < 0 ? -e : e; k > 0; k--) power *= 10;
    return e < 0 ? x / power : x * power;
}

/* Read digits from *at on into *sum, as many as it holds exactly. Returns how many digits there
   are; *dropped counts those that *sum could not hold. */
static int tpc_read_digits(const char **at, const char *end, double *sum, int *dropped) {
    int count = 0;
    for (; *at < end && **at >= '0' && **at <= '9'; ++*at, count++) {
        if (*sum < 1e14) *sum = *sum * 10 + (**at - '0');
        else ++*dropped;
    }
    return count;
}

/* Read a decimal number, independent of the locale; 0 if the text is not a number. */
static int tpc_read_number(const char *at, const char *end, double *value) {
    const int negative = at < end && *at == '-';
    double sum = 0, exponent = 0;
    int dropped = 0, lost = 0, past = 0;
    if (at < end && (*at == '-' || *at == '+')) at++;
    int digits = tpc_read_digits(&at, end, &sum, &dropped);
    if (at < end && *at == '.') {
        at++;
        const int before = dropped;
        past = tpc_read_digits(&at, end, &sum, &dropped);
        digits += past;
        past -= dropped - before;
        dropped = before;
    }
    if (!digits) return 0;
    if (at < end && (*at == 'e' || *at == 'E')) {
        at++;
        const int down = at < end && *at == '-';
        if (at < end && (*at == '-' || *at == '+')) at++;
        if (!tpc_read_digits(&at, end, &exponent, &lost)) return 0;
        if (exponent > 9999) exponent = 9999;
        if (down) exponent = -exponent;
    }
    if (at != end) return 0;
    const double scaled = sum > 0 ? tpc_scale10(sum, (int)exponent + dropped - past) : 0;
    *value = negative ? -scaled : scaled;
    return 1;
}

/* Write `count` significant digits of x > 0; returns the power of ten of the first. */
static int tpc_write_digits(double x, int count, char *digits) {
    int power = 0;
    while (tpc_scale10(x, -power) >= 10) power++;
    while (tpc_scale10(x, -power) < 1) power--;
    double whole = floor(tpc_scale10(x, count - 1 - power) + 0.5);
    if (whole >= tpc_scale10(1, count)) {
        whole = tpc_scale10(1, count - 1);
        power++;
    }
    uint64_t n = (uint64_t)whole;
    for (int i = count; i-- > 0; n /= 10) digits[i] = (char)('0' + n % 10);
    return power;
}

/* Write x to `count` significant digits: 0.05, 12, 1.5e-7. */
static void tpc_write_rounded(float x, int count, char text[TPC_NUMBER]) {
    char digits[16], *to = text;
    const int power = tpc_write_digits(fabs((double)x), count, digits);
    const int plain = power >= -5 && power < 9;
    int at = plain ? power : 0; /* of the next digit */
    if (x < 0) *to++ = '-';
    if (at < 0) {
        *to++ = '0';
        *to++ = '.';
        for (int i = -1; i > at; i--) *to++ = '0';
    }
    for (int i = 0; i < count || at >= 0; i++, at--) {
        if (at == -1 && i) *to++ = '.';
        *to++ = (char)(i < count ? digits[i] : '0');
    }
    *to = 0;
    if (!plain) snprintf(to, (size_t)(text + TPC_NUMBER - to), "e%d", power);
}

/* Write the shortest text that reads back as x. */
static void tpc_write_number(float x, char text[TPC_NUMBER]) {
    if (!txm_is_finite((double)x) || x == 0) {
        snprintf(text, TPC_NUMBER, "%s", x == 0 ? "0" : x > 0 ? "inf" : x < 0 ? "-inf" : "nan");
        return;
    }
    for (int count = 1; count <= 9; count++) {
        double back = 0;
        tpc_write_rounded(x, count, text);
        tpc_read_number(text, text + strlen(text), &back);
        if (txm_float(back) == x) return;
    }
}

/* ---- species: checking ------------------------------------------------------------------- */

/* Write what the value of a field must be, for a message. */
static void tpc_write_range(const tpc_field *f, char *text, size_t capacity) {
    const char *const *names = tpc_names_of(f);
    char low[TPC_NUMBER], high[TPC_NUMBER];
    if (!names) {
        tpc_write_number(f->low, low);
        tpc_write_number(f->high, high);
        snprintf(text, capacity, "%s must be %s%s to %s", f->key,
                 f->kind == TPC_WHOLE ? "a whole number of " : "", low, high);
        return;
    }
    int n = snprintf(text, capacity, "%s must be one of", f->key);
    for (; *names && n > 0 && (size_t)n < capacity; names++)
        n += snprintf(text + n, capacity - (size_t)n, " %s", *names);
}

/* the first field that is out of its range, or NULL */
static const tpc_field *tpc_find_fault(const tpc_field *fields, int count, const void *base) {
    for (int i = 0; i < count; i++) {
        for (int k = 0; k < fields[i].count; k++) {
            const float x = tpc_get(&fields[i], base, k);
            if (!(x >= fields[i].low && x <= fields[i].high)) return &fields[i];
        }
    }
    return NULL;
}

/* Can this name be written on a line? No control characters, no #, no blanks at its ends. */
static int tpc_is_name(const char name[TREEPIECES_MAX_NAME]) {
    int n = 0;
    while (n < TREEPIECES_MAX_NAME && name[n]) {
        const unsigned char c = (unsigned char)name[n++];
        if (c < ' ' || c == '#' || c == 127) return 0;
    }
    return n < TREEPIECES_MAX_NAME && (!n || (name[0] != ' ' && name[n - 1] != ' '));
}

static txm_status tpc_species_check(const treepieces_species *s, txm_env *env) {
    char line[200], range[120];
    if (!tpc_is_name(s->name))
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "a species name is too long, begins or ends with a blank, or contains # or a "
                        "control character");
    const char *name = s->name[0] ? s->name : "without a name";
    const tpc_field *fault = tpc_find_fault(tpc_fields, TPC_FIELDS, s);
    if (fault) {
        tpc_write_range(fault, range, sizeof range);
        snprintf(line, sizeof line, "species %s: %s", name, range);
        return txm_fail(env, TXM_BAD_ARGUMENT, line);
    }
    for (int k = 0; k < s->order_count; k++) {
        fault = tpc_find_fault(tpc_order_fields, TPC_ORDER_FIELDS, &s->orders[k]);
        if (!fault) continue;
        tpc_write_range(fault, range, sizeof range);
        snprintf(line, sizeof line, "species %s, order %d: %s", name, k, range);
        return txm_fail(env, TXM_BAD_ARGUMENT, line);
    }
    if (!(s->crown_base < s->crown_top)) {
        snprintf(line, sizeof line, "species %s: crown_top must be above crown_base", name);
        return txm_fail(env, TXM_BAD_ARGUMENT, line);
    }
    return TXM_OK;
}

/* ---- species: presets -------------------------------------------------------------------- */

/* The default of every key: a small round tree. */
static const char tpc_fresh[] =
    "flare 1.6\n"
    "envelope free\n" "crown_base 0\n" "crown_top 1\n" "crown_width 1\n" "shade 0\n"
    "phototropism 0\n" "clearance 1.2\n"
    "stiffness 1\n"
    "leaf_shape oval\n" "leaf_count 24\n" "leaf_size 0.3\n" "cloud_kind round\n" "cloud 0.5\n"
    "cloud_flat 0.8\n"
    "bark_kind furrowed\n"
    "leaf_color 0.3 0.45 0.15\n" "bark_color 0.4 0.35 0.3\n"
    "order 0\n" "length 8\n" "length_spread 0.1\n" "radius 0.025\n" "taper 0.25\n" "segments 12\n"
    "start 0.25\n" "side 0.45\n" "pair 0.1\n" "fork 0.12\n" "triple 0\n" "fork_angle 25\n"
    "fork_ratio 0.9\n"
    "angle_base 0\n" "angle_top 0\n" "angle_spread 0\n" "profile 1 1 1\n" "roll 0\n"
    "wander 6\n" "tropism 0.05\n" "sag 0\n" "gravimorphism 0\n" "flatten 0\n" "leaves 0\n"
    "leaves_start 0.8\n"
    "order 1\n" "length 0.5\n" "length_spread 0.2\n" "radius 0.5\n" "taper 0.2\n" "segments 7\n"
    "start 0.2\n" "side 0.5\n" "pair 0.1\n" "fork 0.06\n" "triple 0\n" "fork_angle 25\n"
    "fork_ratio 0.9\n"
    "angle_base 65\n" "angle_top 40\n" "angle_spread 10\n" "profile 1 0.9 0.5\n" "roll 137.5\n"
    "wander 9\n" "tropism 0.05\n" "sag 0\n" "gravimorphism 0\n" "flatten 0\n" "leaves 0.5\n"
    "leaves_start 0.5\n"
    "order 2\n" "length 0.45\n" "length_spread 0.25\n" "radius 0.55\n" "taper 0.3\n" "segments 4\n"
    "start 0.2\n" "side 0.5\n" "pair 0\n" "fork 0\n" "triple 0\n" "fork_angle 25\n"
    "fork_ratio 0.9\n"
    "angle_base 55\n" "angle_top 40\n" "angle_spread 12\n" "profile 1 0.9 0.6\n" "roll 137.5\n"
    "wander 12\n" "tropism 0.03\n" "sag 0\n" "gravimorphism 0\n" "flatten 0\n" "leaves 0.8\n"
    "leaves_start 0.2\n";

static const char tpc_oak[] =
    "name oak\n" "phototropism 0.2\n" "flare 1.7\n" "stiffness 1.4\n"
    "envelope ellipsoid\n" "crown_base 0.06\n" "crown_top 1.08\n" "crown_width 1.45\n"
    "leaf_shape lobed\n" "leaf_count 28\n" "leaf_size 0.42\n" "cloud 1.2\n" "cloud_flat 0.8\n"
    "leaf_color 0.29 0.4 0.13\n" "bark_color 0.4 0.35 0.29\n"
    "order 0\n" "length 15\n" "radius 0.034\n" "taper 0.05\n" "segments 15\n"
    "start 0.2\n" "side 0.5\n" "pair 0.05\n" "fork 0.35\n" "fork_angle 30\n" "fork_ratio 0.95\n"
    "wander 9\n" "tropism 0.03\n" "leaves 0.9\n" "leaves_start 0.85\n"
    "order 1\n" "length 0.72\n" "length_spread 0.2\n" "radius 0.55\n" "taper 0.06\n" "segments 12\n"
    "start 0.15\n" "side 0.5\n" "pair 0.05\n" "fork 0.22\n" "fork_angle 28\n"
    "angle_base 80\n" "angle_top 40\n" "angle_spread 10\n" "profile 1 1 0.75\n" "roll 137.5\n"
    "wander 15\n" "tropism 0.06\n" "leaves 0.7\n" "leaves_start 0.5\n"
    "order 2\n" "gravimorphism 0.5\n"
    "length 0.45\n" "radius 0.5\n" "taper 0.1\n" "segments 7\n"
    "start 0.1\n" "side 0.55\n" "fork 0.15\n"
    "angle_base 65\n" "angle_top 45\n" "angle_spread 15\n" "profile 1 0.9 0.5\n"
    "wander 17\n" "tropism 0.1\n" "leaves 0.6\n" "leaves_start 0.3\n"
    "order 3\n" "gravimorphism 0.5\n"
    "length 0.5\n" "radius 0.5\n" "taper 0.2\n" "segments 4\n" "side 0.4\n"
    "angle_base 55\n" "angle_top 45\n"
    "wander 18\n" "tropism 0.08\n" "leaves 0.6\n" "leaves_start 0.2\n"
    "order 4\n" "gravimorphism 0.3\n" "length 0.5\n" "radius 0.55\n" "segments 3\n"
    "wander 16\n" "leaves 0.5\n";

static const char tpc_beech[] =
    "name beech\n" "phototropism 0.15\n" "flare 1.8\n" "stiffness 1.2\n"
    "envelope ellipsoid\n" "crown_base 0.06\n" "crown_top 1.08\n" "crown_width 0.95\n"
    "leaf_shape oval\n" "leaf_count 48\n" "leaf_size 0.36\n" "cloud_kind layers\n" "cloud 1.25\n"
    "cloud_flat 0.5\n"
    "leaf_color 0.28 0.39 0.14\n" "bark_kind smooth\n" "bark_color 0.47 0.48 0.46\n"
    "order 0\n" "length 20\n" "radius 0.024\n" "taper 0.04\n" "segments 26\n"
    "start 0.14\n" "side 0.8\n" "pair 0.05\n" "fork 0.08\n" "fork_angle 20\n" "fork_ratio 0.95\n"
    "wander 4\n" "tropism 0.08\n" "leaves 0.9\n" "leaves_start 0.9\n"
    "order 1\n" "length 0.6\n" "radius 0.42\n" "taper 0.05\n" "segments 13\n"
    "start 0.12\n" "side 0.7\n" "pair 0.05\n" "fork 0.1\n" "fork_angle 22\n"
    "angle_base 66\n" "angle_top 28\n" "angle_spread 8\n" "profile 1 1 0.4\n"
    "wander 8\n" "tropism 0.05\n" "leaves 0.8\n" "leaves_start 0.5\n"
    "order 2\n" "length 0.42\n" "radius 0.45\n" "taper 0.08\n" "segments 7\n"
    "start 0.1\n" "side 0.6\n" "fork 0.06\n"
    "angle_base 60\n" "angle_top 40\n" "profile 1 0.9 0.4\n"
    "wander 9\n" "tropism 0.02\n" "flatten 0.4\n" "leaves 0.8\n" "leaves_start 0.3\n"
    "order 3\n" "length 0.45\n" "radius 0.45\n" "taper 0.15\n" "segments 5\n"
    "side 0.4\n" "angle_base 50\n" "angle_top 40\n"
    "wander 10\n" "sag 15\n" "flatten 0.5\n" "leaves 0.6\n" "leaves_start 0.2\n";

static const char tpc_maple[] =
    "name maple\n" "phototropism 0.2\n" "flare 1.5\n"
    "envelope ellipsoid\n" "crown_base 0.12\n" "crown_top 1.1\n" "crown_width 0.85\n"
    "leaf_shape palmate\n" "leaf_count 24\n" "leaf_size 0.42\n" "cloud 1\n" "cloud_flat 0.85\n"
    "leaf_color 0.74 0.4 0.12\n" "bark_color 0.42 0.38 0.33\n"
    "order 0\n" "length 15\n" "radius 0.02\n" "taper 0.05\n" "segments 20\n"
    "start 0.16\n" "side 0.2\n" "pair 0.5\n" "fork 0.06\n" "fork_angle 20\n" "fork_ratio 0.95\n"
    "wander 4\n" "tropism 0.1\n" "leaves 0.9\n" "leaves_start 0.85\n"
    "order 1\n" "length 0.55\n" "radius 0.42\n" "taper 0.05\n" "segments 11\n"
    "start 0.2\n" "side 0.15\n" "pair 0.4\n" "fork 0.12\n"
    "angle_base 55\n" "angle_top 30\n" "profile 0.9 1 0.5\n" "roll 90\n"
    "wander 7\n" "tropism 0.08\n" "leaves 0.6\n" "leaves_start 0.4\n"
    "order 2\n" "length 0.42\n" "radius 0.42\n" "taper 0.1\n" "segments 7\n"
    "start 0.15\n" "side 0.1\n" "pair 0.4\n" "fork 0.06\n"
    "angle_base 50\n" "angle_top 40\n" "profile 1 0.9 0.5\n" "roll 90\n"
    "wander 8\n" "tropism 0.08\n" "leaves 0.6\n" "leaves_start 0.3\n"
    "order 3\n" "length 0.5\n" "radius 0.45\n" "taper 0.2\n" "segments 4\n"
    "side 0.1\n" "pair 0.25\n" "angle_base 45\n" "angle_top 40\n" "roll 90\n"
    "wander 10\n" "tropism 0.08\n" "leaves 0.7\n" "leaves_start 0.2\n";

static const char tpc_birch[] =
    "name birch\n" "phototropism 0.1\n" "flare 1.3\n" "stiffness 0.7\n"
    "envelope ellipsoid\n" "crown_base 0.1\n" "crown_top 1.12\n" "crown_width 0.5\n"
    "leaf_shape heart\n" "leaf_count 12\n" "leaf_size 0.5\n" "cloud 0.75\n" "cloud_flat 1.3\n"
    "leaf_color 0.4 0.52 0.16\n" "bark_kind lenticels\n" "bark_color 0.85 0.83 0.79\n"
    "order 0\n" "length 18\n" "radius 0.01\n" "taper 0.03\n" "segments 38\n"
    "start 0.2\n" "side 0.9\n" "pair 0.05\n" "fork 0\n"
    "wander 3\n" "tropism 0.12\n" "leaves 0.9\n" "leaves_start 0.9\n"
    "order 1\n" "length 0.3\n" "radius 0.36\n" "taper 0.06\n" "segments 11\n"
    "start 0.1\n" "side 0.9\n" "fork 0.02\n"
    "angle_base 58\n" "angle_top 30\n" "angle_spread 7\n" "profile 1 0.9 0.25\n"
    "wander 7\n" "tropism 0.06\n" "sag 30\n" "leaves 0.35\n" "leaves_start 0.6\n"
    "order 2\n" "length 0.42\n" "radius 0.38\n" "taper 0.12\n" "segments 6\n"
    "start 0.05\n" "side 0.8\n" "angle_base 50\n" "angle_top 35\n" "profile 1 1 0.6\n"
    "wander 10\n" "sag 100\n" "tropism -0.06\n" "leaves 0.4\n" "leaves_start 0.3\n"
    "order 3\n" "length 0.7\n" "radius 0.45\n" "taper 0.3\n" "segments 5\n" "side 0\n"
    "angle_base 45\n" "angle_top 35\n" "profile 1 1 0.7\n"
    "wander 9\n" "sag 110\n" "tropism -0.14\n" "leaves 0.5\n" "leaves_start 0.2\n";

static const char tpc_poplar[] =
    "name poplar\n" "flare 1.5\n" "stiffness 0.9\n"
    "leaf_shape heart\n" "leaf_count 26\n" "leaf_size 0.45\n" "cloud 0.85\n" "cloud_flat 1.4\n"
    "leaf_color 0.3 0.44 0.14\n" "bark_color 0.45 0.42 0.36\n"
    "order 0\n" "length 24\n" "radius 0.013\n" "taper 0.03\n" "segments 50\n"
    "start 0.04\n" "side 0.6\n" "pair 0.4\n" "fork 0\n"
    "wander 1.5\n" "tropism 0.25\n" "leaves 0.9\n" "leaves_start 0.9\n"
    "order 1\n" "length_spread 0.12\n" "length 0.26\n" "radius 0.32\n" "taper 0.06\n"
    "segments 10\n" "start 0.15\n" "side 0.6\n" "fork 0\n"
    "angle_base 30\n" "angle_top 18\n" "angle_spread 5\n" "profile 0.8 1 0.14\n"
    "wander 4\n" "tropism 0.16\n" "leaves 0.7\n" "leaves_start 0.12\n"
    "order 2\n" "length 0.4\n" "radius 0.42\n" "taper 0.12\n" "segments 6\n"
    "start 0.1\n" "side 0.4\n" "angle_base 32\n" "angle_top 25\n" "profile 1 0.9 0.5\n"
    "wander 6\n" "tropism 0.14\n" "leaves 0.7\n" "leaves_start 0.3\n"
    "order 3\n" "length 0.4\n" "radius 0.5\n" "taper 0.3\n" "segments 3\n"
    "angle_base 32\n" "angle_top 25\n" "wander 7\n" "tropism 0.12\n" "leaves 0.6\n";

static const char tpc_willow[] =
    "name willow\n" "phototropism 0.1\n" "flare 1.6\n" "stiffness 0.6\n"
    "envelope ellipsoid\n" "crown_base 0\n" "crown_top 1.05\n" "crown_width 1.6\n"
    "leaf_shape lance\n" "leaf_count 16\n" "leaf_size 0.9\n" "cloud_kind strips\n" "cloud 1\n"
    "cloud_flat 2\n"
    "leaf_color 0.42 0.5 0.18\n" "bark_color 0.42 0.37 0.29\n"
    "order 0\n" "length 10\n" "radius 0.045\n" "taper 0.08\n" "segments 13\n"
    "start 0.18\n" "side 0.5\n" "pair 0.05\n" "fork 0.45\n" "fork_angle 28\n" "fork_ratio 0.85\n"
    "wander 8\n" "tropism 0.03\n" "leaves 0.6\n" "leaves_start 0.7\n"
    "order 1\n" "length 0.7\n" "radius 0.5\n" "taper 0.1\n" "segments 10\n"
    "start 0.15\n" "side 0.75\n" "pair 0.25\n" "fork 0.06\n"
    "angle_base 50\n" "angle_top 45\n" "profile 1 1 0.7\n"
    "wander 9\n" "tropism 0.1\n" "sag 75\n" "leaves 0.45\n" "leaves_start 0.35\n"
    "order 2\n" "length 0.85\n" "radius 0.4\n" "taper 0.12\n" "segments 8\n"
    "start 0.1\n" "side 0.3\n" "angle_base 60\n" "angle_top 40\n" "profile 1 1 0.8\n"
    "wander 5\n" "tropism -0.16\n" "sag 70\n" "gravimorphism 0.3\n" "leaves 0.85\n"
    "leaves_start 0.15\n"
    "order 3\n" "length 0.6\n" "radius 0.5\n" "taper 0.3\n" "segments 5\n"
    "angle_base 30\n" "angle_top 30\n"
    "wander 5\n" "tropism -0.3\n" "leaves 0.85\n" "leaves_start 0\n";

static const char tpc_almond[] =
    "name almond\n" "phototropism 0.1\n" "flare 1.4\n"
    "leaf_shape blossom\n" "leaf_count 44\n" "leaf_size 0.28\n" "cloud 0.42\n" "cloud_flat 0.9\n"
    "leaf_color 0.94 0.76 0.8\n" "bark_kind lenticels\n" "bark_color 0.3 0.25 0.22\n"
    "order 0\n" "length 5.5\n" "radius 0.026\n" "taper 0.06\n" "segments 14\n"
    "start 0.2\n" "side 0.35\n" "fork 0.42\n" "triple 0.1\n" "fork_angle 32\n" "fork_ratio 0.95\n"
    "wander 8\n" "tropism 0.1\n" "leaves 0.3\n" "leaves_start 0.6\n"
    "order 1\n" "length 0.5\n" "radius 0.45\n" "taper 0.1\n" "segments 9\n"
    "start 0.1\n" "side 0.6\n" "fork 0.15\n" "fork_angle 28\n"
    "angle_base 55\n" "angle_top 40\n" "profile 1 1 0.6\n"
    "wander 11\n" "tropism 0.08\n" "leaves 0.5\n" "leaves_start 0.3\n"
    "order 2\n" "length 0.45\n" "radius 0.5\n" "taper 0.15\n" "segments 5\n"
    "side 0.55\n" "fork 0.05\n" "angle_base 50\n" "angle_top 40\n" "profile 1 0.9 0.5\n"
    "wander 12\n" "tropism 0.08\n" "leaves 0.6\n" "leaves_start 0.2\n"
    "order 3\n" "length 0.5\n" "radius 0.55\n" "taper 0.3\n" "segments 3\n"
    "angle_base 45\n" "angle_top 40\n" "wander 12\n" "tropism 0.06\n" "leaves 0.6\n";

static const char tpc_pine[] =
    "name pine\n" "phototropism 0.15\n" "flare 1.4\n"
    "leaf_shape needle\n" "leaf_count 32\n" "leaf_size 0.66\n" "cloud_kind shoots\n" "cloud 0.95\n"
    "cloud_flat 0.32\n"
    "leaf_color 0.23 0.335 0.185\n" "bark_kind plates\n" "bark_color 0.55 0.36 0.24\n"
    "order 0\n" "length 18\n" "radius 0.018\n" "taper 0.06\n" "segments 30\n"
    "start 0.5\n" "side 0.35\n" "pair 0.25\n" "fork 0.1\n" "fork_angle 30\n"
    "wander 5\n" "tropism 0.08\n" "leaves 0.9\n" "leaves_start 0.9\n"
    "order 1\n" "length 0.34\n" "radius 0.42\n" "taper 0.1\n" "segments 9\n"
    "start 0.35\n" "side 0.3\n" "pair 0.25\n" "fork 0.12\n" "fork_angle 28\n"
    "angle_base 88\n" "angle_top 50\n" "angle_spread 10\n" "profile 0.8 1 0.7\n"
    "wander 14\n" "tropism 0.06\n" "flatten 0.3\n" "leaves 0.25\n" "leaves_start 0.75\n" "sag -25\n"
    "order 2\n" "length 0.42\n" "radius 0.45\n" "taper 0.15\n" "segments 5\n"
    "start 0.2\n" "side 0.3\n" "pair 0.15\n"
    "angle_base 60\n" "angle_top 45\n" "profile 1 0.9 0.5\n"
    "wander 14\n" "tropism 0.1\n" "flatten 0.85\n" "leaves 0.6\n" "leaves_start 0.6\n"
    "order 3\n" "length 0.5\n" "radius 0.5\n" "taper 0.3\n" "segments 3\n"
    "angle_base 50\n" "angle_top 40\n"
    "wander 12\n" "tropism 0.12\n" "leaves 0.6\n" "leaves_start 0.4\n" "flatten 0.8\n";

static const char tpc_spruce[] =
    "name spruce\n" "flare 1.4\n"
    "leaf_shape needle\n" "leaf_count 26\n" "leaf_size 0.9\n" "cloud_kind layers\n" "cloud 0.6\n"
    "cloud_flat 0.5\n"
    "leaf_color 0.19 0.295 0.18\n" "bark_kind plates\n" "bark_color 0.38 0.3 0.25\n"
    "order 0\n" "length 22\n" "radius 0.014\n" "taper 0.03\n" "segments 64\n"
    "start 0.04\n" "side 0.05\n" "pair 0.95\n" "fork 0\n"
    "wander 1\n" "tropism 0.3\n" "leaves 1\n" "leaves_start 0.96\n"
    "order 1\n" "length 0.2\n" "radius 0.38\n" "taper 0.12\n" "segments 9\n"
    "start 0.05\n" "side 0.1\n" "pair 0.8\n" "fork 0\n"
    "angle_base 95\n" "angle_top 55\n" "angle_spread 6\n" "profile 1 0.56 0.08\n" "roll 80\n"
    "wander 4\n" "sag -22\n" "leaves 0.9\n" "leaves_start 0\n"
    "order 2\n" "length 0.38\n" "radius 0.4\n" "taper 0.3\n" "segments 3\n"
    "side 0\n" "pair 0\n"
    "angle_base 60\n" "angle_top 50\n" "profile 1 0.8 0.3\n" "roll 15\n"
    "wander 6\n" "sag 25\n" "flatten 0.7\n" "leaves 0.8\n" "leaves_start 0.1\n";

static const char tpc_dead[] =
    "name dead\n" "phototropism 0.1\n" "flare 1.7\n" "stiffness 2\n" "leaf_count 0\n"
    "bark_color 0.5 0.47 0.43\n"
    "order 0\n" "length 9\n" "radius 0.036\n" "taper 0.3\n" "segments 12\n"
    "start 0.3\n" "side 0.55\n" "fork 0.18\n" "fork_angle 28\n" "fork_ratio 0.85\n"
    "wander 12\n" "tropism 0.02\n"
    "order 1\n" "length 0.42\n" "length_spread 0.6\n" "radius 0.45\n" "taper 0.3\n" "segments 7\n"
    "start 0.3\n" "side 0.35\n" "fork 0.12\n"
    "angle_base 80\n" "angle_top 40\n" "angle_spread 18\n" "profile 1 1 0.6\n"
    "wander 20\n" "tropism 0.03\n"
    "order 2\n" "length 0.4\n" "length_spread 0.6\n" "radius 0.45\n" "taper 0.4\n" "segments 4\n"
    "side 0.25\n" "angle_base 60\n" "angle_top 45\n" "angle_spread 20\n" "wander 22\n"
    "order 3\n" "length 0.4\n" "radius 0.5\n" "taper 0.4\n" "segments 3\n" "wander 20\n";

static const struct {
    const char *name, *text;
} tpc_presets[] = {
    {"oak", tpc_oak},
    {"beech", tpc_beech},
    {"maple", tpc_maple},
    {"birch", tpc_birch},
    {"poplar", tpc_poplar},
    {"willow", tpc_willow},
    {"almond", tpc_almond},
    {"pine", tpc_pine},
    {"spruce", tpc_spruce},
    {"dead", tpc_dead},
};

TREEPIECES_API int treepieces_preset_count(void) {
    return (int)(sizeof tpc_presets / sizeof tpc_presets[0]);
}

TREEPIECES_API const char *treepieces_preset_text(int index) {
    return index >= 0 && index < treepieces_preset_count() ? tpc_presets[index].text : NULL;
}

/* ---- species: reading -------------------------------------------------------------------- */

typedef struct tpc_reader {
    const char *at, *end; /* rest of the line          */
    int line, order;      /* order -1: none begun      */
    int keys, crown_line; /* keys so far; line of the last crown_ key */
    const char *like;     /* NULL, or the text to read after this line */
    treepieces_species species;
    txm_env *env;
} tpc_reader;

typedef struct tpc_word {
    const char *at, *end;
} tpc_word;

static int tpc_is_blank(char c) {
    return c == ' ' || c == '\t';
}

static int tpc_is_word(const tpc_word *w, const char *text) {
    const size_t n = strlen(text);
    return (size_t)(w->end - w->at) == n && !memcmp(w->at, text, n);
}

/* Read the next word of the line; 0 if there is none. */
static int tpc_next_word(tpc_reader *r, tpc_word *w) {
    while (r->at < r->end && tpc_is_blank(*r->at)) r->at++;
    w->at = r->at;
    while (r->at < r->end && !tpc_is_blank(*r->at)) r->at++;
    w->end = r->at;
    return w->at < w->end;
}

enum { TPC_SHOWN = 28 /* of a word in a message, with its 0 */ };

/* Copy a word, which may contain anything or be NULL, for a message; returns its length there. */
static size_t tpc_show_word(const tpc_word *w, char shown[TPC_SHOWN]) {
    size_t n = 0;
    for (const char *p = w ? w->at : NULL; p && p < w->end; p++) {
        if (n + 4 >= TPC_SHOWN) {
            memcpy(shown + n, "...", 3);
            n += 3;
            break;
        }
        shown[n++] = (char)(*p > ' ' && *p < 127 ? *p : '?');
    }
    shown[n] = 0;
    return n;
}

/* Fail with "line 7: WORD: fault"; the word may be NULL. */
static txm_status tpc_fail_line(const tpc_reader *r, const tpc_word *w, const char *fault) {
    char line[220], shown[TPC_SHOWN];
    const size_t n = tpc_show_word(w, shown);
    snprintf(line, sizeof line, "line %d: %s%s%s", r->line, shown, n ? ": " : "", fault);
    return txm_fail(r->env, TXM_BAD_DATA, line);
}

/* Read value i of a field; the key is for messages. */
static txm_status tpc_read_value(tpc_reader *r, const tpc_word *key, const tpc_field *f, void *base,
                                 int i) {
    char range[120];
    tpc_word w;
    double x = -1;
    const char *const *names = tpc_names_of(f);
    if (!tpc_next_word(r, &w)) return tpc_fail_line(r, key, "a value is missing");
    for (int k = 0; names && names[k]; k++)
        if (tpc_is_word(&w, names[k])) x = k;
    if (!names && !tpc_read_number(w.at, w.end, &x)) return tpc_fail_line(r, &w, "is not a number");
    const float value = x > -1e9 && x < 1e9 ? txm_float(x) : x < 0 ? -1e9f : 1e9f;
    if (!(value >= f->low && value <= f->high) ||
        (f->kind != TPC_REAL && value != (float)(int)value)) {
        tpc_write_range(f, range, sizeof range);
        return tpc_fail_line(r, &w, range);
    }
    tpc_set(f, base, i, value == 0 ? 0 : value); /* no -0 */
    return TXM_OK;
}

static txm_status tpc_read_name(tpc_reader *r, const tpc_word *key) {
    char *name = r->species.name;
    while (r->at < r->end && tpc_is_blank(*r->at)) r->at++;
    while (r->at < r->end && tpc_is_blank(r->end[-1])) r->end--;
    const size_t size = (size_t)(r->end - r->at);
    if (!size) return tpc_fail_line(r, key, "a value is missing");
    if (size >= TREEPIECES_MAX_NAME)
        return tpc_fail_line(r, key, "longer than 31 characters");
    memset(name, 0, TREEPIECES_MAX_NAME);
    memcpy(name, r->at, size);
    if (strlen(name) != size || !tpc_is_name(name))
        return tpc_fail_line(r, key, "contains a control character");
    r->at = r->end;
    return TXM_OK;
}

/* "order N" begins an order; order_count becomes at least N + 1. */
static txm_status tpc_begin_order(tpc_reader *r, const tpc_word *key) {
    static const tpc_field field = {"order", 0, TPC_WHOLE, 1, 0, TREEPIECES_MAX_ORDERS - 1};
    const txm_status status = tpc_read_value(r, key, &field, &r->order, 0);
    if (status != TXM_OK) return status;
    if (r->species.order_count <= r->order) r->species.order_count = r->order + 1;
    return TXM_OK;
}

/* "like NAME": its text is read after this line. Orders that it does not have keep their defaults. */
static txm_status tpc_begin_like(tpc_reader *r, const tpc_word *key) {
    tpc_word w;
    if (!tpc_next_word(r, &w)) return tpc_fail_line(r, key, "a value is missing");
    if (r->keys) return tpc_fail_line(r, key, "must come before all other keys");
    for (int i = 0; i < treepieces_preset_count(); i++) {
        if (!tpc_is_word(&w, tpc_presets[i].name)) continue;
        r->like = tpc_presets[i].text;
        return TXM_OK;
    }
    return tpc_fail_line(r, &w, "is not a built-in species");
}

/* How many letters must be inserted, removed or replaced to get from one word to the other. */
static int tpc_distance(const char *a, const char *b) {
    const int m = (int)strlen(a), n = (int)strlen(b);
    int row[TPC_SHOWN]; /* row[j]: from the letters of a so far to the first j of b */
    TXM_ASSERT(n < TPC_SHOWN);
    for (int j = 0; j <= n; j++) row[j] = j;
    for (int i = 1; i <= m; i++) {
        int diagonal = row[0];
        row[0] = i;
        for (int j = 1; j <= n; j++) {
            const int replaced = diagonal + (a[i - 1] != b[j - 1]);
            diagonal = row[j];
            row[j] = 1 + (row[j] < row[j - 1] ? row[j] : row[j - 1]);
            if (replaced < row[j]) row[j] = replaced;
        }
    }
    return row[n];
}

/* Fail with "line 7: unknown key 'flair'", and the key that it was perhaps meant to be. */
static txm_status tpc_fail_key(const tpc_reader *r, const tpc_word *key) {
    static const char *const others[] = {"like", "order", "name"};
    char line[120], shown[TPC_SHOWN];
    const char *nearest = NULL;
    const int size = (int)tpc_show_word(key, shown);
    int least = size < 8 ? (size + 1) / 2 : 4; /* from this on it is another word */
    for (int i = 0; i < TPC_FIELDS + TPC_ORDER_FIELDS + 3; i++) {
        const int k = i - TPC_FIELDS, o = k - TPC_ORDER_FIELDS;
        const char *name = k < 0 ? tpc_fields[i].key : o < 0 ? tpc_order_fields[k].key : others[o];
        const int distance = tpc_distance(shown, name);
        if (distance < least) {
            least = distance;
            nearest = name;
        }
    }
    snprintf(line, sizeof line, "line %d: unknown key '%s'%s%s%s", r->line, shown,
             nearest ? "; did you mean '" : "", nearest ? nearest : "", nearest ? "'?" : "");
    return txm_fail(r->env, TXM_BAD_DATA, line);
}

static txm_status tpc_read_key(tpc_reader *r, const tpc_word *key) {
    if (tpc_is_word(key, "like")) return tpc_begin_like(r, key);
    if (tpc_is_word(key, "order")) return tpc_begin_order(r, key);
    if (tpc_is_word(key, "name")) return tpc_read_name(r, key);
    const tpc_field *field = NULL;
    void *base = &r->species;
    for (int i = 0; i < TPC_FIELDS; i++)
        if (tpc_is_word(key, tpc_fields[i].key)) field = &tpc_fields[i];
    for (int i = 0; i < TPC_ORDER_FIELDS && !field; i++) {
        if (!tpc_is_word(key, tpc_order_fields[i].key)) continue;
        if (r->order < 0) return tpc_fail_line(r, key, "needs a line \"order N\" before it");
        field = &tpc_order_fields[i];
        base = &r->species.orders[r->order];
    }
    if (!field) return tpc_fail_key(r, key);
    if (!strncmp(field->key, "crown_", 6)) r->crown_line = r->line;
    for (int i = 0; i < field->count; i++) {
        const txm_status status = tpc_read_value(r, key, field, base, i);
        if (status != TXM_OK) return status;
    }
    return TXM_OK;
}

/* Read the line from r->at on: a key and its values, a comment, or nothing. */
static txm_status tpc_read_line(tpc_reader *r) {
    tpc_word key, rest;
    const char *comment = (const char *)memchr(r->at, '#', (size_t)(r->end - r->at));
    if (comment) r->end = comment;
    if (!tpc_next_word(r, &key)) return TXM_OK;
    const txm_status status = tpc_read_key(r, &key);
    if (status != TXM_OK) return status;
    if (tpc_next_word(r, &rest)) return tpc_fail_line(r, &key, "has too many values");
    r->keys++;
    return TXM_OK;
}

/* The end of the line that begins here: at \n, \r\n or \r, or at the end of the text. */
static const char *tpc_line_end(const char *at, const char *end) {
    while (at < end && *at != '\n' && *at != '\r') at++;
    return at;
}

/* Read a text whose missing keys keep the values of *species. */
static txm_status tpc_read_text(const char *text, size_t size, txm_env *env,
                                treepieces_species *species) {
    const char *at = text, *end = text + size;
    tpc_reader r;
    memset(&r, 0, sizeof r);
    r.order = -1;
    r.species = *species;
    r.env = env;
    while (at < end) {
        const char *line_end = tpc_line_end(at, end);
        r.at = at;
        r.end = line_end;
        r.line++;
        r.like = NULL;
        txm_status status = tpc_read_line(&r);
        if (status == TXM_OK && r.like)
            status = tpc_read_text(r.like, strlen(r.like), env, &r.species);
        if (status != TXM_OK) return status;
        at = line_end + (end - line_end > 1 && line_end[0] == '\r' && line_end[1] == '\n');
        if (at < end) at++;
    }
    if (!(r.species.crown_base < r.species.crown_top)) {
        r.line = r.crown_line;
        return tpc_fail_line(&r, NULL, "crown_top must be above crown_base");
    }
    *species = r.species;
    return TXM_OK;
}

/* Step over a byte order mark, which editors on Windows put before UTF-8. Other encodings of Unicode
   begin with marks of their own. */
static txm_status tpc_skip_mark(const char **text, size_t *size, txm_env *env) {
    const char *t = *text;
    if (*size >= 2 && (!memcmp(t, "\xff\xfe", 2) || !memcmp(t, "\xfe\xff", 2)))
        return txm_fail(env, TXM_BAD_DATA, "line 1: the text is UTF-16; save it as UTF-8");
    if (*size >= 3 && !memcmp(t, "\xef\xbb\xbf", 3)) {
        *text += 3;
        *size -= 3;
    }
    return TXM_OK;
}

TREEPIECES_API txm_status treepieces_species_parse(const char *text, size_t size, txm_env *env,
                                                   treepieces_species *species) {
    treepieces_species fresh;
    if (!species || (!text && size))
        return txm_fail(env, TXM_BAD_ARGUMENT, "text or species is NULL");
    memset(&fresh, 0, sizeof fresh);
    fresh.crown_top = 1; /* above crown_base until it is read */
    txm_status status = tpc_read_text(tpc_fresh, strlen(tpc_fresh), env, &fresh);
    for (int k = 1; k < TREEPIECES_MAX_ORDERS; k++)
        if (k >= fresh.order_count) fresh.orders[k] = fresh.orders[k - 1];
    if (status == TXM_OK) status = tpc_skip_mark(&text, &size, env);
    if (status == TXM_OK && size) status = tpc_read_text(text, size, env, &fresh);
    if (status != TXM_OK) return status;
    for (int k = fresh.order_count; k < TREEPIECES_MAX_ORDERS; k++)
        memset(&fresh.orders[k], 0, sizeof fresh.orders[k]);
    *species = fresh;
    return TXM_OK;
}

/* ---- species: printing ------------------------------------------------------------------- */

typedef struct tpc_writer {
    char *text;
    size_t capacity, length;
} tpc_writer;

static void tpc_write(tpc_writer *w, const char *text) {
    for (; *text; text++, w->length++)
        if (w->length + 1 < w->capacity) w->text[w->length] = *text;
}

static void tpc_write_fields(tpc_writer *w, const tpc_field *fields, int count, const void *base) {
    char number[TPC_NUMBER];
    for (int i = 0; i < count; i++) {
        const tpc_field *f = &fields[i];
        const char *const *names = tpc_names_of(f);
        tpc_write(w, f->key);
        for (int k = 0; k < f->count; k++) {
            const float x = tpc_get(f, base, k);
            tpc_write(w, " ");
            if (!names || !(x >= f->low && x <= f->high)) tpc_write_number(x, number);
            tpc_write(w, names && x >= f->low && x <= f->high ? names[(int)x] : number);
        }
        tpc_write(w, "\n");
    }
}

TREEPIECES_API size_t treepieces_species_print(const treepieces_species *species, char *text,
                                               size_t capacity) {
    tpc_writer w;
    char name[TREEPIECES_MAX_NAME + 1], order[32];
    if (!species) return 0;
    w.text = text;
    w.capacity = text ? capacity : 0;
    w.length = 0;
    memcpy(name, species->name, TREEPIECES_MAX_NAME);
    name[TREEPIECES_MAX_NAME] = 0;
    if (name[0]) {
        tpc_write(&w, "name ");
        tpc_write(&w, name);
        tpc_write(&w, "\n");
    }
    tpc_write_fields(&w, tpc_fields, TPC_FIELDS, species);
    for (int k = 0; k < species->order_count && k < TREEPIECES_MAX_ORDERS; k++) {
        snprintf(order, sizeof order, "\norder %d\n", k);
        tpc_write(&w, order);
        tpc_write_fields(&w, tpc_order_fields, TPC_ORDER_FIELDS, &species->orders[k]);
    }
    if (w.capacity) w.text[w.length < w.capacity ? w.length : w.capacity - 1] = 0;
    return w.length;
}

TREEPIECES_API txm_status treepieces_preset(const char *name, txm_env *env,
                                            treepieces_species *species) {
    char line[240];
    if (!name || !species) return txm_fail(env, TXM_BAD_ARGUMENT, "name or species is NULL");
    for (int i = 0; i < treepieces_preset_count(); i++) {
        if (strcmp(name, tpc_presets[i].name) != 0) continue;
        const char *text = tpc_presets[i].text;
        return treepieces_species_parse(text, strlen(text), env, species);
    }
    int n = snprintf(line, sizeof line, "no species \"%.24s\"; there are", name);
    for (int i = 0; i < treepieces_preset_count() && n > 0 && (size_t)n < sizeof line; i++)
        n += snprintf(line + n, sizeof line - (size_t)n, "%s %s", i ? "," : "",
                      tpc_presets[i].name);
    return txm_fail(env, TXM_BAD_ARGUMENT, line);
}

/* ---- space: which stems are near --------------------------------------------------------- */

enum {
    TPC_SPACE_CELLS = 8 /* a stem is entered in at most so many; longer ones in a list of their own */
};

/* The axis of a piece, which is thought to be a straight cone with round ends. */
typedef struct tpc_limb {
    float from[3], to[3];
    float radius, end; /* at its ends, metres */
    int32_t parent;    /* of its segment      */
    float middle[3], half; /* half its length */
} tpc_limb;

/* Set the middle of a limb and half its length. */
static void tpc_limb_measure(tpc_limb *limb) {
    float half[3];
    for (int k = 0; k < 3; k++) {
        half[k] = 0.5f * (limb->to[k] - limb->from[k]);
        limb->middle[k] = limb->from[k] + half[k];
    }
    limb->half = sqrtf(tpc_dot(half, half));
}

/* A stem in a cell. */
typedef struct tpc_entry {
    int32_t next, limb;
} tpc_entry;

/* The stems of a tree that grows, found by cells of a grid. */
typedef struct tpc_space {
    tpc_limb *limbs;    /* by node; as many as the tree may have                                */
    tpc_entry *entries; /* TPC_SPACE_CELLS for each                                             */
    int32_t *heads;     /* of lists of entries, by a hash of cells: 2^bits                      */
    int32_t long_ones;
    int limb_count, entry_count, capacity, bits; /* capacity: of stems */
    float per_metre;                             /* cells              */
} tpc_space;

/* Room for a tree of so many pieces; 0 if there is no memory. */
static int tpc_space_make(tpc_space *s, int capacity, txm_arena *arena) {
    s->capacity = capacity;
    s->bits = 3;
    while (1 << s->bits < capacity) s->bits++;
    s->limbs = (tpc_limb *)txm_arena_alloc(arena, (size_t)capacity, sizeof *s->limbs);
    s->entries = (tpc_entry *)txm_arena_alloc(arena, (size_t)capacity * TPC_SPACE_CELLS, sizeof *s->entries);
    s->heads = (int32_t *)txm_arena_alloc(arena, (size_t)1 << s->bits, sizeof *s->heads);
    return !arena->failed;
}

/* cell: its side in metres, > 0 */
static void tpc_space_clear(tpc_space *s, float cell) {
    s->limb_count = s->entry_count = 0;
    s->long_ones = -1;
    s->per_metre = 1 / cell;
    for (int i = 0; i < 1 << s->bits; i++) s->heads[i] = -1;
}

/* The cells that a stem may reach into: the least and the greatest along each axis. */
static int tpc_space_range(const tpc_space *s, const tpc_limb *limb, int least[3], int most[3]) {
    const float r = txm_maxf(limb->radius, limb->end);
    int cells = 1;
    for (int k = 0; k < 3; k++) {
        const float low = (txm_minf(limb->from[k], limb->to[k]) - r) * s->per_metre;
        const float high = (txm_maxf(limb->from[k], limb->to[k]) + r) * s->per_metre;
        least[k] = (int)txm_clampf(low, -1e8f, 1e8f) - (low < 0);
        most[k] = (int)txm_clampf(high, -1e8f, 1e8f) - (high < 0);
        const int across = most[k] - least[k] + 1;
        cells = across > TPC_SPACE_CELLS ? TPC_SPACE_CELLS + 1 : cells * across;
        if (cells > TPC_SPACE_CELLS) return cells;
    }
    return cells;
}

static int32_t *tpc_space_head(tpc_space *s, int x, int y, int z) {
    const uint32_t h = (uint32_t)x * 0x9e3779b1u ^ (uint32_t)y * 0x85ebca77u ^ (uint32_t)z * 0xc2b2ae3du;
    return &s->heads[h >> (32 - s->bits)];
}

static void tpc_space_enter(tpc_space *s, int32_t *head) {
    TXM_ASSERT(s->entry_count < s->capacity * TPC_SPACE_CELLS);
    tpc_entry *e = &s->entries[s->entry_count];
    e->next = *head;
    e->limb = s->limb_count;
    *head = s->entry_count++;
}

/* Add the stem of the next node. */
static void tpc_space_add(tpc_space *s, const tpc_limb *limb) {
    int least[3], most[3];
    TXM_ASSERT(s->limb_count < s->capacity);
    s->limbs[s->limb_count] = *limb;
    if (tpc_space_range(s, limb, least, most) > TPC_SPACE_CELLS) {
        tpc_space_enter(s, &s->long_ones);
    } else {
        for (int x = least[0]; x <= most[0]; x++)
            for (int y = least[1]; y <= most[1]; y++)
                for (int z = least[2]; z <= most[2]; z++)
                    tpc_space_enter(s, tpc_space_head(s, x, y, z));
    }
    s->limb_count++;
}

/* ---- space: do stems touch ---------------------------------------------------------------- */

/* The nearest places of two axes, 0..1 along each; returns the square of their distance. away: from
   the place on b to that on a. */
static float tpc_nearest(const tpc_limb *a, const tpc_limb *b, float *along_a, float *along_b,
                         float away[3]) {
    float u[3], v[3], w[3];
    for (int k = 0; k < 3; k++) {
        u[k] = a->to[k] - a->from[k];
        v[k] = b->to[k] - b->from[k];
        w[k] = a->from[k] - b->from[k];
    }
    const float uu = tpc_dot(u, u), vv = tpc_dot(v, v), uv = tpc_dot(u, v);
    const float uw = tpc_dot(u, w), vw = tpc_dot(v, w), area = uu * vv - uv * uv;
    const float tiny = 1e-20f;
    float s = area > 1e-6f * uu * vv ? txm_clampf((uv * vw - uw * vv) / area, 0, 1) : 0;
    float t = (uv * s + vw) / (vv > tiny ? vv : tiny);
    if (t < 0 || t > 1) {
        t = t < 0 ? 0 : 1;
        s = txm_clampf((t * uv - uw) / (uu > tiny ? uu : tiny), 0, 1);
    }
    for (int k = 0; k < 3; k++) away[k] = w[k] + (s * u[k] - t * v[k]);
    *along_a = s;
    *along_b = t;
    return tpc_dot(away, away);
}

/* Do the stems come nearer to each other than `clearance` times the sum of their radii there? along:
   receives how far along the axis of `a`, metres. */
static int tpc_limbs_touch(const tpc_limb *a, const tpc_limb *b, float clearance, float *along, float away[3]) {
    float s, t, square = tpc_nearest(a, b, &s, &t, away);
    const float radii = txm_lerpf(a->radius, a->end, s) + txm_lerpf(b->radius, b->end, t);
    if (square >= clearance * clearance * radii * radii) return 0;
    const float axis[3] = {a->to[0] - a->from[0], a->to[1] - a->from[1], a->to[2] - a->from[2]};
    *along = s * sqrtf(tpc_dot(axis, axis));
    return 1;
}

/* Do the stem of a node to come and that of a node that is there come from one fork a few pieces below? */
static int tpc_is_kin(const tpc_space *s, int32_t parent, int32_t other) {
    enum { GENERATIONS = 6 };
    for (int up = 0; up < GENERATIONS && parent != other; up++) {
        if (parent > other) parent = s->limbs[parent].parent;
        else other = s->limbs[other].parent;
    }
    return parent == other;
}

/* Is a stem, not yet added, too near to another one? Its parent, that one's parent and its other
   children do not count; neither do kin near the fork, up to a distance of `fork` along the stem. */
static int tpc_limb_hits(const tpc_space *s, const tpc_limb *limb, int32_t other, float clearance,
                         float fork, float away[3]) {
    const int32_t up = limb->parent;
    const tpc_limb *b = &s->limbs[other];
    const float between[3] = {limb->middle[0] - b->middle[0], limb->middle[1] - b->middle[1],
                              limb->middle[2] - b->middle[2]};
    const float thick = txm_maxf(limb->radius, limb->end) + txm_maxf(b->radius, b->end);
    const float reach = limb->half + b->half + clearance * thick;
    if (tpc_dot(between, between) > reach * reach) return 0; /* the usual case */
    float along;
    if (other == up || other == s->limbs[up].parent || s->limbs[other].parent == up) return 0;
    return tpc_limbs_touch(limb, &s->limbs[other], clearance, &along, away) &&
           (along > fork || !tpc_is_kin(s, up, other));
}

/* The number of a stem to which one with a parent, not yet added, comes too near, or TREEPIECES_NONE. away:
   receives the direction out of it, not normalized. fork: see tpc_limb_hits. */
static int32_t tpc_space_touches(tpc_space *s, const tpc_limb *limb, float clearance, float fork, float away[3]) {
    int least[3], most[3];
    tpc_limb wide = *limb;
    wide.radius *= clearance;
    wide.end *= clearance;
    const int cells = tpc_space_range(s, &wide, least, most);
    if (cells > TPC_SPACE_CELLS) { /* rare: look at all */
        for (int32_t i = 0; i < s->limb_count; i++)
            if (tpc_limb_hits(s, limb, i, clearance, fork, away)) return i;
        return TREEPIECES_NONE;
    }
    for (int32_t e = s->long_ones; e >= 0; e = s->entries[e].next)
        if (tpc_limb_hits(s, limb, s->entries[e].limb, clearance, fork, away)) return s->entries[e].limb;
    for (int x = least[0]; x <= most[0]; x++)
        for (int y = least[1]; y <= most[1]; y++)
            for (int z = least[2]; z <= most[2]; z++)
                for (int32_t e = *tpc_space_head(s, x, y, z); e >= 0; e = s->entries[e].next)
                    if (tpc_limb_hits(s, limb, s->entries[e].limb, clearance, fork, away)) return s->entries[e].limb;
    return TREEPIECES_NONE;
}

/* ---- the sketch of a tree ------------------------------------------------------------------ */

/* A tree is sketched first: axis by axis, the most important ones first, each in full detail from its
   base to its end. Pieces are made of the sketch afterwards, see assemble.h. Where no branch was
   sketched a fork or side branch is a tube, and tubes that follow one another become one, as far as
   the limit on pieces demands. What is sketched does not depend on the limit, only where it stops: so
   trees of all limits have one skeleton, of which small ones lack the least axes. */

/* By how much tubes are longer in trees of fewer pieces. */
static float tpc_stretch(int most) {
    return txm_clampf(sqrtf(2400 / (float)most), 1, 6);
}

/* By how much tubes cut corners, in base radii of the trunk: in large trees so little that they still keep
   clear of others. */
static float tpc_deviation(int most) {
    const float few = 600 / (float)most;
    return 0.15f * few * few * few * few;
}

/* The number of segments in a tube at most; a step is one, or one with a branch and what is left. */
static int tpc_most_joined(float stretch) {
    return (int)(2 * stretch) + 1;
}

/* A piece as the grammar has it. */
typedef struct tpc_segment {
    uint64_t seed;
    float position[3], rotation[4]; /* of the piece, as of the rim in tpc_bud                   */
    float stem[3];                  /* its axis, unit length                                    */
    float radius, length, ratios[TREEPIECES_MAX_LEAVES]; /* metres; over radius                 */
    float part;                     /* of its length that bears the branches, a piece of its own */
    float along, axis_length, step, end_radius;          /* of the axis, see tpc_bud            */
    float longest;                  /* length of a tube that begins here, for the sake of its bark */
    int32_t axis, node;                                  /* node: of its piece, set at the end  */
    uint16_t depth;
    uint8_t type, order, is_forked, leaves;
    uint8_t main;   /* leaf rim where the axis goes on                                          */
    uint8_t begins; /* 1: the first one of a piece                                              */
    uint8_t grown;  /* bit k: an axis begins at leaf rim k                                      */
    uint8_t across; /* log2 of the tiles across an edge of its leaf rims, set at the end        */
} tpc_segment;

/* A chain of segments. */
typedef struct tpc_axis {
    int32_t first, end;  /* its segments                                                        */
    int32_t parent, rim; /* the segment where it begins, or TREEPIECES_NONE, and its leaf rim   */
} tpc_axis;

typedef struct tpc_sketch {
    tpc_segment *segments; /* a chain has consecutive numbers                                   */
    tpc_axis *axes;
    int segment_count, axis_count, pieces; /* pieces: of all that is sketched                   */
    int is_rigid;                          /* every segment is one piece, and every leaf rim one axis */
    int most_joined;                       /* segments in a tube                                */
    float stretch;                         /* longest tube, in steps of its axis                */
    float taper;                           /* least radius of a tube above over that below      */
    float deviation;                       /* of a tube from the joints it replaces, metres     */
} tpc_sketch;

/* Does the type lose branches that are not sketched? */
static int tpc_is_elastic(const tpc_sketch *s, int type) {
    return !s->is_rigid && (type == TREEPIECES_SIDE || type == TREEPIECES_PLANAR || type == TREEPIECES_Y);
}

/* Is it a stem whose branches need only a part of its length? */
static int tpc_bears_branches(const tpc_sketch *s, int type) {
    return !s->is_rigid && (type == TREEPIECES_SIDE || type == TREEPIECES_PLANAR);
}

/* A segment that is, or can be a part of, a tube. */
static int tpc_is_plain(const tpc_sketch *s, const tpc_segment *t) {
    return !s->is_rigid && (t->type == TREEPIECES_I || (tpc_is_elastic(s, t->type) && !t->grown));
}

/* A tube that is made of segments. */
typedef struct tpc_run {
    const tpc_segment *first; /* NULL: none yet */
    float length;
    int count;
} tpc_run;

/* Would the tube with one more segment remain near enough to the joint below that one? */
static int tpc_is_straight(const tpc_sketch *s, const tpc_segment *first, const tpc_segment *t) {
    float joint[3], end[3];
    for (int k = 0; k < 3; k++) {
        joint[k] = t->position[k] - first->position[k];
        end[k] = joint[k] + t->length * t->stem[k];
    }
    const float square = tpc_dot(end, end), dot = tpc_dot(joint, end);
    const float aside = s->deviation;
    return tpc_dot(joint, joint) * square - dot * dot <= aside * aside * square &&
           tpc_dot(first->stem, t->stem) > (first->along > 0 ? 0.86f : 0.97f);
}

/* Does the next segment of a chain begin a piece? Otherwise it becomes a part of the tube. */
static int tpc_run_take(const tpc_sketch *s, tpc_run *run, const tpc_segment *t) {
    const int is_plain = tpc_is_plain(s, t);
    if (run->first && is_plain && run->count < s->most_joined &&
        run->length + t->length <= txm_minf(s->stretch * run->first->step, run->first->longest) &&
        t->radius * t->ratios[t->main] > s->taper * run->first->radius && tpc_is_straight(s, run->first, t)) {
        run->length += t->length;
        run->count++;
        return 0;
    }
    run->first = is_plain ? t : NULL;
    run->length = t->length;
    run->count = 1;
    return 1;
}

/* By how many pieces does the tree grow when an axis begins at a leaf rim of a segment? The tip that
   closes a rim of a piece that loses none is counted already. Where the segment becomes a piece of its
   own, the tube after it begins anew, and so may some that follow; is_made: take note of them. */
static int tpc_split(tpc_sketch *s, int32_t at, int is_made) {
    tpc_segment *t = &s->segments[at];
    if (!tpc_is_elastic(s, t->type)) return -1;
    if (t->grown) return 0;
    const int32_t end = s->axes[t->axis].end;
    tpc_run run = {NULL, 0, 0};
    int more = !t->begins + (t->part < t->length);
    if (is_made) t->begins = 1;
    for (int32_t i = at + 1; i < end; i++) {
        tpc_segment *next = &s->segments[i];
        const int begins = tpc_run_take(s, &run, next);
        if (begins && next->begins) break; /* as before from here on */
        more += begins - next->begins;
        if (is_made) next->begins = (uint8_t)begins;
    }
    return more;
}

/* ---- growing: the state of a tree --------------------------------------------------------- */

enum {
    TPC_FRAME = 8,         /* axes that decide how high the tree is                         */
    TPC_BUCKETS = 160,     /* of leaf rims that wait for an axis, by the logarithm of its length */
    TPC_GRID = 16,         /* cells along a side of the shade grid                          */
    TPC_FORK = 2,          /* radii of a stem, up to where it may touch others of its fork  */
    TPC_MAX_BRANCH = 60    /* percent: largest radius of a side branch over that of its stem */
};

/* Ours, see docs/choices.md#choices-in-treepiecesh; how many tiles lie across a quad, how thin twigs
   get, where shade is counted, and where hanging axes end. */
static const float tpc_tile_width = 0.1f;     /* wanted, in base radii of the trunk             */
static const float tpc_halving_width = 0.58f; /* of that: narrower tiles are halved in number   */
static const float tpc_twig_radius = 0.033f;  /* the least, in base radii of the trunk          */
static const float tpc_grid_width = 1.6f;     /* of the shade grid, in trunk lengths            */
static const float tpc_clearance = 0.04f;     /* above the ground, in trunk lengths             */
static const float tpc_cell_steps = 1.25f;    /* of the grid of stems, in steps of the trunk    */

static const float tpc_dome = 0.8f;           /* fall of the dome over crowns, see tpc_limit_rise  */
static const float tpc_slack = 0.8f;          /* more clearance, as tubes cut corners             */
static const float tpc_beyond = 10;          /* importance of reach beyond the crown, over length */
static const float tpc_waiting = 100;        /* of axes in the shade, over the share of pieces above */
static const float tpc_rise = 0.5f;          /* of axes towards the light, over their turn aside     */

/* The open rim where an axis goes on. */
typedef struct tpc_bud {
    uint64_t seed;                /* of all that is drawn for its piece and those beyond it     */
    int32_t parent;               /* segment, or TREEPIECES_NONE                                */
    uint8_t rim, order;
    uint8_t is_forked, is_aimed;  /* after a fork, where `start` no longer applies; `aim` is the
                                     direction of the piece after this one                      */
    uint16_t depth;
    float position[3], rotation[4], axis[3]; /* of the rim, from the foot of the tree, but turned as
                                     in the world; axis: its y axis                             */
    float heading[3];             /* of growth                                                  */
    float aim[3];
    float radius, end_radius;     /* here, and at the end of the axis                           */
    float rest;                   /* of its step, which a short branching piece left over for a
                                     plain one                                                  */
    float along, length, step;    /* of the axis; step: length of a piece                       */
    float roll;                   /* degrees about the axis to the next branch, in the
                                     frame of the rim                                           */
} tpc_bud;

/* A leaf rim that waits for its axis. */
typedef struct tpc_wait {
    int32_t next; /* in its bucket                                                    */
    int32_t segment, rim;
    float length, end[3]; /* what is expected of the axis: how long it is, and where it ends;
                             length is less for those that may leave gaps */
} tpc_wait;

/* A tree while it grows. */
typedef struct tpc_growth {
    const treepieces_forest_desc *desc;
    const treepieces_kit *kit;
    const treepieces_species *species;
    treepieces_place place;
    txm_rng rng;
    txm_status status;
    const char *fault;
    int index; /* of the tree */
    treepieces_node *nodes;
    uint32_t *bands;   /* by node: word 3 of its record        */
    uint32_t *records; /* by node: number of its record, set at the end */
    treepieces_cluster *clusters;
    tpc_sketch sketch;
    tpc_run run; /* of the axis that grows */
    tpc_wait *waits;
    int node_count, cluster_count, wait_count, most, most_segments, bucket;
    int32_t first[TPC_BUCKETS], last[TPC_BUCKETS];
    uint32_t type_counts[TREEPIECES_MAX_TYPES];
    float scale, trunk, foot; /* scale of the place; length and base radius of the trunk, metres  */
    float height;
    float low[3], high[3];          /* of the box about all stems that have grown                 */
    float ceiling;                  /* no later stem grows above this                             */
    float aside[TREEPIECES_MAX_ORDERS][2][2]; /* cosine and sine of angle_base and angle_top        */
    uint16_t shade[TPC_GRID][TPC_GRID][TPC_GRID]; /* x, z, y: pieces in this cell and above       */
    tpc_space space; /* where the species has a clearance */
} tpc_growth;

static float tpc_uniform(tpc_growth *g, float low, float high) {
    return low + (high - low) * txm_rng_float(&g->rng);
}

/* What is drawn at an open rim depends on its seed alone, not on what grew elsewhere before: a tree of
   fewer pieces is part of one of more. */
enum { TPC_OPENING = 1, TPC_ATTACHING, TPC_LEAFING }; /* streams */

static void tpc_draw_for(tpc_growth *g, uint64_t seed, uint64_t stream) {
    g->rng = txm_rng_make(seed, stream);
}

/* ---- growing: light --------------------------------------------------------------------------- */

/* the shade cell of a position; returns the side of a cell */
static float tpc_cell(const tpc_growth *g, const float position[3], int cell[3]) {
    const float side = tpc_grid_width * g->trunk / (float)TPC_GRID;
    for (int k = 0; k < 3; k++) {
        const float middle = k == 1 ? 0 : (float)TPC_GRID / 2;
        const float at = position[k] / side + middle;
        cell[k] = at > 0 ? at < (float)TPC_GRID ? (int)at : TPC_GRID - 1 : 0;
    }
    return side;
}

static int tpc_casts_shade(const treepieces_species *species) {
    return species->shade > 0 || species->phototropism > 0;
}

static void tpc_cast_shade(tpc_growth *g, const float position[3]) {
    int c[3];
    if (!tpc_casts_shade(g->species)) return;
    tpc_cell(g, position, c);
    uint16_t *column = g->shade[c[0]][c[2]];
    for (int y = 0; y <= c[1]; y++) column[y] = (uint16_t)(column[y] + (column[y] < UINT16_MAX));
}

/* The part of all pieces that lies above a position. */
static float tpc_shade_share(const tpc_growth *g, const float position[3]) {
    int c[3];
    tpc_cell(g, position, c);
    return (float)g->shade[c[0]][c[2]][c[1]] / (float)g->sketch.segment_count;
}

/* Towards the light: from where more pieces are above to where fewer are; each component -1..1. */
static void tpc_find_light(const tpc_growth *g, const float position[3], float towards[3]) {
    int c[3];
    tpc_cell(g, position, c);
    for (int k = 0; k < 3; k++) {
        int before[3] = {c[0], c[1], c[2]}, after[3] = {c[0], c[1], c[2]};
        if (before[k] > 0) before[k]--;
        if (after[k] + 1 < TPC_GRID) after[k]++;
        const int low = g->shade[before[0]][before[2]][before[1]], high = g->shade[after[0]][after[2]][after[1]];
        towards[k] = (float)(low - high) / (float)(low + high + 1);
    }
}

/* ---- growing: rims by the importance of their axes ------------------------------------------ */

/* The bits of a positive float, which grow about as its logarithm, by 2^23 per octave. */
static uint32_t tpc_float_bits(float x) {
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

/* Eight buckets per octave, the most important first: from 2, in lengths of the trunk. */
static int tpc_bucket(float importance) {
    return txm_clampi((int)(0x40000000u >> 20) - (int)(tpc_float_bits(importance) >> 20), 0, TPC_BUCKETS - 1);
}

/* The longer an axis is, and the further it leads out of the box about what has grown so far, the more
   does the tree lose without it; the less light its end gets, the less. */
static float tpc_importance(const tpc_growth *g, const tpc_wait *w) {
    float beyond = 0;
    for (int k = 0; k < 3; k++) {
        beyond = txm_maxf(beyond, (k == 1 ? 2.0f : 1.0f) * (w->end[k] - g->high[k]));
        if (k != 1) beyond = txm_maxf(beyond, g->low[k] - w->end[k]);
    }
    float length = w->length;
    const float light = g->species->phototropism;
    if (light > 0) length /= 1 + tpc_waiting * light * tpc_shade_share(g, w->end);
    return (length + tpc_beyond * beyond) / g->trunk;
}

/* Put a rim after the last one into its bucket. */
static void tpc_push(tpc_growth *g, int32_t i) {
    tpc_wait *w = &g->waits[i];
    const int b = tpc_bucket(tpc_importance(g, w));
    w->next = -1;
    if (g->first[b] < 0) g->first[b] = i;
    else g->waits[g->last[b]].next = i;
    g->last[b] = i;
    if (b < g->bucket) g->bucket = b;
}

/* Take out the most important one, or NULL. Where the tree has grown meanwhile, it waits again. */
static const tpc_wait *tpc_pop(tpc_growth *g) {
    for (;;) {
        while (g->bucket < TPC_BUCKETS && g->first[g->bucket] < 0) g->bucket++;
        if (g->bucket == TPC_BUCKETS) return NULL;
        const int b = g->bucket;
        const int32_t i = g->first[b];
        g->first[b] = g->waits[i].next;
        if (tpc_bucket(tpc_importance(g, &g->waits[i])) <= b) return &g->waits[i];
        tpc_push(g, i);
    }
}

/* ---- growing: pruning ---------------------------------------------------------------------- */

static int tpc_is_outside(const tpc_growth *g, const tpc_bud *bud) {
    const treepieces_species *s = g->species;
    if (s->envelope == TREEPIECES_FREE) return 0;
    const float x = bud->position[0], z = bud->position[2];
    const float y = bud->position[1] / g->trunk;
    const float h = (y - s->crown_base) / (s->crown_top - s->crown_base);
    if (h > 1) return 1;
    if (bud->order == 0) return 0;
    if (h < 0) return 1;
    float r = 0.5f * s->crown_width * g->trunk;
    if (s->envelope == TREEPIECES_CONE) r *= 1 - h;
    if (s->envelope == TREEPIECES_ELLIPSOID) r *= sqrtf(1 - (2 * h - 1) * (2 * h - 1));
    return x * x + z * z > r * r;
}

static int tpc_is_shaded(const tpc_growth *g, const tpc_bud *bud) {
    if (!(g->species->shade > 0) || bud->order == 0) return 0;
    int c[3];
    const float side = tpc_cell(g, bud->position, c) / g->scale;
    if (c[1] + 1 >= TPC_GRID) return 0;
    return (float)g->shade[c[0]][c[2]][c[1] + 1] > g->species->shade * side * side;
}

/* ---- growing: the grammar ------------------------------------------------------------------ */

static const treepieces_order *tpc_order(const tpc_growth *g, int order) {
    return &g->species->orders[order < g->species->order_count ? order : g->species->order_count - 1];
}

/* Choose the type of the next piece. */
static int tpc_choose_type(tpc_growth *g, const tpc_bud *bud) {
    const treepieces_order *o = tpc_order(g, bud->order);
    if (bud->depth == 0 && g->species->flare > 1) return TREEPIECES_FLARE;
    if ((1 - bud->along) * bud->length < 0.5f * bud->step || tpc_is_outside(g, bud) ||
        tpc_is_shaded(g, bud) || bud->position[1] > g->ceiling)
        return TREEPIECES_TIP;
    /* a hanging axis ends before it reaches the ground */
    if (bud->heading[1] < 0 && bud->position[1] < tpc_clearance * g->trunk)
        return TREEPIECES_TIP;
    if (g->desc->rule == TREEPIECES_ALTERNATE) return bud->depth & 1 ? TREEPIECES_Y : TREEPIECES_I;
    if (g->desc->rule == TREEPIECES_RANDOM)
        return txm_rng_next(&g->rng) >> 31 ? TREEPIECES_Y : TREEPIECES_I;
    float dice = txm_rng_float(&g->rng);
    if ((!bud->is_forked && bud->along < o->start) || (bud->along == 0 && bud->order > 0))
        return TREEPIECES_I; /* a branch's first piece does not twist */
    if (bud->rest > 0) return TREEPIECES_I;
    if (bud->order + 1 < g->species->order_count) {
        if ((dice -= o->side) < 0) return TREEPIECES_SIDE;
        if ((dice -= o->pair) < 0) return TREEPIECES_PLANAR;
    }
    if ((dice -= o->fork) < 0) return TREEPIECES_Y;
    if (dice < o->triple) return TREEPIECES_SPATIAL;
    return TREEPIECES_I;
}

/* The smallest radius of twigs, so that texels are not much smaller on them than on the trunk. */
static float tpc_thinnest(const tpc_growth *g) {
    return tpc_twig_radius * g->foot;
}

/* The least length of a piece, in radii, at which its type keeps its proportions. */
static float tpc_shortest(int type) {
    static const float low[TREEPIECES_BUILTIN] = {1, 1, 2, 2, 1, 1.2f, 1};
    return low[type];
}

/* log2 of the tiles across an edge of a rim, as tpc_bands comes to it. */
static int tpc_tiles_across(const tpc_growth *g, float radius) {
    int across = 0;
    while (across < 4 && radius >= tpc_halving_width * tpc_tile_width * g->foot * (float)(2 << across))
        across++;
    return across;
}

/* The most length of a piece, in radii: at most 8 tiles lie along a quad, so one with many across must not be
   long. */
static float tpc_tallest(const tpc_growth *g, float radius, int type) {
    static const float high[TREEPIECES_BUILTIN] = {40, 2.5f, 3, 3, 2.5f, 18, 1.4f};
    const int across = tpc_tiles_across(g, radius);
    return txm_minf(high[type], (type == TREEPIECES_I ? 64.0f : 20.0f) / (float)(1 << across));
}

/* The length of the next segment, limited to a range of radii so that its type keeps its proportions. */
static float tpc_choose_length(const tpc_growth *g, const tpc_bud *bud, int type) {
    const float low = tpc_shortest(type);
    const float left = (1 - bud->along) * bud->length;
    const float step = bud->rest > 0 ? bud->rest : bud->step;
    float length = step < left ? step : left;
    if (type == TREEPIECES_TIP && length < 0.7f * bud->step) length = 0.7f * bud->step;
    const int as = tpc_bears_branches(&g->sketch, type) ? (int)TREEPIECES_I : type;
    const float most = tpc_tallest(g, bud->radius, as);
    return txm_clampf(length, low * bud->radius, txm_maxf(most, low) * bud->radius);
}

static void tpc_choose(tpc_growth *g, const tpc_bud *bud, treepieces_choice *c) {
    const treepieces_order *o = tpc_order(g, bud->order);
    const int type = tpc_choose_type(g, bud);
    memset(c, 0, sizeof *c);
    c->type = type;
    memcpy(c->direction, bud->heading, sizeof c->direction);
    c->length = tpc_choose_length(g, bud, type);
    c->turn = type == TREEPIECES_I ? (int)txm_rng_below(&g->rng, TREEPIECES_RIM) : -1;
    const float left = (1 - bud->along) * bud->length;
    const float share = left > c->length ? c->length / left : 1;
    const float on = 1 + (bud->end_radius / bud->radius - 1) * share; /* the taper of the stem */
    c->ratios[0] = txm_clampf(on, 0.3f, 1);
    if (type == TREEPIECES_FLARE) c->ratios[0] = 1 / g->species->flare;
    if (type == TREEPIECES_Y) {
        const float uneven = tpc_uniform(g, -0.14f, 0.14f);
        c->ratios[0] = 0.76f + uneven;
        c->ratios[1] = 0.76f - uneven;
    } else if (type == TREEPIECES_SPATIAL) {
        for (int k = 0; k < 3; k++) c->ratios[k] = tpc_uniform(g, 0.54f, 0.72f);
    }
    if (type == TREEPIECES_Y || type == TREEPIECES_SPATIAL) {
        const float least = txm_minf(1, tpc_thinnest(g) / bud->radius);
        for (int k = 0; k < 3; k++) c->ratios[k] = txm_maxf(c->ratios[k], least);
    } else if (type == TREEPIECES_SIDE || type == TREEPIECES_PLANAR) {
        const float ratio = tpc_order(g, bud->order + 1)->radius, thinnest = tpc_thinnest(g);
        for (int k = 1; k < 3; k++)
            c->ratios[k] = txm_clampf(txm_maxf(ratio * tpc_uniform(g, 0.85f, 1.15f), thinnest / bud->radius),
                                      0.05f, (float)TPC_MAX_BRANCH / 100);
    }
    c->leaves = g->species->leaf_count > 0 && bud->along >= o->leaves_start && o->leaves > 0 &&
                txm_rng_float(&g->rng) < o->leaves;
}

/* The first axes decide how high the tree is: others rise less and less under a dome as high, and end there. */
static void tpc_limit_rise(const tpc_growth *g, tpc_bud *bud) {
    const float x = bud->position[0], z = bud->position[2];
    const float room = g->ceiling - bud->position[1] - tpc_dome * (x * x + z * z) / g->trunk;
    if (bud->heading[1] * 3 * bud->step <= room || bud->heading[1] <= 0) return;
    bud->heading[1] = txm_maxf(room / (3 * bud->step), 0);
    tpc_unit_or_up(bud->heading);
    if (room < 0.5f * bud->step) bud->along = 1;
}

/* Turn the axis a little: wander, tropism, light, sag. */
static void tpc_steer(tpc_growth *g, tpc_bud *bud, float length) {
    const treepieces_order *o = tpc_order(g, bud->order);
    float *h = bud->heading;
    const float degree = 0.0174532925f;
    if (o->wander > 0) {
        float aside[3] = {tpc_uniform(g, -1, 1) * o->wander * degree, 0, 0};
        aside[2] = tpc_uniform(g, -1, 1) * o->wander * degree;
        tpc_rotate(bud->rotation, aside, aside);
        for (int k = 0; k < 3; k++) h[k] += aside[k];
    }
    /* the component of "up" orthogonal to the heading is the sine of the angle between them */
    const float up = o->tropism, rise = h[1], light = bud->order > 0 ? g->species->phototropism : 0;
    h[0] -= up * rise * h[0];
    h[1] += up * (1 - rise * rise);
    h[2] -= up * rise * h[2];
    if (light > 0) {
        float towards[3];
        tpc_find_light(g, bud->position, towards);
        for (int k = 0; k < 3; k++) h[k] += (k == 1 ? tpc_rise : 1) * light * towards[k];
    }
    if (o->sag != 0) {
        const float at = bud->along + 0.5f * length / bud->length;
        const float fall = o->sag * degree * 2 * at * (length / bud->length);
        h[1] -= fall * sqrtf(h[0] * h[0] + h[2] * h[2] + 0.02f);
    }
    tpc_unit_or_up(h);
}

/* ---- growing: a piece on a rim ------------------------------------------------------------- */

static const float tpc_turns[TREEPIECES_RIM][4] = {
    {0, 0, 0, 1},           {0, 0.5f, 0, 0.86602540378f},  {0, 0.86602540378f, 0, 0.5f},
    {0, 1, 0, 0},           {0, 0.86602540378f, 0, -0.5f}, {0, 0.5f, 0, -0.86602540378f},
};

/* out = a b, where the building rotation is skipped when it is the identity, the usual case */
static void tpc_multiply_building(const float building[4], const float b[4], float out[4]) {
    if (building[3] < 1) tpc_multiply(building, b, out);
    else memcpy(out, b, 4 * sizeof *b);
}
static void tpc_multiply_by_building(const float a[4], const float building[4], float out[4]) {
    if (building[3] < 1) tpc_multiply(a, building, out);
    else memcpy(out, a, 4 * sizeof *a);
}

/* The nearest multiple of 60 degrees, as 0..5, and the rest, -30..30 degrees. */
static int tpc_nearest_sixth(float degrees, float *rest) {
    const float turns = degrees / 60;
    const int whole = (int)(turns + (turns < 0 ? -0.5f : 0.5f));
    *rest = degrees - 60 * (float)whole;
    return (whole % TREEPIECES_RIM + TREEPIECES_RIM) % TREEPIECES_RIM;
}

/* Turn a frame so that its y axis, `axis`, comes to lie along `heading`, by the shortest rotation. Both are
   unit vectors; the heading is limited to 60 degrees from the axis. out may be the frame. */
static void tpc_turn_to(const float axis[3], float heading[3], const float frame[4], float out[4]) {
    float cosine = tpc_dot(axis, heading), across[3];
    if (cosine < 0.5f) {
        for (int k = 0; k < 3; k++) heading[k] -= cosine * axis[k];
        const float level = sqrtf(tpc_dot(heading, heading));
        const float shrink = level > 0 ? 0.86602540378f / level : 0;
        cosine = level > 0 ? 0.5f : 1;
        for (int k = 0; k < 3; k++) heading[k] = cosine * axis[k] + shrink * heading[k];
    }
    tpc_cross(axis, heading, across);
    const float scale = 1 / sqrtf(tpc_dot(across, across) + (1 + cosine) * (1 + cosine));
    const float arc[4] = {scale * across[0], scale * across[1], scale * across[2], scale * (1 + cosine)};
    tpc_multiply(arc, frame, out);
}

/* A thick branch at a small angle to its stem would have its rim inside the stem, and a pocket
   above it. Its first piece therefore leads away from the stem as far as necessary, and the next
   one takes the intended direction. */
static void tpc_stand_off(tpc_bud *bud, const float stem[3], const float out[3], float ratio,
                          float offset) {
    const float most = txm_clampf((offset - 1.1f) / ratio, 0, 0.68f), cosine = tpc_dot(bud->heading, stem);
    bud->is_aimed = cosine > most;
    if (!bud->is_aimed) return;
    memcpy(bud->aim, bud->heading, sizeof bud->aim);
    const float sine = sqrtf(1 - most * most);
    for (int i = 0; i < 3; i++) bud->heading[i] = most * stem[i] + sine * out[i];
}

/* The heading at so many degrees from the stem, towards `out`. */
static void tpc_turn_aside(tpc_bud *bud, float degrees, const float stem[3], const float out[3]) {
    double sine, cosine;
    txm_sincos((double)degrees * (TXM_PI / 180), &sine, &cosine);
    const float ahead = txm_float(cosine), aside = txm_float(sine);
    for (int i = 0; i < 3; i++) bud->heading[i] = ahead * stem[i] + aside * out[i];
}

/* How a piece sits on a rim. */
typedef struct tpc_seat {
    float after;       /* what is left of the bud's roll, degrees                       */
    float stem[3];     /* the axis of the piece, unit length                            */
    float rotation[4]; /* in the world                                                  */
} tpc_seat;

/* The piece is turned about the rim's axis, then its stem grows along the direction chosen. A tube of a
   sketch need not turn. */
static void tpc_seat_piece(const tpc_growth *g, const tpc_bud *bud, const treepieces_choice *c, tpc_seat *seat) {
    int turn = c->turn;
    float twist = 0;
    memcpy(seat->stem, c->direction, sizeof seat->stem);
    tpc_unit_or_up(seat->stem);
    if (turn < 0) turn = tpc_nearest_sixth(bud->roll, &twist);
    if (c->type == TREEPIECES_I && !g->sketch.is_rigid) turn = 0;
    seat->after = bud->roll - (60 * (float)turn + twist);
    tpc_turn_to(bud->axis, seat->stem, bud->rotation, seat->rotation);
    if (turn) tpc_multiply(seat->rotation, tpc_turns[turn], seat->rotation);
    if (twist != 0) { /* t: tangent of half the twist, 15 degrees at most */
        const float x = twist * 0.00872664626f, t = x * (1 + x * x * (0.33333333f + 0.13333333f * x * x));
        const float shorter = 1 / sqrtf(1 + t * t), about[4] = {0, t * shorter, 0, shorter};
        tpc_multiply(seat->rotation, about, seat->rotation);
    }
}

/* The stem of a piece that sits so. */
static void tpc_limb_of(const tpc_growth *g, const tpc_bud *bud, const treepieces_choice *c,
                        const tpc_seat *seat, tpc_limb *stem) {
    for (int k = 0; k < 3; k++) {
        stem->from[k] = bud->position[k];
        stem->to[k] = bud->position[k] + c->length * seat->stem[k];
    }
    stem->radius = bud->radius;
    stem->end = g->kit->pieces[c->type].leaf_count ? bud->radius * c->ratios[0] : 0;
    stem->parent = bud->parent;
    tpc_limb_measure(stem);
}

/* The direction from the stem to the middle of leaf rim k, which is not on the axis. */
static void tpc_find_out(const tpc_growth *g, const tpc_segment *from, int k, float out[3]) {
    const float *to = g->kit->pieces[from->type].building[k].translation;
    const float offset = g->kit->offsets[from->type][k];
    out[0] = to[0] / offset;
    out[1] = 0;
    out[2] = to[2] / offset;
    tpc_rotate(from->rotation, out, out);
}

static int tpc_is_fork(int type) {
    return type == TREEPIECES_Y || type == TREEPIECES_SPATIAL;
}

/* The length of an axis that begins at a segment, without what is drawn for it; out: away from the stem
   there. That of a fork counts from the base of the axis that splits. */
static float tpc_expect_length(const tpc_growth *g, const tpc_segment *from, const float out[3]) {
    if (tpc_is_fork(from->type))
        return from->axis_length * tpc_order(g, from->order)->fork_ratio;
    const treepieces_order *o = tpc_order(g, from->order + 1), *parent = tpc_order(g, from->order);
    const float t = from->is_forked || parent->start >= 1
                        ? from->along
                        : txm_clampf((from->along - parent->start) / (1 - parent->start), 0, 1);
    float longer = o->profile[0] * (1 - t) * (1 - 2 * t) + o->profile[1] * 4 * t * (1 - t) +
                   o->profile[2] * t * (2 * t - 1);
    longer *= 1 + o->gravimorphism * out[1];
    return from->axis_length * o->length * txm_clampf(longer, 0.02f, 10);
}

/* 0..1: the digits of a number in reverse behind the binary point. The numbers below any limit are spread
   evenly, and so are those whose result is below one. */
static float tpc_reverse(uint32_t n) {
    float result = 0, bit = 0.5f;
    for (; n; n >>= 1, bit *= 0.5f)
        if (n & 1) result += bit;
    return result;
}

/* Let leaf rim k of a segment wait for its axis; number: of the segment among those of its axis that bear
   any. Among branches side by side every second one is more important, and so on: where some do not
   grow, the others are spread along the stem. */
static void tpc_wait_for_axis(tpc_growth *g, int32_t at, int k, int number) {
    TXM_ASSERT(g->wait_count < (TREEPIECES_MAX_LEAVES - 1) * g->most_segments);
    const tpc_segment *from = &g->sketch.segments[at];
    const float spread = tpc_reverse((uint32_t)number);
    tpc_wait *w = &g->waits[g->wait_count];
    float out[3], ahead = 0.9f, aside = 0.4f; /* of a fork */
    tpc_find_out(g, from, k, out);
    w->segment = at;
    w->rim = k;
    w->length = tpc_expect_length(g, from, out);
    if (tpc_is_fork(from->type)) {
        w->length *= 1 - from->along;
    } else {
        const int order = from->order + 1 < g->species->order_count ? from->order + 1 : from->order;
        ahead = txm_lerpf(g->aside[order][0][0], g->aside[order][1][0], from->along);
        aside = txm_lerpf(g->aside[order][0][1], g->aside[order][1][1], from->along);
    }
    for (int i = 0; i < 3; i++)
        w->end[i] = from->position[i] + from->length * from->stem[i] +
                    w->length * (ahead * from->stem[i] + aside * out[i]);
    if (!tpc_is_fork(from->type)) { /* not only the longest ones */
        const float even = from->axis_length * tpc_order(g, from->order + 1)->length;
        w->length = sqrtf(even * w->length) / (1 + 3 * spread);
    }
    tpc_push(g, g->wait_count++);
}

/* The bud at leaf rim k of a fork: the axis goes on as one of its arms. */
static void tpc_open_arm(tpc_growth *g, const tpc_segment *from, int k, const float out[3], tpc_bud *bud) {
    const treepieces_order *o = tpc_order(g, from->order);
    const int arms = g->kit->pieces[from->type].leaf_count;
    float mean = 0;
    bud->roll = tpc_uniform(g, 60, 120); /* the next fork lies across this one */
    for (int i = 0; i < arms; i++) mean += from->ratios[i] / (float)arms;
    /* the thicker arm is straighter, and the axis itself runs on */
    const float runs_on = k == from->main && !g->sketch.is_rigid ? 0.6f : 1;
    const float straighter = runs_on * txm_clampf(1 - 2.5f * (from->ratios[k] / mean - 1), 0.3f, 1.7f);
    tpc_turn_aside(bud, o->fork_angle * straighter, from->stem, out);
    bud->length = tpc_uniform(g, 0.85f, 1.1f) * tpc_expect_length(g, from, out);
    if (runs_on < 1) bud->length = from->axis_length;
    bud->end_radius =
        txm_maxf(from->end_radius * from->ratios[k], txm_minf(bud->radius, tpc_thinnest(g)));
    bud->is_forked = 1;
    bud->is_aimed = 0;
}

/* The bud at leaf rim k, where a branch begins. */
static void tpc_open_branch(tpc_growth *g, const tpc_segment *from, int k, const float out[3], tpc_bud *bud) {
    const treepieces_order *o = tpc_order(g, from->order + 1);
    if (from->order + 1 < g->species->order_count) bud->order++;
    const float angle = o->angle_base + (o->angle_top - o->angle_base) * from->along +
                        tpc_uniform(g, -1, 1) * o->angle_spread;
    tpc_turn_aside(bud, txm_clampf(angle, 5, 175), from->stem, out);
    bud->heading[1] *= 1 - o->flatten * (1 - from->stem[1] * from->stem[1]);
    tpc_unit_or_up(bud->heading);
    tpc_stand_off(bud, from->stem, out, from->ratios[k], g->kit->offsets[from->type][k]);
    bud->length = tpc_expect_length(g, from, out) * tpc_uniform(g, 1 - o->length_spread, 1 + o->length_spread);
    bud->step = from->axis_length * o->length / o->segments * tpc_uniform(g, 0.9f, 1.1f);
    if (bud->step < 1.5f * bud->radius) bud->step = 1.5f * bud->radius;
    bud->end_radius = txm_maxf(bud->radius * o->taper, txm_minf(bud->radius, tpc_thinnest(g)));
    bud->along = 0;
    bud->is_forked = 0;
    bud->rest = 0;
    bud->roll = tpc_uniform(g, 0, 360);
}

/* Set up the bud at leaf rim k of a segment, where an axis goes on or begins. Where one goes on, bud is,
   on entry, that of the segment. */
static void tpc_open_rim(tpc_growth *g, int32_t at, int k, tpc_bud *bud) {
    const tpc_segment *from = &g->sketch.segments[at];
    const treepieces_similarity *b = &g->kit->pieces[from->type].building[k];
    const float length = k == from->main ? from->length : from->part;
    const float local[3] = {b->translation[0] * from->radius, b->translation[1] * length,
                            b->translation[2] * from->radius};
    bud->seed = txm_hash(from->seed + (uint64_t)(k + 1) * 0x9e3779b97f4a7c15u);
    tpc_draw_for(g, bud->seed, TPC_OPENING);
    bud->rim = (uint8_t)k;
    bud->parent = at;
    bud->order = from->order;
    bud->is_forked = from->is_forked;
    bud->depth = (uint16_t)(from->depth + 1);
    bud->radius = from->radius * from->ratios[k];
    bud->end_radius = from->end_radius;
    bud->length = from->axis_length;
    bud->step = from->step;
    tpc_multiply_by_building(from->rotation, b->rotation, bud->rotation);
    if (g->kit->offsets[from->type][k] > 0) tpc_rotate(from->rotation, local, bud->position);
    else
        for (int i = 0; i < 3; i++) bud->position[i] = from->stem[i] * local[1];
    for (int i = 0; i < 3; i++) bud->position[i] += from->position[i];
    bud->along = from->along + local[1] / from->axis_length;
    if (bud->along > 1) bud->along = 1;
    bud->rest = from->type == TREEPIECES_I ? 0 : from->step - from->length;
    if (bud->rest < bud->radius) bud->rest = 0;
    memcpy(bud->axis, from->stem, sizeof bud->axis);
    if (b->rotation[3] < 1) {
        const float up[3] = {0, 1, 0};
        tpc_rotate(bud->rotation, up, bud->axis);
    }
    if (g->kit->offsets[from->type][k] < 0.3f) { /* the stem itself */
        memcpy(bud->heading, bud->is_aimed ? bud->aim : from->stem, sizeof bud->heading);
        bud->is_aimed = 0;
        tpc_steer(g, bud, local[1]);
        tpc_limit_rise(g, bud);
        return;
    }
    float out[3];
    tpc_find_out(g, from, k, out);
    if (tpc_is_fork(from->type)) tpc_open_arm(g, from, k, out, bud);
    else tpc_open_branch(g, from, k, out, bud);
    tpc_limit_rise(g, bud);
}

/* ---- growing: axis by axis --------------------------------------------------------------------- */

/* Call the caller's rule and check its choice; 0 if that is invalid. */
static int tpc_call_rule(tpc_growth *g, const tpc_bud *bud, treepieces_choice *c) {
    treepieces_site site;
    site.depth = bud->depth;
    site.order = bud->order;
    site.parent = bud->parent < 0 ? -1 : g->sketch.segments[bud->parent].type;
    site.rim = bud->rim;
    site.tree = g->index;
    for (int k = 0; k < 3; k++) site.position[k] = bud->position[k] + g->place.position[k];
    memcpy(site.direction, bud->heading, sizeof site.direction);
    site.radius = bud->radius;
    site.along = bud->along;
    site.length = bud->length;
    g->desc->own_rule(g->desc->own_user, &site, &g->rng, c);
    g->fault = NULL;
    if (c->type < 0 || c->type >= g->kit->count)
        g->fault = "own_rule chose a type that the kit does not have";
    else if (c->turn < -1 || c->turn >= TREEPIECES_RIM)
        g->fault = "own_rule chose a turn that is not -1 to 5";
    else if (!(c->length > 0) || !txm_is_finite((double)c->length))
        g->fault = "own_rule chose a length that is not above 0";
    else if (!txm_is_finite((double)c->direction[0] + (double)c->direction[1] + (double)c->direction[2]))
        g->fault = "own_rule chose a direction that is not finite";
    else
        for (int k = 0; k < g->kit->pieces[c->type].leaf_count; k++)
            if (!(c->ratios[k] >= 0.02f && c->ratios[k] <= 1))
                g->fault = "own_rule chose a ratio that is not 0.02 to 1";
    if (g->fault) g->status = TXM_BAD_ARGUMENT;
    return g->status == TXM_OK;
}

/* What is the same for all trees of a limit: how far the pieces of a tree of few are stretched. */
static void tpc_begin_sketch(tpc_growth *g) {
    tpc_sketch *s = &g->sketch;
    s->segment_count = s->axis_count = s->pieces = 0;
    s->is_rigid = g->desc->rule != TREEPIECES_GRAMMAR || g->desc->own_rule;
    s->stretch = tpc_stretch(g->most);
    s->most_joined = tpc_most_joined(s->stretch);
    s->taper = txm_minf(0.65f, 0.65f * (float)g->most / 150);
    s->deviation = tpc_deviation(g->most) * g->foot;
}

/* Reset a slot and open the first rim, on the ground. */
static void tpc_begin_tree(tpc_growth *g, tpc_bud *bud) {
    const treepieces_order *o = &g->species->orders[0];
    memset(bud, 0, sizeof *bud);
    g->node_count = g->cluster_count = g->wait_count = 0;
    g->bucket = 0;
    g->height = 0;
    g->status = TXM_OK;
    memset(g->type_counts, 0, sizeof g->type_counts);
    for (int b = 0; b < TPC_BUCKETS; b++) g->first[b] = g->last[b] = -1;
    if (tpc_casts_shade(g->species)) memset(g->shade, 0, sizeof g->shade);
    tpc_draw_for(g, g->place.seed, 0x7265657069656365u);
    g->scale = g->place.scale > 0 ? g->place.scale : 1;
    g->trunk = o->length * g->scale * tpc_uniform(g, 1 - o->length_spread, 1 + o->length_spread);
    g->foot = g->trunk * o->radius;
    bud->parent = TREEPIECES_NONE;
    bud->seed = g->place.seed;
    double sine, cosine;
    txm_sincos(0.5 * (double)g->place.turn, &sine, &cosine);
    bud->rotation[1] = txm_float(sine);
    bud->rotation[3] = txm_float(cosine);
    bud->axis[1] = bud->heading[1] = 1;
    bud->radius = g->foot * (g->species->flare > 1 ? g->species->flare : 1);
    bud->end_radius = txm_maxf(g->foot * o->taper, tpc_thinnest(g));
    bud->length = g->trunk;
    bud->step = g->trunk / o->segments;
    bud->roll = tpc_uniform(g, 0, 360);
    g->ceiling = 1e30f;
    for (int k = 0; k < 3; k++) g->low[k] = g->high[k] = bud->position[k];
    for (int i = 0; i < g->species->order_count; i++) {
        const treepieces_order *a = tpc_order(g, i);
        for (int top = 0; top < 2; top++) {
            txm_sincos((double)(top ? a->angle_top : a->angle_base) * (TXM_PI / 180), &sine, &cosine);
            g->aside[i][top][0] = txm_float(cosine);
            g->aside[i][top][1] = txm_float(sine);
        }
    }
    tpc_begin_sketch(g);
    if (g->species->clearance > 0)
        tpc_space_clear(&g->space, tpc_cell_steps * bud->step + 2 * bud->radius);
}

/* End the axis here. */
static void tpc_end_axis(const tpc_growth *g, const tpc_bud *bud, treepieces_choice *c) {
    c->type = TREEPIECES_TIP;
    c->turn = 0;
    memcpy(c->direction, bud->heading, sizeof c->direction);
    c->length = tpc_choose_length(g, bud, TREEPIECES_TIP);
    c->leaves = g->species->leaf_count > 0 && bud->order > 0;
}

/* Seat the piece, which gives its stem. Returns the segment that is in the way, or TREEPIECES_NONE; away: out
   of that. */
static int32_t tpc_find_obstacle(tpc_growth *g, const tpc_bud *bud, const treepieces_choice *c,
                                 tpc_seat *seat, tpc_limb *limb, float away[3]) {
    tpc_seat_piece(g, bud, c, seat);
    tpc_limb_of(g, bud, c, seat, limb);
    if (bud->parent < 0) return TREEPIECES_NONE;
    return tpc_space_touches(&g->space, limb, g->species->clearance + tpc_slack, (float)TPC_FORK * bud->radius, away);
}

/* Does a segment belong to the axis that grows, or to that where it began? */
static int tpc_is_own_stem(const tpc_growth *g, const tpc_bud *bud, int is_first, int32_t other) {
    const tpc_sketch *s = &g->sketch;
    const int32_t own = s->segments[bud->parent].axis, begins = s->axes[own].parent;
    if (s->segments[other].axis == own) return 1;
    return !is_first && begins >= 0 && s->segments[other].axis == s->segments[begins].axis;
}

/* Seat the piece where it comes too near to no other stem: as chosen, or turned out of the way, or as
   the end of its axis, the shortest if need be; and take the room. A branch does not bend about the stem
   from which it comes. One that has no room even to begin is refused: returns 0. */
static int tpc_take_room(tpc_growth *g, const tpc_bud *bud, int is_first, int is_refusable,
                         treepieces_choice *c, tpc_seat *seat) {
    static const float turns[] = {0.4f, 0.9f, 1.8f}; /* tangents, of further and further aside */
    enum { TURNS = sizeof turns / sizeof turns[0] };
    const treepieces_choice chosen = *c;
    tpc_limb limb;
    float away[3];
    for (int t = 0;; t++) {
        const int32_t other = tpc_find_obstacle(g, bud, c, seat, &limb, away);
        if (other < 0) break;
        if (t == TURNS || tpc_is_own_stem(g, bud, is_first, other)) {
            if (is_refusable) return 0;
            *c = chosen;
            if (c->type != TREEPIECES_TIP) tpc_end_axis(g, bud, c);
            c->length = tpc_shortest(TREEPIECES_TIP) * bud->radius;
            tpc_seat_piece(g, bud, c, seat);
            tpc_limb_of(g, bud, c, seat, &limb);
            break;
        }
        tpc_unit_or_up(away);
        for (int k = 0; k < 3; k++) c->direction[k] = bud->heading[k] + turns[t] * away[k];
    }
    tpc_space_add(&g->space, &limb);
    return 1;
}

/* The leaf rim where the axis goes on: that on it, or the thickest. */
static int tpc_main_rim(const tpc_growth *g, const treepieces_choice *c) {
    int thickest = 0;
    if (g->kit->offsets[c->type][0] < 0.3f) return 0;
    for (int k = 1; k < g->kit->pieces[c->type].leaf_count; k++)
        if (c->ratios[k] > c->ratios[thickest]) thickest = k;
    return thickest;
}

/* Append a segment; the branches that may begin at it wait for their turn. */
static void tpc_append_segment(tpc_growth *g, const tpc_bud *bud, const treepieces_choice *c,
                               const tpc_seat *seat) {
    tpc_sketch *s = &g->sketch;
    const int32_t at = s->segment_count++;
    const int leaves = g->kit->pieces[c->type].leaf_count;
    TXM_ASSERT(s->segment_count <= g->most_segments);
    tpc_segment *t = &s->segments[at];
    t->seed = bud->seed;
    memcpy(t->position, bud->position, sizeof t->position);
    memcpy(t->rotation, seat->rotation, sizeof t->rotation);
    memcpy(t->stem, seat->stem, sizeof t->stem);
    t->radius = bud->radius;
    t->length = c->length;
    t->longest = tpc_tallest(g, bud->radius, TREEPIECES_I) * bud->radius * txm_maxf(0.8f, 120 / (float)g->most);
    t->part = c->length;
    if (tpc_bears_branches(s, c->type)) {
        const float part = tpc_tallest(g, bud->radius, c->type) * bud->radius;
        if (t->length > part + bud->radius) t->part = part;
    }
    memcpy(t->ratios, c->ratios, sizeof t->ratios);
    t->along = bud->along;
    t->axis_length = bud->length;
    t->step = bud->step;
    t->end_radius = bud->end_radius;
    t->axis = s->axis_count - 1;
    t->depth = bud->depth;
    t->type = (uint8_t)c->type;
    t->order = bud->order;
    t->is_forked = bud->is_forked;
    t->leaves = c->leaves != 0;
    t->main = (uint8_t)tpc_main_rim(g, c);
    t->grown = 0;
    s->axes[t->axis].end = s->segment_count;
    t->begins = (uint8_t)tpc_run_take(s, &g->run, t);
    s->pieces += t->begins;
    if (!tpc_is_elastic(s, c->type) && leaves) s->pieces += leaves - 1; /* each has a tip at least */
    tpc_cast_shade(g, bud->position);
    for (int k = 0; k < 3; k++) {
        const float end = t->position[k] + t->length * t->stem[k];
        if (end < g->low[k]) g->low[k] = end;
        if (end > g->high[k]) g->high[k] = end;
    }
}

/* Grow the axis that begins with the bud, at the price of so many pieces to begin with. */
static void tpc_grow_axis(tpc_growth *g, tpc_bud *bud, int price, int is_refusable) {
    tpc_sketch *s = &g->sketch;
    const int is_crowded = g->species->clearance > 0 && !s->is_rigid;
    treepieces_choice choice;
    tpc_seat seat;
    int is_first = 1;
    const int32_t first = s->segment_count;
    g->run.first = NULL;
    do {
        tpc_draw_for(g, bud->seed, TPC_ATTACHING);
        tpc_choose(g, bud, &choice);
        if (g->desc->own_rule && !tpc_call_rule(g, bud, &choice)) return;
        const int leaves = g->kit->pieces[choice.type].leaf_count;
        const int tips = tpc_is_elastic(s, choice.type) ? 1 : leaves;
        if (leaves && s->pieces + (is_first ? price : 0) + 1 + tips > g->most) tpc_end_axis(g, bud, &choice);
        if (!is_crowded) tpc_seat_piece(g, bud, &choice, &seat);
        else if (!tpc_take_room(g, bud, is_first, is_first && is_refusable, &choice, &seat)) return;
        if (is_first) {
            tpc_axis *axis = &s->axes[s->axis_count++];
            TXM_ASSERT(s->axis_count <= g->most);
            axis->first = s->segment_count;
            axis->parent = bud->parent;
            axis->rim = bud->rim;
            s->pieces += price;
            if (bud->parent >= 0) {
                tpc_split(s, bud->parent, 1);
                s->segments[bud->parent].grown |= (uint8_t)(1 << bud->rim);
            }
            is_first = 0;
        }
        tpc_append_segment(g, bud, &choice, &seat);
        if (!g->kit->pieces[choice.type].leaf_count) break;
        const tpc_segment *t = &s->segments[s->segment_count - 1];
        bud->roll = seat.after;
        tpc_open_rim(g, s->segment_count - 1, t->main, bud);
        if (choice.type == TREEPIECES_SIDE || choice.type == TREEPIECES_PLANAR)
            bud->roll = seat.after + tpc_order(g, t->order + 1)->roll; /* of the next branch */
    } while (g->status == TXM_OK);
    int number = 0;
    for (int32_t i = first; i < s->segment_count; i++) {
        const int leaves = g->kit->pieces[s->segments[i].type].leaf_count;
        for (int k = 0; k < leaves; k++)
            if (k != s->segments[i].main) tpc_wait_for_axis(g, i, k, number);
        number += leaves > 1;
    }
}

/* Sketch one tree: axis after axis, until the limit is reached. Leaf rims of pieces that lose none need
   at least a tip. */
static void tpc_grow(tpc_growth *g) {
    tpc_sketch *s = &g->sketch;
    tpc_bud bud;
    int is_full = 0;
    tpc_begin_tree(g, &bud);
    tpc_grow_axis(g, &bud, 0, 0);
    for (const tpc_wait *w; g->status == TXM_OK && (w = tpc_pop(g)) != NULL;) {
        const int is_elastic = tpc_is_elastic(s, s->segments[w->segment].type);
        if (is_full && is_elastic) continue;
        const int price = tpc_split(s, w->segment, 0);
        is_full = is_full || s->pieces + price + 2 > g->most;
        if (is_full && is_elastic) continue;
        memset(&bud, 0, sizeof bud);
        tpc_open_rim(g, w->segment, w->rim, &bud);
        tpc_grow_axis(g, &bud, price, is_elastic);
        if (s->axis_count == TPC_FRAME && !s->is_rigid)
            g->ceiling = g->high[1] + 0.004f * (g->high[1] - g->low[1]);
    }
}

/* ---- assembling: pieces of the sketch ------------------------------------------------------- */

enum { TPC_CLASSES = 16 }; /* of oscillators */

/* A piece to be placed on a rim. */
typedef struct tpc_part {
    const tpc_segment *first; /* of those that it stands for */
    int type;
    float radius, ratio, length; /* ratio: of its stem's radius above to that below */
    float foliage;               /* clouds that it stands for */
} tpc_part;

/* Word 3 of a record: log2 of the number of tiles along and across the quads of each band. Where tiles
   would be too narrow, the number across is halved. across: its log2 below; receives that above. */
static uint32_t tpc_bands(const tpc_growth *g, const tpc_part *part, int *across) {
    static const uint8_t halvable[TREEPIECES_BUILTIN] = {3, 1, 1, 1, 1, 0, 2};
    const float tile = tpc_tile_width * g->foot;
    const tpc_band *band = g->kit->bands[part->type];
    const int may = part->type < TREEPIECES_BUILTIN ? halvable[part->type] : 0;
    int now = *across;
    uint32_t word = 0;
    for (int b = 0; b < g->kit->band_counts[part->type]; b++) {
        /* the stem's radius above the band; bands of branches begin as wide as band 0 ends */
        const float share = part->type == TREEPIECES_I && b == 0 ? 0.5f : 1;
        const float radius = part->radius * (1 + (part->ratio - 1) * share);
        int halve = 0;
        const int is_as_before = b == 1 && part->type != TREEPIECES_I && part->type != TREEPIECES_FLARE;
        const float least = tpc_halving_width * tile * (float)(1 << now);
        if (!is_as_before && (may >> b & 1) && now > 0 && radius < least) {
            halve = 1;
            now--;
        }
        const float width = part->radius / (float)(1 << now);
        const float dy = band[b].rise * part->length, dr = band[b].spread * part->radius;
        const float height = sqrtf(dy * dy + dr * dr);
        int along = 0;
        while (along < 3 && height > 1.41f * width * (float)(1 << along)) along++;
        word |= (uint32_t)(now | along << 3 | halve << 5) << (8 * b);
    }
    *across = now;
    return word;
}

/* The multiple of 60 degrees about y that is nearest to a rotation, as 0..5. */
static int tpc_nearest_turn(const float q[4]) {
    int best = 0;
    float most = -1;
    for (int k = 0; k < TREEPIECES_RIM; k++) {
        const float match = fabsf(q[1] * tpc_turns[k][1] + q[3] * tpc_turns[k][3]);
        if (match > most + 1e-6f) {
            most = match;
            best = k;
        }
    }
    return best;
}

/* How many clouds belong to a segment: its own, and those of the branches that have not grown there. */
static float tpc_foliage(const tpc_growth *g, const tpc_segment *t) {
    float clouds = t->leaves, out[3];
    if (!(g->species->leaf_count > 0)) return 0;
    if (t->type == TREEPIECES_TIP) /* all that would have grown there */
        return clouds * txm_maxf(1, 0.125f * (1 - t->along) * t->axis_length / (g->species->cloud * g->scale));
    if (!tpc_is_elastic(&g->sketch, t->type)) return clouds;
    for (int k = 0; k < g->kit->pieces[t->type].leaf_count; k++) {
        const int order = t->order + !tpc_is_fork(t->type);
        if (k == t->main || (t->grown >> k & 1) || !(tpc_order(g, order)->leaves > 0)) continue;
        tpc_find_out(g, t, k, out);
        clouds += 0.5f * tpc_expect_length(g, t, out) / (g->species->cloud * g->scale);
    }
    return clouds;
}

/* The clouds of a piece as one. */
static void tpc_add_cluster(tpc_growth *g, const tpc_part *part) {
    const tpc_segment *t = part->first;
    TXM_ASSERT(g->cluster_count < g->most);
    treepieces_cluster *c = &g->clusters[g->cluster_count++];
    tpc_draw_for(g, t->seed, TPC_LEAFING);
    c->node = (uint32_t)(g->node_count - 1);
    c->along = part->type == TREEPIECES_TIP ? 0.7f : tpc_uniform(g, 0.2f, 1);
    c->radius = g->species->cloud * g->scale * tpc_uniform(g, 0.75f, 1.2f);
    c->look = txm_rng_next(&g->rng);
    c->radius *= txm_clampf(sqrtf(part->foliage), 1, 1.8f);
}

/* Append a piece: parent is the node below, rotation that of its rim in the world, and joint the
   rotation of the piece from there. */
static void tpc_append_node(tpc_growth *g, const tpc_part *part, int32_t parent, int rim,
                            const float joint[4], int turn, int *across) {
    TXM_ASSERT(g->node_count < g->most);
    treepieces_node *node = &g->nodes[g->node_count];
    /* node rotations are relative to the parent, rim frames include the building rotation */
    if (parent >= 0)
        tpc_multiply_building(g->kit->pieces[g->nodes[parent].type].building[rim].rotation, joint,
                              node->rotation);
    else memcpy(node->rotation, joint, sizeof node->rotation);
    node->radius = part->radius;
    node->length = part->length;
    node->parent = parent;
    node->type = (uint8_t)part->type;
    node->joint = (uint8_t)(rim * 8 + turn);
    node->order = part->first->order;
    /* the thinner the faster: two classes per octave, plus one at random */
    const int sway = (int)(tpc_float_bits(g->foot) >> 22) - (int)(tpc_float_bits(part->radius) >> 22) +
                     (int)(txm_hash(part->first->seed) >> 63);
    node->sway = (uint8_t)txm_clampi(sway, 0, TPC_CLASSES - 1);
    g->bands[g->node_count] = tpc_bands(g, part, across);
    g->type_counts[part->type]++;
    g->node_count++;
    g->height = txm_maxf(g->height, part->first->position[1]);
    if (part->foliage > 0) tpc_add_cluster(g, part);
}

/* The kind of piece that a segment with some of its branches is; seen from the other side, if only the
   second branch of a pair has grown. */
static void tpc_reduce(const tpc_sketch *s, tpc_segment *t) {
    static const float half_turn[4] = {0, 1, 0, 0};
    if (s->is_rigid || t->type != TREEPIECES_PLANAR || t->grown == 6) return;
    t->type = TREEPIECES_SIDE;
    if (t->grown == 2) return;
    tpc_multiply(t->rotation, half_turn, t->rotation);
    t->ratios[1] = t->ratios[2];
}

/* Make the pieces of one axis. */
static void tpc_assemble_axis(tpc_growth *g, const tpc_axis *axis) {
    tpc_sketch *s = &g->sketch;
    int32_t parent = TREEPIECES_NONE;
    int rim = axis->rim, across = 4;
    float frame[4] = {0, 0, 0, 1}; /* of the rim where the next piece sits */
    if (axis->parent >= 0) {
        const tpc_segment *from = &s->segments[axis->parent];
        parent = from->node;
        if (rim >= g->kit->pieces[from->type].leaf_count) rim = 1;
        across = from->across;
        tpc_multiply_by_building(from->rotation, g->kit->pieces[from->type].building[rim].rotation, frame);
    }
    for (int32_t i = axis->first, end; i < axis->end; i = end) {
        tpc_segment *t = &s->segments[i];
        tpc_part part = {t, t->type, t->radius, t->ratios[t->main], t->length, tpc_foliage(g, t)};
        const float back[4] = {-frame[0], -frame[1], -frame[2], frame[3]};
        const float up[3] = {0, 1, 0};
        float rotation[4], joint[4], y[3];
        int turn;
        for (end = i + 1; end < axis->end && !s->segments[end].begins; end++)
            part.foliage += tpc_foliage(g, &s->segments[end]);
        if (tpc_is_plain(s, t)) {
            const tpc_segment *next = &s->segments[end];
            float chord[3];
            tpc_rotate(frame, up, y);
            for (int k = 0; k < 3; k++) chord[k] = next->position[k] - t->position[k];
            part.type = TREEPIECES_I;
            part.length = sqrtf(tpc_dot(chord, chord));
            part.ratio = next->radius / t->radius;
            if (part.length > 0)
                for (int k = 0; k < 3; k++) chord[k] /= part.length;
            else { /* too short for its square */
                part.length = t->length;
                memcpy(chord, t->stem, sizeof chord);
            }
            turn = (int)((t->seed >> 32) % TREEPIECES_RIM);
            tpc_turn_to(y, chord, frame, rotation);
            tpc_multiply(rotation, tpc_turns[turn], rotation);
            tpc_multiply(back, rotation, joint);
        } else {
            tpc_reduce(s, t);
            part.type = t->type;
            part.length = t->part;
            if (t->part < t->length) part.ratio = 1 + (part.ratio - 1) * t->part / t->length;
            memcpy(rotation, t->rotation, sizeof rotation);
            tpc_multiply(back, rotation, joint);
            turn = tpc_nearest_turn(joint);
        }
        tpc_append_node(g, &part, parent, rim, joint, turn, &across);
        t->node = parent = g->node_count - 1;
        t->across = (uint8_t)across;
        if (part.length < t->length && part.type != TREEPIECES_I) { /* and the rest of its stem */
            static const float straight[4] = {0, 0, 0, 1};
            part.type = TREEPIECES_I;
            part.radius *= part.ratio;
            part.ratio = t->radius * t->ratios[0] / part.radius;
            part.length = t->length - t->part;
            part.foliage = 0;
            tpc_append_node(g, &part, parent, 0, straight, 0, &across);
            parent++;
        }
        rim = part.type == TREEPIECES_I ? 0 : t->main;
        if (end < axis->end)
            tpc_multiply_by_building(rotation, g->kit->pieces[part.type].building[rim].rotation, frame);
    }
}

/* Make the pieces of the sketch: axis after axis, so parents come first. */
static void tpc_assemble(tpc_growth *g) {
    for (int i = 0; i < g->sketch.axis_count && g->status == TXM_OK; i++)
        tpc_assemble_axis(g, &g->sketch.axes[i]);
    TXM_ASSERT(g->status != TXM_OK || g->node_count == g->sketch.pieces);
}

/* ---- modes of swaying ---------------------------------------------------------------------- */

enum { TPC_PHASES = 8 /* of the flutter within a class of oscillators */ };

/* Does the axis that bears this piece go on at that rim of it? At forks other ones begin. */
static int tpc_goes_on(int type, int rim) {
    return rim == 0 && type != TREEPIECES_Y && type != TREEPIECES_SPATIAL;
}

/* One of eight phases, from the rotation of a piece, so that it does not depend on the rest of the tree. */
static uint32_t tpc_phase(const treepieces_node *n) {
    const uint32_t bits = tpc_float_bits(n->rotation[0]) ^ tpc_float_bits(n->rotation[2]);
    return bits * 0x9e3779b9u >> 29;
}

/* All joints of an axis swing in one mode: with the class of the piece in which it begins, and with a
   phase of its own. Each alone, they would cancel each other out. */
static void tpc_set_modes(treepieces_node *nodes, uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        treepieces_node *n = &nodes[i];
        const treepieces_node *up = n->parent < 0 ? NULL : &nodes[n->parent];
        const int goes_on = up && n->order == up->order && tpc_goes_on(up->type, n->joint >> 3);
        n->sway = goes_on ? up->sway : (uint8_t)(n->sway + TPC_CLASSES * tpc_phase(n));
    }
}

/* ---- a forest ------------------------------------------------------------------------------ */

enum {
    TPC_BLOCK_TREES = 64,      /* trees that grow at a time ...                  */
    TPC_BLOCK_PIECES = 1 << 18 /* ... limited to this many pieces in total       */
};

/* A forest with its memory. */
typedef struct tpc_forest {
    treepieces_forest forest; /* first, so that a pointer to it is one to this */
    txm_arena arena;          /* itself, species, trees and records */
    txm_arena node_arena, cluster_arena;
} tpc_forest;

/* A forest under construction. */
typedef struct tpc_planting {
    const treepieces_forest_desc *desc;
    tpc_forest *made;
    txm_arena scratch, band_arena;
    tpc_growth *slots;
    int slot_count, first; /* tree of slot 0 */
    float spacing;
    treepieces_tree *trees;
    uint32_t (*offsets)[TREEPIECES_MAX_TYPES]; /* by tree: its first record of each type */
    uint32_t type_counts[TREEPIECES_MAX_TYPES];
    uint32_t *words[TREEPIECES_MAX_TYPES];
    /* these grow with the trees */
    treepieces_node *nodes;
    uint32_t *bands;
    treepieces_cluster *clusters;
    size_t node_count, cluster_count, node_capacity, band_capacity, cluster_capacity;
} tpc_planting;

/* The distance of the trees in the grid, metres. */
static float tpc_spacing(const treepieces_forest_desc *desc) {
    float spacing = desc->spacing;
    for (int i = 0; i < desc->species_count && !(desc->spacing > 0); i++)
        spacing = txm_maxf(spacing, 0.6f * desc->species[i].orders[0].length);
    return spacing;
}

/* Where tree i stands if the caller gives no places. */
static treepieces_place tpc_scatter(const treepieces_forest_desc *desc, float spacing, int i) {
    treepieces_place place;
    int side = 1;
    txm_rng rng = txm_rng_make(desc->seed, 0x666f7265u + ((uint64_t)i << 32));
    while (side < 46340 && side * side < desc->tree_count) side++;
    memset(&place, 0, sizeof place);
    if (desc->tree_count > 1) {
        const int column = i % side, row = i / side;
        const float x = (float)column + 0.5f - 0.5f * (float)side;
        const float z = (float)row + 0.5f - 0.5f * (float)side;
        place.position[0] = spacing * (x + 0.6f * (txm_rng_float(&rng) - 0.5f));
        place.position[2] = spacing * (z + 0.6f * (txm_rng_float(&rng) - 0.5f));
        place.scale = 0.8f + 0.4f * txm_rng_float(&rng);
        place.species = (int)txm_rng_below(&rng, (uint32_t)desc->species_count);
    }
    place.turn = 6.2831853f * txm_rng_float(&rng);
    const uint64_t high = txm_rng_next(&rng); /* before the low half: operands have no order */
    place.seed = high << 32 | txm_rng_next(&rng);
    return place;
}

static void tpc_grow_slot(void *context, int i) {
    tpc_planting *p = (tpc_planting *)context;
    tpc_growth *g = &p->slots[i];
    g->index = p->first + i;
    g->place = p->desc->places ? p->desc->places[g->index] : tpc_scatter(p->desc, p->spacing, g->index);
    g->species = &p->desc->species[g->place.species];
    tpc_grow(g);
    tpc_assemble(g);
    if (g->status == TXM_OK) tpc_set_modes(g->nodes, (uint32_t)g->node_count);
}

static txm_status tpc_make_slots(tpc_planting *p, txm_env *env) {
    const int most = p->desc->max_pieces ? p->desc->max_pieces : 600;
    int count = TPC_BLOCK_PIECES / most;
    count = txm_clampi(count, 4, TPC_BLOCK_TREES);
    if (count > p->desc->tree_count) count = p->desc->tree_count;
    p->slots = (tpc_growth *)txm_arena_zero(&p->scratch, (size_t)count, sizeof *p->slots);
    if (!p->slots) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to grow trees");
    for (p->slot_count = 0; p->slot_count < count; p->slot_count++) {
        tpc_growth *g = &p->slots[p->slot_count];
        g->desc = p->desc;
        g->kit = p->desc->kit;
        g->most = most;
        g->most_segments = most * tpc_most_joined(tpc_stretch(most));
        /* a tree has at most `most` nodes, each of some segments and with one cluster at most */
        g->nodes = (treepieces_node *)txm_arena_alloc(&p->scratch, (size_t)most, sizeof *g->nodes);
        g->bands = (uint32_t *)txm_arena_alloc(&p->scratch, (size_t)most, sizeof *g->bands);
        g->records = (uint32_t *)txm_arena_alloc(&p->scratch, (size_t)most, sizeof *g->records);
        const size_t segments = (size_t)g->most_segments;
        g->sketch.axes = (tpc_axis *)txm_arena_alloc(&p->scratch, (size_t)most, sizeof *g->sketch.axes);
        g->sketch.segments = (tpc_segment *)txm_arena_alloc(&p->scratch, segments, sizeof *g->sketch.segments);
        g->waits = (tpc_wait *)txm_arena_alloc(&p->scratch, segments * (TREEPIECES_MAX_LEAVES - 1),
                                               sizeof *g->waits);
        g->clusters = (treepieces_cluster *)txm_arena_alloc(&p->scratch, (size_t)most,
                                                            sizeof *g->clusters);
        if (!tpc_space_make(&g->space, g->most_segments, &p->scratch))
            return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to grow trees");
    }
    return TXM_OK;
}

/* Make room for `more` items after the first `count` of a block. What is allocated is an estimate
   for all trees from those that are done. Returns the block, or NULL if there is no memory. */
static void *tpc_reserve(const tpc_planting *p, int done, txm_arena *arena, void *block, size_t count,
                         size_t more, size_t size, size_t *capacity) {
    size_t wanted = count + more;
    if (block && wanted <= *capacity) return block;
    const double all = 1.05 * (double)wanted / done * p->desc->tree_count + 64;
    if (all < 4e9 && (size_t)all > wanted) wanted = (size_t)all;
    txm_arena larger_arena = *arena;
    larger_arena.blocks = NULL;
    void *larger = txm_arena_alloc(&larger_arena, wanted, size);
    if (!larger) return NULL;
    if (block) memcpy(larger, block, count * size);
    txm_arena_free(arena);
    *arena = larger_arena;
    *capacity = wanted;
    return larger;
}

/* Copy what grew in slot i to the place in the forest that its tree has. */
static void tpc_copy_slot(void *context, int i) {
    const tpc_planting *p = (const tpc_planting *)context;
    const tpc_growth *g = &p->slots[i];
    const treepieces_tree *t = &p->trees[p->first + i];
    memcpy(p->nodes + t->first_node, g->nodes, t->node_count * sizeof *p->nodes);
    memcpy(p->bands + t->first_node, g->bands, t->node_count * sizeof *p->bands);
    for (uint32_t k = 0; k < t->cluster_count; k++) {
        treepieces_cluster *c = &p->clusters[t->first_cluster + k];
        *c = g->clusters[k];
        c->node += t->first_node;
    }
}

/* Append the trees that grew in the slots to the forest. */
static txm_status tpc_append_trees(tpc_planting *p, int count, txm_env *env) {
    size_t nodes = 0, clusters = 0;
    for (int i = 0; i < count; i++) {
        if (p->slots[i].status != TXM_OK) return txm_fail(env, p->slots[i].status, p->slots[i].fault);
        nodes += (size_t)p->slots[i].node_count;
        clusters += (size_t)p->slots[i].cluster_count;
    }
    if (nodes > 0x7fffffffu - p->node_count)
        return txm_fail(env, TXM_TOO_LARGE, "more than 2^31 pieces");
    const int done = p->first + count;
    void *n = tpc_reserve(p, done, &p->made->node_arena, p->nodes, p->node_count, nodes,
                          sizeof *p->nodes, &p->node_capacity);
    if (n) p->nodes = (treepieces_node *)n;
    void *b = tpc_reserve(p, done, &p->band_arena, p->bands, p->node_count, nodes, sizeof *p->bands,
                          &p->band_capacity);
    if (b) p->bands = (uint32_t *)b;
    void *c = tpc_reserve(p, done, &p->made->cluster_arena, p->clusters, p->cluster_count, clusters,
                          sizeof *p->clusters, &p->cluster_capacity);
    if (c) p->clusters = (treepieces_cluster *)c;
    if (!n || !b || !c) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the forest");
    for (int i = 0; i < count; i++) {
        const tpc_growth *g = &p->slots[i];
        treepieces_tree *t = &p->trees[p->first + i];
        t->first_node = (uint32_t)p->node_count;
        t->node_count = (uint32_t)g->node_count;
        t->first_cluster = (uint32_t)p->cluster_count;
        t->cluster_count = (uint32_t)g->cluster_count;
        memcpy(t->position, g->place.position, sizeof t->position);
        t->turn = g->place.turn;
        t->scale = g->scale;
        t->species = g->place.species;
        t->seed = (uint32_t)txm_hash(g->place.seed);
        t->height = g->height;
        p->node_count += t->node_count;
        p->cluster_count += t->cluster_count;
        for (int k = 0; k < TREEPIECES_MAX_TYPES; k++) {
            p->offsets[p->first + i][k] = p->type_counts[k];
            p->type_counts[k] += g->type_counts[k];
        }
    }
    txm_parallel_for(env, count, tpc_copy_slot, p);
    return TXM_OK;
}

/* Choose a random tile for every quad, four at a time: column r (9 - tiles across) / 16 for random
   r of 0..15 (0 for 16 tiles), the row likewise; quads at the bottom of their layer get the last
   row. */
static void tpc_fill_cells(const tpc_cells *cells, int words, uint32_t bands, txm_rng *rng,
                           uint32_t *word) {
    const uint32_t low = 0x0f0f0f0fu;
    for (int i = 0; i < words; i++) {
        const tpc_cells *c = &cells[i];
        const uint32_t bits = txm_rng_next(rng), across = bits & low, down = bits >> 4 & low;
        word[i] = 0;
        for (int b = c->first; b <= c->last; b++) {
            const uint32_t band = bands >> (8 * b) & 255u, last = 8u - (1u << (band >> 3 & 3));
            const uint32_t columns = band & 4 ? 1 : 9u - (1u << (band & 3)), rows = last + 1;
            const uint32_t bottom = band & 32 ? ~0u : c->bottom;
            const uint32_t column = across * columns >> 4 & low, row = down * rows >> 4 & low;
            const uint32_t chosen = (row & ~bottom) | (last * 0x01010101u & bottom);
            word[i] |= (column | chosen << 3) & c->bands[b];
        }
        word[i] &= ~c->own | 0x36363636u; /* the caller's classes lie on 2 x 2 cells */
    }
}

/* Fill the records of tree p->first + i. A child enters itself in the record of its parent. */
static void tpc_fill_tree(void *context, int i) {
    tpc_planting *p = (tpc_planting *)context;
    const treepieces_kit *kit = p->desc->kit;
    const treepieces_tree *t = &p->trees[p->first + i];
    uint32_t *records = p->slots[i].records, next[TREEPIECES_MAX_TYPES];
    txm_rng rng = txm_rng_make(t->seed, 0x63656c6cu);
    memcpy(next, p->offsets[p->first + i], sizeof next);
    for (uint32_t n = 0; n < t->node_count; n++) {
        const treepieces_node *node = &p->nodes[t->first_node + n];
        const uint32_t stride = p->made->forest.batches[node->type].stride;
        uint32_t *w = p->words[node->type] + (size_t)(records[n] = next[node->type]++) * stride;
        w[0] = t->first_node + n;
        w[1] = w[2] = 0;
        w[3] = p->bands[t->first_node + n];
        tpc_fill_cells(kit->cells[node->type], (int)stride - 4, w[3], &rng, w + 4);
        if (node->parent < 0) continue;
        const int type = p->nodes[t->first_node + (uint32_t)node->parent].type, rim = node->joint >> 3;
        uint32_t *up = p->words[type] +
                       (size_t)records[node->parent] * p->made->forest.batches[type].stride;
        up[1 + rim / 2] |= (n - (uint32_t)node->parent) << (16 * (rim & 1));
        up[2] |= (uint32_t)(node->joint & 7) << (16 + 4 * rim);
    }
}

/* Allocate the records, as their numbers are known now. */
static txm_status tpc_make_arrays(tpc_planting *p, txm_env *env) {
    treepieces_forest *out = &p->made->forest;
    size_t bytes = sizeof *p->made + (size_t)out->tree_count * sizeof *p->trees +
                   (size_t)out->species_count * sizeof *out->species +
                   p->node_capacity * sizeof *p->nodes + p->cluster_capacity * sizeof *p->clusters;
    for (int k = 0; k < out->type_count; k++) {
        treepieces_batch *b = &out->batches[k];
        b->quad_count = out->kit->pieces[k].quad_count;
        b->stride = 4 + ((uint32_t)b->quad_count + 3) / 4;
        b->count = p->type_counts[k];
        if (!b->count) continue;
        p->words[k] = (uint32_t *)txm_arena_alloc(&p->made->arena, b->count,
                                                  b->stride * sizeof(uint32_t));
        if (!p->words[k]) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the forest");
        b->words = p->words[k];
        bytes += (size_t)b->count * b->stride * sizeof(uint32_t);
    }
    out->nodes = p->nodes;
    out->clusters = p->clusters;
    out->node_count = (uint32_t)p->node_count;
    out->cluster_count = (uint32_t)p->cluster_count;
    out->bytes = bytes;
    return TXM_OK;
}

/* Grow all trees, block after block; then, as the sizes of the batches are known, fill the records. */
static txm_status tpc_grow_trees(tpc_planting *p, txm_env *env) {
    const int trees = p->desc->tree_count;
    p->trees = (treepieces_tree *)txm_arena_zero(&p->made->arena, (size_t)trees, sizeof *p->trees);
    p->offsets = (uint32_t(*)[TREEPIECES_MAX_TYPES])txm_arena_alloc(&p->scratch, (size_t)trees,
                                                                   sizeof *p->offsets);
    if (p->made->arena.failed || p->scratch.failed)
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the forest");
    p->made->forest.trees = p->trees;
    txm_status status = tpc_make_slots(p, env);
    for (int pass = 0; pass < 2 && status == TXM_OK; pass++) {
        if (pass) status = tpc_make_arrays(p, env);
        for (p->first = 0; status == TXM_OK && p->first < trees; p->first += p->slot_count) {
            const int left = trees - p->first, count = left < p->slot_count ? left : p->slot_count;
            if (txm_progress(env, 0.7f * (float)pass + (pass ? 0.3f : 0.7f) * (float)p->first / (float)trees,
                             pass ? "assemble" : "grow"))
                return txm_fail(env, TXM_CANCELLED, "cancelled");
            txm_parallel_for(env, count, pass ? tpc_fill_tree : tpc_grow_slot, p);
            if (!pass) status = tpc_append_trees(p, count, env);
        }
    }
    return status;
}

static txm_status tpc_check_forest(const treepieces_forest_desc *d, txm_env *env) {
    if (!d || !d->kit) return txm_fail(env, TXM_BAD_ARGUMENT, "desc or kit is NULL");
    if (!d->species || d->species_count < 1)
        return txm_fail(env, TXM_BAD_ARGUMENT, "species: at least one is needed");
    if (d->tree_count < 1) return txm_fail(env, TXM_BAD_ARGUMENT, "tree_count must be 1 or more");
    if (d->max_pieces && (d->max_pieces < 8 || d->max_pieces > 65535))
        return txm_fail(env, TXM_BAD_ARGUMENT, "max_pieces must be 8 to 65535, or 0 for 600");
    if (d->rule < TREEPIECES_GRAMMAR || d->rule > TREEPIECES_RANDOM)
        return txm_fail(env, TXM_BAD_ARGUMENT, "rule is not a treepieces_rule");
    if (!(d->spacing >= 0) || !txm_is_finite((double)d->spacing))
        return txm_fail(env, TXM_BAD_ARGUMENT, "spacing must be 0 or more");
    for (int i = 0; i < d->species_count; i++) {
        const txm_status status = tpc_species_check(&d->species[i], env);
        if (status != TXM_OK) return status;
    }
    for (int i = 0; d->places && i < d->tree_count; i++) {
        const treepieces_place *p = &d->places[i];
        for (int k = 0; k < 3; k++)
            if (!(fabsf(p->position[k]) <= 1e6f))
                return txm_fail(env, TXM_BAD_ARGUMENT, "places: a position is beyond 1000 km");
        if (!(fabsf(p->turn) <= 1e4f) || !(p->scale == 0 || (p->scale >= 1e-3f && p->scale <= 1000)))
            return txm_fail(env, TXM_BAD_ARGUMENT, "places: a turn or scale is out of range");
        if (p->species < 0 || p->species >= d->species_count)
            return txm_fail(env, TXM_BAD_ARGUMENT, "places: a species number is out of range");
    }
    return TXM_OK;
}

TREEPIECES_API txm_status treepieces_scatter(const treepieces_forest_desc *desc, txm_env *env,
                                             treepieces_place *places) {
    const txm_status status = tpc_check_forest(desc, env);
    if (status != TXM_OK) return status;
    if (!places) return txm_fail(env, TXM_BAD_ARGUMENT, "places is NULL");
    const float spacing = tpc_spacing(desc);
    for (int i = 0; i < desc->tree_count; i++)
        places[i] = desc->places ? desc->places[i] : tpc_scatter(desc, spacing, i);
    return TXM_OK;
}

TREEPIECES_API void treepieces_forest_free(treepieces_forest *forest) {
    if (!forest) return;
    tpc_forest *f = (tpc_forest *)forest;
    txm_arena arena = f->arena;
    txm_arena_free(&f->node_arena);
    txm_arena_free(&f->cluster_arena);
    txm_arena_free(&arena);
}

TREEPIECES_API txm_status treepieces_forest_make(const treepieces_forest_desc *desc, txm_env *env,
                                                 treepieces_forest **out) {
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    txm_status status = tpc_check_forest(desc, env);
    if (status != TXM_OK) return status;
    txm_arena arena;
    tpc_planting p;
    memset(&p, 0, sizeof p);
    p.desc = desc;
    p.spacing = tpc_spacing(desc);
    txm_arena_init(&p.scratch, env);
    txm_arena_init(&p.band_arena, env);
    txm_arena_init(&arena, env);
    tpc_forest *f = (tpc_forest *)txm_arena_zero(&arena, 1, sizeof *f);
    treepieces_species *species = (treepieces_species *)txm_arena_alloc(
        &arena, (size_t)desc->species_count, sizeof *species);
    if (f) {
        f->arena = arena;
        txm_arena_init(&f->node_arena, env);
        txm_arena_init(&f->cluster_arena, env);
    }
    if (arena.failed) {
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the forest");
    } else {
        memcpy(species, desc->species, (size_t)desc->species_count * sizeof *species);
        f->forest.kit = desc->kit;
        f->forest.species = species;
        f->forest.species_count = desc->species_count;
        f->forest.tree_count = desc->tree_count;
        f->forest.type_count = desc->kit->count;
        p.made = f;
        status = tpc_grow_trees(&p, env);
    }
    txm_arena_free(&p.scratch);
    txm_arena_free(&p.band_arena);
    if (status == TXM_OK) *out = &f->forest;
    else if (f) treepieces_forest_free(&f->forest);
    else txm_arena_free(&arena);
    return status;
}

/* ---- wind -------------------------------------------------------------------------------- */

enum { TPC_WAVES = 4 };

/* A travelling gust: weight * sin(2 pi (along . (x, z) - rate * t + phase)). */
typedef struct tpc_wave {
    double along[2], rate, phase, weight;
} tpc_wave;

/* The wind at one time, and the step of the oscillators that ends then. */
typedef struct tpc_air {
    float direction[3], pressure, gusts;
    tpc_wave waves[TPC_WAVES];
    double time;
    struct {
        float xx, xv, vx, vv; /* (x, v) -> (xx x + xv v, vx x + vv v), x from the equilibrium */
        float give; /* radians at pressure 1 per sixteenth of the tree's height               */
        float flutter[TPC_PHASES];
    } classes[TPC_CLASSES];
} tpc_air;

/* sin(2 pi turns), for any number of turns */
static double tpc_sine_of_turns(double turns) {
    double sine, cosine;
    txm_sincos((turns - floor(turns)) * (2 * TXM_PI), &sine, &cosine);
    return sine;
}

/* The nearest rate, turns a second, at which the wind repeats itself after its period. */
static double tpc_periodic(const treepieces_wind *wind, double rate) {
    const double period = (double)wind->period, turns = floor(rate * period + 0.5);
    return period > 0 ? (turns > 1 ? turns : 1) / period : rate;
}

/* Waves of 90, 41, 19 and 9 m that travel about in the direction and at the speed of the wind. */
static void tpc_make_waves(const treepieces_wind *wind, tpc_air *air) {
    static const double lengths[TPC_WAVES] = {90, 41, 19, 9};
    static const double weights[TPC_WAVES] = {0.4, 0.3, 0.2, 0.1};
    txm_rng rng = txm_rng_make(wind->seed, 0x77696e64u);
    double sine, cosine;
    txm_sincos((double)wind->direction, &sine, &cosine);
    air->direction[0] = txm_float(cosine);
    air->direction[1] = 0;
    air->direction[2] = txm_float(-sine);
    const float fast = wind->speed / 15; /* from there on crowns give way and offer less to the wind */
    air->pressure = 0.0120185f * wind->speed * wind->speed / sqrtf(1 + fast * fast);
    air->gusts = wind->gusts;
    for (int i = 0; i < TPC_WAVES; i++) {
        tpc_wave *w = &air->waves[i];
        const double aside = 0.7 * ((double)txm_rng_float(&rng) - 0.5);
        txm_sincos((double)wind->direction + aside, &sine, &cosine);
        w->along[0] = cosine / lengths[i];
        w->along[1] = -sine / lengths[i];
        w->rate = (double)wind->speed * (0.8 + 0.4 * (double)txm_rng_float(&rng)) / lengths[i];
        w->rate = tpc_periodic(wind, w->rate);
        w->phase = (double)txm_rng_float(&rng);
        w->weight = weights[i];
    }
}

static float tpc_pressure(const tpc_air *air, const float position[3], double time) {
    double sum = 0;
    for (int i = 0; i < TPC_WAVES; i++) {
        const tpc_wave *w = &air->waves[i];
        sum += w->weight * tpc_sine_of_turns(w->along[0] * (double)position[0] +
                                             w->along[1] * (double)position[2] - w->rate * time +
                                             w->phase);
    }
    const float pressure = air->pressure * (1 + air->gusts * 1.5f * txm_float(sum));
    return pressure > 0 ? pressure : 0;
}

static int tpc_is_wind(const treepieces_wind *w) {
    return w && fabsf(w->direction) <= 1e4f && w->speed >= 0 && w->speed <= 100 && w->gusts >= 0 &&
           w->gusts <= 1 && w->period >= 0 && w->period <= 1e6f;
}

TREEPIECES_API float treepieces_gust(const treepieces_wind *wind, const float position[3],
                                     double time) {
    tpc_air air;
    if (!tpc_is_wind(wind) || !position || !txm_is_finite(time)) return 0;
    tpc_make_waves(wind, &air);
    return tpc_pressure(&air, position, time);
}

/* Class c has the frequency 0.3 * 2^(c / 3) Hz and the damping ratio d = 1/5. The step over dt is
   the exact solution of

       x'' + 2 d w x' + w^2 x = 0,   x = e^(-d w t) (a cos(k t) + b sin(k t)),  k = w sqrt(1 - d^2)

   so that it is right and stable for any dt. Thin branches bend further, and flutter. */
static void tpc_make_classes(const treepieces_wind *wind, double dt, tpc_air *air) {
    const double damping = 0.2, part = sqrt(1 - damping * damping);
    for (int c = 0; c < TPC_CLASSES; c++) {
        const double frequency = 0.3 * txm_exp2(c / 3.0), omega = 2 * TXM_PI * frequency;
        const double fade = damping * omega * dt;
        double e = 0, sine = 0, cosine = 0;
        if (fade < 60) { /* else the old swing has died out */
            e = txm_exp2(-fade * 1.44269504088896340736);
            txm_sincos(omega * part * dt, &sine, &cosine);
        }
        air->classes[c].xx = txm_float(e * (cosine + damping / part * sine));
        air->classes[c].xv = txm_float(e * sine / (omega * part));
        air->classes[c].vx = txm_float(-e * omega / part * sine);
        air->classes[c].vv = txm_float(e * (cosine - damping / part * sine));
        air->classes[c].give = txm_float(0.0055 * txm_exp2(0.6 * c));
        const double share = wind->gusts * (0.2 + 0.7 * (c < 4 ? c / 4.0 : 1));
        const double slow = tpc_periodic(wind, frequency), fast = tpc_periodic(wind, 1.618 * frequency);
        for (int k = 0; k < TPC_PHASES; k++)
            air->classes[c].flutter[k] =
                txm_float(share * (0.6 * tpc_sine_of_turns(slow * air->time + k * 0.381966) +
                                   0.4 * tpc_sine_of_turns(fast * air->time + k * 0.723607)));
    }
}

/* ---- bones ------------------------------------------------------------------------------- */

typedef struct tpc_posing {
    const treepieces_forest *forest;
    const treepieces_pose *pose;
    const tpc_air *air; /* NULL: no wind */
    float *state, *bones;
} tpc_posing;

/* q = q p, with p the rotation about the axis (x, 0, z) by about its length, in radians */
static void tpc_bend(float q[4], float x, float z) {
    const float a = 0.5f * x, c = 0.5f * z, w = 1 / sqrtf(1 + a * a + c * c);
    const float p[4] = {w * a, 0, w * c, w};
    tpc_multiply(q, p, q);
}

/* Apply the pose to joint i of a tree: its random bend, a hash of its number and of the tree's seed, and
   its own rotation. */
static void tpc_pose_joint(const treepieces_pose *pose, const treepieces_tree *t, uint32_t i, float q[4]) {
    if (pose->amount > 0) {
        const uint64_t number = (uint64_t)t->seed << 32 | ((uint64_t)i + 1);
        const uint64_t h = txm_hash(pose->seed ^ number * 0x9e3779b97f4a7c15u);
        const float u = (float)(h & 0xffffff) * 1.1920929e-7f - 1, v = (float)(h >> 40) * 1.1920929e-7f - 1;
        tpc_bend(q, 0.7f * pose->amount * u, 0.7f * pose->amount * v);
    }
    if (pose->joints) tpc_multiply(q, pose->joints + 4 * (size_t)(t->first_node + i), q);
}

/* An angle as it is where it is small, and below 0.12 radians in any wind. */
static float tpc_soften(float angle) {
    return angle / (1 + fabsf(angle) * (1 / 0.12f));
}

/* One time step of a joint: the wind in its frame (x and z across the stem) drives its oscillator. The
   two directions differ in phase, so that branches move round and round. */
static void tpc_sway_joint(const tpc_air *air, const treepieces_node *n, float yield,
                           const float wind[3], float *state, float q[4]) {
    const int mode = n->sway % TPC_CLASSES, phase = n->sway / TPC_CLASSES;
    const float back[4] = {-q[0], -q[1], -q[2], q[3]};
    float w[3];
    tpc_rotate(back, wind, w);
    const float flutter = air->classes[mode].flutter[phase];
    const float other = air->classes[mode].flutter[(phase + 3) % TPC_PHASES];
    const float strength = sqrtf(wind[0] * wind[0] + wind[1] * wind[1] + wind[2] * wind[2]);
    const float give = air->classes[mode].give * txm_clampf(yield * n->length, 0.1f, 3);
    /* equilibrium, leaning with the wind: towards +z about +x, towards +x about -z */
    const float rest[2] = {tpc_soften(give * (w[2] + strength * flutter)),
                           tpc_soften(-give * (w[0] + strength * other))};
    for (int k = 0; k < 2; k++) {
        const float x = state[2 * k] - rest[k], v = state[2 * k + 1];
        state[2 * k] = rest[k] + (air->classes[mode].xx * x + air->classes[mode].xv * v);
        state[2 * k + 1] = air->classes[mode].vx * x + air->classes[mode].vv * v;
    }
    tpc_bend(q, state[0], state[2]);
}

/* The bones of a tree, parents first. */
static void tpc_pose_tree(void *context, int index) {
    const tpc_posing *p = (const tpc_posing *)context;
    const treepieces_tree *t = &p->forest->trees[index];
    const float stiffness = p->forest->species[t->species].stiffness;
    const float yield = 16 / (stiffness * txm_maxf(t->height, 0.1f)); /* of one metre of stem */
    float pressure = 0;
    if (p->air) pressure = tpc_pressure(p->air, t->position, p->air->time);
    for (uint32_t i = 0; i < t->node_count; i++) {
        const uint32_t number = t->first_node + i;
        const treepieces_node *n = &p->forest->nodes[number];
        float *b = p->bones + TREEPIECES_BONE * (size_t)number;
        float q[4] = {n->rotation[0], n->rotation[1], n->rotation[2], n->rotation[3]};
        float r[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}; /* rows of the parent's rotation */
        float at[3] = {t->position[0], t->position[1], t->position[2]};
        if (n->parent >= 0) {
            const treepieces_node *up = n - i + n->parent;
            const float *a = p->bones + TREEPIECES_BONE * (size_t)(t->first_node + (uint32_t)n->parent);
            const float *to = p->forest->kit->pieces[up->type].building[n->joint >> 3].translation;
            const float by_radius = 1 / up->radius, by_length = 1 / up->length;
            for (int k = 0; k < 3; k++) {
                r[3 * k] = a[4 * k] * by_radius;
                r[3 * k + 1] = a[4 * k + 1] * by_length;
                r[3 * k + 2] = a[4 * k + 2] * by_radius;
                at[k] = ((a[4 * k] * to[0] + a[4 * k + 1] * to[1]) + a[4 * k + 2] * to[2]) + a[4 * k + 3];
            }
        }
        if (p->pose) tpc_pose_joint(p->pose, t, i, q);
        if (p->air) {
            const float *d = p->air->direction;
            const float wind[3] = {pressure * (r[0] * d[0] + r[6] * d[2]),
                                   pressure * (r[1] * d[0] + r[7] * d[2]),
                                   pressure * (r[2] * d[0] + r[8] * d[2])};
            tpc_sway_joint(p->air, n, yield, wind, p->state + 4 * (size_t)number, q);
        }
        const float x2 = q[0] + q[0], y2 = q[1] + q[1], z2 = q[2] + q[2];
        const float m[9] = {1 - (q[1] * y2 + q[2] * z2), q[0] * y2 - q[3] * z2, q[0] * z2 + q[3] * y2,
                            q[0] * y2 + q[3] * z2, 1 - (q[0] * x2 + q[2] * z2), q[1] * z2 - q[3] * x2,
                            q[0] * z2 - q[3] * y2, q[1] * z2 + q[3] * x2, 1 - (q[0] * x2 + q[1] * y2)};
        for (int k = 0; k < 3; k++) {
            const float *row = r + 3 * k;
            b[4 * k] = n->radius * ((row[0] * m[0] + row[1] * m[3]) + row[2] * m[6]);
            b[4 * k + 1] = n->length * ((row[0] * m[1] + row[1] * m[4]) + row[2] * m[7]);
            b[4 * k + 2] = n->radius * ((row[0] * m[2] + row[1] * m[5]) + row[2] * m[8]);
            b[4 * k + 3] = at[k];
        }
    }
}

static txm_status tpc_check_pose(const treepieces_pose *pose, txm_env *env) {
    if (pose && !(pose->amount >= 0 && pose->amount <= 2))
        return txm_fail(env, TXM_BAD_ARGUMENT, "amount must be 0 to 2 radians");
    return TXM_OK;
}

TREEPIECES_API txm_status treepieces_bones(const treepieces_forest *forest,
                                           const treepieces_pose *pose, txm_env *env, float *bones) {
    if (!forest || !bones) return txm_fail(env, TXM_BAD_ARGUMENT, "forest or bones is NULL");
    const txm_status status = tpc_check_pose(pose, env);
    if (status != TXM_OK) return status;
    tpc_posing p;
    memset(&p, 0, sizeof p);
    p.forest = forest;
    p.pose = pose;
    p.bones = bones;
    txm_parallel_for(env, forest->tree_count, tpc_pose_tree, &p);
    return TXM_OK;
}

TREEPIECES_API txm_status treepieces_sway(const treepieces_forest *forest,
                                          const treepieces_wind *wind, double time, double dt,
                                          const treepieces_pose *pose, txm_env *env, float *state,
                                          float *bones) {
    if (!forest || !state || !bones)
        return txm_fail(env, TXM_BAD_ARGUMENT, "forest, state or bones is NULL");
    if (!tpc_is_wind(wind))
        return txm_fail(env, TXM_BAD_ARGUMENT, "wind is NULL, or a field of it out of range");
    if (!(fabs(time) <= 1e9) || !(dt >= 0 && dt <= 1e9))
        return txm_fail(env, TXM_BAD_ARGUMENT, "time and dt must be finite, dt not below 0");
    const txm_status status = tpc_check_pose(pose, env);
    if (status != TXM_OK) return status;
    tpc_air air;
    tpc_posing p;
    memset(&p, 0, sizeof p);
    tpc_make_waves(wind, &air);
    air.time = time;
    tpc_make_classes(wind, dt, &air);
    p.forest = forest;
    p.pose = pose;
    p.air = &air;
    p.state = state;
    p.bones = bones;
    txm_parallel_for(env, forest->tree_count, tpc_pose_tree, &p);
    return TXM_OK;
}

/* ---- skinning ---------------------------------------------------------------------------- */

static void tpc_move_point(const float *bone, const float p[3], float out[3]) {
    for (int k = 0; k < 3; k++)
        out[k] = ((bone[4 * k] * p[0] + bone[4 * k + 1] * p[1]) + bone[4 * k + 2] * p[2]) +
                 bone[4 * k + 3];
}

/* squares of the lengths of a bone's columns */
static void tpc_columns(const float *bone, float squares[3]) {
    for (int k = 0; k < 3; k++)
        squares[k] = (bone[k] * bone[k] + bone[4 + k] * bone[4 + k]) + bone[8 + k] * bone[8 + k];
}

/* n by the inverse transpose: as columns are orthogonal, each is divided by its square */
static void tpc_move_normal(const float *bone, const float n[3], float out[3]) {
    float squares[3];
    tpc_columns(bone, squares);
    const float m[3] = {n[0] / squares[0], n[1] / squares[1], n[2] / squares[2]};
    for (int k = 0; k < 3; k++)
        out[k] = (bone[4 * k] * m[0] + bone[4 * k + 1] * m[1]) + bone[4 * k + 2] * m[2];
}

/* The bones of a record's children, relative to its own; 0 where there is none. */
static void tpc_children(const uint32_t *record, uint32_t children[TREEPIECES_MAX_LEAVES]) {
    children[0] = record[1] & 0xffffu;
    children[1] = record[1] >> 16;
    children[2] = record[2] & 0xffffu;
}

/* An instance of a piece with what its bones have in common for all its vertices. */
typedef struct tpc_instance {
    const treepieces_piece *piece;
    const tpc_local_vertex *local;                   /* vertex_count for each leaf rim       */
    const float *own, *child[TREEPIECES_MAX_LEAVES]; /* bones                                */
    float own_squares[3], squares[TREEPIECES_MAX_LEAVES][3]; /* of the bones' columns        */
    float stretch[TREEPIECES_MAX_LEAVES];            /* of the own piece over the child's    */
    int turn[TREEPIECES_MAX_LEAVES];
} tpc_instance;

static void tpc_find_instance(const treepieces_forest *forest, const float *bones, int type,
                              uint32_t number, tpc_instance *s) {
    const treepieces_batch *batch = &forest->batches[type];
    const uint32_t *word = batch->words + (size_t)number * batch->stride;
    uint32_t difference[TREEPIECES_MAX_LEAVES];
    s->piece = &forest->kit->pieces[type];
    s->local = forest->kit->local[type];
    s->own = bones + TREEPIECES_BONE * (size_t)word[0];
    tpc_columns(s->own, s->own_squares);
    tpc_children(word, difference);
    for (int k = 0; k < s->piece->leaf_count; k++) {
        s->child[k] = s->own + TREEPIECES_BONE * (size_t)difference[k];
        s->turn[k] = (int)(word[2] >> (16 + 4 * k) & 15u);
        tpc_columns(s->child[k], s->squares[k]);
        /* products of the squares would underflow where a species at its limits is that small */
        s->stretch[k] = sqrtf((s->squares[k][0] / s->own_squares[0]) *
                              (s->own_squares[1] / s->squares[k][1]));
    }
}

/* Vertex i, which is on no leaf rim; the normal has no unit length yet. */
static void tpc_blend_vertex(const tpc_instance *s, int i, float position[3], float normal[3]) {
    const treepieces_vertex *v = &s->piece->vertices[i];
    const float w = v->weights[0];
    float p[3], n[3], moved[3];
    tpc_move_point(s->own, v->position, position);
    tpc_move_normal(s->own, v->normal, normal);
    for (int c = 0; c < 3 && w < 1; c++) position[c] *= w;
    for (int c = 0; c < 3 && w < 1; c++) normal[c] *= w * sqrtf(s->own_squares[0]);
    for (int k = 0; k < s->piece->leaf_count; k++) {
        const float wk = v->weights[1 + k];
        const tpc_local_vertex *at = &s->local[k * s->piece->vertex_count + i];
        if (!(wk > 0)) continue;
        tpc_turn((TREEPIECES_RIM - s->turn[k]) % TREEPIECES_RIM, at->position, p);
        tpc_turn((TREEPIECES_RIM - s->turn[k]) % TREEPIECES_RIM, at->normal, n);
        p[1] *= s->stretch[k];
        n[1] /= s->stretch[k];
        tpc_move_point(s->child[k], p, moved);
        for (int c = 0; c < 3; c++) position[c] += wk * moved[c];
        tpc_move_normal(s->child[k], n, moved);
        for (int c = 0; c < 3; c++) normal[c] += wk * sqrtf(s->squares[k][0]) * moved[c];
    }
}

TREEPIECES_API void treepieces_skin(const treepieces_forest *forest, const float *bones, int type,
                                    uint32_t instance, float *positions, float *normals) {
    tpc_instance s;
    tpc_find_instance(forest, bones, type, instance, &s);
    for (int i = 0; i < s.piece->vertex_count; i++) {
        const int rim = s.piece->vertices[i].rim;
        float p[3], n[3], normal[3];
        if (rim >= 0) {
            const int k = rim / TREEPIECES_RIM;
            tpc_rim_vertex((rim + TREEPIECES_RIM - s.turn[k]) % TREEPIECES_RIM, p, n);
            tpc_move_point(s.child[k], p, positions + 3 * i);
            if (!normals) continue;
            tpc_move_normal(s.child[k], n, normal);
        } else {
            tpc_blend_vertex(&s, i, positions + 3 * i, normal);
            if (!normals) continue;
        }
        tpc_unit(normal);
        memcpy(normals + 3 * i, normal, sizeof normal);
    }
}

/* ---- level of detail --------------------------------------------------------------------- */

/* The level at the mean of `count` points, which are given as their sum. */
static int tpc_level(const treepieces_lod *lod, const float sum[3], float count) {
    const float half = lod->half_distance > 0 ? lod->half_distance : 10;
    const float most = txm_clampf(lod->max_level, 1, 64);
    double squares = 0;
    for (int k = 0; k < 3; k++) {
        const double d = (double)(sum[k] / count - lod->eye[k]);
        squares += d * d;
    }
    const float halvings = txm_clampf(txm_float(sqrt(squares) / half), 0, 100);
    const double level = (double)most * txm_exp2(-halvings);
    const int whole = (int)level;
    return whole < 1 ? 1 : whole + (level > whole);
}

TREEPIECES_API int treepieces_edge_level(const treepieces_lod *lod, const float a[3],
                                         const float b[3]) {
    const float sum[3] = {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
    return tpc_level(lod, sum, 2);
}

TREEPIECES_API int treepieces_inner_level(const treepieces_lod *lod, const float corners[12]) {
    float sum[3];
    for (int k = 0; k < 3; k++)
        sum[k] = (corners[k] + corners[3 + k]) + (corners[6 + k] + corners[9 + k]);
    return tpc_level(lod, sum, 4);
}

/* Position i of 0..n along a side, a multiple of 2^-16, so that position n - i is exactly 1 minus
   that of i. The step 1 / n is rounded once, then multiplied, as tessellation units do. */
static float tpc_fraction(int i, int n) {
    if (2 * i > n) return 1 - tpc_fraction(n - i, n);
    if (2 * i == n) return 0.5f;
    const int step = (65536 * 2 + n) / (2 * n);
    return (float)(i * step) / 65536.0f;
}

/* The vertices of a pattern: first those of the sides, side k from corner k up to the one before
   corner k + 1, then the inner grid, column by column. */
typedef struct tpc_pattern {
    int edges[4], first[4], inner, outer_count;
} tpc_pattern;

static int tpc_side_vertex(const tpc_pattern *p, int side, int i) {
    return i < p->edges[side] ? p->first[side] + i : p->first[(side + 1) % 4];
}

/* Vertex i of 0..inner - 2 on the border of the inner grid along a side, in the side's direction. */
static int tpc_inner_vertex(const tpc_pattern *p, int side, int i) {
    const int n = p->inner - 1, back = n - 1 - i;
    const int u = side == 0 ? 0 : side == 1 ? i : side == 2 ? n - 1 : back;
    const int v = side == 0 ? i : side == 1 ? n - 1 : side == 2 ? back : 0;
    return p->outer_count + u * n + v;
}

static void tpc_add_triangle(uint16_t *indices, int *count, int a, int b, int c) {
    if (indices) {
        indices[3 * *count] = (uint16_t)a;
        indices[3 * *count + 1] = (uint16_t)b;
        indices[3 * *count + 2] = (uint16_t)c;
    }
    ++*count;
}

/* The strip between a side and the inner grid: always advance on the one that is less far along. */
static void tpc_stitch(const tpc_pattern *p, int side, uint16_t *indices, int *count) {
    const int outer = p->edges[side], inner = p->inner - 2;
    int i = 0, j = 0;
    while (i < outer || j < inner) {
        /* middles of the next outer and inner step; inner place j lies at (j + 1) / (inner + 2) */
        const int a = (2 * i + 1) * (inner + 2), b = (2 * j + 3) * outer;
        if (j == inner || (i < outer && a <= b)) {
            tpc_add_triangle(indices, count, tpc_side_vertex(p, side, i),
                             tpc_side_vertex(p, side, i + 1), tpc_inner_vertex(p, side, j));
            i++;
        } else {
            tpc_add_triangle(indices, count, tpc_side_vertex(p, side, i),
                             tpc_inner_vertex(p, side, j + 1), tpc_inner_vertex(p, side, j));
            j++;
        }
    }
}

TREEPIECES_API int treepieces_pattern(const int edges[4], int inner, float *coords,
                                      uint16_t *indices, int *triangles) {
    static const int corner_u[4] = {0, 0, 1, 1}, corner_v[4] = {0, 1, 1, 0};
    tpc_pattern p;
    int count = 0;
    p.outer_count = 0;
    p.inner = txm_clampi(inner, 1, 64);
    for (int k = 0; k < 4; k++) {
        p.edges[k] = txm_clampi(edges[k], 1, 64);
        p.first[k] = p.outer_count;
        p.outer_count += p.edges[k];
    }
    if (p.inner == 1 && p.outer_count > 4) p.inner = 2;
    const int n = p.inner - 1;
    if (!coords && !indices) { /* the strips and the inner grid */
        count = n == 0 ? 2 : p.outer_count + 4 * (n - 1) + 2 * (n - 1) * (n - 1);
        if (triangles) *triangles = count;
        return p.outer_count + n * n;
    }
    for (int k = 0; k < 4 && coords; k++) {
        for (int i = 0; i < p.edges[k]; i++) {
            const float t = tpc_fraction(i, p.edges[k]), back = 1 - t;
            float *at = coords + 2 * (p.first[k] + i);
            const int u = corner_u[k], v = corner_v[k], next = (k + 1) % 4;
            at[0] = u == corner_u[next] ? (float)u : u ? back : t;
            at[1] = v == corner_v[next] ? (float)v : v ? back : t;
        }
    }
    for (int u = 0; u < n; u++) {
        for (int v = 0; v < n; v++) {
            if (coords) {
                float *at = coords + 2 * (p.outer_count + u * n + v);
                at[0] = tpc_fraction(u + 1, p.inner);
                at[1] = tpc_fraction(v + 1, p.inner);
            }
            if (u + 1 == n || v + 1 == n) continue;
            const int a = p.outer_count + u * n + v;
            tpc_add_triangle(indices, &count, a, a + 1, a + n + 1);
            tpc_add_triangle(indices, &count, a, a + n + 1, a + n);
        }
    }
    if (n == 0) {
        tpc_add_triangle(indices, &count, 0, 1, 2);
        tpc_add_triangle(indices, &count, 0, 2, 3);
    }
    for (int k = 0; k < 4 && n > 0; k++) tpc_stitch(&p, k, indices, &count);
    if (triangles) *triangles = count;
    return p.outer_count + n * n;
}

/* The bilinear weights of the corners at (u, v). */
static void tpc_corner_weights(float u, float v, float w[4]) {
    w[0] = (1 - u) * (1 - v);
    w[1] = (1 - u) * v;
    w[2] = u * v;
    w[3] = u * (1 - v);
}

/* A weighted sum of four numbers. Independent of the order of the corners to the bit while at most
   two weights are not 0, as on a side: opposite corners are added first, and x + 0 is x. */
static float tpc_mix(const float w[4], float a, float b, float c, float d) {
    return (w[0] * a + w[2] * c) + (w[1] * b + w[3] * d);
}

TREEPIECES_API void treepieces_patch_point(const float positions[12], const float normals[12],
                                           float shape, float u, float v, float position[3],
                                           float normal[3]) {
    const float alpha = shape < 0 ? 0 : shape > 0 ? shape : 0.6f;
    float w[4], p[3], n[3], depth[4];
    tpc_corner_weights(u, v, w);
    for (int k = 0; k < 3; k++) {
        p[k] = tpc_mix(w, positions[k], positions[3 + k], positions[6 + k], positions[9 + k]);
        n[k] = tpc_mix(w, normals[k], normals[3 + k], normals[6 + k], normals[9 + k]);
    }
    for (int i = 0; i < 4; i++) { /* height above the tangent plane of the corner */
        const float *corner = positions + 3 * i, *up = normals + 3 * i;
        depth[i] = (up[0] * (p[0] - corner[0]) + up[1] * (p[1] - corner[1])) +
                   up[2] * (p[2] - corner[2]);
    }
    for (int k = 0; k < 3; k++)
        position[k] = p[k] - alpha * tpc_mix(w, depth[0] * normals[k], depth[1] * normals[3 + k],
                                             depth[2] * normals[6 + k], depth[3] * normals[9 + k]);
    if (!normal) return;
    tpc_unit(n);
    memcpy(normal, n, sizeof n);
}

/* ---- pictures with hidden colours ---------------------------------------------------------- */

/* A picture of the form of out in the arena, to be drawn and then delivered. */
static txm_status tpc_new_picture(const txm_image *out, txm_arena *arena, txm_env *env,
                                  txm_image *picture) {
    *picture = *out;
    picture->stride = 0;
    *picture = txm_image_resolve(*picture);
    picture->pixels = txm_arena_alloc(arena, (size_t)picture->height, (size_t)picture->stride);
    return picture->pixels ? TXM_OK : txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a picture");
}

static void tpc_copy_picture(const txm_image *picture, const txm_image *out) {
    for (int y = 0; y < picture->height; y++)
        memcpy(txm_image_row(out, y), txm_image_row_const(picture, y), (size_t)picture->stride);
}

/* Bleed hidden colours and copy the picture to out, which is untouched after an error. */
static txm_status tpc_deliver(const txm_image *picture, const txm_image *out, txm_env *env) {
    const txm_status status = txm_image_bleed(picture, 0, env);
    if (status == TXM_OK) tpc_copy_picture(picture, out);
    return status;
}

/* ---- bark: sheets of framed tiles --------------------------------------------------------- */

TREEPIECES_API int treepieces_bark_layers(const treepieces_bark_desc *desc) {
    int layers = TREEPIECES_OWN;
    for (int i = 0; desc && desc->classes && i < desc->tile_count; i++)
        if (desc->classes[i] >= layers) layers = desc->classes[i] + 1;
    return layers;
}

static txm_status tpc_check_bark(const treepieces_bark_desc *d, const txm_image *out,
                                 txm_env *env) {
    if (!d || !d->tiles) return txm_fail(env, TXM_BAD_ARGUMENT, "desc or tiles is NULL");
    if (d->tile_count < 1 || d->tile_count > 4096)
        return txm_fail(env, TXM_BAD_ARGUMENT, "tile_count must be 1 to 4096");
    int plain = 0;
    for (int i = 0; i < d->tile_count; i++) {
        const txm_status status = txm_image_check(&d->tiles[i], "a tile", 0, env);
        const int c = d->classes ? d->classes[i] : TREEPIECES_BARK;
        if (status != TXM_OK) return status;
        const txm_image t = txm_image_resolve(d->tiles[i]), first = txm_image_resolve(d->tiles[0]);
        if (t.width != t.height || t.width != first.width || t.channels != first.channels ||
            t.sample != first.sample)
            return txm_fail(env, TXM_BAD_ARGUMENT,
                            "tiles must be square, of one size, sample type and channel count");
        if (t.width < 4 || t.width > 4096 || t.width % 2)
            return txm_fail(env, TXM_BAD_ARGUMENT,
                            "tiles must be 4 to 4096 pixels wide, an even number");
        if (c != TREEPIECES_BARK && (c < TREEPIECES_OWN || c > 63))
            return txm_fail(env, TXM_BAD_ARGUMENT, "classes must be 0 or 5 to 63");
        plain += c == TREEPIECES_BARK;
    }
    if (!plain) return txm_fail(env, TXM_BAD_ARGUMENT, "no tile is of class 0");
    const txm_status status = txm_image_check(out, "out", 0, env);
    if (status != TXM_OK) return status;
    const txm_image o = txm_image_resolve(*out), t = txm_image_resolve(d->tiles[0]);
    if (o.width != TREEPIECES_SHEET * t.width || o.channels != t.channels || o.sample != t.sample ||
        o.height != TREEPIECES_SHEET * t.width * treepieces_bark_layers(d))
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "out must be 8 tiles wide, 8 a layer high, of the tiles' channels and "
                        "samples");
    return TXM_OK;
}

/* A random tile of a class, if possible not one of the two given; -1: there is none. */
static int tpc_pick_tile(const treepieces_bark_desc *d, int tile_class, txm_rng *rng, int unlike,
                         int unlike_too) {
    int best = -1;
    uint32_t most = 0;
    for (int i = 0; i < d->tile_count; i++) {
        if ((d->classes ? d->classes[i] : TREEPIECES_BARK) != tile_class) continue;
        /* others come before those two */
        const uint32_t preferred = i != unlike && i != unlike_too ? 1u << 31 : 1;
        const uint32_t ticket = (txm_rng_next(rng) >> 1) | preferred;
        if (ticket > most) {
            most = ticket;
            best = i;
        }
    }
    return best;
}

/* 1 at x = 0 falling smoothly to 0 at x = 1 and beyond */
static float tpc_fade(float x) {
    const float t = txm_clampf(1 - x, 0, 1);
    return t * t * (3 - 2 * t);
}

/* What is blended into a texel: one of the tile itself, or four of a tile that is shown at half
   size. */
typedef struct tpc_blend {
    const txm_image *from;
    int x, y, side; /* the first of side x side texels */
    float weight;   /* of it; the rest is the texel's own */
} tpc_blend;

/* The blend of texel (x, y) of a cell of the lowest row: towards the south side what the layer
   requires there. lower: four tiles, shown at half size, for HALVING. */
static tpc_blend tpc_blend_at(const txm_image *tile, const txm_image *const lower[4], int layer,
                              int x, int y) {
    const int last = tile->width - 1, size = tile->width;
    const float rise = (float)(last - y) / (float)size; /* from the south side, in tiles */
    tpc_blend b = {tile, x, y, 1, 0};
    if (layer == TREEPIECES_FOLD) { /* half of its mirror image: then it is symmetric */
        b.weight = 0.5f * tpc_fade(4 * rise);
        b.x = last - x;
    } else if (layer == TREEPIECES_TURN_LEFT) { /* its west side, turned to the south */
        b.weight = tpc_fade(2 * rise);
        b.x = last - y;
        b.y = x;
    } else if (layer == TREEPIECES_TURN_RIGHT) { /* its east side */
        b.weight = tpc_fade(2 * rise);
        b.x = y;
        b.y = last - x;
    } else if (layer == TREEPIECES_HALVING) {
        b.weight = tpc_fade(rise);
        b.from = lower[(2 * x >= size) + 2 * (2 * y >= size)];
        b.x = 2 * x % size;
        b.y = 2 * y % size;
        b.side = 2;
    }
    return b;
}

/* One channel of it, where all texels are opaque. */
static float tpc_blend_channel(const txm_image *tile, const tpc_blend *b, int x, int y, int c) {
    float other = txm_image_get(b->from, b->x, b->y, c);
    if (b->side == 2)
        other = 0.25f * ((other + txm_image_get(b->from, b->x + 1, b->y, c)) +
                         (txm_image_get(b->from, b->x, b->y + 1, c) +
                          txm_image_get(b->from, b->x + 1, b->y + 1, c)));
    return txm_lerpf(txm_image_get(tile, x, y, c), other, b->weight);
}

/* All channels: colours count as much as they show. */
static void tpc_blend_texel(const txm_image *tile, const tpc_blend *b, int x, int y, float *texel) {
    const int count = b->side * b->side, channels = tile->channels;
    txm_mean mean = txm_mean_of(channels);
    float other[4][4];
    txm_image_pixel(tile, x, y, texel);
    int is_opaque = !txm_image_has_alpha(tile) || texel[channels - 1] >= 1;
    for (int k = 0; k < count; k++) {
        txm_image_pixel(b->from, b->x + k % 2, b->y + k / 2, other[k]);
        is_opaque &= !txm_image_has_alpha(tile) || other[k][channels - 1] >= 1;
    }
    for (int c = 0; c < channels && is_opaque; c++)
        texel[c] = tpc_blend_channel(tile, b, x, y, c);
    if (is_opaque) return;
    txm_mean_add(&mean, texel, 1 - (double)b->weight);
    for (int k = 0; k < count; k++) txm_mean_add(&mean, other[k], (double)b->weight / count);
    txm_mean_get(&mean, texel);
}

static void tpc_draw_cell(const txm_image *out, int column, int top, const txm_image *tile,
                          const txm_image *const lower[4], int layer, int is_lowest) {
    const size_t texel = (size_t)tile->channels * txm_sample_bytes(tile->sample);
    for (int y = 0; y < tile->width; y++) {
        char *row = (char *)txm_image_row(out, top + y) + (size_t)(column * tile->width) * texel;
        if (!is_lowest || layer == TREEPIECES_BARK) {
            memcpy(row, txm_image_row_const(tile, y), (size_t)tile->width * texel);
            continue;
        }
        for (int x = 0; x < tile->width; x++) {
            const tpc_blend blend = tpc_blend_at(tile, lower, layer, x, y);
            float color[4];
            tpc_blend_texel(tile, &blend, x, y, color);
            for (int c = 0; c < tile->channels; c++)
                txm_image_set(out, column * tile->width + x, top + y, c, color[c]);
        }
    }
}

/* A layer of one of the caller's classes: each tile on 2 x 2 cells, extended by its border. */
static void tpc_draw_own(const treepieces_bark_desc *d, const txm_image *out, int layer,
                         txm_rng *rng) {
    const int size = txm_image_resolve(d->tiles[0]).width, first = layer * TREEPIECES_SHEET * size;
    for (int b = 0; b < 16; b++) {
        const int number = tpc_pick_tile(d, layer, rng, -1, -1);
        const txm_image tile = txm_image_resolve(d->tiles[number < 0 ? 0 : number]);
        for (int y = 0; y < 2 * size; y++)
            for (int x = 0; x < 2 * size; x++)
                for (int c = 0; c < tile.channels; c++) {
                    const int from_x = txm_clampi(x - size / 2, 0, size - 1);
                    const int from_y = txm_clampi(y - size / 2, 0, size - 1);
                    txm_image_set(out, b % 4 * 2 * size + x, first + b / 4 * 2 * size + y, c,
                                  txm_image_get(&tile, from_x, from_y, c));
                }
    }
}

static void tpc_draw_layer(const treepieces_bark_desc *d, const txm_image *out, int layer) {
    enum { SIDE = TREEPIECES_SHEET };
    int chosen[SIDE][SIDE];
    txm_rng rng = txm_rng_make(d->seed, (uint64_t)layer);
    if (layer >= TREEPIECES_OWN) {
        tpc_draw_own(d, out, layer, &rng);
        return;
    }
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            const int left = x ? chosen[y][x - 1] : -1, above = y ? chosen[y - 1][x] : -1;
            const txm_image *lower[4];
            txm_image halves[4];
            chosen[y][x] = tpc_pick_tile(d, TREEPIECES_BARK, &rng, left, above);
            for (int k = 0; k < 4; k++) {
                const int number = tpc_pick_tile(d, TREEPIECES_BARK, &rng, chosen[y][x], -1);
                halves[k] = txm_image_resolve(d->tiles[number]);
                lower[k] = &halves[k];
            }
            const txm_image tile = txm_image_resolve(d->tiles[chosen[y][x]]);
            tpc_draw_cell(out, x, (layer * SIDE + y) * tile.width, &tile, lower, layer,
                          y == SIDE - 1);
        }
    }
}

TREEPIECES_API txm_status treepieces_bark(const treepieces_bark_desc *desc, txm_env *env,
                                          txm_image out) {
    txm_status status = tpc_check_bark(desc, &out, env);
    if (status != TXM_OK) return status;
    const txm_image o = txm_image_resolve(out);
    txm_image picture = o;
    const int layers = treepieces_bark_layers(desc), has_alpha = txm_image_has_alpha(&o);
    txm_arena arena;
    txm_arena_init(&arena, env);
    if (has_alpha) status = tpc_new_picture(&o, &arena, env, &picture);
    for (int layer = 0; layer < layers && status == TXM_OK; layer++)
        tpc_draw_layer(desc, &picture, layer);
    if (has_alpha && status == TXM_OK) status = tpc_deliver(&picture, &o, env);
    txm_arena_free(&arena);
    return status;
}

TREEPIECES_API int treepieces_quad_uv(const treepieces_quad *quad, uint32_t bands, int cell,
                                      int pixels, int corner, float uv[2]) {
    const uint32_t band = bands >> (8 * quad->band) & 255u;
    const int is_own = quad->tile_class >= TREEPIECES_OWN;
    const int across = is_own ? 1 : 1 << (band & 7), along = is_own ? 1 : 1 << (band >> 3 & 3);
    const int east = corner >= 2, south = corner == 1 || corner == 2;
    const float shift = is_own ? 0.5f : 0, half = 0.5f / (float)pixels;
    uv[0] = ((float)((cell & 7) + (east ? across : 0)) + shift) / (float)TREEPIECES_SHEET;
    uv[1] = ((float)((cell >> 3) + (south ? along : 0)) + shift) / (float)TREEPIECES_SHEET;
    uv[1] += south ? -half : half; /* layers lie one under the other */
    if (quad->tile_class == TREEPIECES_BARK && (band & 32)) return TREEPIECES_HALVING;
    return quad->tile_class;
}

/* ---- bark: drawn ---------------------------------------------------------------------------- */

/* Smooth value noise, 0..1, on the unit torus with columns x rows cells. */
static float tpc_noise(float x, float y, int columns, int rows, uint64_t seed) {
    const float u = x * (float)columns, v = y * (float)rows;
    const int i = (int)u, j = (int)v;
    const float s = tpc_fade(1 - (u - (float)i)), t = tpc_fade(1 - (v - (float)j));
    float corner[4];
    for (int k = 0; k < 4; k++) {
        const uint64_t a = (uint64_t)((i + (k & 1)) % columns);
        const uint64_t b = (uint64_t)((j + (k >> 1)) % rows);
        corner[k] = (float)(txm_hash(seed ^ (a << 40) ^ (b << 20)) >> 40) / 16777216.0f;
    }
    return txm_lerpf(txm_lerpf(corner[0], corner[1], s), txm_lerpf(corner[2], corner[3], s), t);
}

/* Noise for tile `number`: its own inside, one that all tiles share at the border. The blend is
   scaled so that its contrast is that of either. */
static float tpc_framed_noise(float x, float y, int columns, int rows, uint64_t seed, int number) {
    const float border = txm_minf(txm_minf(x, 1 - x), txm_minf(y, 1 - y));
    const float inside = 1 - tpc_fade((border - 0.03f) * 5), outside = 1 - inside;
    if (!(inside > 0)) return tpc_noise(x, y, columns, rows, seed);
    const float frame = outside > 0 ? tpc_noise(x, y, columns, rows, seed) - 0.5f : 0;
    const float own = tpc_noise(x, y, columns, rows, seed + 1 + (uint64_t)number) - 0.5f;
    return 0.5f + (outside * frame + inside * own) / sqrtf(inside * inside + outside * outside);
}

/* A place of a tile of bark that is being drawn. */
typedef struct tpc_bark_place {
    float x, y; /* in the tile, 0..1 */
    uint64_t seed;
    int number; /* of the tile */
} tpc_bark_place;

/* -1/2..1/2; salt: which of the noises of a bark */
static float tpc_bark_noise(const tpc_bark_place *p, int columns, int rows, uint64_t salt) {
    return tpc_framed_noise(p->x, p->y, columns, rows, p->seed + salt, p->number) - 0.5f;
}

/* Brightness of bark, about 1: ridges between fissures along the stem, grain on them. A fissure crosses
   the frame in the middle of a tile, at the same place in all, and wanders and ends in between, so that
   the frame is not visible. Plates: wider ones, with cracks all round, of different height. */
static float tpc_furrowed_bark(const tpc_bark_place *p, int is_plates) {
    const float slow = tpc_bark_noise(p, 3, 2, 1000), quick = tpc_bark_noise(p, 9, 6, 2000);
    const float grain = tpc_bark_noise(p, 26, 8, 3000), fine = tpc_bark_noise(p, 40, 24, 3500);
    const float across = 1.5f + p->x + 0.75f * slow + 0.16f * quick + 0.07f * grain;
    const int ridge = (int)across;
    const float f = across - (float)ridge, edge = txm_minf(f, 1 - f);
    const float border = txm_minf(txm_minf(p->x, 1 - p->x), txm_minf(p->y, 1 - p->y));
    const float inside = 1 - tpc_fade((border - 0.03f) * 4);
    const float gap = (is_plates ? 0.09f : 0.13f) + 0.42f * inside * tpc_bark_noise(p, 4, 3, 4000);
    /* cracks across a ridge, half a tile higher on every second one */
    const float bend = tpc_bark_noise(p, 3, 3, 5000);
    const float along = 1 + p->y + 0.5f * (float)(ridge & 1) + 0.7f * bend + 0.1f * quick;
    const float g = along - (float)(int)along;
    const float open = is_plates ? 1 : 2.4f * (tpc_bark_noise(p, 3, 3, 6000) + 0.02f);
    const float crack = inside * tpc_fade(txm_minf(g, 1 - g) / 0.07f) * txm_clampf(open, 0, 1);
    const float fissure = gap > 0.02f ? tpc_fade(edge / gap) : 0;
    const float depth = txm_maxf(fissure, (is_plates ? 0.9f : 0.6f) * crack);
    /* a ridge is lit from one side; layers that flake off have edges */
    const float flake = is_plates ? 0.22f * tpc_fade(fabsf(slow + 0.4f * quick) * 12) : 0;
    const float top = 0.60f + 0.22f * (0.5f - f) + 0.22f * slow + 0.2f * quick - flake;
    return 0.45f + top * (1 - 0.85f * depth) + (0.34f - 0.2f * depth) * grain + 0.16f * fine;
}

/* Smooth bark: spots, and fine wrinkles across the stem. */
static float tpc_smooth_bark(const tpc_bark_place *p) {
    const float spots = tpc_bark_noise(p, 3, 4, 6000), wrinkle = tpc_bark_noise(p, 4, 22, 6500);
    const float fine = tpc_bark_noise(p, 24, 40, 7000);
    return 0.95f + 0.2f * spots + 0.2f * wrinkle + 0.1f * fine;
}

/* Smooth bark with lenticels across it: dark ones on pale bark, as of birches, else paler ones. None
   lie on the frame, where their repetition would be visible. */
static float tpc_lenticel_bark(const tpc_bark_place *p, int is_pale) {
    const float border = txm_minf(txm_minf(p->x, 1 - p->x), txm_minf(p->y, 1 - p->y));
    const float inside = 1 - tpc_fade((border - 0.03f) * 5);
    const uint64_t own = p->seed + 5000 + (uint64_t)p->number;
    const float mark = tpc_noise(p->x, p->y, 2, 13, own);
    const float wide = tpc_noise(p->x, p->y, 1, 6, own + 1000);
    const float shade = tpc_bark_noise(p, 3, 5, 6000), grain = tpc_bark_noise(p, 20, 40, 7000);
    const float marks = inside * (0.55f * tpc_fade((0.88f - mark) * 8) + 0.5f * tpc_fade((0.93f - wide) * 8));
    return (is_pale ? 0.98f - marks : 0.92f + 0.6f * marks) + 0.1f * grain + 0.12f * shade;
}

static float tpc_bark_relief(const treepieces_species *species, const tpc_bark_place *p) {
    const float *color = species->bark_color;
    switch (species->bark_kind) {
    case TREEPIECES_BARK_SMOOTH: return tpc_smooth_bark(p);
    case TREEPIECES_BARK_LENTICELS: return tpc_lenticel_bark(p, color[0] + color[1] + color[2] > 1.5f);
    default: return tpc_furrowed_bark(p, species->bark_kind == TREEPIECES_BARK_PLATES);
    }
}

TREEPIECES_API txm_status treepieces_draw_bark(const treepieces_species *species, uint64_t seed,
                                               txm_env *env, const txm_image *tiles,
                                               int tile_count) {
    if (!species || !tiles || tile_count < 1)
        return txm_fail(env, TXM_BAD_ARGUMENT, "species or tiles is NULL, or tile_count below 1");
    for (int i = 0; i < tile_count; i++) {
        const txm_status status = txm_image_check(&tiles[i], "a tile", 0, env);
        if (status != TXM_OK) return status;
        if (tiles[i].width != tiles[i].height || txm_image_resolve(tiles[i]).channels < 3)
            return txm_fail(env, TXM_BAD_ARGUMENT, "tiles must be square, of 3 or 4 channels");
    }
    const float *color = species->bark_color;
    for (int i = 0; i < tile_count; i++) {
        const txm_image t = txm_image_resolve(tiles[i]);
        for (int y = 0; y < t.height; y++) {
            for (int x = 0; x < t.width; x++) {
                const tpc_bark_place p = {((float)x + 0.5f) / (float)t.width,
                                          ((float)y + 0.5f) / (float)t.height, seed, i};
                const float relief = tpc_bark_relief(species, &p);
                const float moss = tpc_bark_noise(&p, 4, 4, 8000);
                const float tint[4] = {1 - 0.08f * moss, 1 + 0.05f * moss, 1 - 0.1f * moss, 1};
                for (int c = 0; c < t.channels; c++)
                    txm_image_set(&t, x, y, c,
                                  c == 3 ? 1 : txm_clampf(color[c] * relief * tint[c], 0, 1));
            }
        }
    }
    return TXM_OK;
}

/* ---- foliage: leaf clouds ------------------------------------------------------------------ */

/* a random number, -1..1 */
static float tpc_signed(txm_rng *rng) {
    return 2 * txm_rng_float(rng) - 1;
}

/* Orient a card: its image grows along `along`, and its face is turned to `facing` as far as that
   allows, or with its back. outward: normal of the cloud's surface there, to which its front is turned;
   the card is shaded as something between that surface and a flat twig. */
static void tpc_orient_card(treepieces_card *card, float along[3], float facing[3],
                            const float outward[3], float wide, float high) {
    tpc_unit_or(along, 1, 0, 0);
    const float share = tpc_dot(facing, along);
    for (int k = 0; k < 3; k++) facing[k] -= share * along[k];
    if (tpc_dot(facing, facing) < 1e-6f) { /* any orthogonal direction */
        facing[0] = along[1];
        facing[1] = -along[0];
        facing[2] = 0;
    }
    tpc_unit_or(facing, 1, 0, 0);
    if (tpc_dot(facing, outward) < 0)
        for (int k = 0; k < 3; k++) facing[k] = -facing[k];
    float right[3];
    tpc_cross(along, facing, right);
    for (int k = 0; k < 3; k++) {
        card->right[k] = wide * right[k];
        card->up[k] = high * along[k];
        card->normal[k] = outward[k] + facing[k];
    }
    tpc_unit_or(card->normal, outward[0], outward[1], outward[2]);
}

/* Impostors show only the unit sphere: move the centre of a card inwards until its corners are
   inside. */
static void tpc_keep_inside(treepieces_card *card) {
    for (int step = 0; step < 64; step++) {
        float most = 0;
        for (int corner = 0; corner < 4; corner++) {
            float p[3];
            for (int k = 0; k < 3; k++)
                p[k] = card->center[k] + (corner & 1 ? card->right[k] : -card->right[k]) +
                       (corner & 2 ? card->up[k] : -card->up[k]);
            most = txm_maxf(most, tpc_dot(p, p));
        }
        if (!(most > 1)) return;
        for (int k = 0; k < 3; k++) card->center[k] *= 0.93f;
    }
}

/* Direction `index` of `count` distributed evenly over the sphere, with some jitter. */
static void tpc_sphere_direction(int index, int count, float phase, txm_rng *rng, float direction[3]) {
    double sine, cosine;
    const float jitter = 0.6f * tpc_signed(rng), off = 0.3f * tpc_signed(rng);
    const float y = txm_clampf(1 - (2 * (float)index + 1 + jitter) / (float)count, -1, 1);
    const float ring = sqrtf(1 - y * y);
    txm_sincos((double)phase + 2.399963229728653 * index + (double)off, &sine, &cosine);
    direction[0] = ring * (float)cosine;
    direction[1] = y;
    direction[2] = ring * (float)sine;
}

/* A position in the unit ball far from the cards so far: the best of some random candidates. This
   avoids clusters and gaps, and puts most cards near the surface. */
static void tpc_far_place(const treepieces_card *cards, int taken, const float size[3],
                          txm_rng *rng, float place[3]) {
    enum { TRIES = 6 };
    float best = -1;
    for (int t = 0; t < TRIES;) {
        float p[3], room = 8;
        for (int k = 0; k < 3; k++) p[k] = tpc_signed(rng);
        if (tpc_dot(p, p) > 1) continue;
        t++;
        for (int i = 0; i < taken; i++) {
            float off[3];
            for (int k = 0; k < 3; k++) off[k] = cards[i].center[k] / size[k] - p[k];
            room = txm_minf(room, tpc_dot(off, off));
        }
        if (room <= best) continue;
        best = room;
        memcpy(place, p, sizeof p);
    }
}

/* What the cards of a cloud have in common. */
typedef struct tpc_cloud {
    int kind, count;
    float scale[3], half; /* of the cloud; half the side of a card */
    float phase;          /* radians, random                       */
    uint32_t seed;        /* of what belongs to no single card     */
    float droop;          /* of twigs                              */
    txm_rng rng;
} tpc_cloud;

/* Twigs that grow outwards, most of them near the surface. Layers: they spread horizontally. */
static void tpc_twig_card(tpc_cloud *c, treepieces_card *cards, int index) {
    const int is_flat = c->kind == TREEPIECES_CLOUD_LAYERS;
    const float half = c->half * (0.8f + 0.35f * txm_rng_float(&c->rng));
    const float reach = txm_maxf(1 - 0.8f * c->half, 0.05f);
    const float size[3] = {reach * c->scale[0], reach * c->scale[1], reach * c->scale[2]};
    float place[3] = {0, 0, 0}, outward[3], along[3], facing[3];
    tpc_far_place(cards, index, size, &c->rng, place);
    /* thinner inside, and a surface that is not a sphere */
    const float radius = sqrtf(tpc_dot(place, place));
    const float further = (1.5f - 0.5f * radius) * (0.84f + 0.16f * txm_rng_float(&c->rng));
    for (int k = 0; k < 3; k++) {
        cards[index].center[k] = size[k] * place[k] * further;
        outward[k] = place[k] / c->scale[k];
    }
    tpc_unit_or(outward, 0, 1, 0);
    for (int k = 0; k < 3; k++) {
        along[k] = 0.9f * outward[k] + 0.5f * tpc_signed(&c->rng);
        facing[k] = 0.35f * outward[k] + (is_flat ? 0.45f : 0.7f) * tpc_signed(&c->rng);
    }
    if (is_flat) along[1] *= 0.35f;
    along[1] -= c->droop;
    facing[1] += is_flat ? 1.1f : 0.6f;
    tpc_orient_card(&cards[index], along, facing, outward, half, half);
}

/* Rows of cards along shoots that radiate from the centre and turn upwards, turned alternately about
   them. */
static void tpc_shoot_card(tpc_cloud *c, treepieces_card *cards, int index) {
    const float reach = txm_maxf(1 - c->half, 0);
    const float fit = 0.7f * reach / txm_maxf(c->half, 0.01f) + 0.95f; /* overlapping by half */
    const int most = txm_clampi((int)txm_minf(fit, 4), 1, 4);
    const int shoots = (c->count + most - 1) / most, steps = (c->count + shoots - 1) / shoots;
    const int step = index / shoots;
    const float place = ((float)step + 0.5f + 0.5f * txm_rng_float(&c->rng)) / (float)steps;
    const float roll = (float)((index % shoots + step) % 3 - 1);
    treepieces_card *card = &cards[index];
    float along[3], facing[3], outward[3];
    tpc_sphere_direction(index % shoots, shoots, c->phase, &c->rng, along);
    const float at = reach * (0.3f + 0.7f * place);
    for (int k = 0; k < 3; k++) along[k] *= c->scale[k];
    tpc_unit_or(along, 1, 0, 0);
    for (int k = 0; k < 3; k++) {
        card->center[k] = at * along[k] * (k == 1 ? txm_minf(1, 1.6f * c->scale[1]) : 1);
        outward[k] = along[k] + (k == 1 ? 0.35f : 0);
    }
    tpc_unit_or(outward, 0, 1, 0);
    for (int k = 0; k < 3; k++) along[k] += 0.25f * tpc_signed(&c->rng);
    along[1] += 0.35f;
    /* across the shoot, horizontal */
    facing[0] = -1.2f * roll * along[2] + 0.2f * tpc_signed(&c->rng);
    facing[1] = 1;
    facing[2] = 1.2f * roll * along[0] + 0.2f * tpc_signed(&c->rng);
    tpc_orient_card(card, along, facing, outward, c->half, c->half);
}

/* Columns of narrow hanging cards, one below the other, that begin and end at different heights. */
static void tpc_strip_card(tpc_cloud *c, treepieces_card *cards, int index) {
    enum { ROWS = 2 };
    const int columns = (c->count + ROWS - 1) / ROWS, column = index % columns, row = index / columns;
    const float share = ((float)column + 0.5f) / (float)columns;
    const float ring = sqrtf(share) * txm_maxf(c->scale[0] - 0.3f * c->half, 0.05f);
    const uint64_t own = txm_hash(c->seed + (uint64_t)column); /* of the column */
    const float high = c->half * (0.75f + 0.5f * (float)(own >> 52) / 4096);
    const float hang = txm_maxf(2 * c->scale[1] - 2.4f * high, 0) * (float)(own >> 40 & 4095) / 4096;
    double sine, cosine;
    float along[3], facing[3], outward[3];
    txm_sincos((double)c->phase + 2.399963229728653 * column, &sine, &cosine);
    treepieces_card *card = &cards[index];
    outward[0] = (float)cosine;
    outward[1] = 0.25f;
    outward[2] = (float)sine;
    tpc_unit_or(outward, 0, 1, 0);
    card->center[0] = ring * (float)cosine + 0.1f * c->half * tpc_signed(&c->rng);
    card->center[1] = c->scale[1] - high - hang - (row ? 0.9f : 0.1f) * high;
    card->center[2] = ring * (float)sine + 0.1f * c->half * tpc_signed(&c->rng);
    for (int k = 0; k < 3; k++) {
        along[k] = 0.12f * tpc_signed(&c->rng) - (k == 1 ? 1.0f : 0);
        facing[k] = 0.5f * outward[k] + tpc_signed(&c->rng);
    }
    tpc_orient_card(card, along, facing, outward, 0.5f * high, high);
}

TREEPIECES_API int treepieces_cloud(const treepieces_species *species, uint32_t look,
                                    treepieces_card *cards) {
    const int count = species ? txm_clampi(species->leaf_count, 0, 256) : 0;
    if (!cards || !count) return count;
    const float flat = txm_clampf(species->cloud_flat, 0.1f, 2);
    tpc_cloud cloud;
    cloud.kind = species->cloud_kind;
    cloud.count = count;
    cloud.half = 0.5f * txm_clampf(species->leaf_size, 0.01f, 4);
    cloud.scale[0] = cloud.scale[2] = txm_minf(1, 1 / flat);
    cloud.scale[1] = txm_minf(1, flat);
    cloud.rng = txm_rng_make(look, 0x1eaf);
    cloud.phase = 6.2831853f * txm_rng_float(&cloud.rng);
    cloud.seed = txm_rng_next(&cloud.rng);
    cloud.droop = species->leaf_shape == TREEPIECES_LEAF_LANCE     ? 0.8f
                  : species->leaf_shape == TREEPIECES_LEAF_BLOSSOM ? 0
                                                                   : 0.2f;
    for (int i = 0; i < count; i++) {
        if (cloud.kind == TREEPIECES_CLOUD_SHOOTS) tpc_shoot_card(&cloud, cards, i);
        else if (cloud.kind == TREEPIECES_CLOUD_STRIPS) tpc_strip_card(&cloud, cards, i);
        else tpc_twig_card(&cloud, cards, i);
        tpc_keep_inside(&cards[i]);
    }
    return count;
}

/* ---- foliage: drawn leaves ----------------------------------------------------------------- */

/* A spray is a list of marks, painted in order. A sample takes the colour of the last mark that
   covers it, so that edges are antialiased without seams and rows are independent of each other.
   Lengths are in sides of the image, y points down. */
enum {
    TPC_TWIG = TREEPIECES_LEAF_COMPOUND + 1, /* shape of a mark: a tapering stroke */
    TPC_MARKS = 2048,
    TPC_SAMPLES = 4 /* per pixel, across and down */
};

typedef struct tpc_mark {
    int shape;               /* treepieces_leaf_shape, or TPC_TWIG */
    float from[2], along[2]; /* its base, and the vector from there to its tip */
    float width;             /* half of it over the length */
    float taper;             /* of a twig: width at its tip over that at its base */
    float bend;              /* of the midrib, over the length */
    float fold;              /* how much lighter one half is than the other */
    float low[2], high[2];   /* bounding box */
    float color[3], tip[3];  /* at the base and at the tip */
} tpc_mark;

typedef struct tpc_spray {
    const treepieces_species *species;
    tpc_mark *marks;
    int count, shape;
    txm_rng rng;
    txm_image out;
    int first_row;
} tpc_spray;

/* The growth habit of a spray, by leaf shape. */
typedef struct tpc_habit {
    int leaves, twigs, twig_leaves; /* on the stem; side twigs; leaves on each */
    float length, width;            /* of a leaf; half the width over the length */
    float petiole, angle, bend;     /* angle: degrees between leaf and stem */
} tpc_habit;

static const tpc_habit tpc_habits[] = {
    {13, 12, 9, 0.105f, 0.31f, 0.012f, 55, 0.08f}, {7, 7, 6, 0.20f, 0.34f, 0.01f, 55, 0.06f},
    {15, 6, 11, 0.20f, 0.085f, 0.02f, 38, 0.14f}, {8, 8, 8, 0.125f, 0.44f, 0.04f, 62, 0.06f},
    {0, 13, 0, 0.07f, 0.042f, 0, 50, 0.05f},      {15, 7, 9, 0.058f, 0.42f, 0.075f, 80, 0},
    {6, 7, 5, 0.19f, 0.19f, 0.05f, 62, 0.04f},    {5, 5, 3, 0.32f, 0.30f, 0.02f, 55, 0.08f},
};

/* Half the width of a leaf at u of its length, over its maximum; side: 0..1 how far from the
   midrib. */
static float tpc_outline(int shape, float u, float side) {
    const float arc = 4 * u * (1 - u);
    float v, phase;
    switch (shape) {
    case TREEPIECES_LEAF_LOBED: /* lobes point to the tip */
        phase = 4.3f * (u - 0.14f * side) + 0.1f;
        v = 2 * (phase - floorf(phase)) - 1;
        return arc * (0.52f + 0.75f * u) * (0.4f + 0.64f * sqrtf(txm_maxf(0, 1 - v * v)));
    case TREEPIECES_LEAF_LANCE: return arc * (1.15f - 0.3f * u);
    case TREEPIECES_LEAF_HEART: /* toothed */
        phase = 13 * u;
        return sqrtf(u) * (1 - u) * (2.9f - 1.1f * u) * (1 + 0.05f * (phase - floorf(phase)));
    case TREEPIECES_LEAF_NEEDLE: return txm_minf(1, 5 * (1 - u));
    case TREEPIECES_LEAF_BLOSSOM: /* a petal, notched */
        if (u > 0.93f + 0.14f * side) return 0;
        v = u * (0.45f + 0.55f * u);
        return 2 * sqrtf(v * (1 - v)) * txm_minf(1, 0.4f + 1.2f * u);
    default:
        v = u * (0.75f + 0.25f * u);
        phase = 16 * u;
        return 2.6f * sqrtf(v) * (1 - v) * (1 + 0.04f * (phase - floorf(phase)));
    }
}

/* The color of a leaf at u of its length and x across; half: half its width there. */
static void tpc_leaf_color(const tpc_mark *m, float u, float x, float half, float color[3]) {
    static const float veins[] = {9, 6, 11, 7}; /* by shape, of those before needles */
    const float across = x < 0 ? -x : x, edge = half > 0 ? across / half : 0;
    float shade = (x < 0 ? 1 - m->fold : 1 + m->fold) * (0.86f + 0.1f * u + 0.1f * edge), light = 0;
    if (m->shape < TREEPIECES_LEAF_NEEDLE) { /* side veins, and the bulges between them */
        const float phase = (u - 0.7f * across) * veins[m->shape] + 100;
        const float between = phase - floorf(phase), off = between < 0.5f ? between : 1 - between;
        shade *= 0.96f + 0.1f * between;
        light = txm_maxf(0.3f * tpc_fade(9 * off) * (1 - edge),
                         0.6f * tpc_fade(across / (0.03f * (1.15f - u))));
    } else if (m->shape == TREEPIECES_LEAF_NEEDLE) {
        light = 0.35f * tpc_fade(2 * edge);
    } else if (m->shape == TREEPIECES_LEAF_BLOSSOM) {
        const float phase = 5 * edge + 0.5f;
        shade = (x < 0 ? 1 - m->fold : 1 + m->fold) * (0.97f + 0.03f * (phase - floorf(phase)));
    }
    for (int k = 0; k < 3; k++) {
        const float own = txm_lerpf(m->color[k], m->tip[k], u) * shade;
        color[k] = txm_lerpf(own, 1.25f * own + 0.07f, light);
    }
}

/* Does the mark cover (x, y)? If so, color (may be NULL) receives its color there. */
static int tpc_mark_at(const tpc_mark *m, float x, float y, float color[3]) {
    if (x < m->low[0] || y < m->low[1] || x > m->high[0] || y > m->high[1]) return 0;
    const float dx = x - m->from[0], dy = y - m->from[1];
    const float square = m->along[0] * m->along[0] + m->along[1] * m->along[1];
    const float u = (dx * m->along[0] + dy * m->along[1]) / square;
    if (!(u > 0 && u < 1)) return 0;
    const float off = (m->along[0] * dy - m->along[1] * dx) / square - m->bend * 4 * u * (1 - u);
    const float across = off < 0 ? -off : off;
    if (m->shape == TPC_TWIG) {
        const float half = m->width * (1 + u * (m->taper - 1));
        if (across > half) return 0;
        for (int k = 0; color && k < 3; k++)
            color[k] = txm_lerpf(m->color[k], m->tip[k], u) * (1 - 0.35f * off / half);
        return 1;
    }
    if (across > 1.3f * m->width) return 0;
    const float half = m->width * tpc_outline(m->shape, u, across / m->width);
    if (across > half) return 0;
    if (color) tpc_leaf_color(m, u, off, half, color);
    return 1;
}

/* Color of the spray at (x, y), shadows of higher marks included; 0 if it is transparent there.
   Only the listed marks are tested. */
static int tpc_spray_at(const tpc_spray *s, const uint16_t *listed, int count, float x, float y,
                        float color[3]) {
    int is_shaded = 0;
    for (int i = count; i-- > 0;) {
        const tpc_mark *m = &s->marks[listed[i]];
        if (tpc_mark_at(m, x, y, color)) {
            for (int k = 0; k < 3; k++) color[k] *= is_shaded ? 0.66f : 1;
            return 1;
        }
        is_shaded = is_shaded || tpc_mark_at(m, x - 0.008f, y - 0.014f, NULL);
    }
    return 0;
}

/* List the marks in `from` that, with their shadows, overlap low..high along an axis. */
static int tpc_list_marks(const tpc_spray *s, const uint16_t *from, int count, int axis, float low,
                          float high, uint16_t *listed) {
    int kept = 0;
    for (int i = 0; i < count; i++) {
        const tpc_mark *m = &s->marks[from[i]];
        if (m->low[axis] <= high && m->high[axis] + 0.02f >= low) listed[kept++] = from[i];
    }
    return kept;
}

static void tpc_draw_row(void *context, int index) {
    enum { BLOCK = 16 }; /* pixels */
    const tpc_spray *s = (const tpc_spray *)context;
    const int y = s->first_row + index;
    const float step = 1.0f / (float)TPC_SAMPLES;
    const float width = (float)s->out.width, height = (float)s->out.height;
    uint16_t in_row[TPC_MARKS], listed[TPC_MARKS];
    int count = 0;
    for (int i = 0; i < s->count; i++) in_row[i] = (uint16_t)i;
    const int row_count = tpc_list_marks(s, in_row, s->count, 1, (float)y / height,
                                         (float)(y + 1) / height, in_row);
    for (int x = 0; x < s->out.width; x++) {
        if (x % BLOCK == 0)
            count = tpc_list_marks(s, in_row, row_count, 0, (float)x / width,
                                   (float)(x + BLOCK) / width, listed);
        float sum[3] = {0, 0, 0}, color[3];
        int covered = 0;
        for (int k = 0; k < TPC_SAMPLES * TPC_SAMPLES; k++) {
            const int column = k % TPC_SAMPLES, row = k / TPC_SAMPLES;
            const float at_x = ((float)x + ((float)column + 0.5f) * step) / width;
            const float at_y = ((float)y + ((float)row + 0.5f) * step) / height;
            if (!tpc_spray_at(s, listed, count, at_x, at_y, color)) continue;
            for (int c = 0; c < 3; c++) sum[c] += color[c];
            covered++;
        }
        for (int c = 0; c < 3; c++)
            txm_image_set(&s->out, x, y, c, covered ? sum[c] / (float)covered : 0);
        txm_image_set(&s->out, x, y, 3, (float)covered / (TPC_SAMPLES * TPC_SAMPLES));
    }
}

/* Add a mark from a to b of half width `half`; NULL if there are too many, or if it has no length. */
static tpc_mark *tpc_add_mark(tpc_spray *s, int shape, const float a[2], const float b[2],
                              float half, float bend, const float color[3]) {
    const float dx = b[0] - a[0], dy = b[1] - a[1], length = sqrtf(dx * dx + dy * dy);
    if (s->count == TPC_MARKS || !(length > 1e-4f)) return NULL;
    tpc_mark *m = &s->marks[s->count++];
    const float room = 1.3f * half + (bend < 0 ? -bend : bend) * length;
    memset(m, 0, sizeof *m);
    m->shape = shape;
    m->width = half / length;
    m->taper = 1;
    m->bend = bend;
    for (int k = 0; k < 2; k++) {
        m->from[k] = a[k];
        m->along[k] = b[k] - a[k];
        m->low[k] = txm_minf(a[k], b[k]) - room;
        m->high[k] = txm_maxf(a[k], b[k]) + room;
    }
    for (int k = 0; k < 3; k++) m->color[k] = m->tip[k] = color[k];
    return m;
}

/* b = the point at distance `length` from a in the direction of `heading` (unit length) rotated by
   `degrees`, kept away from the border by `margin`. */
static void tpc_advance(const float a[2], const float heading[2], float degrees, float length,
                   float margin, float b[2]) {
    double sine, cosine;
    txm_sincos((double)degrees * (TXM_PI / 180), &sine, &cosine);
    const float x = heading[0] * (float)cosine - heading[1] * (float)sine;
    const float y = heading[0] * (float)sine + heading[1] * (float)cosine;
    b[0] = txm_clampf(a[0] + length * x, margin, 1 - margin);
    b[1] = txm_clampf(a[1] + length * y, margin, 1 - margin);
}

/* The base color made a little lighter or darker, yellower or bluer, at random. */
static void tpc_vary_color(tpc_spray *s, const float base[3], float color[3]) {
    const float light = 1 + 0.18f * tpc_signed(&s->rng), warm = 0.12f * tpc_signed(&s->rng);
    color[0] = base[0] * light * (1 + warm);
    color[1] = base[1] * light;
    color[2] = base[2] * light * (1 - 1.5f * warm);
}

/* A bent stem or twig. */
typedef struct tpc_stem {
    float from[2], to[2], bend;
} tpc_stem;

/* The point and the direction at s of the length of a stem. */
static void tpc_stem_at(const tpc_stem *t, float s, float at[2], float heading[2]) {
    const float dx = t->to[0] - t->from[0], dy = t->to[1] - t->from[1];
    const float arc = t->bend * 4 * s * (1 - s), slope = t->bend * 4 * (1 - 2 * s);
    at[0] = t->from[0] + s * dx - arc * dy;
    at[1] = t->from[1] + s * dy + arc * dx;
    heading[0] = dx - slope * dy;
    heading[1] = dy + slope * dx;
    const float length = txm_maxf(sqrtf(heading[0] * heading[0] + heading[1] * heading[1]), 1e-6f);
    heading[0] /= length;
    heading[1] /= length;
}

/* Add a stem as a chain of twig marks. */
static void tpc_add_stem(tpc_spray *s, const tpc_stem *stem, float half, float half_at_end) {
    const int parts = 8, is_blossom = s->shape == TREEPIECES_LEAF_BLOSSOM;
    float color[3], green[3];
    for (int k = 0; k < 3; k++) {
        const float leaf = is_blossom ? 0.35f : 0.75f * s->species->leaf_color[k];
        color[k] = 0.85f * s->species->bark_color[k];
        if (s->species->bark_color[0] > 0.6f) color[k] *= 0.55f; /* twigs of birches are brown */
        green[k] = 0.5f * color[k] + 0.5f * leaf;
    }
    for (int i = 0; i < parts; i++) {
        float a[2], b[2], heading[2];
        const float u = (float)i / (float)parts, v = u + 1.15f / (float)parts; /* overlap */
        tpc_stem_at(stem, u, a, heading);
        tpc_stem_at(stem, txm_minf(v, 1), b, heading);
        const float foot = txm_lerpf(half, half_at_end, u), top = txm_lerpf(half, half_at_end, v);
        tpc_mark *m = tpc_add_mark(s, TPC_TWIG, a, b, foot, 0, color);
        if (!m) return;
        m->taper = top / foot;
        for (int k = 0; k < 3; k++) {
            m->color[k] = txm_lerpf(color[k], green[k], u);
            m->tip[k] = txm_lerpf(color[k], green[k], txm_minf(v, 1));
        }
    }
}

/* Add one blade of a leaf; NULL as of tpc_add_mark. */
static tpc_mark *tpc_add_blade(tpc_spray *s, int outline, const float foot[2], const float heading[2],
                               float degrees, float length, float wide, const float color[3]) {
    const tpc_habit *habit = &tpc_habits[s->shape];
    const float half = length * wide, bend = habit->bend * tpc_signed(&s->rng);
    float tip[2];
    tpc_advance(foot, heading, degrees, length, 0.015f + 0.75f * half, tip);
    tpc_mark *blade = tpc_add_mark(s, outline, foot, tip, half, bend, color);
    if (!blade) return NULL;
    blade->fold = 0.09f * tpc_signed(&s->rng);
    for (int k = 0; k < 3; k++) blade->tip[k] = color[k] * (k == 2 ? 1.0f : 1.08f);
    return blade;
}

/* A palmate leaf: five lobes from one point, the middle one last, on top. */
static void tpc_add_lobes(tpc_spray *s, const float foot[2], const float heading[2], float degrees,
                          float length, const float color[3]) {
    static const float angles[] = {-88, 88, -42, 42, 0}, lengths[] = {0.55f, 0.55f, 0.85f, 0.85f, 1};
    for (int i = 0; i < 5; i++)
        tpc_add_blade(s, TREEPIECES_LEAF_OVAL, foot, heading, degrees + angles[i],
                      lengths[i] * length, tpc_habits[s->shape].width, color);
}

/* A compound leaf: pairs of leaflets on a stalk, and one at its end. */
static void tpc_add_leaflets(tpc_spray *s, const float foot[2], const float heading[2], float degrees,
                             float length, const float color[3]) {
    enum { PAIRS = 4 };
    const float leaflet = 0.36f * length, wide = tpc_habits[s->shape].width;
    float end[2], at[2];
    tpc_advance(foot, heading, degrees, length - leaflet, 0.05f, end);
    tpc_mark *stalk = tpc_add_mark(s, TPC_TWIG, foot, end, 0.003f, 0, color);
    if (stalk) stalk->taper = 0.6f;
    for (int i = 0; i < 2 * PAIRS; i++) {
        const int pair = i / 2;
        const float along = 0.25f + 0.7f * (float)pair / (float)(PAIRS - 1);
        for (int k = 0; k < 2; k++) at[k] = txm_lerpf(foot[k], end[k], along);
        tpc_add_blade(s, TREEPIECES_LEAF_OVAL, at, heading, degrees + (i % 2 ? -55.0f : 55.0f), leaflet,
                      wide, color);
    }
    tpc_add_blade(s, TREEPIECES_LEAF_OVAL, end, heading, degrees, leaflet, wide, color);
}

/* Add a leaf with its petiole, seen roughly from above. */
static void tpc_add_leaf(tpc_spray *s, int shape, const float at[2], const float heading[2],
                         float degrees, float size, const float base[3]) {
    const tpc_habit *habit = &tpc_habits[shape];
    float foot[2], color[3];
    const float length = habit->length * size * (0.85f + 0.3f * txm_rng_float(&s->rng));
    const float wide = habit->width * (0.72f + 0.34f * txm_rng_float(&s->rng));
    tpc_vary_color(s, base, color);
    tpc_advance(at, heading, degrees, habit->petiole * size + 0.01f, 0.01f, foot);
    tpc_mark *stalk = tpc_add_mark(s, TPC_TWIG, at, foot, 0.003f, 0, color);
    if (stalk) stalk->taper = 0.7f;
    const float lean = 8 * tpc_signed(&s->rng);
    if (shape == TREEPIECES_LEAF_PALMATE)
        tpc_add_lobes(s, foot, heading, degrees + lean, length, color);
    else if (shape == TREEPIECES_LEAF_COMPOUND)
        tpc_add_leaflets(s, foot, heading, degrees + lean, length, color);
    else tpc_add_blade(s, shape, foot, heading, degrees + lean, length, wide, color);
}

/* Add a flower: five petals and the stamens, seen obliquely. */
static void tpc_add_flower(tpc_spray *s, const float at[2], float radius) {
    static const float white[3] = {1, 0.97f, 0.975f}, anther[3] = {0.85f, 0.62f, 0.25f};
    static const float up[2] = {0, -1};
    const float turn = 72 * txm_rng_float(&s->rng), lean = 180 * txm_rng_float(&s->rng);
    const float *tint = s->species->leaf_color;
    const float deep[3] = {0.9f * tint[0], 0.66f * tint[1], 0.76f * tint[2]};
    const float squash = 0.35f * txm_rng_float(&s->rng);
    for (int i = 0; i < 5; i++) {
        double sine, cosine;
        float tip[2], foot[2];
        const float angle = turn + 72 * (float)i + 5 * tpc_signed(&s->rng);
        txm_sincos((double)(angle - lean) * (TXM_PI / 180), &sine, &cosine);
        const float length = radius * (1 - squash * (float)(cosine * cosine));
        const float half = 0.46f * radius * (1 - squash * (float)(sine * sine));
        tpc_advance(at, up, angle, 0.08f * radius, 0.01f, foot);
        tpc_advance(at, up, angle, length, 0.01f, tip);
        tpc_mark *petal = tpc_add_mark(s, TREEPIECES_LEAF_BLOSSOM, foot, tip, half, 0, deep);
        if (!petal) return;
        const float paler = 0.45f + 0.35f * txm_rng_float(&s->rng);
        petal->fold = 0.03f * tpc_signed(&s->rng);
        for (int k = 0; k < 3; k++) {
            petal->tip[k] = txm_lerpf(tint[k], white[k], paler);
            petal->color[k] = txm_lerpf(deep[k], petal->tip[k], 0.4f);
        }
    }
    for (int i = 0; i < 5; i++) {
        const float angle = 72 * (float)i + 15 * tpc_signed(&s->rng);
        float tip[2], top[2];
        tpc_advance(at, up, angle, radius * (0.2f + 0.2f * txm_rng_float(&s->rng)), 0.01f, tip);
        tpc_advance(tip, up, angle, 0.07f * radius, 0.01f, top);
        tpc_add_mark(s, TPC_TWIG, at, tip, 0.014f * radius, 0, deep);
        tpc_add_mark(s, TPC_TWIG, tip, top, 0.04f * radius, 0, anther);
    }
}

/* Add the leaves or flowers of a twig: on alternate sides, and one at the end. */
static void tpc_add_foliage(tpc_spray *s, const tpc_stem *stem, int count, float first,
                            float size) {
    static const float young[3] = {0.42f, 0.55f, 0.2f};
    const tpc_habit *habit = &tpc_habits[s->shape];
    float side = txm_rng_float(&s->rng) < 0.5f ? -1.0f : 1.0f;
    for (int i = 0; i < count; i++, side = -side) {
        const int is_last = i == count - 1;
        const float along = count > 1 ? first + (1 - first) * (float)i / (float)(count - 1) : 1;
        const float turn = is_last ? 0 : side * habit->angle * (1.1f - 0.4f * along);
        const float angle = turn + 8 * tpc_signed(&s->rng);
        float at[2], heading[2], middle[2];
        tpc_stem_at(stem, along, at, heading);
        if (s->shape != TREEPIECES_LEAF_BLOSSOM) {
            tpc_add_leaf(s, s->shape, at, heading, angle, size * (1.05f - 0.3f * along * along),
                         s->species->leaf_color);
            continue;
        }
        if (is_last || txm_rng_float(&s->rng) < 0.35f)
            tpc_add_leaf(s, TREEPIECES_LEAF_LANCE, at, heading, -0.6f * angle, 0.4f, young);
        const float around = 180 * tpc_signed(&s->rng), off = sqrtf(txm_rng_float(&s->rng));
        tpc_advance(at, heading, around, off * habit->petiole, 0.09f, middle);
        tpc_add_flower(s, middle, habit->length * (0.85f + 0.25f * txm_rng_float(&s->rng)));
    }
}

/* Add needles all round a shoot, those at its tip forwards. long_by: their length over the usual. They
   are so dense that smaller pictures of them do not vanish. */
static void tpc_add_needles(tpc_spray *s, const tpc_stem *stem, float first, float long_by) {
    const tpc_habit *habit = &tpc_habits[TREEPIECES_LEAF_NEEDLE];
    const float dx = stem->to[0] - stem->from[0], dy = stem->to[1] - stem->from[1];
    const float covered = (1 - first) * sqrtf(dx * dx + dy * dy);
    const int count = (int)(covered / (0.0024f + 0.0016f * long_by)) + 4;
    for (int i = 0; i < count; i++) {
        const float along = first + (1 - first) * (float)i / (float)(count - 1);
        const float spread = i % 5 == 4 ? 0.5f * tpc_signed(&s->rng) : i % 2 ? 1.0f : -1.0f;
        const float angle = spread * habit->angle * (1.1f - 0.75f * along * along);
        const float length = long_by * habit->length * (0.7f + 0.45f * txm_rng_float(&s->rng));
        float at[2], heading[2], tip[2], color[3];
        tpc_stem_at(stem, along, at, heading);
        tpc_vary_color(s, s->species->leaf_color, color);
        tpc_advance(at, heading, angle + 9 * tpc_signed(&s->rng), length, 0.01f, tip);
        tpc_mark *m = tpc_add_mark(s, TREEPIECES_LEAF_NEEDLE, at, tip, habit->width * habit->length,
                                   habit->bend * tpc_signed(&s->rng), color);
        for (int k = 0; m && k < 3; k++) {
            m->color[k] = 0.75f * color[k];
            m->tip[k] = 1.2f * color[k] + 0.01f;
        }
    }
}

/* A spray of needles: thin shoots with gaps between them. Of pines there are few, from the foot of the
   spray, with long needles; of others they stand along a stem, and are the shorter the higher. */
static void tpc_make_shoots(tpc_spray *s) {
    const int is_tuft = s->species->cloud_kind == TREEPIECES_CLOUD_SHOOTS;
    const int twigs = is_tuft ? 6 : tpc_habits[TREEPIECES_LEAF_NEEDLE].twigs;
    const float long_by = is_tuft ? 2.6f : 1;
    tpc_stem stem = {{0.5f, 1}, {0.5f, is_tuft ? 0.17f : 0.07f}, 0};
    stem.to[0] += 0.06f * tpc_signed(&s->rng);
    stem.bend = 0.05f * tpc_signed(&s->rng);
    tpc_add_stem(s, &stem, 0.008f, 0.003f);
    for (int i = 0; i < twigs; i++) {
        const float along = (is_tuft ? 0.25f : 0.04f) + (is_tuft ? 0.4f : 0.8f) * (float)i / (float)twigs;
        const float side = i % 2 ? -1.0f : 1.0f;
        const float length = (is_tuft ? 0.36f : 0.34f * (1.02f - 0.7f * along)) *
                             (0.8f + 0.35f * txm_rng_float(&s->rng));
        const float angle = side * (is_tuft ? 50 - 45 * along : 44 - 10 * along) + 7 * tpc_signed(&s->rng);
        tpc_stem twig;
        float heading[2];
        tpc_stem_at(&stem, along, twig.from, heading);
        tpc_advance(twig.from, heading, angle, length, 0.07f * long_by, twig.to);
        twig.bend = -0.07f * side;
        tpc_add_stem(s, &twig, 0.005f, 0.002f);
        tpc_add_needles(s, &twig, is_tuft ? 0.35f : 0.06f, long_by);
    }
    tpc_add_needles(s, &stem, is_tuft ? 0.5f : 0.03f, long_by);
}

/* A spray for hanging strips: long shoots side by side, of different lengths. */
static void tpc_make_strips(tpc_spray *s) {
    enum { SHOOTS = 6, LEAVES = 20 };
    for (int i = 0; i < SHOOTS; i++) {
        const float x = ((float)i + 0.5f + 0.3f * tpc_signed(&s->rng)) / (float)SHOOTS;
        tpc_stem stem = {{0, 1}, {0, 0}, 0};
        stem.from[0] = 0.5f + 0.86f * (x - 0.5f);
        stem.to[0] = txm_clampf(stem.from[0] + 0.06f * tpc_signed(&s->rng), 0.08f, 0.92f);
        stem.to[1] = 0.08f + 0.4f * txm_rng_float(&s->rng) * txm_rng_float(&s->rng);
        stem.bend = 0.025f * tpc_signed(&s->rng);
        tpc_add_stem(s, &stem, 0.006f, 0.002f);
        tpc_add_foliage(s, &stem, LEAVES, 0.02f, 0.85f);
    }
}

/* A spray for all other clouds: a stem upwards from the middle of the lower side, twigs on both
   sides. */
static void tpc_make_spray(tpc_spray *s) {
    const tpc_habit *habit = &tpc_habits[s->shape];
    tpc_stem stem = {{0.5f, 1}, {0.5f, 0}, 0};
    stem.to[0] += 0.06f * tpc_signed(&s->rng);
    stem.to[1] = 0.97f * habit->length + 0.03f;
    stem.bend = 0.05f * tpc_signed(&s->rng);
    tpc_add_stem(s, &stem, 0.010f, 0.003f);
    for (int i = 0; i < habit->twigs; i++) {
        const float along = 0.05f + 0.75f * (float)i / (float)habit->twigs;
        const float side = i % 2 ? -1.0f : 1.0f, length = 0.52f * (1.05f - 0.6f * along);
        const float angle = side * (66 - 24 * along) + 5 * tpc_signed(&s->rng);
        tpc_stem twig;
        float heading[2];
        tpc_stem_at(&stem, along, twig.from, heading);
        tpc_advance(twig.from, heading, angle, length, 0.12f, twig.to);
        twig.bend = -0.08f * side;
        tpc_add_stem(s, &twig, 0.006f, 0.0025f);
        tpc_add_foliage(s, &twig, habit->twig_leaves, 0.25f, 0.85f);
    }
    tpc_add_foliage(s, &stem, habit->leaves, 0.14f, 0.88f);
}

TREEPIECES_API txm_status treepieces_draw_leaves(const treepieces_species *species, uint64_t seed,
                                                 txm_env *env, txm_image out) {
    enum { ROWS = 64 }; /* between two progress reports */
    tpc_spray spray;
    if (!species) return txm_fail(env, TXM_BAD_ARGUMENT, "species is NULL");
    txm_status status = txm_image_check(&out, "out", 0, env);
    if (status != TXM_OK) return status;
    if (out.channels != 4 || out.sample != TXM_U8)
        return txm_fail(env, TXM_BAD_ARGUMENT, "out must have 4 channels of 8 bits");
    txm_arena arena;
    txm_arena_init(&arena, env);
    memset(&spray, 0, sizeof spray);
    out = txm_image_resolve(out);
    spray.marks = (tpc_mark *)txm_arena_alloc(&arena, TPC_MARKS, sizeof *spray.marks);
    status = spray.marks ? tpc_new_picture(&out, &arena, env, &spray.out)
                         : txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the leaves");
    spray.species = species;
    spray.shape = txm_clampi(species->leaf_shape, 0, TREEPIECES_LEAF_COMPOUND);
    spray.rng = txm_rng_make(seed, 0x59a7);
    if (status == TXM_OK && spray.shape == TREEPIECES_LEAF_NEEDLE) tpc_make_shoots(&spray);
    else if (status == TXM_OK && species->cloud_kind == TREEPIECES_CLOUD_STRIPS)
        tpc_make_strips(&spray);
    else if (status == TXM_OK) tpc_make_spray(&spray);
    for (int y = 0; y < out.height && status == TXM_OK; y += ROWS) {
        spray.first_row = y;
        if (txm_progress(env, (float)y / (float)out.height, "leaves"))
            status = txm_fail(env, TXM_CANCELLED, "cancelled");
        else txm_parallel_for(env, txm_clampi(out.height - y, 0, ROWS), tpc_draw_row, &spray);
    }
    if (status == TXM_OK) status = tpc_deliver(&spray.out, &out, env);
    txm_arena_free(&arena);
    return status;
}

/* ---- foliage: impostors -------------------------------------------------------------------- */

/* The color of a point p of a card is that of its texel, times

       (0.82 + 0.36 clamp(0.35 + 0.65 n.l) + 0.2 max(0, f.l)) * (0.75 + 0.25 min(1, p.p))

   with the normal n of the card, l towards the light and the forward axis f of the view: wrap
   lighting, light transmitted by leaves when the sun is behind them, and shade in the middle of the
   cloud. The nearest texel is taken, sRGB values are used as they are: a shader does the same in
   three lines. Cards seen at an angle with a sine below 0.1 are skipped: they would be rows of
   dots. */
static float tpc_card_light(const treepieces_impostor_desc *d, const treepieces_card *card) {
    const float direct = txm_clampf(0.35f + 0.65f * tpc_dot(card->normal, d->light), 0, 1);
    return 0.82f + 0.36f * direct + 0.2f * txm_maxf(0, tpc_dot(d->forward, d->light));
}

/* First and last of `count` pixels whose centres lie in low..high, where -1..1 is the image. */
static void tpc_pixels(float low, float high, int count, int *first, int *last) {
    const float n = (float)count;
    *first = (int)txm_clampf((low + 1) * 0.5f * n - 0.5f, 0, n);
    *last = (int)txm_clampf((high + 1) * 0.5f * n + 0.5f, -1, n - 1);
}

/* The texel at (s, t) of a card, each -1..1, to the right and up. */
static const uint8_t *tpc_texel(const txm_image *leaves, float s, float t) {
    const int x = (int)((s + 1) * 0.5f * (float)leaves->width);
    const int y = (int)((1 - t) * 0.5f * (float)leaves->height);
    const void *row = txm_image_row_const(leaves, txm_clampi(y, 0, leaves->height - 1));
    return (const uint8_t *)row + 4 * txm_clampi(x, 0, leaves->width - 1);
}

static void tpc_draw_card(const treepieces_impostor_desc *d, const treepieces_card *card,
                          const txm_image *leaves, const txm_image *color, const txm_image *depth) {
    const float c[3] = {tpc_dot(card->center, d->right), tpc_dot(card->center, d->up),
                        -tpc_dot(card->center, d->forward)};
    const float r[3] = {tpc_dot(card->right, d->right), tpc_dot(card->right, d->up),
                        -tpc_dot(card->right, d->forward)};
    const float u[3] = {tpc_dot(card->up, d->right), tpc_dot(card->up, d->up),
                        -tpc_dot(card->up, d->forward)};
    const float det = r[0] * u[1] - r[1] * u[0], light = tpc_card_light(d, card);
    const float wide = fabsf(r[0]) + fabsf(u[0]), high = fabsf(r[1]) + fabsf(u[1]);
    const float area = tpc_dot(card->right, card->right) * tpc_dot(card->up, card->up);
    int left, right, top, bottom;
    if (!(det * det > 0.01f * area)) return; /* seen edge on */
    if (!(fabsf(c[0]) + fabsf(c[1]) + wide + high < 1e6f)) return; /* too large or not finite */
    tpc_pixels(c[0] - wide, c[0] + wide, color->width, &left, &right);
    tpc_pixels(-c[1] - high, high - c[1], color->height, &top, &bottom);
    for (int row = top; row <= bottom; row++) {
        const float y = 1 - (2 * (float)row + 1) / (float)color->height;
        uint8_t *colors = (uint8_t *)txm_image_row(color, row);
        float *depths = (float *)txm_image_row(depth, row);
        for (int column = left; column <= right; column++) {
            const float x = (2 * (float)column + 1) / (float)color->width - 1;
            const float s = ((x - c[0]) * u[1] - (y - c[1]) * u[0]) / det;
            const float t = ((y - c[1]) * r[0] - (x - c[0]) * r[1]) / det;
            if (!(s >= -1 && s < 1 && t > -1 && t <= 1)) continue;
            const float z = c[2] + s * r[2] + t * u[2];
            if (!(z > depths[column])) continue;
            const uint8_t *texel = tpc_texel(leaves, s, t);
            if (texel[3] < 128) continue;
            const float shade = light * (0.75f + 0.25f * txm_minf(1, x * x + y * y + z * z));
            for (int k = 0; k < 3; k++) {
                const float lit = txm_clampf((float)texel[k] * shade, 0, 255);
                colors[4 * column + k] = (uint8_t)(lit + 0.5f);
            }
            colors[4 * column + 3] = 255;
            depths[column] = z;
        }
    }
}

static void tpc_draw_cloud(const treepieces_impostor_desc *d, const txm_image *leaves,
                           const txm_image *color, const txm_image *depth) {
    memset(color->pixels, 0, 4 * (size_t)color->width * (size_t)color->height);
    for (int y = 0; y < depth->height; y++) {
        float *row = (float *)txm_image_row(depth, y);
        for (int x = 0; x < depth->width; x++) row[x] = -2;
    }
    for (int i = 0; i < d->card_count; i++) tpc_draw_card(d, &d->cards[i], leaves, color, depth);
}

/* Are the axes orthogonal unit vectors, and is light of unit length? */
static int tpc_is_view(const treepieces_impostor_desc *d) {
    const float *v[4] = {d->right, d->up, d->forward, d->light};
    for (int i = 0; i < 4; i++) {
        if (!(fabsf(tpc_dot(v[i], v[i]) - 1) < 1e-3f)) return 0;
        if (i < 3 && !(fabsf(tpc_dot(v[i], v[(i + 1) % 3])) < 1e-3f)) return 0;
    }
    return 1;
}

TREEPIECES_API txm_status treepieces_impostor(const treepieces_impostor_desc *desc, txm_env *env,
                                              txm_image color, txm_image depth) {
    if (!desc || (desc->card_count && !desc->cards) || desc->card_count < 0)
        return txm_fail(env, TXM_BAD_ARGUMENT, "desc or cards is NULL, or card_count below 0");
    txm_status status = txm_image_check(&desc->leaves, "leaves", 0, env);
    if (status == TXM_OK) status = txm_image_check(&color, "color", 0, env);
    if (status == TXM_OK) status = txm_image_check(&depth, "depth", 0, env);
    if (status != TXM_OK) return status;
    const txm_image leaves = txm_image_resolve(desc->leaves);
    const txm_image c = txm_image_resolve(color), d = txm_image_resolve(depth);
    if (leaves.channels != 4 || leaves.sample != TXM_U8 || c.channels != 4 || c.sample != TXM_U8)
        return txm_fail(env, TXM_BAD_ARGUMENT, "leaves and color must have 4 channels of 8 bits");
    if (d.channels != 1 || d.sample != TXM_F32 || d.width != c.width || d.height != c.height)
        return txm_fail(env, TXM_BAD_ARGUMENT, "depth must be float, 1 channel, of color's size");
    if (!tpc_is_view(desc))
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "right, up, forward and light must be unit vectors, the first three "
                        "orthogonal");
    txm_image colors, depths;
    txm_arena arena;
    txm_arena_init(&arena, env);
    status = tpc_new_picture(&c, &arena, env, &colors);
    if (status == TXM_OK) status = tpc_new_picture(&d, &arena, env, &depths);
    if (status == TXM_OK) {
        tpc_draw_cloud(desc, &leaves, &colors, &depths);
        status = tpc_deliver(&colors, &c, env);
    }
    if (status == TXM_OK) tpc_copy_picture(&depths, &d);
    txm_arena_free(&arena);
    return status;
}

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
