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

/* ---- what all functions share -------------------------------------------------------------- */

enum {
    TMC_BLOCK = 1024, /* triangles or values that a thread takes at a time                    */
    TMC_NONE = 0xff   /* no corner                                                            */
};
#define TMC_BATCHES 16 /* rounds of a long loop, between which the caller may cancel           */
#define TMC_SNAP 1e-6  /* of an edge: points of a patch nearer to a side lie on it             */
#define TMC_H 0.86602540378443864676 /* height of the reference triangle, sqrt(3) / 2          */

/* Have all requests to the arena been met? Functions ask for all they need, then look once. */
static txm_status tmc_check_memory(const txm_arena *arena, txm_env *env) {
    if (!arena->failed) return TXM_OK;
    return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the work on the mesh");
}

static txm_status tmc_report(txm_env *env, double fraction, const char *stage) {
    if (!txm_progress(env, txm_float(fraction), stage)) return TXM_OK;
    return txm_fail(env, TXM_CANCELLED, "cancelled");
}

static int tmc_are_finite(const float *values, size_t count) {
    for (size_t i = 0; i < count; i++) {
        if (!txm_is_finite(values[i])) return 0;
    }
    return 1;
}

/* A loop over count things; each block of them writes only its own results. */
typedef struct tmc_loop {
    void (*body)(const void *job, size_t first, size_t end);
    const void *job;
    size_t count, first_block;
} tmc_loop;

static void tmc_block(void *context, int index) {
    const tmc_loop *l = (const tmc_loop *)context;
    const size_t first = (l->first_block + (size_t)index) * TMC_BLOCK;
    const size_t end = first + TMC_BLOCK;
    l->body(l->job, first, end < l->count ? end : l->count);
}

/* body(job, first, end) for all of count, spread over threads; progress goes from..to. */
static txm_status tmc_run_blocks(void (*body)(const void *, size_t, size_t), const void *job,
                                 size_t count, double from, double to, const char *stage,
                                 txm_env *env) {
    tmc_loop l;
    const size_t blocks = (count + TMC_BLOCK - 1) / TMC_BLOCK;
    l.body = body;
    l.job = job;
    l.count = count;
    for (size_t b = 0; b < TMC_BATCHES; b++) {
        const size_t end = blocks * (b + 1) / TMC_BATCHES;
        l.first_block = blocks * b / TMC_BATCHES;
        if (end == l.first_block) continue;
        const txm_status status =
            tmc_report(env, from + (to - from) * (double)b / TMC_BATCHES, stage);
        if (status != TXM_OK) return status;
        txm_parallel_for(env, (int)(end - l.first_block), tmc_block, &l);
    }
    return TXM_OK;
}

/* The sum of the weighted normals at each vertex; sum holds 3 zeros for each. */
static void tmc_sum_normals(const txm_mesh *mesh, double *sum) {
    for (size_t t = 0; t < mesh->face_count; t++) {
        txm_dvec3 p[3];
        txm_mesh_triangle(mesh, t, p);
        const txm_dvec3 n = txm_d3_area2(p[0], p[1], p[2]);
        const double d[3] = {txm_d3_dist2(p[0], p[1]), txm_d3_dist2(p[1], p[2]),
                             txm_d3_dist2(p[2], p[0])};
        for (size_t k = 0; k < 3; k++) {
            const double weight = d[k] * d[(k + 2) % 3];
            double *to = sum + 3 * (size_t)mesh->indices[3 * t + k];
            if (!(weight > 0)) continue;
            to[0] += n.x / weight;
            to[1] += n.y / weight;
            to[2] += n.z / weight;
        }
    }
}

TRIMESH_COVER_API txm_status trimesh_normals(const txm_mesh *mesh, txm_env *env, float *normals) {
    txm_arena arena;
    txm_status status = txm_mesh_check(mesh, "mesh", 3, 1, TRIMESH_MAX_VERTICES, env);
    if (status != TXM_OK) return status;
    if (mesh->vertex_count == 0) return TXM_OK;
    if (!normals) return txm_fail(env, TXM_BAD_ARGUMENT, "normals is NULL");
    if (tmc_report(env, 0, "normals") != TXM_OK) return TXM_CANCELLED;
    txm_arena_init(&arena, env);
    double *sum = (double *)txm_arena_zero(&arena, mesh->vertex_count, 3 * sizeof(double));
    if ((status = tmc_check_memory(&arena, env)) == TXM_OK) {
        tmc_sum_normals(mesh, sum);
        for (size_t v = 0; v < mesh->vertex_count; v++) {
            const txm_dvec3 n = txm_d3_unit(txm_d3(sum[3 * v], sum[3 * v + 1], sum[3 * v + 2]));
            normals[3 * v] = txm_float(n.x);
            normals[3 * v + 1] = txm_float(n.y);
            normals[3 * v + 2] = txm_float(n.z);
        }
    }
    txm_arena_free(&arena);
    return status;
}

/* ---- which sides share an edge -------------------------------------------------------------- */

/* The sides of a mesh in the order of their edges, allocated in the arena, with as much scratch. */
static txm_status tmc_sort_sides(const txm_mesh *mesh, txm_arena *arena, txm_env *env,
                                 uint32_t **sorted) {
    *sorted = (uint32_t *)txm_arena_alloc(arena, txm_mesh_sides(mesh), 2 * sizeof(uint32_t));
    const txm_status status = tmc_check_memory(arena, env);
    if (status == TXM_OK) txm_mesh_sort_sides(mesh, *sorted);
    return status;
}

/* Link the sides of each edge into a ring, as txm_mesh_link does. */
static txm_status tmc_link(const txm_mesh *mesh, txm_env *env, uint32_t *next) {
    txm_arena scratch;
    uint32_t *sorted;
    txm_arena_init(&scratch, env);
    const txm_status status = tmc_sort_sides(mesh, &scratch, env, &sorted);
    if (status == TXM_OK) txm_mesh_link(mesh, sorted, 0, next);
    txm_arena_free(&scratch);
    return status;
}

/* ---- attributes ------------------------------------------------------------------------------ */

typedef struct tmc_values {
    const uint32_t *entry; /* which value each corner of the input has */
    const float *values;
    size_t channels;
} tmc_values;

static txm_status tmc_check_values(const txm_mesh *input, const trimesh_values *values,
                                   txm_env *env, tmc_values *out) {
    if (!values) return txm_fail(env, TXM_BAD_ARGUMENT, "values is NULL");
    if (values->channels < 1 || values->channels > TRIMESH_MAX_CHANNELS)
        return txm_fail(env, TXM_BAD_ARGUMENT, "channels must be 1 to TRIMESH_MAX_CHANNELS");
    if (values->count > 3 * (size_t)TRIMESH_MAX_VERTICES)
        return txm_fail(env, TXM_TOO_LARGE, "more than 3 TRIMESH_MAX_VERTICES values");
    if (values->count && !values->values)
        return txm_fail(env, TXM_BAD_ARGUMENT, "the values are NULL");
    if (!values->indices && values->count != input->vertex_count)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "values without indices must be as many as the input has vertices");
    out->entry = values->indices ? values->indices : input->indices;
    out->values = values->values;
    out->channels = (size_t)values->channels;
    for (size_t i = 0; values->indices && i < 3 * input->face_count; i++) {
        if (values->indices[i] >= values->count)
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                    "values: triangle # names entry #, which is not below count",
                                    i / 3, values->indices[i]);
    }
    for (size_t i = 0; i < values->count; i++) {
        if (!tmc_are_finite(values->values + out->channels * i, out->channels))
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT, "values: entry # is not finite", i, 0);
    }
    return TXM_OK;
}

static txm_status tmc_check_sources(const txm_mesh *input, const txm_mesh_place *sources,
                                    size_t count, txm_env *env) {
    if (count > (size_t)INT32_MAX) return txm_fail(env, TXM_TOO_LARGE, "more than 2^31 sources");
    if (count && !sources) return txm_fail(env, TXM_BAD_ARGUMENT, "sources is NULL");
    for (size_t i = 0; i < count; i++) {
        const txm_mesh_place *s = &sources[i];
        if (s->triangle >= input->face_count)
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                    "source # names triangle #, which the input does not have", i,
                                    s->triangle);
        if (!(s->u >= 0 && s->v >= 0 && (double)s->u + s->v <= 1 + TMC_SNAP))
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                    "u and v of source # must be 0 or more, their sum at most 1", i,
                                    0);
    }
    return TXM_OK;
}

/* out = a + u (b - a) + v (c - a): exact where the three are equal */
static void tmc_interpolate(const tmc_values *x, size_t triangle, double u, double v, float *out) {
    const float *a = x->values + x->channels * x->entry[3 * triangle];
    const float *b = x->values + x->channels * x->entry[3 * triangle + 1];
    const float *c = x->values + x->channels * x->entry[3 * triangle + 2];
    for (size_t i = 0; i < x->channels; i++)
        out[i] = txm_float(a[i] + u * ((double)b[i] - a[i]) + v * ((double)c[i] - a[i]));
}

typedef struct tmc_transfer {
    tmc_values values;
    const txm_mesh_place *sources;
    float *out;
} tmc_transfer;

static void tmc_transfer_block(const void *job, size_t first, size_t end) {
    const tmc_transfer *j = (const tmc_transfer *)job;
    for (size_t i = first; i < end; i++) {
        const txm_mesh_place *s = &j->sources[i];
        tmc_interpolate(&j->values, s->triangle, s->u, s->v, j->out + j->values.channels * i);
    }
}

TRIMESH_COVER_API txm_status trimesh_transfer(const txm_mesh *input, const trimesh_values *values,
                                        const txm_mesh_place *sources, size_t count, txm_env *env,
                                        float *out) {
    tmc_transfer j;
    txm_status status = txm_mesh_check(input, "input", 3, 0, TRIMESH_MAX_VERTICES, env);
    if (status == TXM_OK) status = tmc_check_values(input, values, env, &j.values);
    if (status == TXM_OK) status = tmc_check_sources(input, sources, count, env);
    if (status != TXM_OK || count == 0) return status;
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    j.sources = sources;
    j.out = out;
    return tmc_run_blocks(tmc_transfer_block, &j, count, 0, 1, "values", env);
}

/* ---- attributes: paths on the input ---------------------------------------------------------- */

/* The input, prepared for paths. */
typedef struct tmc_paths {
    txm_mesh input;
    tmc_values values;
    const txm_mesh *mesh;
    const txm_mesh_place *sources;
    uint32_t *welded; /* 1 per vertex: the first vertex in the same place                  */
    uint32_t *vertex; /* 1 per corner: its welded vertex                                   */
    uint32_t *next;   /* 1 per side, see txm_mesh_link                                     */
    uint8_t *seam;    /* 1 per side: 0 = none, 1 = seam, 2 = none or several on the other side */
    uint32_t *chart;  /* 1 per triangle: a triangle of its chart, the same for all of a chart  */
    float *out;
} tmc_paths;

/* A place on the input: (1 - u - v) a + u b + v c of a triangle. */
typedef struct tmc_place {
    size_t triangle;
    double u, v;
} tmc_place;

