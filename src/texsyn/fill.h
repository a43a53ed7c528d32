#ifndef TEXSYN_FILL_H
#define TEXSYN_FILL_H

#include "mosaic_learner.h"
#include "tone.h"
#include "learn.h"
#include "mask.h"

/* ---- filling -----------------------------------------------------------------------------

   Holes are filled in windows of bounded size: small holes that lie close together share one, large
   ones are cut into several, and what one window has filled is known to the next. A window is a
   mosaic with one label. The texture is learned in the hole itself, on a canvas with known
   surroundings, so that what is learned last is what is seen. There are no cliques with the coarser
   level, which only is the start: they would let the seam of the coarse level show.         */

enum {
    TXS_FILL_CELL = 32,     /* pixels: holes nearer than this belong together */
    TXS_FILL_CELLS = 8,     /* a side of what a window fills, at most */
    TXS_FILL_MARGIN = 48,   /* known pixels round it, if it is wide */
    TXS_FILL_THIN = 24,     /* pixels: width of a hole that counts as thin; its margin, too */
    TXS_FILL_WIDER = 8,     /* pixels by which it is widened to learn in it */
    TXS_FILL_FEW = 256,     /* source pixels: with fewer nothing can be learned */
    TXS_FILL_LEAST = 1024,  /* source pixels: with fewer another window's model serves */
    TXS_FILL_ENOUGH = 4096, /* source pixels: a window grows until it has so many */
    TXS_FILL_REACH = 10,    /* of cliques */
    TXS_FILL_LEVELS = TXS_MAX_LEVELS,
    TXS_TAKEN = TXS_SOURCE + 1, /* a state while holes are looked for */
    TXS_FILL_REFRESH = 8,       /* sub-lattices */
    TXS_FILL_SOFT = 4000,       /* pixels, see txs_soften: of a hole that is wide, of a thin one */
    TXS_FILL_SOFT_THIN = 100000,
    TXS_FILL_COOL = 60 /* percent: temperature of the last sweep */
};

#define TXS_FILL_DIMMEST 0.25 /* change of contrast in another light, at most; ours */
#define TXS_FILL_BRIGHTEST 4.0

/* A part of the hole to be filled at once, in pixels of the picture, and the window round it. */
typedef struct txs_hole {
    int x0, y0, x1, y1;
    int64_t missing;
    int left, top, width, height;
    int64_t source; /* pixels to learn from in the window */
} txs_hole;

typedef struct txs_filler {
    const texsyn_fill_desc *desc;
    txm_image image; /* a copy, in which windows are filled */
    uint8_t *state;  /* of each pixel: enum txs_state; TXS_FREE: still missing */
    txs_hole *hole;
    int hole_count;
    int64_t missing, source;
    int16_t *noise, *cool;
    texsyn_model *given; /* without cliques that a mosaic does not know, or NULL */
    texsyn_model *first; /* what the window with most known pixels has learned   */
} txs_filler;

/* ---- checks --------------------------------------------------------------------------- */

static txm_status txs_fill_check(const texsyn_fill_desc *d, const txm_image *out, txm_env *env) {
    txm_status status;
    if (!d) return txm_fail(env, TXM_BAD_ARGUMENT, "fill: desc is NULL");
    if ((status = txm_image_check(&d->image, "image", TEXSYN_MAX_PIXELS, env)) != TXM_OK)
        return status;
    const int channels = d->image.channels ? d->image.channels : 1;
    if (channels == 2) return txm_fail(env, TXM_BAD_ARGUMENT, "image: 2 channels; give 1, 3 or 4");
    if (!d->mask.pixels) return txm_fail(env, TXM_BAD_ARGUMENT, "mask: pixels is NULL");
    if ((status = txs_check_mask(&d->mask, &d->image, "mask", env)) != TXM_OK) return status;
    if ((status = txs_check_mask(&d->source, &d->image, "source", env)) != TXM_OK) return status;
    if (d->model && d->model->channels != channels)
        return txm_fail(env, TXM_BAD_ARGUMENT, "model: must have the channels of the image");
    if (d->quality < -2 || d->quality > 2)
        return txm_fail(env, TXM_BAD_ARGUMENT, "quality must be -2 to 2");
    if ((status = txm_image_check(out, "out", 0, env)) != TXM_OK) return status;
    if (out->width != d->image.width || out->height != d->image.height ||
        (out->channels ? out->channels : 1) != channels || out->sample != d->image.sample)
        return txm_fail(env, TXM_BAD_ARGUMENT, "out: must have the form of the image");
    return TXM_OK;
}

/* ---- the picture ---------------------------------------------------------------------- */

