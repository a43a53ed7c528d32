/* test_textiles_plane.c - the infinite plane, and the codes of the sets that cover it
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_textiles_plane && build/tests/unit/test_textiles_plane */
#include "textiles.h"

#include "gridkit.h"

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
                textiles_set_free(set);
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
            textiles_set_free(set);
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
            textiles_set_free(set);
        }
    }
}

/* ---- the plane -------------------------------------------------------------------------- */

/* The formulas as shaders/textiles.glsl has them, written down once more. */
static uint32_t mix(uint32_t h) {
    h = (h ^ h >> 16) * 0x7feb352du;
    h = (h ^ h >> 15) * 0x846ca68bu;
    return h ^ h >> 16;
}
static uint32_t hash(uint32_t seed, uint32_t what, int x, int y) {
    return mix(mix((uint32_t)x + seed) ^ ((uint32_t)y * 0x9e3779b9u + what * 0x85ebca6bu));
}
static int below(uint32_t h, int n) {
    return (int)((h >> 8) * (uint32_t)n >> 24);
}

static int formula_tile(const textiles_plane *p, int x, int y) {
    const int x1 = wrapped(x, 1), y1 = wrapped(y, 1), c = p->colors, v = p->variants;
    const uint32_t s = p->seed;
    int e[4], code = 0, variant = 0;
    if (p->kind == TEXTILES_WANG) {
        e[0] = below(hash(s, 0, x, y), c);
        e[1] = below(hash(s, 1, x1, y), c);
        e[2] = below(hash(s, 0, x, y1), c);
        e[3] = below(hash(s, 1, x, y), c);
    } else {
        e[0] = below(hash(s, 2, x, y), c);
        e[1] = below(hash(s, 2, x1, y), c);
        e[2] = below(hash(s, 2, x1, y1), c);
        e[3] = below(hash(s, 2, x, y1), c);
    }
    for (int k = 0; k < 4; k++) code = code * c + e[k];
    if (v > 1) {
        const int bx = (int)((uint32_t)x >> 1), by = (int)((uint32_t)y >> 1);
        const uint32_t h = hash(s, 3, bx, by), g = hash(s, 4, bx, by);
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
            textiles_set_free(set);
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
        textiles_set_free(set);
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
        textiles_set_free(set);
    }
}

/* The formulas of triangles once more: lattice points as numbers (a, b) modulo 2^32. */
static int formula_triangle(const textiles_set *set, const textiles_plane *p, int a, int b,
                            int half, int *rotation) {
    const int a1 = wrapped(a, 1), b1 = wrapped(b, 1), v = p->variants;
    const int corners[2][3][2] = {{{a, b}, {a, b1}, {a1, b}}, {{a1, b1}, {a1, b}, {a, b1}}};
    const int colors[2][3] = {{below(hash(p->seed, 9, a, b), p->colors),
                               below(hash(p->seed, 10, a, b), p->colors),
                               below(hash(p->seed, 8, a, b), p->colors)},
                              {below(hash(p->seed, 9, a1, b), p->colors),
                               below(hash(p->seed, 10, a, b), p->colors),
                               below(hash(p->seed, 8, a, b1), p->colors)}};
    int edges[4] = {0, 0, 0, 0}, directions[3];
    for (int k = 0; k < 3; k++) {
        const int *from = corners[half][k], *to = corners[half][(k + 1) % 3];
        const uint32_t low = hash(p->seed, 7, from[0], from[1]);
        const uint32_t high = hash(p->seed, 7, to[0], to[1]);
        int up = low < high;
        if (low == high && from[0] != to[0]) up = (uint32_t)from[0] < (uint32_t)to[0];
        else if (low == high) up = (uint32_t)from[1] < (uint32_t)to[1];
        edges[k] = colors[half][k];
        directions[k] = up ? 1 : -1;
    }
    const uint32_t h = hash(p->seed, 11, a, b);
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
        textiles_set_free(set);
    }
}

/* Two neighbours of equal rank: one pair in 2^32, but it can be computed. The points (a+1, b) and
   (a, b+1) have the same rank if (z + G) ^ z = X for z = G b + 7 W, G and W the factors of hash and
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
            mix((uint32_t)a + p.seed) ^ mix((uint32_t)a + 1 + p.seed);
        const uint32_t carry = g ^ x, forced = ~(g ^ carry); /* where G and carry agree */
        if (carry & 1 || (forced & (carry >> 1 ^ g)) << 1) continue;
        const int b = (int)(((carry >> 1) - 7 * w) * inverse);
        if (hash(p.seed, 7, wrapped(a, 1), b) != hash(p.seed, 7, a, wrapped(b, 1))) continue;
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
    textiles_set_free(set);
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
            textiles_set_free(set);
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
    textiles_set_free(set);
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
    for (int i = 0; i < 3; i++) textiles_set_free(sets[i]);
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
    };
    return cmocka_run_group_tests_name("textiles_plane", tests, NULL, NULL);
}
