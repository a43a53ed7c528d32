#ifndef TEXPATCH_LATTICE_H
#define TEXPATCH_LATTICE_H

#include "config.h"

/* ---- the lattice ------------------------------------------------------------------------- */

/* From the nearest point of the lattice to the offset (x, y), in pixels. */
static inline void txp_from_lattice(const txp_stack *k, double x, double y, double *dx,
                                    double *dy) {
    double u = k->inverse[0] * x + k->inverse[1] * y, v = k->inverse[2] * x + k->inverse[3] * y;
    u -= floor(u + 0.5);
    v -= floor(v + 0.5);
    *dx = k->lattice[0] * u + k->lattice[2] * v;
    *dy = k->lattice[1] * u + k->lattice[3] * v;
}

/* The square of that distance. */
static inline double txp_off_lattice(const txp_stack *k, double x, double y) {
    double dx, dy;
    txp_from_lattice(k, x, y, &dx, &dy);
    return dx * dx + dy * dy;
}

/* ---- finding the lattice of an exemplar ------------------------------------------------- */

/* ours, see docs/choices.md; correlations lie in -1..1 */
enum { TXP_PEAKS = 40 };         /* highest peaks of the correlation that are looked at         */
#define TXP_LATTICE_CLEAR 0.25   /* least mean correlation at the points of a lattice           */
#define TXP_LATTICE_ALIKE 0.85   /* of the best lattice's: of those above this the smallest     */
#define TXP_STEP_CLEAR 0.3       /* least correlation at its two steps                          */
#define TXP_STEP_ALIKE 0.65      /* the same, of the strongest peak                             */
#define TXP_FAR_ALIKE 0.7        /* of the steps': least correlation at whole multiples of them */
#define TXP_RANDOM 0.26          /* strongest peak below which there is no long-range order     */

/* The autocorrelation of a picture for all lags |dx| <= reach_x, 0 <= dy <= reach_y. */
typedef struct txp_correlation {
    const int16_t *gray; /* -128..127 */
    int width, height, reach_x, reach_y;
    float *at; /* (2 reach_x + 1) x (reach_y + 1) */
} txp_correlation;

static inline double txp_correlated(const txp_correlation *k, int dx, int dy) {
    if (dy < 0) {
        dx = -dx;
        dy = -dy;
    }
    if (dx < -k->reach_x || dx > k->reach_x || dy > k->reach_y) return -2;
    return k->at[dy * (2 * k->reach_x + 1) + dx + k->reach_x];
}

/* One row of lags, normalised over the overlapping pixels. The sums are exact. */
static void txp_correlate_row(void *context, int dy) {
    const txp_correlation *k = (const txp_correlation *)context;
    for (int dx = -k->reach_x; dx <= k->reach_x; dx++) {
        const int x0 = dx < 0 ? -dx : 0, x1 = dx > 0 ? k->width - dx : k->width;
        const double n = (double)(x1 - x0) * (k->height - dy);
        int64_t a = 0, b = 0, aa = 0, bb = 0, ab = 0;
        for (int y = 0; y + dy < k->height; y++) {
            const int16_t *u = k->gray + (ptrdiff_t)y * k->width;
            const int16_t *v = u + (ptrdiff_t)dy * k->width + dx;
            int32_t ra = 0, rb = 0, raa = 0, rbb = 0, rab = 0;
            for (int x = x0; x < x1; x++) {
                ra += u[x];
                rb += v[x];
                raa += u[x] * u[x];
                rbb += v[x] * v[x];
                rab += u[x] * v[x];
            }
            a += ra;
            b += rb;
            aa += raa;
            bb += rbb;
            ab += rab;
        }
        const double va = (double)aa - (double)a * (double)a / n;
        const double vb = (double)bb - (double)b * (double)b / n;
        const double cov = (double)ab - (double)a * (double)b / n;
        k->at[dy * (2 * k->reach_x + 1) + dx + k->reach_x] =
            va > 0 && vb > 0 ? txm_float(cov / sqrt(va * vb)) : 0;
    }
}

