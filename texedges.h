/* texedges.h - v0.2.0 - the gray layers of a picture, their boundaries, and strokes drawn like them
   SPDX-License-Identifier: MIT OR Unlicense                   (full text: end of file)

   WHAT IT DOES
     Divides the gray values of a picture into a few layers and finds the boundaries between them,
     as closed lines and as pictures [1, 3.2]. Strokes that a user draws are disturbed with the
     statistics of these boundaries, so that they look like edges of the texture, and become a guide
     picture that says which layer each pixel should show [1, 3.3].

   QUICK START                                 (tests build and run this very block)
     // Layers of a picture, and a stroke with edges like theirs. cc -std=c99 quick.c -lm
     #define TEXEDGES_IMPLEMENTATION          // in exactly one .c or .cpp file
     #include "texedges.h"                    // texmath.h must lie beside it
     #include <stdio.h>

     enum { SIDE = 128 };
     static unsigned char photo[SIDE * SIDE], layers[SIDE * SIDE];   // the caller owns all pixels
     static unsigned char guide[SIDE * SIDE], mask[SIDE * SIDE];

     static txm_image image_of(unsigned char *pixels) {
         txm_image image = {pixels, SIDE, SIDE, 1, TXM_U8, 0};
         return image;
     }

     int main(void) {
         static texedges_desc desc;           // static: all zero, which means the defaults
         static texedges_control control;
         static texedges_stroke stroke;
         static txm_env env;                  // malloc, silent, serial; receives the message
         const txm_vec2 points[3] = {{16, 90}, {64, 64}, {112, 90}};
         const txm_image layers_out = image_of(layers), guide_out = image_of(guide);
         const txm_image mask_out = image_of(mask);
         texedges_set *edges = NULL, *lines = NULL;
         for (int i = 0; i < SIDE * SIDE; i++) {   // instead of a photograph: wavy stripes
             const int x = i % SIDE, y = i / SIDE;
             photo[i] = (unsigned char)((y + x * x / 16 % 7) / 16 % 2 ? 200 : 60);
         }
         desc.image = image_of(photo);
         desc.levels = 2;
         stroke.points = points;
         stroke.count = 3;
         stroke.layer = 1;                    // the bright one
         stroke.width = 20;
         control.strokes = &stroke;
         control.stroke_count = 1;
         control.background = -1;             // free: anything, away from the stroke
         int ok = texedges_find(&desc, &env, &edges) == TXM_OK &&
                  texedges_layers(&desc, edges, &env, &layers_out) == TXM_OK;
         control.edges = edges;
         ok = ok && texedges_disturb(&control, SIDE, SIDE, &env, &lines) == TXM_OK &&
              texedges_guide(&control, lines, &env, &guide_out, &mask_out) == TXM_OK;
         if (ok)
             printf("%d boundaries; the stroke has gray %d\n", (int)edges->line_count,
                    guide[SIDE * 64 + 64]);
         else fprintf(stderr, "edges: %s\n", env.message);
         texedges_set_free(lines);
         texedges_set_free(edges);
         return !ok;
     }

   WHICH CALL
     texedges_find        the boundaries of all layers, as lines
     texedges_layers      the layer of each pixel, as a gray picture
     texedges_draw        lines drawn over a picture
     texedges_disturb     strokes, disturbed like the boundaries of their layer
     texedges_guide       the guide picture of disturbed strokes, and where it counts
     To follow strokes in a texture made with texpatch.h: the picture of texedges_layers is the
     guide of its exemplar, the two pictures of texedges_guide are its guide and guide_mask.

   HOW IT WORKS
     The histogram of the grays is divided into parts of about the same area, at its least frequent
     values; small connected regions can be merged into the layer around them. Lines follow the
     cracks between pixels. The roughness of a layer is how far its lines P deviate from their smooth
     course 2 S P - S S P (S a blur of 32 pixels), along and across it. Along a stroke pieces of this
     roughness, 16 to 48 pixels long, are joined end to end; of those that join well the one is
     taken that brings the directions of the line closest to those of the exemplar's lines. Loops
     are cut off, and the line is filled by its winding number.

   CONFIGURATION   (define before the include that has _IMPLEMENTATION)
     TEXEDGES_STATIC       every function static to the including file (set it everywhere)
     TEXEDGES_MAX_PIXELS   refuse larger pictures; default 2^28

   MEMORY
     5 to 13 bytes for each pixel while layers are found, 8 for each point of the lines, of which
     there are up to four a pixel, 200 for each pixel along the longest stroke. After an error
     nothing stays allocated, and the set to be returned is NULL.

   TIME   (one core of 2023)
     Some 0.2 us for each pixel of a picture, 1 us for each pixel along edges and strokes, 50 ns for
     each pixel of a guide. All work is serial.

   THREADS
     No global state: calls with different env and outputs may overlap; a finished set may be read
     by many.

   SAME BYTES
     Layers, lines, and guides are made in integers; blurs and strokes in double, by sums in a fixed
     order and square roots, rounded to float once: the same bytes on any compiler that keeps to
     IEEE 754 (see texmath.h), built with -ffp-contract=off.

   REFERENCES
     [1] GPU-based interactive near-regular texture synthesis for digital human models.
         Technology and Health Care.                                                            */
#ifndef TEXEDGES_H
#define TEXEDGES_H

#include "texmath.h"

#define TEXEDGES_VERSION "0.2.0"

#ifndef TEXEDGES_MAX_PIXELS
#define TEXEDGES_MAX_PIXELS (1 << 28) /* larger pictures are refused */
#endif

#if defined(TEXEDGES_STATIC) && defined(__GNUC__)
#define TEXEDGES_API __attribute__((unused)) static
#elif defined(TEXEDGES_STATIC)
#define TEXEDGES_API static
#else
#define TEXEDGES_API extern
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* ---- layered edges ----------------------------------------------------------------------- */

enum { TEXEDGES_MAX_LEVELS = 16 };

/* One boundary of a layer: its points are points[first .. first + count - 1] of the set, closed
   (the last is joined to the first). */
typedef struct texedges_polyline {
    int layer;    /* 0..levels-1: this is a boundary of that layer                            */
    int is_hole;  /* the layer lies outside it                                                */
    size_t first, count;
} texedges_polyline;

/* The boundaries of the gray layers of a picture [1, 3.2]. Layer k holds the pixels whose gray
   value g has thresholds[k-1] <= g < thresholds[k] (the first from 0, the last to 1).

   Lines that texedges_find makes run along the cracks between pixels, with a point at each pixel
   corner that they pass. The layer lies to the right of the line's direction (outer boundaries run
   clockwise as seen, holes counter-clockwise); the outside of the picture belongs to no layer.
   Each side of each crack between two layers is part of exactly one line. Pixels that touch only at
   a corner are not connected: where two pixels of a layer touch so, its line turns right, around the
   pixel that it came along. So lines may touch at a corner, but never cross themselves or each other.

         +---+              lines are in raster order of their first points: the top left corner
         | k |              of the topmost (then leftmost) pixel of an outer boundary
     +---+---+  the two pixels of layer k have a line each; the two
     | k |      others too, whether they are of one layer or not
     +---+                                                                                    */
typedef struct texedges_set {
    int levels, width, height;
    float thresholds[TEXEDGES_MAX_LEVELS]; /* levels - 1 of them, rising, of the gray 0..1     */
    int beside[TEXEDGES_MAX_LEVELS]; /* the layer that shares most of this layer's boundary; -1:
                                        none, it has no boundary but the picture's              */
    texedges_polyline *lines;
    size_t line_count;
    txm_vec2 *points; /* (0, 0) is the top left corner of the picture, (0.5, 0.5) the centre of the
                         top left pixel                                                        */
    size_t point_count;
    txm_arena memory; /* private: holds the set                                                */
} texedges_set;

/* What to find. All zero but the image is a good default. */
typedef struct texedges_desc {
    txm_image image; /* 1..4 channels; the gray is the luma of RGB (0.2126, 0.7152, 0.0722) of the
                        samples as they are, clamped to 0..1; alpha is not used, but where it
                        is 0 the colour is taken from visible neighbours                       */
    int levels;      /* 2..TEXEDGES_MAX_LEVELS; 0 = 4, as in the paper                         */
    float smooth;    /* radius in pixels of a blur beforehand, 0..16; a fine-grained picture needs
                        1 to 3                                                                 */
    int least;       /* pixels: a connected region whose boundary (holes and the picture's border
                        included) is shorter is merged into the neighbouring layer that shares
                        most of that boundary, the shortest first; 0 = all regions are kept    */
    const float *thresholds; /* levels - 1 of them, rising, in 0..1; NULL = such that the layers
                        have about the same area, each at the least frequent gray nearby       */
} texedges_desc;

/* Find the boundaries of all layers.

   env    NULL, or how to allocate, report and cancel
   out    receives the set, or NULL on any error; release it with texedges_set_free
   return TXM_OK; TXM_BAD_ARGUMENT for a field outside its range or samples that are not finite;
          TXM_TOO_LARGE above TEXEDGES_MAX_PIXELS or 2^20 pixels a side; TXM_OUT_OF_MEMORY;
          TXM_CANCELLED
   cost   O(pixels (1 + smooth + log least)) time, about 0.2 us a pixel; 13 bytes a pixel while it
          works (9 without least, 5 without both), and the result: 8 bytes for each point, of which
          there are up to four a pixel, and 24 for each line                                   */
TEXEDGES_API txm_status texedges_find(const texedges_desc *desc, txm_env *env, texedges_set **out);

/* Release a set; NULL is allowed. */
TEXEDGES_API void texedges_set_free(texedges_set *set);

/* The layer of each pixel of a picture, by the thresholds of a set, as a gray value: layer k is
   255 k / (levels - 1), rounded. It serves as the guide of an exemplar (see control edges).

   desc   image, smooth and least are used; with those that the set was found with, the layers
          change exactly where its lines run
   edges  whose thresholds to use
   layers TXM_U8, 1 channel, the size of the picture; untouched after an error
   return as texedges_find
   cost   as texedges_find; 13 bytes a pixel                                                   */
TEXEDGES_API txm_status texedges_layers(const texedges_desc *desc, const texedges_set *edges,
                                        txm_env *env, const txm_image *layers);

/* Draw the boundaries of one layer (-1: of all) over a picture (TXM_U8, 1 or 3 channels), one pixel
   wide, on the layer's own side; colours run from dark to light with the layers, in one channel the
   gray. What lies outside the picture is not drawn. The picture is untouched after an error.
   cost   a byte for each pixel; O(pixels + length of the lines) time                           */
TEXEDGES_API txm_status texedges_draw(const texedges_set *edges, int layer, txm_env *env,
                                      const txm_image *image);

/* ---- control edges ----------------------------------------------------------------------- */

/* A stroke of the user: a line that becomes an edge of the texture [1, 3.3]. The inside of a closed
   one becomes the layer; an open one becomes a band of the layer with round ends. */
typedef struct texedges_stroke {
    const txm_vec2 *points; /* count of them, 2 or more (closed: 3), not all the same, in pixels of
                               the output; they may lie outside it, up to 2^20                  */
    int count;
    int is_closed;
    int layer;   /* 0..levels-1: of the inside, or of the band                                  */
    float width; /* of the band of an open stroke, pixels, 2..256; 0 = 8                        */
} texedges_stroke;

/* Strokes, and how to treat them. */
typedef struct texedges_control {
    const texedges_set *edges; /* of the exemplar, from texedges_find                           */
    const texedges_stroke *strokes;
    int stroke_count;  /* 0 or more                                                             */
    int background;    /* the layer outside all strokes; -1 = free: any layer, except the stroke's
                          own next to a stroke                                                  */
    float disturb;     /* 0..4: how much of the exemplar's roughness the strokes take on; 0 = 1;
                          -1 = none                                                             */
    uint64_t seed;     /* another seed gives another disturbance                                */
} texedges_control;

/* The strokes, disturbed with the statistics of the exemplar's edges of their layer: pieces of the
   roughness of those edges, their deviation from their own smooth course, are joined end to end
   along the stroke.

   width, height  of the output, in pixels
   out    receives one closed line for each stroke, in their order (of an open stroke: around its
          band), inside to the right; or NULL on any error. levels, thresholds and beside are the
          exemplar's. Release it with texedges_set_free.
          A line deviates from its stroke (the edge of its band) by 4 pixels at most; from short
          strokes and narrow bands by less, 1/16 of the length and 7/16 of the width. Where the
          stroke turns gently (radii over 8 pixels, no part nearer than 8 pixels to another) the
          line does not cross itself. If the exemplar has no edge of that layer of 64 pixels or
          more, and with disturb = -1, it is the stroke itself
   return TXM_OK; TXM_BAD_ARGUMENT for a field outside its range, coordinates that are not finite,
          edges that texedges_find did not make; TXM_TOO_LARGE for strokes longer than 2^26 pixels;
          TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost   O(edges + length of the strokes) time, about 1 us for each pixel of either; 200 bytes for
          each pixel of the longest stroke (its band's outline), 30 for each of all, 100 for each of
          the edges of a layer                                                                 */
