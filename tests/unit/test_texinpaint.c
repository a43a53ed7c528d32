/* test_texinpaint.c - completing pictures and textures of meshes: what is promised of every result
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texinpaint && build/tests/unit/test_texinpaint */
#include "paintkit.h"

/* ---- what is completed and what is kept ---------------------------------------------------- */

/* No colour of the pictures below; in all holes beforehand. */
static const uint8_t sentinel[4] = {255, 0, 255, 0};

static void dig(uint8_t *pixels, int channels) {
    for (int i = 0; i < PIXELS; i++) {
        if (mask[i]) memcpy(pixels + i * channels, sentinel, (size_t)channels);
    }
}

static int sentinels(const uint8_t *pixels, int channels) {
    int n = 0;
    for (int i = 0; i < PIXELS; i++) n += memcmp(pixels + i * channels, sentinel, (size_t)channels) == 0;
    return n;
}

static void test_nothing_is_missing(void **state) {
    (void)state;
    static const float points[6] = {1, 1, 0, 60, 60, 0};
    const texinpaint_line line = {points, 2};
    draw_stripes(picture, 3);
    no_mask();
    texinpaint_desc d = desc_of(picture, 3, TXM_U8);
    for (int prior = 0; prior < 2; prior++) {
        d.prior = prior ? TEXINPAINT_PRIOR_LINES : TEXINPAINT_PRIOR_NONE;
        d.lines = &line;
        d.line_count = prior;
        memset(result, FILL, sizeof result);
        complete_bytes(&d, result);
        assert_memory_equal(result, picture, 3 * PIXELS);
    }
    plane_of_two();
    use_mesh(&d);
    memset(result, FILL, sizeof result);
    complete_bytes(&d, result);
    assert_memory_equal(result, picture, 3 * PIXELS);
}

/* Each structure: known pixels stay, all missing ones are written. */
static void test_stripes(void **state) {
    (void)state;
    static uint8_t truth[3 * PIXELS];
    draw_stripes(truth, 3);
    disk(30, 34, 13);
    memcpy(picture, truth, sizeof truth);
    dig(picture, 3);
    texinpaint_desc d = desc_of(picture, 3, TXM_U8);
    for (d.structure = TEXINPAINT_AUTO; d.structure <= TEXINPAINT_PATTERN; d.structure++) {
        complete_bytes(&d, result);
        check_known(result, picture, 3);
        assert_int_equal(sentinels(result, 3), 0);
        const double error = error_in_hole(result, truth, 3);
        if (error > 20) fail_msg("structure %d: error %.1f", d.structure, error);
    }
}

/* Sides that no power of two divides, channels, very small ones: a status, and nothing else changed. */
static void test_odd_pictures(void **state) {
    (void)state;
    static const int sides[7][2] = {{1, 1}, {2, 1}, {7, 9}, {8, 8}, {9, 33}, {61, 20}, {64, 3}};
    for (int k = 0; k < 28; k++) {
        const int w = sides[k / 4][0], h = sides[k / 4][1], n = 1 + k % 4;
        texinpaint_desc d;
        txm_env env = {0};
        memset(&d, 0, sizeof d);
        d.image = view(picture, w, h, n, TXM_U8);
        d.mask = view(mask, w, h, 1, TXM_U8);
        const txm_image out = view(result, w, h, n, TXM_U8);
        for (int i = 0; i < w * h * n; i++) picture[i] = (uint8_t)(100 + at_random(i, 1, n) % 50);
        for (int i = 0; i < w * h; i++) mask[i] = (uint8_t)(i % w > w / 3 && i % w <= w / 2 && i / w <= h / 2 ? 255 : 0);
        memset(result, FILL, sizeof result);
        const txm_status status = texinpaint_complete(&d, &env, &out);
        if (status != TXM_OK) fail_msg("%d x %d: %s", w, h, env.message);
        for (int i = 0; i < w * h; i++) {
            if (!mask[i]) assert_memory_equal(result + i * n, picture + i * n, (size_t)n);
        }
        assert_int_equal(result[w * h * n], FILL);
    }
}

