/* test_textiles_assign.c - which tile lies where: sets, the plane, grids, meshes
   SPDX-License-Identifier: MIT OR Unlicense

   cc -std=c99 -I. -Itests tests/test_textiles_assign.c -lcmocka -lpthread -lm

   What the tiles show plays no part here: all sets are imported from one gray picture.        */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define TEXTILES_IMPLEMENTATION
#include "textiles.h"

#include "testkit.h"

/* ---- helpers ---------------------------------------------------------------------------- */

enum { N = 32, FILL = 0x5c5c5c5c, MOST = 256 * 16 };

static textiles_desc desc_of(textiles_kind kind, int colors, int variants, int reduced) {
    textiles_desc d;
    memset(&d, 0, sizeof d);
    d.kind = kind;
    d.size = N;
    d.colors = colors;
    d.variants = variants;
    d.reduced = reduced;
    return d;
}

/* how many tiles a description stands for, by the formulas of the literature */
static int count_of(const textiles_desc *d) {
    const int c = d->colors, v = d->variants;
    switch (d->kind) {
    case TEXTILES_WANG: return v * (d->reduced ? 2 * c * c : c * c * c * c);
    case TEXTILES_CORNER: return v * c * c * c * c;
    case TEXTILES_TRIANGLE: return v * (d->reduced ? 2 * c * c * c : (8 * c * c * c + 4 * c) / 3);
    case TEXTILES_FRAME: break;
    }
    return v * (d->classes ? d->class_count : c);
}

static textiles_set *import(const textiles_desc *d) {
    static uint8_t pixels[(N + 1) * (N + 1)];
    static txm_image tiles[MOST];
    const int side = N + (d->kind == TEXTILES_TRIANGLE), count = count_of(d);
    txm_env env = {0};
    textiles_set *set = NULL;
    for (int i = 0; i < count; i++) {
        memset(&tiles[i], 0, sizeof tiles[i]);
        tiles[i].pixels = pixels;
        tiles[i].width = tiles[i].height = side;
    }
    const txm_status status = textiles_import(d, tiles, count, 1, &env, &set);
    if (status != TXM_OK) fail_msg("import: %d, %s", status, env.message);
    assert_int_equal(textiles_count(set), count);
    return set;
}

static textiles_set *make_set(textiles_kind kind, int colors, int variants, int reduced) {
    const textiles_desc d = desc_of(kind, colors, variants, reduced);
    return import(&d);
}

static textiles_set *make_frame(const int (*classes)[4], int count, int colors, int variants) {
    textiles_desc d = desc_of(TEXTILES_FRAME, colors, variants, 0);
    d.classes = classes;
    d.class_count = count;
    return import(&d);
}

/* classes on which a random walk gets stuck but which cover any grid */
static const int stubborn[6][4] = {{0, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 1},
                                   {1, 0, 0, 1}, {1, 1, 1, 1}, {1, 1, 0, 0}};

static textiles_tile tile_at(const textiles_set *set, int index) {
    textiles_tile t;
    if (!textiles_tile_at(set, index, &t)) fail_msg("no tile %d", index);
    return t;
}

/* the right neighbour continues the left one, the lower one the upper */
static int joins(const textiles_set *set, int a, int b, int down) {
    const textiles_tile s = tile_at(set, a), t = tile_at(set, b);
    if (textiles_kind_of(set) == TEXTILES_CORNER)
        return down ? s.edges[3] == t.edges[0] && s.edges[2] == t.edges[1]
                    : s.edges[1] == t.edges[0] && s.edges[2] == t.edges[3];
    return down ? s.edges[2] == t.edges[0] : s.edges[1] == t.edges[3];
}

static void check_joins(const textiles_set *set, const int *tiles, int width, int height,
                        int periodic) {
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            const int t = tiles[y * width + x], right = (x + 1) % width, below = (y + 1) % height;
            if (t < 0 || t >= textiles_count(set)) fail_msg("(%d, %d): tile %d", x, y, t);
            if ((right || periodic) && !joins(set, t, tiles[y * width + right], 0))
                fail_msg("(%d, %d) does not join its right neighbour", x, y);
            if ((below || periodic) && !joins(set, t, tiles[below * width + x], 1))
                fail_msg("(%d, %d) does not join the one below", x, y);
        }
    }
}

/* how often a tile lies three times in a row */
static int count_runs(const int *tiles, int width, int height, int periodic) {
    int runs = 0;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            const int *row = tiles + y * width, t = row[x];
            if (width > 1 && (periodic || x + 2 < width))
                runs += t == row[(x + 1) % width] && t == row[(x + 2) % width];
            if (height > 1 && (periodic || y + 2 < height))
                runs += t == tiles[(y + 1) % height * width + x] &&
                        t == tiles[(y + 2) % height * width + x];
        }
    }
    return runs;
}

/* every tile within so many standard deviations of its share, if the shares are equal */
static void check_usage(const int *tiles, int count, int kinds, double deviations) {
    static int used[MOST];
    const double mean = (double)count / kinds;
    memset(used, 0, sizeof used);
    for (int i = 0; i < count; i++) used[tiles[i]]++;
    for (int t = 0; t < kinds; t++) {
        if (!(fabs(used[t] - mean) <= deviations * sqrt(mean)))
            fail_msg("tile %d of %d: %d times, not about %g", t, kinds, used[t], mean);
    }
}

static int differences(const int *a, const int *b, int count) {
    int n = 0;
    for (int i = 0; i < count; i++) n += a[i] != b[i];
    return n;
}

static void fill(int *tiles, int count, int value) {
    for (int i = 0; i < count; i++) tiles[i] = value;
}

static void assert_filled(const int *tiles, int count, int value) {
    for (int i = 0; i < count; i++)
        if (tiles[i] != value) fail_msg("number %d was touched", i);
}

/* a random number of any bits */
static int any_int(txm_rng *rng) {
    return txm_rng_range(rng, INT_MIN, INT_MAX);
}
static int wrapped(int x, int step) {
    return (int)((uint32_t)x + (uint32_t)step);
}

/* ---- sets: every combination ------------------------------------------------------------ */

static void test_sets_squares(void **state) {
    (void)state;
    for (int kind = TEXTILES_WANG; kind <= TEXTILES_CORNER; kind++) {
        for (int c = 2; c <= 4; c++) {
            for (int v = 1; v <= 3; v += 2) {
                textiles_set *set = make_set((textiles_kind)kind, c, v, 0);
                assert_int_equal(textiles_count(set), c * c * c * c * v);
                for (int code = 0; code < c * c * c * c; code++) {
                    const int e[4] = {code / (c * c * c), code / (c * c) % c, code / c % c, code % c};
                    int rotation = 7;
                    const int found = textiles_find(set, e, NULL, &rotation);
                    assert_int_equal(found, code * v); /* colours read as digits */
                    assert_int_equal(rotation, 0);
                    for (int i = 0; i < v; i++) {
                        const textiles_tile t = tile_at(set, found + i);
                        assert_memory_equal(t.edges, e, sizeof e);
                        assert_int_equal(t.variant, i);
                    }
                }
                const int beyond[4] = {0, c, 0, 0}, below[4] = {0, 0, 0, -1};
                assert_int_equal(textiles_find(set, beyond, NULL, NULL), -1);
                assert_int_equal(textiles_find(set, below, NULL, NULL), -1);
                textiles_free(set);
            }
        }
    }
}

/* Each pair of north and west has two tiles, which differ in both others; each pair of south and
   east is as frequent. */
static void test_sets_reduced_wang(void **state) {
    (void)state;
    for (int c = 2; c <= 4; c++) {
        for (int v = 1; v <= 2; v++) {
            int first[16], seen[16] = {0}, ends[16] = {0};
            textiles_set *set = make_set(TEXTILES_WANG, c, v, 1);
            for (int i = 0; i < textiles_count(set); i += v) {
                const textiles_tile t = tile_at(set, i);
                const int key = t.edges[0] * c + t.edges[3];
                if (seen[key]++) {
                    const textiles_tile u = tile_at(set, first[key]);
                    assert_int_not_equal(t.edges[1], u.edges[1]);
                    assert_int_not_equal(t.edges[2], u.edges[2]);
                }
                first[key] = i;
                ends[t.edges[2] * c + t.edges[1]]++;
                assert_int_equal(textiles_find(set, t.edges, NULL, NULL), i);
            }
            for (int key = 0; key < c * c; key++) {
                assert_int_equal(seen[key], 2);
                assert_int_equal(ends[key], 2);
            }
            textiles_free(set);
        }
    }
}

