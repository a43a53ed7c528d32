/* growkit.h - what the unit tests of treepieces.h share: a kit of pieces, forests and their bones
   SPDX-License-Identifier: MIT OR Unlicense

   Includes cmocka.h, treepieces.h, images.h and testkit.h.                                      */
#ifndef GROWKIT_H
#define GROWKIT_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "treepieces.h"

#include "images.h"
#include "testkit.h"

/* What all tests of a program use; made by set_up. */
static treepieces_kit *kit;
static treepieces_species oak;

static inline int set_up(void **state) {
    (void)state;
    return treepieces_kit_make(NULL, 0, NULL, &kit) != TXM_OK ||
           treepieces_preset("oak", NULL, &oak) != TXM_OK;
}
static inline int tear_down(void **state) {
    (void)state;
    treepieces_kit_free(kit);
    return 0;
}

/* cleared memory of just this size, never NULL */
static inline void *room(size_t count, size_t size) {
    void *p = calloc(count ? count : 1, size);
    assert_non_null(p);
    return p;
}

static inline float dot(const float a[3], const float b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* so many oaks of at most so many pieces */
static inline treepieces_forest_desc describe(int trees, int pieces) {
    treepieces_forest_desc d;
    memset(&d, 0, sizeof d);
    d.kit = kit;
    d.species = &oak;
    d.species_count = 1;
    d.tree_count = trees;
    d.max_pieces = pieces;
    d.seed = 5;
    return d;
}

static inline treepieces_forest *grow(const treepieces_forest_desc *d) {
    txm_env env = tk_env(NULL, NULL);
    treepieces_forest *f;
    if (treepieces_forest_make(d, &env, &f) != TXM_OK) fail_msg("%s", env.message);
    return f;
}

static inline float *make_bones(const treepieces_forest *f, const treepieces_pose *pose) {
    float *bones = (float *)room(f->node_count, TREEPIECES_BONE * sizeof(float));
    assert_int_equal(treepieces_bones(f, pose, NULL, bones), TXM_OK);
    return bones;
}

/* A forest with its bones. */
typedef struct grown {
    treepieces_forest *forest;
    float *bones;
} grown;

static inline grown grow_posed(const treepieces_forest_desc *d, float amount, uint64_t seed) {
    grown g;
    treepieces_pose pose;
    memset(&pose, 0, sizeof pose);
    pose.amount = amount;
    pose.seed = seed;
    g.forest = grow(d);
    g.bones = make_bones(g.forest, &pose);
    return g;
}

static inline void free_grown(grown *g) {
    treepieces_forest_free(g->forest);
    free(g->bones);
}

/* ---- pictures ---- */

static inline txm_image make_image(int width, int height, int channels, txm_sample sample) {
    const size_t pixel = (size_t)channels * txm_sample_bytes(sample);
    void *pixels = room((size_t)width * (size_t)height, pixel);
    return view(pixels, width, height, channels, sample);
}

static inline size_t image_bytes(const txm_image *i) {
    return (size_t)i->width * (size_t)i->height * (size_t)i->channels * txm_sample_bytes(i->sample);
}

static inline uint64_t hash_image(const txm_image *i) {
    return tk_hash(0, i->pixels, image_bytes(i));
}

static inline const uint8_t *rgba(const txm_image *i, int x, int y) {
    return (const uint8_t *)txm_image_row_const(i, y) + 4 * x;
}

#endif /* GROWKIT_H */
