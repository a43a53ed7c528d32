/* retilekit.h - surfaces of known topology, and all that a retiled mesh must be
   SPDX-License-Identifier: MIT OR Unlicense

   Include cmocka.h and trimesh_relax.h first. make_* builds a surface in `in`; made() retiles it and
   checks the result as a whole.                                                                 */
#ifndef RETILEKIT_H
#define RETILEKIT_H

#include "surfaces.h"
#include "testkit.h"

enum { MOST_FOUND = 8000 };

static const trimesh_method both[2] = {TRIMESH_LATTICE, TRIMESH_REPEL};

/* ---- made surfaces ------------------------------------------------------------------------ */

static inline void begin(long euler, size_t components, size_t loops) {
    in.vertices = in.triangles = 0;
    in.euler = euler;
    in.components = components;
    in.loops = loops;
}

/* An octahedron whose sides are cut into n^2 triangles, pushed out to a ball. Sides share no
   vertices: it is welded where it is read. */
static inline void add_ball(int n, double radius, double x, double y, double z) {
    for (int side = 0; side < 8; side++) {
        const double sx = side & 1 ? -1 : 1, sy = side & 2 ? -1 : 1, sz = side & 4 ? -1 : 1;
        const int turned = sx * sy * sz < 0;
        const uint32_t first = (uint32_t)in.vertices;
        for (int i = 0; i <= n; i++) {
            for (int j = 0; i + j <= n; j++) {
                const double l = sqrt((double)(i * i + j * j + (n - i - j) * (n - i - j)));
                vertex(x + sx * radius * i / l, y + sy * radius * j / l,
                       z + sz * radius * (n - i - j) / l);
            }
        }
        for (int i = 0; i < n; i++) {
            for (int j = 0; i + j < n; j++) {
                const uint32_t a = first + (uint32_t)(i * (n + 1) - i * (i - 1) / 2 + j);
                const uint32_t b = a + (uint32_t)(n + 1 - i); /* (i + 1, j) */
                if (turned) triangle(a, a + 1, b);
                else triangle(a, b, a + 1);
                if (i + j + 1 == n) continue;
                if (turned) triangle(a + 1, b + 1, b);
                else triangle(a + 1, b, b + 1);
            }
        }
    }
}

static inline void make_ball(int n) {
    begin(2, 1, 0);
    add_ball(n, 1, 0, 0, 0);
}

static inline void make_cube(void) {
    begin(2, 1, 0);
    add_box(0, 0, 0, 1, 1, 1);
}

static inline void make_torus(int n, int m) {
    begin(0, 1, 0);
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < m; j++) {
            const double u = 2 * TXM_PI * i / n, v = 2 * TXM_PI * j / m;
            vertex((1 + 0.4 * cos(v)) * cos(u), (1 + 0.4 * cos(v)) * sin(u), 0.4 * sin(v));
        }
    }
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < m; j++) {
            const int i1 = (i + 1) % n, j1 = (j + 1) % m;
            quad((uint32_t)(i * m + j), (uint32_t)(i1 * m + j), (uint32_t)(i1 * m + j1),
                 (uint32_t)(i * m + j1));
        }
    }
}

/* A wavy sheet of n * n squares with a square hole in the middle. */
static inline void make_sheet(int n) {
    begin(0, 1, 2);
    for (int i = 0; i <= n; i++)
        for (int j = 0; j <= n; j++)
            vertex((double)i / n, (double)j / n, 0.08 * sin(5.0 * i / n) * cos(4.0 * j / n));
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) {
            const uint32_t a = (uint32_t)(i * (n + 1) + j), b = a + (uint32_t)(n + 1);
            if (3 * i >= n && 3 * i < 2 * n && 3 * j >= n && 3 * j < 2 * n) continue;
            quad(a, b, b + 1, a + 1);
        }
    }
}

/* Two rings in a figure of eight, inside where this is below 0. */
static inline double eight(double x, double y, double z) {
    const double f = x * x * (1 - x * x) - y * y;
    return f * f + 0.5 * z * z - 0.02;
}

/* Where it is 0 on the edge from a to b: points of the grid, value in the fourth. */
static inline uint32_t between(const double *a, const double *b) {
    const double *p = a, *q = b;
    for (int k = 0; k < 3; k++) { /* in one order, so that neighbours find the same bits */
        if (a[k] < b[k]) break;
        if (a[k] > b[k]) {
            p = b;
            q = a;
            break;
        }
    }
    const double s = p[3] / (p[3] - q[3]);
    return vertex(p[0] + s * (q[0] - p[0]), p[1] + s * (q[1] - p[1]), p[2] + s * (q[2] - p[2]));
}

