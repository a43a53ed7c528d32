/* test_treepieces_bark.c - trees: tiles of bark and their sheet
   SPDX-License-Identifier: MIT OR Unlicense                                                    */
#include "treepieces.h"

#include "growkit.h"

enum { TILES = 6, TILE = 32, SHEET = TREEPIECES_SHEET * TILE };

static void draw_tiles(txm_image *tiles, int count, const char *species, int channels,
                       txm_sample sample) {
    treepieces_species s;
    assert_int_equal(treepieces_preset(species, NULL, &s), TXM_OK);
    for (int i = 0; i < count; i++) tiles[i] = make_image(TILE, TILE, channels, sample);
    assert_int_equal(treepieces_draw_bark(&s, 3, NULL, tiles, count), TXM_OK);
}

static void free_tiles(txm_image *tiles, int count) {
    for (int i = 0; i < count; i++) free(tiles[i].pixels);
}

static txm_image make_sheet(const txm_image *tiles, int count, const int *classes, uint64_t seed) {
    treepieces_bark_desc d;
    memset(&d, 0, sizeof d);
    d.tiles = tiles;
    d.classes = classes;
    d.tile_count = count;
    d.seed = seed;
    txm_image sheet = make_image(SHEET, SHEET * treepieces_bark_layers(&d), tiles[0].channels,
                                 tiles[0].sample);
    assert_int_equal(treepieces_bark(&d, NULL, sheet), TXM_OK);
    return sheet;
}

static float at(const txm_image *image, int x, int y, int c) {
    return txm_image_get(image, x, y, c);
}

/* All tiles have the same border and different insides; the same seed gives the same tiles. */
static void test_draw_bark(void **state) {
    (void)state;
    static const char *const names[] = {"oak", "beech", "birch", "almond", "pine"}; /* all kinds */
    for (int i = 0; i < 5; i++) {
        txm_image tiles[TILES], again[TILES];
        draw_tiles(tiles, TILES, names[i], 3, TXM_U8);
        draw_tiles(again, TILES, names[i], 3, TXM_U8);
        for (int t = 0; t < TILES; t++) {
            assert_true(hash_image(&tiles[t]) == hash_image(&again[t]));
            for (int other = 0; other < t; other++)
                assert_true(hash_image(&tiles[t]) != hash_image(&tiles[other]));
            for (int k = 0; k < TILE * 3; k++) {
                const int last = TILE - 1, a = k / 3, c = k % 3;
                assert_true(at(&tiles[t], a, 0, c) == at(&tiles[0], a, 0, c));
                assert_true(at(&tiles[t], a, last, c) == at(&tiles[0], a, last, c));
                assert_true(at(&tiles[t], 0, a, c) == at(&tiles[0], 0, a, c));
                assert_true(at(&tiles[t], last, a, c) == at(&tiles[0], last, a, c));
            }
        }
        free_tiles(tiles, TILES);
        free_tiles(again, TILES);
    }
}

/* Root mean square difference between two lines of a sheet, rows or columns. */
static double line_difference(const txm_image *sheet, int a, int b, int is_column) {
    double sum = 0;
    for (int k = 0; k < SHEET; k++)
        for (int c = 0; c < 3; c++) {
            const double d = is_column ? (double)(at(sheet, a, k, c) - at(sheet, b, k, c))
                                       : (double)(at(sheet, k, a, c) - at(sheet, k, b, c));
            sum += d * d;
        }
    return sqrt(sum / (3 * SHEET));
}

/* Layer 0 repeats seamlessly: the difference across tile borders and across the sheet's border is
   no more than that between any neighbouring lines. */
