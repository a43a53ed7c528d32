/* texsyn.h - v0.2.0 - learn a texture as a small table of statistics, synthesise any amount of it
   SPDX-License-Identifier: MIT OR Unlicense                   (full text: end of file)

   WHAT IT DOES
     Reads one photograph of a texture and records, for a few dozen relative positions of two to
     four pixels ("clique types"), how often each difference of their values occurs: two to four
     thousand bytes. From these alone it makes new texture of any size, optionally tileable. No
     pixel of the photograph is kept, so none can be copied.

   QUICK START                                 (tests build and run this very block)
     // Learn a texture and make a larger one. cc -std=c99 quick.c -lm
     #define TEXSYN_IMPLEMENTATION            // in exactly one .c or .cpp file
     #include "texsyn.h"                      // texmath.h must lie beside it
     #include <stdio.h>

     int main(void) {
         static unsigned char photo[64 * 64], larger[128 * 96];    // the caller owns all pixels
         static texsyn_learn_desc learn;      // static: all zero, the default for every field
         static texsyn_synth_desc synth;
         static txm_env env;                  // malloc, silent, serial; receives the message
         static txm_image out;
         texsyn_model *model;
         for (int i = 0; i < 64 * 64; i++)    // instead of a photograph: waves
             photo[i] = (unsigned char)(128 + i % 64 * 9 % 50 + i / 64 * 5 % 70);
         learn.example.pixels = photo;
         learn.example.width = learn.example.height = 64;
         out.pixels = larger;
         out.width = synth.width = 128;
         out.height = synth.height = 96;
         if (texsyn_learn(&learn, &env, &model) != TXM_OK) {
             fprintf(stderr, "learn: %s\n", env.message);
             return 1;
         }
         synth.model = model;
         if (texsyn_synthesize(&synth, &env, out) != TXM_OK) {
             fprintf(stderr, "synthesise: %s\n", env.message);
             return 1;
         }
         printf("%d clique types, pixel (5, 7) is %d\n", texsyn_clique_count(model),
                larger[7 * 128 + 5]);
         texsyn_model_free(model);
         return 0;
     }

   WHAT IT IS GOOD FOR
     Bark, grass, gravel, sand, litter, rust, plaster, coarse weaves: irregular textures. It cannot
     reproduce closed contours, long thin lines or exact layouts: cobbles merge, bricks lose their
     rows. A photograph whose lighting or material changes gives a texture with patches of both; a
     mask leaves out what does not belong. About 256 x 256 pixels that show the largest element a
     few dozen times are enough; 64 x 64 are too few for good statistics.

   HOW IT WORKS
     The example is split into decorrelated colour bands of at most 32 values and into pyramid
     levels. On each level, coarse first, a canvas is synthesised with the clique types so far, the
     histograms of all other types are compared with the example's, the types that differ most are
     added, and so on [1]. Synthesis is Gibbs sampling [4] in which the potentials of the clique
     types are controlled so that the histograms of the canvas follow those of the example.
     In addition to the pairs of [1] there is a coarse joint histogram of two neighbouring values,
     which distinguishes rare values from frequent ones; and there are cliques of three and four
     pixels (corners, parallel differences, differences together with those of the coarser level),
     for what pairs cannot express.

   CONFIGURATION   (define before the include that has _IMPLEMENTATION)
     TEXSYN_STATIC       every function static to the including file (set it everywhere)
     TEXSYN_MAX_PIXELS   refuse larger images; default 2^28
     TEXSYN_NO_SIMD      plain C only. Else SSE2 where the compiler has it and, with gcc and clang,
                         AVX2 where the processor has it. The bytes are the same.

   MEMORY
     A model is a few blocks, some 100 kB in memory for 3 kB in a file. Learning takes 12 bytes per
     sample of the example and 3 to 5 MB; up to 40 MB with one level and max_distance 60. Synthesis
     takes 2 bytes per band and pixel for the current level and the next coarser one, without
     margins: 8 to 9 bytes per RGB pixel in all, and 1 MB; a picture that does not tile is cut
     from a canvas of at least 64 x 64. After an error nothing stays allocated and *out is NULL.

   TIME   (one core of 2023; make bench measures yours)
     Learning 256 x 256 RGB about 1.3 s; synthesis about 1.5 s per RGB megapixel. Both grow with
     the pixels and the clique types. The parallel-for hook spreads both.

   THREADS
     No global state. Calls with different env, job and out may overlap; a model may be used by many
     calls at once.

   SAME BYTES
     Learning and synthesis give the same bytes for the same input, options and seed: whatever the
     number of threads, with or without SIMD, on any compiler that follows IEEE 754 (see
     texmath.h). Synthesis uses integers up to the last step.

   LIMITS
     Sides of the example 16 pixels or more, images and canvases up to TEXSYN_MAX_PIXELS, which may
     be lowered; float samples up to a million. Differences under 1/255 are not resolved, so scale a
     float or 16-bit example of narrow range first. A model file is refused unless every number in
     it is in range. Build with -ffp-contract=off if the bytes of learned models must agree
     everywhere.

   REFERENCES
     [1] A. Zalesny, D. Auf der Maur, L. Van Gool. Realistic textures for virtual reality.
         VAST 2001, section 3.
     [2] A. Zalesny, L. Van Gool. A compact model for viewpoint dependent texture synthesis.
         SMILE 2000.
     [3] G. Gimel'farb. Image textures and Gibbs random fields. Kluwer 1999 (controllable
         simulated annealing, of which the control here is a faster relative).
     [4] S. Geman, D. Geman. Stochastic relaxation, Gibbs distributions, and the Bayesian
         restoration of images. IEEE PAMI 6(6), 1984.                                        */
#ifndef TEXSYN_H
#define TEXSYN_H

#include "texmath.h"

#define TEXSYN_VERSION "0.2.0"

#ifndef TEXSYN_MAX_PIXELS
#define TEXSYN_MAX_PIXELS (1 << 28) /* larger images are refused */
#endif
#if TEXSYN_MAX_PIXELS > (1 << 28)
#error "TEXSYN_MAX_PIXELS: at most 2^28"
#endif

#if defined(TEXSYN_STATIC) && defined(__GNUC__)
#define TEXSYN_API __attribute__((unused)) static
#elif defined(TEXSYN_STATIC)
#define TEXSYN_API static
#else
#define TEXSYN_API extern
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* ---- learning --------------------------------------------------------------------------- */

/* A learned texture. It holds all it needs and never changes once it is made. */
typedef struct texsyn_model texsyn_model;

typedef struct texsyn_learn_desc {
    txm_image example; /* 1, 3 or 4 channels, both sides at least 16 px; not modified, need not
                          outlive the call                                                       */
    txm_image mask;    /* same size, 1 channel: learn where it is not 0; pixels NULL = everywhere */
    int max_distance;  /* longest pair in pixels of the example, 2..60; 0 = 40. Levels other than
                          the coarsest use pairs of at most 10 of their pixels                   */
    int max_types;     /* clique types per pyramid level beyond the preselected, 1..60; 0 = 24, or
                          36 for a gray example                                                   */
    int levels;        /* pyramid levels, 1..6; 0 = as many as leave the short side about 64 px;
                          fewer are made if a level would be under 8 px or hold little of a mask  */
    float threshold;   /* types whose histograms differ by less than this, or by less than the
                          sampling noise, are not added; 0 = 0.005                                */
    uint64_t seed;     /* for the random numbers; any value                                       */
} texsyn_learn_desc;

/* Learn a model: the analysis of [1], section 3, steps 1 to 6, on every pyramid level.

   env    NULL, or how to allocate, report and spread the work
   out    receives the model, or NULL on any error; release it with texsyn_model_free
   return TXM_OK; TXM_BAD_ARGUMENT for a field outside its range, samples that are not finite or
          beyond a million; TXM_TOO_SMALL for an example under 16 x 16 or a mask of fewer than 256
          pixels; TXM_TOO_LARGE above TEXSYN_MAX_PIXELS; TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost   see MEMORY and TIME above; a larger max_distance or max_types costs in proportion      */
TEXSYN_API txm_status texsyn_learn(const texsyn_learn_desc *desc, txm_env *env, texsyn_model **out);

/* Release a model with the allocator it was made with; NULL is allowed. */
TEXSYN_API void texsyn_model_free(texsyn_model *model);

/* ---- looking into a model --------------------------------------------------------------- */

typedef enum texsyn_kind {
    TEXSYN_SINGLE = 0, /* one pixel:  I_b(p)                                                     */
    TEXSYN_PAIR,       /* two pixels: I_c(p + d) - I_b(p), head minus tail                       */
    TEXSYN_PARENT,     /* a pixel and the coarser level above it: J_c(p) - I_b(p)                */
    TEXSYN_VALUES,     /* two pixels, coarsely: class of I_b(p), class of I_c(p + d)             */
    TEXSYN_CORNER,     /* three: classes of I_b(p + d) - I_b(p) and I_b(p + e) - I_b(p)          */
    TEXSYN_SCALE,      /* classes of I_b(p + d) - I_b(p) and J_b(p + e) - J_b(p + d - e)         */
    TEXSYN_PARALLEL    /* classes of I_b(p + d) - I_b(p) and I_c(p + e + d) - I_c(p + e)         */
} texsyn_kind;

/* One clique type of a model's neighbourhood system. */
typedef struct texsyn_clique {
    int level;        /* 0 = full resolution                                                   */
    texsyn_kind kind;
    int band, other;  /* tail band b, head band c (equal within a band)                        */
    int dx, dy;       /* displacement d in pixels of that level                                */
    int ex, ey;       /* displacement e                                                        */
    int phase;        /* of a pair of neighbours: 0 = all, 1 = tails at even, 2 = at odd
                         coordinates                                                           */
} texsyn_clique;

TEXSYN_API int texsyn_channels(const texsyn_model *model);    /* of the example: 1, 3 or 4 */
TEXSYN_API int texsyn_level_count(const texsyn_model *model); /* 1..6                      */
TEXSYN_API int texsyn_band_count(const texsyn_model *model);  /* 1..4 decorrelated bands   */
TEXSYN_API int texsyn_clique_count(const texsyn_model *model);

/* Clique type index of 0..count-1; its normalised histogram goes to bins (if not NULL), at most
   bin_count of them. Returns the number of bins of the type, 0 for a bad index. */
TEXSYN_API int texsyn_clique_at(const texsyn_model *model, int index, texsyn_clique *clique,
                                float *bins, int bin_count);

/* ---- saving and loading ----------------------------------------------------------------- */

/* Write the model as bytes: docs/model-format.md. *size receives the number of bytes needed; with
   buffer NULL nothing else happens. Saving what was loaded gives the same bytes again.
   return TXM_OK; TXM_BAD_ARGUMENT for NULL; TXM_TOO_SMALL if capacity < *size, with the buffer
          untouched; TXM_OUT_OF_MEMORY                                                        */
TEXSYN_API txm_status texsyn_save(const texsyn_model *model, txm_env *env, void *buffer,
                                  size_t capacity, size_t *size);

/* Read a model back. *out receives it, or NULL on any error; release it with texsyn_model_free.
   return TXM_OK; TXM_BAD_DATA for anything but a complete, intact model with all numbers in range;
          TXM_BAD_ARGUMENT for NULL; TXM_OUT_OF_MEMORY                                        */
TEXSYN_API txm_status texsyn_load(const void *data, size_t size, txm_env *env, texsyn_model **out);

/* ---- synthesis -------------------------------------------------------------------------- */

typedef struct texsyn_synth_desc {
    const texsyn_model *model; /* must outlive the job                                          */
    int width, height;         /* of the output in pixels, 1 or more each                        */
    int tileable;              /* non-zero: the output continues across its own borders          */
    int quality;               /* -2 fast .. +2 best: fewer or more sweeps; 0 = default          */
    uint64_t seed;             /* another seed, another picture                                  */
} texsyn_synth_desc;

/* Synthesise in one call. out is the caller's: desc->width x desc->height, the channels of the
   model (or 3 where it has 1, or 4 = opaque), 8 or 16 bits, or float, which is not clamped to 0..1.
   Untouched after an error.
   return TXM_OK; TXM_BAD_ARGUMENT for a field outside its range or a picture that does not fit;
          TXM_TOO_LARGE above TEXSYN_MAX_PIXELS; TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost   O(width * height * clique types); see MEMORY and TIME above                         */
TEXSYN_API txm_status texsyn_synthesize(const texsyn_synth_desc *desc, txm_env *env, txm_image out);

/* Synthesise in steps, for progressive display: begin, step while there is more to do, draw at any
   time, free. The final picture is the same as that of the single call. */
typedef struct texsyn_job texsyn_job;

/* Check the descriptor and make the job; *job is NULL on any error. The statuses are those of
   texsyn_synthesize. The job keeps the allocator of env; later calls may be given another env. */
TEXSYN_API txm_status texsyn_begin(const texsyn_synth_desc *desc, txm_env *env, texsyn_job **job);

/* Do one sweep; the progress callback receives the fraction of the whole job that is done. After
   TXM_OUT_OF_MEMORY the step may be tried again; after TXM_CANCELLED too, but as a sweep was
   interrupted the picture will differ from an uninterrupted one with the same seed.
   more   receives 1, or 0 once nothing is left to do; untouched after an error; NULL is allowed */
TEXSYN_API txm_status texsyn_step(texsyn_job *job, txm_env *env, int *more);

/* Draw the picture in its current state, at full size; once no step is left, the finished one.
   TXM_BAD_ARGUMENT if it does not fit out; out is as for texsyn_synthesize. */
TEXSYN_API txm_status texsyn_draw(const texsyn_job *job, txm_env *env, txm_image out);

/* Release a job; NULL is allowed. */
TEXSYN_API void texsyn_free(texsyn_job *job);

#ifdef __cplusplus
}
#endif
#endif /* TEXSYN_H */

#if defined(TEXSYN_IMPLEMENTATION) && !defined(TEXSYN_IMPLEMENTED)
#define TEXSYN_IMPLEMENTED

/* ---- configuration ------------------------------------------------------------------ */

#if !defined(TEXSYN_NO_SIMD) && defined(__SSE2__)
#include <emmintrin.h>
#define TXS_SSE2 1
#if defined(__GNUC__)
#include <immintrin.h>
#define TXS_AVX2 1 /* compiled for AVX2 function by function, chosen when running */
#endif
#endif

/* ---- constants -------------------------------------------------------------------------- */

enum {
    TXS_MAX_BANDS = 4,
    TXS_MAX_LEVELS = 6,
    TXS_VALUES = 32,      /* gray levels of a band; fewer are clearly worse, the rows of the
                             sampler are as wide                                              */
    TXS_CLASSES = 9,      /* of a value or a difference in the kinds that take two            */
    TXS_DIFFERENCES = 63, /* -31..31                                                          */
    TXS_BINS = TXS_CLASSES * TXS_CLASSES, /* of the largest histogram                         */
    TXS_ONE = 65536,    /* sum of a normalised histogram                                    */
    TXS_MAX_TYPES = 96, /* clique types of one level                                        */
    TXS_MAX_ENDS = 112, /* ends of cliques at one pixel of one band: keeps energies 16 bit  */
    TXS_MAX_REACH = 60, /* pixels                                                           */
    TXS_NEAR = 10,      /* pixels: reach of all levels but the coarsest                     */
    TXS_ROW = 64,       /* bytes of a table row for a difference                            */
    TXS_TABLE = (2 * TXS_CLASSES + TXS_DIFFERENCES) * TXS_ROW, /* bytes of one type's tables  */
    TXS_ZERO = 64,       /* the byte in a row that stands for no energy                      */
    TXS_NAT = 16,        /* steps of a row's byte per nat of energy                          */
    TXS_FINE = 4,        /* steps of the summed energy per step of a byte                    */
    TXS_NEVER = 1600,    /* such steps: the energy of a value that a band lacks              */
    TXS_PRECISE = 256,   /* steps of a controlled potential per step of a byte               */
    TXS_NOISE = 8192,    /* entries of the noise table                                       */
    TXS_WINDOW = 64,     /* weight of one count in the running histograms                    */
    TXS_TASKS = 16,      /* shares of a pass, whatever the number of threads                 */
    TXS_SAMPLES = 24576, /* pixels counted per sweep: as many as matter                      */
    TXS_GRID = 8,        /* sub-lattices a side                                              */
    TXS_TOGETHER = 8,    /* pixels drawn together                                            */
    TXS_GROUP = 2,       /* sub-lattices between two looks at the histograms                 */
    TXS_PROPORTIONAL = 150, /* gains of the control, nats per unit of histogram error; see   */
    TXS_INTEGRAL = 40,      /* docs/choices.md                                               */
    TXS_TYPES = 24,      /* added per level unless the caller says otherwise                 */
    TXS_TYPES_GRAY = 36, /* if there is only one band                                       */
    TXS_COARSE = 8,      /* 1/TXS_NAT nat: steps of a stored potential; the control refines  */
    TXS_STEEPEST = 20,   /* such steps: the largest stored potential                         */
    TXS_UNSEEN = 1,      /* such steps: the potential of a bin that has none stored          */
    TXS_RARE = 3,        /* the smallest root whose bin has a stored potential               */
    TXS_SMALLEST = 64    /* pixels: a narrower canvas has no statistics to speak of          */
};

