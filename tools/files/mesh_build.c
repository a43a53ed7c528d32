/* mesh_build.c - what a reader has gathered becomes a mesh
   SPDX-License-Identifier: MIT OR Unlicense */
#include "mesh_file.h"

#include <stdarg.h>
#include <stdio.h>

enum { MAX_EARS = 1000 }; /* corners; longer polygons are treated as convex: ears take n^2 steps */

/* ---- what a reader has gathered ---------------------------------------------------------- */

void builder_init(builder *b, mesh_data *mesh, const char **why) {
    memset(b, 0, sizeof *b);
    b->positions = list_of(3 * sizeof(float));
    b->normals = list_of(3 * sizeof(float));
    b->rotations = list_of(4 * sizeof(float));
    b->colors = list_of(4);
    b->uvs = list_of(2 * sizeof(float));
    b->corners = list_of(sizeof(corner));
    b->polygons = list_of(sizeof(polygon));
    b->triangles = list_of(3 * sizeof(corner));
    b->flat = list_of(2 * sizeof(double));
    b->around = list_of(sizeof(size_t));
    b->mesh = mesh;
    b->why = why;
}

void builder_free(builder *b) {
    list_free(&b->positions);
    list_free(&b->normals);
    list_free(&b->rotations);
    list_free(&b->colors);
    list_free(&b->uvs);
    list_free(&b->corners);
    list_free(&b->polygons);
    list_free(&b->triangles);
    list_free(&b->flat);
    list_free(&b->around);
}

int builder_fail(const builder *b, size_t line, const char *format, ...) {
    char *to = b->mesh->message;
    const size_t room = sizeof b->mesh->message;
    int n = line ? snprintf(to, room, "line %lu: ", (unsigned long)line) : 0;
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(to + n, room - (size_t)n, format, arguments);
    va_end(arguments);
    *b->why = to;
    return 0;
}

int builder_fail_memory(const builder *b) {
    return builder_fail(b, 0, "not enough memory for this mesh");
}

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
static void flatten(const float *positions, const corner *p, size_t n, point *flat) {
    double normal[3] = {0, 0, 0};
    for (size_t i = 0; i < n; i++) { /* Newell's sum: right for any polygon, flat or not */
        const float *a = positions + 3 * (size_t)p[i].vertex;
        const float *b = positions + 3 * (size_t)p[i + 1 < n ? i + 1 : 0].vertex;
        for (int k = 0; k < 3; k++) {
            const int y = (k + 1) % 3, z = (k + 2) % 3;
            normal[k] += ((double)a[y] - (double)b[y]) * ((double)a[z] + (double)b[z]);
        }
    }
    int axis = 0;
    for (int k = 1; k < 3; k++) {
        if (fabs(normal[k]) > fabs(normal[axis])) axis = k;
    }
    const int x = (axis + 1) % 3, y = (axis + 2) % 3;
    for (size_t i = 0; i < n; i++) {
        const float *a = positions + 3 * (size_t)p[i].vertex;
        flat[i][0] = (double)a[normal[axis] < 0 ? y : x];
        flat[i][1] = (double)a[normal[axis] < 0 ? x : y];
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

/* Convex polygons become fans; from others ears are cut off while there are any. */
static int triangulate(builder *b, const corner *p, size_t n) {
    if (n == 3) return add_triangle(b, p[0], p[1], p[2]);
    size_t left = n, *around = NULL;
    if (n <= MAX_EARS) {
        b->flat.count = b->around.count = 0;
        point *flat = (point *)list_add(&b->flat, n);
        around = (size_t *)list_add(&b->around, n);
        if (!flat || !around) return builder_fail_memory(b);
        for (size_t i = 0; i < n; i++) around[i] = i;
        flatten((const float *)b->positions.items, p, n, flat);
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

int builder_triangulate(builder *b) {
    const polygon *polygons = (const polygon *)b->polygons.items;
    const corner *corners = (const corner *)b->corners.items;
    if (!list_reserve(&b->triangles, b->polygons.count)) return builder_fail_memory(b);
    for (size_t i = 0; i < b->polygons.count; i++) {
        const polygon *f = &polygons[i];
        for (size_t k = f->first; k < f->first + f->count; k++) {
            if (corners[k].vertex >= b->positions.count)
                return builder_fail(b, f->line, "a face with vertex %lu, but there are only %lu",
                                    (unsigned long)corners[k].vertex + 1,
                                    (unsigned long)b->positions.count);
            if (corners[k].uv != NO_UV && corners[k].uv >= b->uvs.count)
                return builder_fail(b, f->line,
                                    "a face with texture vertex %lu, but there are only %lu",
                                    (unsigned long)corners[k].uv + 1, (unsigned long)b->uvs.count);
        }
        if (!triangulate(b, corners + f->first, f->count)) return 0;
    }
    return 1;
}

/* Hand the list's block over to the mesh. */
static void *take(list *l) {
    void *items = l->items;
    l->items = NULL;
    return items;
}

int builder_finish(builder *b) {
    mesh_data *mesh = b->mesh;
    const size_t count = b->triangles.count;
    const corner *corners = (const corner *)b->triangles.items;
    int has_uvs = 0;
    size_t bytes;
    for (size_t i = 0; i < 3 * count && !has_uvs; i++) has_uvs = corners[i].uv != NO_UV;
    if (count) {
        if (!txm_mul(count, 6, sizeof(float), &bytes)) return builder_fail_memory(b);
        mesh->indices = (uint32_t *)malloc(bytes / 2);
        if (has_uvs) mesh->uvs = (float *)malloc(bytes);
        if (!mesh->indices || (has_uvs && !mesh->uvs)) return builder_fail_memory(b);
    }
    for (size_t i = 0; i < 3 * count; i++) {
        mesh->indices[i] = corners[i].vertex;
        if (!has_uvs) continue;
        const float *uv = (const float *)b->uvs.items + 2 * (size_t)corners[i].uv;
        mesh->uvs[2 * i] = corners[i].uv == NO_UV ? 0 : uv[0];
        mesh->uvs[2 * i + 1] = corners[i].uv == NO_UV ? 0 : turn_v(uv[1]);
    }
    mesh->vertex_count = b->positions.count;
    mesh->triangle_count = count;
    mesh->positions = (float *)take(&b->positions);
    mesh->normals = (float *)take(&b->normals);
    mesh->rotations = (float *)take(&b->rotations);
    mesh->colors = (unsigned char *)take(&b->colors);
    return 1;
}