static void test_bark_plain(void **state) {
    (void)state;
    txm_image tiles[TILES];
    draw_tiles(tiles, TILES, "oak", 3, TXM_F32);
    txm_image sheet = make_sheet(tiles, TILES, NULL, 1);
    assert_int_equal(sheet.height, TREEPIECES_OWN * SHEET);
    for (int is_column = 0; is_column < 2; is_column++) {
        double inside = 0, most = 0;
        for (int k = 0; k < SHEET; k++) {
            const double d = line_difference(&sheet, k, (k + 1) % SHEET, is_column);
            if (k % TILE != TILE - 1) inside = d > inside ? d : inside;
            else most = d > most ? d : most;
        }
        assert_true(most < 1.1 * inside);
    }
    long first = 0; /* every place shows one of the tiles */
    for (int cell = 0; cell < 64; cell++) {
        const int x = cell % 8 * TILE, y = cell / 8 * TILE;
        int found = -1;
        for (int t = 0; t < TILES && found < 0; t++) {
            int same = 1;
            for (int k = 0; k < TILE * TILE && same; k++)
                same = at(&sheet, x + k % TILE, y + k / TILE, 0) ==
                       at(&tiles[t], k % TILE, k / TILE, 0);
            if (same) found = t;
        }
        assert_true(found >= 0);
        first += found == 0;
    }
    assert_in_range(first, 1, 40);
    txm_image again = make_sheet(tiles, TILES, NULL, 1), other = make_sheet(tiles, TILES, NULL, 2);
    assert_true(hash_image(&again) == hash_image(&sheet));
    assert_true(hash_image(&other) != hash_image(&sheet));
    free(again.pixels);
    free(other.pixels);
    free(sheet.pixels);
    free_tiles(tiles, TILES);
}

/* The lowest row of pixels of the layers that are blended. */
static void test_bark_layers(void **state) {
    (void)state;
    txm_image tiles[TILES];
    draw_tiles(tiles, TILES, "oak", 3, TXM_F32);
    txm_image sheet = make_sheet(tiles, TILES, NULL, 4);
    const int fold = (TREEPIECES_FOLD + 1) * SHEET - 1;
    const int left = (TREEPIECES_TURN_LEFT + 1) * SHEET - 1;
    const int right = (TREEPIECES_TURN_RIGHT + 1) * SHEET - 1;
    for (int k = 0; k < 3 * SHEET; k++) {
        const int x = k / 3, c = k % 3, u = x % TILE, last = TILE - 1;
        /* two folded quads lie head to head: what one has at x the other has at the mirrored place,
           whichever cells they show, as all tiles have one frame */
        for (int cell = 0; cell < 8; cell++)
            assert_true(fabsf(at(&sheet, x, fold, c) -
                              at(&sheet, cell * TILE + last - u, fold, c)) < 1e-5f);
        /* beyond the east side of a plain quad comes the west side of any, downwards */
        assert_true(fabsf(at(&sheet, x, left, c) - at(&tiles[0], 0, u, c)) < 1e-5f);
        /* beyond its west side the east side, upwards */
        assert_true(fabsf(at(&sheet, x, right, c) - at(&tiles[0], last, last - u, c)) < 1e-5f);
    }
    for (int layer = TREEPIECES_FOLD; layer <= TREEPIECES_HALVING; layer++)
        for (int k = 0; k < 3 * SHEET; k++) { /* they join plain bark to the north */
            const int x = k / 3, c = k % 3, top = layer * SHEET + SHEET - TILE;
            assert_true(fabsf(at(&sheet, x, top, c) - at(&tiles[0], x % TILE, 0, c)) < 0.005f);
        }
    free(sheet.pixels);
    free_tiles(tiles, TILES);
}

/* A halving cell ends in two tiles of half the size. */
static void test_bark_halving(void **state) {
    (void)state;
    txm_image tile;
    draw_tiles(&tile, 1, "oak", 3, TXM_F32);
    txm_image sheet = make_sheet(&tile, 1, NULL, 4);
    const int bottom = (TREEPIECES_HALVING + 1) * SHEET - 1;
    for (int k = 0; k < 3 * SHEET; k++) {
        const int x = k / 3, c = k % 3, u = 2 * (x % TILE) % TILE;
        float sum = 0;
        for (int p = 0; p < 4; p++) sum += at(&tile, u + (p & 1), TILE - 2 + (p >> 1), c);
        assert_true(fabsf(at(&sheet, x, bottom, c) - sum / 4) < 1e-5f);
    }
    free(sheet.pixels);
    free_tiles(&tile, 1);
}

