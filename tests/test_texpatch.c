/* test_texpatch.c - jobs, parts anew, the plane: where pixels come from and how they fit
   SPDX-License-Identifier: MIT OR Unlicense

   cc -std=c99 -I. -Itests tests/test_texpatch.c -lcmocka -lpthread -lm

   Layers, strokes and guides made of them are in test_texpatch_edges.c. With TEXPATCH_TEST_SHOW in
   the environment the measured values are printed.                                             */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <limits.h>
#include <stdint.h>
#include <time.h>

#include <cmocka.h>

#define TEXPATCH_IMPLEMENTATION
#include "texpatch.h"

#include "testkit.h"

/* ---- helpers ---------------------------------------------------------------------------- */

enum { FILL = 0x5c };

/* what a test has allocated; released after it */
static void *pool[2048];
static int pool_count;

static void *need(size_t bytes) {
    void *p = malloc(bytes);
    if (!p || pool_count == 2048) abort();
    pool[pool_count++] = p;
    return p;
}

static void show(const char *what, double value) {
    if (getenv("TEXPATCH_TEST_SHOW")) printf("# %s: %.4f\n", what, value);
}

static int release_all(void **state) {
    (void)state;
    while (pool_count > 0) free(pool[--pool_count]);
    show("seconds until now", (double)clock() / CLOCKS_PER_SEC);
    return 0;
}

static void assert_between(const char *what, double x, double low, double high) {
    show(what, x);
    if (!(x >= low && x <= high)) fail_msg("%s: %.9g is not in %g..%g", what, x, low, high);
}

static txm_image view(void *pixels, int width, int height, int channels, txm_sample sample) {
    txm_image im;
    memset(&im, 0, sizeof im);
    im.pixels = pixels;
    im.width = width;
    im.height = height;
    im.channels = channels;
    im.sample = sample;
    return im;
}

static size_t bytes_of(const txm_image *im) {
    return (size_t)im->width * (size_t)im->height * (size_t)im->channels *
           txm_sample_bytes(im->sample);
}

static txm_image new_image(int width, int height, int channels, txm_sample sample) {
    txm_image im = view(NULL, width, height, channels, sample);
    im.pixels = need(bytes_of(&im));
    memset(im.pixels, FILL, bytes_of(&im));
    return im;
}

/* the same picture, its rows bottom-up in memory */
static txm_image flipped(const txm_image *from) {
    txm_image to = new_image(from->width, from->height, from->channels, from->sample);
    const size_t row = bytes_of(from) / (size_t)from->height;
    to.stride = -(ptrdiff_t)row;
    to.pixels = (char *)to.pixels + row * (size_t)(from->height - 1);
    for (int y = 0; y < from->height; y++)
        memcpy(txm_image_row(&to, y), txm_image_row_const(from, y), row);
    return to;
}

/* the same values in another sample type, times scale plus shift */
static txm_image converted(const txm_image *from, txm_sample sample, float scale, float shift) {
    txm_image to = new_image(from->width, from->height, from->channels, sample);
    for (int y = 0; y < to.height; y++) {
        for (int x = 0; x < to.width; x++) {
            for (int c = 0; c < to.channels; c++)
                txm_image_set(&to, x, y, c, txm_image_get(from, x, y, c) * scale + shift);
        }
    }
    return to;
}

static int is_same(const txm_image *a, const txm_image *b) {
    const size_t row = bytes_of(a) / (size_t)a->height;
    assert_true(bytes_of(a) == bytes_of(b) && a->height == b->height);
    for (int y = 0; y < a->height; y++) {
        if (memcmp(txm_image_row_const(a, y), txm_image_row_const(b, y), row) != 0) return 0;
    }
    return 1;
}

/* is pixel (x, y) of a, to the byte, pixel (u, v) of b? */
static int is_pixel(const txm_image *a, int x, int y, const txm_image *b, int u, int v) {
    const size_t n = (size_t)a->channels * txm_sample_bytes(a->sample);
    return memcmp((const char *)txm_image_row_const(a, y) + (size_t)x * n,
                  (const char *)txm_image_row_const(b, v) + (size_t)u * n, n) == 0;
}

static int is_filled(const txm_image *im) {
    const unsigned char *p = (const unsigned char *)im->pixels;
    for (size_t i = 0; i < bytes_of(im); i++) {
        if (p[i] != FILL) return 0;
    }
    return 1;
}

static txm_image new_mask(int width, int height, int value) {
    const txm_image im = new_image(width, height, 1, TXM_U8);
    memset(im.pixels, value, bytes_of(&im));
    return im;
}

static void fill_box(const txm_image *mask, int x0, int y0, int x1, int y1, int value) {
    for (int y = y0; y < y1; y++)
        memset((uint8_t *)mask->pixels + y * mask->width + x0, value, (size_t)(x1 - x0));
}

static int mask_at(const txm_image *mask, int x, int y) {
    return ((const uint8_t *)txm_image_row_const(mask, y))[x];
}

/* difference of two pixels, 0..1 per channel, mean of the channels */
static double step(const txm_image *im, int x, int y, int u, int v) {
    double sum = 0;
    for (int c = 0; c < im->channels; c++)
        sum += fabs((double)txm_image_get(im, x, y, c) - (double)txm_image_get(im, u, v, c));
    return sum / im->channels;
}

static double mean_of(const txm_image *im, int c) {
    double sum = 0;
    for (int y = 0; y < im->height; y++) {
        for (int x = 0; x < im->width; x++) sum += (double)txm_image_get(im, x, y, c);
    }
    return sum / im->width / im->height;
}

/* ---- exemplars -------------------------------------------------------------------------- */

static int at_random(int x, int y, int which) {
    const uint64_t place = (uint64_t)(uint32_t)x << 32 | (uint32_t)y;
    return (int)(txm_hash(place + 0x9e3779b97f4a7c15u * (uint64_t)(uint32_t)(which + 1)) >> 56);
}

/* smooth noise 0..1 with features of size pixels */
static double smooth(double x, double y, double size, int which) {
    const int ix = (int)floor(x / size), iy = (int)floor(y / size);
    double fx = x / size - ix, fy = y / size - iy;
    fx = fx * fx * (3 - 2 * fx);
    fy = fy * fy * (3 - 2 * fy);
    const double top = at_random(ix, iy, which) * (1 - fx) + at_random(ix + 1, iy, which) * fx;
    const double low =
        at_random(ix, iy + 1, which) * (1 - fx) + at_random(ix + 1, iy + 1, which) * fx;
    return (top * (1 - fy) + low * fy) / 255;
}

/* Pebbles: the distance to the nearest of one random point per square of 9 pixels. */
static txm_image draw_gravel(int width, int height, int channels, int which) {
    const txm_image im = new_image(width, height, channels, TXM_U8);
    uint8_t *to = (uint8_t *)im.pixels;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            int best = 1 << 30, bi = 0, bj = 0;
            for (int j = y / 9 - 1; j <= y / 9 + 1; j++) {
                for (int i = x / 9 - 1; i <= x / 9 + 1; i++) {
                    const int dx = i * 9 + at_random(i, j, which) * 9 / 256 - x;
                    const int dy = j * 9 + at_random(i, j, which + 1) * 9 / 256 - y;
                    if (dx * dx + dy * dy >= best) continue;
                    best = dx * dx + dy * dy;
                    bi = i;
                    bj = j;
                }
            }
            for (int c = 0; c < channels; c++)
                *to++ = (uint8_t)txm_clampi(190 - 3 * best + at_random(bi, bj, which + 2 + c) / 5 +
                                                at_random(x, y, which + 9 + c) / 16,
                                            0, 255);
        }
    }
    return im;
}

/* Noise without any raster: random values seen through a disk, stretched, around a level. */
static txm_image draw_noise(int width, int height, int channels, int which, int radius, int level) {
    const txm_image im = new_image(width, height, channels, TXM_U8);
    uint8_t *to = (uint8_t *)im.pixels;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            for (int c = 0; c < channels; c++) {
                int sum = 0, n = 0;
                for (int v = -radius; v <= radius; v++) {
                    for (int u = -radius; u <= radius; u++) {
                        const int weight = radius * radius + 2 - u * u - v * v;
                        if (weight <= 0) continue;
                        sum += weight * at_random(x + u, y + v, which + c);
                        n += weight;
                    }
                }
                *to++ = (uint8_t)txm_clampi(level + (sum / n - 128) * 3 / 2 + 8 * c, 0, 255);
            }
        }
    }
    return im;
}

/* Bricks of step_x x step_y pixels, mortar included, every second row half a step further. Bricks
   differ in colour and shine; the grain is the same nowhere. */
static txm_image draw_bricks(int width, int height, int step_x, int step_y) {
    const txm_image im = new_image(width, height, 3, TXM_U8);
    uint8_t *to = (uint8_t *)im.pixels;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            const int row = y / step_y, shifted = x + (row % 2) * step_x / 2,
                      column = shifted / step_x;
            const int is_mortar = y % step_y < 3 || shifted % step_x < 3;
            for (int c = 0; c < 3; c++) {
                const int own = 150 - 40 * c + at_random(column, row, 3) / 8 - 16;
                *to++ =
                    (uint8_t)txm_clampi((is_mortar ? 205 : own) + at_random(x, y, c) / 12, 0, 255);
            }
        }
    }
    return im;
}

/* 16 bit: the number of each pixel, told once and no more */
static txm_image draw_numbers(int width, int height) {
    const txm_image im = new_image(width, height, 1, TXM_U16);
    for (int i = 0; i < width * height; i++) ((uint16_t *)im.pixels)[i] = (uint16_t)(i + 1);
    return im;
}

/* Hills of 16 bit, and their normals by central differences. sense 1: y up, 2: y down. */
enum { SLOPE = 16 }; /* of the hills, when 65536 is a pixel's height */
static txm_image draw_hills(int width, int height) {
    const txm_image im = new_image(width, height, 1, TXM_U16);
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++)
            ((uint16_t *)im.pixels)[y * width + x] =
                (uint16_t)(20000 + 20000 * smooth(x, y, 9, 40) + 8000 * smooth(x, y, 5, 41));
    }
    return im;
}

