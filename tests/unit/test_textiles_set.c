/* test_textiles_set.c - which tiles a set has; sets imported from finished pictures
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_textiles_set && build/tests/unit/test_textiles_set */
#include "textiles.h"

#include "tilekit.h"

/* ---- tests: listing ------------------------------------------------------------------------- */

static textiles_set *import_plain(textiles_kind kind, int colors, int variants, int reduced,
                                  int count) {
    uint8_t one = 0;
    const txm_image from = view(&one, 1, 1, 1, TXM_U8);
    textiles_desc d = desc_of(kind, NULL, 0, 32);
    d.colors = colors;
    d.variants = variants;
    d.reduced = reduced;
    return import_cut(&d, count, &from, cut_gray);
}

static void check_find(const textiles_set *set, const int edges[4], const int directions[3],
                       int tile, int rotation) {
    int r = -7;
    assert_int_equal(textiles_find(set, edges, directions, &r), tile);
    assert_int_equal(r, tile < 0 ? -7 : rotation);
    assert_int_equal(textiles_find(set, edges, directions, NULL), tile);
}

/* Tiles of equal colours follow each other, variants in order; find gives the first. */
static void check_variants(const textiles_set *set, int variants) {
    for (int t = 0; t < textiles_count(set); t++) {
        textiles_tile tile, first;
        assert_int_equal(textiles_tile_at(set, t, &tile), 1);
        assert_int_equal(textiles_tile_at(set, t - t % variants, &first), 1);
        assert_int_equal(tile.variant, t % variants);
        assert_memory_equal(tile.edges, first.edges, sizeof tile.edges);
        assert_memory_equal(tile.directions, first.directions, sizeof tile.directions);
        check_find(set, tile.edges, tile.directions, t - t % variants, 0);
    }
}

static void test_list_squares(void **state) {
    (void)state;
    for (int colors = 2; colors <= 4; colors++) {
        for (int variants = 1; variants <= 3; variants += 2) {
            const int c4 = colors * colors * colors * colors;
            const textiles_kind kind = variants == 1 ? TEXTILES_WANG : TEXTILES_CORNER;
            textiles_set *set = import_plain(kind, colors, variants, 0, c4 * variants);
            assert_int_equal(textiles_kind_of(set), kind);
            assert_int_equal(textiles_count(set), c4 * variants);
            assert_int_equal(textiles_size(set), 32);
            assert_int_equal(textiles_colors(set), colors);
            assert_int_equal(textiles_variants(set), variants);
            assert_int_equal(textiles_map_count(set), 1);
            assert_int_equal(textiles_channels(set, 0), 1);
            assert_int_equal(textiles_channels(set, 1), 0);
            assert_int_equal(textiles_channels(set, -1), 0);
            check_variants(set, variants);
            for (int i = 0; i < c4; i++) { /* the colours read as digits */
                const int e[4] = {i / colors / colors / colors, i / colors / colors % colors,
                                  i / colors % colors, i % colors};
                check_find(set, e, NULL, i * variants, 0);
            }
            textiles_set_free(set);
        }
    }
}

static void test_list_reduced_wang(void **state) {
    (void)state;
    for (int colors = 2; colors <= 4; colors++) {
        const int variants = colors - 1, count = 2 * colors * colors * variants;
        textiles_set *set = import_plain(TEXTILES_WANG, colors, variants, 1, count);
        int pairs[TEXTILES_MAX_COLORS][TEXTILES_MAX_COLORS] = {{0}};
        assert_int_equal(textiles_count(set), count);
        check_variants(set, variants);
        for (int t = 0; t < count; t += variants) {
            textiles_tile a;
            textiles_tile_at(set, t, &a);
            pairs[a.edges[0]][a.edges[3]]++;
        }
        for (int n = 0; n < colors; n++) {
            int found = 0;
            for (int w = 0; w < colors; w++) assert_int_equal(pairs[n][w], 2);
            for (int i = 0; i < colors * colors * colors; i++) {
                const int e[4] = {n, i / colors / colors, i / colors % colors, i % colors};
                found += textiles_find(set, e, NULL, NULL) >= 0;
            }
            assert_int_equal(found, 2 * colors); /* all others are not there */
        }
        textiles_set_free(set);
    }
}