static inline void cut_tetrahedron(const double *const p[4]) {
    const double *low[4], *high[4];
    int below = 0, above = 0;
    for (int k = 0; k < 4; k++) {
        if (p[k][3] < 0) low[below++] = p[k];
        else high[above++] = p[k];
    }
    if (below == 0 || above == 0) return;
    const size_t first = in.triangles;
    if (below == 2) {
        quad(between(low[0], high[0]), between(low[0], high[1]), between(low[1], high[1]),
             between(low[1], high[0]));
    } else {
        const double *const *three = below == 1 ? high : low;
        const double *one = below == 1 ? low[0] : high[0];
        triangle(between(one, three[0]), between(one, three[1]), between(one, three[2]));
    }
    for (size_t t = first; t < in.triangles; t++) { /* counter-clockwise seen from above */
        uint32_t *v = in.t + 3 * t;
        double a[3], b[3], c[3], n[3];
        for (int k = 0; k < 3; k++) {
            a[k] = in.at[3 * v[0] + (uint32_t)k];
            b[k] = (double)in.at[3 * v[1] + (uint32_t)k] - a[k];
            c[k] = (double)in.at[3 * v[2] + (uint32_t)k] - a[k];
        }
        for (int k = 0; k < 3; k++)
            n[k] = b[(k + 1) % 3] * c[(k + 2) % 3] - b[(k + 2) % 3] * c[(k + 1) % 3];
        double up = 0;
        for (int k = 0; k < 3; k++) up += n[k] * (high[0][k] - low[0][k]);
        if (up < 0) {
            const uint32_t swap = v[1];
            v[1] = v[2];
            v[2] = swap;
        }
    }
}

/* Marching tetrahedra: six round the diagonal of each cell. A soup without shared vertices. */
static inline void make_eight(int n) {
    static const int path[6][2] = {{1, 3}, {3, 2}, {2, 6}, {6, 4}, {4, 5}, {5, 1}};
    const double step = 2.6 / n;
    begin(-2, 1, 0);
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n / 2; j++) {
            for (int k = 0; k < n / 4 + 2; k++) {
                double p[8][4];
                for (int c = 0; c < 8; c++) {
                    p[c][0] = -1.3 + step * (i + (c & 1)) + 0.001;
                    p[c][1] = -0.65 + step * (j + (c >> 1 & 1)) + 0.002;
                    p[c][2] = -0.325 + step * (k - 1 + (c >> 2)) + 0.003;
                    p[c][3] = eight(p[c][0], p[c][1], p[c][2]);
                }
                for (int s = 0; s < 6; s++) {
                    const double *const q[4] = {p[0], p[7], p[path[s][0]], p[path[s][1]]};
                    cut_tetrahedron(q);
                }
            }
        }
    }
}

/* ---- calls -------------------------------------------------------------------------------- */

static trimesh_report report;

static inline trimesh_desc describe(size_t vertices, trimesh_method method) {
    trimesh_desc d = desc_of_in(vertices);
    d.method = method;
    return d;
}

/* ---- what a mesh is ------------------------------------------------------------------------ */

typedef struct found {
    long euler;
    size_t components, loops, inside, six;
    double quality, least_quality, edge_mean, edge_cv, area, volume;
} found;

static uint64_t sides[6 * MOST_FOUND];
static uint32_t from_corner[6 * MOST_FOUND], piece[MOST_FOUND], degree[MOST_FOUND];
static uint8_t on_rim[MOST_FOUND];

typedef struct keyed {
    uint64_t key;
    uint32_t corner;
} keyed;
static keyed sorted[6 * MOST_FOUND];

static inline int compare_keyed(const void *a, const void *b) {
    const uint64_t x = ((const keyed *)a)->key, y = ((const keyed *)b)->key;
    return x < y ? -1 : x > y;
}

static size_t side_count;

/* the corner from which the directed edge a b starts, or -1 */
static inline long find_side(uint32_t a, uint32_t b) {
    const uint64_t key = (uint64_t)a << 32 | b;
    size_t low = 0, high = side_count;
    while (low < high) {
        const size_t mid = (low + high) / 2;
        if (sides[mid] < key) low = mid + 1;
        else high = mid;
    }
    return low < side_count && sides[low] == key ? (long)from_corner[low] : -1;
}

static inline uint32_t next_of(uint32_t c) {
    return c % 3 == 2 ? c - 2 : c + 1;
}

static inline uint32_t root_of(uint32_t i) {
    while (piece[i] != i) i = piece[i] = piece[piece[i]];
    return i;
}

