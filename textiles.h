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

/* ---- configuration ------------------------------------------------------------------ */

#if !defined(TEXTILES_NO_SIMD) && defined(__SSE2__)
#include <emmintrin.h>
#define TXT_SSE2 1
#if defined(__GNUC__)
#include <immintrin.h>
#define TXT_AVX2 1 /* compiled for AVX2 function by function, chosen when running */
#endif
#endif

/* ---- private types ---------------------------------------------------------------------- */

/* One map of all tiles: tile by tile side x side texels. */
typedef struct txt_map {
    int channels;
    int has_alpha;   /* the last of 2 or 4 channels is alpha: the map is no data */
    txm_sample sample;
    size_t texel;    /* bytes of one texel                                     */
    uint8_t *pixels; /* count * side * side * texel bytes; aligned for sample  */
} txt_map;

struct textiles_set {
    txm_arena arena; /* holds the set itself and all it points to                                 */
    textiles_kind kind;
    int size, side; /* pixels a side; texels stored a row: size, of triangles size + 1           */
    int colors, variants, reduced;
    int symbols;    /* digits of a code: colors, of triangles 2 colors                           */
    int complete;   /* every code has a tile (triangles: every acyclic one)                       */
    int count, map_count;
    textiles_tile *tiles;
    int32_t *lookup; /* by code: tile of variant 0 * 4 + rotation, or -1; see txt_code            */
    txt_map maps[TEXTILES_MAX_MAPS];
    int32_t *source; /* count * side * side texel numbers in the sheet, or NULL if imported       */
    struct {         /* exemplars as the texel numbers count them, one after the other            */
        int32_t first;
        int width, height; /* texels; of triangles rows are sqrt(3) / 2 pixels apart              */
    } sheets[TEXTILES_MAX_EXEMPLARS];
    int exemplar_count;
};

/* Colours as digits of one number: squares 4 digits edges[0] first, triangles 3 symbols
   2 color + (direction < 0). The number of codes is txt_code_count. */
static int txt_symbol(const textiles_set *s, const int edges[4], const int directions[3], int k) {
    return s->kind == TEXTILES_TRIANGLE ? 2 * edges[k] + (directions[k] < 0) : edges[k];
}

static int txt_code(const textiles_set *s, const int edges[4], const int directions[3]) {
    const int digits = s->kind == TEXTILES_TRIANGLE ? 3 : 4;
    int code = 0;
    for (int k = 0; k < digits; k++) {
        if (edges[k] < 0 || edges[k] >= s->colors) return -1;
        code = code * s->symbols + txt_symbol(s, edges, directions, k);
    }
    return code;
}

static int txt_code_count(const textiles_set *s) {
    const int n = s->symbols;
    return s->kind == TEXTILES_TRIANGLE ? n * n * n : n * n * n * n;
}

/* texel (x, y) of a tile, inside its side x side square */
static uint8_t *txt_texel(const textiles_set *s, int map, int tile, int x, int y) {
    const size_t side = (size_t)s->side;
    return s->maps[map].pixels +
           (((size_t)tile * side + (size_t)y) * side + (size_t)x) * s->maps[map].texel;
}

/* the exemplar of which a sheet holds the texel of this number */
static int txt_sheet_of(const textiles_set *s, int32_t texel) {
    int e = 0;
    while (e + 1 < s->exemplar_count && texel >= s->sheets[e + 1].first) e++;
    return e;
}

/* sample i of a row, as it is stored: not scaled to 0..1 */
static double txt_stored(txm_sample sample, const void *row, size_t i) {
    if (sample == TXM_F32) return (double)((const float *)row)[i];
    if (sample == TXM_U16) return ((const uint16_t *)row)[i];
    return ((const uint8_t *)row)[i];
}

static txm_status txt_cancelled(txm_env *env) {
    return txm_fail(env, TXM_CANCELLED, "cancelled");
}

/* ---- which tiles a set has ---------------------------------------------------------------- */

/* The checks of a description that made and imported sets have in common. */
static txm_status txt_check_kind(const textiles_desc *d, txm_env *env) {
    const int low = d->kind == TEXTILES_FRAME ? 1 : 2;
    const int least = d->kind == TEXTILES_TRIANGLE ? TEXTILES_MIN_TRIANGLE : TEXTILES_MIN_SIZE;
    if ((int)d->kind < TEXTILES_WANG || (int)d->kind > TEXTILES_FRAME)
        return txm_fail(env, TXM_BAD_ARGUMENT, "kind is none of textiles_kind");
    if (d->size && (d->size < least || d->size > TEXTILES_MAX_SIZE))
        return txm_fail_numbers(env, TXM_BAD_ARGUMENT, "size must be # to # pixels, or 0 for 128",
                                (uint64_t)least, TEXTILES_MAX_SIZE);
    if (d->colors && (d->colors < low || d->colors > TEXTILES_MAX_COLORS))
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "colors must be 2 to 4 (of a frame set 1 to 4), or 0 for 2");
    if (d->variants < 0 || d->variants > TEXTILES_MAX_VARIANTS)
        return txm_fail(env, TXM_BAD_ARGUMENT, "variants must be 1 to 16, or 0 for 1");
    if (d->reduced && d->kind != TEXTILES_WANG && d->kind != TEXTILES_TRIANGLE)
        return txm_fail(env, TXM_BAD_ARGUMENT, "only wang and triangle sets can be reduced");
    if ((d->classes || d->class_count) && d->kind != TEXTILES_FRAME)
        return txm_fail(env, TXM_BAD_ARGUMENT, "classes are for frame sets; leave them NULL and 0");
    if (!d->classes != !d->class_count || d->class_count < 0 ||
        d->class_count > TEXTILES_MAX_CLASSES)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "give classes together with class_count, 1 to 64, or neither");
    const int colors = d->colors ? d->colors : 2;
    for (int k = 0; k < d->class_count; k++) {
        for (int i = 0; i < 4; i++) {
            if (d->classes[k][i] < 0 || d->classes[k][i] >= colors)
                return txm_fail(env, TXM_BAD_ARGUMENT, "classes: a color is not below colors");
        }
        for (int j = 0; j < k; j++) {
            if (memcmp(d->classes[j], d->classes[k], sizeof d->classes[k]) == 0)
                return txm_fail(env, TXM_BAD_ARGUMENT,
                                "classes: two are the same; raise variants instead");
        }
    }
    return TXM_OK;
}

/* Append the variants of a tile; enter it in the table under its code and, of a triangle, under
   those of its rotations. With tiles NULL it only counts. */
static void txt_add_tile(textiles_set *s, const int edges[4], const int directions[3]) {
    const int rotations = s->kind == TEXTILES_TRIANGLE ? 3 : 1;
    if (s->tiles) {
        for (int v = 0; v < s->variants; v++) {
            textiles_tile *t = &s->tiles[s->count + v];
            for (int k = 0; k < 4; k++) t->edges[k] = edges[k];
            for (int k = 0; k < 3; k++) t->directions[k] = directions[k];
            t->variant = v;
        }
        for (int r = rotations - 1; r >= 0; r--) { /* side k here is side k + r of the tile */
            int e[4] = {edges[0], edges[1], edges[2], edges[3]}, d[3] = {0, 0, 0};
            for (int k = 0; k < 3 && rotations == 3; k++) {
                e[k] = edges[(k + r) % 3];
                d[k] = directions[(k + r) % 3];
            }
            s->lookup[txt_code(s, e, d)] = s->count * 4 + r;
        }
    }
    s->count += s->variants;
}

/* All triples of directed edges up to rotation, ((2 C)^3 + 4 C) / 3 of them; in a reduced set
   without those whose edges all have the same direction, 2 C^3. Each is listed under its smallest
   code. */
static void txt_list_triangles(textiles_set *s) {
    const int n = s->symbols;
    for (int a = 0; a < n; a++) {
        for (int b = 0; b < n; b++) {
            for (int c = 0; c < n; c++) {
                const int code = (a * n + b) * n + c;
                if ((b * n + c) * n + a < code || (c * n + a) * n + b < code) continue;
                const int sum = (a & 1) + (b & 1) + (c & 1);
                if (s->reduced && (sum == 0 || sum == 3)) continue;
                const int edges[4] = {a / 2, b / 2, c / 2, 0};
                const int directions[3] = {a & 1 ? -1 : 1, b & 1 ? -1 : 1, c & 1 ? -1 : 1};
                txt_add_tile(s, edges, directions);
            }
        }
    }
}

/* Count the tiles (tiles NULL) or list them. */
static void txt_list_tiles(textiles_set *s, const textiles_desc *d) {
    const int c = s->colors, none[3] = {0, 0, 0};
    s->count = 0;
    if (s->kind == TEXTILES_TRIANGLE) {
        txt_list_triangles(s);
    } else if (s->kind == TEXTILES_FRAME) {
        for (int k = 0; k < (d->classes ? d->class_count : c); k++) {
            const int plain[4] = {0, k, 0, k};
            txt_add_tile(s, d->classes ? d->classes[k] : plain, none);
        }
    } else if (s->reduced) {
        /* (north, west) -> (east, south) is one to one for each of the two tiles, so that all
           colours are as frequent, and both tiles differ in both */
        for (int i = 0; i < 2 * c * c; i++) {
            const int north = i / (2 * c), west = i / 2 % c, j = i & 1;
            const int edges[4] = {north, (north + west + j) % c, (north + j) % c, west};
            txt_add_tile(s, edges, none);
        }
    } else {
        for (int i = 0; i < c * c * c * c; i++) {
            const int edges[4] = {i / (c * c * c), i / (c * c) % c, i / c % c, i % c};
            txt_add_tile(s, edges, none);
        }
    }
}

/* A set with its tiles listed and memory for their texels. Of maps only channels and sample are
   read, and what is alpha follows from the description. */
static txm_status txt_set_make(const textiles_desc *d, const txt_map *maps, int map_count,
                               int with_source, txm_env *env, textiles_set **out) {
    textiles_set head;
    memset(&head, 0, sizeof head);
    txm_arena_init(&head.arena, env);
    head.kind = d->kind;
    head.size = d->size ? d->size : 128;
    head.side = head.size + (d->kind == TEXTILES_TRIANGLE);
    head.colors = d->colors ? d->colors : 2;
    head.variants = d->variants ? d->variants : 1;
    head.reduced = d->reduced != 0;
    head.complete = d->kind == TEXTILES_TRIANGLE || (d->kind != TEXTILES_FRAME && !d->reduced);
    head.symbols = head.colors * (d->kind == TEXTILES_TRIANGLE ? 2 : 1);
    head.map_count = map_count;
    txt_list_tiles(&head, d);

    const size_t texels = (size_t)head.side * (size_t)head.side;
    if ((size_t)head.count > TEXTILES_MAX_PIXELS / texels)
        return txm_fail(env, TXM_TOO_LARGE,
                        "the set has more than TEXTILES_MAX_PIXELS pixels; fewer or smaller tiles");
    const size_t all = (size_t)head.count * texels, codes = (size_t)txt_code_count(&head);
    head.tiles =
        (textiles_tile *)txm_arena_alloc(&head.arena, (size_t)head.count, sizeof(textiles_tile));
    head.lookup = (int32_t *)txm_arena_alloc(&head.arena, codes, sizeof(int32_t));
    for (int m = 0; m < map_count; m++) {
        head.maps[m] = maps[m];
        head.maps[m].has_alpha = maps[m].channels % 2 == 0 && !(d->data_maps >> m & 1);
        head.maps[m].texel = (size_t)maps[m].channels * txm_sample_bytes(maps[m].sample);
        head.maps[m].pixels = (uint8_t *)txm_arena_zero(&head.arena, all, head.maps[m].texel);
    }
    if (with_source)
        head.source = (int32_t *)txm_arena_alloc(&head.arena, all, sizeof(int32_t));
    textiles_set *s = (textiles_set *)txm_arena_alloc(&head.arena, 1, sizeof *s);
    if (head.arena.failed) {
        txm_arena_free(&head.arena);
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the tile set");
    }
    for (size_t i = 0; i < codes; i++) head.lookup[i] = -1;
    txt_list_tiles(&head, d);
    *s = head;
    *out = s;
    return TXM_OK;
}

/* May square u lie east of t, or (down) south of it? */
static int txt_joins(const textiles_set *s, int t, int u, int down) {
    const int *a = s->tiles[t].edges, *b = s->tiles[u].edges;
    if (s->kind == TEXTILES_CORNER)
        return down ? a[3] == b[0] && a[2] == b[1] : a[1] == b[0] && a[2] == b[3];
    return down ? a[2] == b[0] : a[1] == b[3];
}

/* Are all samples finite? Of a triangle's square only the triangle counts. */
static int txt_tile_is_finite(const txm_image *im, textiles_kind kind) {
    for (int y = 0; y < im->height; y++) {
        txm_image row = *im;
        row.pixels = txm_image_row(im, y);
        row.height = 1;
        if (kind == TEXTILES_TRIANGLE) row.width = im->width - y;
        if (!txm_image_is_finite(&row)) return 0;
    }
    return 1;
}

/* Replace the hidden colours of all tiles of imported squares by those of visible neighbours. */
static txm_status txt_bleed_tiles(const textiles_set *s, txm_env *env) {
    txm_status status = TXM_OK;
    for (int i = 0; i < s->count && s->kind != TEXTILES_TRIANGLE; i++) {
        for (int m = 0; m < s->map_count && status == TXM_OK; m++) {
            const txm_image tile = {txt_texel(s, m, i, 0, 0), s->side, s->side,
                                    s->maps[m].channels, s->maps[m].sample, 0};
            if (s->maps[m].has_alpha) status = txm_image_bleed(&tile, 0, env);
        }
    }
    return status;
}

/* ---- public: sets ------------------------------------------------------------------------- */

TEXTILES_API void textiles_set_free(textiles_set *set) {
    if (!set) return;
    txm_arena arena = set->arena; /* the set lies in a block of its own */
    txm_arena_free(&arena);
}

TEXTILES_API txm_status textiles_import(const textiles_desc *desc, const txm_image *tiles,
                                        int tile_count, int map_count, txm_env *env,
                                        textiles_set **out) {
    txt_map maps[TEXTILES_MAX_MAPS];
    textiles_set *s = NULL;
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    if (!desc || !tiles) return txm_fail(env, TXM_BAD_ARGUMENT, "desc or tiles is NULL");
    if (map_count < 1 || map_count > TEXTILES_MAX_MAPS)
        return txm_fail(env, TXM_BAD_ARGUMENT, "map_count must be 1 to 8");
    if (tile_count < 1) return txm_fail(env, TXM_BAD_ARGUMENT, "tile_count must be 1 or more");
    txm_status status = txt_check_kind(desc, env);
    if (status != TXM_OK) return status;

    const int side = (desc->size ? desc->size : 128) + (desc->kind == TEXTILES_TRIANGLE);
    memset(maps, 0, sizeof maps);
    for (int m = 0; m < map_count; m++) {
        maps[m].channels = tiles[m].channels ? tiles[m].channels : 1;
        maps[m].sample = tiles[m].sample;
    }
    for (int i = 0; i < tile_count; i++) {
        for (int m = 0; m < map_count; m++) {
            const txm_image *im = &tiles[(size_t)i * (size_t)map_count + (size_t)m];
            status = txm_image_check(im, "tiles", TEXTILES_MAX_PIXELS, env);
            if (status != TXM_OK) return status;
            if (im->width != side || im->height != side || im->sample != maps[m].sample ||
                txm_image_resolve(*im).channels != maps[m].channels)
                return txm_fail(env, TXM_BAD_ARGUMENT,
                                "tiles: all must have the size of the set and the same channels");
            if (!txt_tile_is_finite(im, desc->kind))
                return txm_fail(env, TXM_BAD_ARGUMENT, "tiles: a sample is not finite");
        }
    }
    status = txt_set_make(desc, maps, map_count, 0, env, &s);
    if (status != TXM_OK) return status;
    if (s->count != tile_count) {
        textiles_set_free(s);
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "tile_count is not the number of tiles that such a set has");
    }
    for (int i = 0; i < tile_count; i++) {
        for (int m = 0; m < map_count; m++) {
            const txm_image *im = &tiles[(size_t)i * (size_t)map_count + (size_t)m];
            for (int y = 0; y < side; y++)
                memcpy(txt_texel(s, m, i, 0, y), txm_image_row_const(im, y),
                       (size_t)side * s->maps[m].texel);
        }
    }
    status = txt_bleed_tiles(s, env);
    if (status != TXM_OK) textiles_set_free(s);
    else *out = s;
    return status;
}

TEXTILES_API textiles_kind textiles_kind_of(const textiles_set *set) {
    return set->kind;
}
TEXTILES_API int textiles_count(const textiles_set *set) {
    return set->count;
}
TEXTILES_API int textiles_size(const textiles_set *set) {
    return set->size;
}
TEXTILES_API int textiles_colors(const textiles_set *set) {
    return set->colors;
}
TEXTILES_API int textiles_variants(const textiles_set *set) {
    return set->variants;
}
TEXTILES_API int textiles_map_count(const textiles_set *set) {
    return set->map_count;
}
TEXTILES_API int textiles_channels(const textiles_set *set, int map) {
    return map >= 0 && map < set->map_count ? set->maps[map].channels : 0;
}

TEXTILES_API int textiles_tile_at(const textiles_set *set, int index, textiles_tile *tile) {
    if (index < 0 || index >= set->count) return 0;
    *tile = set->tiles[index];
    return 1;
}

TEXTILES_API int textiles_find(const textiles_set *set, const int edges[4], const int directions[3],
                               int *rotation) {
    if (!edges || (set->kind == TEXTILES_TRIANGLE && !directions)) return -1;
    const int code = txt_code(set, edges, directions);
    if (code < 0 || set->lookup[code] < 0) return -1;
    if (rotation) *rotation = set->lookup[code] & 3;
    return set->lookup[code] / 4;
}

TEXTILES_API int textiles_source(const textiles_set *set, int tile, int x, int y, float from[2]) {
    if (!set->source || tile < 0 || tile >= set->count || x < 0 || y < 0 || x >= set->side ||
        y >= set->side)
        return -1;
    const size_t side = (size_t)set->side;
    const int32_t t = set->source[((size_t)tile * side + (size_t)y) * side + (size_t)x];
    if (t < 0) return -1;
    const int e = txt_sheet_of(set, t), at = t - set->sheets[e].first, width = set->sheets[e].width;
    const int row = at / width, column = at % width;
    if (set->kind == TEXTILES_TRIANGLE) {
        from[0] = (float)column + (row & 1 ? 0.5f : 0.0f);
        from[1] = txm_float(row * 0.86602540378443864676);
    } else {
        from[0] = (float)column;
        from[1] = (float)row;
    }
    return e;
}

/* ---- the hash ----------------------------------------------------------------------------- */

/* Which tile lies where is computed from

       hash(seed, what, x, y) = txt_at(txt_column(seed, x), what, y),

   32 bits that depend on the position, on the property wanted there (what) and on the seed. The
   inner half depends on the column only and is shared by all cells of a column, and by two edges of
   one. In 32-bit integers, since shaders/textiles.glsl computes the same; coordinates are taken
   modulo 2^32. The two multipliers of the mixing step are those of C. Wellons ("prospecting for
   hash functions"). */
static uint32_t txt_mix(uint32_t h) {
    h ^= h >> 16;
    h *= 0x7feb352du;
    h ^= h >> 15;
    h *= 0x846ca68bu;
    return h ^ (h >> 16);
}

static uint32_t txt_column(uint32_t seed, uint32_t x) {
    return txt_mix(x + seed);
}

/* the part of the hash that is the same for all columns */
static uint32_t txt_key(uint32_t what, uint32_t y) {
    return y * 0x9e3779b9u + what * 0x85ebca6bu;
}

static uint32_t txt_at(uint32_t column, uint32_t what, uint32_t y) {
    return txt_mix(column ^ txt_key(what, y));
}

/* a hash as a number of 0..n-1 */
static int txt_below(uint32_t hash, int n) {
    return (int)((hash >> 8) * (uint32_t)n >> 24);
}

/* the upper and lower 16 bits of a hash as numbers of 0..n-1 */
static int txt_upper(uint32_t hash, int n) {
    return (int)((hash >> 16) * (uint32_t)n >> 16);
}
static int txt_lower(uint32_t hash, int n) {
    return (int)((hash & 0xffffu) * (uint32_t)n >> 16);
}

/* ---- the plane: which tile lies where --------------------------------------------------- */

/* The hashes of a square (x, y):

       what 0   the colour of its north edge; its south edge is the north edge of (x, y + 1)
       what 1   the colour of its west edge; its east edge is the west edge of (x + 1, y)
       what 2   of corner tiles, the colour of its north-west corner
       what 3   variants of the upper left and lower right square of a block of 2 x 2
       what 4   variants of the other two

   Colours are txt_below(hash, colors). */

/* the k-th of the variants that are neither a nor d */
static int txt_other_variant(int k, int a, int d) {
    const int low = a < d ? a : d, high = a < d ? d : a;
    k += k >= low;
    return k + ((k >= high) & (low != high));
}

/* The variants of a block of squares (2 bx, 2 by) .. (2 bx + 1, 2 by + 1),

       a b      a and d at random (two variants: d = a),
       c d      b and c at random among those that are neither a nor d.

   Of three squares in a row two belong to the same block, and these have different variants, so
   that three equal tiles never lie in a row, whatever their colours. h = hash(3, bx, by), g =
   hash(4, bx, by) for bx = x / 2, by = y / 2 of the coordinates as unsigned numbers. */
static void txt_block_variants(uint32_t h, uint32_t g, int variants, int v[4]) {
    const int a = txt_upper(h, variants), d = variants == 2 ? a : txt_lower(h, variants);
    const int others = variants - 1 - (a != d);
    v[0] = a;
    v[1] = txt_other_variant(txt_upper(g, others), a, d);
    v[2] = txt_other_variant(txt_lower(g, others), a, d);
    v[3] = d;
}

/* the variant of a square */
static int txt_square_variant(uint32_t seed, int variants, uint32_t x, uint32_t y) {
    int v[4];
    if (variants < 2) return 0;
    const uint32_t column = txt_column(seed, x >> 1);
    txt_block_variants(txt_at(column, 3, y >> 1), txt_at(column, 4, y >> 1), variants, v);
    return v[(y & 1) * 2 + (x & 1)];
}

enum { TXT_STRIP = 256 }; /* columns that textiles_plane_fill computes at a time; even */

/* A strip of the plane, filled row by row; element i belongs to column x + i. */
typedef struct txt_strip {
    uint32_t column[TXT_STRIP + 1];    /* txt_column of the columns            */
    uint32_t block[TXT_STRIP / 2 + 1]; /* and of the blocks of two             */
    int upper[TXT_STRIP + 1];          /* colours at the row's upper side      */
    int lower[TXT_STRIP + 1];          /* and at its lower side                */
    int west[TXT_STRIP + 1];           /* colours of vertical edges            */
    int variant[2][TXT_STRIP + 2];     /* of the rows of a block, from even x  */
} txt_strip;

static void txt_strip_colors(const uint32_t *column, int count, uint32_t what, uint32_t y, int colors,
                             int *out) {
    const uint32_t key = txt_key(what, y);
    for (int i = 0; i < count; i++) out[i] = txt_below(txt_mix(column[i] ^ key), colors);
}

static void txt_strip_variants(txt_strip *s, int blocks, int variants, uint32_t by) {
    int v[4][TXT_STRIP / 2 + 1];
    for (int i = 0; i < blocks; i++) {
        int of[4];
        txt_block_variants(txt_at(s->block[i], 3, by), txt_at(s->block[i], 4, by), variants, of);
        for (int k = 0; k < 4; k++) v[k][i] = of[k];
    }
    for (int i = 0; i < blocks; i++) {
        s->variant[0][2 * i] = v[0][i];
        s->variant[0][2 * i + 1] = v[1][i];
        s->variant[1][2 * i] = v[2][i];
        s->variant[1][2 * i + 1] = v[3][i];
    }
}

/* Fill count <= TXT_STRIP columns of a window; a row of tiles is `width` numbers long. */
static void txt_fill_strip(const textiles_plane *p, uint32_t x, uint32_t y, int count, int width,
                           int height, int *tiles) {
    txt_strip s;
    const int c = p->colors, v = p->variants, corner = p->kind == TEXTILES_CORNER;
    const uint32_t what = corner ? 2u : 0u, odd = x & 1;
    const int blocks = (count + (int)odd + 1) / 2, sides = corner ? count + 1 : count;
    for (int i = 0; i <= count; i++) s.column[i] = txt_column(p->seed, x + (uint32_t)i);
    for (int i = 0; i < blocks; i++) s.block[i] = txt_column(p->seed, (x + 2 * (uint32_t)i) >> 1);
    memset(s.variant, 0, sizeof s.variant);
    txt_strip_colors(s.column, sides, what, y, c, s.lower);
    for (int row = 0; row < height; row++, y++, tiles += width) {
        memcpy(s.upper, s.lower, (size_t)sides * sizeof s.upper[0]);
        txt_strip_colors(s.column, sides, what, y + 1, c, s.lower);
        if (v > 1 && (row == 0 || (y & 1) == 0)) txt_strip_variants(&s, blocks, v, y >> 1);
        const int *variant = s.variant[y & 1] + odd;
        if (corner) {
            for (int i = 0; i < count; i++) {
                const int code =
                    ((s.upper[i] * c + s.upper[i + 1]) * c + s.lower[i + 1]) * c + s.lower[i];
                tiles[i] = code * v + variant[i];
            }
        } else {
            txt_strip_colors(s.column, count + 1, 1, y, c, s.west);
            for (int i = 0; i < count; i++) {
                const int code =
                    ((s.upper[i] * c + s.west[i + 1]) * c + s.lower[i]) * c + s.west[i];
                tiles[i] = code * v + variant[i];
            }
        }
    }
}

/* ---- public: the plane ------------------------------------------------------------------ */

TEXTILES_API txm_status textiles_plane_make(const textiles_set *set, uint32_t seed, txm_env *env,
                                            textiles_plane *plane) {
    if (!set || !plane) return txm_fail(env, TXM_BAD_ARGUMENT, "set or plane is NULL");
    if (set->kind == TEXTILES_FRAME)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "a frame set lacks combinations of colors that the plane needs; use "
                        "textiles_solve");
    if (!set->complete)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "a reduced wang set lacks combinations of colors that the plane needs; "
                        "make the set without reduced, or use textiles_scanline");
    plane->kind = set->kind;
    plane->colors = set->colors;
    plane->variants = set->variants;
    plane->seed = seed;
    plane->table = set->kind == TEXTILES_TRIANGLE ? set->lookup : NULL;
    return TXM_OK;
}

TEXTILES_API int textiles_plane_tile(const textiles_plane *plane, int x, int y) {
    const uint32_t u = (uint32_t)x, v = (uint32_t)y;
    const uint32_t here = txt_column(plane->seed, u), next = txt_column(plane->seed, u + 1);
    const int c = plane->colors;
    int code;
    if (plane->kind == TEXTILES_TRIANGLE) return -1;
    if (plane->kind == TEXTILES_CORNER) {
        code = txt_below(txt_at(here, 2, v), c);
        code = code * c + txt_below(txt_at(next, 2, v), c);
        code = code * c + txt_below(txt_at(next, 2, v + 1), c);
        code = code * c + txt_below(txt_at(here, 2, v + 1), c);
    } else {
        code = txt_below(txt_at(here, 0, v), c);
        code = code * c + txt_below(txt_at(next, 1, v), c);
        code = code * c + txt_below(txt_at(here, 0, v + 1), c);
        code = code * c + txt_below(txt_at(here, 1, v), c);
    }
    return code * plane->variants + txt_square_variant(plane->seed, plane->variants, u, v);
}

TEXTILES_API void textiles_plane_fill(const textiles_plane *plane, int x, int y, int width,
                                      int height, int *tiles) {
    if (width < 1 || height < 1) return;
    if (plane->kind == TEXTILES_TRIANGLE) {
        for (size_t i = 0; i < (size_t)width * (size_t)height; i++) tiles[i] = -1;
        return;
    }
    for (int left = 0; left < width; left += TXT_STRIP) {
        const int count = width - left < TXT_STRIP ? width - left : TXT_STRIP;
        txt_fill_strip(plane, (uint32_t)x + (uint32_t)left, (uint32_t)y, count, width, height,
                       tiles + left);
        if (count < TXT_STRIP) break; /* left + TXT_STRIP might overflow */
    }
}

