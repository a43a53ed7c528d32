#ifndef TEXPATCH_PHASE_H
#define TEXPATCH_PHASE_H

#include "view.h"

/* ---- phases: where exactly the waves of a view lie in a photograph ------------------------- */

/* At each node of a grid over the photograph the gray picture is multiplied by the wave that the
   view predicts there: the angle of the sum is by how much the wave lies beside its prediction.
   The view and its waves are fitted to these angles by least squares: first to the differences of
   neighbouring nodes, which do not mind errors of whole turns, then to the angles themselves. */

/* ours, see docs/choices.md */
enum {
    TXP_NODES = 16,    /* along the longer side                                                  */
    TXP_VIEWS = 4,     /* numbers of a view                                                       */
    TXP_NUMBERS = 10,  /* and three of each wave                                     */
    TXP_FIT_ROUNDS = 7 /* the first half with differences                                        */
};
#define TXP_LISTENING 1.25   /* periods: from the middle of a node to the rim of its window       */
#define TXP_LISTENING_LEAST 0.12 /* half sides: the same, at least                              */
#define TXP_HOPELESS 0.25      /* agreement after the first half: no more is tried             */
#define TXP_OUTLIER 0.08     /* turns: residuals above count less and less                       */

/* One wave at one node. */
typedef struct txp_sight {
    double beside; /* turns, -0.5..0.5                                            */
    double weight; /* 0..1: how much of the contrast there is this wave; 0: none  */
} txp_sight;

typedef struct txp_nodes {
    const txp_gray *gray;
    int across, down, waves;
    double half;
    txp_spot *at;            /* across * down  */
    txp_sight (*sight)[2];
} txp_nodes;

/* The angle of (x, y) in turns, -0.5..0.5: atan2 of the same bits everywhere. */
static double txp_turns(double x, double y) {
    const double ax = fabs(x), ay = fabs(y), most = ax > ay ? ax : ay, least = ax > ay ? ay : ax;
    if (!(most > 0)) return 0;
    double t = least / most;
    for (int i = 0; i < 2; i++) t = t / (1 + sqrt(1 + t * t)); /* the tangent of half the angle */
    const double tt = t * t;
    double sum = 0;
    for (int k = 15; k > 0; k -= 2) sum = 1.0 / k - tt * sum;
    double angle = 4 * t * sum / (2 * TXM_PI);
    if (ay > ax) angle = 0.25 - angle;
    if (x < 0) angle = 0.5 - angle;
    return y < 0 ? -angle : angle;
}

/* The phase of a wave at a place of the photograph, and the local frequency there. */
static int txp_wave_phase(const txp_view *v, const txp_wave *w, double x, double y, double *phase,
                          double frequency[2]) {
    double place[2], m[4];
    if (!txp_view_place(v, x, y, place, m)) return 0;
    *phase = w->a * place[0] + w->b * place[1] + w->shift;
    frequency[0] = m[0] * w->a + m[2] * w->b;
    frequency[1] = m[1] * w->a + m[3] * w->b;
    return 1;
}

/* Nodes over a gray picture. 0: no memory. */
static int txp_nodes_make(const txp_gray *gray, txm_arena *arena, txp_nodes *n) {
    const int w = gray->width, h = gray->height, longer = w > h ? w : h;
    n->gray = gray;
    n->half = 0.5 * longer;
    n->across = txm_clampi((int)((int64_t)TXP_NODES * w / longer), 4, TXP_NODES);
    n->down = txm_clampi((int)((int64_t)TXP_NODES * h / longer), 4, TXP_NODES);
    const size_t count = (size_t)n->across * (size_t)n->down;
    n->at = (txp_spot *)txm_arena_alloc(arena, count, sizeof *n->at);
    n->sight = (txp_sight(*)[2])txm_arena_zero(arena, count, sizeof *n->sight);
    if (arena->failed) return 0;
    for (int i = 0; i < n->across * n->down; i++) {
        const int column = i % n->across, row = i / n->across;
        n->at[i].x = ((column + 0.5) / n->across - 0.5) * w / n->half;
        n->at[i].y = ((row + 0.5) / n->down - 0.5) * h / n->half;
    }
    return 1;
}

