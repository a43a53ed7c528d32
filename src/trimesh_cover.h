/* trimesh_cover.h - v0.2.0 - textures, attributes and instances on the triangles of a mesh
   SPDX-License-Identifier: MIT OR Unlicense                   (full text: end of file)

   WHAT IT DOES
     Takes any triangle mesh and covers it: textures its triangles with triangular patches or
     edge-matching tiles, transfers texture coordinates and colours from another mesh of the same
     surface, and places objects (lipids, scales, blades of grass) on every triangle for instanced
     drawing. All of it looks best on triangles of about one size and shape, as trimesh_relax.h makes
     them; neither header needs the other.

   QUICK START                                 (tests build and run this very block)
     // Put 12 things on each triangle of a tetrahedron. cc -std=c99 quick.c -lm
     #define TRIMESH_COVER_IMPLEMENTATION     // in exactly one .c or .cpp file
     #include "trimesh_cover.h"               // texmath.h must lie beside it
     #include <stdio.h>

     int main(void) {
         static const float positions[] = {1, 1, 1, -1, -1, 1, -1, 1, -1, 1, -1, -1};
         static const uint32_t indices[] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
         static trimesh_patch_desc spread;    // static: all zero, which means the defaults
         static trimesh_scatter_desc desc;
         static txm_env env;                  // malloc, silent, serial; receives the message
         trimesh_point points[64];
         trimesh_patch patch = {points, 0};
         trimesh_instance things[256];
         size_t count;
         spread.points = 12;
         desc.mesh.positions = positions;
         desc.mesh.indices = indices;
         desc.mesh.vertex_count = 4;
         desc.mesh.face_count = 4;
         desc.patches = &patch;
         desc.patch_count = 1;
         if (trimesh_reference_patch(&spread, &env, points, 64, &patch.count) != TXM_OK ||
             trimesh_scatter(&desc, &env, things, 256, &count) != TXM_OK) {
             fprintf(stderr, "cover: %s\n", env.message);
             return 1;
         }
         printf("%lu things; the first at %.3f %.3f %.3f\n", (unsigned long)count,
                things[0].position[0], things[0].position[1], things[0].position[2]);
         return 0;
     }

   WHICH CALL
     trimesh_normals                    smooth normals for a mesh that has none
     trimesh_transfer                   colours, weights: from the vertices of another mesh
     trimesh_transfer_corners           texture coordinates with seams, from another mesh
     trimesh_split_corners              vertex arrays for a renderer, from values at corners
     trimesh_atlas_make, _uv            where patches lie in one picture
     trimesh_choose                     a patch and a rotation for every triangle
     trimesh_place_tiles                texture coordinates from tiles and rotations
     trimesh_edge_colors, _random_colors, _proper_colors      colours of edges and of vertices
     trimesh_scatter                    instances of objects, from a patch on every triangle
     trimesh_reference_patch, trimesh_order_patch             patches for it

   CONFIGURATION   (define before the include that has _IMPLEMENTATION)
     TRIMESH_COVER_STATIC   every function static to the including file (set it everywhere)
     TRIMESH_MAX_VERTICES   refuse more vertices or triangles; default 2^26; as in trimesh_relax.h

   MEMORY     Results are written to the caller's arrays. What else a call needs is stated with it:
              10 to 75 bytes per triangle, which are freed before it returns.
   THREADS    No global state; calls with different env and outputs may overlap. Values and instances
              are computed on the environment's parallel-for.
   SAME BYTES The same results for any number of threads, and on any compiler that keeps to IEEE 754
              (see texmath.h), built with -ffp-contract=off: integers, hashes, and doubles, with no
              function of libm but the square root, rounded to float once.

   REFERENCES
     [1] M. Glinzner. Texturing of 3D objects using simple physics and equilateral triangle patches.
         Bachelor's thesis, TU Wien, 2016.
     [2] F. Neyret, M.-P. Cani. Pattern-based texturing revisited. SIGGRAPH 1999.
     [3] N. Max. Weights for computing vertex normals from facet normals. J. Graphics Tools 4(2), 1999.
     [4] T. Boubekeur, M. Alexa. Phong tessellation. SIGGRAPH Asia 2008.
     [5] D. Matula, L. Beck. Smallest-last ordering and clustering and graph coloring algorithms.
         J. ACM 30(3), 1983.                                                                      */
#ifndef TRIMESH_COVER_H
#define TRIMESH_COVER_H

#include "texmath.h"

#define TRIMESH_COVER_VERSION "0.2.0"