/* Learning. Ours, by the medians of several measures over the stochastic exemplars: the kinds of
   three and four pixels describe shapes and are preferred. */
#define TXS_THRESHOLD 0.005f   /* smallest distance of histograms that is worth a clique type    */
#define TXS_NOISE_SHARE 0.75f  /* the same in units of the expected sampling noise               */
#define TXS_CORNER_WEIGHT 2.0f /* of distances, pairs having 1                                   */
#define TXS_EDGE_WEIGHT 2.5f

/* classes of a difference -31..31: fine where differences are frequent */
static const uint8_t txs_difference_class[TXS_DIFFERENCES + 1] = {
    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 2, 2, 2, 3, 3, 4,
    5, 5, 6, 6, 6, 7, 7, 7, 7, 7, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8};

/* ---- private types ---------------------------------------------------------------------- */

/* A clique type and its statistics. */
typedef struct txs_type {
    int kind, band, other;
    int dx, dy, ex, ey;
    int phase; /* tails counted: 0 all, 1 at even, 2 at odd coordinates; see txs_is_tail */
    int32_t share[TXS_BINS];     /* the example's histogram, sum about TXS_ONE                  */
    int16_t potential[TXS_BINS]; /* where the synthesis starts, 1/TXS_NAT nat                   */
    int16_t root[TXS_BINS];      /* the two as a model file keeps them: square roots of the     */
    int16_t level[TXS_BINS];     /* shares, potentials in coarse steps                          */
} txs_type;

/* One pyramid level: how bands are quantised, v -> (v - low) / step + 1/2, and what is known. */
typedef struct txs_level {
    int values[TXS_MAX_BANDS];
    float low[TXS_MAX_BANDS], step[TXS_MAX_BANDS];
    uint8_t classes[TXS_MAX_BANDS][TXS_VALUES]; /* of values, by quantiles of the single pixels */
    txs_type *types;                            /* the first ones are the singles of each band  */
    int type_count;
} txs_level;

/* a float with 15 bits of mantissa: what a model file keeps */
static float txs_short_float(float x) {
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    bits &= 0xffffff00u;
    memcpy(&x, &bits, sizeof x);
    return x;
}

struct texsyn_model {
    txm_arena arena; /* holds the model itself and its types                                  */
    int channels, bands, levels;
    float mean[TXS_MAX_BANDS];                 /* of the channels, 0..255                       */
    float basis[TXS_MAX_BANDS][TXS_MAX_BANDS]; /* band b = sum_c basis[b][c] (x[c] - mean[c])   */
    float dither[TXS_MAX_BANDS];               /* share of a step that the example's values fill */
    txs_level level[TXS_MAX_LEVELS];           /* 0 = full resolution                           */
};

/* Quantised planes with a margin that repeats the opposite border: first the bands, then the
   bands of the coarser level at this resolution ("parent"), which do not change. */
typedef struct txs_canvas {
    int width, height, margin;
    int slip_x, slip_y;      /* from here on odd and even swap, see txs_place; or the size */
    ptrdiff_t stride, plane; /* bytes to the next row, to the next plane */
    uint8_t *pixels;         /* the margin's first corner                */
} txs_canvas;

static int txs_mod(int a, int n) {
    a %= n;
    return a < 0 ? a + n : a;
}

static uint8_t *txs_at(const txs_canvas *c, int plane, int x, int y) {
    return c->pixels + plane * c->plane + (y + c->margin) * c->stride + (x + c->margin);
}

/* 0 if it does not fit the address space or there is no memory */
static int txs_canvas_make(txs_canvas *c, const txm_env *env, int width, int height, int margin,
                           int planes) {
    size_t plane, bytes;
    c->width = width;
    c->height = height;
    c->margin = margin;
    c->slip_x = width;
    c->slip_y = height;
    c->pixels = NULL;
    size_t stride = (size_t)width + 2 * (size_t)margin;
    if (!txm_mul(stride, (size_t)height + 2 * (size_t)margin, 1, &plane) ||
        !txm_mul(plane, (size_t)planes, 1, &bytes) || bytes > PTRDIFF_MAX)
        return 0;
    c->stride = (ptrdiff_t)stride;
    c->plane = (ptrdiff_t)plane;
    c->pixels = (uint8_t *)txm_alloc(env, bytes);
    if (c->pixels) memset(c->pixels, 0, bytes);
    return c->pixels != NULL;
}

static void txs_canvas_free(txs_canvas *c, const txm_env *env) {
    txm_free(env, c->pixels);
    c->pixels = NULL;
}

/* Fill the margin of a plane from the opposite sides. */
static void txs_wrap(const txs_canvas *c, int plane) {
    for (int y = 0; y < c->height; y++) {
        uint8_t *row = txs_at(c, plane, 0, y);
        for (int x = 1; x <= c->margin; x++) row[-x] = row[txs_mod(-x, c->width)];
        for (int x = 0; x < c->margin; x++) row[c->width + x] = row[txs_mod(x, c->width)];
    }
    for (int y = -c->margin; y < c->height + c->margin; y++) {
        if (y < 0 || y >= c->height)
            memcpy(txs_at(c, plane, -c->margin, y),
                   txs_at(c, plane, -c->margin, txs_mod(y, c->height)), (size_t)c->stride);
    }
}

/* Set a pixel and its copies in the margin. */
static void txs_set(const txs_canvas *c, int plane, int x, int y, uint8_t value) {
    *txs_at(c, plane, x, y) = value;
    if (x >= c->margin && x < c->width - c->margin && y >= c->margin && y < c->height - c->margin)
        return;
    int left = x - (x + c->margin) / c->width * c->width;
    int top = y - (y + c->margin) / c->height * c->height;
    for (int yy = top; yy < c->height + c->margin; yy += c->height)
        for (int xx = left; xx < c->width + c->margin; xx += c->width)
            *txs_at(c, plane, xx, yy) = value;
}

/* ---- clique types ----------------------------------------------------------------------- */

/* Where the members of a clique lie, seen from its tail; returns how many. */
static int txs_members(const txs_type *t, int at[4][2]) {
    const int s = t->kind == TEXSYN_PARALLEL ? 1 : -1;
    const int x[4] = {0, t->dx, t->ex, t->dx + s * t->ex};
    const int y[4] = {0, t->dy, t->ey, t->dy + s * t->ey};
    static const int counts[] = {1, 2, 1, 2, 3, 4, 4}; /* by texsyn_kind */
    for (int i = 0; i < counts[t->kind]; i++) {
        at[i][0] = x[i];
        at[i][1] = y[i];
    }
    return counts[t->kind];
}

/* May a pixel with these parities (x & 1, y & 1) be the tail? The neighbours (1, 0) and (0, 1) are
   two clique types each below the coarsest level: within a pixel of the coarser level, and across
   its border. In a photograph they have the same histogram; were they one type, a synthesised
   level would be smoother within than across, and show the grid of the one above. */
static int txs_is_tail(const txs_type *t, int px, int py) {
    return t->phase == 0 || ((t->dx & 1 ? px : py) & 1) == t->phase - 1;
}

/* the largest distance along an axis between two members */
static int txs_reach(const txs_type *t) {
    int at[4][2], n = txs_members(t, at), reach = 0;
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < i; j++) {
            for (int k = 0; k < 2; k++) {
                int d = abs(at[i][k] - at[j][k]);
                if (d > reach) reach = d;
            }
        }
    }
    return reach;
}

static int txs_bin_count(int kind) {
    return kind == TEXSYN_SINGLE                          ? TXS_VALUES
           : kind == TEXSYN_PAIR || kind == TEXSYN_PARENT ? TXS_DIFFERENCES
                                                          : TXS_BINS;
}

/* How to find the bin of a clique from its tail's address p (in plane 0):
     value       p[a]
     difference  p[a] - p[b] + 31
     values      ca[p[a]] * 9 + cb[p[b]]
     two         class(p[a] - p[b]) * 9 + class(p[c] - p[d])                                */
typedef struct txs_tally {
    int form; /* 0 value, 1 difference, 2 values, 3 two */
    int type; /* index in the level */
    ptrdiff_t a, b, c, d;
    const uint8_t *ca, *cb;
} txs_tally;

static txs_tally txs_tally_make(const txs_type *t, const txs_level *level, const txs_canvas *c,
                                int bands) {
    const ptrdiff_t tail = t->band * c->plane, head = t->other * c->plane;
    const ptrdiff_t parent = (bands + t->other) * c->plane;
    const ptrdiff_t d = t->dy * c->stride + t->dx, e = t->ey * c->stride + t->ex;
    txs_tally y = {3, 0, tail + d, tail, 0, 0, NULL, NULL};
    switch (t->kind) {
    case TEXSYN_SINGLE:
        y.form = 0;
        y.a = tail;
        break;
    case TEXSYN_PAIR:
        y.form = 1;
        y.a = head + d;
        break;
    case TEXSYN_PARENT:
        y.form = 1;
        y.a = parent;
        break;
    case TEXSYN_VALUES:
        y.form = 2;
        y.a = tail;
        y.b = head + d;
        y.ca = level->classes[t->band];
        y.cb = level->classes[t->other];
        break;
    case TEXSYN_CORNER:
        y.c = tail + e;
        y.d = tail;
        break;
    case TEXSYN_SCALE:
        y.c = parent + e;
        y.d = parent + d - e;
        break;
    default: /* TEXSYN_PARALLEL */ y.c = head + d + e; y.d = head + e;
    }
    return y;
}

static int txs_class(int difference) {
    return txs_difference_class[difference + 31];
}

static int txs_bin(const txs_tally *y, const uint8_t *p) {
    switch (y->form) {
    case 0: return p[y->a];
    case 1: return p[y->a] - p[y->b] + 31;
    case 2: return y->ca[p[y->a]] * TXS_CLASSES + y->cb[p[y->b]];
    default: return txs_class(p[y->a] - p[y->b]) * TXS_CLASSES + txs_class(p[y->c] - p[y->d]);
    }
}

/* Classes of a band's values: quantiles with narrow tails, so that rare values keep their say. */
static void txs_make_classes(txs_level *level, int band) {
    static const int cut[TXS_CLASSES - 1] = {655, 3277, 13107, 26214, 39322, 52429, 62259, 64881};
    const int32_t *share = level->types[band].share;
    int64_t below = 0;
    for (int v = 0; v < TXS_VALUES; v++) {
        int k = 0;
        while (k < TXS_CLASSES - 1 && below + share[v] / 2 > cut[k]) k++;
        level->classes[band][v] = (uint8_t)k;
        below += share[v];
    }
}

/* ---- energy of a pixel -------------------------------------------------------------------

   The Gibbs energy of a candidate value v at a pixel is the sum of the potentials of all cliques
   that end there. Once the other members are known, the potentials for v = 0..31 lie side by
   side in a table prepared for that end ("row"): for a difference n - v, for example, in the
   reversed potential from entry 31 - n on. A byte per entry, 1/16 nat, 64 for none.

     form 0   row = table - p[o1]                                     one difference
     form 1   row = table + class(p[o2] - p[o3]) * 64 - p[o1]         two, the other one known
     form 2   row = table + (p[o2] - p[o1]) * 64 - p[o1]              two, v in both
     form 3   row = table + classes[p[o1]] * 32                       a value beside a known one */
typedef struct txs_end {
    ptrdiff_t o1, o2, o3;
    const uint8_t *table, *classes;
} txs_end;

enum { TXS_FORMS = 4 };

static const uint8_t txs_no_energy[TXS_VALUES] = {
    TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO,
    TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO,
    TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO,
    TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO};

/* The value with the lowest energy

       e(v) = TXS_FINE * (sum of rows at v - TXS_ZERO count) + single(v) + noise

   With noise of Gumbel's distribution that is a draw from exp(-e) / sum exp(-e), the Gibbs
   sampler's step [4]. Values are kept even ones first, single[] and noise[] in that order, since
   adding bytes as the halves of 16-bit words yields them so. count is even, rows hold 1..127. */
typedef int txs_pick(const uint8_t *const *rows, int count, const int16_t *single,
                     const int16_t *noise);

static int txs_slot_value(int slot) {
    return (slot & 15) * 2 + (slot >> 4);
}

#ifndef TXS_SSE2
static int txs_pick_plain(const uint8_t *const *rows, int count, const int16_t *single,
                          const int16_t *noise) {
    int sum[TXS_VALUES] = {0}, best = 0;
    for (int i = 0; i < count; i++)
        for (int v = 0; v < TXS_VALUES; v++) sum[v] += rows[i][v];
    for (int slot = 0, least = INT_MAX; slot < TXS_VALUES; slot++) {
        int e =
            TXS_FINE * (sum[txs_slot_value(slot)] - TXS_ZERO * count) + single[slot] + noise[slot];
        if (e < least) {
            least = e;
            best = slot;
        }
    }
    return txs_slot_value(best);
}

#else
static __m128i txs_load(const void *p) {
    return _mm_loadu_si128((const __m128i *)p);
}

/* the least of 8 words, in all 8 */
static __m128i txs_least(__m128i m) {
    m = _mm_min_epi16(m, _mm_shuffle_epi32(m, 0x4e));
    m = _mm_min_epi16(m, _mm_shuffle_epi32(m, 0xb1));
    return _mm_min_epi16(m, _mm_shufflehi_epi16(_mm_shufflelo_epi16(m, 0xb1), 0xb1));
}

static int txs_pick_sse2(const uint8_t *const *rows, int count, const int16_t *single,
                         const int16_t *noise) {
    const __m128i low = _mm_set1_epi16(255);
    __m128i e0 = _mm_set1_epi16((short)(-TXS_ZERO * count)), e1 = e0, e2 = e0, e3 = e0;
    for (int i = 0; i < count; i += 2) {
        __m128i a = _mm_add_epi8(txs_load(rows[i]), txs_load(rows[i + 1]));
        __m128i b = _mm_add_epi8(txs_load(rows[i] + 16), txs_load(rows[i + 1] + 16));
        e0 = _mm_add_epi16(e0, _mm_and_si128(a, low));
        e1 = _mm_add_epi16(e1, _mm_and_si128(b, low));
        e2 = _mm_add_epi16(e2, _mm_srli_epi16(a, 8));
        e3 = _mm_add_epi16(e3, _mm_srli_epi16(b, 8));
    }
#define TXS_FINISH(e, k) \
    _mm_add_epi16(_mm_slli_epi16(e, 2), _mm_add_epi16(txs_load(single + (k)), txs_load(noise + (k))))
    e0 = TXS_FINISH(e0, 0);
    e1 = TXS_FINISH(e1, 8);
    e2 = TXS_FINISH(e2, 16);
    e3 = TXS_FINISH(e3, 24);
#undef TXS_FINISH
    __m128i m = txs_least(_mm_min_epi16(_mm_min_epi16(e0, e1), _mm_min_epi16(e2, e3)));
    int first = _mm_movemask_epi8(_mm_packs_epi16(_mm_cmpeq_epi16(e0, m), _mm_cmpeq_epi16(e1, m)));
    int last = _mm_movemask_epi8(_mm_packs_epi16(_mm_cmpeq_epi16(e2, m), _mm_cmpeq_epi16(e3, m)));
    return txs_slot_value(txm_lowest_bit((unsigned)first | (unsigned)last << 16));
}
#endif

