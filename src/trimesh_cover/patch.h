#ifndef TRIMESH_COVER_PATCH_H
#define TRIMESH_COVER_PATCH_H

#include "scatter.h"

/* ---- geometry on triangles: making patches --------------------------------------------------- */

#define TMC_RADIUS 1.9 /* ours: radius of influence, in steps; best of 1.5, 1.7, 1.9, 2.5 */
#define TMC_FORCE 0.2  /* ours: constant f; best of 0.1, 0.2, 0.3, 0.5 */

/* Points as u, v; the triangles across the sides are treated as mirror images. */
typedef struct tmc_uv {
    double u, v;
} tmc_uv;

/* its mirror image in side k: the weight of the opposite corner changes its sign */
static tmc_uv tmc_mirror(tmc_uv p, int k) {
    const double w = 1 - p.u - p.v, s = k == 0 ? p.v : k == 1 ? w : p.u;
    tmc_uv q;
    q.u = k == 2 ? -s : p.u + s;
    q.v = k == 0 ? -s : p.v + s;
    return q;
}

static double tmc_uv_dist2(tmc_uv a, tmc_uv b) {
    const double u = a.u - b.u, v = a.v - b.v;
    return u * u + u * v + v * v;
}

/* Each next point is the one furthest from those before and their images. gap: 1 per point. */
static void tmc_order(trimesh_point *points, size_t count, double *gap) {
    tmc_uv at;
    at.u = at.v = 1.0 / 3;
    for (size_t i = 0; i < count; i++) { /* the first: nearest to the middle */
        tmc_uv p;
        p.u = points[i].u;
        p.v = points[i].v;
        gap[i] = 100 - tmc_uv_dist2(at, p);
    }
    for (size_t i = 0; i < count; i++) {
        size_t best = i;
        for (size_t k = i + 1; k < count; k++) {
            if (gap[k] > gap[best]) best = k;
        }
        const trimesh_point chosen = points[best];
        points[best] = points[i];
        gap[best] = gap[i];
        points[i] = chosen;
        at.u = chosen.u;
        at.v = chosen.v;
        const tmc_uv copies[4] = {at, tmc_mirror(at, 0), tmc_mirror(at, 1), tmc_mirror(at, 2)};
        for (size_t k = i + 1; k < count; k++) {
            tmc_uv p;
            p.u = points[k].u;
            p.v = points[k].v;
            for (int c = 0; c < 4; c++) gap[k] = fmin(gap[k], tmc_uv_dist2(copies[c], p));
        }
    }
}

TRIMESH_COVER_API txm_status trimesh_order_patch(trimesh_point *points, size_t count, txm_env *env) {
    txm_arena arena;
    if (count > 16384) return txm_fail(env, TXM_TOO_LARGE, "more than 16384 points to order");
    if (count == 0) return TXM_OK;
    if (!points) return txm_fail(env, TXM_BAD_ARGUMENT, "points is NULL");
    for (size_t i = 0; i < count; i++) {
        const txm_status status = tmc_check_point(&points[i], 0, i, env);
        if (status != TXM_OK) return status;
    }
    if (tmc_report(env, 0, "order") != TXM_OK) return TXM_CANCELLED;
    txm_arena_init(&arena, env);
    double *gap = (double *)txm_arena_alloc(&arena, count, sizeof(double));
    const txm_status status = tmc_check_memory(&arena, env);
    if (status == TXM_OK) tmc_order(points, count, gap);
    txm_arena_free(&arena);
    return status;
}

/* Repulsion inside a triangle: `fixed` points on its sides, the others move. */
typedef struct tmc_swarm {
    int fixed, count;       /* points                                                     */
    int all;                /* including the images near the sides                        */
    double radius, margin;  /* of influence; least weight of a corner for those that move */
    tmc_uv *at, *to;        /* room for 4 per point                                       */
    int *head, *next;       /* which points lie in a cell: a list each                    */
    int cells;              /* a side; cell (0, 0) begins at (-1/2, -1/2)                 */
} tmc_swarm;

static int tmc_cell(const tmc_swarm *s, double x) {
    return txm_clampi((int)((x + 0.5) * 0.5 * s->cells), 0, s->cells - 1);
}

static void tmc_fill_cells(tmc_swarm *s) {
    s->all = s->count;
    for (int i = s->fixed; i < s->count; i++) {
        for (int k = 0; k < 3; k++) {
            const tmc_uv image = tmc_mirror(s->at[i], k);
            if (!(tmc_uv_dist2(image, s->at[i]) < 4 * s->radius * s->radius)) continue;
            TXM_ASSERT(s->all < 4 * s->count); /* itself and three images */
            s->at[s->all++] = image;
        }
    }
    for (int c = 0; c < s->cells * s->cells; c++) s->head[c] = -1;
    for (int i = 0; i < s->all; i++) {
        int *head = &s->head[s->cells * tmc_cell(s, s->at[i].v) + tmc_cell(s, s->at[i].u)];
        s->next[i] = *head;
        *head = i;
    }
}

/* pos_new = pos + sum over the others (r - d) f direction [1, equation 3.1]. The thesis has f =
   1/2; as all points move at once they then oscillate, and pairs of them stay together: the least
   distances are 0.02 to 0.17 steps, and 0.7 to 0.8 with our two numbers. */
