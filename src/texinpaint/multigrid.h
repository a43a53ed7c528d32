#ifndef TEXINPAINT_MULTIGRID_H
#define TEXINPAINT_MULTIGRID_H

#include "config.h"

/* ---- multigrid on graphs ---------------------------------------------------------------------
   Solves A x = b where A is the Laplacian of a weighted graph with some nodes tied to ground,

       (A x)_i = ground_i x_i + sum over links  w_ij (x_i - x_j),

   by conjugate gradients, preconditioned by a cycle over coarser graphs [3]. A coarser graph has
   one node for each group of about four nodes that strong links connect; the weights between
   groups are the sums of those between their members (Galerkin's product with piecewise constant
   interpolation). Each level is solved by two steps of conjugate gradients, preconditioned by
   the next level: this "K cycle" makes the number of iterations independent of the size, also
   for graphs without any regularity. */

enum {
    TXI_GRID_LEVELS = 24,
    TXI_GRID_DIRECT = 96,     /* nodes up to which a system is solved directly; ours            */
    TXI_GRID_ITERATIONS = 200 /* at most; then the result is taken as it is. 5 to 20 are usual  */
};

#define TXI_GRID_ENOUGH 0.0625 /* squared norm of the residual after one step of the two, relative,
                                  from which the second is left out: 1/4 in [3]                  */

typedef struct txi_grid_level {
    size_t count;
    const uint32_t *first, *to; /* links in rows, each in both                                  */
    const float *weight;
    double *inverse; /* 1 / diagonal of A                                                       */
    uint32_t *group; /* 1 per node: its node on the next level; NULL on the last                */
    double *r, *x;   /* the system of this level: right side, solution (not on the first)       */
    double *q;       /* scratch                                                                 */
    double *c, *v;   /* of the first of two steps: correction, A times it (not on the first)    */
} txi_grid_level;

typedef struct txi_grid {
    txi_grid_level level[TXI_GRID_LEVELS];
    int levels;
    double *direct; /* Cholesky factor of the last level, in rows; NULL: too large, it is
                       smoothed                                                                  */
} txi_grid;

/* Group the nodes of a level in pairs: each with the free neighbour of the strongest link.
   Returns the number of groups. */
static uint32_t txi_grid_pair(size_t count, const uint32_t *first, const uint32_t *to,
                              const float *weight, uint32_t *group) {
    uint32_t groups = 0;
    for (size_t i = 0; i < count; i++) group[i] = UINT32_MAX;
    for (size_t i = 0; i < count; i++) {
        uint32_t mate = UINT32_MAX;
        float most = 0;
        if (group[i] != UINT32_MAX) continue;
        for (uint32_t k = first[i]; k < first[i + 1]; k++) {
            if (to[k] == i || group[to[k]] != UINT32_MAX || !(weight[k] > most)) continue;
            most = weight[k];
            mate = to[k];
        }
        group[i] = groups;
        if (mate != UINT32_MAX) group[mate] = groups;
        groups++;
    }
    return groups;
}

/* The links between groups. members: the nodes in the order of their group, those of group g are
   members[start[g]] .. members[start[g + 1] - 1]; place: scratch, 1 per group. Returns their
   number. */
static uint32_t txi_grid_sum(const uint32_t *first, const uint32_t *to, const float *weight,
                             const uint32_t *group, uint32_t groups, const uint32_t *start,
                             const uint32_t *members, uint32_t *place, uint32_t *out_first,
                             uint32_t *out_to, float *out_weight) {
    uint32_t total = 0;
    for (uint32_t g = 0; g < groups; g++) place[g] = UINT32_MAX;
    for (uint32_t g = 0; g < groups; g++) {
        out_first[g] = total;
        for (uint32_t m = start[g]; m < start[g + 1]; m++) {
            for (uint32_t k = first[members[m]]; k < first[members[m] + 1]; k++) {
                const uint32_t other = group[to[k]];
                if (other == g) continue;
                if (place[other] == UINT32_MAX || place[other] < out_first[g]) {
                    place[other] = total;
                    out_to[total] = other;
                    out_weight[total++] = weight[k];
                } else {
                    out_weight[place[other]] += weight[k];
                }
            }
        }
    }
    out_first[groups] = total;
    return total;
}

/* Sort the nodes by group. */
static void txi_grid_members(size_t count, const uint32_t *group, uint32_t groups, uint32_t *start,
                             uint32_t *members) {
    memset(start, 0, ((size_t)groups + 1) * sizeof *start);
    for (size_t i = 0; i < count; i++) start[group[i] + 1]++;
    for (uint32_t g = 0; g < groups; g++) start[g + 1] += start[g];
    for (size_t i = count; i-- > 0;) members[--start[group[i] + 1]] = (uint32_t)i;
    for (uint32_t g = 0; g < groups; g++) start[g] = start[g + 1];
    start[groups] = (uint32_t)count;
}