/* mean correlation at all points of the lattice (a, b) within reach, each the best of 3 x 3 lags */
static double txp_lattice_score(const txp_correlation *k, const double a[2], const double b[2]) {
    double sum = 0;
    int count = 0;
    for (int i = -8; i <= 8; i++) {
        for (int j = -8; j <= 8; j++) {
            const int x = (int)floor(i * a[0] + j * b[0] + 0.5);
            const int y = (int)floor(i * a[1] + j * b[1] + 0.5);
            if (y < 0 || (y == 0 && x <= 0) || y > k->reach_y || x < -k->reach_x || x > k->reach_x)
                continue;
            double best = -2;
            for (int d = 0; d < 9; d++)
                best = fmax(best, txp_correlated(k, x + d % 3 - 1, y + d / 3 - 1));
            sum += best;
            count++;
        }
    }
    return count ? sum / count : 0;
}

/* The maximum of the correlation near p, with subpixel accuracy by parabolas. */
static void txp_refine_peak(const txp_correlation *k, double p[2]) {
    int x = (int)floor(p[0] + 0.5), y = (int)floor(p[1] + 0.5), bx = x, by = y;
    for (int d = 0; d < 9; d++) {
        const int u = x + d % 3 - 1, v = y + d / 3 - 1;
        if (txp_correlated(k, u, v) > txp_correlated(k, bx, by)) {
            bx = u;
            by = v;
        }
    }
    const double c = txp_correlated(k, bx, by);
    const double l = txp_correlated(k, bx - 1, by), r = txp_correlated(k, bx + 1, by);
    const double t = txp_correlated(k, bx, by - 1), d = txp_correlated(k, bx, by + 1);
    p[0] = bx;
    p[1] = by;
    if (l > -2 && r > -2 && l + r < 2 * c) p[0] += 0.5 * (l - r) / (l + r - 2 * c);
    if (t > -2 && d > -2 && t + d < 2 * c) p[1] += 0.5 * (t - d) / (t + d - 2 * c);
}

/* The shortest basis of the same lattice (Gauss). */
static void txp_reduce_basis(double a[2], double b[2]) {
    for (int i = 0; i < 100; i++) {
        const double aa = a[0] * a[0] + a[1] * a[1], bb = b[0] * b[0] + b[1] * b[1];
        if (bb < aa) {
            for (int c = 0; c < 2; c++) {
                const double t = a[c];
                a[c] = b[c];
                b[c] = t;
            }
            continue;
        }
        const double m = floor((a[0] * b[0] + a[1] * b[1]) / aa + 0.5);
        if (m > -0.5 && m < 0.5) return;
        b[0] -= m * a[0];
        b[1] -= m * a[1];
    }
}

/* Does what has this lattice repeat across its courses only? */
static inline int txp_is_free(const double v[4]) {
    return v[0] == 0 && v[1] == 0;
}

static double txp_det(const double *a, const double *b) {
    return a[0] * b[1] - a[1] * b[0];
}

