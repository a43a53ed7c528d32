/* mesh_build.c - what a reader has gathered becomes a mesh
   SPDX-License-Identifier: MIT OR Unlicense */
#include "mesh_file.h"

#include <stdarg.h>
#include <stdio.h>

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
        if (!polygon_triangulate(b, corners + f->first, f->count)) return 0;
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