#ifdef TXS_AVX2
__attribute__((target("avx2"))) static int
txs_pick_avx2(const uint8_t *const *rows, int count, const int16_t *single, const int16_t *noise) {
    const __m256i low = _mm256_set1_epi16(255);
    __m256i e0 = _mm256_set1_epi16((short)(-TXS_ZERO * count)), e1 = e0;
    for (int i = 0; i < count; i += 2) {
        __m256i a = _mm256_add_epi8(_mm256_loadu_si256((const __m256i *)(const void *)rows[i]),
                                    _mm256_loadu_si256((const __m256i *)(const void *)rows[i + 1]));
        e0 = _mm256_add_epi16(e0, _mm256_and_si256(a, low));
        e1 = _mm256_add_epi16(e1, _mm256_srli_epi16(a, 8));
    }
    const __m256i *s = (const __m256i *)(const void *)single,
                  *n = (const __m256i *)(const void *)noise;
    e0 = _mm256_add_epi16(_mm256_slli_epi16(e0, 2),
                          _mm256_add_epi16(_mm256_loadu_si256(s), _mm256_loadu_si256(n)));
    e1 = _mm256_add_epi16(_mm256_slli_epi16(e1, 2),
                          _mm256_add_epi16(_mm256_loadu_si256(s + 1), _mm256_loadu_si256(n + 1)));
    __m256i w = _mm256_min_epi16(e0, e1);
    __m128i m = _mm_min_epi16(_mm256_castsi256_si128(w), _mm256_extracti128_si256(w, 1));
    m = _mm_min_epi16(m, _mm_shuffle_epi32(m, 0x4e));
    m = _mm_min_epi16(m, _mm_shuffle_epi32(m, 0xb1));
    m = _mm_min_epi16(m, _mm_shufflehi_epi16(_mm_shufflelo_epi16(m, 0xb1), 0xb1));
    w = _mm256_broadcastsi128_si256(m);
    w = _mm256_packs_epi16(_mm256_cmpeq_epi16(e0, w), _mm256_cmpeq_epi16(e1, w));
    w = _mm256_permute4x64_epi64(w, 0xd8);
    return txs_slot_value(__builtin_ctz((unsigned)_mm256_movemask_epi8(w)));
}
#endif

static txs_pick *txs_best_pick(void) {
#ifdef TXS_AVX2
    if (__builtin_cpu_supports("avx2")) return txs_pick_avx2;
#endif
#ifdef TXS_SSE2
    return txs_pick_sse2;
#else
    return txs_pick_plain;
#endif
}

/* ---- potentials ---------------------------------------------------------------------------

   Every potential is controlled:

       V = integral + proportional gain * (h - h_ref),

   h the current histogram of the canvas, h_ref the example's, so that the energy of values that are
   too frequent rises; the integral part follows the error once a sweep. [1] derives the potentials
   from the statistics; controlling them needs far fewer sweeps.                              */

/* Minus a Gumbel variable, shuffled: entries i..i+31 for a random i are a noise row. */
static void txs_noise_table(int16_t *noise) {
    txm_rng rng = txm_rng_make(1, 2);
    for (int i = 0; i < TXS_NOISE; i++) {
        double gumbel = log(-log((i + 0.5) / (double)TXS_NOISE));
        int j = (int)txm_rng_below(&rng, (uint32_t)i + 1);
        noise[i] = noise[j];
        noise[j] = (int16_t)floor(gumbel * (TXS_NAT * TXS_FINE) + 0.5);
    }
    memcpy(noise + TXS_NOISE, noise, TXS_VALUES * sizeof *noise);
}

/* The ends of a clique type on a canvas of so many bands, each with the band it lies in and its
   form; returns how many. Their rows lie in the type's tables, TXS_TABLE bytes. */
static int txs_type_ends(const txs_level *level, const txs_type *t, const uint8_t *tables,
                         const txs_canvas *c, int bands, txs_end ends[4], int band[4],
                         int form[4]) {
    const ptrdiff_t tail = t->band * c->plane, head = t->other * c->plane;
    const ptrdiff_t parent = (bands + t->other) * c->plane;
    const ptrdiff_t d = t->dy * c->stride + t->dx, e = t->ey * c->stride + t->ex;
    const uint8_t *table = tables + 31;
    const ptrdiff_t block = TXS_CLASSES * TXS_ROW;
    for (int i = 0; i < 4; i++) {
        memset(&ends[i], 0, sizeof ends[i]);
        band[i] = t->band;
        form[i] = 1;
        ends[i].table = table + i * block;
    }
    switch (t->kind) {
    case TEXSYN_SINGLE: return 0;
    case TEXSYN_PAIR: /* the head, the tail */
        form[0] = form[1] = 0;
        band[0] = t->other;
        ends[0].o1 = tail - d;
        ends[1].o1 = head + d;
        ends[1].table = table + TXS_ROW;
        return 2;
    case TEXSYN_PARENT:
        form[0] = 0;
        ends[0].o1 = parent;
        ends[0].table = table + TXS_ROW;
        return 1;
    case TEXSYN_VALUES:
        form[0] = form[1] = 3;
        ends[0].o1 = head + d;
        ends[0].classes = level->classes[t->other];
        ends[0].table = table - 31;
        band[1] = t->other;
        ends[1].o1 = tail - d;
        ends[1].classes = level->classes[t->band];
        ends[1].table = table - 31 + TXS_CLASSES * TXS_VALUES;
        return 2;
    case TEXSYN_CORNER: /* the arms, the corner */
        ends[0].o1 = ends[0].o3 = tail - d;
        ends[0].o2 = tail + e - d;
        ends[1].o1 = ends[1].o3 = tail - e;
        ends[1].o2 = tail + d - e;
        form[2] = 2;
        ends[2].o1 = tail + d;
        ends[2].o2 = tail + e;
        ends[2].table = table + 2 * block + 31 * TXS_ROW;
        return 3;
    case TEXSYN_SCALE: /* the head, the tail */
        ends[0].o1 = tail - d;
        ends[0].o2 = parent + e - d;
        ends[0].o3 = parent - e;
        ends[1].o1 = tail + d;
        ends[1].o2 = parent + e;
        ends[1].o3 = parent + d - e;
        return 2;
    default: /* TEXSYN_PARALLEL: head and tail of the one difference, of the other */
        ends[0].o1 = tail - d;
        ends[0].o2 = head + e;
        ends[0].o3 = head + e - d;
        ends[1].o1 = tail + d;
        ends[1].o2 = head + e + d;
        ends[1].o3 = head + e;
        band[2] = band[3] = t->other;
        ends[2].o1 = head - d;
        ends[2].o2 = tail - e;
        ends[2].o3 = tail - e - d;
        ends[3].o1 = head + d;
        ends[3].o2 = tail - e + d;
        ends[3].o3 = tail - e;
        return 4;
    }
}

/* Ends that a level's types put into one band, at most; a model must stay within TXS_MAX_ENDS. */
static int txs_most_ends(const txs_level *level, int bands) {
    int count[TXS_MAX_BANDS] = {0}, most = 0;
    for (int k = 0; k < level->type_count; k++) {
        const txs_type *t = &level->types[k];
        static const int tail[] = {0, 1, 1, 1, 3, 2, 2}, head[] = {0, 1, 0, 1, 0, 0, 2};
        count[t->band] += tail[t->kind];
        count[t->other] += head[t->kind];
    }
    for (int b = 0; b < bands; b++)
        if (count[b] > most) most = count[b];
    return most;
}

/* Spread the potential v of a type (as bytes of rows) over the tables of its ends. */
static void txs_expand(const txs_level *level, const txs_type *t, const uint8_t *v,
                       uint8_t *table) {
    const uint8_t *class_of = txs_difference_class;
    enum { N = TXS_CLASSES, ROW = TXS_ROW, BLOCK = TXS_CLASSES * TXS_ROW };
    switch (t->kind) {
    case TEXSYN_PAIR:
    case TEXSYN_PARENT:
        for (int i = 0; i < TXS_DIFFERENCES; i++) {
            table[i] = v[i];
            table[ROW + i] = v[TXS_DIFFERENCES - 1 - i];
        }
        break;
    case TEXSYN_VALUES:
        for (int q = 0; q < N; q++) {
            for (int i = 0; i < TXS_VALUES; i++) {
                table[q * TXS_VALUES + i] = v[level->classes[t->band][i] * N + q];
                table[(N + q) * TXS_VALUES + i] = v[q * N + level->classes[t->other][i]];
            }
        }
        break;
    case TEXSYN_CORNER:
        for (int q = 0; q < N; q++) {
            for (int i = 0; i < TXS_DIFFERENCES; i++) {
                table[q * ROW + i] = v[class_of[i] * N + q];
                table[BLOCK + q * ROW + i] = v[q * N + class_of[i]];
            }
        }
        for (int delta = -31; delta <= 31; delta++) { /* difference 31 - i on one arm, delta more
                                                         on the other */
            uint8_t *row = table + 2 * BLOCK + (delta + 31) * ROW;
            for (int i = 0; i < TXS_DIFFERENCES; i++)
                row[i] = v[class_of[62 - i] * N + class_of[txm_clampi(62 - i + delta, 0, 62)]];
        }
        break;
    default: /* TEXSYN_SCALE and, with the ends of the other difference, TEXSYN_PARALLEL */
        for (int q = 0; q < N; q++) {
            for (int i = 0; i < TXS_DIFFERENCES; i++) {
                table[q * ROW + i] = v[class_of[i] * N + q];
                table[BLOCK + q * ROW + i] = v[class_of[62 - i] * N + q];
                if (t->kind == TEXSYN_SCALE) continue;
                table[2 * BLOCK + q * ROW + i] = v[q * N + class_of[i]];
                table[3 * BLOCK + q * ROW + i] = v[q * N + class_of[62 - i]];
            }
        }
    }
}

/* How strongly the errors of a histogram act on its potential. */
typedef struct txs_gain {
    int proportional, integral; /* 1/TXS_WHOLE nat per unit of error, the latter once a sweep */
} txs_gain;

enum { TXS_WHOLE = 256 };

/* Control one type: its potential v, in steps of 1/(TXS_NAT TXS_PRECISE) nat, from the errors of
   its histogram; integrate as well if it is time. */
static void txs_steer(const txs_type *t, txs_gain gain, int integrate, const int32_t *histogram,
                      int32_t *integral, int32_t *v) {
    const int nat = TXS_NAT * TXS_PRECISE, bins = txs_bin_count(t->kind);
    const int32_t limit = (t->kind == TEXSYN_SINGLE ? 10 * TXS_NAT : 63) * TXS_PRECISE;
    int64_t total = 1;
    for (int i = 0; i < bins; i++) total += histogram[i];
    const int64_t scale = ((int64_t)TXS_ONE << 24) / total;
    for (int i = 0; i < bins; i++) {
        int32_t error = (int32_t)((histogram[i] * scale) >> 24) - t->share[i];
        int32_t pull = error * nat / TXS_ONE; /* for a gain of 1 nat per unit of error */
        if (integrate)
            integral[i] = txm_clampi(integral[i] + gain.integral * pull / TXS_WHOLE, -limit, limit);
        v[i] = txm_clampi(integral[i] + gain.proportional * pull / TXS_WHOLE, -limit, limit);
    }
}

/* Put a steered potential where the sampler looks it up: that of a single into the words that a
   candidate's energy starts from, any other into the tables of the ends. */
static void txs_publish(const txs_level *level, const txs_type *t, const int32_t *v,
                        int16_t single[TXS_VALUES], uint8_t *table) {
    uint8_t row[TXS_BINS];
    for (int i = 0; i < txs_bin_count(t->kind); i++) {
        if (t->kind == TEXSYN_SINGLE)
            single[(i >> 1) + (i & 1) * 16] =
                (int16_t)(i < level->values[t->band] ? v[i] / (TXS_PRECISE / TXS_FINE) : TXS_NEVER);
        else row[i] = (uint8_t)((v[i] + TXS_ZERO * TXS_PRECISE) / TXS_PRECISE);
    }
    if (t->kind != TEXSYN_SINGLE) txs_expand(level, t, row, table);
}

/* ---- the sampler --------------------------------------------------------------------------

   Gibbs sampling of a canvas, which is a torus, with controlled potentials.

   Order and threads. A sweep visits one sub-lattice (x, y modulo 8) after another. The canvas is
   divided into an even number of strips at least as high as a clique; all even strips are processed
   in parallel, then all odd ones, so that no pixel changes while another thread reads it, and the
   result does not depend on the number of threads.                                          */

/* The ends of cliques at a pixel, and the clique types that have a tail there. */
typedef struct txs_list {
    txs_end ends[TXS_MAX_BANDS][TXS_MAX_ENDS]; /* sorted by form */
    int end_count[TXS_MAX_BANDS][TXS_FORMS];
    txs_tally tally[TXS_MAX_TYPES]; /* sorted by form */
    int tally_count[TXS_FORMS];
} txs_list;

typedef struct txs_sampler {
    const txs_level *level;
    const txs_canvas *canvas;
    int bands;
    uint64_t seed;
    txs_pick *pick;
    txs_list list[4]; /* for pixels of each parity, (x & 1) + 2 (y & 1)   */
    int16_t single[TXS_MAX_BANDS][TXS_VALUES];
    uint8_t *tables;                /* TXS_TABLE bytes a type               */
    int32_t (*histogram)[TXS_BINS]; /* TXS_WINDOW times the counts of the last sweep */
    int32_t (*integral)[TXS_BINS];  /* 1/(TXS_NAT TXS_PRECISE) nat          */
    int32_t (*counts)[TXS_BINS];    /* TXS_TASKS times all types            */
    const int16_t *noise;
    int strips, tasks, skip;          /* layout; one pixel in skip is counted */
    int sublattice[TXS_GROUP], phase; /* of the pass                          */
    uint64_t pass, sweep;
} txs_sampler;

/* Set all tables from the histograms' errors; integrate as well if it is time. */
static void txs_control(txs_sampler *s, int integrate) {
    const txs_gain gain = {(int)TXS_PROPORTIONAL * TXS_WHOLE, (int)TXS_INTEGRAL * TXS_WHOLE};
    for (int k = 0; k < s->level->type_count; k++) {
        const txs_type *t = &s->level->types[k];
        int32_t v[TXS_BINS];
        txs_steer(t, gain, integrate, s->histogram[k], s->integral[k], v);
        txs_publish(s->level, t, v, s->single[t->band], s->tables + (size_t)k * TXS_TABLE);
    }
}

/* Count the cliques whose tail is p. */
static void txs_count(const txs_list *list, const uint8_t *p, int32_t (*counts)[TXS_BINS]) {
    const txs_tally *t = list->tally, *stop = t + list->tally_count[0];
    for (; t < stop; t++) counts[t->type][p[t->a]]++;
    for (stop += list->tally_count[1]; t < stop; t++) counts[t->type][p[t->a] - p[t->b] + 31]++;
    for (stop += list->tally_count[2]; t < stop; t++)
        counts[t->type][t->ca[p[t->a]] * TXS_CLASSES + t->cb[p[t->b]]]++;
    for (stop += list->tally_count[3]; t < stop; t++)
        counts[t->type]
              [txs_class(p[t->a] - p[t->b]) * TXS_CLASSES + txs_class(p[t->c] - p[t->d])]++;
}

static const txs_list *txs_list_at(const txs_sampler *s, int x, int y) {
    const int px = x + (x >= s->canvas->slip_x), py = y + (y >= s->canvas->slip_y);
    return &s->list[(px & 1) + 2 * (py & 1)];
}

static int txs_is_counted(const txs_sampler *s, int x, int y) {
    return s->skip == 1 || (unsigned)(x / TXS_GRID + 3 * (y / TXS_GRID)) % (unsigned)s->skip == 0;
}

