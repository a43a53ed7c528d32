#ifndef TEXSYN_GROUND_H
#define TEXSYN_GROUND_H

#include "example.h"

/* ---- the ground of a mosaic --------------------------------------------------------------

   A mosaic is a picture of several textures, each pixel of which has the label of one of them. Its
   parts are, in this order:

     ground.h          a labelled picture and its pyramid: this part
     mosaic.h          one level of it as a canvas of quantised values
     mosaic_sampler.h  Gibbs sampling of that canvas
     mosaic_learner.h  the statistics of its textures
     tone.h            from quantised values back to smooth ones

   How a caller uses them (fill.h does):

     1. Make the ground: labels, what is known, and the values of what is known, each pixel in the
        bands of its own label's model. txs_ground_halve makes the coarser levels.
     2. For each level, coarse first: txs_mosaic_make and txs_mosaic_lay turn the ground into a
        canvas; txs_mosaic_raise starts it from the coarser one.
     3. txs_mosaic_learn finds the clique types of the level, on this canvas or on another one, and
        leaves it synthesised; or, with models that are known, txs_mosaic_run synthesises only.
     4. txs_tone_apply smooths within the steps of the quantisation.

   Target statistics and canvas are separate: the source is a mosaic whose pixels are known (state
   TXS_SOURCE), the canvas is one with free pixels (state TXS_FREE). Both may be the same object: a
   picture with a hole. A composite texture is learned with the example as the source and its own
   label map, all free, as the canvas, and then synthesised with a new label map.            */

enum {
    TXS_MAX_LABELS = 16,
    TXS_NO_LABEL = 255 /* of pixels that no clique may contain */
};

enum txs_state {
    TXS_FREE,  /* to be synthesised                                     */
    TXS_KNOWN, /* fixed surroundings                                    */
    TXS_SOURCE /* fixed, and the statistics of its label are taken here */
};

typedef struct txs_ground { /* one level of a labelled picture */
    int width, height, bands;
    float *value;   /* planes of the bands, at least where pixels are not free; NULL if all are */
    uint8_t *label; /* 0.. or TXS_NO_LABEL */
    uint8_t *state; /* of enum txs_state   */
    uint8_t *weight; /* of colours where they are known, see alpha.h; NULL = all are opaque */
    int alpha[TXS_MAX_LABELS]; /* of each label: the band of alpha, or -1 */
} txs_ground;

/* Room for a ground; 0 if there is no memory. Labels and states are not set. */
static int txs_ground_make(txs_ground *g, txm_arena *arena, int width, int height, int bands,
                           int has_values) {
    size_t pixels;
    if (!txm_mul((size_t)width, (size_t)height, 1, &pixels)) return 0;
    memset(g, 0, sizeof *g);
    g->width = width;
    g->height = height;
    g->bands = bands;
    g->label = (uint8_t *)txm_arena_alloc(arena, pixels, 1);
    g->state = (uint8_t *)txm_arena_alloc(arena, pixels, 1);
    if (has_values)
        g->value = (float *)txm_arena_zero(arena, pixels, sizeof(float) * (size_t)bands);
    if (has_values && bands == TXS_MAX_BANDS) { /* colours and alpha */
        g->weight = (uint8_t *)txm_arena_alloc(arena, pixels, 1);
        if (g->weight) memset(g->weight, TXS_OPAQUE, pixels);
    }
    for (int k = 0; k < TXS_MAX_LABELS; k++) g->alpha[k] = -1;
    return !arena->failed;
}

/* The label that most of count pixels have, the first of equals. */
static int txs_majority(const uint8_t *labels, int count) {
    int best = TXS_NO_LABEL, most = 0;
    for (int i = 0; i < count; i++) {
        int same = 0;
        for (int j = 0; j < count; j++) same += labels[j] == labels[i];
        if (labels[i] != TXS_NO_LABEL && same > most) {
            most = same;
            best = labels[i];
        }
    }
    return best;
}

/* The mean of the children with a label in a band of it: of colours as far as they are visible. */
static float txs_mean_of_children(const txs_ground *g, const size_t *child, int children, int label,
                                  int band) {
    const float *plane = g->value + (size_t)band * (size_t)g->width * (size_t)g->height;
    const uint8_t *weight = g->alpha[label] == band ? NULL : g->weight;
    double sum = 0, plain = 0, shown = 0;
    int count = 0;
    for (int i = 0; i < children; i++) {
        if (g->label[child[i]] != label) continue;
        plain += (double)plane[child[i]];
        count++;
        if (!weight) continue;
        sum += (double)weight[child[i]] * (double)plane[child[i]];
        shown += weight[child[i]];
    }
    return txm_float(shown > 0 ? sum / shown : plain / count);
}

