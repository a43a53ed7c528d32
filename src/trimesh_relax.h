/* trimesh_relax.h - v0.2.0 - any surface as near-equilateral triangles
   SPDX-License-Identifier: MIT OR Unlicense                   (full text: end of file)

   WHAT IT DOES
     Takes a triangle mesh of any shape and quality and covers the same surface with a given number
     of vertices whose triangles are as equilateral and equal as the surface allows: a closed or
     bordered manifold of the same topology, with creases, borders and (if given) seams preserved.
     Such triangles are easy to texture: see trimesh_cover.h.

   QUICK START                                 (tests build and run this very block)
     // Cover a tetrahedron-like pebble with 500 vertices. cc -std=c99 quick.c -lm
     #define TRIMESH_RELAX_IMPLEMENTATION     // in exactly one .c or .cpp file
     #include "trimesh_relax.h"               // texmath.h must lie beside it
     #include <stdio.h>

     int main(void) {
         static const float positions[] = {1, 1, 1, -1, -1, 1, -1, 1, -1, 1, -1, -1};
         static const uint32_t indices[] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
         static trimesh_desc desc;            // static: all zero, which means the defaults
         static txm_env env;                  // malloc, silent, serial; receives the message
         trimesh_mesh *mesh;
         desc.surface.positions = positions;
         desc.surface.indices = indices;
         desc.surface.vertex_count = 4;
         desc.surface.face_count = 4;
         desc.vertices = 500;
         if (trimesh_retile(&desc, &env, &mesh) != TXM_OK) {
             fprintf(stderr, "retile: %s\n", env.message);
             return 1;
         }
         printf("%lu vertices, %lu triangles, edges of %.3f\n", (unsigned long)mesh->vertex_count,
                (unsigned long)mesh->triangle_count, mesh->edge_length);
         trimesh_mesh_free(mesh);
         return 0;
     }

   HOW IT WORKS
     The input is repaired (welded, consistently oriented; duplicate and degenerate triangles are
     removed, sheets that share an edge are separated, one-sided ones cut, T-junctions stitched), creases and borders become lines, each border loop is closed by a ghost vertex.
     The working mesh starts as a copy of the surface and is a closed manifold at every moment: it is
     only split, collapsed (under the link condition) and flipped, so its topology cannot change.
       TRIMESH_LATTICE (default): the copy is resampled to about twice the number of vertices; a
     six-fold direction field and triangular lattice points are found on a hierarchy [3]; edges whose
     ends share a lattice point collapse. Dislocations, pairs of vertices of valence five and seven, are
     moved by local steps until they cancel or their surroundings get no better. From 20,000 vertices on this is done for a quarter of the
     number, and then each triangle is cut in four.
       TRIMESH_REPEL: the method of [1] and [2]: points sampled by area repel each other along the
     surface and replace the old vertices by mutual tessellation, which unlike the greedy
     triangulation of [1] cannot fail. For viewers, and for surfaces that are edited (trimesh_update).
       Then with both methods the mesh is relaxed (each triangle pulls its corners towards the best
     fitting equilateral triangle of the target size) and flipped [4], brought to the exact number of
     vertices, and fitted: a vertex moves off the surface by the mean height of the surface over its
     triangles, which keeps the volume. Last, crossing and inverted triangles are searched for and
     smoothed away; an invalid result is never returned, unless the surface crosses itself.

   CONFIGURATION   (define before the include that has _IMPLEMENTATION)
     TRIMESH_RELAX_STATIC   every function static to the including file (set it everywhere)
     TRIMESH_MAX_VERTICES   refuse more vertices or triangles; default 2^26
     TRIMESH_ASSERT(x)      checks for errors in the library, which no input can trigger; default
                            assert of <assert.h>

   MEMORY     About 200 bytes per input vertex and 600 per output vertex while working; the result
              takes 60 bytes per vertex. After an error nothing stays allocated, *mesh is NULL.
   THREADS    No global state; calls with different env may overlap. Relaxation and projection run
              on the environment's parallel-for.
   SAME BYTES The same result for any number of threads and on every machine with IEEE arithmetic:
              sums are taken in double in a fixed order, angles come from texmath.h.

   LIMITS
     Uniform triangles cannot show detail that is finer than they are: ears thinner than an edge are
     smoothed; volume_change of the mesh says what that costs. Where that would leave crossings, edges
     become shorter there, or the call says that it needs more vertices. A surface that crosses or
     touches itself is accepted; its result may cross itself, too.
     Creases sharper than 120 degrees stay creases, so two triangles nearly face each other there.
     The number of vertices is exact; edge lengths follow from it.
     Positions are floats, which hold some seven digits: from a mesh that lies farther from the origin
     than 16 times its size, as those in map coordinates do, take an origin away in double first.

   REFERENCES
     [1] M. Glinzner. Texturing of 3D objects using simple physics and equilateral triangle patches.
         Bachelor's thesis, TU Wien, 2016.
     [2] G. Turk. Generating textures on arbitrary surfaces using reaction-diffusion. SIGGRAPH 1991;
         Re-tiling polygonal surfaces. SIGGRAPH 1992.
     [3] W. Jakob, M. Tarini, D. Panozzo, O. Sorkine-Hornung. Instant field-aligned meshes.
         SIGGRAPH Asia 2015.
     [4] M. Botsch, L. Kobbelt. A remeshing approach to multiresolution modeling. SGP 2004.     */
