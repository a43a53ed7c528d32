/* bench_textiles.c - seconds and memory of textiles.h: bench_textiles EXEMPLAR...
   SPDX-License-Identifier: MIT OR Unlicense

   The first table cuts sets of all kinds out of the first picture, on one thread and on all; the
   second looks up tiles of the plane; the third has a line for each picture; the fourth compares this
   build with one for TEXTILES_NO_SIMD, which lies in plain/ beside it. Seconds are of the clock, of
   one run; of lookups, and of both builds, the fastest run counts.

   bench_textiles --once EXEMPLAR cuts one set and fills a window of the plane, and prints the seconds
   of both. */
#define _XOPEN_SOURCE 700 /* clock_gettime, popen */
#define TEXTILES_IMPLEMENTATION
#include "textiles.h"

#include "bench.h"

enum { LOOKUPS = 3, WINDOW = 1024 };

static const char *const kind_names[] = {"wang", "corner", "triangle", "frame"};

/* ---- making sets -------------------------------------------------------------------------- */

static textiles_set *make(const txm_image *picture, textiles_kind kind, int colors, int size,
                          int threads, result *r) {
    textiles_set *set;
    textiles_exemplar exemplar;
    textiles_desc desc;
    txm_env env = make_env(&threads);
    memset(&desc, 0, sizeof desc);
    exemplar.maps = picture;
    exemplar.map_count = 1;
    desc.kind = kind;
    desc.exemplars = &exemplar;
    desc.exemplar_count = 1;
    desc.size = size;
    desc.colors = colors;
    *r = no_result;
    const watch w = start();
    if (textiles_make(&desc, &env, &set) != TXM_OK) give_up(kind_names[kind], env.message);
    stop(&w, r);
    return set;
}

static double mean_joint(const textiles_set *set) {
    textiles_joints joints;
    memset(&joints, 0, sizeof joints);
    if (textiles_measure(set, 0, NULL, &joints) != TXM_OK) give_up("measure", "failed");
    return joints.mean;
}

static void kinds(const char *path, const txm_image *picture) {
    const int threads = env_cores();
    char head[16];
    snprintf(head, sizeof head, "%d threads", threads);
    printf("tiles of 128 x 128 out of %s, %d x %d, %d channels: seconds on 1 and on %d threads\n\n",
           file_name(path), picture->width, picture->height, picture->channels, threads);
    printf("kind     colors tiles 1 thread %10s  speedup  s/tile peak MiB  joint\n", head);
    for (int kind = TEXTILES_WANG; kind <= TEXTILES_FRAME; kind++) {
        for (int colors = 2; colors <= 3; colors++) {
            result one, all;
            textiles_set_free(make(picture, (textiles_kind)kind, colors, 128, 1, &one));
            textiles_set *set = make(picture, (textiles_kind)kind, colors, 128, threads, &all);
            printf("%-8s %6d %5d %8.2f %10.2f %8.2f %7.3f %8.1f %6.3f\n", kind_names[kind], colors,
                   textiles_count(set), one.seconds, all.seconds, one.seconds / all.seconds,
                   one.seconds / textiles_count(set), mebibytes(all.peak), mean_joint(set));
            fflush(stdout);
            textiles_set_free(set);
        }
    }
}

static void one_line(const char *path, const txm_image *picture) {
    result wang, triangle;
    textiles_set *w = make(picture, TEXTILES_WANG, 2, 64, 1, &wang);
    textiles_set *t = make(picture, TEXTILES_TRIANGLE, 2, 64, 1, &triangle);
    print_picture(path, picture);
    printf(" %10.2f %8.3f %14.2f %8.3f\n", wang.cpu, mean_joint(w), triangle.cpu, mean_joint(t));
    textiles_set_free(w);
    textiles_set_free(t);
}

/* ---- the plane ---------------------------------------------------------------------------- */

