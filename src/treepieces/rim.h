#ifndef TREEPIECES_RIM_H
#define TREEPIECES_RIM_H

#include "../treepieces.h"

/* ---- vectors and rotations --------------------------------------------------------------- */

/* Everything that shapes a tree is computed by sums, products, quotients and square roots, so that
   it is the same everywhere. In float, not rounded from double as vectors of texmath.h are: a
   forest takes millions of these operations. */

/* q v q* for a unit quaternion q = x y z w; out may be v */
static void tpc_rotate(const float q[4], const float v[3], float out[3]) {
    const float tx = 2 * (q[1] * v[2] - q[2] * v[1]), ty = 2 * (q[2] * v[0] - q[0] * v[2]);
    const float tz = 2 * (q[0] * v[1] - q[1] * v[0]);
    const float x = v[0] + q[3] * tx + (q[1] * tz - q[2] * ty);
    const float y = v[1] + q[3] * ty + (q[2] * tx - q[0] * tz);
    const float z = v[2] + q[3] * tz + (q[0] * ty - q[1] * tx);
    out[0] = x;
    out[1] = y;
    out[2] = z;
}

/* out = a b: b first, then a; out may be one of them. Leave the order of the terms, and every term
   added, some with the sign inverted: from neighbouring a - b c and a + b c gcc 12 makes one
   instruction that rounds only once, even with contraction off. */
static void tpc_multiply(const float a[4], const float b[4], float out[4]) {
    const float back[3] = {-a[0], -a[1], -a[2]};
    const float x = a[3] * b[0] + a[0] * b[3] + a[1] * b[2] + back[2] * b[1];
    const float y = a[3] * b[1] + back[0] * b[2] + a[1] * b[3] + a[2] * b[0];
    const float z = a[3] * b[2] + a[0] * b[1] + back[1] * b[0] + a[2] * b[3];
    const float w = a[3] * b[3] + back[0] * b[0] + back[1] * b[1] + back[2] * b[2];
    out[0] = x;
    out[1] = y;
    out[2] = z;
    out[3] = w;
}

static float tpc_dot(const float a[3], const float b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void tpc_cross(const float a[3], const float b[3], float out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* Scale v to unit length. It must not be the zero vector. */
static void tpc_unit(float v[3]) {
    const float length = sqrtf(tpc_dot(v, v));
    for (int k = 0; k < 3; k++) v[k] /= length;
}

/* The same, a little faster; the zero vector becomes +y. */
static void tpc_unit_or_up(float v[3]) {
    const float square = tpc_dot(v, v), scale = 1 / sqrtf(square);
    if (square > 0)
        for (int k = 0; k < 3; k++) v[k] *= scale;
    else v[1] = 1;
}

/* The same; a vector shorter than 1e-6 becomes (x, y, z). */
static void tpc_unit_or(float v[3], float x, float y, float z) {
    const float length = sqrtf(tpc_dot(v, v)), other[3] = {x, y, z};
    for (int k = 0; k < 3; k++) v[k] = length > 1e-6f ? v[k] / length : other[k];
}

/* ---- the canonical rim ------------------------------------------------------------------- */

/* cos and sin of 60 k degrees */
static const float tpc_cos6[TREEPIECES_RIM] = {1.0f, 0.5f, -0.5f, -1.0f, -0.5f, 0.5f};
static const float tpc_sin6[TREEPIECES_RIM] = {0.0f,  0.86602540378f,  0.86602540378f,
                                               0.0f, -0.86602540378f, -0.86602540378f};

static const float tpc_cone_out = 0.99503719021f; /* normals at a rim: 10 / sqrt(101) outwards, */
static const float tpc_cone_up = 0.09950371902f;  /* 1 / sqrt(101) upwards                      */

static void tpc_rim_vertex(int place, float position[3], float normal[3]) {
    position[0] = tpc_cos6[place];
    position[1] = 0;
    position[2] = -tpc_sin6[place];
    normal[0] = tpc_cone_out * tpc_cos6[place];
    normal[1] = tpc_cone_up;
    normal[2] = -tpc_cone_out * tpc_sin6[place];
}

/* v rotated about y by 60 k degrees, which moves vertex j of a rim to vertex j + k */
static void tpc_turn(int k, const float v[3], float out[3]) {
    const float c = tpc_cos6[k], s = tpc_sin6[k], x = v[0], z = v[2];
    out[0] = c * x + s * z;
    out[1] = v[1];
    out[2] = c * z - s * x;
}

static void tpc_building_point(const treepieces_similarity *b, const float p[3], float out[3]) {
    tpc_rotate(b->rotation, p, out);
    for (int i = 0; i < 3; i++) out[i] = b->translation[i] + b->scale * out[i];
}

/* Vertex `place` of a leaf rim in model space of the piece. */
static void tpc_leaf_vertex(const treepieces_similarity *b, int place, float position[3],
                            float normal[3]) {
    tpc_rim_vertex(place, position, normal);
    tpc_building_point(b, position, position);
    tpc_rotate(b->rotation, normal, normal);
}

/* The vertex numbers of leaf rim k; of the root rim for k = -1. */
static const int *tpc_rim_of(const treepieces_piece *p, int k) {
    return k < 0 ? p->root_rim : p->leaf_rims[k];
}

#endif /* TREEPIECES_RIM_H */