/* Each combination of three directed edges is there, once up to rotation. */
static void test_sets_triangles(void **state) {
    (void)state;
    for (int c = 2; c <= 4; c++) {
        for (int reduced = 0; reduced < 2; reduced++) {
            static int shown[176];
            const int v = 3 - c % 2;
            textiles_set *set = make_set(TEXTILES_TRIANGLE, c, v, reduced);
            memset(shown, 0, sizeof shown);
            for (int code = 0; code < 8 * c * c * c; code++) {
                const int s[3] = {code / (4 * c * c), code / (2 * c) % (2 * c), code % (2 * c)};
                const int e[4] = {s[0] / 2, s[1] / 2, s[2] / 2, 99};
                const int d[3] = {s[0] % 2 ? -1 : 1, s[1] % 2 ? -1 : 1, s[2] % 2 ? -1 : 1};
                const int round = d[0] == d[1] && d[1] == d[2];
                int r = 7;
                const int found = textiles_find(set, e, d, &r);
                if (round && reduced) {
                    assert_int_equal(found, -1);
                    continue;
                }
                if (found < 0 || r < 0 || r > 2) fail_msg("code %d: tile %d, %d", code, found, r);
                const textiles_tile t = tile_at(set, found);
                assert_int_equal(t.variant, 0);
                shown[found / v]++;
                for (int k = 0; k < 3; k++) {
                    assert_int_equal(t.edges[(k + r) % 3], e[k]);
                    assert_int_equal(t.directions[(k + r) % 3], d[k]);
                    /* turned on by k, the same tile */
                    const int f[4] = {e[k], e[(k + 1) % 3], e[(k + 2) % 3], 0};
                    const int g[3] = {d[k], d[(k + 1) % 3], d[(k + 2) % 3]};
                    assert_int_equal(textiles_find(set, f, g, NULL), found);
                }
            }
            for (int base = 0; base < textiles_count(set) / v; base++) {
                const textiles_tile t = tile_at(set, base * v);
                int same = t.edges[0] == t.edges[1] && t.edges[1] == t.edges[2];
                same &= t.directions[0] == t.directions[1] && t.directions[1] == t.directions[2];
                assert_int_equal(shown[base], same ? 1 : 3);
            }
            textiles_free(set);
        }
    }
}

/* ---- the plane -------------------------------------------------------------------------- */

/* The formulas as shaders/textiles.glsl has them, written down once more. */
static int formula_tile(const textiles_plane *p, int x, int y) {
    const int x1 = wrapped(x, 1), y1 = wrapped(y, 1), c = p->colors, v = p->variants;
    const uint32_t s = p->seed;
    int e[4], code = 0, variant = 0;
    if (p->kind == TEXTILES_WANG) {
        e[0] = txt_below(txt_hash(s, 0, x, y), c);
        e[1] = txt_below(txt_hash(s, 1, x1, y), c);
        e[2] = txt_below(txt_hash(s, 0, x, y1), c);
        e[3] = txt_below(txt_hash(s, 1, x, y), c);
    } else {
        e[0] = txt_below(txt_hash(s, 2, x, y), c);
        e[1] = txt_below(txt_hash(s, 2, x1, y), c);
        e[2] = txt_below(txt_hash(s, 2, x1, y1), c);
        e[3] = txt_below(txt_hash(s, 2, x, y1), c);
    }
    for (int k = 0; k < 4; k++) code = code * c + e[k];
    if (v > 1) {
        const int bx = (int)((uint32_t)x >> 1), by = (int)((uint32_t)y >> 1);
        const uint32_t h = txt_hash(s, 3, bx, by), g = txt_hash(s, 4, bx, by);
        const int a = (int)((h >> 16) * (uint32_t)v >> 16);
        const int d = v == 2 ? a : (int)((h & 65535) * (uint32_t)v >> 16);
        if ((x & 1) == (y & 1)) {
            variant = x & 1 ? d : a;
        } else {
            /* list the variants that are neither a nor d, take one */
            int others[16], n = 0;
            for (int i = 0; i < v; i++)
                if (i != a && i != d) others[n++] = i;
            const uint32_t bits = x & 1 ? g >> 16 : g & 65535;
            variant = others[bits * (uint32_t)n >> 16];
        }
    }
    return code * v + variant;
}

static const int plane_variants[] = {1, 2, 3, 5, 16};

static void test_plane_formula(void **state) {
    (void)state;
    for (int kind = TEXTILES_WANG; kind <= TEXTILES_CORNER; kind++) {
        for (int i = 0; i < 15; i++) {
            textiles_set *set =
                make_set((textiles_kind)kind, 2 + i / 5, plane_variants[i % 5], 0);
            textiles_plane p;
            txm_rng rng = txm_rng_make(1, (uint64_t)i);
            assert_int_equal(textiles_plane_make(set, txm_rng_next(&rng), NULL, &p), TXM_OK);
            for (int k = 0; k < 2000; k++) {
                const int x = k < 1000 ? any_int(&rng) : k % 32 - 16;
                const int y = k < 1000 ? any_int(&rng) : k / 32 % 32 - 16;
                assert_int_equal(textiles_plane_tile(&p, x, y), formula_tile(&p, x, y));
            }
            textiles_free(set);
        }
    }
}

/* Windows anywhere, of any size, show what plane_tile says. */
static void test_plane_windows(void **state) {
    (void)state;
    static int tiles[600 * 24];
    txm_rng rng = txm_rng_make(2, 0);
    for (int i = 0; i < 60; i++) {
        textiles_set *set = make_set(i % 2 ? TEXTILES_CORNER : TEXTILES_WANG, 2 + i % 3,
                                     plane_variants[i % 4], 0);
        textiles_plane p;
        assert_int_equal(textiles_plane_make(set, txm_rng_next(&rng), NULL, &p), TXM_OK);
        const int width = i % 6 == 5 ? txm_rng_range(&rng, 250, 600) : txm_rng_range(&rng, 1, 40);
        const int height = txm_rng_range(&rng, 1, 20);
        const int from = i % 3; /* anywhere, about the origin, about the seam of the integers */
        const int x = from == 0 ? any_int(&rng)
                                : wrapped(from == 1 ? 0 : INT_MIN, txm_rng_range(&rng, -20, 20));
        const int y = from == 0 ? any_int(&rng)
                                : wrapped(from == 1 ? 0 : INT_MIN, txm_rng_range(&rng, -20, 20));
        fill(tiles, width * height + 1, FILL);
        textiles_plane_fill(&p, x, y, width, height, tiles);
        for (int k = 0; k < width * height; k++) {
            const int t = textiles_plane_tile(&p, wrapped(x, k % width), wrapped(y, k / width));
            if (t != tiles[k]) fail_msg("window %d, place %d: %d, not %d", i, k, tiles[k], t);
        }
        assert_int_equal(tiles[width * height], FILL);
        check_joins(set, tiles, width, height, 0);
        if (p.variants > 1) assert_int_equal(count_runs(tiles, width, height, 0), 0);
        fill(tiles, 4, FILL);
        textiles_plane_fill(&p, 0, 0, 0, 5, tiles);
        textiles_plane_fill(&p, 0, 0, 5, -1, tiles);
        assert_filled(tiles, 4, FILL);
        textiles_free(set);
    }
}

/* Big windows: edges match, no runs, tiles about as frequent, no period. */
static void test_plane_statistics(void **state) {
    (void)state;
    enum { W = 192, H = 160 };
    static int tiles[W * H], other[W * H];
    for (int i = 0; i < 10; i++) {
        const textiles_kind kind = i % 2 ? TEXTILES_CORNER : TEXTILES_WANG;
        const int c = 2 + (i > 7), v = plane_variants[i / 2 % 4], kinds = c * c * c * c * v;
        textiles_set *set = make_set(kind, c, v, 0);
        textiles_plane p;
        assert_int_equal(textiles_plane_make(set, (uint32_t)i, NULL, &p), TXM_OK);
        textiles_plane_fill(&p, -100, -77, W, H, tiles);
        check_joins(set, tiles, W, H, 0);
        const int runs = count_runs(tiles, W, H, 0);
        if (v > 1) assert_int_equal(runs, 0);
        else assert_true(runs > 0); /* or the count would be wrong */
        check_usage(tiles, W * H, kinds, 5);

        /* shifted by any small period, or with another seed, it is another plane */
        for (int k = 1; k < 40; k++) {
            const int dx = k % 2 ? k : k / 2, dy = k % 2 ? 0 : k;
            textiles_plane_fill(&p, -100 + dx, -77 + dy, W, H, other);
            assert_true(differences(tiles, other, W * H) > W * H * 3 / 4);
            textiles_plane_fill(&p, -100, -77 + k, W, H, other);
            assert_true(differences(tiles, other, W * H) > W * H * 3 / 4);
        }
        p.seed += 1;
        textiles_plane_fill(&p, -100, -77, W, H, other);
        assert_true(differences(tiles, other, W * H) > W * H * 3 / 4);
        textiles_free(set);
    }
}