/* The hashes of lattice points (a, b) of triangles, coordinates again modulo 2^32:

       what 7    the rank of the point. Edges run from the lower to the higher rank, of equal ranks
                 (2^-32 of all) from the lower to the higher a, of equal a from the lower b. As ranks
                 are an order, the three edges of a triangle never have the same direction: a reduced
                 set will do
       what 8    the colour of the edge (a, b) - (a+1, b)
       what 9    the colour of the edge (a, b) - (a, b+1)
       what 10   the colour of the edge (a+1, b) - (a, b+1)
       what 11   the variants: an even one for half 0 from the upper 16 bits, an odd one for half 1
                 from the lower. All neighbours of a half 0 are halves 1, so neighbours differ */
TEXTILES_API int textiles_plane_triangle(const textiles_plane *plane, int a, int b, int half,
                                         int *rotation) {
    const uint32_t u = (uint32_t)a, v = (uint32_t)b, one = half != 0;
    const uint32_t here = txt_column(plane->seed, u), next = txt_column(plane->seed, u + 1);
    if (rotation) *rotation = 0;
    if (!plane->table) return -1;
    /* corners in their order: (a, b), (a, b+1), (a+1, b) or (a+1, b+1), (a+1, b), (a, b+1) */
    const uint32_t at[3] = {u + one, u + one, u + 1 - one}; /* a of the corners */
    const uint32_t bt[3] = {v + one, v + 1 - one, v + one};
    const uint32_t rank[3] = {txt_at(one ? next : here, 7, bt[0]),
                              txt_at(one ? next : here, 7, bt[1]),
                              txt_at(one ? here : next, 7, bt[2])};
    const uint32_t hash[3] = {txt_at(one ? next : here, 9, v), txt_at(here, 10, v),
                              txt_at(here, 8, v + one)};
    const int symbols = 2 * plane->colors;
    int code = 0;
    for (int k = 0; k < 3; k++) {
        const int n = k == 2 ? 0 : k + 1;
        int against = rank[k] > rank[n];
        if (rank[k] == rank[n]) against = at[k] > at[n] || (at[k] == at[n] && bt[k] > bt[n]);
        code = code * symbols + 2 * txt_below(hash[k], plane->colors) + against;
    }
    const int32_t entry = plane->table[code];
    int variant = 0;
    if (plane->variants > 1) {
        const uint32_t h = txt_at(here, 11, v);
        variant = one ? 2 * txt_lower(h, plane->variants / 2) + 1
                      : 2 * txt_upper(h, (plane->variants + 1) / 2);
    }
    if (rotation) *rotation = (int)(entry & 3);
    return (int)(entry / 4) + variant;
}

TEXTILES_API const int32_t *textiles_plane_table(const textiles_plane *plane, int *count) {
    if (count) *count = plane->table ? 8 * plane->colors * plane->colors * plane->colors : 0;
    return plane->table;
}

/* ---- grids: scan-line order ------------------------------------------------------------- */

/* The tiles (first variants only) that match the cells above and to the left. A key has a digit for
   each colour that must agree, 0..colors-1 or colors for "any": north and west; of corner tiles nw,
   ne and sw. There are at most 256 such tiles, each listed under 4 or 8 keys. */
enum { TXT_KEYS = 5 * 5 * 5, TXT_MAX_BASES = 256 };

typedef struct txt_choice {
    int first[TXT_KEYS + 1]; /* bases[first[key]] .. bases[first[key + 1] - 1] */
    uint8_t bases[8 * TXT_MAX_BASES];
} txt_choice;

static int txt_choice_key(const textiles_set *s, int nw_or_north, int ne, int sw_or_west) {
    const int n = s->colors + 1;
    return s->kind == TEXTILES_CORNER ? (nw_or_north * n + ne) * n + sw_or_west
                                      : nw_or_north * n + sw_or_west;
}

static void txt_choice_make(const textiles_set *s, txt_choice *choice) {
    int next[TXT_KEYS + 1];
    const int corner = s->kind == TEXTILES_CORNER, any = s->colors;
    memset(choice->first, 0, sizeof choice->first);
    for (int pass = 0; pass < 2; pass++) { /* count, then list in the order of the tiles */
        memcpy(next, choice->first, sizeof next);
        for (int base = 0; base < s->count / s->variants; base++) {
            const int *e = s->tiles[base * s->variants].edges;
            for (int mask = 0; mask < 8; mask++) { /* which of the digits are "any" */
                if (!corner && mask & 2) continue;
                const int key = txt_choice_key(s, mask & 1 ? any : e[0], mask & 2 ? any : e[1],
                                               mask & 4 ? any : e[3]);
                if (pass == 0) choice->first[key + 1]++;
                else choice->bases[next[key]++] = (uint8_t)base;
            }
        }
        for (int key = 0; key < TXT_KEYS && pass == 0; key++)
            choice->first[key + 1] += choice->first[key];
    }
}

/* Is there a tile for each pair of colours that the cells above and to the left can have? */
static txm_status txt_choice_check(const textiles_set *s, const txt_choice *choice, int width,
                                   int height, txm_env *env) {
    int south = 0, east = 0; /* sets of colours */
    for (int t = 0; t < s->count; t++) {
        south |= 1 << s->tiles[t].edges[2];
        east |= 1 << s->tiles[t].edges[1];
    }
    for (int n = 0; n < s->colors && s->kind != TEXTILES_CORNER; n++) { /* corner sets are complete */
        for (int w = 0; w < s->colors; w++) {
            if (!(south >> n & 1) || !(east >> w & 1)) continue;
            const int key = txt_choice_key(s, height > 1 ? n : s->colors, 0, width > 1 ? w : s->colors);
            if (choice->first[key] < choice->first[key + 1]) continue;
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                    "a dead end: no tile has north color # and west color #; add "
                                    "such a class, or use textiles_solve",
                                    (uint64_t)n, (uint64_t)w);
        }
    }
    return TXM_OK;
}

/* One of the tiles under a key, if possible neither `row` nor `column`, which would be the third
   equal one in a row or column (-1: nothing to avoid). */
static int txt_choose(const textiles_set *s, const txt_choice *choice, int key, int row, int column,
                      txm_rng *rng) {
    const uint8_t *bases = choice->bases + choice->first[key];
    const int n = (choice->first[key + 1] - choice->first[key]) * s->variants;
    int allowed = n;
    if (row >= 0 || column >= 0) {
        for (int i = 0; i < n; i++) {
            const int t = bases[i / s->variants] * s->variants + i % s->variants;
            allowed -= t == row || t == column;
        }
    }
    if (allowed == 0 || allowed == n) {
        const int i = (int)txm_rng_below(rng, (uint32_t)n);
        return bases[i / s->variants] * s->variants + i % s->variants;
    }
    int left = (int)txm_rng_below(rng, (uint32_t)allowed);
    for (int i = 0;; i++) {
        const int t = bases[i / s->variants] * s->variants + i % s->variants;
        if (t != row && t != column && left-- == 0) return t;
    }
}

/* the checks that textiles_scanline and textiles_solve have in common */
static txm_status txt_check_grid(const textiles_set *set, int width, int height, const int *tiles,
                                 txm_env *env) {
    size_t bytes;
    if (!set || !tiles) return txm_fail(env, TXM_BAD_ARGUMENT, "set or tiles is NULL");
    if (set->kind == TEXTILES_TRIANGLE)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "triangles have no grid of squares; use textiles_plane_make or "
                        "textiles_assign_triangles");
    if (width < 1 || height < 1)
        return txm_fail(env, TXM_BAD_ARGUMENT, "width and height must be 1 or more");
    if (!txm_mul((size_t)width, (size_t)height, sizeof(int), &bytes))
        return txm_fail(env, TXM_TOO_LARGE, "width * height exceeds what memory can hold");
    return TXM_OK;
}

TEXTILES_API txm_status textiles_scanline(const textiles_set *set, int width, int height,
                                          uint64_t seed, txm_env *env, int *tiles) {
    txt_choice choice;
    txm_status status = txt_check_grid(set, width, height, tiles, env);
    if (status != TXM_OK) return status;
    txt_choice_make(set, &choice);
    status = txt_choice_check(set, &choice, width, height, env);
    if (status != TXM_OK) return status;

    txm_rng rng = txm_rng_make(seed, 40); /* streams: 40 here, 41 in textiles_solve */
    const int any = set->colors, corner = set->kind == TEXTILES_CORNER;
    const ptrdiff_t up = width;
    int *t = tiles;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++, t++) {
            const int *left = x ? set->tiles[t[-1]].edges : NULL;
            const int *above = y ? set->tiles[t[-up]].edges : NULL;
            int first = above ? above[2] : any, west = left ? left[1] : any, ne = any;
            if (corner) {
                ne = first;
                first = left ? left[1] : above ? above[3] : any;
                west = left ? left[2] : any;
            }
            const int row = x > 1 && t[-1] == t[-2] ? t[-1] : -1;
            const int column = y > 1 && t[-up] == t[-2 * up] ? t[-up] : -1;
            *t = txt_choose(set, &choice, txt_choice_key(set, first, ne, west), row, column, &rng);
        }
    }
    return TXM_OK;
}

/* ---- grids: tiling under constraints ---------------------------------------------------- */

/* The unknowns are the slots between the cells: horizontal edges, then vertical edges; of corner
   sets the corners. Each has a set of colours it may still take. In a complete set every
   combination has a tile, so that the given tiles decide some slots and the rest is drawn at
   random, in one pass.

   With reduced wang sets and frame sets (at most 64 tiles, variants not counted) there is a search.
   The domain of a cell is the set of tiles that its four slots allow; a slot keeps the colours that
   occur in the domains on both sides; this is propagated until nothing changes [AC-3, Mackworth
   1977]. Cells are decided in scan-line order, with propagation after each; on failure the latest
   decision is undone. After too many failures without progress the search restarts with other
   random numbers. */
enum {
    TXT_ATTEMPTS = 64,         /* ours: restarts                                              */
    TXT_FAILURES = 1000,       /* ours: failures without getting any further, and 8 a column  */
    TXT_REDRAWS = 8,           /* ours: draws to avoid three equal tiles in a row              */
    TXT_SLOTS = 1 << 28,       /* a trail entry is slot * 16 + colours, in 32 bits             */
    TXT_REPORT_CELLS = 1 << 14 /* cells done from one report to the next                       */
};

typedef struct txt_decision {
    uint64_t untried; /* tiles left to try at this cell          */
    uint32_t cell;
    uint32_t scan;    /* all cells before this one are decided   */
    uint32_t mark;    /* length of the trail before the decision */
} txt_decision;

typedef struct txt_solver {
    const textiles_set *set;
    txm_env *env;
    int width, height, periodic;
    uint32_t cells, slots;
    uint8_t *colors; /* by slot: set of colours                                       */
    int *tiles;      /* by cell: the given tile or the result, -1 = none yet          */
    /* for the search only */
    uint64_t having[4][TEXTILES_MAX_COLORS]; /* tiles that show this colour there        */
    uint64_t allowing[4][1 << TEXTILES_MAX_COLORS]; /* tiles that show one of these colours */
    uint64_t all;                            /* all tiles; with a period of 1 those that
                                                match themselves                         */
    uint32_t *trail, trail_length;           /* changed slots with their colours before  */
    uint32_t *queue, queue_length;           /* cells to look at again                   */
    uint8_t *queued;                         /* by cell                                  */
    txt_decision *decisions;
    uint32_t failed_at;                      /* the cell whose domain became empty       */
    uint32_t steps;                          /* since the last report                    */
    float fraction;                          /* reported last                            */
    int cancelled;
} txt_solver;

/* Slots of a cell in the order of a tile's edges. */
static void txt_cell_slots(const txt_solver *s, uint32_t cell, uint32_t slot[4]) {
    const uint32_t w = (uint32_t)s->width, h = (uint32_t)s->height, x = cell % w, y = cell / w;
    const uint32_t right = s->periodic && x + 1 == w ? 0 : x + 1;
    const uint32_t below = s->periodic && y + 1 == h ? 0 : y + 1;
    const uint32_t columns = s->periodic ? w : w + 1, rows = s->periodic ? h : h + 1;
    if (s->set->kind == TEXTILES_CORNER) {
        slot[0] = y * columns + x;
        slot[1] = y * columns + right;
        slot[2] = below * columns + right;
        slot[3] = below * columns + x;
    } else {
        slot[0] = y * w + x;
        slot[1] = rows * w + y * columns + right;
        slot[2] = below * w + x;
        slot[3] = rows * w + y * columns + x;
    }
}

/* Report progress now and then; the fraction never falls. */
static int txt_solver_report(txt_solver *s, uint32_t steps, float fraction) {
    s->steps += steps;
    if (s->cancelled || s->steps < TXT_REPORT_CELLS) return s->cancelled;
    s->steps = 0;
    if (fraction > s->fraction) s->fraction = fraction;
    s->cancelled = txm_progress(s->env, s->fraction, "tiling") != 0;
    return s->cancelled;
}

static int txt_bit_count(uint64_t bits) {
    int n = 0;
    for (; bits; bits &= bits - 1) n++;
    return n;
}

/* one of the bits that are set, at random */
static int txt_random_bit(uint64_t bits, txm_rng *rng) {
    uint32_t left = txm_rng_below(rng, (uint32_t)txt_bit_count(bits));
    for (; left; left--) bits &= bits - 1;
    return txm_lowest_bit(bits);
}

static uint64_t txt_domain(const txt_solver *s, const uint32_t slot[4]) {
    uint64_t domain = s->all;
    for (int k = 0; k < 4; k++) domain &= s->allowing[k][s->colors[slot[k]]];
    return domain;
}

/* the tile of a cell that is decided */
static int txt_decided_base(const txt_solver *s, uint32_t cell) {
    uint32_t slot[4];
    txt_cell_slots(s, cell, slot);
    return txm_lowest_bit(txt_domain(s, slot));
}

static void txt_enqueue(txt_solver *s, uint32_t cell) {
    if (s->queued[cell]) return;
    s->queued[cell] = 1;
    TXM_ASSERT(s->queue_length < s->cells);
    s->queue[s->queue_length++] = cell;
}

/* Reduce the slots of a cell to the colours of the tiles of a domain; enqueue the neighbours at
   slots that change. */
static void txt_narrow(txt_solver *s, uint32_t cell, const uint32_t slot[4], uint64_t domain) {
    const uint32_t w = (uint32_t)s->width, x = cell % w, last = s->cells - w;
    for (int k = 0; k < 4; k++) {
        const uint8_t before = s->colors[slot[k]];
        uint8_t after = 0;
        for (int c = 0; c < s->set->colors; c++) {
            if (domain & s->having[k][c]) after = (uint8_t)(after | 1 << c);
        }
        if (after == before) continue;
        TXM_ASSERT(s->trail_length < 3 * s->slots);
        s->trail[s->trail_length++] = slot[k] * 16 + before;
        s->colors[slot[k]] = after;
        if (k == 0 && (cell >= w || s->periodic)) txt_enqueue(s, cell >= w ? cell - w : cell + last);
        if (k == 1 && (x + 1 < w || s->periodic)) txt_enqueue(s, x + 1 < w ? cell + 1 : cell - x);
        if (k == 2 && (cell < last || s->periodic))
            txt_enqueue(s, cell < last ? cell + w : cell - last);
        if (k == 3 && (x || s->periodic)) txt_enqueue(s, x ? cell - 1 : cell + w - 1);
    }
}

/* Process the queue; 0 if a cell has no tile left (failed_at), or when cancelled. */
static int txt_propagate(txt_solver *s) {
    while (s->queue_length) {
        uint32_t slot[4];
        const uint32_t cell = s->queue[--s->queue_length];
        s->queued[cell] = 0;
        txt_cell_slots(s, cell, slot);
        const uint64_t domain = txt_domain(s, slot);
        if (domain) txt_narrow(s, cell, slot, domain);
        else s->failed_at = cell;
        if (!domain || txt_solver_report(s, 1, 0)) {
            while (s->queue_length) s->queued[s->queue[--s->queue_length]] = 0;
            return 0;
        }
    }
    return 1;
}

static int txt_decide(txt_solver *s, uint32_t cell, int base) {
    uint32_t slot[4];
    txt_cell_slots(s, cell, slot);
    txt_narrow(s, cell, slot, (uint64_t)1 << base);
    return txt_propagate(s);
}

static void txt_undo(txt_solver *s, uint32_t mark) {
    while (s->trail_length > mark) {
        const uint32_t entry = s->trail[--s->trail_length];
        s->colors[entry / 16] = (uint8_t)(entry % 16);
    }
}

/* A random tile of the domain of a cell; without variants not the third equal one in a row or
   column, if the domain has another. */
static int txt_draw_base(const txt_solver *s, uint32_t cell, uint64_t domain, txm_rng *rng) {
    const uint32_t w = (uint32_t)s->width;
    uint64_t good = domain;
    if (s->set->variants == 1 && cell % w > 1) {
        const int base = txt_decided_base(s, cell - 1);
        if (base == txt_decided_base(s, cell - 2)) good &= ~((uint64_t)1 << base);
    }
    if (s->set->variants == 1 && cell / w > 1) {
        const int base = txt_decided_base(s, cell - w);
        if (base == txt_decided_base(s, cell - 2 * w)) good &= ~((uint64_t)1 << base);
    }
    return txt_random_bit(good ? good : domain, rng);
}

/* One attempt. 1 = every cell is decided, 0 = too many failures or cancelled, -1 = all
   possibilities were tried, there is no tiling.

   After a failure the cell without a tile is decided first at each level that the search returns
   to, until that succeeds: the cause is often a decision a row earlier, and all combinations of the
   cells between would be tried in vain ["last conflict", Lecoutre 2009]. */
static int txt_attempt(txt_solver *s, txm_rng *rng) {
    const uint32_t most = TXT_FAILURES + 8 * (uint32_t)s->width;
    uint32_t depth = 0, failures = 0, scan = 0, furthest = 0, urgent = s->cells;
    while (scan < s->cells) {
        uint32_t slot[4];
        const uint32_t cell = urgent < s->cells ? urgent : scan;
        if (txt_solver_report(s, 1, 0.9f * (float)scan / (float)s->cells)) return 0;
        urgent = s->cells;
        txt_cell_slots(s, cell, slot);
        const uint64_t domain = txt_domain(s, slot);
        if (!(domain & (domain - 1))) { /* one tile left: the slots show it */
            scan += cell == scan;
            continue;
        }
        if (scan > furthest) {
            furthest = scan;
            failures = 0;
        }
        TXM_ASSERT(depth < s->cells);
        txt_decision *d = &s->decisions[depth++];
        int base = txt_draw_base(s, cell, domain, rng);
        d->cell = cell;
        d->scan = scan;
        d->mark = s->trail_length;
        d->untried = domain & ~((uint64_t)1 << base);
        while (!txt_decide(s, d->cell, base)) {
            if (s->cancelled || failures++ == most) return 0;
            for (; !d->untried; d--) {
                if (urgent == s->cells) urgent = d->cell;
                if (--depth == 0) return -1;
            }
            txt_undo(s, d->mark);
            scan = d->scan;
            base = txt_random_bit(d->untried, rng);
            d->untried &= ~((uint64_t)1 << base);
        }
    }
    return 1;
}

/* Enter the given tiles. 0: two of them disagree at the cell failed_at, or cancelled. */
static int txt_enter_given(txt_solver *s) {
    for (uint32_t cell = 0; cell < s->cells; cell++) {
        uint32_t slot[4];
        if (txt_solver_report(s, 1, 0)) return 0;
        if (s->tiles[cell] < 0) continue;
        const int *e = s->set->tiles[s->tiles[cell]].edges;
        txt_cell_slots(s, cell, slot);
        for (int k = 0; k < 4; k++) {
            s->colors[slot[k]] = (uint8_t)(s->colors[slot[k]] & 1 << e[k]);
            if (s->colors[slot[k]]) continue;
            s->failed_at = cell;
            return 0;
        }
    }
    return 1;
}

static txm_status txt_contradiction(txt_solver *s) {
    if (s->cancelled) return txt_cancelled(s->env);
    return txm_fail_numbers(s->env, TXM_BAD_ARGUMENT,
                            "tiles: those given near column #, row # contradict each other",
                            s->failed_at % (uint32_t)s->width, s->failed_at / (uint32_t)s->width);
}

/* Reduced wang and frame sets: fill in the numbers of tiles, variant 0, where none is given. */
static txm_status txt_search_tiles(txt_solver *s, txm_arena *arena, txm_rng *rng) {
    const textiles_set *set = s->set;
    s->trail = (uint32_t *)txm_arena_alloc(arena, s->slots, 3 * sizeof(uint32_t));
    s->queue = (uint32_t *)txm_arena_alloc(arena, s->cells, sizeof(uint32_t));
    s->queued = (uint8_t *)txm_arena_zero(arena, s->cells, 1);
    s->decisions = (txt_decision *)txm_arena_alloc(arena, s->cells, sizeof(txt_decision));
    if (arena->failed)
        return txm_fail(s->env, TXM_OUT_OF_MEMORY, "no memory to solve a grid of this size");
    for (int base = 0; base < set->count / set->variants; base++) {
        const int *e = set->tiles[base * set->variants].edges;
        const uint64_t bit = (uint64_t)1 << base;
        for (int k = 0; k < 4; k++) s->having[k][e[k]] |= bit;
        if (s->periodic && s->width == 1 && e[1] != e[3]) continue; /* lies beside itself */
        if (s->periodic && s->height == 1 && e[0] != e[2]) continue;
        s->all |= bit;
    }
    for (int k = 0; k < 4; k++) {
        for (int i = 0; i < 1 << set->colors; i++) {
            for (int c = 0; c < set->colors; c++)
                if (i >> c & 1) s->allowing[k][i] |= s->having[k][c];
        }
    }

    /* first without the given tiles: is it the set that has no such tiling? */
    for (int with_given = 0; with_given < 2; with_given++) {
        if (with_given && !txt_enter_given(s)) return txt_contradiction(s);
        for (uint32_t cell = s->cells; cell-- > 0;) txt_enqueue(s, cell);
        if (txt_propagate(s)) {
            s->trail_length = 0; /* never to be undone */
        } else {
            if (with_given || s->cancelled) return txt_contradiction(s);
            return txm_fail(s->env, TXM_BAD_DATA, "the set has no tiling of this size");
        }
    }
    int found = 0;
    for (int attempt = 0; attempt < TXT_ATTEMPTS && !found; attempt++) {
        txt_undo(s, 0);
        found = txt_attempt(s, rng);
        if (s->cancelled) return txt_cancelled(s->env);
    }
    if (found < 0) return txm_fail(s->env, TXM_BAD_DATA, "no tiling has the given tiles");
    if (!found)
        return txm_fail(s->env, TXM_BAD_DATA,
                        "no tiling found in 64 attempts; another seed or fewer given tiles may "
                        "help");
    for (uint32_t cell = 0; cell < s->cells; cell++) {
        if (s->tiles[cell] < 0) s->tiles[cell] = txt_decided_base(s, cell) * set->variants;
    }
    return TXM_OK;
}

/* Complete sets: draw the cells that are not given. Without variants a tile that would be the third
   equal one in a row is drawn again a few times. */
static txm_status txt_draw_tiles(txt_solver *s, txm_rng *rng) {
    const uint32_t w = (uint32_t)s->width;
    const int n = s->set->colors, v = s->set->variants, all = (1 << n) - 1;
    if (!txt_enter_given(s)) return txt_contradiction(s);
    for (uint32_t cell = 0; cell < s->cells; cell++) {
        uint32_t slot[4];
        int *t = s->tiles + cell, color[4], row = -1, column = -1;
        if (txt_solver_report(s, 1, 0.9f * (float)cell / (float)s->cells))
            return txt_cancelled(s->env);
        if (*t >= 0) continue;
        txt_cell_slots(s, cell, slot);
        if (v == 1 && cell % w > 1 && t[-1] == t[-2]) row = t[-1];
        if (v == 1 && cell / w > 1 && s->tiles[cell - w] == s->tiles[cell - 2 * w])
            column = s->tiles[cell - w];
        for (int draw = 0; draw < TXT_REDRAWS; draw++) {
            int code = 0;
            for (int k = 0; k < 4; k++) {
                const int set = s->colors[slot[k]]; /* one colour or all */
                color[k] = set == all ? (int)txm_rng_below(rng, (uint32_t)n)
                                      : txm_lowest_bit((uint64_t)set);
                for (int j = 0; j < k; j++) /* in a period of 1 a slot has two sides */
                    if (slot[j] == slot[k]) color[k] = color[j];
                code = code * n + color[k];
            }
            *t = s->set->lookup[code] / 4;
            if (*t != row && *t != column) break;
        }
        for (int k = 0; k < 4; k++) s->colors[slot[k]] = (uint8_t)(1 << color[k]);
    }
    return TXM_OK;
}

/* How many runs of three equal tiles, across and down, contain this cell. */
static int txt_runs(const txt_solver *s, int x, int y) {
    const int at[2] = {x, y}, length[2] = {s->width, s->height};
    const int tile = s->tiles[(size_t)y * (size_t)s->width + (size_t)x];
    int runs = 0;
    for (int axis = 0; axis < 2; axis++) {
        int equal = 0; /* length of the run so far */
        if (length[axis] == 1) continue;
        for (int d = -2; d <= 2; d++) {
            int p[2] = {x, y};
            p[axis] = at[axis] + d;
            if (s->periodic) p[axis] = (p[axis] + 2 * length[axis]) % length[axis];
            const int inside = p[axis] >= 0 && p[axis] < length[axis];
            equal = inside && s->tiles[(size_t)p[1] * (size_t)s->width + (size_t)p[0]] == tile
                        ? equal + 1
                        : 0;
            runs += equal >= 3;
        }
    }
    return runs;
}

/* Choose the variants of cells that are not given: first those of the plane, which have no three
   equal tiles in a row; then, since given tiles and the period may break that, the best for each
   cell. */
static txm_status txt_choose_variants(txt_solver *s, const uint8_t *given, uint32_t seed) {
    const int variants = s->set->variants;
    for (int pass = 0; pass < 4 && variants > 1; pass++) {
        int changed = 0;
        uint32_t cell = 0;
        for (int y = 0; y < s->height; y++) {
            if (txt_solver_report(s, (uint32_t)s->width, 0.9f)) return txt_cancelled(s->env);
            for (int x = 0; x < s->width; x++, cell++) {
                int *t = s->tiles + cell;
                if (given[cell]) continue;
                if (pass == 0) {
                    *t += txt_square_variant(seed, variants, (uint32_t)x, (uint32_t)y);
                    continue;
                }
                int least = txt_runs(s, x, y), best = *t;
                const int old = *t, base = old - old % variants;
                for (int v = 1; v < variants && least; v++) {
                    *t = base + (old + v) % variants;
                    const int runs = txt_runs(s, x, y);
                    if (runs < least) {
                        least = runs;
                        best = *t;
                    }
                }
                *t = best;
                changed |= best != old;
            }
        }
        if (pass && !changed) break;
    }
    return TXM_OK;
}

