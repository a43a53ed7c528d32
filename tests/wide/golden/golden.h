/* golden.h - what the golden programs share: cases, exemplars, and the lines that they print
   SPDX-License-Identifier: MIT OR Unlicense

   A golden program covers one module. Each of its cases hashes what some calls make; main prints a
   line "module case hash" for each. golden.txt beside this file has these lines as they must be, on
   every compiler, level of optimisation and number of threads; tests/wide/golden/compare.sh tells
   which module and case differ.

       make build/golden/golden_texsyn
       build/golden/golden_texsyn THREADS [CASE...]  0: one thread, the indices of loops backwards
       tests/wide/golden/compare.sh "build/golden/golden_texsyn 3"

   Inputs are made of integers and of what the C standard rounds exactly, so that libm has no part
   in them.                                                                                       */
#ifndef GOLDEN_H
#define GOLDEN_H

#include "testkit.h"

/* ---- hashes ------------------------------------------------------------------------------ */

/* tk_hash of numbers of `unit` bytes each, their lowest byte first whatever the machine does. */
static inline uint64_t golden_hash(uint64_t start, const void *numbers, size_t count, size_t unit) {
    static const uint16_t one = 1;
    const unsigned char *p = (const unsigned char *)numbers;
    unsigned char little[8];
    uint64_t hash = start;
    if (*(const unsigned char *)&one == 1) return tk_hash(start, numbers, count);
    for (size_t i = 0; i < count; i += unit) {
        for (size_t k = 0; k < unit; k++) little[k] = p[i + unit - 1 - k];
        hash = tk_hash(hash, little, unit);
    }
    return hash;
}

/* ---- cases ------------------------------------------------------------------------------- */

typedef struct golden_case {
    const char *name;
    uint64_t (*run)(txm_env *env);
} golden_case;

/* Ends the program: what a case asks for must succeed. */
static inline void golden_need(txm_status status, const char *what, const txm_env *env) {
    if (status == TXM_OK) return;
    fprintf(stderr, "%s: %s: %s\n", what, txm_status_text(status), env->message);
    exit(1);
}

/* Is the case among those that are asked for? Without names all are. */
static inline int golden_is_asked(int argc, char **argv, const char *name) {
    for (int i = 2; i < argc; i++)
        if (strcmp(argv[i], name) == 0) return 1;
    return argc <= 2;
}

static inline int golden_main(int argc, char **argv, const char *module, const golden_case *cases,
                              int count) {
    int threads = argc > 1 ? atoi(argv[1]) : 1, printed = 0;
    for (int i = 0; i < count; i++) {
        if (!golden_is_asked(argc, argv, cases[i].name)) continue;
        txm_env env;
        memset(&env, 0, sizeof env);
        if (threads == 0) env.parallel_for = tk_parallel_reverse;
        if (threads > 1) {
            env.parallel_for = tk_parallel_threads;
            env.parallel_user = &threads;
        }
        const uint64_t hash = cases[i].run(&env);
        printf("%s %s %08lx%08lx\n", module, cases[i].name, (unsigned long)(hash >> 32),
               (unsigned long)(hash & 0xffffffffu));
        fflush(stdout);
        printed++;
    }
    return printed == (argc > 2 ? argc - 2 : count) ? 0 : 1;
}

/* main of a program whose cases stand in the array `cases` */
#define GOLDEN_MAIN(module)                                                                       \
    int main(int argc, char **argv) {                                                             \
        return golden_main(argc, argv, module, cases, (int)(sizeof cases / sizeof *cases));       \
    }

/* ---- pictures ---------------------------------------------------------------------------- */

static inline txm_image golden_image(void *pixels, int width, int height, int channels,
                                     txm_sample sample) {
    txm_image image;
    memset(&image, 0, sizeof image);
    image.pixels = pixels;
    image.width = width;
    image.height = height;
    image.channels = channels;
    image.sample = sample;
    return image;
}

/* slopes, patches and noise; alpha, if there is one, is mostly 255 */
static inline void golden_noise(uint8_t *pixels, int width, int height, int channels) {
    txm_rng rng = txm_rng_make(7, (uint64_t)channels);
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            for (int c = 0; c < channels; c++) {
                int v = ((x * 5 + y * 3 + c * 40) % 64) * 2 + ((x / 4 + y / 4) % 3) * 20;
                v += (int)txm_rng_below(&rng, 60);
                pixels[(y * width + x) * channels + c] = (uint8_t)v;
            }
        }
    }
}

/* bricks of 16 x 8 in a bond, each of a shade of its own, with rough faces */
static inline void golden_bricks(uint8_t *pixels, int width, int height, int channels) {
    txm_rng rng = txm_rng_make(3, (uint64_t)channels);
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            const int shifted = x + (y / 8 % 2) * 8;
            const int joint = y % 8 == 0 || shifted % 16 == 0;
            const int shade = (int)(txm_hash((uint64_t)(y / 8 * 97 + shifted / 16)) % 32);
            for (int c = 0; c < channels; c++) {
                const int face = 110 + shade - 25 * c + (int)txm_rng_below(&rng, 16);
                pixels[(y * width + x) * channels + c] = (uint8_t)(joint ? 210 - 5 * c : face);
            }
        }
    }
}

