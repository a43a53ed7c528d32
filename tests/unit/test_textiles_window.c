/* test_textiles_window.c - windows of the plane drawn from an atlas; what drawing refuses
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_textiles_window && build/tests/unit/test_textiles_window */
#include "textiles.h"

#include "atlaskit.h"

/* ---- the plane ---------------------------------------------------------------------------- */

static textiles_plane plane_of(const textiles_set *set, uint32_t seed) {
    textiles_plane plane;
    txm_env env = {0};
    const txm_status status = textiles_plane_make(set, seed, &env, &plane);
    if (status != TXM_OK) fail_msg("plane: %d, %s", status, env.message);
    return plane;
}

/* Squares at whole places and step 1 are copied, bit by bit. */
static void test_plane_copies(void **state) {
    (void)state;
    enum { SIDE = 100 };
    for (int i = 0; i < KINDS; i++) {
        if (!torus_allowed(&kinds[i])) continue; /* complete squares */
        textiles_set *set = import(&kinds[i], N);
        const textiles_plane plane = plane_of(set, 7);
        for (int p = 0; p < 9; p++) {
            const textiles_packing packing = (textiles_packing)(p / 3);
            const textiles_layout l =
                lay_out(set, packing, packing == TEXTILES_TORUS ? 0 : p % 3 * 2);
            const int x0 = p % 3 == 2 ? -1000003 : -40, y0 = p % 3 == 1 ? 777777 : -33;
            txm_image atlas = atlas_of(set, &l, 0), bytes = atlas_of(set, &l, 1);
            txm_image out = picture(SIDE, SIDE, 3, TXM_F32), small = picture(SIDE, SIDE, 4, TXM_U8);
            assert_int_equal(textiles_draw_plane(&plane, &l, &atlas, x0, y0, 1, NULL, out), TXM_OK);
            assert_int_equal(textiles_draw_plane(&plane, &l, &bytes, x0, y0, 1, NULL, small),
                             TXM_OK);
            for (int b = 0; b < SIDE * SIDE; b++) {
                const int x = x0 + b % SIDE, y = y0 + b / SIDE;
                const int column = (int)floor((double)x / N), row = (int)floor((double)y / N);
                const where w = look(&out, b % SIDE, b / SIDE);
                assert_int_equal(w.tile, textiles_plane_tile(&plane, column, row));
                assert_int_equal(w.x, x - column * N);
                assert_int_equal(w.y, y - row * N);
                int px, py;
                assert_int_equal(textiles_place(&l, w.tile, &px, &py, NULL, NULL), 1);
                assert_memory_equal((uint8_t *)small.pixels + 4 * b,
                                    (uint8_t *)txm_image_row(&bytes, py + w.y) + 4 * (px + w.x), 4);
            }
            free(atlas.pixels);
            free(bytes.pixels);
            free(out.pixels);
            free(small.pixels);
        }
        textiles_set_free(set);
    }
}

/* one place of the plane */
static void probe(const textiles_plane *plane, const textiles_layout *l, const txm_image *atlas,
                  double x, double y, float out[3]) {
    txm_image im;
    memset(&im, 0, sizeof im);
    im.pixels = out;
    im.width = im.height = 1;
    im.channels = 3;
    im.sample = TXM_F32;
    const double step = 1.0 / 1024;
    assert_int_equal(
        textiles_draw_plane(plane, l, atlas, x - step / 2, y - step / 2, step, NULL, im), TXM_OK);
}

