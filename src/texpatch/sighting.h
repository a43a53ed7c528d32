#ifndef TEXPATCH_SIGHTING_H
#define TEXPATCH_SIGHTING_H

#include "wavy.h"

/* ---- finding the pattern of a photograph --------------------------------------------------- */

/* ours, see docs/choices.md */
#define TXP_CLEAR_LEAST 0.72 /* agreement of the phases of the first wave, 0..1: else no pattern  */
#define TXP_SECOND_LEAST 0.6 /* the same of the second one: else it is left out                   */
#define TXP_CONTRAST 0.03    /* of a wave, 0..1, that counts half                                 */
#define TXP_CONVINCING 1.3   /* score from which on nothing else is tried                         */
#define TXP_LEAST_PERIODS 1.5 /* of a wave in half of the longer side                             */
#define TXP_FIELD_FROM 0.4   /* agreement from which on a field is looked for                    */
#define TXP_BEND_MOST 0.5    /* of a lens, |bend| and |curl|                                      */
#define TXP_LENS_HELPS 0.8   /* of the disagreement without a lens: if more is left, there is none */
#define TXP_FREQUENCY 0.2    /* cycles per pixel, at most, in the picture the phases are read from */

/* What is found: score 0: no pattern. */
typedef struct txp_sighting {
    txp_guess guess;
    int size;        /* the picture the phases are read from      */
    txp_swell field; /* that of the guess, if its view points to it */
} txp_sighting;

/* The smallest picture that shows all waves of a guess well. */
static int txp_size_for(const txp_gray *sizes, int count, const txp_guess *g) {
    double most = 0;
    for (int k = 0; k < 2; k++) {
        const txp_wave *w = &g->wave[k];
        if (w->clear > 0) most = fmax(most, w->a * w->a + w->b * w->b);
    }
    for (int i = count - 1; i > 0; i--) {
        const int longer = sizes[i].width > sizes[i].height ? sizes[i].width : sizes[i].height;
        if (most <= (TXP_FREQUENCY * longer / 2) * (TXP_FREQUENCY * longer / 2)) return i;
    }
    return 0;
}

/* How much a fitted guess is worth: agreement of its waves, weak ones less. 0: it is no pattern. */
static double txp_worth(const txp_nodes *n, txp_guess *g) {
    const txp_view *v = &g->view;
    double sum = 0;
    const double reach_x = 0.5 * n->gray->width / n->half, reach_y = 0.5 * n->gray->height / n->half;
    if (fabs(v->bend) > TXP_BEND_MOST || fabs(v->curl) > TXP_BEND_MOST) return 0;
    if (!(fabs(v->tilt_x) * reach_x + fabs(v->tilt_y) * reach_y < 0.95)) return 0;
    txp_clearer_first(g);
    const txp_wave *a = &g->wave[0], *b = &g->wave[1];
    const double cross = a->a * b->b - a->b * b->a;
    const double aa = a->a * a->a + a->b * a->b, bb = b->a * b->a + b->b * b->b;
    const double least = TXP_LEAST_PERIODS * TXP_LEAST_PERIODS;
    if (b->clear < TXP_SECOND_LEAST || bb < least ||
        cross * cross < TXP_APART * TXP_APART * aa * bb)
        g->wave[1].clear = 0;
    if (a->clear < TXP_CLEAR_LEAST || aa < least) return 0;
    for (int k = 0; k < 2; k++)
        sum += g->wave[k].clear * g->wave[k].clear * g->wave[k].contrast /
               (g->wave[k].contrast + TXP_CONTRAST);
    return sum;
}

