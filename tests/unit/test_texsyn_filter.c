/* test_texsyn_filter.c - what the sampler keeps of its filters, and its vector code
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texsyn_filter && build/tests/unit/test_texsyn_filter */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "testkit.h"
#include "texsyn/neighbourhood.h"

enum { MARGIN = 10, BANDS = 2 };

typedef struct scene {
    txm_arena arena;
    txs_level level;
    txs_type types[BANDS + BANDS * TXS_SHAPES];
    txs_canvas canvas;
    int16_t noise[TXS_NOISE + TXS_VALUES];
    txs_sampler *sampler;
} scene;

static scene the;

/* All shapes on the first band and some on the second, on a random canvas of this size. */
static void set_scene(int width, int height, uint64_t seed) {
    txm_rng rng = txm_rng_make(seed, 1);
    memset(&the, 0, sizeof the);
    txm_arena_init(&the.arena, NULL);
    assert_true(txs_canvas_make(&the.canvas, NULL, width, height, MARGIN, 2 * BANDS + 1));
    the.level.types = the.types;
    for (int b = 0; b < BANDS; b++) {
        the.level.values[b] = b ? 11 : 32;
        txs_type *t = &the.types[the.level.type_count++];
        t->kind = TEXSYN_SINGLE;
        t->band = t->other = b;
    }
    for (int b = 0; b < BANDS; b++) {
        for (int shape = b; shape < TXS_SHAPES / (1 + b); shape++) {
            txs_type *t = &the.types[the.level.type_count++];
            t->kind = TEXSYN_FILTER;
            t->band = t->other = b;
            t->shape = shape;
            t->scale = 20 + 40 * shape;
            for (int i = 0; i < TXS_RESPONSES; i++)
                t->share[i] = (int32_t)txm_rng_below(&rng, TXS_ONE / TXS_RESPONSES);
        }
        for (int y = 0; y < height; y++)
            for (int x = 0; x < width; x++)
                *txs_at(&the.canvas, b, x, y) =
                    (uint8_t)txm_rng_below(&rng, (uint32_t)the.level.values[b]);
        txs_wrap(&the.canvas, b);
    }
    txs_noise_table(the.noise);
    the.sampler = txs_sampler_make(&the.arena, &the.level, the.level.type_count, TXS_MAX_FILTERS,
                                   &the.canvas, BANDS, the.noise, seed);
    assert_non_null(the.sampler);
    txs_sampler_start(the.sampler, NULL);
}

static void clear_scene(void) {
    txs_canvas_free(&the.canvas, NULL);
    txm_arena_free(&the.arena);
}

/* Every response that a pixel looks at is what a count gives on the torus. */
static void check_responses(void) {
    const txs_filters *f = &the.sampler->filters;
    const int w = the.canvas.width, h = the.canvas.height;
    int seen = 0;
    for (int y = 0; y < h; y++) {
        for (int x = 0; x < w; x++) {
            for (int k = 0; k < f->count; k++) {
                const txs_type *t = &the.types[f->filter[k].type];
                int at[TXS_MAX_MEMBERS][2], weight[TXS_MAX_MEMBERS];
                const int n = txs_shape_pixels(t->shape, at, weight);
                for (int i = 0; i < n; i++) {
                    const int tx = x - at[i][0], ty = y - at[i][1];
                    if (txs_parity(tx, ty) != f->parity) continue;
                    int sum = TXS_MAX_RESPONSE;
                    for (int j = 0; j < n; j++)
                        sum += weight[j] * *txs_at(&the.canvas, t->band, txs_mod(tx + at[j][0], w),
                                                   txs_mod(ty + at[j][1], h));
                    assert_int_equal(f->filter[k].response[txs_response_index(f, tx, ty)], sum);
                    seen++;
                }
            }
        }
    }
    assert_true(seen > w * h);
}

static void test_responses_are_kept(void **state) {
    (void)state;
    static const int sizes[][2] = {{64, 64}, {65, 63}, {40, 97}, {71, 16}, {16, 33},
                                   {9, 9},   {5, 12},  {3, 4},   {2, 1},   {1, 1}};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        set_scene(sizes[i][0], sizes[i][1], i);
        assert_int_equal(the.sampler->filters.count, TXS_SHAPES + TXS_SHAPES / 2 - 1);
        check_responses();
        for (int sweep = 0; sweep < 5; sweep++) {
            assert_int_equal(txs_sweep(the.sampler, NULL, "test", 0, 1), TXM_OK);
            check_responses();
        }
        clear_scene();
    }
}

