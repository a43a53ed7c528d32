/* texinpaint.h - v0.2.0 - complete the missing texture of a mesh, or a hole in a picture
   SPDX-License-Identifier: MIT OR Unlicense                   (full text: end of file)

   WHAT IT DOES
     Fills a hole in the texture of a mesh, across the seams of its atlas, or a hole in a plain
     picture: first the lines that end at the hole are continued through it, then the texture is
     completed along these lines, then everywhere else, from pieces of the surroundings [1]. Further
     maps (normals, roughness, labels) are completed from the same pieces. No known texel changes, but
     for the colour of transparent ones, which is bled from the visible ones near by.

   QUICK START                                 (tests build and run this very block)
     // Remove a disc from a striped picture. cc -std=c99 quick.c -lm
     #define TEXINPAINT_IMPLEMENTATION        // in exactly one .c or .cpp file
     #include "texinpaint.h"                  // texmath.h must lie beside it
     #include <stdio.h>

     enum { SIDE = 128 };
     static unsigned char photo[SIDE * SIDE], hole[SIDE * SIDE], whole[SIDE * SIDE];

     static txm_image image_of(unsigned char *pixels) {
         txm_image image = {pixels, SIDE, SIDE, 1, TXM_U8, 0};
         return image;
     }

     int main(void) {
         static texinpaint_desc desc;         // static: all zero, which means the defaults
         static txm_env env;                  // malloc, silent, serial; receives the message
         const txm_image out = image_of(whole);
         for (int i = 0; i < SIDE * SIDE; i++) {   // instead of a photograph: stripes
             const int x = i % SIDE - 64, y = i / SIDE - 64;
             photo[i] = (unsigned char)((i % SIDE + i / SIDE) / 16 % 2 ? 200 : 60);
             hole[i] = x * x + y * y < 400 ? 255 : 0;
         }
         desc.image = image_of(photo);
         desc.mask = image_of(hole);
         if (texinpaint_complete(&desc, &env, &out) != TXM_OK) {
             fprintf(stderr, "inpaint: %s\n", env.message);
             return 1;
         }
         printf("the centre is %d now\n", whole[SIDE * 64 + 64]);
         return 0;
     }

   WHICH CALL
     texinpaint_complete     a picture, or the texture of a mesh, and up to 15 maps in register
     texinpaint_begin, _step, _draw, _info_of, _free
                             the same step by step, to show a preview, to cancel, to try again
     texinpaint_harmonic     smooth colours only: quick, and right where nothing but shading is missing
     texinpaint_dilate       gutters only: the colours of charts spread around them, as far as wanted
     texinpaint_crest        the ridges and valleys of a mesh, as lines

   HOW IT WORKS
     The surface around a hole is laid out flat in a window, across the seams of the atlas, with as
     little distortion as possible [6] and pixels of the size of a texel; a hole that goes round a limb,
     or is large, takes several windows one after another. A plain picture is its own window. In a
     window, first, lines that end at the hole are found from the structure tensor, and all pairs of
     ends that may belong together get a curve. What a pair costs comes from how far the curve bends,
     from the colours on both sides and from tensor votes of the line ends [1, II.B; 4]; all joins are
     chosen together by annealing. Prior lines (drawn, or crest lines [1, II.C; 2]) take part. Along
     each joined line a strip of real texture is laid: square patches from the known parts of such
     lines, turned within 10 degrees, chosen by belief propagation [1, III.A; 5].
     Then the rest, from coarse to fine: 8 x 8 patches are matched with turned (pictures: little, and
     mirrored) copies of the known part, at first in rings from the rim inwards, and by annealing
     [1, III.B]; later by a randomised search [8]. A patch that has less detail than expected at its
     place costs more, so that grain does not fade, and so does one that is copied twice or from
     nearby, so that nothing is seen to repeat. At the finest level each pixel is a copy of one place;
     the pieces are joined along minimum cuts [7], and a Poisson equation takes away what steps of tone
     are left at seams and rim.
     This is done to half resolution without lines, with few lines (as in pictures of things) and with
     all ends joined (as in patterns); the one that goes on best at the rim and has the patches most
     like the surroundings wins and is completed.

   CONFIGURATION   (define before the include that has _IMPLEMENTATION)
     TEXINPAINT_STATIC       every function static to the including file (set it everywhere)
     TEXINPAINT_MAX_PIXELS   refuse larger pictures; default 2^28
     TEXINPAINT_NO_SIMD      plain C only. Else SSE2 where the compiler has it, with the same bytes.

   MEMORY
     A job copies its maps, and has 3 bytes for each pixel, with a mesh 8 and 80 for each triangle.
     A window takes some 300 bytes for each of its pixels while it is completed: 45 MB in all for a
     picture of 512 x 512 with a hole of 5 %, 80 to 100 MB for textures of 1024 x 1024. After an error
     nothing stays allocated; a job stays as it was and its step may be tried again.

   TIME   (one core of 2023; make bench measures yours)
     Holes of 5 %, RGB: 0.4 to 1.1 s in a picture of 512 x 512 (the more, the more lines there are), 2
     to 2.5 s in a texture of 1024 x 1024 on 7,000 triangles; 10 % take less than twice as long. The
     preview takes 0.1 to 0.3 s, texinpaint_harmonic 0.05 to 0.15 s. A hole with hardly anything known
     around it is slower, as no coarser level can be used.

   THREADS
     No global state: calls with different env, jobs and outputs may overlap. A job may be used by only
     one call at a time. The parallel-for hook runs bands of rows, rings of patches, strips and pixels.

   SAME BYTES
     Matches are compared in integers; all else is double, summed in a fixed order, with square roots,
     and exponentials and logarithms that are rounded to float once: the same bytes for any number of
     threads, with and without SIMD, and on any compiler that keeps to IEEE 754 (see texmath.h), built
     with -ffp-contract=off. The seed matters: where there is little to go by, try another.

   LIMITS
     It knows textures, not things: it will not finish a face, a word or the window of a house. Lines
     are continued as far as they can be seen to go on; what began and ended within the hole is lost.
     A hole that is wider than the texture around it repeats what there is. Perspective is not
     corrected. Where a surface cannot be laid out without cuts (a corner, a finger tip) the hole is
     cut, too, and lines may end at the cut.

   REFERENCES
     [1] K. Guo, X. Chen, Y. Liu, B. Zhou, Y. Guo. Geometric based structure propagation and texture
         matching for 3D texture completion. 2013.
     [2] S. Yoshizawa, A. Belyaev, H.-P. Seidel. Fast and robust detection of crest lines on meshes.
         ACM Symposium on Solid and Physical Modeling 2005.
     [3] Y. Notay. An aggregation-based algebraic multigrid method. Electronic Transactions on
         Numerical Analysis 37, 2010.
     [4] G. Medioni, M.-S. Lee, C.-K. Tang. A computational framework for segmentation and grouping.
         Elsevier, 2000.
     [5] N. Komodakis, G. Tziritas. Image completion using efficient belief propagation via priority
         scheduling and dynamic pruning. IEEE Transactions on Image Processing 16(11), 2007.
     [6] L. Liu, L. Zhang, Y. Xu, C. Gotsman, S. Gortler. A local/global approach to mesh
         parameterization. SGP 2008.
     [7] Y. Boykov, O. Veksler, R. Zabih. Fast approximate energy minimization via graph cuts. IEEE
         PAMI 23(11), 2001.
     [8] C. Barnes, E. Shechtman, A. Finkelstein, D. Goldman. PatchMatch. SIGGRAPH 2009.       */
