/* test_trimesh_relax.c - retiling: properties that every result must have, on surfaces made here
   SPDX-License-Identifier: MIT OR Unlicense

   Every mesh that comes out is checked as a whole (check_sound): exactly so many vertices, an
   oriented manifold of the input's topology, sources that lead back to the positions. The tests add
   what their surface asks for. All goes for both methods.                                       */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "trimesh_relax.h"
#include "retilekit.h"

/* ---- tests -------------------------------------------------------------------------------- */

/* Exactly as many as asked for, from very few on. */
static void test_numbers(void **state) {
    static const size_t numbers[] = {4, 5, 6, 7, 11, 12, 33, 100, 101, 257, 500};
    (void)state;
    make_ball(10);
    for (int k = 0; k < 2; k++) {
        for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
            const trimesh_desc d = describe(numbers[i], both[k]);
            found f;
            trimesh_mesh_free(made(&d, numbers[i] < 30 ? 0.5 : 0.15, &f));
            assert_true(f.volume > 0);
        }
    }
}

/* More vertices than the surface has, and many fewer; another seed is another mesh. */
static void test_ball(void **state) {
    const double exact = 4 * TXM_PI / 3;
    (void)state;
    make_ball(24);
    for (int k = 0; k < 2; k++) {
        trimesh_desc d = describe(3000, both[k]);
        found f;
        trimesh_mesh *m = made(&d, 0.05, &f);
        print_message("# ball: quality %.4f, valence 6 %.3f, edge cv %.3f, volume %+.3f %%\n",
                      f.quality, (double)f.six / (double)f.inside, f.edge_cv,
                      100 * (f.volume / exact - 1));
        check_regular(&f, both[k]);
        assert_true(fabs(f.volume / exact - 1) < 0.004);
        for (size_t i = 0; i < m->vertex_count; i++) {
            static const float origin[3] = {0, 0, 0};
            const float *p = m->positions + 3 * i, *n = m->normals + 3 * i;
            assert_true(fabs(distance(p, origin) - 1) < 0.006);
            assert_true((double)(p[0] * n[0] + p[1] * n[1] + p[2] * n[2]) > 0.99);
            assert_int_equal(m->kinds[i], TRIMESH_FREE);
        }
        d.seed = 1;
        d.vertices = 300;
        trimesh_mesh *one = made(&d, 0.15, NULL);
        d.seed = 2;
        trimesh_mesh *two = made(&d, 0.15, NULL);
        assert_memory_not_equal(one->positions, two->positions, 3 * 300 * sizeof(float));
        trimesh_mesh_free(m);
        trimesh_mesh_free(one);
        trimesh_mesh_free(two);
    }
}

static void test_torus(void **state) {
    (void)state;
    tk_wide();
    make_torus(60, 28);
    for (int k = 0; k < 2; k++) {
        const trimesh_desc d = describe(3001, both[k]);
        const double exact = 2 * TXM_PI * TXM_PI * 0.16;
        found f;
        trimesh_mesh_free(made(&d, 0.05, &f));
        print_message("# torus: quality %.4f, valence 6 %.3f, edge cv %.3f, volume %+.3f %%\n",
                      f.quality, (double)f.six / (double)f.inside, f.edge_cv,
                      100 * (f.volume / exact - 1));
        check_regular(&f, both[k]);
        assert_true(fabs(f.volume / exact - 1) < 0.015); /* the input itself lacks 1.1 % */
    }
}

/* Two handles, from a soup whose triangles share no vertices, many of them slivers. */
static void test_eight(void **state) {
    (void)state;
    make_eight(36);
    for (int k = 0; k < 2; k++) {
        const trimesh_desc d = describe(2001, both[k]);
        found f;
        trimesh_mesh_free(made(&d, 0.3, &f));
        print_message("# eight: %lu triangles, %lu welded, quality %.4f, valence 6 %.3f\n",
                      (unsigned long)in.triangles, (unsigned long)report.welded, f.quality,
                      (double)f.six / (double)f.inside);
        assert_true(report.welded > in.vertices / 2);
        assert_true(f.quality > (k ? 0.945 : 0.97));
        assert_true(f.volume > 0);
    }
}

/* Turned inside out it stays so. */
static void test_orientation(void **state) {
    (void)state;
    for (int k = 0; k < 2; k++) {
        make_ball(8);
        const trimesh_desc d = describe(200, both[k]);
        found f;
        for (size_t t = 0; t < in.triangles; t++) {
            const uint32_t swap = in.t[3 * t + 1];
            in.t[3 * t + 1] = in.t[3 * t + 2];
            in.t[3 * t + 2] = swap;
        }
        trimesh_mesh_free(made(&d, 0.15, &f));
        assert_true(f.volume < -3.8);
    }
}

/* The vertex at this place, or -1. */
static long vertex_at(const trimesh_mesh *m, double x, double y, double z) {
    const float p[3] = {(float)x, (float)y, (float)z};
    for (size_t i = 0; i < m->vertex_count; i++) {
        if (distance(p, m->positions + 3 * i) < 1e-6) return (long)i;
    }
    return -1;
}

