/* texedges.h - v0.2.0 - the gray layers of a picture, their boundaries, and strokes drawn like them
   SPDX-License-Identifier: MIT OR Unlicense                   (full text: end of file)

   WHAT IT DOES
     Divides the gray values of a picture into a few layers and finds the boundaries between them,
     as closed lines and as pictures [1, 3.2]. Strokes that a user draws are disturbed with the
     statistics of these boundaries, so that they look like edges of the texture, and become a guide
     picture that says which layer each pixel should show [1, 3.3].

   QUICK START                                 (tests build and run this very block)
     // Layers of a picture, and a stroke with edges like theirs. cc -std=c99 quick.c -lm
     #define TEXEDGES_IMPLEMENTATION          // in exactly one .c or .cpp file
     #include "texedges.h"                    // texmath.h must lie beside it
     #include <stdio.h>

     enum { SIDE = 128 };
     static unsigned char photo[SIDE * SIDE], layers[SIDE * SIDE];   // the caller owns all pixels
     static unsigned char guide[SIDE * SIDE], mask[SIDE * SIDE];

     static txm_image image_of(unsigned char *pixels) {
         txm_image image = {pixels, SIDE, SIDE, 1, TXM_U8, 0};
         return image;
     }

     int main(void) {
         static texedges_desc desc;           // static: all zero, which means the defaults
         static texedges_control control;
         static texedges_stroke stroke;
         static txm_env env;                  // malloc, silent, serial; receives the message
         const txm_vec2 points[3] = {{16, 90}, {64, 64}, {112, 90}};
         const txm_image layers_out = image_of(layers), guide_out = image_of(guide);
         const txm_image mask_out = image_of(mask);
         texedges_set *edges = NULL, *lines = NULL;
         for (int i = 0; i < SIDE * SIDE; i++) {   // instead of a photograph: wavy stripes
             const int x = i % SIDE, y = i / SIDE;
             photo[i] = (unsigned char)((y + x * x / 16 % 7) / 16 % 2 ? 200 : 60);
         }
         desc.image = image_of(photo);
         desc.levels = 2;
         stroke.points = points;
         stroke.count = 3;
         stroke.layer = 1;                    // the bright one
         stroke.width = 20;
         control.strokes = &stroke;
         control.stroke_count = 1;
         control.background = -1;             // free: anything, away from the stroke
         int ok = texedges_find(&desc, &env, &edges) == TXM_OK &&
                  texedges_layers(&desc, edges, &env, &layers_out) == TXM_OK;
         control.edges = edges;
         ok = ok && texedges_disturb(&control, SIDE, SIDE, &env, &lines) == TXM_OK &&
              texedges_guide(&control, lines, &env, &guide_out, &mask_out) == TXM_OK;
         if (ok)
             printf("%d boundaries; the stroke has gray %d\n", (int)edges->line_count,
                    guide[SIDE * 64 + 64]);
         else fprintf(stderr, "edges: %s\n", env.message);
         texedges_set_free(lines);
         texedges_set_free(edges);
         return !ok;
     }

   WHICH CALL
     texedges_find        the boundaries of all layers, as lines
     texedges_layers      the layer of each pixel, as a gray picture
     texedges_draw        lines drawn over a picture
     texedges_disturb     strokes, disturbed like the boundaries of their layer
     texedges_guide       the guide picture of disturbed strokes, and where it counts
     To follow strokes in a texture made with texpatch.h: the picture of texedges_layers is the
     guide of its exemplar, the two pictures of texedges_guide are its guide and guide_mask.

   HOW IT WORKS
     The histogram of the grays is divided into parts of about the same area, at its least frequent
     values; small connected regions can be merged into the layer around them. Lines follow the
     cracks between pixels. The roughness of a layer is how far its lines P deviate from their smooth
     course 2 S P - S S P (S a blur of 32 pixels), along and across it. Along a stroke pieces of this
     roughness, 16 to 48 pixels long, are joined end to end; of those that join well the one is
     taken that brings the directions of the line closest to those of the exemplar's lines. Loops
     are cut off, and the line is filled by its winding number.

   CONFIGURATION   (define before the include that has _IMPLEMENTATION)
     TEXEDGES_STATIC       every function static to the including file (set it everywhere)
     TEXEDGES_MAX_PIXELS   refuse larger pictures; default 2^28

   MEMORY
     5 to 13 bytes for each pixel while layers are found, 8 for each point of the lines, of which
     there are up to four a pixel, 200 for each pixel along the longest stroke. After an error
     nothing stays allocated, and the set to be returned is NULL.

   TIME   (one core of 2023)
     Some 0.2 us for each pixel of a picture, 1 us for each pixel along edges and strokes, 50 ns for
     each pixel of a guide. All work is serial.

   THREADS
     No global state: calls with different env and outputs may overlap; a finished set may be read
     by many.

   SAME BYTES
     Layers, lines, and guides are made in integers; blurs and strokes in double, by sums in a fixed
     order and square roots, rounded to float once: the same bytes on any compiler that keeps to
     IEEE 754 (see texmath.h), built with -ffp-contract=off.

   REFERENCES
     [1] GPU-based interactive near-regular texture synthesis for digital human models.
         Technology and Health Care.                                                            */