/* The formulas of triangles once more: lattice points as numbers (a, b) modulo 2^32. */
static int formula_triangle(const textiles_set *set, const textiles_plane *p, int a, int b,
                            int half, int *rotation) {
    const int a1 = wrapped(a, 1), b1 = wrapped(b, 1), v = p->variants;
    const int corners[2][3][2] = {{{a, b}, {a, b1}, {a1, b}}, {{a1, b1}, {a1, b}, {a, b1}}};
    const int colors[2][3] = {{txt_below(txt_hash(p->seed, 9, a, b), p->colors),
                               txt_below(txt_hash(p->seed, 10, a, b), p->colors),
                               txt_below(txt_hash(p->seed, 8, a, b), p->colors)},
                              {txt_below(txt_hash(p->seed, 9, a1, b), p->colors),
                               txt_below(txt_hash(p->seed, 10, a, b), p->colors),
                               txt_below(txt_hash(p->seed, 8, a, b1), p->colors)}};
    int edges[4] = {0, 0, 0, 0}, directions[3];
    for (int k = 0; k < 3; k++) {
        const int *from = corners[half][k], *to = corners[half][(k + 1) % 3];
        const uint32_t low = txt_hash(p->seed, 7, from[0], from[1]);
        const uint32_t high = txt_hash(p->seed, 7, to[0], to[1]);
        int up = low < high;
        if (low == high && from[0] != to[0]) up = (uint32_t)from[0] < (uint32_t)to[0];
        else if (low == high) up = (uint32_t)from[1] < (uint32_t)to[1];
        edges[k] = colors[half][k];
        directions[k] = up ? 1 : -1;
    }
    const uint32_t h = txt_hash(p->seed, 11, a, b);
    const int even = 2 * (int)((h >> 16) * (uint32_t)((v + 1) / 2) >> 16);
    const int odd = 2 * (int)((h & 65535) * (uint32_t)(v / 2) >> 16) + 1;
    return textiles_find(set, edges, directions, rotation) + (v == 1 ? 0 : half ? odd : even);
}

typedef struct corner_of {
    int tile, side; /* the side of the tile that lies at side k of the triangle */
} corner_of;

static corner_of side_at(const textiles_plane *p, int a, int b, int half, int k) {
    int r = 7;
    corner_of c;
    c.tile = textiles_plane_triangle(p, a, b, half, &r);
    if (r < 0 || r > 2) fail_msg("rotation %d", r);
    assert_int_equal(textiles_plane_triangle(p, a, b, half, NULL), c.tile);
    c.side = (k + r) % 3;
    return c;
}

static void test_plane_triangles(void **state) {
    (void)state;
    static int tiles[2 * 64 * 64];
    for (int i = 0; i < 24; i++) {
        const int c = 2 + i % 3, v = plane_variants[i / 6], reduced = i / 3 % 2;
        textiles_set *set = make_set(TEXTILES_TRIANGLE, c, v, reduced);
        textiles_plane p;
        txm_rng rng = txm_rng_make(3, (uint64_t)i);
        int beside = 0, count = 0, used[16] = {0};
        assert_int_equal(textiles_plane_make(set, txm_rng_next(&rng), NULL, &p), TXM_OK);
        for (int k = 0; k < 3000; k++) {
            int a = k % 50 - 25, b = k / 50 - 30;
            if (k % 3 == 1) a = wrapped(a, INT_MIN), b = wrapped(b, INT_MIN);
            if (k % 3 == 2) a = any_int(&rng), b = any_int(&rng);
            for (int half = 0; half < 2; half++) {
                int r = 7, wanted = 7;
                const int tile = formula_triangle(set, &p, a, b, half, &wanted);
                assert_int_equal(textiles_plane_triangle(&p, a, b, half, &r), tile);
                assert_int_equal(r, wanted);
            }
            /* half 0 meets half 1 of its own cell, of the one before, and of the one above */
            static const int with[3][3] = {{-1, 0, 0}, {0, 0, 1}, {0, -1, 2}};
            for (int n = 0; n < 3; n++) {
                const corner_of s = side_at(&p, a, b, 0, n);
                const corner_of o =
                    side_at(&p, wrapped(a, with[n][0]), wrapped(b, with[n][1]), 1, with[n][2]);
                const textiles_tile t = tile_at(set, s.tile), u = tile_at(set, o.tile);
                if (t.edges[s.side] != u.edges[o.side] ||
                    t.directions[s.side] != -u.directions[o.side])
                    fail_msg("(%d, %d), side %d does not match", a, b, n);
                beside += s.tile == o.tile;
                used[t.variant]++;
                used[u.variant]++;
            }
        }
        if (v > 1) assert_int_equal(beside, 0);
        else assert_true(beside > 0);
        for (int k = 0; k < v; k++) assert_true(used[k] > 9000 / v); /* of 18000 */

        /* no small period */
        for (int k = 0; k < 64 * 64; k++)
            for (int h = 0; h < 2; h++)
                tiles[2 * k + h] = textiles_plane_triangle(&p, k % 64, k / 64, h, NULL);
        for (int d = 1; d < 24; d++) {
            int same = 0;
            for (int k = 0; k < 64 * 64; k++) {
                const int x = k % 64, y = k / 64;
                count = x + d < 64 && y + d < 64 ? 1 : 0;
                if (count) same += tiles[2 * k] == tiles[2 * (k + d)];
                if (count) same += tiles[2 * k] == tiles[2 * (k + 64 * d)];
                if (count) same += tiles[2 * k + 1] == tiles[2 * (k + 65 * d) + 1];
            }
            assert_true(same < 3 * (64 - d) * (64 - d) / 3);
        }
        textiles_free(set);
    }
}

/* Two neighbours of equal rank: one pair in 2^32, but it can be computed. The points (a+1, b) and
   (a, b+1) have the same rank if (z + G) ^ z = X for z = G b + 7 W, G and W the factors of txt_hash and
   X known from a; bit by bit this says what is carried, and z where it is free. */
static void test_plane_equal_ranks(void **state) {
    (void)state;
    const uint32_t g = 0x9e3779b9u, w = 0x85ebca6bu;
    uint32_t inverse = g; /* of G, modulo 2^32 */
    int found = 0;
    for (int i = 0; i < 5; i++) inverse *= 2 - g * inverse;
    textiles_set *set = make_set(TEXTILES_TRIANGLE, 2, 1, 1);
    textiles_plane p;
    assert_int_equal(textiles_plane_make(set, 12345, NULL, &p), TXM_OK);
    for (int a = 0; a < 4000000 && found < 4; a++) {
        const uint32_t x =
            txt_mix((uint32_t)a + p.seed) ^ txt_mix((uint32_t)a + 1 + p.seed);
        const uint32_t carry = g ^ x, forced = ~(g ^ carry); /* where G and carry agree */
        if (carry & 1 || (forced & (carry >> 1 ^ g)) << 1) continue;
        const int b = (int)(((carry >> 1) - 7 * w) * inverse);
        if (txt_hash(p.seed, 7, wrapped(a, 1), b) != txt_hash(p.seed, 7, a, wrapped(b, 1))) continue;
        found++;
        for (int half = 0; half < 2; half++) {
            int r = 7, wanted = 7;
            const int tile = formula_triangle(set, &p, a, b, half, &wanted);
            assert_int_equal(textiles_plane_triangle(&p, a, b, half, &r), tile);
            assert_int_equal(r, wanted);
        }
        const corner_of s = side_at(&p, a, b, 0, 1), o = side_at(&p, a, b, 1, 1);
        const textiles_tile t = tile_at(set, s.tile), u = tile_at(set, o.tile);
        assert_int_equal(t.edges[s.side], u.edges[o.side]);
        assert_int_equal(t.directions[s.side], -u.directions[o.side]);
    }
    assert_int_equal(found, 4);
    textiles_free(set);
}

