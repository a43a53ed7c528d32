/* test_texpatch_again.c - a part of a finished texture made again
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texpatch_again && build/tests/unit/test_texpatch_again */
#include "patchkit.h"

/* ---- a part made again ------------------------------------------------------------------ */

/* Draw after each step: outside the part nothing changes, inside all pixels are the exemplar's. */
static void run_part(texpatch_job *job, const txm_image maps[2], const txm_image *again,
                     const txm_image before[2]) {
    const int w = again->width, h = again->height;
    int steps = 0;
    for (int more = 1; more; steps++) {
        assert_int_equal(texpatch_step(job, NULL, &more), TXM_OK);
        for (int m = 0; m < 2; m++) {
            const txm_image now = drawn(job, m, &maps[m], w, h);
            for (int i = 0; i < w * h; i++) {
                const int x = i % w, y = i / w;
                if (!mask_at(again, x, y)) {
                    if (!is_pixel(&now, x, y, &before[m], x, y))
                        fail_msg("map %d: (%d, %d) outside of the part changed", m, x, y);
                    continue;
                }
                if (m == 0) continue;
                const texpatch_source s = texpatch_source_at(job, x, y);
                const int name = ((const uint16_t *)now.pixels)[i] - 1;
                assert_true(s.exemplar == 0 && name >= 0 && name < maps[1].width * maps[1].height);
                assert_true(fabsf((float)(name % maps[1].width) - s.x) <= 0.501f);
                assert_true(fabsf((float)(name / maps[1].width) - s.y) <= 0.501f);
            }
        }
    }
    assert_true(steps > 1);
    assert_int_equal(run(job), 1); /* nothing is left to do */
}

static double changed(const txm_image *a, const txm_image *b, const txm_image *mask) {
    int count = 0, all = 0;
    for (int y = 0; y < a->height; y++) {
        for (int x = 0; x < a->width; x++) {
            if (!mask_at(mask, x, y)) continue;
            all++;
            count += !is_pixel(a, x, y, b, x, y);
        }
    }
    return count / (double)all;
}

static void test_again(void **state) {
    (void)state;
    enum { W = 144, H = 120 };
    txm_image maps[2], before[2], after[4];
    maps[0] = draw_gravel(96, 96, 3, 0);
    maps[1] = draw_numbers(96, 96);
    const texpatch_exemplar e = exemplar_of(maps);
    texpatch_map labels[2];
    memset(labels, 0, sizeof labels);
    labels[0].weight = 1;
    labels[1].is_label = 1;
    texpatch_desc d = desc_of(&e, 1, 2, W, H);
    d.maps = labels;
    d.passes = 1;
    for (int tileable = 0; tileable <= 3; tileable += 3) {
        txm_image mask = new_mask(W, H, 0);
        d.tileable = tileable;
        fill_box(&mask, 40, 30, 90, 70, 255);
        if (tileable) { /* across all borders */
            fill_box(&mask, 0, 0, 30, 25, 255);
            fill_box(&mask, W - 20, 0, W, 25, 255);
            fill_box(&mask, 0, H - 20, 30, H, 255);
            fill_box(&mask, W - 20, H - 20, W, H, 255);
        }
        /* seed 1, seed 2, seed 1 on another job that has not been run yet */
        for (int k = 0; k < 3; k++) {
            texpatch_job *job = begin(&d);
            if (k < 2) {
                run(job);
                for (int m = 0; m < 2; m++) before[m] = drawn(job, m, &maps[m], W, H);
            }
            assert_int_equal(texpatch_again(job, &mask, NULL, NULL, k == 1 ? 2 : 1, NULL), TXM_OK);
            run_part(job, maps, &mask, before);
            after[k] = drawn(job, 0, &maps[0], W, H);
            assert_between("pixels changed", changed(&after[k], &before[0], &mask), 0.6, 1);
            if (k == 0) { /* the same again: another picture before, but the same result */
                assert_int_equal(texpatch_again(job, &mask, NULL, NULL, 1, NULL), TXM_OK);
                run(job);
                after[3] = drawn(job, 0, &maps[0], W, H);
                assert_true(is_same(&after[0], &after[3]));
            }
            texpatch_free(job);
        }
        assert_true(is_same(&after[0], &after[2]));
        assert_between("by another seed", changed(&after[0], &after[1], &mask), 0.1, 1);

        /* it fits: to what is around it, and to itself across the border */
        double sum[3] = {0, 0, 0}, count[3] = {0, 0, 0};
        for (int y = 0; y < H; y++) {
            for (int x = 0; x < W; x++) {
                for (int k = 0; k < 2; k++) {
                    const int u = k ? x : (x + 1) % W, v = k ? (y + 1) % H : y;
                    const int a = mask_at(&mask, x, y) != 0, b = mask_at(&mask, u, v) != 0;
                    const int kind = u < x || v < y ? 2 : a != b;
                    if (kind == 2 && !(a && b)) continue;
                    sum[kind] += step(&after[0], x, y, u, v);
                    count[kind]++;
                }
            }
        }
        assert_between("step to the part", sum[1] / count[1] / (sum[0] / count[0]), 0.6, 1.4);
        if (tileable)
            assert_between("across the border", sum[2] / count[2] / (sum[0] / count[0]), 0.5, 1.5);
    }

    /* an empty part; two parts without steps in between are two parts */
    const txm_image nothing = new_mask(W, H, 0), one = new_mask(W, H, 0), two = new_mask(W, H, 0);
    int more = 1;
    d.tileable = 0;
    fill_box(&one, 0, 0, 30, 30, 255);
    fill_box(&two, 20, 20, 50, 40, 255);
    texpatch_job *job = begin(&d);
    run(job);
    before[0] = drawn(job, 0, &maps[0], W, H);
    assert_int_equal(texpatch_again(job, &nothing, NULL, NULL, 5, NULL), TXM_OK);
    assert_int_equal(texpatch_step(job, NULL, &more), TXM_OK);
    assert_int_equal(more, 0);
    after[0] = drawn(job, 0, &maps[0], W, H);
    assert_true(is_same(&before[0], &after[0]));
    for (int k = 0; k < 2; k++) {
        if (k) job = begin(&d);
        assert_int_equal(texpatch_again(job, &one, NULL, NULL, 5, NULL), TXM_OK);
        if (!k) run(job);
        assert_int_equal(texpatch_again(job, &two, NULL, NULL, 6, NULL), TXM_OK);
        run(job);
        after[k] = drawn(job, 0, &maps[0], W, H);
        texpatch_free(job);
    }
    assert_true(is_same(&after[0], &after[1]));

    /* all of it */
    const txm_image all = new_mask(W, H, 255);
    job = begin(&d);
    run(job);
    assert_int_equal(texpatch_again(job, &all, NULL, NULL, 9, NULL), TXM_OK);
    run_part(job, maps, &all, before);
    after[0] = drawn(job, 0, &maps[0], W, H);
    assert_between("pixels changed", changed(&after[0], &before[0], &all), 0.9, 1);

    /* kept pixels stay */
    texpatch_free(job);
    txm_image kept[2];
    kept[0] = before[0];
    kept[1] = new_image(W, H, 1, TXM_U16);
    d.kept = kept;
    d.keep = two;
    job = begin(&d);
    assert_int_equal(texpatch_again(job, &one, NULL, NULL, 5, NULL), TXM_OK);
    run(job);
    after[0] = drawn(job, 0, &maps[0], W, H);
    assert_true(changed(&after[0], &kept[0], &two) == 0);
    assert_int_equal(texpatch_source_at(job, 25, 25).exemplar, -1);
    assert_int_equal(texpatch_source_at(job, 10, 10).exemplar, 0);
    texpatch_free(job);
}