static txm_dvec3 tmc_point(const txm_mesh *input, tmc_place at) {
    txm_dvec3 p[3];
    txm_mesh_triangle(input, at.triangle, p);
    return txm_d3_mad(txm_d3_mad(p[0], txm_d3_sub(p[1], p[0]), at.u), txm_d3_sub(p[2], p[0]), at.v);
}

/* Give vertices in equal places the same number. pairs: room for 2 per vertex. */
static void tmc_weld(const txm_mesh *input, txm_pair *pairs, uint32_t *welded) {
    const size_t n = input->vertex_count;
    for (size_t i = 0; i < n; i++) pairs[i].value = (uint32_t)i;
    for (size_t axis = 3; axis-- > 0;) {
        for (size_t i = 0; i < n; i++) /* + 0: -0 becomes 0      */
            pairs[i].key = txm_sort_key(input->positions[3 * (size_t)pairs[i].value + axis] + 0.0f);
        txm_sort_pairs(pairs, pairs + n, n);
    }
    for (size_t i = 0; i < n; i++) {
        const size_t v = pairs[i].value, before = i ? pairs[i - 1].value : v;
        const float *p = input->positions + 3 * v, *q = input->positions + 3 * before;
        int equal = 1;
        for (int k = 0; k < 3; k++) equal &= p[k] >= q[k] && p[k] <= q[k];
        welded[v] = i && equal ? welded[before] : (uint32_t)v;
    }
}

static int tmc_equal_values(const tmc_values *x, size_t corner, size_t other) {
    const float *a = x->values + x->channels * x->entry[corner];
    const float *b = x->values + x->channels * x->entry[other];
    for (size_t i = 0; i < x->channels; i++) {
        if (!(a[i] >= b[i] && a[i] <= b[i])) return 0;
    }
    return 1;
}

static uint8_t tmc_seam(const tmc_paths *p, size_t side) {
    const size_t other = p->next[side];
    if (other == side || p->next[other] != side) return 2;
    size_t a = other, b = txm_mesh_next(&p->input, other); /* the same ends, in either order     */
    if (p->vertex[a] != p->vertex[side]) {
        a = b;
        b = other;
    }
    return !(tmc_equal_values(&p->values, side, a) &&
             tmc_equal_values(&p->values, txm_mesh_next(&p->input, side), b));
}

/* The first triangle of the chart that t is in so far; shortens the way there. */
static uint32_t tmc_chart(uint32_t *chart, uint32_t t) {
    while (chart[t] != t) t = chart[t] = chart[chart[t]];
    return t;
}

/* Charts: triangles that are joined by sides without seams. */
static void tmc_find_charts(tmc_paths *p) {
    const size_t n = p->input.face_count;
    for (size_t t = 0; t < n; t++) p->chart[t] = (uint32_t)t;
    for (size_t side = 0; side < 3 * n; side++) {
        if (p->seam[side]) continue;
        const uint32_t a = tmc_chart(p->chart, (uint32_t)(side / 3));
        const uint32_t b = tmc_chart(p->chart, p->next[side] / 3);
        p->chart[a > b ? a : b] = a > b ? b : a;
    }
    for (size_t t = 0; t < n; t++) p->chart[t] = tmc_chart(p->chart, (uint32_t)t);
}

static txm_status tmc_paths_build(tmc_paths *p, txm_arena *arena, txm_env *env) {
    const size_t n = p->input.vertex_count, sides = 3 * p->input.face_count;
    txm_arena scratch;
    txm_arena_init(&scratch, env);
    p->welded = (uint32_t *)txm_arena_alloc(arena, n, sizeof(uint32_t));
    p->vertex = (uint32_t *)txm_arena_alloc(arena, sides, sizeof(uint32_t));
    p->next = (uint32_t *)txm_arena_alloc(arena, sides, sizeof(uint32_t));
    p->seam = (uint8_t *)txm_arena_alloc(arena, sides, 1);
    p->chart = (uint32_t *)txm_arena_alloc(arena, p->input.face_count, sizeof(uint32_t));
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(&scratch, n, 2 * sizeof(txm_pair));
    txm_status status = tmc_check_memory(arena, env);
    if (status == TXM_OK) status = tmc_check_memory(&scratch, env);
    if (status == TXM_OK) tmc_weld(&p->input, pairs, p->welded);
    txm_arena_free(&scratch);
    if (status != TXM_OK) return status;
    for (size_t i = 0; i < sides; i++) p->vertex[i] = p->welded[p->input.indices[i]];
    txm_mesh whole = p->input;
    whole.indices = p->vertex;
    if ((status = tmc_link(&whole, env, p->next)) != TXM_OK) return status;
    for (size_t i = 0; i < sides; i++) p->seam[i] = tmc_seam(p, i);
    tmc_find_charts(p);
    return TXM_OK;
}

/* ---- attributes: places on seams ------------------------------------------------------------- */

enum { TMC_MOST_SPOTS = 64 }; /* ours: triangles around a vertex that are looked at          */

/* A place on the input as all triangles there have it: one inside a triangle, two on a side, those
   around a vertex. The first is the place that was given. */
typedef struct tmc_spots {
    tmc_place at[TMC_MOST_SPOTS];
    size_t count;
    int on_seam; /* is there a seam between two of them? */
} tmc_spots;

/* the place at corner k of a triangle */
static tmc_place tmc_at_corner(size_t corner) {
    tmc_place at;
    at.triangle = corner / 3;
    at.u = corner % 3 == 1 ? 1 : 0;
    at.v = corner % 3 == 2 ? 1 : 0;
    return at;
}

/* the corner at this vertex of the triangle that a side belongs to */
static size_t tmc_corner_of(const tmc_paths *p, size_t side, uint32_t vertex) {
    const size_t next = txm_mesh_next(&p->input, side);
    return p->vertex[side] == vertex ? side : p->vertex[next] == vertex ? next
                                                                       : txm_mesh_next(&p->input, next);
}

/* Add the triangles around the vertex of a corner, first counter-clockwise, then the other way. */
static void tmc_spots_around(const tmc_paths *p, size_t corner, tmc_spots *s) {
    const uint32_t vertex = p->vertex[corner];
    for (int back = 0; back < 2; back++) {
        size_t c = corner, side = back ? corner : txm_mesh_next(&p->input, txm_mesh_next(&p->input, corner));
        while (p->seam[side] != 2 && s->count < TMC_MOST_SPOTS) {
            s->on_seam |= p->seam[side];
            const size_t other = p->next[side];
            c = tmc_corner_of(p, other, vertex);
            if (c / 3 == corner / 3) return; /* all around */
            s->at[s->count++] = tmc_at_corner(c);
            /* leave by the other one of the two sides at the vertex */
            side = other == c ? txm_mesh_next(&p->input, txm_mesh_next(&p->input, c)) : c;
        }
    }
}

/* All triangles at a place. */
static void tmc_find_spots(const tmc_paths *p, tmc_place at, tmc_spots *s) {
    const double w[3] = {1 - at.u - at.v, at.u, at.v};
    size_t zeros = 0, zero = 0, whole = 0;
    s->at[0] = at;
    s->count = 1;
    s->on_seam = 0;
    for (size_t k = 0; k < 3; k++) {
        if (w[k] <= TMC_SNAP) {
            zeros++;
            zero = k;
        } else whole = k;
    }
    if (zeros == 2) tmc_spots_around(p, 3 * at.triangle + whole, s);
    if (zeros != 1) return;
    const size_t side = 3 * at.triangle + (zero + 1) % 3; /* from corner k + 1 to k + 2 */
    if (p->seam[side] == 2) return;
    const size_t other = p->next[side], next = txm_mesh_next(&p->input, other);
    double weight[3] = {0, 0, 0};
    const int alike = p->vertex[other] == p->vertex[side];
    weight[(alike ? other : next) % 3] = w[(zero + 1) % 3];
    weight[(alike ? next : other) % 3] = w[(zero + 2) % 3];
    s->at[1].triangle = other / 3;
    s->at[1].u = weight[1];
    s->at[1].v = weight[2];
    s->count = 2;
    s->on_seam = p->seam[side];
}

/* Which of the spots lies in the chart? -1: none. */
static int tmc_spot_in_chart(const tmc_paths *p, const tmc_spots *s, uint32_t chart) {
    for (size_t i = 0; i < s->count; i++) {
        if (p->chart[s->at[i].triangle] == chart) return (int)i;
    }
    return -1;
}

/* Of the spots that lie in the chart of `at`, the one whose values are nearest to those there: where a
   chart is cut, both sides of the cut lie in it. 0: none lies in it. */
static int tmc_nearest_spot(const tmc_paths *p, const tmc_spots *s, tmc_place at, tmc_place *spot) {
    float here[TRIMESH_MAX_CHANNELS], there[TRIMESH_MAX_CHANNELS];
    double least = -1;
    tmc_interpolate(&p->values, at.triangle, at.u, at.v, here);
    for (size_t i = 0; i < s->count; i++) {
        double sum = 0;
        if (p->chart[s->at[i].triangle] != p->chart[at.triangle]) continue;
        tmc_interpolate(&p->values, s->at[i].triangle, s->at[i].u, s->at[i].v, there);
        for (size_t k = 0; k < p->values.channels; k++)
            sum += ((double)here[k] - there[k]) * ((double)here[k] - there[k]);
        if (least >= 0 && sum >= least) continue;
        least = sum;
        *spot = s->at[i];
    }
    return least >= 0;
}

/* A path: from `start` towards `end` in the plane through both along `up`. */
typedef struct tmc_path {
    txm_dvec3 start, ahead, across; /* ahead: to the end; across: normal of the plane           */
    double reach;                 /* |ahead|^2                                                */
    size_t goal;                  /* the triangle of the end; SIZE_MAX = not known            */
    int through;                  /* cross seams                                              */
} tmc_path;

/* Where the plane meets a side, as a fraction of it. The values on both sides of the plane are
   computed from the vertex alone, so that all triangles there give the same result. */
static double tmc_cut(const tmc_path *w, const txm_dvec3 c[3], size_t k) {
    const double f = txm_d3_dot(txm_d3_sub(c[k], w->start), w->across);
    const double g = txm_d3_dot(txm_d3_sub(c[(k + 1) % 3], w->start), w->across);
    return f / (f - g);
}

/* the place at share s of side k of a triangle */
static tmc_place tmc_on_side(size_t triangle, size_t k, double s) {
    tmc_place at;
    at.triangle = triangle;
    s = s >= 0 ? s <= 1 ? s : 1 : 0;
    at.u = k == 0 ? s : k == 1 ? 1 - s : 0;
    at.v = k == 1 ? s : k == 2 ? 1 - s : 0;
    return at;
}

static double tmc_along(const tmc_path *w, txm_dvec3 x) {
    return txm_d3_dot(txm_d3_sub(x, w->start), w->ahead);
}

/* The side by which the path leaves a triangle: a side that the plane meets, not the side `from`
   (0..2); at the start from is 3, then the one further ahead. Returns 3 if there is none. */
