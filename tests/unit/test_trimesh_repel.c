/* test_trimesh_repel.c - points that repel each other, step by step, and after a cut
   SPDX-License-Identifier: MIT OR Unlicense                                                    */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "trimesh_relax.h"
#include "testkit.h"

enum { MOST_V = 20000, MOST_F = 40000 };

/* ---- surfaces ---- */

typedef struct shape {
    float p[3 * MOST_V];
    uint32_t f[3 * MOST_F];
    uint32_t nv, nf;
} shape;

static shape one, two;

static uint32_t add_point(shape *s, double x, double y, double z) {
    assert_true(s->nv < MOST_V);
    s->p[3 * s->nv] = (float)x;
    s->p[3 * s->nv + 1] = (float)y;
    s->p[3 * s->nv + 2] = (float)z;
    return s->nv++;
}
static void add_face(shape *s, uint32_t a, uint32_t b, uint32_t c) {
    assert_true(s->nf < MOST_F);
    s->f[3 * s->nf] = a;
    s->f[3 * s->nf + 1] = b;
    s->f[3 * s->nf++ + 2] = c;
}

/* A net of n by m points, each side closed to a ring or not. */
static void add_net(shape *s, uint32_t n, uint32_t m, int ring_n, int ring_m,
                    void (*at)(double u, double v, double *p)) {
    const uint32_t first = s->nv;
    for (uint32_t i = 0; i < n; i++) {
        for (uint32_t j = 0; j < m; j++) {
            double p[3];
            at((double)i / (ring_n ? n : n - 1), (double)j / (ring_m ? m : m - 1), p);
            add_point(s, p[0], p[1], p[2]);
        }
    }
    for (uint32_t i = 0; i + 1 < n + (ring_n ? 1u : 0u); i++) {
        for (uint32_t j = 0; j + 1 < m + (ring_m ? 1u : 0u); j++) {
            const uint32_t a = first + i * m + j, b = first + (i + 1) % n * m + j;
            const uint32_t c = first + (i + 1) % n * m + (j + 1) % m;
            const uint32_t d = first + i * m + (j + 1) % m;
            add_face(s, a, b, c);
            add_face(s, a, c, d);
        }
    }
}

static void at_torus(double u, double v, double *p) {
    const double a = 2 * TXM_PI * u, b = 2 * TXM_PI * v;
    p[0] = (1 + 0.4 * cos(b)) * cos(a);
    p[1] = (1 + 0.4 * cos(b)) * sin(a);
    p[2] = 0.4 * sin(b);
}
static void at_grid(double u, double v, double *p) {
    p[0] = u;
    p[1] = v;
    p[2] = 0.1 * sin(6 * u) * cos(5 * v);
}
static void at_sheet(double u, double v, double *p) {
    p[0] = u;
    p[1] = v;
    p[2] = 0;
}
static void at_sheet_above(double u, double v, double *p) {
    p[0] = u;
    p[1] = v;
    p[2] = 0.004;
}

static void add_box(shape *s, double x, double y, double z, double w, double h, double d) {
    static const uint32_t faces[12][3] = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6},
                                          {0, 1, 4}, {1, 5, 4}, {2, 6, 3}, {3, 6, 7},
                                          {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
    const uint32_t first = s->nv;
    for (int k = 0; k < 8; k++)
        add_point(s, x + (k & 1 ? w : 0), y + (k & 2 ? h : 0), z + (k & 4 ? d : 0));
    for (int k = 0; k < 12; k++)
        add_face(s, first + faces[k][0], first + faces[k][1], first + faces[k][2]);
}