#ifndef TRIMESH_RELAX_H
#define TRIMESH_RELAX_H

#include "texmath.h"

#define TRIMESH_RELAX_VERSION "0.2.0"

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
    TRIMESH_CREASE = 1, /* on a crease line or a seam        */
    TRIMESH_BORDER = 2, /* on the border                     */
    TRIMESH_CORNER = 3  /* where lines meet, end or bend: never moves */
} trimesh_kind;

/* A finished mesh; read only, released by trimesh_mesh_free. Triangles are counter-clockwise seen from
   outside. Every vertex is used. */
typedef struct trimesh_mesh {
    size_t vertex_count, triangle_count;
    float *positions;        /* 3 per vertex                                               */
    float *normals;          /* 3 per vertex, unit: of the input surface, smooth           */
    uint32_t *indices;       /* 3 per triangle                                             */
    txm_mesh_place *sources; /* 1 per vertex: where it lies on the input                    */
    uint8_t *kinds;          /* 1 per vertex: a trimesh_kind                               */
    int32_t *old_vertices;   /* of trimesh_update: 1 per vertex, which one of the old mesh it was,
                                -1 = new; else NULL                                        */
    double edge_length;      /* the target length, in units of the input                   */
    double volume_change;    /* the volume inside relative to the input's, minus 1: clearly below 0
                                where parts are thinner than an edge; 0 for surfaces with a border */
    txm_arena memory;        /* private                                                    */
} trimesh_mesh;

/* ---- what was found and repaired in the input -------------------------------------------- */

typedef struct trimesh_report {
    size_t vertices, triangles; /* after the repair                                          */
    size_t welded;              /* vertices merged with another in the same place            */
    size_t unused;              /* vertices without triangles                                */
    size_t degenerate;          /* triangles without area, removed or flipped                */
    size_t duplicate;           /* triangles with the vertices of another                    */
    size_t fins;                /* triangles that stuck out of an edge of two others         */
    size_t overfull;            /* edges of more than two triangles, which were joined in pairs */
    size_t opened;              /* triangles left over at such edges, where they have a border */
    size_t turned;              /* triangles reversed to agree with their neighbours         */
    size_t cut;                 /* edges cut because the surface was one-sided (Moebius)     */
    size_t closed;              /* of the welded: vertices on borders that were only close   */
    size_t stitched;            /* vertices put into sides of triangles on which they lay    */
    size_t split;               /* vertices added where fans met in one vertex               */
    size_t dropped;             /* pieces dropped: below drop_below, or crumbs               */
    double dropped_area;        /* and their part of the area, 0..1                          */
    size_t components;          /* connected pieces                                          */
    size_t loops;               /* border loops                                              */
    long euler;                 /* vertices - edges + triangles after the repair             */
    size_t crease_edges;        /* edges kept as creases                                     */
    size_t seam_edges;          /* edges kept as seams, some of which may be creases, too    */
} trimesh_report;

/* ---- retiling ---------------------------------------------------------------------------- */

typedef enum trimesh_method {
    TRIMESH_LATTICE = 0, /* points from a lattice that follows the surface: most regular     */
    TRIMESH_REPEL = 1    /* points sampled by area that repel each other, as in [1] and [2]; if
                            that leaves crossings, the lattice instead                       */
} trimesh_method;

