/* test_texpatch_edges.c - layers and their boundaries, disturbed strokes, guides
   SPDX-License-Identifier: MIT OR Unlicense

   cc -std=c99 -I. -Itests tests/test_texpatch_edges.c -lcmocka -lpthread -lm                  */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define TEXPATCH_IMPLEMENTATION
#include "texpatch.h"

#include "testkit.h"

/* ---- helpers ---------------------------------------------------------------------------- */

enum { SIDE = 256, FILL = 0x5c };

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

static txm_image gray(uint8_t *pixels, int width, int height) {
    return view(pixels, width, height, 1, TXM_U8);
}

/* thresholds for pictures whose gray is the number of the layer */
static const float by_number[15] = {0.5f / 255,  1.5f / 255,  2.5f / 255,  3.5f / 255,
                                    4.5f / 255,  5.5f / 255,  6.5f / 255,  7.5f / 255,
                                    8.5f / 255,  9.5f / 255,  10.5f / 255, 11.5f / 255,
                                    12.5f / 255, 13.5f / 255, 14.5f / 255};

static texpatch_edges_desc desc_of(txm_image image, int levels, const float *thresholds) {
    texpatch_edges_desc d;
    memset(&d, 0, sizeof d);
    d.image = image;
    d.levels = levels;
    d.thresholds = thresholds;
    return d;
}

static texpatch_edges find(const texpatch_edges_desc *desc) {
    txm_env env = {0};
    texpatch_edges e;
    const txm_status status = texpatch_edges_find(desc, &env, &e);
    if (status != TXM_OK) fail_msg("find: %d, %s", status, env.message);
    return e;
}

/* edges of a picture that holds the numbers of its layers */
static texpatch_edges find_numbers(uint8_t *pixels, int width, int height, int levels) {
    const texpatch_edges_desc d = desc_of(gray(pixels, width, height), levels, by_number);
    return find(&d);
}

static double area_of(const texpatch_edges *e, const texpatch_polyline *line) {
    double sum = 0;
    for (size_t j = 0; j < line->count; j++) {
        const txm_vec2 p = e->points[line->first + j];
        const txm_vec2 q = e->points[line->first + (j + 1) % line->count];
        sum += (double)p.x * q.y - (double)q.x * p.y;
    }
    return sum / 2;
}

/* Everything that must hold for the boundaries of a map of layers. */
static void check_lines(const texpatch_edges *e, const uint8_t *layer) {
    const int w = e->width, h = e->height;
    /* how often each side of each crack is run through: right, down, left, up from a corner */
    uint8_t *used = (uint8_t *)calloc((size_t)(w + 1) * (size_t)(h + 1), 4);
    double area[TEXPATCH_MAX_LEVELS] = {0}, pixels[TEXPATCH_MAX_LEVELS] = {0};
    size_t points = 0, cracks = 0;
    static const int dx[4] = {1, 0, -1, 0}, dy[4] = {0, 1, 0, -1};
    for (size_t i = 0; i < e->line_count; i++) {
        const texpatch_polyline *line = &e->lines[i];
        assert_int_equal(line->first, points);
        points += line->count;
        assert_true(line->count >= 4 && line->layer >= 0 && line->layer < e->levels);
        const double a = area_of(e, line);
        assert_true(line->is_hole ? a < 0 : a > 0);
        area[line->layer] += a;
        for (size_t j = 0; j < line->count; j++) {
            const txm_vec2 p = e->points[line->first + j];
            const txm_vec2 q = e->points[line->first + (j + 1) % line->count];
            const int x = (int)p.x, y = (int)p.y;
            int d = 0;
            assert_true((float)x == p.x && (float)y == p.y);
            while (d < 4 && (x + dx[d] != (int)q.x || y + dy[d] != (int)q.y)) d++;
            if (d == 4)
                fail_msg("line %zu: a step from (%g, %g) to (%g, %g)", i, p.x, p.y, q.x, q.y);
            /* the pixel to the right is the layer's, the one to the left is not */
            const int rx = x - (d == 1 || d == 2), ry = y - (d >= 2);
            const int lx = x - (d >= 2), ly = y - (d == 0 || d == 3);
            assert_int_equal(layer[ry * w + rx], line->layer);
            if (lx >= 0 && ly >= 0 && lx < w && ly < h)
                assert_true(layer[ly * w + lx] != line->layer);
            used[4 * (y * (w + 1) + x) + d]++;
        }
    }
    assert_int_equal(points, e->point_count);
    /* every crack between two layers once from each of its sides */
    for (int y = 0; y < h; y++) {
        for (int x = 0; x < w; x++) {
            const int at[4] = {y * (w + 1) + x, y * (w + 1) + x + 1, (y + 1) * (w + 1) + x + 1,
                               (y + 1) * (w + 1) + x}; /* where its sides begin, clockwise */
            static const int nx[4] = {0, 1, 0, -1}, ny[4] = {-1, 0, 1, 0};
            for (int d = 0; d < 4; d++) {
                const int u = x + nx[d], v = y + ny[d];
                const int outside = u < 0 || v < 0 || u >= w || v >= h;
                const int is_crack = outside || layer[v * w + u] != layer[y * w + x];
                assert_int_equal(used[4 * at[d] + d], is_crack);
                cracks += (size_t)is_crack;
            }
            pixels[layer[y * w + x]] += 1;
        }
    }
    assert_int_equal(cracks, points);
    for (int k = 0; k < e->levels; k++) assert_true(area[k] == pixels[k]);
    free(used);
}

/* No line crosses itself or another: at each corner the ways in and out of all lines, turned by a
   hair to the right where they share a crack, must not interleave. */
static void check_no_crossing(const texpatch_edges *e) {
    const int w = e->width + 1;
    uint8_t *passes = (uint8_t *)calloc((size_t)w * (size_t)(e->height + 1), 4 * 2);
    uint8_t *count = (uint8_t *)calloc((size_t)w * (size_t)(e->height + 1), 1);
    for (size_t i = 0; i < e->line_count; i++) {
        const texpatch_polyline *line = &e->lines[i];
        const txm_vec2 *p = e->points + line->first;
        for (size_t j = 0; j < line->count; j++) {
            const txm_vec2 a = p[(j + line->count - 1) % line->count], b = p[j];
            const txm_vec2 c = p[(j + 1) % line->count];
            const int in = a.x < b.x ? 2 : a.x > b.x ? 0 : a.y < b.y ? 3 : 1; /* its arm */
            const int out = c.x > b.x ? 0 : c.x < b.x ? 2 : c.y > b.y ? 1 : 3;
            const int at = (int)b.y * w + (int)b.x;
            /* arms clockwise at 0, 3, 6, 9; to the right of the way out is clockwise, of the way
               that comes in counterclockwise, seen from the corner */
            passes[8 * at + 2 * count[at]] = (uint8_t)((3 * in + 11) % 12);
            passes[8 * at + 2 * count[at] + 1] = (uint8_t)(3 * out + 1);
            count[at]++;
        }
    }
    for (int at = 0; at < w * (e->height + 1); at++) {
        assert_true(count[at] <= 4);
        for (int i = 0; i < count[at]; i++) {
            for (int j = 0; j < i; j++) {
                const uint8_t *p = passes + 8 * at + 2 * i, *q = passes + 8 * at + 2 * j;
                const int span = (p[1] + 12 - p[0]) % 12;
                const int u = (q[0] + 12 - p[0]) % 12 < span, v = (q[1] + 12 - p[0]) % 12 < span;
                if (u != v) fail_msg("lines cross at corner %d, %d", at % w, at / w);
            }
        }
    }
    free(passes);
    free(count);
}

/* ---- shapes ----------------------------------------------------------------------------- */

static void test_disc(void **state) {
    (void)state;
    static uint8_t pixels[64 * 48];
    double area = 0;
    for (int i = 0; i < 64 * 48; i++) {
        const int x = i % 64 - 30, y = i / 64 - 20;
        pixels[i] = x * x + y * y <= 15 * 15;
        area += pixels[i];
    }
    texpatch_edges e = find_numbers(pixels, 64, 48, 2);
    check_lines(&e, pixels);
    check_no_crossing(&e);
    assert_int_equal(e.line_count, 3); /* the picture's border, the hole in it, the disc */
    assert_int_equal(e.lines[0].layer, 0);
    assert_int_equal(e.lines[0].count, 2 * (64 + 48));
    assert_true(e.points[0].x == 0 && e.points[0].y == 0 && e.points[1].x == 1);
    assert_true(e.lines[1].is_hole && e.lines[1].layer == 0 && area_of(&e, &e.lines[1]) == -area);
    assert_true(!e.lines[2].is_hole && e.lines[2].layer == 1 && area_of(&e, &e.lines[2]) == area);
    assert_int_equal(e.lines[2].count, 4 * 31);
    /* the topmost, leftmost of its pixels' top left corner */
    assert_true(e.points[e.lines[2].first].x == 30 && e.points[e.lines[2].first].y == 5);
    assert_int_equal(e.beside[0], 1);
    assert_int_equal(e.beside[1], 0);
    texpatch_edges_free(&e);
    assert_null(e.lines);
    texpatch_edges_free(&e);
    texpatch_edges_free(NULL);
}

