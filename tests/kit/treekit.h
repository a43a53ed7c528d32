/* treekit.h - a rule of the caller for the tests of treepieces.h
   SPDX-License-Identifier: MIT OR Unlicense                                                     */
#ifndef TREEKIT_H
#define TREEKIT_H

#include "treepieces.h"

/* An own_rule that attaches random pieces in random directions, so that all pairs of pieces occur. */
static inline void any_piece(void *user, const treepieces_site *site, txm_rng *rng,
                             treepieces_choice *choice) {
    (void)user;
    choice->type = (int)txm_rng_below(rng, TREEPIECES_BUILTIN);
    choice->turn = (int)txm_rng_below(rng, TREEPIECES_RIM);
    for (int k = 0; k < 3; k++) {
        choice->direction[k] = site->direction[k] + txm_rng_float(rng) - 0.5f;
        choice->ratios[k] = 0.3f + 0.7f * txm_rng_float(rng);
    }
    choice->length = site->radius * (0.5f + 3 * txm_rng_float(rng));
}

#endif /* TREEKIT_H */