static size_t tmc_exit(const tmc_path *w, const txm_dvec3 c[3], size_t from) {
    int above[3];
    size_t best = 3;
    double furthest = 0;
    for (size_t k = 0; k < 3; k++)
        above[k] = txm_d3_dot(txm_d3_sub(c[k], w->start), w->across) >= 0;
    for (size_t k = 0; k < 3; k++) {
        const size_t n = (k + 1) % 3;
        if (above[k] == above[n] || k == from) continue;
        const double s = tmc_cut(w, c, k);
        const double along = tmc_along(w, txm_d3_mad(c[k], txm_d3_sub(c[n], c[k]), s));
        if (best != 3 && along <= furthest) continue;
        best = k;
        furthest = along;
    }
    return best;
}

/* Follow a path. *at is its start and receives its end: where it meets a seam, or the place at the
   distance of the end. Returns 1 if it came to the goal triangle. */
static int tmc_walk(const tmc_paths *p, const tmc_path *w, tmc_place *at) {
    size_t triangle = at->triangle, from = 3;
    int reached = 0;
    for (int step = 0; step < 1 << 16; step++) {
        txm_dvec3 c[3];
        if (triangle == w->goal) return 1;
        txm_mesh_triangle(&p->input, triangle, c);
        const size_t k = tmc_exit(w, c, from);
        if (k == 3) return 0;
        const double s = tmc_cut(w, c, k);
        const txm_dvec3 x = txm_d3_mad(c[k], txm_d3_sub(c[(k + 1) % 3], c[k]), s);
        const double along = tmc_along(w, x), least = -0.5 * w->reach;
        const tmc_place out = tmc_on_side(triangle, k, s);
        if (!reached && along >= w->reach) {
            /* between the entry and the exit; the end may also lie in a triangle nearby */
            tmc_place in = *at;
            if (from < 3) in = tmc_on_side(triangle, from, tmc_cut(w, c, from));
            const double before = tmc_along(w, tmc_point(&p->input, in));
            const double share = along > before ? (w->reach - before) / (along - before) : 1;
            const double t = share >= 0 ? share <= 1 ? share : 1 : 0;
            at->triangle = triangle;
            at->u = in.u + t * (out.u - in.u);
            at->v = in.v + t * (out.v - in.v);
            const txm_dvec3 gap =
                txm_d3_sub(tmc_point(&p->input, *at), txm_d3_add(w->start, w->ahead));
            if (w->goal == SIZE_MAX || txm_d3_len2(gap) <= 1e-12 * w->reach) return 0;
            reached = 1;
        }
        if (!reached) *at = out;
        const size_t side = 3 * triangle + k;
        if (along > 2 * w->reach || along < least) return 0;
        if (p->seam[side] == 2 || (p->seam[side] && !w->through)) return 0;
        triangle = p->next[side] / 3;
        from = p->next[side] % 3;
    }
    return 0;
}

/* A path from a place, which is first moved a little into its triangle: so the plane surely cuts
   two sides of it, and a start in a corner needs no search around the corner. */
static tmc_path tmc_path_make(const tmc_paths *p, tmc_place *at, txm_dvec3 end, txm_dvec3 up,
                              size_t goal, int through) {
    tmc_path w;
    at->u += 1e-3 * (1.0 / 3 - at->u);
    at->v += 1e-3 * (1.0 / 3 - at->v);
    w.start = tmc_point(&p->input, *at);
    w.ahead = txm_d3_sub(end, w.start);
    w.across = txm_d3_cross(up, w.ahead);
    w.reach = txm_d3_len2(w.ahead);
    w.goal = goal;
    w.through = through;
    return w;
}

/* If the chart of the middle is not one that all three corners have, but another is, as where a seam
   bends between two corners on it, take that one: its place at the first corner, moved inwards by the
   path to the middle. */
static void tmc_choose_chart(const tmc_paths *p, const tmc_spots spots[3], tmc_place *middle) {
    size_t first = 0;
    for (size_t k = 1; k < 3; k++)
        if (spots[k].count < spots[first].count) first = k;
    const tmc_spots *s = &spots[first];
    int found = -1;
    for (size_t i = 0; i < s->count; i++) {
        const uint32_t chart = p->chart[s->at[i].triangle];
        if (tmc_spot_in_chart(p, &spots[(first + 1) % 3], chart) < 0 ||
            tmc_spot_in_chart(p, &spots[(first + 2) % 3], chart) < 0)
            continue;
        if (chart == p->chart[middle->triangle]) return;
        if (found < 0) found = (int)i;
    }
    if (found >= 0) *middle = s->at[found];
}

/* The values at the corners of one triangle of the mesh. */
static void tmc_transfer_face(const tmc_paths *p, size_t t) {
    tmc_place from[3];
    tmc_spots spots[3];
    txm_dvec3 c[3];
    for (size_t k = 0; k < 3; k++) {
        const txm_mesh_place *s = &p->sources[p->mesh->indices[3 * t + k]];
        from[k].triangle = s->triangle;
        from[k].u = s->u;
        from[k].v = s->v;
        c[k] = tmc_point(&p->input, from[k]);
        tmc_find_spots(p, from[k], &spots[k]);
    }
    const txm_dvec3 up = txm_d3_unit(txm_d3_area2(c[0], c[1], c[2]));
    const txm_dvec3 middle = txm_d3_scale(txm_d3_add(txm_d3_add(c[0], c[1]), c[2]), 1.0 / 3);
    tmc_place centre = from[0];
    const tmc_path way = tmc_path_make(p, &centre, middle, up, SIZE_MAX, 1);
    if (way.reach > 0) tmc_walk(p, &way, &centre);
    tmc_choose_chart(p, spots, &centre);
    for (size_t k = 0; k < 3; k++) {
        tmc_place at = centre;
        const tmc_path w = tmc_path_make(p, &at, c[k], up, from[k].triangle, 0);
        if (tmc_walk(p, &w, &at)) at = from[k];
        else if (spots[k].on_seam) tmc_nearest_spot(p, &spots[k], at, &at);
        tmc_interpolate(&p->values, at.triangle, at.u, at.v,
                        p->out + p->values.channels * (3 * t + k));
    }
}

static void tmc_transfer_faces(const void *job, size_t first, size_t end) {
    for (size_t t = first; t < end; t++) tmc_transfer_face((const tmc_paths *)job, t);
}

TRIMESH_COVER_API txm_status trimesh_transfer_corners(const txm_mesh *input, const trimesh_values *values,
                                                const txm_mesh *mesh, const txm_mesh_place *sources,
                                                txm_env *env, float *out) {
    tmc_paths p;
    txm_arena arena;
    memset(&p, 0, sizeof p);
    txm_status status = txm_mesh_check(input, "input", 3, 1, TRIMESH_MAX_VERTICES, env);
    if (status == TXM_OK) status = tmc_check_values(input, values, env, &p.values);
    if (status == TXM_OK) status = txm_mesh_check(mesh, "mesh", 3, 0, TRIMESH_MAX_VERTICES, env);
    if (status == TXM_OK) status = tmc_check_sources(input, sources, mesh->vertex_count, env);
    if (status != TXM_OK || mesh->face_count == 0) return status;
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    if (tmc_report(env, 0, "seams") != TXM_OK) return TXM_CANCELLED;
    p.input = *input;
    p.mesh = mesh;
    p.sources = sources;
    p.out = out;
    txm_arena_init(&arena, env);
    status = tmc_paths_build(&p, &arena, env);
    if (status == TXM_OK)
        status = tmc_run_blocks(tmc_transfer_faces, &p, mesh->face_count, 0.3, 1, "values", env);
    txm_arena_free(&arena);
    return status;
}

/* ---- attributes: doubled vertices ------------------------------------------------------------ */

/* the bits of a float, the same for 0 and -0 */
static uint32_t tmc_bits(float x) {
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits == 0x80000000u ? 0 : bits;
}

static int tmc_equal_bits(const float *a, const float *b, size_t count) {
    for (size_t i = 0; i < count; i++) {
        if (tmc_bits(a[i]) != tmc_bits(b[i])) return 0;
    }
    return 1;
}

/* Sort the corners by vertex, and those of one vertex by a hash of their values. */
static void tmc_sort_corners(const txm_mesh *mesh, const float *values, size_t channels,
                             txm_pair *pairs) {
    const size_t n = 3 * mesh->face_count;
    for (size_t c = 0; c < n; c++) {
        uint64_t hash = 0;
        for (size_t i = 0; i < channels; i++)
            hash = txm_hash(hash + tmc_bits(values[channels * c + i]) + 1);
        pairs[c].key = (uint32_t)(hash >> 32);
        pairs[c].value = (uint32_t)c;
    }
    txm_sort_pairs(pairs, pairs + n, n);
    for (size_t i = 0; i < n; i++) pairs[i].key = mesh->indices[pairs[i].value];
    txm_sort_pairs(pairs, pairs + n, n);
}

TRIMESH_COVER_API txm_status trimesh_split_corners(const txm_mesh *mesh, const float *values,
                                             int channels, txm_env *env, uint32_t *new_indices,
                                             uint32_t *corners, size_t *count) {
    txm_arena arena;
    txm_status status = txm_mesh_check(mesh, "mesh", 3, 0, TRIMESH_MAX_VERTICES, env);
    if (status != TXM_OK) return status;
    if (channels < 1 || channels > TRIMESH_MAX_CHANNELS)
        return txm_fail(env, TXM_BAD_ARGUMENT, "channels must be 1 to TRIMESH_MAX_CHANNELS");
    if (!count || (mesh->face_count && !values))
        return txm_fail(env, TXM_BAD_ARGUMENT, "values or count is NULL");
    const size_t n = 3 * mesh->face_count, width = (size_t)channels;
    if (tmc_report(env, 0, "corners") != TXM_OK) return TXM_CANCELLED;
    txm_arena_init(&arena, env);
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(&arena, n, 2 * sizeof(txm_pair));
    size_t made = 0;
    if ((status = tmc_check_memory(&arena, env)) != TXM_OK) goto done;
    tmc_sort_corners(mesh, values, width, pairs);
    /* Equal corners now follow each other, except where different values have the same hash, which
       is rare: then there is an extra vertex, which does no harm. */
    for (size_t i = 0; i < n; i++) {
        const size_t c = pairs[i].value, before = pairs[i ? i - 1 : 0].value;
        const int fresh = i == 0 || mesh->indices[c] != mesh->indices[before] ||
                          !tmc_equal_bits(values + width * c, values + width * before, width);
        if (fresh && corners) corners[made] = (uint32_t)c;
        made += (size_t)fresh;
        if (new_indices) new_indices[c] = (uint32_t)(made - 1);
    }
    *count = made;
done:
    txm_arena_free(&arena);
    return status;
}

/* ---- texturing ------------------------------------------------------------------------------- */

TRIMESH_COVER_API txm_status trimesh_atlas_make(int count, int size, int gutter, txm_env *env,
                                          trimesh_atlas *atlas) {
    const int n = count ? count : 4, s = size ? size : 256, g = gutter == -1 ? 8 : gutter;
    if (!atlas) return txm_fail(env, TXM_BAD_ARGUMENT, "atlas is NULL");
    if (n < 1 || n > 256) return txm_fail(env, TXM_BAD_ARGUMENT, "count must be 1 to 256");
    if (s < 2 || s > 16384) return txm_fail(env, TXM_BAD_ARGUMENT, "size must be 2 to 16384");
    if (g < 0 || g > s) return txm_fail(env, TXM_BAD_ARGUMENT, "gutter must be -1 to size");
    atlas->count = n;
    atlas->size = s;
    atlas->gutter = g;
    atlas->pitch = s + 2 * g;
    atlas->width = n * atlas->pitch;
    atlas->height = (int)ceil(s * TMC_H) + 2 * g;
    return TXM_OK;
}

