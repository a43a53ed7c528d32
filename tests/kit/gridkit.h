/* gridkit.h - what the tests of tilings share: sets of gray tiles, checks, calls under faults
   SPDX-License-Identifier: MIT OR Unlicense

   Includes cmocka.h, textiles.h and testkit.h. What the tiles show plays no part here: all sets are
   imported from one gray picture.                                                             */
#ifndef GRIDKIT_H
#define GRIDKIT_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "textiles.h"

#include "testkit.h"

/* ---- helpers ---------------------------------------------------------------------------- */

enum { N = 32, FILL = 0x5c5c5c5c, MOST = 256 * 16 };

static inline textiles_desc desc_of(textiles_kind kind, int colors, int variants, int reduced) {
    textiles_desc d;
    memset(&d, 0, sizeof d);
    d.kind = kind;
    d.size = N;
    d.colors = colors;
    d.variants = variants;
    d.reduced = reduced;
    return d;
}

/* how many tiles a description stands for, by the formulas of the literature */
static inline int count_of(const textiles_desc *d) {
    const int c = d->colors, v = d->variants;
    switch (d->kind) {
    case TEXTILES_WANG: return v * (d->reduced ? 2 * c * c : c * c * c * c);
    case TEXTILES_CORNER: return v * c * c * c * c;
    case TEXTILES_TRIANGLE: return v * (d->reduced ? 2 * c * c * c : (8 * c * c * c + 4 * c) / 3);
    case TEXTILES_FRAME: break;
    }
    return v * (d->classes ? d->class_count : c);
}

static inline textiles_set *import(const textiles_desc *d) {
    static uint8_t pixels[(N + 1) * (N + 1)];
    static txm_image tiles[MOST];
    const int side = N + (d->kind == TEXTILES_TRIANGLE), count = count_of(d);
    txm_env env = {0};
    textiles_set *set = NULL;
    for (int i = 0; i < count; i++) {
        memset(&tiles[i], 0, sizeof tiles[i]);
        tiles[i].pixels = pixels;
        tiles[i].width = tiles[i].height = side;
    }
    const txm_status status = textiles_import(d, tiles, count, 1, &env, &set);
    if (status != TXM_OK) fail_msg("import: %d, %s", status, env.message);
    assert_int_equal(textiles_count(set), count);
    return set;
}

static inline textiles_set *make_set(textiles_kind kind, int colors, int variants, int reduced) {
    const textiles_desc d = desc_of(kind, colors, variants, reduced);
    return import(&d);
}

static inline textiles_set *make_frame(const int (*classes)[4], int count, int colors, int variants) {
    textiles_desc d = desc_of(TEXTILES_FRAME, colors, variants, 0);
    d.classes = classes;
    d.class_count = count;
    return import(&d);
}

/* classes on which a random walk gets stuck but which cover any grid */
static const int stubborn[6][4] = {{0, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 1},
                                   {1, 0, 0, 1}, {1, 1, 1, 1}, {1, 1, 0, 0}};

static inline textiles_tile tile_at(const textiles_set *set, int index) {
    textiles_tile t;
    if (!textiles_tile_at(set, index, &t)) fail_msg("no tile %d", index);
    return t;
}

/* the right neighbour continues the left one, the lower one the upper */
static inline int joins(const textiles_set *set, int a, int b, int down) {
    const textiles_tile s = tile_at(set, a), t = tile_at(set, b);
    if (textiles_kind_of(set) == TEXTILES_CORNER)
        return down ? s.edges[3] == t.edges[0] && s.edges[2] == t.edges[1]
                    : s.edges[1] == t.edges[0] && s.edges[2] == t.edges[3];
    return down ? s.edges[2] == t.edges[0] : s.edges[1] == t.edges[3];
}

static inline void check_joins(const textiles_set *set, const int *tiles, int width, int height,
                               int periodic) {
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            const int t = tiles[y * width + x], right = (x + 1) % width, below = (y + 1) % height;
            if (t < 0 || t >= textiles_count(set)) fail_msg("(%d, %d): tile %d", x, y, t);
            if ((right || periodic) && !joins(set, t, tiles[y * width + right], 0))
                fail_msg("(%d, %d) does not join its right neighbour", x, y);
            if ((below || periodic) && !joins(set, t, tiles[below * width + x], 1))
                fail_msg("(%d, %d) does not join the one below", x, y);
        }
    }
}

/* how often a tile lies three times in a row */
static inline int count_runs(const int *tiles, int width, int height, int periodic) {
    int runs = 0;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            const int *row = tiles + y * width, t = row[x];
            if (width > 1 && (periodic || x + 2 < width))
                runs += t == row[(x + 1) % width] && t == row[(x + 2) % width];
            if (height > 1 && (periodic || y + 2 < height))
                runs += t == tiles[(y + 1) % height * width + x] &&
                        t == tiles[(y + 2) % height * width + x];
        }
    }
    return runs;
}