/* Classes of the caller: whole tiles in the middle of 2 x 2 cells, where quads expect them. */
static void test_bark_own(void **state) {
    (void)state;
    static const int classes[TILES] = {0, 0, 0, 5, 7, 0};
    txm_image tiles[TILES];
    draw_tiles(tiles, TILES, "oak", 4, TXM_U8);
    txm_image sheet = make_sheet(tiles, TILES, classes, 4);
    assert_int_equal(sheet.height, 8 * SHEET);
    for (int i = 0; i < 16; i++) {
        treepieces_quad quad;
        float nw[2], se[2];
        memset(&quad, 0, sizeof quad);
        quad.tile_class = i & 1 ? 7 : 5;
        const int cell = i % 4 * 2 + i / 4 * 16, t = i & 1 ? 4 : 3;
        assert_int_equal(treepieces_quad_uv(&quad, 0, cell, SHEET, 0, nw), quad.tile_class);
        assert_int_equal(treepieces_quad_uv(&quad, 0, cell, SHEET, 2, se), quad.tile_class);
        const int x = (int)(nw[0] * SHEET + 0.5f), y = (int)(nw[1] * SHEET);
        assert_true(fabsf((se[0] - nw[0]) * SHEET - TILE) < 1.01f);
        for (int row = 0; row < TILE; row++)
            assert_memory_equal(rgba(&sheet, x, quad.tile_class * SHEET + y + row),
                                rgba(&tiles[t], 0, row), 4 * TILE);
    }
    free(sheet.pixels);
    free_tiles(tiles, TILES);
}

static void test_bark_refusals(void **state) {
    (void)state;
    static const int no_plain[TILES] = {5, 5, 5, 5, 5, 5}, odd[TILES] = {0, 1, 0, 0, 0, 0};
    static const int too_high[TILES] = {0, 64, 0, 0, 0, 0};
    txm_image tiles[TILES], sheet = make_image(SHEET, 5 * SHEET, 3, TXM_U8);
    draw_tiles(tiles, TILES, "oak", 3, TXM_U8);
    const uint64_t hash = hash_image(&sheet);
    for (int kind = 0; kind < 13; kind++) {
        txm_image bad[TILES], out = sheet;
        treepieces_bark_desc d;
        txm_env env = tk_env(NULL, NULL);
        memset(&d, 0, sizeof d);
        memcpy(bad, tiles, sizeof bad);
        d.tiles = bad;
        d.tile_count = TILES;
        if (kind == 0) d.tiles = NULL;
        if (kind == 1) d.tile_count = 0;
        if (kind == 2) bad[2].pixels = NULL;
        if (kind == 3) bad[2].height--;
        if (kind == 4) bad[2].width = bad[2].height = TILE / 2;
        if (kind == 5) bad[2].channels = 1;
        if (kind == 6) d.classes = no_plain;
        if (kind == 7) d.classes = odd;
        if (kind == 8) d.classes = too_high;
        if (kind == 9) out.height -= TILE;
        if (kind == 10) out.channels = 1;
        if (kind == 11) out.pixels = NULL;
        assert_int_equal(treepieces_bark(kind == 12 ? NULL : &d, &env, out), TXM_BAD_ARGUMENT);
        assert_true(env.message[0] != 0);
        assert_true(hash_image(&sheet) == hash);
    }
    for (int kind = 0; kind < 4; kind++) {
        txm_image bad = tiles[0];
        txm_env env = tk_env(NULL, NULL);
        if (kind == 0) bad.height--;
        if (kind == 1) bad.channels = 1;
        assert_int_equal(treepieces_draw_bark(kind == 2 ? NULL : &oak, 1, &env, &bad, kind != 3),
                         TXM_BAD_ARGUMENT);
        assert_true(env.message[0] != 0);
    }
    free(sheet.pixels);
    free_tiles(tiles, TILES);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_draw_bark), cmocka_unit_test(test_bark_plain),
        cmocka_unit_test(test_bark_layers), cmocka_unit_test(test_bark_halving),
        cmocka_unit_test(test_bark_own), cmocka_unit_test(test_bark_refusals),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