/* One level from the one above it, whose links are replaced by those of the coarser graph: twice
   grouped in pairs. fine->group receives the groups. 0: no memory. */
static int txi_grid_coarsen(txi_grid_level *fine, txi_grid_level *coarse, txm_arena *arena,
                            txm_arena *scratch) {
    const size_t n = fine->count, links = fine->first[n];
    fine->group = (uint32_t *)txm_arena_alloc(arena, n, sizeof(uint32_t));
    uint32_t *group = (uint32_t *)txm_arena_alloc(scratch, n, 3 * sizeof(uint32_t));
    uint32_t *start = (uint32_t *)txm_arena_alloc(scratch, n + 1, sizeof(uint32_t));
    uint32_t *first = (uint32_t *)txm_arena_alloc(scratch, n + 1, sizeof(uint32_t));
    uint32_t *to = (uint32_t *)txm_arena_alloc(scratch, links + 1, sizeof(uint32_t));
    float *weight = (float *)txm_arena_alloc(scratch, links + 1, sizeof(float));
    if (!fine->group || scratch->failed) return 0;
    uint32_t *members = group + n, *place = members + n;
    const uint32_t pairs = txi_grid_pair(n, fine->first, fine->to, fine->weight, fine->group);
    txi_grid_members(n, fine->group, pairs, start, members);
    txi_grid_sum(fine->first, fine->to, fine->weight, fine->group, pairs, start, members, place,
                 first, to, weight);
    const uint32_t groups = txi_grid_pair(pairs, first, to, weight, group);
    for (size_t i = 0; i < n; i++) fine->group[i] = group[fine->group[i]];
    /* from the links of the fine graph again: those of the pairs are overwritten */
    txi_grid_members(n, fine->group, groups, start, members);
    const uint32_t total = txi_grid_sum(fine->first, fine->to, fine->weight, fine->group, groups,
                                        start, members, place, first, to, weight);
    uint32_t *kept = (uint32_t *)txm_arena_alloc(arena, (size_t)groups + 1, sizeof(uint32_t));
    uint32_t *kept_to = (uint32_t *)txm_arena_alloc(arena, (size_t)total + 1, sizeof(uint32_t));
    float *kept_weight = (float *)txm_arena_alloc(arena, (size_t)total + 1, sizeof(float));
    if (arena->failed) return 0;
    memcpy(kept, first, ((size_t)groups + 1) * sizeof *kept);
    memcpy(kept_to, to, total * sizeof *to);
    memcpy(kept_weight, weight, total * sizeof *weight);
    coarse->count = groups;
    coarse->first = kept;
    coarse->to = kept_to;
    coarse->weight = kept_weight;
    return 1;
}

/* y = A x */
static void txi_grid_apply(const txi_grid_level *l, const double *x, double *y) {
    for (size_t i = 0; i < l->count; i++) {
        double sum = 0;
        for (uint32_t k = l->first[i]; k < l->first[i + 1]; k++)
            sum += (double)l->weight[k] * x[l->to[k]];
        y[i] = x[i] / l->inverse[i] - sum;
    }
}

/* The Cholesky factor of the last level. */
static void txi_grid_factor(const txi_grid_level *l, double *a) {
    const size_t n = l->count;
    memset(a, 0, n * n * sizeof *a);
    for (size_t i = 0; i < n; i++) {
        a[i * n + i] += 1 / l->inverse[i];
        for (uint32_t k = l->first[i]; k < l->first[i + 1]; k++)
            a[i * n + l->to[k]] -= (double)l->weight[k];
    }
    for (size_t i = 0; i < n; i++) {
        const double whole = a[i * n + i];
        for (size_t j = 0; j <= i; j++) {
            double sum = a[i * n + j];
            for (size_t k = 0; k < j; k++) sum -= a[i * n + k] * a[j * n + k];
            if (j < i) a[i * n + j] = sum / a[j * n + j];
            else a[i * n + i] = sqrt(fmax(sum, 1e-14 * whole)); /* rounding may leave nothing */
        }
    }
}

static void txi_grid_direct(const txi_grid *g, const txi_grid_level *l, const double *r,
                            double *x) {
    const size_t n = l->count;
    const double *a = g->direct;
    for (size_t i = 0; i < n; i++) {
        double sum = r[i];
        for (size_t k = 0; k < i; k++) sum -= a[i * n + k] * x[k];
        x[i] = sum / a[i * n + i];
    }
    for (size_t i = n; i-- > 0;) {
        double sum = x[i];
        for (size_t k = i + 1; k < n; k++) sum -= a[k * n + i] * x[k];
        x[i] = sum / a[i * n + i];
    }
}

