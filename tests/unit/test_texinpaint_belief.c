/* test_texinpaint_belief.c - belief propagation against exhaustive enumeration
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texinpaint_belief && build/tests/unit/test_texinpaint_belief */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "texinpaint/belief.h"
#include "testkit.h"

/* ---- small random graphs ---------------------------------------------------------------- */

enum { NODES = 8, LABELS = 5, LINKS = 20 };
typedef enum kind { CHAIN, TREE, LOOPS } kind;

typedef struct puzzle {
    int nodes, links, counts[NODES], ends[2 * LINKS];
    size_t firsts[NODES];
    int32_t unary[NODES * LABELS], pairs[LINKS][LABELS][LABELS];
    long calls;
} puzzle;

static int32_t pair_of(const void *context, int link, int a, int b) {
    puzzle *p = (puzzle *)(uintptr_t)context;
    p->calls++;
    return p->pairs[link][a][b];
}

static void add_link(puzzle *p, txm_rng *rng, int a, int b) {
    const int turned = (int)txm_rng_below(rng, 2);
    p->ends[2 * p->links] = turned ? b : a;
    p->ends[2 * p->links + 1] = turned ? a : b;
    p->links++;
}

/* few different costs make ties */
static void make_puzzle(puzzle *p, txm_rng *rng, kind k) {
    const uint32_t range = txm_rng_below(rng, 2) ? 1000 : 10;
    size_t sum = 0;
    memset(p, 0, sizeof *p);
    p->nodes = 1 + (int)txm_rng_below(rng, NODES);
    for (int n = 0; n < p->nodes; n++) {
        p->counts[n] = 1 + (int)txm_rng_below(rng, LABELS - 1);
        p->firsts[n] = sum;
        sum += (size_t)p->counts[n];
    }
    for (size_t i = 0; i < sum; i++) p->unary[i] = (int32_t)txm_rng_below(rng, range);
    for (int n = 1; n < p->nodes; n++)
        add_link(p, rng, k == CHAIN ? n - 1 : (int)txm_rng_below(rng, (uint32_t)n), n);
    for (int extra = k == LOOPS && p->nodes > 2 ? 1 + (int)txm_rng_below(rng, 6) : 0; extra; extra--) {
        const int a = (int)txm_rng_below(rng, (uint32_t)p->nodes);
        const int b = (int)txm_rng_below(rng, (uint32_t)p->nodes - 1);
        add_link(p, rng, a, b + (b >= a));
    }
    for (int l = 0; l < p->links; l++)
        for (int a = 0; a < LABELS; a++)
            for (int b = 0; b < LABELS; b++)
                p->pairs[l][a][b] = (int32_t)txm_rng_below(rng, range);
}

static txi_graph graph_of(const puzzle *p) {
    txi_graph g;
    memset(&g, 0, sizeof g);
    g.node_count = p->nodes;
    g.link_count = p->links;
    g.counts = p->counts;
    g.firsts = p->firsts;
    g.unary = p->unary;
    g.ends = p->ends;
    g.pair = pair_of;
    g.context = p;
    return g;
}

static int64_t energy_of(const puzzle *p, const int *x) {
    int64_t sum = 0;
    for (int n = 0; n < p->nodes; n++) sum += p->unary[p->firsts[n] + (size_t)x[n]];
    for (int l = 0; l < p->links; l++) sum += p->pairs[l][x[p->ends[2 * l]]][x[p->ends[2 * l + 1]]];
    return sum;
}

static int64_t least_energy(const puzzle *p) {
    int64_t least = INT64_MAX;
    int x[NODES] = {0}, n = 0;
    while (n < p->nodes) {
        const int64_t e = energy_of(p, x);
        least = e < least ? e : least;
        for (n = 0; n < p->nodes && ++x[n] == p->counts[n]; n++) x[n] = 0;
    }
    return least;
}

/* One node at a time from the cheapest labels. */
static int64_t single_energy(const puzzle *p) {
    int x[NODES] = {0}, changed = 1;
    for (int n = 0; n < p->nodes; n++)
        for (int a = 1; a < p->counts[n]; a++)
            if (p->unary[p->firsts[n] + (size_t)a] < p->unary[p->firsts[n] + (size_t)x[n]]) x[n] = a;
    while (changed) {
        changed = 0;
        for (int n = 0; n < p->nodes; n++) {
            int best = x[n];
            int64_t least = energy_of(p, x);
            for (int a = 0; a < p->counts[n]; a++) {
                x[n] = a;
                if (energy_of(p, x) < least) least = energy_of(p, x), best = a, changed = 1;
            }
            x[n] = best;
        }
    }
    return energy_of(p, x);
}

static int64_t solve(const puzzle *p, int keep, int *labels) {
    const txi_graph g = graph_of(p);
    int64_t energy = -1;
    txm_arena arena;
    txm_arena_init(&arena, NULL);
    assert_int_equal(txi_belief(&g, keep, 1, &arena, labels, &energy, NULL), TXM_OK);
    for (int n = 0; n < p->nodes; n++) assert_in_range(labels[n], 0, p->counts[n] - 1);
    assert_int_equal(energy, energy_of(p, labels));
    txm_arena_free(&arena);
    return energy;
}

/* ---- tests ------------------------------------------------------------------------------ */

