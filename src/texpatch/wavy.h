#ifndef TEXPATCH_WAVY_H
#define TEXPATCH_WAVY_H

#include "phase.h"

/* ---- fitting the field to the phases -------------------------------------------------------- */

/* By how much the waves lie beside their prediction is a smooth function of the place where a wall is
   wavy, and noise where bricks are laid unevenly. What the field predicts for nodes that it has not
   seen tells which: blocks of nodes are left out in turn, for several stiffnesses of the field. */

/* ours, see docs/choices.md */
enum {
    TXP_FOLD = 2,         /* nodes along the sides of the blocks that are left out in turn           */
    TXP_STIFFNESSES = 4,  /* that are tried, each a quarter as stiff as the one before               */
    TXP_FIELD_FITS = 6,   /* rounds of one fit, the first half with differences                      */
    TXP_FIELD_LOOKS = 4,  /* at the photograph, with the field as it is by then                      */
    TXP_FIELD_TERMS = 32  /* numbers of both components that matter at a place                       */
};
#define TXP_STIFFEST 2.56    /* weight of second differences, in turns of weight 1                */
#define TXP_HELPS 0.7        /* of the disagreement of unseen nodes: if more is left, it is no help */
#define TXP_SOFTER 0.85      /* the same from one stiffness to the next softer one               */
#define TXP_FORESIGHT 0.88   /* agreement of unseen nodes, for each wave                         */
#define TXP_HELPS_LEAST 0.02 /* a disagreement that is smaller than this is none                 */
#define TXP_STEEPEST 0.3     /* displacement of a field from place to place                      */

/* One linear form in the numbers of a field. */
typedef struct txp_form {
    int count, at[2 * TXP_FIELD_TERMS];
    double value[2 * TXP_FIELD_TERMS];
} txp_form;

typedef struct txp_waving {
    const txp_nodes *nodes;
    const txp_guess *guess; /* its view has the field that the nodes were seen with, or none */
    txp_swell field;        /* what is fitted                                                */
    int parts;              /* components: 2, or 1 if only one wave is seen                  */
    double toward[2][2];    /* the directions of the components                              */
    double shift[2];        /* of the waves, in turns                                        */
    int unknowns;
    double *a, *b; /* unknowns * unknowns, unknowns */
} txp_waving;

/* Prepare a fit of the field to what the nodes see. 0: no memory. */
static int txp_waving_make(const txp_nodes *n, const txp_guess *g, txm_arena *arena, txp_waving *q) {
    memset(q, 0, sizeof *q);
    q->nodes = n;
    q->guess = g;
    txp_swell_make(n->gray->width, n->gray->height, &q->field);
    q->parts = n->waves;
    q->toward[0][0] = q->toward[1][1] = 1;
    if (q->parts == 1) {
        const txp_wave *w = &g->wave[0];
        const double length = sqrt(w->a * w->a + w->b * w->b);
        if (!(length > 0)) return 1;
        q->toward[0][0] = w->a / length;
        q->toward[0][1] = w->b / length;
    }
    q->unknowns = q->parts * q->field.across * q->field.down;
    const size_t count = (size_t)q->unknowns;
    q->a = (double *)txm_arena_alloc(arena, count * count, sizeof *q->a);
    q->b = (double *)txm_arena_alloc(arena, count, sizeof *q->b);
    return !arena->failed;
}

/* Add how the phase of a wave at a place depends on the field. */
static void txp_form_phase(const txp_waving *q, const txp_wave *w, txp_spot at, double sign,
                           txp_form *form) {
    const txp_swell *f = &q->field;
    double wx[4], wy[4], slope[4];
    const int i0 = txp_spline_weights((at.x + f->reach_x) / f->cell_x, f->across, wx, slope);
    const int j0 = txp_spline_weights((at.y + f->reach_y) / f->cell_y, f->down, wy, slope);
    for (int j = 0; j < 4; j++) {
        for (int i = 0; i < 4; i++) {
            for (int p = 0; p < q->parts; p++) {
                const double along = w->a * q->toward[p][0] + w->b * q->toward[p][1];
                form->at[form->count] = ((j0 + j) * f->across + i0 + i) * q->parts + p;
                form->value[form->count++] = sign * wx[i] * wy[j] * along;
            }
        }
    }
}

