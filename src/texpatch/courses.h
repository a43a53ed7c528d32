#ifndef TEXPATCH_COURSES_H
#define TEXPATCH_COURSES_H

#include "canvas.h"
#include "lattice.h"

/* ---- courses ------------------------------------------------------------------------------- */

/* Bricks, planks and roof tiles lie in courses. Their joints cover so little of the picture that it
   is much like itself moved along the courses by any length: which length is that of a brick says
   only what is left of the correlation once its mean along the courses is subtracted. And a mason
   may begin each course where he likes. Then no lattice holds for all of them, but each course has
   its own phase:

       |      |      |      |        phase 0
       ----------------------------
         |      |      |      |      phase 0.3
       ----------------------------
           |      |      |           phase 0.6                                                    */

/* ours, see docs/choices.md */
enum {
    TXP_RIDGES = 360,       /* directions in which courses are looked for                           */
    TXP_RIDGE_FROM = 3,     /* pixels: nearer than that everything is like itself                   */
    TXP_PROFILE_SIDE = 512, /* pixels: the finest level whose longer side is at most this is measured */
    TXP_TURNS = 24,         /* steps to each side by which the direction is corrected               */
    TXP_SLOTS = 8,          /* across one course: where it may begin                                */
    TXP_PROFILE_BINS = 64,  /* along one brick                                                      */
    TXP_LEAST_COURSES = 3,
    TXP_COURSE_UNITS = 3,   /* so many courses at most are one: bonds of unlike courses take turns   */
    TXP_ALIGNINGS = 3       /* rounds in which courses are aligned with their mean                   */
};
#define TXP_TURN_STEP 0.0015  /* radians: half a pixel across 340                                   */
#define TXP_RIDGE_CLEAR 0.35  /* least mean correlation along courses                                */
#define TXP_RIDGE_WIDE 1.5    /* pixels by which a step of the lattice may leave its course          */
#define TXP_PITCH_CLEAR 0.5   /* least correlation of the profile across, one course on              */
#define TXP_BRICK_CLEAR 0.3   /* least correlation of the courses, one brick on                      */
#define TXP_BRICK_SEEN 0.7    /* of the picture's length: the longest brick that is looked for       */
#define TXP_BRICK_SAME 0.1    /* of a brick: a step of the lattice this near to whole bricks is right */
#define TXP_PEAK_DIP 0.5      /* of a peak's height: before it the correlation is lower than that    */
#define TXP_COURSE_ALIKE 0.6  /* least mean correlation of a course with their mean, aligned         */
#define TXP_UNIT_GAIN 0.1     /* by which it must grow for more courses to be one                    */
#define TXP_COURSE_WHOLE 0.5  /* of a course must be in the picture                                  */
#define TXP_COURSE_EVEN 0.03  /* of a brick: phases as regular as this are a lattice                 */
#define TXP_COURSE_SEEN 0.33  /* of a piece's size: so far from its middle its courses count         */
#define TXP_COURSE_BREAK 2.0  /* square of pixels: what a course costs at most that is not its middle's */

/* x in 0..n-1. */
static inline int txp_modulo(double x, int n) {
    return (int)(x - n * floor(x / n));
}

/* The course of the exemplar that course k of the canvas is like. */
static inline int txp_course_model(const txp_courses *c, double k) {
    if (c->around) k = txp_modulo(k, c->around);
    return c->first + txp_modulo(k, c->cycle);
}

/* Where a piece goes: a place of the canvas in the sheet's lattice; the courses there, of its middle
   and to both sides, and their phases. */
typedef struct txp_goal {
    double x, y, course[3], phase[3];
} txp_goal;

static txp_goal txp_goal_make(const txp_stack *k, const txp_courses *c, double x, double y, int size) {
    const double across = fabs(k->inverse[2]) + fabs(k->inverse[3]), half = 0.5 * size;
    txp_goal g;
    memset(&g, 0, sizeof g);
    g.x = x;
    g.y = y;
    for (int i = 0; i < 3 && c->count; i++) {
        const double beside = (i == 0 ? 0 : i == 1 ? -1 : 1) * TXP_COURSE_SEEN * across * size;
        g.course[i] = floor(k->inverse[2] * (x + half) + k->inverse[3] * (y + half) - c->origin + beside);
        g.phase[i] = (double)c->phase[txp_course_model(c, g.course[i])];
    }
    return g;
}

