/* texpatch.h - v0.2.0 - more of a photographed texture, its layout kept, in a fraction of a second
   SPDX-License-Identifier: MIT OR Unlicense                   (full text: end of file)

   WHAT IT DOES
     Synthesises texture of any size from a photograph: bricks stay in their courses, tiles and
     woven patterns on their lattice, gravel becomes more gravel [1]. Several maps of a material
     (albedo, normals, height ...) are made in register. The result can be tileable, follow a
     painted guide (texedges.h makes one from drawn strokes) and keep given pixels, and parts of it
     can be synthesised again after an edit; or it is any window of an endless plane.

   QUICK START                                 (tests build and run this very block)
     // Twice as much of a texture. cc -std=c99 quick.c -lm
     #define TEXPATCH_IMPLEMENTATION          // in exactly one .c or .cpp file
     #include "texpatch.h"                    // texmath.h must lie beside it
     #include <stdio.h>

     int main(void) {
         static unsigned char photo[64 * 64], pixels[128 * 128];   // the caller owns all pixels
         static texpatch_desc desc;           // static: all zero, which means the defaults
         static texpatch_exemplar exemplar;
         static txm_env env;                  // malloc, silent, serial; receives the message
         static txm_image picture, out;
         for (int i = 0; i < 64 * 64; i++)    // instead of a photograph: bricks
             photo[i] = (unsigned char)(i / 64 % 16 < 2 || (i + i / 1024 % 2 * 16) % 32 < 2 ? 220
                                                                        : 90 + i * i % 31);
         picture.pixels = photo;
         picture.width = picture.height = 64;
         exemplar.maps = &picture;            // more maps in register may follow
         desc.exemplars = &exemplar;
         desc.exemplar_count = desc.map_count = 1;
         desc.width = desc.height = 128;
         desc.tileable = TEXPATCH_TILE_X | TEXPATCH_TILE_Y;
         out.pixels = pixels;
         out.width = out.height = 128;
         if (texpatch_make(&desc, &env, &out) != TXM_OK) {
             fprintf(stderr, "texture: %s\n", env.message);
             return 1;
         }
         printf("the middle pixel is %d\n", pixels[64 * 128 + 64]);
         return 0;
     }

   WHICH CALL
     texpatch_make        a picture, or several maps in register, in one call
     texpatch_begin ...   the same in steps, with a picture after each; texpatch_again synthesises
                          a part again, texpatch_source_at tells where each pixel comes from
     texpatch_plane_...   windows of an endless plane, which agree wherever they overlap
     texpatch_straight_   a photograph of a wall or floor, seen at an angle, as from straight in
                          front; what is synthesised from it keeps its courses
     texpatch_half        coarser levels of detail of a result
     texsyn.h makes stochastic texture from a model of a few kB instead of pieces of the photograph;
     textiles.h makes sets of tiles that are assembled when the picture is drawn.

   HOW IT WORKS
     Coordinates are synthesised, not colours [5]: each pixel of the output refers to a pixel of the
     exemplar. First pass [1, 3.4; 3], at the coarsest level of a pyramid: patches of N x N pixels,
     N / 2 apart, in scan order, each the best match of all positions, joined along minimum-error
     cuts. Positions off the exemplar's lattice, which is found in its autocorrelation, cost more
     (in courses of bricks and planks each course has its own phase), and so do those that were used more often than others. Second pass [1, 3.5; 2], coarse to fine:
     neighbourhoods of 16, then 8 pixels search for their best match among what their pixels already
     show, at random positions [4] and one lattice step away. Each pixel takes, of the candidates of
     all neighbourhoods that cover it, the one nearest to their mean with the adaptive weights
     w = P |x - z|^(r - 2), r = 0.8, where P is the share of well-matched neighbourhoods among those
     of high frequency nearby. As it takes one candidate and not the mean, nothing is blurred.
     Differences are sums of absolute differences of bytes. At the end pieces are bent by up to 4
     pixels so that lines meet at seams, and small steps of colour there are smoothed.
     Alpha, the last of 2 or 4 channels of a map that is neither data nor normals, says how much of
     a pixel shows: colours are compared, averaged and bent weighted by it, and the colours of fully
     transparent pixels never matter; those of the result are the visible neighbours'.
     A photograph is straightened before all that: the spectra of small windows are those of a few
     waves on a plane; the tilt, the lens and the waves that explain all windows are searched for and
     then fitted to the phases of the waves by least squares. What is left, if it is smooth, becomes
     a field of displacements. Edges tell which way is up.
     A part that is synthesised again and a cell of the plane are the same kind of job, with some
     pixels given.

   LIMITS
     Touching stones are sometimes merged; perspective is corrected by
     texpatch_straight_find alone; a lattice whose rows are not parallel (waves, fans) is not found. What is unique in the exemplar, such as a knot in
     wood, is repeated.

   CONFIGURATION   (define before the include that has _IMPLEMENTATION)
     TEXPATCH_STATIC       every function static to the including file (set it everywhere)
     TEXPATCH_MAX_PIXELS   refuse larger exemplars, outputs and windows; default 2^28
     TEXPATCH_NO_SIMD      plain C only. Else SSE2 where the compiler has it, with the same bytes.

   MEMORY
     RGB: some 24 bytes for each pixel of the output while it is made, and 40 for each pixel of at
     most 320 rows of it; a copy of each map that has transparent pixels; some 6 for each pixel of the
     exemplar and each of its turned and mirrored forms. The plane holds one cell at a time, and 20
     bytes for each pixel along the upper and lower sides of a row of cells.

   TIME   (one core of 2023; make bench measures yours)
     512 x 512 from 256 x 256 pixels, RGB: 0.3 s; without optimisation (passes = -1) 0.15 s. It is
     proportional to the pixels of the output; the exemplar's size matters only at the coarsest
     level. The parallel-for hook runs rows of neighbourhoods and bands of rows.

   THREADS
     No global state. Calls with different env and outputs may overlap; many threads may draw the
     same plane, but a job may be used by only one call at a time.

   SAME BYTES
     All decisions are made in integers, or in float and double rounded once: the same bytes on any
     number of threads, with and without SIMD and on any compiler that keeps to IEEE 754 (see
     texmath.h), built with -ffp-contract=off.

   REFERENCES
     [1] GPU-based interactive near-regular texture synthesis for digital human models.
         Technology and Health Care.
     [2] V. Kwatra, I. Essa, A. Bobick, N. Kwatra. Texture optimization for example-based synthesis.
         SIGGRAPH 2005.
     [3] A. Efros, W. Freeman. Image quilting for texture synthesis and transfer. SIGGRAPH 2001.
     [4] C. Barnes, E. Shechtman, A. Finkelstein, D. Goldman. PatchMatch. SIGGRAPH 2009.
     [5] S. Lefebvre, H. Hoppe. Parallel controllable texture synthesis. SIGGRAPH 2005.          */
