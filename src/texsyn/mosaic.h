#ifndef TEXSYN_MOSAIC_H
#define TEXSYN_MOSAIC_H

#include "ground.h"

/* ---- the canvas of a mosaic --------------------------------------------------------------

   Planes of one level: the bands, each pixel quantised as its label's model says; the bands of the
   coarser level at this resolution (only if the models use parents); then planes of labels. Outside
   lies a margin without labels, so the canvas is no torus. Which members a clique may have is asked
   of the planes of labels, at the same offsets as of the values:

     label   of all pixels
     sample  of source pixels, TXS_NO_LABEL elsewhere: where target statistics are taken
     parent  of pixels that have a parent of their own label, TXS_NO_LABEL elsewhere

   Where not all colours are visible a last plane has their weights (alpha.h).              */
typedef struct txs_mosaic {
    txs_canvas canvas;
    int labels, bands;
    ptrdiff_t label, sample, parent; /* from plane 0 to these planes; parent 0 = no parents */
    ptrdiff_t weight;                /* the same; 0 = all is visible                        */
    const uint8_t *state;            /* of the ground */
} txs_mosaic;

/* What a label's texture is on this level. */
typedef struct txs_texture {
    const texsyn_model *model;
    txs_level *level;
} txs_texture;

static ptrdiff_t txs_pixel_offset(const txs_mosaic *m, int x, int y) {
    return (y + m->canvas.margin) * m->canvas.stride + x + m->canvas.margin;
}

static uint8_t *txs_pixel(const txs_mosaic *m, int x, int y) {
    return m->canvas.pixels + txs_pixel_offset(m, x, y);
}

static int txs_is_free(const txs_mosaic *m, int x, int y) {
    return m->state[(size_t)y * (size_t)m->canvas.width + (size_t)x] == TXS_FREE &&
           txs_pixel(m, x, y)[m->label] != TXS_NO_LABEL;
}

/* A canvas for a ground, with a margin as wide as the longest clique, and its planes of labels.
   Returns 0 if there is no memory; release it with txs_mosaic_free. */
static int txs_mosaic_make(txs_mosaic *m, const txm_env *env, const txs_ground *g, int labels,
                           int margin, int has_parents) {
    const int planes = g->bands * (has_parents ? 2 : 1), has_weights = g->weight != NULL;
    memset(m, 0, sizeof *m);
    if (!txs_canvas_make(&m->canvas, env, g->width, g->height, margin,
                         planes + 2 + has_parents + has_weights))
        return 0;
    m->labels = labels;
    m->bands = g->bands;
    m->label = planes * m->canvas.plane;
    m->sample = m->label + m->canvas.plane;
    m->parent = has_parents ? m->sample + m->canvas.plane : 0;
    m->weight = has_weights ? m->sample + (1 + has_parents) * m->canvas.plane : 0;
    m->state = g->state;
    memset(m->canvas.pixels + m->label, TXS_NO_LABEL,
           (size_t)m->canvas.plane * (size_t)(2 + has_parents));
    for (int y = 0; y < g->height; y++) {
        for (int x = 0; x < g->width; x++) {
            const size_t i = (size_t)y * (size_t)g->width + (size_t)x;
            uint8_t *p = txs_pixel(m, x, y);
            p[m->label] = g->label[i];
            if (g->state[i] == TXS_SOURCE) p[m->sample] = g->label[i];
            if (has_weights) p[m->weight] = g->weight[i];
        }
    }
    return 1;
}

static void txs_mosaic_free(txs_mosaic *m, const txm_env *env) {
    txs_canvas_free(&m->canvas, env);
}

/* Quantise what is known; free pixels become even noise (step 2 of [1]). */
static void txs_mosaic_lay(txs_mosaic *m, const txs_ground *g, const txs_texture *texture,
                           uint64_t seed) {
    const size_t pixels = (size_t)g->width * (size_t)g->height;
    txm_rng rng = txm_rng_make(seed, 3);
    for (int y = 0; y < g->height; y++) {
        for (int x = 0; x < g->width; x++) {
            const size_t i = (size_t)y * (size_t)g->width + (size_t)x;
            uint8_t *p = txs_pixel(m, x, y);
            if (g->label[i] == TXS_NO_LABEL) continue;
            const txs_texture *t = &texture[g->label[i]];
            for (int b = 0; b < t->model->bands; b++) {
                const int v =
                    g->state[i] == TXS_FREE
                        ? (int)txm_rng_below(&rng, (uint32_t)t->level->values[b])
                        : txs_quantise(t->level, b, (double)g->value[(size_t)b * pixels + i]);
                p[b * m->canvas.plane] = (uint8_t)v;
            }
        }
    }
}