static void test_plane_table(void **state) {
    (void)state;
    for (int c = 2; c <= 4; c++) {
        for (int reduced = 0; reduced < 2; reduced++) {
            textiles_set *set = make_set(TEXTILES_TRIANGLE, c, 2, reduced);
            textiles_plane p;
            int count = 0;
            assert_int_equal(textiles_plane_make(set, 1, NULL, &p), TXM_OK);
            const int32_t *table = textiles_plane_table(&p, &count);
            assert_int_equal(count, 8 * c * c * c);
            assert_ptr_equal(textiles_plane_table(&p, NULL), table);
            for (int code = 0; code < count; code++) {
                const int s[3] = {code / (4 * c * c), code / (2 * c) % (2 * c), code % (2 * c)};
                const int e[4] = {s[0] / 2, s[1] / 2, s[2] / 2, 0};
                const int d[3] = {s[0] % 2 ? -1 : 1, s[1] % 2 ? -1 : 1, s[2] % 2 ? -1 : 1};
                int r = 0;
                const int t = textiles_find(set, e, d, &r);
                assert_int_equal(table[code], t < 0 ? -1 : t * 4 + r);
            }
            int tiles[2] = {0, 0}; /* no squares here */
            assert_int_equal(textiles_plane_tile(&p, 0, 0), -1);
            textiles_plane_fill(&p, 0, 0, 2, 1, tiles);
            assert_filled(tiles, 2, -1);
            textiles_free(set);
        }
    }
    textiles_set *set = make_set(TEXTILES_WANG, 2, 1, 0);
    textiles_plane p;
    int count = 9, r = 9;
    assert_int_equal(textiles_plane_make(set, 1, NULL, &p), TXM_OK);
    assert_null(textiles_plane_table(&p, &count));
    assert_int_equal(count, 0);
    assert_int_equal(textiles_plane_triangle(&p, 0, 0, 0, &r), -1);
    assert_int_equal(r, 0);
    textiles_free(set);
}

static void test_plane_refuses(void **state) {
    (void)state;
    textiles_set *sets[3] = {make_set(TEXTILES_WANG, 2, 1, 1), make_set(TEXTILES_FRAME, 3, 1, 0),
                             make_set(TEXTILES_WANG, 2, 1, 0)};
    for (int i = 0; i < 4; i++) {
        txm_env env = {0};
        textiles_plane p, copy;
        memset(&p, FILL & 255, sizeof p);
        copy = p;
        assert_int_equal(textiles_plane_make(i < 3 ? sets[i] : NULL, 0, &env, i == 2 ? NULL : &p),
                         TXM_BAD_ARGUMENT);
        assert_true(env.message[0] != 0);
        assert_memory_equal(&p, &copy, sizeof p);
        assert_int_equal(textiles_plane_make(i < 3 ? sets[i] : NULL, 0, NULL, i == 2 ? NULL : &p),
                         TXM_BAD_ARGUMENT);
    }
    for (int i = 0; i < 3; i++) textiles_free(sets[i]);
}

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
        textiles_free(set);
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
        textiles_free(set);
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
    textiles_free(wang);
    textiles_free(triangle);
    textiles_free(frame);
}

/* ---- tiling under constraints ----------------------------------------------------------- */

enum { SOLVE_CASES = 16 };

static textiles_set *solve_case(int i) {
    static const int cases[SOLVE_CASES][4] = {
        {TEXTILES_WANG, 2, 1, 0},   {TEXTILES_WANG, 2, 3, 0},   {TEXTILES_WANG, 3, 2, 0},
        {TEXTILES_WANG, 4, 1, 0},   {TEXTILES_WANG, 2, 1, 1},   {TEXTILES_WANG, 2, 4, 1},
        {TEXTILES_WANG, 3, 1, 1},   {TEXTILES_WANG, 4, 2, 1},   {TEXTILES_CORNER, 2, 1, 0},
        {TEXTILES_CORNER, 2, 3, 0}, {TEXTILES_CORNER, 3, 1, 0}, {TEXTILES_CORNER, 4, 2, 0},
        {TEXTILES_FRAME, 1, 2, 0},  {TEXTILES_FRAME, 3, 1, 0},  {TEXTILES_FRAME, 2, 3, 0},
        {TEXTILES_FRAME, 2, 2, 0}};
    if (i == SOLVE_CASES - 1) return make_frame(stubborn, 6, 2, 2);
    return make_set((textiles_kind)cases[i][0], cases[i][1], cases[i][2], cases[i][3]);
}

static void solve(const textiles_set *set, int w, int h, int periodic, uint64_t seed, int *tiles) {
    tk_progress progress = {0};
    txm_env env = tk_env(NULL, &progress);
    const txm_status status = textiles_solve(set, w, h, periodic, seed, &env, tiles);
    if (status != TXM_OK) fail_msg("solve %d x %d: %d, %s", w, h, status, env.message);
    assert_int_equal(progress.errors, 0);
}

static void test_solve(void **state) {
    (void)state;
    enum { MOST_CELLS = 40 * 40 };
    static int tiles[MOST_CELLS], wishes[MOST_CELLS], again[MOST_CELLS];
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
            /* some of it as wishes, from one in sixteen to all */
            for (uint32_t keep = 1; keep <= 16; keep *= 2) {
                for (int t = 0; t < n; t++)
                    wishes[t] = txm_rng_below(&rng, 16) < keep ? tiles[t] : -1;
                memcpy(again, wishes, sizeof again);
                solve(set, w, h, periodic, (uint64_t)k + 100, again);
                check_joins(set, again, w, h, periodic);
                for (int t = 0; t < n; t++)
                    if (wishes[t] >= 0) assert_int_equal(again[t], wishes[t]);
            }
        }
        textiles_free(set);
    }
}

/* Is there a tiling? Tries everything, cell by cell from number `at`. */
static int has_tiling(const textiles_set *set, int *tiles, const int *wishes, int at, int w, int h,
                      int periodic) {
    const int x = at % w, y = at / w, v = textiles_variants(set);
    if (at == w * h) return 1;
    for (int t = 0; t < textiles_count(set); t += v) {
        if (wishes[at] >= 0 && t != wishes[at] / v * v) continue;
        tiles[at] = t;
        if (x && !joins(set, tiles[at - 1], t, 0)) continue;
        if (y && !joins(set, tiles[at - w], t, 1)) continue;
        if (periodic && x == w - 1 && !joins(set, t, tiles[at - x], 0)) continue;
        if (periodic && y == h - 1 && !joins(set, t, tiles[x], 1)) continue;
        if (has_tiling(set, tiles, wishes, at + 1, w, h, periodic)) return 1;
    }
    return 0;
}

/* Small grids, wishes at random: solved if and only if there is a tiling. */
static void test_solve_is_exact(void **state) {
    (void)state;
    static const int which[] = {4, 5, 6, 7, 13, SOLVE_CASES - 1};
    int solved = 0, refused = 0;
    for (size_t i = 0; i < sizeof which / sizeof *which; i++) {
        textiles_set *set = solve_case(which[i]);
        txm_rng rng = txm_rng_make(6, (uint64_t)i);
        for (int k = 0; k < 300; k++) {
            const int w = txm_rng_range(&rng, 1, 3), h = txm_rng_range(&rng, 1, 3), periodic = k % 2;
            int wishes[9], tiles[9], scratch[9];
            for (int t = 0; t < w * h; t++) {
                const int wish = (int)txm_rng_below(&rng, (uint32_t)textiles_count(set));
                wishes[t] = txm_rng_below(&rng, 4) ? -1 : wish;
            }
            memcpy(tiles, wishes, sizeof tiles);
            const txm_status status = textiles_solve(set, w, h, periodic, (uint64_t)k, NULL, tiles);
            const int expected = has_tiling(set, scratch, wishes, 0, w, h, periodic);
            if ((status == TXM_OK) != expected) fail_msg("case %d, %d: %d", which[i], k, status);
            if (expected) {
                check_joins(set, tiles, w, h, periodic);
                for (int t = 0; t < w * h; t++)
                    if (wishes[t] >= 0) assert_int_equal(tiles[t], wishes[t]);
                solved++;
            } else {
                assert_memory_equal(tiles, wishes, sizeof(int) * (size_t)(w * h));
                assert_true(status == TXM_BAD_ARGUMENT || status == TXM_BAD_DATA);
                refused++;
            }
        }
        textiles_free(set);
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
        textiles_free(set);
    }
}

static void refuses_solve(const textiles_set *set, int w, int h, int periodic, const int *wishes,
                          txm_status expected, const char *words) {
    int tiles[128];
    tk_memory memory = {0};
    txm_env env = tk_env(&memory, NULL);
    const size_t bytes = sizeof(int) * (size_t)(w > 0 && h > 0 && w * h <= 128 ? w * h : 1);
    memcpy(tiles, wishes, bytes);
    const txm_status status = textiles_solve(set, w, h, periodic, 1, &env, tiles);
    if (status != expected) fail_msg("%s: status %d, %s", words, status, env.message);
    if (!strstr(env.message, words)) fail_msg("'%s' does not say '%s'", env.message, words);
    assert_memory_equal(tiles, wishes, bytes);
    assert_int_equal(tk_leaks(&memory), 0);
    assert_int_equal(textiles_solve(set, w, h, periodic, 1, NULL, tiles), expected);
}