static txm_vec3 normal_of(const txm_image *hills, int x, int y, int sense) {
    const int l = txm_clampi(x - 1, 0, hills->width - 1),
              r = txm_clampi(x + 1, 0, hills->width - 1);
    const int t = txm_clampi(y - 1, 0, hills->height - 1),
              b = txm_clampi(y + 1, 0, hills->height - 1);
    const float dx = (txm_image_get(hills, r, y, 0) - txm_image_get(hills, l, y, 0)) * SLOPE;
    const float dy = (txm_image_get(hills, x, b, 0) - txm_image_get(hills, x, t, 0)) * SLOPE;
    return txm_vec3_normalize(txm_v3(-dx, sense == 2 ? -dy : dy, 1));
}

static txm_image draw_normals(const txm_image *hills, int sense, txm_sample sample) {
    const txm_image im = new_image(hills->width, hills->height, 3, sample);
    for (int y = 0; y < im.height; y++) {
        for (int x = 0; x < im.width; x++) {
            const txm_vec3 n = normal_of(hills, x, y, sense);
            txm_image_set(&im, x, y, 0, 0.5f + 0.5f * n.x);
            txm_image_set(&im, x, y, 1, 0.5f + 0.5f * n.y);
            txm_image_set(&im, x, y, 2, 0.5f + 0.5f * n.z);
        }
    }
    return im;
}

/* ---- jobs ------------------------------------------------------------------------------- */

static texpatch_exemplar exemplar_of(const txm_image *maps) {
    texpatch_exemplar e;
    memset(&e, 0, sizeof e);
    e.maps = maps;
    return e;
}

static texpatch_desc desc_of(const texpatch_exemplar *exemplars, int count, int maps, int width,
                             int height) {
    texpatch_desc d;
    memset(&d, 0, sizeof d);
    d.exemplars = exemplars;
    d.exemplar_count = count;
    d.map_count = maps;
    d.width = width;
    d.height = height;
    d.seed = 7;
    return d;
}

static texpatch_job *begin(const texpatch_desc *desc) {
    txm_env env = {0};
    texpatch_job *job = NULL;
    const txm_status status = texpatch_begin(desc, &env, &job);
    if (status != TXM_OK) fail_msg("begin: %d, %s", status, env.message);
    return job;
}

/* all steps that are left; how many there were */
static int run(texpatch_job *job) {
    int steps = 0;
    for (int more = 1; more; steps++) {
        assert_true(steps < 1000);
        assert_int_equal(texpatch_step(job, NULL, &more), TXM_OK);
    }
    return steps;
}

/* All steps but the last, which bends pieces and spreads steps of colour. How many there are
   depends on the exemplar, not on the size, unless sides wrap. */
static void run_but_one(texpatch_job *job, const texpatch_desc *desc) {
    texpatch_desc least = *desc;
    least.width = least.height = 1;
    texpatch_job *other = begin(&least);
    const int steps = run(other);
    int more = 1;
    texpatch_free(other);
    for (int i = 0; i + 1 < steps; i++) {
        assert_int_equal(more, 1);
        assert_int_equal(texpatch_step(job, NULL, &more), TXM_OK);
    }
    assert_int_equal(more, 1);
}

static txm_image drawn(const texpatch_job *job, int map, const txm_image *like, int width,
                       int height) {
    txm_env env = {0};
    const txm_image out = new_image(width, height, like->channels, like->sample);
    const txm_status status = texpatch_draw(job, map, 0, 0, &env, out);
    if (status != TXM_OK) fail_msg("draw: %d, %s", status, env.message);
    return out;
}

/* all maps in one call; the first is returned, the others go to rest if that is not NULL */
static txm_image made_maps(const texpatch_desc *desc, txm_env *env, txm_image *rest) {
    txm_env own = {0};
    txm_image out[TEXPATCH_MAX_MAPS];
    for (int m = 0; m < desc->map_count; m++) {
        const txm_image *like = &desc->exemplars[0].maps[m];
        out[m] = new_image(desc->width, desc->height, like->channels, like->sample);
        if (m && rest) rest[m - 1] = out[m];
    }
    if (!env) env = &own;
    const txm_status status = texpatch_make(desc, env, out);
    if (status != TXM_OK) fail_msg("make: %d, %s", status, env->message);
    return out[0];
}

static txm_image made(const texpatch_desc *desc, txm_env *env) {
    return made_maps(desc, env, NULL);
}

static int is_whole(texpatch_source s) {
    return s.x == (float)(int)s.x && s.y == (float)(int)s.y;
}

/* One for each pixel of a job. */
static texpatch_source *sources_of(const texpatch_job *job, int width, int height) {
    texpatch_source *s = (texpatch_source *)need((size_t)width * (size_t)height * sizeof *s);
    for (int i = 0; i < width * height; i++) s[i] = texpatch_source_at(job, i % width, i / width);
    return s;
}

/* Before the last step every pixel is one of an exemplar's. */
static void check_places(const texpatch_job *job, const texpatch_desc *d, int map) {
    const txm_image out = drawn(job, map, &d->exemplars[0].maps[map], d->width, d->height);
    for (int y = 0; y < d->height; y++) {
        for (int x = 0; x < d->width; x++) {
            const texpatch_source s = texpatch_source_at(job, x, y);
            assert_true(s.exemplar >= 0 && s.exemplar < d->exemplar_count && is_whole(s));
            const txm_image *from = &d->exemplars[s.exemplar].maps[map];
            assert_true(s.x >= 0 && s.y >= 0 && s.x < (float)from->width &&
                        s.y < (float)from->height);
            if (!is_pixel(&out, x, y, from, (int)s.x, (int)s.y))
                fail_msg("map %d: (%d, %d) is not (%g, %g) of exemplar %d", map, x, y, s.x, s.y,
                         s.exemplar);
        }
    }
}

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

/* With turns and mirrored pieces: neighbours in a piece are neighbours in the exemplar, in the
   direction that the turn says. */
static void test_turns(void **state) {
    (void)state;
    enum { W = 80, H = 72 };
    const txm_image gravel = draw_gravel(40, 36, 3, 0);
    const texpatch_exemplar e = exemplar_of(&gravel);
    /* where one pixel to the right leads in the exemplar after so many turns counter-clockwise */
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
            /* it is no gray mush: as much contrast between neighbours as the exemplar has */
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

/* Sizes and strides that are out of the ordinary. */
static void test_sizes(void **state) {
    (void)state;
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

        /* bottom-up, with room between the rows */
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
    const txm_image gravel = draw_gravel(96, 96, 3, 0), bricks = draw_bricks(96, 96, 24, 16);
    for (int which = 0; which < 2; which++) {
        const texpatch_exemplar e = exemplar_of(which ? &bricks : &gravel);
        texpatch_desc d = desc_of(&e, 1, 1, 96, 136);
        txm_env env = {0};
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
        for (int i = 0; i < 96 * 136; i++)
            same += is_pixel(&first, i % 96, i / 96, &other, i % 96, i / 96);
        assert_between("pixels that another seed leaves", same / (96.0 * 136), 0, 0.2);
    }
}

/* ---- maps in register ------------------------------------------------------------------- */

/* The exemplar of four maps: gravel, normals, hills, numbers as names. */
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

static void check_lengths(const txm_image *normals) {
    for (int y = 0; y < normals->height; y++) {
        for (int x = 0; x < normals->width; x++) {
            double sum = 0;
            for (int c = 0; c < 3; c++) {
                const double v = 2 * (double)txm_image_get(normals, x, y, c) - 1;
                sum += v * v;
            }
            if (!(fabs(sqrt(sum) - 1) <= 1.0 / 127))
                fail_msg("(%d, %d): a normal of length %g", x, y, sqrt(sum));
        }
    }
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
                    const double got = 2 * (double)txm_image_get(&normals, x, y, c) - 1;
                    if (!(fabs(got - (double)v[c]) < 0.02))
                        fail_msg("(%d, %d) turn %d channel %d: %g, not %g", x, y, s[i].turn, c, got,
                                 (double)v[c]);
                }
            }
        }
        assert_between("normals compared", compared / (double)(side * side), 0.3, 1);
        for (int t = 0; t < (which ? 8 : 1); t++) assert_true(of_turn[t] > 10);

        /* bent and blended: names stay names, and everything still shows one place */
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
            /* a place just between two pixels may go either way */
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

/* ---- tileable --------------------------------------------------------------------------- */

/* mean steps of neighbours along x or y: [0] inside, [1] across the wrap; sums are added up */
static void add_steps(const txm_image *im, int down, double sum[2], double count[2]) {
    for (int y = 0; y < im->height; y++) {
        for (int x = 0; x < im->width; x++) {
            const int u = down ? x : (x + 1) % im->width, v = down ? (y + 1) % im->height : y;
            const int wraps = down ? v == 0 : u == 0;
            sum[wraps] += step(im, x, y, u, v);
            count[wraps]++;
        }
    }
}

static void test_tileable(void **state) {
    (void)state;
    const txm_image noise = draw_noise(96, 96, 3, 0, 3, 128);
    const texpatch_exemplar e = exemplar_of(&noise);
    for (int tileable = 0; tileable <= 3; tileable++) {
        double sum[2][2] = {{0, 0}, {0, 0}}, count[2][2] = {{0, 0}, {0, 0}};
        for (int seed = 0; seed < 3; seed++) {
            texpatch_desc d = desc_of(&e, 1, 1, 120, 104);
            d.tileable = tileable;
            d.passes = 2;
            d.seed = (uint64_t)seed;
            if (tileable == 0 && seed) continue;
            const txm_image out = made(&d, NULL);
            for (int k = 0; k < 2; k++) add_steps(&out, k, sum[k], count[k]);
        }
        for (int k = 0; k < 2; k++) {
            const double ratio = sum[k][1] / count[k][1] / (sum[k][0] / count[k][0]);
            if (tileable >> k & 1) assert_between("step across the wrap", ratio, 0.9, 1.1);
            else assert_between("step of sides that need not fit", ratio, 1.5, 9);
        }
    }
}

