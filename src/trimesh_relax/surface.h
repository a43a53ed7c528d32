#ifndef TRIMESH_RELAX_SURFACE_H
#define TRIMESH_RELAX_SURFACE_H

#include "config.h"

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

#endif /* TRIMESH_RELAX_SURFACE_H */
