/* surfaces.h - surfaces made by the tests of trimesh_relax.h, vertex by vertex
   SPDX-License-Identifier: MIT OR Unlicense

   Include cmocka.h and trimesh_relax.h first. There is one surface, `in`; everything adds to it.  */
#ifndef SURFACES_H
#define SURFACES_H

enum { MOST_VERTICES = 60000, MOST_TRIANGLES = 40000 };

typedef struct shape {
    float at[3 * MOST_VERTICES], scale[MOST_VERTICES];
    uint32_t t[3 * MOST_TRIANGLES];
    size_t vertices, triangles;
    long euler; /* what the shape has, by construction */
    size_t components, loops;
} shape;

static shape in;

/* The surface as it is handed over, to be retiled with so many vertices. */
static inline trimesh_desc desc_of_in(size_t vertices) {
    trimesh_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.surface.positions = in.at;
    desc.surface.vertex_count = in.vertices;
    desc.surface.indices = in.t;
    desc.surface.face_count = in.triangles;
    desc.vertices = vertices;
    return desc;
}

static inline uint32_t vertex(double x, double y, double z) {
    float *p = in.at + 3 * in.vertices;
    assert_true(in.vertices < MOST_VERTICES);
    p[0] = (float)x;
    p[1] = (float)y;
    p[2] = (float)z;
    return (uint32_t)in.vertices++;
}

static inline void triangle(uint32_t a, uint32_t b, uint32_t c) {
    uint32_t *t = in.t + 3 * in.triangles++;
    assert_true(in.triangles <= MOST_TRIANGLES);
    t[0] = a;
    t[1] = b;
    t[2] = c;
}

static inline void quad(uint32_t a, uint32_t b, uint32_t c, uint32_t d) {
    triangle(a, b, c);
    triangle(a, c, d);
}

/* A box with its lowest corner at (x, y, z). */
static inline void add_box(double x, double y, double z, double w, double d, double h) {
    uint32_t c[8];
    for (int i = 0; i < 8; i++)
        c[i] = vertex(x + w * (i & 1), y + d * (i >> 1 & 1), z + h * (i >> 2));
    quad(c[0], c[2], c[3], c[1]);
    quad(c[4], c[5], c[7], c[6]);
    quad(c[0], c[1], c[5], c[4]);
    quad(c[2], c[6], c[7], c[3]);
    quad(c[0], c[4], c[6], c[2]);
    quad(c[1], c[3], c[7], c[5]);
}

#endif /* SURFACES_H */
