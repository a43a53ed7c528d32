/* test_texpatch_places.c - where pixels come from: pieces, maps in register, novelty, passes
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texpatch_places && build/tests/unit/test_texpatch_places */
#include "patchkit.h"

/* ---- where pixels come from ------------------------------------------------------------- */

static void test_places(void **state) {
    (void)state;
    const txm_image gravel = draw_gravel(64, 56, 3, 0), bricks = draw_bricks(112, 96, 28, 16);
    const texpatch_exemplar small = exemplar_of(&gravel), large = exemplar_of(&bricks);
    texpatch_desc d = desc_of(&small, 1, 1, 101, 96);
    for (int which = 0; which < 3; which++) {
        if (which == 1) d = desc_of(&large, 1, 1, 130, 120);
        if (which == 2) d.passes = -1;
        texpatch_job *job = begin(&d);
        assert_true(texpatch_source_at(job, 3, 3).exemplar == -1); /* nothing yet */
        run_but_one(job, &d);
        check_places(job, &d, 0);
        assert_int_equal(texpatch_source_at(job, -1, 0).exemplar, -1);
        assert_int_equal(texpatch_source_at(job, 0, d.height).exemplar, -1);
        assert_int_equal(texpatch_source_at(NULL, 0, 0).exemplar, -1);

        /* a window is a part of the whole */
        const txm_image all = drawn(job, 0, &gravel, d.width, d.height);
        const txm_image part = new_image(23, 31, 3, TXM_U8);
        assert_int_equal(texpatch_draw(job, 0, 40, 50, NULL, part), TXM_OK);
        for (int i = 0; i < 23 * 31; i++)
            assert_true(is_pixel(&part, i % 23, i / 23, &all, 40 + i % 23, 50 + i / 23));
        texpatch_free(job);
    }
}

/* Exemplars and their turned forms lie one below the other, higher than 16 bits tell with a sign. */
static void test_high(void **state) {
    (void)state;
    tk_wide();
    enum { COUNT = 8, WIDE = 32, HIGH = 1100 };
    const txm_image gravel = draw_gravel(WIDE, HIGH, 1, 0);
    texpatch_exemplar e[COUNT];
    for (int i = 0; i < COUNT; i++) e[i] = exemplar_of(&gravel);
    texpatch_desc d = desc_of(e, COUNT, 1, 48, 48);
    d.turns = 2;
    d.mirror = 1;
    d.passes = -1;
    assert_true(COUNT * HIGH * 4 > INT16_MAX);
    texpatch_job *job = begin(&d);
    run_but_one(job, &d);
    check_places(job, &d, 0);
    int last = 0;
    for (int i = 0; i < 48 * 48; i++) last += texpatch_source_at(job, i % 48, i / 48).exemplar == COUNT - 1;
    assert_true(last > 0);
    texpatch_free(job);
}

/* With turns and mirrored pieces: neighbours in a piece are neighbours in the exemplar, in the
   direction that the turn says. */