/* By how much of a brick course i of the goal is beside that of the exemplar `moved` courses on, if a
   piece is moved along by u; 0 if there is no such course. */
static inline int txp_course_off(const txp_courses *c, const txp_goal *g, int i, double u, double moved,
                                 double *off) {
    const double own = g->course[i] + moved;
    if (own < 0 || own >= c->count) return 0;
    u -= (double)c->phase[(int)own] - g->phase[i];
    *off = u - floor(u + 0.5);
    return 1;
}

/* Move a place of the sheet to the nearest that fits lattice and bond. */
static void txp_snap(const txp_stack *k, const txp_courses *c, const txp_goal *g, int *x, int *y) {
    const double px = *x - g->x, py = *y - g->y;
    double dx, dy, off;
    if (c->count) {
        const double v = k->inverse[2] * px + k->inverse[3] * py, moved = floor(v + 0.5);
        if (!txp_course_off(c, g, 0, k->inverse[0] * px + k->inverse[1] * py, moved, &off)) return;
        dx = k->lattice[0] * off + k->lattice[2] * (v - moved);
        dy = k->lattice[1] * off + k->lattice[3] * (v - moved);
    } else {
        txp_from_lattice(k, px, py, &dx, &dy);
    }
    *x -= (int)floor(dx + 0.5);
    *y -= (int)floor(dy + 0.5);
}

/* The square of the distance from the nearest place that fits lattice and bond, which is what a place
   costs. The course of a piece's middle decides; of those beside it a part is added. */
static inline double txp_off_bond(const txp_stack *k, const txp_courses *c, const txp_goal *g, double x,
                                  double y) {
    const double px = x - g->x, py = y - g->y, *l = k->lattice;
    if (!c->count) return txp_off_lattice(k, px, py);
    const double v = k->inverse[2] * px + k->inverse[3] * py, moved = floor(v + 0.5);
    const double across = (v - moved) * (v - moved) * (l[2] * l[2] + l[3] * l[3]);
    const double u = k->inverse[0] * px + k->inverse[1] * py, brick = l[0] * l[0] + l[1] * l[1];
    double off, most = 0;
    if (across > (double)TXP_OFF_LATTICE || !txp_course_off(c, g, 0, u, moved, &off))
        return 2.0 * (int)TXP_OFF_LATTICE;
    const double own = across + off * off * brick; /* the steps are normal to each other */
    if (own > (double)TXP_OFF_LATTICE) return own;
    for (int i = 1; i < 3; i++) {
        if (!txp_course_off(c, g, i, u, moved, &off)) off = 0.5;
        most = fmax(most, off * off * brick);
    }
    return own + fmin(most, TXP_COURSE_BREAK);
}

/* ---- finding courses --------------------------------------------------------------------------- */

/* The correlation at any lag, linear between pixels; -2: out of reach. */
static double txp_correlated_at(const txp_correlation *k, double x, double y) {
    const int i = (int)floor(x), j = (int)floor(y);
    const double u = x - i, v = y - j;
    const double a = txp_correlated(k, i, j), b = txp_correlated(k, i + 1, j);
    const double c = txp_correlated(k, i, j + 1), d = txp_correlated(k, i + 1, j + 1);
    if (a < -1.5 || b < -1.5 || c < -1.5 || d < -1.5) return -2;
    return (1 - v) * ((1 - u) * a + u * b) + v * ((1 - u) * c + u * d);
}