/* How a wave lies at a place (pixels of the gray picture): its phase in turns, its local frequency in
   cycles per pixel. */
static int txp_lies(const txp_nodes *n, const txp_view *v, const txp_wave *w, double x, double y,
                    double *phase, double frequency[2]) {
    const txp_gray *g = n->gray;
    if (!txp_wave_phase(v, w, (x + 0.5 - 0.5 * g->width) / n->half,
                        (y + 0.5 - 0.5 * g->height) / n->half, phase, frequency))
        return 0;
    frequency[0] /= n->half;
    frequency[1] /= n->half;
    return 1;
}

/* What a node sees of a wave. */
static txp_sight txp_see(const txp_nodes *n, const txp_view *v, const txp_wave *w, txp_spot at) {
    txp_sight sight = {0, 0};
    const txp_gray *g = n->gray;
    const double cx = at.x * n->half + 0.5 * g->width - 0.5;
    const double cy = at.y * n->half + 0.5 * g->height - 0.5;
    double phase, f[2], sine, cosine, re = 0, im = 0, bells = 0, energy = 0;
    if (!txp_lies(n, v, w, cx, cy, &phase, f)) return sight;
    const double speed = sqrt(f[0] * f[0] + f[1] * f[1]);
    if (!(speed > 1e-4) || fabs(f[0]) > 0.45 || fabs(f[1]) > 0.45) return sight;
    const double reach =
        fmin(fmax(TXP_LISTENING / speed, fmax(5, TXP_LISTENING_LEAST * n->half)), 0.25 * n->half);
    const int x0 = (int)fmax(ceil(cx - reach), 0), x1 = (int)fmin(floor(cx + reach), g->width - 1);
    const int y0 = (int)fmax(ceil(cy - reach), 0), y1 = (int)fmin(floor(cy + reach), g->height - 1);
    for (int y = y0; y <= y1; y++) {
        const double q = (y - cy) / reach, by = (1 - q * q) * (1 - q * q);
        const float *row = g->at + (size_t)y * (size_t)g->width;
        if (!txp_lies(n, v, w, cx, y, &phase, f)) continue;
        phase += f[0] * (x0 - cx);
        phase -= floor(phase);
        txm_sincos(2 * TXM_PI * f[0], &sine, &cosine);
        const double turn_re = cosine, turn_im = sine;
        txm_sincos(2 * TXM_PI * phase, &sine, &cosine);
        double c = cosine, s = sine;
        for (int x = x0; x <= x1; x++) {
            const double u = (x - cx) / reach, bell = by * (1 - u * u) * (1 - u * u);
            const double value = (double)row[x], next = c * turn_re - s * turn_im;
            re += bell * value * c;
            im -= bell * value * s;
            bells += bell;
            energy += bell * value * value;
            s = c * turn_im + s * turn_re;
            c = next;
        }
    }
    if (!(energy > 0)) return sight;
    /* the value is like cos(2 pi (phase + beside)) */
    sight.beside = txp_turns(re, im);
    sight.weight = sqrt((re * re + im * im) / (bells * energy));
    return sight;
}

typedef struct txp_seeing {
    txp_nodes *nodes;
    const txp_guess *guess;
} txp_seeing;

static void txp_see_node(void *context, int i) {
    const txp_seeing *q = (const txp_seeing *)context;
    const txp_nodes *n = q->nodes;
    for (int k = 0; k < 2; k++) {
        txp_sight none = {0, 0};
        n->sight[i][k] =
            k < n->waves ? txp_see(n, &q->guess->view, &q->guess->wave[k], n->at[i]) : none;
    }
}

/* ---- least squares -------------------------------------------------------------------------- */

static double txp_rest(double turns) {
    return turns - floor(turns + 0.5);
}