#ifndef TEXPATCH_H
#define TEXPATCH_H

#include "texmath.h"

#define TEXPATCH_VERSION "0.2.0"

#ifndef TEXPATCH_MAX_PIXELS
#define TEXPATCH_MAX_PIXELS (1 << 28) /* larger exemplars and outputs are refused */
#endif

#if defined(TEXPATCH_STATIC) && defined(__GNUC__)
#define TEXPATCH_API __attribute__((unused)) static
#elif defined(TEXPATCH_STATIC)
#define TEXPATCH_API static
#else
#define TEXPATCH_API extern
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* ---- what to synthesise ------------------------------------------------------------------ */

enum {
    TEXPATCH_MAX_MAPS = 16,     /* pictures in register: albedo, normal, roughness, ...      */
    TEXPATCH_MAX_EXEMPLARS = 8,
    TEXPATCH_MAX_CHANNELS = 16, /* of all maps with a weight, and the guide, together        */
    TEXPATCH_MIN_SIDE = 32,     /* pixels, of an exemplar                                    */
    TEXPATCH_MAX_SIDE = 16384   /* of an exemplar                                            */
};

/* How one of the maps is treated; all zero: a picture that follows the others. */
typedef struct texpatch_map {
    float weight;  /* 0..16: how much differences in this map count when pieces are matched;
                      0 = it follows the others                                              */
    int is_normal; /* 3 or 4 channels, the first three a unit vector (txm_normal_decode): blended
                      as vectors, kept at unit length, turned with the piece. x to the right,
                      y up (OpenGL); 2 = y down (DirectX)                                     */
    int is_label;  /* values are labels, not quantities: never blended or interpolated       */
    int is_data;   /* quantities (height, roughness), not colours: averaged without decoding */
} texpatch_map;

/* One exemplar: a photograph, or several maps of one material in register. */
typedef struct texpatch_exemplar {
    const txm_image *maps; /* map_count pictures of one size; every exemplar has the same maps:
                              channels and sample type                                       */
    txm_image guide;       /* its guide, the size of the maps, 1..4 channels; pixels NULL: none */
    txm_image mask;        /* the size of the maps: a mask that allows (txm_mask_use in texmath.h):
                              pixels that do not count are never used; pixels NULL: use all      */
} texpatch_exemplar;

