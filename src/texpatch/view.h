#ifndef TEXPATCH_VIEW_H
#define TEXPATCH_VIEW_H

#include "field.h"

/* ---- how a plane was photographed ---------------------------------------------------------- */

/* From a place (x, y) of the photograph to the plane, both centred on the middle and equal there
   to first order: the lens is undone, q = (x, y) (1 + bend r^2 + curl r^4), then the perspective,
   (X, Y) = q / (1 + tilt_x q_x + tilt_y q_y), then what the field adds, if there is one. A periodic
   wall is a sum of plane waves in (X, Y). */
typedef struct txp_view {
    double tilt_x, tilt_y, bend, curl;
    const txp_swell *field; /* NULL: none */
} txp_view;

/* A wave on the plane: phase = a X + b Y + shift, in turns; clear: how well it is seen, in the
   measure of the stage; contrast: how much of the contrast it is, 0..1. */
typedef struct txp_wave {
    double a, b, shift, clear, contrast;
} txp_wave;

/* The place on the plane, and the derivatives m = (dX/dx, dX/dy, dY/dx, dY/dy). 0: the place lies
   beyond the horizon, or where the lens folds. */
static int txp_view_place(const txp_view *v, double x, double y, double place[2], double m[4]) {
    const double rr = x * x + y * y, lens = 1 + rr * (v->bend + rr * v->curl);
    const double slope = 2 * v->bend + 4 * rr * v->curl; /* of the lens, by r, over r */
    const double qx = x * lens, qy = y * lens, depth = 1 + v->tilt_x * qx + v->tilt_y * qy;
    const double lxx = lens + slope * x * x, lxy = slope * x * y, lyy = lens + slope * y * y;
    if (!(depth > 0.05) || !(lxx * lyy - lxy * lxy > 0.02) || !(lxx > 0)) return 0;
    const double px = qx / depth, py = qy / depth;
    const double xx = (1 - px * v->tilt_x) / depth, xy = -px * v->tilt_y / depth;
    const double yx = -py * v->tilt_x / depth, yy = (1 - py * v->tilt_y) / depth;
    place[0] = px;
    place[1] = py;
    m[0] = xx * lxx + xy * lxy;
    m[1] = xx * lxy + xy * lyy;
    m[2] = yx * lxx + yy * lxy;
    m[3] = yx * lxy + yy * lyy;
    if (v->field) {
        double moved[2], slopes[4];
        txp_swell_at(v->field, x, y, moved, slopes);
        for (int d = 0; d < 2; d++) place[d] += moved[d];
        for (int i = 0; i < 4; i++) m[i] += slopes[i];
    }
    return 1;
}

/* ---- the search: which view makes the spectra of all windows agree? ------------------------ */

/* ours, see docs/choices.md */
enum {
    TXP_TILT_STEPS = 8,    /* to each side of 0                                                   */
    TXP_BEND_STEPS = 2,    /* the same                                                            */
    TXP_ASKED_WINDOWS = 4, /* across and down: windows whose peaks are tried as waves             */
    TXP_ASKED_TIPS = 4,    /* of the peaks of each of them                                        */
    TXP_GUESSES = 12,      /* of each tilt_x the best guesses are kept                            */
    TXP_OFFERS = 4,        /* of each scale, with different waves, the phases are looked at        */
    TXP_REFINED = 24,      /* of all guesses, the best, are refined                               */
    TXP_MOST_WINDOWS = TXP_WINDOWS * TXP_WINDOWS
};
#define TXP_TILT_STEP 0.1
#define TXP_TILT_MOST 0.85  /* |tilt_x| + |tilt_y| in the corners of the picture                  */
#define TXP_BEND_STEP 0.09
#define TXP_PEAK_MOST 24.0  /* the limit of what a magnitude counts, so that no window decides alone */
#define TXP_ALIKE 0.15      /* difference of one wave, of its length                               */
#define TXP_APART 0.34      /* least sine of the angle between two waves                          */

typedef struct txp_guess {
    txp_view view;
    txp_wave wave[2];
    double score;
} txp_guess;

/* A view, prepared for the windows: from (a, b) to the local frequency of each. */
typedef struct txp_prepared {
    double m[TXP_MOST_WINDOWS][4];
    int good[TXP_MOST_WINDOWS];
} txp_prepared;

/* The distortion (1 + k r^2) has an inverse that begins 1 - k r^2 + 3 k^2 r^4. */
static double txp_usual_curl(double bend) {
    return 3 * bend * bend;
}

static void txp_prepare(const txp_spectra *s, const txp_view *v, txp_prepared *p) {
    double place[2];
    memset(p->good, 0, sizeof p->good);
    for (int i = 0; i < s->across * s->down; i++)
        p->good[i] = txp_view_place(v, s->middles[i].x, s->middles[i].y, place, p->m[i]);
}

