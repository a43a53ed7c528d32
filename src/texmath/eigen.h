#ifndef TEXMATH_EIGEN_H
#define TEXMATH_EIGEN_H

#include "env.h"
#include "number.h"

/* ---- kernel: symmetric 3x3 eigensystem -------------------------------------------------- */

/* Eigenvalues and eigenvectors of

       | a[0] a[1] a[2] |
   A = | a[1] a[3] a[4] |      A vectors[k] = values[k] vectors[k]
       | a[2] a[4] a[5] |

   by cyclic Jacobi rotations in double [6]; A is usually the covariance of points.

   values   descending
   vectors  unit length, at right angles, vectors[2] = vectors[0] x vectors[1]; of the first two
            the component of largest magnitude (the first such) is positive. For equal values any
            basis of their space is right; this one depends on the bits of A only.
   return   TXM_OK, or TXM_BAD_ARGUMENT (nothing written) if an entry is not finite         */
static inline txm_status txm_eigen3(const double a[6], double values[3], double vectors[3][3]) {
    double m[3][3] = {{a[0], a[1], a[2]}, {a[1], a[3], a[4]}, {a[2], a[4], a[5]}};
    double v[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}; /* columns become the vectors */
    double scale = 0;
    int order[3] = {0, 1, 2};
    for (int i = 0; i < 6; i++) {
        if (!txm_is_finite(a[i])) return TXM_BAD_ARGUMENT;
        scale = fmax(scale, fabs(a[i]));
    }
    for (int i = 0; i < 9 && scale > 0; i++) m[i / 3][i % 3] /= scale; /* squares cannot overflow */

    /* Each rotation zeroes m[p][q]; the off-diagonal elements converge quadratically: usually 6 sweeps
       are enough, and 32 always. It ends when rotations no longer change the diagonal. */
    for (int sweep = 0, turned = 1; turned && sweep < 32; sweep++) {
        turned = 0;
        for (int k = 0; k < 3; k++) {
            const int p = k == 2 ? 1 : 0, q = k == 0 ? 1 : 2, r = 3 - p - q;
            if (fabs(m[p][q]) <= 1e-18) {
                m[p][q] = m[q][p] = 0;
                continue;
            }
            turned = 1;
            const double theta = (m[q][q] - m[p][p]) / (2 * m[p][q]);
            const double t = (theta < 0 ? -1 : 1) / (fabs(theta) + sqrt(theta * theta + 1));
            const double c = 1 / sqrt(t * t + 1), s = t * c;
            const double rp = m[r][p], rq = m[r][q];
            m[p][p] -= t * m[p][q];
            m[q][q] += t * m[p][q];
            m[p][q] = m[q][p] = 0;
            m[r][p] = m[p][r] = c * rp - s * rq;
            m[r][q] = m[q][r] = s * rp + c * rq;
            for (int i = 0; i < 3; i++) {
                const double ip = v[i][p], iq = v[i][q];
                v[i][p] = c * ip - s * iq;
                v[i][q] = s * ip + c * iq;
            }
        }
    }
    for (int k = 0; k < 3; k++) { /* three compare-and-swaps that keep the order of equals */
        const int i = k == 1 ? 1 : 0, x = order[i], y = order[i + 1];
        if (m[y][y] > m[x][x]) {
            order[i] = y;
            order[i + 1] = x;
        }
    }
    for (int k = 0; k < 3; k++) {
        const int o = order[k];
        double sign = 0, most = 0;
        for (int i = 0; i < 3; i++) {
            /* nearly equal magnitudes count as equal, so that rounding does not choose the sign */
            if (fabs(v[i][o]) > most * (1 + 1e-9)) {
                most = fabs(v[i][o]);
                sign = v[i][o] < 0 ? -1 : 1;
            }
        }
        values[k] = m[o][o] * scale;
        for (int i = 0; i < 3; i++) vectors[k][i] = sign * v[i][o];
    }
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        vectors[2][i] = vectors[0][j] * vectors[1][k] - vectors[0][k] * vectors[1][j];
    }
    return TXM_OK;
}

#endif /* TEXMATH_EIGEN_H */
