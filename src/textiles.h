/* textiles.h - v0.2.0 - cut tiles that join without seams out of photographs, and place them
   SPDX-License-Identifier: MIT OR Unlicense                   (full text: end of file)

   WHAT IT DOES
     It cuts a set of tiles out of one photograph of a texture: squares with colours on their edges
     (Wang tiles) or on their corners, equilateral triangles with directed colours on their edges,
     or squares whose whole border is fixed. Tiles with equal colours join without a visible seam,
     while their interiors differ, so that a small atlas gives a texture without end and without
     period. Then it decides which tile goes where: on the infinite plane in constant time per tile,
     on finite grids under constraints, on triangle and quad meshes. Tiles made elsewhere can be
     used as well.

   QUICK START                                 (tests build and run this very block)
     // Cut Wang tiles and cover some of the plane with them. cc -std=c99 quick.c -lm
     #define TEXTILES_IMPLEMENTATION          // in exactly one .c or .cpp file
     #include "textiles.h"                    // texmath.h must lie beside it
     #include <stdio.h>

     int main(void) {
         static unsigned char photo[128 * 128], plane_pixels[256 * 192];
         static unsigned char atlas_pixels[1 << 20];      // the caller owns all pixels
         static textiles_desc desc;           // static: all zero, the default for every field
         textiles_exemplar exemplar;
         textiles_set *set;
         textiles_layout layout;
         textiles_plane plane;
         static txm_env env;                  // malloc, silent, serial; receives the message
         static txm_image picture, atlas, out;
         for (int i = 0; i < 128 * 128; i++)  // instead of a photograph: noise in waves
             photo[i] = (unsigned char)(90 + i % 128 * 7 % 50 + i / 128 * 5 % 70 + i * i % 31);
         picture.pixels = photo;
         picture.width = picture.height = 128;
         exemplar.maps = &picture;            // more maps in register may follow
         exemplar.map_count = 1;
         desc.kind = TEXTILES_WANG;
         desc.exemplars = &exemplar;
         desc.exemplar_count = 1;
         desc.size = 32;
         if (textiles_make(&desc, &env, &set) != TXM_OK ||
             textiles_layout_make(set, TEXTILES_PACKED, 8, &env, &layout) != TXM_OK ||
             textiles_plane_make(set, 1, &env, &plane) != TXM_OK) {
             fprintf(stderr, "tiles: %s\n", env.message);
             return 1;
         }
         atlas.pixels = atlas_pixels;
         atlas.width = layout.width;
         atlas.height = layout.height;
         out.pixels = plane_pixels;
         out.width = 256;
         out.height = 192;
         if (textiles_draw_atlas(set, &layout, 0, &env, atlas) != TXM_OK ||
             textiles_draw_plane(&plane, &layout, &atlas, 0, 0, 1, &env, out) != TXM_OK) {
             fprintf(stderr, "draw: %s\n", env.message);
             return 1;
         }
         printf("%d tiles, atlas %d x %d, tile %d at (5, 7)\n", textiles_count(set),
                layout.width, layout.height, textiles_plane_tile(&plane, 5, 7));
         textiles_set_free(set);
         return 0;
     }

   WHICH KIND
     wang      the usual choice for a plane: C colours per axis, C^4 tiles. All tiles have the same
               pixels at their corners. A reduced set has 2 C^2 tiles, for scan-line order only.
     corner    the same number of tiles; corners differ, and diagonal neighbours match too.
     triangle  for surfaces of any shape: ((2 C)^3 + 4 C) / 3 tiles cover any triangle mesh, since
               every combination of edges has a tile. The texture turns with the triangles, so it
               should look alike in all directions.
     frame     for the quads of a model whose edges have fixed colours [5]: a class of tiles for
               each kind of quad, each class with any number of interiors.
     Two colours with two variants show no period at a glance; three colours are better where the
     surface is seen for a long time. A tile should be about three times as wide as the largest
     element of the texture, and the exemplar three times as wide as a tile. The exemplar may be as
     small as 64 x 64, but then the tiles repeat its content. Regular layouts, bricks for example,
     become irregular. (stb_herringbone_wang_tile.h assembles maps from hand-made templates, in a
     third of a microsecond per tile; it makes no tiles from pictures. textiles_import accepts
     hand-made ones.)

   HOW IT WORKS
     First a place of the exemplar with typical colour and roughness is chosen for each corner.
     Then, for each colour, a place for its edges: a strip of unmodified exemplar that covers both
     sides of the joint, so that the joint itself is a line of the exemplar. It must agree with the
     corners at its ends, be typical in roughness, brightness and contrast, and lie apart from the
     other edges. The two pixels on either side of a joint are the same in all tiles with that
     colour. The interior is a piece of the exemplar that fits the border, chosen so that the tiles
     show all of the exemplar and the set keeps its mean colour, roughness and contrast. Graph cuts
     (expansion moves [7]) join it to the border [8], instead of the diamonds of [1]; then the worst
     places along the cuts are covered with further pieces. Steps of colour that remain at the cuts
     are smoothed by a Poisson equation [9]. Triangles are made on a triangular lattice, on which
     turning by 60 degrees needs no resampling.

   CONFIGURATION   (define before the include that has _IMPLEMENTATION)
     TEXTILES_STATIC       every function static to the including file (set it everywhere)
     TEXTILES_MAX_PIXELS   refuse larger exemplars, sets and pictures; default 2^28
     TEXTILES_NO_SIMD      plain C only. Else SSE2 where the compiler has it and, with gcc and clang,
                           AVX2 where the processor has it. The bytes are the same.

   MEMORY
     A set holds the pixels of its tiles and, for each pixel, 4 bytes that say where it comes from.
     While it is made it also takes about 35 bytes per pixel of the exemplars and 9 per channel of
     their first map, and 1 MB and 190 bytes per pixel of a tile for each of up to eight tiles that
     are made at the same time. The plane needs no memory.

   TIME   (one core of 2023; make bench measures yours)
     About 0.1 s for a tile of 128 x 128 from 512 x 512 pixels, RGB: 16 Wang tiles in 1.5 s, 24
     triangles in 2 s. With a parallel-for hook eight tiles are made at a time.

   THREADS
     No global state. Calls with different env and outputs may overlap, and may share a set.

   SAME BYTES
     All decisions are made in integers, or in double and rounded once: the same bytes on any number
     of threads and on any compiler that keeps to IEEE 754 (see texmath.h), built with
     -ffp-contract=off.

   LIMITS
     Tiles of 8 to 1024 pixels (triangles: 32 to 1024), 2 to 4 colours, 1 to 16 variants, up to 8 maps and 8 exemplars of
     64 x 64 pixels or more. Joints are as rough as interiors within a few percent on average and
     35 % for any pair (textiles_measure reports it), unless the tiles are smaller than 64 pixels or
     the exemplar has smooth and rough areas larger than a tile. Cuts compare at most 8 channels;
     float maps are scaled to their range first.

   REFERENCES
     [1] M. F. Cohen, J. Shade, S. Hiller, O. Deussen. Wang tiles for image and texture generation.
         SIGGRAPH 2003.
     [2] A. A. Efros, W. T. Freeman. Image quilting for texture synthesis and transfer.
         SIGGRAPH 2001.
     [3] F. Neyret, M.-P. Cani. Pattern-based texturing revisited. SIGGRAPH 1999 (triangles).
     [4] A. Lagae, P. Dutre. An alternative for Wang tiles: colored edges versus colored corners.
         ACM Transactions on Graphics 25(4), 2006.
     [5] V. Burkus, A. Karpati, L. Szecsi. Animated trees with interlocking pieces (sections 5.1
         and 5.2: tiles with fixed frames for the quads of a model).
     [6] L.-Y. Wei. Tile-based texture mapping on graphics hardware. Graphics Hardware 2004.
     [7] Y. Boykov, O. Veksler, R. Zabih. Fast approximate energy minimization via graph cuts.
         IEEE PAMI 23(11), 2001; Y. Boykov, V. Kolmogorov. An experimental comparison of
         min-cut/max-flow algorithms. IEEE PAMI 26(9), 2004.
     [8] V. Kwatra et al. Graphcut textures. SIGGRAPH 2003.
     [9] P. Perez, M. Gangnet, A. Blake. Poisson image editing. SIGGRAPH 2003.
     [10] R. G. Keys. Cubic convolution interpolation for digital image processing. IEEE ASSP 29,
         1981.                                                                               */
