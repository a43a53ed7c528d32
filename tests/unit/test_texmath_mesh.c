/* test_texmath_mesh.c - mesh views, their check, and which sides share an edge
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texmath_mesh && build/tests/unit/test_texmath_mesh */
#include "mathkit.h"

/* ---- the check --------------------------------------------------------------------------- */

static void assert_refused(const txm_mesh *mesh, int corners, int positions, size_t most,
                           txm_status status, const char *message) {
    txm_env env;
    memset(&env, 0, sizeof env);
    assert_int_equal(txm_mesh_check(mesh, "grid", corners, positions, most, &env), status);
    assert_string_equal(env.message, message);
    assert_int_equal(txm_mesh_check(mesh, "grid", corners, positions, most, NULL), status);
}

static void test_check(void **state) {
    (void)state;
    static const uint32_t indices[12] = {0, 1, 2, 2, 1, 3, 3, 3, 3, 0, 2, 4};
    static const float positions[15] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 5, 5, 5};
    float broken[15];
    uint32_t far[12];
    txm_mesh empty, good;
    memset(&empty, 0, sizeof empty);
    memset(&good, 0, sizeof good);
    good.positions = positions;
    good.indices = indices;
    good.vertex_count = 5;
    good.face_count = 4;
    assert_int_equal(txm_mesh_check(&empty, "grid", 0, 1, 0, NULL), TXM_OK);
    assert_int_equal(txm_mesh_check(&good, "grid", 3, 1, 5, NULL), TXM_OK);
    assert_int_equal(txm_mesh_sides(&good), 12);
    txm_mesh m = good;
    m.corners = 4;
    m.face_count = 3;
    assert_int_equal(txm_mesh_check(&m, "grid", 0, 1, 0, NULL), TXM_OK);
    assert_int_equal(txm_mesh_check(&m, "grid", 4, 1, 0, NULL), TXM_OK);
    assert_int_equal(txm_mesh_sides(&m), 12);
    m.positions = NULL;
    assert_int_equal(txm_mesh_check(&m, "grid", 4, 0, 0, NULL), TXM_OK);

    assert_refused(NULL, 0, 0, 0, TXM_BAD_ARGUMENT, "grid: is NULL; pass a txm_mesh");
    assert_refused(&m, 3, 0, 0, TXM_BAD_ARGUMENT, "grid: faces must be triangles");
    assert_refused(&good, 4, 0, 0, TXM_BAD_ARGUMENT, "grid: faces must be quads");
    assert_refused(&m, 4, 1, 0, TXM_BAD_ARGUMENT, "grid: positions is NULL");
    m.corners = 5;
    assert_refused(&m, 0, 0, 0, TXM_BAD_ARGUMENT, "grid: corners must be 3 or 4 (0 means 3)");
    m.corners = -3;
    assert_refused(&m, 0, 0, 0, TXM_BAD_ARGUMENT, "grid: corners must be 3 or 4 (0 means 3)");
    m = good;
    m.indices = NULL;
    assert_refused(&m, 0, 0, 0, TXM_BAD_ARGUMENT, "grid: indices is NULL");
    assert_refused(&good, 0, 0, 4, TXM_TOO_LARGE, "grid: more than 4 vertices or faces");
    m = good;
    m.vertex_count = 4; /* corner 11 names vertex 4 */
    assert_refused(&m, 0, 0, 0, TXM_BAD_ARGUMENT,
                   "grid: face 3 names vertex 4, which is not below vertex_count");
    memcpy(far, indices, sizeof far);
    far[4] = UINT32_MAX;
    m = good;
    m.indices = far;
    assert_refused(&m, 0, 0, 0, TXM_BAD_ARGUMENT,
                   "grid: face 1 names vertex 4294967295, which is not below vertex_count");
    static const float wrong[3] = {INFINITY, -INFINITY, NAN};
    for (size_t k = 0; k < 3; k++) {
        memcpy(broken, positions, sizeof broken);
        broken[9 + k] = wrong[k];
        m = good;
        m.positions = broken;
        assert_refused(&m, 0, 1, 0, TXM_BAD_ARGUMENT,
                       "grid: the position of vertex 3 is not finite");
        assert_int_equal(txm_mesh_check(&m, "grid", 0, 0, 0, NULL), TXM_OK);
    }
    /* counts beyond what sides can be numbered with are refused before an array is looked at */
    m = empty;
    m.vertex_count = 1;
    m.face_count = (size_t)UINT32_MAX / 3;
    const char *huge = "grid: more faces or vertices than 32 bits can number the sides of";
    assert_refused(&m, 0, 0, 0, TXM_TOO_LARGE, huge);
    m.face_count = SIZE_MAX;
    assert_refused(&m, 0, 0, 0, TXM_TOO_LARGE, huge);
    m.face_count = SIZE_MAX / 3 + 1;
    assert_refused(&m, 0, 0, 0, TXM_TOO_LARGE, huge);
    m.face_count = 0;
    m.vertex_count = SIZE_MAX / 2;
    assert_refused(&m, 0, 1, 0, TXM_TOO_LARGE, huge);
    m.corners = 4;
    m.vertex_count = 1;
    m.face_count = (size_t)UINT32_MAX / 4 + 1;
    assert_refused(&m, 0, 0, 0, TXM_TOO_LARGE, huge);
    m.face_count = (size_t)UINT32_MAX / 4;
    if (sizeof(size_t) > 4) assert_refused(&m, 0, 0, 0, TXM_BAD_ARGUMENT, "grid: indices is NULL");
}