#ifdef TRIMESH_COVER_STATIC
#define TRIMESH_COVER_API static
#else
#define TRIMESH_COVER_API extern
#endif

/* Inputs and outputs of more vertices or triangles are refused. */
#ifndef TRIMESH_MAX_VERTICES
#define TRIMESH_MAX_VERTICES (1 << 26)
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* ---- meshes ------------------------------------------------------------------------------- */

/* All functions take any mesh of triangles, a result of trimesh_retile or your own. Borders, several
   components, edges with more than two triangles, inconsistent orientation and unused vertices are
   allowed; two triangles are neighbours if they share two vertex numbers. Outputs are the caller's
   arrays, of the size stated, untouched after an error unless said otherwise. Every call returns
   TXM_OK; TXM_BAD_ARGUMENT for a NULL, a field outside its range, an index that is not below
   vertex_count, a position that is not finite; TXM_TOO_LARGE above TRIMESH_MAX_VERTICES vertices
   or triangles; TXM_OUT_OF_MEMORY; TXM_CANCELLED; further statuses are listed with the call. A mesh
   without triangles is allowed and gives no output. */

/* Smooth unit normals of a mesh that has none, 3 floats per vertex; 0 0 0 at a vertex without
   triangles of an area above 0. Each triangle counts by sin(angle at the vertex) / (product of the
   two edges' lengths), which is exact on spheres [3]. O(triangles), 24 bytes per vertex. */
TRIMESH_COVER_API txm_status trimesh_normals(const txm_mesh *mesh, txm_env *env, float *normals);

/* ---- attributes: from the input to the result ---------------------------------------------- */

enum { TRIMESH_MAX_CHANNELS = 64 };

/* Values at the vertices or corners of the input: texture coordinates, colours, weights. */
typedef struct trimesh_values {
    const float *values;     /* channels per entry, finite                                      */
    size_t count;            /* entries; without indices: vertex_count of the input             */
    const uint32_t *indices; /* 3 per triangle, which entry its corners have, as OBJ files have for
                                texture coordinates; NULL = the entry of the corner's vertex     */
    int channels;            /* floats per entry, 1..TRIMESH_MAX_CHANNELS                        */
} trimesh_values;

/* Values at points of the input: a + u (b - a) + v (c - a) of the three corners' values a, b, c.
   For continuous values (colours, weights); for texture coordinates with seams use the next function.

   input    the mesh that trimesh_retile was given (positions are not used)
   sources  count of them, a result's: mesh->sources and mesh->vertex_count
   out      channels floats per source
   cost     O(count)                                                                           */
TRIMESH_COVER_API txm_status trimesh_transfer(const txm_mesh *input, const trimesh_values *values,
                                              const txm_mesh_place *sources, size_t count,
                                              txm_env *env, float *out);

/* Values with seams (charts of texture coordinates) at the corners of a result's triangles, so that
   no triangle spans two charts. A seam is an edge of the input whose two triangles have different
   values there, or that is an edge of one triangle or of more than two. Vertices in the same place
   count as one, so that meshes cut along their seams (glTF) work as well.

   Each triangle takes the chart of the input at its middle: a path leads there from the source of its
   corner 0, across seams, in the plane through both places that is perpendicular to the triangle.
   From the middle another such path leads to each corner, and ends where it meets a seam: a corner
   beyond the seam takes the value at that place. So along a seam charts end up to a triangle early or
   late, depending on the triangles; values are never interpolated across a seam.
   A source that lies on a seam, as where the mesh follows it (`seams` of trimesh_relax.h), is on both
   sides of it: the corner takes the value of its triangle's side, exactly.

               chart 1    s   chart 2
               +----------s------+          m middle, in chart 1; s the seam
                \     m - s - > /           the corner at the right gets what chart 1 has
                 \        s    /            where the path meets s
                  \       s   /

   input    the mesh that trimesh_retile was given; degenerate triangles only end paths
   mesh     the result (its indices; positions are not used)
   sources  1 per vertex of mesh
   out      channels floats per corner, 3 corners per triangle, in the order of mesh->indices
   cost     O(input) for the neighbours, then for each triangle of mesh as many steps as input
            triangles lie on its paths; 79 bytes per triangle of the input, 20 per vertex       */
TRIMESH_COVER_API txm_status trimesh_transfer_corners(const txm_mesh *input,
                                                      const trimesh_values *values,
                                                      const txm_mesh *mesh,
                                                      const txm_mesh_place *sources, txm_env *env,
                                                      float *out);