/* how far (x, y) is from a whole number of steps, in steps */
static double off_lattice(const float v[4], double x, double y) {
    const double det = (double)v[0] * (double)v[3] - (double)v[1] * (double)v[2];
    const double a = (x * (double)v[3] - y * (double)v[2]) / det;
    const double b = ((double)v[0] * y - (double)v[1] * x) / det;
    return fmax(fabs(a - floor(a + 0.5)), fabs(b - floor(b + 0.5)));
}

static void test_lattice(void **state) {
    (void)state;
    float v[4];
    static const int steps[3][2] = {{24, 16}, {30, 11}, {18, 14}};
    for (int i = 0; i < 3; i++) {
        const int dx = steps[i][0], dy = steps[i][1];
        const txm_image bricks = draw_bricks(i == 1 ? 128 : 90, 90, dx, dy);
        const texpatch_exemplar e = exemplar_of(&bricks);
        texpatch_desc d = desc_of(&e, 1, 1, 96, 96);
        texpatch_job *job = begin(&d);
        assert_int_equal(texpatch_lattice(job, v), 1);
        /* a basis of the same lattice: as much area, and both known steps are of it */
        const double det = fabs((double)v[0] * (double)v[3] - (double)v[1] * (double)v[2]);
        assert_between("area of a cell", det / (dx * dy), 0.98, 1.02);
        assert_between("a row's step is one", off_lattice(v, dx, 0), 0, 0.02);
        assert_between("that to the next row too", off_lattice(v, dx * 0.5, dy), 0, 0.02);
        texpatch_free(job);

        d.lattice = -1;
        job = begin(&d);
        v[2] = 5;
        assert_int_equal(texpatch_lattice(job, v), 0);
        assert_true(v[0] == 0 && v[1] == 0 && v[2] == 0 && v[3] == 0);
        assert_int_equal(texpatch_lattice(job, NULL), 0);
        texpatch_free(job);

        d.lattice = 1;
        d.lattice_vectors[0] = 20;
        d.lattice_vectors[3] = -17.5f;
        job = begin(&d);
        assert_int_equal(texpatch_lattice(job, v), 1);
        assert_true(off_lattice(v, 20, 0) < 1e-5 && off_lattice(v, 0, 17.5) < 1e-5);
        texpatch_free(job);
    }
    for (int i = 0; i < 4; i++) {
        const txm_image plain = i < 2 ? draw_gravel(96, 80, 3, 20 * i)
                                      : draw_noise(96, 80, 3, 20 * i, i == 2 ? 2 : 3, 120);
        const texpatch_exemplar e = exemplar_of(&plain);
        const texpatch_desc d = desc_of(&e, 1, 1, 96, 96);
        texpatch_job *job = begin(&d);
        assert_int_equal(texpatch_lattice(job, v), 0);
        texpatch_free(job);
    }
    assert_int_equal(texpatch_lattice(NULL, v), 0);
}