TRIMESH_COVER_API int trimesh_atlas_uv(const trimesh_atlas *atlas, int patch, float *uv) {
    if (!atlas || !uv || patch < -1 || patch >= atlas->count) return 0;
    const int first = patch < 0 ? 0 : patch, end = patch < 0 ? atlas->count : patch + 1;
    for (int p = first; p < end; p++) {
        for (int k = 0; k < 3; k++, uv += 2) {
            const double across = k == 0 ? 0 : k == 1 ? 1 : 0.5;
            const double x = (double)p * atlas->pitch + atlas->gutter + across * atlas->size;
            const double y = atlas->height - atlas->gutter - (k == 2 ? atlas->size * TMC_H : 0);
            uv[0] = txm_float(x / atlas->width);
            uv[1] = txm_float(y / atlas->height);
        }
    }
    return 1;
}

/* All triangles in breadth-first order. */
static void tmc_breadth_first(const uint32_t *next, size_t triangles, uint8_t *seen,
                              uint32_t *order) {
    size_t end = 0;
    for (size_t first = 0, at = 0; first < triangles; first++) {
        if (seen[first]) continue;
        seen[first] = 1;
        order[end++] = (uint32_t)first;
        for (; at < end; at++) {
            for (size_t side = 3 * (size_t)order[at]; side < 3 * (size_t)order[at] + 3; side++) {
                for (size_t s = next[side]; s != side; s = next[s]) {
                    if (seen[s / 3]) continue;
                    seen[s / 3] = 1;
                    TXM_ASSERT(end < triangles);
                    order[end++] = (uint32_t)(s / 3);
                }
            }
        }
    }
}

/* The cost of a choice beside the neighbours' choices so far: 0 = none of them has this patch. */
static int tmc_clashes(const uint32_t *next, const int *choice, int patches, size_t t, int chosen) {
    int sum = 0;
    for (size_t side = 3 * t; side < 3 * t + 3; side++) {
        int looked = 0; /* not for edges of very many triangles          */
        for (size_t s = next[side]; s != side && looked < 8; s = next[s], looked++) {
            const int other = choice[s / 3];
            if (other >= 0 && other % patches == chosen % patches) sum += other == chosen ? 8 : 1;
        }
    }
    return sum;
}

/* Choose in the reverse of that order: then every triangle but the last of its piece still has a
   neighbour without a choice, so that at most two neighbours constrain it. choice = patch + patches
   * rotation. */
static void tmc_choose(const uint32_t *next, const uint32_t *order, size_t triangles, int patches,
                       int total, uint64_t seed, int *choice) {
    for (size_t t = 0; t < triangles; t++) choice[t] = -1;
    for (size_t i = triangles; i-- > 0;) {
        const size_t t = order[i];
        txm_rng rng = txm_rng_make(seed, t);
        const int first = (int)txm_rng_below(&rng, (uint32_t)total);
        int best = first, least = INT_MAX;
        for (int k = 0; k < total && k < 64 && least > 0; k++) {
            const int chosen = (int)(((int64_t)first + k) % total);
            const int clashes = tmc_clashes(next, choice, patches, t, chosen);
            if (clashes >= least) continue;
            least = clashes;
            best = chosen;
        }
        choice[t] = best;
    }
}

static void tmc_put_choice(int choice, int patches, size_t t, int *out, int *rotations) {
    out[t] = choice % patches;
    if (rotations) rotations[t] = choice / patches;
}

TRIMESH_COVER_API txm_status trimesh_choose(const txm_mesh *mesh, const trimesh_choose_desc *desc,
                                      txm_env *env, int *patches, int *rotations) {
    trimesh_choose_desc none;
    txm_arena arena;
    memset(&none, 0, sizeof none);
    if (!desc) desc = &none;
    const int n = desc->patches ? desc->patches : 4, turns = desc->rotations ? desc->rotations : 3;
    txm_status status = txm_mesh_check(mesh, "mesh", 3, 0, TRIMESH_MAX_VERTICES, env);
    if (status != TXM_OK) return status;
    if (n < 1 || n > 65536) return txm_fail(env, TXM_BAD_ARGUMENT, "patches must be 1 to 65536");
    if (turns != 1 && turns != 3)
        return txm_fail(env, TXM_BAD_ARGUMENT, "rotations must be 1 or 3");
    const size_t count = mesh->face_count;
    if (count == 0) return TXM_OK;
    if (!patches || (turns == 3 && !rotations))
        return txm_fail(env, TXM_BAD_ARGUMENT, "patches or rotations is NULL");
    if (tmc_report(env, 0, "patches") != TXM_OK) return TXM_CANCELLED;
    for (size_t t = 0; desc->repeat && t < count; t++) {
        txm_rng rng = txm_rng_make(desc->seed, t);
        tmc_put_choice((int)txm_rng_below(&rng, (uint32_t)(n * turns)), n, t, patches, rotations);
    }
    if (desc->repeat) return TXM_OK;
    txm_arena_init(&arena, env);
    uint32_t *next = (uint32_t *)txm_arena_alloc(&arena, count, 3 * sizeof(uint32_t));
    uint32_t *order = (uint32_t *)txm_arena_alloc(&arena, count, sizeof(uint32_t));
    int *choice = (int *)txm_arena_alloc(&arena, count, sizeof(int));
    uint8_t *seen = (uint8_t *)txm_arena_zero(&arena, count, 1);
    status = tmc_check_memory(&arena, env);
    if (status == TXM_OK) status = tmc_link(mesh, env, next);
    if (status == TXM_OK) status = tmc_report(env, 0.5, "patches");
    if (status == TXM_OK) {
        tmc_breadth_first(next, count, seen, order);
        tmc_choose(next, order, count, n, n * turns, desc->seed, choice);
        for (size_t t = 0; t < count; t++) tmc_put_choice(choice[t], n, t, patches, rotations);
    }
    txm_arena_free(&arena);
    return status;
}

TRIMESH_COVER_API txm_status trimesh_place_tiles(size_t triangle_count, const int *tiles,
                                           const int *rotations, const float *tile_uv,
                                           size_t tile_count, txm_env *env, float *uv) {
    if (triangle_count > TRIMESH_MAX_VERTICES)
        return txm_fail(env, TXM_TOO_LARGE, "more than TRIMESH_MAX_VERTICES triangles");
    if (triangle_count == 0) return TXM_OK;
    if (!tiles || !tile_uv || !uv)
        return txm_fail(env, TXM_BAD_ARGUMENT, "tiles, tile_uv or uv is NULL");
    for (size_t t = 0; t < triangle_count; t++) {
        if (tiles[t] < 0 || (size_t)tiles[t] >= tile_count)
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                    "the tile of triangle # is not 0..tile_count - 1", t, 0);
        if (rotations && (rotations[t] < 0 || rotations[t] > 2))
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT, "the rotation of triangle # is not 0..2",
                                    t, 0);
    }
    for (size_t t = 0; t < triangle_count; t++) {
        const size_t turn = rotations ? (size_t)rotations[t] : 0;
        for (size_t k = 0; k < 3; k++) {
            const float *from = tile_uv + 6 * (size_t)tiles[t] + 2 * ((k + turn) % 3);
            uv[6 * t + 2 * k] = from[0];
            uv[6 * t + 2 * k + 1] = from[1];
        }
    }
    return TXM_OK;
}

TRIMESH_COVER_API txm_status trimesh_edge_colors(const txm_mesh *mesh, int colors, uint64_t seed,
                                           txm_env *env, int *edge_colors, int *directions) {
    const txm_status status = txm_mesh_check(mesh, "mesh", 3, 0, TRIMESH_MAX_VERTICES, env);
    if (status != TXM_OK) return status;
    if (colors < 1 || colors > 65536)
        return txm_fail(env, TXM_BAD_ARGUMENT, "colors must be 1 to 65536");
    if (mesh->face_count && !edge_colors)
        return txm_fail(env, TXM_BAD_ARGUMENT, "edge_colors is NULL");
    for (size_t i = 0; i < 3 * mesh->face_count; i++) {
        edge_colors[i] = txm_mesh_edge_color(mesh, i, seed, colors);
        if (directions) directions[i] = txm_mesh_runs_down(mesh, i) ? -1 : 1;
    }
    return TXM_OK;
}

TRIMESH_COVER_API txm_status trimesh_random_colors(size_t vertex_count, int count, uint64_t seed,
                                             txm_env *env, int *colors) {
    const int n = count ? count : 3;
    if (vertex_count > TRIMESH_MAX_VERTICES)
        return txm_fail(env, TXM_TOO_LARGE, "more than TRIMESH_MAX_VERTICES vertices");
    if (n < 1 || n > 65536) return txm_fail(env, TXM_BAD_ARGUMENT, "count must be 1 to 65536");
    if (vertex_count && !colors) return txm_fail(env, TXM_BAD_ARGUMENT, "colors is NULL");
    for (size_t v = 0; v < vertex_count; v++) {
        txm_rng rng = txm_rng_make(seed, v);
        colors[v] = (int)txm_rng_below(&rng, (uint32_t)n);
    }
    return TXM_OK;
}

/* ---- texturing: proper colours --------------------------------------------------------------- */

/* Which vertices share an edge: those of v are ends[first[v]] .. ends[first[v + 1] - 1]. */
typedef struct tmc_graph {
    size_t count;
    uint32_t *first, *ends;
    uint32_t *degree; /* neighbours left                                                  */
    uint32_t *order;  /* all vertices by degree; removed from the front                  */
    uint32_t *place;  /* where a vertex lies in order                                     */
    uint32_t *bucket; /* where the vertices of each degree begin                          */
} tmc_graph;

static txm_status tmc_graph_build(tmc_graph *g, const txm_mesh *mesh, txm_arena *arena,
                                  txm_env *env) {
    const size_t n = mesh->vertex_count, sides = 3 * mesh->face_count;
    txm_arena scratch;
    uint32_t *sorted;
    txm_arena_init(&scratch, env);
    g->count = n;
    g->first = (uint32_t *)txm_arena_zero(arena, n + 2, sizeof(uint32_t));
    g->ends = (uint32_t *)txm_arena_alloc(arena, sides, 2 * sizeof(uint32_t));
    txm_status status = tmc_check_memory(arena, env);
    if (status == TXM_OK) status = tmc_sort_sides(mesh, &scratch, env, &sorted);
    const int good = status == TXM_OK;
    for (int pass = 0; pass < 2 && good; pass++) {
        for (size_t i = 0; i < sides; i = txm_mesh_edge_end(mesh, sorted, i)) {
            const uint32_t low = txm_mesh_low(mesh, sorted[i]), high = txm_mesh_high(mesh, sorted[i]);
            if (low == high) continue;
            if (pass) {
                g->ends[g->first[low + 1]] = high;
                g->ends[g->first[high + 1]] = low;
            }
            /* count at + 2, then fill from + 1: afterwards first[v] is right */
            g->first[low + (pass ? 1 : 2)]++;
            g->first[high + (pass ? 1 : 2)]++;
        }
        for (size_t v = 2; !pass && v < n + 2; v++) g->first[v] += g->first[v - 1];
    }
    txm_arena_free(&scratch);
    return status;
}

