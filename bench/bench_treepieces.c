/* bench_treepieces.c - seconds and memory of treepieces.h: bench_treepieces [ANYTHING...]
   SPDX-License-Identifier: MIT OR Unlicense

   Grows 1,000 trees of each species with a limit of pieces that gives them some 4,000 base triangles
   each, and 1,000 with the default limit; moves their bones in the wind; bakes one tree. One thread,
   the best of several runs. "grown": in memory that was used before, as by a program that keeps a
   pool; "fresh": in memory new from the system, where first access takes most of the time. Names of
   pictures, which `make bench` gives to every benchmark, are ignored.                            */
#define _XOPEN_SOURCE 700 /* clock_gettime, popen */
#define TREEPIECES_IMPLEMENTATION
#include "treepieces.h"

#include "bench.h"

enum { TREES = 1000, RUNS = 7, FEW = 154 };

/* ---- a pool: blocks one after the other, all released at once ----------------------------------- */

static unsigned char *pool;
static size_t pool_size, pool_used;

static void *pool_allocate(void *user, size_t bytes) {
    (void)user;
    const size_t size = (bytes + 63) / 64 * 64;
    if (size > pool_size - pool_used) return NULL;
    pool_used += size;
    return pool + pool_used - size;
}

static void pool_release(void *user, void *block) {
    (void)user;
    (void)block;
}

/* ---- one species ------------------------------------------------------------------------------- */

static treepieces_forest *grow(const treepieces_forest_desc *desc, txm_env *env, double *seconds) {
    treepieces_forest *forest = NULL;
    result best = no_result;
    for (int i = 0; i < RUNS; i++) {
        treepieces_forest_free(forest);
        pool_used = 0;
        const watch w = start();
        if (treepieces_forest_make(desc, env, &forest) != TXM_OK) give_up("forest", env->message);
        stop(&w, &best);
    }
    *seconds = best.seconds;
    return forest;
}

static double sway(const treepieces_forest *forest, float *state, float *bones) {
    const treepieces_wind wind = {0.3f, 8, 0.6f, 1, 0};
    result best = no_result;
    for (int i = 0; i < RUNS; i++) {
        const watch w = start();
        treepieces_sway(forest, &wind, i / 60.0, 1 / 60.0, NULL, NULL, state, bones);
        stop(&w, &best);
    }
    return best.seconds;
}

static void measure(const treepieces_kit *kit, const treepieces_species *species, int pieces) {
    treepieces_forest_desc desc;
    treepieces_bake_desc bake;
    treepieces_mesh *mesh;
    txm_env plain, pooled;
    double grown, fresh;
    size_t triangles = 0;
    memset(&desc, 0, sizeof desc);
    memset(&bake, 0, sizeof bake);
    memset(&plain, 0, sizeof plain);
    memset(&pooled, 0, sizeof pooled);
    pooled.allocate = pool_allocate;
    pooled.release = pool_release;
    desc.kit = kit;
    desc.species = species;
    desc.species_count = 1;
    desc.tree_count = TREES;
    desc.max_pieces = pieces;
    desc.seed = 1;
    treepieces_forest_free(grow(&desc, &pooled, &grown));
    treepieces_forest *forest = grow(&desc, &plain, &fresh);
    for (int t = 0; t < forest->type_count; t++)
        triangles += 2 * (size_t)forest->batches[t].count * (size_t)forest->batches[t].quad_count;
    float *bones = (float *)malloc(forest->node_count * TREEPIECES_BONE * sizeof(float));
    float *state = (float *)calloc(forest->node_count, 4 * sizeof(float));
    if (!bones || !state) give_up("bones", "out of memory");
    const double frame = sway(forest, state, bones);
    bake.forest = forest;
    bake.bones = bones;
    result baked = no_result;
    const watch w = start();
    if (treepieces_bake(&bake, &plain, &mesh) != TXM_OK) give_up("bake", plain.message);
    stop(&w, &baked);
    const double kilobytes = ((double)forest->bytes + forest->node_count * 64.0) / 1024 / TREES;
    printf("%-8s %8.0f %9.0f %8.1f %8.1f %8.1f %8.1f %8.2f\n", species->name,
           (double)forest->node_count / TREES, (double)triangles / TREES, 1e3 * grown, 1e3 * fresh,
           1e3 * frame, kilobytes, 1e3 * baked.seconds);
    treepieces_mesh_free(mesh);
    treepieces_forest_free(forest);
    free(bones);
    free(state);
}

int main(void) {
    treepieces_kit *kit;
    txm_env env;
    memset(&env, 0, sizeof env);
    pool_size = (size_t)1 << 28;
    pool = (unsigned char *)malloc(pool_size);
    if (!pool) give_up("pool", "out of memory");
    memset(pool, 1, pool_size);
    if (treepieces_kit_make(NULL, 0, &env, &kit) != TXM_OK) give_up("kit", env.message);
    for (int few = 1; few >= 0; few--) {
        printf("%s1,000 trees of %s pieces each\n", few ? "" : "\n", few ? "at most 154" : "at most 600");
        printf("species    pieces triangles grown ms fresh ms frame ms  KB/tree bake one\n");
        for (int i = 0; i < treepieces_preset_count(); i++) {
            const char *text = treepieces_preset_text(i);
            treepieces_species species;
            if (treepieces_species_parse(text, strlen(text), &env, &species) != TXM_OK)
                give_up("species", env.message);
            measure(kit, &species, few ? FEW : 0);
        }
    }
    treepieces_kit_free(kit);
    free(pool);
    return 0;
}