static void test_turns(void **state) {
    (void)state;
    enum { W = 80, H = 72 };
    const txm_image gravel = draw_gravel(40, 36, 3, 0);
    const texpatch_exemplar e = exemplar_of(&gravel);
    /* one pixel to the right, in the exemplar, after so many turns counter-clockwise */
    static const int right[4][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
    static const int down[4][2] = {{0, 1}, {-1, 0}, {0, -1}, {1, 0}};
    for (int which = 0; which < 4; which++) {
        texpatch_desc d = desc_of(&e, 1, 1, W, H);
        int seen[8] = {0};
        d.passes = 1;
        d.turns = which == 3 ? 2 : which == 2 ? 0 : 4;
        d.mirror = which > 0;
        texpatch_job *job = begin(&d);
        run_but_one(job, &d);
        check_places(job, &d, 0);
        const texpatch_source *s = sources_of(job, W, H);
        int pairs = 0, good = 0;
        for (int y = 0; y + 1 < H; y++) {
            for (int x = 0; x + 1 < W; x++) {
                const texpatch_source a = s[y * W + x];
                seen[a.turn & 7]++;
                assert_true(a.turn >= 0 && a.turn < 8);
                for (int k = 0; k < 2; k++) {
                    const texpatch_source b = k ? s[(y + 1) * W + x] : s[y * W + x + 1];
                    const int *way = k ? down[a.turn % 4] : right[a.turn % 4];
                    if (a.turn != b.turn) continue;
                    pairs++;
                    good += (int)(b.x - a.x) == (a.turn > 3 ? -way[0] : way[0]) &&
                            (int)(b.y - a.y) == way[1];
                }
            }
        }
        assert_between("neighbours that go on", (double)good / pairs, 0.6, 1);
        for (int t = 0; t < 8; t++) {
            const int wanted =
                (t % 4 == 0 || d.turns == 4 || (d.turns == 2 && t % 2 == 0)) && (t < 4 || d.mirror);
            if (wanted != (seen[t] > 0)) fail_msg("%d: turn %d of %d pixels", which, t, seen[t]);
        }
        texpatch_free(job);
    }
}

/* The sample type changes nothing but the samples. */
static void test_samples(void **state) {
    (void)state;
    tk_wide();
    for (int channels = 1; channels <= 4; channels++) {
        txm_image forms[4];
        const texpatch_source *first = NULL;
        forms[0] = draw_gravel(40, 48, channels, channels);
        memset(forms[0].pixels, 255, (size_t)channels); /* floats span 0..1 like the bytes */
        forms[1] = converted(&forms[0], TXM_U16, 1, 0);
        forms[2] = converted(&forms[0], TXM_F32, 1, 0);
        forms[3] = converted(&forms[0], TXM_F32, 8, -3);
        for (int f = channels % 2 ? 0 : 2; f < 4; f++) {
            const texpatch_exemplar e = exemplar_of(&forms[f]);
            texpatch_desc d = desc_of(&e, 1, 1, 96, 64);
            const texpatch_map data = {1, 0, 0, 1}; /* of 2 and 4 channels the last is no alpha */
            d.maps = &data;
            d.passes = 1;
            texpatch_job *job = begin(&d);
            run_but_one(job, &d);
            check_places(job, &d, 0);
            int more = 1;
            assert_int_equal(texpatch_step(job, NULL, &more), TXM_OK);
            assert_int_equal(more, 0);
            const texpatch_source *s = sources_of(job, 96, 64);
            if (!first) first = s;
            else if (f < 3) assert_memory_equal(first, s, 96 * 64 * sizeof *s);
            const txm_image out = drawn(job, 0, &forms[f], 96, 64);
            float low = 9, high = -9;
            for (int i = 0; i < 40 * 48 * channels; i++) {
                const float v =
                    txm_image_get(&forms[f], i / channels % 40, i / channels / 40, i % channels);
                low = txm_minf(low, v);
                high = txm_maxf(high, v);
            }
            if (f == 3) assert_true(low < -1 && high > 2);
            for (int c = 0; c < channels; c++) {
                for (int i = 0; i < 96 * 64; i++) {
                    const float v = txm_image_get(&out, i % 96, i / 96, c);
                    assert_true(v >= low && v <= high);
                }
                const double unit = f == 3 ? 8 : 1;
                assert_between("mean against the exemplar's",
                               (mean_of(&out, c) - mean_of(&forms[f], c)) / unit, -0.1, 0.1);
            }
            /* nothing is blurred: neighbours have as much contrast as in the exemplar */
            double own = 0, theirs = 0;
            for (int i = 0; i < 96 * 64; i++)
                if (i % 96) own += step(&out, i % 96, i / 96, i % 96 - 1, i / 96);
            for (int i = 0; i < 40 * 48; i++)
                if (i % 40) theirs += step(&forms[f], i % 40, i / 40, i % 40 - 1, i / 40);
            assert_between("contrast", own / (95 * 64) / (theirs / (39 * 48)), 0.85, 1.15);
            texpatch_free(job);
        }
    }
}

/* Unusual sizes and strides. */
static void test_sizes(void **state) {
    (void)state;
    tk_wide();
    static const int sizes[6][2] = {{1, 1}, {1, 300}, {300, 1}, {33, 97}, {2, 2}, {131, 67}};
    const txm_image gravel = draw_gravel(37, 53, 3, 0), turned = flipped(&gravel);
    const texpatch_exemplar e = exemplar_of(&gravel), f = exemplar_of(&turned);
    for (int i = 0; i < 6; i++) {
        texpatch_desc d = desc_of(&e, 1, 1, sizes[i][0], sizes[i][1]);
        d.passes = i % 2 ? -1 : 1;
        const txm_image out = made(&d, NULL);
        texpatch_job *job = begin(&d);
        run_but_one(job, &d);
        check_places(job, &d, 0);
        texpatch_free(job);

        /* bottom-up, with gaps between the rows */
        const int row = d.width * 3 + 5;
        uint8_t *pixels = (uint8_t *)need((size_t)(row * d.height));
        memset(pixels, FILL, (size_t)(row * d.height));
        txm_image upside = view(pixels + row * (d.height - 1), d.width, d.height, 3, TXM_U8);
        upside.stride = -row;
        d.exemplars = &f;
        assert_int_equal(texpatch_make(&d, NULL, &upside), TXM_OK);
        assert_true(is_same(&out, &upside));
        for (int y = 0; y < d.height; y++) {
            for (int k = 0; k < 5; k++) assert_int_equal(pixels[y * row + d.width * 3 + k], FILL);
        }
    }
}

static void test_seeds_and_threads(void **state) {
    (void)state;
    tk_wide();
    const txm_image gravel = draw_gravel(96, 96, 3, 0), bricks = draw_bricks(96, 96, 24, 16);
    enum { OPEN, BRICKS, ODD_TORUS, CASES };
    for (int which = 0; which < CASES; which++) {
        const texpatch_exemplar e = exemplar_of(which == BRICKS ? &bricks : &gravel);
        texpatch_desc d = desc_of(&e, 1, 1, 96, which == ODD_TORUS ? 135 : 136);
        txm_env env = {0};
        if (which == ODD_TORUS) d.tileable = TEXPATCH_TILE_X | TEXPATCH_TILE_Y;
        const txm_image first = made(&d, NULL), again = made(&d, NULL);
        assert_true(is_same(&first, &again));
        env.parallel_for = tk_parallel_reverse;
        const txm_image reversed = made(&d, &env);
        assert_true(is_same(&first, &reversed));
        env.parallel_for = tk_parallel_threads;
        const txm_image threads = made(&d, &env);
        assert_true(is_same(&first, &threads));
        d.seed++;
        const txm_image other = made(&d, NULL);
        int same = 0;
        for (int i = 0; i < d.width * d.height; i++)
            same += is_pixel(&first, i % d.width, i / d.width, &other, i % d.width, i / d.width);
        assert_between("pixels that another seed leaves", same / (1.0 * d.width * d.height), 0, 0.2);
    }
}

/* ---- maps in register ------------------------------------------------------------------- */

/* The exemplar of four maps: gravel, normals, hills, numbers as labels. */
static texpatch_map kinds[4];
static void draw_maps(int width, int height, int sense, txm_image maps[4]) {
    maps[0] = draw_gravel(width, height, 3, 0);
    maps[2] = draw_hills(width, height);
    maps[1] = draw_normals(&maps[2], sense, TXM_U8);
    maps[3] = draw_numbers(width, height);
    memset(kinds, 0, sizeof kinds);
    kinds[0].weight = 1;
    kinds[1].is_normal = sense;
    kinds[2].is_data = 1;
    kinds[3].is_label = 1;
}

static void test_register(void **state) {
    (void)state;
    for (int which = 0; which < 3; which++) {
        const int w = which ? 40 : 96, h = which ? 48 : 100, side = which ? 80 : 112;
        const int sense = which == 2 ? 2 : 1;
        txm_image maps[4];
        draw_maps(w, h, sense, maps);
        const texpatch_exemplar e = exemplar_of(maps);
        texpatch_desc d = desc_of(&e, 1, 4, side, side);
        d.maps = kinds;
        d.turns = which ? 4 : 1;
        d.mirror = which > 0;
        kinds[2].weight = which == 1 ? 0.5f : 0;
        texpatch_job *job = begin(&d);
        run_but_one(job, &d);
        check_places(job, &d, 0);
        check_places(job, &d, 2);
        check_places(job, &d, 3);
        if (which == 0) check_places(job, &d, 1);

        /* normals agree with the hills that are drawn, where those are one piece around a pixel */
        const txm_image normals = drawn(job, 1, &maps[1], side, side);
        const txm_image hills = drawn(job, 2, &maps[2], side, side);
        const texpatch_source *s = sources_of(job, side, side);
        int compared = 0, of_turn[8] = {0};
        check_lengths(&normals);
        for (int y = 1; y + 1 < side; y++) {
            for (int x = 1; x + 1 < side; x++) {
                const int i = y * side + x, next[4] = {i - 1, i + 1, i - side, i + side};
                int inside =
                    s[i].x > 0 && s[i].y > 0 && s[i].x < (float)(w - 1) && s[i].y < (float)(h - 1);
                for (int k = 0; k < 4; k++) inside &= s[next[k]].turn == s[i].turn;
                const float rx = s[i + 1].x - s[i].x, ry = s[i + 1].y - s[i].y;
                const float dx = s[i + side].x - s[i].x, dy = s[i + side].y - s[i].y;
                if (!inside || fabsf(rx) + fabsf(ry) != 1 || s[i - 1].x != s[i].x - rx ||
                    s[i - 1].y != s[i].y - ry || s[i - side].x != s[i].x - dx ||
                    s[i - side].y != s[i].y - dy || rx * dy - ry * dx != (s[i].turn < 4 ? 1 : -1))
                    continue;
                const txm_vec3 n = normal_of(&hills, x, y, sense);
                const float v[3] = {n.x, n.y, n.z};
                compared++;
                of_turn[s[i].turn]++;
                for (int c = 0; c < 3; c++) {
                    const double sample = (double)txm_image_get(&normals, x, y, c);
                    const double got = txm_normal_decode(sample, normals.sample);
                    if (!(fabs(got - (double)v[c]) < 0.02))
                        fail_msg("(%d, %d) turn %d channel %d: %g, not %g", x, y, s[i].turn, c, got,
                                 (double)v[c]);
                }
            }
        }
        assert_between("normals compared", compared / (double)(side * side), 0.3, 1);
        for (int t = 0; t < (which ? 8 : 1); t++) assert_true(of_turn[t] > 10);

        /* bent and blended: labels stay labels, and all maps still show the same place */
        int more = 1;
        assert_int_equal(texpatch_step(job, NULL, &more), TXM_OK);
        const txm_image late = drawn(job, 1, &maps[1], side, side);
        const txm_image data = drawn(job, 2, &maps[2], side, side);
        const txm_image names = drawn(job, 3, &maps[3], side, side);
        int bent = 0;
        check_lengths(&late);
        for (int i = 0; i < side * side; i++) {
            const texpatch_source p = texpatch_source_at(job, i % side, i / side);
            const int name = ((const uint16_t *)names.pixels)[i] - 1;
            assert_true(name >= 0 && name < w * h);
            /* a place halfway between two pixels may be rounded either way */
            assert_true(fabsf((float)(name % w) - p.x) <= 0.501f);
            assert_true(fabsf((float)(name / w) - p.y) <= 0.501f);
            bent += !is_whole(p);
            if (is_whole(p) && kinds[2].weight == 0)
                assert_true(is_pixel(&data, i % side, i / side, &maps[2], (int)p.x, (int)p.y));
        }
        assert_between("pixels bent", bent / (double)(side * side), 0.001, 0.99);
        texpatch_free(job);
    }
}

/* ---- novelty, passes, patches ----------------------------------------------------------- */

/* share of neighbouring pixels that are neighbours in the exemplar too */
static double share_together(const texpatch_job *job, int width, int height) {
    int together = 0, all = 0;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            const texpatch_source a = texpatch_source_at(job, x, y);
            for (int k = 0; k < 2; k++) {
                const int u = x + !k, v = y + k;
                if (u >= width || v >= height) continue;
                const texpatch_source b = texpatch_source_at(job, u, v);
                all++;
                together +=
                    b.exemplar == a.exemplar && b.x == a.x + (float)!k && b.y == a.y + (float)k;
            }
        }
    }
    return together / (double)all;
}