static void test_grain_stays(void **state) {
    (void)state;
    double sum[2] = {0, 0}, square[2] = {0, 0};
    int n[2] = {0, 0};
    for (int i = 0; i < PIXELS; i++) picture[i] = (uint8_t)(60 + at_random(i % SIDE, i / SIDE, 3) / 2);
    disk(32, 32, 14);
    dig(picture, 1);
    texinpaint_desc d = desc_of(picture, 1, TXM_U8);
    complete_bytes(&d, result);
    for (int i = 0; i < PIXELS; i++) {
        const int hole = mask[i] != 0;
        sum[hole] += result[i];
        square[hole] += result[i] * (double)result[i];
        n[hole]++;
    }
    double spread[2];
    for (int k = 0; k < 2; k++) spread[k] = sqrt(square[k] / n[k] - sum[k] / n[k] * (sum[k] / n[k]));
    if (!(spread[1] > 0.85 * spread[0] && spread[1] < 1.15 * spread[0]))
        fail_msg("deviation %.1f of %.1f", spread[1], spread[0]);
    assert_true(fabs(sum[1] / n[1] - sum[0] / n[0]) < 8);
    /* another seed, another completion; the same seed, the same */
    d.seed = 2;
    complete_bytes(&d, other);
    assert_memory_not_equal(result, other, PIXELS);
    d.seed = 1;
    complete_bytes(&d, other);
    assert_memory_equal(result, other, PIXELS);
}

/* ---- maps ------------------------------------------------------------------------------------ */

/* A map of labels says where each pixel comes from. */
static void test_source_is_honoured(void **state) {
    (void)state;
    static uint8_t half[PIXELS], half_out[PIXELS], source[2 * PIXELS];
    texinpaint_map map;
    memset(&map, 0, sizeof map);
    map.image = view(half, SIDE, SIDE, 1, TXM_U8);
    map.is_label = 1;
    draw_stripes(picture, 3);
    disk(36, 30, 12);
    for (int i = 0; i < PIXELS; i++) {
        half[i] = (uint8_t)(mask[i] ? 99 : i % SIDE < 32 ? 3 : 200);
        source[2 * i] = (uint8_t)(i % SIDE < 32 ? 255 : 0);
        source[2 * i + 1] = 200; /* gray times alpha */
    }
    dig(picture, 3);
    texinpaint_desc d = desc_of(picture, 3, TXM_U8);
    const txm_image out[2] = {view(result, SIDE, SIDE, 3, TXM_U8), view(half_out, SIDE, SIDE, 1, TXM_U8)};
    d.maps = &map;
    d.map_count = 1;
    d.source = view(source, SIDE, SIDE, 2, TXM_U8);
    for (int side = 0; side < 2; side++) {
        complete(&d, out);
        check_known(half_out, half, 1);
        for (int i = 0; i < PIXELS; i++) {
            if (mask[i]) assert_int_equal(half_out[i], side ? 200 : 3);
        }
        for (int i = 0; i < PIXELS; i++) source[2 * i] = (uint8_t)~source[2 * i];
    }
    d.source.pixels = NULL; /* anywhere: but no label that there is not */
    complete(&d, out);
    for (int i = 0; i < PIXELS; i++) assert_true(half_out[i] == 3 || half_out[i] == 200);
}

/* Copies of a picture in other sample types stay copies: exact, or within a level. */
static void test_maps_in_register(void **state) {
    (void)state;
    static uint8_t copy[3 * PIXELS], copy_out[3 * PIXELS];
    static uint16_t deep[3 * PIXELS], deep_out[3 * PIXELS];
    static float real[3 * PIXELS], real_out[3 * PIXELS];
    texinpaint_map maps[3];
    memset(maps, 0, sizeof maps);
    draw_stripes(picture, 3);
    disk(30, 30, 12);
    dig(picture, 3);
    for (int i = 0; i < 3 * PIXELS; i++) {
        copy[i] = picture[i];
        deep[i] = (uint16_t)(picture[i] * 257);
        real[i] = (float)(picture[i] * 2.0 / 255 - 3); /* any range of values */
    }
    maps[0].image = view(copy, SIDE, SIDE, 3, TXM_U8);
    maps[1].image = view(deep, SIDE, SIDE, 3, TXM_U16);
    maps[2].image = view(real, SIDE, SIDE, 3, TXM_F32);
    const txm_image out[4] = {view(result, SIDE, SIDE, 3, TXM_U8), view(copy_out, SIDE, SIDE, 3, TXM_U8),
                              view(deep_out, SIDE, SIDE, 3, TXM_U16), view(real_out, SIDE, SIDE, 3, TXM_F32)};
    texinpaint_desc d = desc_of(picture, 3, TXM_U8);
    d.maps = maps;
    d.map_count = 3;
    complete(&d, out);
    assert_memory_equal(result, copy_out, sizeof copy_out);
    check_known(deep_out, deep, 6);
    check_known(real_out, real, 12);
    for (int i = 0; i < 3 * PIXELS; i++) {
        assert_true(fabs(deep_out[i] / 257.0 - result[i]) <= 1);
        assert_true(fabs((real_out[i] + 3.0) * 255 / 2 - result[i]) <= 1);
    }
    /* by itself, a picture of 16 bits is completed as one of 8 bits is */
    texinpaint_desc e = desc_of(deep, 3, TXM_U16);
    memset(deep_out, 0, sizeof deep_out);
    complete(&e, &out[2]);
    for (int i = 0; i < 3 * PIXELS; i++) assert_true(fabs(deep_out[i] / 257.0 - result[i]) <= 1);
}

