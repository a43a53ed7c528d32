/* test_textiles_make.c - what the tiles of a made set show
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_textiles_make && build/tests/unit/test_textiles_make */
#include "textiles.h"

#include "tilecheck.h"

/* ---- tests: what a set shows ------------------------------------------------------------------ */

static void test_borders(void **state) {
    (void)state;
    const int sizes[][2] = {{EXEMPLAR, EXEMPLAR}};
    for (int k = 0; k < KINDS; k++) {
        for (int r = 0; r < 2; r++) {
            check_sources(&common[k][r], sizes);
            check_set(&common[k][r], 1);
            check_edges_differ(&common[k][r]);
        }
    }
}

/* share of the texels away from the border that differ between two tiles, by source */
static double share_different(const readback *b, const readback *o, int s, int t) {
    int count = 0, different = 0;
    for (int y = 0; y < b->side; y++) {
        for (int x = 0; x < b->side; x++) {
            if (!is_inside(b, x + 8, y + 8) || x < 8 || y < 8 || x >= b->size - 8 || y >= b->size - 8)
                continue;
            const size_t p = place_of(b, s, x, y), q = place_of(o, t, x, y);
            different += b->sheet[p] != o->sheet[q] ||
                         memcmp(b->from[p], o->from[q], sizeof b->from[p]) != 0;
            count++;
        }
    }
    return (double)different / count;
}

static void test_insides_differ(void **state) {
    (void)state;
    for (int k = 0; k < KINDS; k++) {
        const readback *b = &common[k][0];
        double sum = 0;
        int pairs = 0;
        for (int t = 1; t < b->count; t++) {
            for (int s = 0; s < t; s++) {
                const double share = share_different(b, b, s, t);
                sum += share;
                pairs++;
                if (b->variants > 1 && s / b->variants == t / b->variants && share < 0.5)
                    fail_msg("kind %d: variants %d, %d differ in %g only", k, s, t, share);
            }
        }
        assert_between(sum / pairs, 0.8, 1);
    }
}

static void test_seeds_differ(void **state) {
    (void)state;
    static const uint64_t seeds[] = {6, 0x100000005u}; /* all 64 bits count */
    for (int i = 0; i < 3; i++) {
        const int k = i ? TEXTILES_FRAME : TEXTILES_TRIANGLE;
        const readback *b = &common[k][0]; /* of seed 5 */
        textiles_desc d = common_desc(k);
        d.repair = TEXTILES_REPAIR_NONE;
        d.seed = seeds[i / 2];
        textiles_set *set = make(&d);
        readback other = read_back(set, 4);
        double share = 0;
        int edge = 0;
        for (int t = 0; t < b->count; t++) {
            share += share_different(b, &other, t, t) / b->count;
            for (int a = 0; a < SIZE; a++) {
                const size_t p = side_place(b, t, 0, a, 0);
                edge += memcmp(b->from[p], other.from[p], sizeof b->from[p]) != 0;
            }
        }
        assert_between(share, 0.8, 1);
        assert_true(edge * 2 > b->count * SIZE);
        free_readback(&other);
        textiles_set_free(set);
    }
}

static void test_pixels_are_the_exemplars(void **state) {
    (void)state;
    for (int k = 0; k < KINDS; k++) {
        if (k != TEXTILES_TRIANGLE) check_pixels(&common[k][0], &common_exemplar);
    }
}

/* Repair changes pixels near cuts, none at the border, and makes the cuts smoother. Pieces may also
   meet where both show the same: there it changes little. */
