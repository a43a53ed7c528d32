/* texsyn.h - v0.2.0 - learn a texture as a small table of statistics, synthesise any amount of it
   SPDX-License-Identifier: MIT OR Unlicense                   (full text: end of file)

   WHAT IT DOES
     Reads one photograph of a texture and records, for a few dozen relative positions of two to
     four pixels ("clique types"), how often each difference of their values occurs: two to four
     thousand bytes. From these alone it makes new texture of any size, optionally tileable. No
     pixel of the photograph is kept, so none can be copied. It also replaces a region of a picture
     by texture that continues its surroundings without a seam.

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

   SEGMENTATION
     texsyn_segment divides a photograph that shows several textures: a label for each pixel. The
     labels say where each texture is to be learned from (the mask of texsyn_learn_desc). It looks
     at colours and at contrast of three sizes; textures that differ in neither count as one. If
     only one is found it looks again for smaller differences: moss on rock is a texture of its own
     in a picture of rocks, but not beside bricks.

   HOW IT WORKS
     The example is split into decorrelated colour bands of at most 32 values and into pyramid
     levels. On each level, coarse first, a canvas is synthesised with the clique types so far, the
     histograms of all other types are compared with the example's, the types that differ most are
     added, and so on [1]. Synthesis is Gibbs sampling [4] in which the potentials of the clique
     types are controlled so that the histograms of the canvas follow those of the example.
     In addition to the pairs of [1] there is a coarse joint histogram of two neighbouring values,
     which distinguishes rare values from frequent ones; there are cliques of three and four pixels
     (corners, parallel differences, differences together with those of the coarser level), for what
     pairs cannot express; and for contours there are filters of 12 to 18 pixels and differences
     beside a label of the coarser level, which says how that changes and curves.
     The colour of transparent pixels is never looked at: statistics of colours count what is
     visible, weighted by alpha, and hidden colour of results continues the visible one.
     texsyn_fill does the same in a hole, with the surroundings fixed: it learns from the known pixels
     near the hole on the canvas of the hole itself.

   CONFIGURATION   (define before the include that has _IMPLEMENTATION)
     TEXSYN_STATIC       every function static to the including file (set it everywhere)
     TEXSYN_MAX_PIXELS   refuse larger images; default 2^28
     TEXSYN_ASSERT(x)    checks for errors in the library, which no input can trigger; default
                         assert of <assert.h>
     TEXSYN_NO_SIMD      plain C only. Else SSE2 where the compiler has it and, with gcc and clang,
                         AVX2 where the processor has it. The bytes are the same.

   MEMORY
     A model is a few blocks, some 100 kB in memory for 3 kB in a file. Learning takes 12 bytes per
     sample of the example and 3 to 5 MB; up to 40 MB with one level and max_distance 60. Synthesis
     takes 2 bytes per band and pixel for the current level and the next coarser one, 1 more for
     labels and half a byte for each filter, without margins: 9 to 14 bytes per RGB pixel in all,
     and 1 MB; a picture that does not tile is cut
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
         restoration of images. IEEE PAMI 6(6), 1984.
     [5] A. A. Efros, W. T. Freeman. Image quilting for texture synthesis and transfer.
         SIGGRAPH 2001.
     [6] T. Leung, J. Malik. Recognizing surfaces using three-dimensional textons. ICCV 1999.
     [7] V. Ferrari, T. Tuytelaars, L. Van Gool. Real-time affine region tracking and coplanar
         grouping. CVPR 2001 (clique partitioning).                                          */
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
    txm_image mask;    /* same size: learn where it counts, a mask that allows (txm_mask_use in
                          texmath.h); pixels NULL = everywhere                                   */
    int max_distance;  /* longest pair in pixels of the example, 2..60; 0 = 40. Levels other than
                          the coarsest use pairs of at most 10 of their pixels                   */
    int max_types;     /* clique types per pyramid level beyond the preselected, 1..60; 0 = 24, or
                          36 for a gray example or one with transparent pixels                   */
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
    TEXSYN_PARALLEL,   /* classes of I_b(p + d) - I_b(p) and I_c(p + e + d) - I_c(p + e)         */
    TEXSYN_FILTER,     /* class of the response of a filter of 12 to 18 pixels, weights 1 and -1 */
    TEXSYN_CONTEXT     /* label of J(p + e), class of I_b(p + d) - I_b(p), of J_b(p) - I_b(p) for
                          d = 0; the label says how J changes and curves there                   */
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