static void test_rings(void **state) {
    (void)state;
    static uint8_t pixels[96 * 96];
    int holes = 0;
    for (int i = 0; i < 96 * 96; i++) {
        const double x = i % 96 - 47.5, y = i / 96 - 47.5;
        const int r = (int)(sqrt(x * x + y * y) / 9);
        pixels[i] = (uint8_t)(r < 5 ? r % 3 : 0);
    }
    texpatch_edges e = find_numbers(pixels, 96, 96, 3);
    check_lines(&e, pixels);
    check_no_crossing(&e);
    assert_int_equal(e.line_count, 11);
    for (size_t i = 0; i < e.line_count; i++) holes += e.lines[i].is_hole;
    assert_int_equal(holes, 5);
    assert_int_equal(e.beside[2], 0); /* outside of a ring is longer than inside */
    texpatch_edges_free(&e);
}

/* Pixels that meet at a corner do not belong together, whoever asks. */
static void test_saddles(void **state) {
    (void)state;
    uint8_t two[4] = {1, 0, 0, 1};
    texpatch_edges e = find_numbers(two, 2, 2, 2);
    check_lines(&e, two);
    check_no_crossing(&e);
    assert_int_equal(e.line_count, 4);
    for (size_t i = 0; i < 4; i++) assert_int_equal(e.lines[i].count, 4);
    texpatch_edges_free(&e);

    static uint8_t board[20 * 20];
    for (int i = 0; i < 400; i++) board[i] = (uint8_t)((i % 20 + i / 20) & 1);
    e = find_numbers(board, 20, 20, 2);
    check_lines(&e, board);
    check_no_crossing(&e);
    assert_int_equal(e.line_count, 400);
    texpatch_edges_free(&e);

    /* a ring that closes at a corner only: inside and outside of it are one line */
    uint8_t ring[25] = {0, 0, 0, 0, 0, /* */
                        0, 1, 1, 0, 0, /* */
                        0, 1, 0, 1, 0, /* */
                        0, 1, 1, 1, 0, /* */
                        0, 0, 0, 0, 0};
    e = find_numbers(ring, 5, 5, 2);
    check_lines(&e, ring);
    check_no_crossing(&e);
    /* the border, the hole for the ring, the ring, the pixel within it */
    assert_int_equal(e.line_count, 4);
    int ring_lines = 0;
    for (size_t i = 0; i < e.line_count; i++) ring_lines += e.lines[i].layer == 1;
    assert_int_equal(ring_lines, 1);
    texpatch_edges_free(&e);
}

static void test_whole_picture(void **state) {
    (void)state;
    uint8_t one = 77;
    static uint8_t plain[30 * 20];
    texpatch_edges_desc d = desc_of(gray(&one, 1, 1), 0, NULL);
    texpatch_edges e = find(&d);
    assert_int_equal(e.levels, 4);
    assert_int_equal(e.line_count, 1);
    assert_int_equal(e.point_count, 4);
    texpatch_edges_free(&e);
    for (int v = 0; v < 256; v += 51) { /* whatever its gray: rising thresholds, one layer */
        memset(plain, v, sizeof plain);
        for (int levels = 2; levels <= TEXPATCH_MAX_LEVELS; levels++) {
            d = desc_of(gray(plain, 30, 20), levels, NULL);
            d.smooth = 3;
            d.least = 1000000;
            e = find(&d);
            assert_int_equal(e.line_count, 1);
            assert_int_equal(e.lines[0].count, 100);
            for (int k = 1; k < levels - 1; k++) assert_true(e.thresholds[k] > e.thresholds[k - 1]);
            for (int k = 0; k < levels; k++) assert_int_equal(e.beside[k], -1);
            texpatch_edges_free(&e);
        }
    }
}

/* ---- random pictures -------------------------------------------------------------------- */

/* a random map of layers, of single pixels or of blocks */
static void draw_random(uint8_t *pixels, int width, int height, int levels, int block,
                        txm_rng *rng) {
    static uint8_t cells[128 * 128];
    for (int i = 0; i < 128 * 128; i++) cells[i] = (uint8_t)txm_rng_below(rng, (uint32_t)levels);
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) pixels[y * width + x] = cells[y / block * 128 + x / block];
    }
}

static void test_random_pictures(void **state) {
    (void)state;
    static uint8_t pixels[64 * 64];
    txm_rng rng = txm_rng_make(5, 0);
    for (int i = 0; i < 200; i++) {
        const int width = txm_rng_range(&rng, 1, 64), height = txm_rng_range(&rng, 1, 64);
        const int levels = txm_rng_range(&rng, 2, TEXPATCH_MAX_LEVELS);
        draw_random(pixels, width, height, levels, txm_rng_range(&rng, 1, 4), &rng);
        texpatch_edges e = find_numbers(pixels, width, height, levels);
        check_lines(&e, pixels);
        check_no_crossing(&e);
        texpatch_edges_free(&e);
    }
}

/* the number of cracks around each region, by plain flooding; returns how many are under least */
static int count_short(const uint8_t *layer, int width, int height, int least) {
    uint8_t *seen = (uint8_t *)calloc((size_t)width * (size_t)height, 1);
    int *stack = (int *)malloc((size_t)width * (size_t)height * sizeof(int));
    int found = 0;
    for (int i = 0; i < width * height; i++) {
        if (seen[i]) continue;
        int top = 0, cracks = 0, pixels = 0;
        stack[top++] = i;
        seen[i] = 1;
        while (top) {
            const int p = stack[--top], x = p % width, y = p / width;
            static const int dx[4] = {0, 1, 0, -1}, dy[4] = {-1, 0, 1, 0};
            pixels++;
            for (int d = 0; d < 4; d++) {
                const int u = x + dx[d], v = y + dy[d], q = v * width + u;
                if (u < 0 || v < 0 || u >= width || v >= height || layer[q] != layer[p]) cracks++;
                else if (!seen[q]) {
                    seen[q] = 1;
                    stack[top++] = q;
                }
            }
        }
        found += cracks < least && pixels < width * height;
    }
    free(seen);
    free(stack);
    return found;
}

/* Small regions go to their surroundings until none is left; texpatch_layers agrees with the lines. */
static void test_least(void **state) {
    (void)state;
    static uint8_t pixels[64 * 64], shown[64 * 64], numbers[64 * 64];
    txm_rng rng = txm_rng_make(6, 0);
    for (int i = 0; i < 200; i++) {
        const int width = txm_rng_range(&rng, 1, 64), height = txm_rng_range(&rng, 1, 64);
        const int levels = txm_rng_range(&rng, 2, 6);
        const int least = txm_rng_range(&rng, 0, i % 4 ? 40 : 400);
        draw_random(pixels, width, height, levels, txm_rng_range(&rng, 1, 4), &rng);
        texpatch_edges_desc d = desc_of(gray(pixels, width, height), levels, by_number);
        d.least = least;
        texpatch_edges e = find(&d);
        const txm_image to = gray(shown, width, height);
        assert_int_equal(texpatch_layers(&d, &e, NULL, &to), TXM_OK);
        for (int p = 0; p < width * height; p++) {
            numbers[p] = (uint8_t)((shown[p] * (levels - 1) + 127) / 255);
            assert_int_equal(shown[p], (int)(255.0 * numbers[p] / (levels - 1) + 0.5));
        }
        assert_int_equal(count_short(numbers, width, height, least), 0);
        if (least <= 4) assert_memory_equal(numbers, pixels, (size_t)(width * height));
        check_lines(&e, numbers);
        check_no_crossing(&e);
        texpatch_edges_free(&e);
    }

    /* a small region goes to the layer that it shares most with: two sides of 3 against one each */
    uint8_t one[9 * 9];
    memset(one, 0, sizeof one);
    for (int y = 0; y < 9; y++) {
        for (int x = 5; x < 9; x++) one[9 * y + x] = 2;
    }
    one[9 * 4 + 4] = 1;
    texpatch_edges_desc d = desc_of(gray(one, 9, 9), 3, by_number);
    d.least = 5;
    texpatch_edges e = find(&d);
    assert_int_equal(e.line_count, 2);
    assert_int_equal(e.lines[0].layer, 0);
    assert_int_equal(e.lines[0].count, 2 * (9 + 5));
    texpatch_edges_free(&e);
}

/* ---- gray and thresholds ---------------------------------------------------------------- */

/* smooth noise, 0..1: a lattice of this many pixels, interpolated */
static double noise(uint64_t seed, double pitch, int x, int y) {
    const int i = (int)(x / pitch), j = (int)(y / pitch);
    double corner[4], u = x / pitch - i, v = y / pitch - j;
    for (int k = 0; k < 4; k++) {
        const uint64_t at = (uint64_t)(i + k % 2) * 1000 + (uint64_t)(j + k / 2);
        corner[k] = (double)(txm_hash(txm_hash(at + 1) + seed) >> 11) / 9007199254740992.0;
    }
    u *= u * (3 - 2 * u);
    v *= v * (3 - 2 * v);
    return (corner[0] * (1 - u) + corner[1] * u) * (1 - v) +
           (corner[2] * (1 - u) + corner[3] * u) * v;
}

