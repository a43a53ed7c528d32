#ifndef TEXMATH_MATRIX_H
#define TEXMATH_MATRIX_H

#include "env.h"
#include "vector.h"

/* ---- matrices --------------------------------------------------------------------------- */

/* Stored column by column: row r of column c is m[3 * c + r], of a mat4 m[4 * c + r]. */
typedef struct txm_mat3 {
    float m[9];
} txm_mat3;
typedef struct txm_mat4 {
    float m[16];
} txm_mat4;

/* out = a b, n x n; the helper of the two below */
static inline void txm_matrix_mul(int n, const float *a, const float *b, float *out) {
    for (int c = 0; c < n; c++) {
        for (int r = 0; r < n; r++) {
            double sum = 0;
            for (int k = 0; k < n; k++) sum += (double)a[n * k + r] * b[n * c + k];
            out[n * c + r] = txm_float(sum);
        }
    }
}

/* out = inverse of m, n x n, n <= 4: Gauss and Jordan with row scaling and partial pivoting.
   A pivot below 2^-40 of its column counts as 0: by then a float matrix has no rank left. */
static inline txm_status txm_matrix_inverse(int n, const float *m, float *out) {
    double a[4][8], largest[4] = {0, 0, 0, 0};
    for (int r = 0; r < n; r++) {
        double scale = 0;
        for (int c = 0; c < n; c++) {
            if (!txm_is_finite(m[n * c + r])) return TXM_BAD_ARGUMENT;
            scale = fmax(scale, fabs((double)m[n * c + r]));
        }
        if (scale <= 0) return TXM_BAD_ARGUMENT;
        for (int c = 0; c < n; c++) {
            a[r][c] = m[n * c + r] / scale;
            a[r][n + c] = r == c ? 1 / scale : 0;
            largest[c] = fmax(largest[c], fabs(a[r][c]));
        }
    }
    for (int k = 0; k < n; k++) {
        int p = k;
        for (int r = k + 1; r < n; r++) {
            if (fabs(a[r][k]) > fabs(a[p][k])) p = r;
        }
        const double pivot = a[p][k];
        if (fabs(pivot) <= largest[k] * (1.0 / 1099511627776.0)) return TXM_BAD_ARGUMENT;
        for (int c = 0; c < 2 * n; c++) {
            const double t = a[p][c];
            a[p][c] = a[k][c];
            a[k][c] = t / pivot;
        }
        for (int r = 0; r < n; r++) {
            const double f = a[r][k];
            for (int c = 0; c < 2 * n && r != k; c++) a[r][c] -= f * a[k][c];
        }
    }
    for (int i = 0; i < n * n; i++) {
        if (fabs(a[i % n][n + i / n]) > 3.4e38) return TXM_BAD_ARGUMENT; /* no float */
    }
    for (int i = 0; i < n * n; i++) out[i] = txm_float(a[i % n][n + i / n]);
    return TXM_OK;
}

static inline txm_mat3 txm_mat3_identity(void) {
    const txm_mat3 m = {{1, 0, 0, 0, 1, 0, 0, 0, 1}};
    return m;
}
static inline txm_mat3 txm_mat3_mul(txm_mat3 a, txm_mat3 b) {
    txm_mat3 out = {{0}};
    txm_matrix_mul(3, a.m, b.m, out.m);
    return out;
}
static inline txm_mat3 txm_mat3_transpose(txm_mat3 m) {
    txm_mat3 out;
    for (int i = 0; i < 9; i++) out.m[i] = m.m[3 * (i % 3) + i / 3];
    return out;
}
/* TXM_BAD_ARGUMENT, and *out untouched, if m is singular to float precision or not finite */
static inline txm_status txm_mat3_inverse(txm_mat3 m, txm_mat3 *out) {
    return txm_matrix_inverse(3, m.m, out->m);
}
/* m v */
static inline txm_vec3 txm_mat3_vec(txm_mat3 m, txm_vec3 v) {
    float r[3];
    for (int i = 0; i < 3; i++)
        r[i] =
            txm_float((double)m.m[i] * v.x + (double)m.m[3 + i] * v.y + (double)m.m[6 + i] * v.z);
    return txm_v3(r[0], r[1], r[2]);
}