/* Rings, and normals that point away from their centre: also where pieces are turned or mirrored. */
static void test_normals_turn(void **state) {
    (void)state;
    tk_wide();
    static uint8_t normal[3 * PIXELS], normal_out[3 * PIXELS];
    texinpaint_map map;
    memset(&map, 0, sizeof map);
    for (int down = 1; down <= 2; down++) {
        disk(44, 44, 9);
        for (int i = 0; i < PIXELS; i++) {
            const double x = i % SIDE - 31.5, y = i / SIDE - 31.5, r = sqrt(x * x + y * y);
            picture[i] = (uint8_t)(120 + 60 * sin(r * 0.6) + at_random(i % SIDE, i / SIDE, 2) % 6);
            const double nx = 0.6 * x / r, ny = 0.6 * y / r * (down == 2 ? 1 : -1);
            normal[3 * i] = (uint8_t)(127.5 * nx + 128);
            normal[3 * i + 1] = (uint8_t)(127.5 * ny + 128);
            normal[3 * i + 2] = (uint8_t)(127.5 * 0.8 + 128);
            if (mask[i]) memset(normal + 3 * i, 0, 3);
        }
        texinpaint_desc d = desc_of(picture, 1, TXM_U8);
        const txm_image out[2] = {view(result, SIDE, SIDE, 1, TXM_U8), view(normal_out, SIDE, SIDE, 3, TXM_U8)};
        map.image = view(normal, SIDE, SIDE, 3, TXM_U8);
        map.is_normal = down;
        d.maps = &map;
        d.map_count = 1;
        complete(&d, out);
        check_known(normal_out, normal, 3);
        double worst = 1, sum = 0;
        int n = 0;
        for (int i = 0; i < PIXELS; i++) {
            if (!mask[i]) continue;
            double v[3], length = 0;
            for (int c = 0; c < 3; c++) v[c] = normal_out[3 * i + c] / 127.5 - 1;
            for (int c = 0; c < 3; c++) length += v[c] * v[c];
            assert_true(fabs(sqrt(length) - 1) < 0.02);
            const double x = i % SIDE - 31.5, y = i / SIDE - 31.5, r = sqrt(x * x + y * y);
            const double along = 0.6 * x / r * v[0] + 0.6 * y / r * (down == 2 ? 1 : -1) * v[1] + 0.8 * v[2];
            worst = fmin(worst, along);
            sum += along;
            n++;
        }
        if (!(sum / n > 0.9)) fail_msg("cosine %.3f, %.3f in the mean", worst, sum / n);
    }
}

