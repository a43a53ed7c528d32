#ifndef TEXINPAINT_BELIEF_H
#define TEXINPAINT_BELIEF_H

#include "config.h"

/* ---- belief propagation ---------------------------------------------------------------------
   Labels x for the nodes of a graph that minimise

       E(x) = sum over nodes of unary(n, x_n) + sum over links of pair(l, x_a, x_b)   [1, eq. 2]

   by min-sum belief propagation. All costs are integers, so that every build decides alike.

   1. Pruning, as in priority belief propagation [5]: the nodes are visited in the order of how few
   of
      their labels are plausible, then in the opposite order. Each one sends its cheapest labels
      only, and keeps those that are cheapest by the messages from both visits.
   2. A graph without cycles: the exact minimum by dynamic programming.
   3. Else messages with damping, from which the labels are read node by node; then moves that fix
      some nodes, so that the others form a forest, and optimise all of these at once. The result
      is never worse than that of optimising one node at a time (ICM) from the cheapest labels. */

enum {
    TXI_COST_MOST = 1 << 30,     /* of one unary or pair cost; may be used as "forbidden"        */
    TXI_BELIEF_ROUNDS = 24,      /* of messages on a graph with cycles; ours                     */
    TXI_BELIEF_MOVES = 16        /* of forests on a graph with cycles; ours                      */
};

typedef struct txi_graph {
    int node_count, link_count;
    const int *counts;    /* labels per node, 1 or more                                        */
    const size_t *firsts; /* per node, where its costs begin in unary                          */
    const int32_t *unary; /* 0..TXI_COST_MOST                                                   */
    const int *ends;      /* 2 per link: different nodes                                        */
    const uint8_t *late;  /* per link, non-zero: too expensive for pruning, not used there; NULL:
                             0                                                                   */
    /* the cost of label a of the link's first node beside label b of its second,
       0..TXI_COST_MOST */
    int32_t (*pair)(const void *context, int link, int a, int b);
    const void *context;
} txi_graph;

/* What both steps need to know of the graph. */
typedef struct txi_beliefs {
    const txi_graph *graph;
    size_t *arms;        /* node_count + 1: where a node's links begin in arm                     */
    int *arm;            /* links, each twice                                                    */
    int *kept_counts;    /* labels kept per node                                                 */
    size_t *kept_firsts; /* node_count + 1: where they begin in kept and sums                    */
    int *kept;           /* labels, ascending for each node                                      */
    int64_t *unary;      /* of the kept labels                                                   */
    size_t *table_firsts; /* per link, where its table begins                                     */
    int32_t *tables;     /* pair costs of kept labels, rows are labels of the first node         */
    int *order, *parent; /* of the forest: nodes in the order of visits, link to the parent or -1 */
    uint32_t *group;     /* sets of free nodes that are connected, see txi_root                  */
    int *shuffled;       /* nodes in a random order                                              */
    uint8_t *is_free;    /* per node, 1: optimised in this move                                  */
    int64_t *sums;       /* per kept label                                                       */
    size_t *back_firsts; /* per node, where its labels begin in back                             */
    int *back;           /* for each label of the parent, the best label of the node             */
} txi_beliefs;

static int txi_other_end(const txi_graph *g, int link, int node) {
    return g->ends[2 * link] == node ? g->ends[2 * link + 1] : g->ends[2 * link];
}

/* Lists the links of each node. */
static void txi_belief_link(txi_beliefs *t, txm_arena *arena) {
    const txi_graph *g = t->graph;
    const size_t nodes = (size_t)g->node_count;
    t->arms = (size_t *)txm_arena_zero(arena, nodes + 1, sizeof *t->arms);
    t->arm = (int *)txm_arena_alloc(arena, 2 * (size_t)g->link_count + 1, sizeof *t->arm);
    if (arena->failed) return;
    for (int i = 0; i < 2 * g->link_count; i++) t->arms[g->ends[i]]++;
    for (size_t n = 0, sum = 0; n <= nodes; n++) { /* where they end, then moved to the front */
        sum += n < nodes ? t->arms[n] : 0;
        t->arms[n] = sum;
    }
    for (int i = 2 * g->link_count - 1; i >= 0; i--) t->arm[--t->arms[g->ends[i]]] = i / 2;
}