enum { TEXPATCH_TILE_X = 1, TEXPATCH_TILE_Y = 2 }; /* for texpatch_desc.tileable               */

/* What to make. All zero but exemplars, their count, map_count and the size is a good default. */
typedef struct texpatch_desc {
    const texpatch_exemplar *exemplars; /* not modified; must live as long as the job draws     */
    int exemplar_count;                 /* 1..TEXPATCH_MAX_EXEMPLARS                             */
    int map_count;                      /* 1..TEXPATCH_MAX_MAPS                                  */
    const texpatch_map *maps; /* map_count of them; NULL = only the first has weight, 1          */
    int width, height;        /* of the output, in pixels, 1 or more                             */
    int tileable;             /* TEXPATCH_TILE_X | TEXPATCH_TILE_Y: opposite sides fit            */
    int patch;  /* side N of the patches of the first pass, in pixels of the output; they are laid
                   N / 2 apart; 0 = chosen for the exemplar                                      */
    int passes; /* optimisation passes for each size of neighbourhood, 1..16; 0 = 3 (2 at full
                   size); -1 = none: patches, cuts and blending alone, in less than half the time */
    int turns;  /* 1, 2 or 4: pieces may be turned by half or quarter turns; 0 = 1               */
    int mirror; /* pieces may be mirrored left to right                                          */
    float novelty; /* 0..1: how strongly large verbatim pieces of the exemplar are avoided: at 1
                      no piece is larger than a neighbourhood, at the cost of detail and likeness */
    int lattice;   /* 0 = find the lattice of the exemplar, if it has one, and keep it; 1 = it has
                      the one given below; -1 = treat it as having none. A lattice is searched for
                      only in a single exemplar that is neither turned nor mirrored              */
    float lattice_vectors[4]; /* for lattice = 1: x and y of both steps, in pixels                */
    txm_image guide;    /* what the exemplars' guides should look like in the output: width x
                           height, with their channels and sample type; pixels NULL: none        */
    txm_image guide_mask; /* width x height: a mask that allows, of where the guide counts;
                           pixels NULL: everywhere                                               */
    float guide_weight; /* 0..16: how much differences in the guide count, relative to a map of
                           weight 1; 0 = 2                                                       */
    const txm_image *kept; /* map_count pictures of width x height, kept where keep counts;
                           NULL: none. They need not come from the exemplar                      */
    txm_image keep;        /* width x height: a mask that allows                                 */
    uint64_t seed;         /* another seed gives another texture                                 */
} texpatch_desc;

/* Make a texture in one call.

   env    NULL, or how to allocate, report, cancel and run in parallel
   out    map_count pictures of desc->width x desc->height, channels and sample of the maps;
          untouched after an error
   return TXM_OK; TXM_BAD_ARGUMENT for a field outside its range, maps or guides that do not match
          or samples that are not finite; TXM_TOO_SMALL for an exemplar under TEXPATCH_MIN_SIDE, or
          whose mask leaves no piece; TXM_TOO_LARGE; TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost   see TIME and MEMORY                                                                 */
TEXPATCH_API txm_status texpatch_make(const texpatch_desc *desc, txm_env *env,
                                      const txm_image *out);

/* ---- step by step ------------------------------------------------------------------------ */

/* A texture that is made step by step. It keeps a copy of the allocator, but not of the exemplars'
   pictures. */
typedef struct texpatch_job texpatch_job;

/* Prepare a job: pyramids, lattice. The statuses are those of texpatch_make. */
TEXPATCH_API txm_status texpatch_begin(const texpatch_desc *desc, txm_env *env,
                                       texpatch_job **out);

/* One step of the work, coarse first: at 512 x 512 some 5 to 60 ms. After an error (cancelling
   included) the job is as before the step and the step may be tried again.
   env    its progress callback receives the fraction of all steps that is done
   more   receives 0 once nothing is left to do; NULL is allowed                              */
TEXPATCH_API txm_status texpatch_step(texpatch_job *job, txm_env *env, int *more);

/* Draw a map in its current state, after one step or more (before the first, TXM_BAD_ARGUMENT). out
   may be a window of the output: its top left pixel is pixel (x, y) of the output, and the window
   must lie inside. Where it is transparent, colours are those of the exemplar's visible neighbours;
   txm_image_bleed on the finished picture fits them to its own, as texpatch_make does. */
