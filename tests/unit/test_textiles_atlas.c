/* test_textiles_atlas.c - pictures of tile sets: layouts, gutters, texture coordinates, the plane
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_textiles_atlas && build/tests/unit/test_textiles_atlas

   Most sets here are of pictures whose pixels say which they are: (tile, x, y) as floats. So every
   pixel of an atlas can be asked where it comes from.                                        */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define TEXTILES_MAX_PIXELS (1 << 22) /* so that sets that are too large are quickly made */
#include "textiles.h"

#include "testkit.h"

/* ---- helpers ---------------------------------------------------------------------------- */

enum { N = 32, FILL = 0x5c };

static void assert_near(double a, double b, double tolerance) {
    if (!(fabs(a - b) <= tolerance)) fail_msg("%.9g is not %.9g within %g", a, b, tolerance);
}

typedef struct kind_of {
    textiles_kind kind;
    int colors, variants, reduced, count;
} kind_of;

static const kind_of kinds[] = {
    {TEXTILES_WANG, 2, 1, 0, 16},     {TEXTILES_WANG, 2, 2, 0, 32},
    {TEXTILES_WANG, 3, 1, 0, 81},     {TEXTILES_WANG, 2, 3, 1, 24},
    {TEXTILES_CORNER, 2, 1, 0, 16},   {TEXTILES_CORNER, 2, 3, 0, 48},
    {TEXTILES_CORNER, 3, 1, 0, 81},   {TEXTILES_TRIANGLE, 2, 1, 0, 24},
    {TEXTILES_TRIANGLE, 2, 3, 0, 72}, {TEXTILES_TRIANGLE, 3, 1, 0, 76},
    {TEXTILES_TRIANGLE, 2, 1, 1, 16}, {TEXTILES_FRAME, 3, 1, 0, 3},
    {TEXTILES_FRAME, 2, 2, 0, 4},
};
enum { KINDS = sizeof kinds / sizeof kinds[0] };

static textiles_desc desc_of(const kind_of *k, int size) {
    textiles_desc d;
    memset(&d, 0, sizeof d);
    d.kind = k->kind;
    d.size = size;
    d.colors = k->colors;
    d.variants = k->variants;
    d.reduced = k->reduced;
    return d;
}

/* Import pictures: map 0 is (tile, x, y) in floats, map 1 random bytes of 4 channels. */
static textiles_set *import_desc(const textiles_desc *d, int count) {
    const int side = d->size + (d->kind == TEXTILES_TRIANGLE);
    const size_t texels = (size_t)side * (size_t)side;
    txm_image *maps = (txm_image *)calloc((size_t)count * 2, sizeof *maps);
    float *where = (float *)malloc((size_t)count * texels * 3 * sizeof *where);
    uint8_t *bytes = (uint8_t *)malloc((size_t)count * texels * 4);
    assert_true(maps && where && bytes);
    txm_rng rng = txm_rng_make(5, 5);
    for (size_t i = 0; i < (size_t)count * texels * 4; i++) bytes[i] = (uint8_t)txm_rng_next(&rng);
    for (int t = 0; t < count; t++) {
        float *p = where + (size_t)t * texels * 3;
        for (int m = 0; m < 2; m++) {
            maps[2 * t + m].width = maps[2 * t + m].height = side;
            maps[2 * t + m].channels = 3 + m;
        }
        maps[2 * t].pixels = p;
        maps[2 * t].sample = TXM_F32;
        maps[2 * t + 1].pixels = bytes + (size_t)t * texels * 4;
        for (int y = 0; y < side; y++) {
            for (int x = 0; x < side; x++) {
                *p++ = (float)t;
                *p++ = (float)x;
                *p++ = (float)y;
            }
        }
    }
    textiles_set *set = NULL;
    txm_env env = {0};
    const txm_status status = textiles_import(d, maps, count, 2, &env, &set);
    if (status != TXM_OK) fail_msg("import: %d, %s", status, env.message);
    free(maps);
    free(where);
    free(bytes);
    return set;
}