static void test_solve_refuses(void **state) {
    (void)state;
    int wishes[128];
    textiles_set *wang = make_set(TEXTILES_WANG, 2, 1, 0);
    textiles_set *reduced = make_set(TEXTILES_WANG, 3, 1, 1);
    textiles_set *corner = make_set(TEXTILES_CORNER, 2, 2, 0);
    textiles_set *triangle = make_set(TEXTILES_TRIANGLE, 2, 1, 0);
    static const int lonely[1][4] = {{0, 1, 0, 0}}, brick[2][4] = {{0, 0, 1, 0}, {1, 0, 0, 0}};
    textiles_set *frame = make_frame(lonely, 1, 2, 1), *bricks = make_frame(brick, 2, 2, 1);
    txm_env env = {0};

    fill(wishes, 128, -1);
    refuses_solve(NULL, 2, 2, 0, wishes, TXM_BAD_ARGUMENT, "NULL");
    assert_int_equal(textiles_solve(wang, 2, 2, 0, 1, &env, NULL), TXM_BAD_ARGUMENT);
    refuses_solve(triangle, 2, 2, 0, wishes, TXM_BAD_ARGUMENT, "triangle");
    refuses_solve(wang, 0, 2, 0, wishes, TXM_BAD_ARGUMENT, "width");
    refuses_solve(wang, 2, -1, 0, wishes, TXM_BAD_ARGUMENT, "height");
    refuses_solve(wang, 1 << 20, 1 << 10, 0, wishes, TXM_TOO_LARGE, "width");
    wishes[7 * 4 + 3] = 16;
    refuses_solve(wang, 7, 5, 0, wishes, TXM_BAD_ARGUMENT, "column 3, row 4");
    wishes[7 * 4 + 3] = -2;
    refuses_solve(corner, 7, 5, 0, wishes, TXM_BAD_ARGUMENT, "column 3, row 4");

    /* neighbours that do not match; corners that meet at a corner only */
    fill(wishes, 128, -1);
    wishes[10] = 0, wishes[11] = 1; /* east 0, west 1 */
    refuses_solve(wang, 8, 3, 0, wishes, TXM_BAD_ARGUMENT, "column 3, row 1");
    fill(wishes, 128, -1);
    wishes[8 + 2] = 0, wishes[8 * 2 + 3] = 31;
    refuses_solve(corner, 8, 5, 0, wishes, TXM_BAD_ARGUMENT, "column 3, row 2");
    /* across the border, and with itself */
    fill(wishes, 128, -1);
    wishes[0] = 1, wishes[7] = 0;
    refuses_solve(wang, 8, 1, 1, wishes, TXM_BAD_ARGUMENT, "column 7, row 0");
    solve(wang, 8, 1, 0, 1, wishes);
    wishes[0] = 1;
    refuses_solve(wang, 1, 1, 1, wishes, TXM_BAD_ARGUMENT, "column 0, row 0");

    /* wishes that only propagation finds at odds: south goes up by 0 or 1 from row to row */
    fill(wishes, 128, -1);
    int up = -1, down = -1;
    for (int t = 0; t < textiles_count(reduced); t++) {
        const textiles_tile tile = tile_at(reduced, t);
        if (tile.edges[2] == 0) up = t;
        if (tile.edges[0] == 2) down = t;
    }
    wishes[3] = up, wishes[5 * 2 + 3] = down;
    refuses_solve(reduced, 5, 4, 0, wishes, TXM_BAD_ARGUMENT, "contradict");
    wishes[5 * 2 + 3] = -1, wishes[5 * 3 + 3] = down;
    solve(reduced, 5, 4, 0, 1, wishes);
    check_joins(reduced, wishes, 5, 4, 0);

    /* no wishes, but no tiling either; one that exists for even heights only */
    fill(wishes, 128, -1);
    refuses_solve(frame, 2, 1, 0, wishes, TXM_BAD_DATA, "no tiling");
    refuses_solve(bricks, 3, 5, 1, wishes, TXM_BAD_DATA, "tiling");
    solve(bricks, 3, 4, 1, 1, wishes);
    check_joins(bricks, wishes, 3, 4, 1);
    fill(wishes, 128, -1);
    solve(frame, 1, 9, 0, 1, wishes); /* below each other they do */
    refuses_solve(frame, 1, 9, 1, wishes, TXM_BAD_DATA, "no tiling");
    textiles_free(wang);
    textiles_free(reduced);
    textiles_free(corner);
    textiles_free(triangle);
    textiles_free(frame);
    textiles_free(bricks);
}

/* ---- failing memory, cancelling --------------------------------------------------------- */

/* A call with its outputs: number what of a list. */
typedef struct call {
    int what;
    textiles_set *set;
    const uint32_t *indices;
    const int *edges;
    size_t faces, vertices;
    int in[4096], out[2][4096];
} call;

static txm_status run(call *c, txm_env *env) {
    memcpy(c->out[0], c->in, sizeof c->in);
    memcpy(c->out[1], c->in, sizeof c->in);
    switch (c->what) {
    case 0: return textiles_solve(c->set, 40, 50, 1, 3, env, c->out[0]);
    case 1:
        return textiles_assign_triangles(c->set, c->indices, c->faces, c->vertices, 3, env,
                                         c->out[0], c->out[1]);
    default:
        return textiles_assign_quads(c->set, c->indices, c->faces, c->vertices, c->edges, 3, env,
                                     c->out[0]);
    }
}

static void check_untouched(const call *c) {
    assert_memory_equal(c->out[0], c->in, sizeof c->in);
    assert_memory_equal(c->out[1], c->in, sizeof c->in);
}

static void check_misfortune(call *c) {
    static int good[2][4096];
    int refused = 0;
    assert_int_equal(run(c, NULL), TXM_OK);
    memcpy(good, c->out, sizeof good);
    for (int onward = 0; onward < 2; onward++) {
        for (long k = 1;; k++) {
            tk_memory memory = {0};
            tk_progress progress = {0};
            memory.fail_at = k;
            memory.fail_onward = onward;
            txm_env env = tk_env(&memory, &progress);
            const txm_status status = run(c, &env);
            assert_int_equal(tk_leaks(&memory), 0);
            if (memory.calls < k) {
                assert_int_equal(status, TXM_OK);
                assert_memory_equal(c->out, good, sizeof good);
                break;
            }
            assert_int_equal(status, TXM_OUT_OF_MEMORY);
            assert_true(env.message[0] != 0);
            check_untouched(c);
            refused++;
        }
    }
    assert_true(refused >= 2);
    for (long k = 1;; k++) {
        tk_memory memory = {0};
        tk_progress progress = {0};
        progress.cancel_at = k;
        txm_env env = tk_env(&memory, &progress);
        const txm_status status = run(c, &env);
        assert_int_equal(tk_leaks(&memory), 0);
        assert_int_equal(progress.errors, 0);
        assert_int_equal(progress.late, 0);
        if (progress.calls < k) {
            assert_int_equal(status, TXM_OK);
            assert_memory_equal(c->out, good, sizeof good);
            assert_true(k > 2);
            break;
        }
        assert_int_equal(status, TXM_CANCELLED);
        check_untouched(c);
    }
}

static void test_solve_misfortune(void **state) {
    (void)state;
    static call c;
    for (int i = 0; i < SOLVE_CASES; i += 2) {
        c.what = 0;
        c.set = solve_case(i);
        fill(c.in, 4096, -1);
        check_misfortune(&c);
        textiles_free(c.set);
    }
}

/* Cancelled in the middle of a long search. */
static void test_solve_cancel_search(void **state) {
    (void)state;
    static int tiles[200 * 200];
    long points = 0;
    for (int i = 0; i < 8; i += 4) {
        textiles_set *set = solve_case(i);
        for (long k = 1;; k += 1 + k / 2) {
            tk_progress progress = {0};
            progress.cancel_at = k;
            txm_env env = tk_env(NULL, &progress);
            fill(tiles, 200 * 200, -1);
            const txm_status status = textiles_solve(set, 200, 200, 1, 1, &env, tiles);
            assert_int_equal(progress.errors, 0);
            assert_int_equal(progress.late, 0);
            if (progress.calls < k) {
                assert_int_equal(status, TXM_OK);
                break;
            }
            assert_int_equal(status, TXM_CANCELLED);
            assert_filled(tiles, 200 * 200, -1);
            points++;
        }
        textiles_free(set);
    }
    assert_true(points > 8);
}

/* ---- meshes: shapes --------------------------------------------------------------------- */

enum { MOST_FACES = 20000 };

typedef struct mesh {
    uint32_t index[3 * MOST_FACES];
    size_t faces, vertices;
    int manifold; /* at most two faces at an edge, each three different vertices */
} mesh;

static void begin(mesh *m) {
    m->faces = m->vertices = 0;
    m->manifold = 1;
}

static void add_face(mesh *m, size_t a, size_t b, size_t c) {
    const size_t v[3] = {a, b, c};
    for (int k = 0; k < 3; k++) {
        m->index[3 * m->faces + (size_t)k] = (uint32_t)v[k];
        if (v[k] >= m->vertices) m->vertices = v[k] + 1;
    }
    m->faces++;
}