TEXEDGES_API txm_status texedges_disturb(const texedges_control *control, int width, int height,
                                         txm_env *env, texedges_set **out);

/* The guide picture of disturbed strokes, and the mask of where it counts. With texpatch.h they are
   texpatch_desc.guide and .guide_mask, and the picture of texedges_layers is the exemplar's guide.

   disturbed  what texedges_disturb made of the same control
   guide  TXM_U8, 1 channel, the size given to texedges_disturb: the gray of the layer. Pixels whose
          centre lies inside a line (winding number not 0; of a centre on the line, that to its
          right or below is inside) have the stroke's layer, the last stroke on top. With
          background = -1, up to 8 pixels outside the strokes it is the layer that shares most of
          the boundary of the nearest stroke's layer in the exemplar
   mask   the same format: 0 where the guide does not count (with background = -1, farther than 8
          pixels outside all strokes), else 255
   return TXM_OK; TXM_BAD_ARGUMENT; TXM_TOO_LARGE; TXM_OUT_OF_MEMORY; TXM_CANCELLED. After an error
          guide and mask are untouched
   cost   O(pixels + area and height of the strokes) time, about 50 ns a pixel; 3 bytes a pixel and
          24 for each row that a stroke's line crosses                                           */
TEXEDGES_API txm_status texedges_guide(const texedges_control *control,
                                       const texedges_set *disturbed, txm_env *env,
                                       const txm_image *guide, const txm_image *mask);

#ifdef __cplusplus
}
#endif
#endif /* TEXEDGES_H */

#if defined(TEXEDGES_IMPLEMENTATION) && !defined(TEXEDGES_IMPLEMENTED)
#define TEXEDGES_IMPLEMENTED

/* ---- constants and progress ------------------------------------------------------------ */

enum {
    TXE_MAX_SIDE = 1 << 20,   /* pixels: up to here a float tells half pixels apart              */
    TXE_MAX_PIXELS = 1 << 28, /* of a picture; four cracks each still fit an int32_t             */
    TXE_MAX_LENGTH = 1 << 26, /* pixels, of all strokes                                          */
    TXE_REPORT = 1 << 15,     /* work, in units of a few ns, between two progress reports        */
    TXE_AROUND = 8, /* pixels around a stroke in which the guide asks for its neighbouring layer */

    TXE_STEP_BLUR = 2,       /* pixels: radius of a blur that removes the steps of pixels        */
    TXE_CORNER_BLUR = 3,     /* pixels: radius of the blur that rounds the corners of a stroke   */
    TXE_COURSE_BLUR = 32,    /* pixels: radius of the blur that makes the smooth course of a line */
    TXE_DIRECTION_BLUR = 24, /* pixels: the same, for the course that directions are relative to */
    TXE_CHORD = 6,     /* pixels to either side, between which a smooth line's direction is taken */
    TXE_BINS = 16,     /* directions of a histogram over half a turn                             */
    TXE_PIECE = 48,    /* samples: longest piece of roughness; the shortest is a third of it     */
    TXE_JOIN = 8,      /* samples over which the end of a piece is blended into the next         */
    TXE_MIN_LINE = 64, /* samples: shorter lines of the exemplar are not measured                */
    TXE_TRIES = 64,    /* candidates for each piece; four times as many for the closing one      */
    TXE_BEST = 8,      /* candidates with the best joints, of which the directions decide        */
    TXE_LOOP = 64      /* points: shorter loops of a disturbed line are cut off                  */
};
#define TXE_MAX_OFFSET 3.5  /* pixels from the stroke, for roughness (0.5 more for chords)       */
#define TXE_KEPT_OFFSET 2.0 /* pixels: larger offsets are compressed, smaller ones kept          */

/* The progress of one call: the current stage covers from..to of it, `total` units of work. */
typedef struct txe_progress {
    const txm_env *env;
    const char *stage;
    double from, to, total, done;
    size_t unreported; /* work since the last report */
} txe_progress;

static txe_progress txe_progress_of(const txm_env *env) {
    txe_progress bar;
    memset(&bar, 0, sizeof bar);
    bar.env = env;
    return bar;
}

/* Begin a stage that ends at `to` of the whole. */
static void txe_stage(txe_progress *bar, const char *stage, double to, double total) {
    bar->from = bar->to;
    bar->to = to;
    bar->stage = stage;
    bar->total = total > 1 ? total : 1;
    bar->done = 0;
}

/* Add finished work; non-zero: the caller cancels. */
static inline int txe_advance(txe_progress *bar, size_t work) {
    bar->unreported += work;
    if (bar->unreported < TXE_REPORT) return 0;
    bar->done += (double)bar->unreported;
    bar->unreported = 0;
    const double part = bar->done < bar->total ? bar->done / bar->total : 1;
    return txm_progress(bar->env, txm_float(bar->from + (bar->to - bar->from) * part), bar->stage);
}

static txm_status txe_no_memory(txm_env *env) {
    return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the edges");
}

static txm_status txe_stopped(txm_env *env) {
    return txm_fail(env, TXM_CANCELLED, "cancelled");
}

/* ---- sets ------------------------------------------------------------------------------ */

/* An empty set, which lies in its own memory; NULL if there is no memory. */
static texedges_set *txe_set_make(int levels, int width, int height, const txm_env *env) {
    txm_arena memory;
    txm_arena_init(&memory, env);
    texedges_set *set = (texedges_set *)txm_arena_zero(&memory, 1, sizeof *set);
    if (!set) return NULL;
    set->levels = levels;
    set->width = width;
    set->height = height;
    set->memory = memory;
    return set;
}

TEXEDGES_API void texedges_set_free(texedges_set *set) {
    if (set) txm_arena_free(&set->memory);
}

/* ---- checks of what the caller gives --------------------------------------------------- */

/* Any picture of a valid size, or (bytes) one of TXM_U8 with 1 channel. */
static txm_status txe_check_image(const txm_image *image, const char *name, int bytes,
                                  txm_env *env) {
    const size_t most = TEXEDGES_MAX_PIXELS < TXE_MAX_PIXELS ? TEXEDGES_MAX_PIXELS : TXE_MAX_PIXELS;
    const txm_status status = txm_image_check(image, name, most, env);
    if (status != TXM_OK) return status;
    if (image->width > TXE_MAX_SIDE || image->height > TXE_MAX_SIDE)
        return txm_fail_at(env, TXM_TOO_LARGE, name, "a side is longer than 2^20 pixels");
    if (bytes && (image->sample != TXM_U8 || image->channels > 1))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name, "must be TXM_U8 with 1 channel");
    return TXM_OK;
}

static int txe_thresholds_are_good(const float *thresholds, int levels) {
    for (int k = 0; k < levels - 1; k++) {
        if (!(thresholds[k] >= 0 && thresholds[k] <= 1)) return 0;
        if (k > 0 && !(thresholds[k] > thresholds[k - 1])) return 0;
    }
    return 1;
}

static txm_status txe_check_desc(const texedges_desc *desc, txm_env *env) {
    if (!desc) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL");
    if (!(desc->smooth >= 0 && desc->smooth <= 16))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "smooth", "must be 0 to 16 pixels");
    if (desc->least < 0)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "least", "must be 0 or more pixels");
    return txe_check_image(&desc->image, "image", 0, env);
}

/* A set as one of the functions here makes it. is_found: as texedges_find does, with steps of one
   pixel from corner to corner. */
static txm_status txe_check_edges(const texedges_set *edges, const char *name, int is_found,
                                  txe_progress *bar, txm_env *env) {
    const char *foreign = "is not as texedges_find or texedges_disturb made it";
    if (!edges || edges->levels < 2 || edges->levels > TEXEDGES_MAX_LEVELS || edges->width < 1 ||
        edges->height < 1 || edges->width > TXE_MAX_SIDE || edges->height > TXE_MAX_SIDE ||
        !txe_thresholds_are_good(edges->thresholds, edges->levels) ||
        (edges->line_count && !edges->lines) || (edges->point_count && !edges->points))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name, foreign);
    for (int k = 0; k < edges->levels; k++) {
        if (edges->beside[k] < -1 || edges->beside[k] >= edges->levels || edges->beside[k] == k)
            return txm_fail_at(env, TXM_BAD_ARGUMENT, name, foreign);
    }
    for (size_t i = 0; i < edges->line_count; i++) {
        const texedges_polyline *line = &edges->lines[i];
        if (line->layer < 0 || line->layer >= edges->levels || line->count < 2 ||
            line->first > edges->point_count || line->count > edges->point_count - line->first)
            return txm_fail_at(env, TXM_BAD_ARGUMENT, name, foreign);
        txm_vec2 p = edges->points[line->first + line->count - 1];
        for (size_t j = 0; j < line->count; j++) {
            const txm_vec2 q = edges->points[line->first + j];
            const float most = (float)(2 * TXE_MAX_SIDE);
            int good = q.x >= -most && q.x <= most && q.y >= -most && q.y <= most;
            if (good && is_found) {
                const float dx = q.x - p.x, dy = q.y - p.y;
                good = q.x >= 0 && q.x <= (float)edges->width && q.y >= 0 &&
                       q.y <= (float)edges->height && dx * dx + dy * dy == 1 && dx * dy == 0 &&
                       q.x == (float)(int)q.x && q.y == (float)(int)q.y;
            }
            if (!good) return txm_fail_at(env, TXM_BAD_ARGUMENT, name, foreign);
            if (txe_advance(bar, 1)) return txe_stopped(env);
            p = q;
        }
    }
    return TXM_OK;
}

static txm_status txe_check_stroke(const texedges_stroke *s, int levels, double *length,
                                   txe_progress *bar, txm_env *env) {
    if (!s->points || s->count < (s->is_closed ? 3 : 2))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "stroke", "needs 2 points or more, closed 3");
    if (s->layer < 0 || s->layer >= levels)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "stroke", "layer must be 0 to levels - 1");
    if (s->width != 0 && !(s->width >= 2 && s->width <= 256))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "stroke", "width must be 0 or 2 to 256 pixels");
    const float most = (float)TXE_MAX_SIDE;
    double own = 0;
    for (int i = 0; i < s->count; i++) {
        const txm_vec2 p = s->points[i], q = s->points[i ? i - 1 : 0];
        const double dx = (double)p.x - q.x, dy = (double)p.y - q.y;
        if (!(p.x >= -most && p.x <= most && p.y >= -most && p.y <= most))
            return txm_fail_at(env, TXM_BAD_ARGUMENT, "stroke",
                               "a coordinate is not finite or beyond 2^20 pixels");
        own += sqrt(dx * dx + dy * dy);
        if (txe_advance(bar, 1)) return txe_stopped(env);
    }
    if (!(own > 1e-3))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "stroke",
                           "has no length: all its points are the same");
    *length += own;
    if (*length > (double)TXE_MAX_LENGTH)
        return txm_fail_at(env, TXM_TOO_LARGE, "strokes", "are longer than 2^26 pixels");
    return TXM_OK;
}

static double txe_points_of(const texedges_control *c) {
    return c && c->edges ? (double)c->edges->point_count : 0;
}

/* Everything that texedges_disturb and texedges_guide read. */
static txm_status txe_check_control(const texedges_control *c, txe_progress *bar, txm_env *env) {
    double length = 0;
    if (!c) return txm_fail(env, TXM_BAD_ARGUMENT, "control is NULL");
    if (c->stroke_count < 0 || (c->stroke_count && !c->strokes))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "strokes", "are NULL, or their count negative");
    if (!(c->disturb == -1 || (c->disturb >= 0 && c->disturb <= 4)))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "disturb", "must be -1 or 0 to 4");
    txm_status status = txe_check_edges(c->edges, "edges", 1, bar, env);
    if (status == TXM_OK && (c->background < -1 || c->background >= c->edges->levels))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "background", "must be -1 to levels - 1");
    for (int i = 0; i < c->stroke_count && status == TXM_OK; i++)
        status = txe_check_stroke(&c->strokes[i], c->edges->levels, &length, bar, env);
    return status;
}

