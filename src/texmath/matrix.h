#ifndef TEXMATH_MATRIX_H
#define TEXMATH_MATRIX_H

#include "env.h"
#include "vector.h"

/* ---- matrices --------------------------------------------------------------------------- */

/* Stored column by column: row r of column c is m[3 * c + r]. */
typedef struct txm_mat3 {
    float m[9];
} txm_mat3;

/* ---- quaternions ------------------------------------------------------------------------ */

/* A rotation: x, y, z = axis * sin(angle / 2), w = cos(angle / 2); length 1. q and -q are the same
   rotation. No rotation is {0, 0, 0, 1}. */
typedef struct txm_quat {
    float x, y, z, w;
} txm_quat;

/* length 1; no rotation for the zero quaternion */
static inline txm_quat txm_quat_normalize(txm_quat q) {
    const double n =
        sqrt((double)q.x * q.x + (double)q.y * q.y + (double)q.z * q.z + (double)q.w * q.w);
    const txm_quat none = {0, 0, 0, 1}, unit = {txm_float(q.x / n), txm_float(q.y / n),
                                                txm_float(q.z / n), txm_float(q.w / n)};
    return n > 0 ? unit : none;
}
/* counter-clockwise about axis (of any length above 0) seen from its tip */
static inline txm_quat txm_quat_axis_angle(txm_vec3 axis, float angle) {
    const txm_vec3 a = txm_vec3_normalize(axis);
    const double s = sin(0.5 * angle);
    const txm_quat q = {txm_float(s * a.x), txm_float(s * a.y), txm_float(s * a.z),
                        txm_float(cos(0.5 * angle))};
    return txm_quat_normalize(q);
}
/* a after b */
static inline txm_quat txm_quat_mul(txm_quat a, txm_quat b) {
    const double ax = a.x, ay = a.y, az = a.z, aw = a.w;
    const txm_quat q = {txm_float(aw * b.x + ax * b.w + ay * b.z - az * b.y),
                        txm_float(aw * b.y - ax * b.z + ay * b.w + az * b.x),
                        txm_float(aw * b.z + ax * b.y - ay * b.x + az * b.w),
                        txm_float(aw * b.w - ax * b.x - ay * b.y - az * b.z)};
    return q;
}
/* the opposite rotation */
static inline txm_quat txm_quat_conjugate(txm_quat q) {
    const txm_quat c = {-q.x, -q.y, -q.z, q.w};
    return c;
}
/* the matrix of a unit quaternion */
static inline txm_mat3 txm_quat_mat3(txm_quat q) {
    const double x = q.x, y = q.y, z = q.z, w = q.w;
    const txm_mat3 m = {{txm_float(1 - 2 * (y * y + z * z)), txm_float(2 * (x * y + w * z)),
                         txm_float(2 * (x * z - w * y)), txm_float(2 * (x * y - w * z)),
                         txm_float(1 - 2 * (x * x + z * z)), txm_float(2 * (y * z + w * x)),
                         txm_float(2 * (x * z + w * y)), txm_float(2 * (y * z - w * x)),
                         txm_float(1 - 2 * (x * x + y * y))}};
    return m;
}
/* v turned by the unit quaternion q: v + 2 w (u x v) + 2 u x (u x v), u = (x, y, z) */
static inline txm_vec3 txm_quat_rotate(txm_quat q, txm_vec3 v) {
    const double x = q.x, y = q.y, z = q.z, w = q.w;
    const double tx = 2 * (y * v.z - z * v.y), ty = 2 * (z * v.x - x * v.z),
                 tz = 2 * (x * v.y - y * v.x);
    return txm_v3(txm_float(v.x + w * tx + (y * tz - z * ty)),
                  txm_float(v.y + w * ty + (z * tx - x * tz)),
                  txm_float(v.z + w * tz + (x * ty - y * tx)));
}
/* The quaternion of a rotation matrix, w >= 0. Of the four ways to it, [7] takes the one whose
   component is largest: that one never divides by something small. */
static inline txm_quat txm_quat_from_mat3(txm_mat3 m) {
    const double xx = m.m[0], yy = m.m[4], zz = m.m[8];
    const double c[4] = {1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz, 1 + xx + yy + zz};
    const double yz = (double)m.m[5] + m.m[7], wx = (double)m.m[5] - m.m[7];
    const double xz = (double)m.m[6] + m.m[2], wy = (double)m.m[6] - m.m[2];
    const double xy = (double)m.m[1] + m.m[3], wz = (double)m.m[1] - m.m[3];
    const double all[4][4] = {
        {c[0], xy, xz, wx}, {xy, c[1], yz, wy}, {xz, yz, c[2], wz}, {wx, wy, wz, c[3]}};
    int k = 3;
    for (int i = 0; i < 3; i++) {
        if (c[i] > c[k]) k = i;
    }
    /* the row is 4 q_k (x, y, z, w); its length is 4 |q_k| */
    const double *q = all[k];
    const double n =
        sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]) * (q[3] < 0 ? -1 : 1);
    const txm_quat none = {0, 0, 0, 1}, unit = {txm_float(q[0] / n), txm_float(q[1] / n),
                                                txm_float(q[2] / n), txm_float(q[3] / n)};
    return n < 0 || n > 0 ? unit : none;
}
/* a * s + b * t, the shorter way round, to length 1; the helper of the two below */
static inline txm_quat txm_quat_blend(txm_quat a, txm_quat b, double s, double t) {
    const txm_quat q = {txm_float(s * a.x + t * b.x), txm_float(s * a.y + t * b.y),
                        txm_float(s * a.z + t * b.z), txm_float(s * a.w + t * b.w)};
    return txm_quat_normalize(q);
}
static inline double txm_quat_dot(txm_quat a, txm_quat b) {
    return (double)a.x * b.x + (double)a.y * b.y + (double)a.z * b.z + (double)a.w * b.w;
}
/* From a (t = 0) to b (t = 1) the shorter way round; fast, at nearly constant angular speed. */
static inline txm_quat txm_quat_nlerp(txm_quat a, txm_quat b, float t) {
    return txm_quat_blend(a, b, 1.0 - t, txm_quat_dot(a, b) < 0 ? -(double)t : t);
}
/* The same at constant angular speed. */
static inline txm_quat txm_quat_slerp(txm_quat a, txm_quat b, float t) {
    const double d = txm_quat_dot(a, b), cosine = fabs(d);
    if (cosine > 0.9995) return txm_quat_nlerp(a, b, t); /* the sine would be too small */
    const double angle = acos(cosine), s = sin((1.0 - t) * angle), u = sin(t * angle);
    return txm_quat_blend(a, b, s, d < 0 ? -u : u); /* blend divides by sin(angle) */
}

/* ---- kernel: symmetric 3x3 eigensystem -------------------------------------------------- */

/* Eigenvalues and eigenvectors of

       | a[0] a[1] a[2] |
   A = | a[1] a[3] a[4] |      A vectors[k] = values[k] vectors[k]
       | a[2] a[4] a[5] |

   by cyclic Jacobi rotations in double [6]; the covariance of points is the usual A.

   values   falling
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

    /* Each rotation zeroes m[p][q]; what is left off the diagonal shrinks quadratically, 6 sweeps
       are the rule and 32 never needed. Rotations that no longer change the diagonal end it. */
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

#endif /* TEXMATH_MATRIX_H */