#ifndef TEXTILES_H
#define TEXTILES_H

#include "texmath.h"

#include <float.h>

#define TEXTILES_VERSION "0.2.0"

#ifndef TEXTILES_MAX_PIXELS
#define TEXTILES_MAX_PIXELS (1 << 28) /* larger exemplars, sets and pictures are refused */
#endif

#if defined(TEXTILES_STATIC) && defined(__GNUC__)
#define TEXTILES_API __attribute__((unused)) static
#elif defined(TEXTILES_STATIC)
#define TEXTILES_API static
#else
#define TEXTILES_API extern
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* ---- tiles ------------------------------------------------------------------------------ */

enum {
    TEXTILES_MAX_COLORS = 4,    /* per axis; of a triangle set altogether       */
    TEXTILES_MAX_VARIANTS = 16, /* tiles with the same colours                  */
    TEXTILES_MAX_MAPS = 8,      /* pictures in register: albedo, normal, ...    */
    TEXTILES_MAX_EXEMPLARS = 8,
    TEXTILES_MAX_CLASSES = 64,  /* of a frame set                               */
    TEXTILES_MIN_SIZE = 8,      /* pixels a side of a square ...                */
    TEXTILES_MIN_TRIANGLE = 32, /* ... and of a triangle                        */
    TEXTILES_MAX_SIZE = 1024
};