/* a cube whose sides are nets, pushed out to a ball */
static void add_ball(shape *s, uint32_t n, double x, double y, double z) {
    const uint32_t first = s->nv;
    for (int side = 0; side < 6; side++) {
        const int k = side / 2;
        const double sign = side % 2 ? -1 : 1;
        const uint32_t base = s->nv;
        for (uint32_t i = 0; i <= n; i++) {
            for (uint32_t j = 0; j <= n; j++) {
                double q[3];
                q[k] = sign;
                q[(k + 1) % 3] = sign * (2.0 * i / n - 1);
                q[(k + 2) % 3] = 2.0 * j / n - 1;
                const double r = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]);
                add_point(s, q[0] / r + x, q[1] / r + y, q[2] / r + z);
            }
        }
        for (uint32_t i = 0; i < n; i++) {
            for (uint32_t j = 0; j < n; j++) {
                const uint32_t a = base + i * (n + 1) + j, b = a + n + 1;
                add_face(s, a, b, b + 1);
                add_face(s, a, b + 1, a + 1);
            }
        }
    }
    /* seams: give equal places equal bits, the retiler welds them */
    for (uint32_t i = first; i < s->nv; i++) {
        for (uint32_t j = first; j < i; j++) {
            const float *a = s->p + 3 * i, *b = s->p + 3 * j;
            if (fabsf(a[0] - b[0]) + fabsf(a[1] - b[1]) + fabsf(a[2] - b[2]) > 1e-5f) continue;
            memcpy(s->p + 3 * i, b, 3 * sizeof(float));
            break;
        }
    }
}

/* where the edge from a to b meets z = h; each edge once */
static uint32_t cut_point(shape *to, const float *a, const float *b, double h) {
    if (memcmp(a, b, 3 * sizeof(float)) > 0) { /* the same from both sides */
        const float *t = a;
        a = b;
        b = t;
    }
    const double u = (h - a[2]) / ((double)b[2] - a[2]);
    return add_point(to, a[0] + u * ((double)b[0] - a[0]), a[1] + u * ((double)b[1] - a[1]), h);
}

/* The part of a ball around 0 below (sign -1) or above z = h, closed by a disc: unwelded. */
static void cut_ball(const shape *from, shape *to, double h, double sign) {
    for (uint32_t f = 0; f < from->nf; f++) {
        const float *p[3];
        int in[3], count = 0;
        for (int k = 0; k < 3; k++) {
            p[k] = from->p + 3 * from->f[3 * f + (uint32_t)k];
            in[k] = sign * (p[k][2] - h) > 0;
            count += in[k];
        }
        if (count == 0) continue;
        int k = 0; /* the corner that is alone on its side */
        while (count < 3 && in[k] != (count == 1)) k++;
        const float *a = p[k], *b = p[(k + 1) % 3], *c = p[(k + 2) % 3];
        const uint32_t ia = add_point(to, a[0], a[1], a[2]);
        if (count == 3) {
            add_face(to, ia, add_point(to, b[0], b[1], b[2]), add_point(to, c[0], c[1], c[2]));
            continue;
        }
        const uint32_t x = cut_point(to, a, b, h), y = cut_point(to, a, c, h);
        if (count == 1) {
            add_face(to, ia, x, y);
            add_face(to, y, x, add_point(to, 0, 0, h));
        } else {
            const uint32_t ib = add_point(to, b[0], b[1], b[2]);
            const uint32_t ic = add_point(to, c[0], c[1], c[2]);
            add_face(to, x, ib, ic);
            add_face(to, x, ic, y);
            add_face(to, x, y, add_point(to, 0, 0, h));
        }
    }
}

/* ---- what a mesh must be ---- */

typedef struct facts {
    long euler, components, border;
    int manifold;
} facts;

static uint32_t root_of(uint32_t *parent, uint32_t v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
}

