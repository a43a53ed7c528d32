/* patchkit.h - what the tests of texpatch.h share: pictures, exemplars, jobs
   SPDX-License-Identifier: MIT OR Unlicense

   Includes cmocka.h, texpatch.h and testkit.h. With TEXPATCH_TEST_SHOW in the environment the
   measured values are printed.                                                                */
#ifndef PATCHKIT_H
#define PATCHKIT_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <limits.h>
#include <stdint.h>
#include <time.h>

#include <cmocka.h>

#include "texpatch.h"

#include "images.h"
#include "testkit.h"

/* ---- helpers ---------------------------------------------------------------------------- */

enum { FILL = 0x5c };

/* what a test has allocated; released after it */
static void *pool[2048];
static int pool_count;

static inline void *need(size_t bytes) {
    void *p = malloc(bytes);
    if (!p || pool_count == 2048) abort();
    pool[pool_count++] = p;
    return p;
}

static inline void show(const char *what, double value) {
    if (getenv("TEXPATCH_TEST_SHOW")) printf("# %s: %.4f\n", what, value);
}

static inline int release_all(void **state) {
    (void)state;
    while (pool_count > 0) free(pool[--pool_count]);
    show("seconds until now", (double)clock() / CLOCKS_PER_SEC);
    return 0;
}

static inline void assert_between(const char *what, double x, double low, double high) {
    show(what, x);
    if (!(x >= low && x <= high)) fail_msg("%s: %.9g is not in %g..%g", what, x, low, high);
}

static inline size_t bytes_of(const txm_image *im) {
    return (size_t)im->width * (size_t)im->height * (size_t)im->channels *
           txm_sample_bytes(im->sample);
}

static inline txm_image new_image(int width, int height, int channels, txm_sample sample) {
    txm_image im = view(NULL, width, height, channels, sample);
    im.pixels = need(bytes_of(&im));
    memset(im.pixels, FILL, bytes_of(&im));
    return im;
}

/* the same picture, its rows bottom-up in memory */
static inline txm_image flipped(const txm_image *from) {
    txm_image to = new_image(from->width, from->height, from->channels, from->sample);
    const size_t row = bytes_of(from) / (size_t)from->height;
    to.stride = -(ptrdiff_t)row;
    to.pixels = (char *)to.pixels + row * (size_t)(from->height - 1);
    for (int y = 0; y < from->height; y++)
        memcpy(txm_image_row(&to, y), txm_image_row_const(from, y), row);
    return to;
}

/* the same values in another sample type, times scale plus shift */
static inline txm_image converted(const txm_image *from, txm_sample sample, float scale,
                                  float shift) {
    txm_image to = new_image(from->width, from->height, from->channels, sample);
    for (int y = 0; y < to.height; y++) {
        for (int x = 0; x < to.width; x++) {
            for (int c = 0; c < to.channels; c++)
                txm_image_set(&to, x, y, c, txm_image_get(from, x, y, c) * scale + shift);
        }
    }
    return to;
}

static inline int is_same(const txm_image *a, const txm_image *b) {
    const size_t row = bytes_of(a) / (size_t)a->height;
    assert_true(bytes_of(a) == bytes_of(b) && a->height == b->height);
    for (int y = 0; y < a->height; y++) {
        if (memcmp(txm_image_row_const(a, y), txm_image_row_const(b, y), row) != 0) return 0;
    }
    return 1;
}

/* is pixel (x, y) of a, to the byte, pixel (u, v) of b? */
static inline int is_pixel(const txm_image *a, int x, int y, const txm_image *b, int u, int v) {
    const size_t n = (size_t)a->channels * txm_sample_bytes(a->sample);
    return memcmp((const char *)txm_image_row_const(a, y) + (size_t)x * n,
                  (const char *)txm_image_row_const(b, v) + (size_t)u * n, n) == 0;
}