/* Inside a square the coordinates change evenly. */
static void test_plane_filters(void **state) {
    (void)state;
    textiles_set *set = import(&kinds[2], N);
    const textiles_plane plane = plane_of(set, 3);
    for (int p = 0; p < 3; p++) {
        const textiles_layout l = lay_out(set, (textiles_packing)p, -1);
        txm_image atlas = atlas_of(set, &l, 0);
        txm_rng rng = txm_rng_make(1, 1);
        for (int k = 0; k < 500; k++) {
            const int column = txm_rng_range(&rng, -50, 50), row = txm_rng_range(&rng, -50, 50);
            const double u = 0.5 + (N - 1) * txm_rng_double(&rng);
            const double v = 0.5 + (N - 1) * txm_rng_double(&rng);
            float got[3];
            probe(&plane, &l, &atlas, column * N + u, row * N + v, got);
            assert_near((double)got[0], textiles_plane_tile(&plane, column, row), 1e-4);
            assert_near((double)got[1], u - 0.5, 1e-4);
            assert_near((double)got[2], v - 0.5, 1e-4);
        }
        free(atlas.pixels);
    }
    textiles_set_free(set);
}

/* Across a tile's border a torus goes on with what lies there in the picture, round its ends too; a
   slice ends. */
static void test_plane_borders(void **state) {
    (void)state;
    textiles_set *set = import(&kinds[2], N);
    const textiles_plane plane = plane_of(set, 3);
    const textiles_layout torus = lay_out(set, TEXTILES_TORUS, 0);
    const textiles_layout slices = lay_out(set, TEXTILES_SLICES, 0);
    txm_image round = atlas_of(set, &torus, 0), apart = atlas_of(set, &slices, 0);
    int wrapped = 0;
    for (int b = 0; b < 400; b++) {
        const int column = b % 20, row = b / 20, tile = textiles_plane_tile(&plane, column, row);
        int px, py;
        float got[3];
        assert_int_equal(textiles_place(&torus, tile, &px, &py, NULL, NULL), 1);
        wrapped += px == 0 || py == 0;
        double want = 0; /* at (1/4, 1/4) of the first pixel: 3/4 of it, 1/4 of that beyond */
        for (int k = 0; k < 4; k++) {
            const where w = look(&round, (px - k % 2 + torus.width) % torus.width,
                                 (py - k / 2 + torus.height) % torus.height);
            want += (k % 2 ? 0.25 : 0.75) * (k / 2 ? 0.25 : 0.75) * w.tile;
        }
        probe(&plane, &torus, &round, column * N + 0.25, row * N + 0.25, got);
        assert_near((double)got[0], want, 1e-4);
        for (int k = 0; k < 2; k++) {
            const double at = k ? N - 0.25 : 0.25;
            probe(&plane, &slices, &apart, column * N + at, row * N + at, got);
            assert_true((int)got[0] == tile && (int)got[1] == k * (N - 1));
            assert_true((int)got[2] == k * (N - 1) && got[0] == (float)tile);
        }
    }
    assert_true(wrapped > 20);
    free(round.pixels);
    free(apart.pixels);
    textiles_set_free(set);
}

/* The texels of a triangle lie where the declaration says, for each corner by itself. */
static void test_plane_triangles(void **state) {
    (void)state;
    const double h = sqrt(3.0) / 2;
    for (int i = 0; i < KINDS; i++) {
        if (kinds[i].kind != TEXTILES_TRIANGLE) continue;
        textiles_set *set = import(&kinds[i], N);
        const textiles_plane plane = plane_of(set, 11);
        for (int p = 0; p < 4; p++) {
            const textiles_layout l =
                lay_out(set, p % 2 ? TEXTILES_SLICES : TEXTILES_PACKED, p / 2 * 8 + 1);
            txm_image atlas = atlas_of(set, &l, 0);
            txm_rng rng = txm_rng_make(2, (uint64_t)p);
            for (int k = 0; k < 600; k++) {
                const int a = txm_rng_range(&rng, -30, 30), b = txm_rng_range(&rng, -30, 30);
                const int half = k % 2, ti = txm_rng_range(&rng, 1, N - 2);
                const int tj = txm_rng_range(&rng, 1, N - 1 - ti); /* texel (ti, tj), not on an edge */
                int rotation = -1;
                const int tile = textiles_plane_triangle(&plane, a, b, half, &rotation);
                /* lattice points of the face's corners 0, 1, 2 */
                const int corner[2][3][2] = {{{a, b}, {a, b + 1}, {a + 1, b}},
                                             {{a + 1, b + 1}, {a + 1, b}, {a, b + 1}}};
                const double share[3] = {N - ti - tj, tj, ti}; /* of the tile's corners */
                double at[2] = {0, 0};
                for (int c = 0; c < 3; c++) {
                    const double w = share[(c + rotation) % 3];
                    at[0] += w * (corner[half][c][0] + corner[half][c][1] / 2.0);
                    at[1] += w * corner[half][c][1] * h;
                }
                float got[3];
                probe(&plane, &l, &atlas, at[0], at[1], got);
                assert_near((double)got[0], tile, 1e-3);
                assert_near((double)got[1], ti, 1e-3);
                assert_near((double)got[2], tj, 1e-3);
            }
            free(atlas.pixels);
        }
        textiles_set_free(set);
    }
}