/* ---- filling holes ---------------------------------------------------------------------- */

typedef struct texsyn_fill_desc {
    txm_image image;  /* 1, 3 or 4 channels, any sample type; not modified                       */
    txm_image mask;   /* same size: filled where it counts, a mask that replaces (txm_mask_use in
                         texmath.h). Any shape, anywhere                                         */
    txm_image source; /* same size: where to learn from, a mask that allows; pixels NULL = from all
                         that is known near the hole                                             */
    const texsyn_model *model; /* what to fill with, of as many channels; NULL = learn it        */
    int relight;               /* non-zero: such a model gets the mean colour and the contrast of
                                  what is known, if it was learned in other light                */
    int quality;               /* -2 fast .. +2 best: fewer or more clique types and sweeps      */
    uint64_t seed;             /* another seed, another filling                                  */
} texsyn_fill_desc;

/* Replace what is masked by texture that continues its surroundings: learned from the known pixels
   near the hole and synthesised with them fixed, so that no seam shows ([1], section 3, object
   removal). Holes are filled in windows of at most 256 x 256 pixels of hole.

   env    NULL, or how to allocate, report and spread the work
   out    form of the image, may be the image itself: known pixels are copied, with the same bytes.
          Untouched after an error
   return TXM_OK; TXM_BAD_ARGUMENT for a field outside its range, pictures that do not match, a mask
          that is empty or covers all, known samples that are not finite or beyond a million;
          TXM_TOO_SMALL if fewer than 256 pixels can be learned from; TXM_TOO_LARGE above
          TEXSYN_MAX_PIXELS; TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost   about 0.2 s for a hole of 64 x 64, 1 s for 200 x 200                                  */
TEXSYN_API txm_status texsyn_fill(const texsyn_fill_desc *desc, txm_env *env, txm_image out);

/* ---- knitting --------------------------------------------------------------------------- */

/* Are the two pictures of the same texture? */
typedef enum texsyn_likeness {
    TEXSYN_LIKENESS_AUTO = 0, /* found from their histograms */
    TEXSYN_LIKENESS_SAME,
    TEXSYN_LIKENESS_DIFFERENT
} texsyn_likeness;

typedef struct texsyn_knit_desc {
    txm_image a;        /* 1, 3 or 4 channels, any sample type, sides of 16 px or more; not modified */
    txm_image b;        /* the same channels and sample type; of any size of 16 px or more: where it
                           ends it goes on reflected                                              */
    txm_image layout;   /* size of a: b where it counts, a elsewhere, a mask that divides
                           (txm_mask_use in texmath.h). Any shape                                 */
    int zone;           /* pixels on either side of the border that are synthesised, 1..64; 0 = 3
                           for pictures of the same texture, 6 for different ones                 */
    float roughness;    /* pixels by which the border is usually displaced, up to 32, and at most
                           2.5 times that; 0 = as the materials are, 3.3 to 11; negative = the
                           border as drawn                                                        */
    texsyn_likeness likeness; /* AUTO with an example of a border: different                      */
    txm_image border;         /* an example of a border between the two textures, in the same light:
                                 channels of a, any size of 16 px or more; pixels NULL = none     */
    txm_image border_layout;  /* its layout, of its size                                          */
    int quality;              /* -2 fast .. +2 best: fewer or more clique types and sweeps        */
    uint64_t seed;            /* another seed, another zone                                       */
} texsyn_knit_desc;

