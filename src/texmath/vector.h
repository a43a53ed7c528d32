#ifndef TEXMATH_VECTOR_H
#define TEXMATH_VECTOR_H

#include "number.h"

/* ---- vectors ---------------------------------------------------------------------------- */

typedef struct txm_vec2 {
    float x, y;
} txm_vec2;
typedef struct txm_vec3 {
    float x, y, z;
} txm_vec3;

/* Constructors, as C++11 has no compound literals. */
static inline txm_vec2 txm_v2(float x, float y) {
    const txm_vec2 v = {x, y};
    return v;
}
static inline txm_vec3 txm_v3(float x, float y, float z) {
    const txm_vec3 v = {x, y, z};
    return v;
}

/* Component by component: a + b, a - b, a s, a (1 - t) + b t. Dot product; length; length 1 in the
   same direction, the zero vector for the zero vector; cross product. */
static inline txm_vec3 txm_vec3_add(txm_vec3 a, txm_vec3 b) {
    return txm_v3(a.x + b.x, a.y + b.y, a.z + b.z);
}
static inline txm_vec3 txm_vec3_sub(txm_vec3 a, txm_vec3 b) {
    return txm_v3(a.x - b.x, a.y - b.y, a.z - b.z);
}
static inline txm_vec3 txm_vec3_scale(txm_vec3 a, float s) {
    return txm_v3(a.x * s, a.y * s, a.z * s);
}
static inline txm_vec3 txm_vec3_lerp(txm_vec3 a, txm_vec3 b, float t) {
    return txm_v3(txm_lerpf(a.x, b.x, t), txm_lerpf(a.y, b.y, t), txm_lerpf(a.z, b.z, t));
}
static inline float txm_vec3_dot(txm_vec3 a, txm_vec3 b) {
    return txm_float((double)a.x * b.x + (double)a.y * b.y + (double)a.z * b.z);
}
static inline float txm_vec3_length(txm_vec3 a) {
    return txm_float(sqrt((double)a.x * a.x + (double)a.y * a.y + (double)a.z * a.z));
}
static inline txm_vec3 txm_vec3_normalize(txm_vec3 a) {
    const double n = sqrt((double)a.x * a.x + (double)a.y * a.y + (double)a.z * a.z);
    return n > 0 ? txm_v3(txm_float(a.x / n), txm_float(a.y / n), txm_float(a.z / n)) : a;
}
static inline txm_vec3 txm_vec3_cross(txm_vec3 a, txm_vec3 b) {
    return txm_v3(txm_float((double)a.y * b.z - (double)a.z * b.y),
                  txm_float((double)a.z * b.x - (double)a.x * b.z),
                  txm_float((double)a.x * b.y - (double)a.y * b.x));
}

/* some unit vector at a right angle to v; x for the zero vector */
static inline txm_vec3 txm_vec3_perpendicular(txm_vec3 v) {
    const float x = fabsf(v.x), y = fabsf(v.y), z = fabsf(v.z);
    if (x <= 0 && y <= 0 && z <= 0) return txm_v3(1, 0, 0);
    /* the cross product with the axis that v is least along */
    const txm_vec3 axis = x <= y && x <= z ? txm_v3(1, 0, 0)
                          : y <= z         ? txm_v3(0, 1, 0)
                                           : txm_v3(0, 0, 1);
    return txm_vec3_normalize(txm_vec3_cross(txm_vec3_normalize(v), axis));
}

/* ---- vectors in double ------------------------------------------------------------------ */

/* For geometric decisions: computed in double, no rounding to float in between. Plain sums and
   products in the order written, so the bits are the same everywhere. */
typedef struct txm_dvec3 {
    double x, y, z;
} txm_dvec3;