static void test_list_triangles(void **state) {
    (void)state;
    for (int colors = 2; colors <= 4; colors++) {
        for (int reduced = 0; reduced < 2; reduced++) {
            const int variants = 1 + (colors == 2), s = 2 * colors;
            const int count = (reduced ? 2 * colors * colors * colors : (s * s * s + 4 * colors) / 3);
            textiles_set *set =
                import_plain(TEXTILES_TRIANGLE, colors, variants, reduced, count * variants);
            int seen = 0;
            check_variants(set, variants);
            for (int i = 0; i < s * s * s; i++) {
                const int symbol[3] = {i / s / s, i / s % s, i % s};
                int e[4] = {0, 0, 0, 0}, d[3], r = -1, sum = 0;
                for (int k = 0; k < 3; k++) {
                    e[k] = symbol[k] / 2;
                    d[k] = symbol[k] % 2 ? -1 : 1;
                    sum += d[k];
                }
                const int t = textiles_find(set, e, d, &r);
                if (reduced && abs(sum) == 3) {
                    assert_int_equal(t, -1);
                    continue;
                }
                assert_true(t >= 0 && t < count * variants && t % variants == 0);
                assert_true(r >= 0 && r < 3);
                textiles_tile tile;
                assert_int_equal(textiles_tile_at(set, t, &tile), 1);
                for (int k = 0; k < 3; k++) {
                    assert_int_equal(tile.edges[(k + r) % 3], e[k]);
                    assert_int_equal(tile.directions[(k + r) % 3], d[k]);
                }
                seen++;
            }
            /* all, or all but a quarter: those that run one way round */
            assert_int_equal(seen, reduced ? s * s * s * 3 / 4 : s * s * s);
            textiles_set_free(set);
        }
    }
}

static void test_list_frames(void **state) {
    (void)state;
    for (int colors = 1; colors <= 4; colors++) {
        textiles_set *set = import_plain(TEXTILES_FRAME, colors, 2, 0, colors * 2);
        check_variants(set, 2);
        for (int k = 0; k < colors; k++) {
            const int e[4] = {0, k, 0, k}, other[4] = {k, 0, 0, 0};
            check_find(set, e, NULL, 2 * k, 0);
            check_find(set, other, NULL, k ? -1 : 0, 0);
        }
        textiles_set_free(set);
    }
    const readback *b = &common[TEXTILES_FRAME][0];
    assert_int_equal(b->count, 15);
    check_variants(b->set, 3);
    for (int k = 0; k < 5; k++) check_find(b->set, common_classes[k], NULL, 3 * k, 0);
}

static void test_find_refuses(void **state) {
    (void)state;
    for (int k = 0; k < KINDS; k++) {
        const textiles_set *set = common_sets[k][0];
        int good[4] = {0, 0, 0, 0}, d[3] = {1, 1, 1};
        textiles_tile tile, before;
        memset(&tile, 0x33, sizeof tile);
        before = tile;
        assert_true(textiles_find(set, good, d, NULL) >= 0);
        for (int i = 0; i < (k == TEXTILES_TRIANGLE ? 3 : 4); i++) {
            static const int bad[] = {-1, 4, 3, INT_MAX, INT_MIN / 2, 1 << 30};
            for (size_t j = 0; j < sizeof bad / sizeof *bad; j++) {
                int e[4] = {0, 0, 0, 0};
                e[i] = bad[j];
                check_find(set, e, d, -1, 0);
            }
        }
        assert_int_equal(textiles_find(set, NULL, d, NULL), -1);
        assert_int_equal(textiles_find(set, good, NULL, NULL), k == TEXTILES_TRIANGLE ? -1 : 0);
        assert_int_equal(textiles_tile_at(set, -1, &tile), 0);
        assert_int_equal(textiles_tile_at(set, textiles_count(set), &tile), 0);
        assert_int_equal(textiles_tile_at(set, INT_MIN, &tile), 0);
        assert_memory_equal(&tile, &before, sizeof tile);

        float from[2] = {0, 0};
        const int side = common[k][0].side, bad[][3] = {
            {-1, 0, 0}, {textiles_count(set), 0, 0}, {0, -1, 0}, {0, 0, -1}, {0, side, 0},
            {0, 0, side}, {INT_MAX, INT_MAX, INT_MAX}, {INT_MIN, INT_MIN, INT_MIN}};
        for (size_t j = 0; j < sizeof bad / sizeof *bad; j++)
            assert_int_equal(textiles_source(set, bad[j][0], bad[j][1], bad[j][2], from), -1);
        assert_int_equal(textiles_source(set, 0, 0, 0, from), 0);
    }
}

/* ---- tests: importing ------------------------------------------------------------------------------- */