/* ---- from a picture to layers ---------------------------------------------------------- */

/* The gray of each pixel, 0..1. 0 = cancelled, -1 = a sample is not finite, 1 = done. */
static int txe_gray(const txm_image *image, float *gray, txe_progress *bar) {
    const int is_color = image->channels >= 3;
    for (int y = 0; y < image->height; y++) {
        for (int x = 0; x < image->width; x++) {
            double g = txm_image_get(image, x, y, 0);
            if (is_color)
                g = 0.2126 * g + 0.7152 * txm_image_get(image, x, y, 1) +
                    0.0722 * txm_image_get(image, x, y, 2);
            if (!txm_is_finite(g)) return -1;
            *gray++ = txm_float(g < 0 ? 0 : g > 1 ? 1 : g);
            if (txe_advance(bar, 1)) return 0;
        }
    }
    return 1;
}

/* Blur with the weights 1 - |d| / (radius + 1), rows then columns; border pixels are repeated
   outwards. scratch: as large as gray. 0 = cancelled. */
static int txe_blur(float *gray, float *scratch, int width, int height, double radius,
                    txe_progress *bar) {
    const int reach = (int)radius;
    double weight[17] = {1}, sum = 0;
    for (int d = 0; d <= reach; d++) {
        weight[d] = 1 - d / (radius + 1);
        sum += d ? 2 * weight[d] : 1;
    }
    for (int pass = 0; pass < 2; pass++) {
        const float *from = pass ? scratch : gray;
        float *to = pass ? gray : scratch;
        const int last = (pass ? height : width) - 1;
        const size_t w = (size_t)width, step = pass ? w : 1;
        for (int y = 0; y < height; y++) {
            for (int x = 0; x < width; x++) {
                const int at = pass ? y : x;
                const size_t i = (size_t)y * w + (size_t)x;
                double g = from[i] * weight[0];
                for (int d = 1; d <= reach; d++) {
                    const int back = d < at ? d : at, ahead = d < last - at ? d : last - at;
                    g += weight[d] *
                         ((double)from[i - (size_t)back * step] + from[i + (size_t)ahead * step]);
                }
                to[i] = txm_float(g / sum);
                if (txe_advance(bar, (size_t)reach + 1)) return 0;
            }
        }
    }
    return 1;
}

/* Thresholds that divide count grays into layers of about the same area.

   In a histogram of 256 bins, cut k lies where k / levels of the area is darker, or within a
   quarter of a layer's area of that, where the two bins next to the cut hold least; in a gap, in
   its middle. If one bin holds too much for that, the cut is on its nearer side. 0 = cancelled. */
static int txe_choose_thresholds(const float *gray, size_t count, int levels, float *thresholds,
                                 txe_progress *bar) {
    size_t bins[256], below[257];
    int previous = 0;
    memset(bins, 0, sizeof bins);
    for (size_t i = 0; i < count; i++) {
        bins[(int)((double)gray[i] * 255 + 0.5)]++;
        if (txe_advance(bar, 1)) return 0;
    }
    below[0] = 0;
    for (int b = 0; b < 256; b++) below[b + 1] = below[b] + bins[b];
    for (int k = 1; k < levels; k++) { /* areas are multiplied by 4 levels, to stay whole */
        const uint64_t target = 4 * (uint64_t)k * count, quarter = count;
        const int most = 256 - (levels - k);
        int best = 0;
        uint64_t best_off = 0, best_held = 0;
        for (int cut = previous + 1; cut <= most; cut++) {
            const uint64_t area = 4 * (uint64_t)levels * below[cut];
            const uint64_t held = bins[cut - 1] + bins[cut];
            const uint64_t off = area > target ? area - target : target - area;
            const int is_near = off <= quarter, best_near = best && best_off <= quarter;
            int better = !best || off < best_off;
            if (is_near || best_near)
                better = is_near && (!best_near || held < best_held || (held == best_held && better));
            if (!better) continue;
            best = cut;
            best_off = off;
            best_held = held;
        }
        int end = best;
        while (end < most && below[end + 1] == below[best] &&
               bins[end] + bins[end + 1] == best_held)
            end++;
        previous = best + (end - best) / 2;
        thresholds[k - 1] = txm_float((previous - 0.5) / 255);
    }
    return 1;
}

/* Steps from a pixel to its neighbour across side 0 = top, 1 = right, 2 = bottom, 3 = left. The
   cracks around a pixel are followed clockwise, so that the pixel lies to the right: along the top
   to the right, and so on. */
static const int txe_step_x[4] = {0, 1, 0, -1}, txe_step_y[4] = {-1, 0, 1, 0};

/* Connected pixels of one layer are a region, in a union-find forest; one of its pixels is its
   root. next links the root and the boundary pixels in a ring; swapping one link of each joins two
   rings. */
typedef struct txe_regions {
    int width, height;
    int32_t *parent, *next;
    int32_t *length; /* of the root: cracks of the region's boundary */
    uint8_t *layer;  /* of the root: what the region shows now       */
} txe_regions;

static int32_t txe_root(const txe_regions *r, int32_t p) {
    while (r->parent[p] != p) p = r->parent[p] = r->parent[r->parent[p]];
    return p;
}

/* Unite the regions of two roots; returns the new root. */
static int32_t txe_unite(txe_regions *r, int32_t a, int32_t b) {
    if (b < a) return txe_unite(r, b, a);
    return r->parent[b] = a;
}

/* the pixel across a side of p, -1: none */
static int32_t txe_neighbour(const txe_regions *r, int32_t p, int side) {
    const int x = p % r->width + txe_step_x[side], y = p / r->width + txe_step_y[side];
    if (x < 0 || y < 0 || x >= r->width || y >= r->height) return -1;
    return p + txe_step_x[side] + txe_step_y[side] * r->width;
}

static int txe_regions_make(txe_regions *r, txe_progress *bar) {
    const int32_t count = (int32_t)r->width * r->height;
    for (int32_t p = 0; p < count; p++) {
        r->parent[p] = r->next[p] = p;
        r->length[p] = 0;
        int32_t root = p;
        for (int side = 3; side >= 0; side -= 3) { /* left and above */
            const int32_t q = txe_neighbour(r, p, side);
            if (q < 0 || r->layer[q] != r->layer[p]) continue;
            const int32_t other = txe_root(r, q);
            if (other != root) root = txe_unite(r, root, other);
        }
        if (txe_advance(bar, 2)) return 0;
    }
    for (int32_t p = 0; p < count; p++) {
        const int32_t root = txe_root(r, p);
        int cracks = 0;
        for (int side = 0; side < 4; side++) {
            const int32_t q = txe_neighbour(r, p, side);
            cracks += q < 0 || r->layer[q] != r->layer[p];
        }
        r->length[root] += cracks;
        if (cracks && p != root) {
            r->next[p] = r->next[root];
            r->next[root] = p;
        }
        if (txe_advance(bar, 2)) return 0;
    }
    return 1;
}

/* Give a region to the layer with which it shares most of its boundary (of equals the darkest) and
   unite it with all regions of that layer around it. Returns the new root, -1 if the region is the
   whole picture. Pixels that are no longer on a boundary are removed from the ring. */
static int32_t txe_dissolve(txe_regions *r, int32_t region, size_t *work) {
    int32_t shared[TEXEDGES_MAX_LEVELS];
    memset(shared, 0, sizeof shared);
    for (int32_t before = region, p = region;;) {
        int inner = 1;
        for (int side = 0; side < 4; side++) {
            const int32_t q = txe_neighbour(r, p, side);
            const int32_t other = q < 0 ? region : txe_root(r, q);
            if (other == region) continue;
            inner = 0;
            shared[r->layer[other]]++;
        }
        ++*work;
        if (inner && p != region) r->next[before] = r->next[p];
        else before = p;
        p = r->next[p];
        if (p == region) break;
    }
    int target = 0;
    for (int k = 1; k < TEXEDGES_MAX_LEVELS; k++) {
        if (shared[k] > shared[target]) target = k;
    }
    if (shared[target] == 0) return -1;
    int32_t root = region, length = r->length[region] - 2 * shared[target];
    for (int32_t p = region, after;; p = after) {
        after = r->next[p]; /* pixels that are linked in behind p are skipped */
        for (int side = 0; side < 4; side++) {
            const int32_t q = txe_neighbour(r, p, side);
            const int32_t other = q < 0 ? root : txe_root(r, q);
            if (other == root || r->layer[other] != target) continue;
            const int32_t link = r->next[p];
            r->next[p] = r->next[other];
            r->next[other] = link;
            length += r->length[other];
            root = txe_unite(r, root, other);
        }
        ++*work;
        if (after == region) break;
    }
    r->layer[root] = (uint8_t)target;
    r->length[root] = length;
    return root;
}

/* Dissolve regions until all have a boundary of at least `least` cracks: first those under 8, then
   under 16 and so on, each time in raster order of the roots. There are O(pixels / n) regions of n
   cracks, so all this takes O(pixels log least). 0 = cancelled. */
static int txe_regions_clean(txe_regions *r, int least, txe_progress *bar) {
    const int32_t count = (int32_t)r->width * r->height;
    for (int bound = 4; bound < least;) {
        bound = bound < least / 2 ? 2 * bound : least;
        for (int32_t p = 0; p < count; p++) {
            int32_t region = r->parent[p] == p ? p : -1;
            while (region >= 0 && r->length[region] < bound) {
                size_t work = 0;
                region = txe_dissolve(r, region, &work);
                if (txe_advance(bar, 8 * work)) return 0;
            }
            if (txe_advance(bar, 1)) return 0;
        }
    }
    for (int32_t p = 0; p < count; p++) {
        r->layer[p] = r->layer[txe_root(r, p)];
        if (txe_advance(bar, 1)) return 0;
    }
    return 1;
}

/* The layer of each pixel. is_given: thresholds holds levels - 1 of them, else it receives them.
   to: the progress of the call when this is done. */
static txm_status txe_layers_find(const texedges_desc *desc, int levels, int is_given,
                                  float *thresholds, uint8_t *layer, double to, txe_progress *bar,
                                  txm_arena *arena, txm_env *env) {
    const int width = desc->image.width, height = desc->image.height;
    const size_t count = (size_t)width * (size_t)height;
    const double smooth = desc->smooth;
    float *gray = (float *)txm_arena_alloc(arena, count, sizeof(float));
    float *scratch = smooth > 0 ? (float *)txm_arena_alloc(arena, count, sizeof(float)) : NULL;
    txm_image shown; /* hidden colours are those of visible neighbours */
    if (arena->failed) return txe_no_memory(env);
    const txm_status status = txm_image_bled(&desc->image, 0, arena, env, &shown);
    if (status != TXM_OK) return status;
    txe_stage(bar, "layers", desc->least > 4 ? to / 2 : to, (double)count * (4 + 2 * smooth));
    const int good = txe_gray(&shown, gray, bar);
    if (good < 0)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "image", "a sample is not finite");
    if (!good || (smooth > 0 && !txe_blur(gray, scratch, width, height, smooth, bar)) ||
        (!is_given && !txe_choose_thresholds(gray, count, levels, thresholds, bar)))
        return txe_stopped(env);
    for (size_t i = 0; i < count; i++) {
        int k = 0;
        while (k < levels - 1 && gray[i] >= thresholds[k]) k++;
        layer[i] = (uint8_t)k;
        if (txe_advance(bar, 1)) return txe_stopped(env);
    }
    txm_arena_free(arena);
    if (desc->least <= 4) return TXM_OK; /* no boundary is shorter */

    txe_regions r;
    r.width = width;
    r.height = height;
    r.layer = layer;
    r.parent = (int32_t *)txm_arena_alloc(arena, count, 3 * sizeof(int32_t));
    if (!r.parent) return txe_no_memory(env);
    r.next = r.parent + count;
    r.length = r.next + count;
    txe_stage(bar, "regions", to, (double)count * 12);
    if (!txe_regions_make(&r, bar) || !txe_regions_clean(&r, desc->least, bar))
        return txe_stopped(env);
    txm_arena_free(arena);
    return TXM_OK;
}

/* Replace the number of each pixel's layer by its gray. 0 = cancelled. */
static int txe_layers_to_gray(uint8_t *layer, size_t count, int levels, txe_progress *bar) {
    uint8_t gray[TEXEDGES_MAX_LEVELS] = {0};
    for (int k = 0; k < levels; k++)
        gray[k] = (uint8_t)((2 * 255 * k + levels - 1) / (2 * (levels - 1)));
    for (size_t i = 0; i < count; i++) {
        layer[i] = gray[layer[i]];
        if (txe_advance(bar, 1)) return 0;
    }
    return 1;
}