typedef enum textiles_kind {
    TEXTILES_WANG = 0, /* squares with colours on their edges                              */
    TEXTILES_CORNER,   /* squares with colours on their corners                            */
    TEXTILES_TRIANGLE, /* equilateral triangles with directed colours on their edges       */
    TEXTILES_FRAME     /* squares of a few classes: all four edge colours are the class's  */
} textiles_kind;

/* What a tile matches. Squares are pictures with rows from top to bottom. Two may lie side by
   side if the east colour of the left one is the west colour of the right one, one above the other
   if south equals north (the two axes have colours of their own); corner tiles if the two corners
   that they share have equal colours.

   A triangle is stored on the lattice of its texels: texel (i, j), i + j <= size, lies at
   (i + j / 2, j sqrt(3) / 2) of the plane, rows downwards. Its corners and sides are numbered
   counter-clockwise, as the corners of faces are:

           0 . . . . 2     corner 0 = (0, 0), 1 = (0, size), 2 = (size, 0)
            . .   . .      side k runs from corner k to corner k + 1
             . . . .       both triangles at an edge store the texels on it
              . . .
                1                                                                         */
typedef struct textiles_tile {
    int edges[4];      /* colours, from 0: north, east, south, west; of a corner tile those of the
                          corners, north-west, north-east, south-east, south-west; of a triangle
                          those of its sides, edges[3] unused                                   */
    int directions[3]; /* of a triangle: +1 if side k runs along the direction of its edge, -1 if
                          against it; neighbours have equal colours and opposite directions     */
    int variant;       /* 0..variants-1 among the tiles with the same colours                   */
} textiles_tile;

/* ---- making a set ------------------------------------------------------------------------ */

/* One exemplar: a photograph, or several maps of one material in register. */
typedef struct textiles_exemplar {
    const txm_image *maps; /* map_count pictures of one size; the first counts most when cutting */
    int map_count;         /* 1..TEXTILES_MAX_MAPS; all exemplars have equally many maps, with the
                              same channels and sample types, and so have the tiles              */
} textiles_exemplar;

typedef enum textiles_repair {
    TEXTILES_REPAIR_DEFAULT = 0, /* = POISSON                                                   */
    TEXTILES_REPAIR_NONE,        /* every pixel is a pixel of the exemplar                      */
    TEXTILES_REPAIR_POISSON      /* steps of colour at cuts inside a tile are smoothed over a few
                                    pixels; the pixels at its border stay as they are           */
} textiles_repair;

