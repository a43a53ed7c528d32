/* bench_trimesh.c - seconds and memory of retiling and scattering: bench_trimesh [--full] [ANYTHING...]
   SPDX-License-Identifier: MIT OR Unlicense

   The surfaces are made here, so names of pictures, which `make bench` gives to every benchmark, are
   not looked at. The first table retiles a torus and a bumpy ball, the second puts a million
   instances on a mesh. --full adds 500,000 vertices, and 200,000 that repel each other, which take
   half a minute. Seconds are of the clock, of one run.                                           */
#define _XOPEN_SOURCE 700 /* clock_gettime, popen */
#define TRIMESH_COVER_IMPLEMENTATION
#include "trimesh_cover.h"
#define TRIMESH_RELAX_IMPLEMENTATION
#include "trimesh_relax.h"

#include "bench.h"

/* ---- surfaces ------------------------------------------------------------------------------ */

typedef struct surface {
    const char *name;
    float *positions;
    uint32_t *indices;
    txm_mesh view;
} surface;

static void make_room(surface *s, size_t vertices, size_t triangles) {
    s->positions = (float *)malloc(3 * vertices * sizeof(float));
    s->indices = (uint32_t *)malloc(3 * triangles * sizeof(uint32_t));
    if (!s->positions || !s->indices) give_up(s->name, "out of memory");
    memset(&s->view, 0, sizeof s->view);
    s->view.positions = s->positions;
    s->view.indices = s->indices;
    s->view.vertex_count = vertices;
    s->view.face_count = triangles;
}

static void put_triangle(uint32_t **to, size_t a, size_t b, size_t c) {
    (*to)[0] = (uint32_t)a;
    (*to)[1] = (uint32_t)b;
    (*to)[2] = (uint32_t)c;
    *to += 3;
}

/* A torus of n * m vertices. */
static surface make_torus(size_t n, size_t m) {
    surface s;
    s.name = "torus";
    make_room(&s, n * m, 2 * n * m);
    float *p = s.positions;
    uint32_t *t = s.indices;
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < m; j++) {
            const double u = 2 * TXM_PI * (double)i / (double)n;
            const double v = 2 * TXM_PI * (double)j / (double)m;
            *p++ = (float)((1 + 0.4 * cos(v)) * cos(u));
            *p++ = (float)((1 + 0.4 * cos(v)) * sin(u));
            *p++ = (float)(0.4 * sin(v));
            const size_t i1 = (i + 1) % n, j1 = (j + 1) % m;
            put_triangle(&t, i * m + j, i1 * m + j, i1 * m + j1);
            put_triangle(&t, i * m + j, i1 * m + j1, i * m + j1);
        }
    }
    return s;
}

/* A ball of n circles of 2 n vertices and two poles, with soft bumps. */
static surface make_ball(size_t n) {
    const size_t m = 2 * n, south = n * m, north = south + 1;
    surface s;
    s.name = "bumpy ball";
    make_room(&s, n * m + 2, 2 * n * m);
    float *p = s.positions;
    uint32_t *t = s.indices;
    for (size_t i = 0; i <= n * m + 1; i++) {
        const size_t ring = i / m + 1;
        const double v = i == south   ? -TXM_PI / 2
                         : i == north ? TXM_PI / 2
                                      : TXM_PI * ((double)ring / (double)(n + 1) - 0.5);
        const double u = i < south ? 2 * TXM_PI * (double)(i % m) / (double)m : 0;
        const double x = cos(u) * cos(v), y = sin(u) * cos(v), z = sin(v);
        const double r = 1 + 0.06 * (sin(7 * x) + sin(8 * y) + sin(6 * z));
        *p++ = (float)(r * x);
        *p++ = (float)(r * y);
        *p++ = (float)(r * z);
    }
    for (size_t j = 0; j < m; j++) {
        const size_t j1 = (j + 1) % m;
        put_triangle(&t, south, j1, j);
        for (size_t i = 0; i + 1 < n; i++) {
            put_triangle(&t, i * m + j, i * m + j1, (i + 1) * m + j1);
            put_triangle(&t, i * m + j, (i + 1) * m + j1, (i + 1) * m + j);
        }
        put_triangle(&t, north, (n - 1) * m + j, (n - 1) * m + j1);
    }
    return s;
}

static void free_surface(surface *s) {
    free(s->positions);
    free(s->indices);
}

/* ---- tables -------------------------------------------------------------------------------- */

static trimesh_mesh *retile(const surface *s, trimesh_method method, size_t vertices, int threads,
                            result *r) {
    trimesh_mesh *mesh;
    trimesh_desc desc;
    txm_env env = make_env(&threads);
    memset(&desc, 0, sizeof desc);
    desc.surface = s->view;
    desc.vertices = vertices;
    desc.method = method;
    *r = no_result;
    const watch w = start();
    if (trimesh_retile(&desc, &env, &mesh) != TXM_OK) give_up(s->name, env.message);
    stop(&w, r);
    return mesh;
}