/* Of 8 bits made 16 the plane shows what it shows of 8 bits, rounded more finely. */
static void test_plane_of_sixteen_bits(void **state) {
    (void)state;
    enum { SIDE = 60 };
    for (int i = 1; i < 9; i += 7) {
        textiles_set *set = import(&kinds[i], N);
        const textiles_plane plane = plane_of(set, 1);
        const textiles_layout l = lay_out(set, TEXTILES_PACKED, 4);
        txm_image bytes = atlas_of(set, &l, 1), words = picture(l.width, l.height, 4, TXM_U16);
        txm_image out = picture(SIDE, SIDE, 4, TXM_U8), deep = picture(SIDE, SIDE, 4, TXM_U16);
        for (size_t k = 0; k < bytes_of(&bytes); k++)
            ((uint16_t *)words.pixels)[k] = (uint16_t)(257 * ((uint8_t *)bytes.pixels)[k]);
        for (int step = 1; step <= 2; step++) {
            const double x = -7 + 0.3 * (step - 1), s = step == 1 ? 1 : 0.37;
            assert_int_equal(textiles_draw_plane(&plane, &l, &bytes, x, 5, s, NULL, out), TXM_OK);
            assert_int_equal(textiles_draw_plane(&plane, &l, &words, x, 5, s, NULL, deep), TXM_OK);
            int between = 0;
            for (int k = 0; k < SIDE * SIDE * 4; k++) {
                const int v = ((uint16_t *)deep.pixels)[k];
                assert_near(v / 257.0, ((uint8_t *)out.pixels)[k], 0.51);
                between += v % 257 != 0;
            }
            if (i == 1 && step == 1) assert_int_equal(between, 0); /* copied as they are */
            else assert_true(between > SIDE * SIDE * 2);
        }
        refused(textiles_draw_plane(&plane, &l, &words, 0, 0, 1, &env, out));
        refused(textiles_draw_plane(&plane, &l, &bytes, 0, 0, 1, &env, deep));
        refused(textiles_draw_atlas(set, &l, 1, &env, words));
        free(bytes.pixels);
        free(words.pixels);
        free(out.pixels);
        free(deep.pixels);
        textiles_set_free(set);
    }
}

