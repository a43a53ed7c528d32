/* meshkit.h - mesh files as bytes, read with the sanitizer looking on
   SPDX-License-Identifier: MIT OR Unlicense

   The test includes cmocka.h first.                                                             */
#ifndef MESHKIT_H
#define MESHKIT_H

#include "files/mesh_io.h"

#include <stdio.h>

/* An exact copy on the heap, so that the sanitizer sees any read beyond it. */
static inline int decode(const void *bytes, size_t size, int points_too, mesh_data *mesh,
                  const char **why) {
    unsigned char *copy = (unsigned char *)malloc(size ? size : 1);
    assert_non_null(copy);
    if (size) memcpy(copy, bytes, size);
    *why = NULL;
    const int ok = mesh_decode(copy, size, points_too, mesh, why);
    free(copy);
    if (!ok) { /* one line that says why, and nothing left behind */
        assert_non_null(*why);
        assert_true((*why)[0] != 0 && strchr(*why, '\n') == NULL);
        assert_null(mesh->positions);
        assert_null(mesh->indices);
        assert_int_equal(mesh->vertex_count, 0);
    }
    return ok;
}

static inline void read_text(const char *text, mesh_data *mesh) {
    const char *why;
    if (!decode(text, strlen(text), 0, mesh, &why)) fail_msg("%s", why);
}

static inline void assert_fails(const char *text, const char *expected) {
    mesh_data mesh;
    const char *why;
    assert_false(decode(text, strlen(text), 0, &mesh, &why));
    assert_string_equal(why, expected);
}

static inline void assert_indices(const mesh_data *mesh, const uint32_t *indices, size_t triangles) {
    assert_int_equal(mesh->triangle_count, triangles);
    assert_memory_equal(mesh->indices, indices, 3 * triangles * sizeof *indices);
}

/* Twice the area of all triangles of a mesh in the plane z = 0, those clockwise taken off. */
static inline double flat_area2(const mesh_data *m) {
    double sum = 0;
    for (size_t t = 0; t < m->triangle_count; t++) {
        const float *a = m->positions + 3 * (size_t)m->indices[3 * t];
        const float *b = m->positions + 3 * (size_t)m->indices[3 * t + 1];
        const float *c = m->positions + 3 * (size_t)m->indices[3 * t + 2];
        const double area2 = (double)(b[0] - a[0]) * (double)(c[1] - a[1]) -
                             (double)(b[1] - a[1]) * (double)(c[0] - a[0]);
        assert_true(area2 >= 0);
        sum += area2;
    }
    return sum;
}

#endif /* MESHKIT_H */
