/* test_textiles_exemplars.c - sets made from exemplars of many sorts and sizes
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_textiles_exemplars && build/tests/unit/test_textiles_exemplars */
#include "textiles.h"

#include "tilecheck.h"

/* ---- tests: exemplars of many sorts ------------------------------------------------------------ */

/* 8 bits made 16: the same tiles. (Those of triangles are resampled, to 16 bits.) */
static void test_sixteen_bits(void **state) {
    (void)state;
    tk_wide();
    enum { N = 96 };
    txm_image maps[2] = {draw(BLOBS, N, N, 3, 64), new_image(N, N, 3, TXM_U16)};
    for (int i = 0; i < N * N * 3; i++)
        ((uint16_t *)maps[1].pixels)[i] = (uint16_t)(257 * ((const uint8_t *)maps[0].pixels)[i]);
    for (int k = 0; k < KINDS; k++) {
        if (k == TEXTILES_TRIANGLE) continue;
        for (int repair = 1; repair <= 2; repair++) {
            textiles_joints joints[2];
            readback b[2];
            textiles_set *sets[2];
            for (int i = 0; i < 2; i++) {
                const textiles_exemplar exemplar = {&maps[i], 1};
                textiles_desc d = desc_of((textiles_kind)k, &exemplar, 1, 34);
                d.repair = (textiles_repair)repair;
                d.reduced = k == TEXTILES_WANG;
                sets[i] = make(&d);
                b[i] = read_back(sets[i], i << 8);
                joints[i] = measure(sets[i], 0);
            }
            for (size_t p = 0; p < place_of(b, b->count, 0, 0); p++) {
                assert_true(b[0].sheet[p] == b[1].sheet[p]);
                assert_memory_equal(b[0].from[p], b[1].from[p], sizeof b[0].from[p]);
                for (int c = 0; c < 3; c++)
                    assert_near(sample_of(&b[1], 0, p, c) / 257, sample_of(&b[0], 0, p, c),
                                repair == TEXTILES_REPAIR_NONE ? 0 : 0.51);
            }
            assert_int_equal(joints[0].pairs, joints[1].pairs);
            assert_near(joints[0].mean, joints[1].mean, repair == TEXTILES_REPAIR_NONE ? 1e-9 : 0.01);
            for (int i = 0; i < 2; i++) {
                free_readback(&b[i]);
                textiles_set_free(sets[i]);
            }
        }
    }
    for (int i = 0; i < 2; i++) free(maps[i].pixels);
}

/* Three exemplars; edges of a colour show the one they are told to. */
static void test_several_exemplars(void **state) {
    (void)state;
    txm_image maps[3];
    textiles_exemplar exemplars[3];
    const int sizes[3][2] = {{96, 80}, {72, 100}, {90, 90}};
    for (int e = 0; e < 3; e++) {
        maps[e] = draw(BLOBS, sizes[e][0], sizes[e][1], 3, 64 + 300 * e);
        exemplars[e].maps = &maps[e];
        exemplars[e].map_count = 1;
    }
    for (int k = 0; k < KINDS; k++) {
        for (int told = 0; told < 2; told++) {
            const int wishes[] = {2, 0, 1};
            textiles_desc d = desc_of((textiles_kind)k, exemplars, 3, 36);
            d.reduced = k == TEXTILES_TRIANGLE || k == TEXTILES_WANG;
            d.repair = TEXTILES_REPAIR_NONE;
            if (k == TEXTILES_FRAME) d.colors = 3, d.variants = 3;
            if (told) d.edge_exemplars = wishes;
            if (told == (k == TEXTILES_CORNER)) continue; /* of these refused, see test_bad_kinds */
            textiles_set *set = make(&d);
            readback b = read_back(set, 0);
            int used[3] = {0, 0, 0};
            check_sources(&b, sizes);
            check_set(&b, 1);
            if (k != TEXTILES_TRIANGLE) check_pixels(&b, exemplars);
            for (int t = 0; t < b.count; t++) {
                for (int i = 0; i < b.side * b.side; i++) {
                    if (is_inside(&b, i % b.side, i / b.side))
                        used[(int)b.sheet[place_of(&b, t, i % b.side, i / b.side)]]++;
                }
                for (int s = 0; s < (k == TEXTILES_TRIANGLE ? 3 : 4) && told; s++) {
                    for (int a = 9; a < 27; a++) {
                        const size_t p = side_place(&b, t, s, a, 0);
                        assert_int_equal(b.sheet[p], wishes[b.tiles[t].edges[s]]);
                    }
                }
            }
            if (!used[0] || !used[1] || !used[2])
                fail_msg("kind %d: %d, %d, %d pixels of the exemplars", k, used[0], used[1], used[2]);
            free_readback(&b);
            textiles_set_free(set);
        }
    }
    for (int e = 0; e < 3; e++) free(maps[e].pixels);
}

