/* bench_growth.c - how time and memory grow with the size of the task:
   bench_growth [--only WORD] EXEMPLAR...
   SPDX-License-Identifier: MIT OR Unlicense

   A line for each thing that the suite does: the time of the processor for one unit of the result at
   four sizes, on one thread; the exponent e of the power law, seconds = c units^e, that fits them best,
   1 if time is in proportion; the time of the clock for one unit of the largest on one thread and on two,
   and their ratio; the ratio that two idle cores can reach, from the times that one takes ("ideal", which
   a busy machine does not change); its memory for one unit. Of several runs the fastest counts. Only the first picture is
   used. --only: the lines whose name has that word. */
#define _XOPEN_SOURCE 700 /* clock_gettime, popen */
#define TEXPATCH_IMPLEMENTATION
#include "texpatch.h"
#define TEXSYN_IMPLEMENTATION
#include "texsyn.h"
#define TEXTILES_IMPLEMENTATION
#include "textiles.h"
#define TREEPIECES_IMPLEMENTATION
#include "treepieces.h"
#define TRIMESH_RELAX_IMPLEMENTATION
#include "trimesh_relax.h"

#include "surfaces.h"

enum { SIZES = 4, RUNS = 3, FEW_PIECES = 154 };

/* One size of a task. */
typedef struct trial {
    const txm_image *picture;
    int size, threads;
    double units; /* of the result; set by the task */
    result best;
} trial;

/* What is measured: size as the task takes it. */
typedef struct task {
    const char *what, *unit;
    int sizes[SIZES];
    void (*run)(trial *t);
} task;

static txm_image blank(const trial *t, int side) {
    txm_image image;
    if (!image_new(side, side, t->picture->channels, TXM_U8, &image)) give_up("picture", "no memory");
    return image;
}

/* ---- tasks --------------------------------------------------------------------------------- */

static void retile(trial *t) {
    surface s = make_torus(240, 110);
    txm_env env = make_env(&t->threads);
    trimesh_desc desc;
    trimesh_mesh *mesh;
    memset(&desc, 0, sizeof desc);
    desc.surface = s.view;
    desc.vertices = (size_t)t->size;
    const watch w = start();
    if (trimesh_retile(&desc, &env, &mesh) != TXM_OK) give_up("retile", env.message);
    stop(&w, &t->best);
    t->units = (double)mesh->vertex_count;
    trimesh_mesh_free(mesh);
    free_surface(&s);
}

static texsyn_model *learn_from(const txm_image *example, int threads, result *r) {
    txm_env env = make_env(&threads);
    texsyn_learn_desc desc;
    texsyn_model *model;
    memset(&desc, 0, sizeof desc);
    desc.example = *example;
    const watch w = start();
    if (texsyn_learn(&desc, &env, &model) != TXM_OK) give_up("learn", env.message);
    stop(&w, r);
    return model;
}

static void learn(trial *t) {
    txm_image example = resized(t->picture, t->size);
    texsyn_model_free(learn_from(&example, t->threads, &t->best));
    t->units = (double)t->size * t->size;
    image_free(&example);
}

static void synth(trial *t) {
    static texsyn_model *model;
    result unused = no_result;
    txm_env env = make_env(&t->threads);
    texsyn_synth_desc desc;
    txm_image out = blank(t, t->size);
    if (!model) model = learn_from(t->picture, 1, &unused);
    memset(&desc, 0, sizeof desc);
    desc.model = model;
    desc.width = desc.height = t->size;
    const watch w = start();
    if (texsyn_synthesize(&desc, &env, out) != TXM_OK) give_up("synth", env.message);
    stop(&w, &t->best);
    t->units = (double)t->size * t->size;
    image_free(&out);
}

static void patch(trial *t) {
    txm_env env = make_env(&t->threads);
    texpatch_exemplar exemplar;
    texpatch_desc desc;
    txm_image out = blank(t, t->size);
    memset(&exemplar, 0, sizeof exemplar);
    memset(&desc, 0, sizeof desc);
    exemplar.maps = t->picture;
    desc.exemplars = &exemplar;
    desc.exemplar_count = desc.map_count = 1;
    desc.width = desc.height = t->size;
    const watch w = start();
    if (texpatch_make(&desc, &env, &out) != TXM_OK) give_up("patch", env.message);
    stop(&w, &t->best);
    t->units = (double)t->size * t->size;
    image_free(&out);
}

