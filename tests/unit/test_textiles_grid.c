/* test_textiles_grid.c - finite grids: scan-line order, tiling under constraints
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_textiles_grid && build/tests/unit/test_textiles_grid */
#include "textiles.h"

#include "gridkit.h"

/* ---- scan-line tiling ------------------------------------------------------------------- */

static void test_scanline(void **state) {
    (void)state;
    enum { W = 70, H = 61 };
    static int tiles[W * H], again[W * H];
    static const struct {
        textiles_kind kind;
        int colors, variants, reduced;
    } cases[] = {
        {TEXTILES_WANG, 2, 1, 0},   {TEXTILES_WANG, 2, 2, 0},   {TEXTILES_WANG, 3, 1, 0},
        {TEXTILES_WANG, 4, 16, 0},  {TEXTILES_WANG, 2, 1, 1},   {TEXTILES_WANG, 2, 2, 1},
        {TEXTILES_WANG, 3, 1, 1},   {TEXTILES_WANG, 4, 3, 1},   {TEXTILES_CORNER, 2, 1, 0},
        {TEXTILES_CORNER, 2, 5, 0}, {TEXTILES_CORNER, 3, 1, 0}, {TEXTILES_CORNER, 4, 2, 0},
        {TEXTILES_FRAME, 1, 3, 0},  {TEXTILES_FRAME, 3, 4, 0},  {TEXTILES_FRAME, 2, 5, 0},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        textiles_set *set =
            make_set(cases[i].kind, cases[i].colors, cases[i].variants, cases[i].reduced);
        const int count = textiles_count(set);
        txm_env env = {0};
        for (int k = 0; k < 6; k++) {
            static const int sizes[6][2] = {{W, H}, {1, 1}, {1, H}, {W, 1}, {2, 2}, {17, 5}};
            const int w = sizes[k][0], h = sizes[k][1];
            fill(tiles, W * H, FILL);
            assert_int_equal(textiles_scanline(set, w, h, 7, &env, tiles), TXM_OK);
            assert_filled(tiles + w * h, W * H - w * h, FILL);
            check_joins(set, tiles, w, h, 0);
            /* with three variants there is always another; complete sets have other colours */
            const int fresh = cases[i].variants > 2 ||
                              (cases[i].kind == TEXTILES_WANG && !cases[i].reduced) ||
                              (cases[i].kind == TEXTILES_CORNER && cases[i].variants > 1);
            if (fresh) assert_int_equal(count_runs(tiles, w, h, 0), 0);
            assert_int_equal(textiles_scanline(set, w, h, 7, NULL, again), TXM_OK);
            assert_memory_equal(tiles, again, sizeof(int) * (size_t)(w * h));
        }
        textiles_scanline(set, W, H, 7, NULL, tiles);
        if (cases[i].kind != TEXTILES_FRAME && cases[i].variants < 16)
            check_usage(tiles, W * H, count, 5 + 2.0 * cases[i].reduced);
        textiles_scanline(set, W, H, 8, NULL, again);
        assert_true(differences(tiles, again, W * H) > W * H / 4);
        textiles_set_free(set);
    }
}

/* A tile three times in a row only where nothing else fits. */
static void test_scanline_runs(void **state) {
    (void)state;
    enum { W = 60, H = 50 };
    static int tiles[W * H];
    static const int kinds[3][4] = {
        {TEXTILES_WANG, 2, 1, 1}, {TEXTILES_CORNER, 2, 1, 0}, {TEXTILES_FRAME, 2, 2, 0}};
    for (int i = 0; i < 3; i++) {
        textiles_set *set =
            make_set((textiles_kind)kinds[i][0], kinds[i][1], kinds[i][2], kinds[i][3]);
        const int count = textiles_count(set);
        int forced = 0;
        assert_int_equal(textiles_scanline(set, W, H, 3, NULL, tiles), TXM_OK);
        for (int y = 0; y < H; y++) {
            for (int x = 0; x < W; x++) {
                const int *t = tiles + y * W + x;
                const int row = x > 1 && t[-1] == t[-2] ? t[-1] : -1;
                const int column = y > 1 && t[-W] == t[-2 * W] ? t[-W] : -1;
                if (*t != row && *t != column) continue;
                forced++;
                for (int k = 0; k < count; k++) {
                    const int fits = (!x || joins(set, t[-1], k, 0)) && (!y || joins(set, t[-W], k, 1));
                    if (fits && k != row && k != column) fail_msg("(%d, %d) could be %d", x, y, k);
                }
            }
        }
        if (i != 2) assert_true(forced < W * H / 8);
        textiles_set_free(set);
    }
}