/* Number the vertices anew, at random: directions go by the numbers. */
static void renumber(mesh *m, uint64_t seed) {
    static int numbers[3 * MOST_FACES];
    txm_rng rng = txm_rng_make(seed, 9);
    for (size_t i = 0; i < m->vertices; i++) numbers[i] = (int)i;
    txm_shuffle(&rng, numbers, (int)m->vertices);
    for (size_t i = 0; i < 3 * m->faces; i++) m->index[i] = (uint32_t)numbers[m->index[i]];
}

static void turn_some_faces(mesh *m, uint64_t seed) {
    txm_rng rng = txm_rng_make(seed, 8);
    for (size_t f = 0; f < m->faces; f++) {
        const uint32_t v = m->index[3 * f];
        if (txm_rng_below(&rng, 2)) continue;
        m->index[3 * f] = m->index[3 * f + 1];
        m->index[3 * f + 1] = v;
    }
}

/* split every face into four */
static void subdivide(mesh *m) {
    static mesh old;
    static uint32_t table[1 << 17][3];
    const size_t places = sizeof table / sizeof *table;
    old = *m;
    memset(table, 0xff, sizeof table);
    m->faces = 0;
    for (size_t f = 0; f < old.faces; f++) {
        const uint32_t *v = old.index + 3 * f;
        size_t middle[3];
        for (int k = 0; k < 3; k++) {
            const uint32_t a = v[k], b = v[(k + 1) % 3], low = a < b ? a : b, high = a < b ? b : a;
            size_t at = (size_t)(txm_hash((uint64_t)high << 32 | low) % places);
            while (table[at][2] != UINT32_MAX && (table[at][0] != low || table[at][1] != high))
                at = (at + 1) % places;
            if (table[at][2] == UINT32_MAX) {
                table[at][0] = low;
                table[at][1] = high;
                table[at][2] = (uint32_t)m->vertices++;
            }
            middle[k] = table[at][2];
        }
        add_face(m, v[0], middle[0], middle[2]);
        add_face(m, v[1], middle[1], middle[0]);
        add_face(m, v[2], middle[2], middle[1]);
        add_face(m, middle[0], middle[1], middle[2]);
    }
}

static void make_sphere(mesh *m, int levels) {
    begin(m);
    for (size_t i = 0; i < 5; i++) {
        const size_t j = (i + 1) % 5;
        add_face(m, 0, 1 + i, 1 + j);
        add_face(m, 1 + j, 1 + i, 6 + i);
        add_face(m, 6 + i, 6 + j, 1 + j);
        add_face(m, 11, 6 + j, 6 + i);
    }
    for (int k = 0; k < levels; k++) subdivide(m);
}

/* A grid of w x h cells of two faces. wrap: 0 open, 1 torus, 2 Moebius strip (around x, turned). */
static void make_grid(mesh *m, size_t w, size_t h, int wrap) {
    begin(m);
    const size_t columns = wrap ? w : w + 1;
    for (size_t y = 0; y < h; y++) {
        for (size_t x = 0; x < w; x++) {
            const size_t below = wrap == 1 ? (y + 1) % h : y + 1;
            const size_t x1 = wrap ? (x + 1) % w : x + 1;
            const int turned = wrap == 2 && x1 == 0;
            const size_t a = y * columns + x, b = below * columns + x;
            const size_t c = (turned ? h - y : y) * columns + x1;
            const size_t d = (turned ? h - below : below) * columns + x1;
            add_face(m, a, b, c);
            add_face(m, d, c, b);
        }
    }
}

static void make_tetrahedron(mesh *m) {
    begin(m);
    add_face(m, 0, 1, 2);
    add_face(m, 0, 2, 3);
    add_face(m, 0, 3, 1);
    add_face(m, 3, 2, 1);
}

/* pages bound at one edge, each a strip of faces */
static void make_book(mesh *m, size_t pages, size_t length) {
    begin(m);
    m->manifold = 0;
    for (size_t p = 0; p < pages; p++) {
        size_t a = 0, b = 1;
        for (size_t i = 0; i < length; i++) {
            const size_t c = 2 + p * length + i;
            if (i % 2) add_face(m, b, a, c);
            else add_face(m, a, b, c);
            a = b;
            b = c;
        }
    }
}

/* faces of any vertices, also twice the same in one face */
static void make_soup(mesh *m, size_t faces, uint32_t vertices, uint64_t seed) {
    txm_rng rng = txm_rng_make(seed, 7);
    begin(m);
    m->manifold = 0;
    for (size_t f = 0; f < faces; f++) {
        const uint32_t a = txm_rng_below(&rng, vertices), b = txm_rng_below(&rng, vertices);
        add_face(m, a, b, txm_rng_below(&rng, vertices));
    }
    m->vertices = vertices;
}

/* ---- meshes: what is asked of a cover --------------------------------------------------- */

typedef struct side_of {
    uint32_t low, high, face;
    int color, rising; /* does the edge run from the lower to the higher vertex? */
} side_of;

static int compare_sides(const void *a, const void *b) {
    const side_of *s = (const side_of *)a, *t = (const side_of *)b;
    if (s->low != t->low) return s->low < t->low ? -1 : 1;
    if (s->high != t->high) return s->high < t->high ? -1 : 1;
    return s->face < t->face ? -1 : s->face > t->face;
}

/* Colours and directions match at every edge. Returns how many pairs of faces at an edge show the
   same tile. */
static int check_cover(const textiles_set *set, const mesh *m, const int *tiles,
                       const int *rotations) {
    static side_of sides[3 * MOST_FACES];
    int beside = 0;
    for (size_t i = 0; i < 3 * m->faces; i++) {
        const size_t f = i / 3, k = i % 3;
        const uint32_t a = m->index[i], b = m->index[3 * f + (k + 1) % 3];
        if (rotations[f] < 0 || rotations[f] > 2) fail_msg("face %d: rotation", (int)f);
        const textiles_tile t = tile_at(set, tiles[f]);
        const size_t side = (k + (size_t)rotations[f]) % 3;
        sides[i].low = a < b ? a : b;
        sides[i].high = a < b ? b : a;
        sides[i].face = (uint32_t)f;
        sides[i].color = t.edges[side];
        sides[i].rising = (a < b) == (t.directions[side] > 0);
    }
    qsort(sides, 3 * m->faces, sizeof *sides, compare_sides);
    for (size_t i = 0; i < 3 * m->faces; i++) {
        const side_of *s = &sides[i];
        if (s->low != s->high && !s->rising) fail_msg("face %d: direction", (int)s->face);
        for (size_t j = i + 1; j < 3 * m->faces && j < i + 8; j++) {
            const side_of *t = &sides[j];
            if (s->low != t->low || s->high != t->high) break;
            if (s->color != t->color)
                fail_msg("faces %d and %d: colours", (int)s->face, (int)t->face);
            beside += s->face != t->face && tiles[s->face] == tiles[t->face];
        }
    }
    return beside;
}

static int cover(const textiles_set *set, const mesh *m, uint64_t seed) {
    static int tiles[MOST_FACES + 1], rotations[MOST_FACES + 1];
    tk_memory memory = {0};
    tk_progress progress = {0};
    txm_env env = tk_env(&memory, &progress);
    tiles[m->faces] = rotations[m->faces] = FILL;
    const txm_status status = textiles_assign_triangles(set, m->index, m->faces, m->vertices, seed,
                                                        &env, tiles, rotations);
    if (status != TXM_OK) fail_msg("assign: %d, %s", status, env.message);
    assert_int_equal(tiles[m->faces], FILL);
    assert_int_equal(rotations[m->faces], FILL);
    assert_int_equal(progress.errors, 0);
    assert_int_equal(tk_leaks(&memory), 0);
    if (m->faces > 100) assert_true(memory.peak_bytes < 40 * m->faces + 1000);
    return check_cover(set, m, tiles, rotations);
}

enum { SHAPES = 16 };

static void make_shape(mesh *m, int shape) {
    switch (shape) {
    case 0: make_tetrahedron(m); break;
    case 1: make_sphere(m, 0); break;
    case 2: make_sphere(m, 3); break;
    case 3: make_grid(m, 1, 1, 0); break;
    case 4: make_grid(m, 30, 21, 0); break;
    case 5: make_grid(m, 3, 3, 1); break;
    case 6: make_grid(m, 31, 16, 1); break;
    case 7: make_grid(m, 30, 5, 2); break;
    case 8: make_sphere(m, 2); break;
    case 9: make_grid(m, 17, 18, 1); break;
    case 10: make_book(m, 3, 20); break;
    case 11: make_book(m, 16, 9); break;
    case 12: make_book(m, 500, 4); break;
    case 13: make_soup(m, 600, 2000, 1); break;
    case 14: make_soup(m, 500, 40, 2); break;
    default: make_soup(m, 300, 5, 3); break;
    }
    renumber(m, (uint64_t)shape);
    if (shape == 8 || shape == 9) turn_some_faces(m, 1); /* unequal winding */
}