/* Draw new values for count pixels of a row, TXS_GRID apart. No clique contains two of them
   (except across the border of a torus whose width is not a multiple of the grid), so the result
   is the same as drawing one after another; drawing them together keeps the data of an end in
   registers. */
static void txs_visit(const txs_sampler *s, int x, int y, int count, txm_rng *rng) {
    const uint8_t *rows[TXS_TOGETHER][TXS_MAX_ENDS + 2];
    const uint8_t *p = txs_at(s->canvas, 0, x, y);
    const txs_list *list = txs_list_at(s, x, y);
    for (int b = 0; b < s->bands; b++) {
        const txs_end *e = list->ends[b], *stop = e + list->end_count[b][0];
        int n = 0;
        for (; e < stop; e++, n++) {
            const uint8_t *p1 = p + e->o1, *table = e->table;
            for (int i = 0; i < count; i++) rows[i][n] = table - p1[i * TXS_GRID];
        }
        for (stop += list->end_count[b][1]; e < stop; e++, n++) {
            const uint8_t *p1 = p + e->o1, *p2 = p + e->o2, *p3 = p + e->o3, *table = e->table;
            for (int i = 0; i < count; i++) {
                int known = txs_class(p2[i * TXS_GRID] - p3[i * TXS_GRID]);
                rows[i][n] = table + known * TXS_ROW - p1[i * TXS_GRID];
            }
        }
        for (stop += list->end_count[b][2]; e < stop; e++, n++) {
            const uint8_t *p1 = p + e->o1, *p2 = p + e->o2, *table = e->table;
            for (int i = 0; i < count; i++) {
                int arm = p1[i * TXS_GRID];
                rows[i][n] = table + (p2[i * TXS_GRID] - arm) * TXS_ROW - arm;
            }
        }
        for (stop += list->end_count[b][3]; e < stop; e++, n++) {
            const uint8_t *p1 = p + e->o1, *classes = e->classes, *table = e->table;
            for (int i = 0; i < count; i++)
                rows[i][n] = table + classes[p1[i * TXS_GRID]] * TXS_VALUES;
        }
        for (int i = 0; i < count; i++) {
            rows[i][n] = txs_no_energy;
            int v = s->pick(rows[i], (n + 1) & ~1, s->single[b],
                            s->noise + (txm_rng_next(rng) & (TXS_NOISE - 1)));
            if (v >= s->level->values[b]) v = s->level->values[b] - 1;
            txs_set(s->canvas, b, x + i * TXS_GRID, y, (uint8_t)v);
        }
    }
}

/* One share of a pass: some of the strips of this phase, the group's sub-lattices in turn. */
static void txs_work(void *context, int task) {
    const txs_sampler *s = (const txs_sampler *)context;
    const int height = s->canvas->height, width = s->canvas->width;
    const int half = s->strips > 1 ? s->strips / 2 : 1;
    int32_t(*counts)[TXS_BINS] = s->counts + task * s->level->type_count;
    for (int i = half * task / s->tasks; i < half * (task + 1) / s->tasks; i++) {
        int strip = s->strips > 1 ? 2 * i + s->phase : 0;
        int top = (int)((int64_t)height * strip / s->strips);
        int bottom = (int)((int64_t)height * (strip + 1) / s->strips);
        for (int j = 0; j < TXS_GROUP; j++) {
            int sx = s->sublattice[j] % TXS_GRID, sy = s->sublattice[j] / TXS_GRID;
            for (int y = top + txs_mod(sy - top, TXS_GRID); y < bottom; y += TXS_GRID) {
                txm_rng rng =
                    txm_rng_make(s->seed ^ (s->pass * TXS_GROUP + (uint64_t)j) << 24, (uint64_t)y);
                for (int x = sx, n; x < width; x += n * TXS_GRID) {
                    const int stop = x < s->canvas->slip_x ? s->canvas->slip_x : width;
                    n = (stop - x + TXS_GRID - 1) / TXS_GRID; /* all of one parity */
                    if (n > TXS_TOGETHER) n = TXS_TOGETHER;
                    txs_visit(s, x, y, n, &rng);
                }
                for (int x = sx; x < width; x += TXS_GRID)
                    if (txs_is_counted(s, x, y))
                        txs_count(txs_list_at(s, x, y), txs_at(s->canvas, 0, x, y), counts);
            }
        }
    }
}

/* Bring the counts of a pass into the running histograms, which forget at the same rate. */
static void txs_gather(txs_sampler *s, int passes) {
    const int types = s->level->type_count;
    const int64_t keep = TXS_ONE - TXS_ONE / passes;
    for (int task = 1; task < s->tasks; task++)
        for (int k = 0; k < types; k++)
            for (int i = 0; i < TXS_BINS; i++) s->counts[k][i] += s->counts[task * types + k][i];
    for (int k = 0; k < types; k++)
        for (int i = 0; i < TXS_BINS; i++)
            s->histogram[k][i] =
                (int32_t)((s->histogram[k][i] * keep) >> 16) + s->counts[k][i] * TXS_WINDOW;
    memset(s->counts, 0, sizeof *s->counts * (size_t)(types * s->tasks));
}

/* Visit every pixel once. Progress from..to of the whole work. */
static txm_status txs_sweep(txs_sampler *s, txm_env *env, const char *stage, float from, float to) {
    enum { ALL = TXS_GRID * TXS_GRID };
    const int phases = s->strips > 1 ? 2 : 1, groups = (int)ALL / TXS_GROUP;
    int order[ALL];
    txm_rng rng = txm_rng_make(s->seed, ~s->sweep++);
    for (int i = 0; i < ALL; i++) order[i] = i;
    txm_shuffle(&rng, order, ALL);
    for (int group = 0; group < groups; group++, s->pass++) {
        if (txm_progress(env, from + (to - from) * (float)group / (float)groups, stage))
            return txm_fail(env, TXM_CANCELLED, "stopped by the progress callback");
        memcpy(s->sublattice, order + group * TXS_GROUP, sizeof s->sublattice);
        /* Both phases use the same potentials: if they were updated in between, even and odd strips
           would compensate for each other and could drift apart permanently. */
        for (s->phase = 0; s->phase < phases; s->phase++)
            txm_parallel_for(env, s->tasks, txs_work, s);
        txs_gather(s, groups);
        txs_control(s, group + 1 == groups);
    }
    return TXM_OK;
}

/* Ends and tallies of the pixels with parities px, py. */
static void txs_list_fill(txs_sampler *s, int px, int py) {
    txs_list *list = &s->list[px + 2 * py];
    for (int form = 0, filled = 0; form < TXS_FORMS; form++) {
        for (int k = 0; k < s->level->type_count; k++) {
            const txs_type *t = &s->level->types[k];
            txs_tally tally = txs_tally_make(t, s->level, s->canvas, s->bands);
            txs_end ends[4];
            int band[4], forms[4],
                n = txs_type_ends(s->level, t, s->tables + (size_t)k * TXS_TABLE, s->canvas,
                                  s->bands, ends, band, forms);
            for (int i = 0; i < n; i++) {
                int *count = list->end_count[band[i]];
                /* of a pair, end 0 is the head; only pairs have a phase */
                if (forms[i] != form || !txs_is_tail(t, px - (i ? 0 : t->dx), py - (i ? 0 : t->dy)))
                    continue;
                list->ends[band[i]][count[0] + count[1] + count[2] + count[3]] = ends[i];
                count[form]++;
            }
            if (tally.form != form || !txs_is_tail(t, px, py)) continue;
            tally.type = k;
            list->tally[filled++] = tally;
            list->tally_count[form]++;
        }
    }
}

/* Lay out the work for the level's types as they are now, and count the canvas as it is. */
static void txs_sampler_start(txs_sampler *s) {
    const txs_canvas *c = s->canvas;
    const int types = s->level->type_count;
    int reach = 16; /* a strip is at least this high: less is too little work for a thread */
    for (int k = 0; k < types; k++)
        if (txs_reach(&s->level->types[k]) > reach) reach = txs_reach(&s->level->types[k]);
    memset(s->list, 0, sizeof s->list);
    for (int parity = 0; parity < 4; parity++) txs_list_fill(s, parity & 1, parity >> 1);
    const int64_t pixels = (int64_t)c->width * c->height;
    s->strips = c->height / reach & ~1;
    if (s->strips < 2) s->strips = 1;
    s->tasks = s->strips > 1 ? s->strips / 2 : 1;
    if (s->tasks > TXS_TASKS) s->tasks = TXS_TASKS;
    s->skip = pixels > TXS_SAMPLES ? (int)(pixels / TXS_SAMPLES) : 1;
    if (s->skip > 2048) s->skip = 2048; /* else txs_is_counted would find almost none */

    memset(s->histogram, 0, sizeof *s->histogram * (size_t)types);
    memset(s->counts, 0, sizeof *s->counts * (size_t)(types * s->tasks));
    for (int y = 0; y < c->height; y++)
        for (int x = 0; x < c->width; x++)
            if (txs_is_counted(s, x, y))
                txs_count(txs_list_at(s, x, y), txs_at(c, 0, x, y), s->histogram);
    for (int k = 0; k < types; k++)
        for (int i = 0; i < TXS_BINS; i++) s->histogram[k][i] *= TXS_WINDOW;
    txs_control(s, 0);
}

/* A sampler in the arena's memory; NULL if there is none. Call txs_sampler_start before use. */
static txs_sampler *txs_sampler_make(txm_arena *arena, const txs_level *level, int max_types,
                                     const txs_canvas *canvas, int bands, const int16_t *noise,
                                     uint64_t seed) {
    const size_t n = (size_t)max_types;
    txs_sampler *s = (txs_sampler *)txm_arena_zero(arena, 1, sizeof *s);
    if (!s) return NULL;
    s->level = level;
    s->canvas = canvas;
    s->bands = bands;
    s->seed = txm_hash(seed);
    s->pick = txs_best_pick();
    s->noise = noise;
    s->tables = (uint8_t *)txm_arena_zero(arena, n, TXS_TABLE);
    s->histogram = (int32_t(*)[TXS_BINS])txm_arena_zero(arena, n, sizeof *s->histogram);
    s->integral = (int32_t(*)[TXS_BINS])txm_arena_zero(arena, n, sizeof *s->integral);
    s->counts = (int32_t(*)[TXS_BINS])txm_arena_zero(arena, n * TXS_TASKS, sizeof *s->counts);
    if (arena->failed) return NULL;
    for (int k = 0; k < level->type_count; k++)
        for (int i = 0; i < TXS_BINS; i++)
            s->integral[k][i] = level->types[k].potential[i] * TXS_PRECISE;
    return s;
}

/* ---- the example --------------------------------------------------------------------------

   The example becomes planes of decorrelated bands (principal components of the colours; alpha
   stays by itself), then a pyramid of them, each level quantised to at most 32 values. */

typedef struct txs_source { /* one level of the example */
    int width, height;
    float *value;      /* planes                                               */
    uint8_t *mask;     /* non-zero: belongs to the texture; NULL = all do      */
    txs_canvas canvas; /* quantised, margin 0                                  */
    int step;          /* statistics are taken from every step-th row          */
} txs_source;

/* Principal components of the colours inside the mask. Rounded as the model file keeps them. */
static void txs_find_bands(texsyn_model *m, const txm_image *im, const txs_source *s) {
    const int colours = m->channels < 3 ? 1 : 3;
    const size_t pixels = (size_t)s->width * (size_t)s->height;
    double mean[4] = {0, 0, 0, 0}, square[4] = {0, 0, 0, 0}, cov[6] = {0, 0, 0, 0, 0, 0};
    double values[3], vectors[3][3], count = 0;
    for (int pass = 0; pass < 2; pass++) {
        for (size_t i = 0; i < pixels; i++) {
            double x[4];
            if (s->mask && !s->mask[i]) continue;
            for (int c = 0; c < m->channels; c++)
                x[c] = 255.0 * (double)txm_image_get(im, (int)(i % (size_t)s->width),
                                                     (int)(i / (size_t)s->width), c) -
                       mean[c];
            for (int c = 0; c < m->channels && !pass; c++) square[c] += x[c];
            count += !pass;
            for (int c = 0, k = 0; c < 3 && pass; c++)
                for (int d = c; d < 3; d++, k++)
                    if (d < colours) cov[k] += x[c] * x[d] / count;
            if (pass && m->channels == 4) square[3] += x[3] * x[3] / count;
        }
        for (int c = 0; c < m->channels && !pass; c++) {
            mean[c] = (double)(m->mean[c] = txs_short_float((float)(square[c] / count)));
            square[c] = 0;
        }
    }
    txm_eigen3(cov, values, vectors);
    m->bands = 0;
    for (int k = 0; k < colours; k++) { /* bands with no visible variance are left out */
        if (values[k] < 0.05 && m->bands > 0) break;
        for (int c = 0; c < colours; c++)
            m->basis[m->bands][c] =
                (float)floor((colours == 1 ? 1 : vectors[k][c]) * 16384 + 0.5) / 16384;
        m->bands++;
    }
    if (m->channels == 4 && square[3] >= 0.05) m->basis[m->bands++][3] = 1;
}

/* The bands of the example at full resolution. */
static void txs_split(const texsyn_model *m, const txm_image *im, txs_source *s) {
    float *out = s->value;
    for (int b = 0; b < m->bands; b++) {
        for (int y = 0; y < s->height; y++) {
            for (int x = 0; x < s->width; x++) {
                double v = 0;
                for (int c = 0; c < m->channels; c++)
                    v += (double)m->basis[b][c] *
                         (255.0 * (double)txm_image_get(im, x, y, c) - (double)m->mean[c]);
                *out++ = txm_float(v);
            }
        }
    }
}

/* The next coarser level: means of 2 x 2; a pixel belongs to the texture if all four do. */
static void txs_halve(const txs_source *fine, txs_source *s, int bands) {
    const size_t w = (size_t)fine->width;
    float *out = s->value;
    for (int b = 0; b < bands; b++) {
        const float *plane = fine->value + (size_t)b * w * (size_t)fine->height;
        for (int y = 0; y < s->height; y++) {
            for (int x = 0; x < s->width; x++) {
                const float *p = plane + (size_t)(2 * y) * w + 2 * (size_t)x;
                *out++ =
                    txm_float(((double)p[0] + (double)p[1] + (double)p[w] + (double)p[w + 1]) / 4);
            }
        }
    }
    for (int y = 0; y < s->height && s->mask; y++) {
        for (int x = 0; x < s->width; x++) {
            const uint8_t *p = fine->mask + (size_t)(2 * y) * w + 2 * (size_t)x;
            s->mask[(size_t)y * (size_t)s->width + (size_t)x] = p[0] && p[1] && p[w] && p[w + 1];
        }
    }
}

/* the value's level, 0..values-1 */
static int txs_quantise(const txs_level *l, int band, double value) {
    double q = floor((value - (double)l->low[band]) / (double)l->step[band] + 0.5);
    return q < 0 ? 0 : q >= l->values[band] ? l->values[band] - 1 : (int)q;
}

static double txs_value(const txs_level *l, int band, double q) {
    return (double)l->low[band] + q * (double)l->step[band];
}

/* Choose the quantisation of a band: 32 steps between the 0.1 and 99.9 percentiles, but no finer
   than one gray level; and quantise. Returns the share of a step that the values fill. */