static void refuses_scanline(const textiles_set *set, int width, int height, const char *words) {
    int tiles[16];
    txm_env env = {0};
    fill(tiles, 16, FILL);
    assert_int_equal(textiles_scanline(set, width, height, 1, &env, tiles), TXM_BAD_ARGUMENT);
    if (!strstr(env.message, words)) fail_msg("'%s' does not say '%s'", env.message, words);
    assert_filled(tiles, 16, FILL);
    assert_int_equal(textiles_scanline(set, width, height, 1, NULL, tiles), TXM_BAD_ARGUMENT);
}

static void test_scanline_refuses(void **state) {
    (void)state;
    static const int dead[2][4] = {{0, 1, 0, 0}, {1, 1, 1, 1}}; /* none for north 0, west 1 */
    textiles_set *wang = make_set(TEXTILES_WANG, 2, 1, 0);
    textiles_set *triangle = make_set(TEXTILES_TRIANGLE, 2, 1, 0);
    textiles_set *frame = make_frame(dead, 2, 2, 2);
    txm_env env = {0};
    int tiles[16];
    refuses_scanline(NULL, 2, 2, "NULL");
    refuses_scanline(triangle, 2, 2, "triangle");
    refuses_scanline(wang, 0, 2, "width");
    refuses_scanline(wang, 2, 0, "height");
    refuses_scanline(wang, INT_MIN, 2, "width");
    refuses_scanline(frame, 2, 2, "north color 0 and west color 1");
    assert_int_equal(textiles_scanline(wang, 2, 2, 1, &env, NULL), TXM_BAD_ARGUMENT);
    /* where the dead end cannot be reached, it does no harm */
    assert_int_equal(textiles_scanline(frame, 1, 16, 1, &env, tiles), TXM_OK);
    check_joins(frame, tiles, 1, 16, 0);
    assert_int_equal(textiles_scanline(frame, 16, 1, 1, &env, tiles), TXM_OK);
    check_joins(frame, tiles, 16, 1, 0);
    textiles_set_free(wang);
    textiles_set_free(triangle);
    textiles_set_free(frame);
}

/* ---- tiling under constraints ----------------------------------------------------------- */

