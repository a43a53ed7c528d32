#ifndef TEXEDGES_CONFIG_H
#define TEXEDGES_CONFIG_H

#include "../texedges.h"

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

#endif /* TEXEDGES_CONFIG_H */
