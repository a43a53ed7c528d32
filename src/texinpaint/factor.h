#ifndef TEXINPAINT_FACTOR_H
#define TEXINPAINT_FACTOR_H

#include "surface.h"

/* ---- factor: sparse linear systems of flattening --------------------------------------------- */

enum { TXI_LEAF = 48 /* ours: unknowns that are not divided further */ };

/* A symmetric positive definite matrix whose pattern is a graph: A = P^T L D L^T P. Rows that
   are solved early have few entries; see txi_dissect. */
typedef struct txi_factor {
    size_t count, edge_count;
    const uint32_t *low, *high; /* the two unknowns of each edge                                  */
    uint32_t *order;    /* row k of L is unknown order[k]                                      */
    uint32_t *up_first, *up_row, *up_edge; /* entries A(up_row, k) above the diagonal, by column */
    uint32_t *parent;   /* elimination tree                                                    */
    size_t *first;      /* columns of L                                                        */
    size_t *filled;     /* entries of a column so far                                          */
    uint32_t *row;
    double *value;
    double *diagonal;   /* D                                                                   */
    double *work;       /* 2 per unknown                                                       */
    uint32_t *flag, *stack, *path;
} txi_factor;

/* The order of elimination: nested dissection by coordinates. The points are divided at the median
   along the longest side of their bounding box; those beyond it that have neighbours before it
   separate the rest and come last; so on with both halves. On surfaces L has O(n log n) entries.

   first, next  the neighbours of point i: next[first[i]] .. next[first[i + 1] - 1]
   order        receives the points
   pairs        scratch, 2 per point; side: scratch, 1 per point                            */
static void txi_dissect(size_t count, const txm_dvec3 *point, const uint32_t *first,
                        const uint32_t *next, uint32_t *order, txm_pair *pairs, uint32_t *side) {
    size_t begins[128], ends[128];
    int depth = 1;
    uint32_t stamp = 0;
    for (size_t i = 0; i < count; i++) {
        order[i] = (uint32_t)i;
        side[i] = 0;
    }
    begins[0] = 0;
    ends[0] = count;
    while (depth > 0) {
        const size_t begin = begins[--depth], end = ends[depth], n = end - begin, half = n / 2;
        if (n <= TXI_LEAF || depth + 2 > 128) continue;
        txm_dvec3 least = point[order[begin]], most = least;
        for (size_t k = begin; k < end; k++) {
            const txm_dvec3 p = point[order[k]];
            least = txm_d3(fmin(least.x, p.x), fmin(least.y, p.y), fmin(least.z, p.z));
            most = txm_d3(fmax(most.x, p.x), fmax(most.y, p.y), fmax(most.z, p.z));
        }
        const txm_dvec3 size = txm_d3_sub(most, least);
        const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
        for (size_t k = 0; k < n; k++) {
            const txm_dvec3 p = point[order[begin + k]];
            const double at = axis == 0 ? p.x - least.x : axis == 1 ? p.y - least.y : p.z - least.z;
            pairs[k].key = txm_sort_key(txm_float(at));
            pairs[k].value = order[begin + k];
        }
        txm_sort_pairs(pairs, pairs + n, n);
        stamp++;
        for (size_t k = 0; k < half; k++) {
            order[begin + k] = pairs[k].value;
            side[pairs[k].value] = stamp;
        }
        size_t to = begin + half, last = 0; /* the separator is gathered in the scratch half of
                                               pairs                                             */
        for (size_t k = half; k < n; k++) {
            const uint32_t v = pairs[k].value;
            int divides = 0;
            for (uint32_t e = first[v]; e < first[v + 1] && !divides; e++)
                divides = side[next[e]] == stamp;
            if (divides) pairs[n + last++].value = v;
            else order[to++] = v;
        }
        for (size_t k = 0; k < last; k++) order[to + k] = pairs[n + k].value;
        begins[depth] = begin;
        ends[depth++] = begin + half;
        begins[depth] = begin + half;
        ends[depth++] = to;
    }
}