static void test_solve(void **state) {
    (void)state;
    enum { MOST_CELLS = 40 * 40 };
    static int tiles[MOST_CELLS], given[MOST_CELLS], again[MOST_CELLS];
    static const int sizes[][2] = {{1, 1}, {1, 9}, {9, 1}, {2, 2}, {3, 2}, {5, 4}, {24, 19}, {40, 40}};
    for (int i = 0; i < SOLVE_CASES; i++) {
        textiles_set *set = solve_case(i);
        for (int k = 0; k < 16; k++) {
            const int w = sizes[k / 2][0], h = sizes[k / 2][1], periodic = k % 2, n = w * h;
            txm_rng rng = txm_rng_make(4, (uint64_t)k);
            fill(tiles, n, -1);
            solve(set, w, h, periodic, (uint64_t)k, tiles);
            check_joins(set, tiles, w, h, periodic);
            /* with room for it, no three in a row */
            if (textiles_variants(set) > 1 && !periodic)
                assert_int_equal(count_runs(tiles, w, h, 0), 0);
            if (textiles_variants(set) > 2 && w > 1 && h > 1)
                assert_int_equal(count_runs(tiles, w, h, periodic), 0);
            fill(again, n, -1);
            assert_int_equal(
                textiles_solve(set, w, h, periodic ? -5 : 0, (uint64_t)k, NULL, again), TXM_OK);
            assert_memory_equal(tiles, again, sizeof(int) * (size_t)n);
            if (n > 300) { /* another seed, another tiling */
                fill(again, n, -1);
                solve(set, w, h, periodic, 99, again);
                assert_true(differences(tiles, again, n) > n / 8);
            }
            /* some of it given, from one cell in sixteen to all */
            for (uint32_t keep = 1; keep <= 16; keep *= 2) {
                for (int t = 0; t < n; t++)
                    given[t] = txm_rng_below(&rng, 16) < keep ? tiles[t] : -1;
                memcpy(again, given, sizeof again);
                solve(set, w, h, periodic, (uint64_t)k + 100, again);
                check_joins(set, again, w, h, periodic);
                for (int t = 0; t < n; t++)
                    if (given[t] >= 0) assert_int_equal(again[t], given[t]);
            }
        }
        textiles_set_free(set);
    }
}

/* Is there a tiling? Tries everything, cell by cell from number `at`. */
static int has_tiling(const textiles_set *set, int *tiles, const int *given, int at, int w, int h,
                      int periodic) {
    const int x = at % w, y = at / w, v = textiles_variants(set);
    if (at == w * h) return 1;
    for (int t = 0; t < textiles_count(set); t += v) {
        if (given[at] >= 0 && t != given[at] / v * v) continue;
        tiles[at] = t;
        if (x && !joins(set, tiles[at - 1], t, 0)) continue;
        if (y && !joins(set, tiles[at - w], t, 1)) continue;
        if (periodic && x == w - 1 && !joins(set, t, tiles[at - x], 0)) continue;
        if (periodic && y == h - 1 && !joins(set, t, tiles[x], 1)) continue;
        if (has_tiling(set, tiles, given, at + 1, w, h, periodic)) return 1;
    }
    return 0;
}

/* Small grids with random given tiles: solved if and only if there is a tiling. */
static void test_solve_is_exact(void **state) {
    (void)state;
    static const int which[] = {4, 5, 6, 7, 13, SOLVE_CASES - 1};
    int solved = 0, refused = 0;
    for (size_t i = 0; i < sizeof which / sizeof *which; i++) {
        textiles_set *set = solve_case(which[i]);
        txm_rng rng = txm_rng_make(6, (uint64_t)i);
        for (int k = 0; k < 300; k++) {
            const int w = txm_rng_range(&rng, 1, 3), h = txm_rng_range(&rng, 1, 3), periodic = k % 2;
            int given[9], tiles[9], scratch[9];
            for (int t = 0; t < w * h; t++) {
                const int index = (int)txm_rng_below(&rng, (uint32_t)textiles_count(set));
                given[t] = txm_rng_below(&rng, 4) ? -1 : index;
            }
            memcpy(tiles, given, sizeof tiles);
            const txm_status status = textiles_solve(set, w, h, periodic, (uint64_t)k, NULL, tiles);
            const int expected = has_tiling(set, scratch, given, 0, w, h, periodic);
            if ((status == TXM_OK) != expected) fail_msg("case %d, %d: %d", which[i], k, status);
            if (expected) {
                check_joins(set, tiles, w, h, periodic);
                for (int t = 0; t < w * h; t++)
                    if (given[t] >= 0) assert_int_equal(tiles[t], given[t]);
                solved++;
            } else {
                assert_memory_equal(tiles, given, sizeof(int) * (size_t)(w * h));
                assert_true(status == TXM_BAD_ARGUMENT || status == TXM_BAD_DATA);
                refused++;
            }
        }
        textiles_set_free(set);
    }
    assert_true(solved > 300 && refused > 300);
}