#ifndef TEXEDGES_H
#define TEXEDGES_H

#include "texmath.h"

#define TEXEDGES_VERSION "0.2.0"

#ifndef TEXEDGES_MAX_PIXELS
#define TEXEDGES_MAX_PIXELS (1 << 28) /* larger pictures are refused */
#endif

#if defined(TEXEDGES_STATIC) && defined(__GNUC__)
#define TEXEDGES_API __attribute__((unused)) static
#elif defined(TEXEDGES_STATIC)
#define TEXEDGES_API static
#else
#define TEXEDGES_API extern
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* ---- layered edges ----------------------------------------------------------------------- */

enum { TEXEDGES_MAX_LEVELS = 16 };

/* One boundary of a layer: its points are points[first .. first + count - 1] of the set, closed
   (the last is joined to the first). */
typedef struct texedges_polyline {
    int layer;    /* 0..levels-1: this is a boundary of that layer                            */
    int is_hole;  /* the layer lies outside it                                                */
    size_t first, count;
} texedges_polyline;

/* The boundaries of the gray layers of a picture [1, 3.2]. Layer k holds the pixels whose gray
   value g has thresholds[k-1] <= g < thresholds[k] (the first from 0, the last to 1).

   Lines that texedges_find makes run along the cracks between pixels, with a point at each pixel
   corner that they pass. The layer lies to the right of the line's direction (outer boundaries run
   clockwise as seen, holes counter-clockwise); the outside of the picture belongs to no layer.
   Each side of each crack between two layers is part of exactly one line. Pixels that touch only at
   a corner are not connected: where two pixels of a layer touch so, its line turns right, around the
   pixel that it came along. So lines may touch at a corner, but never cross themselves or each other.

         +---+              lines are in raster order of their first points: the top left corner
         | k |              of the topmost (then leftmost) pixel of an outer boundary
     +---+---+  the two pixels of layer k have a line each; the two
     | k |      others too, whether they are of one layer or not
     +---+                                                                                    */
typedef struct texedges_set {
    int levels, width, height;
    float thresholds[TEXEDGES_MAX_LEVELS]; /* levels - 1 of them, rising, of the gray 0..1     */
    int beside[TEXEDGES_MAX_LEVELS]; /* the layer that shares most of this layer's boundary; -1:
                                        none, it has no boundary but the picture's              */
    texedges_polyline *lines;
    size_t line_count;
    txm_vec2 *points; /* (0, 0) is the top left corner of the picture, (0.5, 0.5) the centre of the
                         top left pixel                                                        */
    size_t point_count;
    txm_arena memory; /* private: holds the set                                                */
} texedges_set;

/* What to find. All zero but the image is a good default. */
typedef struct texedges_desc {
    txm_image image; /* 1..4 channels; the gray is the luma of RGB (0.2126, 0.7152, 0.0722) of the
                        samples as they are, clamped to 0..1; alpha is not used, but where it
                        is 0 the colour is taken from visible neighbours                       */
    int levels;      /* 2..TEXEDGES_MAX_LEVELS; 0 = 4, as in the paper                         */
    float smooth;    /* radius in pixels of a blur beforehand, 0..16; a fine-grained picture needs
                        1 to 3                                                                 */
    int least;       /* pixels: a connected region whose boundary (holes and the picture's border
                        included) is shorter is merged into the neighbouring layer that shares
                        most of that boundary, the shortest first; 0 = all regions are kept    */
    const float *thresholds; /* levels - 1 of them, rising, in 0..1; NULL = such that the layers
                        have about the same area, each at the least frequent gray nearby       */
} texedges_desc;

/* Find the boundaries of all layers.

   env    NULL, or how to allocate, report and cancel
   out    receives the set, or NULL on any error; release it with texedges_set_free
   return TXM_OK; TXM_BAD_ARGUMENT for a field outside its range or samples that are not finite;
          TXM_TOO_LARGE above TEXEDGES_MAX_PIXELS or 2^20 pixels a side; TXM_OUT_OF_MEMORY;
          TXM_CANCELLED
   cost   O(pixels (1 + smooth + log least)) time, about 0.2 us a pixel; 13 bytes a pixel while it
          works (9 without least, 5 without both), and the result: 8 bytes for each point, of which
          there are up to four a pixel, and 24 for each line                                   */
TEXEDGES_API txm_status texedges_find(const texedges_desc *desc, txm_env *env, texedges_set **out);

/* Release a set; NULL is allowed. */
TEXEDGES_API void texedges_set_free(texedges_set *set);

/* The layer of each pixel of a picture, by the thresholds of a set, as a gray value: layer k is
   255 k / (levels - 1), rounded. It serves as the guide of an exemplar (see control edges).

   desc   image, smooth and least are used; with those that the set was found with, the layers
          change exactly where its lines run
   edges  whose thresholds to use
   layers TXM_U8, 1 channel, the size of the picture; untouched after an error
   return as texedges_find
   cost   as texedges_find; 13 bytes a pixel                                                   */
