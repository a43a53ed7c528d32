/* test_texpatch_alpha.c - pictures with transparent pixels, whose colour nobody knows
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texpatch_alpha && build/tests/unit/test_texpatch_alpha */
#define TEXPATCH_IMPLEMENTATION
#include "patchkit.h"

enum { SIDE = 72, OUT = 64, LOW = 60, HIGH = 140 };

/* Leaves of colours LOW..HIGH with soft rims on a transparent ground; or, with period, slats of a
   fence that far apart. What the ground hides depends on `hidden`: 0 white, 1 black, 2 noise. */
static txm_image draw_cutout(int side, int channels, int period, int hidden) {
    const txm_image im = new_image(side, side, channels, TXM_U8);
    uint8_t *to = (uint8_t *)im.pixels;
    for (int y = 0; y < side; y++) {
        for (int x = 0; x < side; x++) {
            const double leaf = period ? 3.5 - fmin(abs(x % period - 4), abs(y % period - 4))
                                       : 26 * (smooth(x, y, 9, 5) - 0.42);
            const int alpha = (int)(255 * (double)txm_clampf((float)leaf, 0, 1));
            for (int c = 0; c < channels - 1; c++) {
                const int tone = LOW + 20 * c + at_random(x / 2, y / 2, c) / 8;
                const int junk = hidden == 2 ? at_random(x, y, 77 + c) : hidden ? 0 : 255;
                *to++ = (uint8_t)(alpha ? tone : junk);
            }
            *to++ = (uint8_t)alpha;
        }
    }
    return im;
}

/* What shows lies in LOW..HIGH, give or take what tones change; so does what is hidden. */
static void check_colours(const txm_image *im) {
    int count = 0;
    for (int y = 0; y < im->height; y++) {
        for (int x = 0; x < im->width; x++) {
            for (int c = 0; c < im->channels - 1; c++) {
                const double v = 255 * (double)txm_image_get(im, x, y, c);
                if (v < LOW - 16 || v > HIGH + 16) fail_msg("%g at (%d, %d)", v, x, y);
            }
            count += txm_image_get(im, x, y, im->channels - 1) > 0;
        }
    }
    assert_between("share that shows", (double)count / im->width / im->height, 0.2, 0.9);
}

typedef struct variant {
    int channels, period, tileable, turns, mirror;
    txm_sample sample;
} variant;

static const variant variants[] = {{4, 0, 0, 1, 0, TXM_U8},
                                   {4, 0, 3, 4, 1, TXM_U16},
                                   {2, 0, 1, 2, 0, TXM_F32},
                                   {4, 18, 3, 1, 0, TXM_U8},
                                   {2, 17, 2, 1, 0, TXM_U16}};

static txm_image make_variant(const variant *v, int hidden) {
    txm_image drawn = draw_cutout(SIDE, v->channels, v->period, hidden);
    txm_image maps[1] = {converted(&drawn, v->sample, 1, 0)};
    const texpatch_exemplar exemplar = {maps, {0}, {0}};
    texpatch_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.exemplars = &exemplar;
    desc.exemplar_count = desc.map_count = 1;
    desc.width = desc.height = OUT;
    desc.tileable = v->tileable;
    desc.turns = v->turns;
    desc.mirror = v->mirror;
    desc.passes = 1;
    const txm_image out = new_image(OUT, OUT, v->channels, v->sample);
    assert_int_equal(texpatch_make(&desc, NULL, &out), TXM_OK);
    return out;
}

static void test_hidden(void **state) {
    (void)state;
    for (size_t i = 0; i < sizeof variants / sizeof variants[0]; i++) {
        const txm_image first = make_variant(&variants[i], 0);
        check_colours(&first);
        for (int hidden = 1; hidden < 3; hidden++) {
            const txm_image other = make_variant(&variants[i], hidden);
            assert_true(is_same(&first, &other));
        }
    }
}