/* Walk along a straight line of the surface from corner p to corner q, over edges of the mesh whose
   vertices lie on it, each step ahead. Returns the steps, 0 if there is no way. */
static int walk(const trimesh_mesh *m, const float *p, const float *q) {
    long at = vertex_at(m, (double)p[0], (double)p[1], (double)p[2]);
    int steps = 0;
    while (at >= 0 && distance(m->positions + 3 * at, q) > 1e-6) {
        const double left = distance(m->positions + 3 * at, q);
        long next = -1;
        for (uint32_t c = 0; c < side_count; c++) {
            if (m->indices[c] != (uint32_t)at) continue;
            const float *o = m->positions + 3 * (size_t)m->indices[next_of(c)];
            const double there = distance(o, q);
            if (distance(p, o) + there < distance(p, q) + 1e-5 && there < left - 1e-6)
                next = (long)m->indices[next_of(c)];
        }
        at = next;
        steps++;
    }
    return at < 0 ? 0 : steps;
}

/* Corners stay where they are, every edge is a chain of edges, sides stay plane. */
static void test_cube(void **state) {
    static const size_t numbers[] = {8, 27, 300, 1501};
    (void)state;
    make_cube();
    for (int k = 0; k < 2; k++) {
        for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
            const trimesh_desc d = describe(numbers[i], both[k]);
            found f;
            int steps = 0, corners = 0;
            trimesh_mesh *m = made(&d, 1e-5, &f);
            assert_int_equal(report.crease_edges, 12);
            assert_true(fabs(f.volume - 1) < 1e-5);
            for (int a = 0; a < 8; a++) {
                const float p[3] = {(float)(a & 1), (float)(a >> 1 & 1), (float)(a >> 2)};
                for (int axis = 0; axis < 3; axis++) {
                    float q[3] = {p[0], p[1], p[2]};
                    if (a >> axis & 1) continue;
                    q[axis] = 1;
                    const int chain = walk(m, p, q);
                    assert_true(chain > 0);
                    steps += chain;
                }
            }
            for (size_t v = 0; v < m->vertex_count; v++) {
                const float *p = m->positions + 3 * v;
                int sides_of = 0;
                for (int c = 0; c < 3; c++) sides_of += p[c] < 1e-6f || p[c] > 1 - 1e-6f;
                corners += m->kinds[v] == TRIMESH_CORNER;
                assert_int_equal(m->kinds[v], sides_of == 3   ? TRIMESH_CORNER
                                              : sides_of == 2 ? TRIMESH_CREASE
                                                              : TRIMESH_FREE);
            }
            assert_int_equal(corners, 8);
            if (numbers[i] >= 300) { /* steps along creases as long as those inside */
                assert_true(fabs(12.0 / steps / f.edge_mean - 1) < 0.15);
                print_message("# cube: %d steps, quality %.3f\n", steps, f.quality);
                assert_true(f.quality > 0.92);
            }
            trimesh_mesh_free(m);
        }
        /* without creases nothing is a line; a corner of the cube may be kept as a tip */
        trimesh_desc d = describe(300, both[k]);
        d.crease_angle = 180;
        int tips = 0;
        trimesh_mesh *m = made(&d, 0.6, NULL);
        assert_int_equal(report.crease_edges, 0);
        for (size_t v = 0; v < m->vertex_count; v++) {
            const float *p = m->positions + 3 * v;
            int sides_of = 0;
            for (int c = 0; c < 3; c++) sides_of += p[c] < 1e-6f || p[c] > 1 - 1e-6f;
            if (sides_of < 3) assert_int_equal(m->kinds[v], TRIMESH_FREE);
            tips += m->kinds[v] == TRIMESH_CORNER;
        }
        print_message("# cube without creases: %d tips\n", tips);
        trimesh_mesh_free(m);
    }
}

/* How far the vertex lies from the outline of the sheet or of its hole, seen from above. */
static double off_outline(const float *p, int n) {
    const double low = ceil(n / 3.0) / n, high = ceil(2 * n / 3.0) / n;
    const double x = (double)p[0], y = (double)p[1];
    const double outer = fmin(fmin(x, 1 - x), fmin(y, 1 - y));
    const double dx = fmax(fmax(low - x, x - high), 0), dy = fmax(fmax(low - y, y - high), 0);
    const double inside = fmin(fmin(x - low, high - x), fmin(y - low, high - y));
    const double inner = inside > 0 ? inside : sqrt(dx * dx + dy * dy);
    return fmin(outer, inner);
}