/* The direction in which a picture is most like itself, and how much on average. */
static double txp_ridge_find(const txp_correlation *k, double d[2]) {
    double best = -1;
    for (int i = 0; i < TXP_RIDGES; i++) {
        double sine, cosine, sum = 0;
        int count = 0;
        txm_sincos(TXM_PI * i / (int)TXP_RIDGES, &sine, &cosine);
        for (int t = TXP_RIDGE_FROM;; t++, count++) {
            const double c = txp_correlated_at(k, t * cosine, t * sine);
            if (c < -1.5) break;
            sum += c;
        }
        if (count < (int)TXP_RIDGE_FROM || sum <= best * count) continue;
        best = sum / count;
        d[0] = cosine;
        d[1] = sine;
    }
    return best;
}

/* The gray of a pixel of the stack, -128..127: of the first map that counts. */
static inline int txp_gray_of(const txp_source *s, const uint8_t *p) {
    int sum = p[0], n = 1; /* one map at least has a weight */
    for (; n < s->guide_at && n < 3; n++) sum += p[n];
    return sum / n - 128;
}

/* What is measured of the courses, in a gray picture. */
typedef struct txp_masonry {
    int width, height;
    float *gray;
    double along[2], normal[2]; /* directions along and across the courses                       */
    double lowest;              /* across, of the picture's pixels                               */
    int bins;                   /* across                                                        */
    double *mean;               /* of each                                                       */
    int *count;                 /* pixels of each                                                */
    double pitch;               /* pixels across                                                 */
} txp_masonry;

static inline double txp_across(const txp_masonry *m, int x, int y) {
    return m->normal[0] * x + m->normal[1] * y - m->lowest;
}

/* The means along the courses, if they go along a direction. Returns how much they vary. */
static double txp_masonry_profile(txp_masonry *m, double dx, double dy) {
    double energy = 0;
    m->normal[0] = -dy;
    m->normal[1] = dx;
    const double w = m->normal[0] * (m->width - 1), h = m->normal[1] * (m->height - 1);
    m->lowest = fmin(w, 0) + fmin(h, 0);
    m->bins = (int)(fabs(w) + fabs(h)) + 2;
    memset(m->mean, 0, (size_t)m->bins * sizeof *m->mean);
    memset(m->count, 0, (size_t)m->bins * sizeof *m->count);
    for (int y = 0; y < m->height; y++) {
        for (int x = 0; x < m->width; x++) {
            const int b = txm_clampi((int)(txp_across(m, x, y) + 0.5), 0, m->bins - 1);
            m->mean[b] += (double)m->gray[(size_t)y * (size_t)m->width + (size_t)x];
            m->count[b]++;
        }
    }
    for (int b = 0; b < m->bins; b++) {
        energy += m->count[b] ? m->mean[b] * m->mean[b] / m->count[b] : 0;
        m->mean[b] /= m->count[b] ? m->count[b] : 1;
    }
    return energy;
}

/* Correct the direction of the courses: along it the means vary most. */
static void txp_masonry_turn(txp_masonry *m) {
    double best = -1, dx = m->along[0], dy = m->along[1];
    for (int i = -TXP_TURNS; i <= TXP_TURNS; i++) {
        double sine, cosine;
        txm_sincos(TXP_TURN_STEP * i, &sine, &cosine);
        const double x = m->along[0] * cosine - m->along[1] * sine;
        const double y = m->along[0] * sine + m->along[1] * cosine;
        const double energy = txp_masonry_profile(m, x, y);
        if (energy <= best) continue;
        best = energy;
        dx = x;
        dy = y;
    }
    m->along[0] = dx;
    m->along[1] = dy;
    txp_masonry_profile(m, dx, dy);
}

/* Signals along the same axis, one after the other, of which some values are not known. */
typedef struct txp_signals {
    int count, length;
    const double *value; /* count * length */
    const int *known;    /* the same; 0: it is not */
} txp_signals;