static double distance(const float *p, const float *q) {
    const double x = (double)p[0] - (double)q[0], y = (double)p[1] - (double)q[1];
    const double z = (double)p[2] - (double)q[2];
    return sqrt(x * x + y * y + z * z);
}

/* Twice the radius of the inscribed circle over that of the circumscribed one, on average. */
static double mean_quality(const trimesh_mesh *m) {
    double sum = 0;
    for (size_t t = 0; t < m->triangle_count; t++) {
        const float *p[3];
        for (size_t k = 0; k < 3; k++) p[k] = m->positions + 3 * (size_t)m->indices[3 * t + k];
        const double a = distance(p[0], p[1]), b = distance(p[1], p[2]), c = distance(p[2], p[0]);
        if (a * b * c > 0) sum += (a + b - c) * (b + c - a) * (c + a - b) / (a * b * c);
    }
    return sum / (double)m->triangle_count;
}

static void retiling(int full) {
    static const size_t numbers[] = {5000, 50000, 200000, 500000};
    const int threads = env_cores();
    surface surfaces[2];
    surfaces[0] = make_torus(240, 110);
    surfaces[1] = make_ball(120);
    printf("retiling, seconds on 1 and on %d threads; us: microseconds per vertex, one thread\n\n",
           threads);
    printf("surface    triangles method  vertices 1 thread %d threads speedup      us peak MiB "
           "bytes/vertex quality\n", threads);
    for (int s = 0; s < 2; s++) {
        for (int method = TRIMESH_LATTICE; method <= TRIMESH_REPEL; method++) {
            const int sizes = (method == TRIMESH_REPEL ? 2 : 3) + (full ? 1 : 0);
            for (int i = 0; i < sizes; i++) {
                result one, all;
                const size_t n = numbers[i];
                trimesh_mesh_free(retile(&surfaces[s], (trimesh_method)method, n, threads, &all));
                trimesh_mesh *m = retile(&surfaces[s], (trimesh_method)method, n, 1, &one);
                printf("%-10s %9lu %-7s %9lu %8.2f %9.2f %7.2f %7.1f %8.1f %12.0f %7.4f\n",
                       surfaces[s].name, (unsigned long)surfaces[s].view.face_count,
                       method == TRIMESH_LATTICE ? "lattice" : "repel", (unsigned long)n,
                       one.seconds, all.seconds, one.seconds / all.seconds,
                       1e6 * one.seconds / (double)n, mebibytes(one.peak),
                       (double)one.peak / (double)n, mean_quality(m));
                fflush(stdout);
                trimesh_mesh_free(m);
            }
        }
    }
    free_surface(&surfaces[0]);
    free_surface(&surfaces[1]);
}

/* A million things on a torus of 20,000 triangles, 50 on each. */
static void scattering(void) {
    enum { POINTS = 50, ROOM = 1100000 };
    trimesh_point points[2 * POINTS];
    trimesh_patch patch;
    trimesh_patch_desc spread;
    trimesh_scatter_desc d;
    result r;
    surface s = make_torus(240, 110);
    trimesh_mesh *mesh = retile(&s, TRIMESH_LATTICE, 10000, env_cores(), &r);
    trimesh_instance *out = (trimesh_instance *)malloc(ROOM * sizeof *out);
    if (!out) give_up("scatter", "out of memory");
    memset(&spread, 0, sizeof spread);
    memset(&d, 0, sizeof d);
    memset(out, 0, ROOM * sizeof *out); /* so that the first run does not fetch the pages */
    spread.points = POINTS;
    if (trimesh_reference_patch(&spread, NULL, points, 2 * POINTS, &patch.count) != TXM_OK)
        give_up("patch", "failed");
    patch.points = points;
    d.mesh = trimesh_as_view(mesh);
    d.normals = mesh->normals;
    d.patches = &patch;
    d.patch_count = 1;
    printf("\nthings on %lu triangles, fastest of 3\n\nhow              threads   things seconds "
           "ns each peak MiB\n", (unsigned long)mesh->triangle_count);
    for (int curved = 0; curved < 2; curved++) {
        for (int threads = 1; threads <= env_cores(); threads *= 2) {
            int used = threads;
            txm_env env = make_env(&used);
            size_t count = 0;
            result best = no_result;
            d.curve = (float)curved;
            for (int run = 0; run < 3; run++) {
                const watch w = start();
                if (trimesh_scatter(&d, &env, out, ROOM, &count) != TXM_OK)
                    give_up("scatter", env.message);
                stop(&w, &best);
            }
            printf("%-16s %7d %8lu %7.3f %7.0f %8.1f\n", curved ? "on the curve" : "on triangles",
                   threads, (unsigned long)count, best.seconds, 1e9 * best.seconds / (double)count,
                   mebibytes(best.peak));
            fflush(stdout);
        }
    }
    free(out);
    trimesh_mesh_free(mesh);
    free_surface(&s);
}

int main(int argc, char **argv) {
    env_let_threads_sleep(argv);
    retiling(argc > 1 && !strcmp(argv[1], "--full"));
    scattering();
    return 0;
}
