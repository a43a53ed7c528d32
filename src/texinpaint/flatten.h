#ifndef TEXINPAINT_FLATTEN_H
#define TEXINPAINT_FLATTEN_H

#include "factor.h"
#include "unfold.h"

/* ---- flatten: a disk of faces in the plane --------------------------------------------------- */

enum {
    TXI_ARAP_ROUNDS = 60 /* ours; it ends earlier when nothing moves any more */
};
#define TXI_COT_LEAST 0.05 /* ours: cotangents are limited to this range, as thin faces would */
#define TXI_COT_MOST 20.0  /* make the system ill-conditioned and negative ones turn faces over */

/* A disk laid out in the plane. */
typedef struct txi_flat {
    const txi_disk *disk;
    txm_dvec3 *point;       /* 1 per vertex                                                      */
    double *xy;             /* 2 per vertex, in the unit of the surface; faces counter-clockwise  */
    double *shape;          /* 3 per face: in its own plane the corners are (0, 0), (s0, 0),
                               (s1, s2)                                                          */
    double *cot;            /* 3 per face: the cotangent of the angle opposite of side k          */
    size_t edge_count;
    uint32_t *low, *high;   /* the vertices of each edge                                         */
    uint32_t *edge;         /* 3 per face: the edge of side k                                    */
} txi_flat;

/* Number the edges. */
static void txi_flat_edges(txi_flat *flat, uint32_t *first, uint32_t *sides, uint32_t *lows,
                           uint32_t *seen, uint32_t *seen_edge) {
    const txi_disk *disk = flat->disk;
    const size_t count = 3 * disk->face_count;
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t a = disk->corner[i], b = disk->corner[txi_next_corner(i)];
        lows[i] = a < b ? a : b;
    }
    txi_bin(lows, count, NULL, disk->vertex_count, first, sides);
    for (size_t v = 0; v < disk->vertex_count; v++) seen[v] = UINT32_MAX;
    flat->edge_count = 0;
    for (uint32_t v = 0; v < disk->vertex_count; v++) {
        for (uint32_t i = first[v]; i < first[v + 1]; i++) {
            const uint32_t a = disk->corner[sides[i]], b = disk->corner[txi_next_corner(sides[i])];
            const uint32_t other = a == v ? b : a;
            if (seen[other] != v) {
                seen[other] = v;
                seen_edge[other] = (uint32_t)flat->edge_count;
                TXM_ASSERT(flat->edge_count < count);
                flat->low[flat->edge_count] = v;
                flat->high[flat->edge_count++] = other;
            }
            flat->edge[sides[i]] = seen_edge[other];
        }
    }
}

/* The shapes of the faces and their cotangents, limited. */
static void txi_flat_shapes(txi_flat *flat, const txi_surface *s) {
    const txi_disk *disk = flat->disk;
    for (size_t i = 0; i < disk->face_count; i++) {
        txm_dvec3 p[3];
        double *shape = flat->shape + 3 * i;
        for (uint32_t k = 0; k < 3; k++) p[k] = txi_corner_point(s, 3 * disk->faces[i] + k);
        const txm_dvec3 ab = txm_d3_sub(p[1], p[0]), ac = txm_d3_sub(p[2], p[0]);
        const double l = txm_d3_len(ab), area = txm_d3_len(txm_d3_cross(ab, ac));
        shape[0] = l;
        shape[1] = l > 0 ? txm_d3_dot(ab, ac) / l : 0;
        shape[2] = l > 0 ? area / l : txm_d3_len(ac);
        for (int k = 0; k < 3; k++) {
            const txm_dvec3 at = p[(k + 2) % 3];
            const double dot = txm_d3_dot(txm_d3_sub(p[k], at), txm_d3_sub(p[(k + 1) % 3], at));
            const double c = area > 0 ? dot / area : TXI_COT_MOST;
            flat->cot[3 * i + (size_t)k] = fmin(fmax(c, TXI_COT_LEAST), TXI_COT_MOST);
        }
    }
}