/* Guides, labels and kept pictures hide colours as well; step by step, parts again, and a plane. */
static void make_all(int hidden, txm_image out[5]) {
    txm_image maps[2] = {draw_cutout(SIDE, 4, 0, hidden), draw_cutout(SIDE, 4, 0, hidden)};
    txm_image kept[2] = {draw_cutout(OUT, 4, 0, hidden), draw_cutout(OUT, 4, 0, hidden)};
    const texpatch_exemplar exemplar = {maps, draw_cutout(SIDE, 2, 0, hidden), {0}};
    texpatch_map kinds[2];
    texpatch_desc desc;
    texpatch_job *job;
    texpatch_plane *plane;
    memset(kinds, 0, sizeof kinds);
    kinds[0].weight = 1;
    kinds[1].weight = 0.5f;
    kinds[1].is_label = 1;
    memset(&desc, 0, sizeof desc);
    desc.exemplars = &exemplar;
    desc.exemplar_count = 1;
    desc.map_count = 2;
    desc.maps = kinds;
    desc.width = desc.height = OUT;
    desc.passes = 1;
    desc.guide = draw_cutout(OUT, 2, 20, hidden);
    desc.kept = kept;
    desc.keep = new_mask(OUT, OUT, 0);
    fill_box(&desc.keep, 20, 20, 40, 40, 255);
    for (int k = 0; k < 5; k++) out[k] = new_image(OUT, OUT, 4, TXM_U8);
    assert_int_equal(texpatch_begin(&desc, NULL, &job), TXM_OK);
    const txm_image again = new_mask(OUT, OUT, 0), guide = draw_cutout(OUT, 2, 24, hidden);
    fill_box(&again, 4, 30, 30, 60, 1);
    for (int more = 1; more;) assert_int_equal(texpatch_step(job, NULL, &more), TXM_OK);
    assert_int_equal(texpatch_again(job, &again, &guide, NULL, 7, NULL), TXM_OK);
    for (int more = 1; more;) assert_int_equal(texpatch_step(job, NULL, &more), TXM_OK);
    for (int m = 0; m < 2; m++) assert_int_equal(texpatch_draw(job, m, 0, 0, NULL, out[m]), TXM_OK);
    texpatch_free(job);
    assert_int_equal(texpatch_plane_make(&desc, NULL, &plane), TXM_OK);
    assert_int_equal(texpatch_plane_draw(plane, -9, 50, NULL, out + 2, NULL), TXM_OK);
    texpatch_plane_free(plane);
    assert_int_equal(
        texpatch_make(&desc, NULL, (txm_image[2]){out[4], new_image(OUT, OUT, 4, TXM_U8)}), TXM_OK);
}

static void test_hidden_everywhere(void **state) {
    (void)state;
    tk_wide();
    txm_image out[3][5];
    for (int hidden = 0; hidden < 3; hidden++) {
        make_all(hidden, out[hidden]);
        for (int k = 0; k < 5; k++) assert_true(is_same(&out[0][k], &out[hidden][k]));
    }
    check_colours(&out[0][0]);
    check_colours(&out[0][2]);
    check_colours(&out[0][4]);
    for (int k = 1; k < 4;
         k += 2) { /* labels: whole pixels of the exemplar, 0 where nothing shows */
        const uint8_t *p = (const uint8_t *)out[0][k].pixels;
        for (int i = 0; i < OUT * OUT; i++, p += 4) {
            if (!p[3]) assert_true(p[0] == 0 && p[1] == 0 && p[2] == 0);
            else assert_true(p[0] >= LOW && p[0] <= LOW + 31);
        }
    }
}

/* Windows of a plane agree in what is hidden, too, and it continues what shows in the plane. */
static void test_plane_windows(void **state) {
    (void)state;
    const txm_image cutout = draw_cutout(SIDE, 4, 0, 2);
    const texpatch_exemplar exemplar = exemplar_of(&cutout);
    const texpatch_desc desc = desc_of(&exemplar, 1, 1, 0, 0);
    const txm_image a = new_image(70, 60, 4, TXM_U8), b = new_image(50, 64, 4, TXM_U8);
    texpatch_plane *plane;
    assert_int_equal(texpatch_plane_make(&desc, NULL, &plane), TXM_OK);
    assert_int_equal(texpatch_plane_draw(plane, -40, 90, NULL, &a, NULL), TXM_OK);
    assert_int_equal(texpatch_plane_draw(plane, -20, 100, NULL, &b, NULL), TXM_OK);
    texpatch_plane_free(plane);
    check_colours(&a);
    double apart[2] = {0, 0}; /* between neighbours: of visible ones, and where visible ones end */
    int count[2] = {0, 0};
    for (int y = 0; y < 50; y++) {
        for (int x = 0; x < 50; x++) {
            assert_true(is_pixel(&a, x + 20, y + 10, &b, x, y));
            if (!x || !(txm_image_get(&b, x - 1, y, 3) > 0)) continue;
            /* hidden pixels are as visible ones beside them, but for the grain */
            const int is_hidden = !(txm_image_get(&b, x, y, 3) > 0);
            apart[is_hidden] += 255 * fabs((double)txm_image_get(&b, x, y, 0) -
                                           (double)txm_image_get(&b, x - 1, y, 0));
            count[is_hidden]++;
        }
    }
    assert_true(count[0] > 100 && count[1] > 10);
    const double grain = apart[0] / count[0];
    assert_between("colours apart where visible ones end", apart[1] / count[1], 0, 1.5 * grain);
}

