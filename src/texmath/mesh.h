#ifndef TEXMATH_MESH_H
#define TEXMATH_MESH_H

#include "env.h"
#include "random.h"
#include "vector.h"

/* ---- meshes ----------------------------------------------------------------------------- */

/* A mesh that the caller owns: faces of 3 corners each, or of 4. */
typedef struct txm_mesh {
    const float *positions;  /* 3 per vertex, finite; NULL where a function needs none         */
    const uint32_t *indices; /* the vertices of each face, counter-clockwise seen from outside */
    size_t vertex_count, face_count;
    int corners; /* of a face: 3 or 4; 0 = 3 */
} txm_mesh;

/* A place on a mesh of triangles: (1 - u - v) a + u b + v c of the corners a, b, c of a triangle,
   in the order of its indices. */
typedef struct txm_mesh_place {
    uint32_t triangle;
    float u, v; /* each 0..1, u + v at most 1 */
} txm_mesh_place;

/* no side, as sides are numbered in 32 bits */
#define TXM_NO_SIDE 0xffffffffu

/* corners of a face, sides of a mesh */
static inline size_t txm_mesh_corners(const txm_mesh *mesh) {
    return mesh->corners ? (size_t)mesh->corners : 3;
}
static inline size_t txm_mesh_sides(const txm_mesh *mesh) {
    return mesh->face_count * txm_mesh_corners(mesh);
}

/* Is this a valid mesh? Any connectivity is allowed: borders, edges of many faces,
   faces that name a vertex twice. A mesh without faces or vertices needs no array for them.

   name       what the caller calls the mesh, for the message: "mesh: indices is NULL"
   corners    number of corners that faces must have, 3 or 4; 0 = either
   positions  non-zero: they are needed and must be finite; 0: they are ignored
   most       refuse more vertices or faces; 0 = no limit but that of 32-bit numbers of sides
   return     TXM_OK; TXM_BAD_ARGUMENT; TXM_TOO_LARGE. The message names the first face or vertex
              that is wrong, from 0
   cost       O(faces + vertices)                                                          */
static inline txm_status txm_mesh_check(const txm_mesh *mesh, const char *name, int corners,
                                        int positions, size_t most, txm_env *env) {
    if (!mesh) return txm_fail_at(env, TXM_BAD_ARGUMENT, name, "is NULL; pass a txm_mesh");
    if (mesh->corners != 0 && mesh->corners != 3 && mesh->corners != 4)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name, "corners must be 3 or 4 (0 means 3)");
    const size_t n = txm_mesh_corners(mesh);
    if (corners && n != (size_t)corners)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name,
                           corners == 3 ? "faces must be triangles" : "faces must be quads");
    if (most && (mesh->vertex_count > most || mesh->face_count > most))
        return txm_fail_numbers_at(env, TXM_TOO_LARGE, name, "more than # vertices or faces", most,
                                   0);
    if (mesh->face_count > (TXM_NO_SIDE - 1) / n || mesh->face_count > SIZE_MAX / 64 ||
        (positions && mesh->vertex_count > SIZE_MAX / 64))
        return txm_fail_at(env, TXM_TOO_LARGE, name,
                           "more faces or vertices than 32 bits can number the sides of");
    if (mesh->face_count && !mesh->indices)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name, "indices is NULL");
    if (positions && mesh->vertex_count && !mesh->positions)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name, "positions is NULL");
    for (size_t i = 0; i < n * mesh->face_count; i++) {
        if (mesh->indices[i] >= mesh->vertex_count)
            return txm_fail_numbers_at(env, TXM_BAD_ARGUMENT, name,
                                       "face # names vertex #, which is not below vertex_count",
                                       i / n, mesh->indices[i]);
    }
    for (size_t i = 0; positions && i < 3 * mesh->vertex_count; i++) {
        if (!txm_is_finite(mesh->positions[i]))
            return txm_fail_numbers_at(env, TXM_BAD_ARGUMENT, name,
                                       "the position of vertex # is not finite", i / 3, 0);
    }
    return TXM_OK;
}