/* A filter's row holds, for each candidate, the potential of the response that it would make. */
static void test_rows(void **state) {
    (void)state;
    set_scene(40, 40, 3);
    txs_filters *f = &the.sampler->filters;
    const uint8_t *rows[TXS_MAX_TAPS * TXS_TOGETHER];
    for (int k = 0; k < f->count; k++) {
        uint8_t v[TXS_RESPONSES];
        for (int i = 0; i < TXS_RESPONSES; i++) v[i] = (uint8_t)(1 + 4 * i);
        txs_expand(&the.level, &the.types[f->filter[k].type], v,
                   the.sampler->tables + (size_t)f->filter[k].type * TXS_TABLE);
    }
    for (int band = 0; band < BANDS; band++) {
        for (int y = 0; y < 40; y++) {
            for (int x = 0; x < 8; x++) {
                const int own = txs_parity(x, y);
                const int taps = txs_filters_aim(f, band, x, y, 3, rows);
                assert_int_equal(taps, f->tap_count[band][own]);
                for (int k = 0; k < taps * 3; k++) {
                    const txs_tap *t = &f->tap[band][own][k / 3];
                    const int xx = x + k % 3 * TXS_GRID;
                    const int r = t->response[txs_response_index(f, xx - t->dx, y - t->dy)];
                    const txs_filter *filter = f->filter;
                    while (filter->response != t->response) filter++;
                    for (int c = 0; c < TXS_VALUES; c++) {
                        const int other = r + t->weight * (c - *txs_at(&the.canvas, band, xx, y));
                        if (other < 0 || other > 2 * TXS_MAX_RESPONSE) continue;
                        assert_int_equal(rows[k / 3 * TXS_TOGETHER + k % 3][c],
                                         1 + 4 * filter->class_of[other]);
                    }
                }
            }
        }
    }
    clear_scene();
}

/* ---- vector code against plain code ------------------------------------------------------- */

static void test_point(void **state) {
    (void)state;
    static uint8_t plane[3 * TXS_GRID * TXS_TOGETHER + TXS_GRID], table[1 << 12],
        classes[TXS_VALUES];
    txm_rng rng = txm_rng_make(4, 4);
    for (int run = 0; run < 500; run++) {
        const uint8_t *a[3 * TXS_TOGETHER] = {0}, *b[3 * TXS_TOGETHER] = {0};
        txs_end ends[3];
        const int form = run % TXS_FORMS, pixels = run % 7 ? TXS_TOGETHER : run % TXS_TOGETHER;
        for (size_t i = 0; i < sizeof plane; i++)
            plane[i] = (uint8_t)txm_rng_below(&rng, form == 4 && i >= 128 ? 9 : 32);
        for (int i = 0; i < TXS_VALUES; i++) classes[i] = (uint8_t)txm_rng_below(&rng, 9);
        for (int k = 0; k < 3; k++) {
            ends[k].o1 = (ptrdiff_t)txm_rng_below(&rng, 8);
            ends[k].o2 = 128 + (ptrdiff_t)txm_rng_below(&rng, 8);
            ends[k].o3 = (ptrdiff_t)txm_rng_below(&rng, 136);
            ends[k].table = table + 2048;
            ends[k].classes = classes;
        }
        txs_aim_plain(ends, 3, form, plane, pixels, a);
        txs_best_aim()(ends, 3, form, plane, pixels, b);
        for (int i = 0; i < 3 * TXS_TOGETHER; i++) assert_ptr_equal(a[i], b[i]);
    }
}

/* The energies of all candidates, and where they saturate. */
static void test_pick(void **state) {
    (void)state;
    static uint8_t rows[(TXS_MAX_ENDS + 2)][TXS_VALUES];
    const uint8_t *at[(TXS_MAX_ENDS + 2) * 2];
    txm_rng rng = txm_rng_make(5, 5);
    for (int run = 0; run < 2000; run++) {
        const int count = 2 * (int)txm_rng_below(&rng, TXS_MAX_ENDS / 2 + 2), apart = 1 + run % 2;
        const int kind = run % 3; /* random, all low, all high */
        int16_t single[TXS_VALUES], noise[TXS_VALUES];
        for (int v = 0; v < TXS_VALUES; v++) {
            single[v] = (int16_t)((int)txm_rng_below(&rng, 2 * TXS_NEVER) - TXS_NEVER);
            noise[v] = (int16_t)((int)txm_rng_below(&rng, 1200) - 600);
            for (int k = 0; k < count; k++)
                rows[k][v] = kind == 0   ? (uint8_t)(1 + txm_rng_below(&rng, 127))
                             : kind == 1 ? (uint8_t)(1 + txm_rng_below(&rng, 4))
                                         : (uint8_t)(127 - txm_rng_below(&rng, 4));
        }
        for (int k = 0; k < count; k++) at[k * apart] = rows[k];
        int best = 0, least = INT_MAX;
        for (int slot = 0; slot < TXS_VALUES; slot++) {
            int e = 0;
            for (int k = 0; k < count; k++) e += rows[k][txs_slot_value(slot)] - TXS_ZERO;
            e = txm_clampi(TXS_FINE * e, INT16_MIN, INT16_MAX) + single[slot] + noise[slot];
            e = txm_clampi(e, INT16_MIN, INT16_MAX);
            if (e < least) {
                least = e;
                best = slot;
            }
        }
        const int expected = txs_slot_value(best);
        assert_int_equal(txs_best_pick()(at, apart, count, single, noise), expected);
#ifdef TXS_SSE2
        assert_int_equal(txs_pick_sse2(at, apart, count, single, noise), expected);
#endif
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_responses_are_kept),
        cmocka_unit_test(test_rows),
        cmocka_unit_test(test_point),
        cmocka_unit_test(test_pick),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