static inline int is_filled(const txm_image *im) {
    const unsigned char *p = (const unsigned char *)im->pixels;
    for (size_t i = 0; i < bytes_of(im); i++) {
        if (p[i] != FILL) return 0;
    }
    return 1;
}

static inline txm_image new_mask(int width, int height, int value) {
    const txm_image im = new_image(width, height, 1, TXM_U8);
    memset(im.pixels, value, bytes_of(&im));
    return im;
}

static inline void fill_box(const txm_image *mask, int x0, int y0, int x1, int y1, int value) {
    for (int y = y0; y < y1; y++)
        memset((uint8_t *)mask->pixels + y * mask->width + x0, value, (size_t)(x1 - x0));
}

static inline int mask_at(const txm_image *mask, int x, int y) {
    return ((const uint8_t *)txm_image_row_const(mask, y))[x];
}

/* difference of two pixels, 0..1 per channel, mean of the channels */
static inline double step(const txm_image *im, int x, int y, int u, int v) {
    double sum = 0;
    for (int c = 0; c < im->channels; c++)
        sum += fabs((double)txm_image_get(im, x, y, c) - (double)txm_image_get(im, u, v, c));
    return sum / im->channels;
}

static inline double mean_of(const txm_image *im, int c) {
    double sum = 0;
    for (int y = 0; y < im->height; y++) {
        for (int x = 0; x < im->width; x++) sum += (double)txm_image_get(im, x, y, c);
    }
    return sum / im->width / im->height;
}

/* ---- exemplars -------------------------------------------------------------------------- */