#ifndef TEXINPAINT_H
#define TEXINPAINT_H

#include "texmath.h"

#define TEXINPAINT_VERSION "0.2.0"

#ifndef TEXINPAINT_MAX_PIXELS
#define TEXINPAINT_MAX_PIXELS (1 << 28) /* larger pictures are refused */
#endif

#if defined(TEXINPAINT_STATIC) && defined(__GNUC__)
#define TEXINPAINT_API __attribute__((unused)) static
#elif defined(TEXINPAINT_STATIC)
#define TEXINPAINT_API static
#else
#define TEXINPAINT_API extern
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* ---- what to complete --------------------------------------------------------------------- */

enum {
    TEXINPAINT_MAX_MAPS = 16,  /* pictures in register: albedo, normal, roughness, ...         */
    TEXINPAINT_MAX_SIDE = 32768 /* pixels of a picture                                          */
};

/* How one of the further maps is treated; all zero: a picture. */
typedef struct texinpaint_map {
    txm_image image; /* the size of desc.image, 1..4 channels, any sample type                  */
    int is_normal;   /* 3 or 4 channels, the first three a unit vector (txm_normal_decode) in the
                        tangent space of the texture: turned with the pieces, kept at unit length.
                        x to the right, y up (OpenGL); 2 = y down (DirectX)                     */
    int is_label;    /* values are labels, not quantities: never blended or interpolated; without
                        is_normal                                                               */
} texinpaint_map;

