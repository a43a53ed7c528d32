/* texedges.h - v0.1.0 - the gray layers of a picture, their boundaries, and strokes drawn like them
   SPDX-License-Identifier: MIT OR Unlicense                   (full text: end of file)          */
#ifndef TEXEDGES_H
#define TEXEDGES_H

#include "texmath.h"

#define TEXEDGES_VERSION "0.1.0"

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

/* The boundaries of the gray layers of a picture [1, 3.2]. Layer k holds the pixels whose gray
   value g has thresholds[k-1] <= g < thresholds[k] (the first from 0, the last to 1). */
typedef struct texedges_polyline {
    int layer;        /* 0..levels-1: this is a boundary of that layer                        */
    int is_hole;      /* the layer lies outside it                                            */
    size_t first;     /* its points are points[first .. first + count - 1], closed: the last is
                         joined to the first                                                  */
    size_t count;
} texedges_polyline;

/* Found lines run along the cracks between pixels, a point at each pixel corner that they pass.
   The layer lies to the right of the way (outer boundaries run clockwise as seen, holes the other
   way), and what lies beyond the picture belongs to no layer. Each side of each crack between two
   layers is part of exactly one line. Pixels that touch at a corner only do not belong together:
   where a layer meets itself so, its line turns right, around the pixel that it came along. So
   lines may touch at a corner but never cross, neither themselves nor others.

         +---+              lines are in raster order of their first points: the top left corner
         | k |              of the topmost (then leftmost) pixel of an outer boundary
     +---+---+  the two pixels of layer k have a line each; the two
     | k |      others too, whether of one layer or not
     +---+                                                                                    */
typedef struct texedges_set {
    int levels, width, height;
    float thresholds[TEXEDGES_MAX_LEVELS]; /* levels - 1 of them, rising, of the gray 0..1     */
    int beside[TEXEDGES_MAX_LEVELS]; /* the layer that most of this layer's boundary borders on; -1:
                                        none, it has no boundary but the picture's              */
    texedges_polyline *lines;
    size_t line_count;
    txm_vec2 *points; /* (0, 0) is the top left corner of the picture, (0.5, 0.5) the centre of the
                         top left pixel                                                        */
    size_t point_count;
    txm_arena memory; /* belongs to the header                                                 */
} texedges_set;

/* What to find. All zero but the image is a good default. */
typedef struct texedges_desc {
    txm_image image; /* 1..4 channels; the gray is the luma of RGB (0.2126, 0.7152, 0.0722) of the
                        samples as they are, cut off at 0 and 1; alpha is not looked at        */
    int levels;      /* 2..TEXEDGES_MAX_LEVELS; 0 = 4, as the paper has it                     */
    float smooth;    /* radius in pixels of a blur beforehand, 0..16; a fine-grained picture needs
                        1 to 3                                                                 */
    int least;       /* regions whose boundary (holes and the picture's border included) is shorter
                        than so many pixels go to the surrounding layer that they share most of
                        it with, the shortest first; 0 = all are kept                          */
    const float *thresholds; /* levels - 1 of them, rising, in 0..1; NULL = such that the layers
                        have about the same area, at the emptiest gray near there */
} texedges_desc;

/* Find the boundaries of all layers.

   env    NULL, or how to allocate, report and cancel
   out    receives them; release it with texedges_set_free. Untouched after an error
   return TXM_OK; TXM_BAD_ARGUMENT for a field outside its range or samples that are not finite;
          TXM_TOO_LARGE above TEXEDGES_MAX_PIXELS or 2^20 pixels a side; TXM_OUT_OF_MEMORY;
          TXM_CANCELLED
   cost   O(pixels (1 + smooth + log least)) time, about 0.2 us a pixel; 13 bytes a pixel while it
          works (9 without least, 5 without both), and the result: 8 bytes for each point, of which
          there are up to four a pixel, and 24 for each line                                   */
TEXEDGES_API txm_status texedges_find(const texedges_desc *desc, txm_env *env,
                                      texedges_set *out);

/* Release edges, which are all zero then; NULL and all zero are allowed. Of several copies of the
   struct only one may be released. */
TEXEDGES_API void texedges_set_free(texedges_set *edges);