/* ---- pruning ---- */

/* A cost as a sort key. */
static uint32_t txi_cost_key(int64_t cost) {
    return cost < 0 ? 0 : cost > UINT32_MAX ? UINT32_MAX : (uint32_t)cost;
}

/* The `keep` cheapest of count costs, as pairs of key and index; of equal ones the first.
   Returns how many. scratch: count pairs. */
static int txi_cheapest(const int64_t *costs, int count, int keep, txm_pair *pairs,
                        txm_pair *scratch) {
    int64_t least = costs[0];
    for (int i = 1; i < count; i++) least = costs[i] < least ? costs[i] : least;
    for (int i = 0; i < count; i++) {
        pairs[i].key = txi_cost_key(costs[i] - least);
        pairs[i].value = (uint32_t)i;
    }
    txm_sort_pairs(pairs, scratch, (size_t)count);
    return count < keep ? count : keep;
}

/* How many labels of a node cost less than the least plus an eighth of the range: the fewer, the
   surer the node is of its label. */
static int txi_plausible(const int64_t *costs, int count) {
    int64_t least = costs[0], most = costs[0];
    int plausible = 0;
    for (int i = 1; i < count; i++) {
        least = costs[i] < least ? costs[i] : least;
        most = costs[i] > most ? costs[i] : most;
    }
    for (int i = 0; i < count; i++) plausible += costs[i] - least <= (most - least) / 8;
    return plausible;
}

/* Messages from the chosen labels of a node along its links to nodes not yet visited. */
static void txi_send_chosen(const txi_beliefs *t, int node, const txm_pair *chosen,
                            int chosen_count, const uint8_t *visited, int64_t *costs) {
    const txi_graph *g = t->graph;
    for (size_t i = t->arms[node]; i < t->arms[node + 1]; i++) {
        const int link = t->arm[i], other = txi_other_end(g, link, node);
        int64_t *to = costs + g->firsts[other];
        if (visited[other] || (g->late && g->late[link])) continue;
        for (int b = 0; b < g->counts[other]; b++) {
            int64_t least = INT64_MAX;
            for (int k = 0; k < chosen_count; k++) {
                const int a = (int)chosen[k].value;
                const int64_t pair = g->ends[2 * link] == node ? g->pair(g->context, link, a, b)
                                                               : g->pair(g->context, link, b, a);
                const int64_t sum = (int64_t)chosen[k].key + pair;
                least = sum < least ? sum : least;
            }
            to[b] += least;
        }
    }
}