static void test_import_round_trip(void **state) {
    (void)state;
    static const int counts[KINDS] = {16, 32, 24, 3};
    for (int k = 0; k < KINDS; k++) {
        const int n = 35, side = n + (k == TEXTILES_TRIANGLE), count = counts[k];
        const size_t texels = (size_t)side * (size_t)side, row = (size_t)side * 2 + 3;
        uint8_t *bytes = (uint8_t *)need((size_t)count * texels * 3);
        uint16_t *words = (uint16_t *)need((size_t)count * texels * sizeof *words);
        float *floats = (float *)need((size_t)count * row * (size_t)side * sizeof *floats);
        txm_image *tiles = (txm_image *)need((size_t)count * 3 * sizeof *tiles);
        txm_rng rng = txm_rng_make(9, (uint64_t)k);
        for (size_t i = 0; i < (size_t)count * texels * 3; i++) bytes[i] = (uint8_t)txm_rng_next(&rng);
        for (size_t i = 0; i < (size_t)count * row * (size_t)side; i++)
            floats[i] = txm_rng_float(&rng) * 1e6f - 5e5f;
        for (size_t i = 0; i < (size_t)count * texels; i++) words[i] = (uint16_t)txm_rng_next(&rng);
        for (int t = 0; t < count; t++) { /* the second map bottom-up, rows apart */
            tiles[3 * t] = view(bytes + (size_t)t * texels * 3, side, side, 3, TXM_U8);
            tiles[3 * t + 1] = view(floats + ((size_t)t * (size_t)side + (size_t)side - 1) * row, side,
                                    side, 2, TXM_F32);
            tiles[3 * t + 1].stride = -(ptrdiff_t)(row * sizeof(float));
            tiles[3 * t + 2] = view(words + (size_t)t * texels, side, side, 1, TXM_U16);
        }
        textiles_desc d = desc_of((textiles_kind)k, NULL, 77, n);
        d.variants = k == TEXTILES_CORNER ? 2 : 0;
        d.data_maps = 1 << 1; /* its second channel hides nothing */
        if (k == TEXTILES_FRAME) d.colors = 3;
        textiles_set *set = NULL;
        tk_memory memory = {0};
        txm_env env = tk_env(&memory, NULL);
        assert_int_equal(textiles_import(&d, tiles, count, 3, &env, &set), TXM_OK);
        memset(&env, 0xff, sizeof env); /* need not outlive the call */
        readback b = read_back(set, 2 | 4 << 8);
        assert_int_equal(b.maps, 3);
        assert_int_equal(b.channels[0], 3);
        assert_int_equal(b.channels[1], 2);
        for (int t = 0; t < count; t++) {
            for (int y = 0; y < side; y++) {
                for (int x = 0; x < side; x++) {
                    const size_t p = place_of(&b, t, x, y);
                    assert_int_equal(b.sheet[p], -1);
                    if (!is_inside(&b, x, y)) continue;
                    for (int m = 0; m < 3; m++) {
                        const char *from = (const char *)txm_image_row_const(&tiles[3 * t + m], y);
                        assert_memory_equal(pixel(&b, m, p), from + (size_t)x * b.texel[m], b.texel[m]);
                    }
                }
            }
        }
        free_readback(&b);
        textiles_set_free(set);
        assert_int_equal(tk_leaks(&memory), 0);
        free(bytes);
        free(words);
        free(floats);
        free(tiles);
    }
    textiles_set_free(NULL);
}

/* Beyond a triangle's third side anything may lie. */
static void test_import_beyond_triangles(void **state) {
    (void)state;
    enum { S = 33 };
    static float pixels[24][S * S];
    txm_image tiles[24];
    textiles_set *set = NULL;
    txm_env env = {0};
    for (int t = 0; t < 24; t++) {
        tiles[t] = view(pixels[t], S, S, 1, TXM_F32);
        for (int i = 0; i < S * S; i++)
            pixels[t][i] = i % S + i / S < S ? (float)(t + i) : (float)NAN;
    }
    const textiles_desc d = desc_of(TEXTILES_TRIANGLE, NULL, 0, S - 1);
    const txm_status status = textiles_import(&d, tiles, 24, 1, &env, &set);
    if (status != TXM_OK) fail_msg("what lies beyond is looked at: %d, %s", status, env.message);
    textiles_set_free(set);
}

static void refuses_import(const textiles_desc *d, const txm_image *tiles, int count, int maps,
                           txm_status expected, const char *what) {
    tk_memory memory = {0};
    txm_env env = tk_env(&memory, NULL);
    textiles_set *set = (textiles_set *)&memory;
    const txm_status status = textiles_import(d, tiles, count, maps, &env, &set);
    if (status != expected) fail_msg("%s: status %d, not %d", what, status, expected);
    if (set) fail_msg("%s: *out is not NULL", what);
    if (!env.message[0]) fail_msg("%s: no message", what);
    assert_int_equal(tk_leaks(&memory), 0);
}

/* 16 tiles of one map */
typedef struct import_job {
    const textiles_desc *desc;
    const txm_image *tiles;
} import_job;