static float txs_quantise_band(txs_level *l, int band, txs_source *s) {
    enum { FINE = 4096 };
    const size_t pixels = (size_t)s->width * (size_t)s->height;
    const float *v = s->value + (size_t)band * pixels;
    uint8_t *q = s->canvas.pixels + band * s->canvas.plane;
    double low = 1e300, high = -1e300;
    size_t count = 0, seen = 0, histogram[FINE] = {0};
    for (size_t i = 0; i < pixels; i++) {
        if (s->mask && !s->mask[i]) continue;
        low = (double)v[i] < low ? (double)v[i] : low;
        high = (double)v[i] > high ? (double)v[i] : high;
        count++;
    }
    const double bin = (high - low) / (double)FINE;
    for (size_t i = 0; i < pixels && bin > 0; i++)
        if (!s->mask || s->mask[i])
            histogram[txm_clampi((int)(((double)v[i] - low) / bin), 0, FINE - 1)]++;
    double from = low, to = high;
    for (int i = 0; i < FINE && bin > 0; i++) {
        if (seen <= count / 1000) from = low + bin * i;
        if (seen < count - count / 1000) to = low + bin * (i + 1);
        seen += histogram[i];
    }
    double step = (to - from) / (TXS_VALUES - 1);
    if (step < 1) step = 1;
    l->values[band] = txm_clampi((int)ceil((to - from) / step - 1e-6) + 1, 1, TXS_VALUES);
    l->step[band] = txs_short_float((float)step);
    l->low[band] = txs_short_float((float)((from + to - step * (l->values[band] - 1)) / 2));

    double spread = 0;
    for (size_t i = 0; i < pixels; i++) {
        q[i] = (uint8_t)txs_quantise(l, band, (double)v[i]);
        double off = ((double)v[i] - txs_value(l, band, q[i])) / (double)l->step[band];
        if ((!s->mask || s->mask[i]) && fabs(off) <= 0.5) spread += off * off;
    }
    double fill = sqrt(12 * spread / (double)count); /* 1 if evenly spread over the steps */
    return (float)floor((fill > 1 ? 1 : fill) * 255 + 0.5) / 255;
}

/* Where pixel x of a row of `fine` lies on a row of `coarse` that is half as long: the nearest
   pixel, its neighbour on the other side, and as the result the weight of the latter in quarters. A
   torus of odd width lies on a coarse one that is half a pixel too long, so positions are
   compressed by a quarter of a pixel at each of two places far from the border, which avoids a seam
   there. From the first of these places on, parities swap. */
static int txs_place(int x, int fine, int coarse, int wrap, int where[2]) {
    int at = 2 * x + 1; /* in quarters of a coarse pixel, from the border */
    if (fine == 2 * coarse - 1) at = (int)(((int64_t)at * 2 * coarse + coarse - 1) / fine);
    const int off = at % 4 - 2; /* -2..1 */
    where[0] = wrap ? at / 4 % coarse : txm_clampi(at / 4, 0, coarse - 1);
    where[1] = where[0] + (off > 0 ? 1 : -1);
    if (!wrap) where[1] = txm_clampi(where[1], 0, coarse - 1);
    return abs(off);
}

/* Fill the parent planes of a canvas with the coarser level above, bilinearly, in this level's
   steps. At the borders the coarse canvas wraps if it has a margin, else its last row is
   repeated. */
static void txs_fill_parent(const txs_level *above, const txs_canvas *coarse,
                            const txs_level *level, txs_canvas *canvas, int bands) {
    if (canvas->width == 2 * coarse->width - 1) canvas->slip_x = coarse->width / 2;
    if (canvas->height == 2 * coarse->height - 1) canvas->slip_y = coarse->height / 2;
    for (int b = 0; b < bands; b++) {
        uint8_t map[16 * TXS_VALUES];
        for (int q = 0; q < 16 * TXS_VALUES; q++)
            map[q] = (uint8_t)txs_quantise(level, b, txs_value(above, b, q / 16.0));
        for (int y = 0; y < canvas->height; y++) {
            const int wrap = coarse->margin > 0;
            int cy[2], cx[2];
            const int v = txs_place(y, canvas->height, coarse->height, wrap, cy), w = 4 - v;
            const uint8_t *near_ = txs_at(coarse, b, 0, cy[0]), *far_ = txs_at(coarse, b, 0, cy[1]);
            uint8_t *to = txs_at(canvas, bands + b, 0, y);
            for (int x = 0; x < canvas->width; x++) {
                const int u = txs_place(x, canvas->width, coarse->width, wrap, cx), t = 4 - u;
                to[x] = map[w * (t * near_[cx[0]] + u * near_[cx[1]]) +
                            v * (t * far_[cx[0]] + u * far_[cx[1]])];
            }
        }
        txs_wrap(canvas, bands + b);
    }
}

/* Start the synthesis of a level: from what is above, or from even noise (step 2 of [1]). */
static void txs_start_canvas(const txs_level *level, const txs_canvas *canvas, int bands,
                             int has_parent, uint64_t seed) {
    txm_rng rng = txm_rng_make(seed, 3);
    for (int b = 0; b < bands; b++) {
        for (int y = 0; y < canvas->height; y++) {
            uint8_t *row = txs_at(canvas, b, 0, y);
            for (int x = 0; x < canvas->width; x++)
                row[x] = has_parent ? row[bands * canvas->plane + x]
                                    : (uint8_t)txm_rng_below(&rng, (uint32_t)level->values[b]);
        }
        txs_wrap(canvas, b);
    }
}

/* ---- statistics of an image ------------------------------------------------------------- */

/* Histogram of a clique type over a canvas: of the example, cliques that lie inside image and
   mask; of a synthesised canvas (wrap) all of them. Every step-th row. Returns the number of
   cliques; share[] sums to about TXS_ONE. */
static int64_t txs_measure(const txs_canvas *c, const uint8_t *mask, int wrap, int step, int bands,
                           const txs_level *level, const txs_type *t, int32_t share[TXS_BINS]) {
    int at[4][2], members = txs_members(t, at), x0 = 0, y0 = 0, x1 = c->width, y1 = c->height;
    uint32_t h[2][TXS_BINS + 15];
    const txs_tally y = txs_tally_make(t, level, c, bands);
    int64_t total = 0;
    memset(h, 0, sizeof h);
    for (int i = 0; i < members && !wrap; i++) {
        if (-at[i][0] > x0) x0 = -at[i][0];
        if (c->width - at[i][0] < x1) x1 = c->width - at[i][0];
        if (-at[i][1] > y0) y0 = -at[i][1];
        if (c->height - at[i][1] < y1) y1 = c->height - at[i][1];
    }
    for (int row = y0; row < y1; row += step) {
        const uint8_t *p = txs_at(c, 0, 0, row);
        if (mask || t->phase) {
            for (int x = x0; x < x1; x++) {
                int inside = txs_is_tail(t, x, row);
                for (int i = 0; i < members && mask; i++)
                    inside &= mask[(ptrdiff_t)(row + at[i][1]) * c->width + x + at[i][0]] != 0;
                if (inside) h[0][txs_bin(&y, p + x)]++;
            }
        } else if (y.form == 1) {
            const uint8_t *a = p + y.a, *b = p + y.b;
            for (int x = x0; x < x1; x++) h[x & 1][a[x] - b[x] + 31]++;
        } else if (y.form == 2) {
            const uint8_t *a = p + y.a, *b = p + y.b;
            for (int x = x0; x < x1; x++) h[x & 1][y.ca[a[x]] * TXS_CLASSES + y.cb[b[x]]]++;
        } else {
            for (int x = x0; x < x1; x++) h[x & 1][txs_bin(&y, p + x)]++;
        }
    }
    for (int i = 0; i < TXS_BINS; i++) total += h[0][i] + h[1][i];
    for (int i = 0; i < TXS_BINS; i++)
        share[i] =
            total ? (int32_t)(((int64_t)(h[0][i] + h[1][i]) * TXS_ONE + total / 2) / total) : 0;
    return total;
}

/* Euclidean distance of two normalised histograms (step 4 of [1]) */
static float txs_distance(const int32_t *a, const int32_t *b) {
    int64_t sum = 0;
    for (int i = 0; i < TXS_BINS; i++) sum += (int64_t)(a[i] - b[i]) * (a[i] - b[i]);
    return txm_float(sqrt((double)sum) / (double)TXS_ONE);
}

/* ---- learning: the neighbourhood system ------------------------------------------------- */

/* One clique type that could be added. */
typedef struct txs_candidate {
    txs_type type;
    float weight;   /* of its distance                                    */
    float noise;    /* distance of two samples of this size from one source */
    float distance; /* now; 0 = not to be taken                           */
} txs_candidate;

typedef struct txs_learner {
    const texsyn_learn_desc *desc;
    texsyn_model *model;
    int index; /* of the level */
    txs_level *level;
    const txs_source *source;
    const txs_canvas *canvas;
    txs_candidate *candidates;
    int candidate_count, capacity;
    int step; /* the canvas is measured on every step-th row */
} txs_learner;

static txs_type *txs_add_type(txs_level *l, int kind, int band, int other, int dx, int dy) {
    txs_type *t = &l->types[l->type_count++];
    memset(t, 0, sizeof *t);
    t->kind = kind;
    t->band = band;
    t->other = other;
    t->dx = dx;
    t->dy = dy;
    return t;
}

static void txs_add_candidate(txs_learner *a, int kind, int band, int other, const int *d,
                              float weight) {
    const int ex = kind >= TEXSYN_CORNER ? d[2] : 0, ey = kind >= TEXSYN_CORNER ? d[3] : 0;
    for (int k = 0; k < a->level->type_count; k++) {
        const txs_type *t = &a->level->types[k];
        if (t->kind == kind && t->band == band && t->other == other && t->dx == d[0] &&
            t->dy == d[1])
            return;
    }
    if (a->candidate_count == a->capacity) return;
    txs_candidate *c = &a->candidates[a->candidate_count++];
    memset(c, 0, sizeof *c);
    c->type.kind = kind;
    c->type.band = band;
    c->type.other = other;
    c->type.dx = d[0];
    c->type.dy = d[1];
    c->type.ex = ex;
    c->type.ey = ey;
    c->weight = weight;
}

/* Pairs within the reach, and the kinds that take three or four pixels, of few shapes. */
static void txs_list_candidates(txs_learner *a, int reach, const float *seen) {
    static const int corners[][4] = {{1, 0, 0, 1},   {-1, 0, 0, 1},  {1, 0, -1, 0}, {0, 1, 0, -1},
                                     {2, 0, 0, 2},   {-2, 0, 0, 2},  {2, 0, -2, 0}, {0, 2, 0, -2},
                                     {1, 1, -1, -1}, {-1, 1, 1, -1}, {1, 1, -1, 1}, {1, 1, 1, -1},
                                     {3, 0, 0, 3},   {-3, 0, 0, 3},  {3, 0, -3, 0}, {0, 3, 0, -3},
                                     {2, 2, -2, -2}, {-2, 2, 2, -2}, {2, 2, -2, 2}, {2, 2, 2, -2},
                                     {4, 0, 0, 4},   {-4, 0, 0, 4},  {3, 0, -4, 0}, {0, 4, 0, -4},
                                     {1, 0, 2, 0},   {0, 1, 0, 2},   {2, 0, 4, 0},  {0, 2, 0, 4}};
    static const int scales[][4] = {{1, 0, 2, 0},  {0, 1, 0, 2},  {1, 1, 2, 2}, {-1, 1, -2, 2},
                                    {2, 0, 2, 0},  {0, 2, 0, 2},  {2, 2, 2, 2}, {-2, 2, -2, 2},
                                    {1, 0, 3, 0},  {0, 1, 0, 3},  {1, 0, 0, 2}, {0, 1, 2, 0},
                                    {1, 1, -2, 2}, {-1, 1, 2, 2}, {2, 0, 0, 2}, {0, 2, 2, 0}};
    const int bands = a->model->bands;
    a->candidate_count = 0;
    for (int b = 0; b < bands; b++) {
        for (int o = b; o < bands; o++) {
            const float weight = seen[b] < seen[o] ? seen[b] : seen[o];
            for (int y = -reach; y <= reach; y++) {
                for (int x = -reach; x <= reach; x++) {
                    const int d[4] = {x, y, 0, 0}, square = x * x + y * y,
                              half = y > 0 || (y == 0 && x > 0);
                    if (square > reach * reach || (y == 0 && x % TXS_GRID == 0)) continue;
                    if (b == o && half) {
                        txs_add_candidate(a, TEXSYN_PAIR, b, b, d, weight);
                        txs_add_candidate(a, TEXSYN_VALUES, b, b, d, weight);
                    }
                    if (b != o && square <= 9 && square)
                        txs_add_candidate(a, TEXSYN_PAIR, b, o, d, weight);
                    if (b == 0 && o && half && square <= 5)
                        txs_add_candidate(a, TEXSYN_PARALLEL, b, o, d, weight);
                }
            }
        }
    }
    static const int edges[][4] = {{1, 0, 0, 1},  {0, 1, 1, 0},  {1, 0, 0, 2},  {0, 1, 2, 0},
                                   {1, 0, 0, 3},  {0, 1, 3, 0},  {1, 1, -1, 1}, {-1, 1, 1, 1},
                                   {1, 1, -2, 2}, {-1, 1, 2, 2}, {1, 0, 2, 0},  {0, 1, 0, 2},
                                   {1, 0, 3, 0},  {0, 1, 0, 3},  {2, 0, 0, 2},  {0, 2, 2, 0},
                                   {2, 0, 0, 4},  {0, 2, 4, 0},  {2, 2, -2, 2}, {-2, 2, 2, 2}};
    for (size_t i = 0; i < sizeof edges / sizeof *edges; i++)
        txs_add_candidate(a, TEXSYN_PARALLEL, 0, 0, edges[i], TXS_EDGE_WEIGHT * seen[0]);
    for (size_t i = 0; i < sizeof corners / sizeof *corners; i++)
        txs_add_candidate(a, TEXSYN_CORNER, 0, 0, corners[i], TXS_CORNER_WEIGHT * seen[0]);
    if (a->index + 1 < a->model->levels)
        for (size_t i = 0; i < sizeof scales / sizeof *scales; i++)
            txs_add_candidate(a, TEXSYN_SCALE, 0, 0, scales[i], TXS_EDGE_WEIGHT * seen[0]);
}

/* Parallel bodies: measure a candidate in the example, in the canvas. */
static void txs_measure_example(void *context, int i) {
    txs_learner *a = (txs_learner *)context;
    txs_candidate *c = &a->candidates[i];
    int64_t n = txs_measure(&a->source->canvas, a->source->mask, 0, a->source->step,
                            a->model->bands, a->level, &c->type, c->type.share);
    int64_t m = (int64_t)a->canvas->width * a->canvas->height / a->step;
    c->noise = n ? txm_float(sqrt(1.0 / (double)n + 1.0 / (double)m)) : 0;
    if (!n) c->weight = 0;
}

static void txs_measure_canvas(void *context, int i) {
    txs_learner *a = (txs_learner *)context;
    txs_candidate *c = &a->candidates[i];
    int32_t share[TXS_BINS];
    txs_measure(a->canvas, NULL, 1, a->step, a->model->bands, a->level, &c->type, share);
    c->distance = txs_distance(share, c->type.share);
}

/* Steps 4 and 5 of [1]: move the count worst clique types into the level. Returns how many. */
static int txs_add_worst(txs_learner *a, int count, float threshold) {
    int added = 0;
    for (; added < count; added++) {
        int worst = -1;
        for (int i = 0; i < a->candidate_count; i++) {
            const txs_candidate *c = &a->candidates[i];
            if (c->distance > txm_maxf(threshold, TXS_NOISE_SHARE * c->noise) && c->weight > 0 &&
                (worst < 0 || c->distance * c->weight >
                                  a->candidates[worst].distance * a->candidates[worst].weight))
                worst = i;
        }
        if (worst < 0 || a->level->type_count == TXS_MAX_TYPES) break;
        const txs_type chosen = a->candidates[worst].type;
        a->level->types[a->level->type_count++] = chosen;
        if (txs_most_ends(a->level, a->model->bands) > TXS_MAX_ENDS) {
            a->level->type_count--;
            break;
        }
        a->candidates[worst] = a->candidates[--a->candidate_count];
        for (int i = 0; i < a->candidate_count; i++) { /* its neighbours are redundant */
            txs_type *t = &a->candidates[i].type;
            if (t->kind == chosen.kind && t->kind < TEXSYN_CORNER && t->band == chosen.band &&
                t->other == chosen.other && abs(t->dx - chosen.dx) <= 1 &&
                abs(t->dy - chosen.dy) <= 1)
                a->candidates[i].distance = 0;
        }
    }
    return added;
}
/* A share h is kept as its square root in steps of 1/scale: the sampling noise of the root is the
   same for all shares, and the step about as large. */