typedef struct textiles_desc {
    const textiles_exemplar *exemplars; /* not modified, need not outlive the call             */
    int exemplar_count;                 /* 1..TEXTILES_MAX_EXEMPLARS                           */
    textiles_kind kind;
    int size;     /* side of a tile in pixels, 8..1024, of a triangle 32..1024, whose edges have
                     size + 1 texels; 0 = 128                                                    */
    int colors;   /* per axis, or of corners, or of triangle edges: 2..4 (frame: 1..4); 0 = 2    */
    int variants; /* tiles with the same colours, 1..16; 0 = 1                                   */
    int reduced;  /* wang: only two tiles (times variants) for each pair of north and west colour,
                     enough for textiles_scanline; triangle: without the tiles whose three edges all
                     have the same direction, which textiles_assign_triangles never needs        */
    const int (*classes)[4]; /* frame: the edge colours of each class, north, east, south, west;
                     NULL = class 0 is 0 0 0 0, class k < colors is 0 k 0 k                      */
    int class_count;         /* 1..TEXTILES_MAX_CLASSES; 0 = colors, with classes NULL           */
    const int *edge_exemplars; /* wang, triangle, frame: for each colour the exemplar that its edges
                     show, colors entries; NULL = any                                            */
    textiles_repair repair;
    uint64_t seed; /* another seed gives another set                                             */
    unsigned data_maps; /* sum of 1 << m: map m holds data; else the last of 2 or 4 channels is
                     alpha, which says how much of the others shows: they are compared, averaged and
                     repaired weighted by it, and those of fully transparent pixels become those of
                     visible neighbours                                                          */
} textiles_desc;

/* A set of tiles; never changed after it is made. */
typedef struct textiles_set textiles_set;

/* Cut a tile set out of exemplars by image quilting [1, 2, 5, 8]; see HOW IT WORKS.

   env    NULL, or how to allocate, report and spread the work
   out    receives the set, or NULL on any error; release it with textiles_set_free
   return TXM_OK; TXM_BAD_ARGUMENT for a field outside its range, maps that do not fit together or
          samples that are not finite; TXM_TOO_SMALL for an exemplar under 64 x 64;
          TXM_TOO_LARGE above TEXTILES_MAX_PIXELS; TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost   O(exemplar + tiles * (size^2 + exemplar)), where one search examines at most 131,072
          places; see MEMORY and TIME                                                         */
TEXTILES_API txm_status textiles_make(const textiles_desc *desc, txm_env *env, textiles_set **out);

/* Make a set of finished pictures, for example hand-made ones; all functions below work for it too.
   Of desc only kind, size, colors, variants, reduced, classes and data_maps are read. tiles holds the pictures
   of map_count maps tile by tile, tiles[tile * map_count + map], in the order of textiles_tile_at:
   size x size, of a triangle (size + 1) x (size + 1) with texel (i, j) at column i, row j; texels
   beyond i + j = size are ignored. tile_count must be the number of tiles that such a set has. */
TEXTILES_API txm_status textiles_import(const textiles_desc *desc, const txm_image *tiles,
                                        int tile_count, int map_count, txm_env *env,
                                        textiles_set **out);

/* Release a set with the allocator it was made with; NULL is allowed. */
TEXTILES_API void textiles_set_free(textiles_set *set);

/* ---- properties of a set ----------------------------------------------------------------- */

TEXTILES_API textiles_kind textiles_kind_of(const textiles_set *set);
TEXTILES_API int textiles_count(const textiles_set *set); /* tiles, variants included        */
TEXTILES_API int textiles_size(const textiles_set *set);  /* pixels a side, as requested     */
TEXTILES_API int textiles_colors(const textiles_set *set);
TEXTILES_API int textiles_variants(const textiles_set *set);
TEXTILES_API int textiles_map_count(const textiles_set *set);
TEXTILES_API int textiles_channels(const textiles_set *set, int map); /* 1..4; 0: no such map */