/* Without variants a complete set avoids three in a row by its colours, mostly. */
static void test_solve_runs(void **state) {
    (void)state;
    static int tiles[100 * 100];
    for (int kind = TEXTILES_WANG; kind <= TEXTILES_CORNER; kind++) {
        textiles_set *set = make_set((textiles_kind)kind, 2, 1, 0);
        fill(tiles, 100 * 100, -1);
        solve(set, 100, 100, 0, 5, tiles);
        check_usage(tiles, 100 * 100, 16, 6);
        const int runs = count_runs(tiles, 100, 100, 0);
        if (kind == TEXTILES_WANG) assert_int_equal(runs, 0);
        else assert_true(runs < 40);
        textiles_set_free(set);
    }
}

static void refuses_solve(const textiles_set *set, int w, int h, int periodic, const int *given,
                          txm_status expected, const char *words) {
    int tiles[128];
    tk_memory memory = {0};
    txm_env env = tk_env(&memory, NULL);
    const size_t bytes = sizeof(int) * (size_t)(w > 0 && h > 0 && w * h <= 128 ? w * h : 1);
    memcpy(tiles, given, bytes);
    const txm_status status = textiles_solve(set, w, h, periodic, 1, &env, tiles);
    if (status != expected) fail_msg("%s: status %d, %s", words, status, env.message);
    if (!strstr(env.message, words)) fail_msg("'%s' does not say '%s'", env.message, words);
    assert_memory_equal(tiles, given, bytes);
    assert_int_equal(tk_leaks(&memory), 0);
    assert_int_equal(textiles_solve(set, w, h, periodic, 1, NULL, tiles), expected);
}