TEXEDGES_API txm_status texedges_layers(const texedges_desc *desc,
                                        const texedges_set *edges, txm_env *env,
                                        const txm_image *layers) {
    txe_progress bar = txe_progress_of(env);
    txm_status status = txe_check_desc(desc, env);
    if (status == TXM_OK) status = txe_check_image(layers, "layers", 1, env);
    if (status == TXM_OK &&
        (layers->width != desc->image.width || layers->height != desc->image.height))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "layers", "must have the size of the image");
    if (status == TXM_OK && (!edges || edges->levels < 2 || edges->levels > TEXEDGES_MAX_LEVELS ||
                             !txe_thresholds_are_good(edges->thresholds, edges->levels)))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "edges", "is not as texedges_find made it");
    if (status != TXM_OK) return status;

    float thresholds[TEXEDGES_MAX_LEVELS];
    txm_arena map, scratch;
    txm_arena_init(&map, env);
    txm_arena_init(&scratch, env);
    memcpy(thresholds, edges->thresholds, sizeof thresholds);
    const size_t width = (size_t)layers->width;
    uint8_t *layer = (uint8_t *)txm_arena_alloc(&map, width, (size_t)layers->height);
    const int levels = edges->levels;
    const size_t count = width * (size_t)layers->height;
    status = layer ? txe_layers_find(desc, levels, 1, thresholds, layer, 1, &bar, &scratch, env)
                   : txe_no_memory(env);
    if (status == TXM_OK && !txe_layers_to_gray(layer, count, levels, &bar))
        status = txe_stopped(env);
    for (int y = 0; y < layers->height && status == TXM_OK; y++)
        memcpy(txm_image_row(layers, y), layer + (size_t)y * width, width);
    txm_arena_free(&scratch);
    txm_arena_free(&map);
    return status;
}

/* ---- from layers to lines -------------------------------------------------------------- */

/* The map of layers while lines are traced: the lower four bits of a byte are the layer, the upper
   four the sides of the pixel whose cracks have not been followed yet. */
typedef struct txe_map {
    int width, height;
    uint8_t *at;
} txe_map;

/* is the pixel of this layer? */
static int txe_is_layer(const txe_map *m, int x, int y, int layer) {
    if (x < 0 || y < 0 || x >= m->width || y >= m->height) return 0;
    return (m->at[(size_t)y * (size_t)m->width + (size_t)x] & 15) == layer;
}

/* Mark all cracks and count them. shared: cracks between each two layers. 0 = cancelled. */
static int txe_mark_cracks(const txe_map *m, size_t *cracks, size_t (*shared)[TEXEDGES_MAX_LEVELS],
                           txe_progress *bar) {
    const int w = m->width;
    *cracks = 0;
    for (int y = 0; y < m->height; y++) {
        for (int x = 0; x < w; x++) {
            uint8_t *at = m->at + (size_t)y * (size_t)w + (size_t)x;
            const int layer = *at & 15;
            for (int side = 0; side < 4; side++) {
                const int u = x + txe_step_x[side], v = y + txe_step_y[side];
                if (txe_is_layer(m, u, v, layer)) continue;
                *at = (uint8_t)(*at | 16 << side);
                ++*cracks;
                if (u >= 0 && v >= 0 && u < w && v < m->height)
                    shared[layer][m->at[(size_t)v * (size_t)w + (size_t)u] & 15]++;
            }
            if (txe_advance(bar, 4)) return 0;
        }
    }
    return 1;
}

/* Follow the cracks of one line, from side `side` of pixel (x, y), and unmark them.

           l | a      p: the pixel to the right of the line (here upwards, along its left side)
             ^        a: the next pixel on the right side, l: the one across from a
           - | p      a is of another layer: turn right, around p, whatever l is;
                      a and l are both of p's layer: turn left;
                      only a is of p's layer: straight on

   Each crack has one successor and one predecessor, so the line returns to its start.
   points  receives the corners, or NULL; returns their number; 0 = cancelled
   area    receives the area to the right, negative if the line is a hole's                   */
static size_t txe_trace(const txe_map *m, int x, int y, int side, txm_vec2 *points,
                        int64_t *area, txe_progress *bar) {
    const int x0 = x, y0 = y, side0 = side, w = m->width;
    const int layer = m->at[(size_t)y * (size_t)w + (size_t)x] & 15;
    size_t count = 0;
    *area = 0;
    do {
        uint8_t *at = m->at + (size_t)y * (size_t)w + (size_t)x;
        *at = (uint8_t)(*at & ~(16 << side));
        if (points)
            points[count] = txm_v2((float)(x + (side == 1 || side == 2)), (float)(y + (side >= 2)));
        count++;
        if (side == 1) *area += x + 1; /* integral of x dy */
        if (side == 3) *area -= x;
        const int ahead = (side + 1) & 3; /* the side between p and a */
        const int ax = x + txe_step_x[ahead], ay = y + txe_step_y[ahead];
        if (!txe_is_layer(m, ax, ay, layer)) {
            side = ahead;
        } else {
            x = ax;
            y = ay;
            const int lx = ax + txe_step_x[side], ly = ay + txe_step_y[side];
            if (txe_is_layer(m, lx, ly, layer)) {
                x = lx;
                y = ly;
                side = (side + 3) & 3;
            }
        }
        if (txe_advance(bar, 4)) return 0;
    } while (x != x0 || y != y0 || side != side0);
    return count;
}

/* All lines in raster order of their first points: traced once to count them, once to keep them. */
static txm_status txe_trace_all(const txe_map *m, txe_progress *bar, texedges_set *e,
                                txm_env *env) {
    size_t shared[TEXEDGES_MAX_LEVELS][TEXEDGES_MAX_LEVELS], cracks;
    for (int pass = 0; pass < 2; pass++) {
        size_t lines = 0, points = 0;
        memset(shared, 0, sizeof shared);
        if (!txe_mark_cracks(m, &cracks, shared, bar)) return txe_stopped(env);
        if (pass == 1) {
            e->lines =
                (texedges_polyline *)txm_arena_alloc(&e->memory, e->line_count, sizeof *e->lines);
            e->points = (txm_vec2 *)txm_arena_alloc(&e->memory, cracks, sizeof *e->points);
            if (e->memory.failed) return txe_no_memory(env);
        }
        for (int y = 0; y < m->height; y++) {
            for (int x = 0; x < m->width; x++) {
                const uint8_t *at = m->at + (size_t)y * (size_t)m->width + (size_t)x;
                for (int side = 0; side < 4; side++) {
                    if (!(*at & 16 << side)) continue;
                    int64_t area;
                    const size_t count =
                        txe_trace(m, x, y, side, pass ? e->points + points : NULL, &area, bar);
                    if (!count) return txe_stopped(env);
                    if (pass) {
                        e->lines[lines].layer = *at & 15;
                        e->lines[lines].is_hole = area < 0;
                        e->lines[lines].first = points;
                        e->lines[lines].count = count;
                    }
                    points += count;
                    lines++;
                }
                if (txe_advance(bar, 1)) return txe_stopped(env);
            }
        }
        e->line_count = lines;
        e->point_count = points;
    }
    for (int k = 0; k < e->levels; k++) {
        int best = -1;
        for (int j = 0; j < e->levels; j++) {
            if (shared[k][j] > (best < 0 ? 0 : shared[k][best])) best = j;
        }
        e->beside[k] = best;
    }
    return TXM_OK;
}

static txm_status txe_find(const texedges_desc *desc, txe_progress *bar, txm_arena *layers,
                           txm_arena *scratch, texedges_set *e, txm_env *env) {
    txe_map map;
    const size_t count = (size_t)e->width * (size_t)e->height;
    map.width = e->width;
    map.height = e->height;
    for (int k = 0; k < e->levels - 1 && desc->thresholds; k++)
        e->thresholds[k] = desc->thresholds[k];
    map.at = (uint8_t *)txm_arena_alloc(layers, count, 1);
    if (!map.at) return txe_no_memory(env);
    const txm_status status = txe_layers_find(desc, e->levels, desc->thresholds != NULL,
                                              e->thresholds, map.at, 0.7, bar, scratch, env);
    if (status != TXM_OK) return status;
    txe_stage(bar, "lines", 1, (double)count * 14);
    return txe_trace_all(&map, bar, e, env);
}

TEXEDGES_API txm_status texedges_find(const texedges_desc *desc, txm_env *env, texedges_set **out) {
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    txm_status status = txe_check_desc(desc, env);
    if (status != TXM_OK) return status;
    if (desc->levels && (desc->levels < 2 || desc->levels > TEXEDGES_MAX_LEVELS))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "levels",
                           "must be 0 or 2 to TEXEDGES_MAX_LEVELS");
    const int levels = desc->levels ? desc->levels : 4;
    if (desc->thresholds && !txe_thresholds_are_good(desc->thresholds, levels))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "thresholds", "must rise and lie within 0 to 1");

    txm_arena layers, scratch;
    txe_progress bar = txe_progress_of(env);
    texedges_set *set = txe_set_make(levels, desc->image.width, desc->image.height, env);
    if (!set) return txe_no_memory(env);
    txm_arena_init(&layers, env);
    txm_arena_init(&scratch, env);
    status = txe_find(desc, &bar, &layers, &scratch, set, env);
    txm_arena_free(&scratch);
    txm_arena_free(&layers);
    if (status == TXM_OK) *out = set;
    else texedges_set_free(set);
    return status;
}

/* Mark the pixels along a line with layer + 1: those under points half a pixel to its right, two
   points a pixel. 0 = cancelled. */
static int txe_draw_line(const texedges_set *e, const texedges_polyline *line, uint8_t *marks,
                         int width, int height, txe_progress *bar) {
    const txm_vec2 *points = e->points + line->first;
    for (size_t j = 0; j < line->count; j++) {
        const txm_vec2 p = points[j], q = points[j + 1 < line->count ? j + 1 : 0];
        const double dx = (double)q.x - p.x, dy = (double)q.y - p.y;
        const double length = sqrt(dx * dx + dy * dy);
        const int steps = 2 * (int)length + 1;
        if (txe_advance(bar, 1)) return 0;
        for (int i = 0; i < steps && length > 0; i++) {
            const double t = (i + 0.5) / steps;
            const double x = p.x + t * dx - 0.5 * dy / length, y = p.y + t * dy + 0.5 * dx / length;
            if (x >= 0 && y >= 0 && x < width && y < height)
                marks[(size_t)y * (size_t)width + (size_t)x] = (uint8_t)(line->layer + 1);
            if (txe_advance(bar, 2)) return 0;
        }
    }
    return 1;
}

/* The colour of a layer, on a ramp from black over purple, red and yellow to white; the darkest
   layer is not quite black. One channel: gray. */
static uint8_t txe_color(int layer, int levels, int channels, int channel) {
    static const int ramp[5][3] = {
        {0, 0, 0}, {112, 0, 144}, {224, 48, 48}, {240, 192, 32}, {255, 255, 255}};
    const int t = 1024 * (layer + 1) / levels; /* 0..1024: four spans of 256 */
    if (channels == 1) return (uint8_t)((255 * (layer + 1) + levels / 2) / levels);
    const int span = t < 1024 ? t / 256 : 3, rest = t - 256 * span;
    return (uint8_t)((ramp[span][channel] * (256 - rest) + ramp[span + 1][channel] * rest) / 256);
}

TEXEDGES_API txm_status texedges_draw(const texedges_set *edges, int layer, txm_env *env,
                                      const txm_image *image) {
    txe_progress bar = txe_progress_of(env);
    txe_stage(&bar, "edges", 0.5, edges ? (double)edges->point_count : 0);
    txm_status status = txe_check_image(image, "image", 0, env);
    if (status != TXM_OK) return status;
    const int channels = image->channels ? image->channels : 1;
    if (image->sample != TXM_U8 || (channels != 1 && channels != 3))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "image", "must be TXM_U8 with 1 or 3 channels");
    status = txe_check_edges(edges, "edges", 0, &bar, env);
    if (status != TXM_OK) return status;
    if (layer < -1 || layer >= edges->levels)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "layer", "must be -1 to levels - 1");

    const int width = image->width, height = image->height;
    txm_arena arena;
    txm_arena_init(&arena, env);
    uint8_t *marks = (uint8_t *)txm_arena_zero(&arena, (size_t)width, (size_t)height);
    if (!marks) return txe_no_memory(env);
    txe_stage(&bar, "edges", 1, 7 * (double)edges->point_count);
    for (size_t i = 0; i < edges->line_count && status == TXM_OK; i++) {
        const texedges_polyline *line = &edges->lines[i];
        if (layer >= 0 && line->layer != layer) continue;
        if (!txe_draw_line(edges, line, marks, width, height, &bar)) status = txe_stopped(env);
    }
    for (int y = 0; y < height && status == TXM_OK; y++) {
        uint8_t *row = (uint8_t *)txm_image_row(image, y);
        for (int x = 0; x < width; x++) {
            const int mark = marks[(size_t)y * (size_t)width + (size_t)x];
            for (int c = 0; c < channels && mark; c++)
                row[x * channels + c] = txe_color(mark - 1, edges->levels, channels, c);
        }
    }
    txm_arena_free(&arena);
    return status;
}