/* Every directed edge once; around each vertex one fan. */
static facts examine(const trimesh_mesh *m) {
    facts r = {0, 0, 0, 1};
    const size_t n = m->vertex_count, c = 3 * m->triangle_count;
    size_t size = 16, edges = 0;
    while (size < 2 * c) size *= 2;
    uint64_t *table = (uint64_t *)calloc(size, sizeof *table);
    uint32_t *parent = (uint32_t *)malloc(n * sizeof *parent);
    uint32_t *fan = (uint32_t *)malloc(c * sizeof *fan); /* corners joined over inner edges */
    uint32_t *corner_of = (uint32_t *)malloc(size * sizeof *corner_of);
    assert_true(table && parent && fan && corner_of);
    for (uint32_t i = 0; i < n; i++) parent[i] = i;
    for (uint32_t i = 0; i < c; i++) fan[i] = i;
    for (size_t pass = 0; pass < 2; pass++) {
        for (uint32_t i = 0; i < c; i++) {
            const uint32_t next = i % 3 == 2 ? i - 2 : i + 1;
            const uint64_t a = m->indices[i], b = m->indices[next];
            const uint64_t key = (pass ? b << 32 | a : a << 32 | b) + 1;
            size_t at = (size_t)txm_hash(key) & (size - 1);
            while (table[at] && table[at] != key) at = (at + 1) & (size - 1);
            if (pass == 0) {
                if (a == b || a >= n || table[at]) r.manifold = 0;
                table[at] = key;
                corner_of[at] = i;
                parent[root_of(parent, (uint32_t)a)] = root_of(parent, (uint32_t)b);
            } else if (table[at]) { /* edge i -> next here, j -> jnext = b -> a there */
                const uint32_t j = corner_of[at], jn = j % 3 == 2 ? j - 2 : j + 1;
                fan[root_of(fan, i)] = root_of(fan, jn);
                fan[root_of(fan, next)] = root_of(fan, j);
                edges += a < b;
            } else {
                edges++;
                r.border++;
            }
        }
    }
    size_t fans = 0, used = 0;
    for (uint32_t i = 0; i < c; i++) fans += fan[i] == i;
    for (uint32_t i = 0; i < n; i++) r.components += parent[i] == i;
    memset(parent, 0, n * sizeof *parent);
    for (uint32_t i = 0; i < c; i++) used += !parent[m->indices[i]]++;
    if (fans != n || used != n) r.manifold = 0;
    r.euler = (long)n - (long)edges + (long)m->triangle_count;
    free(table);
    free(parent);
    free(fan);
    free(corner_of);
    return r;
}

static trimesh_desc describe(const shape *s, size_t vertices) {
    trimesh_desc d;
    memset(&d, 0, sizeof d);
    d.surface.positions = s->p;
    d.surface.indices = s->f;
    d.surface.vertex_count = s->nv;
    d.surface.face_count = s->nf;
    d.vertices = vertices;
    d.method = TRIMESH_REPEL;
    return d;
}

static trimesh_mesh *retile(const shape *s, size_t vertices) {
    trimesh_desc d = describe(s, vertices);
    trimesh_mesh *m = NULL;
    txm_env env;
    memset(&env, 0, sizeof env);
    const txm_status status = trimesh_retile(&d, &env, &m);
    if (status != TXM_OK) print_message("%s\n", env.message);
    assert_int_equal(status, TXM_OK);
    assert_int_equal(m->vertex_count, vertices);
    assert_true(examine(m).manifold);
    return m;
}

static void clear(shape *s) {
    s->nv = s->nf = 0;
}

static uint64_t hash_mesh(const trimesh_mesh *m) {
    uint64_t h = tk_hash(0, m->positions, 3 * m->vertex_count * sizeof(float));
    h = tk_hash(h, m->normals, 3 * m->vertex_count * sizeof(float));
    h = tk_hash(h, m->kinds, m->vertex_count);
    return tk_hash(h, m->indices, 3 * m->triangle_count * sizeof(uint32_t));
}

static double edge(const trimesh_mesh *m, size_t i, size_t j) {
    double d = 0;
    for (int k = 0; k < 3; k++) {
        const double x = (double)m->positions[3 * i + (size_t)k] - m->positions[3 * j + (size_t)k];
        d += x * x;
    }
    return sqrt(d);
}

/* mean of 2 inradius / circumradius */
static double quality(const trimesh_mesh *m) {
    double sum = 0;
    for (size_t t = 0; t < m->triangle_count; t++) {
        const uint32_t *v = m->indices + 3 * t;
        const double a = edge(m, v[0], v[1]), b = edge(m, v[1], v[2]), c = edge(m, v[2], v[0]);
        sum += (b + c - a) * (c + a - b) * (a + b - c) / (a * b * c);
    }
    return sum / (double)m->triangle_count;
}

/* ---- topology and number ---- */

