/* test_texpatch_half.c - levels of detail
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texpatch_half && build/tests/unit/test_texpatch_half */
#include "patchkit.h"

/* ---- levels of detail ------------------------------------------------------------------- */

static double decode(double v) {
    return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}
static double encode(double v) {
    return v <= 0.0031308 ? v * 12.92 : 1.055 * pow(v, 1 / 2.4) - 0.055;
}

static void test_half(void **state) {
    (void)state;
    static const int sizes[6][2] = {{1, 1}, {7, 5}, {8, 6}, {1, 9}, {10, 1}, {31, 17}};
    enum { COLOUR, DATA, LABEL, NORMAL, KINDS };
    for (int i = 0; i < 6 * 3 * 4 * KINDS; i++) {
        const int *size = sizes[i % 6], channels = i / 18 % 4 + 1, kind = i / 72;
        const txm_sample sample = (txm_sample)(i / 6 % 3);
        const int w = (size[0] + 1) / 2, h = (size[1] + 1) / 2;
        if (kind == NORMAL && channels < 3) continue;
        txm_image from = new_image(size[0], size[1], channels, sample);
        texpatch_map map;
        memset(&map, 0, sizeof map);
        map.is_data = kind == DATA;
        map.is_label = kind == LABEL;
        map.is_normal = kind == NORMAL ? 1 + i % 2 : 0;
        for (int p = 0; p < size[0] * size[1]; p++) {
            float v[4];
            for (int c = 0; c < 4; c++) v[c] = (float)at_random(p, c, i) / 255;
            if (kind == NORMAL) {
                const txm_vec3 n = txm_vec3_normalize(txm_v3(v[0] - 0.5f, v[1] - 0.5f, v[2]));
                v[0] = 0.5f + 0.5f * n.x;
                v[1] = 0.5f + 0.5f * n.y;
                v[2] = 0.5f + 0.5f * n.z;
            }
            for (int c = 0; c < channels; c++) /* floats may lie beyond 0..1 */
                txm_image_set(&from, p % size[0], p / size[0], c,
                              sample == TXM_F32 && kind != NORMAL ? 3 * v[c] - 1 : v[c]);
        }
        if (i % 4 == 1) from = flipped(&from);
        const txm_image half = new_image(w, h, channels, sample);
        assert_int_equal(texpatch_half(&from, kind == COLOUR && i % 2 ? NULL : &map, NULL, &half),
                         TXM_OK);
        const double unit = sample == TXM_U8 ? 255 : sample == TXM_U16 ? 65535 : 1e6;
        for (int p = 0; p < w * h; p++) {
            const int x = p % w, y = p / w;
            double mean[4] = {0, 0, 0, 0}, length = 0;
            int n = 0, is_one = 0;
            for (int v = 2 * y; v < 2 * y + 2 && v < size[1]; v++) {
                for (int u = 2 * x; u < 2 * x + 2 && u < size[0]; u++, n++) {
                    is_one |= is_pixel(&half, x, y, &from, u, v);
                    for (int c = 0; c < channels; c++) {
                        const int is_alpha = channels % 2 == 0 && c == channels - 1;
                        const double g = (double)txm_image_get(&from, u, v, c);
                        const int is_coded = kind == COLOUR && sample != TXM_F32 && !is_alpha;
                        mean[c] += is_coded ? decode(g) : g;
                    }
                }
            }
            if (kind == LABEL) {
                assert_true(is_one);
                continue;
            }
            for (int c = 0; c < channels; c++) mean[c] /= n;
            for (int c = 0; c < 3 && kind == NORMAL; c++)
                length += (2 * mean[c] - 1) * (2 * mean[c] - 1);
            for (int c = 0; c < channels; c++) {
                const int is_alpha = channels % 2 == 0 && c == channels - 1;
                const double got = (double)txm_image_get(&half, x, y, c);
                if (kind == NORMAL && c < 3) mean[c] = 0.5 + 0.5 * (2 * mean[c] - 1) / sqrt(length);
                if (kind == COLOUR && sample != TXM_F32 && !is_alpha) mean[c] = encode(mean[c]);
                if (!(fabs(got - mean[c]) * unit <= 0.6 + (sample == TXM_F32 ? 1 : 0)))
                    fail_msg("case %d, (%d, %d) %d: %.8g, not %.8g", i, x, y, c, got, mean[c]);
            }
        }
        if (kind == NORMAL && sample != TXM_F32) check_lengths(&half);
    }

    /* normals that cancel each other out */
    txm_image flat = new_image(2, 1, 3, TXM_F32), one = new_image(1, 1, 3, TXM_F32);
    static const float opposed[6] = {1, 0.5f, 0.5f, 0, 0.5f, 0.5f}, up[3] = {0.5f, 0.5f, 1};
    texpatch_map map;
    memset(&map, 0, sizeof map);
    map.is_normal = 1;
    memcpy(flat.pixels, opposed, sizeof opposed);
    assert_int_equal(texpatch_half(&flat, &map, NULL, &one), TXM_OK);
    assert_memory_equal(one.pixels, up, sizeof up);

    /* refused */
    txm_image odd = new_image(5, 5, 3, TXM_U8), good = new_image(3, 3, 3, TXM_U8), bad[5];
    for (int k = 0; k < 5; k++) bad[k] = good;
    bad[0].width = 2;
    bad[1].height = 2;
    bad[2].channels = 1;
    bad[3] = new_image(3, 3, 3, TXM_U16);
    bad[4].pixels = NULL;
    for (int k = 0; k < 5; k++) {
        txm_env env = {0};
        assert_int_equal(texpatch_half(&odd, NULL, &env, &bad[k]), TXM_BAD_ARGUMENT);
        assert_true(env.message[0] != 0);
    }
    assert_int_equal(texpatch_half(NULL, NULL, NULL, &good), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_half(&odd, NULL, NULL, NULL), TXM_BAD_ARGUMENT);
    odd.channels = good.channels = 1;
    assert_int_equal(texpatch_half(&odd, &map, NULL, &good), TXM_BAD_ARGUMENT);
    odd.width = 1 << 15;
    odd.height = 1 << 15;
    assert_int_equal(texpatch_half(&odd, NULL, NULL, &good), TXM_TOO_LARGE);
    assert_true(is_filled(&good) && is_filled(&bad[3]));
}

/* ---- all tests -------------------------------------------------------------------------- */

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(test_half, release_all),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