static void test_novelty(void **state) {
    (void)state;
    const txm_image gravel = draw_gravel(96, 96, 3, 0);
    const texpatch_exemplar e = exemplar_of(&gravel);
    double share[3], contrast[3];
    for (int i = 0; i < 3; i++) {
        texpatch_desc d = desc_of(&e, 1, 1, 112, 112);
        d.novelty = (float)i * 0.5f;
        texpatch_job *job = begin(&d);
        run_but_one(job, &d);
        check_places(job, &d, 0);
        share[i] = share_together(job, 112, 112);
        show("share of neighbours kept together", share[i]);
        const txm_image out = drawn(job, 0, &gravel, 112, 112);
        double sum[2] = {0, 0}, count[2] = {0, 0};
        add_steps(&out, 0, sum, count);
        contrast[i] = sum[0] / count[0];
        texpatch_free(job);
    }
    assert_true(share[1] < share[0] - 0.003 && share[2] < share[1] - 0.02);
    assert_between("contrast left", contrast[2] / contrast[0], 0.75, 1.25);
}

static void test_passes(void **state) {
    (void)state;
    static const int passes[4] = {-1, 1, 4, 16}, patches[5] = {1, 8, 16, 28, 16384};
    const txm_image gravel = draw_gravel(48, 44, 3, 0);
    const txm_image least = draw_gravel(40, 36, 3, 0);
    const texpatch_exemplar e = exemplar_of(&gravel), f = exemplar_of(&least);
    int steps = 0;
    for (int i = 0; i < 4; i++) { /* the more passes, the more steps */
        texpatch_desc d = desc_of(&f, 1, 1, 56, 48);
        d.passes = passes[i];
        texpatch_job *job = begin(&d);
        const int n = run(job);
        assert_true(n > steps);
        assert_int_equal(run(job), 1); /* nothing is left to do */
        steps = n;
        texpatch_free(job);
        job = begin(&d);
        run_but_one(job, &d);
        check_places(job, &d, 0);
        texpatch_free(job);
    }
    double last = 0;
    for (int i = 0; i < 5; i++) { /* the larger the patches, the larger the pieces */
        texpatch_desc d = desc_of(&e, 1, 1, 80, 80);
        d.passes = -1;
        d.patch = patches[i];
        texpatch_job *job = begin(&d);
        int more = 1;
        assert_int_equal(texpatch_step(job, NULL, &more), TXM_OK);
        check_places(job, &d, 0);
        const double share = share_together(job, 80, 80);
        show("share of neighbours kept together", share);
        if (i > 1 && i < 4) assert_true(share > last);
        last = share;
        texpatch_free(job);
        d.tileable = 3;
        d.width = 32;
        d.height = 33;
        made(&d, NULL); /* patches become as small as the torus requires */
    }

    /* a patch larger than the canvas is reduced to its size */
    const txm_image small = draw_gravel(64, 64, 1, 0);
    const texpatch_exemplar only = exemplar_of(&small);
    texpatch_desc tiny = desc_of(&only, 1, 1, 1, 1);
    tiny.patch = 40;
    tiny.passes = -1;
    made(&tiny, NULL);
}

/* ---- all tests -------------------------------------------------------------------------- */

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(test_places, release_all),
        cmocka_unit_test_teardown(test_high, release_all),
        cmocka_unit_test_teardown(test_turns, release_all),
        cmocka_unit_test_teardown(test_samples, release_all),
        cmocka_unit_test_teardown(test_sizes, release_all),
        cmocka_unit_test_teardown(test_seeds_and_threads, release_all),
        cmocka_unit_test_teardown(test_register, release_all),
        cmocka_unit_test_teardown(test_novelty, release_all),
        cmocka_unit_test_teardown(test_passes, release_all),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
