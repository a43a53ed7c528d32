/* same_bytes.c - print one hash over what all headers make: same_bytes THREADS
   SPDX-License-Identifier: MIT OR Unlicense

   test_same_bytes.sh builds this with each compiler and optimisation level and runs it on several
   numbers of threads; all must print the same line. Everything here is in integers, but for what
   lies between the pixels of an exemplar in triangles, repair, meshes, and trees.               */
#define TEXSYN_IMPLEMENTATION
#include "texsyn.h"
#define TEXPATCH_IMPLEMENTATION
#include "texpatch.h"
#define TEXTILES_IMPLEMENTATION
#include "textiles.h"
#define TRIMESH_RELAX_IMPLEMENTATION
#include "trimesh_relax.h"
#define TREEPIECES_IMPLEMENTATION
#include "treepieces.h"
#include "testkit.h"

enum { SIDE = 64, WIDTH = 96, HEIGHT = 80 };

static void give_up(const char *what, const txm_env *env) {
    fprintf(stderr, "%s: %s\n", what, env->message);
    exit(1);
}

/* The exemplar: slopes, patches and noise. */
static void draw_exemplar(uint8_t *pixels, int channels) {
    txm_rng rng = txm_rng_make(7, (uint64_t)channels);
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            for (int c = 0; c < channels; c++) {
                int v = ((x * 5 + y * 3 + c * 40) % 64) * 2 + ((x / 4 + y / 4) % 3) * 20;
                v += (int)txm_rng_below(&rng, 60);
                pixels[(y * SIDE + x) * channels + c] = (uint8_t)v;
            }
        }
    }
}

/* Hash over the model and the synthesis of one drawn exemplar. */
static uint64_t run(int channels, int tileable, txm_env *env, uint64_t hash) {
    static uint8_t pixels[SIDE * SIDE * 4], out[WIDTH * HEIGHT * 4], bytes[1 << 16];
    draw_exemplar(pixels, channels);

    texsyn_learn_desc learn;
    texsyn_synth_desc synth;
    texsyn_model *model = NULL;
    size_t size = 0;
    memset(&learn, 0, sizeof learn);
    learn.example.pixels = pixels;
    learn.example.width = learn.example.height = SIDE;
    learn.example.channels = channels;
    learn.max_distance = 12;
    if (texsyn_learn(&learn, env, &model) != TXM_OK) give_up("learn", env);
    if (texsyn_save(model, env, bytes, sizeof bytes, &size) != TXM_OK) give_up("save", env);
    hash = tk_hash(hash, bytes, size);

    memset(&synth, 0, sizeof synth);
    synth.model = model;
    synth.width = WIDTH;
    synth.height = HEIGHT;
    synth.tileable = tileable;
    synth.seed = 3;
    txm_image image = {out, WIDTH, HEIGHT, channels, TXM_U8, 0};
    if (texsyn_synthesize(&synth, env, image) != TXM_OK) give_up("synthesize", env);
    hash = tk_hash(hash, out, (size_t)WIDTH * HEIGHT * (size_t)channels);
    texsyn_model_free(model);
    return hash;
}

/* Hash over a tile set of the exemplar: its pixels, and where they come from. A second map, of floats,
   goes along. */