static tmc_uv tmc_push(const tmc_swarm *s, int i) {
    const tmc_uv p = s->at[i];
    const int column = tmc_cell(s, p.u), row = tmc_cell(s, p.v);
    tmc_uv to = p;
    for (int c = 0; c < 9; c++) {
        const int x = column + c % 3 - 1, y = row + c / 3 - 1;
        if (x < 0 || y < 0 || x >= s->cells || y >= s->cells) continue;
        for (int j = s->head[s->cells * y + x]; j >= 0; j = s->next[j]) {
            const double d = sqrt(tmc_uv_dist2(p, s->at[j]));
            if (d >= s->radius || !(d > 0)) continue;
            to.u += TMC_FORCE * (s->radius - d) * (p.u - s->at[j].u) / d;
            to.v += TMC_FORCE * (s->radius - d) * (p.v - s->at[j].v) / d;
        }
    }
    const double least = fmin(fmin(to.u, to.v), 1 - to.u - to.v), third = 1.0 / 3;
    if (least < s->margin) { /* back towards the middle, until it is inside */
        const double share = (third - s->margin) / (third - least);
        to.u = third + (to.u - third) * share;
        to.v = third + (to.v - third) * share;
    }
    return to;
}

static void tmc_swarm_start(tmc_swarm *s, int steps, int hexagonal, uint64_t seed) {
    txm_rng rng = txm_rng_make(seed, 0x7061746368u);
    int n = 0;
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < steps; i++) {
            const double t = (double)i / steps;
            TXM_ASSERT(n < s->count);
            s->at[n].u = k == 0 ? t : k == 1 ? 1 - t : 0;
            s->at[n++].v = k == 0 ? 0 : k == 1 ? t : 1 - t;
        }
    }
    for (int j = 1; j < steps && hexagonal; j++) {
        for (int i = 1; i + j < steps; i++) {
            TXM_ASSERT(n < s->count);
            s->at[n].u = (double)i / steps;
            s->at[n++].v = (double)j / steps;
        }
    }
    while (n < s->count) {
        double u = txm_rng_double(&rng), v = txm_rng_double(&rng);
        if (u + v > 1) {
            u = 1 - u;
            v = 1 - v;
        }
        if (u < s->margin || v < s->margin || 1 - u - v < s->margin) continue;
        s->at[n].u = u;
        s->at[n++].v = v;
    }
}

static txm_status tmc_swarm_run(tmc_swarm *s, int rounds, txm_env *env) {
    for (int r = 0; r < rounds; r++) {
        const txm_status status = tmc_report(env, 0.8 * r / rounds, "repulsion");
        if (status != TXM_OK) return status;
        tmc_fill_cells(s);
        for (int i = s->fixed; i < s->count; i++) s->to[i] = tmc_push(s, i);
        for (int i = s->fixed; i < s->count; i++) s->at[i] = s->to[i];
    }
    return tmc_report(env, 0.8, "order");
}

TRIMESH_COVER_API txm_status trimesh_reference_patch(const trimesh_patch_desc *desc, txm_env *env,
                                               trimesh_point *points, size_t capacity,
                                               size_t *count) {
    trimesh_patch_desc none;
    txm_arena arena;
    tmc_swarm s;
    memset(&none, 0, sizeof none);
    if (!desc) desc = &none;
    const int wanted = desc->points ? desc->points : 32;
    const int rounds = desc->iterations ? desc->iterations : 100;
    if (wanted < 1 || wanted > 4096)
        return txm_fail(env, TXM_BAD_ARGUMENT, "points must be 1 to 4096");
    if (rounds < 1 || rounds > 1000)
        return txm_fail(env, TXM_BAD_ARGUMENT, "iterations must be 1 to 1000");
    if (!count) return txm_fail(env, TXM_BAD_ARGUMENT, "count is NULL");
    /* of a side's points half count, of the corners a sixth: wanted = inside + 3 (m - 1) / 2 + 1/2 */
    const int steps = (int)(sqrt(2.0 * wanted) + 0.5);
    const int loose =
        desc->hexagonal ? (steps - 1) * (steps - 2) / 2 : (2 * wanted + 3 - 3 * steps) / 2;
    memset(&s, 0, sizeof s);
    s.fixed = 3 * steps;
    s.count = s.fixed + (loose > 0 ? loose : 0);
    *count = (size_t)s.count;
    if (!points) return TXM_OK;
    if (capacity < *count)
        return txm_fail_numbers(env, TXM_TOO_LARGE, "# points, but there is room for # only",
                                *count, capacity);
    s.radius = TMC_RADIUS / steps;
    s.margin = 0.25 / steps;
    /* a cell spans at least 2 radius / sqrt(3) of u and of v */
    s.cells = txm_clampi((int)(2 * TMC_H / s.radius), 1, 1024);
    txm_arena_init(&arena, env);
    s.at = (tmc_uv *)txm_arena_alloc(&arena, *count, 4 * sizeof(tmc_uv));
    s.to = (tmc_uv *)txm_arena_alloc(&arena, *count, sizeof(tmc_uv));
    s.next = (int *)txm_arena_alloc(&arena, *count, 4 * sizeof(int));
    s.head = (int *)txm_arena_alloc(&arena, (size_t)s.cells * (size_t)s.cells, sizeof(int));
    double *gap = (double *)txm_arena_alloc(&arena, *count, sizeof(double));
    txm_status status = tmc_check_memory(&arena, env);
    if (status == TXM_OK) {
        tmc_swarm_start(&s, steps, desc->hexagonal, desc->seed);
        status = tmc_swarm_run(&s, desc->hexagonal ? 0 : rounds, env);
    }
    if (status == TXM_OK) {
        memset(points, 0, *count * sizeof *points);
        for (size_t i = 0; i < *count; i++) {
            points[i].u = txm_float(s.at[i].u);
            points[i].v = txm_float(s.at[i].v);
        }
        tmc_order(points, *count, gap);
    }
    txm_arena_free(&arena);
    return status;
}

#endif /* TRIMESH_COVER_PATCH_H */