/* One sweep of Gauss and Seidel, up or down the nodes. */
static void txi_grid_sweep(const txi_grid_level *l, const double *r, double *x, int down) {
    for (size_t n = 0; n < l->count; n++) {
        const size_t i = down ? l->count - 1 - n : n;
        double sum = r[i];
        for (uint32_t k = l->first[i]; k < l->first[i + 1]; k++)
            sum += (double)l->weight[k] * x[l->to[k]];
        x[i] = sum * l->inverse[i];
    }
}

static double txi_grid_dot(const double *a, const double *b, size_t count) {
    double sum = 0;
    for (size_t i = 0; i < count; i++) sum += a[i] * b[i];
    return sum;
}

static void txi_grid_coarse(const txi_grid *g, int level);

/* x = about A^-1 r, by smoothing before and after a correction from the next level. */
static void txi_grid_cycle(const txi_grid *g, int level, const double *r, double *x) {
    const txi_grid_level *l = &g->level[level];
    const size_t n = l->count;
    memset(x, 0, n * sizeof *x);
    if (level + 1 == g->levels) {
        if (g->direct) {
            txi_grid_direct(g, l, r, x);
            return;
        }
        for (int k = 0; k < 4; k++) {
            txi_grid_sweep(l, r, x, 0);
            txi_grid_sweep(l, r, x, 1);
        }
        return;
    }
    const txi_grid_level *next = l + 1;
    txi_grid_sweep(l, r, x, 0);
    txi_grid_apply(l, x, l->q);
    memset(next->r, 0, next->count * sizeof *next->r);
    for (size_t i = 0; i < n; i++) next->r[l->group[i]] += r[i] - l->q[i];
    txi_grid_coarse(g, level + 1);
    for (size_t i = 0; i < n; i++) x[i] += next->x[l->group[i]];
    txi_grid_sweep(l, r, x, 1);
}

/* Solve the system of a level below the first, r, by two steps of conjugate gradients; one if that
   is good enough. r is lost. With c1, r1, v1 = A c1 of the first step, c2, r2, v2 of the second
   [3]:

       x = (a1 / p1 - f a2 / (p1 p2)) c1 + (a2 / p2) c2,
       p1 = c1.v1, a1 = c1.r1, f = c2.v1, p2 = c2.v2 - f^2 / p1, a2 = c2.r2                     */
static void txi_grid_coarse(const txi_grid *g, int level) {
    const txi_grid_level *l = &g->level[level];
    const size_t n = l->count;
    if (level + 1 == g->levels) {
        txi_grid_cycle(g, level, l->r, l->x);
        return;
    }
    const double norm = txi_grid_dot(l->r, l->r, n);
    txi_grid_cycle(g, level, l->r, l->c);
    txi_grid_apply(l, l->c, l->v);
    const double p1 = txi_grid_dot(l->c, l->v, n), a1 = txi_grid_dot(l->c, l->r, n);
    const double step = p1 > 0 ? a1 / p1 : 0;
    for (size_t i = 0; i < n; i++) l->r[i] -= step * l->v[i];
    if (!(p1 > 0) || txi_grid_dot(l->r, l->r, n) <= TXI_GRID_ENOUGH * norm) {
        for (size_t i = 0; i < n; i++) l->x[i] = step * l->c[i];
        return;
    }
    txi_grid_cycle(g, level, l->r, l->x);
    const double f = txi_grid_dot(l->x, l->v, n), a2 = txi_grid_dot(l->x, l->r, n);
    txi_grid_apply(l, l->x, l->q);
    const double p2 = txi_grid_dot(l->x, l->q, n) - f * f / p1;
    const double second = p2 > 0 ? a2 / p2 : 0;
    for (size_t i = 0; i < n; i++) l->x[i] = (step - f * second / p1) * l->c[i] + second * l->x[i];
}

/* The levels for a graph.
   first, to, weight  its links in rows; they are used as long as the grid is
   ground             1 per node, 0 or more; each connected part needs one that is not 0
   cost               about 0.2 us and 130 bytes per node                                   */
