/* trimesh_relax.h - v0.1.0 - any surface as near-equilateral triangles, and textures on them
   SPDX-License-Identifier: MIT OR Unlicense                   (full text: end of file)

   WHAT IT DOES
     Takes a triangle mesh of any shape and quality and covers the same surface with a given number
     of vertices whose triangles are as equilateral and equal as the surface allows: a closed or
     bordered manifold of the same topology, creases and borders kept. On such triangles textures
     are easy: it lays triangular patches and edge-matching tiles, carries UVs and colours over, and
     places things (lipids, scales, blades) on every triangle for instanced drawing.

   QUICK START                                 (tests build and run this very block)
     // Cover a tetrahedron-like pebble with 500 vertices. cc -std=c99 quick.c -lm
     #define TRIMESH_RELAX_IMPLEMENTATION     // in exactly one .c or .cpp file
     #include "trimesh_relax.h"               // texmath.h must lie beside it
     #include <stdio.h>

     int main(void) {
         static const float positions[] = {1, 1, 1, -1, -1, 1, -1, 1, -1, 1, -1, -1};
         static const uint32_t indices[] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
         trimesh_desc desc = {0};             // zero = the default, for every field
         trimesh_mesh *mesh;
         txm_env env = {0};                   // malloc, silent, serial; receives the message
         desc.surface.positions = positions;
         desc.surface.indices = indices;
         desc.surface.vertex_count = 4;
         desc.surface.face_count = 4;
         desc.vertices = 500;
         if (trimesh_retile(&desc, &env, NULL, &mesh) != TXM_OK) {
             fprintf(stderr, "retile: %s\n", env.message);
             return 1;
         }
         printf("%lu vertices, %lu triangles, edges of %.3f\n", (unsigned long)mesh->vertex_count,
                (unsigned long)mesh->triangle_count, mesh->edge_length);
         trimesh_free(mesh);
         return 0;
     }

   HOW IT WORKS
     The input is mended (welded, wound alike, freed of double and empty triangles), creases and
     borders become lines, each border loop is closed by a ghost vertex. The mesh that changes starts
     as a copy of the surface and is a closed manifold at every moment: it is only ever split,
     collapsed (under the link condition) and flipped, so that its topology cannot go wrong.
       TRIMESH_LATTICE (default): the copy is brought to about twice the number of vertices; a
     six-fold direction field and triangular lattice points are found on a hierarchy [4]; edges whose
     ends share a lattice point collapse. From 20,000 vertices on this is done at a quarter of the
     number and each triangle cut in four.
       TRIMESH_REPEL: the method of [1] and [2]: points strewn by area repel each other along the
     surface, and replace the old vertices by mutual tessellation, which cannot fail where [1]'s
     greedy triangulation can. For viewers, and for surfaces that are edited (trimesh_update).
       Then both are relaxed - each triangle pulls its corners towards the equilateral triangle
     that fits it best, of the wanted size - flipped, brought to the exact number, and fitted: a
     vertex moves off the surface by the mean height of the surface over its triangles, so that
     volume is kept. At last crossings and turned triangles are looked for and smoothed away; a
     result that is not sound is never handed out.

   CONFIGURATION   (define before the include that has _IMPLEMENTATION)
     TRIMESH_RELAX_STATIC         every function static to the including file (set it everywhere)
     TRIMESH_MAX_VERTICES   refuse more vertices or triangles; default 2^26
     TRIMESH_ASSERT(x)      programming errors inside the library, no input can reach one; default
                            assert of <assert.h>

   MEMORY     About 200 bytes per input vertex and 600 per output vertex while working; the result
              takes 60 bytes per vertex. After an error nothing stays allocated, *out is NULL.
   THREADS    No global state; calls with different env may overlap. Relaxation, projection and
              placing run on the environment's parallel-for.
   SAME BYTES The same result for any number of threads. Sums are taken in double in a fixed order
              and no libm function but sqrt takes part in decisions, except that normals are
              weighted by angles (atan2).

   LIMITS
     Uniform triangles cannot show what is finer than they are: ears thinner than an edge are
     smoothed, and where that would leave crossings the edges there become shorter, or the call says
     that it needs more vertices. A surface that crosses itself is accepted and may do so in the
     result. Creases sharper than 120 degrees stay creases, so two triangles nearly face each other
     there. The number of vertices is exact; edge lengths follow from it.

   REFERENCES
     [1] M. Glinzner. Texturing of 3D objects using simple physics and equilateral triangle patches.
         Bachelor's thesis, TU Wien, 2016.
     [2] G. Turk. Generating textures on arbitrary surfaces using reaction-diffusion. SIGGRAPH 1991;
         Re-tiling polygonal surfaces. SIGGRAPH 1992.
     [3] F. Neyret, M.-P. Cani. Pattern-based texturing revisited. SIGGRAPH 1999.
     [4] W. Jakob, M. Tarini, D. Panozzo, O. Sorkine-Hornung. Instant field-aligned meshes.
         SIGGRAPH Asia 2015.
     [5] M. Botsch, L. Kobbelt. A remeshing approach to multiresolution modeling. SGP 2004.
     [6] N. Max. Weights for computing vertex normals from facet normals. J. Graphics Tools 4(2), 1999.
     [7] T. Boubekeur, M. Alexa. Phong tessellation. SIGGRAPH Asia 2008.
     [8] D. Matula, L. Beck. Smallest-last ordering and clustering and graph coloring algorithms.
         J. ACM 30(3), 1983.                                                                      */