/* How clearly all windows show a wave: the mean of the magnitudes, over those that can show it. */
static double txp_wave_clear(const txp_spectra *s, const txp_prepared *p, double a, double b) {
    const int count = s->across * s->down;
    const double lowest = TXP_LEAST_WAVES * s->half / s->side;
    double sum = 0;
    int seen = 0;
    for (int i = 0; i < count; i++) {
        if (!p->good[i]) continue;
        const double *m = p->m[i];
        const double wx = m[0] * a + m[2] * b, wy = m[1] * a + m[3] * b;
        if (wx * wx + wy * wy < lowest * lowest) continue;
        const double z = txp_spectrum_at(s, i, wx, wy);
        if (!(z > 0)) continue;
        sum += z * TXP_PEAK_MOST / (z + TXP_PEAK_MOST);
        seen++;
    }
    return 2 * seen > count ? sum / sqrt((double)count * seen) : 0;
}

/* Small: of two views that are as good the flatter one is taken. */
static double txp_view_penalty(const txp_view *v) {
    return 1 - 0.06 * (v->tilt_x * v->tilt_x + v->tilt_y * v->tilt_y) - 0.6 * v->bend * v->bend;
}

static double txp_guess_score(const txp_spectra *s, const txp_guess *g, int waves) {
    txp_prepared p;
    double sum = 0;
    txp_prepare(s, &g->view, &p);
    for (int k = 0; k < waves; k++) sum += txp_wave_clear(s, &p, g->wave[k].a, g->wave[k].b);
    return sum * txp_view_penalty(&g->view);
}

/* The wave on the plane that window i sees with the frequency w. */
static int txp_wave_from(const double m[4], const double w[2], txp_wave *wave) {
    const double det = m[0] * m[3] - m[1] * m[2];
    if (!(fabs(det) > 1e-6) || !(w[0] * w[0] + w[1] * w[1] > 0)) return 0;
    wave->a = (m[3] * w[0] - m[2] * w[1]) / det;
    wave->b = (m[0] * w[1] - m[1] * w[0]) / det;
    return 1;
}

typedef struct txp_hunt {
    const txp_spectra *spectra;
    double reach_x, reach_y; /* of the picture, in half sides                                    */
    txp_guess (*best)[TXP_GUESSES];
} txp_hunt;

/* Put a guess into a list sorted by score, unless a like one is there that is better. */
static void txp_keep_guess(txp_guess *list, int count, const txp_guess *g) {
    int k = count - 1;
    if (!(g->score > list[k].score)) return;
    for (; k > 0 && list[k - 1].score < g->score; k--) list[k] = list[k - 1];
    list[k] = *g;
}

static int txp_asked(int count, int i) {
    return count <= TXP_ASKED_WINDOWS ? i : i * (count - 1) / (TXP_ASKED_WINDOWS - 1);
}

/* All guesses of one view. */
static void txp_try_view(const txp_hunt *q, const txp_view *v, txp_guess *list) {
    const txp_spectra *s = q->spectra;
    const int across = s->across < TXP_ASKED_WINDOWS ? s->across : TXP_ASKED_WINDOWS;
    const int down = s->down < TXP_ASKED_WINDOWS ? s->down : TXP_ASKED_WINDOWS;
    const double penalty = txp_view_penalty(v);
    txp_prepared p;
    txp_guess best;
    memset(&best, 0, sizeof best);
    best.view = *v;
    txp_prepare(s, v, &p);
    for (int i = 0; i < across * down; i++) {
        const int at =
            txp_asked(s->down, i / across) * s->across + txp_asked(s->across, i % across);
        if (!p.good[at]) continue;
        for (int t = 0; t < TXP_ASKED_TIPS; t++) {
            txp_wave wave = {0, 0, 0, 0, 0};
            if (!txp_wave_from(p.m[at], s->tips[at][t], &wave)) continue;
            const double score = txp_wave_clear(s, &p, wave.a, wave.b) * penalty;
            if (!(score > best.score)) continue;
            best.score = score;
            best.wave[0] = wave;
        }
    }
    txp_keep_guess(list, TXP_GUESSES, &best);
}

static void txp_try_column(void *context, int column) {
    const txp_hunt *q = (const txp_hunt *)context;
    txp_guess *list = q->best[column];
    txp_view v;
    memset(list, 0, TXP_GUESSES * sizeof *list);
    v.field = NULL;
    v.tilt_x = (column - TXP_TILT_STEPS) * TXP_TILT_STEP;
    for (int row = -TXP_TILT_STEPS; row <= TXP_TILT_STEPS; row++) {
        v.tilt_y = row * TXP_TILT_STEP;
        if (fabs(v.tilt_x) * q->reach_x + fabs(v.tilt_y) * q->reach_y > TXP_TILT_MOST) continue;
        for (int k = -TXP_BEND_STEPS; k <= TXP_BEND_STEPS; k++) {
            v.bend = k * TXP_BEND_STEP;
            v.curl = txp_usual_curl(v.bend);
            txp_try_view(q, &v, list);
        }
    }
}