TEXPATCH_API txm_status texpatch_draw(const texpatch_job *job, int map, int x, int y, txm_env *env,
                                      txm_image out);

/* Where a pixel of the output comes from. With it anything that is in register with the exemplars
   can be looked up later. */
typedef struct texpatch_source {
    float x, y;    /* pixel of the exemplar as given (turns undone); pixel centres are whole
                      numbers, fractions lie between them                                       */
    int exemplar;  /* -1: the pixel was kept                                                    */
    int turn;      /* quarter turns of the piece, counter-clockwise, 0..3; + 4: it is mirrored
                      (before turning)                                                          */
} texpatch_source;
TEXPATCH_API texpatch_source texpatch_source_at(const texpatch_job *job, int x, int y);

/* Synthesise a part again: the pixels of `again`, a mask that replaces, of the size of the output.
   Any remaining steps are done first. All other pixels are kept, and the part is fitted to
   them. The following steps do the work, in time proportional to the part's bounding box.
   guide, guide_mask   as in the desc, copied; the job follows them from now on. NULL = unchanged */
TEXPATCH_API txm_status texpatch_again(texpatch_job *job, const txm_image *again,
                                       const txm_image *guide, const txm_image *guide_mask,
                                       uint64_t seed, txm_env *env);

/* Release a job; NULL is allowed. */
TEXPATCH_API void texpatch_free(texpatch_job *job);

/* The lattice that a job keeps: x, y of both steps in pixels of the exemplar; 0: it has none. Where each
   course of bricks or planks begins somewhere else the first step is along the courses, from one brick to
   the next, and the second across; the first is 0, 0 if planks have any length. */
TEXPATCH_API int texpatch_lattice(const texpatch_job *job, float vectors[4]);

/* ---- straightening a photograph ---------------------------------------------------------- */

/* A wall or floor that was photographed at an angle, turned, or through a lens that bends lines, as
   it looks from straight in front. Its pattern must repeat in one direction at least: masonry, tiles,
   planks, roofs, cloth. */
typedef struct texpatch_straight_desc {
    txm_image photo; /* the pattern is looked for in it; not modified, need not live on             */
    txm_image mask;  /* the size of photo: looks only where it counts (txm_mask_at); pixels
                        NULL: look everywhere. Transparent pixels are not looked at either          */
    float focal;     /* focal length of the camera, in longer sides of the photograph as it was
                        taken, 0.1..100 (that for 35 mm film over 36); 0 = 0.85. It only
                        matters for the proportions of what was photographed from the side          */
    int whole;       /* 1: the largest rectangle of whole periods along each side along which the
                        pattern repeats, so that it can be tiled; 0: the largest rectangle          */
} texpatch_straight_desc;

typedef struct texpatch_straight texpatch_straight;

/* Find the pattern of a photograph, and how it was photographed.

   out    receives the result, or NULL on any error; release it with texpatch_straight_free
   return TXM_OK, also if there is no pattern; TXM_BAD_ARGUMENT, TXM_TOO_LARGE,
          TXM_OUT_OF_MEMORY, TXM_CANCELLED
   cost   some 0.1 to 1 s; some 30 bytes per pixel of a picture of at most 2600 x 2600        */
TEXPATCH_API txm_status texpatch_straight_find(const texpatch_straight_desc *desc, txm_env *env,
                                               texpatch_straight **out);

/* 1: a pattern was found; width, height (NULL is allowed) receive the size of the straight picture.
   0: there is none, or straight is NULL; the size is that of the photograph. The straight picture
   is the upright rectangle that shows most of the photograph and nothing beyond it, as fine as the
   photograph is anywhere in it, but of at most twice its pixels. */
TEXPATCH_API int texpatch_straight_found(const texpatch_straight *straight, int *width,
                                         int *height);

/* How well the pattern agrees with a plane, 0 to 1; 0 if there is none or straight is NULL. */
TEXPATCH_API double texpatch_straight_agreement(const texpatch_straight *straight);

/* Along which sides the straight picture is cut to whole periods: 1: x, 2: y, 3: both; 0: none,
   because desc.whole was 0, nothing was found or nothing repeats upright, or straight is NULL. */
TEXPATCH_API int texpatch_straight_whole(const texpatch_straight *straight);

/* Draw a picture in register with the photograph, straight; without a pattern: a copy.

   image  the size of the photograph: it itself, or another map of the same material
   map    what kind of map it is (its weight is ignored); NULL = colours. Normals turn with the
          picture, labels are never blended; colours are weighted by their alpha unless is_data
   out    of the size that was found, with the channels and samples of image
   return TXM_OK, TXM_BAD_ARGUMENT, TXM_TOO_LARGE, TXM_CANCELLED: then out is drawn in part    */