/* Keep at most `keep` labels of each node. cost: O(links * keep * labels) calls of pair. */
static txm_status txi_belief_prune(txi_beliefs *t, int keep, txm_arena *arena, txm_env *env) {
    const txi_graph *g = t->graph;
    const int nodes = g->node_count;
    size_t labels = 0, kept = 0;
    int most = 1;
    for (int n = 0; n < nodes; n++) {
        labels += (size_t)g->counts[n];
        most = g->counts[n] > most ? g->counts[n] : most;
    }
    int64_t *costs = (int64_t *)txm_arena_alloc(arena, 2 * labels + 1, sizeof *costs);
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(arena, 2 * (size_t)most, sizeof *pairs);
    uint8_t *visited = (uint8_t *)txm_arena_zero(arena, (size_t)nodes + 1, 1);
    int *order = (int *)txm_arena_alloc(arena, (size_t)nodes + 1, sizeof *order);
    int *plausible = (int *)txm_arena_alloc(arena, (size_t)nodes + 1, sizeof *plausible);
    t->kept_counts = (int *)txm_arena_alloc(arena, (size_t)nodes + 1, sizeof *t->kept_counts);
    t->kept_firsts = (size_t *)txm_arena_alloc(arena, (size_t)nodes + 1, sizeof *t->kept_firsts);
    t->kept = (int *)txm_arena_alloc(arena, labels + 1, sizeof *t->kept);
    if (arena->failed) return txi_no_memory(env);

    for (int pass = 0; pass < 2; pass++) {
        for (int n = 0; n < nodes; n++) {
            for (int i = 0; i < g->counts[n]; i++)
                costs[(size_t)pass * labels + g->firsts[n] + (size_t)i] =
                    g->unary[g->firsts[n] + (size_t)i];
            visited[n] = 0;
            plausible[n] = -1;
        }
        for (int k = 0; k < nodes; k++) {
            int64_t *mine = costs + (size_t)pass * labels;
            int node = pass ? order[nodes - 1 - k] : -1;
            for (int n = 0; n < nodes && !pass; n++) {
                if (visited[n]) continue;
                if (plausible[n] < 0)
                    plausible[n] = txi_plausible(mine + g->firsts[n], g->counts[n]);
                if (node < 0 || plausible[n] < plausible[node]) node = n;
            }
            if (!pass) order[k] = node;
            visited[node] = 1;
            for (size_t i = t->arms[node]; i < t->arms[node + 1]; i++)
                plausible[txi_other_end(g, t->arm[i], node)] = -1; /* its costs change now */
            const int chosen =
                txi_cheapest(mine + g->firsts[node], g->counts[node], keep, pairs, pairs + most);
            txi_send_chosen(t, node, pairs, chosen, visited, mine);
        }
        if (txm_progress(env, 0, "strips")) return txi_stopped(env);
    }
    for (int n = 0; n < nodes; n++) {
        int64_t *a = costs + g->firsts[n], *b = a + labels;
        for (int i = 0; i < g->counts[n]; i++) a[i] += b[i] - g->unary[g->firsts[n] + (size_t)i];
        t->kept_firsts[n] = kept;
        t->kept_counts[n] = txi_cheapest(a, g->counts[n], keep, pairs, pairs + most);
        for (int i = 0; i < t->kept_counts[n]; i++) pairs[i].key = pairs[i].value;
        txm_sort_pairs(pairs, pairs + most, (size_t)t->kept_counts[n]);
        for (int i = 0; i < t->kept_counts[n]; i++) t->kept[kept++] = (int)pairs[i].value;
    }
    t->kept_firsts[nodes] = kept;
    return TXM_OK;
}

/* ---- one move: the free nodes form a forest, the others keep their labels ---- */

/* The cost of a kept label of `node` (index x) beside a kept label of the other end (index y). */
static int32_t txi_pair_of(const txi_beliefs *t, int link, int node, int x, int y) {
    const int *ends = t->graph->ends + 2 * link;
    const int row = ends[0] == node ? x : y, column = ends[0] == node ? y : x;
    return t->tables[t->table_firsts[link] + (size_t)row * (size_t)t->kept_counts[ends[1]] +
                     (size_t)column];
}

/* E(x), x as indices into the kept labels */
static int64_t txi_belief_energy(const txi_beliefs *t, const int *x) {
    const txi_graph *g = t->graph;
    int64_t sum = 0;
    for (int n = 0; n < g->node_count; n++) sum += t->unary[t->kept_firsts[n] + (size_t)x[n]];
    for (int l = 0; l < g->link_count; l++)
        sum += txi_pair_of(t, l, g->ends[2 * l], x[g->ends[2 * l]], x[g->ends[2 * l + 1]]);
    return sum;
}