/* Make the vertex arrays of a renderer from values at corners: a vertex whose corners differ is
   split, with one copy for each different value (bits are compared, -0 equals 0). New vertices are in
   the order of the old ones; old ones without triangles are left out.

   mesh         indices and counts; positions are not used and may be NULL
   values       channels floats per corner
   new_indices  receives 3 per triangle, or NULL: count only
   corners      receives for each new vertex one of its corners, or NULL; 3 * face_count entries are
                always enough, *count of a first call exactly. With c = corners[i], new vertex i
                is a copy of vertex mesh->indices[c] with the value at values + channels * c.
   count        receives the number of new vertices
   cost         O(triangles), 60 bytes each                                                     */
TRIMESH_COVER_API txm_status trimesh_split_corners(const txm_mesh *mesh, const float *values,
                                                   int channels, txm_env *env, uint32_t *new_indices,
                                                   uint32_t *corners, size_t *count);

/* ---- texturing [1, section 3.4] ------------------------------------------------------------ */

/* The thesis's atlas: equilateral triangles side by side in one picture, each in a cell with a
   gutter around it. With h = size sqrt(3) / 2, in pixels from the top left corner of the picture,
   corners 0, 1, 2 of patch p lie at

       x = p pitch + gutter + (0, size, size / 2),   y = height - gutter - (0, 0, h)

              2          pitch  = size + 2 gutter
             / \         width  = count pitch
            / p \        height = ceil(h) + 2 gutter
           0 --- 1       texture coordinates: x / width, y / height, v downwards (glTF)        */
typedef struct trimesh_atlas {
    int count, size, gutter;  /* as requested, defaults resolved */
    int pitch, width, height; /* pixels */
} trimesh_atlas;

/* Lay out an atlas. count 1..256, 0 = 4; size (pixels a side) 2..16384, 0 = 256; gutter (pixels)
   0..size, -1 = 8. */
TRIMESH_COVER_API txm_status trimesh_atlas_make(int count, int size, int gutter, txm_env *env,
                                                trimesh_atlas *atlas);

/* Texture coordinates u v of the corners 0, 1, 2 of one patch, or, with patch -1, of all: 6 floats
   each, as trimesh_place_tiles takes them. Returns 0 for a bad patch number. */
TRIMESH_COVER_API int trimesh_atlas_uv(const trimesh_atlas *atlas, int patch, float *uv);

typedef struct trimesh_choose_desc {
    int patches;   /* how many there are to choose from, 1..65536; 0 = 4                          */
    int rotations; /* 1: corner k always shows corner k; 3: all three rotations; 0 = 3            */
    int repeat;    /* 0: neighbours have different patches where possible, else different rotations;
                      non-zero: all at random, as in [1]                                          */
    uint64_t seed; /* another seed gives another choice                                           */
} trimesh_choose_desc;

/* Choose a patch and a rotation for every triangle, at random.

   mesh       indices and counts; positions may be NULL
   desc       NULL = all defaults
   patches    receives 1 per triangle
   rotations  receives 1 per triangle: r = 0..2, corner k shows corner (k + r) mod 3 of the patch;
              may be NULL
   cost       O(triangles), 60 bytes each; with repeat: none                                     */
TRIMESH_COVER_API txm_status trimesh_choose(const txm_mesh *mesh, const trimesh_choose_desc *desc,
                                            txm_env *env, int *patches, int *rotations);

/* Texture coordinates of all corners from the tile and rotation of each triangle.

   tiles, rotations  1 per triangle, of trimesh_choose or of textiles_assign_triangles; rotations
                     NULL = all 0
   tile_uv           6 floats per tile, its corners 0, 1, 2: of trimesh_atlas_uv, or the first three
                     of textiles_place; tile_count tiles
   uv                receives 6 floats per triangle: corner k gets corner (k + rotation) mod 3 of
                     the tile. trimesh_split_corners with 2 channels makes vertices of them     */
TRIMESH_COVER_API txm_status trimesh_place_tiles(size_t triangle_count, const int *tiles,
                                                 const int *rotations, const float *tile_uv,
                                                 size_t tile_count, txm_env *env, float *uv);

/* For any edge-matching tiles: a colour for every edge, by hash of its two vertices and the
   seed, and a direction, from its lower to its higher vertex number. Side k of a triangle runs from
   corner k to corner (k + 1) mod 3. The same hash as textiles_assign_triangles begins with (which
   then recolours edges so that equal tiles do not meet).

   colors       how many, 1..65536
   edge_colors  receives 3 per triangle: 0..colors - 1, equal on both sides of an edge
   directions   receives 3 per triangle: +1 if the side runs along the edge's direction, -1 against
                it; may be NULL. Those of a triangle are never all +1 or all -1                 */
