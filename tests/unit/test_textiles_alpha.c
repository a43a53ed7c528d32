/* test_textiles_alpha.c - exemplars with transparent pixels, whose colour nobody knows
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_textiles_alpha && build/tests/unit/test_textiles_alpha */
#include "textiles.h"

#include "tilekit.h"

enum { SIDE = 100, TILE = 32, LOW = 70, HIGH = 150 };

/* Leaves with soft rims; what is under the transparent ground depends on `hidden`. */
static txm_image draw_leaves(int channels, txm_sample sample, int hidden) {
    const txm_image im = new_image(SIDE, SIDE, channels, sample);
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            const float alpha = txm_clampf((float)(draw_blobs(x, y, 3) - 110) / 40, 0, 1);
            const int shows = alpha * 255 >= 0.5f;
            for (int c = 0; c < channels - 1; c++) {
                const int tone = LOW + 20 * c + at_random(x / 2, y / 2, c) / 8;
                const int junk = hidden == 2 ? at_random(x, y, 77 + c) : hidden ? 0 : 255;
                txm_image_set(&im, x, y, c, (float)(shows ? tone : junk) / 255);
            }
            txm_image_set(&im, x, y, channels - 1, shows ? alpha : 0);
        }
    }
    return im;
}

static textiles_set *make_set(const txm_image *maps, int count, textiles_kind kind,
                              unsigned data_maps) {
    const textiles_exemplar exemplar = {maps, count};
    textiles_desc desc;
    textiles_set *set = NULL;
    memset(&desc, 0, sizeof desc);
    desc.exemplars = &exemplar;
    desc.exemplar_count = 1;
    desc.kind = kind;
    desc.size = TILE;
    desc.reduced = 1;
    desc.data_maps = data_maps;
    assert_int_equal(textiles_make(&desc, NULL, &set), TXM_OK);
    return set;
}

static txm_image draw_set(const textiles_set *set, int map, int channels, txm_sample sample,
                          textiles_layout *layout) {
    assert_int_equal(textiles_layout_make(set, TEXTILES_PACKED, 4, NULL, layout), TXM_OK);
    const txm_image atlas = new_image(layout->width, layout->height, channels, sample);
    assert_int_equal(textiles_draw_atlas(set, layout, map, NULL, atlas), TXM_OK);
    return atlas;
}

/* What shows lies in LOW..HIGH, give or take what repair changes; so does what is hidden. */
static void check_colours(const txm_image *im) {
    int count = 0;
    for (int y = 0; y < im->height; y++) {
        for (int x = 0; x < im->width; x++) {
            for (int c = 0; c < im->channels - 1; c++)
                assert_between(255 * (double)txm_image_get(im, x, y, c), LOW - 25, HIGH + 25);
            count += txm_image_get(im, x, y, im->channels - 1) > 0;
        }
    }
    assert_between((double)count / im->width / im->height, 0.2, 0.95);
}

static size_t bytes_of(const txm_image *im) {
    return (size_t)im->width * (size_t)im->height * (size_t)im->channels *
           txm_sample_bytes(im->sample);
}

static void test_hidden(void **state) {
    (void)state;
    static const struct {
        textiles_kind kind;
        int channels;
        txm_sample sample;
    } cases[3] = {{TEXTILES_WANG, 4, TXM_U8},
                  {TEXTILES_TRIANGLE, 4, TXM_U16},
                  {TEXTILES_TRIANGLE, 2, TXM_F32}};
    for (int i = 0; i < 3; i++) {
        txm_image first = {0};
        double mean = 0;
        for (int hidden = 0; hidden < 3; hidden++) {
            const txm_image map = draw_leaves(cases[i].channels, cases[i].sample, hidden);
            textiles_set *set = make_set(&map, 1, cases[i].kind, 0);
            textiles_layout layout;
            textiles_joints joints;
            const txm_image atlas = draw_set(set, 0, map.channels, map.sample, &layout);
            assert_int_equal(textiles_measure(set, 0, NULL, &joints), TXM_OK);
            if (hidden == 0) {
                first = atlas;
                mean = joints.mean;
                check_colours(&atlas);
            } else {
                assert_memory_equal(first.pixels, atlas.pixels, bytes_of(&atlas));
                assert_true(mean == joints.mean);
                free(atlas.pixels);
            }
            textiles_set_free(set);
            free(map.pixels);
        }
        free(first.pixels);
    }
}