/* Remove the vertex with the fewest neighbours left, over and over; order receives them. Vertices
   are sorted by degree; one that loses a neighbour is swapped with the first of its degree. */
static txm_status tmc_smallest_first(tmc_graph *g, txm_arena *arena, txm_env *env) {
    const size_t n = g->count;
    g->degree = (uint32_t *)txm_arena_alloc(arena, n, sizeof(uint32_t));
    g->order = (uint32_t *)txm_arena_alloc(arena, n, sizeof(uint32_t));
    g->place = (uint32_t *)txm_arena_alloc(arena, n, sizeof(uint32_t));
    g->bucket = (uint32_t *)txm_arena_zero(arena, n + 2, sizeof(uint32_t));
    const txm_status status = tmc_check_memory(arena, env);
    if (status != TXM_OK) return status;
    for (size_t v = 0; v < n; v++) {
        g->degree[v] = g->first[v + 1] - g->first[v];
        g->bucket[g->degree[v] + 1]++;
    }
    for (size_t d = 1; d < n + 2; d++) g->bucket[d] += g->bucket[d - 1];
    for (size_t v = 0; v < n; v++) {
        g->place[v] = g->bucket[g->degree[v]]++;
        g->order[g->place[v]] = (uint32_t)v;
    }
    for (size_t d = n + 1; d > 0; d--) g->bucket[d] = g->bucket[d - 1];
    g->bucket[0] = 0;
    for (size_t i = 0; i < n; i++) {
        const uint32_t v = g->order[i];
        for (uint32_t e = g->first[v]; e < g->first[v + 1]; e++) {
            const uint32_t u = g->ends[e], d = g->degree[u];
            if (g->place[u] <= i || d <= g->degree[v]) continue; /* removed, or next anyway */
            const uint32_t to = g->bucket[d]++, w = g->order[to], from = g->place[u];
            g->order[from] = w;
            g->place[w] = from;
            g->order[to] = u;
            g->place[u] = to;
            g->degree[u] = d - 1;
        }
    }
    return TXM_OK;
}

/* Colour in the reverse order; taken[c] = v + 1: a neighbour of v has colour c. */
static int tmc_color_back(const tmc_graph *g, uint32_t *taken, int *colors) {
    int most = 0;
    for (size_t i = g->count; i-- > 0;) {
        const uint32_t v = g->order[i];
        for (uint32_t e = g->first[v]; e < g->first[v + 1]; e++) {
            if (g->place[g->ends[e]] > i) taken[colors[g->ends[e]]] = v + 1;
        }
        int c = 0;
        while (taken[c] == v + 1) c++;
        colors[v] = c;
        if (c + 1 > most) most = c + 1;
    }
    return most;
}

TRIMESH_COVER_API txm_status trimesh_proper_colors(const txm_mesh *mesh, txm_env *env, int *colors,
                                             int *count) {
    tmc_graph g;
    txm_arena arena;
    memset(&g, 0, sizeof g);
    txm_status status = txm_mesh_check(mesh, "mesh", 3, 0, TRIMESH_MAX_VERTICES, env);
    if (status != TXM_OK) return status;
    const size_t n = mesh->vertex_count;
    if (n && !colors) return txm_fail(env, TXM_BAD_ARGUMENT, "colors is NULL");
    if (mesh->face_count == 0) {
        for (size_t v = 0; v < n; v++) colors[v] = 0;
        if (count) *count = n > 0;
        return TXM_OK;
    }
    if (tmc_report(env, 0, "edges") != TXM_OK) return TXM_CANCELLED;
    txm_arena_init(&arena, env);
    uint32_t *taken = (uint32_t *)txm_arena_zero(&arena, n + 1, sizeof(uint32_t));
    status = tmc_check_memory(&arena, env);
    if (status == TXM_OK) status = tmc_graph_build(&g, mesh, &arena, env);
    if (status == TXM_OK) status = tmc_smallest_first(&g, &arena, env);
    if (status == TXM_OK) status = tmc_report(env, 0.7, "colors");
    if (status == TXM_OK) {
        const int most = tmc_color_back(&g, taken, colors);
        if (count) *count = most;
    }
    txm_arena_free(&arena);
    return status;
}

/* ---- geometry on triangles: patches made ready ----------------------------------------------- */

enum {
    TMC_MOST_POINTS = 1 << 20 /* of a patch */
};
#define TMC_WHOLE 6 /* sixths of a thing that a point inside counts; on a side 3, a corner 1 */

/* A point of a patch with all that does not depend on the triangle. */
typedef struct tmc_item {
    double w[3]; /* weights of the patch's corners                                        */
    double height, scale;
    txm_quat turn;  /* of length 1                                                        */
    uint32_t prototype;
    uint32_t before;      /* sixths of the points before this one                         */
    uint8_t side, corner; /* on which it lies; TMC_NONE = inside; both for a corner    */
} tmc_item;

typedef struct tmc_prepared {
    const tmc_item *items;
    const uint32_t *rim; /* numbers of the items on sides and corners, rising             */
    uint32_t count, rim_count;
    uint32_t sixths; /* of all points                                                     */
} tmc_prepared;

typedef struct tmc_scatter {
    const trimesh_scatter_desc *desc;
    const float *normals;
    const tmc_prepared *kits;
    const uint8_t *owned; /* 1 per triangle: bit k = its side k, bit 3 + k = its corner k; NULL =
                             no patch has points there                                    */
    double *area;         /* 1 per triangle, at the height                                */
    uint32_t *take;       /* 1 per triangle: how many points are used; NULL = all             */
    size_t *offset;       /* 1 per triangle: number of its first instance                 */
    const double *mix;    /* sums of the shares                                           */
    uint64_t key;         /* of the seed                                                  */
    trimesh_instance *out;
} tmc_scatter;

static txm_status tmc_check_point(const trimesh_point *p, size_t patch, size_t i, txm_env *env) {
    const char *why = NULL;
    double turn = 0;
    for (int k = 0; k < 4; k++) turn += (double)p->rotation[k] * p->rotation[k];
    if (!(p->u >= 0 && p->v >= 0 && (double)p->u + p->v <= 1 + TMC_SNAP))
        why = "patch #, point #: u and v must be 0 or more, their sum at most 1";
    else if (!(p->height >= -1000 && p->height <= 1000))
        why = "patch #, point #: height must be -1000 to 1000";
    else if (!(p->scale >= 0 && p->scale <= 1000))
        why = "patch #, point #: scale must be 0 to 1000";
    else if (!txm_is_finite(turn)) why = "patch #, point #: rotation is not finite";
    return why ? txm_fail_numbers(env, TXM_BAD_ARGUMENT, why, patch, i) : TXM_OK;
}

static void tmc_prepare_point(const trimesh_point *p, tmc_item *item) {
    const txm_quat turn = {p->rotation[0], p->rotation[1], p->rotation[2], p->rotation[3]};
    double sum = 0;
    int zeros = 0;
    item->w[0] = 1.0 - p->u - p->v;
    item->w[1] = p->u;
    item->w[2] = p->v;
    item->side = item->corner = TMC_NONE;
    for (int k = 0; k < 3; k++) { /* side k lies opposite corner k + 2 */
        if (item->w[k] > TMC_SNAP) continue;
        item->w[k] = 0;
        item->side = (uint8_t)((k + 1) % 3);
        zeros++;
    }
    for (int k = 0; k < 3; k++) {
        sum += item->w[k];
        if (zeros == 2 && item->w[k] > 0) item->corner = (uint8_t)k;
    }
    for (int k = 0; k < 3; k++) item->w[k] /= sum;
    item->height = p->height;
    item->scale = p->scale > 0 ? p->scale : 1;
    item->turn = txm_quat_unit(turn);
    item->prototype = p->prototype;
}

static uint32_t tmc_sixths(const tmc_item *item) {
    return item->corner != TMC_NONE ? 1 : item->side != TMC_NONE ? 3 : TMC_WHOLE;
}

/* Check and prepare all patches; *rims: has one of them points on its sides? */
static txm_status tmc_prepare(const trimesh_scatter_desc *desc, txm_arena *arena, txm_env *env,
                              tmc_scatter *s, int *rims) {
    size_t total = 0;
    for (size_t p = 0; p < (size_t)desc->patch_count; p++) {
        const trimesh_patch *patch = &desc->patches[p];
        if (patch->count > TMC_MOST_POINTS || (patch->count && !patch->points))
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                    "patch # has more than 2^20 points, or points is NULL", p, 0);
        for (size_t i = 0; i < patch->count; i++) {
            const txm_status status = tmc_check_point(&patch->points[i], p, i, env);
            if (status != TXM_OK) return status;
        }
        total += patch->count;
    }
    tmc_item *items = (tmc_item *)txm_arena_alloc(arena, total + 1, sizeof *items);
    uint32_t *rim = (uint32_t *)txm_arena_alloc(arena, total + 1, sizeof *rim);
    tmc_prepared *kits =
        (tmc_prepared *)txm_arena_alloc(arena, (size_t)desc->patch_count, sizeof *kits);
    const txm_status status = tmc_check_memory(arena, env);
    if (status != TXM_OK) return status;
    s->kits = kits;
    for (size_t p = 0; p < (size_t)desc->patch_count; p++) {
        tmc_prepared *kit = &kits[p];
        kit->items = items;
        kit->rim = rim;
        kit->count = (uint32_t)desc->patches[p].count;
        kit->rim_count = kit->sixths = 0;
        for (uint32_t i = 0; i < kit->count; i++) {
            tmc_prepare_point(&desc->patches[p].points[i], &items[i]);
            items[i].before = kit->sixths;
            kit->sixths += tmc_sixths(&items[i]);
            if (items[i].side != TMC_NONE) rim[kit->rim_count++] = i;
        }
        items += kit->count;
        rim += kit->rim_count;
        if (kit->rim_count) *rims = 1;
    }
    return TXM_OK;
}

/* Assign every edge and every vertex to the first triangle that has it. */
static txm_status tmc_assign_owners(const txm_mesh *mesh, txm_env *env, uint8_t *owned) {
    const size_t sides = 3 * mesh->face_count;
    const uint32_t *vertex = mesh->indices;
    txm_arena scratch;
    uint32_t *sorted;
    txm_arena_init(&scratch, env);
    uint8_t *given = (uint8_t *)txm_arena_zero(&scratch, mesh->vertex_count, 1);
    const txm_status status = tmc_sort_sides(mesh, &scratch, env, &sorted);
    const int good = status == TXM_OK;
    for (size_t i = 0; i < sides && good; i = txm_mesh_edge_end(mesh, sorted, i))
        owned[sorted[i] / 3] |= (uint8_t)(1 << sorted[i] % 3);
    for (size_t i = 0; i < sides && good; i++) {
        if (!given[vertex[i]]) owned[i / 3] |= (uint8_t)(8 << i % 3);
        given[vertex[i]] = 1;
    }
    txm_arena_free(&scratch);
    return status;
}