static void make_tiles(trial *t, int colors, int variants, int size) {
    txm_env env = make_env(&t->threads);
    textiles_exemplar exemplar;
    textiles_desc desc;
    textiles_set *set;
    memset(&desc, 0, sizeof desc);
    exemplar.maps = t->picture;
    exemplar.map_count = 1;
    desc.exemplars = &exemplar;
    desc.exemplar_count = 1;
    desc.size = size;
    desc.colors = colors;
    desc.variants = variants;
    const watch w = start();
    if (textiles_make(&desc, &env, &set) != TXM_OK) give_up("tiles", env.message);
    stop(&w, &t->best);
    t->units = (double)textiles_count(set) * size * size;
    textiles_set_free(set);
}

static void tiles(trial *t) {
    make_tiles(t, 2, 1, t->size);
}

static void more_tiles(trial *t) {
    const int colors = t->size < 81 ? 2 : t->size < 256 ? 3 : 4;
    make_tiles(t, colors, t->size / (colors * colors * colors * colors), 64);
}

/* t->size trees; r: how long they grew. */
static treepieces_forest *grow(trial *t, txm_env *env, treepieces_kit **kit, result *r) {
    treepieces_forest_desc desc;
    treepieces_species oak;
    treepieces_forest *made;
    memset(&desc, 0, sizeof desc);
    if (treepieces_kit_make(NULL, 0, env, kit) != TXM_OK || treepieces_preset("oak", env, &oak) != TXM_OK)
        give_up("forest", env->message);
    desc.kit = *kit;
    desc.species = &oak;
    desc.species_count = 1;
    desc.tree_count = t->size;
    desc.max_pieces = FEW_PIECES;
    const watch w = start();
    if (treepieces_forest_make(&desc, env, &made) != TXM_OK) give_up("forest", env->message);
    stop(&w, r);
    t->units = t->size;
    return made;
}

static void forest(trial *t) {
    txm_env env = make_env(&t->threads);
    treepieces_kit *kit;
    treepieces_forest_free(grow(t, &env, &kit, &t->best));
    treepieces_kit_free(kit);
}

/* A step of the wind; bones and state are the caller's memory, and count as such. */
static void sway(trial *t) {
    txm_env env = make_env(&t->threads);
    const treepieces_wind wind = {0.3f, 8, 0.5f, 1, 0};
    result unused = no_result;
    treepieces_kit *kit;
    treepieces_forest *made = grow(t, &env, &kit, &unused);
    const watch w = start();
    float *bones = (float *)txm_alloc(&env, made->node_count * TREEPIECES_BONE * sizeof(float));
    float *state = (float *)txm_alloc(&env, made->node_count * 4 * sizeof(float));
    if (!bones || !state) give_up("sway", "no memory");
    memset(state, 0, made->node_count * 4 * sizeof(float));
    memset(bones, 0, made->node_count * TREEPIECES_BONE * sizeof(float));
    stop(&w, &unused);
    t->best.peak = unused.peak;
    for (int i = 0; i < RUNS; i++) {
        result r = no_result;
        const watch step = start();
        if (treepieces_sway(made, &wind, 0.1 * i, 0.1, NULL, &env, state, bones) != TXM_OK)
            give_up("sway", env.message);
        stop(&step, &r);
        if (r.cpu < t->best.cpu) {
            t->best.cpu = r.cpu;
            t->best.saved = r.saved;
        }
        if (r.seconds < t->best.seconds) t->best.seconds = r.seconds;
    }
    txm_free(&env, bones);
    txm_free(&env, state);
    treepieces_forest_free(made);
    treepieces_kit_free(kit);
}

static void write_png(trial *t) {
    txm_image image = resized(t->picture, t->size);
    txm_env env = make_env(&t->threads);
    image_job job = {0};
    unsigned char *bytes;
    size_t size;
    const char *why;
    job.env = &env;
    const watch w = start();
    if (!image_encode(&job, ".png", &image, &bytes, &size, &why)) give_up("PNG", why);
    stop(&w, &t->best);
    t->units = (double)t->size * t->size;
    free(bytes);
    image_free(&image);
}