#ifndef TRIMESH_RELAX_H
#define TRIMESH_RELAX_H

#include "texmath.h"

#define TRIMESH_RELAX_VERSION "0.1.0"

#ifdef TRIMESH_RELAX_STATIC
#define TRIMESH_API static
#else
#define TRIMESH_API extern
#endif

/* Inputs and outputs of more vertices or triangles are refused. */
#ifndef TRIMESH_MAX_VERTICES
#define TRIMESH_MAX_VERTICES (1 << 26)
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* ---- meshes ----------------------------------------------------------------------------- */

/* What keeps a vertex from moving freely. */
typedef enum trimesh_kind {
    TRIMESH_FREE = 0,   /* anywhere on the surface           */
    TRIMESH_CREASE = 1, /* on a crease line                  */
    TRIMESH_BORDER = 2, /* on the border                     */
    TRIMESH_CORNER = 3  /* where lines meet, end or turn: never moves */
} trimesh_kind;

/* A finished mesh; read only, released by trimesh_free. Triangles are counter-clockwise seen from
   outside. Every vertex is used. */
typedef struct trimesh_mesh {
    size_t vertex_count, triangle_count;
    float *positions;        /* 3 per vertex                                               */
    float *normals;          /* 3 per vertex, unit: of the input surface, smooth           */
    uint32_t *indices;       /* 3 per triangle                                             */
    txm_mesh_place *sources; /* 1 per vertex: where it lies on the input                    */
    uint8_t *kinds;          /* 1 per vertex: a trimesh_kind                               */
    double edge_length;      /* that was aimed at, in units of the input                   */
    txm_arena memory;        /* where all this lies                                        */
} trimesh_mesh;

/* ---- what was found and mended in the input ---------------------------------------------- */

typedef struct trimesh_report {
    size_t vertices, triangles; /* after mending                                             */
    size_t welded;              /* vertices that another one lies on                         */
    size_t unused;              /* vertices of no triangle                                   */
    size_t degenerate;          /* triangles without area taken away or flipped away         */
    size_t duplicate;           /* triangles that were there before                          */
    size_t fins;                /* triangles that stuck out of an edge of two others         */
    size_t turned;              /* triangles turned to agree with their neighbours           */
    size_t split;               /* vertices added where fans met in one vertex               */
    size_t components;          /* connected pieces                                          */
    size_t loops;               /* border loops                                              */
    long euler;                 /* vertices - edges + triangles of what is left              */
    size_t crease_edges;        /* edges kept as creases                                     */
    uint32_t bad_edge[2];       /* out, after TXM_BAD_DATA: the edge that cannot be mended   */
} trimesh_report;

/* ---- retiling ---------------------------------------------------------------------------- */

typedef enum trimesh_method {
    TRIMESH_LATTICE = 0, /* points from a lattice that follows the surface: most regular     */
    TRIMESH_REPEL = 1    /* points strewn by area that repel each other, as in [1] and [2]; where
                            that gives crossings, the lattice after all                      */
} trimesh_method;