TEXEDGES_API txm_status texedges_layers(const texedges_desc *desc, const texedges_set *edges,
                                        txm_env *env, const txm_image *layers);

/* Draw the boundaries of one layer (-1: of all) over a picture (TXM_U8, 1 or 3 channels), one pixel
   wide, on the layer's own side; colours run from dark to light with the layers, in one channel the
   gray. What lies outside the picture is not drawn. The picture is untouched after an error.
   cost   a byte for each pixel; O(pixels + length of the lines) time                           */
TEXEDGES_API txm_status texedges_draw(const texedges_set *edges, int layer, txm_env *env,
                                      const txm_image *image);

/* ---- control edges ----------------------------------------------------------------------- */

/* A stroke of the user: a line that becomes an edge of the texture [1, 3.3]. The inside of a closed
   one becomes the layer; an open one becomes a band of the layer with round ends. */
typedef struct texedges_stroke {
    const txm_vec2 *points; /* count of them, 2 or more (closed: 3), not all the same, in pixels of
                               the output; they may lie outside it, up to 2^20                  */
    int count;
    int is_closed;
    int layer;   /* 0..levels-1: of the inside, or of the band                                  */
    float width; /* of the band of an open stroke, pixels, 2..256; 0 = 8                        */
} texedges_stroke;

/* Strokes, and how to treat them. */
typedef struct texedges_control {
    const texedges_set *edges; /* of the exemplar, from texedges_find                           */
    const texedges_stroke *strokes;
    int stroke_count;  /* 0 or more                                                             */
    int background;    /* the layer outside all strokes; -1 = free: any layer, except the stroke's
                          own next to a stroke                                                  */
    float disturb;     /* 0..4: how much of the exemplar's roughness the strokes take on; 0 = 1;
                          -1 = none                                                             */
    uint64_t seed;     /* another seed gives another disturbance                                */
} texedges_control;

/* The strokes, disturbed with the statistics of the exemplar's edges of their layer: pieces of the
   roughness of those edges, their deviation from their own smooth course, are joined end to end
   along the stroke.

   width, height  of the output, in pixels
   out    receives one closed line for each stroke, in their order (of an open stroke: around its
          band), inside to the right; or NULL on any error. levels, thresholds and beside are the
          exemplar's. Release it with texedges_set_free.
          A line deviates from its stroke (the edge of its band) by 4 pixels at most; from short
          strokes and narrow bands by less, 1/16 of the length and 7/16 of the width. Where the
          stroke turns gently (radii over 8 pixels, no part nearer than 8 pixels to another) the
          line does not cross itself. If the exemplar has no edge of that layer of 64 pixels or
          more, and with disturb = -1, it is the stroke itself
   return TXM_OK; TXM_BAD_ARGUMENT for a field outside its range, coordinates that are not finite,
          edges that texedges_find did not make; TXM_TOO_LARGE for strokes longer than 2^26 pixels;
          TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost   O(edges + length of the strokes) time, about 1 us for each pixel of either; 200 bytes for
          each pixel of the longest stroke (its band's outline), 30 for each of all, 100 for each of
          the edges of a layer                                                                 */
TEXEDGES_API txm_status texedges_disturb(const texedges_control *control, int width, int height,
                                         txm_env *env, texedges_set **out);

/* The guide picture of disturbed strokes, and the mask of where it counts. With texpatch.h they are
   texpatch_desc.guide and .guide_mask, and the picture of texedges_layers is the exemplar's guide.

   disturbed  what texedges_disturb made of the same control
   guide  TXM_U8, 1 channel, the size given to texedges_disturb: the gray of the layer. Pixels whose
          centre lies inside a line (winding number not 0; of a centre on the line, that to its
          right or below is inside) have the stroke's layer, the last stroke on top. With
          background = -1, up to 8 pixels outside the strokes it is the layer that shares most of
          the boundary of the nearest stroke's layer in the exemplar
   mask   the same format: 0 where the guide does not count (with background = -1, farther than 8
          pixels outside all strokes), else 255
   return TXM_OK; TXM_BAD_ARGUMENT; TXM_TOO_LARGE; TXM_OUT_OF_MEMORY; TXM_CANCELLED. After an error
          guide and mask are untouched
   cost   O(pixels + area and height of the strokes) time, about 50 ns a pixel; 3 bytes a pixel and
          24 for each row that a stroke's line crosses                                           */
TEXEDGES_API txm_status texedges_guide(const texedges_control *control,
                                       const texedges_set *disturbed, txm_env *env,
                                       const txm_image *guide, const txm_image *mask);

#ifdef __cplusplus
}
#endif
#endif /* TEXEDGES_H */

#if defined(TEXEDGES_IMPLEMENTATION) && !defined(TEXEDGES_IMPLEMENTED)
#define TEXEDGES_IMPLEMENTED

#include "texedges/config.h"
#include "texedges/check.h"
#include "texedges/layers.h"
#include "texedges/lines.h"
#include "texedges/roughness.h"
#include "texedges/strokes.h"
#include "texedges/guide.h"
#endif /* TEXEDGES_IMPLEMENTATION */

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
