/* texmath.h - v0.2.0 - what all texkit headers share
   SPDX-License-Identifier: MIT OR Unlicense                   (full text: end of file)

   WHAT IT DOES
     The basics that every texkit header needs: status codes, the environment (allocator,
     progress and cancel, parallel-for), checked size arithmetic, image views, a random number
     generator, a sort, vectors, quaternions, sRGB; and the few kernels that more than one of them
     uses: eigenvectors of a symmetric 3x3 matrix, the minimum-error cut, the minimum cut of a grid,
     levels of detail of an image, means of pixels weighted by alpha and colour for those that hide
     theirs, the measuring and the evening of uneven light, the Poisson equation on a masked image,
     and the edge adjacency of a mesh.

   QUICK START                                 (tests build and run this very block)
     // Fill a hole in an image smoothly. cc -std=c99 quick.c -lm
     #include "texmath.h"
     #include <stdio.h>

     int main(void) {
         static float pixels[64 * 64];            // the caller owns all pixels
         static unsigned char hole[64 * 64];
         static txm_poisson_desc desc;            // static: all zero, the default for every field
         static txm_env env;                      // malloc, silent, serial; receives the message
         desc.image.pixels = pixels;
         desc.image.width = desc.image.height = 64;
         desc.image.sample = TXM_F32;
         desc.mask = desc.image;
         desc.mask.pixels = hole;
         desc.mask.sample = TXM_U8;
         for (int y = 0; y < 64; y++) {
             for (int x = 0; x < 64; x++) {
                 hole[64 * y + x] = x >= 16 && x < 48 && y >= 16 && y < 48 ? 255 : 0;
                 txm_image_set(&desc.image, x, y, 0, hole[64 * y + x] ? 0.0f : (float)x / 63.0f);
             }
         }
         if (txm_poisson(&desc, &env) != TXM_OK) {
             fprintf(stderr, "poisson: %s\n", env.message);
             return 1;
         }
         printf("centre of the ramp: %.4f\n", txm_image_get(&desc.image, 32, 32, 0)); // 0.5079
         return 0;
     }

   CONFIGURATION
     TXM_ASSERT(x)          checks for errors in the library, which no input can trigger; default
                            assert of <assert.h>
     Every function is static inline, there is no implementation section: include the file
     wherever it is needed, in C99 or later and in C++11 or later, and link the math library.

   CONVENTIONS
     Right-handed space. Angles are in radians. A quaternion (x, y, z, w) has its scalar last, as in
     glTF. Image rows go from top to bottom, x to the right.
     Masks are pictures of any form: gray times alpha, and what is at least half of its range counts.
     txm_mask_use tells the whole rule, which all headers of the suite keep.

   MEMORY
     Nine functions allocate, all through the environment: txm_alloc, txm_arena_alloc,
     txm_arena_zero, txm_flow_make and txm_image_bled (from an arena), txm_image_bleed, txm_even,
     txm_uneven and txm_poisson. The last four free all of it before they return: txm_poisson holds
     64 + 4 * channels bytes for each unknown pixel. The sort, the minimum-error cut and the sides of a mesh work in the caller's memory.

   THREADS
     No global state. Two calls may overlap unless they share what one of them writes: an env, an
     arena, a generator, an image.

   SAME BYTES
     Integers, 8- and 16-bit samples, generator, hash and sort: the same bits everywhere. All else
     is computed in double in a fixed order and rounded once, by txm_float, which works around a
     bug of gcc (vectors in double are not rounded). That gives the same bits wherever arithmetic is
     IEEE 754 (on 32-bit x86: -msse2), with -ffp-contract=off (the default of gcc -std=c99) and
     without -ffast-math. No result depends on the C library: of its functions only sqrt, fabs, floor
     and ceil are used, which are exact.
     Sort, cut, eigenvectors and the sides of a mesh give the same result even where there are
     ties.

   LIMITS
     An image may span PTRDIFF_MAX bytes; txm_poisson takes up to 2^31 - 1 unknowns; a mesh may have
     up to 2^32 - 2 sides. Functions that return no status expect arguments in the range stated and
     do not check them.

   REFERENCES
     [1] M. O'Neill. PCG: a family of simple fast space-efficient statistically good algorithms for
         random number generation. Harvey Mudd College HMC-CS-2014-0905, 2014.
     [2] A. A. Efros, W. T. Freeman. Image quilting for texture synthesis and transfer.
         SIGGRAPH 2001.
     [3] P. Perez, M. Gangnet, A. Blake. Poisson image editing. SIGGRAPH 2003.
     [4] R. Bridson. Fluid simulation for computer graphics, section 4.3 (the preconditioner
         MIC(0) of I. Gustafsson. A class of first order factorization methods. BIT 18, 1978).
     [5] IEC 61966-2-1:1999 (sRGB).
     [6] G. H. Golub, C. F. Van Loan. Matrix computations, 4th ed., section 8.5 (Jacobi).
     [7] S. W. Shepperd. Quaternion from rotation matrix. J. Guidance and Control 1(3), 1978.
     [8] Y. Boykov, V. Kolmogorov. An experimental comparison of min-cut/max-flow algorithms for
         energy minimization in vision. IEEE PAMI 26(9), 2004.
     [9] S. J. Gortler, R. Grzeszczuk, R. Szeliski, M. F. Cohen. The lumigraph, section 3.4 (pull
         and push). SIGGRAPH 1996.
     [10] I. Castano. Computing alpha mipmaps. The Witness (blog), 2010.                       */
#ifndef TEXMATH_H
#define TEXMATH_H

#include "texmath/config.h"
#ifdef __cplusplus
extern "C" {
#endif

#include "texmath/env.h"
#include "texmath/number.h"
#include "texmath/image.h"
#include "texmath/mask.h"
#include "texmath/normal.h"
#include "texmath/alpha.h"
#include "texmath/level.h"
#include "texmath/light.h"
#include "texmath/random.h"
#include "texmath/vector.h"
#include "texmath/eigen.h"
#include "texmath/cut.h"
#include "texmath/poisson.h"
#include "texmath/mesh.h"
#ifdef __cplusplus
}
#endif
#endif /* TEXMATH_H */

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