typedef struct trimesh_desc {
    txm_mesh surface; /* triangles; not modified, need not outlive the call (a job's must)    */
    size_t vertices;       /* how many the result has, 4 or more                                */
    trimesh_method method; /* 0 = lattice                                                       */
    const float *scale;    /* 1 per input vertex: wanted edge length relative to the others,
                              above 0, at most 1000 times the least; NULL = uniform             */
    float adapt;           /* 0..1: how much shorter edges are where the surface bends; 0 = not */
    float crease_angle;    /* degrees between the normals of two triangles from which on their
                              edge may be a crease, 0 = 50; 180 = none. Below 75 it must also
                              stand out from the edges around, and creases that hang together
                              to less than 6 percent of the diagonal are left out              */
    float line_spacing;    /* edge length along creases and borders relative to that inside,
                              0.25..4; 0 = 1. More, where they would take over half of the
                              vertices                                                          */
    float weld;            /* weld vertices nearer than this, relative to the diagonal of the
                              bounding box, 0..0.01; 0 = only those in equal places             */
    int iterations;        /* TRIMESH_REPEL: at most so many rounds of repulsion, 1..1000; 0 = 40 */
    uint64_t seed;         /* another number, another result                                    */
} trimesh_desc;

/* Retile a surface.

   desc    see there
   report  receives what was found in the input, also after an error; NULL = not wanted
   out     receives the mesh, or NULL on any error
   return  TXM_OK; TXM_BAD_ARGUMENT for a field outside its range; TXM_BAD_DATA for a surface that
           cannot be mended (message and report name the first bad edge); TXM_TOO_SMALL if the
           surface cannot be covered with so few vertices (the message says how many are needed);
           TXM_TOO_LARGE; TXM_OUT_OF_MEMORY; TXM_CANCELLED                                       */
TRIMESH_API txm_status trimesh_retile(const trimesh_desc *desc, txm_env *env,
                                      trimesh_report *report, trimesh_mesh **out);

/* Release a mesh; NULL is allowed. */
TRIMESH_API void trimesh_free(trimesh_mesh *mesh);

/* ---- retiling step by step ----------------------------------------------------------------- */

/* A retiling under way, for viewers that show it and programs that have other things to do in
   between. trimesh_retile is trimesh_begin, trimesh_step until done, trimesh_end. */
typedef struct trimesh_job trimesh_job;

/* How far a job is. All pointers are valid until the next call for the job. */
typedef struct trimesh_state {
    const char *stage;       /* what the last step did: "mend", "strew", "join", "repel", "lattice",
                                "subdivide", "finish"                                          */
    int round;               /* of repulsion, from 1; 0 before                                 */
    float fraction;          /* 0..1 of the whole, never falling                               */
    int done;                /* non-zero: call trimesh_end, there are no more steps            */
    float mean, largest;     /* movement of the points in the last round, in edge lengths      */
    size_t points;           /* 0 before there are any                                         */
    const float *positions;  /* 3 per point, in the caller's units                             */
    size_t triangles;        /* 0 until points are joined                                      */
    const uint32_t *indices; /* 3 per triangle, of points                                      */
} trimesh_state;

/* Check the descriptor and mend the surface.

   desc    what it points to must stay as it is until the job is gone, the struct itself need not
   report  as in trimesh_retile
   job     receives the job, or NULL on any error; release it with trimesh_end or trimesh_job_free
   return  as trimesh_retile                                                                   */
TRIMESH_API txm_status trimesh_begin(const trimesh_desc *desc, txm_env *env,
                                     trimesh_report *report, trimesh_job **job);

/* Do the next piece: with TRIMESH_REPEL strew the points, join them, one round of repulsion, ...,
   finish. Does nothing once the job is done.

   env    for hooks and message of this call; the allocator stays that of trimesh_begin
   state  receives how far the job is, also after an error (then without points); NULL = not wanted,
          which saves making the arrays
   return TXM_OK; after anything else the job can only be released: every later call returns the
          same                                                                                 */
TRIMESH_API txm_status trimesh_step(trimesh_job *job, txm_env *env, trimesh_state *state);

