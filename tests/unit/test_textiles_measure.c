/* test_textiles_measure.c - how well tiles join: textiles_measure against another route
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_textiles_measure && build/tests/unit/test_textiles_measure */
#include "textiles.h"

#include "tilekit.h"

/* ---- measuring by another route -------------------------------------------------------------- */

/* all pairs of neighbours inside a tile: those across the joint that it has on side k, and all that
   count as usual there */
static void tally_tile(const readback *b, int m, int t, int k, tally *joint, tally *all) {
    static const int dx[3] = {1, 0, 1}, dy[3] = {0, 1, -1};
    const int triangle = b->kind == TEXTILES_TRIANGLE;
    for (int y = 0; y < b->side; y++) {
        for (int x = 0; x < b->side; x++) {
            for (int d = 0; d < 3; d++) {
                const int u = x + dx[d], v = y + dy[d];
                if (triangle ? 0 : d != (k & 1 ? 0 : 1)) continue;
                if (u >= b->side || v >= b->side || v < 0) continue;
                if (!is_inside(b, x, y) || !is_inside(b, u, v)) continue;
                const double step = step_of(b, m, place_of(b, t, x, y), place_of(b, t, u, v));
                all->sum += step;
                all->count++;
                if (triangle && row_from(b, k, x, y) + row_from(b, k, u, v) == 1) {
                    joint->sum += step;
                    joint->count++;
                }
            }
        }
    }
}

static textiles_joints measure_again(const readback *b, int m) {
    textiles_joints j = {0, 0, 1e300, 0, 0};
    const int triangle = b->kind == TEXTILES_TRIANGLE, sides = triangle ? 3 : 4;
    tally(*joint)[4] = (tally(*)[4])need((size_t)b->count * sizeof *joint);
    tally(*all)[4] = (tally(*)[4])need((size_t)b->count * sizeof *all);
    double steps = 0, usual = 0;
    memset(joint, 0, (size_t)b->count * sizeof *joint);
    memset(all, 0, (size_t)b->count * sizeof *all);
    for (int t = 0; t < b->count; t++) {
        for (int k = 0; k < sides; k++) tally_tile(b, m, t, k, &joint[t][k], &all[t][k]);
    }
    for (int s = 0; s < b->count; s++) {
        for (int t = 0; t < b->count; t++) {
            for (int k = 0; k < 3; k++) {
                for (int l = 0; l < sides; l++) {
                    tally step = {0, 0};
                    if (triangle) {
                        if (b->tiles[s].edges[k] != b->tiles[t].edges[l] ||
                            b->tiles[s].directions[k] + b->tiles[t].directions[l] != 0)
                            continue;
                        step.sum = joint[s][k].sum + joint[t][l].sum;
                        step.count = joint[s][k].count + joint[t][l].count;
                    } else { /* east to west, south to north */
                        if (k == 0 || l != (k + 2) % 4 || side_key(b, s, k) != side_key(b, t, l))
                            continue;
                        for (int a = 0; a < b->size; a++)
                            step.sum += step_of(b, m, side_place(b, s, k, a, 0),
                                                side_place(b, t, l, a, 0));
                        step.count = b->size;
                    }
                    const double inside = (mean_of(all[s][k]) + mean_of(all[t][l])) / 2;
                    const double ratio = mean_of(step) / inside;
                    j.mean += ratio;
                    j.worst = fmax(j.worst, ratio);
                    j.least = fmin(j.least, ratio);
                    steps += mean_of(step);
                    usual += inside;
                    j.pairs++;
                }
            }
        }
    }
    free(joint);
    free(all);
    j.mean /= j.pairs;
    j.overall = steps / usual;
    return j;
}

static void check_measure(const readback *b, int m) {
    const textiles_joints j = measure(b->set, m), again = measure_again(b, m);
    assert_int_equal(j.pairs, again.pairs);
    assert_near(j.mean, again.mean, 1e-9 * again.mean);
    assert_near(j.worst, again.worst, 1e-9 * again.worst);
    assert_near(j.least, again.least, 1e-9 * again.least);
    assert_near(j.overall, again.overall, 1e-9 * again.overall);
}

/* ---- tiles cut out of a picture ------------------------------------------------------------- */

static void copy_from(const txm_image *from, int x, int y, txm_image *to) {
    const size_t pixel = (size_t)from->channels * txm_sample_bytes(from->sample);
    for (int j = 0; j < to->height; j++) {
        for (int i = 0; i < to->width; i++)
            memcpy((char *)txm_image_row(to, j) + (size_t)i * pixel,
                   (const char *)txm_image_row_const(from, (y + j) % from->height) +
                       (size_t)((x + i) % from->width) * pixel, pixel);
    }
}

static void cut_anywhere(int tile, int side, const txm_image *from, txm_image *to) {
    copy_from(from, at_random(tile, side, 50) * (from->width - side) / 256,
              at_random(tile, side, 51) * (from->height - side) / 256, to);
}

static void cut_the_same(int tile, int side, const txm_image *from, txm_image *to) {
    (void)tile;
    (void)side;
    copy_from(from, 0, 0, to);
}

static void cut_flat(int tile, int side, const txm_image *from, txm_image *to) {
    (void)from;
    memset(to->pixels, tile ? 90 : 70, (size_t)side * (size_t)side);
}