/* The correlation of signals with themselves, moved; -2: out of reach. */
static double txp_signals_alike(const txp_signals *s, int by) {
    double n = 0, a = 0, b = 0, aa = 0, bb = 0, ab = 0;
    if (by < 0 || by + 2 > s->length) return -2;
    for (int k = 0; k < s->count; k++) {
        const double *p = s->value + (size_t)k * (size_t)s->length;
        const int *is_known = s->known + (size_t)k * (size_t)s->length;
        for (int i = 0; i + by < s->length; i++) {
            if (!is_known[i] || !is_known[i + by]) continue;
            n += 1;
            a += p[i];
            b += p[i + by];
            aa += p[i] * p[i];
            bb += p[i + by] * p[i + by];
            ab += p[i] * p[i + by];
        }
    }
    if (!(n > 1)) return 0;
    aa -= a * a / n;
    bb -= b * b / n;
    return aa > 0 && bb > 0 ? (ab - a * b / n) / sqrt(aa * bb) : 0;
}

/* The maximum within reach of a lag, with its fraction. */
static double txp_signals_peak(const txp_signals *s, double near_by, int reach, double *height) {
    const int middle = (int)(near_by + 0.5);
    int best = middle;
    for (int i = middle - reach; i <= middle + reach; i++)
        if (txp_signals_alike(s, i) > txp_signals_alike(s, best)) best = i;
    const double l = txp_signals_alike(s, best - 1), c = txp_signals_alike(s, best);
    const double r = txp_signals_alike(s, best + 1);
    *height = c;
    return best + (l > -2 && r > -2 && l + r < 2 * c ? 0.5 * (l - r) / (l + r - 2 * c) : 0);
}

/* The shortest period of signals up to `most`; 0: they have none as clear as that. */
static double txp_signals_period(const txp_signals *s, int most, double clear) {
    double best = 0, height;
    for (int turn = 0; turn < 2; turn++) {
        double before = 1, c = txp_signals_alike(s, 1), least = 1;
        for (int i = 1; i < most; i++) {
            const double after = txp_signals_alike(s, i + 1);
            least = fmin(least, c);
            const int is_peak = c >= before && c >= after && least < TXP_PEAK_DIP * c;
            if (is_peak && !turn) best = fmax(best, c);
            if (is_peak && turn && c >= TXP_LATTICE_ALIKE * best) {
                double period = txp_signals_peak(s, i, 1, &height);
                for (int k = 2; k * period < most; k++) { /* farther peaks tell more exactly */
                    const double far_peak = txp_signals_peak(s, k * period, 2, &height);
                    if (height < TXP_FAR_ALIKE * c) break;
                    period = far_peak / k;
                }
                return period;
            }
            before = c;
            c = after;
        }
        if (best < clear) return 0;
    }
    return 0;
}

/* What differs along the courses: sums over thin strips along them. */
typedef struct txp_strips {
    int count, length; /* strips; pixels along                                                    */
    double left;       /* along, of the first of them                                             */
    double *sum;
    int *pixels;       /* of each sum                                                             */
} txp_strips;

static int txp_strips_make(const txp_masonry *m, txm_arena *arena, txp_strips *s) {
    const double w = m->along[0] * (m->width - 1), h = m->along[1] * (m->height - 1);
    s->left = fmin(w, 0) + fmin(h, 0);
    s->length = (int)(fabs(w) + fabs(h)) + 2;
    s->count = (int)(m->bins / m->pitch * (int)TXP_SLOTS) + 1;
    s->sum = (double *)txm_arena_zero(arena, (size_t)s->count * (size_t)s->length, sizeof *s->sum);
    s->pixels =
        (int *)txm_arena_zero(arena, (size_t)s->count * (size_t)s->length, sizeof *s->pixels);
    if (arena->failed) return 0;
    for (int y = 0; y < m->height; y++) {
        for (int x = 0; x < m->width; x++) {
            const double v = txp_across(m, x, y), u = m->along[0] * x + m->along[1] * y - s->left;
            const int b = txm_clampi((int)(v + 0.5), 0, m->bins - 1);
            const int strip = txm_clampi((int)(v / m->pitch * (int)TXP_SLOTS), 0, s->count - 1);
            const size_t at = (size_t)strip * (size_t)s->length +
                              (size_t)txm_clampi((int)(u + 0.5), 0, s->length - 1);
            s->sum[at] += (double)m->gray[(size_t)y * (size_t)m->width + (size_t)x] - m->mean[b];
            s->pixels[at]++;
        }
    }
    return 1;
}

