#ifndef TRIMESH_RELAX_CONFIG_H
#define TRIMESH_RELAX_CONFIG_H

#include "../trimesh_relax.h"

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

#endif /* TRIMESH_RELAX_CONFIG_H */