/* A float sample that must be known and is NaN or too large? */
static int txs_fill_is_sound(const txm_image *im, int x, int y) {
    if (im->sample != TXM_F32) return 1;
    for (int c = 0; c < im->channels; c++) {
        const float v = txm_image_get(im, x, y, c);
        if (!txm_is_finite((double)v) || !(fabsf(v) <= 1e6f)) return 0;
    }
    return 1;
}

/* The copy of the picture and what is known of it. */
static txm_status txs_fill_open(txs_filler *f, txm_arena *arena, txm_env *env) {
    const texsyn_fill_desc *d = f->desc;
    const txm_image im = txm_image_resolve(d->image);
    const size_t pixels = (size_t)im.width * (size_t)im.height;
    f->image = im;
    f->image.stride = 0;
    f->image.pixels =
        txm_arena_alloc(arena, pixels, (size_t)im.channels * txm_sample_bytes(im.sample));
    f->image = txm_image_resolve(f->image);
    f->state = (uint8_t *)txm_arena_alloc(arena, pixels, 1);
    if (arena->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the picture");
    uint8_t *source;
    const txm_status status = txs_read_mask(&d->source, arena, &source, env);
    if (status != TXM_OK) return status;
    txs_copy_picture(&im, &f->image);
    txm_mask_read(&d->mask, TXM_MASK_REPLACES, f->state);
    for (int y = 0; y < im.height; y++) {
        for (int x = 0; x < im.width; x++) {
            const size_t i = (size_t)y * (size_t)im.width + (size_t)x;
            uint8_t *state = &f->state[i];
            *state = (uint8_t)(*state                   ? TXS_FREE
                               : !source || source[i] ? TXS_SOURCE
                                                      : TXS_KNOWN);
            f->missing += *state == TXS_FREE;
            f->source += *state == TXS_SOURCE;
            if (*state != TXS_FREE && !txs_fill_is_sound(&im, x, y))
                return txm_fail(env, TXM_BAD_ARGUMENT,
                                "image: a known sample is NaN or beyond a million");
        }
    }
    if (!f->missing)
        return txm_fail(env, TXM_BAD_ARGUMENT, "mask: is empty, nothing of it is at least half white; white is what is to be filled");
    if ((size_t)f->missing == pixels)
        return txm_fail(env, TXM_BAD_ARGUMENT, "mask: covers the whole picture; nothing is known");
    if (f->source < TXS_FILL_FEW)
        return txm_fail(env, TXM_TOO_SMALL,
                        "fewer than 256 pixels (16 x 16) are known to learn from");
    return TXM_OK;
}

/* ---- windows -------------------------------------------------------------------------- */

/* Shrink a box to what is missing in it and in no hole yet, and take that. */
static void txs_hole_take(txs_filler *f, txs_hole *h) {
    const txs_hole box = *h;
    h->x0 = box.x1;
    h->y0 = box.y1;
    h->x1 = box.x0;
    h->y1 = box.y0;
    h->missing = 0;
    for (int y = box.y0; y < box.y1; y++) {
        for (int x = box.x0; x < box.x1; x++) {
            uint8_t *state = &f->state[(size_t)y * (size_t)f->image.width + (size_t)x];
            if (*state != TXS_FREE) continue;
            *state = TXS_TAKEN;
            if (x < h->x0) h->x0 = x;
            if (y < h->y0) h->y0 = y;
            if (x >= h->x1) h->x1 = x + 1;
            if (y >= h->y1) h->y1 = y + 1;
            h->missing++;
        }
    }
}

/* The window round a hole with a margin, and how much can be learned there. */
static void txs_hole_open(const txs_filler *f, txs_hole *h, int margin) {
    h->left = h->x0 > margin ? h->x0 - margin : 0;
    h->top = h->y0 > margin ? h->y0 - margin : 0;
    h->width = (h->x1 < f->image.width - margin ? h->x1 + margin : f->image.width) - h->left;
    h->height = (h->y1 < f->image.height - margin ? h->y1 + margin : f->image.height) - h->top;
    h->source = 0;
    for (int y = h->top; y < h->top + h->height; y++)
        for (int x = h->left; x < h->left + h->width; x++)
            h->source += f->state[(size_t)y * (size_t)f->image.width + (size_t)x] == TXS_SOURCE;
}

/* Mark the connected cells with missing pixels; returns the box of them in cells. */
static txs_hole txs_take_cells(uint8_t *cell, int width, int height, int32_t *stack, int first) {
    txs_hole box;
    int count = 1;
    memset(&box, 0, sizeof box);
    box.x0 = box.x1 = first % width;
    box.y0 = box.y1 = first / width;
    cell[first] = 0;
    stack[0] = first;
    while (count) {
        const int at = stack[--count], x = at % width, y = at / width;
        if (x < box.x0) box.x0 = x;
        if (y < box.y0) box.y0 = y;
        if (x > box.x1) box.x1 = x;
        if (y > box.y1) box.y1 = y;
        for (int k = 0; k < 9; k++) {
            const int nx = x + k % 3 - 1, ny = y + k / 3 - 1;
            if (nx < 0 || ny < 0 || nx >= width || ny >= height || !cell[ny * width + nx]) continue;
            cell[ny * width + nx] = 0;
            TEXSYN_ASSERT(count < width * height);
            stack[count++] = ny * width + nx;
        }
    }
    box.x1++;
    box.y1++;
    return box;
}

/* Cut a box of cells into holes of bounded size. */
static void txs_cut_hole(txs_filler *f, txs_hole box) {
    const int w = box.x1 - box.x0, h = box.y1 - box.y0;
    const int nx = (w + TXS_FILL_CELLS - 1) / TXS_FILL_CELLS;
    const int ny = (h + TXS_FILL_CELLS - 1) / TXS_FILL_CELLS;
    for (int i = 0; i < nx * ny; i++) {
        const int x = i % nx, y = i / nx;
        txs_hole part;
        memset(&part, 0, sizeof part);
        part.x0 = (box.x0 + w * x / nx) * TXS_FILL_CELL;
        part.x1 = (box.x0 + w * (x + 1) / nx) * TXS_FILL_CELL;
        part.y0 = (box.y0 + h * y / ny) * TXS_FILL_CELL;
        part.y1 = (box.y0 + h * (y + 1) / ny) * TXS_FILL_CELL;
        if (part.x1 > f->image.width) part.x1 = f->image.width;
        if (part.y1 > f->image.height) part.y1 = f->image.height;
        txs_hole_take(f, &part);
        if (part.missing) f->hole[f->hole_count++] = part;
    }
}

/* Find the holes and their windows: those with most to learn from first. Boxes may overlap; a window
   fills all that is missing in its box, so a later one may find nothing. */
static txm_status txs_find_holes(txs_filler *f, txm_arena *arena, txm_env *env) {
    const int width = (f->image.width + TXS_FILL_CELL - 1) / TXS_FILL_CELL;
    const int height = (f->image.height + TXS_FILL_CELL - 1) / TXS_FILL_CELL;
    const size_t cells = (size_t)width * (size_t)height;
    uint8_t *cell = (uint8_t *)txm_arena_zero(arena, cells, 1);
    int32_t *stack = (int32_t *)txm_arena_alloc(arena, cells, sizeof *stack);
    f->hole = (txs_hole *)txm_arena_alloc(arena, cells, sizeof *f->hole); /* one each at most */
    if (arena->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the windows");
    for (int y = 0; y < f->image.height; y++)
        for (int x = 0; x < f->image.width; x++)
            if (f->state[(size_t)y * (size_t)f->image.width + (size_t)x] == TXS_FREE)
                cell[y / TXS_FILL_CELL * width + x / TXS_FILL_CELL] = 1;
    for (int i = 0; i < width * height; i++)
        if (cell[i]) txs_cut_hole(f, txs_take_cells(cell, width, height, stack, i));
    TEXSYN_ASSERT((size_t)f->hole_count <= cells);
    for (size_t i = 0; i < (size_t)f->image.width * (size_t)f->image.height; i++)
        if (f->state[i] == TXS_TAKEN) f->state[i] = TXS_FREE;
    for (int i = 0; i < f->hole_count; i++) {
        const int w = f->hole[i].x1 - f->hole[i].x0, h = f->hole[i].y1 - f->hole[i].y0;
        txs_hole_open(f, &f->hole[i],
                      (w < h ? w : h) <= TXS_FILL_THIN ? (int)TXS_FILL_THIN : (int)TXS_FILL_MARGIN);
    }
    for (int i = 1; i < f->hole_count; i++) { /* few: insertion sort, stable */
        const txs_hole h = f->hole[i];
        int j = i;
        for (; j > 0 && f->hole[j - 1].source < h.source; j--) f->hole[j] = f->hole[j - 1];
        f->hole[j] = h;
    }
    return TXM_OK;
}

/* ---- a window ------------------------------------------------------------------------- */

/* What a window works with. */
typedef struct txs_pane {
    txs_hole hole;
    txs_ground ground[TXS_FILL_LEVELS];
    int levels, thin, margin;
    int is_trial;   /* only to learn in: a thin hole that is widened */
    txm_image view; /* of the picture */
    texsyn_model *model;
    float spread[TXS_MAX_BANDS];
    txs_mosaic canvas, above;
    uint8_t *reached; /* scratch, a byte for each pixel of the window */
    int index;        /* of the window */
} txs_pane;

/* Distances in king's moves: of missing pixels from known ones (from_hole 0), or of known pixels from
   missing ones (1). Returns the largest. */
static int txs_distances(const txs_ground *g, int from_hole, int32_t *distance) {
    const int width = g->width, height = g->height, far_ = width + height;
    int most = 0;
    for (int pass = 0; pass < 2; pass++) {
        for (int i = 0; i < width * height; i++) {
            const int at = pass ? width * height - 1 - i : i, x = at % width, y = at / width;
            const int step = pass ? 1 : -1, is_far = (g->state[at] == TXS_FREE) != from_hole;
            int d = !is_far ? 0 : pass ? distance[at] : far_;
            for (int k = -1; k <= 1 && is_far; k++) {
                const int nx = x + k, ny = y + step;
                if (nx < 0 || nx >= width || ny < 0 || ny >= height) continue;
                if (distance[ny * width + nx] + 1 < d) d = distance[ny * width + nx] + 1;
            }
            if (is_far && x + step >= 0 && x + step < width && distance[at + step] + 1 < d)
                d = distance[at + step] + 1;
            distance[at] = d;
            if (pass && d > most) most = d;
        }
    }
    return most;
}

/* The width of the widest part of the hole. distance: a number for each pixel. */
static int txs_hole_width(const txs_ground *g, int32_t *distance) {
    return 2 * txs_distances(g, 0, distance);
}

/* Pyramid levels for a hole of this width; ours, by trial. */
static int txs_hole_levels(int width) {
    static const int from[TXS_FILL_LEVELS - 1] = {20, 40, 80, 240, 480};
    int levels = 1;
    while (levels < TXS_FILL_LEVELS && width >= from[levels - 1]) levels++;
    return levels;
}

/* States and labels of the window: what is missing outside the hole's box has no label yet. */
static void txs_pane_mark(const txs_filler *f, txs_pane *p) {
    const txs_hole *h = &p->hole;
    txs_ground *g = &p->ground[0];
    for (int y = 0; y < g->height; y++) {
        for (int x = 0; x < g->width; x++) {
            const size_t i = (size_t)y * (size_t)g->width + (size_t)x;
            const int px = h->left + x, py = h->top + y;
            g->state[i] = f->state[(size_t)py * (size_t)f->image.width + (size_t)px];
            const int is_inside = px >= h->x0 && px < h->x1 && py >= h->y0 && py < h->y1;
            g->label[i] = g->state[i] == TXS_FREE && !is_inside ? TXS_NO_LABEL : 0;
        }
    }
}

static int64_t txs_count_source(const txs_ground *g) {
    int64_t count = 0;
    for (size_t i = 0; i < (size_t)g->width * (size_t)g->height; i++)
        count += g->state[i] == TXS_SOURCE && g->label[i] != TXS_NO_LABEL;
    return count;
}

/* In a thin hole nearly all cliques have known members, which says little of the potentials: they are
   learned in a wider one, if enough is left to learn from. distance: a number for each pixel. */
static void txs_pane_widen(txs_pane *p, int32_t *distance) {
    txs_ground *g = &p->ground[0];
    const int pixels = g->width * g->height;
    int64_t left = 0;
    txs_distances(g, 1, distance);
    for (int i = 0; i < pixels; i++)
        left += g->state[i] == TXS_SOURCE && distance[i] > TXS_FILL_WIDER;
    if (left < TXS_FILL_LEAST) return;
    for (int i = 0; i < pixels; i++)
        if (g->label[i] != TXS_NO_LABEL && distance[i] <= TXS_FILL_WIDER) g->state[i] = TXS_FREE;
    p->is_trial = 1;
}

/* Learn only from what is near the hole, if that is enough: a long scratch crosses much that
   differs. distance: a number for each pixel. */
static void txs_pane_narrow(txs_pane *p, int32_t *distance) {
    txs_ground *g = &p->ground[0];
    const int pixels = g->width * g->height;
    int64_t near_ = 0;
    txs_distances(g, 1, distance);
    for (int i = 0; i < pixels; i++) near_ += g->state[i] == TXS_SOURCE && distance[i] <= p->margin;
    if (near_ < TXS_FILL_ENOUGH) return;
    for (int i = 0; i < pixels; i++)
        if (g->state[i] == TXS_SOURCE && distance[i] > p->margin) g->state[i] = TXS_KNOWN;
}

/* Room for a model with all its types. */
static texsyn_model *txs_fill_model_make(txm_arena *arena, int channels) {
    texsyn_model *m = (texsyn_model *)txm_arena_zero(arena, 1, sizeof *m);
    txs_type *types =
        (txs_type *)txm_arena_zero(arena, (size_t)TXS_FILL_LEVELS * TXS_MAX_TYPES, sizeof *types);
    if (arena->failed) return NULL;
    m->channels = channels;
    for (int i = 0; i < TXS_FILL_LEVELS; i++) m->level[i].types = types + i * TXS_MAX_TYPES;
    return m;
}

/* A model as the canvas can use it: the cliques with the coarser level are left out, and neighbours
   within a coarser pixel and across its border become one type again. */
static void txs_flatten(const texsyn_model *from, texsyn_model *to) {
    txs_type *types[TXS_FILL_LEVELS];
    for (int i = 0; i < TXS_FILL_LEVELS; i++) types[i] = to->level[i].types;
    *to = *from;
    for (int i = 0; i < from->levels; i++) {
        const txs_level *l = &from->level[i];
        int kept = 0;
        to->level[i].types = types[i];
        for (int k = 0; k < l->type_count; k++) {
            const txs_type *t = &l->types[k];
            if (t->kind > TEXSYN_PARALLEL || t->kind == TEXSYN_PARENT || t->kind == TEXSYN_SCALE ||
                t->phase == 2)
                continue;
            to->level[i].types[kept] = *t;
            to->level[i].types[kept++].phase = 0;
        }
        to->level[i].type_count = kept;
    }
}

/* ---- a model in another light ---------------------------------------------------------------- */

/* Standard deviation of a band's values. */
static double txs_band_deviation(const txs_level *l, int band) {
    double mean = 0, square = 0;
    for (int v = 0; v < TXS_VALUES; v++) {
        const double share = (double)l->types[band].share[v] / (double)TXS_ONE;
        mean += share * v;
        square += share * v * v;
    }
    return sqrt(square > mean * mean ? square - mean * mean : 0) * (double)l->step[band];
}

/* Give a model the mean colour of what is known and visible, and the contrast of its first band: a
   texture from another photograph then has the light of this one. Alpha stays as it is. */
static void txs_fill_relight(const txs_filler *f, texsyn_model *m) {
    const int colours = m->channels < 3 ? 1 : 3;
    const int first = txs_is_alpha(m, 0) && m->bands > 1; /* the first band of colours */
    const txm_image *im = &f->image;
    double mean[3] = {0, 0, 0}, square = 0, along = 0, count = 0;
    for (int y = 0; y < im->height; y++) {
        for (int x = 0; x < im->width; x++) {
            double band = 0, weight = 1;
            if (f->state[(size_t)y * (size_t)im->width + (size_t)x] != TXS_SOURCE ||
                (m->channels == 4 && !(txm_image_get(im, x, y, 3) > 0)))
                continue;
            if (m->channels == 4) weight = (double)txm_clampf(txm_image_get(im, x, y, 3), 0, 1);
            for (int c = 0; c < colours; c++) {
                const double v = 255.0 * (double)txm_image_get(im, x, y, c);
                mean[c] += weight * v;
                band += (double)m->basis[first][c] * (v - (double)m->mean[c]);
            }
            along += weight * band;
            square += weight * (band * band);
            count += weight;
        }
    }
    if (!(count >= (double)TXS_FILL_FEW)) return;
    const double variance = square / count - along / count * (along / count);
    const double now = txs_band_deviation(&m->level[0], first);
    double gain = variance > 0 && now > 0 ? sqrt(variance) / now : 1;
    gain = gain < TXS_FILL_DIMMEST ? TXS_FILL_DIMMEST : gain;
    gain = gain > TXS_FILL_BRIGHTEST ? TXS_FILL_BRIGHTEST : gain;
    for (int c = 0; c < colours; c++) m->mean[c] = txs_short_float(txm_float(mean[c] / count));
    for (int i = 0; i < m->levels; i++) {
        for (int b = 0; b < m->bands; b++) {
            if (m->channels == 4 && m->basis[b][3] != 0) continue;
            m->level[i].low[b] = txs_short_float(txm_float((double)m->level[i].low[b] * gain));
            m->level[i].step[b] = txs_short_float(txm_float((double)m->level[i].step[b] * gain));
        }
    }
}

/* ---- filling a window ----------------------------------------------------------------- */

/* Work for the given quality, -2..2; ours, by trial. */
static int txs_fill_types(int quality) {
    static const int types[5] = {0, 6, 12, 18, 24};
    return types[quality + 2];
}

static int txs_fill_sweeps(int quality) {
    static const int sweeps[5] = {5, 8, 12, 18, 28};
    return sweeps[quality + 2];
}

/* The ground of the window: its pixels, and the coarser levels as far as there is something to learn
   from. With a known model only its own levels. */
static txm_status txs_pane_prepare(const txs_filler *f, txs_pane *p, const texsyn_model *known,
                                   txm_arena *arena, txm_env *env) {
    const txs_hole *h = &p->hole;
    const int channels = f->image.channels;
    const size_t pixels = (size_t)h->width * (size_t)h->height;
    txs_ground *g = p->ground;
    p->view = f->image;
    p->view.pixels = (char *)txm_image_row(&f->image, h->top) +
                     (size_t)h->left * (size_t)channels * txm_sample_bytes(f->image.sample);
    p->view.width = h->width;
    p->view.height = h->height;
    int32_t *scratch = (int32_t *)txm_arena_alloc(arena, pixels, sizeof *scratch);
    p->reached = (uint8_t *)txm_arena_alloc(arena, pixels, 1);
    if (arena->failed || !txs_ground_make(&g[0], arena, h->width, h->height, channels, 1))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a window");
    txs_pane_mark(f, p);
    int width = txs_hole_width(&g[0], scratch);
    p->thin = width <= TXS_FILL_THIN;
    if (p->thin && !known) txs_pane_widen(p, scratch);
    if (p->is_trial) width = txs_hole_width(&g[0], scratch);
    p->margin = p->thin ? (int)TXS_FILL_THIN : (int)TXS_FILL_MARGIN;
    txs_pane_narrow(p, scratch);
    int levels = txs_hole_levels(width);
    if (known && levels > known->levels) levels = known->levels;
    if (!known) txs_ground_find_bands(&g[0], &p->view, 0, p->model, p->reached);
    txs_ground_split(&g[0], &p->view, &p->model);
    if (!txs_ground_show(&g[0], &p->model, 1, arena))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a window");
    for (p->levels = 1; p->levels < levels; p->levels++) {
        const txs_ground *fine = &g[p->levels - 1];
        txs_ground *coarse = &g[p->levels];
        if (!txs_ground_make(coarse, arena, (fine->width + 1) / 2, (fine->height + 1) / 2, channels,
                             1))
            return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a window");
        txs_ground_halve(fine, coarse);
        if (txs_count_source(coarse) < TXS_FILL_FEW) break;
    }
    p->model->levels = p->levels;
    return TXM_OK;
}

/* Quantise the levels of the window. */
static txm_status txs_pane_quantise(txs_pane *p, txm_arena *arena, txm_env *env) {
    const size_t room =
        (size_t)p->ground[0].width * (size_t)p->ground[0].height * (size_t)p->model->bands;
    float *values = (float *)txm_arena_alloc(arena, room, sizeof *values);
    uint8_t *bytes = (uint8_t *)txm_arena_alloc(arena, room, 1);
    if (arena->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a window");
    for (int i = 0; i < p->levels; i++)
        txs_ground_quantise(&p->ground[i], 0, p->model->bands, &p->model->level[i], values, bytes,
                            i ? NULL : p->spread);
    return TXM_OK;
}

/* Learn or synthesise one level of the window. */
static txm_status txs_pane_level(const txs_filler *f, txs_pane *p, int index, int is_known,
                                 txm_env *env, float from, float to) {
    const int quality = f->desc->quality;
    const uint64_t seed = txm_hash(f->desc->seed + 977u * (uint64_t)p->index) + (uint64_t)index;
    const txs_texture texture = {p->model, &p->model->level[index]};
    const int softness = p->thin && !p->is_trial ? TXS_FILL_SOFT_THIN : TXS_FILL_SOFT;
    const int16_t *last = index ? NULL : f->cool;
    txs_raise_map maps[1];
    int reach = TXS_FILL_REACH;
    for (int k = 0; k < texture.level->type_count && is_known; k++)
        if (txs_reach(&texture.level->types[k]) > reach)
            reach = txs_reach(&texture.level->types[k]);
    if (!txs_mosaic_make(&p->canvas, env, &p->ground[index], 1, reach, 0))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a window");
    txs_mosaic_lay(&p->canvas, &p->ground[index], &texture, seed);
    if (p->above.canvas.pixels) {
        const txs_texture above = {p->model, &p->model->level[index + 1]};
        txs_mosaic_raise(&p->canvas, &p->above, &above, &texture, maps);
        txs_mosaic_free(&p->above, env);
    } else {
        txs_mosaic_grow(&p->canvas, p->reached, seed);
    }
    if (is_known) {
        const txs_brush_plan plan = {TXS_MAX_TYPES, 0, TXS_FILL_REFRESH, softness, seed};
        return txs_mosaic_run(&p->canvas, &texture, &plan, NULL, 0, txs_fill_sweeps(quality),
                              f->noise, last, env, from, to);
    }
    const txs_study_plan plan = {4,
                                 3,
                                 txs_fill_sweeps(quality),
                                 txs_fill_types(quality),
                                 6,
                                 TXS_FILL_REACH,
                                 TXS_FILL_REFRESH,
                                 softness,
                                 0,
                                 seed,
                                 f->noise,
                                 last,
                                 NULL};
    return txs_mosaic_learn(&plan, index, &p->model, &p->canvas, &p->canvas, NULL, NULL, env, from,
                            to);
}

/* The samples of a pixel from the bands of the window's ground. */
static void txs_pane_paint(const txs_pane *p, int x, int y) {
    const texsyn_model *m = p->model;
    const txs_ground *g = &p->ground[0];
    const size_t pixels = (size_t)g->width * (size_t)g->height;
    const size_t i = (size_t)y * (size_t)g->width + (size_t)x;
    for (int c = 0; c < m->channels; c++) {
        double v = (double)m->mean[c];
        for (int b = 0; b < m->bands; b++) /* a product of two floats is exact in double */
            v += (double)m->basis[b][c] * (double)g->value[(size_t)b * pixels + i];
        txm_image_set(&p->view, x, y, c, txm_float(v / 255));
    }
}

/* From the canvas to the picture. */
static txm_status txs_pane_close(txs_filler *f, txs_pane *p, txm_arena *arena, txm_env *env) {
    txs_ground *g = &p->ground[0];
    const txs_texture texture = {p->model, &p->model->level[0]};
    const size_t pixels = (size_t)g->width * (size_t)g->height;
    float *at = (float *)txm_arena_alloc(arena, pixels, sizeof *at);
    float *grain = (float *)txm_arena_alloc(arena, pixels, sizeof *grain);
    if (arena->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a window");
    for (int b = 0; b < p->model->bands; b++)
        txs_tone_apply(&p->canvas, g, &texture, 0, b, p->spread[b], f->desc->seed, at, grain);
    for (int y = 0; y < g->height; y++) {
        for (int x = 0; x < g->width; x++) {
            const size_t i = (size_t)y * (size_t)g->width + (size_t)x;
            if (g->state[i] != TXS_FREE || g->label[i] == TXS_NO_LABEL) continue;
            txs_pane_paint(p, x, y);
            f->state[(size_t)(p->hole.top + y) * (size_t)f->image.width +
                     (size_t)(p->hole.left + x)] = TXS_KNOWN;
        }
    }
    return TXM_OK;
}

/* Take a copy of a model that is known instead of learning one. */
static void txs_pane_adopt(txs_pane *p, const texsyn_model *known) {
    txs_flatten(known, p->model);
    memcpy(p->spread, known->dither, sizeof p->spread);
}

/* All levels of a window. */
static txm_status txs_pane_levels(const txs_filler *f, txs_pane *p, int is_known, txm_env *env,
                                  float from, float to) {
    txm_status status = TXM_OK;
    float total = 0;
    for (int i = 0; i < p->levels; i++) total += 1.0f / (float)(1 << 2 * i);
    const float part = (to - from) / total;
    for (int i = p->levels - 1; i >= 0 && status == TXM_OK; i--) {
        const float next = from + part / (float)(1 << 2 * i);
        status = txs_pane_level(f, p, i, is_known, env, from, i ? next : to);
        from = next;
        if (i && status == TXM_OK) {
            p->above = p->canvas;
            p->canvas.canvas.pixels = NULL;
        }
    }
    return status;
}

/* Fill a window with a model that is known, or with one that is learned, which p->model receives.
   *is_trial: it was only learned. */
static txm_status txs_fill_once(txs_filler *f, int index, const texsyn_model *known,
                                texsyn_model *model, int *is_trial, txm_env *env, float from,
                                float to) {
    txm_status status;
    txm_arena arena;
    txm_arena_init(&arena, env);
    txs_pane *p = (txs_pane *)txm_arena_zero(&arena, 1, sizeof *p);
    if (!p) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a window");
    p->hole = f->hole[index];
    p->model = model;
    p->index = index;
    p->canvas.canvas.pixels = p->above.canvas.pixels = NULL; /* both are freed below, if made or not */
    if (known) txs_pane_adopt(p, known);
    status = txs_pane_prepare(f, p, known, &arena, env);
    if (status == TXM_OK && !known) status = txs_pane_quantise(p, &arena, env);
    if (status == TXM_OK) status = txs_pane_levels(f, p, known != NULL, env, from, to);
    if (status == TXM_OK && !p->is_trial) status = txs_pane_close(f, p, &arena, env);
    memcpy(model->dither, p->spread, sizeof p->spread);
    *is_trial = p->is_trial;
    txs_mosaic_free(&p->canvas, env);
    txs_mosaic_free(&p->above, env);
    txm_arena_free(&arena);
    return status;
}

/* The same, and once more with the model if it was only learned. The models lie in the memory of
   models. */
static txm_status txs_fill_window(txs_filler *f, int index, const texsyn_model *known,
                                  txm_arena *models, texsyn_model **model, txm_env *env, float from,
                                  float to) {
    const float learned = from + 0.8f * (to - from); /* of the time, if there is a trial */
    int is_trial = 0;
    txm_status status = TXM_OUT_OF_MEMORY;
    *model = txs_fill_model_make(models, f->image.channels);
    texsyn_model *copy = txs_fill_model_make(models, f->image.channels);
    if (*model && copy)
        status = txs_fill_once(f, index, known, *model, &is_trial, env, from, learned);
    else txm_fail(env, status, "no memory for a model");
    if (status == TXM_OK && is_trial)
        status = txs_fill_once(f, index, *model, copy, &is_trial, env, learned, to);
    return status;
}

/* All windows. What the first has learned serves those that have little to learn from. */
static txm_status txs_fill_windows(txs_filler *f, txm_arena *arena, txm_env *env) {
    txm_status status = TXM_OK;
    const texsyn_model *given = f->given;
    double done = 0;
    for (int i = 0; i < f->hole_count && status == TXM_OK; i++) {
        txs_hole *h = &f->hole[i];
        const float from = (float)(done / (double)f->missing);
        txm_arena own; /* of this window's model */
        texsyn_model *model;
        done += (double)h->missing;
        txm_arena_init(&own, env);
        for (int margin = TXS_FILL_MARGIN;
             i == 0 && !given && h->source < TXS_FILL_ENOUGH && h->source < f->source;
             margin = txm_clampi(2 * margin, 0, 1 << 24))
            txs_hole_open(f, h, margin);
        const texsyn_model *known = given ? given : h->source < TXS_FILL_LEAST ? f->first : NULL;
        status = txs_fill_window(f, i, known, i ? &own : arena, &model, env, from,
                                 (float)(done / (double)f->missing));
        if (i == 0) f->first = model;
        txm_arena_free(&own);
    }
    return status;
}

/* ---- public: filling ------------------------------------------------------------------ */

TEXSYN_API txm_status texsyn_fill(const texsyn_fill_desc *desc, txm_env *env, txm_image out) {
    txm_arena arena;
    txs_filler filler;
    txm_status status = txs_fill_check(desc, &out, env);
    if (status != TXM_OK) return status;
    memset(&filler, 0, sizeof filler);
    filler.desc = desc;
    txm_arena_init(&arena, env);
    status = txs_fill_open(&filler, &arena, env);
    if (status == TXM_OK) status = txs_find_holes(&filler, &arena, env);
    if (status == TXM_OK) {
        const size_t entries = (size_t)TXS_NOISE + TXS_VALUES;
        filler.noise = (int16_t *)txm_arena_alloc(&arena, entries, sizeof *filler.noise);
        filler.cool = (int16_t *)txm_arena_alloc(&arena, entries, sizeof *filler.cool);
        if (desc->model) filler.given = txs_fill_model_make(&arena, filler.image.channels);
        if (arena.failed) status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to fill");
    }
    if (status == TXM_OK) {
        txs_noise_table(filler.noise);
        txs_cool_noise(filler.noise, TXS_FILL_COOL, filler.cool);
        if (filler.given) txs_flatten(desc->model, filler.given);
        if (filler.given && desc->relight) txs_fill_relight(&filler, filler.given);
        status = txs_fill_windows(&filler, &arena, env);
    }
    if (status == TXM_OK && txm_image_has_alpha(&filler.image)) { /* known pixels stay, to the byte */
        txm_mask_read(&desc->mask, TXM_MASK_REPLACES, filler.state);
        status = txm_image_bleed_part(&filler.image, filler.state, 0, 1, 1, env);
    }
    if (status == TXM_OK) txs_copy_picture(&filler.image, &out);
    txm_arena_free(&arena);
    return status;
}

#endif /* TEXSYN_FILL_H */