/* The tile with an index of 0..count-1; returns 0 for a bad index. Tiles of equal colours follow
   each other, variant 0 first; complete wang and corner sets are sorted by their colours read as
   digits. */
TEXTILES_API int textiles_tile_at(const textiles_set *set, int index, textiles_tile *tile);

/* The tile (variant 0) with these colours and, of a triangle, directions; -1: none. Triangles are
   stored once for their three rotations: *rotation (may be NULL) receives r such that side k of the
   request is side (k + r) mod 3 of the tile. */
TEXTILES_API int textiles_find(const textiles_set *set, const int edges[4], const int directions[3],
                               int *rotation);

/* Where pixel (x, y) of a tile comes from: returns the number of the exemplar, from receives the
   pixel there (of triangles, whose texels lie between pixels, the position). -1 for a bad index or
   an imported set. */
TEXTILES_API int textiles_source(const textiles_set *set, int tile, int x, int y, float from[2]);

/* How well the tiles join. For each pair that may lie side by side: the mean absolute difference of
   neighbouring pixels across the joint, divided by that of all neighbours inside the two tiles in
   the same direction. (Triangles share the texels on the edge: differences between these and the
   rows on both sides.) 1 = the joint is as rough as the interiors. */
typedef struct textiles_joints {
    double mean, worst, least; /* of the ratio over all pairs             */
    double overall;            /* mean step over all joints / mean inside */
    int pairs;
} textiles_joints;
TEXTILES_API txm_status textiles_measure(const textiles_set *set, int map, txm_env *env,
                                         textiles_joints *joints);

/* ---- pictures of a set ------------------------------------------------------------------- */

typedef enum textiles_packing {
    TEXTILES_PACKED = 0, /* each tile with a gutter around it that continues the texture         */
    TEXTILES_TORUS,      /* Wei's layout [6] of complete wang and corner sets (corner: 2 or 3
                            colours): every tile's neighbours match it, across the borders of the
                            picture too, so that filtering and mip-maps need no gutter           */
    TEXTILES_SLICES      /* one below the other, each with its gutter: layer t of a texture array
                            is rows t * pitch_y to (t + 1) * pitch_y - 1. (OpenGL guarantees no
                            more than 256 layers.)                                               */
} textiles_packing;

/* Where the tiles lie in one picture; a plain value. Pixel (x, y) of a tile lies at
   (px + step * x, py + step * y) with px, py and step of textiles_place. */
typedef struct textiles_layout {
    int size, colors, variants, count; /* of the set                           */
    textiles_kind kind;
    textiles_packing packing;
    int gutter;           /* pixels                                            */
    int columns;          /* cells a row                                       */
    int pitch_x, pitch_y; /* pixels from cell to cell                          */
    int width, height;    /* pixels of the whole picture                       */
} textiles_layout;

/* Compute where each tile lies.

   gutter  0..size/2 pixels around each tile, filled with what a matching neighbour shows there: 1
           is enough for bilinear filtering, 2^n for mip-map level n; -1 = 8, in small tiles size/2
           (TORUS: must be 0 or -1). Rounded up to a power of two; tiles and gutters begin at multiples of it, so that no
           pixel of these levels belongs to two tiles. In a set of textiles_make the first 2 pixels
           are the same for all neighbours that match; the others are those of one such neighbour.
   return  TXM_OK, TXM_BAD_ARGUMENT, TXM_TOO_LARGE                                             */
TEXTILES_API txm_status textiles_layout_make(const textiles_set *set, textiles_packing packing,
                                             int gutter, txm_env *env, textiles_layout *layout);

/* Where pixel (0, 0) of a tile lies, and the step to the next: +1, or -1 for triangles stored
   upside down. uv receives the corners in texture coordinates, v downwards: of a square its outer
   corners nw, ne, se, sw, of a triangle the centres of its corner texels 0, 1, 2 (uv[3] is not
   written). With SLICES px and py refer to the whole picture, uv to the layer of the tile. All
   outputs may be NULL. Returns 0 for a bad index. */
TEXTILES_API int textiles_place(const textiles_layout *layout, int tile, int *px, int *py, int *step,
                                float uv[4][2]);