TRIMESH_COVER_API txm_status trimesh_edge_colors(const txm_mesh *mesh, int colors, uint64_t seed,
                                                 txm_env *env, int *edge_colors, int *directions);

/* A random colour 0..count - 1 for every vertex, as in [1] (with 3). count 1..65536; 0 = 3. */
TRIMESH_COVER_API txm_status trimesh_random_colors(size_t vertex_count, int count, uint64_t seed,
                                                   txm_env *env, int *colors);

/* A colour for every vertex so that the ends of every edge differ. Greedy, in smallest-last order
   [5]: the vertex with the fewest remaining neighbours is removed repeatedly, and the last one
   removed is coloured first. At most 6 colours on surfaces of genus 0, mostly 4 or 5; 7 on a torus.

   colors  receives 1 per vertex, from 0; a vertex without triangles gets 0
   count   receives how many colours were used; may be NULL
   cost    O(triangles), 60 bytes each and 16 per vertex                                        */
TRIMESH_COVER_API txm_status trimesh_proper_colors(const txm_mesh *mesh, txm_env *env, int *colors,
                                                   int *count);

/* ---- geometry on triangles ----------------------------------------------------------------- */

/* One object on the reference triangle (0, 0), (1, 0), (1/2, sqrt(3)/2), at x = u + v / 2,
   y = v sqrt(3) / 2; z points away from the surface. Lengths are in edges of the triangle. */
typedef struct trimesh_point {
    float u, v;         /* 0 or more, u + v at most 1; exactly 0 or 1 on the sides              */
    float height;       /* over the surface, in edge lengths, -1000..1000                       */
    float scale;        /* size, in edge lengths, 0..1000; 0 = 1                                */
    float rotation[4];  /* quaternion x, y, z, w that rotates the object in the frame x, y, z of the
                           reference triangle, of any length; 0 0 0 0 = none                    */
    uint32_t prototype; /* which object; copied to the instances                                */
} trimesh_point;

/* What is put on a triangle. With desc->density only some points are used, from the front of the
   list, so order them such that the first n are well spread for every n (trimesh_order_patch).

   Points on the sides (within 10^-6 of an edge) are placed once: those on an edge by the first
   (lowest) of its triangles, those on a vertex by the first of its triangles. To avoid gaps and
   duplicates at edges, give all patches of a call the same points on all three sides, symmetric under
   t to 1 - t, and all corners or none; then every edge and vertex of the mesh shows them once,
   whatever patches and rotations meet there. */
typedef struct trimesh_patch {
    const trimesh_point *points;
    size_t count; /* 0..2^20 */
} trimesh_patch;

/* An object in space: scaled, then rotated, then moved. */
typedef struct trimesh_instance {
    float position[3];
    float rotation[4];  /* unit quaternion x, y, z, w: glTF's order; w >= 0                     */
    float scale;
    uint32_t prototype;
    uint32_t triangle;  /* on which it is placed                                                */
} trimesh_instance;

typedef struct trimesh_scatter_desc {
    txm_mesh mesh;
    const float *normals;         /* 3 per vertex, unit: a result's; NULL = trimesh_normals       */
    const trimesh_patch *patches; /* patch_count of them                                          */
    int patch_count;              /* 1..65536                                                     */
    const int *choices;           /* 1 per triangle: its patch; NULL = at random                  */
    const int *rotations;         /* 1 per triangle, 0..2: corner k of the triangle is corner
                                     (k + rotation) mod 3 of the patch; NULL = at random          */
    float unit;   /* edge length for heights and scales: above 0, in units of the mesh; 0 = that of
                     the equilateral triangle of each triangle's area                             */
    float height; /* added to the height of every point, in edge lengths, -1000..1000             */
    int inside;   /* non-zero: the other side. Heights are measured against the normals, and objects
                     are rotated by 180 degrees about their x axis, z against the normal          */
    float curve;  /* 0..1: 0 = objects are on the flat triangles, 1 = on the curved surface that
                     the normals describe (Phong tessellation [4] with half its weight, which is
                     right for a sphere); the shift is at most 1 edge                             */
    float density; /* objects per unit of area at height `height` (on side `inside`): then patches
                     are used in part, see below; 0 = all points of the patches on every triangle */
    int spin;      /* non-zero: every object is rotated by a random angle about its own z axis    */
    const float *mix; /* shares, mix_count of them, 0 or more: prototypes 0..mix_count - 1 are drawn
                     at random in these proportions; NULL = the points' own                       */
    int mix_count;    /* 0..256                                                                   */
    uint64_t seed;    /* another seed gives other choices                                         */
} trimesh_scatter_desc;

