#ifndef TEXSYN_KNIT_H
#define TEXSYN_KNIT_H

#include "seam.h"
#include "fill.h"

/* ---- knitting ----------------------------------------------------------------------------

   Two pictures of the same texture: the border moves to where they agree best (seam.h), and its zone
   is a hole, to be filled. Of different ones: the border is displaced (border.h), then the zone is
   synthesised in windows, starting from the pixels of the two pictures. A window is a mosaic with two labels, each learned from its own
   side. Crossing types say what meets across the border: as in the example of a border, or, where
   there is none, as where the two pictures happen to agree best, which is where one would cut. */

enum {
    TXS_KNIT_ZONE = 6,        /* pixels on either side of the border      */
    TXS_KNIT_ZONE_ALIKE = 3,  /* the same between pictures of one texture */
    TXS_KNIT_MOST = 64,       /* a zone at most                           */
    TXS_KNIT_LEAST = 16,      /* pixels: sides of pictures                */
    TXS_KNIT_TWO = 2,         /* labels                                   */
    TXS_KNIT_GAP = 2 * TXS_CROSS_REACH, /* pixels between pictures side by side */
    TXS_KNIT_BLOCK = 8,  /* pixels: sides of the fields of a checkerboard */
    TXS_KNIT_MATCH = 25, /* percent of the pixels count as agreeing       */
    TXS_KNIT_FEW = 64    /* pixels of an example that lie at its border   */
};

#define TXS_KNIT_ALIKE 0.32 /* nearer histograms are of the same texture: ours, by trial */
#define TXS_KNIT_ROUGHEST 32.0f

typedef struct txs_knitter {
    const texsyn_knit_desc *desc;
    txs_pair_of_pictures pair, border;
    txm_image image;    /* a copy, in which the zone is synthesised */
    uint8_t *label;     /* of each pixel: 0 or 1                    */
    uint8_t *state;     /* enum txs_state                           */
    uint16_t *distance; /* from the other label                     */
    int zone;
    int64_t missing;
    int16_t *noise, *cool;
} txs_knitter;

/* ---- checks --------------------------------------------------------------------------- */

static txm_status txs_knit_check_picture(const txm_image *image, const char *name, txm_env *env) {
    const txm_status status = txm_image_check(image, name, TEXSYN_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    if (image->channels == 2)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name, "2 channels; give 1, 3 or 4");
    if (image->width < TXS_KNIT_LEAST || image->height < TXS_KNIT_LEAST)
        return txm_fail_at(env, TXM_TOO_SMALL, name, "must be 16 x 16 or larger");
    if (!txs_image_is_moderate(image))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name,
                           "has samples that are not finite or beyond a million");
    return TXM_OK;
}

static int txs_channels_of(const txm_image *image) {
    return image->channels ? image->channels : 1;
}

static txm_status txs_knit_check_border(const texsyn_knit_desc *d, txm_env *env) {
    txm_status status = txs_knit_check_picture(&d->border, "border", env);
    if (status != TXM_OK) return status;
    if (txs_channels_of(&d->border) != txs_channels_of(&d->a))
        return txm_fail(env, TXM_BAD_ARGUMENT, "border: must have the channels of a");
    if (!d->border_layout.pixels)
        return txm_fail(env, TXM_BAD_ARGUMENT, "border_layout: pixels is NULL");
    return txs_check_mask(&d->border_layout, &d->border, "border_layout", env);
}

