/* test_texinpaint_blend.c - the correction of copied pixels against a direct solution, turned normals
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texinpaint_blend && build/tests/unit/test_texinpaint_blend */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "texinpaint/blend.h"
#include "texinpaint/fill.h"

#include "testkit.h"

enum { SIDE = 21, PIXELS = SIDE * SIDE, MIDDLE = SIDE / 2, CHANNELS = 3, MOST = 120 };

static uint8_t states[PIXELS];
static txi_copy copies[PIXELS];
static float values[CHANNELS * PIXELS], before[CHANNELS * PIXELS];
/* as it is, by a quarter to either side, mirrored */
static const txi_pose poses[4] = {{1, 0, 0, 1}, {0, 1, -1, 0}, {0, -1, 1, 0}, {-1, 0, 0, 1}};

static txi_window window_of(void) {
    txi_window w;
    memset(&w, 0, sizeof w);
    w.width = w.height = SIDE;
    w.state = states;
    return w;
}

/* A hole of 9 x 7 pixels in the middle, in three pieces; the copies of a piece lie at p + offset. */
static void make_hole(void) {
    static const int offset[3][2] = {{-5, 7}, {6, -6}, {6, 6}};
    for (int i = 0; i < PIXELS; i++) {
        const int x = i % SIDE, y = i / SIDE, hole = abs(x - MIDDLE) < 5 && abs(y - MIDDLE) < 4;
        const int piece = x + y < 2 * MIDDLE ? 0 : x > MIDDLE + 1 ? 1 : 2;
        states[i] = (uint8_t)(hole ? TXI_HOLE : TXI_KNOWN);
        memset(&copies[i], 0, sizeof copies[i]);
        copies[i].piece = hole ? piece : -1;
        copies[i].x = (float)(x + offset[piece][0]);
        copies[i].y = (float)(y + offset[piece][1]);
    }
    for (int y = 0; y < SIDE; y++) states[y * SIDE] = TXI_VOID;
}

/* ---- against a direct solution ------------------------------------------------------------------ */

static int is_inside(int x, int y) {
    return x >= 0 && y >= 0 && x < SIDE && y < SIDE;
}

static int is_known(int x, int y) {
    return is_inside(x, y) && states[y * SIDE + x] == TXI_KNOWN;
}

/* the value one channel has a step beyond the source of a pixel; copies lie on pixels here. 0: none there */
static int beyond(int p, int dx, int dy, int c, double *value) {
    const int x = (int)copies[p].x + dx, y = (int)copies[p].y + dy;
    if (!is_known(x, y)) return 0;
    *value = (double)before[CHANNELS * (y * SIDE + x) + c];
    return 1;
}

static void solve_dense(double a[MOST][MOST], double *b, int n) {
    for (int i = 0; i < n; i++) { /* diagonally dominant: no pivots */
        for (int k = i + 1; k < n; k++) {
            const double f = a[k][i] / a[i][i];
            for (int j = i; j < n; j++) a[k][j] -= f * a[i][j];
            b[k] -= f * b[i];
        }
    }
    for (int i = n; i-- > 0;) {
        for (int k = i + 1; k < n; k++) b[i] -= a[i][k] * b[k];
        b[i] /= a[i][i];
    }
}