/* In a map that is data the last channel is no alpha, and nothing changes. */
static void test_data(void **state) {
    (void)state;
    const txm_image maps[2] = {draw_leaves(3, TXM_U8, 0), draw_leaves(4, TXM_U8, 0)};
    textiles_layout layout;
    for (unsigned data = 0; data < 4; data += 2) {
        textiles_set *set = make_set(maps, 2, TEXTILES_WANG, data);
        const txm_image atlas = draw_set(set, 1, 4, TXM_U8, &layout);
        int white = 0;
        for (int i = 0; i < atlas.width * atlas.height; i++)
            white += ((const uint8_t *)atlas.pixels)[4 * i] > HIGH + 60;
        if (data) assert_true(white > 500);
        else assert_int_equal(white, 0);
        free(atlas.pixels);
        textiles_set_free(set);
    }
    for (int m = 0; m < 2; m++) free(maps[m].pixels);
}

/* Imported tiles: their hidden colours go too, and between the pixels of an atlas colour is weighted
   by alpha, even where next to nothing shows. */
static void test_import(void **state) {
    (void)state;
    textiles_desc desc;
    textiles_set *set = NULL;
    textiles_plane plane;
    textiles_layout layout;
    static txm_image tiles[16];
    memset(&desc, 0, sizeof desc);
    desc.size = TILE;
    for (int t = 0; t < 16; t++) {
        tiles[t] = new_image(TILE, TILE, 4, TXM_U8);
        uint8_t *p = (uint8_t *)tiles[t].pixels;
        for (int i = 0; i < TILE * TILE; i++, p += 4) {
            const int shows = i / 3 % 2 && i / TILE % 5;
            p[0] = p[1] = p[2] = shows ? 100 : 255;
            p[3] = shows ? 255 : 0;
        }
    }
    assert_int_equal(textiles_import(&desc, tiles, 16, 1, NULL, &set), TXM_OK);
    const txm_image atlas = draw_set(set, 0, 4, TXM_U8, &layout);
    for (int i = 0; i < atlas.width * atlas.height; i++)
        assert_int_equal(((uint8_t *)atlas.pixels)[4 * i], 100);
    for (int i = 0; i < atlas.width * atlas.height; i++) { /* white that hardly shows */
        uint8_t *p = (uint8_t *)atlas.pixels + 4 * (size_t)i;
        if (p[3]) continue;
        p[0] = 255;
        p[3] = 1;
    }
    const txm_image out = new_image(90, 70, 4, TXM_U8);
    assert_int_equal(textiles_plane_make(set, 3, NULL, &plane), TXM_OK);
    assert_int_equal(textiles_draw_plane(&plane, &layout, &atlas, 5.3, 7.7, 0.37, NULL, out),
                     TXM_OK);
    for (int i = 0; i < 90 * 70; i++) {
        const uint8_t *p = (const uint8_t *)out.pixels + 4 * (size_t)i;
        if (p[3] >= 32) assert_true(p[0] <= 105);
    }
    textiles_set_free(set);
    free(out.pixels);
    free(atlas.pixels);
    for (int t = 0; t < 16; t++) free(tiles[t].pixels);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_hidden),
        cmocka_unit_test(test_data),
        cmocka_unit_test(test_import),
    };
    return cmocka_run_group_tests_name("textiles alpha", tests, NULL, NULL);
}
