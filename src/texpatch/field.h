#ifndef TEXPATCH_FIELD_H
#define TEXPATCH_FIELD_H

#include "spectra.h"

/* ---- a smooth field of displacements -------------------------------------------------------- */

/* What tilt and lens leave over: walls that bulge, photographs that were put together from several.
   The displacement on the plane at a place of the photograph, as a cubic B-spline of few cells. */

/* ours, see docs/choices.md */
enum {
    TXP_CELLS_ALONG = 7,                   /* of the spline, along the longer side of the photograph */
    TXP_KNOTS = TXP_CELLS_ALONG + 3,       /* numbers along it                                       */
    TXP_FIELD_MOST = TXP_KNOTS * TXP_KNOTS /* numbers of one component, at most                      */
};

typedef struct txp_swell {
    int across, down;        /* numbers along the sides */
    double reach_x, reach_y; /* the photograph goes from -reach to reach */
    double cell_x, cell_y;
    double at[TXP_FIELD_MOST][2];
} txp_swell;

/* A field of zeros over a photograph. */
static void txp_swell_make(int width, int height, txp_swell *f) {
    const int longer = width > height ? width : height, most = TXP_CELLS_ALONG;
    const int cells_x = txm_clampi((int)((int64_t)most * width / longer), 1, most);
    const int cells_y = txm_clampi((int)((int64_t)most * height / longer), 1, most);
    memset(f, 0, sizeof *f);
    f->across = cells_x + 3;
    f->down = cells_y + 3;
    f->reach_x = (double)width / longer;
    f->reach_y = (double)height / longer;
    f->cell_x = 2 * f->reach_x / cells_x;
    f->cell_y = 2 * f->reach_y / cells_y;
}

/* The four weights of a cubic B-spline at t, in cells, and their slopes; returns the first number. */
static int txp_spline_weights(double t, int numbers, double w[4], double slope[4]) {
    const int first = txm_clampi((int)floor(t), 0, numbers - 4);
    const double u = fmin(fmax(t - first, 0), 1), v = 1 - u;
    w[0] = v * v * v / 6;
    w[1] = (3 * u * u * u - 6 * u * u + 4) / 6;
    w[2] = (3 * v * v * v - 6 * v * v + 4) / 6;
    w[3] = u * u * u / 6;
    slope[0] = -0.5 * v * v;
    slope[1] = 1.5 * u * u - 2 * u;
    slope[2] = 2 * v - 1.5 * v * v;
    slope[3] = 0.5 * u * u;
    return first;
}

/* The displacement at a place; m: its derivatives, as in txp_view_place. */
static void txp_swell_at(const txp_swell *f, double x, double y, double moved[2], double m[4]) {
    double wx[4], wy[4], sx[4], sy[4];
    const int i0 = txp_spline_weights((x + f->reach_x) / f->cell_x, f->across, wx, sx);
    const int j0 = txp_spline_weights((y + f->reach_y) / f->cell_y, f->down, wy, sy);
    moved[0] = moved[1] = m[0] = m[1] = m[2] = m[3] = 0;
    for (int j = 0; j < 4; j++) {
        for (int i = 0; i < 4; i++) {
            const double *at = f->at[(j0 + j) * f->across + i0 + i];
            for (int d = 0; d < 2; d++) {
                moved[d] += wx[i] * wy[j] * at[d];
                m[2 * d] += sx[i] * wy[j] / f->cell_x * at[d];
                m[2 * d + 1] += wx[i] * sy[j] / f->cell_y * at[d];
            }
        }
    }
}

#endif /* TEXPATCH_FIELD_H */