/* every tile within so many standard deviations of its share, if the shares are equal */
static inline void check_usage(const int *tiles, int count, int kinds, double deviations) {
    static int used[MOST];
    const double mean = (double)count / kinds;
    memset(used, 0, sizeof used);
    for (int i = 0; i < count; i++) used[tiles[i]]++;
    for (int t = 0; t < kinds; t++) {
        if (!(fabs(used[t] - mean) <= deviations * sqrt(mean)))
            fail_msg("tile %d of %d: %d times, not about %g", t, kinds, used[t], mean);
    }
}

static inline int differences(const int *a, const int *b, int count) {
    int n = 0;
    for (int i = 0; i < count; i++) n += a[i] != b[i];
    return n;
}

static inline void fill(int *tiles, int count, int value) {
    for (int i = 0; i < count; i++) tiles[i] = value;
}

static inline void assert_filled(const int *tiles, int count, int value) {
    for (int i = 0; i < count; i++)
        if (tiles[i] != value) fail_msg("number %d was touched", i);
}

/* a random number of any bits */
static inline int any_int(txm_rng *rng) {
    return txm_rng_range(rng, INT_MIN, INT_MAX);
}
static inline int wrapped(int x, int step) {
    return (int)((uint32_t)x + (uint32_t)step);
}

/* ---- tiling under constraints ----------------------------------------------------------- */

enum { SOLVE_CASES = 16 };

static inline textiles_set *solve_case(int i) {
    static const int cases[SOLVE_CASES][4] = {
        {TEXTILES_WANG, 2, 1, 0},   {TEXTILES_WANG, 2, 3, 0},   {TEXTILES_WANG, 3, 2, 0},
        {TEXTILES_WANG, 4, 1, 0},   {TEXTILES_WANG, 2, 1, 1},   {TEXTILES_WANG, 2, 4, 1},
        {TEXTILES_WANG, 3, 1, 1},   {TEXTILES_WANG, 4, 2, 1},   {TEXTILES_CORNER, 2, 1, 0},
        {TEXTILES_CORNER, 2, 3, 0}, {TEXTILES_CORNER, 3, 1, 0}, {TEXTILES_CORNER, 4, 2, 0},
        {TEXTILES_FRAME, 1, 2, 0},  {TEXTILES_FRAME, 3, 1, 0},  {TEXTILES_FRAME, 2, 3, 0},
        {TEXTILES_FRAME, 2, 2, 0}};
    if (i == SOLVE_CASES - 1) return make_frame(stubborn, 6, 2, 2);
    return make_set((textiles_kind)cases[i][0], cases[i][1], cases[i][2], cases[i][3]);
}

static inline void solve(const textiles_set *set, int w, int h, int periodic, uint64_t seed, int *tiles) {
    tk_progress progress = {0};
    txm_env env = tk_env(NULL, &progress);
    const txm_status status = textiles_solve(set, w, h, periodic, seed, &env, tiles);
    if (status != TXM_OK) fail_msg("solve %d x %d: %d, %s", w, h, status, env.message);
    assert_int_equal(progress.errors, 0);
}

/* ---- failing memory, cancelling --------------------------------------------------------- */

/* A call with its outputs; what: 0 solve, 1 triangles, 2 quads. */
typedef struct call {
    int what;
    textiles_set *set;
    const uint32_t *indices;
    const int *edges;
    size_t faces, vertices;
    int in[4096], out[2][4096], good[2][4096];
    int good_known;
} call;

/* Make the call: if it fails, the outputs must be untouched, else the same each time. */
static inline txm_status run(void *context, txm_env *env) {
    call *c = (call *)context;
    txm_status status;
    memcpy(c->out[0], c->in, sizeof c->in);
    memcpy(c->out[1], c->in, sizeof c->in);
    if (c->what == 0)
        status = textiles_solve(c->set, 40, 50, 1, 3, env, c->out[0]);
    else if (c->what == 1)
        status = textiles_assign_triangles(c->set, c->indices, c->faces, c->vertices, 3, env,
                                           c->out[0], c->out[1]);
    else
        status = textiles_assign_quads(c->set, c->indices, c->faces, c->vertices, c->edges, 3, env,
                                       c->out[0]);
    if (status != TXM_OK) {
        assert_memory_equal(c->out[0], c->in, sizeof c->in);
        assert_memory_equal(c->out[1], c->in, sizeof c->in);
    } else if (c->good_known) {
        assert_memory_equal(c->out, c->good, sizeof c->good);
    }
    return status;
}

static inline void check_faults(call *c) {
    c->good_known = 0;
    assert_int_equal(run(c, NULL), TXM_OK);
    memcpy(c->good, c->out, sizeof c->good);
    c->good_known = 1;
    assert_true(tk_sweep(run, c, TK_ALLOCATION) > 0);
    assert_true(tk_sweep(run, c, TK_ONWARD) > 0);
    assert_true(tk_sweep(run, c, TK_CANCEL) > 1);
}

#endif /* GRIDKIT_H */