/* Join two pictures along a border of any shape so that no seam shows ([1], section 3 and Fig. 5).

   Pictures of the same texture: the border moves to where they agree best, and its zone is filled as
   texsyn_fill does. Different ones: the border is displaced by the materials themselves, bright
   grains reaching over dark gaps, and by noise as coarse as they are. In either case spots smaller
   than the displacement may vanish. Then the zone is synthesised, either side with statistics of its
   own, and what meets across the border follows the example of a border, or the places where the two
   pictures agree best. texsyn_relight beforehand gives both the same light.

   env    NULL, or how to allocate, report and spread the work
   out    form of a, may be a or b itself: outside the zone of the (displaced) border it has the bytes
          of a or b, but for hidden colour. Untouched after an error
   return TXM_OK; TXM_BAD_ARGUMENT for a field outside its range, pictures that do not match, a layout
          that is all black or all white, samples that are not finite or beyond a million;
          TXM_TOO_SMALL for pictures under 16 x 16, fewer than 256 pixels outside the zone, or an
          example whose border is shorter than 64 pixels; TXM_TOO_LARGE above TEXSYN_MAX_PIXELS;
          TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost   memory and time grow with the pixels, 4 bytes beside the copy for each; and with the length
          of the border: 0.6 s for 256 px of it                                                  */
TEXSYN_API txm_status texsyn_knit(const texsyn_knit_desc *desc, txm_env *env, txm_image out);

/* ---- segmentation ----------------------------------------------------------------------- */

enum {
    TEXSYN_MAX_SEGMENTS = 16, /* textures of a segmentation */
    TEXSYN_TRANSITION = 254,  /* label of what is too small or thin to be one, if asked for */
    TEXSYN_NO_LABEL = 255     /* label of pixels that do not take part */
};

typedef struct texsyn_segment_desc {
    txm_image image; /* 1, 3 or 4 channels, both sides at least 16 px; where alpha is under one half
                        pixels do not take part                                                   */
    txm_image mask;  /* same size: pixels take part where it counts, a mask that allows
                        (txm_mask_use in texmath.h); pixels NULL = all                            */
    int segments;    /* how many textures, 1..16; 0 = as many as are found, 1 or more             */
    int transition;  /* non-zero: parts thinner than about 13 pixels and specks get
                        TEXSYN_TRANSITION; else they join what is around them. Pixels are those of
                        the resolution that is worked at                                          */
    uint64_t seed;   /* for the choice of the first textons; any value                            */
} texsyn_segment_desc;

/* Find the textures of a picture without being told what they look like [6, 7].

   A picture of more than 2^19 pixels is reduced by a whole number until it has no more; boundaries
   are then as exact as a pixel of that size, and smooth.

   env    NULL, or how to allocate, report and spread the work
   out    receives a label for each pixel: 0..*count-1, 0 for the texture with the largest area, and
          the special ones above. 1 channel, 8 bits, as large as the image, which it must not
          overlap. Untouched after an error
   count  receives the number of textures; each has at least one pixel. Untouched after an error
   return TXM_OK; TXM_BAD_ARGUMENT for a field outside its range, samples that are not finite or
          beyond a million; TXM_TOO_SMALL for an image under 16 x 16, if fewer than 256 pixels take
          part, or if it has no so many segments; TXM_TOO_LARGE above TEXSYN_MAX_PIXELS;
          TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost   O(width * height) time, 0.3 s for 512 x 512. 32 MB and 3 bytes per label for each of at
          most 2^19 pixels: 35 MB for two labels, some 60 MB for 16, whatever the size             */
TEXSYN_API txm_status texsyn_segment(const texsyn_segment_desc *desc, txm_env *env, txm_image out,
                                     int *count);

/* ---- composite textures ----------------------------------------------------------------- */

/* A learned composite texture: a label map, itself a texture, and a texture for each label ([1],
   section 4). It holds all it needs and never changes once it is made. */
typedef struct texsyn_composite texsyn_composite;

/* Does the layout have an order? Its labels may keep to their height (sky above ground), to their
   place from left to right, or to none. */
typedef enum texsyn_field {
    TEXSYN_FIELD_AUTO = 0, /* found from the example */
    TEXSYN_FIELD_NONE,
    TEXSYN_FIELD_ROWS,
    TEXSYN_FIELD_COLUMNS
} texsyn_field;