/* The wanted values of the hole, by the definition at the top of blend.h. */
static void expect(double *wanted) {
    static const int dx[4] = {1, -1, 0, 0}, dy[4] = {0, 0, 1, -1};
    static double a[MOST][MOST], right[CHANNELS][MOST], system[MOST][MOST];
    static int number[PIXELS], pixel[MOST];
    double low[CHANNELS], high[CHANNELS];
    int n = 0;
    for (int c = 0; c < CHANNELS; c++) {
        low[c] = 1e9;
        high[c] = -1e9;
    }
    for (int i = 0; i < PIXELS; i++) {
        if (states[i] == TXI_HOLE) {
            assert_true(n < MOST);
            number[i] = n;
            pixel[n++] = i;
        }
        for (int c = 0; c < CHANNELS && states[i] == TXI_KNOWN; c++) {
            low[c] = fmin(low[c], before[CHANNELS * i + c]);
            high[c] = fmax(high[c], before[CHANNELS * i + c]);
        }
    }
    memset(a, 0, sizeof a);
    memset(right, 0, sizeof right);
    for (int i = 0; i < n; i++) {
        const int p = pixel[i];
        a[i][i] += TXI_BLEND_SCREEN;
        for (int k = 0; k < 4; k++) {
            const int x = p % SIDE + dx[k], y = p / SIDE + dy[k], q = y * SIDE + x;
            double jump[CHANNELS] = {0, 0, 0}, square = 0;
            if (!is_inside(x, y) || states[q] == TXI_VOID) continue;
            const int hole = states[q] == TXI_HOLE;
            for (int c = 0; c < CHANNELS && !(hole && copies[p].piece == copies[q].piece); c++) {
                double here = 0, there = 0, mine, theirs, mean = 0;
                int count = 0;
                beyond(p, 0, 0, c, &here);
                if (hole) beyond(q, 0, 0, c, &there);
                else there = (double)before[CHANNELS * q + c];
                if (beyond(p, dx[k], dy[k], c, &mine)) {
                    mean += mine - here;
                    count++;
                }
                if (hole && beyond(q, -dx[k], -dy[k], c, &theirs)) {
                    mean += there - theirs;
                    count++;
                }
                jump[c] = there - here - (count ? mean / count : 0);
                const double unit = (high[c] - low[c]) * (hole ? TXI_BLEND_JUMP : TXI_RIM_JUMP);
                square += jump[c] / unit * (jump[c] / unit) / CHANNELS;
            }
            const double weight = (hole ? 1 : TXI_RIM_WEIGHT) *
                                  (square < 9 ? (1 - square / 9) * (1 - square / 9) : 0);
            a[i][i] += weight;
            if (hole) a[i][number[q]] -= weight;
            for (int c = 0; c < CHANNELS; c++) right[c][i] += weight * jump[c];
        }
    }
    for (int c = 0; c < CHANNELS; c++) {
        memcpy(system, a, sizeof a);
        solve_dense(system, right[c], n);
        for (int i = 0; i < n; i++) {
            double v = 0;
            beyond(pixel[i], 0, 0, c, &v);
            wanted[CHANNELS * pixel[i] + c] = fmin(fmax(v + right[c][i], low[c]), high[c]);
        }
    }
}

static void test_against_direct_solution(void **state) {
    (void)state;
    static double wanted[CHANNELS * PIXELS];
    const txi_window w = window_of();
    txm_rng rng = txm_rng_make(1, 2);
    for (int round = 0; round < 6; round++) { /* ever rougher: more and more steps count as edges */
        double changed = 0;
        make_hole();
        for (int i = 0; i < CHANNELS * PIXELS; i++)
            before[i] = (float)(0.02 * (i / CHANNELS % SIDE) * (i % 3 + 1) +
                                0.012 * (i / CHANNELS / SIDE) + 0.1 * round * txm_rng_double(&rng));
        memcpy(values, before, sizeof values);
        expect(wanted);
        assert_int_equal(txi_blend_map(&w, copies, poses, values, CHANNELS, 0, 0, NULL), TXM_OK);
        for (int i = 0; i < CHANNELS * PIXELS; i++) {
            double v;
            if (states[i / CHANNELS] != TXI_HOLE) {
                assert_true(values[i] == before[i]);
                continue;
            }
            if (fabs(values[i] - wanted[i]) > 1e-4)
                fail_msg("round %d, pixel %d: %g, not %g", round, i / CHANNELS, (double)values[i],
                         wanted[i]);
            assert_true(beyond(i / CHANNELS, 0, 0, i % CHANNELS, &v));
            changed = fmax(changed, fabs(v - values[i]));
        }
        assert_true(changed > 0.01);
    }
}

/* ---- turned pieces --------------------------------------------------------------------------------- */