TEXTILES_API txm_status textiles_solve(const textiles_set *set, int width, int height, int periodic,
                                       uint64_t seed, txm_env *env, int *tiles) {
    txt_solver s;
    txm_arena arena;
    txm_status status = txt_check_grid(set, width, height, tiles, env);
    if (status != TXM_OK) return status;
    if (((uint64_t)width + 1) * ((uint64_t)height + 1) > TXT_SLOTS / 2)
        return txm_fail(env, TXM_TOO_LARGE, "width * height must stay below 2^27; solve it in parts");
    const uint32_t w = (uint32_t)width, h = (uint32_t)height;
    for (uint32_t i = 0; i < w * h; i++) {
        if (tiles[i] < -1 || tiles[i] >= set->count)
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                    "tiles: the one at column #, row # is neither -1 nor a tile's "
                                    "number",
                                    i % w, i / w);
    }
    if (txm_progress(env, 0, "tiling")) return txt_cancelled(env);

    memset(&s, 0, sizeof s);
    s.set = set;
    s.env = env;
    s.width = width;
    s.height = height;
    s.periodic = periodic != 0;
    s.cells = w * h;
    s.slots = set->kind == TEXTILES_CORNER ? (w + 1) * (h + 1) : 2 * w * h + w + h;
    txm_arena_init(&arena, env);
    s.colors = (uint8_t *)txm_arena_alloc(&arena, s.slots, 1);
    s.tiles = (int *)txm_arena_alloc(&arena, s.cells, sizeof(int));
    uint8_t *given = (uint8_t *)txm_arena_alloc(&arena, s.cells, 1);
    if (arena.failed) {
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to solve a grid of this size");
        goto done;
    }
    memset(s.colors, (1 << set->colors) - 1, s.slots);
    memcpy(s.tiles, tiles, s.cells * sizeof(int));
    for (uint32_t i = 0; i < s.cells; i++) given[i] = tiles[i] >= 0;

    {
        txm_rng rng = txm_rng_make(seed, 41);
        status = set->complete ? txt_draw_tiles(&s, &rng) : txt_search_tiles(&s, &arena, &rng);
        if (status == TXM_OK) status = txt_choose_variants(&s, given, txm_rng_next(&rng));
    }
    if (status == TXM_OK && txm_progress(env, 1, "tiling")) status = txt_cancelled(env);
    if (status == TXM_OK) memcpy(tiles, s.tiles, s.cells * sizeof(int));

done:
    txm_arena_free(&arena);
    return status;
}

/* ---- meshes: edges and their colours ---------------------------------------------------- */

enum {
    TXT_RING = 16,         /* ours: faces at an edge that are looked at; keeps soups linear */
    TXT_PASSES = 32,       /* ours: over the faces to separate equal neighbours             */
    TXT_REPORT_FACES = 1 << 14
};

/* Side k of face f runs from its corner k to the next and has the number f * corners + k. The sides
   at one edge, that is with the same two vertices, form a ring by `next`, and have one colour. */
typedef struct txt_cover {
    const textiles_set *set;
    txm_env *env;
    txm_arena arena;
    txm_mesh mesh;
    uint64_t seed;
    uint32_t faces, corners, sides; /* of the mesh; corners: 3 or 4 a face    */
    uint32_t *next;                 /* by side                                */
    uint8_t *color;                 /* by side                                */
    int32_t *tile;                  /* by face; -1 = none yet                 */
} txt_cover;

/* the tile (variant 0) * 4 + rotation for the colours of a face, or -1 */
static int32_t txt_face_entry(const txt_cover *c, uint32_t face) {
    const textiles_set *s = c->set;
    const uint32_t first = face * c->corners;
    int code = 0;
    if (c->corners == 4) { /* west, south, east, north; the code begins with north */
        for (int k = 3; k >= 0; k--) code = code * s->colors + c->color[first + (uint32_t)k];
        return s->lookup[code];
    }
    for (uint32_t side = first; side < first + 3; side++)
        code = code * s->symbols + 2 * c->color[side] + txm_mesh_runs_down(&c->mesh, side);
    return s->lookup[code];
}

/* How many neighbours of a face show the tile. */
static int txt_equal_neighbors(const txt_cover *c, uint32_t face, int32_t tile) {
    int equal = 0;
    for (uint32_t k = 0; k < c->corners; k++) {
        const uint32_t side = face * c->corners + k;
        uint32_t other = c->next[side];
        for (int i = 0; i < TXT_RING && other != side; i++, other = c->next[other]) {
            const uint32_t f = other / c->corners;
            equal += f != face && c->tile[f] == tile;
        }
    }
    return equal;
}

/* Give a face the tile of its colours in the variant that the fewest neighbours show, of equally
   good ones the first from a random variant on. Returns how many neighbours show it. */
static int txt_choose_tile(txt_cover *c, uint32_t face) {
    const int variants = c->set->variants;
    const int32_t base = txt_face_entry(c, face) / 4;
    const uint64_t h = txm_hash(txm_hash(c->seed + 1) + face) >> 32;
    const int first = (int)(h * (uint64_t)variants >> 32);
    int32_t best = base;
    int least = -1;
    for (int i = 0; i < variants && least != 0; i++) {
        const int32_t tile = base + (first + i) % variants;
        const int equal = txt_equal_neighbors(c, face, tile);
        if (least >= 0 && equal >= least) continue;
        least = equal;
        best = tile;
    }
    c->tile[face] = best;
    return least;
}

/* Color the edge of a side, choose tiles for the faces there, and count their equal neighbours. */
static int txt_try_color(txt_cover *c, uint32_t side, uint8_t color, const uint32_t *faces, int count) {
    uint32_t other = side;
    int equal = 0;
    do {
        c->color[other] = color;
        other = c->next[other];
    } while (other != side);
    for (int i = 0; i < count; i++) c->tile[faces[i]] = -1;
    for (int i = 0; i < count; i++) txt_choose_tile(c, faces[i]);
    for (int i = 0; i < count; i++) equal += txt_equal_neighbors(c, faces[i], c->tile[faces[i]]);
    return equal;
}

/* Give an edge the colour with which its faces have the fewest equal neighbours. If no colour is
   better, an equally good one is taken when bit 0 of coin is set, to leave local minima. */
static void txt_recolor(txt_cover *c, uint32_t side, uint32_t coin) {
    const int colors = c->set->colors;
    const uint8_t old = c->color[side];
    uint32_t faces[TXT_RING], other = side;
    int32_t tiles[TXT_RING];
    int count = 0, least = 0;
    do { /* each face once */
        const uint32_t f = other / c->corners;
        int known = 0;
        for (int i = 0; i < count; i++) known |= faces[i] == f;
        if (!known && count == TXT_RING) return;
        if (!known) faces[count++] = f;
        other = c->next[other];
    } while (other != side);
    for (int i = 0; i < count; i++) {
        tiles[i] = c->tile[faces[i]];
        least += txt_equal_neighbors(c, faces[i], tiles[i]);
    }
    uint8_t best = old;
    for (int i = 0; i < colors; i++) {
        const uint8_t color = (uint8_t)((old + 1 + i) % colors);
        const int equal = txt_try_color(c, side, color, faces, count);
        if (equal > least || (equal == least && (best != old || color == old || !(coin & 1)))) continue;
        least = equal;
        best = color;
    }
    txt_try_color(c, side, best, faces, count);
    if (best == old) {
        int equal = 0;
        for (int i = 0; i < count; i++) equal += txt_equal_neighbors(c, faces[i], c->tile[faces[i]]);
        if (equal <= least) return;
        for (int i = 0; i < count; i++) c->tile[faces[i]] = tiles[i]; /* no better: restore */
    }
}

/* Choose all tiles, then separate equal neighbours by other variants and, where edges may be
   recoloured, by other colours. 0 when cancelled. */
static int txt_choose_tiles(txt_cover *c, int recolor) {
    for (uint32_t f = 0; f < c->faces; f++) c->tile[f] = -1;
    for (uint32_t f = 0; f < c->faces; f++) {
        if (f % TXT_REPORT_FACES == 0 &&
            txm_progress(c->env, 0.5f + 0.3f * (float)f / (float)c->faces, "tiles"))
            return 0;
        txt_choose_tile(c, f);
    }
    for (int pass = 0; pass < TXT_PASSES; pass++) {
        int found = 0;
        for (uint32_t f = 0; f < c->faces; f++) {
            if (f % TXT_REPORT_FACES == 0) {
                const float done = ((float)pass + (float)f / (float)c->faces) / (float)TXT_PASSES;
                if (txm_progress(c->env, 0.8f + 0.2f * done, "neighbors")) return 0;
            }
            if (!txt_equal_neighbors(c, f, c->tile[f])) continue;
            found = 1;
            if (!txt_choose_tile(c, f) || !recolor) continue;
            const uint32_t h = (uint32_t)(txm_hash(txm_hash(c->seed + 2) +
                                                   ((uint64_t)pass << 32 | f)) >> 32);
            for (uint32_t i = 0; i < c->corners; i++) {
                const uint32_t k = (h + i) % c->corners;
                txt_recolor(c, f * c->corners + k, h >> (8 + i));
                if (!txt_equal_neighbors(c, f, c->tile[f])) break;
            }
        }
        if (!found) break;
    }
    return 1;
}

/* ---- meshes: checks and colours ---------------------------------------------------------- */

/* May two sides of quads share an edge? North meets south and east meets west, with one colour and
   in opposite directions. */
static int txt_sides_match(const txt_cover *c, uint32_t a, uint32_t b) {
    const uint32_t *v = c->mesh.indices;
    return ((a ^ b) & 3) == 2 && v[a] != v[b] && c->color[a] == c->color[b];
}

/* Do all sides of quads match those at the same edge? Sides from a vertex to itself have no edge:
   around a pole all faces have one at the same vertex. */
static txm_status txt_check_sides(const txt_cover *c) {
    for (uint32_t side = 0; side < c->sides; side++) {
        uint32_t other = TXM_NO_SIDE;
        for (uint32_t s = c->next[side]; s < side; s = c->next[s]) /* rings run downwards */
            if (!txt_sides_match(c, side, s)) other = s;
        if (other != TXM_NO_SIDE)
            return txm_fail_numbers(c->env, TXM_BAD_ARGUMENT,
                                    "faces # and # share an edge whose sides do not match: it must "
                                    "be north and south, or east and west, of one color and equal "
                                    "winding",
                                    other / 4, side / 4);
    }
    return TXM_OK;
}

/* Colours by hash (edges NULL), or as given for quads; 0 when cancelled. */
static int txt_color_sides(txt_cover *c, const int *edges) {
    for (uint32_t i = 0; i < c->sides; i++) {
        if (i % (4 * TXT_REPORT_FACES) == 0 &&
            txm_progress(c->env, 0.5f * (float)i / (float)c->sides, "edges"))
            return 0;
        c->color[i] =
            (uint8_t)(edges ? edges[i - i % 4 + (3 - i % 4)]
                            : txm_mesh_edge_color(&c->mesh, i, c->seed, c->set->colors));
    }
    return 1;
}

/* Cover a mesh of 3 or 4 corners a face: check it, color its edges (edges: as for quads, or NULL),
   choose tiles. What it allocates is in the arena, which the caller frees in any case. */
static txm_status txt_cover_make(txt_cover *c, const textiles_set *set, const uint32_t *indices,
                                 int corners, size_t face_count, size_t vertex_count,
                                 const int *edges, uint64_t seed, txm_env *env) {
    memset(c, 0, sizeof *c);
    c->set = set;
    c->env = env;
    c->seed = seed;
    txm_arena_init(&c->arena, env);
    c->mesh.indices = indices;
    c->mesh.face_count = face_count;
    c->mesh.vertex_count = vertex_count;
    c->mesh.corners = corners;
    txm_status status = txm_mesh_check(&c->mesh, "indices", corners, 0, 0, env);
    if (status != TXM_OK) return status;
    c->faces = (uint32_t)face_count;
    c->corners = (uint32_t)corners;
    c->sides = (uint32_t)txm_mesh_sides(&c->mesh);
    for (uint32_t i = 0; edges && i < c->sides; i++) {
        if (edges[i] < 0 || edges[i] >= set->colors)
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT, "edges: a color of face # is not 0..#",
                                    i / c->corners, (uint64_t)set->colors - 1);
    }

    uint32_t *sorted = (uint32_t *)txm_arena_alloc(&c->arena, c->sides, 2 * sizeof(uint32_t));
    c->color = (uint8_t *)txm_arena_alloc(&c->arena, c->sides, 1);
    c->tile = (int32_t *)txm_arena_alloc(&c->arena, c->faces, sizeof(int32_t));
    if (c->arena.failed)
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the edges of the mesh");
    if (!txt_color_sides(c, edges)) return txt_cancelled(env);
    c->next = sorted + c->sides; /* scratch of the sort, free after it */
    txm_mesh_sort_sides(&c->mesh, sorted);
    txm_mesh_link(&c->mesh, sorted, TXM_LINK_DOWN | (corners == 3 ? TXM_LINK_POINTS : 0), c->next);
    if (corners == 4) status = txt_check_sides(c);
    for (uint32_t f = 0; f < c->faces && status == TXM_OK; f++) {
        if (txt_face_entry(c, f) < 0)
            status = txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                      "edges: the set has no tile with the colors of face #", f, 0);
    }
    if (status == TXM_OK && !txt_choose_tiles(c, !edges)) status = txt_cancelled(env);
    if (status == TXM_OK && txm_progress(env, 1, "neighbors")) status = txt_cancelled(env);
    return status;
}

/* ---- public: meshes --------------------------------------------------------------------- */

TEXTILES_API txm_status textiles_assign_triangles(const textiles_set *set, const uint32_t *indices,
                                                  size_t face_count, size_t vertex_count,
                                                  uint64_t seed, txm_env *env, int *tiles,
                                                  int *rotations) {
    txt_cover c;
    if (!set) return txm_fail(env, TXM_BAD_ARGUMENT, "set is NULL");
    if (set->kind != TEXTILES_TRIANGLE)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "faces of three corners need a triangle set; for quads there is "
                        "textiles_assign_quads");
    if (face_count == 0) return TXM_OK;
    if (!indices || !tiles || !rotations)
        return txm_fail(env, TXM_BAD_ARGUMENT, "indices, tiles or rotations is NULL");
    const txm_status status =
        txt_cover_make(&c, set, indices, 3, face_count, vertex_count, NULL, seed, env);
    for (uint32_t f = 0; f < c.faces && status == TXM_OK; f++) {
        tiles[f] = c.tile[f];
        rotations[f] = (int)(txt_face_entry(&c, f) & 3);
    }
    txm_arena_free(&c.arena);
    return status;
}

TEXTILES_API txm_status textiles_assign_quads(const textiles_set *set, const uint32_t *indices,
                                              size_t face_count, size_t vertex_count,
                                              const int *edges, uint64_t seed, txm_env *env,
                                              int *tiles) {
    txt_cover c;
    if (!set) return txm_fail(env, TXM_BAD_ARGUMENT, "set is NULL");
    if (set->kind != TEXTILES_WANG && set->kind != TEXTILES_FRAME)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "quads need a wang or frame set, with colors on its edges");
    if (!edges && !set->complete)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "without edges the colors are hashed, which takes a complete wang set; give "
                        "edges, or make the set without reduced");
    if (face_count == 0) return TXM_OK;
    if (!indices || !tiles) return txm_fail(env, TXM_BAD_ARGUMENT, "indices or tiles is NULL");
    const txm_status status =
        txt_cover_make(&c, set, indices, 4, face_count, vertex_count, edges, seed, env);
    if (status == TXM_OK) memcpy(tiles, c.tile, face_count * sizeof *tiles);
    txm_arena_free(&c.arena);
    return status;
}

/* ---- atlas: where tiles lie ----------------------------------------------------------- */

/* The position of the pair (a, b) in a ring of all C^2 pairs, each of which begins with the second
   colour of the one before, (a, b), (b, c), (c, d) ... [6, section 3.1.1]. The first colours of the
   pairs are 0 0 1 1 0 2 1 2 2 0 3 1 3 2 3 3; the first C^2 of these are a de Bruijn sequence of C
   colours. */
static int txt_ring_place(int a, int b) {
    if (a == b) return a ? (a + 1) * (a + 1) - 2 : 0;
    if (b == 0) return (a + 1) * (a + 1) - 1;
    return a > b ? a * a + 2 * b - 1 : 2 * a + b * b;
}

/* Corner colours on a torus on which each of the 16 squares of four corners occurs once: the first
   such in lexicographic order. */
static const uint8_t txt_torus_corners[4][4] = {
    {0, 0, 0, 1}, {0, 0, 1, 0}, {1, 0, 1, 1}, {0, 1, 1, 1}};

/* Column and row of a complete set's tile, variant 0, in the torus.

   Wang tiles: the vertical edges of a row run through the ring of pairs (west, east), the
   horizontal edges of a column through that of pairs (north, south), so that every combination
   occurs.

   Corner tiles, 3 colours: column k of the corners is the ring, moved up by 0 + 1 + ... + (k - 1).
   From column to column the shift grows by k, and 0 + 1 + ... + 8 is a multiple of 9, so that the
   torus closes. The pair (nw, sw) gives the position of the left side in the ring, (ne, se) that of
   the right side, their difference k [Cock 1988]. This needs an odd number of colours. */
static void txt_torus_place(const textiles_layout *l, int code, int *column, int *row) {
    const int c = l->colors, ring = c * c;
    const int e[4] = {code / (c * c * c), code / (c * c) % c, code / c % c, code % c};
    if (l->kind == TEXTILES_WANG) {
        *column = txt_ring_place(e[3], e[1]);
        *row = txt_ring_place(e[0], e[2]);
    } else if (c == 3) {
        const int left = txt_ring_place(e[0], e[3]), right = txt_ring_place(e[1], e[2]);
        const int k = (right - left + ring) % ring;
        *column = k;
        *row = (left + ring * ring - k * (k - 1) / 2) % ring;
    } else {
        for (int i = 0; i < 16; i++) {
            const int x = i % 4, y = i / 4, right = (x + 1) % 4, below = (y + 1) % 4;
            if (txt_torus_corners[y][x] != e[0] || txt_torus_corners[y][right] != e[1]) continue;
            if (txt_torus_corners[below][right] != e[2]) continue;
            if (txt_torus_corners[below][x] != e[3]) continue;
            *column = x;
            *row = y;
        }
    }
}

/* the smallest multiple of a power of two that is not below x */
static int txt_round_up(int x, int power) {
    return (x + power - 1) / power * power;
}

/* Fill in columns, pitch and size of a layout whose other fields are set.

   The gutter is rounded up to a power of two, g. Tiles begin at multiples of g, and so do cells, so
   that a pixel of mip-map level log2(g) belongs to one cell. Bilinear filtering there looks at the
   two by two such pixels around a place, which from a border at a multiple of g reach g pixels far.

   Triangles: two to a cell, the second upside down, mirrored at the cell's centre. Rows and columns
   of texels behave as above, but across the hypotenuse the four pixels' far corner is further away:
   with the edge at i + j = N, the block of four begins at i + j <= floor(N + 1) - g, so that its
   last pixel has i + j <= floor(N + 1) + 3 g - 2, floor() to multiples of g.

         +--------------x      A owns the pixels with x + y < pitch of its cell, B the others:
         |A . . . . . / |      up to i + j = pitch - 1 - 2 g, and pitch - 2 - 2 g. The latter is
         | . A . . /  B |      the number above for pitch = floor(N + 1) + 5 g
         |  . . /  . .  |
         | . /  . . . B |
         x--------------+                                                                   */
static txm_status txt_lay_out(textiles_layout *l, txm_env *env) {
    const int triangle = l->kind == TEXTILES_TRIANGLE, side = l->size + triangle;
    int cells = l->count, rows;
    if (l->gutter < 0 || l->gutter > l->size)
        return txm_fail(env, TXM_BAD_ARGUMENT, "gutter must be 0 to half the tiles' size, or -1");
    int g = 1;
    while (g < l->gutter) g *= 2;
    if (l->gutter > 0) l->gutter = g;

    if (l->packing == TEXTILES_TORUS) {
        l->columns = l->colors * l->colors * l->variants;
        rows = l->colors * l->colors;
        l->pitch_x = l->pitch_y = side;
    } else {
        l->pitch_x = txt_round_up(side, g) + 2 * l->gutter;
        if (triangle && l->packing == TEXTILES_PACKED) {
            l->pitch_x = l->gutter ? side / g * g + 5 * g : side + 1;
            cells = (cells + 1) / 2; /* all triangle sets have an even number of tiles */
        }
        l->pitch_y = l->pitch_x;
        l->columns = 1;
        while (l->packing == TEXTILES_PACKED && l->columns * l->columns < cells) l->columns++;
        rows = (cells + l->columns - 1) / l->columns;
    }
    l->width = l->columns * l->pitch_x;
    l->height = rows * l->pitch_y;
    if (l->height > TEXTILES_MAX_PIXELS / l->width)
        return txm_fail(env, TXM_TOO_LARGE,
                        "the atlas has more than TEXTILES_MAX_PIXELS pixels; use fewer tiles");
    return TXM_OK;
}

/* Refuse a layout that textiles_layout_make cannot have made: its numbers are used as indices. */
static txm_status txt_check_layout(const textiles_layout *layout, txm_env *env) {
    static const char *const bad = "layout was not made by textiles_layout_make";
    if (!layout) return txm_fail(env, TXM_BAD_ARGUMENT, "layout is NULL");
    textiles_layout l = *layout;
    if ((int)l.packing < TEXTILES_PACKED || (int)l.packing > TEXTILES_SLICES ||
        (int)l.kind < TEXTILES_WANG || (int)l.kind > TEXTILES_FRAME || l.size < TEXTILES_MIN_SIZE ||
        l.size > TEXTILES_MAX_SIZE || l.colors < 1 || l.colors > TEXTILES_MAX_COLORS ||
        l.variants < 1 || l.variants > TEXTILES_MAX_VARIANTS || l.count < 1 ||
        l.count > 256 * TEXTILES_MAX_VARIANTS)
        return txm_fail(env, TXM_BAD_ARGUMENT, bad);
    if (l.packing == TEXTILES_TORUS &&
        (l.kind == TEXTILES_TRIANGLE || l.kind == TEXTILES_FRAME || l.gutter != 0 ||
         (l.kind == TEXTILES_CORNER && l.colors == 4) ||
         l.count != l.colors * l.colors * l.colors * l.colors * l.variants))
        return txm_fail(env, TXM_BAD_ARGUMENT, bad);
    const txm_status status = txt_lay_out(&l, env);
    if (status != TXM_OK) return status;
    if (l.gutter != layout->gutter || l.columns != layout->columns ||
        l.pitch_x != layout->pitch_x || l.pitch_y != layout->pitch_y ||
        l.width != layout->width || l.height != layout->height)
        return txm_fail(env, TXM_BAD_ARGUMENT, bad);
    return TXM_OK;
}