/* Find the lattice in a correlation. 1: there is one. *strongest: the highest peak. */
static int txp_lattice_find(const txp_correlation *k, double out[4], double *strongest) {
    int px[TXP_PEAKS] = {0}, py[TXP_PEAKS] = {0}, count = 0;
    double pc[TXP_PEAKS] = {0}, mean = 0;
    const int wide = 2 * k->reach_x + 1;
    for (int i = 0; i < wide * (k->reach_y + 1); i++) mean += fabs((double)k->at[i]);
    mean /= wide * (k->reach_y + 1);
    for (int y = 0; y <= k->reach_y; y++) {
        for (int x = -k->reach_x; x <= k->reach_x; x++) {
            const double c = txp_correlated(k, x, y);
            int is_peak = x * x + y * y >= 16 && !(y == 0 && x < 0);
            for (int d = 0; d < 9 && is_peak; d++)
                is_peak = d == 4 || txp_correlated(k, x + d % 3 - 1, y + d / 3 - 1) <= c;
            if (!is_peak) continue;
            int at = count < TXP_PEAKS ? count++ : TXP_PEAKS;
            while (at > 0 && pc[at - 1] < c) {
                if (at < TXP_PEAKS) {
                    px[at] = px[at - 1];
                    py[at] = py[at - 1];
                    pc[at] = pc[at - 1];
                }
                at--;
            }
            if (at < TXP_PEAKS) {
                px[at] = x;
                py[at] = y;
                pc[at] = c;
            }
        }
    }
    *strongest = count ? pc[0] : 0;
    double best = 0, area = 1e30, scores[TXP_PEAKS][TXP_PEAKS];
    int bi = -1, bj = -1;
    for (int i = 0; i < count; i++) {
        for (int j = i + 1; j < count; j++) {
            double a[2] = {(double)px[i], (double)py[i]}, b[2] = {(double)px[j], (double)py[j]};
            scores[i][j] = -2;
            txp_reduce_basis(a, b);
            const double la = sqrt(a[0] * a[0] + a[1] * a[1]), lb = sqrt(b[0] * b[0] + b[1] * b[1]);
            if (la < 4 || fabs(txp_det(a, b)) < 0.5 * la * lb) continue;
            scores[i][j] = txp_lattice_score(k, a, b);
            if (scores[i][j] > best) best = scores[i][j];
        }
    }
    for (int i = 0; i < count; i++) {
        for (int j = i + 1; j < count; j++) {
            double a[2] = {(double)px[i], (double)py[i]}, b[2] = {(double)px[j], (double)py[j]};
            const double size = fabs(txp_det(a, b));
            if (scores[i][j] < TXP_LATTICE_ALIKE * best || size >= area) continue;
            area = size;
            bi = i;
            bj = j;
        }
    }
    if (bi < 0 || best <= TXP_LATTICE_CLEAR || best <= 2 * mean) return 0;
    double a[2] = {(double)px[bi], (double)py[bi]}, b[2] = {(double)px[bj], (double)py[bj]};
    txp_reduce_basis(a, b);
    txp_refine_peak(k, a);
    txp_refine_peak(k, b);
    const double ca = txp_correlated(k, (int)floor(a[0] + 0.5), (int)floor(a[1] + 0.5));
    const double cb = txp_correlated(k, (int)floor(b[0] + 0.5), (int)floor(b[1] + 0.5));
    if (fmin(ca, cb) < TXP_STEP_ALIKE * *strongest || fmin(ca, cb) <= TXP_STEP_CLEAR) return 0;
    /* farther points of the lattice determine the steps more exactly */
    for (int t = 2; t <= 8; t++) {
        for (int c = 0; c < 2; c++) {
            double *v = c ? b : a, far_peak[2] = {v[0] * t, v[1] * t};
            const double x = far_peak[0], y = far_peak[1];
            if (fabs(x) > k->reach_x - 1 || fabs(y) > k->reach_y - 1) continue;
            txp_refine_peak(k, far_peak);
            const double ex = far_peak[0] - x, ey = far_peak[1] - y;
            if (ex * ex + ey * ey > 1.5 * 1.5) continue;
            if (txp_correlated(k, (int)floor(far_peak[0] + 0.5), (int)floor(far_peak[1] + 0.5)) <
                TXP_FAR_ALIKE * fmin(ca, cb))
                continue;
            v[0] = far_peak[0] / t;
            v[1] = far_peak[1] / t;
        }
    }
    out[0] = a[0];
    out[1] = a[1];
    out[2] = b[0];
    out[3] = b[1];
    return 1;
}

/* Set the lattice of a level of the stack; v: its steps, in pixels of level 0. If the first is 0 all
   places along the courses are as good. */
static void txp_lattice_set(txp_stack *k, const double v[4], double scale) {
    for (int i = 0; i < 4; i++) k->lattice[i] = v[i] * scale;
    if (txp_is_free(v)) {
        const double square = k->lattice[2] * k->lattice[2] + k->lattice[3] * k->lattice[3];
        k->inverse[0] = k->inverse[1] = 0;
        k->inverse[2] = k->lattice[2] / square;
        k->inverse[3] = k->lattice[3] / square;
        return;
    }
    const double det = k->lattice[0] * k->lattice[3] - k->lattice[1] * k->lattice[2];
    k->inverse[0] = k->lattice[3] / det;
    k->inverse[1] = -k->lattice[2] / det;
    k->inverse[2] = -k->lattice[1] / det;
    k->inverse[3] = k->lattice[0] / det;
}

#endif /* TEXPATCH_LATTICE_H */