/* Draw the atlas of one map. out: layout width x height, channels and sample type of the map;
   untouched after an error. Pixels outside all tiles and gutters repeat the nearest gutter. */
TEXTILES_API txm_status textiles_draw_atlas(const textiles_set *set, const textiles_layout *layout,
                                            int map, txm_env *env, txm_image out);

/* Draw one tile with a gutter around it: (size + 2 gutter) a side, of triangles (size + 1 + 2
   gutter) with texel (0, 0) at (gutter, gutter). */
TEXTILES_API txm_status textiles_draw_tile(const textiles_set *set, int tile, int gutter, int map,
                                           txm_env *env, txm_image out);

/* ---- the infinite plane ------------------------------------------------------------------ */

/* A plane without end and without period, covered by a set: which tile lies where is computed from
   the position and the seed alone, in constant time. Needs a complete wang, corner or triangle set
   (a reduced triangle set is enough). A plain value that may be copied; valid as long as the set. */
typedef struct textiles_plane {
    int colors, variants;
    textiles_kind kind;
    uint32_t seed;
    const int32_t *table; /* triangles: by symbols, tile * 4 + rotation, see textiles_plane_table */
} textiles_plane;

TEXTILES_API txm_status textiles_plane_make(const textiles_set *set, uint32_t seed, txm_env *env,
                                            textiles_plane *plane);

/* The tile of the square at column x, row y, which may be any int: coordinates wrap around. With two
   variants or more no three equal tiles lie in a row or column. -1 on a plane of triangles. */
TEXTILES_API int textiles_plane_tile(const textiles_plane *plane, int x, int y);

/* The same for a window of width x height squares; the fastest way. */
TEXTILES_API void textiles_plane_fill(const textiles_plane *plane, int x, int y, int width,
                                      int height, int *tiles);

/* Triangles: the lattice point (a, b) lies at (a + b / 2, b sqrt(3) / 2) sides, rows downwards.
   half 0 is the triangle (a, b), (a, b+1), (a+1, b); half 1 is (a+1, b+1), (a+1, b), (a, b+1).
   Corner k of the triangle, in this order, shows corner (k + *rotation) mod 3 of the tile; rotation
   may be NULL. With two variants or more equal tiles are never neighbours. -1 on a plane of
   squares. */
TEXTILES_API int textiles_plane_triangle(const textiles_plane *plane, int a, int b, int half,
                                         int *rotation);

/* The table of a triangle set for the GPU: (2 colors)^3 entries tile * 4 + rotation, -1 where there
   is none, by the symbols (2 color + (direction < 0)) of sides 0, 1, 2 as digits. NULL for squares. */
TEXTILES_API const int32_t *textiles_plane_table(const textiles_plane *plane, int *count);

/* Draw a window of the plane from an atlas, with bilinear filtering, as shaders/textiles.glsl does;
   in an atlas of 2 or 4 channels colour is weighted by alpha.

   atlas   drawn by textiles_draw_atlas with this layout
   x, y    position of the picture's top left corner on the plane, in pixels of the tiles (a side of
           a tile has size of them), up to 10^9 tiles from the origin
   step    pixels of the tiles per pixel of the picture, > 0; with whole x, y and step 1 squares are
           copied unfiltered
   return  TXM_OK, TXM_BAD_ARGUMENT, TXM_TOO_LARGE                                             */
TEXTILES_API txm_status textiles_draw_plane(const textiles_plane *plane,
                                            const textiles_layout *layout, const txm_image *atlas,
                                            double x, double y, double step, txm_env *env,
                                            txm_image out);

/* ---- finite grids ------------------------------------------------------------------------ */

/* Stochastic tiling in scan-line order [1]: each tile is drawn at random among those that match the
   tiles above and to the left, without three equal ones in a row where possible. For any square
   set, reduced ones too, that has a tile for each such pair of colours.

   return TXM_OK; TXM_BAD_ARGUMENT: triangles, a size below 1, or a set with a dead end, that is, a
          pair of colours that occur to the south and east of tiles but that no tile has to the
          north and west; TXM_TOO_LARGE                                                          */