/* Put a patch on every triangle of a mesh, and list the instances.

   Position: the point (u, v) of the triangle (moved by curve), plus height times the unit normal
   interpolated there. Orientation: z along that normal, x along the direction of the patch's x axis
   on the triangle (by the rotation nearest to the affine map from the reference triangle), made
   perpendicular to z. So frames are continuous across edges, up to a rotation by a multiple of
   60 degrees. Scale: the point's times the edge length.

   With density, triangle t of area A(t) (its corners moved along their normals to the height) gets as
   many points from the front of its patch as come nearest to density A(t) + e objects, where e is the
   error left by the previous triangle along a space-filling (Morton) curve; a point on a side counts
   1/2, on a corner 1/6, since that many triangles share it. So the count in any region is accurate
   to about one object per side of the region. The patches need enough points for the largest
   triangle: for meshes of trimesh_retile a third more than for the mean are enough.

   out       receives *count instances, triangle by triangle in the patch's order; NULL: count only.
             After TXM_CANCELLED it may be filled in part
   capacity  how many instances out has room for
   count     receives how many there are, also after TXM_TOO_LARGE because of capacity
   return    also TXM_TOO_SMALL: the patches have too few points for this density, the message says
             how many the largest triangle needs; TXM_TOO_LARGE: more than capacity or 2^31
   cost      O(triangles + instances), 0.1 to 0.2 us per instance; 36 bytes per triangle, 36 per
             vertex without normals; with points on the sides 50 more per triangle               */
TRIMESH_COVER_API txm_status trimesh_scatter(const trimesh_scatter_desc *desc, txm_env *env,
                                             trimesh_instance *out, size_t capacity, size_t *count);

/* position + scale (rotated point): where a point of the object is in space. out may be point. */
TRIMESH_COVER_API void trimesh_instance_apply(const trimesh_instance *instance, const float point[3],
                                              float out[3]);

typedef struct trimesh_patch_desc {
    int points;      /* how many per triangle of a mesh, on average, 1..4096; 0 = 32              */
    int hexagonal;   /* non-zero: the triangular lattice with m steps along a side, m^2 / 2 points
                        per triangle, m = the nearest to sqrt(2 points); rotations do not show    */
    int iterations;  /* rounds of repulsion, 1..1000; 0 = 100                                     */
    uint64_t seed;   /* another seed gives another patch; those with equal `points` fit together  */
} trimesh_patch_desc;

/* Make a patch of evenly spread points, ordered for use in part. m + 1 points lie on each side,
   including the corners, at equal steps, m as above, so that all patches of the same `points` join
   without gaps in all rotations. Those inside repel each other and are repelled by those on sides,
   with a force that falls to zero at the radius of influence [1, equation 3.1]. Heights are 0,
   scales 1, prototypes 0.

   points    receives *count points; NULL: count only. points + 2 m + 2 are always enough
   capacity  how many points it has room for
   return    also TXM_TOO_LARGE if capacity is too small; *count is correct then
   cost      O(count^2 + iterations count), 0.1 s for 1000                                       */
TRIMESH_COVER_API txm_status trimesh_reference_patch(const trimesh_patch_desc *desc, txm_env *env,
                                                     trimesh_point *points, size_t capacity,
                                                     size_t *count);

/* Order the points of a patch of your own for use in part: each next point is the one furthest from
   those before, with neighbouring triangles treated as mirror images. O(count^2); count up to 16384;
   8 bytes each. */
TRIMESH_COVER_API txm_status trimesh_order_patch(trimesh_point *points, size_t count, txm_env *env);

#ifdef __cplusplus
}
#endif
#endif /* TRIMESH_COVER_H */

#if defined(TRIMESH_COVER_IMPLEMENTATION) && !defined(TRIMESH_COVER_IMPLEMENTED)
#define TRIMESH_COVER_IMPLEMENTED

#include "trimesh_cover/check.h"
#include "trimesh_cover/attributes.h"
#include "trimesh_cover/seams.h"
#include "trimesh_cover/texture.h"
#include "trimesh_cover/scatter.h"
#include "trimesh_cover/patch.h"
#endif /* TRIMESH_COVER_IMPLEMENTATION */

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