/* The patch of a triangle and how it is turned. */
static const tmc_prepared *tmc_choice(const tmc_scatter *s, size_t t, size_t *rotation) {
    const trimesh_scatter_desc *d = s->desc;
    const uint64_t h = txm_hash(s->key + t);
    const size_t random = (size_t)((h >> 32) * (uint64_t)d->patch_count >> 32);
    *rotation = d->rotations ? (size_t)d->rotations[t] : (size_t)((h & 0xffffffffu) * 3 >> 32);
    return &s->kits[d->choices ? (size_t)d->choices[t] : random];
}

/* May this triangle show the item, turned so? */
static int tmc_owns(const tmc_scatter *s, size_t t, size_t rotation, const tmc_item *item) {
    if (item->side == TMC_NONE) return 1;
    const int corner = item->corner != TMC_NONE;
    const size_t there = corner ? item->corner : item->side, here = (there + 3 - rotation) % 3;
    return s->owned[t] >> (here + (corner ? 3 : 0)) & 1;
}

/* ---- geometry on triangles: how many where --------------------------------------------------- */

/* The edge length of the triangle that heights and scales refer to. */
static double tmc_unit(const tmc_scatter *s, txm_dvec3 area2) {
    return s->desc->unit > 0 ? s->desc->unit : sqrt(txm_d3_len(area2) / TMC_H);
}

static void tmc_area_block(const void *job, size_t first, size_t end) {
    const tmc_scatter *s = (const tmc_scatter *)job;
    const txm_mesh *mesh = &s->desc->mesh;
    const double height = s->desc->inside ? -s->desc->height : s->desc->height;
    for (size_t t = first; t < end; t++) {
        txm_dvec3 p[3];
        txm_mesh_triangle(mesh, t, p);
        const txm_dvec3 flat = txm_d3_area2(p[0], p[1], p[2]);
        const double up = height * tmc_unit(s, flat);
        for (size_t k = 0; k < 3; k++) {
            const float *n = s->normals + 3 * (size_t)mesh->indices[3 * t + k];
            p[k] = txm_d3_mad(p[k], txm_d3_load(n), up);
        }
        const txm_dvec3 there = txm_d3_area2(p[0], p[1], p[2]);
        /* beyond the centre of curvature the triangle is inverted: no room there */
        s->area[t] = txm_d3_dot(there, flat) > 0 ? 0.5 * txm_d3_len(there) : 0;
    }
}

/* spread the lower ten bits of x to every third bit */
static uint32_t tmc_third_bits(uint32_t x) {
    x = (x | x << 16) & 0x030000ffu;
    x = (x | x << 8) & 0x0300f00fu;
    x = (x | x << 4) & 0x030c30c3u;
    return (x | x << 2) & 0x09249249u;
}

/* The triangles in the order of a Morton curve through their middles. pairs: room for 2 per
   triangle. */
static void tmc_morton(const txm_mesh *mesh, txm_pair *pairs) {
    double low[3] = {0, 0, 0}, size = 0;
    for (size_t i = 0; i < 3 * mesh->vertex_count; i++)
        if (i < 3 || mesh->positions[i] < low[i % 3]) low[i % 3] = mesh->positions[i];
    for (size_t i = 0; i < 3 * mesh->vertex_count; i++)
        if (mesh->positions[i] - low[i % 3] > size) size = mesh->positions[i] - low[i % 3];
    for (size_t t = 0; t < mesh->face_count; t++) {
        uint32_t key = 0;
        txm_dvec3 p[3];
        txm_mesh_triangle(mesh, t, p);
        const txm_dvec3 sum = txm_d3_add(txm_d3_add(p[0], p[1]), p[2]);
        const double at[3] = {sum.x / 3 - low[0], sum.y / 3 - low[1], sum.z / 3 - low[2]};
        for (int k = 0; k < 3; k++) {
            const int cell = size > 0 ? (int)(at[k] / size * 1023.5) : 0;
            key |= tmc_third_bits((uint32_t)txm_clampi(cell, 0, 1023)) << k;
        }
        pairs[t].key = key;
        pairs[t].value = (uint32_t)t;
    }
    txm_sort_pairs(pairs, pairs + mesh->face_count, mesh->face_count);
}

/* How many points from the front of a patch come nearest to so many sixths of a thing. */
static uint32_t tmc_prefix_length(const tmc_prepared *kit, double sixths) {
    uint32_t low = 0, high = kit->count; /* low points are not too many, high + 1 points are */
    while (low < high) {
        const uint32_t middle = (low + high + 1) / 2;
        const uint32_t sum = middle < kit->count ? kit->items[middle].before : kit->sixths;
        if (sum <= sixths) low = middle;
        else high = middle - 1;
    }
    if (low == kit->count) return low;
    const tmc_item *next = &kit->items[low];
    return sixths - next->before > 0.5 * tmc_sixths(next) ? low + 1 : low;
}

/* Fill s->take so that the number of things on any stretch of the curve fits its area. */
static txm_status tmc_thin_patches(const tmc_scatter *s, const txm_pair *order, txm_env *env) {
    const size_t triangles = s->desc->mesh.face_count;
    double carry = 0, most = 0;
    int short_of = 0;
    for (size_t i = 0; i < triangles; i++) {
        const size_t t = order[i].value;
        const double wanted = TMC_WHOLE * (double)s->desc->density * s->area[t];
        size_t rotation;
        const tmc_prepared *kit = tmc_choice(s, t, &rotation);
        const uint32_t n = tmc_prefix_length(kit, wanted + carry);
        carry += wanted - (n < kit->count ? kit->items[n].before : kit->sixths);
        /* what one triangle lacks goes to the next few, at most an eighth of their number */
        if (carry > fmax(TMC_WHOLE, wanted / 8)) {
            short_of = 1;
            carry = 0;
        }
        if (wanted > most) most = wanted;
        s->take[t] = n;
    }
    if (!short_of) return TXM_OK;
    most = ceil(most / TMC_WHOLE);
    return txm_fail_numbers(
        env, TXM_TOO_SMALL,
        "the patches have too few points for this density; the largest triangle "
        "needs #, points on sides counted half, on corners a sixth",
        most < 1e15 ? (uint64_t)most : (uint64_t)1000000000000000u, 0);
}

/* s->offset[t] = instances of triangle t */
static void tmc_count_block(const void *job, size_t first, size_t end) {
    const tmc_scatter *s = (const tmc_scatter *)job;
    for (size_t t = first; t < end; t++) {
        size_t rotation;
        const tmc_prepared *kit = tmc_choice(s, t, &rotation);
        const uint32_t take = s->take ? s->take[t] : kit->count;
        size_t count = take;
        for (uint32_t i = 0; i < kit->rim_count && kit->rim[i] < take; i++)
            count -= !tmc_owns(s, t, rotation, &kit->items[kit->rim[i]]);
        s->offset[t] = count;
    }
}

/* ---- geometry on triangles: frames ----------------------------------------------------------- */

/* A unit vector at a right angle to the unit vector n, near x if there is one. */
static txm_dvec3 tmc_tangent(txm_dvec3 x, txm_dvec3 n) {
    x = txm_d3_mad(x, n, -txm_d3_dot(x, n));
    if (txm_d3_len2(x) > 0) return txm_d3_unit(x);
    const txm_vec3 p = txm_vec3_perpendicular(
        txm_v3(txm_float(n.x), txm_float(n.y), txm_float(n.z)));
    x = txm_d3(p.x, p.y, p.z);
    return txm_d3_unit(txm_d3_mad(x, n, -txm_d3_dot(x, n)));
}

/* A triangle that a patch lies on. */
typedef struct tmc_base {
    txm_dvec3 p[3], n[3]; /* by the corner of the patch                     */
    txm_dvec3 ex, ey;     /* images of the patch's axes                     */
    txm_dvec3 up;         /* twice the area times the normal                */
    double unit, edge;  /* for heights and scales; the triangle's own     */
} tmc_base;

static void tmc_base_make(const tmc_scatter *s, size_t t, size_t rotation, tmc_base *b) {
    const txm_mesh *mesh = &s->desc->mesh;
    for (size_t k = 0; k < 3; k++) {
        const size_t v = mesh->indices[3 * t + k], to = (k + rotation) % 3;
        b->p[to] = txm_d3_load(mesh->positions + 3 * v);
        b->n[to] = txm_d3_load(s->normals + 3 * v);
    }
    b->up = txm_d3_area2(b->p[0], b->p[1], b->p[2]);
    b->ex = txm_d3_sub(b->p[1], b->p[0]);
    b->ey = txm_d3_scale(txm_d3_sub(b->p[2], txm_d3_scale(txm_d3_add(b->p[0], b->p[1]), 0.5)),
                         1 / TMC_H);
    b->unit = tmc_unit(s, b->up);
    b->edge = sqrt(txm_d3_len(b->up) / TMC_H);
}

/* Phong tessellation [4]: the point p of the triangle moves towards its feet on the tangent planes
   at the corners, here by half the distance, which on a sphere leads back to the sphere:

       sum_i w_i ((p_i - p) . n_i) n_i  =  sum_{i<j} w_i w_j |p_i - p_j|^2 / r  =  2 sagitta      */
static txm_dvec3 tmc_curve_point(const tmc_base *b, const double w[3], txm_dvec3 p, double curve) {
    txm_dvec3 sum = txm_d3(0, 0, 0);
    for (int k = 0; k < 3; k++)
        sum = txm_d3_mad(sum, b->n[k], w[k] * txm_d3_dot(txm_d3_sub(b->p[k], p), b->n[k]));
    sum = txm_d3_scale(sum, 0.5 * curve);
    const double length = txm_d3_len(sum);
    return length > b->edge ? txm_d3_scale(sum, b->edge / length) : sum;
}

/* A random rotation about z: half its angle is the angle of a random point of the disc. */
static txm_quat tmc_spin(uint64_t h) {
    double x, y, r;
    do {
        h = txm_hash(h + 1);
        x = (double)(int32_t)(uint32_t)h / 2147483648.0;
        y = (double)(int32_t)(uint32_t)(h >> 32) / 2147483648.0;
        r = x * x + y * y;
    } while (r > 1 || r < 0.01);
    const txm_quat q = {0, 0, x / sqrt(r), y / sqrt(r)};
    return q;
}

static uint32_t tmc_mix(const tmc_scatter *s, uint64_t h) {
    const int count = s->desc->mix_count;
    const double x = (double)(h >> 11) / 9007199254740992.0 * s->mix[count - 1];
    int k = 0;
    while (k + 1 < count && s->mix[k] <= x) k++;
    return (uint32_t)k;
}

/* As a float: of meshes near the end of the range of floats, things on them may lie beyond it. */
static float tmc_bounded(double x) {
    const double most = 3.4028234663852886e38;
    return txm_float(x < -most ? -most : x > most ? most : x);
}