/* One set with everything checked; segments: of which its edges may be made. */
static void try_size(textiles_kind kind, int width, int height, int channels, int size, int colors,
                     int segments) {
    const int sizes[][2] = {{width, height}};
    txm_image map = draw(CELLS, width, height, channels, 80);
    const textiles_exemplar exemplar = {&map, 1};
    textiles_desc d = desc_of(kind, &exemplar, 1, size);
    d.colors = colors;
    d.reduced = kind == TEXTILES_TRIANGLE || kind == TEXTILES_WANG;
    d.repair = TEXTILES_REPAIR_NONE;
    textiles_set *set = make(&d);
    readback b = read_back(set, 0);
    assert_int_equal(b.size, size ? size : 128);
    check_sources(&b, sizes);
    check_set(&b, segments);
    if (kind != TEXTILES_TRIANGLE) check_pixels(&b, &exemplar);
    if (getenv("TEXTILES_TEST_SHOW")) measure(set, 0);
    free_readback(&b);
    textiles_set_free(set);
    free(map.pixels);
}

static void test_sizes(void **state) {
    (void)state;
    tk_wide();
    try_size(TEXTILES_WANG, 64, 64, 1, 32, 4, 1);
    try_size(TEXTILES_WANG, 100, 64, 4, 33, 2, 1);
    try_size(TEXTILES_CORNER, 64, 64, 1, 32, 3, 1);
    try_size(TEXTILES_TRIANGLE, 64, 70, 2, 32, 2, 1);
    try_size(TEXTILES_FRAME, 64, 128, 3, 33, 4, 1);
    try_size(TEXTILES_FRAME, 65, 67, 2, 32, 1, 1);
}

/* Down to 8 pixels a side. */
static void test_small_tiles(void **state) {
    static const int sizes[] = {8, 9, 12, 16, 24, 31};
    (void)state;
    for (int k = 0; k < 6; k++) {
        try_size(TEXTILES_WANG, 96, 80, 3, sizes[k], 2, 1);
        try_size(TEXTILES_CORNER, 64, 70, 1, sizes[k], 2, 1);
        try_size(TEXTILES_FRAME, 64, 96, 4, sizes[k], 2, 1);
    }
}

static void test_small_exemplars(void **state) {
    (void)state;
    tk_wide();
    try_size(TEXTILES_FRAME, 400, 64, 1, 0, 1, 6);
    if (tk_full()) {
        try_size(TEXTILES_FRAME, 64, 64, 3, 0, 2, 6);
        try_size(TEXTILES_FRAME, 90, 64, 1, 0, 2, 6);
    }
    try_size(TEXTILES_FRAME, 64, 400, 1, 100, 1, 6);
    try_size(TEXTILES_CORNER, 90, 64, 1, 50, 2, 4);
    try_size(TEXTILES_TRIANGLE, 70, 64, 1, 60, 2, 4);
}

/* Tiles much larger than the exemplar: made or refused, but never from beyond its borders. The largest
   takes half a minute under sanitizers: only with FULL=1. */