static textiles_set *import(const kind_of *k, int size) {
    const textiles_desc d = desc_of(k, size);
    return import_desc(&d, k->count);
}

/* a refusal, with a message */
#define refused(call)                                                                              \
    do {                                                                                           \
        txm_env env = {0};                                                                         \
        assert_int_equal(call, TXM_BAD_ARGUMENT);                                                  \
        assert_true(strlen(env.message) > 10);                                                     \
    } while (0)

static txm_image picture(int width, int height, int channels, txm_sample sample) {
    txm_image im;
    memset(&im, 0, sizeof im);
    im.width = width;
    im.height = height;
    im.channels = channels;
    im.sample = sample;
    const size_t bytes = (size_t)width * (size_t)height * (size_t)channels * txm_sample_bytes(sample);
    im.pixels = malloc(bytes);
    assert_non_null(im.pixels);
    memset(im.pixels, FILL, bytes);
    return im;
}

/* the bytes of a packed picture */
static size_t bytes_of(const txm_image *im) {
    return (size_t)im->width * (size_t)im->height * (size_t)im->channels *
           txm_sample_bytes(im->sample);
}

static int untouched(const txm_image *im) {
    const uint8_t *p = (const uint8_t *)im->pixels;
    for (size_t i = 0; i < bytes_of(im); i++) {
        if (p[i] != FILL) return 0;
    }
    return 1;
}

static textiles_layout lay_out(const textiles_set *set, textiles_packing packing, int gutter) {
    textiles_layout l;
    txm_env env = {0};
    const txm_status status = textiles_layout_make(set, packing, gutter, &env, &l);
    if (status != TXM_OK) fail_msg("layout: %d, %s", status, env.message);
    return l;
}

static txm_image atlas_of(const textiles_set *set, const textiles_layout *l, int map) {
    txm_image im = picture(l->width, l->height, map ? 4 : 3, map ? TXM_U8 : TXM_F32);
    txm_env env = {0};
    const txm_status status = textiles_draw_atlas(set, l, map, &env, im);
    if (status != TXM_OK) fail_msg("atlas: %d, %s", status, env.message);
    return im;
}

/* which pixel of which tile (x, y) of a picture shows */
typedef struct where {
    int tile, x, y;
} where;

static where look(const txm_image *im, int x, int y) {
    const float *p = (const float *)txm_image_row_const(im, y) + 3 * x;
    const where w = {(int)p[0], (int)p[1], (int)p[2]};
    assert_true((float)w.tile == p[0] && (float)w.x == p[1] && (float)w.y == p[2]);
    return w;
}

static int torus_allowed(const kind_of *k) {
    return !k->reduced && (k->kind == TEXTILES_WANG || k->kind == TEXTILES_CORNER);
}

/* Is u right of t, or below it, as it should be? By the rules of the declaration. */
static int matches(const textiles_set *set, int t, int u, int down) {
    textiles_tile a, b;
    assert_true(textiles_tile_at(set, t, &a) && textiles_tile_at(set, u, &b));
    if (textiles_kind_of(set) == TEXTILES_CORNER) {
        return down ? a.edges[3] == b.edges[0] && a.edges[2] == b.edges[1]
                    : a.edges[1] == b.edges[0] && a.edges[2] == b.edges[3];
    }
    return down ? a.edges[2] == b.edges[0] : a.edges[1] == b.edges[3];
}

/* ---- layouts ------------------------------------------------------------------------------ */

