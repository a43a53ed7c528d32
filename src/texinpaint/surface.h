#ifndef TEXINPAINT_SURFACE_H
#define TEXINPAINT_SURFACE_H

#include "check.h"

/* ---- surface ---- */

#define TXI_NO_FACE 0xffffffffu

/* The mesh as a surface, across the seams of its atlas. */
struct txi_surface {
    size_t face_count, vertex_count; /* vertices: welded, those at equal positions are one      */
    txm_dvec3 *point;    /* 1 per vertex                                                       */
    uint32_t *vertex;    /* 3 per face: its vertices                                           */
    uint32_t *opposite;  /* 3 per face: the side on the other side of side k, from corner k to the
                            next; TXM_NO_SIDE at borders                                       */
    float *uv;           /* 6 per face: its corners in texels, texel centres are whole numbers; not
                            wrapped                                                            */
    uint32_t *chart;     /* 1 per face: faces that are connected in the atlas or overlap in it */
    uint32_t *owner;     /* 1 per texel: the first face whose chart covers its centre, or TXI_NO_FACE */
    uint32_t *first, *corners; /* the corners of vertex v: corners[first[v]] .. [first[v + 1] - 1] */
    uint32_t *hole_first, *hole; /* the missing texels of face f: hole[hole_first[f]] .. as first */
    size_t cursor;       /* no texel in front of this one is missing and covered               */
};

static txm_status txi_surface_make(txi_domain *d, txm_arena *arena, txm_env *env) {
    (void)arena;
    (void)env;
    d->surface = NULL;
    return TXM_OK;
}

#endif /* TEXINPAINT_SURFACE_H */