/* Solve A x = b for a symmetric positive A of size n, which is overwritten; b becomes x. */
static void txp_solve(double a[TXP_NUMBERS][TXP_NUMBERS], double *b, int n) {
    for (int i = 0; i < n; i++) {
        for (int j = 0; j <= i; j++) {
            double sum = a[i][j];
            for (int k = 0; k < j; k++) sum -= a[i][k] * a[j][k];
            a[i][j] = i == j ? sqrt(fmax(sum, 1e-12)) : sum / a[j][j];
        }
    }
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < i; k++) b[i] -= a[i][k] * b[k];
        b[i] /= a[i][i];
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int k = i + 1; k < n; k++) b[i] -= a[k][i] * b[k];
        b[i] /= a[i][i];
    }
}

static double *txp_number_of(txp_guess *g, int k) {
    txp_view *v = &g->view;
    if (k < TXP_VIEWS) return k < 2 ? (k ? &v->tilt_y : &v->tilt_x) : k > 2 ? &v->curl : &v->bend;
    txp_wave *w = &g->wave[(k - TXP_VIEWS) / 3];
    const int part = (k - TXP_VIEWS) % 3;
    return part == 0 ? &w->a : part == 1 ? &w->b : &w->shift;
}

/* The derivatives of the phase of a wave at a place by all numbers. */
static int txp_phase_slopes(const txp_guess *g, int wave, txp_spot at, double slopes[TXP_NUMBERS]) {
    const double little = 1e-4;
    double place[2], m[4], frequency[2];
    if (!txp_view_place(&g->view, at.x, at.y, place, m)) return 0;
    for (int k = 0; k < TXP_NUMBERS; k++) slopes[k] = 0;
    slopes[TXP_VIEWS + 3 * wave] = place[0];
    slopes[TXP_VIEWS + 3 * wave + 1] = place[1];
    slopes[TXP_VIEWS + 3 * wave + 2] = 1;
    for (int k = 0; k < TXP_VIEWS; k++) {
        txp_guess other = *g;
        double above, below;
        *txp_number_of(&other, k) += little;
        if (!txp_wave_phase(&other.view, &g->wave[wave], at.x, at.y, &above, frequency)) return 0;
        *txp_number_of(&other, k) -= 2 * little;
        if (!txp_wave_phase(&other.view, &g->wave[wave], at.x, at.y, &below, frequency)) return 0;
        slopes[k] = (above - below) / (2 * little);
    }
    return 1;
}

/* One equation: slopes . x = beside. */
typedef struct txp_equations {
    double a[TXP_NUMBERS][TXP_NUMBERS], b[TXP_NUMBERS];
} txp_equations;

static void txp_add_equation(txp_equations *q, const double *slopes, double beside, double weight) {
    for (int i = 0; i < TXP_NUMBERS; i++) {
        q->b[i] += weight * slopes[i] * beside;
        for (int j = 0; j <= i; j++) q->a[i][j] += weight * slopes[i] * slopes[j];
    }
}

/* A number that stays as it is. */
static void txp_hold(txp_equations *q, int k) {
    for (int i = 0; i < TXP_NUMBERS; i++) q->a[i > k ? i : k][i > k ? k : i] = 0;
    q->a[k][k] = 1;
    q->b[k] = 0;
}

/* Equations of all nodes, or of all pairs of neighbours. */
static void txp_collect(const txp_nodes *n, const txp_guess *g, int differences, txp_equations *q) {
    memset(q, 0, sizeof *q);
    for (int i = 0; i < n->across * n->down; i++) {
        for (int k = 0; k < n->waves; k++) {
            const txp_sight *s = &n->sight[i][k];
            double slopes[TXP_NUMBERS], other[TXP_NUMBERS];
            if (!(s->weight > 0) || !txp_phase_slopes(g, k, n->at[i], slopes)) continue;
            if (!differences) {
                const double r = s->beside / TXP_OUTLIER;
                txp_add_equation(q, slopes, s->beside, s->weight * s->weight / (1 + r * r));
                continue;
            }
            for (int d = 0; d < 2; d++) {
                const int j = d ? i + n->across : i + 1;
                if (d ? j >= n->across * n->down : j % n->across == 0) continue;
                const txp_sight *t = &n->sight[j][k];
                if (!(t->weight > 0) || !txp_phase_slopes(g, k, n->at[j], other)) continue;
                for (int c = 0; c < TXP_NUMBERS; c++) other[c] -= slopes[c];
                const double step = txp_rest(t->beside - s->beside), r = step / (2 * TXP_OUTLIER);
                txp_add_equation(q, other, step, s->weight * t->weight / (1 + r * r));
            }
        }
    }
}