/* Tiles and gutters lie inside the picture and apart from each other, at multiples of the gutter. */
static void check_rectangles(const kind_of *k, const textiles_layout *l) {
    const int triangle = k->kind == TEXTILES_TRIANGLE, g = l->gutter, side = l->size + triangle;
    uint8_t *taken = (uint8_t *)calloc((size_t)l->width, (size_t)l->height);
    assert_non_null(taken);
    assert_int_equal(l->count, k->count);
    assert_true(l->pitch_x >= side && l->pitch_y >= side);
    if (g) assert_true(l->width % g == 0 && l->height % g == 0);
    for (int t = 0; t < l->count; t++) {
        int px = -1, py = -1, step = 0;
        assert_int_equal(textiles_place(l, t, &px, &py, &step, NULL), 1);
        assert_true(step == 1 || (step == -1 && triangle));
        if (g) assert_true((px + (step < 0)) % g == 0 && (py + (step < 0)) % g == 0);
        for (int j = -g; j < side + g; j++) {
            for (int i = -g; i < side + g; i++) {
                if (triangle && i + j > l->size + g) continue;
                const int x = px + step * i, y = py + step * j;
                assert_true(x >= 0 && y >= 0 && x < l->width && y < l->height);
                uint8_t *p = taken + (size_t)y * (size_t)l->width + x;
                assert_int_equal(*p, 0);
                *p = 1;
            }
        }
    }
    free(taken);
}

static void test_rectangles(void **state) {
    (void)state;
    static const int gutters[] = {0, 1, 2, 3, 8, 13, -1};
    for (int i = 0; i < KINDS; i++) {
        for (int size = N; size <= N + 5; size += 5) {
            textiles_set *set = import(&kinds[i], size);
            for (int k = 0; k < 7; k++) {
                for (int p = 0; p < 2; p++) {
                    const textiles_packing packing = p ? TEXTILES_SLICES : TEXTILES_PACKED;
                    const textiles_layout l = lay_out(set, packing, gutters[k]);
                    const int asked = gutters[k] < 0 ? 8 : gutters[k];
                    assert_true(l.gutter >= asked && l.gutter < 2 * asked + !asked);
                    check_rectangles(&kinds[i], &l);
                    if (p) {
                        assert_int_equal(l.width, l.pitch_x);
                        assert_int_equal(l.height, l.count * l.pitch_y);
                    } else if (l.count > 4) { /* about square */
                        assert_true(l.width <= 2 * l.height && l.height <= 2 * l.width);
                    }
                }
            }
            if (torus_allowed(&kinds[i])) {
                const textiles_layout l = lay_out(set, TEXTILES_TORUS, -1);
                assert_int_equal(l.gutter, 0);
                assert_int_equal(l.width * l.height, l.count * size * size);
                check_rectangles(&kinds[i], &l);
            }
            textiles_set_free(set);
        }
    }
}

/* All that bilinear filtering at mip-map levels up to log2(gutter) sees from a tile's inside and
   border is the tile's surroundings, not another cell. */
static void test_footprints(void **state) {
    (void)state;
    for (int i = 0; i < KINDS; i++) {
        const int triangle = kinds[i].kind == TEXTILES_TRIANGLE, size = N + 3 * (i % 2);
        textiles_set *set = import(&kinds[i], size);
        const int margin = size / 2;
        txm_image alone = picture(size + triangle + 2 * margin, size + triangle + 2 * margin, 3,
                                  TXM_F32);
        for (int g = 1; g <= 8; g *= 2) {
            const textiles_layout l = lay_out(set, TEXTILES_PACKED, g);
            txm_image atlas = atlas_of(set, &l, 0);
            for (int t = 0; t < l.count; t += 1 + l.count / 8) {
                int px, py, step;
                assert_int_equal(textiles_place(&l, t, &px, &py, &step, NULL), 1);
                assert_int_equal(textiles_draw_tile(set, t, margin, 0, NULL, alone), TXM_OK);
                for (int q = 0; q <= 16 * size; q++) { /* places along the border */
                    const double f = (q % (4 * size)) / 4.0, far = size, way = q / (4 * size);
                    const double u = way < 1 ? f : way < 2 ? 0 : way < 3 ? f : far;
                    const double v = way < 1 ? 0 : way < 2 ? f : way < 3 ? (triangle ? far - f : far)
                                                                          : f;
                    if (triangle && u + v > far) continue;
                    const double centre = triangle ? 0.5 : 0;
                    /* the first of the four mip-map pixels around the place */
                    const int x = (int)floor((px + step * u + centre) / g - 0.5) * g;
                    const int y = (int)floor((py + step * v + centre) / g - 0.5) * g;
                    for (int b = 0; b < 4 * g * g; b++) {
                        const int ax = x + b % (2 * g), ay = y + b / (2 * g);
                        if (ax < 0 || ay < 0 || ax >= l.width || ay >= l.height)
                            fail_msg("tile %d of kind %d looks outside the atlas", t, i);
                        const where seen = look(&atlas, ax, ay);
                        const where want = look(&alone, margin + step * (ax - px),
                                                margin + step * (ay - py));
                        if (seen.tile != want.tile || seen.x != want.x || seen.y != want.y)
                            fail_msg("kind %d, gutter %d, tile %d: (%d, %d) is another's", i, g, t,
                                     step * (ax - px), step * (ay - py));
                    }
                }
            }
            free(atlas.pixels);
        }
        free(alone.pixels);
        textiles_set_free(set);
    }
}