/* Frees nodes in the order `shuffled` as long as no cycle arises among them. Returns how many. */
static int txi_belief_free(txi_beliefs *t) {
    const txi_graph *g = t->graph;
    int count = 0;
    for (int n = 0; n < g->node_count; n++) {
        t->group[n] = (uint32_t)n;
        t->is_free[n] = 0;
    }
    for (int k = 0; k < g->node_count; k++) {
        const int n = t->shuffled[k];
        int cycle = 0;
        for (size_t i = t->arms[n]; i < t->arms[n + 1] && !cycle; i++) {
            const int m = txi_other_end(g, t->arm[i], n);
            if (!t->is_free[m]) continue;
            for (size_t j = t->arms[n]; j < i && !cycle; j++) { /* two links to one tree */
                const int o = txi_other_end(g, t->arm[j], n);
                cycle = t->is_free[o] &&
                        txi_root(t->group, (uint32_t)o) == txi_root(t->group, (uint32_t)m);
            }
        }
        if (cycle) continue;
        t->is_free[n] = 1;
        count++;
        for (size_t i = t->arms[n]; i < t->arms[n + 1]; i++) {
            const int m = txi_other_end(g, t->arm[i], n);
            if (t->is_free[m]) txi_join_sets(t->group, (uint32_t)m, (uint32_t)n);
        }
    }
    return count;
}

/* Orders the free nodes so that each stands behind its parent. Returns how many. */
static int txi_belief_order(txi_beliefs *t) {
    const txi_graph *g = t->graph;
    int count = 0;
    for (int n = 0; n < g->node_count; n++) t->parent[n] = -2; /* not reached */
    for (int root = 0; root < g->node_count; root++) {
        if (!t->is_free[root] || t->parent[root] != -2) continue;
        t->parent[root] = -1;
        t->order[count++] = root;
        for (int k = count - 1; k < count; k++) {
            const int n = t->order[k];
            for (size_t i = t->arms[n]; i < t->arms[n + 1]; i++) {
                const int m = txi_other_end(g, t->arm[i], n);
                if (!t->is_free[m] || t->parent[m] != -2) continue;
                t->parent[m] = t->arm[i];
                TXM_ASSERT(count < g->node_count);
                t->order[count++] = m;
            }
        }
    }
    return count;
}

/* The best labels of all free nodes, the others' given: exact. */
static void txi_belief_move(txi_beliefs *t, int *x) {
    const txi_graph *g = t->graph;
    const int count = txi_belief_order(t);
    for (int k = 0; k < count; k++) {
        const int n = t->order[k];
        int64_t *sums = t->sums + t->kept_firsts[n];
        for (int a = 0; a < t->kept_counts[n]; a++)
            sums[a] = t->unary[t->kept_firsts[n] + (size_t)a];
        for (size_t i = t->arms[n]; i < t->arms[n + 1]; i++) {
            const int m = txi_other_end(g, t->arm[i], n);
            for (int a = 0; a < t->kept_counts[n] && !t->is_free[m]; a++)
                sums[a] += txi_pair_of(t, t->arm[i], n, a, x[m]);
        }
    }
    size_t back = 0;
    for (int k = count - 1; k >= 0; k--) { /* leaves first */
        const int n = t->order[k], link = t->parent[n];
        if (link < 0) continue;
        const int up = txi_other_end(g, link, n);
        const int64_t *sums = t->sums + t->kept_firsts[n];
        t->back_firsts[n] = back;
        for (int b = 0; b < t->kept_counts[up]; b++) {
            int64_t least = INT64_MAX;
            int best = 0;
            for (int a = 0; a < t->kept_counts[n]; a++) {
                const int64_t sum = sums[a] + txi_pair_of(t, link, n, a, b);
                if (sum < least) least = sum, best = a;
            }
            t->back[back++] = best;
            t->sums[t->kept_firsts[up] + (size_t)b] += least;
        }
    }
    for (int k = 0; k < count; k++) { /* roots first */
        const int n = t->order[k], link = t->parent[n];
        const int64_t *sums = t->sums + t->kept_firsts[n];
        if (link >= 0) {
            x[n] = t->back[t->back_firsts[n] + (size_t)x[txi_other_end(g, link, n)]];
            continue;
        }
        x[n] = 0;
        for (int a = 1; a < t->kept_counts[n]; a++)
            if (sums[a] < sums[x[n]]) x[n] = a;
    }
}