/* blobs about the points of a jittered grid: smooth, with edges that wander */
static inline void golden_blobs(uint8_t *pixels, int width, int height, int channels) {
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            int nearest = 1 << 20;
            for (int k = 0; k < 9; k++) {
                const int cx = x / 12 + k % 3 - 1, cy = y / 12 + k / 3 - 1;
                const uint64_t h = txm_hash((uint64_t)(cy * 1009 + cx + 5000));
                const int dx = x - cx * 12 - (int)(h % 12), dy = y - cy * 12 - (int)(h / 16 % 12);
                if (dx * dx + dy * dy < nearest) nearest = dx * dx + dy * dy;
            }
            for (int c = 0; c < channels; c++)
                pixels[(y * width + x) * channels + c] =
                    (uint8_t)txm_clampi(240 - 2 * nearest - 20 * c, 0, 255);
        }
    }
}

/* ---- surfaces ---------------------------------------------------------------------------- */

enum { GOLDEN_VERTICES = 1200, GOLDEN_TRIANGLES = 2400 };

/* A triangle mesh in arrays of its own. */
typedef struct golden_surface {
    float positions[3 * GOLDEN_VERTICES];
    uint32_t indices[3 * GOLDEN_TRIANGLES];
    size_t vertex_count, triangle_count;
} golden_surface;

static inline uint32_t golden_vertex(golden_surface *s, double x, double y, double z) {
    float *p = s->positions + 3 * s->vertex_count;
    p[0] = txm_float(x);
    p[1] = txm_float(y);
    p[2] = txm_float(z);
    return (uint32_t)s->vertex_count++;
}

static inline void golden_quad(golden_surface *s, uint32_t a, uint32_t b, uint32_t c, uint32_t d) {
    const uint32_t corners[6] = {a, b, c, a, c, d};
    memcpy(s->indices + 3 * s->triangle_count, corners, sizeof corners);
    s->triangle_count += 2;
}

/* A bumpy ring: about a square, and a square about that. Or open: a bent sheet with a border. */
static inline void golden_ring(golden_surface *s, int open) {
    enum { N = 20, M = 10 };
    memset(s, 0, sizeof *s);
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < M; j++) {
            const double x = open ? i : i < N / 2 ? i - N / 4 : 3 * N / 4 - i;
            const double y = open ? j : i < N / 2 ? N / 4 - fabs(x) : fabs(x) - N / 4;
            const double p = j < M / 2 ? j - M / 4.0 : 3 * M / 4.0 - j;
            const double q = j < M / 2 ? M / 4.0 - fabs(p) : fabs(p) - M / 4.0;
            const double l = sqrt(x * x + y * y), t = sqrt(p * p + q * q);
            const double r = open ? 1 : (3 + p / t + 0.1 * ((i * 7 + j * 3) % 4)) / l;
            golden_vertex(s, x * r, y * r, open ? 0.03 * x * y : q / t);
        }
    }
    for (int i = 0; i < N - open; i++) {
        for (int j = 0; j < M - open; j++) {
            const int i1 = (i + 1) % N, j1 = (j + 1) % M;
            golden_quad(s, (uint32_t)(i * M + j), (uint32_t)(i1 * M + j), (uint32_t)(i1 * M + j1),
                        (uint32_t)(i * M + j1));
        }
    }
}

/* A box with sharp edges, w by d by h cells, its lowest corner at (x, y, z). The sides do not share
   vertices, as in files with hard edges. */
static inline void golden_box(golden_surface *s, const int cells[3], double x, double y, double z) {
    for (int side = 0; side < 6; side++) {
        const int axis = side / 2, u = (axis + 1) % 3, v = (axis + 2) % 3, far = side % 2;
        const uint32_t first = (uint32_t)s->vertex_count, row = (uint32_t)cells[u] + 1;
        for (int j = 0; j <= cells[v]; j++) {
            for (int i = 0; i <= cells[u]; i++) {
                double p[3];
                p[axis] = far ? cells[axis] : 0;
                p[u] = i;
                p[v] = j;
                golden_vertex(s, x + p[0], y + p[1], z + p[2]);
            }
        }
        for (uint32_t j = 0; j < (uint32_t)cells[v]; j++) {
            for (uint32_t i = 0; i < (uint32_t)cells[u]; i++) {
                const uint32_t a = first + j * row + i;
                if (far) golden_quad(s, a, a + 1, a + row + 1, a + row);
                else golden_quad(s, a, a + row, a + row + 1, a + 1);
            }
        }
    }
}

#endif /* GOLDEN_H */