/* The pixels of the coarser canvas round a pixel that have its label: their offsets and weights;
   returns the sum of the weights, of 16. */
static int txs_parents_of(const txs_mosaic *coarse, int x, int y, int label, ptrdiff_t at[4],
                          int weight[4]) {
    int sum = 0;
    for (int i = 0; i < 4; i++) {
        const int cx = x / 2 + (i % 2 ? (x & 1 ? 1 : -1) : 0);
        const int cy = y / 2 + (i / 2 ? (y & 1 ? 1 : -1) : 0);
        at[i] = txs_pixel_offset(coarse, cx, cy); /* at most a pixel outside, in the margin */
        weight[i] = coarse->canvas.pixels[at[i] + coarse->label] == label
                        ? (i % 2 ? 1 : 3) * (i / 2 ? 1 : 3)
                        : 0;
        sum += weight[i];
    }
    return sum;
}

/* Values of the coarser level in sixteenths to values of this one. */
typedef uint8_t txs_raise_map[TXS_MAX_BANDS][16 * TXS_VALUES];

static void txs_raise_map_make(const txs_level *above, const txs_level *level, int bands,
                               txs_raise_map map) {
    for (int b = 0; b < bands; b++)
        for (int q = 0; q < 16 * TXS_VALUES; q++)
            map[b][q] = (uint8_t)txs_quantise(level, b, txs_value(above, b, q / 16.0));
}

/* Interpolate the coarser canvas among pixels of the same label: free pixels start from it, and it
   becomes the parent planes if there are such. maps: one for each label. */
static void txs_mosaic_raise(txs_mosaic *m, const txs_mosaic *coarse, const txs_texture *above,
                             const txs_texture *texture, txs_raise_map *maps) {
    for (int k = 0; k < m->labels; k++)
        txs_raise_map_make(above[k].level, texture[k].level, texture[k].model->bands, maps[k]);
    for (int y = 0; y < m->canvas.height; y++) {
        for (int x = 0; x < m->canvas.width; x++) {
            uint8_t *p = txs_pixel(m, x, y);
            const int label = p[m->label], is_free = txs_is_free(m, x, y);
            ptrdiff_t at[4];
            int weight[4], sum;
            if (label == TXS_NO_LABEL || (!is_free && !m->parent)) continue;
            sum = txs_parents_of(coarse, x, y, label, at, weight);
            if (!sum) continue;
            for (int b = 0; b < texture[label].model->bands; b++) {
                const uint8_t *q = coarse->canvas.pixels + b * coarse->canvas.plane;
                int value = sum / 2;
                for (int i = 0; i < 4; i++) value += 16 * weight[i] * q[at[i]];
                const uint8_t v = maps[label][b][value / sum];
                if (is_free) p[b * m->canvas.plane] = v;
                if (m->parent) p[(m->bands + b) * m->canvas.plane] = v;
            }
            if (m->parent) p[m->parent] = (uint8_t)label;
        }
    }
}

enum { TXS_UNREACHED, TXS_REACHED, TXS_REACHED_NOW };

/* Copy the values of a neighbour that has some already and the same label; 0 if there is none. */
static int txs_grow_pixel(txs_mosaic *m, const uint8_t *reached, int x, int y, txm_rng *rng) {
    const uint32_t first = txm_rng_below(rng, 8);
    uint8_t *p = txs_pixel(m, x, y);
    for (uint32_t k = 0; k < 8; k++) {
        const int turn = (int)((first + k) & 7), at = turn + (turn > 3); /* of 3 x 3 without 4 */
        const int nx = x + at % 3 - 1, ny = y + at / 3 - 1;
        if (nx < 0 || ny < 0 || nx >= m->canvas.width || ny >= m->canvas.height) continue;
        const uint8_t *q = txs_pixel(m, nx, ny);
        if (reached[(size_t)ny * (size_t)m->canvas.width + (size_t)nx] != TXS_REACHED ||
            q[m->label] != p[m->label])
            continue;
        for (int b = 0; b < m->bands; b++) p[b * m->canvas.plane] = q[b * m->canvas.plane];
        return 1;
    }
    return 0;
}

/* Start free pixels from known ones: ring after ring, each pixel copies a neighbour. What is reached
   from no known pixel keeps its value. reached: a byte for each pixel. */