TEXTILES_API txm_status textiles_scanline(const textiles_set *set, int width, int height,
                                          uint64_t seed, txm_env *env, int *tiles);

/* Tiling under constraints: cells that hold a tile's number keep it, cells with -1 are filled so
   that all match. Any square set.

   periodic  non-zero: the grid continues across its own borders
   tiles     width * height, rows from the top; in: tiles to keep, or -1; out: the tiling (untouched
             after an error)
   return    TXM_OK; TXM_BAD_ARGUMENT: triangles, a bad size or number, or tiles to keep that
             contradict each other (the message says where); TXM_BAD_DATA: no tiling found, because
             there is none or because 64 searches gave up; TXM_TOO_LARGE above 2^27 cells;
             TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost      O(width * height * tiles) for complete sets; others need a search             */
TEXTILES_API txm_status textiles_solve(const textiles_set *set, int width, int height, int periodic,
                                       uint64_t seed, txm_env *env, int *tiles);

/* ---- meshes ------------------------------------------------------------------------------ */

/* Cover a triangle mesh. Every edge gets a colour by hash and the direction from its lower to its
   higher vertex number, every face a tile with these edges. Any connectivity is allowed: borders,
   edges of more than two faces, inconsistent winding. Equal tiles are not neighbours where colours
   and variants can avoid it.

   indices    3 * face_count vertex numbers below vertex_count, faces counter-clockwise
   tiles      receives the tile of each face
   rotations  receives r for each face: its corner k shows corner (k + r) mod 3 of the tile
   return     TXM_OK; TXM_BAD_ARGUMENT; TXM_TOO_LARGE; TXM_OUT_OF_MEMORY; TXM_CANCELLED (outputs
              untouched)
   cost       O(faces), 40 bytes per face                                                        */
TEXTILES_API txm_status textiles_assign_triangles(const textiles_set *set, const uint32_t *indices,
                                                  size_t face_count, size_t vertex_count,
                                                  uint64_t seed, txm_env *env, int *tiles,
                                                  int *rotations);

/* Cover a mesh of quads with wang or frame tiles. Corner 0, 1, 2, 3 of a quad is nw, sw, se, ne of
   its tile (counter-clockwise), so the edges 0-1, 1-2, 2-3, 3-0 are west, south, east, north.

   indices   4 * face_count vertex numbers below vertex_count
   edges     4 * face_count colours north, east, south, west; NULL = colours by hash (complete wang
             sets)
   return    TXM_OK; TXM_BAD_ARGUMENT, also if an edge is shared by more than two faces or by two
             sides that do not match (north matches south, east matches west, in opposite
             directions), or if no tile has the colours of a face: the message names the faces;
             TXM_TOO_LARGE; TXM_OUT_OF_MEMORY; TXM_CANCELLED                                    */
TEXTILES_API txm_status textiles_assign_quads(const textiles_set *set, const uint32_t *indices,
                                              size_t face_count, size_t vertex_count,
                                              const int *edges, uint64_t seed, txm_env *env,
                                              int *tiles);

/* Texture coordinates of the corners 0, 1, 2 (3) of a face with this tile and rotation, v
   downwards. Returns the number of corners, 0 for a bad index or rotation. */
TEXTILES_API int textiles_face_uv(const textiles_layout *layout, int tile, int rotation,
                                  float uv[4][2]);

#ifdef __cplusplus
}
#endif
#endif /* TEXTILES_H */

#if defined(TEXTILES_IMPLEMENTATION) && !defined(TEXTILES_IMPLEMENTED)
#define TEXTILES_IMPLEMENTED

#include "textiles/config.h"
#include "textiles/set.h"
#include "textiles/plane.h"
#include "textiles/grid.h"
#include "textiles/mesh.h"
#include "textiles/atlas.h"
#include "textiles/exemplar.h"
#include "textiles/search.h"
#include "textiles/frame.h"
#include "textiles/tile.h"
#include "textiles/interior.h"
#include "textiles/repair.h"
#include "textiles/make.h"
#include "textiles/measure.h"
#endif /* TEXTILES_IMPLEMENTATION */

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