/* smooth noise 0..1 with features of size pixels */
static inline double smooth(double x, double y, double size, int which) {
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
static inline txm_image draw_gravel(int width, int height, int channels, int which) {
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

/* Noise without a lattice: random values averaged over a disk, stretched, around a level. */
static inline txm_image draw_noise(int width, int height, int channels, int which, int radius,
                                   int level) {
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
static inline txm_image draw_bricks(int width, int height, int step_x, int step_y) {
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

/* 16 bit: each pixel its own number */
static inline txm_image draw_numbers(int width, int height) {
    const txm_image im = new_image(width, height, 1, TXM_U16);
    for (int i = 0; i < width * height; i++) ((uint16_t *)im.pixels)[i] = (uint16_t)(i + 1);
    return im;
}

/* Hills of 16 bit, and their normals by central differences. sense 1: y up, 2: y down. */
enum { SLOPE = 16 }; /* of the hills, when 65536 is a pixel's height */
static inline txm_image draw_hills(int width, int height) {
    const txm_image im = new_image(width, height, 1, TXM_U16);
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++)
            ((uint16_t *)im.pixels)[y * width + x] =
                (uint16_t)(20000 + 20000 * smooth(x, y, 9, 40) + 8000 * smooth(x, y, 5, 41));
    }
    return im;
}

static inline txm_vec3 normal_of(const txm_image *hills, int x, int y, int sense) {
    const int l = txm_clampi(x - 1, 0, hills->width - 1),
              r = txm_clampi(x + 1, 0, hills->width - 1);
    const int t = txm_clampi(y - 1, 0, hills->height - 1),
              b = txm_clampi(y + 1, 0, hills->height - 1);
    const float dx = (txm_image_get(hills, r, y, 0) - txm_image_get(hills, l, y, 0)) * SLOPE;
    const float dy = (txm_image_get(hills, x, b, 0) - txm_image_get(hills, x, t, 0)) * SLOPE;
    return txm_vec3_normalize(txm_v3(-dx, sense == 2 ? -dy : dy, 1));
}

static inline txm_image draw_normals(const txm_image *hills, int sense, txm_sample sample) {
    const txm_image im = new_image(hills->width, hills->height, 3, sample);
    for (int y = 0; y < im.height; y++) {
        for (int x = 0; x < im.width; x++) {
            const txm_vec3 n = normal_of(hills, x, y, sense);
            const float v[3] = {n.x, n.y, n.z};
            for (int c = 0; c < 3; c++)
                txm_image_set(&im, x, y, c, txm_float(txm_normal_encode((double)v[c], sample)));
        }
    }
    return im;
}

/* ---- jobs ------------------------------------------------------------------------------- */

static inline texpatch_exemplar exemplar_of(const txm_image *maps) {
    texpatch_exemplar e;
    memset(&e, 0, sizeof e);
    e.maps = maps;
    return e;
}

static inline texpatch_desc desc_of(const texpatch_exemplar *exemplars, int count, int maps,
                                    int width, int height) {
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

static inline texpatch_job *begin(const texpatch_desc *desc) {
    txm_env env = {0};
    texpatch_job *job = NULL;
    const txm_status status = texpatch_begin(desc, &env, &job);
    if (status != TXM_OK) fail_msg("begin: %d, %s", status, env.message);
    return job;
}

/* all steps that are left; returns how many */
static inline int run(texpatch_job *job) {
    int steps = 0;
    for (int more = 1; more; steps++) {
        assert_true(steps < 1000);
        assert_int_equal(texpatch_step(job, NULL, &more), TXM_OK);
    }
    return steps;
}

/* All steps but the last, which bends pieces and spreads steps of colour. How many there are
   depends on the exemplar, not on the size, unless sides wrap. */
static inline void run_but_one(texpatch_job *job, const texpatch_desc *desc) {
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

static inline txm_image drawn(const texpatch_job *job, int map, const txm_image *like, int width,
                              int height) {
    txm_env env = {0};
    const txm_image out = new_image(width, height, like->channels, like->sample);
    const txm_status status = texpatch_draw(job, map, 0, 0, &env, out);
    if (status != TXM_OK) fail_msg("draw: %d, %s", status, env.message);
    return out;
}

/* all maps in one call; the first is returned, the others go to rest if that is not NULL */
static inline txm_image made_maps(const texpatch_desc *desc, txm_env *env, txm_image *rest) {
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

static inline txm_image made(const texpatch_desc *desc, txm_env *env) {
    return made_maps(desc, env, NULL);
}

static inline int is_whole(texpatch_source s) {
    return s.x == (float)(int)s.x && s.y == (float)(int)s.y;
}

/* One for each pixel of a job. */
static inline texpatch_source *sources_of(const texpatch_job *job, int width, int height) {
    texpatch_source *s = (texpatch_source *)need((size_t)width * (size_t)height * sizeof *s);
    for (int i = 0; i < width * height; i++) s[i] = texpatch_source_at(job, i % width, i / width);
    return s;
}

/* Before the last step every pixel is one of an exemplar's. */
static inline void check_places(const texpatch_job *job, const texpatch_desc *d, int map) {
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

/* ---- measuring -------------------------------------------------------------------------- */

/* mean steps of neighbours along x or y: [0] inside, [1] across the wrap; sums are added up */
static inline void add_steps(const txm_image *im, int down, double sum[2], double count[2]) {
    for (int y = 0; y < im->height; y++) {
        for (int x = 0; x < im->width; x++) {
            const int u = down ? x : (x + 1) % im->width, v = down ? (y + 1) % im->height : y;
            const int wraps = down ? v == 0 : u == 0;
            sum[wraps] += step(im, x, y, u, v);
            count[wraps]++;
        }
    }
}

static inline void check_lengths(const txm_image *normals) {
    for (int y = 0; y < normals->height; y++) {
        for (int x = 0; x < normals->width; x++) {
            double sum = 0;
            for (int c = 0; c < 3; c++) {
                const double v =
                    txm_normal_decode((double)txm_image_get(normals, x, y, c), normals->sample);
                sum += v * v;
            }
            if (!(fabs(sqrt(sum) - 1) <= 1.0 / 127))
                fail_msg("(%d, %d): a normal of length %g", x, y, sqrt(sum));
        }
    }
}

#endif /* PATCHKIT_H */