/* The layer of each pixel of a picture, by the thresholds of edges, as a gray value: layer k is
   255 k / (levels - 1), rounded. It serves as the guide of an exemplar (see control edges).

   desc   image, smooth and least are looked at; with those that edges were found with, the layers
          change exactly where its lines run
   layers TXM_U8, 1 channel, the size of the picture; untouched after an error
   return as texedges_find
   cost   as texedges_find; 13 bytes a pixel                                             */
TEXEDGES_API txm_status texedges_layers(const texedges_desc *desc,
                                        const texedges_set *edges, txm_env *env,
                                        const txm_image *layers);

/* Draw boundaries of one layer (-1: of all) over a picture (TXM_U8, 1 or 3 channels), one pixel
   wide, on the layer's own side; colours run from dark to light with the layers, in one channel the
   gray. What lies outside of the picture is not drawn.
   cost   a byte for each pixel; O(pixels + length of the lines) time                           */
TEXEDGES_API txm_status texedges_draw(const texedges_set *edges, int layer, txm_env *env,
                                      const txm_image *image);

/* ---- control edges ----------------------------------------------------------------------- */

/* A stroke of the user: a line that becomes an edge of the texture [1, 3.3]. Where it is closed,
   its inside becomes the layer; an open one becomes a band of the layer, as wide as width says,
   with round ends. */
typedef struct texedges_stroke {
    const txm_vec2 *points; /* count of them, 2 or more (closed: 3), not all the same, in pixels of
                               the output; they may lie outside it, up to 2^20                  */
    int count;
    int is_closed;
    int layer;   /* 0..levels-1: what lies within                                               */
    float width; /* of an open stroke, pixels, 2..256; 0 = 8                                    */
} texedges_stroke;

typedef struct texedges_control {
    const texedges_set *edges; /* of the exemplar, from texedges_find                   */
    const texedges_stroke *strokes;
    int stroke_count;  /* 0 or more                                                             */
    int background;    /* layer outside of all strokes; -1 = free: whatever the texture has, but
                          next to a stroke not the stroke's own layer */
    float disturb;     /* 0..4: how much of the exemplar's unrest the strokes take on; 0 = 1;
                          -1 = none                                                             */
    uint64_t seed;     /* another seed, another unrest                                          */
} texedges_control;

/* The strokes, disturbed with the statistics of the exemplar's edges of their layer: pieces of the
   way in which those stray from their own smooth course are strung together along the stroke.

   out    receives one closed line for each stroke, in their order (of an open stroke: around its
          band), inside to the right; levels, thresholds and beside are the exemplar's, width and
          height those given. Release it with texedges_set_free; untouched after an error.
          A line strays from its stroke (the edge of its band) by 4 pixels at most; less from short
          strokes and narrow bands, by 1/16 of the length and 7/16 of the width. Where the stroke
          turns gently (radii over 8 pixels, no part nearer than 8 pixels to another) it does not
          cross itself. Of a layer without edges of 64 pixels in the exemplar, and with disturb =
          -1, it is the stroke itself
   return TXM_OK; TXM_BAD_ARGUMENT for a field outside its range, coordinates that are not finite,
          edges that texedges_find did not make; TXM_TOO_LARGE for strokes longer than 2^26
          pixels; TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost   O(edges + length of the strokes) time, about 1 us for each pixel of either; 200 bytes for
          each pixel of the longest stroke (its band's outline), 30 for each of all, 100 for each of
          the edges of a layer                                                                 */
TEXEDGES_API txm_status texedges_disturb(const texedges_control *control, int width, int height,
                                         txm_env *env, texedges_set *out);

/* The guide that makes a job follow the strokes, for texpatch_desc.guide and .guide_mask; the
   exemplars' counterpart is texedges_layers's picture.

   disturbed  what texedges_disturb made of the same control
   guide  TXM_U8, 1 channel, the size given to texedges_disturb: the gray of the layer. Pixels whose
          centre lies inside a line (winding number not 0; of a centre on the line, that to its
          right or below is inside) have the stroke's layer, the last stroke on top. With
          background = -1, up to 8 pixels outside of the strokes it is the layer that the nearest
          stroke's layer mostly borders on in the exemplar
   mask   the same format: 0 where the strokes say nothing (with background = -1, farther than 8
          pixels outside of all strokes), else 255
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