/* The mean of `strips` strips from one on, less its own mean over `wide` pixels to both sides: joints
   count, not the tones of bricks. Returns its pixels. */
static int txp_course_signal(const txp_strips *s, int from, int strips, int wide, double *value,
                             int *known, double *sums) {
    int all = 0;
    memset(value, 0, (size_t)s->length * sizeof *value);
    memset(known, 0, (size_t)s->length * sizeof *known);
    for (int k = from < 0 ? 0 : from; k < from + strips && k < s->count; k++) {
        for (int i = 0; i < s->length; i++) {
            value[i] += s->sum[(size_t)k * (size_t)s->length + (size_t)i];
            known[i] += s->pixels[(size_t)k * (size_t)s->length + (size_t)i];
        }
    }
    sums[0] = sums[s->length + 1] = 0; /* of values; of how many are known */
    for (int i = 0; i < s->length; i++) {
        if (known[i]) value[i] /= known[i];
        all += known[i];
        sums[i + 1] = sums[i] + value[i];
        sums[s->length + 2 + i] = sums[s->length + 1 + i] + (known[i] > 0);
    }
    for (int i = 0; i < s->length; i++) {
        const int l = i - wide < 0 ? 0 : i - wide, r = i + wide + 1 < s->length ? i + wide + 1 : s->length;
        if (known[i])
            value[i] -= (sums[r] - sums[l]) / (sums[s->length + 1 + r] - sums[s->length + 1 + l]);
    }
    return all;
}

/* The courses, units of some strips each. */
typedef struct txp_bond {
    int count;        /* of those that are whole                                                  */
    double origin;    /* of the first, in units                                                   */
    txp_signals signals;
    double *phase;    /* of each, in bins                                                         */
    double alike;     /* mean correlation with their mean, aligned                                */
} txp_bond;

/* Find where units of some strips begin, and their signals; bond->count is 0 if there are too few.
   0: no memory. */
static int txp_bond_units(const txp_masonry *m, const txp_strips *s, int strips, txm_arena *arena,
                          txp_bond *b) {
    const int units = s->count / strips + 2, wide = (int)m->pitch + 1;
    const size_t length = (size_t)s->length;
    double best = -1;
    int start = 0, most = 0, first = -1;
    memset(b, 0, sizeof *b);
    double *value = (double *)txm_arena_alloc(arena, (size_t)units * length, sizeof *value);
    int *known = (int *)txm_arena_alloc(arena, (size_t)units * length, sizeof *known);
    double *sums = (double *)txm_arena_alloc(arena, 2 * (length + 1), sizeof *sums);
    if (arena->failed) return 0;
    for (int from = 0; from < strips; from++) {
        double energy = 0;
        int whole = 0;
        for (int i = -1; i + 1 < units; i++) {
            const int all = txp_course_signal(s, from + i * strips, strips, wide, value, known, sums);
            if (all > whole) whole = all;
            for (size_t k = 0; k < length; k++) energy += value[k] * value[k] * known[k];
        }
        if (energy <= best) continue;
        best = energy;
        start = from;
        most = whole;
    }
    for (int i = -1; i + 1 < units; i++) { /* whole ones follow each other */
        const size_t at = (size_t)b->count * length;
        const int all = txp_course_signal(s, start + i * strips, strips, wide, value + at, known + at, sums);
        if (all >= TXP_COURSE_WHOLE * most) {
            if (first < 0) first = i;
            b->count++;
        } else if (first >= 0) {
            break;
        }
    }
    b->origin = first + (double)start / strips;
    if (b->count < (int)TXP_LEAST_COURSES) b->count = 0;
    b->signals.count = b->count;
    b->signals.length = s->length;
    b->signals.value = value;
    b->signals.known = known;
    return 1;
}