/* Entries of row k of L: the nodes on the paths of the elimination tree from the entries of A
   above the diagonal of column k towards k. Fills stack from top, in an order in which children
   come before their parents; returns where it begins. */
static size_t txi_row_pattern(const txi_factor *f, uint32_t k) {
    size_t top = f->count;
    f->flag[k] = k;
    for (uint32_t e = f->up_first[k]; e < f->up_first[k + 1]; e++) {
        size_t length = 0;
        for (uint32_t i = f->up_row[e]; f->flag[i] != k; i = f->parent[i]) {
            TXM_ASSERT(length < f->count);
            f->path[length++] = i;
            f->flag[i] = k;
        }
        while (length > 0) f->stack[--top] = f->path[--length];
    }
    return top;
}

/* Fill parent, the elimination tree, and first, from how long the columns of L become. filled:
   0. */
static void txi_factor_tree(txi_factor *f) {
    for (uint32_t k = 0; k < f->count; k++) {
        f->parent[k] = UINT32_MAX;
        f->flag[k] = k;
        for (uint32_t e = f->up_first[k]; e < f->up_first[k + 1]; e++) {
            for (uint32_t i = f->up_row[e]; f->flag[i] != k; i = f->parent[i]) {
                if (f->parent[i] == UINT32_MAX) f->parent[i] = k;
                f->filled[i]++;
                f->flag[i] = k;
            }
        }
    }
    f->first[0] = 0;
    for (size_t k = 0; k < f->count; k++) f->first[k + 1] = f->first[k] + f->filled[k];
}

/* Find the order and the pattern of L for a graph of count unknowns at these points. */
static txm_status txi_factor_plan(txi_factor *f, size_t count, const txm_dvec3 *point,
                                  size_t edge_count, const uint32_t *low, const uint32_t *high,
                                  txm_arena *arena, txm_env *env) {
    memset(f, 0, sizeof *f);
    f->count = count;
    f->edge_count = edge_count;
    f->low = low;
    f->high = high;
    uint32_t *first = (uint32_t *)txm_arena_zero(arena, count + 2, sizeof(uint32_t));
    uint32_t *next = (uint32_t *)txm_arena_alloc(arena, 2 * edge_count + 1, sizeof(uint32_t));
    uint32_t *place = (uint32_t *)txm_arena_alloc(arena, count, sizeof(uint32_t));
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(arena, count, 2 * sizeof(txm_pair));
    f->order = (uint32_t *)txm_arena_alloc(arena, count, sizeof(uint32_t));
    f->up_first = (uint32_t *)txm_arena_zero(arena, count + 2, sizeof(uint32_t));
    f->up_row = (uint32_t *)txm_arena_alloc(arena, edge_count + 1, sizeof(uint32_t));
    f->up_edge = (uint32_t *)txm_arena_alloc(arena, edge_count + 1, sizeof(uint32_t));
    f->parent = (uint32_t *)txm_arena_alloc(arena, count, sizeof(uint32_t));
    f->first = (size_t *)txm_arena_alloc(arena, count + 1, sizeof(size_t));
    f->filled = (size_t *)txm_arena_zero(arena, count, sizeof(size_t));
    f->diagonal = (double *)txm_arena_alloc(arena, count, sizeof(double));
    f->work = (double *)txm_arena_zero(arena, count, 2 * sizeof(double));
    f->flag = (uint32_t *)txm_arena_alloc(arena, count, sizeof(uint32_t));
    f->stack = (uint32_t *)txm_arena_alloc(arena, count, sizeof(uint32_t));
    f->path = (uint32_t *)txm_arena_alloc(arena, count, sizeof(uint32_t));
    if (arena->failed) return txi_no_memory(env);

    for (size_t e = 0; e < edge_count; e++) {
        first[low[e] + 2]++;
        first[high[e] + 2]++;
    }
    for (size_t i = 2; i < count + 2; i++) first[i] += first[i - 1];
    for (size_t e = 0; e < edge_count; e++) {
        next[first[low[e] + 1]++] = high[e];
        next[first[high[e] + 1]++] = low[e];
    }
    txi_dissect(count, point, first, next, f->order, pairs, f->flag);
    for (size_t k = 0; k < count; k++) place[f->order[k]] = (uint32_t)k;

    for (size_t e = 0; e < edge_count; e++) {
        const uint32_t a = place[low[e]], b = place[high[e]];
        f->up_first[(a > b ? a : b) + 2]++;
    }
    for (size_t k = 2; k < count + 2; k++) f->up_first[k] += f->up_first[k - 1];
    for (size_t e = 0; e < edge_count; e++) {
        const uint32_t a = place[low[e]], b = place[high[e]];
        const uint32_t at = f->up_first[(a > b ? a : b) + 1]++;
        f->up_row[at] = a > b ? b : a;
        f->up_edge[at] = (uint32_t)e;
    }
    txi_factor_tree(f);
    f->row = (uint32_t *)txm_arena_alloc(arena, f->first[count] + 1, sizeof(uint32_t));
    f->value = (double *)txm_arena_alloc(arena, f->first[count] + 1, sizeof(double));
    return arena->failed ? txi_no_memory(env) : TXM_OK;
}