typedef struct texsyn_composite_learn_desc {
    txm_image example;  /* 1, 3 or 4 channels, both sides at least 32 px; not modified            */
    txm_image labels;   /* same size, 1 channel of 8 bits: 0..15, each on 256 pixels or more, and
                           255 where nothing is to be learned; texsyn_segment finds them          */
    texsyn_field field; /* of the layout                                                          */
    int max_types;      /* clique types per label and level beyond the preselected, 1..64; 0 = 10 */
    uint64_t seed;      /* for the random numbers; any value                                      */
} texsyn_composite_learn_desc;

/* Learn a composite.

   env    NULL, or how to allocate, report and spread the work
   out    receives the composite, or NULL on any error; release it with texsyn_composite_free
   return TXM_OK; TXM_BAD_ARGUMENT for a field outside its range, labels that do not fit or are over
          15, samples that are not finite; TXM_TOO_SMALL for an example under 32 x 32 or a label with
          fewer than 256 pixels, which the message names; TXM_TOO_LARGE above TEXSYN_MAX_PIXELS;
          TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost   O(pixels) for the statistics, and about 3 s for 512 x 512 with three labels             */
TEXSYN_API txm_status texsyn_composite_learn(const texsyn_composite_learn_desc *desc, txm_env *env,
                                             texsyn_composite **out);

/* Release a composite with the allocator it was made with; NULL is allowed. */
TEXSYN_API void texsyn_composite_free(texsyn_composite *composite);

TEXSYN_API int texsyn_composite_label_count(const texsyn_composite *composite); /* 1..16 */

/* The texture of a label, to look into; NULL for a bad label. The composite owns it. */
TEXSYN_API const texsyn_model *texsyn_composite_model(const texsyn_composite *composite, int label);

/* Write the composite as bytes, read it back: as texsyn_save and texsyn_load. */
TEXSYN_API txm_status texsyn_composite_save(const texsyn_composite *composite, txm_env *env,
                                            void *buffer, size_t capacity, size_t *size);
TEXSYN_API txm_status texsyn_composite_load(const void *data, size_t size, txm_env *env,
                                            texsyn_composite **out);

typedef struct texsyn_composite_desc {
    const texsyn_composite *composite;
    int width, height; /* of the output in pixels, 1 or more each                                 */
    txm_image layout;  /* width x height, 1 channel of 8 bits: a drawn label map, every value a
                          label of the composite; pixels NULL = a map is synthesised              */
    int quality;       /* -2 fast .. +2 best; 0 = default                                         */
    uint64_t seed;     /* another seed, another picture                                           */
} texsyn_composite_desc;

/* Synthesise a composite: the label map if none is drawn, then all textures and what happens where
   they meet in one run.

   out    width x height, the channels of the example (or 3 where it has 1, or 4 = opaque), any sample
          type; untouched after an error
   return TXM_OK; TXM_BAD_ARGUMENT for a field outside its range, a label that the composite does not
          have, or a picture that does not fit; TXM_TOO_LARGE; TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost   O(width * height): about 8 s for 1024 x 1024 on one core, 40 bytes per pixel            */
TEXSYN_API txm_status texsyn_composite_synthesize(const texsyn_composite_desc *desc, txm_env *env,
                                                  txm_image out);

/* The label map alone, as texsyn_composite_synthesize with the same description makes it.
   out    width x height, 1 channel of 8 bits */
TEXSYN_API txm_status texsyn_composite_layout(const texsyn_composite_desc *desc, txm_env *env,
                                              txm_image out);

/* ---- light ------------------------------------------------------------------------------ */

typedef struct texsyn_relight_desc {
    txm_image image;     /* 1 to 4 channels; not modified                                        */
    txm_image mask;      /* same size: what of it is compared with the other picture, a mask that
                            allows (txm_mask_use in texmath.h); pixels NULL = everything.
                            Transparent pixels are never compared                                */
    txm_image like;      /* a picture in the light that is wanted, of any size                   */
    txm_image like_mask; /* the same for that one                                                */
    float strength;      /* how much of the change is made, up to 1; 0 = 1                       */
} texsyn_relight_desc;