static void test_closed(void **state) {
    (void)state;
    static const size_t counts[] = {4, 12, 100, 3000};
    for (int k = 0; k < 4; k++) {
        clear(&one);
        add_ball(&one, 12, 0, 0, 0);
        trimesh_mesh *m = retile(&one, counts[k]);
        const facts f = examine(m);
        assert_int_equal(f.euler, 2);
        assert_int_equal(f.components, 1);
        assert_int_equal(f.border, 0);
        if (k > 1) assert_true(quality(m) > 0.96);
        trimesh_mesh_free(m);
    }
    clear(&one);
    add_net(&one, 60, 30, 1, 1, at_torus);
    for (int k = 2; k < 4; k++) {
        trimesh_mesh *m = retile(&one, counts[k]);
        assert_int_equal(examine(m).euler, 0);
        assert_int_equal(examine(m).border, 0);
        trimesh_mesh_free(m);
    }
}

static void test_open(void **state) {
    (void)state;
    clear(&one);
    add_net(&one, 40, 30, 0, 0, at_grid);
    trimesh_mesh *m = retile(&one, 800);
    const facts f = examine(m);
    size_t corners = 0, border = 0;
    assert_int_equal(f.euler, 1);
    for (size_t i = 0; i < m->vertex_count; i++) {
        const float *p = m->positions + 3 * i;
        corners += m->kinds[i] == TRIMESH_CORNER;
        if (m->kinds[i] != TRIMESH_BORDER) continue;
        border++;
        assert_true(p[0] < 1e-5f || p[0] > 1 - 1e-5f || p[1] < 1e-5f || p[1] > 1 - 1e-5f);
    }
    assert_int_equal(corners, 4);
    assert_int_equal(f.border, corners + border);
    assert_true(border > 80 && border < 140);
    trimesh_mesh_free(m);
}

static void test_cube(void **state) {
    (void)state;
    clear(&one);
    add_box(&one, 0, 0, 0, 1, 1, 1);
    static const size_t counts[] = {8, 40, 2000};
    for (int k = 0; k < 3; k++) {
        trimesh_mesh *m = retile(&one, counts[k]);
        size_t corners = 0;
        assert_int_equal(examine(m).euler, 2);
        for (size_t i = 0; i < m->vertex_count; i++) {
            int sides = 0;
            for (size_t j = 0; j < 3; j++) {
                const float x = m->positions[3 * i + j];
                sides += x < 1e-5f || x > 1 - 1e-5f;
            }
            corners += sides == 3;
            assert_int_equal(m->kinds[i], sides == 3   ? TRIMESH_CORNER
                                          : sides == 2 ? TRIMESH_CREASE
                                                       : TRIMESH_FREE);
        }
        assert_int_equal(corners, 8);
        trimesh_mesh_free(m);
    }
}

static void test_two_components(void **state) {
    (void)state;
    clear(&one);
    add_ball(&one, 10, 0, 0, 0);
    add_box(&one, 3, 0, 0, 0.05, 0.05, 0.05); /* too small for a share by area */
    trimesh_mesh *m = retile(&one, 500);
    const facts f = examine(m);
    assert_int_equal(f.components, 2);
    assert_int_equal(f.euler, 4);
    trimesh_mesh_free(m);
}

/* No edge from one sheet to the other, and both get their share. */
static void test_thin(void **state) {
    (void)state;
    clear(&one);
    add_net(&one, 20, 20, 0, 0, at_sheet);
    add_net(&one, 20, 20, 0, 0, at_sheet_above);
    trimesh_mesh *m = retile(&one, 600);
    assert_int_equal(examine(m).components, 2);
    assert_int_equal(examine(m).euler, 2);
    size_t above = 0;
    for (size_t i = 0; i < m->vertex_count; i++) above += m->positions[3 * i + 2] > 0.002f;
    assert_true(above > 280 && above < 320);
    trimesh_mesh_free(m);

    clear(&one); /* a plate: what is joined only around its rim */
    add_box(&one, 0, 0, 0, 1, 1, 0.004);
    m = retile(&one, 1000);
    assert_int_equal(examine(m).euler, 2);
    for (size_t t = 0; t < m->triangle_count; t++) { /* none through it */
        size_t up = 0, free_ones = 0;
        for (size_t k = 0; k < 3; k++) {
            const size_t v = m->indices[3 * t + k];
            up += m->positions[3 * v + 2] > 0.002f && m->kinds[v] == TRIMESH_FREE;
            free_ones += m->kinds[v] == TRIMESH_FREE;
        }
        assert_true(up == 0 || up == free_ones);
    }
    trimesh_mesh_free(m);
}