/* The equation form = value. */
static void txp_form_add(txp_waving *q, const txp_form *form, double value, double weight) {
    for (int i = 0; i < form->count; i++) {
        const double wi = weight * form->value[i];
        double *row = q->a + (size_t)form->at[i] * (size_t)q->unknowns;
        q->b[form->at[i]] += wi * value;
        for (int j = 0; j < form->count; j++)
            if (form->at[j] <= form->at[i]) row[form->at[j]] += wi * form->value[j];
    }
}

/* Second differences of the numbers of a field are small. */
static void txp_stiffen(txp_waving *q, double weight) {
    static const int steps[3][3][2] = {
        {{0, 0}, {1, 0}, {2, 0}}, {{0, 0}, {0, 1}, {0, 2}}, {{0, 0}, {1, 1}, {0, 0}}};
    const txp_swell *f = &q->field;
    for (int y = 0; y < f->down; y++) {
        for (int x = 0; x < f->across; x++) {
            for (int k = 0; k < 3 * q->parts; k++) {
                const int kind = k / q->parts, part = k % q->parts;
                const int(*s)[2] = steps[kind];
                const int wide = kind == 0 ? 2 : kind == 2, high = kind == 1 ? 2 : kind == 2;
                txp_form form;
                if (x + wide >= f->across || y + high >= f->down) continue;
                form.count = kind == 2 ? 4 : 3;
                for (int i = 0; i < 3; i++) {
                    form.at[i] = ((y + s[i][1]) * f->across + x + s[i][0]) * q->parts + part;
                    form.value[i] = i == 1 ? -2 : 1;
                }
                if (kind == 2) {
                    form.at[2] = (y * f->across + x + 1) * q->parts + part;
                    form.at[3] = ((y + 1) * f->across + x) * q->parts + part;
                    form.value[0] = form.value[1] = 1;
                    form.value[2] = form.value[3] = -1;
                }
                txp_form_add(q, &form, 0, kind == 2 ? 2 * weight : weight);
            }
        }
    }
    for (int i = 0; i < q->unknowns; i++)
        q->a[(size_t)i * (size_t)q->unknowns + (size_t)i] += 1e-3 * weight + 1e-9;
}

/* Solve: a is overwritten, b becomes the solution. */
static void txp_waving_solve(txp_waving *q) {
    const int n = q->unknowns;
    double *b = q->b;
    for (int i = 0; i < n; i++) {
        double *row = q->a + (size_t)i * (size_t)n;
        for (int j = 0; j <= i; j++) {
            const double *other = q->a + (size_t)j * (size_t)n;
            double sum = row[j];
            for (int k = 0; k < j; k++) sum -= row[k] * other[k];
            row[j] = i == j ? sqrt(fmax(sum, 1e-12)) : sum / other[j];
        }
    }
    for (int i = 0; i < n; i++) {
        const double *row = q->a + (size_t)i * (size_t)n;
        for (int k = 0; k < i; k++) b[i] -= row[k] * b[k];
        b[i] /= row[i];
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int k = i + 1; k < n; k++) b[i] -= q->a[(size_t)k * (size_t)n + (size_t)i] * b[k];
        b[i] /= q->a[(size_t)i * (size_t)n + (size_t)i];
    }
}

/* By how many turns the fitted field moves a wave at a place. */
static double txp_moves(const txp_waving *q, const txp_wave *w, txp_spot at) {
    double moved[2], m[4];
    txp_swell_at(&q->field, at.x, at.y, moved, m);
    return w->a * moved[0] + w->b * moved[1];
}

/* By how much a wave at a node lies beside tilt, lens and wave; the fitted field is left out, or in. */
static double txp_still_beside(const txp_waving *q, int node, int k, int with_field) {
    const txp_wave *w = &q->guess->wave[k];
    const txp_spot at = q->nodes->at[node];
    double moved[2], m[4], beside = q->nodes->sight[node][k].beside - q->shift[k];
    if (q->guess->view.field) {
        txp_swell_at(q->guess->view.field, at.x, at.y, moved, m);
        beside += w->a * moved[0] + w->b * moved[1];
    }
    return with_field ? beside - txp_moves(q, w, at) : beside;
}

