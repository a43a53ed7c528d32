#ifndef TEXMATH_CUT_H
#define TEXMATH_CUT_H

#include "env.h"

/* ---- kernel: minimum-error cut ---------------------------------------------------------- */

/* The cheapest path through a strip from its first line to its last, moving at most one pixel
   sideways per line [2]:

       E(i, j) = e(i, j) + min(E(i-1, j-1), E(i-1, j), E(i-1, j+1)),  path(last) = argmin E(last, .)

             j 0 .. width-1             e(i, j) = error[i * along + j * across], in floats
         i 0 . . # . .
           1 . # . . .                  a cut from top to bottom: along = row, across = 1
           2 . # . . .                  from left to right:       along = 1, across = row
           3 . . # . .

   Of equal sums the same j wins, then the smaller j; of equal ends the smaller j.
   error    >= 0; INFINITY excludes a pixel as long as the path can avoid it
   path     receives j for each line, length of them
   scratch  room for length * width doubles
   return   the sum of the errors on the path; 0 (nothing written) if length or width is below 1
   cost     O(length * width)                                                              */
static inline double txm_cut(const float *error, int length, int width, ptrdiff_t along,
                             ptrdiff_t across, int *path, double *scratch) {
    if (length < 1 || width < 1) return 0;
    const size_t w = (size_t)width;
    for (int i = 0; i < length; i++) {
        double *line = scratch + (size_t)i * w;
        const double *above = i ? line - w : NULL;
        for (int j = 0; j < width; j++) {
            double best = above ? above[j] : 0;
            if (above && j > 0 && above[j - 1] < best) best = above[j - 1];
            if (above && j + 1 < width && above[j + 1] < best) best = above[j + 1];
            line[j] = best + error[i * along + j * across];
        }
    }
    const double *line = scratch + (size_t)(length - 1) * w;
    int j = 0;
    for (int k = 1; k < width; k++) {
        if (line[k] < line[j]) j = k;
    }
    const double total = line[j];
    for (int i = length - 1;; i--) {
        path[i] = j;
        if (i == 0) return total;
        const double *above = scratch + (size_t)(i - 1) * w;
        int best = j;
        if (j > 0 && above[j - 1] < above[best]) best = j - 1;
        if (j + 1 < width && above[j + 1] < above[best]) best = j + 1;
        j = best;
    }
}

/* ---- kernel: minimum cut on a grid ------------------------------------------------------ */

/* The minimum cut that separates the nodes of a grid into those of a source and those of a sink:
   maximum flow by two growing search trees [8]. A node is a cell of the grid, which has a margin of
   one cell on all sides whose capacities stay zero. Arc d of node p goes to p + step[d]; the
   opposite arc is d + directions / 2 there.

   txm_flow_make allocates the memory. Then set step[] and count, fill arc[][] and excess[], call
   txm_flow_solve, and read tree[]: TXM_FLOW_SINK are the nodes on the sink's side. Sums of the
   capacities at a node must stay below 2^30. Integers only, so the same cut everywhere. */
enum { TXM_FLOW_FREE = 0, TXM_FLOW_SOURCE = 1, TXM_FLOW_SINK = 2 };
/* parents that are not an arc */
enum { TXM_FLOW_TERMINAL = 6, TXM_FLOW_NONE = 7, TXM_FLOW_ORPHAN = 8 };

typedef struct txm_flow {
    int directions; /* 4 or 6 */
    int step[6];
    int count;        /* nodes, margin included             */
    int32_t *arc[6];  /* residual capacities                */
    int32_t *excess;  /* > 0 from the source, < 0 to the sink */
    int32_t *next;    /* queue of active nodes: -2 = not in it, -1 = last */
    int32_t *orphans; /* circular                           */
    int32_t *stamp, *distance;
    uint8_t *tree, *parent;
    int first, last, orphan_at, orphan_count, time;
} txm_flow;

static inline int txm_flow_opposite(const txm_flow *g, int d) {
    const int half = g->directions / 2;
    return d < half ? d + half : d - half;
}

static inline void txm_flow_activate(txm_flow *g, int p) {
    if (g->next[p] != -2) return;
    g->next[p] = -1;
    if (g->last >= 0) g->next[g->last] = p;
    else g->first = p;
    g->last = p;
}