/* Climb to the nearest maximum: each number in turn up or down, by steps that are halved. */
static void txp_climb(const txp_spectra *s, txp_guess *g, int waves) {
    double step[7] = {0.05, 0.05, 0.04, 0, 0, 0, 0};
    double *number[7] = {&g->view.tilt_x, &g->view.tilt_y, &g->view.bend, &g->wave[0].a,
                         &g->wave[0].b,   &g->wave[1].a,   &g->wave[1].b};
    for (int k = 3; k < 7; k++) step[k] = 0.5 * s->half / s->side;
    g->score = txp_guess_score(s, g, waves);
    for (int round = 0, halvings = 0; round < 60 && halvings < 6; round++) {
        int better = 0;
        for (int k = 0; k < 3 + 2 * waves; k++) {
            for (int sign = -1; sign <= 1; sign += 2) {
                const double old = *number[k];
                *number[k] += sign * step[k];
                g->view.curl = txp_usual_curl(g->view.bend);
                const double score = txp_guess_score(s, g, waves);
                if (score > g->score) {
                    g->score = score;
                    better = 1;
                    break;
                }
                *number[k] = old;
                g->view.curl = txp_usual_curl(g->view.bend);
            }
        }
        if (better) continue;
        halvings++;
        for (int k = 0; k < 7; k++) step[k] *= 0.5;
    }
}

/* The clearest wave that is not along the first one. */
static void txp_second_wave(const txp_spectra *s, txp_guess *g) {
    const txp_wave *first = &g->wave[0];
    txp_prepared p;
    txp_prepare(s, &g->view, &p);
    memset(&g->wave[1], 0, sizeof g->wave[1]);
    for (int i = 0; i < s->across * s->down; i++) {
        for (int t = 0; t < TXP_TIPS && p.good[i]; t++) {
            txp_wave w = {0, 0, 0, 0, 0};
            if (!txp_wave_from(p.m[i], s->tips[i][t], &w)) continue;
            const double cross = first->a * w.b - first->b * w.a;
            if (cross * cross < TXP_APART * TXP_APART * (w.a * w.a + w.b * w.b) *
                                    (first->a * first->a + first->b * first->b))
                continue;
            w.clear = txp_wave_clear(s, &p, w.a, w.b);
            if (w.clear > g->wave[1].clear) g->wave[1] = w;
        }
    }
}

typedef struct txp_climbers {
    const txp_spectra *spectra;
    txp_guess *list;
} txp_climbers;

static void txp_climb_one(void *context, int i) {
    const txp_climbers *c = (const txp_climbers *)context;
    if (c->list[i].score > 0) txp_climb(c->spectra, &c->list[i], 1);
}

/* Are these two waves one wave, or nearly? */
static int txp_same_wave(const txp_wave *p, const txp_wave *q) {
    const double pp = p->a * p->a + p->b * p->b, qq = q->a * q->a + q->b * q->b;
    const double sign = p->a * q->a + p->b * q->b < 0 ? -1 : 1;
    const double a = p->a - sign * q->a, b = p->b - sign * q->b;
    return a * a + b * b < TXP_ALIKE * TXP_ALIKE * fmin(pp, qq);
}

/* The best views and waves of one scale, the best first; score 0: none. */
static void txp_search_view(const txp_spectra *s, txm_env *env, txp_guess out[TXP_OFFERS]) {
    enum { COLUMNS = 2 * TXP_TILT_STEPS + 1 };
    txp_guess best[COLUMNS][TXP_GUESSES], list[TXP_REFINED];
    txp_hunt q;
    txp_climbers climbers;
    txp_prepared p;
    q.spectra = s;
    q.reach_x = 0.5 * s->gray->width / s->half;
    q.reach_y = 0.5 * s->gray->height / s->half;
    q.best = best;
    memset(list, 0, sizeof list);
    txm_parallel_for(env, COLUMNS, txp_try_column, &q);
    for (int i = 0; i < COLUMNS * (int)TXP_GUESSES; i++)
        txp_keep_guess(list, TXP_REFINED, &best[i / TXP_GUESSES][i % TXP_GUESSES]);
    climbers.spectra = s;
    climbers.list = list;
    txm_parallel_for(env, TXP_REFINED, txp_climb_one, &climbers);
    memset(out, 0, TXP_OFFERS * sizeof *out);
    for (int k = 0; k < TXP_OFFERS; k++) {
        for (int i = 0; i < TXP_REFINED; i++) {
            int is_new = list[i].score > out[k].score;
            for (int j = 0; j < k && is_new; j++)
                is_new = !txp_same_wave(&out[j].wave[0], &list[i].wave[0]);
            if (is_new) out[k] = list[i];
        }
    }
    for (int k = 0; k < TXP_OFFERS; k++) {
        if (!(out[k].score > 0)) continue;
        txp_second_wave(s, &out[k]);
        txp_climb(s, &out[k], 2);
        txp_prepare(s, &out[k].view, &p);
        for (int i = 0; i < 2; i++)
            out[k].wave[i].clear = txp_wave_clear(s, &p, out[k].wave[i].a, out[k].wave[i].b);
    }
}

#endif /* TEXPATCH_VIEW_H */