/* How lines are continued. */
enum {
    TEXINPAINT_AUTO = 0,  /* the hypotheses below are tried, the one that fits best wins        */
    TEXINPAINT_TEXTURE,   /* no lines: texture alone                                            */
    TEXINPAINT_PICTURE,   /* lines as in pictures of things: few, long, they may end            */
    TEXINPAINT_PATTERN    /* lines as in patterns: each line end is joined to another           */
};

/* Prior knowledge about where lines run [1, II.C]. */
enum { TEXINPAINT_PRIOR_NONE = 0, TEXINPAINT_PRIOR_CREST, TEXINPAINT_PRIOR_LINES };

/* A line on a mesh or in a picture. */
typedef struct texinpaint_line {
    const float *points; /* 3 per point on or near the surface of the mesh, in its units; for a
                            picture x, y in pixels (pixel centres at one half) and 0            */
    int count;           /* 2 or more                                                            */
} texinpaint_line;

/* What to complete, and how. All zero but image and mask is a good default. Pictures are not modified;
   they, the maps, the lines and the mesh must live as long as the job. */
typedef struct texinpaint_desc {
    txm_image image;  /* the picture, or the texture of the mesh: 1..4 channels, any sample type */
    txm_image mask;   /* same size: missing where it counts, a mask that replaces (txm_mask_use in
                         texmath.h): gray times alpha of at least half, and its soft rim         */
    txm_image source; /* same size: where texture may be taken from, a mask that allows; pixels NULL:
                         from all that is known                                                  */
    const texinpaint_map *maps; /* further maps in register, completed along with the picture    */
    int map_count;              /* 0..TEXINPAINT_MAX_MAPS - 1                                    */
    txm_mesh mesh;    /* triangles; face_count 0: the picture is a plain picture                 */
    const float *uv;  /* 2 per entry: u to the right, v downwards, 0..1 is the picture once; values
                         outside repeat it                                                       */
    size_t uv_count;  /* entries of uv                                                           */
    const uint32_t *uv_indices; /* 3 per triangle, which entry its corners have; NULL: the entry of
                         the corner's vertex                                                     */
    int gutter;       /* missing texels outside the charts are filled up to so many texels from
                         them, 1..TEXINPAINT_MAX_SIDE; 0 = 8; -1 = none                          */
    int structure;    /* TEXINPAINT_AUTO .. TEXINPAINT_PATTERN                                   */
    int prior;        /* TEXINPAINT_PRIOR_...                                                    */
    const texinpaint_line *lines; /* that the completed lines should follow, for
                         TEXINPAINT_PRIOR_LINES                                                  */
    int line_count;   /* 0 or more; 1 or more for TEXINPAINT_PRIOR_LINES                        */
    float alpha;      /* line ends farther apart than this are not joined, in texels along the
                         surface, 0..1e6; 0 = 1.5 times the diameter of the hole [1, II.B]      */
    int beta;         /* votes are propagated into the hole at most so often, 0..4096; 0 = 64
                         [1, II.B]                                                              */
    uint64_t seed;    /* another seed gives another completion                                   */
    /* Receives intermediate results as pictures: points, votes, lines, hypotheses, pieces; NULL = none.
       The picture belongs to the library and lives until the function returns.                 */
    void (*show)(void *user, const char *name, const txm_image *picture);
    void *show_user;
} texinpaint_desc;

/* Complete the picture and its maps in one call.

   env    NULL, or how to allocate, report, cancel and run in parallel
   out    1 + map_count pictures, size, channels and sample type of image and of each map: known
          texels are copied, missing ones completed. Untouched after an error. They may be the
          inputs themselves
   return TXM_OK; TXM_BAD_ARGUMENT for a field outside its range, pictures that do not match, samples
          or coordinates that are not finite, a mesh without texture coordinates; TXM_TOO_SMALL if
          nothing is known that may be copied from; TXM_TOO_LARGE; TXM_OUT_OF_MEMORY;
          TXM_CANCELLED                                                                        */