/* The border keeps its loops, its corners and its place. */
static void test_border(void **state) {
    tk_wide();
    enum { SIDE = 30 };
    static const size_t numbers[] = {40, 601, 2000};
    (void)state;
    make_sheet(SIDE);
    for (int k = 0; k < 2; k++) {
        for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
            const trimesh_desc d = describe(numbers[i], both[k]);
            found f;
            double sum = 0, rim = 0;
            trimesh_mesh *m = made(&d, 0.3, &f);
            for (size_t v = 0; v < m->vertex_count; v++) {
                if (!on_rim[v]) continue;
                const double off = off_outline(m->positions + 3 * v, SIDE) / f.edge_mean;
                assert_true(off < 0.05);
                sum += off * off;
                rim++;
            }
            assert_true(sqrt(sum / rim) < 0.02);
            for (int c = 0; c < 4; c++) {
                const float *p = in.at + 3 * (size_t)((c & 1 ? SIDE : 0) * (SIDE + 1) +
                                                      (c & 2 ? SIDE : 0));
                const long v = vertex_at(m, (double)p[0], (double)p[1], (double)p[2]);
                assert_true(v >= 0);
                assert_int_equal(m->kinds[v], TRIMESH_CORNER);
            }
            if (numbers[i] >= 600) assert_true(f.quality > 0.95);
            trimesh_mesh_free(m);
        }
    }
}

/* Pieces get vertices by their area; a small one is not forgotten. */
static void test_two_balls(void **state) {
    (void)state;
    for (int k = 0; k < 2; k++) {
        size_t small = 0;
        begin(4, 2, 0);
        add_ball(10, 1, 0, 0, 0);
        add_ball(8, 0.5, 3, 0, 0);
        trimesh_desc d = describe(1001, both[k]);
        trimesh_mesh *m = made(&d, 0.15, NULL);
        for (size_t v = 0; v < m->vertex_count; v++) small += m->positions[3 * v] > 2;
        assert_in_range(small, 180, 220); /* a fifth of the area */
        trimesh_mesh_free(m);
        begin(4, 2, 0);
        add_ball(10, 1, 0, 0, 0);
        add_ball(4, 0.02, 3, 0, 0);
        d = describe(300, both[k]);
        m = made(&d, 0.5, NULL);
        small = 0;
        for (size_t v = 0; v < m->vertex_count; v++) small += m->positions[3 * v] > 2;
        assert_in_range(small, 4, 20);
        trimesh_mesh_free(m);
    }
}

/* Sides much nearer to each other than an edge is long: no bridge from one to the other. */
static void test_plate(void **state) {
    (void)state;
    for (int k = 0; k < 2; k++) {
        begin(2, 1, 0);
        add_box(0, 0, 0, 1, 1, 0.01);
        const trimesh_desc d = describe(801, both[k]);
        found f;
        trimesh_mesh *m = made(&d, 1e-4, &f);
        assert_true(fabs(f.volume / 0.01 - 1) < 1e-3);
        assert_true(f.edge_mean > 3 * 0.01);
        for (uint32_t c = 0; c < side_count; c++) { /* only the rim has both heights */
            const float *p = m->positions + 3 * (size_t)m->indices[c];
            const float *q = m->positions + 3 * (size_t)m->indices[next_of(c)];
            if (fabsf(p[2] - q[2]) < 0.005f) continue;
            for (int e = 0; e < 2; e++) {
                const float *o = e ? q : p;
                const float in_by = fminf(fminf(o[0], 1 - o[0]), fminf(o[1], 1 - o[1]));
                assert_true(in_by < 1e-5f);
            }
        }
        trimesh_mesh_free(m);
    }
    /* two sheets without thickness, not joined */
    for (int k = 0; k < 2; k++) {
        begin(2, 2, 2);
        for (int z = 0; z < 2; z++) {
            uint32_t c[4];
            for (int i = 0; i < 4; i++) c[i] = vertex(i == 1 || i == 2, i / 2, 0.002 * z);
            quad(c[0], c[1], c[2], c[3]);
        }
        const trimesh_desc d = describe(500, both[k]);
        trimesh_mesh_free(made(&d, 1e-4, NULL));
    }
}

/* A coarse ball with dents in all directions. */
static void test_noise(void **state) {
    (void)state;
    make_ball(5);
    for (size_t i = 0; i < in.vertices; i++) { /* by place, so that equal places stay equal */
        int32_t q[3];
        for (size_t k = 0; k < 3; k++) q[k] = (int32_t)(in.at[3 * i + k] * 1000 + 0.5f);
        const double r = 1 + 0.1 * ((double)(tk_hash(0, q, sizeof q) % 1000) / 1000 - 0.5);
        for (size_t k = 0; k < 3; k++) in.at[3 * i + k] *= (float)r;
    }
    for (int k = 0; k < 2; k++) {
        static const size_t numbers[] = {150, 1001};
        for (int i = 0; i < 2; i++) {
            trimesh_desc d = describe(numbers[i], both[k]);
            found f;
            d.crease_angle = 180;
            trimesh_mesh_free(made(&d, 0.4, &f));
            assert_true(f.quality > 0.95);
        }
    }
}

/* ---- density -------------------------------------------------------------------------------- */

/* Mean edge length where x is on this side. */
static double edges_where(const trimesh_mesh *m, int right) {
    double sum = 0, count = 0;
    for (size_t c = 0; c < 3 * m->triangle_count; c++) {
        const float *p = m->positions + 3 * (size_t)m->indices[c];
        const float *q = m->positions + 3 * (size_t)m->indices[next_of((uint32_t)c)];
        if (right ? fminf(p[0], q[0]) < 0.4f : fmaxf(p[0], q[0]) > -0.4f) continue;
        sum += distance(p, q);
        count++;
    }
    return sum / count;
}