/* Views with strides, more channels and other hooks show the same. */
static void test_same_bytes(void **state) {
    (void)state;
    enum { SIDE = 90 };
    static const int which[] = {1, 6, 8};
    for (int i = 0; i < 3; i++) {
        textiles_set *set = import(&kinds[which[i]], N);
        const textiles_plane plane = plane_of(set, 1);
        const textiles_layout l = lay_out(set, TEXTILES_PACKED, 4);
        txm_image first = atlas_of(set, &l, 1), out = picture(SIDE, SIDE, 4, TXM_U8);
        assert_int_equal(textiles_draw_plane(&plane, &l, &first, 3.3, -4.1, 0.77, NULL, out), TXM_OK);
        for (int hook = 0; hook < 2; hook++) {
            tk_memory memory = {0};
            txm_env env = tk_env(&memory, NULL);
            env.parallel_for = hook ? tk_parallel_threads : tk_parallel_reverse;
            const size_t stride = (size_t)l.width * 4 + 12;
            uint8_t *rows = (uint8_t *)malloc(stride * (size_t)l.height);
            assert_non_null(rows);
            txm_image turned = first; /* bottom-up */
            turned.pixels = rows + stride * (size_t)(l.height - 1);
            turned.stride = -(ptrdiff_t)stride;
            assert_int_equal(textiles_draw_atlas(set, &l, 1, &env, turned), TXM_OK);
            for (int y = 0; y < l.height; y++)
                assert_memory_equal(txm_image_row(&turned, y), txm_image_row(&first, y),
                                    (size_t)l.width * 4);
            txm_image again = picture(SIDE, SIDE, 4, TXM_U8);
            assert_int_equal(textiles_draw_plane(&plane, &l, &turned, 3.3, -4.1, 0.77, &env, again),
                             TXM_OK);
            assert_memory_equal(again.pixels, out.pixels, bytes_of(&out));
            assert_int_equal(memory.calls, 0); /* nothing here allocates */
            free(again.pixels);
            free(rows);
        }
        free(first.pixels);
        free(out.pixels);
        textiles_set_free(set);
    }
}

/* ---- bad input ---------------------------------------------------------------------------- */

static void test_bad_layouts(void **state) {
    (void)state;
    const kind_of four = {TEXTILES_CORNER, 4, 1, 0, 256};
    textiles_layout l, before;
    memset(&l, FILL, sizeof l);
    before = l;
    textiles_set *wang = import(&kinds[0], N), *reduced = import(&kinds[3], N);
    textiles_set *triangle = import(&kinds[7], N), *frame = import(&kinds[11], N);
    textiles_set *corner = import(&four, N);
    refused(textiles_layout_make(NULL, TEXTILES_PACKED, 0, &env, &l));
    refused(textiles_layout_make(wang, TEXTILES_PACKED, 0, &env, NULL));
    refused(textiles_layout_make(wang, (textiles_packing)3, 0, &env, &l));
    refused(textiles_layout_make(wang, (textiles_packing)-1, 0, &env, &l));
    refused(textiles_layout_make(wang, TEXTILES_PACKED, -2, &env, &l));
    refused(textiles_layout_make(wang, TEXTILES_PACKED, N / 2 + 1, &env, &l));
    refused(textiles_layout_make(wang, TEXTILES_SLICES, INT_MAX, &env, &l));
    refused(textiles_layout_make(wang, TEXTILES_TORUS, 1, &env, &l));
    refused(textiles_layout_make(reduced, TEXTILES_TORUS, 0, &env, &l));
    refused(textiles_layout_make(triangle, TEXTILES_TORUS, 0, &env, &l));
    refused(textiles_layout_make(frame, TEXTILES_TORUS, 0, &env, &l));
    refused(textiles_layout_make(corner, TEXTILES_TORUS, 0, &env, &l));
    assert_memory_equal(&l, &before, sizeof l);

    l = lay_out(wang, TEXTILES_PACKED, 2);
    int px = 5;
    float uv[4][2];
    assert_int_equal(textiles_place(&l, -1, &px, NULL, NULL, uv), 0);
    assert_int_equal(textiles_place(&l, 16, &px, NULL, NULL, uv), 0);
    assert_int_equal(textiles_place(NULL, 0, &px, NULL, NULL, uv), 0);
    assert_int_equal(textiles_face_uv(&l, 16, 0, uv), 0);
    assert_int_equal(textiles_face_uv(&l, 0, 0, NULL), 0);
    assert_int_equal(textiles_face_uv(&l, 0, 3, uv), 0);
    assert_int_equal(textiles_face_uv(&l, 0, -1, uv), 0);
    assert_int_equal(px, 5);
    textiles_set_free(wang);
    textiles_set_free(reduced);
    textiles_set_free(triangle);
    textiles_set_free(frame);
    textiles_set_free(corner);
}