/* the scale map: edges twice as long where it says so */
static void test_scale(void **state) {
    (void)state;
    static float scale[MOST_V];
    clear(&one);
    add_net(&one, 60, 30, 1, 1, at_torus);
    for (uint32_t i = 0; i < one.nv; i++) scale[i] = 1 + 0.5f * (one.p[3 * i] + 1.4f) / 1.4f;
    trimesh_desc d = describe(&one, 2000);
    d.scale = scale;
    trimesh_mesh *m = NULL;
    assert_int_equal(trimesh_retile(&d, NULL, &m), TXM_OK);
    double sum[2] = {0, 0};
    int count[2] = {0, 0};
    for (size_t c = 0; c < 3 * m->triangle_count; c++) {
        const size_t i = m->indices[c], j = m->indices[c % 3 == 2 ? c - 2 : c + 1];
        const float x = m->positions[3 * i];
        if (fabsf(x) < 1) continue;
        sum[x > 0] += edge(m, i, j);
        count[x > 0]++;
    }
    const double ratio = sum[1] / count[1] / (sum[0] / count[0]); /* 1.93 to 1.07, about */
    assert_true(ratio > 1.5 && ratio < 2.1);
    trimesh_mesh_free(m);
}

/* ---- steps ---- */

static void test_steps(void **state) {
    (void)state;
    clear(&one);
    add_net(&one, 40, 20, 1, 1, at_torus);
    for (int method = 0; method < 2; method++) {
        trimesh_desc d = describe(&one, 700);
        trimesh_mesh *whole = NULL, *stepped = NULL;
        trimesh_job *job = NULL;
        trimesh_state s;
        tk_progress progress;
        txm_env env;
        int rounds = 0, more = 1;
        memset(&progress, 0, sizeof progress);
        env = tk_env(NULL, &progress);
        d.method = (trimesh_method)method;
        assert_int_equal(trimesh_retile(&d, NULL, &whole), TXM_OK);
        assert_int_equal(trimesh_begin(&d, &env, &job), TXM_OK);
        for (; more; rounds++) {
            assert_int_equal(trimesh_step(job, &env, &more), TXM_OK);
            if (rounds % 3 == 2) continue; /* not looked at */
            assert_int_equal(trimesh_get_state(job, &env, &s), TXM_OK);
            if (strcmp(s.stage, "repel") == 0) {
                assert_int_equal(s.points, 700);
                assert_int_equal(s.triangles, 1400);
            }
            for (size_t i = 0; i < 3 * s.triangles; i++) assert_true(s.indices[i] < s.points);
            for (size_t i = 0; i < 3 * s.points; i++) assert_true(fabsf(s.positions[i]) < 1.5f);
        }
        assert_int_equal(progress.errors, 0); /* 0 to 1, never falling */
        assert_true(progress.calls >= rounds);
        more = 1;
        assert_int_equal(trimesh_step(job, NULL, &more), TXM_OK); /* nothing more to do */
        assert_int_equal(more, 0);
        assert_int_equal(trimesh_get_mesh(job, NULL, &stepped), TXM_OK);
        trimesh_free(job);
        assert_true(hash_mesh(whole) == hash_mesh(stepped));
        trimesh_mesh_free(whole);
        trimesh_mesh_free(stepped);
        assert_int_equal(trimesh_begin(&d, NULL, &job), TXM_OK);
        assert_int_equal(trimesh_step(job, NULL, NULL), TXM_OK);
        trimesh_free(job); /* half way */
    }
    trimesh_free(NULL);
}