/* blobs with rough borders */
static void draw_blobs(uint8_t *pixels, int side, uint64_t seed, double rough) {
    for (int y = 0; y < side; y++) {
        for (int x = 0; x < side; x++) {
            const double g = noise(seed, 48, x, y) + rough * (noise(seed + 1, 11, x, y) - 0.5) +
                             0.5 * rough * (noise(seed + 2, 5, x, y) - 0.5);
            pixels[y * side + x] = (uint8_t)(255 * (g < 0 ? 0 : g > 1 ? 1 : g));
        }
    }
}

static void test_thresholds(void **state) {
    (void)state;
    static uint8_t pixels[SIDE * SIDE];
    draw_blobs(pixels, SIDE, 3, 0.3);
    for (int levels = 2; levels <= 8; levels++) {
        double area[8] = {0};
        const texpatch_edges_desc d = desc_of(gray(pixels, SIDE, SIDE), levels, NULL);
        texpatch_edges e = find(&d);
        for (size_t i = 0; i < e.line_count; i++)
            area[e.lines[i].layer] += area_of(&e, &e.lines[i]);
        for (int k = 0; k < levels; k++) { /* each threshold up to a quarter of a layer off */
            assert_true(area[k] >= 0.5 * SIDE * SIDE / levels);
            assert_true(area[k] <= 1.5 * SIDE * SIDE / levels);
        }
        texpatch_edges_free(&e);
    }

    /* two heaps with a gap between them, not in the middle: the gap's middle is found */
    txm_rng rng = txm_rng_make(1, 1);
    for (int i = 0; i < SIDE * SIDE; i++) {
        const int first = txm_rng_below(&rng, 100) < 55;
        pixels[i] = (uint8_t)txm_rng_range(&rng, first ? 10 : 120, first ? 80 : 240);
    }
    texpatch_edges_desc d = desc_of(gray(pixels, SIDE, SIDE), 2, NULL);
    texpatch_edges e = find(&d);
    assert_true(e.thresholds[0] > 95 / 255.0f && e.thresholds[0] < 105 / 255.0f);
    texpatch_edges_free(&e);

    /* the value itself belongs to the upper layer */
    uint8_t row[3] = {127, 128, 129};
    const float half = 128 / 255.0f;
    d = desc_of(gray(row, 3, 1), 2, &half);
    e = find(&d);
    assert_int_equal(e.line_count, 2);
    assert_int_equal(e.lines[0].count, 4);
    assert_int_equal(e.lines[1].count, 6);
    texpatch_edges_free(&e);
}

/* The same picture in all formats has the same edges. */
static void test_formats(void **state) {
    (void)state;
    enum { W = 80, H = 60 };
    static uint8_t plain[W * H], bytes[(W + 3) * H * 4];
    static uint16_t words[W * H * 4];
    static float floats[W * H * 4];
    for (int i = 0; i < W * H; i++) plain[i] = (uint8_t)(255 * noise(9, 9, i % W, i / W));
    texpatch_edges_desc d = desc_of(gray(plain, W, H), 3, NULL);
    d.smooth = 1.5f;
    d.least = 12;
    texpatch_edges e = find(&d);
    for (int channels = 1; channels <= 4; channels++) {
        for (int sample = 0; sample < 3; sample++) {
            txm_rng rng = txm_rng_make(1, 1);
            for (int i = 0; i < W * H; i++) {
                for (int c = 0; c < channels; c++) {
                    const int alpha = channels % 2 == 0 && c == channels - 1;
                    const int v = alpha ? (int)txm_rng_below(&rng, 256) : plain[i];
                    bytes[i / W * (W + 3) * channels + i % W * channels + c] = (uint8_t)v;
                    words[i * channels + c] = (uint16_t)(257 * v);
                    floats[i * channels + c] = alpha ? NAN : (float)v / 255.0f;
                }
            }
            const txm_sample u16 = (txm_sample)2; /* TXM_U16, where texmath.h has it */
            const txm_sample kind = sample == 0 ? TXM_U8 : sample == 1 ? u16 : TXM_F32;
            if (sample == 1 && txm_sample_bytes(u16) != 2) continue;
            void *of[3] = {bytes, words, floats};
            d.image = view(of[sample], W, H, channels, kind);
            if (sample == 0) d.image.stride = (W + 3) * channels;
            texpatch_edges other = find(&d);
            assert_int_equal(other.line_count, e.line_count);
            assert_int_equal(other.point_count, e.point_count);
            assert_memory_equal(other.points, e.points, e.point_count * sizeof *e.points);
            assert_memory_equal(other.lines, e.lines, e.line_count * sizeof *e.lines);
            texpatch_edges_free(&other);
        }
    }
    texpatch_edges_free(&e);

    /* gray is the luma, cut off at 0 and 1 */
    float rgb[4 * 3] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 9, -9, 9};
    const float marks[3] = {0.1f, 0.5f, 0.9f};
    const int expected[4] = {1, 2, 0, 0};
    for (int i = 0; i < 4; i++) {
        d = desc_of(view(rgb + 3 * i, 1, 1, 3, TXM_F32), 4, marks);
        e = find(&d);
        assert_int_equal(e.lines[0].layer, expected[i]);
        texpatch_edges_free(&e);
    }
}

static void test_smooth(void **state) {
    (void)state;
    static uint8_t pixels[64 * 64], layers[64 * 64];
    size_t last = SIZE_MAX;
    txm_rng rng = txm_rng_make(2, 2);
    for (int i = 0; i < 64 * 64; i++) pixels[i] = (uint8_t)txm_rng_below(&rng, 256);
    for (int r = 0; r <= 16; r += 4) { /* the more blur, the less edge */
        const float half = 0.5f;
        texpatch_edges_desc d = desc_of(gray(pixels, 64, 64), 2, &half);
        d.smooth = (float)r;
        texpatch_edges e = find(&d);
        assert_true(e.point_count < last);
        last = e.point_count;
        texpatch_edges_free(&e);
    }
    /* a point becomes a pyramid: with radius 2 the weights are 1/3 2/3 1 2/3 1/3 over 3 */
    memset(pixels, 0, sizeof pixels);
    pixels[32 * 64 + 32] = 255;
    float marks[2] = {1.5f / 81, 3.5f / 81};
    texpatch_edges_desc d = desc_of(gray(pixels, 64, 64), 3, marks);
    d.smooth = 2;
    texpatch_edges e = find(&d);
    const txm_image to = gray(layers, 64, 64);
    assert_int_equal(texpatch_layers(&d, &e, NULL, &to), TXM_OK);
    for (int i = 0; i < 64 * 64; i++) {
        const int x = abs(i % 64 - 32), y = abs(i / 64 - 32);
        const int weight = x > 2 || y > 2 ? 0 : (3 - x) * (3 - y);
        assert_int_equal(layers[i], weight < 2 ? 0 : weight < 4 ? 128 : 255);
    }
    texpatch_edges_free(&e);
}

/* ---- drawing ---------------------------------------------------------------------------- */

static void test_draw(void **state) {
    (void)state;
    enum { W = 50, H = 40 };
    static uint8_t layer[W * H], one[W * H], three[(W + 1) * H * 3];
    txm_rng rng = txm_rng_make(4, 4);
    draw_random(layer, W, H, 3, 5, &rng);
    texpatch_edges e = find_numbers(layer, W, H, 3);
    for (int wanted = -1; wanted < 3; wanted++) {
        memset(one, 7, sizeof one);
        memset(three, 7, sizeof three);
        const txm_image to = gray(one, W, H);
        txm_image rgb = view(three, W, H, 3, TXM_U8);
        rgb.stride = (W + 1) * 3;
        assert_int_equal(texpatch_edges_draw(&e, wanted, NULL, &to), TXM_OK);
        assert_int_equal(texpatch_edges_draw(&e, wanted, NULL, &rgb), TXM_OK);
        for (int i = 0; i < W * H; i++) { /* the pixels along the cracks, no others */
            const int x = i % W, y = i / W, k = layer[i];
            const int inner = x > 0 && layer[i - 1] == k && x + 1 < W && layer[i + 1] == k &&
                              y > 0 && layer[i - W] == k && y + 1 < H && layer[i + W] == k;
            const int is_drawn = !inner && (wanted < 0 || wanted == k);
            assert_int_equal(one[i], is_drawn ? 85 * (k + 1) : 7);
            const uint8_t *p = three + ((W + 1) * y + x) * 3;
            assert_true(is_drawn ? p[0] + p[1] + p[2] > 30 : p[0] == 7 && p[1] == 7 && p[2] == 7);
        }
    }
    /* a smaller picture: the part that lies in it */
    uint8_t small[10 * 10];
    memset(small, 7, sizeof small);
    memset(one, 7, sizeof one);
    const txm_image to = gray(one, W, H), part = gray(small, 10, 10);
    assert_int_equal(texpatch_edges_draw(&e, -1, NULL, &to), TXM_OK);
    assert_int_equal(texpatch_edges_draw(&e, -1, NULL, &part), TXM_OK);
    for (int y = 0; y < 10; y++) assert_memory_equal(small + 10 * y, one + W * y, 10);
    texpatch_edges_free(&e);
}