/* ---- lines as arrays of points --------------------------------------------------------- */

typedef struct txe_point {
    double x, y;
} txe_point;

static txe_point txe_between(txe_point a, txe_point b, double t) {
    txe_point p;
    p.x = a.x + (b.x - a.x) * t;
    p.y = a.y + (b.y - a.y) * t;
    return p;
}

static double txe_distance(txe_point a, txe_point b) {
    const double dx = b.x - a.x, dy = b.y - a.y;
    return sqrt(dx * dx + dy * dy);
}

/* Length of the line through n points; closed: back to the first. Negative: cancelled. */
static double txe_length(const txe_point *p, size_t n, int is_closed, txe_progress *bar) {
    double sum = 0;
    for (size_t i = 1; i < n + (is_closed != 0); i++) {
        sum += txe_distance(p[i - 1], p[i < n ? i : 0]);
        if (txe_advance(bar, 1)) return -1;
    }
    return sum;
}

/* m points at equal distances along a line of n points and this length: closed from the first point
   on, open from the first to the last. 0 = cancelled. */
static int txe_resample(const txe_point *p, size_t n, int is_closed, double length,
                        txe_point *out, size_t m, txe_progress *bar) {
    const size_t segments = is_closed ? n : n - 1;
    const double step = length / (double)(is_closed ? m : m - 1);
    size_t i = 0;
    double from = 0, span = txe_distance(p[0], p[1]); /* of segment i */
    for (size_t k = 0; k < m; k++) {
        const double at = step * (double)k;
        while (at > from + span && i + 1 < segments) {
            from += span;
            i++;
            span = txe_distance(p[i], p[i + 1 < n ? i + 1 : 0]);
            if (txe_advance(bar, 1)) return 0;
        }
        const double t = span > 0 ? (at - from) / span : 0;
        out[k] = txe_between(p[i], p[i + 1 < n ? i + 1 : 0], t < 1 ? t : 1);
        if (txe_advance(bar, 1)) return 0;
    }
    return 1;
}

/* Blur a line with the weights radius + 1 - |d|, whole numbers. Closed: cyclically (n > radius);
   open: the radius shrinks towards the ends, which stay where they are. 0 = cancelled. */
static int txe_soften(const txe_point *p, size_t n, int is_closed, size_t radius,
                      txe_point *out, txe_progress *bar) {
    for (size_t i = 0; i < n; i++) {
        size_t reach = radius;
        if (!is_closed && reach > i) reach = i;
        if (!is_closed && reach > n - 1 - i) reach = n - 1 - i;
        double x = 0, y = 0;
        for (size_t d = 1; d <= reach; d++) {
            const txe_point a = p[i >= d ? i - d : i + n - d];
            const txe_point b = p[i + d < n ? i + d : i + d - n];
            const double weight = (double)(reach + 1 - d);
            x += weight * (a.x + b.x);
            y += weight * (a.y + b.y);
        }
        const double weight = (double)(reach + 1), sum = weight * weight;
        out[i].x = (x + weight * p[i].x) / sum;
        out[i].y = (y + weight * p[i].y) / sum;
        if (txe_advance(bar, reach + 1)) return 0;
    }
    return 1;
}

/* The unit vector from a to b; unchanged if they are the same point. */
static void txe_direction(txe_point a, txe_point b, txe_point *direction) {
    const double length = txe_distance(a, b);
    if (!(length > 1e-9)) return;
    direction->x = (b.x - a.x) / length;
    direction->y = (b.y - a.y) / length;
}

/* ---- the roughness of the exemplar's edges --------------------------------------------- */

/* One sample of a line of the exemplar, one pixel of length before the next: how far its smooth
   course advances to the next sample, and the offset of the line from the course, ahead and to the
   right. */
typedef struct txe_sample {
    double step, ahead, right;
    double length; /* of the line to the next sample, its offsets limited                      */
    int bin;       /* direction of the line relative to its course                             */
} txe_sample;

/* The roughness of one layer: the samples of all its lines, and the indices at which a piece of
   TXE_PIECE + TXE_JOIN samples can begin. */
typedef struct txe_roughness {
    txe_sample *samples;
    size_t *starts;
    size_t count, start_count, most; /* filled, and room for                                    */
    double amount;          /* factor of the exemplar's roughness                               */
    double step;            /* mean of all steps                                                */
    double share[TXE_BINS]; /* histogram of the directions of the exemplar's edges, sum 1       */
} txe_roughness;

/* Scratch for one line of up to count points. */
typedef struct txe_scratch {
    txe_point *a, *b, *c;
} txe_scratch;

static void txe_scratch_make(txe_scratch *scratch, txm_arena *arena, size_t count) {
    scratch->a = (txe_point *)txm_arena_alloc(arena, count, sizeof *scratch->a);
    scratch->b = (txe_point *)txm_arena_alloc(arena, count, sizeof *scratch->b);
    scratch->c = (txe_point *)txm_arena_alloc(arena, count, sizeof *scratch->c);
}

/* The factor that limits an offset of this length to TXE_MAX_OFFSET: 1 up to TXE_KEPT_OFFSET, then
   soft compression. */
static double txe_limit(double length) {
    const double room = TXE_MAX_OFFSET - TXE_KEPT_OFFSET, more = length - TXE_KEPT_OFFSET;
    return more > 0 ? (TXE_KEPT_OFFSET + room * more / (more + room)) / length : 1;
}

/* The direction of (ahead, right) or its opposite: 0 = straight on, then in steps of 1/16 of half a
   turn to the right. The table: cosine and sine of 1/2, 3/2, ... of such a step. */
static int txe_bin(double ahead, double right) {
    static const double edge[TXE_BINS / 2][2] = {
        {0.99518473, 0.09801714}, {0.95694034, 0.29028468}, {0.88192126, 0.47139674},
        {0.77301045, 0.63439328}, {0.63439328, 0.77301045}, {0.47139674, 0.88192126},
        {0.29028468, 0.95694034}, {0.09801714, 0.99518473}};
    const double x = ahead < 0 ? -ahead : ahead, y = right < 0 ? -right : right;
    int k = 0;
    while (k < TXE_BINS / 2 && y * edge[k][0] > x * edge[k][1]) k++;
    return (ahead < 0) != (right < 0) ? (TXE_BINS - k) % TXE_BINS : k % TXE_BINS;
}

/* The directions of a line of n points in scratch->b relative to its course, its blur of radius
   TXE_DIRECTION_BLUR; a blur of `radius` removes the steps of pixels first. Added to share, as if
   the line had `amount` times its roughness, or stored in the samples of its points.
   0 = cancelled. */
static int txe_directions(const txe_scratch *scratch, size_t n, int is_closed, size_t radius,
                          double amount, double *share, txe_sample *samples, txe_progress *bar) {
    const txe_point *line = scratch->a, *course = scratch->c;
    const size_t trim = is_closed || !share ? 0 : TXE_DIRECTION_BLUR; /* ends have no course */
    if (!txe_soften(scratch->b, n, is_closed, radius, scratch->a, bar) ||
        !txe_soften(scratch->b, n, is_closed, TXE_DIRECTION_BLUR, scratch->c, bar))
        return 0;
    for (size_t i = trim; i < n - trim; i++) {
        size_t at[4]; /* the course from at[0] to at[3], the line from at[1] to at[2] */
        for (int k = 0; k < 4; k++) {
            const size_t off = k == 0 || k == 3 ? TXE_CHORD : 1;
            if (k < 2) at[k] = i >= off ? i - off : is_closed ? i + n - off : 0;
            else at[k] = i + off < n ? i + off : is_closed ? i + off - n : n - 1;
        }
        const double cx = course[at[3]].x - course[at[0]].x, cy = course[at[3]].y - course[at[0]].y;
        const double dx = line[at[2]].x - line[at[1]].x, dy = line[at[2]].y - line[at[1]].y;
        const int bin = txe_bin(cx * dx + cy * dy, amount * (cx * dy - cy * dx));
        if (share) share[bin] += 1;
        if (samples) {
            samples[i].bin = bin;
            samples[i].length = txe_distance(line[i], line[at[2]]);
        }
        if (txe_advance(bar, 4)) return 0;
    }
    return 1;
}

/* Add the samples of one line: n points in scratch->a, a pixel apart at most. With S the blur of
   radius TXE_COURSE_BLUR, the smooth course of the line P is 2 S P - S S P, which keeps curves that
   S alone would shrink. The ends of open lines, which have no course, are left out.
   0 = cancelled. */
static int txe_measure_run(txe_roughness *u, const txe_scratch *scratch, size_t n, int is_closed,
                           txe_progress *bar) {
    txe_point *line = scratch->b, *blurred = scratch->a, *course = scratch->c;
    if (n < TXE_MIN_LINE) return 1;
    const double length = txe_length(scratch->a, n, is_closed, bar);
    if (length < 0) return 0;
    const size_t m = (size_t)(length + 0.5) + !is_closed; /* at most n */
    const size_t trim = is_closed ? 0 : TXE_COURSE_BLUR;
    if (m < TXE_MIN_LINE + 2 * trim) return 1;
    if (!txe_resample(scratch->a, n, is_closed, length, line, m, bar) ||
        !txe_soften(line, m, is_closed, TXE_COURSE_BLUR, blurred, bar) ||
        !txe_soften(blurred, m, is_closed, TXE_COURSE_BLUR, course, bar))
        return 0;
    for (size_t i = 0; i < m; i++) {
        course[i].x = 2 * blurred[i].x - course[i].x;
        course[i].y = 2 * blurred[i].y - course[i].y;
    }
    /* a closed line is repeated beyond its end, so that pieces can begin anywhere */
    const size_t room = TXE_PIECE + TXE_JOIN, end = is_closed ? m + room : m - trim;
    txe_sample *first = u->samples + u->count;
    txe_point direction;
    direction.x = 1;
    direction.y = 0;
    for (size_t i = trim; i < end; i++) {
        const size_t at = i % m, back = (i + m - TXE_CHORD) % m, front = (i + TXE_CHORD) % m;
        const double dx = line[at].x - course[at].x, dy = line[at].y - course[at].y;
        TXM_ASSERT(u->count < u->most);
        txe_sample *s = &u->samples[u->count];
        txe_direction(course[back], course[front], &direction);
        s->step = txe_distance(course[at], course[(i + 1) % m]);
        s->ahead = u->amount * (dx * direction.x + dy * direction.y);
        s->right = u->amount * (dy * direction.x - dx * direction.y);
        if (i + room <= end) {
            u->starts[u->start_count++] = u->count;
            u->step += s->step;
        }
        u->count++;
        if (txe_advance(bar, 4)) return 0;
    }
    if (!txe_directions(scratch, m, is_closed, TXE_STEP_BLUR, u->amount, u->share, NULL, bar))
        return 0;
    /* Limit the offsets and take the directions once more, along a straight course, smoothed a
       little more than the exemplar's: a line that is drawn in pixels loses some of its roughness,
       and in the end as much shall be visible as in the exemplar. */
    double x = 0;
    const size_t count = end - trim;
    for (size_t i = 0; i < count; i++) {
        txe_sample *s = first + i;
        const double factor = txe_limit(sqrt(s->ahead * s->ahead + s->right * s->right));
        s->ahead *= factor;
        s->right *= factor;
        line[i].x = x + s->ahead;
        line[i].y = s->right;
        x += s->step;
        if (txe_advance(bar, 2)) return 0;
    }
    return txe_directions(scratch, count, 0, TXE_STEP_BLUR + 1, 1, NULL, first, bar);
}

/* does the crack from p to q run along the picture's border? */
static int txe_on_border(const texedges_set *e, txm_vec2 p, txm_vec2 q) {
    return (p.x == q.x && (p.x == 0 || p.x == (float)e->width)) ||
           (p.y == q.y && (p.y == 0 || p.y == (float)e->height));
}