static inline double distance(const float *p, const float *q) {
    double sum = 0;
    for (int k = 0; k < 3; k++) sum += ((double)p[k] - (double)q[k]) * ((double)p[k] - (double)q[k]);
    return sqrt(sum);
}

/* Directed edges: each once, sorted into `sides`. Returns how many have no reverse. */
static inline size_t list_sides(const trimesh_mesh *m) {
    size_t open = 0;
    side_count = 3 * m->triangle_count;
    assert_true(side_count <= 6 * MOST_FOUND);
    for (uint32_t c = 0; c < side_count; c++) {
        assert_true(m->indices[c] < m->vertex_count);
        assert_true(m->indices[c] != m->indices[next_of(c)]);
        sorted[c].key = (uint64_t)m->indices[c] << 32 | m->indices[next_of(c)];
        sorted[c].corner = c;
    }
    qsort(sorted, side_count, sizeof *sorted, compare_keyed);
    for (size_t i = 0; i < side_count; i++) {
        sides[i] = sorted[i].key;
        from_corner[i] = sorted[i].corner;
        assert_true(i == 0 || sides[i] != sides[i - 1]);
    }
    memset(on_rim, 0, sizeof on_rim);
    for (size_t i = 0; i < side_count; i++) {
        const uint32_t a = (uint32_t)(sides[i] >> 32), b = (uint32_t)(sides[i] & 0xffffffffu);
        if (find_side(b, a) >= 0) continue;
        on_rim[a] = on_rim[b] = 1;
        open++;
    }
    return open;
}

/* Every vertex is used and has one fan: turning about it from its first corner (on the rim: the one
   whose side has nothing on its right) finds all of its corners. */
static inline void check_fans(const trimesh_mesh *m) {
    static uint32_t corners[MOST_FOUND], first[MOST_FOUND];
    memset(corners, 0, sizeof corners);
    for (uint32_t c = 0; c < side_count; c++) {
        const uint32_t v = m->indices[c];
        if (corners[v]++ == 0 || find_side(m->indices[next_of(c)], v) < 0) first[v] = c;
    }
    for (uint32_t v = 0; v < m->vertex_count; v++) {
        uint32_t count = 0, c = first[v];
        assert_true(corners[v] > 0);
        do { /* across the side that comes in to v */
            const uint32_t from = m->indices[next_of(next_of(c))];
            const long beyond = find_side(v, from);
            count++;
            if (beyond < 0) break;
            c = (uint32_t)beyond;
        } while (c != first[v] && count <= corners[v]);
        assert_int_equal(count, corners[v]);
    }
}

static inline void count_pieces(const trimesh_mesh *m, size_t open, found *f) {
    size_t rims = 0;
    f->components = m->vertex_count;
    for (uint32_t i = 0; i < m->vertex_count; i++) piece[i] = i;
    for (uint32_t c = 0; c < side_count; c++) {
        const uint32_t a = root_of(m->indices[c]), b = root_of(m->indices[next_of(c)]);
        if (a != b) f->components--;
        piece[a] = b;
    }
    for (uint32_t i = 0; i < m->vertex_count; i++) {
        piece[i] = i;
        rims += on_rim[i];
    }
    assert_int_equal(rims, open); /* every vertex on the border has one border edge going out */
    f->loops = rims;
    for (size_t i = 0; i < side_count; i++) {
        const uint32_t a = (uint32_t)(sides[i] >> 32), b = (uint32_t)(sides[i] & 0xffffffffu);
        if (find_side(b, a) >= 0) continue;
        const uint32_t x = root_of(a), y = root_of(b);
        if (x != y) f->loops--;
        piece[x] = y;
    }
    f->euler = (long)m->vertex_count - (long)((side_count + open) / 2) + (long)m->triangle_count;
}

