/* test_texpatch_plane.c - the unbounded plane: windows that agree, statistics, failing memory
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texpatch_plane && build/tests/unit/test_texpatch_plane */
#include "patchkit.h"

/* ---- the plane -------------------------------------------------------------------------- */

static texpatch_plane *plane_of(const texpatch_desc *desc) {
    txm_env env = {0};
    texpatch_plane *plane = NULL;
    const txm_status status = texpatch_plane_make(desc, &env, &plane);
    if (status != TXM_OK) fail_msg("plane: %d, %s", status, env.message);
    assert_true(texpatch_plane_cell(plane) > 0);
    return plane;
}

static void test_plane_windows(void **state) {
    (void)state;
    tk_wide();
    enum { COUNT = 20 };
    const int windows[5] = {2, 3, tk_full() ? COUNT : 8, 3, 3};
    txm_image maps[2];
    maps[0] = draw_noise(32, 34, 1, 0, 1, 128);
    maps[1] = draw_numbers(32, 34);
    const texpatch_exemplar e = exemplar_of(maps);
    texpatch_map labels[2];
    memset(labels, 0, sizeof labels);
    labels[0].weight = 1;
    labels[1].is_label = 1;
    texpatch_desc d = desc_of(&e, 1, 2, 0, 0); /* the size is ignored */
    d.maps = labels;
    d.passes = -1;
    d.patch = 20; /* large ones are fast */
    texpatch_plane *plane = plane_of(&d), *twin = plane_of(&d);
    const int cell = texpatch_plane_cell(plane);
    const int64_t far_away = (int64_t)1 << 40;
    const int64_t middle[5][2] = {{0, 0},
                                  {-far_away + 190, far_away - 90},
                                  {3 * cell + 18, -7 * cell + 60},
                                  {far_away - 30, -far_away + 70},
                                  {-1234567890123 / 2, 77}};
    txm_rng rng = txm_rng_make(11, 0);
    int pairs = 0;
    for (int c = 0; c < 5; c++) {
        int64_t at[COUNT][2];
        txm_image out[COUNT][2];
        texpatch_source *sources[COUNT];
        for (int k = 0; k < windows[c]; k++) { /* all of them hold the middle */
            int size[2];
            for (int a = 0; a < 2; a++) {
                const int before = txm_rng_range(&rng, 0, 30), behind = txm_rng_range(&rng, 0, 30);
                at[k][a] = middle[c][a] - (k ? before : 0);
                size[a] = k ? before + behind + 1 : 1;
            }
            out[k][0] = new_image(size[0], size[1], 1, TXM_U8);
            out[k][1] = new_image(size[0], size[1], 1, TXM_U16);
            sources[k] = (texpatch_source *)need((size_t)(size[0] * size[1]) * sizeof **sources);
            txm_env env = {0};
            if (k % 3 == 1) env.parallel_for = tk_parallel_reverse;
            const txm_status status = texpatch_plane_draw(k % 2 ? plane : twin, at[k][0], at[k][1],
                                                          &env, out[k], k % 4 ? sources[k] : NULL);
            if (status != TXM_OK) fail_msg("window: %d, %s", status, env.message);
            for (int i = 0; i < size[0] * size[1] && k % 4; i++) {
                const texpatch_source s = sources[k][i];
                const int name = ((const uint16_t *)out[k][1].pixels)[i] - 1;
                assert_true(s.exemplar == 0 && name >= 0 && name < 32 * 34);
                assert_true(fabsf((float)(name % 32) - s.x) <= 0.501f);
                assert_true(fabsf((float)(name / 32) - s.y) <= 0.501f);
            }
        }
        for (int a = 0; a < windows[c]; a++) {
            for (int b = 0; b < a; b++, pairs++) {
                for (int i = 0; i < out[a][0].width * out[a][0].height; i++) {
                    const int x = i % out[a][0].width, y = i / out[a][0].width;
                    const int64_t u = at[a][0] + x - at[b][0], v = at[a][1] + y - at[b][1];
                    if (u < 0 || v < 0 || u >= out[b][0].width || v >= out[b][0].height) continue;
                    for (int m = 0; m < 2; m++) {
                        if (!is_pixel(&out[a][m], x, y, &out[b][m], (int)u, (int)v))
                            fail_msg("place %d: windows %d and %d differ at (%d, %d)", c, a, b, x,
                                     y);
                    }
                    if (a % 4 && b % 4)
                        assert_memory_equal(&sources[a][i], &sources[b][v * out[b][0].width + u],
                                            sizeof **sources);
                }
            }
        }
    }
    assert_true(pairs >= (tk_full() ? 200 : 38));

    /* the limits of x and y */
    const txm_image out[2] = {new_image(4, 4, 1, TXM_U8), new_image(4, 4, 1, TXM_U16)};
    for (int i = 0; i < 4; i++) {
        txm_env env = {0};
        const int64_t x = i == 0 ? far_away + 1 : i == 1 ? -far_away - 1 : 0;
        const int64_t y = i == 2 ? far_away + 1 : i == 3 ? -far_away - 1 : 0;
        assert_int_equal(texpatch_plane_draw(plane, x, y, &env, out, NULL), TXM_BAD_ARGUMENT);
        assert_true(env.message[0] != 0 && is_filled(&out[0]) && is_filled(&out[1]));
    }
    assert_int_equal(texpatch_plane_draw(plane, far_away, -far_away, NULL, out, NULL), TXM_OK);
    assert_int_equal(texpatch_plane_draw(NULL, 0, 0, NULL, out, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_plane_draw(plane, 0, 0, NULL, NULL, NULL), TXM_BAD_ARGUMENT);
    const txm_image uneven[2] = {new_image(4, 4, 1, TXM_U8), new_image(4, 5, 1, TXM_U16)};
    assert_int_equal(texpatch_plane_draw(plane, 0, 0, NULL, uneven, NULL), TXM_BAD_ARGUMENT);
    const txm_image format[2] = {new_image(4, 4, 1, TXM_U8), new_image(4, 4, 1, TXM_U8)};
    assert_int_equal(texpatch_plane_draw(plane, 0, 0, NULL, format, NULL), TXM_BAD_ARGUMENT);
    assert_true(is_filled(&uneven[0]) && is_filled(&format[0]));
    texpatch_plane_free(plane);
    texpatch_plane_free(twin);
    texpatch_plane_free(NULL);
    assert_int_equal(texpatch_plane_cell(NULL), 0);
}

/* It looks like its exemplar, seams of the cells included, and does not repeat. */
static void test_plane_looks(void **state) {
    (void)state;
    for (int which = 0; which < 2; which++) {
        const txm_image from =
            which ? draw_bricks(64, 64, 16, 10) : draw_noise(48, 48, 3, 0, 3, 120);
        const texpatch_exemplar e = exemplar_of(&from);
        texpatch_desc d = desc_of(&e, 1, 1, 0, 0);
        d.passes = 1;
        texpatch_plane *plane = plane_of(&d);
        /* around a corner of four cells; what lies within half of it is made beforehand */
        const int cell = texpatch_plane_cell(plane), side = 96, half = cell / 16, far_side = 40;
        const txm_image out = new_image(side, side, 3, TXM_U8);
        const txm_image far_off = new_image(far_side, far_side, 3, TXM_U8);
        const int64_t x = (int64_t)5 * cell - side / 2, y = (int64_t)-3 * cell - side / 2;
        assert_int_equal(texpatch_plane_draw(plane, x, y, NULL, &out, NULL), TXM_OK);
        assert_int_equal(texpatch_plane_draw(plane, x - 4 * cell, y, NULL, &far_off, NULL), TXM_OK);
        for (int c = 0; c < 3; c++)
            assert_between("mean colour", mean_of(&out, c) - mean_of(&from, c), -0.03, 0.03);
        double sum[5] = {0}, count[5] = {0}, own[2] = {0, 0}, n[2] = {0, 0};
        int same = 0;
        for (int k = 0; k < 2; k++) {
            add_steps(&from, k, own, n);
            for (int i = 0; i < side * side; i++) {
                const int u = i % side + !k, v = i / side + k, at = k ? v : u;
                if (u >= side || v >= side) continue;
                /* 1: between two cells side by side, 2: one below the other, 3: along what is made
                   before their insides, 4: around what is made first, at the corner */
                const int from_corner = abs((k ? u : v) - side / 2);
                const int joint = at == side / 2               ? 1 + k
                                  : abs(at - side / 2) != half ? 0
                                  : from_corner < half         ? 4
                                                               : 3;
                sum[joint] += step(&out, i % side, i / side, u, v);
                count[joint]++;
            }
        }
        for (int i = 0; i < far_side * far_side; i++)
            same +=
                is_pixel(&out, i % far_side, i / far_side, &far_off, i % far_side, i / far_side);
        assert_between("step", (sum[0] / count[0]) / (own[0] / n[0]), 0.8, 1.2);
        for (int k = 1; k < 5 && !which; k++) /* in a wall joints of bricks may lie there */
            assert_between("step at a joint", (sum[k] / count[k]) / (sum[0] / count[0]), 0.6,
                           k == 4 ? 1.8 : 1.5);
        assert_between("the same elsewhere", same / (double)(far_side * far_side), 0, 0.2);
        texpatch_plane_free(plane);
    }
}

/* ---- failing memory, cancelling --------------------------------------------------------- */

typedef struct window {
    const texpatch_desc *desc;
    const texpatch_plane *plane;
    txm_image out;
} window;

static txm_status make_plane(void *context, txm_env *env) {
    const window *w = (const window *)context;
    texpatch_plane *plane;
    const txm_status status = texpatch_plane_make(w->desc, env, &plane);
    texpatch_plane_free(plane);
    return status;
}

static txm_status draw_window(void *context, txm_env *env) {
    const window *w = (const window *)context;
    return texpatch_plane_draw(w->plane, 30, 40, env, &w->out, NULL);
}

static void test_plane_misfortune(void **state) {
    (void)state;
    const txm_image noise = draw_noise(32, 32, 1, 0, 1, 128);
    const texpatch_exemplar e = exemplar_of(&noise);
    texpatch_desc d = desc_of(&e, 1, 1, 0, 0);
    d.passes = -1;
    tk_memory memory = {0};
    txm_env env = tk_env(&memory, NULL);
    texpatch_plane *plane;
    assert_int_equal(texpatch_plane_make(&d, &env, &plane), TXM_OK);
    window w = {&d, plane, new_image(20, 20, 1, TXM_U8)};
    const txm_image wanted = new_image(20, 20, 1, TXM_U8);
    assert_int_equal(texpatch_plane_draw(plane, 30, 40, NULL, &wanted, NULL), TXM_OK);
    const long blocks = memory.blocks;
    assert_true(tk_sweep(make_plane, &w, TK_ALLOCATION) > 3);
    for (int kind = 0; kind < 3; kind++)
        assert_true(tk_sweep(draw_window, &w, (tk_kind)kind) > 20);
    assert_int_equal(memory.blocks, blocks); /* the plane is as it was */
    assert_int_equal(draw_window(&w, NULL), TXM_OK);
    assert_true(is_same(&w.out, &wanted));
    texpatch_plane_free(plane);
    assert_int_equal(tk_leaks(&memory), 0);
}

/* ---- all tests -------------------------------------------------------------------------- */

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(test_plane_windows, release_all),
        cmocka_unit_test_teardown(test_plane_looks, release_all),
        cmocka_unit_test_teardown(test_plane_misfortune, release_all),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