/* A signal folded to one brick. */
static void txp_bond_profile(const txp_signals *s, int k, double period, double *profile) {
    int count[TXP_PROFILE_BINS] = {0};
    double mean = 0;
    memset(profile, 0, TXP_PROFILE_BINS * sizeof *profile);
    for (int i = 0; i < s->length; i++) {
        const size_t at = (size_t)k * (size_t)s->length + (size_t)i;
        const double u = i / period - floor(i / period);
        const int bin = txm_clampi((int)(u * (int)TXP_PROFILE_BINS), 0, TXP_PROFILE_BINS - 1);
        if (!s->known[at]) continue;
        profile[bin] += s->value[at];
        count[bin]++;
    }
    for (int b = 0; b < TXP_PROFILE_BINS; b++) {
        if (count[b]) profile[b] /= count[b];
        mean += profile[b] / (int)TXP_PROFILE_BINS;
    }
    for (int b = 0; b < TXP_PROFILE_BINS; b++) profile[b] -= mean;
}

/* By how many bins a profile lies after a model, and how alike they are then. */
static double txp_profile_align(const double *profile, const double *model, double *alike) {
    double c[TXP_PROFILE_BINS], pp = 0, mm = 0;
    int best = 0;
    for (int i = 0; i < TXP_PROFILE_BINS; i++) {
        c[i] = 0;
        pp += profile[i] * profile[i];
        mm += model[i] * model[i];
        for (int b = 0; b < TXP_PROFILE_BINS; b++)
            c[i] += profile[(b + i) % TXP_PROFILE_BINS] * model[b];
        if (c[i] > c[best]) best = i;
    }
    const double l = c[(best + TXP_PROFILE_BINS - 1) % TXP_PROFILE_BINS];
    const double r = c[(best + 1) % TXP_PROFILE_BINS];
    *alike = pp > 0 && mm > 0 ? c[best] / sqrt(pp * mm) : 0;
    return best + (l + r < 2 * c[best] ? 0.5 * (l - r) / (l + r - 2 * c[best]) : 0);
}

/* Align all units with their mean. 0: no memory. */
static int txp_bond_align(txp_bond *b, double period, txm_arena *arena) {
    double model[TXP_PROFILE_BINS], most = -1;
    double(*profile)[TXP_PROFILE_BINS] = (double(*)[TXP_PROFILE_BINS])txm_arena_alloc(
        arena, (size_t)b->count, sizeof *profile);
    b->phase = (double *)txm_arena_alloc(arena, (size_t)b->count, sizeof *b->phase);
    if (arena->failed) return 0;
    for (int i = 0; i < b->count; i++) {
        double energy = 0;
        txp_bond_profile(&b->signals, i, period, profile[i]);
        for (int k = 0; k < TXP_PROFILE_BINS; k++) energy += profile[i][k] * profile[i][k];
        if (energy > most) memcpy(model, profile[i], sizeof model);
        most = fmax(most, energy);
    }
    for (int round = 0; round < TXP_ALIGNINGS; round++) {
        double sum[TXP_PROFILE_BINS] = {0};
        b->alike = 0;
        for (int i = 0; i < b->count; i++) {
            double alike;
            b->phase[i] = txp_profile_align(profile[i], model, &alike);
            b->alike += alike / b->count;
            const int by = (int)floor(b->phase[i] + 0.5) + TXP_PROFILE_BINS;
            for (int k = 0; k < TXP_PROFILE_BINS; k++)
                sum[k] += profile[i][(k + by) % TXP_PROFILE_BINS];
        }
        memcpy(model, sum, sizeof model);
    }
    return 1;
}

/* The shift from one course to the next with which the phases are nearly those of a lattice, in steps;
   *off: the largest difference from it. */
