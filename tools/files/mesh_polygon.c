/* mesh_polygon.c - polygons become triangles
   SPDX-License-Identifier: MIT OR Unlicense */
#include "mesh_file.h"

enum { MAX_EARS = 1000 }; /* corners; longer polygons are treated as convex: ears take n^2 steps */

/* ---- polygons to triangles --------------------------------------------------------------- */

typedef double point[2];

/* Twice the area of a triangle in the plane, positive if counter-clockwise. */
static double area2(const double *a, const double *b, const double *c) {
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

static int same_point(const double *a, const double *b) {
    return a[0] == b[0] && a[1] == b[1];
}

/* The corners seen along the axis that the polygon faces most, so that they run
   counter-clockwise. */
static void flatten(const double *positions, const corner *p, size_t n, point *flat) {
    double normal[3] = {0, 0, 0};
    for (size_t i = 0; i < n; i++) { /* Newell's sum: right for any polygon, flat or not */
        const double *a = positions + 3 * (size_t)p[i].vertex;
        const double *b = positions + 3 * (size_t)p[i + 1 < n ? i + 1 : 0].vertex;
        for (int k = 0; k < 3; k++) {
            const int y = (k + 1) % 3, z = (k + 2) % 3;
            normal[k] += (a[y] - b[y]) * (a[z] + b[z]);
        }
    }
    int axis = 0;
    for (int k = 1; k < 3; k++) {
        if (fabs(normal[k]) > fabs(normal[axis])) axis = k;
    }
    const int x = (axis + 1) % 3, y = (axis + 2) % 3;
    for (size_t i = 0; i < n; i++) {
        const double *a = positions + 3 * (size_t)p[i].vertex;
        flat[i][0] = a[normal[axis] < 0 ? y : x];
        flat[i][1] = a[normal[axis] < 0 ? x : y];
    }
}

static int is_convex(const point *flat, size_t n) {
    for (size_t i = 0; i < n; i++) {
        if (!(area2(flat[i], flat[(i + 1) % n], flat[(i + 2) % n]) > 0)) return 0;
    }
    return 1;
}

/* Is the corner at place i of those left an ear: a left turn with none of the others in it? */
static int is_ear(const point *flat, const size_t *around, size_t left, size_t i) {
    const double *a = flat[around[(i + left - 1) % left]], *b = flat[around[i]];
    const double *c = flat[around[(i + 1) % left]];
    if (!(area2(a, b, c) > 0)) return 0;
    for (size_t k = 2; k + 1 < left; k++) {
        const double *q = flat[around[(i + k) % left]];
        if (area2(a, b, q) < 0 || area2(b, c, q) < 0 || area2(c, a, q) < 0) continue;
        if (!same_point(q, a) && !same_point(q, b) && !same_point(q, c)) return 0;
    }
    return 1;
}

static int add_triangle(builder *b, corner x, corner y, corner z) {
    corner *t = (corner *)list_add(&b->triangles, 1);
    if (!t) return builder_fail_memory(b);
    t[0] = x;
    t[1] = y;
    t[2] = z;
    return 1;
}

int polygon_triangulate(builder *b, const corner *p, size_t n) {
    if (n == 3) return add_triangle(b, p[0], p[1], p[2]);
    size_t left = n, *around = NULL;
    if (n <= MAX_EARS) {
        b->flat.count = b->around.count = 0;
        point *flat = (point *)list_add(&b->flat, n);
        around = (size_t *)list_add(&b->around, n);
        if (!flat || !around) return builder_fail_memory(b);
        for (size_t i = 0; i < n; i++) around[i] = i;
        flatten((const double *)b->positions.items, p, n, flat);
        if (!is_convex((const point *)flat, n)) {
            size_t tries = 8 * n, i = 1; /* a polygon that crosses itself may run out of ears */
            for (; left > 3 && tries > 0; tries--) {
                if (!is_ear((const point *)flat, around, left, i % left)) {
                    i++;
                    continue;
                }
                i %= left;
                if (!add_triangle(b, p[around[(i + left - 1) % left]], p[around[i]],
                                  p[around[(i + 1) % left]]))
                    return 0;
                memmove(around + i, around + i + 1, (left - i - 1) * sizeof *around);
                left--;
            }
        }
    }
    for (size_t i = 1; i + 1 < left; i++) {
        const int ok = around ? add_triangle(b, p[around[0]], p[around[i]], p[around[i + 1]])
                              : add_triangle(b, p[0], p[i], p[i + 1]);
        if (!ok) return 0;
    }
    return 1;
}