static txm_status txs_knit_check(const texsyn_knit_desc *d, const txm_image *out, txm_env *env) {
    txm_status status;
    if (!d) return txm_fail(env, TXM_BAD_ARGUMENT, "knit: desc is NULL");
    if ((status = txs_knit_check_picture(&d->a, "a", env)) != TXM_OK ||
        (status = txs_knit_check_picture(&d->b, "b", env)) != TXM_OK)
        return status;
    if (txs_channels_of(&d->b) != txs_channels_of(&d->a) || d->b.sample != d->a.sample)
        return txm_fail(env, TXM_BAD_ARGUMENT, "b: must have the channels and samples of a");
    if (!d->layout.pixels) return txm_fail(env, TXM_BAD_ARGUMENT, "layout: pixels is NULL");
    if ((status = txs_check_mask(&d->layout, &d->a, "layout", env)) != TXM_OK) return status;
    if (d->border.pixels && (status = txs_knit_check_border(d, env)) != TXM_OK) return status;
    if (d->zone < 0 || d->zone > TXS_KNIT_MOST)
        return txm_fail(env, TXM_BAD_ARGUMENT, "zone must be 1 to 64, or 0 for the default");
    if (!(d->roughness <= TXS_KNIT_ROUGHEST))
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "roughness must be up to 32, 0 for the default, negative for none");
    if ((int)d->likeness < TEXSYN_LIKENESS_AUTO || (int)d->likeness > TEXSYN_LIKENESS_DIFFERENT)
        return txm_fail(env, TXM_BAD_ARGUMENT, "likeness must be one of texsyn_likeness");
    if (d->quality < -2 || d->quality > 2)
        return txm_fail(env, TXM_BAD_ARGUMENT, "quality must be -2 to 2");
    if ((status = txm_image_check(out, "out", 0, env)) != TXM_OK) return status;
    if (out->width != d->a.width || out->height != d->a.height ||
        txs_channels_of(out) != txs_channels_of(&d->a) || out->sample != d->a.sample)
        return txm_fail(env, TXM_BAD_ARGUMENT, "out: must have the form of a");
    return TXM_OK;
}

/* ---- the pictures --------------------------------------------------------------------- */

/* Read a layout; returns how many pixels are white. */
static size_t txs_knit_read(const txm_image *layout, uint8_t *label) {
    const size_t pixels = txs_pixels_of(layout->width, layout->height);
    const size_t white = txm_mask_read(layout, TXM_MASK_DIVIDES, label);
    for (size_t i = 0; i < pixels; i++) label[i] = label[i] != 0;
    return white;
}

static txm_status txs_knit_open(txs_knitter *k, txm_arena *arena, txm_env *env) {
    const texsyn_knit_desc *d = k->desc;
    const size_t entries = (size_t)TXS_NOISE + TXS_VALUES;
    const size_t pixels = txs_pixels_of(d->a.width, d->a.height);
    txm_status status = txm_image_bled(&d->a, 0, arena, env, &k->pair.picture[0]);
    if (status == TXM_OK) status = txm_image_bled(&d->b, 0, arena, env, &k->pair.picture[1]);
    if (status == TXM_OK && d->border.pixels)
        status = txm_image_bled(&d->border, 0, arena, env, &k->border.picture[0]);
    if (status != TXM_OK) return status;
    k->pair.width = d->a.width;
    k->pair.height = d->a.height;
    if (d->border.pixels) {
        k->border.picture[1] = k->border.picture[0];
        k->border.width = d->border.width;
        k->border.height = d->border.height;
    }
    k->image = k->pair.picture[0];
    k->image.stride = 0;
    k->image.pixels = txm_arena_alloc(
        arena, pixels, (size_t)k->image.channels * txm_sample_bytes(k->image.sample));
    k->image = txm_image_resolve(k->image);
    k->label = (uint8_t *)txm_arena_alloc(arena, pixels, 1);
    k->state = (uint8_t *)txm_arena_alloc(arena, pixels, 1);
    k->distance = (uint16_t *)txm_arena_alloc(arena, pixels, sizeof *k->distance);
    k->noise = (int16_t *)txm_arena_alloc(arena, entries, sizeof *k->noise);
    k->cool = (int16_t *)txm_arena_alloc(arena, entries, sizeof *k->cool);
    if (arena->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the pictures");
    txs_noise_table(k->noise);
    txs_cool_noise(k->noise, TXS_FILL_COOL, k->cool);
    const size_t white = txs_knit_read(&d->layout, k->label);
    if (white == 0)
        return txm_fail(env, TXM_BAD_ARGUMENT, "layout: is all black; white is where b goes");
    if (white == pixels)
        return txm_fail(env, TXM_BAD_ARGUMENT, "layout: is all white; black is where a goes");
    return TXM_OK;
}

/* The bytes of a pixel of one of the two pictures to another one. */
static void txs_knit_copy_pixel(const txs_pair_of_pictures *p, int label, int x, int y,
                                const txm_image *to, int to_x, int to_y) {
    const txm_image *from = &p->picture[label];
    const size_t bytes = (size_t)from->channels * txm_sample_bytes(from->sample);
    const int fx = txs_reflect(x, from->width), fy = txs_reflect(y, from->height);
    memcpy((uint8_t *)txm_image_row(to, to_y) + (size_t)to_x * bytes,
           (const uint8_t *)txm_image_row_const(from, fy) + (size_t)fx * bytes, bytes);
}

/* Put the two pictures together, and find the zone. */
static void txs_knit_compose(txs_knitter *k) {
    const int width = k->image.width, height = k->image.height;
    txs_border_distances(k->label, width, height, k->distance);
    k->missing = 0;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            const size_t i = (size_t)y * (size_t)width + (size_t)x;
            const int is_free = k->distance[i] <= TXS_NEXT * k->zone;
            txs_knit_copy_pixel(&k->pair, k->label[i], x, y, &k->image, x, y);
            k->state[i] = (uint8_t)(is_free ? TXS_FREE : TXS_SOURCE);
            k->missing += is_free;
        }
    }
}