/* The movement dies down; the points get to even distances. */
static void test_convergence(void **state) {
    (void)state;
    clear(&one);
    add_ball(&one, 16, 0, 0, 0);
    trimesh_desc d = describe(&one, 1500);
    trimesh_job *job = NULL;
    trimesh_state s;
    float first = 0, last = 0;
    int rounds = 0, more = 1;
    d.iterations = 60;
    assert_int_equal(trimesh_begin(&d, NULL, &job), TXM_OK);
    while (more) {
        assert_int_equal(trimesh_step(job, NULL, &more), TXM_OK);
        assert_int_equal(trimesh_get_state(job, NULL, &s), TXM_OK);
        if (s.round == 1) first = s.mean;
        last = s.mean;
        rounds = s.round;
    }
    assert_true(rounds > 10 && rounds <= 60);
    assert_true(first > 0.1f && last < 0.01f);
    trimesh_free(job);
}

/* ---- the same bytes ---- */

static void test_same_bytes(void **state) {
    (void)state;
    clear(&one);
    add_net(&one, 60, 40, 1, 1, at_torus);
    uint64_t hash[3];
    for (int k = 0; k < 3; k++) {
        trimesh_desc d = describe(&one, 6000);
        trimesh_mesh *m = NULL;
        txm_env env = tk_env(NULL, NULL);
        if (k == 1) env.parallel_for = tk_parallel_reverse;
        if (k == 2) env.parallel_for = tk_parallel_threads;
        d.iterations = 8;
        assert_int_equal(trimesh_retile(&d, &env, &m), TXM_OK);
        hash[k] = hash_mesh(m);
        trimesh_mesh_free(m);
    }
    assert_true(hash[0] == hash[1] && hash[0] == hash[2]);
}

/* ---- updates ---- */

/* Every old vertex that did not move, and how many those are. */
static size_t count_still(const trimesh_mesh *old, const trimesh_mesh *m) {
    const int32_t *map = m->old_vertices;
    size_t still = 0;
    uint8_t *seen = (uint8_t *)calloc(old->vertex_count, 1);
    assert_non_null(seen);
    for (size_t i = 0; i < m->vertex_count; i++) {
        assert_true(map[i] >= -1 && map[i] < (int32_t)old->vertex_count);
        if (map[i] < 0) continue;
        assert_false(seen[map[i]]); /* each once */
        seen[map[i]] = 1;
        still += memcmp(m->positions + 3 * i, old->positions + 3 * (size_t)map[i], 12) == 0;
    }
    free(seen);
    return still;
}

static void test_update_same(void **state) {
    (void)state;
    for (int k = 0; k < 3; k++) {
        clear(&one);
        if (k == 0) add_ball(&one, 12, 0, 0, 0);
        if (k == 1) add_box(&one, 0, 0, 0, 1, 1, 1);
        if (k == 2) add_net(&one, 40, 30, 0, 0, at_grid);
        trimesh_mesh *old = retile(&one, 900), *m = NULL;
        trimesh_update_desc u;
        memset(&u, 0, sizeof u);
        u.desc = describe(&one, 0);
        assert_int_equal(trimesh_update(old, &u, NULL, &m), TXM_OK);
        assert_true(examine(m).manifold);
        print_message("same surface %d: %d of 900, %d still\n", k, (int)m->vertex_count,
                      (int)count_still(old, m));
        assert_true(m->vertex_count >= 890 && m->vertex_count <= 910);
        assert_true(count_still(old, m) >= 850);
        trimesh_mesh_free(m);
        trimesh_mesh_free(old);
    }
}

/* A surface that takes hundreds of thousands of vertices at the density of the old mesh can be left while
   they are strewn; one that takes too many is refused at once. */