static txm_status txi_grid_make(size_t count, const uint32_t *first, const uint32_t *to,
                                const float *weight, const double *ground, txm_arena *arena,
                                txm_env *env, txi_grid *g) {
    txm_arena scratch;
    memset(g, 0, sizeof *g);
    g->level[0].count = count;
    g->level[0].first = first;
    g->level[0].to = to;
    g->level[0].weight = weight;
    const double *earth = ground;
    for (int k = 0; k < TXI_GRID_LEVELS; k++) {
        txi_grid_level *l = &g->level[k];
        const size_t n = l->count;
        g->levels = k + 1;
        l->inverse = (double *)txm_arena_alloc(arena, n, sizeof(double));
        l->q = (double *)txm_arena_alloc(arena, n, sizeof(double));
        if (k > 0) {
            l->r = (double *)txm_arena_alloc(arena, n, 4 * sizeof(double));
            if (l->r) {
                l->x = l->r + n;
                l->c = l->x + n;
                l->v = l->c + n;
            }
        }
        if (arena->failed) return txi_no_memory(env);
        for (size_t i = 0; i < n; i++) {
            double sum = earth[i];
            for (uint32_t j = l->first[i]; j < l->first[i + 1]; j++)
                sum += l->to[j] == i ? 0 : (double)l->weight[j];
            l->inverse[i] = sum > 0 ? 1 / sum : 1; /* 0: a node by itself, without ground */
        }
        if (n <= TXI_GRID_DIRECT || k + 1 == TXI_GRID_LEVELS) break;
        txm_arena_init(&scratch, env);
        const int ok = txi_grid_coarsen(l, l + 1, arena, &scratch);
        txm_arena_free(&scratch);
        double *sums = ok ? (double *)txm_arena_zero(arena, l[1].count, sizeof(double)) : NULL;
        if (!sums) return txi_no_memory(env);
        for (size_t i = 0; i < n; i++) sums[l->group[i]] += earth[i];
        earth = sums;
        if (l[1].count > n - n / 8) break; /* hardly any links: smoothing is enough */
    }
    const size_t n = g->level[g->levels - 1].count;
    if (n > TXI_GRID_DIRECT) return TXM_OK;
    g->direct = (double *)txm_arena_alloc(arena, n, n * sizeof(double));
    if (!g->direct) return txi_no_memory(env);
    txi_grid_factor(&g->level[g->levels - 1], g->direct);
    return TXM_OK;
}

/* Solve A x = b. x holds a guess and receives the solution; b is lost.
   tolerance  of the residual, relative to that of x = 0
   return     TXM_OK, TXM_OUT_OF_MEMORY, TXM_CANCELLED
   cost       some 10 iterations of about 0.15 us per node; 24 bytes per node               */
static txm_status txi_grid_solve(const txi_grid *g, double *b, double *x, double tolerance,
                                 const char *stage, txm_env *env) {
    const txi_grid_level *l = &g->level[0];
    const size_t n = l->count;
    txm_status status = TXM_OK;
    txm_arena arena;
    txm_arena_init(&arena, env);
    double *z = (double *)txm_arena_alloc(&arena, n, sizeof(double));
    double *p = (double *)txm_arena_alloc(&arena, n, sizeof(double));
    double *v = (double *)txm_arena_alloc(&arena, n, sizeof(double));
    if (arena.failed) {
        txm_arena_free(&arena);
        return txi_no_memory(env);
    }
    const double goal = txi_grid_dot(b, b, n) * tolerance * tolerance;
    double *r = b, first = 0, rest, curve = 0;
    txi_grid_apply(l, x, v);
    for (size_t i = 0; i < n; i++) r[i] -= v[i];
    rest = first = txi_grid_dot(r, r, n);
    float reached = 0;
    for (int k = 0; k < TXI_GRID_ITERATIONS && rest > goal; k++) {
        /* the digits gained, of those wanted */
        if (rest < first && goal > 0)
            reached = txm_maxf(reached, txm_float(log(first / rest) / log(first / goal)));
        if (txm_progress(env, txm_minf(reached, 1), stage)) {
            status = txi_stopped(env);
            break;
        }
        txi_grid_cycle(g, 0, r, z);
        /* the cycle is not the same linear map each time: z is made conjugate to the last p */
        const double back = curve > 0 ? -txi_grid_dot(z, v, n) / curve : 0;
        for (size_t i = 0; i < n; i++) p[i] = z[i] + (curve > 0 ? back * p[i] : 0);
        txi_grid_apply(l, p, v);
        curve = txi_grid_dot(p, v, n);
        if (!(curve > 0)) break; /* nothing left but rounding */
        const double step = txi_grid_dot(p, r, n) / curve;
        for (size_t i = 0; i < n; i++) {
            x[i] += step * p[i];
            r[i] -= step * v[i];
        }
        rest = txi_grid_dot(r, r, n);
    }
    txm_arena_free(&arena);
    return status;
}

#endif /* TEXINPAINT_MULTIGRID_H */