/* Compute L and D, row by row, of the matrix with diagonal[i] and, for each edge, -weight[edge]
   in both its places. */
static void txi_factor_make(txi_factor *f, const double *weight, const double *diagonal) {
    double *y = f->work;
    memset(f->filled, 0, f->count * sizeof *f->filled);
    for (size_t i = 0; i < f->count; i++) {
        y[i] = 0;
        f->flag[i] = UINT32_MAX;
    }
    for (uint32_t k = 0; k < f->count; k++) {
        const size_t top = txi_row_pattern(f, k);
        double d = diagonal[f->order[k]];
        for (uint32_t e = f->up_first[k]; e < f->up_first[k + 1]; e++)
            y[f->up_row[e]] = -weight[f->up_edge[e]];
        for (size_t s = top; s < f->count; s++) {
            const uint32_t i = f->stack[s];
            const double yi = y[i];
            const size_t begin = f->first[i], end = begin + f->filled[i];
            y[i] = 0;
            for (size_t p = begin; p < end; p++) y[f->row[p]] -= f->value[p] * yi;
            const double l = yi / f->diagonal[i];
            d -= l * yi;
            f->row[end] = k;
            f->value[end] = l;
            f->filled[i]++;
        }
        f->diagonal[k] = d > 1e-30 ? d : 1e-30; /* positive but for rounding */
    }
}

/* Solve for two right sides at once: xy holds them, 2 numbers for each unknown, and receives the
   solutions. */
static void txi_factor_solve(const txi_factor *f, double *xy) {
    double *z = f->work;
    for (size_t k = 0; k < f->count; k++) {
        z[2 * k] = xy[2 * (size_t)f->order[k]];
        z[2 * k + 1] = xy[2 * (size_t)f->order[k] + 1];
    }
    for (size_t k = 0; k < f->count; k++) {
        const double x = z[2 * k], y = z[2 * k + 1];
        for (size_t p = f->first[k]; p < f->first[k + 1]; p++) {
            z[2 * (size_t)f->row[p]] -= f->value[p] * x;
            z[2 * (size_t)f->row[p] + 1] -= f->value[p] * y;
        }
    }
    for (size_t k = f->count; k-- > 0;) {
        double x = z[2 * k] / f->diagonal[k], y = z[2 * k + 1] / f->diagonal[k];
        for (size_t p = f->first[k]; p < f->first[k + 1]; p++) {
            x -= f->value[p] * z[2 * (size_t)f->row[p]];
            y -= f->value[p] * z[2 * (size_t)f->row[p] + 1];
        }
        z[2 * k] = x;
        z[2 * k + 1] = y;
    }
    for (size_t k = 0; k < f->count; k++) {
        xy[2 * (size_t)f->order[k]] = z[2 * k];
        xy[2 * (size_t)f->order[k] + 1] = z[2 * k + 1];
    }
}

#endif /* TEXINPAINT_FACTOR_H */