/* Add the parts of a line that do not run along the picture's border. 0 = cancelled. */
static int txe_measure_line(txe_roughness *u, const txe_scratch *scratch, const texedges_set *e,
                            const texedges_polyline *line, txe_progress *bar) {
    const txm_vec2 *p = e->points + line->first;
    size_t start = line->count, n = 0;
    for (size_t j = 0; j < line->count && start == line->count; j++) { /* first on the border */
        if (txe_on_border(e, p[j], p[j + 1 < line->count ? j + 1 : 0])) start = j;
        if (txe_advance(bar, 1)) return 0;
    }
    const int is_closed = start == line->count;
    for (size_t k = 0; k < line->count; k++) {
        const size_t j = (start + k) % line->count, next = (j + 1) % line->count;
        if (txe_on_border(e, p[j], p[next])) {
            if (!txe_measure_run(u, scratch, n, 0, bar)) return 0;
            n = 0;
        } else { /* middles of cracks: a slope of 1 is a straight line */
            scratch->a[n].x = 0.5 * ((double)p[j].x + p[next].x);
            scratch->a[n].y = 0.5 * ((double)p[j].y + p[next].y);
            n++;
        }
        if (txe_advance(bar, 1)) return 0;
    }
    return txe_measure_run(u, scratch, n, is_closed, bar);
}

/* The roughness of a layer, amount times that of the exemplar, in memory of the arena. */
static txm_status txe_measure_layer(txe_roughness *u, const texedges_set *e, int layer,
                                    double amount, txm_arena *arena, txe_progress *bar,
                                    txm_env *env) {
    const size_t room = TXE_PIECE + TXE_JOIN;
    txe_scratch scratch;
    size_t most = 0, longest = 0;
    double sum = 0;
    memset(u, 0, sizeof *u);
    u->amount = amount;
    for (size_t i = 0; i < e->line_count; i++) {
        const texedges_polyline *line = &e->lines[i];
        if (line->layer != layer || line->count < TXE_MIN_LINE) continue;
        most += line->count + room;
        if (line->count > longest) longest = line->count;
    }
    if (most == 0) return TXM_OK;
    u->most = most; /* m samples of n points of a line, m at most n + 1; closed ones go on for room */
    u->samples = (txe_sample *)txm_arena_alloc(arena, most, sizeof *u->samples);
    u->starts = (size_t *)txm_arena_alloc(arena, most, sizeof *u->starts);
    txe_scratch_make(&scratch, arena, longest + room);
    if (arena->failed) return txe_no_memory(env);
    for (size_t i = 0; i < e->line_count; i++) {
        const texedges_polyline *line = &e->lines[i];
        if (line->layer != layer || line->count < TXE_MIN_LINE) continue;
        if (!txe_measure_line(u, &scratch, e, line, bar)) return txe_stopped(env);
    }
    for (int b = 0; b < TXE_BINS; b++) sum += u->share[b];
    for (int b = 0; b < TXE_BINS && sum > 0; b++) u->share[b] /= sum;
    if (u->start_count) u->step /= (double)u->start_count;
    if (u->step < 0.125) u->step = 0.125; /* of lines that turn on the spot */
    return TXM_OK;
}

/* ---- new roughness from pieces --------------------------------------------------------- */

/* The squared distance of two runs of TXE_JOIN samples: it compares offsets and slopes. */
static double txe_mismatch(const txe_sample *a, const txe_sample *b) {
    double sum = 0;
    for (int j = 0; j < TXE_JOIN; j++) {
        const double ahead = a[j].ahead - b[j].ahead, right = a[j].right - b[j].right;
        sum += ahead * ahead + right * right;
    }
    return sum;
}

/* Make a piece begin where the tail of the last one is: the difference of their first samples is
   removed gradually over TXE_JOIN samples. A cross-fade would smooth both. */
static void txe_join(const txe_sample *tail, txe_sample *piece) {
    const double ahead = tail->ahead - piece->ahead, right = tail->right - piece->right;
    for (int j = 0; j < TXE_JOIN; j++) {
        const double part = 1 - j / (double)TXE_JOIN;
        piece[j].ahead += ahead * part;
        piece[j].right += right * part;
    }
}

/* The pieces chosen so far, as far as the choice of the next one depends on them. */
typedef struct txe_chain {
    const txe_sample *tail; /* how the last piece continues in the exemplar; NULL: there is none */
    double length;          /* of the line so far                                                */
    double bins[TXE_BINS];  /* the same by direction                                             */
} txe_chain;

/* How far the histogram of directions would be from the exemplar's with this piece. */
static double txe_direction_error(const txe_chain *chain, const double *share,
                                  const txe_sample *piece, size_t length) {
    double bins[TXE_BINS], total = chain->length, sum = 0;
    memcpy(bins, chain->bins, sizeof bins);
    for (size_t j = 0; j < length; j++) {
        bins[piece[j].bin] += piece[j].length;
        total += piece[j].length;
    }
    for (int b = 0; b < TXE_BINS; b++) {
        const double off = bins[b] - share[b] * total;
        sum += off * off / (share[b] + 0.01);
    }
    return sum;
}

/* Choose a piece of this length. Of random candidates those with the best joints stay: to the tail,
   and if the piece closes the line to head (NULL: to its own beginning). Of these the one is taken
   that brings the histogram of directions nearest to the exemplar's. */
static const txe_sample *txe_choose_piece(const txe_roughness *u, txm_rng *rng,
                                          const txe_chain *chain, size_t length, int closes,
                                          const txe_sample *head) {
    const txe_sample *good[TXE_BEST + 1] = {NULL}, *best;
    double gaps[TXE_BEST + 1] = {0}, least;
    int count = 0;
    for (int i = 0; i < TXE_TRIES * (closes ? 4 : 1); i++) {
        const size_t pick = (size_t)(txm_rng_double(rng) * (double)u->start_count);
        const txe_sample *piece = u->samples + u->starts[pick];
        double gap = chain->tail ? txe_mismatch(chain->tail, piece) : 0;
        if (closes) gap += txe_mismatch(piece + length, head ? head : piece);
        int at = count;
        for (; at > 0 && gap < gaps[at - 1]; at--) {
            gaps[at] = gaps[at - 1];
            good[at] = good[at - 1];
        }
        gaps[at] = gap;
        good[at] = piece;
        if (count < TXE_BEST) count++;
    }
    best = good[0];
    least = closes ? 0 : txe_direction_error(chain, u->share, best, length);
    for (int i = 1; i < count && !closes; i++) {
        const double off = txe_direction_error(chain, u->share, good[i], length);
        if (off >= least) continue;
        best = good[i];
        least = off;
    }
    return best;
}

/* Join pieces to a closed line of m samples, m >= TXE_PIECE / 3. 0 = cancelled. */
static int txe_chain_pieces(const txe_roughness *u, txm_rng *rng, txe_sample *samples, size_t m,
                            txe_progress *bar) {
    const size_t shortest = TXE_PIECE / 3;
    txe_chain chain;
    memset(&chain, 0, sizeof chain);
    for (size_t k = 0; k < m;) {
        const size_t rest = m - k;
        size_t length = rest;
        if (rest > TXE_PIECE)
            length = shortest + txm_rng_below(rng, TXE_PIECE - (uint32_t)shortest + 1);
        if (length < rest && rest - length < shortest) length = rest - shortest;
        const txe_sample *piece =
            txe_choose_piece(u, rng, &chain, length, length == rest, k ? samples : NULL);
        memcpy(samples + k, piece, length * sizeof *samples);
        if (chain.tail) txe_join(chain.tail, samples + k);
        for (size_t j = 0; j < length; j++) {
            chain.bins[piece[j].bin] += piece[j].length;
            chain.length += piece[j].length;
        }
        chain.tail = piece + length;
        k += length;
        if (txe_advance(bar, 64 * TXE_TRIES)) return 0;
    }
    txe_join(chain.tail, samples);
    return 1;
}

/* ---- disturbed strokes ----------------------------------------------------------------- */

/* Points of the outline of a stroke; with points NULL they are only counted. */
typedef struct txe_outline {
    txe_point *points;
    size_t count;
} txe_outline;

static void txe_outline_add(txe_outline *o, double x, double y) {
    if (o->points) {
        o->points[o->count].x = x;
        o->points[o->count].y = y;
    }
    o->count++;
}

/* One side of a band around n points, to the left of the line (back: of the reversed line), and the
   round cap at its end. Where the line turns away the gap is filled in steps of about a pixel. */
static int txe_band_side(const txe_point *p, size_t n, int back, double half, txe_outline *o,
                         txe_progress *bar) {
    txe_point d, before;
    d.x = 1;
    d.y = 0;
    for (size_t i = 1; i < n; i++) { /* the first direction there is */
        const size_t at = back ? n - i : i - 1, next = back ? at - 1 : at + 1;
        if (txe_distance(p[at], p[next]) > 1e-9) {
            txe_direction(p[at], p[next], &d);
            break;
        }
    }
    for (size_t i = 0; i < n; i++) {
        const size_t at = back ? n - 1 - i : i;
        const size_t low = at > 2 ? at - 2 : 0, high = at + 2 < n ? at + 2 : n - 1;
        before = d;
        txe_direction(p[back ? high : low], p[back ? low : high], &d);
        const int turns = i ? (int)(half * txe_distance(before, d)) : 0;
        for (int k = 1; k <= turns; k++) {
            txe_point mid, zero;
            zero.x = zero.y = 0;
            mid = before;
            txe_direction(zero, txe_between(before, d, (double)k / (turns + 1)), &mid);
            txe_outline_add(o, p[at].x + half * mid.y, p[at].y - half * mid.x);
        }
        txe_outline_add(o, p[at].x + half * d.y, p[at].y - half * d.x);
        if (txe_advance(bar, (size_t)turns + 1)) return 0;
    }
    /* a half circle of two quarters ((1 - t^2) u + 2 t v) / (1 + t^2): left, ahead, right */
    const txe_point end = p[back ? 0 : n - 1];
    const int steps = (int)(1.6 * half) + 1;
    for (int k = 1; k < 2 * steps; k++) {
        const double t = (double)(k < steps ? k : k - steps) / steps;
        const double c = half * (1 - t * t) / (1 + t * t), s = half * 2 * t / (1 + t * t);
        const double left = k < steps ? c : -s, ahead = k < steps ? s : c;
        txe_outline_add(o, end.x + left * d.y + ahead * d.x, end.y - left * d.x + ahead * d.y);
    }
    return !txe_advance(bar, 4 * (size_t)steps);
}

/* The outline of a stroke as a closed line with its inside to the right: of a closed stroke its
   points in that order; of an open one both sides of its band. */
static txm_status txe_outline_make(const texedges_stroke *s, txe_outline *o, txm_arena *arena,
                                   txe_progress *bar, txm_env *env) {
    const size_t n = (size_t)s->count;
    txe_point *given = (txe_point *)txm_arena_alloc(arena, n, sizeof *given);
    double area = 0;
    if (!given) return txe_no_memory(env);
    for (size_t i = 0; i < n; i++) {
        const txm_vec2 p = s->points[i], q = s->points[i + 1 < n ? i + 1 : 0], p0 = s->points[0];
        given[i].x = p.x;
        given[i].y = p.y;
        area += ((double)p.x - p0.x) * ((double)q.y - p0.y) -
                ((double)q.x - p0.x) * ((double)p.y - p0.y);
        if (txe_advance(bar, 1)) return txe_stopped(env);
    }
    if (s->is_closed) {
        for (size_t i = 0, j = n - 1; i < j && area < 0; i++, j--) {
            const txe_point p = given[i];
            given[i] = given[j];
            given[j] = p;
        }
        o->points = given;
        o->count = n;
        return TXM_OK;
    }
    const double length = txe_length(given, n, 0, bar);
    if (length < 0) return txe_stopped(env);
    const size_t m = (size_t)length + 2;
    txe_point *even = (txe_point *)txm_arena_alloc(arena, 2 * m, sizeof *even);
    if (!even) return txe_no_memory(env);
    if (!txe_resample(given, n, 0, length, even, m, bar) ||
        !txe_soften(even, m, 0, TXE_CORNER_BLUR, even + m, bar))
        return txe_stopped(env);
    const double half = 0.5 * (s->width > 0 ? s->width : 8);
    for (int pass = 0; pass < 2; pass++) { /* count, then keep */
        o->points =
            pass ? (txe_point *)txm_arena_alloc(arena, o->count, sizeof *o->points) : NULL;
        if (pass && !o->points) return txe_no_memory(env);
        o->count = 0;
        if (!txe_band_side(even + m, m, 0, half, o, bar) ||
            !txe_band_side(even + m, m, 1, half, o, bar))
            return txe_stopped(env);
    }
    return TXM_OK;
}