static void test_repair(void **state) {
    (void)state;
    for (int k = 0; k < KINDS; k++) {
        const readback *b = &common[k][0], *r = &common[k][1];
        const int triangle = k == TEXTILES_TRIANGLE;
        double steps[2][3] = {{0}};
        int changed = 0, cuts = 0;
        tally change[2] = {{0, 0}, {0, 0}}; /* far from cuts, near them */
        for (int t = 0; t < b->count; t++) {
            for (int y = 0; y < b->side; y++) {
                for (int x = 0; x < b->side; x++) {
                    const size_t p = place_of(b, t, x, y);
                    if (!is_inside(b, x, y)) continue;
                    assert_true(b->sheet[p] == r->sheet[p]);
                    assert_memory_equal(b->from[p], r->from[p], sizeof b->from[p]);
                    int edge = b->size;
                    for (int s = 0; s < 3 && triangle; s++) {
                        const int row = row_from(b, s, x, y);
                        edge = row < edge ? row : edge;
                    }
                    if (!triangle) {
                        const int across = x < b->size - 1 - x ? x : b->size - 1 - x;
                        const int down = y < b->size - 1 - y ? y : b->size - 1 - y;
                        edge = across < down ? across : down;
                    }
                    int near = 0; /* do sources break within reach? */
                    for (int v = y - 7; v <= y + 6; v++) {
                        for (int u = x - 7; u <= x + 6; u++) {
                            if (u < 0 || v < 0 || u + 1 >= b->side || v + 1 >= b->side ||
                                !is_inside(b, u, v) || near)
                                continue;
                            const size_t q = place_of(b, t, u, v);
                            const size_t o[2] = {q + 1, q + (size_t)b->side};
                            for (int i = 0; i < 2; i++) {
                                if (!triangle) near |= !is_next(b, q, o[i], !i, i);
                                else near |= 1; /* turned pieces: not looked at */
                            }
                        }
                    }
                    int same = 1;
                    for (int m = 0; m < b->maps; m++)
                        same = same && memcmp(pixel(b, m, p), pixel(r, m, p), b->texel[m]) == 0;
                    changed += !same;
                    if (!same && edge < (triangle ? 1 : 2)) fail_msg("a border pixel was repaired");
                    if (edge >= 2)
                        change[near].sum += fabs(sample_of(b, 2, p, 0) - sample_of(r, 2, p, 0));
                    change[near].count += edge >= 2;
                    if (triangle || edge < 3 || is_next(b, p, p + 1, 1, 0)) continue;
                    cuts++;
                    for (int m = 0; m < 3; m++) {
                        steps[0][m] += step_of(b, m, p, p + 1);
                        steps[1][m] += step_of(r, m, p, p + 1);
                    }
                }
            }
        }
        assert_true(changed > 20);
        if (triangle) continue;
        assert_true(cuts > 20);
        assert_true(change[0].count > 100 && change[1].count > 100);
        assert_true(mean_of(change[0]) * 8 < mean_of(change[1]));
        for (int m = 0; m < 3; m++) assert_true(steps[1][m] < steps[0][m]);
    }
}

/* Maps stay in register: what is a function of the first map still is. */
static void test_register(void **state) {
    (void)state;
    for (int k = 0; k < KINDS; k++) {
        const readback *b = &common[k][0];
        int values = 0;
        assert_int_equal(b->maps, 3);
        assert_true(b->channels[0] == 3 && b->channels[1] == 4 && b->channels[2] == 1);
        for (int t = 0; t < b->count; t++) {
            for (int y = 0; y < b->side; y++) {
                for (int x = 0; x < b->side; x++) {
                    const size_t p = place_of(b, t, x, y);
                    if (!is_inside(b, x, y)) continue;
                    const uint8_t *rgb = pixel(b, 0, p), *two = pixel(b, 1, p);
                    const double third = sample_of(b, 2, p, 0);
                    values |= 1 << rgb[0] / 32;
                    if (k != TEXTILES_TRIANGLE) {
                        for (int c = 0; c < 4; c++)
                            assert_int_equal(two[c], second_map(rgb, c));
                        assert_true(third == (double)third_map(rgb));
                    } else { /* resampling is linear but for rounding and clamping */
                        for (int c = 0; c < 4; c++) assert_near(two[c], second_map(rgb, c), 1.01);
                        int clamped = 0;
                        for (int c = 0; c < 3; c++) clamped |= rgb[c] == 0 || rgb[c] == 255;
                        if (!clamped) assert_near(third, (double)third_map(rgb), 0.25 * 11 * 0.51);
                    }
                }
            }
        }
        assert_true((values & (values - 1)) != 0);
    }
}