static void test_tiny_exemplars(void **state) {
    (void)state;
    static const int cases[][4] = {{TEXTILES_FRAME, 64, 64, 160},
                                   {TEXTILES_FRAME, 100, 64, 230},
                                   {TEXTILES_FRAME, 64, 64, 1024}};
    for (int i = 0; i < 2 + tk_full(); i++) {
        const int *c = cases[i], sizes[][2] = {{c[1], c[2]}};
        txm_image map = draw(BLOBS, c[1], c[2], 1, 80);
        const textiles_exemplar exemplar = {&map, 1};
        textiles_desc d = desc_of((textiles_kind)c[0], &exemplar, 1, c[3]);
        tk_memory memory = {0};
        txm_env env = tk_env(&memory, NULL);
        textiles_set *set = NULL;
        d.colors = 1;
        d.repair = TEXTILES_REPAIR_NONE;
        const txm_status status = textiles_make(&d, &env, &set);
        if (status != TXM_OK) {
            assert_int_equal(status, TXM_TOO_SMALL);
            assert_true(!set && env.message[0]);
        } else {
            readback b = read_back(set, 0);
            check_sources(&b, sizes);
            check_pixels(&b, &exemplar);
            free_readback(&b);
            textiles_set_free(set);
        }
        assert_int_equal(tk_leaks(&memory), 0);
        free(map.pixels);
    }
}

/* An exemplar of one colour: so are the tiles. Floats of any size too. */
static void test_constant(void **state) {
    (void)state;
    static uint8_t gray[64 * 64 * 3];
    static float floats[64 * 64];
    static const float values[] = {0.0f, -7.5f, 3e38f};
    memset(gray, 77, sizeof gray);
    for (int k = 0; k < KINDS; k++) {
        for (int i = 0; i < 2; i++) {
            const txm_image map = i ? view(floats, 64, 64, 1, TXM_F32) : view(gray, 64, 64, 3, TXM_U8);
            const textiles_exemplar exemplar = {&map, 1};
            const double value = i ? (double)values[k % 3] : 77;
            for (int p = 0; p < 64 * 64; p++) floats[p] = values[k % 3];
            textiles_desc d = desc_of((textiles_kind)k, &exemplar, 1, 32);
            d.reduced = k == TEXTILES_WANG || k == TEXTILES_TRIANGLE;
            textiles_set *set = make(&d);
            readback b = read_back(set, i);
            for (int t = 0; t < b.count; t++) {
                for (int p = 0; p < b.side * b.side; p++) {
                    if (!is_inside(&b, p % b.side, p / b.side)) continue;
                    assert_near(sample_of(&b, 0, place_of(&b, t, p % b.side, p / b.side), 0), value,
                                fabs(value) * 1e-6);
                }
            }
            if (k != TEXTILES_TRIANGLE || !i) {
                const textiles_joints j = measure(set, 0);
                assert_true(j.mean == 1 && j.worst == 1 && j.least == 1 && j.overall == 1);
            }
            free_readback(&b);
            textiles_set_free(set);
        }
    }
}

/* Rows far apart, and upside down in memory: the same set. */
static void test_strides(void **state) {
    (void)state;
    enum { W = 70, H = 66, ROW = 80 };
    static float apart[H * ROW];
    static float packed[H * W];
    for (int i = 0; i < H * ROW; i++) apart[i] = (float)NAN; /* what lies between is not looked at */
    for (int y = 0; y < H; y++) {
        for (int x = 0; x < W; x++)
            packed[y * W + x] = apart[(H - 1 - y) * ROW + x] = (float)draw_cells(x + 64, y + 64, 0);
    }
    txm_image maps[2] = {view(packed, W, H, 0, TXM_F32),
                         view(apart + (H - 1) * ROW, W, H, 1, TXM_F32)};
    maps[1].stride = -(ptrdiff_t)(ROW * sizeof(float));
    for (int k = 2; k < KINDS; k++) {
        uint64_t hash[2];
        for (int i = 0; i < 2; i++) {
            const textiles_exemplar exemplar = {&maps[i], 1};
            textiles_desc d = desc_of((textiles_kind)k, &exemplar, 1, 32);
            d.reduced = k == TEXTILES_TRIANGLE;
            textiles_set *set = make(&d);
            assert_int_equal(textiles_channels(set, 0), 1);
            hash[i] = hash_and_free(set, 1);
        }
        assert_true(hash[0] == hash[1]);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sixteen_bits),
        cmocka_unit_test(test_several_exemplars),
        cmocka_unit_test(test_sizes),
        cmocka_unit_test(test_small_tiles),
        cmocka_unit_test(test_small_exemplars),
        cmocka_unit_test(test_constant),
        cmocka_unit_test(test_strides),
        cmocka_unit_test(test_tiny_exemplars),
    };
    return cmocka_run_group_tests_name("textiles_exemplars", tests, NULL, NULL);
}