/* The point at index u, a fraction, of a closed line of n points. */
static txe_point txe_point_at(const txe_point *p, size_t n, double u) {
    const double wide = (double)n;
    if (u < 0) u += wide;
    if (u >= wide) u -= wide;
    size_t i = (size_t)u;
    if (i >= n) i = n - 1;
    return txe_between(p[i], p[i + 1 < n ? i + 1 : 0], u - (double)i);
}

/* Do the segments a b and c d cross? Where they only touch they do not. */
static int txe_cross(txm_vec2 a, txm_vec2 b, txm_vec2 c, txm_vec2 d, txm_vec2 *at) {
    if (txm_maxf(a.x, b.x) < txm_minf(c.x, d.x) || txm_maxf(c.x, d.x) < txm_minf(a.x, b.x) ||
        txm_maxf(a.y, b.y) < txm_minf(c.y, d.y) || txm_maxf(c.y, d.y) < txm_minf(a.y, b.y))
        return 0;
    const double ux = (double)b.x - a.x, uy = (double)b.y - a.y;
    const double vx = (double)d.x - c.x, vy = (double)d.y - c.y;
    const double wx = (double)c.x - a.x, wy = (double)c.y - a.y;
    const double c_side = ux * wy - uy * wx, d_side = c_side + (ux * vy - uy * vx);
    const double a_side = vy * wx - vx * wy, b_side = a_side + (vx * uy - vy * ux);
    if (!((c_side < 0 && d_side > 0) || (c_side > 0 && d_side < 0))) return 0;
    if (!((a_side < 0 && b_side > 0) || (a_side > 0 && b_side < 0))) return 0;
    const double t = a_side / (a_side - b_side);
    *at = txm_v2(txm_float(a.x + ux * t), txm_float(a.y + uy * t));
    return 1;
}

/* Cut loops of fewer than TXE_LOOP points off a closed line. Points are pushed onto a stack; where
   the segment to the next one crosses an earlier one, the stack is cut back to that and continues
   from the crossing. A second pass starts from another point, for loops through the first. Returns
   how many points remain; 0 = cancelled.
   scratch: room for n points */
static size_t txe_cut_loops(txm_vec2 *points, size_t n, txm_vec2 *scratch, txe_progress *bar) {
    for (int round = 0; round < 2; round++) {
        const size_t turn = n / 2;
        size_t top = 0;
        for (size_t i = 0; i <= n; i++) { /* the first point again at the end */
            const txm_vec2 next = points[(turn + i) % n];
            for (size_t k = 2; top > k && k <= TXE_LOOP; k++) { /* newest first: small loops */
                const txm_vec2 *old = scratch + top - k - 1;
                txm_vec2 at;
                if (i == n && old == scratch) break; /* they share the first point */
                if (!txe_cross(scratch[top - 1], next, old[0], old[1], &at)) continue;
                top -= k;
                scratch[top++] = at;
                k = 1;
            }
            if (i < n) {
                TXM_ASSERT(top < n); /* each point is pushed once, a crossing replaces two or more */
                scratch[top++] = next;
            }
            if (txe_advance(bar, TXE_LOOP)) return 0;
        }
        n = top;
        memcpy(points, scratch, n * sizeof *points);
    }
    return n;
}

/* The outline o displaced by up to `most` pixels, in memory of the arena. */
static txm_status txe_displace(const txe_roughness *u, double most, txm_rng *rng,
                               const txe_outline *o, txm_vec2 **points, size_t *count,
                               txm_arena *arena, txe_progress *bar, txm_env *env) {
    const double length = txe_length(o->points, o->count, 1, bar);
    if (length < 0) return txe_stopped(env);
    if (most > length / 16) most = length / 16;
    if (length > 4 * (double)TXE_MAX_LENGTH)
        return txm_fail_at(env, TXM_TOO_LARGE, "strokes", "have too many turns for their width");
    const size_t n = length > 16 ? (size_t)(length + 0.5) : 16, shortest = TXE_PIECE / 3;
    size_t m = (size_t)(length / u->step + 0.5);
    if (m < shortest) m = shortest;
    txe_point *even = (txe_point *)txm_arena_alloc(arena, n, 2 * sizeof *even);
    txe_sample *row = (txe_sample *)txm_arena_alloc(arena, m, sizeof *row);
    txm_vec2 *line = (txm_vec2 *)txm_arena_alloc(arena, m + 1, 2 * sizeof *line);
    if (arena->failed) return txe_no_memory(env);
    const txe_point *soft = even + n;
    const size_t corner = n < 8 * TXE_CORNER_BLUR ? n / 8 : (size_t)TXE_CORNER_BLUR;
    if (!txe_resample(o->points, o->count, 1, length, even, n, bar) ||
        !txe_soften(even, n, 1, corner, even + n, bar) || !txe_chain_pieces(u, rng, row, m, bar))
        return txe_stopped(env);

    double sum = 0, at = 0;
    for (size_t k = 0; k < m; k++) sum += row[k].step;
    const double stretch = sum > 0 ? (double)n / sum : 0; /* stroke samples per step */
    const double scale = most / TXE_MAX_OFFSET;
    const double chord = n < 4 * TXE_CHORD ? (double)n / 4 : (double)TXE_CHORD;
    txe_point direction;
    direction.x = 1;
    direction.y = 0;
    for (size_t k = 0; k < m; k++) {
        const txe_point p = txe_point_at(soft, n, at), given = txe_point_at(even, n, at);
        txe_direction(txe_point_at(soft, n, at - chord), txe_point_at(soft, n, at + chord),
                      &direction);
        const double room = most - txe_distance(p, given);
        const double ahead = row[k].ahead * scale, right = row[k].right * scale;
        const double off = sqrt(ahead * ahead + right * right);
        const double factor = off <= room ? 1 : room > 0 ? room / off : 0;
        line[k].x = txm_float(p.x + factor * (ahead * direction.x - right * direction.y));
        line[k].y = txm_float(p.y + factor * (ahead * direction.y + right * direction.x));
        at += row[k].step * stretch;
        if (txe_advance(bar, 4)) return txe_stopped(env);
    }
    *points = line;
    *count = txe_cut_loops(line, m, line + m + 1, bar);
    return *count ? TXM_OK : txe_stopped(env);
}

/* The line of one stroke, in memory of `lines`. */
static txm_status txe_stroke(const texedges_control *c, int i, const txe_roughness *u,
                             txm_vec2 **points, size_t *count, txm_arena *lines, txe_progress *bar,
                             txm_env *env) {
    const texedges_stroke *s = &c->strokes[i];
    const double width = s->is_closed ? 256 : s->width > 0 ? s->width : 8; /* sides stay apart */
    const double most = width < 8 ? width * TXE_MAX_OFFSET / 8 : TXE_MAX_OFFSET;
    txm_arena work;
    txe_outline o;
    txm_vec2 *made = NULL;
    txm_rng rng = txm_rng_make(c->seed, (uint64_t)i);
    txm_arena_init(&work, env);
    memset(&o, 0, sizeof o);
    txm_status status = txe_outline_make(s, &o, &work, bar, env);
    const int is_plain = c->disturb < 0 || u->start_count == 0;
    *count = o.count;
    if (status == TXM_OK && !is_plain)
        status = txe_displace(u, most, &rng, &o, &made, count, &work, bar, env);
    if (status == TXM_OK) {
        *points = (txm_vec2 *)txm_arena_alloc(lines, *count, sizeof **points);
        if (!*points) status = txe_no_memory(env);
    }
    for (size_t k = 0; k < *count && status == TXM_OK; k++) {
        (*points)[k] =
            is_plain ? txm_v2(txm_float(o.points[k].x), txm_float(o.points[k].y)) : made[k];
        if (txe_advance(bar, 1)) status = txe_stopped(env);
    }
    txm_arena_free(&work);
    return status;
}

/* All strokes, layer by layer, so that the roughness of one layer at a time is held. */
static txm_status txe_disturb(const texedges_control *c, txe_progress *bar, txm_arena *lines,
                              texedges_set *e, txm_env *env) {
    const size_t n = (size_t)c->stroke_count;
    txm_vec2 **points = (txm_vec2 **)txm_arena_alloc(lines, n, sizeof(txm_vec2 *));
    e->lines = (texedges_polyline *)txm_arena_zero(&e->memory, n, sizeof *e->lines);
    if (lines->failed || e->memory.failed) return txe_no_memory(env);
    for (int layer = 0; layer < e->levels; layer++) {
        txm_arena held;
        txe_roughness u;
        int is_used = 0;
        txm_status status = TXM_OK;
        memset(&u, 0, sizeof u);
        for (int i = 0; i < c->stroke_count; i++) is_used |= c->strokes[i].layer == layer;
        txm_arena_init(&held, env);
        if (is_used && c->disturb >= 0)
            status = txe_measure_layer(&u, c->edges, layer, c->disturb > 0 ? c->disturb : 1, &held,
                                       bar, env);
        for (int i = 0; i < c->stroke_count && status == TXM_OK && is_used; i++) {
            if (c->strokes[i].layer != layer) continue;
            e->lines[i].layer = layer;
            status = txe_stroke(c, i, &u, &points[i], &e->lines[i].count, lines, bar, env);
        }
        txm_arena_free(&held);
        if (status != TXM_OK) return status;
    }
    e->line_count = n;
    for (size_t i = 0; i < n; i++) {
        e->lines[i].first = e->point_count;
        e->point_count += e->lines[i].count;
    }
    if (n == 0) return TXM_OK;
    e->points = (txm_vec2 *)txm_arena_alloc(&e->memory, e->point_count, sizeof *e->points);
    if (!e->points) return txe_no_memory(env);
    for (size_t i = 0; i < n; i++) {
        memcpy(e->points + e->lines[i].first, points[i], e->lines[i].count * sizeof *e->points);
        if (txe_advance(bar, e->lines[i].count)) return txe_stopped(env);
    }
    return TXM_OK;
}

TEXEDGES_API txm_status texedges_disturb(const texedges_control *control, int width, int height,
                                         txm_env *env, texedges_set **out) {
    txe_progress bar = txe_progress_of(env);
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    if (width < 1 || height < 1)
        return txm_fail(env, TXM_BAD_ARGUMENT, "width and height must be 1 or more");
    if (width > TXE_MAX_SIDE || height > TXE_MAX_SIDE)
        return txm_fail(env, TXM_TOO_LARGE, "a side is longer than 2^20 pixels");
    txe_stage(&bar, "edges", 0.1, txe_points_of(control));
    txm_status status = txe_check_control(control, &bar, env);
    if (status != TXM_OK) return status;

    double work = 150 * (double)control->edges->point_count;
    for (int i = 0; i < control->stroke_count; i++) {
        const texedges_stroke *s = &control->strokes[i];
        for (int k = 1; k < s->count; k++) {
            const txm_vec2 p = s->points[k - 1], q = s->points[k];
            const double dx = (double)q.x - p.x, dy = (double)q.y - p.y;
            work += 250 * sqrt(dx * dx + dy * dy);
        }
    }
    txe_stage(&bar, "strokes", 1, work);
    txm_arena lines;
    texedges_set *set = txe_set_make(control->edges->levels, width, height, env);
    if (!set) return txe_no_memory(env);
    memcpy(set->thresholds, control->edges->thresholds, sizeof set->thresholds);
    memcpy(set->beside, control->edges->beside, sizeof set->beside);
    txm_arena_init(&lines, env);
    status = txe_disturb(control, &bar, &lines, set, env);
    txm_arena_free(&lines);
    if (status == TXM_OK) *out = set;
    else texedges_set_free(set);
    return status;
}

/* ---- the guide ------------------------------------------------------------------------- */

/* The map that a guide is drawn from: layer + 1 of each pixel, 0 = nothing. */
typedef struct txe_guide {
    int width, height;
    uint8_t *at;
} txe_guide;

/* Fixed-point coordinates of 1/256 pixel: all that follows is exact. */
static int64_t txe_fixed(float x) {
    return (int64_t)floor((double)x * 256 + 0.5);
}

/* a / b rounded up, b > 0 */
static int64_t txe_ceil(int64_t a, int64_t b) {
    return a / b + (a % b > 0);
}