TEXINPAINT_API txm_status texinpaint_complete(const texinpaint_desc *desc, txm_env *env,
                                              const txm_image *out);

/* ---- step by step ------------------------------------------------------------------------ */

/* What was done, for curious callers. */
typedef struct texinpaint_info {
    int holes;           /* connected holes on the surface, or in the picture                    */
    int windows;         /* flat windows that were completed, or left smooth as there are no
                            8 x 8 texels around to copy                                          */
    int structure;       /* of the largest window: TEXINPAINT_TEXTURE .. TEXINPAINT_PATTERN; 0:
                            none has been completed, or all were left smooth                     */
    int line_ends;       /* line ends found at the border of the holes                           */
    int joins;           /* lines continued from border to border                                */
    size_t missing;      /* texels that were missing and lie in a chart                          */
    size_t written;      /* texels written, gutters included                                     */
} texinpaint_info;

/* A completion that is made step by step. It keeps a copy of the allocator. */
typedef struct texinpaint_job texinpaint_job;

/* Prepare a job.

   out    receives the job, or NULL on any error; release it with texinpaint_free
   return as texinpaint_complete
   cost   O(texels) and O(triangles); with TEXINPAINT_PRIOR_CREST that of texinpaint_crest      */
TEXINPAINT_API txm_status texinpaint_begin(const texinpaint_desc *desc, txm_env *env,
                                           texinpaint_job **out);

/* One step of the work. The first makes a preview: smooth colours in the holes, and the lines through
   the first hole. Then each window takes two: the first leaves a picture of half the resolution.
   After an error (cancelling included) the step may be tried again.
   env    its progress callback receives the fraction of all steps that is done
   more   receives 1, or 0 once nothing is left to do; NULL is allowed
   return TXM_OK, also if nothing is left to do; TXM_BAD_ARGUMENT: job is NULL; TXM_TOO_LARGE;
          TXM_OUT_OF_MEMORY; TXM_CANCELLED                                                    */
TEXINPAINT_API txm_status texinpaint_step(texinpaint_job *job, txm_env *env, int *more);

/* Copy the picture (map 0) or a further map (1..map_count) in its current state.

   env    receives the message of an error; NULL is allowed
   out    size, channels and sample type of the input; untouched after an error
   return TXM_OK; TXM_BAD_ARGUMENT before the first step, for a map that there is not, and for an
          out of another form; TXM_TOO_LARGE                                                  */
TEXINPAINT_API txm_status texinpaint_draw(const texinpaint_job *job, int map, txm_env *env,
                                          const txm_image *out);

/* What has been done so far; job is not NULL. */
TEXINPAINT_API texinpaint_info texinpaint_info_of(const texinpaint_job *job);

/* Release a job; NULL is allowed. */
TEXINPAINT_API void texinpaint_free(texinpaint_job *job);

/* ---- without texture: smooth fill, gutters -------------------------------------------------- */

/* Fill the holes smoothly: each colour is a harmonic function on the surface (in the picture, without
   a mesh), its values at the border of the hole those of the known texels, the seams of the atlas
   without effect. image, mask, maps, mesh, uv and gutter of the desc are used. Colours are averaged times
   their alpha; normals in space, then made unit; labels are those of the nearest known texel. Parts of the
   surface without any known texel get the mean colour of the known ones.
   return as texinpaint_complete; TXM_TOO_SMALL if nothing in the charts is known
   cost   about 3 us per missing texel of three channels of 8 bits, 200 bytes               */
TEXINPAINT_API txm_status texinpaint_harmonic(const texinpaint_desc *desc, txm_env *env,
                                              const txm_image *out);

/* Fill the gutters: every texel outside the charts, however far (or up to desc->gutter texels, measured
   from centre to centre), gets the values of the nearest texel in a chart, in all maps. The picture does
   not wrap. image, maps, mesh, uv, gutter (0 = without limit) are used; mask, if it has pixels, marks
   texels in charts that are not to be spread either. Without a mesh the masked pixels are filled, from
   the others; without mesh and mask those that are fully transparent get the colour of the nearest one
   that is not, and stay transparent.
   return as texinpaint_complete; TXM_TOO_SMALL if there is nothing to spread
   cost   O(pixels), about 20 ns and 6 bytes each                                           */
TEXINPAINT_API txm_status texinpaint_dilate(const texinpaint_desc *desc, txm_env *env,
                                            const txm_image *out);