/* Transparent pixels are magenta, opaque ones are green: magenta must not show. */
static void test_alpha(void **state) {
    (void)state;
    disk(32, 32, 10);
    for (int i = 0; i < PIXELS; i++) {
        const int clear = (i % SIDE + i / SIDE / 2) / 12 % 2, g = at_random(i % SIDE, i / SIDE, 0) % 20;
        const uint8_t p[4] = {(uint8_t)(clear ? 255 : 10), (uint8_t)(clear ? 0 : 150 + g),
                              (uint8_t)(clear ? 255 : 10), (uint8_t)(clear ? 0 : 255)};
        memcpy(picture + 4 * i, p, 4);
        if (mask[i]) memset(picture + 4 * i, 77, 4);
    }
    texinpaint_desc d = desc_of(picture, 4, TXM_U8);
    for (int is_mesh = 0; is_mesh < 2; is_mesh++) { /* where it is interpolated, too */
        uint32_t v[25];
        const double at[2] = {0.3, 0.4}, x[2] = {60, 10}, y[2] = {-8, 50};
        memset(&mesh, 0, sizeof mesh);
        grid_vertices(v, 4, 4, 0, 0, 60, 60);
        add_chart(v, 4, 4, at, x, y);
        if (is_mesh) use_mesh(&d);
        complete_bytes(&d, result);
        int opaque = 0, clear = 0;
        for (int i = 0; i < PIXELS; i++)
            if (!mask[i]) assert_memory_equal(result + 4 * i, picture + 4 * i, 4);
        memcpy(other, picture, sizeof picture);
        for (int i = 0; i < PIXELS; i++) /* what is hidden makes no difference */
            if (!mask[i] && !picture[4 * i + 3]) memset(other + 4 * i, at_random(i, 1, 3), 3);
        texinpaint_desc e = d;
        e.image.pixels = other;
        static uint8_t again[4 * PIXELS];
        complete_bytes(&e, again);
        for (int i = 0; i < PIXELS; i++)
            assert_memory_equal(again + 4 * i, (mask[i] ? result : other) + 4 * i, 4);
        for (int i = 0; i < PIXELS; i++) {
            const uint8_t *p = result + 4 * i;
            if (!mask[i]) continue;
            opaque += p[3] > 128;
            clear += p[3] < 10;
            const int limit = p[3] > 60 || !p[3] ? 40 : 255; /* of faint ones few bits are left */
            if (p[0] > limit || p[2] > limit) fail_msg("%d %d %d %d", p[0], p[1], p[2], p[3]);
        }
        assert_true(opaque > 60 && clear > 30);
    }
}

/* ---- layouts, threads, steps ------------------------------------------------------------------- */

static void test_strides_and_in_place(void **state) {
    (void)state;
    enum { ROW = 3 * SIDE + 13 };
    static uint8_t rows[ROW * SIDE], rows_out[ROW * SIDE], upside[PIXELS];
    draw_stripes(picture, 3);
    disk(28, 34, 10);
    texinpaint_desc d = desc_of(picture, 3, TXM_U8);
    complete_bytes(&d, result);
    memset(rows, FILL, sizeof rows);
    memset(rows_out, FILL, sizeof rows_out);
    for (int y = 0; y < SIDE; y++) {
        memcpy(rows + ROW * (SIDE - 1 - y), picture + 3 * SIDE * y, 3 * SIDE);
        memcpy(upside + SIDE * (SIDE - 1 - y), mask + SIDE * y, SIDE);
    }
    texinpaint_desc e = d;
    e.image.pixels = rows + ROW * (SIDE - 1);
    e.image.stride = -ROW;
    e.mask.pixels = upside + SIDE * (SIDE - 1);
    e.mask.stride = -SIDE;
    txm_image out = view(rows_out, SIDE, SIDE, 3, TXM_U8);
    out.stride = ROW;
    complete(&e, &out);
    for (int y = 0; y < SIDE; y++) {
        assert_memory_equal(rows_out + ROW * y, result + 3 * SIDE * y, 3 * SIDE);
        for (int x = 3 * SIDE; x < ROW; x++) assert_int_equal(rows_out[ROW * y + x], FILL);
    }
    complete(&e, &e.image); /* in place */
    for (int y = 0; y < SIDE; y++)
        assert_memory_equal(rows + ROW * (SIDE - 1 - y), result + 3 * SIDE * y, 3 * SIDE);
}

/* two disks and a plane of two charts, so that there is something of everything */
static texinpaint_desc plane_desc(double radius) {
    texinpaint_desc d = desc_of(picture, 3, TXM_U8);
    plane_of_two();
    draw_plane(picture, 28, 14, radius);
    use_mesh(&d);
    return d;
}

static void test_same_bytes_for_any_threads(void **state) {
    (void)state;
    tk_wide();
    static int counts[3] = {1, 2, 3};
    for (int k = 0; k < 8; k++) {
        texinpaint_desc d = desc_of(picture, 3, TXM_U8);
        const txm_image out = view(k % 4 ? other : result, SIDE, SIDE, 3, TXM_U8);
        txm_env env = {0};
        draw_stripes(picture, 3);
        disk(32, 30, 8);
        if (k >= 4) d = plane_desc(6);
        env.parallel_for = k % 4 == 0 ? NULL : k % 4 == 1 ? tk_parallel_reverse : tk_parallel_threads;
        env.parallel_user = &counts[k % 4 - (k % 4 > 0)];
        assert_int_equal(texinpaint_complete(&d, &env, &out), TXM_OK);
        if (k % 4) assert_memory_equal(result, other, 3 * PIXELS);
    }
}