/* the position of a corner; corner k of face f has the number f * corners + k */
static inline txm_dvec3 txm_mesh_point(const txm_mesh *mesh, size_t corner) {
    return txm_d3_load(mesh->positions + 3 * (size_t)mesh->indices[corner]);
}
/* the positions of a triangle's corners */
static inline void txm_mesh_triangle(const txm_mesh *mesh, size_t face, txm_dvec3 p[3]) {
    for (size_t k = 0; k < 3; k++) p[k] = txm_mesh_point(mesh, 3 * face + k);
}

/* Side i runs from corner i to the next corner of its face, whose number this is. */
static inline size_t txm_mesh_next(const txm_mesh *mesh, size_t i) {
    if (mesh->corners == 4) return i % 4 == 3 ? i - 3 : i + 1;
    return i % 3 == 2 ? i - 2 : i + 1;
}
/* the lower and the higher vertex of side i: its edge */
static inline uint32_t txm_mesh_low(const txm_mesh *mesh, size_t i) {
    const uint32_t a = mesh->indices[i], b = mesh->indices[txm_mesh_next(mesh, i)];
    return a < b ? a : b;
}
static inline uint32_t txm_mesh_high(const txm_mesh *mesh, size_t i) {
    const uint32_t a = mesh->indices[i], b = mesh->indices[txm_mesh_next(mesh, i)];
    return a < b ? b : a;
}

/* Does side i run from the higher vertex to the lower? From a vertex to itself: the last side of a
   face does, so that they do not all run one way round. */
static inline int txm_mesh_runs_down(const txm_mesh *mesh, size_t i) {
    const size_t next = txm_mesh_next(mesh, i);
    const uint32_t a = mesh->indices[i], b = mesh->indices[next];
    return a == b ? next < i : a > b;
}

/* A color 0..colors-1 for the edge of side i, by hash of its two vertices, so that all functions
   that color the edges of a mesh with the same seed and number agree. */
static inline int txm_mesh_edge_color(const txm_mesh *mesh, size_t i, uint64_t seed, int colors) {
    const uint64_t edge = (uint64_t)txm_mesh_high(mesh, i) << 32 | txm_mesh_low(mesh, i);
    const uint64_t hash = txm_hash(txm_hash(seed ^ 0x7465787475726573u) + edge) >> 32;
    return (int)(hash * (uint64_t)colors >> 32);
}

/* the order of sides: by the lower, then by the higher vertex of the edge, then by number */
static inline int txm_mesh_before(const txm_mesh *mesh, uint32_t a, uint32_t b) {
    const uint32_t a_low = txm_mesh_low(mesh, a), b_low = txm_mesh_low(mesh, b);
    const uint32_t a_high = txm_mesh_high(mesh, a), b_high = txm_mesh_high(mesh, b);
    if (a_low != b_low) return a_low < b_low;
    return a_high != b_high ? a_high < b_high : a < b;
}

/* Restore the heap from root down. */
static inline void txm_mesh_sift(const txm_mesh *mesh, uint32_t *heap, size_t root, size_t count) {
    for (size_t child = 2 * root + 1; child < count; root = child, child = 2 * root + 1) {
        if (child + 1 < count && txm_mesh_before(mesh, heap[child], heap[child + 1])) child++;
        if (txm_mesh_before(mesh, heap[child], heap[root])) return;
        const uint32_t side = heap[root];
        heap[root] = heap[child];
        heap[child] = side;
    }
}

/* Sort the sides of one bin: a few with the same lower vertex, as most bins are, by insertion,
   their keys being the higher vertex and the number; others as a heap. */
static inline void txm_mesh_sort_bin(const txm_mesh *mesh, uint32_t *sides, size_t count,
                                     int is_vertex) {
    enum { FEW = 48 };
    uint64_t key[FEW];
    if (count < 2) return;
    if (!is_vertex || count > FEW) {
        for (size_t i = count / 2; i-- > 0;) txm_mesh_sift(mesh, sides, i, count);
        for (size_t end = count - 1; end > 0; end--) {
            const uint32_t side = sides[0];
            sides[0] = sides[end];
            sides[end] = side;
            txm_mesh_sift(mesh, sides, 0, end);
        }
        return;
    }
    for (size_t i = 0; i < count; i++) {
        const uint64_t k = (uint64_t)txm_mesh_high(mesh, sides[i]) << 32 | sides[i];
        size_t at = i;
        for (; at > 0 && key[at - 1] > k; at--) key[at] = key[at - 1];
        key[at] = k;
    }
    for (size_t i = 0; i < count; i++) sides[i] = (uint32_t)key[i];
}