static double txp_bond_slope(const txp_bond *b, double *off) {
    double best = 0;
    *off = 1;
    for (int t = 0; t < 4 * (int)TXP_PROFILE_BINS; t++) {
        const double slope = (double)t / (4 * (int)TXP_PROFILE_BINS);
        double least = 0, most = 0;
        for (int i = 1; i < b->count; i++) {
            double d = (b->phase[i] - b->phase[0]) / (int)TXP_PROFILE_BINS - slope * i;
            d -= floor(d + 0.5);
            least = fmin(least, d);
            most = fmax(most, d);
        }
        if (0.5 * (most - least) >= *off) continue;
        *off = 0.5 * (most - least);
        best = slope;
    }
    return best;
}

/* How far the change from course i to course j is from any between two neighbours. */
static double txp_bond_break(const txp_courses *c, int i, int j) {
    double least = 1;
    for (int k = 0; k + 1 < c->count; k++) {
        double d = (double)c->phase[j] - (double)c->phase[i] -
                   ((double)c->phase[k + 1] - (double)c->phase[k]);
        d -= floor(d + 0.5);
        least = fmin(least, fabs(d));
    }
    return least;
}

/* Choose the courses that are repeated, so that where they begin again the bond looks like one that
   is there. around: see txp_courses. */
static void txp_courses_cycle(txp_courses *c, int around) {
    double best = 2;
    c->around = around;
    for (int cycle = c->count; cycle >= 2 && cycle > c->count / 2; cycle--) {
        for (int first = 0; first + cycle <= c->count; first++) {
            const int last = around ? (around - 1) % cycle : cycle - 1;
            double off = txp_bond_break(c, first + last, first);
            if (!around || around > cycle)
                off = fmax(off, txp_bond_break(c, first + cycle - 1, first));
            if (off >= best) continue;
            best = off;
            c->first = first;
            c->cycle = cycle;
        }
    }
}

/* The shortest step of a lattice along the courses; 0: it has none. v: in pixels of level top. */
static double txp_step_along(const double v[4], const double d[2]) {
    double shortest = 0;
    for (int i = -3; i <= 3; i++) {
        for (int j = -3; j <= 3; j++) {
            const double x = i * v[0] + j * v[2], y = i * v[1] + j * v[3];
            const double length = x * d[0] + y * d[1];
            if (length < (double)TXP_RIDGE_FROM || fabs(y * d[0] - x * d[1]) > TXP_RIDGE_WIDE) continue;
            if (!(shortest > 0) || length < shortest) shortest = length;
        }
    }
    return shortest;
}

/* Is a step along the courses one that shows in them? brick: as long as those are; 0: of any length. */
static int txp_step_shows(const txp_signals *s, double step, double brick) {
    double height;
    if (!(step > 0)) return 0;
    if (!(brick > 0)) {
        if (step >= TXP_BRICK_SEEN * s->length) return 1; /* too few are seen to tell */
        txp_signals_peak(s, step, 2, &height);
        return height >= 0.5 * TXP_BRICK_CLEAR;
    }
    const double bricks = step / brick;
    return bricks > 0.5 && fabs(bricks - floor(bricks + 0.5)) <= TXP_BRICK_SAME;
}

/* The gray picture of a level, in which courses are measured; d: their direction. 0: no memory. */
static int txp_masonry_make(const txp_source *s, int level, const double d[2], txm_arena *scratch,
                            txp_masonry *m) {
    const txp_stack *t = &s->stack[level];
    memset(m, 0, sizeof *m);
    m->width = t->wide[0];
    m->height = t->high[0];
    const size_t bins = (size_t)m->width + (size_t)m->height + 2; /* whatever the direction */
    m->gray = (float *)txm_arena_alloc(scratch, (size_t)m->width * (size_t)m->height, sizeof *m->gray);
    m->mean = (double *)txm_arena_alloc(scratch, bins, sizeof *m->mean);
    m->count = (int *)txm_arena_alloc(scratch, bins, sizeof *m->count);
    if (scratch->failed) return 0;
    for (int y = 0; y < m->height; y++)
        for (int x = 0; x < m->width; x++)
            m->gray[(size_t)y * (size_t)m->width + (size_t)x] =
                (float)txp_gray_of(s, txp_stack_at(s, t, x, y));
    memcpy(m->along, d, sizeof m->along);
    txp_masonry_turn(m);
    return 1;
}