/* The rows first..end-1 whose centre lines a segment crosses, and where. Its upper end counts, its
   lower one does not: a corner counts once, a horizontal segment not at all. */
typedef struct txe_slope {
    int64_t x, y, dx, dy; /* of the upper end, and from there to the lower one */
    int first, end, down; /* down: 1 if the segment runs downwards, else 0      */
} txe_slope;

static txe_slope txe_slope_of(txm_vec2 p, txm_vec2 q, int height) {
    const int64_t px = txe_fixed(p.x), py = txe_fixed(p.y);
    const int64_t qx = txe_fixed(q.x), qy = txe_fixed(q.y);
    txe_slope s;
    s.down = py < qy;
    s.x = s.down ? px : qx;
    s.y = s.down ? py : qy;
    s.dx = s.down ? qx - px : px - qx;
    s.dy = s.down ? qy - py : py - qy;
    const int64_t first = txe_ceil(s.y - 128, 256), end = txe_ceil(s.y + s.dy - 128, 256);
    s.first = first < 0 ? 0 : first > height ? height : (int)first;
    s.end = end < s.first ? s.first : end > height ? height : (int)end;
    return s;
}

/* The first pixel of a row whose centre lies on the segment or to its right, 0..width. */
static uint32_t txe_column(const txe_slope *s, int row, int width) {
    const int64_t down = 256 * (int64_t)row + 128 - s->y;
    const int64_t column = txe_ceil((s->x - 128) * s->dy + down * s->dx, 256 * s->dy);
    return (uint32_t)(column < 0 ? 0 : column > width ? width : column);
}

/* Fill the inside of a line (winding number not 0) with value: its crossings with the centre lines
   of rows are listed row by row, sorted by column, and the spans between them are filled. */
static txm_status txe_fill(const txe_guide *g, const txm_vec2 *p, size_t n, int value,
                           txm_arena *arena, txe_progress *bar, txm_env *env) {
    int top = g->height, bottom = 0;
    size_t total = 0, longest = 0;
    for (size_t i = 0; i < n; i++) {
        const txe_slope s = txe_slope_of(p[i], p[i + 1 < n ? i + 1 : 0], g->height);
        if (s.first < s.end && s.first < top) top = s.first;
        if (s.first < s.end && s.end > bottom) bottom = s.end;
        total += (size_t)(s.end - s.first);
        if (txe_advance(bar, 4)) return txe_stopped(env);
    }
    if (total == 0) return TXM_OK;
    /* next[r]: index of the next crossing of row top + r; in the end, where the row ends */
    const size_t rows = (size_t)(bottom - top);
    size_t *next = (size_t *)txm_arena_zero(arena, rows + 1, sizeof *next);
    txm_pair *list = (txm_pair *)txm_arena_alloc(arena, total, sizeof *list);
    if (arena->failed) return txe_no_memory(env);
    for (int pass = 0; pass < 2; pass++) {
        for (size_t i = 0; i < n; i++) {
            const txe_slope s = txe_slope_of(p[i], p[i + 1 < n ? i + 1 : 0], g->height);
            for (int y = s.first; y < s.end; y++) {
                size_t *at = &next[y - top];
                if (pass) {
                    list[*at].key = txe_column(&s, y, g->width);
                    list[*at].value = (uint32_t)s.down;
                }
                ++*at;
                if (txe_advance(bar, 4)) return txe_stopped(env);
            }
            if (txe_advance(bar, 1)) return txe_stopped(env);
        }
        for (size_t r = 0, sum = 0; r < rows && pass == 0; r++) { /* counts become indices */
            const size_t count = next[r];
            if (count > longest) longest = count;
            next[r] = sum;
            sum += count;
        }
    }
    txm_pair *scratch = (txm_pair *)txm_arena_alloc(arena, longest, sizeof *scratch);
    if (!scratch) return txe_no_memory(env);
    for (size_t r = 0; r < rows; r++) {
        const size_t from = r ? next[r - 1] : 0, count = next[r] - from;
        uint8_t *row = g->at + (size_t)(top + (int)r) * (size_t)g->width;
        int64_t winding = 0;
        txm_sort_pairs(list + from, scratch, count);
        for (size_t i = from; i + 1 < from + count; i++) {
            winding += list[i].value ? 1 : -1;
            if (winding) memset(row + list[i].key, value, list[i + 1].key - list[i].key);
        }
        if (txe_advance(bar, (size_t)g->width / 16 + 8 * count + 512)) return txe_stopped(env);
    }
    return TXM_OK;
}

/* With a free background: the surroundings of strokes get the layer that borders most on that of
   the nearest stroke. An exact distance transform: first the distance to the nearest stroke in the
   same row, then the least sum of squares over the rows above and below; of equals the left, then
   the upper one.
   off, what: two bytes for each pixel, the distance and the stroke's layer + 1. 0 = cancelled */
static int txe_fill_around(const txe_guide *g, const int *beside, uint8_t *off, uint8_t *what,
                           txe_progress *bar) {
    const size_t w = (size_t)g->width;
    for (int y = 0; y < g->height; y++) {
        const uint8_t *row = g->at + (size_t)y * w;
        uint8_t *distance = off + (size_t)y * w, *mark = what + (size_t)y * w;
        int since = TXE_AROUND + 1, last = 0; /* pixels since the last stroke, and its mark */
        for (size_t x = 0; x < w; x++) {
            since = row[x] ? 0 : since <= TXE_AROUND ? since + 1 : since;
            if (row[x]) last = row[x];
            distance[x] = (uint8_t)since;
            mark[x] = (uint8_t)last;
            if (txe_advance(bar, 1)) return 0;
        }
        since = TXE_AROUND + 1;
        for (size_t x = w; x-- > 0;) {
            since = row[x] ? 0 : since <= TXE_AROUND ? since + 1 : since;
            if (row[x]) last = row[x];
            if (since < distance[x]) {
                distance[x] = (uint8_t)since;
                mark[x] = (uint8_t)last;
            }
            if (txe_advance(bar, 1)) return 0;
        }
    }
    for (int y = 0; y < g->height; y++) {
        const int low = y > TXE_AROUND ? y - TXE_AROUND : 0;
        const int high = y + TXE_AROUND < g->height ? y + TXE_AROUND : g->height - 1;
        for (size_t x = 0; x < w; x++) {
            uint8_t *at = g->at + (size_t)y * w + x;
            int least = TXE_AROUND * TXE_AROUND + 1, mark = 0;
            if (txe_advance(bar, 2)) return 0;
            if (off[(size_t)y * w + x] == 0) continue; /* inside a stroke */
            for (int v = low; v <= high; v++) {
                const int dx = off[(size_t)v * w + x], dy = v - y;
                if (dx * dx + dy * dy >= least) continue;
                least = dx * dx + dy * dy;
                mark = what[(size_t)v * w + x];
            }
            *at = (uint8_t)(mark ? beside[mark - 1] + 1 : 0);
            if (txe_advance(bar, 8)) return 0;
        }
    }
    return 1;
}

/* Draw all lines and their surroundings. mask, what: with a free background two more bytes for each
   pixel, else NULL. In the end g holds grays, and mask where they count. */
static txm_status txe_guide_make(const texedges_control *c, const texedges_set *lines,
                                 const txe_guide *g, uint8_t *mask, uint8_t *what,
                                 txe_progress *bar, txm_env *env) {
    const size_t count = (size_t)g->width * (size_t)g->height;
    for (size_t i = 0; i < lines->line_count; i++) {
        const texedges_polyline *line = &lines->lines[i];
        txm_arena work;
        txm_arena_init(&work, env);
        const txm_status status = txe_fill(g, lines->points + line->first, line->count,
                                           line->layer + 1, &work, bar, env);
        txm_arena_free(&work);
        if (status != TXM_OK) return status;
    }
    txe_stage(bar, "surroundings", 1, (mask ? 12 : 2) * (double)count);
    if (mask) {
        int beside[TEXEDGES_MAX_LEVELS];
        for (int k = 0; k < lines->levels; k++) { /* without a neighbour: any other layer */
            beside[k] = c->edges->beside[k];
            if (beside[k] < 0) beside[k] = k ? k - 1 : 1;
        }
        if (!txe_fill_around(g, beside, mask, what, bar)) return txe_stopped(env);
    }
    for (size_t i = 0; i < count; i++) {
        const int layer = g->at[i] ? g->at[i] - 1 : mask ? 0 : c->background;
        if (mask) mask[i] = g->at[i] ? 255 : 0;
        g->at[i] = (uint8_t)layer;
        if (txe_advance(bar, 1)) return txe_stopped(env);
    }
    return txe_layers_to_gray(g->at, count, lines->levels, bar) ? TXM_OK : txe_stopped(env);
}

TEXEDGES_API txm_status texedges_guide(const texedges_control *control,
                                       const texedges_set *disturbed, txm_env *env,
                                       const txm_image *guide, const txm_image *mask) {
    txe_progress bar = txe_progress_of(env);
    txm_status status = txe_check_image(guide, "guide", 1, env);
    if (status == TXM_OK) status = txe_check_image(mask, "mask", 1, env);
    txe_stage(&bar, "edges", 0.2, txe_points_of(control));
    if (status == TXM_OK) status = txe_check_control(control, &bar, env);
    if (status == TXM_OK) status = txe_check_edges(disturbed, "disturbed", 0, &bar, env);
    if (status != TXM_OK) return status;
    if (guide->width != disturbed->width || guide->height != disturbed->height ||
        mask->width != disturbed->width || mask->height != disturbed->height)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "guide and mask must have the size that texedges_disturb was given");
    int same = disturbed->levels == control->edges->levels &&
               disturbed->line_count == (size_t)control->stroke_count;
    for (int i = 0; i < control->stroke_count && same; i++)
        same = disturbed->lines[i].layer == control->strokes[i].layer;
    if (!same)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "disturbed",
                           "was made of other strokes than control holds");

    const size_t w = (size_t)guide->width, count = w * (size_t)guide->height;
    const int is_free = control->background < 0;
    txm_arena arena;
    txe_guide g;
    txe_stage(&bar, "strokes", 0.5, 30 * (double)disturbed->point_count);
    txm_arena_init(&arena, env);
    g.width = guide->width;
    g.height = guide->height;
    g.at = (uint8_t *)txm_arena_zero(&arena, count, is_free ? 3 : 1);
    uint8_t *counts = g.at && is_free ? g.at + count : NULL; /* the mask */
    status =
        g.at ? txe_guide_make(control, disturbed, &g, counts, counts ? counts + count : NULL, &bar,
                              env)
             : txe_no_memory(env);
    for (int y = 0; y < g.height && g.at && status == TXM_OK; y++) {
        uint8_t *row = (uint8_t *)txm_image_row(mask, y);
        memcpy(txm_image_row(guide, y), g.at + (size_t)y * w, w);
        if (counts) memcpy(row, counts + (size_t)y * w, w);
        else memset(row, 255, w);
    }
    txm_arena_free(&arena);
    return status;
}

#endif /* TEXEDGES_IMPLEMENTATION */

/* ---- licence ----------------------------------------------------------------------------

   This file may be used under either of two licences, whichever you like better.

   1. MIT

   Copyright (c) 2026 the texkit authors

   Permission is hereby granted, free of charge, to any person obtaining a copy of this software
   and associated documentation files (the "Software"), to deal in the Software without
   restriction, including without limitation the rights to use, copy, modify, merge, publish,
   distribute, sublicense, and/or sell copies of the Software, and to permit persons to whom the
   Software is furnished to do so, subject to the following conditions:

   The above copyright notice and this permission notice shall be included in all copies or
   substantial portions of the Software.

   THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING
   BUT NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY, FITNESS FOR A PARTICULAR PURPOSE AND
   NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS OR COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM,
   DAMAGES OR OTHER LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM,
   OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE SOFTWARE.

   2. Public domain (Unlicense, unlicense.org)

   This is free and unencumbered software released into the public domain.

   Anyone is free to copy, modify, publish, use, compile, sell, or distribute this software,
   either in source code form or as a compiled binary, for any purpose, commercial or non-
   commercial, and by any means.

   In jurisdictions that recognize copyright laws, the author or authors of this software dedicate
   any and all copyright interest in the software to the public domain. We make this dedication
   for the benefit of the public at large and to the detriment of our heirs and successors. We
   intend this dedication to be an overt act of relinquishment in perpetuity of all present and
   future rights to this software under copyright law.

   THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING
   BUT NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY, FITNESS FOR A PARTICULAR PURPOSE AND
   NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER
   LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM, OUT OF OR IN
   CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE SOFTWARE.
*/