static int txs_root_scale(int kind, int level) {
    return kind == TEXSYN_SINGLE ? 160 : level == 0 ? 48 : level == 1 ? 36 : 26;
}

/* Round what was measured to what is kept. */
static void txs_round_statistics(txs_type *t, int level) {
    const int scale = txs_root_scale(t->kind, level);
    for (int i = 0; i < TXS_BINS; i++) {
        t->root[i] = (int16_t)floor(sqrt((double)t->share[i] / (double)TXS_ONE) * scale + 0.5);
        t->level[i] = (int16_t)floor((double)t->potential[i] / (double)TXS_COARSE + 0.5);
    }
}

/* The preselected clique types: singles, the 4-neighbourhood within the bands, the bands against
   each other at the same pixel [1], and each band against the level above. */
static void txs_preselect(txs_learner *a) {
    const int bands = a->model->bands;
    a->level->type_count = 0;
    for (int b = 0; b < bands; b++) {
        txs_type *t = txs_add_type(a->level, TEXSYN_SINGLE, b, b, 0, 0);
        txs_measure(&a->source->canvas, a->source->mask, 0, 1, bands, a->level, t, t->share);
        txs_make_classes(a->level, b);
    }
    for (int b = 0; b < bands; b++) {
        const int top = a->index + 1 == a->model->levels;
        for (int phase = !top; phase <= 2 * !top; phase++) {
            txs_add_type(a->level, TEXSYN_PAIR, b, b, 1, 0)->phase = phase;
            txs_add_type(a->level, TEXSYN_PAIR, b, b, 0, 1)->phase = phase;
        }
        if (!top) txs_add_type(a->level, TEXSYN_PARENT, b, b, 0, 0);
        for (int o = b + 1; o < bands; o++) txs_add_type(a->level, TEXSYN_VALUES, b, o, 0, 0);
    }
    int kept = bands;
    for (int k = bands; k < a->level->type_count; k++) {
        txs_type t = a->level->types[k];
        if (txs_measure(&a->source->canvas, a->source->mask, 0, a->source->step, bands, a->level,
                        &t, t.share) > 0)
            a->level->types[kept++] = t; /* an irregular mask may contain none of them */
    }
    a->level->type_count = kept;
}

/* How much a band's histograms count: its standard deviation in gray levels against 4, and less
   if it has few values, whose histograms have few bins and so larger distances. */
static float txs_visibility(const txs_level *l, int band) {
    const int32_t *share = l->types[band].share;
    double mean = 0, square = 0;
    for (int v = 0; v < TXS_VALUES; v++) {
        mean += (double)share[v] * v / (double)TXS_ONE;
        square += (double)share[v] * v * v / (double)TXS_ONE;
    }
    double deviation =
        sqrt(square - mean * mean > 0 ? square - mean * mean : 0) * (double)l->step[band];
    return txm_float(deviation / (deviation + 4) * sqrt(l->values[band] / (double)TXS_VALUES));
}

/* The model's potentials: the mean over some sweeps, which varies less than the last value. They
   are arbitrary up to a constant, and where the example has no clique. */
static void txs_keep_potentials(txs_level *l, int64_t (*sum)[TXS_BINS], int sweeps) {
    for (int k = 0; k < l->type_count; k++) {
        txs_type *t = &l->types[k];
        int64_t mean = 0, total = 1;
        for (int i = 0; i < TXS_BINS; i++) {
            mean += sum[k][i] / sweeps * t->share[i];
            total += t->share[i];
        }
        mean /= total;
        for (int i = 0; i < TXS_BINS; i++)
            t->potential[i] =
                (int16_t)txm_clampi((int)((sum[k][i] / sweeps - mean) / TXS_PRECISE),
                                    -TXS_STEEPEST * TXS_COARSE, TXS_STEEPEST * TXS_COARSE);
    }
}

/* Learn one level on a canvas whose parent planes are filled. Fraction from..to of the whole. */
static txm_status txs_learn_level(txs_learner *a, const int16_t *noise, txm_env *env, float from,
                                  float to) {
    const int max_types = a->desc->max_types     ? a->desc->max_types
                          : a->model->bands == 1 ? TXS_TYPES_GRAY
                                                 : TXS_TYPES;
    const float threshold = a->desc->threshold > 0 ? a->desc->threshold : TXS_THRESHOLD;
    const int max_distance = a->desc->max_distance ? a->desc->max_distance : 40;
    enum { FIRST = 6, BETWEEN = 3, LAST = 15, KEPT = 8, BATCH = 6 };
    const int bands = a->model->bands, top = a->index + 1 == a->model->levels;
    const int rounds = (max_types + BATCH - 1) / BATCH;
    const float sweep = (to - from) / (float)(FIRST + rounds * (BETWEEN + 2) + LAST);
    const int side = a->source->width < a->source->height ? a->source->width : a->source->height;
    int left = max_types, sweeps = FIRST;
    txm_arena arena;
    float seen[TXS_MAX_BANDS];
    txm_status status = TXM_OK;

    txm_arena_init(&arena, env);
    a->step = (int)((int64_t)a->canvas->width * a->canvas->height / 24576) | 1;
    int reach = max_distance >> a->index;
    if (!top && reach > TXS_NEAR) reach = TXS_NEAR;
    if (reach > side / 4) reach = side / 4;
    if (reach > a->canvas->margin) reach = a->canvas->margin;
    if (reach < 2) reach = 2;

    a->capacity = (2 * reach + 1) * (2 * reach + 1) * bands + 400;
    a->candidates =
        (txs_candidate *)txm_arena_alloc(&arena, (size_t)a->capacity, sizeof *a->candidates);
    int64_t(*sum)[TXS_BINS] =
        (int64_t(*)[TXS_BINS])txm_arena_zero(&arena, TXS_MAX_TYPES, sizeof *sum);
    txs_sampler *s = txs_sampler_make(&arena, a->level, TXS_MAX_TYPES, a->canvas, bands, noise,
                                      txm_hash(a->desc->seed) + 64 + (uint64_t)a->index);
    if (arena.failed) {
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to learn the model");
        goto done;
    }

    txs_preselect(a);
    for (int b = 0; b < bands; b++) seen[b] = txs_visibility(a->level, b);
    txs_list_candidates(a, reach, seen);
    txm_parallel_for(env, a->candidate_count, txs_measure_example, a);
    txs_start_canvas(a->level, a->canvas, bands, !top,
                     txm_hash(a->desc->seed) + (uint64_t)a->index);

    /* steps 3 to 6 of [1]; what was synthesised so far, and its potentials, are kept */
    for (;;) {
        txs_sampler_start(s);
        for (int i = 0; i < sweeps; i++, from += sweep)
            if ((status = txs_sweep(s, env, "learn", from, from + sweep)) != TXM_OK) goto done;
        if (left == 0) break;
        txm_parallel_for(env, a->candidate_count, txs_measure_canvas, a);
        int added = txs_add_worst(a, left < BATCH ? left : BATCH, threshold);
        if (added == 0) break;
        left -= added;
        sweeps = BETWEEN;
        from += 2 * sweep; /* about what the measuring takes */
    }
    for (int i = 0; i < LAST; i++, from += sweep) {
        if ((status = txs_sweep(s, env, "learn", from, from + sweep)) != TXM_OK) goto done;
        for (int k = 0; k < a->level->type_count && i >= LAST - KEPT; k++)
            for (int j = 0; j < TXS_BINS; j++) sum[k][j] += s->integral[k][j];
    }
    txs_keep_potentials(a->level, sum, KEPT);
    for (int k = 0; k < a->level->type_count; k++)
        txs_round_statistics(&a->level->types[k], a->index);
done:
    txm_arena_free(&arena);
    return status;
}

/* ---- the model as bytes -------------------------------------------------------------------

   An adaptive binary arithmetic code (a range coder as LZMA has it). One description of the model,
   txs_code_model, serves for both directions: a coder either writes the value that it is given or
   returns the one that it reads. docs/model-format.md describes the bytes.                  */

enum { TXS_MAGIC_BYTES = 4, TXS_CRC_BYTES = 4, TXS_MAX_FILE = 1 << 20, TXS_UNARY = 14 };

typedef struct txs_coder {
    int reading, bad; /* bad: ran out of bytes, or an impossible value    */
    uint8_t *out;     /* writing; NULL = only count                       */
    const uint8_t *in;
    size_t at, size;      /* bytes so far, bytes there are                    */
    uint64_t low;         /* writing: the interval's start, with a carry      */
    uint32_t range, code; /* its width; reading: where the code lies in it    */
    uint8_t held;         /* writing: a byte that a carry could still change  */
    size_t held_count;    /* and how many follow it that are all ones         */
} txs_coder;

static void txs_put(txs_coder *c, uint8_t byte) {
    if (c->out && c->at < c->size) c->out[c->at] = byte;
    c->at++;
}

static uint8_t txs_get(txs_coder *c) {
    if (c->at < c->size) return c->in[c->at++];
    c->bad = 1;
    return 0;
}

static void txs_shift(txs_coder *c) {
    if (c->low < 0xff000000u || c->low > 0xffffffffu) {
        uint8_t carry = (uint8_t)(c->low >> 32);
        for (; c->held_count; c->held_count--) {
            txs_put(c, (uint8_t)(c->held + carry));
            c->held = 0xff;
        }
        c->held = (uint8_t)(c->low >> 24);
    }
    c->held_count++;
    c->low = (c->low & 0x00ffffffu) << 8;
}

static void txs_coder_start(txs_coder *c) {
    c->range = 0xffffffffu;
    c->held_count = 1; /* a leading zero byte, as LZMA has it */
    for (int i = 0; i < 5 && c->reading; i++) c->code = c->code << 8 | txs_get(c);
}

static void txs_coder_finish(txs_coder *c) {
    for (int i = 0; i < 5; i++) txs_shift(c);
}

/* The probability of a 0 in 1/65536, and how many bits were coded with it, up to 24: it adapts
   faster at first. */
typedef struct txs_chance {
    uint16_t zero, seen;
} txs_chance;

static const txs_chance txs_even = {32768, 0};

/* Code one bit with its probability, and adapt that. */
static int txs_bit(txs_coder *c, txs_chance *p, int bit) {
    const uint32_t bound = (uint32_t)(((uint64_t)c->range * p->zero) >> 16);
    if (c->reading) bit = c->code >= bound;
    const int target = bit ? 512 : 65536 - 512;
    p->zero = (uint16_t)(p->zero + (target - p->zero) * 2 / (2 * p->seen + 3));
    if (p->seen < 24) p->seen++;
    if (!bit) {
        c->range = bound;
    } else {
        if (c->reading) c->code -= bound;
        else c->low += bound;
        c->range -= bound;
    }
    while (c->range < (1u << 24)) {
        c->range <<= 8;
        if (c->reading) c->code = c->code << 8 | txs_get(c);
        else txs_shift(c);
    }
    return bit;
}

/* count bits, highest first, each as likely 0 as 1 */
static uint32_t txs_raw(txs_coder *c, int count, uint32_t value) {
    uint32_t result = 0;
    for (int i = count - 1; i >= 0; i--) {
        txs_chance half = txs_even;
        result = result << 1 | (uint32_t)txs_bit(c, &half, (int)(value >> i & 1));
    }
    return result;
}

/* A raw number limited to low..high; anything else is not a model. */
static int txs_limited(txs_coder *c, int bits, int low, int high, int value) {
    value = (int)txs_raw(c, bits, (uint32_t)(value - low)) + low;
    if (value > high) c->bad = 1;
    return c->bad ? low : value;
}

static float txs_real(txs_coder *c, float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    bits = txs_raw(c, 24, bits >> 8) << 8;
    memcpy(&value, &bits, sizeof value);
    if (!(fabsf(value) <= 1e9f)) c->bad = 1; /* NaN too */
    return c->bad ? 1 : value;
}

/* Contexts of a whole number that is mostly near 0: is it 0, its sign, its size in unary. */
typedef struct txs_context {
    txs_chance zero, sign, more[TXS_UNARY];
} txs_context;

static void txs_contexts_init(txs_context *x, int count) {
    for (int i = 0; i < count; i++) {
        x[i].zero = x[i].sign = txs_even;
        for (int j = 0; j < TXS_UNARY; j++) x[i].more[j] = txs_even;
    }
}

static int txs_number(txs_coder *c, txs_context *x, int value) {
    int size = abs(value), n = 1;
    if (!txs_bit(c, &x->zero, value != 0)) return 0;
    int negative = txs_bit(c, &x->sign, value < 0);
    while (n <= TXS_UNARY && txs_bit(c, &x->more[n - 1], size > n)) n++;
    if (n > TXS_UNARY) n += (int)txs_raw(c, 12, (uint32_t)(size - n));
    return negative ? -n : n;
}

typedef enum txs_mirror { TXS_NONE, TXS_REVERSED, TXS_DIAGONAL } txs_mirror;

/* A sequence, each entry coded as its difference from a prediction: the entry of the most similar
   sequence, shifted by most of the shift of the entry before, and mixed with the entry at the
   mirrored place if that is known already. The last difference chooses the context. */
static void txs_sequence(txs_coder *c, txs_context *x, int16_t *v, const int16_t *like, int count,
                         int low, int high, txs_mirror mirror) {
    int surprise = 0, drift = 0;
    for (int i = 0; i < count; i++) {
        int twin = i;
        if (mirror == TXS_REVERSED) twin = count - 1 - i;
        if (mirror == TXS_DIAGONAL) twin = i % TXS_CLASSES * TXS_CLASSES + i / TXS_CLASSES;
        int expected = like ? like[i] + drift * 3 / 4 : drift;
        if (twin < i) expected = (expected + 3 * v[twin] + 2) / 4;
        expected = txm_clampi(expected, low, high);
        txs_context *now = x + (abs(surprise) > 2 ? 3 : abs(surprise)) + (expected == low ? 4 : 0);
        surprise = txs_number(c, now, v[i] - expected);
        if (expected + surprise < low || expected + surprise > high) c->bad = 1;
        v[i] = (int16_t)(c->bad ? low : expected + surprise);
        drift = v[i] - (like ? like[i] : 0);
    }
}

/* All contexts: of displacements, histograms and potentials by the kind of the clique type. */
typedef struct txs_codec {
    txs_context place[4][7], share[7][8], potential[7][8];
    int16_t used[TXS_BINS]; /* the potential, where it is kept */
} txs_codec;

/* The inverse of txs_round_statistics. A potential is kept only for bins that occur in the example;
   other bins get a high energy, which the control raises if they occur nevertheless. Returns 0 for
   an empty histogram. */
static int txs_unround_statistics(txs_type *t) {
    int32_t total = 0;
    for (int i = 0; i < TXS_BINS; i++) total += t->root[i] * t->root[i];
    for (int i = 0; i < TXS_BINS && total; i++) {
        t->share[i] = (int32_t)((int64_t)t->root[i] * t->root[i] * TXS_ONE / total);
        if (t->root[i] < TXS_RARE) t->level[i] = TXS_UNSEEN;
        t->potential[i] = (int16_t)(t->level[i] * TXS_COARSE);
    }
    return total > 0;
}

/* The type before k whose histogram is likely to look most like that of type k, or -1. */
static int txs_most_alike(const txs_level *l, int k) {
    const txs_type *t = &l->types[k];
    int best = -1, least = INT_MAX;
    for (int i = 0; i < k; i++) {
        const txs_type *o = &l->types[i];
        const int length = abs(t->dx) + abs(t->dy), other = abs(o->dx) + abs(o->dy);
        int distance = (o->band != t->band) * 200 + (o->other != t->other) * 100 +
                  8 * abs(length - other) + abs(o->dx - t->dx) + abs(o->dy - t->dy);
        if (o->kind == t->kind && distance <= least) {
            least = distance;
            best = i;
        }
    }
    return best;
}