/* The bond of units of one course or, if courses take turns, of more. 0: no memory. */
static int txp_bond_find(const txp_masonry *m, const txp_strips *s, double brick, txm_arena *scratch,
                         txp_bond *bond, int *courses) {
    memset(bond, 0, sizeof *bond);
    *courses = 1;
    for (int k = 1; k <= TXP_COURSE_UNITS; k++) {
        txp_bond more;
        if (!txp_bond_units(m, s, k * (int)TXP_SLOTS, scratch, &more)) return 0;
        if (!more.count) break;
        if (!txp_bond_align(&more, brick, scratch)) return 0;
        if (k > 1 && more.alike < bond->alike + TXP_UNIT_GAIN) continue;
        *bond = more;
        *courses = k;
    }
    return 1;
}

/* Look for courses where a correlation at level top is high in one direction; v, *has: the lattice
   found in it, which is replaced if it does not know how long a brick is. 0: no memory. */
static int txp_courses_find(const txp_source *s, const txp_correlation *k, int top, double v[4], int *has,
                            txp_courses *c, txm_arena *memory, txm_arena *scratch) {
    double d[2] = {1, 0}, off;
    txp_masonry m;
    txp_strips strips;
    txp_bond bond;
    int level = 0, courses;
    if (txp_ridge_find(k, d) < TXP_RIDGE_CLEAR) return 1;
    while (level < top && (s->stack[level].wide[0] > (int)TXP_PROFILE_SIDE ||
                           s->stack[level].high[0] > (int)TXP_PROFILE_SIDE))
        level++;
    if (!txp_masonry_make(s, level, d, scratch, &m)) return 0;
    txp_signals across = {1, m.bins, m.mean, m.count};
    m.pitch = txp_signals_period(&across, m.bins / (int)TXP_LEAST_COURSES, TXP_PITCH_CLEAR);
    if (!(m.pitch > 0)) return 1;
    if (!txp_strips_make(&m, scratch, &strips)) return 0;
    if (!txp_bond_units(&m, &strips, TXP_SLOTS, scratch, &bond)) return 0;
    if (!bond.count) return 1;
    const double brick =
        txp_signals_period(&bond.signals, (int)(TXP_BRICK_SEEN * strips.length), TXP_BRICK_CLEAR);
    const double part = (double)(1 << level) / (1 << top); /* pixels of level top */
    if (*has && txp_step_shows(&bond.signals, txp_step_along(v, m.along) / part, brick)) return 1;
    if (!(brick > 0)) { /* planks of any length */
        *has = 1;
        for (int i = 0; i < 2; i++) {
            v[i] = 0;
            v[2 + i] = m.normal[i] * m.pitch * part;
        }
        return 1;
    }
    if (!txp_bond_find(&m, &strips, brick, scratch, &bond, &courses)) return 0;
    if (bond.alike < TXP_COURSE_ALIKE) return 1;
    *has = 1;
    for (int i = 0; i < 2; i++) {
        v[i] = m.along[i] * brick * part;
        v[2 + i] = m.normal[i] * courses * m.pitch * part;
    }
    const double slope = txp_bond_slope(&bond, &off);
    if (off <= TXP_COURSE_EVEN) { /* each course is moved as much: a lattice */
        for (int i = 0; i < 2; i++) v[2 + i] += (slope > 0.5 ? slope - 1 : slope) * v[i];
        return 1;
    }
    c->phase = (float *)txm_arena_alloc(memory, (size_t)bond.count, sizeof *c->phase);
    if (!c->phase) return 0;
    c->count = bond.count;
    c->origin = bond.origin + m.lowest / (courses * m.pitch);
    for (int i = 0; i < c->count; i++) {
        const double p = bond.phase[i] / (int)TXP_PROFILE_BINS;
        c->phase[i] = txm_float(p - floor(p));
    }
    txp_courses_cycle(c, 0);
    return 1;
}

#endif /* TEXPATCH_COURSES_H */