static int pictures_shown;
static void count_shown(void *user, const char *name, const txm_image *shown) {
    assert_ptr_equal(user, &pictures_shown);
    assert_true(name[0] && shown->pixels && shown->width > 0 && shown->height > 0);
    pictures_shown++;
}

static void test_steps(void **state) {
    (void)state;
    texinpaint_job *job = NULL;
    tk_progress progress;
    memset(&progress, 0, sizeof progress);
    txm_env env = tk_env(NULL, &progress);
    int more = 1, steps = 0;
    texinpaint_desc d = plane_desc(9);
    const txm_image out = view(other, SIDE, SIDE, 3, TXM_U8);
    dig(picture, 3);
    complete_bytes(&d, result);
    d.show = count_shown;
    d.show_user = &pictures_shown;
    pictures_shown = 0;
    memset(other, FILL, sizeof other);
    assert_int_equal(texinpaint_begin(&d, &env, &job), TXM_OK);
    assert_int_equal(texinpaint_draw(job, 0, &env, &out), TXM_BAD_ARGUMENT);
    assert_int_equal(other[0], FILL);
    for (; more; steps++) {
        assert_int_equal(texinpaint_step(job, &env, &more), TXM_OK);
        assert_int_equal(texinpaint_draw(job, 0, NULL, &out), TXM_OK);
        for (int i = 0; i < PIXELS; i++) { /* the first picture is whole already, but for gutters */
            double p[2];
            if (mask[i] && on_plane(i % SIDE, i / SIDE, p)) assert_memory_not_equal(other + 3 * i, sentinel, 3);
        }
    }
    assert_true(steps >= 4 && pictures_shown > 0);
    assert_int_equal(progress.errors, 0);
    assert_memory_equal(result, other, 3 * PIXELS);
    const texinpaint_info info = texinpaint_info_of(job);
    assert_int_equal(texinpaint_step(job, &env, &more), TXM_OK); /* nothing is left to do */
    assert_int_equal(more, 0);
    assert_int_equal(texinpaint_step(job, NULL, NULL), TXM_OK);
    assert_int_equal(texinpaint_draw(job, 0, NULL, &out), TXM_OK);
    assert_memory_equal(result, other, 3 * PIXELS);
    texinpaint_free(job);

    size_t missing = 0, gutter = 0;
    for (int i = 0; i < PIXELS; i++) {
        double p[2];
        const int inside = on_plane(i % SIDE, i / SIDE, p);
        missing += mask[i] && inside;
        gutter += mask[i] && !inside && memcmp(result + 3 * i, sentinel, 3) != 0;
    }
    assert_int_equal(info.holes, 1);
    assert_int_equal(info.windows, 1);
    assert_int_equal(info.missing, missing);
    assert_int_equal(info.written, missing + gutter);
    assert_true(info.structure >= TEXINPAINT_TEXTURE && info.structure <= TEXINPAINT_PATTERN);
}

/* ---- meshes ------------------------------------------------------------------------------------ */

/* Known texels stay; a texel of a gutter has the values of the nearest one in a chart if it is missing
   and at most `gutter` away. */
static void check_gutters(const uint8_t *made, int gutter) {
    for (int i = 0; i < PIXELS; i++) {
        double p[2];
        int least = INT_MAX, is_same = 0;
        if (!mask[i]) {
            assert_memory_equal(made + 3 * i, picture + 3 * i, 3);
            continue;
        }
        if (on_plane(i % SIDE, i / SIDE, p)) continue;
        for (int j = 0; j < PIXELS; j++) {
            const int dx = i % SIDE - j % SIDE, dy = i / SIDE - j / SIDE, apart = dx * dx + dy * dy;
            if (abs(dx) > 16 || abs(dy) > 16 || !on_plane(j % SIDE, j / SIDE, p) || apart > least) continue;
            is_same = (apart == least && is_same) || memcmp(made + 3 * i, made + 3 * j, 3) == 0;
            least = apart;
        }
        if (gutter > 0 && least <= gutter * gutter) assert_true(is_same);
        else assert_memory_equal(made + 3 * i, picture + 3 * i, 3);
    }
}

