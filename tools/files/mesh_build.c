/* mesh_build.c - what a reader has gathered becomes a mesh
   SPDX-License-Identifier: MIT OR Unlicense */
#include "mesh_file.h"

#include <stdarg.h>
#include <stdio.h>

static const double MOST_COORDINATE = 1e100; /* farther away nothing is measured in any unit */

/* ---- what a reader has gathered ---------------------------------------------------------- */

void builder_init(builder *b, mesh_data *mesh, const char **why) {
    memset(b, 0, sizeof *b);
    b->positions = list_of(3 * sizeof(double));
    b->normals = list_of(3 * sizeof(float));
    b->rotations = list_of(4 * sizeof(float));
    b->colors = list_of(4);
    b->uvs = list_of(2 * sizeof(float));
    b->corners = list_of(sizeof(corner));
    b->polygons = list_of(sizeof(polygon));
    b->triangles = list_of(3 * sizeof(corner));
    b->bad = list_of(sizeof(bad_position));
    b->names = b->library = list_of(1);
    b->vertex_shades = b->face_shades = list_of(sizeof(shade));
    b->texcoords = list_of(sizeof(float));
    b->faces = list_of(sizeof(uint32_t));
    b->material = NO_MATERIAL;
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
    list_free(&b->bends);
    list_free(&b->heap);
    list_free(&b->sorted);
    list_free(&b->boxes);
    list_free(&b->bad);
    list_free(&b->names);
    list_free(&b->library);
    list_free(&b->vertex_shades);
    list_free(&b->face_shades);
    list_free(&b->texcoords);
    list_free(&b->faces);
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

/* ---- what is not finite ------------------------------------------------------------------ */

/* Coordinates whose squares and products of some do not overflow. */
static int is_usable(const double *p) {
    for (int k = 0; k < 3; k++) {
        if (!(fabs(p[k]) <= MOST_COORDINATE)) return 0;
    }
    return 1;
}

int builder_check_position(builder *b, size_t vertex, size_t line) {
    double *p = (double *)b->positions.items + 3 * vertex;
    if (is_usable(p)) return 1;
    bad_position *bad = (bad_position *)list_add(&b->bad, 1);
    if (!bad) return builder_fail_memory(b);
    bad->vertex = vertex;
    bad->line = line;
    p[0] = p[1] = p[2] = NAN;
    return 1;
}

int builder_add_polygon(builder *b, size_t first, size_t line) {
    if (b->corners.count - first < 3) {
        b->corners.count = first;
        b->left_out[LEFT_FACES]++;
        return 1;
    }
    polygon *f = (polygon *)list_add(&b->polygons, 1);
    if (!f) return builder_fail_memory(b);
    f->first = first;
    f->count = b->corners.count - first;
    f->line = line;
    f->material = b->material;
    return 1;
}

int strip_add(builder *b, strip *s, uint32_t vertex) {
    const size_t first = b->corners.count, turned = s->count & 1;
    const uint32_t v[3] = {s->last[turned], s->last[1 - turned], vertex};
    s->last[0] = s->last[1];
    s->last[1] = vertex;
    if (s->count++ < 2 || v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) return 1;
    corner *c = (corner *)list_add(&b->corners, 3);
    if (!c) return builder_fail_memory(b);
    for (int k = 0; k < 3; k++) c[k].vertex = c[k].uv = v[k];
    return builder_add_polygon(b, first, 0);
}

static int fail_bad_position(const builder *b, size_t vertex) {
    const bad_position *bad = (const bad_position *)b->bad.items;
    size_t i = 0;
    while (i + 1 < b->bad.count && bad[i].vertex != vertex) i++;
    return builder_fail(b, bad[i].line, "vertex %lu has a coordinate that is not a finite number",
                        (unsigned long)vertex + 1);
}

/* Normals that are not finite become none. */
static void mend_normals(builder *b) {
    float *n = (float *)b->normals.items;
    for (size_t i = 0; i < b->normals.count; i++, n += 3) {
        if (txm_is_finite((double)n[0]) && txm_is_finite((double)n[1]) &&
            txm_is_finite((double)n[2]))
            continue;
        n[0] = n[1] = n[2] = 0;
        b->left_out[LEFT_NORMALS]++;
    }
}

/* Texture coordinates that are not finite; no corner may use them any more. */
static void count_bad_uvs(builder *b) {
    const float *uv = (const float *)b->uvs.items;
    for (size_t i = 0; i < b->uvs.count; i++, uv += 2)
        b->left_out[LEFT_UVS] += !txm_is_finite((double)uv[0]) || !txm_is_finite((double)uv[1]);
}

static int is_bad_uv(const builder *b, uint32_t uv) {
    const float *p = (const float *)b->uvs.items + 2 * (size_t)uv;
    return !txm_is_finite((double)p[0]) || !txm_is_finite((double)p[1]);
}

/* ---- polygons to triangles --------------------------------------------------------------- */

/* Does all that the polygon refers to exist? Texture coordinates that are none are forgotten. */
static int check_polygon(builder *b, const polygon *f) {
    corner *corners = (corner *)b->corners.items;
    for (corner *c = corners + f->first; c < corners + f->first + f->count; c++) {
        if (c->vertex >= b->positions.count)
            return builder_fail(b, f->line, "a face with vertex %lu, but there are only %lu",
                                (unsigned long)c->vertex + 1, (unsigned long)b->positions.count);
        if (isnan(((const double *)b->positions.items)[3 * (size_t)c->vertex]))
            return fail_bad_position(b, c->vertex);
        if (c->uv == NO_UV) continue;
        if (c->uv >= b->uvs.count)
            return builder_fail(b, f->line,
                                "a face with texture vertex %lu, but there are only %lu",
                                (unsigned long)c->uv + 1, (unsigned long)b->uvs.count);
        if (b->left_out[LEFT_UVS] && is_bad_uv(b, c->uv)) c->uv = NO_UV;
    }
    return 1;
}

int builder_triangulate(builder *b) {
    const polygon *polygons = (const polygon *)b->polygons.items;
    if (!list_reserve(&b->triangles, b->polygons.count)) return builder_fail_memory(b);
    count_bad_uvs(b);
    mend_normals(b);
    for (size_t i = 0; i < b->polygons.count; i++) {
        const polygon *f = &polygons[i];
        const corner *corners = (const corner *)b->corners.items + f->first;
        if (!check_polygon(b, f) || !polygon_triangulate(b, corners, f->count)) return 0;
        if (!builder_note_faces(b)) return 0;
    }
    return 1;
}

/* ---- the mesh ---------------------------------------------------------------------------- */

/* Hand the list's block over to the mesh. */
static void *take(list *l) {
    void *items = l->items;
    l->items = NULL;
    return items;
}

/* Positions relative to the place of what is used. What is not, and what floats cannot hold, comes
   to lie upon a vertex that is. */
static int place_positions(builder *b) {
    mesh_data *mesh = b->mesh;
    const double *from = (const double *)b->positions.items;
    const corner *corners = (const corner *)b->triangles.items;
    const size_t count = b->positions.count, used = 3 * b->triangles.count;
    size_t bytes, first = used ? corners[0].vertex : 0;
    if (used == 0 && b->bad.count) return fail_bad_position(b, *(const size_t *)b->bad.items);
    if (!txm_mul(count, 3, sizeof(float), &bytes)) return builder_fail_memory(b);
    unsigned char *is_used = (unsigned char *)malloc(count + 1);
    mesh->positions = (float *)malloc(bytes + 1);
    if (!is_used || !mesh->positions) {
        free(is_used);
        return builder_fail_memory(b);
    }
    memset(is_used, used == 0, count);
    for (size_t c = 0; c < used; c++) is_used[corners[c].vertex] = 1;
    if (!b->unmoved) mesh->place = place_choose(from, is_used, count);
    int ok = 1;
    for (size_t i = 0; i < count && ok; i++) {
        int fits = 1;
        for (size_t k = 0; k < 3; k++) {
            float *to = &mesh->positions[3 * i + k];
            *to = mesh_place_in(&mesh->place, from[3 * i + k], (int)k);
            fits &= txm_is_finite((double)*to);
        }
        if (fits) continue;
        b->left_out[LEFT_VERTICES]++;
        if (is_used[i])
            ok = builder_fail(b, 0, "vertex %lu lies too far away from others",
                              (unsigned long)i + 1);
        for (size_t k = 0; k < 3 && ok; k++)
            mesh->positions[3 * i + k] = mesh_place_in(&mesh->place, from[3 * first + k], (int)k);
    }
    free(is_used);
    return ok;
}

/* Say in one line what was left out. */
static void write_note(builder *b) {
    static const char *const names[LEFT_KINDS] = {
        "faces with less than three corners", "unused vertices that are not finite",
        "texture coordinates that are not finite", "normals that are not finite",
        "attributes of STL facets", "points and lines", "instanced meshes", "skins",
        "morph targets", "colors that are not finite", "further material libraries",
        "pictures and colors of materials"};
    char *to = b->mesh->note;
    const size_t room = sizeof b->mesh->note;
    size_t n = 0;
    for (int k = 0; k < LEFT_KINDS; k++) {
        if (b->left_out[k] == 0) continue;
        const int more = snprintf(to + n, room - n, "%s%s (%lu)", n ? ", " : "left out: ", names[k],
                                  (unsigned long)b->left_out[k]);
        n = more > 0 && (size_t)more < room - n ? n + (size_t)more : n;
    }
    if (b->commas)
        snprintf(to + n, room - n, "%scommas in numbers were taken for decimal points",
                 n ? "; " : "");
}

int builder_finish(builder *b) {
    mesh_data *mesh = b->mesh;
    const size_t count = b->triangles.count;
    const corner *corners = (const corner *)b->triangles.items;
    int has_uvs = 0;
    size_t bytes;
    if (!place_positions(b) || !builder_finish_dress(b)) return 0;
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
        mesh->uvs[2 * i + 1] = corners[i].uv == NO_UV ? 0 : b->v_runs_down ? uv[1] : turn_v(uv[1]);
    }
    mesh->vertex_count = b->positions.count;
    mesh->triangle_count = count;
    mesh->normals = b->normals.count ? (float *)take(&b->normals) : NULL;
    mesh->rotations = (float *)take(&b->rotations);
    mesh->colors = (unsigned char *)take(&b->colors);
    write_note(b);
    return 1;
}