/* ---- strokes ---------------------------------------------------------------------------- */

enum { CIRCLE = 400, WIDE = 512 };

/* A circle, a clover, a wave: gentle strokes of this layer. */
static int draw_strokes(texpatch_stroke strokes[3], int layer) {
    static txm_vec2 circle[CIRCLE], clover[CIRCLE], wave[CIRCLE];
    for (int i = 0; i < CIRCLE; i++) {
        const double a = 2 * TXM_PI * i / CIRCLE, r = 95 + 22 * sin(3 * a), t = i / (CIRCLE - 1.0);
        circle[i] = txm_v2((float)(150 + 110 * cos(a)), (float)(150 + 110 * sin(a)));
        clover[i] = txm_v2((float)(380 + r * cos(a)), (float)(160 + r * sin(a)));
        wave[i] = txm_v2((float)(40 + 430 * t), (float)(390 + 60 * sin(7 * t)));
    }
    memset(strokes, 0, 3 * sizeof *strokes);
    for (int i = 0; i < 3; i++) {
        strokes[i].points = i == 0 ? circle : i == 1 ? clover : wave;
        strokes[i].count = CIRCLE;
        strokes[i].is_closed = i < 2;
        strokes[i].layer = layer;
        strokes[i].width = 24;
    }
    return 3;
}

static texpatch_control control_of(const texpatch_edges *edges, const texpatch_stroke *strokes,
                                   int count) {
    texpatch_control c;
    memset(&c, 0, sizeof c);
    c.edges = edges;
    c.strokes = strokes;
    c.stroke_count = count;
    return c;
}

static texpatch_edges disturb(const texpatch_control *control, int width, int height) {
    txm_env env = {0};
    texpatch_edges e;
    const txm_status status = texpatch_disturb(control, width, height, &env, &e);
    if (status != TXM_OK) fail_msg("disturb: %d, %s", status, env.message);
    return e;
}

static void guide_of(const texpatch_control *control, const texpatch_edges *lines, uint8_t *guide,
                     uint8_t *mask) {
    txm_env env = {0};
    const txm_image g = gray(guide, lines->width, lines->height);
    const txm_image m = gray(mask, lines->width, lines->height);
    const txm_status status = texpatch_control_guide(control, lines, &env, &g, &m);
    if (status != TXM_OK) fail_msg("guide: %d, %s", status, env.message);
}

/* from a point to the nearest one of a line */
static double distance_to(const txm_vec2 *p, int count, int is_closed, double x, double y) {
    double least = 1e30;
    for (int i = 0; i < count - !is_closed; i++) {
        const txm_vec2 a = p[i], b = p[(i + 1) % count];
        const double dx = (double)b.x - a.x, dy = (double)b.y - a.y, n = dx * dx + dy * dy;
        double t = n > 0 ? ((x - a.x) * dx + (y - a.y) * dy) / n : 0;
        t = t < 0 ? 0 : t > 1 ? 1 : t;
        const double ux = a.x + t * dx - x, uy = a.y + t * dy - y;
        if (ux * ux + uy * uy < least) least = ux * ux + uy * uy;
    }
    return sqrt(least);
}

/* from a point to the outline of a stroke: of an open one, to the edge of its band */
static double distance_to_stroke(const texpatch_stroke *s, double x, double y) {
    const double d = distance_to(s->points, s->count, s->is_closed, x, y);
    return s->is_closed ? d : fabs(d - 0.5 * (s->width > 0 ? s->width : 8));
}

static int turns(txm_vec2 a, txm_vec2 b, txm_vec2 c) {
    const double d =
        ((double)b.x - a.x) * ((double)c.y - a.y) - ((double)c.x - a.x) * ((double)b.y - a.y);
    return (d > 0) - (d < 0);
}

/* how often a closed line crosses itself */
static int count_crossings(const txm_vec2 *p, size_t n) {
    int found = 0;
    for (size_t i = 0; i < n; i++) {
        const txm_vec2 a = p[i], b = p[(i + 1) % n];
        for (size_t j = i + 2; j < n; j++) {
            const txm_vec2 c = p[j], d = p[(j + 1) % n];
            if (txm_maxf(a.x, b.x) < txm_minf(c.x, d.x) || txm_maxf(c.x, d.x) < txm_minf(a.x, b.x))
                continue;
            found += turns(a, b, c) * turns(a, b, d) < 0 && turns(c, d, a) * turns(c, d, b) < 0;
        }
    }
    return found;
}

/* The exemplar that the strokes below take after, 4 layers. */
static texpatch_edges find_blobs(uint64_t seed, double rough) {
    static uint8_t pixels[SIDE * SIDE];
    draw_blobs(pixels, SIDE, seed, rough);
    texpatch_edges_desc d = desc_of(gray(pixels, SIDE, SIDE), 4, NULL);
    d.least = 24;
    return find(&d);
}

static void test_disturb(void **state) {
    (void)state;
    static uint8_t guide[WIDE * WIDE], mask[WIDE * WIDE];
    texpatch_edges blobs = find_blobs(1, 0.3);
    texpatch_stroke strokes[3];
    for (int layer = 0; layer < 4; layer++) {
        texpatch_control c = control_of(&blobs, strokes, draw_strokes(strokes, layer));
        c.background = layer ? 0 : 3;
        c.seed = 1 + (uint64_t)layer;
        texpatch_edges lines = disturb(&c, WIDE, WIDE);
        assert_int_equal(lines.line_count, 3);
        assert_true(lines.width == WIDE && lines.height == WIDE && lines.levels == 4);
        assert_memory_equal(lines.thresholds, blobs.thresholds, sizeof lines.thresholds);
        double strays = 0, points = 0;
        for (int i = 0; i < 3; i++) {
            const texpatch_polyline *line = &lines.lines[i];
            const txm_vec2 *p = lines.points + line->first;
            assert_int_equal(line->layer, layer);
            assert_int_equal(line->is_hole, 0);
            assert_true(area_of(&lines, line) > 0); /* the inside lies to the right */
            double longest = 0;
            for (size_t j = 0; j < line->count; j++) {
                const txm_vec2 q = p[(j + 1) % line->count];
                const double d = distance_to_stroke(&strokes[i], p[j].x, p[j].y);
                if (d > 4) fail_msg("layer %d stroke %d strays by %g", layer, i, d);
                strays += d;
                points += 1;
                const double step = sqrt(((double)q.x - p[j].x) * ((double)q.x - p[j].x) +
                                         ((double)q.y - p[j].y) * ((double)q.y - p[j].y));
                if (step > longest) longest = step;
            }
            assert_true(longest < 3); /* closed as well: the last step is no longer than others */
            assert_int_equal(count_crossings(p, line->count), 0);
        }
        assert_true(strays / points > 0.3); /* and it does stray */

        /* the guide's edge is where the strokes are: on both sides of 90 % of their length */
        guide_of(&c, &lines, guide, mask);
        for (int i = 0; i < 3; i++) {
            const texpatch_stroke *s = &strokes[i];
            int near = 0;
            for (int j = 0; j < s->count; j++) {
                const double reach = 4 + (s->is_closed ? 0 : 0.5 * s->width);
                const txm_vec2 p = s->points[j];
                const int x0 = (int)(p.x - reach - 1), x1 = (int)(p.x + reach + 1);
                const int y0 = (int)(p.y - reach - 1), y1 = (int)(p.y + reach + 1);
                int sides = 0;
                for (int y = y0; y <= y1; y++) {
                    for (int x = x0; x <= x1; x++) {
                        const double dx = x + 0.5 - p.x, dy = y + 0.5 - p.y;
                        if (dx * dx + dy * dy > reach * reach) continue;
                        sides |= guide[y * WIDE + x] == 85 * layer ? 1 : 2;
                    }
                }
                near += sides == 3;
            }
            assert_true(near >= 0.9 * s->count);
        }
        texpatch_edges_free(&lines);
    }
    texpatch_edges_free(&blobs);
}

