/* test_texpatch_given.c - what is given beforehand: guides, kept pixels, exemplars, masks
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texpatch_given && build/tests/unit/test_texpatch_given */
#include "patchkit.h"

/* ---- guide, keep, several exemplars, masks ---------------------------------------------- */

static void test_guide(void **state) {
    (void)state;
    enum { SIDE = 120, W = 44, H = 40 };
    txm_image maps[2];
    texpatch_exemplar e[2];
    maps[0] = draw_gravel(W, H, 3, 0);
    maps[1] = draw_noise(W, H, 3, 50, 2, 128);
    for (int i = 0; i < 2; i++) {
        e[i] = exemplar_of(&maps[i]);
        e[i].guide = new_mask(W, H, 255 * i);
    }
    texpatch_desc d = desc_of(e, 2, 1, SIDE, SIDE);
    d.passes = 1;
    d.guide = new_mask(SIDE, SIDE, 0);
    for (int which = 0; which < 2; which++) { /* halves, then a disk */
        int good = 0, far_away = 0;
        uint8_t *g = (uint8_t *)d.guide.pixels;
        for (int i = 0; i < SIDE * SIDE; i++) {
            const double dx = i % SIDE - 60, dy = i / SIDE - 60;
            g[i] = (which ? dx * dx + dy * dy < 40 * 40 : i % SIDE >= 60) ? 255 : 0;
        }
        texpatch_job *job = begin(&d);
        run(job);
        for (int i = 0; i < SIDE * SIDE; i++) {
            const double dx = i % SIDE - 60, dy = i / SIDE - 60;
            const double off = which ? sqrt(dx * dx + dy * dy) - 40 : dx + 0.5;
            if (fabs(off) <= 8) continue;
            far_away++;
            good += texpatch_source_at(job, i % SIDE, i / SIDE).exemplar == (g[i] ? 1 : 0);
        }
        assert_between("of the right material", good / (double)far_away, 0.97, 1);
        texpatch_free(job);
    }

    /* where the mask is 0 the guide does not matter */
    d.width = d.height = 64;
    d.guide_mask = new_mask(64, 64, 0);
    txm_image out[2];
    for (int k = 0; k < 2; k++) {
        d.guide = new_mask(64, 64, 255 * k);
        out[k] = made(&d, NULL);
    }
    assert_true(is_same(&out[0], &out[1]));

    /* half of it: only this half has to follow the guide */
    fill_box(&d.guide_mask, 0, 0, 32, 64, 255);
    for (int k = 0; k < 2; k++) {
        d.guide = new_mask(64, 64, 255 * k);
        texpatch_job *job = begin(&d);
        int good = 0;
        run(job);
        for (int i = 0; i < 64 * 24; i++)
            good += texpatch_source_at(job, i % 24, i / 24).exemplar == k;
        assert_between("of the right material", good / (64.0 * 24), 0.97, 1);
        texpatch_free(job);
    }
}

static void test_keep(void **state) {
    (void)state;
    enum { SIDE = 112 };
    txm_image maps[2], kept[2];
    maps[0] = draw_gravel(128, 128, 3, 0);
    maps[1] = draw_numbers(128, 128);
    const texpatch_exemplar e = exemplar_of(maps);
    texpatch_map labels[2];
    memset(labels, 0, sizeof labels);
    labels[0].weight = 1;
    labels[1].is_label = 1;
    texpatch_desc d = desc_of(&e, 1, 2, SIDE, SIDE);
    d.maps = labels;
    kept[0] = new_image(SIDE, SIDE, 3, TXM_U8);  /* of the exemplar, so that something can fit */
    kept[1] = new_image(SIDE, SIDE, 1, TXM_U16); /* values that the exemplar does not have */
    for (int i = 0; i < SIDE * SIDE; i++)
        memcpy((uint8_t *)kept[0].pixels + 3 * i,
               (uint8_t *)maps[0].pixels + 3 * ((i / SIDE + 9) * 128 + i % SIDE + 9), 3);
    d.kept = kept;
    d.keep = new_mask(SIDE, SIDE, 0);
    for (int i = 0; i < SIDE * SIDE; i++) {
        const int dx = i % SIDE - 60, dy = i / SIDE - 50;
        const int is_in = dx * dx + dy * dy < 30 * 30 || i % SIDE < 3;
        ((uint8_t *)d.keep.pixels)[i] = is_in ? 255 : 0;
    }
    for (int which = 0; which < 2; which++) {
        d.passes = which ? -1 : 0;
        d.tileable = which ? 3 : 0;
        texpatch_job *job = begin(&d);
        int more = 1;
        while (more) { /* kept pixels are there from the first step to the last */
            assert_int_equal(texpatch_step(job, NULL, &more), TXM_OK);
            for (int m = 0; m < 2; m++) {
                const txm_image out = drawn(job, m, &maps[m], SIDE, SIDE);
                for (int i = 0; i < SIDE * SIDE; i++) {
                    const int x = i % SIDE, y = i / SIDE;
                    const texpatch_source s = texpatch_source_at(job, x, y);
                    if (mask_at(&d.keep, x, y)) {
                        /* coarse levels round the border of the kept area to their pixels */
                        if (!more) assert_int_equal(s.exemplar, -1);
                        if (!more || s.exemplar < 0)
                            assert_true(is_pixel(&out, x, y, &kept[m], x, y));
                    } else if (!more) {
                        assert_int_equal(s.exemplar, 0);
                    }
                }
            }
        }
        const txm_image out = drawn(job, 0, &maps[0], SIDE, SIDE);
        double sum[2] = {0, 0}, count[2] = {0, 0};
        for (int y = 0; y + 1 < SIDE; y++) {
            for (int x = 0; x + 1 < SIDE; x++) {
                for (int k = 0; k < 2; k++) {
                    const int u = x + !k, v = y + k;
                    const int a = mask_at(&d.keep, x, y) != 0, b = mask_at(&d.keep, u, v) != 0;
                    sum[a != b] += step(&out, x, y, u, v);
                    count[a != b]++;
                }
            }
        }
        assert_between("step to what is kept", sum[1] / count[1] / (sum[0] / count[0]), 0.5,
                       which ? 2.5 : 2);
        texpatch_free(job);
    }

    /* everything is kept; nothing is */
    d.tileable = 0;
    memset(d.keep.pixels, 255, SIDE * SIDE);
    txm_image out = made(&d, NULL);
    assert_true(is_same(&out, &kept[0]));
    memset(d.keep.pixels, 0, SIDE * SIDE);
    out = made(&d, NULL);
    d.kept = NULL;
    const txm_image free_one = made(&d, NULL);
    assert_true(is_same(&out, &free_one));
}