/* A torus of bricks: the steps are adapted to its sides, and the joints run on across them. */
static void test_lattice_torus(void **state) {
    (void)state;
    const txm_image bricks = draw_bricks(112, 96, 24, 16);
    const texpatch_exemplar e = exemplar_of(&bricks);
    static const int sides[3][2] = {{130, 100}, {101, 99}, {144, 128}};
    for (int i = 0; i < 3; i++) {
        texpatch_desc d = desc_of(&e, 1, 1, sides[i][0], sides[i][1]);
        float v[4];
        d.tileable = TEXPATCH_TILE_X | TEXPATCH_TILE_Y;
        texpatch_job *job = begin(&d);
        assert_int_equal(texpatch_lattice(job, v), 1);
        assert_between("steps along the width", off_lattice(v, d.width, 0), 0, 0.001);
        assert_between("steps along the height", off_lattice(v, 0, d.height), 0, 0.001);
        run(job);
        const txm_image out = drawn(job, 0, &bricks, d.width, d.height);
        /* what lies whole steps apart is alike, also across the border */
        int alike[2] = {0, 0}, count[2] = {0, 0};
        for (int y = 0; y < d.height; y++) {
            for (int x = 0; x < d.width; x++) {
                const int u = (int)floorf((float)x + v[0] + 0.5f);
                const int w = (int)floorf((float)y + v[1] + 0.5f);
                const int wraps = u < 0 || w < 0 || u >= d.width || w >= d.height;
                alike[wraps] +=
                    step(&out, x, y, (u + d.width) % d.width, (w + d.height) % d.height) < 0.15;
                count[wraps]++;
            }
        }
        assert_between("alike one step on", alike[0] / (double)count[0], 0.9, 1);
        assert_between("across the border", alike[1] / (double)count[1], 0.8, 1);
        texpatch_free(job);
    }
}

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

    /* where the mask is 0 it does not matter what the guide says */
    d.width = d.height = 64;
    d.guide_mask = new_mask(64, 64, 0);
    txm_image out[2];
    for (int k = 0; k < 2; k++) {
        d.guide = new_mask(64, 64, 255 * k);
        out[k] = made(&d, NULL);
    }
    assert_true(is_same(&out[0], &out[1]));

    /* half of it: the other half is free to be anything, this one is not */
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
    kept[1] = new_image(SIDE, SIDE, 1, TXM_U16); /* values that it has nowhere */
    for (int i = 0; i < SIDE * SIDE; i++)
        memcpy((uint8_t *)kept[0].pixels + 3 * i,
               (uint8_t *)maps[0].pixels + 3 * ((i / SIDE + 9) * 128 + i % SIDE + 9), 3);
    d.kept = kept;
    d.keep = new_mask(SIDE, SIDE, 0);
    for (int i = 0; i < SIDE * SIDE; i++) {
        const int dx = i % SIDE - 60, dy = i / SIDE - 50;
        const int is_in = dx * dx + dy * dy < 30 * 30 || i % SIDE < 3;
        ((uint8_t *)d.keep.pixels)[i] = is_in ? (uint8_t)(i % 200 + 1) : 0;
    }
    for (int which = 0; which < 2; which++) {
        d.passes = which ? -1 : 0;
        d.tileable = which ? 3 : 0;
        texpatch_job *job = begin(&d);
        int more = 1;
        while (more) { /* what is kept is there from the start, and never taken away */
            assert_int_equal(texpatch_step(job, NULL, &more), TXM_OK);
            for (int m = 0; m < 2; m++) {
                const txm_image out = drawn(job, m, &maps[m], SIDE, SIDE);
                for (int i = 0; i < SIDE * SIDE; i++) {
                    const int x = i % SIDE, y = i / SIDE;
                    const texpatch_source s = texpatch_source_at(job, x, y);
                    if (mask_at(&d.keep, x, y)) {
                        /* coarse pictures round the border of what is kept to their pixels */
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
    memset(d.keep.pixels, 1, SIDE * SIDE);
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
            e[i].mask = new_mask(w, h, 1);
        }
        fill_box(&e[0].mask, w / 4, 0, w / 4 + 3, h, 0);
        fill_box(&e[0].mask, w / 2, h / 2, w, h / 2 + 5, 0);
        fill_box(&e[1].mask, 0, 0, w, 2, 0);
        e[1].mask = flipped(&e[1].mask);
        texpatch_desc d = desc_of(e, 2, 1, 120, 96);
        d.passes = 1;
        d.turns = 2;
        texpatch_job *job = begin(&d);
        int more = 1, far_away = 0, used[2] = {0, 0};
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
                int near = 9; /* an unmasked pixel is so near, in whole pixels */
                for (int r = 0; r <= 5 && near == 9; r++) {
                    for (int k = 0; k < (2 * r + 1) * (2 * r + 1); k++) {
                        const int x = (int)floorf(s.x + 0.5f) + k % (2 * r + 1) - r;
                        const int y = (int)floorf(s.y + 0.5f) + k / (2 * r + 1) - r;
                        if (x >= 0 && y >= 0 && x < w && y < h && mask_at(mask, x, y)) near = r;
                    }
                }
                if (near > 4) fail_msg("(%g, %g) of %d is masked", s.x, s.y, s.exemplar);
                far_away += near > 0;
            }
        }
        assert_true(used[0] > 0 && used[1] > 0);
        show("bent into what is masked", far_away / (120.0 * 96));
        assert_true(far_away < 120 * 96 / 20);
        texpatch_free(job);

        /* one is masked altogether: the other makes it all */
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

/* ---- a part anew ------------------------------------------------------------------------ */

/* Draw after each step: outside of the part nothing changes, inside all is the exemplar's. */
static void run_part(texpatch_job *job, const txm_image maps[2], const txm_image *again,
                     const txm_image before[2]) {
    const int w = again->width, h = again->height;
    for (int more = 1; more;) {
        assert_int_equal(texpatch_step(job, NULL, &more), TXM_OK);
        for (int m = 0; m < 2; m++) {
            const txm_image now = drawn(job, m, &maps[m], w, h);
            for (int i = 0; i < w * h; i++) {
                const int x = i % w, y = i / w;
                if (!mask_at(again, x, y)) {
                    if (!is_pixel(&now, x, y, &before[m], x, y))
                        fail_msg("map %d: (%d, %d) outside of the part changed", m, x, y);
                    continue;
                }
                if (m == 0) continue;
                const texpatch_source s = texpatch_source_at(job, x, y);
                const int name = ((const uint16_t *)now.pixels)[i] - 1;
                assert_true(s.exemplar == 0 && name >= 0 && name < maps[1].width * maps[1].height);
                assert_true(fabsf((float)(name % maps[1].width) - s.x) <= 0.501f);
                assert_true(fabsf((float)(name / maps[1].width) - s.y) <= 0.501f);
            }
        }
    }
}

static double changed(const txm_image *a, const txm_image *b, const txm_image *mask) {
    int count = 0, all = 0;
    for (int y = 0; y < a->height; y++) {
        for (int x = 0; x < a->width; x++) {
            if (!mask_at(mask, x, y)) continue;
            all++;
            count += !is_pixel(a, x, y, b, x, y);
        }
    }
    return count / (double)all;
}

static void test_again(void **state) {
    (void)state;
    enum { W = 144, H = 120 };
    txm_image maps[2], before[2], after[4];
    maps[0] = draw_gravel(96, 96, 3, 0);
    maps[1] = draw_numbers(96, 96);
    const texpatch_exemplar e = exemplar_of(maps);
    texpatch_map labels[2];
    memset(labels, 0, sizeof labels);
    labels[0].weight = 1;
    labels[1].is_label = 1;
    texpatch_desc d = desc_of(&e, 1, 2, W, H);
    d.maps = labels;
    d.passes = 1;
    for (int tileable = 0; tileable <= 3; tileable += 3) {
        txm_image mask = new_mask(W, H, 0);
        d.tileable = tileable;
        fill_box(&mask, 40, 30, 90, 70, 1);
        if (tileable) { /* over all borders */
            fill_box(&mask, 0, 0, 30, 25, 9);
            fill_box(&mask, W - 20, 0, W, 25, 9);
            fill_box(&mask, 0, H - 20, 30, H, 9);
            fill_box(&mask, W - 20, H - 20, W, H, 9);
        }
        /* seed 1, seed 2, seed 1 on another job that has not been run yet */
        for (int k = 0; k < 3; k++) {
            texpatch_job *job = begin(&d);
            if (k < 2) {
                run(job);
                for (int m = 0; m < 2; m++) before[m] = drawn(job, m, &maps[m], W, H);
            }
            assert_int_equal(texpatch_again(job, &mask, NULL, NULL, k == 1 ? 2 : 1, NULL), TXM_OK);
            assert_true(texpatch_done(job) < 1);
            run_part(job, maps, &mask, before);
            assert_true(texpatch_done(job) == 1);
            after[k] = drawn(job, 0, &maps[0], W, H);
            assert_between("pixels changed", changed(&after[k], &before[0], &mask), 0.6, 1);
            if (k == 0) { /* the same once more: it starts from another picture but ends alike */
                assert_int_equal(texpatch_again(job, &mask, NULL, NULL, 1, NULL), TXM_OK);
                run(job);
                after[3] = drawn(job, 0, &maps[0], W, H);
                assert_true(is_same(&after[0], &after[3]));
            }
            texpatch_free(job);
        }
        assert_true(is_same(&after[0], &after[2]));
        assert_between("by another seed", changed(&after[0], &after[1], &mask), 0.1, 1);

        /* it fits: to what is around it, and to itself across the border */
        double sum[3] = {0, 0, 0}, count[3] = {0, 0, 0};
        for (int y = 0; y < H; y++) {
            for (int x = 0; x < W; x++) {
                for (int k = 0; k < 2; k++) {
                    const int u = k ? x : (x + 1) % W, v = k ? (y + 1) % H : y;
                    const int a = mask_at(&mask, x, y) != 0, b = mask_at(&mask, u, v) != 0;
                    const int kind = u < x || v < y ? 2 : a != b;
                    if (kind == 2 && !(a && b)) continue;
                    sum[kind] += step(&after[0], x, y, u, v);
                    count[kind]++;
                }
            }
        }
        assert_between("step to the part", sum[1] / count[1] / (sum[0] / count[0]), 0.6, 1.4);
        if (tileable)
            assert_between("across the border", sum[2] / count[2] / (sum[0] / count[0]), 0.5, 1.5);
    }

    /* nothing to make anew; two parts without steps in between are two parts */
    const txm_image nothing = new_mask(W, H, 0), one = new_mask(W, H, 0), two = new_mask(W, H, 0);
    int more = 1;
    d.tileable = 0;
    fill_box(&one, 0, 0, 30, 30, 1);
    fill_box(&two, 20, 20, 50, 40, 1);
    texpatch_job *job = begin(&d);
    run(job);
    before[0] = drawn(job, 0, &maps[0], W, H);
    assert_int_equal(texpatch_again(job, &nothing, NULL, NULL, 5, NULL), TXM_OK);
    assert_true(texpatch_done(job) == 1);
    assert_int_equal(texpatch_step(job, NULL, &more), TXM_OK);
    assert_int_equal(more, 0);
    after[0] = drawn(job, 0, &maps[0], W, H);
    assert_true(is_same(&before[0], &after[0]));
    for (int k = 0; k < 2; k++) {
        if (k) job = begin(&d);
        assert_int_equal(texpatch_again(job, &one, NULL, NULL, 5, NULL), TXM_OK);
        if (!k) run(job);
        assert_int_equal(texpatch_again(job, &two, NULL, NULL, 6, NULL), TXM_OK);
        run(job);
        after[k] = drawn(job, 0, &maps[0], W, H);
        texpatch_free(job);
    }
    assert_true(is_same(&after[0], &after[1]));

    /* all of it */
    const txm_image all = new_mask(W, H, 1);
    job = begin(&d);
    run(job);
    assert_int_equal(texpatch_again(job, &all, NULL, NULL, 9, NULL), TXM_OK);
    run_part(job, maps, &all, before);
    after[0] = drawn(job, 0, &maps[0], W, H);
    assert_between("pixels changed", changed(&after[0], &before[0], &all), 0.9, 1);

    /* what was kept stays */
    texpatch_free(job);
    txm_image kept[2];
    kept[0] = before[0];
    kept[1] = new_image(W, H, 1, TXM_U16);
    d.kept = kept;
    d.keep = two;
    job = begin(&d);
    assert_int_equal(texpatch_again(job, &one, NULL, NULL, 5, NULL), TXM_OK);
    run(job);
    after[0] = drawn(job, 0, &maps[0], W, H);
    assert_true(changed(&after[0], &kept[0], &two) == 0);
    assert_int_equal(texpatch_source_at(job, 25, 25).exemplar, -1);
    assert_int_equal(texpatch_source_at(job, 10, 10).exemplar, 0);
    texpatch_free(job);
}

static void test_again_guide(void **state) {
    (void)state;
    enum { SIDE = 128, W = 44 };
    txm_image maps[2];
    texpatch_exemplar e[2];
    maps[0] = draw_gravel(W, W, 3, 0);
    maps[1] = draw_noise(W, W, 3, 50, 2, 128);
    for (int i = 0; i < 2; i++) {
        e[i] = exemplar_of(&maps[i]);
        e[i].guide = new_mask(W, W, 255 * i);
    }
    texpatch_desc d = desc_of(e, 2, 1, SIDE, SIDE);
    d.passes = 1;
    d.guide = new_mask(SIDE, SIDE, 0);
    const txm_image mask = new_mask(SIDE, SIDE, 0), guide = new_mask(SIDE, SIDE, 0);
    fill_box(&mask, 24, 30, 100, 96, 1);
    fill_box(&guide, 30, 36, 94, 90, 255);
    texpatch_job *job = begin(&d);
    run(job);
    const txm_image before = drawn(job, 0, &maps[0], SIDE, SIDE);
    for (int k = 0; k < 3; k++) {
        /* given; as it was given; given back. The caller's own is not looked at later */
        const txm_image mine = new_mask(SIDE, SIDE, 0);
        if (k == 0) memcpy(mine.pixels, guide.pixels, SIDE * SIDE);
        assert_int_equal(texpatch_again(job, &mask, k == 1 ? NULL : &mine, NULL, 3, NULL), TXM_OK);
        memset(mine.pixels, 100, SIDE * SIDE);
        run(job);
        const txm_image out = drawn(job, 0, &maps[0], SIDE, SIDE);
        int good = 0, count = 0;
        for (int i = 0; i < SIDE * SIDE; i++) {
            const int x = i % SIDE, y = i / SIDE;
            if (!mask_at(&mask, x, y)) assert_true(is_pixel(&out, x, y, &before, x, y));
            if (x < 38 || x >= 86 || y < 44 || y >= 82) continue;
            count++;
            good += texpatch_source_at(job, x, y).exemplar == (k < 2);
        }
        assert_between("of the new material", good / (double)count, 0.97, 1);
    }
    texpatch_free(job);
}

/* ---- the plane -------------------------------------------------------------------------- */

static texpatch_plane *plane_of(const texpatch_desc *desc) {
    txm_env env = {0};
    texpatch_plane *plane = NULL;
    const txm_status status = texpatch_plane_make(desc, &env, &plane);
    if (status != TXM_OK) fail_msg("plane: %d, %s", status, env.message);
    assert_true(texpatch_plane_cell(plane) > 0);
    return plane;
}

static void test_plane_windows(void **state) {
    (void)state;
    enum { COUNT = 20 };
    static const int windows[5] = {2, 3, 20, 3, 3};
    txm_image maps[2];
    maps[0] = draw_noise(32, 34, 1, 0, 1, 128);
    maps[1] = draw_numbers(32, 34);
    const texpatch_exemplar e = exemplar_of(maps);
    texpatch_map labels[2];
    memset(labels, 0, sizeof labels);
    labels[0].weight = 1;
    labels[1].is_label = 1;
    texpatch_desc d = desc_of(&e, 1, 2, 0, 0); /* the size is not looked at */
    d.maps = labels;
    d.passes = -1;
    d.patch = 20; /* large ones are fast */
    texpatch_plane *plane = plane_of(&d), *twin = plane_of(&d);
    const int cell = texpatch_plane_cell(plane);
    const int64_t far_away = (int64_t)1 << 40;
    const int64_t middle[5][2] = {{0, 0},
                                  {-far_away + 190, far_away - 90},
                                  {3 * cell + 18, -7 * cell + 60},
                                  {far_away - 30, -far_away + 70},
                                  {-1234567890123 / 2, 77}};
    txm_rng rng = txm_rng_make(11, 0);
    int pairs = 0;
    for (int c = 0; c < 5; c++) {
        int64_t at[COUNT][2];
        txm_image out[COUNT][2];
        texpatch_source *sources[COUNT];
        for (int k = 0; k < windows[c]; k++) { /* all of them hold the middle */
            int size[2];
            for (int a = 0; a < 2; a++) {
                const int before = txm_rng_range(&rng, 0, 30), behind = txm_rng_range(&rng, 0, 30);
                at[k][a] = middle[c][a] - (k ? before : 0);
                size[a] = k ? before + behind + 1 : 1;
            }
            out[k][0] = new_image(size[0], size[1], 1, TXM_U8);
            out[k][1] = new_image(size[0], size[1], 1, TXM_U16);
            sources[k] = (texpatch_source *)need((size_t)(size[0] * size[1]) * sizeof **sources);
            txm_env env = {0};
            if (k % 3 == 1) env.parallel_for = tk_parallel_reverse;
            const txm_status status = texpatch_plane_draw(k % 2 ? plane : twin, at[k][0], at[k][1],
                                                          &env, out[k], k % 4 ? sources[k] : NULL);
            if (status != TXM_OK) fail_msg("window: %d, %s", status, env.message);
            for (int i = 0; i < size[0] * size[1] && k % 4; i++) {
                const texpatch_source s = sources[k][i];
                const int name = ((const uint16_t *)out[k][1].pixels)[i] - 1;
                assert_true(s.exemplar == 0 && name >= 0 && name < 32 * 34);
                assert_true(fabsf((float)(name % 32) - s.x) <= 0.501f);
                assert_true(fabsf((float)(name / 32) - s.y) <= 0.501f);
            }
        }
        for (int a = 0; a < windows[c]; a++) {
            for (int b = 0; b < a; b++, pairs++) {
                for (int i = 0; i < out[a][0].width * out[a][0].height; i++) {
                    const int x = i % out[a][0].width, y = i / out[a][0].width;
                    const int64_t u = at[a][0] + x - at[b][0], v = at[a][1] + y - at[b][1];
                    if (u < 0 || v < 0 || u >= out[b][0].width || v >= out[b][0].height) continue;
                    for (int m = 0; m < 2; m++) {
                        if (!is_pixel(&out[a][m], x, y, &out[b][m], (int)u, (int)v))
                            fail_msg("place %d: windows %d and %d differ at (%d, %d)", c, a, b, x,
                                     y);
                    }
                    if (a % 4 && b % 4)
                        assert_memory_equal(&sources[a][i], &sources[b][v * out[b][0].width + u],
                                            sizeof **sources);
                }
            }
        }
    }
    assert_true(pairs >= 200);

    /* no farther than that */
    const txm_image out[2] = {new_image(4, 4, 1, TXM_U8), new_image(4, 4, 1, TXM_U16)};
    for (int i = 0; i < 4; i++) {
        txm_env env = {0};
        const int64_t x = i == 0 ? far_away + 1 : i == 1 ? -far_away - 1 : 0;
        const int64_t y = i == 2 ? far_away + 1 : i == 3 ? -far_away - 1 : 0;
        assert_int_equal(texpatch_plane_draw(plane, x, y, &env, out, NULL), TXM_BAD_ARGUMENT);
        assert_true(env.message[0] != 0 && is_filled(&out[0]) && is_filled(&out[1]));
    }
    assert_int_equal(texpatch_plane_draw(plane, far_away, -far_away, NULL, out, NULL), TXM_OK);
    assert_int_equal(texpatch_plane_draw(NULL, 0, 0, NULL, out, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_plane_draw(plane, 0, 0, NULL, NULL, NULL), TXM_BAD_ARGUMENT);
    const txm_image uneven[2] = {new_image(4, 4, 1, TXM_U8), new_image(4, 5, 1, TXM_U16)};
    assert_int_equal(texpatch_plane_draw(plane, 0, 0, NULL, uneven, NULL), TXM_BAD_ARGUMENT);
    const txm_image format[2] = {new_image(4, 4, 1, TXM_U8), new_image(4, 4, 1, TXM_U8)};
    assert_int_equal(texpatch_plane_draw(plane, 0, 0, NULL, format, NULL), TXM_BAD_ARGUMENT);
    assert_true(is_filled(&uneven[0]) && is_filled(&format[0]));
    texpatch_plane_free(plane);
    texpatch_plane_free(twin);
    texpatch_plane_free(NULL);
    assert_int_equal(texpatch_plane_cell(NULL), 0);
}

/* It looks like its exemplar, joins of the cells included, and is nowhere the same. */
static void test_plane_looks(void **state) {
    (void)state;
    for (int which = 0; which < 2; which++) {
        const txm_image from =
            which ? draw_bricks(64, 64, 16, 10) : draw_noise(48, 48, 3, 0, 3, 120);
        const texpatch_exemplar e = exemplar_of(&from);
        texpatch_desc d = desc_of(&e, 1, 1, 0, 0);
        d.passes = 1;
        texpatch_plane *plane = plane_of(&d);
        /* around a corner of four cells; what lies within half of it is made beforehand */
        const int cell = texpatch_plane_cell(plane), side = 96, half = cell / 16, far_side = 40;
        const txm_image out = new_image(side, side, 3, TXM_U8);
        const txm_image far_off = new_image(far_side, far_side, 3, TXM_U8);
        const int64_t x = (int64_t)5 * cell - side / 2, y = (int64_t)-3 * cell - side / 2;
        assert_int_equal(texpatch_plane_draw(plane, x, y, NULL, &out, NULL), TXM_OK);
        assert_int_equal(texpatch_plane_draw(plane, x - 4 * cell, y, NULL, &far_off, NULL), TXM_OK);
        for (int c = 0; c < 3; c++)
            assert_between("mean colour", mean_of(&out, c) - mean_of(&from, c), -0.03, 0.03);
        double sum[5] = {0}, count[5] = {0}, own[2] = {0, 0}, n[2] = {0, 0};
        int same = 0;
        for (int k = 0; k < 2; k++) {
            add_steps(&from, k, own, n);
            for (int i = 0; i < side * side; i++) {
                const int u = i % side + !k, v = i / side + k, at = k ? v : u;
                if (u >= side || v >= side) continue;
                /* 1: between two cells side by side, 2: one below the other, 3: along what is made
                   before their insides, 4: around what is made first, at the corner */
                const int from_corner = abs((k ? u : v) - side / 2);
                const int joint = at == side / 2               ? 1 + k
                                  : abs(at - side / 2) != half ? 0
                                  : from_corner < half         ? 4
                                                               : 3;
                sum[joint] += step(&out, i % side, i / side, u, v);
                count[joint]++;
            }
        }
        for (int i = 0; i < far_side * far_side; i++)
            same +=
                is_pixel(&out, i % far_side, i / far_side, &far_off, i % far_side, i / far_side);
        assert_between("step", (sum[0] / count[0]) / (own[0] / n[0]), 0.8, 1.2);
        for (int k = 1; k < 5 && !which; k++) /* joints of a wall of bricks lie where they lie */
            assert_between("step at a joint", (sum[k] / count[k]) / (sum[0] / count[0]), 0.6,
                           k == 4 ? 1.8 : 1.5);
        assert_between("the same elsewhere", same / (double)(far_side * far_side), 0, 0.2);
        texpatch_plane_free(plane);
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
    static const int passes[4] = {-1, 1, 4, 16}, patches[5] = {1, 8, 16, 28, 8192};
    const txm_image gravel = draw_gravel(48, 44, 3, 0);
    const txm_image least = draw_gravel(40, 36, 3, 0);
    const texpatch_exemplar e = exemplar_of(&gravel), f = exemplar_of(&least);
    int steps = 0;
    for (int i = 0; i < 4; i++) { /* the more passes, the more steps */
        texpatch_desc d = desc_of(&f, 1, 1, 56, 48);
        d.passes = passes[i];
        texpatch_job *job = begin(&d);
        const int n = run(job);
        assert_true(n > steps && texpatch_done(job) == 1);
        assert_int_equal(run(job), 1); /* and then nothing is left to do */
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
        made(&d, NULL); /* patches become as small as the torus demands */
    }

    /* a patch larger than the canvas is made as large as that */
    const txm_image small = draw_gravel(64, 64, 1, 0);
    const texpatch_exemplar only = exemplar_of(&small);
    texpatch_desc tiny = desc_of(&only, 1, 1, 1, 1);
    tiny.patch = 40;
    tiny.passes = -1;
    made(&tiny, NULL);
}

/* ---- levels of detail ------------------------------------------------------------------- */

static double decode(double v) {
    return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}
static double encode(double v) {
    return v <= 0.0031308 ? v * 12.92 : 1.055 * pow(v, 1 / 2.4) - 0.055;
}

static void test_half(void **state) {
    (void)state;
    static const int sizes[6][2] = {{1, 1}, {7, 5}, {8, 6}, {1, 9}, {10, 1}, {31, 17}};
    enum { COLOUR, DATA, LABEL, NORMAL, KINDS };
    for (int i = 0; i < 6 * 3 * 4 * KINDS; i++) {
        const int *size = sizes[i % 6], channels = i / 18 % 4 + 1, kind = i / 72;
        const txm_sample sample = (txm_sample)(i / 6 % 3);
        const int w = (size[0] + 1) / 2, h = (size[1] + 1) / 2;
        if (kind == NORMAL && channels < 3) continue;
        txm_image from = new_image(size[0], size[1], channels, sample);
        texpatch_map map;
        memset(&map, 0, sizeof map);
        map.is_data = kind == DATA;
        map.is_label = kind == LABEL;
        map.is_normal = kind == NORMAL ? 1 + i % 2 : 0;
        for (int p = 0; p < size[0] * size[1]; p++) {
            float v[4];
            for (int c = 0; c < 4; c++) v[c] = (float)at_random(p, c, i) / 255;
            if (kind == NORMAL) {
                const txm_vec3 n = txm_vec3_normalize(txm_v3(v[0] - 0.5f, v[1] - 0.5f, v[2]));
                v[0] = 0.5f + 0.5f * n.x;
                v[1] = 0.5f + 0.5f * n.y;
                v[2] = 0.5f + 0.5f * n.z;
            }
            for (int c = 0; c < channels; c++) /* floats beyond 0..1 are means like others */
                txm_image_set(&from, p % size[0], p / size[0], c,
                              sample == TXM_F32 && kind != NORMAL ? 3 * v[c] - 1 : v[c]);
        }
        if (i % 4 == 1) from = flipped(&from);
        const txm_image half = new_image(w, h, channels, sample);
        assert_int_equal(texpatch_half(&from, kind == COLOUR && i % 2 ? NULL : &map, NULL, &half),
                         TXM_OK);
        const double unit = sample == TXM_U8 ? 255 : sample == TXM_U16 ? 65535 : 1e6;
        for (int p = 0; p < w * h; p++) {
            const int x = p % w, y = p / w;
            double mean[4] = {0, 0, 0, 0}, length = 0;
            int n = 0, is_one = 0;
            for (int v = 2 * y; v < 2 * y + 2 && v < size[1]; v++) {
                for (int u = 2 * x; u < 2 * x + 2 && u < size[0]; u++, n++) {
                    is_one |= is_pixel(&half, x, y, &from, u, v);
                    for (int c = 0; c < channels; c++) {
                        const int is_alpha = channels % 2 == 0 && c == channels - 1;
                        const double g = (double)txm_image_get(&from, u, v, c);
                        const int is_coded = kind == COLOUR && sample != TXM_F32 && !is_alpha;
                        mean[c] += is_coded ? decode(g) : g;
                    }
                }
            }
            if (kind == LABEL) {
                assert_true(is_one);
                continue;
            }
            for (int c = 0; c < channels; c++) mean[c] /= n;
            for (int c = 0; c < 3 && kind == NORMAL; c++)
                length += (2 * mean[c] - 1) * (2 * mean[c] - 1);
            for (int c = 0; c < channels; c++) {
                const int is_alpha = channels % 2 == 0 && c == channels - 1;
                const double got = (double)txm_image_get(&half, x, y, c);
                if (kind == NORMAL && c < 3) mean[c] = 0.5 + 0.5 * (2 * mean[c] - 1) / sqrt(length);
                if (kind == COLOUR && sample != TXM_F32 && !is_alpha) mean[c] = encode(mean[c]);
                if (!(fabs(got - mean[c]) * unit <= 0.6 + (sample == TXM_F32 ? 1 : 0)))
                    fail_msg("case %d, (%d, %d) %d: %.8g, not %.8g", i, x, y, c, got, mean[c]);
            }
        }
        if (kind == NORMAL && sample != TXM_F32) check_lengths(&half);
    }

    /* normals that cancel each other out */
    txm_image flat = new_image(2, 1, 3, TXM_F32), one = new_image(1, 1, 3, TXM_F32);
    static const float opposed[6] = {1, 0.5f, 0.5f, 0, 0.5f, 0.5f}, up[3] = {0.5f, 0.5f, 1};
    texpatch_map map;
    memset(&map, 0, sizeof map);
    map.is_normal = 1;
    memcpy(flat.pixels, opposed, sizeof opposed);
    assert_int_equal(texpatch_half(&flat, &map, NULL, &one), TXM_OK);
    assert_memory_equal(one.pixels, up, sizeof up);

    /* refused */
    txm_image odd = new_image(5, 5, 3, TXM_U8), good = new_image(3, 3, 3, TXM_U8), bad[5];
    for (int k = 0; k < 5; k++) bad[k] = good;
    bad[0].width = 2;
    bad[1].height = 2;
    bad[2].channels = 1;
    bad[3] = new_image(3, 3, 3, TXM_U16);
    bad[4].pixels = NULL;
    for (int k = 0; k < 5; k++) {
        txm_env env = {0};
        assert_int_equal(texpatch_half(&odd, NULL, &env, &bad[k]), TXM_BAD_ARGUMENT);
        assert_true(env.message[0] != 0);
    }
    assert_int_equal(texpatch_half(NULL, NULL, NULL, &good), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_half(&odd, NULL, NULL, NULL), TXM_BAD_ARGUMENT);
    odd.channels = good.channels = 1;
    assert_int_equal(texpatch_half(&odd, &map, NULL, &good), TXM_BAD_ARGUMENT);
    odd.width = 1 << 15;
    odd.height = 1 << 15;
    assert_int_equal(texpatch_half(&odd, NULL, NULL, &good), TXM_TOO_LARGE);
    assert_true(is_filled(&good) && is_filled(&bad[3]));
}

/* ---- bad input -------------------------------------------------------------------------- */

/* A description in which everything is given, and its pictures. */
typedef struct whole {
    txm_image maps[2][5], kept[5], out[5];
    texpatch_map kinds[5];
    texpatch_exemplar exemplars[2];
    texpatch_desc desc;
} whole;

static void make_whole(whole *t) {
    memset(t, 0, sizeof *t);
    for (int i = 0; i < 2; i++) {
        t->maps[i][0] = draw_gravel(36, 32, 3, 20 * i);
        t->maps[i][1] = converted(&t->maps[i][0], TXM_F32, 1, 0);
        t->exemplars[i].maps = t->maps[i];
        t->exemplars[i].guide = new_mask(36, 32, 255 * i);
        t->exemplars[i].mask = new_mask(36, 32, 1);
    }
    t->kinds[0].weight = 1;
    for (int m = 0; m < 2; m++) {
        t->kept[m] = new_image(48, 40, 3, m ? TXM_F32 : TXM_U8);
        t->out[m] = new_image(48, 40, 3, m ? TXM_F32 : TXM_U8);
        for (int i = 0; i < 48 * 40 * 3; i++)
            txm_image_set(&t->kept[m], i / 3 % 48, i / 3 / 48, i % 3, 0.5f);
    }
    t->desc = desc_of(t->exemplars, 2, 2, 48, 40);
    t->desc.maps = t->kinds;
    t->desc.passes = 1;
    t->desc.guide = new_mask(48, 40, 0);
    fill_box(&t->desc.guide, 20, 0, 48, 40, 255);
    t->desc.guide_mask = new_mask(48, 40, 1);
    t->desc.kept = t->kept;
    t->desc.keep = new_mask(48, 40, 0);
    fill_box(&t->desc.keep, 10, 10, 20, 18, 1);
}

/* both: the plane refuses it too; otherwise it does not look there */
static void refuse(whole *t, txm_status expected, int both) {
    txm_env env = {0};
    texpatch_job *job = (texpatch_job *)t;
    texpatch_plane *plane = (texpatch_plane *)t;
    txm_status status = texpatch_make(&t->desc, &env, t->out);
    if (status != expected) fail_msg("make: %d, not %d: %s", status, expected, env.message);
    assert_true(env.message[0] != 0 && is_filled(&t->out[0]) && is_filled(&t->out[1]));
    memset(env.message, 0, sizeof env.message);
    assert_int_equal(texpatch_begin(&t->desc, &env, &job), expected);
    assert_true(env.message[0] != 0 && job == NULL);
    assert_int_equal(texpatch_begin(&t->desc, NULL, &job), expected);
    memset(env.message, 0, sizeof env.message);
    status = texpatch_plane_make(&t->desc, &env, &plane);
    if (status != (both ? expected : TXM_OK)) fail_msg("plane: %d, %s", status, env.message);
    assert_true(both ? env.message[0] != 0 && plane == NULL : plane != NULL);
    texpatch_plane_free(plane);
}

/* Each of values in a field of the description, then as it was. */
#define REFUSE_EACH(field, type, expected, both, ...)                 \
    do {                                                              \
        type values[] = {__VA_ARGS__};                                \
        type was = t.field;                                           \
        for (size_t k = 0; k < sizeof values / sizeof *values; k++) { \
            t.field = values[k];                                      \
            refuse(&t, expected, both);                               \
        }                                                             \
        t.field = was;                                                \
    } while (0)

static void test_refuses(void **state) {
    (void)state;
    whole t;
    make_whole(&t);
    made(&t.desc, NULL); /* nothing is wrong with it */
    REFUSE_EACH(desc.exemplars, const texpatch_exemplar *, TXM_BAD_ARGUMENT, 1, NULL);
    REFUSE_EACH(desc.exemplar_count, int, TXM_BAD_ARGUMENT, 1, 0, -1, 9, INT_MAX, INT_MIN);
    REFUSE_EACH(desc.map_count, int, TXM_BAD_ARGUMENT, 1, 0, -1, 17, INT_MAX);
    REFUSE_EACH(desc.width, int, TXM_BAD_ARGUMENT, 0, 0, -1, INT_MIN);
    REFUSE_EACH(desc.height, int, TXM_BAD_ARGUMENT, 0, 0, -1, INT_MIN);
    REFUSE_EACH(desc.width, int, TXM_TOO_LARGE, 0, INT_MAX, TEXPATCH_MAX_PIXELS / 40 + 1);
    REFUSE_EACH(desc.tileable, int, TXM_BAD_ARGUMENT, 0, -1, 4, INT_MAX);
    REFUSE_EACH(desc.patch, int, TXM_BAD_ARGUMENT, 1, -1, 8193, INT_MAX, INT_MIN);
    REFUSE_EACH(desc.passes, int, TXM_BAD_ARGUMENT, 1, -2, 17, INT_MAX, INT_MIN);
    REFUSE_EACH(desc.turns, int, TXM_BAD_ARGUMENT, 1, -1, 3, 5, 8, INT_MAX);
    REFUSE_EACH(desc.novelty, float, TXM_BAD_ARGUMENT, 1, -0.1f, 1.1f, NAN, INFINITY);
    REFUSE_EACH(desc.guide_weight, float, TXM_BAD_ARGUMENT, 1, -1, 16.5f, NAN, INFINITY);
    REFUSE_EACH(desc.lattice, int, TXM_BAD_ARGUMENT, 1, -2, 2, INT_MAX);
    t.desc.lattice = 1;
    refuse(&t, TXM_BAD_ARGUMENT, 1); /* steps of no length */
    t.desc.lattice_vectors[0] = 10;
    t.desc.lattice_vectors[3] = 10;
    REFUSE_EACH(desc.lattice_vectors[2], float, TXM_BAD_ARGUMENT, 1, NAN, INFINITY, 1e6f);
    REFUSE_EACH(desc.lattice_vectors[3], float, TXM_BAD_ARGUMENT, 1, 0, 1.5f, NAN);
    t.desc.lattice = 0;
    REFUSE_EACH(kinds[0].weight, float, TXM_BAD_ARGUMENT, 1, 0, -1, 16.5f, NAN, INFINITY);
    REFUSE_EACH(kinds[1].weight, float, TXM_BAD_ARGUMENT, 1, -1, 17, NAN);

    /* pictures that do not go together, or are none */
    for (int i = 0; i < 2; i++) {
        REFUSE_EACH(exemplars[i].maps, const txm_image *, TXM_BAD_ARGUMENT, 1, NULL);
        for (int m = 0; m < 2; m++) {
            REFUSE_EACH(maps[i][m].pixels, void *, TXM_BAD_ARGUMENT, 1, NULL);
            REFUSE_EACH(maps[i][m].channels, int, TXM_BAD_ARGUMENT, 1, 5, -1);
            REFUSE_EACH(maps[i][m].stride, ptrdiff_t, TXM_BAD_ARGUMENT, 1, 20, -20);
            REFUSE_EACH(maps[i][m].sample, txm_sample, TXM_BAD_ARGUMENT, 1, (txm_sample)3);
            if (m) REFUSE_EACH(maps[i][m].width, int, TXM_BAD_ARGUMENT, 1, 35, 0);
            if (m) REFUSE_EACH(maps[i][m].height, int, TXM_BAD_ARGUMENT, 1, 31, -1);
            if (i) REFUSE_EACH(maps[i][m].channels, int, TXM_BAD_ARGUMENT, 1, 1, 2);
            if (i && m) REFUSE_EACH(maps[i][m].sample, txm_sample, TXM_BAD_ARGUMENT, 1, TXM_U8);
        }
        REFUSE_EACH(exemplars[i].guide.pixels, void *, TXM_BAD_ARGUMENT, 0, NULL);
        REFUSE_EACH(exemplars[i].guide.width, int, TXM_BAD_ARGUMENT, 0, 35, 0);
        REFUSE_EACH(exemplars[i].guide.height, int, TXM_BAD_ARGUMENT, 0, 16);
        REFUSE_EACH(exemplars[i].mask.width, int, TXM_BAD_ARGUMENT, 1, 35, 0);
        REFUSE_EACH(exemplars[i].mask.height, int, TXM_BAD_ARGUMENT, 1, 31, -1);
        REFUSE_EACH(exemplars[i].mask.channels, int, TXM_BAD_ARGUMENT, 1, -1, 2, 3, 5);
        float *sample = (float *)t.maps[i][1].pixels + 777, was = *sample;
        for (int k = 0; k < 3; k++) {
            *sample = k == 0 ? NAN : k == 1 ? INFINITY : -INFINITY;
            refuse(&t, TXM_BAD_ARGUMENT, 1);
        }
        *sample = was;
    }
    REFUSE_EACH(desc.guide.pixels, void *, TXM_BAD_ARGUMENT, 0, NULL);
    REFUSE_EACH(desc.guide.width, int, TXM_BAD_ARGUMENT, 0, 47, 0);
    REFUSE_EACH(desc.guide.height, int, TXM_BAD_ARGUMENT, 0, 39);
    REFUSE_EACH(desc.guide_mask.width, int, TXM_BAD_ARGUMENT, 0, 47, 0);
    REFUSE_EACH(desc.keep.pixels, void *, TXM_BAD_ARGUMENT, 0, NULL);
    REFUSE_EACH(desc.keep.width, int, TXM_BAD_ARGUMENT, 0, 47, 0);
    REFUSE_EACH(kept[1].pixels, void *, TXM_BAD_ARGUMENT, 0, NULL);
    REFUSE_EACH(kept[1].width, int, TXM_BAD_ARGUMENT, 0, 47, 0);
    REFUSE_EACH(kept[1].channels, int, TXM_BAD_ARGUMENT, 0, 1, 2);
    REFUSE_EACH(kept[1].sample, txm_sample, TXM_BAD_ARGUMENT, 0, TXM_U8);
    ((float *)t.kept[1].pixels)[5] = NAN;
    refuse(&t, TXM_BAD_ARGUMENT, 0);
    ((float *)t.kept[1].pixels)[5] = 0;

    /* too small, too large */
    for (int i = 0; i < 2; i++) {
        const whole was = t;
        for (int m = 0; m < 2; m++) t.maps[i][m].height = 31;
        t.exemplars[i].guide.height = t.exemplars[i].mask.height = 31;
        refuse(&t, TXM_TOO_SMALL, 1);
        memcpy(&t, &was, sizeof t);
    }
    whole plain;
    memset(&plain, 0, sizeof plain);
    plain.maps[0][0] = draw_gravel(32, 32, 1, 0);
    plain.exemplars[0].maps = plain.maps[0];
    plain.desc = desc_of(plain.exemplars, 1, 1, 40, 31);
    plain.out[0] = plain.out[1] = new_image(40, 31, 1, TXM_U8);
    plain.desc.tileable = TEXPATCH_TILE_Y;
    refuse(&plain, TXM_TOO_SMALL, 0);
    plain.desc.tileable = TEXPATCH_TILE_X;
    made(&plain.desc, NULL);
    plain.kinds[0].weight = 1;
    plain.kinds[0].is_normal = 1; /* of one channel */
    plain.desc.maps = plain.kinds;
    refuse(&plain, TXM_BAD_ARGUMENT, 1);
    plain.desc.maps = NULL;
    plain.maps[0][0] = new_image(8193, 32, 1, TXM_U8);
    refuse(&plain, TXM_TOO_LARGE, 1);
    plain.maps[0][0] = new_image(32, 8192, 1, TXM_U8);
    plain.desc.turns = 4;
    refuse(&plain, TXM_TOO_LARGE, 1); /* too many rows */
    plain.desc.turns = 0;
    for (int m = 0; m < 5; m++) {
        plain.maps[0][m] = new_image(32, 32, 4, TXM_U8);
        plain.kinds[m].weight = 1;
        plain.kinds[m].is_normal = 0;
    }
    plain.desc.map_count = 5;
    plain.desc.maps = plain.kinds;
    refuse(&plain, TXM_TOO_LARGE, 1); /* 20 channels */

    /* the output */
    txm_image good = t.out[1];
    for (int k = 0; k < 6; k++) {
        txm_env env = {0};
        t.out[1] = good;
        if (k == 0) t.out[1].pixels = NULL;
        if (k == 1) t.out[1].width = 47;
        if (k == 2) t.out[1].height = 39;
        if (k == 3) t.out[1].channels = 1;
        if (k == 4) t.out[1].sample = TXM_U8;
        if (k == 5) t.out[1].stride = 8;
        assert_int_equal(texpatch_make(&t.desc, &env, t.out), TXM_BAD_ARGUMENT);
        assert_true(env.message[0] != 0 && is_filled(&t.out[0]) && is_filled(&good));
    }
    assert_int_equal(texpatch_make(&t.desc, NULL, NULL), TXM_BAD_ARGUMENT);
    t.out[1] = good;
    assert_int_equal(texpatch_make(NULL, NULL, t.out), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_begin(&t.desc, NULL, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_plane_make(&t.desc, NULL, NULL), TXM_BAD_ARGUMENT);
}

static void test_job_refuses(void **state) {
    (void)state;
    whole t;
    make_whole(&t);
    texpatch_job *job = begin(&t.desc), *free_one;
    txm_image out = t.out[0];
    assert_int_equal(texpatch_draw(job, 0, 0, 0, NULL, out), TXM_BAD_ARGUMENT); /* no step yet */
    assert_int_equal(texpatch_draw(NULL, 0, 0, 0, NULL, out), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_step(NULL, NULL, NULL), TXM_BAD_ARGUMENT);
    assert_true(texpatch_done(job) == 0 && texpatch_done(NULL) == 1);
    run(job);
    static const int places[6][2] = {{-1, 0}, {0, -1}, {1, 0}, {0, 1}, {INT_MAX, 0}, {0, INT_MIN}};
    for (int k = 0; k < 6; k++)
        assert_int_equal(texpatch_draw(job, 0, places[k][0], places[k][1], NULL, out),
                         TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_draw(job, 2, 0, 0, NULL, out), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_draw(job, -1, 0, 0, NULL, out), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_draw(job, 1, 0, 0, NULL, out), TXM_BAD_ARGUMENT); /* 8 bit */
    out.channels = 1;
    assert_int_equal(texpatch_draw(job, 0, 0, 0, NULL, out), TXM_BAD_ARGUMENT);
    out.channels = 3;
    out.pixels = NULL;
    assert_int_equal(texpatch_draw(job, 0, 0, 0, NULL, out), TXM_BAD_ARGUMENT);
    assert_true(is_filled(&t.out[0]));

    const txm_image before = drawn(job, 0, &t.maps[0][0], 48, 40);
    const txm_image all = new_mask(48, 40, 1), guide = new_mask(48, 40, 0);
    for (int k = 0; k < 8; k++) {
        txm_env env = {0};
        txm_image mask = all, g = guide, m = all;
        if (k == 0) mask.width = 47;
        if (k == 1) mask.pixels = NULL;
        if (k == 2) mask.height = 20;
        if (k == 3) mask = view(new_image(48, 40, 3, TXM_U8).pixels, 48, 40, 3, TXM_U8);
        if (k == 4) g.width = 47;
        if (k == 5) g = new_image(48, 40, 2, TXM_U8);
        if (k == 6) g.pixels = NULL;
        if (k == 7) m.height = 39;
        assert_int_equal(texpatch_again(job, &mask, &g, &m, 1, &env), TXM_BAD_ARGUMENT);
        assert_true(env.message[0] != 0);
    }
    assert_int_equal(texpatch_again(NULL, &all, NULL, NULL, 1, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_again(job, NULL, NULL, NULL, 1, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(run(job), 1);
    const txm_image after = drawn(job, 0, &t.maps[0][0], 48, 40);
    assert_true(is_same(&before, &after));
    texpatch_free(job);

    /* a guide for a job that was begun without one */
    const texpatch_exemplar e = exemplar_of(t.maps[0]);
    const texpatch_desc d = desc_of(&e, 1, 2, 48, 40);
    free_one = begin(&d);
    assert_int_equal(texpatch_again(free_one, &all, &guide, NULL, 1, NULL), TXM_BAD_ARGUMENT);
    assert_true(texpatch_done(free_one) == 0); /* not even begun */
    texpatch_free(free_one);
    texpatch_free(NULL);
}

/* ---- misfortune -------------------------------------------------------------------------- */

/* Every progress call in turn cancels texpatch_make, every allocation in turn fails. */
static void test_make_misfortune(void **state) {
    (void)state;
    whole t;
    make_whole(&t);
    for (int failing = 0; failing < 3; failing++) {
        for (long k = 1;; k++) {
            tk_memory memory = {0};
            tk_progress progress = {0};
            txm_env env = tk_env(&memory, &progress);
            if (failing == 2 && k == 16) break; /* the later ones are no news */
            if (!failing) progress.cancel_at = k;
            else memory.fail_at = k;
            memory.fail_onward = failing == 2;
            for (int m = 0; m < 2; m++) memset(t.out[m].pixels, FILL, bytes_of(&t.out[m]));
            const txm_status status = texpatch_make(&t.desc, &env, t.out);
            assert_int_equal(tk_leaks(&memory), 0);
            assert_int_equal(progress.errors, 0);
            assert_int_equal(progress.late, 0);
            if (failing ? memory.calls < k : progress.calls < k) {
                assert_int_equal(status, TXM_OK);
                assert_true(k > 10 && !is_filled(&t.out[0]) && !is_filled(&t.out[1]));
                break;
            }
            assert_int_equal(status, failing ? TXM_OUT_OF_MEMORY : TXM_CANCELLED);
            assert_true(env.message[0] != 0);
            assert_true(is_filled(&t.out[0]) && is_filled(&t.out[1]));
        }
    }
}

/* A call on a job that fails in every possible way before it succeeds. what: 0 step, 1 again */
static int stumble(texpatch_job *job, tk_memory *memory, int failing, const txm_image *again,
                   const txm_image *guide) {
    for (long k = 1;; k++) {
        tk_progress progress = {0};
        const long blocks = memory->blocks, calls = memory->calls;
        const float done = texpatch_done(job);
        int more = 1;
        if (!failing) progress.cancel_at = k;
        else memory->fail_at = calls + k;
        txm_env env = tk_env(memory, &progress);
        const txm_status status = again ? texpatch_again(job, again, guide, NULL, 4, &env)
                                        : texpatch_step(job, &env, &more);
        assert_true(progress.errors == 0 && progress.late == 0 && memory->errors == 0);
        if (failing ? memory->calls - calls < k : progress.calls < k) {
            assert_int_equal(status, TXM_OK);
            memory->fail_at = 0;
            if (!again) assert_true(texpatch_done(job) > done || !more);
            return more;
        }
        assert_int_equal(status, failing ? TXM_OUT_OF_MEMORY : TXM_CANCELLED);
        assert_true(env.message[0] != 0);
        assert_int_equal(memory->blocks, blocks); /* as before the step */
        assert_true(texpatch_done(job) == done);
    }
}

/* The same for single steps, and for a part anew: the bytes are those of a job without trouble. */
static void test_step_misfortune(void **state) {
    (void)state;
    whole t;
    make_whole(&t);
    /* two levels, so that steps refine too */
    const txm_image gravel = draw_gravel(98, 96, 1, 0);
    const texpatch_exemplar e = exemplar_of(&gravel);
    const texpatch_desc large = desc_of(&e, 1, 1, 70, 50);
    for (int which = 0; which < 2; which++) {
        texpatch_desc d = which ? large : t.desc;
        d.passes = 1;
        const int w = d.width, h = d.height;
        const txm_image mask = new_mask(w, h, 0), guide = new_mask(w, h, 0);
        fill_box(&mask, 12, 5, 40, 30, 1);
        const txm_image *new_guide = which ? NULL : &guide;
        texpatch_job *job = begin(&d);
        run(job);
        assert_int_equal(texpatch_again(job, &mask, new_guide, NULL, 4, NULL), TXM_OK);
        run(job);
        const txm_image wanted = drawn(job, 0, &d.exemplars[0].maps[0], w, h);
        texpatch_free(job);
        for (int failing = 0; failing < 2; failing++) {
            tk_memory memory = {0};
            txm_env env = tk_env(&memory, NULL);
            job = NULL;
            for (long k = 1; failing && !job; k++) {
                memory.fail_at = memory.calls + k;
                const txm_status status = texpatch_begin(&d, &env, &job);
                assert_int_equal(status, job ? TXM_OK : TXM_OUT_OF_MEMORY);
                if (!job) assert_int_equal(tk_leaks(&memory), 0);
            }
            memory.fail_at = 0;
            if (!job) assert_int_equal(texpatch_begin(&d, &env, &job), TXM_OK);
            while (stumble(job, &memory, failing, NULL, NULL)) {
            }
            stumble(job, &memory, failing, &mask, new_guide);
            while (stumble(job, &memory, failing, NULL, NULL)) {
            }
            const txm_image out = drawn(job, 0, &d.exemplars[0].maps[0], w, h);
            assert_true(is_same(&out, &wanted));
            texpatch_free(job);
            assert_int_equal(tk_leaks(&memory), 0);
        }
    }
}

/* done rises from 0 to 1 from step to step, and what is reported with it; so it does for a part */
static void test_progress(void **state) {
    (void)state;
    const txm_image gravel = draw_gravel(96, 98, 3, 0);
    const texpatch_exemplar e = exemplar_of(&gravel);
    const texpatch_desc d = desc_of(&e, 1, 1, 96, 100);
    texpatch_job *job = begin(&d);
    const txm_image mask = new_mask(96, 100, 0);
    fill_box(&mask, 40, 40, 60, 70, 1);
    for (int part = 0; part < 2; part++) {
        tk_progress progress = {0};
        txm_env env = tk_env(NULL, &progress);
        float done = texpatch_done(job);
        assert_true(done == 0);
        for (int more = 1; more;) {
            assert_int_equal(texpatch_step(job, &env, &more), TXM_OK);
            assert_true(texpatch_done(job) > done && texpatch_done(job) <= 1);
            assert_true(progress.last <= texpatch_done(job));
            done = texpatch_done(job);
            assert_true((done == 1) == !more);
        }
        assert_int_equal(progress.errors, 0);
        assert_true(progress.calls > 20);
        if (!part) assert_int_equal(texpatch_again(job, &mask, NULL, NULL, 2, NULL), TXM_OK);
    }
    texpatch_free(job);
}

static void test_plane_misfortune(void **state) {
    (void)state;
    const txm_image noise = draw_noise(32, 32, 1, 0, 1, 128);
    const texpatch_exemplar e = exemplar_of(&noise);
    texpatch_desc d = desc_of(&e, 1, 1, 0, 0);
    d.passes = -1;
    tk_memory memory = {0};
    txm_env env = tk_env(&memory, NULL);
    texpatch_plane *plane = NULL;
    for (long k = 1; !plane; k++) {
        memory.fail_at = memory.calls + k;
        const txm_status status = texpatch_plane_make(&d, &env, &plane);
        assert_int_equal(status, plane ? TXM_OK : TXM_OUT_OF_MEMORY);
        if (!plane) assert_int_equal(tk_leaks(&memory), 0);
    }
    memory.fail_at = 0;
    const txm_image wanted = new_image(20, 20, 1, TXM_U8), out = new_image(20, 20, 1, TXM_U8);
    assert_int_equal(texpatch_plane_draw(plane, 30, 40, NULL, &wanted, NULL), TXM_OK);
    for (int failing = 0; failing < 2; failing++) {
        /* many alike: the first ones, then some of them */
        for (long k = 1;; k += k < 4 ? 1 : failing ? 23 : 19) {
            const long blocks = memory.blocks, calls = memory.calls;
            tk_progress progress = {0};
            if (!failing) progress.cancel_at = k;
            else memory.fail_at = calls + k;
            env = tk_env(&memory, &progress);
            const txm_status status = texpatch_plane_draw(plane, 30, 40, &env, &out, NULL);
            memory.fail_at = 0;
            assert_int_equal(memory.blocks, blocks);
            assert_true(progress.errors == 0 && progress.late == 0 && memory.errors == 0);
            if (failing ? memory.calls - calls < k : progress.calls < k) {
                assert_int_equal(status, TXM_OK);
                break;
            }
            assert_int_equal(status, failing ? TXM_OUT_OF_MEMORY : TXM_CANCELLED);
            assert_true(env.message[0] != 0);
        }
        assert_true(is_same(&out, &wanted));
    }
    texpatch_plane_free(plane);
    assert_int_equal(tk_leaks(&memory), 0);
}

/* ---- all tests -------------------------------------------------------------------------- */

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(test_places, release_all),
        cmocka_unit_test_teardown(test_turns, release_all),
        cmocka_unit_test_teardown(test_samples, release_all),
        cmocka_unit_test_teardown(test_sizes, release_all),
        cmocka_unit_test_teardown(test_seeds_and_threads, release_all),
        cmocka_unit_test_teardown(test_register, release_all),
        cmocka_unit_test_teardown(test_tileable, release_all),
        cmocka_unit_test_teardown(test_lattice, release_all),
        cmocka_unit_test_teardown(test_lattice_torus, release_all),
        cmocka_unit_test_teardown(test_guide, release_all),
        cmocka_unit_test_teardown(test_keep, release_all),
        cmocka_unit_test_teardown(test_exemplars, release_all),
        cmocka_unit_test_teardown(test_masks, release_all),
        cmocka_unit_test_teardown(test_again, release_all),
        cmocka_unit_test_teardown(test_again_guide, release_all),
        cmocka_unit_test_teardown(test_plane_windows, release_all),
        cmocka_unit_test_teardown(test_plane_looks, release_all),
        cmocka_unit_test_teardown(test_novelty, release_all),
        cmocka_unit_test_teardown(test_passes, release_all),
        cmocka_unit_test_teardown(test_half, release_all),
        cmocka_unit_test_teardown(test_refuses, release_all),
        cmocka_unit_test_teardown(test_job_refuses, release_all),
        cmocka_unit_test_teardown(test_make_misfortune, release_all),
        cmocka_unit_test_teardown(test_step_misfortune, release_all),
        cmocka_unit_test_teardown(test_progress, release_all),
        cmocka_unit_test_teardown(test_plane_misfortune, release_all),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