/* The weight of a coarser pixel: the mean, but not 0 where anything is visible. */
static uint8_t txs_weight_of_children(const txs_ground *g, const size_t *child, int children,
                                      int label) {
    int sum = 0, count = 0;
    for (int i = 0; i < children; i++) {
        if (g->label[child[i]] != label) continue;
        sum += g->weight[child[i]];
        count++;
    }
    if (sum < count) return (uint8_t)(sum > 0);
    return (uint8_t)(count ? sum / count : 0);
}

/* One pixel of the coarser level from the children of it that there are. */
static void txs_halve_pixel(const txs_ground *fine, const size_t *child, int children,
                            txs_ground *coarse, size_t to) {
    uint8_t labels[4], least = TXS_SOURCE;
    int label, any_free = 0;
    for (int i = 0; i < children; i++) labels[i] = fine->label[child[i]];
    label = txs_majority(labels, children);
    for (int i = 0; i < children; i++) {
        const uint8_t state = fine->state[child[i]];
        if (labels[i] != TXS_NO_LABEL && state == TXS_FREE) any_free = 1;
        if (labels[i] == label && state < least) least = state;
    }
    coarse->label[to] = (uint8_t)label;
    coarse->state[to] = any_free ? (uint8_t)TXS_FREE : least;
    if (any_free || !coarse->value || label == TXS_NO_LABEL) return;
    for (int b = 0; b < fine->bands; b++)
        coarse->value[(size_t)b * (size_t)coarse->width * (size_t)coarse->height + to] =
            txs_mean_of_children(fine, child, children, label, b);
    if (coarse->weight)
        coarse->weight[to] = txs_weight_of_children(fine, child, children, label);
}

/* The next coarser level, of half the size, rounded up. A pixel takes the label of most of its
   children and the mean of those; it is free if one of them is. */
static void txs_ground_halve(const txs_ground *fine, txs_ground *coarse) {
    memcpy(coarse->alpha, fine->alpha, sizeof coarse->alpha);
    if (!fine->weight) coarse->weight = NULL;
    for (int y = 0; y < coarse->height; y++) {
        for (int x = 0; x < coarse->width; x++) {
            size_t child[4];
            int children = 0;
            for (int i = 0; i < 4; i++) {
                const int cx = 2 * x + i % 2, cy = 2 * y + i / 2;
                if (cx < fine->width && cy < fine->height)
                    child[children++] = (size_t)cy * (size_t)fine->width + (size_t)cx;
            }
            txs_halve_pixel(fine, child, children, coarse,
                            (size_t)y * (size_t)coarse->width + (size_t)x);
        }
    }
}

/* The bands of a texture: principal components of its visible colours; alpha is a band if it varies,
   the first one if something is hidden.
   mask: a byte for each pixel of the picture, not 0 where the texture is; becomes the weights. If
   nothing is visible there is one band, in which everything is 0. */
static void txs_find_visible_bands(texsyn_model *m, const txm_image *im, uint8_t *mask) {
    const int pixels = im->width * im->height;
    txs_source s;
    int visible = 0, hidden = 0, partial = 0;
    for (int i = 0; i < pixels && m->channels == 4; i++) {
        if (!mask[i]) continue;
        mask[i] = txs_weight_of((double)txm_image_get(im, i % im->width, i / im->width, 3));
        visible += mask[i] > 0;
        hidden += mask[i] == 0;
        partial += mask[i] > 0 && mask[i] < TXS_OPAQUE;
    }
    if (hidden && !visible) {
        m->bands = 1;
        memset(m->mean, 0, sizeof m->mean);
        memset(m->basis, 0, sizeof m->basis);
        m->basis[0][0] = 1;
        return;
    }
    memset(&s, 0, sizeof s);
    s.width = im->width;
    s.height = im->height;
    s.mask = mask;
    s.weight = partial ? mask : NULL;
    txs_find_bands(m, im, &s);
    if (hidden && !txs_is_alpha(m, m->bands - 1)) m->basis[m->bands++][3] = 1;
    if (hidden) txs_put_alpha_first(m);
}

/* Those of the source pixels of a label; im is as large as the ground. mask: scratch, as above. */
static void txs_ground_find_bands(const txs_ground *g, const txm_image *im, int label,
                                  texsyn_model *m, uint8_t *mask) {
    const size_t pixels = (size_t)g->width * (size_t)g->height;
    for (size_t i = 0; i < pixels; i++)
        mask[i] = g->state[i] == TXS_SOURCE && g->label[i] == label;
    txs_find_visible_bands(m, im, mask);
}

/* Set a pixel's values to those of its samples in the bands of a model, and its weight; a
   transparent one has no colour, which is the mean one. */
