/* tilecheck.h - what every set of tiles must pass: borders, joints, corners, sources
   SPDX-License-Identifier: MIT OR Unlicense                                              */
#ifndef TILECHECK_H
#define TILECHECK_H

#include "tilekit.h"

/* ---- checks that every set must pass -------------------------------------------------------- */

/* Every texel has a source inside its exemplar. sizes: width and height of each. */
static inline void check_sources(const readback *b, const int (*sizes)[2]) {
    for (int t = 0; t < b->count; t++) {
        for (int y = 0; y < b->side; y++) {
            for (int x = 0; x < b->side; x++) {
                const size_t p = place_of(b, t, x, y);
                const int e = b->sheet[p];
                if (!is_inside(b, x, y)) {
                    assert_int_equal(e, -1);
                    continue;
                }
                if (e < 0) fail_msg("tile %d: no source for (%d, %d)", t, x, y);
                const double u = (double)b->from[p][0], v = (double)b->from[p][1];
                if (!(u >= 0 && v >= 0 && u <= sizes[e][0] - 1 && v <= sizes[e][1] - 1))
                    fail_msg("tile %d: (%d, %d) comes from (%g, %g)", t, x, y, u, v);
                if (b->kind != TEXTILES_TRIANGLE) assert_true(u == floor(u) && v == floor(v));
            }
        }
    }
}

/* The first two rows at a side are the same in all tiles with its colour. */
static inline void check_square_borders(const readback *b) {
    for (int k = 0; k < 4; k++) {
        for (int t = 0; t < b->count; t++) {
            const int first = tile_with(b, k, side_key(b, t, k));
            for (int i = 0; i < 2 * b->size; i++) {
                const size_t p = side_place(b, t, k, i / 2, i % 2);
                const size_t q = side_place(b, first, k, i / 2, i % 2);
                if (!same_source(b, p, q))
                    fail_msg("tiles %d, %d, side %d: sources differ at %d, row %d", first, t, k,
                             i / 2, i % 2);
                if (!same_bytes(b, p, q))
                    fail_msg("tiles %d, %d, side %d: bytes differ at %d, row %d", first, t, k, i / 2,
                             i % 2);
            }
        }
    }
}

/* The exemplar continues across the joints and along them, except once per cut and row. */
static inline void check_square_joints(const readback *b, int segments) {
    const int n = b->size, zone = n / 4 < 12 ? n / 4 : 12;
    int joints = 0;
    for (int axis = 0; axis < 2; axis++) { /* 0: south over north, 1: east beside west */
        for (int key = 0; key < KEYS; key++) {
            const int k[2] = {axis ? 1 : 2, axis ? 3 : 0};
            const int t[2] = {tile_with(b, k[0], key), tile_with(b, k[1], key)};
            if (t[0] < 0 || t[1] < 0) continue;
            joints++;
            size_t line[4], last[4] = {0, 0, 0, 0};
            int breaks[3] = {0, 0, 0}, along[4] = {0, 0, 0, 0};
            for (int a = 0; a < n; a++) {
                for (int l = 0; l < 4; l++)
                    line[l] = side_place(b, t[l / 2], k[l / 2], a, l < 2 ? 1 - l : l - 2);
                for (int l = 0; l < 3; l++) {
                    if (is_next(b, line[l], line[l + 1], axis, !axis)) continue;
                    breaks[l]++;
                    if (segments == 1 && a >= zone && a < n - zone)
                        fail_msg("key %d, axis %d: a break across at %d", key, axis, a);
                }
                for (int l = 0; l < 4 && a; l++)
                    along[l] += !is_next(b, last[l], line[l], !axis, axis);
                memcpy(last, line, sizeof last);
            }
            for (int l = 0; l < 3; l++) assert_true(breaks[l] <= segments + 1);
            for (int l = 0; l < 4; l++) assert_true(along[l] <= segments + 1);
        }
    }
    assert_true(joints > 0);
}

/* Around a vertex four tiles show one piece of exemplar, always the same for its colour. */
static inline void check_square_corners(const readback *b) {
    const int n = b->size;
    for (int color = 0; color < b->colors; color++) {
        size_t vertex = (size_t)-1;
        for (int t = 0; t < b->count; t++) {
            for (int c = 0; c < 4; c++) { /* nw, ne, se, sw */
                if (b->kind == TEXTILES_CORNER && b->tiles[t].edges[c] != color) continue;
                const int right = c == 1 || c == 2, low = c >= 2;
                if (vertex == (size_t)-1 && c == 0) vertex = place_of(b, t, 0, 0);
                if (vertex == (size_t)-1) continue; /* the first tile is 0 0 0 0; of others below */
                for (int i = 0; i < 4; i++) {
                    const int dx = right ? -1 - i % 2 : i % 2, dy = low ? -1 - i / 2 : i / 2;
                    const size_t p = place_of(b, t, (n + dx) % n, (n + dy) % n);
                    if (!is_next(b, vertex, p, dx, dy))
                        fail_msg("tile %d, corner %d: not what other tiles show there", t, c);
                }
            }
        }
        assert_true(vertex != (size_t)-1);
    }
}

/* Edges of different colours show different places. */
static inline void check_edges_differ(const readback *b) {
    const int triangle = b->kind == TEXTILES_TRIANGLE;
    for (int k = 0; k < (triangle ? 3 : 4); k++) {
        for (int one = 0; one < KEYS; one++) {
            for (int two = 0; two < one; two++) {
                const int s = tile_with(b, k, one), t = tile_with(b, k, two);
                int same = 0;
                if (s < 0 || t < 0) continue;
                if (triangle && b->tiles[s].directions[k] != b->tiles[t].directions[k]) continue;
                for (int a = 12; a < b->size - 12; a++)
                    same += same_source(b, side_place(b, s, k, a, 0), side_place(b, t, k, a, 0));
                assert_true(b->size <= 24 || same * 8 <= b->size - 24);
            }
        }
    }
}