/* Mean edge length where x is larger. */
static double edges_beyond(const trimesh_mesh *m, float x) {
    double sum = 0, count = 0;
    for (size_t c = 0; c < 3 * m->triangle_count; c++) {
        const float *p = m->positions + 3 * (size_t)m->indices[c];
        const float *q = m->positions + 3 * (size_t)m->indices[next_of((uint32_t)c)];
        if (fminf(p[0], q[0]) < x) continue;
        sum += distance(p, q);
        count++;
    }
    return sum / count;
}

static void test_scale(void **state) {
    tk_wide();
    static const float factors[] = {2, 4};
    (void)state;
    make_ball(24);
    for (int k = 0; k < 2; k++) {
        for (int i = 0; i < 2; i++) {
            trimesh_desc d = describe(3000, both[k]);
            for (size_t v = 0; v < in.vertices; v++) {
                const float t = txm_clampf(in.at[3 * v] / 0.6f + 0.5f, 0, 1);
                in.scale[v] = 7 * (1 + (factors[i] - 1) * (1 - t));
            }
            d.scale = in.scale;
            found f;
            trimesh_mesh *m = made(&d, 0.15, &f);
            const double ratio = edges_where(m, 0) / edges_where(m, 1);
            print_message("# scale 1:%g: edges 1:%.2f, quality %.3f\n", (double)factors[i], ratio,
                          f.quality);
            assert_true(ratio > 0.85 * (double)factors[i] && ratio < 1.15 * (double)factors[i]);
            assert_true(f.quality > 0.95);
            trimesh_mesh_free(m);
        }
    }
}

/* Scales are relative: the same number everywhere is as good as none, with adapt as well. */
static void test_scale_is_relative(void **state) {
    (void)state;
    make_ball(12);
    for (size_t v = 0; v < in.vertices; v++) in.at[3 * v] *= 3; /* an egg: adapt has work to do */
    for (int k = 0; k < 2; k++) {
        for (int adapt = 0; adapt < 2; adapt++) {
            trimesh_desc d = describe(501, both[k]);
            double mean[2], length[2], tip[2];
            d.adapt = (float)adapt;
            for (int scaled = 0; scaled < 2; scaled++) {
                found f;
                for (size_t v = 0; v < in.vertices; v++) in.scale[v] = 8;
                d.scale = scaled ? in.scale : NULL;
                trimesh_mesh *m = made(&d, 0.3, &f);
                mean[scaled] = f.edge_mean;
                length[scaled] = m->edge_length;
                tip[scaled] = edges_beyond(m, 2.7f);
                trimesh_mesh_free(m);
            }
            print_message("# scale 8 everywhere, adapt %d: edges of %.3f and %.3f, at the tip %.3f "
                          "and %.3f, aimed at %.3f and %.3f\n",
                          adapt, mean[0], mean[1], tip[0], tip[1], length[0], length[1]);
            assert_true(fabs(mean[1] / mean[0] - 1) < 0.02);
            assert_true(fabs(tip[1] / tip[0] - 1) < 0.05);
            if (!adapt) assert_true(fabs(length[0] / mean[0] - 1) < 0.1);
        }
    }
}

/* Edges are shorter where a surface bends: an egg whose end has a ninth of the radius. */
static void test_adapt(void **state) {
    const int seeds = tk_full() ? 4 : 2;
    (void)state;
    make_ball(24);
    for (size_t v = 0; v < in.vertices; v++) {
        const float x = in.at[3 * v];
        if (x > 0) in.at[3 * v] = 2.2f * x;
        for (size_t k = 1; k < 3; k++)
            if (x > 0) in.at[3 * v + k] *= 1 - 0.5f * x;
    }
    for (int k = 0; k < 2; k++) {
        double ratio[2] = {0, 0};
        for (int i = 0; i < 2 * seeds; i++) { /* the edges of one seed wobble by 4 % at the tip */
            trimesh_desc d = describe(1500, both[k]);
            found f;
            d.adapt = (float)(i % 2);
            d.seed = (uint64_t)i / 2;
            trimesh_mesh *m = made(&d, 0.3, &f);
            ratio[i % 2] += edges_beyond(m, 2.05f) / f.edge_mean / seeds;
            trimesh_mesh_free(m);
        }
        print_message("# adapt: edges at the tip %.2f of the mean, without %.2f\n", ratio[1],
                      ratio[0]);
        assert_true(ratio[1] < (seeds > 2 ? 0.97 : 0.99) * ratio[0]);
    }
}

/* A ball that ends in a thin wavy leaf, whose two sides cross where the edges are as long as elsewhere:
   another attempt makes them shorter there, and only there. */