static txm_status txi_flat_init(txi_flat *flat, const txi_surface *s, const txi_disk *disk,
                                const txm_dvec3 *point, txm_arena *arena, txm_env *env) {
    const size_t faces = disk->face_count, vertices = disk->vertex_count;
    txm_arena scratch;
    txm_arena_init(&scratch, env);
    memset(flat, 0, sizeof *flat);
    flat->disk = disk;
    flat->point = (txm_dvec3 *)txm_arena_alloc(arena, vertices, sizeof(txm_dvec3));
    flat->xy = (double *)txm_arena_zero(arena, vertices, 2 * sizeof(double));
    flat->shape = (double *)txm_arena_alloc(arena, faces, 3 * sizeof(double));
    flat->cot = (double *)txm_arena_alloc(arena, faces, 3 * sizeof(double));
    flat->low = (uint32_t *)txm_arena_alloc(arena, faces, 3 * sizeof(uint32_t));
    flat->high = (uint32_t *)txm_arena_alloc(arena, faces, 3 * sizeof(uint32_t));
    flat->edge = (uint32_t *)txm_arena_alloc(arena, faces, 3 * sizeof(uint32_t));
    uint32_t *first = (uint32_t *)txm_arena_alloc(&scratch, vertices + 1, sizeof(uint32_t));
    uint32_t *sides = (uint32_t *)txm_arena_alloc(&scratch, faces, 3 * sizeof(uint32_t));
    uint32_t *lows = (uint32_t *)txm_arena_alloc(&scratch, faces, 3 * sizeof(uint32_t));
    uint32_t *seen = (uint32_t *)txm_arena_alloc(&scratch, vertices, 2 * sizeof(uint32_t));
    const int good = !arena->failed && !scratch.failed;
    if (good) {
        memcpy(flat->point, point, vertices * sizeof *point);
        txi_flat_edges(flat, first, sides, lows, seen, seen + vertices);
        txi_flat_shapes(flat, s);
    }
    txm_arena_free(&scratch);
    return good ? TXM_OK : txi_no_memory(env);
}

/* The border on a circle, each vertex at its share of the length, the rest where each is the
   mean of its neighbours, weighted by positive cotangents: no face is turned over (Tutte). The
   circle has the area of the surface. weight and diagonal: scratch, 1 per edge and vertex. */
static void txi_tutte(txi_flat *flat, txi_factor *factor, double *weight, double *diagonal,
                      uint8_t *fixed) {
    const txi_disk *disk = flat->disk;
    const size_t vertices = disk->vertex_count;
    double length = 0, area = 0, at = 0;
    uint32_t side = disk->border;
    memset(weight, 0, flat->edge_count * sizeof *weight);
    memset(diagonal, 0, vertices * sizeof *diagonal);
    memset(fixed, 0, vertices);
    for (size_t i = 0; i < disk->face_count; i++)
        area += flat->shape[3 * i] * flat->shape[3 * i + 2] / 2;
    for (size_t k = 0; k < disk->loop; k++, side = disk->next[side])
        length += txm_d3_dist(flat->point[disk->corner[side]],
                              flat->point[disk->corner[txi_next_corner(side)]]) + 1e-12;
    const double radius = sqrt(area / TXM_PI);
    for (size_t k = 0; k < disk->loop; k++, side = disk->next[side]) {
        const uint32_t v = disk->corner[side], to = disk->corner[txi_next_corner(side)];
        double sine, cosine;
        txm_sincos(2 * TXM_PI * at / length, &sine, &cosine);
        at += txm_d3_dist(flat->point[v], flat->point[to]) + 1e-12;
        fixed[v] = 1;
        flat->xy[2 * (size_t)v] = radius * cosine;
        flat->xy[2 * (size_t)v + 1] = radius * sine;
    }
    for (size_t i = 0; i < 3 * disk->face_count; i++) weight[flat->edge[i]] += flat->cot[i];
    for (size_t v = 0; v < vertices; v++) {
        if (fixed[v]) diagonal[v] = 1;
        else flat->xy[2 * v] = flat->xy[2 * v + 1] = 0;
    }
    for (size_t e = 0; e < flat->edge_count; e++) {
        for (int turn = 0; turn < 2; turn++) {
            const size_t a = turn ? flat->high[e] : flat->low[e],
                         b = turn ? flat->low[e] : flat->high[e];
            if (fixed[a]) continue;
            diagonal[a] += weight[e];
            if (!fixed[b]) continue;
            flat->xy[2 * a] += weight[e] * flat->xy[2 * b];
            flat->xy[2 * a + 1] += weight[e] * flat->xy[2 * b + 1];
        }
        if (fixed[flat->low[e]] || fixed[flat->high[e]]) weight[e] = 0;
    }
    txi_factor_make(factor, weight, diagonal);
    txi_factor_solve(factor, flat->xy);
}

/* Corner k of face i in its own plane. */
static void txi_shape_corner(const double *shape, int k, double *x, double *y) {
    *x = k == 0 ? 0 : k == 1 ? shape[0] : shape[1];
    *y = k == 2 ? shape[2] : 0;
}

/* Turn face i as it lies best, a b being the cosine and sine of the angle, and add its part of the
   right sides. */