/* A change of light: a plain value, for texsyn_light_apply. */
enum { TEXSYN_LIGHT_KNOTS = 20 };
typedef struct texsyn_light {
    int knots;                       /* of the curve of brightness, 2 to TEXSYN_LIGHT_KNOTS      */
    float from[TEXSYN_LIGHT_KNOTS];  /* brightness before, 0..1, rising                          */
    float to[TEXSYN_LIGHT_KNOTS];    /* and after                                                */
    float slope[TEXSYN_LIGHT_KNOTS]; /* of the curve at the knots                                */
    float gain[2];                   /* chroma is multiplied by this complex number              */
    float cast[2];                   /* and this is added, but not to grays                      */
    float fade;                      /* the saturation from which on all of it is                */
} texsyn_light;

/* Give a picture the light of another one: the photometric correction of [1], section 3 and Fig. 6.

   A monotone curve of brightness, the same for all channels, and a gain, a rotation and an offset of
   chroma are chosen so that distributions agree; materials that occur in unequal shares are matched
   first. Grays stay exactly gray. 8-bit samples are dithered.

   out    the caller's, with the size and channels of the image, 8 or 16 bits or float; may be the
          image itself; untouched after an error
   return TXM_OK; TXM_BAD_ARGUMENT for a field outside its range, a picture that does not fit,
          samples that are not finite or beyond a million; TXM_TOO_SMALL for fewer than 16 pixels to
          compare, named; TXM_TOO_LARGE above TEXSYN_MAX_PIXELS; TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost   some 0.1 s and 2 MB to learn, 0.2 s per megapixel to apply                           */
TEXSYN_API txm_status texsyn_relight(const texsyn_relight_desc *desc, txm_env *env, txm_image out);

/* The change alone, for other pictures in the same light; strength is not used. *out is untouched
   after an error. Statuses as above. */
TEXSYN_API txm_status texsyn_light_learn(const texsyn_relight_desc *desc, txm_env *env,
                                         texsyn_light *out);

/* Apply a change; strength 0..1: at 0 the picture is copied. out and statuses as above. */
TEXSYN_API txm_status texsyn_light_apply(const texsyn_light *light, float strength,
                                         const txm_image *image, txm_env *env, txm_image out);

/* ---- erosion ---------------------------------------------------------------------------- */

/* Cracks and pits like those of a weathered exemplar, in the order in which they appear. */
typedef struct texsyn_erosion texsyn_erosion;

typedef struct texsyn_erosion_desc {
    txm_image weathered; /* at least 32 x 32; its cracks are darker than their surroundings. Not
                            modified, need not outlive the call                                  */
    txm_image mask;      /* same size: only where it counts, a mask that allows (txm_mask_use in
                            texmath.h); pixels NULL = everywhere. Transparent pixels of the
                            exemplar are never used                                              */
    float share;         /* of the pixels that are eroded at level 1, up to 0.5; 0 = 0.1         */
    int width, height;   /* of the pictures to be eroded, 1 or more each                         */
    uint64_t seed;       /* another seed, other cracks                                           */
} texsyn_erosion_desc;

/* Find the cracks of an exemplar and lay cracks like them over any size ([1], section 4 and Fig. 11).

   The cracks of the exemplar are laid in pieces, joined along minimum-error cuts [5], because thin
   long lines are beyond clique statistics. Every pixel gets a rank; at level l those of the first
   l * share * pixels, rounded, are eroded. So each level's pixels are part of the next one's.

   env    NULL, or how to allocate, report and spread the work
   out    receives the erosion, or NULL on any error; release it with texsyn_erosion_free
   return TXM_OK; TXM_BAD_ARGUMENT for a field outside its range, samples that are not finite or
          beyond a million; TXM_TOO_SMALL for an exemplar under 32 x 32 or of fewer than 1024
          pixels that count; TXM_TOO_LARGE above TEXSYN_MAX_PIXELS; TXM_OUT_OF_MEMORY;
          TXM_CANCELLED
   cost   about 3 s per megapixel of erosion and 2 s of exemplar; 7 bytes per pixel, 60 while it is
          made, and 75 per pixel of the exemplar                                               */
TEXSYN_API txm_status texsyn_erosion_make(const texsyn_erosion_desc *desc, txm_env *env,
                                          texsyn_erosion **out);