typedef struct trimesh_desc {
    txm_mesh surface; /* triangles; not modified, need not outlive the call (a job's must)    */
    size_t vertices;       /* how many the result has, 4 or more                                */
    trimesh_method method; /* 0 = lattice                                                       */
    const float *scale;    /* 1 per input vertex: target edge length relative to other vertices,
                              above 0, at most 1000 times the smallest; NULL = uniform          */
    float adapt;           /* 0..1: how much shorter edges are where the surface bends; 0 = no
                              adaptation                                                        */
    float crease_angle;    /* smallest angle between the normals of two triangles, in degrees, at
                              which their edge may be a crease; 0 = 50; 180 = none. Below 75 it
                              must also be clearly sharper than the edges around it; between
                              flats 0.6 of the angle is enough. Chamfers and fillets narrower than
                              an edge become one crease. Connected creases shorter than 6 percent of the diagonal are left out       */
    float line_spacing;    /* edge length along creases and borders relative to that inside,
                              0.25..4; 0 = 1. Increased where lines would take more than half of
                              the vertices                                                      */
    float weld;            /* weld vertices closer than this, relative to the diagonal of the
                              bounding box, at most 0.01. 0 = those in the same place, and on
                              borders those closer than 1e-5 and a tenth of the edges there.
                              Vertices as close to a border edge are put into it, which closes
                              T-junctions. -1 = none of this, also in the same place            */
    float drop_below;      /* drop connected pieces of less than this part of the area, 0..1, except
                              the largest. Without it, too, crumbs are dropped: pieces that are
                              worth less than four vertices, if they took more than 5 percent of
                              the vertices beyond their share and are less than 10 percent of
                              the area                                                          */
    int iterations;        /* TRIMESH_REPEL: maximum rounds of repulsion, 1..1000; 0 = 40       */
    uint64_t seed;         /* another seed gives another result                                 */
    const uint32_t *seams; /* 3 per triangle, one for each corner, any numbers, such as the indices
                              of an OBJ file's texture coordinates: where two triangles meet in an
                              edge and have different numbers at one of its ends, that edge is part
                              of a seam, which the result's edges follow as they follow creases; but
                              the surface is smooth there. Connected seams shorter than 3 edges of
                              the result are left out, and so are those of one edge around the
                              pole of a globe. NULL = none                                     */
    trimesh_report *report; /* out: receives what was found in the input, also after an error;
                              NULL = no report                                                  */
} trimesh_desc;

/* Retile a surface.

   desc    see there
   mesh    receives the mesh, or NULL on any error; release it with trimesh_mesh_free
   return  TXM_OK; TXM_BAD_ARGUMENT for a field outside its range, an index that is not below
           vertex_count, a position that is not finite; TXM_TOO_SMALL if the surface cannot be
           covered with so few vertices (the message names a number that is enough: up to four
           were tried for it, which takes as long as the call with them); TXM_TOO_LARGE;
           TXM_OUT_OF_MEMORY; TXM_CANCELLED                                                      */
TRIMESH_API txm_status trimesh_retile(const trimesh_desc *desc, txm_env *env, trimesh_mesh **mesh);

/* A view of a result as a mesh of texmath.h, without a copy of its arrays: for trimesh_cover.h. */
TRIMESH_API txm_mesh trimesh_as_view(const trimesh_mesh *mesh);

/* Release a mesh; NULL is allowed. */
TRIMESH_API void trimesh_mesh_free(trimesh_mesh *mesh);

/* ---- retiling step by step ----------------------------------------------------------------- */

/* A retiling in progress, for viewers that show it and programs that do other work in between.
   trimesh_retile is trimesh_begin, trimesh_step while there is more, trimesh_get_mesh,
   trimesh_free. */
typedef struct trimesh_job trimesh_job;

/* Check the descriptor and repair the surface.

   desc    what it points to must stay unchanged until the job is released, except for the struct
           itself and the report
   job     receives the job, or NULL on any error; release it with trimesh_free
   return  as trimesh_retile                                                                   */
TRIMESH_API txm_status trimesh_begin(const trimesh_desc *desc, txm_env *env, trimesh_job **job);

/* Do the next part of the work: with TRIMESH_REPEL sample the points, join them, one round of
   repulsion, ..., finish. Does nothing once the job is done.

   env    for hooks and message of this call; the allocator stays that of trimesh_begin
   more   receives 0 when nothing is left to do, also after an error; NULL is allowed
   return TXM_OK; after anything else the job can only be released: every later call returns the
          same                                                                                 */
TRIMESH_API txm_status trimesh_step(trimesh_job *job, txm_env *env, int *more);

/* The state of a job. All pointers are valid until the next call for the job. */
typedef struct trimesh_state {
    const char *stage;       /* what the last step did: "mend", "sample", "join", "repel",
                                "lattice", "subdivide", "finish"                               */
    int round;               /* of repulsion, from 1; 0 = not begun                            */
    float mean, largest;     /* movement of the points in the last round, in edge lengths      */
    size_t points;           /* 0 before there are any, and after an error                     */
    const float *positions;  /* 3 per point, in the caller's units                             */
    size_t triangles;        /* 0 until points are joined                                      */
    const uint32_t *indices; /* 3 per triangle, of points                                      */
} trimesh_state;

/* What a viewer shows between two steps. Allocates the arrays of the state.

   return  TXM_OK; TXM_OUT_OF_MEMORY: the state is then all zero, and the job can continue      */