/* ---- moving the border ---------------------------------------------------------------- */

/* How coarse the border is to be, as the materials are or as asked for: pixels. */
static double txs_knit_grain(const txs_knitter *k, const txs_material *material) {
    const double a = material[0].grain, b = material[1].grain, coarser = a > b ? a : b;
    if (k->desc->roughness > 0) return (double)k->desc->roughness / TXS_ROUGH;
    if (coarser < TXS_FINEST_GRAIN) return TXS_FINEST_GRAIN;
    return coarser > TXS_COARSEST_GRAIN ? TXS_COARSEST_GRAIN : coarser;
}

/* Displace the border as the materials are, or to where they agree. Fraction 0..to of the whole. */
static txm_status txs_knit_move(txs_knitter *k, const txs_material *material, int is_alike,
                                txm_env *env, float to) {
    const double grain = txs_knit_grain(k, material);
    txs_coats coats;
    txs_frayed f;
    txm_arena arena;
    txm_status status;
    if (k->desc->roughness < 0) return TXM_OK;
    txs_border_distances(k->label, k->image.width, k->image.height, k->distance);
    memset(&f, 0, sizeof f);
    f.label = k->label;
    f.distance = k->distance;
    f.width = k->image.width;
    f.height = k->image.height;
    f.rough = txm_float(grain * TXS_ROUGH);
    f.limit = (int)((double)f.rough * TXS_ROUGHEST * (double)TXS_NEXT);
    if (is_alike) return txs_seam_find(&k->pair, &f, env, to);
    txm_arena_init(&arena, env);
    status = txs_coats_make(&coats, &arena, &k->pair, grain, k->desc->seed)
                 ? txs_fray(&f, &coats, env, to)
                 : txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to displace the border");
    txm_arena_free(&arena);
    return status;
}

/* ---- one texture ---------------------------------------------------------------------- */

static txm_status txs_knit_alike(txs_knitter *k, const txs_material *material, txm_env *env,
                                 txm_image out) {
    texsyn_fill_desc fill;
    const txm_status status = txs_knit_move(k, material, 1, env, 0);
    if (status != TXM_OK) return status;
    const size_t pixels = txs_pixels_of(k->image.width, k->image.height);
    k->zone = k->desc->zone ? k->desc->zone : (int)TXS_KNIT_ZONE_ALIKE;
    txs_knit_compose(k);
    if (!k->missing) { /* nothing but a spot, which has vanished */
        txs_copy_picture(&k->image, &out);
        return TXM_OK;
    }
    if ((int64_t)pixels - k->missing < TXS_FILL_FEW)
        return txm_fail(env, TXM_TOO_SMALL, "fewer than 256 pixels lie outside the zone");
    for (size_t i = 0; i < pixels; i++) k->state[i] = k->state[i] == TXS_FREE ? 255 : 0;
    memset(&fill, 0, sizeof fill);
    fill.image = k->image;
    fill.mask = k->image;
    fill.mask.pixels = k->state;
    fill.mask.channels = 1;
    fill.mask.sample = TXM_U8;
    fill.mask.stride = 0;
    fill.quality = k->desc->quality;
    fill.seed = k->desc->seed;
    return texsyn_fill(&fill, env, out);
}