static inline void txm_flow_orphan(txm_flow *g, int p) {
    int at = g->orphan_at + g->orphan_count++;
    if (at >= g->count) at -= g->count;
    g->parent[p] = TXM_FLOW_ORPHAN;
    g->orphans[at] = p;
}

/* Push flow along the path that arc d of p (in the source's tree) closes. */
static inline void txm_flow_augment(txm_flow *g, int p, int d) {
    const int q = p + g->step[d];
    int32_t flow = g->arc[d][p];
    for (int x = p;; x += g->step[g->parent[x]]) {
        const int up = g->parent[x];
        const int32_t rest = up == TXM_FLOW_TERMINAL
                                 ? g->excess[x]
                                 : g->arc[txm_flow_opposite(g, up)][x + g->step[up]];
        if (rest < flow) flow = rest;
        if (up == TXM_FLOW_TERMINAL) break;
    }
    for (int x = q;; x += g->step[g->parent[x]]) {
        const int up = g->parent[x];
        const int32_t rest = up == TXM_FLOW_TERMINAL ? -g->excess[x] : g->arc[up][x];
        if (rest < flow) flow = rest;
        if (up == TXM_FLOW_TERMINAL) break;
    }
    g->arc[d][p] -= flow;
    g->arc[txm_flow_opposite(g, d)][q] += flow;
    for (int x = p, end = 0; !end;) {
        const int up = g->parent[x];
        if (up == TXM_FLOW_TERMINAL) {
            g->excess[x] -= flow;
            if (g->excess[x] == 0) txm_flow_orphan(g, x);
            end = 1;
        } else {
            const int y = x + g->step[up];
            g->arc[up][x] += flow;
            g->arc[txm_flow_opposite(g, up)][y] -= flow;
            if (g->arc[txm_flow_opposite(g, up)][y] == 0) txm_flow_orphan(g, x);
            x = y;
        }
    }
    for (int x = q, end = 0; !end;) {
        const int up = g->parent[x];
        if (up == TXM_FLOW_TERMINAL) {
            g->excess[x] += flow;
            if (g->excess[x] == 0) txm_flow_orphan(g, x);
            end = 1;
        } else {
            const int y = x + g->step[up];
            g->arc[up][x] -= flow;
            g->arc[txm_flow_opposite(g, up)][y] += flow;
            if (g->arc[up][x] == 0) txm_flow_orphan(g, x);
            x = y;
        }
    }
}

/* Capacity of the arc that connects p to its neighbour in direction d, in the direction of p's
   tree. */
static inline int32_t txm_flow_hold(const txm_flow *g, int p, int d) {
    if (g->tree[p] != TXM_FLOW_SOURCE) return g->arc[d][p];
    return g->arc[txm_flow_opposite(g, d)][p + g->step[d]];
}

/* Find a new parent for an orphan, the nearest to the terminal, or free it and its children. */
static inline void txm_flow_adopt(txm_flow *g, int p) {
    int best = TXM_FLOW_NONE, least = INT_MAX;
    const uint8_t tree = g->tree[p];
    for (int d = 0; d < g->directions; d++) {
        const int q = p + g->step[d];
        if (g->tree[q] != tree || g->parent[q] == TXM_FLOW_NONE || txm_flow_hold(g, p, d) == 0)
            continue;
        int length = 0, x = q;
        for (;;) { /* is q still connected to the terminal? */
            if (g->stamp[x] == g->time) {
                length += g->distance[x];
                break;
            }
            const int up = g->parent[x];
            length++;
            if (up == TXM_FLOW_TERMINAL) {
                g->stamp[x] = g->time;
                g->distance[x] = 1;
                break;
            }
            if (up == TXM_FLOW_ORPHAN || up == TXM_FLOW_NONE) {
                length = INT_MAX;
                break;
            }
            x += g->step[up];
        }
        if (length == INT_MAX) continue;
        if (length < least) {
            least = length;
            best = d;
        }
        for (x = q; g->stamp[x] != g->time; x += g->step[g->parent[x]]) {
            g->stamp[x] = g->time;
            g->distance[x] = length--;
        }
    }
    g->parent[p] = (uint8_t)best;
    if (best != TXM_FLOW_NONE) {
        g->stamp[p] = g->time;
        g->distance[p] = least + 1;
        return;
    }
    for (int d = 0; d < g->directions; d++) {
        const int q = p + g->step[d];
        if (g->tree[q] != tree || g->parent[q] == TXM_FLOW_NONE) continue;
        if (txm_flow_hold(g, p, d) > 0) txm_flow_activate(g, q);
        if (g->parent[q] < 6 && q + g->step[g->parent[q]] == p) txm_flow_orphan(g, q);
    }
    g->tree[p] = TXM_FLOW_FREE;
}