/* Vectors that point away from the middle: a copy that is turned about the middle must fit as it is. */
static void test_normals_turn(void **state) {
    (void)state;
    const txi_window w = window_of();
    make_hole();
    for (int i = 0; i < PIXELS; i++) {
        const int x = i % SIDE - MIDDLE, y = i / SIDE - MIDDLE;
        /* a square turned by a quarter, or mirrored, comes to lie where it is known */
        states[i] = (uint8_t)(x > 2 && x < 7 && y > -2 && y < 2 ? TXI_HOLE : TXI_KNOWN);
        const double r = 0.01 + sqrt((double)(x * x + y * y));
        before[3 * i] = (float)(0.7 * x / r);
        before[3 * i + 1] = (float)(0.7 * y / r);
        before[3 * i + 2] = 0.7f;
    }
    for (int turn = 1; turn < 5; turn++) { /* 4: two pieces */
        for (int i = 0; i < PIXELS; i++) {
            const int x = i % SIDE - MIDDLE, y = i / SIDE - MIDDLE;
            const int pose = turn < 4 ? turn : y > 0 ? 1 : 3;
            copies[i].pose = pose;
            copies[i].piece = states[i] == TXI_HOLE ? pose : -1;
            copies[i].x = MIDDLE + (float)x * poses[pose].a + (float)y * poses[pose].c;
            copies[i].y = MIDDLE + (float)x * poses[pose].b + (float)y * poses[pose].d;
        }
        memcpy(values, before, sizeof values);
        for (int i = 0; i < PIXELS; i++) {
            if (states[i] == TXI_HOLE) memset(values + 3 * i, 0, 3 * sizeof(float));
        }
        assert_int_equal(txi_blend_map(&w, copies, poses, values, 3, 0, 1, NULL), TXM_OK);
        for (int i = 0; i < 3 * PIXELS; i++) assert_true(fabsf(values[i] - before[i]) < 1e-4f);
    }
}

/* Labels are copied as they are, from the nearest pixel. */
static void test_labels(void **state) {
    (void)state;
    const txi_window w = window_of();
    make_hole();
    for (int i = 0; i < PIXELS; i++) {
        values[i] = before[i] = (float)(i * 7 % 5);
        copies[i].x += 0.3f;
        copies[i].y -= 0.4f;
    }
    assert_int_equal(txi_blend_map(&w, copies, poses, values, 1, 1, 0, NULL), TXM_OK);
    for (int i = 0; i < PIXELS; i++) {
        if (states[i] != TXI_HOLE) continue;
        const int x = (int)floor((double)copies[i].x + 0.5),
                  y = (int)floor((double)copies[i].y + 0.5);
        assert_true(values[i] == before[y * SIDE + x]);
    }
}

static txm_status blend(void *context, txm_env *env) {
    const txi_window w = window_of();
    (void)context;
    return txi_blend_map(&w, copies, poses, values, 3, 0, 0, env);
}

static void test_faults(void **state) {
    (void)state;
    make_hole();
    for (int i = 0; i < CHANNELS * PIXELS; i++) values[i] = (float)(i % 7);
    assert_true(tk_sweep(blend, NULL, TK_ALLOCATION) >= 8);
    assert_true(tk_sweep(blend, NULL, TK_ONWARD) >= 8);
}

/* ---- before the values are blended ---------------------------------------------------------------- */

/* Missing texels may lie between the pixels of a window: nothing is to be filled in it then. */
static void test_window_without_hole(void **state) {
    static uint8_t color[4 * PIXELS];
    txi_window w = window_of();
    txi_style style;
    txi_filler *filler = NULL;
    txm_arena arena;
    (void)state;
    memset(states, TXI_KNOWN, sizeof states);
    memset(&style, 0, sizeof style);
    style.start = 14;
    w.color = color;
    txm_arena_init(&arena, NULL);
    assert_int_equal(txi_filler_make(&w, &style, 1, &arena, NULL, &filler), TXM_TOO_SMALL);
    txm_arena_free(&arena);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_against_direct_solution),
        cmocka_unit_test(test_normals_turn),
        cmocka_unit_test(test_labels),
        cmocka_unit_test(test_faults),
        cmocka_unit_test(test_window_without_hole),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