static void test_update_large(void **state) {
    (void)state;
    clear(&one);
    add_ball(&one, 12, 0, 0, 0);
    trimesh_mesh *old = retile(&one, 100), *m = NULL;
    const float sizes[2] = {60, 1e4f};
    for (int k = 0; k < 2; k++) {
        clear(&two);
        add_ball(&two, 12, 0, 0, 0);
        for (uint32_t i = 0; i < 3 * two.nv; i++) two.p[i] *= sizes[k];
        trimesh_update_desc u;
        tk_progress progress;
        memset(&u, 0, sizeof u);
        memset(&progress, 0, sizeof progress);
        progress.cancel_at = k ? 0 : 30;
        txm_env env = tk_env(NULL, &progress);
        u.desc = describe(&two, 0);
        assert_int_equal(trimesh_update(old, &u, &env, &m), k ? TXM_TOO_LARGE : TXM_CANCELLED);
        assert_null(m);
        assert_true(progress.errors == 0 && progress.late == 0);
        if (k) assert_non_null(strstr(env.message, "say how many"));
    }
    trimesh_mesh_free(old);
}

static void test_update_cut(void **state) {
    (void)state;
    const double h = 0.3;
    clear(&one);
    add_ball(&one, 16, 0, 0, 0);
    trimesh_mesh *old = retile(&one, 2000);
    for (int half = 0; half < 2; half++) {
        clear(&two);
        cut_ball(&one, &two, h, half ? 1 : -1);
        trimesh_update_desc u;
        trimesh_mesh *m = NULL;
        trimesh_report report;
        txm_env env = tk_env(NULL, NULL);
        memset(&u, 0, sizeof u);
        u.desc = describe(&two, 0);
        u.desc.report = &report;
        const txm_status status = trimesh_update(old, &u, &env, &m);
        assert_int_equal(report.components, 1);
        if (status != TXM_OK) print_message("%s\n", env.message);
        assert_int_equal(status, TXM_OK);
        const facts f = examine(m);
        assert_true(f.manifold);
        assert_int_equal(f.euler, 2);
        assert_int_equal(f.border, 0);
        assert_int_equal(f.components, 1);
        size_t far_ones = 0, far_still = 0, seam = 0;
        for (size_t i = 0; i < old->vertex_count; i++) {
            const double z = old->positions[3 * i + 2];
            far_ones += half ? z > h + 8 * old->edge_length : z < h - 8 * old->edge_length;
        }
        for (size_t i = 0; i < m->vertex_count; i++) {
            const float *p = m->positions + 3 * i;
            const int far = half ? p[2] > h + 8 * old->edge_length : p[2] < h - 8 * old->edge_length;
            seam += fabs(p[2] - h) < 1e-4;
            far_still += far && m->old_vertices[i] >= 0 &&
                         memcmp(p, old->positions + 3 * (size_t)m->old_vertices[i], 12) == 0;
        }
        print_message("half %d: %d vertices, quality %.4f, far %d still %d, all still %d\n", half,
                      (int)m->vertex_count, quality(m), (int)far_ones, (int)far_still,
                      (int)count_still(old, m));
        assert_int_equal(far_still, far_ones);
        assert_true(seam > 100);
        assert_true(quality(m) > 0.95);
        /* as dense as before: area of the part and of its disc */
        const double part = 2 * TXM_PI * (half ? 1 - h : 1 + h) + TXM_PI * (1 - h * h);
        assert_true(fabs((double)m->vertex_count / (2000 * part / (4 * TXM_PI)) - 1) < 0.08);
        trimesh_mesh_free(m);

        u.desc.vertices = (size_t)(2000 * part / (4 * TXM_PI));
        assert_int_equal(trimesh_update(old, &u, &env, &m), TXM_OK);
        assert_int_equal(m->vertex_count, u.desc.vertices);
        assert_true(examine(m).manifold);
        trimesh_mesh_free(m);
    }
    trimesh_mesh_free(old);
}

/* ---- bad arguments, no memory, cancel ---- */