/* A pixel that hardly shows hardly counts when pieces are compared. */
static void test_faint(void **state) {
    (void)state;
    uint8_t pixels[8] = {0, 255, 90, 1, 255, 3, 180, 1}, bytes[2][4];
    const txm_image im = view(pixels, 2, 1, 4, TXM_U8);
    for (int x = 0; x < 2; x++)
        assert_int_equal(txp_feature(&im, x, 0, 1, 0, 1, 0, 1, 1, bytes[x]), 4);
    for (int c = 0; c < 4; c++) assert_true(abs(bytes[0][c] - bytes[1][c]) <= 1);
    assert_int_equal(txp_feature(&im, 0, 0, 1, 0, 0, 0, 1, 1, bytes[0]), 4); /* as data */
    assert_memory_equal(bytes[0], pixels, 4);
}

/* Data are no alpha: what is 0 in the last channel hides nothing. */
static void test_data(void **state) {
    (void)state;
    const txm_image maps[1] = {draw_cutout(SIDE, 4, 0, 2)};
    const texpatch_exemplar exemplar = {maps, {0}, {0}};
    const texpatch_map kind = {1, 0, 0, 1};
    texpatch_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.exemplars = &exemplar;
    desc.exemplar_count = desc.map_count = 1;
    desc.maps = &kind;
    desc.width = desc.height = OUT;
    desc.passes = -1;
    const txm_image out = new_image(OUT, OUT, 4, TXM_U8);
    assert_int_equal(texpatch_make(&desc, NULL, &out), TXM_OK);
    int high = 0;
    for (int i = 0; i < OUT * OUT; i++) high += ((const uint8_t *)out.pixels)[4 * i] > HIGH + 60;
    assert_true(high > 100);
}

/* Bent samples between a leaf and white: never white, and never darker than the leaf. */
static void test_samples(void **state) {
    (void)state;
    static float pixels[8 * 8 * 4];
    const txm_image im = view(pixels, 8, 8, 4, TXM_F32);
    for (int round = 0; round < 200; round++) {
        for (int i = 0; i < 64; i++) {
            const int shows = at_random(i, round, 1) < 120;
            pixels[4 * i + 3] = shows ? (float)at_random(i, round, 2) / 255 : 0;
            for (int c = 0; c < 3; c++) pixels[4 * i + c] = shows ? 0.25f + 0.01f * (float)c : 1;
        }
        for (int k = 0; k < 50; k++) {
            float v[4];
            const double x = 1 + 5 * at_random(k, round, 3) / 255.0;
            const double y = 1 + 5 * at_random(k, round, 4) / 255.0;
            txp_sample(&im, x, y, 0, 1, v);
            for (int c = 0; c < 3 && v[3] > 0; c++)
                assert_true(fabsf(v[c] - 0.25f - 0.01f * (float)c) < 1e-6f);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(test_hidden, release_all),
        cmocka_unit_test_teardown(test_hidden_everywhere, release_all),
        cmocka_unit_test_teardown(test_plane_windows, release_all),
        cmocka_unit_test_teardown(test_faint, release_all),
        cmocka_unit_test_teardown(test_data, release_all),
        cmocka_unit_test_teardown(test_samples, release_all),
    };
    return cmocka_run_group_tests_name("texpatch alpha", tests, NULL, NULL);
}