/* Which sides share an edge, that is, have the same two vertices: sort the sides by the lower, then
   by the higher vertex of their edge. Those of one edge lie together, the lowest number first.

       for (size_t i = 0, end; i < sides; i = end) {
           end = txm_mesh_edge_end(mesh, sorted, i);
           ...  sorted[i] to sorted[end - 1] are the sides of one edge
       }

   The sides are counted into bins by the lower vertex, or by ranges of it if vertex numbers are
   larger than the number of sides, and each bin is sorted. The mesh must have passed
   txm_mesh_check.
   sorted  receives the numbers of the sides; room for 2 for each, the upper half is scratch
   cost    O(n log m) for n sides, of which at most m are in one bin; m is usually about 6 */
static inline void txm_mesh_sort_sides(const txm_mesh *mesh, uint32_t *sorted) {
    const size_t sides = txm_mesh_sides(mesh);
    uint32_t *next = sorted + sides, sum = 0, begin = 0;
    uint64_t span = 0; /* above all lower vertices */
    for (size_t i = 0; i < sides; i++) {
        const uint64_t low = txm_mesh_low(mesh, i);
        if (low >= span) span = low + 1;
    }
    const int is_vertex = span <= sides;
    const size_t bins = is_vertex ? (size_t)span : sides;
    memset(next, 0, bins * sizeof *next);
    for (size_t i = 0; i < sides; i++) {
        const uint64_t low = txm_mesh_low(mesh, i);
        next[is_vertex ? low : low * sides / span]++;
    }
    for (size_t b = 0; b < bins; b++) { /* from how many to where the first goes */
        const uint32_t n = next[b];
        next[b] = sum;
        sum += n;
    }
    for (size_t i = 0; i < sides; i++) {
        const uint64_t low = txm_mesh_low(mesh, i);
        sorted[next[is_vertex ? low : low * sides / span]++] = (uint32_t)i;
    }
    for (size_t b = 0; b < bins; b++) {
        txm_mesh_sort_bin(mesh, sorted + begin, next[b] - begin, is_vertex);
        begin = next[b];
    }
}

/* one past the last of the sorted sides that share the edge of sorted[i] */
static inline size_t txm_mesh_edge_end(const txm_mesh *mesh, const uint32_t *sorted, size_t i) {
    const size_t sides = txm_mesh_sides(mesh);
    const uint32_t low = txm_mesh_low(mesh, sorted[i]), high = txm_mesh_high(mesh, sorted[i]);
    do i++;
    while (i < sides && txm_mesh_low(mesh, sorted[i]) == low &&
           txm_mesh_high(mesh, sorted[i]) == high);
    return i;
}

/* options of txm_mesh_link; add them up */
enum {
    TXM_LINK_DOWN = 1,  /* each side to the one before it, the lowest to the highest          */
    TXM_LINK_POINTS = 2 /* sides from a vertex to itself have an edge like others             */
};

/* Link the sides of each edge into a ring: next[side] is the next higher side there, after the
   highest the lowest; a side without others, or from a vertex to itself, is its own next.

   sorted  the sides as txm_mesh_sort_sides left them
   flags   0, or options
   next    receives one side for each; may be sorted + sides                               */
static inline void txm_mesh_link(const txm_mesh *mesh, const uint32_t *sorted, int flags,
                                 uint32_t *next) {
    const size_t sides = txm_mesh_sides(mesh);
    for (size_t i = 0, end; i < sides; i = end) {
        end = txm_mesh_edge_end(mesh, sorted, i);
        const int is_point = txm_mesh_low(mesh, sorted[i]) == txm_mesh_high(mesh, sorted[i]);
        for (size_t k = i; k < end; k++) {
            const size_t up = k + 1 < end ? k + 1 : i, down = k > i ? k - 1 : end - 1;
            const size_t other = is_point && !(flags & TXM_LINK_POINTS) ? k
                                 : flags & TXM_LINK_DOWN                ? down
                                                                        : up;
            next[sorted[k]] = sorted[other];
        }
    }
}

#endif /* TEXMATH_MESH_H */