TEXTILES_API int textiles_place(const textiles_layout *layout, int tile, int *px, int *py,
                                int *step, float uv[4][2]) {
    if (!layout || tile < 0 || tile >= layout->count || layout->columns < 1) return 0;
    const textiles_layout *l = layout;
    const int triangle = l->kind == TEXTILES_TRIANGLE, slices = l->packing == TEXTILES_SLICES;
    const int pair = triangle && !slices, cell = pair ? tile / 2 : tile;
    int column = cell % l->columns, row = cell / l->columns;
    if (l->packing == TEXTILES_TORUS) {
        txt_torus_place(l, tile / l->variants, &column, &row);
        column += tile % l->variants * l->colors * l->colors;
    }
    const int down = !(pair && tile & 1); /* else upside down, its corner at the lower right */
    const int x = column * l->pitch_x + (down ? l->gutter : l->pitch_x - 1 - l->gutter);
    const int y = row * l->pitch_y + (down ? l->gutter : l->pitch_y - 1 - l->gutter);
    if (px) *px = x;
    if (py) *py = y;
    if (step) *step = down ? 1 : -1;
    if (uv) {
        /* of triangles from texel centre to texel centre; of slices inside the slice */
        static const int squares[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
        static const int triangles[3][2] = {{0, 0}, {0, 1}, {1, 0}};
        const double centre = triangle ? 0.5 : 0, side = down ? l->size : -l->size;
        for (int k = 0; k < (triangle ? 3 : 4); k++) {
            const int *corner = triangle ? triangles[k] : squares[k];
            uv[k][0] = txm_float((x + centre + side * corner[0]) / l->width);
            uv[k][1] = txm_float((y - (slices ? row * l->pitch_y : 0) + centre + side * corner[1]) /
                                 (slices ? l->pitch_y : l->height));
        }
    }
    return 1;
}

/* ---- atlas: what lies around a tile --------------------------------------------------- */

/* A square and eight tiles around it that match; -1: none does. The diagonal ones match the tiles
   above or below and beside them, where the set has such a tile. */
static void txt_around(const textiles_set *s, int tile, int around[3][3]) {
    static const int order[8][2] = {{2, 1}, {0, 1}, {1, 0}, {1, 2}, {2, 0}, {0, 0}, {2, 2}, {0, 2}};
    for (int i = 0; i < 9; i++) around[i / 3][i % 3] = -1;
    around[1][1] = tile;
    for (int k = 0; k < 8; k++) {
        const int x = order[k][0], y = order[k][1];
        const int beside = x == 1 ? -1 : around[y][1], above = y == 1 ? -1 : around[1][x];
        if (k >= 4 && (beside < 0 || above < 0)) continue;
        for (int u = 0; u < s->count && around[y][x] < 0; u += s->variants) {
            if (beside >= 0 && !(x == 2 ? txt_joins(s, beside, u, 0) : txt_joins(s, u, beside, 0)))
                continue;
            if (above >= 0 && !(y == 2 ? txt_joins(s, above, u, 1) : txt_joins(s, u, above, 1)))
                continue;
            around[y][x] = u;
        }
    }
}

/* Pixel (x, y) of the plane around a square, less than a tile away. Where no tile matches, the
   nearest pixel of those around. */
static const uint8_t *txt_square_texel(const textiles_set *s, int map, int around[3][3], int x,
                                       int y) {
    const int n = s->size;
    int column = x < 0 ? 0 : x < n ? 1 : 2, row = y < 0 ? 0 : y < n ? 1 : 2;
    if (around[row][column] < 0) {
        if (around[1][column] >= 0) row = 1;
        else if (around[row][1] >= 0) column = 1;
        else row = column = 1;
    }
    return txt_texel(s, map, around[row][column], txm_clampi(x - (column - 1) * n, 0, n - 1),
                     txm_clampi(y - (row - 1) * n, 0, n - 1));
}

/* A triangle that may lie beyond side k of another, as tile * 3 + its own side there: of the same
   colour and opposite direction. Every triangle set has one, near the start of the list. */
static int txt_across(const textiles_set *s, int tile, int k) {
    const textiles_tile *t = &s->tiles[tile];
    for (int u = 0; u < s->count; u += s->variants) {
        for (int m = 0; m < 3; m++) {
            if (s->tiles[u].edges[m] == t->edges[k] &&
                s->tiles[u].directions[m] == -t->directions[k])
                return u * 3 + m;
        }
    }
    return tile * 3 + k;
}

/* Texel (i, j) of the plane around a triangle: go from triangle to triangle, each time across the
   side that the texel lies furthest beyond. With w[k] the barycentric coordinate of corner k, times
   size, the neighbour across side k has the third corner Q = V(k) + V(k+1) - V(k+2), so that

       w(k) V(k) + w(k+1) V(k+1) + w(k+2) V(k+2)
           = (w(k) + w(k+2)) V(k) + (w(k+1) + w(k+2)) V(k+1) - w(k+2) Q,

   and its own side m runs from V(k+1) to V(k). */
static const uint8_t *txt_triangle_texel(const textiles_set *s, int map, int tile, int i, int j) {
    int w[3] = {s->size - i - j, j, i};
    for (;;) {
        int least = w[1] < w[0] ? 1 : 0;
        if (w[2] < w[least]) least = 2;
        if (w[least] >= 0) return txt_texel(s, map, tile, w[2], w[1]);
        const int k = (least + 1) % 3, next = txt_across(s, tile, k), m = next % 3;
        const int beyond = -w[least], start = w[(k + 1) % 3] - beyond, end = w[k] - beyond;
        w[m] = start;
        w[(m + 1) % 3] = end;
        w[(m + 2) % 3] = beyond;
        tile = next / 3;
    }
}

/* Draw texels (i, j) of the plane around a tile, i and j in low..high, i + j <= most, at
   (px + step i, py + step j) of a picture. */
static void txt_draw_around(const textiles_set *s, int map, int tile, const txm_image *out, int px,
                            int py, int step, int low, int high, int most) {
    const size_t texel = s->maps[map].texel;
    int around[3][3];
    if (s->kind != TEXTILES_TRIANGLE) txt_around(s, tile, around);
    for (int j = low; j <= high; j++) {
        uint8_t *row = (uint8_t *)txm_image_row(out, py + step * j);
        for (int i = low; i <= high && i + j <= most; i++) {
            uint8_t *to = row + (size_t)(px + step * i) * texel;
            if (s->kind == TEXTILES_TRIANGLE) {
                memcpy(to, txt_triangle_texel(s, map, tile, i, j), texel);
            } else if (i == 0 && j >= 0 && j < s->size) {
                memcpy(to, txt_texel(s, map, tile, 0, j), (size_t)s->size * texel);
                i = s->size - 1; /* the tile's own row at once */
            } else {
                memcpy(to, txt_square_texel(s, map, around, i, j), texel);
            }
        }
    }
}

/* Draw one tile of an atlas and the rest of its cell around it. */
typedef struct txt_atlas_job {
    const textiles_set *set;
    const textiles_layout *layout;
    const txm_image *out;
    int map;
} txt_atlas_job;

static void txt_draw_cell(void *context, int tile) {
    const txt_atlas_job *job = (const txt_atlas_job *)context;
    const textiles_layout *l = job->layout;
    const int high = l->pitch_x - 1 - l->gutter;
    int px, py, step, most = 2 * high;
    textiles_place(l, tile, &px, &py, &step, NULL);
    if (l->packing == TEXTILES_PACKED && l->kind == TEXTILES_TRIANGLE)
        most = l->pitch_x - (step > 0 ? 1 : 2) - 2 * l->gutter;
    txt_draw_around(job->set, job->map, tile, job->out, px, py, step, -l->gutter, high, most);
}

/* ---- atlas: the plane, pixel by pixel ------------------------------------------------- */

/* a window of the plane */
typedef struct txt_view {
    const textiles_plane *plane;
    const textiles_layout *layout;
    txm_image atlas, out;
    double x, y, step;
} txt_view;

/* Bilinear interpolation at (x, y) of the atlas, pixel centres at whole numbers. Torus layouts
   repeat; others are clamped to the picture, slices to the slice. */
static void txt_bilinear(const txt_view *v, int tile, double x, double y, void *to) {
    const textiles_layout *l = v->layout;
    const int slices = l->packing == TEXTILES_SLICES;
    const int top = slices ? tile * l->pitch_y : 0;
    const int bottom = slices ? top + l->pitch_y - 1 : l->height - 1;
    const double fx = x - floor(x), fy = y - floor(y);
    const void *rows[2];
    size_t at[2];
    for (int k = 0; k < 2; k++) {
        int ix = (int)floor(x) + k, iy = (int)floor(y) + k;
        if (l->packing == TEXTILES_TORUS) {
            ix = (ix + l->width) % l->width;
            iy = (iy + l->height) % l->height;
        }
        at[k] = (size_t)txm_clampi(ix, 0, l->width - 1) * (size_t)v->atlas.channels;
        rows[k] = txm_image_row_const(&v->atlas, txm_clampi(iy, top, bottom));
    }
    const int last = v->atlas.channels - 1, has_alpha = txm_image_has_alpha(&v->atlas);
    double alpha[4] = {1, 1, 1, 1}, shown = 0;
    for (int k = 0; k < 4 && has_alpha; k++) {
        alpha[k] = fmax(txt_stored(v->atlas.sample, rows[k / 2], at[k & 1] + (size_t)last), 0);
        shown += alpha[k] * (k & 1 ? fx : 1 - fx) * (k / 2 ? fy : 1 - fy);
    }
    const int is_even = alpha[0] == alpha[1] && alpha[0] == alpha[2] && alpha[0] == alpha[3];
    for (int c = 0; c <= last; c++) {
        double s[4];
        const int by_alpha = c < last && !is_even && shown > 0;
        for (int k = 0; k < 4; k++) {
            s[k] = txt_stored(v->atlas.sample, rows[k / 2], at[k & 1] + (size_t)c);
            if (by_alpha) s[k] *= alpha[k] / shown;
        }
        const double above = s[0] * (1 - fx) + s[1] * fx, below = s[2] * (1 - fx) + s[3] * fx;
        const double value = above * (1 - fy) + below * fy;
        if (v->atlas.sample == TXM_F32) ((float *)to)[c] = txm_float(value);
        else if (v->atlas.sample == TXM_U16) ((uint16_t *)to)[c] = (uint16_t)(value + 0.5);
        else ((uint8_t *)to)[c] = (uint8_t)(value + 0.5);
    }
}

/* One row of the window. The tile is looked up again only when the position leaves it. */
static void txt_view_row(void *context, int row) {
    const txt_view *v = (const txt_view *)context;
    const textiles_layout *l = v->layout;
    const int triangle = l->kind == TEXTILES_TRIANGLE;
    const double n = l->size, root3 = 1.7320508075688772935;
    const size_t texel = (size_t)v->out.channels * txm_sample_bytes(v->out.sample);
    uint8_t *to = (uint8_t *)txm_image_row(&v->out, row);
    int last[3] = {0, 0, -1}, tile = 0, rotation = 0, px = 0, py = 0, step = 1;
    for (int column = 0; column < v->out.width; column++, to += texel) {
        const double x = v->x + (column + 0.5) * v->step, y = v->y + (row + 0.5) * v->step;
        const double a = triangle ? (x - y / root3) / n : x / n;
        const double b = triangle ? y * 2 / (root3 * n) : y / n;
        const double fa = a - floor(a), fb = b - floor(b);
        const int now[3] = {(int)floor(a), (int)floor(b), triangle && fa + fb >= 1};
        if (now[0] != last[0] || now[1] != last[1] || now[2] != last[2]) {
            for (int k = 0; k < 3; k++) last[k] = now[k];
            tile = triangle ? textiles_plane_triangle(v->plane, now[0], now[1], now[2], &rotation)
                            : textiles_plane_tile(v->plane, now[0], now[1]);
            textiles_place(l, tile, &px, &py, &step, NULL);
        }
        if (triangle) {
            const double w[3] = {now[2] ? fa + fb - 1 : 1 - fa - fb, now[2] ? 1 - fb : fb,
                                 now[2] ? 1 - fa : fa};
            const double j = w[(4 - rotation) % 3] * n, i = w[(5 - rotation) % 3] * n;
            txt_bilinear(v, tile, px + step * i, py + step * j, to);
        } else {
            txt_bilinear(v, tile, px + (x - now[0] * n) - 0.5, py + (y - now[1] * n) - 0.5, to);
        }
    }
}

/* ---- public: pictures of a set -------------------------------------------------------- */

TEXTILES_API txm_status textiles_layout_make(const textiles_set *set, textiles_packing packing,
                                             int gutter, txm_env *env, textiles_layout *layout) {
    textiles_layout l;
    if (!set || !layout) return txm_fail(env, TXM_BAD_ARGUMENT, "set or layout is NULL");
    if ((int)packing < TEXTILES_PACKED || (int)packing > TEXTILES_SLICES)
        return txm_fail(env, TXM_BAD_ARGUMENT, "packing is none of textiles_packing");
    const int torus = packing == TEXTILES_TORUS;
    if (gutter < -1 || gutter > set->size / 2)
        return txm_fail(env, TXM_BAD_ARGUMENT, "gutter must be 0 to half the tiles' size, or -1");
    if (torus && gutter > 0)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "TEXTILES_TORUS has no gutter; leave it 0, or use TEXTILES_PACKED");
    if (torus && (!set->complete || set->kind == TEXTILES_TRIANGLE))
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "TEXTILES_TORUS is for complete wang and corner sets; use TEXTILES_PACKED");
    if (torus && set->kind == TEXTILES_CORNER && set->colors == 4)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "TEXTILES_TORUS takes corner sets of 2 or 3 colors; use TEXTILES_PACKED");
    memset(&l, 0, sizeof l);
    l.packing = packing;
    l.kind = set->kind;
    l.size = set->size;
    l.colors = set->colors;
    l.variants = set->variants;
    l.count = set->count;
    l.gutter = torus ? 0 : gutter < 0 ? 8 < set->size / 2 ? 8 : set->size / 2 : gutter;
    const txm_status status = txt_lay_out(&l, env);
    if (status == TXM_OK) *layout = l;
    return status;
}