/* Strokes as people draw them: corners, hairpins, knots, out of the picture, tiny, crossing. */
static void test_disturb_anything(void **state) {
    (void)state;
    static uint8_t guide[200 * 160], mask[200 * 160];
    static txm_vec2 points[200];
    texpatch_edges blobs = find_blobs(2, 0.5);
    txm_rng rng = txm_rng_make(3, 3);
    double worst = 0;
    for (int i = 0; i < 150; i++) {
        texpatch_stroke s;
        memset(&s, 0, sizeof s);
        s.points = points;
        s.is_closed = (int)txm_rng_below(&rng, 2);
        s.count = txm_rng_range(&rng, 2 + s.is_closed, i % 3 ? 6 : 200);
        s.layer = (int)txm_rng_below(&rng, 4);
        s.width = i % 2 ? 0 : 2 + 60 * txm_rng_float(&rng);
        const float span = i % 5 == 0 ? 3.0f : i % 5 == 1 ? 1000.0f : 150.0f;
        for (int j = 0; j < s.count; j++) {
            points[j] = txm_v2(30 + span * txm_rng_float(&rng), 20 + span * txm_rng_float(&rng));
            if (i % 7 == 0) points[j] = txm_v2(floorf(points[j].x), 60); /* back and forth */
            if (i % 7 == 1 && j)
                points[j] = txm_v2(points[j - 1].x + txm_rng_float(&rng) - 0.3f,
                                   points[j - 1].y + txm_rng_float(&rng) - 0.5f);
        }
        points[1].x += 1; /* not all the same */
        texpatch_control c = control_of(&blobs, &s, 1);
        c.disturb = i % 4 == 3 ? 4.0f : 0;
        c.background = -1;
        texpatch_edges lines = disturb(&c, 200, 160);
        assert_int_equal(lines.line_count, 1);
        assert_true(lines.lines[0].count >= 2);
        for (size_t j = 0; j < lines.point_count && s.is_closed; j++) {
            const txm_vec2 p = lines.points[j];
            const txm_vec2 q = lines.points[j + 1 < lines.point_count ? j + 1 : 0];
            for (int k = 0; k < 2; k++) { /* also between the points */
                const double d = distance_to(points, s.count, 1, p.x + 0.5 * k * (q.x - p.x),
                                             p.y + 0.5 * k * (q.y - p.y));
                if (d > worst) worst = d;
            }
        }
        for (size_t j = 0; j < lines.point_count && !s.is_closed; j++) {
            const double half = 0.5 * (s.width > 0 ? s.width : 8);
            const double d = distance_to(points, s.count, 0, lines.points[j].x, lines.points[j].y);
            if (d - half > worst) worst = d - half;
        }
        guide_of(&c, &lines, guide, mask);
        texpatch_edges_free(&lines);
    }
    if (!(worst <= 4)) fail_msg("a line strays by %g", worst);
    texpatch_edges_free(&blobs);
}

static void test_disturb_seeds(void **state) {
    (void)state;
    texpatch_edges blobs = find_blobs(1, 0.3);
    texpatch_stroke strokes[3];
    texpatch_control c = control_of(&blobs, strokes, draw_strokes(strokes, 1));
    texpatch_edges a = disturb(&c, WIDE, WIDE), b = disturb(&c, WIDE, WIDE);
    assert_int_equal(a.point_count, b.point_count);
    assert_memory_equal(a.points, b.points, a.point_count * sizeof *a.points);
    c.seed = 1;
    texpatch_edges other = disturb(&c, WIDE, WIDE);
    assert_true(other.point_count != a.point_count ||
                memcmp(other.points, a.points, a.point_count * sizeof *a.points) != 0);
    texpatch_edges_free(&b);
    texpatch_edges_free(&other);

    /* a stroke's line does not depend on the others' layers, nor on how the edges were made */
    c.seed = 0;
    strokes[1].layer = 2;
    b = disturb(&c, WIDE, WIDE);
    assert_int_equal(a.lines[0].count, b.lines[0].count);
    assert_memory_equal(a.points, b.points, a.lines[0].count * sizeof *a.points);
    texpatch_edges_free(&b);

    /* more and less of it */
    double stray[3];
    for (int k = 0; k < 3; k++) {
        c.disturb = k == 0 ? 0.25f : k == 1 ? 1.0f : 4.0f;
        b = disturb(&c, WIDE, WIDE);
        stray[k] = 0;
        for (size_t j = 0; j < b.lines[0].count; j++)
            stray[k] += distance_to_stroke(&strokes[0], b.points[j].x, b.points[j].y) /
                        (double)b.lines[0].count;
        texpatch_edges_free(&b);
    }
    assert_true(stray[0] < 0.5 * stray[1] && stray[1] < stray[2]);
    texpatch_edges_free(&a);
    texpatch_edges_free(&blobs);
}

/* Without disturbance, or without edges in the exemplar, the line is the stroke itself. */
static void test_disturb_none(void **state) {
    (void)state;
    static uint8_t plain[64 * 64];
    texpatch_edges none = find_numbers(plain, 64, 64, 3), blobs = find_blobs(1, 0.3);
    const txm_vec2 square[4] = {{10, 10}, {10, 50}, {50, 50}, {50, 10}}; /* counterclockwise */
    const txm_vec2 segment[2] = {{20, 30}, {60, 30}};
    texpatch_stroke strokes[2];
    memset(strokes, 0, sizeof strokes);
    strokes[0].points = square;
    strokes[0].count = 4;
    strokes[0].is_closed = 1;
    strokes[0].layer = 2;
    strokes[1].points = segment;
    strokes[1].count = 2;
    strokes[1].layer = 1;
    for (int k = 0; k < 2; k++) {
        texpatch_control c = control_of(k ? &blobs : &none, strokes, 2);
        c.disturb = k ? -1.0f : 0;
        texpatch_edges lines = disturb(&c, 80, 60);
        assert_int_equal(lines.lines[0].count, 4);
        for (int j = 0; j < 4; j++)
            assert_memory_equal(&lines.points[j], &square[3 - j], sizeof *square);
        const texpatch_polyline *band = &lines.lines[1];
        for (size_t j = 0; j < band->count; j++) {
            const txm_vec2 p = lines.points[band->first + j];
            assert_true(fabs(distance_to(segment, 2, 0, p.x, p.y) - 4) < 1e-3);
        }
        const double expected = 40 * 8 + TXM_PI * 16, area = area_of(&lines, band);
        assert_true(fabs(area - expected) < 0.01 * expected);
        texpatch_edges_free(&lines);
    }
    texpatch_control c = control_of(&blobs, NULL, 0); /* no strokes at all */
    texpatch_edges lines = disturb(&c, 80, 60);
    assert_int_equal(lines.line_count, 0);
    assert_int_equal(lines.point_count, 0);
    texpatch_edges_free(&lines);
    texpatch_edges_free(&none);
    texpatch_edges_free(&blobs);
}

/* ---- statistics ------------------------------------------------------------------------- */

enum { BINS = 16 };

/* blur by weights radius + 1 - |d|; open lines near their ends by less */
static void blur(const double *from, double *to, int n, int is_closed, int radius) {
    for (int i = 0; i < n; i++) {
        double sum = 0, weights = 0;
        int r = radius;
        if (!is_closed && r > i) r = i;
        if (!is_closed && r > n - 1 - i) r = n - 1 - i;
        for (int d = -r; d <= r; d++) {
            sum += (r + 1 - abs(d)) * from[((i + d) % n + n) % n];
            weights += r + 1 - abs(d);
        }
        to[i] = sum / weights;
    }
}

/* The histogram of a run of points' direction against that of the run smoothed over 24 pixels: 16
   bins over half a turn. left and right of the middle apart. */
static void count_directions(double *x, double *y, int n, int is_closed, double middle,
                             double bins[2][BINS]) {
    enum { MOST = 40000 };
    static double u[MOST], v[MOST], cu[MOST], cv[MOST];
    if (n < 64 || n > MOST) return;
    blur(x, u, n, is_closed, 2);
    blur(y, v, n, is_closed, 2);
    double length = 0, from = 0;
    for (int i = 1; i < n + is_closed; i++)
        length += hypot(u[i % n] - u[i - 1], v[i % n] - v[i - 1]);
    const int m = (int)(length + 0.5);
    if (m < 64) return;
    for (int k = 0, j = 0; k < m; k++) { /* a point each pixel; x and y have done their duty */
        const double at = length * k / m;
        double span = hypot(u[(j + 1) % n] - u[j], v[(j + 1) % n] - v[j]);
        while (at > from + span && j + 1 < n) {
            from += span;
            j++;
            span = hypot(u[(j + 1) % n] - u[j], v[(j + 1) % n] - v[j]);
        }
        const double t = span > 0 ? (at - from) / span : 0;
        x[k] = u[j] + (u[(j + 1) % n] - u[j]) * t;
        y[k] = v[j] + (v[(j + 1) % n] - v[j]) * t;
    }
    blur(x, cu, m, is_closed, 24);
    blur(y, cv, m, is_closed, 24);
    const int trim = is_closed ? 0 : 24;
    for (int i = trim; i < m - trim; i++) {
        const int a = (i + m - 1) % m, b = (i + 1) % m, c = (i + m - 6) % m, d = (i + 6) % m;
        const double dx = x[b] - x[a], dy = y[b] - y[a], cx = cu[d] - cu[c], cy = cv[d] - cv[c];
        const double angle = atan2(cx * dy - cy * dx, cx * dx + cy * dy);
        bins[x[i] >= middle][((int)floor(angle / TXM_PI * BINS + 0.5) + 4 * BINS) % BINS] += 1;
    }
}