static void test_torus(void **state) {
    (void)state;
    static const kind_of more[] = {{TEXTILES_WANG, 4, 1, 0, 256}, {TEXTILES_CORNER, 3, 2, 0, 162}};
    for (int i = 0; i < KINDS + 2; i++) {
        const kind_of *k = i < KINDS ? &kinds[i] : &more[i - KINDS];
        if (!torus_allowed(k)) continue;
        textiles_set *set = import(k, N);
        const textiles_layout l = lay_out(set, TEXTILES_TORUS, 0);
        txm_image atlas = atlas_of(set, &l, 0);
        const int columns = l.width / N, rows = l.height / N;
        assert_int_equal(columns * rows, k->count);
        uint8_t seen[256] = {0};
        for (int y = 0; y < rows; y++) {
            for (int x = 0; x < columns; x++) {
                const where w = look(&atlas, x * N, y * N);
                const where right = look(&atlas, (x + 1) % columns * N, y * N);
                const where below = look(&atlas, x * N, (y + 1) % rows * N);
                assert_true(matches(set, w.tile, right.tile, 0));
                assert_true(matches(set, w.tile, below.tile, 1));
                assert_int_equal(seen[w.tile], 0);
                seen[w.tile] = 1;
                for (int b = 0; b < N * N; b++) {
                    const where p = look(&atlas, x * N + b % N, y * N + b / N);
                    assert_true(p.tile == w.tile && p.x == b % N && p.y == b / N);
                }
            }
        }
        free(atlas.pixels);
        textiles_set_free(set);
    }
}

/* ---- gutters ------------------------------------------------------------------------------ */

/* A square's surroundings are legal neighbours, in place. */
static void check_square_gutter(const textiles_set *set, int tile, const txm_image *im, int gutter,
                                int corners) {
    where first[3][3];
    for (int y = 0; y < 3; y++) {
        for (int x = 0; x < 3; x++)
            first[y][x] = look(im, x == 0 ? 0 : x == 1 ? gutter : gutter + N,
                               y == 0 ? 0 : y == 1 ? gutter : gutter + N);
    }
    assert_int_equal(first[1][1].tile, tile);
    assert_true(matches(set, tile, first[1][2].tile, 0));
    assert_true(matches(set, first[1][0].tile, tile, 0));
    assert_true(matches(set, first[0][1].tile, tile, 1));
    assert_true(matches(set, tile, first[2][1].tile, 1));
    for (int c = 0; c < 4 && corners; c++) {
        const int x = c % 2 * 2, y = c / 2 * 2, corner = first[y][x].tile;
        const int beside = first[y][1].tile, above = first[1][x].tile;
        assert_true(x ? matches(set, beside, corner, 0) : matches(set, corner, beside, 0));
        assert_true(y ? matches(set, above, corner, 1) : matches(set, corner, above, 1));
    }
    for (int y = 0; y < im->height; y++) {
        for (int x = 0; x < im->width; x++) {
            const int u = x - gutter, v = y - gutter;
            const int column = u < 0 ? 0 : u < N ? 1 : 2, row = v < 0 ? 0 : v < N ? 1 : 2;
            const where w = look(im, x, y);
            if (!corners && column != 1 && row != 1) continue;
            assert_int_equal(w.tile, first[row][column].tile);
            assert_int_equal(w.x, (u + N) % N);
            assert_int_equal(w.y, (v + N) % N);
        }
    }
}