static uint64_t run_tiles(textiles_kind kind, int channels, txm_env *env, uint64_t hash) {
    enum { TILE = 32 };
    static uint8_t pixels[SIDE * SIDE * 4], bytes[(TILE + 1) * (TILE + 1) * 4];
    static float floats[SIDE * SIDE], values[(TILE + 1) * (TILE + 1)];
    draw_exemplar(pixels, channels);
    for (int i = 0; i < SIDE * SIDE; i++) floats[i] = (float)pixels[i * channels] / 3.0f;

    const txm_image maps[2] = {{pixels, SIDE, SIDE, channels, TXM_U8, 0},
                               {floats, SIDE, SIDE, 1, TXM_F32, 0}};
    const textiles_exemplar exemplar = {maps, 2};
    textiles_desc desc;
    textiles_set *set = NULL;
    memset(&desc, 0, sizeof desc);
    desc.kind = kind;
    desc.exemplars = &exemplar;
    desc.exemplar_count = 1;
    desc.size = TILE;
    desc.reduced = 1;
    desc.seed = 3;
    if (textiles_make(&desc, env, &set) != TXM_OK) give_up("tiles", env);
    const int side = TILE + (kind == TEXTILES_TRIANGLE);
    for (int t = 0; t < textiles_count(set); t++) {
        const txm_image out[2] = {{bytes, side, side, channels, TXM_U8, 0},
                                  {values, side, side, 1, TXM_F32, 0}};
        for (int m = 0; m < 2; m++) {
            if (textiles_draw_tile(set, t, 0, m, env, out[m]) != TXM_OK) give_up("draw", env);
        }
        for (int y = 0; y < side; y++) {
            for (int x = 0; x < (kind == TEXTILES_TRIANGLE ? side - y : side); x++) {
                float from[2] = {0, 0};
                const int e = textiles_source(set, t, x, y, from);
                if (e != 0) give_up("source", env);
                hash = tk_hash(hash, from, sizeof from);
                hash = tk_hash(hash, bytes + (y * side + x) * channels, (size_t)channels);
                hash = tk_hash(hash, values + y * side + x, sizeof(float));
            }
        }
    }
    textiles_free(set);
    return hash;
}

/* Hash over a texture made of pieces of the exemplar, and over a window of the endless plane. */
static uint64_t run_patch(int channels, int tileable, int turns, txm_env *env, uint64_t hash) {
    static uint8_t pixels[SIDE * SIDE * 4], out[WIDTH * HEIGHT * 4];
    draw_exemplar(pixels, channels);
    const txm_image map = {pixels, SIDE, SIDE, channels, TXM_U8, 0};
    const txm_image image = {out, WIDTH, HEIGHT, channels, TXM_U8, 0};
    const txm_image window = {out, 20, 30, channels, TXM_U8, 0};
    texpatch_exemplar exemplar;
    texpatch_desc desc;
    texpatch_plane *plane = NULL;
    memset(&exemplar, 0, sizeof exemplar);
    memset(&desc, 0, sizeof desc);
    exemplar.maps = &map;
    desc.exemplars = &exemplar;
    desc.exemplar_count = desc.map_count = 1;
    desc.width = WIDTH;
    desc.height = HEIGHT;
    desc.tileable = tileable;
    desc.turns = turns;
    desc.mirror = turns > 1;
    desc.seed = 3;
    if (texpatch_make(&desc, env, &image) != TXM_OK) give_up("patch", env);
    hash = tk_hash(hash, out, (size_t)WIDTH * HEIGHT * (size_t)channels);
    if (tileable) return hash;
    if (texpatch_plane_make(&desc, env, &plane) != TXM_OK ||
        texpatch_plane_draw(plane, -70, 5, env, &window, NULL) != TXM_OK)
        give_up("plane", env);
    hash = tk_hash(hash, out, 20 * 30 * (size_t)channels);
    texpatch_plane_free(plane);
    return hash;
}

/* Hash over a retiled surface and the things that stand on it. The surface is a bumpy ring, or open:
   a bent sheet. Only integers and sqrt make it, so that libm has no part in it. */