/* 256 tiles of 80 pixels are within the limit that tests/build.mk sets, with wide gutters no longer. */
static void test_too_large(void **state) {
    (void)state;
    const kind_of many = {TEXTILES_WANG, 4, 1, 0, 256};
    textiles_set *set = import(&many, 80);
    textiles_layout l;
    txm_env env = {0};
    assert_int_equal(textiles_layout_make(set, TEXTILES_PACKED, 16, &env, &l), TXM_OK);
    assert_int_equal(textiles_layout_make(set, TEXTILES_PACKED, 40, &env, &l), TXM_TOO_LARGE);
    assert_int_equal(textiles_layout_make(set, TEXTILES_SLICES, 40, &env, &l), TXM_TOO_LARGE);
    assert_int_equal(l.gutter, 16);
    textiles_set_free(set);
}

/* every field of a layout changed in turn */
static textiles_layout spoiled(textiles_layout l, int field) {
    int *const fields[] = {&l.size,    &l.colors,  &l.variants, &l.count, &l.gutter,
                           &l.columns, &l.pitch_x, &l.pitch_y,  &l.width, &l.height};
    if (field < 20) *fields[field / 2] += field % 2 ? 1 : -1;
    else if (field < 30) *fields[field - 20] = -1;
    else if (field < 40) *fields[field - 30] = INT_MAX;
    else if (field < 50) *fields[field - 40] = 0;
    else if (field == 50) l.packing = (textiles_packing)7;
    else l.kind = (textiles_kind)9;
    return l;
}