/* ---- a window of two textures --------------------------------------------------------- */

typedef struct txs_loom { /* what a window works with */
    txs_knitter *knit;
    txs_hole hole;
    txs_ground canvas, source, border;
    txs_mosaic on, from, along; /* of the same */
    txs_texture texture[TXS_KNIT_TWO];
    texsyn_model *model[TXS_KNIT_TWO];
    float spread[TXS_KNIT_TWO][TXS_MAX_BANDS];
} txs_loom;

/* The values of a pixel in the bands of a label's model. */
static void txs_loom_split(const txs_loom *w, const txs_pair_of_pictures *p, int label, int x, int y,
                           txs_ground *g, size_t at) {
    float sample[4] = {0, 0, 0, 0};
    for (int i = 0; i < w->model[label]->channels; i++) sample[i] = txs_pair_get(p, label, x, y, i);
    txs_ground_set(g, at, w->model[label], sample);
}

/* Where the textures are learned: the two pictures side by side, each on its own side if that is
   enough. */
static void txs_loom_mark_source(txs_loom *w) {
    const txs_knitter *k = w->knit;
    const txs_hole *h = &w->hole;
    txs_ground *g = &w->source;
    const size_t pixels = txs_pixels_of(g->width, g->height);
    memset(g->label, TXS_NO_LABEL, pixels);
    memset(g->state, TXS_KNOWN, pixels);
    for (int label = 0; label < TXS_KNIT_TWO; label++) {
        int own = 0;
        for (int pass = 0; pass < 2; pass++) {
            for (int i = 0; i < h->width * h->height; i++) {
                const int x = i % h->width, y = i / h->width;
                const size_t in = (size_t)(h->top + y) * (size_t)k->image.width +
                                  (size_t)(h->left + x);
                const size_t at = (size_t)y * (size_t)g->width +
                                  (size_t)(x + label * (h->width + TXS_KNIT_GAP));
                const int is_own = k->label[in] == label && k->state[in] == TXS_SOURCE;
                if (!pass) own += is_own;
                else if (is_own || own < TXS_FILL_ENOUGH) {
                    g->label[at] = (uint8_t)label;
                    g->state[at] = TXS_SOURCE;
                }
            }
        }
    }
}

/* A copy of a window of one of the pictures. */
static txm_image txs_loom_cut(const txs_loom *w, int label, txm_arena *arena) {
    const txs_hole *h = &w->hole;
    txm_image view = w->knit->pair.picture[label];
    view.width = h->width;
    view.height = h->height;
    view.stride = 0;
    view.pixels =
        txm_arena_alloc(arena, txs_pixels_of(h->width, h->height),
                        (size_t)view.channels * txm_sample_bytes(view.sample));
    view = txm_image_resolve(view);
    for (int y = 0; y < h->height && view.pixels; y++)
        for (int x = 0; x < h->width; x++)
            txs_knit_copy_pixel(&w->knit->pair, label, h->left + x, h->top + y, &view, x, y);
    return view;
}

/* The bands of a label, whose picture lies in the source beside the other's. mask: a byte for each
   pixel of the view. */
static void txs_loom_find_bands(const txs_loom *w, int label, const txm_image *view,
                                uint8_t *mask) {
    const txs_ground *g = &w->source;
    for (int i = 0; i < view->width * view->height; i++) {
        const int x = i % view->width, y = i / view->width;
        mask[i] = g->label[(size_t)y * (size_t)g->width +
                           (size_t)(x + label * (view->width + TXS_KNIT_GAP))] == label;
    }
    txs_find_visible_bands(w->model[label], view, mask);
}