static void tmc_place_item(const tmc_scatter *s, const tmc_base *b, const tmc_item *item,
                           uint64_t h, trimesh_instance *out) {
    const trimesh_scatter_desc *d = s->desc;
    const double *w = item->w, side = d->inside ? -1 : 1;
    txm_dvec3 p = txm_d3_scale(b->p[0], w[0]), n = txm_d3_scale(b->n[0], w[0]);
    for (int k = 1; k < 3; k++) {
        p = txm_d3_mad(p, b->p[k], w[k]);
        n = txm_d3_mad(n, b->n[k], w[k]);
    }
    n = txm_d3_unit(txm_d3_len2(n) > 0 ? n : b->up);
    if (!(txm_d3_len2(n) > 0)) n = txm_d3(0, 0, 1);
    if (d->curve > 0) p = txm_d3_add(p, tmc_curve_point(b, w, p, d->curve));
    p = txm_d3_mad(p, n, side * (item->height + d->height) * b->unit);
    /* In the plane of the triangle the nearest rotation takes x to the sum of ex and ey rotated by
       -90 degrees; seen from below, where the winding is opposite, by +90 degrees. */
    const double back = txm_d3_dot(n, b->up) < 0 ? -1 : 1;
    const txm_dvec3 x = tmc_tangent(txm_d3_mad(b->ex, txm_d3_cross(b->ey, n), back), n);
    const txm_dvec3 z = txm_d3_scale(n, side);
    txm_quat q = txm_quat_mul(txm_quat_from_axes(x, txm_d3_cross(z, x), z), item->turn);
    if (d->spin) q = txm_quat_mul(q, tmc_spin(h));
    const double length = sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
    const double scale = q.w < 0 ? -1 / length : 1 / length;
    out->position[0] = tmc_bounded(p.x);
    out->position[1] = tmc_bounded(p.y);
    out->position[2] = tmc_bounded(p.z);
    out->rotation[0] = txm_float(q.x * scale);
    out->rotation[1] = txm_float(q.y * scale);
    out->rotation[2] = txm_float(q.z * scale);
    out->rotation[3] = txm_float(q.w * scale);
    out->scale = tmc_bounded(item->scale * b->unit);
    out->prototype = s->mix ? tmc_mix(s, txm_hash(h)) : item->prototype;
}

static void tmc_fill_block(const void *job, size_t first, size_t end) {
    const tmc_scatter *s = (const tmc_scatter *)job;
    for (size_t t = first; t < end; t++) {
        tmc_base base;
        size_t rotation;
        const tmc_prepared *kit = tmc_choice(s, t, &rotation);
        const uint32_t take = s->take ? s->take[t] : kit->count;
        trimesh_instance *out = s->out + s->offset[t];
        tmc_base_make(s, t, rotation, &base);
        for (uint32_t i = 0; i < take; i++) {
            const tmc_item *item = &kit->items[i];
            if (!tmc_owns(s, t, rotation, item)) continue;
            tmc_place_item(s, &base, item, txm_hash(s->key + ((uint64_t)t << 20 | i) + 1), out);
            out->triangle = (uint32_t)t;
            out++;
        }
    }
}

/* ---- geometry on triangles: public ----------------------------------------------------------- */

static txm_status tmc_check_choices(const trimesh_scatter_desc *d, txm_env *env) {
    for (size_t t = 0; t < d->mesh.face_count; t++) {
        if (d->choices && (d->choices[t] < 0 || d->choices[t] >= d->patch_count))
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                    "the choice of triangle # is not 0..patch_count - 1", t, 0);
        if (d->rotations && (d->rotations[t] < 0 || d->rotations[t] > 2))
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT, "the rotation of triangle # is not 0..2",
                                    t, 0);
    }
    return TXM_OK;
}

static txm_status tmc_check_scatter(const trimesh_scatter_desc *d, txm_env *env) {
    double sum = 0;
    if (!d) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL; pass a trimesh_scatter_desc");
    const txm_status status = txm_mesh_check(&d->mesh, "mesh", 3, 1, TRIMESH_MAX_VERTICES, env);
    if (status != TXM_OK) return status;
    if (d->normals && !tmc_are_finite(d->normals, 3 * d->mesh.vertex_count))
        return txm_fail(env, TXM_BAD_ARGUMENT, "normals must be finite");
    if (!d->patches || d->patch_count < 1 || d->patch_count > 65536)
        return txm_fail(env, TXM_BAD_ARGUMENT, "patch_count must be 1 to 65536, patches not NULL");
    if (!(d->unit >= 0 && txm_is_finite(d->unit)))
        return txm_fail(env, TXM_BAD_ARGUMENT, "unit must be finite and 0 or more");
    if (!(d->height >= -1000 && d->height <= 1000))
        return txm_fail(env, TXM_BAD_ARGUMENT, "height must be -1000 to 1000");
    if (!(d->curve >= 0 && d->curve <= 1))
        return txm_fail(env, TXM_BAD_ARGUMENT, "curve must be 0 to 1");
    if (!(d->density >= 0 && txm_is_finite(d->density)))
        return txm_fail(env, TXM_BAD_ARGUMENT, "density must be finite and 0 or more");
    if (d->mix_count < 0 || d->mix_count > 256 || (d->mix && d->mix_count == 0))
        return txm_fail(env, TXM_BAD_ARGUMENT, "mix_count must be 1 to 256 with mix, else 0");
    for (int i = 0; i < d->mix_count && d->mix; i++) {
        if (!(d->mix[i] >= 0 && txm_is_finite(d->mix[i])))
            return txm_fail(env, TXM_BAD_ARGUMENT, "mix must be finite and 0 or more");
        sum += d->mix[i];
    }
    if (d->mix && !(sum > 0)) return txm_fail(env, TXM_BAD_ARGUMENT, "mix must not be all 0");
    return tmc_check_choices(d, env);
}

/* Areas, and from them how much of each patch is used. */
static txm_status tmc_plan_density(tmc_scatter *s, txm_arena *arena, txm_env *env) {
    const size_t triangles = s->desc->mesh.face_count;
    txm_arena scratch;
    txm_arena_init(&scratch, env);
    s->take = (uint32_t *)txm_arena_alloc(arena, triangles, sizeof(uint32_t));
    s->area = (double *)txm_arena_alloc(&scratch, triangles, sizeof(double));
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(&scratch, triangles, 2 * sizeof(txm_pair));
    txm_status status = tmc_check_memory(arena, env);
    if (status == TXM_OK) status = tmc_check_memory(&scratch, env);
    if (status == TXM_OK)
        status = tmc_run_blocks(tmc_area_block, s, triangles, 0.1, 0.2, "areas", env);
    if (status == TXM_OK) {
        tmc_morton(&s->desc->mesh, pairs);
        status = tmc_thin_patches(s, pairs, env);
    }
    txm_arena_free(&scratch);
    return status;
}

/* Everything before placing: normals, patches, owners of edges and vertices, counts, offsets. */
static txm_status tmc_plan(tmc_scatter *s, txm_arena *arena, txm_env *env, size_t *count) {
    const trimesh_scatter_desc *d = s->desc;
    const size_t triangles = d->mesh.face_count;
    int rims = 0;
    txm_status status = tmc_prepare(d, arena, env, s, &rims);
    if (status == TXM_OK) status = tmc_report(env, 0, "patches");
    if (status != TXM_OK) return status;
    s->normals = d->normals;
    if (!s->normals) {
        float *n = (float *)txm_arena_alloc(arena, d->mesh.vertex_count, 3 * sizeof(float));
        txm_env quiet;
        memset(&quiet, 0, sizeof quiet);
        if (env) quiet = *env;
        quiet.progress = NULL; /* the call has progress of its own */
        if ((status = tmc_check_memory(arena, env)) != TXM_OK) return status;
        if ((status = trimesh_normals(&d->mesh, &quiet, n)) != TXM_OK)
            return txm_fail(env, status, quiet.message);
        s->normals = n;
    }
    if (d->mix) {
        double *mix = (double *)txm_arena_alloc(arena, (size_t)d->mix_count, sizeof(double));
        if ((status = tmc_check_memory(arena, env)) != TXM_OK) return status;
        for (int i = 0; i < d->mix_count; i++) mix[i] = d->mix[i] + (i ? mix[i - 1] : 0);
        s->mix = mix;
    }
    if (rims) {
        uint8_t *owned = (uint8_t *)txm_arena_zero(arena, triangles, 1);
        if ((status = tmc_check_memory(arena, env)) == TXM_OK)
            status = tmc_assign_owners(&d->mesh, env, owned);
        if (status != TXM_OK) return status;
        s->owned = owned;
    }
    if (d->density > 0) status = tmc_plan_density(s, arena, env);
    if (status != TXM_OK) return status;
    s->offset = (size_t *)txm_arena_alloc(arena, triangles, sizeof(size_t));
    if ((status = tmc_check_memory(arena, env)) != TXM_OK) return status;
    status = tmc_run_blocks(tmc_count_block, s, triangles, 0.2, 0.3, "counting", env);
    uint64_t sum = 0;
    for (size_t t = 0; t < triangles && status == TXM_OK; t++) {
        const size_t here = s->offset[t];
        s->offset[t] = (size_t)sum;
        sum += here;
        if (sum > (uint64_t)INT32_MAX || sum > SIZE_MAX / sizeof(trimesh_instance))
            return txm_fail(env, TXM_TOO_LARGE, "more than 2^31 instances");
    }
    if (status == TXM_OK) *count = (size_t)sum;
    return status;
}

TRIMESH_COVER_API txm_status trimesh_scatter(const trimesh_scatter_desc *desc, txm_env *env,
                                       trimesh_instance *out, size_t capacity, size_t *count) {
    tmc_scatter s;
    txm_arena arena;
    txm_status status = tmc_check_scatter(desc, env);
    if (status != TXM_OK) return status;
    if (!count) return txm_fail(env, TXM_BAD_ARGUMENT, "count is NULL");
    if (desc->mesh.face_count == 0) {
        *count = 0;
        return TXM_OK;
    }
    memset(&s, 0, sizeof s);
    s.desc = desc;
    s.key = txm_hash(desc->seed + 0x9e3779b97f4a7c15u) << 1;
    s.out = out;
    txm_arena_init(&arena, env);
    status = tmc_plan(&s, &arena, env, count);
    if (status == TXM_OK && out && *count > capacity)
        status = txm_fail_numbers(env, TXM_TOO_LARGE, "# instances, but out has room for # only",
                                  *count, capacity);
    if (status == TXM_OK && out)
        status = tmc_run_blocks(tmc_fill_block, &s, desc->mesh.face_count, 0.3, 1, "placing", env);
    txm_arena_free(&arena);
    return status;
}

TRIMESH_COVER_API void trimesh_instance_apply(const trimesh_instance *instance, const float point[3],
                                        float out[3]) {
    const double x = instance->rotation[0], y = instance->rotation[1], z = instance->rotation[2];
    const txm_dvec3 axis = txm_d3(x, y, z), p = txm_d3_scale(txm_d3_load(point), instance->scale);
    const txm_dvec3 t = txm_d3_scale(txm_d3_cross(axis, p), 2);
    const txm_dvec3 turned =
        txm_d3_add(txm_d3_mad(p, t, instance->rotation[3]), txm_d3_cross(axis, t));
    out[0] = txm_float(turned.x + instance->position[0]);
    out[1] = txm_float(turned.y + instance->position[1]);
    out[2] = txm_float(turned.z + instance->position[2]);
}

