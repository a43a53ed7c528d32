/* test_texmath_cut.c - the minimum-error cut and the minimum cut of a grid
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texmath_cut && build/tests/unit/test_texmath_cut */
#include "mathkit.h"

/* ---- cut -------------------------------------------------------------------------------- */

/* The cheapest sum over all paths from line i, column j on. */
static double brute_cut(const float *error, int length, int width, int i, int j) {
    double best = INFINITY;
    if (i == length - 1) return error[i * width + j];
    for (int k = j - 1; k <= j + 1; k++) {
        if (k >= 0 && k < width) best = fmin(best, brute_cut(error, length, width, i + 1, k));
    }
    return error[i * width + j] + best;
}

static void test_cut(void **state) {
    (void)state;
    enum { L = 7, W = 5 };
    txm_rng rng = txm_rng_make(15, 0);
    for (int round = 0; round < 1500; round++) {
        const int length = txm_rng_range(&rng, 1, L), width = txm_rng_range(&rng, 1, W);
        float error[L * W], turned[L * W];
        double scratch[L * W], best = INFINITY, sum = 0, sum_turned;
        int path[L], other[L];
        for (int i = 0; i < length; i++) {
            for (int j = 0; j < width; j++) {
                /* integers, so that sums are exact in any order, and tie often */
                const float e = (float)txm_rng_below(&rng, round % 2 ? 3 : 1000);
                error[i * width + j] = turned[j * length + i] = e;
            }
        }
        for (int j = 0; j < width; j++) best = fmin(best, brute_cut(error, length, width, 0, j));
        const double total = txm_cut(error, length, width, width, 1, path, scratch);
        sum_turned = txm_cut(turned, length, width, 1, length, other, scratch);
        for (int i = 0; i < length; i++) {
            assert_in_range(path[i], 0, width - 1);
            if (i) assert_true(abs(path[i] - path[i - 1]) <= 1);
            sum += error[i * width + path[i]];
            assert_int_equal(path[i], other[i]);
        }
        assert_true(total == best && sum == best && sum_turned == best);
    }
    /* ties: straight on, and from the smallest index */
    float flat[L * W] = {0};
    double scratch[L * W];
    int path[L];
    txm_cut(flat, L, W, W, 1, path, scratch);
    for (int i = 0; i < L; i++) assert_int_equal(path[i], 0);
    flat[(L - 1) * W] = 1;
    txm_cut(flat, L, W, W, 1, path, scratch);
    for (int i = 0; i < L; i++) assert_int_equal(path[i], 1);
    /* a wall of INFINITY with one hole */
    for (int j = 0; j < W; j++) flat[3 * W + j] = j == 3 ? 0.5f : INFINITY;
    assert_true(txm_cut(flat, L, W, W, 1, path, scratch) == 0.5);
    assert_int_equal(path[3], 3);
    /* NaN breaks the optimum but never the bounds */
    for (int i = 0; i < L * W; i++) flat[i] = i % 3 ? NAN : 1;
    txm_cut(flat, L, W, W, 1, path, scratch);
    for (int i = 0; i < L; i++) assert_in_range(path[i], 0, W - 1);
    path[0] = 77;
    assert_true(txm_cut(flat, 0, W, W, 1, path, scratch) == 0);
    assert_true(txm_cut(flat, L, 0, W, 1, path, scratch) == 0);
    assert_int_equal(path[0], 77);
}

/* ---- minimum cut of a grid --------------------------------------------------------------- */

enum { FLOW_W = 4, FLOW_H = 3, FLOW_STRIDE = FLOW_W + 2, FLOW_NODES = (FLOW_W + 2) * (FLOW_H + 2) };

static int flow_node(int i) {
    return (i / FLOW_W + 1) * FLOW_STRIDE + i % FLOW_W + 1;
}

/* Capacities cut when the nodes of the mask are the sink's. */
static long flow_cut(int directions, const int step[6], int32_t arc[6][FLOW_NODES],
                     const int32_t excess[FLOW_NODES], unsigned mask) {
    long sum = 0;
    int is_sink[FLOW_NODES] = {0};
    for (int i = 0; i < FLOW_W * FLOW_H; i++) is_sink[flow_node(i)] = (int)(mask >> i & 1);
    for (int i = 0; i < FLOW_W * FLOW_H; i++) {
        const int p = flow_node(i);
        if (excess[p] > 0 && is_sink[p]) sum += excess[p];
        if (excess[p] < 0 && !is_sink[p]) sum -= excess[p];
        for (int d = 0; d < directions; d++) {
            if (!is_sink[p] && is_sink[p + step[d]]) sum += arc[d][p];
        }
    }
    return sum;
}

/* On random grids the cut is as cheap as the cheapest of all 2^12. */
static void test_flow(void **state) {
    (void)state;
    txm_arena arena;
    txm_flow g;
    txm_arena_init(&arena, NULL);
    for (int directions = 4; directions <= 6; directions += 2) {
        assert_true(txm_flow_make(&g, &arena, directions, FLOW_NODES));
        for (int trial = 0; trial < 150; trial++) {
            static int32_t arc[6][FLOW_NODES], excess[FLOW_NODES];
            txm_rng rng = txm_rng_make(5, (uint64_t)(trial * 10 + directions));
            const int most = trial % 3 == 0 ? 3 : 1000; /* small ones give ties */
            const int half = directions / 2;
            const int step[3] = {1, FLOW_STRIDE, FLOW_STRIDE - 1};
            memset(arc, 0, sizeof arc);
            memset(excess, 0, sizeof excess);
            for (int d = 0; d < half; d++) {
                g.step[d] = step[d];
                g.step[d + half] = -step[d];
            }
            for (int i = 0; i < FLOW_W * FLOW_H; i++) {
                const int p = flow_node(i);
                excess[p] = txm_rng_range(&rng, -most, most);
                for (int k = 0; k < FLOW_W * FLOW_H; k++) {
                    for (int d = 0; d < directions; d++) {
                        if (flow_node(k) == p + g.step[d])
                            arc[d][p] = txm_rng_range(&rng, 0, most);
                    }
                }
            }
            g.count = FLOW_NODES;
            for (int d = 0; d < directions; d++) memcpy(g.arc[d], arc[d], sizeof arc[d]);
            memcpy(g.excess, excess, sizeof excess);
            txm_flow_solve(&g);
            unsigned mask = 0;
            for (int i = 0; i < FLOW_W * FLOW_H; i++)
                mask |= (unsigned)(g.tree[flow_node(i)] == TXM_FLOW_SINK) << i;
            long least = LONG_MAX;
            for (unsigned m = 0; m < 1u << (FLOW_W * FLOW_H); m++) {
                const long cut = flow_cut(directions, g.step, arc, excess, m);
                if (cut < least) least = cut;
            }
            assert_int_equal(flow_cut(directions, g.step, arc, excess, mask), least);
        }
    }
    txm_arena_free(&arena);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_cut),
        cmocka_unit_test(test_flow),
    };
    return cmocka_run_group_tests_name("texmath cuts", tests, NULL, NULL);
}