/* Do what is left, hand the mesh over and release the job, also after an error.

   out     receives the mesh, or NULL on any error                                             */
TRIMESH_API txm_status trimesh_end(trimesh_job *job, txm_env *env, trimesh_mesh **out);

/* Release a job without finishing it; NULL is allowed. */
TRIMESH_API void trimesh_job_free(trimesh_job *job);

/* ---- after the surface has changed --------------------------------------------------------- */

typedef struct trimesh_update_desc {
    trimesh_desc desc; /* of the new surface. vertices: 0 = at the density of the old mesh. scale,
                          adapt, crease_angle, ... as for the old one, method is not looked at   */
    float radius;      /* how far from the change vertices may move, in edge lengths, 1..1000;
                          0 = 4                                                                */
    float tolerance;   /* how far off the new surface an old vertex may lie, in edge lengths,
                          0..0.5; 0 = 0.2. Smaller changes of the surface go unnoticed; results
                          lie up to 0.1 or so off it where it bends, for the sake of the whole  */
} trimesh_update_desc;

/* Retile a surface that was edited or cut, from the mesh of what it was before: old vertices that
   lie on the new surface stay, where it has none (at a seam, on faces of a cut) new ones enter, and
   all within a radius of these relax [1, chapter 6: splitting objects].

            old            cut            updated             A: far ones, bit for bit where they
         .--+--+--.     .--+--+ .      .--+--+-.                 were, with the same triangles
        /  /\ /\ / \   /  /\ / |      /  /\ / \|             B: nearer than the radius, old ones
        A-----------B  A-------|      A---B--B-N                 that may move a little
        \  \/ \/ \ /   \  \/ \ |      \  \/ \ /|             N: new ones
         '--+--+--'     '--+--+'       '--+--+-'

   A vertex stays if its distance to the new surface is at most the tolerance and its normal agrees
   to 45 degrees; of vertices on creases and borders only corners and such as lie on a line of their
   kind again; none stays so near to a new line that it would crowd the points there.

   old     a result for the surface as it was
   out     receives the mesh, or NULL on any error
   map     NULL, or receives out->vertex_count numbers: which vertex of old each one was, -1 = new;
           they are released with the mesh
   return  as trimesh_retile, but for desc.vertices = 0
   cost    O((old + surface) log), as retiling with TRIMESH_REPEL without the repulsion          */
TRIMESH_API txm_status trimesh_update(const trimesh_mesh *old, const trimesh_update_desc *desc,
                                      txm_env *env, trimesh_report *report, trimesh_mesh **out,
                                      const int32_t **map);


/* ---- using a mesh: what goes for all functions below --------------------------------------- */

/* They take any triangle mesh as a txm_mesh, a result of trimesh_retile or your own: borders,
   several pieces, edges with more than two triangles and unequal winding are allowed, holes in the
   numbering too; two triangles are neighbours if they share two vertex numbers. Outputs are arrays
   of the caller's, of the size stated, untouched after an error unless said otherwise. Every call
   returns TXM_OK; TXM_BAD_ARGUMENT for a NULL, a field outside its range, an index that is not below
   vertex_count, a position that is not finite; TXM_TOO_LARGE above TRIMESH_MAX_VERTICES vertices
   or triangles; TXM_OUT_OF_MEMORY; TXM_CANCELLED; what else, it says. A mesh without triangles is
   allowed and gives nothing. Same arguments, same bytes, whatever the threads. */

/* A result as a view. */
TRIMESH_API txm_mesh trimesh_as_view(const trimesh_mesh *mesh);

/* Smooth unit normals of a mesh that has none, 3 floats per vertex; 0 0 0 at a vertex without
   triangles of an area above 0. Each triangle counts by sin(angle at the vertex) / (product of the
   two edges' lengths), which is exact on spheres [Max 1999]. O(triangles), 24 bytes per vertex. */
TRIMESH_API txm_status trimesh_normals(const txm_mesh *mesh, txm_env *env, float *normals);

/* ---- attributes: values of the input at the vertices of the result ------------------------- */

enum { TRIMESH_MAX_CHANNELS = 64 };