static uint64_t run_mesh(trimesh_method method, int open, txm_env *env, uint64_t hash) {
    enum { N = 20, M = 10 };
    static float at[3 * N * M];
    static uint32_t t[6 * N * M];
    static trimesh_instance things[1 << 14];
    static trimesh_point points[64];
    uint32_t corners = 0;
    for (int i = 0; i < N; i++) { /* about a square, and a square about that */
        for (int j = 0; j < M; j++) {
            const double x = open ? i : i < N / 2 ? i - N / 4 : 3 * N / 4 - i;
            const double y = open ? j : i < N / 2 ? N / 4 - fabs(x) : fabs(x) - N / 4;
            const double p = j < M / 2 ? j - M / 4.0 : 3 * M / 4.0 - j;
            const double q = j < M / 2 ? M / 4.0 - fabs(p) : fabs(p) - M / 4.0;
            const double l = sqrt(x * x + y * y), s = sqrt(p * p + q * q);
            const double r = open ? 1 : (3 + p / s + 0.1 * ((i * 7 + j * 3) % 4)) / l;
            float *v = at + 3 * (i * M + j);
            v[0] = txm_float(x * r);
            v[1] = txm_float(y * r);
            v[2] = txm_float(open ? 0.03 * x * y : q / s);
        }
    }
    for (int i = 0; i < N - open; i++) {
        for (int j = 0; j < M - open; j++) {
            const int i1 = (i + 1) % N, j1 = (j + 1) % M;
            const int quad[6] = {i * M + j, i1 * M + j, i1 * M + j1, i * M + j, i1 * M + j1, i * M + j1};
            for (int k = 0; k < 6; k++) t[corners++] = (uint32_t)quad[k];
        }
    }
    trimesh_desc desc;
    trimesh_scatter_desc scatter;
    trimesh_patch patch;
    trimesh_patch_desc spread;
    trimesh_mesh *mesh = NULL;
    size_t count = 0;
    memset(&desc, 0, sizeof desc);
    desc.surface.positions = at;
    desc.surface.indices = t;
    desc.surface.vertex_count = N * M;
    desc.surface.triangle_count = corners / 3;
    desc.vertices = 401;
    desc.method = method;
    desc.adapt = open ? 0.5f : 0;
    desc.crease_angle = 60;
    if (trimesh_retile(&desc, env, NULL, &mesh) != TXM_OK) give_up("retile", env);
    hash = tk_hash(hash, mesh->positions, 3 * mesh->vertex_count * sizeof(float));
    hash = tk_hash(hash, mesh->normals, 3 * mesh->vertex_count * sizeof(float));
    hash = tk_hash(hash, mesh->indices, 3 * mesh->triangle_count * sizeof(uint32_t));
    hash = tk_hash(hash, mesh->sources, mesh->vertex_count * sizeof(trimesh_source));
    hash = tk_hash(hash, mesh->kinds, mesh->vertex_count);

    memset(&spread, 0, sizeof spread);
    memset(&scatter, 0, sizeof scatter);
    spread.points = 12;
    if (trimesh_reference_patch(&spread, env, points, 64, &patch.count) != TXM_OK)
        give_up("patch", env);
    patch.points = points;
    scatter.mesh = trimesh_as_view(mesh);
    scatter.normals = mesh->normals;
    scatter.patches = &patch;
    scatter.patch_count = 1;
    if (trimesh_scatter(&scatter, env, things, 1 << 14, &count) != TXM_OK) give_up("scatter", env);
    hash = tk_hash(hash, things, count * sizeof *things);
    trimesh_free(mesh);
    return hash;
}

