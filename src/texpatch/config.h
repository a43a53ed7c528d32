#ifndef TEXPATCH_CONFIG_H
#define TEXPATCH_CONFIG_H

#include "../texpatch.h"

/* ---- configuration ------------------------------------------------------------------ */

#if defined(__SSE2__) && !defined(TEXPATCH_NO_SIMD)
#include <emmintrin.h>
#endif

/* ---- constants and private types --------------------------------------------------------- */

#if defined(__SSE2__) && !defined(TEXPATCH_NO_SIMD)
#define TXP_SSE2 1
#endif

enum {
    TXP_MAX_LEVELS = 8,
    TXP_COARSE = 96,      /* pixels: the pyramid ends once the smaller side is under this        */
    TXP_MARGIN = 8,       /* pixels of canvas beyond the output, cut off at the end              */
    TXP_BLOCK = 24,       /* pixels: patch of the first pass, at the coarsest level              */
    TXP_SMALL_BLOCK = 12, /* the same for exemplars without long order                           */
    TXP_WINDOW = 16,      /* pixels: the larger neighbourhood of the optimisation                */
    TXP_PAD = 32,         /* columns and rows of a torus that are repeated beyond its end        */
    TXP_STARTS = 6,       /* first passes tried on a small canvas; the best is kept              */
    TXP_CELL = 8,         /* pixels: side of the cells in which use of the exemplar is counted   */
    TXP_LANES = 8,        /* bands processed together, whatever the number of threads            */
    TXP_BAND = 32,        /* rows of a band                                                      */
    TXP_OFF_LATTICE = 9,  /* square of the distance, in pixels, that counts as off the lattice   */
    TXP_MAX_SHEETS = TEXPATCH_MAX_EXEMPLARS * 8
};

/* A pixel of the stack of sheets; x = -1: none, the pixel of the canvas is the caller's. */
typedef struct txp_place {
    int32_t x, y;
} txp_place;

/* One exemplar in one orientation: rows first .. first + height - 1 of the stack. Its pixel (x, y)
   is the exemplar at (xx x + xy y + x0, yx x + yy y + y0). */
typedef struct txp_sheet {
    int exemplar, turn;
    int width, height;
    double xx, xy, x0, yx, yy, y0;
    int plain; /* it is only turned, not resampled: whole pixels are whole pixels               */
} txp_sheet;

/* The stack at one resolution: the bytes that are compared, bytes of them per pixel. */
typedef struct txp_stack {
    int width, height;
    size_t pitch; /* bytes from row to row                                               */
    uint8_t *pixels;
    int first[TXP_MAX_SHEETS], wide[TXP_MAX_SHEETS], high[TXP_MAX_SHEETS];
    uint8_t *sheet;    /* of each row                                                         */
    uint32_t *bad;     /* (width + 1) x (height + 1) sums of unusable pixels; NULL: none       */
    double lattice[4]; /* steps in pixels of this level                                       */
    double inverse[4]; /* lattice coordinates of (x, y): i0 x + i1 y, i2 x + i3 y              */
} txp_stack;

/* Where bricks begin in the courses of an exemplar; course i is where the second lattice coordinate
   is origin + i to origin + i + 1. Those of the canvas repeat some of them in order. */
typedef struct txp_courses {
    int count;  /* 0: there are none, the lattice is all                                            */
    int around; /* the canvas closes after so many; 0: it does not                                  */
    int first, cycle; /* what is repeated                                                           */
    double origin;
    float *phase; /* in steps along the course, 0 to 1                                              */
} txp_courses;

/* What all jobs on the same exemplars share. */
typedef struct txp_source {
    int sheets, levels, bytes, tones, guide_at, guide_bytes; /* tones: bytes of the maps          */
    int has_lattice, is_random; /* is_random: no long-range order at all                        */
    txp_courses courses;        /* where the lattice holds for each course alone                */
    double contrast;            /* mean difference of two pixels anywhere, bytes summed         */
    int has_alpha;
    int16_t alpha_at[TEXPATCH_MAX_CHANNELS]; /* of a compared byte that is a colour: the byte of its
                                               alpha; -1: it has none                            */
    uint8_t opaque[TEXPATCH_MAX_CHANNELS]; /* what that byte is where alpha is 1                 */
    txp_sheet sheet[TXP_MAX_SHEETS];
    txp_stack stack[TXP_MAX_LEVELS];
} txp_source;

/* The picture at one resolution. Beyond the end of an axis that wraps, pixels repeats the first
   columns and rows. */
typedef struct txp_canvas {
    int width, height, wrap; /* wrap: bits as in texpatch_desc.tileable                        */
    size_t pitch;
    uint8_t *pixels;
    txp_place *at;
    txp_place *next; /* where a pass puts what it chooses; only during one                      */
    uint8_t *fixed; /* 1 = not to be changed; NULL: nothing is                                 */
    uint8_t *free_guide; /* 1 = the guide does not count here; NULL: it does, or there is none  */
} txp_canvas;

#endif /* TEXPATCH_CONFIG_H */
