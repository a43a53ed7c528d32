/* surface.c - closed surfaces f(p) = 0 that each ray from the origin meets once
   SPDX-License-Identifier: MIT OR Unlicense  */
#include "membrane.h"

#include <math.h>
#include <string.h>

double sphere(const double p[3]) {
    return sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) - 140;
}

/* a capsule along x, blended with a smaller sphere: the smooth minimum of two distances */
double capsule(const double p[3]) {
    const double along = p[0] < -90 ? p[0] + 90 : p[0] > 90 ? p[0] - 90 : 0;
    const double body = sqrt(along * along + p[1] * p[1] + p[2] * p[2]) - 80;
    const double dx = p[0] + 50, dy = p[1] - 75, blend = 40;
    const double bump = sqrt(dx * dx + dy * dy + p[2] * p[2]) - 55;
    const double h = fmax(blend - fabs(body - bump), 0) / blend;
    return fmin(body, bump) - 0.25 * h * h * blend;
}

static void find_surface(double (*f)(const double[3]), const double d[3], float *out) {
    double near = 0, far = 1000 / sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    for (int i = 0; i < 60; i++) {
        const double t = 0.5 * (near + far), p[3] = {t * d[0], t * d[1], t * d[2]};
        if (f(p) < 0) near = t;
        else far = t;
    }
    for (int k = 0; k < 3; k++) out[k] = (float)(near * d[k]);
}

/* The six faces of a cube, projected onto the surface, each a grid of its own: trimesh_retile welds
   them. */
void make_surface(double (*f)(const double[3]), float *positions, uint32_t *indices) {
    for (uint32_t side = 0; side < 6; side++) {
        const uint32_t first = side * (GRID + 1) * (GRID + 1);
        for (uint32_t j = 0; j <= GRID; j++) {
            for (uint32_t i = 0; i <= GRID; i++, positions += 3) {
                double d[3];
                d[side % 3] = side < 3 ? GRID : -GRID;
                d[(side + 1) % 3] = 2.0 * i - GRID;
                d[(side + 2) % 3] = 2.0 * j - GRID;
                find_surface(f, d, positions);
            }
        }
        for (uint32_t j = 0; j < GRID; j++) {
            for (uint32_t i = 0; i < GRID; i++, indices += 6) {
                /* counter-clockwise from outside: the last three faces swap the axes */
                const uint32_t a = first + j * (GRID + 1) + i, up = a + GRID + 1;
                const uint32_t b = side < 3 ? a + 1 : up, c = side < 3 ? up : a + 1;
                const uint32_t two[6] = {a, b, c, c, b, up + 1};
                memcpy(indices, two, sizeof two);
            }
        }
    }
}

double area_of(const txm_mesh *m) {
    double area = 0;
    for (size_t t = 0; t < m->face_count; t++) {
        txm_vec3 p[3];
        for (size_t k = 0; k < 3; k++) {
            const float *v = m->positions + 3 * (size_t)m->indices[3 * t + k];
            p[k] = txm_v3(v[0], v[1], v[2]);
        }
        area += 0.5 * (double)txm_vec3_length(txm_vec3_cross(txm_vec3_sub(p[1], p[0]),
                                                             txm_vec3_sub(p[2], p[0])));
    }
    return area;
}