/* ---- graphs with cycles ---- */

/* One node at a time, until nothing changes (ICM). */
static void txi_belief_single(txi_beliefs *t, int *x) {
    const txi_graph *g = t->graph;
    int changed = 1;
    for (int round = 0; round < 100 && changed; round++) {
        changed = 0;
        for (int n = 0; n < g->node_count; n++) {
            int64_t *sums = t->sums + t->kept_firsts[n];
            int best = x[n];
            for (int a = 0; a < t->kept_counts[n]; a++) {
                sums[a] = t->unary[t->kept_firsts[n] + (size_t)a];
                for (size_t i = t->arms[n]; i < t->arms[n + 1]; i++)
                    sums[a] += txi_pair_of(t, t->arm[i], n, a,
                                           x[txi_other_end(g, t->arm[i], n)]);
            }
            for (int a = 0; a < t->kept_counts[n]; a++)
                if (sums[a] < sums[best]) best = a;
            changed |= best != x[n];
            x[n] = best;
        }
    }
}

/* Where a link's messages to its first (side 0) or second end lie. */
static int64_t *txi_message(int64_t *messages, const size_t *firsts, const txi_beliefs *t, int link,
                            int side) {
    const int *ends = t->graph->ends + 2 * link;
    return messages + firsts[link] + (side ? (size_t)t->kept_counts[ends[0]] : 0);
}

/* The unary costs of a node and all messages to it, into its place in sums. */
static int64_t *txi_belief_gather(txi_beliefs *t, int n, int64_t *messages, const size_t *firsts) {
    const txi_graph *g = t->graph;
    int64_t *sums = t->sums + t->kept_firsts[n];
    for (int a = 0; a < t->kept_counts[n]; a++) sums[a] = t->unary[t->kept_firsts[n] + (size_t)a];
    for (size_t i = t->arms[n]; i < t->arms[n + 1]; i++) {
        const int64_t *in =
            txi_message(messages, firsts, t, t->arm[i], g->ends[2 * t->arm[i] + 1] == n);
        for (int a = 0; a < t->kept_counts[n]; a++) sums[a] += in[a];
    }
    return sums;
}

/* New messages from a node along one link: half the old one, half the new one, the least of them
   0. */
static void txi_belief_send(txi_beliefs *t, int n, int link, int64_t *messages,
                            const size_t *firsts) {
    const txi_graph *g = t->graph;
    const int side = g->ends[2 * link] == n; /* of the receiver */
    const int m = txi_other_end(g, link, n);
    const int64_t *sums = t->sums + t->kept_firsts[n];
    const int64_t *in = txi_message(messages, firsts, t, link, !side);
    int64_t *out = txi_message(messages, firsts, t, link, side), base = INT64_MAX;
    for (int b = 0; b < t->kept_counts[m]; b++) {
        int64_t least = INT64_MAX;
        for (int a = 0; a < t->kept_counts[n]; a++) {
            const int64_t sum = sums[a] - in[a] + txi_pair_of(t, link, n, a, b);
            least = sum < least ? sum : least;
        }
        out[b] = (out[b] + least) / 2;
        base = out[b] < base ? out[b] : base;
    }
    for (int b = 0; b < t->kept_counts[m]; b++) out[b] -= base;
}

/* Reads labels node by node: the least sum of the unary cost, the pair costs with nodes already
   read and the messages from the others. */
static void txi_belief_read(txi_beliefs *t, int *x, int64_t *messages, const size_t *firsts) {
    const txi_graph *g = t->graph;
    for (int n = 0; n < g->node_count; n++) {
        int64_t *sums = txi_belief_gather(t, n, messages, firsts);
        x[n] = 0;
        for (size_t i = t->arms[n]; i < t->arms[n + 1]; i++) {
            const int link = t->arm[i], m = txi_other_end(g, link, n);
            const int64_t *in = txi_message(messages, firsts, t, link, g->ends[2 * link + 1] == n);
            for (int a = 0; a < t->kept_counts[n] && m < n; a++)
                sums[a] += txi_pair_of(t, link, n, a, x[m]) - in[a];
        }
        for (int a = 1; a < t->kept_counts[n]; a++)
            if (sums[a] < sums[x[n]]) x[n] = a;
    }
}