static void test_corners(void **state) {
    (void)state;
    static const uint32_t indices[12] = {4, 2, 9, 1, 1, 0, 3, 8, 8, 5, 7, 6};
    static const size_t next[2][12] = {{1, 2, 0, 4, 5, 3, 7, 8, 6, 10, 11, 9},
                                       {1, 2, 3, 0, 5, 6, 7, 4, 9, 10, 11, 8}};
    float positions[30];
    for (int i = 0; i < 30; i++) positions[i] = (float)i / 8;
    for (int quads = 0; quads < 2; quads++) {
        txm_mesh m;
        memset(&m, 0, sizeof m);
        m.positions = positions;
        m.indices = indices;
        m.vertex_count = 10;
        m.face_count = quads ? 3 : 4;
        m.corners = quads ? 4 : 0;
        for (size_t i = 0; i < 12; i++) {
            const uint32_t a = indices[i], b = indices[next[quads][i]];
            assert_int_equal(txm_mesh_next(&m, i), next[quads][i]);
            assert_int_equal(txm_mesh_low(&m, i), a < b ? a : b);
            assert_int_equal(txm_mesh_high(&m, i), a < b ? b : a);
            const txm_dvec3 p = txm_mesh_point(&m, i);
            assert_true(p.x == 3 * a / 8.0 && p.y == p.x + 0.125 && p.z == p.x + 0.25);
        }
        txm_dvec3 p[3];
        if (quads) continue;
        txm_mesh_triangle(&m, 2, p);
        assert_true(p[0].x == 9 / 8.0 && p[1].x == 3 && p[2].z == 3.25);
    }
}

/* ---- which sides share an edge ------------------------------------------------------------ */

enum { MOST_FACES = 400, MOST_SIDES = 4 * MOST_FACES };

typedef struct soup {
    uint32_t indices[MOST_SIDES];
    uint32_t sorted[2 * MOST_SIDES];
    uint32_t next[MOST_SIDES];
    txm_mesh mesh;
} soup;

/* Faces of vertices taken at random: many edges of many faces, and sides from a vertex to itself.
   spread: the numbers of the vertices are that far apart. */
static void make_soup(soup *s, size_t faces, int corners, uint32_t vertices, uint32_t spread,
                      uint64_t seed) {
    txm_rng rng = txm_rng_make(seed, vertices);
    memset(&s->mesh, 0, sizeof s->mesh);
    s->mesh.indices = s->indices;
    s->mesh.corners = corners;
    s->mesh.face_count = faces;
    s->mesh.vertex_count = (size_t)vertices * spread;
    for (size_t i = 0; i < faces * (size_t)corners; i++)
        s->indices[i] = spread * txm_rng_below(&rng, vertices) + spread - 1;
}