/* By how much the phases of a wave agree with it over the picture, -1..1. */
static double txp_agreement(const txp_nodes *n, int k) {
    double re = 0, sum = 0, sine, cosine;
    for (int i = 0; i < n->across * n->down; i++) {
        const txp_sight *s = &n->sight[i][k];
        txm_sincos(2 * TXM_PI * s->beside, &sine, &cosine);
        re += s->weight * cosine;
        sum += s->weight;
    }
    return sum > 0 ? re / sum : 0;
}

static double txp_mean_weight(const txp_nodes *n, int k) {
    double sum = 0;
    for (int i = 0; i < n->across * n->down; i++) sum += n->sight[i][k].weight;
    return sum / (n->across * n->down);
}

/* Turn each wave so that the mean of its residuals is 0. */
static void txp_set_shifts(const txp_nodes *n, txp_guess *g) {
    for (int k = 0; k < n->waves; k++) {
        double re = 0, im = 0, sine, cosine;
        for (int i = 0; i < n->across * n->down; i++) {
            const txp_sight *s = &n->sight[i][k];
            txm_sincos(2 * TXM_PI * s->beside, &sine, &cosine);
            re += s->weight * cosine;
            im += s->weight * sine;
        }
        g->wave[k].shift = txp_rest(g->wave[k].shift + txp_turns(re, im));
    }
}

static void txp_clearer_first(txp_guess *g) {
    const txp_wave first = g->wave[0];
    if (!(g->wave[1].clear > first.clear)) return;
    g->wave[0] = g->wave[1];
    g->wave[1] = first;
}

/* How well the waves agree with what the nodes see, and how much of the contrast they are. */
static void txp_measure(const txp_nodes *n, txp_guess *g) {
    for (int k = 0; k < 2; k++) {
        g->wave[k].clear = k < n->waves ? txp_agreement(n, k) : 0;
        g->wave[k].contrast = k < n->waves ? txp_mean_weight(n, k) : 0;
    }
}

/* Fit the view and its waves to the phases; clear of each wave receives how well they agree.
   has_lens 0: the lens stays as it is. */
static void txp_fit_phases(txp_nodes *n, txm_env *env, int has_lens, txp_guess *g) {
    txp_seeing seeing;
    txp_equations q;
    seeing.nodes = n;
    seeing.guess = g;
    n->waves = g->wave[1].clear > 0 ? 2 : 1;
    for (int round = 0; round < TXP_FIT_ROUNDS; round++) {
        const int differences = round < TXP_FIT_ROUNDS / 2;
        txm_parallel_for(env, n->across * n->down, txp_see_node, &seeing);
        if (round == TXP_FIT_ROUNDS / 2) {
            txp_set_shifts(n, g);
            txm_parallel_for(env, n->across * n->down, txp_see_node, &seeing);
            double most = 0;
            for (int k = 0; k < n->waves; k++) most = fmax(most, txp_agreement(n, k));
            if (most < TXP_HOPELESS) break;
        }
        txp_collect(n, g, differences, &q);
        for (int k = 0; k < TXP_NUMBERS; k++) q.a[k][k] += (k < TXP_VIEWS ? 1e-2 : 1e-6) + 1e-4 * q.a[k][k];
        for (int k = 2; k < TXP_VIEWS && !has_lens; k++) txp_hold(&q, k);
        txp_solve(q.a, q.b, TXP_NUMBERS);
        for (int k = 0; k < TXP_NUMBERS; k++) *txp_number_of(g, k) += q.b[k];
    }
    txm_parallel_for(env, n->across * n->down, txp_see_node, &seeing);
    txp_measure(n, g);
}

#endif /* TEXPATCH_PHASE_H */