/* Messages for some rounds; x receives the best labels read after any of them. y: room for
   labels. */
static txm_status txi_belief_loopy(txi_beliefs *t, int *x, int *y, txm_arena *arena, txm_env *env) {
    const txi_graph *g = t->graph;
    size_t size = 0;
    size_t *firsts = (size_t *)txm_arena_alloc(arena, (size_t)g->link_count + 1, sizeof *firsts);
    for (int l = 0; l < g->link_count && firsts; l++) {
        firsts[l] = size;
        size += (size_t)(t->kept_counts[g->ends[2 * l]] + t->kept_counts[g->ends[2 * l + 1]]);
    }
    int64_t *messages = (int64_t *)txm_arena_zero(arena, size + 1, sizeof *messages);
    if (arena->failed) return txi_no_memory(env);
    int64_t best = txi_belief_energy(t, x);
    for (int round = 0; round < TXI_BELIEF_ROUNDS; round++) {
        for (int k = 0; k < g->node_count; k++) { /* forwards and backwards alternately */
            const int n = round & 1 ? g->node_count - 1 - k : k;
            txi_belief_gather(t, n, messages, firsts);
            for (size_t i = t->arms[n]; i < t->arms[n + 1]; i++)
                txi_belief_send(t, n, t->arm[i], messages, firsts);
        }
        txi_belief_read(t, y, messages, firsts);
        const int64_t energy = txi_belief_energy(t, y);
        if (energy < best) {
            best = energy;
            memcpy(x, y, (size_t)g->node_count * sizeof *x);
        }
        if (txm_progress(env, 0, "strips")) return txi_stopped(env);
    }
    return TXM_OK;
}

/* Moves on random forests from x; the energy never rises. */
static void txi_belief_improve(txi_beliefs *t, int *x, txm_rng *rng) {
    for (int move = 0; move < TXI_BELIEF_MOVES; move++) {
        txm_shuffle(rng, t->shuffled, t->graph->node_count);
        txi_belief_free(t);
        txi_belief_move(t, x);
    }
}

/* ---- the whole ---- */

/* The cheapest label of each node by itself. */
static void txi_belief_cheapest(const txi_beliefs *t, int *x) {
    for (int n = 0; n < t->graph->node_count; n++) {
        const int64_t *unary = t->unary + t->kept_firsts[n];
        x[n] = 0;
        for (int a = 1; a < t->kept_counts[n]; a++)
            if (unary[a] < unary[x[n]]) x[n] = a;
    }
}