/* the edges of a layer, those along the picture's border left out */
static void count_edges(const texpatch_edges *e, int layer, double bins[2][BINS]) {
    static double x[40000], y[40000];
    memset(bins, 0, 2 * sizeof bins[0]);
    for (size_t i = 0; i < e->line_count; i++) {
        const texpatch_polyline *line = &e->lines[i];
        const txm_vec2 *p = e->points + line->first;
        const int count = (int)line->count;
        int start = -1, n = 0;
        if (line->layer != layer || count > 39000) continue;
        for (int k = 0; k <= 2 * count; k++) {
            const txm_vec2 a = p[k % count], b = p[(k + 1) % count];
            const int on_border = (a.x == b.x && (a.x == 0 || a.x == (float)e->width)) ||
                                  (a.y == b.y && (a.y == 0 || a.y == (float)e->height));
            if (start < 0 && !on_border && k < count) continue;
            if (start < 0) start = k;
            if (k == count && start == k) break; /* closed: below */
            if (k > start + count) break;
            if (on_border) {
                count_directions(x, y, n, 0, 0.5 * e->width, bins);
                n = 0;
            } else {
                x[n] = 0.5 * (a.x + b.x);
                y[n++] = 0.5 * (a.y + b.y);
            }
        }
        if (start < count) continue;
        for (n = 0; n < count; n++) {
            x[n] = 0.5 * (p[n].x + p[(n + 1) % count].x);
            y[n] = 0.5 * (p[n].y + p[(n + 1) % count].y);
        }
        count_directions(x, y, count, 1, 0.5 * e->width, bins);
    }
}

static double chi_square(const double *a, const double *b) {
    double sum = 0, an = 0, bn = 0;
    for (int i = 0; i < BINS; i++) an += a[i], bn += b[i];
    assert_true(an > 0 && bn > 0);
    for (int i = 0; i < BINS; i++) {
        const double p = a[i] / an, q = b[i] / bn;
        if (p + q > 0) sum += (p - q) * (p - q) / (p + q);
    }
    return sum;
}

/* The directions along disturbed strokes are those along the exemplar's edges: not much farther from
   them than its left half is from its right half. Both of the lines themselves and of the edges that
   are found in the guide. */
static void test_statistics(void **state) {
    (void)state;
    static uint8_t guide[WIDE * WIDE], mask[WIDE * WIDE];
    static double x[40000], y[40000];
    for (int round = 0; round < 3; round++) {
        static uint8_t pixels[384 * 384];
        draw_blobs(pixels, 384, 5 + (uint64_t)round, 0.2 + 0.1 * round);
        texpatch_edges_desc d = desc_of(gray(pixels, 384, 384), 2, NULL);
        d.least = 24;
        texpatch_edges e = find(&d);
        for (int layer = 0; layer < 2; layer++) {
            double halves[2][BINS], all[BINS], lines[BINS] = {0}, drawn[BINS] = {0}, bins[2][BINS];
            texpatch_stroke strokes[3];
            count_edges(&e, layer, halves);
            for (int b = 0; b < BINS; b++) all[b] = halves[0][b] + halves[1][b];
            texpatch_control c = control_of(&e, strokes, draw_strokes(strokes, layer));
            c.background = 1 - layer;
            for (c.seed = 0; c.seed < 4; c.seed++) {
                texpatch_edges o = disturb(&c, WIDE, WIDE);
                for (size_t i = 0; i < o.line_count; i++) {
                    memset(bins, 0, sizeof bins);
                    for (size_t j = 0; j < o.lines[i].count; j++) {
                        x[j] = o.points[o.lines[i].first + j].x;
                        y[j] = o.points[o.lines[i].first + j].y;
                    }
                    count_directions(x, y, (int)o.lines[i].count, 1, 0, bins);
                    for (int b = 0; b < BINS; b++) lines[b] += bins[1][b];
                }
                guide_of(&c, &o, guide, mask);
                const texpatch_edges_desc g = desc_of(gray(guide, WIDE, WIDE), 2, NULL);
                texpatch_edges found = find(&g);
                count_edges(&found, layer, bins);
                for (int b = 0; b < BINS; b++) drawn[b] += bins[0][b] + bins[1][b];
                texpatch_edges_free(&found);
                texpatch_edges_free(&o);
            }
            const double own = chi_square(halves[0], halves[1]);
            const double line = chi_square(lines, all), edge = chi_square(drawn, all);
            if (line > 1.5 * own || edge > 1.5 * own)
                fail_msg("round %d layer %d: halves %.4f, lines %.4f, guide %.4f", round, layer,
                         own, line, edge);
        }
        texpatch_edges_free(&e);
    }
}

/* ---- the guide -------------------------------------------------------------------------- */

static int64_t fixed(float x) {
    return (int64_t)floor(x * 256.0 + 0.5);
}

/* winding number of a closed line in 256ths of a pixel around a pixel's centre */
static int winding_of(const txm_vec2 *p, int count, int x, int y) {
    const int64_t cx = 256 * (int64_t)x + 128, cy = 256 * (int64_t)y + 128;
    int sum = 0;
    for (int i = 0; i < count; i++) {
        const txm_vec2 a = p[i], b = p[(i + 1) % count];
        const int64_t ax = fixed(a.x), ay = fixed(a.y), bx = fixed(b.x), by = fixed(b.y);
        const int64_t side = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay); /* < 0: to the right */
        if ((ay <= cy) == (by <= cy)) continue;
        if (ay < by ? side <= 0 : side >= 0) sum += ay < by ? 1 : -1;
    }
    return sum;
}

static void test_guide_fill(void **state) {
    (void)state;
    enum { W = 70, H = 50 };
    static uint8_t guide[W * H], mask[W * H], plain[16 * 16];
    static txm_vec2 points[4][40];
    texpatch_edges none = find_numbers(plain, 16, 16, 5);
    txm_rng rng = txm_rng_make(8, 8);
    for (int i = 0; i < 200; i++) {
        texpatch_stroke strokes[4];
        memset(strokes, 0, sizeof strokes);
        for (int k = 0; k < 4; k++) {
            strokes[k].points = points[k];
            strokes[k].count = txm_rng_range(&rng, 3, i % 2 ? 40 : 5);
            strokes[k].is_closed = 1;
            strokes[k].layer = (int)txm_rng_below(&rng, 5);
            for (int j = 0; j < strokes[k].count; j++) { /* also on centres, corners, outside */
                float x = 90 * txm_rng_float(&rng) - 10, y = 70 * txm_rng_float(&rng) - 10;
                if (i % 3) x = floorf(2 * x) / 2, y = floorf(2 * y) / 2;
                points[k][j] = txm_v2(x, y);
            }
            points[k][0].x = 30.25f;
        }
        texpatch_control c = control_of(&none, strokes, 4);
        c.background = (int)txm_rng_below(&rng, 5);
        texpatch_edges lines = disturb(&c, W, H);
        guide_of(&c, &lines, guide, mask);
        for (int p = 0; p < W * H; p++) {
            int layer = c.background;
            for (int k = 0; k < 4; k++) {
                const txm_vec2 *at = lines.points + lines.lines[k].first;
                if (winding_of(at, strokes[k].count, p % W, p / W)) layer = strokes[k].layer;
            }
            assert_int_equal(guide[p], (int)(255.0 * layer / 4 + 0.5));
            assert_int_equal(mask[p], 255);
        }
        texpatch_edges_free(&lines);
    }

    /* two squares that share a side through pixel centres: each pixel belongs to one of them */
    const txm_vec2 left[4] = {{4.5f, 4.5f}, {20.5f, 4.5f}, {20.5f, 20.5f}, {4.5f, 20.5f}};
    const txm_vec2 right[4] = {{20.5f, 4.5f}, {36.5f, 4.5f}, {36.5f, 20.5f}, {20.5f, 20.5f}};
    texpatch_stroke strokes[2];
    memset(strokes, 0, sizeof strokes);
    int counts[5] = {0};
    for (int k = 0; k < 2; k++) {
        strokes[k].points = k ? right : left;
        strokes[k].count = 4;
        strokes[k].is_closed = 1;
        strokes[k].layer = k + 1;
    }
    texpatch_control c = control_of(&none, strokes, 2);
    texpatch_edges lines = disturb(&c, W, H);
    guide_of(&c, &lines, guide, mask);
    for (int p = 0; p < W * H; p++) counts[(guide[p] + 32) / 64]++;
    assert_int_equal(counts[1], 256);
    assert_int_equal(counts[2], 256);
    assert_int_equal(guide[4 * W + 4], 64);
    assert_int_equal(guide[20 * W + 20], 0);
    texpatch_edges_free(&lines);
    texpatch_edges_free(&none);
}

