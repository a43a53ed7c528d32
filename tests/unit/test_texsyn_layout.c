/* test_texsyn_layout.c - label maps: synthesised ones are like the example's
   SPDX-License-Identifier: MIT OR Unlicense */
#include "partkit.h"

/* ---- measures of a label map --------------------------------------------------------------- */

static double share_of(const uint8_t *map, int pixels, int label) {
    int count = 0;
    for (int i = 0; i < pixels; i++) count += map[i] == label;
    return count / (double)pixels;
}

/* Pairs of neighbours with different labels, per pixel. */
static double boundary(const uint8_t *map, int width, int height) {
    int count = 0;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            const uint8_t *p = map + y * width + x;
            count += x + 1 < width && p[0] != p[1];
            count += y + 1 < height && p[0] != p[width];
        }
    }
    return count / (double)(width * height);
}

/* ---- what is alike --------------------------------------------------------------------------- */

/* Maps of another size have areas and boundaries like those of the example. */
static void check_alike(label_at *label, int labels) {
    static uint8_t example[LARGE * LARGE], made[LARGE * LARGE * 2];
    static const int sizes[2][2] = {{LARGE, LARGE}, {LARGE * 2, LARGE}};
    draw_labels(example, LARGE, LARGE, label);
    texsyn_composite *c = learn_layout(example, LARGE, LARGE, TEXSYN_FIELD_NONE);
    for (int s = 0; s < 2; s++) {
        const int width = sizes[s][0], height = sizes[s][1];
        double area = 0, border = 0;
        enum { SEEDS = 3 };
        double share[16] = {0};
        for (int seed = 0; seed < SEEDS; seed++) {
            make_layout(c, width, height, (uint64_t)seed, made);
            border += boundary(made, width, height) / SEEDS;
            for (int k = 0; k < labels; k++) share[k] += share_of(made, width * height, k) / SEEDS;
        }
        for (int k = 0; k < labels; k++) {
            area = share_of(example, LARGE * LARGE, k);
            assert_between(share[k] / area, 0.88, 1.12);
        }
        assert_between(border / boundary(example, LARGE, LARGE), 0.85, 1.15);
    }
    texsyn_composite_free(c);
}

static void test_patches(void **state) {
    (void)state;
    tk_wide();
    check_alike(patches, 2);
}

static void test_three(void **state) {
    (void)state;
    tk_wide();
    check_alike(three, 3);
}

static void test_stripes(void **state) {
    (void)state;
    tk_wide();
    check_alike(stripes, 2);
}

/* ---- fields ------------------------------------------------------------------------------------ */

/* Of the pixels of label 0 that lie in the outer third, the share in the first one. */
static double first_third(const uint8_t *map, int width, int height, int is_rows) {
    double first = 0, last = 0;
    for (int i = 0; i < width * height; i++) {
        const int at = is_rows ? i / width : i % width, side = is_rows ? height : width;
        if (map[i] != 0) continue;
        first += at < side / 3;
        last += at >= side - side / 3;
    }
    return first / (first + last + 1e-9);
}

static void test_sky(void **state) {
    (void)state;
    tk_wide();
    static uint8_t example[LARGE * LARGE], turned[LARGE * LARGE], made[LARGE * LARGE * 2];
    static const int sizes[3][2] = {{LARGE, LARGE}, {LARGE * 2, LARGE}, {60, 40}};
    draw_labels(example, LARGE, LARGE, sky);
    for (int i = 0; i < LARGE * LARGE; i++)
        turned[i] = example[i % LARGE * LARGE + i / LARGE];
    for (int is_columns = 0; is_columns < 2; is_columns++) {
        for (int is_auto = 0; is_auto < 2; is_auto++) {
            const texsyn_field field = is_auto      ? TEXSYN_FIELD_AUTO
                                       : is_columns ? TEXSYN_FIELD_COLUMNS
                                                    : TEXSYN_FIELD_ROWS;
            texsyn_composite *c = learn_layout(is_columns ? turned : example, LARGE, LARGE, field);
            for (int s = 0; s < 3; s++) {
                const int width = sizes[s][0], height = sizes[s][1];
                make_layout(c, width, height, 7, made);
                assert_true(first_third(made, width, height, !is_columns) > 0.99);
                assert_between(share_of(made, width * height, 0), 0.35, 0.58);
            }
            texsyn_composite_free(c);
        }
    }
}

/* ---- maps of all kinds -------------------------------------------------------------------------- */

static void test_odd(void **state) {
    (void)state;
    static uint8_t example[48 * 32], made[300 * 5];
    static const int sizes[4][2] = {{1, 1}, {300, 1}, {1, 300}, {37, 29}};
    for (int kind = 0; kind < 4; kind++) {
        int labels = 1;
        for (int i = 0; i < 48 * 32; i++) {
            const int x = i % 48, y = i / 48;
            const int label = kind == 0   ? 0                /* one label */
                              : kind == 1 ? (x + y) & 1      /* checks    */
                              : kind == 2 ? x / 16 + y / 16 * 3
                                          : x < 24;
            example[i] = (uint8_t)(kind == 3 && x > 40 ? 255 : label); /* unknown in part */
            if (label >= labels) labels = label + 1;
        }
        texsyn_composite *c = learn_layout(example, 48, 32, TEXSYN_FIELD_AUTO);
        assert_int_equal(texsyn_composite_label_count(c), labels);
        for (int s = 0; s < 4; s++) {
            make_layout(c, sizes[s][0], sizes[s][1], 3, made);
            for (int i = 0; i < sizes[s][0] * sizes[s][1]; i++) assert_true(made[i] < labels);
        }
        texsyn_composite_free(c);
    }
}

/* Another seed, another map; each quality works. */
static void test_seeds(void **state) {
    (void)state;
    static uint8_t example[64 * 64], made[2][64 * 64];
    draw_labels(example, 64, 64, patches);
    texsyn_composite *c = learn_layout(example, 64, 64, TEXSYN_FIELD_NONE);
    make_layout(c, 64, 64, 1, made[0]);
    make_layout(c, 64, 64, 1, made[1]);
    assert_memory_equal(made[0], made[1], 64 * 64);
    make_layout(c, 64, 64, 2, made[1]);
    assert_memory_not_equal(made[0], made[1], 64 * 64);
    for (int quality = -2; quality <= 2; quality++) {
        texsyn_composite_desc d = composite_desc(c, 40, 30);
        d.quality = quality;
        assert_int_equal(texsyn_composite_layout(&d, NULL, view_bytes(made[0], 40, 30, 1)), TXM_OK);
    }
    texsyn_composite_free(c);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_patches), cmocka_unit_test(test_three), cmocka_unit_test(test_stripes),
        cmocka_unit_test(test_sky),     cmocka_unit_test(test_odd),   cmocka_unit_test(test_seeds),
    };
    return cmocka_run_group_tests_name("texsyn_layout", tests, NULL, NULL);
}
