#ifndef TRIMESH_RELAX_CONFIG_H
#define TRIMESH_RELAX_CONFIG_H

#include "../trimesh_relax.h"

/* ---- configuration ------------------------------------------------------------------ */

#include <stdio.h>

#ifndef TRIMESH_ASSERT
#include <assert.h>
#define TRIMESH_ASSERT(x) assert(x)
#endif

/* ---- vectors in double -------------------------------------------------------------------- */

typedef struct tmr_vec {
    double x, y, z;
} tmr_vec;

static tmr_vec tmr_v(double x, double y, double z) {
    tmr_vec v;
    v.x = x;
    v.y = y;
    v.z = z;
    return v;
}
static tmr_vec tmr_add(tmr_vec a, tmr_vec b) {
    return tmr_v(a.x + b.x, a.y + b.y, a.z + b.z);
}
static tmr_vec tmr_sub(tmr_vec a, tmr_vec b) {
    return tmr_v(a.x - b.x, a.y - b.y, a.z - b.z);
}
static tmr_vec tmr_scale(tmr_vec a, double s) {
    return tmr_v(a.x * s, a.y * s, a.z * s);
}
static tmr_vec tmr_mad(tmr_vec a, tmr_vec b, double s) { /* a + b s */
    return tmr_v(a.x + b.x * s, a.y + b.y * s, a.z + b.z * s);
}
static double tmr_dot(tmr_vec a, tmr_vec b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
static tmr_vec tmr_cross(tmr_vec a, tmr_vec b) {
    return tmr_v(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
static double tmr_len2(tmr_vec a) {
    return tmr_dot(a, a);
}
static double tmr_len(tmr_vec a) {
    return sqrt(tmr_dot(a, a));
}
static double tmr_dist2(tmr_vec a, tmr_vec b) {
    return tmr_len2(tmr_sub(a, b));
}
static double tmr_dist(tmr_vec a, tmr_vec b) {
    return sqrt(tmr_dist2(a, b));
}
static tmr_vec tmr_unit(tmr_vec a) { /* the zero vector stays */
    const double n = tmr_len(a);
    return n > 0 ? tmr_scale(a, 1 / n) : a;
}
/* twice the area of a triangle times its unit normal */
static tmr_vec tmr_area2(tmr_vec a, tmr_vec b, tmr_vec c) {
    return tmr_cross(tmr_sub(b, a), tmr_sub(c, a));
}

/* ---- corners ----------------------------------------------------------------------------- */

/* A mesh is two arrays over corners. Corner c of triangle c / 3 stands for its vertex and for the
   edge opposite to it, from the vertex of tmr_next(c) to that of tmr_prev(c). */
static int32_t tmr_next(int32_t c) {
    return c % 3 == 2 ? c - 2 : c + 1;
}
static int32_t tmr_prev(int32_t c) {
    return c % 3 == 0 ? c + 2 : c - 1;
}

#endif /* TRIMESH_RELAX_CONFIG_H */
