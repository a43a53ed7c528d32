/* test_texpatch_half.c - levels of detail
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texpatch_half && build/tests/unit/test_texpatch_half */
#include "patchkit.h"

/* ---- levels of detail ------------------------------------------------------------------- */

/* Each kind of map is averaged as test_texmath_level.c has it. */
static void test_half(void **state) {
    (void)state;
    static const int sizes[6][2] = {{1, 1}, {7, 5}, {8, 6}, {1, 9}, {10, 1}, {31, 17}};
    static const txm_content contents[4] = {TXM_COLOR, TXM_DATA, TXM_LABELS, TXM_NORMALS};
    for (int i = 0; i < 6 * 3 * 4 * 4; i++) {
        const int *size = sizes[i % 6], channels = i / 18 % 4 + 1, kind = i / 72;
        const txm_sample sample = (txm_sample)(i / 6 % 3);
        const int w = txm_level_side(size[0], 1), h = txm_level_side(size[1], 1);
        if (contents[kind] == TXM_NORMALS && channels < 3) continue;
        txm_image from = new_image(size[0], size[1], channels, sample);
        texpatch_map map;
        memset(&map, 0, sizeof map);
        map.is_data = contents[kind] == TXM_DATA;
        map.is_label = contents[kind] == TXM_LABELS;
        map.is_normal = contents[kind] == TXM_NORMALS ? 1 + i % 2 : 0;
        for (int p = 0; p < size[0] * size[1]; p++) {
            for (int c = 0; c < channels; c++)
                txm_image_set(&from, p % size[0], p / size[0], c, (float)at_random(p, c, i) / 255);
        }
        if (i % 4 == 1) from = flipped(&from);
        const txm_image half = new_image(w, h, channels, sample);
        const txm_image want = new_image(w, h, channels, sample);
        const texpatch_map *given = kind == 0 && i % 2 ? NULL : &map;
        assert_int_equal(texpatch_half(&from, given, i % 4, NULL, &half), TXM_OK);
        assert_int_equal(txm_image_halve(&from, contents[kind], i % 4, &want, NULL), TXM_OK);
        for (int p = 0; p < w * h; p++)
            assert_true(is_pixel(&half, p % w, p / w, &want, p % w, p / w));
    }
}

static void test_half_refused(void **state) {
    (void)state;
    txm_image odd = new_image(5, 5, 3, TXM_U8), good = new_image(2, 2, 3, TXM_U8), bad[5];
    texpatch_map map;
    memset(&map, 0, sizeof map);
    map.is_normal = 1;
    for (int k = 0; k < 5; k++) bad[k] = good;
    bad[0].width = 3;
    bad[1].height = 3;
    bad[2].channels = 1;
    bad[3] = new_image(2, 2, 3, TXM_U16);
    bad[4].pixels = NULL;
    for (int k = 0; k < 5; k++) {
        txm_env env = {0};
        assert_int_equal(texpatch_half(&odd, NULL, 0, &env, &bad[k]), TXM_BAD_ARGUMENT);
        assert_true(env.message[0] != 0);
    }
    assert_int_equal(texpatch_half(NULL, NULL, 0, NULL, &good), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_half(&odd, NULL, 0, NULL, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_half(&odd, NULL, 4, NULL, &good), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_half(&odd, NULL, -1, NULL, &good), TXM_BAD_ARGUMENT);
    odd.channels = good.channels = 1;
    assert_int_equal(texpatch_half(&odd, &map, 0, NULL, &good), TXM_BAD_ARGUMENT);
    odd.width = 1 << 15;
    odd.height = 1 << 15;
    assert_int_equal(texpatch_half(&odd, NULL, 0, NULL, &good), TXM_TOO_LARGE);
    assert_true(is_filled(&good) && is_filled(&bad[3]));
}

/* ---- all tests -------------------------------------------------------------------------- */

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(test_half, release_all),
        cmocka_unit_test_teardown(test_half_refused, release_all),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