static txm_status try_import(void *context, txm_env *env) {
    const import_job *job = (const import_job *)context;
    textiles_set *set = (textiles_set *)env;
    const txm_status status = textiles_import(job->desc, job->tiles, 16, 1, env, &set);
    if (status == TXM_OK) assert_non_null(set);
    else assert_null(set);
    textiles_set_free(set);
    return status;
}

static void test_import_refuses(void **state) {
    (void)state;
    static float pixels[128 * 32];
    txm_image tiles[32];
    textiles_desc d = desc_of(TEXTILES_WANG, NULL, 0, 32);
    txm_env env = {0};
    for (int t = 0; t < 32; t++) tiles[t] = view(pixels, 32, 32, 1, TXM_F32);
    assert_int_equal(textiles_import(&d, tiles, 16, 1, &env, NULL), TXM_BAD_ARGUMENT);
    assert_true(env.message[0] != 0);
    refuses_import(NULL, tiles, 16, 1, TXM_BAD_ARGUMENT, "desc NULL");
    refuses_import(&d, NULL, 16, 1, TXM_BAD_ARGUMENT, "tiles NULL");
    refuses_import(&d, tiles, 15, 1, TXM_BAD_ARGUMENT, "15 tiles");
    refuses_import(&d, tiles, 17, 1, TXM_BAD_ARGUMENT, "17 tiles");
    refuses_import(&d, tiles, 32, 1, TXM_BAD_ARGUMENT, "32 tiles");
    refuses_import(&d, tiles, 0, 1, TXM_BAD_ARGUMENT, "no tiles");
    refuses_import(&d, tiles, -16, 1, TXM_BAD_ARGUMENT, "-16 tiles");
    refuses_import(&d, tiles, 16, 0, TXM_BAD_ARGUMENT, "no maps");
    refuses_import(&d, tiles, 16, -1, TXM_BAD_ARGUMENT, "-1 maps");
    refuses_import(&d, tiles, 3, 9, TXM_BAD_ARGUMENT, "9 maps");
    for (int t = 0; t < 16; t += 15) {
        for (int i = 0; i < 9; i++) {
            const txm_image keep = tiles[t];
            float *sample = &((float *)tiles[t].pixels)[1000];
            txm_status expected = TXM_BAD_ARGUMENT;
            if (i == 0) tiles[t].pixels = NULL;
            if (i == 1) tiles[t].width = 31;
            if (i == 2) tiles[t].height = 33;
            if (i == 3) tiles[t].channels = 2;
            if (i == 4) tiles[t].sample = t ? TXM_U8 : TXM_U16;
            if (i == 5) tiles[t].stride = 31 * 4;
            if (i == 6) tiles[t].channels = 5;
            if (i == 7) *sample = (float)NAN;
            if (i == 8) tiles[t].width = INT_MAX, expected = TXM_TOO_LARGE;
            refuses_import(&d, tiles, 16, 1, expected, "one tile that does not fit");
            *sample = 0;
            tiles[t] = keep;
        }
    }
#define REFUSES_IMPORT(field, value)                                                   \
    do {                                                                               \
        textiles_desc e = d;                                                           \
        e.field = value;                                                               \
        refuses_import(&e, tiles, 16, 1, TXM_BAD_ARGUMENT, #field " = " #value);       \
    } while (0)
    REFUSES_IMPORT(kind, (textiles_kind)4);
    REFUSES_IMPORT(kind, TEXTILES_TRIANGLE);
    REFUSES_IMPORT(size, 31);
    REFUSES_IMPORT(size, 33);
    REFUSES_IMPORT(size, 0);
    REFUSES_IMPORT(size, 1025);
    REFUSES_IMPORT(colors, 3);
    REFUSES_IMPORT(colors, 5);
    REFUSES_IMPORT(variants, 2);
    REFUSES_IMPORT(variants, 17);
    REFUSES_IMPORT(reduced, 1);
    REFUSES_IMPORT(classes, common_classes);
    REFUSES_IMPORT(class_count, 5);

    import_job job = {&d, tiles};
    for (int kind = TK_ALLOCATION; kind <= TK_ONWARD; kind++)
        assert_true(tk_sweep(try_import, &job, (tk_kind)kind) > 2);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_list_squares),
        cmocka_unit_test(test_list_reduced_wang),
        cmocka_unit_test(test_list_triangles),
        cmocka_unit_test(test_list_frames),
        cmocka_unit_test(test_find_refuses),
        cmocka_unit_test(test_import_round_trip),
        cmocka_unit_test(test_import_beyond_triangles),
        cmocka_unit_test(test_import_refuses),
    };
    return cmocka_run_group_tests_name("textiles_set", tests, make_common_unrepaired, free_common);
}