/* Release an erosion with the allocator it was made with; NULL is allowed. */
TEXSYN_API void texsyn_erosion_free(texsyn_erosion *erosion);

/* The share of the pixels that is eroded at level 1. */
TEXSYN_API float texsyn_erosion_share(const texsyn_erosion *erosion);

/* Erode a picture: colours in cracks are multiplied by what the exemplar's are of their
   surroundings, channel by channel; the pixels around them a little.

   level    0..1; at 0 the picture is copied
   levels   NULL, or a gray picture of the erosion's size, with or without alpha: level is multiplied
            by its gray times alpha, pixel by pixel. The brighter, the more eroded
   picture  of the erosion's size, 1 to 4 channels; alpha is kept
   out      the caller's, of the same size and channels, also the picture itself; untouched after an
            error
   return   TXM_OK; TXM_BAD_ARGUMENT; TXM_TOO_LARGE; TXM_OUT_OF_MEMORY (for three rows, and for a
            copy of the picture if colour is hidden in it)                                     */
TEXSYN_API txm_status texsyn_erosion_draw(const texsyn_erosion *erosion, float level,
                                          const txm_image *levels, const txm_image *picture,
                                          txm_env *env, txm_image out);

/* What is eroded, as a mask: 1 channel, white where it is. Otherwise as texsyn_erosion_draw. */
TEXSYN_API txm_status texsyn_erosion_mask(const texsyn_erosion *erosion, float level,
                                          const txm_image *levels, txm_env *env, txm_image out);

/* The other way round: white where the exemplar is intact, two pixels away from all cracks, black
   elsewhere. With this as the mask, texsyn_learn learns the polished stone. Width, height and seed
   of desc are not used; out has the size of the exemplar and 1 channel. Statuses as above. */
TEXSYN_API txm_status texsyn_erosion_intact(const texsyn_erosion_desc *desc, txm_env *env,
                                            txm_image out);

#ifdef __cplusplus
}
#endif
#endif /* TEXSYN_H */

#if defined(TEXSYN_IMPLEMENTATION) && !defined(TEXSYN_IMPLEMENTED)
#define TEXSYN_IMPLEMENTED

/* gcc 12 for aarch64, from -O1 on, takes functions here that write to memory for pure ones and drops what
   they do, unless both of these analyses are off. */
#if defined(__aarch64__) && defined(__GNUC__) && !defined(__clang__)
#pragma GCC push_options
#pragma GCC optimize("no-ipa-modref,no-ipa-pure-const")
#define TXS_POP_OPTIONS
#endif

#include "texsyn/config.h"
#include "texsyn/mask.h"
#include "texsyn/alpha.h"
#include "texsyn/model.h"
#include "texsyn/energy.h"
#include "texsyn/potential.h"
#include "texsyn/filter.h"
#include "texsyn/sampler.h"
#include "texsyn/example.h"
#include "texsyn/neighbourhood.h"
#include "texsyn/file.h"
#include "texsyn/learn.h"
#include "texsyn/synthesis.h"
#include "texsyn/ground.h"
#include "texsyn/mosaic.h"
#include "texsyn/mosaic_sampler.h"
#include "texsyn/mosaic_learner.h"
#include "texsyn/tone.h"
#include "texsyn/fill.h"
#include "texsyn/border.h"
#include "texsyn/seam.h"
#include "texsyn/knit.h"
#include "texsyn/textons.h"
#include "texsyn/regions.h"
#include "texsyn/labels.h"
#include "texsyn/segment.h"
#include "texsyn/layout.h"
#include "texsyn/layout_sampler.h"
#include "texsyn/layout_learn.h"
#include "texsyn/composite.h"
#include "texsyn/composite_file.h"
#include "texsyn/light.h"
#include "texsyn/relight.h"
#include "texsyn/darkness.h"
#include "texsyn/order.h"
#include "texsyn/laying.h"
#include "texsyn/erode.h"

#ifdef TXS_POP_OPTIONS
#pragma GCC pop_options
#undef TXS_POP_OPTIONS
#endif
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