/* Histogram and potential of type k. */
static void txs_code_statistics(txs_coder *c, txs_codec *z, txs_level *l, int level, int k) {
    txs_type *t = &l->types[k];
    const int bins = t->kind == TEXSYN_SINGLE ? l->values[t->band] : txs_bin_count(t->kind);
    const int like = txs_most_alike(l, k), same = t->band == t->other;
    int used = 0;
    txs_mirror mirror = TXS_NONE; /* differences are about as often v as -v */
    if (same && t->kind == TEXSYN_VALUES) mirror = TXS_DIAGONAL;
    else if (same && t->kind != TEXSYN_SINGLE && t->kind != TEXSYN_CORNER) mirror = TXS_REVERSED;
    txs_sequence(c, z->share[t->kind], t->root, like < 0 ? NULL : l->types[like].root, bins, 0,
                 txs_root_scale(t->kind, level), mirror);

    for (int i = 0; i < bins; i++)
        if (t->root[i] >= TXS_RARE) z->used[used++] = t->level[i];
    mirror = same && t->kind != TEXSYN_SINGLE ? TXS_REVERSED : TXS_NONE;
    txs_sequence(c, z->potential[t->kind], z->used, NULL, used, -TXS_STEEPEST, TXS_STEEPEST,
                 mirror);
    used = 0;
    for (int i = 0; i < bins; i++)
        if (t->root[i] >= TXS_RARE) t->level[i] = z->used[used++];
    if (!c->bad && !txs_unround_statistics(t)) c->bad = 1;
}

static void txs_code_type(txs_coder *c, txs_codec *z, txs_type *t, const texsyn_model *m,
                          int level) {
    t->kind = txs_limited(c, 3, TEXSYN_PAIR, TEXSYN_PARALLEL, t->kind);
    t->band = txs_limited(c, 2, 0, m->bands - 1, t->band);
    t->phase = t->kind == TEXSYN_PAIR ? txs_limited(c, 2, 0, 2, t->phase) : 0;
    t->other = t->kind == TEXSYN_CORNER ? t->band : txs_limited(c, 2, 0, m->bands - 1, t->other);
    if ((t->kind == TEXSYN_PARENT || t->kind == TEXSYN_SCALE) && level + 1 == m->levels) c->bad = 1;
    if (t->kind != TEXSYN_PARENT) {
        t->dx = txs_number(c, &z->place[0][t->kind], t->dx);
        t->dy = txs_number(c, &z->place[1][t->kind], t->dy);
    }
    if (t->kind >= TEXSYN_CORNER) {
        t->ex = txs_number(c, &z->place[2][t->kind], t->ex);
        t->ey = txs_number(c, &z->place[3][t->kind], t->ey);
    }
    /* members that coincide would change together */
    const int same_d = t->dx == 0 && t->dy == 0, same_e = t->ex == 0 && t->ey == 0;
    const int equal = t->ex == t->dx && t->ey == t->dy,
              opposite = t->ex == -t->dx && t->ey == -t->dy;
    if (t->kind != TEXSYN_PARENT && same_d && (t->band == t->other || t->kind >= TEXSYN_CORNER))
        c->bad = 1;
    if (t->kind == TEXSYN_CORNER && (same_e || equal)) c->bad = 1;
    if (t->kind == TEXSYN_PARALLEL && t->band == t->other && (same_e || equal || opposite))
        c->bad = 1;
    /* and so would members that are drawn at the same time, see txs_visit */
    int at[4][2], drawn = t->kind == TEXSYN_SCALE ? 2 : txs_members(t, at);
    txs_members(t, at);
    for (int i = 0; i < drawn; i++) {
        for (int j = 0; j < i; j++) {
            const int apart = at[i][0] - at[j][0];
            if (at[i][1] == at[j][1] && apart != 0 && apart % TXS_GRID == 0) c->bad = 1;
        }
    }
    if (abs(t->dx) > TXS_MAX_REACH || abs(t->dy) > TXS_MAX_REACH || abs(t->ex) > TXS_MAX_REACH ||
        abs(t->ey) > TXS_MAX_REACH || txs_reach(t) > TXS_MAX_REACH)
        c->bad = 1;
}

/* The whole model, to or from the coder. What reading allocates goes to the model's arena.
   Returns 0 if there is no memory. */
static int txs_code_model(txs_coder *c, texsyn_model *m, txs_codec *z) {
    static const int channels_of[] = {1, 3, 4};
    int kind = m->channels == 4 ? 2 : m->channels == 3 ? 1 : 0;
    m->channels = channels_of[txs_limited(c, 2, 0, 2, kind)];
    m->bands = txs_limited(c, 2, 1, m->channels, m->bands);
    m->levels = txs_limited(c, 3, 1, TXS_MAX_LEVELS, m->levels);
    for (int i = 0; i < m->channels; i++) m->mean[i] = txs_real(c, m->mean[i]);
    for (int b = 0; b < m->bands; b++) {
        for (int i = 0; i < m->channels; i++)
            m->basis[b][i] =
                (float)txs_limited(c, 16, -16384, 16384, (int)(m->basis[b][i] * 16384)) / 16384;
        m->dither[b] = (float)txs_limited(c, 8, 0, 255, (int)(m->dither[b] * 255 + 0.5f)) / 255;
    }
    memset(z, 0, sizeof *z);
    txs_contexts_init(&z->place[0][0], 4 * 7);
    txs_contexts_init(&z->share[0][0], 7 * 8);
    txs_contexts_init(&z->potential[0][0], 7 * 8);
    for (int i = m->levels - 1; i >= 0 && !c->bad; i--) {
        txs_level *l = &m->level[i];
        for (int b = 0; b < m->bands; b++) {
            l->values[b] = txs_limited(c, 5, 1, TXS_VALUES, l->values[b]);
            l->low[b] = txs_real(c, l->low[b]);
            l->step[b] = txs_real(c, l->step[b]);
            if (!(l->step[b] > 1e-6f)) c->bad = 1;
        }
        l->type_count = txs_limited(c, 7, m->bands, TXS_MAX_TYPES, l->type_count);
        if (c->bad) break;
        if (c->reading) {
            l->types =
                (txs_type *)txm_arena_zero(&m->arena, (size_t)l->type_count, sizeof(txs_type));
            if (!l->types) return 0;
        }
        for (int k = 0; k < l->type_count && !c->bad; k++) {
            txs_type *t = &l->types[k];
            if (k < m->bands) t->band = t->other = k; /* singles, in the order of the bands */
            else txs_code_type(c, z, t, m, i);
            if (!c->bad) txs_code_statistics(c, z, l, i, k);
            if (k < m->bands && !c->bad) txs_make_classes(l, k);
        }
        if (!c->bad && txs_most_ends(l, m->bands) > TXS_MAX_ENDS) c->bad = 1;
    }
    return 1;
}

/* CRC-32 of IEEE 802.3, a bit at a time: models are small */
static uint32_t txs_crc(const uint8_t *bytes, size_t count) {
    uint32_t crc = 0xffffffffu;
    for (size_t i = 0; i < count; i++) {
        crc ^= bytes[i];
        for (int k = 0; k < 8; k++) crc = crc >> 1 ^ (crc & 1 ? 0xedb88320u : 0);
    }
    return ~crc;
}

/* ---- public: models --------------------------------------------------------------------- */

TEXSYN_API void texsyn_model_free(texsyn_model *model) {
    if (model) txm_arena_free(&model->arena);
}

static texsyn_model *txs_model_make(txm_env *env) {
    txm_arena arena;
    txm_arena_init(&arena, env);
    texsyn_model *m = (texsyn_model *)txm_arena_zero(&arena, 1, sizeof *m);
    if (m) m->arena = arena;
    return m;
}

TEXSYN_API txm_status texsyn_save(const texsyn_model *model, txm_env *env, void *buffer,
                                  size_t capacity, size_t *size) {
    if (!model || !size) return txm_fail(env, TXM_BAD_ARGUMENT, "save: model or size is NULL");
    txm_arena arena;
    txm_arena_init(&arena, env);
    txs_codec *z = (txs_codec *)txm_arena_alloc(&arena, 1, sizeof *z);
    txs_type *types =
        (txs_type *)txm_arena_alloc(&arena, TXS_MAX_TYPES * TXS_MAX_LEVELS, sizeof *types);
    texsyn_model *copy = (texsyn_model *)txm_arena_alloc(&arena, 1, sizeof *copy);
    txm_status status = TXM_OK;
    if (arena.failed) {
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to save the model");
        goto done;
    }
    *copy = *model; /* the coder stores what it codes, so it works on a copy */
    for (int i = 0; i < model->levels; i++) {
        const txs_level *l = &model->level[i];
        copy->level[i].types = types + i * TXS_MAX_TYPES;
        memcpy(copy->level[i].types, l->types, sizeof *types * (size_t)l->type_count);
    }
    for (int writing = 0; writing < (buffer ? 2 : 1) && status == TXM_OK; writing++) {
        uint8_t *bytes = writing ? (uint8_t *)buffer : NULL; /* the first time only to count */
        txs_coder c;
        memset(&c, 0, sizeof c);
        c.out = bytes;
        c.size = capacity;
        txs_put(&c, 'T'), txs_put(&c, 'X'), txs_put(&c, 'S'), txs_put(&c, '1');
        txs_coder_start(&c);
        txs_code_model(&c, copy, z);
        txs_coder_finish(&c);
        *size = c.at + TXS_CRC_BYTES;
        if (buffer && capacity < *size)
            status = txm_fail(env, TXM_TOO_SMALL, "save: the buffer is smaller than *size says");
        if (!writing) continue;
        const uint32_t crc = txs_crc(bytes, c.at);
        for (int i = 0; i < TXS_CRC_BYTES; i++) bytes[c.at + (size_t)i] = (uint8_t)(crc >> 8 * i);
    }
done:
    txm_arena_free(&arena);
    return status;
}

TEXSYN_API txm_status texsyn_load(const void *data, size_t size, txm_env *env, texsyn_model **out) {
    const uint8_t *bytes = (const uint8_t *)data;
    if (out) *out = NULL;
    if (!data || !out) return txm_fail(env, TXM_BAD_ARGUMENT, "load: data or out is NULL");
    if (size < TXS_MAGIC_BYTES + TXS_CRC_BYTES || memcmp(bytes, "TXS1", TXS_MAGIC_BYTES) != 0)
        return txm_fail(env, TXM_BAD_DATA, "not a texsyn model");
    size -= TXS_CRC_BYTES;
    uint32_t crc = 0;
    for (int i = 0; i < TXS_CRC_BYTES; i++) crc |= (uint32_t)bytes[size + (size_t)i] << 8 * i;
    if (size > TXS_MAX_FILE || crc != txs_crc(bytes, size))
        return txm_fail(env, TXM_BAD_DATA, "the model is damaged or cut short");

    texsyn_model *m = txs_model_make(env);
    txs_codec *z = (txs_codec *)txm_alloc(env, sizeof *z);
    txs_coder c;
    int enough = m && z;
    memset(&c, 0, sizeof c);
    c.reading = 1;
    c.in = bytes;
    c.at = TXS_MAGIC_BYTES;
    c.size = size;
    if (enough) {
        txs_coder_start(&c);
        enough = txs_code_model(&c, m, z);
        c.bad |= c.at != c.size; /* the coder reads just what was written */
    }
    txm_free(env, z);
    if (enough && !c.bad) {
        *out = m;
        return TXM_OK;
    }
    texsyn_model_free(m);
    return enough ? txm_fail(env, TXM_BAD_DATA, "the model's contents contradict each other")
                  : txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to load the model");
}

TEXSYN_API int texsyn_channels(const texsyn_model *model) {
    return model ? model->channels : 0;
}

TEXSYN_API int texsyn_level_count(const texsyn_model *model) {
    return model ? model->levels : 0;
}

TEXSYN_API int texsyn_band_count(const texsyn_model *model) {
    return model ? model->bands : 0;
}

TEXSYN_API int texsyn_clique_count(const texsyn_model *model) {
    int count = 0;
    for (int i = 0; model && i < model->levels; i++) count += model->level[i].type_count;
    return count;
}

TEXSYN_API int texsyn_clique_at(const texsyn_model *model, int index, texsyn_clique *clique,
                                float *bins, int bin_count) {
    for (int i = 0; model && index >= 0 && i < model->levels; i++) {
        if (index >= model->level[i].type_count) {
            index -= model->level[i].type_count;
            continue;
        }
        const txs_type *t = &model->level[i].types[index];
        const int n = txs_bin_count(t->kind);
        if (clique) {
            clique->kind = (texsyn_kind)t->kind;
            clique->level = i;
            clique->band = t->band;
            clique->other = t->other;
            clique->dx = t->dx;
            clique->dy = t->dy;
            clique->ex = t->ex;
            clique->ey = t->ey;
            clique->phase = t->phase;
        }
        for (int k = 0; bins && k < n && k < bin_count; k++)
            bins[k] = (float)t->share[k] / (float)TXS_ONE;
        return n;
    }
    return 0;
}

/* ---- public: learning ------------------------------------------------------------------- */

/* no float sample is NaN or larger than LIMITS says */
static int txs_image_is_moderate(const txm_image *image) {
    const txm_image im = txm_image_resolve(*image);
    for (int y = 0; y < im.height && im.sample == TXM_F32; y++) {
        const float *row = (const float *)txm_image_row_const(&im, y);
        for (size_t i = 0; i < (size_t)im.width * (size_t)im.channels; i++)
            if (!txm_is_finite((double)row[i]) || !(fabsf(row[i]) <= 1e6f)) return 0;
    }
    return 1;
}

static txm_status txs_learn_check(const texsyn_learn_desc *d, txm_env *env) {
    txm_status status;
    if (!d) return txm_fail(env, TXM_BAD_ARGUMENT, "learn: desc is NULL");
    if ((status = txm_image_check(&d->example, "example", TEXSYN_MAX_PIXELS, env)) != TXM_OK)
        return status;
    if (d->example.channels == 2)
        return txm_fail(env, TXM_BAD_ARGUMENT, "example: 2 channels; give 1, 3 or 4");
    if (d->example.width < 16 || d->example.height < 16)
        return txm_fail(env, TXM_TOO_SMALL, "example: both sides must be at least 16 pixels");
    if (!txs_image_is_moderate(&d->example))
        return txm_fail(env, TXM_BAD_ARGUMENT, "example: a sample is NaN or beyond a million");
    if (d->mask.pixels) {
        if ((status = txm_image_check(&d->mask, "mask", TEXSYN_MAX_PIXELS, env)) != TXM_OK)
            return status;
        if (d->mask.width != d->example.width || d->mask.height != d->example.height)
            return txm_fail(env, TXM_BAD_ARGUMENT, "mask: must be as large as the example");
        if (d->mask.channels > 1 || d->mask.sample != TXM_U8)
            return txm_fail(env, TXM_BAD_ARGUMENT, "mask: must have one 8-bit channel");
    }
    if (d->max_distance < 0 || d->max_distance == 1 || d->max_distance > TXS_MAX_REACH)
        return txm_fail(env, TXM_BAD_ARGUMENT, "max_distance must be 2 to 60, or 0");
    if (d->max_types < 0 || d->max_types > 60)
        return txm_fail(env, TXM_BAD_ARGUMENT, "max_types must be 1 to 60, or 0");
    if (d->levels < 0 || d->levels > TXS_MAX_LEVELS)
        return txm_fail(env, TXM_BAD_ARGUMENT, "levels must be 1 to 6, or 0");
    if (!(d->threshold >= 0) || !txm_is_finite((double)d->threshold))
        return txm_fail(env, TXM_BAD_ARGUMENT, "threshold must be 0 or more");
    return TXM_OK;
}