/* Fit a guess, with a field where that helps, and judge it. 0: no memory. */
static int txp_fit_guess(txp_nodes *n, txm_env *env, txp_guess *g, txp_swell *field) {
    txp_guess wavy;
    int helps = 0;
    txp_fit_phases(n, env, 1, g);
    wavy = *g;
    g->score = txp_worth(n, g);
    if (!(fmax(wavy.wave[0].clear, wavy.wave[1].clear) >= TXP_FIELD_FROM)) return 1;
    if (!txp_find_field(n, env, &wavy, field, &helps)) return 0;
    if (!helps) return 1;
    txp_measure(n, &wavy);
    wavy.score = txp_worth(n, &wavy);
    if (wavy.score > g->score) *g = wavy;
    return 1;
}

/* Try the guesses of one scale. 0: no memory. */
static int txp_try_scale(const txp_gray *sizes, int count, int at, int side, txm_env *env,
                         txp_sighting *best) {
    txm_arena scratch;
    txp_spectra spectra;
    txp_guess offers[TXP_OFFERS];
    txm_arena_init(&scratch, env);
    int done = txp_spectra_make(&sizes[at], side, &scratch, env, &spectra);
    if (done) txp_search_view(&spectra, env, offers);
    for (int k = 0; k < TXP_OFFERS && done; k++) {
        txp_nodes nodes;
        txp_swell field;
        txp_guess g = offers[k];
        if (!(g.score > 0) || best->guess.score >= TXP_CONVINCING) break;
        const int size = txp_size_for(sizes, count, &g);
        done = txp_nodes_make(&sizes[size], &scratch, &nodes) &&
               txp_fit_guess(&nodes, env, &g, &field);
        if (!done) break;
        if (g.score > best->guess.score) {
            best->guess = g;
            best->size = size;
            if (g.view.field) best->field = field;
        }
    }
    txm_arena_free(&scratch);
    return done;
}

/* Where stones are laid unevenly a lens always explains some of it: without need there is none.
   0: no memory. */
static int txp_doubt_lens(const txp_gray *sizes, txm_env *env, txp_sighting *found) {
    txm_arena scratch;
    txp_nodes nodes;
    txp_guess flat = found->guess;
    txm_arena_init(&scratch, env);
    const int done = txp_nodes_make(&sizes[found->size], &scratch, &nodes);
    if (done) {
        double with = 0, without = 0;
        flat.view.bend = flat.view.curl = 0;
        txp_fit_phases(&nodes, env, 0, &flat);
        for (int k = 0; k < nodes.waves; k++) {
            with += 1 - found->guess.wave[k].clear;
            without += 1 - flat.wave[k].clear;
        }
        const double score = txp_worth(&nodes, &flat);
        if (score > 0 && with > TXP_LENS_HELPS * without) {
            found->guess = flat;
            found->guess.score = score;
        }
    }
    txm_arena_free(&scratch);
    return done;
}

/* The view and the waves of a photograph; sizes: its evened pictures. The view's field is that of
   *found. */
static txm_status txp_find_pattern(const txp_gray *sizes, int count, txm_env *env,
                                   txp_sighting *found) {
    memset(found, 0, sizeof *found);
    for (int at = count - 1; at >= 0; at--) {
        const txp_gray *g = &sizes[at];
        const int least = g->width < g->height ? g->width : g->height;
        for (int side = TXP_WINDOW_SIDE; side >= TXP_WINDOW_SIDE / 4; side /= 2) {
            /* small windows only where large ones would be too few */
            if (least < side || (side < TXP_WINDOW_SIDE && least > 4 * side)) continue;
            if (found->guess.score >= TXP_CONVINCING) break;
            if (txm_progress(env, 0.5f * (float)(count - at) / (float)(count + 1), "lattice"))
                return txm_fail(env, TXM_CANCELLED, "cancelled");
            if (!txp_try_scale(sizes, count, at, side, env, found))
                return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the lattice");
        }
    }
    if (found->guess.view.field) found->guess.view.field = &found->field;
    else if (found->guess.score > 0 && !txp_doubt_lens(sizes, env, found))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the lattice");
    return TXM_OK;
}

#endif /* TEXPATCH_SIGHTING_H */
