#ifndef TEXEDGES_CONFIG_H
#define TEXEDGES_CONFIG_H

#include "../texedges.h"

/* ---- constants and progress ------------------------------------------------------------ */

enum {
    TXE_SIDE = 1 << 20,   /* pixels: a float tells corners and halves of them apart up to here  */
    TXE_PIXELS = 1 << 28, /* of a picture; four cracks each still fit an int32_t                */
    TXE_LENGTH = 1 << 26, /* pixels, of all strokes                                             */
    TXE_TICK = 1 << 15,   /* pieces of work of a few ns each between two reports                */
    TXE_RING = 8,         /* pixels around a stroke in which the guide says what it is not      */

    TXE_LIGHT = 2,   /* pixels: a blur of this radius takes the steps out of a line of cracks   */
    TXE_CORNER = 3,  /* pixels: the blur of a stroke, for its corners                           */
    TXE_SCALE = 32,  /* pixels: what varies faster along a line is its unrest                   */
    TXE_COURSE = 24, /* pixels: blur of the line against which its directions are counted       */
    TXE_CHORD = 6,   /* pixels to both sides, by which the direction of a smooth line is taken  */
    TXE_BINS = 16,   /* directions told apart in half a turn                                    */
    TXE_PIECE = 48,  /* samples: longest piece of unrest; the shortest is a third of it         */
    TXE_JOIN = 8,    /* samples over which a piece is led on from the last one                  */
    TXE_SHORT = 64,  /* samples: shorter lines of the exemplar tell nothing                     */
    TXE_TRIES = 64,  /* pieces looked at for each join; four times as many to close a line      */
    TXE_GOOD = 8,    /* of them so many that join best are looked at closer                     */
    TXE_LOOP = 64    /* points: shorter loops of a disturbed line are cut off                   */
};
#define TXE_STRAY 3.5  /* pixels: how far unrest goes from the stroke (0.5 more for chords)     */
#define TXE_LINEAR 2.0 /* pixels: up to here it is as it was in the exemplar                    */

/* The bar of one call: a stage fills from..to of it in total pieces of work. */
typedef struct txe_bar {
    const txm_env *env;
    const char *stage;
    double from, to, total, done;
    size_t quiet; /* work since the last report */
} txe_bar;

static txe_bar txe_bar_make(const txm_env *env) {
    txe_bar bar;
    memset(&bar, 0, sizeof bar);
    bar.env = env;
    return bar;
}

static void txe_stage(txe_bar *bar, const char *stage, double to, double total) {
    bar->from = bar->to;
    bar->to = to;
    bar->stage = stage;
    bar->total = total > 1 ? total : 1;
    bar->done = 0;
}

/* So much work is done; non-zero: stop. */
static inline int txe_tick(txe_bar *bar, size_t work) {
    bar->quiet += work;
    if (bar->quiet < TXE_TICK) return 0;
    bar->done += (double)bar->quiet;
    bar->quiet = 0;
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

/* An empty set, which lies in its own memory; NULL: there is none. */
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