/* What is known at the vertices or corners of the input: texture coordinates, colours, weights. */
typedef struct trimesh_values {
    const float *values;     /* channels per entry, finite                                      */
    size_t count;            /* entries; without indices: vertex_count of the input             */
    const uint32_t *indices; /* 3 per triangle, which entry its corners have, as OBJ files have for
                                texture coordinates; NULL = the entry of the corner's vertex     */
    int channels;            /* floats per entry, 1..TRIMESH_MAX_CHANNELS                        */
} trimesh_values;

/* Values at points of the input: a + u (b - a) + v (c - a) of the three corners' values a, b, c.
   Right for what is continuous, colours and weights; for texture coordinates with seams there is
   the next function.

   input    as it was given to trimesh_retile (positions are not looked at)
   sources  count of them, a result's: mesh->sources and mesh->vertex_count
   out      channels floats per source
   cost     O(count)                                                                           */
TRIMESH_API txm_status trimesh_transfer(const txm_mesh *input, const trimesh_values *values,
                                        const txm_mesh_place *sources, size_t count, txm_env *env,
                                        float *out);

/* Values with seams (charts of texture coordinates) at the corners of a result's triangles, so that
   no triangle spans two charts. A seam is an edge of the input whose two triangles have other
   values there, or that has no or several triangles on its other side; vertices in equal places are
   one, so that meshes cut along their seams (glTF) do as well.

   Each triangle takes the chart of the input at its middle: from the source of its corner 0 a path
   leads there, over seams, in the plane through both that stands upright on the triangle. From the
   middle another such path leads to each corner, and ends where it meets a seam: a corner beyond
   takes the value at that place. So along a seam charts end up to a triangle early or late, as the
   triangles lie; nothing is ever interpolated across.

               chart 1    s   chart 2
               +----------s------+          m middle, in chart 1; s the seam
                \     m - s - > /           the corner at the right gets what chart 1 has
                 \        s    /            where the path meets s
                  \       s   /

   input    as it was given to trimesh_retile, sound enough: degenerate triangles only end paths
   mesh     the result (its indices; positions are not looked at)
   sources  1 per vertex of mesh
   out      channels floats per corner, 3 corners per triangle, in the order of mesh->indices
   cost     O(input) for the neighbours, then for each triangle of mesh as many steps as input
            triangles lie on its paths; 75 bytes per triangle of the input, 20 per vertex       */
TRIMESH_API txm_status trimesh_transfer_corners(const txm_mesh *input, const trimesh_values *values,
                                                const txm_mesh *mesh, const txm_mesh_place *sources,
                                                txm_env *env, float *out);

/* From values at corners to the vertex arrays of a renderer: a vertex whose corners differ is
   doubled, one copy for each different value (bits are compared, -0 equals 0). New vertices are in
   the order of the old ones; old ones without triangles are left out.

   mesh         indices and counts; positions are not looked at and may be NULL
   values       channels floats per corner
   new_indices  receives 3 per triangle, or NULL: count only
   corners      receives for each new vertex one of its corners, or NULL; room for 3 * triangle_count
                is always enough, *count of a first call exactly. With c = corners[i], new vertex i is
                a copy of vertex mesh->indices[c] with the value at values + channels * c.
   count        receives the number of new vertices
   cost         O(triangles), 60 bytes each                                                     */
TRIMESH_API txm_status trimesh_split_corners(const txm_mesh *mesh, const float *values,
                                             int channels, txm_env *env, uint32_t *new_indices,
                                             uint32_t *corners, size_t *count);

/* ---- texturing [1, section 3.4] ------------------------------------------------------------ */

/* The thesis's atlas: equilateral triangles side by side in one picture, each in a cell with a gutter
   around. With h = size sqrt(3) / 2, in pixels from the top left corner of the picture, corners
   0, 1, 2 of patch p lie at

       x = p pitch + gutter + (0, size, size / 2),   y = height - gutter - (0, 0, h)

              2          pitch  = size + 2 gutter
             / \         width  = count pitch
            / p \        height = ceil(h) + 2 gutter
           0 --- 1       texture coordinates: x / width, y / height, v downwards (glTF)        */
typedef struct trimesh_atlas {
    int count, size, gutter;  /* as asked for, defaults resolved */
    int pitch, width, height; /* pixels */
} trimesh_atlas;