static void test_again_guide(void **state) {
    (void)state;
    enum { SIDE = 128, W = 44 };
    txm_image maps[2];
    texpatch_exemplar e[2];
    maps[0] = draw_gravel(W, W, 3, 0);
    maps[1] = draw_noise(W, W, 3, 50, 2, 128);
    for (int i = 0; i < 2; i++) {
        e[i] = exemplar_of(&maps[i]);
        e[i].guide = new_mask(W, W, 255 * i);
    }
    texpatch_desc d = desc_of(e, 2, 1, SIDE, SIDE);
    d.passes = 1;
    d.guide = new_mask(SIDE, SIDE, 0);
    const txm_image mask = new_mask(SIDE, SIDE, 0), guide = new_mask(SIDE, SIDE, 0);
    fill_box(&mask, 24, 30, 100, 96, 255);
    fill_box(&guide, 30, 36, 94, 90, 255);
    texpatch_job *job = begin(&d);
    run(job);
    const txm_image before = drawn(job, 0, &maps[0], SIDE, SIDE);
    for (int k = 0; k < 3; k++) {
        /* a new guide; unchanged; the first again. The caller's picture is not read later */
        const txm_image mine = new_mask(SIDE, SIDE, 0);
        if (k == 0) memcpy(mine.pixels, guide.pixels, SIDE * SIDE);
        assert_int_equal(texpatch_again(job, &mask, k == 1 ? NULL : &mine, NULL, 3, NULL), TXM_OK);
        memset(mine.pixels, 100, SIDE * SIDE);
        run(job);
        const txm_image out = drawn(job, 0, &maps[0], SIDE, SIDE);
        int good = 0, count = 0;
        for (int i = 0; i < SIDE * SIDE; i++) {
            const int x = i % SIDE, y = i / SIDE;
            if (!mask_at(&mask, x, y)) assert_true(is_pixel(&out, x, y, &before, x, y));
            if (x < 38 || x >= 86 || y < 44 || y >= 82) continue;
            count++;
            good += texpatch_source_at(job, x, y).exemplar == (k < 2);
        }
        assert_between("of the new material", good / (double)count, 0.97, 1);
    }
    texpatch_free(job);
}

/* ---- all tests -------------------------------------------------------------------------- */

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(test_again, release_all),
        cmocka_unit_test_teardown(test_again_guide, release_all),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