/* Tables of the pair costs of kept labels, and room for moves. */
static txm_status txi_belief_tables(txi_beliefs *t, txm_arena *arena, txm_env *env) {
    const txi_graph *g = t->graph;
    const size_t nodes = (size_t)g->node_count, kept = t->kept_firsts[nodes];
    size_t cells = 0, backs = 0;
    t->table_firsts =
        (size_t *)txm_arena_alloc(arena, (size_t)g->link_count + 1, sizeof *t->table_firsts);
    for (int l = 0; l < g->link_count && t->table_firsts; l++) {
        const int a = t->kept_counts[g->ends[2 * l]], b = t->kept_counts[g->ends[2 * l + 1]];
        t->table_firsts[l] = cells;
        cells += (size_t)a * (size_t)b;
        backs += (size_t)(a > b ? a : b); /* one of the two is the parent */
    }
    t->tables = (int32_t *)txm_arena_alloc(arena, cells + 1, sizeof *t->tables);
    t->unary = (int64_t *)txm_arena_alloc(arena, kept + 1, sizeof *t->unary);
    t->sums = (int64_t *)txm_arena_alloc(arena, kept + 1, sizeof *t->sums);
    t->order = (int *)txm_arena_alloc(arena, nodes + 1, sizeof *t->order);
    t->parent = (int *)txm_arena_alloc(arena, nodes + 1, sizeof *t->parent);
    t->group = (uint32_t *)txm_arena_alloc(arena, nodes + 1, sizeof *t->group);
    t->shuffled = (int *)txm_arena_alloc(arena, nodes + 1, sizeof *t->shuffled);
    t->is_free = (uint8_t *)txm_arena_alloc(arena, nodes + 1, 1);
    t->back_firsts = (size_t *)txm_arena_alloc(arena, nodes + 1, sizeof *t->back_firsts);
    t->back = (int *)txm_arena_alloc(arena, backs + 1, sizeof *t->back);
    if (arena->failed) return txi_no_memory(env);
    for (size_t n = 0; n < nodes; n++) {
        t->shuffled[n] = (int)n;
        for (size_t i = t->kept_firsts[n]; i < t->kept_firsts[n + 1]; i++)
            t->unary[i] = g->unary[g->firsts[n] + (size_t)t->kept[i]];
    }
    for (int l = 0; l < g->link_count; l++) {
        const int a = g->ends[2 * l], b = g->ends[2 * l + 1];
        int32_t *cell = t->tables + t->table_firsts[l];
        for (int i = 0; i < t->kept_counts[a]; i++)
            for (int j = 0; j < t->kept_counts[b]; j++)
                *cell++ = g->pair(g->context, l, t->kept[t->kept_firsts[a] + (size_t)i],
                                  t->kept[t->kept_firsts[b] + (size_t)j]);
        if (l % 16 == 15 && txm_progress(env, 0, "strips")) return txi_stopped(env);
    }
    return TXM_OK;
}

/* Labels of low energy.

   keep    labels of a node that are left after pruning, 1 or more; those of late links are only
           found if they survive it
   labels  receives one label per node
   energy  receives E of them; may be NULL
   return  TXM_OK; TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost    O(links * keep * (labels + keep * rounds)); memory of the arena                      */
static txm_status txi_belief(const txi_graph *g, int keep, uint64_t seed, txm_arena *arena,
                             int *labels, int64_t *energy, txm_env *env) {
    const size_t nodes = (size_t)g->node_count;
    txi_beliefs t;
    memset(&t, 0, sizeof t);
    t.graph = g;
    txi_belief_link(&t, arena);
    if (arena->failed) return txi_no_memory(env);
    txm_status status = txi_belief_prune(&t, keep, arena, env);
    if (status == TXM_OK) status = txi_belief_tables(&t, arena, env);
    if (status != TXM_OK) return status;
    int *x = (int *)txm_arena_zero(arena, 3 * nodes + 1, sizeof *x);
    if (!x) return txi_no_memory(env);
    int *y = x + nodes;

    if (TXI_LEFT_OUT & TXI_BELIEF) {
        txi_belief_cheapest(&t, x);
    } else if (txi_belief_free(&t) == g->node_count) {
        txi_belief_move(&t, x);
    } else {
        txm_rng rng = txm_rng_make(seed, 0);
        txi_belief_cheapest(&t, y);
        txi_belief_single(&t, y);
        memcpy(x, y, nodes * sizeof *x);
        status = txi_belief_loopy(&t, x, y + nodes, arena, env);
        if (status != TXM_OK) return status;
        txi_belief_improve(&t, x, &rng);
        txi_belief_improve(&t, y, &rng);
        if (txi_belief_energy(&t, y) < txi_belief_energy(&t, x)) memcpy(x, y, nodes * sizeof *x);
    }
    for (size_t n = 0; n < nodes; n++) labels[n] = t.kept[t.kept_firsts[n] + (size_t)x[n]];
    if (energy) *energy = txi_belief_energy(&t, x);
    return TXM_OK;
}

#endif /* TEXINPAINT_BELIEF_H */