/* Lay out an atlas. count 1..256, 0 = 4; size (pixels a side) 2..16384, 0 = 256; gutter (pixels)
   0..size, -1 = 8. */
TRIMESH_API txm_status trimesh_atlas_make(int count, int size, int gutter, txm_env *env,
                                          trimesh_atlas *atlas);

/* Texture coordinates u v of the corners 0, 1, 2 of one patch, or, with patch -1, of all: 6 floats
   each, what trimesh_place_tiles takes. 0 for a bad number. */
TRIMESH_API int trimesh_atlas_uv(const trimesh_atlas *atlas, int patch, float *uv);

typedef struct trimesh_choose_desc {
    int patches;   /* how many there are to choose from, 1..65536; 0 = 4                          */
    int rotations; /* 1: corner k always shows corner k; 3: also turned; 0 = 3                    */
    int repeat;    /* 0: neighbours differ in patch where they can, else in rotation; non-zero: all
                      at random, as in [1]                                                        */
    uint64_t seed; /* another number, another choice                                              */
} trimesh_choose_desc;

/* Choose a patch and a rotation for every triangle, at random.

   mesh       indices and counts; positions may be NULL
   desc       NULL = all defaults
   patches    receives 1 per triangle
   rotations  receives 1 per triangle: r = 0..2, corner k shows corner (k + r) mod 3 of the patch;
              may be NULL
   cost       O(triangles), 60 bytes each; with repeat: none                                     */
TRIMESH_API txm_status trimesh_choose(const txm_mesh *mesh, const trimesh_choose_desc *desc,
                                      txm_env *env, int *patches, int *rotations);

/* Texture coordinates of all corners from the tile and rotation of each triangle.

   tiles, rotations  1 per triangle, of trimesh_choose or of textiles_assign_triangles; rotations
                     NULL = all 0
   tile_uv           6 floats per tile, its corners 0, 1, 2: of trimesh_atlas_uv, or the first three
                     of textiles_place; tile_count tiles
   uv                receives 6 floats per triangle: corner k gets corner (k + rotation) mod 3 of the
                     tile. Double vertices by trimesh_split_corners with 2 channels.           */
TRIMESH_API txm_status trimesh_place_tiles(size_t triangle_count, const int *tiles,
                                           const int *rotations, const float *tile_uv,
                                           size_t tile_count, txm_env *env, float *uv);

/* For edge-matching tiles of any make: a colour for every edge, by hash of its two vertices and the
   seed, and a direction, from its lower to its higher vertex number. Side k of a triangle runs from
   corner k to corner (k + 1) mod 3. The same hash as textiles_assign_triangles begins with (which
   then recolours edges so that equal tiles do not meet).

   colors       how many, 1..65536
   edge_colors  receives 3 per triangle: 0..colors - 1, equal on both sides of an edge
   directions   receives 3 per triangle: +1 if the side runs along the edge's direction, -1 against
                it; may be NULL. The three of a triangle never run one way round.               */
TRIMESH_API txm_status trimesh_edge_colors(const txm_mesh *mesh, int colors, uint64_t seed,
                                           txm_env *env, int *edge_colors, int *directions);

/* A random colour 0..count - 1 for every vertex, as in [1] (with 3). count 1..65536; 0 = 3. */
TRIMESH_API txm_status trimesh_random_colors(size_t vertex_count, int count, uint64_t seed,
                                             txm_env *env, int *colors);

/* A colour for every vertex so that the ends of every edge differ: greedily, the vertex that had the
   fewest neighbours left when taken away coloured last-taken first (smallest-last order [Matula and
   Beck 1983]). At most 6 colours on surfaces of genus 0, mostly 4 or 5; 7 on a torus.

   colors  receives 1 per vertex, from 0; a vertex without triangles gets 0
   count   receives how many colours were used; may be NULL
   cost    O(triangles), 60 bytes each and 16 per vertex                                        */
TRIMESH_API txm_status trimesh_proper_colors(const txm_mesh *mesh, txm_env *env, int *colors,
                                             int *count);

/* ---- geometry on triangles ----------------------------------------------------------------- */

