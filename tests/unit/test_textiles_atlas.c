/* test_textiles_atlas.c - pictures of tile sets: layouts, gutters, texture coordinates
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_textiles_atlas && build/tests/unit/test_textiles_atlas */
#define TEXTILES_MAX_PIXELS (1 << 22) /* so that sets that are too large are quickly made */
#include "textiles.h"

#include "atlaskit.h"

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

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rectangles),
        cmocka_unit_test(test_footprints),
        cmocka_unit_test(test_torus),
        cmocka_unit_test(test_gutters),
        cmocka_unit_test(test_atlas),
        cmocka_unit_test(test_left_over),
        cmocka_unit_test(test_lonely_frames),
        cmocka_unit_test(test_uv),
    };
    return cmocka_run_group_tests_name("textiles_atlas", tests, NULL, NULL);
}