/* The textures of the window: bands and how they are quantised. */
static txm_status txs_loom_source(txs_loom *w, txm_arena *arena, txm_env *env) {
    const txs_hole *h = &w->hole;
    txs_ground *g = &w->source;
    const int width = 2 * h->width + TXS_KNIT_GAP, channels = w->knit->image.channels;
    const size_t room = txs_pixels_of(width, h->height) * (size_t)channels;
    txs_ground_make(g, arena, width, h->height, channels, 1);
    uint8_t *bytes = (uint8_t *)txm_arena_alloc(arena, room, 1);
    float *values = (float *)txm_arena_alloc(arena, room, sizeof *values);
    for (int label = 0; label < TXS_KNIT_TWO; label++) {
        w->model[label] = txs_fill_model_make(arena, channels);
        if (!w->model[label]) break;
        w->model[label]->levels = 1;
        w->texture[label].model = w->model[label];
        w->texture[label].level = &w->model[label]->level[0];
    }
    if (arena->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a window");
    txs_loom_mark_source(w);
    for (int label = 0; label < TXS_KNIT_TWO; label++) {
        const txm_image view = txs_loom_cut(w, label, arena);
        if (arena->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a window");
        txs_loom_find_bands(w, label, &view, bytes);
        for (int i = 0; i < h->width * h->height; i++) {
            const int x = i % h->width, y = i / h->width;
            txs_loom_split(w, &w->knit->pair, label, h->left + x, h->top + y, g,
                           (size_t)y * (size_t)width +
                               (size_t)(x + label * (h->width + TXS_KNIT_GAP)));
        }
    }
    if (!txs_ground_show(g, w->model, TXS_KNIT_TWO, arena))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a window");
    for (int label = 0; label < TXS_KNIT_TWO; label++)
        txs_ground_quantise(g, label, w->model[label]->bands, w->texture[label].level, values,
                            bytes, w->spread[label]);
    return TXM_OK;
}

/* What is synthesised: the window of the picture. The zone outside the hole, which other windows
   have not synthesised yet, has no label. */
static txm_status txs_loom_canvas(txs_loom *w, txm_arena *arena, txm_env *env) {
    const txs_knitter *k = w->knit;
    const txs_hole *h = &w->hole;
    txs_ground *g = &w->canvas;
    txs_pair_of_pictures done;
    if (!txs_ground_make(g, arena, h->width, h->height, k->image.channels, 1))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a window");
    memset(&done, 0, sizeof done);
    done.picture[0] = done.picture[1] = k->image;
    for (int i = 0; i < h->width * h->height; i++) {
        const int x = h->left + i % h->width, y = h->top + i / h->width;
        const size_t in = (size_t)y * (size_t)k->image.width + (size_t)x;
        const int is_inside = x >= h->x0 && x < h->x1 && y >= h->y0 && y < h->y1;
        const int is_later = k->state[in] == TXS_FREE && !is_inside;
        g->state[i] = k->state[in];
        g->label[i] = is_later ? (uint8_t)TXS_NO_LABEL : k->label[in];
        txs_loom_split(w, &done, k->label[in], x, y, g, (size_t)i);
    }
    if (!txs_ground_show(g, w->model, TXS_KNIT_TWO, arena))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a window");
    return TXM_OK;
}

/* ---- what meets across a border ------------------------------------------------------- */

/* An example of a border as a ground. */
static txm_status txs_loom_example(txs_loom *w, txm_arena *arena, txm_env *env) {
    const txs_knitter *k = w->knit;
    txs_ground *g = &w->border;
    if (!txs_ground_make(g, arena, k->border.width, k->border.height, k->image.channels, 1))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the example of a border");
    memset(g->state, TXS_SOURCE, txs_pixels_of(g->width, g->height));
    txs_knit_read(&k->desc->border_layout, g->label);
    for (int y = 0; y < g->height; y++) {
        for (int x = 0; x < g->width; x++) {
            const size_t at = (size_t)y * (size_t)g->width + (size_t)x;
            txs_loom_split(w, &k->border, g->label[at], x, y, g, at);
        }
    }
    if (!txs_ground_show(g, w->model, TXS_KNIT_TWO, arena))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the example of a border");
    return TXM_OK;
}

/* A border that might be, where no example of one is given: the two pictures on a checkerboard, less
   the places where they do not agree. mismatch: a byte for each pixel. */
static txm_status txs_loom_invent(txs_loom *w, txm_arena *arena, txm_env *env) {
    const txs_knitter *k = w->knit;
    const txs_hole *h = &w->hole;
    txs_ground *g = &w->border;
    int histogram[256] = {0}, agreeing = 0, most = 0;
    const int pixels = h->width * h->height;
    uint8_t *mismatch = (uint8_t *)txm_arena_alloc(arena, (size_t)pixels, 1);
    if (arena->failed || !txs_ground_make(g, arena, h->width, h->height, k->image.channels, 1))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a window");
    for (int i = 0; i < pixels; i++) {
        mismatch[i] = txs_mismatch(&k->pair, h->left + i % h->width, h->top + i / h->width);
        histogram[mismatch[i]]++;
    }
    while (most < 255 && (int64_t)(agreeing += histogram[most]) * 100 <
                             (int64_t)pixels * TXS_KNIT_MATCH)
        most++;
    for (int i = 0; i < pixels; i++) {
        const int x = i % h->width, y = i / h->width;
        const int label = (x / TXS_KNIT_BLOCK + y / TXS_KNIT_BLOCK) & 1;
        g->state[i] = TXS_SOURCE;
        g->label[i] = (uint8_t)(mismatch[i] <= most ? label : (int)TXS_NO_LABEL);
        txs_loom_split(w, &k->pair, label, h->left + x, h->top + y, g, (size_t)i);
    }
    if (!txs_ground_show(g, w->model, TXS_KNIT_TWO, arena))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a window");
    return TXM_OK;
}

/* ---- synthesising a window ------------------------------------------------------------ */

/* The zone starts from the pixels of the pictures. */
static void txs_loom_start(txs_loom *w) {
    const txs_ground *g = &w->canvas;
    const size_t pixels = txs_pixels_of(g->width, g->height);
    for (int y = 0; y < g->height; y++) {
        for (int x = 0; x < g->width; x++) {
            const size_t i = (size_t)y * (size_t)g->width + (size_t)x;
            if (!txs_is_free(&w->on, x, y)) continue;
            const txs_texture *t = &w->texture[g->label[i]];
            for (int b = 0; b < t->model->bands; b++)
                txs_pixel(&w->on, x, y)[b * w->on.canvas.plane] = (uint8_t)txs_quantise(
                    t->level, b, (double)g->value[(size_t)b * pixels + i]);
        }
    }
}

static txm_status txs_loom_run(txs_loom *w, uint64_t seed, txm_env *env, float from, float to) {
    const txs_knitter *k = w->knit;
    const int quality = k->desc->quality, reach = TXS_FILL_REACH;
    const txs_study_plan plan = {2,
                                 2,
                                 txs_fill_sweeps(quality),
                                 txs_fill_types(quality),
                                 6,
                                 TXS_FILL_REACH,
                                 TXS_FILL_REFRESH,
                                 TXS_FILL_SOFT,
                                 1,
                                 seed,
                                 k->noise,
                                 k->cool,
                                 &w->along};
    if (!txs_mosaic_make(&w->on, env, &w->canvas, TXS_KNIT_TWO, reach, 0) ||
        !txs_mosaic_make(&w->from, env, &w->source, TXS_KNIT_TWO, reach, 0) ||
        !txs_mosaic_make(&w->along, env, &w->border, TXS_KNIT_TWO, reach, 0))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a window");
    txs_mosaic_lay(&w->on, &w->canvas, w->texture, seed);
    txs_mosaic_lay(&w->from, &w->source, w->texture, seed);
    txs_mosaic_lay(&w->along, &w->border, w->texture, seed);
    txs_loom_start(w);
    return txs_mosaic_learn(&plan, 0, w->model, &w->from, &w->on, NULL, NULL, env, from, to);
}

/* The samples of a pixel of the picture from the bands of the canvas. */
static void txs_loom_paint(const txs_loom *w, int x, int y) {
    const txs_ground *g = &w->canvas;
    const size_t pixels = txs_pixels_of(g->width, g->height);
    const size_t i = (size_t)y * (size_t)g->width + (size_t)x;
    const texsyn_model *m = w->model[g->label[i]];
    for (int c = 0; c < m->channels; c++) {
        double v = (double)m->mean[c];
        for (int b = 0; b < m->bands; b++) /* a product of two floats is exact in double */
            v += (double)m->basis[b][c] * (double)g->value[(size_t)b * pixels + i];
        txm_image_set(&w->knit->image, w->hole.left + x, w->hole.top + y, c, txm_float(v / 255));
    }
}

/* From the canvas to the picture. */
static txm_status txs_loom_close(txs_loom *w, txm_arena *arena, txm_env *env) {
    txs_knitter *k = w->knit;
    txs_ground *g = &w->canvas;
    const size_t pixels = txs_pixels_of(g->width, g->height);
    float *at = (float *)txm_arena_alloc(arena, pixels, sizeof *at);
    float *grain = (float *)txm_arena_alloc(arena, pixels, sizeof *grain);
    if (arena->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a window");
    for (int label = 0; label < TXS_KNIT_TWO; label++)
        for (int b = 0; b < w->model[label]->bands; b++)
            txs_tone_apply(&w->on, g, w->texture, label, b, w->spread[label][b], k->desc->seed, at,
                           grain);
    for (int y = 0; y < g->height; y++) {
        for (int x = 0; x < g->width; x++) {
            const size_t i = (size_t)y * (size_t)g->width + (size_t)x;
            if (g->state[i] != TXS_FREE || g->label[i] == TXS_NO_LABEL) continue;
            txs_loom_paint(w, x, y);
            k->state[(size_t)(w->hole.top + y) * (size_t)k->image.width +
                     (size_t)(w->hole.left + x)] = TXS_KNOWN;
        }
    }
    return TXM_OK;
}

static txm_status txs_knit_window(txs_knitter *k, const txs_hole *hole, int index, txm_env *env,
                                  float from, float to) {
    txm_arena arena;
    txm_status status = TXM_OUT_OF_MEMORY;
    txm_arena_init(&arena, env);
    txs_loom *w = (txs_loom *)txm_arena_zero(&arena, 1, sizeof *w);
    if (!w) return txm_fail(env, status, "no memory for a window");
    w->knit = k;
    w->hole = *hole;
    status = txs_loom_source(w, &arena, env);
    if (status == TXM_OK) status = txs_loom_canvas(w, &arena, env);
    if (status == TXM_OK)
        status = k->border.width ? txs_loom_example(w, &arena, env)
                                 : txs_loom_invent(w, &arena, env);
    if (status == TXM_OK)
        status = txs_loom_run(w, txm_hash(k->desc->seed + 977u * (uint64_t)index), env, from, to);
    if (status == TXM_OK) status = txs_loom_close(w, &arena, env);
    txs_mosaic_free(&w->on, env);
    txs_mosaic_free(&w->from, env);
    txs_mosaic_free(&w->along, env);
    txm_arena_free(&arena);
    return status;
}

/* The zone in a cell, and the window round it; 0 if there is none. */
static int txs_knit_hole(const txs_knitter *k, int left, int top, txs_hole *h) {
    const int right = txm_clampi(left + TXS_KNIT_CELL, 0, k->image.width);
    const int bottom = txm_clampi(top + TXS_KNIT_CELL, 0, k->image.height);
    memset(h, 0, sizeof *h);
    h->x0 = right;
    h->y0 = bottom;
    for (int y = top; y < bottom; y++) {
        for (int x = left; x < right; x++) {
            if (k->state[(size_t)y * (size_t)k->image.width + (size_t)x] != TXS_FREE) continue;
            if (x < h->x0) h->x0 = x;
            if (y < h->y0) h->y0 = y;
            if (x >= h->x1) h->x1 = x + 1;
            h->y1 = y + 1;
            h->missing++;
        }
    }
    if (!h->missing) return 0;
    h->left = txm_clampi(h->x0 - TXS_FILL_MARGIN, 0, k->image.width);
    h->top = txm_clampi(h->y0 - TXS_FILL_MARGIN, 0, k->image.height);
    h->width = txm_clampi(h->x1 + TXS_FILL_MARGIN, 0, k->image.width) - h->left;
    h->height = txm_clampi(h->y1 + TXS_FILL_MARGIN, 0, k->image.height) - h->top;
    return 1;
}

/* ---- two textures --------------------------------------------------------------------- */

/* Does the example of a border have one? */
static txm_status txs_knit_check_example(const txs_knitter *k, txm_env *env) {
    txm_arena arena;
    const int width = k->border.width, height = k->border.height;
    int64_t meetings = 0;
    if (!width) return TXM_OK;
    txm_arena_init(&arena, env);
    uint8_t *label = (uint8_t *)txm_arena_alloc(&arena, txs_pixels_of(width, height), 1);
    if (!label) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the example of a border");
    txs_knit_read(&k->desc->border_layout, label);
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            const uint8_t *p = label + (size_t)y * (size_t)width + (size_t)x;
            meetings += (x && p[0] != p[-1]) + (y && p[0] != p[-(ptrdiff_t)width]);
        }
    }
    txm_arena_free(&arena);
    if (meetings < TXS_KNIT_FEW)
        return txm_fail(env, TXM_TOO_SMALL,
                        "border_layout: its border is shorter than 64 pixels; nothing to learn");
    return TXM_OK;
}

static txm_status txs_knit_different(txs_knitter *k, const txs_material *material, txm_env *env) {
    txm_status status = txs_knit_check_example(k, env);
    int64_t done = 0;
    int index = 0;
    if (status == TXM_OK) status = txs_knit_move(k, material, 0, env, 0.1f);
    if (status != TXM_OK) return status;
    k->zone = k->desc->zone ? k->desc->zone : (int)TXS_KNIT_ZONE;
    txs_knit_compose(k);
    for (int top = 0; top < k->image.height; top += TXS_KNIT_CELL) {
        for (int left = 0; left < k->image.width && status == TXM_OK; left += TXS_KNIT_CELL) {
            txs_hole hole;
            if (!txs_knit_hole(k, left, top, &hole)) continue;
            const float from = 0.1f + 0.9f * (float)((double)done / (double)k->missing);
            done += hole.missing;
            status = txs_knit_window(k, &hole, index++, env, from,
                                     0.1f + 0.9f * (float)((double)done / (double)k->missing));
        }
    }
    return status;
}

/* ---- public: knitting ----------------------------------------------------------------- */

TEXSYN_API txm_status texsyn_knit(const texsyn_knit_desc *desc, txm_env *env, txm_image out) {
    txm_arena arena;
    txs_knitter k;
    txs_material material[TXS_KNIT_TWO];
    txm_status status = txs_knit_check(desc, &out, env);
    if (status != TXM_OK) return status;
    memset(&k, 0, sizeof k);
    k.desc = desc;
    txm_arena_init(&arena, env);
    status = txs_knit_open(&k, &arena, env);
    if (status == TXM_OK && txm_progress(env, 0, "border"))
        status = txm_fail(env, TXM_CANCELLED, "cancelled");
    if (status == TXM_OK) {
        for (int label = 0; label < TXS_KNIT_TWO; label++)
            txs_survey(&k.pair, k.label, label, &material[label]);
        const int is_alike = desc->likeness == TEXSYN_LIKENESS_AUTO
                                 ? !desc->border.pixels &&
                                       txs_material_distance(&material[0], &material[1]) < TXS_KNIT_ALIKE
                                 : desc->likeness == TEXSYN_LIKENESS_SAME;
        if (is_alike) status = txs_knit_alike(&k, material, env, out);
        else {
            status = txs_knit_different(&k, material, env);
            if (status == TXM_OK) status = txm_image_bleed(&k.image, 0, env);
            if (status == TXM_OK) txs_copy_picture(&k.image, &out);
        }
    }
    txm_arena_free(&arena);
    return status;
}

#endif /* TEXSYN_KNIT_H */