static void txs_mosaic_grow(txs_mosaic *m, uint8_t *reached, uint64_t seed) {
    const int width = m->canvas.width, pixels = width * m->canvas.height;
    txm_rng rng = txm_rng_make(seed, 5);
    for (int i = 0; i < pixels; i++)
        reached[i] = !txs_is_free(m, i % width, i / width) ? TXS_REACHED : TXS_UNREACHED;
    for (int grown = 1; grown;) {
        grown = 0;
        for (int i = 0; i < pixels; i++) {
            if (reached[i] != TXS_UNREACHED) continue;
            if (!txs_grow_pixel(m, reached, i % width, i / width, &rng)) continue;
            reached[i] = TXS_REACHED_NOW;
            grown = 1;
        }
        for (int i = 0; i < pixels; i++)
            if (reached[i] == TXS_REACHED_NOW) reached[i] = TXS_REACHED;
    }
}

/* ---- who may be in a clique ----------------------------------------------------------- */

/* The other members of a clique and their label: it counts if all of them have it. */
typedef struct txs_guard {
    ptrdiff_t at[3]; /* from a pixel of plane 0 into planes of labels */
    int count, label;
} txs_guard;

static int txs_holds(const txs_guard *g, const uint8_t *p) {
    for (int i = 0; i < g->count; i++)
        if (p[g->at[i]] != g->label) return 0;
    return 1;
}

/* The guard of a clique type for the pixel that is its given member. labels: the plane that the
   members are looked up in. */
static txs_guard txs_guard_make(const txs_mosaic *m, const txs_type *t, int label, int member,
                                ptrdiff_t labels) {
    int at[4][2], members = txs_members(t, at);
    txs_guard g;
    memset(&g, 0, sizeof g);
    g.label = label;
    if (t->kind == TEXSYN_PARENT) g.at[g.count++] = m->parent;
    for (int i = 0; i < members; i++) {
        const int is_parent = t->kind == TEXSYN_SCALE && i >= 2;
        if (i == member) continue;
        TEXSYN_ASSERT(g.count < (int)(sizeof g.at / sizeof *g.at));
        g.at[g.count++] = (at[i][1] - at[member][1]) * m->canvas.stride + at[i][0] - at[member][0] +
                          (is_parent ? m->parent : labels);
    }
    return g;
}

/* Is a clique type of a kind that mosaics know? */
static int txs_mosaic_knows(const txs_mosaic *m, const txs_type *t) {
    if (t->kind > TEXSYN_PARALLEL) return 0;
    return m->parent || (t->kind != TEXSYN_PARENT && t->kind != TEXSYN_SCALE);
}

/* ---- lists of pixels ------------------------------------------------------------------ */

/* Pixels of one label: first those round which all pixels within the reach have the same label
   ("pure"), so that nothing needs to be checked. */
typedef struct txs_pixels {
    int32_t *at; /* from the first byte of the canvas */
    int pure, count;
} txs_pixels;

/* For each pixel: how far do the pixels to the left of it, and it, have equal labels? And the same
   for the square. The planes of labels and of parents must agree. */
static int txs_is_same(const txs_mosaic *m, const uint8_t *p, ptrdiff_t labels) {
    return p[labels] != TXS_NO_LABEL && (!m->parent || p[m->parent] == p[labels]);
}

/* Mark (1) the pixels whose square of the given reach has one label only; purity: a byte for each
   pixel, columns: a number for each column. */
static void txs_find_pure(const txs_mosaic *m, ptrdiff_t labels, int reach, uint8_t *purity,
                          int *columns) {
    const int width = m->canvas.width, height = m->canvas.height, side = 2 * reach + 1;
    memset(purity, 0, (size_t)width * (size_t)height);
    for (int x = 0; x < width; x++) columns[x] = 0;
    for (int y = 0; y < height; y++) {
        const uint8_t *row = txs_pixel(m, 0, y), *above = row - m->canvas.stride;
        for (int x = 0, run = 0; x < width; x++) {
            const int same = txs_is_same(m, row + x, labels);
            run = !same ? 0 : run && row[x - 1 + labels] == row[x + labels] ? run + 1 : 1;
            /* columns[x]: rows whose last `side` pixels up to x have one label, the same in all */
            if (run < side) columns[x] = 0;
            else columns[x] = above[x + labels] == row[x + labels] ? columns[x] + 1 : 1;
            if (columns[x] >= side)
                purity[(size_t)(y - reach) * (size_t)width + (size_t)(x - reach)] = 1;
        }
    }
}

#endif /* TEXSYN_MOSAIC_H */
