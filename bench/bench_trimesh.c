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

#include "surfaces.h"

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
