#ifndef TREEPIECES_TESSELLATION_H
#define TREEPIECES_TESSELLATION_H

#include "rim.h"

/* ---- level of detail --------------------------------------------------------------------- */

/* The level at the mean of `count` points, which are given as their sum. */
static int tpc_level(const treepieces_lod *lod, const float sum[3], float count) {
    const float half = lod->half_distance > 0 ? lod->half_distance : 10;
    const float most = txm_clampf(lod->max_level, 1, 64);
    double squares = 0;
    for (int k = 0; k < 3; k++) {
        const double d = (double)(sum[k] / count - lod->eye[k]);
        squares += d * d;
    }
    const float halvings = txm_clampf(txm_float(sqrt(squares) / half), 0, 100);
    const double level = (double)most * txm_exp2(-halvings);
    const int whole = (int)level;
    return whole < 1 ? 1 : whole + (level > whole);
}

TREEPIECES_API int treepieces_edge_level(const treepieces_lod *lod, const float a[3],
                                         const float b[3]) {
    const float sum[3] = {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
    return tpc_level(lod, sum, 2);
}

TREEPIECES_API int treepieces_inner_level(const treepieces_lod *lod, const float corners[12]) {
    float sum[3];
    for (int k = 0; k < 3; k++)
        sum[k] = (corners[k] + corners[3 + k]) + (corners[6 + k] + corners[9 + k]);
    return tpc_level(lod, sum, 4);
}

/* Position i of 0..n along a side, a multiple of 2^-16, so that position n - i is exactly 1 minus
   that of i. The step 1 / n is rounded once, then multiplied, as tessellation units do. */
static float tpc_fraction(int i, int n) {
    if (2 * i > n) return 1 - tpc_fraction(n - i, n);
    if (2 * i == n) return 0.5f;
    const int step = (65536 * 2 + n) / (2 * n);
    return (float)(i * step) / 65536.0f;
}

/* The vertices of a pattern: first those of the sides, side k from corner k up to the one before
   corner k + 1, then the inner grid, column by column. */
typedef struct tpc_pattern {
    int edges[4], first[4], inner, outer_count;
} tpc_pattern;

static int tpc_side_vertex(const tpc_pattern *p, int side, int i) {
    return i < p->edges[side] ? p->first[side] + i : p->first[(side + 1) % 4];
}

/* Vertex i of 0..inner - 2 on the border of the inner grid along a side, in the side's direction. */
static int tpc_inner_vertex(const tpc_pattern *p, int side, int i) {
    const int n = p->inner - 1, back = n - 1 - i;
    const int u = side == 0 ? 0 : side == 1 ? i : side == 2 ? n - 1 : back;
    const int v = side == 0 ? i : side == 1 ? n - 1 : side == 2 ? back : 0;
    return p->outer_count + u * n + v;
}

static void tpc_add_triangle(uint16_t *indices, int *count, int a, int b, int c) {
    if (indices) {
        indices[3 * *count] = (uint16_t)a;
        indices[3 * *count + 1] = (uint16_t)b;
        indices[3 * *count + 2] = (uint16_t)c;
    }
    ++*count;
}

/* The strip between a side and the inner grid: always advance on the one that is less far along. */
static void tpc_stitch(const tpc_pattern *p, int side, uint16_t *indices, int *count) {
    const int outer = p->edges[side], inner = p->inner - 2;
    int i = 0, j = 0;
    while (i < outer || j < inner) {
        /* middles of the next outer and inner step; inner place j lies at (j + 1) / (inner + 2) */
        const int a = (2 * i + 1) * (inner + 2), b = (2 * j + 3) * outer;
        if (j == inner || (i < outer && a <= b)) {
            tpc_add_triangle(indices, count, tpc_side_vertex(p, side, i),
                             tpc_side_vertex(p, side, i + 1), tpc_inner_vertex(p, side, j));
            i++;
        } else {
            tpc_add_triangle(indices, count, tpc_side_vertex(p, side, i),
                             tpc_inner_vertex(p, side, j + 1), tpc_inner_vertex(p, side, j));
            j++;
        }
    }
}

TREEPIECES_API int treepieces_pattern(const int edges[4], int inner, float *coords,
                                      uint16_t *indices, int *triangles) {
    static const int corner_u[4] = {0, 0, 1, 1}, corner_v[4] = {0, 1, 1, 0};
    tpc_pattern p;
    int count = 0;
    p.outer_count = 0;
    p.inner = txm_clampi(inner, 1, 64);
    for (int k = 0; k < 4; k++) {
        p.edges[k] = txm_clampi(edges[k], 1, 64);
        p.first[k] = p.outer_count;
        p.outer_count += p.edges[k];
    }
    if (p.inner == 1 && p.outer_count > 4) p.inner = 2;
    const int n = p.inner - 1;
    if (!coords && !indices) { /* the strips and the inner grid */
        count = n == 0 ? 2 : p.outer_count + 4 * (n - 1) + 2 * (n - 1) * (n - 1);
        if (triangles) *triangles = count;
        return p.outer_count + n * n;
    }
    for (int k = 0; k < 4 && coords; k++) {
        for (int i = 0; i < p.edges[k]; i++) {
            const float t = tpc_fraction(i, p.edges[k]), back = 1 - t;
            float *at = coords + 2 * (p.first[k] + i);
            const int u = corner_u[k], v = corner_v[k], next = (k + 1) % 4;
            at[0] = u == corner_u[next] ? (float)u : u ? back : t;
            at[1] = v == corner_v[next] ? (float)v : v ? back : t;
        }
    }
    for (int u = 0; u < n; u++) {
        for (int v = 0; v < n; v++) {
            if (coords) {
                float *at = coords + 2 * (p.outer_count + u * n + v);
                at[0] = tpc_fraction(u + 1, p.inner);
                at[1] = tpc_fraction(v + 1, p.inner);
            }
            if (u + 1 == n || v + 1 == n) continue;
            const int a = p.outer_count + u * n + v;
            tpc_add_triangle(indices, &count, a, a + 1, a + n + 1);
            tpc_add_triangle(indices, &count, a, a + n + 1, a + n);
        }
    }
    if (n == 0) {
        tpc_add_triangle(indices, &count, 0, 1, 2);
        tpc_add_triangle(indices, &count, 0, 2, 3);
    }
    for (int k = 0; k < 4 && n > 0; k++) tpc_stitch(&p, k, indices, &count);
    if (triangles) *triangles = count;
    return p.outer_count + n * n;
}

/* The bilinear weights of the corners at (u, v). */
static void tpc_corner_weights(float u, float v, float w[4]) {
    w[0] = (1 - u) * (1 - v);
    w[1] = (1 - u) * v;
    w[2] = u * v;
    w[3] = u * (1 - v);
}

/* A weighted sum of four numbers. Independent of the order of the corners to the bit while at most
   two weights are not 0, as on a side: opposite corners are added first, and x + 0 is x. */
static float tpc_mix(const float w[4], float a, float b, float c, float d) {
    return (w[0] * a + w[2] * c) + (w[1] * b + w[3] * d);
}

TREEPIECES_API void treepieces_patch_point(const float positions[12], const float normals[12],
                                           float shape, float u, float v, float position[3],
                                           float normal[3]) {
    const float alpha = shape < 0 ? 0 : shape > 0 ? shape : 0.6f;
    float w[4], p[3], n[3], depth[4];
    tpc_corner_weights(u, v, w);
    for (int k = 0; k < 3; k++) {
        p[k] = tpc_mix(w, positions[k], positions[3 + k], positions[6 + k], positions[9 + k]);
        n[k] = tpc_mix(w, normals[k], normals[3 + k], normals[6 + k], normals[9 + k]);
    }
    for (int i = 0; i < 4; i++) { /* height above the tangent plane of the corner */
        const float *corner = positions + 3 * i, *up = normals + 3 * i;
        depth[i] = (up[0] * (p[0] - corner[0]) + up[1] * (p[1] - corner[1])) +
                   up[2] * (p[2] - corner[2]);
    }
    for (int k = 0; k < 3; k++)
        position[k] = p[k] - alpha * tpc_mix(w, depth[0] * normals[k], depth[1] * normals[3 + k],
                                             depth[2] * normals[6 + k], depth[3] * normals[9 + k]);
    if (!normal) return;
    tpc_unit(n);
    memcpy(normal, n, sizeof n);
}

#endif /* TREEPIECES_TESSELLATION_H */