static void test_across_a_seam(void **state) {
    (void)state;
    static const int gutters[4] = {0, -1, 1, 2};
    static uint8_t truth[3 * PIXELS];
    texinpaint_desc d = plane_desc(10);
    memcpy(truth, picture, sizeof truth);
    dig(picture, 3);
    for (int k = 0; k < 4; k++) {
        d.gutter = gutters[k];
        const txm_image out = view(result, SIDE, SIDE, 3, TXM_U8);
        if (k < 2) complete(&d, &out);
        else assert_int_equal(texinpaint_harmonic(&d, NULL, &out), TXM_OK);
        check_gutters(result, gutters[k] ? gutters[k] : 8);
        double sum = 0;
        int n = 0;
        for (int i = 0; i < PIXELS; i++) {
            double p[2];
            if (!mask[i] || !on_plane(i % SIDE, i / SIDE, p)) continue;
            assert_memory_not_equal(result + 3 * i, sentinel, 3);
            for (int c = 0; c < 3; c++) sum += abs(result[3 * i + c] - truth[3 * i + c]);
            n += 3;
        }
        assert_true(n > 3 * 250);
        if (k < 2 && sum / n > 24) fail_msg("error %.1f", sum / n);
    }
}

/* A direction on the plane is another in each chart. */
static void test_normals_across_a_seam(void **state) {
    (void)state;
    static uint8_t normal[3 * PIXELS], normal_out[3 * PIXELS];
    static const uint8_t left[3] = {204, 128, 230}, right[3] = {128, 204, 230}; /* along x of the plane */
    texinpaint_desc d = plane_desc(10);
    texinpaint_map map;
    memset(&map, 0, sizeof map);
    for (int i = 0; i < PIXELS; i++) {
        memcpy(normal + 3 * i, i / SIDE < 32 ? left : right, 3);
        if (mask[i]) memset(normal + 3 * i, 5, 3);
    }
    map.image = view(normal, SIDE, SIDE, 3, TXM_U8);
    map.is_normal = 1;
    d.maps = &map;
    d.map_count = 1;
    d.gutter = -1;
    const txm_image out[2] = {view(result, SIDE, SIDE, 3, TXM_U8), view(normal_out, SIDE, SIDE, 3, TXM_U8)};
    for (int k = 0; k < 2; k++) { /* smooth, too */
        if (k) assert_int_equal(texinpaint_harmonic(&d, NULL, out), TXM_OK);
        else complete(&d, out);
        int turned = 0;
        for (int i = 0; i < PIXELS; i++) {
            double p[2];
            const uint8_t *wanted = i / SIDE < 32 ? left : right;
            if (!mask[i] || !on_plane(i % SIDE, i / SIDE, p)) continue;
            const double a = atan2(normal_out[3 * i + 1] - 127.5, normal_out[3 * i] - 127.5);
            const double b = atan2(wanted[1] - 127.5, wanted[0] - 127.5);
            /* pieces may be turned, and constant ones are as good any way; smooth is exact */
            if (k) assert_true(fabs(a - b) < 0.05);
            turned += fabs(a - b) > 0.05;
            assert_true(abs(normal_out[3 * i + 2] - 230) < 4);
        }
        (void)turned;
    }
}

static uint32_t corner_vertices[25];

/* Everything in charts is written, nothing else changes: for meshes of all sorts. */
static void check_mesh(const char *what) {
    texinpaint_desc d = desc_of(picture, 3, TXM_U8);
    txm_env env = {0};
    const txm_image out = view(result, SIDE, SIDE, 3, TXM_U8);
    use_mesh(&d);
    dig(picture, 3);
    d.gutter = -1;
    const txm_status status = texinpaint_complete(&d, &env, &out);
    if (status != TXM_OK) fail_msg("%s: %s", what, env.message);
    check_known(result, picture, 3);
    texinpaint_job *job = NULL;
    assert_int_equal(texinpaint_begin(&d, NULL, &job), TXM_OK);
    const texinpaint_info info = texinpaint_info_of(job);
    texinpaint_free(job);
    int missing = 0;
    for (int i = 0; i < PIXELS; i++) missing += mask[i] != 0;
    if (sentinels(result, 3) != missing - (int)info.missing)
        fail_msg("%s: %d of %d left, %lu covered", what, sentinels(result, 3), missing, (unsigned long)info.missing);
}