TRIMESH_API txm_status trimesh_get_state(trimesh_job *job, txm_env *env, trimesh_state *state);

/* The mesh of a job that is done. Each call makes a new copy.

   mesh    receives the mesh, or NULL on any error; release it with trimesh_mesh_free; it does not
           depend on the job
   return  TXM_OK; TXM_BAD_ARGUMENT if the job is not done; TXM_OUT_OF_MEMORY; if a step has failed,
           the status that it returned                                                         */
TRIMESH_API txm_status trimesh_get_mesh(trimesh_job *job, txm_env *env, trimesh_mesh **mesh);

/* Release a job, done or not; NULL is allowed. */
TRIMESH_API void trimesh_free(trimesh_job *job);

/* ---- after the surface has changed --------------------------------------------------------- */

typedef struct trimesh_update_desc {
    trimesh_desc desc; /* of the new surface. vertices: 0 = at the density of the old mesh. scale,
                          adapt, crease_angle, ... as for the old one; method is ignored         */
    float radius;      /* how far from the change vertices may move, in edge lengths, 1..1000;
                          0 = 4                                                                */
    float tolerance;   /* how far off the new surface an old vertex may lie, in edge lengths,
                          0..0.5; 0 = 0.2. Smaller changes of the surface go unnoticed. Fitted
                          vertices lie up to about 0.1 off the surface where it bends           */
} trimesh_update_desc;

/* Retile a surface that was edited or cut, starting from the mesh made before: old vertices that lie
   on the new surface stay, new ones are added where there are none (at a seam, on faces of a cut),
   and all vertices within a radius of the new ones are relaxed [1, chapter 6: splitting objects].

            old            cut            updated             A: far ones, bit for bit where they
         .--+--+--.     .--+--+ .      .--+--+-.                 were, with the same triangles
        /  /\ /\ / \   /  /\ / |      /  /\ / \|             B: old ones within the radius, which
        A-----------B  A-------|      A---B--B-N                 may move a little
        \  \/ \/ \ /   \  \/ \ |      \  \/ \ /|             N: new ones
         '--+--+--'     '--+--+'       '--+--+-'

   A vertex stays if its distance to the new surface is at most the tolerance and its normal differs
   by at most 45 degrees. A vertex on a crease or border stays only if it is a corner again or lies on
   a line of the same kind. Vertices too close to the points of a new line are removed.

   old     a result for the surface before the change
   mesh    receives the mesh, or NULL on any error; its old_vertices say which vertex of old each
           one was
   return  as trimesh_retile, except that desc.vertices may be 0
   cost    O((old + surface) log), as retiling with TRIMESH_REPEL without the repulsion          */
TRIMESH_API txm_status trimesh_update(const trimesh_mesh *old, const trimesh_update_desc *desc,
                                      txm_env *env, trimesh_mesh **mesh);

#ifdef __cplusplus
}
#endif
#endif /* TRIMESH_RELAX_H */

#if defined(TRIMESH_RELAX_IMPLEMENTATION) && !defined(TRIMESH_RELAX_IMPLEMENTED)
#define TRIMESH_RELAX_IMPLEMENTED

#include "trimesh_relax/config.h"
#include "trimesh_relax/surface.h"
#include "trimesh_relax/mend.h"
#include "trimesh_relax/mend_pairs.h"
#include "trimesh_relax/mend_turn.h"
#include "trimesh_relax/mend_gaps.h"
#include "trimesh_relax/mend_thin.h"
#include "trimesh_relax/mend_doubles.h"
#include "trimesh_relax/mend_all.h"
#include "trimesh_relax/seams.h"
#include "trimesh_relax/bands.h"
#include "trimesh_relax/creases.h"
#include "trimesh_relax/density.h"
#include "trimesh_relax/pieces.h"
#include "trimesh_relax/mesh.h"
#include "trimesh_relax/place.h"
#include "trimesh_relax/work.h"
#include "trimesh_relax/ridges.h"
#include "trimesh_relax/relax.h"
#include "trimesh_relax/collapse.h"
#include "trimesh_relax/renumber.h"
#include "trimesh_relax/fields.h"
#include "trimesh_relax/count.h"
#include "trimesh_relax/trial.h"
#include "trimesh_relax/defects.h"
#include "trimesh_relax/slivers.h"
#include "trimesh_relax/subdivide.h"
#include "trimesh_relax/validity.h"
#include "trimesh_relax/join.h"
#include "trimesh_relax/repel.h"
#include "trimesh_relax/retile.h"
#include "trimesh_relax/finer.h"
#include "trimesh_relax/job.h"
#include "trimesh_relax/update.h"
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