/* ---- the table ------------------------------------------------------------------------------- */

static trial measure(const task *what, int size, int threads, const txm_image *picture) {
    trial t = {NULL, 0, 0, 0, {0, 0, 0, 0}};
    t.picture = picture;
    t.size = size;
    t.threads = threads;
    t.best = no_result;
    for (int i = 0; i < RUNS; i++) what->run(&t);
    return t;
}

/* The slope of the line that fits log seconds over log units best. */
static double exponent(const trial t[SIZES]) {
    double x[SIZES], y[SIZES], mean_x = 0, mean_y = 0, xx = 0, xy = 0;
    for (int i = 0; i < SIZES; i++) {
        x[i] = log(t[i].units);
        y[i] = log(t[i].best.cpu);
        mean_x += x[i] / SIZES;
        mean_y += y[i] / SIZES;
    }
    for (int i = 0; i < SIZES; i++) {
        xx += (x[i] - mean_x) * (x[i] - mean_x);
        xy += (x[i] - mean_x) * (y[i] - mean_y);
    }
    return xy / xx;
}

static void line(const task *what, const txm_image *picture) {
    trial t[SIZES];
    printf("%-20s", what->what);
    for (int i = 0; i < SIZES; i++) {
        t[i] = measure(what, what->sizes[i], 1, picture);
        printf(" %8d:%7.3g", what->sizes[i], 1e6 * t[i].best.cpu / t[i].units);
        fflush(stdout);
    }
    const trial *one = &t[SIZES - 1];
    const trial two = measure(what, one->size, 2, picture);
    double ideal = 0;
    for (int i = 0; i < RUNS; i++) {
        trial paper = {NULL, 0, 0, 0, {0, 0, 0, 0}};
        paper.picture = picture;
        paper.size = one->size;
        paper.threads = ON_PAPER;
        paper.best = no_result;
        what->run(&paper);
        const double ratio = paper.best.cpu / (paper.best.cpu - paper.best.saved);
        if (ratio > ideal) ideal = ratio;
    }
    printf(" %8.2f %7.3g %7.3g %5.2f %5.2f", exponent(t), 1e6 * one->best.seconds / one->units,
           1e6 * two.best.seconds / one->units, one->best.seconds / two.best.seconds, ideal);
    if (one->best.peak) printf(" %11.1f", (double)one->best.peak / one->units);
    else printf(" %11s", "-"); /* of the tool, whose memory is not counted */
    printf("  %s\n", what->unit);
    fflush(stdout);
}

int main(int argc, char **argv) {
    static const task tasks[] = {
        {"retile a torus", "vertex", {5000, 20000, 50000, 200000}, retile},
        {"learn", "pixel", {64, 128, 256, 512}, learn},
        {"synth", "pixel", {256, 512, 1024, 2048}, synth},
        {"patch", "pixel", {512, 1024, 2048, 4096}, patch},
        {"tiles, by side", "pixel", {64, 96, 128, 192}, tiles},
        {"tiles, by number", "pixel", {16, 32, 81, 256}, more_tiles},
        {"forest", "tree", {10, 100, 1000, 10000}, forest},
        {"sway", "tree", {10, 100, 1000, 10000}, sway},
        {"write PNG", "pixel", {512, 1024, 2048, 4096}, write_png},
    };
    txm_image picture;
    const char *why;
    const int has_word = argc > 3 && !strcmp(argv[1], "--only");
    const char *word = has_word ? argv[2] : "", *path = argv[has_word ? 3 : 1];
    if (argc < 2) {
        fprintf(stderr, "usage: bench_growth [--only WORD] EXEMPLAR...\n");
        return 1;
    }
    env_let_threads_sleep(argv);
    if (!image_read(path, 0, &picture, &why)) give_up(path, why);
    printf("%s, %d x %d: microseconds for a unit by size, one thread; the largest by the clock; %d cores\n\n",
           file_name(path), picture.width, picture.height, env_cores());
    printf("what                 size: us at each of four%33s exponent     one     two ratio ideal  bytes/unit  unit\n", "");
    for (size_t i = 0; i < sizeof tasks / sizeof tasks[0]; i++)
        if (strstr(tasks[i].what, word)) line(&tasks[i], &picture);
    image_free(&picture);
    return 0;
}