static void test_bad_pictures(void **state) {
    (void)state;
    enum { SIDE = 20 };
    for (int i = 0; i < 2; i++) {
        textiles_set *set = import(&kinds[i ? 8 : 1], N), *other = import(&kinds[i ? 7 : 0], N);
        const textiles_layout l = lay_out(set, TEXTILES_PACKED, 2);
        const textiles_layout of_other = lay_out(other, TEXTILES_PACKED, 2);
        const int side = N + i + 4;
        const textiles_plane plane = plane_of(set, 1), of_others = plane_of(other, 1);
        txm_image atlas = picture(l.width, l.height, 3, TXM_F32), flat = atlas;
        txm_image wide = picture(l.width + 1, l.height, 3, TXM_F32);
        txm_image out = picture(SIDE, SIDE, 3, TXM_F32), bytes = picture(SIDE, SIDE, 3, TXM_U8);
        txm_image tile = picture(side, side, 3, TXM_F32), broken = out;
        broken.pixels = NULL;

        refused(textiles_draw_atlas(NULL, &l, 0, &env, atlas));
        refused(textiles_draw_atlas(set, NULL, 0, &env, atlas));
        refused(textiles_draw_atlas(set, &l, -1, &env, atlas));
        refused(textiles_draw_atlas(set, &l, 2, &env, atlas));
        refused(textiles_draw_atlas(set, &l, 1, &env, atlas));
        refused(textiles_draw_atlas(set, &l, 0, &env, wide));
        refused(textiles_draw_atlas(set, &l, 0, &env, broken));
        refused(textiles_draw_atlas(set, &of_other, 0, &env, atlas));
        flat.sample = TXM_U8;
        refused(textiles_draw_atlas(set, &l, 0, &env, flat));
        flat = atlas;
        flat.channels = 1;
        refused(textiles_draw_atlas(set, &l, 0, &env, flat));
        refused(textiles_draw_tile(NULL, 0, 2, 0, &env, tile));
        refused(textiles_draw_tile(set, -1, 2, 0, &env, tile));
        refused(textiles_draw_tile(set, l.count, 2, 0, &env, tile));
        refused(textiles_draw_tile(set, 0, -1, 0, &env, tile));
        refused(textiles_draw_tile(set, 0, 3, 0, &env, tile));
        refused(textiles_draw_tile(set, 0, N / 2 + 1, 0, &env, tile));
        refused(textiles_draw_tile(set, 0, 2, 3, &env, tile));
        refused(textiles_draw_tile(set, 0, 2, 1, &env, tile));
        assert_true(untouched(&atlas) && untouched(&wide) && untouched(&tile));

        assert_int_equal(textiles_draw_atlas(set, &l, 0, NULL, atlas), TXM_OK);
        refused(textiles_draw_plane(NULL, &l, &atlas, 0, 0, 1, &env, out));
        refused(textiles_draw_plane(&plane, NULL, &atlas, 0, 0, 1, &env, out));
        refused(textiles_draw_plane(&plane, &l, NULL, 0, 0, 1, &env, out));
        refused(textiles_draw_plane(&plane, &l, &broken, 0, 0, 1, &env, out));
        refused(textiles_draw_plane(&plane, &l, &wide, 0, 0, 1, &env, out));
        refused(textiles_draw_plane(&plane, &l, &atlas, 0, 0, 1, &env, bytes));
        refused(textiles_draw_plane(&plane, &l, &atlas, 0, 0, 1, &env, broken));
        refused(textiles_draw_plane(&of_others, &l, &atlas, 0, 0, 1, &env, out));
        refused(textiles_draw_plane(&plane, &of_other, &atlas, 0, 0, 1, &env, out));
        const double bad[] = {0, -1, NAN, INFINITY, 1e300};
        for (int k = 0; k < 5; k++) {
            refused(textiles_draw_plane(&plane, &l, &atlas, 0, 0, bad[k], &env, out));
            if (k < 2) continue;
            refused(textiles_draw_plane(&plane, &l, &atlas, bad[k], 0, 1, &env, out));
            refused(textiles_draw_plane(&plane, &l, &atlas, 0, -bad[k], 1, &env, out));
        }
        for (int field = 0; field < 52; field++) {
            const textiles_layout s = spoiled(l, field);
            txm_env env = {0};
            assert_int_not_equal(textiles_draw_atlas(set, &s, 0, &env, wide), TXM_OK);
            if (field == 0) continue; /* tiles one pixel smaller may lie in the same cells */
            assert_int_not_equal(textiles_draw_plane(&plane, &s, &atlas, 0, 0, 1, &env, out), TXM_OK);
        }
        assert_true(untouched(&out) && untouched(&bytes) && untouched(&wide));

        /* a reduced set's layout has too few tiles for the full set's table */
        if (i) {
            textiles_set *fewer = import(&kinds[10], N);
            const textiles_layout small = lay_out(fewer, TEXTILES_PACKED, 2);
            txm_image im = atlas_of(fewer, &small, 0);
            refused(textiles_draw_plane(&of_others, &small, &im, 0, 0, 1, &env, out));
            textiles_set_free(fewer);
            free(im.pixels);
        }
        free(atlas.pixels);
        free(wide.pixels);
        free(out.pixels);
        free(bytes.pixels);
        free(tile.pixels);
        textiles_set_free(set);
        textiles_set_free(other);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_plane_copies),
        cmocka_unit_test(test_plane_filters),
        cmocka_unit_test(test_plane_borders),
        cmocka_unit_test(test_plane_triangles),
        cmocka_unit_test(test_plane_of_sixteen_bits),
        cmocka_unit_test(test_same_bytes),
        cmocka_unit_test(test_bad_layouts),
        cmocka_unit_test(test_too_large),
        cmocka_unit_test(test_bad_pictures),
    };
    return cmocka_run_group_tests_name("textiles_window", tests, NULL, NULL);
}