static void txs_ground_set(txs_ground *g, size_t at, const texsyn_model *m, const float sample[4]) {
    const size_t pixels = (size_t)g->width * (size_t)g->height;
    double c[4] = {0, 0, 0, 0};
    for (int k = 0; k < m->channels; k++)
        c[k] = 255.0 * (double)sample[k] - (double)m->mean[k];
    if (m->channels == 4 && !(sample[3] > 0)) c[0] = c[1] = c[2] = 0;
    if (g->weight) g->weight[at] = txs_weight_of((double)sample[3]);
    for (int b = 0; b < m->bands; b++) {
        double v = 0;
        for (int k = 0; k < m->channels; k++) v += (double)m->basis[b][k] * c[k];
        g->value[(size_t)b * pixels + at] = txm_float(v);
    }
}

/* Set all pixels that are known, each in the bands of its label's model. */
static void txs_ground_split(txs_ground *g, const txm_image *im, texsyn_model *const *model) {
    for (int y = 0; y < g->height; y++) {
        for (int x = 0; x < g->width; x++) {
            const size_t i = (size_t)y * (size_t)g->width + (size_t)x;
            float sample[4] = {0, 0, 0, 0};
            if (g->state[i] == TXS_FREE || g->label[i] == TXS_NO_LABEL) continue;
            const texsyn_model *m = model[g->label[i]];
            for (int k = 0; k < m->channels; k++) sample[k] = txm_image_get(im, x, y, k);
            txs_ground_set(g, i, m, sample);
        }
    }
}

/* Hidden pixels of a label borrow the colours of visible ones, in the band of a colour. visible:
   scratch, a number for each pixel; own: a byte. */
static void txs_ground_borrow(txs_ground *g, int label, int band, uint32_t *visible, uint8_t *own) {
    const size_t pixels = (size_t)g->width * (size_t)g->height;
    float *plane = g->value + (size_t)band * pixels;
    uint32_t count = 0;
    for (size_t i = 0; i < pixels; i++) {
        own[i] = g->label[i] == label && g->state[i] != TXS_FREE ? g->weight[i] : 0;
        if (own[i]) visible[count++] = (uint32_t)i;
    }
    txs_lenders lenders = txs_lenders_of(own, g->width, g->height, visible, count);
    for (size_t i = 0; i < pixels && count; i++)
        if (g->label[i] == label && !g->weight[i])
            plane[i] = plane[txs_lender(&lenders, i)];
}

/* After all pixels are set that are known: hidden ones borrow colours, for which see alpha.h.
   Returns 0 if there is no memory. */
static int txs_ground_show(txs_ground *g, texsyn_model *const *model, int labels,
                           txm_arena *arena) {
    const size_t pixels = (size_t)g->width * (size_t)g->height;
    int is_opaque = 1;
    for (size_t i = 0; i < pixels && g->weight && is_opaque; i++)
        is_opaque = g->weight[i] == TXS_OPAQUE;
    if (is_opaque) g->weight = NULL;
    if (!g->weight) return 1;
    uint32_t *visible = (uint32_t *)txm_arena_alloc(arena, pixels, sizeof *visible);
    uint8_t *own = (uint8_t *)txm_arena_alloc(arena, pixels, 1);
    if (arena->failed) return 0;
    for (int k = 0; k < labels; k++) {
        for (int b = 0; b < model[k]->bands; b++) {
            if (txs_is_alpha(model[k], b)) g->alpha[k] = b;
            else txs_ground_borrow(g, k, b, visible, own);
        }
    }
    return 1;
}

/* How the bands of a label are quantised: from its source pixels. Returns how many these are; with
   fewer than 2 nothing is set. dither: NULL, or receives the share of a step that is filled.
   scratch: bands floats and bands bytes for each pixel of the ground. */
static size_t txs_ground_quantise(const txs_ground *g, int label, int bands, txs_level *level,
                                  float *values, uint8_t *bytes, float *dither) {
    const size_t pixels = (size_t)g->width * (size_t)g->height;
    txs_source s;
    size_t count = 0;
    memset(&s, 0, sizeof s);
    for (size_t i = 0; i < pixels; i++) count += g->state[i] == TXS_SOURCE && g->label[i] == label;
    if (count < 2) return count;
    for (int b = 0; b < bands; b++) {
        size_t n = 0;
        for (size_t i = 0; i < pixels; i++)
            if (g->state[i] == TXS_SOURCE && g->label[i] == label)
                values[(size_t)b * count + n++] = g->value[(size_t)b * pixels + i];
    }
    s.width = (int)count;
    s.height = 1;
    s.value = values;
    s.canvas.pixels = bytes;
    s.canvas.plane = (ptrdiff_t)count;
    for (int b = 0; b < bands; b++) {
        const float fill = txs_quantise_band(level, b, &s, NULL);
        if (dither) dither[b] = fill;
    }
    return count;
}

#endif /* TEXSYN_GROUND_H */