/* the checks of a map's number and of out that both calls that draw tiles have in common */
static txm_status txt_check_picture(const textiles_set *set, int map, const txm_image *out,
                                    int width, int height, txm_env *env) {
    if (map < 0 || map >= set->map_count)
        return txm_fail(env, TXM_BAD_ARGUMENT, "map: the set has no map of this number");
    const txm_status status = txm_image_check(out, "out", TEXTILES_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    if (out->width != width || out->height != height)
        return txm_fail(env, TXM_BAD_ARGUMENT, "out: width or height is not what the tiles need");
    if (txm_image_resolve(*out).channels != set->maps[map].channels ||
        out->sample != set->maps[map].sample)
        return txm_fail(env, TXM_BAD_ARGUMENT, "out: channels and sample type must be the map's");
    return TXM_OK;
}

TEXTILES_API txm_status textiles_draw_atlas(const textiles_set *set, const textiles_layout *layout,
                                            int map, txm_env *env, txm_image out) {
    if (!set) return txm_fail(env, TXM_BAD_ARGUMENT, "set is NULL");
    txm_status status = txt_check_layout(layout, env);
    if (status != TXM_OK) return status;
    if (layout->kind != set->kind || layout->size != set->size || layout->count != set->count ||
        layout->colors != set->colors || layout->variants != set->variants)
        return txm_fail(env, TXM_BAD_ARGUMENT, "layout belongs to another set");
    status = txt_check_picture(set, map, &out, layout->width, layout->height, env);
    if (status != TXM_OK) return status;

    const txm_image im = txm_image_resolve(out);
    txt_atlas_job job;
    job.set = set;
    job.layout = layout;
    job.out = &im;
    job.map = map;
    txm_parallel_for(env, set->count, txt_draw_cell, &job);

    /* cells without a tile, at the end of the last row: the nearest pixel to the left or above */
    const int pair = layout->kind == TEXTILES_TRIANGLE && layout->packing == TEXTILES_PACKED;
    const int cells = pair ? set->count / 2 : set->count;
    const int right = ((cells - 1) % layout->columns + 1) * layout->pitch_x;
    const int top = im.height - layout->pitch_y;
    const size_t texel = set->maps[map].texel;
    for (int y = top; y < im.height; y++) {
        uint8_t *row = (uint8_t *)txm_image_row(&im, y);
        for (int x = right; x < im.width; x++) {
            const uint8_t *from = row + (size_t)(right - 1) * texel;
            if (top > 0 && y - top < x - right)
                from = (const uint8_t *)txm_image_row(&im, top - 1) + (size_t)x * texel;
            memcpy(row + (size_t)x * texel, from, texel);
        }
    }
    return TXM_OK;
}

TEXTILES_API txm_status textiles_draw_tile(const textiles_set *set, int tile, int gutter, int map,
                                           txm_env *env, txm_image out) {
    if (!set) return txm_fail(env, TXM_BAD_ARGUMENT, "set is NULL");
    if (tile < 0 || tile >= set->count)
        return txm_fail(env, TXM_BAD_ARGUMENT, "tile: the set has no tile of this number");
    if (gutter < 0 || gutter > set->size / 2)
        return txm_fail(env, TXM_BAD_ARGUMENT, "gutter must be 0 to half the tiles' size");
    const int side = set->side + 2 * gutter;
    const txm_status status = txt_check_picture(set, map, &out, side, side, env);
    if (status != TXM_OK) return status;
    const txm_image im = txm_image_resolve(out);
    const int high = set->side - 1 + gutter;
    txt_draw_around(set, map, tile, &im, gutter, gutter, 1, -gutter, high, 2 * high);
    return TXM_OK;
}

TEXTILES_API txm_status textiles_draw_plane(const textiles_plane *plane,
                                            const textiles_layout *layout, const txm_image *atlas,
                                            double x, double y, double step, txm_env *env,
                                            txm_image out) {
    if (!plane) return txm_fail(env, TXM_BAD_ARGUMENT, "plane is NULL");
    txm_status status = txt_check_layout(layout, env);
    if (status != TXM_OK) return status;
    const int c = layout->colors;
    int fits = plane->kind == layout->kind && plane->colors == c &&
               plane->variants == layout->variants && layout->kind != TEXTILES_FRAME;
    if (fits && layout->kind == TEXTILES_TRIANGLE) {
        fits = plane->table != NULL;
        for (int i = 0; fits && i < 8 * c * c * c; i++)
            fits = plane->table[i] / 4 <= layout->count - layout->variants;
    } else if (fits) {
        fits = layout->count == c * c * c * c * layout->variants;
    }
    if (!fits) return txm_fail(env, TXM_BAD_ARGUMENT, "plane and layout belong to different sets");
    status = txm_image_check(atlas, "atlas", TEXTILES_MAX_PIXELS, env);
    if (status == TXM_OK) status = txm_image_check(&out, "out", TEXTILES_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    if (atlas->width != layout->width || atlas->height != layout->height)
        return txm_fail(env, TXM_BAD_ARGUMENT, "atlas: width or height is not that of the layout");
    if (txm_image_resolve(*atlas).channels != txm_image_resolve(out).channels ||
        atlas->sample != out.sample)
        return txm_fail(env, TXM_BAD_ARGUMENT, "out: channels and sample type must be the atlas's");
    if (!txm_is_finite(x) || !txm_is_finite(y) || !txm_is_finite(step) || !(step > 0))
        return txm_fail(env, TXM_BAD_ARGUMENT, "x, y and step must be finite, and step above 0");
    /* tile numbers must fit an int; of triangles they mix both coordinates */
    const double reach = fabs(x) + fabs(y) + step * out.width + step * out.height;
    if (!(reach / layout->size < 1e9))
        return txm_fail(env, TXM_BAD_ARGUMENT, "the window lies more than 10^9 tiles from the origin");

    txt_view view;
    view.plane = plane;
    view.layout = layout;
    view.atlas = txm_image_resolve(*atlas);
    view.out = txm_image_resolve(out);
    view.x = x;
    view.y = y;
    view.step = step;
    txm_parallel_for(env, out.height, txt_view_row, &view);
    return TXM_OK;
}

TEXTILES_API int textiles_face_uv(const textiles_layout *layout, int tile, int rotation,
                                  float uv[4][2]) {
    float corner[4][2];
    if (!uv || rotation < 0 || rotation > 2) return 0;
    if (!textiles_place(layout, tile, NULL, NULL, NULL, corner)) return 0;
    const int triangle = layout->kind == TEXTILES_TRIANGLE, corners = triangle ? 3 : 4;
    for (int k = 0; k < corners; k++) { /* squares are listed clockwise, faces not */
        const int from = triangle ? (k + rotation) % 3 : (4 - k) % 4;
        uv[k][0] = corner[from][0];
        uv[k][1] = corner[from][1];
    }
    return corners;
}

/* ---- constants of the cutting ------------------------------------------------------------- */

enum {
    TXT_MAX_FEATURES = 8, /* bytes of a texel that are compared                                */
    TXT_MAX_SEGMENTS = 40, /* pieces of exemplar along an edge                                  */
    TXT_MISSING = 256,    /* difference to a texel beyond the exemplar, quarter gray levels    */
    TXT_LANES = 32,       /* places of a row that are compared side by side                    */
    TXT_CELL = 8,         /* texels a side of a cell in which use is counted                   */
    TXT_SURROUNDINGS = 4  /* texels: half width of the box whose brightness is a feature       */
};

/* macros, as C++20 deprecates arithmetic of enumerators with floating-point numbers */
#define TXT_SCALE 16          /* units of a search's cost per gray level                     */
#define TXT_SURROUND_GAIN 3   /* factor by which surroundings count more                     */

/* ---- sheets: the exemplars as texels ------------------------------------------------------- */

/* One exemplar as a grid of texels. For squares these are its pixels. For triangles it is resampled
   on a triangular lattice: texel k of row j lies at (k + (j odd) / 2, j sqrt(3) / 2); everywhere
   else lattice points have axial coordinates (i, j) with i = k - floor(j / 2), in which turning by
   60 degrees is (i, j) -> (-j, i + j), and shifts are sums. */
typedef struct txt_sheet {
    int width, height;
    int32_t first;                     /* number of its first texel                            */
    txm_image maps[TEXTILES_MAX_MAPS]; /* the caller's, or resampled                           */
} txt_sheet;

/* A piece of exemplar laid over a tile: texel (x, y) shows turned(x, y) + (i, j) of a sheet. */
typedef struct txt_layer {
    int sheet, turn; /* turn: sixths of a circle, 0 for squares     */
    int i, j;
    int is_frame;    /* belongs to an edge or a corner of the set   */
} txt_layer;

/* Traits whose means over the set should be those of the exemplars, in gray levels: the channels of
   the first map, the steps from texel to texel (half of 60 each), and the variance. */
enum { TXT_STEP = 4, TXT_VARIANCE = 6, TXT_TRAITS = 7 }; /* TXT_STEP + 1: the step down */

typedef struct txt_line {
    uint32_t *sum; /* of a value along a line of texels, sum[0] before the first one */
    double mean;   /* over all texels                                                */
} txt_line;

/* The strip of exemplar at an edge, the same in all tiles with its colour. Coordinates: a along the
   joint from the start vertex, u across it. Squares: u < 0 is above or left of the joint;
   triangles: u = 0 lies on it. */
typedef struct txt_seam_strip {
    int axis; /* 0: runs to the right, 1: down */
    int count;
    struct {
        int sheet, i, j; /* texel of the sheet at a = 0, u = 0 */
    } segment[TXT_MAX_SEGMENTS];
    int corner[2];  /* of start and end                                                      */
    uint8_t *which; /* by a, u: 0 the start's corner, 1..count a segment, count + 1 the end's */
} txt_seam_strip;

/* A place of the exemplars where a piece may come from. */
typedef struct txt_place {
    int sheet, turn, i, j;
    uint32_t cost; /* mean difference of a sample and the extra cost, TXT_SCALE per gray level */
} txt_place;

typedef struct txt_build {
    textiles_set *set;
    const textiles_desc *desc;
    txm_env *env;
    txm_arena arena;
    int is_triangle;
    int features, stride; /* compared bytes of a texel; bytes from one to the next: 4 or 8   */
    int feature_map[TXT_MAX_FEATURES], feature_channel[TXT_MAX_FEATURES];
    txt_sheet sheets[TEXTILES_MAX_EXEMPLARS];
    int sheet_count;
    size_t texels;
    uint8_t *texel;         /* texels * stride: what is compared                              */
    uint8_t *plane;         /* features * texels: the same, blurred a little, for searches    */
    txt_line cross[2];      /* by axis: differences across a joint there                      */
    txt_line along[2];      /* differences along a line                                       */
    txt_line salience[2];   /* how conspicuous a place is, along both axes                    */
    txt_line color[2][4];   /* the first map's channels                                       */
    uint8_t *salient;       /* the same of a texel, see txt_fill_salience                     */
    uint16_t *line_cost[2]; /* by axis: the cost of a joint of line_length texels from there  */
    int line_length[2];
    double line_step[2];    /* the mean step that it should have                              */
    uint32_t *use[TEXTILES_MAX_EXEMPLARS];  /* by cell: how much of it interiors show          */
    uint32_t *used[TEXTILES_MAX_EXEMPLARS]; /* sums over all cells above and to the left       */
    double *traits[TEXTILES_MAX_EXEMPLARS]; /* the same of TXT_TRAITS traits                   */
    double usual[TXT_TRAITS];               /* their means over the exemplars                  */
    double surplus[TXT_TRAITS];             /* sum over the tiles so far of what exceeds these  */
    struct {
        int sheet, i, j;
    } corner[TEXTILES_MAX_COLORS];
    int corner_count;
    txt_seam_strip *strips;
    int strip_count;
    txt_place *inside; /* by tile: where its interior comes from; sheet -1: not made yet */
    int lock_from, lock_count; /* u of a strip's first line, how many                         */
    double step_mean;          /* from texel to texel, both axes                               */
    double wanted_step;        /* of joints, in units of the mean step of the exemplars       */
    int corners_are_final;     /* edges then compensate for the corners                        */
} txt_build;

static const int txt_turns[6][4] = {{1, 0, 0, 1},   {0, -1, 1, 1}, {-1, -1, 1, 0},
                                    {-1, 0, 0, -1}, {0, 1, -1, -1}, {1, 1, -1, 0}};

static void txt_turn(int turn, int x, int y, int *i, int *j) {
    const int *m = txt_turns[turn];
    *i = m[0] * x + m[1] * y;
    *j = m[2] * x + m[3] * y;
}

/* floor(j / 2), also below zero */
static int txt_half(int j) {
    return (j - (j & 1)) / 2;
}

/* number of the texel at (i, j) of a sheet; -1 beyond its borders */
static int32_t txt_number(const txt_build *b, int sheet, int i, int j) {
    const txt_sheet *s = &b->sheets[sheet];
    const int k = b->is_triangle ? i + txt_half(j) : i;
    if (k < 0 || k >= s->width || j < 0 || j >= s->height) return -1;
    return s->first + j * s->width + k;
}

/* number of the texel that a layer shows at (x, y) of a tile; -1: none */
static int32_t txt_shown(const txt_build *b, const txt_layer *l, int x, int y) {
    int i, j;
    txt_turn(l->turn, x, y, &i, &j);
    return txt_number(b, l->sheet, i + l->i, j + l->j);
}

/* difference of two texels in quarters of a gray level, 0..1020, the mean over all features */
static int txt_difference(const txt_build *b, int32_t s, int32_t t) {
    int sum = 0;
    if (s == t) return 0;
    if (s < 0 || t < 0) return TXT_MISSING;
    const uint8_t *p = b->texel + (size_t)s * (size_t)b->stride;
    const uint8_t *q = b->texel + (size_t)t * (size_t)b->stride;
    for (int c = 0; c < 4; c++) sum += p[c] > q[c] ? p[c] - q[c] : q[c] - p[c];
    for (int c = 4; c < b->stride; c++) sum += p[c] > q[c] ? p[c] - q[c] : q[c] - p[c];
    return 4 * sum / b->features;
}

/* Cubic convolution over six points, of fourth order [10]: nearly as sharp as the exemplar. */
static double txt_keys(double x) {
    x = fabs(x);
    if (x < 1) return (4.0 / 3 * x - 7.0 / 3) * x * x + 1;
    if (x < 2) return ((-7.0 / 12 * x + 3) * x - 59.0 / 12) * x + 2.5;
    if (x < 3) return ((1.0 / 12 * x - 2.0 / 3) * x + 1.75) * x - 1.5;
    return 0;
}

/* Is a pixel of an image with alpha not fully opaque? */
static int txt_is_translucent(const txm_image *im) {
    for (int y = 0; y < im->height; y++) {
        for (int x = 0; x < im->width; x++) {
            if (txm_image_get(im, x, y, im->channels - 1) < 1) return 1;
        }
    }
    return 0;
}

/* One row of a lattice sheet: interpolate six rows of the picture, then along the row. by_alpha:
   colours are weighted by alpha; where so little shows that the weights below 0 count, they are
   those of the nearest pixel. */
static void txt_resample_row(const txm_image *in, const txm_image *out, int row, int by_alpha,
                             double *line) {
    const double y = row * 0.86602540378443864676;
    const int top = (int)floor(y), n = in->channels;
    double weight[6], half[6];
    for (int k = 0; k < 6; k++) {
        weight[k] = txt_keys(y - (top - 2 + k));
        half[k] = txt_keys(0.5 - (k - 2));
    }
    for (int x = 0; x < in->width; x++) {
        for (int c = 0; c < n; c++) {
            double sum = 0;
            for (int k = 0; k < 6; k++) {
                const int v = txm_clampi(top - 2 + k, 0, in->height - 1);
                double value = txm_image_get(in, x, v, c);
                if (by_alpha && c + 1 < n)
                    value *= (double)txm_clampf(txm_image_get(in, x, v, n - 1), 0, 1);
                sum += weight[k] * value;
            }
            line[x * n + c] = sum;
        }
    }
    const int nearest = txm_clampi((int)floor(y + 0.5), 0, in->height - 1);
    for (int x = 0; x < out->width; x++) {
        double shown = 1;
        for (int c = n - 1; c >= 0; c--) { /* alpha first */
            double value = line[x * n + c];
            if (row & 1) {
                value = 0;
                for (int k = 0; k < 6; k++)
                    value += half[k] * line[txm_clampi(x - 2 + k, 0, in->width - 1) * n + c];
            }
            if (by_alpha && c == n - 1) shown = value;
            else if (by_alpha && shown > 0.25) value /= shown;
            else if (by_alpha) value = txm_image_get(in, x, nearest, c);
            txm_image_set(out, x, row, c, txm_float(value));
        }
    }
}

/* Turn the exemplars into sheets. */
static txm_status txt_make_sheets(txt_build *b) {
    const textiles_desc *d = b->desc;
    b->sheet_count = d->exemplar_count;
    for (int e = 0; e < d->exemplar_count; e++) {
        txt_sheet *s = &b->sheets[e];
        const txm_image *first = &d->exemplars[e].maps[0];
        s->width = first->width;
        s->height = first->height;
        if (b->is_triangle) {
            s->width = first->width - 1;
            s->height = (int)((first->height - 1) / 0.86602540378443864676) + 1;
        }
        s->first = (int32_t)b->texels;
        b->texels += (size_t)s->width * (size_t)s->height;
        if (b->texels > TEXTILES_MAX_PIXELS)
            return txm_fail(b->env, TXM_TOO_LARGE, "exemplars: more than TEXTILES_MAX_PIXELS");
        for (int m = 0; m < b->set->map_count; m++) {
            txm_image in = txm_image_resolve(d->exemplars[e].maps[m]);
            const int has_alpha = b->set->maps[m].has_alpha;
            const txm_status status =
                has_alpha ? txm_image_bled(&in, 0, &b->arena, b->env, &in) : TXM_OK;
            if (status != TXM_OK) return status;
            s->maps[m] = in;
            if (!b->is_triangle) continue;
            const int by_alpha = has_alpha && txt_is_translucent(&in);
            txm_image *out = &s->maps[m];
            out->width = s->width;
            out->height = s->height;
            out->stride = (ptrdiff_t)((size_t)s->width * b->set->maps[m].texel);
            out->pixels = txm_arena_alloc(
                &b->arena, (size_t)s->width * (size_t)s->height, b->set->maps[m].texel);
            double *line = (double *)txm_alloc(b->env, (size_t)in.width * 4 * sizeof(double));
            if (!out->pixels || !line) {
                txm_free(b->env, line);
                return txm_fail(b->env, TXM_OUT_OF_MEMORY, "no memory for the exemplars");
            }
            for (int y = 0; y < s->height; y++) txt_resample_row(&in, out, y, by_alpha, line);
            txm_free(b->env, line);
        }
        b->set->sheets[e].first = s->first;
        b->set->sheets[e].width = s->width;
        b->set->sheets[e].height = s->height;
    }
    b->set->exemplar_count = d->exemplar_count;
    return TXM_OK;
}

/* What is compared: all channels of the first map, then those of the others at half weight as long
   as there is room. Colours count as much as they are opaque. Floats are scaled to their range. */
static void txt_list_features(txt_build *b) {
    for (int m = 0; m < b->set->map_count; m++) {
        const int n = b->set->maps[m].channels;
        if (m && b->features + n > TXT_MAX_FEATURES) continue;
        for (int c = 0; c < n; c++) {
            TXM_ASSERT(b->features < TXT_MAX_FEATURES);
            b->feature_map[b->features] = m;
            b->feature_channel[b->features++] = c;
        }
    }
    if (b->features < TXT_MAX_FEATURES) b->feature_map[b->features++] = -1; /* surroundings */
    b->stride = b->features <= 4 ? 4 : 8;
}

/* The last feature: the brightness of the surroundings, which depends on where in an element (a
   stone, a leaf) a texel lies. So cuts and searches do not join parts of different elements just
   because they have the same colour. */
static txm_status txt_fill_surroundings(txt_build *b, int f) {
    for (int e = 0; e < b->sheet_count; e++) {
        const txt_sheet *s = &b->sheets[e];
        const int n = s->width * s->height, r = TXT_SURROUNDINGS;
        int32_t *gray = (int32_t *)txm_alloc(b->env, (size_t)n * 2 * sizeof(int32_t));
        if (!gray) return txm_fail(b->env, TXM_OUT_OF_MEMORY, "no memory for the exemplars");
        int32_t *row = gray + n;
        const int colors = b->set->maps[0].channels < 3 ? 1 : 3;
        double mean = 0;
        for (int t = 0; t < n; t++) {
            const uint8_t *p = b->texel + ((size_t)s->first + (size_t)t) * (size_t)b->stride;
            gray[t] = 0;
            for (int c = 0; c < colors; c++) gray[t] += p[c];
            gray[t] = gray[t] * 16 / colors;
            mean += gray[t];
        }
        mean /= n;
        for (int pass = 0; pass < 2; pass++) { /* two boxes make a tent */
            for (int y = 0; y < s->height; y++) {
                for (int x = 0; x < s->width; x++) {
                    int32_t sum = 0;
                    for (int k = -r; k <= r; k++)
                        sum += gray[y * s->width + txm_clampi(x + k, 0, s->width - 1)];
                    row[y * s->width + x] = sum / (2 * r + 1);
                }
            }
            for (int y = 0; y < s->height; y++) {
                for (int x = 0; x < s->width; x++) {
                    int32_t sum = 0;
                    for (int k = -r; k <= r; k++)
                        sum += row[txm_clampi(y + k, 0, s->height - 1) * s->width + x];
                    gray[y * s->width + x] = sum / (2 * r + 1);
                }
            }
        }
        for (int t = 0; t < n; t++)
            b->texel[((size_t)s->first + (size_t)t) * (size_t)b->stride + (size_t)f] =
                (uint8_t)txm_clampi((int)(128 + (gray[t] - mean) * TXT_SURROUND_GAIN / 16), 0, 255);
        txm_free(b->env, gray);
    }
    return TXM_OK;
}

static txm_status txt_fill_features(txt_build *b) {
    for (int f = 0; f < b->features; f++) {
        const int m = b->feature_map[f], c = b->feature_channel[f];
        if (m < 0) return txt_fill_surroundings(b, f);
        const int n = b->set->maps[m].channels;
        double low = 0, high = 1;
        if (b->set->maps[m].sample == TXM_F32) {
            low = DBL_MAX;
            high = -DBL_MAX;
            for (int e = 0; e < b->sheet_count; e++) {
                const txm_image *im = &b->sheets[e].maps[m];
                for (int y = 0; y < im->height; y++) {
                    for (int x = 0; x < im->width; x++) {
                        const double v = txm_image_get(im, x, y, c);
                        low = fmin(low, v);
                        high = fmax(high, v);
                    }
                }
            }
        }
        const double scale = (m ? 127.5 : 255.0) / (high > low ? high - low : 1);
        for (int e = 0; e < b->sheet_count; e++) {
            const txm_image *im = &b->sheets[e].maps[m];
            uint8_t *to = b->texel + (size_t)b->sheets[e].first * (size_t)b->stride + f;
            for (int y = 0; y < im->height; y++) {
                for (int x = 0; x < im->width; x++, to += b->stride) {
                    double v = (txm_image_get(im, x, y, c) - low) * scale;
                    if (b->set->maps[m].has_alpha && c + 1 < n)
                        v *= txm_clampf(txm_image_get(im, x, y, n - 1), 0, 1);
                    *to = (uint8_t)txm_clampi((int)(v + 0.5), 0, 255);
                }
            }
        }
    }
    return TXM_OK;
}

/* Planes of the features, each texel averaged with its neighbours: searches compare only a part of
   the texels, and noise in single ones must not decide. */
static void txt_fill_planes(txt_build *b) {
    for (int e = 0; e < b->sheet_count; e++) {
        const txt_sheet *s = &b->sheets[e];
        for (int y = 0; y < s->height; y++) {
            for (int x = 0; x < s->width; x++) {
                int sum[TXT_MAX_FEATURES] = {0}, n = 0;
                for (int dy = -1; dy <= 1; dy++) {
                    for (int dx = -1; dx <= 1; dx++) {
                        if (x + dx < 0 || x + dx >= s->width || y + dy < 0 || y + dy >= s->height)
                            continue;
                        const uint8_t *p = b->texel + (size_t)(s->first + (y + dy) * s->width +
                                                               x + dx) * (size_t)b->stride;
                        for (int f = 0; f < b->features; f++) sum[f] += p[f];
                        n++;
                    }
                }
                const size_t t = (size_t)(s->first + y * s->width + x);
                for (int f = 0; f < b->features; f++)
                    b->plane[(size_t)f * b->texels + t] = (uint8_t)((sum[f] + n / 2) / n);
            }
        }
    }
}

/* Sums of a value along the lines of an axis: value(b, which, sheet, x, y) at (x, y) as stored. */
static void txt_sum_lines(txt_build *b, txt_line *line, int axis, int which,
                          int (*value)(const txt_build *b, int which, int sheet, int x, int y)) {
    double total = 0, count = 0;
    for (int e = 0; e < b->sheet_count; e++) {
        const txt_sheet *s = &b->sheets[e];
        const int lines = axis ? s->width : s->height, length = axis ? s->height : s->width;
        for (int l = 0; l < lines; l++) {
            uint32_t sum = 0;
            for (int k = 0; k < length; k++) {
                const int x = axis ? l : k, y = axis ? k : l;
                const int v = value(b, which, e, x, y);
                if (v >= 0) {
                    total += v;
                    count += 1;
                    sum += (uint32_t)v;
                }
                line->sum[s->first + y * s->width + x] = sum;
            }
        }
    }
    line->mean = count > 0 ? total / count : 0;
}

/* Mean of a line's value over n texels from storage place (x, y) on, in units of the mean over all;
   what lies beyond the sheet is left out. */
static double txt_line_mean(const txt_build *b, const txt_line *line, int axis, int sheet, int x,
                            int y, int n) {
    const txt_sheet *s = &b->sheets[sheet];
    int from = (axis ? y : x) - 1, to = from + n;
    const int length = axis ? s->height : s->width, other = axis ? x : y;
    if (from < 0) from = 0;
    if (to >= length) to = length - 1;
    if (to <= from || other < 0 || other >= (axis ? s->width : s->height) || line->mean <= 0)
        return 1;
    const size_t first = (size_t)s->first;
    const size_t p = axis ? (size_t)from * (size_t)s->width + (size_t)other
                          : (size_t)other * (size_t)s->width + (size_t)from;
    const size_t q = axis ? (size_t)to * (size_t)s->width + (size_t)other
                          : (size_t)other * (size_t)s->width + (size_t)to;
    return (double)(line->sum[first + q] - line->sum[first + p]) / (to - from) / line->mean;
}

/* The difference of two texels as textiles_measure has it: the channels of the first map only. */
static int txt_step(const txt_build *b, int32_t s, int32_t t) {
    const uint8_t *p = b->texel + (size_t)s * (size_t)b->stride;
    const uint8_t *q = b->texel + (size_t)t * (size_t)b->stride;
    int sum = 0;
    for (int c = 0; c < b->set->maps[0].channels; c++) sum += abs(p[c] - q[c]);
    return 4 * sum;
}

/* Step across a joint that runs along the axis: for squares of the two pixels on either side,
   for triangles of an edge texel and the four beside it. First map only; -1 at the border. */
static int txt_cross_value(const txt_build *b, int axis, int sheet, int x, int y) {
    const txt_sheet *s = &b->sheets[sheet];
    const int32_t t = s->first + y * s->width + x;
    if (!b->is_triangle) {
        if (axis ? x == 0 : y == 0) return -1;
        return txt_step(b, t, t - (axis ? 1 : s->width));
    }
    const int odd = y & 1, left = x - 1 + odd;
    if (y == 0 || y + 1 >= s->height || left < 0 || left + 1 >= s->width) return -1;
    int sum = 0;
    for (int k = 0; k < 2; k++) {
        sum += txt_step(b, t, s->first + (y - 1) * s->width + left + k);
        sum += txt_step(b, t, s->first + (y + 1) * s->width + left + k);
    }
    return sum / 4;
}

/* Step along a line of the axis; -1 at its start. */
static int txt_along_value(const txt_build *b, int axis, int sheet, int x, int y) {
    const txt_sheet *s = &b->sheets[sheet];
    const int32_t t = s->first + y * s->width + x;
    if (axis ? y == 0 : x == 0) return -1;
    return txt_step(b, t, t - (axis ? s->width : 1));
}

static int txt_color_value(const txt_build *b, int channel, int sheet, int x, int y) {
    const txt_sheet *s = &b->sheets[sheet];
    return b->texel[(size_t)(s->first + y * s->width + x) * (size_t)b->stride + (size_t)channel];
}

/* salience as far as it exceeds 28, where 16 is the mean */
static int txt_salience_value(const txt_build *b, int axis, int sheet, int x, int y) {
    (void)axis;
    const txt_sheet *s = &b->sheets[sheet];
    const int v = b->salient[s->first + y * s->width + x];
    return v > 28 ? v - 28 : 0;
}

/* Salience: the squared deviation from the mean colour in units of the variance, mean 16, averaged
   over a neighbourhood. Rare elements far from the mean, a white stone for example, are conspicuous
   where they repeat. */
static txm_status txt_fill_salience(txt_build *b) {
    double mean[TXT_MAX_FEATURES] = {0}, variance[TXT_MAX_FEATURES] = {0};
    for (size_t t = 0; t < b->texels; t++) {
        for (int f = 0; f < b->features; f++) {
            const double v = b->texel[t * (size_t)b->stride + (size_t)f];
            mean[f] += v;
            variance[f] += v * v;
        }
    }
    double total = 0;
    for (int f = 0; f < b->features; f++) {
        mean[f] /= (double)b->texels;
        total += variance[f] / (double)b->texels - mean[f] * mean[f];
    }
    if (total < 1) total = 1;
    enum { REACH = 3 };
    for (int e = 0; e < b->sheet_count; e++) {
        const txt_sheet *s = &b->sheets[e];
        const size_t n = (size_t)s->width * (size_t)s->height;
        float *row = (float *)txm_alloc(b->env, 2 * n * sizeof(float));
        if (!row) return txm_fail(b->env, TXM_OUT_OF_MEMORY, "no memory for the exemplars");
        float *raw = row + n;
        for (size_t t = 0; t < n; t++) {
            double z = 0;
            const uint8_t *p = b->texel + ((size_t)s->first + t) * (size_t)b->stride;
            for (int f = 0; f < b->features; f++) z += (p[f] - mean[f]) * (p[f] - mean[f]);
            raw[t] = txm_float(fmin(16 * z / total, 160));
        }
        for (int y = 0; y < s->height; y++) {
            for (int x = 0; x < s->width; x++) {
                double sum = 0;
                for (int k = -REACH; k <= REACH; k++)
                    sum += raw[y * s->width + txm_clampi(x + k, 0, s->width - 1)];
                row[y * s->width + x] = txm_float(sum);
            }
        }
        for (int y = 0; y < s->height; y++) {
            for (int x = 0; x < s->width; x++) {
                double sum = 0;
                for (int k = -REACH; k <= REACH; k++)
                    sum += row[txm_clampi(y + k, 0, s->height - 1) * s->width + x];
                sum /= (2 * REACH + 1) * (2 * REACH + 1);
                b->salient[s->first + y * s->width + x] = (uint8_t)txm_clampi((int)sum, 0, 255);
            }
        }
        txm_free(b->env, row);
    }
    return TXM_OK;
}

/* Traits of one texel; 0 for steps at the border and for channels that the map does not have. */
static void txt_texel_traits(const txt_build *b, int32_t t, double traits[TXT_TRAITS]) {
    const int e = txt_sheet_of(b->set, t);
    const txt_sheet *s = &b->sheets[e];
    const int at = t - s->first, x = at % s->width, y = at / s->width;
    for (int k = 0; k < TXT_TRAITS; k++) traits[k] = 0;
    for (int c = 0; c < b->set->maps[0].channels; c++) traits[c] = txt_color_value(b, c, e, x, y);
    const double scale = 60 / (b->step_mean > 0 ? b->step_mean : 1);
    if (x) traits[TXT_STEP] = scale * txt_step(b, t, t - 1);
    if (y) traits[TXT_STEP + 1] = scale * txt_step(b, t, t - s->width);
    traits[TXT_VARIANCE] = b->salient[t] * (20 / 16.0);
}

/* Sums of the traits over cells above and to the left, and their means. */
static void txt_fill_traits(txt_build *b) {
    double sum = 0;
    for (int e = 0; e < b->sheet_count; e++) {
        const txt_sheet *s = &b->sheets[e];
        for (int y = 1; y < s->height; y++) {
            for (int x = 1; x < s->width; x++) {
                const int32_t t = s->first + y * s->width + x;
                sum += txt_step(b, t, t - 1) + txt_step(b, t, t - s->width);
            }
        }
    }
    b->step_mean = sum / (double)b->texels;
    for (int e = 0; e < b->sheet_count; e++) {
        const txt_sheet *s = &b->sheets[e];
        const int across = s->width / TXT_CELL + 2, down = s->height / TXT_CELL + 2;
        for (int y = 0; y < s->height; y++) {
            for (int x = 0; x < s->width; x++) {
                double one[TXT_TRAITS];
                double *cell =
                    b->traits[e] + ((y / TXT_CELL + 1) * across + x / TXT_CELL + 1) * TXT_TRAITS;
                txt_texel_traits(b, s->first + y * s->width + x, one);
                for (int k = 0; k < TXT_TRAITS; k++) {
                    cell[k] += one[k] / (TXT_CELL * TXT_CELL);
                    b->usual[k] += one[k] / (double)b->texels;
                }
            }
        }
        for (int y = 1; y < down; y++) {
            double row[TXT_TRAITS] = {0};
            for (int x = 1; x < across; x++) {
                double *cell = b->traits[e] + (y * across + x) * TXT_TRAITS;
                for (int k = 0; k < TXT_TRAITS; k++) {
                    row[k] += cell[k];
                    cell[k] = cell[k - across * TXT_TRAITS] + row[k];
                }
            }
        }
    }
}

/* Everything that is computed once from the exemplars. */
static txm_status txt_prepare(txt_build *b) {
    txt_list_features(b);
    txm_status status = txt_make_sheets(b);
    if (status != TXM_OK) return status;
    b->texel = (uint8_t *)txm_arena_zero(&b->arena, b->texels, (size_t)b->stride);
    b->plane = (uint8_t *)txm_arena_zero(&b->arena, b->texels * (size_t)b->features + TXT_LANES, 1);
    b->salient = (uint8_t *)txm_arena_alloc(&b->arena, b->texels, 1);
    const int axes = b->is_triangle ? 1 : 2;
    for (int a = 0; a < axes; a++) {
        b->cross[a].sum = (uint32_t *)txm_arena_alloc(&b->arena, b->texels, sizeof(uint32_t));
        b->salience[a].sum = (uint32_t *)txm_arena_alloc(&b->arena, b->texels, sizeof(uint32_t));
        b->line_cost[a] = (uint16_t *)txm_arena_alloc(&b->arena, b->texels, sizeof(uint16_t));
        b->along[a].sum = (uint32_t *)txm_arena_alloc(&b->arena, b->texels, sizeof(uint32_t));
        for (int c = 0; c < b->set->maps[0].channels; c++)
            b->color[a][c].sum =
                (uint32_t *)txm_arena_alloc(&b->arena, b->texels, sizeof(uint32_t));
    }
    for (int e = 0; e < b->sheet_count; e++) {
        const txt_sheet *s = &b->sheets[e];
        const size_t cells = ((size_t)s->width / TXT_CELL + 2) * ((size_t)s->height / TXT_CELL + 2);
        b->use[e] = (uint32_t *)txm_arena_zero(&b->arena, cells, sizeof(uint32_t));
        b->used[e] = (uint32_t *)txm_arena_zero(&b->arena, cells, sizeof(uint32_t));
        b->traits[e] = (double *)txm_arena_zero(&b->arena, cells, TXT_TRAITS * sizeof(double));
    }
    if (b->arena.failed) return txm_fail(b->env, TXM_OUT_OF_MEMORY, "no memory for the exemplars");
    status = txt_fill_features(b);
    if (status != TXM_OK) return status;
    txt_fill_planes(b);
    status = txt_fill_salience(b);
    if (status != TXM_OK) return status;
    txt_fill_traits(b);
    for (int a = 0; a < axes; a++) {
        txt_sum_lines(b, &b->cross[a], a, a, txt_cross_value);
        txt_sum_lines(b, &b->along[a], a, a, txt_along_value);
        txt_sum_lines(b, &b->salience[a], a, a, txt_salience_value);
        for (int c = 0; c < b->set->maps[0].channels; c++)
            txt_sum_lines(b, &b->color[a][c], a, c, txt_color_value);
    }
    return TXM_OK;
}

/* ---- searching the exemplars ------------------------------------------------------------- */

enum {
    TXT_POSITIONS = 1 << 17, /* places of one exemplar looked at in one search, about          */
    TXT_SAMPLES = 2048    /* texels compared at one place of a search, at most                 */
};

/* A texel that a piece should show, and its offset from the place of the piece, turned already. */
typedef struct txt_sample {
    int i, j;
    uint8_t value[TXT_MAX_FEATURES]; /* blurred */
} txt_sample;

/* What to search for: samples to match, and additional costs of a place. */
typedef struct txt_query {
    txt_sample *samples;
    int count, capacity;
    /* add to cost[0..n-1] for the places (i, j), (i + 1, j) ... of a sheet; NULL: nothing */
    void (*extra)(const void *context, int sheet, int i, int j, int n, uint32_t *cost);
    const void *context;
    int apart;  /* places closer than this count as one */
    int coarse; /* look at one row in so many more      */
    int need[4][2], need_count; /* texels that must lie in the sheet besides the samples */
} txt_query;

/* memory of one search at a time */
typedef struct txt_scratch {
    uint32_t *sum32; /* costs of a row of places                             */
    size_t *starts;  /* where the samples of the row's first place lie       */
    txm_pair *pairs, *spare; /* best place of each piece of a row       */
    txt_place *places;
    int capacity;
} txt_scratch;

enum { TXT_RUN = 16 }; /* places of a row of which only the best is kept */

static void txt_sample_add(const txt_build *b, txt_query *q, int i, int j, int32_t shows) {
    if (q->count == q->capacity || shows < 0) return;
    txt_sample *s = &q->samples[q->count++];
    s->i = i;
    s->j = j;
    for (int f = 0; f < b->features && f < TXT_MAX_FEATURES; f++)
        s->value[f] = b->plane[(size_t)f * b->texels + (size_t)shows];
}

/* The range of i for which all samples of places (i, j) lie in the sheet; 0: none. */
static int txt_row_range(const txt_build *b, const txt_query *q, int sheet, int j, int *from,
                         int *to) {
    const txt_sheet *s = &b->sheets[sheet];
    int low = INT_MIN / 2, high = INT_MAX / 2;
    for (int k = 0; k < q->count; k++) {
        const int row = j + q->samples[k].j;
        if (row < 0 || row >= s->height) return 0;
        const int shift = q->samples[k].i + (b->is_triangle ? txt_half(row) : 0);
        if (-shift > low) low = -shift;
        if (s->width - shift < high) high = s->width - shift;
    }
    for (int k = 0; k < q->need_count; k++) {
        const int row = j + q->need[k][1];
        if (row < 0 || row >= s->height) return 0;
        const int shift = q->need[k][0] + (b->is_triangle ? txt_half(row) : 0);
        if (-shift > low) low = -shift;
        if (s->width - shift < high) high = s->width - shift;
    }
    *from = low;
    *to = high;
    return high > low;
}

/* Sums of the differences of samples first..last-1 at TXT_LANES places side by side, added to sum.
   One group has at most 256 differences, so that 16 bits suffice. */
#ifdef TXT_AVX2
__attribute__((target("avx2"))) static void txt_add_lanes_avx2(const txt_build *b,
                                                               const txt_query *q,
                                                               const size_t *starts, int first,
                                                               int last, int at, uint32_t *sum) {
    const __m256i zero = _mm256_setzero_si256();
    __m256i low = zero, high = zero; /* places 0-7 and 16-23, 8-15 and 24-31 */
    for (int k = first; k < last; k++) {
        const uint8_t *line = b->plane + starts[k] + at;
        for (int f = 0; f < b->features; f++, line += b->texels) {
            const __m256i want = _mm256_set1_epi8((char)q->samples[k].value[f]);
            const __m256i v = _mm256_loadu_si256((const __m256i *)(const void *)line);
            const __m256i d = _mm256_or_si256(_mm256_subs_epu8(v, want), _mm256_subs_epu8(want, v));
            low = _mm256_add_epi16(low, _mm256_unpacklo_epi8(d, zero));
            high = _mm256_add_epi16(high, _mm256_unpackhi_epi8(d, zero));
        }
    }
    uint16_t sums[TXT_LANES];
    _mm256_storeu_si256((__m256i *)(void *)sums, low);
    _mm256_storeu_si256((__m256i *)(void *)(sums + 16), high);
    for (int i = 0; i < TXT_LANES; i++) sum[i] += sums[(i & 7) | (i & 16) >> 1 | (i & 8) << 1];
}
#endif

static void txt_add_lanes(const txt_build *b, const txt_query *q, const size_t *starts, int first,
                          int last, int at, uint32_t *sum) {
#ifdef TXT_SSE2
    const __m128i zero = _mm_setzero_si128();
    __m128i sums[4] = {zero, zero, zero, zero};
    for (int k = first; k < last; k++) {
        const uint8_t *line = b->plane + starts[k] + at;
        for (int f = 0; f < b->features; f++, line += b->texels) {
            const __m128i want = _mm_set1_epi8((char)q->samples[k].value[f]);
            for (int h = 0; h < 2; h++) {
                const __m128i v = _mm_loadu_si128((const __m128i *)(const void *)(line + 16 * h));
                const __m128i d = _mm_or_si128(_mm_subs_epu8(v, want), _mm_subs_epu8(want, v));
                sums[2 * h] = _mm_add_epi16(sums[2 * h], _mm_unpacklo_epi8(d, zero));
                sums[2 * h + 1] = _mm_add_epi16(sums[2 * h + 1], _mm_unpackhi_epi8(d, zero));
            }
        }
    }
    for (int h = 0; h < 4; h++) {
        __m128i *to = (__m128i *)(void *)(sum + 8 * h);
        const __m128i low = _mm_unpacklo_epi16(sums[h], zero);
        const __m128i high = _mm_unpackhi_epi16(sums[h], zero);
        _mm_storeu_si128(to, _mm_add_epi32(_mm_loadu_si128(to), low));
        _mm_storeu_si128(to + 1, _mm_add_epi32(_mm_loadu_si128(to + 1), high));
    }
#else
    uint16_t sums[TXT_LANES] = {0};
    for (int k = first; k < last; k++) {
        const uint8_t *line = b->plane + starts[k] + at;
        for (int f = 0; f < b->features; f++, line += b->texels) {
            const uint8_t want = q->samples[k].value[f];
            for (int i = 0; i < TXT_LANES; i++) {
                const uint8_t v = line[i];
                sums[i] = (uint16_t)(sums[i] + ((v > want ? v : want) - (v > want ? want : v)));
            }
        }
    }
    for (int i = 0; i < TXT_LANES; i++) sum[i] += sums[i];
#endif
}

/* Costs of the places (from, j) .. (from + n - 1, j). The planes end in TXT_LANES spare bytes, so
   that whole groups of lanes can be read; results beyond n are ignored. */
static void txt_row_costs(const txt_build *b, const txt_query *q, int sheet, int j, int from, int n,
                          txt_scratch *m) {
    const txt_sheet *s = &b->sheets[sheet];
    const int group = 256 / b->features;
    const int lanes = (n + TXT_LANES - 1) / TXT_LANES * TXT_LANES;
    memset(m->sum32, 0, (size_t)lanes * sizeof(uint32_t));
    for (int k = 0; k < q->count; k++) {
        const int row = j + q->samples[k].j;
        const int column = from + q->samples[k].i + (b->is_triangle ? txt_half(row) : 0);
        m->starts[k] = (size_t)(s->first + row * s->width + column);
    }
    void (*add)(const txt_build *, const txt_query *, const size_t *, int, int, int, uint32_t *) =
        txt_add_lanes;
#ifdef TXT_AVX2
    if (__builtin_cpu_supports("avx2")) add = txt_add_lanes_avx2;
#endif
    for (int i = 0; i < lanes; i += TXT_LANES) {
        for (int k = 0; k < q->count; k += group)
            add(b, q, m->starts, k, k + group < q->count ? k + group : q->count, i, m->sum32 + i);
    }
    const uint32_t parts = (uint32_t)(q->count * b->features);
    for (int i = 0; i < n; i++) m->sum32[i] = m->sum32[i] * TXT_SCALE / parts;
    if (q->extra) q->extra(q->context, sheet, from, j, n, m->sum32);
}

/* The best places of one sheet, cheapest first, at least q->apart from each other: appended to
   best[], which keeps the cheapest of most. Tries every second row or fewer, then the rows left out
   next to what it found. */
static int txt_search(const txt_build *b, const txt_query *q, int sheet, int turn, txt_scratch *m,
                      txt_place *best, int count, int most) {
    const txt_sheet *s = &b->sheets[sheet];
    int top = INT_MAX, bottom = INT_MIN, found = 0, from, to;
    if (q->count == 0) return count;
    for (int k = 0; k < q->count; k++) {
        if (q->samples[k].j < top) top = q->samples[k].j;
        if (q->samples[k].j > bottom) bottom = q->samples[k].j;
    }
    const int rows = s->height - (bottom - top);
    if (rows < 1) return count;
    int step = (int)((int64_t)rows * s->width / TXT_POSITIONS) + 1;
    if (step < 2) step = rows > 8 ? 2 : 1;
    step += q->coarse;
    for (int j = -top; j + bottom < s->height; j += step) {
        if (!txt_row_range(b, q, sheet, j, &from, &to)) continue;
        txt_row_costs(b, q, sheet, j, from, to - from, m);
        for (int i = from; i < to; i += TXT_RUN) {
            int at = i;
            for (int k = i + 1; k < to && k < i + TXT_RUN; k++) {
                if (m->sum32[k - from] < m->sum32[at - from]) at = k;
            }
            if (found == m->capacity) break;
            const txt_place place = {sheet, turn, at, j, m->sum32[at - from]};
            m->places[found] = place;
            m->pairs[found].key = place.cost;
            m->pairs[found].value = (uint32_t)found;
            found++;
        }
    }
    txm_sort_pairs(m->pairs, m->spare, (size_t)found);

    int taken = 0;
    for (int k = 0; k < found && taken < most; k++) {
        txt_place p = m->places[m->pairs[k].value];
        for (int j = p.j - step + 1; j < p.j + step && step > 1; j++) { /* rows left out */
            if (j == m->places[m->pairs[k].value].j || !txt_row_range(b, q, sheet, j, &from, &to))
                continue;
            const int low = p.i - 1 > from ? p.i - 1 : from, high = p.i + 2 < to ? p.i + 2 : to;
            if (high <= low) continue;
            txt_row_costs(b, q, sheet, j, low, high - low, m);
            for (int i = low; i < high; i++) {
                if (m->sum32[i - low] >= p.cost) continue;
                p.i = i;
                p.j = j;
                p.cost = m->sum32[i - low];
            }
        }
        int keep = 1;
        for (int c = 0; c < count && keep; c++) {
            keep = best[c].sheet != sheet || best[c].turn != turn ||
                   abs(best[c].i - p.i) >= q->apart || abs(best[c].j - p.j) >= q->apart;
        }
        if (!keep) continue;
        int at = count < most ? count : most - 1;
        if (count == most && best[at].cost <= p.cost) break;
        if (count < most) count++;
        for (; at > 0 && best[at - 1].cost > p.cost; at--) best[at] = best[at - 1];
        best[at] = p;
        taken++;
    }
    return count;
}

/* memory for searches; arena->failed if there is none */
static void txt_scratch_make(const txt_build *b, txm_arena *arena, txt_scratch *m) {
    int width = 0;
    m->capacity = 0;
    for (int e = 0; e < b->sheet_count; e++) {
        const txt_sheet *s = &b->sheets[e];
        /* rows and, of each, pieces; lattice rows shift against each other, thus some more */
        const int n = (s->width / TXT_RUN + 2) * ((int)(TXT_POSITIONS / s->width) + 2) * 2;
        if (s->width > width) width = s->width;
        if (n > m->capacity) m->capacity = n;
    }
    m->sum32 = (uint32_t *)txm_arena_alloc(arena, (size_t)width + TXT_LANES, sizeof(uint32_t));
    m->starts = (size_t *)txm_arena_alloc(arena, TXT_SAMPLES, sizeof(size_t));
    m->pairs = (txm_pair *)txm_arena_alloc(arena, (size_t)m->capacity, 2 * sizeof(txm_pair));
    m->spare = m->pairs ? m->pairs + m->capacity : NULL;
    m->places = (txt_place *)txm_arena_alloc(arena, (size_t)m->capacity, sizeof(txt_place));
}

/* ---- corners and edges ------------------------------------------------------------------- */

enum {
    TXT_LOCK = 2,         /* texels on either side of a joint that all tiles share             */
    TXT_NEAR = 4,         /* texels from the vertex where the piece of a corner may end ...    */
    TXT_FAR = 12,         /* ... and where it must have ended; less in small tiles             */
    TXT_ACROSS = 6,       /* half width of the strip in which such a cut is sought             */
    TXT_CORNERS = 160,    /* random places that are rated for each corner                      */
    TXT_SAME_PLACE = 300  /* gray levels for a strip that another colour shows already         */
};
#define TXT_END 8             /* texels of a joint that show the corner, about; less in small tiles */

static int txt_near(const txt_build *b) {
    return b->set->size / 8 < TXT_NEAR ? b->set->size / 8 : TXT_NEAR;
}

static int txt_end(const txt_build *b) {
    return b->set->size / 4 < TXT_END ? b->set->size / 4 : TXT_END;
}

static int txt_zone_end(const txt_build *b) {
    return b->set->size / 4 < TXT_FAR ? b->set->size / 4 : TXT_FAR;
}

/* Strip coordinates (a, u) as a shift on the sheet. */
static void txt_along(const txt_build *b, int axis, int a, int u, int *i, int *j) {
    if (b->is_triangle) { /* a counts from where row u meets the joint's normal, roughly */
        *i = a - txt_half(u);
        *j = u;
    } else {
        *i = axis ? u : a;
        *j = axis ? a : u;
    }
}

/* What a strip shows at (a, u) by piece w of it (0 and count + 1: the corners). */
static int32_t txt_strip_shows(const txt_build *b, const txt_seam_strip *s, int w, int a, int u) {
    int i, j, sheet, si, sj;
    if (w >= 1 && w <= s->count) {
        sheet = s->segment[w - 1].sheet;
        si = s->segment[w - 1].i;
        sj = s->segment[w - 1].j;
        txt_along(b, s->axis, a, u, &i, &j);
    } else { /* a corner: its vertex lies at the end of the strip */
        const int c = s->corner[w != 0];
        sheet = b->corner[c].sheet;
        si = b->corner[c].i;
        sj = b->corner[c].j;
        txt_along(b, s->axis, w ? a - b->set->size : a, u, &i, &j);
        if (b->is_triangle && w) { /* seen from the other end */
            i = -i;
            j = -j;
        }
    }
    return txt_number(b, sheet, si + i, sj + j);
}

/* The cost of a line of texels as a joint, in search units. A good joint has typical roughness,
   across (the most visible) and along, typical colour, and nothing conspicuous on it. The weights,
   in gray levels, are ours, found by measuring and by eye. */
static int txt_line_cost(const txt_build *b, int axis, double wanted, int sheet, int x, int y,
                         int n) {
    const double step = txt_line_mean(b, &b->cross[axis], axis, sheet, x, y, n) / wanted;
    const double salience = txt_line_mean(b, &b->salience[axis], axis, sheet, x, y, n);
    const double along = txt_line_mean(b, &b->along[axis], axis, sheet, x, y, n);
    const double off = fabs(step - 1), excess = salience - 1;
    double cost = 100 * off + (off > 0.05 ? 200 * (off - 0.05) : 0) + 20 * fabs(along - 1);
    if (excess > 0) cost += 6 * excess;
    for (int c = 0; c < b->set->maps[0].channels; c++) {
        const double color = txt_line_mean(b, &b->color[axis][c], axis, sheet, x, y, n);
        cost += 0.7 * b->color[axis][c].mean * fabs(color - 1) / b->set->maps[0].channels;
    }
    return (int)fmin(cost * TXT_SCALE, 65535);
}

/* A table of these costs for lines of n texels from every texel on. */
static void txt_fill_line_costs(txt_build *b, int axis, int n, double wanted) {
    if (b->line_length[axis] == n && fabs(b->line_step[axis] - wanted) < 0.002) return;
    b->line_length[axis] = n;
    b->line_step[axis] = wanted;
    for (int e = 0; e < b->sheet_count; e++) {
        const txt_sheet *s = &b->sheets[e];
        for (int y = 0; y < s->height; y++) {
            for (int x = 0; x < s->width; x++)
                b->line_cost[axis][s->first + y * s->width + x] =
                    (uint16_t)txt_line_cost(b, axis, wanted, e, x, y, n);
        }
    }
}

/* The extra cost of the places of a row for a segment over a = from to from + length. */
typedef struct txt_strip_query {
    const txt_build *b;
    const txt_seam_strip *strips; /* those of the same axis so far */
    int strip_count, axis, from, length;
} txt_strip_query;

static void txt_strip_extra(const void *context, int sheet, int i, int j, int n, uint32_t *cost) {
    const txt_strip_query *q = (const txt_strip_query *)context;
    const txt_build *b = q->b;
    int di, dj;
    txt_along(b, q->axis, q->from, 0, &di, &dj);
    for (int k = 0; k < n; k++) {
        const int y = j + dj, x = i + k + di + (b->is_triangle ? txt_half(y) : 0);
        const txt_sheet *in = &b->sheets[sheet];
        cost[k] += b->line_cost[q->axis][in->first + txm_clampi(y, 0, in->height - 1) * in->width +
                                         txm_clampi(x, 0, in->width - 1)];
        for (int s = 0; s < q->strip_count; s++) { /* keep away from the other strips */
            const txt_seam_strip *other = &q->strips[s];
            if (other->axis != q->axis) continue;
            for (int g = 0; g < other->count; g++) {
                if (other->segment[g].sheet != sheet) continue;
                int oi = other->segment[g].i, oj = other->segment[g].j;
                int across = q->axis ? abs(oi - (i + k)) : abs(oj - j);
                int along = q->axis ? abs(oj - j) : abs(oi + txt_half(oj * b->is_triangle) -
                                                        (i + k + txt_half(j * b->is_triangle)));
                if (across == 0 && along == 0) cost[k] += TXT_SAME_PLACE * TXT_SCALE;
                if (across < 16 && along < q->length)
                    cost[k] += (uint32_t)((16 - across) * (q->length - along) * 30 / q->length *
                                          TXT_SCALE / 16);
            }
        }
    }
}

/* Samples at the ends of segment w. at_start: what the segment before shows around a = from, for
   the first segment the corner; at_end: what the corner at the end of the strip shows. */
static void txt_end_samples(const txt_build *b, txt_query *q, const txt_seam_strip *s, int w, int from,
                            int at_start, int at_end) {
    const int size = b->set->size, zone = txt_zone_end(b) + 1;
    q->count = 0;
    for (int u = -6; u <= 6; u += 2) {
        for (int k = 0; k < zone; k += 2) {
            int i, j;
            if (at_start) {
                int a = from + k;
                if (w > 1) a -= zone / 2; /* the overlap with the segment before */
                else if (!b->is_triangle) a += txt_near(b) - 1;
                txt_along(b, s->axis, a, u, &i, &j);
                if (!b->is_triangle || w > 1 || k <= 6)
                    txt_sample_add(b, q, i, j, txt_strip_shows(b, s, w - 1, a, u));
            }
            if (at_end) {
                int a = size - k;
                if (!b->is_triangle) a -= txt_near(b) - 1;
                txt_along(b, s->axis, a, u, &i, &j);
                if (!b->is_triangle || k <= 6)
                    txt_sample_add(b, q, i, j, txt_strip_shows(b, s, s->count + 1, a, u));
            }
        }
    }
}

/* number of segments of a strip, each so short that a sheet has several places for it */
static int txt_segment_count(const txt_build *b, int axis, int only_sheet) {
    int length = 0;
    for (int e = 0; e < b->sheet_count; e++) {
        const int l = axis ? b->sheets[e].height : b->sheets[e].width;
        if ((only_sheet < 0 || e == only_sheet) && l > length) length = l;
    }
    const int size = b->set->size;
    if (size + 24 <= length) return 1;
    int count = (size + 2 * TXT_FAR) / (length * 3 / 5 > 12 ? length * 3 / 5 : 12) + 1;
    return count > TXT_MAX_SEGMENTS ? TXT_MAX_SEGMENTS : count;
}

/* The mean step that a strip should have between its ends, TXT_END texels each that show the
   corners, so that the whole joint has b->wanted_step. */
static double txt_wanted_step(const txt_build *b, const txt_seam_strip *s) {
    const int size = b->set->size, axis = s->axis, length = txt_end(b);
    double ends = 0;
    if (b->is_triangle || !b->corners_are_final) return b->wanted_step;
    for (int end = 0; end < 2; end++) {
        const int c = s->corner[end], back = end ? length : 0;
        ends += txt_line_mean(b, &b->cross[axis], axis, b->corner[c].sheet,
                              b->corner[c].i - (axis ? 0 : back),
                              b->corner[c].j - (axis ? back : 0), length);
    }
    const double rest = (b->wanted_step * size - length * ends) / (size - 2 * length);
    return fmin(fmax(rest, 0.75), 1.25);
}

/* Choose the segments of a strip one after the other. Returns the cost, or UINT32_MAX if nothing
   fits. only_sheet: -1 = any. */
static uint32_t txt_choose_strip(txt_build *b, txt_seam_strip *s, const txt_seam_strip *others,
                                 int other_count, int only_sheet, txt_query *q, txt_scratch *m) {
    const int size = b->set->size;
    const int count = txt_segment_count(b, s->axis, only_sheet);
    uint32_t total = 0;
    s->count = count;
    for (int g = 0; g < count; g++) {
        const int from = g * size / count, to = (g + 1) * size / count;
        const int ends = count == 1 && !b->is_triangle ? txt_end(b) : 0;
        txt_strip_query extra = {b, others, other_count, s->axis, from + ends, to - from - 2 * ends};
        txt_place best;
        int found = 0;
        txt_fill_line_costs(b, s->axis, size / count - 2 * ends, txt_wanted_step(b, s));
        q->extra = txt_strip_extra;
        /* cppcheck-suppress autoVariables ; used in this round only */
        q->context = &extra;
        q->apart = 1;
        txt_end_samples(b, q, s, g + 1, from, 1, g + 1 == count);
        for (int k = 0; k < 4; k++) { /* it must cover its part and overlap the next ones */
            const int first = g ? from - 7 : b->is_triangle ? 0 : txt_near(b);
            const int last = g + 1 < count ? to + 7 : b->is_triangle ? size : size - txt_near(b);
            txt_along(b, s->axis, k & 1 ? last : first, k & 2 ? TXT_LOCK : -TXT_LOCK,
                      &q->need[k][0], &q->need[k][1]);
        }
        q->need_count = 4;
        for (int e = 0; e < b->sheet_count; e++) {
            if (only_sheet < 0 || e == only_sheet)
                found = txt_search(b, q, e, 0, m, &best, found, 1);
        }
        if (!found) return UINT32_MAX;
        s->segment[g].sheet = best.sheet;
        s->segment[g].i = best.i;
        s->segment[g].j = best.j;
        total += best.cost;
    }
    return total / (uint32_t)count;
}

/* Where piece w of a strip ends and the next begins, line by line across the strip: the minimum
   error cut [2] through a = from..to-1. */
static void txt_cut_strip(const txt_build *b, txt_seam_strip *s, int w, int from, int to) {
    enum { LINES = 2 * TXT_ACROSS + 1 };
    float error[LINES * 64];
    double scratch[LINES * 64];
    int path[LINES];
    const int size = b->set->size, length = size + b->is_triangle;
    if (to - from > 64) to = from + 64;
    const int width = to - from;
    for (int l = 0; l < LINES; l++) {
        const int u = l - TXT_ACROSS;
        int before = txt_difference(b, txt_strip_shows(b, s, w, from, u),
                                    txt_strip_shows(b, s, w + 1, from, u));
        for (int k = 0; k < width; k++) {
            const int a = from + k + 1;
            const int after = txt_difference(b, txt_strip_shows(b, s, w, a, u),
                                             txt_strip_shows(b, s, w + 1, a, u));
            error[l * width + k] = (float)((before + after) * (before + after));
            before = after;
        }
    }
    txm_cut(error, LINES, width, width, 1, path, scratch);
    for (int l = 0; l < b->lock_count; l++) {
        const int turn = from + path[b->lock_from + l + TXT_ACROSS];
        for (int a = turn + 1; a < length; a++) s->which[a * b->lock_count + l] = (uint8_t)(w + 1);
    }
}

/* Cut all pieces of a strip, and note which of them each texel shows. */
static void txt_finish_strip(const txt_build *b, txt_seam_strip *s) {
    const int size = b->set->size, n = b->lock_count, zone = txt_zone_end(b), nearest = txt_near(b);
    if (b->is_triangle) {
        memset(s->which, 1, (size_t)(size + 1) * (size_t)n);
        for (int g = 1; g < s->count; g++)
            txt_cut_strip(b, s, g, g * size / s->count - 6, g * size / s->count + 6);
        s->which[-b->lock_from] = 0; /* the vertices themselves belong to all strips */
        s->which[size * n - b->lock_from] = (uint8_t)(s->count + 1);
        return;
    }
    memset(s->which, 0, (size_t)size * (size_t)n);
    txt_cut_strip(b, s, 0, nearest, zone);
    for (int g = 1; g < s->count; g++)
        txt_cut_strip(b, s, g, g * size / s->count - 6, g * size / s->count + 6);
    txt_cut_strip(b, s, s->count, size - zone - 1, size - nearest - 1);
}

/* The cost of a place as a corner: how far it is from typical roughness and salience. */
static uint32_t txt_corner_cost(const txt_build *b, int sheet, int i, int j) {
    const int x = i + (b->is_triangle ? txt_half(j) : 0), r = 10;
    double off = 0, excess = 0;
    const int axes = b->is_triangle ? 1 : 2;
    for (int axis = 0; axis < axes; axis++) {
        double step = 0;
        for (int k = -r; k < r; k++) {
            const int px = axis ? x + k : x - r, py = axis ? j - r : j + k;
            step += txt_line_mean(b, &b->cross[axis], axis, sheet, px, py, 2 * r);
            excess += txt_line_mean(b, &b->salience[axis], axis, sheet, px, py, 2 * r) / axes;
        }
        step /= 2 * r;
        off += fabs(step - 1);
        /* and of the joint's own end */
        step = txt_line_mean(b, &b->cross[axis], axis, sheet, axis ? x : x - r, axis ? j - r : j,
                             2 * r);
        off += 0.5 * fabs(step - 1);
    }
    excess = excess / (2 * r) - 1;
    uint32_t cost = (uint32_t)((30 * off + (excess > 0 ? 8 * excess : 0)) * TXT_SCALE);
    if (b->is_triangle) {
        /* the surroundings of the vertex should look the same turned by multiples of 60 degrees */
        int sum = 0, n = 0;
        for (int dj = -4; dj <= 4; dj++) {
            for (int di = -4; di <= 4; di++) {
                if (abs(di + dj) > 4) continue;
                const int32_t here = txt_number(b, sheet, i + di, j + dj);
                for (int turn = 1; turn < 6; turn++) {
                    int ti, tj;
                    txt_turn(turn, di, dj, &ti, &tj);
                    sum += txt_difference(b, here, txt_number(b, sheet, i + ti, j + tj));
                    n++;
                }
            }
        }
        cost += (uint32_t)(sum * (TXT_SCALE / 4) / n);
    }
    return cost;
}

/* the exemplar that edges of a colour are taken from; -1: any */
static int txt_edge_sheet(const txt_build *b, int color) {
    return b->desc->edge_exemplars ? b->desc->edge_exemplars[color] : -1;
}

/* The number of an edge's strip. wang, frame: axis 0 then axis 1, by colour; corner: by axis,
   colour at the start and at the end; triangle: by colour. */
static int txt_strip_index(const txt_build *b, int axis, int color, int end_color) {
    const int c = b->set->colors;
    if (b->set->kind == TEXTILES_CORNER) return (axis * c + color) * c + end_color;
    return axis * c + color;
}

/* Choose all strips for the corners as they are; the sum of the costs. */
static uint64_t txt_choose_strips(txt_build *b, txt_seam_strip *strips, txt_query *q,
                                  txt_scratch *m) {
    const int is_corner = b->set->kind == TEXTILES_CORNER, axes = b->is_triangle ? 1 : 2;
    const int ends = is_corner ? b->corner_count : 1;
    const int colors = is_corner ? b->corner_count : b->set->colors;
    uint64_t total = 0;
    int count = 0;
    txt_seam_strip list[2 * TEXTILES_MAX_COLORS * TEXTILES_MAX_COLORS];
    for (int axis = 0; axis < axes; axis++) {
        for (int c = 0; c < colors; c++) {
            for (int e = 0; e < ends; e++) {
                txt_seam_strip *s = &list[count];
                memset(s, 0, sizeof *s);
                s->axis = axis;
                s->corner[0] = is_corner ? c : 0;
                s->corner[1] = is_corner ? e : 0;
                const uint32_t cost = txt_choose_strip(b, s, list, count,
                                                       is_corner ? -1 : txt_edge_sheet(b, c), q, m);
                if (cost == UINT32_MAX) return UINT64_MAX;
                total += cost;
                if (strips) {
                    txt_seam_strip *to = &strips[txt_strip_index(b, axis, c, e)];
                    s->which = to->which;
                    *to = *s;
                    s->which = NULL;
                }
                count++;
            }
        }
    }
    return count ? total / (uint64_t)count : UINT64_MAX;
}

/* A random place for a corner, far enough from the borders where the sheet is large enough. */
static void txt_random_corner(const txt_build *b, txm_rng *rng, int *sheet, int *i, int *j) {
    *sheet = (int)txm_rng_below(rng, (uint32_t)b->sheet_count);
    const txt_sheet *s = &b->sheets[*sheet];
    const int mx = s->width > 48 ? 16 : s->width / 3, my = s->height > 48 ? 16 : s->height / 3;
    const int x = txm_rng_range(rng, mx, s->width - 1 - mx);
    *j = txm_rng_range(rng, my, s->height - 1 - my);
    *i = x - (b->is_triangle ? txt_half(*j) : 0);
}

/* Choose one more corner: of TXT_CORNERS random places the most typical ones are compared by the
   strips that they lead to. */
static txm_status txt_choose_corner(txt_build *b, txm_rng *rng, txt_query *q, txt_scratch *m) {
    enum { SHORT_LIST = 10 };
    struct {
        int sheet, i, j;
        uint32_t cost;
    } list[SHORT_LIST];
    int count = 0, best = -1;
    uint64_t least = UINT64_MAX;
    const int me = b->corner_count++;
    memset(list, 0, sizeof list);
    for (int k = 0; k < TXT_CORNERS; k++) {
        int sheet, i, j;
        txt_random_corner(b, rng, &sheet, &i, &j);
        int away = 1;
        for (int c = 0; c < me; c++) {
            if (b->corner[c].sheet == sheet && abs(b->corner[c].i - i) < 24 &&
                abs(b->corner[c].j - j) < 24 && k < TXT_CORNERS * 3 / 4)
                away = 0;
        }
        if (!away) continue;
        const uint32_t cost = txt_corner_cost(b, sheet, i, j);
        if (count == SHORT_LIST && list[count - 1].cost <= cost) continue;
        if (count < SHORT_LIST) count++;
        int at = count - 1;
        for (; at > 0 && list[at - 1].cost > cost; at--) list[at] = list[at - 1];
        list[at].sheet = sheet;
        list[at].i = i;
        list[at].j = j;
        list[at].cost = cost;
    }
    for (int k = 0; k < count; k++) {
        b->corner[me].sheet = list[k].sheet;
        b->corner[me].i = list[k].i;
        b->corner[me].j = list[k].j;
        q->coarse = 3;
        uint64_t cost = txt_choose_strips(b, NULL, q, m);
        q->coarse = 0;
        if (cost == UINT64_MAX) continue;
        cost += list[k].cost;
        if (cost < least) {
            least = cost;
            best = k;
        }
        if (txm_progress(b->env, 0.02f + 0.08f * (float)(me * count + k + 1) /
                                             (float)(count * b->set->colors), "edges"))
            return txm_fail(b->env, TXM_CANCELLED, "cancelled while choosing edges");
    }
    if (best < 0)
        return txm_fail(b->env, TXM_TOO_SMALL,
                        "exemplars: too small to cut an edge from; give a larger picture");
    b->corner[me].sheet = list[best].sheet;
    b->corner[me].i = list[best].i;
    b->corner[me].j = list[best].j;
    return TXM_OK;
}

/* Choose the corners, then for each colour the strip at its edges: unmodified exemplar on both
   sides of the joint, which agrees with the corners at its ends and lies apart from the other
   strips. */
static txm_status txt_make_frames(txt_build *b) {
    const int c = b->set->colors, is_corner = b->set->kind == TEXTILES_CORNER;
    const int corners = is_corner ? c : 1, length = b->set->size + b->is_triangle;
    b->lock_from = -TXT_LOCK;
    b->lock_count = 2 * TXT_LOCK + b->is_triangle;
    b->strip_count = b->is_triangle ? c : is_corner ? 2 * c * c : 2 * c;
    b->strips = (txt_seam_strip *)txm_arena_zero(&b->arena, (size_t)b->strip_count, sizeof(txt_seam_strip));
    const size_t cells = (size_t)length * (size_t)b->lock_count;
    uint8_t *which = (uint8_t *)txm_arena_alloc(&b->arena, (size_t)b->strip_count, cells);
    txm_arena arena;
    txt_scratch m;
    txt_query q;
    txm_arena_init(&arena, b->env);
    memset(&q, 0, sizeof q);
    q.capacity = 256;
    q.samples = (txt_sample *)txm_arena_alloc(&arena, 256, sizeof(txt_sample));
    txm_status status = TXM_OK;
    txt_scratch_make(b, &arena, &m);
    if (b->arena.failed || arena.failed) {
        status = txm_fail(b->env, TXM_OUT_OF_MEMORY, "no memory for the edges");
        goto done;
    }
    for (int s = 0; s < b->strip_count; s++) b->strips[s].which = which + (size_t)s * cells;
    {
        txm_rng rng = txm_rng_make(b->desc->seed, 1);
        for (int k = 0; k < corners && status == TXM_OK; k++)
            status = txt_choose_corner(b, &rng, &q, &m);
    }
    if (status != TXM_OK) goto done;
    b->corners_are_final = 1;
    if (txt_choose_strips(b, b->strips, &q, &m) == UINT64_MAX) {
        status = txm_fail(b->env, TXM_TOO_SMALL,
                          "exemplars: too small to cut an edge from; give a larger picture");
        goto done;
    }
    for (int s = 0; s < b->strip_count; s++) txt_finish_strip(b, &b->strips[s]);
done:
    txm_arena_free(&arena);
    return status;
}

/* ---- one tile ---------------------------------------------------------------------------- */

enum {
    TXT_FRAME_LAYERS = 4 * (TXT_MAX_SEGMENTS + 2), /* pieces at the frame of a tile              */
    TXT_PLACES = 32,      /* found for the interior of a tile                                  */
    TXT_BIAS = 400        /* energy of a texel of the frame, per row away from the joint       */
};

/* A tile being made. Every texel has the number of the layer that it shows. */
typedef struct txt_canvas {
    const txt_build *b;
    int tile, side, half; /* half: directions in which neighbours are counted, 2 or 3 */
    int dx[3], dy[3];
    uint8_t *inside, *locked;
    uint16_t *label, *kept, *start, *best; /* kept, start, best: copies to restore */
    uint8_t *border;      /* rows to the nearest joint, at most 255 */
    int32_t *shows;       /* number of the texel shown, -1 beyond the exemplar */
    int32_t *other;       /* what the layer being tried would show */
    uint16_t *gap;        /* difference of the two */
    txt_layer *layers;
    int layer_capacity;
    int layer_count, frame_count; /* the first frame_count belong to edges and corners */
    txm_flow flow;
    txt_query query;
    txt_scratch scratch;
    txt_place places[TXT_PLACES]; /* found for the interior */
    int place_count, tries; /* how many of them are cut */
    int best_place;
} txt_canvas;

/* The cost of a cut between two neighbours: the squared sum of the differences that the layers on
   its two sides have at one and at the other texel [8]. */
static int32_t txt_seam(int at_p, int at_q) {
    return (at_p + at_q) * (at_p + at_q);
}

/* the cost of the cut between neighbouring texels p = (x, y) and q with their present labels */
static int32_t txt_cut_cost(const txt_canvas *c, int p, int q, int x, int y, int dx, int dy) {
    if (c->label[p] == c->label[q]) return 0;
    const txt_layer *a = &c->layers[c->label[p]], *d = &c->layers[c->label[q]];
    const int at_p = txt_difference(c->b, c->shows[p], txt_shown(c->b, d, x, y));
    const int at_q = txt_difference(c->b, c->shows[q], txt_shown(c->b, a, x + dx, y + dy));
    return txt_seam(at_p, at_q);
}

/* An edge's strip is the same in all tiles with its colour: the less of it shows, the less repeats.
   So it costs energy, more the further from the border. */
static int32_t txt_bias(const txt_canvas *c, int label, int p) {
    if (!c->layers[label].is_frame || c->border[p] < 3) return 0;
    const int depth = c->border[p] < 24 ? c->border[p] - 2 : 22;
    return TXT_BIAS * depth;
}

/* Energy of all cuts that touch the rectangle, and of the layers that its texels show. */
static int64_t txt_energy(const txt_canvas *c, int x0, int y0, int x1, int y1) {
    const int side = c->side;
    int64_t sum = 0;
    for (int y = y0 - 1; y < y1; y++) {
        for (int x = x0 - 1; x <= x1; x++) {
            if (x < 0 || y < 0 || x >= side) continue;
            const int p = y * side + x;
            if (!c->inside[p]) continue;
            if (x >= x0 && x < x1 && y >= y0) sum += txt_bias(c, c->label[p], p);
            for (int k = 0; k < c->half; k++) {
                const int qx = x + c->dx[k], qy = y + c->dy[k];
                if (qx < 0 || qy < 0 || qx >= side || qy >= side) continue;
                const int q = qy * side + qx;
                if (c->inside[q] && c->label[p] != c->label[q])
                    sum += txt_cut_cost(c, p, q, x, y, c->dx[k], c->dy[k]);
            }
        }
    }
    return sum;
}

/* One expansion move [7]: layer l takes those texels of the rectangle that minimise the energy.
   Returns by how much the energy fell; if it would not fall, nothing changes. */
static int64_t txt_expand(txt_canvas *c, int l, int x0, int y0, int x1, int y1) {
    const txt_build *b = c->b;
    txm_flow *g = &c->flow;
    const int side = c->side, half = c->half, width = x1 - x0 + 2, height = y1 - y0 + 2;
    g->count = width * height;
    for (int k = 0; k < half; k++) {
        g->step[k] = c->dy[k] * width + c->dx[k];
        g->step[k + half] = -g->step[k];
    }
    for (int k = 0; k < 2 * half; k++) memset(g->arc[k], 0, (size_t)g->count * sizeof(int32_t));
    memset(g->excess, 0, (size_t)g->count * sizeof(int32_t));

    /* what the layer would show, one texel beyond the rectangle too */
    int any = 0;
    for (int y = y0 - 1; y <= y1; y++) {
        for (int x = x0 - 1; x <= x1; x++) {
            if (x < 0 || y < 0 || x >= side || y >= side) continue;
            const int p = y * side + x;
            if (!c->inside[p]) continue;
            c->other[p] = txt_shown(b, &c->layers[l], x, y);
            c->gap[p] = (uint16_t)txt_difference(b, c->shows[p], c->other[p]);
        }
    }
#define TXT_MAY(p, x, y) \
    ((x) >= x0 && (x) < x1 && (y) >= y0 && (y) < y1 && !c->locked[p] && c->other[p] >= 0 && \
     c->label[p] != l)
    for (int y = y0 - 1; y < y1; y++) {
        for (int x = x0 - 1; x <= x1; x++) {
            if (x < 0 || y < 0 || x >= side) continue;
            const int p = y * side + x, node = (y - y0 + 1) * width + (x - x0 + 1);
            if (!c->inside[p]) continue;
            const int may_p = TXT_MAY(p, x, y), is_p = c->label[p] == l;
            if (may_p) {
                any = 1;
                /* to change costs on the source's side, to stay on the sink's */
                g->excess[node] += txt_bias(c, l, p) - txt_bias(c, c->label[p], p);
            }
            for (int k = 0; k < half; k++) {
                const int qx = x + c->dx[k], qy = y + c->dy[k];
                if (qx < 0 || qy < 0 || qx >= side || qy >= side) continue;
                const int q = qy * side + qx;
                if (!c->inside[q]) continue;
                const int may_q = TXT_MAY(q, qx, qy), is_q = c->label[q] == l;
                if (!may_p && !may_q) continue;
                /* p and q stay; p stays, q changes; p changes, q stays; both change: 0 */
                int32_t ss, sc, cs;
                if (c->label[p] == c->label[q]) {
                    ss = 0;
                    sc = cs = txt_seam(c->gap[p], c->gap[q]);
                } else {
                    const txt_layer *lp = &c->layers[c->label[p]], *lq = &c->layers[c->label[q]];
                    const int32_t pq = txt_shown(b, lp, qx, qy), qp = txt_shown(b, lq, x, y);
                    ss = txt_seam(txt_difference(b, c->shows[p], qp),
                                  txt_difference(b, c->shows[q], pq));
                    sc = txt_seam(c->gap[p], txt_difference(b, c->other[q], pq));
                    cs = txt_seam(c->gap[q], txt_difference(b, c->other[p], qp));
                }
                const int other = node + g->step[k];
                if (may_p && may_q) {
                    if (ss > sc + cs) ss = sc + cs; /* no negative arcs; the energy is checked */
                    g->excess[node] += cs - ss;
                    g->excess[other] -= cs;
                    g->arc[k][node] += sc + cs - ss;
                } else if (may_p) {
                    g->excess[node] += is_q ? -sc : cs - ss;
                } else {
                    g->excess[other] += is_p ? -cs : sc - ss;
                }
            }
        }
    }
    if (!any) return 0;
    const int64_t before = txt_energy(c, x0, y0, x1, y1);
    txm_flow_solve(g);
    for (int y = y0; y < y1; y++)
        memcpy(c->kept + y * side + x0, c->label + y * side + x0,
               (size_t)(x1 - x0) * sizeof *c->label);
    for (int y = y0; y < y1; y++) {
        for (int x = x0; x < x1; x++) {
            const int p = y * side + x, node = (y - y0 + 1) * width + (x - x0 + 1);
            if (!c->inside[p] || !TXT_MAY(p, x, y)) continue;
            if (g->tree[node] == TXM_FLOW_SINK) {
                c->label[p] = (uint16_t)l;
                const int32_t t = c->shows[p];
                c->shows[p] = c->other[p];
                c->other[p] = t; /* to undo it */
            }
        }
    }
#undef TXT_MAY
    const int64_t after = txt_energy(c, x0, y0, x1, y1);
    if (after < before) return before - after;
    for (int y = y0; y < y1; y++) {
        for (int x = x0; x < x1; x++) {
            const int p = y * side + x;
            if (!c->inside[p] || c->label[p] == c->kept[p]) continue;
            c->label[p] = c->kept[p];
            c->shows[p] = c->other[p];
        }
    }
    return 0;
}

/* ---- the frame of a tile ----------------------------------------------------------------- */

/* side k of a tile: its strip, and how strip coordinates come from the tile's: (a, u) or, of
   triangles, axial (i, j) = turned(x, y) + (di, dj) */
typedef struct txt_side {
    const txt_seam_strip *strip;
    int turn, di, dj;
    int layer[TXT_MAX_SEGMENTS + 2]; /* of the canvas, by the number of the strip's piece */
} txt_side;

/* Sides of a square: north, east, south, west; of a triangle 0, 1, 2. */
static void txt_find_side(const txt_build *b, const textiles_tile *t, int k, txt_side *s) {
    const int size = b->set->size, is_corner = b->set->kind == TEXTILES_CORNER;
    s->turn = s->di = s->dj = 0;
    if (b->is_triangle) {
        /* side k runs in direction 1, 5, 3 (sixths of a circle), the strip in direction 0 */
        const int run[3] = {1, 5, 3};
        const int corner[3][2] = {{0, 0}, {0, size}, {size, 0}};
        int i, j;
        s->strip = &b->strips[t->edges[k]];
        s->turn = (6 - run[k] + (t->directions[k] < 0 ? 3 : 0)) % 6;
        txt_turn(s->turn, corner[k][0], corner[k][1], &i, &j);
        s->di = (t->directions[k] < 0 ? size : 0) - i;
        s->dj = -j;
        return;
    }
    const int axis = k & 1;                         /* east and west run down */
    const int ends[4][2] = {{0, 1}, {1, 2}, {3, 2}, {0, 3}}; /* of corners nw, ne, se, sw */
    s->strip = &b->strips[is_corner ? txt_strip_index(b, axis, t->edges[ends[k][0]],
                                                      t->edges[ends[k][1]])
                                    : txt_strip_index(b, axis, t->edges[k], 0)];
    s->di = k == 1 ? -size : 0;
    s->dj = k == 2 ? -size : 0;
}

/* (a, u) of a texel on a side; u is 0, 1, .. or, from the other side, -1, -2, .. (triangles: 0, -1,
   .. for + and 0, 1, .. for -) */
static void txt_side_place(const txt_build *b, const txt_side *s, int x, int y, int *a, int *u) {
    int i, j;
    txt_turn(s->turn, x, y, &i, &j);
    i += s->di;
    j += s->dj;
    if (b->is_triangle) {
        *a = i + txt_half(j);
        *u = j;
    } else {
        *a = s->strip->axis ? j : i;
        *u = s->strip->axis ? i : j;
    }
}

/* The layers of a side: its start's corner, its segments, its end's corner. */
static void txt_add_side_layers(txt_canvas *c, txt_side *s) {
    const txt_build *b = c->b;
    for (int w = 0; w < s->strip->count + 2; w++) {
        txt_layer *l = &c->layers[c->layer_count];
        int i = s->di, j = s->dj;
        l->turn = s->turn;
        l->is_frame = 1;
        if (w >= 1 && w <= s->strip->count) {
            l->sheet = s->strip->segment[w - 1].sheet;
            i += s->strip->segment[w - 1].i;
            j += s->strip->segment[w - 1].j;
        } else {
            const int corner = s->strip->corner[w != 0], size = b->set->size;
            l->sheet = b->corner[corner].sheet;
            i += b->corner[corner].i;
            j += b->corner[corner].j;
            if (w && b->is_triangle) { /* seen from the end, turned by half a circle */
                l->turn = (s->turn + 3) % 6;
                i = b->corner[corner].i + size - s->di;
                j = b->corner[corner].j - s->dj;
            } else if (w) {
                if (s->strip->axis) j -= size;
                else i -= size;
            }
        }
        l->i = i;
        l->j = j;
        s->layer[w] = 0;
        while (memcmp(&c->layers[s->layer[w]], l, sizeof *l) != 0) s->layer[w]++;
        if (s->layer[w] == c->layer_count) c->layer_count++; /* else two sides share a corner */
    }
}

/* Start a tile: texels at its edges are fixed, all others show the strip of the nearest edge. */
static void txt_begin_tile(txt_canvas *c, int tile) {
    const txt_build *b = c->b;
    const int side = c->side, size = b->set->size, sides = b->is_triangle ? 3 : 4;
    txt_side list[4];
    c->tile = tile;
    c->layer_count = 0;
    for (int k = 0; k < sides; k++) {
        txt_find_side(b, &b->set->tiles[tile], k, &list[k]);
        txt_add_side_layers(c, &list[k]);
    }
    c->frame_count = c->layer_count;
    for (int y = 0; y < side; y++) {
        for (int x = 0; x < side; x++) {
            const int p = y * side + x;
            c->inside[p] = (uint8_t)(!b->is_triangle || x + y <= size);
            if (!c->inside[p]) continue;
            int nearest = 0, depth = INT_MAX, na = 0, nu = 0, locks = 0;
            for (int k = 0; k < sides; k++) {
                int a, u;
                txt_side_place(b, &list[k], x, y, &a, &u);
                /* rows from the joint: 0 touches it */
                const int row = b->is_triangle ? abs(u) : u < 0 ? -1 - u : u;
                if (row < TXT_LOCK + b->is_triangle &&
                    (!b->is_triangle || row == 0 || (a >= 6 && a <= size - 6)))
                    locks = 1;
                if (row < depth) {
                    nearest = k;
                    depth = row;
                    na = a;
                    nu = u;
                }
            }
            const txt_seam_strip *s = list[nearest].strip;
            const int line = txm_clampi(nu, b->lock_from, b->lock_from + b->lock_count - 1);
            const int at = txm_clampi(na, 0, size - 1 + b->is_triangle);
            const int w = s->which[at * b->lock_count + line - b->lock_from];
            c->border[p] = (uint8_t)txm_clampi(depth, 0, 255);
            c->locked[p] = (uint8_t)locks;
            c->label[p] = (uint16_t)list[nearest].layer[w];
            c->shows[p] = txt_shown(b, &c->layers[c->label[p]], x, y);
            /* a segment or corner that does not reach here: another segment of the same edge */
            for (int v = 1; v <= s->count && c->shows[p] < 0; v++) {
                c->label[p] = (uint16_t)list[nearest].layer[v];
                c->shows[p] = txt_shown(b, &c->layers[c->label[p]], x, y);
            }
        }
    }
}

/* One more expansion move for every layer, limited to the surroundings of what it has. */
static void txt_expand_all(txt_canvas *c) {
    const int reach = 20;
    for (int l = 0; l < c->layer_count; l++) {
        int x0 = INT_MAX, y0 = INT_MAX, x1 = 0, y1 = 0;
        for (int y = 0; y < c->side; y++) {
            for (int x = 0; x < c->side; x++) {
                if (!c->inside[y * c->side + x] || c->label[y * c->side + x] != l) continue;
                if (x < x0) x0 = x;
                if (x >= x1) x1 = x + 1;
                if (y < y0) y0 = y;
                y1 = y + 1;
            }
        }
        if (x1 == 0) continue;
        txt_expand(c, l, txm_clampi(x0 - reach, 0, c->side), txm_clampi(y0 - reach, 0, c->side),
                   txm_clampi(x1 + reach, 0, c->side), txm_clampi(y1 + reach, 0, c->side));
    }
}

/* ---- interiors: what the tiles so far show ----------------------------------------------- */

enum {
    TXT_MENDS = 12,       /* bad places of a tile for which another piece is sought            */
    TXT_WINDOW = 12,      /* half width of such a place                                        */
    TXT_USE = 20,         /* gray levels that a place costs which another interior shows       */
    TXT_PLACE_WEIGHT = 60 /* energy per search unit of a place and texel of a tile's side      */
};

/* For the extra cost of places that other interiors show already, in search units. */
typedef struct txt_use_query {
    const txt_build *b;
    int turn, size;
} txt_use_query;

/* approximately the rectangle of a sheet that a piece laid over the interior shows */
static void txt_piece_box(const txt_build *b, int turn, int size, int i, int j, int box[4]) {
    if (!b->is_triangle) {
        box[0] = i;
        box[1] = j;
        box[2] = i + size;
        box[3] = j + size;
        return;
    }
    int ci, cj; /* a square of the triangle's area around its centre */
    txt_turn(turn, size / 3, size / 3, &ci, &cj);
    const int x = i + ci + txt_half(j + cj), y = j + cj, r = size / 3;
    box[0] = x - r;
    box[1] = y - r;
    box[2] = x + r;
    box[3] = y + r;
}

/* Approximately the cells that a piece shows: receives their bounds, returns how many. */
static int txt_piece_cells(const txt_build *b, int sheet, int turn, int size, int i, int j,
                           int cells[4]) {
    const int across = b->sheets[sheet].width / TXT_CELL + 2;
    const int down = b->sheets[sheet].height / TXT_CELL + 2;
    int box[4];
    txt_piece_box(b, turn, size, i, j, box);
    for (int k = 0; k < 4; k++)
        cells[k] = txm_clampi((box[k] + TXT_CELL / 2) / TXT_CELL, 0, (k & 1 ? down : across) - 1);
    return (cells[2] - cells[0]) * (cells[3] - cells[1]);
}

/* By how much the traits of a piece exceed the means of the exemplars. */
static void txt_piece_traits(const txt_build *b, const txt_place *p, double more[TXT_TRAITS]) {
    int c[4];
    const int across = b->sheets[p->sheet].width / TXT_CELL + 2;
    const int area = txt_piece_cells(b, p->sheet, p->turn, b->set->size, p->i, p->j, c);
    const double *sum = b->traits[p->sheet];
    for (int k = 0; k < TXT_TRAITS; k++) {
        more[k] = 0;
        if (area <= 0) continue;
        more[k] = (sum[(c[3] * across + c[2]) * TXT_TRAITS + k] -
                   sum[(c[1] * across + c[2]) * TXT_TRAITS + k] -
                   sum[(c[3] * across + c[0]) * TXT_TRAITS + k] +
                   sum[(c[1] * across + c[0]) * TXT_TRAITS + k]) / area - b->usual[k];
    }
}

static void txt_use_extra(const void *context, int sheet, int i, int j, int n, uint32_t *cost) {
    const txt_use_query *q = (const txt_use_query *)context;
    const txt_build *b = q->b;
    const int across = b->sheets[sheet].width / TXT_CELL + 2;
    const uint32_t *sum = b->used[sheet];
    for (int k = 0; k < n; k++) {
        int c[4];
        const int area = txt_piece_cells(b, sheet, q->turn, q->size, i + k, j, c);
        if (area <= 0) continue;
        const uint32_t use = sum[c[3] * across + c[2]] - sum[c[1] * across + c[2]] -
                             sum[c[3] * across + c[0]] + sum[c[1] * across + c[0]];
        cost[k] += use / (uint32_t)area;
    }
}

/* Add to the surplus by how much the traits of a tile exceed the means of the exemplars. */
static void txt_count_traits(txt_build *b, const txt_canvas *c) {
    double sum[TXT_TRAITS] = {0}, one[TXT_TRAITS];
    int count = 0;
    for (int p = 0; p < c->side * c->side; p++) {
        if (!c->inside[p]) continue;
        txt_texel_traits(b, c->shows[p], one);
        for (int k = 0; k < TXT_TRAITS; k++) sum[k] += one[k];
        count++;
    }
    for (int k = 0; k < TXT_TRAITS; k++) b->surplus[k] += sum[k] / count - b->usual[k];
}

/* Count for each cell what the interior of a tile shows of it. */
static void txt_count_use(txt_build *b, const txt_canvas *c) {
    for (int y = 0; y < c->side; y++) {
        for (int x = 0; x < c->side; x++) {
            const int p = y * c->side + x;
            if (!c->inside[p] || c->layers[c->label[p]].is_frame) continue;
            const int32_t t = c->shows[p];
            const int e = txt_sheet_of(b->set, t);
            const int w = b->sheets[e].width, at = t - b->sheets[e].first;
            const int across = w / TXT_CELL + 2;
            const uint32_t weight = 8 + b->salient[t] / 2; /* 16 for mean salience */
            b->use[e][at / w / TXT_CELL * across + at % w / TXT_CELL] += weight;
        }
    }
}

/* Summed area table of the use, in search units: a cell that is used once more than the others
   costs TXT_USE gray levels at first, and less the more all of them are used. */
static void txt_sum_use(txt_build *b) {
    uint64_t total = 0;
    for (int e = 0; e < b->sheet_count; e++) {
        const int cells = (b->sheets[e].width / TXT_CELL + 2) * (b->sheets[e].height / TXT_CELL + 2);
        for (int k = 0; k < cells; k++) total += b->use[e][k];
    }
    const uint64_t one = 16 * (uint64_t)b->texels; /* everything used once */
    for (int e = 0; e < b->sheet_count; e++) {
        const int across = b->sheets[e].width / TXT_CELL + 2;
        const int down = b->sheets[e].height / TXT_CELL + 2;
        for (int y = 1; y < down; y++) {
            uint32_t row = 0;
            for (int x = 1; x < across; x++) {
                const uint64_t use = b->use[e][(y - 1) * across + x - 1];
                row += (uint32_t)(use * TXT_USE * TXT_SCALE * b->texels /
                                  (TXT_CELL * TXT_CELL * (one + total)));
                b->used[e][y * across + x] = b->used[e][(y - 1) * across + x] + row;
            }
        }
    }
}

/* ---- interiors: finding and cutting them ------------------------------------------------- */

/* Give layer l all texels of the rectangle that show the frame and lie at least `depth` rows from
   every joint. */
static void txt_fill_interior(txt_canvas *c, int l, int x0, int y0, int x1, int y1, int depth) {
    for (int y = y0; y < y1; y++) {
        for (int x = x0; x < x1; x++) {
            const int p = y * c->side + x;
            if (!c->inside[p] || c->border[p] < depth || !c->layers[c->label[p]].is_frame) continue;
            const int32_t t = txt_shown(c->b, &c->layers[l], x, y);
            if (t < 0) continue;
            c->label[p] = (uint16_t)l;
            c->shows[p] = t;
        }
    }
}

/* Find places of the exemplars that continue the frame inwards. */
static void txt_find_interiors(txt_canvas *c) {
    const txt_build *b = c->b;
    const int side = c->side, turns = b->is_triangle ? 6 : 1;
    txt_use_query use = {b, 0, b->set->size};
    c->place_count = 0;
    c->query.extra = txt_use_extra;
    c->query.context = &use;
    c->query.apart = 1 + b->set->size / (b->set->variants > 1 ? 8 : 12);
    c->query.coarse = turns > 1 ? 3 : 0;
    for (int turn = 0; turn < turns; turn++) {
        c->query.count = 0;
        use.turn = turn;
        for (int y = 0; y < side; y++) {
            for (int x = 0; x < side; x++) {
                const int p = y * side + x;
                if (!c->inside[p] || c->border[p] < 2 || c->border[p] > 10) continue;
                if (c->border[p] % 3 != 2 || (x + y) % 3 || (turns > 1 && (x ^ y) & 1)) continue;
                int i, j;
                txt_turn(turn, x, y, &i, &j);
                txt_sample_add(b, &c->query, i, j, c->shows[p]);
            }
        }
        for (int e = 0; e < b->sheet_count; e++)
            c->place_count = txt_search(b, &c->query, e, turn, &c->scratch, c->places,
                                        c->place_count, TXT_PLACES);
    }
}

/* The layer of a place, new or existing; -1: too many layers. */
static int txt_add_layer(txt_canvas *c, const txt_place *p) {
    const txt_layer layer = {p->sheet, p->turn, p->i, p->j, 0};
    for (int l = 0; l < c->layer_count; l++) {
        txt_layer *old = &c->layers[l];
        if (!old->is_frame && old->sheet == layer.sheet && old->turn == layer.turn &&
            old->i == layer.i && old->j == layer.j)
            return l;
    }
    if (c->layer_count == c->layer_capacity) return -1;
    c->layers[c->layer_count] = layer;
    return c->layer_count++;
}

/* At the worst places along the cuts, search for a piece that matches the surroundings, and expand
   it. */
static void txt_mend(txt_canvas *c) {
    const txt_build *b = c->b;
    const int side = c->side, r = TXT_WINDOW;
    int done_x[TXT_MENDS] = {0}, done_y[TXT_MENDS] = {0};
    c->query.extra = NULL;
    c->query.apart = 3;
    c->query.coarse = 2;
    const int mends = b->is_triangle ? TXT_MENDS * 2 / 3 : TXT_MENDS; /* half the area */
    for (int n = 0; n < mends; n++) {
        /* the window of the highest cost, on a grid */
        int64_t worst = 0;
        int wx = -1, wy = -1;
        for (int y = 2; y + 2 < side; y += 4) {
            for (int x = 2; x + 2 < side; x += 4) {
                if (!c->inside[y * side + x]) continue;
                int again = 0;
                for (int k = 0; k < n; k++)
                    again |= abs(done_x[k] - x) < 6 && abs(done_y[k] - y) < 6;
                if (again) continue;
                int64_t sum = 0;
                for (int dy = -5; dy <= 5; dy++) {
                    for (int dx = -5; dx <= 5; dx++) {
                        const int px = x + dx, py = y + dy;
                        if (px < 0 || py < 0 || px + 1 >= side || py + 1 >= side) continue;
                        const int p = py * side + px;
                        if (!c->inside[p]) continue;
                        for (int k = 0; k < c->half; k++) {
                            const int qx = px + c->dx[k], qy = py + c->dy[k];
                            if (qx < 0) continue;
                            const int q = qy * side + qx;
                            if (c->inside[q] && c->label[p] != c->label[q])
                                sum += txt_cut_cost(c, p, q, px, py, c->dx[k], c->dy[k]);
                        }
                    }
                }
                if (sum > worst) {
                    worst = sum;
                    wx = x;
                    wy = y;
                }
            }
        }
        if (wx < 0) return;
        done_x[n] = wx;
        done_y[n] = wy;
        const int x0 = txm_clampi(wx - r, 0, side), x1 = txm_clampi(wx + r + 1, 0, side);
        const int y0 = txm_clampi(wy - r, 0, side), y1 = txm_clampi(wy + r + 1, 0, side);
        txt_place found[2];
        int count = 0;
        int turn = c->layers[c->label[wy * side + wx]].turn;
        c->query.count = 0;
        for (int y = y0; y < y1; y += 2) {
            for (int x = x0 + (y / 2 & 1); x < x1; x += 2) {
                const int p = y * side + x;
                if (!c->inside[p] || (abs(x - wx) < 6 && abs(y - wy) < 6 && !c->locked[p]))
                    continue;
                int i, j;
                txt_turn(turn, x, y, &i, &j);
                txt_sample_add(b, &c->query, i, j, c->shows[p]);
            }
        }
        for (int e = 0; e < b->sheet_count; e++)
            count = txt_search(b, &c->query, e, turn, &c->scratch, found, count, 2);
        for (int k = 0; k < count; k++) {
            const int before = c->layer_count, l = txt_add_layer(c, &found[k]);
            if (l < 0) return;
            if (txt_expand(c, l, x0, y0, x1, y1) == 0) c->layer_count = before;
        }
    }
}

/* Compute from the labels what the texels show. */
static void txt_show(txt_canvas *c) {
    for (int y = 0; y < c->side; y++) {
        for (int x = 0; x < c->side; x++) {
            const int p = y * c->side + x;
            if (c->inside[p]) c->shows[p] = txt_shown(c->b, &c->layers[c->label[p]], x, y);
        }
    }
}

/* side of the blocks in which the interior is filled: that of the tile, or less if the exemplars
   are smaller */
static int txt_block_side(const txt_build *b) {
    int most = 0;
    for (int e = 0; e < b->sheet_count; e++) {
        const txt_sheet *s = &b->sheets[e];
        const int least = s->width < s->height ? s->width : s->height;
        if (least > most) most = least;
    }
    if (b->set->side + 8 <= most) return b->set->side;
    most = most * 5 / 8 - 16;
    return most > 8 ? most : 8;
}

/* Fill the interior block by block, as the exemplar is too small to fill it at once; each block
   continues the frame and the blocks before it. */
static void txt_fill_blocks(txt_canvas *c, int forced) {
    const txt_build *b = c->b;
    const int side = c->side, block = txt_block_side(b), reach = 8;
    const int count = (side + block - 1) / block, size = (side + count - 1) / count;
    txt_use_query use = {b, 0, size};
    c->query.extra = txt_use_extra;
    c->query.context = &use;
    c->query.apart = 1 + size / 6;
    for (int n = 0; n < count * count; n++) {
        const int x0 = txm_clampi(n % count * size - reach, 0, side);
        const int x1 = txm_clampi(n % count * size + size + reach, 0, side);
        const int y0 = txm_clampi(n / count * size - reach, 0, side);
        const int y1 = txm_clampi(n / count * size + size + reach, 0, side);
        txt_place place[4];
        int found = 0;
        c->query.count = 0;
        for (int y = y0; y < y1; y += 2) {
            for (int x = x0 + (y / 2 & 1); x < x1; x += 2) {
                const int p = y * side + x;
                if (!c->inside[p] || (c->layers[c->label[p]].is_frame && c->border[p] > 10))
                    continue;
                txt_sample_add(b, &c->query, x, y, c->shows[p]);
            }
        }
        if (c->query.count == 0) { /* nothing to continue: any place that is little used so far */
            const int32_t any = b->sheets[0].first;
            for (int k = 0; k < 4; k++)
                txt_sample_add(b, &c->query, k & 1 ? x0 : x1 - 1, k & 2 ? y0 : y1 - 1, any);
        }
        for (int e = 0; e < b->sheet_count; e++)
            found = txt_search(b, &c->query, e, 0, &c->scratch, place, found, 4);
        /* not always the best, which is the same for all tiles with these edges */
        txm_rng rng = txm_rng_make(b->desc->seed, (uint64_t)c->tile * 4096 + (uint64_t)n);
        const int l =
            found ? txt_add_layer(c, &place[txm_rng_below(&rng, (uint32_t)found)]) : -1;
        if (l < 0) continue;
        txt_fill_interior(c, l, x0, y0, x1, y1, forced);
        txt_expand(c, l, x0, y0, x1, y1);
    }
}

/* Where no piece reaches (only with an exemplar much smaller than the tile) show the texel of the
   sheet that is nearest to the one of the label. */
static void txt_fill_gaps(txt_canvas *c) {
    const txt_build *b = c->b;
    for (int p = 0; p < c->side * c->side; p++) {
        if (!c->inside[p] || c->shows[p] >= 0) continue;
        const txt_layer *l = &c->layers[c->label[p]];
        const txt_sheet *s = &b->sheets[l->sheet];
        int i, j;
        txt_turn(l->turn, p % c->side, p / c->side, &i, &j);
        j = txm_clampi(j + l->j, 0, s->height - 1);
        i = txm_clampi(i + l->i + (b->is_triangle ? txt_half(j) : 0), 0, s->width - 1);
        c->shows[p] = s->first + j * s->width + i;
    }
}

/* Cut one interior after the other into the frame, keep the best, and mend it. */
static void txt_cut_tile(txt_canvas *c) {
    const txt_build *b = c->b;
    const int side = c->side, size = b->set->size;
    const size_t bytes = (size_t)side * (size_t)side * sizeof *c->label;
    const int depth = b->is_triangle ? size / 6 : size / 5;
    const int forced = depth > TXT_LOCK ? depth : TXT_LOCK; /* what tiles share stays */
    int64_t least = 0;
    c->best_place = -1;
    if (txt_block_side(b) < side || c->place_count == 0) {
        txt_fill_blocks(c, forced);
        txt_expand_all(c);
        txt_mend(c);
        return;
    }
    memcpy(c->start, c->label, bytes);
    for (int k = 0; k < c->place_count && k < c->tries; k++) {
        c->layer_count = c->frame_count;
        memcpy(c->label, c->start, bytes);
        txt_show(c);
        txt_add_layer(c, &c->places[k]);
        txt_fill_interior(c, c->frame_count, 0, 0, side, side, forced);
        txt_expand(c, c->frame_count, 0, 0, side, side);
        txt_expand_all(c);
        const int64_t energy = txt_energy(c, 0, 0, side, side) +
                               (int64_t)c->places[k].cost * TXT_PLACE_WEIGHT * side;
        if (c->best_place >= 0 && energy >= least) continue;
        least = energy;
        c->best_place = k;
        memcpy(c->best, c->label, bytes);
    }
    c->layer_count = c->frame_count;
    txt_add_layer(c, &c->places[c->best_place]);
    memcpy(c->label, c->best, bytes);
    txt_show(c);
    txt_mend(c);
}

/* ---- repair ------------------------------------------------------------------------------ */

#define TXT_FAINT 0.125 /* alpha up to which a repaired colour says too little, and ...            */
#define TXT_CLEAR 0.5   /* ... from which on it is taken as it is                                  */

/* Memory for txm_poisson from one block, so that threads do not call the allocator. */
typedef struct txt_pool {
    uint8_t *block;
    size_t used, size;
} txt_pool;

static void *txt_pool_take(void *user, size_t bytes) {
    txt_pool *p = (txt_pool *)user;
    bytes = (bytes + 63) / 64 * 64;
    if (bytes > p->size - p->used) return NULL;
    p->used += bytes;
    return p->block + p->used - bytes;
}

static void txt_pool_give(void *user, void *block) {
    (void)user;
    (void)block; /* the next repair frees all at once */
}

/* bytes that are enough for txm_poisson with any mask of a tile */
static size_t txt_pool_bytes(size_t texels, size_t side) {
    return texels * (6 * sizeof(double) + 4 * sizeof(int32_t) + 4 * sizeof(float)) +
           side * sizeof(int32_t) + 4096;
}

/* the value of a map at a texel of the sheets */
static float txt_sheet_value(const txt_build *b, int map, int32_t t, int channel) {
    const txt_sheet *s = &b->sheets[txt_sheet_of(b->set, t)];
    const int at = t - s->first;
    return txm_image_get(&s->maps[map], at % s->width, at / s->width, channel);
}

/* The same as it is repaired: colours as much as they show. */
static float txt_repair_value(const txt_build *b, int map, int32_t t, int channel) {
    const int last = b->set->maps[map].channels - 1;
    const float value = txt_sheet_value(b, map, t, channel);
    if (!b->set->maps[map].has_alpha || channel == last) return value;
    const float alpha = txm_clampf(txt_sheet_value(b, map, t, last), 0, 1);
    return txm_float((double)value * (double)alpha);
}

/* The straight colour and the alpha of a repaired texel. Opaque texels stay opaque and transparent
   ones transparent; the less shows, the more the colour is that of the exemplar. */
static void txt_repair_shown(const txt_build *b, int map, int32_t t, float *pixel) {
    const int last = b->set->maps[map].channels - 1;
    const double alpha = (double)txm_clampf(txt_sheet_value(b, map, t, last), 0, 1);
    const double shown = (double)pixel[last], least = shown < alpha ? shown : alpha;
    const double trust = (least - TXT_FAINT) / (TXT_CLEAR - TXT_FAINT);
    for (int c = 0; c < last; c++) {
        const float own = txt_sheet_value(b, map, t, c);
        const float repaired = trust > 0 ? txm_float((double)pixel[c] / shown) : own;
        pixel[c] = trust >= 1 ? repaired : txm_lerpf(own, repaired, txm_float(trust > 0 ? trust : 0));
    }
    pixel[last] = txm_float(alpha + (shown - alpha) * 4 * alpha * (1 - alpha));
}

typedef struct txt_repair {
    float *image, *target; /* side * side * 4 */
    uint8_t *mask;
    txt_pool pool;
} txt_repair;

/* Spread the steps at the cuts of a tile over the texels near them [9]: differences are those of
   the exemplar, across a cut the mean of those that its two layers have there. */
static void txt_repair_tile(const txt_canvas *c, txt_repair *r) {
    const txt_build *b = c->b;
    textiles_set *set = b->set;
    const int side = c->side, reach = 5;
    const int dx[4] = {1, 0, -1, 0}, dy[4] = {0, 1, 0, -1};
    int any = 0;
    memset(r->mask, 0, (size_t)side * (size_t)side);
    for (int y = 0; y + 1 < side; y++) {
        for (int x = 0; x + 1 < side; x++) {
            const int p = y * side + x;
            if (!c->inside[p]) continue;
            const int right = c->inside[p + 1] && c->label[p] != c->label[p + 1];
            const int below = c->inside[p + side] && c->label[p] != c->label[p + side];
            if (!right && !below) continue;
            for (int v = txm_clampi(y - reach, 0, side); v < txm_clampi(y + reach + 2, 0, side); v++) {
                for (int u = txm_clampi(x - reach, 0, side); u < txm_clampi(x + reach + 2, 0, side); u++) {
                    const int q = v * side + u;
                    if (c->inside[q] && !c->locked[q]) r->mask[q] = 255, any = 1;
                }
            }
        }
    }
    if (!any) return;
    for (int m = 0; m < set->map_count; m++) {
        const int n = set->maps[m].channels, has_alpha = set->maps[m].has_alpha;
        txm_poisson_desc desc;
        txm_env env;
        memset(&desc, 0, sizeof desc);
        memset(&env, 0, sizeof env);
        env.allocate = txt_pool_take;
        env.release = txt_pool_give;
        env.memory_user = &r->pool;
        r->pool.used = 0;
        for (int p = 0; p < side * side; p++) {
            for (int k = 0; k < n; k++) {
                r->image[p * n + k] = c->inside[p] ? txt_repair_value(b, m, c->shows[p], k) : 0.0f;
                r->target[p * n + k] = 0;
            }
        }
        for (int y = 0; y < side; y++) {
            for (int x = 0; x < side; x++) {
                const int p = y * side + x;
                if (!r->mask[p]) continue;
                for (int d = 0; d < 4; d++) {
                    const int qx = x + dx[d], qy = y + dy[d], q = qy * side + qx;
                    if (qx < 0 || qy < 0 || qx >= side || qy >= side || !c->inside[q]) continue;
                    const int32_t pq = txt_shown(b, &c->layers[c->label[p]], qx, qy);
                    const int32_t qp = txt_shown(b, &c->layers[c->label[q]], x, y);
                    for (int k = 0; k < n; k++) {
                        const double here = r->image[p * n + k], there = r->image[q * n + k];
                        double sum = 0, count = 0;
                        if (pq >= 0) {
                            sum += txt_repair_value(b, m, pq, k) - here;
                            count += 1;
                        }
                        if (qp >= 0) {
                            sum += there - txt_repair_value(b, m, qp, k);
                            count += 1;
                        }
                        const double step = count > 0 ? sum / count : there - here;
                        r->target[p * n + k] = txm_float(r->target[p * n + k] + step);
                    }
                }
            }
        }
        desc.image.pixels = r->image;
        desc.image.width = desc.image.height = side;
        desc.image.channels = n;
        desc.image.sample = TXM_F32;
        desc.target = desc.image;
        desc.target.pixels = r->target;
        desc.mask = desc.image;
        desc.mask.pixels = r->mask;
        desc.mask.channels = 1;
        desc.mask.sample = TXM_U8;
        desc.tolerance = 1e-3f;
        if (txm_poisson(&desc, &env) != TXM_OK) continue; /* cannot be: the pool is enough */
        const txm_image out = {txt_texel(set, m, c->tile, 0, 0), side, side, n,
                               set->maps[m].sample, 0};
        for (int p = 0; p < side * side; p++) {
            if (r->mask[p] && has_alpha) txt_repair_shown(b, m, c->shows[p], r->image + p * n);
            for (int k = 0; k < n && r->mask[p]; k++)
                txm_image_set(&out, p % side, p / side, k, r->image[p * n + k]);
        }
    }
}

/* ---- all tiles --------------------------------------------------------------------------- */

enum {
    TXT_BATCH = 8,        /* tiles made at the same time, for any number of threads            */
    TXT_TRIES = 4         /* interiors cut for each tile, of which the best is kept            */
};
#define TXT_BALANCE 0.8       /* weight of use and traits when places are ranked             */

/* The pixels and sources of a finished tile. */
static void txt_store_tile(const txt_canvas *c) {
    const txt_build *b = c->b;
    textiles_set *set = b->set;
    const int side = c->side;
    int32_t *source = set->source + (size_t)c->tile * (size_t)side * (size_t)side;
    for (int p = 0; p < side * side; p++) {
        source[p] = c->inside[p] ? c->shows[p] : -1;
        if (!c->inside[p]) continue;
        const int32_t t = c->shows[p];
        const int e = txt_sheet_of(b->set, t);
        const int at = t - b->sheets[e].first, w = b->sheets[e].width;
        for (int m = 0; m < set->map_count; m++) {
            const char *row = (const char *)txm_image_row_const(&b->sheets[e].maps[m], at / w);
            memcpy(txt_texel(set, m, c->tile, p % side, p / side),
                   row + (size_t)(at % w) * set->maps[m].texel, set->maps[m].texel);
        }
    }
}

typedef struct txt_batch {
    txt_canvas canvas[TXT_BATCH];
    txt_repair repair[TXT_BATCH];
} txt_batch;

static void txt_batch_begin(void *context, int k) {
    txt_canvas *c = &((txt_batch *)context)->canvas[k];
    txt_begin_tile(c, c->tile);
    if (txt_block_side(c->b) >= c->side) txt_find_interiors(c);
    else c->place_count = 0;
}

static void txt_batch_cut(void *context, int k) {
    txt_batch *batch = (txt_batch *)context;
    txt_canvas *c = &batch->canvas[k];
    txt_cut_tile(c);
    txt_fill_gaps(c);
    txt_store_tile(c);
    if (c->b->desc->repair != TEXTILES_REPAIR_NONE) txt_repair_tile(c, &batch->repair[k]);
}

/* memory for making one tile after another; arena->failed if there is none */
static void txt_canvas_make(txt_build *b, txm_arena *arena, txt_canvas *c, txt_repair *r) {
    const size_t n = (size_t)b->set->side * (size_t)b->set->side;
    memset(c, 0, sizeof *c);
    memset(r, 0, sizeof *r);
    c->b = b;
    c->side = b->set->side;
    c->half = b->is_triangle ? 3 : 2;
    c->dx[0] = 1;
    c->dy[1] = 1;
    c->dx[2] = -1;
    c->dy[2] = 1;
    uint8_t *bytes = (uint8_t *)txm_arena_zero(arena, n, 3);
    uint16_t *labels = (uint16_t *)txm_arena_zero(arena, n, 4 * sizeof(uint16_t));
    const int blocks = (c->side + txt_block_side(b) - 1) / txt_block_side(b);
    c->layer_capacity = TXT_FRAME_LAYERS + blocks * blocks + 2 * TXT_MENDS;
    c->layers = (txt_layer *)txm_arena_alloc(arena, (size_t)c->layer_capacity, sizeof(txt_layer));
    c->shows = (int32_t *)txm_arena_alloc(arena, n, 2 * sizeof(int32_t));
    c->gap = (uint16_t *)txm_arena_alloc(arena, n, sizeof(uint16_t));
    c->query.capacity = TXT_SAMPLES;
    c->query.samples = (txt_sample *)txm_arena_alloc(arena, TXT_SAMPLES, sizeof(txt_sample));
    txt_scratch_make(b, arena, &c->scratch);
    txm_flow_make(&c->flow, arena, 2 * c->half, (c->side + 2) * (c->side + 2));
    if (b->desc->repair != TEXTILES_REPAIR_NONE) {
        r->image = (float *)txm_arena_alloc(arena, n, 8 * sizeof(float));
        r->mask = (uint8_t *)txm_arena_alloc(arena, n, 1);
        r->pool.size = txt_pool_bytes(n, (size_t)c->side);
        r->pool.block = (uint8_t *)txm_arena_alloc(arena, r->pool.size, 1);
    }
    if (arena->failed) return;
    if (r->image) r->target = r->image + 4 * n;
    c->inside = bytes;
    c->locked = bytes + n;
    c->border = bytes + 2 * n;
    c->label = labels;
    c->kept = labels + n;
    c->start = labels + 2 * n;
    c->best = labels + 3 * n;
    c->other = c->shows + n;
}

/* variant 0 of a tile */
static int txt_base(const txt_build *b, int tile) {
    return tile - b->set->tiles[tile].variant;
}

/* Are two places closer than `reach`? */
static int txt_places_agree(const txt_place *a, const txt_place *b, int reach) {
    return a->sheet == b->sheet && a->turn == b->turn && abs(a->i - b->i) < reach &&
           abs(a->j - b->j) < reach;
}

/* The cost of a place, in gray levels, for being shown by other tiles: variants of one tile must
   not show the same, and no two tiles exactly the same. */
static double txt_sharing_cost(const txt_build *b, const txt_batch *batch, int k,
                               const txt_place *place) {
    const int reach = b->set->size / 3, apart = b->set->size / 8, tile = batch->canvas[k].tile;
    const int first = txt_base(b, tile), begun = batch->canvas[0].tile;
    double cost = 0;
    for (int t = 0; t < begun; t++) {
        if (txt_places_agree(&b->inside[t], place, t >= first ? apart : 3)) cost += 300;
    }
    for (int o = 0; o < k; o++) {
        const txt_canvas *other = &batch->canvas[o];
        for (int q = 0; q < other->place_count && q < other->tries; q++) {
            const int variant = other->tile >= first;
            if (!txt_places_agree(&other->places[q], place, variant ? apart : reach)) continue;
            cost += variant ? 300 : TXT_USE / (q ? 2 : 1);
        }
    }
    return cost;
}

/* Sort the places found for the interiors of a batch: those that another tile shows or tries come
   later, those that bring the traits of the set closer to the means of the exemplars earlier. */
static void txt_rank_places(const txt_build *b, txt_batch *batch, int count) {
    double surplus[TXT_TRAITS], more[TXT_TRAITS];
    memcpy(surplus, b->surplus, sizeof surplus);
    for (int k = 0; k < count; k++) {
        txt_canvas *c = &batch->canvas[k];
        int same = 1; /* variants of one tile that are in the batch share the places */
        for (int o = 0; o < count; o++)
            same += o != k && txt_base(b, batch->canvas[o].tile) == txt_base(b, c->tile);
        c->tries = txm_clampi(c->place_count / same, 1, TXT_TRIES - b->is_triangle);
        for (int p = 0; p < c->place_count; p++) {
            double cost = txt_sharing_cost(b, batch, k, &c->places[p]);
            txt_piece_traits(b, &c->places[p], more);
            for (int t = 0; t < TXT_TRAITS; t++) cost += fabs(surplus[t] + more[t]);
            for (int t = TXT_STEP; t < TXT_STEP + 2; t++) {
                /* joints have typical roughness and would be visible beside a smooth interior */
                const double rough = b->usual[t] > 0 ? 1 + more[t] / b->usual[t] : 1;
                if (rough < 0.9) cost += 600 * (0.9 - rough);
            }
            c->places[p].cost += (uint32_t)(cost * TXT_SCALE * TXT_BALANCE);
        }
        for (int p = 1; p < c->place_count; p++) { /* a stable sort */
            const txt_place place = c->places[p];
            int at = p;
            for (; at > 0 && c->places[at - 1].cost > place.cost; at--)
                c->places[at] = c->places[at - 1];
            c->places[at] = place;
        }
        if (c->place_count) {
            txt_piece_traits(b, &c->places[0], more);
            for (int t = 0; t < TXT_TRAITS; t++) surplus[t] += more[t];
        }
    }
}

static txm_status txt_make_tiles(txt_build *b) {
    txm_status status = TXM_OK;
    txm_arena arena;
    const int count = b->set->count;
    const int slots = count < TXT_BATCH ? count : TXT_BATCH;
    txm_arena_init(&arena, b->env);
    txt_batch *batch = (txt_batch *)txm_arena_zero(&arena, 1, sizeof *batch);
    b->inside = (txt_place *)txm_arena_zero(&arena, (size_t)count, sizeof(txt_place));
    for (int k = 0; k < slots && batch; k++)
        txt_canvas_make(b, &arena, &batch->canvas[k], &batch->repair[k]);
    if (arena.failed) {
        status = txm_fail(b->env, TXM_OUT_OF_MEMORY, "no memory to cut tiles");
        goto done;
    }
    for (int t = 0; t < count; t++) b->inside[t].sheet = -1;
    for (int first = 0; first < count; first += TXT_BATCH) {
        const int n = count - first < TXT_BATCH ? count - first : TXT_BATCH;
        if (txm_progress(b->env, 0.1f + 0.9f * (float)first / (float)count, "tiles")) {
            status = txm_fail(b->env, TXM_CANCELLED, "cancelled while cutting tiles");
            goto done;
        }
        txt_sum_use(b);
        for (int k = 0; k < n; k++) batch->canvas[k].tile = first + k;
        txm_parallel_for(b->env, n, txt_batch_begin, batch);
        txt_rank_places(b, batch, n);
        txm_parallel_for(b->env, n, txt_batch_cut, batch);
        for (int k = 0; k < n; k++) {
            txt_count_use(b, &batch->canvas[k]);
            txt_count_traits(b, &batch->canvas[k]);
            const int best = batch->canvas[k].best_place;
            if (best >= 0) b->inside[first + k] = batch->canvas[k].places[best];
        }
    }
done:
    txm_arena_free(&arena);
    return status;
}

/* ---- public: making ---------------------------------------------------------------------- */

static txm_status txt_check_exemplars(const textiles_desc *d, txt_map maps[TEXTILES_MAX_MAPS],
                                      txm_env *env) {
    if (!d->exemplars || d->exemplar_count < 1 || d->exemplar_count > TEXTILES_MAX_EXEMPLARS)
        return txm_fail(env, TXM_BAD_ARGUMENT, "exemplars: give 1 to 8");
    const int count = d->exemplars[0].map_count;
    const int colors = d->colors ? d->colors : 2;
    for (int e = 0; e < d->exemplar_count; e++) {
        const textiles_exemplar *x = &d->exemplars[e];
        if (!x->maps || x->map_count < 1 || x->map_count > TEXTILES_MAX_MAPS ||
            x->map_count != count)
            return txm_fail(env, TXM_BAD_ARGUMENT,
                            "exemplars: each needs the same number of maps, 1 to 8");
        for (int m = 0; m < count; m++) {
            const txm_image *im = &x->maps[m];
            const txm_status status = txm_image_check(im, "exemplars", TEXTILES_MAX_PIXELS, env);
            if (status != TXM_OK) return status;
            const int channels = im->channels ? im->channels : 1;
            if (im->width != x->maps[0].width || im->height != x->maps[0].height)
                return txm_fail(env, TXM_BAD_ARGUMENT,
                                "exemplars: the maps of one must have the same size");
            if (e && (channels != maps[m].channels || im->sample != maps[m].sample))
                return txm_fail(env, TXM_BAD_ARGUMENT,
                                "exemplars: all must have the same channels and sample type");
            if (!txm_image_is_finite(im))
                return txm_fail(env, TXM_BAD_ARGUMENT, "exemplars: a sample is not finite");
            if (im->width < 64 || im->height < 64)
                return txm_fail(env, TXM_TOO_SMALL, "exemplars: both sides need 64 pixels or more");
            maps[m].channels = channels;
            maps[m].sample = im->sample;
        }
    }
    if (d->edge_exemplars) {
        if (d->kind == TEXTILES_CORNER)
            return txm_fail(env, TXM_BAD_ARGUMENT, "edge_exemplars: corner sets have no edge colors");
        for (int c = 0; c < colors; c++) {
            if (d->edge_exemplars[c] < 0 || d->edge_exemplars[c] >= d->exemplar_count)
                return txm_fail(env, TXM_BAD_ARGUMENT, "edge_exemplars: no such exemplar");
        }
    }
    if ((int)d->repair < 0 || d->repair > TEXTILES_REPAIR_POISSON)
        return txm_fail(env, TXM_BAD_ARGUMENT, "repair is none of textiles_repair");
    return TXM_OK;
}

TEXTILES_API txm_status textiles_make(const textiles_desc *desc, txm_env *env, textiles_set **out) {
    txt_map maps[TEXTILES_MAX_MAPS];
    txt_build b;
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    if (!desc) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL; pass a textiles_desc");
    memset(maps, 0, sizeof maps);
    memset(&b, 0, sizeof b);
    txm_status status = txt_check_kind(desc, env);
    if (status == TXM_OK) status = txt_check_exemplars(desc, maps, env);
    if (status == TXM_OK && txm_progress(env, 0, "exemplars"))
        status = txt_cancelled(env);
    if (status == TXM_OK)
        status = txt_set_make(desc, maps, desc->exemplars[0].map_count, 1, env, &b.set);
    if (status != TXM_OK) return status;
    b.desc = desc;
    b.env = env;
    b.is_triangle = desc->kind == TEXTILES_TRIANGLE;
    b.wanted_step = b.is_triangle ? 0.99 : 1; /* cuts inside triangles are a little rougher */
    txm_arena_init(&b.arena, env);
    status = txt_prepare(&b);
    if (status == TXM_OK) status = txt_make_frames(&b);
    if (status == TXM_OK) status = txt_make_tiles(&b);
    if (status == TXM_OK && txm_progress(env, 1, "tiles"))
        status = txt_cancelled(env);
    txm_arena_free(&b.arena);
    if (status != TXM_OK) textiles_set_free(b.set);
    else *out = b.set;
    return status;
}

/* ---- public: measuring ------------------------------------------------------------------- */

/* sum over the channels of the absolute difference of two texels; colours count as they show */
static double txt_texel_step(const txt_map *m, const uint8_t *p, const uint8_t *q) {
    const size_t last = (size_t)m->channels - 1;
    const double full = m->sample == TXM_F32 ? 1 : m->sample == TXM_U16 ? 65535 : 255;
    double sum = 0, shown_p = 1, shown_q = 1;
    if (m->has_alpha) {
        shown_p = fmin(fmax(txt_stored(m->sample, p, last) / full, 0), 1);
        shown_q = fmin(fmax(txt_stored(m->sample, q, last) / full, 0), 1);
    }
    for (size_t c = 0; c <= last; c++) {
        const int is_alpha = m->has_alpha && c == last;
        sum += fabs(txt_stored(m->sample, p, c) * (is_alpha ? 1 : shown_p) -
                    txt_stored(m->sample, q, c) * (is_alpha ? 1 : shown_q));
    }
    return sum;
}

/* The mean difference of neighbours inside a tile: axis 0 from row to row, 1 from column to column;
   of triangles in all three directions. */
static double txt_inside_step(const textiles_set *s, int map, int tile, int axis) {
    const int side = s->side;
    const int dx[3] = {1, 0, -1}, dy[3] = {0, 1, 1};
    double sum = 0;
    int count = 0;
    for (int y = 0; y < side; y++) {
        for (int x = 0; x < side; x++) {
            for (int d = 0; d < 3; d++) {
                const int u = x + dx[d], v = y + dy[d];
                if (s->kind != TEXTILES_TRIANGLE && d != !axis) continue;
                if (u < 0 || u >= side || v >= side) continue;
                if (s->kind == TEXTILES_TRIANGLE && (x + y > s->size || u + v > s->size)) continue;
                sum += txt_texel_step(&s->maps[map], txt_texel(s, map, tile, x, y),
                                      txt_texel(s, map, tile, u, v));
                count++;
            }
        }
    }
    return sum / count;
}

/* texel a = 0..size, row r = 0.. of side k of a triangle; row r has size + 1 - r texels */
static void txt_side_texel(const textiles_set *s, int k, int a, int r, int *x, int *y) {
    const int n = s->size;
    if (k == 0) { /* down the left side: rows go right */
        *x = r;
        *y = a;
    } else if (k == 1) { /* up the slanting side: rows go left and up */
        *x = a;
        *y = n - r - a;
    } else { /* back along the top: rows go down */
        *x = n - r - a;
        *y = r;
    }
}

/* The mean difference between the texels on side k of triangle a and the row beside it in triangle
   b, whose side m is at the same edge in the opposite direction. */
static double txt_row_step(const textiles_set *s, int map, int a, int k, int b, int m) {
    double sum = 0;
    for (int i = 0; i < s->size; i++) {
        for (int e = 0; e < 2; e++) { /* texel i of row 1 lies between the edge's i and i + 1 */
            int x, y, u, v;
            txt_side_texel(s, k, s->size - i - e, 0, &x, &y);
            txt_side_texel(s, m, i, 1, &u, &v);
            sum += txt_texel_step(&s->maps[map], txt_texel(s, map, a, x, y),
                                  txt_texel(s, map, b, u, v));
        }
    }
    return sum / (2 * s->size);
}

typedef struct txt_tally {
    textiles_joints *joints;
    double step, inside;
} txt_tally;

static void txt_count_joint(txt_tally *t, double step, double inside) {
    /* flat interiors: without a step the joint is perfect, else bad */
    const double ratio = inside > 0 ? step / inside : step > 0 ? 1e9 : 1;
    textiles_joints *j = t->joints;
    if (j->pairs == 0 || ratio > j->worst) j->worst = ratio;
    if (j->pairs == 0 || ratio < j->least) j->least = ratio;
    j->mean += ratio;
    j->pairs++;
    t->step += step;
    t->inside += inside;
}

static void txt_measure_squares(const textiles_set *s, int map, int a, int b, const double *inside,
                                txt_tally *tally) {
    const int last = s->size - 1;
    for (int axis = 0; axis < 2; axis++) { /* 0: b under a, 1: b right of a */
        double sum = 0;
        if (!txt_joins(s, a, b, !axis)) continue;
        for (int k = 0; k <= last; k++)
            sum += txt_texel_step(&s->maps[map],
                                  txt_texel(s, map, a, axis ? last : k, axis ? k : last),
                                  txt_texel(s, map, b, axis ? 0 : k, axis ? k : 0));
        txt_count_joint(tally, sum / s->size, 0.5 * (inside[2 * a + axis] + inside[2 * b + axis]));
    }
}

static void txt_measure_triangles(const textiles_set *s, int map, int a, int b,
                                  const double *inside, txt_tally *tally) {
    for (int k = 0; k < 3; k++) {
        for (int m = 0; m < 3; m++) {
            if (s->tiles[a].edges[k] != s->tiles[b].edges[m] ||
                s->tiles[a].directions[k] == s->tiles[b].directions[m])
                continue;
            txt_count_joint(tally,
                            0.5 * (txt_row_step(s, map, a, k, b, m) + txt_row_step(s, map, b, m, a, k)),
                            0.5 * (inside[2 * a] + inside[2 * b]));
        }
    }
}

TEXTILES_API txm_status textiles_measure(const textiles_set *set, int map, txm_env *env,
                                         textiles_joints *joints) {
    if (!set || !joints) return txm_fail(env, TXM_BAD_ARGUMENT, "set or joints is NULL");
    if (map < 0 || map >= set->map_count) return txm_fail(env, TXM_BAD_ARGUMENT, "map: no such map");
    const size_t count = (size_t)set->count;
    double *inside = (double *)txm_alloc(env, count * 2 * sizeof(double));
    if (!inside) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to measure");
    textiles_joints result = {0, 0, 0, 0, 0};
    txt_tally tally = {&result, 0, 0};
    const int is_triangle = set->kind == TEXTILES_TRIANGLE;
    for (int t = 0; t < set->count; t++) {
        for (int axis = 0; axis < 2; axis++) inside[2 * t + axis] = txt_inside_step(set, map, t, axis);
    }
    for (int a = 0; a < set->count; a++) {
        for (int b = 0; b < set->count; b++) {
            if (is_triangle) txt_measure_triangles(set, map, a, b, inside, &tally);
            else txt_measure_squares(set, map, a, b, inside, &tally);
        }
    }
    txm_free(env, inside);
    if (result.pairs) {
        result.mean /= result.pairs;
        result.overall = tally.inside > 0 ? tally.step / tally.inside : 1;
    }
    *joints = result;
    return TXM_OK;
}

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