static void test_solve_refuses(void **state) {
    (void)state;
    int given[128];
    textiles_set *wang = make_set(TEXTILES_WANG, 2, 1, 0);
    textiles_set *reduced = make_set(TEXTILES_WANG, 3, 1, 1);
    textiles_set *corner = make_set(TEXTILES_CORNER, 2, 2, 0);
    textiles_set *triangle = make_set(TEXTILES_TRIANGLE, 2, 1, 0);
    static const int lonely[1][4] = {{0, 1, 0, 0}}, brick[2][4] = {{0, 0, 1, 0}, {1, 0, 0, 0}};
    textiles_set *frame = make_frame(lonely, 1, 2, 1), *bricks = make_frame(brick, 2, 2, 1);
    txm_env env = {0};

    fill(given, 128, -1);
    refuses_solve(NULL, 2, 2, 0, given, TXM_BAD_ARGUMENT, "NULL");
    assert_int_equal(textiles_solve(wang, 2, 2, 0, 1, &env, NULL), TXM_BAD_ARGUMENT);
    refuses_solve(triangle, 2, 2, 0, given, TXM_BAD_ARGUMENT, "triangle");
    refuses_solve(wang, 0, 2, 0, given, TXM_BAD_ARGUMENT, "width");
    refuses_solve(wang, 2, -1, 0, given, TXM_BAD_ARGUMENT, "height");
    refuses_solve(wang, 1 << 20, 1 << 10, 0, given, TXM_TOO_LARGE, "width");
    given[7 * 4 + 3] = 16;
    refuses_solve(wang, 7, 5, 0, given, TXM_BAD_ARGUMENT, "column 3, row 4");
    given[7 * 4 + 3] = -2;
    refuses_solve(corner, 7, 5, 0, given, TXM_BAD_ARGUMENT, "column 3, row 4");

    /* neighbours that do not match; corners that meet at a corner only */
    fill(given, 128, -1);
    given[10] = 0, given[11] = 1; /* east 0, west 1 */
    refuses_solve(wang, 8, 3, 0, given, TXM_BAD_ARGUMENT, "column 3, row 1");
    fill(given, 128, -1);
    given[8 + 2] = 0, given[8 * 2 + 3] = 31;
    refuses_solve(corner, 8, 5, 0, given, TXM_BAD_ARGUMENT, "column 3, row 2");
    /* across the border, and with itself */
    fill(given, 128, -1);
    given[0] = 1, given[7] = 0;
    refuses_solve(wang, 8, 1, 1, given, TXM_BAD_ARGUMENT, "column 7, row 0");
    solve(wang, 8, 1, 0, 1, given);
    given[0] = 1;
    refuses_solve(wang, 1, 1, 1, given, TXM_BAD_ARGUMENT, "column 0, row 0");

    /* given tiles that only propagation finds to contradict: south rises by 0 or 1 from row to row */
    fill(given, 128, -1);
    int up = -1, down = -1;
    for (int t = 0; t < textiles_count(reduced); t++) {
        const textiles_tile tile = tile_at(reduced, t);
        if (tile.edges[2] == 0) up = t;
        if (tile.edges[0] == 2) down = t;
    }
    given[3] = up, given[5 * 2 + 3] = down;
    refuses_solve(reduced, 5, 4, 0, given, TXM_BAD_ARGUMENT, "contradict");
    given[5 * 2 + 3] = -1, given[5 * 3 + 3] = down;
    solve(reduced, 5, 4, 0, 1, given);
    check_joins(reduced, given, 5, 4, 0);

    /* nothing given, but no tiling either; one that exists for even heights only */
    fill(given, 128, -1);
    refuses_solve(frame, 2, 1, 0, given, TXM_BAD_DATA, "no tiling");
    refuses_solve(bricks, 3, 5, 1, given, TXM_BAD_DATA, "tiling");
    solve(bricks, 3, 4, 1, 1, given);
    check_joins(bricks, given, 3, 4, 1);
    fill(given, 128, -1);
    solve(frame, 1, 9, 0, 1, given); /* one below the other they match */
    refuses_solve(frame, 1, 9, 1, given, TXM_BAD_DATA, "no tiling");
    textiles_set_free(wang);
    textiles_set_free(reduced);
    textiles_set_free(corner);
    textiles_set_free(triangle);
    textiles_set_free(frame);
    textiles_set_free(bricks);
}

static void test_solve_faults(void **state) {
    (void)state;
    static call c;
    for (int i = 0; i < SOLVE_CASES; i += 2) {
        c.what = 0;
        c.set = solve_case(i);
        fill(c.in, 4096, -1);
        check_faults(&c);
        textiles_set_free(c.set);
    }
}

/* Cancelled in the middle of a long search. */
static txm_status search_long(void *context, txm_env *env) {
    static int tiles[200 * 200];
    fill(tiles, 200 * 200, -1);
    const txm_status status =
        textiles_solve((const textiles_set *)context, 200, 200, 1, 1, env, tiles);
    if (status != TXM_OK) assert_filled(tiles, 200 * 200, -1);
    return status;
}

static void test_solve_cancel_search(void **state) {
    (void)state;
    long points = 0;
    for (int i = 0; i < 8; i += 4) {
        textiles_set *set = solve_case(i);
        const long reports = tk_sweep(search_long, set, TK_CANCEL);
        assert_true(reports > 0);
        points += reports;
        textiles_set_free(set);
    }
    assert_true(points > 8);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_scanline),
        cmocka_unit_test(test_scanline_runs),
        cmocka_unit_test(test_scanline_refuses),
        cmocka_unit_test(test_solve),
        cmocka_unit_test(test_solve_is_exact),
        cmocka_unit_test(test_solve_runs),
        cmocka_unit_test(test_solve_refuses),
        cmocka_unit_test(test_solve_faults),
        cmocka_unit_test(test_solve_cancel_search),
    };
    return cmocka_run_group_tests_name("textiles_grid", tests, NULL, NULL);
}