static void test_exemplars(void **state) {
    (void)state;
    tk_wide();
    enum { SIDE = 128 };
    txm_image maps[3];
    texpatch_exemplar e[3];
    for (int i = 0; i < 3; i++) {
        maps[i] = draw_gravel(40 + 8 * i, 64 - 8 * i, 3, 30 * i);
        e[i] = exemplar_of(&maps[i]);
    }
    texpatch_desc d = desc_of(e, 3, 1, SIDE, SIDE);
    d.passes = 1;
    texpatch_job *job = begin(&d);
    int of[3] = {0, 0, 0};
    run_but_one(job, &d);
    check_places(job, &d, 0);
    for (int i = 0; i < SIDE * SIDE; i++)
        of[texpatch_source_at(job, i % SIDE, i / SIDE).exemplar]++;
    for (int i = 0; i < 3; i++)
        assert_between("share of an exemplar", of[i] / (double)(SIDE * SIDE), 0.1, 0.6);
    texpatch_free(job);
}

static void test_masks(void **state) {
    (void)state;
    txm_image maps[2];
    texpatch_exemplar e[2];
    for (int big = 0; big < 2; big++) {
        const int w = big ? 112 : 56, h = big ? 96 : 40;
        for (int i = 0; i < 2; i++) {
            maps[i] = draw_gravel(w, h, 3, 30 * i);
            e[i] = exemplar_of(&maps[i]);
            e[i].mask = new_mask(w, h, 255);
        }
        fill_box(&e[0].mask, w / 4, 0, w / 4 + 3, h, 0);
        fill_box(&e[0].mask, w / 2, h / 2, w, h / 2 + 5, 0);
        fill_box(&e[1].mask, 0, 0, w, 2, 0);
        e[1].mask = flipped(&e[1].mask);
        texpatch_desc d = desc_of(e, 2, 1, 120, 96);
        d.passes = 1;
        d.turns = 2;
        texpatch_job *job = begin(&d);
        int more = 1, bent = 0, used[2] = {0, 0};
        while (more) {
            assert_int_equal(texpatch_step(job, NULL, &more), TXM_OK);
            for (int i = 0; i < 120 * 96; i++) {
                const texpatch_source s = texpatch_source_at(job, i % 120, i / 120);
                const txm_image *mask = &e[s.exemplar].mask;
                used[s.exemplar]++;
                if (more) {
                    assert_true(mask_at(mask, (int)s.x, (int)s.y));
                    continue;
                }
                for (int k = 0; k < 4; k++) { /* nothing of what is masked, however it is bent */
                    const int x = (int)(k % 2 ? ceilf(s.x) : floorf(s.x));
                    const int y = (int)(k / 2 ? ceilf(s.y) : floorf(s.y));
                    if (!mask_at(mask, x, y))
                        fail_msg("(%g, %g) of %d is masked", s.x, s.y, s.exemplar);
                }
                bent += s.x != floorf(s.x) || s.y != floorf(s.y);
            }
        }
        assert_true(used[0] > 0 && used[1] > 0);
        show("bent", bent / (120.0 * 96));
        assert_true(bent > 120 * 96 / 50);
        texpatch_free(job);

        /* one is masked completely: all comes from the other */
        memset(e[0].mask.pixels, 0, (size_t)(w * h));
        job = begin(&d);
        run(job);
        for (int i = 0; i < 120 * 96; i++)
            assert_int_equal(texpatch_source_at(job, i % 120, i / 120).exemplar, 1);
        texpatch_free(job);
        e[1].mask = e[0].mask;
        txm_env env = {0};
        const txm_image out = new_image(120, 96, 3, TXM_U8);
        assert_int_equal(texpatch_make(&d, &env, &out), TXM_TOO_SMALL);
        assert_true(env.message[0] != 0 && is_filled(&out));
    }
}

/* ---- all tests -------------------------------------------------------------------------- */

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(test_guide, release_all),
        cmocka_unit_test_teardown(test_keep, release_all),
        cmocka_unit_test_teardown(test_exemplars, release_all),
        cmocka_unit_test_teardown(test_masks, release_all),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
