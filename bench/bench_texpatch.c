/* bench_texpatch.c - seconds and memory of texpatch.h: bench_texpatch EXEMPLAR...
   SPDX-License-Identifier: MIT OR Unlicense

   The first table makes textures of many kinds from the first picture, on one thread and on all; where
   one thread alone would take long, on all only. The second has a line for each picture. The third
   compares this build with one for TEXPATCH_NO_SIMD, which lies in plain/ beside it. Seconds are of
   the clock, of one run; of both builds the fastest run counts.

   bench_texpatch --once EXEMPLAR makes 512 x 512 once and prints the CPU seconds. */
#define _XOPEN_SOURCE 700 /* clock_gettime, popen */
#define TEXPATCH_IMPLEMENTATION
#include "texpatch.h"

#include "bench.h"

enum { MAPS = 3, STROKE_WIDTH = 64, STROKE_LENGTH = 256 };

static txm_image new_image(int width, int height, int channels) {
    txm_image image = {NULL, width, height, channels, TXM_U8, 0};
    image.pixels = calloc((size_t)width * (size_t)height, (size_t)channels);
    if (!image.pixels) give_up("picture", "out of memory");
    return image;
}

/* ---- what is timed ------------------------------------------------------------------------ */

static texpatch_desc make_desc(const texpatch_exemplar *exemplar, int map_count, int side) {
    texpatch_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.exemplars = exemplar;
    desc.exemplar_count = 1;
    desc.map_count = map_count;
    desc.width = desc.height = side;
    return desc;
}

static void finish(texpatch_job *job, txm_env *env) {
    for (int more = 1; more;) {
        if (texpatch_step(job, env, &more) != TXM_OK) give_up("texpatch_step", env->message);
    }
}

static void time_make(const texpatch_desc *desc, int threads, result *r) {
    txm_image out[MAPS];
    txm_env env = make_env(&threads);
    memset(out, 0, sizeof out);
    for (int m = 0; m < desc->map_count; m++)
        out[m] = new_image(desc->width, desc->height, desc->exemplars[0].maps[m].channels);
    *r = no_result;
    const watch w = start();
    if (texpatch_make(desc, &env, out) != TXM_OK) give_up("texpatch_make", env.message);
    stop(&w, r);
    for (int m = 0; m < MAPS; m++) free(out[m].pixels);
}

/* A finished job, of which a band in the middle is made again. */
static void time_again(const texpatch_desc *desc, int threads, result *r) {
    txm_image again = new_image(desc->width, desc->height, 1);
    txm_env env = make_env(&threads);
    texpatch_job *job;
    for (int y = 0; y < STROKE_WIDTH; y++)
        memset((uint8_t *)txm_image_row(&again, (desc->height - STROKE_WIDTH) / 2 + y) +
                   (desc->width - STROKE_LENGTH) / 2,
               255, STROKE_LENGTH);
    if (texpatch_begin(desc, &env, &job) != TXM_OK) give_up("texpatch_begin", env.message);
    finish(job, &env);
    *r = no_result;
    const watch w = start();
    if (texpatch_again(job, &again, NULL, NULL, 2, &env) != TXM_OK)
        give_up("texpatch_again", env.message);
    finish(job, &env);
    stop(&w, r);
    texpatch_free(job);
    free(again.pixels);
}

/* One cell of the plane, all else that it needs included; returns its side. */
static int time_cell(const texpatch_desc *desc, int threads, result *r) {
    txm_env env = make_env(&threads);
    texpatch_plane *plane;
    if (texpatch_plane_make(desc, &env, &plane) != TXM_OK) give_up("plane_make", env.message);
    const int side = texpatch_plane_cell(plane);
    txm_image out = new_image(side, side, desc->exemplars[0].maps[0].channels);
    *r = no_result;
    const watch w = start();
    if (texpatch_plane_draw(plane, 0, 0, &env, &out, NULL) != TXM_OK)
        give_up("plane_draw", env.message);
    stop(&w, r);
    texpatch_plane_free(plane);
    free(out.pixels);
    return side;
}

/* ---- tables ------------------------------------------------------------------------------- */

static void print_row(const char *what, int width, int height, const result *one,
                      const result *all) {
    char size[24];
    snprintf(size, sizeof size, "%d x %d", width, height);
    printf("%-26s %-11s", what, size);
    if (one) printf(" %8.2f", one->seconds);
    else printf("        -");
    printf(" %10.2f", all->seconds);
    if (one) printf(" %8.2f", one->seconds / all->seconds);
    else printf("        -");
    printf(" %8.2f %8.1f\n", 1e6 * all->cpu / width / height, mebibytes(all->peak));
    fflush(stdout);
}

static void make_row(const char *what, const texpatch_desc *desc, int is_long) {
    const int threads = env_cores();
    result one, all;
    if (!is_long) time_make(desc, 1, &one);
    time_make(desc, threads, &all);
    print_row(what, desc->width, desc->height, is_long ? NULL : &one, &all);
}