/* One thing on the reference triangle (0, 0), (1, 0), (1/2, sqrt(3)/2), at x = u + v / 2,
   y = v sqrt(3) / 2; z points away from the surface. Lengths are in edges of the triangle. */
typedef struct trimesh_point {
    float u, v;         /* 0 or more, u + v at most 1; exactly 0 or 1 on the sides              */
    float height;       /* over the surface, in edge lengths, -1000..1000                       */
    float scale;        /* size, in edge lengths, 0..1000; 0 = 1                                */
    float rotation[4];  /* quaternion x, y, z, w that turns the thing in the frame x, y, z of the
                           reference triangle, of any length; 0 0 0 0 = as it is                */
    uint32_t prototype; /* which thing, handed through                                          */
} trimesh_point;

/* What is put on a triangle. Where desc->density thins it, points are taken from the front of the
   list, so put them in an order in which every beginning is spread well (trimesh_order_patch).

   Points on the sides (within 10^-6 of an edge) belong to one triangle only: an edge to the first
   (lowest) of its triangles, a vertex to the first of its. So that edges have neither gaps nor
   doubles, have the same points on all three sides, at t and 1 - t alike, and all corners or none,
   in all patches of a call; then every edge and vertex of the mesh shows them once, whatever patches
   and rotations meet there. */
typedef struct trimesh_patch {
    const trimesh_point *points;
    size_t count; /* 0..2^20 */
} trimesh_patch;

/* A thing in space: place it by scaling, then turning, then moving. */
typedef struct trimesh_instance {
    float position[3];
    float rotation[4];  /* unit quaternion x, y, z, w: glTF's order; w >= 0                     */
    float scale;
    uint32_t prototype;
    uint32_t triangle;  /* on which it stands                                                   */
} trimesh_instance;

typedef struct trimesh_scatter_desc {
    txm_mesh mesh;
    const float *normals;         /* 3 per vertex, unit: a result's; NULL = trimesh_normals       */
    const trimesh_patch *patches; /* patch_count of them                                          */
    int patch_count;              /* 1..65536                                                     */
    const int *choices;           /* 1 per triangle: its patch; NULL = at random                  */
    const int *rotations;         /* 1 per triangle, 0..2: corner k of the triangle is corner
                                     (k + rotation) mod 3 of the patch; NULL = at random          */
    float unit;   /* length of an edge, for heights and scales: above 0, in units of the mesh; 0 =
                     each triangle's own, that of the equilateral triangle of its area            */
    float height; /* added to the height of every point, in edge lengths, -1000..1000             */
    int inside;   /* non-zero: the other side. Heights count against the normals, and things are
                     turned half round about their x axis, z against the normal                   */
    float curve;  /* 0..1: 0 = things stand on the flat triangles, 1 = on the curved surface that the
                     normals tell of (Phong tessellation with half its weight, which is what a sphere
                     needs); clamped to 1 edge                                                    */
    float density; /* things per unit of area at height `height` (on side `inside`): patches are
                     thinned for it, see below; 0 = all points of the patches on every triangle   */
    int spin;      /* non-zero: every thing is turned by a random angle about its own z axis      */
    const float *mix; /* shares, mix_count of them, 0 or more: prototypes 0..mix_count - 1 are drawn
                     at random in these proportions; NULL = the points' own                       */
    int mix_count;    /* 0..256                                                                   */
    uint64_t seed;    /* another number, other choices                                            */
} trimesh_scatter_desc;

/* Put a patch on every triangle of a mesh, and list what stands where.

   Position: the point (u, v) of the triangle (moved by curve), plus height times the unit normal
   interpolated there. Orientation: z along that normal, x along the direction of the patch's x axis
   on the triangle: of the affine map from the reference triangle the rotation nearest to it, made
   perpendicular to z. So frames go on smoothly across edges, up to the turn by a multiple of
   60 degrees. Scale: the point's times the edge length.

   With density, triangle t of area A(t) (its corners moved along their normals to the height) gets
   the beginning of its patch that comes nearest to density A(t) + e things, where e is the error
   left by the triangle before, in the order of a space-filling (Morton) curve; a point on a side
   counts 1/2, on a corner 1/6, as so many triangles share it. So counts are right in any region, to
   a thing or so per side of it. The patches need enough points for the largest triangle: a third
   more than for the mean do for meshes of trimesh_retile.

   out       receives *count instances, triangle by triangle in the patch's order; NULL: count only.
             After TXM_CANCELLED it may be filled in part
   capacity  how many instances out has room for
   count     receives how many there are, also after TXM_TOO_LARGE for want of room
   return    also TXM_TOO_SMALL: the patches have too few points for this density, the message says
             how many the largest triangle needs; TXM_TOO_LARGE: more than capacity or 2^31
   cost      O(triangles + instances), 0.1 to 0.2 us per instance; 36 bytes per triangle, 36 per
             vertex without normals; with points on the sides 50 more per triangle. The parallel-for
             hook spreads the triangles                                                         */