TEXPATCH_API txm_status texpatch_straight_draw(const texpatch_straight *straight,
                                               const txm_image *image, const texpatch_map *map,
                                               txm_env *env, const txm_image *out);

/* Where pixel (x, y) of the straight picture lies in the photograph, in pixels whose centres are
   whole numbers. 0: nowhere, or an argument is NULL or not finite. */
TEXPATCH_API int texpatch_straight_source(const texpatch_straight *straight, double x, double y,
                                          double source[2]);

/* Release a result; NULL is allowed. */
TEXPATCH_API void texpatch_straight_free(texpatch_straight *straight);

/* ---- levels of detail -------------------------------------------------------------------- */

/* The next coarser level of a finished map, max(1, width / 2) x max(1, height / 2) pixels, rounded
   down as graphics APIs want it: the mean of the 2 x 2 pixels that each pixel covers, of odd sides
   2 and a part, see txm_image_halve. Colours of 8 and 16 bits that are not data are averaged in
   linear light, weighted by alpha; normals are renormalised; of labels one is taken. So all levels
   agree with each other and with what a renderer makes of level 0. For cutouts see also
   txm_image_set_coverage.

   map       NULL: a picture
   tileable  TEXPATCH_TILE_X | TEXPATCH_TILE_Y, as the map was made
   half      untouched after an error: TXM_BAD_ARGUMENT, TXM_TOO_LARGE, TXM_OUT_OF_MEMORY     */
TEXPATCH_API txm_status texpatch_half(const txm_image *image, const texpatch_map *map,
                                      int tileable, txm_env *env, const txm_image *half);

/* ---- the endless plane ------------------------------------------------------------------- */

/* An endless texture without a period. Overlapping windows of it agree to the byte, even if they
   are made on different machines, so a large picture can be made tile by tile.

   The plane is divided into square cells. The areas around the cells' corners are made first,
   from the seed and their position alone; then strips along the sides between two corners; then the
   interiors. */
typedef struct texpatch_plane texpatch_plane;

/* desc as for a job; width, height, tileable, guide and kept are ignored. */
TEXPATCH_API txm_status texpatch_plane_make(const texpatch_desc *desc, txm_env *env,
                                            texpatch_plane **out);

/* Draw the window whose top left pixel is (x, y), |x|, |y| <= 2^40, for all maps: out holds
   map_count pictures of one size. Hidden colours continue what shows around them in the plane, so that
   windows agree in them, too. sources may be NULL, or width * height of them.
   cost   that of all cells that the window touches (texpatch_plane_cell pixels a side): windows
          of whole cells are cheapest                                                          */
TEXPATCH_API txm_status texpatch_plane_draw(const texpatch_plane *plane, int64_t x, int64_t y,
                                            txm_env *env, const txm_image *out,
                                            texpatch_source *sources);

/* The side of a cell, in pixels; 0 if plane is NULL. */
TEXPATCH_API int texpatch_plane_cell(const texpatch_plane *plane);

/* Release a plane; NULL is allowed. */
TEXPATCH_API void texpatch_plane_free(texpatch_plane *plane);

#ifdef __cplusplus
}
#endif
#endif /* TEXPATCH_H */

#if defined(TEXPATCH_IMPLEMENTATION) && !defined(TEXPATCH_IMPLEMENTED)
#define TEXPATCH_IMPLEMENTED

#include "texpatch/config.h"
#include "texpatch/canvas.h"
#include "texpatch/lattice.h"
#include "texpatch/courses.h"
#include "texpatch/sheets.h"
#include "texpatch/check.h"
#include "texpatch/quilt.h"
#include "texpatch/refine.h"
#include "texpatch/relax.h"
#include "texpatch/seams.h"
#include "texpatch/job.h"
#include "texpatch/finish.h"
#include "texpatch/begin.h"
#include "texpatch/draw.h"
#include "texpatch/again.h"
#include "texpatch/plane.h"
#include "texpatch/levels.h"
#include "texpatch/evened.h"
#include "texpatch/spectra.h"
#include "texpatch/field.h"
#include "texpatch/view.h"
#include "texpatch/phase.h"
#include "texpatch/wavy.h"
#include "texpatch/sighting.h"
#include "texpatch/frame.h"
#include "texpatch/whole.h"
#include "texpatch/rectify.h"
#endif /* TEXPATCH_IMPLEMENTATION */

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