/* In which of the two parts of the nodes a node is. */
static int txp_fold_of(const txp_nodes *n, int node) {
    return (node % n->across / (int)TXP_FOLD + node / n->across / (int)TXP_FOLD) & 1;
}

/* Equations of the nodes, or of pairs of neighbours; those of one part left out (-1: none). */
static void txp_waving_collect(txp_waving *q, int left_out, int differences) {
    const txp_nodes *n = q->nodes;
    const size_t count = (size_t)q->unknowns;
    memset(q->a, 0, count * count * sizeof *q->a);
    memset(q->b, 0, count * sizeof *q->b);
    for (int i = 0; i < n->across * n->down; i++) {
        for (int k = 0; k < n->waves && txp_fold_of(n, i) != left_out; k++) {
            const txp_wave *w = &q->guess->wave[k];
            const txp_sight *s = &n->sight[i][k];
            txp_form form;
            if (!(s->weight > 0)) continue;
            for (int d = 0; d < 2 && differences; d++) {
                const int j = d ? i + n->across : i + 1;
                if (d ? j >= n->across * n->down : j % n->across == 0) continue;
                const txp_sight *t = &n->sight[j][k];
                if (!(t->weight > 0) || txp_fold_of(n, j) == left_out) continue;
                form.count = 0;
                txp_form_phase(q, w, n->at[j], 1, &form);
                txp_form_phase(q, w, n->at[i], -1, &form);
                const double rest =
                    txp_rest(txp_still_beside(q, j, k, 1) - txp_still_beside(q, i, k, 1));
                const double r = rest / (2 * TXP_OUTLIER);
                txp_form_add(q, &form,
                             rest + txp_moves(q, w, n->at[j]) - txp_moves(q, w, n->at[i]),
                             s->weight * t->weight / (1 + r * r));
            }
            if (differences) continue;
            form.count = 0;
            txp_form_phase(q, w, n->at[i], 1, &form);
            const double rest = txp_rest(txp_still_beside(q, i, k, 1)), r = rest / TXP_OUTLIER;
            txp_form_add(q, &form, rest + txp_moves(q, w, n->at[i]),
                         s->weight * s->weight / (1 + r * r));
        }
    }
}

/* By how much each wave agrees, at the nodes of one part (-1: all), with what is fitted: sums of what
   agrees and of what there is are added. */
static void txp_waving_agree(const txp_waving *q, int part, int with_field, double sums[2][2]) {
    const txp_nodes *n = q->nodes;
    double sine, cosine;
    for (int i = 0; i < n->across * n->down; i++) {
        for (int k = 0; k < n->waves; k++) {
            if (part >= 0 && txp_fold_of(n, i) != part) continue;
            txm_sincos(2 * TXM_PI * txp_still_beside(q, i, k, with_field), &sine, &cosine);
            sums[k][0] += n->sight[i][k].weight * cosine;
            sums[k][1] += n->sight[i][k].weight;
        }
    }
}

/* The agreement of the wave that agrees least. */
static double txp_least_agreement(const txp_waving *q, double sums[2][2]) {
    double least = 1;
    for (int k = 0; k < q->nodes->waves; k++)
        least = fmin(least, sums[k][1] > 0 ? sums[k][0] / sums[k][1] : 0);
    return least;
}

/* Turn each wave so that what is left has the mean 0. */
static void txp_waving_turn(txp_waving *q, int left_out) {
    const txp_nodes *n = q->nodes;
    for (int k = 0; k < n->waves; k++) {
        double re = 0, im = 0, sine, cosine;
        for (int i = 0; i < n->across * n->down; i++) {
            if (txp_fold_of(n, i) == left_out) continue;
            txm_sincos(2 * TXM_PI * txp_still_beside(q, i, k, 1), &sine, &cosine);
            re += n->sight[i][k].weight * cosine;
            im += n->sight[i][k].weight * sine;
        }
        q->shift[k] += txp_turns(re, im);
    }
}