/* The place on the plane of texel (i, j) of the tile that lies beyond side k of a triangle with its
   own side m: corner m at our corner k + 1, corner m + 1 at our corner k. By turning vectors. */
static void beyond(int k, int m, int i, int j, double at[2]) {
    const double h = sqrt(3.0) / 2;
    const double v[3][2] = {{0, 0}, {N / 2.0, N * h}, {N, 0}};
    const double *a = v[m], *b = v[(m + 1) % 3], *to_a = v[(k + 1) % 3], *to_b = v[k];
    const double p[2] = {i + j / 2.0 - a[0], j * h - a[1]};
    const double from[2] = {b[0] - a[0], b[1] - a[1]}, to[2] = {to_b[0] - to_a[0], to_b[1] - to_a[1]};
    const double cosine = (from[0] * to[0] + from[1] * to[1]) / (N * N);
    const double sine = (from[0] * to[1] - from[1] * to[0]) / (N * N);
    at[0] = to_a[0] + cosine * p[0] - sine * p[1];
    at[1] = to_a[1] + sine * p[0] + cosine * p[1];
}

static void check_triangle_gutter(const textiles_set *set, int tile, const txm_image *im,
                                  int gutter) {
    textiles_tile t, u;
    int beyond_sides[3] = {0, 0, 0};
    assert_true(textiles_tile_at(set, tile, &t));
    for (int j = -gutter; j <= N + gutter; j++) {
        for (int i = -gutter; i <= N + gutter; i++) {
            const where w = look(im, i + gutter, j + gutter);
            const int out[3] = {i < 0, i + j > N, j < 0}; /* beyond side 0, 1, 2 */
            assert_true(textiles_tile_at(set, w.tile, &u));
            assert_true(w.x >= 0 && w.y >= 0 && w.x + w.y <= N);
            if (out[0] + out[1] + out[2] == 0) {
                assert_true(w.tile == tile && w.x == i && w.y == j);
                continue;
            }
            if (out[0] + out[1] + out[2] > 1) continue; /* a tile of some neighbour's neighbour */
            const int k = out[0] ? 0 : out[1] ? 1 : 2;
            const int depth = out[0] ? -i : out[1] ? i + j - N : -j;
            /* a neighbour's rows are shorter the further away from the edge */
            const int along = out[0] ? N - j : out[1] ? i : j == 0 ? i : N - i;
            if (along < 0 || along > N) continue;
            if ((out[0] && j < depth) || (out[1] && (i > N || j > N)) || (out[2] && i < depth))
                continue;
            int found = 0;
            for (int m = 0; m < 3; m++) {
                double at[2];
                beyond(k, m, w.x, w.y, at);
                found += u.edges[m] == t.edges[k] && u.directions[m] == -t.directions[k] &&
                         fabs(at[0] - (i + j / 2.0)) < 1e-6 &&
                         fabs(at[1] - j * sqrt(3.0) / 2) < 1e-6;
            }
            if (!found) fail_msg("tile %d, texel (%d, %d): no legal neighbour's", tile, i, j);
            beyond_sides[k]++;
        }
    }
    for (int k = 0; k < 3; k++) assert_true(beyond_sides[k] > gutter * (N - gutter));
}

static void test_gutters(void **state) {
    (void)state;
    for (int i = 0; i < KINDS; i++) {
        textiles_set *set = import(&kinds[i], N);
        const int side = N + (kinds[i].kind == TEXTILES_TRIANGLE);
        for (int gutter = 1; gutter <= 16; gutter += 5) {
            txm_image im = picture(side + 2 * gutter, side + 2 * gutter, 3, TXM_F32);
            for (int t = 0; t < kinds[i].count; t++) {
                assert_int_equal(textiles_draw_tile(set, t, gutter, 0, NULL, im), TXM_OK);
                if (kinds[i].kind == TEXTILES_TRIANGLE) check_triangle_gutter(set, t, &im, gutter);
                else check_square_gutter(set, t, &im, gutter, !kinds[i].reduced);
            }
            free(im.pixels);
        }
        textiles_set_free(set);
    }
}