static void test_guide_free(void **state) {
    (void)state;
    enum { W = 90, H = 60 };
    static uint8_t guide[W * H], mask[W * H], layer[96 * 96];
    for (int i = 0; i < 96 * 96; i++) layer[i] = (uint8_t)(i % 96 / 24); /* bars 0 1 2 3 */
    for (int i = 0; i < 96 * 48; i++) layer[i] = layer[i] == 1 ? 3 : layer[i];
    texpatch_edges e = find_numbers(layer, 96, 96, 4);
    const txm_vec2 a[4] = {{10, 10}, {30, 12}, {32, 30}, {12, 28}};
    const txm_vec2 b[4] = {{44, 6}, {80, 6}, {84, 50}, {70, 54}};
    texpatch_stroke strokes[2];
    memset(strokes, 0, sizeof strokes);
    for (int k = 0; k < 2; k++) {
        strokes[k].points = k ? b : a;
        strokes[k].count = 4;
        strokes[k].is_closed = 1;
        strokes[k].layer = k ? 2 : 0;
    }
    texpatch_control c = control_of(&e, strokes, 2);
    c.background = -1;
    texpatch_edges lines = disturb(&c, W, H);
    guide_of(&c, &lines, guide, mask);
    assert_true(e.beside[0] >= 0 && e.beside[0] != 0 && e.beside[2] >= 0 && e.beside[2] != 2);
    for (int p = 0; p < W * H; p++) {
        const int x = p % W, y = p / W;
        int own = -1, near[2] = {1000, 1000};
        for (int q = 0; q < W * H; q++) { /* squares of distances to pixels of either stroke */
            const int d = (q % W - x) * (q % W - x) + (q / W - y) * (q / W - y);
            if (d > 64) continue;
            for (int k = 0; k < 2; k++) {
                const texpatch_polyline *line = &lines.lines[k];
                if (d >= near[k]) continue;
                if (winding_of(lines.points + line->first, (int)line->count, q % W, q / W))
                    near[k] = d;
            }
        }
        for (int k = 0; k < 2; k++) own = near[k] == 0 ? strokes[k].layer : own;
        assert_int_equal(mask[p], near[0] <= 64 || near[1] <= 64 ? 255 : 0);
        if (!mask[p]) continue;
        if (own >= 0) assert_int_equal(guide[p], 85 * own);
        else if (near[0] < near[1]) assert_int_equal(guide[p], 85 * e.beside[0]);
        else if (near[1] < near[0]) assert_int_equal(guide[p], 85 * e.beside[2]);
        else assert_true(guide[p] == 85 * e.beside[0] || guide[p] == 85 * e.beside[2]);
    }
    texpatch_edges_free(&lines);

    c.stroke_count = 0; /* nothing drawn, nothing said */
    lines = disturb(&c, W, H);
    guide_of(&c, &lines, guide, mask);
    for (int p = 0; p < W * H; p++) assert_int_equal(mask[p], 0);
    texpatch_edges_free(&lines);
    texpatch_edges_free(&e);
}

/* ---- bad input -------------------------------------------------------------------------- */

static int is_untouched(const void *bytes, size_t count) {
    const unsigned char *p = (const unsigned char *)bytes;
    for (size_t i = 0; i < count; i++) {
        if (p[i] != FILL) return 0;
    }
    return 1;
}

static void refuse_find(const texpatch_edges_desc *d, txm_status expected) {
    txm_env env = {0};
    texpatch_edges e;
    memset(&e, FILL, sizeof e);
    const txm_status status = texpatch_edges_find(d, &env, &e);
    if (status != expected) fail_msg("%d, not %d: %s", status, expected, env.message);
    assert_true(is_untouched(&e, sizeof e));
    assert_true(env.message[0] != 0);
    assert_int_equal(texpatch_edges_find(d, NULL, &e), expected);
}

static void test_find_refuses(void **state) {
    (void)state;
    static uint8_t pixels[16 * 16], layers[16 * 16];
    float floats[4] = {0, 0.5f, NAN, 1}, steep[3] = {0.2f, 0.2f, 0.4f};
    const texpatch_edges_desc good = desc_of(gray(pixels, 16, 16), 4, NULL);
    texpatch_edges_desc d = good;
    refuse_find(NULL, TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_edges_find(&d, NULL, NULL), TXM_BAD_ARGUMENT);
    d.image.pixels = NULL;
    refuse_find(&d, TXM_BAD_ARGUMENT);
    static const int levels[5] = {1, -1, 17, INT_MAX, INT_MIN};
    for (int i = 0; i < 5; i++) {
        d = good;
        d.levels = levels[i];
        refuse_find(&d, TXM_BAD_ARGUMENT);
    }
    static const float smooth[4] = {-0.5f, 16.5f, NAN, INFINITY};
    for (int i = 0; i < 4; i++) {
        d = good;
        d.smooth = smooth[i];
        refuse_find(&d, TXM_BAD_ARGUMENT);
    }
    d = good;
    d.least = -1;
    refuse_find(&d, TXM_BAD_ARGUMENT);
    d = good;
    d.thresholds = steep;
    refuse_find(&d, TXM_BAD_ARGUMENT);
    steep[1] = NAN;
    refuse_find(&d, TXM_BAD_ARGUMENT);
    steep[1] = 1.5f;
    refuse_find(&d, TXM_BAD_ARGUMENT);
    d = desc_of(view(floats, 2, 2, 1, TXM_F32), 2, NULL);
    refuse_find(&d, TXM_BAD_ARGUMENT);
    floats[2] = -INFINITY;
    refuse_find(&d, TXM_BAD_ARGUMENT);
    d = good;
    d.image.width = 1 << 15;
    d.image.height = 1 << 15;
    refuse_find(&d, TXM_TOO_LARGE);
    d.image.width = (1 << 20) + 1;
    d.image.height = 1;
    refuse_find(&d, TXM_TOO_LARGE);
    d.image.width = INT_MAX;
    d.image.height = INT_MAX;
    refuse_find(&d, TXM_TOO_LARGE);

    /* layers and draw */
    texpatch_edges e = find(&good), odd = e;
    memset(layers, FILL, sizeof layers);
    txm_image to = gray(layers, 16, 16);
    assert_int_equal(texpatch_layers(NULL, &e, NULL, &to), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_layers(&good, NULL, NULL, &to), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_layers(&good, &e, NULL, NULL), TXM_BAD_ARGUMENT);
    odd.levels = 1;
    assert_int_equal(texpatch_layers(&good, &odd, NULL, &to), TXM_BAD_ARGUMENT);
    odd = e;
    odd.thresholds[1] = NAN;
    assert_int_equal(texpatch_layers(&good, &odd, NULL, &to), TXM_BAD_ARGUMENT);
    to.height = 15;
    assert_int_equal(texpatch_layers(&good, &e, NULL, &to), TXM_BAD_ARGUMENT);
    to = view(layers, 16, 8, 2, TXM_U8);
    assert_int_equal(texpatch_layers(&good, &e, NULL, &to), TXM_BAD_ARGUMENT);

    to = gray(layers, 16, 16);
    assert_int_equal(texpatch_edges_draw(NULL, -1, NULL, &to), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_edges_draw(&e, -1, NULL, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_edges_draw(&e, -2, NULL, &to), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_edges_draw(&e, 4, NULL, &to), TXM_BAD_ARGUMENT);
    to = view(layers, 8, 8, 4, TXM_U8);
    assert_int_equal(texpatch_edges_draw(&e, -1, NULL, &to), TXM_BAD_ARGUMENT);
    to = gray(layers, 16, 16);
    odd = e;
    odd.point_count--;
    assert_int_equal(texpatch_edges_draw(&odd, -1, NULL, &to), TXM_BAD_ARGUMENT);
    odd = e;
    odd.lines = NULL;
    assert_int_equal(texpatch_edges_draw(&odd, -1, NULL, &to), TXM_BAD_ARGUMENT);
    odd = e;
    const txm_vec2 kept = e.points[3];
    e.points[3].x = NAN;
    assert_int_equal(texpatch_edges_draw(&e, -1, NULL, &to), TXM_BAD_ARGUMENT);
    e.points[3].x = 1e30f;
    assert_int_equal(texpatch_edges_draw(&e, -1, NULL, &to), TXM_BAD_ARGUMENT);
    e.points[3] = kept;
    assert_true(is_untouched(layers, sizeof layers));
    texpatch_edges_free(&e);
}

static void refuse_control(const texpatch_control *c, int width, int height, txm_status expected) {
    txm_env env = {0};
    texpatch_edges e;
    memset(&e, FILL, sizeof e);
    const txm_status status = texpatch_disturb(c, width, height, &env, &e);
    if (status != expected) fail_msg("%d, not %d: %s", status, expected, env.message);
    assert_true(is_untouched(&e, sizeof e));
    assert_true(env.message[0] != 0);
}

static void test_control_refuses(void **state) {
    (void)state;
    static uint8_t pixels[64 * 64], bytes[2][64 * 64];
    for (int i = 0; i < 64 * 64; i++) pixels[i] = (uint8_t)(i % 64 / 32);
    texpatch_edges e = find_numbers(pixels, 64, 64, 2), odd = e;
    txm_vec2 points[4] = {{5, 5}, {40, 8}, {42, 44}, {9, 40}};
    texpatch_stroke good_stroke, s;
    memset(&good_stroke, 0, sizeof good_stroke);
    good_stroke.points = points;
    good_stroke.count = 4;
    good_stroke.is_closed = 1;
    s = good_stroke;
    const texpatch_control good = control_of(&e, &s, 1);
    texpatch_control c = good;

    refuse_control(NULL, 64, 64, TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_disturb(&c, 64, 64, NULL, NULL), TXM_BAD_ARGUMENT);
    refuse_control(&c, 0, 64, TXM_BAD_ARGUMENT);
    refuse_control(&c, 64, -1, TXM_BAD_ARGUMENT);
    refuse_control(&c, INT_MAX, 64, TXM_TOO_LARGE);
    c.edges = NULL;
    refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
    c = good;
    c.strokes = NULL;
    refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
    c = good;
    c.stroke_count = -1;
    refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
    static const float disturbs[5] = {-0.5f, -2, 4.5f, NAN, INFINITY};
    for (int i = 0; i < 5; i++) {
        c = good;
        c.disturb = disturbs[i];
        refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
    }
    for (int k = -2; k <= 2; k += 4) {
        c = good;
        c.background = k;
        refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
    }
    c = good;
    s.points = NULL;
    refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
    s = good_stroke;
    s.count = 2;
    refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
    s.is_closed = 0;
    s.count = 1;
    refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
    s = good_stroke;
    s.layer = 2;
    refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
    s.layer = -1;
    refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
    static const float widths[5] = {-1, 1.5f, 257, NAN, INFINITY};
    for (int i = 0; i < 5; i++) {
        s = good_stroke;
        s.is_closed = 0;
        s.width = widths[i];
        refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
    }
    s = good_stroke;
    static const float places[4] = {NAN, INFINITY, -INFINITY, 1e7f};
    for (int i = 0; i < 8; i++) {
        const txm_vec2 kept = points[2];
        if (i < 4) points[2].x = places[i];
        else points[2].y = places[i - 4];
        refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
        points[2] = kept;
    }
    const txm_vec2 same[3] = {{7, 7}, {7, 7}, {7, 7}};
    s.points = same;
    s.count = 3;
    refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);

    /* too long */
    static txm_vec2 zigzag[100];
    for (int i = 0; i < 100; i++) zigzag[i] = txm_v2(i % 2 ? 1e6f : -1e6f, (float)i);
    s.points = zigzag;
    s.count = 100;
    refuse_control(&c, 64, 64, TXM_TOO_LARGE);
    s = good_stroke;

    /* edges that nobody found */
    odd = e;
    odd.beside[0] = 9;
    c.edges = &odd;
    refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
    odd = e;
    const txm_vec2 kept = e.points[5];
    e.points[5].x += 0.5f;
    refuse_control(&good, 64, 64, TXM_BAD_ARGUMENT);
    e.points[5] = kept;

    /* the guide */
    texpatch_edges lines = disturb(&good, 64, 64);
    memset(bytes, FILL, sizeof bytes);
    txm_image guide = gray(bytes[0], 64, 64), mask = gray(bytes[1], 64, 64);
    assert_int_equal(texpatch_control_guide(NULL, &lines, NULL, &guide, &mask), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_control_guide(&good, NULL, NULL, &guide, &mask), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_control_guide(&good, &lines, NULL, NULL, &mask), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_control_guide(&good, &lines, NULL, &guide, NULL), TXM_BAD_ARGUMENT);
    mask.height = 63;
    assert_int_equal(texpatch_control_guide(&good, &lines, NULL, &guide, &mask), TXM_BAD_ARGUMENT);
    mask = view(bytes[1], 32, 64, 2, TXM_U8);
    assert_int_equal(texpatch_control_guide(&good, &lines, NULL, &guide, &mask), TXM_BAD_ARGUMENT);
    mask = gray(bytes[1], 64, 64);
    lines.lines[0].layer = 1;
    assert_int_equal(texpatch_control_guide(&good, &lines, NULL, &guide, &mask), TXM_BAD_ARGUMENT);
    lines.lines[0].layer = 0;
    assert_int_equal(texpatch_control_guide(&good, &e, NULL, &guide, &mask), TXM_BAD_ARGUMENT);
    assert_true(is_untouched(bytes, sizeof bytes));
    texpatch_edges_free(&lines);
    texpatch_edges_free(&e);
}