static void begin_mesh(void) {
    memset(&mesh, 0, sizeof mesh);
    draw_stripes(picture, 3);
    no_mask();
}

static void test_strange_meshes(void **state) {
    (void)state;
    const double at[2] = {4, 4}, x[2] = {24, 0}, y[2] = {0, 24}, back[2] = {-24, 0}, corner[2] = {28, 4};
    const double beside[2] = {34, 4}, far_off[2] = {4 + 3 * SIDE, 4 - 2 * SIDE}, point[2] = {10, 40}, none[2] = {0, 0};
    uint32_t v[25];

    begin_mesh(); /* mirrored: the second chart is the first seen from behind */
    grid_vertices(v, 4, 4, 0, 0, 24, 24);
    add_chart(v, 4, 4, at, x, y);
    grid_vertices(v, 4, 4, 24, 0, 24, 24);
    add_chart(v, 4, 4, corner, back, y);
    add_disk(16, 16, 8);
    check_mesh("overlapping and mirrored");

    begin_mesh(); /* repeated, out of range, wrapped around the border of the picture */
    grid_vertices(v, 4, 4, 0, 0, 24, 24);
    add_chart(v, 4, 4, far_off, x, y);
    add_disk(16, 16, 8);
    check_mesh("out of range");

    begin_mesh();
    const double wrapped[2] = {-12, 52};
    grid_vertices(v, 4, 4, 0, 0, 24, 24);
    add_chart(v, 4, 4, wrapped, x, y);
    add_disk(0, 0, 7);
    add_disk(63, 63, 7);
    check_mesh("wrapped");

    begin_mesh(); /* a chart without area beside one that has some, a hole at the border */
    grid_vertices(v, 4, 4, 0, 0, 24, 24);
    add_chart(v, 4, 4, at, x, y);
    grid_vertices(v, 2, 2, 24, 0, 24, 24);
    add_chart(v, 2, 2, point, x, none);
    add_disk(4, 4, 9);
    check_mesh("without area, at a border");

    begin_mesh(); /* three sheets at one edge, a face that names a vertex twice, a face twice */
    grid_vertices(v, 4, 4, 0, 0, 24, 24);
    memcpy(corner_vertices, v, sizeof v);
    add_chart(v, 4, 4, at, x, y);
    for (int k = 0; k < 2; k++) {
        const double below[2] = {k ? 34 : 4, 36};
        for (int j = 0; j < 5; j++)
            for (int i = 0; i < 5; i++)
                v[5 * j + i] = j ? add_vertex(6 * i, 24, (k ? -6 : 6) * j) : corner_vertices[20 + i];
        add_chart(v, 4, 4, below, x, y);
    }
    add_corner(v[0], 4, 60);
    add_corner(v[0], 14, 60);
    add_corner(v[1], 14, 63);
    for (int k = 0; k < 3; k++) {
        mesh.vertex[mesh.corners] = mesh.vertex[k];
        mesh.entry[mesh.corners++] = mesh.entry[k];
    }
    add_disk(16, 28, 6);
    add_disk(16, 36, 6);
    check_mesh("not a manifold");

    begin_mesh(); /* two components; all of the second is missing */
    grid_vertices(v, 4, 4, 0, 0, 24, 24);
    add_chart(v, 4, 4, at, x, y);
    grid_vertices(v, 4, 4, 100, 0, 24, 24);
    add_chart(v, 4, 4, beside, x, y);
    add_disk(16, 16, 6);
    add_disk(46, 16, 20);
    for (int i = 0; i < PIXELS; i++) mask[i] = i % SIDE < 30 && i % SIDE > 24 ? 0 : mask[i];
    check_mesh("two components");
}