/* An atlas shows each tile and its gutter as draw_tile does, and no pixel is left undrawn. */
static void test_atlas(void **state) {
    (void)state;
    for (int i = 0; i < KINDS; i++) {
        const int triangle = kinds[i].kind == TEXTILES_TRIANGLE;
        textiles_set *set = import(&kinds[i], N);
        for (int p = 0; p < 6; p++) {
            static const int gutters[] = {0, 1, 4};
            const int gutter = gutters[p / 2];
            const textiles_layout l =
                lay_out(set, p % 2 ? TEXTILES_SLICES : TEXTILES_PACKED, gutter);
            txm_image atlas = atlas_of(set, &l, 0);
            const int side = N + triangle + 2 * gutter;
            txm_image im = picture(side, side, 3, TXM_F32);
            for (int t = 0; t < l.count; t++) {
                int px, py, step;
                assert_int_equal(textiles_place(&l, t, &px, &py, &step, NULL), 1);
                assert_int_equal(textiles_draw_tile(set, t, gutter, 0, NULL, im), TXM_OK);
                for (int b = 0; b < side * side; b++) {
                    const int u = b % side - gutter, v = b / side - gutter;
                    if (triangle && u + v > N + gutter) continue;
                    const where want = look(&im, u + gutter, v + gutter);
                    const where got = look(&atlas, px + step * u, py + step * v);
                    assert_memory_equal(&got, &want, sizeof got);
                }
            }
            for (int b = 0; b < l.width * l.height; b++) {
                const where w = look(&atlas, b % l.width, b / l.width);
                assert_true(w.tile >= 0 && w.tile < l.count && w.x >= 0 && w.y >= 0);
                assert_true(triangle ? w.x + w.y <= N : w.x < N && w.y < N);
            }
            free(im.pixels);
            free(atlas.pixels);
        }
        textiles_set_free(set);
    }
}

/* The cells left over at an atlas's end show the pixel of the picture that is nearest. */
static void test_left_over(void **state) {
    (void)state;
    textiles_set *set = import(&kinds[11], N); /* three tiles */
    const textiles_layout l = lay_out(set, TEXTILES_PACKED, 4);
    assert_true(l.columns == 2 && l.height == 2 * l.pitch_y);
    txm_image atlas = atlas_of(set, &l, 0);
    for (int y = 0; y < l.pitch_y; y++) {
        for (int x = 0; x < l.pitch_x; x++) {
            const int above = y < x;
            const where w = look(&atlas, l.pitch_x + x, l.pitch_y + y);
            const where want = look(&atlas, above ? l.pitch_x + x : l.pitch_x - 1,
                                    above ? l.pitch_y - 1 : l.pitch_y + y);
            assert_memory_equal(&w, &want, sizeof w);
        }
    }
    free(atlas.pixels);
    textiles_set_free(set);
}

/* Where no neighbour fits, the border goes on; where only one axis has one, that one does. */
static void test_lonely_frames(void **state) {
    (void)state;
    static const int below[2][4] = {{0, 1, 2, 3}, {2, 1, 2, 3}}; /* below: class 1; else none */
    static const int aside[1][4] = {{0, 1, 2, 1}};               /* on both sides itself      */
    for (int k = 0; k < 2; k++) {
        textiles_desc d;
        memset(&d, 0, sizeof d);
        d.kind = TEXTILES_FRAME;
        d.size = N;
        d.colors = 4;
        d.classes = k ? aside : below;
        d.class_count = 2 - k;
        textiles_set *set = import_desc(&d, 2 - k);
        txm_image im = picture(N + 10, N + 10, 3, TXM_F32);
        assert_int_equal(textiles_draw_tile(set, 0, 5, 0, NULL, im), TXM_OK);
        for (int y = -5; y < N + 5; y++) {
            for (int x = -5; x < N + 5; x++) {
                const where w = look(&im, x + 5, y + 5);
                assert_int_equal(w.tile, !k && y >= N);
                assert_int_equal(w.x, k ? (x + N) % N : txm_clampi(x, 0, N - 1));
                assert_int_equal(w.y, !k && y >= N ? y - N : txm_clampi(y, 0, N - 1));
            }
        }
        free(im.pixels);
        textiles_set_free(set);
    }
}

