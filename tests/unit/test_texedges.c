/* test_texedges.c - layers of a picture and their boundaries
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texedges && build/tests/unit/test_texedges */
#include "edgekit.h"

/* ---- what must hold --------------------------------------------------------------------- */

/* Everything that must hold for the boundaries of a map of layers. */
static void check_lines(const texedges_set *e, const uint8_t *layer) {
    const int w = e->width, h = e->height;
    /* how often each side of each crack is followed: right, down, left, up from a corner */
    uint8_t *used = (uint8_t *)calloc((size_t)(w + 1) * (size_t)(h + 1), 4);
    double area[TEXEDGES_MAX_LEVELS] = {0}, pixels[TEXEDGES_MAX_LEVELS] = {0};
    size_t points = 0, cracks = 0;
    static const int dx[4] = {1, 0, -1, 0}, dy[4] = {0, 1, 0, -1};
    for (size_t i = 0; i < e->line_count; i++) {
        const texedges_polyline *line = &e->lines[i];
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
static void check_no_crossing(const texedges_set *e) {
    const int w = e->width + 1;
    uint8_t *passes = (uint8_t *)calloc((size_t)w * (size_t)(e->height + 1), 4 * 2);
    uint8_t *count = (uint8_t *)calloc((size_t)w * (size_t)(e->height + 1), 1);
    for (size_t i = 0; i < e->line_count; i++) {
        const texedges_polyline *line = &e->lines[i];
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
    texedges_set *e = find_numbers(pixels, 64, 48, 2);
    check_lines(e, pixels);
    check_no_crossing(e);
    assert_int_equal(e->line_count, 3); /* the picture's border, the hole in it, the disc */
    assert_int_equal(e->lines[0].layer, 0);
    assert_int_equal(e->lines[0].count, 2 * (64 + 48));
    assert_true(e->points[0].x == 0 && e->points[0].y == 0 && e->points[1].x == 1);
    assert_true(e->lines[1].is_hole && e->lines[1].layer == 0 && area_of(e, &e->lines[1]) == -area);
    assert_true(!e->lines[2].is_hole && e->lines[2].layer == 1 && area_of(e, &e->lines[2]) == area);
    assert_int_equal(e->lines[2].count, 4 * 31);
    /* the top left corner of its topmost, then leftmost pixel */
    assert_true(e->points[e->lines[2].first].x == 30 && e->points[e->lines[2].first].y == 5);
    assert_int_equal(e->beside[0], 1);
    assert_int_equal(e->beside[1], 0);
    texedges_set_free(e);
    texedges_set_free(NULL);
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
    texedges_set *e = find_numbers(pixels, 96, 96, 3);
    check_lines(e, pixels);
    check_no_crossing(e);
    assert_int_equal(e->line_count, 11);
    for (size_t i = 0; i < e->line_count; i++) holes += e->lines[i].is_hole;
    assert_int_equal(holes, 5);
    assert_int_equal(e->beside[2], 0); /* outside of a ring is longer than inside */
    texedges_set_free(e);
}

/* Pixels that touch only at a corner are not connected, in any layer. */
static void test_saddles(void **state) {
    (void)state;
    uint8_t two[4] = {1, 0, 0, 1};
    texedges_set *e = find_numbers(two, 2, 2, 2);
    check_lines(e, two);
    check_no_crossing(e);
    assert_int_equal(e->line_count, 4);
    for (size_t i = 0; i < 4; i++) assert_int_equal(e->lines[i].count, 4);
    texedges_set_free(e);

    static uint8_t board[20 * 20];
    for (int i = 0; i < 400; i++) board[i] = (uint8_t)((i % 20 + i / 20) & 1);
    e = find_numbers(board, 20, 20, 2);
    check_lines(e, board);
    check_no_crossing(e);
    assert_int_equal(e->line_count, 400);
    texedges_set_free(e);

    /* a ring that closes at a corner only: inside and outside of it are one line */
    uint8_t ring[25] = {0, 0, 0, 0, 0, /* */
                        0, 1, 1, 0, 0, /* */
                        0, 1, 0, 1, 0, /* */
                        0, 1, 1, 1, 0, /* */
                        0, 0, 0, 0, 0};
    e = find_numbers(ring, 5, 5, 2);
    check_lines(e, ring);
    check_no_crossing(e);
    /* the border, the hole for the ring, the ring, the pixel within it */
    assert_int_equal(e->line_count, 4);
    int ring_lines = 0;
    for (size_t i = 0; i < e->line_count; i++) ring_lines += e->lines[i].layer == 1;
    assert_int_equal(ring_lines, 1);
    texedges_set_free(e);
}

static void test_whole_picture(void **state) {
    (void)state;
    uint8_t one = 77;
    static uint8_t plain[30 * 20];
    texedges_desc d = desc_of(gray(&one, 1, 1), 0, NULL);
    texedges_set *e = find(&d);
    assert_int_equal(e->levels, 4);
    assert_int_equal(e->line_count, 1);
    assert_int_equal(e->point_count, 4);
    texedges_set_free(e);
    for (int v = 0; v < 256; v += 51) { /* any gray: rising thresholds, one layer */
        memset(plain, v, sizeof plain);
        for (int levels = 2; levels <= TEXEDGES_MAX_LEVELS; levels++) {
            d = desc_of(gray(plain, 30, 20), levels, NULL);
            d.smooth = 3;
            d.least = 1000000;
            e = find(&d);
            assert_int_equal(e->line_count, 1);
            assert_int_equal(e->lines[0].count, 100);
            for (int k = 1; k < levels - 1; k++)
                assert_true(e->thresholds[k] > e->thresholds[k - 1]);
            for (int k = 0; k < levels; k++) assert_int_equal(e->beside[k], -1);
            texedges_set_free(e);
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
        const int levels = txm_rng_range(&rng, 2, TEXEDGES_MAX_LEVELS);
        draw_random(pixels, width, height, levels, txm_rng_range(&rng, 1, 4), &rng);
        texedges_set *e = find_numbers(pixels, width, height, levels);
        check_lines(e, pixels);
        check_no_crossing(e);
        texedges_set_free(e);
    }
}

/* the number of cracks around each region, by flood fill; returns how many are under least */
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

/* Small regions are given to their surroundings until none is left; texedges_layers agrees with the
   lines. */
static void test_least(void **state) {
    (void)state;
    static uint8_t pixels[64 * 64], shown[64 * 64], numbers[64 * 64];
    txm_rng rng = txm_rng_make(6, 0);
    for (int i = 0; i < 200; i++) {
        const int width = txm_rng_range(&rng, 1, 64), height = txm_rng_range(&rng, 1, 64);
        const int levels = txm_rng_range(&rng, 2, 6);
        const int least = txm_rng_range(&rng, 0, i % 4 ? 40 : 400);
        draw_random(pixels, width, height, levels, txm_rng_range(&rng, 1, 4), &rng);
        texedges_desc d = desc_of(gray(pixels, width, height), levels, by_number);
        d.least = least;
        texedges_set *e = find(&d);
        const txm_image to = gray(shown, width, height);
        assert_int_equal(texedges_layers(&d, e, NULL, &to), TXM_OK);
        for (int p = 0; p < width * height; p++) {
            numbers[p] = (uint8_t)((shown[p] * (levels - 1) + 127) / 255);
            assert_int_equal(shown[p], (int)(255.0 * numbers[p] / (levels - 1) + 0.5));
        }
        assert_int_equal(count_short(numbers, width, height, least), 0);
        if (least <= 4) assert_memory_equal(numbers, pixels, (size_t)(width * height));
        check_lines(e, numbers);
        check_no_crossing(e);
        texedges_set_free(e);
    }

    /* a small region goes to the layer that it shares most with: two sides of 3 against one each */
    uint8_t one[9 * 9];
    memset(one, 0, sizeof one);
    for (int y = 0; y < 9; y++) {
        for (int x = 5; x < 9; x++) one[9 * y + x] = 2;
    }
    one[9 * 4 + 4] = 1;
    texedges_desc d = desc_of(gray(one, 9, 9), 3, by_number);
    d.least = 5;
    texedges_set *e = find(&d);
    assert_int_equal(e->line_count, 2);
    assert_int_equal(e->lines[0].layer, 0);
    assert_int_equal(e->lines[0].count, 2 * (9 + 5));
    texedges_set_free(e);
}

/* ---- gray and thresholds ---------------------------------------------------------------- */

static void test_thresholds(void **state) {
    (void)state;
    static uint8_t pixels[SIDE * SIDE];
    draw_blobs(pixels, SIDE, 3, 0.3);
    for (int levels = 2; levels <= 8; levels++) {
        double area[8] = {0};
        const texedges_desc d = desc_of(gray(pixels, SIDE, SIDE), levels, NULL);
        texedges_set *e = find(&d);
        for (size_t i = 0; i < e->line_count; i++)
            area[e->lines[i].layer] += area_of(e, &e->lines[i]);
        for (int k = 0; k < levels; k++) { /* each threshold up to a quarter of a layer off */
            assert_true(area[k] >= 0.5 * SIDE * SIDE / levels);
            assert_true(area[k] <= 1.5 * SIDE * SIDE / levels);
        }
        texedges_set_free(e);
    }

    /* two clusters with a gap between them, off the middle: the middle of the gap is found */
    txm_rng rng = txm_rng_make(1, 1);
    for (int i = 0; i < SIDE * SIDE; i++) {
        const int first = txm_rng_below(&rng, 100) < 55;
        pixels[i] = (uint8_t)txm_rng_range(&rng, first ? 10 : 120, first ? 80 : 240);
    }
    texedges_desc d = desc_of(gray(pixels, SIDE, SIDE), 2, NULL);
    texedges_set *e = find(&d);
    assert_true(e->thresholds[0] > 95 / 255.0f && e->thresholds[0] < 105 / 255.0f);
    texedges_set_free(e);

    /* the value itself belongs to the upper layer */
    uint8_t row[3] = {127, 128, 129};
    const float half = 128 / 255.0f;
    d = desc_of(gray(row, 3, 1), 2, &half);
    e = find(&d);
    assert_int_equal(e->line_count, 2);
    assert_int_equal(e->lines[0].count, 4);
    assert_int_equal(e->lines[1].count, 6);
    texedges_set_free(e);
}

/* The same picture in all formats has the same edges. */
static void test_formats(void **state) {
    (void)state;
    enum { W = 80, H = 60 };
    static uint8_t plain[W * H], bytes[(W + 3) * H * 4];
    static uint16_t words[W * H * 4];
    static float floats[W * H * 4];
    for (int i = 0; i < W * H; i++) plain[i] = (uint8_t)(255 * noise(9, 9, i % W, i / W));
    texedges_desc d = desc_of(gray(plain, W, H), 3, NULL);
    d.smooth = 1.5f;
    d.least = 12;
    texedges_set *e = find(&d);
    for (int channels = 1; channels <= 4; channels++) {
        for (int sample = 0; sample < 3; sample++) {
            txm_rng rng = txm_rng_make(1, 1);
            for (int i = 0; i < W * H; i++) {
                for (int c = 0; c < channels; c++) {
                    const int alpha = channels % 2 == 0 && c == channels - 1;
                    const int v = alpha ? txm_rng_range(&rng, 1, 255) : plain[i];
                    bytes[i / W * (W + 3) * channels + i % W * channels + c] = (uint8_t)v;
                    words[i * channels + c] = (uint16_t)(257 * v);
                    floats[i * channels + c] = (float)v / 255.0f;
                }
            }
            const txm_sample kind = sample == 0 ? TXM_U8 : sample == 1 ? TXM_U16 : TXM_F32;
            void *of[3] = {bytes, words, floats};
            d.image = view(of[sample], W, H, channels, kind);
            if (sample == 0) d.image.stride = (W + 3) * channels;
            texedges_set *other = find(&d);
            assert_int_equal(other->line_count, e->line_count);
            assert_int_equal(other->point_count, e->point_count);
            assert_memory_equal(other->points, e->points, e->point_count * sizeof *e->points);
            assert_memory_equal(other->lines, e->lines, e->line_count * sizeof *e->lines);
            texedges_set_free(other);
        }
    }
    texedges_set_free(e);

    /* where alpha is 0 any colour may be: the neighbours' is taken */
    for (int hidden = 0; hidden < 2; hidden++) {
        for (int i = 0; i < W * H; i++) {
            const int shows = i % W / 9 % 2 || i / W / 7 % 2;
            words[2 * i] = (uint16_t)(shows ? 257 * plain[i] : 65535 * hidden);
            words[2 * i + 1] = (uint16_t)(shows ? 65535 : 0);
        }
        d.image = view(words, W, H, 2, TXM_U16);
        texedges_set *other = find(&d);
        if (hidden) {
            assert_int_equal(other->point_count, e->point_count);
            assert_memory_equal(other->points, e->points, e->point_count * sizeof *e->points);
            texedges_set_free(other);
        } else e = other;
    }
    texedges_set_free(e);

    /* gray is the luma, clamped to 0..1 */
    float rgb[4 * 3] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 9, -9, 9};
    const float marks[3] = {0.1f, 0.5f, 0.9f};
    const int expected[4] = {1, 2, 0, 0};
    for (int i = 0; i < 4; i++) {
        d = desc_of(view(rgb + 3 * i, 1, 1, 3, TXM_F32), 4, marks);
        e = find(&d);
        assert_int_equal(e->lines[0].layer, expected[i]);
        texedges_set_free(e);
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
        texedges_desc d = desc_of(gray(pixels, 64, 64), 2, &half);
        d.smooth = (float)r;
        texedges_set *e = find(&d);
        assert_true(e->point_count < last);
        last = e->point_count;
        texedges_set_free(e);
    }
    /* a point becomes a pyramid: with radius 2 the weights are 1/3 2/3 1 2/3 1/3 over 3 */
    memset(pixels, 0, sizeof pixels);
    pixels[32 * 64 + 32] = 255;
    float marks[2] = {1.5f / 81, 3.5f / 81};
    texedges_desc d = desc_of(gray(pixels, 64, 64), 3, marks);
    d.smooth = 2;
    texedges_set *e = find(&d);
    const txm_image to = gray(layers, 64, 64);
    assert_int_equal(texedges_layers(&d, e, NULL, &to), TXM_OK);
    for (int i = 0; i < 64 * 64; i++) {
        const int x = abs(i % 64 - 32), y = abs(i / 64 - 32);
        const int weight = x > 2 || y > 2 ? 0 : (3 - x) * (3 - y);
        assert_int_equal(layers[i], weight < 2 ? 0 : weight < 4 ? 128 : 255);
    }
    texedges_set_free(e);
}

/* ---- drawing ---------------------------------------------------------------------------- */

static void test_draw(void **state) {
    (void)state;
    enum { W = 50, H = 40 };
    static uint8_t layer[W * H], one[W * H], three[(W + 1) * H * 3];
    txm_rng rng = txm_rng_make(4, 4);
    draw_random(layer, W, H, 3, 5, &rng);
    texedges_set *e = find_numbers(layer, W, H, 3);
    for (int wanted = -1; wanted < 3; wanted++) {
        memset(one, 7, sizeof one);
        memset(three, 7, sizeof three);
        const txm_image to = gray(one, W, H);
        txm_image rgb = view(three, W, H, 3, TXM_U8);
        rgb.stride = (W + 1) * 3;
        assert_int_equal(texedges_draw(e, wanted, NULL, &to), TXM_OK);
        assert_int_equal(texedges_draw(e, wanted, NULL, &rgb), TXM_OK);
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
    assert_int_equal(texedges_draw(e, -1, NULL, &to), TXM_OK);
    assert_int_equal(texedges_draw(e, -1, NULL, &part), TXM_OK);
    for (int y = 0; y < 10; y++) assert_memory_equal(small + 10 * y, one + W * y, 10);
    texedges_set_free(e);
}

/* ---- all tests -------------------------------------------------------------------------- */

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
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