static void test_thin_leaf(void **state) {
    (void)state;
    make_ball(48);
    for (size_t v = 0; v < in.vertices; v++) {
        float *p = in.at + 3 * v;
        const float t = txm_clampf((p[0] - 0.2f) / 0.3f, 0, 1), leaf = t * t * (3 - 2 * t);
        const float wave = 0.11f * sinf(12 * p[0]);
        p[2] = p[2] * (1 - 0.97f * leaf) + wave * leaf;
        if (p[0] > 0.2f) p[0] = 0.2f + 1.6f * (p[0] - 0.2f);
    }
    for (int k = 0; k < 2; k++) {
        trimesh_desc d = describe(900, both[k]);
        found f;
        trimesh_mesh *m = made(&d, 0.9, &f);
        const double leaf = edges_beyond(m, 0.7f), all = f.edge_mean;
        for (size_t v = 0; v < m->vertex_count; v++) m->positions[3 * v] *= -1;
        const double ball = edges_beyond(m, 0);
        print_message("# a wavy leaf: edges of %.3f, on the leaf %.3f, on the ball %.3f\n", all, leaf, ball);
        assert_true(leaf < 0.85 * ball && ball < 1.3 * all);
        trimesh_mesh_free(m);
    }
}

static void test_line_spacing(void **state) {
    static const float spacings[] = {0.5f, 1, 2};
    (void)state;
    make_cube();
    for (int k = 0; k < 2; k++) {
        for (int i = 0; i < 3; i++) {
            trimesh_desc d = describe(1200, both[k]);
            double line = 0, count = 0, free_sum = 0, free_count = 0;
            d.line_spacing = spacings[i];
            trimesh_mesh *m = made(&d, 1e-5, NULL);
            for (size_t c = 0; c < 3 * m->triangle_count; c++) {
                const uint32_t a = m->indices[c], b = m->indices[next_of((uint32_t)c)];
                const float *p = m->positions + 3 * (size_t)a, *q = m->positions + 3 * (size_t)b;
                int same = 0; /* coordinates: on one edge of the cube two */
                for (int x = 0; x < 3; x++) same += fabsf(p[x] - q[x]) < 1e-6f;
                const double length = distance(p, q);
                if (m->kinds[a] == TRIMESH_CREASE && m->kinds[b] == TRIMESH_CREASE && same == 2) {
                    line += length;
                    count++;
                } else if (m->kinds[a] == TRIMESH_FREE && m->kinds[b] == TRIMESH_FREE) {
                    free_sum += length;
                    free_count++;
                }
            }
            const double ratio = line / count / (free_sum / free_count);
            print_message("# line spacing %g: %.2f\n", (double)spacings[i], ratio);
            assert_true(ratio > 0.7 * (double)spacings[i] && ratio < 1.4 * (double)spacings[i]);
            trimesh_mesh_free(m);
        }
    }
}

/* ---- inputs that need mending ----------------------------------------------------------------- */

static void test_soup(void **state) {
    (void)state;
    make_torus(24, 12);
    static float at[3 * MOST_VERTICES];
    const size_t corners = 3 * in.triangles;
    assert_true(corners <= MOST_VERTICES);
    for (size_t c = 0; c < corners; c++) memcpy(at + 3 * c, in.at + 3 * (size_t)in.t[c], 12);
    memcpy(in.at, at, 3 * corners * sizeof(float));
    for (size_t c = 0; c < corners; c++) in.t[c] = (uint32_t)c;
    in.vertices = corners;
    for (int k = 0; k < 2; k++) {
        const trimesh_desc d = describe(301, both[k]);
        trimesh_mesh_free(made(&d, 0.3, NULL));
        assert_int_equal(report.welded, corners - 24 * 12);
        assert_int_equal(report.vertices, 24 * 12);
    }
}

/* Double triangles, some of them turned; vertices of no triangle; triangles without area. */
static void test_dirt(void **state) {
    (void)state;
    for (int k = 0; k < 2; k++) {
        make_torus(24, 12);
        const size_t clean = in.triangles;
        for (uint32_t i = 0; i < 40; i++) {
            const uint32_t *t = in.t + 3 * (7 * i);
            if (i % 2) triangle(t[1], t[2], t[0]);
            else triangle(t[1], t[0], t[2]);
        }
        triangle(3, 3, 4);
        vertex(50, 50, 50);
        const trimesh_desc d = describe(301, both[k]);
        found f;
        trimesh_mesh_free(made(&d, 0.3, &f));
        assert_int_equal(report.triangles, clean);
        assert_int_equal(report.duplicate, 40);
        assert_int_equal(report.unused, 1);
        assert_true(report.degenerate >= 1);
        assert_true(f.volume > 0);
    }
}

/* A prism of three sides, each cut into n quads: the whole triangles below and above become fans of
   splinters, all of whose short sides lie on one edge of theirs. */