/* Heights and roughness as one might derive them, in register with the picture. */
static void derive_maps(const txm_image *picture, txm_image maps[MAPS]) {
    maps[0] = *picture;
    for (int m = 1; m < MAPS; m++) {
        maps[m] = new_image(picture->width, picture->height, 1);
        for (int y = 0; y < picture->height; y++) {
            for (int x = 0; x < picture->width; x++) {
                const float v = txm_image_get(picture, x, y, 0);
                txm_image_set(&maps[m], x, y, 0, m == 1 ? v : 1 - v * v);
            }
        }
    }
}

static void everything(const char *path, const txm_image *picture) {
    const int threads = env_cores();
    char head[16];
    txm_image maps[MAPS];
    texpatch_exemplar exemplar;
    texpatch_map weights[MAPS];
    result one, all;
    derive_maps(picture, maps);
    memset(&exemplar, 0, sizeof exemplar);
    memset(weights, 0, sizeof weights);
    exemplar.maps = maps;
    snprintf(head, sizeof head, "%d threads", threads);
    printf("out of %s, %d x %d, %d channels: seconds on 1 and on %d threads\n\n", file_name(path),
           picture->width, picture->height, picture->channels, threads);
    printf("what                       pixels      1 thread %10s  speedup us/pixel peak MiB\n",
           head);

    texpatch_desc desc = make_desc(&exemplar, 1, 512);
    make_row("defaults", &desc, 0);
    desc.passes = -1;
    make_row("passes -1", &desc, 0);
    desc.passes = 0;
    desc.tileable = TEXPATCH_TILE_X | TEXPATCH_TILE_Y;
    make_row("tileable", &desc, 0);
    desc.tileable = 0;
    desc.turns = 4;
    make_row("turns 4", &desc, 0);
    desc.turns = 0;
    desc.novelty = 1;
    make_row("novelty 1", &desc, 0);
    desc.novelty = 0;
    desc.map_count = MAPS;
    make_row("3 maps, 2 of them follow", &desc, 0);
    for (int m = 0; m < MAPS; m++) weights[m].weight = 1;
    desc.maps = weights;
    make_row("3 maps, all matched", &desc, 0);
    desc.maps = NULL;
    desc.map_count = 1;

    time_again(&desc, 1, &one);
    time_again(&desc, threads, &all);
    print_row("a stroke again, of 512", STROKE_LENGTH, STROKE_WIDTH, &one, &all);
    const int side = time_cell(&desc, 1, &one);
    time_cell(&desc, threads, &all);
    print_row("a cell of the plane", side, side, &one, &all);

    for (int size = 1024; size <= 4096; size *= 2) { /* the time for a pixel stays */
        desc.width = desc.height = size;
        desc.passes = 0;
        make_row("defaults", &desc, 1);
        desc.passes = -1;
        make_row("passes -1", &desc, 1);
    }
    for (int m = 1; m < MAPS; m++) free(maps[m].pixels);
}

static void one_line(const char *path, const txm_image *picture) {
    texpatch_exemplar exemplar;
    texpatch_job *job;
    txm_env env;
    result full, fast;
    float v[4] = {0, 0, 0, 0};
    memset(&exemplar, 0, sizeof exemplar);
    memset(&env, 0, sizeof env);
    exemplar.maps = picture;
    texpatch_desc desc = make_desc(&exemplar, 1, 512);
    if (texpatch_begin(&desc, &env, &job) != TXM_OK) give_up(path, env.message);
    const int has_lattice = texpatch_lattice(job, v);
    texpatch_free(job);
    time_make(&desc, 1, &full);
    desc.passes = -1;
    time_make(&desc, 1, &fast);
    print_picture(path, picture);
    printf(" %10.2f %10.2f", full.cpu, fast.cpu);
    if (has_lattice)
        printf("  %.1f,%.1f %.1f,%.1f\n", (double)v[0], (double)v[1], (double)v[2], (double)v[3]);
    else printf("  none\n");
}

/* ---- this build against the one without SIMD --------------------------------------------- */

static void once(const txm_image *picture, double seconds[STAGES]) {
    texpatch_exemplar exemplar;
    result r;
    memset(&exemplar, 0, sizeof exemplar);
    exemplar.maps = picture;
    const texpatch_desc desc = make_desc(&exemplar, 1, 512);
    time_make(&desc, 1, &r);
    seconds[0] = r.cpu;
}

int main(int argc, char **argv) {
    static const tables t = {
        "bench_texpatch",
        everything,
        "one thread, 512 x 512\n\n"
        "exemplar         size        ch defaults s passes -1 s  lattice\n",
        one_line,
        once,
        2,
        "one thread, CPU, 512 x 512 out of",
        {"making it", NULL},
        "TEXPATCH_NO_SIMD"};
    return run_tables(&t, argc, argv);
}