/* ---- geometry on triangles: making patches --------------------------------------------------- */

#define TMC_RADIUS 1.9 /* ours: radius of influence, in steps; best of 1.5, 1.7, 1.9, 2.5 */
#define TMC_FORCE 0.2  /* ours: constant f; best of 0.1, 0.2, 0.3, 0.5 */

/* Points as u, v; the triangles across the sides are treated as mirror images. */
typedef struct tmc_uv {
    double u, v;
} tmc_uv;

/* its mirror image in side k: the weight of the opposite corner changes its sign */
static tmc_uv tmc_mirror(tmc_uv p, int k) {
    const double w = 1 - p.u - p.v, s = k == 0 ? p.v : k == 1 ? w : p.u;
    tmc_uv q;
    q.u = k == 2 ? -s : p.u + s;
    q.v = k == 0 ? -s : p.v + s;
    return q;
}

static double tmc_uv_dist2(tmc_uv a, tmc_uv b) {
    const double u = a.u - b.u, v = a.v - b.v;
    return u * u + u * v + v * v;
}

/* Each next point is the one furthest from those before and their images. gap: 1 per point. */
static void tmc_order(trimesh_point *points, size_t count, double *gap) {
    tmc_uv at;
    at.u = at.v = 1.0 / 3;
    for (size_t i = 0; i < count; i++) { /* the first: nearest to the middle */
        tmc_uv p;
        p.u = points[i].u;
        p.v = points[i].v;
        gap[i] = 100 - tmc_uv_dist2(at, p);
    }
    for (size_t i = 0; i < count; i++) {
        size_t best = i;
        for (size_t k = i + 1; k < count; k++) {
            if (gap[k] > gap[best]) best = k;
        }
        const trimesh_point chosen = points[best];
        points[best] = points[i];
        gap[best] = gap[i];
        points[i] = chosen;
        at.u = chosen.u;
        at.v = chosen.v;
        const tmc_uv copies[4] = {at, tmc_mirror(at, 0), tmc_mirror(at, 1), tmc_mirror(at, 2)};
        for (size_t k = i + 1; k < count; k++) {
            tmc_uv p;
            p.u = points[k].u;
            p.v = points[k].v;
            for (int c = 0; c < 4; c++) gap[k] = fmin(gap[k], tmc_uv_dist2(copies[c], p));
        }
    }
}

TRIMESH_COVER_API txm_status trimesh_order_patch(trimesh_point *points, size_t count, txm_env *env) {
    txm_arena arena;
    if (count > 16384) return txm_fail(env, TXM_TOO_LARGE, "more than 16384 points to order");
    if (count == 0) return TXM_OK;
    if (!points) return txm_fail(env, TXM_BAD_ARGUMENT, "points is NULL");
    for (size_t i = 0; i < count; i++) {
        const txm_status status = tmc_check_point(&points[i], 0, i, env);
        if (status != TXM_OK) return status;
    }
    if (tmc_report(env, 0, "order") != TXM_OK) return TXM_CANCELLED;
    txm_arena_init(&arena, env);
    double *gap = (double *)txm_arena_alloc(&arena, count, sizeof(double));
    const txm_status status = tmc_check_memory(&arena, env);
    if (status == TXM_OK) tmc_order(points, count, gap);
    txm_arena_free(&arena);
    return status;
}

/* Repulsion inside a triangle: `fixed` points on its sides, the others move. */
typedef struct tmc_swarm {
    int fixed, count;       /* points                                                     */
    int all;                /* including the images near the sides                        */
    double radius, margin;  /* of influence; least weight of a corner for those that move */
    tmc_uv *at, *to;        /* room for 4 per point                                       */
    int *head, *next;       /* which points lie in a cell: a list each                    */
    int cells;              /* a side; cell (0, 0) begins at (-1/2, -1/2)                 */
} tmc_swarm;

static int tmc_cell(const tmc_swarm *s, double x) {
    return txm_clampi((int)((x + 0.5) * 0.5 * s->cells), 0, s->cells - 1);
}

static void tmc_fill_cells(tmc_swarm *s) {
    s->all = s->count;
    for (int i = s->fixed; i < s->count; i++) {
        for (int k = 0; k < 3; k++) {
            const tmc_uv image = tmc_mirror(s->at[i], k);
            if (!(tmc_uv_dist2(image, s->at[i]) < 4 * s->radius * s->radius)) continue;
            TXM_ASSERT(s->all < 4 * s->count); /* itself and three images */
            s->at[s->all++] = image;
        }
    }
    for (int c = 0; c < s->cells * s->cells; c++) s->head[c] = -1;
    for (int i = 0; i < s->all; i++) {
        int *head = &s->head[s->cells * tmc_cell(s, s->at[i].v) + tmc_cell(s, s->at[i].u)];
        s->next[i] = *head;
        *head = i;
    }
}

/* pos_new = pos + sum over the others (r - d) f direction [1, equation 3.1]. The thesis has f =
   1/2; as all points move at once they then oscillate, and pairs of them stay together: the least
   distances are 0.02 to 0.17 steps, and 0.7 to 0.8 with our two numbers. */
static tmc_uv tmc_push(const tmc_swarm *s, int i) {
    const tmc_uv p = s->at[i];
    const int column = tmc_cell(s, p.u), row = tmc_cell(s, p.v);
    tmc_uv to = p;
    for (int c = 0; c < 9; c++) {
        const int x = column + c % 3 - 1, y = row + c / 3 - 1;
        if (x < 0 || y < 0 || x >= s->cells || y >= s->cells) continue;
        for (int j = s->head[s->cells * y + x]; j >= 0; j = s->next[j]) {
            const double d = sqrt(tmc_uv_dist2(p, s->at[j]));
            if (d >= s->radius || !(d > 0)) continue;
            to.u += TMC_FORCE * (s->radius - d) * (p.u - s->at[j].u) / d;
            to.v += TMC_FORCE * (s->radius - d) * (p.v - s->at[j].v) / d;
        }
    }
    const double least = fmin(fmin(to.u, to.v), 1 - to.u - to.v), third = 1.0 / 3;
    if (least < s->margin) { /* back towards the middle, until it is inside */
        const double share = (third - s->margin) / (third - least);
        to.u = third + (to.u - third) * share;
        to.v = third + (to.v - third) * share;
    }
    return to;
}

static void tmc_swarm_start(tmc_swarm *s, int steps, int hexagonal, uint64_t seed) {
    txm_rng rng = txm_rng_make(seed, 0x7061746368u);
    int n = 0;
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < steps; i++) {
            const double t = (double)i / steps;
            TXM_ASSERT(n < s->count);
            s->at[n].u = k == 0 ? t : k == 1 ? 1 - t : 0;
            s->at[n++].v = k == 0 ? 0 : k == 1 ? t : 1 - t;
        }
    }
    for (int j = 1; j < steps && hexagonal; j++) {
        for (int i = 1; i + j < steps; i++) {
            TXM_ASSERT(n < s->count);
            s->at[n].u = (double)i / steps;
            s->at[n++].v = (double)j / steps;
        }
    }
    while (n < s->count) {
        double u = txm_rng_double(&rng), v = txm_rng_double(&rng);
        if (u + v > 1) {
            u = 1 - u;
            v = 1 - v;
        }
        if (u < s->margin || v < s->margin || 1 - u - v < s->margin) continue;
        s->at[n].u = u;
        s->at[n++].v = v;
    }
}

static txm_status tmc_swarm_run(tmc_swarm *s, int rounds, txm_env *env) {
    for (int r = 0; r < rounds; r++) {
        const txm_status status = tmc_report(env, 0.8 * r / rounds, "repulsion");
        if (status != TXM_OK) return status;
        tmc_fill_cells(s);
        for (int i = s->fixed; i < s->count; i++) s->to[i] = tmc_push(s, i);
        for (int i = s->fixed; i < s->count; i++) s->at[i] = s->to[i];
    }
    return tmc_report(env, 0.8, "order");
}

TRIMESH_COVER_API txm_status trimesh_reference_patch(const trimesh_patch_desc *desc, txm_env *env,
                                               trimesh_point *points, size_t capacity,
                                               size_t *count) {
    trimesh_patch_desc none;
    txm_arena arena;
    tmc_swarm s;
    memset(&none, 0, sizeof none);
    if (!desc) desc = &none;
    const int wanted = desc->points ? desc->points : 32;
    const int rounds = desc->iterations ? desc->iterations : 100;
    if (wanted < 1 || wanted > 4096)
        return txm_fail(env, TXM_BAD_ARGUMENT, "points must be 1 to 4096");
    if (rounds < 1 || rounds > 1000)
        return txm_fail(env, TXM_BAD_ARGUMENT, "iterations must be 1 to 1000");
    if (!count) return txm_fail(env, TXM_BAD_ARGUMENT, "count is NULL");
    /* of a side's points half count, of the corners a sixth: wanted = inside + 3 (m - 1) / 2 + 1/2 */
    const int steps = (int)(sqrt(2.0 * wanted) + 0.5);
    const int loose =
        desc->hexagonal ? (steps - 1) * (steps - 2) / 2 : (2 * wanted + 3 - 3 * steps) / 2;
    memset(&s, 0, sizeof s);
    s.fixed = 3 * steps;
    s.count = s.fixed + (loose > 0 ? loose : 0);
    *count = (size_t)s.count;
    if (!points) return TXM_OK;
    if (capacity < *count)
        return txm_fail_numbers(env, TXM_TOO_LARGE, "# points, but there is room for # only",
                                *count, capacity);
    s.radius = TMC_RADIUS / steps;
    s.margin = 0.25 / steps;
    /* a cell spans at least 2 radius / sqrt(3) of u and of v */
    s.cells = txm_clampi((int)(2 * TMC_H / s.radius), 1, 1024);
    txm_arena_init(&arena, env);
    s.at = (tmc_uv *)txm_arena_alloc(&arena, *count, 4 * sizeof(tmc_uv));
    s.to = (tmc_uv *)txm_arena_alloc(&arena, *count, sizeof(tmc_uv));
    s.next = (int *)txm_arena_alloc(&arena, *count, 4 * sizeof(int));
    s.head = (int *)txm_arena_alloc(&arena, (size_t)s.cells * (size_t)s.cells, sizeof(int));
    double *gap = (double *)txm_arena_alloc(&arena, *count, sizeof(double));
    txm_status status = tmc_check_memory(&arena, env);
    if (status == TXM_OK) {
        tmc_swarm_start(&s, steps, desc->hexagonal, desc->seed);
        status = tmc_swarm_run(&s, desc->hexagonal ? 0 : rounds, env);
    }
    if (status == TXM_OK) {
        memset(points, 0, *count * sizeof *points);
        for (size_t i = 0; i < *count; i++) {
            points[i].u = txm_float(s.at[i].u);
            points[i].v = txm_float(s.at[i].v);
        }
        tmc_order(points, *count, gap);
    }
    txm_arena_free(&arena);
    return status;
}

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