static void make_splinters(int n) {
    uint32_t ring[2][3];
    begin(2, 1, 0);
    for (int z = 0; z < 2; z++)
        for (int k = 0; k < 3; k++)
            ring[z][k] = vertex(cos(2 * TXM_PI * k / 3), sin(2 * TXM_PI * k / 3), z);
    triangle(ring[0][2], ring[0][1], ring[0][0]);
    triangle(ring[1][0], ring[1][1], ring[1][2]);
    for (int k = 0; k < 3; k++) {
        const float *a = in.at + 3 * ring[0][k], *b = in.at + 3 * ring[0][(k + 1) % 3];
        uint32_t low = ring[0][k], high = ring[1][k];
        for (int i = 1; i <= n; i++) {
            const double t = (double)i / n, x = a[0] + t * (b[0] - a[0]), y = a[1] + t * (b[1] - a[1]);
            const uint32_t l = i < n ? vertex(x, y, 0) : ring[0][(k + 1) % 3];
            const uint32_t h = i < n ? vertex(x, y, 1) : ring[1][(k + 1) % 3];
            quad(low, l, h, high);
            low = l;
            high = h;
        }
    }
}

static void test_splinters(void **state) {
    (void)state;
    for (int n = 10; n <= 1000; n *= 10) {
        make_splinters(n);
        const trimesh_desc d = describe(1000, TRIMESH_LATTICE);
        found f;
        trimesh_mesh_free(made(&d, 0.02, &f));
        assert_int_equal(report.stitched, 6 * (n - 1));
        assert_true(f.quality > 0.94);
    }
}

/* ---- refusals ------------------------------------------------------------------------------- */

static txm_status refused(const trimesh_desc *d, char message[]) {
    static char poison;
    trimesh_mesh *m = (trimesh_mesh *)(void *)&poison;
    tk_memory memory;
    memset(&memory, 0, sizeof memory);
    txm_env env = tk_env(&memory, NULL);
    const txm_status status = trimesh_retile(d, &env, &m);
    if (status == TXM_OK) {
        assert_non_null(m);
        trimesh_mesh_free(m);
    } else {
        assert_null(m);
        assert_true(strlen(env.message) > 4);
    }
    assert_int_equal(tk_leaks(&memory), 0);
    if (message) snprintf(message, sizeof env.message, "%s", env.message);
    return status;
}

/* Either a sound mesh or the number that is needed, which then is enough. */
static void try_small(size_t vertices, trimesh_method method) {
    for (int tries = 0;; tries++) {
        char message[sizeof(((txm_env *)0)->message)];
        const trimesh_desc d = describe(vertices, method);
        const txm_status status = refused(&d, message);
        if (status == TXM_OK) {
            trimesh_mesh_free(made(&d, 4, NULL));
            return;
        }
        assert_int_equal(status, TXM_TOO_SMALL);
        /* the last number of the message */
        const char *digits = message + strlen(message);
        while (digits > message && !(digits[-1] >= '0' && digits[-1] <= '9')) digits--;
        while (digits > message && digits[-1] >= '0' && digits[-1] <= '9') digits--;
        const unsigned long needed = strtoul(digits, NULL, 10);
        if (needed <= vertices) print_message("# %s\n", message);
        assert_true(needed > vertices);
        vertices = needed;
        assert_true(tries < 8);
    }
}

/* It is refused, and the number that the message names, not below the least, is enough. */
static void check_hint(const trimesh_desc *desc, size_t least) {
    trimesh_desc d = *desc;
    char message[sizeof(((txm_env *)0)->message)];
    assert_int_equal(refused(&d, message), TXM_TOO_SMALL);
    const char *give = strstr(message, "; give ");
    assert_non_null(give);
    d.vertices = (size_t)atol(give + strlen("; give "));
    assert_true(d.vertices >= least);
    trimesh_mesh *mesh = NULL;
    assert_int_equal(trimesh_retile(&d, NULL, &mesh), TXM_OK);
    trimesh_mesh_free(mesh);
}

static void test_too_small(void **state) {
    (void)state;
    tk_wide();
    for (int k = 0; k < 2; k++) {
        char message[sizeof(((txm_env *)0)->message)];
        make_cube();
        for (size_t n = 4; n <= 9; n += tk_full() ? 1 : 2) try_small(n, both[k]);
        make_torus(24, 12);
        for (size_t n = 4; n <= 16; n += tk_full() ? 3 : 6) try_small(n, both[k]);
        trimesh_desc d = describe(6, both[k]);
        check_hint(&d, 7);
        for (size_t n = 0; n < 4; n++) {
            d.vertices = n;
            assert_int_equal(refused(&d, message), TXM_TOO_SMALL);
            assert_non_null(strstr(message, "4"));
        }
        make_eight(24);
        for (size_t n = 4; n <= 20; n += tk_full() ? 8 : 16) try_small(n, both[k]);
        make_sheet(6);
        for (size_t n = 4; n <= 12; n += 4) try_small(n, both[k]);
        begin(6, 3, 0);
        for (int i = 0; i < 3; i++) add_ball(4, 1, 3 * i, 0, 0);
        d = describe(11, both[k]);
        check_hint(&d, 12);
        try_small(12, both[k]);
    }
}