/* Pictures that nobody looks at: the plane takes the same time for any. */
static void make_plane(textiles_kind kind, int colors, int variants, textiles_set **set,
                       textiles_plane *plane) {
    enum { SIDE = TEXTILES_MIN_TRIANGLE };
    static uint8_t pixels[(SIDE + 1) * (SIDE + 1)];
    const int c = colors, count = (kind == TEXTILES_TRIANGLE ? (8 * c * c * c + 4 * c) / 3
                                                             : c * c * c * c) * variants;
    txm_image *tiles = (txm_image *)calloc((size_t)count, sizeof *tiles);
    textiles_desc desc;
    txm_env env;
    memset(&desc, 0, sizeof desc);
    memset(&env, 0, sizeof env);
    if (!tiles) give_up("tiles", "out of memory");
    for (int i = 0; i < count; i++) {
        tiles[i].pixels = pixels;
        tiles[i].width = tiles[i].height = SIDE + (kind == TEXTILES_TRIANGLE);
        tiles[i].channels = 1;
    }
    desc.kind = kind;
    desc.size = SIDE;
    desc.colors = colors;
    desc.variants = variants;
    if (textiles_import(&desc, tiles, count, 1, &env, set) != TXM_OK ||
        textiles_plane_make(*set, 1, &env, plane) != TXM_OK)
        give_up(kind_names[kind], env.message);
    free(tiles);
}

/* Seconds for a window of WINDOW x WINDOW tiles; by plane_fill if there is room for them. */
static double lookup_seconds(const textiles_plane *plane, int *tiles, unsigned *sum) {
    result best = no_result;
    for (int run = 0; run < LOOKUPS; run++) {
        const int from = run * WINDOW;
        const watch w = start();
        if (tiles) {
            textiles_plane_fill(plane, from, 0, WINDOW, WINDOW, tiles);
            *sum += (unsigned)tiles[run];
        }
        for (int y = 0; y < WINDOW && !tiles; y++) {
            for (int x = 0; x < WINDOW; x++) {
                int rotation;
                *sum += (unsigned)(plane->kind == TEXTILES_TRIANGLE
                                       ? textiles_plane_triangle(plane, from + x / 2, y, x & 1,
                                                                 &rotation)
                                       : textiles_plane_tile(plane, from + x, y));
            }
        }
        stop(&w, &best);
    }
    return best.seconds;
}

/* million tiles per second */
static double lookup_rate(const textiles_plane *plane, int *tiles, unsigned *sum) {
    return 1e-6 * WINDOW * WINDOW / lookup_seconds(plane, tiles, sum);
}

static void lookups(void) {
    int *tiles = (int *)malloc((size_t)WINDOW * WINDOW * sizeof *tiles);
    unsigned sum = 0;
    if (!tiles) give_up("tiles", "out of memory");
    printf("\nlookups of tiles of the plane, one thread: million tiles per second\n\n"
           "kind     colors variants one by one   window\n");
    for (int kind = TEXTILES_WANG; kind <= TEXTILES_TRIANGLE; kind++) {
        for (int i = 0; i < 4; i++) {
            const int colors = 2 + i / 2, variants = 1 + 3 * (i % 2);
            textiles_set *set;
            textiles_plane plane;
            make_plane((textiles_kind)kind, colors, variants, &set, &plane);
            printf("%-8s %6d %8d %10.1f", kind_names[kind], colors, variants,
                   lookup_rate(&plane, NULL, &sum));
            if (kind == TEXTILES_TRIANGLE) printf("        -\n");
            else printf(" %8.1f\n", lookup_rate(&plane, tiles, &sum));
            textiles_set_free(set);
        }
    }
    free(tiles);
    if (sum == 1) printf("\n"); /* so that no compiler leaves the lookups out */
}

/* ---- this build against the one without SIMD --------------------------------------------- */

static void once(const txm_image *picture, double seconds[STAGES]) {
    int *tiles = (int *)malloc((size_t)WINDOW * WINDOW * sizeof *tiles);
    unsigned sum = 0;
    textiles_plane plane;
    result r;
    textiles_set *set = make(picture, TEXTILES_WANG, 2, 128, 1, &r);
    if (!tiles || textiles_plane_make(set, 1, NULL, &plane) != TXM_OK) give_up("plane", "no memory");
    seconds[0] = r.cpu;
    seconds[1] = lookup_seconds(&plane, tiles, &sum);
    textiles_set_free(set);
    free(tiles);
}

static void first(const char *path, const txm_image *picture) {
    kinds(path, picture);
    lookups();
}

int main(int argc, char **argv) {
    static const tables t = {
        "bench_textiles",
        first,
        "one thread, 16 wang tiles and 24 triangles of 64 pixels\n\n"
        "exemplar         size        ch wang CPU s    joint triangle CPU s    joint\n",
        one_line,
        once,
        2,
        "one thread, 16 wang tiles of 128 x 128 out of",
        {"making them", "a window of 1,048,576 tiles"},
        "TEXTILES_NO_SIMD"};
    return run_tables(&t, argc, argv);
}