/* Any connectivity; on manifolds no tile beside itself, with four variants for sure. */
static void test_meshes(void **state) {
    (void)state;
    static mesh m;
    for (int c = 2; c <= 3; c++) {
        for (int v = 1; v <= 4; v++) {
            for (int reduced = 0; reduced < 2; reduced++) {
                textiles_set *set = make_set(TEXTILES_TRIANGLE, c, v, reduced);
                int faces = 0, beside = 0;
                for (int shape = 0; shape < SHAPES; shape++) {
                    make_shape(&m, shape);
                    const int b = cover(set, &m, (uint64_t)(c + 10 * v));
                    if (m.manifold && v >= 2 && b)
                        fail_msg("shape %d, %d variants: %d tiles beside themselves", shape, v, b);
                    if (m.manifold) {
                        beside += b;
                        faces += (int)m.faces;
                    }
                }
                assert_true(beside * 200 <= faces); /* with one variant colours do it, mostly */
                textiles_free(set);
            }
        }
    }
}

static void test_mesh_is_deterministic(void **state) {
    (void)state;
    static mesh m;
    static int tiles[3][MOST_FACES], rotations[3][MOST_FACES];
    textiles_set *set = make_set(TEXTILES_TRIANGLE, 2, 2, 1);
    make_sphere(&m, 3);
    for (int i = 0; i < 3; i++)
        assert_int_equal(textiles_assign_triangles(set, m.index, m.faces, m.vertices,
                                                   i == 2 ? 5 : 4, NULL, tiles[i], rotations[i]),
                         TXM_OK);
    assert_memory_equal(tiles[0], tiles[1], m.faces * sizeof(int));
    assert_memory_equal(rotations[0], rotations[1], m.faces * sizeof(int));
    assert_true(differences(tiles[0], tiles[2], (int)m.faces) > (int)m.faces / 2);
    check_usage(tiles[0], (int)m.faces, textiles_count(set), 7);
    textiles_free(set);
}

/* Vertex numbers up to 2^32 - 2 need no memory of their own. */
static void test_mesh_sparse_numbers(void **state) {
    (void)state;
    static mesh m;
    textiles_set *set = make_set(TEXTILES_TRIANGLE, 2, 4, 1);
    make_grid(&m, 20, 20, 0);
    for (size_t i = 0; i < 3 * m.faces; i++) m.index[i] = UINT32_MAX - 1 - m.index[i] * 3000000u;
    m.vertices = UINT32_MAX;
    assert_int_equal(cover(set, &m, 1), 0);
    textiles_free(set);
}

static void refuses_mesh(const textiles_set *set, const uint32_t *indices, size_t faces,
                         size_t vertices, txm_status expected, const char *words) {
    int tiles[4], rotations[4];
    tk_memory memory = {0};
    txm_env env = tk_env(&memory, NULL);
    fill(tiles, 4, FILL);
    fill(rotations, 4, FILL);
    const txm_status status =
        textiles_assign_triangles(set, indices, faces, vertices, 1, &env, tiles, rotations);
    if (status != expected) fail_msg("%s: status %d, %s", words, status, env.message);
    if (!strstr(env.message, words)) fail_msg("'%s' does not say '%s'", env.message, words);
    assert_filled(tiles, 4, FILL);
    assert_filled(rotations, 4, FILL);
    assert_int_equal(tk_leaks(&memory), 0);
    assert_int_equal(
        textiles_assign_triangles(set, indices, faces, vertices, 1, NULL, tiles, rotations),
        expected);
}

static void test_mesh_refuses(void **state) {
    (void)state;
    const uint32_t indices[] = {0, 1, 2, 2, 1, 3};
    int tiles[2], rotations[2];
    textiles_set *wang = make_set(TEXTILES_WANG, 2, 1, 0);
    textiles_set *set = make_set(TEXTILES_TRIANGLE, 2, 1, 0);
    refuses_mesh(NULL, indices, 2, 4, TXM_BAD_ARGUMENT, "NULL");
    refuses_mesh(wang, indices, 2, 4, TXM_BAD_ARGUMENT, "triangle");
    refuses_mesh(set, NULL, 2, 4, TXM_BAD_ARGUMENT, "NULL");
    refuses_mesh(set, indices, 2, 3, TXM_BAD_ARGUMENT, "face 1 names vertex 3");
    refuses_mesh(set, indices, 2, 0, TXM_BAD_ARGUMENT, "face 0");
    refuses_mesh(set, indices, (size_t)1 << 31, 4, TXM_TOO_LARGE, "faces");
    refuses_mesh(set, indices, SIZE_MAX, 4, TXM_TOO_LARGE, "faces");
    assert_int_equal(textiles_assign_triangles(set, indices, 2, 4, 1, NULL, NULL, rotations),
                     TXM_BAD_ARGUMENT);
    assert_int_equal(textiles_assign_triangles(set, indices, 2, 4, 1, NULL, tiles, NULL),
                     TXM_BAD_ARGUMENT);
    assert_int_equal(textiles_assign_triangles(set, NULL, 0, 0, 1, NULL, NULL, NULL), TXM_OK);
    textiles_free(wang);
    textiles_free(set);
}

static void test_mesh_misfortune(void **state) {
    (void)state;
    static mesh m;
    static call c;
    make_sphere(&m, 3);
    c.what = 1;
    c.set = make_set(TEXTILES_TRIANGLE, 2, 1, 0); /* one variant: colours are changed */
    c.indices = m.index;
    c.faces = m.faces;
    c.vertices = m.vertices;
    fill(c.in, 4096, FILL);
    check_misfortune(&c);
    textiles_free(c.set);
}

/* ---- meshes of quads -------------------------------------------------------------------- */

/* w x h quads, rows downwards; corners nw, sw, se, ne. torus: closed in both directions. */
static void make_quads(uint32_t *index, size_t w, size_t h, int torus) {
    const size_t columns = torus ? w : w + 1;
    for (size_t y = 0; y < h; y++) {
        for (size_t x = 0; x < w; x++) {
            const size_t right = torus ? (x + 1) % w : x + 1, below = torus ? (y + 1) % h : y + 1;
            *index++ = (uint32_t)(y * columns + x);
            *index++ = (uint32_t)(below * columns + x);
            *index++ = (uint32_t)(below * columns + right);
            *index++ = (uint32_t)(y * columns + right);
        }
    }
}

static size_t quad_vertices(size_t w, size_t h, int torus) {
    return torus ? w * h : (w + 1) * (h + 1);
}

static int count_beside(const int *tiles, int w, int h, int torus) {
    int beside = 0;
    for (int y = 0; y < h; y++) {
        for (int x = 0; x < w; x++) {
            const int t = tiles[y * w + x];
            if (w > 1 && (torus || x + 1 < w)) beside += t == tiles[y * w + (x + 1) % w];
            if (h > 1 && (torus || y + 1 < h)) beside += t == tiles[(y + 1) % h * w + x];
        }
    }
    return beside;
}

static void test_quads(void **state) {
    (void)state;
    static uint32_t index[4 * 900];
    static int tiles[901];
    static const int sizes[][2] = {{1, 1}, {2, 1}, {1, 7}, {2, 2}, {3, 3}, {12, 9}, {30, 30}};
    for (int i = 0; i < 9; i++) {
        const int c = 2 + i % 3, v = 1 + 2 * (i / 3);
        textiles_set *set = make_set(TEXTILES_WANG, c, v, 0);
        for (int k = 0; k < 14; k++) {
            const int w = sizes[k / 2][0], h = sizes[k / 2][1], torus = k % 2;
            const size_t n = (size_t)(w * h), vertices = quad_vertices((size_t)w, (size_t)h, torus);
            txm_env env = {0};
            if (torus && (w == 2 || h == 2)) continue; /* both edges between the same vertices */
            make_quads(index, (size_t)w, (size_t)h, torus);
            tiles[n] = FILL;
            const txm_status status =
                textiles_assign_quads(set, index, n, vertices, NULL, 6, &env, tiles);
            if (status != TXM_OK) fail_msg("quads: %d, %s", status, env.message);
            assert_int_equal(tiles[n], FILL);
            check_joins(set, tiles, w, h, torus);
            if (w > 2 && h > 2) assert_int_equal(count_beside(tiles, w, h, torus), 0);
            if (n == 900 && v == 1 && c == 2) check_usage(tiles, 900, 16, 7);
        }
        textiles_free(set);
    }
}

/* With colours given the tiles are those of these colours, in variants that do not lie beside
   themselves. */