static void txi_arap_face(const txi_flat *flat, size_t i, double face_weight, double *right) {
    double qx[3], qy[3], a = 0, b = 0;
    size_t v[3];
    for (int k = 0; k < 3; k++) {
        txi_shape_corner(flat->shape + 3 * i, k, &qx[k], &qy[k]);
        v[k] = flat->disk->corner[3 * i + (size_t)k];
    }
    for (int k = 0; k < 3; k++) {
        const int j = (k + 1) % 3;
        const double c = flat->cot[3 * i + (size_t)k];
        const double px = flat->xy[2 * v[j]] - flat->xy[2 * v[k]];
        const double py = flat->xy[2 * v[j] + 1] - flat->xy[2 * v[k] + 1];
        a += c * (px * (qx[j] - qx[k]) + py * (qy[j] - qy[k]));
        b += c * (py * (qx[j] - qx[k]) - px * (qy[j] - qy[k]));
    }
    const double n = sqrt(a * a + b * b);
    a = n > 0 ? a / n : 1;
    b = n > 0 ? b / n : 0;
    for (int k = 0; k < 3; k++) {
        const int j = (k + 1) % 3;
        const double c = flat->cot[3 * i + (size_t)k] * face_weight;
        const double x = c * (a * (qx[j] - qx[k]) - b * (qy[j] - qy[k]));
        const double y = c * (b * (qx[j] - qx[k]) + a * (qy[j] - qy[k]));
        right[2 * v[j]] += x;
        right[2 * v[j] + 1] += y;
        right[2 * v[k]] -= x;
        right[2 * v[k] + 1] -= y;
    }
}

/* As rigid as possible: turn each face as it lies best, then move the vertices so that the sum over
   the sides of

       weight(face) cot(side) |p_i - p_j - R(face) (q_i - q_j)|^2

   is least, q being the face in its own plane; by turns (the local and the global step of [6]). The
   weights of faces are not in [6]: what is known may be distorted more than the hole.

   weight, diagonal, right  scratch, 1 per edge, 1 and 2 per vertex
   small_step  of vertices, in the unit of the surface: end when none moves farther        */
static void txi_arap(txi_flat *flat, txi_factor *factor, const double *face_weight, double *weight,
                     double *diagonal, double *right, double small_step) {
    const txi_disk *disk = flat->disk;
    const size_t vertices = disk->vertex_count;
    memset(weight, 0, flat->edge_count * sizeof *weight);
    memset(diagonal, 0, vertices * sizeof *diagonal);
    for (size_t i = 0; i < 3 * disk->face_count; i++)
        weight[flat->edge[i]] += flat->cot[i] * face_weight[i / 3];
    for (size_t e = 0; e < flat->edge_count; e++) {
        diagonal[flat->low[e]] += weight[e];
        diagonal[flat->high[e]] += weight[e];
    }
    /* one vertex is held weakly where it lies: the sum does not depend on where the whole lies */
    const double hold = diagonal[0] * 1e-3;
    diagonal[0] += hold;
    txi_factor_make(factor, weight, diagonal);
    for (int round = 0; round < TXI_ARAP_ROUNDS; round++) {
        memset(right, 0, vertices * 2 * sizeof *right);
        right[0] = hold * flat->xy[0];
        right[1] = hold * flat->xy[1];
        for (size_t i = 0; i < disk->face_count; i++)
            txi_arap_face(flat, i, face_weight[i], right);
        txi_factor_solve(factor, right);
        double moved = 0;
        for (size_t v = 0; v < 2 * vertices; v++) {
            moved = fmax(moved, fabs(right[v] - flat->xy[v]));
            flat->xy[v] = right[v];
        }
        if (moved < small_step) break;
    }
}

/* Lay the disk out. face_weight: 1 per face of the disk, how rigid it is to be, above 0. */
static txm_status txi_flatten(txi_flat *flat, const double *face_weight, double small_step,
                              txm_env *env) {
    const size_t vertices = flat->disk->vertex_count;
    txm_arena scratch;
    txi_factor factor;
    txm_arena_init(&scratch, env);
    double *weight = (double *)txm_arena_alloc(&scratch, flat->edge_count, sizeof(double));
    double *diagonal = (double *)txm_arena_alloc(&scratch, vertices, sizeof(double));
    double *right = (double *)txm_arena_alloc(&scratch, vertices, 2 * sizeof(double));
    uint8_t *fixed = (uint8_t *)txm_arena_alloc(&scratch, vertices, 1);
    txm_status status = scratch.failed ? txi_no_memory(env) : TXM_OK;
    if (status == TXM_OK)
        status = txi_factor_plan(&factor, vertices, flat->point, flat->edge_count, flat->low,
                                 flat->high, &scratch, env);
    if (status == TXM_OK) {
        txi_tutte(flat, &factor, weight, diagonal, fixed);
        txi_arap(flat, &factor, face_weight, weight, diagonal, right, small_step);
    }
    txm_arena_free(&scratch);
    return status;
}

#endif /* TEXINPAINT_FLATTEN_H */