/* Holes are counted on the surface: one goes through the seam, one is by itself. */
static void test_holes_are_counted(void **state) {
    (void)state;
    tk_wide();
    texinpaint_job *job = NULL;
    texinpaint_desc d = plane_desc(7);
    add_disk(7, 7, 3);
    assert_int_equal(texinpaint_begin(&d, NULL, &job), TXM_OK);
    assert_int_equal(texinpaint_step(job, NULL, NULL), TXM_OK);
    assert_int_equal(texinpaint_info_of(job).holes, 2);
    texinpaint_free(job);
    draw_stripes(picture, 3);
    no_mask();
    for (int k = 0; k < 9; k++) add_disk(10 + 20 * (k % 3), 10 + 20 * (k / 3), 3);
    texinpaint_desc e = desc_of(picture, 3, TXM_U8);
    assert_int_equal(texinpaint_begin(&e, NULL, &job), TXM_OK);
    assert_int_equal(texinpaint_step(job, NULL, NULL), TXM_OK);
    assert_int_equal(texinpaint_info_of(job).holes, 9);
    texinpaint_free(job);
    complete_bytes(&e, result);
    check_known(result, picture, 3);
    draw_stripes(other, 3);
    assert_true(error_in_hole(result, other, 3) < 20);
}

/* A tube, its seam along it, with a hole all around it. */
static void test_around_a_tube(void **state) {
    (void)state;
    uint32_t v[17 * 9];
    const double at[2] = {4, 8}, x[2] = {56, 0}, y[2] = {0, 48};
    begin_mesh();
    for (int k = 0; k < 17 * 9; k++) {
        const double a = 2 * TXM_PI * (k % 17) / 16, r = 56 / (2 * TXM_PI);
        v[k] = k % 17 == 16 ? v[k - 16] : add_vertex(r * cos(a), 6 * (k / 17), r * sin(a));
    }
    add_chart(v, 16, 8, at, x, y);
    for (int i = 0; i < PIXELS; i++) mask[i] = (uint8_t)(i / SIDE > 24 && i / SIDE < 38 ? 255 : 0);
    check_mesh("a tube");
}

/* A cube in six charts of 18 texels; stripes through space, a hole across an edge. */
static void test_cube(void **state) {
    (void)state;
    static uint8_t truth[3 * PIXELS];
    begin_mesh();
    no_mask();
    for (int side = 0; side < 6; side++) {
        uint32_t v[25];
        const double at[2] = {2 + 20 * (side % 3), 2 + 20 * (side / 3)}, x[2] = {18, 0}, y[2] = {0, 18};
        for (int k = 0; k < 25; k++) {
            double p[3];
            const int axis = side / 2, flip = side % 2;
            p[axis] = flip ? 18 : 0;
            p[(axis + 1) % 3] = flip ? k % 5 * 4.5 : k / 5 * 4.5;
            p[(axis + 2) % 3] = flip ? k / 5 * 4.5 : k % 5 * 4.5;
            v[k] = add_vertex(p[0], p[1], p[2]);
        }
        add_chart(v, 4, 4, at, x, y);
        for (int j = 0; j < 18; j++) {
            for (int i = 0; i < 18; i++) {
                double p[3];
                const int axis = side / 2, flip = side % 2;
                p[axis] = flip ? 18 : 0;
                p[(axis + 1) % 3] = (flip ? i : j) + 0.5;
                p[(axis + 2) % 3] = (flip ? j : i) + 0.5;
                const int at_texel = (j + (int)at[1]) * SIDE + i + (int)at[0];
                const double dx = p[0] - 18, dy = p[1] - 9, dz = p[2] - 18;
                for (int c = 0; c < 3; c++)
                    picture[3 * at_texel + c] = (uint8_t)stripe_at((int)(p[0] + p[1]), (int)(p[2] * 2), c);
                if (dx * dx + dy * dy + dz * dz < 36) mask[at_texel] = 255;
            }
        }
    }
    memcpy(truth, picture, sizeof truth);
    check_mesh("a cube");
    const double error = error_in_hole(result, truth, 3);
    if (error > 30) fail_msg("error %.1f", error);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_nothing_is_missing),     cmocka_unit_test(test_stripes),
        cmocka_unit_test(test_odd_pictures),           cmocka_unit_test(test_grain_stays),
        cmocka_unit_test(test_source_is_honoured),     cmocka_unit_test(test_maps_in_register),
        cmocka_unit_test(test_normals_turn),           cmocka_unit_test(test_alpha),
        cmocka_unit_test(test_strides_and_in_place),   cmocka_unit_test(test_same_bytes_for_any_threads),
        cmocka_unit_test(test_steps),                  cmocka_unit_test(test_across_a_seam),
        cmocka_unit_test(test_normals_across_a_seam),  cmocka_unit_test(test_strange_meshes),
        cmocka_unit_test(test_holes_are_counted),      cmocka_unit_test(test_around_a_tube),
        cmocka_unit_test(test_cube),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