static void test_quads_with_edges(void **state) {
    (void)state;
    enum { W = 13, H = 11 };
    static uint32_t index[4 * W * H];
    int tiles[W * H], wanted[W * H], edges[4 * W * H];
    for (int i = 0; i < SOLVE_CASES; i++) {
        textiles_set *set = solve_case(i);
        const int v = textiles_variants(set);
        for (int torus = 0; torus < 2; torus++) {
            txm_env env = {0};
            make_quads(index, W, H, torus);
            fill(wanted, W * H, -1);
            solve(set, W, H, torus, 3, wanted);
            for (int t = 0; t < W * H; t++) {
                const textiles_tile tile = tile_at(set, wanted[t]);
                memcpy(edges + 4 * t, tile.edges, sizeof tile.edges);
            }
            const txm_status status = textiles_assign_quads(
                set, index, W * H, quad_vertices(W, H, torus), edges, 3, &env, tiles);
            if (textiles_kind_of(set) == TEXTILES_CORNER) {
                assert_int_equal(status, TXM_BAD_ARGUMENT);
                continue;
            }
            if (status != TXM_OK) fail_msg("quads: %d, %s", status, env.message);
            for (int t = 0; t < W * H; t++) assert_int_equal(tiles[t] / v, wanted[t] / v);
            if (v > 2 && textiles_colors(set) > 1 && textiles_kind_of(set) == TEXTILES_WANG)
                assert_int_equal(count_beside(tiles, W, H, torus), 0);
        }
        textiles_free(set);
    }
    textiles_set *five = make_set(TEXTILES_FRAME, 1, 5, 0); /* one class, five variants: enough */
    make_quads(index, W, H, 1);
    memset(edges, 0, sizeof edges);
    assert_int_equal(textiles_assign_quads(five, index, W * H, W * H, edges, 3, NULL, tiles), TXM_OK);
    assert_int_equal(count_beside(tiles, W, H, 1), 0);
    textiles_free(five);
}

static void refuses_quads(const textiles_set *set, const uint32_t *indices, size_t faces,
                          size_t vertices, const int *edges, txm_status expected,
                          const char *words) {
    int tiles[4];
    tk_memory memory = {0};
    txm_env env = tk_env(&memory, NULL);
    fill(tiles, 4, FILL);
    const txm_status status =
        textiles_assign_quads(set, indices, faces, vertices, edges, 1, &env, tiles);
    if (status != expected) fail_msg("%s: status %d, %s", words, status, env.message);
    if (!strstr(env.message, words)) fail_msg("'%s' does not say '%s'", env.message, words);
    assert_filled(tiles, 4, FILL);
    assert_int_equal(tk_leaks(&memory), 0);
    assert_int_equal(textiles_assign_quads(set, indices, faces, vertices, edges, 1, NULL, tiles),
                     expected);
}

static void test_quads_refuse(void **state) {
    (void)state;
    textiles_set *wang = make_set(TEXTILES_WANG, 2, 1, 0);
    textiles_set *reduced = make_set(TEXTILES_WANG, 2, 1, 1);
    textiles_set *corner = make_set(TEXTILES_CORNER, 2, 1, 0);
    textiles_set *frame = make_set(TEXTILES_FRAME, 2, 1, 0);
    const txm_status bad = TXM_BAD_ARGUMENT;
    uint32_t index[16];
    int edges[16], tiles[4];
    make_quads(index, 2, 2, 0);
    memset(edges, 0, sizeof edges);
    refuses_quads(NULL, index, 4, 9, NULL, bad, "NULL");
    refuses_quads(wang, NULL, 4, 9, NULL, bad, "NULL");
    refuses_quads(corner, index, 4, 9, NULL, bad, "wang");
    refuses_quads(reduced, index, 4, 9, NULL, bad, "complete");
    refuses_quads(frame, index, 4, 9, NULL, bad, "complete");
    refuses_quads(wang, index, 4, 8, NULL, bad, "face 3 names vertex 8");
    refuses_quads(wang, index, SIZE_MAX, 9, NULL, TXM_TOO_LARGE, "faces");
    refuses_quads(wang, index, (size_t)1 << 30, 9, NULL, TXM_TOO_LARGE, "faces");
    assert_int_equal(textiles_assign_quads(wang, index, 4, 9, NULL, 1, NULL, NULL), bad);
    assert_int_equal(textiles_assign_quads(wang, NULL, 0, 0, NULL, 1, NULL, NULL), TXM_OK);
    assert_int_equal(textiles_assign_quads(wang, index, 4, 9, edges, 1, NULL, tiles), TXM_OK);

    /* colours: beyond the set's, unequal at an edge, of no tile */
    edges[4 * 2 + 1] = 2;
    refuses_quads(wang, index, 4, 9, edges, bad, "face 2");
    edges[4 * 2 + 1] = -1;
    refuses_quads(wang, index, 4, 9, edges, bad, "face 2");
    edges[4 * 2 + 1] = 1; /* its east, where face 3 has west 0 */
    refuses_quads(wang, index, 4, 9, edges, bad, "faces 2 and 3");
    edges[4 * 2 + 1] = 0, edges[4 * 1 + 2] = 1; /* south of face 1, above face 3 */
    refuses_quads(wang, index, 4, 9, edges, bad, "faces 1 and 3");
    edges[4 * 1 + 2] = 0, edges[4 * 3 + 2] = 1;
    refuses_quads(frame, index, 4, 9, edges, bad, "colors of face 3");
    edges[4 * 3 + 2] = 0;

    /* sides: a face turned by a quarter, by a half, wound the other way, a third face at an edge */
    uint32_t other[16];
    for (int turn = 1; turn < 4; turn++) {
        memcpy(other, index, sizeof other);
        for (int k = 0; k < 4; k++) other[4 + k] = index[4 + (k + turn) % 4];
        refuses_quads(wang, other, 2, 9, NULL, bad, "faces 0 and 1");
    }
    memcpy(other, index, sizeof other); /* its west side runs down twice */
    for (int k = 0; k < 4; k++) other[4 + k] = index[4 + (5 - k) % 4];
    refuses_quads(wang, other, 2, 9, NULL, bad, "faces 0 and 1");
    memcpy(other, index, sizeof other);
    other[8] = index[4], other[9] = index[5], other[10] = 7, other[11] = 8; /* one more to the east */
    refuses_quads(wang, other, 3, 9, NULL, bad, "and 2");

    /* quads without a north edge around a pole are fine */
    const uint32_t pole[] = {0, 1, 2, 0, 0, 2, 3, 0, 0, 3, 1, 0};
    assert_int_equal(textiles_assign_quads(wang, pole, 3, 4, NULL, 1, NULL, tiles), TXM_OK);
    for (int k = 0; k < 3; k++) assert_true(joins(wang, tiles[k], tiles[(k + 1) % 3], 0));
    textiles_free(wang);
    textiles_free(reduced);
    textiles_free(corner);
    textiles_free(frame);
}

static void test_quads_misfortune(void **state) {
    (void)state;
    static uint32_t index[4 * 400];
    static int edges[4 * 400];
    static call c;
    make_quads(index, 20, 20, 1);
    c.what = 2;
    c.indices = index;
    c.faces = c.vertices = 400;
    fill(c.in, 4096, FILL);
    c.set = make_set(TEXTILES_WANG, 2, 1, 0);
    check_misfortune(&c);
    c.edges = edges;
    check_misfortune(&c);
    textiles_free(c.set);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sets_squares),
        cmocka_unit_test(test_sets_reduced_wang),
        cmocka_unit_test(test_sets_triangles),
        cmocka_unit_test(test_plane_formula),
        cmocka_unit_test(test_plane_windows),
        cmocka_unit_test(test_plane_statistics),
        cmocka_unit_test(test_plane_triangles),
        cmocka_unit_test(test_plane_equal_ranks),
        cmocka_unit_test(test_plane_table),
        cmocka_unit_test(test_plane_refuses),
        cmocka_unit_test(test_scanline),
        cmocka_unit_test(test_scanline_runs),
        cmocka_unit_test(test_scanline_refuses),
        cmocka_unit_test(test_solve),
        cmocka_unit_test(test_solve_is_exact),
        cmocka_unit_test(test_solve_runs),
        cmocka_unit_test(test_solve_refuses),
        cmocka_unit_test(test_solve_misfortune),
        cmocka_unit_test(test_solve_cancel_search),
        cmocka_unit_test(test_meshes),
        cmocka_unit_test(test_mesh_is_deterministic),
        cmocka_unit_test(test_mesh_sparse_numbers),
        cmocka_unit_test(test_mesh_refuses),
        cmocka_unit_test(test_mesh_misfortune),
        cmocka_unit_test(test_quads),
        cmocka_unit_test(test_quads_with_edges),
        cmocka_unit_test(test_quads_refuse),
        cmocka_unit_test(test_quads_misfortune),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