/* Fit the field; the nodes of one part are left out (-1: none). */
static void txp_waving_fit(txp_waving *q, double stiffness, int left_out) {
    memset(q->field.at, 0, sizeof q->field.at);
    q->shift[0] = q->shift[1] = 0;
    for (int round = 0; round < TXP_FIELD_FITS; round++) {
        txp_waving_collect(q, left_out, round < TXP_FIELD_FITS / 2);
        txp_stiffen(q, stiffness);
        txp_waving_solve(q);
        for (int i = 0; i < q->unknowns; i++) {
            double *at = q->field.at[i / q->parts];
            const double *toward = q->toward[i % q->parts];
            if (i % q->parts == 0) at[0] = at[1] = 0;
            for (int d = 0; d < 2; d++) at[d] += q->b[i] * toward[d];
        }
        txp_waving_turn(q, left_out);
    }
}

/* How well the parts agree that were left out in turn. */
static double txp_foresight(txp_waving *q, double stiffness) {
    double sums[2][2] = {{0, 0}, {0, 0}};
    for (int part = 0; part < 2; part++) {
        txp_waving_fit(q, stiffness, part);
        txp_waving_agree(q, part, 1, sums);
    }
    return txp_least_agreement(q, sums);
}

/* Is the field gentle all over the photograph? */
static int txp_is_gentle(const txp_swell *f) {
    enum { STEPS = 24 };
    for (int i = 0; i <= STEPS; i++) {
        for (int j = 0; j <= STEPS; j++) {
            double moved[2], m[4];
            txp_swell_at(f, (2.0 * i / (int)STEPS - 1) * f->reach_x,
                         (2.0 * j / (int)STEPS - 1) * f->reach_y, moved, m);
            for (int k = 0; k < 4; k++)
                if (!(fabs(m[k]) < TXP_STEEPEST)) return 0;
        }
    }
    return 1;
}

/* The stiffness with which a field predicts unseen nodes clearly better than none does, the stiffest
   unless a softer one is clearly better; 0: none. */
static double txp_best_stiffness(txp_waving *q) {
    double sums[2][2] = {{0, 0}, {0, 0}}, best = 0, stiffness = 0, tried = TXP_STIFFEST;
    txp_waving_agree(q, -1, 0, sums);
    const double before = txp_least_agreement(q, sums);
    if (1 - before < TXP_HELPS_LEAST) return 0;
    for (int i = 0; i < TXP_STIFFNESSES; i++, tried /= 4) {
        const double agreement = txp_foresight(q, tried);
        if (!(1 - agreement < TXP_SOFTER * (1 - best))) continue;
        best = agreement;
        stiffness = tried;
    }
    return best > TXP_FORESIGHT && 1 - best < TXP_HELPS * (1 - before) ? stiffness : 0;
}

/* Look for a field that helps; the guess was fitted without one. Then *field is it, the guess's view
   points to it and its waves are turned; if the second wave does not agree it is left out. *helps: is
   there one? 0: no memory. */
static int txp_find_field(txp_nodes *n, txm_env *env, txp_guess *g, txp_swell *field, int *helps) {
    txm_arena scratch;
    txp_waving q;
    txp_seeing seeing;
    double stiffness = 0;
    *helps = 0;
    seeing.nodes = n;
    seeing.guess = g;
    txp_clearer_first(g);
    txm_parallel_for(env, n->across * n->down, txp_see_node, &seeing);
    txm_arena_init(&scratch, env);
    for (; n->waves > 0; n->waves--) {
        if (!txp_waving_make(n, g, &scratch, &q)) {
            txm_arena_free(&scratch);
            return 0;
        }
        if (q.unknowns) stiffness = txp_best_stiffness(&q);
        if (stiffness > 0 || n->waves == 1) break;
    }
    for (int look = 0; look < TXP_FIELD_LOOKS && stiffness > 0; look++) {
        txp_waving_fit(&q, stiffness, -1);
        *field = q.field;
        g->view.field = field;
        for (int k = 0; k < n->waves; k++)
            g->wave[k].shift = txp_rest(g->wave[k].shift + q.shift[k]);
        txm_parallel_for(env, n->across * n->down, txp_see_node, &seeing);
    }
    *helps = stiffness > 0 && txp_is_gentle(field);
    txm_arena_free(&scratch);
    return 1;
}

#endif /* TEXPATCH_WAVY_H */