/* Hash over some trees of a species: how they grew, their bones in the wind, one as a mesh, its leaves. */
static uint64_t run_trees(int preset, txm_env *env, uint64_t hash) {
    enum { TREES = 5, PICTURE = 48 };
    static uint8_t leaves[PICTURE * PICTURE * 4], color[PICTURE * PICTURE * 4];
    static float depth[PICTURE * PICTURE];
    static treepieces_card cards[256];
    const char *text = treepieces_preset_text(preset);
    const treepieces_wind wind = {0.3f, 9, 0.7f, 5};
    const treepieces_lod lod = {{1, 2, 3}, 3, 4, 0};
    treepieces_species species;
    treepieces_kit *kit;
    treepieces_forest *forest;
    treepieces_mesh *mesh;
    if (treepieces_species_parse(text, strlen(text), env, &species) != TXM_OK) give_up("species", env);
    if (treepieces_kit_make(NULL, 0, env, &kit) != TXM_OK) give_up("kit", env);
    treepieces_forest_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.kit = kit;
    desc.species = &species;
    desc.species_count = 1;
    desc.tree_count = TREES;
    desc.max_pieces = 250;
    desc.seed = 11;
    if (treepieces_forest_make(&desc, env, &forest) != TXM_OK) give_up("forest", env);
    hash = tk_hash(hash, forest->nodes, forest->node_count * sizeof *forest->nodes);
    hash = tk_hash(hash, forest->clusters, forest->cluster_count * sizeof *forest->clusters);
    for (int t = 0; t < forest->type_count; t++) {
        const treepieces_batch *b = &forest->batches[t];
        if (b->count) hash = tk_hash(hash, b->words, (size_t)b->count * b->stride * 4);
    }

    float *bones = (float *)malloc(forest->node_count * TREEPIECES_BONE * sizeof(float));
    float *sway = (float *)calloc(forest->node_count, 4 * sizeof(float));
    if (!bones || !sway) give_up("bones", env);
    for (int i = 0; i < 9; i++)
        if (treepieces_sway(forest, &wind, 0.1 * i, 0.1, NULL, env, sway, bones) != TXM_OK)
            give_up("sway", env);
    hash = tk_hash(hash, bones, forest->node_count * TREEPIECES_BONE * sizeof(float));

    treepieces_bake_desc bake;
    memset(&bake, 0, sizeof bake);
    bake.forest = forest;
    bake.bones = bones;
    bake.lod = &lod;
    if (treepieces_bake(&bake, env, &mesh) != TXM_OK) give_up("bake", env);
    hash = tk_hash(hash, mesh->positions, 3 * mesh->vertex_count * sizeof(float));
    hash = tk_hash(hash, mesh->normals, 3 * mesh->vertex_count * sizeof(float));
    hash = tk_hash(hash, mesh->indices, 3 * mesh->triangle_count * sizeof(uint32_t));
    hash = tk_hash(hash, mesh->uvs, 6 * mesh->triangle_count * sizeof(float));
    treepieces_mesh_free(mesh);

    const int count = treepieces_cloud(&species, 3, cards);
    hash = tk_hash(hash, cards, (size_t)count * sizeof *cards);
    if (count > 0) {
        const txm_image picture = {leaves, PICTURE, PICTURE, 4, TXM_U8, 0};
        const txm_image seen = {color, PICTURE, PICTURE, 4, TXM_U8, 0};
        const txm_image far = {depth, PICTURE, PICTURE, 1, TXM_F32, 0};
        treepieces_impostor_desc impostor;
        memset(&impostor, 0, sizeof impostor);
        if (treepieces_draw_leaves(&species, 1, env, picture) != TXM_OK) give_up("leaves", env);
        impostor.cards = cards;
        impostor.card_count = count;
        impostor.leaves = picture;
        impostor.right[0] = impostor.up[1] = impostor.light[1] = 1;
        impostor.forward[2] = -1;
        if (treepieces_impostor(&impostor, env, seen, far) != TXM_OK) give_up("impostor", env);
        hash = tk_hash(hash, leaves, sizeof leaves);
        hash = tk_hash(hash, color, sizeof color);
        hash = tk_hash(hash, depth, sizeof depth);
    }
    free(bones);
    free(sway);
    treepieces_forest_free(forest);
    treepieces_kit_free(kit);
    return hash;
}

int main(int argc, char **argv) {
    int threads = argc > 1 ? atoi(argv[1]) : 1;
    txm_env env;
    memset(&env, 0, sizeof env);
    if (threads == 0) env.parallel_for = tk_parallel_reverse; /* one thread, backwards */
    if (threads > 1) {
        env.parallel_for = tk_parallel_threads;
        env.parallel_user = &threads;
    }
    uint64_t hash = run(1, 0, &env, 0);
    hash = run(3, 1, &env, hash);
    hash = run(4, 0, &env, hash);
    hash = run_tiles(TEXTILES_WANG, 3, &env, hash);
    hash = run_tiles(TEXTILES_TRIANGLE, 1, &env, hash);
    hash = run_patch(3, TEXPATCH_TILE_X | TEXPATCH_TILE_Y, 1, &env, hash);
    hash = run_patch(1, 0, 4, &env, hash);
    for (int open = 0; open < 2; open++) {
        hash = run_mesh(TRIMESH_LATTICE, open, &env, hash);
        hash = run_mesh(TRIMESH_REPEL, open, &env, hash);
    }
    for (int preset = 0; preset < 2; preset++) hash = run_trees(preset, &env, hash);
    printf("%08lx%08lx\n", (unsigned long)(hash >> 32), (unsigned long)(hash & 0xffffffffu));
    return 0;
}