static inline txm_mat4 txm_mat4_identity(void) {
    const txm_mat4 m = {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}};
    return m;
}
static inline txm_mat4 txm_mat4_mul(txm_mat4 a, txm_mat4 b) {
    txm_mat4 out = {{0}};
    txm_matrix_mul(4, a.m, b.m, out.m);
    return out;
}
static inline txm_mat4 txm_mat4_transpose(txm_mat4 m) {
    txm_mat4 out;
    for (int i = 0; i < 16; i++) out.m[i] = m.m[4 * (i % 4) + i / 4];
    return out;
}
/* as txm_mat3_inverse */
static inline txm_status txm_mat4_inverse(txm_mat4 m, txm_mat4 *out) {
    return txm_matrix_inverse(4, m.m, out->m);
}
/* m v */
static inline txm_vec4 txm_mat4_vec(txm_mat4 m, txm_vec4 v) {
    float r[4];
    for (int i = 0; i < 4; i++)
        r[i] = txm_float((double)m.m[i] * v.x + (double)m.m[4 + i] * v.y +
                         (double)m.m[8 + i] * v.z + (double)m.m[12 + i] * v.w);
    return txm_v4(r[0], r[1], r[2], r[3]);
}
/* the point p moved by m, divided by its w (unless that is 0) */
static inline txm_vec3 txm_mat4_point(txm_mat4 m, txm_vec3 p) {
    const txm_vec4 q = txm_mat4_vec(m, txm_v4(p.x, p.y, p.z, 1));
    const float w = q.w < 0 || q.w > 0 ? q.w : 1;
    return txm_v3(q.x / w, q.y / w, q.z / w);
}
/* the direction v turned by m; translation does not move it */
static inline txm_vec3 txm_mat4_vector(txm_mat4 m, txm_vec3 v) {
    const txm_vec4 q = txm_mat4_vec(m, txm_v4(v.x, v.y, v.z, 0));
    return txm_v3(q.x, q.y, q.z);
}
/* the linear part; for normals take its inverse transposed */
static inline txm_mat3 txm_mat4_mat3(txm_mat4 m) {
    txm_mat3 out;
    for (int i = 0; i < 9; i++) out.m[i] = m.m[4 * (i / 3) + i % 3];
    return out;
}
static inline txm_mat4 txm_mat4_translation(txm_vec3 t) {
    const txm_mat4 m = {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, t.x, t.y, t.z, 1}};
    return m;
}
static inline txm_mat4 txm_mat4_scale(txm_vec3 s) {
    const txm_mat4 m = {{s.x, 0, 0, 0, 0, s.y, 0, 0, 0, 0, s.z, 0, 0, 0, 0, 1}};
    return m;
}
/* World to camera: eye goes to the origin, target onto the -z axis, up to the upper half. Any up
   will do, also one along the line of sight. */
static inline txm_mat4 txm_mat4_look_at(txm_vec3 eye, txm_vec3 target, txm_vec3 up) {
    txm_vec3 z = txm_vec3_normalize(txm_vec3_sub(eye, target));
    if (txm_vec3_dot(z, z) <= 0) z = txm_v3(0, 0, 1);
    txm_vec3 x = txm_vec3_cross(txm_vec3_normalize(up), z);
    x = txm_vec3_length(x) > 1e-6f ? txm_vec3_normalize(x) : txm_vec3_perpendicular(z);
    const txm_vec3 y = txm_vec3_cross(z, x);
    const txm_mat4 m = {{x.x, y.x, z.x, 0, x.y, y.y, z.y, 0, x.z, y.z, z.z, 0,
                         -txm_vec3_dot(x, eye), -txm_vec3_dot(y, eye), -txm_vec3_dot(z, eye), 1}};
    return m;
}
/* Camera to clip space: fov_y between 0 and pi, aspect = width / height > 0, 0 < near < far;
   z = -near goes to -1, z = -far to 1. (near_z, far_z: near and far are macros on Windows.) */
static inline txm_mat4 txm_mat4_perspective(float fov_y, float aspect, float near_z, float far_z) {
    const double f = cos(0.5 * fov_y) / sin(0.5 * fov_y), d = (double)near_z - far_z;
    const txm_mat4 m = {{txm_float(f / aspect), 0, 0, 0, 0, txm_float(f), 0, 0, 0, 0,
                         txm_float(((double)far_z + near_z) / d), -1, 0, 0,
                         txm_float(2.0 * far_z * near_z / d), 0}};
    return m;
}

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
static inline txm_mat4 txm_quat_mat4(txm_quat q) {
    const txm_mat3 r = txm_quat_mat3(q);
    txm_mat4 m = txm_mat4_identity();
    for (int i = 0; i < 9; i++) m.m[4 * (i / 3) + i % 3] = r.m[i];
    return m;
}
static inline txm_mat4 txm_mat4_rotation(txm_vec3 axis, float angle) {
    return txm_quat_mat4(txm_quat_axis_angle(axis, angle));
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
/* The quaternion of a rotation matrix, w >= 0. Of the four ways to it, [8] takes the one whose
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
/* From a (t = 0) to b (t = 1) the shorter way round; cheap, speed not quite even. */
static inline txm_quat txm_quat_nlerp(txm_quat a, txm_quat b, float t) {
    return txm_quat_blend(a, b, 1.0 - t, txm_quat_dot(a, b) < 0 ? -(double)t : t);
}
/* The same at even speed. */
static inline txm_quat txm_quat_slerp(txm_quat a, txm_quat b, float t) {
    const double d = txm_quat_dot(a, b), cosine = fabs(d);
    if (cosine > 0.9995) return txm_quat_nlerp(a, b, t); /* the sine would be too small */
    const double angle = acos(cosine), s = sin((1.0 - t) * angle), u = sin(t * angle);
    return txm_quat_blend(a, b, s, d < 0 ? -u : u); /* blend divides by sin(angle) */
}

#endif /* TEXMATH_MATRIX_H */