TRIMESH_API txm_status trimesh_scatter(const trimesh_scatter_desc *desc, txm_env *env,
                                       trimesh_instance *out, size_t capacity, size_t *count);

/* position + scale (point turned): where a point of the thing comes to lie. out may be point. */
TRIMESH_API void trimesh_instance_apply(const trimesh_instance *instance, const float point[3],
                                        float out[3]);

typedef struct trimesh_patch_desc {
    int points;      /* how many per triangle of a mesh, on average, 1..4096; 0 = 32              */
    int hexagonal;   /* non-zero: the triangular lattice with m steps along a side, m^2 / 2 points per
                        triangle, m = the nearest to sqrt(2 points); then rotations do not show   */
    int iterations;  /* rounds of repulsion, 1..1000; 0 = 100                                     */
    uint64_t seed;   /* another number, another patch; all with the same `points` go together     */
} trimesh_patch_desc;

/* Make a patch of evenly spread points, in an order for thinning. m + 1 points lie on each side, the
   corners included, at equal steps, m as above, so that all patches of the same `points` join
   without gaps in all rotations; those inside repel each other and these, with a force falling to
   zero at the radius of influence [1, equation 3.1]. Heights are 0, scales 1, prototypes 0.

   points    receives *count points; NULL: count only. points + 2 m + 2 is always room enough
   capacity  how many points it has room for
   return    also TXM_TOO_LARGE for want of room; count is right then
   cost      O(count^2 + iterations count), 0.1 s for 1000                                       */
TRIMESH_API txm_status trimesh_reference_patch(const trimesh_patch_desc *desc, txm_env *env,
                                               trimesh_point *points, size_t capacity,
                                               size_t *count);

/* Put the points of a patch of your own in an order for thinning: each next point the one furthest
   from those before, neighbouring triangles taken for mirror images. O(count^2); count up to 16384.
   8 bytes each. */
TRIMESH_API txm_status trimesh_order_patch(trimesh_point *points, size_t count, txm_env *env);

#ifdef __cplusplus
}
#endif
#endif /* TRIMESH_RELAX_H */

#if defined(TRIMESH_RELAX_IMPLEMENTATION) && !defined(TRIMESH_RELAX_IMPLEMENTED)
#define TRIMESH_RELAX_IMPLEMENTED

#include "trimesh_relax/config.h"
#include "trimesh_relax/surface.h"
#include "trimesh_relax/mend.h"
#include "trimesh_relax/mend_thin.h"
#include "trimesh_relax/mend_all.h"
#include "trimesh_relax/lines.h"
#include "trimesh_relax/mesh.h"
#include "trimesh_relax/place.h"
#include "trimesh_relax/work.h"
#include "trimesh_relax/relax.h"
#include "trimesh_relax/split.h"
#include "trimesh_relax/fields.h"
#include "trimesh_relax/count.h"
#include "trimesh_relax/subdivide.h"
#include "trimesh_relax/sound.h"
#include "trimesh_relax/join.h"
#include "trimesh_relax/repel.h"
#include "trimesh_relax/retile.h"
#include "trimesh_relax/job.h"
#include "trimesh_relax/update.h"
#include "trimesh_relax/check.h"
#include "trimesh_relax/attributes.h"
#include "trimesh_relax/texture.h"
#include "trimesh_relax/scatter.h"
#include "trimesh_relax/patch.h"
#endif /* TRIMESH_RELAX_IMPLEMENTATION */

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