/* Triangles of a smooth exemplar: a texel has the exemplar's value at the place it comes from. */
static double smooth(double x, double y, int c) {
    return 0.5 + 0.2 * sin(0.19 * x + 0.11 * y + c) + 0.2 * cos(0.13 * x - 0.17 * y + 2 * c);
}

static void test_triangle_values(void **state) {
    (void)state;
    const int n = 96, sizes[][2] = {{96, 96}};
    txm_image maps[3] = {new_image(n, n, 3, TXM_F32), new_image(n, n, 2, TXM_U8),
                         new_image(n, n, 1, TXM_U16)};
    for (int i = 0; i < n * n; i++) {
        ((uint16_t *)maps[2].pixels)[i] = (uint16_t)(65535 * smooth(i % n, i / n, 5) + 0.5);
        for (int c = 0; c < 3; c++)
            ((float *)maps[0].pixels)[3 * i + c] = (float)smooth(i % n, i / n, c);
        for (int c = 0; c < 2; c++)
            ((uint8_t *)maps[1].pixels)[2 * i + c] =
                (uint8_t)(255 * smooth(i % n, i / n, c + 3) + 0.5);
    }
    const textiles_exemplar exemplar = {maps, 3};
    textiles_desc d = desc_of(TEXTILES_TRIANGLE, &exemplar, 1, 33);
    d.reduced = 1;
    d.repair = TEXTILES_REPAIR_NONE;
    d.data_maps = 1 << 1;
    textiles_set *set = make(&d);
    readback b = read_back(set, 1 | 4 << 8);
    check_sources(&b, sizes);
    check_set(&b, 1);
    int turned = 0, inner = 0;
    for (int t = 0; t < b.count; t++) {
        for (int y = 0; y < b.side; y++) {
            for (int x = 0; x + y < b.side; x++) {
                const size_t p = place_of(&b, t, x, y);
                const double u = (double)b.from[p][0], v = (double)b.from[p][1];
                if (u < 3 || v < 3 || u > n - 4 || v > n - 4) continue;
                for (int c = 0; c < 3; c++)
                    assert_near(sample_of(&b, 0, p, c), smooth(u, v, c), 2e-4);
                for (int c = 0; c < 2; c++)
                    assert_near(sample_of(&b, 1, p, c), 255 * smooth(u, v, c + 3), 1.5);
                assert_near(sample_of(&b, 2, p, 0), 65535 * smooth(u, v, 5), 2e-4 * 65535);
                inner++;
                turned += x + y < b.side - 1 &&
                          fabs((double)(b.from[p + 1][0] - b.from[p][0]) - 1) > 0.1;
            }
        }
    }
    assert_true(inner > b.count * 300 && turned > b.count * 20);
    free_readback(&b);
    textiles_set_free(set);
    for (int m = 0; m < 3; m++) free(maps[m].pixels);
}

/* ---- tests: the same bytes ----------------------------------------------------------------------- */

static void test_same_bytes(void **state) {
    (void)state;
    for (int k = 1; k < KINDS; k++) { /* the common ones were made on threads */
        textiles_desc d = common_desc(k);
        d.repair = TEXTILES_REPAIR_POISSON;
        const uint64_t hash = hash_of(&common[k][1]);
        assert_true(hash != hash_of(&common[k][0]));
        if (k != TEXTILES_TRIANGLE) assert_true(hash_and_free(make_with(&d, NULL), 4) == hash);
        if (k != TEXTILES_CORNER)
            assert_true(hash_and_free(make_with(&d, tk_parallel_reverse), 4) == hash);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_borders),
        cmocka_unit_test(test_insides_differ),
        cmocka_unit_test(test_seeds_differ),
        cmocka_unit_test(test_pixels_are_the_exemplars),
        cmocka_unit_test(test_repair),
        cmocka_unit_test(test_register),
        cmocka_unit_test(test_triangle_values),
        cmocka_unit_test(test_same_bytes),
    };
    return cmocka_run_group_tests_name("textiles_make", tests, make_common, free_common);
}