static inline void measure_shape(const trimesh_mesh *m, found *f) {
    double sum = 0, squares = 0;
    f->least_quality = 1;
    memset(degree, 0, sizeof degree);
    for (size_t t = 0; t < m->triangle_count; t++) {
        const float *p[3];
        double s[3];
        for (int k = 0; k < 3; k++) {
            const uint32_t v = m->indices[3 * t + (size_t)k];
            p[k] = m->positions + 3 * (size_t)v;
            degree[v]++;
        }
        for (int k = 0; k < 3; k++) {
            s[k] = distance(p[k], p[(k + 1) % 3]);
            sum += s[k];
            squares += s[k] * s[k];
        }
        const double excess = (s[0] + s[1] - s[2]) * (s[1] + s[2] - s[0]) * (s[2] + s[0] - s[1]);
        const double quality = excess > 0 ? excess / (s[0] * s[1] * s[2]) : 0;
        f->quality += quality;
        f->least_quality = fmin(f->least_quality, quality);
        f->area += excess > 0 ? 0.25 * sqrt(excess * (s[0] + s[1] + s[2])) : 0;
        for (int k = 0; k < 3; k++) {
            const int k1 = (k + 1) % 3, k2 = (k + 2) % 3;
            f->volume += (double)p[0][k] * ((double)p[1][k1] * (double)p[2][k2] -
                                            (double)p[1][k2] * (double)p[2][k1]) / 6;
        }
    }
    const double n = (double)side_count;
    f->quality /= (double)m->triangle_count;
    f->edge_mean = sum / n;
    f->edge_cv = sqrt(fmax(0, squares / n - f->edge_mean * f->edge_mean)) / f->edge_mean;
    for (uint32_t i = 0; i < m->vertex_count; i++) {
        if (on_rim[i]) continue;
        f->inside++;
        f->six += degree[i] == 6;
    }
}

/* The place that a source names, in the caller's triangle. */
static inline void place_of(const txm_mesh_place *s, float p[3]) {
    assert_true(s->triangle < in.triangles);
    assert_true(s->u >= 0 && s->v >= 0 && s->u + s->v <= 1.000001f);
    const uint32_t *t = in.t + 3 * (size_t)s->triangle;
    for (uint32_t k = 0; k < 3; k++) {
        const double a = in.at[3 * t[0] + k], b = in.at[3 * t[1] + k], c = in.at[3 * t[2] + k];
        p[k] = (float)(a + (double)s->u * (b - a) + (double)s->v * (c - a));
    }
}

/* All that must hold for any result. off: how far vertices may lie off the surface, in edges. */
static inline found check_sound(const trimesh_mesh *m, size_t vertices, double off) {
    found f;
    memset(&f, 0, sizeof f);
    assert_int_equal(m->vertex_count, vertices);
    assert_true(vertices <= MOST_FOUND);
    const size_t open = list_sides(m);
    check_fans(m);
    count_pieces(m, open, &f);
    measure_shape(m, &f);
    assert_int_equal(f.euler, in.euler);
    assert_int_equal(f.components, in.components);
    assert_int_equal(f.loops, in.loops);
    assert_true(f.least_quality > 0);
    assert_true(m->edge_length > 0);
    for (size_t i = 0; i < vertices; i++) {
        static const float origin[3] = {0, 0, 0};
        float p[3];
        place_of(&m->sources[i], p);
        const double d = distance(p, m->positions + 3 * i);
        if (!(d <= off * f.edge_mean))
            print_message("# vertex %lu: %g edges off its source\n", (unsigned long)i,
                          d / f.edge_mean);
        assert_true(d <= off * f.edge_mean);
        assert_true(fabs(distance(m->normals + 3 * i, origin) - 1) < 1e-3);
        assert_true(m->kinds[i] <= TRIMESH_CORNER);
        assert_int_equal(on_rim[i], m->kinds[i] == TRIMESH_BORDER ||
                                        (m->kinds[i] == TRIMESH_CORNER && on_rim[i]));
    }
    return f;
}

/* Retile what `in` holds, check it, give it back. */
static inline trimesh_mesh *made(const trimesh_desc *d, double off, found *f) {
    trimesh_mesh *m;
    tk_memory memory;
    txm_env env;
    memset(&memory, 0, sizeof memory);
    env = tk_env(NULL, NULL);
    trimesh_desc reported = *d;
    reported.report = &report;
    const txm_status status = trimesh_retile(&reported, &env, &m);
    if (status != TXM_OK) print_message("# %lu vertices: %s\n", (unsigned long)d->vertices, env.message);
    assert_int_equal(status, TXM_OK);
    assert_int_equal(report.euler, in.euler);
    assert_int_equal(report.components, in.components);
    assert_int_equal(report.loops, in.loops);
    const found g = check_sound(m, d->vertices, off);
    if (f) *f = g;
    return m;
}

/* Points that only repel each other settle into a less regular pattern. */
static inline void check_regular(const found *f, trimesh_method method) {
    const int lattice = method == TRIMESH_LATTICE;
    assert_true(f->quality > (lattice ? 0.99 : 0.97));
    assert_true((double)f->six > (lattice ? 0.92 : 0.7) * (double)f->inside);
    assert_true(f->edge_cv < (lattice ? 0.06 : 0.1));
}

#endif /* RETILEKIT_H */