/* ---- crest lines ------------------------------------------------------------------------- */

/* kinds of crest lines; add them up in a description */
enum { TEXINPAINT_RIDGE = 1, TEXINPAINT_VALLEY = 2 };

/* Which crest lines of a mesh to find. All zero but mesh is a good default. */
typedef struct texinpaint_crest_desc {
    txm_mesh mesh;    /* triangles, counter-clockwise from outside, of any connectivity; vertices in
                         equal places count as one                                              */
    float threshold;  /* weaker lines are left out, 0..1e6; the strength of a line is the integral of
                         its curvature along it, without unit: 1 for one as long as its radius of
                         curvature. 0 = 2, or 0.02 of the strongest line if that is more        */
    int kinds;        /* TEXINPAINT_RIDGE, TEXINPAINT_VALLEY, or their sum; 0 = both            */
    int rings;        /* rings of vertices around each that curvature is taken from, 1..8; more for
                         noisy meshes; 0 = 2                                                    */
} texinpaint_crest_desc;

/* Lines, the strongest first. Closed ones end with their first point. */
typedef struct texinpaint_crests {
    texinpaint_line *lines; /* points on the surface, about one per triangle                    */
    const float *strengths; /* 1 per line                                                       */
    const uint8_t *kinds;   /* 1 per line: TEXINPAINT_RIDGE or TEXINPAINT_VALLEY                */
    size_t line_count;
    txm_arena memory; /* private */
} texinpaint_crests;

/* The crest lines of a mesh: where the larger principal curvature has an extremum along its own line
   of curvature [2]. The estimate comes from a cubic fitted around each vertex. A mesh without faces has
   none.
   out    receives the lines, or NULL on any error; release it with texinpaint_crests_free
   return TXM_OK; TXM_BAD_ARGUMENT for a field outside its range, or a mesh that is not valid;
          TXM_TOO_LARGE; TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost   about 5 us per vertex with 2 rings                                                  */
TEXINPAINT_API txm_status texinpaint_crest(const texinpaint_crest_desc *desc, txm_env *env,
                                           texinpaint_crests **out);

/* Release lines; NULL is allowed. */
TEXINPAINT_API void texinpaint_crests_free(texinpaint_crests *crests);

#ifdef __cplusplus
}
#endif
#endif /* TEXINPAINT_H */

#if defined(TEXINPAINT_IMPLEMENTATION) && !defined(TEXINPAINT_IMPLEMENTED)
#define TEXINPAINT_IMPLEMENTED

#include "texinpaint/config.h"
#include "texinpaint/raster.h"
#include "texinpaint/check.h"
#include "texinpaint/surface.h"
#include "texinpaint/geodesic.h"
#include "texinpaint/factor.h"
#include "texinpaint/unfold.h"
#include "texinpaint/flatten.h"
#include "texinpaint/resample.h"
#include "texinpaint/window.h"
#include "texinpaint/sheet.h"
#include "texinpaint/layout.h"
#include "texinpaint/graph.h"
#include "texinpaint/multigrid.h"
#include "texinpaint/harmonic.h"
#include "texinpaint/curvature.h"
#include "texinpaint/crest.h"
#include "texinpaint/prior.h"
#include "texinpaint/vote.h"
#include "texinpaint/slope.h"
#include "texinpaint/trace.h"
#include "texinpaint/grow.h"
#include "texinpaint/pair.h"
#include "texinpaint/join.h"
#include "texinpaint/judge.h"
#include "texinpaint/belief.h"
#include "texinpaint/stroke.h"
#include "texinpaint/strip.h"
#include "texinpaint/whole.h"
#include "texinpaint/cover.h"
#include "texinpaint/chain.h"
#include "texinpaint/lay.h"
#include "texinpaint/picture.h"
#include "texinpaint/detail.h"
#include "texinpaint/pose.h"
#include "texinpaint/search.h"
#include "texinpaint/onion.h"
#include "texinpaint/anneal.h"
#include "texinpaint/ballot.h"
#include "texinpaint/assemble.h"
#include "texinpaint/fill.h"
#include "texinpaint/look.h"
#include "texinpaint/blend.h"
#include "texinpaint/choose.h"
#include "texinpaint/preview.h"
#include "texinpaint/job.h"
#endif /* TEXINPAINT_IMPLEMENTATION */

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