/* ---- tests: measuring --------------------------------------------------------------------------- */

static void test_measure_agrees(void **state) {
    (void)state;
    for (int k = 0; k < KINDS; k++) {
        for (int m = 0; m < 3; m++) {
            check_measure(&common[k][1], m);
            if (k > 1) check_measure(&common[k][0], m);
        }
    }
}

static void check_guarantee(const textiles_set *set) {
    const textiles_joints j = measure(set, 0);
    assert_between(j.mean, 0.9, 1.1);
    assert_between(j.worst, j.mean, 1.35);
    assert_between(j.overall, 0.9, 1.1);
    assert_between(j.least, 0.6, j.mean);
}

/* The promise of the header: joints are as rough as the texture is elsewhere. */
static void test_guarantee(void **state) {
    (void)state;
    for (int k = 0; k < KINDS; k++) {
        if (k != TEXTILES_TRIANGLE) check_guarantee(common_sets[k][1]);
    }
    for (int k = 0; k < KINDS; k++) { /* of triangles, large ones keep it */
        const int triangle = k == TEXTILES_TRIANGLE, n = triangle ? 192 : 144;
        txm_image map = draw(k == TEXTILES_WANG ? STRIPES : CELLS, n, n, triangle ? 1 : 3, 64);
        const textiles_exemplar exemplar = {&map, 1};
        textiles_desc d = desc_of((textiles_kind)k, &exemplar, 1, n / 3);
        d.reduced = k == TEXTILES_WANG || triangle;
        textiles_set *set = make(&d);
        check_guarantee(set);
        textiles_set_free(set);
        free(map.pixels);
    }
}

/* Tiles that do not match are told apart. */
static void test_measure_controls(void **state) {
    (void)state;
    static const int counts[KINDS] = {16, 16, 24, 2};
    const txm_image periodic = draw(BLOBS, SIZE, SIZE, 3, 64);
    for (int k = 0; k < KINDS; k++) {
        textiles_desc d = desc_of((textiles_kind)k, NULL, 0, SIZE);
        textiles_joints j, good = measure(common_sets[k][1], 0);

        textiles_set *set = import_cut(&d, counts[k], &common_maps[0], cut_anywhere);
        readback b = read_back(set, 0);
        if (k != TEXTILES_TRIANGLE) check_measure(&b, 0);
        j = measure(set, 0);
        if (!(j.mean > 1.5 && j.mean > 1.4 * good.mean && j.worst > 1.8))
            fail_msg("kind %d: tiles cut anywhere seem to match: mean %.3f, worst %.3f; of a made set "
                     "%.3f, %.3f", k, j.mean, j.worst, good.mean, good.worst);
        free_readback(&b);
        textiles_set_free(set);

        /* one tile for all, whose sides belong together but for the step from last to first */
        set = import_cut(&d, counts[k], &periodic, cut_the_same);
        b = read_back(set, 0);
        if (k != TEXTILES_TRIANGLE) check_measure(&b, 0);
        free_readback(&b);
        textiles_set_free(set);

        const txm_image none = view(NULL, 0, 0, 1, TXM_U8);
        set = import_cut(&d, counts[k], &none, cut_gray);
        j = measure(set, 0);
        assert_true(j.mean == 1 && j.worst == 1 && j.least == 1 && j.overall == 1 && j.pairs > 0);
        textiles_set_free(set);
        if (k == TEXTILES_TRIANGLE) continue;
        set = import_cut(&d, counts[k], &none, cut_flat);
        j = measure(set, 0);
        assert_true(j.worst > 1e6 && j.least == 1);
        textiles_set_free(set);
    }
    free(periodic.pixels);
}

static void test_measure_refuses(void **state) {
    (void)state;
    const textiles_set *set = common_sets[TEXTILES_TRIANGLE][0];
    for (int i = 0; i < 6; i++) {
        tk_memory memory = {0};
        memory.fail_at = i == 5;
        txm_env env = tk_env(&memory, NULL);
        textiles_joints j, before;
        memset(&j, 0x5c, sizeof j);
        before = j;
        const txm_status status =
            textiles_measure(i == 0 ? NULL : set, i == 2 ? -1 : i == 3 ? 3 : i == 4 ? INT_MAX : 0, &env,
                             i == 1 ? NULL : &j);
        assert_int_equal(status, i == 5 ? TXM_OUT_OF_MEMORY : TXM_BAD_ARGUMENT);
        assert_true(env.message[0] != 0);
        assert_memory_equal(&j, &before, sizeof j);
        assert_int_equal(tk_leaks(&memory), 0);
    }
    textiles_joints j;
    tk_memory memory = {0};
    txm_env env = tk_env(&memory, NULL);
    assert_int_equal(textiles_measure(set, 2, &env, &j), TXM_OK);
    assert_int_equal(tk_leaks(&memory), 0);
    assert_int_equal(textiles_measure(set, 2, NULL, &j), TXM_OK);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_measure_agrees),
        cmocka_unit_test(test_guarantee),
        cmocka_unit_test(test_measure_controls),
        cmocka_unit_test(test_measure_refuses),
    };
    return cmocka_run_group_tests_name("textiles_measure", tests, make_common, free_common);
}