/* ---- texture coordinates ------------------------------------------------------------------ */

/* What lies at uv, a little towards the middle of the tile, is the corner asked for. */
static void test_uv(void **state) {
    (void)state;
    for (int i = 0; i < KINDS; i++) {
        const int triangle = kinds[i].kind == TEXTILES_TRIANGLE, corners = triangle ? 3 : 4;
        textiles_set *set = import(&kinds[i], N);
        for (int p = 0; p < 3; p++) {
            if (p == 1 && !torus_allowed(&kinds[i])) continue;
            const textiles_layout l = lay_out(set, (textiles_packing)p, -1);
            txm_image atlas = atlas_of(set, &l, 0);
            for (int t = 0; t < l.count; t++) {
                for (int r = 0; r < (triangle ? 3 : 1); r++) {
                    float place[4][2], face[4][2];
                    assert_int_equal(textiles_place(&l, t, NULL, NULL, NULL, place), 1);
                    assert_int_equal(textiles_face_uv(&l, t, r, face), corners);
                    double middle[2] = {0, 0};
                    for (int k = 0; k < corners; k++) {
                        middle[0] += (double)place[k][0] / corners;
                        middle[1] += (double)place[k][1] / corners;
                    }
                    const int height = p == TEXTILES_SLICES ? l.pitch_y : l.height;
                    const int top = p == TEXTILES_SLICES ? t * l.pitch_y : 0;
                    for (int k = 0; k < 2 * corners; k++) {
                        const float *uv = k < corners ? place[k] : face[k - corners];
                        const double u = (double)uv[0] * 0.999 + middle[0] * 0.001;
                        const double v = (double)uv[1] * 0.999 + middle[1] * 0.001;
                        const where w = look(&atlas, (int)floor(u * l.width),
                                             top + (int)floor(v * height));
                        /* nw, ne, se, sw; faces nw, sw, se, ne; triangles (0,0), (0,N), (N,0) */
                        static const int square[8][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1},
                                                         {0, 0}, {0, 1}, {1, 1}, {1, 0}};
                        static const int three[3][2] = {{0, 0}, {0, 1}, {1, 0}};
                        const int *c = !triangle ? square[k] : three[k < 3 ? k : (k + r) % 3];
                        const int far = N - !triangle;
                        assert_int_equal(w.tile, t);
                        assert_int_equal(w.x, c[0] * far);
                        assert_int_equal(w.y, c[1] * far);
                    }
                }
            }
            free(atlas.pixels);
        }
        textiles_set_free(set);
    }
}

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

/* 256 tiles of 80 pixels are within the limit, with wide gutters no longer. */
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
            assert_int_not_equal(textiles_draw_plane(&plane, &s, &atlas, 0, 0, 1, &env, out), TXM_OK);
            assert_int_not_equal(textiles_draw_atlas(set, &s, 0, &env, wide), TXM_OK);
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
        cmocka_unit_test(test_rectangles),      cmocka_unit_test(test_footprints),
        cmocka_unit_test(test_torus),           cmocka_unit_test(test_gutters),
        cmocka_unit_test(test_atlas),           cmocka_unit_test(test_left_over),
        cmocka_unit_test(test_lonely_frames),
        cmocka_unit_test(test_uv),              cmocka_unit_test(test_plane_copies),
        cmocka_unit_test(test_plane_filters),   cmocka_unit_test(test_plane_borders),
        cmocka_unit_test(test_plane_triangles),
        cmocka_unit_test(test_plane_of_sixteen_bits),
        cmocka_unit_test(test_same_bytes),      cmocka_unit_test(test_bad_layouts),
        cmocka_unit_test(test_too_large),       cmocka_unit_test(test_bad_pictures),
    };
    return cmocka_run_group_tests_name("textiles_atlas", tests, NULL, NULL);
}