/* Grow the tree of p by one ring. Returns 1 with (*from, *d) the arc where the two trees touch. */
static inline int txm_flow_grow(txm_flow *g, int p, int *from, int *direction) {
    const int is_source = g->tree[p] == TXM_FLOW_SOURCE;
    for (int d = 0; d < g->directions; d++) {
        const int q = p + g->step[d], back = txm_flow_opposite(g, d);
        if ((is_source ? g->arc[d][p] : g->arc[back][q]) == 0) continue;
        if (g->tree[q] == TXM_FLOW_FREE) {
            g->tree[q] = g->tree[p];
            g->parent[q] = (uint8_t)back;
            g->stamp[q] = g->stamp[p];
            g->distance[q] = g->distance[p] + 1;
            txm_flow_activate(g, q);
        } else if (g->tree[q] != g->tree[p]) {
            *from = is_source ? p : q;
            *direction = is_source ? d : back;
            return 1;
        } else if (g->stamp[q] <= g->stamp[p] && g->distance[q] > g->distance[p]) {
            g->parent[q] = (uint8_t)back; /* a shorter path */
            g->stamp[q] = g->stamp[p];
            g->distance[q] = g->distance[p] + 1;
        }
    }
    return 0;
}

/* Push the maximum flow. Afterwards the nodes whose tree is TXM_FLOW_SINK lie beyond the cut;
   the arcs and excess hold what is left.
   cost  linear in practice, some 0.1 us per node; polynomial at worst                        */
static inline void txm_flow_solve(txm_flow *g) {
    g->first = g->last = -1;
    g->orphan_at = g->orphan_count = 0;
    g->time = 0;
    for (int p = 0; p < g->count; p++) {
        g->next[p] = -2;
        g->stamp[p] = 0;
        g->distance[p] = 1;
        g->tree[p] = TXM_FLOW_FREE;
        g->parent[p] = TXM_FLOW_NONE;
        if (g->excess[p] == 0) continue;
        g->tree[p] = g->excess[p] > 0 ? TXM_FLOW_SOURCE : TXM_FLOW_SINK;
        g->parent[p] = TXM_FLOW_TERMINAL;
        txm_flow_activate(g, p);
    }
    int current = -1;
    for (;;) {
        int p = current, from, d;
        if (p < 0 || g->parent[p] == TXM_FLOW_NONE) {
            do { /* the next active node that still belongs to a tree */
                p = g->first;
                if (p < 0) return;
                g->first = g->next[p];
                if (g->first < 0) g->last = -1;
                g->next[p] = -2;
            } while (g->parent[p] == TXM_FLOW_NONE);
        }
        current = -1;
        const int touch = txm_flow_grow(g, p, &from, &d);
        g->time++;
        if (!touch) continue;
        current = p; /* it may touch again */
        txm_flow_augment(g, from, d);
        while (g->orphan_count) {
            const int orphan = g->orphans[g->orphan_at];
            if (++g->orphan_at == g->count) g->orphan_at = 0;
            g->orphan_count--;
            txm_flow_adopt(g, orphan);
        }
    }
}

/* Memory for up to most nodes with 4 or 6 directions, 22 + 4 * directions bytes each, from the
   arena. 0: there is none. */
static inline int txm_flow_make(txm_flow *g, txm_arena *arena, int directions, int most) {
    const size_t n = (size_t)most;
    g->directions = directions;
    int ok = 1;
    for (int d = 0; d < directions && ok; d++) {
        g->arc[d] = (int32_t *)txm_arena_alloc(arena, n, sizeof(int32_t));
        ok = g->arc[d] != NULL;
    }
    int32_t *block = ok ? (int32_t *)txm_arena_alloc(arena, n, 5 * sizeof(int32_t)) : NULL;
    g->tree = (uint8_t *)txm_arena_alloc(arena, n, 2);
    if (!block || !g->tree) return 0;
    g->excess = block;
    g->next = block + n;
    g->orphans = block + 2 * n;
    g->stamp = block + 3 * n;
    g->distance = block + 4 * n;
    g->parent = g->tree + n;
    return 1;
}

#endif /* TEXMATH_CUT_H */