static inline txm_dvec3 txm_d3(double x, double y, double z) {
    txm_dvec3 v;
    v.x = x;
    v.y = y;
    v.z = z;
    return v;
}
/* the three floats at p */
static inline txm_dvec3 txm_d3_load(const float *p) {
    return txm_d3(p[0], p[1], p[2]);
}
static inline txm_dvec3 txm_d3_add(txm_dvec3 a, txm_dvec3 b) {
    return txm_d3(a.x + b.x, a.y + b.y, a.z + b.z);
}
static inline txm_dvec3 txm_d3_sub(txm_dvec3 a, txm_dvec3 b) {
    return txm_d3(a.x - b.x, a.y - b.y, a.z - b.z);
}
static inline txm_dvec3 txm_d3_scale(txm_dvec3 a, double s) {
    return txm_d3(a.x * s, a.y * s, a.z * s);
}
/* a + b s */
static inline txm_dvec3 txm_d3_mad(txm_dvec3 a, txm_dvec3 b, double s) {
    return txm_d3(a.x + b.x * s, a.y + b.y * s, a.z + b.z * s);
}
static inline double txm_d3_dot(txm_dvec3 a, txm_dvec3 b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
static inline txm_dvec3 txm_d3_cross(txm_dvec3 a, txm_dvec3 b) {
    return txm_d3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
/* length and distance, also squared */
static inline double txm_d3_len2(txm_dvec3 a) {
    return txm_d3_dot(a, a);
}
static inline double txm_d3_len(txm_dvec3 a) {
    return sqrt(txm_d3_dot(a, a));
}
static inline double txm_d3_dist2(txm_dvec3 a, txm_dvec3 b) {
    return txm_d3_len2(txm_d3_sub(a, b));
}
static inline double txm_d3_dist(txm_dvec3 a, txm_dvec3 b) {
    return sqrt(txm_d3_dist2(a, b));
}
/* length 1 in the same direction, however long; the zero vector for the zero vector */
static inline txm_dvec3 txm_d3_unit(txm_dvec3 a) {
    const double n = txm_d3_len(a);
    if (n > 1e-150 && n < 1e150) return txm_d3_scale(a, 1 / n);
    /* its square has too few bits, or is out of range */
    const double most = fmax(fabs(a.x), fmax(fabs(a.y), fabs(a.z)));
    if (!(most > 0)) return a;
    a = txm_d3(a.x / most, a.y / most, a.z / most);
    return txm_d3_scale(a, 1 / txm_d3_len(a));
}
/* twice the area of the triangle a b c times its unit normal, on the side from which it is
   counter-clockwise */
static inline txm_dvec3 txm_d3_area2(txm_dvec3 a, txm_dvec3 b, txm_dvec3 c) {
    return txm_d3_cross(txm_d3_sub(b, a), txm_d3_sub(c, a));
}

/* ---- quaternions ------------------------------------------------------------------------ */

/* A rotation: x, y, z = axis * sin(angle / 2), w = cos(angle / 2), of length 1. q and -q are the
   same rotation. No rotation is {0, 0, 0, 1}. */
typedef struct txm_quat {
    double x, y, z, w;
} txm_quat;

/* length 1; no rotation for the zero quaternion */
static inline txm_quat txm_quat_unit(txm_quat q) {
    const double n = sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
    const txm_quat none = {0, 0, 0, 1}, unit = {q.x / n, q.y / n, q.z / n, q.w / n};
    return n > 0 ? unit : none;
}
/* a after b */
static inline txm_quat txm_quat_mul(txm_quat a, txm_quat b) {
    const txm_quat q = {a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
                        a.w * b.y + a.y * b.w + a.z * b.x - a.x * b.z,
                        a.w * b.z + a.z * b.w + a.x * b.y - a.y * b.x,
                        a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z};
    return q;
}
/* the opposite rotation */
static inline txm_quat txm_quat_conjugate(txm_quat q) {
    const txm_quat c = {-q.x, -q.y, -q.z, q.w};
    return c;
}
/* v turned by q: v + 2 w (u x v) + 2 u x (u x v), u = (x, y, z) */
static inline txm_dvec3 txm_quat_rotate(txm_quat q, txm_dvec3 v) {
    const double tx = 2 * (q.y * v.z - q.z * v.y), ty = 2 * (q.z * v.x - q.x * v.z);
    const double tz = 2 * (q.x * v.y - q.y * v.x);
    return txm_d3(v.x + q.w * tx + (q.y * tz - q.z * ty), v.y + q.w * ty + (q.z * tx - q.x * tz),
                  v.z + q.w * tz + (q.x * ty - q.y * tx));
}
/* The rotation that takes the axes to x, y, z, unit vectors at right angles. Not of length 1: its
   length is 4 times its largest component. [7]: of the four ways to compute it, the one that never
   divides by something small. */
static inline txm_quat txm_quat_from_axes(txm_dvec3 x, txm_dvec3 y, txm_dvec3 z) {
    const double c[4] = {1 + x.x - y.y - z.z, 1 - x.x + y.y - z.z, 1 - x.x - y.y + z.z,
                         1 + x.x + y.y + z.z};
    txm_quat q;
    int k = 3;
    for (int i = 0; i < 3; i++) {
        if (c[i] > c[k]) k = i;
    }
    q.x = k == 0 ? c[0] : k == 1 ? y.x + x.y : k == 2 ? z.x + x.z : y.z - z.y;
    q.y = k == 0 ? y.x + x.y : k == 1 ? c[1] : k == 2 ? z.y + y.z : z.x - x.z;
    q.z = k == 0 ? z.x + x.z : k == 1 ? z.y + y.z : k == 2 ? c[2] : x.y - y.x;
    q.w = k == 0 ? y.z - z.y : k == 1 ? z.x - x.z : k == 2 ? x.y - y.x : c[3];
    return q;
}

#endif /* TEXMATH_VECTOR_H */