static void test_arguments(void **state) {
    (void)state;
    clear(&one);
    add_ball(&one, 4, 0, 0, 0);
    trimesh_desc d = describe(&one, 50);
    trimesh_job *job = (trimesh_job *)&one;
    trimesh_mesh *m = (trimesh_mesh *)&one;
    trimesh_update_desc u;
    trimesh_state s;
    assert_int_equal(trimesh_begin(NULL, NULL, &job), TXM_BAD_ARGUMENT);
    assert_null(job);
    assert_int_equal(trimesh_begin(&d, NULL, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(trimesh_step(NULL, NULL, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(trimesh_get_mesh(NULL, NULL, &m), TXM_BAD_ARGUMENT);
    assert_null(m);
    assert_int_equal(trimesh_get_state(NULL, NULL, &s), TXM_BAD_ARGUMENT);
    assert_null(s.stage);
    d.iterations = 1001;
    assert_int_equal(trimesh_begin(&d, NULL, &job), TXM_BAD_ARGUMENT);
    d.iterations = 0;
    d.crease_angle = -1;
    assert_int_equal(trimesh_begin(&d, NULL, &job), TXM_BAD_ARGUMENT);
    d.crease_angle = 0;
    d.vertices = 3;
    assert_int_equal(trimesh_begin(&d, NULL, &job), TXM_TOO_SMALL);
    d.vertices = 50;
    assert_int_equal(trimesh_begin(&d, NULL, &job), TXM_OK);
    assert_int_equal(trimesh_get_mesh(job, NULL, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(trimesh_get_state(job, NULL, NULL), TXM_BAD_ARGUMENT);
    trimesh_free(job);
    memset(&u, 0, sizeof u);
    u.desc = d;
    assert_int_equal(trimesh_update(NULL, &u, NULL, &m), TXM_BAD_ARGUMENT);
    trimesh_mesh *old = retile(&one, 50);
    u.radius = 0.5f;
    assert_int_equal(trimesh_update(old, &u, NULL, &m), TXM_BAD_ARGUMENT);
    assert_int_equal(trimesh_update(old, NULL, NULL, &m), TXM_BAD_ARGUMENT);
    trimesh_mesh_free(old);
}

/* All calls of a job, looked at after each step. */
static txm_status run_job(void *context, txm_env *env) {
    trimesh_mesh *m = NULL;
    trimesh_job *job = NULL;
    trimesh_desc d = describe((const shape *)context, 40);
    int more = 1;
    d.iterations = 2;
    txm_status status = trimesh_begin(&d, env, &job);
    while (status == TXM_OK && more) {
        trimesh_state s;
        status = trimesh_step(job, env, &more);
        if (status == TXM_OK) status = trimesh_get_state(job, env, &s);
    }
    if (status == TXM_OK) status = trimesh_get_mesh(job, env, &m);
    assert_true((status == TXM_OK) == (m != NULL));
    trimesh_free(job);
    trimesh_mesh_free(m);
    return status;
}

static txm_status run_update(void *context, txm_env *env) {
    trimesh_mesh *m = NULL;
    trimesh_update_desc u;
    memset(&u, 0, sizeof u);
    u.desc = describe(&two, 0);
    const txm_status status = trimesh_update((const trimesh_mesh *)context, &u, env, &m);
    assert_true((status == TXM_OK) == (m != NULL));
    trimesh_mesh_free(m);
    return status;
}

static void test_faults(void **state) {
    (void)state;
    clear(&one);
    add_ball(&one, 4, 0, 0, 0);
    clear(&two);
    cut_ball(&one, &two, 0.1, -1);
    trimesh_mesh *old = retile(&one, 40);
    for (int what = 0; what < 2; what++) {
        tk_call *call = what ? run_update : run_job;
        void *context = what ? (void *)old : (void *)&one;
        assert_true(tk_sweep(call, context, TK_ALLOCATION) > 60);
        assert_true(tk_sweep(call, context, TK_ONWARD) > 60);
        assert_true(tk_sweep(call, context, TK_CANCEL) > 10);
    }
    trimesh_mesh_free(old);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_closed),        cmocka_unit_test(test_open),
        cmocka_unit_test(test_cube),          cmocka_unit_test(test_two_components),
        cmocka_unit_test(test_thin),          cmocka_unit_test(test_scale),
        cmocka_unit_test(test_steps),         cmocka_unit_test(test_convergence),
        cmocka_unit_test(test_same_bytes),    cmocka_unit_test(test_update_same),
        cmocka_unit_test(test_update_large),
        cmocka_unit_test(test_update_cut),    cmocka_unit_test(test_arguments),
        cmocka_unit_test(test_faults),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