/* ---- misfortune ------------------------------------------------------------------------- */

/* One of the five functions on a fixed task; *untouched: its output is as before. */
typedef struct task {
    int which;
    texpatch_edges_desc desc;
    texpatch_edges blobs, lines;
    texpatch_stroke strokes[3];
    texpatch_control control;
} task;

static uint8_t task_pixels[192 * 192], task_out[2][320 * 320];

static txm_status run_task(task *t, txm_env *env, int *untouched) {
    texpatch_edges e;
    const int side = 192;
    txm_image to = gray(task_out[0], side, side);
    txm_status status = TXM_OK;
    memset(&e, FILL, sizeof e);
    memset(task_out, FILL, sizeof task_out);
    switch (t->which) {
    case 0: status = texpatch_edges_find(&t->desc, env, &e); break;
    case 1: status = texpatch_layers(&t->desc, &t->blobs, env, &to); break;
    case 2: status = texpatch_edges_draw(&t->blobs, -1, env, &to); break;
    case 3: status = texpatch_disturb(&t->control, 320, 320, env, &e); break;
    default: {
        const txm_image guide = gray(task_out[0], 320, 320), mask = gray(task_out[1], 320, 320);
        status = texpatch_control_guide(&t->control, &t->lines, env, &guide, &mask);
    }
    }
    *untouched = is_untouched(&e, sizeof e) && is_untouched(task_out, sizeof task_out);
    if (status == TXM_OK && (t->which == 0 || t->which == 3)) texpatch_edges_free(&e);
    return status;
}

static void make_task(task *t) {
    memset(t, 0, sizeof *t);
    draw_blobs(task_pixels, 192, 4, 0.4);
    t->desc = desc_of(gray(task_pixels, 192, 192), 3, NULL);
    t->desc.smooth = 1;
    t->desc.least = 20;
    t->blobs = find(&t->desc);
    t->control = control_of(&t->blobs, t->strokes, draw_strokes(t->strokes, 1));
    t->strokes[0].layer = 2;
    t->control.background = -1;
    t->lines = disturb(&t->control, 320, 320);
}

static void test_misfortune(void **state) {
    (void)state;
    task t;
    int untouched;
    make_task(&t);
    for (t.which = 0; t.which < 5; t.which++) {
        for (int onward = 0; onward < 2; onward++) {
            for (long k = 1;; k++) {
                tk_memory memory = {0};
                memory.fail_at = k;
                memory.fail_onward = onward;
                txm_env env = tk_env(&memory, NULL);
                const txm_status status = run_task(&t, &env, &untouched);
                assert_int_equal(tk_leaks(&memory), 0);
                if (memory.calls < k) {
                    assert_int_equal(status, TXM_OK);
                    assert_true(k > 1 && !untouched);
                    break;
                }
                assert_int_equal(status, TXM_OUT_OF_MEMORY);
                assert_true(untouched);
            }
        }
        for (long k = 1;; k++) {
            tk_memory memory = {0};
            tk_progress progress = {0};
            progress.cancel_at = k;
            txm_env env = tk_env(&memory, &progress);
            const txm_status status = run_task(&t, &env, &untouched);
            assert_int_equal(tk_leaks(&memory), 0);
            assert_int_equal(progress.errors, 0);
            assert_int_equal(progress.late, 0);
            if (progress.calls < k) {
                assert_int_equal(status, TXM_OK);
                assert_true(k > 1);
                break;
            }
            assert_int_equal(status, TXM_CANCELLED);
            assert_true(untouched);
        }
    }
    texpatch_edges_free(&t.lines);
    texpatch_edges_free(&t.blobs);
}

/* What is held while it works, per pixel, is what the header promises. */
static void test_memory(void **state) {
    (void)state;
    task t;
    int untouched;
    make_task(&t);
    for (t.which = 0; t.which < 5; t.which++) {
        tk_memory memory = {0};
        txm_env env = tk_env(&memory, NULL);
        assert_int_equal(run_task(&t, &env, &untouched), TXM_OK);
        const double pixels = 192.0 * 192, out = 320.0 * 320, peak = (double)memory.peak_bytes;
        const double held = 8.0 * (double)t.blobs.point_count + 32.0 * (double)t.blobs.line_count;
        if (t.which < 2) assert_true(peak < 13.5 * pixels + held + 2000);
        if (t.which == 2) assert_true(peak < 1.5 * pixels + 1000);
        if (t.which == 4) assert_true(peak < 4 * out + 1000);
    }
    texpatch_edges_free(&t.lines);
    texpatch_edges_free(&t.blobs);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_disc),
        cmocka_unit_test(test_rings),
        cmocka_unit_test(test_saddles),
        cmocka_unit_test(test_whole_picture),
        cmocka_unit_test(test_random_pictures),
        cmocka_unit_test(test_least),
        cmocka_unit_test(test_thresholds),
        cmocka_unit_test(test_formats),
        cmocka_unit_test(test_smooth),
        cmocka_unit_test(test_draw),
        cmocka_unit_test(test_disturb),
        cmocka_unit_test(test_disturb_anything),
        cmocka_unit_test(test_disturb_seeds),
        cmocka_unit_test(test_disturb_none),
        cmocka_unit_test(test_statistics),
        cmocka_unit_test(test_guide_fill),
        cmocka_unit_test(test_guide_free),
        cmocka_unit_test(test_find_refuses),
        cmocka_unit_test(test_control_refuses),
        cmocka_unit_test(test_misfortune),
        cmocka_unit_test(test_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