/* What must hold of sorted sides, found the slow way; returns the number of edges. */
static size_t check_sorted(const soup *s) {
    const size_t sides = txm_mesh_sides(&s->mesh);
    unsigned char seen[MOST_SIDES] = {0};
    size_t edges = 0;
    for (size_t i = 0, end; i < sides; i = end, edges++) {
        end = txm_mesh_edge_end(&s->mesh, s->sorted, i);
        assert_true(end > i && end <= sides);
        const uint32_t low = txm_mesh_low(&s->mesh, s->sorted[i]);
        const uint32_t high = txm_mesh_high(&s->mesh, s->sorted[i]);
        size_t count = 0;
        for (size_t k = 0; k < sides; k++)
            count += txm_mesh_low(&s->mesh, k) == low && txm_mesh_high(&s->mesh, k) == high;
        assert_int_equal(end - i, count);
        for (size_t k = i; k < end; k++) {
            const uint32_t side = s->sorted[k];
            assert_true(side < sides && !seen[side]);
            seen[side] = 1;
            assert_true(txm_mesh_low(&s->mesh, side) == low &&
                        txm_mesh_high(&s->mesh, side) == high);
            assert_true(k == i || side > s->sorted[k - 1]);
        }
        if (end == sides) continue;
        const uint32_t l = txm_mesh_low(&s->mesh, s->sorted[end]);
        const uint32_t h = txm_mesh_high(&s->mesh, s->sorted[end]);
        assert_true(l > low || (l == low && h > high));
    }
    return edges;
}

/* The ring of each side, found the slow way: up to the next higher side of the same edge, or down
   to the next lower one, and round. */
static void check_rings(const soup *s, int flags) {
    const size_t sides = txm_mesh_sides(&s->mesh);
    for (size_t i = 0; i < sides; i++) {
        const uint32_t low = txm_mesh_low(&s->mesh, i), high = txm_mesh_high(&s->mesh, i);
        size_t other = i;
        for (size_t n = 1; n < sides; n++) {
            other = flags & TXM_LINK_DOWN ? (i + sides - n) % sides : (i + n) % sides;
            if (txm_mesh_low(&s->mesh, other) == low && txm_mesh_high(&s->mesh, other) == high)
                break;
            other = i;
        }
        if (low == high && !(flags & TXM_LINK_POINTS)) other = i;
        assert_int_equal(s->next[i], other);
    }
}

static void test_edges_of_soups(void **state) {
    (void)state;
    static soup s;
    for (uint64_t seed = 1; seed <= 24; seed++) {
        const int corners = 3 + (int)(seed % 2);
        const uint32_t spread = seed % 3 == 0 ? 1 : seed % 3 == 1 ? 1000 : 300000007 / 64;
        const uint32_t vertices = 3 + (uint32_t)(seed * seed) / 9;
        make_soup(&s, 1 + 16 * (size_t)seed, corners, vertices, spread, seed);
        assert_int_equal(txm_mesh_check(&s.mesh, "soup", corners, 0, 0, NULL), TXM_OK);
        txm_mesh_sort_sides(&s.mesh, s.sorted);
        check_sorted(&s);
        for (int flags = 0; flags < 4; flags++) {
            memset(s.next, 0xff, sizeof s.next);
            txm_mesh_link(&s.mesh, s.sorted, flags, s.next);
            check_rings(&s, flags);
        }
    }
}

/* the vertex of a torus of n x n quads */
static uint32_t torus_vertex(uint32_t n, uint32_t x, uint32_t y) {
    return n * (y % n) + x % n;
}