/* Edge texels are the same whichever side and tile they are seen from, vertices everywhere; the rows
   beside an edge are the same in all tiles that see it from the same side. */
static inline void check_triangle_borders(const readback *b) {
    const int n = b->size;
    int first[TEXTILES_MAX_COLORS][2][2]; /* color, direction -> tile, side */
    memset(first, -1, sizeof first);
    for (int t = 0; t < b->count; t++) {
        for (int k = 0; k < 3; k++) {
            const int color = b->tiles[t].edges[k], with = b->tiles[t].directions[k] > 0;
            if (first[color][with][0] < 0) {
                first[color][with][0] = t;
                first[color][with][1] = k;
            }
            for (int end = 0; end < 2; end++) {
                const size_t p = side_place(b, t, k, end * n, 0), q = place_of(b, 0, 0, 0);
                assert_true(same_source(b, p, q) && same_bytes(b, p, q));
            }
            for (int d = 0; d < 2; d++) {
                const int s = first[color][d][0], j = first[color][d][1];
                if (s < 0) continue;
                for (int a = 0; a <= n; a++) {
                    const size_t p = side_place(b, t, k, a, 0);
                    const size_t q = side_place(b, s, j, d == with ? a : n - a, 0);
                    if (!same_source(b, p, q) || !same_bytes(b, p, q))
                        fail_msg("tile %d side %d, tile %d side %d: texel %d differs", t, k, s, j, a);
                }
                for (int a = 8; a <= n - 8 - 2 && d == with; a++) {
                    for (int r = 1; r <= 2; r++) {
                        const size_t p = side_place(b, t, k, a, r), q = side_place(b, s, j, a, r);
                        if (!same_source(b, p, q) || !same_bytes(b, p, q))
                            fail_msg("tiles %d, %d: row %d differs at %d", t, s, r, a);
                    }
                }
            }
        }
    }
}

/* The rows on both sides of an edge lie in the exemplar on both sides of what the edge shows. */
static inline void check_triangle_joints(const readback *b, int segments) {
    const int n = b->size;
    int joints = 0;
    for (int color = 0; color < b->colors; color++) {
        int at[2][2] = {{-1, -1}, {-1, -1}}, breaks = 0, places = 0;
        for (int t = 0; t < b->count; t++) {
            for (int k = 0; k < 3; k++) {
                if (b->tiles[t].edges[k] != color) continue;
                at[b->tiles[t].directions[k] > 0][0] = t;
                at[b->tiles[t].directions[k] > 0][1] = k;
            }
        }
        if (at[0][0] < 0 || at[1][0] < 0) continue;
        joints++;
        for (int a = 8; a < n - 8; a++) {
            const size_t p = side_place(b, at[1][0], at[1][1], a, 0);
            const size_t q = side_place(b, at[1][0], at[1][1], a + 1, 0);
            const size_t side[2] = {side_place(b, at[1][0], at[1][1], a, 1),
                                    side_place(b, at[0][0], at[0][1], n - a - 1, 1)};
            const double ex = (double)b->from[q][0] - (double)b->from[p][0];
            const double ey = (double)b->from[q][1] - (double)b->from[p][1];
            double turn[2];
            int fine = b->sheet[p] == b->sheet[q] && fabs(ex * ex + ey * ey - 1) < 1e-3;
            for (int i = 0; i < 2; i++) {
                const double x = (double)b->from[side[i]][0] - (double)b->from[p][0];
                const double y = (double)b->from[side[i]][1] - (double)b->from[p][1];
                turn[i] = ex * y - ey * x; /* sin of the angle from the edge: 60 degrees */
                fine = fine && b->sheet[side[i]] == b->sheet[p] && fabs(x * x + y * y - 1) < 1e-3 &&
                       fabs(ex * x + ey * y - 0.5) < 1e-3;
            }
            fine = fine && turn[0] * turn[1] < 0;
            breaks += !fine;
            places++;
        }
        if (segments == 1) assert_int_equal(breaks, 0);
        assert_true(breaks <= 6 * (segments - 1));
        assert_true(places > n / 3);
    }
    assert_true(joints > 0);
}

static inline void check_set(const readback *b, int segments) {
    if (b->kind == TEXTILES_TRIANGLE) {
        check_triangle_borders(b);
        check_triangle_joints(b, segments);
    } else {
        check_square_borders(b);
        check_square_joints(b, segments);
        check_square_corners(b);
    }
}

/* Is p's pixel of a map that of the exemplar at its source? Squares. */
static inline int shows_source(const readback *b, const textiles_exemplar *exemplars, int m, size_t p) {
    const txm_image *im = &exemplars[b->sheet[p]].maps[m];
    const char *row = (const char *)txm_image_row_const(im, (int)b->from[p][1]);
    return memcmp(pixel(b, m, p), row + (size_t)b->from[p][0] * b->texel[m], b->texel[m]) == 0;
}

static inline void check_pixels(const readback *b, const textiles_exemplar *exemplars) {
    for (int m = 0; m < b->maps; m++) {
        for (int t = 0; t < b->count; t++) {
            for (int i = 0; i < b->side * b->side; i++) {
                if (!shows_source(b, exemplars, m, place_of(b, t, i % b->side, i / b->side)))
                    fail_msg("map %d, tile %d: (%d, %d) is not its source", m, t, i % b->side,
                             i / b->side);
            }
        }
    }
}

#endif /* TILECHECK_H */
