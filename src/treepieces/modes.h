#ifndef TREEPIECES_MODES_H
#define TREEPIECES_MODES_H

#include "assemble.h"

/* ---- modes of swaying ---------------------------------------------------------------------- */

enum { TPC_PHASES = 8 /* of the flutter within a class of oscillators */ };

/* Does the axis that bears this piece go on at that rim of it? At forks other ones begin. */
static int tpc_goes_on(int type, int rim) {
    return rim == 0 && type != TREEPIECES_Y && type != TREEPIECES_SPATIAL;
}

/* One of eight phases, from the rotation of a piece, so that it does not depend on the rest of the tree. */
static uint32_t tpc_phase(const treepieces_node *n) {
    const uint32_t bits = tpc_float_bits(n->rotation[0]) ^ tpc_float_bits(n->rotation[2]);
    return bits * 0x9e3779b9u >> 29;
}

/* All joints of an axis swing in one mode: with the class of the piece in which it begins, and with a
   phase of its own. Each alone, they would cancel each other out. */
static void tpc_set_modes(treepieces_node *nodes, uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        treepieces_node *n = &nodes[i];
        const treepieces_node *up = n->parent < 0 ? NULL : &nodes[n->parent];
        const int goes_on = up && n->order == up->order && tpc_goes_on(up->type, n->joint >> 3);
        n->sway = goes_on ? up->sway : (uint8_t)(n->sway + TPC_CLASSES * tpc_phase(n));
    }
}

#endif /* TREEPIECES_MODES_H */