static void test_edges_of_a_torus(void **state) {
    (void)state;
    static soup s;
    for (int corners = 3; corners <= 4; corners++) {
        const uint32_t n = 12;
        size_t count = 0;
        memset(&s.mesh, 0, sizeof s.mesh);
        for (uint32_t y = 0; y < n; y++) {
            for (uint32_t x = 0; x < n; x++) {
                const uint32_t a = torus_vertex(n, x, y), b = torus_vertex(n, x + 1, y);
                const uint32_t c = torus_vertex(n, x + 1, y + 1), d = torus_vertex(n, x, y + 1);
                const uint32_t both[6] = {a, b, c, a, c, d}, quad[4] = {a, b, c, d};
                const size_t size = corners == 3 ? 6 : 4;
                memcpy(s.indices + count, corners == 3 ? both : quad, size * sizeof *s.indices);
                count += size;
            }
        }
        s.mesh.indices = s.indices;
        s.mesh.corners = corners;
        s.mesh.vertex_count = n * n;
        s.mesh.face_count = count / (size_t)corners;
        txm_mesh_sort_sides(&s.mesh, s.sorted);
        const size_t edges = check_sorted(&s);
        assert_int_equal(edges, (corners == 3 ? 3 : 2) * n * n);
        assert_int_equal((int)s.mesh.vertex_count - (int)edges + (int)s.mesh.face_count, 0);
        txm_mesh_link(&s.mesh, s.sorted, 0, s.next);
        for (size_t i = 0; i < count; i++) { /* closed and wound evenly: one partner each */
            assert_true(s.next[i] != i);
            assert_int_equal(s.next[s.next[i]], i);
            assert_int_equal(s.indices[s.next[i]], s.indices[txm_mesh_next(&s.mesh, i)]);
        }
    }
}

/* Colours and directions depend on the two vertices only, whichever side of the edge is asked. */
static void test_edge_colors(void **state) {
    (void)state;
    static soup s;
    int count[5] = {0}, other_seed = 0;
    make_soup(&s, MOST_FACES, 3, 60, 1000, 7);
    txm_mesh_sort_sides(&s.mesh, s.sorted);
    for (size_t i = 0, end; i < 3 * MOST_FACES; i = end) {
        const uint32_t first = s.sorted[i];
        const int color = txm_mesh_edge_color(&s.mesh, first, 11, 5);
        end = txm_mesh_edge_end(&s.mesh, s.sorted, i);
        assert_true(color >= 0 && color < 5);
        count[color]++;
        other_seed += txm_mesh_edge_color(&s.mesh, first, 12, 5) != color;
        assert_int_equal(txm_mesh_edge_color(&s.mesh, first, 11, 1), 0);
        for (size_t k = i; k < end; k++)
            assert_int_equal(txm_mesh_edge_color(&s.mesh, s.sorted[k], 11, 5), color);
    }
    for (int c = 0; c < 5; c++) assert_true(count[c] > 120); /* of some 900 edges */
    assert_true(other_seed > 600);

    static const uint32_t triangle[3] = {5, 2, 9}, point[4] = {3, 3, 3, 3};
    txm_mesh m;
    memset(&m, 0, sizeof m);
    m.indices = triangle;
    assert_true(txm_mesh_runs_down(&m, 0) && !txm_mesh_runs_down(&m, 1));
    assert_true(txm_mesh_runs_down(&m, 2));
    m.indices = point;
    for (size_t i = 0; i < 3; i++) assert_int_equal(txm_mesh_runs_down(&m, i), i == 2);
    m.corners = 4;
    for (size_t i = 0; i < 4; i++) assert_int_equal(txm_mesh_runs_down(&m, i), i == 3);
}

static void test_no_faces(void **state) {
    (void)state;
    txm_mesh m;
    uint32_t sorted[1] = {7}, next[1] = {7};
    memset(&m, 0, sizeof m);
    txm_mesh_sort_sides(&m, sorted);
    txm_mesh_link(&m, sorted, 0, next);
    assert_true(sorted[0] == 7 && next[0] == 7);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_check),
        cmocka_unit_test(test_corners),
        cmocka_unit_test(test_edges_of_soups),
        cmocka_unit_test(test_edges_of_a_torus),
        cmocka_unit_test(test_edge_colors),
        cmocka_unit_test(test_no_faces),
    };
    return cmocka_run_group_tests_name("texmath meshes", tests, NULL, NULL);
}