/* Split the example into levels of quantised bands. */
static txm_status txs_prepare(const texsyn_learn_desc *desc, texsyn_model *m, txs_source *source,
                              txm_arena *arena, txm_env *env) {
    const txm_image *im = &desc->example;
    const int side = im->width < im->height ? im->width : im->height;
    m->channels = im->channels ? im->channels : 1;
    m->levels = 1;
    while (m->levels < (desc->levels ? desc->levels : TXS_MAX_LEVELS) &&
           side >> m->levels >= (desc->levels ? 8 : TXS_SMALLEST))
        m->levels++;
    for (int i = 0; i < m->levels; i++) {
        txs_source *s = &source[i];
        s->width = im->width >> i;
        s->height = im->height >> i;
        const size_t pixels = (size_t)s->width * (size_t)s->height;
        s->step = (int)(pixels / (1 << 17)) | 1;
        s->value = (float *)txm_arena_alloc(arena, pixels * (size_t)m->channels, sizeof(float));
        if (desc->mask.pixels) s->mask = (uint8_t *)txm_arena_alloc(arena, pixels, 1);
        s->canvas.width = s->width;
        s->canvas.height = s->height;
        s->canvas.stride = s->width;
        s->canvas.plane = (ptrdiff_t)pixels;
        s->canvas.pixels = (uint8_t *)txm_arena_zero(arena, pixels, 2 * (size_t)m->channels);
        if (arena->failed)
            return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the example");
        if (i == 0) {
            for (int y = 0; y < s->height && s->mask; y++)
                memcpy(s->mask + (size_t)y * (size_t)s->width, txm_image_row_const(&desc->mask, y),
                       (size_t)s->width);
            size_t seen = 0;
            for (size_t k = 0; k < pixels && s->mask; k++) seen += s->mask[k] != 0;
            if (s->mask && seen < 256)
                return txm_fail(env, TXM_TOO_SMALL,
                                "mask: fewer than 256 pixels (16 x 16) are not 0");
            txs_find_bands(m, im, s);
            txs_split(m, im, s);
        } else {
            txs_halve(&source[i - 1], s, m->bands);
            size_t seen = 0;
            for (size_t k = 0; k < pixels && s->mask; k++) seen += s->mask[k] != 0;
            if (s->mask && seen < 256) {
                m->levels = i; /* too little of an irregular region is left at this level */
                break;
            }
        }
        for (int b = 0; b < m->bands; b++) {
            float fill = txs_quantise_band(&m->level[i], b, s);
            if (i == 0) m->dither[b] = fill;
        }
    }
    for (int i = m->levels - 2; i >= 0; i--)
        txs_fill_parent(&m->level[i + 1], &source[i + 1].canvas, &m->level[i], &source[i].canvas,
                       m->bands);
    return TXM_OK;
}

TEXSYN_API txm_status texsyn_learn(const texsyn_learn_desc *desc, txm_env *env,
                                   texsyn_model **out) {
    if (out) *out = NULL;
    else return txm_fail(env, TXM_BAD_ARGUMENT, "learn: out is NULL");
    txm_status status = txs_learn_check(desc, env);
    if (status != TXM_OK) return status;

    txm_arena arena;
    txs_source source[TXS_MAX_LEVELS];
    txs_canvas canvas, above;
    texsyn_model *m = NULL;
    uint8_t *bytes = NULL;
    size_t size;
    float from = 0, total = 0;
    memset(source, 0, sizeof source);
    memset(&canvas, 0, sizeof canvas);
    memset(&above, 0, sizeof above);
    txm_arena_init(&arena, env);

    int16_t *noise = (int16_t *)txm_arena_alloc(&arena, TXS_NOISE + TXS_VALUES, sizeof *noise);
    m = (texsyn_model *)txm_arena_zero(&arena, 1, sizeof *m);
    if (arena.failed) {
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to learn the model");
        goto done;
    }
    txs_noise_table(noise);
    if ((status = txs_prepare(desc, m, source, &arena, env)) != TXM_OK) goto done;

    for (int i = 0; i < m->levels; i++) total += 1.0f / (float)(1 << 2 * i);
    for (int i = m->levels - 1; i >= 0; i--) {
        txs_learner a;
        memset(&a, 0, sizeof a);
        a.desc = desc;
        a.model = m;
        a.index = i;
        a.level = &m->level[i];
        a.source = &source[i];
        a.canvas = &canvas;
        a.level->types = (txs_type *)txm_arena_zero(&arena, TXS_MAX_TYPES, sizeof(txs_type));
        const int margin = i + 1 == m->levels ? TXS_MAX_REACH : TXS_NEAR;
        if (!a.level->types ||
            !txs_canvas_make(&canvas, env, txm_clampi(source[i].width, 128, 256),
                             txm_clampi(source[i].height, 128, 256), margin, 2 * m->bands)) {
            status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to learn the model");
            goto done;
        }
        if (above.pixels) txs_fill_parent(a.level + 1, &above, a.level, &canvas, m->bands);
        txs_canvas_free(&above, env);
        const float to = from + 1.0f / (float)(1 << 2 * i) / total;
        if ((status = txs_learn_level(&a, noise, env, from, to)) != TXM_OK) goto done;
        from = to;
        above = canvas;
        canvas.pixels = NULL;
    }

    /* the model returned has been through the file format, so that saving it loses nothing more */
    if ((status = texsyn_save(m, env, NULL, 0, &size)) != TXM_OK) goto done;
    bytes = (uint8_t *)txm_arena_alloc(&arena, size, 1);
    if (!bytes) status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to learn the model");
    else if ((status = texsyn_save(m, env, bytes, size, &size)) == TXM_OK)
        status = texsyn_load(bytes, size, env, out);
done:
    txs_canvas_free(&canvas, env);
    txs_canvas_free(&above, env);
    txm_arena_free(&arena);
    return status;
}

/* ---- public: synthesis ------------------------------------------------------------------ */

struct texsyn_job {
    texsyn_synth_desc desc;
    txm_env memory;  /* the allocator of texsyn_begin                         */
    txm_arena arena; /* holds the job; what a level needs lies in level_arena */
    txm_arena level_arena;
    int16_t *noise;
    txs_canvas canvas; /* of the current level, or of the finished level 0      */
    txs_sampler *sampler;
    int level, sweep;  /* current ones; level -1: finished                      */
    double work, done; /* pixel visits in all, so far                           */
};

/* sweeps of a level: the coarser ones cost little and matter more */
static int txs_sweeps(const texsyn_synth_desc *d, int level) {
    static const int sweeps[5][3] = {{2, 4, 8}, {3, 6, 10}, {5, 8, 16}, {6, 12, 24}, {10, 20, 32}};
    return sweeps[d->quality + 2][level > 2 ? 2 : level];
}

/* Size of a level's canvas. A canvas is always a torus. Where the result need not tile, it is a
   crop of one that is not too small to have statistics and halves evenly. Returns 0 if the finest
   is larger than TEXSYN_MAX_PIXELS. */
static int txs_canvas_size(const texsyn_synth_desc *d, int level, int *width, int *height) {
    const int64_t even = (int64_t)1 << (d->model->levels - 1);
    int64_t w = d->width, h = d->height;
    if (!d->tileable) {
        w = ((w < TXS_SMALLEST ? (int)TXS_SMALLEST : w) + even - 1) / even * even;
        h = ((h < TXS_SMALLEST ? (int)TXS_SMALLEST : h) + even - 1) / even * even;
    }
    *width = (int)((w + (1 << level) - 1) >> level);
    *height = (int)((h + (1 << level) - 1) >> level);
    return h <= TEXSYN_MAX_PIXELS / w;
}

/* Make canvas and sampler of the next finer level. */
static txm_status txs_enter_level(texsyn_job *job, txm_env *env) {
    const texsyn_model *m = job->desc.model;
    const int i = job->level;
    const txs_level *l = &m->level[i];
    int width, height, margin = 1;
    txs_canvas coarse = job->canvas;
    txs_canvas_size(&job->desc, i, &width, &height);
    for (int k = 0; k < l->type_count; k++) {
        int reach = txs_reach(&l->types[k]);
        if (reach > margin) margin = reach;
    }
    txm_arena_free(&job->level_arena);
    job->sampler = NULL;
    if (!txs_canvas_make(&job->canvas, &job->memory, width, height, margin, 2 * m->bands)) {
        job->canvas = coarse;
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the canvas");
    }
    job->sampler = txs_sampler_make(&job->level_arena, l, l->type_count, &job->canvas, m->bands,
                                    job->noise, txm_hash(job->desc.seed) + 128 + (uint64_t)i);
    if (!job->sampler) {
        txs_canvas_free(&job->canvas, &job->memory);
        job->canvas = coarse;
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the sampler");
    }
    if (coarse.pixels) txs_fill_parent(l + 1, &coarse, l, &job->canvas, m->bands);
    txs_start_canvas(l, &job->canvas, m->bands, coarse.pixels != NULL,
                     txm_hash(job->desc.seed) + (uint64_t)i);
    txs_canvas_free(&coarse, &job->memory);
    txs_sampler_start(job->sampler);
    return TXM_OK;
}

TEXSYN_API txm_status texsyn_begin(const texsyn_synth_desc *desc, txm_env *env, texsyn_job **out) {
    int width, height;
    if (out) *out = NULL;
    if (!desc || !out || !desc->model)
        return txm_fail(env, TXM_BAD_ARGUMENT, "begin: desc, model or out is NULL");
    if (desc->width < 1 || desc->height < 1)
        return txm_fail(env, TXM_BAD_ARGUMENT, "width and height must be 1 or more");
    if (!txs_canvas_size(desc, 0, &width, &height))
        return txm_fail(env, TXM_TOO_LARGE, "more than TEXSYN_MAX_PIXELS pixels; make tiles");
    if (desc->quality < -2 || desc->quality > 2)
        return txm_fail(env, TXM_BAD_ARGUMENT, "quality must be -2 to 2");

    txm_arena arena;
    txm_arena_init(&arena, env);
    texsyn_job *job = (texsyn_job *)txm_arena_zero(&arena, 1, sizeof *job);
    int16_t *noise = (int16_t *)txm_arena_alloc(&arena, TXS_NOISE + TXS_VALUES, sizeof *noise);
    if (arena.failed) {
        txm_arena_free(&arena);
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the job");
    }
    txs_noise_table(noise);
    job->arena = arena;
    job->noise = noise;
    txm_arena_init(&job->level_arena, env);
    if (env) {
        job->memory.allocate = env->allocate;
        job->memory.release = env->release;
        job->memory.memory_user = env->memory_user;
    }
    job->desc = *desc;
    job->level = desc->model->levels - 1;
    for (int i = 0; i <= job->level; i++) {
        txs_canvas_size(desc, i, &width, &height);
        job->work += (double)width * height * txs_sweeps(desc, i);
    }
    txm_status status = txs_enter_level(job, env);
    if (status == TXM_OK) *out = job;
    else texsyn_free(job);
    return status;
}

TEXSYN_API txm_status texsyn_step(texsyn_job *job, txm_env *env, int *more) {
    if (!job) return txm_fail(env, TXM_BAD_ARGUMENT, "step: job is NULL");
    txm_status status = TXM_OK;
    if (job->level >= 0) {
        if (job->sweep == txs_sweeps(&job->desc, job->level)) { /* failed here the last time? */
            job->level--;
            if ((status = txs_enter_level(job, env)) != TXM_OK) {
                job->level++;
                return status;
            }
            job->sweep = 0;
        }
        const double visits = (double)job->canvas.width * job->canvas.height;
        status = txs_sweep(job->sampler, env, "synthesise", (float)(job->done / job->work),
                           (float)((job->done + visits) / job->work));
        if (status != TXM_OK) return status;
        job->done += visits;
        job->sweep++;
        if (job->level == 0 && job->sweep == txs_sweeps(&job->desc, 0)) {
            job->level = -1;
            txm_arena_free(&job->level_arena);
        }
    }
    if (more) *more = job->level >= 0;
    return TXM_OK;
}

/* A canvas as pixels: back from bands to channels. Within its quantisation step a value is placed
   by its neighbours where these are smooth, at random where they are not. */
typedef struct txs_painter {
    const texsyn_job *job;
    const txm_image *out;
    int level;
} txs_painter;

enum { TXS_PAINT_ROWS = 16 };

static void txs_paint(void *context, int share) {
    const txs_painter *painter = (const txs_painter *)context;
    const texsyn_model *m = painter->job->desc.model;
    const txs_level *l = &m->level[painter->level];
    const txs_canvas *c = &painter->job->canvas;
    const txm_image *out = painter->out;
    const uint64_t seed = txm_hash(painter->job->desc.seed);
    int end =
        (share + 1) * TXS_PAINT_ROWS < out->height ? (share + 1) * TXS_PAINT_ROWS : out->height;
    for (int y = share * TXS_PAINT_ROWS; y < end; y++) {
        for (int x = 0; x < out->width; x++) {
            double v[4] = {(double)m->mean[0], (double)m->mean[1], (double)m->mean[2],
                           (double)m->mean[3]};
            const uint8_t *p = txs_at(c, 0, x >> painter->level, y >> painter->level);
            uint64_t noise = txm_hash(((uint64_t)(unsigned)y << 32 | (unsigned)x) ^ seed);
            for (int b = 0; b < m->bands; b++, p += c->plane, noise >>= 16) {
                const uint8_t *q = p - c->stride, *r = p + c->stride;
                const int n[8] = {q[-1], q[0], q[1], p[-1], p[1], r[-1], r[0], r[1]};
                int smooth = 1, sum = 4 * p[0];
                for (int i = 0; i < 8; i++) smooth &= abs(n[i] - p[0]) <= 1;
                sum += n[0] + n[2] + n[5] + n[7] + 2 * (n[1] + n[3] + n[4] + n[6]);
                double off =
                    smooth ? (sum - 16 * p[0]) / 16.0 : (double)(noise & 0xffff) / 65536 - 0.5;
                off = off < -0.5 ? -0.5 : off > 0.5 ? 0.5 : off;
                /* a product of two floats is exact in double, contracted or not */
                const float at = txm_float(p[0] + off * (double)m->dither[b]);
                const float value = txm_float(txs_value(l, b, (double)at));
                for (int i = 0; i < m->channels; i++)
                    v[i] += (double)value * (double)m->basis[b][i];
            }
            for (int i = 0; i < out->channels; i++) {
                double sample = i == 3 && m->channels < 4 ? 255 : v[m->channels == 1 ? 0 : i];
                txm_image_set(out, x, y, i, txm_float(sample / 255));
            }
        }
    }
}

/* Can the picture go there? */
static txm_status txs_check_out(const texsyn_synth_desc *desc, const txm_image *out, txm_env *env) {
    const txm_status status = txm_image_check(out, "out", 0, env);
    const int channels = out->channels ? out->channels : 1;
    if (status != TXM_OK) return status;
    if (out->width != desc->width || out->height != desc->height)
        return txm_fail(env, TXM_BAD_ARGUMENT, "out: must have the size of the synthesis");
    if (channels == 2 || channels < desc->model->channels)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "out: must have the channels of the model, or 3 or 4");
    return TXM_OK;
}

TEXSYN_API txm_status texsyn_draw(const texsyn_job *job, txm_env *env, txm_image out) {
    if (!job) return txm_fail(env, TXM_BAD_ARGUMENT, "draw: job is NULL");
    const txm_status status = txs_check_out(&job->desc, &out, env);
    if (status != TXM_OK) return status;
    out = txm_image_resolve(out);
    txs_painter painter = {job, &out, job->level < 0 ? 0 : job->level};
    txm_parallel_for(env, (out.height + TXS_PAINT_ROWS - 1) / TXS_PAINT_ROWS, txs_paint, &painter);
    return TXM_OK;
}

TEXSYN_API void texsyn_free(texsyn_job *job) {
    if (!job) return;
    txs_canvas_free(&job->canvas, &job->memory);
    txm_arena_free(&job->level_arena);
    txm_arena_free(&job->arena);
}

TEXSYN_API txm_status texsyn_synthesize(const texsyn_synth_desc *desc, txm_env *env,
                                        txm_image out) {
    texsyn_job *job;
    txm_status status = texsyn_begin(desc, env, &job);
    if (status == TXM_OK) status = txs_check_out(desc, &out, env); /* before the work, not after */
    for (int more = 1; more && status == TXM_OK;) status = texsyn_step(job, env, &more);
    if (status == TXM_OK) status = texsyn_draw(job, env, out);
    texsyn_free(job);
    return status;
}

#endif /* TEXSYN_IMPLEMENTATION */

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
