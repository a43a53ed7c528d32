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

/* ---- configuration ------------------------------------------------------------------ */

#include <stdio.h>

#ifndef TRIMESH_ASSERT
#include <assert.h>
#define TRIMESH_ASSERT(x) assert(x)
#endif

/* ---- memory ------------------------------------------------------------------------------- */

/* Have all requests to the arena been met? Functions ask for all they need, then look once. */
static txm_status tmr_check_memory(const txm_arena *arena) {
    return arena->failed ? TXM_OUT_OF_MEMORY : TXM_OK;
}

/* ---- corners ----------------------------------------------------------------------------- */

/* A mesh is two arrays over corners. Corner c of triangle c / 3 stands for its vertex and for the
   edge opposite to it, from the vertex of tmr_next(c) to that of tmr_prev(c). */
static int32_t tmr_next(int32_t c) {
    return c % 3 == 2 ? c - 2 : c + 1;
}
static int32_t tmr_prev(int32_t c) {
    return c % 3 == 0 ? c + 2 : c - 1;
}

/* ---- the input, mended ------------------------------------------------------------------- */

/* Kinds of edges. A seam may be a crease as well: then both bits are set. */
enum { TMR_PLAIN_EDGE = 0, TMR_CREASE_EDGE = 1, TMR_BORDER_EDGE = 2, TMR_SEAM_EDGE = 4 };

/* An oriented manifold, perhaps with borders; does not change while points move on it. Scaled so
   that the bounding box has its centre at 0 and a diagonal of 1. */
typedef struct tmr_surface {
    int32_t vertex_count, face_count;
    txm_dvec3 *point;       /* 1 per vertex                                                     */
    int32_t *vertex;        /* of each corner                                                   */
    int32_t *opposite;      /* corner on the other side of the corner's edge, -1 at the border  */
    txm_dvec3 *normal;      /* 1 per face, unit; of a face without area: that of its surroundings */
    txm_dvec3 *vertex_normal; /* 1 per vertex, unit, weighted by angles                           */
    int32_t *corner;        /* 1 per vertex: one of its corners; on the border the first one
                               counter-clockwise, so that walking on reaches all              */
    int32_t *component;     /* 1 per face, from 0                                               */
    int32_t component_count;
    int32_t loop_count;     /* border loops                                                     */
    int32_t border_count;   /* border edges: corners whose opposite is -1                       */
    int32_t *fan;           /* NULL, or 1 per vertex: where in spoke its fan begins, -1 = it is small */
    int32_t *spoke;         /* of each large fan the number of its corners, then they, counter-
                               clockwise: place.h                                              */
    uint32_t *origin;       /* 1 per face: the caller's triangle                                */
    uint8_t *turn;          /* 1 per face: how its corners map to the caller's: corner k is the
                               caller's corner (k + turn) % 3, or (turn - k + 3) % 3 with turn
                               - 4 for turn >= 4 (winding reversed)                             */
    float *scale;           /* 1 per vertex: wanted edge length, relative; NULL = uniform       */
    uint8_t *edge_kind;     /* 1 per corner: kind of the opposite edge; creases are found later */
    float *section;         /* NULL, or 1 per corner: of the strip that its edge stands for, its
                               cross-section, 0 = none: ridges.h                              */
    txm_dvec3 centre;       /* in the caller's units; caller's = point * diagonal + centre      */
    double diagonal;
    double area;            /* of all faces, in scaled units                                    */
    double volume;          /* inside, before strips were made lines: ridges.h                  */
} tmr_surface;
/* How to walk around a vertex, from corner c of it (surfaces are oriented, vertices have one fan):

          b ___              tmr_ccw(c): the corner of the same vertex v in the next triangle
          |\   ` .           counter-clockwise, which lies beyond the edge from v to b;
          | \     a          tmr_cw(c): in the next one clockwise, beyond the edge from v to a;
          |  \  c /          -1 where that edge is on the border.
          |   \  /
          |ccw \/ v          for (k = s->corner[v]; k >= 0;) { ...; k = tmr_ccw(s->opposite, k);
                                                               if (k == s->corner[v]) break; }

   A vertex on the border has one more neighbour than it has triangles: the a of its first corner
   s->corner[v], the b of every one. */
static int32_t tmr_ccw(const int32_t *opposite, int32_t c) {
    const int32_t o = opposite[tmr_next(c)];
    return o < 0 ? -1 : tmr_next(o);
}
static int32_t tmr_cw(const int32_t *opposite, int32_t c) {
    const int32_t o = opposite[tmr_prev(c)];
    return o < 0 ? -1 : tmr_prev(o);
}

/* What is done to the caller's triangles, in this order:

   vertices   scale to the unit box, weld, ignore unused ones
   faces      remove those with a vertex twice, and duplicates
   gaps       weld the borders that nearly meet, put vertices into the sides on which they lie
   edges      find opposites; where an edge has more than two faces remove fins and interior walls,
              and pair the others
   winding    orient faces consistently, and cut where the surface is one-sided
   area       flip caps and collapse needles; start again if faces were added or removed
   fans       one vertex for each, numbered
   measures   normals, components, border loops                                                 */

/* ---- mending: state and checks ------------------------------------------------------------ */

enum {
    TMR_MOST = 1 << 26, /* vertices and triangles of an input or a result                    */
    TMR_MOST_SLOTS = INT32_MAX / 3, /* vertices or triangles: int32_t numbers the corners        */
    TMR_NO_VERTEX = -1,   /* in the first corner of a triangle: to be removed                  */
    TMR_OVERFULL = -2,    /* as opposite: the edge has more than two triangles                 */
    TMR_MAPPED = 8,       /* as turn: corners do not match; use the nearest point of origin   */
    TMR_MEND_ROUNDS = 8,  /* ours: of flipping and collapsing; one or two are enough           */
    TMR_FLIP_SWEEPS = 64, /* ours: back and forth over the thin triangles; mostly three        */
    TMR_FAN_LIMIT = 256   /* ours: vertices of more triangles are left as they are             */
};

/* The input while it is mended. Vertices keep the caller's numbers to the end: no face refers to a
   vertex that was welded to another one, or to an unused one. */
typedef struct tmr_mend {
    const trimesh_desc *desc;
    txm_env *env;
    trimesh_report report;
    int32_t vertex_count, face_count;
    txm_dvec3 *point;  /* 1 per input vertex, scaled                                      */
    int32_t *rename;   /* 1 per input vertex: the vertex that replaces it                    */
    int32_t *degree;   /* 1 per input vertex: a count, used by each step                  */
    int32_t *stamp;    /* 1 per input vertex: marks neighbours                              */
    int32_t *vertex;   /* the next four as in tmr_surface, with room for the input        */
    int32_t *opposite;
    uint32_t *origin;
    uint8_t *turn;
    uint8_t *flag;     /* 1 per face, of the step at hand                                 */
    uint8_t *twin;     /* 1 per face: it had a duplicate of opposite winding              */
    int single;        /* non-zero: some face has no such duplicate                       */
    int32_t *list;     /* 1 per face, of the step at hand                                 */
    uint32_t *sides;   /* 1 per corner: the sides in the order of their edges; as much scratch */
    txm_arena *arena, *scratch; /* what the surface keeps; what is freed after mending   */
    int32_t *table;    /* hash table: index + 1, 0 = free                                 */
    size_t table_size; /* a power of two, at least twice the vertices and the faces       */
    txm_dvec3 centre;
    double diagonal;
    double noise; /* scaled units: resolution of single precision                   */
} tmr_mend;

static txm_status tmr_mend_cancel(tmr_mend *m, float fraction) {
    if (!txm_progress(m->env, fraction, "mend")) return TXM_OK;
    return txm_fail(m->env, TXM_CANCELLED, "cancelled while mending the surface");
}

static txm_status tmr_check_scale(const trimesh_desc *desc, txm_env *env) {
    const size_t count = desc->surface.vertex_count;
    double least = 0, most = 0;
    for (size_t i = 0; i < count; i++) {
        const double s = desc->scale[i];
        if (!txm_is_finite(s) || !(s > 0))
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                    "scale: of vertex # it must be finite and above 0", i, 0);
        if (i == 0 || s < least) least = s;
        if (i == 0 || s > most) most = s;
    }
    if (most > 1000 * least)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "scale: the largest is more than 1000 times the least");
    return TXM_OK;
}

/* Check all numbers of the input. */
static txm_status tmr_check_surface(const trimesh_desc *desc, txm_env *env) {
    if (!desc) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL; pass a trimesh_desc");
    const size_t limit = TRIMESH_MAX_VERTICES < TMR_MOST ? TRIMESH_MAX_VERTICES : TMR_MOST;
    const txm_status status = txm_mesh_check(&desc->surface, "surface", 3, 1, limit, env);
    if (status != TXM_OK) return status;
    if (desc->surface.vertex_count == 0 || desc->surface.face_count == 0)
        return txm_fail(env, TXM_TOO_SMALL, "surface: no vertices or no triangles");
    if (!(desc->weld >= 0 && desc->weld <= 0.01f) && !(desc->weld >= -1 && desc->weld <= -1))
        return txm_fail(env, TXM_BAD_ARGUMENT, "weld must be 0 to 0.01, or -1 for none");
    return desc->scale ? tmr_check_scale(desc, env) : TXM_OK;
}

/* Allocate what there is for each face and corner, with room for so many faces, and the table. What
   the surface keeps lies in m->arena, the rest in m->scratch. */
static txm_status tmr_mend_alloc_faces(tmr_mend *m, size_t faces) {
    const size_t v = (size_t)m->vertex_count;
    m->table_size = 16;
    while (m->table_size < 2 * (v > faces ? v : faces)) m->table_size *= 2;
    m->vertex = (int32_t *)txm_arena_alloc(m->arena, 3 * faces, sizeof(int32_t));
    m->opposite = (int32_t *)txm_arena_alloc(m->arena, 3 * faces, sizeof(int32_t));
    m->origin = (uint32_t *)txm_arena_alloc(m->arena, faces, sizeof(uint32_t));
    m->turn = (uint8_t *)txm_arena_zero(m->arena, faces, 1);
    m->flag = (uint8_t *)txm_arena_zero(m->scratch, 2 * faces, 1);
    m->list = (int32_t *)txm_arena_alloc(m->scratch, faces, sizeof(int32_t));
    m->sides = (uint32_t *)txm_arena_alloc(m->scratch, 6 * faces, sizeof(uint32_t));
    m->table = (int32_t *)txm_arena_alloc(m->scratch, m->table_size, sizeof(int32_t));
    if (m->arena->failed || m->scratch->failed)
        return txm_fail(m->env, TXM_OUT_OF_MEMORY, "no memory to mend the surface");
    m->twin = m->flag + faces;
    return TXM_OK;
}

/* Allocate all that the mending needs. */
static txm_status tmr_mend_alloc(tmr_mend *m) {
    const size_t v = (size_t)m->vertex_count;
    m->rename = (int32_t *)txm_arena_alloc(m->scratch, 3 * v, sizeof(int32_t));
    if (!m->rename) return txm_fail(m->env, TXM_OUT_OF_MEMORY, "no memory to mend the surface");
    m->degree = m->rename + v;
    m->stamp = m->degree + v;
    return tmr_mend_alloc_faces(m, (size_t)m->face_count);
}

/* ---- mending: vertices -------------------------------------------------------------------- */

/* Scale the used vertices; afterwards rename is -1 for the others. */
static txm_status tmr_mend_scale(tmr_mend *m) {
    const txm_mesh *in = &m->desc->surface;
    double low[3] = {0, 0, 0}, high[3] = {0, 0, 0}, largest = 0;
    for (int32_t i = 0; i < m->vertex_count; i++) m->rename[i] = -1;
    for (size_t i = 0; i < 3 * in->face_count; i++)
        m->rename[in->indices[i]] = (int32_t)in->indices[i];
    for (int k = 0; k < 3; k++)
        low[k] = high[k] = in->positions[3 * (size_t)in->indices[0] + (size_t)k];
    for (int32_t i = 0; i < m->vertex_count; i++) {
        m->report.unused += m->rename[i] < 0;
        for (int k = 0; k < 3 && m->rename[i] >= 0; k++) {
            const double x = in->positions[3 * (size_t)i + (size_t)k];
            if (x < low[k]) low[k] = x;
            if (x > high[k]) high[k] = x;
            if (fabs(x) > largest) largest = fabs(x);
        }
    }
    const txm_dvec3 size = txm_d3(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
    m->diagonal = txm_d3_len(size);
    m->centre =
        txm_d3(0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2]));
    if (!(m->diagonal > 0))
        return txm_fail(m->env, TXM_TOO_SMALL, "all vertices of the surface are in one place");
    m->noise = largest / m->diagonal * (1.0 / (1 << 23));
    for (int32_t i = 0; i < m->vertex_count; i++) {
        const float *p = in->positions + 3 * (size_t)i;
        m->point[i] = txm_d3((p[0] - m->centre.x) / m->diagonal, (p[1] - m->centre.y) / m->diagonal,
                             (p[2] - m->centre.z) / m->diagonal);
    }
    return TXM_OK;
}

static uint64_t tmr_hash_cell(txm_dvec3 cell) {
    uint64_t bits[3];
    cell = txm_d3_add(cell, txm_d3(0, 0, 0)); /* -0 to +0 */
    memcpy(&bits[0], &cell.x, sizeof bits[0]);
    memcpy(&bits[1], &cell.y, sizeof bits[1]);
    memcpy(&bits[2], &cell.z, sizeof bits[2]);
    return txm_hash(txm_hash(txm_hash(bits[0]) ^ bits[1]) ^ bits[2]);
}

static txm_dvec3 tmr_cell(txm_dvec3 p, double size) {
    return size > 0 ? txm_d3(floor(p.x / size), floor(p.y / size), floor(p.z / size)) : p;
}

/* The lowest vertex in a cell that is not farther than size from point i, or else best. reach: NULL,
   or 1 per vertex: not farther than this of both, either. */
static int32_t tmr_weld_find(const tmr_mend *m, txm_dvec3 cell, int32_t i, double size,
                             const double *reach, int32_t best) {
    size_t slot = (size_t)tmr_hash_cell(cell) & (m->table_size - 1);
    for (; m->table[slot]; slot = (slot + 1) & (m->table_size - 1)) {
        const int32_t j = m->table[slot] - 1;
        const double most = reach ? fmin(size, fmin(reach[i], reach[j])) : size;
        if ((best < 0 || j < best) && txm_d3_dist2(m->point[i], m->point[j]) <= most * most)
            best = j;
    }
    return best;
}

/* Each vertex, in order, is welded to the first kept vertex that is near enough, or else is kept.
   So chains of near vertices do not collapse into one, and a cell of the grid holds few kept
   vertices. With size 0 only vertices in equal places are welded. reach: as tmr_weld_find has it;
   vertices for which it is negative are left out. */
static void tmr_weld(tmr_mend *m, double size, const double *reach) {
    if (size < 1e-14) size = 0; /* so that a cell's number plus 1 is another number */
    const int range = size > 0 ? 1 : 0;
    memset(m->table, 0, m->table_size * sizeof *m->table);
    for (int32_t i = 0; i < m->vertex_count; i++) {
        if (m->rename[i] != i || (reach && reach[i] < 0)) continue;
        const txm_dvec3 cell = tmr_cell(m->point[i], size);
        int32_t best = -1;
        for (int x = -range; x <= range; x++) {
            for (int y = -range; y <= range; y++) {
                for (int z = -range; z <= range; z++)
                    best = tmr_weld_find(m, txm_d3_add(cell, txm_d3(x, y, z)), i, size, reach,
                                         best);
            }
        }
        if (best >= 0) {
            m->rename[i] = best;
            m->report.welded++;
            continue;
        }
        size_t slot = (size_t)tmr_hash_cell(cell) & (m->table_size - 1);
        while (m->table[slot]) slot = (slot + 1) & (m->table_size - 1);
        m->table[slot] = i + 1;
    }
}

/* ---- mending: faces ----------------------------------------------------------------------- */

static void tmr_mend_load(tmr_mend *m) {
    const uint32_t *indices = m->desc->surface.indices;
    for (int32_t c = 0; c < 3 * m->face_count; c++) m->vertex[c] = m->rename[indices[c]];
    for (int32_t f = 0; f < m->face_count; f++) m->origin[f] = (uint32_t)f;
}

/* Remove the faces that are marked with TMR_NO_VERTEX or have a vertex twice; count the latter. */
static void tmr_mend_compact(tmr_mend *m) {
    int32_t n = 0;
    for (int32_t f = 0; f < m->face_count; f++) {
        const int32_t *v = m->vertex + 3 * f;
        if (v[0] == TMR_NO_VERTEX) continue;
        if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) {
            m->report.degenerate++;
            continue;
        }
        memmove(m->vertex + 3 * n, v, 3 * sizeof *v);
        m->origin[n] = m->origin[f];
        m->turn[n] = m->turn[f];
        m->twin[n++] = m->twin[f];
    }
    m->face_count = n;
}

/* 0: other vertices; 1: the same, in the same winding; -1: in the opposite winding */
static int tmr_same_face(const int32_t *a, const int32_t *b) {
    for (int k = 0; k < 3; k++) {
        if (a[0] != b[k]) continue;
        if (a[1] == b[(k + 1) % 3] && a[2] == b[(k + 2) % 3]) return 1;
        if (a[2] == b[(k + 1) % 3] && a[1] == b[(k + 2) % 3]) return -1;
    }
    return 0;
}

/* Of faces with the same three vertices keep the first; note whether another had opposite
   winding. */
static void tmr_mend_duplicates(tmr_mend *m) {
    const size_t mask = m->table_size - 1;
    memset(m->table, 0, m->table_size * sizeof *m->table);
    for (int32_t f = 0; f < m->face_count; f++) {
        const int32_t *v = m->vertex + 3 * f;
        /* a sum, which does not depend on their order */
        size_t slot = (size_t)(txm_hash((uint64_t)v[0] + 1) + txm_hash((uint64_t)v[1] + 1) +
                               txm_hash((uint64_t)v[2] + 1)) & mask;
        int same = 0;
        for (; m->table[slot]; slot = (slot + 1) & mask) {
            same = tmr_same_face(m->vertex + 3 * (m->table[slot] - 1), v);
            if (same) break;
        }
        if (!same) {
            m->table[slot] = f + 1;
            continue;
        }
        if (same < 0) m->twin[m->table[slot] - 1] = 1;
        m->report.duplicate++;
        m->vertex[3 * f] = TMR_NO_VERTEX;
    }
    tmr_mend_compact(m);
}

/* ---- mending: edges ----------------------------------------------------------------------- */

/* The faces as they are now. */
static txm_mesh tmr_mend_mesh(const tmr_mend *m) {
    txm_mesh mesh;
    memset(&mesh, 0, sizeof mesh);
    mesh.indices = (const uint32_t *)m->vertex;
    mesh.vertex_count = (size_t)m->vertex_count;
    mesh.face_count = (size_t)m->face_count;
    return mesh;
}

/* the corner opposite to the side that is the i-th in the order of the edges */
static int32_t tmr_opposite_corner(const tmr_mend *m, int32_t i) {
    return tmr_prev((int32_t)m->sides[i]);
}

/* The end of the run of sides of one edge that begins at i. */
static int32_t tmr_run_end(const tmr_mend *m, int32_t i) {
    const txm_mesh mesh = tmr_mend_mesh(m);
    return (int32_t)txm_mesh_edge_end(&mesh, m->sides, (size_t)i);
}

/* Find the opposites. Returns how many edges have more than two faces. */
static int32_t tmr_mend_opposites(tmr_mend *m) {
    const txm_mesh mesh = tmr_mend_mesh(m);
    int32_t overfull = 0;
    txm_mesh_sort_sides(&mesh, m->sides);
    for (int32_t i = 0, end; i < 3 * m->face_count; i = end) {
        const int32_t c = tmr_opposite_corner(m, i);
        end = tmr_run_end(m, i);
        if (end == i + 1) m->opposite[c] = -1;
        else if (end == i + 2) {
            m->opposite[c] = tmr_opposite_corner(m, i + 1);
            m->opposite[m->opposite[c]] = c;
        } else {
            for (int32_t k = i; k < end; k++) m->opposite[tmr_opposite_corner(m, k)] = TMR_OVERFULL;
            overfull++;
        }
    }
    return overfull;
}

/* Has the triangle no area, as far as single precision can tell? */
static int tmr_is_thin(const tmr_mend *m, const txm_dvec3 p[3]) {
    double longest = 0;
    for (int k = 0; k < 3; k++) longest = fmax(longest, txm_d3_dist2(p[k], p[(k + 1) % 3]));
    longest = sqrt(longest);
    const double height = longest > 0 ? txm_d3_len(txm_d3_area2(p[0], p[1], p[2])) / longest : 0;
    /* a height within rounding errors counts only if the triangle is slim as well */
    return height <= 1e-6 * longest || (height <= m->noise && height <= 1e-3 * longest);
}
static void tmr_face_points(const tmr_mend *m, int32_t f, txm_dvec3 p[3]) {
    for (int k = 0; k < 3; k++) p[k] = m->point[m->vertex[3 * f + k]];
}
static int tmr_face_is_thin(const tmr_mend *m, int32_t f) {
    txm_dvec3 p[3];
    tmr_face_points(m, f, p);
    return tmr_is_thin(m, p);
}

/* A fin is attached at the edge of its corner c only: its other two edges are borders. */
static int tmr_is_fin(const tmr_mend *m, int32_t c, int thin_only) {
    return m->opposite[tmr_next(c)] == -1 && m->opposite[tmr_prev(c)] == -1 &&
           (!thin_only || tmr_face_is_thin(m, c / 3));
}

/* Mark the fins of a run if two or more faces remain; if not, try only those without area. */
static int tmr_cut_fins(tmr_mend *m, int32_t begin, int32_t end) {
    for (int thin_only = 0; thin_only < 2; thin_only++) {
        int32_t fins = 0;
        for (int32_t k = begin; k < end; k++)
            fins += tmr_is_fin(m, tmr_opposite_corner(m, k), thin_only);
        if (fins == 0 || end - begin - fins < 2) continue;
        for (int32_t k = begin; k < end; k++) {
            const int32_t c = tmr_opposite_corner(m, k);
            if (tmr_is_fin(m, c, thin_only)) m->flag[c / 3] = 1;
        }
        return 1;
    }
    return 0;
}

/* An interior wall of two faces back to back, of which the first step kept one, is removed where it
   meets two faces of the outside, or only other walls; so is all of the wall that is connected to
   it. (If all faces of the input were double, they are the outside.) */
static int tmr_cut_twins(tmr_mend *m, int32_t begin, int32_t end) {
    int32_t twins = 0, top = 0;
    for (int32_t k = begin; k < end; k++) twins += m->twin[m->sides[k] / 3];
    const int32_t others = end - begin - twins;
    if (twins == 0 || !(others == 2 || (others == 0 && m->single))) return 0;
    for (int32_t k = begin; k < end; k++) {
        const int32_t f = (int32_t)m->sides[k] / 3;
        if (!m->twin[f] || m->flag[f]) continue;
        m->flag[f] = 1;
        m->list[top++] = f;
    }
    while (top > 0) {
        const int32_t f = m->list[--top];
        for (int32_t c = 3 * f; c < 3 * f + 3; c++) {
            const int32_t g = m->opposite[c] < 0 ? f : m->opposite[c] / 3;
            if (!m->twin[g] || m->flag[g]) continue;
            m->flag[g] = 1;
            TRIMESH_ASSERT(top < m->face_count);
            m->list[top++] = g;
        }
    }
    return 1;
}

static void tmr_clear_flags(tmr_mend *m) {
    for (int32_t f = 0; f < m->face_count; f++) m->flag[f] = 0;
}

/* Call `mend` for the edges with more than two faces. Returns how many of them it mended. */
static int32_t tmr_mend_overfull(tmr_mend *m, int (*mend)(tmr_mend *, int32_t, int32_t)) {
    int32_t mended = 0;
    for (int32_t i = 0, end; i < 3 * m->face_count; i = end) {
        end = tmr_run_end(m, i);
        if (end - i > 2) mended += mend(m, i, end);
    }
    return mended;
}

/* Remove the flagged faces. Returns how many. */
static size_t tmr_cut_flagged(tmr_mend *m) {
    size_t count = 0;
    for (int32_t f = 0; f < m->face_count; f++) {
        if (m->flag[f]) m->vertex[3 * f] = TMR_NO_VERTEX;
        count += m->flag[f];
    }
    tmr_mend_compact(m);
    return count;
}

/* ---- mending: edges of more than two faces ------------------------------------------------ */

/* At such an edge the faces are paired, and each pair is joined as if the others were not there, so
   that sheets that touch along the edge become separate. Of an odd number one face is left over: the
   edge is part of its border. Every edge can be mended that way; which faces go together matters
   only for the shape. */

/* A face at an edge, as a spoke of a wheel seen along the edge, which runs from its lower vertex to
   the higher. */
typedef struct tmr_spoke {
    double angle;   /* around the edge, radians                                               */
    int32_t corner; /* opposite to the edge                                                   */
    int32_t patch;  /* faces that are connected over edges of two faces have the same number  */
    int along;      /* the face winds along the edge, not against it                          */
    int paired;
} tmr_spoke;

typedef struct tmr_wheel {
    tmr_spoke *spoke; /* room for the faces of any edge */
    int32_t *patch;   /* 1 per face                     */
    size_t pairs, singles; /* edges whose faces were paired; faces left over */
} tmr_wheel;

enum { TMR_WHEEL = 64 }; /* ours: of more faces at an edge neighbours are paired, the best are not sought */
#define TMR_APART 1e-4   /* ours: radians between two sheets that are clearly apart                   */
#define TMR_ALIKE 0.1    /* ours: radians: pairs that bend alike; then the patches decide, so that the
                            same sheets are paired all along a line of such edges                    */

static int tmr_spoke_before(const tmr_spoke *a, const tmr_spoke *b, int by_patch) {
    if (by_patch && a->patch != b->patch) return a->patch < b->patch;
    if (!by_patch && (a->angle < b->angle || a->angle > b->angle)) return a->angle < b->angle;
    return a->corner < b->corner;
}

/* Sort as a heap: no two spokes are equal. */
static void tmr_sort_spokes(tmr_spoke *spoke, int32_t count, int by_patch) {
    for (int32_t end = count, start = count / 2; end > 1;) {
        if (start > 0) start--; /* build the heap first, then take the last one off */
        else {
            const tmr_spoke last = spoke[--end];
            spoke[end] = spoke[0];
            spoke[0] = last;
        }
        for (int32_t root = start, child; (child = 2 * root + 1) < end; root = child) {
            if (child + 1 < end && tmr_spoke_before(spoke + child, spoke + child + 1, by_patch))
                child++;
            if (!tmr_spoke_before(spoke + root, spoke + child, by_patch)) break;
            const tmr_spoke moved = spoke[root];
            spoke[root] = spoke[child];
            spoke[child] = moved;
        }
    }
}

/* The faces around the edge of the sides begin to end - 1, by rising angle. Returns 0 if one of them
   has no area, so that its angle says nothing. */
static int tmr_spokes_make(const tmr_mend *m, int32_t begin, int32_t end, tmr_wheel *wheel) {
    const txm_mesh mesh = tmr_mend_mesh(m);
    const int32_t low = (int32_t)txm_mesh_low(&mesh, m->sides[begin]);
    const int32_t high = (int32_t)txm_mesh_high(&mesh, m->sides[begin]);
    const txm_dvec3 e = txm_d3_unit(txm_d3_sub(m->point[high], m->point[low]));
    txm_dvec3 u = txm_d3(0, 0, 0), w = u;
    int is_clear = 1;
    for (int32_t k = 0; k < end - begin; k++) {
        tmr_spoke *s = wheel->spoke + k;
        const int32_t c = tmr_opposite_corner(m, begin + k);
        txm_dvec3 d = txm_d3_sub(m->point[m->vertex[c]], m->point[low]);
        d = txm_d3_mad(d, e, -txm_d3_dot(d, e));
        is_clear &= !tmr_face_is_thin(m, c / 3);
        if (!(txm_d3_len2(u) > 0)) {
            u = txm_d3_unit(d);
            w = txm_d3_cross(e, u);
        }
        s->angle = k ? txm_atan2(txm_d3_dot(d, w), txm_d3_dot(d, u)) : 0;
        s->corner = c;
        s->patch = wheel->patch[c / 3];
        s->along = m->vertex[tmr_next(c)] == low;
        s->paired = 0;
    }
    tmr_sort_spokes(wheel->spoke, end - begin, 0);
    return is_clear;
}

static void tmr_pair_spokes(tmr_mend *m, tmr_spoke *a, tmr_spoke *b) {
    a->paired = b->paired = 1;
    m->opposite[a->corner] = b->corner;
    m->opposite[b->corner] = a->corner;
}

/* Two or more sheets that touch along an edge, seen along it, angles rising clockwise: the faces have
   alternating winding. Those with the inside between them belong together:

            \  solid /           e is the edge from its lower vertex to the higher. The normal of a
         -   \      /  +         face that winds along e (+) points to rising angles, so the solid
              \    /             lies between it and the one before it, which must wind against
               \  /              e (-).
         +_____ e _____-
               solid                                                                            */
static int tmr_pair_solids(tmr_mend *m, tmr_spoke *spoke, int32_t count) {
    if (count % 2) return 0;
    for (int32_t k = 0; k < count; k++) { /* clearly apart, and alternating? */
        const int32_t next = (k + 1) % count;
        const double gap = spoke[next].angle - spoke[k].angle + (next ? 0 : 2 * TXM_PI);
        if (gap < TMR_APART || spoke[k].along == spoke[next].along) return 0;
    }
    for (int32_t k = 0; k < count; k++)
        if (spoke[k].along) tmr_pair_spokes(m, spoke + k, spoke + (k + count - 1) % count);
    return 1;
}

/* how much a sheet of these two faces would bend at the edge, 0..pi; more if one of them had to be
   reversed for that */
static double tmr_spoke_bend(const tmr_spoke *a, const tmr_spoke *b) {
    const double apart = fabs(a->angle - b->angle);
    return TXM_PI - fmin(apart, 2 * TXM_PI - apart) + (a->along == b->along ? 2 * TXM_PI : 0);
}

/* Pair the faces of which a sheet bends least, again and again. */
static void tmr_pair_straightest(tmr_mend *m, tmr_spoke *spoke, int32_t count) {
    tmr_sort_spokes(spoke, count, 1);
    for (int32_t left = count; left > 1; left -= 2) {
        int32_t a = -1, b = -1;
        double least = 0;
        for (int32_t i = 0; i < count; i++) {
            for (int32_t j = i + 1; j < count && !spoke[i].paired; j++) {
                const double bend = tmr_spoke_bend(spoke + i, spoke + j);
                if (spoke[j].paired || (a >= 0 && bend > least - TMR_ALIKE)) continue;
                least = bend;
                a = i;
                b = j;
            }
        }
        tmr_pair_spokes(m, spoke + a, spoke + b);
    }
}

/* Pair neighbours by angle: those of different winding as brackets are paired, then the others. */
static void tmr_pair_neighbors(tmr_mend *m, tmr_spoke *spoke, int32_t count) {
    for (int pass = 0; pass < 2; pass++) {
        int32_t open = -1; /* the last one without a partner; m->list: the one before it */
        for (int32_t k = 0; k < count; k++) {
            if (spoke[k].paired) continue;
            if (open >= 0 && (pass || spoke[open].along != spoke[k].along)) {
                tmr_pair_spokes(m, spoke + open, spoke + k);
                open = m->list[open];
            } else {
                m->list[k] = open;
                open = k;
            }
        }
    }
}

/* Pair the faces of the edge of the sides begin to end - 1. */
static void tmr_pair_edge(tmr_mend *m, int32_t begin, int32_t end, tmr_wheel *wheel) {
    const int32_t count = end - begin;
    const int is_clear = tmr_spokes_make(m, begin, end, wheel);
    if (!is_clear || !tmr_pair_solids(m, wheel->spoke, count)) {
        if (count <= TMR_WHEEL) tmr_pair_straightest(m, wheel->spoke, count);
        else tmr_pair_neighbors(m, wheel->spoke, count);
    }
    for (int32_t k = 0; k < count; k++) {
        if (wheel->spoke[k].paired) continue;
        m->opposite[wheel->spoke[k].corner] = -1;
        wheel->singles++;
    }
    wheel->pairs++;
}

/* Number the patches of faces. */
static void tmr_find_patches(tmr_mend *m, int32_t *patch) {
    for (int32_t f = 0; f < m->face_count; f++) patch[f] = -1;
    for (int32_t f = 0; f < m->face_count; f++) {
        int32_t count = 0;
        if (patch[f] >= 0) continue;
        patch[f] = f;
        m->list[count++] = f;
        for (int32_t i = 0; i < count; i++) {
            for (int32_t c = 3 * m->list[i]; c < 3 * m->list[i] + 3; c++) {
                const int32_t o = m->opposite[c];
                if (o < 0 || patch[o / 3] >= 0) continue;
                patch[o / 3] = f;
                m->list[count++] = o / 3;
            }
        }
    }
}

/* Pair the faces of all edges that have more than two. */
static txm_status tmr_mend_pairs(tmr_mend *m) {
    int32_t longest = 0;
    tmr_wheel wheel;
    memset(&wheel, 0, sizeof wheel);
    for (int32_t i = 0, end; i < 3 * m->face_count; i = end) {
        end = tmr_run_end(m, i);
        if (end - i > longest) longest = end - i;
    }
    wheel.spoke = (tmr_spoke *)txm_arena_alloc(m->scratch, (size_t)longest, sizeof(tmr_spoke));
    wheel.patch = (int32_t *)txm_arena_alloc(m->scratch, (size_t)m->face_count, sizeof(int32_t));
    if (m->scratch->failed)
        return txm_fail(m->env, TXM_OUT_OF_MEMORY, "no memory to mend the surface");
    tmr_find_patches(m, wheel.patch);
    for (int32_t i = 0, end; i < 3 * m->face_count; i = end) {
        end = tmr_run_end(m, i);
        if (end - i > 2) tmr_pair_edge(m, i, end, &wheel);
    }
    m->report.overfull = wheel.pairs;
    m->report.opened = wheel.singles;
    return TXM_OK;
}

/* Find the opposites, mending edges until each has at most two faces. */
static txm_status tmr_mend_edges(tmr_mend *m) {
    m->report.overfull = m->report.opened = 0;
    for (int round = 0; tmr_mend_opposites(m) > 0; round++) {
        tmr_clear_flags(m);
        for (int32_t f = 0; f < m->face_count; f++) m->single |= !m->twin[f];
        if (round == TMR_MEND_ROUNDS) return tmr_mend_pairs(m);
        if (tmr_mend_overfull(m, tmr_cut_fins)) m->report.fins += tmr_cut_flagged(m);
        else if (tmr_mend_overfull(m, tmr_cut_twins)) m->report.duplicate += tmr_cut_flagged(m);
        else return tmr_mend_pairs(m);
    }
    return TXM_OK;
}

/* ---- mending: orientation ----------------------------------------------------------------- */

/* Does the face beyond the edge of corner c have the same winding? */
static int tmr_winds_alike(const tmr_mend *m, int32_t c) {
    return m->vertex[tmr_next(c)] == m->vertex[tmr_prev(m->opposite[c])];
}

/* List the component of face first in m->list, and flag its faces: 1 = stays, 2 = to be reversed.
   Edges whose faces have different winding are crossed only where no other is left, so that a
   surface that cannot be oriented is cut there. Returns how many faces. */
static int32_t tmr_flag_windings(tmr_mend *m, int32_t first) {
    uint32_t *later = m->sides + 3 * m->face_count; /* 1 per corner at most: each is looked at once */
    int32_t count = 0, done = 0, waiting = 0, next = 0;
    m->flag[first] = 1;
    m->list[count++] = first;
    for (;;) {
        if (done < count) {
            const int32_t f = m->list[done++];
            for (int32_t c = 3 * f; c < 3 * f + 3; c++) {
                const int32_t o = m->opposite[c];
                if (o < 0 || m->flag[o / 3]) continue;
                if (!tmr_winds_alike(m, c)) {
                    TRIMESH_ASSERT(waiting < 3 * m->face_count);
                    later[waiting++] = (uint32_t)c;
                    continue;
                }
                m->flag[o / 3] = m->flag[f];
                m->list[count++] = o / 3;
            }
        } else if (next < waiting) {
            const int32_t c = (int32_t)later[next++], g = m->opposite[c] / 3;
            if (m->flag[g]) continue;
            m->flag[g] = (uint8_t)(3 - m->flag[c / 3]);
            m->list[count++] = g;
        } else return count;
    }
}

/* Would the faces at the edge of corner c still have different winding? */
static int tmr_is_twisted(const tmr_mend *m, int32_t c) {
    const int32_t o = m->opposite[c];
    return o >= 0 && tmr_winds_alike(m, c) != (m->flag[c / 3] == m->flag[o / 3]);
}

/* The other way round, would face f have shorter twisted edges? */
static int tmr_untwists(const tmr_mend *m, int32_t f) {
    double gain = 0, all = 0;
    for (int32_t c = 3 * f; c < 3 * f + 3; c++) {
        const double length = m->opposite[c] < 0 ? 0
                                                 : txm_d3_dist(m->point[m->vertex[tmr_next(c)]],
                                                               m->point[m->vertex[tmr_prev(c)]]);
        gain += tmr_is_twisted(m, c) ? length : -length;
        all += length;
    }
    return gain > 1e-6 * all;
}

/* Cut the twisted edges of the count faces of m->list: lines from border to border, or loops, as
   around each vertex they are even in number. First let them become shorter. */
static void tmr_cut_twisted(tmr_mend *m, int32_t count) {
    int turned = 1;
    for (int sweep = 0; turned && sweep < TMR_FLIP_SWEEPS; sweep++) {
        turned = 0;
        for (int32_t i = 0; i < count; i++) {
            if (!tmr_untwists(m, m->list[i])) continue;
            m->flag[m->list[i]] = (uint8_t)(3 - m->flag[m->list[i]]);
            turned = 1;
        }
    }
    for (int32_t i = 0; i < count; i++) {
        for (int32_t c = 3 * m->list[i]; c < 3 * m->list[i] + 3; c++) {
            if (!tmr_is_twisted(m, c)) continue;
            m->opposite[m->opposite[c]] = -1;
            m->opposite[c] = -1;
            m->report.cut++;
        }
    }
}

/* Flag the component of face first: 1 = stays, 2 = to be reversed, so that all of it has the
   winding of most of its area (if equal: of the first face). Cut it where it is one-sided. */
static void tmr_orient_component(tmr_mend *m, int32_t first) {
    double stays = 0, turns = 0; /* area */
    int twisted = 0;
    const int32_t count = tmr_flag_windings(m, first);
    for (int32_t i = 0; i < count; i++) {
        const int32_t f = m->list[i];
        txm_dvec3 p[3];
        tmr_face_points(m, f, p);
        const double area = txm_d3_len(txm_d3_area2(p[0], p[1], p[2]));
        if (m->flag[f] == 1) stays += area;
        else turns += area;
        for (int32_t c = 3 * f; c < 3 * f + 3; c++) twisted |= tmr_is_twisted(m, c);
    }
    if (twisted) tmr_cut_twisted(m, count);
    if (turns > stays * (1 + 1e-9)) { /* if equal up to rounding, the first face stays   */
        for (int32_t i = 0; i < count; i++)
            m->flag[m->list[i]] = (uint8_t)(3 - m->flag[m->list[i]]);
    }
}

/* Reverse the faces with flag 2: swap their corners 1 and 2. */
static void tmr_turn_flagged(tmr_mend *m) {
    for (int32_t f = 0; f < m->face_count; f++) {
        if (m->flag[f] != 2) continue;
        const int32_t c = 3 * f + 1, v = m->vertex[c], o = m->opposite[c];
        m->vertex[c] = m->vertex[c + 1];
        m->vertex[c + 1] = v;
        m->opposite[c] = m->opposite[c + 1];
        m->opposite[c + 1] = o;
        if (m->turn[f] != TMR_MAPPED) m->turn[f] ^= 4;
    }
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        const int32_t o = m->opposite[c];
        if (o >= 0 && m->flag[o / 3] == 2 && o % 3) m->opposite[c] = 6 * (o / 3) + 3 - o;
    }
}

static void tmr_mend_orient(tmr_mend *m) {
    tmr_clear_flags(m);
    m->report.cut = 0;
    for (int32_t f = 0; f < m->face_count; f++)
        if (!m->flag[f]) tmr_orient_component(m, f);
    tmr_turn_flagged(m);
}

/* Faces without duplicates, at most two at an edge, consistently oriented. */
static txm_status tmr_mend_faces(tmr_mend *m) {
    tmr_mend_compact(m);
    tmr_mend_duplicates(m);
    txm_status status = tmr_mend_cancel(m, 0.02f);
    if (status == TXM_OK) status = tmr_mend_edges(m);
    if (status == TXM_OK && m->face_count == 0)
        status = txm_fail(m->env, TXM_TOO_SMALL, "the surface has no area");
    if (status == TXM_OK) tmr_mend_orient(m);
    return status;
}

/* ---- mending: gaps between borders -------------------------------------------------------- */

/* Borders that run along each other but share no edges leave gaps, mostly too narrow to see:

        a-----------b            a-----------b       T-junction: v lies on the side of another face,
        |           |            |  .     .  |       which is split there
        |           |            | .       . |
        a-----v-----b    ->      a-----v-----b
        |     |     |            |     |     |
        +-----+-----+            +-----+-----+

   First vertices on borders that are close are welded, then vertices on borders that are close to a
   border edge are put into it, if then a part of it is an edge of another face. */

#define TMR_CLOSE 1e-5      /* ours: how close, in diagonals                                     */
#define TMR_CLOSE_EDGES 0.1 /* ours: but no more than this part of the edges there               */
enum {
    TMR_LEAST_LEVEL = -40, /* edges shorter than 2^this diagonals are as those of that length  */
    TMR_CELLS_OF_EDGE = 8  /* an edge is no longer than a cell: two of them each way, at most  */
};

/* A vertex to be put into the edge opposite to a corner. */
typedef struct tmr_stitch {
    int32_t corner, vertex;
    int32_t next; /* the next one of that edge, farther along; -1 = none             */
    float along;  /* 0..1 from the vertex of the next corner to that of the previous one */
} tmr_stitch;

/* Border edges by the cells that they touch. Each level has cells of 2^level diagonals and the edges
   that are about as long, so that neither long nor short ones fill many cells or one. */
typedef struct tmr_gaps {
    double close;       /* how close, in diagonals */
    double *reach;      /* 1 per vertex: how close in view of the edges there; not on a border: -1 */
    txm_pair *cell;     /* by key; value: corner */
    size_t cell_count;
    uint64_t levels;    /* bit level - TMR_LEAST_LEVEL: there are such edges */
    tmr_stitch *stitch;
    size_t stitch_count;
    int32_t *first;     /* 1 per corner: the first stitch of its edge, -1 = none */
} tmr_gaps;

static int tmr_is_border(const tmr_mend *m, int32_t c) {
    return m->opposite[c] == -1;
}

static double tmr_edge_length(const tmr_mend *m, int32_t c) {
    return txm_d3_dist(m->point[m->vertex[tmr_next(c)]], m->point[m->vertex[tmr_prev(c)]]);
}

/* How far each vertex on a border may be from what it is joined with. Returns how many border edges
   there are. */
static size_t tmr_gaps_reach(const tmr_mend *m, tmr_gaps *g) {
    size_t count = 0;
    for (int32_t v = 0; v < m->vertex_count; v++) g->reach[v] = -1;
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        if (!tmr_is_border(m, c)) continue;
        g->reach[m->vertex[tmr_next(c)]] = g->reach[m->vertex[tmr_prev(c)]] = g->close;
        count++;
    }
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        const double length = tmr_edge_length(m, c), most = TMR_CLOSE_EDGES * length;
        if (length <= 2 * m->noise) continue; /* in the same place but for rounding */
        double *a = g->reach + m->vertex[tmr_next(c)], *b = g->reach + m->vertex[tmr_prev(c)];
        if (*a > most) *a = most;
        if (*b > most) *b = most;
    }
    return count;
}

/* ---- vertices on edges -------------------------------------------------------------------- */

static uint32_t tmr_gap_key(txm_dvec3 cell, int level) {
    return (uint32_t)(txm_hash(tmr_hash_cell(cell) + (uint64_t)(level - TMR_LEAST_LEVEL)) >> 32);
}

/* List the border edges, or count the entries where g->cell is NULL. */
static void tmr_gaps_fill(const tmr_mend *m, tmr_gaps *g) {
    g->cell_count = 0;
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        if (!tmr_is_border(m, c)) continue;
        const txm_dvec3 a = m->point[m->vertex[tmr_next(c)]], b = m->point[m->vertex[tmr_prev(c)]];
        const double more = g->close;
        int level = 0;
        frexp(txm_d3_dist(a, b) + 2 * more, &level); /* which is less than 2^level */
        if (level < TMR_LEAST_LEVEL) level = TMR_LEAST_LEVEL;
        const double size = ldexp(1, level);
        const txm_dvec3 low = tmr_cell(txm_d3(fmin(a.x, b.x) - more, fmin(a.y, b.y) - more,
                                              fmin(a.z, b.z) - more), size);
        const txm_dvec3 high = tmr_cell(txm_d3(fmax(a.x, b.x) + more, fmax(a.y, b.y) + more,
                                               fmax(a.z, b.z) + more), size);
        g->levels |= (uint64_t)1 << (level - TMR_LEAST_LEVEL);
        for (int k = 0; k < TMR_CELLS_OF_EDGE; k++) {
            const txm_dvec3 cell = txm_d3(low.x + (k & 1), low.y + (k >> 1 & 1), low.z + (k >> 2));
            if (cell.x > high.x || cell.y > high.y || cell.z > high.z) continue;
            if (g->cell) {
                g->cell[g->cell_count].key = tmr_gap_key(cell, level);
                g->cell[g->cell_count].value = (uint32_t)c;
            }
            g->cell_count++;
        }
    }
}

/* Does vertex v lie on the edge of corner c, between its ends? */
static int tmr_lies_on(const tmr_mend *m, const tmr_gaps *g, int32_t v, int32_t c, float *along) {
    const int32_t i = m->vertex[tmr_next(c)], j = m->vertex[tmr_prev(c)];
    if (v == i || v == j || v == m->vertex[c]) return 0;
    const txm_dvec3 a = m->point[i], ab = txm_d3_sub(m->point[j], a);
    const double length = txm_d3_len(ab), reach = fmin(g->reach[v], TMR_CLOSE_EDGES * length);
    const txm_dvec3 av = txm_d3_sub(m->point[v], a);
    const double t = length > 0 ? txm_d3_dot(av, ab) / length : 0;
    if (!(t > reach && t < length - reach)) return 0;
    *along = txm_float(t / length);
    return txm_d3_len2(txm_d3_mad(av, ab, -t / length)) <= reach * reach;
}

/* Find the vertices on edges. g->stitch NULL: only count them. */
static void tmr_find_stitches(const tmr_mend *m, tmr_gaps *g) {
    size_t count = 0;
    for (int32_t v = 0; v < m->vertex_count; v++) {
        if (!(g->reach[v] >= 0)) continue;
        for (int bit = 0; g->levels >> bit; bit++) {
            const int level = TMR_LEAST_LEVEL + bit;
            if (!(g->levels >> bit & 1)) continue;
            const uint32_t key = tmr_gap_key(tmr_cell(m->point[v], ldexp(1, level)), level);
            size_t low = 0, high = g->cell_count;
            while (low < high) {
                const size_t middle = (low + high) / 2;
                if (g->cell[middle].key < key) low = middle + 1;
                else high = middle;
            }
            for (; low < g->cell_count && g->cell[low].key == key; low++) {
                const int32_t c = (int32_t)g->cell[low].value;
                float along = 0;
                if (!tmr_lies_on(m, g, v, c, &along)) continue;
                if (g->stitch) {
                    TRIMESH_ASSERT(count < g->stitch_count);
                    g->stitch[count].corner = c;
                    g->stitch[count].vertex = v;
                    g->stitch[count].along = along;
                }
                count++;
            }
        }
    }
    g->stitch_count = count;
}

/* ---- which of them join edges ------------------------------------------------------------- */

/* Borders as sets of edges: how often there is each. */
typedef struct tmr_edge_set {
    uint64_t *key; /* 0 = free */
    uint8_t *several;
    size_t mask;
} tmr_edge_set;

static size_t tmr_edge_slot(const tmr_edge_set *e, int32_t a, int32_t b) {
    const uint64_t low = (uint64_t)(a < b ? a : b), high = (uint64_t)(a < b ? b : a);
    const uint64_t key = (low << 32 | high) + 1;
    size_t i = (size_t)txm_hash(key) & e->mask;
    while (e->key[i] && e->key[i] != key) i = (i + 1) & e->mask;
    if (!e->key[i]) e->key[i] = key;
    else e->several[i] |= 2; /* 1: it was asked for before; 2: and once more since then */
    return i;
}

/* Walk along the parts of the border edge of corner c. count: note them in the set. Else: is one of
   them part of another border edge, too? */
static int tmr_walk_parts(const tmr_mend *m, const tmr_gaps *g, const tmr_edge_set *e, int32_t c) {
    int several = 0;
    int32_t from = m->vertex[tmr_next(c)];
    for (int32_t k = g->first[c];; k = g->stitch[k].next) {
        const int32_t to = k >= 0 ? g->stitch[k].vertex : m->vertex[tmr_prev(c)];
        several |= e->several[tmr_edge_slot(e, from, to)];
        from = to;
        if (k < 0) return several;
    }
}

/* List the stitches of each edge along it, and forget those that join nothing. Returns how many are
   left. */
static size_t tmr_list_stitches(const tmr_mend *m, tmr_gaps *g, txm_pair *pairs,
                                const tmr_edge_set *e) {
    const size_t n = g->stitch_count;
    size_t kept = 0;
    for (size_t i = 0; i < n; i++) {
        pairs[i].key = txm_sort_key(g->stitch[i].along);
        pairs[i].value = (uint32_t)i;
    }
    txm_sort_pairs(pairs, pairs + n, n);
    for (int32_t c = 0; c < 3 * m->face_count; c++) g->first[c] = -1;
    for (size_t i = n; i-- > 0;) { /* from the far end, each becomes the first */
        tmr_stitch *s = g->stitch + pairs[i].value;
        const int32_t next = g->first[s->corner];
        if (next >= 0 && g->stitch[next].vertex == s->vertex) continue;
        s->next = next;
        g->first[s->corner] = (int32_t)pairs[i].value;
    }
    for (int32_t c = 0; c < 3 * m->face_count; c++)
        if (tmr_is_border(m, c)) tmr_walk_parts(m, g, e, c);
    for (size_t i = 0; i <= e->mask; i++) e->several[i] = e->several[i] != 0;
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        if (g->first[c] < 0) continue;
        if (!(tmr_walk_parts(m, g, e, c) & 1)) g->first[c] = -1;
        for (int32_t k = g->first[c]; k >= 0; k = g->stitch[k].next) kept++;
    }
    return kept;
}

/* ---- splitting faces ---------------------------------------------------------------------- */

/* The stitch in the middle of the longest side of face f that has any; *corner: of that side. The
   list of the side ends before it, *rest receives what follows it. -1: none. */
static int32_t tmr_take_stitch(const tmr_mend *m, tmr_gaps *g, int32_t f, int32_t *corner,
                               int32_t *rest) {
    double longest = -1;
    int32_t count = 0;
    for (int32_t c = 3 * f; c < 3 * f + 3; c++) {
        if (g->first[c] < 0 || tmr_edge_length(m, c) <= longest) continue;
        longest = tmr_edge_length(m, c);
        *corner = c;
    }
    if (longest < 0) return -1;
    for (int32_t k = g->first[*corner]; k >= 0; k = g->stitch[k].next) count++;
    int32_t *link = g->first + *corner;
    for (int32_t k = count / 2; k > 0; k--) link = &g->stitch[*link].next;
    const int32_t taken = *link;
    *link = -1;
    *rest = g->stitch[taken].next;
    return taken;
}

/* Split faces until no side has stitches left: (p, a, b) at v between a and b into (p, a, v), which
   stays, and (p, v, b). */
static void tmr_split_stitched(tmr_mend *m, tmr_gaps *g) {
    for (int32_t f = 0; f < m->face_count; f++) {
        int32_t c = 0, rest = -1;
        for (int32_t k; (k = tmr_take_stitch(m, g, f, &c, &rest)) >= 0;) {
            const int32_t v = g->stitch[k].vertex, h = m->face_count++;
            m->vertex[3 * h] = m->vertex[c];
            m->vertex[3 * h + 1] = v;
            m->vertex[3 * h + 2] = m->vertex[tmr_prev(c)];
            m->vertex[tmr_prev(c)] = v;
            g->first[3 * h] = rest;
            g->first[3 * h + 1] = g->first[tmr_next(c)]; /* the side from b to p */
            g->first[3 * h + 2] = -1;
            g->first[tmr_next(c)] = -1;
            m->origin[h] = m->origin[f];
            m->turn[f] = m->turn[h] = TMR_MAPPED;
            m->twin[h] = m->twin[f];
        }
    }
}

/* Make room for more faces. */
static txm_status tmr_mend_grow(tmr_mend *m, size_t more) {
    const tmr_mend old = *m;
    const size_t n = (size_t)m->face_count;
    const txm_status status = tmr_mend_alloc_faces(m, n + more);
    if (status != TXM_OK) return status;
    memcpy(m->vertex, old.vertex, 3 * n * sizeof *m->vertex);
    memcpy(m->origin, old.origin, n * sizeof *m->origin);
    memcpy(m->turn, old.turn, n);
    memcpy(m->twin, old.twin, n);
    return TXM_OK;
}

/* Put vertices into the edges on which they lie. border: how many border edges there are. */
static txm_status tmr_stitch_edges(tmr_mend *m, tmr_gaps *g, size_t border) {
    static const char no_memory[] = "no memory to close gaps of the surface";
    tmr_edge_set e;
    tmr_gaps_fill(m, g); /* counts */
    g->cell = (txm_pair *)txm_arena_alloc(m->scratch, 2 * g->cell_count, sizeof(txm_pair));
    if (!g->cell) return txm_fail(m->env, TXM_OUT_OF_MEMORY, no_memory);
    tmr_gaps_fill(m, g);
    txm_sort_pairs(g->cell, g->cell + g->cell_count, g->cell_count);
    tmr_find_stitches(m, g); /* counts */
    const size_t n = g->stitch_count, corners = 3 * ((size_t)m->face_count + n);
    if (n == 0) return TXM_OK;
    if (n > (size_t)TMR_MOST_SLOTS - (size_t)m->face_count)
        return txm_fail(m->env, TXM_TOO_LARGE, "too many vertices lie on edges of other faces");
    for (e.mask = 16; e.mask < 2 * (border + n); e.mask *= 2) {}
    e.key = (uint64_t *)txm_arena_zero(m->scratch, e.mask, sizeof(uint64_t));
    e.several = (uint8_t *)txm_arena_zero(m->scratch, e.mask, 1);
    g->stitch = (tmr_stitch *)txm_arena_alloc(m->scratch, n, sizeof(tmr_stitch));
    g->first = (int32_t *)txm_arena_alloc(m->scratch, corners, sizeof(int32_t));
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(m->scratch, 2 * n, sizeof(txm_pair));
    if (m->scratch->failed) return txm_fail(m->env, TXM_OUT_OF_MEMORY, no_memory);
    e.mask--;
    tmr_find_stitches(m, g);
    m->report.stitched = tmr_list_stitches(m, g, pairs, &e);
    if (m->report.stitched == 0) return TXM_OK;
    const txm_status status = tmr_mend_grow(m, m->report.stitched);
    if (status == TXM_OK) tmr_split_stitched(m, g);
    return status;
}

/* ---- both --------------------------------------------------------------------------------- */

/* Weld the vertices on borders that are close. Returns how many were. */
static size_t tmr_weld_borders(tmr_mend *m, const tmr_gaps *g) {
    const size_t before = m->report.welded;
    tmr_weld(m, g->close, g->reach);
    const size_t welded = m->report.welded - before;
    for (int32_t c = 0; c < 3 * m->face_count && welded > 0; c++)
        m->vertex[c] = m->rename[m->vertex[c]];
    return welded;
}

/* Close gaps, unless nothing shall be welded. */
static txm_status tmr_mend_gaps(tmr_mend *m) {
    tmr_gaps g;
    memset(&g, 0, sizeof g);
    tmr_mend_compact(m);
    tmr_mend_duplicates(m);
    if (m->desc->weld < 0) return TXM_OK;
    g.close = m->desc->weld > 0 ? m->desc->weld : fmin(fmax(TMR_CLOSE, 4 * m->noise), 0.01);
    g.reach = (double *)txm_arena_alloc(m->scratch, (size_t)m->vertex_count, sizeof(double));
    if (!g.reach) return txm_fail(m->env, TXM_OUT_OF_MEMORY, "no memory to close gaps");
    tmr_mend_opposites(m);
    size_t border = tmr_gaps_reach(m, &g);
    if (border > 0 && !(m->desc->weld > 0) && (m->report.closed = tmr_weld_borders(m, &g)) > 0) {
        tmr_mend_compact(m);
        tmr_mend_duplicates(m);
        tmr_mend_opposites(m);
        border = tmr_gaps_reach(m, &g);
    }
    return border > 0 ? tmr_stitch_edges(m, &g, border) : TXM_OK;
}

/* ---- mending: triangles without area ------------------------------------------------------ */

/* Without area there are needles, with two corners in almost one place, and caps, with a corner
   almost on the edge opposite to it:

         ._____________            ___.___
         '-------------         .-----'-----.          a T-junction is filled with a cap: its long
         needle: collapse       cap: flip             edge is flipped, and both halves have area */
static int tmr_is_needle(const tmr_mend *m, int32_t f, int32_t *shortest, int32_t *longest) {
    double least = 0, most = 0;
    txm_dvec3 p[3];
    tmr_face_points(m, f, p);
    for (int32_t k = 0; k < 3; k++) {
        const double length = txm_d3_dist(p[(k + 1) % 3], p[(k + 2) % 3]);
        if (k == 0 || length < least) {
            least = length;
            *shortest = 3 * f + k;
        }
        if (k == 0 || length > most) {
            most = length;
            *longest = 3 * f + k;
        }
    }
    return least <= 1e-6 * most || (least <= m->noise && least <= 1e-3 * most);
}

/* The corners at the vertex of c, and its neighbours: as many, or on the border (*open) one more.
   Returns how many corners, or 0 if they are more than TMR_FAN_LIMIT. */
static int32_t tmr_ring(const tmr_mend *m, int32_t c, int32_t *corner, int32_t *around, int *open) {
    int32_t n = 0, k = c;
    for (int32_t back = tmr_cw(m->opposite, c); back >= 0 && back != c; n++) {
        if (n == TMR_FAN_LIMIT) return 0;
        k = back;
        back = tmr_cw(m->opposite, back);
    }
    *open = tmr_cw(m->opposite, k) < 0;
    c = k; /* first of the fan, or any */
    for (n = 0; k >= 0 && (n == 0 || k != c); k = tmr_ccw(m->opposite, k)) {
        if (n == TMR_FAN_LIMIT) return 0;
        around[n] = m->vertex[tmr_next(k)];
        corner[n++] = k;
    }
    if (*open) around[n] = m->vertex[tmr_prev(corner[n - 1])];
    return n;
}

static int tmr_has_neighbor(const tmr_mend *m, int32_t c, int32_t v) {
    int32_t corner[TMR_FAN_LIMIT], around[TMR_FAN_LIMIT + 1];
    int open = 0;
    const int32_t n = tmr_ring(m, c, corner, around, &open);
    for (int32_t k = 0; k < n + open; k++) {
        if (around[k] == v) return 1;
    }
    return n == 0; /* too many to look at: "yes" prevents the flip       */
}

static void tmr_join(tmr_mend *m, int32_t a, int32_t b) {
    m->opposite[a] = b;
    if (b >= 0) m->opposite[b] = a;
}

/* Height over longest edge. */
static double tmr_slimness(txm_dvec3 a, txm_dvec3 b, txm_dvec3 c) {
    const double longest2 = fmax(txm_d3_dist2(a, b), fmax(txm_d3_dist2(b, c), txm_d3_dist2(c, a)));
    return longest2 > 0 ? txm_d3_len(txm_d3_area2(a, b, c)) / longest2 : 0;
}

/* Flip the edge of corner c if the worse of the two triangles gets better and none is inverted. As
   this triangle has no area, both new ones lie in the triangle beyond. */
static int tmr_flip_thin(tmr_mend *m, int32_t c) {
    const int32_t o = m->opposite[c];
    if (o < 0 || m->vertex[o] == m->vertex[c]) return 0;
    const int32_t next = tmr_next(c), prev = tmr_prev(c), beyond = tmr_next(o);
    const txm_dvec3 p = m->point[m->vertex[c]], q = m->point[m->vertex[o]];
    const txm_dvec3 a = m->point[m->vertex[next]], b = m->point[m->vertex[prev]];
    const txm_dvec3 n = txm_d3_add(txm_d3_area2(p, a, b), txm_d3_area2(q, b, a));
    const double before = fmin(tmr_slimness(p, a, b), tmr_slimness(q, b, a));
    const double after = fmin(tmr_slimness(p, a, q), tmr_slimness(q, b, p));
    if (!(after > before) || !(txm_d3_dot(txm_d3_area2(p, a, q), n) >= 0) ||
        !(txm_d3_dot(txm_d3_area2(q, b, p), n) >= 0) || tmr_has_neighbor(m, c, m->vertex[o]))
        return 0;
    const int32_t aq = m->opposite[beyond], bp = m->opposite[next];
    m->vertex[prev] = m->vertex[o];
    m->vertex[tmr_prev(o)] = m->vertex[c];
    tmr_join(m, c, aq);
    tmr_join(m, o, bp);
    tmr_join(m, next, beyond);
    m->origin[c / 3] = m->origin[o / 3];
    m->turn[c / 3] = m->turn[o / 3] = TMR_MAPPED;
    return 1;
}

/* Detach a face and flag it for removal. */
static void tmr_drop_face(tmr_mend *m, int32_t f) {
    for (int32_t c = 3 * f; c < 3 * f + 3; c++) {
        if (m->opposite[c] >= 0) m->opposite[m->opposite[c]] = -1;
        m->opposite[c] = -1;
    }
    m->flag[f] = 1;
}

/* Flip the longest edge of a thin face, or remove the face if that edge is on the border. Needles
   are left as they are. Returns non-zero if something changed. */
static int tmr_flip_cap(tmr_mend *m, int32_t f) {
    int32_t shortest = 0, longest = 0;
    if (m->flag[f] || !tmr_face_is_thin(m, f) || tmr_is_needle(m, f, &shortest, &longest)) return 0;
    if (m->opposite[longest] < 0) {
        tmr_drop_face(m, f);
        return 1;
    }
    if (!tmr_flip_thin(m, longest)) return 0;
    m->report.degenerate++;
    return 1;
}

/* Go over the count thin faces of m->list, back and forth, so that a row of them along one edge is
   undone from either end. m->list keeps those that are still thin. Returns how many. */
static int32_t tmr_flip_caps(tmr_mend *m, int32_t count) {
    int done = 1;
    for (int sweep = 0; done && sweep < TMR_FLIP_SWEEPS; sweep++) {
        int32_t kept = 0;
        done = 0;
        for (int32_t i = 0; i < count; i++)
            done |= tmr_flip_cap(m, m->list[sweep % 2 ? count - 1 - i : i]);
        for (int32_t i = 0; i < count; i++) {
            const int32_t f = m->list[i];
            if (!m->flag[f] && tmr_face_is_thin(m, f)) m->list[kept++] = f;
        }
        count = kept;
    }
    return count;
}

/* Would moving the vertex of these corners to point p invert a face that has an area? */
static int tmr_move_inverts(const tmr_mend *m, const int32_t *corner, int32_t n, int32_t other,
                            txm_dvec3 p) {
    for (int32_t k = 0; k < n; k++) {
        const int32_t i = m->vertex[tmr_next(corner[k])], j = m->vertex[tmr_prev(corner[k])];
        if (i == other || j == other || tmr_face_is_thin(m, corner[k] / 3)) continue;
        const txm_dvec3 before =
            txm_d3_area2(m->point[m->vertex[corner[k]]], m->point[i], m->point[j]);
        if (!(txm_d3_dot(txm_d3_area2(p, m->point[i], m->point[j]), before) > 0)) return 1;
    }
    return 0;
}

/* Merge the ends of the edge of corner c, if that leaves a manifold: their only common neighbours
   are the apices of the edge's faces, and the edge does not join two borders. Neighbours are not
   touched for the rest of the round (degree 0). */
static int tmr_collapse_needle(tmr_mend *m, int32_t c, int32_t stamp) {
    int32_t from[TMR_FAN_LIMIT], to[TMR_FAN_LIMIT], near_from[TMR_FAN_LIMIT + 1];
    int32_t near_to[TMR_FAN_LIMIT + 1], common = 0, u = m->vertex[tmr_next(c)];
    int open_u = 0, open_v = 0;
    const int32_t v = m->vertex[tmr_prev(c)];
    const int32_t nu = tmr_ring(m, tmr_next(c), to, near_to, &open_u);
    const int32_t nv = tmr_ring(m, tmr_prev(c), from, near_from, &open_v);
    /* also for vertices with several fans, and for long rings */
    if (nu == 0 || nv == 0 || nu != m->degree[u] || nv != m->degree[v]) return 0;
    if (m->opposite[c] >= 0 && open_u && open_v) return 0;
    if (!open_u && !open_v && (nu == 3 || nv == 3)) return 0; /* might be a tetrahedron */
    for (int32_t k = 0; k < nu + open_u; k++) m->stamp[near_to[k]] = stamp;
    for (int32_t k = 0; k < nv + open_v; k++) common += m->stamp[near_from[k]] == stamp;
    if (common != (m->opposite[c] >= 0 ? 2 : 1)) return 0;
    /* the border stays where it is; else the lower number stays */
    const int keep_u = open_u != open_v ? open_u : u < v;
    if (keep_u ? tmr_move_inverts(m, from, nv, u, m->point[u])
               : tmr_move_inverts(m, to, nu, v, m->point[v]))
        return 0;
    m->rename[keep_u ? v : u] = keep_u ? u : v;
    for (int32_t k = 0; k < nu + open_u; k++) m->degree[near_to[k]] = 0;
    for (int32_t k = 0; k < nv + open_v; k++) m->degree[near_from[k]] = 0;
    return 1;
}

/* Choose and collapse needles among the count faces of m->list. Returns how many. Opposites must be
   found again afterwards. */
static int32_t tmr_collapse_needles(tmr_mend *m, int32_t count) {
    int32_t done = 0, shortest = 0, longest = 0;
    for (int32_t i = 0; i < m->vertex_count; i++) {
        m->rename[i] = i;
        m->degree[i] = 0;
        m->stamp[i] = -1;
    }
    for (int32_t c = 0; c < 3 * m->face_count; c++) m->degree[m->vertex[c]] += !m->flag[c / 3];
    for (int32_t i = 0; i < count; i++) {
        if (tmr_is_needle(m, m->list[i], &shortest, &longest))
            done += tmr_collapse_needle(m, shortest, i);
    }
    for (int32_t c = 0; c < 3 * m->face_count && done; c++) m->vertex[c] = m->rename[m->vertex[c]];
    return done;
}

/* Flip and collapse until no face without area is left, or nothing changes. */
static txm_status tmr_mend_thin(tmr_mend *m) {
    txm_status status = TXM_OK;
    for (int round = 0; status == TXM_OK && round < TMR_MEND_ROUNDS; round++) {
        int32_t count = 0;
        for (int32_t f = 0; f < m->face_count; f++) {
            m->flag[f] = 0;
            if (tmr_face_is_thin(m, f)) m->list[count++] = f;
        }
        if (count == 0) break;
        if (count == m->face_count)
            return txm_fail(m->env, TXM_TOO_SMALL, "the surface has no area");
        count = tmr_flip_caps(m, count);
        const int32_t collapsed = count > 0 ? tmr_collapse_needles(m, count) : 0;
        const size_t cut = tmr_cut_flagged(m);
        m->report.degenerate += cut;
        if (collapsed == 0 && cut == 0) break;
        status = tmr_mend_faces(m);
    }
    return status;
}

/* ---- mending: vertices where fans meet, and numbering ------------------------------------- */

/* Mark the fan around the vertex of corner c as seen, and set its vertex to v unless that is
   negative. Returns the first corner counter-clockwise, which has the border on its right; without
   border c. */
static int32_t tmr_mark_fan(tmr_mend *m, int32_t c, uint8_t *seen, int32_t v) {
    int32_t first = c;
    for (int32_t k = c; k >= 0;) {
        seen[k] = 1;
        if (v >= 0) m->vertex[k] = v;
        k = tmr_ccw(m->opposite, k);
        if (k == c) return c;
    }
    for (int32_t k = tmr_cw(m->opposite, c); k >= 0; k = tmr_cw(m->opposite, k)) {
        seen[k] = 1;
        if (v >= 0) m->vertex[k] = v;
        first = k;
    }
    return first;
}

/* Count the fans; set degree = 1 for vertices in use. */
static int32_t tmr_count_fans(tmr_mend *m, uint8_t *seen) {
    int32_t fans = 0;
    memset(m->degree, 0, (size_t)m->vertex_count * sizeof *m->degree);
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        if (seen[c]) continue;
        m->degree[m->vertex[c]] = 1;
        tmr_mark_fan(m, c, seen, -1);
        fans++;
    }
    return fans;
}

/* Number the vertices in use in the caller's order, one per fan; further fans of a vertex come
   after all others. Fills corner, point and scale of the surface. */
static void tmr_number_fans(tmr_mend *m, tmr_surface *s, uint8_t *seen) {
    int32_t used = 0;
    for (int32_t i = 0; i < m->vertex_count; i++) m->rename[i] = m->degree[i] ? used++ : -1;
    m->report.split = (size_t)(s->vertex_count - used);
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        if (seen[c]) continue;
        const int32_t old = m->vertex[c];
        int32_t v = used;
        if (m->degree[old]) {
            m->degree[old] = 0;
            v = m->rename[old];
        } else used++;
        TRIMESH_ASSERT(v < s->vertex_count); /* as many as tmr_count_fans has counted */
        s->point[v] = m->point[old];
        if (s->scale) s->scale[v] = m->desc->scale[old];
        s->corner[v] = tmr_mark_fan(m, c, seen, v);
    }
}

/* Store the mended faces in the surface, with vertices split and numbered. */
static txm_status tmr_mend_finish(tmr_mend *m, txm_arena *arena, tmr_surface *s) {
    const size_t f = (size_t)m->face_count;
    s->face_count = m->face_count;
    s->vertex = m->vertex;
    s->opposite = m->opposite;
    s->origin = m->origin;
    s->turn = m->turn;
    s->centre = m->centre;
    s->diagonal = m->diagonal;
    s->edge_kind = (uint8_t *)txm_arena_zero(arena, 3 * f, 1);
    if (!s->edge_kind) return txm_fail(m->env, TXM_OUT_OF_MEMORY, "no memory for the surface");
    /* edge_kind, which is not needed yet, marks the corners that were visited */
    s->vertex_count = tmr_count_fans(m, s->edge_kind);
    const size_t v = (size_t)s->vertex_count;
    s->point = (txm_dvec3 *)txm_arena_alloc(arena, v, sizeof(txm_dvec3));
    s->corner = (int32_t *)txm_arena_alloc(arena, v, sizeof(int32_t));
    if (m->desc->scale) s->scale = (float *)txm_arena_alloc(arena, v, sizeof(float));
    if (arena->failed) return txm_fail(m->env, TXM_OUT_OF_MEMORY, "no memory for the surface");
    memset(s->edge_kind, 0, 3 * f);
    tmr_number_fans(m, s, s->edge_kind);
    for (size_t c = 0; c < 3 * f; c++)
        s->edge_kind[c] = (uint8_t)(s->opposite[c] < 0 ? TMR_BORDER_EDGE : TMR_PLAIN_EDGE);
    for (size_t i = 0; i < f; i++) m->report.turned += (s->turn[i] & 4) != 0;
    m->report.vertices = v;
    m->report.triangles = f;
    return TXM_OK;
}

/* ---- mending: several edges between two vertices ------------------------------------------ */

/* Where the faces of an edge were paired, or a one-sided surface was cut, both edges may still run
   between the same two vertices. The mesh that changes tells edges by their ends, so such edges get a
   vertex in the middle. (Two border edges of that kind would also be a loop of two.) */

/* Mark the corners of such edges, 1 each in mark. Returns how many corners. */
static size_t tmr_find_doubles(const tmr_mend *m, const tmr_surface *s, uint8_t *mark) {
    txm_mesh mesh;
    size_t count = 0;
    memset(&mesh, 0, sizeof mesh);
    mesh.indices = (const uint32_t *)s->vertex;
    mesh.vertex_count = (size_t)s->vertex_count;
    mesh.face_count = (size_t)s->face_count;
    txm_mesh_sort_sides(&mesh, m->sides);
    memset(mark, 0, 3 * (size_t)s->face_count);
    for (size_t i = 0, end; i < txm_mesh_sides(&mesh); i = end) {
        const int32_t c = tmr_opposite_corner(m, (int32_t)i);
        end = txm_mesh_edge_end(&mesh, m->sides, i);
        if (end - i == 1 || (end - i == 2 && s->opposite[c] >= 0)) continue;
        for (size_t k = i; k < end; k++) mark[tmr_opposite_corner(m, (int32_t)k)] = 1;
        count += end - i;
    }
    return count;
}

/* Split face (p, a, b) of corner c at p into (p, a, v), which stays, and a new one, (p, v, b). Returns
   the corner at p of the new one. */
static int32_t tmr_halve_face(tmr_surface *s, int32_t c, int32_t v, uint8_t *mark) {
    const int32_t f = c / 3, n = 3 * s->face_count++, next = tmr_next(c), prev = tmr_prev(c);
    s->vertex[n] = s->vertex[c];
    s->vertex[n + 1] = v;
    s->vertex[n + 2] = s->vertex[prev];
    s->vertex[prev] = v;
    s->opposite[n + 1] = s->opposite[next]; /* from b to p */
    if (s->opposite[next] >= 0) s->opposite[s->opposite[next]] = n + 1;
    s->opposite[next] = n + 2; /* from p to v */
    s->opposite[n + 2] = next;
    mark[n + 1] = mark[next];
    mark[c] = mark[next] = mark[n] = mark[n + 2] = 0;
    s->origin[n / 3] = s->origin[f];
    s->turn[n / 3] = s->turn[f] = TMR_MAPPED;
    return n;
}

/* Put a vertex into the middle of the edge of corner c. */
static void tmr_halve_edge(tmr_surface *s, int32_t c, uint8_t *mark) {
    const int32_t o = s->opposite[c], v = s->vertex_count++;
    const int32_t a = s->vertex[tmr_next(c)], b = s->vertex[tmr_prev(c)];
    s->point[v] = txm_d3_scale(txm_d3_add(s->point[a], s->point[b]), 0.5);
    if (s->scale) s->scale[v] = txm_float(0.5 * (s->scale[a] + (double)s->scale[b]));
    const int32_t c2 = tmr_halve_face(s, c, v, mark); /* c: a to v, c2: v to b */
    s->opposite[c] = s->opposite[c2] = -1;
    if (o < 0) return;
    const int32_t o2 = tmr_halve_face(s, o, v, mark); /* o: b to v, o2: v to a */
    s->opposite[c] = o2;
    s->opposite[o2] = c;
    s->opposite[c2] = o;
    s->opposite[o] = c2;
}

/* Copies of the arrays of the surface with room for more faces and vertices. */
static txm_status tmr_surface_grow(tmr_surface *s, size_t faces, size_t vertices,
                                   txm_arena *arena) {
    const tmr_surface old = *s;
    const size_t f = (size_t)s->face_count, v = (size_t)s->vertex_count;
    s->vertex = (int32_t *)txm_arena_alloc(arena, 3 * (f + faces), sizeof(int32_t));
    s->opposite = (int32_t *)txm_arena_alloc(arena, 3 * (f + faces), sizeof(int32_t));
    s->origin = (uint32_t *)txm_arena_alloc(arena, f + faces, sizeof(uint32_t));
    s->turn = (uint8_t *)txm_arena_alloc(arena, f + faces, 1);
    s->edge_kind = (uint8_t *)txm_arena_zero(arena, 3 * (f + faces), 1);
    s->point = (txm_dvec3 *)txm_arena_alloc(arena, v + vertices, sizeof(txm_dvec3));
    s->corner = (int32_t *)txm_arena_alloc(arena, v + vertices, sizeof(int32_t));
    if (s->scale) s->scale = (float *)txm_arena_alloc(arena, v + vertices, sizeof(float));
    if (arena->failed) return TXM_OUT_OF_MEMORY;
    memcpy(s->vertex, old.vertex, 3 * f * sizeof *s->vertex);
    memcpy(s->opposite, old.opposite, 3 * f * sizeof *s->opposite);
    memcpy(s->origin, old.origin, f * sizeof *s->origin);
    memcpy(s->turn, old.turn, f);
    memcpy(s->point, old.point, v * sizeof *s->point);
    if (s->scale) memcpy(s->scale, old.scale, v * sizeof *s->scale);
    return TXM_OK;
}

/* One corner of each vertex, and the kinds of edges, as tmr_surface has them. */
static void tmr_surface_corners(tmr_surface *s) {
    for (int32_t v = 0; v < s->vertex_count; v++) s->corner[v] = -1;
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        s->edge_kind[c] = (uint8_t)(s->opposite[c] < 0 ? TMR_BORDER_EDGE : TMR_PLAIN_EDGE);
        if (s->corner[s->vertex[c]] < 0 || tmr_cw(s->opposite, c) < 0)
            s->corner[s->vertex[c]] = c;
    }
}

/* Split the edges of which there are several between two vertices of the numbered surface. */
static txm_status tmr_split_doubles(tmr_mend *m, txm_arena *arena, tmr_surface *s) {
    static const char no_memory[] = "no memory for the surface";
    uint8_t *mark = (uint8_t *)txm_arena_alloc(m->scratch, 3 * (size_t)s->face_count, 1);
    if (!mark) return txm_fail(m->env, TXM_OUT_OF_MEMORY, no_memory);
    /* each corner that is marked gets a face more, and each edge, which has one or two, a vertex */
    const size_t more = tmr_find_doubles(m, s, mark), f = (size_t)s->face_count;
    if (more == 0) return TXM_OK;
    if (f + more > TMR_MOST_SLOTS || (size_t)s->vertex_count + more > TMR_MOST_SLOTS)
        return txm_fail(m->env, TXM_TOO_LARGE, "the surface has too many edges of several faces");
    uint8_t *marks = (uint8_t *)txm_arena_zero(m->scratch, 3 * (f + more), 1);
    if (!marks || tmr_surface_grow(s, more, more, arena) != TXM_OK)
        return txm_fail(m->env, TXM_OUT_OF_MEMORY, no_memory);
    memcpy(marks, mark, 3 * f);
    for (int32_t c = 0; c < 3 * s->face_count; c++)
        if (marks[c]) tmr_halve_edge(s, c, marks);
    TRIMESH_ASSERT((size_t)s->face_count == f + more);
    tmr_surface_corners(s);
    m->report.vertices = (size_t)s->vertex_count;
    m->report.triangles = (size_t)s->face_count;
    return TXM_OK;
}

/* ---- the surface: normals and topology ---------------------------------------------------- */

/* Normals of faces without area: the mean of their neighbours', from the rim of such a region
   inwards. */
static void tmr_fill_normals(tmr_surface *s, const int32_t *thin, int32_t count) {
    int left = count > 0;
    for (int round = 0; left && round < TMR_FLIP_SWEEPS; round++) {
        left = 0;
        for (int32_t i = 0; i < count; i++) {
            const int32_t f = thin[i];
            txm_dvec3 sum = txm_d3(0, 0, 0);
            if (txm_d3_len2(s->normal[f]) > 0) continue;
            for (int32_t c = 3 * f; c < 3 * f + 3; c++) {
                if (s->opposite[c] >= 0) sum = txm_d3_add(sum, s->normal[s->opposite[c] / 3]);
            }
            s->normal[f] = txm_d3_unit(sum);
            left |= !(txm_d3_len2(sum) > 0);
        }
    }
    for (int32_t i = 0; i < count; i++) { /* no face nearby has a normal: use its own, or any */
        const int32_t *v = s->vertex + 3 * thin[i];
        txm_dvec3 *n = s->normal + thin[i];
        if (txm_d3_len2(*n) > 0) continue;
        *n = txm_d3_unit(txm_d3_area2(s->point[v[0]], s->point[v[1]], s->point[v[2]]));
        if (!(txm_d3_len2(*n) > 0)) *n = txm_d3(0, 0, 1);
    }
}

/* Normals of faces; *count faces of no area are listed in thin. */
static void tmr_face_normals(const tmr_mend *m, tmr_surface *s, int32_t *thin, int32_t *count) {
    s->area = s->volume = 0;
    *count = 0;
    for (int32_t f = 0; f < s->face_count; f++) {
        txm_dvec3 p[3];
        for (int k = 0; k < 3; k++) p[k] = s->point[s->vertex[3 * f + k]];
        const txm_dvec3 n = txm_d3_area2(p[0], p[1], p[2]);
        s->area += 0.5 * txm_d3_len(n);
        s->volume += txm_d3_dot(p[0], n) / 6;
        s->normal[f] = txm_d3_unit(n);
        if (tmr_is_thin(m, p)) {
            s->normal[f] = txm_d3(0, 0, 0);
            TRIMESH_ASSERT(*count < s->face_count);
            thin[(*count)++] = f;
        }
    }
}

/* Vertex normals: the sum over the corners of angle times normal. */
static void tmr_vertex_normals(tmr_surface *s) {
    memset(s->vertex_normal, 0, (size_t)s->vertex_count * sizeof *s->vertex_normal);
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        const txm_dvec3 p = s->point[s->vertex[c]];
        const txm_dvec3 a = txm_d3_sub(s->point[s->vertex[tmr_next(c)]], p);
        const txm_dvec3 b = txm_d3_sub(s->point[s->vertex[tmr_prev(c)]], p);
        const double angle = txm_atan2(txm_d3_len(txm_d3_cross(a, b)), txm_d3_dot(a, b));
        txm_dvec3 *n = s->vertex_normal + s->vertex[c];
        *n = txm_d3_mad(*n, s->normal[c / 3], angle);
    }
    for (int32_t i = 0; i < s->vertex_count; i++) {
        txm_dvec3 *n = s->vertex_normal + i;
        *n = txm_d3_unit(*n);
        if (!(txm_d3_len2(*n) > 0)) *n = s->normal[s->corner[i] / 3];
    }
}

/* Number the connected pieces by their first face. queue: scratch, 1 per face. */
static void tmr_find_components(tmr_surface *s, int32_t *queue) {
    s->component_count = 0;
    for (int32_t f = 0; f < s->face_count; f++) s->component[f] = -1;
    for (int32_t f = 0; f < s->face_count; f++) {
        int32_t count = 0;
        if (s->component[f] >= 0) continue;
        s->component[f] = s->component_count;
        queue[count++] = f;
        for (int32_t i = 0; i < count; i++) {
            for (int32_t c = 3 * queue[i]; c < 3 * queue[i] + 3; c++) {
                const int32_t g = s->opposite[c] / 3;
                if (s->opposite[c] < 0 || s->component[g] >= 0) continue;
                s->component[g] = s->component_count;
                TRIMESH_ASSERT(count < s->face_count);
                queue[count++] = g;
            }
        }
        s->component_count++;
    }
}

/* The border edge that follows the one of corner c, with the surface on the left. */
static int32_t tmr_next_border(const tmr_surface *s, int32_t c) {
    int32_t k = tmr_next(c);
    while (s->opposite[k] >= 0) k = tmr_next(s->opposite[k]);
    return k;
}

/* Count border loops and edges; fill in components, loops and Euler characteristic. */
static void tmr_count_loops(tmr_surface *s, trimesh_report *report, uint8_t *seen) {
    int32_t loops = 0, border = 0;
    memset(seen, 0, 3 * (size_t)s->face_count);
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        if (s->opposite[c] >= 0) continue;
        border++;
        if (seen[c]) continue;
        for (int32_t k = c; !seen[k]; k = tmr_next_border(s, k)) seen[k] = 1;
        loops++;
    }
    s->loop_count = loops;
    s->border_count = border;
    report->loops = (size_t)loops;
    report->components = (size_t)s->component_count;
    report->euler = (long)s->vertex_count + s->face_count - (3 * (long)s->face_count + border) / 2;
}

/* Normals, components, loops, area; temporary memory of its own. */
static txm_status tmr_surface_measure(tmr_mend *m, txm_arena *arena, txm_arena *scratch,
                                      tmr_surface *s) {
    const size_t f = (size_t)s->face_count, v = (size_t)s->vertex_count;
    int32_t count = 0;
    s->normal = (txm_dvec3 *)txm_arena_alloc(arena, f, sizeof(txm_dvec3));
    s->vertex_normal = (txm_dvec3 *)txm_arena_alloc(arena, v, sizeof(txm_dvec3));
    s->component = (int32_t *)txm_arena_alloc(arena, f, sizeof(int32_t));
    int32_t *list = (int32_t *)txm_arena_alloc(scratch, f, sizeof(int32_t));
    if (arena->failed || scratch->failed)
        return txm_fail(m->env, TXM_OUT_OF_MEMORY, "no memory for the surface");
    tmr_face_normals(m, s, list, &count);
    if (count == s->face_count || !(s->area > 0))
        return txm_fail(m->env, TXM_TOO_SMALL, "the surface has no area");
    tmr_fill_normals(s, list, count);
    tmr_vertex_normals(s);
    tmr_find_components(s, list);
    tmr_count_loops(s, &m->report, (uint8_t *)list);
    return TXM_OK;
}

/* ---- the input, mended: the whole --------------------------------------------------------- */

static txm_status tmr_mend_all(tmr_mend *m, txm_arena *arena, txm_arena *places,
                               txm_arena *scratch, tmr_surface *s) {
    txm_status status = tmr_check_surface(m->desc, m->env);
    if (status != TXM_OK) return status;
    m->vertex_count = (int32_t)m->desc->surface.vertex_count;
    m->face_count = (int32_t)m->desc->surface.face_count;
    m->arena = arena;
    m->scratch = scratch;
    m->point = (txm_dvec3 *)txm_arena_alloc(places, (size_t)m->vertex_count, sizeof(txm_dvec3));
    if (!m->point) return txm_fail(m->env, TXM_OUT_OF_MEMORY, "no memory to mend the surface");
    if ((status = tmr_mend_alloc(m)) != TXM_OK) return status;
    if ((status = tmr_mend_cancel(m, 0)) != TXM_OK) return status;
    if ((status = tmr_mend_scale(m)) != TXM_OK) return status;
    if (m->desc->weld >= 0) tmr_weld(m, m->desc->weld, NULL);
    if ((status = tmr_mend_cancel(m, 0.01f)) != TXM_OK) return status;
    tmr_mend_load(m);
    if ((status = tmr_mend_gaps(m)) != TXM_OK) return status;
    if ((status = tmr_mend_faces(m)) != TXM_OK) return status;
    if ((status = tmr_mend_thin(m)) != TXM_OK) return status;
    if ((status = tmr_mend_cancel(m, 0.03f)) != TXM_OK) return status;
    if ((status = tmr_mend_finish(m, arena, s)) != TXM_OK) return status;
    if ((status = tmr_split_doubles(m, arena, s)) != TXM_OK) return status;
    txm_arena_free(scratch);
    txm_arena_free(places);
    if ((status = tmr_mend_cancel(m, 0.04f)) != TXM_OK) return status;
    return tmr_surface_measure(m, arena, scratch, s);
}

/* Check, weld and mend the caller's surface.

   arena   receives what the surface keeps, also part of it after an error: free it then
   report  NULL, or receives what was found, also after an error
   return  TXM_OK; TXM_BAD_ARGUMENT; TXM_TOO_SMALL without area or faces;
           TXM_TOO_LARGE; TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost    O(n) time; about 130 bytes per triangle of a closed mesh, 85 of them kept         */
static txm_status tmr_surface_build(const trimesh_desc *desc, txm_env *env, txm_arena *arena,
                                    trimesh_report *report, tmr_surface *s) {
    txm_arena places, scratch;
    tmr_mend m;
    memset(&m, 0, sizeof m);
    memset(s, 0, sizeof *s);
    m.desc = desc;
    m.env = env;
    txm_arena_init(&places, env);
    txm_arena_init(&scratch, env);
    const txm_status status = tmr_mend_all(&m, arena, &places, &scratch, s);
    txm_arena_free(&scratch);
    txm_arena_free(&places);
    if (report) *report = m.report;
    return status;
}

/* ---- seams ------------------------------------------------------------------------------- */

#define TMR_SAME_CORNER 1e-4 /* ours: of the longest side; nearer vertices are a triangle's own corners */

#define TMR_SHORTEST_SEAM 3 /* ours: in edge lengths; connected seams need as many vertices       */

/* The corners of a triangle of the caller, scaled as the surface is. */
static void tmr_caller_corners(const tmr_surface *s, const trimesh_desc *desc, uint32_t triangle,
                               txm_dvec3 p[3]) {
    for (size_t k = 0; k < 3; k++) {
        const size_t v = desc->surface.indices[3 * (size_t)triangle + k];
        const float *q = desc->surface.positions + 3 * v;
        p[k] = txm_d3_scale(txm_d3_sub(txm_d3(q[0], q[1], q[2]), s->centre), 1 / s->diagonal);
    }
}

/* The entry of desc->seams at corner c of the surface. Where mending has changed a face, its vertices
   are looked for among the corners of the caller's triangle that it came from. Returns 0 if it is
   none of them, as a vertex in the middle of a side of that triangle. */
static int tmr_seam_entry(const tmr_surface *s, const trimesh_desc *desc, int32_t c,
                          uint32_t *entry) {
    const int32_t f = c / 3;
    const int turn = s->turn[f], k = (int)(c % 3);
    const uint32_t *entries = desc->seams + 3 * (size_t)s->origin[f];
    txm_dvec3 p[3];
    double longest = 0;
    int best = 0;
    if (turn < TMR_MAPPED) {
        *entry = entries[turn < 4 ? (k + turn) % 3 : (turn - 4 - k + 3) % 3];
        return 1;
    }
    tmr_caller_corners(s, desc, s->origin[f], p);
    const txm_dvec3 own = s->point[s->vertex[c]];
    for (int i = 0; i < 3; i++) {
        longest = fmax(longest, txm_d3_dist2(p[i], p[(i + 1) % 3]));
        if (txm_d3_dist2(p[i], own) < txm_d3_dist2(p[best], own)) best = i;
    }
    *entry = entries[best];
    return txm_d3_dist2(p[best], own) <= TMR_SAME_CORNER * TMR_SAME_CORNER * longest;
}

/* Do the two triangles at the edge opposite to c have different entries at one of its ends? */
static int tmr_is_seam(const tmr_surface *s, const trimesh_desc *desc, int32_t c) {
    const int32_t o = s->opposite[c];
    const int32_t here[2] = {tmr_next(c), tmr_prev(c)}, there[2] = {tmr_prev(o), tmr_next(o)};
    uint32_t one = 0, two = 0;
    for (int end = 0; end < 2; end++) {
        if (tmr_seam_entry(s, desc, here[end], &one) && tmr_seam_entry(s, desc, there[end], &two) &&
            one != two)
            return 1;
    }
    return 0;
}

/* Mark the seams in s->edge_kind, beside what is there already. */
static void tmr_mark_seams(tmr_surface *s, const trimesh_desc *desc) {
    for (int32_t c = 0; c < 3 * s->face_count && desc->seams; c++) {
        const int32_t o = s->opposite[c];
        if (o < c || !tmr_is_seam(s, desc, c)) continue;
        s->edge_kind[c] |= TMR_SEAM_EDGE;
        s->edge_kind[o] |= TMR_SEAM_EDGE;
    }
}

/* What makes a line: border, seam or crease. A seam that is a crease in part is one line. */
static int tmr_line_class(int edge_kind) {
    return edge_kind & TMR_SEAM_EDGE ? TMR_SEAM_EDGE : edge_kind;
}

/* ---- bands: chamfers and fillets narrower than an edge -------------------------------------- */

/* Parts have chamfers and fillets: narrow strips of faces between two flats, over which the surface
   turns. Triangles larger than the strip cannot follow it. Vertices that come to lie to either side
   of it make saw-teeth, unless it becomes a line. So strips are found here by walking across:

             flat 0  ________                       a walk starts in the middle of an edge, at right
                             `-. strip              angles to it, goes on straight over the unfolded
                                `\                  faces, and ends where the surface has been flat
                                  |                 for about half an edge length
                                  | flat 1

   and ridges.h extends both flats to the line in which they meet. All numbers here are ours, see
   docs/choices.md#bands. */
enum { TMR_WALK_MOST = 96 };    /* faces that a walk crosses at most                             */
#define TMR_BAND_WIDTH 1.8      /* widest strip, in edge lengths: a fillet that turns by 90 degrees
                                   turns by 50 in one edge length                              */
#define TMR_BAND_FLAT 0.45      /* a flat is as wide as this, in edge lengths                    */
#define TMR_FLAT_RATIO 2        /* of the widths of a flat and of the chamfer beside it, at least  */
#define TMR_BAND_SHIFT 0.85     /* how far a strip may be moved, in edge lengths                 */
#define TMR_BAND_BENT 0.14      /* how much a flat may turn: 2 sin of half the angle, 8 degrees  */
#define TMR_BAND_EVEN 0.026     /* what belongs to the flat turns by less: 1.5 degrees           */
#define TMR_BAND_SAME 0.01      /* faces of one plane turn by less: half a degree                */
#define TMR_BAND_LEAST 0.035    /* walks begin at edges that turn by more: 2 degrees             */
#define TMR_BAND_MOST 1.64      /* strips turn by no more than this: 110 degrees                 */
#define TMR_BAND_ONE_WAY 1.4    /* sum of the turns over the turn of the whole, at most          */

/* Faces on the way across from an edge. face[i] lies between point[i] and point[i + 1]; those lie at
   way[i] and way[i + 1]. */
typedef struct tmr_walk {
    int32_t count;
    int border; /* did it end at the border? */
    int32_t face[TMR_WALK_MOST];
    double way[TMR_WALK_MOST + 1];
    txm_dvec3 point[TMR_WALK_MOST + 1];
    int32_t corner;  /* of the next face, opposite to the edge by which it is entered              */
    txm_dvec3 a, b;  /* the ends of that edge: at the next corner and at the previous one          */
    txm_dvec3 d;     /* the direction in the next face, unit                                       */
} tmr_walk;

/* A strip as a walk has seen it. */
typedef struct tmr_band {
    int32_t count;                    /* faces in between                                        */
    int32_t face[2 * TMR_WALK_MOST];
    int32_t flat[2];                  /* a face of each flat                                     */
    txm_dvec3 normal[2], point[2];    /* of the flats; where the strip begins and ends           */
    double width;
    double section; /* area of the cross-section between the strip and the line where the flats
                       meet; negative where the surface is concave                              */
} tmr_band;

/* how far two unit normals are apart: 2 sin of half the angle */
static double tmr_chord(const tmr_surface *s, int32_t f, int32_t g) {
    return txm_d3_dist(s->normal[f], s->normal[g]);
}

/* Begin in the middle of the edge opposite to corner c, at right angles to it. */
static void tmr_walk_begin(const tmr_surface *s, int32_t c, tmr_walk *walk) {
    walk->count = walk->border = 0;
    walk->corner = c;
    walk->a = s->point[s->vertex[tmr_next(c)]];
    walk->b = s->point[s->vertex[tmr_prev(c)]];
    walk->d = txm_d3_cross(s->normal[c / 3], txm_d3_unit(txm_d3_sub(walk->b, walk->a)));
    walk->way[0] = 0;
    walk->point[0] = txm_d3_scale(txm_d3_add(walk->a, walk->b), 0.5);
}

/* Cross the next face, not after the border.

            q           The walk comes in between a and b, and leaves between b and q if q lies to its
           / \          left, else between q and a.
          /   \
         b--^--a        Returns 0 if it has crossed too many faces, or if this one has no area.  */
static int tmr_walk_on(const tmr_surface *s, tmr_walk *walk) {
    const int32_t i = walk->count, c = walk->corner;
    if (i >= TMR_WALK_MOST) return 0;
    const txm_dvec3 n = s->normal[c / 3], p = walk->point[i], d = walk->d, q = s->point[s->vertex[c]];
    const int left = txm_d3_dot(n, txm_d3_cross(d, txm_d3_sub(q, p))) > 0;
    const int32_t exit = left ? tmr_next(c) : tmr_prev(c);
    if (left) walk->a = q; /* seen from the next face */
    else walk->b = q;
    const txm_dvec3 e = txm_d3_unit(txm_d3_sub(walk->a, walk->b)), out = txm_d3_cross(e, n);
    const double speed = txm_d3_dot(d, out), cosine = txm_d3_dot(d, e);
    if (!(speed > 1e-9)) return 0;
    const double t = fmax(0, txm_d3_dot(txm_d3_sub(q, p), out) / speed);
    walk->face[i] = c / 3;
    walk->way[i + 1] = walk->way[i] + t;
    walk->point[i + 1] = txm_d3_mad(p, d, t);
    walk->count++;
    walk->corner = s->opposite[exit];
    walk->border = walk->corner < 0;
    if (walk->border) return 1;
    /* in the next face the edge runs the other way, so that its inside lies to the right */
    const txm_dvec3 in = txm_d3_cross(e, s->normal[walk->corner / 3]);
    walk->d = txm_d3_unit(txm_d3_mad(txm_d3_scale(e, cosine), in, sqrt(fmax(0, 1 - cosine * cosine))));
    return 1;
}

/* Walk from the edge opposite to corner c until a flat that is at least that wide is reached, but no
   farther than reach. *first receives the number of its first face, *flat that of its longest one.
   Returns 0 if there is none. */
static int tmr_walk_to_flat(const tmr_surface *s, int32_t c, double reach, double least, tmr_walk *walk,
                            int32_t *first, int32_t *flat) {
    int32_t from = 0;
    tmr_walk_begin(s, c, walk);
    while (!walk->border && walk->way[walk->count] < reach && tmr_walk_on(s, walk)) {
        const int32_t i = walk->count - 1;
        while (tmr_chord(s, walk->face[from], walk->face[i]) > TMR_BAND_BENT) from++;
        if (walk->way[i + 1] - walk->way[from] < least && !walk->border) continue;
        *flat = from;
        for (int32_t k = from; k <= i; k++)
            if (walk->way[k + 1] - walk->way[k] > walk->way[*flat + 1] - walk->way[*flat]) *flat = k;
        *first = from;
        while (tmr_chord(s, walk->face[*first], walk->face[*flat]) > TMR_BAND_EVEN) ++*first;
        return 1;
    }
    return 0;
}

/* the point nearest to q of the line where two planes meet, which are not parallel */
static txm_dvec3 tmr_meet(txm_dvec3 q, const txm_dvec3 normal[2], const txm_dvec3 point[2]) {
    const double g = txm_d3_dot(normal[0], normal[1]);
    const double a = txm_d3_dot(normal[0], txm_d3_sub(point[0], q));
    const double b = txm_d3_dot(normal[1], txm_d3_sub(point[1], q));
    const double inverse = 1 / fmax(1e-6, 1 - g * g);
    return txm_d3_mad(txm_d3_mad(q, normal[0], (a - g * b) * inverse), normal[1],
                      (b - g * a) * inverse);
}

/* The faces and cuts of two walks from one edge, from the flat on the left to that on the right:
   cut[i] lies between face[i] and face[i + 1]. */
typedef struct tmr_profile {
    int32_t count, edge; /* faces; the edge is cut[edge] */
    int32_t face[2 * TMR_WALK_MOST];
    txm_dvec3 cut[2 * TMR_WALK_MOST];
} tmr_profile;

static void tmr_join_walks(const tmr_walk *left, int32_t left_first, int32_t left_flat,
                           const tmr_walk *right, int32_t right_first, int32_t right_flat,
                           tmr_profile *p) {
    memset(p, 0, sizeof *p);
    for (int32_t i = left_first; i >= 0; i--) {
        p->cut[p->count] = left->point[i];
        p->face[p->count++] = left->face[i];
    }
    p->edge = p->count - 1;
    for (int32_t i = 0; i <= right_first; i++) {
        p->cut[p->count] = right->point[i + 1];
        p->face[p->count++] = right->face[i];
    }
    TRIMESH_ASSERT(p->count <= 2 * TMR_WALK_MOST);
    p->face[0] = left->face[left_flat];
    p->face[p->count - 1] = right->face[right_flat];
}

/* Narrow the range of faces low..high, whose ends are flats, until it turns by at most
   TMR_BAND_MOST and has at most one edge that is sharp by itself: its widest face becomes a flat. */
static void tmr_narrow_profile(const tmr_surface *s, const tmr_profile *p, double sharp,
                               int32_t *low, int32_t *high) {
    while (*high - *low >= 2) {
        int count = 0;
        int32_t widest = *low + 1;
        double most = -1;
        for (int32_t i = *low; i < *high; i++)
            count += tmr_chord(s, p->face[i], p->face[i + 1]) >= sharp;
        if (count <= 1 && tmr_chord(s, p->face[*low], p->face[*high]) <= TMR_BAND_MOST) return;
        for (int32_t i = *low + 1; i < *high; i++) {
            const double width = txm_d3_dist2(p->cut[i - 1], p->cut[i]);
            if (width > most) {
                most = width;
                widest = i;
            }
        }
        if (widest <= p->edge) *low = widest;
        else *high = widest;
    }
}

/* Does the range of the profile make a strip? Fill it in. */
static int tmr_measure_band(const tmr_surface *s, const tmr_profile *p, int32_t low, int32_t high,
                            double sharp, double spacing, tmr_band *band) {
    const double turn = tmr_chord(s, p->face[low], p->face[high]);
    double sum = 0;
    if (high - low < 2 || turn < sharp) return 0;
    band->count = 0;
    band->width = 0;
    for (int32_t i = low; i < high; i++) sum += tmr_chord(s, p->face[i], p->face[i + 1]);
    for (int32_t i = low + 1; i < high; i++) {
        band->face[band->count++] = p->face[i];
        band->width += txm_d3_dist(p->cut[i - 1], p->cut[i]);
    }
    if (sum > TMR_BAND_ONE_WAY * turn || band->width > TMR_BAND_WIDTH * spacing) return 0;
    for (int k = 0; k < 2; k++) {
        band->flat[k] = p->face[k ? high : low];
        band->normal[k] = s->normal[band->flat[k]];
        band->point[k] = p->cut[k ? high - 1 : low];
    }
    const txm_dvec3 middle = txm_d3_scale(txm_d3_add(band->point[0], band->point[1]), 0.5);
    const txm_dvec3 meet = tmr_meet(middle, band->normal, band->point), out = txm_d3_sub(meet, middle);
    txm_dvec3 area = txm_d3(0, 0, 0);
    for (int32_t i = low; i + 1 < high; i++)
        area = txm_d3_add(area, txm_d3_area2(meet, p->cut[i], p->cut[i + 1]));
    band->section = 0.5 * txm_d3_len(area);
    if (txm_d3_dot(out, txm_d3_add(band->normal[0], band->normal[1])) < 0)
        band->section = -band->section;
    return txm_d3_len(out) <= TMR_BAND_SHIFT * spacing;
}

/* The wanted edge length at the edge opposite to corner c. */
static double tmr_spacing_at(const tmr_surface *s, int32_t c, double spacing) {
    if (!s->scale) return spacing;
    return spacing * 0.5 *
           (s->scale[s->vertex[tmr_next(c)]] + (double)s->scale[s->vertex[tmr_prev(c)]]);
}

/* Does the surface turn fast enough at the edge opposite to c for a strip? */
static int tmr_turns_fast(const tmr_surface *s, int32_t c, double sharp, double spacing) {
    const int32_t o = s->opposite[c];
    if (o < 0) return 0;
    const double turn = tmr_chord(s, c / 3, o / 3);
    if (turn < TMR_BAND_LEAST) return 0;
    double height = 0;
    for (int side = 0; side < 2; side++) {
        const int32_t *v = s->vertex + 3 * ((side ? o : c) / 3);
        const double area2 =
            txm_d3_len(txm_d3_area2(s->point[v[0]], s->point[v[1]], s->point[v[2]]));
        height = side && height < area2 ? height : area2;
    }
    const double length =
        txm_d3_dist(s->point[s->vertex[tmr_next(c)]], s->point[s->vertex[tmr_prev(c)]]);
    return turn * TMR_BAND_WIDTH * spacing * length > 0.4 * sharp * height;
}

/* Does a flat, at least that wide, begin at the edge opposite to corner c, on its side? */
static int tmr_is_beside_flat(const tmr_surface *s, int32_t c, double least) {
    tmr_walk walk;
    int32_t first, flat;
    return tmr_walk_to_flat(s, c, least, least, &walk, &first, &flat) && first == 0;
}

/* Is the edge opposite to corner c part of a strip? sharp: the turn that makes a crease, as
   tmr_chord has it. */
static int tmr_band_at(const tmr_surface *s, int32_t c, double sharp, double spacing,
                       tmr_band *band) {
    tmr_walk left, right;
    tmr_profile profile;
    int32_t first[2], flat[2];
    spacing = tmr_spacing_at(s, c, spacing);
    if (s->opposite[c] < c) return 0; /* the border, or seen from the other side */
    if (!tmr_turns_fast(s, c, sharp, spacing)) return 0;
    const double reach = (TMR_BAND_WIDTH + TMR_BAND_FLAT) * spacing, least = TMR_BAND_FLAT * spacing;
    if (tmr_is_beside_flat(s, c, least) && tmr_is_beside_flat(s, s->opposite[c], least))
        return 0; /* the usual case, seen from near */
    if (!tmr_walk_to_flat(s, c, reach, least, &left, first, flat) ||
        !tmr_walk_to_flat(s, s->opposite[c], reach, least, &right, first + 1, flat + 1))
        return 0;
    tmr_join_walks(&left, first[0], flat[0], &right, first[1], flat[1], &profile);
    int32_t low = 0, high = profile.count - 1;
    tmr_narrow_profile(s, &profile, sharp, &low, &high);
    return tmr_measure_band(s, &profile, low, high, sharp, spacing, band);
}

/* How wide is the flat that begins at the edge opposite to corner c, on its side? */
static double tmr_flat_width(const tmr_surface *s, int32_t c) {
    tmr_walk walk;
    tmr_walk_begin(s, c, &walk); /* to the border, or as far as a walk goes */
    while (!walk.border && tmr_walk_on(s, &walk))
        if (tmr_chord(s, c / 3, walk.face[walk.count - 1]) > TMR_BAND_BENT)
            return walk.way[walk.count - 1];
    return walk.way[walk.count];
}

/* Is the edge opposite to corner c one of a part, between two flats? They begin there on both sides. A
   single triangle is none: scans consist of such. Of a chamfer and the flat beside it one is much
   wider than the other; facets of a coarse mesh of something round are all alike. */
static int tmr_is_between_flats(const tmr_surface *s, int32_t c, double spacing) {
    double width[2];
    const double least = TMR_BAND_FLAT * tmr_spacing_at(s, c, spacing);
    for (int side = 0; side < 2; side++) {
        const int32_t k = side ? s->opposite[c] : c;
        const int32_t x = s->opposite[tmr_next(k)], y = s->opposite[tmr_prev(k)];
        if ((x < 0 || tmr_chord(s, k / 3, x / 3) > TMR_BAND_SAME) &&
            (y < 0 || tmr_chord(s, k / 3, y / 3) > TMR_BAND_SAME))
            return 0;
        width[side] = tmr_flat_width(s, k);
        if (width[side] < least) return 0;
    }
    return fmax(width[0], width[1]) >= TMR_FLAT_RATIO * fmin(width[0], width[1]);
}

/* ---- creases and borders as lines --------------------------------------------------------- */

/* Creases, seams and borders, cut into lines at the vertices that must stay: where they meet, end or turn
   sharply. A line is a run of segments, each an edge of the surface. */
typedef struct tmr_lines {
    int32_t line_count, segment_count;
    int32_t *first;   /* 1 per line and one more: its first segment                             */
    uint8_t *closed;  /* 1 per line: a loop without a corner                                    */
    uint8_t *border;  /* 1 per line: part of the border                                         */
    double *length;   /* 1 per line                                                             */
    int32_t *a, *b;   /* 1 per segment: its vertices on the surface                             */
    int32_t *face;    /* 1 per segment: a face beside it                                        */
    int32_t *line;    /* 1 per segment                                                          */
    double *start;    /* 1 per segment: distance from the beginning of the line to a            */
    int32_t *edge;    /* 1 per corner of the surface: 0, or 1 + the line that its edge is part of */
    uint8_t *kind;    /* 1 per vertex of the surface: trimesh_kind                              */
    uint8_t *smooth;  /* 1 per vertex of the surface: on seams, without a crease or border      */
    int32_t *segment; /* 1 per vertex of the surface: on a line one of its segments             */
} tmr_lines;

/* the edge opposite to corner c, seen from its vertex v: the other end */
static int32_t tmr_other_end(const tmr_surface *s, int32_t c, int32_t v) {
    const int32_t a = s->vertex[tmr_next(c)], b = s->vertex[tmr_prev(c)];
    return a == v ? b : a;
}

/* how far the surface turns at the edge opposite to c: 1 - cosine of the angle; 0 at the border */
static double tmr_turn_at(const tmr_surface *s, int32_t c) {
    const int32_t o = s->opposite[c];
    return o < 0 ? 0 : 1 - txm_d3_dot(s->normal[c / 3], s->normal[o / 3]);
}

#define TMR_GENTLE_CREASE 0.6 /* ours: see docs/choices.md#creases */

/* Which edges of the surface are creases? Those at which it turns by the angle or more, and clearly
   more than at the other edges of the two triangles, which tells a sharp edge from a coarse mesh:
   there it turns at most half as much. Where three or four edges of two triangles are sharp, as on
   small steps and pins, the angle alone decides if it is wide. Between flats as wide as about half
   an edge of the result, as beside a chamfer, TMR_GENTLE_CREASE of the angle is enough. Writes 1 per
   corner into s->edge_kind. Returns how many edges are creases. */
static size_t tmr_find_creases(tmr_surface *s, double angle, double spacing) {
    const double least = angle >= 180 ? 3 : 1 - txm_cos(angle * (TXM_PI / 180));
    const double gentle = angle >= 180 ? 3 : 1 - txm_cos(TMR_GENTLE_CREASE * angle * (TXM_PI / 180));
    const double sure = fmax(least, 1 - txm_cos(75 * (TXM_PI / 180)));
    size_t count = 0;
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        const int32_t o = s->opposite[c];
        s->edge_kind[c] = o < 0 ? TMR_BORDER_EDGE : TMR_PLAIN_EDGE;
        const double turn = tmr_turn_at(s, c);
        if (o < 0 || turn < gentle) continue;
        /* how much the other edges turn, except those that are as sharp themselves */
        const double around[4] = {tmr_turn_at(s, tmr_next(c)), tmr_turn_at(s, tmr_prev(c)),
                                  tmr_turn_at(s, tmr_next(o)), tmr_turn_at(s, tmr_prev(o))};
        double sum = 0;
        int sharp = 0;
        for (int k = 0; k < 4; k++) {
            sharp += around[k] > 0.5 * turn;
            sum += around[k] > 0.5 * turn ? 0 : around[k];
        }
        if (turn < sure && (sharp > 2 || sum > 0.25 * turn)) continue;
        if (turn < least && !tmr_is_between_flats(s, c, spacing)) continue;
        s->edge_kind[c] = TMR_CREASE_EDGE;
        count++;
    }
    return count / 2;
}

/* One entry per vertex and line edge at it, in the order of the vertices. */
typedef struct tmr_ends {
    int32_t *first;  /* per vertex, and one more */
    int32_t *corner; /* the edge opposite to it  */
} tmr_ends;

/* does this one of an edge's two corners represent it? */
static int tmr_represents_edge(const tmr_surface *s, int32_t c) {
    return s->opposite[c] < c;
}

static txm_status tmr_list_ends(const tmr_surface *s, txm_arena *arena, tmr_ends *ends) {
    const int32_t n = s->vertex_count;
    int32_t total = 0;
    ends->first = (int32_t *)txm_arena_zero(arena, (size_t)n + 2, sizeof(int32_t));
    if (!ends->first) return TXM_OUT_OF_MEMORY;
    int32_t *count = ends->first + 1;
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        if (s->edge_kind[c] == TMR_PLAIN_EDGE || !tmr_represents_edge(s, c)) continue;
        count[s->vertex[tmr_next(c)]]++;
        count[s->vertex[tmr_prev(c)]]++;
        total += 2;
    }
    ends->corner = (int32_t *)txm_arena_alloc(arena, (size_t)total + 1, sizeof(int32_t));
    if (!ends->corner) return TXM_OUT_OF_MEMORY;
    int32_t sum = 0; /* first[v + 1] counts up from the place of v's first entry to its end */
    for (int32_t v = 0; v < n; v++) {
        const int32_t k = count[v];
        count[v] = sum;
        sum += k;
    }
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        if (s->edge_kind[c] == TMR_PLAIN_EDGE || !tmr_represents_edge(s, c)) continue;
        TRIMESH_ASSERT(count[s->vertex[tmr_next(c)]] < total && count[s->vertex[tmr_prev(c)]] < total);
        ends->corner[count[s->vertex[tmr_next(c)]]++] = c;
        ends->corner[count[s->vertex[tmr_prev(c)]]++] = c;
    }
    return TXM_OK;
}

/* Connected lines of less than the given length in all are noise, or cannot be followed: make them
   plain. Those with an edge of one of the kinds in the mask `kept` stay. */
static txm_status tmr_drop_short_lines(tmr_surface *s, const tmr_ends *ends, double least, int kept,
                                       txm_arena *arena) {
    const int32_t n = s->vertex_count;
    int32_t *stack = (int32_t *)txm_arena_alloc(arena, (size_t)n, sizeof(int32_t));
    uint8_t *seen = (uint8_t *)txm_arena_zero(arena, (size_t)n, 1);
    if (!stack || !seen) return TXM_OUT_OF_MEMORY;
    for (int32_t v = 0; v < n; v++) {
        int32_t size = 0, done = 0;
        double length = 0;
        int stays = 0;
        if (seen[v] || ends->first[v] == ends->first[v + 1]) continue;
        seen[v] = 1;
        stack[size++] = v;
        for (; done < size; done++) {
            const int32_t u = stack[done];
            for (int32_t e = ends->first[u]; e < ends->first[u + 1]; e++) {
                const int32_t w = tmr_other_end(s, ends->corner[e], u);
                stays |= s->edge_kind[ends->corner[e]] & kept;
                length += 0.5 * txm_d3_dist(s->point[u], s->point[w]);
                if (!seen[w]) {
                    seen[w] = 1;
                    TRIMESH_ASSERT(size < n);
                    stack[size++] = w;
                }
            }
        }
        if (length >= least || stays) continue;
        for (int32_t i = 0; i < size; i++) {
            for (int32_t e = ends->first[stack[i]]; e < ends->first[stack[i] + 1]; e++) {
                const int32_t c = ends->corner[e];
                s->edge_kind[c] = TMR_PLAIN_EDGE;
                if (s->opposite[c] >= 0) s->edge_kind[s->opposite[c]] = TMR_PLAIN_EDGE;
            }
        }
    }
    return TXM_OK;
}

/* Direction from v along the line that starts with the edge of corner c, over about the distance
   reach, or less if the line branches. */
static txm_dvec3 tmr_line_direction(const tmr_surface *s, const tmr_ends *ends, int32_t v,
                                    int32_t c, double reach) {
    int32_t at = tmr_other_end(s, c, v), e = c;
    for (int i = 0; i < 1000; i++) {
        if (txm_d3_dist2(s->point[at], s->point[v]) >= reach * reach) break;
        if (ends->first[at + 1] - ends->first[at] != 2) break;
        const int32_t k = ends->first[at];
        e = ends->corner[k] == e ? ends->corner[k + 1] : ends->corner[k];
        at = tmr_other_end(s, e, at);
        if (at == v) break;
    }
    if (at == v) at = tmr_other_end(s, c, v);
    return txm_d3_unit(txm_d3_sub(s->point[at], s->point[v]));
}

/* The kind of every vertex; corners where lines meet, end, or turn by more than 40 degrees over
   the distance reach (the sharpest vertex of each bend only). */
static txm_status tmr_find_corners(const tmr_surface *s, const tmr_ends *ends, double reach,
                                   txm_arena *arena, uint8_t *kind) {
    const int32_t n = s->vertex_count;
    float *turn = (float *)txm_arena_zero(arena, (size_t)n, sizeof(float));
    if (!turn) return TXM_OUT_OF_MEMORY;
    for (int32_t v = 0; v < n; v++) {
        const int32_t k = ends->first[v], count = ends->first[v + 1] - k;
        kind[v] = TRIMESH_FREE;
        if (count == 0) continue;
        kind[v] = TRIMESH_CORNER;
        if (count != 2) continue;
        const int32_t c = ends->corner[k], d = ends->corner[k + 1];
        if (tmr_line_class(s->edge_kind[c]) != tmr_line_class(s->edge_kind[d])) continue;
        kind[v] = s->edge_kind[c] == TMR_BORDER_EDGE ? TRIMESH_BORDER : TRIMESH_CREASE;
        turn[v] = (float)(1 + txm_d3_dot(tmr_line_direction(s, ends, v, c, reach),
                                         tmr_line_direction(s, ends, v, d, reach)));
    }
    const float limit = (float)(1 - txm_cos(40 * TXM_PI / 180));
    for (int32_t v = 0; v < n; v++) {
        int sharpest = turn[v] > limit;
        for (int32_t k = ends->first[v]; k < ends->first[v + 1] && sharpest; k++) {
            int32_t at = v, e = ends->corner[k];
            double way = 0;
            for (int i = 0; i < 1000 && sharpest; i++) {
                const int32_t next = tmr_other_end(s, e, at);
                way += txm_d3_dist(s->point[at], s->point[next]);
                at = next;
                if (way > reach || at == v || turn[at] <= 0) break;
                const float other = turn[at], own = turn[v];
                sharpest = other < own || (at >= v && other <= own);
                const int32_t j = ends->first[at];
                e = ends->corner[j] == e ? ends->corner[j + 1] : ends->corner[j];
            }
        }
        if (sharpest) kind[v] = TRIMESH_CORNER;
    }
    return TXM_OK;
}

enum { TMR_TIP_BALL = 64 }; /* vertices around a tip, at most                                  */
#define TMR_TIP_DEFECT 1.3  /* ours: radians of angle missing around a tip                    */

/* 2 pi minus the angles around each vertex: what is missing there for the surface to be flat. */
static void tmr_angle_defects(const tmr_surface *s, float *defect) {
    for (int32_t v = 0; v < s->vertex_count; v++) defect[v] = (float)(2 * TXM_PI);
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        const txm_dvec3 p = s->point[s->vertex[c]];
        const txm_dvec3 a = txm_d3_sub(s->point[s->vertex[tmr_next(c)]], p);
        const txm_dvec3 b = txm_d3_sub(s->point[s->vertex[tmr_prev(c)]], p);
        defect[s->vertex[c]] -= txm_float(txm_atan2(txm_d3_len(txm_d3_cross(a, b)), txm_d3_dot(a, b)));
    }
}

/* Is v the tip of something thinner than an edge, such as a horn? The vertices within reach have a
   large angle defect in all, and none of them lies beyond v along its normal. */
static int tmr_is_tip(const tmr_surface *s, const float *defect, const uint8_t *kind, int32_t v,
                      double reach) {
    int32_t list[TMR_TIP_BALL];
    int count = 1;
    double sum = 0;
    list[0] = v;
    for (int i = 0; i < count; i++) {
        const int32_t u = list[i], first = s->corner[u];
        if (kind[u] != TRIMESH_FREE) return 0;
        if (txm_d3_dot(txm_d3_sub(s->point[u], s->point[v]), s->vertex_normal[v]) > 1e-9) return 0;
        sum += defect[u];
        for (int32_t c = first; c >= 0;) {
            const int32_t x = s->vertex[tmr_next(c)];
            int known = txm_d3_dist2(s->point[x], s->point[v]) > reach * reach;
            for (int j = 0; j < count && !known; j++) known = list[j] == x;
            if (!known && count == TMR_TIP_BALL) return 0;
            if (!known) list[count++] = x;
            c = tmr_ccw(s->opposite, c);
            if (c == first) break;
        }
    }
    return sum >= TMR_TIP_DEFECT;
}

/* Make the tips corners, so that they stay. */
static txm_status tmr_find_tips(const tmr_surface *s, double reach, txm_arena *scratch,
                                uint8_t *kind) {
    float *defect = (float *)txm_arena_alloc(scratch, (size_t)s->vertex_count, sizeof(float));
    if (!defect) return TXM_OUT_OF_MEMORY;
    tmr_angle_defects(s, defect);
    for (int32_t v = 0; v < s->vertex_count; v++)
        if (kind[v] == TRIMESH_FREE && defect[v] > 0 && tmr_is_tip(s, defect, kind, v, reach))
            kind[v] = TRIMESH_CORNER;
    return TXM_OK;
}

/* Add a line: from v over the edge of corner c to its end. */
static void tmr_trace(const tmr_surface *s, const tmr_ends *ends, tmr_lines *l, int32_t v,
                      int32_t c) {
    const int32_t id = l->line_count++, begin = v;
    double length = 0;
    l->first[id] = l->segment_count;
    l->border[id] = s->edge_kind[c] == TMR_BORDER_EDGE;
    for (;;) {
        TRIMESH_ASSERT(l->segment_count < ends->first[s->vertex_count] / 2);
        const int32_t k = l->segment_count++, w = tmr_other_end(s, c, v);
        l->a[k] = v;
        l->b[k] = w;
        l->face[k] = c / 3;
        l->line[k] = id;
        l->start[k] = length;
        length += txm_d3_dist(s->point[v], s->point[w]);
        l->edge[c] = 1 + id;
        if (s->opposite[c] >= 0) l->edge[s->opposite[c]] = 1 + id;
        l->segment[v] = l->segment[w] = k;
        v = w;
        if (v == begin || l->kind[v] == TRIMESH_CORNER) break;
        const int32_t e = ends->first[v];
        c = ends->corner[e] == c ? ends->corner[e + 1] : ends->corner[e];
    }
    l->closed[id] = v == begin && l->kind[v] != TRIMESH_CORNER;
    l->length[id] = length;
    l->first[id + 1] = l->segment_count;
}

/* Is this seam the only line at its end opposite to v? */
static int tmr_is_spoke(const tmr_surface *s, const tmr_ends *ends, int32_t v, int32_t c) {
    const int32_t w = tmr_other_end(s, c, v);
    return s->edge_kind[c] == TMR_SEAM_EDGE && ends->first[w + 1] - ends->first[w] == 1;
}

/* At the pole of a globe each triangle has texture coordinates of its own, and all edges there are seams
   that end at once: spokes, which are no cuts. Make plain those of vertices with two or more. */
static void tmr_drop_spokes(tmr_surface *s, const tmr_ends *ends) {
    for (int32_t v = 0; v < s->vertex_count; v++) {
        int spokes = 0;
        for (int32_t e = ends->first[v]; e < ends->first[v + 1]; e++)
            spokes += tmr_is_spoke(s, ends, v, ends->corner[e]);
        for (int32_t e = ends->first[v]; e < ends->first[v + 1] && spokes > 1; e++) {
            const int32_t c = ends->corner[e];
            if (!tmr_is_spoke(s, ends, v, c)) continue;
            s->edge_kind[c] = s->edge_kind[s->opposite[c]] = TMR_PLAIN_EDGE;
        }
    }
}

/* Find creases and seams, and list the ends of the edges that stay. */
static txm_status tmr_find_lines(tmr_surface *s, const trimesh_desc *desc, double angle,
                                 double spacing, txm_arena *scratch, tmr_ends *ends) {
    txm_status status;
    if (tmr_find_creases(s, angle, spacing)) {
        if ((status = tmr_list_ends(s, scratch, ends)) != TXM_OK) return status;
        status = tmr_drop_short_lines(s, ends, fmax(5 * spacing, 0.06), TMR_BORDER_EDGE, scratch);
        if (status != TXM_OK) return status;
    }
    if (desc->seams) {
        tmr_mark_seams(s, desc);
        if ((status = tmr_list_ends(s, scratch, ends)) != TXM_OK) return status;
        tmr_drop_spokes(s, ends);
        if ((status = tmr_list_ends(s, scratch, ends)) != TXM_OK) return status;
        status = tmr_drop_short_lines(s, ends, TMR_SHORTEST_SEAM * spacing,
                                      TMR_BORDER_EDGE | TMR_CREASE_EDGE, scratch);
        if (status != TXM_OK) return status;
    }
    return tmr_list_ends(s, scratch, ends);
}

/* Which vertices are on seams only? There the surface is smooth. */
static void tmr_find_smooth(const tmr_surface *s, const tmr_ends *ends, uint8_t *smooth) {
    for (int32_t v = 0; v < s->vertex_count; v++) {
        int kinds = 0;
        for (int32_t e = ends->first[v]; e < ends->first[v + 1]; e++)
            kinds |= s->edge_kind[ends->corner[e]];
        smooth[v] = kinds == TMR_SEAM_EDGE;
    }
}

/* Count the edges of creases and seams for the report. */
static void tmr_count_lines(const tmr_surface *s, trimesh_report *report) {
    report->crease_edges = report->seam_edges = 0;
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        if (!tmr_represents_edge(s, c)) continue;
        report->crease_edges += (s->edge_kind[c] & TMR_CREASE_EDGE) != 0;
        report->seam_edges += (s->edge_kind[c] & TMR_SEAM_EDGE) != 0;
    }
}

/* Find all lines. spacing: the edge length of the result, which decides which creases are too short
   and which bends too slight. */
static txm_status tmr_lines_build(tmr_surface *s, const trimesh_desc *desc, double angle,
                                  double spacing, txm_arena *arena, txm_arena *scratch,
                                  trimesh_report *report, tmr_lines *l) {
    tmr_ends ends;
    const size_t n = (size_t)s->vertex_count, corners = 3 * (size_t)s->face_count;
    txm_status status;
    if ((status = tmr_find_lines(s, desc, angle, spacing, scratch, &ends)) != TXM_OK) return status;
    /* each edge is listed at both its ends and becomes one segment; no line is without segments */
    const size_t segments = (size_t)ends.first[s->vertex_count] / 2;
    l->line_count = l->segment_count = 0;
    l->first = (int32_t *)txm_arena_zero(arena, segments + 1, sizeof(int32_t));
    l->closed = (uint8_t *)txm_arena_alloc(arena, segments + 1, 1);
    l->border = (uint8_t *)txm_arena_alloc(arena, segments + 1, 1);
    l->length = (double *)txm_arena_alloc(arena, segments + 1, sizeof(double));
    l->a = (int32_t *)txm_arena_alloc(arena, segments + 1, sizeof(int32_t));
    l->b = (int32_t *)txm_arena_alloc(arena, segments + 1, sizeof(int32_t));
    l->face = (int32_t *)txm_arena_alloc(arena, segments + 1, sizeof(int32_t));
    l->line = (int32_t *)txm_arena_alloc(arena, segments + 1, sizeof(int32_t));
    l->start = (double *)txm_arena_alloc(arena, segments + 1, sizeof(double));
    l->edge = (int32_t *)txm_arena_zero(arena, corners, sizeof(int32_t));
    l->kind = (uint8_t *)txm_arena_alloc(arena, n, 1);
    l->smooth = (uint8_t *)txm_arena_alloc(arena, n, 1);
    l->segment = (int32_t *)txm_arena_zero(arena, n, sizeof(int32_t));
    if ((status = tmr_check_memory(arena)) != TXM_OK) return status;
    tmr_find_smooth(s, &ends, l->smooth);
    status = tmr_find_corners(s, &ends, 0.75 * spacing, scratch, l->kind);
    if (status == TXM_OK && angle < 180)
        status = tmr_find_tips(s, 0.75 * spacing, scratch, l->kind);
    if (status != TXM_OK) return status;
    for (int pass = 0; pass < 2; pass++) { /* lines from corners; then closed ones  */
        for (int32_t v = 0; v < s->vertex_count; v++) {
            if ((l->kind[v] == TRIMESH_CORNER) != (pass == 0)) continue;
            for (int32_t k = ends.first[v]; k < ends.first[v + 1]; k++)
                if (!l->edge[ends.corner[k]]) tmr_trace(s, &ends, l, v, ends.corner[k]);
        }
    }
    tmr_count_lines(s, report);
    return TXM_OK;
}

/* Is segment k part of a seam where the surface is smooth? */
static int tmr_is_smooth_segment(const tmr_lines *l, int32_t k) {
    return l->smooth[l->a[k]] && l->smooth[l->b[k]];
}

/* the segment behind (step 1) or before (-1) segment k of its line; -1 at the end */
static int32_t tmr_segment_step(const tmr_lines *l, int32_t k, int step) {
    const int32_t line = l->line[k], first = l->first[line], last = l->first[line + 1] - 1;
    if (step > 0 && k == last) return l->closed[line] ? first : -1;
    if (step < 0 && k == first) return l->closed[line] ? last : -1;
    return k + step;
}

/* The place on the line nearest to p, found by walking from segment *k while the distance falls. */
static txm_dvec3 tmr_project_line(const tmr_surface *s, const tmr_lines *l, txm_dvec3 p,
                                  int32_t *k) {
    txm_dvec3 best = p;
    double least = -1;
    int direction = 0;
    for (int32_t i = *k, guard = l->segment_count + 1; i >= 0 && guard > 0; guard--) {
        const txm_dvec3 a = s->point[l->a[i]], ab = txm_d3_sub(s->point[l->b[i]], a);
        const double t = txm_d3_dot(txm_d3_sub(p, a), ab) / (txm_d3_len2(ab) + 1e-300);
        const txm_dvec3 q = txm_d3_mad(a, ab, t < 0 ? 0 : t > 1 ? 1 : t);
        const double d = txm_d3_dist2(p, q);
        if (least >= 0 && d >= least) break;
        least = d;
        best = q;
        *k = i;
        const int step = t < 0 ? -1 : t > 1 ? 1 : 0;
        if (step == 0 || step == -direction) break;
        direction = step;
        i = tmr_segment_step(l, i, step);
    }
    return best;
}

/* the place on a line at the distance from its beginning; *k: the segment it lies on */
static txm_dvec3 tmr_line_at(const tmr_surface *s, const tmr_lines *l, int32_t line, double way,
                             int32_t *k) {
    int32_t low = l->first[line], high = l->first[line + 1] - 1;
    while (low < high) { /* the last segment that starts at way or before */
        const int32_t middle = (low + high + 1) / 2;
        if (l->start[middle] <= way) low = middle;
        else high = middle - 1;
    }
    const double end = low + 1 < l->first[line + 1] ? l->start[low + 1] : l->length[line];
    const double span = end - l->start[low];
    double t = span > 0 ? (way - l->start[low]) / span : 0;
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    *k = low;
    const txm_dvec3 a = s->point[l->a[low]];
    return txm_d3_mad(a, txm_d3_sub(s->point[l->b[low]], a), t);
}

/* how far from the beginning of its line a place on segment k lies */
static double tmr_line_way(const tmr_surface *s, const tmr_lines *l, txm_dvec3 p, int32_t k) {
    return l->start[k] + txm_d3_dist(s->point[l->a[k]], p);
}

/* ---- density ------------------------------------------------------------------------------ */

enum { TMR_GRADE_SWEEPS = 12 };   /* ours: for the limit on how fast the edge length may change   */
#define TMR_TURN_PER_EDGE 0.6     /* ours: radians that one edge may turn where density adapts    */
#define TMR_LEAST_SIZE 0.2        /* ours: the shortest edges where it adapts fully               */

/* The edge length, where the scale is 1, of a mesh of so many vertices: a triangle of edge L has
   the area sqrt(3) / 4 L^2, and there are two triangles per vertex. */
static double tmr_spacing(const tmr_surface *s, double vertices) {
    double sum = 0;
    for (int32_t f = 0; f < s->face_count && s->scale; f++) {
        const int32_t *v = s->vertex + 3 * f;
        const double scale = (s->scale[v[0]] + (double)s->scale[v[1]] + s->scale[v[2]]) / 3;
        const txm_dvec3 n = txm_d3_area2(s->point[v[0]], s->point[v[1]], s->point[v[2]]);
        sum += 0.5 * txm_d3_len(n) / (scale * scale);
    }
    return sqrt((s->scale ? sum : s->area) / vertices * 1.1547005383792515);
}

/* Normalize the scale: the same number of vertices shall give the same spacing where it is 1 as
   without a scale. */
static void tmr_normalize_scale(tmr_surface *s) {
    if (!s->scale) return;
    const double factor = tmr_spacing(s, 1) / sqrt(s->area * 1.1547005383792515);
    for (int32_t v = 0; v < s->vertex_count; v++) s->scale[v] = txm_float(s->scale[v] * factor);
}

/* Curvature at every vertex: the largest change of the normal per unit of length along an edge. */
static void tmr_curvature(const tmr_surface *s, float *curvature) {
    for (int32_t v = 0; v < s->vertex_count; v++) curvature[v] = 0;
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        const int32_t a = s->vertex[tmr_next(c)], b = s->vertex[tmr_prev(c)];
        const double length = txm_d3_dist(s->point[a], s->point[b]);
        if (length <= 0) continue;
        const float k = txm_float(txm_d3_dist(s->vertex_normal[a], s->vertex_normal[b]) / length);
        curvature[a] = txm_maxf(curvature[a], k);
        curvature[b] = txm_maxf(curvature[b], k);
    }
}

/* Shorten the wanted edge lengths until they grow by no more than d / 3 over a distance d. */
static void tmr_grade_scale(const tmr_surface *s, double spacing, float *scale) {
    for (int sweep = 0; sweep < TMR_GRADE_SWEEPS; sweep++) {
        for (int32_t i = 0; i < 3 * s->face_count; i++) {
            const int32_t c = sweep % 2 ? 3 * s->face_count - 1 - i : i;
            const int32_t a = s->vertex[tmr_next(c)], b = s->vertex[tmr_prev(c)];
            const double d = txm_d3_dist(s->point[a], s->point[b]) / spacing / 3;
            scale[a] = txm_minf(scale[a], txm_float(scale[b] + d));
            scale[b] = txm_minf(scale[b], txm_float(scale[a] + d));
        }
    }
}

/* Shorten the wanted edge lengths where the surface bends, fully or in part (adapt), so that an
   edge turns by no more than TMR_TURN_PER_EDGE. */
static txm_status tmr_adapt_scale(tmr_surface *s, double spacing, double adapt, txm_arena *arena,
                                  txm_arena *scratch) {
    const size_t n = (size_t)s->vertex_count;
    float *curvature = (float *)txm_arena_alloc(scratch, n, sizeof(float));
    float *scale = (float *)txm_arena_alloc(arena, n, sizeof(float));
    if (!curvature || !scale) return TXM_OUT_OF_MEMORY;
    tmr_curvature(s, curvature);
    for (size_t v = 0; v < n; v++) {
        const double wanted = curvature[v] > 0 ? TMR_TURN_PER_EDGE / curvature[v] / spacing : 1;
        const double limited = wanted < TMR_LEAST_SIZE ? TMR_LEAST_SIZE : wanted > 1 ? 1 : wanted;
        scale[v] = txm_float((s->scale ? s->scale[v] : 1) * (1 - adapt + adapt * limited));
    }
    tmr_grade_scale(s, spacing, scale);
    s->scale = scale;
    return TXM_OK;
}

/* ---- pieces: how many vertices each needs, and which are dropped --------------------------- */

/* Scans have crumbs: pieces so small that their share of the vertices is less than any piece needs.
   Hundreds of them would take the vertices of the body. So the largest are kept while what they take
   beyond their share stays small, and the others are dropped. If there is no body, that is, if crumbs
   are a good part of the surface, all are kept. */

#define TMR_CRUMB 4         /* ours: vertices that a piece is worth by its area                  */
#define TMR_CRUMB_ROOM 0.05 /* ours: part of the vertices that crumbs may take beyond their share */
#define TMR_CRUMB_FEW 16    /* ours: or so many, if they are at most                             */
#define TMR_CRUMB_PART 0.25 /* this part of all                                                  */
#define TMR_CRUMB_AREA 0.1  /* ours: part of the surface that is dropped at most                 */

typedef struct tmr_piece {
    double area;   /* scaled units */
    double volume; /* inside: its part of that of the surface                */
    double weight; /* area relative to the square of the wanted edge length */
    double euler;  /* characteristic, its border loops not closed            */
    double loops;  /* border loops */
    double fixed;  /* vertices that its lines need at least: corners, and more on loops */
    double least;  /* vertices that it needs at least */
    int is_dropped;
} tmr_piece;

/* The least number of vertices for a piece. Closed, Heawood's bound: 4 for a sphere, 7 for a torus;
   each border loop has 3 of its own. */
static double tmr_piece_least(const tmr_piece *p) {
    const double heawood = ceil((7 + sqrt(fmax(49 - 24 * (p->euler + p->loops), 1))) / 2);
    return fmax(p->fixed, p->loops > 0 ? 3 * p->loops : heawood);
}

static txm_status tmr_measure_pieces(const tmr_surface *s, const tmr_lines *l, tmr_piece *pieces,
                                     txm_arena *scratch) {
    uint8_t *seen = (uint8_t *)txm_arena_zero(scratch, 3 * (size_t)s->face_count, 1);
    if (!seen) return TXM_OUT_OF_MEMORY;
    memset(pieces, 0, (size_t)s->component_count * sizeof *pieces);
    for (int32_t f = 0; f < s->face_count; f++) {
        const int32_t *v = s->vertex + 3 * f;
        tmr_piece *p = pieces + s->component[f];
        const double area =
            0.5 * txm_d3_len(txm_d3_area2(s->point[v[0]], s->point[v[1]], s->point[v[2]]));
        const double size =
            s->scale ? (s->scale[v[0]] + (double)s->scale[v[1]] + s->scale[v[2]]) / 3 : 1;
        p->area += area;
        p->volume += txm_d3_dot(s->point[v[0]], txm_d3_area2(s->point[v[0]], s->point[v[1]],
                                                             s->point[v[2]])) / 6;
        p->weight += area / (size * size);
        p->euler -= 0.5; /* a face and its three halves of edges; 1/2 more for each border edge */
        for (int32_t c = 3 * f; c < 3 * f + 3; c++) {
            if (s->opposite[c] >= 0) continue;
            p->euler -= 0.5;
            p->loops += !seen[c];
            for (int32_t k = c; !seen[k]; k = tmr_next_border(s, k)) seen[k] = 1;
        }
    }
    for (int32_t v = 0; v < s->vertex_count; v++) {
        tmr_piece *p = pieces + s->component[s->corner[v] / 3];
        p->euler++;
        p->fixed += l->kind[v] == TRIMESH_CORNER;
    }
    for (int32_t i = 0; i < l->line_count; i++) { /* a loop has three edges */
        const int32_t first = l->first[i], last = l->first[i + 1] - 1;
        tmr_piece *p = pieces + s->component[l->face[first]];
        p->fixed += l->closed[i] ? 3 : l->a[first] == l->b[last] ? 2 : 0;
    }
    for (int32_t i = 0; i < s->component_count; i++) pieces[i].least = tmr_piece_least(pieces + i);
    return TXM_OK;
}

/* Choose the crumbs to be dropped. all: the weight of all pieces. */
static txm_status tmr_choose_crumbs(const tmr_surface *s, double vertices, double all,
                                    tmr_piece *pieces, txm_arena *scratch) {
    const size_t n = (size_t)s->component_count;
    txm_pair *order = (txm_pair *)txm_arena_alloc(scratch, 2 * n, sizeof(txm_pair));
    const double room =
        fmax(TMR_CRUMB_ROOM * vertices, fmin(TMR_CRUMB_FEW, TMR_CRUMB_PART * vertices));
    double more = 0, crumbs = 0;
    size_t count = 0;
    if (!order) return TXM_OUT_OF_MEMORY;
    for (size_t i = 0; i < n; i++) {
        const double worth = pieces[i].weight / all * vertices;
        if (pieces[i].is_dropped || worth >= TMR_CRUMB) continue;
        order[count].key = ~txm_sort_key(txm_float(pieces[i].weight)); /* the largest first */
        order[count++].value = (uint32_t)i;
        more += fmax(pieces[i].least - worth, 0);
        crumbs += pieces[i].weight;
    }
    if (more <= room || crumbs > TMR_CRUMB_AREA * all) return TXM_OK;
    txm_sort_pairs(order, order + n, count);
    more = 0;
    for (size_t i = 0; i < count; i++) {
        tmr_piece *p = pieces + order[i].value;
        more += fmax(p->least - p->weight / all * vertices, 0);
        p->is_dropped = more > room;
    }
    return TXM_OK;
}

/* Remove the pieces that are dropped from the surface. */
static txm_status tmr_drop_pieces(tmr_surface *s, const tmr_piece *pieces, trimesh_report *report,
                                  txm_arena *scratch) {
    const size_t n = (size_t)s->face_count;
    int32_t *face = (int32_t *)txm_arena_alloc(scratch, n, sizeof(int32_t));
    int32_t *vertex = (int32_t *)txm_arena_alloc(scratch, (size_t)s->vertex_count, sizeof(int32_t));
    int32_t *piece =
        (int32_t *)txm_arena_alloc(scratch, (size_t)s->component_count, sizeof(int32_t));
    int32_t faces = 0, vertices = 0, count = 0;
    if (!face || !vertex || !piece) return TXM_OUT_OF_MEMORY;
    for (int32_t i = 0; i < s->component_count; i++)
        piece[i] = pieces[i].is_dropped ? -1 : count++;
    for (int32_t f = 0; f < s->face_count; f++)
        face[f] = piece[s->component[f]] < 0 ? -1 : faces++;
    for (int32_t v = 0; v < s->vertex_count; v++)
        vertex[v] = face[s->corner[v] / 3] < 0 ? -1 : vertices++;
    for (int32_t v = 0; v < s->vertex_count; v++) { /* downwards only: nothing is overwritten early */
        const int32_t to = vertex[v];
        if (to < 0) continue;
        s->point[to] = s->point[v];
        s->vertex_normal[to] = s->vertex_normal[v];
        s->corner[to] = 3 * face[s->corner[v] / 3] + s->corner[v] % 3;
        if (s->scale) s->scale[to] = s->scale[v];
    }
    for (int32_t f = 0; f < s->face_count; f++) {
        const int32_t to = face[f];
        if (to < 0) continue;
        for (int32_t k = 0; k < 3; k++) {
            const int32_t o = s->opposite[3 * f + k];
            s->vertex[3 * to + k] = vertex[s->vertex[3 * f + k]];
            s->opposite[3 * to + k] = o < 0 ? -1 : 3 * face[o / 3] + o % 3;
            if (s->section) s->section[3 * to + k] = s->section[3 * f + k];
        }
        s->normal[to] = s->normal[f];
        s->component[to] = piece[s->component[f]];
        s->origin[to] = s->origin[f];
        s->turn[to] = s->turn[f];
    }
    for (int32_t i = 0; i < s->component_count; i++) {
        const tmr_piece *p = pieces + i;
        if (!p->is_dropped) continue;
        s->volume -= p->volume;
        report->dropped++;
        report->dropped_area += p->area / s->area;
        report->euler -= (long)floor(p->euler + 0.5);
        report->loops -= (size_t)p->loops;
    }
    s->area *= 1 - report->dropped_area;
    s->border_count = 0;
    for (int32_t c = 0; c < 3 * faces; c++) s->border_count += s->opposite[c] < 0;
    s->loop_count = (int32_t)report->loops;
    s->face_count = faces;
    s->vertex_count = vertices;
    s->component_count = count;
    report->components = (size_t)count;
    report->vertices = (size_t)vertices;
    report->triangles = (size_t)faces;
    return TXM_OK;
}

/* Drop the pieces below the caller's share of the area, and crumbs.

   vertices  of the result
   again     non-zero: this was done before; only count
   least     receives how many vertices the others need at least
   dropped   receives non-zero if any was dropped: then the lines must be built again         */
static txm_status tmr_settle_pieces(tmr_surface *s, const tmr_lines *l, const trimesh_desc *desc,
                                    double vertices, trimesh_report *report, txm_arena *scratch,
                                    int again, double *least, int *dropped) {
    tmr_piece *pieces =
        (tmr_piece *)txm_arena_alloc(scratch, (size_t)s->component_count, sizeof(tmr_piece));
    double all = 0;
    int32_t largest = 0;
    if (!pieces) return TXM_OUT_OF_MEMORY;
    txm_status status = tmr_measure_pieces(s, l, pieces, scratch);
    if (status != TXM_OK) return status;
    for (int32_t i = 0; i < s->component_count; i++)
        if (pieces[i].area > pieces[largest].area) largest = i;
    for (int32_t i = 0; i < s->component_count; i++) { /* one is always kept */
        pieces[i].is_dropped = !again && i != largest && pieces[i].area < desc->drop_below * s->area;
        all += pieces[i].is_dropped ? 0 : pieces[i].weight;
    }
    if (!again) status = tmr_choose_crumbs(s, vertices, all, pieces, scratch);
    if (status != TXM_OK) return status;
    *least = 0;
    *dropped = 0;
    for (int32_t i = 0; i < s->component_count; i++) {
        *least += pieces[i].is_dropped ? 0 : pieces[i].least;
        *dropped |= pieces[i].is_dropped;
    }
    return *dropped ? tmr_drop_pieces(s, pieces, report, scratch) : TXM_OK;
}

/* Find the lines; drop pieces, and then find them again. vertices: of the result; spacing: as
   tmr_lines_build has it. least: receives how many vertices the pieces that are left need. */
static txm_status tmr_settle_lines(tmr_surface *s, const trimesh_desc *desc, double vertices,
                                   double angle, double spacing, txm_arena *arena,
                                   txm_arena *scratch, trimesh_report *report, tmr_lines *l,
                                   double *least) {
    int dropped = 1;
    for (int round = 0; dropped && round < 2; round++) {
        txm_status status =
            tmr_lines_build(s, desc, angle, spacing, arena, scratch, report, l);
        if (status == TXM_OK)
            status = tmr_settle_pieces(s, l, desc, vertices, report, scratch, round, least, &dropped);
        if (status != TXM_OK) return status;
    }
    return TXM_OK;
}

/* ---- the mesh that changes ---------------------------------------------------------------- */

/* Flags of a vertex besides the trimesh_kind in the lowest two bits. */
enum {
    TMR_KIND = 3,
    TMR_GHOST = 4,
    TMR_MARK = 8,
    TMR_PINNED = 16 /* for updates: this vertex, and edges between such, must stay      */
};

enum { TMR_VALENCE = 60 }; /* no operation gives a vertex more neighbours               */

/* A closed manifold at every moment: each border loop is closed by a ghost vertex joined to all of
   the loop, so that the operators need no special case for borders. Corners as in tmr_surface; a
   dead triangle has vertex -1 in its first corner, a dead vertex corner -1.

                        ghost
                       /  |  \          ghost triangles, which stay out of all geometry
                 -----a---b---c-----    the border, each with the number of its line            */
typedef struct tmr_mesh {
    int32_t vertex_count, face_count; /* slots in use, including dead ones                      */
    int32_t vertex_limit, face_limit; /* slots allocated                                        */
    int32_t live, ghosts;             /* live vertices without ghosts; ghosts                   */
    int32_t live_faces;               /* live triangles, including ghost triangles              */
    txm_dvec3 *p;                     /* position                                               */
    txm_dvec3 *n;                     /* normal of the surface there, smooth                    */
    int32_t *source; /* face of the surface that p lies in; of a vertex on a line its segment;
                        of a vertex that never moves: its vertex of the surface                */
    int32_t *corner;                  /* one corner                                             */
    uint8_t *flags;
    int32_t *valence; /* neighbours, including ghosts                                           */
    int32_t *vertex, *opposite; /* of corners                                                   */
    int32_t *edge;              /* of corners: 0, or 1 + the line that their edge is part of    */
} tmr_mesh;

/* the corner at the same vertex in the next triangle counter-clockwise */
static int32_t tmr_swing(const tmr_mesh *m, int32_t c) {
    return tmr_next(m->opposite[tmr_next(c)]);
}
static int tmr_is_dead(const tmr_mesh *m, int32_t face) {
    return m->vertex[3 * face] < 0;
}
static int tmr_is_ghost(const tmr_mesh *m, int32_t v) {
    return m->flags[v] & TMR_GHOST;
}
static int tmr_is_ghost_face(const tmr_mesh *m, int32_t face) {
    const int32_t *v = m->vertex + 3 * face;
    return (m->flags[v[0]] | m->flags[v[1]] | m->flags[v[2]]) & TMR_GHOST;
}
static int tmr_kind_of(const tmr_mesh *m, int32_t v) {
    return m->flags[v] & TMR_KIND;
}

static void tmr_link(tmr_mesh *m, int32_t a, int32_t b, int32_t line) {
    m->opposite[a] = b;
    m->opposite[b] = a;
    m->edge[a] = m->edge[b] = line;
}
/* the corner at a of the triangle in which b comes next; -1 if a and b are not neighbours */
static int32_t tmr_find_edge(const tmr_mesh *m, int32_t a, int32_t b) {
    const int32_t first = m->corner[a];
    int32_t c = first;
    do {
        if (m->vertex[tmr_next(c)] == b) return c;
        c = tmr_swing(m, c);
    } while (c != first);
    return -1;
}

/* Are a and b neighbours? Looks around the one that is not a ghost. */
static int tmr_are_neighbors(const tmr_mesh *m, int32_t a, int32_t b) {
    if (tmr_is_ghost(m, a)) return tmr_is_ghost(m, b) ? 0 : tmr_find_edge(m, b, a) >= 0;
    return tmr_find_edge(m, a, b) >= 0;
}

/* May the edge opposite to c be flipped? Looks at the topology only. */
static int tmr_can_flip(const tmr_mesh *m, int32_t c) {
    const int32_t o = m->opposite[c], d = m->vertex[c], e = m->vertex[o];
    const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
    if (m->edge[c] != 0) return 0;
    if ((m->flags[a] | m->flags[b] | m->flags[d] | m->flags[e]) & TMR_GHOST) return 0;
    if (m->flags[a] & m->flags[b] & m->flags[d] & m->flags[e] & TMR_PINNED) return 0;
    if (m->valence[a] <= 3 || m->valence[b] <= 3) return 0;
    if (m->valence[d] >= TMR_VALENCE || m->valence[e] >= TMR_VALENCE) return 0;
    return !tmr_are_neighbors(m, d, e);
}

/* Flip the edge opposite to c:

          d (c)                 d
         /   \                / | \
        a --- b     ->       a  |  b
         \   /                \ | /
          e (o)                 e                                                              */
static void tmr_flip(tmr_mesh *m, int32_t c) {
    const int32_t o = m->opposite[c];
    const int32_t cn = tmr_next(c), cp = tmr_prev(c), on = tmr_next(o), op = tmr_prev(o);
    const int32_t a = m->vertex[cn], b = m->vertex[cp], d = m->vertex[c], e = m->vertex[o];
    /* outer edges: opposite to cn is b d, to cp is d a, to on is a e, to op is e b */
    const int32_t bd = m->opposite[cn], ae = m->opposite[on];
    const int32_t bd_line = m->edge[cn], ae_line = m->edge[on];
    /* c's triangle becomes d a e: c = d, cn = a, cp = e; o's becomes e b d */
    m->vertex[cp] = e;
    m->vertex[op] = d;
    /* in (d, a, e): opposite to d is a e, to a is e d, to e is d a (as before) */
    tmr_link(m, c, ae, ae_line);
    tmr_link(m, o, bd, bd_line);
    tmr_link(m, cn, on, 0);
    m->corner[a] = cn;
    m->corner[b] = on;
    m->corner[d] = c;
    m->corner[e] = o;
    m->valence[a]--;
    m->valence[b]--;
    m->valence[d]++;
    m->valence[e]++;
}

static int32_t tmr_new_vertex(tmr_mesh *m) {
    const int32_t v = m->vertex_count++;
    m->live++;
    return v;
}

/* Put a new vertex on the edge opposite to c, without its geometry. Returns -1 if there is no room.

          d (c)                 d
         /   \                / | \
        a --- b     ->       a--v--b
         \   /                \ | /
          e (o)                 e                                                              */
static int32_t tmr_split(tmr_mesh *m, int32_t c) {
    if (m->vertex_count >= m->vertex_limit || m->face_count + 2 > m->face_limit) return -1;
    const int32_t o = m->opposite[c], kind = m->edge[c];
    const int32_t cn = tmr_next(c), op = tmr_prev(o);
    const int32_t b = m->vertex[tmr_prev(c)], d = m->vertex[c], e = m->vertex[o];
    const int32_t v = tmr_new_vertex(m), f = 3 * m->face_count, g = f + 3;
    const int32_t bd = m->opposite[cn], eb = m->opposite[op];
    const int32_t bd_line = m->edge[cn], eb_line = m->edge[op];
    m->face_count += 2;
    m->live_faces += 2;
    /* c's triangle (d, a, b) becomes (d, a, v), o's (e, b, a) becomes (e, v, a);
       new ones f = (d, v, b) and g = (e, b, v) */
    m->vertex[f] = d;
    m->vertex[f + 1] = v;
    m->vertex[f + 2] = b;
    m->vertex[g] = e;
    m->vertex[g + 1] = b;
    m->vertex[g + 2] = v;
    m->vertex[tmr_prev(c)] = v;
    m->vertex[tmr_next(o)] = v;
    tmr_link(m, c, o, kind);
    tmr_link(m, f, g, kind);
    tmr_link(m, f + 1, bd, bd_line); /* opposite to v in f: b d */
    tmr_link(m, g + 2, eb, eb_line); /* opposite to v in g: e b */
    tmr_link(m, f + 2, cn, 0); /* opposite to b in f: d v; to a in c's triangle: v d */
    tmr_link(m, g + 1, op, 0); /* opposite to b in g: v e; to a in o's triangle: e v */
    m->corner[v] = f + 1;
    m->corner[b] = f + 2;
    m->corner[d] = c;
    m->corner[e] = o;
    m->corner[m->vertex[cn]] = cn;
    m->valence[v] = 4;
    m->flags[v] = 0;
    m->valence[d]++;
    m->valence[e]++;
    return v;
}

/* Put a new vertex into a triangle, without its geometry. Returns -1 if there is no room. */
static int32_t tmr_split_face(tmr_mesh *m, int32_t face) {
    if (m->vertex_count >= m->vertex_limit || m->face_count + 2 > m->face_limit) return -1;
    const int32_t i = 3 * face, f = 3 * m->face_count, g = f + 3;
    const int32_t a = m->vertex[i], b = m->vertex[i + 1], c = m->vertex[i + 2];
    const int32_t v = tmr_new_vertex(m);
    const int32_t ca = m->opposite[i + 1], ab = m->opposite[i + 2];
    const int32_t ca_line = m->edge[i + 1], ab_line = m->edge[i + 2];
    m->face_count += 2;
    m->live_faces += 2;
    /* (a, b, c) becomes (v, b, c); new ones f = (a, v, c), g = (a, b, v) */
    m->vertex[i] = v;
    m->vertex[f] = a;
    m->vertex[f + 1] = v;
    m->vertex[f + 2] = c;
    m->vertex[g] = a;
    m->vertex[g + 1] = b;
    m->vertex[g + 2] = v;
    tmr_link(m, f + 1, ca, ca_line);
    tmr_link(m, g + 2, ab, ab_line);
    tmr_link(m, f, i + 1, 0);     /* v c */
    tmr_link(m, f + 2, g + 1, 0); /* a v */
    tmr_link(m, g, i + 2, 0);     /* b v */
    m->corner[v] = i;
    m->corner[a] = f;
    m->corner[b] = i + 1;
    m->corner[c] = i + 2;
    m->valence[v] = 3;
    m->flags[v] = 0;
    m->valence[a]++;
    m->valence[b]++;
    m->valence[c]++;
    return v;
}

/* May b = vertex[prev(c)] be merged into a = vertex[next(c)], so that the mesh stays a manifold of
   the same topology, with the same creases and borders? The link condition: a and b have only the
   two neighbours d and e in common. Costs O(valence). */
static int tmr_can_collapse(tmr_mesh *m, int32_t c) {
    const int32_t o = m->opposite[c], cn = tmr_next(c), cp = tmr_prev(c);
    const int32_t a = m->vertex[cn], b = m->vertex[cp], d = m->vertex[c], e = m->vertex[o];
    const int on = m->edge[c] != 0, kind = tmr_kind_of(m, b);
    int common = 0;
    if ((m->flags[a] | m->flags[b]) & TMR_GHOST) return 0;
    if (kind == TRIMESH_CORNER || ((m->flags[a] | m->flags[b]) & TMR_PINNED)) return 0;
    if (kind != TRIMESH_FREE && !on) return 0;
    /* two lines must not become one: d's two sides merge */
    if (m->edge[cn] != 0 && m->edge[cp] != 0) return 0;
    if (m->edge[tmr_next(o)] != 0 && m->edge[tmr_prev(o)] != 0) return 0;
    if (m->valence[d] <= 3 || m->valence[e] <= 3) return 0;
    if (m->valence[a] + m->valence[b] - 4 > TMR_VALENCE) return 0;
    int32_t i = cn;
    do {
        m->flags[m->vertex[tmr_next(i)]] |= TMR_MARK;
        i = tmr_swing(m, i);
    } while (i != cn);
    i = cp;
    do {
        common += (m->flags[m->vertex[tmr_next(i)]] & TMR_MARK) != 0;
        i = tmr_swing(m, i);
    } while (i != cp);
    i = cn;
    do {
        m->flags[m->vertex[tmr_next(i)]] &= (uint8_t)~TMR_MARK;
        i = tmr_swing(m, i);
    } while (i != cn);
    return common == 2;
}

static void tmr_kill_face(tmr_mesh *m, int32_t face) {
    for (int k = 0; k < 3; k++) m->vertex[3 * face + k] = -1;
    m->live_faces--;
}

/* Merge b = vertex[prev(c)] into a = vertex[next(c)]; a keeps its place. */
static void tmr_collapse(tmr_mesh *m, int32_t c) {
    const int32_t o = m->opposite[c], cn = tmr_next(c), cp = tmr_prev(c);
    const int32_t on = tmr_next(o), op = tmr_prev(o);
    const int32_t a = m->vertex[cn], b = m->vertex[cp], d = m->vertex[c], e = m->vertex[o];
    const int32_t bd = m->opposite[cn], da = m->opposite[cp]; /* beyond the edges b d, d a */
    const int32_t ae = m->opposite[on], eb = m->opposite[op];
    const int32_t line_d = m->edge[cn] ? m->edge[cn] : m->edge[cp];
    const int32_t line_e = m->edge[on] ? m->edge[on] : m->edge[op];
    int32_t i = cp;
    do { /* b's corners become a's */
        m->vertex[i] = a;
        i = tmr_swing(m, i);
    } while (i != cp);
    tmr_kill_face(m, c / 3);
    tmr_kill_face(m, o / 3);
    tmr_link(m, bd, da, line_d);
    tmr_link(m, ae, eb, line_e);
    m->corner[b] = -1;
    m->live--;
    m->corner[a] = tmr_next(da);
    m->corner[d] = tmr_prev(da);
    m->corner[e] = tmr_next(ae);
    m->valence[a] += m->valence[b] - 4;
    m->valence[d]--;
    m->valence[e]--;
}

/* ---- moving on the surface ---------------------------------------------------------------- */

/* The point of triangle a b c nearest to p, as weights of b and c; *part: 0 inside, 1 2 3 the edge
   opposite to a b c, 4 5 6 the corner a b c. */
static txm_dvec3 tmr_nearest(txm_dvec3 p, txm_dvec3 a, txm_dvec3 b, txm_dvec3 c, double *u,
                             double *v, int *part) {
    const txm_dvec3 ab = txm_d3_sub(b, a), ac = txm_d3_sub(c, a), ap = txm_d3_sub(p, a);
    const double d1 = txm_d3_dot(ab, ap), d2 = txm_d3_dot(ac, ap);
    *u = *v = 0;
    *part = 4;
    if (d1 <= 0 && d2 <= 0) return a;
    const txm_dvec3 bp = txm_d3_sub(p, b);
    const double d3 = txm_d3_dot(ab, bp), d4 = txm_d3_dot(ac, bp);
    *u = 1;
    *part = 5;
    if (d3 >= 0 && d4 <= d3) return b;
    const double vc = d1 * d4 - d3 * d2;
    if (vc <= 0 && d1 >= 0 && d3 <= 0) {
        *u = d1 > d3 ? d1 / (d1 - d3) : 0;
        *part = 3;
        return txm_d3_mad(a, ab, *u);
    }
    const txm_dvec3 cp = txm_d3_sub(p, c);
    const double d5 = txm_d3_dot(ab, cp), d6 = txm_d3_dot(ac, cp);
    *u = 0;
    *v = 1;
    *part = 6;
    if (d6 >= 0 && d5 <= d6) return c;
    const double vb = d5 * d2 - d1 * d6;
    if (vb <= 0 && d2 >= 0 && d6 <= 0) {
        *v = d2 > d6 ? d2 / (d2 - d6) : 0;
        *part = 2;
        return txm_d3_mad(a, ac, *v);
    }
    const double va = d3 * d6 - d5 * d4;
    if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
        const double n = (d4 - d3) + (d5 - d6);
        *v = n > 0 ? (d4 - d3) / n : 0;
        *u = 1 - *v;
        *part = 1;
        return txm_d3_mad(b, txm_d3_sub(c, b), *v);
    }
    const double n = va + vb + vc;
    *u = n > 0 ? vb / n : 0;
    *v = n > 0 ? vc / n : 0;
    *part = 0;
    return txm_d3_add(txm_d3_mad(a, ab, *u), txm_d3_scale(ac, *v));
}

typedef struct tmr_place {
    txm_dvec3 p;  /* on the surface         */
    int32_t face; /* in this face of it     */
    double u, v;  /* weights of corners 1, 2 */
    double d2;    /* squared distance from what was projected */
    int part;     /* as tmr_nearest has it  */
} tmr_place;

static tmr_place tmr_on_face(const tmr_surface *s, int32_t face, txm_dvec3 p) {
    tmr_place at;
    const int32_t *v = s->vertex + 3 * face;
    at.face = face;
    at.p = tmr_nearest(p, s->point[v[0]], s->point[v[1]], s->point[v[2]], &at.u, &at.v, &at.part);
    at.d2 = txm_d3_dist2(p, at.p);
    return at;
}

/* ---- large fans ---------------------------------------------------------------------------- */

/* Where many faces meet in one vertex, as in the tip of a cone, or in the corner opposite to a side
   with many T-junctions, looking at all of them takes most of the time. So the corners of such fans
   are listed, and searched from coarse to fine. */
enum {
    TMR_FAN_SMALL = 48,   /* ours: all faces of fans up to so many are looked at                  */
    TMR_FAN_SAMPLES = 16, /* ours: of a large one so many first,                                  */
    TMR_FAN_FINER = 4     /* ours: then in steps of this part, around the best                    */
};

/* List the large fans in s->fan and s->spoke. */
static txm_status tmr_find_fans(tmr_surface *s, txm_arena *arena, txm_arena *scratch) {
    const size_t n = (size_t)s->vertex_count;
    size_t total = 0;
    s->fan = s->spoke = NULL;
    int32_t *valence = (int32_t *)txm_arena_zero(scratch, n, sizeof(int32_t));
    if (!valence) return TXM_OUT_OF_MEMORY;
    for (int32_t c = 0; c < 3 * s->face_count; c++) valence[s->vertex[c]]++;
    for (size_t v = 0; v < n; v++)
        if (valence[v] > TMR_FAN_SMALL) total += (size_t)valence[v] + 1;
    if (total == 0 || total > INT32_MAX) return TXM_OK; /* too many to number: slow, but as good */
    s->fan = (int32_t *)txm_arena_alloc(arena, n, sizeof(int32_t));
    s->spoke = (int32_t *)txm_arena_alloc(arena, total, sizeof(int32_t));
    if (!s->fan || !s->spoke) return TXM_OUT_OF_MEMORY;
    size_t at = 0;
    for (int32_t v = 0; v < s->vertex_count; v++) {
        const int32_t first = s->corner[v];
        s->fan[v] = -1;
        if (valence[v] <= TMR_FAN_SMALL) continue;
        s->fan[v] = (int32_t)at;
        s->spoke[at++] = valence[v];
        int32_t c = first;
        do { /* each vertex has one fan */
            TRIMESH_ASSERT(at < total && c >= 0);
            s->spoke[at++] = c;
            c = tmr_ccw(s->opposite, c);
        } while (c >= 0 && c != first);
        TRIMESH_ASSERT(at == (size_t)s->fan[v] + 1 + (size_t)valence[v]);
    }
    return TXM_OK;
}

/* The place nearest to p in the faces of vertex v, or in a large fan about that. */
static tmr_place tmr_on_fan(const tmr_surface *s, int32_t v, txm_dvec3 p) {
    if (!s->fan || s->fan[v] < 0) {
        const int32_t first = s->corner[v];
        tmr_place best = tmr_on_face(s, first / 3, p);
        for (int32_t c = tmr_ccw(s->opposite, first); c >= 0 && c != first; c = tmr_ccw(s->opposite, c)) {
            const tmr_place there = tmr_on_face(s, c / 3, p);
            if (there.d2 < best.d2) best = there;
        }
        return best;
    }
    const int32_t n = s->spoke[s->fan[v]], *spoke = s->spoke + s->fan[v] + 1;
    int32_t step = (n + TMR_FAN_SAMPLES - 1) / TMR_FAN_SAMPLES, k = 0;
    tmr_place best = tmr_on_face(s, spoke[0] / 3, p);
    for (int32_t i = step; i < n; i += step) {
        const tmr_place there = tmr_on_face(s, spoke[i] / 3, p);
        if (there.d2 < best.d2) {
            best = there;
            k = i;
        }
    }
    while (step > 1) {
        const int32_t middle = k, reach = step;
        step = (step + TMR_FAN_FINER - 1) / TMR_FAN_FINER;
        for (int32_t i = -reach + step; i < reach; i += step) {
            const int32_t j = (middle + i + n) % n; /* across the border that is just another one */
            const tmr_place there = tmr_on_face(s, spoke[j] / 3, p);
            if (there.d2 < best.d2) {
                best = there;
                k = j;
            }
        }
    }
    return best;
}

/* ---- projecting ---------------------------------------------------------------------------- */

/* The place on the surface nearest to p, found by walking from a face while the distance falls:
   takes time proportional to the way, and cannot jump to another sheet. Large fans are crossed at
   once. */
static tmr_place tmr_project(const tmr_surface *s, txm_dvec3 p, int32_t face) {
    int32_t crossed = -1; /* the last large fan */
    tmr_place at = tmr_on_face(s, face, p);
    for (int guard = 0; guard < 4096 && at.part != 0; guard++) {
        tmr_place best = at;
        if (at.part <= 3) {
            const int32_t o = s->opposite[3 * at.face + at.part - 1];
            if (o >= 0) best = tmr_on_face(s, o / 3, p);
            for (int k = 0; k < 3 && s->fan; k++) {
                const int32_t v = s->vertex[3 * at.face + k];
                if (k == at.part - 1 || v == crossed || s->fan[v] < 0) continue;
                const tmr_place there = tmr_on_fan(s, v, p);
                if (there.d2 < best.d2) best = there;
                crossed = v;
            }
        } else {
            const int32_t v = s->vertex[3 * at.face + at.part - 4];
            const tmr_place there = tmr_on_fan(s, v, p);
            if (there.d2 < best.d2) best = there;
        }
        if (best.face == at.face || !(best.d2 < at.d2 * (1 - 1e-12))) break;
        at = best;
    }
    return at;
}

/* the smooth normal at a place; beside a crease that of the face */
static txm_dvec3 tmr_normal_at(const tmr_surface *s, const tmr_lines *l, const tmr_place *at) {
    const double w[3] = {1 - at->u - at->v, at->u, at->v};
    txm_dvec3 n = txm_d3(0, 0, 0);
    for (int k = 0; k < 3; k++) {
        const int32_t v = s->vertex[3 * at->face + k];
        const int sharp =
            (l->kind[v] == TRIMESH_CREASE || l->kind[v] == TRIMESH_CORNER) && !l->smooth[v];
        n = txm_d3_mad(n, sharp ? s->normal[at->face] : s->vertex_normal[v], w[k]);
    }
    return txm_d3_len2(n) > 0.01 ? txm_d3_unit(n) : s->normal[at->face];
}

static double tmr_scale_at(const tmr_surface *s, const tmr_place *at) {
    if (!s->scale) return 1;
    const int32_t *v = s->vertex + 3 * at->face;
    return (1 - at->u - at->v) * s->scale[v[0]] + at->u * s->scale[v[1]] +
           at->v * s->scale[v[2]];
}

/* ---- the work ----------------------------------------------------------------------------- */

enum {
    TMR_CHUNK = 2048, /* vertices or triangles per parallel task; does not change results */
    TMR_TICK = 50000, /* ours: progress is reported after the work of moving so many vertices */
    TMR_TICK_TRIAL = 20 /* ours: so many are what trying something at one edge takes */
};

typedef struct tmr_work {
    const tmr_surface *s;
    const tmr_lines *l;
    const trimesh_desc *desc;
    txm_env *env;
    tmr_mesh m;
    float *size;       /* 1 per vertex of m: edge length there relative to length               */
    double length;     /* edge length aimed at                                                  */
    double line_scale; /* along lines relative to that                                          */
    txm_dvec3 *moved;  /* 1 per vertex: scratch: the place it moves to                          */
    int32_t *landed;   /* 1 per vertex: scratch: the face or segment there                      */
    uint8_t *bad;      /* 1 per vertex: scratch: a mark                                         */
    uint8_t *flag;     /* 1 per triangle: scratch: a mark                                       */
    float *height;     /* 1 per triangle: scratch: height of the surface over it                */
    float (*limit)[2]; /* 1 per vertex: scratch: how far into and out of the surface it may fit */
    uint8_t *mask;     /* of relaxation: NULL, or 1 per vertex: may it move?                    */
    uint8_t *mask_room; /* 1 per vertex: memory for mask */
    double pull;       /* of relaxation: how far triangles pull to the wanted size, 0..1        */
    double step;       /* of relaxation: over-relaxation factor                                 */
    int64_t ticks;     /* work since progress was reported: tmr_tick                            */
    int splinters;     /* of collapsing: also the short sides of much longer triangles          */
} tmr_work;

/* A progress callback that passes on to the caller's what never falls, also where something is done twice. */
typedef struct tmr_rising {
    int (*progress)(void *user, float fraction, const char *stage); /* the caller's */
    void *user;
    float fraction; /* the highest reported */
} tmr_rising;

static int tmr_rise(void *user, float fraction, const char *stage) {
    tmr_rising *r = (tmr_rising *)user;
    if (fraction > r->fraction) r->fraction = fraction;
    return r->progress(r->user, r->fraction, stage);
}

/* Let an environment, a copy of the caller's, report by way of r. */
static void tmr_rise_in(tmr_rising *r, txm_env *env) {
    if (!env->progress) return;
    r->progress = env->progress;
    r->user = env->progress_user;
    env->progress = tmr_rise;
    env->progress_user = r;
}

/* Report progress if the work of moving TMR_TICK vertices was done since the last time: small meshes need
   no reports, and of large ones no pass is too long to be cancelled. Non-zero: cancelled, stop. */
static int tmr_tick(tmr_work *w, int32_t vertices) {
    w->ticks += vertices;
    if (w->ticks < TMR_TICK) return 0;
    w->ticks = 0;
    return txm_progress(w->env, 0, "relax"); /* the fraction stays at the highest so far */
}

/* Does the caller want edges of different lengths? Others are a means: tmr_halve_at_spots. */
static int tmr_wants_sizes(const tmr_work *w) {
    return w->desc->scale != NULL || w->desc->adapt > 0;
}

/* a face of the surface at the vertex */
static int32_t tmr_face_of(const tmr_work *w, int32_t v) {
    const int kind = tmr_kind_of(&w->m, v);
    if (kind == TRIMESH_FREE) return w->m.source[v];
    if (kind == TRIMESH_CORNER) return w->s->corner[w->m.source[v]] / 3;
    return w->l->face[w->m.source[v]];
}

/* Put vertex v at the place. */
static void tmr_put(tmr_work *w, int32_t v, const tmr_place *at) {
    w->m.p[v] = at->p;
    w->m.n[v] = tmr_normal_at(w->s, w->l, at);
    w->m.source[v] = at->face;
    w->size[v] = txm_float(tmr_scale_at(w->s, at));
}

/* Let vertex v stay where it is, unless w->moved is set later. */
static void tmr_keep_place(tmr_work *w, int32_t v) {
    w->moved[v] = w->m.p[v];
    w->landed[v] = w->m.source[v];
}

/* Put vertex v on segment k of a line. */
static void tmr_put_on_line(tmr_work *w, int32_t v, txm_dvec3 p, int32_t k) {
    const int32_t *a = w->l->a, *b = w->l->b;
    const tmr_place at = tmr_on_face(w->s, w->l->face[k], p);
    w->m.p[v] = p;
    w->m.n[v] = txm_d3_unit(txm_d3_add(w->s->vertex_normal[a[k]], w->s->vertex_normal[b[k]]));
    w->m.source[v] = k;
    w->size[v] = txm_float(tmr_scale_at(w->s, &at));
}

/* the middle of the triangle of these vertices */
static txm_dvec3 tmr_middle(const tmr_mesh *m, const int32_t *v) {
    return txm_d3_scale(txm_d3_add(txm_d3_add(m->p[v[0]], m->p[v[1]]), m->p[v[2]]), 1.0 / 3);
}

/* The place of the surface nearest to p, walking from all its faces at vertex v: beside a crease the
   distance may fall on one side only. */
static tmr_place tmr_project_from(const tmr_work *w, int32_t v, txm_dvec3 p) {
    const tmr_surface *s = w->s;
    const int32_t k = w->m.source[v];
    const int kind = tmr_kind_of(&w->m, v);
    tmr_place at = tmr_project(s, p, tmr_face_of(w, v));
    if (kind == TRIMESH_CORNER) {
        const int32_t first = s->corner[k];
        if (s->fan && s->fan[k] >= 0) {
            const tmr_place other = tmr_project(s, p, tmr_on_fan(s, k, p).face);
            return other.d2 < at.d2 ? other : at;
        }
        for (int32_t c = tmr_ccw(s->opposite, first); c >= 0 && c != first; c = tmr_ccw(s->opposite, c)) {
            const tmr_place other = tmr_project(s, p, c / 3);
            if (other.d2 < at.d2) at = other;
        }
    } else if (kind != TRIMESH_FREE) {
        for (int32_t c = 3 * w->l->face[k], i = 0; i < 3; i++, c++) {
            if (s->vertex[c] == w->l->a[k] || s->vertex[c] == w->l->b[k] || s->opposite[c] < 0) continue;
            const tmr_place other = tmr_project(s, p, s->opposite[c] / 3);
            if (other.d2 < at.d2) at = other;
        }
    }
    return at;
}

/* the place of the surface nearest to it, walking from all three vertices */
static tmr_place tmr_below_middle(const tmr_work *w, const int32_t *v) {
    const txm_dvec3 middle = tmr_middle(&w->m, v);
    tmr_place at = tmr_project_from(w, v[0], middle);
    for (int k = 1; k < 3; k++) {
        const tmr_place other = tmr_project_from(w, v[k], middle);
        if (other.d2 < at.d2) at = other;
    }
    return at;
}

/* the place of the surface nearest to p, a point between the vertices a and b */
static tmr_place tmr_project_between(const tmr_work *w, int32_t a, int32_t b, txm_dvec3 p) {
    if (tmr_kind_of(&w->m, a) == TRIMESH_FREE) return tmr_project(w->s, p, w->m.source[a]);
    if (tmr_kind_of(&w->m, b) == TRIMESH_FREE) return tmr_project(w->s, p, w->m.source[b]);
    const tmr_place one = tmr_project_from(w, a, p), two = tmr_project_from(w, b, p);
    return two.d2 < one.d2 ? two : one;
}

/* The normal that a triangle should have: the mean normal of its free vertices, since normals on
   creases say little; without a free vertex that of the surface below its middle. */
static txm_dvec3 tmr_expected_normal(const tmr_work *w, int32_t a, int32_t b, int32_t c) {
    const tmr_mesh *m = &w->m;
    const int32_t v[3] = {a, b, c};
    txm_dvec3 n = txm_d3(0, 0, 0);
    int any = 0;
    for (int k = 0; k < 3; k++) {
        if (tmr_kind_of(m, v[k]) != TRIMESH_FREE) continue;
        n = txm_d3_add(n, m->n[v[k]]);
        any = 1;
    }
    if (any) return txm_d3_unit(n);
    return w->s->normal[tmr_below_middle(w, v).face];
}

#define TMR_THIN 0.02 /* twice the area over the squared longest edge of a triangle without a direction */

/* how well a triangle at these points agrees with the normals of its vertices: -1..1, -1 also for
   one without area */
static double tmr_agreement(const tmr_work *w, int32_t a, int32_t b, int32_t c, txm_dvec3 pa,
                            txm_dvec3 pb, txm_dvec3 pc) {
    const txm_dvec3 n = txm_d3_area2(pa, pb, pc);
    const double length = txm_d3_len(n);
    const double longest =
        fmax(txm_d3_dist2(pa, pb), fmax(txm_d3_dist2(pb, pc), txm_d3_dist2(pc, pa)));
    if (length <= TMR_THIN * longest) return -1;
    return txm_d3_dot(n, tmr_expected_normal(w, a, b, c)) / length;
}

#define TMR_LEAST_AGREEMENT 0.4 /* cosine of the steepest angle to the surface that is accepted   */

/* ---- setting up --------------------------------------------------------------------------- */

/* Arrays for so many vertices and triangles; the mesh in them is empty. */
static txm_status tmr_alloc_mesh(tmr_work *w, int32_t vertices, int32_t faces, txm_arena *arena) {
    tmr_mesh *m = &w->m;
    const size_t nv = (size_t)vertices, nc = 3 * (size_t)faces;
    m->vertex_limit = vertices;
    m->face_limit = faces;
    m->vertex_count = m->live = m->face_count = m->live_faces = 0;
    m->p = (txm_dvec3 *)txm_arena_alloc(arena, nv, sizeof(txm_dvec3));
    m->n = (txm_dvec3 *)txm_arena_alloc(arena, nv, sizeof(txm_dvec3));
    m->source = (int32_t *)txm_arena_alloc(arena, nv, sizeof(int32_t));
    m->corner = (int32_t *)txm_arena_alloc(arena, nv, sizeof(int32_t));
    m->flags = (uint8_t *)txm_arena_zero(arena, nv, 1);
    m->valence = (int32_t *)txm_arena_zero(arena, nv, sizeof(int32_t));
    m->vertex = (int32_t *)txm_arena_alloc(arena, nc, sizeof(int32_t));
    m->opposite = (int32_t *)txm_arena_alloc(arena, nc, sizeof(int32_t));
    m->edge = (int32_t *)txm_arena_zero(arena, nc, sizeof(int32_t));
    w->size = (float *)txm_arena_alloc(arena, nv, sizeof(float));
    w->moved = (txm_dvec3 *)txm_arena_alloc(arena, nv, sizeof(txm_dvec3));
    w->landed = (int32_t *)txm_arena_alloc(arena, nv, sizeof(int32_t));
    w->bad = (uint8_t *)txm_arena_zero(arena, nv, 1);
    w->mask_room = (uint8_t *)txm_arena_alloc(arena, nv, 1);
    w->flag = (uint8_t *)txm_arena_alloc(arena, (size_t)faces, 1);
    return tmr_check_memory(arena);
}

/* Copy the surface into w->m, its border loops closed by ghosts, with room for `more` vertices.

   The copy has one ghost vertex for each border loop and one ghost triangle for each border edge.
   Every operation that makes a vertex makes two triangles (tmr_split, tmr_split_face), and slots are
   never used twice, except by trials that give them back:

       vertices = V + loops + more
       faces    = F + border edges + 2 more

   return  TXM_OK; TXM_TOO_LARGE if corners could not be numbered; TXM_OUT_OF_MEMORY               */
static txm_status tmr_copy_surface(tmr_work *w, double more, txm_arena *arena) {
    const tmr_surface *s = w->s;
    tmr_mesh *m = &w->m;
    const double vertices = (double)s->vertex_count + s->loop_count + more;
    const double faces = (double)s->face_count + s->border_count + 2 * more;
    memset(m, 0, sizeof *m);
    if (vertices > (double)TMR_MOST_SLOTS || faces > (double)TMR_MOST_SLOTS)
        return txm_fail(w->env, TXM_TOO_LARGE, "the surface and its borders are too large");
    const txm_status status = tmr_alloc_mesh(w, (int32_t)vertices, (int32_t)faces, arena);
    if (status != TXM_OK) return status;
    m->vertex_count = m->live = s->vertex_count;
    m->face_count = m->live_faces = s->face_count;
    const size_t corners = 3 * (size_t)s->face_count;
    memcpy(m->vertex, s->vertex, corners * sizeof(int32_t));
    memcpy(m->opposite, s->opposite, corners * sizeof(int32_t));
    memcpy(m->edge, w->l->edge, corners * sizeof(int32_t));
    for (int32_t v = 0; v < s->vertex_count; v++) {
        const int kind = w->l->kind[v];
        m->p[v] = s->point[v];
        m->n[v] = s->vertex_normal[v];
        m->corner[v] = s->corner[v];
        m->source[v] = kind == TRIMESH_FREE     ? s->corner[v] / 3
                       : kind == TRIMESH_CORNER ? v
                                                : w->l->segment[v];
        m->flags[v] = (uint8_t)kind;
        w->size[v] = s->scale ? s->scale[v] : 1;
    }
    for (size_t c = 0; c < corners; c++) m->valence[m->vertex[c]]++;

    /* Ghosts: walk each border loop, one ghost triangle per border edge. From the border edge of
       corner c, which runs from u = next(c) to v = prev(c), the next one begins at v. */
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        if (m->opposite[c] >= 0) continue;
        TRIMESH_ASSERT(m->vertex_count < m->vertex_limit);
        const int32_t ghost = m->vertex_count++, first_face = m->face_count;
        m->flags[ghost] = TMR_GHOST;
        m->p[ghost] = m->n[ghost] = txm_d3(0, 0, 0);
        m->source[ghost] = -1;
        m->corner[ghost] = 3 * first_face;
        m->valence[ghost] = 0;
        w->size[ghost] = 1;
        m->ghosts++;
        int32_t e = c;
        do {
            TRIMESH_ASSERT(m->face_count < m->face_limit);
            const int32_t f = 3 * m->face_count++;
            m->live_faces++;
            m->vertex[f] = ghost;
            m->vertex[f + 1] = m->vertex[tmr_prev(e)];
            m->vertex[f + 2] = m->vertex[tmr_next(e)];
            tmr_link(m, f, e, w->l->edge[e]);
            m->valence[ghost]++;
            m->valence[m->vertex[tmr_prev(e)]]++;
            m->valence[m->vertex[tmr_next(e)]]++;
            int32_t at = tmr_prev(e); /* turn clockwise about v to the next border edge */
            while (s->opposite[tmr_prev(at)] >= 0) at = tmr_prev(s->opposite[tmr_prev(at)]);
            e = tmr_prev(at);
        } while (e != c);
        for (int32_t f = first_face; f < m->face_count; f++) {
            const int32_t next = f + 1 < m->face_count ? f + 1 : first_face;
            /* f = (ghost, v, u): its edge ghost v, opposite to u, is the next one's ghost u */
            tmr_link(m, 3 * f + 2, 3 * next + 1, 0);
        }
    }
    TRIMESH_ASSERT(m->ghosts == s->loop_count);
    TRIMESH_ASSERT(m->face_count == s->face_count + s->border_count);
    return TXM_OK;
}

/* ---- back to the caller's triangles ------------------------------------------------------- */

/* The place in the caller's triangle. Where mending has flipped an edge, a face is not one of the
   caller's: then the nearest point of the triangle that it came from. */
static txm_mesh_place tmr_surface_source(const tmr_surface *s, const trimesh_desc *desc,
                                         const tmr_place *at) {
    txm_mesh_place source;
    double weight[3] = {0, 0, 0};
    const double own[3] = {1 - at->u - at->v, at->u, at->v};
    const int turn = s->turn[at->face];
    source.triangle = s->origin[at->face];
    if (turn < TMR_MAPPED) {
        for (int k = 0; k < 3; k++)
            weight[turn < 4 ? (k + turn) % 3 : (turn - 4 - k + 3) % 3] = own[k];
    } else {
        txm_dvec3 p[3];
        int part;
        tmr_caller_corners(s, desc, source.triangle, p);
        tmr_nearest(at->p, p[0], p[1], p[2], &weight[1], &weight[2], &part);
    }
    source.u = txm_clampf(txm_float(weight[1]), 0, 1);
    source.v = txm_clampf(txm_float(weight[2]), 0, txm_float(1.0 - source.u));
    return source;
}

/* ---- ridges: strips become lines ------------------------------------------------------------- */

/* The flats on both sides of each strip are extended to the line in which they meet. Each vertex of
   a strip moves to the planes of the flats that walks over its faces have seen, and of its own faces
   that are no part of a strip; where three flats meet, that is their corner. Vertices that come to
   the same place are merged. The volume that this adds to the surface (or takes away where it is
   concave) is kept as the cross-section of the strip, and given back by the finished mesh, whose
   vertices on the line move inwards by as much: tmr_return_volume. */
enum {
    TMR_RIDGE_TRIES = 4,   /* a strip that folds the surface is left as it is: so many times      */
    TMR_RIDGE_PASSES = 8,  /* of merging                                                          */
    TMR_RIDGE_FILLS = 64   /* of filling corners                                                  */
};
#define TMR_RIDGE_LEVELS 64.0    /* merging: edges are sorted by steps of this part of an edge length */
#define TMR_RIDGE_LEAST 5.0      /* strips shorter than this are left out, in edge lengths,       */
#define TMR_RIDGE_SHARE 0.06     /* or than this, in diagonals of the bounding box: as creases    */
#define TMR_RIDGE_REACH 1.7      /* vertices move by no more than this, in edge lengths           */
#define TMR_RIDGE_CORNER 1.25    /* largest corner, relative to that                              */
#define TMR_RIDGE_OFF 0.004      /* merged vertices may miss their planes by this, in edge lengths */
#define TMR_RIDGE_PULL 1e-3      /* weight of the old place against one plane                     */
#define TMR_RIDGE_RATE 0.05      /* moving a vertex by one edge takes so much volume at least, in
                                    edge lengths to the third                                    */
#define TMR_RIDGE_ALONG 0.95     /* edges along a ridge: cosine                                  */
#define TMR_RIDGE_AGREE 0.9      /* faces beside a strip keep their normals: cosine               */

/* A vertex of a strip. */
typedef struct tmr_ridge {
    double plane[10]; /* sum of n n^T (xx xy xz yy yz zz), n d (x y z), d d over its planes n x = d */
    txm_dvec3 old, to; /* where it was, goes to; of merged ones the mean of where they were       */
    double merged;     /* how many                                                               */
    txm_dvec3 low, high; /* the box of where they were                                           */
    double reach;      /* how far they may move                                                  */
    int planes;        /* 0 = it has none yet, 1 = own ones, more: from neighbours               */
    int32_t into;      /* the ridge that it was merged into, or itself                           */
} tmr_ridge;

typedef struct tmr_ridges {
    tmr_surface *s;
    txm_env *env;
    double sharp, spacing;
    uint8_t *strip;     /* 1 per face: part of a strip                                            */
    uint8_t *seen;      /* 1 per face: bit k: a strip was seen from the edge opposite to its corner k */
    int32_t *component; /* 1 per face: of a connected strip, its first face                       */
    float *length;      /* 1 per face: its part of the length of the strip                        */
    float (*section)[2]; /* 1 per face: sum of the cross-sections that walks have seen, how many   */
    int32_t *number;    /* 1 per vertex: of its ridge, -1 = none                                  */
    int32_t count;      /* of ridges                                                              */
    tmr_ridge *ridge;
} tmr_ridges;

static void tmr_add_plane(tmr_ridge *r, txm_dvec3 n, txm_dvec3 p) {
    const double d = txm_d3_dot(n, p);
    const double add[10] = {n.x * n.x, n.x * n.y, n.x * n.z, n.y * n.y, n.y * n.z,
                            n.z * n.z, n.x * d,   n.y * d,   n.z * d,   d * d};
    for (int k = 0; k < 10; k++) r->plane[k] += add[k];
}

/* the mean squared distance of p from the planes */
static double tmr_plane_error(const tmr_ridge *r, txm_dvec3 p) {
    const double *q = r->plane, count = q[0] + q[3] + q[5];
    const double error = q[0] * p.x * p.x + q[3] * p.y * p.y + q[5] * p.z * p.z +
                         2 * (q[1] * p.x * p.y + q[2] * p.x * p.z + q[4] * p.y * p.z) -
                         2 * (q[6] * p.x + q[7] * p.y + q[8] * p.z) + q[9];
    return count > 0 ? fmax(0, error) / count : 0;
}

/* The place nearest to all planes; where they leave it open, nearest to where the vertex was.
   Solves (A + e 1) (x - old) = b - A old by Cramer's rule. */
static txm_dvec3 tmr_ridge_place(const tmr_ridge *r) {
    const double *q = r->plane, e = TMR_RIDGE_PULL;
    const txm_dvec3 o = r->old;
    const txm_dvec3 x = txm_d3(q[0] + e, q[1], q[2]), y = txm_d3(q[1], q[3] + e, q[4]),
                    z = txm_d3(q[2], q[4], q[5] + e);
    const txm_dvec3 b = txm_d3(q[6] - (q[0] * o.x + q[1] * o.y + q[2] * o.z),
                               q[7] - (q[1] * o.x + q[3] * o.y + q[4] * o.z),
                               q[8] - (q[2] * o.x + q[4] * o.y + q[5] * o.z));
    const double det = txm_d3_dot(x, txm_d3_cross(y, z));
    if (!(det > 0)) return o;
    const txm_dvec3 d = txm_d3(txm_d3_dot(b, txm_d3_cross(y, z)), txm_d3_dot(x, txm_d3_cross(b, z)),
                               txm_d3_dot(x, txm_d3_cross(y, b)));
    return txm_d3_mad(o, d, 1 / det);
}

/* Mark the faces of all strips. */
static txm_status tmr_mark_strips(tmr_ridges *r, size_t *found) {
    const tmr_surface *s = r->s;
    tmr_band band;
    *found = 0;
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        if (c % 65536 == 65535 && txm_progress(r->env, 0, "mend")) return TXM_CANCELLED;
        if (!tmr_band_at(s, c, r->sharp, r->spacing, &band)) continue;
        const double length =
            txm_d3_dist(s->point[s->vertex[tmr_next(c)]], s->point[s->vertex[tmr_prev(c)]]);
        const double turn = tmr_chord(s, c / 3, s->opposite[c] / 3);
        const double whole = txm_d3_dist(band.normal[0], band.normal[1]);
        r->seen[c / 3] |= (uint8_t)(1 << c % 3);
        for (int32_t i = 0; i < band.count; i++) r->strip[band.face[i]] = 1;
        r->length[band.face[0]] += txm_float(length * turn / whole);
        ++*found;
    }
    return TXM_OK;
}

/* Is the face part of a corner where strips meet? Walks do not cross all of those: it is small, lies
   beside a strip, and at two of its edges the surface turns. */
static int tmr_is_strip_corner(const tmr_ridges *r, const uint8_t *at_strip, int32_t f) {
    const tmr_surface *s = r->s;
    const int32_t *v = s->vertex + 3 * f;
    const double spacing = tmr_spacing_at(s, 3 * f, r->spacing), most = TMR_BAND_SHIFT * spacing;
    int turns = 0, fast = 0;
    const int beside = at_strip[v[0]] + at_strip[v[1]] + at_strip[v[2]];
    if (beside < 2) return 0;
    for (int k = 0; k < 3; k++) {
        if (txm_d3_dist2(s->point[v[k]], s->point[v[(k + 1) % 3]]) > most * most) return 0;
        const int32_t o = s->opposite[3 * f + k];
        turns += o >= 0 && tmr_chord(s, f, o / 3) > TMR_BAND_SAME;
        fast += tmr_turns_fast(s, 3 * f + k, r->sharp, spacing);
    }
    return turns >= 2 && fast >= 1;
}

/* Add the faces of corners to the strips that meet there, from the rim inwards. at_strip: scratch,
   1 per vertex. */
static void tmr_fill_strip_corners(tmr_ridges *r, uint8_t *at_strip) {
    const tmr_surface *s = r->s;
    memset(at_strip, 0, (size_t)s->vertex_count);
    for (int32_t c = 0; c < 3 * s->face_count; c++) at_strip[s->vertex[c]] |= r->strip[c / 3];
    for (int round = 0, found = 1; round < TMR_RIDGE_FILLS && found; round++) {
        found = 0;
        for (int32_t f = 0; f < s->face_count; f++) {
            if (r->strip[f] || !tmr_is_strip_corner(r, at_strip, f)) continue;
            r->strip[f] = 1;
            found = 1;
        }
        for (int32_t c = 0; c < 3 * s->face_count && found; c++)
            at_strip[s->vertex[c]] |= r->strip[c / 3];
    }
}

/* Number the connected strips; forget the short ones. queue: scratch, 1 per face. */
static void tmr_drop_short_strips(tmr_ridges *r, int32_t *queue) {
    const tmr_surface *s = r->s;
    const double least = fmax(TMR_RIDGE_LEAST * r->spacing, TMR_RIDGE_SHARE);
    for (int32_t f = 0; f < s->face_count; f++) r->component[f] = -1;
    for (int32_t f = 0; f < s->face_count; f++) {
        int32_t count = 0;
        double length = 0;
        if (!r->strip[f] || r->component[f] >= 0) continue;
        r->component[f] = f;
        queue[count++] = f;
        for (int32_t i = 0; i < count; i++) {
            length += r->length[queue[i]];
            for (int32_t c = 3 * queue[i]; c < 3 * queue[i] + 3; c++) {
                const int32_t g = s->opposite[c] < 0 ? -1 : s->opposite[c] / 3;
                if (g < 0 || !r->strip[g] || r->component[g] >= 0) continue;
                r->component[g] = f;
                queue[count++] = g;
            }
        }
        for (int32_t i = 0; i < count && length < least; i++) r->strip[queue[i]] = 0;
    }
}

/* Does the vertex lie near both flats? The far end of a long face may not. */
static int tmr_is_near_band(const tmr_ridge *r, const tmr_band *band) {
    for (int j = 0; j < 2; j++)
        if (fabs(txm_d3_dot(band->normal[j], txm_d3_sub(r->old, band->point[j]))) > r->reach) return 0;
    return 1;
}

/* Vertices of strips without planes, inside of corners, take those of their neighbours. */
static void tmr_spread_planes(tmr_ridges *r) {
    const tmr_surface *s = r->s;
    for (int round = 0, found = 1; round < TMR_RIDGE_FILLS && found; round++) {
        found = 0;
        for (int32_t c = 0; c < 3 * s->face_count; c++) {
            const int32_t a = r->number[s->vertex[c]], b = r->number[s->vertex[tmr_next(c)]];
            if (!r->strip[c / 3] || a < 0 || b < 0) continue;
            for (int side = 0; side < 2; side++) {
                tmr_ridge *to = r->ridge + (side ? b : a);
                const tmr_ridge *from = r->ridge + (side ? a : b);
                const int known = from->planes && from->planes <= round + 1;
                if (!known || (to->planes && to->planes <= round + 1)) continue;
                for (int k = 0; k < 10; k++) to->plane[k] += from->plane[k];
                to->planes = round + 2;
                found = 1;
            }
        }
    }
}

/* how far the vertices merged move, at most */
static double tmr_farthest(const tmr_ridge *r) {
    const txm_dvec3 a = txm_d3_sub(r->to, r->low), b = txm_d3_sub(r->high, r->to);
    return txm_d3_len(txm_d3(fmax(a.x, b.x), fmax(a.y, b.y), fmax(a.z, b.z)));
}

/* Where would the vertices a and b go, merged? Returns 0 if that is too far or off their planes. */
static int tmr_merge_ridges(const tmr_ridges *r, const tmr_ridge *a, const tmr_ridge *b,
                            tmr_ridge *sum) {
    const double off = TMR_RIDGE_OFF * r->spacing;
    *sum = *a;
    for (int k = 0; k < 10; k++) sum->plane[k] += b->plane[k];
    sum->merged += b->merged;
    sum->old = txm_d3_scale(txm_d3_add(txm_d3_scale(a->old, a->merged), txm_d3_scale(b->old, b->merged)),
                            1 / sum->merged);
    sum->low = txm_d3(fmin(a->low.x, b->low.x), fmin(a->low.y, b->low.y), fmin(a->low.z, b->low.z));
    sum->high = txm_d3(fmax(a->high.x, b->high.x), fmax(a->high.y, b->high.y), fmax(a->high.z, b->high.z));
    sum->reach = fmin(a->reach, b->reach);
    sum->to = tmr_ridge_place(sum);
    return tmr_plane_error(sum, sum->to) <= off * off &&
           tmr_farthest(sum) <= sum->reach;
}

/* The ridge that ridge k was merged into; shortens the way there. */
static int32_t tmr_ridge_root(const tmr_ridges *r, int32_t k) {
    while (r->ridge[k].into != k) k = r->ridge[k].into = r->ridge[r->ridge[k].into].into;
    return k;
}

/* Faces of strips that no walk along a cross-section has seen form corners: the vertices of each
   share all their planes, so that they go to one place. Corners that are too large stay as they are. */
static void tmr_join_corners(tmr_ridges *r) {
    const tmr_surface *s = r->s;
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        const int32_t a = r->number[s->vertex[c]], b = r->number[s->vertex[tmr_next(c)]];
        if (!r->strip[c / 3] || r->section[c / 3][1] > 0 || a < 0 || b < 0) continue;
        const int32_t x = tmr_ridge_root(r, a), y = tmr_ridge_root(r, b);
        if (x == y) continue;
        tmr_ridge sum;
        (void)tmr_merge_ridges(r, r->ridge + x, r->ridge + y, &sum);
        r->ridge[y].into = x; /* all of them count until the corner is known to be small */
        r->ridge[x].low = sum.low;
        r->ridge[x].high = sum.high;
    }
    for (int32_t k = 0; k < r->count; k++) {
        const int32_t x = tmr_ridge_root(r, k);
        const double most = TMR_RIDGE_CORNER * r->ridge[x].reach;
        if (x == k || txm_d3_dist2(r->ridge[x].low, r->ridge[x].high) > most * most) continue;
        for (int i = 0; i < 10; i++) r->ridge[x].plane[i] += r->ridge[k].plane[i];
        r->ridge[x].old = txm_d3_add(r->ridge[x].old, r->ridge[k].old);
        r->ridge[x].merged++;
    }
    for (int32_t k = 0; k < r->count; k++) {
        tmr_ridge *x = r->ridge + k;
        if (x->into != k || x->merged < 1.5) continue;
        x->old = txm_d3_scale(x->old, 1 / x->merged);
    }
    for (int32_t k = 0; k < r->count; k++) {
        const tmr_ridge *x = r->ridge + tmr_ridge_root(r, k);
        if (x != r->ridge + k && x->merged > 1.5) {
            memcpy(r->ridge[k].plane, x->plane, sizeof x->plane);
            r->ridge[k].low = r->ridge[k].high = r->ridge[k].old;
            r->ridge[k].old = x->old;
        }
    }
    for (int32_t k = 0; k < r->count; k++) r->ridge[k].merged = 1;
    for (int32_t v = 0; v < s->vertex_count; v++) {
        if (r->number[v] < 0) continue;
        tmr_ridge *x = r->ridge + r->number[v];
        x->into = r->number[v];
        x->low = x->high = s->point[v];
    }
}

/* Does the walk from the edge of corner c follow a cross-section, at right angles to the line where
   the flats meet? */
static int tmr_is_cross_section(const tmr_surface *s, int32_t c, const tmr_band *band) {
    const txm_dvec3 a = s->point[s->vertex[tmr_next(c)]], b = s->point[s->vertex[tmr_prev(c)]];
    const txm_dvec3 ridge = txm_d3_unit(txm_d3_cross(band->normal[0], band->normal[1]));
    return fabs(txm_d3_dot(txm_d3_unit(txm_d3_sub(b, a)), ridge)) > TMR_RIDGE_ALONG;
}

/* Number the vertices of strips, and collect their planes: those of the flats that walks from and
   to faces outside of strips see, and those of their own faces that belong to no strip. */
static txm_status tmr_collect_planes(tmr_ridges *r, txm_arena *scratch) {
    const tmr_surface *s = r->s;
    tmr_band band;
    r->count = 0;
    for (int32_t v = 0; v < s->vertex_count; v++) r->number[v] = -1;
    for (int32_t c = 0; c < 3 * s->face_count; c++)
        if (r->strip[c / 3] && r->number[s->vertex[c]] < 0) r->number[s->vertex[c]] = r->count++;
    r->ridge = (tmr_ridge *)txm_arena_zero(scratch, (size_t)r->count + 1, sizeof(tmr_ridge));
    if (!r->ridge) return TXM_OUT_OF_MEMORY;
    for (int32_t f = 0; f < s->face_count; f++) r->section[f][0] = r->section[f][1] = 0;
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        const int32_t k = r->number[s->vertex[c]];
        if (k < 0) continue;
        r->ridge[k].old = r->ridge[k].low = r->ridge[k].high = s->point[s->vertex[c]];
        r->ridge[k].merged = 1;
        r->ridge[k].into = k;
        r->ridge[k].reach =
            TMR_RIDGE_REACH * r->spacing * (s->scale ? (double)s->scale[s->vertex[c]] : 1);
        if (!r->strip[c / 3]) tmr_add_plane(r->ridge + k, s->normal[c / 3], s->point[s->vertex[c]]);
    }
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        const int32_t o = s->opposite[c];
        if (!(r->seen[c / 3] >> c % 3 & 1) || (!r->strip[c / 3] && !r->strip[o / 3])) continue;
        if (!tmr_band_at(s, c, r->sharp, r->spacing, &band)) continue;
        if (r->strip[band.flat[0]] || r->strip[band.flat[1]]) continue;
        if (!tmr_is_cross_section(s, c, &band)) continue;
        for (int32_t i = 0; i < 3 * band.count; i++) {
            const int32_t k = r->number[s->vertex[3 * band.face[i / 3] + i % 3]];
            if (k >= 0 && tmr_is_near_band(r->ridge + k, &band))
                for (int j = 0; j < 2; j++) tmr_add_plane(r->ridge + k, band.normal[j], band.point[j]);
        }
        for (int32_t i = 0; i < band.count; i++) {
            r->section[band.face[i]][0] += txm_float(band.section);
            r->section[band.face[i]][1]++;
        }
    }
    for (int32_t i = 0; i < r->count; i++)
        r->ridge[i].planes = r->ridge[i].plane[0] + r->ridge[i].plane[3] + r->ridge[i].plane[5] > 0;
    tmr_spread_planes(r);
    tmr_join_corners(r);
    return TXM_OK;
}

/* Is the face sound with its vertices where they go? One beside a strip keeps its normal. */
static int tmr_ridge_face_is_sound(const tmr_ridges *r, const tmr_mesh *m, int32_t f) {
    const tmr_surface *s = r->s;
    const int32_t *v = m->vertex + 3 * f, *u = s->vertex + 3 * f;
    if (f >= s->face_count) return 1; /* of a ghost */
    const txm_dvec3 n = txm_d3_area2(m->p[v[0]], m->p[v[1]], m->p[v[2]]);
    const double before = txm_d3_len(txm_d3_area2(s->point[u[0]], s->point[u[1]], s->point[u[2]]));
    const double area = txm_d3_len(n), cosine = txm_d3_dot(n, s->normal[f]);
    if (r->strip[f]) return area >= 0.2 * before && cosine >= 0.5 * area;
    return area >= 0.02 * before && cosine >= TMR_RIDGE_AGREE * area;
}

/* May the edge opposite to c be merged? In the first passes only if its ends go to the same place,
   across a strip; then also if a face beside it is not sound otherwise, as in corners. */
static int tmr_wants_merge(const tmr_ridges *r, const tmr_mesh *m, int32_t c, int pass) {
    const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
    if (tmr_is_ghost(m, a) || tmr_is_ghost(m, b) || r->number[a] < 0 || r->number[b] < 0) return 0;
    const tmr_ridge *x = r->ridge + r->number[a], *y = r->ridge + r->number[b];
    if (txm_d3_dist2(x->to, y->to) < 0.1 * txm_d3_dist2(x->old, y->old)) return 1;
    return pass >= TMR_RIDGE_PASSES / 2 && (!tmr_ridge_face_is_sound(r, m, c / 3) ||
                                            !tmr_ridge_face_is_sound(r, m, m->opposite[c] / 3));
}

/* List the edges to be merged, the shortest first. */
static size_t tmr_list_merges(const tmr_ridges *r, const tmr_mesh *m, int pass, size_t most,
                              txm_pair *pairs, txm_pair *room) {
    size_t count = 0;
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        if (m->vertex[c] < 0 || m->opposite[c] < c || !tmr_wants_merge(r, m, c, pass)) continue;
        const tmr_ridge *x = r->ridge + r->number[m->vertex[tmr_next(c)]];
        const tmr_ridge *y = r->ridge + r->number[m->vertex[tmr_prev(c)]];
        const double length = txm_d3_dist(x->old, y->old) / r->spacing * TMR_RIDGE_LEVELS;
        TRIMESH_ASSERT(count < most);
        pairs[count].key = length < 1e6 ? (uint32_t)length : 1000000;
        pairs[count++].value = (uint32_t)c;
    }
    txm_sort_pairs(pairs, room, count);
    return count;
}

/* Move the vertices of strips to their places in m, a copy of the surface, and merge them over edges
   between them. */
static txm_status tmr_merge_strips(tmr_ridges *r, tmr_mesh *m, txm_arena *scratch) {
    const size_t most = (size_t)m->face_count * 3 / 2 + 1; /* edges; faces only become fewer */
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(scratch, most, sizeof(txm_pair));
    txm_pair *room = (txm_pair *)txm_arena_alloc(scratch, most, sizeof(txm_pair));
    if (!pairs || !room) return TXM_OUT_OF_MEMORY;
    for (int32_t v = 0; v < r->s->vertex_count; v++) {
        if (r->number[v] < 0) continue;
        tmr_ridge *x = r->ridge + r->number[v];
        x->to = tmr_ridge_place(x);
        if (txm_d3_dist2(x->to, x->old) > x->reach * x->reach) x->to = x->old;
        m->p[v] = x->to;
    }
    for (int pass = 0; pass < TMR_RIDGE_PASSES; pass++) {
        const size_t count = tmr_list_merges(r, m, pass, most, pairs, room);
        for (size_t i = 0; i < count; i++) {
            const int32_t c = (int32_t)pairs[i].value;
            tmr_ridge sum;
            if (m->vertex[c] < 0 || !tmr_wants_merge(r, m, c, pass)) continue;
            const int32_t a = m->vertex[tmr_next(c)];
            tmr_ridge *x = r->ridge + r->number[a], *y = r->ridge + r->number[m->vertex[tmr_prev(c)]];
            if (!tmr_merge_ridges(r, x, y, &sum) || !tmr_can_collapse(m, c)) continue;
            tmr_collapse(m, c);
            *x = sum;
            y->into = r->number[a];
            m->p[a] = sum.to;
        }
    }
    return TXM_OK;
}

/* Forget the strips that would fold the surface. Returns how many faces are not sound. */
static int32_t tmr_drop_folding_strips(tmr_ridges *r, const tmr_mesh *m) {
    const tmr_surface *s = r->s;
    int32_t count = 0;
    for (int32_t f = 0; f < s->face_count; f++) r->length[f] = 0; /* of a component's first face */
    for (int32_t f = 0; f < s->face_count; f++) {
        const int32_t *v = m->vertex + 3 * f;
        if (v[0] < 0) continue;
        if (r->number[v[0]] < 0 && r->number[v[1]] < 0 && r->number[v[2]] < 0) continue;
        if (tmr_ridge_face_is_sound(r, m, f)) continue;
        count++;
        if (r->strip[f]) r->length[r->component[f]] = 1;
        for (int k = 0; k < 3; k++) { /* all strips at its vertices, as they were */
            const int32_t u = s->vertex[3 * f + k], first = s->corner[u];
            for (int32_t c = first; c >= 0;) {
                if (r->strip[c / 3]) r->length[r->component[c / 3]] = 1;
                c = tmr_ccw(s->opposite, c);
                if (c == first) break;
            }
        }
    }
    for (int32_t f = 0; f < s->face_count && count; f++)
        if (r->strip[f] && r->length[r->component[f]] > 0) r->strip[f] = 0;
    return count;
}

/* the ridge that a vertex of the surface was merged into */
static int32_t tmr_merged_ridge(const tmr_ridges *r, int32_t v) {
    return r->number[v] < 0 ? -1 : tmr_ridge_root(r, r->number[v]);
}

/* Each face of a strip that has become an edge adds its cross-section to that edge, for both corners
   of m at it: sums in section[][0], how many in section[][1]. vertex: scratch, 1 per ridge. */
static void tmr_section_edges(const tmr_ridges *r, const tmr_mesh *m, int32_t *vertex,
                              float (*section)[2]) {
    const tmr_surface *s = r->s;
    for (int32_t v = 0; v < s->vertex_count; v++)
        if (m->corner[v] >= 0 && r->number[v] >= 0) vertex[r->number[v]] = v;
    for (int32_t f = 0; f < s->face_count; f++) {
        if (!r->strip[f] || m->vertex[3 * f] >= 0 || !(r->section[f][1] > 0)) continue;
        int32_t end[3];
        for (int k = 0; k < 3; k++) end[k] = vertex[tmr_merged_ridge(r, s->vertex[3 * f + k])];
        const int32_t a = end[0], b = end[1] != a ? end[1] : end[2];
        const int32_t c = a == b ? -1 : tmr_find_edge(m, a, b);
        if (c < 0) continue;
        const int32_t two[2] = {tmr_prev(c), m->opposite[tmr_prev(c)]};
        for (int k = 0; k < 2; k++) {
            if (two[k] / 3 >= s->face_count) continue; /* of a ghost */
            section[two[k]][0] += r->section[f][0];
            section[two[k]][1] += r->section[f][1];
        }
    }
}

/* Make the merged mesh the surface. section: as tmr_section_edges has it. map: scratch, 1 per vertex
   and face. */
static void tmr_take_merged(tmr_ridges *r, const tmr_mesh *m, float (*section)[2], int32_t *map) {
    tmr_surface *s = r->s;
    int32_t *face = map + s->vertex_count;
    int32_t vertices = 0, faces = 0;
    for (int32_t v = 0; v < s->vertex_count; v++) map[v] = m->corner[v] < 0 ? -1 : vertices++;
    for (int32_t f = 0; f < s->face_count; f++) face[f] = m->vertex[3 * f] < 0 ? -1 : faces++;
    for (int32_t v = 0; v < s->vertex_count; v++) {
        const int32_t k = map[v];
        if (k < 0) continue;
        s->point[k] = m->p[v];
        if (s->scale) s->scale[k] = s->scale[v];
    }
    const int32_t old = s->face_count;
    s->border_count = 0;
    s->area = 0;
    for (int32_t f = 0; f < old; f++) {
        const int32_t g = face[f];
        if (g < 0) continue;
        for (int k = 0; k < 3; k++) {
            const int32_t o = m->opposite[3 * f + k];
            s->vertex[3 * g + k] = map[m->vertex[3 * f + k]];
            s->opposite[3 * g + k] = o / 3 >= old ? -1 : 3 * face[o / 3] + o % 3; /* ghosts */
            s->border_count += o / 3 >= old;
            const float *sum = section[3 * f + k];
            s->section[3 * g + k] = sum[1] > 0 ? sum[0] / sum[1] : 0;
            s->corner[s->vertex[3 * g + k]] = 3 * g + k;
        }
        const int32_t *v = s->vertex + 3 * g;
        const txm_dvec3 n = txm_d3_area2(s->point[v[0]], s->point[v[1]], s->point[v[2]]);
        s->area += 0.5 * txm_d3_len(n);
        s->normal[g] = txm_d3_len2(n) > 0 ? txm_d3_unit(n) : s->normal[f];
        s->component[g] = s->component[f];
        s->origin[g] = s->origin[f];
        s->turn[g] = s->turn[f];
    }
    s->vertex_count = vertices;
    s->face_count = faces;
    for (int32_t c = 0; c < 3 * faces; c++) { /* on the border the first one counter-clockwise */
        if (s->opposite[tmr_prev(c)] < 0) s->corner[s->vertex[c]] = c;
    }
    tmr_vertex_normals(s);
}

/* One attempt: move and merge the vertices of strips. *again receives 1 if some of them fold the
   surface: they are forgotten, and the surface is as it was. */
static txm_status tmr_try_ridges(tmr_ridges *r, txm_arena *arena, int *again) {
    tmr_lines none;
    tmr_work w;
    txm_arena scratch;
    tmr_surface *s = r->s;
    memset(&none, 0, sizeof none);
    memset(&w, 0, sizeof w);
    txm_arena_init(&scratch, r->env);
    none.edge = (int32_t *)txm_arena_zero(&scratch, 3 * (size_t)s->face_count, sizeof(int32_t));
    none.kind = (uint8_t *)txm_arena_zero(&scratch, (size_t)s->vertex_count, 1);
    w.s = s;
    w.l = &none;
    w.env = r->env;
    *again = 0;
    txm_status status = tmr_check_memory(&scratch);
    if (status == TXM_OK) status = tmr_collect_planes(r, &scratch);
    if (status == TXM_OK) status = tmr_copy_surface(&w, 0, &scratch);
    if (status == TXM_OK) status = tmr_merge_strips(r, &w.m, &scratch);
    if (status == TXM_OK) {
        *again = tmr_drop_folding_strips(r, &w.m) > 0;
        if (!*again) {
            const size_t n = (size_t)s->vertex_count, corners = 3 * (size_t)s->face_count;
            int32_t *map = (int32_t *)txm_arena_alloc(&scratch, n + corners / 3, sizeof(int32_t));
            float(*section)[2] =
                (float(*)[2])txm_arena_zero(&scratch, corners, 2 * sizeof(float));
            s->section = (float *)txm_arena_alloc(arena, corners, sizeof(float));
            if (map && section && s->section) {
                tmr_section_edges(r, &w.m, map, section);
                tmr_take_merged(r, &w.m, section, map);
            } else {
                s->section = NULL;
                status = TXM_OUT_OF_MEMORY;
            }
        }
    }
    txm_arena_free(&scratch);
    return status;
}

/* Make lines of the strips that are narrower than an edge of the result. Changes the surface:
   points, faces, normals, area; fills in s->section if there are any.

   angle    of creases, in degrees
   spacing  the edge length of the result
   return   TXM_OK; TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost     one walk per edge at which the surface turns, O(n) otherwise                         */
static txm_status tmr_make_ridges(tmr_surface *s, double angle, double spacing, txm_env *env,
                                  txm_arena *arena, txm_arena *scratch) {
    const size_t faces = (size_t)s->face_count;
    tmr_ridges r;
    size_t found = 0;
    int again = 1;
    if (angle >= 180) return TXM_OK;
    memset(&r, 0, sizeof r);
    r.s = s;
    r.env = env;
    r.spacing = spacing;
    r.sharp = sqrt(2 - 2 * txm_cos(angle * (TXM_PI / 180)));
    r.strip = (uint8_t *)txm_arena_zero(scratch, faces, 1);
    r.seen = (uint8_t *)txm_arena_zero(scratch, faces, 1);
    r.length = (float *)txm_arena_zero(scratch, faces, sizeof(float));
    if (!r.strip || !r.seen || !r.length) return TXM_OUT_OF_MEMORY;
    txm_status status = tmr_mark_strips(&r, &found);
    if (status != TXM_OK || found == 0) return status;
    int32_t *queue = (int32_t *)txm_arena_alloc(scratch, faces, sizeof(int32_t));
    r.component = (int32_t *)txm_arena_alloc(scratch, faces, sizeof(int32_t));
    r.number = (int32_t *)txm_arena_alloc(scratch, (size_t)s->vertex_count, sizeof(int32_t));
    r.section = (float(*)[2])txm_arena_alloc(scratch, faces, 2 * sizeof(float));
    if ((status = tmr_check_memory(scratch)) != TXM_OK) return status;
    tmr_fill_strip_corners(&r, (uint8_t *)r.number);
    tmr_drop_short_strips(&r, queue);
    for (int k = 0; k < TMR_RIDGE_TRIES && again && status == TXM_OK; k++) {
        found = 0;
        for (size_t f = 0; f < faces; f++) found += r.strip[f];
        if (found == 0) break;
        status = tmr_try_ridges(&r, arena, &again);
    }
    return status;
}

/* ---- giving the volume back ------------------------------------------------------------------ */

/* the cross-section of the strip that segment k of the lines stands for */
static double tmr_segment_section(const tmr_work *w, int32_t k) {
    const int32_t *v = w->s->vertex + 3 * w->l->face[k];
    for (int i = 0; i < 3; i++)
        if (v[i] != w->l->a[k] && v[i] != w->l->b[k]) return w->s->section[3 * w->l->face[k] + i];
    return 0;
}

/* that of an edge of the mesh from a to b on line id */
static double tmr_edge_section(const tmr_work *w, int32_t id, int32_t a, int32_t b) {
    const int32_t end[2] = {a, b};
    double sum = 0;
    int count = 0;
    for (int k = 0; k < 2; k++) {
        if (tmr_kind_of(&w->m, end[k]) != TRIMESH_CREASE) continue;
        sum += tmr_segment_section(w, w->m.source[end[k]]);
        count++;
    }
    return count ? sum / count : tmr_segment_section(w, w->l->first[id]);
}

enum { TMR_RIDGE_SIDES = 24 }; /* faces beside the ridges of one vertex, at most                  */

/* What moves a vertex of ridges: the volume that it has to lose, and in which direction: along the
   flats beside its ridges, but within the other faces around it. */
typedef struct tmr_shrink {
    double volume;
    txm_dvec3 area; /* a sixth of the sum of the area vectors (times 2) around: volume per way   */
    txm_dvec3 side[TMR_RIDGE_SIDES]; /* normals of the faces beside its ridges                   */
    int sides;
} tmr_shrink;

static void tmr_measure_shrink(const tmr_work *w, int32_t v, tmr_shrink *r) {
    const tmr_mesh *m = &w->m;
    int32_t c = m->corner[v];
    const int32_t first = c;
    memset(r, 0, sizeof *r);
    do {
        const int32_t a = m->vertex[tmr_next(c)], edge = tmr_prev(c); /* from v to a */
        if (!tmr_is_ghost_face(m, c / 3)) {
            const int32_t b = m->vertex[edge];
            r->area = txm_d3_mad(r->area, txm_d3_area2(m->p[v], m->p[a], m->p[b]), 1.0 / 6);
        }
        const double section =
            m->edge[edge] && !w->l->border[m->edge[edge] - 1] ? tmr_edge_section(w, m->edge[edge] - 1, v, a) : 0;
        if (section < 0 || section > 0) {
            r->volume += 0.5 * section * txm_d3_dist(m->p[v], m->p[a]);
            for (int k = 0; k < 2; k++) {
                const int32_t *u = m->vertex + (k ? m->opposite[edge] : edge) / 3 * 3;
                if (r->sides < TMR_RIDGE_SIDES)
                    r->side[r->sides++] = txm_d3_unit(txm_d3_area2(m->p[u[0]], m->p[u[1]], m->p[u[2]]));
            }
        }
        c = tmr_swing(m, c);
    } while (c != first);
}

static txm_dvec3 tmr_shrink_direction(const tmr_work *w, int32_t v, const tmr_shrink *r) {
    const tmr_mesh *m = &w->m;
    txm_dvec3 d = txm_d3(0, 0, 0);
    for (int k = 0; k < r->sides; k++) d = txm_d3_add(d, r->side[k]);
    for (int round = 0; round < 4; round++) { /* more than one face: alternate */
        int32_t c = m->corner[v];
        const int32_t first = c;
        do {
            const int32_t *u = m->vertex + c / 3 * 3;
            const txm_dvec3 n = txm_d3_unit(txm_d3_area2(m->p[u[0]], m->p[u[1]], m->p[u[2]]));
            int beside = tmr_is_ghost_face(m, c / 3) != 0;
            for (int k = 0; k < r->sides && !beside; k++)
                beside = txm_d3_dot(r->side[k], n) > TMR_RIDGE_AGREE;
            if (!beside) d = txm_d3_mad(d, n, -txm_d3_dot(d, n));
            c = tmr_swing(m, c);
        } while (c != first);
    }
    return txm_d3_unit(d);
}

/* Find where the vertices of ridges go for share of the volume that they have to lose, into
   w->moved. Returns that volume. */
static double tmr_shrink_ridges(tmr_work *w, double share) {
    tmr_mesh *m = &w->m;
    double sum = 0;
    for (int32_t v = 0; v < m->vertex_count; v++) {
        const int kind = m->corner[v] < 0 || tmr_is_ghost(m, v) ? TRIMESH_FREE : tmr_kind_of(m, v);
        tmr_shrink r;
        tmr_keep_place(w, v);
        if (kind != TRIMESH_CREASE && kind != TRIMESH_CORNER) continue;
        tmr_measure_shrink(w, v, &r);
        if (r.sides == 0) continue;
        const txm_dvec3 d = tmr_shrink_direction(w, v, &r);
        const double rate = txm_d3_dot(r.area, d), most = TMR_BAND_SHIFT * w->length * w->size[v];
        sum += r.volume;
        if (!(rate > TMR_RIDGE_RATE * w->length * w->length)) continue;
        const double way = share * r.volume / rate;
        w->moved[v] = txm_d3_mad(m->p[v], d, way > most ? -most : way < -most ? most : -way);
    }
    return sum;
}

/* the volume between the origin and the triangles at these places */
static double tmr_mesh_volume(const tmr_mesh *m, const txm_dvec3 *p) {
    double sum = 0;
    for (int32_t f = 0; f < m->face_count; f++) {
        const int32_t *v = m->vertex + 3 * f;
        if (v[0] < 0 || tmr_is_ghost_face(m, f)) continue;
        sum += txm_d3_dot(p[v[0]], txm_d3_cross(p[v[1]], p[v[2]]));
    }
    return sum / 6;
}

/* Move the vertices of ridges inwards until the strips that they stand for have their volume again.
   What neighbours do to each other is measured once, and taken into account. */
static void tmr_return_volume(tmr_work *w) {
    tmr_mesh *m = &w->m;
    if (!w->s->section) return;
    const double volume = tmr_shrink_ridges(w, 1);
    const double lost = tmr_mesh_volume(m, m->p) - tmr_mesh_volume(m, w->moved);
    const double share = fabs(lost) > 0.5 * fabs(volume) ? volume / lost : 1;
    if (share > 0.5 && share < 2) tmr_shrink_ridges(w, share);
    for (int32_t v = 0; v < m->vertex_count; v++)
        if (m->corner[v] >= 0 && !tmr_is_ghost(m, v)) m->p[v] = w->moved[v];
}

/* ---- flips -------------------------------------------------------------------------------- */

/* 2 inradius / circumradius, 1 for an equilateral triangle; negative if it disagrees with n */
static double tmr_quality(txm_dvec3 a, txm_dvec3 b, txm_dvec3 c, txm_dvec3 n) {
    const txm_dvec3 cross = txm_d3_area2(a, b, c);
    const double x = txm_d3_dist(b, c), y = txm_d3_dist(c, a), z = txm_d3_dist(a, b);
    const double bottom = (x + y + z) * x * y * z;
    const double area2 = txm_d3_len(cross);
    const double q = bottom > 0 ? 4 * area2 * area2 / bottom : 0; /* 8 A^2 / (s a b c) */
    return txm_d3_dot(cross, n) < TMR_LEAST_AGREEMENT * area2 ? -1 : q;
}

/* neighbours that a vertex should have, including ghosts */
static int tmr_ideal_valence(const tmr_mesh *m, int32_t v) {
    return tmr_kind_of(m, v) == TRIMESH_BORDER ? 5 : 6;
}
/* what it costs to have others: their square, of up to millions */
static int64_t tmr_valence_cost(const tmr_mesh *m, int32_t v, int change) {
    if (tmr_kind_of(m, v) == TRIMESH_CORNER) return 0;
    const int64_t d = (int64_t)m->valence[v] + change - tmr_ideal_valence(m, v);
    return d * d;
}

/* by how much flipping the edge opposite to c would lower the cost of valences */
static int64_t tmr_flip_gain(const tmr_mesh *m, int32_t c) {
    const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
    const int32_t d = m->vertex[c], e = m->vertex[m->opposite[c]];
    return tmr_valence_cost(m, a, 0) + tmr_valence_cost(m, b, 0) + tmr_valence_cost(m, d, 0) +
           tmr_valence_cost(m, e, 0) - tmr_valence_cost(m, a, -1) - tmr_valence_cost(m, b, -1) -
           tmr_valence_cost(m, d, 1) - tmr_valence_cost(m, e, 1);
}

typedef struct tmr_quad {
    int32_t a, b, d, e;        /* as in tmr_flip */
    double before, after;      /* the lower quality of the two triangles */
} tmr_quad;

/* What would flipping the edge opposite to c do? Returns 0 if it cannot be flipped. */
static int tmr_measure_flip(const tmr_work *w, int32_t c, tmr_quad *q) {
    const tmr_mesh *m = &w->m;
    if (!tmr_can_flip(m, c)) return 0;
    const int32_t o = m->opposite[c];
    q->a = m->vertex[tmr_next(c)];
    q->b = m->vertex[tmr_prev(c)];
    q->d = m->vertex[c];
    q->e = m->vertex[o];
    const txm_dvec3 a = m->p[q->a], b = m->p[q->b], d = m->p[q->d], e = m->p[q->e];
    q->before = fmin(tmr_quality(d, a, b, tmr_expected_normal(w, q->d, q->a, q->b)),
                     tmr_quality(e, b, a, tmr_expected_normal(w, q->e, q->b, q->a)));
    q->after = fmin(tmr_quality(d, a, e, tmr_expected_normal(w, q->d, q->a, q->e)),
                    tmr_quality(e, b, d, tmr_expected_normal(w, q->e, q->b, q->d)));
    return 1;
}

/* Is the sum of the two angles opposite to the edge of c over pi? (Delaunay) */
static int tmr_is_wide(const tmr_mesh *m, int32_t c) {
    const txm_dvec3 a = m->p[m->vertex[tmr_next(c)]], b = m->p[m->vertex[tmr_prev(c)]];
    const txm_dvec3 d = m->p[m->vertex[c]], e = m->p[m->vertex[m->opposite[c]]];
    const txm_dvec3 da = txm_d3_sub(a, d), db = txm_d3_sub(b, d), ea = txm_d3_sub(a, e),
                    eb = txm_d3_sub(b, e);
    const double cd = txm_d3_dot(da, db), ce = txm_d3_dot(ea, eb);
    if (cd >= 0 && ce >= 0) return 0;
    const double sd = txm_d3_len(txm_d3_cross(da, db)), se = txm_d3_len(txm_d3_cross(ea, eb));
    /* sin(d + e) < 0, with a margin so that equal diagonals stay */
    return sd * ce + se * cd <
           -1e-6 * sqrt(txm_d3_len2(da) * txm_d3_len2(db) * txm_d3_len2(ea) * txm_d3_len2(eb));
}

/* Which corners' edges are wide? Bits 0 to 2 of w->flag, one byte per triangle. */
static void tmr_wide_chunk(void *context, int index) {
    tmr_work *w = (tmr_work *)context;
    const tmr_mesh *m = &w->m;
    const int32_t from = index * TMR_CHUNK;
    const int32_t to = from + TMR_CHUNK < m->face_count ? from + TMR_CHUNK : m->face_count;
    for (int32_t f = from; f < to; f++) {
        w->flag[f] = 0;
        for (int32_t c = 3 * f; c < 3 * f + 3; c++) {
            if (m->vertex[c] < 0 || m->opposite[c] < c || m->edge[c] || !tmr_is_wide(m, c)) continue;
            w->flag[f] |= (uint8_t)(1 << (c - 3 * f));
        }
    }
}

/* Flip edges until the mesh is Delaunay, as far as the normals allow. */
static void tmr_flip_delaunay(tmr_work *w, int rounds) {
    tmr_mesh *m = &w->m;
    tmr_quad q;
    for (int round = 0; round < rounds; round++) {
        int32_t turned = 0;
        txm_parallel_for(w->env, (m->face_count + TMR_CHUNK - 1) / TMR_CHUNK, tmr_wide_chunk, w);
        for (int32_t f = 0; f < m->face_count; f++) {
            for (int32_t c = 3 * f; w->flag[f] && c < 3 * f + 3; c++) {
                if (!((w->flag[f] >> (c - 3 * f)) & 1) || m->edge[c]) continue;
                if (!tmr_is_wide(m, c) || !tmr_measure_flip(w, c, &q)) continue;
                if (q.after <= 0 && q.after <= q.before) continue;
                tmr_flip(m, c);
                turned++;
            }
        }
        if (turned == 0) break;
    }
}

/* Flip edges where that brings valences nearer to 6 and the triangles stay fair. */
static void tmr_flip_valences(tmr_work *w, int rounds, double least) {
    tmr_mesh *m = &w->m;
    tmr_quad q;
    for (int round = 0; round < rounds; round++) {
        int32_t turned = 0;
        for (int32_t c = 0; c < 3 * m->face_count; c++) {
            if (m->vertex[c] < 0 || m->opposite[c] < c || m->edge[c]) continue;
            if (tmr_flip_gain(m, c) <= 0 || !tmr_measure_flip(w, c, &q)) continue;
            if (q.after < least && q.after <= q.before) continue;
            tmr_flip(m, c);
            turned++;
        }
        if (turned == 0) break;
    }
}

/* ---- relaxation --------------------------------------------------------------------------- */

/* The target of a triangle: the equilateral triangle that fits it best, around its *centre,
   perpendicular to the normal *n expected there, part of the way to the wanted size. Its corner 0 is
   at centre + pull, which is returned, the others are rotated by 120 degrees. The fit is the mean of
   the three corners rotated back onto the first:
       pull = (A + R^-1 B + R^-2 C) / 3 = A / 2 + sqrt(3) / 6 n x (C - B)                        */
static txm_dvec3 tmr_fit(const tmr_work *w, const int32_t *v, txm_dvec3 *centre, txm_dvec3 *n) {
    const tmr_mesh *m = &w->m;
    const txm_dvec3 a = m->p[v[0]], b = m->p[v[1]], c = m->p[v[2]];
    *centre = txm_d3_scale(txm_d3_add(txm_d3_add(a, b), c), 1.0 / 3);
    *n = tmr_expected_normal(w, v[0], v[1], v[2]);
    txm_dvec3 arm = txm_d3_sub(a, *centre);
    arm = txm_d3_mad(arm, *n, -txm_d3_dot(arm, *n));
    txm_dvec3 pull =
        txm_d3_add(txm_d3_scale(arm, 0.5),
                   txm_d3_scale(txm_d3_cross(*n, txm_d3_sub(c, b)), 0.28867513459481287));
    const double size = w->length * (w->size[v[0]] + (double)w->size[v[1]] + w->size[v[2]]) / 3;
    const double radius = size * 0.57735026918962576, length = txm_d3_len(pull);
    if (length < 0.1 * radius) { /* inverted or flat: start from its first corner    */
        const double arm_length = txm_d3_len(arm);
        return arm_length > 0 ? txm_d3_scale(arm, radius / arm_length) : pull;
    }
    return txm_d3_scale(pull, ((1 - w->pull) * length + w->pull * radius) / length);
}

/* the two neighbours of a vertex on its line; returns 0 if there are not exactly two */
static int tmr_line_neighbors(const tmr_mesh *m, int32_t v, int32_t two[2]) {
    int count = 0;
    int32_t c = m->corner[v];
    const int32_t first = c;
    do { /* the edge from v to next(c) is opposite to prev(c) */
        if (m->edge[tmr_prev(c)]) {
            if (count < 2) two[count] = m->vertex[tmr_next(c)];
            count++;
        }
        c = tmr_swing(m, c);
    } while (c != first);
    return count == 2;
}

/* Where relaxation puts the free vertex v: the mean of the targets of its triangles, on the surface.
   Returns 0 if it has no triangles. */
static int tmr_relaxed_place(const tmr_work *w, int32_t v, tmr_place *at) {
    const tmr_mesh *m = &w->m;
    txm_dvec3 sum = txm_d3(0, 0, 0);
    int count = 0;
    int32_t c = m->corner[v];
    const int32_t first = c;
    do {
        const int32_t corners[3] = {v, m->vertex[tmr_next(c)], m->vertex[tmr_prev(c)]};
        if (!tmr_is_ghost(m, corners[1]) && !tmr_is_ghost(m, corners[2])) {
            txm_dvec3 centre, n;
            const txm_dvec3 pull = tmr_fit(w, corners, &centre, &n);
            sum = txm_d3_add(sum, txm_d3_add(centre, pull));
            count++;
        }
        c = tmr_swing(m, c);
    } while (c != first);
    if (count == 0) return 0;
    const txm_dvec3 to =
        txm_d3_mad(m->p[v], txm_d3_sub(txm_d3_scale(sum, 1.0 / count), m->p[v]), w->step);
    *at = tmr_project(w->s, to, m->source[v]);
    return 1;
}

/* Find the new place of vertex v; store it in w->moved and w->landed. */
static void tmr_relax_vertex(tmr_work *w, int32_t v) {
    const tmr_mesh *m = &w->m;
    const int kind = tmr_kind_of(m, v);
    tmr_place at;
    tmr_keep_place(w, v);
    if (w->mask && !w->mask[v]) return;
    if (m->corner[v] < 0 || kind == TRIMESH_CORNER || (m->flags[v] & (TMR_GHOST | TMR_PINNED)))
        return;
    if (kind != TRIMESH_FREE) {
        int32_t two[2];
        if (!tmr_line_neighbors(m, v, two)) return;
        const double a = 1 / (double)w->size[two[0]], b = 1 / (double)w->size[two[1]];
        const txm_dvec3 p = txm_d3_scale(
            txm_d3_add(txm_d3_scale(m->p[two[0]], a), txm_d3_scale(m->p[two[1]], b)), 1 / (a + b));
        w->moved[v] =
            tmr_project_line(w->s, w->l, txm_d3_scale(txm_d3_add(m->p[v], p), 0.5), &w->landed[v]);
    } else if (tmr_relaxed_place(w, v, &at)) {
        w->moved[v] = at.p;
        w->landed[v] = at.face;
    }
}

static void tmr_relax_chunk(void *context, int index) {
    tmr_work *w = (tmr_work *)context;
    const int32_t from = index * TMR_CHUNK;
    const int32_t to = from + TMR_CHUNK < w->m.vertex_count ? from + TMR_CHUNK : w->m.vertex_count;
    for (int32_t v = from; v < to; v++) tmr_relax_vertex(w, v);
}

static int tmr_has_moved(const tmr_work *w, int32_t v) {
    const txm_dvec3 a = w->moved[v], b = w->m.p[v];
    return a.x < b.x || a.x > b.x || a.y < b.y || a.y > b.y || a.z < b.z || a.z > b.z;
}

/* Would the triangle be worse than allowed after its corners have moved? */
static int tmr_is_spoilt(const tmr_work *w, int32_t face) {
    const tmr_mesh *m = &w->m;
    const int32_t *v = m->vertex + 3 * face;
    if (v[0] < 0 || tmr_is_ghost_face(m, face)) return 0;
    if (!tmr_has_moved(w, v[0]) && !tmr_has_moved(w, v[1]) && !tmr_has_moved(w, v[2])) return 0;
    const double after =
        tmr_agreement(w, v[0], v[1], v[2], w->moved[v[0]], w->moved[v[1]], w->moved[v[2]]);
    if (after >= TMR_LEAST_AGREEMENT) return 0;
    return after < tmr_agreement(w, v[0], v[1], v[2], m->p[v[0]], m->p[v[1]], m->p[v[2]]);
}

static void tmr_spoilt_chunk(void *context, int index) {
    tmr_work *w = (tmr_work *)context;
    const int32_t from = index * TMR_CHUNK;
    const int32_t to = from + TMR_CHUNK < w->m.face_count ? from + TMR_CHUNK : w->m.face_count;
    for (int32_t f = from; f < to; f++) w->flag[f] = (uint8_t)tmr_is_spoilt(w, f);
}

/* Mark the vertices of all spoilt triangles in w->bad. Returns how many such triangles there are. */
static int32_t tmr_find_spoilt(tmr_work *w) {
    tmr_mesh *m = &w->m;
    int32_t found = 0;
    txm_parallel_for(w->env, (m->face_count + TMR_CHUNK - 1) / TMR_CHUNK, tmr_spoilt_chunk, w);
    for (int32_t f = 0; f < m->face_count; f++) {
        if (!w->flag[f]) continue;
        found++;
        for (int k = 0; k < 3; k++) w->bad[m->vertex[3 * f + k]] = 1;
    }
    return found;
}

static void tmr_settle_chunk(void *context, int index) {
    tmr_work *w = (tmr_work *)context;
    tmr_mesh *m = &w->m;
    const int32_t from = index * TMR_CHUNK;
    const int32_t to = from + TMR_CHUNK < m->vertex_count ? from + TMR_CHUNK : m->vertex_count;
    for (int32_t v = from; v < to; v++) {
        if (m->corner[v] < 0 || tmr_is_ghost(m, v) || w->bad[v] || !tmr_has_moved(w, v)) continue;
        const int kind = tmr_kind_of(m, v);
        if (kind == TRIMESH_CORNER) continue;
        if (kind == TRIMESH_FREE) {
            tmr_place at = tmr_on_face(w->s, w->landed[v], w->moved[v]);
            at.p = w->moved[v]; /* fitting takes vertices off the surface */
            tmr_put(w, v, &at);
        } else {
            tmr_put_on_line(w, v, w->moved[v], w->landed[v]);
        }
    }
}

/* Move all vertices to w->moved, except those that would invert a triangle. */
static void tmr_settle(tmr_work *w) {
    tmr_mesh *m = &w->m;
    const int chunks = (m->vertex_count + TMR_CHUNK - 1) / TMR_CHUNK;
    memset(w->bad, 0, (size_t)m->vertex_count);
    for (int round = 0; round < 12; round++) {
        if (tmr_find_spoilt(w) == 0) break;
        for (int32_t v = 0; v < m->vertex_count; v++)
            if (w->bad[v]) w->moved[v] = m->p[v];
    }
    txm_parallel_for(w->env, chunks, tmr_settle_chunk, w);
}

static void tmr_relax(tmr_work *w) {
    const int chunks = (w->m.vertex_count + TMR_CHUNK - 1) / TMR_CHUNK;
    txm_parallel_for(w->env, chunks, tmr_relax_chunk, w);
    tmr_settle(w);
}

/* The edge length that as many equilateral triangles of the same total area would have, areas taken
   relative to the wanted sizes. */
static double tmr_ideal_length(const tmr_work *w) {
    const tmr_mesh *m = &w->m;
    double sum = 0;
    int32_t count = 0;
    for (int32_t f = 0; f < m->face_count; f++) {
        const int32_t *v = m->vertex + 3 * f;
        if (v[0] < 0 || tmr_is_ghost_face(m, f)) continue;
        const double size = (w->size[v[0]] + (double)w->size[v[1]] + w->size[v[2]]) / 3;
        sum += 0.5 * txm_d3_len(txm_d3_area2(m->p[v[0]], m->p[v[1]], m->p[v[2]])) / (size * size);
        count++;
    }
    return count ? sqrt(sum / count * 2.3094010767585034) : 0; /* area = sqrt(3) / 4 L^2 */
}

/* ---- splitting and collapsing ------------------------------------------------------------- */

/* length of the edge opposite to c relative to what is wanted there */
static double tmr_edge_size(const tmr_work *w, int32_t c) {
    const int32_t a = w->m.vertex[tmr_next(c)], b = w->m.vertex[tmr_prev(c)];
    const double wanted = w->length * 0.5 * (w->size[a] + (double)w->size[b]);
    return txm_d3_dist(w->m.p[a], w->m.p[b]) / (w->m.edge[c] ? wanted * w->line_scale : wanted);
}

static int tmr_is_real_edge(const tmr_mesh *m, int32_t c) {
    return m->vertex[c] >= 0 && m->opposite[c] > c && !tmr_is_ghost(m, m->vertex[tmr_next(c)]) &&
           !tmr_is_ghost(m, m->vertex[tmr_prev(c)]);
}

#define TMR_SPLINTER 0.02 /* ours: shortest over longest edge of triangles whose short side is merged
                             however long the others are: split, they would fill the mesh,     */
#define TMR_SPLINTER_BEND 0.05 /* ours: if that turns them by no more than this                 */

/* Does moving its corner from p to `to` leave the triangle p x y in its plane? */
static int tmr_stays_flat(txm_dvec3 p, txm_dvec3 to, txm_dvec3 x, txm_dvec3 y) {
    const txm_dvec3 n = txm_d3_area2(p, x, y), way = txm_d3_sub(to, p);
    const double off = txm_d3_dot(n, way);
    return off * off <= TMR_SPLINTER_BEND * TMR_SPLINTER_BEND * txm_d3_len2(n) * txm_d3_len2(way);
}

/* Does that make it, too thin to agree with anything, no thinner, without turning it over? */
static int tmr_widens_thin(txm_dvec3 p, txm_dvec3 to, txm_dvec3 x, txm_dvec3 y) {
    const txm_dvec3 before = txm_d3_area2(p, x, y), after = txm_d3_area2(to, x, y);
    const double longest2 = fmax(txm_d3_dist2(p, x), fmax(txm_d3_dist2(x, y), txm_d3_dist2(y, p)));
    return txm_d3_len(before) <= TMR_THIN * longest2 &&
           txm_d3_dot(before, after) > 0.9 * txm_d3_len2(before);
}

/* Would all triangles of b be fair after b is merged into a at position to? reach: no edge may
   become longer than this, relative to the wanted length, but with w->splinters for those of
   splinters, which are longer already; 0 = any. */
static int tmr_collapse_is_fair(const tmr_work *w, int32_t c, txm_dvec3 to, double reach) {
    const tmr_mesh *m = &w->m;
    const int32_t o = m->opposite[c];
    const double merged2 = txm_d3_dist2(m->p[m->vertex[tmr_next(c)]], m->p[m->vertex[tmr_prev(c)]]);
    for (int end = 0; end < 2; end++) {
        const int32_t first = end ? tmr_next(c) : tmr_prev(c), v = m->vertex[first];
        if (end && txm_d3_dist2(m->p[v], to) <= 0) break; /* a stays */
        int32_t i = first;
        do {
            const int32_t x = m->vertex[tmr_next(i)], y = m->vertex[tmr_prev(i)];
            if (i / 3 != c / 3 && i / 3 != o / 3 && !tmr_is_ghost(m, x) && !tmr_is_ghost(m, y)) {
                const double after = tmr_agreement(w, v, x, y, to, m->p[x], m->p[y]);
                const double wanted = w->length * 0.5 * (w->size[v] + (double)w->size[x]);
                const double most2 = reach * reach * wanted * wanted;
                const double vx2 = txm_d3_dist2(m->p[v], m->p[x]), vy2 = txm_d3_dist2(m->p[v], m->p[y]);
                const double long2 = fmax(most2, merged2 / (TMR_SPLINTER * TMR_SPLINTER));
                const int splinter = w->splinters && fmax(vx2, vy2) > long2 &&
                                     tmr_stays_flat(m->p[v], to, m->p[x], m->p[y]);
                const int longer = splinter && vx2 > long2;
                const int thin = splinter && tmr_widens_thin(m->p[v], to, m->p[x], m->p[y]);
                if (after < TMR_LEAST_AGREEMENT && !thin &&
                    after <= tmr_agreement(w, v, x, y, m->p[v], m->p[x], m->p[y]))
                    return 0;
                if (reach > 0 && !longer && txm_d3_dist2(to, m->p[x]) > most2) return 0;
            }
            i = tmr_swing(m, i);
        } while (i != first);
    }
    return 1;
}

/* Collapse the edge opposite to c, to the end that must stay, or else to its middle or either end.
   Returns 0 if that is not possible. */
static int tmr_try_collapse(tmr_work *w, int32_t c, double reach, int middle) {
    tmr_mesh *m = &w->m;
    const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
    /* the more constrained one stays: corner, line, free */
    const int rank_a = tmr_kind_of(m, a) == TRIMESH_CORNER ? 2 : tmr_kind_of(m, a) != TRIMESH_FREE;
    const int rank_b = tmr_kind_of(m, b) == TRIMESH_CORNER ? 2 : tmr_kind_of(m, b) != TRIMESH_FREE;
    if (rank_b > rank_a) c = m->opposite[c];
    const int32_t keep = m->vertex[tmr_next(c)];
    if (!tmr_can_collapse(m, c)) return 0;
    if (rank_a == 0 && rank_b == 0 && middle) {
        const tmr_place at =
            tmr_project(w->s, txm_d3_scale(txm_d3_add(m->p[a], m->p[b]), 0.5), m->source[keep]);
        if (tmr_collapse_is_fair(w, c, at.p, reach)) {
            tmr_collapse(m, c);
            tmr_put(w, keep, &at);
            return 1;
        }
    }
    if (!tmr_collapse_is_fair(w, c, m->p[keep], reach)) {
        if (rank_a != rank_b) return 0;
        c = m->opposite[c];
        if (!tmr_can_collapse(m, c)) return 0;
        if (!tmr_collapse_is_fair(w, c, m->p[m->vertex[tmr_next(c)]], reach)) return 0;
    }
    tmr_collapse(m, c);
    return 1;
}

/* Would the four triangles around a vertex at p on the edge of c be fair? */
static int tmr_split_is_fair(const tmr_work *w, int32_t c, txm_dvec3 p, txm_dvec3 n) {
    const tmr_mesh *m = &w->m;
    const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
    const double length2 = txm_d3_dist2(m->p[a], m->p[b]);
    if (fmax(txm_d3_dist2(p, m->p[a]), txm_d3_dist2(p, m->p[b])) > 0.6 * length2) return 0;
    for (int side = 0; side < 2; side++) {
        const int32_t i = side ? m->opposite[c] : c, d = m->vertex[i];
        const int32_t x = m->vertex[tmr_next(i)], y = m->vertex[tmr_prev(i)];
        if (tmr_is_ghost(m, d)) continue;
        const txm_dvec3 one = txm_d3_area2(m->p[d], m->p[x], p),
                        two = txm_d3_area2(m->p[d], p, m->p[y]);
        const double before = tmr_agreement(w, d, x, y, m->p[d], m->p[x], m->p[y]);
        const txm_dvec3 whole = txm_d3_area2(m->p[d], m->p[x], m->p[y]);
        if (before < TMR_LEAST_AGREEMENT) continue;
        if (txm_d3_dot(one, whole) <= 0 || txm_d3_dot(two, whole) <= 0) return 0;
        if (m->edge[c]) continue;
        if (txm_d3_dot(one, n) < 0.2 * txm_d3_len(one) ||
            txm_d3_dot(two, n) < 0.2 * txm_d3_len(two))
            return 0;
    }
    return 1;
}

/* The place on the line half-way between two neighbours on it, a and b; *k: its segment. Between two
   corners, which may belong to other lines too, that is the middle of the whole line. */
static txm_dvec3 tmr_line_middle(const tmr_work *w, int32_t id, int32_t a, int32_t b, int32_t *k) {
    const tmr_mesh *m = &w->m;
    const int bound_a = tmr_kind_of(m, a) == TRIMESH_CORNER;
    const int bound_b = tmr_kind_of(m, b) == TRIMESH_CORNER;
    if (bound_a && bound_b) return tmr_line_at(w->s, w->l, id, 0.5 * w->l->length[id], k);
    *k = m->source[bound_a ? b : a];
    return tmr_project_line(w->s, w->l, txm_d3_scale(txm_d3_add(m->p[a], m->p[b]), 0.5), k);
}

/* Split the edge opposite to c at its middle, on the surface. Returns the new vertex; -1 if there
   is no room or the triangles would not be fair. */
static int32_t tmr_split_edge(tmr_work *w, int32_t c) {
    tmr_mesh *m = &w->m;
    const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
    const int32_t line = m->edge[c];
    const txm_dvec3 middle = txm_d3_scale(txm_d3_add(m->p[a], m->p[b]), 0.5);
    if (line) {
        const int32_t id = line - 1;
        int32_t k;
        const txm_dvec3 p = tmr_line_middle(w, id, a, b, &k);
        if (!tmr_split_is_fair(w, c, p, txm_d3(0, 0, 0))) return -1;
        const int32_t v = tmr_split(m, c);
        if (v < 0) return v;
        m->flags[v] = w->l->border[id] ? TRIMESH_BORDER : TRIMESH_CREASE;
        tmr_put_on_line(w, v, p, k);
        return v;
    }
    const tmr_place at = tmr_project_between(w, a, b, middle);
    if (!tmr_split_is_fair(w, c, at.p, tmr_normal_at(w->s, w->l, &at))) return -1;
    const int32_t v = tmr_split(m, c);
    if (v >= 0) tmr_put(w, v, &at);
    return v;
}

/* an edge's length relative to what is allowed; above 1 it must be split */
static double tmr_excess(const tmr_work *w, int32_t c, double limit, double line_limit) {
    return tmr_edge_size(w, c) / (w->m.edge[c] ? line_limit : limit);
}

/* Is no other edge of the two triangles longer? (always true on lines) */
static int tmr_is_longest(const tmr_work *w, int32_t c) {
    const tmr_mesh *m = &w->m;
    const int32_t o = m->opposite[c];
    const int32_t other[4] = {tmr_next(c), tmr_prev(c), tmr_next(o), tmr_prev(o)};
    const double size = tmr_edge_size(w, c);
    if (m->edge[c]) return 1;
    for (int k = 0; k < 4; k++) {
        if (tmr_edge_size(w, other[k]) > size * (1 + 1e-9)) return 0;
    }
    return 1;
}

/* Split all edges longer than limit, on lines longer than line_limit. Returns how many. The longest
   first, and only where an edge is the longest of its triangles: otherwise slivers arise. */
static int32_t tmr_split_long(tmr_work *w, double limit, double line_limit) {
    tmr_mesh *m = &w->m;
    int32_t count = 0;
    double least = 0;
    for (int32_t c = 0; c < 3 * m->face_count; c++)
        if (tmr_is_real_edge(m, c)) least = fmax(least, tmr_excess(w, c, limit, line_limit));
    for (int round = 0; round < 100 && least > 1; round++) {
        const int32_t before = count, corners = 3 * m->face_count;
        least = fmax(1, 0.8 * least);
        for (int32_t c = 0; c < corners; c++) {
            if (!tmr_is_real_edge(m, c) || tmr_excess(w, c, limit, line_limit) < least) continue;
            if (!tmr_is_longest(w, c)) continue;
            count += tmr_split_edge(w, c) >= 0;
        }
        if (count != before) tmr_flip_delaunay(w, 2);
    }
    return count;
}

static int32_t tmr_collapse_short(tmr_work *w, double limit, double line_limit, double reach,
                                  int middle) {
    tmr_mesh *m = &w->m;
    int32_t count = 0;
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        if (!tmr_is_real_edge(m, c)) continue;
        if (tmr_edge_size(w, c) >= (m->edge[c] ? line_limit : limit)) continue;
        count += tmr_try_collapse(w, c, reach, middle);
    }
    return count;
}

/* ---- neighbours side by side in memory ------------------------------------------------------ */

/* Splits and collapses leave triangles all over their arrays, between dead ones. So they are numbered
   anew now and then: breadth-first across their edges, and vertices in the order in which triangles
   come to them, so that what passes over the mesh finds most of it in the cache. */

/* List the live triangles breadth-first; number[f]: the place of triangle f in the list. */
static void tmr_breadth_first(const tmr_mesh *m, int32_t *list, int32_t *number) {
    int32_t count = 0, done = 0;
    for (int32_t f = 0; f < m->face_count; f++) number[f] = -1;
    for (int32_t f = 0; f < m->face_count; f++) {
        if (tmr_is_dead(m, f) || number[f] >= 0) continue;
        TRIMESH_ASSERT(count < m->live_faces);
        number[f] = count;
        list[count++] = f;
        for (; done < count; done++) {
            for (int32_t c = 3 * list[done]; c < 3 * list[done] + 3; c++) {
                const int32_t g = m->opposite[c] / 3;
                if (number[g] >= 0) continue;
                TRIMESH_ASSERT(count < m->live_faces);
                number[g] = count;
                list[count++] = g;
            }
        }
    }
    TRIMESH_ASSERT(count == m->live_faces);
}

/* The triangles in the order of the list; room: 3 per triangle. */
static void tmr_permute_faces(tmr_mesh *m, const int32_t *list, const int32_t *number, int32_t *room) {
    int32_t *const array[3] = {m->vertex, m->opposite, m->edge};
    for (int a = 0; a < 3; a++) {
        for (int32_t f = 0; f < m->live_faces; f++) {
            for (int32_t k = 0; k < 3; k++) {
                const int32_t x = array[a][3 * list[f] + k];
                room[3 * f + k] = a == 1 ? 3 * number[x / 3] + x % 3 : x;
            }
        }
        memcpy(array[a], room, 3 * (size_t)m->live_faces * sizeof(int32_t));
    }
    m->face_count = m->live_faces;
}

/* The vertices in the order in which triangles come to them, those of no triangle left out.
   number, list: scratch, 1 per vertex. Uses w->moved, w->landed and w->mask_room. */
static void tmr_permute_vertices(tmr_work *w, int32_t *number, int32_t *list) {
    tmr_mesh *m = &w->m;
    txm_dvec3 *const place[2] = {m->p, m->n};
    int32_t *const whole[2] = {m->source, m->valence};
    int32_t count = 0;
    for (int32_t v = 0; v < m->vertex_count; v++) number[v] = -1;
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        const int32_t v = m->vertex[c];
        if (number[v] < 0) {
            TRIMESH_ASSERT(count < m->live + m->ghosts);
            number[v] = count;
            list[count++] = v;
        }
        m->vertex[c] = number[v];
    }
    TRIMESH_ASSERT(count == m->live + m->ghosts);
    for (int a = 0; a < 2; a++) {
        for (int32_t v = 0; v < count; v++) w->moved[v] = place[a][list[v]];
        memcpy(place[a], w->moved, (size_t)count * sizeof(txm_dvec3));
        for (int32_t v = 0; v < count; v++) w->landed[v] = whole[a][list[v]];
        memcpy(whole[a], w->landed, (size_t)count * sizeof(int32_t));
    }
    float *const size = (float *)w->moved;
    uint8_t *const flags = w->mask_room;
    for (int32_t v = 0; v < count; v++) {
        size[v] = w->size[list[v]];
        flags[v] = m->flags[list[v]];
    }
    memcpy(w->size, size, (size_t)count * sizeof(float));
    memcpy(m->flags, flags, (size_t)count);
    m->vertex_count = count;
    for (int32_t c = 3 * m->face_count - 1; c >= 0; c--) m->corner[m->vertex[c]] = c;
}

/* Number the mesh anew, without dead slots. Costs O(slots). */
static txm_status tmr_renumber(tmr_work *w) {
    tmr_mesh *m = &w->m;
    const size_t faces = (size_t)m->face_count, vertices = (size_t)m->vertex_count;
    const size_t most = faces > vertices ? faces : vertices;
    txm_arena arena;
    txm_arena_init(&arena, w->env);
    int32_t *number = (int32_t *)txm_arena_alloc(&arena, most, sizeof(int32_t));
    int32_t *list = (int32_t *)txm_arena_alloc(&arena, most, sizeof(int32_t));
    int32_t *room = (int32_t *)txm_arena_alloc(&arena, (size_t)m->live_faces, 3 * sizeof(int32_t));
    const txm_status status = tmr_check_memory(&arena);
    if (status == TXM_OK) {
        tmr_breadth_first(m, list, number);
        tmr_permute_faces(m, list, number, room);
        tmr_permute_vertices(w, number, list);
    }
    txm_arena_free(&arena);
    return status;
}

/* ---- fields on a hierarchy ---------------------------------------------------------------- */

/* One level of the hierarchy: nodes with neighbours; level 0 are the vertices of the mesh, each
   further one joins pairs of nodes. Each node has a tangent plane with the axes x and n x x, in
   which it holds a direction with six equal arms (as the sixth power of a complex number) and a
   point of the triangular lattice that these arms span. */
typedef struct tmr_level {
    int32_t count, links;
    txm_dvec3 *p, *n, *x;
    float *area;
    float *scale;       /* lattice spacing                                                 */
    double (*z)[2];     /* direction to the sixth power                                    */
    txm_dvec3 *q;       /* a lattice point near p                                          */
    uint8_t *fixed;     /* 1: z and q are given (lines), 2: q is (corners)                 */
    int32_t *parent;    /* node of the next level                                          */
    int32_t *first, *to; /* neighbours of i: to[first[i]] .. to[first[i + 1] - 1]          */
    float *weight;      /* of each link                                                    */
    float (*turn)[2];   /* per link: takes the neighbour's z into this node's frame        */
} tmr_level;

enum { TMR_MAX_LEVELS = 40 };

typedef struct tmr_fields {
    tmr_level level[TMR_MAX_LEVELS];
    int count;
    int32_t *node;   /* of each vertex of the mesh, -1 = none */
    int32_t *vertex; /* of each node of level 0               */
} tmr_fields;

static txm_dvec3 tmr_any_axis(txm_dvec3 n) {
    const double x = fabs(n.x), y = fabs(n.y), z = fabs(n.z);
    const txm_dvec3 axis = x <= y && x <= z ? txm_d3(1, 0, 0)
                           : y <= z         ? txm_d3(0, 1, 0)
                                            : txm_d3(0, 0, 1);
    return txm_d3_unit(txm_d3_cross(n, axis));
}

static void tmr_complex_mul(const double a[2], const double b[2], double out[2]) {
    const double re = a[0] * b[0] - a[1] * b[1], im = a[0] * b[1] + a[1] * b[0];
    out[0] = re;
    out[1] = im;
}
static void tmr_sixth_power(const double a[2], double out[2]) {
    double square[2], fourth[2];
    tmr_complex_mul(a, a, square);
    tmr_complex_mul(square, square, fourth);
    tmr_complex_mul(fourth, square, out);
}
/* the square root of a unit complex number with half its angle, which lies in -pi..pi */
static void tmr_half_angle(const double a[2], double out[2]) {
    const double re = sqrt(fmax(0, 0.5 * (1 + a[0]))), im = sqrt(fmax(0, 0.5 * (1 - a[0])));
    out[0] = re;
    out[1] = a[1] < 0 ? -im : im;
}
/* A sixth root of a complex number, of unit length. A third of an angle is about 1/4 + 1/16 + 1/64
   of it; Newton's method does the rest. sqrt gives the same bits with every C library, atan2 and
   cos do not. */
static void tmr_sixth_root(const double z[2], double out[2]) {
    const double length = sqrt(z[0] * z[0] + z[1] * z[1]);
    double a[2] = {1, 0}, r[2], part[2];
    if (length > 1e-100) {
        a[0] = z[0] / length;
        a[1] = z[1] / length;
    }
    tmr_half_angle(a, a); /* now the cube root of this one */
    tmr_half_angle(a, part);
    tmr_half_angle(part, part);
    r[0] = part[0];
    r[1] = part[1];
    for (int k = 0; k < 2; k++) {
        tmr_half_angle(part, part);
        tmr_half_angle(part, part);
        tmr_complex_mul(r, part, r);
    }
    for (int k = 0; k < 3; k++) { /* r = (2 r + a / r^2) / 3; 1 / r^2 = conj(r)^2 for unit r */
        const double conjugate[2] = {r[0], -r[1]};
        double square[2], term[2];
        tmr_complex_mul(conjugate, conjugate, square);
        tmr_complex_mul(a, square, term);
        r[0] = (2 * r[0] + term[0]) / 3;
        r[1] = (2 * r[1] + term[1]) / 3;
        const double n = sqrt(r[0] * r[0] + r[1] * r[1]);
        r[0] /= n;
        r[1] /= n;
    }
    out[0] = r[0];
    out[1] = r[1];
}

/* The complex number that takes coordinates in the frame (n1, x1) to the frame (n0, x0), when n1 is
   rotated onto n0 by the shortest rotation. */
static void tmr_transport(txm_dvec3 n0, txm_dvec3 x0, txm_dvec3 n1, txm_dvec3 x1, double out[2]) {
    const txm_dvec3 axis = txm_d3_cross(n1, n0);
    const double cosine = txm_d3_dot(n0, n1);
    /* R x = x cos + axis x x + axis (axis . x) / (1 + cos) */
    const double k = txm_d3_dot(axis, x1) / (1 + fmax(cosine, -0.99));
    txm_dvec3 x = txm_d3_add(txm_d3_add(txm_d3_scale(x1, cosine), txm_d3_cross(axis, x1)),
                             txm_d3_scale(axis, k));
    const double re = txm_d3_dot(x, x0), im = txm_d3_dot(x, txm_d3_cross(n0, x0));
    const double length = sqrt(re * re + im * im);
    out[0] = length > 1e-12 ? re / length : 1;
    out[1] = length > 1e-12 ? im / length : 0;
}

static txm_status tmr_level_alloc(tmr_level *level, int32_t count, int32_t links,
                                  txm_arena *arena) {
    const size_t n = (size_t)count, k = (size_t)links;
    level->count = count;
    level->links = links;
    level->p = (txm_dvec3 *)txm_arena_alloc(arena, n, sizeof(txm_dvec3));
    level->n = (txm_dvec3 *)txm_arena_alloc(arena, n, sizeof(txm_dvec3));
    level->x = (txm_dvec3 *)txm_arena_alloc(arena, n, sizeof(txm_dvec3));
    level->q = (txm_dvec3 *)txm_arena_alloc(arena, n, sizeof(txm_dvec3));
    level->area = (float *)txm_arena_alloc(arena, n, sizeof(float));
    level->scale = (float *)txm_arena_alloc(arena, n, sizeof(float));
    level->z = (double(*)[2])txm_arena_zero(arena, n, 2 * sizeof(double));
    level->fixed = (uint8_t *)txm_arena_zero(arena, n, 1);
    level->parent = (int32_t *)txm_arena_alloc(arena, n, sizeof(int32_t));
    level->first = (int32_t *)txm_arena_alloc(arena, n + 1, sizeof(int32_t));
    level->to = (int32_t *)txm_arena_alloc(arena, k + 1, sizeof(int32_t));
    level->weight = (float *)txm_arena_alloc(arena, k + 1, sizeof(float));
    level->turn = (float(*)[2])txm_arena_alloc(arena, k + 1, 2 * sizeof(float));
    return tmr_check_memory(arena);
}

/* Level 0: the vertices. */
static txm_status tmr_level_zero(const tmr_work *w, tmr_fields *f, txm_arena *arena) {
    const tmr_mesh *m = &w->m;
    int32_t count = 0, links = 0;
    f->node = (int32_t *)txm_arena_alloc(arena, (size_t)m->vertex_count, sizeof(int32_t));
    f->vertex = (int32_t *)txm_arena_alloc(arena, (size_t)m->live, sizeof(int32_t));
    if (!f->node || !f->vertex) return TXM_OUT_OF_MEMORY;
    for (int32_t v = 0; v < m->vertex_count; v++) {
        f->node[v] = -1;
        if (m->corner[v] < 0 || tmr_is_ghost(m, v)) continue;
        f->vertex[count] = v;
        f->node[v] = count++;
        links += m->valence[v];
    }
    tmr_level *level = &f->level[0];
    const txm_status status = tmr_level_alloc(level, count, links, arena);
    if (status != TXM_OK) return status;
    int32_t k = 0;
    for (int32_t i = 0; i < count; i++) {
        const int32_t v = f->vertex[i], first = m->corner[v];
        int32_t c = first;
        level->p[i] = level->q[i] = m->p[v];
        level->n[i] = m->n[v];
        level->x[i] = tmr_any_axis(m->n[v]);
        level->area[i] = 1;
        level->scale[i] = txm_float(w->length * w->size[v]);
        level->first[i] = k;
        do {
            const int32_t to = m->vertex[tmr_next(c)];
            if (!tmr_is_ghost(m, to)) {
                TRIMESH_ASSERT(k < links); /* the valences count all neighbours, also ghosts */
                level->to[k] = f->node[to];
                level->weight[k++] = 1;
            }
            c = tmr_swing(m, c);
        } while (c != first);
        const int kind = tmr_kind_of(m, v);
        level->fixed[i] = kind == TRIMESH_FREE ? 0 : kind == TRIMESH_CORNER ? 2 : 1;
        int32_t two[2];
        if (level->fixed[i] == 1 && tmr_line_neighbors(m, v, two)) {
            const txm_dvec3 d = txm_d3_sub(m->p[two[1]], m->p[two[0]]);
            double a[2] = {txm_d3_dot(d, level->x[i]),
                           txm_d3_dot(d, txm_d3_cross(level->n[i], level->x[i]))};
            const double n = sqrt(a[0] * a[0] + a[1] * a[1]);
            a[0] = n > 0 ? a[0] / n : 1;
            a[1] = n > 0 ? a[1] / n : 0;
            tmr_sixth_power(a, level->z[i]);
        } else if (level->fixed[i] == 1) {
            level->fixed[i] = 2;
        }
    }
    level->first[count] = level->links = k;
    return TXM_OK;
}

/* The next level: each node merged with the most similar neighbour. */
static txm_status tmr_level_up(const tmr_level *a, tmr_level *b, txm_arena *arena,
                               txm_arena *scratch) {
    int32_t count = 0;
    int32_t *child = (int32_t *)txm_arena_alloc(scratch, 2 * (size_t)a->count, sizeof(int32_t));
    int32_t *seen = (int32_t *)txm_arena_alloc(scratch, (size_t)a->count, sizeof(int32_t));
    if (!child || !seen) return TXM_OUT_OF_MEMORY;
    for (int32_t i = 0; i < a->count; i++) a->parent[i] = -1;
    for (int32_t i = 0; i < a->count; i++) {
        double best_score = -2;
        int32_t best = -1;
        if (a->parent[i] >= 0) continue;
        for (int32_t k = a->first[i]; k < a->first[i + 1]; k++) {
            const int32_t j = a->to[k];
            if (a->parent[j] >= 0) continue;
            const double x = a->area[i], y = a->area[j];
            const double score = txm_d3_dot(a->n[i], a->n[j]) * (x < y ? x / y : y / x);
            if (score > best_score) {
                best_score = score;
                best = j;
            }
        }
        a->parent[i] = count;
        if (best >= 0) a->parent[best] = count;
        child[2 * count] = i;
        child[2 * count + 1] = best;
        count++;
    }
    const txm_status status = tmr_level_alloc(b, count, a->links, arena);
    if (status != TXM_OK) return status;
    int32_t k = 0;
    for (int32_t i = 0; i < count; i++) seen[i] = -1;
    for (int32_t i = 0; i < count; i++) {
        txm_dvec3 p = txm_d3(0, 0, 0), n = p;
        double area = 0, scale = 0;
        int fixed = 0, only = 1;
        const int32_t first = k;
        b->first[i] = k;
        b->z[i][0] = b->z[i][1] = 0;
        for (int side = 0; side < 2; side++) {
            const int32_t c = child[2 * i + side];
            if (c < 0) continue;
            p = txm_d3_mad(p, a->p[c], a->area[c]);
            n = txm_d3_mad(n, a->n[c], a->area[c]);
            scale += (double)a->scale[c] * a->area[c];
            area += a->area[c];
            fixed |= a->fixed[c] == 1;
            only = only && a->fixed[c];
            for (int32_t j = a->first[c]; j < a->first[c + 1]; j++) {
                const int32_t to = a->parent[a->to[j]];
                if (to == i) continue;
                if (seen[to] < first) {
                    TRIMESH_ASSERT(k < a->links); /* each comes from a link of its own below */
                    seen[to] = k;
                    b->to[k] = to;
                    b->weight[k++] = 0;
                }
                b->weight[seen[to]] += a->weight[j];
            }
        }
        b->p[i] = b->q[i] = txm_d3_scale(p, 1 / area);
        b->n[i] = txm_d3_len2(n) > 1e-12 ? txm_d3_unit(n) : a->n[child[2 * i]];
        b->x[i] = tmr_any_axis(b->n[i]);
        b->area[i] = txm_float(area);
        b->scale[i] = txm_float(scale / area);
        b->fixed[i] = (uint8_t)fixed;
        for (int side = 0; side < 2 && fixed; side++) {
            const int32_t c = child[2 * i + side];
            double t[2], six[2], z[2];
            if (c < 0 || a->fixed[c] != 1) continue;
            tmr_transport(b->n[i], b->x[i], a->n[c], a->x[c], t);
            tmr_sixth_power(t, six);
            tmr_complex_mul(a->z[c], six, z);
            b->z[i][0] += z[0];
            b->z[i][1] += z[1];
            b->q[i] = a->q[c];
        }
    }
    b->first[count] = b->links = k;
    return TXM_OK;
}

static void tmr_level_turns(tmr_level *level) {
    for (int32_t i = 0; i < level->count; i++) {
        for (int32_t k = level->first[i]; k < level->first[i + 1]; k++) {
            const int32_t j = level->to[k];
            double t[2], six[2];
            tmr_transport(level->n[i], level->x[i], level->n[j], level->x[j], t);
            tmr_sixth_power(t, six);
            level->turn[k][0] = txm_float(six[0]);
            level->turn[k][1] = txm_float(six[1]);
        }
    }
}

/* Directions: each node takes the mean of its neighbours (Gauss and Seidel), which makes the field
   as smooth as it can be, with its magnitude going to 0 where arms do not fit. */
static txm_status tmr_smooth_directions(tmr_work *work, tmr_level *level, int sweeps) {
    for (int sweep = 0; sweep < sweeps; sweep++) {
        double most = 0;
        if (tmr_tick(work, level->count)) return TXM_CANCELLED;
        for (int32_t i = 0; i < level->count; i++) {
            double re = 0, im = 0, sum = 0;
            if (level->fixed[i] == 1) continue;
            for (int32_t k = level->first[i]; k < level->first[i + 1]; k++) {
                const double *z = level->z[level->to[k]];
                const double c = level->turn[k][0], s = level->turn[k][1], w = level->weight[k];
                re += w * (z[0] * c - z[1] * s);
                im += w * (z[0] * s + z[1] * c);
                sum += w;
            }
            if (sum <= 0) continue;
            level->z[i][0] = re / sum;
            level->z[i][1] = im / sum;
            most = fmax(most, fmax(fabs(re), fabs(im)) / sum);
        }
        if (most > 0 && most < 1e-3) { /* avoids underflow; fixed nodes do not matter then */
            for (int32_t i = 0; i < level->count; i++) {
                if (level->fixed[i] == 1) continue;
                level->z[i][0] /= most;
                level->z[i][1] /= most;
            }
        }
    }
    return TXM_OK;
}

static txm_status tmr_solve_directions(tmr_work *w, tmr_fields *f, uint64_t seed) {
    tmr_level *top = &f->level[f->count - 1];
    txm_rng rng = txm_rng_make(seed, 1);
    for (int32_t i = 0; i < top->count; i++) {
        const double re = txm_rng_double(&rng) - 0.5, im = txm_rng_double(&rng) - 0.5;
        if (top->fixed[i] == 1) continue;
        top->z[i][0] = re;
        top->z[i][1] = im;
    }
    for (int l = f->count - 1; l >= 0; l--) {
        tmr_level *level = &f->level[l];
        if (tmr_tick(w, level->count)) return TXM_CANCELLED;
        tmr_level_turns(level);
        if (l < f->count - 1) {
            const tmr_level *up = &f->level[l + 1];
            for (int32_t i = 0; i < level->count; i++) {
                const int32_t j = level->parent[i];
                double t[2], six[2];
                if (level->fixed[i] == 1) continue;
                tmr_transport(level->n[i], level->x[i], up->n[j], up->x[j], t);
                tmr_sixth_power(t, six);
                tmr_complex_mul(up->z[j], six, level->z[i]);
            }
        }
        const txm_status status =
            tmr_smooth_directions(w, level, l == f->count - 1 ? 100 : l == 0 ? 5 : 10);
        if (status != TXM_OK) return status;
    }
    for (int l = 0; l < f->count; l++) { /* x becomes one of the arms */
        tmr_level *level = &f->level[l];
        for (int32_t i = 0; i < level->count; i++) {
            double r[2];
            const txm_dvec3 y = txm_d3_cross(level->n[i], level->x[i]);
            tmr_sixth_root(level->z[i], r);
            level->x[i] = txm_d3_add(txm_d3_scale(level->x[i], r[0]), txm_d3_scale(y, r[1]));
        }
    }
    return TXM_OK;
}

/* ---- lattice points ----------------------------------------------------------------------- */

/* the second arm of a lattice: x turned by 60 degrees about n */
static txm_dvec3 tmr_arm(txm_dvec3 n, txm_dvec3 x) {
    return txm_d3_add(txm_d3_scale(x, 0.5), txm_d3_scale(txm_d3_cross(n, x), 0.86602540378443865));
}

/* lattice coordinates of d: d = a x + b y with the arms x and y, in units of the spacing */
static void tmr_lattice_at(txm_dvec3 d, txm_dvec3 x, txm_dvec3 y, double inverse, double *a,
                           double *b) {
    const double dx = txm_d3_dot(d, x) * inverse, dy = txm_d3_dot(d, y) * inverse;
    *a = (dx - 0.5 * dy) * (4.0 / 3);
    *b = (dy - 0.5 * dx) * (4.0 / 3);
}

/* the point of the lattice through q that lies nearest to p (in the tangent plane) */
static txm_dvec3 tmr_lattice_round(txm_dvec3 q, txm_dvec3 x, txm_dvec3 y, double spacing,
                                   txm_dvec3 p) {
    double a, b, least = 0;
    txm_dvec3 best = q;
    tmr_lattice_at(txm_d3_sub(p, q), x, y, 1 / spacing, &a, &b);
    const double a0 = floor(a), b0 = floor(b);
    for (int k = 0; k < 4; k++) {
        const txm_dvec3 to =
            txm_d3_mad(txm_d3_mad(q, x, (a0 + (k & 1)) * spacing), y, (b0 + (k >> 1)) * spacing);
        const double d = txm_d3_dist2(to, p);
        if (k == 0 || d < least) {
            least = d;
            best = to;
        }
    }
    return best;
}

/* a point about half-way between two tangent planes: where they cross, or else the middle */
static txm_dvec3 tmr_between(txm_dvec3 p0, txm_dvec3 n0, txm_dvec3 p1, txm_dvec3 n1) {
    const double n00 = txm_d3_dot(n0, p0), n01 = txm_d3_dot(n0, p1), n10 = txm_d3_dot(n1, p0);
    const double n11 = txm_d3_dot(n1, p1), c = txm_d3_dot(n0, n1);
    const double d = 1 / (1 - c * c + 1e-4);
    const double l0 = 2 * (n01 - n00 - c * (n10 - n11)) * d;
    const double l1 = 2 * (n10 - n11 - c * (n01 - n00)) * d;
    const txm_dvec3 middle = txm_d3_scale(txm_d3_add(p0, p1), 0.5);
    return txm_d3_sub(middle,
                      txm_d3_scale(txm_d3_add(txm_d3_scale(n0, -l0), txm_d3_scale(n1, -l1)), 0.25));
}

/* Of the lattice points of two nodes about half-way between them, the closest pair: the place on
   which both should agree. */
static void tmr_closest_pair(const tmr_level *level, int32_t i, txm_dvec3 qi, int32_t j,
                             txm_dvec3 *a, txm_dvec3 *b) {
    const double spacing = 0.5 * (level->scale[i] + (double)level->scale[j]);
    const txm_dvec3 middle = tmr_between(level->p[i], level->n[i], level->p[j], level->n[j]);
    txm_dvec3 from[2], x[2], y[2]; /* each has four lattice points around the middle: a rhombus */
    for (int side = 0; side < 2; side++) {
        const int32_t v = side ? j : i;
        const txm_dvec3 q = side ? level->q[j] : qi, arm = tmr_arm(level->n[v], level->x[v]);
        double s, t;
        tmr_lattice_at(txm_d3_sub(middle, q), level->x[v], arm, 1 / spacing, &s, &t);
        x[side] = txm_d3_scale(level->x[v], spacing);
        y[side] = txm_d3_scale(arm, spacing);
        from[side] = txm_d3_mad(txm_d3_mad(q, x[side], floor(s)), y[side], floor(t));
    }
    /* squared distances, less that of the first pair: |d + p - r|^2 - |d|^2 = (p + 2 d) p + (r - 2 d) r
       - 2 p r, where p and r are 0, x, y or x + y of either side */
    const txm_dvec3 d = txm_d3_sub(from[0], from[1]);
    const double unit = spacing * spacing;
    const double dx[2] = {2 * txm_d3_dot(d, x[0]), -2 * txm_d3_dot(d, x[1])};
    const double dy[2] = {2 * txm_d3_dot(d, y[0]), -2 * txm_d3_dot(d, y[1])};
    const double xx = 2 * txm_d3_dot(x[0], x[1]), xy = 2 * txm_d3_dot(x[0], y[1]);
    const double yx = 2 * txm_d3_dot(y[0], x[1]), yy = 2 * txm_d3_dot(y[0], y[1]);
    const double one[4] = {0, unit + dx[0], unit + dy[0], 3 * unit + dx[0] + dy[0]};
    const double two[4] = {0, unit + dx[1], unit + dy[1], 3 * unit + dx[1] + dy[1]};
    const double both[4][4] = {{0, 0, 0, 0},
                               {0, xx, xy, xx + xy},
                               {0, yx, yy, yx + yy},
                               {0, xx + yx, xy + yy, xx + xy + yx + yy}};
    double least = 0;
    int best = 0;
    for (int k = 1; k < 16; k++) {
        const double distance = one[k & 3] + two[k >> 2] - both[k & 3][k >> 2];
        best = distance < least ? k : best;
        least = distance < least ? distance : least;
    }
    *a = txm_d3_mad(txm_d3_mad(from[0], x[0], best & 1), y[0], best >> 1 & 1);
    *b = txm_d3_mad(txm_d3_mad(from[1], x[1], best >> 2 & 1), y[1], best >> 3);
}

static txm_status tmr_smooth_points(tmr_work *w, tmr_level *level, int sweeps) {
    for (int sweep = 0; sweep < sweeps; sweep++) {
        for (int32_t i = 0; i < level->count; i++) {
            if (tmr_tick(w, 1)) return TXM_CANCELLED;
            txm_dvec3 q = level->q[i];
            double sum = 0;
            if (level->fixed[i]) continue;
            for (int32_t k = level->first[i]; k < level->first[i + 1]; k++) {
                const double weight = level->weight[k];
                txm_dvec3 a = q, b = q;
                tmr_closest_pair(level, i, q, level->to[k], &a, &b);
                q = txm_d3_add(txm_d3_scale(a, sum), txm_d3_scale(b, weight));
                sum += weight;
                q = txm_d3_scale(q, 1 / sum);
                q = txm_d3_mad(q, level->n[i],
                               -txm_d3_dot(level->n[i], txm_d3_sub(q, level->p[i])));
            }
            if (sum > 0)
                level->q[i] = tmr_lattice_round(q, level->x[i], tmr_arm(level->n[i], level->x[i]),
                                                level->scale[i], level->p[i]);
        }
    }
    return TXM_OK;
}

static txm_status tmr_solve_points(tmr_work *w, tmr_fields *f) {
    for (int l = f->count - 1; l >= 0; l--) {
        tmr_level *level = &f->level[l];
        if (l < f->count - 1) {
            const tmr_level *up = &f->level[l + 1];
            for (int32_t i = 0; i < level->count; i++) {
                if (level->fixed[i]) continue;
                txm_dvec3 q = up->q[level->parent[i]];
                q = txm_d3_mad(q, level->n[i],
                               -txm_d3_dot(level->n[i], txm_d3_sub(q, level->p[i])));
                level->q[i] = tmr_lattice_round(q, level->x[i], tmr_arm(level->n[i], level->x[i]),
                                                level->scale[i], level->p[i]);
            }
        }
        const txm_status status = tmr_smooth_points(w, level, l == 0 ? 3 : 6);
        if (status != TXM_OK) return status;
    }
    return TXM_OK;
}

static txm_status tmr_fields_build(const tmr_work *w, tmr_fields *f, txm_arena *arena) {
    txm_arena scratch;
    txm_status status = tmr_level_zero(w, f, arena);
    f->count = 1;
    while (status == TXM_OK && f->count < TMR_MAX_LEVELS && f->level[f->count - 1].count > 8) {
        txm_arena_init(&scratch, w->env);
        status = tmr_level_up(&f->level[f->count - 1], &f->level[f->count], arena, &scratch);
        txm_arena_free(&scratch);
        if (status != TXM_OK ||
            f->level[f->count].count * 20.0 > f->level[f->count - 1].count * 19.0)
            break;
        f->count++;
    }
    return status;
}

/* ---- from the lattice to a mesh ----------------------------------------------------------- */

/* Merge b = vertex[prev(c)] into a, or a into b, or both at their lattice point: the first of these
   that keeps the triangles around fair. Their lattice point becomes the mean of the two. */
static int tmr_collapse_onto(tmr_work *w, int32_t c) {
    tmr_mesh *m = &w->m;
    const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
    const int free = tmr_kind_of(m, a) == TRIMESH_FREE;
    const double x = w->bad[a], y = w->bad[b];
    const txm_dvec3 mean = txm_d3_scale(
        txm_d3_add(txm_d3_scale(w->moved[a], x), txm_d3_scale(w->moved[b], y)), 1 / (x + y));
    int32_t keep = a;
    if (tmr_can_collapse(m, c) && tmr_collapse_is_fair(w, c, m->p[a], 0)) {
        tmr_collapse(m, c);
    } else if (free && tmr_can_collapse(m, m->opposite[c]) &&
               tmr_collapse_is_fair(w, m->opposite[c], m->p[b], 0)) {
        tmr_collapse(m, m->opposite[c]);
        keep = b;
    } else if (free && tmr_can_collapse(m, c)) {
        const tmr_place at = tmr_project(w->s, mean, m->source[a]);
        if (!tmr_collapse_is_fair(w, c, at.p, 0)) return 0;
        tmr_collapse(m, c);
        tmr_put(w, a, &at);
    } else {
        return 0;
    }
    if (!free) return 1;
    w->moved[keep] = mean;
    w->bad[keep] = (uint8_t)fmin(255, x + y);
    return 1;
}

/* Collapse the edges whose ends share a lattice point, the shortest first. moved[v] holds the
   lattice point of v, and bad[v] how many vertices were merged into v. */
static txm_status tmr_collapse_lattice(tmr_work *w, const tmr_fields *f, txm_arena *scratch) {
    tmr_mesh *m = &w->m;
    const size_t most = (size_t)m->live_faces * 3 / 2 + 1; /* edges of a closed mesh */
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(scratch, most, sizeof(txm_pair));
    txm_pair *room = (txm_pair *)txm_arena_alloc(scratch, most, sizeof(txm_pair));
    if (!pairs || !room) return TXM_OUT_OF_MEMORY;
    if (tmr_tick(w, m->live)) return TXM_CANCELLED;
    for (int32_t v = 0; v < m->vertex_count; v++) {
        w->bad[v] = 1;
        w->moved[v] = f->node[v] >= 0 ? f->level[0].q[f->node[v]] : m->p[v];
        if (f->node[v] >= 0 && f->level[0].fixed[f->node[v]]) w->moved[v] = m->p[v];
    }
    for (int pass = 0; pass < 8; pass++) {
        size_t count = 0;
        int32_t done = 0;
        for (int32_t c = 0; c < 3 * m->face_count; c++) {
            if (!tmr_is_real_edge(m, c)) continue;
            const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
            const double spacing = 0.5 * w->length * (w->size[a] + (double)w->size[b]);
            const double apart = txm_d3_dist(w->moved[a], w->moved[b]);
            if (apart > 0.5 * spacing) continue;
            if (tmr_kind_of(m, a) != TRIMESH_FREE && tmr_kind_of(m, b) != TRIMESH_FREE) continue;
            TRIMESH_ASSERT(count < most);
            pairs[count].key =
                txm_sort_key(txm_float(apart + 0.05 * txm_d3_dist(m->p[a], m->p[b])));
            pairs[count++].value = (uint32_t)c;
        }
        txm_sort_pairs(pairs, room, count);
        for (size_t i = 0; i < count; i++) {
            int32_t c = (int32_t)pairs[i].value;
            if (m->vertex[c] < 0) continue;
            if (tmr_tick(w, 1)) return TXM_CANCELLED;
            const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
            if (tmr_is_ghost(m, a) || tmr_is_ghost(m, b)) continue;
            const double spacing = 0.5 * w->length * (w->size[a] + (double)w->size[b]);
            if (txm_d3_dist(w->moved[a], w->moved[b]) > 0.5 * spacing) continue;
            if (tmr_kind_of(m, b) != TRIMESH_FREE) {
                if (tmr_kind_of(m, a) != TRIMESH_FREE) continue;
                c = m->opposite[c];
            }
            if (!tmr_collapse_onto(w, c)) continue;
            done++;
        }
        if (done == 0) break;
    }
    for (int32_t v = 0; v < m->vertex_count; v++) { /* onto the surface */
        w->landed[v] = m->source[v];
        if (m->corner[v] < 0 || tmr_kind_of(m, v) != TRIMESH_FREE || tmr_is_ghost(m, v)) {
            w->moved[v] = m->p[v];
            continue;
        }
        const tmr_place at = tmr_project(w->s, w->moved[v], m->source[v]);
        w->moved[v] = at.p;
        w->landed[v] = at.face;
    }
    tmr_settle(w);
    return TXM_OK;
}

/* ---- the right number --------------------------------------------------------------------- */

enum {
    TMR_MOST_COST = 4000000, /* costs above this rank alike: keys, which have three decimals, have 32 bits */
    TMR_IDLE = 3             /* ours: after so many passes without a change stronger means are tried */
};

/* how collapsing (sign -1) or splitting (+1) the edge of c would change the cost of valences */
static int64_t tmr_count_cost(const tmr_mesh *m, int32_t c, int sign) {
    const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
    const int32_t d = m->vertex[c], e = m->vertex[m->opposite[c]];
    int64_t cost = 0;
    if (!tmr_is_ghost(m, d)) cost += tmr_valence_cost(m, d, sign) - tmr_valence_cost(m, d, 0);
    if (!tmr_is_ghost(m, e)) cost += tmr_valence_cost(m, e, sign) - tmr_valence_cost(m, e, 0);
    if (sign > 0) return cost + 4;
    return cost + tmr_valence_cost(m, a, m->valence[b] - 4) - tmr_valence_cost(m, a, 0) -
           tmr_valence_cost(m, b, 0);
}

/* Mark the vertices around the edge of c; 0 if one of them is marked already. */
static int tmr_claim(tmr_work *w, int32_t c) {
    const tmr_mesh *m = &w->m;
    const int32_t end[2] = {tmr_next(c), tmr_prev(c)};
    for (int pass = 0; pass < 2; pass++) {
        for (int k = 0; k < 2; k++) {
            int32_t i = end[k];
            do {
                const int32_t v = m->vertex[tmr_next(i)];
                if (pass == 0 && w->bad[v] && !tmr_is_ghost(m, v)) return 0;
                if (pass == 1) w->bad[v] = 1;
                i = tmr_swing(m, i);
            } while (i != end[k]);
        }
    }
    return 1;
}

/* Split or collapse edges where it disturbs the pattern least, until there are target vertices,
   with a few rounds of relaxation in between. *missing receives how many vertices are missing at
   the end (negative: too many). */
static txm_status tmr_fix_count(tmr_work *w, int32_t target, int relaxations, txm_arena *scratch,
                                int32_t *missing) {
    tmr_mesh *m = &w->m;
    const size_t most = (size_t)m->face_limit * 3 / 2 + 1; /* edges there can ever be */
    txm_pair *pairs, *room;
    *missing = target - m->live;
    if (*missing == 0) return TXM_OK;
    int idle = 0; /* passes without any change */
    pairs = (txm_pair *)txm_arena_alloc(scratch, most, sizeof(txm_pair));
    room = (txm_pair *)txm_arena_alloc(scratch, most, sizeof(txm_pair));
    if (!pairs || !room) return TXM_OUT_OF_MEMORY;
    for (int pass = 0; pass < 60 && *missing; pass++) {
        const int sign = *missing > 0 ? 1 : -1;
        size_t count = 0;
        for (int32_t c = 0; c < 3 * m->face_count; c++) {
            if (!tmr_is_real_edge(m, c)) continue;
            if ((m->flags[m->vertex[tmr_next(c)]] | m->flags[m->vertex[tmr_prev(c)]]) & TMR_PINNED)
                continue;
            const double size = tmr_edge_size(w, c);
            if (sign > 0 && size < 0.6 && pass < 30) continue;
            TRIMESH_ASSERT(count < most);
            const int64_t full = tmr_count_cost(m, c, sign);
            const int64_t cost = full < TMR_MOST_COST ? full : (int64_t)TMR_MOST_COST;
            pairs[count].key = (uint32_t)(1000 * (100 + cost) -
                                          sign * (int)(300 * fmin(size, 3)) +
                                          (m->edge[c] ? 2000 : 0));
            pairs[count++].value = (uint32_t)c;
        }
        if (tmr_tick(w, m->live)) return TXM_CANCELLED;
        txm_sort_pairs(pairs, room, count);
        memset(w->bad, 0, (size_t)m->vertex_count);
        int32_t done = 0;
        for (size_t i = 0; i < count && *missing; i++) {
            const int32_t c = (int32_t)pairs[i].value, before = m->live;
            if (m->vertex[c] < 0 || (pass < 40 && !tmr_claim(w, c))) continue;
            if (sign > 0) {
                const int32_t v = tmr_split_edge(w, c);
                if (v >= 0) w->bad[v] = 1;
            } else {
                tmr_try_collapse(w, c, pass < 20 ? 1.9 : 0, 1);
            }
            done += m->live != before;
            *missing = target - m->live;
            /* not too many at once, so that the others are ranked again */
            if (pass < 8 && done * 4 > (*missing < 0 ? -*missing : *missing) + 8) break;
        }
        /* relax where something was changed */
        memcpy(w->mask_room, w->bad, (size_t)m->vertex_count);
        w->mask = pass % 4 == 3 ? NULL : w->mask_room;
        if (tmr_tick(w, m->live)) return TXM_CANCELLED;
        tmr_flip_valences(w, 2, 0.4);
        for (int k = 0; k < relaxations; k++) {
            if (tmr_tick(w, m->live)) return TXM_CANCELLED;
            tmr_relax(w);
        }
        if (tmr_tick(w, m->live)) return TXM_CANCELLED;
        tmr_flip_delaunay(w, 2);
        w->mask = NULL;
        if (tmr_tick(w, m->live)) return TXM_CANCELLED;
        if (done == 0 && pass >= 40) break;
        idle = done ? 0 : idle + 1;
        if (idle == TMR_IDLE) { /* go on to what allows more */
            pass = pass < 20 ? 19 : pass < 30 ? 29 : 39;
            idle = 0;
        }
    }
    return TXM_OK;
}

/* ---- resampling --------------------------------------------------------------------------- */

/* Bring the copy of the surface to about two vertices per lattice point to come. */
static txm_status tmr_resample(tmr_work *w) {
    const double aim = sqrt(0.5); /* of edges, relative to w->length */
    /* lines first: the inside is then split to fit them */
    tmr_split_long(w, 1e9, 1.0);
    /* fine input: collapse edges, the shortest first, in one direction too: a fan over a side with a
       thousand vertices consists of splinters */
    double limit = 0.05 * aim;
    while (limit < 0.72 * aim) {
        w->splinters = 1;
        tmr_collapse_short(w, limit, limit * 1.2, 1.4 * aim, 0);
        w->splinters = 0;
        limit *= 1.5;
        if (txm_progress(w->env, 0, "resample")) return TXM_CANCELLED;
    }
    for (int round = 0; round < 24; round++) {
        const int32_t split = tmr_split_long(w, 1.4 * aim, 1.4);
        tmr_flip_delaunay(w, 4);
        const int32_t gone = tmr_collapse_short(w, 0.7 * aim, 0.7, 1.4 * aim, 0);
        tmr_flip_delaunay(w, 2);
        if (round >= 3 && (split + gone) * 200.0 < w->m.live) break;
        if (txm_progress(w->env, 0, "resample")) return TXM_CANCELLED;
    }
    return TXM_OK;
}

/* Collapse edges of lines that have more than fit their length; the others are spaced evenly later. */
static txm_status tmr_thin_lines(tmr_work *w, txm_arena *scratch) {
    tmr_mesh *m = &w->m;
    const tmr_lines *l = w->l;
    if (l->line_count == 0) return TXM_OK;
    int32_t *over = (int32_t *)txm_arena_alloc(scratch, (size_t)l->line_count, sizeof(int32_t));
    if (!over) return TXM_OUT_OF_MEMORY;
    for (int32_t i = 0; i < l->line_count; i++) {
        const int32_t fit = (int32_t)(l->length[i] / (w->length * w->line_scale) + 0.5);
        const int32_t least = l->closed[i] ? 3 : 1;
        over[i] = -(fit > least ? fit : least);
    }
    for (int32_t c = 0; c < 3 * m->face_count; c++)
        if (tmr_is_real_edge(m, c) && m->edge[c]) over[m->edge[c] - 1]++;
    for (int32_t c = 0; c < 3 * m->face_count && !w->s->scale; c++) {
        if (!tmr_is_real_edge(m, c) || !m->edge[c] || over[m->edge[c] - 1] <= 0) continue;
        const int32_t line = m->edge[c] - 1;
        over[line] -= tmr_try_collapse(w, c, 0, 0);
    }
    return TXM_OK;
}

/* Spread the vertices of each line evenly along it. */
static void tmr_even_lines(tmr_work *w) {
    tmr_mesh *m = &w->m;
    int any = 0;
    for (int32_t v = 0; v < m->vertex_count; v++) {
        const int kind = m->corner[v] < 0 || tmr_is_ghost(m, v) ? 0 : tmr_kind_of(m, v);
        w->bad[v] = kind == TRIMESH_CREASE || kind == TRIMESH_BORDER; /* still to do */
        any |= w->bad[v];
        tmr_keep_place(w, v);
    }
    for (int32_t v = 0; v < m->vertex_count && any; v++) {
        int32_t two[2];
        if (!w->bad[v] || !tmr_line_neighbors(m, v, two)) continue;
        /* back to an end of the line, or all the way around to v */
        int32_t before = two[0], at = v, begin = -1;
        for (;;) {
            const int32_t next = before;
            if (tmr_kind_of(m, next) == TRIMESH_CORNER) {
                begin = next;
                break;
            }
            if (next == v || !tmr_line_neighbors(m, next, two)) break;
            before = two[0] == at ? two[1] : two[0];
            at = next;
        }
        /* now walk forward from there: first count, then place */
        const int32_t start = begin >= 0 ? begin : v, second = begin >= 0 ? at : -1;
        const int32_t line = w->l->line[m->source[v]];
        int32_t count = 0;
        for (int pass = 0; pass < 2; pass++) {
            int32_t from = start, to = second, i = 0;
            double way = 0;
            int forward = 1;
            if (begin < 0) {
                tmr_line_neighbors(m, v, two);
                to = two[1];
                way = tmr_line_way(w->s, w->l, m->p[v], m->source[v]);
            }
            if (pass == 1) {
                /* in which direction along the line? */
                const double w0 = tmr_line_way(w->s, w->l, m->p[to], m->source[to]);
                if (begin >= 0) {
                    const double nearby = w0, distant = w->l->length[line] - w0;
                    const txm_dvec3 first_point = w->s->point[w->l->a[w->l->first[line]]];
                    const txm_dvec3 last_point = w->s->point[w->l->b[w->l->first[line + 1] - 1]];
                    const double d_first = txm_d3_dist2(first_point, m->p[begin]);
                    const double d_last = txm_d3_dist2(last_point, m->p[begin]);
                    forward = d_first < d_last || (d_first <= d_last && nearby <= distant);
                    way = forward ? 0 : w->l->length[line];
                } else {
                    double d = w0 - way;
                    if (d < -0.5 * w->l->length[line]) d += w->l->length[line];
                    if (d > 0.5 * w->l->length[line]) d -= w->l->length[line];
                    forward = d >= 0;
                }
            }
            const double step = pass ? w->l->length[line] / (count + 1) * (forward ? 1 : -1) : 0;
            while (to != start && tmr_kind_of(m, to) != TRIMESH_CORNER) {
                i++;
                if (pass == 1) {
                    double x = way + step * i;
                    if (w->l->closed[line]) {
                        if (x < 0) x += w->l->length[line];
                        if (x >= w->l->length[line]) x -= w->l->length[line];
                    }
                    w->moved[to] = tmr_line_at(w->s, w->l, line, x, &w->landed[to]);
                    w->bad[to] = 0;
                }
                if (!tmr_line_neighbors(m, to, two)) break;
                const int32_t next = two[0] == from ? two[1] : two[0];
                from = to;
                to = next;
            }
            count = i;
        }
        w->bad[v] = 0;
    }
    if (any) tmr_settle(w);
}

/* ---- operations on trial ------------------------------------------------------------------ */

/* What a triangle lacks to an equilateral one of the wanted size:

       1 / q - 1 + s (x + 1 / x - 2),   q = 4 sqrt(3) area / (sum of the squared sides),
                                        x = area / wanted area

   0 for the wanted triangle; near it, twice the square of its shear and s times the square of the
   error of its area; without bound towards a degenerate one. A triangle that disagrees with the
   surface costs so much that no gain elsewhere outweighs it. */
#define TMR_STRAIN_OF_SIZE 0.25 /* ours: s                                                      */
#define TMR_STRAIN_OF_WANTED 1  /* ours: s where the caller wants different sizes               */
#define TMR_STRAIN_OF_FOLD 1000 /* ours: of a triangle that disagrees with the surface          */

static double tmr_strain(const tmr_work *w, int32_t face) {
    const tmr_mesh *m = &w->m;
    const int32_t *v = m->vertex + 3 * face;
    if (v[0] < 0 || tmr_is_ghost_face(m, face)) return 0;
    const txm_dvec3 a = m->p[v[0]], b = m->p[v[1]], c = m->p[v[2]], cross = txm_d3_area2(a, b, c);
    const double area2 = txm_d3_dot(cross, tmr_expected_normal(w, v[0], v[1], v[2]));
    const double q = 3.4641016151377544 * area2 /
                     (txm_d3_dist2(a, b) + txm_d3_dist2(b, c) + txm_d3_dist2(c, a));
    if (!(q > 0.05) || area2 * area2 < TMR_LEAST_AGREEMENT * TMR_LEAST_AGREEMENT * txm_d3_len2(cross))
        return TMR_STRAIN_OF_FOLD;
    const double size = w->length * (w->size[v[0]] + (double)w->size[v[1]] + w->size[v[2]]) / 3;
    const double x = area2 / (0.86602540378443865 * size * size);
    return 1 / q - 1 + (tmr_wants_sizes(w) ? TMR_STRAIN_OF_WANTED : TMR_STRAIN_OF_SIZE) * (x + 1 / x - 2);
}

/* The part of the mesh around an edge, as it was before a trial: the ends of the edge and the two
   vertices opposite to it, a ring of vertices around these four, which may move, and the rim, which
   stays. All triangles of vertices that may move belong to it, so nothing else can change. A trial that
   promises well goes on in a patch that is one ring wider.

   On a regular mesh there are 4 + 10 + 16 vertices and 46 triangles, or 52 and 82 in the wider one. A
   larger patch than fits is not tried. */
enum { TMR_PATCH_VERTICES = 160, TMR_PATCH_FACES = 280 };

typedef struct tmr_patch_vertex {
    txm_dvec3 p, n;
    int32_t vertex, source, corner, valence;
    float size;
    uint8_t flags;
} tmr_patch_vertex;

typedef struct tmr_patch_face {
    int32_t face, vertex[3], opposite[3], edge[3];
} tmr_patch_face;

typedef struct tmr_patch {
    tmr_patch_vertex vertex[TMR_PATCH_VERTICES];
    tmr_patch_face face[TMR_PATCH_FACES];
    int vertices, faces;
    int bound;      /* triangles that hang on lines: whose normal takes long to find            */
    int core, movable;                                  /* vertices: the four and their ring; those that move */
    int32_t live, live_faces, vertex_count, face_count; /* of the mesh                          */
    int32_t added;  /* vertex that the trial has added, -1 = none                               */
    int lines_too;  /* vertices on lines may move, too                                          */
    double strain;  /* of all triangles before                                                  */
} tmr_patch;

/* Add vertex v, unless it is there. Returns 0 if there is no room. Marks it in w->bad, as
   tmr_patch_add_face marks triangles in w->flag: both are 0 outside of the patch. */
static int tmr_patch_add(tmr_work *w, tmr_patch *patch, int32_t v) {
    const tmr_mesh *m = &w->m;
    if (w->bad[v]) return 1;
    if (patch->vertices == TMR_PATCH_VERTICES) return 0;
    tmr_patch_vertex *k = &patch->vertex[patch->vertices++];
    w->bad[v] = 1;
    k->vertex = v;
    k->p = m->p[v];
    k->n = m->n[v];
    k->source = m->source[v];
    k->corner = m->corner[v];
    k->valence = m->valence[v];
    k->size = w->size[v];
    k->flags = m->flags[v];
    return 1;
}

/* Are all vertices of the triangle on lines? */
static int tmr_is_bound(const tmr_mesh *m, int32_t face) {
    const int32_t *v = m->vertex + 3 * face;
    return tmr_kind_of(m, v[0]) != TRIMESH_FREE && tmr_kind_of(m, v[1]) != TRIMESH_FREE &&
           tmr_kind_of(m, v[2]) != TRIMESH_FREE;
}

static int tmr_patch_add_face(tmr_work *w, tmr_patch *patch, int32_t face) {
    const tmr_mesh *m = &w->m;
    if (w->flag[face]) return 1;
    if (patch->faces == TMR_PATCH_FACES) return 0;
    tmr_patch_face *k = &patch->face[patch->faces++];
    w->flag[face] = 1;
    k->face = face;
    patch->bound += tmr_is_bound(m, face);
    for (int j = 0; j < 3; j++) {
        k->vertex[j] = m->vertex[3 * face + j];
        k->opposite[j] = m->opposite[3 * face + j];
        k->edge[j] = m->edge[3 * face + j];
    }
    patch->strain += tmr_strain(w, face);
    return 1;
}

/* Add the neighbours of the vertices from..to-1, and if wanted their triangles. Returns 0 if there is
   no room. */
static int tmr_patch_grow(tmr_work *w, tmr_patch *patch, int from, int to, int faces_too) {
    const tmr_mesh *m = &w->m;
    for (int i = from; i < to; i++) {
        const int32_t v = patch->vertex[i].vertex, first = m->corner[v];
        int32_t c = first;
        if (first < 0 || tmr_is_ghost(m, v)) continue;
        do {
            if (!tmr_patch_add(w, patch, m->vertex[tmr_next(c)])) return 0;
            if (faces_too && !tmr_patch_add_face(w, patch, c / 3)) return 0;
            c = tmr_swing(m, c);
        } while (c != first);
    }
    return 1;
}

static void tmr_patch_mark(tmr_work *w, const tmr_patch *patch, uint8_t mark) {
    for (int i = 0; i < patch->vertices; i++) w->bad[patch->vertex[i].vertex] = mark;
    for (int i = 0; i < patch->faces; i++) w->flag[patch->face[i].face] = mark;
    for (int32_t f = patch->face_count; f < w->m.face_count; f++) w->flag[f] = mark;
    if (patch->added >= 0) w->bad[patch->added] = mark;
}

/* Keep the state around the edge opposite to c. Returns 0 if the patch is too large. */
static int tmr_patch_keep(tmr_work *w, tmr_patch *patch, int32_t c) {
    const tmr_mesh *m = &w->m;
    const int32_t core[4] = {m->vertex[tmr_next(c)], m->vertex[tmr_prev(c)], m->vertex[c],
                             m->vertex[m->opposite[c]]};
    patch->vertices = patch->faces = patch->bound = 0;
    patch->strain = 0;
    patch->live = m->live;
    patch->live_faces = m->live_faces;
    patch->vertex_count = m->vertex_count;
    patch->face_count = m->face_count;
    patch->added = -1;
    for (int k = 0; k < 4; k++) tmr_patch_add(w, patch, core[k]);
    int fits = tmr_patch_grow(w, patch, 0, patch->vertices, 0);
    patch->core = patch->movable = patch->vertices;
    fits = fits && tmr_patch_grow(w, patch, 0, patch->movable, 1);
    tmr_patch_mark(w, patch, 0);
    return fits;
}

/* During a trial: let the rim move, too, within a rim around it. Up to now nothing beyond it has
   changed. Where that does not fit, the patch stays as it is. */
static void tmr_patch_widen(tmr_work *w, tmr_patch *patch) {
    const int vertices = patch->vertices, faces = patch->faces;
    const double strain = patch->strain;
    tmr_patch_mark(w, patch, 1);
    const int fits = tmr_patch_grow(w, patch, patch->movable, vertices, 1);
    tmr_patch_mark(w, patch, 0);
    if (fits) {
        patch->movable = vertices;
    } else {
        patch->vertices = vertices;
        patch->faces = faces;
        patch->strain = strain;
    }
}

/* Take the trial back. */
static void tmr_patch_restore(tmr_work *w, const tmr_patch *patch) {
    tmr_mesh *m = &w->m;
    for (int i = 0; i < patch->vertices; i++) {
        const tmr_patch_vertex *k = &patch->vertex[i];
        const int32_t v = k->vertex;
        m->p[v] = k->p;
        m->n[v] = k->n;
        m->source[v] = k->source;
        m->corner[v] = k->corner;
        m->valence[v] = k->valence;
        w->size[v] = k->size;
        m->flags[v] = k->flags;
    }
    for (int i = 0; i < patch->faces; i++) {
        const tmr_patch_face *k = &patch->face[i];
        for (int j = 0; j < 3; j++) {
            m->vertex[3 * k->face + j] = k->vertex[j];
            m->opposite[3 * k->face + j] = k->opposite[j];
            m->edge[3 * k->face + j] = k->edge[j];
        }
    }
    m->live = patch->live;
    m->live_faces = patch->live_faces;
    m->vertex_count = patch->vertex_count;
    m->face_count = patch->face_count;
}

/* strain of the patch as it is now: of its old triangles that live, and of the new ones */
static double tmr_patch_strain(const tmr_work *w, const tmr_patch *patch) {
    double sum = 0;
    for (int i = 0; i < patch->faces; i++) sum += tmr_strain(w, patch->face[i].face);
    for (int32_t f = patch->face_count; f < w->m.face_count; f++) sum += tmr_strain(w, f);
    return sum;
}

static void tmr_patch_relax_vertex(tmr_work *w, const tmr_patch *patch, int32_t v) {
    const tmr_mesh *m = &w->m;
    tmr_place at;
    if (m->corner[v] < 0 || m->flags[v] & (TMR_GHOST | TMR_PINNED)) return;
    if (tmr_kind_of(m, v) == TRIMESH_FREE) {
        if (tmr_relaxed_place(w, v, &at)) tmr_put(w, v, &at);
    } else if (patch->lines_too) {
        tmr_relax_vertex(w, v);
        if (tmr_has_moved(w, v)) tmr_put_on_line(w, v, w->moved[v], w->landed[v]);
    }
}

/* Relax the vertices of the patch, each from where the others are now. */
static void tmr_patch_relax(tmr_work *w, const tmr_patch *patch) {
    if (patch->added >= 0) tmr_patch_relax_vertex(w, patch, patch->added);
    for (int i = 0; i < patch->movable; i++) tmr_patch_relax_vertex(w, patch, patch->vertex[i].vertex);
}

enum { TMR_TRIAL_SWEEPS = 8, TMR_TRIAL_WIDE = 2 }; /* ours: of relaxation; after which it is widened */

/* Relax what an operation has left, and let it stay if that lowers the strain by more than the price;
   otherwise take it back. Sweeps converge like a geometric series: once there is more left to gain
   than the last one has gained, there is no hope. */
static int tmr_patch_judge(tmr_work *w, tmr_patch *patch, double price) {
    double before = tmr_patch_strain(w, patch);
    for (int sweep = 0; sweep < TMR_TRIAL_SWEEPS; sweep++) {
        const double then = patch->strain;
        if (sweep == TMR_TRIAL_WIDE) tmr_patch_widen(w, patch);
        before += patch->strain - then;
        tmr_patch_relax(w, patch);
        const double now = tmr_patch_strain(w, patch), excess = now + price - patch->strain;
        if (excess < -1e-9) return 1;
        if (excess > before - now) break;
        before = now;
    }
    tmr_patch_restore(w, patch);
    return 0;
}

/* ---- defects of the lattice --------------------------------------------------------------- */

/* A pair of neighbours of valence five and seven is a dislocation: a row of the lattice ends there. A
   flip moves it along the row, a vertex taken out or put in moves it across; two that meet may cancel.
   Relaxation alone moves none, since each step leads over a state that is worse than both its ends. So
   the steps are tried, relaxed and judged by the strain that is left.

   Not all dislocations can go: where a surface is curved, equal triangles need them. See
   docs/choices.md#defects. */
enum {
    TMR_DEFECT_PASSES = 6, /* ours: over the mesh, at most                                        */
    TMR_DEFECT_COST = 2,   /* ours: a flip may raise the cost of valences by so much              */
    TMR_DEFECT_BOUND = 8   /* ours: no trial where more triangles than this hang on lines         */
};
#define TMR_VERTEX_PRICE 0.01 /* ours: strain that a vertex is worth, for each one too many       */

typedef struct tmr_defects {
    tmr_work *w;
    tmr_patch *patch;
    uint8_t *was;   /* 1 per vertex: the mesh around it has changed in the last pass              */
    int32_t target; /* vertices                                                                   */
    double price;   /* strain that a vertex is worth, for each one too many                       */
} tmr_defects;

/* Mark the patch as changed, in w->mask_room, if the trial has succeeded. */
static int tmr_defect_done(tmr_defects *d, double price) {
    tmr_work *w = d->w;
    tmr_patch *patch = d->patch;
    if (!tmr_patch_judge(w, patch, price)) return 0;
    for (int i = 0; i < patch->core; i++) w->mask_room[patch->vertex[i].vertex] = 1;
    if (patch->added >= 0) w->mask_room[patch->added] = 1;
    return 1;
}

static int tmr_defect_keep(tmr_defects *d, int32_t c) {
    return tmr_patch_keep(d->w, d->patch, c) && d->patch->bound <= TMR_DEFECT_BOUND;
}

static int tmr_try_flip(tmr_defects *d, int32_t c) {
    tmr_work *w = d->w;
    if (tmr_flip_gain(&w->m, c) < -TMR_DEFECT_COST || !tmr_can_flip(&w->m, c)) return 0;
    if (!tmr_defect_keep(d, c)) return 0;
    tmr_flip(&w->m, c);
    return tmr_defect_done(d, 0);
}

static int tmr_try_removal(tmr_defects *d, int32_t c) {
    tmr_work *w = d->w;
    if (tmr_count_cost(&w->m, c, -1) > 0 || !tmr_can_collapse(&w->m, c)) return 0;
    if (!tmr_defect_keep(d, c) || !tmr_try_collapse(w, c, 0, 1)) return 0;
    return tmr_defect_done(d, -d->price * (w->m.live + 1 - d->target));
}

/* A vertex is put in by a split of c's edge a b, which gives it four neighbours, and a flip of one of
   the outer edges of the two triangles, which gives it a fifth: of a d, where d is the third corner of
   one of them, e that of the other, and y lies behind a d. There are four such edges. a has one
   neighbour less then, e and y have one more.

   Returns the corner at y, -1 if that edge stays; *cost receives the change of the cost of valences. */
static int32_t tmr_insertion(const tmr_mesh *m, int32_t c, int which, int64_t *cost) {
    const int32_t i = which & 2 ? m->opposite[c] : c; /* at d */
    const int32_t side = which & 1 ? tmr_next(i) : tmr_prev(i), y = m->opposite[side];
    const int32_t a = m->vertex[which & 1 ? tmr_prev(i) : tmr_next(i)];
    const int32_t e = m->vertex[m->opposite[i]];
    if (m->edge[side] || tmr_is_ghost(m, m->vertex[y])) return -1;
    *cost = 1; /* of v, which has five neighbours */
    *cost += tmr_valence_cost(m, a, -1) - tmr_valence_cost(m, a, 0);
    *cost += tmr_valence_cost(m, e, 1) - tmr_valence_cost(m, e, 0);
    *cost += tmr_valence_cost(m, m->vertex[y], 1) - tmr_valence_cost(m, m->vertex[y], 0);
    return y;
}

static int tmr_try_insertions(tmr_defects *d, int32_t c) {
    tmr_work *w = d->w;
    for (int which = 0; which < 4; which++) {
        int64_t cost;
        const int32_t y = tmr_insertion(&w->m, c, which, &cost);
        if (y < 0 || cost > 0 || !tmr_defect_keep(d, c)) continue;
        d->patch->added = tmr_split_edge(w, c);
        if (d->patch->added < 0) return 0;
        if (!tmr_can_flip(&w->m, y)) {
            tmr_patch_restore(w, d->patch);
            continue;
        }
        tmr_flip(&w->m, y);
        if (tmr_defect_done(d, d->price * (w->m.live - 1 - d->target))) return 1;
    }
    return 0;
}

/* One pass over the edges of which an end or opposite vertex has changed. Returns how many steps were
   taken; -1: cancelled. */
static int32_t tmr_defect_pass(tmr_defects *d) {
    tmr_work *w = d->w;
    tmr_mesh *m = &w->m;
    const int32_t corners = 3 * m->face_count;
    int32_t steps = 0;
    memcpy(d->was, w->mask_room, (size_t)m->vertex_count);
    memset(d->was + m->vertex_count, 0, (size_t)(m->vertex_limit - m->vertex_count));
    memset(w->mask_room, 0, (size_t)m->vertex_limit);
    for (int32_t c = 0; c < corners; c++) {
        if (!tmr_is_real_edge(m, c) || m->edge[c]) continue;
        const int32_t end[4] = {m->vertex[tmr_next(c)], m->vertex[tmr_prev(c)], m->vertex[c],
                                m->vertex[m->opposite[c]]};
        int changed = 0, loose = 0;
        for (int k = 0; k < 4; k++) {
            changed |= d->was[end[k]] | w->mask_room[end[k]];
            loose += tmr_kind_of(m, end[k]) == TRIMESH_FREE;
        }
        if (changed && tmr_tick(w, TMR_TICK_TRIAL)) return -1;
        if (!changed || loose < 2 || tmr_is_ghost(m, end[2]) || tmr_is_ghost(m, end[3])) continue;
        const int is_free =
            tmr_kind_of(m, end[0]) == TRIMESH_FREE && tmr_kind_of(m, end[1]) == TRIMESH_FREE;
        steps += tmr_try_flip(d, c) ||
                 (is_free && (tmr_try_removal(d, c) || tmr_try_insertions(d, c)));
    }
    return steps;
}

static txm_status tmr_defects_begin(tmr_defects *d, tmr_work *w, int32_t target, txm_arena *scratch) {
    tmr_mesh *m = &w->m;
    d->w = w;
    d->target = target;
    d->price = TMR_VERTEX_PRICE;
    d->patch = (tmr_patch *)txm_arena_zero(scratch, 1, sizeof *d->patch);
    d->was = (uint8_t *)txm_arena_alloc(scratch, (size_t)m->vertex_limit, 1);
    if (!d->patch || !d->was) return TXM_OUT_OF_MEMORY;
    w->pull = w->step = 1;
    w->length = tmr_ideal_length(w) * sqrt((double)m->live / target);
    memset(w->bad, 0, (size_t)m->vertex_limit);
    memset(w->flag, 0, (size_t)m->face_limit);
    memset(w->mask_room, 1, (size_t)m->vertex_limit);
    return TXM_OK;
}

/* Move and cancel the dislocations of a mesh that is nearly relaxed, at about target vertices. */
static txm_status tmr_mend_defects(tmr_work *w, int32_t target, txm_arena *scratch) {
    tmr_defects d;
    const txm_status status = tmr_defects_begin(&d, w, target, scratch);
    for (int pass = 0; pass < TMR_DEFECT_PASSES && status == TXM_OK; pass++) {
        if (txm_progress(w->env, 0, "relax")) return TXM_CANCELLED;
        const int32_t steps = tmr_defect_pass(&d);
        if (steps < 0) return TXM_CANCELLED;
        if (steps == 0) break;
    }
    return status;
}

enum { TMR_COUNT_PASSES = 6 }; /* ours: at most                                                    */
#define TMR_COUNT_PRICE 0.05   /* ours: strain that one vertex may cost in the first pass          */

/* Bring a finished mesh from nearly the right number to the target: beside dislocations, where
   that costs little strain, from pass to pass twice as much. Some may be left. */
static txm_status tmr_count_beside_defects(tmr_work *w, int32_t target, txm_arena *scratch) {
    tmr_mesh *m = &w->m;
    tmr_defects d;
    if (m->live == target) return TXM_OK;
    const txm_status status = tmr_defects_begin(&d, w, target, scratch);
    double price = TMR_COUNT_PRICE;
    for (int pass = 0; pass < TMR_COUNT_PASSES && status == TXM_OK; pass++, price *= 2) {
        if (txm_progress(w->env, 0, "relax")) return TXM_CANCELLED;
        for (int32_t c = 0; c < 3 * m->face_count && m->live != target; c++) {
            const int32_t missing = target - m->live;
            if (!tmr_is_real_edge(m, c) || m->edge[c]) continue;
            if (tmr_kind_of(m, m->vertex[tmr_next(c)]) != TRIMESH_FREE ||
                tmr_kind_of(m, m->vertex[tmr_prev(c)]) != TRIMESH_FREE)
                continue;
            if (tmr_tick(w, TMR_TICK_TRIAL)) return TXM_CANCELLED;
            d.price = price / (missing < 0 ? -missing : missing);
            if (missing < 0) tmr_try_removal(&d, c);
            else tmr_try_insertions(&d, c);
        }
    }
    return status;
}

/* ---- the worst triangles ------------------------------------------------------------------ */

/* Where a surface is curved more tightly than triangles can follow, at tips, and between creases, some
   triangles stay thin whatever relaxation does. Around each of these every flip, collapse and split is
   tried, as with dislocations, until none helps. See docs/choices.md#slivers. */
enum {
    TMR_SLIVER_PASSES = 4, /* ours: over the mesh, at most                                        */
    TMR_SLIVER_SHARE = 50  /* ours: one for so many vertices is tried; with more the input is thin */
};
#define TMR_SLIVER 0.75         /* ours: quality below which a triangle is worth it                  */
#define TMR_SHORT_LINE 0.5      /* ours: two corners so close, in edge lengths, may become one       */

static int tmr_is_sliver(const tmr_work *w, int32_t face) {
    const tmr_mesh *m = &w->m;
    const int32_t *v = m->vertex + 3 * face;
    if (v[0] < 0 || tmr_is_ghost_face(m, face)) return 0;
    return tmr_quality(m->p[v[0]], m->p[v[1]], m->p[v[2]],
                       tmr_expected_normal(w, v[0], v[1], v[2])) < TMR_SLIVER;
}

/* May b = vertex[prev(c)], a corner, be merged into a = vertex[next(c)], another one, to which a short
   line leads at which the mesh turns by less than 60 degrees? The lines of b end in a then. */
static int tmr_can_merge(tmr_work *w, int32_t c) {
    tmr_mesh *m = &w->m;
    const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
    const uint8_t flags = m->flags[b];
    if (!m->edge[c] || tmr_edge_size(w, c) > TMR_SHORT_LINE) return 0;
    const int32_t d = m->vertex[c], e = m->vertex[m->opposite[c]];
    if (tmr_is_ghost(m, d) || tmr_is_ghost(m, e)) return 0;
    const txm_dvec3 n = txm_d3_unit(txm_d3_area2(m->p[d], m->p[a], m->p[b]));
    if (txm_d3_dot(n, txm_d3_unit(txm_d3_area2(m->p[e], m->p[b], m->p[a]))) < 0.5) return 0;
    m->flags[b] = (uint8_t)(flags - TRIMESH_CORNER + TRIMESH_CREASE); /* otherwise it must stay */
    const int can = tmr_can_collapse(m, c);
    m->flags[b] = flags;
    return can && tmr_collapse_is_fair(w, c, m->p[a], 0);
}

/* Collapse the edge opposite to c, on trial. */
static int tmr_try_merge(tmr_work *w, tmr_patch *patch, int32_t c) {
    tmr_mesh *m = &w->m;
    const int corners = tmr_kind_of(m, m->vertex[tmr_next(c)]) == TRIMESH_CORNER &&
                        tmr_kind_of(m, m->vertex[tmr_prev(c)]) == TRIMESH_CORNER;
    /* where lines are spaced otherwise than the inside, what is on them stays */
    if (m->edge[c] && (w->line_scale < 1 || w->line_scale > 1)) return 0;
    if (corners && !tmr_can_merge(w, c)) return 0;
    if (!tmr_patch_keep(w, patch, c)) return 0;
    if (corners) tmr_collapse(m, c);
    else if (!tmr_try_collapse(w, c, 0, 1)) return 0;
    return tmr_patch_judge(w, patch, 0);
}

static int tmr_try_split(tmr_work *w, tmr_patch *patch, int32_t c) {
    if (!tmr_patch_keep(w, patch, c)) return 0;
    patch->added = tmr_split_edge(w, c);
    return patch->added >= 0 && tmr_patch_judge(w, patch, 0);
}

static int tmr_try_turn(tmr_work *w, tmr_patch *patch, int32_t c) {
    if (!tmr_can_flip(&w->m, c) || !tmr_patch_keep(w, patch, c)) return 0;
    tmr_flip(&w->m, c);
    return tmr_patch_judge(w, patch, 0);
}

/* One pass over the mesh. Returns how many triangles were mended; -1: cancelled. */
static int32_t tmr_sliver_pass(tmr_work *w, tmr_patch *patch, int count_too, int32_t *budget) {
    const int32_t faces = w->m.face_count;
    int32_t steps = 0;
    for (int32_t f = 0; f < faces && *budget > 0; f++) {
        if (!tmr_is_sliver(w, f)) continue;
        --*budget;
        if (tmr_tick(w, 10 * TMR_TICK_TRIAL)) return -1; /* each way of mending it is tried */
        int done = 0;
        for (int32_t c = 3 * f; c < 3 * f + 3 && !done; c++) done = tmr_try_turn(w, patch, c);
        for (int32_t c = 3 * f; c < 3 * f + 3 && !done && count_too; c++) {
            if (tmr_is_ghost(&w->m, w->m.vertex[w->m.opposite[c]])) continue;
            done = tmr_try_merge(w, patch, c) || tmr_try_merge(w, patch, w->m.opposite[c]) ||
                   tmr_try_split(w, patch, c);
        }
        steps += done;
    }
    return steps;
}

/* Mend the worst triangles. count_too: the number of vertices may change. */
static txm_status tmr_mend_slivers(tmr_work *w, int count_too, txm_arena *scratch) {
    tmr_mesh *m = &w->m;
    tmr_patch *patch = (tmr_patch *)txm_arena_zero(scratch, 1, sizeof *patch);
    if (!patch) return TXM_OUT_OF_MEMORY;
    patch->lines_too = 1;
    w->pull = w->step = 1;
    memset(w->bad, 0, (size_t)m->vertex_limit);
    memset(w->flag, 0, (size_t)m->face_limit);
    int32_t budget = m->live / TMR_SLIVER_SHARE + 20;
    for (int pass = 0; pass < TMR_SLIVER_PASSES; pass++) {
        const int32_t steps = tmr_sliver_pass(w, patch, count_too, &budget);
        if (steps < 0) return TXM_CANCELLED;
        if (steps == 0) break;
        if (tmr_tick(w, m->live)) return TXM_CANCELLED;
    }
    return TXM_OK;
}

/* ---- subdividing -------------------------------------------------------------------------- */

/* Is the mesh near enough to the surface for each triangle to be cut in four? */
static int tmr_may_subdivide(const tmr_work *w) {
    const tmr_mesh *m = &w->m;
    int32_t edges = 0, bent = 0;
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        if (!tmr_is_real_edge(m, c) || m->edge[c]) continue;
        const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
        edges++;
        /* the height of the arc over the chord is about length * tan(angle / 4) / 2 */
        bent += txm_d3_dot(m->n[a], m->n[b]) < -0.2;
    }
    return bent * 100.0 <= edges;
}

/* Copy the living part of w->m into new arrays, each triangle cut in four if wanted, with room for
   1000 vertices more.

   Every live vertex and ghost stays. A cut adds at most one vertex per edge, of which there are 3/2
   live_faces, and makes four triangles of one, of a ghost triangle two. */
static txm_status tmr_rebuild(tmr_work *w, int cut, txm_arena *arena, txm_arena *scratch) {
    enum { MORE = 1000 };
    const tmr_mesh old = w->m;
    const double vertices =
        (double)MORE + old.live + (double)old.ghosts + (cut ? 1.5 * old.live_faces : 0);
    const double faces = (cut ? 4.0 : 1.0) * old.live_faces + 4 * MORE;
    const float *old_size = w->size;
    tmr_mesh *m = &w->m;
    int32_t *number = (int32_t *)txm_arena_alloc(scratch, (size_t)old.vertex_count, sizeof(int32_t));
    int32_t *middle = (int32_t *)txm_arena_alloc(scratch, 3 * (size_t)old.face_count, sizeof(int32_t));
    int32_t *where = (int32_t *)txm_arena_alloc(scratch, (size_t)old.face_count, sizeof(int32_t));
    if (vertices > (double)TMR_MOST_SLOTS || faces > (double)TMR_MOST_SLOTS)
        return txm_fail(w->env, TXM_TOO_LARGE, "too many triangles");
    txm_status status = tmr_check_memory(scratch);
    if (status == TXM_OK) status = tmr_alloc_mesh(w, (int32_t)vertices, (int32_t)faces, arena);
    if (status != TXM_OK) return status;
    for (int32_t v = 0; v < old.vertex_count; v++) {
        if (old.corner[v] < 0) continue;
        TRIMESH_ASSERT(m->vertex_count < m->vertex_limit);
        const int32_t k = number[v] = m->vertex_count++;
        m->p[k] = old.p[v];
        m->n[k] = old.n[v];
        m->source[k] = old.source[v];
        m->flags[k] = old.flags[v];
        w->size[k] = old_size[v];
        m->live += !(old.flags[v] & TMR_GHOST);
    }
    /* triangles: one each, or corner 0, 1, 2 and the middle; ghost triangles (ghost, b, a) are cut
       in two across the border edge: (ghost, b, m) and (ghost, m, a) */
    for (int32_t f = 0; f < old.face_count; f++) {
        if (old.vertex[3 * f] < 0) continue;
        const int ghost = cut ? tmr_is_ghost_face(&old, f) : 0;
        where[f] = m->face_count;
        m->face_count += !cut ? 1 : ghost ? 2 : 4;
    }
    TRIMESH_ASSERT(m->face_count <= m->face_limit);
    m->live_faces = m->face_count;
    for (int32_t c = 0; c < 3 * old.face_count && cut; c++) {
        if (old.vertex[c] < 0 || old.opposite[c] < c) continue;
        const int32_t a = old.vertex[tmr_next(c)], b = old.vertex[tmr_prev(c)];
        middle[c] = middle[old.opposite[c]] = -1;
        if ((old.flags[a] | old.flags[b]) & TMR_GHOST) continue;
        TRIMESH_ASSERT(m->vertex_count < m->vertex_limit);
        middle[c] = middle[old.opposite[c]] = m->vertex_count;
        const int32_t v = m->vertex_count++;
        m->live++;
        m->flags[v] = 0;
        /* where an arc with these normals at its ends would have its middle */
        const txm_dvec3 d = txm_d3_sub(old.p[b], old.p[a]);
        txm_dvec3 p = txm_d3_scale(txm_d3_add(old.p[a], old.p[b]), 0.5);
        const double na = txm_d3_dot(old.n[a], d), nb = txm_d3_dot(old.n[b], d);
        p = txm_d3_add(
            p, txm_d3_scale(txm_d3_sub(txm_d3_scale(old.n[a], -na), txm_d3_scale(old.n[b], -nb)),
                            0.125));
        const int32_t x = number[a], y = number[b];
        if (old.edge[c]) {
            const int32_t id = old.edge[c] - 1;
            int32_t k;
            m->flags[v] = w->l->border[id] ? TRIMESH_BORDER : TRIMESH_CREASE;
            p = tmr_line_middle(w, id, x, y, &k);
            tmr_put_on_line(w, v, p, k);
        } else {
            const tmr_place at = tmr_project_between(w, x, y, p);
            tmr_put(w, v, &at);
        }
    }
    for (int32_t f = 0; f < old.face_count; f++) {
        const int32_t *v = old.vertex + 3 * f, c = 3 * f, to = 3 * (old.vertex[c] < 0 ? 0 : where[f]);
        if (v[0] < 0) continue;
        if (!cut) {
            for (int k = 0; k < 3; k++) {
                const int32_t o = old.opposite[c + k];
                m->vertex[to + k] = number[v[k]];
                m->opposite[to + k] = 3 * where[o / 3] + o % 3;
                m->edge[to + k] = old.edge[c + k];
            }
            continue;
        }
        int g = -1;
        for (int k = 0; k < 3; k++)
            if (old.flags[v[k]] & TMR_GHOST) g = k;
        if (g >= 0) { /* (g, b, a) */
            const int32_t b = c + (g + 1) % 3, a = c + (g + 2) % 3, mid = middle[c + g];
            const int32_t corners[6] = {number[v[g]], number[old.vertex[b]], mid,
                                        number[v[g]], mid, number[old.vertex[a]]};
            for (int k = 0; k < 6; k++) m->vertex[to + k] = corners[k];
            tmr_link(m, to + 1, to + 5, 0); /* ghost - middle */
            continue;
        }
        for (int k = 0; k < 3; k++) { /* corner k: (v, middle of the next edge, of the previous) */
            m->vertex[to + 3 * k] = number[v[k]];
            m->vertex[to + 3 * k + 1] = middle[tmr_prev(c + k)];
            m->vertex[to + 3 * k + 2] = middle[tmr_next(c + k)];
            m->vertex[to + 9 + k] = middle[c + k];
        }
        /* the middle one: its corner k, on the edge opposite to corner k, looks at that corner's
           triangle across the edge between the two other middles */
        for (int k = 0; k < 3; k++) tmr_link(m, to + 9 + k, to + 3 * k, 0);
    }
    for (int32_t c = 0; c < 3 * old.face_count && cut; c++) {
        if (old.vertex[c] < 0 || old.opposite[c] < c) continue;
        const int32_t o = old.opposite[c], f = 3 * where[c / 3], g = 3 * where[o / 3];
        const int fg = tmr_is_ghost_face(&old, c / 3), gg = tmr_is_ghost_face(&old, o / 3);
        const int32_t a = tmr_next(c), b = tmr_prev(c);      /* edge a b; in o's triangle: */
        const int32_t oa = tmr_prev(o), ob = tmr_next(o);    /* the same vertices */
        if (middle[c] < 0) { /* a ghost edge: ghost - x, one whole edge of one half each */
            int32_t side[2];
            for (int k = 0; k < 2; k++) {
                const int32_t i = k ? o : c, base = k ? g : f;
                int ghost = 0;
                for (int j = 0; j < 3; j++)
                    if (old.flags[old.vertex[i / 3 * 3 + j]] & TMR_GHOST) ghost = j;
                /* of (ghost, b, a) = (0, 1, 2): i is b or a, its edge ghost - the other one */
                const int which = (i % 3 - ghost + 3) % 3;
                /* i is b (1): edge a - ghost: half (ghost, m, a) opposite m; a (2): half 1 opp. m */
                side[k] = which == 1 ? base + 4 : base + 2;
            }
            tmr_link(m, side[0], side[1], 0);
            continue;
        }
        /* two halves: at a and at b */
        int32_t at_a[2], at_b[2];
        for (int k = 0; k < 2; k++) {
            const int32_t i = k ? o : c, base = k ? g : f, ia = k ? oa : a, ib = k ? ob : b;
            if (k ? gg : fg) {
                /* i is the ghost; (ghost, next, m), (ghost, m, prev): opposite to the ghost */
                at_a[k] = ia == tmr_next(i) ? base : base + 3;
                at_b[k] = ib == tmr_next(i) ? base : base + 3;
            } else {
                /* the triangle at corner x is (x, m of prev edge.. ) */
                at_a[k] = base + 3 * (ia % 3) + (ia == tmr_next(i) ? 2 : 1);
                at_b[k] = base + 3 * (ib % 3) + (ib == tmr_next(i) ? 2 : 1);
            }
        }
        tmr_link(m, at_a[0], at_a[1], old.edge[c]);
        tmr_link(m, at_b[0], at_b[1], old.edge[c]);
    }
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        m->corner[m->vertex[c]] = c;
        m->valence[m->vertex[c]]++;
    }
    return TXM_OK;
}

/* ---- fitting ------------------------------------------------------------------------------ */

/* Chords lie inside a round surface, so a mesh with its vertices on the surface has too little
   volume. Each free vertex moves along its normal by the mean height of the surface over the
   triangles around it. The mean height over one triangle is 3/4 of that at its centre plus 1/4 of
   the mean of those at its corners, which is exact for a paraboloid. It moves off the
   surface by no more than TMR_FIT_OUT, except where the surface is round all around: beside a fillet
   it would stick out. On a flat it stays. */
#define TMR_FIT_OUT 0.02    /* ours: in edge lengths                                           */
#define TMR_FIT_MOST 0.15   /* ours: where it is round                                         */
#define TMR_FIT_EVEN 1e-4   /* ours: triangles of lower height lie in a flat                   */
#define TMR_FIT_ROUND 0.3   /* ours: it is, if the second lowest height is this part of the mean */

static double tmr_height_over(const tmr_work *w, int32_t face) {
    const tmr_mesh *m = &w->m;
    const int32_t *v = m->vertex + 3 * face;
    const txm_dvec3 n = txm_d3_unit(txm_d3_area2(m->p[v[0]], m->p[v[1]], m->p[v[2]]));
    const txm_dvec3 centre = tmr_middle(m, v);
    double sum = 0;
    int32_t from = v[0];
    for (int k = 0; k < 3; k++) {
        if (tmr_kind_of(m, v[k]) != TRIMESH_FREE) continue;
        from = v[k];
        const tmr_place at = tmr_on_face(w->s, m->source[v[k]], m->p[v[k]]);
        sum += txm_d3_dot(txm_d3_sub(at.p, m->p[v[k]]), n);
    }
    const tmr_place at = tmr_project(w->s, centre, tmr_face_of(w, from));
    return 0.75 * txm_d3_dot(txm_d3_sub(at.p, centre), n) + 0.25 * sum / 3;
}

/* May fitting take v off the surface? Creases and borders stay where they are. */
static int tmr_may_fit(const tmr_work *w, int32_t v) {
    const int kind = tmr_kind_of(&w->m, v);
    return kind == TRIMESH_FREE ||
           (kind == TRIMESH_CREASE && tmr_is_smooth_segment(w->l, w->m.source[v]));
}

/* How far may vertex v move out of the surface (sign 1) or into it (-1)? Not at all if triangles
   around it lie in a flat. On a smooth surface the heights over the triangles around are nearly
   equal; the second lowest one tells such places from those beside a fillet, where some are high. */
static float tmr_fit_limit(const tmr_work *w, int32_t v, double sign) {
    const tmr_mesh *m = &w->m;
    const double unit = w->length * w->size[v];
    double low[2] = {0, 0}, sum = 0; /* the lowest heights, in rising order */
    int count = 0, flat = 0;
    int32_t c = m->corner[v];
    const int32_t first = c;
    do {
        if (!tmr_is_ghost_face(m, c / 3)) {
            double h = sign * (double)w->height[c / 3];
            flat += fabs(h) < TMR_FIT_EVEN * unit;
            sum += h;
            for (int k = 0; k < 2; k++) {
                const double old = low[k];
                if (k < count && old <= h) continue;
                low[k] = h;
                h = old;
                if (k >= count) break;
            }
            count++;
        }
        c = tmr_swing(m, c);
    } while (c != first);
    if (flat >= 2 || count == 0) return 0;
    const double second = low[count > 1 ? 1 : 0];
    const int is_round = second * count >= TMR_FIT_ROUND * sum;
    return txm_float((is_round ? TMR_FIT_MOST : TMR_FIT_OUT) * unit);
}

static void tmr_limit_chunk(void *context, int index) {
    tmr_work *w = (tmr_work *)context;
    const tmr_mesh *m = &w->m;
    const int32_t from = index * TMR_CHUNK;
    const int32_t to = from + TMR_CHUNK < m->vertex_count ? from + TMR_CHUNK : m->vertex_count;
    for (int32_t v = from; v < to; v++) {
        w->limit[v][0] = w->limit[v][1] = 0;
        if (m->corner[v] < 0 || tmr_is_ghost(m, v) || !tmr_may_fit(w, v)) continue;
        w->limit[v][0] = -tmr_fit_limit(w, v, -1);
        w->limit[v][1] = tmr_fit_limit(w, v, 1);
    }
}

/* Move vertex v by the mean height around it, within its limits. */
static void tmr_fit_vertex(tmr_work *w, int32_t v) {
    const tmr_mesh *m = &w->m;
    double sum = 0;
    int count = 0;
    int32_t c = m->corner[v];
    const int32_t first = c;
    do {
        if (!tmr_is_ghost_face(m, c / 3)) {
            sum += w->height[c / 3];
            count++;
        }
        c = tmr_swing(m, c);
    } while (c != first);
    if (count == 0) return;
    const tmr_place at = tmr_on_face(w->s, tmr_face_of(w, v), m->p[v]);
    const double now = txm_d3_dot(txm_d3_sub(m->p[v], at.p), m->n[v]), to = now + sum / count;
    const double least = w->limit[v][0], most = w->limit[v][1];
    w->moved[v] = txm_d3_mad(m->p[v], m->n[v], (to < least ? least : to > most ? most : to) - now);
}

static void tmr_fit_chunk(void *context, int index) {
    tmr_work *w = (tmr_work *)context;
    const tmr_mesh *m = &w->m;
    const int32_t from = index * TMR_CHUNK;
    const int32_t to = from + TMR_CHUNK < m->vertex_count ? from + TMR_CHUNK : m->vertex_count;
    for (int32_t v = from; v < to; v++) {
        tmr_keep_place(w, v);
        if (m->corner[v] < 0 || tmr_is_ghost(m, v) || !tmr_may_fit(w, v)) continue;
        tmr_fit_vertex(w, v);
    }
}

static void tmr_height_chunk(void *context, int index) {
    tmr_work *w = (tmr_work *)context;
    const tmr_mesh *m = &w->m;
    const int32_t from = index * TMR_CHUNK;
    const int32_t to = from + TMR_CHUNK < m->face_count ? from + TMR_CHUNK : m->face_count;
    for (int32_t f = from; f < to; f++)
        w->height[f] = tmr_is_dead(m, f) || tmr_is_ghost_face(m, f) ? 0 : (float)tmr_height_over(w, f);
}

static txm_status tmr_fit_surface(tmr_work *w, int rounds, txm_arena *scratch) {
    w->height = (float *)txm_arena_alloc(scratch, (size_t)w->m.face_count, sizeof(float));
    w->limit = (float(*)[2])txm_arena_alloc(scratch, (size_t)w->m.vertex_count, 2 * sizeof(float));
    if (!w->height || !w->limit) return TXM_OUT_OF_MEMORY;
    for (int round = 0; round < rounds; round++) {
        txm_parallel_for(w->env, (w->m.face_count + TMR_CHUNK - 1) / TMR_CHUNK, tmr_height_chunk, w);
        if (tmr_tick(w, w->m.live)) return TXM_CANCELLED;
        const int chunks = (w->m.vertex_count + TMR_CHUNK - 1) / TMR_CHUNK;
        if (round == 0) txm_parallel_for(w->env, chunks, tmr_limit_chunk, w);
        if (tmr_tick(w, w->m.live)) return TXM_CANCELLED;
        txm_parallel_for(w->env, chunks, tmr_fit_chunk, w);
        tmr_settle(w);
        if (tmr_tick(w, w->m.live)) return TXM_CANCELLED;
    }
    return TXM_OK;
}

/* ---- is the result sound? ----------------------------------------------------------------- */

/* Does the open segment p q cross the interior of triangle a b c? rim: or its boundary. */
static int tmr_crosses(txm_dvec3 p, txm_dvec3 q, txm_dvec3 a, txm_dvec3 b, txm_dvec3 c, int rim) {
    const txm_dvec3 e1 = txm_d3_sub(b, a), e2 = txm_d3_sub(c, a), d = txm_d3_sub(q, p);
    const txm_dvec3 h = txm_d3_cross(d, e2);
    const double det = txm_d3_dot(e1, h), eps = 1e-10, least = rim ? -eps : eps;
    if (fabs(det) <= 1e-10 * txm_d3_len(e1) * txm_d3_len(e2) * txm_d3_len(d)) return 0;
    const txm_dvec3 s = txm_d3_sub(p, a), k = txm_d3_cross(s, e1);
    const double u = txm_d3_dot(s, h) / det, v = txm_d3_dot(d, k) / det,
                 t = txm_d3_dot(e2, k) / det;
    return u > least && v > least && u + v < 1 - least && t > eps && t < 1 - eps;
}

/* Do two triangles, which share at most one vertex, cross each other? rim: also where an edge only
   passes through the boundary of the other triangle, as with cards that cross edge to edge. */
static int tmr_faces_cross(const tmr_mesh *m, int32_t f, int32_t g, int rim) {
    const int32_t *v = m->vertex + 3 * f, *w = m->vertex + 3 * g;
    int shared = 0, kf = 0, kg = 0;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            if (v[i] != w[j]) continue;
            shared++;
            kf = i;
            kg = j;
        }
    }
    if (shared > 1) return 0;
    const txm_dvec3 a[3] = {m->p[v[0]], m->p[v[1]], m->p[v[2]]};
    const txm_dvec3 b[3] = {m->p[w[0]], m->p[w[1]], m->p[w[2]]};
    if (shared == 1)
        return tmr_crosses(a[(kf + 1) % 3], a[(kf + 2) % 3], b[0], b[1], b[2], rim) ||
               tmr_crosses(b[(kg + 1) % 3], b[(kg + 2) % 3], a[0], a[1], a[2], rim);
    const txm_dvec3 n = txm_d3_area2(a[0], a[1], a[2]);
    double low = 0, high = 0; /* of b on either side of a's plane */
    for (int i = 0; i < 3; i++) {
        const double d = txm_d3_dot(n, txm_d3_sub(b[i], a[0]));
        low = i == 0 || d < low ? d : low;
        high = i == 0 || d > high ? d : high;
    }
    if (low > 0 || high < 0) return 0;
    for (int i = 0; i < 3; i++) {
        if (tmr_crosses(a[i], a[(i + 1) % 3], b[0], b[1], b[2], rim)) return 1;
        if (tmr_crosses(b[i], b[(i + 1) % 3], a[0], a[1], a[2], rim)) return 1;
    }
    return 0;
}

#define TMR_TOUCH 1e-6 /* ours: distance, in diagonals, of what touches */

/* squared distance of the segments a b and c d */
static double tmr_segments_dist2(txm_dvec3 a, txm_dvec3 b, txm_dvec3 c, txm_dvec3 d) {
    const txm_dvec3 u = txm_d3_sub(b, a), v = txm_d3_sub(d, c), w = txm_d3_sub(a, c);
    const double uu = txm_d3_len2(u), vv = txm_d3_len2(v), uv = txm_d3_dot(u, v);
    const double uw = txm_d3_dot(u, w), vw = txm_d3_dot(v, w), det = uu * vv - uv * uv;
    double s = det > 1e-12 * uu * vv ? (uv * vw - vv * uw) / det : 0;
    s = fmin(fmax(s, 0), 1);
    double t = vv > 0 ? (uv * s + vw) / vv : 0;
    if (t < 0 || t > 1) { /* beyond an end: that end, and the place on a b nearest to it */
        t = t < 0 ? 0 : 1;
        s = uu > 0 ? fmin(fmax((uv * t - uw) / uu, 0), 1) : 0;
    }
    return txm_d3_dist2(txm_d3_mad(a, u, s), txm_d3_mad(c, v, t));
}

static int tmr_point_touches(txm_dvec3 p, const txm_dvec3 t[3]) {
    double u, v;
    int part;
    return txm_d3_dist2(p, tmr_nearest(p, t[0], t[1], t[2], &u, &v, &part)) < TMR_TOUCH * TMR_TOUCH;
}

/* Do two triangles touch away from the vertices that they share? So do cards and boxes that stand on
   one another, sheets that lie on each other, and what was separated along an edge. */
static int tmr_faces_touch(const tmr_mesh *m, int32_t f, int32_t g) {
    txm_dvec3 p[2][3];
    int alone[2][3] = {{1, 1, 1}, {1, 1, 1}}; /* not shared */
    for (int i = 0; i < 3; i++) {
        p[0][i] = m->p[m->vertex[3 * f + i]];
        p[1][i] = m->p[m->vertex[3 * g + i]];
        for (int j = 0; j < 3; j++)
            if (m->vertex[3 * f + i] == m->vertex[3 * g + j]) alone[0][i] = alone[1][j] = 0;
    }
    for (int k = 0; k < 2; k++) { /* a triangle without area touches its neighbours anyway */
        const double longest = fmax(txm_d3_dist2(p[k][0], p[k][1]),
                                    fmax(txm_d3_dist2(p[k][1], p[k][2]),
                                         txm_d3_dist2(p[k][2], p[k][0])));
        if (txm_d3_len(txm_d3_area2(p[k][0], p[k][1], p[k][2])) <= 10 * TMR_TOUCH * sqrt(longest))
            return 0;
    }
    for (int k = 0; k < 2; k++)
        for (int i = 0; i < 3; i++)
            if (alone[k][i] && tmr_point_touches(p[k][i], p[1 - k])) return 1;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) { /* edges without a shared end */
            const int i2 = (i + 1) % 3, j2 = (j + 1) % 3;
            const int32_t a = m->vertex[3 * f + i], b = m->vertex[3 * f + i2];
            const int32_t c = m->vertex[3 * g + j], d = m->vertex[3 * g + j2];
            if (a == c || a == d || b == c || b == d) continue;
            if (tmr_segments_dist2(p[0][i], p[0][i2], p[1][j], p[1][j2]) < TMR_TOUCH * TMR_TOUCH)
                return 1;
        }
    }
    return 0;
}

/* Triangles by the cells of a grid that their bounding boxes touch: hashed cells, sorted. */
typedef struct tmr_cells {
    double cell;
    txm_pair *entry, *spare;
    size_t count, limit;
    int overflow;
} tmr_cells;

/* The cell of a coordinate. Where one vertex lies extremely far out, edges may be so short beside the
   diagonal that cells cannot be counted; then those of the outer ones are the same. */
static int32_t tmr_cell_at(double x, double cell) {
    const double at = floor(x / cell);
    return !(at > -1e9) ? -1000000000 : at < 1e9 ? (int32_t)at : 1000000000;
}

static uint32_t tmr_cell_key(int32_t x, int32_t y, int32_t z) {
    return (uint32_t)(txm_hash((uint64_t)(uint32_t)x * 0x9e3779b1u + (uint64_t)(uint32_t)y *
                               0x85ebca77u * 65537u + ((uint64_t)(uint32_t)z << 40)) >> 32);
}

static void tmr_face_box(const tmr_mesh *m, int32_t f, txm_dvec3 *low, txm_dvec3 *high) {
    *low = *high = m->p[m->vertex[3 * f]];
    for (int k = 1; k < 3; k++) {
        const txm_dvec3 p = m->p[m->vertex[3 * f + k]];
        *low = txm_d3(fmin(low->x, p.x), fmin(low->y, p.y), fmin(low->z, p.z));
        *high = txm_d3(fmax(high->x, p.x), fmax(high->y, p.y), fmax(high->z, p.z));
    }
}

static void tmr_cells_add(const tmr_mesh *m, tmr_cells *g, int32_t f) {
    txm_dvec3 low, high;
    tmr_face_box(m, f, &low, &high);
    const int32_t x1 = tmr_cell_at(high.x, g->cell), y1 = tmr_cell_at(high.y, g->cell);
    const int32_t z1 = tmr_cell_at(high.z, g->cell);
    for (int32_t x = tmr_cell_at(low.x, g->cell); x <= x1; x++) {
        for (int32_t y = tmr_cell_at(low.y, g->cell); y <= y1; y++) {
            for (int32_t z = tmr_cell_at(low.z, g->cell); z <= z1; z++) {
                if (g->count == g->limit) {
                    g->overflow = 1;
                    return;
                }
                g->entry[g->count].key = tmr_cell_key(x, y, z);
                g->entry[g->count++].value = (uint32_t)f;
            }
        }
    }
}

enum {
    TMR_NEAR_CELLS = 1 << 16
}; /* coarse cells by hash: near a marked vertex?                    */

static uint32_t tmr_near_key(txm_dvec3 p, double cell, int dx, int dy, int dz) {
    return tmr_cell_key(tmr_cell_at(p.x, cell) + dx, tmr_cell_at(p.y, cell) + dy,
                        tmr_cell_at(p.z, cell) + dz) % TMR_NEAR_CELLS;
}

/* Set near for the coarse cells around the vertices marked in w->bad. */
static void tmr_mark_near(const tmr_work *w, uint8_t *nearby) {
    memset(nearby, 0, TMR_NEAR_CELLS);
    for (int32_t v = 0; v < w->m.vertex_count; v++) {
        if (!w->bad[v]) continue;
        for (int k = 0; k < 27; k++)
            nearby[tmr_near_key(w->m.p[v], 3 * w->length, k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1)] = 1;
    }
}

/* The cells of all triangles, or of those near, in order. */
static txm_status tmr_cells_make(const tmr_work *w, const uint8_t *nearby, tmr_cells *g,
                                 txm_arena *arena) {
    const tmr_mesh *m = &w->m;
    memset(g, 0, sizeof *g);
    g->cell = w->length * 0.65;
    g->limit = (size_t)m->live_faces * 10 + 1000;
    g->entry = (txm_pair *)txm_arena_alloc(arena, g->limit, sizeof(txm_pair));
    g->spare = (txm_pair *)txm_arena_alloc(arena, g->limit, sizeof(txm_pair));
    if (!g->entry || !g->spare) return TXM_OUT_OF_MEMORY;
    do { /* use coarser cells if there are many large triangles */
        g->cell *= 2;
        g->count = 0;
        g->overflow = 0;
        for (int32_t f = 0; f < m->face_count && !g->overflow; f++) {
            if (tmr_is_dead(m, f) || tmr_is_ghost_face(m, f)) continue;
            if (nearby && !nearby[tmr_near_key(m->p[m->vertex[3 * f]], 3 * w->length, 0, 0, 0)])
                continue;
            tmr_cells_add(m, g, f);
        }
    } while (g->overflow);
    txm_sort_pairs(g->entry, g->spare, g->count);
    return TXM_OK;
}

/* Is this the cell in which the boxes of two triangles, with these low corners, overlap first? There
   are others, where the pair need not be looked at again. */
static int tmr_is_first_cell(const tmr_cells *g, uint32_t key, txm_dvec3 a, txm_dvec3 b) {
    return key == tmr_cell_key(tmr_cell_at(fmax(a.x, b.x), g->cell),
                               tmr_cell_at(fmax(a.y, b.y), g->cell),
                               tmr_cell_at(fmax(a.z, b.z), g->cell));
}

enum { TMR_COUNT_CROSSING, TMR_ANY_CROSSING, TMR_ANY_TOUCHING }; /* what tmr_count_crossings does */

/* Count the pairs of triangles that cross each other in *found, and mark their vertices in w->bad.
   near: where to look, as tmr_mark_near has it; NULL = everywhere. what: TMR_ANY_CROSSING stops at the
   first one, TMR_ANY_TOUCHING also at the first that touch. Linear in the number of triangles. */
static txm_status tmr_count_crossings(tmr_work *w, const uint8_t *nearby, int what,
                                      txm_arena *scratch, long *found) {
    const tmr_mesh *m = &w->m;
    const int rim = what == TMR_ANY_TOUCHING;
    const double slack = rim ? TMR_TOUCH : 0;
    tmr_cells g;
    *found = 0;
    if (tmr_tick(w, m->live)) return TXM_CANCELLED;
    const txm_status status = tmr_cells_make(w, nearby, &g, scratch);
    if (status != TXM_OK) return status;
    if (tmr_tick(w, m->live)) return TXM_CANCELLED;
    for (size_t i = 0; i < g.count;) {
        size_t end = i + 1;
        while (end < g.count && g.entry[end].key == g.entry[i].key) end++;
        if (tmr_tick(w, 1)) return TXM_CANCELLED;
        for (size_t x = i; x < end; x++) {
            const int32_t f = (int32_t)g.entry[x].value;
            txm_dvec3 low, high;
            tmr_face_box(m, f, &low, &high);
            for (size_t y = x + 1; y < end; y++) {
                const int32_t h = (int32_t)g.entry[y].value;
                txm_dvec3 low2, high2;
                if (f == h) continue;
                tmr_face_box(m, h, &low2, &high2);
                if (low.x > high2.x + slack || low2.x > high.x + slack ||
                    low.y > high2.y + slack || low2.y > high.y + slack ||
                    low.z > high2.z + slack || low2.z > high.z + slack)
                    continue;
                if (what != TMR_COUNT_CROSSING &&
                    !tmr_is_first_cell(&g, g.entry[i].key, low, low2))
                    continue;
                if (!tmr_faces_cross(m, f, h, rim) && !(rim && tmr_faces_touch(m, f, h))) continue;
                ++*found;
                if (what != TMR_COUNT_CROSSING) return TXM_OK;
                for (int k = 0; k < 3; k++)
                    w->bad[m->vertex[3 * f + k]] = w->bad[m->vertex[3 * h + k]] = 1;
            }
        }
        i = end;
    }
    return TXM_OK;
}

enum { TMR_SPOT_FACES = 256 }; /* of the surface that are looked at around one spot */

/* Does the surface face along n anywhere near the place? Looks at the faces that are connected to
   it within a ball around p. */
static int tmr_faces_along(const tmr_surface *s, txm_dvec3 n, int32_t face, txm_dvec3 p,
                           double radius) {
    int32_t list[TMR_SPOT_FACES];
    int count = 1;
    list[0] = face;
    for (int i = 0; i < count; i++) {
        if (txm_d3_dot(n, s->normal[list[i]]) > 0.3) return 1;
        for (int k = 0; k < 3 && count < TMR_SPOT_FACES; k++) {
            const int32_t o = s->opposite[3 * list[i] + k];
            int known = o < 0;
            for (int j = 0; j < count && !known; j++) known = list[j] == o / 3;
            if (known || tmr_on_face(s, o / 3, p).d2 > radius * radius) continue;
            list[count++] = o / 3;
        }
    }
    return 0;
}

/* Count the triangles that have no area, or whose normal is opposite to that of all of the surface
   nearby. Those that are only opposite to the nearest place, as happens on thin sheets, are counted
   in *doubtful. Marks their vertices. */
static long tmr_count_inverted(tmr_work *w, long *doubtful) {
    const tmr_mesh *m = &w->m;
    long found = 0;
    *doubtful = 0;
    for (int32_t f = 0; f < m->face_count; f++) {
        const int32_t *v = m->vertex + 3 * f;
        if (v[0] < 0 || tmr_is_ghost_face(m, f)) continue;
        const txm_dvec3 n = txm_d3_area2(m->p[v[0]], m->p[v[1]], m->p[v[2]]);
        const double longest =
            fmax(txm_d3_dist2(m->p[v[0]], m->p[v[1]]),
                 fmax(txm_d3_dist2(m->p[v[1]], m->p[v[2]]), txm_d3_dist2(m->p[v[2]], m->p[v[0]])));
        const double area2 = txm_d3_len(n);
        int turned = area2 < 1e-4 * longest, doubt = 0;
        if (!turned && tmr_agreement(w, v[0], v[1], v[2], m->p[v[0]], m->p[v[1]], m->p[v[2]]) < 0.2) {
            const tmr_place at = tmr_below_middle(w, v);
            doubt = txm_d3_dot(n, w->s->normal[at.face]) < 0 &&
                    txm_d3_dot(n, tmr_normal_at(w->s, w->l, &at)) < 0;
            turned = doubt && !tmr_faces_along(w->s, txm_d3_scale(n, 1 / area2), at.face,
                                               tmr_middle(m, v), sqrt(at.d2) + 0.45 * w->length);
        }
        if (!turned && !doubt) continue;
        found += turned;
        *doubtful += !turned;
        for (int k = 0; k < 3; k++) w->bad[v[k]] = 1;
    }
    return found;
}

/* Open folds, that is, edges at which two triangles nearly lie on each other (the mesh turns by
   more than 120 degrees): move such an edge towards the middle between the two far corners. Returns
   how many there were. */
static long tmr_open_folds(tmr_work *w, double share) {
    tmr_mesh *m = &w->m;
    long found = 0;
    for (int32_t v = 0; v < m->vertex_count; v++) {
        tmr_keep_place(w, v);
    }
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        if (!tmr_is_real_edge(m, c)) continue;
        const int32_t o = m->opposite[c], d = m->vertex[c], e = m->vertex[o];
        if (tmr_is_ghost(m, d) || tmr_is_ghost(m, e)) continue;
        const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
        const txm_dvec3 n = txm_d3_unit(txm_d3_area2(m->p[d], m->p[a], m->p[b]));
        if (txm_d3_dot(n, txm_d3_unit(txm_d3_area2(m->p[e], m->p[b], m->p[a]))) >= -0.47) continue;
        found++;
        const txm_dvec3 distant = txm_d3_scale(txm_d3_add(m->p[d], m->p[e]), 0.5);
        const txm_dvec3 nearby = txm_d3_scale(txm_d3_add(m->p[a], m->p[b]), 0.5);
        const txm_dvec3 to =
            txm_d3_scale(txm_d3_unit(txm_d3_sub(distant, nearby)), share * w->length);
        if (tmr_kind_of(m, a) == TRIMESH_FREE)
            w->moved[a] = txm_d3_add(w->moved[a], txm_d3_scale(to, w->size[a]));
        if (tmr_kind_of(m, b) == TRIMESH_FREE)
            w->moved[b] = txm_d3_add(w->moved[b], txm_d3_scale(to, w->size[b]));
    }
    if (found) tmr_settle(w);
    return found;
}

/* Extend the marks in w->bad to all neighbours of marked vertices. */
static void tmr_grow_marks(tmr_work *w) {
    const tmr_mesh *m = &w->m;
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        if (m->vertex[c] < 0) continue;
        const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
        if (w->bad[a] == 1 && !w->bad[b]) w->bad[b] = 2;
        if (w->bad[b] == 1 && !w->bad[a]) w->bad[a] = 2;
    }
    for (int32_t v = 0; v < m->vertex_count; v++) w->bad[v] = w->bad[v] != 0;
}

/* Move every marked vertex half-way to the mean of its neighbours, off the surface: detail that is
   too fine for the triangles is smoothed away there. Creases are moved only if lines_too is set. */
static void tmr_smooth_marked(tmr_work *w, int lines_too) {
    tmr_mesh *m = &w->m;
    for (int32_t v = 0; v < m->vertex_count; v++) {
        const int kind = tmr_kind_of(m, v);
        if (!w->bad[v] || m->corner[v] < 0 || (m->flags[v] & (TMR_GHOST | TMR_PINNED))) continue;
        if (kind == TRIMESH_BORDER || (kind != TRIMESH_FREE && !lines_too)) continue;
        txm_dvec3 sum = txm_d3(0, 0, 0);
        int32_t count = 0, c = m->corner[v];
        const int32_t first = c;
        do {
            const int32_t to = m->vertex[tmr_next(c)];
            if (!tmr_is_ghost(m, to)) {
                sum = txm_d3_add(sum, m->p[to]);
                count++;
            }
            c = tmr_swing(m, c);
        } while (c != first);
        if (count == 0) continue;
        m->p[v] = txm_d3_add(txm_d3_scale(m->p[v], 0.5), txm_d3_scale(sum, 0.5 / count));
        if (kind != TRIMESH_FREE) continue;
        const tmr_place at = tmr_project(w->s, m->p[v], m->source[v]);
        m->source[v] = at.face;
    }
}

#define TMR_FAIR 0.85 /* ours: quality of triangles that gets no further attention */

/* More rounds of relaxation and flips around the triangles that are still poor. */
static txm_status tmr_improve_spots(tmr_work *w, int rounds) {
    tmr_mesh *m = &w->m;
    w->pull = w->step = 1;
    for (int round = 0; round < rounds; round++) {
        int32_t poor = 0;
        memset(w->bad, 0, (size_t)m->vertex_count);
        for (int32_t f = 0; f < m->face_count; f++) {
            const int32_t *v = m->vertex + 3 * f;
            if (v[0] < 0 || tmr_is_ghost_face(m, f)) continue;
            if (tmr_quality(m->p[v[0]], m->p[v[1]], m->p[v[2]],
                            tmr_expected_normal(w, v[0], v[1], v[2])) >= TMR_FAIR)
                continue;
            poor++;
            for (int k = 0; k < 3; k++) w->bad[v[k]] = 1;
        }
        if (poor == 0) break;
        for (int k = 0; k < 3; k++) tmr_grow_marks(w);
        memcpy(w->mask_room, w->bad, (size_t)m->vertex_count);
        w->mask = w->mask_room;
        for (int k = 0; k < 3; k++) tmr_relax(w);
        w->mask = NULL;
        if (tmr_tick(w, m->live)) return TXM_CANCELLED;
        tmr_flip_valences(w, 2, 0.4);
        tmr_flip_delaunay(w, 2);
        if (tmr_tick(w, m->live)) return TXM_CANCELLED;
    }
    return TXM_OK;
}

enum { TMR_SPOT_ROUNDS = 16 };

/* Smooth around the spots where triangles cross or are inverted, in growing neighbourhoods; the
   best state found stays. *faults receives how many are left. */
static txm_status tmr_mend_spots(tmr_work *w, long *faults) {
    const size_t count = (size_t)w->m.vertex_count;
    txm_arena arena;
    long best = -1;
    txm_dvec3 *kept = NULL;
    int32_t *kept_source = NULL;
    txm_arena_init(&arena, w->env);
    uint8_t *nearby = (uint8_t *)txm_arena_alloc(&arena, TMR_NEAR_CELLS, 1);
    txm_status status = tmr_check_memory(&arena);
    for (int round = 0; round <= TMR_SPOT_ROUNDS && status == TXM_OK; round++) {
        txm_arena scratch;
        long crossings, doubtful;
        if (round > 0) tmr_mark_near(w, nearby); /* w->bad: what was moved */
        memset(w->bad, 0, count);
        txm_arena_init(&scratch, w->env);
        status = tmr_count_crossings(w, round > 0 ? nearby : NULL, TMR_COUNT_CROSSING, &scratch,
                                     &crossings);
        txm_arena_free(&scratch);
        if (status != TXM_OK) break;
        if (tmr_tick(w, w->m.live)) {
            status = TXM_CANCELLED;
            break;
        }
        const long turned = tmr_count_inverted(w, &doubtful);
        const long score = 1000 * (crossings + turned) + doubtful;
        if (best < 0 || score < best) {
            if (score > 0 && !kept) {
                kept = (txm_dvec3 *)txm_arena_alloc(&arena, count, sizeof(txm_dvec3));
                kept_source = (int32_t *)txm_arena_alloc(&arena, count, sizeof(int32_t));
                if ((status = tmr_check_memory(&arena)) != TXM_OK) break;
            }
            best = score;
            if (kept) memcpy(kept, w->m.p, count * sizeof(txm_dvec3));
            if (kept) memcpy(kept_source, w->m.source, count * sizeof(int32_t));
        }
        if (score == 0 || (best < 1000 && round >= 4)) break;
        if (50 * (crossings + turned) > (long)w->m.live_faces + 2000) break; /* too many to mend */
        for (int k = 0; k < 1 + round / 6; k++) tmr_grow_marks(w);
        tmr_smooth_marked(w, round >= 6);
    }
    if (status == TXM_OK && best > 0) {
        memcpy(w->m.p, kept, count * sizeof(txm_dvec3));
        memcpy(w->m.source, kept_source, count * sizeof(int32_t));
    }
    *faults = best / 1000;
    txm_arena_free(&arena);
    return status;
}

/* ---- points that repel each other [1, sections 3.1 to 3.3] --------------------------------- */

/* The thesis distributes points, lets them repel each other, then joins them to triangles. Here they
   are joined first and stay joined while they repel each other, with edges flipped as they move:

   - the neighbours of a point are those within the radius of influence that a walk over edges finds.
     Points of two sheets that are close together, of one piece or of two, do not affect each other,
     and no search in space is needed;
   - the triangulation cannot fail: it is a closed manifold of the right topology from the start;
   - vertices of the input that cannot be removed, since a handle needs them, become points like the
     others, and the number is exact before points find their places.

   Stages:  sample   points by area, evenly on lines       (tmr_sample)
            join     put each into the mesh of the input   (tmr_insert; mutual tessellation [2])
                     and remove the input's vertices       (tmr_remove_vertices)
            repel    equation 3.1                          (tmr_repel_round)                    */

enum {
    TMR_ROUNDS = 40,        /* of repulsion; k of Turk and of the thesis                          */
    TMR_NEAR = 48,          /* most points that repel one; a dozen is usual                       */
    TMR_REMOVE_PASSES = 60, /* ours: over the vertices of the input; 5 to 20 are usual           */
    TMR_WALK = 4096         /* steps within one face of the input                                 */
};

/* Radius of influence r = 2 sqrt(area / N), Turk's, here in lengths of the edge L = sqrt(2 /
   sqrt(3) area / N) of the triangular lattice with so many points. In the lattice the six
   neighbours are nearer than r, and the next six only just. */
#define TMR_REACH 1.86

/* f of equation 3.1: the thesis's 0.5 at first, then falling until the points come to rest. As all
   points move at once, 0.5 is too large for that: neighbours oscillate from f = 0.2 on. But the
   oscillation gets points out of poor arrangements, as heat does: lowering f slowly gives a mean
   quality of 0.981 instead of 0.976 in 40 rounds, and 0.985 in 120. */
#define TMR_FORCE 0.5
#define TMR_LAST_FORCE 0.15

typedef struct tmr_sampling {
    tmr_work *w;
    const trimesh_desc *desc;
    int32_t *inside;   /* 1 per triangle of the mesh: the face of the surface that contains it    */
    int32_t *fixed;    /* 1 per component: points on lines and corners                           */
    int32_t *wanted;   /* 1 per component: all points                                            */
    int32_t *spare;    /* 1 per component: how many of them are not required                     */
    double *weight;    /* 1 per component                                                        */
    double *piece; /* 1 per face: area / size^2, which its share of the points is proportional to */
    uint8_t *keep;     /* 1 per vertex of the mesh: is a point                                    */
    double *ways;      /* line_room + 1: places on the current line                              */
    int32_t line_room; /* the most edges that a line is cut into                                 */
    double length;     /* L, where the size is 1                                                  */
    int32_t hint;      /* triangle of the mesh where a search starts                             */
} tmr_sampling;

/* ---- sampling: how many where --------------------------------------------------------------- */

/* wanted edge length at a vertex of the surface, relative */
static double tmr_vertex_size(const tmr_surface *s, int32_t v) {
    return s->scale ? s->scale[v] : 1;
}

/* length of a segment in wanted edge lengths */
static double tmr_segment_weight(const tmr_surface *s, const tmr_lines *l, int32_t k) {
    return txm_d3_dist(s->point[l->a[k]], s->point[l->b[k]]) * 2 /
           (tmr_vertex_size(s, l->a[k]) + tmr_vertex_size(s, l->b[k]));
}

static double tmr_line_weight(const tmr_surface *s, const tmr_lines *l, int32_t line) {
    double sum = 0;
    for (int32_t k = l->first[line]; k < l->first[line + 1]; k++)
        sum += tmr_segment_weight(s, l, k);
    return sum;
}

static double tmr_face_weight(const tmr_surface *s, int32_t f) {
    const int32_t *v = s->vertex + 3 * f;
    const double size = (tmr_vertex_size(s, v[0]) + tmr_vertex_size(s, v[1]) +
                         tmr_vertex_size(s, v[2])) / 3;
    return 0.5 * txm_d3_len(txm_d3_area2(s->point[v[0]], s->point[v[1]], s->point[v[2]])) /
           (size * size);
}

/* Edge length L for so many points: each has sqrt(3) / 2 L^2 of the weighted area, on the border
   half of that. */
static double tmr_sampling_length(const tmr_surface *s, const tmr_lines *l, double line_scale,
                                  double points) {
    double area = 0, border = 0;
    for (int32_t f = 0; f < s->face_count; f++) area += tmr_face_weight(s, f);
    for (int32_t i = 0; i < l->line_count; i++)
        if (l->border[i]) border += tmr_line_weight(s, l, i);
    double length = sqrt(1.1547005383792515 * area / points);
    for (int round = 0; round < 4; round++) {
        const double whole = points - 0.5 * border / (length * line_scale);
        length = sqrt(1.1547005383792515 * area / fmax(whole, 0.5 * points));
    }
    return length;
}

/* How many edges a line is cut into: by its length, and so many that no two edges coincide. */
static int32_t tmr_line_steps(const tmr_sampling *t, int32_t line) {
    const tmr_lines *l = t->w->l;
    const double spacing = t->length * t->w->line_scale;
    const double steps = floor(tmr_line_weight(t->w->s, l, line) / spacing + 0.5);
    const int32_t a = l->a[l->first[line]], b = l->b[l->first[line + 1] - 1];
    const int32_t least = a == b ? 3 : 1;
    return steps < least ? least : steps > t->w->m.vertex_limit ? t->w->m.vertex_limit
                                                                 : (int32_t)steps;
}

/* The smallest number of points for each component, from its Euler characteristic. Call it before
   anything is cut. */
static void tmr_least_points(tmr_sampling *t) {
    const tmr_surface *s = t->w->s;
    const tmr_mesh *m = &t->w->m;
    double *euler = t->weight; /* free until later */
    for (int32_t i = 0; i < s->component_count; i++) euler[i] = 0;
    for (int32_t v = 0; v < m->vertex_count; v++) {
        int32_t f = m->corner[v] / 3;
        if (f >= s->face_count) f = m->opposite[3 * f] / 3; /* (ghost, b, a): the face beside it */
        euler[s->component[f]]++;
    }
    for (int32_t f = 0; f < m->face_count; f++)
        euler[s->component[f < s->face_count ? f : m->opposite[3 * f] / 3]] -= 0.5;
    for (int32_t i = 0; i < s->component_count; i++) /* Heawood; sphere 4, torus 7 */
        t->wanted[i] = (int32_t)ceil((7 + sqrt(fmax(49 - 24 * euler[i], 1))) / 2);
}

/* Share the points among the components by weight, but give each at least what it needs. If that is
   too many in all, take points from those that have most to spare. */
static void tmr_share_points(tmr_sampling *t, int32_t total) {
    const tmr_surface *s = t->w->s;
    const int32_t n = s->component_count;
    double sum = 0, run = 0;
    int32_t given = 0, before = 0;
    for (int32_t i = 0; i < n; i++) t->weight[i] = 0;
    for (int32_t f = 0; f < s->face_count; f++) t->weight[s->component[f]] += t->piece[f];
    for (int32_t i = 0; i < n; i++) sum += t->weight[i];
    for (int32_t i = 0; i < n; i++) {
        run += t->weight[i];
        const int32_t to = (int32_t)floor(run / sum * total + 0.5);
        const int32_t least = t->wanted[i] > t->fixed[i] ? t->wanted[i] : t->fixed[i];
        t->wanted[i] = to - before > least ? to - before : least;
        t->spare[i] = t->wanted[i] - least;
        given += t->wanted[i];
        before = to;
    }
    while (given > total) { /* at most once per component */
        int32_t most = 0;
        for (int32_t i = 1; i < n; i++)
            if (t->spare[i] > t->spare[most]) most = i;
        if (t->spare[most] == 0) break;
        const int32_t over = given - total, take = over < t->spare[most] ? over : t->spare[most];
        t->wanted[most] -= take;
        t->spare[most] -= take;
        given -= take;
    }
}

/* ---- joining: putting a point into the mesh ------------------------------------------------ */

/* Flip edges around the new vertex v until they are Delaunay, only within faces of the surface, so
   that triangles stay parts of faces. */
static void tmr_legalize(tmr_sampling *t, int32_t v) {
    tmr_mesh *m = &t->w->m;
    int32_t stack[64], count = 0, c = m->corner[v];
    const int32_t first = c;
    do {
        if (count < 64) stack[count++] = c;
        c = tmr_swing(m, c);
    } while (c != first);
    for (int guard = 0; count > 0 && guard < 1000; guard++) {
        c = stack[--count];
        const int32_t o = m->opposite[c];
        if (m->vertex[c] != v || m->edge[c] || t->inside[c / 3] != t->inside[o / 3]) continue;
        if (!tmr_is_wide(m, c) || !tmr_can_flip(m, c)) continue;
        const int32_t other = tmr_prev(o); /* will be v's corner in the second triangle */
        tmr_flip(m, c);
        if (count < 62) {
            stack[count++] = other;
            stack[count++] = c;
        }
    }
}

/* The part of the face in which p lies, and the weights of its corners there. */
static int32_t tmr_find_part(const tmr_sampling *t, int32_t face, txm_dvec3 p, double weight[3]) {
    const tmr_mesh *m = &t->w->m;
    const txm_dvec3 n = t->w->s->normal[face];
    int32_t part = t->inside[t->hint] == face ? t->hint : face;
    for (int guard = 0; guard < TMR_WALK; guard++) {
        const int32_t *v = m->vertex + 3 * part;
        double sum = 0;
        int least = 0;
        for (int k = 0; k < 3; k++) {
            const txm_dvec3 a = m->p[v[(k + 1) % 3]], b = m->p[v[(k + 2) % 3]];
            weight[k] = txm_d3_dot(txm_d3_area2(p, a, b), n);
            sum += weight[k];
            if (weight[k] < weight[least]) least = k;
        }
        for (int k = 0; k < 3; k++) weight[k] = sum > 0 ? weight[k] / sum : 1.0 / 3;
        const int32_t o = m->opposite[3 * part + least] / 3;
        if (weight[least] >= 0 || t->inside[o] != face) break;
        part = o;
    }
    return part;
}

/* Cut the edge opposite to c at a new vertex; -1 without room. */
static int32_t tmr_cut_edge(tmr_sampling *t, int32_t c) {
    tmr_mesh *m = &t->w->m;
    const int32_t a = t->inside[c / 3], b = t->inside[m->opposite[c] / 3];
    const int32_t v = tmr_split(m, c);
    if (v < 0) return v;
    t->inside[m->face_count - 2] = a;
    t->inside[m->face_count - 1] = b;
    t->keep[v] = 1;
    return v;
}

/* Put a point that lies in a face of the surface into the mesh: into the triangle that holds it, on
   an edge if it lies there. Returns its vertex, or -1 if there is no room, or if it lies on a line
   or on a vertex that is a point already. exact: do not move the point; else it keeps a margin from
   the edges. */
static int32_t tmr_insert(tmr_sampling *t, int32_t face, txm_dvec3 p, int exact) {
    tmr_work *w = t->w;
    tmr_mesh *m = &w->m;
    double weight[3];
    int32_t part = tmr_find_part(t, face, p, weight), v;
    int least = 0, most = 0;
    for (int k = 1; k < 3; k++) {
        if (weight[k] < weight[least]) least = k;
        if (weight[k] > weight[most]) most = k;
    }
    const double margin = exact ? 1e-9 : 0.02;
    const int32_t *corner = m->vertex + 3 * part;
    if (exact && weight[most] > 1 - 1e-6) { /* on a vertex */
        v = corner[most];
        if (t->keep[v] || tmr_is_ghost(m, v) || tmr_kind_of(m, v) != TRIMESH_FREE) return -1;
        t->keep[v] = 1;
        return v;
    }
    if (exact && weight[least] < margin) {
        if (m->edge[3 * part + least]) return -1;
        v = tmr_cut_edge(t, 3 * part + least);
    } else {
        if (weight[least] < margin) { /* keep the margin        */
            double sum = 0;
            for (int k = 0; k < 3; k++) sum += weight[k] = fmax(weight[k], margin);
            p = txm_d3(0, 0, 0);
            for (int k = 0; k < 3; k++) p = txm_d3_mad(p, m->p[corner[k]], weight[k] / sum);
        }
        v = tmr_split_face(m, part);
        if (v < 0) return v;
        t->inside[m->face_count - 2] = t->inside[m->face_count - 1] = face;
    }
    if (v < 0) return v;
    t->keep[v] = 1;
    t->hint = part;
    const tmr_place at = tmr_on_face(w->s, face, p);
    tmr_put(w, v, &at);
    if (exact) m->p[v] = p;
    tmr_legalize(t, v);
    return v;
}

/* Cut a line at places given by their distance from its beginning, in wanted edge lengths, in
   rising order. A vertex of the surface very near to one of them is used instead. vertices: NULL,
   or receives the vertex for each place. TXM_TOO_SMALL: there is no room for so many vertices. */
static txm_status tmr_cut_line(tmr_sampling *t, int32_t line, const double *ways, int32_t count,
                               int32_t *vertices) {
    tmr_work *w = t->w;
    const tmr_surface *s = w->s;
    const tmr_lines *l = w->l;
    const double nearby = 0.02 * t->length;
    double way = 0;
    int32_t done = 0;
    for (int32_t k = l->first[line]; k < l->first[line + 1]; k++) {
        const int32_t a = l->a[k], b = l->b[k];
        const double weight = tmr_segment_weight(s, l, k);
        int32_t left = a;
        for (; done < count && ways[done] < way + weight + nearby; done++) {
            const double u = weight > 0 ? (ways[done] - way) / weight : 0;
            int32_t v = u < 0.5 ? a : b;
            if (u * weight >= nearby && (1 - u) * weight >= nearby) {
                const int32_t c = tmr_find_edge(&w->m, left, b);
                v = c < 0 ? -1 : tmr_cut_edge(t, tmr_prev(c));
                if (v < 0) return TXM_TOO_SMALL;
                w->m.flags[v] = l->border[line] ? TRIMESH_BORDER : TRIMESH_CREASE;
                tmr_put_on_line(
                    w, v, txm_d3_mad(s->point[a], txm_d3_sub(s->point[b], s->point[a]), u), k);
                tmr_legalize(t, v);
                left = v;
            }
            t->keep[v] = 1;
            if (vertices) vertices[done] = v;
        }
        way += weight;
    }
    for (; done < count && vertices; done++) vertices[done] = -1;
    return TXM_OK;
}

/* spread the lower ten bits to every third */
static uint32_t tmr_spread_bits(uint32_t x) {
    x &= 0x3ff;
    x = (x | x << 16) & 0x30000ff;
    x = (x | x << 8) & 0x300f00f;
    x = (x | x << 4) & 0x30c30c3;
    return (x | x << 2) & 0x9249249;
}

/* The order of a place on a curve that fills the box of -1/2..1/2 (Morton). */
static uint32_t tmr_curve_key(txm_dvec3 p) {
    const double x[3] = {p.x, p.y, p.z};
    uint32_t key = 0;
    for (int k = 0; k < 3; k++)
        key |= tmr_spread_bits((uint32_t)txm_clampi((int)((x[k] + 0.5) * 1023), 0, 1023)) << k;
    return key;
}

static txm_dvec3 tmr_face_centre(const tmr_surface *s, int32_t f) {
    const int32_t *v = s->vertex + 3 * f;
    return txm_d3_scale(txm_d3_add(txm_d3_add(s->point[v[0]], s->point[v[1]]), s->point[v[2]]),
                        1.0 / 3);
}

/* Faces in the order of a space-filling curve, component by component, in pairs[].value. */
static void tmr_order_faces(const tmr_surface *s, txm_pair *pairs, txm_pair *room) {
    for (int32_t f = 0; f < s->face_count; f++) {
        pairs[f].key = tmr_curve_key(tmr_face_centre(s, f));
        pairs[f].value = (uint32_t)f;
    }
    txm_sort_pairs(pairs, room, (size_t)s->face_count);
    for (int32_t f = 0; f < s->face_count; f++)
        pairs[f].key = (uint32_t)s->component[pairs[f].value];
    txm_sort_pairs(pairs, room, (size_t)s->face_count); /* keeps the order of equal ones */
}

/* The place of point i of count in a face: in one of the m^2 parts that lines at 1/m of its sides
   cut it into, m^2 >= count, row by row, at random within.

       m = 3, row 0 at the corner 0:   /\       row j has 2 j + 1 parts, up and down in turn
                                      /\/\
                                     /\/\/\                                                    */
static txm_dvec3 tmr_sample_place(const tmr_surface *s, int32_t face, int32_t i, int32_t count,
                                  txm_rng *rng) {
    const int32_t *v = s->vertex + 3 * face;
    int32_t m = (int32_t)floor(sqrt((double)count));
    if (m < 1) m = 1;
    while ((double)m * m < count) m++;
    const double cell = floor((double)i * m * m / count);
    int32_t row = (int32_t)floor(sqrt(cell));
    while ((double)row * row > cell) row--;
    while ((row + 1.0) * (row + 1) <= cell) row++;
    int32_t k = (int32_t)(cell - (double)row * row);
    if (row & 1) k = 2 * row - k; /* back and forth, so that consecutive points are close */
    double x = txm_rng_double(rng), y = txm_rng_double(rng);
    if (x + y > 1) {
        x = 1 - x;
        y = 1 - y;
    }
    const int32_t column = k / 2;
    double down, across; /* from corner 0 towards corner 1, from 1 towards 2, in cells */
    if (k & 1) {
        down = row + 1 - x - y;
        across = column + 1 - x;
    } else {
        down = row + x + y;
        across = column + y;
    }
    const double u = (down - across) / m, w = across / m;
    return txm_d3_add(s->point[v[0]],
                      txm_d3_add(txm_d3_scale(txm_d3_sub(s->point[v[1]], s->point[v[0]]), u),
                                 txm_d3_scale(txm_d3_sub(s->point[v[2]], s->point[v[0]]), w)));
}

/* Strew the points that are on no line: each component is cut into as many runs of equal weight
   along the order of its faces, and each run gets one. */
static txm_status tmr_sample_faces(tmr_sampling *t, txm_arena *scratch) {
    const tmr_surface *s = t->w->s;
    const size_t n = (size_t)s->face_count;
    txm_rng rng = txm_rng_make(t->desc->seed, 66);
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(scratch, n, sizeof(txm_pair));
    txm_pair *room = (txm_pair *)txm_arena_alloc(scratch, n, sizeof(txm_pair));
    if (!pairs || !room) return TXM_OUT_OF_MEMORY;
    tmr_order_faces(s, pairs, room);
    int32_t component = -1, placed = 0, count = 0;
    double run = 0, next = 0, step = 0;
    for (size_t i = 0; i < n; i++) {
        const int32_t f = (int32_t)pairs[i].value;
        if (s->component[f] != component) {
            component = s->component[f];
            count = t->wanted[component] - t->fixed[component];
            placed = 0;
            run = 0;
            step = count > 0 ? t->weight[component] / count : 0;
            next = step * txm_rng_double(&rng);
        }
        run += t->piece[f];
        int32_t here = 0;
        const int last = i + 1 == n || s->component[pairs[i + 1].value] != component;
        while (placed < count && (next < run || last)) {
            here++;
            placed++;
            next = step * (placed + txm_rng_double(&rng));
        }
        for (int32_t k = 0; k < here; k++) {
            tmr_insert(t, f, tmr_sample_place(s, f, k, here, &rng), 0);
            if (tmr_tick(t->w, 1)) return TXM_CANCELLED;
        }
        if (tmr_tick(t->w, 1)) return TXM_CANCELLED;
    }
    return TXM_OK;
}

/* ---- joining: removing the vertices of the surface ------------------------------------------ */

/* the worst quality of b's triangles after b is merged into the other end of c's edge; -1: not
   allowed */
static double tmr_remove_quality(const tmr_work *w, int32_t c) {
    const tmr_mesh *m = &w->m;
    const int32_t o = m->opposite[c], first = tmr_prev(c), a = m->vertex[tmr_next(c)];
    double worst = 1;
    int32_t i = first;
    do {
        const int32_t x = m->vertex[tmr_next(i)], y = m->vertex[tmr_prev(i)];
        if (i / 3 != c / 3 && i / 3 != o / 3 && !tmr_is_ghost(m, x) && !tmr_is_ghost(m, y)) {
            const double q = tmr_quality(m->p[a], m->p[x], m->p[y], tmr_expected_normal(w, a, x, y));
            if (q < worst) worst = q;
        }
        i = tmr_swing(m, i);
    } while (i != first);
    return worst;
}

/* Flip edges of v where possible, the best result first: with fewer neighbours it is easier to
   remove. */
static void tmr_lower_valence(tmr_work *w, int32_t v) {
    tmr_mesh *m = &w->m;
    for (int guard = 0; guard < TMR_VALENCE && m->valence[v] > 3; guard++) {
        tmr_quad q;
        double best = 0.02;
        int32_t turn = -1, c = m->corner[v];
        const int32_t first = c;
        do { /* the edge from v to next(c) */
            if (tmr_measure_flip(w, tmr_prev(c), &q) && q.after > best) {
                best = q.after;
                turn = tmr_prev(c);
            }
            c = tmr_swing(m, c);
        } while (c != first);
        if (turn < 0) break;
        tmr_flip(m, turn);
    }
}

/* Merge vertex v into the neighbour for which the triangles stay best. Returns 0 if no neighbour
   will do. force: accept a triangle that is inverted if it was so before. */
static int tmr_remove_vertex(tmr_work *w, int32_t v, int force) {
    tmr_mesh *m = &w->m;
    double best = -2;
    int32_t into = -1, c = m->corner[v];
    const int32_t first = c;
    do { /* the edge from v to next(c) = a is opposite to k with v = next(k); its opposite o has
            v = prev(o), as the collapse wants it */
        const int32_t o = m->opposite[tmr_prev(c)];
        if (m->vertex[tmr_prev(o)] == v && tmr_can_collapse(m, o)) {
            const double q = tmr_remove_quality(w, o);
            const int fair = q > 0 || (force && tmr_collapse_is_fair(
                                                    w, o, m->p[m->vertex[tmr_next(o)]], 0));
            if (q > best && fair) {
                best = q;
                into = o;
            }
        }
        c = tmr_swing(m, c);
    } while (c != first);
    if (into < 0) return 0;
    tmr_collapse(m, into);
    return 1;
}

/* One pass over the vertices that are no points: removes those without a neighbour that was touched
   in this pass, so that the mesh becomes coarser evenly. Returns how many are left. */
static int32_t tmr_remove_pass(tmr_work *w, const uint8_t *keep, int effort, int32_t *taken) {
    tmr_mesh *m = &w->m;
    int32_t left = 0;
    memset(w->bad, 0, (size_t)m->vertex_count);
    *taken = 0;
    for (int32_t v = 0; v < m->vertex_count; v++) {
        if (keep[v] || m->corner[v] < 0 || tmr_is_ghost(m, v)) continue;
        left++;
        if (w->bad[v]) continue;
        int32_t c = m->corner[v];
        const int32_t first = c;
        do {
            w->bad[m->vertex[tmr_next(c)]] = 1;
            c = tmr_swing(m, c);
        } while (c != first);
        if (effort > 0) tmr_lower_valence(w, v);
        if (!tmr_remove_vertex(w, v, effort > 2)) continue;
        left--;
        ++*taken;
    }
    return left;
}

/* Remove all vertices that are no points where possible; those that must stay are points like the
   others from now on. fraction: for the progress. */
static txm_status tmr_remove_vertices(tmr_work *w, const uint8_t *keep, float fraction) {
    int idle = 0;
    for (int pass = 0; pass < TMR_REMOVE_PASSES; pass++) {
        int32_t taken;
        const int32_t left = tmr_remove_pass(w, keep, idle, &taken);
        if (left == 0) break;
        tmr_flip_delaunay(w, 2);
        idle = taken * 50 < left ? idle + 1 : 0;
        if (idle > 6) break;
        if (txm_progress(w->env, fraction, "join")) return TXM_CANCELLED;
    }
    tmr_flip_delaunay(w, 8);
    return TXM_OK;
}

/* ---- sampling and joining: the whole -------------------------------------------------------- */

/* Vertices to make room for so that a mesh of the surface takes so many points (ours: a quarter more,
   for the vertices of lines). */
static double tmr_sampling_room(double points) {
    return points + floor(points / 4) + 1000;
}

static txm_status tmr_sampling_alloc(tmr_sampling *t, txm_arena *scratch) {
    const tmr_surface *s = t->w->s;
    const tmr_mesh *m = &t->w->m;
    const size_t n = (size_t)s->component_count;
    t->inside = (int32_t *)txm_arena_alloc(scratch, (size_t)m->face_limit, sizeof(int32_t));
    t->keep = (uint8_t *)txm_arena_zero(scratch, (size_t)m->vertex_limit, 1);
    t->fixed = (int32_t *)txm_arena_zero(scratch, n, sizeof(int32_t));
    t->wanted = (int32_t *)txm_arena_zero(scratch, n, sizeof(int32_t));
    t->spare = (int32_t *)txm_arena_zero(scratch, n, sizeof(int32_t));
    t->weight = (double *)txm_arena_zero(scratch, n, sizeof(double));
    t->piece = (double *)txm_arena_alloc(scratch, (size_t)s->face_count, sizeof(double));
    t->line_room = 0;
    for (int32_t i = 0; i < t->w->l->line_count; i++) {
        const int32_t steps = tmr_line_steps(t, i);
        if (steps > t->line_room) t->line_room = steps;
    }
    t->ways = (double *)txm_arena_alloc(scratch, (size_t)t->line_room + 1, sizeof(double));
    const txm_status status = tmr_check_memory(scratch);
    if (status != TXM_OK) return status;
    for (int32_t f = 0; f < m->face_count; f++) t->inside[f] = f < s->face_count ? f : -1;
    for (int32_t f = 0; f < s->face_count; f++) t->piece[f] = tmr_face_weight(s, f);
    return TXM_OK;
}

/* Corners and the points on lines. TXM_TOO_SMALL: there is no room for so many. */
static txm_status tmr_sample_lines(tmr_sampling *t) {
    const tmr_surface *s = t->w->s;
    const tmr_lines *l = t->w->l;
    const tmr_mesh *m = &t->w->m;
    for (int32_t v = 0; v < s->vertex_count; v++) t->keep[v] = l->kind[v] == TRIMESH_CORNER;
    for (int32_t i = 0; i < l->line_count; i++) {
        const int32_t steps = tmr_line_steps(t, i), first = l->closed[i] ? 0 : 1;
        const double step = tmr_line_weight(s, l, i) / steps;
        for (int32_t k = first; k < steps; k++) t->ways[k - first] = k * step;
        const txm_status status = tmr_cut_line(t, i, t->ways, steps - first, NULL);
        if (status != TXM_OK) return status;
    }
    for (int32_t v = 0; v < m->vertex_count; v++)
        if (t->keep[v]) t->fixed[s->component[tmr_face_of(t->w, v)]]++;
    return TXM_OK;
}

/* Strew desc->vertices points over a mesh that is a copy of the surface, with room as
   tmr_sampling_room has it. */
static txm_status tmr_sample(tmr_sampling *t, tmr_work *w, const trimesh_desc *desc,
                             txm_arena *scratch) {
    const int32_t total = (int32_t)desc->vertices;
    memset(t, 0, sizeof *t);
    t->w = w;
    t->desc = desc;
    t->length = w->length =
        tmr_sampling_length(w->s, w->l, w->line_scale, total);
    txm_status status = tmr_sampling_alloc(t, scratch);
    if (status != TXM_OK) return status;
    tmr_least_points(t);
    if ((status = tmr_sample_lines(t)) != TXM_OK) return status;
    tmr_share_points(t, total);
    return tmr_sample_faces(t, scratch);
}

/* Make the mesh one of these points only, as many as are wanted. */
static txm_status tmr_join_points(tmr_sampling *t, txm_arena *scratch) {
    int32_t missing;
    const txm_status status = tmr_remove_vertices(t->w, t->keep, 0.15f);
    if (status != TXM_OK) return status;
    return tmr_fix_count(t->w, (int32_t)t->desc->vertices, 1, scratch, &missing);
}

/* ---- repulsion ------------------------------------------------------------------------------ */

/* The points within reach of v that are connected to it by edges between such points; v itself
   first. */
static int tmr_find_near(const tmr_work *w, int32_t v, int32_t nearby[TMR_NEAR]) {
    const tmr_mesh *m = &w->m;
    const double reach = TMR_REACH * w->length * w->size[v];
    int count = 1;
    nearby[0] = v;
    for (int i = 0; i < count; i++) {
        int32_t c = m->corner[nearby[i]];
        const int32_t first = c;
        do {
            const int32_t x = m->vertex[tmr_next(c)];
            int known = tmr_is_ghost(m, x) || txm_d3_dist2(m->p[x], m->p[v]) > reach * reach;
            for (int k = 0; k < count && !known; k++) known = nearby[k] == x;
            if (!known && count < TMR_NEAR) nearby[count++] = x;
            c = tmr_swing(m, c);
        } while (c != first);
    }
    return count;
}

/* Length of an arc over its chord, by the cosine of the angle between the normals of its ends:
   (angle / 2) / sin(angle / 2), as a polynomial that is right at 0, 90 and 180 degrees. */
static double tmr_arc(double cosine) {
    const double x = 1 - cosine;
    return 1 + x * (0.0833 + x * (-0.0463 + x * 0.0737));
}

/* Equation 3.1: pos += (r - |d|) f d / |d|, d the way from another point to this one, over all that
   are nearer than the radius of influence r. */
static void tmr_repel_vertex(tmr_work *w, int32_t v) {
    const tmr_mesh *m = &w->m;
    const int kind = tmr_kind_of(m, v);
    int32_t nearby[TMR_NEAR];
    txm_dvec3 push = txm_d3(0, 0, 0);
    tmr_keep_place(w, v);
    if (m->corner[v] < 0 || kind == TRIMESH_CORNER || tmr_is_ghost(m, v)) return;
    const int count = tmr_find_near(w, v, nearby);
    for (int i = 1; i < count; i++) {
        const int32_t x = nearby[i];
        if (kind != TRIMESH_FREE && tmr_kind_of(m, x) == TRIMESH_FREE) continue;
        txm_dvec3 d = txm_d3_sub(m->p[v], m->p[x]);
        const double r = TMR_REACH * w->length * 0.5 * (w->size[v] + (double)w->size[x]);
        const double chord = txm_d3_len(d), length = chord * tmr_arc(txm_d3_dot(m->n[v], m->n[x]));
        if (length >= r) continue;
        if (chord > 0) d = txm_d3_scale(d, 1 / chord);
        else
            d = txm_d3_scale(txm_d3_unit(txm_d3_cross(m->n[v], txm_d3(0.6, 0.64, 0.48))),
                             v < x ? 1 : -1);
        push = txm_d3_mad(push, d, w->step * (r - length));
    }
    /* no farther than to where other points push back */
    const double limit = 0.5 * w->length * w->size[v], way = txm_d3_len(push);
    if (way > limit) push = txm_d3_scale(push, limit / way);
    const txm_dvec3 to = txm_d3_add(m->p[v], push);
    if (kind != TRIMESH_FREE) {
        w->moved[v] = tmr_project_line(w->s, w->l, to, &w->landed[v]);
        return;
    }
    const tmr_place at = tmr_project(w->s, to, m->source[v]);
    w->moved[v] = at.p;
    w->landed[v] = at.face;
}

static void tmr_repel_chunk(void *context, int index) {
    tmr_work *w = (tmr_work *)context;
    const int32_t from = index * TMR_CHUNK;
    const int32_t to = from + TMR_CHUNK < w->m.vertex_count ? from + TMR_CHUNK : w->m.vertex_count;
    for (int32_t v = from; v < to; v++) tmr_repel_vertex(w, v);
}

/* Would a triangle be inverted that is not so now? tmr_settle does not see this for slivers, which
   it takes for spoilt already. */
static int tmr_would_invert(const tmr_work *w, int32_t face) {
    const int32_t *v = w->m.vertex + 3 * face;
    if (v[0] < 0 || tmr_is_ghost_face(&w->m, face)) return 0;
    const txm_dvec3 *p = w->moved, *q = w->m.p;
    const txm_dvec3 after = txm_d3_area2(p[v[0]], p[v[1]], p[v[2]]);
    const txm_dvec3 before = txm_d3_area2(q[v[0]], q[v[1]], q[v[2]]);
    if (txm_d3_dot(after, before) > 0) return 0;
    const txm_dvec3 n = tmr_expected_normal(w, v[0], v[1], v[2]);
    return txm_d3_dot(after, n) <= 0 && txm_d3_dot(before, n) >= 0;
}

static void tmr_hold_inverting(tmr_work *w) {
    tmr_mesh *m = &w->m;
    for (int round = 0; round < 8; round++) {
        int32_t found = 0;
        for (int32_t f = 0; f < m->face_count; f++) {
            if (!tmr_would_invert(w, f)) continue;
            found++;
            for (int k = 0; k < 3; k++) {
                const int32_t v = m->vertex[3 * f + k];
                tmr_keep_place(w, v);
            }
        }
        if (found == 0) break;
    }
}

/* f in round 0..rounds - 1 */
static double tmr_repel_force(int round, int rounds) {
    const double left = 1 - round / (rounds > 1 ? rounds - 1.0 : 1.0);
    return TMR_LAST_FORCE + (TMR_FORCE - TMR_LAST_FORCE) * left * left;
}

/* One round: move all points at once (so that the result does not depend on threads), then flip
   edges. mean and largest movement, in wanted edge lengths. */
static void tmr_repel_round(tmr_work *w, double force, double *mean, double *largest) {
    const tmr_mesh *m = &w->m;
    const int chunks = (m->vertex_count + TMR_CHUNK - 1) / TMR_CHUNK;
    double sum = 0, most = 0;
    w->step = force;
    txm_parallel_for(w->env, chunks, tmr_repel_chunk, w);
    for (int32_t v = 0; v < m->vertex_count; v++) {
        if (m->corner[v] < 0 || tmr_is_ghost(m, v)) continue;
        const double d = txm_d3_dist(w->moved[v], m->p[v]) / (w->length * w->size[v]);
        sum += d;
        if (d > most) most = d;
    }
    *mean = m->live ? sum / m->live : 0;
    *largest = most;
    tmr_hold_inverting(w);
    tmr_settle(w);
    tmr_flip_delaunay(w, 2);
}

#define TMR_CALM 0.002 /* ours: mean movement, in edge lengths, at which it stops              */

/* ---- retiling ----------------------------------------------------------------------------- */

#define TMR_CREASE_ANGLE 50 /* ours: degrees, see docs/choices.md#creases */

/* All numbers here are ours, see docs/choices.md#tuning. Lengths are in wanted edge lengths. */
enum {
    TMR_CUT_FROM = 20000,   /* from so many vertices on a quarter of them, then cut in four       */
    TMR_SPACING_ROUNDS = 3, /* of relaxation before the lattice spacing is set                   */
    TMR_CLEAN_ROUNDS = 4,   /* of splits and collapses after the lattice                          */
    TMR_FOLD_ROUNDS = 8     /* of opening folds, at most                                          */
};
#define TMR_LATTICE_SPACING 0.982 /* lattice spacing over edge length: see tmr_set_spacing       */
#define TMR_LONG 1.5              /* cleaning splits edges longer than this,                     */
#define TMR_LONG_ON_LINES 1.6     /* on creases and borders                                      */
#define TMR_SHORT 0.55            /* and collapses those shorter than this,                      */
#define TMR_SHORT_ON_LINES 0.5    /* on creases and borders,                                     */
#define TMR_LONGEST 1.5           /* if no edge around gets longer than this                     */
#define TMR_FAIR_FLIP 0.4         /* flips for the valences leave triangles of this quality,     */
#define TMR_FAIR_FLIP_CLEAN 0.3   /* while cleaning of this, or better ones than before          */
#define TMR_FOLD_STEP 0.06        /* how far the edge of a fold moves in a round                 */

/* How much tmr_improve does. */
typedef struct tmr_effort {
    int rounds, relaxations; /* in each round */
    double pull, step;       /* as in tmr_work */
} tmr_effort;
static const tmr_effort tmr_after_lattice = {2, 3, 1.5, 0.8};
static const tmr_effort tmr_after_repulsion = {10, 2, 0.8, 1}; /* which is less regular          */
static const tmr_effort tmr_after_cut = {2, 2, 1, 1};
static const tmr_effort tmr_polish_density = {1, 2, 1.5, 0.8};
static const tmr_effort tmr_polish_angles = {3, 2, 0.5, 1};
static const tmr_effort tmr_polish_sizes = {3, 2, 1.2, 1}; /* where the caller wants different ones */

/* Rounds of relaxation and flips. A strong pull evens out the density, a weak one the angles. */
static txm_status tmr_improve(tmr_work *w, const tmr_effort *effort) {
    w->pull = effort->pull;
    w->step = effort->step;
    for (int round = 0; round < effort->rounds; round++) {
        /* the fraction stays at the highest so far: tmr_rise */
        if (txm_progress(w->env, 0, "relax")) return TXM_CANCELLED;
        w->length = tmr_ideal_length(w);
        for (int k = 0; k < effort->relaxations; k++) {
            tmr_relax(w);
            if (tmr_tick(w, w->m.live)) return TXM_CANCELLED;
        }
        tmr_flip_delaunay(w, 3);
        if (tmr_tick(w, w->m.live)) return TXM_CANCELLED;
        tmr_flip_valences(w, 3, TMR_FAIR_FLIP);
    }
    return TXM_OK;
}

/* Even out the resampled copy a little, and set the lattice spacing for so many vertices: that of
   as many equilateral triangles on the area there is, times TMR_LATTICE_SPACING. So the lattice has
   a few vertices too many: removing vertices improves the pattern, adding some disturbs it. */
static txm_status tmr_set_spacing(tmr_work *w, int32_t target) {
    const double faces = w->m.live_faces;
    w->pull = 0.5;
    w->step = 1;
    w->length = tmr_ideal_length(w);
    for (int k = 0; k < TMR_SPACING_ROUNDS; k++) {
        tmr_relax(w);
        tmr_flip_delaunay(w, 2);
        if (tmr_tick(w, w->m.live)) return TXM_CANCELLED;
    }
    w->length = TMR_LATTICE_SPACING * tmr_ideal_length(w) *
                sqrt(faces / (faces + 2.0 * (target - w->m.live)));
    return TXM_OK;
}

/* Directions, lattice points, and the mesh collapsed onto them. */
static txm_status tmr_solve_lattice(tmr_work *w, uint64_t seed, txm_arena *arena) {
    tmr_fields f;
    txm_status status = tmr_tick(w, w->m.live) ? TXM_CANCELLED : tmr_fields_build(w, &f, arena);
    if (status == TXM_OK) status = tmr_solve_directions(w, &f, seed);
    if (status == TXM_OK) status = tmr_solve_points(w, &f);
    return status == TXM_OK ? tmr_collapse_lattice(w, &f, arena) : status;
}

/* Turn w->m, a copy of the surface, into a lattice of target vertices. */
static txm_status tmr_make_lattice(tmr_work *w, int32_t target, uint64_t seed) {
    txm_arena arena;
    int32_t missing = 0;
    txm_status status = tmr_resample(w);
    if (status == TXM_OK) status = tmr_renumber(w);
    if (status != TXM_OK) return status;
    txm_arena_init(&arena, w->env);
    status = tmr_thin_lines(w, &arena);
    if (status == TXM_OK) {
        tmr_even_lines(w);
        status = tmr_set_spacing(w, target);
        if (status == TXM_OK) status = tmr_solve_lattice(w, seed, &arena);
        if (status == TXM_OK) status = tmr_renumber(w);
    }
    for (int round = 0; round < TMR_CLEAN_ROUNDS && status == TXM_OK; round++) {
        tmr_flip_delaunay(w, 4);
        tmr_flip_valences(w, 4, TMR_FAIR_FLIP_CLEAN);
        for (int k = 0; k < 3 && status == TXM_OK; k++) {
            tmr_relax(w);
            if (tmr_tick(w, w->m.live)) status = TXM_CANCELLED;
        }
        if (status != TXM_OK) break;
        tmr_split_long(w, TMR_LONG, TMR_LONG_ON_LINES);
        tmr_collapse_short(w, TMR_SHORT, TMR_SHORT_ON_LINES, TMR_LONGEST, 1);
    }
    if (status == TXM_OK) status = tmr_fix_count(w, target, 2, &arena, &missing);
    if (status == TXM_OK) status = tmr_improve(w, &tmr_after_lattice);
    if (status == TXM_OK) status = tmr_mend_defects(w, target, &arena);
    txm_arena_free(&arena);
    return status;
}

/* The worst triangles. Then there may be too few vertices or too many. */
static txm_status tmr_mend_worst(tmr_work *w, int32_t target, txm_arena *scratch) {
    int32_t missing;
    txm_status status = tmr_mend_slivers(w, 1, scratch);
    if (status != TXM_OK) return status;
    if ((status = tmr_improve_spots(w, 1)) != TXM_OK) return status;
    status = tmr_mend_slivers(w, 1, scratch);
    if (status != TXM_OK || w->m.live == target) return status;
    status = tmr_count_beside_defects(w, target, scratch);
    if (status == TXM_OK) status = tmr_fix_count(w, target, 2, scratch, &missing);
    return status == TXM_OK ? tmr_mend_slivers(w, 0, scratch) : status;
}

/* The last part of every method: the exact number, and more regularity. */
static txm_status tmr_polish(tmr_work *w, int32_t target, txm_arena *scratch) {
    int32_t missing;
    txm_status status = tmr_fix_count(w, target, 2, scratch, &missing);
    if (status == TXM_OK) status = tmr_improve(w, &tmr_polish_density);
    if (status == TXM_OK) status = tmr_improve(w, w->s->scale ? &tmr_polish_sizes : &tmr_polish_angles);
    if (status != TXM_OK) return status;
    if ((status = tmr_improve_spots(w, 3)) != TXM_OK) return status;
    if ((status = tmr_mend_worst(w, target, scratch)) != TXM_OK) return status;
    if (w->m.live != target)
        return txm_fail_numbers(w->env, TXM_TOO_SMALL, "reached # vertices instead of #",
                                (uint64_t)w->m.live, (uint64_t)target);
    if ((status = tmr_fit_surface(w, 2, scratch)) != TXM_OK) return status;
    for (int round = 0; round < TMR_FOLD_ROUNDS; round++) {
        if (tmr_tick(w, w->m.live)) return TXM_CANCELLED;
        if (tmr_open_folds(w, TMR_FOLD_STEP) == 0) break;
    }
    tmr_return_volume(w);
    return TXM_OK;
}

/* ---- public ------------------------------------------------------------------------------- */

/* where vertex v lies in the caller's triangles */
static txm_mesh_place tmr_source_of(const tmr_work *w, int32_t v) {
    const tmr_surface *s = w->s;
    tmr_place at = tmr_on_face(s, tmr_face_of(w, v), w->m.p[v]);
    if (tmr_kind_of(&w->m, v) == TRIMESH_CREASE && tmr_is_smooth_segment(w->l, w->m.source[v])) {
        int32_t k = w->m.source[v]; /* fitting has taken it off the line */
        const txm_dvec3 p = tmr_project_line(s, w->l, w->m.p[v], &k);
        at = tmr_on_face(s, w->l->face[k], p);
    }
    return tmr_surface_source(s, w->desc, &at);
}

/* The normal at vertex v: where those around cancel out, as on a sheet folded onto itself, that of the
   face in which it lies. */
static txm_dvec3 tmr_normal_of(const tmr_work *w, int32_t v) {
    const txm_dvec3 n = w->m.n[v];
    return n.x != 0 || n.y != 0 || n.z != 0 ? n : w->s->normal[tmr_face_of(w, v)];
}

/* Make the result, in the caller's units. */
static txm_status tmr_write(const tmr_work *w, trimesh_mesh **out) {
    const tmr_mesh *m = &w->m;
    txm_arena arena, scratch;
    txm_arena_init(&arena, w->env);
    txm_arena_init(&scratch, w->env);
    trimesh_mesh *mesh = (trimesh_mesh *)txm_arena_zero(&arena, 1, sizeof *mesh);
    int32_t *number = (int32_t *)txm_arena_alloc(&scratch, (size_t)m->vertex_count, sizeof(int32_t));
    size_t faces = 0;
    for (int32_t f = 0; f < m->face_count; f++)
        faces += !tmr_is_dead(m, f) && !tmr_is_ghost_face(m, f);
    if (mesh) {
        const size_t n = (size_t)m->live;
        mesh->positions = (float *)txm_arena_alloc(&arena, n, 3 * sizeof(float));
        mesh->normals = (float *)txm_arena_alloc(&arena, n, 3 * sizeof(float));
        mesh->sources = (txm_mesh_place *)txm_arena_alloc(&arena, n, sizeof(txm_mesh_place));
        mesh->kinds = (uint8_t *)txm_arena_alloc(&arena, n, 1);
        mesh->indices = (uint32_t *)txm_arena_alloc(&arena, faces, 3 * sizeof(uint32_t));
    }
    if (!mesh || arena.failed || scratch.failed) {
        txm_arena_free(&arena);
        txm_arena_free(&scratch);
        return TXM_OUT_OF_MEMORY;
    }
    const tmr_surface *s = w->s;
    for (int32_t v = 0; v < m->vertex_count; v++) {
        if (m->corner[v] < 0 || tmr_is_ghost(m, v)) continue;
        TRIMESH_ASSERT(mesh->vertex_count < (size_t)m->live);
        const size_t k = mesh->vertex_count++;
        const txm_dvec3 p = txm_d3_add(txm_d3_scale(m->p[v], s->diagonal), s->centre);
        const txm_dvec3 normal = tmr_normal_of(w, v);
        number[v] = (int32_t)k;
        mesh->positions[3 * k] = txm_float(p.x);
        mesh->positions[3 * k + 1] = txm_float(p.y);
        mesh->positions[3 * k + 2] = txm_float(p.z);
        mesh->normals[3 * k] = txm_float(normal.x);
        mesh->normals[3 * k + 1] = txm_float(normal.y);
        mesh->normals[3 * k + 2] = txm_float(normal.z);
        mesh->kinds[k] = (uint8_t)tmr_kind_of(m, v);
        mesh->sources[k] = tmr_source_of(w, v);
    }
    for (int32_t f = 0; f < m->face_count; f++) {
        if (tmr_is_dead(m, f) || tmr_is_ghost_face(m, f)) continue;
        for (int k = 0; k < 3; k++)
            mesh->indices[3 * mesh->triangle_count + (size_t)k] =
                (uint32_t)number[m->vertex[3 * f + k]];
        mesh->triangle_count++;
    }
    mesh->edge_length = w->length * s->diagonal;
    if (s->loop_count == 0 && s->volume > 0)
        mesh->volume_change = tmr_mesh_volume(m, m->p) / s->volume - 1;
    mesh->memory = arena;
    txm_arena_free(&scratch);
    *out = mesh;
    return TXM_OK;
}

TRIMESH_API txm_mesh trimesh_as_view(const trimesh_mesh *mesh) {
    txm_mesh view;
    view.corners = 3;
    view.positions = mesh->positions;
    view.indices = mesh->indices;
    view.vertex_count = mesh->vertex_count;
    view.face_count = mesh->triangle_count;
    return view;
}

TRIMESH_API void trimesh_mesh_free(trimesh_mesh *mesh) {
    if (!mesh) return;
    txm_arena arena = mesh->memory; /* the mesh lies in it */
    txm_arena_free(&arena);
}

/* ---- shorter edges where triangles cross ---------------------------------------------------- */

/* Where two sheets lie closer to each other than triangles stand off a bent surface, these cross. Another
   attempt wants shorter edges there, and only there: a chord of half the length stands off a quarter as
   far. */
enum { TMR_FINER_REACH = 2 }; /* ours: so many rings around the spots */

/* Mark the vertices of triangles that cross or are inverted, and their surroundings, in w->bad. */
static txm_status tmr_mark_spots(tmr_work *w) {
    long crossings, doubtful;
    txm_arena scratch;
    memset(w->bad, 0, (size_t)w->m.vertex_count);
    txm_arena_init(&scratch, w->env);
    const txm_status status = tmr_count_crossings(w, NULL, TMR_COUNT_CROSSING, &scratch, &crossings);
    txm_arena_free(&scratch);
    if (status != TXM_OK) return status;
    tmr_count_inverted(w, &doubtful);
    for (int ring = 0; ring < TMR_FINER_REACH; ring++) tmr_grow_marks(w);
    return TXM_OK;
}

/* Halve the wanted edge lengths where the mesh is not sound. */
static txm_status tmr_halve_at_spots(tmr_work *w, tmr_surface *s, txm_arena *arena) {
    const size_t n = (size_t)s->vertex_count;
    float *scale = (float *)txm_arena_alloc(arena, n, sizeof(float));
    if (!scale) return TXM_OUT_OF_MEMORY;
    const txm_status status = tmr_mark_spots(w);
    if (status != TXM_OK) return status;
    for (size_t v = 0; v < n; v++) scale[v] = s->scale ? s->scale[v] : 1;
    for (int32_t v = 0; v < w->m.vertex_count; v++) {
        if (!w->bad[v] || w->m.corner[v] < 0 || tmr_is_ghost(&w->m, v)) continue;
        const int32_t *k = s->vertex + 3 * tmr_face_of(w, v);
        for (int i = 0; i < 3; i++) scale[k[i]] = txm_float(0.5 * (s->scale ? s->scale[k[i]] : 1));
    }
    tmr_grade_scale(s, w->length, scale);
    s->scale = scale;
    return TXM_OK;
}

/* ---- retiling step by step ----------------------------------------------------------------- */

#define TMR_FLAT_VOLUME 1e-6 /* ours: thickness of what has no inside, in diagonals               */

enum tmr_stage {
    TMR_STAGE_MEND,
    TMR_STAGE_SAMPLE,
    TMR_STAGE_JOIN,
    TMR_STAGE_REPEL,
    TMR_STAGE_LATTICE,
    TMR_STAGE_SUBDIVIDE,
    TMR_STAGE_FINISH,
    TMR_STAGE_DONE
};

struct trimesh_job {
    trimesh_desc desc;
    txm_env env;           /* hooks of the current call; progress goes through rising          */
    tmr_rising rising;
    trimesh_report report;
    txm_status status;     /* of the first failure                                             */
    int stage;             /* next to be done                                                  */
    int shown;             /* the last one done                                                */
    int round, rounds;     /* of repulsion: done; at most                                      */
    double mean, largest;  /* movement in the last one                                         */
    int plain;             /* strips are left as they are: ridges.h                              */
    int retries;           /* with shorter edges so far                                         */
    uint64_t wanted;       /* after TXM_TOO_SMALL: how many vertices may do                     */
    uint8_t crosses[2];    /* the surface crosses, or touches itself: 0 = not known, 1 = no, 2 = yes */
    int is_trial;          /* to find out whether so many vertices do: one attempt, no hint      */
    int cut; /* how often the number is quartered, then triangles cut in four          */
    tmr_surface s;
    tmr_lines l;
    tmr_work w;
    tmr_sampling t;
    txm_arena input;       /* surface and lines                                                */
    txm_arena first;       /* the mesh, including the surface's vertices                       */
    txm_arena second;      /* the mesh, compact                                                */
    txm_arena scratch;     /* of the current stage                                             */
    txm_arena view;        /* what the state points to                                         */
};

/* Check a descriptor except its surface. */
static txm_status tmr_check_desc(const trimesh_desc *desc, txm_env *env) {
    if (!desc) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL; pass a trimesh_desc");
    if (desc->vertices < 4)
        return txm_fail(env, TXM_TOO_SMALL, "vertices must be 4 or more");
    if (desc->vertices > TRIMESH_MAX_VERTICES || desc->vertices > TMR_MOST)
        return txm_fail(env, TXM_TOO_LARGE, "vertices: more than TRIMESH_MAX_VERTICES");
    if (desc->method != TRIMESH_LATTICE && desc->method != TRIMESH_REPEL)
        return txm_fail(env, TXM_BAD_ARGUMENT, "method must be TRIMESH_LATTICE or TRIMESH_REPEL");
    if (!(desc->adapt >= 0 && desc->adapt <= 1))
        return txm_fail(env, TXM_BAD_ARGUMENT, "adapt must be 0 to 1");
    if (!(desc->crease_angle >= 0 && desc->crease_angle <= 180))
        return txm_fail(env, TXM_BAD_ARGUMENT, "crease_angle must be 0 to 180 degrees");
    if (!(desc->line_spacing >= 0.25f && desc->line_spacing <= 4) &&
        !(desc->line_spacing >= 0 && desc->line_spacing <= 0))
        return txm_fail(env, TXM_BAD_ARGUMENT, "line_spacing must be 0.25 to 4, or 0");
    if (!(desc->drop_below >= 0 && desc->drop_below <= 1))
        return txm_fail(env, TXM_BAD_ARGUMENT, "drop_below must be 0 to 1");
    if (desc->iterations < 0 || desc->iterations > 1000)
        return txm_fail(env, TXM_BAD_ARGUMENT, "iterations must be 0 to 1000");
    return TXM_OK;
}

/* spacing of the result where the scale is 1, in scaled units */
static double tmr_job_spacing(const trimesh_job *job) {
    return tmr_spacing(&job->s, (double)job->desc.vertices);
}

/* ---- the stages: each sets the next one ----------------------------------------------------- */

/* Find the lines, and see whether the vertices are enough for them. */
static txm_status tmr_job_lines(trimesh_job *job, float angle) {
    const size_t vertices = job->desc.vertices;
    double least = 0;
    const txm_status status =
        tmr_settle_lines(&job->s, &job->desc, (double)vertices, angle, tmr_job_spacing(job),
                         &job->input, &job->scratch, &job->report, &job->l, &least);
    if (status != TXM_OK || (double)vertices >= least) return status;
    job->wanted = (uint64_t)least;
    return txm_fail_numbers(&job->env, TXM_TOO_SMALL,
                            "# vertices are too few for the pieces of the surface, their creases and "
                            "borders", vertices, 0);
}

/* Mend the surface, find its lines. */
static txm_status tmr_job_mend(trimesh_job *job) {
    const float angle = job->desc.crease_angle > 0 ? job->desc.crease_angle : TMR_CREASE_ANGLE;
    txm_status status =
        tmr_surface_build(&job->desc, &job->env, &job->input, &job->report, &job->s);
    if (status != TXM_OK) return status;
    tmr_normalize_scale(&job->s);
    if (job->desc.adapt > 0)
        status = tmr_adapt_scale(&job->s, tmr_job_spacing(job), job->desc.adapt, &job->input,
                                 &job->scratch);
    if (status == TXM_OK && !job->plain)
        status = tmr_make_ridges(&job->s, angle, tmr_job_spacing(job), &job->env, &job->input,
                                 &job->scratch);
    if (status == TXM_OK) status = tmr_job_lines(job, angle);
    if (status == TXM_OK) status = tmr_find_fans(&job->s, &job->input, &job->scratch);
    if (status != TXM_OK) return status;
    job->w.s = &job->s;
    job->w.l = &job->l;
    job->w.desc = &job->desc;
    job->w.env = &job->env;
    job->w.line_scale = job->desc.line_spacing > 0 ? job->desc.line_spacing : 1;
    double lines = 0; /* with more than half of the vertices on lines space these more widely */
    for (int32_t i = 0; i < job->l.line_count; i++) lines += job->l.length[i];
    job->w.line_scale = fmax(job->w.line_scale, lines / tmr_job_spacing(job) /
                                                    (0.5 * (double)job->desc.vertices));
    job->w.pull = 1;
    job->w.step = 1;
    /* closed: V - E + F with a ghost for each loop */
    const double euler = (double)job->report.euler + (double)job->report.loops;
    if (job->desc.vertices >= TMR_CUT_FROM && (double)job->desc.vertices + 3 * euler > 1000)
        job->cut = job->desc.vertices >= 4 * TMR_CUT_FROM ? 2 : 1;
    job->stage = job->desc.method == TRIMESH_REPEL ? TMR_STAGE_SAMPLE : TMR_STAGE_LATTICE;
    return TXM_OK;
}

static txm_status tmr_job_sample(trimesh_job *job) {
    const double room = tmr_sampling_room((double)job->desc.vertices);
    const txm_status status = tmr_copy_surface(&job->w, room, &job->first);
    if (status != TXM_OK) return status;
    job->stage = TMR_STAGE_JOIN;
    const txm_status sampled = tmr_sample(&job->t, &job->w, &job->desc, &job->scratch);
    if (sampled != TXM_TOO_SMALL) return sampled;
    txm_arena_free(&job->first); /* no room for lines: the lattice adapts them */
    memset(&job->w.m, 0, sizeof job->w.m);
    job->stage = TMR_STAGE_LATTICE;
    return TXM_OK;
}

/* Join the points; then copy the mesh without the slots of the surface's own vertices. */
static txm_status tmr_job_join(trimesh_job *job) {
    txm_status status = tmr_join_points(&job->t, &job->scratch);
    if (status != TXM_OK) return status;
    if ((status = tmr_rebuild(&job->w, 0, &job->second, &job->scratch)) != TXM_OK) return status;
    txm_arena_free(&job->first);
    job->rounds = job->desc.iterations > 0 ? job->desc.iterations : TMR_ROUNDS;
    job->stage = TMR_STAGE_REPEL;
    return TXM_OK;
}

static txm_status tmr_job_repel(trimesh_job *job) {
    tmr_repel_round(&job->w, tmr_repel_force(job->round, job->rounds), &job->mean, &job->largest);
    job->round++;
    if (job->round < job->rounds && job->mean >= TMR_CALM) return TXM_OK;
    job->stage = TMR_STAGE_FINISH;
    return tmr_improve(&job->w, &tmr_after_repulsion);
}

static txm_status tmr_job_lattice(trimesh_job *job) {
    const double euler = (double)job->report.euler + (double)job->report.loops;
    const double target = (double)job->desc.vertices;
    int32_t aim = (int32_t)target;
    for (int k = 0; k < job->cut; k++) aim = (int32_t)floor((aim + 3 * euler) / 4);
    /* room for three vertices per one aimed at, or as many as the surface has, and a quarter more */
    const double closed = (double)job->s.vertex_count + job->s.loop_count;
    const double most = fmax(closed, 3.0 * aim);
    job->w.length = tmr_job_spacing(job) * sqrt(target / aim);
    txm_status status = tmr_copy_surface(&job->w, most + floor(most / 4) + 1000 - closed, &job->first);
    if (status != TXM_OK) return status;
    status = tmr_make_lattice(&job->w, aim, job->desc.seed);
    if (status != TXM_OK) return status;
    job->stage = TMR_STAGE_SUBDIVIDE;
    if (!job->cut || tmr_may_subdivide(&job->w)) return TXM_OK;
    job->cut--; /* too coarse: try again with four times the number */
    job->stage = TMR_STAGE_LATTICE;
    txm_arena_free(&job->first);
    memset(&job->w.m, 0, sizeof job->w.m);
    return TXM_OK;
}

static txm_status tmr_job_subdivide(trimesh_job *job) {
    tmr_work *w = &job->w;
    for (int left = job->cut;; left--) {
        txm_status status = tmr_rebuild(w, left > 0, &job->second, &job->scratch);
        if (status != TXM_OK) return status;
        txm_arena_free(&job->first);
        txm_arena_free(&job->scratch);
        job->first = job->second;
        txm_arena_init(&job->second, &job->env);
        if (left) status = tmr_improve(w, &tmr_after_cut);
        if (status != TXM_OK) return status;
        if (left <= 1) break;
    }
    job->stage = TMR_STAGE_FINISH;
    return TXM_OK;
}

/* Does the surface cross itself? Then the result may, too. what: as tmr_count_crossings has it. */
static txm_status tmr_surface_crosses(trimesh_job *job, int what, int *crosses) {
    uint8_t *known = &job->crosses[what == TMR_ANY_TOUCHING];
    tmr_work w = job->w;
    txm_arena arena;
    long found = 0;
    *crosses = *known == 2;
    if (*known) return TXM_OK;
    txm_arena_init(&arena, &job->env);
    txm_status status = tmr_copy_surface(&w, 0, &arena);
    if (status == TXM_OK) status = tmr_count_crossings(&w, NULL, what, &arena, &found);
    txm_arena_free(&arena);
    if (status != TXM_OK) return status;
    *crosses = found > 0;
    *known = (uint8_t)(1 + *crosses);
    return TXM_OK;
}

/* Is the surface closed, but without an inside? Then it lies on itself however dense the mesh is. */
static int tmr_is_flat(const tmr_surface *s) {
    return s->loop_count == 0 && fabs(s->volume) <= TMR_FLAT_VOLUME * s->area;
}

/* Want shorter edges: first where the mesh, which has the number of vertices if it is exact, is not sound;
   then wherever the surface bends, too. */
static txm_status tmr_job_shorten(trimesh_job *job, int exact) {
    txm_status status = TXM_OK;
    if (exact) status = tmr_halve_at_spots(&job->w, &job->s, &job->input);
    if (status == TXM_OK && (job->retries || !exact))
        status = tmr_adapt_scale(&job->s, tmr_job_spacing(job), 1, &job->input, &job->scratch);
    job->retries++;
    return status;
}

/* Prepare another attempt: with denser lines, then with the full number if it was a quarter, then
   with shorter edges. *again receives 0 if nothing is left to try. */
static txm_status tmr_job_retry(trimesh_job *job, int exact, int *again) {
    const int quartered = job->desc.method == TRIMESH_LATTICE && job->cut;
    txm_status status = TXM_OK;
    *again = !job->is_trial && (job->w.line_scale > 1 || quartered || job->retries < 2);
    if (!*again) return TXM_OK;
    if (job->w.line_scale > 1) job->w.line_scale = 1; /* lines were too coarse for the inside */
    else if (quartered) job->cut--;
    else status = tmr_job_shorten(job, exact);
    txm_arena_free(&job->first);
    txm_arena_free(&job->second);
    memset(&job->w.m, 0, sizeof job->w.m);
    job->stage = TMR_STAGE_LATTICE;
    return status;
}

/* Prepare another attempt from the beginning, without lines instead of strips. */
static txm_status tmr_job_without_ridges(trimesh_job *job) {
    txm_arena_free(&job->first);
    txm_arena_free(&job->second);
    txm_arena_free(&job->input);
    memset(&job->s, 0, sizeof job->s);
    memset(&job->l, 0, sizeof job->l);
    memset(&job->w, 0, sizeof job->w);
    job->plain = 1;
    job->cut = job->retries = 0;
    job->crosses[0] = job->crosses[1] = 0;
    job->stage = TMR_STAGE_MEND;
    return TXM_OK;
}

/* Finish, and check that no triangle is inverted or crosses another one: a result that is not sound
   is never returned. */
static txm_status tmr_job_finish(trimesh_job *job) {
    int again, crosses = 0;
    txm_status status = tmr_polish(&job->w, (int32_t)job->desc.vertices, &job->scratch);
    if (status != TXM_OK && status != TXM_TOO_SMALL) return status;
    const int exact = status == TXM_OK;
    if (exact) {
        long faults;
        job->stage = TMR_STAGE_DONE;
        status = tmr_mend_spots(&job->w, &faults);
        if (status != TXM_OK || faults == 0) return status;
        status = tmr_surface_crosses(job, TMR_ANY_CROSSING, &crosses);
        if (status != TXM_OK || crosses) return status;
        if (50 * faults > (long)job->w.m.live_faces || tmr_is_flat(&job->s)) { /* sheets lie on each other */
            status = tmr_surface_crosses(job, TMR_ANY_TOUCHING, &crosses);
            if (status != TXM_OK || crosses) return status;
        }
    }
    status = tmr_job_retry(job, exact, &again);
    if (status != TXM_OK || again) return status;
    if (exact) { /* as the last resort: sheets that touch may be meant to cross */
        status = tmr_surface_crosses(job, TMR_ANY_TOUCHING, &crosses);
        if (status != TXM_OK || crosses) return status;
    }
    if (job->s.section) return tmr_job_without_ridges(job);
    job->wanted = 2 * (uint64_t)job->desc.vertices;
    return txm_fail_numbers(&job->env, TXM_TOO_SMALL,
                            "the surface has parts too thin or too fine for # vertices without "
                            "crossings", job->desc.vertices, 0);
}

static const char *tmr_stage_name(int stage) {
    static const char *const names[] = {"mend",    "sample",    "join",   "repel",
                                        "lattice", "subdivide", "finish", "finish"};
    return names[stage];
}

/* how much of the work is done, roughly */
static float tmr_job_fraction(const trimesh_job *job) {
    static const float from[] = {0, 0.05f, 0.15f, 0.3f, 0.05f, 0.5f, 0.7f, 1};
    const float part = job->stage == TMR_STAGE_REPEL ? (float)job->round / (float)job->rounds : 0;
    return txm_maxf(job->rising.fraction, from[job->stage] + 0.4f * part);
}

static txm_status tmr_begin(const trimesh_desc *desc, txm_env *env, int is_trial,
                            trimesh_job **job);

/* Would so many vertices be enough? */
static txm_status tmr_job_try(const trimesh_job *job, size_t vertices) {
    trimesh_desc desc = job->desc;
    txm_env env = job->env; /* whose message stays */
    trimesh_job *trial = NULL;
    int more = 1;
    desc.vertices = vertices;
    desc.report = NULL;
    txm_status status = tmr_begin(&desc, &env, 1, &trial);
    while (status == TXM_OK && more) status = trimesh_step(trial, &env, &more);
    trimesh_free(trial);
    return status;
}

/* After TXM_TOO_SMALL: say how many vertices are enough, which was tried before it is said. */
static txm_status tmr_job_hint(trimesh_job *job) {
    static const double part[] = {1, 1.5, 2, 4}; /* ours: of job->wanted */
    char text[sizeof job->env.message];
    size_t tried = 0;
    memcpy(text, job->env.message, sizeof text);
    for (int k = 0; k < 4; k++) {
        const double vertices = ceil(part[k] * (double)job->wanted);
        if (vertices > TRIMESH_MAX_VERTICES || vertices > (double)TMR_MOST) break;
        tried = (size_t)vertices;
        const txm_status status = tmr_job_try(job, tried);
        if (status == TXM_OUT_OF_MEMORY || status == TXM_CANCELLED) return status;
        if (status == TXM_OK) {
            snprintf(job->env.message, sizeof text, "%.110s; give %lu", text, (unsigned long)tried);
            return TXM_TOO_SMALL;
        }
    }
    snprintf(job->env.message, sizeof text, "%.100s; %lu are too few, too", text,
             (unsigned long)tried);
    return TXM_TOO_SMALL;
}

/* One stage or round. A job that has failed stays failed. */
static txm_status tmr_job_advance(trimesh_job *job) {
    txm_status status = TXM_OK;
    if (job->status != TXM_OK) return txm_fail(&job->env, job->status, "the job has failed before");
    const int stage = job->stage;
    if (stage == TMR_STAGE_DONE) return TXM_OK;
    if (txm_progress(&job->env, tmr_job_fraction(job), tmr_stage_name(stage)))
        status = TXM_CANCELLED;
    else if (stage == TMR_STAGE_MEND) status = tmr_job_mend(job);
    else if (stage == TMR_STAGE_SAMPLE) status = tmr_job_sample(job);
    else if (stage == TMR_STAGE_JOIN) status = tmr_job_join(job);
    else if (stage == TMR_STAGE_REPEL) status = tmr_job_repel(job);
    else if (stage == TMR_STAGE_LATTICE) status = tmr_job_lattice(job);
    else if (stage == TMR_STAGE_SUBDIVIDE) status = tmr_job_subdivide(job);
    else status = tmr_job_finish(job);
    if (status == TXM_TOO_SMALL && !job->is_trial && job->wanted) status = tmr_job_hint(job);
    if (job->stage != TMR_STAGE_JOIN) txm_arena_free(&job->scratch); /* its marks lie there */
    job->shown = stage;
    job->status = status;
    if (status == TXM_OUT_OF_MEMORY)
        txm_fail(&job->env, status, "no memory to retile the surface");
    if (status == TXM_CANCELLED) txm_fail(&job->env, status, "cancelled while retiling");
    return status;
}

/* ---- what a viewer sees --------------------------------------------------------------------- */

/* is vertex v of the mesh one of the points? Before they are joined only the samples are. */
static int tmr_is_point(const trimesh_job *job, int32_t v) {
    const tmr_mesh *m = &job->w.m;
    if (m->corner[v] < 0 || tmr_is_ghost(m, v)) return 0;
    return job->stage != TMR_STAGE_JOIN || job->t.keep[v];
}

static txm_status tmr_fill_points(trimesh_job *job, int32_t *number, trimesh_state *state) {
    const tmr_mesh *m = &job->w.m;
    size_t n = 0;
    for (int32_t v = 0; v < m->vertex_count; v++)
        number[v] = tmr_is_point(job, v) ? (int32_t)n++ : -1;
    if (n == 0) return TXM_OK;
    float *p = (float *)txm_arena_alloc(&job->view, n, 3 * sizeof(float));
    if (!p) return TXM_OUT_OF_MEMORY;
    state->points = n;
    state->positions = p;
    for (int32_t v = 0; v < m->vertex_count; v++) {
        if (number[v] < 0) continue;
        const txm_dvec3 at = txm_d3_add(txm_d3_scale(m->p[v], job->s.diagonal), job->s.centre);
        *p++ = txm_float(at.x);
        *p++ = txm_float(at.y);
        *p++ = txm_float(at.z);
    }
    return TXM_OK;
}

static txm_status tmr_fill_triangles(trimesh_job *job, const int32_t *number,
                                     trimesh_state *state) {
    const tmr_mesh *m = &job->w.m;
    size_t n = 0;
    for (int32_t f = 0; f < m->face_count; f++) n += !tmr_is_dead(m, f) && !tmr_is_ghost_face(m, f);
    if (n == 0) return TXM_OK;
    uint32_t *indices = (uint32_t *)txm_arena_alloc(&job->view, n, 3 * sizeof(uint32_t));
    if (!indices) return TXM_OUT_OF_MEMORY;
    state->triangles = n;
    state->indices = indices;
    for (int32_t f = 0; f < m->face_count; f++) {
        if (tmr_is_dead(m, f) || tmr_is_ghost_face(m, f)) continue;
        for (int k = 0; k < 3; k++) *indices++ = (uint32_t)number[m->vertex[3 * f + k]];
    }
    return TXM_OK;
}

static txm_status tmr_fill_state(trimesh_job *job, trimesh_state *state) {
    const tmr_mesh *m = &job->w.m;
    state->stage = tmr_stage_name(job->shown);
    state->round = job->round;
    state->mean = txm_float(job->mean);
    state->largest = txm_float(job->largest);
    if (job->status != TXM_OK || m->vertex_count == 0) return TXM_OK;
    int32_t *number =
        (int32_t *)txm_arena_alloc(&job->view, (size_t)m->vertex_count, sizeof(int32_t));
    if (!number) return TXM_OUT_OF_MEMORY;
    txm_status status = tmr_fill_points(job, number, state);
    if (status == TXM_OK && job->stage != TMR_STAGE_JOIN)
        status = tmr_fill_triangles(job, number, state);
    return status;
}

/* ---- jobs: public --------------------------------------------------------------------------- */

/* Use the hooks of this call, but the allocator of trimesh_begin, which made the blocks. */
static void tmr_job_enter(trimesh_job *job, const txm_env *env) {
    const txm_env old = job->env;
    memset(&job->env, 0, sizeof job->env);
    if (env) job->env = *env;
    job->env.allocate = old.allocate;
    job->env.release = old.release;
    job->env.memory_user = old.memory_user;
    job->env.message[0] = 0;
    tmr_rise_in(&job->rising, &job->env);
}

/* Hand the message to the caller. */
static txm_status tmr_job_leave(const trimesh_job *job, txm_env *env, txm_status status) {
    return status == TXM_OK ? TXM_OK : txm_fail(env, status, job->env.message);
}

static txm_status tmr_begin(const trimesh_desc *desc, txm_env *env, int is_trial,
                            trimesh_job **job) {
    if (desc && desc->report) memset(desc->report, 0, sizeof *desc->report);
    if (!job) return txm_fail(env, TXM_BAD_ARGUMENT, "job is NULL");
    *job = NULL;
    txm_status status = tmr_check_desc(desc, env);
    if (status != TXM_OK) return status;
    trimesh_job *j = (trimesh_job *)txm_alloc(env, sizeof *j);
    if (!j) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a job");
    memset(j, 0, sizeof *j);
    if (env) j->env = *env;
    tmr_job_enter(j, env);
    j->desc = *desc;
    j->is_trial = is_trial;
    txm_arena_init(&j->input, env);
    txm_arena_init(&j->first, env);
    txm_arena_init(&j->second, env);
    txm_arena_init(&j->scratch, env);
    txm_arena_init(&j->view, env);
    status = tmr_job_advance(j);
    if (desc->report) *desc->report = j->report;
    tmr_job_leave(j, env, status);
    if (status != TXM_OK) trimesh_free(j);
    else *job = j;
    return status;
}

TRIMESH_API txm_status trimesh_begin(const trimesh_desc *desc, txm_env *env, trimesh_job **job) {
    return tmr_begin(desc, env, 0, job);
}

TRIMESH_API txm_status trimesh_step(trimesh_job *job, txm_env *env, int *more) {
    if (more) *more = 0;
    if (!job) return txm_fail(env, TXM_BAD_ARGUMENT, "job is NULL");
    tmr_job_enter(job, env);
    txm_arena_free(&job->view);
    const txm_status status = tmr_job_advance(job);
    if (more) *more = status == TXM_OK && job->stage != TMR_STAGE_DONE;
    return tmr_job_leave(job, env, status);
}

TRIMESH_API txm_status trimesh_get_state(trimesh_job *job, txm_env *env, trimesh_state *state) {
    if (state) memset(state, 0, sizeof *state);
    if (!job || !state) return txm_fail(env, TXM_BAD_ARGUMENT, "job or state is NULL");
    tmr_job_enter(job, env);
    txm_arena_free(&job->view);
    const txm_status status = tmr_fill_state(job, state);
    if (status != TXM_OK) {
        txm_arena_free(&job->view);
        memset(state, 0, sizeof *state);
        txm_fail(&job->env, status, "no memory for the state; the job can go on");
    }
    return tmr_job_leave(job, env, status);
}

TRIMESH_API txm_status trimesh_get_mesh(trimesh_job *job, txm_env *env, trimesh_mesh **mesh) {
    if (mesh) *mesh = NULL;
    if (!job || !mesh) return txm_fail(env, TXM_BAD_ARGUMENT, "job or mesh is NULL");
    tmr_job_enter(job, env);
    txm_status status = job->status;
    if (status != TXM_OK) txm_fail(&job->env, status, "the job has failed before");
    else if (job->stage != TMR_STAGE_DONE)
        status = txm_fail(&job->env, TXM_BAD_ARGUMENT, "the job is not done; call trimesh_step");
    else if ((status = tmr_write(&job->w, mesh)) != TXM_OK)
        txm_fail(&job->env, status, "no memory for the mesh");
    return tmr_job_leave(job, env, status);
}

TRIMESH_API void trimesh_free(trimesh_job *job) {
    if (!job) return;
    const txm_env env = job->env;
    txm_arena_free(&job->input);
    txm_arena_free(&job->first);
    txm_arena_free(&job->second);
    txm_arena_free(&job->scratch);
    txm_arena_free(&job->view);
    txm_free(&env, job);
}

TRIMESH_API txm_status trimesh_retile(const trimesh_desc *desc, txm_env *env, trimesh_mesh **mesh) {
    trimesh_job *job;
    int more = 1;
    if (mesh) *mesh = NULL;
    if (!mesh) return txm_fail(env, TXM_BAD_ARGUMENT, "mesh is NULL");
    txm_status status = trimesh_begin(desc, env, &job);
    while (status == TXM_OK && more) status = trimesh_step(job, env, &more);
    if (status == TXM_OK) status = trimesh_get_mesh(job, env, mesh);
    trimesh_free(job);
    return status;
}

/* ---- after the surface has changed ---------------------------------------------------------- */

/* The new surface is retiled with points that come from three places: the old mesh, where it lies
   on the new surface; its lines, in the gaps between the old points there; and the rest of the
   surface that no triangle of the old mesh covers. Then as in TRIMESH_REPEL these are put into the
   mesh of the surface, whose own vertices are removed. Between old points the edges of the old mesh
   are restored, points far from anything new are pinned, and the others are relaxed. */

enum { TMR_LEAF = 4 }; /* triangles in a leaf of the tree */

/* Triangles in a tree of boxes: in the order of a space-filling curve, leaves of TMR_LEAF, a full
   binary tree over them. Node i has children 2 i + 1, 2 i + 2. */
typedef struct tmr_tree {
    const txm_dvec3 *point;
    const int32_t *vertex; /* 3 per triangle */
    txm_pair *order;       /* .value: triangle */
    int32_t count, leaves; /* leaves: a power of two */
    txm_dvec3 *low, *high; /* 1 per node */
} tmr_tree;

static void tmr_grow_box(txm_dvec3 *low, txm_dvec3 *high, txm_dvec3 p) {
    *low = txm_d3(fmin(low->x, p.x), fmin(low->y, p.y), fmin(low->z, p.z));
    *high = txm_d3(fmax(high->x, p.x), fmax(high->y, p.y), fmax(high->z, p.z));
}

static txm_status tmr_tree_build(tmr_tree *t, const txm_dvec3 *point, const int32_t *vertex,
                                 int32_t count, txm_arena *arena) {
    t->point = point;
    t->vertex = vertex;
    t->count = count;
    t->leaves = 1;
    while (t->leaves < (count + TMR_LEAF - 1) / TMR_LEAF) t->leaves *= 2;
    const size_t nodes = 2 * (size_t)t->leaves;
    t->order = (txm_pair *)txm_arena_alloc(arena, (size_t)count, sizeof(txm_pair));
    txm_pair *room = (txm_pair *)txm_arena_alloc(arena, (size_t)count, sizeof(txm_pair));
    t->low = (txm_dvec3 *)txm_arena_alloc(arena, nodes, sizeof(txm_dvec3));
    t->high = (txm_dvec3 *)txm_arena_alloc(arena, nodes, sizeof(txm_dvec3));
    const txm_status status = tmr_check_memory(arena);
    if (status != TXM_OK) return status;
    for (int32_t f = 0; f < count; f++) {
        const int32_t *v = vertex + 3 * f;
        t->order[f].value = (uint32_t)f;
        t->order[f].key = tmr_curve_key(
            txm_d3_scale(txm_d3_add(txm_d3_add(point[v[0]], point[v[1]]), point[v[2]]), 1.0 / 3));
    }
    txm_sort_pairs(t->order, room, (size_t)count);
    for (int32_t i = 2 * t->leaves - 2; i >= 0; i--) {
        txm_dvec3 low = txm_d3(1e300, 1e300, 1e300), high = txm_d3(-1e300, -1e300, -1e300);
        if (i < t->leaves - 1) {
            low = t->low[2 * i + 1];
            high = t->high[2 * i + 1];
            tmr_grow_box(&low, &high, t->low[2 * i + 2]);
            tmr_grow_box(&low, &high, t->high[2 * i + 2]);
            if (t->low[2 * i + 2].x > t->high[2 * i + 2].x) { /* nothing in it    */
                low = t->low[2 * i + 1];
                high = t->high[2 * i + 1];
            }
        }
        const int32_t first = (i - t->leaves + 1) * TMR_LEAF;
        for (int32_t k = 0; k < 3 * TMR_LEAF && i >= t->leaves - 1; k++)
            if (first + k / 3 < count)
                tmr_grow_box(&low, &high, point[vertex[3 * t->order[first + k / 3].value +
                                                       (uint32_t)(k % 3)]]);
        t->low[i] = low;
        t->high[i] = high;
    }
    return TXM_OK;
}

/* squared distance from p to the box of a node */
static double tmr_box_dist2(const tmr_tree *t, int32_t i, txm_dvec3 p) {
    const double x = fmax(fmax(t->low[i].x - p.x, p.x - t->high[i].x), 0);
    const double y = fmax(fmax(t->low[i].y - p.y, p.y - t->high[i].y), 0);
    const double z = fmax(fmax(t->low[i].z - p.z, p.z - t->high[i].z), 0);
    return x * x + y * y + z * z;
}

enum { TMR_TREE_DEPTH = 64 }; /* each level leaves one node on the stack: of 2^31 at most 31, and one */

/* The triangle nearest to p within reach whose normal agrees with n to the cosine `agree`; -1:
   none. *at: the place on it. */
static int32_t tmr_tree_nearest(const tmr_tree *t, txm_dvec3 p, txm_dvec3 n, double agree,
                                double reach, tmr_place *at) {
    int32_t stack[TMR_TREE_DEPTH], size = 0, best = -1;
    double least = reach * reach;
    stack[size++] = 0;
    while (size > 0) {
        const int32_t i = stack[--size];
        if (tmr_box_dist2(t, i, p) > least) continue;
        if (i < t->leaves - 1) { /* the nearer one first */
            const int distant = tmr_box_dist2(t, 2 * i + 1, p) < tmr_box_dist2(t, 2 * i + 2, p);
            TRIMESH_ASSERT(size + 2 <= TMR_TREE_DEPTH);
            stack[size++] = 2 * i + 1 + distant;
            stack[size++] = 2 * i + 2 - distant;
            continue;
        }
        const int32_t first = (i - t->leaves + 1) * TMR_LEAF;
        for (int32_t k = first; k < first + TMR_LEAF && k < t->count; k++) {
            tmr_place here;
            const int32_t f = (int32_t)t->order[k].value, *v = t->vertex + 3 * f;
            const txm_dvec3 a = t->point[v[0]], b = t->point[v[1]], c = t->point[v[2]];
            here.face = f;
            here.p = tmr_nearest(p, a, b, c, &here.u, &here.v, &here.part);
            here.d2 = txm_d3_dist2(p, here.p);
            if (here.d2 > least || (best >= 0 && here.d2 >= least)) continue;
            const txm_dvec3 across = txm_d3_area2(a, b, c);
            if (txm_d3_dot(across, n) < agree * txm_d3_len(across)) continue;
            least = here.d2;
            best = f;
            *at = here;
        }
    }
    return best;
}

/* ---- points in a grid ------------------------------------------------------------------------- */

typedef struct tmr_grid {
    double cell;
    int32_t mask;
    int32_t *head; /* 1 per slot: the last vertex put there, or -1 */
    int32_t *next; /* 1 per vertex of the mesh: the one before it */
} tmr_grid;

static int32_t tmr_grid_slot(const tmr_grid *g, double x, double y, double z) {
    const uint64_t h = txm_hash(txm_hash(txm_hash((uint64_t)(int64_t)x) ^ (uint64_t)(int64_t)y) ^
                                (uint64_t)(int64_t)z);
    return (int32_t)(h & (uint64_t)g->mask);
}

static txm_status tmr_grid_build(tmr_grid *g, double cell, int32_t points, int32_t vertices,
                                 txm_arena *arena) {
    int32_t size = 16;
    while (size < points && size < (1 << 28)) size *= 2;
    g->cell = cell;
    g->mask = size - 1;
    g->head = (int32_t *)txm_arena_alloc(arena, (size_t)size, sizeof(int32_t));
    g->next = (int32_t *)txm_arena_alloc(arena, (size_t)vertices, sizeof(int32_t));
    const txm_status status = tmr_check_memory(arena);
    if (status != TXM_OK) return status;
    for (int32_t i = 0; i < size; i++) g->head[i] = -1;
    return TXM_OK;
}

static void tmr_grid_add(tmr_grid *g, txm_dvec3 p, int32_t v) {
    int32_t *head = g->head + tmr_grid_slot(g, floor(p.x / g->cell), floor(p.y / g->cell),
                                            floor(p.z / g->cell));
    TRIMESH_ASSERT(*head != v); /* no point twice: it would be the one before itself */
    g->next[v] = *head;
    *head = v;
}

/* Is a point of the grid nearer to p than reach, on the same side of a sheet? was: NULL, or 1 per
   vertex: those with a number >= 0 do not count. */
static int tmr_is_crowded(const tmr_grid *g, const tmr_work *w, const int32_t *was, txm_dvec3 p,
                          txm_dvec3 n, double reach) {
    const int k = (int)fmin(ceil(reach / g->cell), 8);
    const double x = floor(p.x / g->cell), y = floor(p.y / g->cell), z = floor(p.z / g->cell);
    for (int i = -k; i <= k; i++) {
        for (int j = -k; j <= k; j++) {
            for (int l = -k; l <= k; l++) {
                int32_t v = g->head[tmr_grid_slot(g, x + i, y + j, z + l)];
                for (; v >= 0; v = g->next[v]) {
                    if (was && was[v] >= 0) continue;
                    if (txm_d3_dist2(w->m.p[v], p) < reach * reach &&
                        txm_d3_dot(w->m.n[v], n) > -0.1)
                        return 1;
                }
            }
        }
    }
    return 0;
}

/* ---- the update ------------------------------------------------------------------------------ */

typedef struct tmr_update {
    const trimesh_mesh *old;
    txm_env env; /* the caller's hooks; progress goes through rising */
    tmr_rising rising;
    trimesh_desc desc;
    double radius, tolerance; /* in edge lengths */
    tmr_surface s;
    tmr_lines l;
    tmr_work w;
    tmr_sampling t;
    tmr_tree tree;       /* of the surface                                                       */
    tmr_tree old_tree;
    tmr_grid grid;
    txm_dvec3
        *old_point;      /* 1 per vertex of the old mesh, scaled                                  */
    int32_t *old_vertex; /* 3 per triangle of the old mesh                                       */
    int32_t *now;        /* 1 per vertex of the old mesh: its vertex in the new one, -1            */
    int32_t *was;        /* 1 per vertex of the new one: its vertex in the old one, -1            */
    int32_t *face;       /* 1 per vertex of the old mesh: the face it lies in, -1                 */
    txm_dvec3 *place;    /* 1 per vertex of the old mesh: where                                  */
    int32_t *segment; /* 1 per corner of the surface: the segment on its edge, -1               */
    double *way;         /* 1 per vertex of the old mesh on a line: distance from its beginning  */
    int32_t *level;      /* 1 per vertex of the mesh: edges to the nearest new one                 */
    txm_arena input, first, scratch;
} tmr_update;

/* a vertex of the old mesh: its normal */
static txm_dvec3 tmr_old_normal(const tmr_update *u, int32_t i) {
    const float *n = u->old->normals + 3 * (size_t)i;
    return txm_d3(n[0], n[1], n[2]);
}

/* Segments by the corners opposite to them. */
static void tmr_map_segments(tmr_update *u) {
    const tmr_surface *s = &u->s;
    for (int32_t c = 0; c < 3 * s->face_count; c++) u->segment[c] = -1;
    for (int32_t k = 0; k < u->l.segment_count; k++) {
        for (int32_t c = 3 * u->l.face[k]; c < 3 * u->l.face[k] + 3; c++) {
            const int32_t a = s->vertex[tmr_next(c)], b = s->vertex[tmr_prev(c)];
            if ((a != u->l.a[k] || b != u->l.b[k]) && (a != u->l.b[k] || b != u->l.a[k])) continue;
            u->segment[c] = k;
            if (s->opposite[c] >= 0) u->segment[s->opposite[c]] = k;
        }
    }
}

/* Take segment k for old vertex i if it is nearer than *least and of the right kind. */
static void tmr_try_segment(tmr_update *u, int32_t i, int32_t k, double *least) {
    if (k < 0 || (u->l.border[u->l.line[k]] != 0) != (u->old->kinds[i] == TRIMESH_BORDER)) return;
    const txm_dvec3 a = u->s.point[u->l.a[k]], b = u->s.point[u->l.b[k]], ab = txm_d3_sub(b, a);
    double t = txm_d3_dot(txm_d3_sub(u->old_point[i], a), ab) / (txm_d3_len2(ab) + 1e-300);
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    const double d2 = txm_d3_dist2(u->old_point[i], txm_d3_mad(a, ab, t));
    if (d2 > *least) return;
    *least = d2;
    u->face[i] = k;
    double way = 0; /* in wanted edge lengths */
    for (int32_t j = u->l.first[u->l.line[k]]; j < k; j++) way += tmr_segment_weight(&u->s, &u->l, j);
    u->way[i] = way + t * tmr_segment_weight(&u->s, &u->l, k);
}

/* The segment that an old vertex on a line lies on now, among those of a face and around its
   corners; -1: none. */
static void tmr_find_segment(tmr_update *u, int32_t i, int32_t face) {
    const double reach = u->tolerance * u->t.length;
    double least = reach * reach;
    u->face[i] = -1;
    for (int k = 0; k < 3; k++) {
        const int32_t first = u->s.corner[u->s.vertex[3 * face + k]];
        int32_t c = first;
        for (int guard = 0; c >= 0 && guard < 256; guard++) {
            tmr_try_segment(u, i, u->segment[tmr_next(c)], &least);
            tmr_try_segment(u, i, u->segment[tmr_prev(c)], &least);
            c = tmr_ccw(u->s.opposite, c);
            if (c == first) break;
        }
    }
}

/* If old vertex i, a corner, lies at a corner of the new surface, map it there. */
static void tmr_find_corner(tmr_update *u, int32_t i, int32_t face) {
    const double reach = u->tolerance * u->t.length;
    for (int k = 0; k < 3; k++) {
        const int32_t v = u->s.vertex[3 * face + k];
        if (u->l.kind[v] != TRIMESH_CORNER || u->was[v] >= 0) continue;
        if (txm_d3_dist2(u->s.point[v], u->old_point[i]) > reach * reach) continue;
        u->now[i] = v;
        u->was[v] = i;
    }
}

/* Where do the old vertices lie on the new surface? For those on lines `face` is the segment. */
static void tmr_find_old(tmr_update *u) {
    for (int32_t i = 0; i < (int32_t)u->old->vertex_count; i++) {
        tmr_place at;
        const int kind = u->old->kinds[i];
        const int sharp = kind != TRIMESH_FREE; /* there are two normals there    */
        u->now[i] = u->face[i] = -1;
        const int32_t f = tmr_tree_nearest(&u->tree, u->old_point[i], tmr_old_normal(u, i),
                                           sharp ? -2 : 0.7, u->tolerance * u->t.length, &at);
        if (f < 0) continue;
        if (kind == TRIMESH_CORNER) tmr_find_corner(u, i, f);
        else if (kind != TRIMESH_FREE) tmr_find_segment(u, i, f);
        else {
            u->face[i] = f;
            u->place[i] = at.p;
        }
    }
}

/* ---- the update: lines ----------------------------------------------------------------------- */

/* List the old vertices on lines in their order along them in pairs[].value. Returns how many. */
static size_t tmr_order_on_lines(const tmr_update *u, txm_pair *pairs, txm_pair *room) {
    size_t n = 0;
    for (size_t i = 0; i < u->old->vertex_count; i++) {
        const int kind = u->old->kinds[i];
        if ((kind != TRIMESH_BORDER && kind != TRIMESH_CREASE) || u->face[i] < 0) continue;
        pairs[n].key = txm_sort_key(txm_float(u->way[i]));
        pairs[n++].value = (uint32_t)i;
    }
    txm_sort_pairs(pairs, room, n);
    for (size_t k = 0; k < n; k++) pairs[k].key = (uint32_t)u->l.line[u->face[pairs[k].value]];
    txm_sort_pairs(pairs, room, n);
    return n;
}

/* Fill the gap between two places on a line with evenly spaced new ones. */
static int32_t tmr_fill_gap(tmr_update *u, double from, double to, double spacing, int32_t count,
                            int32_t room, int32_t *olds) {
    const double steps = floor((to - from) / spacing + 0.5);
    for (double k = 1; k < steps && count < room; k++) {
        u->t.ways[count] = from + (to - from) * k / steps;
        olds[count++] = -1;
    }
    return count;
}

/* Points on a line: the old ones that are far enough apart, and new ones in the gaps. */
static txm_status tmr_update_line(tmr_update *u, int32_t line, const txm_pair *pairs, size_t count,
                                  int32_t *olds, int32_t *vertices, int32_t room) {
    const double length = tmr_line_weight(&u->s, &u->l, line);
    const double scale = u->desc.line_spacing > 0 ? u->desc.line_spacing : 1;
    const double spacing = u->t.length * scale;
    const int closed = u->l.closed[line];
    double last = 0, begin = 0;
    int32_t n = 0;
    size_t kept = 0;
    for (size_t k = 0; k < count && n < room; k++) {
        const int32_t i = (int32_t)pairs[k].value;
        const double way = u->way[i], end = closed && kept ? begin + length : length;
        const int first = closed && kept == 0;
        if (!first && way - last < 0.5 * spacing) continue;
        if ((!closed || kept) && end - way < 0.5 * spacing) continue;
        if (first) begin = way;
        else n = tmr_fill_gap(u, last, way, spacing, n, room, olds);
        if (n >= room) break;
        u->t.ways[n] = way;
        olds[n++] = i;
        last = way;
        kept++;
    }
    if (kept == 0 || !closed) { /* the rest, or all */
        const int32_t steps = kept ? 0 : tmr_line_steps(&u->t, line);
        if (closed && room > 0) {
            u->t.ways[n] = 0;
            olds[n++] = -1;
        }
        n = tmr_fill_gap(u, last, length, steps ? length / steps : spacing, n, room, olds);
    } else { /* across the end of the loop to the first one; those beyond the end move to the front */
        n = tmr_fill_gap(u, last, begin + length, spacing, n, room, olds);
        int32_t over = 0;
        while (over < n && u->t.ways[n - 1 - over] >= length) over++;
        for (int32_t turn = 0; turn < over; turn++) {
            const double way = u->t.ways[n - 1] - length;
            memmove(u->t.ways + 1, u->t.ways, ((size_t)n - 1) * sizeof(double));
            memmove(olds + 1, olds, ((size_t)n - 1) * sizeof(int32_t));
            u->t.ways[0] = way;
            olds[0] = -1;
        }
    }
    const txm_status status = tmr_cut_line(&u->t, line, u->t.ways, n, vertices);
    if (status != TXM_OK) return status;
    for (int32_t k = 0; k < n; k++) {
        if (olds[k] < 0 || vertices[k] < 0 || u->was[vertices[k]] >= 0) continue;
        u->was[vertices[k]] = olds[k];
        u->now[olds[k]] = vertices[k];
    }
    return TXM_OK;
}

static txm_status tmr_update_lines(tmr_update *u) {
    const size_t n = u->old->vertex_count;
    const int32_t room = 3 * u->t.line_room + 16;
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(&u->scratch, 2 * n, sizeof(txm_pair));
    int32_t *olds = (int32_t *)txm_arena_alloc(&u->scratch, 2 * (size_t)room, sizeof(int32_t));
    u->t.ways = (double *)txm_arena_alloc(&u->scratch, (size_t)room, sizeof(double));
    txm_status status = tmr_check_memory(&u->scratch);
    if (status != TXM_OK) return status;
    for (int32_t v = 0; v < u->s.vertex_count; v++) u->t.keep[v] = u->l.kind[v] == TRIMESH_CORNER;
    const size_t count = tmr_order_on_lines(u, pairs, pairs + n);
    size_t k = 0;
    for (int32_t line = 0; line < u->l.line_count && status == TXM_OK; line++) {
        const size_t first = k;
        while (k < count && pairs[k].key == (uint32_t)line) k++;
        status = tmr_update_line(u, line, pairs + first, k - first, olds, olds + room, room);
    }
    if (status == TXM_TOO_SMALL)
        txm_fail(u->w.env, status,
                 "creases and borders take more vertices than there is room for; "
                 "give more, or a larger line_spacing");
    return status;
}

/* ---- the update: points on faces -------------------------------------------------------------- */

/* Put the old vertices on faces into the mesh, face by face, except those too near to lines. */
static txm_status tmr_update_old(tmr_update *u) {
    const size_t n = u->old->vertex_count;
    size_t count = 0;
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(&u->scratch, 2 * n, sizeof(txm_pair));
    if (!pairs) return TXM_OUT_OF_MEMORY;
    for (int32_t v = 0; v < u->w.m.vertex_count; v++)
        if (u->t.keep[v]) tmr_grid_add(&u->grid, u->w.m.p[v], v);
    for (size_t i = 0; i < n; i++) {
        if (u->old->kinds[i] != TRIMESH_FREE || u->face[i] < 0) continue;
        const tmr_place at = tmr_on_face(&u->s, u->face[i], u->place[i]);
        const double reach = 0.6 * u->t.length * tmr_scale_at(&u->s, &at);
        const txm_dvec3 normal = u->s.normal[u->face[i]];
        if (tmr_is_crowded(&u->grid, &u->w, u->was, u->place[i], normal, reach)) continue;
        pairs[count].key = (uint32_t)u->face[i];
        pairs[count++].value = (uint32_t)i;
    }
    txm_sort_pairs(pairs, pairs + n, count);
    for (size_t k = 0; k < count; k++) {
        const int32_t i = (int32_t)pairs[k].value;
        const int32_t v = tmr_insert(&u->t, u->face[i], u->place[i], 1);
        if (v < 0) continue;
        u->now[i] = v;
        u->was[v] = i;
        tmr_grid_add(&u->grid, u->w.m.p[v], v);
    }
    return TXM_OK;
}

/* Is a place of the new surface covered by a triangle of the old mesh all of whose corners are
   still there? */
static int tmr_is_covered(const tmr_update *u, txm_dvec3 p, txm_dvec3 n, double length) {
    tmr_place at;
    const int32_t f = tmr_tree_nearest(&u->old_tree, p, n, 0.5, 0.5 * length, &at);
    if (f < 0) return 0;
    for (int k = 0; k < 3; k++)
        if (u->now[u->old_vertex[3 * f + k]] < 0) return 0;
    return 1;
}

/* Put new points where there are none: try many places, along the faces, and take those that keep
   the distance from all others and that the old mesh does not cover. limit: most points in all. */
static txm_status tmr_update_new(tmr_update *u, const txm_pair *order, double distance,
                                 int32_t *live, int32_t limit, uint64_t stream) {
    const double area = 0.86602540378443865 * u->t.length * u->t.length; /* of one point */
    txm_rng rng = txm_rng_make(u->desc.seed, stream);
    double run = 0;
    for (int32_t i = 0; i < u->s.face_count && *live < limit; i++) {
        const int32_t f = (int32_t)order[i].value;
        run += 6 * u->t.piece[f] / area;
        const int32_t tries = run < 1 ? 0 : run > 1e8 ? 100000000 : (int32_t)run;
        run -= tries;
        if (tmr_tick(&u->w, 1)) return TXM_CANCELLED;
        for (int32_t k = 0; k < tries && *live < limit; k++) {
            if (tmr_tick(&u->w, 1)) return TXM_CANCELLED;
            const txm_dvec3 p = tmr_sample_place(&u->s, f, k, tries, &rng), n = u->s.normal[f];
            const tmr_place at = tmr_on_face(&u->s, f, p);
            const double length = u->t.length * tmr_scale_at(&u->s, &at);
            if (tmr_is_crowded(&u->grid, &u->w, NULL, p, n, distance * length)) continue;
            if (tmr_is_covered(u, p, n, length)) continue;
            const int32_t v = tmr_insert(&u->t, f, p, 0);
            if (v < 0) continue;
            tmr_grid_add(&u->grid, u->w.m.p[v], v);
            ++*live;
        }
    }
    return TXM_OK;
}

static txm_status tmr_update_sample(tmr_update *u) {
    /* in falling distance: a random packing at 0.78 is as dense as the lattice at 1 */
    static const double distance[] = {0.85, 0.75, 0.65, 0.55};
    const size_t n = (size_t)u->s.face_count;
    const int exact = u->desc.vertices > 0;
    int32_t live = 0;
    txm_status status = tmr_update_lines(u);
    if (status == TXM_OK) status = tmr_update_old(u);
    if (status != TXM_OK) return status;
    txm_pair *order = (txm_pair *)txm_arena_alloc(&u->scratch, 2 * n, sizeof(txm_pair));
    if (!order) return TXM_OUT_OF_MEMORY;
    tmr_order_faces(&u->s, order, order + n);
    for (int32_t v = 0; v < u->w.m.vertex_count; v++) live += u->t.keep[v];
    for (int pass = 0; pass < (exact ? 4 : 2) && status == TXM_OK; pass++)
        status = tmr_update_new(u, order, distance[pass], &live,
                                exact ? (int32_t)u->desc.vertices : TMR_MOST,
                                77 + (uint64_t)pass);
    return status;
}

/* ---- the update: what stays as it was ----------------------------------------------------------- */

static uint64_t tmr_edge_key(int32_t a, int32_t b) {
    const uint64_t x = (uint64_t)(a < b ? a : b), y = (uint64_t)(a < b ? b : a);
    return (x << 32 | y) + 1; /* 0 = free */
}

static int tmr_has_edge(const uint64_t *table, size_t mask, int32_t a, int32_t b) {
    const uint64_t key = tmr_edge_key(a, b);
    for (size_t i = (size_t)txm_hash(key) & mask; table[i]; i = (i + 1) & mask)
        if (table[i] == key) return 1;
    return 0;
}

/* Flip edges between old vertices to restore those of the old mesh. */
static txm_status tmr_restore_edges(tmr_update *u) {
    tmr_mesh *m = &u->w.m;
    const size_t n = 3 * u->old->triangle_count;
    size_t size = 16;
    while (size < 2 * n) size *= 2; /* an edge has a triangle or two: at most half of it is used */
    uint64_t *table = (uint64_t *)txm_arena_zero(&u->scratch, size, sizeof(uint64_t));
    if (!table) return TXM_OUT_OF_MEMORY;
    for (size_t c = 0; c < n; c++) {
        const int32_t a = u->now[u->old->indices[c]];
        const int32_t b = u->now[u->old->indices[c % 3 == 2 ? c - 2 : c + 1]];
        if (a < 0 || b < 0 || tmr_has_edge(table, size - 1, a, b)) continue;
        size_t i = (size_t)txm_hash(tmr_edge_key(a, b)) & (size - 1);
        while (table[i]) i = (i + 1) & (size - 1);
        table[i] = tmr_edge_key(a, b);
    }
    for (int round = 0; round < 20; round++) {
        int32_t turned = 0;
        for (int32_t c = 0; c < 3 * m->face_count; c++) {
            if (m->vertex[c] < 0 || m->opposite[c] < c || m->edge[c]) continue;
            const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
            const int32_t d = m->vertex[c], e = m->vertex[m->opposite[c]];
            tmr_quad q;
            if (u->was[d] < 0 || u->was[e] < 0 || !tmr_has_edge(table, size - 1, d, e)) continue;
            if (tmr_has_edge(table, size - 1, a, b) || !tmr_measure_flip(&u->w, c, &q)) continue;
            if (q.after <= 0 && q.after <= q.before) continue;
            tmr_flip(m, c);
            turned++;
        }
        if (turned == 0) break;
    }
    return TXM_OK;
}

/* Pin the old vertices that are farther than the radius, in edges, from every new vertex and from
   every place where an old one is gone. */
static void tmr_pin(tmr_update *u) {
    tmr_mesh *m = &u->w.m;
    const int32_t most = (int32_t)ceil(u->radius);
    for (int32_t v = 0; v < m->vertex_count; v++) u->level[v] = u->was[v] < 0 ? 0 : most + 1;
    for (size_t c = 0; c < 3 * u->old->triangle_count; c++) {
        const uint32_t i = u->old->indices[c], j = u->old->indices[c % 3 == 2 ? c - 2 : c + 1];
        if (u->now[i] < 0 && u->now[j] >= 0) u->level[u->now[j]] = 1;
        if (u->now[j] < 0 && u->now[i] >= 0) u->level[u->now[i]] = 1;
    }
    for (int32_t round = 0; round < most; round++) {
        for (int32_t c = 0; c < 3 * m->face_count; c++) {
            if (m->vertex[c] < 0 || tmr_is_ghost_face(m, c / 3)) continue;
            const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
            if (u->level[a] == round && u->level[b] > round + 1) u->level[b] = round + 1;
            if (u->level[b] == round && u->level[a] > round + 1) u->level[a] = round + 1;
        }
    }
    for (int32_t v = 0; v < m->vertex_count; v++)
        if (m->corner[v] >= 0 && !tmr_is_ghost(m, v) && u->level[v] > most)
            m->flags[v] |= TMR_PINNED;
}

/* ---- the update: the whole ---------------------------------------------------------------------- */

static txm_status tmr_update_alloc(tmr_update *u) {
    const size_t n = u->old->vertex_count, t = u->old->triangle_count;
    const size_t room = (size_t)u->w.m.vertex_limit;
    txm_arena *arena = &u->first;
    u->old_point = (txm_dvec3 *)txm_arena_alloc(arena, n, sizeof(txm_dvec3));
    u->place = (txm_dvec3 *)txm_arena_alloc(arena, n, sizeof(txm_dvec3));
    u->now = (int32_t *)txm_arena_alloc(arena, n, sizeof(int32_t));
    u->face = (int32_t *)txm_arena_alloc(arena, n, sizeof(int32_t));
    u->way = (double *)txm_arena_zero(arena, n, sizeof(double));
    u->old_vertex = (int32_t *)txm_arena_alloc(arena, 3 * t, sizeof(int32_t));
    u->was = (int32_t *)txm_arena_alloc(arena, room, sizeof(int32_t));
    u->level = (int32_t *)txm_arena_zero(arena, room, sizeof(int32_t));
    u->segment = (int32_t *)txm_arena_alloc(arena, 3 * (size_t)u->s.face_count, sizeof(int32_t));
    txm_status status = tmr_check_memory(arena);
    if (status != TXM_OK) return status;
    for (size_t i = 0; i < n; i++) {
        const float *p = u->old->positions + 3 * i;
        u->old_point[i] =
            txm_d3_scale(txm_d3_sub(txm_d3(p[0], p[1], p[2]), u->s.centre), 1 / u->s.diagonal);
    }
    for (size_t c = 0; c < 3 * t; c++) u->old_vertex[c] = (int32_t)u->old->indices[c];
    for (size_t v = 0; v < room; v++) u->was[v] = -1;
    status = tmr_tree_build(&u->tree, u->s.point, u->s.vertex, u->s.face_count, arena);
    if (status == TXM_OK)
        status = tmr_tree_build(&u->old_tree, u->old_point, u->old_vertex, (int32_t)t, arena);
    return status;
}

/* How many points the surface has at edge length u->t.length. */
static double tmr_points_for(const tmr_update *u) {
    const double scale = u->desc.line_spacing > 0 ? u->desc.line_spacing : 1;
    double area = 0, border = 0;
    for (int32_t f = 0; f < u->s.face_count; f++) area += tmr_face_weight(&u->s, f);
    for (int32_t i = 0; i < u->l.line_count; i++)
        if (u->l.border[i]) border += tmr_line_weight(&u->s, &u->l, i);
    return area / (0.86602540378443865 * u->t.length * u->t.length) +
           0.5 * border / (u->t.length * scale);
}

static txm_status tmr_update_begin(tmr_update *u, trimesh_report *report) {
    txm_env *env = u->w.env;
    const float angle = u->desc.crease_angle > 0 ? u->desc.crease_angle : TMR_CREASE_ANGLE;
    trimesh_desc desc = u->desc;
    double least = 0; /* not checked: the old mesh says how many there are */
    if (desc.vertices == 0) desc.vertices = u->old->vertex_count;
    txm_status status = tmr_surface_build(&desc, env, &u->input, report, &u->s);
    if (status != TXM_OK) return status;
    const double length = u->old->edge_length / u->s.diagonal;
    if (u->desc.adapt > 0)
        status = tmr_adapt_scale(&u->s, length, u->desc.adapt, &u->input, &u->scratch);
    if (status == TXM_OK)
        status = tmr_settle_lines(&u->s, &u->desc, (double)desc.vertices, angle, length, &u->input,
                                  &u->scratch, report, &u->l, &least);
    if (status == TXM_OK) status = tmr_find_fans(&u->s, &u->input, &u->scratch);
    if (status != TXM_OK) return status;
    u->w.desc = &u->desc;
    u->w.s = &u->s;
    u->w.l = &u->l;
    u->t.w = &u->w;
    u->t.desc = &u->desc;
    u->t.length = length;
    if (u->desc.vertices > 0)
        u->t.length =
            tmr_sampling_length(&u->s, &u->l, u->desc.line_spacing > 0 ? u->desc.line_spacing : 1,
                                (double)u->desc.vertices);
    u->w.length = u->t.length;
    u->w.line_scale = u->desc.line_spacing > 0 ? u->desc.line_spacing : 1;
    const double points = fmax(tmr_points_for(u), (double)u->old->vertex_count);
    if (points > (double)TRIMESH_MAX_VERTICES || 4 * points > (double)TMR_MOST)
        return txm_fail(env, TXM_TOO_LARGE,
                        "the new surface takes too many vertices at the density of the old mesh; say how many");
    status = tmr_copy_surface(&u->w, tmr_sampling_room(floor(2 * points)), &u->first);
    if (status == TXM_OK) status = tmr_sampling_alloc(&u->t, &u->scratch);
    if (status == TXM_OK) status = tmr_update_alloc(u);
    if (status == TXM_OK)
        status =
            tmr_grid_build(&u->grid, u->t.length, (int32_t)points, u->w.m.vertex_limit, &u->first);
    if (status != TXM_OK) return status;
    tmr_map_segments(u);
    tmr_find_old(u);
    return TXM_OK;
}

static txm_status tmr_update_relax(tmr_update *u) {
    tmr_work *w = &u->w;
    int32_t missing = 0;
    w->pull = 0.5;
    w->step = 1;
    for (int round = 0; round < 12; round++) {
        for (int k = 0; k < 2; k++) tmr_relax(w);
        tmr_flip_delaunay(w, 3);
        tmr_flip_valences(w, 3, 0.4);
        if (round == 4 && u->desc.vertices > 0) {
            const txm_status status =
                tmr_fix_count(w, (int32_t)u->desc.vertices, 2, &u->scratch, &missing);
            if (status != TXM_OK) return status;
        }
        if (txm_progress(w->env, 0.6f + 0.03f * (float)round, "relax")) return TXM_CANCELLED;
    }
    if (missing != 0)
        return txm_fail(w->env, TXM_TOO_SMALL,
                        "the vertices asked for do not fit into what has changed; ask for 0");
    long faults;
    const txm_status status = tmr_mend_spots(w, &faults);
    if (status != TXM_OK) return status;
    if (faults > 0)
        return txm_fail(w->env, TXM_TOO_SMALL, "the changed part is too thin or too fine for "
                        "edges of this length; retile the whole with more vertices");
    return TXM_OK;
}

/* Make the result; pinned vertices keep their positions bit for bit. */
static txm_status tmr_update_write(tmr_update *u, trimesh_mesh **out) {
    const tmr_mesh *m = &u->w.m;
    trimesh_mesh *mesh = NULL;
    const txm_status status = tmr_write(&u->w, &mesh);
    if (status != TXM_OK) return status;
    int32_t *which = (int32_t *)txm_arena_alloc(&mesh->memory, mesh->vertex_count, sizeof(int32_t));
    if (!which) {
        trimesh_mesh_free(mesh);
        return TXM_OUT_OF_MEMORY;
    }
    size_t k = 0;
    for (int32_t v = 0; v < m->vertex_count; v++) {
        if (m->corner[v] < 0 || tmr_is_ghost(m, v)) continue;
        which[k] = u->was[v];
        if (m->flags[v] & TMR_PINNED)
            memcpy(mesh->positions + 3 * k, u->old->positions + 3 * (size_t)u->was[v],
                   3 * sizeof(float));
        k++;
    }
    mesh->edge_length = u->t.length * u->s.diagonal;
    mesh->old_vertices = which;
    *out = mesh;
    return TXM_OK;
}

static txm_status tmr_update_run(tmr_update *u, trimesh_report *report, trimesh_mesh **out) {
    txm_status status = tmr_update_begin(u, report);
    if (status != TXM_OK) return status;
    if (txm_progress(u->w.env, 0.2f, "sample")) return TXM_CANCELLED;
    if ((status = tmr_update_sample(u)) != TXM_OK) return status;
    if (txm_progress(u->w.env, 0.4f, "join")) return TXM_CANCELLED;
    if ((status = tmr_remove_vertices(&u->w, u->t.keep, 0.4f)) != TXM_OK) return status;
    if ((status = tmr_restore_edges(u)) != TXM_OK) return status;
    tmr_pin(u);
    if ((status = tmr_update_relax(u)) != TXM_OK) return status;
    return tmr_update_write(u, out);
}

static txm_status tmr_check_update(const trimesh_mesh *old, const trimesh_update_desc *desc,
                                   txm_env *env) {
    if (!old || !desc) return txm_fail(env, TXM_BAD_ARGUMENT, "old or desc is NULL");
    trimesh_desc check = desc->desc;
    if (check.vertices == 0) check.vertices = 4;
    if (!(desc->radius >= 1 && desc->radius <= 1000) && !(desc->radius >= 0 && desc->radius <= 0))
        return txm_fail(env, TXM_BAD_ARGUMENT, "radius must be 1 to 1000, or 0");
    if (!(desc->tolerance >= 0 && desc->tolerance <= 0.5f))
        return txm_fail(env, TXM_BAD_ARGUMENT, "tolerance must be 0 to 0.5");
    const txm_mesh view = trimesh_as_view(old);
    const txm_status status = txm_mesh_check(&view, "old", 3, 1, TMR_MOST, env);
    if (status != TXM_OK) return status;
    if (old->triangle_count == 0 || !(old->edge_length > 0) || !old->normals || !old->kinds)
        return txm_fail(env, TXM_BAD_ARGUMENT, "old is no result of trimesh_retile");
    return tmr_check_desc(&check, env);
}

TRIMESH_API txm_status trimesh_update(const trimesh_mesh *old, const trimesh_update_desc *desc,
                                      txm_env *env, trimesh_mesh **mesh) {
    trimesh_report own, *report = &own;
    if (desc && desc->desc.report) report = desc->desc.report;
    memset(report, 0, sizeof *report);
    if (!mesh) return txm_fail(env, TXM_BAD_ARGUMENT, "mesh is NULL");
    *mesh = NULL;
    txm_status status = tmr_check_update(old, desc, env);
    if (status != TXM_OK) return status;
    tmr_update *u = (tmr_update *)txm_alloc(env, sizeof *u);
    if (!u) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for an update");
    memset(u, 0, sizeof *u);
    u->old = old;
    u->desc = desc->desc;
    u->radius = desc->radius > 0 ? desc->radius : 4;
    u->tolerance = desc->tolerance > 0 ? desc->tolerance : 0.2;
    if (env) u->env = *env;
    u->env.message[0] = 0;
    u->w.env = &u->env;
    tmr_rise_in(&u->rising, &u->env);
    txm_arena_init(&u->input, &u->env);
    txm_arena_init(&u->first, &u->env);
    txm_arena_init(&u->scratch, &u->env);
    status = tmr_update_run(u, report, mesh);
    if (status == TXM_OUT_OF_MEMORY) txm_fail(env, status, "no memory to update the mesh");
    else if (status == TXM_CANCELLED) txm_fail(env, status, "cancelled while updating the mesh");
    else if (status != TXM_OK) txm_fail(env, status, u->env.message);
    txm_arena_free(&u->input);
    txm_arena_free(&u->first);
    txm_arena_free(&u->scratch);
    txm_free(env, u);
    return status;
}

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