static void test_bad_arguments(void **state) {
    static const double nan_value = NAN;
    (void)state;
    make_ball(4);
    trimesh_desc good = describe(60, TRIMESH_LATTICE), d;
    trimesh_mesh *m;
    txm_env env = tk_env(NULL, NULL);
    assert_int_equal(refused(&good, NULL), TXM_OK);
    assert_int_equal(trimesh_retile(&good, &env, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(refused(NULL, NULL), TXM_BAD_ARGUMENT);
#define REFUSED(field, value) \
    do { \
        d = good; \
        d.field = (value); \
        assert_int_equal(refused(&d, NULL), TXM_BAD_ARGUMENT); \
    } while (0)
    REFUSED(surface.positions, NULL);
    REFUSED(surface.indices, NULL);
    REFUSED(adapt, -0.1f);
    REFUSED(adapt, 1.1f);
    REFUSED(adapt, (float)nan_value);
    REFUSED(crease_angle, -1);
    REFUSED(crease_angle, 181);
    REFUSED(crease_angle, (float)nan_value);
    REFUSED(line_spacing, 0.2f);
    REFUSED(line_spacing, 4.1f);
    REFUSED(line_spacing, -1);
    REFUSED(line_spacing, (float)nan_value);
    REFUSED(weld, -0.001f);
    REFUSED(weld, 0.011f);
    REFUSED(weld, (float)nan_value);
    REFUSED(iterations, -1);
    REFUSED(iterations, 1001);
    REFUSED(method, (trimesh_method)2);
#undef REFUSED
    d = good;
    d.vertices = (size_t)TRIMESH_MAX_VERTICES + 1;
    assert_int_equal(refused(&d, NULL), TXM_TOO_LARGE);
    d.vertices = SIZE_MAX;
    assert_int_equal(refused(&d, NULL), TXM_TOO_LARGE);
    d = good;
    d.surface.face_count = (size_t)TRIMESH_MAX_VERTICES + 1;
    assert_int_equal(refused(&d, NULL), TXM_TOO_LARGE);
    /* scales out of range, positions and indices that are none */
    static const float bad[] = {0, -1, NAN, INFINITY, 2000};
    for (size_t v = 0; v < in.vertices; v++) in.scale[v] = 1;
    d = good;
    d.scale = in.scale;
    assert_int_equal(refused(&d, NULL), TXM_OK);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        in.scale[5] = bad[i];
        assert_int_equal(refused(&d, NULL), TXM_BAD_ARGUMENT);
    }
    const float x = in.at[7];
    in.at[7] = (float)nan_value;
    assert_int_equal(refused(&good, NULL), TXM_BAD_ARGUMENT);
    in.at[7] = INFINITY;
    assert_int_equal(refused(&good, NULL), TXM_BAD_ARGUMENT);
    in.at[7] = x;
    in.t[10] = (uint32_t)in.vertices;
    assert_int_equal(refused(&good, NULL), TXM_BAD_ARGUMENT);
    make_ball(4);
    d = good;
    d.surface.face_count = 0;
    assert_int_equal(refused(&d, NULL), TXM_TOO_SMALL);
    /* three faces that cannot be parted name their edge */
    make_ball(4);
    assert_int_equal(trimesh_retile(&good, NULL, &m), TXM_OK); /* without an env */
    trimesh_mesh_free(m);
    trimesh_mesh_free(NULL);
}

/* ---- failures ------------------------------------------------------------------------------- */

/* A case that goes through all stages: an open sheet with a hole, or a cube, of few vertices. */
static trimesh_desc small_case(int which, trimesh_method method) {
    if (which) make_cube();
    else make_sheet(6);
    trimesh_desc d = describe(60, method);
    d.adapt = which ? 0 : 0.5f;
    d.iterations = 3;
    return d;
}

static txm_status retile_it(void *context, txm_env *env) {
    trimesh_mesh *m = NULL;
    const txm_status status = trimesh_retile((const trimesh_desc *)context, env, &m);
    assert_true((status == TXM_OK) == (m != NULL));
    trimesh_mesh_free(m);
    return status;
}

static void test_faults(void **state) {
    (void)state;
    for (int which = 0; which < 2; which++) {
        for (int k = 0; k < 2; k++) {
            trimesh_desc d = small_case(which, both[k]);
            assert_true(tk_sweep(retile_it, &d, TK_ALLOCATION) > 60);
            assert_true(tk_sweep(retile_it, &d, TK_ONWARD) > 60);
            assert_true(tk_sweep(retile_it, &d, TK_CANCEL) > 20);
        }
    }
}

/* A large mesh reports within passes, and may be cancelled there. */
static void test_reports(void **state) {
    long calls[2];
    (void)state;
    make_torus(40, 20);
    for (int k = 0; k < 2; k++) {
        trimesh_desc d = describe(k ? 8000 : 500, TRIMESH_LATTICE);
        tk_progress progress = {0};
        txm_env env = tk_env(NULL, &progress);
        assert_int_equal(retile_it(&d, &env), TXM_OK);
        assert_int_equal(progress.errors, 0);
        calls[k] = progress.calls;
    }
    assert_true(calls[1] > calls[0] + 30);
    for (int k = 1; k < 4; k++) {
        trimesh_desc d = describe(8000, TRIMESH_LATTICE);
        tk_progress progress = {0};
        tk_memory memory = {0};
        txm_env env = tk_env(&memory, &progress);
        progress.cancel_at = calls[1] * k / 4;
        assert_int_equal(retile_it(&d, &env), TXM_CANCELLED);
        assert_int_equal(progress.late, 0);
        assert_int_equal(tk_leaks(&memory), 0);
    }
}

/* ---- same bytes ------------------------------------------------------------------------------- */

static uint64_t hash_of(const trimesh_desc *d, txm_env *env) {
    trimesh_mesh *m;
    assert_int_equal(trimesh_retile(d, env, &m), TXM_OK);
    uint64_t h = tk_hash(0, m->positions, 3 * m->vertex_count * sizeof(float));
    h = tk_hash(h, m->normals, 3 * m->vertex_count * sizeof(float));
    h = tk_hash(h, m->indices, 3 * m->triangle_count * sizeof(uint32_t));
    h = tk_hash(h, m->sources, m->vertex_count * sizeof(txm_mesh_place));
    h = tk_hash(h, m->kinds, m->vertex_count);
    trimesh_mesh_free(m);
    return h;
}

static void test_same_bytes(void **state) {
    (void)state;
    tk_wide();
    for (int which = 0; which < 2; which++) {
        if (which) make_sheet(20);
        else make_torus(40, 20);
        for (int k = 0; k < 2; k++) {
            trimesh_desc d = describe(tk_full() ? 1501 : 601, both[k]);
            int threads = 3;
            txm_env env = tk_env(NULL, NULL);
            const uint64_t plain = hash_of(&d, &env);
            assert_true(plain == hash_of(&d, &env));
            env.parallel_for = tk_parallel_reverse;
            assert_true(plain == hash_of(&d, &env));
            env.parallel_for = tk_parallel_threads;
            env.parallel_user = &threads;
            assert_true(plain == hash_of(&d, &env));
        }
    }
}

/* Step by step gives what the one call gives; a job may be dropped at any step. */
static void test_steps(void **state) {
    (void)state;
    make_torus(24, 12);
    for (int k = 0; k < 2; k++) {
        trimesh_desc d = describe(300, both[k]);
        trimesh_mesh *whole, *stepped;
        d.iterations = 6;
        whole = made(&d, 0.3, NULL);
        for (int drop = 1, more = 1; more; drop++) {
            trimesh_job *job;
            trimesh_state s;
            tk_memory memory;
            memset(&memory, 0, sizeof memory);
            txm_env env = tk_env(&memory, NULL);
            assert_int_equal(trimesh_begin(&d, &env, &job), TXM_OK);
            for (int steps = 0; more && steps < drop; steps++) {
                assert_int_equal(trimesh_step(job, &env, &more), TXM_OK);
                assert_int_equal(trimesh_get_state(job, &env, &s), TXM_OK);
                assert_true(strlen(s.stage) > 2);
                for (size_t c = 0; c < 3 * s.triangles; c++) assert_true(s.indices[c] < s.points);
            }
            if (more) {
                assert_int_equal(trimesh_get_mesh(job, &env, &stepped), TXM_BAD_ARGUMENT);
                assert_null(stepped);
                trimesh_free(job);
                assert_int_equal(tk_leaks(&memory), 0);
                continue;
            }
            for (int times = 0; times < 2; times++) { /* as often as one likes */
                assert_int_equal(trimesh_get_mesh(job, &env, &stepped), TXM_OK);
                if (times) trimesh_free(job);
                assert_memory_equal(whole->positions, stepped->positions, 3 * 300 * sizeof(float));
                assert_memory_equal(whole->indices, stepped->indices,
                                    3 * whole->triangle_count * sizeof(uint32_t));
                trimesh_mesh_free(stepped);
            }
            assert_int_equal(tk_leaks(&memory), 0);
        }
        trimesh_mesh_free(whole);
    }
    trimesh_free(NULL);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_numbers),     cmocka_unit_test(test_ball),
        cmocka_unit_test(test_torus),       cmocka_unit_test(test_eight),
        cmocka_unit_test(test_orientation), cmocka_unit_test(test_cube),
        cmocka_unit_test(test_border),      cmocka_unit_test(test_two_balls),
        cmocka_unit_test(test_plate),       cmocka_unit_test(test_noise),
        cmocka_unit_test(test_scale),       cmocka_unit_test(test_scale_is_relative),
        cmocka_unit_test(test_adapt),       cmocka_unit_test(test_line_spacing),
        cmocka_unit_test(test_thin_leaf),
        cmocka_unit_test(test_soup),        cmocka_unit_test(test_dirt),
        cmocka_unit_test(test_splinters),
        cmocka_unit_test(test_too_small),   cmocka_unit_test(test_bad_arguments),
        cmocka_unit_test(test_faults),      cmocka_unit_test(test_same_bytes),
        cmocka_unit_test(test_steps),       cmocka_unit_test(test_reports),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