static void test_chains_and_trees_are_exact(void **state) {
    txm_rng rng = txm_rng_make(1, 0);
    puzzle p;
    int labels[NODES];
    (void)state;
    for (int i = 0; i < 400; i++) {
        make_puzzle(&p, &rng, i & 1 ? TREE : CHAIN);
        assert_int_equal(solve(&p, LABELS, labels), least_energy(&p));
    }
}

static void test_loops_are_mostly_exact(void **state) {
    txm_rng rng = txm_rng_make(2, 0);
    puzzle p;
    int labels[NODES], optimal = 0;
    (void)state;
    for (int i = 0; i < 300; i++) {
        make_puzzle(&p, &rng, LOOPS);
        const int64_t energy = solve(&p, LABELS, labels);
        assert_true(energy <= single_energy(&p));
        optimal += energy == least_energy(&p);
    }
    assert_true(optimal >= 294); /* 98 of 100; measured: 99.8 */
}

/* A long chain whose labels are positions: neighbours should be one apart, the ends are given. Of 200
   labels 8 are kept, and the path must still be found, with few calls. */
typedef struct path {
    int32_t unary[20 * 200];
    long calls;
} path;

static int32_t step_cost(const void *context, int link, int a, int b) {
    path *p = (path *)(uintptr_t)context;
    (void)link;
    p->calls++;
    return b == a + 1 ? 0 : 10 + (b > a ? b - a : a - b);
}

static void test_pruning_keeps_the_path(void **state) {
    static path p;
    int counts[20], ends[38], labels[20];
    size_t firsts[20];
    int64_t energy = 0;
    txi_graph g;
    txm_arena arena;
    (void)state;
    memset(&g, 0, sizeof g);
    for (int n = 0; n < 20; n++) {
        counts[n] = 200;
        firsts[n] = 200 * (size_t)n;
        ends[2 * (n < 19 ? n : 0)] = n < 19 ? n : 0;
        ends[2 * (n < 19 ? n : 0) + 1] = n < 19 ? n + 1 : 1;
    }
    for (int a = 0; a < 200; a++) {
        p.unary[a] = a == 57 ? 0 : 500;
        p.unary[19 * 200 + a] = a == 57 + 19 ? 0 : 500;
    }
    g.node_count = 20;
    g.link_count = 19;
    g.counts = counts;
    g.firsts = firsts;
    g.unary = p.unary;
    g.ends = ends;
    g.pair = step_cost;
    g.context = &p;
    txm_arena_init(&arena, NULL);
    assert_int_equal(txi_belief(&g, 8, 1, &arena, labels, &energy, NULL), TXM_OK);
    assert_int_equal(energy, 0);
    for (int n = 0; n < 20; n++) assert_int_equal(labels[n], 57 + n);
    assert_true(p.calls <= 19 * (2 * 8 * 200 + 8 * 8)); /* all pairs: 19 * 40,000 */
    txm_arena_free(&arena);
}

static void test_late_links_are_not_pruned_with(void **state) {
    txm_rng rng = txm_rng_make(3, 0);
    puzzle p;
    uint8_t late[LINKS];
    int labels[NODES];
    (void)state;
    memset(late, 1, sizeof late);
    for (int i = 0; i < 50; i++) {
        make_puzzle(&p, &rng, TREE);
        txi_graph g = graph_of(&p);
        txm_arena arena;
        int64_t energy;
        g.late = late;
        txm_arena_init(&arena, NULL);
        assert_int_equal(txi_belief(&g, LABELS, 1, &arena, labels, &energy, NULL), TXM_OK);
        assert_int_equal(energy, least_energy(&p));
        long cells = 0;
        for (int l = 0; l < p.links; l++)
            cells += (long)p.counts[p.ends[2 * l]] * p.counts[p.ends[2 * l + 1]];
        assert_true(p.calls == cells);
        txm_arena_free(&arena);
    }
}

static void test_no_nodes(void **state) {
    txi_graph g;
    txm_arena arena;
    int64_t energy = -1;
    (void)state;
    memset(&g, 0, sizeof g);
    txm_arena_init(&arena, NULL);
    assert_int_equal(txi_belief(&g, 8, 1, &arena, NULL, &energy, NULL), TXM_OK);
    assert_int_equal(energy, 0);
    txm_arena_free(&arena);
}

static txm_status run_puzzle(void *context, txm_env *env) {
    const txi_graph g = graph_of((const puzzle *)context);
    int labels[NODES];
    txm_arena arena;
    txm_arena_init(&arena, env);
    const txm_status status = txi_belief(&g, 3, 1, &arena, labels, NULL, env);
    txm_arena_free(&arena);
    return status;
}

static void test_faults(void **state) {
    txm_rng rng = txm_rng_make(4, 0);
    puzzle p;
    (void)state;
    do make_puzzle(&p, &rng, LOOPS);
    while (p.nodes < 6);
    assert_true(tk_sweep(run_puzzle, &p, TK_ALLOCATION) > 10);
    assert_true(tk_sweep(run_puzzle, &p, TK_ONWARD) > 10);
    assert_true(tk_sweep(run_puzzle, &p, TK_CANCEL) > 4);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_chains_and_trees_are_exact),
        cmocka_unit_test(test_loops_are_mostly_exact),
        cmocka_unit_test(test_pruning_keeps_the_path),
        cmocka_unit_test(test_late_links_are_not_pruned_with),
        cmocka_unit_test(test_no_nodes),
        cmocka_unit_test(test_faults),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
