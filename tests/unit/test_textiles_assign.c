/* test_textiles_assign.c - meshes of triangles and of quads covered with tiles
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_textiles_assign && build/tests/unit/test_textiles_assign */
#include "textiles.h"

#include "gridkit.h"

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
                textiles_set_free(set);
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
    textiles_set_free(set);
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
    textiles_set_free(set);
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
    textiles_set_free(wang);
    textiles_set_free(set);
}

static void test_mesh_faults(void **state) {
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
    check_faults(&c);
    textiles_set_free(c.set);
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
        textiles_set_free(set);
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
        textiles_set_free(set);
    }
    textiles_set *five = make_set(TEXTILES_FRAME, 1, 5, 0); /* one class, five variants: enough */
    make_quads(index, W, H, 1);
    memset(edges, 0, sizeof edges);
    assert_int_equal(textiles_assign_quads(five, index, W * H, W * H, edges, 3, NULL, tiles), TXM_OK);
    assert_int_equal(count_beside(tiles, W, H, 1), 0);
    textiles_set_free(five);
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
    textiles_set_free(wang);
    textiles_set_free(reduced);
    textiles_set_free(corner);
    textiles_set_free(frame);
}

static void test_quads_faults(void **state) {
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
    check_faults(&c);
    c.edges = edges;
    check_faults(&c);
    textiles_set_free(c.set);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_meshes),
        cmocka_unit_test(test_mesh_is_deterministic),
        cmocka_unit_test(test_mesh_sparse_numbers),
        cmocka_unit_test(test_mesh_refuses),
        cmocka_unit_test(test_mesh_faults),
        cmocka_unit_test(test_quads),
        cmocka_unit_test(test_quads_with_edges),
        cmocka_unit_test(test_quads_refuse),
        cmocka_unit_test(test_quads_faults),
    };
    return cmocka_run_group_tests_name("textiles_assign", tests, NULL, NULL);
}
