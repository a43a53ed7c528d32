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

/* ---- configuration ------------------------------------------------------------------ */

#if !defined(TEXSYN_NO_SIMD) && defined(__SSE2__)
#include <emmintrin.h>
#define TXS_SSE2 1
#if defined(__GNUC__)
#include <immintrin.h>
#define TXS_AVX2 1 /* compiled for AVX2 function by function, chosen when running */
#ifdef __x86_64__
#define TXS_LANES 1 /* an address is as long as a lane */
#endif
#endif
#endif

#ifndef TEXSYN_ASSERT
#include <assert.h>
#define TEXSYN_ASSERT(x) assert(x)
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
    TXS_MAX_ENDS = 160, /* ends of cliques at one pixel of one band                         */
    TXS_MAX_MEMBERS = 18, /* pixels of a clique                                             */
    TXS_LABELS = 9,     /* of a pixel by what its surroundings look like on the level above */
    TXS_LABEL_REACH = 2,   /* pixels: of what a label looks at                              */
    TXS_MAX_GRADIENT = 30752, /* the largest squared gradient: 2 (4 times 31)^2             */
    TXS_RESPONSES = 27, /* classes of a filter's response                                   */
    TXS_MAX_RESPONSE = 279, /* 9 pixels against 9                                           */
    TXS_MAX_FILTERS = 12, /* clique types that are filters, of one level                    */
    TXS_MAX_REACH = 60, /* pixels                                                           */
    TXS_NEAR = 10,      /* pixels: reach of all levels but the coarsest                     */
    TXS_ROW_BITS = 6,   /* their binary logarithm                                           */
    TXS_ROW = 1 << TXS_ROW_BITS, /* bytes of a table row for a difference                   */
    TXS_VALUE_BITS = 5, /* the logarithm of TXS_VALUES                                      */
    TXS_TABLE = (2 * TXS_CLASSES + TXS_DIFFERENCES) * TXS_ROW, /* bytes of one type's tables  */
    TXS_RESPONSE_ROW = 2 * (TXS_MAX_RESPONSE + TXS_VALUES) - 1, /* bytes of a filter's table,
                            of which there is one for each weight                           */
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
    TXS_TYPES_CUTOUT = 36, /* if some colours are hidden: shapes and colours take their share */
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
#define TXS_CONTOUR_WEIGHT 2.5f /* filters and labels */

/* classes of a difference -31..31: fine where differences are frequent */
static const uint8_t txs_difference_class[TXS_DIFFERENCES + 1] = {
    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 2, 2, 2, 3, 3, 4,
    5, 5, 6, 6, 6, 7, 7, 7, 7, 7, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8};

/* ---- pictures and masks ----------------------------------------------------------------- */

static size_t txs_pixels_of(int width, int height) {
    return (size_t)width * (size_t)height;
}

/* Copy rows from one picture to another of the same form. */
static void txs_copy_picture(const txm_image *from, const txm_image *to) {
    const txm_image a = txm_image_resolve(*from), b = txm_image_resolve(*to);
    const size_t row = (size_t)a.width * (size_t)a.channels * txm_sample_bytes(a.sample);
    for (int y = 0; y < a.height; y++)
        memmove(txm_image_row(&b, y), txm_image_row_const(&a, y), row);
}

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

/* A mask that may be left out, of a picture. */
static txm_status txs_check_mask(const txm_image *mask, const txm_image *image, const char *name,
                                 txm_env *env) {
    if (!mask->pixels) return TXM_OK;
    return txm_mask_check(mask, name, image->width, image->height, TEXSYN_MAX_PIXELS, env);
}

/* The bytes of a mask of what may be used, 255 where it counts; *bytes is NULL without a mask. */
static txm_status txs_read_mask(const txm_image *mask, txm_arena *arena, uint8_t **bytes,
                                txm_env *env) {
    *bytes = NULL;
    if (!mask->pixels) return TXM_OK;
    *bytes = (uint8_t *)txm_arena_alloc(arena, txs_pixels_of(mask->width, mask->height), 1);
    if (!*bytes) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the mask");
    txm_mask_read(mask, TXM_MASK_ALLOWS, *bytes);
    return TXM_OK;
}

/* ---- alpha of an example ------------------------------------------------------------------

   The colour of a transparent pixel is unknown, so it must not enter any statistics. The weight of
   a colour is its alpha in steps; cliques of colours are counted with the least weight of their
   pixels. Cliques of colours and alpha are counted everywhere, and there hidden pixels borrow the
   colour of a visible one that lies elsewhere: then colour and transparency are independent, the
   statistics of colour are the same all over the picture, and a synthesised picture has the texture
   of what is visible everywhere, of which its alpha shows a part.                             */

enum {
    TXS_OPAQUE = 15,  /* the largest weight: small, so that 32 bits hold the counts */
    TXS_LENDERS = 24  /* places that are tried before any visible pixel will do     */
};

/* The weight of a colour whose alpha is that: 0 only if it is hidden. */
static uint8_t txs_weight_of(double alpha) {
    return (uint8_t)(alpha > 0 ? (alpha < 1 ? ceil(alpha * (double)TXS_OPAQUE) : (int)TXS_OPAQUE) : 0);
}

/* How often a clique is counted whose least weight is that: fully from a quarter of the opacity on.
   Colours of thin veils belong to their alpha, with which they are counted in full; only what is
   faint is left out gradually. */
static uint32_t txs_counts_of(uint32_t least) {
    return 4 * least < TXS_OPAQUE ? 4 * least : (uint32_t)TXS_OPAQUE;
}

/* The weights of a picture's pixels. mask: NULL, or a byte for each pixel, 0 where it does not
   count; its weight is 0. Returns 0 if all that count are opaque, so that there is no need of
   weights. */
static int txs_weigh(const txm_image *im, const uint8_t *mask, uint8_t *weight) {
    int differ = 0;
    if (im->channels != 4) return 0;
    for (int y = 0; y < im->height; y++) {
        for (int x = 0; x < im->width; x++) {
            const size_t i = (size_t)y * (size_t)im->width + (size_t)x;
            weight[i] = txs_weight_of((double)txm_image_get(im, x, y, 3));
            if (mask && !mask[i]) weight[i] = 0;
            else differ |= weight[i] != TXS_OPAQUE;
        }
    }
    return differ;
}

/* ---- hidden colour of results ------------------------------------------------------------ */

/* Where a picture is to be painted: out itself, or a picture of that form in the arena if alpha can
   hide colours, which then are bled; *to receives it. */
static txm_status txs_easel(const txm_image *out, int can_hide, txm_arena *arena, txm_env *env,
                            txm_image *to) {
    *to = txm_image_resolve(*out);
    if (!can_hide) return TXM_OK;
    to->stride = 0;
    *to = txm_image_resolve(*to);
    to->pixels = txm_arena_alloc(arena, (size_t)to->height, (size_t)to->stride);
    return to->pixels ? TXM_OK : txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a picture");
}

/* What was painted becomes the result: hidden colours are bled. */
static txm_status txs_hang(const txm_image *painted, const txm_image *out, int wrap, txm_env *env) {
    if (painted->pixels == out->pixels) return TXM_OK;
    const txm_status status = txm_image_bleed(painted, wrap, env);
    if (status == TXM_OK) txs_copy_picture(painted, out);
    return status;
}

/* ---- borrowed colours -------------------------------------------------------------------- */

/* Who lends colours: visible pixels, and some places that are the same for all that borrow. */
typedef struct txs_lenders {
    const uint8_t *weight; /* of each pixel, not 0 where it can lend */
    int width, height;
    const uint32_t *visible; /* those that can lend */
    uint32_t count;
    size_t place[TXS_LENDERS][2];
} txs_lenders;

static txs_lenders txs_lenders_of(const uint8_t *weight, int width, int height,
                                  const uint32_t *visible, uint32_t count) {
    txs_lenders l;
    txm_rng rng = txm_rng_make(1, 0);
    memset(&l, 0, sizeof l);
    l.weight = weight;
    l.width = width;
    l.height = height;
    l.visible = visible;
    l.count = count;
    for (int k = 0; k < TXS_LENDERS; k++) {
        l.place[k][0] = txm_rng_below(&rng, (uint32_t)width);
        l.place[k][1] = txm_rng_below(&rng, (uint32_t)height);
    }
    return l;
}

/* Where hidden pixel i borrows its colour: the first visible one of the places, so that neighbours
   mostly borrow neighbours; else any visible one. There must be one. */
static size_t txs_lender(const txs_lenders *l, size_t i) {
    const size_t w = (size_t)l->width, h = (size_t)l->height;
    for (int k = 0; k < TXS_LENDERS; k++) {
        const size_t x = (i % w + l->place[k][0]) % w, y = (i / w + l->place[k][1]) % h;
        if (l->weight[y * w + x]) return y * w + x;
    }
    txm_rng rng = txm_rng_make(i, 1);
    return l->visible[txm_rng_below(&rng, l->count)];
}

/* Give the hidden pixels of a plane of colours those of visible ones, or 0 if there are none.
   visible: scratch, a number for each pixel. Returns how many are visible. */
static uint32_t txs_borrow(float *plane, const uint8_t *weight, int width, int height,
                           uint32_t *visible) {
    const size_t pixels = txs_pixels_of(width, height);
    uint32_t count = 0;
    for (size_t i = 0; i < pixels; i++)
        if (weight[i]) visible[count++] = (uint32_t)i;
    const txs_lenders lenders = txs_lenders_of(weight, width, height, visible, count);
    for (size_t i = 0; i < pixels; i++)
        if (!weight[i]) plane[i] = count ? plane[txs_lender(&lenders, i)] : 0;
    return count;
}

/* ---- private types ---------------------------------------------------------------------- */

/* A clique type and its statistics. */
typedef struct txs_type {
    int kind, band, other;
    int dx, dy, ex, ey;
    int phase; /* tails counted: 0 all, 1 at even, 2 at odd coordinates; see txs_is_tail */
    int shape, scale; /* of a filter: index in txs_shapes, response with the last class */
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
    int gradient_cut[2], curve_cut[2];          /* between the labels, see txs_fill_labels      */
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

enum { TXS_VERSION = 2, TXS_KINDS = TEXSYN_CONTEXT + 1 };

struct texsyn_model {
    txm_arena arena; /* holds the model itself and its types                                  */
    int channels, bands, levels;
    int version; /* of its file                                                               */
    float mean[TXS_MAX_BANDS];                 /* of the channels, 0..255                       */
    float basis[TXS_MAX_BANDS][TXS_MAX_BANDS]; /* band b = sum_c basis[b][c] (x[c] - mean[c])   */
    float dither[TXS_MAX_BANDS];               /* share of a step that the example's values fill */
    txs_level level[TXS_MAX_LEVELS];           /* 0 = full resolution                           */
};

/* Quantised planes with a margin that repeats the opposite border: first the bands, then the
   bands of the coarser level at this resolution ("parent"), which do not change, then the labels,
   which do not either. */
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
    bytes += TXS_GRID; /* lanes reach so far beyond the last pixel */
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

/* Filters: the pixels p + i e + j d, i < length, weighed by the profile's j-th entry. */
typedef struct txs_shape {
    int dx, dy, ex, ey, length, profile;
} txs_shape;

static const struct {
    int width, weight[6];
} txs_profiles[] = {{2, {-1, 1}}, {4, {-1, 1, 1, -1}}, {6, {-1, -1, -1, 1, 1, 1}}};

enum { TXS_SHAPES = 8 };

/* seven pixels against their parallels, bars, squares against their neighbours */
static const txs_shape txs_shapes[TXS_SHAPES] = {
    {0, 1, 1, 0, 7, 0}, {1, 0, 0, 1, 7, 0}, {1, -1, 1, 1, 7, 0}, {1, 1, -1, 1, 7, 0},
    {0, 1, 1, 0, 3, 1}, {1, 0, 0, 1, 3, 1}, {0, 1, 1, 0, 3, 2},  {1, 0, 0, 1, 3, 2}};

/* Where the pixels of a shape lie, and their weights, 1 or -1; returns how many. */
static int txs_shape_pixels(int shape, int at[TXS_MAX_MEMBERS][2], int weight[TXS_MAX_MEMBERS]) {
    const txs_shape *s = &txs_shapes[shape];
    int n = 0;
    for (int i = 0; i < s->length; i++) {
        for (int j = 0; j < txs_profiles[s->profile].width; j++, n++) {
            at[n][0] = i * s->ex + j * s->dx;
            at[n][1] = i * s->ey + j * s->dy;
            weight[n] = txs_profiles[s->profile].weight[j];
        }
    }
    return n;
}

/* Classes of all responses -TXS_MAX_RESPONSE..: 13 + sign(r) floor(13 (|r| / scale)^0.7 + 1/2), 0
   and 26 beyond the scale. The limits are |r| / scale in 1/4096. */
static void txs_response_classes(int scale, uint8_t class_of[2 * TXS_MAX_RESPONSE + 1]) {
    static const int limit[TXS_RESPONSES / 2] = {39,   187,  389,  628,  900,  1199, 1522,
                                                 1867, 2232, 2617, 3019, 3438, 3873};
    for (int r = 0, k = 0; r <= TXS_MAX_RESPONSE; r++) {
        while (k < TXS_RESPONSES / 2 && r * 4096 >= limit[k] * scale) k++;
        class_of[TXS_MAX_RESPONSE + r] = (uint8_t)(TXS_RESPONSES / 2 + k);
        class_of[TXS_MAX_RESPONSE - r] = (uint8_t)(TXS_RESPONSES / 2 - k);
    }
}

/* Where the members of a clique of the kinds up to TEXSYN_PARALLEL lie, seen from its tail; returns
   how many. */
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

/* The same of all kinds. A label is known where all pixels are that it looks at. */
static int txs_footprint(const txs_type *t, int at[TXS_MAX_MEMBERS][2]) {
    int weight[TXS_MAX_MEMBERS], n = 2;
    if (t->kind == TEXSYN_FILTER) return txs_shape_pixels(t->shape, at, weight);
    if (t->kind != TEXSYN_CONTEXT) return txs_members(t, at);
    at[0][0] = at[0][1] = 0;
    at[1][0] = t->dx;
    at[1][1] = t->dy;
    for (int y = -TXS_LABEL_REACH; y <= TXS_LABEL_REACH; y += TXS_LABEL_REACH) {
        for (int x = -TXS_LABEL_REACH; x <= TXS_LABEL_REACH; x += TXS_LABEL_REACH, n++) {
            at[n][0] = t->ex + x;
            at[n][1] = t->ey + y;
        }
    }
    return n;
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
    int at[TXS_MAX_MEMBERS][2], n = txs_footprint(t, at), reach = 0;
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
           : kind == TEXSYN_FILTER                        ? TXS_RESPONSES
                                                          : TXS_BINS;
}

/* How to find the bin of a clique from its tail's address p (in plane 0):
     value       p[a]
     difference  p[a] - p[b] + 31
     values      ca[p[a]] * 9 + cb[p[b]]
     two         class(p[a] - p[b]) * 9 + class(p[c] - p[d])
     labelled    p[c] * 9 + class(p[a] - p[b])
   Filters are counted otherwise.                                                           */
typedef struct txs_tally {
    int form; /* 0 value, 1 difference, 2 values, 3 two, 4 labelled; -1 none */
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
    case TEXSYN_CONTEXT:
        y.form = 4;
        if (t->dx == 0 && t->dy == 0) y.a = parent;
        y.c = 2 * bands * c->plane + e;
        break;
    case TEXSYN_FILTER: y.form = -1; break;
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
    case 4: return p[y->c] * TXS_CLASSES + txs_class(p[y->a] - p[y->b]);
    default: return txs_class(p[y->a] - p[y->b]) * TXS_CLASSES + txs_class(p[y->c] - p[y->d]);
    }
}

/* Is it the band of alpha? */
static int txs_is_alpha(const texsyn_model *m, int band) {
    return m->channels == 4 && m->basis[band][3] != 0;
}

/* Classes of alpha's values: hidden, opaque, and evenly what lies between. */
static void txs_make_alpha_classes(txs_level *level, int band) {
    const int last = level->values[band] - 1, between = TXS_CLASSES - 2;
    for (int v = 0; v < TXS_VALUES; v++) {
        const int k = v == 0 ? 0 : v >= last ? between + 1 : 1 + (v - 1) * between / (last - 1);
        level->classes[band][v] = (uint8_t)k;
    }
}

/* Classes of a band's values: quantiles with narrow tails, so that rare values keep their say. Where
   alpha is the first band, quantiles would not tell its soft rims from what is opaque. */
static void txs_make_classes(const texsyn_model *m, txs_level *level, int band) {
    static const int cut[TXS_CLASSES - 1] = {655, 3277, 13107, 26214, 39322, 52429, 62259, 64881};
    const int32_t *share = level->types[band].share;
    int64_t below = 0;
    if (band == 0 && txs_is_alpha(m, band)) {
        txs_make_alpha_classes(level, band);
        return;
    }
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
     form 3   row = table + classes[p[o1]] * 32                       a value beside a known one
     form 4   row = table + p[o2] * 64 - p[o1]                        one difference, at a label

   For a filter with the response r, a pixel of weight w and value p has the row
   table + w r - p.                                                                         */
typedef struct txs_end {
    ptrdiff_t o1, o2, o3;
    const uint8_t *table, *classes;
} txs_end;

enum { TXS_FORMS = 5 };

static const uint8_t txs_no_energy[TXS_VALUES] = {
    TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO,
    TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO,
    TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO,
    TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO, TXS_ZERO};

/* Write the rows of count ends of one form, for TXS_TOGETHER pixels p, p + TXS_GRID, ...: that of
   end k for pixel i goes to rows[k * TXS_TOGETHER + i]. Only the first `pixels` are wanted. */
typedef void txs_aim(const txs_end *ends, int count, int form, const uint8_t *p, int pixels,
                       const uint8_t **rows);

/* The value with the lowest energy

       e(v) = TXS_FINE * (sum of rows at v - TXS_ZERO count) + single(v) + noise

   With noise of Gumbel's distribution that is a draw from exp(-e) / sum exp(-e), the Gibbs
   sampler's step [4]. Values are kept even ones first, single[] and noise[] in that order, since
   adding bytes as the halves of 16-bit words yields them so. The rows are those at rows[0],
   rows[apart], ...; their count is even, they hold 1..127. Energies saturate at 16 bits. */
typedef int txs_pick(const uint8_t *const *rows, int apart, int count, const int16_t *single,
                     const int16_t *noise);

static int txs_slot_value(int slot) {
    return (slot & 15) * 2 + (slot >> 4);
}

static void txs_aim_plain(const txs_end *ends, int count, int form, const uint8_t *p, int pixels,
                            const uint8_t **rows) {
    for (int k = 0; k < count; k++, rows += TXS_TOGETHER) {
        const txs_end *e = &ends[k];
        const uint8_t *p1 = p + e->o1, *p2 = p + e->o2, *p3 = p + e->o3, *table = e->table;
        const int stop = pixels * TXS_GRID;
        const uint8_t **row = rows;
        switch (form) {
        case 0:
            for (int x = 0; x < stop; x += TXS_GRID) *row++ = table - p1[x];
            break;
        case 1:
            for (int x = 0; x < stop; x += TXS_GRID)
                *row++ = table + txs_class(p2[x] - p3[x]) * TXS_ROW - p1[x];
            break;
        case 2:
            for (int x = 0; x < stop; x += TXS_GRID)
                *row++ = table + (p2[x] - p1[x]) * TXS_ROW - p1[x];
            break;
        case 3:
            for (int x = 0; x < stop; x += TXS_GRID)
                *row++ = table + e->classes[p1[x]] * TXS_VALUES;
            break;
        default:
            for (int x = 0; x < stop; x += TXS_GRID) *row++ = table + p2[x] * TXS_ROW - p1[x];
        }
    }
}

#ifndef TXS_SSE2
static int txs_pick_plain(const uint8_t *const *rows, int apart, int count, const int16_t *single,
                          const int16_t *noise) {
    int sum[TXS_VALUES] = {0}, best = 0;
    for (int i = 0; i < count; i++)
        for (int v = 0; v < TXS_VALUES; v++) sum[v] += rows[i * apart][v];
    for (int slot = 0, least = INT_MAX; slot < TXS_VALUES; slot++) {
        int e = TXS_FINE * (sum[txs_slot_value(slot)] - TXS_ZERO * count);
        e = txm_clampi(e, INT16_MIN, INT16_MAX) + single[slot] + noise[slot];
        e = txm_clampi(e, INT16_MIN, INT16_MAX);
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

/* TXS_FINE times the summed rows, and the rest */
static __m128i txs_finish(__m128i e, const int16_t *single, const int16_t *noise) {
    e = _mm_adds_epi16(e, e);
    return _mm_adds_epi16(_mm_adds_epi16(e, e), _mm_add_epi16(txs_load(single), txs_load(noise)));
}

/* Sums of words: `all` of the words that two bytes make, `high` of their upper bytes; the sum of the
   lower ones follows. */
static int txs_pick_sse2(const uint8_t *const *rows, int apart, int count, const int16_t *single,
                         const int16_t *noise) {
    __m128i all0 = _mm_setzero_si128(), all1 = all0, high0 = all0, high1 = all0;
    for (int i = 0; i < count; i += 2, rows += 2 * apart) {
        const uint8_t *r = rows[0], *q = rows[apart];
        __m128i a = _mm_add_epi8(txs_load(r), txs_load(q));
        __m128i b = _mm_add_epi8(txs_load(r + 16), txs_load(q + 16));
        all0 = _mm_add_epi16(all0, a);
        all1 = _mm_add_epi16(all1, b);
        high0 = _mm_add_epi16(high0, _mm_srli_epi16(a, 8));
        high1 = _mm_add_epi16(high1, _mm_srli_epi16(b, 8));
    }
    const __m128i zero = _mm_set1_epi16((short)(TXS_ZERO * count));
    __m128i e0 = _mm_sub_epi16(_mm_sub_epi16(all0, _mm_slli_epi16(high0, 8)), zero);
    __m128i e1 = _mm_sub_epi16(_mm_sub_epi16(all1, _mm_slli_epi16(high1, 8)), zero);
    __m128i e2 = _mm_sub_epi16(high0, zero), e3 = _mm_sub_epi16(high1, zero);
    e0 = txs_finish(e0, single, noise);
    e1 = txs_finish(e1, single + 8, noise + 8);
    e2 = txs_finish(e2, single + 16, noise + 16);
    e3 = txs_finish(e3, single + 24, noise + 24);
    __m128i m = txs_least(_mm_min_epi16(_mm_min_epi16(e0, e1), _mm_min_epi16(e2, e3)));
    int first = _mm_movemask_epi8(_mm_packs_epi16(_mm_cmpeq_epi16(e0, m), _mm_cmpeq_epi16(e1, m)));
    int last = _mm_movemask_epi8(_mm_packs_epi16(_mm_cmpeq_epi16(e2, m), _mm_cmpeq_epi16(e3, m)));
    return txs_slot_value(txm_lowest_bit((unsigned)first | (unsigned)last << 16));
}
#endif

#ifdef TXS_AVX2
#define TXS_FOR_AVX2 __attribute__((target("avx2"))) static

TXS_FOR_AVX2 int txs_pick_avx2(const uint8_t *const *rows, int apart, int count,
                               const int16_t *single, const int16_t *noise) {
    __m256i all = _mm256_setzero_si256(), high = all;
    for (int i = 0; i < count; i += 2, rows += 2 * apart) {
        __m256i a = _mm256_add_epi8(_mm256_loadu_si256((const __m256i *)(const void *)rows[0]),
                                    _mm256_loadu_si256((const __m256i *)(const void *)rows[apart]));
        all = _mm256_add_epi16(all, a);
        high = _mm256_add_epi16(high, _mm256_srli_epi16(a, 8));
    }
    const __m256i zero = _mm256_set1_epi16((short)(TXS_ZERO * count));
    const __m256i *s = (const __m256i *)(const void *)single,
                  *n = (const __m256i *)(const void *)noise;
    __m256i e0 = _mm256_sub_epi16(_mm256_sub_epi16(all, _mm256_slli_epi16(high, 8)), zero);
    __m256i e1 = _mm256_sub_epi16(high, zero);
    e0 = _mm256_adds_epi16(e0, e0); /* times TXS_FINE */
    e1 = _mm256_adds_epi16(e1, e1);
    e0 = _mm256_adds_epi16(_mm256_adds_epi16(e0, e0),
                           _mm256_add_epi16(_mm256_loadu_si256(s), _mm256_loadu_si256(n)));
    e1 = _mm256_adds_epi16(_mm256_adds_epi16(e1, e1),
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

#ifdef TXS_LANES
/* TXS_GRID pixels are as many bytes as a 64-bit lane has, so that a lane's lowest byte is the pixel
   of its row, and four rows' addresses are computed at once. */
#define TXS_LOAD4(p) _mm256_loadu_si256((const __m256i *)(const void *)(p))

TXS_FOR_AVX2 void txs_aim_avx2(const txs_end *ends, int count, int form, const uint8_t *p,
                                 int pixels, const uint8_t **rows) {
    const __m256i low = _mm256_set1_epi64x(255);
    /* classes 4 to 8 of differences 0 to 15 without the 4 */
    const __m256i class_of =
        _mm256_broadcastsi128_si256(_mm_setr_epi8(0, 1, 1, 2, 2, 2, 3, 3, 3, 3, 3, 4, 4, 4, 4, 4));
    const __m256i most = _mm256_set1_epi8(15), middle = _mm256_set1_epi8(TXS_CLASSES / 2);
    if (pixels < TXS_TOGETHER) { /* the others may lie beyond the canvas */
        txs_aim_plain(ends, count, form, p, pixels, rows);
        return;
    }
    for (int k = 0; k < count; k++, ends++) {
        const __m256i table = _mm256_set1_epi64x((long long)(intptr_t)ends->table);
        for (int half = 0; half < 2; half++, rows += TXS_TOGETHER / 2) {
            const uint8_t *q = p + half * (TXS_TOGETHER / 2 * TXS_GRID);
            const __m256i p1 = _mm256_and_si256(TXS_LOAD4(q + ends->o1), low);
            __m256i row = _mm256_sub_epi64(table, p1);
            if (form == 1) {
                const __m256i d = _mm256_sub_epi8(TXS_LOAD4(q + ends->o2), TXS_LOAD4(q + ends->o3));
                __m256i known =
                    _mm256_shuffle_epi8(class_of, _mm256_min_epu8(_mm256_abs_epi8(d), most));
                known = _mm256_add_epi8(_mm256_sign_epi8(known, d), middle);
                known = _mm256_and_si256(known, low);
                row = _mm256_add_epi64(row, _mm256_slli_epi64(known, TXS_ROW_BITS));
            } else if (form == 2) {
                const __m256i p2 = _mm256_and_si256(TXS_LOAD4(q + ends->o2), low);
                row = _mm256_add_epi64(row,
                                       _mm256_slli_epi64(_mm256_sub_epi64(p2, p1), TXS_ROW_BITS));
            } else if (form == 3) {
                const __m256i *c = (const __m256i *)(const void *)ends->classes;
                const __m256i both = _mm256_loadu_si256(c);
                const __m256i first = _mm256_permute2x128_si256(both, both, 0x00);
                const __m256i last = _mm256_permute2x128_si256(both, both, 0x11);
                /* an index with its highest bit set gives 0 */
                const __m256i class_ = _mm256_or_si256(
                    _mm256_shuffle_epi8(first, _mm256_add_epi8(p1, _mm256_set1_epi64x(0x70))),
                    _mm256_shuffle_epi8(last, _mm256_sub_epi8(p1, _mm256_set1_epi64x(16))));
                row = _mm256_add_epi64(
                    table, _mm256_slli_epi64(_mm256_and_si256(class_, low), TXS_VALUE_BITS));
            } else if (form == 4) {
                const __m256i label = _mm256_and_si256(TXS_LOAD4(q + ends->o2), low);
                row = _mm256_add_epi64(row, _mm256_slli_epi64(label, TXS_ROW_BITS));
            }
            _mm256_storeu_si256((__m256i *)(void *)rows, row);
        }
    }
}
#endif

static txs_aim *txs_best_aim(void) {
#ifdef TXS_LANES
    if (__builtin_cpu_supports("avx2")) return txs_aim_avx2;
#endif
    return txs_aim_plain;
}

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
    const ptrdiff_t label = 2 * bands * c->plane + e;
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
    case TEXSYN_FILTER: return 0;
    case TEXSYN_CONTEXT: /* the head, the tail; or the tail below its parent */
        form[0] = form[1] = 4;
        ends[0].o1 = parent;
        ends[0].o2 = label;
        ends[0].table = table + block;
        if (t->dx == 0 && t->dy == 0) return 1;
        ends[0].o1 = tail + d;
        ends[1].o1 = tail - d;
        ends[1].o2 = label - d;
        ends[1].table = table;
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

/* Ends of a filter at one pixel, at most, if its tails have one parity. */
static int txs_shape_ends(int shape) {
    int at[TXS_MAX_MEMBERS][2], weight[TXS_MAX_MEMBERS], count[4] = {0}, most = 0;
    const int n = txs_shape_pixels(shape, at, weight);
    for (int i = 0; i < n; i++) {
        const int parity = (at[i][0] & 1) + 2 * (at[i][1] & 1);
        if (++count[parity] > most) most = count[parity];
    }
    return most;
}

/* Ends that a level's types put into one band, at most; a model must stay within TXS_MAX_ENDS. */
static int txs_most_ends(const txs_level *level, int bands) {
    int count[TXS_MAX_BANDS] = {0}, most = 0;
    for (int k = 0; k < level->type_count; k++) {
        const txs_type *t = &level->types[k];
        static const int tail[] = {0, 1, 1, 1, 3, 2, 2, 0, 2}, head[] = {0, 1, 0, 1, 0, 0, 2, 0, 0};
        count[t->band] += t->kind == TEXSYN_FILTER ? txs_shape_ends(t->shape) : tail[t->kind];
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
    case TEXSYN_CONTEXT:
        for (int q = 0; q < TXS_LABELS; q++) {
            for (int i = 0; i < TXS_DIFFERENCES; i++) {
                table[q * ROW + i] = v[q * N + class_of[i]];
                table[BLOCK + q * ROW + i] = v[q * N + class_of[62 - i]];
            }
        }
        break;
    case TEXSYN_FILTER: {
        uint8_t classes[2 * TXS_MAX_RESPONSE + 1];
        txs_response_classes(t->scale, classes);
        for (int i = 0; i < TXS_RESPONSE_ROW; i++) {
            const int r = txm_clampi(i - (TXS_VALUES - 1), 0, 2 * TXS_MAX_RESPONSE);
            table[i] = v[classes[r]];
            table[TXS_RESPONSE_ROW + i] = v[classes[2 * TXS_MAX_RESPONSE - r]];
        }
        break;
    }
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

/* ---- filters ------------------------------------------------------------------------------

   A filter's response at its tail is a sum over many pixels, so it is kept. A pixel that changes
   changes the responses at the tails of all filters that contain it.

   Neighbouring tails say nearly the same, so at a time only those of one parity (x & 1, y & 1) are
   considered, a quarter of all, and another quarter in the next sweep. Their responses form a plane
   of words with half the canvas's rows and columns, so TXS_GRID pixels are 64 bits there as well.

   The canvas's margin has responses too. Parities go on counting there, so on a torus of odd size a
   pixel and its copies have different tails, and all are kept up to date.                   */

typedef struct txs_filter {
    int type;           /* index in the level */
    uint16_t *response; /* plus TXS_MAX_RESPONSE */
    uint8_t class_of[2 * TXS_MAX_RESPONSE + 1];
} txs_filter;

/* A pixel of a filter that has its tail at (x - dx, y - dy). */
typedef struct txs_tap {
    int dx, dy, weight;
    ptrdiff_t tail; /* from (x, y) to the tail in the plane of responses */
    uint16_t *response;
    const uint8_t *table; /* row of the response -TXS_MAX_RESPONSE if the pixel is 0 */
} txs_tap;

enum {
    TXS_EDGE = 8, /* pixels around the canvas that have responses: even, as far as shapes reach */
    TXS_RESPONSE_GRID = TXS_GRID / 2,
    TXS_MAX_TAPS = 8 * TXS_MAX_FILTERS, /* at one pixel */
    TXS_RESPONSE_ROWS = 16              /* rows of responses computed by one task */
};

/* Rows for TXS_TOGETHER pixels at `now`, TXS_GRID apart, `tails` being their responses without the
   taps' own offsets: as txs_aim does it. */
typedef void txs_aim_taps(const txs_tap *taps, int count, const uint8_t *now, ptrdiff_t tails,
                            int pixels, const uint8_t **rows);

/* Add the changes of these pixels to the responses. */
typedef void txs_add_taps(const txs_tap *taps, int count, ptrdiff_t tails, int pixels,
                          const int *delta);

typedef struct txs_filters {
    const txs_canvas *canvas;
    const txs_level *level;
    int count, parity;
    int reach; /* of the filters along an axis; as much of the margin has copies that count */
    ptrdiff_t stride; /* responses in a row */
    int rows;
    txs_aim_taps *aim;
    txs_add_taps *add;
    txs_filter filter[TXS_MAX_FILTERS];
    txs_tap tap[TXS_MAX_BANDS][4][TXS_MAX_TAPS]; /* for pixels of each parity */
    int tap_count[TXS_MAX_BANDS][4];
} txs_filters;

static int txs_parity(int x, int y) {
    return (x & 1) + 2 * (y & 1);
}

/* Pixel (x, y) in the plane of responses, which begins at (-TXS_EDGE, -TXS_EDGE). */
static ptrdiff_t txs_response_index(const txs_filters *f, int x, int y) {
    return ((y + TXS_EDGE) >> 1) * f->stride + ((x + TXS_EDGE) >> 1);
}

/* The smallest rectangle around the pixels of a shape, the tail included: x0, y0, x1, y1. */
static void txs_shape_box(int at[TXS_MAX_MEMBERS][2], int count, int box[4]) {
    memset(box, 0, 4 * sizeof *box);
    for (int i = 0; i < count; i++) {
        for (int k = 0; k < 2; k++) {
            if (at[i][k] < box[k]) box[k] = at[i][k];
            if (at[i][k] > box[k + 2]) box[k + 2] = at[i][k];
        }
    }
}

/* One row of the responses of filter k, of all tails whose pixels lie on the canvas. */
static void txs_filters_row(const txs_filters *f, int k, int y) {
    const txs_canvas *c = f->canvas;
    const txs_type *t = &f->level->types[f->filter[k].type];
    int at[TXS_MAX_MEMBERS][2], weight[TXS_MAX_MEMBERS], box[4];
    const int n = txs_shape_pixels(t->shape, at, weight), m = c->margin;
    txs_shape_box(at, n, box);
    if (y + box[1] < -m || y + box[3] >= c->height + m) return;
    int x0 = -(m + box[0] < TXS_EDGE ? m + box[0] : (int)TXS_EDGE);
    const int x1 = c->width + (m - box[2] < TXS_EDGE ? m - box[2] : (int)TXS_EDGE);
    x0 += (x0 ^ f->parity) & 1;
    if (x1 <= x0) return;
    const int count = (x1 - x0 + 1) / 2;
    uint16_t *row = f->filter[k].response + txs_response_index(f, x0, y);
    for (int i = 0; i < count; i++) row[i] = TXS_MAX_RESPONSE;
    for (int j = 0; j < n; j++) {
        const uint8_t *p = txs_at(c, t->band, x0 + at[j][0], y + at[j][1]);
        if (weight[j] > 0)
            for (int i = 0; i < count; i++) row[i] = (uint16_t)(row[i] + p[2 * i]);
        else
            for (int i = 0; i < count; i++) row[i] = (uint16_t)(row[i] - p[2 * i]);
    }
}

static void txs_filters_rows(void *context, int share) {
    const txs_filters *f = (const txs_filters *)context;
    for (int i = share * TXS_RESPONSE_ROWS; i < (share + 1) * TXS_RESPONSE_ROWS && i < f->rows; i++)
        for (int k = 0; k < f->count; k++)
            txs_filters_row(f, k, 2 * i - TXS_EDGE + (f->parity >> 1));
}

/* Consider the tails of another parity. */
static void txs_filters_turn(txs_filters *f, txm_env *env, int parity, const uint8_t *tables) {
    f->parity = parity;
    memset(f->tap_count, 0, sizeof f->tap_count);
    for (int k = 0; k < f->count; k++) {
        const txs_type *t = &f->level->types[f->filter[k].type];
        int at[TXS_MAX_MEMBERS][2], weight[TXS_MAX_MEMBERS];
        const int n = txs_shape_pixels(t->shape, at, weight);
        const uint8_t *table = tables + (size_t)f->filter[k].type * TXS_TABLE + TXS_VALUES - 1;
        for (int i = 0; i < n; i++) {
            const int own = txs_parity(at[i][0], at[i][1]) ^ parity;
            int *count = &f->tap_count[t->band][own];
            if (*count == TXS_MAX_TAPS) continue; /* cannot be: see txs_shape_ends */
            txs_tap *tap = &f->tap[t->band][own][(*count)++];
            tap->dx = at[i][0];
            tap->dy = at[i][1];
            tap->weight = weight[i];
            tap->response = f->filter[k].response;
            tap->table = table + (weight[i] < 0 ? TXS_RESPONSE_ROW + 2 * TXS_MAX_RESPONSE : 0);
            /* a halved coordinate loses its parity, so these are even */
            tap->tail = ((own >> 1) - (parity >> 1) - at[i][1]) / 2 * f->stride +
                        ((own & 1) - (parity & 1) - at[i][0]) / 2;
        }
    }
    if (f->count)
        txm_parallel_for(env, (f->rows + TXS_RESPONSE_ROWS - 1) / TXS_RESPONSE_ROWS,
                         txs_filters_rows, f);
}

static void txs_aim_taps_plain(const txs_tap *taps, int count, const uint8_t *now,
                                 ptrdiff_t tails, int pixels, const uint8_t **rows) {
    for (int k = 0; k < count; k++, rows += TXS_TOGETHER) {
        const uint16_t *r = taps[k].response + taps[k].tail + tails;
        for (int i = 0; i < pixels; i++)
            rows[i] = taps[k].table + taps[k].weight * r[i * TXS_RESPONSE_GRID] - now[i * TXS_GRID];
    }
}

static void txs_add_taps_plain(const txs_tap *taps, int count, ptrdiff_t tails, int pixels,
                               const int *delta) {
    for (int k = 0; k < count; k++) {
        uint16_t *r = taps[k].response + taps[k].tail + tails;
        for (int i = 0; i < pixels; i++, r += TXS_RESPONSE_GRID)
            *r = (uint16_t)(*r + taps[k].weight * delta[i]);
    }
}

#ifdef TXS_LANES
enum { /* from the first pixel of a batch to the second half of it */
    TXS_HALF_PIXELS = TXS_TOGETHER / 2 * TXS_GRID,
    TXS_HALF_RESPONSES = TXS_HALF_PIXELS / 2
};

TXS_FOR_AVX2 void txs_aim_taps_avx2(const txs_tap *taps, int count, const uint8_t *now,
                                      ptrdiff_t tails, int pixels, const uint8_t **rows) {
    const __m256i byte = _mm256_set1_epi64x(255), word = _mm256_set1_epi64x(65535);
    if (pixels < TXS_TOGETHER) {
        txs_aim_taps_plain(taps, count, now, tails, pixels, rows);
        return;
    }
    const __m256i first = _mm256_and_si256(TXS_LOAD4(now), byte);
    const __m256i last = _mm256_and_si256(TXS_LOAD4(now + TXS_HALF_PIXELS), byte);
    for (int k = 0; k < count; k++, rows += TXS_TOGETHER) {
        const uint16_t *r = taps[k].response + taps[k].tail + tails;
        const __m256i table = _mm256_set1_epi64x((long long)(intptr_t)taps[k].table);
        const __m256i a = _mm256_and_si256(TXS_LOAD4(r), word);
        const __m256i b = _mm256_and_si256(TXS_LOAD4(r + TXS_HALF_RESPONSES), word);
        __m256i u = _mm256_sub_epi64(table, first), v = _mm256_sub_epi64(table, last);
        if (taps[k].weight > 0) {
            u = _mm256_add_epi64(u, a);
            v = _mm256_add_epi64(v, b);
        } else {
            u = _mm256_sub_epi64(u, a);
            v = _mm256_sub_epi64(v, b);
        }
        _mm256_storeu_si256((__m256i *)(void *)rows, u);
        _mm256_storeu_si256((__m256i *)(void *)(rows + TXS_TOGETHER / 2), v);
    }
}

/* The other words of a lane are responses that stay as they are: another pixel's change is added to
   them by the same thread, before or after. */
TXS_FOR_AVX2 void txs_add_taps_avx2(const txs_tap *taps, int count, ptrdiff_t tails, int pixels,
                                    const int *delta) {
    if (pixels < TXS_TOGETHER) {
        txs_add_taps_plain(taps, count, tails, pixels, delta);
        return;
    }
    const __m256i word = _mm256_set1_epi64x(65535);
    const __m256i d = _mm256_loadu_si256((const __m256i *)(const void *)delta);
    const __m256i a = _mm256_and_si256(_mm256_cvtepi32_epi64(_mm256_castsi256_si128(d)), word);
    const __m256i b = _mm256_and_si256(_mm256_cvtepi32_epi64(_mm256_extracti128_si256(d, 1)), word);
    for (int k = 0; k < count; k++) {
        uint16_t *r = taps[k].response + taps[k].tail + tails;
        uint16_t *q = r + TXS_HALF_RESPONSES;
        const __m256i u = TXS_LOAD4(r), v = TXS_LOAD4(q);
        const int plus = taps[k].weight > 0;
        _mm256_storeu_si256((__m256i *)(void *)r,
                            plus ? _mm256_add_epi16(u, a) : _mm256_sub_epi16(u, a));
        _mm256_storeu_si256((__m256i *)(void *)q,
                            plus ? _mm256_add_epi16(v, b) : _mm256_sub_epi16(v, b));
    }
}
#endif

/* Rows of the filters' ends at pixels (x, y), (x + TXS_GRID, y), ... of a band; returns how many. */
static int txs_filters_aim(const txs_filters *f, int band, int x, int y, int pixels,
                             const uint8_t **rows) {
    const int own = txs_parity(x, y), count = f->tap_count[band][own];
    if (count)
        f->aim(f->tap[band][own], count, txs_at(f->canvas, band, x, y),
                 txs_response_index(f, x, y), pixels, rows);
    return count;
}

/* Pixel (x, y) of a band and its copies in the margin have changed by delta. */
static void txs_filters_change_one(const txs_filters *f, int band, int x, int y, int delta) {
    const int w = f->canvas->width, h = f->canvas->height, reach = f->reach;
    for (int yy = y - (y + reach) / h * h; yy < h + reach; yy += h) {
        for (int xx = x - (x + reach) / w * w; xx < w + reach; xx += w) {
            const int own = txs_parity(xx, yy);
            const txs_tap *t = f->tap[band][own], *stop = t + f->tap_count[band][own];
            for (; t < stop; t++) {
                const int tx = xx - t->dx, ty = yy - t->dy;
                if (tx >= -TXS_EDGE && tx < w + TXS_EDGE && ty >= -TXS_EDGE && ty < h + TXS_EDGE)
                    txs_add_taps_plain(t, 1, txs_response_index(f, xx, yy), 1, &delta);
            }
        }
    }
}

/* Pixels (x, y), (x + TXS_GRID, y), ... of a band have changed by delta[]. */
static void txs_filters_change(const txs_filters *f, int band, int x, int y, int pixels,
                               const int *delta) {
    const int own = txs_parity(x, y), reach = f->reach;
    if (f->count == 0) return;
    if (y >= reach && y < f->canvas->height - reach && x >= reach &&
        x + (pixels - 1) * TXS_GRID < f->canvas->width - reach) /* no copies */
        f->add(f->tap[band][own], f->tap_count[band][own], txs_response_index(f, x, y), pixels,
               delta);
    else
        for (int i = 0; i < pixels; i++)
            if (delta[i]) txs_filters_change_one(f, band, x + i * TXS_GRID, y, delta[i]);
}

/* Count the filters whose tail is (x, y). */
static void txs_filters_count(const txs_filters *f, int x, int y, int32_t (*counts)[TXS_BINS]) {
    if (txs_parity(x, y) != f->parity) return;
    const ptrdiff_t at = txs_response_index(f, x, y);
    for (int k = 0; k < f->count; k++) {
        const txs_filter *filter = &f->filter[k];
        counts[filter->type][filter->class_of[filter->response[at]]]++;
    }
}

/* Take the filters among the level's types; there must be as many planes. */
static void txs_filters_find(txs_filters *f) {
    f->count = f->reach = 0;
    for (int k = 0; k < f->level->type_count; k++) {
        const txs_type *t = &f->level->types[k];
        if (t->kind != TEXSYN_FILTER || f->count == TXS_MAX_FILTERS) continue;
        txs_filter *filter = &f->filter[f->count++];
        filter->type = k;
        txs_response_classes(t->scale, filter->class_of);
        if (txs_reach(t) > f->reach) f->reach = txs_reach(t);
    }
}

/* Planes for so many filters; sets arena->failed if there is no memory. */
static void txs_filters_make(txs_filters *f, txm_arena *arena, const txs_level *level,
                             const txs_canvas *canvas, int count) {
    enum { ROUND = 2, LANE = TXS_RESPONSE_GRID }; /* lanes reach so far beyond the last response */
    const size_t stride = ((size_t)canvas->width + 2 * TXS_EDGE + 1) / ROUND;
    const size_t rows = ((size_t)canvas->height + 2 * TXS_EDGE + 1) / ROUND;
    f->canvas = canvas;
    f->level = level;
    f->stride = (ptrdiff_t)stride;
    f->rows = (int)rows;
    f->aim = txs_aim_taps_plain;
    f->add = txs_add_taps_plain;
#ifdef TXS_LANES
    if (__builtin_cpu_supports("avx2")) {
        f->aim = txs_aim_taps_avx2;
        f->add = txs_add_taps_avx2;
    }
#endif
    for (int k = 0; k < count && k < TXS_MAX_FILTERS; k++)
        f->filter[k].response =
            (uint16_t *)txm_arena_zero(arena, stride * rows + LANE, sizeof(uint16_t));
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
    txs_aim *aim;
    txs_pick *pick;
    txs_list list[4]; /* for pixels of each parity, (x & 1) + 2 (y & 1)   */
    int16_t single[TXS_MAX_BANDS][TXS_VALUES];
    uint8_t *tables;                /* TXS_TABLE bytes a type               */
    int32_t (*histogram)[TXS_BINS]; /* TXS_WINDOW times the counts of the last sweep */
    int32_t (*integral)[TXS_BINS];  /* 1/(TXS_NAT TXS_PRECISE) nat          */
    int32_t (*counts)[TXS_BINS];    /* TXS_TASKS times all types            */
    const int16_t *noise;
    txs_filters filters;
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
    for (stop += list->tally_count[4]; t < stop; t++)
        counts[t->type][p[t->c] * TXS_CLASSES + txs_class(p[t->a] - p[t->b])]++;
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
    const uint8_t *rows[(TXS_MAX_ENDS + 2) * TXS_TOGETHER];
    const uint8_t *p = txs_at(s->canvas, 0, x, y);
    const txs_list *list = txs_list_at(s, x, y);
    for (int b = 0; b < s->bands; b++) {
        const txs_end *e = list->ends[b];
        const uint8_t *now = p + b * s->canvas->plane;
        int n = 0;
        for (int form = 0; form < TXS_FORMS; form++) {
            const int ends = list->end_count[b][form];
            s->aim(e, ends, form, p, count, rows + n * TXS_TOGETHER);
            e += ends;
            n += ends;
        }
        n += txs_filters_aim(&s->filters, b, x, y, count, rows + n * TXS_TOGETHER);
        int delta[TXS_TOGETHER] = {0}, any = 0;
        for (int i = 0; i < count; i++) {
            rows[n * TXS_TOGETHER + i] = txs_no_energy;
            int v = s->pick(rows + i, TXS_TOGETHER, (n + 1) & ~1, s->single[b],
                            s->noise + (txm_rng_next(rng) & (TXS_NOISE - 1)));
            if (v >= s->level->values[b]) v = s->level->values[b] - 1;
            delta[i] = v - now[i * TXS_GRID];
            any |= delta[i];
            txs_set(s->canvas, b, x + i * TXS_GRID, y, (uint8_t)v);
        }
        if (any) txs_filters_change(&s->filters, b, x, y, count, delta);
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
                for (int x = sx; x < width; x += TXS_GRID) {
                    if (!txs_is_counted(s, x, y)) continue;
                    txs_count(txs_list_at(s, x, y), txs_at(s->canvas, 0, x, y), counts);
                    txs_filters_count(&s->filters, x, y, counts);
                }
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

static const int txs_turns[4] = {0, 3, 1, 2}; /* parities of filters' tails, sweep by sweep */

/* Visit every pixel once. Progress from..to of the whole work. */
static txm_status txs_sweep(txs_sampler *s, txm_env *env, const char *stage, float from, float to) {
    enum { ALL = TXS_GRID * TXS_GRID };
    const int phases = s->strips > 1 ? 2 : 1, groups = (int)ALL / TXS_GROUP;
    int order[ALL];
    txs_filters_turn(&s->filters, env, txs_turns[s->sweep % 4], s->tables);
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
                list->ends[band[i]][count[0] + count[1] + count[2] + count[3] + count[4]] = ends[i];
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
static void txs_sampler_start(txs_sampler *s, txm_env *env) {
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

    txs_filters_find(&s->filters);
    txs_filters_turn(&s->filters, env, txs_turns[s->sweep % 4], s->tables);
    memset(s->histogram, 0, sizeof *s->histogram * (size_t)types);
    memset(s->counts, 0, sizeof *s->counts * (size_t)(types * s->tasks));
    for (int y = 0; y < c->height; y++) {
        for (int x = 0; x < c->width; x++) {
            if (!txs_is_counted(s, x, y)) continue;
            txs_count(txs_list_at(s, x, y), txs_at(c, 0, x, y), s->histogram);
            txs_filters_count(&s->filters, x, y, s->histogram);
        }
    }
    for (int k = 0; k < types; k++)
        for (int i = 0; i < TXS_BINS; i++) s->histogram[k][i] *= TXS_WINDOW;
    txs_control(s, 0);
}

/* A sampler in the arena's memory for so many types and filters among them; NULL if there is none.
   Call txs_sampler_start before use. */
static txs_sampler *txs_sampler_make(txm_arena *arena, const txs_level *level, int max_types,
                                     int max_filters, const txs_canvas *canvas, int bands,
                                     const int16_t *noise, uint64_t seed) {
    const size_t n = (size_t)max_types;
    txs_sampler *s = (txs_sampler *)txm_arena_zero(arena, 1, sizeof *s);
    if (!s) return NULL;
    s->level = level;
    s->canvas = canvas;
    s->bands = bands;
    s->seed = txm_hash(seed);
    s->aim = txs_best_aim();
    s->pick = txs_best_pick();
    s->noise = noise;
    s->tables = (uint8_t *)txm_arena_zero(arena, n, TXS_TABLE);
    s->histogram = (int32_t(*)[TXS_BINS])txm_arena_zero(arena, n, sizeof *s->histogram);
    s->integral = (int32_t(*)[TXS_BINS])txm_arena_zero(arena, n, sizeof *s->integral);
    s->counts = (int32_t(*)[TXS_BINS])txm_arena_zero(arena, n * TXS_TASKS, sizeof *s->counts);
    txs_filters_make(&s->filters, arena, level, canvas, max_filters);
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
    uint8_t *weight;   /* of colours, see alpha.h; NULL = all are visible      */
    txs_canvas canvas; /* quantised, margin 0                                  */
    int step;          /* statistics are taken from every step-th row          */
} txs_source;

/* Alpha becomes the first band, the one whose shapes are learned. */
static void txs_put_alpha_first(texsyn_model *m) {
    for (int b = m->bands - 1; b > 0; b--) {
        if (!txs_is_alpha(m, b)) continue;
        float row[TXS_MAX_BANDS];
        memcpy(row, m->basis[b], sizeof row);
        memcpy(m->basis[b], m->basis[b - 1], sizeof row);
        memcpy(m->basis[b - 1], row, sizeof row);
    }
}

/* Principal components of the visible colours inside the mask. Rounded as the model file keeps
   them. Alpha is the last band, if it varies. Returns non-zero if it varies more than any colour. */
static int txs_find_bands(texsyn_model *m, const txm_image *im, const txs_source *s) {
    const int colours = m->channels < 3 ? 1 : 3;
    const size_t pixels = (size_t)s->width * (size_t)s->height;
    double mean[4] = {0, 0, 0, 0}, square[4] = {0, 0, 0, 0}, cov[6] = {0, 0, 0, 0, 0, 0};
    double values[3], vectors[3][3], count = 0, visible = 0;
    for (int pass = 0; pass < 2; pass++) {
        for (size_t i = 0; i < pixels; i++) {
            double x[4];
            if (s->mask && !s->mask[i]) continue;
            const double weight = s->weight ? (double)s->weight[i] : 1;
            for (int c = 0; c < m->channels; c++)
                x[c] = 255.0 * (double)txm_image_get(im, (int)(i % (size_t)s->width),
                                                     (int)(i / (size_t)s->width), c) -
                       mean[c];
            for (int c = 0; c < m->channels && !pass; c++)
                square[c] += c < 3 ? weight * x[c] : x[c];
            count += !pass;
            visible += pass ? 0 : weight;
            for (int c = 0, k = 0; c < 3 && pass && visible > 0; c++)
                for (int d = c; d < 3; d++, k++)
                    if (d < colours) cov[k] += weight * (x[c] * x[d]) / visible;
            if (pass && m->channels == 4) square[3] += x[3] * x[3] / count;
        }
        for (int c = 0; c < m->channels && !pass; c++) {
            const double total = c < 3 ? visible : count;
            m->mean[c] = txs_short_float((float)(total > 0 ? square[c] / total : 0));
            mean[c] = (double)m->mean[c];
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
    return square[3] > values[0];
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

/* The mean of 2 x 2 colours as far as they are visible. */
static float txs_visible_mean(const float *p, const uint8_t *weight, size_t row) {
    const size_t at[4] = {0, 1, row, row + 1};
    double sum = 0, total = 0;
    for (int k = 0; k < 4; k++) {
        sum += (double)weight[at[k]] * (double)p[at[k]];
        total += weight[at[k]];
    }
    return txm_float(sum / total);
}

/* The weight of a coarser pixel; not 0 where anything is visible. */
static uint8_t txs_mean_weight(const uint8_t *weight, size_t row) {
    const int sum = weight[0] + weight[1] + weight[row] + weight[row + 1];
    return (uint8_t)(sum > 0 && sum < 4 ? 1 : sum / 4);
}

/* The next coarser level: means of 2 x 2; a pixel belongs to the texture if all four do. */
static void txs_halve(const txs_source *fine, txs_source *s, const texsyn_model *m) {
    const size_t w = (size_t)fine->width;
    float *out = s->value;
    for (int b = 0; b < m->bands; b++) {
        const float *plane = fine->value + (size_t)b * w * (size_t)fine->height;
        const uint8_t *weights = txs_is_alpha(m, b) ? NULL : fine->weight;
        for (int y = 0; y < s->height; y++) {
            for (int x = 0; x < s->width; x++) {
                const size_t at = (size_t)(2 * y) * w + 2 * (size_t)x;
                const float *p = plane + at;
                if (weights && txs_mean_weight(weights + at, w))
                    *out++ = txs_visible_mean(p, weights + at, w);
                else
                    *out++ = txm_float(
                        ((double)p[0] + (double)p[1] + (double)p[w] + (double)p[w + 1]) / 4);
            }
        }
    }
    for (int y = 0; y < s->height && s->weight; y++)
        for (int x = 0; x < s->width; x++)
            s->weight[(size_t)y * (size_t)s->width + (size_t)x] =
                txs_mean_weight(fine->weight + (size_t)(2 * y) * w + 2 * (size_t)x, w);
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

/* How much pixel i of a band counts. */
static size_t txs_count_of(const txs_source *s, const uint8_t *weight, size_t i) {
    if (s->mask && !s->mask[i]) return 0;
    return weight ? weight[i] : 1;
}

/* Choose the quantisation of a band: 32 steps between the 0.1 and 99.9 percentiles, but no finer
   than one gray level; and quantise. weight: of the pixels, or NULL. Returns the share of a step
   that the values fill. */
static float txs_quantise_band(txs_level *l, int band, txs_source *s, const uint8_t *weight) {
    enum { FINE = 4096 };
    const size_t pixels = (size_t)s->width * (size_t)s->height;
    const float *v = s->value + (size_t)band * pixels;
    uint8_t *q = s->canvas.pixels + band * s->canvas.plane;
    double low = 1e300, high = -1e300;
    size_t count = 0, seen = 0, histogram[FINE] = {0};
    for (size_t i = 0; i < pixels; i++) {
        const size_t counts = txs_count_of(s, weight, i);
        if (!counts) continue;
        low = (double)v[i] < low ? (double)v[i] : low;
        high = (double)v[i] > high ? (double)v[i] : high;
        count += counts;
    }
    const double bin = (high - low) / (double)FINE;
    for (size_t i = 0; i < pixels && bin > 0; i++) {
        const size_t counts = txs_count_of(s, weight, i);
        if (counts)
            histogram[txm_clampi((int)(((double)v[i] - low) / bin), 0, FINE - 1)] += counts;
    }
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
        if (fabs(off) <= 0.5) spread += (double)txs_count_of(s, weight, i) * (off * off);
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

/* How the first band of the level above changes and curves at p: the squared gradient by Sobel's
   filter, the Laplacian, both of pixels that are `step` apart in x and `row` in y. */
static void txs_look(const uint8_t *p, const ptrdiff_t x[2], const ptrdiff_t y[2], int *gradient,
                     int *curve) {
    const int gx = p[y[0] + x[1]] + 2 * p[x[1]] + p[y[1] + x[1]] - p[y[0] + x[0]] - 2 * p[x[0]] -
                   p[y[1] + x[0]];
    const int gy = p[y[1] + x[0]] + 2 * p[y[1]] + p[y[1] + x[1]] - p[y[0] + x[0]] - 2 * p[y[0]] -
                   p[y[0] + x[1]];
    *gradient = gx * gx + gy * gy;
    *curve = p[x[0]] + p[x[1]] + p[y[0]] + p[y[1]] - 4 * p[0];
}

/* Visit the labels' arguments; at a border without margin the last pixel is repeated. */
static void txs_look_at(const txs_canvas *c, int bands, int x, int y, int *gradient, int *curve) {
    enum { R = TXS_LABEL_REACH };
    const int wrap = c->margin >= R;
    const ptrdiff_t dx[2] = {wrap || x >= R ? -R : -x,
                             wrap || x + R < c->width ? R : c->width - 1 - x};
    const ptrdiff_t dy[2] = {c->stride * (wrap || y >= R ? -R : -y),
                             c->stride * (wrap || y + R < c->height ? R : c->height - 1 - y)};
    txs_look(txs_at(c, bands, x, y), dx, dy, gradient, curve);
}

/* Fill the plane of labels from the parent plane of the first band: by thirds of the gradient, 0 to
   2, plus 3 times thirds of the curvature. */
static void txs_fill_labels(const txs_level *level, txs_canvas *canvas, int bands) {
    for (int y = 0; y < canvas->height; y++) {
        uint8_t *label = txs_at(canvas, 2 * bands, 0, y);
        for (int x = 0; x < canvas->width; x++) {
            int gradient, curve;
            txs_look_at(canvas, bands, x, y, &gradient, &curve);
            label[x] =
                (uint8_t)((gradient > level->gradient_cut[0]) +
                          (gradient > level->gradient_cut[1]) +
                          3 * ((curve > level->curve_cut[0]) + (curve > level->curve_cut[1])));
        }
    }
    txs_wrap(canvas, 2 * bands);
}

/* Choose the limits of the labels: thirds of the example. weight: of the first band, or NULL.
   Returns 0 if there is no memory. */
static int txs_cut_labels(txs_level *level, const txs_source *s, const uint8_t *weight, int bands,
                          txm_arena *arena) {
    enum { CURVES = 8 * TXS_VALUES + 1 };
    uint32_t *gradients =
        (uint32_t *)txm_arena_zero(arena, TXS_MAX_GRADIENT + 1, sizeof *gradients);
    uint32_t curves[CURVES] = {0}, count = 0;
    if (!gradients) return 0;
    for (int y = 0; y < s->height; y++) {
        for (int x = 0; x < s->width; x++) {
            int gradient, curve;
            const size_t i = (size_t)y * (size_t)s->width + (size_t)x;
            if ((s->mask && !s->mask[i]) || (weight && !weight[i])) continue;
            txs_look_at(&s->canvas, bands, x, y, &gradient, &curve);
            gradients[gradient]++;
            curves[curve + CURVES / 2]++;
            count++;
        }
    }
    for (uint32_t i = 0; i < 2; i++) {
        const uint32_t part = (i + 1) * (count / 3);
        uint32_t seen = 0;
        int g = 0, k = 0;
        while (g < TXS_MAX_GRADIENT && (seen += gradients[g]) < part) g++;
        for (seen = 0; k < CURVES - 1 && (seen += curves[k]) < part;) k++;
        level->gradient_cut[i] = g;
        level->curve_cut[i] = k - CURVES / 2;
    }
    return 1;
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

enum { TXS_RESPONSES_TOGETHER = 256 };

/* The responses of a filter at count tails from (x, y) on. */
static void txs_responses(const txs_canvas *c, const txs_type *t, int x, int y, int count,
                          int16_t *response) {
    int at[TXS_MAX_MEMBERS][2], weight[TXS_MAX_MEMBERS];
    const int n = txs_shape_pixels(t->shape, at, weight);
    memset(response, 0, (size_t)count * sizeof *response);
    for (int k = 0; k < n; k++) {
        const uint8_t *p = txs_at(c, t->band, x + at[k][0], y + at[k][1]);
        const int w = weight[k];
        for (int i = 0; i < count; i++) response[i] = (int16_t)(response[i] + w * p[i]);
    }
}

/* The tails whose members lie inside an image: x, y of the first, and after the last. */
static void txs_find_tails(int at[TXS_MAX_MEMBERS][2], int members, int width, int height,
                           int inside[4]) {
    const int size[2] = {width, height};
    for (int k = 0; k < 2; k++) {
        inside[k] = 0;
        inside[k + 2] = size[k];
        for (int i = 0; i < members; i++) {
            if (-at[i][k] > inside[k]) inside[k] = -at[i][k];
            if (size[k] - at[i][k] < inside[k + 2]) inside[k + 2] = size[k] - at[i][k];
        }
    }
}

/* Which pixels of an example count: those inside the mask; with weights, by the least weight of a
   clique's members. */
typedef struct txs_stencil {
    const uint8_t *mask, *weight; /* a byte for each pixel; NULL = all are inside, or weigh 1 */
    int width;
} txs_stencil;

/* How much the clique at (x, y) counts. */
static uint32_t txs_clique_weight(const txs_stencil *s, int at[TXS_MAX_MEMBERS][2], int members,
                                  int x, int y) {
    uint32_t least = s->weight ? (uint32_t)TXS_OPAQUE : 1;
    for (int i = 0; i < members; i++) {
        const ptrdiff_t p = (ptrdiff_t)(y + at[i][1]) * s->width + x + at[i][0];
        if (s->mask && !s->mask[p]) least = 0;
        if (s->weight && s->weight[p] < least) least = s->weight[p];
    }
    return s->weight ? txs_counts_of(least) : least;
}

/* Histogram of a clique type over a canvas: of the example (stencil), cliques that lie inside it and
   count; of a synthesised canvas (NULL) all of them. Every step-th row. Returns the number of
   cliques; share[] sums to about TXS_ONE. */
static int64_t txs_measure(const txs_canvas *c, const txs_stencil *stencil, int step, int bands,
                           const txs_level *level, const txs_type *t, int32_t share[TXS_BINS]) {
    const int is_partial = stencil && (stencil->mask || stencil->weight);
    int at[TXS_MAX_MEMBERS][2], inside[4] = {0, 0, c->width, c->height};
    const int members = txs_footprint(t, at);
    uint32_t h[2][TXS_BINS + 15];
    const txs_tally y = txs_tally_make(t, level, c, bands);
    int64_t total = 0;
    memset(h, 0, sizeof h);
    if (stencil) txs_find_tails(at, members, c->width, c->height, inside);
    const int x0 = inside[0], y0 = inside[1], x1 = inside[2], y1 = inside[3];
    uint8_t class_of[2 * TXS_MAX_RESPONSE + 1];
    if (t->kind == TEXSYN_FILTER) txs_response_classes(t->scale, class_of);
    for (int row = y0; row < y1; row += step) {
        const uint8_t *p = txs_at(c, 0, 0, row);
        if (is_partial || t->phase) {
            for (int x = x0; x < x1; x++) {
                if (!txs_is_tail(t, x, row)) continue;
                const uint32_t weight =
                    is_partial ? txs_clique_weight(stencil, at, members, x, row) : 1;
                if (!weight) continue;
                if (t->kind == TEXSYN_FILTER) {
                    int16_t r;
                    txs_responses(c, t, x, row, 1, &r);
                    h[0][class_of[r + TXS_MAX_RESPONSE]] += weight;
                } else {
                    h[0][txs_bin(&y, p + x)] += weight;
                }
            }
        } else if (t->kind == TEXSYN_FILTER) {
            int16_t r[TXS_RESPONSES_TOGETHER];
            for (int x = x0, n; x < x1; x += n) {
                n = x1 - x < TXS_RESPONSES_TOGETHER ? x1 - x : (int)TXS_RESPONSES_TOGETHER;
                txs_responses(c, t, x, row, n, r);
                for (int i = 0; i < n; i++) h[i & 1][class_of[r[i] + TXS_MAX_RESPONSE]]++;
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
    return stencil && stencil->weight ? (total + TXS_OPAQUE - 1) / TXS_OPAQUE : total;
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
    int step;   /* the canvas is measured on every step-th row */
    int shapes; /* filters and labels may be chosen too        */
} txs_learner;

/* What counts in the example for a type: cliques that alpha is part of count whole. */
static txs_stencil txs_stencil_of(const txs_learner *a, const txs_type *t) {
    const int has_alpha = txs_is_alpha(a->model, t->band) || txs_is_alpha(a->model, t->other);
    const txs_stencil s = {a->source->mask, has_alpha ? NULL : a->source->weight,
                           a->source->width};
    return s;
}

static txs_type *txs_add_type(txs_level *l, int kind, int band, int other, int dx, int dy) {
    TEXSYN_ASSERT(l->type_count < TXS_MAX_TYPES);
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

/* What a filter's last classes begin at: the example's 99.5th percentile. */
static int txs_find_scale(const txs_learner *a, const txs_type *t) {
    const txs_source *s = a->source;
    int at[TXS_MAX_MEMBERS][2], inside[4];
    const int members = txs_footprint(t, at);
    uint32_t h[TXS_MAX_RESPONSE + 1] = {0}, count = 0, seen = 0;
    int16_t r[TXS_RESPONSES_TOGETHER];
    const txs_stencil stencil = txs_stencil_of(a, t);
    const int is_partial = stencil.mask || stencil.weight;
    txs_find_tails(at, members, s->width, s->height, inside);
    for (int y = inside[1]; y < inside[3]; y += s->step) {
        for (int x = inside[0], n; x < inside[2]; x += n) {
            n = inside[2] - x < TXS_RESPONSES_TOGETHER ? inside[2] - x
                                                       : (int)TXS_RESPONSES_TOGETHER;
            txs_responses(&s->canvas, t, x, y, n, r);
            for (int i = 0; i < n; i++) {
                const uint32_t weight =
                    is_partial ? txs_clique_weight(&stencil, at, members, x + i, y) : 1;
                h[abs(r[i])] += weight;
                count += weight;
            }
        }
    }
    int scale = TXS_MAX_RESPONSE;
    while (scale > 1 && (seen += h[scale]) <= count / 200) scale--;
    return scale;
}

/* Filters, and differences beside the labels of the level above. */
static void txs_list_shapes(txs_learner *a, const float *seen) {
    static const int contexts[][4] = {{0, 0, 0, 0},   {1, 0, 0, 0}, {0, 1, 0, 0}, {1, 1, 0, 0},
                                      {-1, 1, 0, 0},  {2, 0, 1, 0}, {0, 2, 0, 1}, {2, 2, 1, 1},
                                      {-2, 2, -1, 1}, {3, 0, 1, 0}, {0, 3, 0, 1}, {3, 3, 1, 1},
                                      {-3, 3, -1, 1}, {4, 0, 2, 0}, {0, 4, 0, 2}};
    if (a->index + 1 < a->model->levels)
        for (size_t i = 0; i < sizeof contexts / sizeof *contexts; i++)
            txs_add_candidate(a, TEXSYN_CONTEXT, 0, 0, contexts[i], TXS_CONTOUR_WEIGHT * seen[0]);
    for (int i = 0; i < TXS_SHAPES; i++) {
        const int d[4] = {txs_shapes[i].dx, txs_shapes[i].dy, txs_shapes[i].ex, txs_shapes[i].ey};
        if (a->candidate_count == a->capacity) return;
        txs_candidate *c = &a->candidates[a->candidate_count++];
        memset(c, 0, sizeof *c);
        c->type.kind = TEXSYN_FILTER;
        c->type.dx = d[0];
        c->type.dy = d[1];
        c->type.ex = d[2];
        c->type.ey = d[3];
        c->type.shape = i;
        c->type.scale = txs_find_scale(a, &c->type);
        c->weight = TXS_CONTOUR_WEIGHT * seen[0];
    }
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
    const txs_stencil stencil = txs_stencil_of(a, &c->type);
    int64_t n = txs_measure(&a->source->canvas, &stencil, a->source->step, a->model->bands,
                            a->level, &c->type, c->type.share);
    int64_t m = (int64_t)a->canvas->width * a->canvas->height / a->step;
    c->noise = n ? txm_float(sqrt(1.0 / (double)n + 1.0 / (double)m)) : 0;
    if (!n) c->weight = 0;
}

static void txs_measure_canvas(void *context, int i) {
    txs_learner *a = (txs_learner *)context;
    txs_candidate *c = &a->candidates[i];
    int32_t share[TXS_BINS];
    txs_measure(a->canvas, NULL, a->step, a->model->bands, a->level, &c->type, share);
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
        const txs_stencil stencil = txs_stencil_of(a, t);
        txs_measure(&a->source->canvas, &stencil, 1, bands, a->level, t, t->share);
        txs_make_classes(a->model, a->level, b);
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
        const txs_stencil stencil = txs_stencil_of(a, &t);
        if (txs_measure(&a->source->canvas, &stencil, a->source->step, bands, a->level, &t,
                        t.share) > 0)
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
                          : a->source->weight    ? TXS_TYPES_CUTOUT
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
    txs_sampler *s = txs_sampler_make(&arena, a->level, TXS_MAX_TYPES, TXS_SHAPES, a->canvas, bands,
                                      noise, txm_hash(a->desc->seed) + 64 + (uint64_t)a->index);
    if (arena.failed) {
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to learn the model");
        goto done;
    }

    txs_preselect(a);
    for (int b = 0; b < bands; b++) seen[b] = txs_visibility(a->level, b);
    txs_list_candidates(a, reach, seen);
    if (a->shapes) txs_list_shapes(a, seen);
    txm_parallel_for(env, a->candidate_count, txs_measure_example, a);
    txs_start_canvas(a->level, a->canvas, bands, !top,
                     txm_hash(a->desc->seed) + (uint64_t)a->index);

    /* steps 3 to 6 of [1]; what was synthesised so far, and its potentials, are kept */
    for (;;) {
        txs_sampler_start(s, env);
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
    int version;      /* of the format                                    */
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
    txs_context place[4][TXS_KINDS], share[TXS_KINDS][8], potential[TXS_KINDS][8];
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
    else if (same && t->kind != TEXSYN_SINGLE && t->kind != TEXSYN_CORNER &&
             t->kind != TEXSYN_CONTEXT)
        mirror = TXS_REVERSED;
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

/* A filter within its band. */
static void txs_code_filter(txs_coder *c, txs_type *t) {
    t->other = t->band;
    t->shape = txs_limited(c, 4, 0, TXS_SHAPES - 1, t->shape);
    t->scale = txs_limited(c, 9, 1, TXS_MAX_RESPONSE, t->scale);
    t->dx = txs_shapes[t->shape].dx;
    t->dy = txs_shapes[t->shape].dy;
    t->ex = txs_shapes[t->shape].ex;
    t->ey = txs_shapes[t->shape].ey;
}

static void txs_code_type(txs_coder *c, txs_codec *z, txs_type *t, const texsyn_model *m,
                          int level) {
    if (c->version == 1) t->kind = txs_limited(c, 3, TEXSYN_PAIR, TEXSYN_PARALLEL, t->kind);
    else t->kind = txs_limited(c, 3, TEXSYN_PAIR, TEXSYN_CONTEXT, t->kind);
    t->band = txs_limited(c, 2, 0, m->bands - 1, t->band);
    t->phase = t->kind == TEXSYN_PAIR ? txs_limited(c, 2, 0, 2, t->phase) : 0;
    if (t->kind == TEXSYN_FILTER) {
        txs_code_filter(c, t);
        return;
    }
    t->other = t->kind == TEXSYN_CORNER || t->kind == TEXSYN_CONTEXT
                   ? t->band
                   : txs_limited(c, 2, 0, m->bands - 1, t->other);
    if ((t->kind == TEXSYN_PARENT || t->kind == TEXSYN_SCALE || t->kind == TEXSYN_CONTEXT) &&
        level + 1 == m->levels)
        c->bad = 1;
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
    if (t->kind != TEXSYN_PARENT && same_d && t->kind != TEXSYN_CONTEXT &&
        (t->band == t->other || t->kind >= TEXSYN_CORNER))
        c->bad = 1;
    if (t->kind == TEXSYN_CORNER && (same_e || equal)) c->bad = 1;
    if (t->kind == TEXSYN_PARALLEL && t->band == t->other && (same_e || equal || opposite))
        c->bad = 1;
    /* and so would members that are drawn at the same time, see txs_visit */
    int at[TXS_MAX_MEMBERS][2], drawn = txs_footprint(t, at);
    if (t->kind == TEXSYN_SCALE || t->kind == TEXSYN_CONTEXT) drawn = 2;
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

/* The limits between the labels. */
static void txs_code_labels(txs_coder *c, txs_level *l) {
    for (int i = 0; i < 2; i++) {
        l->gradient_cut[i] = txs_limited(c, 15, 0, TXS_MAX_GRADIENT, l->gradient_cut[i]);
        l->curve_cut[i] = txs_limited(c, 9, -4 * TXS_VALUES, 4 * TXS_VALUES, l->curve_cut[i]);
    }
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
    txs_contexts_init(&z->place[0][0], 4 * TXS_KINDS);
    txs_contexts_init(&z->share[0][0], TXS_KINDS * 8);
    txs_contexts_init(&z->potential[0][0], TXS_KINDS * 8);
    for (int i = m->levels - 1; i >= 0 && !c->bad; i--) {
        txs_level *l = &m->level[i];
        for (int b = 0; b < m->bands; b++) {
            l->values[b] = txs_limited(c, 5, 1, TXS_VALUES, l->values[b]);
            l->low[b] = txs_real(c, l->low[b]);
            l->step[b] = txs_real(c, l->step[b]);
            if (!(l->step[b] > 1e-6f)) c->bad = 1;
        }
        if (c->version > 1 && i + 1 < m->levels) txs_code_labels(c, l);
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
            if (k < m->bands && !c->bad) txs_make_classes(m, l, k);
        }
        int filters = 0;
        for (int k = 0; k < l->type_count && !c->bad; k++)
            filters += l->types[k].kind == TEXSYN_FILTER;
        if (filters > TXS_MAX_FILTERS) c->bad = 1;
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

/* Does the file end in the CRC of what comes before? */
static int txs_is_intact(const uint8_t *bytes, size_t size) {
    uint32_t crc = 0;
    if (size < TXS_MAGIC_BYTES + TXS_CRC_BYTES || size - TXS_CRC_BYTES > TXS_MAX_FILE) return 0;
    size -= TXS_CRC_BYTES;
    for (int i = 0; i < TXS_CRC_BYTES; i++) crc |= (uint32_t)bytes[size + (size_t)i] << 8 * i;
    return crc == txs_crc(bytes, size);
}

/* A coder that reads a file; the last of the magic bytes is the version. */
static txs_coder txs_reader(const uint8_t *bytes, size_t size) {
    txs_coder c;
    memset(&c, 0, sizeof c);
    c.reading = 1;
    c.version = bytes[TXS_MAGIC_BYTES - 1] - '0';
    c.in = bytes;
    c.at = TXS_MAGIC_BYTES;
    c.size = size - TXS_CRC_BYTES;
    txs_coder_start(&c);
    return c;
}

/* What has a description that serves for both directions, as txs_code_model is one. */
typedef void txs_described(txs_coder *c, void *what);

/* Write a file: magic bytes with the version, the code, the CRC. See texsyn_save. */
static txm_status txs_write(const char *magic, int version, txs_described *describe, void *what,
                            txm_env *env, void *buffer, size_t capacity, size_t *size) {
    for (int writing = 0; writing < (buffer ? 2 : 1); writing++) {
        uint8_t *bytes = writing ? (uint8_t *)buffer : NULL; /* the first time only to count */
        txs_coder c;
        memset(&c, 0, sizeof c);
        c.out = bytes;
        c.version = version;
        c.size = capacity;
        for (int i = 0; i < TXS_MAGIC_BYTES - 1; i++) txs_put(&c, (uint8_t)magic[i]);
        txs_put(&c, (uint8_t)('0' + version));
        txs_coder_start(&c);
        describe(&c, what);
        txs_coder_finish(&c);
        *size = c.at + TXS_CRC_BYTES;
        if (buffer && capacity < *size)
            return txm_fail(env, TXM_TOO_SMALL, "save: the buffer is smaller than *size says");
        if (!writing) continue;
        const uint32_t crc = txs_crc(bytes, c.at);
        for (int i = 0; i < TXS_CRC_BYTES; i++) bytes[c.at + (size_t)i] = (uint8_t)(crc >> 8 * i);
    }
    return TXM_OK;
}

typedef struct txs_described_model {
    texsyn_model *model;
    txs_codec *codec;
} txs_described_model;

static void txs_describe_model(txs_coder *c, void *what) {
    txs_described_model *m = (txs_described_model *)what;
    txs_code_model(c, m->model, m->codec);
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
    if (arena.failed) {
        txm_arena_free(&arena);
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to save the model");
    }
    *copy = *model; /* the coder stores what it codes, so it works on a copy */
    for (int i = 0; i < model->levels; i++) {
        const txs_level *l = &model->level[i];
        copy->level[i].types = types + i * TXS_MAX_TYPES;
        memcpy(copy->level[i].types, l->types, sizeof *types * (size_t)l->type_count);
    }
    txs_described_model what = {copy, z};
    const txm_status status =
        txs_write("TXS", copy->version, txs_describe_model, &what, env, buffer, capacity, size);
    txm_arena_free(&arena);
    return status;
}

TEXSYN_API txm_status texsyn_load(const void *data, size_t size, txm_env *env, texsyn_model **out) {
    const uint8_t *bytes = (const uint8_t *)data;
    if (out) *out = NULL;
    if (!data || !out) return txm_fail(env, TXM_BAD_ARGUMENT, "load: data or out is NULL");
    if (size < TXS_MAGIC_BYTES + TXS_CRC_BYTES || (memcmp(bytes, "TXS1", TXS_MAGIC_BYTES) != 0 &&
                                                   memcmp(bytes, "TXS2", TXS_MAGIC_BYTES) != 0))
        return txm_fail(env, TXM_BAD_DATA, "not a texsyn model");
    if (!txs_is_intact(bytes, size))
        return txm_fail(env, TXM_BAD_DATA, "the model is damaged or cut short");

    texsyn_model *m = txs_model_make(env);
    txs_codec *z = (txs_codec *)txm_alloc(env, sizeof *z);
    txs_coder c = txs_reader(bytes, size);
    int enough = m && z;
    if (enough) {
        m->version = c.version;
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
    if ((status = txs_check_mask(&d->mask, &d->example, "mask", env)) != TXM_OK) return status;
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

/* Bands of the example at full resolution; hidden pixels get borrowed colours. s->weight: room for
   the weights, set to NULL if there is no need of them. Returns 0 if there is no memory. */
static int txs_split_visible(texsyn_model *m, const txm_image *im, txs_source *s,
                             txm_arena *arena) {
    const size_t pixels = (size_t)s->width * (size_t)s->height;
    if (s->weight && !txs_weigh(im, s->mask, s->weight)) s->weight = NULL;
    if (txs_find_bands(m, im, s) && s->weight) txs_put_alpha_first(m);
    txs_split(m, im, s);
    if (!s->weight) return 1;
    uint32_t visible = 0, *list = (uint32_t *)txm_arena_alloc(arena, pixels, sizeof *list);
    for (int b = 0; b < m->bands && list; b++)
        if (!txs_is_alpha(m, b))
            visible = txs_borrow(s->value + (size_t)b * pixels, s->weight, s->width, s->height, list);
    if (!visible) s->weight = NULL;
    return list != NULL;
}

/* Are there enough pixels inside the mask, and a visible one? */
static int txs_is_enough(const txs_source *s) {
    const size_t pixels = (size_t)s->width * (size_t)s->height;
    size_t inside = 0, visible = 0;
    for (size_t i = 0; i < pixels && s->mask; i++) inside += s->mask[i] != 0;
    for (size_t i = 0; i < pixels && s->weight; i++)
        visible += (!s->mask || s->mask[i]) && s->weight[i];
    return (!s->mask || inside >= 256) && (!s->weight || visible);
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
        if (m->channels == 4) s->weight = (uint8_t *)txm_arena_alloc(arena, pixels, 1);
        s->canvas.width = s->width;
        s->canvas.height = s->height;
        s->canvas.stride = s->width;
        s->canvas.plane = (ptrdiff_t)pixels;
        s->canvas.pixels = (uint8_t *)txm_arena_zero(arena, pixels, 2 * (size_t)m->channels + 1);
        if (arena->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the example");
        if (i == 0) {
            if (s->mask && txm_mask_read(&desc->mask, TXM_MASK_ALLOWS, s->mask) < 256)
                return txm_fail(env, TXM_TOO_SMALL,
                                "mask: fewer than 256 pixels (16 x 16) count; they do where gray "
                                "times alpha is at least half");
            if (!txs_split_visible(m, im, s, arena))
                return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the example");
        } else {
            if (!source[i - 1].weight) s->weight = NULL;
            txs_halve(&source[i - 1], s, m);
            if (!txs_is_enough(s)) { /* too little of an irregular region is left at this level */
                m->levels = i;
                break;
            }
        }
        for (int b = 0; b < m->bands; b++) {
            float fill = txs_quantise_band(&m->level[i], b, s, txs_is_alpha(m, b) ? NULL : s->weight);
            if (i == 0) m->dither[b] = fill;
        }
    }
    for (int i = m->levels - 2; i >= 0; i--) {
        txs_fill_parent(&m->level[i + 1], &source[i + 1].canvas, &m->level[i], &source[i].canvas,
                        m->bands);
        if (!txs_cut_labels(&m->level[i], &source[i], txs_is_alpha(m, 0) ? NULL : source[i].weight,
                            m->bands, arena))
            return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the example");
        txs_fill_labels(&m->level[i], &source[i].canvas, m->bands);
    }
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
    m->version = TXS_VERSION;
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
        a.shapes = 1;
        a.level->types = (txs_type *)txm_arena_zero(&arena, TXS_MAX_TYPES, sizeof(txs_type));
        const int margin = i + 1 == m->levels ? TXS_MAX_REACH : TXS_NEAR;
        if (!a.level->types ||
            !txs_canvas_make(&canvas, env, txm_clampi(source[i].width, 128, 256),
                             txm_clampi(source[i].height, 128, 256), margin, 2 * m->bands + 1)) {
            status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to learn the model");
            goto done;
        }
        if (above.pixels) {
            txs_fill_parent(a.level + 1, &above, a.level, &canvas, m->bands);
            txs_fill_labels(a.level, &canvas, m->bands);
        }
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
    int width, height, margin = TXS_LABEL_REACH, filters = 0;
    txs_canvas coarse = job->canvas;
    txs_canvas_size(&job->desc, i, &width, &height);
    for (int k = 0; k < l->type_count; k++) {
        int reach = txs_reach(&l->types[k]);
        if (reach > margin) margin = reach;
        filters += l->types[k].kind == TEXSYN_FILTER;
    }
    txm_arena_free(&job->level_arena);
    job->sampler = NULL;
    if (!txs_canvas_make(&job->canvas, &job->memory, width, height, margin, 2 * m->bands + 1)) {
        job->canvas = coarse;
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the canvas");
    }
    job->sampler =
        txs_sampler_make(&job->level_arena, l, l->type_count, filters, &job->canvas, m->bands,
                         job->noise, txm_hash(job->desc.seed) + 128 + (uint64_t)i);
    if (!job->sampler) {
        txs_canvas_free(&job->canvas, &job->memory);
        job->canvas = coarse;
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the sampler");
    }
    if (coarse.pixels) {
        txs_fill_parent(l + 1, &coarse, l, &job->canvas, m->bands);
        txs_fill_labels(l, &job->canvas, m->bands);
    }
    txs_start_canvas(l, &job->canvas, m->bands, coarse.pixels != NULL,
                     txm_hash(job->desc.seed) + (uint64_t)i);
    txs_canvas_free(&coarse, &job->memory);
    txs_sampler_start(job->sampler, env);
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

/* All of the picture; out is untouched after an error. */
static txm_status txs_paint_picture(const texsyn_job *job, txm_env *env, const txm_image *out) {
    const int can_hide = job->desc.model->channels == TXS_MAX_BANDS;
    const int wrap = job->desc.tileable ? TXM_WRAP_X | TXM_WRAP_Y : 0;
    txm_arena arena;
    txm_image to;
    txm_arena_init(&arena, env);
    txm_status status = txs_easel(out, can_hide, &arena, env, &to);
    if (status == TXM_OK) {
        txs_painter painter = {job, &to, job->level < 0 ? 0 : job->level};
        txm_parallel_for(env, (to.height + TXS_PAINT_ROWS - 1) / TXS_PAINT_ROWS, txs_paint,
                         &painter);
        status = txs_hang(&to, out, wrap, env);
    }
    txm_arena_free(&arena);
    return status;
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
    return txs_paint_picture(job, env, &out);
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

/* ---- sampling a mosaic -------------------------------------------------------------------

   As sampler.h does, with these differences. Only free pixels are visited. They are listed by strip,
   sub-lattice and label, and those of one list are drawn in batches, wherever they lie. Each label
   has its own clique types, tables and histograms, which count cliques with a free tail. Pure pixels
   look at no label; at others an end counts if its guard holds. Beside the types of the labels there
   are crossing ones: VALUES whose tail has one label and whose head another, each in the classes of
   its own model.                                                                             */

/* A clique type across a border. */
typedef struct txs_crossing {
    int tail, head; /* labels */
    txs_type type;  /* VALUES */
} txs_crossing;

enum {
    TXS_MAX_CROSSINGS = 256, /* of one level */
    TXS_CROSS_ENDS = 96,     /* of one label and band */
    TXS_SOFT_CROSSING = 40  /* see txs_soften; ours, by trial */
};

/* What the pixels of one label and parity take part in. */
typedef struct txs_part {
    txs_list list;
    txs_guard guard[TXS_MAX_BANDS][TXS_MAX_ENDS]; /* of the ends   */
    txs_guard tally_guard[TXS_MAX_TYPES];         /* of the tallies */
    txs_end cross[TXS_MAX_BANDS][TXS_CROSS_ENDS]; /* of crossing types */
    txs_guard cross_guard[TXS_MAX_BANDS][TXS_CROSS_ENDS];
    int cross_count[TXS_MAX_BANDS];
} txs_part;

typedef struct txs_brush { /* the sampler */
    const txs_mosaic *mosaic;
    const txs_texture *texture; /* of each label */
    const txs_crossing *crossing;
    int crossings;
    int parities; /* 4 if there are parents, else 1 */
    int refresh;  /* sub-lattices between two looks at the histograms */
    int softness; /* see txs_soften */
    uint64_t seed;
    txs_pick *pick;
    const int16_t *noise;
    txs_part *part;                /* parities for each label */
    int16_t (*single)[TXS_VALUES]; /* TXS_MAX_BANDS for each label */
    /* of each type: its place is base[label] + index; those of crossing types follow */
    int capacity, base[TXS_MAX_LABELS + 1];
    int *active, active_count; /* places in use */
    uint8_t *tables;
    int32_t (*histogram)[TXS_BINS], (*integral)[TXS_BINS];
    int32_t (*counts)[TXS_BINS]; /* TXS_TASKS times all places */
    txs_gain *gain;
    /* pixels: lists in the order of strips, sub-lattices, labels */
    int32_t *pixel;
    txs_pixels *list;
    uint8_t *purity; /* of each pixel of the canvas */
    int *columns;
    size_t pixel_count, list_capacity;
    int top, rows; /* of free pixels */
    int skip[TXS_MAX_LABELS], free_count[TXS_MAX_LABELS];
    int strips, tasks, phase, group, integrate;
    int order[TXS_GRID * TXS_GRID];
    uint64_t pass, sweep;
} txs_brush;

enum { TXS_ALL = TXS_GRID * TXS_GRID };

/* ---- what a pixel takes part in ------------------------------------------------------- */

/* Which member of the clique the ends of txs_type_ends are, by kind. */
static const uint8_t txs_end_member[][4] = {{0, 0, 0, 0}, {1, 0, 0, 0}, {0, 0, 0, 0}, {0, 1, 0, 0},
                                            {1, 2, 0, 0}, {1, 0, 0, 0}, {1, 0, 3, 2}};

static void txs_part_add_ends(txs_brush *s, txs_part *part, int label, int k, int px, int py,
                              int form) {
    const txs_texture *texture = &s->texture[label];
    const txs_type *t = &texture->level->types[k];
    txs_end ends[4];
    int band[4], forms[4];
    const int n =
        txs_type_ends(texture->level, t, s->tables + (size_t)(s->base[label] + k) * TXS_TABLE,
                      &s->mosaic->canvas, s->mosaic->bands, ends, band, forms);
    for (int i = 0; i < n; i++) {
        int *count = part->list.end_count[band[i]];
        const int at = count[0] + count[1] + count[2] + count[3];
        /* of a pair, end 0 is the head; only pairs have a phase */
        if (forms[i] != form || !txs_is_tail(t, px - (i ? 0 : t->dx), py - (i ? 0 : t->dy)))
            continue;
        if (at == TXS_MAX_ENDS) continue; /* cannot be: models are checked */
        part->list.ends[band[i]][at] = ends[i];
        part->guard[band[i]][at] =
            txs_guard_make(s->mosaic, t, label, txs_end_member[t->kind][i], s->mosaic->label);
        count[form]++;
    }
}

/* Ends and tallies of the pixels of a label with parities px, py. */
static void txs_part_fill(txs_brush *s, txs_part *part, int label, int px, int py) {
    const txs_level *level = s->texture[label].level;
    memset(part, 0, sizeof *part);
    for (int form = 0, filled = 0; form < TXS_FORMS; form++) {
        for (int k = 0; k < level->type_count; k++) {
            const txs_type *t = &level->types[k];
            if (!txs_mosaic_knows(s->mosaic, t)) continue;
            txs_part_add_ends(s, part, label, k, px, py, form);
            txs_tally tally = txs_tally_make(t, level, &s->mosaic->canvas, s->mosaic->bands);
            if (tally.form != form || !txs_is_tail(t, px, py)) continue;
            tally.type = k;
            part->tally_guard[filled] = txs_guard_make(s->mosaic, t, label, 0, s->mosaic->label);
            part->list.tally[filled++] = tally;
            part->list.tally_count[form]++;
        }
    }
}

/* An end of a crossing type at pixels of `label`; the other member has the label `far_`. */
static void txs_part_add_crossing(txs_brush *s, int label, int far_, int band, int far_band,
                                  ptrdiff_t d, const uint8_t *table) {
    for (int parity = 0; parity < s->parities; parity++) {
        txs_part *part = &s->part[label * s->parities + parity];
        const int at = part->cross_count[band];
        if (at == TXS_CROSS_ENDS) return;
        txs_end *e = &part->cross[band][at];
        txs_guard *g = &part->cross_guard[band][at];
        memset(e, 0, sizeof *e);
        memset(g, 0, sizeof *g);
        e->o1 = far_band * s->mosaic->canvas.plane + d;
        e->classes = s->texture[far_].level->classes[far_band];
        e->table = table;
        TEXSYN_ASSERT(g->count < (int)(sizeof g->at / sizeof *g->at));
        g->at[g->count++] = s->mosaic->label + d;
        g->label = far_;
        part->cross_count[band]++;
    }
}

static void txs_parts_fill(txs_brush *s) {
    for (int k = 0; k < s->mosaic->labels; k++)
        for (int parity = 0; parity < s->parities; parity++)
            txs_part_fill(s, &s->part[k * s->parities + parity], k, parity & 1, parity >> 1);
    for (int i = 0; i < s->crossings; i++) {
        const txs_crossing *c = &s->crossing[i];
        const txs_type *t = &c->type;
        const ptrdiff_t d = t->dy * s->mosaic->canvas.stride + t->dx;
        const uint8_t *table = s->tables + (size_t)(s->base[s->mosaic->labels] + i) * TXS_TABLE;
        txs_part_add_crossing(s, c->tail, c->head, t->band, t->other, d, table);
        txs_part_add_crossing(s, c->head, c->tail, t->other, t->band, -d,
                              table + (int)TXS_CLASSES * TXS_VALUES);
    }
}

/* ---- drawing -------------------------------------------------------------------------- */

/* The candidate's energies at one end, as energy.h says. */
static const uint8_t *txs_row(const txs_end *e, int form, const uint8_t *p) {
    switch (form) {
    case 0: return e->table - p[e->o1];
    case 1: return e->table + txs_class(p[e->o2] - p[e->o3]) * TXS_ROW - p[e->o1];
    case 2: return e->table + (p[e->o2] - p[e->o1]) * TXS_ROW - p[e->o1];
    default: return e->table + e->classes[p[e->o1]] * TXS_VALUES;
    }
}

/* Draw a value for one pixel and band, given the rows of its ends. */
static void txs_draw_value(const txs_brush *s, int label, int band, const uint8_t **rows, int n,
                           uint8_t *p, txm_rng *rng) {
    const int values = s->texture[label].level->values[band];
    rows[n] = txs_no_energy;
    int v = s->pick(rows, 1, (n + 1) & ~1, s->single[label * TXS_MAX_BANDS + band],
                    s->noise + (txm_rng_next(rng) & (TXS_NOISE - 1)));
    if (v >= values) v = values - 1;
    p[band * s->mosaic->canvas.plane] = (uint8_t)v;
}

/* Draw some pure pixels of a list. */
static void txs_draw_pure(const txs_brush *s, int label, const txs_list *list, const int32_t *at,
                          int count, txm_rng *rng) {
    const uint8_t *rows[TXS_TOGETHER][TXS_MAX_ENDS + 2];
    uint8_t *base = s->mosaic->canvas.pixels;
    for (int b = 0; b < s->texture[label].model->bands; b++) {
        const txs_end *e = list->ends[b], *stop = e + list->end_count[b][0];
        int n = 0;
        for (; e < stop; e++, n++) {
            const uint8_t *p1 = base + e->o1, *table = e->table;
            for (int i = 0; i < count; i++) rows[i][n] = table - p1[at[i]];
        }
        for (stop += list->end_count[b][1]; e < stop; e++, n++) {
            const uint8_t *p1 = base + e->o1, *p2 = base + e->o2, *p3 = base + e->o3;
            for (int i = 0; i < count; i++)
                rows[i][n] = e->table + txs_class(p2[at[i]] - p3[at[i]]) * TXS_ROW - p1[at[i]];
        }
        for (stop += list->end_count[b][2]; e < stop; e++, n++) {
            const uint8_t *p1 = base + e->o1, *p2 = base + e->o2;
            for (int i = 0; i < count; i++)
                rows[i][n] = e->table + (p2[at[i]] - p1[at[i]]) * TXS_ROW - p1[at[i]];
        }
        for (stop += list->end_count[b][3]; e < stop; e++, n++) {
            const uint8_t *p1 = base + e->o1;
            for (int i = 0; i < count; i++)
                rows[i][n] = e->table + e->classes[p1[at[i]]] * TXS_VALUES;
        }
        for (int i = 0; i < count; i++) txs_draw_value(s, label, b, rows[i], n, base + at[i], rng);
    }
}

/* Draw a pixel near another label or the border. */
static void txs_draw_checked(const txs_brush *s, int label, const txs_part *part, uint8_t *p,
                             txm_rng *rng) {
    const uint8_t *rows[TXS_MAX_ENDS + 2];
    for (int b = 0; b < s->texture[label].model->bands; b++) {
        const txs_end *e = part->list.ends[b];
        const txs_guard *g = part->guard[b];
        int n = 0;
        for (int form = 0; form < TXS_FORMS; form++)
            for (int i = part->list.end_count[b][form]; i > 0; i--, e++, g++)
                if (txs_holds(g, p)) rows[n++] = txs_row(e, form, p);
        for (int i = 0; i < part->cross_count[b] && n < TXS_MAX_ENDS; i++)
            if (txs_holds(&part->cross_guard[b][i], p))
                rows[n++] = txs_row(&part->cross[b][i], 3, p);
        txs_draw_value(s, label, b, rows, n, p, rng);
    }
}

/* ---- counting ------------------------------------------------------------------------- */

/* Count the cliques whose tail is p. counts: of all types. */
static void txs_brush_count(const txs_brush *s, int label, const txs_part *part, int is_pure,
                            const uint8_t *p, int32_t (*counts)[TXS_BINS]) {
    if (is_pure) {
        txs_count(&part->list, p, counts + s->base[label]);
        return;
    }
    const int *of = part->list.tally_count, n = of[0] + of[1] + of[2] + of[3];
    for (int i = 0; i < n; i++) {
        const txs_tally *t = &part->list.tally[i];
        if (txs_holds(&part->tally_guard[i], p)) counts[s->base[label] + t->type][txs_bin(t, p)]++;
    }
    for (int i = 0; i < s->crossings; i++) {
        const txs_crossing *c = &s->crossing[i];
        const txs_type *t = &c->type;
        const uint8_t *q = p + t->dy * s->mosaic->canvas.stride + t->dx;
        if (c->tail != label || q[s->mosaic->label] != c->head) continue;
        const int v = p[t->band * s->mosaic->canvas.plane];
        const int w = q[t->other * s->mosaic->canvas.plane];
        counts[s->base[s->mosaic->labels] + i]
              [s->texture[c->tail].level->classes[t->band][v] * TXS_CLASSES +
               s->texture[c->head].level->classes[t->other][w]]++;
    }
}

static const txs_pixels *txs_brush_list(const txs_brush *s, int strip, int sublattice, int label) {
    return &s->list[((size_t)strip * TXS_ALL + (size_t)sublattice) * (size_t)s->mosaic->labels +
                    (size_t)label];
}

static const txs_part *txs_brush_part(const txs_brush *s, int label, int sublattice) {
    const int parity = s->parities == 1 ? 0 : (sublattice & 1) + 2 * (sublattice / TXS_GRID & 1);
    return &s->part[label * s->parities + parity];
}

/* Count every skip-th pixel of a list. */
static void txs_count_list(const txs_brush *s, int strip, int sublattice, int label,
                           int32_t (*counts)[TXS_BINS]) {
    const txs_pixels *list = txs_brush_list(s, strip, sublattice, label);
    const txs_part *part = txs_brush_part(s, label, sublattice);
    const int skip = s->skip[label];
    for (int i = (strip + 5 * sublattice) % skip; i < list->count; i += skip)
        txs_brush_count(s, label, part, i < list->pure, s->mosaic->canvas.pixels + list->at[i],
                        counts);
}

/* ---- a sweep -------------------------------------------------------------------------- */

static void txs_draw_list(const txs_brush *s, int strip, int sublattice, int label, uint64_t pass) {
    const txs_pixels *list = txs_brush_list(s, strip, sublattice, label);
    const txs_part *part = txs_brush_part(s, label, sublattice);
    txm_rng rng =
        txm_rng_make(s->seed ^ pass << 24, (uint64_t)strip * TXS_MAX_LABELS + (uint64_t)label);
    for (int i = 0; i < list->pure; i += TXS_TOGETHER) {
        const int n = list->pure - i;
        txs_draw_pure(s, label, &part->list, list->at + i, n < TXS_TOGETHER ? n : (int)TXS_TOGETHER,
                      &rng);
    }
    for (int i = list->pure; i < list->count; i++)
        txs_draw_checked(s, label, part, s->mosaic->canvas.pixels + list->at[i], &rng);
}

/* One share of a pass: some of the strips of this phase, the group's sub-lattices in turn. */
static void txs_brush_work(void *context, int task) {
    const txs_brush *s = (const txs_brush *)context;
    const int half = s->strips > 1 ? s->strips / 2 : 1;
    int32_t(*counts)[TXS_BINS] = s->counts + (size_t)task * (size_t)s->capacity;
    for (int i = half * task / s->tasks; i < half * (task + 1) / s->tasks; i++) {
        const int strip = s->strips > 1 ? 2 * i + s->phase : 0;
        for (int j = 0; j < s->refresh; j++) {
            const int sublattice = s->order[s->group * s->refresh + j];
            const uint64_t pass = s->pass * TXS_ALL + (uint64_t)j;
            for (int k = 0; k < s->mosaic->labels; k++) {
                txs_draw_list(s, strip, sublattice, k, pass);
                txs_count_list(s, strip, sublattice, k, counts);
            }
        }
    }
}

/* The clique type at a place. */
static const txs_type *txs_brush_type(const txs_brush *s, int place, int *label) {
    const int labels = s->mosaic->labels;
    *label = place < s->base[labels] ? place / s->base[1] : labels;
    return *label < labels ? &s->texture[*label].level->types[place - s->base[*label]]
                           : &s->crossing[place - s->base[labels]].type;
}

/* Spread the potential of a crossing type over the tables of its ends. */
static void txs_publish_crossing(const txs_brush *s, const txs_crossing *c, const int32_t *v,
                                 uint8_t *table) {
    const uint8_t *tail = s->texture[c->tail].level->classes[c->type.band];
    const uint8_t *head = s->texture[c->head].level->classes[c->type.other];
    enum { N = TXS_CLASSES };
    uint8_t row[TXS_BINS];
    for (int i = 0; i < TXS_BINS; i++)
        row[i] = (uint8_t)((v[i] + TXS_ZERO * TXS_PRECISE) / TXS_PRECISE);
    for (int q = 0; q < N; q++) {
        for (int i = 0; i < TXS_VALUES; i++) {
            table[q * TXS_VALUES + i] = row[tail[i] * N + q];
            table[(N + q) * TXS_VALUES + i] = row[q * N + head[i]];
        }
    }
}

/* Bring the counts of a pass into the running histogram of a type, which forgets at the same rate,
   and set the type's tables from its error. */
static void txs_brush_control(txs_brush *s, int place) {
    const int passes = TXS_ALL / s->refresh;
    const int64_t keep = TXS_ONE - TXS_ONE / passes;
    int32_t v[TXS_BINS], *histogram = s->histogram[place];
    int label;
    const txs_type *t = txs_brush_type(s, place, &label);
    uint8_t *table = s->tables + (size_t)place * TXS_TABLE;
    for (int i = 0; i < TXS_BINS; i++) histogram[i] = (int32_t)((histogram[i] * keep) >> 16);
    for (int task = 0; task < s->tasks; task++) {
        int32_t *count = s->counts[(size_t)task * (size_t)s->capacity + (size_t)place];
        for (int i = 0; i < TXS_BINS; i++) histogram[i] += count[i] * TXS_WINDOW;
        memset(count, 0, sizeof *s->counts);
    }
    txs_steer(t, s->gain[place], s->integrate, histogram, s->integral[place], v);
    if (label == s->mosaic->labels)
        txs_publish_crossing(s, &s->crossing[place - s->base[label]], v, table);
    else
        txs_publish(s->texture[label].level, t, v, s->single[label * TXS_MAX_BANDS + t->band],
                    table);
}

enum { TXS_CONTROL_TASKS = 8 };

static void txs_brush_control_some(void *context, int task) {
    txs_brush *s = (txs_brush *)context;
    for (int i = task; i < s->active_count; i += TXS_CONTROL_TASKS)
        txs_brush_control(s, s->active[i]);
}

/* Visit every free pixel once. Progress from..to of the whole work. */
static txm_status txs_brush_sweep(txs_brush *s, txm_env *env, const char *stage, float from,
                                  float to) {
    const int phases = s->strips > 1 ? 2 : 1, groups = TXS_ALL / s->refresh;
    txm_rng rng = txm_rng_make(s->seed, ~s->sweep++);
    for (int i = 0; i < TXS_ALL; i++) s->order[i] = i;
    txm_shuffle(&rng, s->order, TXS_ALL);
    for (s->group = 0; s->group < groups; s->group++, s->pass++) {
        if (txm_progress(env, from + (to - from) * (float)s->group / (float)groups, stage))
            return txm_fail(env, TXM_CANCELLED, "stopped by the progress callback");
        for (s->phase = 0; s->phase < phases; s->phase++)
            txm_parallel_for(env, s->tasks, txs_brush_work, s);
        s->integrate = s->group + 1 == groups;
        txm_parallel_for(env, TXS_CONTROL_TASKS, txs_brush_control_some, s);
    }
    return TXM_OK;
}

/* ---- laying out the work -------------------------------------------------------------- */

static int txs_strip_of(const txs_brush *s, int y) {
    return (int)(((int64_t)(y - s->top + 1) * s->strips - 1) / s->rows);
}

static txs_pixels *txs_list_of(txs_brush *s, int x, int y, int label) {
    const int sublattice = x % TXS_GRID + y % TXS_GRID * TXS_GRID;
    return &s->list[((size_t)txs_strip_of(s, y) * TXS_ALL + (size_t)sublattice) *
                        (size_t)s->mosaic->labels +
                    (size_t)label];
}

/* Call visit-like code for each free pixel: first count the pixels of each list, then fill them. */
static void txs_list_pixels(txs_brush *s, int is_filling) {
    const txs_mosaic *m = s->mosaic;
    const int width = m->canvas.width;
    for (int pure = 1; pure >= 0; pure--) {
        for (int y = s->top; y < s->top + s->rows; y++) {
            for (int x = 0; x < width; x++) {
                if (!txs_is_free(m, x, y) ||
                    s->purity[(size_t)y * (size_t)width + (size_t)x] != pure)
                    continue;
                txs_pixels *list = txs_list_of(s, x, y, txs_pixel(m, x, y)[m->label]);
                if (is_filling) list->at[list->count] = (int32_t)txs_pixel_offset(m, x, y);
                list->count++;
                list->pure += pure;
            }
        }
    }
}

static void txs_brush_list_all(txs_brush *s) {
    const size_t lists = (size_t)s->strips * TXS_ALL * (size_t)s->mosaic->labels;
    size_t filled = 0;
    TEXSYN_ASSERT(lists <= s->list_capacity);
    memset(s->list, 0, lists * sizeof *s->list);
    memset(s->free_count, 0, sizeof s->free_count);
    txs_list_pixels(s, 0);
    for (size_t i = 0; i < lists; i++) {
        s->list[i].at = s->pixel + filled;
        filled += (size_t)s->list[i].count;
        s->free_count[i % (size_t)s->mosaic->labels] += s->list[i].count;
        s->list[i].count = s->list[i].pure = 0;
    }
    TEXSYN_ASSERT(filled == s->pixel_count);
    txs_list_pixels(s, 1);
}

/* The largest distance between members of a clique of this level; at least what is worth a strip. */
static int txs_brush_reach(const txs_brush *s) {
    int reach = 1;
    for (int i = 0; i < s->active_count; i++) {
        int label, r = txs_reach(txs_brush_type(s, s->active[i], &label));
        if (r > reach) reach = r;
    }
    return reach;
}

/* The gain of a type whose histogram counts n cliques: few cliques have noisy histograms, and
   surroundings that are fixed. */
static txs_gain txs_soften(int64_t n, int softness) {
    txs_gain gain;
    gain.proportional = (int)((int)TXS_PROPORTIONAL * TXS_WHOLE * n / (n + softness));
    gain.integral = (int)((int)TXS_INTEGRAL * TXS_WHOLE * n / (n + softness));
    return gain;
}

/* Which places are in use. */
static void txs_brush_activate(txs_brush *s) {
    const int labels = s->mosaic->labels;
    s->active_count = 0;
    for (int k = 0; k < labels; k++)
        for (int i = 0; i < s->texture[k].level->type_count; i++)
            if (txs_mosaic_knows(s->mosaic, &s->texture[k].level->types[i]))
                s->active[s->active_count++] = s->base[k] + i;
    for (int i = 0; i < s->crossings; i++) s->active[s->active_count++] = s->base[labels] + i;
    TEXSYN_ASSERT(s->active_count <= s->capacity);
}

/* Lay out the work for the types as they are now, and count the canvas as it is. */
static void txs_brush_start(txs_brush *s) {
    enum { STRIP = 16 }; /* a strip is at least this high: less is too little work for a thread */
    const int labels = s->mosaic->labels;
    txs_brush_activate(s);
    txs_parts_fill(s);
    int reach = txs_brush_reach(s);
    txs_find_pure(s->mosaic, s->mosaic->label, reach, s->purity, s->columns);
    if (reach < STRIP) reach = STRIP;
    s->strips = s->rows / reach & ~1;
    if (s->strips < 2) s->strips = 1;
    s->tasks = s->strips > 1 ? s->strips / 2 : 1;
    if (s->tasks > TXS_TASKS) s->tasks = TXS_TASKS;
    txs_brush_list_all(s);
    for (int k = 0; k < labels; k++) s->skip[k] = s->free_count[k] / TXS_SAMPLES + 1;

    for (int i = 0; i < s->active_count; i++) {
        memset(s->histogram[s->active[i]], 0, sizeof *s->histogram);
        for (int task = 0; task < TXS_TASKS; task++)
            memset(s->counts[(size_t)task * (size_t)s->capacity + (size_t)s->active[i]], 0,
                   sizeof *s->counts);
    }
    for (int strip = 0; strip < s->strips; strip++)
        for (int sublattice = 0; sublattice < TXS_ALL; sublattice++)
            for (int k = 0; k < labels; k++) txs_count_list(s, strip, sublattice, k, s->counts);
    for (int i = 0; i < s->active_count; i++) {
        const int place = s->active[i];
        int64_t cliques = 0;
        for (int j = 0; j < TXS_BINS; j++) cliques += s->counts[place][j];
        s->gain[place] = place < s->base[labels]
                             ? txs_soften(s->free_count[place / s->base[1]], s->softness)
                             : txs_soften(cliques, TXS_SOFT_CROSSING);
    }
    s->integrate = 0;
    for (int i = 0; i < s->active_count; i++) txs_brush_control(s, s->active[i]);
}

/* Forget what the control has found; start from the potentials of the types. */
static void txs_brush_reset(txs_brush *s) {
    txs_brush_activate(s);
    for (int i = 0; i < s->active_count; i++) {
        int label;
        const txs_type *t = txs_brush_type(s, s->active[i], &label);
        for (int j = 0; j < TXS_BINS; j++)
            s->integral[s->active[i]][j] = t->potential[j] * TXS_PRECISE;
    }
}

/* What txs_brush_make is told. */
typedef struct txs_brush_plan {
    int max_types; /* of one label, at most TXS_MAX_TYPES */
    int max_crossings;
    int refresh;  /* sub-lattices between two looks at the histograms: divides 64 */
    int softness; /* the gains are those of sampler.h times n / (n + softness), n free pixels */
    uint64_t seed;
} txs_brush_plan;

/* A sampler in the arena's memory; NULL if there is none. texture: one for each label. Call
   txs_brush_reset before the first, txs_brush_start before each use with other types or labels. */
static txs_brush *txs_brush_make(txm_arena *arena, const txs_mosaic *mosaic,
                                 const txs_texture *texture, const txs_brush_plan *plan,
                                 const int16_t *noise) {
    const txs_canvas *c = &mosaic->canvas;
    const size_t labels = (size_t)mosaic->labels;
    txs_brush *s = (txs_brush *)txm_arena_zero(arena, 1, sizeof *s);
    if (!s) return NULL;
    s->mosaic = mosaic;
    s->texture = texture;
    s->parities = mosaic->parent ? 4 : 1;
    s->refresh = plan->refresh;
    s->softness = plan->softness;
    s->seed = txm_hash(plan->seed);
    s->pick = txs_best_pick();
    s->noise = noise;
    for (int k = 0; k <= mosaic->labels; k++) s->base[k] = k * plan->max_types;
    s->capacity = s->base[mosaic->labels] + plan->max_crossings;
    s->top = c->height;
    for (int y = 0, bottom = 0; y < c->height; y++) {
        for (int x = 0; x < c->width; x++) {
            if (!txs_is_free(mosaic, x, y)) continue;
            if (y < s->top) s->top = y;
            bottom = y + 1;
            s->rows = bottom - s->top;
            s->pixel_count++;
        }
    }
    if (!s->rows) s->top = 0, s->rows = 1;
    s->list_capacity = ((size_t)s->rows / 16 + 1) * TXS_ALL * labels;
    const size_t places = (size_t)s->capacity;
    s->part = (txs_part *)txm_arena_alloc(arena, labels * (size_t)s->parities, sizeof *s->part);
    s->single =
        (int16_t(*)[TXS_VALUES])txm_arena_zero(arena, labels * TXS_MAX_BANDS, sizeof *s->single);
    s->active = (int *)txm_arena_alloc(arena, places, sizeof *s->active);
    s->tables = (uint8_t *)txm_arena_zero(arena, places, TXS_TABLE);
    s->histogram = (int32_t(*)[TXS_BINS])txm_arena_zero(arena, places, sizeof *s->histogram);
    s->integral = (int32_t(*)[TXS_BINS])txm_arena_zero(arena, places, sizeof *s->integral);
    s->counts = (int32_t(*)[TXS_BINS])txm_arena_zero(arena, places * TXS_TASKS, sizeof *s->counts);
    s->gain = (txs_gain *)txm_arena_zero(arena, places, sizeof *s->gain);
    s->pixel = (int32_t *)txm_arena_alloc(arena, s->pixel_count + 1, sizeof *s->pixel);
    s->list = (txs_pixels *)txm_arena_alloc(arena, s->list_capacity, sizeof *s->list);
    s->purity = (uint8_t *)txm_arena_alloc(arena, (size_t)c->width, (size_t)c->height);
    s->columns = (int *)txm_arena_alloc(arena, (size_t)c->width, sizeof *s->columns);
    return arena->failed ? NULL : s;
}

/* The noise of a lower temperature: percent of it. Both have TXS_NOISE + TXS_VALUES entries. */
static void txs_cool_noise(const int16_t *noise, int percent, int16_t *cool) {
    for (int i = 0; i < (int)TXS_NOISE + TXS_VALUES; i++)
        cool[i] = (int16_t)(noise[i] * percent / 100);
}

/* ---- learning a mosaic -------------------------------------------------------------------

   Greedy selection of clique types on one level as in neighbourhood.h, for all labels at once and
   for the crossings of their borders. Targets are measured at the source pixels of one mosaic, what
   was synthesised at the free pixels of another (or of the same). Crossings may be measured in a
   mosaic of their own.                                                                      */

typedef struct txs_study_plan {
    int first, between, last; /* sweeps: at first, after each batch of types, at the end   */
    int types, batch;         /* added for each label, at once                             */
    int reach;                /* of pairs, in pixels of the level                          */
    int refresh, softness;    /* of the sampler */
    int crosses;              /* non-zero: crossing types as well                          */
    uint64_t seed;
    const int16_t *noise, *last_noise; /* the latter of the last sweep                     */
    const txs_mosaic *border; /* where crossings are measured instead of in the source, or NULL */
} txs_study_plan;

/* A crossing type that could be added. */
typedef struct txs_cross_candidate {
    txs_crossing crossing;
    float weight, noise, distance; /* as of txs_candidate */
} txs_cross_candidate;

typedef struct txs_study {
    const txs_study_plan *plan;
    const txs_mosaic *source, *canvas;
    int index;            /* of the level    */
    int now;              /* label that is measured */
    texsyn_model **model; /* of each label */
    txs_texture texture[TXS_MAX_LABELS];
    txs_learner learner[TXS_MAX_LABELS];
    txs_pixels tails[TXS_MAX_LABELS];      /* of the source, TXS_TAILS at most  */
    txs_pixels free_tails[TXS_MAX_LABELS]; /* of the canvas                     */
    const txs_mosaic *border;              /* where crossings are measured      */
    txs_pixels border_tails[TXS_MAX_LABELS];
    txs_crossing *crossing;
    int crossings;
    txs_cross_candidate *cross;
    int cross_count;
} txs_study;

enum {
    TXS_TAILS = 12000,    /* cliques counted of each type: as many as matter */
    TXS_PRESELECTED = 32, /* types of a label at most, see txs_study_preselect */
    TXS_CROSS_REACH = 5,  /* pixels, between the first bands; ours, by trial */
    TXS_CROSS_BATCH = 4   /* crossing types added for each pair of labels at once */
};

/* ---- measuring ------------------------------------------------------------------------ */

static void txs_normalise(const uint32_t *h, int64_t total, int32_t share[TXS_BINS]) {
    for (int i = 0; i < TXS_BINS; i++)
        share[i] = total ? (int32_t)(((int64_t)h[i] * TXS_ONE + total / 2) / total) : 0;
}

static int txs_is_tail_at(const txs_mosaic *m, const txs_type *t, int32_t at) {
    const int x = (int)(at % m->canvas.stride) - m->canvas.margin;
    const int y = (int)(at / m->canvas.stride) - m->canvas.margin;
    return txs_is_tail(t, x & 1, y & 1);
}

/* Does the type say something of colours only, and are some of them hidden in this mosaic? */
static int txs_is_weighed(const txs_mosaic *m, const texsyn_model *model, const txs_type *t) {
    return m->weight && !txs_is_alpha(model, t->band) && !txs_is_alpha(model, t->other);
}

/* Histogram of a clique type of colours over source pixels: a clique counts with the least weight of
   its members. Returns the number of cliques. */
static int64_t txs_study_weigh(const txs_mosaic *m, const txs_pixels *tails, int label,
                               const txs_level *level, const txs_type *t, int32_t share[TXS_BINS]) {
    const txs_tally y = txs_tally_make(t, level, &m->canvas, m->bands);
    const txs_guard guard = txs_guard_make(m, t, label, 0, m->sample);
    int at[4][2], drawn = txs_members(t, at);
    uint32_t h[TXS_BINS];
    int64_t total = 0;
    if (t->kind == TEXSYN_SCALE) drawn = 2; /* the others are of the coarser level */
    memset(h, 0, sizeof h);
    for (int i = 0; i < tails->count; i++) {
        const uint8_t *p = m->canvas.pixels + tails->at[i];
        if (!txs_holds(&guard, p) || (t->phase && !txs_is_tail_at(m, t, tails->at[i]))) continue;
        uint32_t least = TXS_OPAQUE;
        for (int k = 0; k < drawn; k++) {
            const uint32_t weight = p[m->weight + at[k][1] * m->canvas.stride + at[k][0]];
            least = weight < least ? weight : least;
        }
        h[txs_bin(&y, p)] += txs_counts_of(least);
        total += txs_counts_of(least);
    }
    txs_normalise(h, total, share);
    return (total + TXS_OPAQUE - 1) / TXS_OPAQUE;
}

/* Histogram of a clique type over its tails, whose label is asked of the plane `labels`. Returns the
   number of cliques. */
static int64_t txs_study_measure(const txs_mosaic *m, ptrdiff_t labels, const txs_pixels *tails,
                                 int label, const txs_level *level, const txs_type *t,
                                 int32_t share[TXS_BINS]) {
    const txs_tally y = txs_tally_make(t, level, &m->canvas, m->bands);
    const txs_guard guard = txs_guard_make(m, t, label, 0, labels);
    const uint8_t *base = m->canvas.pixels;
    uint32_t h[TXS_BINS];
    int64_t total = 0;
    int i = 0;
    memset(h, 0, sizeof h);
    if (t->phase) {
        for (; i < tails->pure; i++)
            if (txs_is_tail_at(m, t, tails->at[i])) h[txs_bin(&y, base + tails->at[i])]++;
    } else if (y.form == 1) {
        for (; i < tails->pure; i++) h[base[tails->at[i] + y.a] - base[tails->at[i] + y.b] + 31]++;
    } else if (y.form == 2) {
        for (; i < tails->pure; i++)
            h[y.ca[base[tails->at[i] + y.a]] * TXS_CLASSES + y.cb[base[tails->at[i] + y.b]]]++;
    } else {
        for (; i < tails->pure; i++) h[txs_bin(&y, base + tails->at[i])]++;
    }
    for (; i < tails->count; i++) {
        const uint8_t *p = base + tails->at[i];
        if (txs_holds(&guard, p) && (!t->phase || txs_is_tail_at(m, t, tails->at[i])))
            h[txs_bin(&y, p)]++;
    }
    for (i = 0; i < TXS_BINS; i++) total += h[i];
    txs_normalise(h, total, share);
    return total;
}

/* The same of source pixels, and of colours that are visible. */
static int64_t txs_study_target(const txs_study *s, int label, const txs_type *t,
                                int32_t share[TXS_BINS]) {
    const txs_level *level = &s->model[label]->level[s->index];
    const txs_pixels *tails = &s->tails[label];
    if (txs_is_weighed(s->source, s->model[label], t)) {
        const int64_t n = txs_study_weigh(s->source, tails, label, level, t, share);
        if (n || t->kind != TEXSYN_SINGLE) return n;
        /* no tail is visible; what they have borrowed will do, since there must be a histogram */
    }
    return txs_study_measure(s->source, s->source->sample, tails, label, level, t, share);
}

/* The same of a crossing type. Colours are counted where they are visible. */
static int64_t txs_study_measure_crossing(const txs_study *s, const txs_mosaic *m, ptrdiff_t labels,
                                          const txs_pixels *tails, const txs_crossing *c,
                                          int32_t share[TXS_BINS]) {
    const txs_type *t = &c->type;
    const ptrdiff_t d = t->dy * m->canvas.stride + t->dx, plane = m->canvas.plane;
    const uint8_t *tail = s->texture[c->tail].level->classes[t->band];
    const uint8_t *head = s->texture[c->head].level->classes[t->other];
    const int is_weighed = m->weight && labels == m->sample;
    const int tail_is_colour = is_weighed && !txs_is_alpha(s->model[c->tail], t->band);
    const int head_is_colour = is_weighed && !txs_is_alpha(s->model[c->head], t->other);
    uint32_t h[TXS_BINS];
    int64_t total = 0;
    memset(h, 0, sizeof h);
    for (int i = tails->pure; i < tails->count; i++) {
        const uint8_t *p = m->canvas.pixels + tails->at[i], *q = p + d;
        if (q[labels] != c->head || (tail_is_colour && !p[m->weight]) ||
            (head_is_colour && !q[m->weight]))
            continue;
        h[tail[p[t->band * plane]] * TXS_CLASSES + head[q[t->other * plane]]]++;
        total++;
    }
    txs_normalise(h, total, share);
    return total;
}

/* ---- tails ---------------------------------------------------------------------------- */

/* Is the pixel one that tails lie at: a source pixel, or a free one? */
static int txs_is_tail_of(const txs_mosaic *m, ptrdiff_t labels, int label, int x, int y) {
    if (txs_pixel(m, x, y)[labels] != label) return 0;
    return labels == m->sample || txs_is_free(m, x, y);
}

/* Evenly spread tails of a label, TXS_TAILS at most of either purity; tails->at has room for twice
   as many. */
static void txs_tails_find(const txs_mosaic *m, ptrdiff_t labels, int label, const uint8_t *purity,
                           txs_pixels *tails) {
    const int width = m->canvas.width, height = m->canvas.height;
    tails->count = tails->pure = 0;
    for (int pure = 1; pure >= 0; pure--) {
        int64_t found = 0, seen = 0;
        for (int pass = 0; pass < (found ? 2 : 1); pass++) {
            for (int y = 0; y < height; y++) {
                for (int x = 0; x < width; x++) {
                    if (purity[(size_t)y * (size_t)width + (size_t)x] != pure ||
                        !txs_is_tail_of(m, labels, label, x, y))
                        continue;
                    if (!pass) {
                        found++;
                        continue;
                    }
                    const int64_t wanted = found < TXS_TAILS ? found : (int)TXS_TAILS;
                    if (seen * wanted / found != (seen + 1) * wanted / found)
                        tails->at[tails->count++] = (int32_t)txs_pixel_offset(m, x, y);
                    seen++;
                }
            }
        }
        if (pure) tails->pure = tails->count;
    }
    TEXSYN_ASSERT(tails->count <= 2 * TXS_TAILS);
}

/* Room for the tails of all labels, and what they are; 0 if there is no memory. */
static int txs_tails_make(txm_arena *arena, const txs_mosaic *m, ptrdiff_t labels, int reach,
                          txs_pixels *tails) {
    const size_t width = (size_t)m->canvas.width, height = (size_t)m->canvas.height;
    size_t room = width * height < TXS_TAILS ? width * height : (size_t)TXS_TAILS;
    uint8_t *purity = (uint8_t *)txm_arena_alloc(arena, width, height);
    int *columns = (int *)txm_arena_alloc(arena, width, sizeof *columns);
    for (int k = 0; k < m->labels; k++)
        tails[k].at = (int32_t *)txm_arena_alloc(arena, 2 * room, sizeof *tails[k].at);
    if (arena->failed) return 0;
    txs_find_pure(m, labels, reach, purity, columns);
    for (int k = 0; k < m->labels; k++) txs_tails_find(m, labels, k, purity, &tails[k]);
    return 1;
}

/* ---- the clique types of a label ------------------------------------------------------ */

/* The preselected clique types, as txs_preselect has them; those that the source does not contain
   are left out. */
static void txs_study_preselect(txs_study *s, int label) {
    texsyn_model *model = s->model[label];
    txs_level *level = &model->level[s->index];
    const int bands = model->bands, has_parents = s->source->parent != 0;
    int kept = bands;
    level->type_count = 0;
    for (int b = 0; b < bands; b++) {
        txs_type *t = txs_add_type(level, TEXSYN_SINGLE, b, b, 0, 0);
        txs_study_target(s, label, t, t->share);
        txs_make_classes(model, level, b);
    }
    for (int b = 0; b < bands; b++) {
        for (int phase = has_parents; phase <= 2 * has_parents; phase++) {
            txs_add_type(level, TEXSYN_PAIR, b, b, 1, 0)->phase = phase;
            txs_add_type(level, TEXSYN_PAIR, b, b, 0, 1)->phase = phase;
        }
        if (has_parents) txs_add_type(level, TEXSYN_PARENT, b, b, 0, 0);
        for (int o = b + 1; o < bands; o++) txs_add_type(level, TEXSYN_VALUES, b, o, 0, 0);
    }
    for (int k = bands; k < level->type_count; k++) {
        txs_type t = level->types[k];
        if (txs_study_target(s, label, &t, t.share) > 0) level->types[kept++] = t;
    }
    level->type_count = kept;
    TEXSYN_ASSERT(kept <= TXS_PRESELECTED);
}

/* Would two members of a clique be drawn together, being of one sub-lattice? */
static int txs_draws_together(const txs_type *t) {
    int at[4][2], n = t->kind == TEXSYN_SCALE ? 2 : txs_members(t, at);
    txs_members(t, at);
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < i; j++) {
            const int x = at[i][0] - at[j][0], y = at[i][1] - at[j][1];
            if ((x || y) && x % TXS_GRID == 0 && y % TXS_GRID == 0) return 1;
        }
    }
    return 0;
}

/* The candidates of a label: those of neighbourhood.h that a mosaic knows. */
static void txs_study_list(txs_study *s, int label) {
    txs_learner *a = &s->learner[label];
    float seen[TXS_MAX_BANDS];
    int kept = 0;
    for (int b = 0; b < a->model->bands; b++) seen[b] = txs_visibility(a->level, b);
    txs_list_candidates(a, s->plan->reach, seen);
    for (int i = 0; i < a->candidate_count; i++)
        if (txs_mosaic_knows(s->source, &a->candidates[i].type) &&
            !txs_draws_together(&a->candidates[i].type))
            a->candidates[kept++] = a->candidates[i];
    a->candidate_count = kept;
}

/* Parallel bodies: measure a candidate in the source, on the canvas. */
static void txs_study_source(void *context, int i) {
    txs_study *s = (txs_study *)context;
    txs_learner *a = &s->learner[s->now];
    txs_candidate *c = &a->candidates[i];
    const int64_t n = txs_study_target(s, s->now, &c->type, c->type.share);
    const int64_t m = s->free_tails[s->now].count + 1;
    c->noise = n ? txm_float(sqrt(1.0 / (double)n + 1.0 / (double)m)) : 0;
    if (!n) c->weight = 0;
}

static void txs_study_canvas(void *context, int i) {
    txs_study *s = (txs_study *)context;
    txs_learner *a = &s->learner[s->now];
    txs_candidate *c = &a->candidates[i];
    int32_t share[TXS_BINS];
    const int64_t n = txs_study_measure(s->canvas, s->canvas->label, &s->free_tails[s->now], s->now,
                                        a->level, &c->type, share);
    c->distance = n ? txs_distance(share, c->type.share) : 0;
}

/* ---- crossing types ------------------------------------------------------------------- */

static void txs_cross_add(txs_study *s, int tail, int head, int band, int other, int dx, int dy,
                          int capacity) {
    if (s->cross_count == capacity) return;
    txs_cross_candidate *c = &s->cross[s->cross_count++];
    memset(c, 0, sizeof *c);
    c->crossing.tail = tail;
    c->crossing.head = head;
    c->crossing.type.kind = TEXSYN_VALUES;
    c->crossing.type.band = band;
    c->crossing.type.other = other;
    c->crossing.type.dx = dx;
    c->crossing.type.dy = dy;
    c->weight = 1;
}

/* Within this distance are the candidates of a pair of bands. */
static int txs_cross_reach(int band, int other) {
    return band == 0 && other == 0 ? TXS_CROSS_REACH : 1;
}

/* All candidates of all pairs of labels; returns how many there can be. With no room only counts. */
static int txs_cross_list(txs_study *s, int capacity) {
    int count = 0;
    s->cross_count = 0;
    for (int k = 0; k < s->source->labels; k++) {
        for (int l = k + 1; l < s->source->labels; l++) {
            for (int b = 0; b < s->model[k]->bands; b++) {
                for (int o = 0; o < s->model[l]->bands; o++) {
                    const int r = txs_cross_reach(b, o);
                    for (int y = -r; y <= r; y++) {
                        for (int x = -r; x <= r; x++) {
                            if (x * x + y * y > r * r || (!x && !y)) continue;
                            count++;
                            txs_cross_add(s, k, l, b, o, x, y, capacity);
                        }
                    }
                }
            }
        }
    }
    return count;
}

static void txs_cross_source(void *context, int i) {
    txs_study *s = (txs_study *)context;
    txs_cross_candidate *c = &s->cross[i];
    const int64_t n =
        txs_study_measure_crossing(s, s->border, s->border->sample,
                                   &s->border_tails[c->crossing.tail], &c->crossing,
                                   c->crossing.type.share);
    enum { FEW = 30 }; /* cliques: less is no statistic */
    c->noise = n ? txm_float(sqrt(2.0 / (double)n)) : 0;
    if (n < FEW) c->weight = 0;
}

static void txs_cross_canvas(void *context, int i) {
    txs_study *s = (txs_study *)context;
    txs_cross_candidate *c = &s->cross[i];
    int32_t share[TXS_BINS];
    const int64_t n = txs_study_measure_crossing(
        s, s->canvas, s->canvas->label, &s->free_tails[c->crossing.tail], &c->crossing, share);
    c->distance = n ? txs_distance(share, c->crossing.type.share) : 0;
}

/* Take candidate i into the level. */
static void txs_cross_take(txs_study *s, int i) {
    if (s->crossings == TXS_MAX_CROSSINGS) return;
    s->crossing[s->crossings++] = s->cross[i].crossing;
    s->cross[i] = s->cross[--s->cross_count];
}

/* The preselected crossing types: the four neighbours, in each band. */
static void txs_cross_preselect(txs_study *s) {
    for (int i = s->cross_count - 1; i >= 0; i--) {
        const txs_cross_candidate *c = &s->cross[i];
        const txs_type *t = &c->crossing.type;
        if (c->weight > 0 && t->band == t->other && abs(t->dx) + abs(t->dy) == 1)
            txs_cross_take(s, i);
    }
}

/* The worst types of a pair of labels; returns how many. */
static int txs_cross_add_worst(txs_study *s, int tail, int head) {
    int added = 0;
    for (; added < TXS_CROSS_BATCH; added++) {
        int worst = -1;
        for (int i = 0; i < s->cross_count; i++) {
            const txs_cross_candidate *c = &s->cross[i];
            if (c->crossing.tail != tail || c->crossing.head != head || c->weight <= 0 ||
                !(c->distance > TXS_NOISE_SHARE * c->noise))
                continue;
            if (worst < 0 || c->distance > s->cross[worst].distance) worst = i;
        }
        if (worst < 0 || s->crossings == TXS_MAX_CROSSINGS) break;
        txs_cross_take(s, worst);
    }
    return added;
}

/* ---- a level -------------------------------------------------------------------------- */

/* Prepare everything that does not change while types are added. */
static txm_status txs_study_begin(txs_study *s, txm_arena *arena, txm_env *env) {
    const int labels = s->source->labels, reach = s->plan->reach;
    for (int k = 0; k < labels; k++) {
        txs_learner *a = &s->learner[k];
        s->texture[k].model = s->model[k];
        s->texture[k].level = &s->model[k]->level[s->index];
        memset(a, 0, sizeof *a);
        a->model = s->model[k];
        a->index = s->source->parent ? s->index : s->model[k]->levels - 1;
        a->level = &s->model[k]->level[s->index];
        a->capacity = (2 * reach + 1) * (2 * reach + 1) * s->model[k]->bands + 400;
        a->candidates =
            (txs_candidate *)txm_arena_alloc(arena, (size_t)a->capacity, sizeof *a->candidates);
    }
    s->crossing = (txs_crossing *)txm_arena_zero(arena, TXS_MAX_CROSSINGS, sizeof *s->crossing);
    const int crosses = s->plan->crosses ? txs_cross_list(s, 0) : 0;
    if (crosses)
        s->cross = (txs_cross_candidate *)txm_arena_alloc(arena, (size_t)crosses, sizeof *s->cross);
    if (arena->failed || !txs_tails_make(arena, s->source, s->source->sample, reach, s->tails) ||
        !txs_tails_make(arena, s->canvas, s->canvas->label, reach, s->free_tails) ||
        (s->plan->border &&
         !txs_tails_make(arena, s->border, s->border->sample, reach, s->border_tails)))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to learn from the picture");
    for (int k = 0; k < labels && !s->plan->border; k++) s->border_tails[k] = s->tails[k];
    for (int k = 0; k < labels; k++) {
        s->now = k;
        txs_study_preselect(s, k);
        txs_study_list(s, k);
        txm_parallel_for(env, s->learner[k].candidate_count, txs_study_source, s);
    }
    if (crosses) {
        txs_cross_list(s, crosses);
        txm_parallel_for(env, s->cross_count, txs_cross_source, s);
        txs_cross_preselect(s);
    }
    return TXM_OK;
}

/* Add the worst types of all labels and pairs of labels, `left` for each label at most; returns how
   many. */
static int txs_study_add(txs_study *s, int left, txm_env *env) {
    const int labels = s->source->labels, batch = left < s->plan->batch ? left : s->plan->batch;
    int added = 0;
    for (int k = 0; k < labels; k++) {
        s->now = k;
        txm_parallel_for(env, s->learner[k].candidate_count, txs_study_canvas, s);
        added += txs_add_worst(&s->learner[k], batch, TXS_THRESHOLD);
    }
    if (!s->plan->crosses) return added;
    txm_parallel_for(env, s->cross_count, txs_cross_canvas, s);
    for (int k = 0; k < labels; k++)
        for (int l = k + 1; l < labels; l++) added += txs_cross_add_worst(s, k, l);
    return added;
}

/* The mean of the controlled potentials over some sweeps is what a model keeps. */
static void txs_study_keep(txs_study *s, const txs_brush *brush, int64_t (*sum)[TXS_BINS],
                           int sweeps) {
    const int labels = s->source->labels;
    for (int k = 0; k < labels; k++)
        txs_keep_potentials(&s->model[k]->level[s->index], sum + brush->base[k], sweeps);
    for (int i = 0; i < s->crossings; i++) {
        txs_level one; /* a level of this type only */
        memset(&one, 0, sizeof one);
        one.types = &s->crossing[i].type;
        one.type_count = 1;
        txs_keep_potentials(&one, sum + brush->base[labels] + i, sweeps);
    }
}

/* The rounds of synthesis and of adding types, then the last sweeps. Fraction from..to of the whole. */
static txm_status txs_study_run(txs_study *s, txs_brush *brush, int64_t (*sum)[TXS_BINS],
                                txm_env *env, float from, float to) {
    const txs_study_plan *plan = s->plan;
    const int rounds = (plan->types + plan->batch - 1) / plan->batch;
    const int kept = (plan->last + 1) / 2; /* of the last sweeps, half make the potentials */
    const float sweep =
        (to - from) / (float)(plan->first + rounds * (plan->between + 2) + plan->last);
    int left = plan->types, sweeps = plan->first;
    txm_status status;
    for (;;) { /* what was synthesised so far, and its potentials, are kept */
        brush->crossings = s->crossings;
        txs_brush_start(brush);
        for (int i = 0; i < sweeps; i++, from += sweep)
            if ((status = txs_brush_sweep(brush, env, "learn", from, from + sweep)) != TXM_OK)
                return status;
        if (left <= 0 || !txs_study_add(s, left, env)) break;
        left -= plan->batch;
        sweeps = plan->between;
        from += 2 * sweep; /* about what the measuring takes */
    }
    for (int i = 0; i < plan->last; i++, from += sweep) {
        if (i + 1 == plan->last && plan->last_noise) brush->noise = plan->last_noise;
        if ((status = txs_brush_sweep(brush, env, "learn", from, from + sweep)) != TXM_OK)
            return status;
        for (int k = 0; k < brush->active_count && i >= plan->last - kept; k++)
            for (int j = 0; j < TXS_BINS; j++)
                sum[brush->active[k]][j] += brush->integral[brush->active[k]][j];
    }
    txs_study_keep(s, brush, sum, kept);
    return TXM_OK;
}

/* Learn level `index` of the models, one for each label, whose bands and quantisation are set and
   whose level has room for TXS_MAX_TYPES types. The source and the canvas have been laid (and
   raised); the latter's free pixels are synthesised. Crossing types go to crossing[], room for
   TXS_MAX_CROSSINGS of them, and *crossings, unless these are NULL. Fraction from..to of the
   whole. */
static txm_status txs_mosaic_learn(const txs_study_plan *plan, int index, texsyn_model **model,
                                   const txs_mosaic *source, txs_mosaic *canvas,
                                   txs_crossing *crossing, int *crossings, txm_env *env, float from,
                                   float to) {
    const txs_brush_plan brush_plan = {TXS_PRESELECTED + plan->types,
                                       plan->crosses ? (int)TXS_MAX_CROSSINGS : 0, plan->refresh,
                                       plan->softness, plan->seed};
    const size_t places =
        (size_t)(canvas->labels * brush_plan.max_types + brush_plan.max_crossings);
    txm_status status = TXM_OUT_OF_MEMORY;
    txm_arena arena;
    txm_arena_init(&arena, env);
    txs_study *s = (txs_study *)txm_arena_zero(&arena, 1, sizeof *s);
    if (s) {
        s->plan = plan;
        s->source = source;
        s->canvas = canvas;
        s->border = plan->border ? plan->border : source;
        s->index = index;
        s->model = model;
        status = txs_study_begin(s, &arena, env);
    }
    if (status == TXM_OK) {
        txs_brush *brush = txs_brush_make(&arena, canvas, s->texture, &brush_plan, plan->noise);
        int64_t(*sum)[TXS_BINS] = (int64_t(*)[TXS_BINS])txm_arena_zero(&arena, places, sizeof *sum);
        status = TXM_OUT_OF_MEMORY;
        if (!arena.failed) {
            brush->crossing = s->crossing;
            status = txs_study_run(s, brush, sum, env, from, to);
        }
    }
    if (status == TXM_OK && crossing) {
        memcpy(crossing, s->crossing, sizeof *crossing * (size_t)s->crossings);
        *crossings = s->crossings;
    }
    if (status == TXM_OUT_OF_MEMORY) txm_fail(env, status, "no memory to learn from the picture");
    txm_arena_free(&arena);
    return status;
}

/* Synthesise the free pixels of a canvas, which has been laid (and raised), with models that are
   known. */
static txm_status txs_mosaic_run(txs_mosaic *canvas, const txs_texture *texture,
                                 const txs_brush_plan *plan, const txs_crossing *crossing,
                                 int crossings, int sweeps, const int16_t *noise,
                                 const int16_t *last_noise, txm_env *env, float from, float to) {
    txm_status status = TXM_OK;
    txm_arena arena;
    txm_arena_init(&arena, env);
    txs_brush *brush = txs_brush_make(&arena, canvas, texture, plan, noise);
    if (!brush) {
        txm_arena_free(&arena);
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to synthesise");
    }
    brush->crossing = crossing;
    brush->crossings = crossings;
    txs_brush_reset(brush);
    txs_brush_start(brush);
    for (int i = 0; i < sweeps && status == TXM_OK; i++) {
        const float at = from + (to - from) * (float)i / (float)sweeps;
        if (i + 1 == sweeps && last_noise) brush->noise = last_noise;
        status = txs_brush_sweep(brush, env, "synthesise", at,
                                 from + (to - from) * (float)(i + 1) / (float)sweeps);
    }
    txm_arena_free(&arena);
    return status;
}

/* ---- values within their steps -----------------------------------------------------------

   A sampled value is a step of the quantisation. Where within the step? Smooth shades want the
   place that the neighbours suggest, grain a random one. What is taken is

       mix * smooth + (1 - mix) * random,

   with mix such that the mean difference of neighbours is that of the source. Positions are in
   steps of the band, so a value is q + position.                                            */

typedef struct txs_tone {
    const txs_mosaic *mosaic;
    const txs_ground *ground;
    const txs_level *level;
    int label, band;
    float *at;    /* value of each pixel in steps: known ones, and the smooth of the free ones */
    float *grain; /* the random place within the step                                          */
    float spread; /* of it: the share of a step                                                */
} txs_tone;

/* A number -1/2..1/2 that belongs to a pixel and band. */
static float txs_tone_noise(uint64_t seed, int x, int y, int band) {
    const uint64_t bits =
        txm_hash(((uint64_t)(unsigned)y << 32 | (unsigned)x) ^ txm_hash(seed + (uint64_t)band));
    return (float)(bits >> 40) / 16777216.0f - 0.5f;
}

static size_t txs_tone_index(const txs_tone *t, int x, int y) {
    return (size_t)y * (size_t)t->ground->width + (size_t)x;
}

/* Has the pixel the label, and is it there at all? */
static int txs_tone_has(const txs_tone *t, int x, int y) {
    return x >= 0 && y >= 0 && x < t->ground->width && y < t->ground->height &&
           t->ground->label[txs_tone_index(t, x, y)] == t->label;
}

/* Known values in steps; free ones start at the middle of theirs. */
static void txs_tone_start(txs_tone *t, uint64_t seed) {
    const size_t pixels = (size_t)t->ground->width * (size_t)t->ground->height;
    const double low = (double)t->level->low[t->band], step = (double)t->level->step[t->band];
    for (int y = 0; y < t->ground->height; y++) {
        for (int x = 0; x < t->ground->width; x++) {
            const size_t i = txs_tone_index(t, x, y);
            if (t->ground->label[i] != t->label) continue;
            if (t->ground->state[i] == TXS_FREE) {
                t->at[i] = txs_pixel(t->mosaic, x, y)[t->band * t->mosaic->canvas.plane];
                t->grain[i] = t->spread * txs_tone_noise(seed, x, y, t->band);
            } else {
                const double value = (double)t->ground->value[(size_t)t->band * pixels + i];
                t->at[i] = txm_float((value - low) / step);
            }
        }
    }
}

/* Sweeps of Gauss and Seidel: free pixels move towards the mean of their neighbours, within that
   share of their step that the source's values fill. */
static void txs_tone_smooth(txs_tone *t, int sweeps) {
    const float limit = t->spread / 2;
    for (int sweep = 0; sweep < sweeps; sweep++) {
        for (int y = 0; y < t->ground->height; y++) {
            for (int x = 0; x < t->ground->width; x++) {
                const size_t i = txs_tone_index(t, x, y);
                double sum = 0;
                int count = 0;
                if (t->ground->state[i] != TXS_FREE || t->ground->label[i] != t->label) continue;
                for (int k = 0; k < 4; k++) {
                    const int nx = x + (k == 0) - (k == 1), ny = y + (k == 2) - (k == 3);
                    if (!txs_tone_has(t, nx, ny)) continue;
                    sum += (double)t->at[txs_tone_index(t, nx, ny)];
                    count++;
                }
                if (!count) continue;
                const float q = txs_pixel(t->mosaic, x, y)[t->band * t->mosaic->canvas.plane];
                t->at[i] = txm_clampf(txm_float(sum / count), q - limit, q + limit);
            }
        }
    }
}

/* A free pixel's value for a mix, or a known one's. */
static double txs_tone_value(const txs_tone *t, int x, int y, double mix) {
    const size_t i = txs_tone_index(t, x, y);
    if (t->ground->state[i] != TXS_FREE) return (double)t->at[i];
    const double q = txs_pixel(t->mosaic, x, y)[t->band * t->mosaic->canvas.plane];
    return q + mix * ((double)t->at[i] - q) + (1 - mix) * (double)t->grain[i];
}

/* Does the pixel have the state, and is it not a hidden colour? */
static int txs_tone_counts(const txs_tone *t, int x, int y, int state) {
    const txs_ground *g = t->ground;
    const size_t i = txs_tone_index(t, x, y);
    if (g->state[i] != state) return 0;
    return state == TXS_FREE || !g->weight || g->alpha[t->label] == t->band || g->weight[i];
}

/* Mean difference of neighbours that both have a state; negative if there are none. */
static double txs_tone_roughness(const txs_tone *t, int state, double mix) {
    double sum = 0;
    int64_t count = 0;
    for (int y = 0; y < t->ground->height; y++) {
        for (int x = 0; x < t->ground->width; x++) {
            if (!txs_tone_has(t, x, y) || !txs_tone_counts(t, x, y, state)) continue;
            const double value = txs_tone_value(t, x, y, mix);
            for (int k = 0; k < 2; k++) {
                const int nx = x + !k, ny = y + k;
                if (!txs_tone_has(t, nx, ny) || !txs_tone_counts(t, nx, ny, state)) continue;
                sum += fabs(txs_tone_value(t, nx, ny, mix) - value);
                count++;
            }
        }
    }
    return count ? sum / (double)count : -1;
}

/* The mix that gives the free pixels the source's roughness. */
static double txs_tone_mix(const txs_tone *t) {
    enum { HALVINGS = 6 };
    const double wanted = txs_tone_roughness(t, TXS_SOURCE, 0);
    double low = 0, high = 1;
    if (wanted < 0) return 1;
    for (int i = 0; i < HALVINGS; i++) { /* more mix, less roughness */
        const double mix = (low + high) / 2;
        if (txs_tone_roughness(t, TXS_FREE, mix) > wanted) low = mix;
        else high = mix;
    }
    return (low + high) / 2;
}

/* Give the free pixels of a label their values in one band of the ground, from the canvas.
   at, grain: a number for each pixel. spread: the share of a step that the source's values fill. */
static void txs_tone_apply(const txs_mosaic *m, txs_ground *g, const txs_texture *texture,
                           int label, int band, float spread, uint64_t seed, float *at,
                           float *grain) {
    enum { SWEEPS = 8 };
    const size_t pixels = (size_t)g->width * (size_t)g->height;
    txs_tone t = {m, g, texture[label].level, label, band, at, grain, spread};
    txs_tone_start(&t, seed);
    txs_tone_smooth(&t, SWEEPS);
    const double mix = txs_tone_mix(&t);
    for (int y = 0; y < g->height; y++) {
        for (int x = 0; x < g->width; x++) {
            const size_t i = txs_tone_index(&t, x, y);
            if (g->state[i] != TXS_FREE || g->label[i] != label) continue;
            const float steps = txm_float(txs_tone_value(&t, x, y, mix));
            g->value[(size_t)band * pixels + i] =
                txm_float(txs_value(t.level, band, (double)steps));
        }
    }
}

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

/* ---- the border of a knit ----------------------------------------------------------------

   Two pictures, and for each pixel the label of the one that it is taken from: 0 or 1. The border
   as drawn is displaced: where the first material is bright it reaches further into the second one
   and the other way round, so that whole grains and stones stay together and stand out; noise as
   coarse as the grain does the rest. How coarse that is is asked of the materials.          */

enum {
    TXS_NEXT = 5, /* distances are in fifths of a pixel: to the next pixel in a row, */
    TXS_CORNERWISE = 7,
    TXS_KNIGHT = 11,     /* diagonally, and 2 along and 1 across                     */
    TXS_FARTHEST = 60000,     /* no other label seen yet                                  */
    TXS_KNIT_CELL = 256,      /* pixels: a side of what is worked on at once              */
    TXS_SURVEY = 100000, /* pixels of a picture that are looked at                   */
    TXS_LAGS = 24,       /* pixels: the longest correlation that is looked for       */
    TXS_TRAITS = 7,      /* histograms that tell textures apart                      */
    TXS_TRAIT_BINS = 32,
    TXS_COATS = 4 /* fields that displace the border: brightness of both, noise, fine noise */
};

#define TXS_FINEST_GRAIN 1.5  /* pixels: standard deviation of the blur of the fields */
#define TXS_COARSEST_GRAIN 5.0
#define TXS_ROUGH 2.2         /* displacement in units of the grain                   */
#define TXS_ROUGHEST 2.5      /* the largest displacement in units of the usual one   */

typedef struct txs_pair_of_pictures { /* all of one form; the second one is repeated by reflection */
    txm_image picture[2];
    int width, height; /* of the first */
} txs_pair_of_pictures;

/* A coordinate reflected into 0..size-1. */
static int txs_reflect(int x, int size) {
    const int turn = txs_mod(x, 2 * size);
    return turn < size ? turn : 2 * size - 1 - turn;
}

static float txs_pair_get(const txs_pair_of_pictures *p, int label, int x, int y, int c) {
    const txm_image *im = &p->picture[label];
    return txm_image_get(im, txs_reflect(x, im->width), txs_reflect(y, im->height), c);
}

/* Brightness 0..1; what cannot be seen is neither bright nor dark. */
static double txs_pair_luma(const txs_pair_of_pictures *p, int label, int x, int y) {
    const int channels = p->picture[label].channels;
    if (channels == 4 && !(txs_pair_get(p, label, x, y, 3) > 0)) return 0.5;
    if (channels < 3) return (double)txs_pair_get(p, label, x, y, 0);
    return (54 * (double)txs_pair_get(p, label, x, y, 0) +
            183 * (double)txs_pair_get(p, label, x, y, 1) +
            19 * (double)txs_pair_get(p, label, x, y, 2)) /
           256;
}

/* ---- distances ------------------------------------------------------------------------ */

/* The distance of a pixel from the nearest one of another label, by way of one neighbour. */
static int txs_border_step(const uint8_t *label, const uint16_t *distance, int width, int height,
                           int x, int y, int dx, int dy, int step) {
    const int nx = x + dx, ny = y + dy;
    if (nx < 0 || ny < 0 || nx >= width || ny >= height) return TXS_FARTHEST;
    const size_t at = (size_t)y * (size_t)width + (size_t)x;
    const size_t next = (size_t)ny * (size_t)width + (size_t)nx;
    return label[next] != label[at] ? step : distance[next] + step;
}

/* Distances of all pixels from the other label, in fifths of a pixel, at most TXS_FARTHEST. */
static void txs_border_distances(const uint8_t *label, int width, int height, uint16_t *distance) {
    static const int8_t way[8][3] = {
        {-1, 0, TXS_NEXT},      {0, -1, TXS_NEXT},      {-1, -1, TXS_CORNERWISE},
        {1, -1, TXS_CORNERWISE},  {-2, -1, TXS_KNIGHT},   {-1, -2, TXS_KNIGHT},
        {1, -2, TXS_KNIGHT},    {2, -1, TXS_KNIGHT}};
    const size_t pixels = txs_pixels_of(width, height);
    for (size_t i = 0; i < pixels; i++) distance[i] = TXS_FARTHEST;
    for (int sign = 1; sign >= -1; sign -= 2) { /* from the first pixel on, then from the last */
        for (size_t i = 0; i < pixels; i++) {
            const size_t at = sign > 0 ? i : pixels - 1 - i;
            const int x = (int)(at % (size_t)width), y = (int)(at / (size_t)width);
            int least = distance[at];
            for (int k = 0; k < 8; k++) {
                const int d = txs_border_step(label, distance, width, height, x, y,
                                              sign * way[k][0], sign * way[k][1], way[k][2]);
                if (d < least) least = d;
            }
            distance[at] = (uint16_t)least;
        }
    }
}

/* ---- what the materials are like ------------------------------------------------------ */

typedef struct txs_material {
    double grain;                             /* pixels: half the length of correlation */
    double trait[TXS_TRAITS][TXS_TRAIT_BINS]; /* normalised histograms                  */
} txs_material;

/* Every how many pixels, in both directions, a picture is looked at. */
static int txs_survey_step(int width, int height) {
    int step = 1;
    while ((int64_t)width * height / step / step > TXS_SURVEY) step++;
    return step;
}

static void txs_add_trait(txs_material *m, int trait, double value) {
    m->trait[trait][txm_clampi((int)floor(value * (double)TXS_TRAIT_BINS), 0,
                               (int)TXS_TRAIT_BINS - 1)] += 1;
}

/* Brightness, two differences of channels, and differences of neighbours near and far. */
static void txs_survey_pixel(const txs_pair_of_pictures *p, int label, int x, int y,
                             txs_material *m) {
    enum { FAR_ = 4 }; /* pixels */
    const double luma = txs_pair_luma(p, label, x, y);
    txs_add_trait(m, 0, luma);
    for (int k = 0; k < 4; k++) {
        const int step = k < 2 ? 1 : FAR_;
        const double other = txs_pair_luma(p, label, x + (k % 2 ? 0 : step), y + (k % 2 ? step : 0));
        txs_add_trait(m, 1 + k, sqrt(fabs(other - luma))); /* small ones are resolved better */
    }
    if (p->picture[label].channels < 3) return;
    const double green = (double)txs_pair_get(p, label, x, y, 1);
    txs_add_trait(m, 5, 0.5 + 2 * ((double)txs_pair_get(p, label, x, y, 0) - green));
    txs_add_trait(m, 6, 0.5 + 2 * ((double)txs_pair_get(p, label, x, y, 2) - green));
}

/* The length of correlation of the brightness: where it falls under 1/e. */
static double txs_correlation(const txs_pair_of_pictures *p, const uint8_t *own, int label,
                              int step) {
    double count = 0, sum = 0, square = 0;
    double differing[TXS_LAGS + 1] = {0}, pairs[TXS_LAGS + 1] = {0};
    for (int y = 0; y < p->height; y += step) {
        for (int x = 0; x < p->width; x += step) {
            if (own[(size_t)y * (size_t)p->width + (size_t)x] != label) continue;
            const double v = txs_pair_luma(p, label, x, y);
            count++;
            sum += v;
            square += txm_float(v * v);
            for (int lag = 1; lag <= TXS_LAGS; lag++) {
                for (int k = 0; k < 2; k++) {
                    const int nx = x + (k ? 0 : lag), ny = y + (k ? lag : 0);
                    if (nx >= p->width || ny >= p->height ||
                        own[(size_t)ny * (size_t)p->width + (size_t)nx] != label)
                        continue;
                    const double d = txs_pair_luma(p, label, nx, ny) - v;
                    differing[lag] += txm_float(d * d);
                    pairs[lag]++;
                }
            }
        }
    }
    const double mean = count > 0 ? sum / count : 0;
    const double variance = count > 0 ? square / count - txm_float(mean * mean) : 0;
    for (int lag = 1; lag <= TXS_LAGS; lag++)
        if (!(pairs[lag] > 0) ||
            differing[lag] / pairs[lag] > 2 * variance * (1 - 0.36787944117144233))
            return lag;
    return TXS_LAGS;
}

/* Look at a picture where it is its own side. */
static void txs_survey(const txs_pair_of_pictures *p, const uint8_t *own, int label,
                       txs_material *m) {
    const int step = txs_survey_step(p->width, p->height);
    double count = 0;
    memset(m, 0, sizeof *m);
    for (int y = 0; y < p->height; y += step) {
        for (int x = 0; x < p->width; x += step) {
            if (own[(size_t)y * (size_t)p->width + (size_t)x] != label) continue;
            txs_survey_pixel(p, label, x, y, m);
            count++;
        }
    }
    for (int k = 0; k < TXS_TRAITS; k++)
        for (int i = 0; i < TXS_TRAIT_BINS && count > 0; i++) m->trait[k][i] /= count;
    m->grain = txs_correlation(p, own, label, step) / 2;
}

/* How much two materials differ: 0..1, the largest of the distances of their histograms. */
static double txs_material_distance(const txs_material *a, const txs_material *b) {
    double most = 0;
    for (int k = 0; k < TXS_TRAITS; k++) {
        double sum = 0;
        for (int i = 0; i < TXS_TRAIT_BINS; i++) sum += fabs(a->trait[k][i] - b->trait[k][i]);
        if (sum / 2 > most) most = sum / 2;
    }
    return most;
}

/* ---- fields --------------------------------------------------------------------------- */

enum {
    TXS_PASSES = 3, /* of moving means: about a Gaussian                       */
    TXS_WIDER = 4   /* times as wide a blur is what brightness is compared with */
};

/* What displaces the border, in a cell of the picture. */
typedef struct txs_coats {
    const txs_pair_of_pictures *pair;
    uint64_t seed;
    int radius;                /* of the blur                                   */
    int left, top;             /* of the cell                                   */
    int side;                  /* of the cell with the rim that blurring needs  */
    double *plane, *wide;      /* side x side each                              */
    double *line;              /* side                                          */
    double *field[TXS_COATS];  /* TXS_KNIT_CELL x TXS_KNIT_CELL each                      */
    double square[TXS_COATS];  /* sums over the pixels that are near the border */
    double count;
} txs_coats;

/* One pass of a moving mean over count values that are step apart; at the ends the last value is
   repeated. */
static void txs_mean_line(double *v, ptrdiff_t step, int count, int radius, double *line) {
    double sum = 0;
    for (int i = 0; i < count; i++) line[i] = v[i * step];
    for (int i = -radius; i <= radius; i++) sum += line[txm_clampi(i, 0, count - 1)];
    for (int i = 0; i < count; i++) {
        v[i * step] = sum / (2 * radius + 1);
        sum += line[txm_clampi(i + radius + 1, 0, count - 1)] -
               line[txm_clampi(i - radius, 0, count - 1)];
    }
}

static void txs_coats_blur(const txs_coats *c, double *plane, int side, int radius) {
    for (int pass = 0; pass < TXS_PASSES; pass++) {
        for (int y = 0; y < side; y++)
            txs_mean_line(plane + (ptrdiff_t)y * side, 1, side, radius, c->line);
        for (int x = 0; x < side; x++) txs_mean_line(plane + x, side, side, radius, c->line);
    }
}

/* The radius of moving means whose passes blur with this standard deviation. */
static int txs_blur_radius(double deviation) {
    const double d = (double)txm_float(deviation); /* its square is exact */
    return txm_clampi((int)floor(sqrt(d * d + 0.25)), 1, 1 << 10);
}

static int txs_coats_rim(int radius) {
    return TXS_PASSES * (1 + TXS_WIDER) * radius;
}

/* Room for the fields of a cell; 0 if there is no memory. */
static int txs_coats_make(txs_coats *c, txm_arena *arena, const txs_pair_of_pictures *pair,
                          double grain, uint64_t seed) {
    memset(c, 0, sizeof *c);
    c->pair = pair;
    c->seed = seed;
    c->radius = txs_blur_radius(grain);
    c->side = TXS_KNIT_CELL + 2 * txs_coats_rim(c->radius);
    const size_t side = (size_t)c->side;
    c->plane = (double *)txm_arena_alloc(arena, side * side, sizeof(double));
    c->wide = (double *)txm_arena_alloc(arena, side * side, sizeof(double));
    c->line = (double *)txm_arena_alloc(arena, side, sizeof(double));
    for (int k = 0; k < TXS_COATS; k++)
        c->field[k] =
            (double *)txm_arena_alloc(arena, (size_t)TXS_KNIT_CELL * TXS_KNIT_CELL, sizeof(double));
    return !arena->failed;
}

/* White noise that belongs to the place. */
static double txs_coat_noise(uint64_t seed, int x, int y) {
    const uint64_t place = (uint64_t)(uint32_t)y << 32 | (uint32_t)x;
    return (double)(txm_hash(place ^ txm_hash(seed)) >> 40) / 16777216.0 - 0.5;
}

/* Brightness less that of the surroundings, of picture k. */
static void txs_coat_brightness(txs_coats *c, int k) {
    const int rim = txs_coats_rim(c->radius);
    const size_t size = (size_t)c->side * (size_t)c->side;
    for (int y = 0; y < c->side; y++)
        for (int x = 0; x < c->side; x++)
            c->plane[(size_t)y * (size_t)c->side + (size_t)x] =
                txs_pair_luma(c->pair, k, c->left + x - rim, c->top + y - rim);
    txs_coats_blur(c, c->plane, c->side, c->radius);
    memcpy(c->wide, c->plane, size * sizeof *c->wide);
    txs_coats_blur(c, c->wide, c->side, TXS_WIDER * c->radius);
    for (int y = 0; y < TXS_KNIT_CELL; y++) {
        for (int x = 0; x < TXS_KNIT_CELL; x++) {
            const size_t at = (size_t)(y + rim) * (size_t)c->side + (size_t)(x + rim);
            c->field[k][y * TXS_KNIT_CELL + x] = c->plane[at] - c->wide[at];
        }
    }
}

/* Noise, blurred, to field k. */
static void txs_coat_clouds(txs_coats *c, int k, int radius) {
    const int rim = TXS_PASSES * radius, side = TXS_KNIT_CELL + 2 * rim;
    for (int y = 0; y < side; y++)
        for (int x = 0; x < side; x++)
            c->plane[(size_t)y * (size_t)side + (size_t)x] =
                txs_coat_noise(c->seed + (uint64_t)k, c->left + x - rim, c->top + y - rim);
    txs_coats_blur(c, c->plane, side, radius);
    for (int y = 0; y < TXS_KNIT_CELL; y++)
        for (int x = 0; x < TXS_KNIT_CELL; x++)
            c->field[k][y * TXS_KNIT_CELL + x] =
                c->plane[(size_t)(y + rim) * (size_t)side + (size_t)(x + rim)];
}

/* All fields in the cell whose first pixel is left, top. */
static void txs_coats_lay(txs_coats *c, int left, int top) {
    c->left = left;
    c->top = top;
    txs_coat_brightness(c, 0);
    txs_coat_brightness(c, 1);
    txs_coat_clouds(c, 2, c->radius);
    txs_coat_clouds(c, 3, (c->radius + 1) / 2);
}

/* ---- displacing ----------------------------------------------------------------------- */

typedef struct txs_frayed { /* a border to be displaced */
    uint8_t *label;
    const uint16_t *distance; /* of the border as drawn */
    int width, height;
    int limit;  /* of the displacement, in fifths of a pixel */
    float rough; /* the usual displacement, pixels */
} txs_frayed;

/* The field that displaces the border, about of standard deviation 1: positive towards picture 0. */
static double txs_coats_at(const txs_coats *c, int at) {
    static const float weight[TXS_COATS] = {-0.5f, 0.5f, 0.65f, 0.3f};
    double sum = 0;
    for (int k = 0; k < TXS_COATS; k++) {
        const double deviation = c->count > 0 ? sqrt(c->square[k] / c->count) : 0;
        if (deviation > 1e-4) /* not of a picture that is flat */
            sum += (double)txm_float((double)weight[k] * c->field[k][at] / deviation);
    }
    return sum;
}

/* Add up the squares of the fields in this cell, or (is_last) displace the border in it. */
static void txs_fray_cell(const txs_frayed *f, txs_coats *c, int is_last) {
    for (int y = 0; y < TXS_KNIT_CELL && c->top + y < f->height; y++) {
        for (int x = 0; x < TXS_KNIT_CELL && c->left + x < f->width; x++) {
            const size_t i = (size_t)(c->top + y) * (size_t)f->width + (size_t)(c->left + x);
            const int at = y * TXS_KNIT_CELL + x, from = f->distance[i];
            if (from > f->limit) continue;
            if (is_last) {
                const double edge = from / (double)TXS_NEXT - 0.5;
                const double off = (double)txm_float(txs_coats_at(c, at) * (double)f->rough);
                f->label[i] = (f->label[i] ? edge : -edge) + off > 0;
                continue;
            }
            for (int k = 0; k < TXS_COATS; k++)
                c->square[k] += (double)txm_float(c->field[k][at] * c->field[k][at]);
            c->count++;
        }
    }
}

static int txs_fray_reaches(const txs_frayed *f, int left, int top) {
    for (int y = top; y < top + TXS_KNIT_CELL && y < f->height; y++)
        for (int x = left; x < left + TXS_KNIT_CELL && x < f->width; x++)
            if (f->distance[(size_t)y * (size_t)f->width + (size_t)x] <= f->limit) return 1;
    return 0;
}

/* Displace the border, cell by cell. Fraction 0..to of the whole. */
static txm_status txs_fray(const txs_frayed *f, txs_coats *c, txm_env *env, float to) {
    for (int pass = 0; pass < 2; pass++) {
        for (int top = 0; top < f->height; top += TXS_KNIT_CELL) {
            const float part = (float)(pass * f->height + top) / (2 * (float)f->height);
            if (txm_progress(env, to * part, "border"))
                return txm_fail(env, TXM_CANCELLED, "cancelled");
            for (int left = 0; left < f->width; left += TXS_KNIT_CELL) {
                if (!txs_fray_reaches(f, left, top)) continue;
                txs_coats_lay(c, left, top);
                txs_fray_cell(f, c, pass);
            }
        }
    }
    return TXM_OK;
}

/* ---- the border between pictures of one texture -------------------------------------------

   It moves to where the two pictures agree: the minimum cut in a band along the border as drawn,
   cell by cell. A cell looks a little beyond itself; what earlier cells have decided is fixed. */

enum {
    TXS_SEAM_RIM = 16,                                     /* pixels that a cell looks beyond itself */
    TXS_SEAM_SIDE = TXS_KNIT_CELL + 2 * TXS_SEAM_RIM + 2,  /* nodes: with the margin of txm_flow */
    TXS_SEAM_HARD = 1 << 20,                               /* more than all arcs of a pixel */
    TXS_SEAM_ROUGHEST = 255                                /* the largest mismatch of a pixel */
};

typedef struct txs_seam {
    const txs_pair_of_pictures *pair;
    const txs_frayed *border;
    txm_flow flow;
    int left, top;     /* of the cell                                   */
    uint8_t *mismatch; /* of each node; those outside the picture have 0 */
} txs_seam;

/* By how much the pictures differ at a pixel, 0..255; colours as far as they are visible. */
static uint8_t txs_mismatch(const txs_pair_of_pictures *p, int x, int y) {
    const int channels = p->picture[0].channels;
    double sum = 0, shown[2] = {1, 1};
    for (int k = 0; k < 2 && channels == 4; k++)
        shown[k] = (double)txm_clampf(txs_pair_get(p, k, x, y, 3), 0, 1);
    for (int c = 0; c < channels; c++) {
        const double a = (double)txs_pair_get(p, 0, x, y, c);
        const double b = (double)txs_pair_get(p, 1, x, y, c);
        sum += c < 3 ? fabs(shown[0] * a - shown[1] * b) : fabs(a - b);
    }
    const double share = sum / channels;
    return (uint8_t)(share < 1 ? (int)floor(share * 255) : (int)TXS_SEAM_ROUGHEST);
}

/* The pixel of a node; 0 if it is in the margin or outside the picture. */
static int txs_seam_pixel(const txs_seam *s, int node, int *x, int *y) {
    const int u = node % TXS_SEAM_SIDE, v = node / TXS_SEAM_SIDE;
    *x = s->left + u - TXS_SEAM_RIM - 1;
    *y = s->top + v - TXS_SEAM_RIM - 1;
    return u > 0 && v > 0 && u < TXS_SEAM_SIDE - 1 && v < TXS_SEAM_SIDE - 1 && *x >= 0 && *y >= 0 &&
           *x < s->border->width && *y < s->border->height;
}

static size_t txs_seam_index(const txs_seam *s, int x, int y) {
    return (size_t)y * (size_t)s->border->width + (size_t)x;
}

/* Arcs to the next pixels, and what is fixed: pixels beyond the band and those of earlier cells. */
static void txs_seam_lay(txs_seam *s) {
    const txs_frayed *f = s->border;
    txm_flow *g = &s->flow;
    int x, y;
    for (int p = 0; p < g->count; p++) {
        for (int d = 0; d < 4; d++) g->arc[d][p] = 0;
        g->excess[p] = 0;
        s->mismatch[p] =
            (uint8_t)(txs_seam_pixel(s, p, &x, &y) ? txs_mismatch(s->pair, x, y) : 0);
    }
    for (int p = 0; p < g->count; p++) {
        if (!txs_seam_pixel(s, p, &x, &y)) continue;
        const size_t i = txs_seam_index(s, x, y);
        const int is_earlier = y < s->top || (y < s->top + TXS_KNIT_CELL && x < s->left);
        if (f->distance[i] > f->limit || is_earlier)
            g->excess[p] = f->label[i] ? -TXS_SEAM_HARD : (int)TXS_SEAM_HARD;
        for (int d = 0; d < 2; d++) {
            const int q = p + g->step[d];
            if (!txs_seam_pixel(s, q, &x, &y)) continue;
            g->arc[d][p] = g->arc[d + 2][q] = 1 + s->mismatch[p] + s->mismatch[q];
        }
    }
}

/* Cut a cell. */
static void txs_seam_cut(txs_seam *s, int left, int top) {
    const txs_frayed *f = s->border;
    s->left = left;
    s->top = top;
    txs_seam_lay(s);
    txm_flow_solve(&s->flow);
    for (int p = 0; p < s->flow.count; p++) {
        int x, y;
        if (!txs_seam_pixel(s, p, &x, &y) || x < left || y < top || x >= left + TXS_KNIT_CELL ||
            y >= top + TXS_KNIT_CELL)
            continue;
        const size_t i = txs_seam_index(s, x, y);
        if (f->distance[i] <= f->limit) f->label[i] = s->flow.tree[p] == TXM_FLOW_SINK;
    }
}

/* Move the border, cell by cell. Fraction 0..to of the whole. */
static txm_status txs_seam_find(const txs_pair_of_pictures *pair, const txs_frayed *border,
                                txm_env *env, float to) {
    const int nodes = TXS_SEAM_SIDE * TXS_SEAM_SIDE;
    txm_status status = TXM_OK;
    txm_arena arena;
    txs_seam s;
    memset(&s, 0, sizeof s);
    s.pair = pair;
    s.border = border;
    txm_arena_init(&arena, env);
    s.mismatch = (uint8_t *)txm_arena_alloc(&arena, (size_t)nodes, 1);
    if (!txm_flow_make(&s.flow, &arena, 4, nodes) || arena.failed)
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to move the border");
    s.flow.count = nodes;
    s.flow.step[0] = 1;
    s.flow.step[1] = TXS_SEAM_SIDE;
    s.flow.step[2] = -1;
    s.flow.step[3] = -TXS_SEAM_SIDE;
    for (int top = 0; top < border->height && status == TXM_OK; top += TXS_KNIT_CELL) {
        if (txm_progress(env, to * (float)top / (float)border->height, "border"))
            status = txm_fail(env, TXM_CANCELLED, "cancelled");
        for (int left = 0; left < border->width && status == TXM_OK; left += TXS_KNIT_CELL)
            if (txs_fray_reaches(border, left, top)) txs_seam_cut(&s, left, top);
    }
    txm_arena_free(&arena);
    return status;
}

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

/* ---- textons ------------------------------------------------------------------------------

   What a pixel looks like, as two small numbers: a colour texton, the nearest of at most 32 typical
   colours, and a texture texton, the nearest of 64 typical answers of nine filters. These tell how
   much the lightness changes across, down and as spots (gradient and Laplacian, without signs,
   smoothed) at three scales. A texture is then a histogram of textons [6]. Everything is computed
   in integers, or in floats that hold whole numbers below 2^24: the same everywhere. */

enum {
    TXS_WORK = 1 << 19,      /* pixels: a larger picture is reduced to a half, a third, ...     */
    TXS_COLOURS = 32,        /* colour textons                                                  */
    TXS_GRAINS = 64,         /* texture textons                                                 */
    TXS_SCALES = 3,          /* Gaussians of sigma 1, 2.2, 4.6                                  */
    TXS_FILTERS = 3 * TXS_SCALES,
    TXS_CODES = 255 * 16,    /* a sample, 0..1, in steps of a sixteenth of an 8-bit one         */
    TXS_LAB = 64,            /* steps per unit of L*, a*, b*                                    */
    TXS_CUBE_ROOTS = 1 << 14, /* entries of the table, from 0 to 1                              */
    TXS_ROOT_UNIT = 8192,    /* its entries' unit                                               */
    TXS_LOUD = 8,            /* filter answers are told apart up to so many times their RMS     */
    TXS_ANSWER = 127,        /* the largest answer of a filter                                  */
    TXS_TRAINING = 8192,     /* pixels that the textons are made from                           */
    TXS_ROUNDS = 8,          /* of k-means                                                      */
    TXS_APART = 20           /* first centres of colours: so many quarters of a unit of Lab     */
};

/* The picture at the resolution that is worked at, and its textons. */
typedef struct txs_scene {
    int width, height, factor;  /* a pixel is a square of factor x factor pixels of the picture   */
    size_t pixels;
    uint8_t *counted;           /* non-zero: at least half of the square takes part               */
    int16_t *lab[3];            /* L*, a*, b* in steps of 1 / TXS_LAB                             */
    uint8_t *colour, *shape;    /* the textons of each pixel                                      */
} txs_scene;

/* ---- colour ------------------------------------------------------------------------------- */

/* The root of a, 0..1, by Newton's method from above: the same everywhere, unlike pow. */
static double txs_newton_root(double a, int degree) {
    double t = 1;
    for (int k = 0; k < 60 && a > 0; k++) {
        double power = 1;
        for (int i = 1; i < degree; i++) power *= t;
        const double next = t - (t * power - a) / (degree * power);
        if (!(next < t)) break;
        t = next;
    }
    return a > 0 ? t : 0;
}

typedef struct txs_colours {
    uint16_t linear[TXS_CODES + 1];    /* of an sRGB code, 0..65535         */
    int16_t root[TXS_CUBE_ROOTS + 1];  /* CIE's f of a linear value         */
} txs_colours;

static void txs_colour_tables(txs_colours *t) {
    for (int i = 0; i <= TXS_CODES; i++) {
        const double s = (double)i / (double)TXS_CODES, v = (s + 0.055) / 1.055;
        const double linear = s <= 0.04045 ? s / 12.92 : v * v * txs_newton_root(v * v, 5);
        t->linear[i] = (uint16_t)(linear * 65535 + 0.5);
    }
    for (int i = 0; i <= TXS_CUBE_ROOTS; i++) {
        const double v = (double)i / (double)TXS_CUBE_ROOTS;
        const double f = v > 0.008856 ? txs_newton_root(v, 3) : 7.787 * v + 16.0 / 116;
        t->root[i] = (int16_t)(f * (double)TXS_ROOT_UNIT + 0.5);
    }
}

/* sRGB codes to L*a*b* under D65 */
static void txs_code_to_lab(const txs_colours *t, const int code[3], int lab[3]) {
    static const uint32_t weights[3][3] = { /* of R, G, B in X, Y, Z over white, of 32768 */
        {14218, 12327, 6223}, {6966, 23436, 2366}, {580, 3588, 28600}};
    int f[3];
    for (int k = 0; k < 3; k++) {
        uint32_t sum = 0;
        for (int c = 0; c < 3; c++) sum += weights[k][c] * t->linear[code[c]];
        f[k] = t->root[(sum >> 15) * TXS_CUBE_ROOTS / 65535];
    }
    lab[0] = 116 * f[1] * TXS_LAB / TXS_ROOT_UNIT - 16 * TXS_LAB;
    lab[1] = 500 * (f[0] - f[1]) / (TXS_ROOT_UNIT / TXS_LAB);
    lab[2] = 200 * (f[1] - f[2]) / (TXS_ROOT_UNIT / TXS_LAB);
}

static int txs_sample_code(const txm_image *im, int x, int y, int c) {
    const void *row = txm_image_row_const(im, y);
    const size_t i = (size_t)x * (size_t)im->channels + (size_t)c;
    if (im->sample == TXM_U8) return 16 * ((const uint8_t *)row)[i];
    if (im->sample == TXM_U16)
        return (int)(((uint32_t)((const uint16_t *)row)[i] * TXS_CODES + 32767) / 65535);
    return (int)((double)txm_clampf(((const float *)row)[i], 0, 1) * (double)TXS_CODES + 0.5);
}

/* ---- the picture at working resolution ------------------------------------------------------ */

/* Does the pixel take part? By the bytes of the mask, where there is one, and by its own alpha. */
static int txs_takes_part(const txm_image *im, const uint8_t *mask, int x, int y) {
    const int alpha = im->channels == 2 || im->channels == 4;
    if (alpha && txs_sample_code(im, x, y, im->channels - 1) < TXS_CODES / 2) return 0;
    return !mask || mask[(size_t)y * (size_t)im->width + (size_t)x];
}

/* One pixel of the scene: the mean of those of its square that take part, weighted by alpha. */
static void txs_reduce(txs_scene *s, const txm_image *im, const uint8_t *mask,
                       const txs_colours *tables, int x, int y) {
    const int f = s->factor, colours = im->channels < 3 ? 1 : 3;
    const int right = txm_clampi((x + 1) * f, 0, im->width);
    const int bottom = txm_clampi((y + 1) * f, 0, im->height);
    const size_t at = (size_t)y * (size_t)s->width + (size_t)x;
    const int alpha = txm_image_has_alpha(im);
    int64_t sum[3] = {0, 0, 0}, weights = 0, parts = 0, all = 0;
    for (int v = y * f; v < bottom; v++) {
        for (int u = x * f; u < right; u++, all++) {
            if (!txs_takes_part(im, mask, u, v)) continue;
            const int weight = alpha ? txs_sample_code(im, u, v, im->channels - 1) : 1;
            for (int c = 0; c < colours; c++)
                sum[c] += (int64_t)weight * txs_sample_code(im, u, v, c);
            weights += weight;
            parts++;
        }
    }
    s->counted[at] = (uint8_t)(parts > 0 && 2 * parts >= all);
    if (!weights) weights = 1;
    int code[3], lab[3];
    for (int c = 0; c < 3; c++) code[c] = (int)(sum[colours == 1 ? 0 : c] / weights);
    txs_code_to_lab(tables, code, lab);
    for (int c = 0; c < 3; c++) s->lab[c][at] = (int16_t)lab[c];
}

/* ---- filters ------------------------------------------------------------------------------ */

/* Five taps of a Gaussian, `step` apart, along a row or a column of count values that lie `by`
   apart; the border is repeated. line: room for count + 4 * step values. */
static void txs_blur_line(int16_t *values, int count, ptrdiff_t by, int step, int16_t *line) {
    const int pad = 2 * step;
    for (int i = 0; i < count; i++) line[pad + i] = values[i * by];
    for (int i = 0; i < pad; i++) {
        line[i] = line[pad];
        line[pad + count + i] = line[pad + count - 1];
    }
    for (int i = 0; i < count; i++) {
        const int16_t *p = line + i;
        const int sum = p[0] + 4 * p[step] + 6 * p[2 * step] + 4 * p[3 * step] + p[4 * step];
        values[i * by] = (int16_t)((sum + 8 + (1 << 20)) / 16 - (1 << 16));
    }
}

typedef struct txs_blurring {
    int16_t *plane, *lines;
    int width, height, step, room; /* room: values a line has in lines */
} txs_blurring;

static void txs_blur_rows(void *context, int share) {
    const txs_blurring *b = (const txs_blurring *)context;
    const int from = (int)((int64_t)b->height * share / TXS_TASKS);
    const int to = (int)((int64_t)b->height * (share + 1) / TXS_TASKS);
    for (int y = from; y < to; y++)
        txs_blur_line(b->plane + (ptrdiff_t)y * b->width, b->width, 1, b->step,
                      b->lines + (ptrdiff_t)share * b->room);
}

static void txs_blur_columns(void *context, int share) {
    const txs_blurring *b = (const txs_blurring *)context;
    const int from = (int)((int64_t)b->width * share / TXS_TASKS);
    const int to = (int)((int64_t)b->width * (share + 1) / TXS_TASKS);
    for (int x = from; x < to; x++)
        txs_blur_line(b->plane + x, b->height, b->width, b->step,
                      b->lines + (ptrdiff_t)share * b->room);
}

static void txs_blur_plane(const txs_scene *s, int16_t *plane, int step, int16_t *lines, int room,
                     txm_env *env) {
    txs_blurring b = {plane, lines, s->width, s->height, step, room};
    TEXSYN_ASSERT(room >= s->width + 4 * step && room >= s->height + 4 * step);
    txm_parallel_for(env, TXS_TASKS, txs_blur_rows, &b);
    txm_parallel_for(env, TXS_TASKS, txs_blur_columns, &b);
}

/* Filter 0, 1: gradients, 2: Laplacian, by differences of pixels `step` apart. */
static int txs_answer(const txs_scene *s, const int16_t *plane, int filter, int step, int x,
                      int y) {
    const ptrdiff_t w = s->width;
    const int left = x < step ? 0 : x - step, right = x + step < s->width ? x + step : s->width - 1;
    const int up = y < step ? 0 : y - step, down = y + step < s->height ? y + step : s->height - 1;
    const int dx = plane[y * w + right] - plane[y * w + left];
    if (filter == 0) return dx;
    if (filter == 1) return plane[down * w + x] - plane[up * w + x];
    return plane[y * w + right] + plane[y * w + left] + plane[down * w + x] + plane[up * w + x] -
           4 * plane[y * w + x];
}

/* One filter over the scene: the magnitudes of its answers, smoothed, relative to their root mean
   square r: 127 a / sqrt(r^2 + a^2), which lets no contour drown the rest. */
static void txs_run_filter(const txs_scene *s, const int16_t *plane, int filter, int step,
                           int16_t *raw, int8_t *out, int16_t *lines, int room, txm_env *env) {
    enum { LEVELS = 256 }; /* of |a|, up to TXS_LOUD times r */
    int8_t level[LEVELS + 1];
    uint64_t square = 0, count = 0;
    for (int y = 0; y < s->height; y++) {
        for (int x = 0; x < s->width; x++) {
            const size_t i = (size_t)y * (size_t)s->width + (size_t)x;
            const int a = txs_answer(s, plane, filter, step, x, y);
            raw[i] = (int16_t)txm_clampi(abs(a), 0, INT16_MAX);
        }
    }
    txs_blur_plane(s, raw, step, lines, room, env);
    for (size_t i = 0; i < s->pixels; i++) {
        if (!s->counted[i]) continue;
        square += (uint64_t)((int64_t)raw[i] * raw[i]);
        count++;
    }
    const double least = (double)TXS_LAB / 4; /* weaker answers are noise of the 8-bit samples */
    double rms = sqrt((double)square / (double)(count ? count : 1));
    if (rms < least) rms = least;
    for (int i = 0; i <= LEVELS; i++) {
        const double v = (double)(i * TXS_LOUD) / (double)LEVELS;
        level[i] = (int8_t)((double)TXS_ANSWER * v / sqrt(1 + v * v) + 0.5);
    }
    const int scale = (int)((double)(LEVELS << 12) / ((double)TXS_LOUD * rms) + 0.5);
    for (size_t i = 0; i < s->pixels; i++) {
        const int64_t at = ((int64_t)raw[i] * scale + (1 << 11)) >> 12;
        out[i] = level[at < (int64_t)LEVELS ? at : (int64_t)LEVELS];
    }
}

/* ---- k-means ------------------------------------------------------------------------------ */

enum { TXS_MOST_CENTRES = 64, TXS_MOST_AXES = TXS_FILTERS };

/* Centres, axis by axis, whole numbers. The distance of x from centre c, up to |x|^2, is
   |c|^2 - 2 x.c: products and sums stay below 2^24, so float holds them exactly. */
typedef struct txs_clusters {
    int count, axes;
    float centre[TXS_MOST_AXES][TXS_MOST_CENTRES], square[TXS_MOST_CENTRES];
} txs_clusters;

static void txs_set_centre(txs_clusters *k, int c, const int *x) {
    float square = 0;
    for (int a = 0; a < k->axes; a++) {
        k->centre[a][c] = (float)x[a];
        square += (float)(x[a] * x[a]);
    }
    k->square[c] = square;
}

/* the nearest centre, the first of several */
static int txs_nearest(const txs_clusters *k, const int *x) {
    float d[TXS_MOST_CENTRES];
    int best = 0;
    for (int c = 0; c < TXS_MOST_CENTRES; c++) d[c] = k->square[c];
    for (int a = 0; a < k->axes; a++) {
        const float v = (float)(-2 * x[a]);
        const float *centre = k->centre[a];
        for (int c = 0; c < TXS_MOST_CENTRES; c++) d[c] += v * centre[c];
    }
    for (int c = 1; c < k->count; c++)
        if (d[c] < d[best]) best = c;
    return best;
}

static int64_t txs_distance2(const int *x, const int *y, int axes) {
    int64_t sum = 0;
    for (int a = 0; a < axes; a++) sum += (int64_t)(x[a] - y[a]) * (x[a] - y[a]);
    return sum;
}

/* First centres: each sample with a chance in proportion to its squared distance from the centres
   so far (k-means++), less `apart`: samples that are nearer to a centre are as good as it. */
static void txs_seed_centres(txs_clusters *k, const int *samples, int n, int64_t apart,
                             int64_t *far_, uint64_t seed) {
    txm_rng rng = txm_rng_make(seed, 7);
    const int axes = k->axes;
    int chosen = (int)txm_rng_below(&rng, (uint32_t)n);
    for (int i = 0; i < n; i++) far_[i] = INT64_MAX;
    for (int c = 0; c < k->count; c++) {
        int64_t sum = 0;
        txs_set_centre(k, c, samples + (ptrdiff_t)chosen * axes);
        for (int i = 0; i < n; i++) {
            const int64_t d = txs_distance2(samples + (ptrdiff_t)i * axes,
                                            samples + (ptrdiff_t)chosen * axes, axes);
            if (d - apart < far_[i]) far_[i] = d > apart ? d - apart : 0;
            sum += far_[i];
        }
        if (sum == 0) { /* no sample differs enough from all centres */
            k->count = c + 1;
            return;
        }
        uint64_t at = ((uint64_t)txm_rng_next(&rng) << 20) % (uint64_t)sum;
        for (chosen = 0; chosen + 1 < n && at >= (uint64_t)far_[chosen]; chosen++)
            at -= (uint64_t)far_[chosen];
    }
}

/* k-means over n samples of `axes` numbers each. */
static void txs_find_centres(txs_clusters *k, const int *samples, int n, int64_t apart,
                              int64_t *far_, uint64_t seed) {
    txs_seed_centres(k, samples, n, apart, far_, seed);
    for (int c = k->count; c < TXS_MOST_CENTRES; c++) k->square[c] = 0; /* computed, never chosen */
    for (int round = 0; round < TXS_ROUNDS; round++) {
        int64_t sum[TXS_MOST_CENTRES][TXS_MOST_AXES] = {{0}}, members[TXS_MOST_CENTRES] = {0};
        for (int i = 0; i < n; i++) {
            const int *x = samples + (ptrdiff_t)i * k->axes;
            const int c = txs_nearest(k, x);
            for (int a = 0; a < k->axes; a++) sum[c][a] += x[a];
            members[c]++;
        }
        for (int c = 0; c < k->count; c++) {
            int mean[TXS_MOST_AXES];
            if (!members[c]) continue;
            for (int a = 0; a < k->axes; a++) {
                const int64_t half = sum[c][a] < 0 ? -members[c] / 2 : members[c] / 2;
                mean[a] = (int)((sum[c][a] + half) / members[c]);
            }
            txs_set_centre(k, c, mean);
        }
    }
}

/* ---- the textons of a scene ---------------------------------------------------------------- */

typedef struct txs_features {
    const txs_scene *scene;
    int16_t *smooth[3];            /* lab, blurred once */
    int8_t *answers[TXS_FILTERS];
    txs_clusters colours, shapes;
} txs_features;

/* (L, 1.5 a, 1.5 b) in steps of a quarter */
static void txs_colour_features(const txs_features *f, size_t i, int *x) {
    x[0] = f->smooth[0][i] / (TXS_LAB / 4);
    for (int c = 1; c < 3; c++) x[c] = f->smooth[c][i] * 3 / (TXS_LAB / 2);
}

static void txs_shape_features(const txs_features *f, size_t i, int *x) {
    for (int a = 0; a < TXS_FILTERS; a++) x[a] = 0 + f->answers[a][i];
}

static void txs_name_textons(void *context, int share) {
    const txs_features *f = (const txs_features *)context;
    const txs_scene *s = f->scene;
    const size_t from = s->pixels * (size_t)share / TXS_TASKS;
    const size_t to = s->pixels * ((size_t)share + 1) / TXS_TASKS;
    for (size_t i = from; i < to; i++) {
        int x[TXS_MOST_AXES];
        if (!s->counted[i]) continue;
        txs_colour_features(f, i, x);
        s->colour[i] = (uint8_t)txs_nearest(&f->colours, x);
        txs_shape_features(f, i, x);
        s->shape[i] = (uint8_t)txs_nearest(&f->shapes, x);
    }
}

/* Make both vocabularies from a sample of the counted pixels, evenly spread over them. */
static void txs_find_textons(txs_features *f, int *samples, int64_t *far_, uint64_t seed) {
    const txs_scene *s = f->scene;
    size_t counted = 0;
    for (size_t i = 0; i < s->pixels; i++) counted += s->counted[i];
    const size_t step = counted / TXS_TRAINING + 1;
    for (int pass = 0; pass < 2; pass++) {
        txs_clusters *k = pass ? &f->shapes : &f->colours;
        k->count = pass ? TXS_GRAINS : TXS_COLOURS;
        k->axes = pass ? TXS_FILTERS : 3;
        size_t seen = 0, next = step / 2;
        int n = 0;
        for (size_t i = 0; i < s->pixels; i++) {
            if (!s->counted[i] || seen++ != next) continue;
            TEXSYN_ASSERT(n < TXS_TRAINING);
            if (pass) txs_shape_features(f, i, samples + n * k->axes);
            else txs_colour_features(f, i, samples + n * k->axes);
            n++;
            next = (size_t)n * step + (size_t)(txm_hash((uint64_t)n) % step);
        }
        TEXSYN_ASSERT(n > 0);
        const int64_t apart = pass ? 0 : TXS_APART * TXS_APART;
        txs_find_centres(k, samples, n, apart, far_, seed + (uint64_t)pass);
    }
}

/* ---- regions ------------------------------------------------------------------------------

   The scene is divided into blocks; each is described by the histograms of the textons around it.
   Neighbouring blocks are joined, the most similar first, until a few dozen regions are left; these
   are then partitioned into cliques of mutually similar ones, wherever they lie [7]. A
   clique is a texture. */

enum {
    TXS_BINS_OF_BLOCK = TXS_COLOURS + TXS_GRAINS,
    TXS_BLOCK_TOTAL = 4096,    /* sum of either half of a normalised histogram                  */
    TXS_FAR = 1 << 16,         /* distance of histograms that have nothing in common            */
    TXS_BLOCK = 8,             /* pixels a side                                                 */
    TXS_SMALLEST_BLOCK = 2,    /* of small pictures, that have at least                         */
    TXS_BLOCKS_ACROSS = 16,    /* on their shorter side                                         */
    TXS_MOST_BLOCKS = 9216,    /* memory grows with their square                                */
    TXS_PIECES = 24,   /* regions that are partitioned                                  */
    TXS_LOG_UNIT = 256         /* of the table of n log2 n                                      */
};

typedef struct txs_blocks {
    int size, width, height, count; /* size: pixels a side                                       */
    uint16_t (*sums)[TXS_BINS_OF_BLOCK];   /* textons counted in each block                      */
    uint16_t (*wide)[TXS_BINS_OF_BLOCK];   /* of a block and what is around it, normalised       */
    uint16_t (*clear)[TXS_BINS_OF_BLOCK];  /* the same without mixtures at boundaries            */
    int *weight;                           /* counted pixels of each block                       */
    int32_t *log_table;                    /* n log2 n for n up to 2 TXS_BLOCK_TOTAL             */
} txs_blocks;

#define TXS_LN2 0.69314718055994530942

static void txs_log_table(int32_t *table) {
    table[0] = 0;
    for (int n = 1; n <= 2 * TXS_BLOCK_TOTAL; n++)
        table[n] = (int32_t)((double)(n * TXS_LOG_UNIT) * txm_log2((double)n) + 0.5);
}

/* The Jensen-Shannon divergence of bins from..to, 0..TXS_FAR. */
static int txs_divergence(const int32_t *table, const uint16_t *p, const uint16_t *q, int from,
                          int to) {
    int32_t sum = 0;
    for (int i = from; i < to; i++) sum += table[p[i]] + table[q[i]] - table[p[i] + q[i]];
    const int64_t whole = 2 * (int64_t)TXS_BLOCK_TOTAL * TXS_LOG_UNIT;
    const int64_t d = (whole + sum) * TXS_FAR / whole;
    return (int)(d < 0 ? 0 : d);
}

/* the mean of those of colour and of texture */
static int txs_unlike(const int32_t *table, const uint16_t *p, const uint16_t *q) {
    return (txs_divergence(table, p, q, 0, TXS_COLOURS) +
            txs_divergence(table, p, q, TXS_COLOURS, TXS_BINS_OF_BLOCK)) /
           2;
}

/* counts, each half to the sum TXS_BLOCK_TOTAL (but for rounding) */
static void txs_normalise_bins(const uint64_t *counts, uint16_t *out) {
    for (int half = 0; half < 2; half++) {
        const int from = half ? (int)TXS_COLOURS : 0;
        const int to = half ? (int)TXS_BINS_OF_BLOCK : (int)TXS_COLOURS;
        uint64_t total = 0;
        for (int i = from; i < to; i++) total += counts[i];
        if (!total) total = 1;
        for (int i = from; i < to; i++)
            out[i] = (uint16_t)((counts[i] * TXS_BLOCK_TOTAL + total / 2) / total);
    }
}

/* ---- blocks ------------------------------------------------------------------------------- */

static void txs_count_blocks(const txs_scene *s, txs_blocks *b) {
    for (int y = 0; y < s->height; y++) {
        for (int x = 0; x < s->width; x++) {
            const size_t i = (size_t)y * (size_t)s->width + (size_t)x;
            const int k = y / b->size * b->width + x / b->size;
            if (!s->counted[i]) continue;
            TEXSYN_ASSERT(k < b->count);
            b->sums[k][s->colour[i]]++;
            b->sums[k][TXS_COLOURS + s->shape[i]]++;
            b->weight[k]++;
        }
    }
}

/* The histogram of a block with its neighbours, which weigh the less the farther they are. */
static void txs_widen(txs_blocks *b, int x, int y) {
    static const int taps[5] = {2, 4, 5, 4, 2};
    uint64_t sum[TXS_BINS_OF_BLOCK] = {0};
    for (int v = -2; v <= 2; v++) {
        for (int u = -2; u <= 2; u++) {
            if (x + u < 0 || x + u >= b->width || y + v < 0 || y + v >= b->height) continue;
            const uint16_t *from = b->sums[(y + v) * b->width + x + u];
            const uint32_t weight = (uint32_t)(taps[u + 2] * taps[v + 2]);
            for (int i = 0; i < TXS_BINS_OF_BLOCK; i++) sum[i] += weight * from[i];
        }
    }
    txs_normalise_bins(sum, b->wide[y * b->width + x]);
}

/* How much a block differs from those two blocks away. */
static int txs_local_spread(const txs_blocks *b, int x, int y) {
    static const int way[4][2] = {{-2, 0}, {2, 0}, {0, -2}, {0, 2}};
    int64_t sum = 0, n = 0;
    for (int k = 0; k < 4; k++) {
        const int u = x + way[k][0], v = y + way[k][1];
        if (u < 0 || u >= b->width || v < 0 || v >= b->height || !b->weight[v * b->width + u])
            continue;
        sum += txs_unlike(b->log_table, b->wide[y * b->width + x], b->wide[v * b->width + u]);
        n++;
    }
    return n ? (int)(sum / n) : 0;
}

/* At a boundary a block mixes two textures. So each takes the histogram of the least mixed one near
   it (Kuwahara's filter). spread: room for a number a block. */
static void txs_clear_mixtures(txs_blocks *b, int *spread) {
    for (int y = 0; y < b->height; y++)
        for (int x = 0; x < b->width; x++)
            spread[y * b->width + x] = txs_local_spread(b, x, y);
    for (int y = 0; y < b->height; y++) {
        for (int x = 0; x < b->width; x++) {
            int best = y * b->width + x;
            if (!b->weight[best]) continue;
            for (int v = txm_clampi(y - 2, 0, y); v <= y + 2 && v < b->height; v++) {
                for (int u = txm_clampi(x - 2, 0, x); u <= x + 2 && u < b->width; u++) {
                    const int k = v * b->width + u;
                    if (b->weight[k] && spread[k] < spread[best]) best = k;
                }
            }
            memcpy(b->clear[y * b->width + x], b->wide[best], sizeof b->wide[best]);
        }
    }
}

/* ---- joining neighbours ---------------------------------------------------------------------- */

typedef struct txs_region_set {
    const txs_blocks *blocks;
    int *of;             /* the region of each block, named by one of its blocks; -1: not counted */
    uint64_t (*sum)[TXS_BINS_OF_BLOCK];    /* of the histograms of its blocks, by area */
    uint16_t (*mean)[TXS_BINS_OF_BLOCK];   /* the same, normalised */
    int64_t *area;       /* counted pixels; 0: no region of this name */
    uint64_t *touches;   /* a row of bits for each region: its neighbours */
    int words;           /* of such a row */
    int *partner;        /* the neighbour that is joined most cheaply; -1: none */
    int64_t *cost;       /* of that */
    int count;
} txs_region_set;

static void txs_set_touch(txs_region_set *r, int a, int b, int value) {
    uint64_t *word = &r->touches[(size_t)a * (size_t)r->words + (size_t)(b >> 6)];
    const uint64_t bit = (uint64_t)1 << (b & 63);
    *word = value ? *word | bit : *word & ~bit;
}

/* Ward's: what joining two regions adds to the unlikeness within regions. */
static int64_t txs_join_cost(const txs_region_set *r, int a, int b) {
    const int64_t d = txs_unlike(r->blocks->log_table, r->mean[a], r->mean[b]);
    const int64_t both = r->area[a] + r->area[b];
    return both ? d * (r->area[a] * r->area[b] / both) : 0;
}

/* the next neighbour of a region after `after`, or -1 */
static int txs_next_touch(const txs_region_set *r, int a, int after) {
    const uint64_t *row = r->touches + (size_t)a * (size_t)r->words;
    for (int b = after + 1; b < r->blocks->count; b++) {
        if (!row[b >> 6]) b |= 63;
        else if (row[b >> 6] >> (b & 63) & 1) return b;
    }
    return -1;
}

static void txs_find_partner(txs_region_set *r, int a) {
    r->partner[a] = -1;
    for (int b = txs_next_touch(r, a, -1); b >= 0; b = txs_next_touch(r, a, b)) {
        const int64_t cost = txs_join_cost(r, a, b);
        if (r->partner[a] >= 0 && cost >= r->cost[a]) continue;
        r->partner[a] = b;
        r->cost[a] = cost;
    }
}

static void txs_join_two(txs_region_set *r, int a, int b) {
    r->area[a] += r->area[b];
    r->area[b] = 0;
    for (int i = 0; i < TXS_BINS_OF_BLOCK; i++) r->sum[a][i] += r->sum[b][i];
    txs_normalise_bins(r->sum[a], r->mean[a]);
    for (int c = txs_next_touch(r, b, -1); c >= 0; c = txs_next_touch(r, b, c)) {
        txs_set_touch(r, c, b, 0);
        if (c == a) continue;
        txs_set_touch(r, c, a, 1);
        txs_set_touch(r, a, c, 1);
    }
    r->partner[b] = -1;
    for (int k = 0; k < r->blocks->count; k++)
        if (r->of[k] == b) r->of[k] = a;
    r->count--;
    txs_find_partner(r, a);
    for (int c = txs_next_touch(r, a, -1); c >= 0; c = txs_next_touch(r, a, c)) {
        if (r->partner[c] == a || r->partner[c] == b) {
            txs_find_partner(r, c);
            continue;
        }
        const int64_t cost = txs_join_cost(r, c, a);
        if (cost < r->cost[c]) {
            r->partner[c] = a;
            r->cost[c] = cost;
        }
    }
}

/* Every counted block a region of its own. It touches the counted block before it in its row and
   in its column, also across what is not counted. */
static void txs_first_regions(txs_region_set *r) {
    const txs_blocks *b = r->blocks;
    r->count = 0;
    for (int k = 0; k < b->count; k++) {
        const int x = k % b->width;
        r->of[k] = b->weight[k] ? k : -1;
        r->area[k] = b->weight[k];
        if (!b->weight[k]) continue;
        r->count++;
        memcpy(r->mean[k], b->clear[k], sizeof r->mean[k]);
        for (int i = 0; i < TXS_BINS_OF_BLOCK; i++)
            r->sum[k][i] = (uint64_t)b->clear[k][i] * (uint64_t)b->weight[k];
        int left = k - 1, up = k - b->width;
        while (left >= k - x && !b->weight[left]) left--;
        while (up >= 0 && !b->weight[up]) up -= b->width;
        const int before[2] = {left >= k - x ? left : -1, up};
        for (int i = 0; i < 2; i++) {
            if (before[i] < 0) continue;
            txs_set_touch(r, k, before[i], 1);
            txs_set_touch(r, before[i], k, 1);
        }
    }
    for (int k = 0; k < b->count; k++) txs_find_partner(r, k);
}

/* Join the most similar neighbours until `most` regions are left, or none touch. */
static void txs_join_neighbours(txs_region_set *r, int most) {
    while (r->count > most) {
        int best = -1;
        for (int k = 0; k < r->blocks->count; k++)
            if (r->partner[k] >= 0 && (best < 0 || r->cost[k] < r->cost[best])) best = k;
        if (best < 0) return;
        const int other = r->partner[best];
        txs_join_two(r, best < other ? best : other, best < other ? other : best);
    }
}

/* ---- partition into cliques --------------------------------------------------------------- */

/* How unlike textures must be, for thick groups and for thin ones. */
typedef struct txs_standard {
    double thick, least_thick; /* the cut for groups of that thickness or more, in blocks */
    double thin, most_thin;    /* and for those of at most that                           */
} txs_standard;

/* Ours, see docs/choices.md: the strict one, and a finer one for what looks like one texture. */
static const txs_standard txs_strict = {0.39, 5, 0.5, 1.8};
static const txs_standard txs_fine = {0.31, 3, 0.5, 1.8};

typedef struct txs_partition {
    int count;         /* groups; 0..count-1, each of one region or more                      */
    int regions;       /* the matrices have as many rows and columns                          */
    int *unlike;       /* mean distance of two groups, by area                                */
    int *border;       /* length of their common boundary in sides of blocks                  */
    int64_t *area;     /* pixels                                                              */
    int *group;        /* of each region                                                      */
    int block;         /* pixels of a block                                                   */
} txs_partition;

static int *txs_unlike_at(const txs_partition *p, int a, int b) {
    return &p->unlike[(size_t)a * (size_t)p->regions + (size_t)b];
}

static int *txs_border_at(const txs_partition *p, int a, int b) {
    return &p->border[(size_t)a * (size_t)p->regions + (size_t)b];
}

/* Row and column `from` of both matrices to `to`. */
static void txs_move_group(txs_partition *p, int to, int from) {
    p->area[to] = p->area[from];
    for (int k = 0; k < p->regions; k++)
        if (p->group[k] == from) p->group[k] = to;
    for (int c = 0; c < p->regions; c++) {
        *txs_unlike_at(p, to, c) = *txs_unlike_at(p, from, c);
        *txs_border_at(p, to, c) = *txs_border_at(p, from, c);
    }
    for (int c = 0; c < p->regions; c++) {
        *txs_unlike_at(p, c, to) = *txs_unlike_at(p, c, from);
        *txs_border_at(p, c, to) = *txs_border_at(p, c, from);
    }
}

/* Group b becomes part of group a; the last group takes the number of b. */
static void txs_unite_groups(txs_partition *p, int a, int b) {
    const int64_t whole = p->area[a] + p->area[b];
    for (int c = 0; c < p->count; c++) {
        const int64_t sum =
            p->area[a] * *txs_unlike_at(p, a, c) + p->area[b] * *txs_unlike_at(p, b, c);
        const int border = *txs_border_at(p, a, c) + *txs_border_at(p, b, c);
        *txs_unlike_at(p, a, c) = *txs_unlike_at(p, c, a) = (int)(sum / whole);
        *txs_border_at(p, a, c) = *txs_border_at(p, c, a) = border;
    }
    *txs_border_at(p, a, a) = 0;
    p->area[a] = whole;
    for (int k = 0; k < p->regions; k++)
        if (p->group[k] == b) p->group[k] = a;
    if (b != --p->count) txs_move_group(p, b, p->count);
}

/* Area per boundary, in blocks: half the width of a strip, a quarter of a square's side. */
static double txs_thickness(const txs_partition *p, int a) {
    int64_t border = 0;
    for (int c = 0; c < p->count; c++) border += c == a ? 0 : *txs_border_at(p, a, c);
    return (double)p->area[a] / (double)(p->block * p->block) / (double)(border ? border : 1);
}

/* How unlike two groups must be to count as two textures. Thin ones are more often parts of one
   texture, such as bricks and mortar. */
static int txs_group_cut(const txs_partition *p, const txs_standard *z, int a, int b) {
    const double s = txs_thickness(p, a), t = txs_thickness(p, b), thinner = s < t ? s : t;
    double share = (z->least_thick - thinner) / (z->least_thick - z->most_thin);
    share = share < 0 ? 0 : share > 1 ? 1 : share;
    return (int)((z->thick + (z->thin - z->thick) * share) * (double)TXS_FAR);
}

/* The pair of groups a < b that is most likely one texture; returns by how much their distance
   exceeds what it may be, INT_MAX if there is but one group. */
static int txs_most_similar(const txs_partition *p, const txs_standard *z, int pair[2]) {
    int best = INT_MAX;
    for (int a = 0; a < p->count; a++) {
        for (int b = a + 1; b < p->count; b++) {
            const int excess = *txs_unlike_at(p, a, b) - txs_group_cut(p, z, a, b);
            if (excess >= best) continue;
            best = excess;
            pair[0] = a;
            pair[1] = b;
        }
    }
    return best;
}

/* Unite the most similar groups while they may be one texture or more than `most` are left, but
   never to fewer than `least`. */
static void txs_find_cliques(txs_partition *p, const txs_standard *z, int least, int most) {
    int pair[2] = {0, 0};
    while (p->count > least) {
        const int excess = txs_most_similar(p, z, pair);
        if (excess >= 0 && p->count <= most) return;
        txs_unite_groups(p, pair[0], pair[1]);
    }
}

/* A strip along a boundary is a mixture of what lies beside it, and the filters see both sides:
   it looks like a texture of its own, but is thinner than this, in blocks. */
#define TXS_THINNEST 1.25

/* The smallest group that is smaller than `least_area` or too thin for a texture, or -1. */
static int txs_least_group(const txs_partition *p, int64_t least_area) {
    int least = -1;
    for (int c = 0; c < p->count; c++) {
        if (p->area[c] >= least_area && txs_thickness(p, c) >= TXS_THINNEST) continue;
        if (least < 0 || p->area[c] < p->area[least]) least = c;
    }
    return least;
}

/* Groups that are too small or too thin join the most similar other one, the smallest first. */
static void txs_join_least(txs_partition *p, int64_t least_area) {
    while (p->count > 1) {
        const int a = txs_least_group(p, least_area);
        int best = -1;
        if (a < 0) return;
        for (int c = 0; c < p->count; c++) {
            if (c == a) continue;
            if (best < 0 || *txs_unlike_at(p, a, c) < *txs_unlike_at(p, a, best)) best = c;
        }
        txs_unite_groups(p, a < best ? a : best, a < best ? best : a);
    }
}

/* ---- labels -------------------------------------------------------------------------------

   Boundaries to the pixel: each pixel takes the label under which the textons around it are
   likely and which its neighbours have. */

enum {
    TXS_MOST_LABELS = TEXSYN_MAX_SEGMENTS,
    TXS_REFINEMENTS = 3,
    TXS_SWEEPS = 4,          /* in each refinement                                       */
    TXS_REACH = 6,          /* pixels: reach of the window in which neighbours count    */
    TXS_PATIENCE = 96,       /* costs as much as if no pixel of it had the label         */
    TXS_FINER = 16,          /* steps per step of a cost when both are added             */
    TXS_COST_UNIT = 64,      /* steps of a cost per nat                                  */
    TXS_SPECK = 2048,        /* a smaller part of the picture is a speck                 */
    TXS_UNSEEN_SHARE = 2000  /* of a label's pixels: as if more had each texton          */
};

typedef struct txs_refiner {
    const txs_scene *scene;
    uint8_t *label;             /* of each pixel                                          */
    int count, reach;
    int32_t *colour_cost, *shape_cost; /* of each texton under each label                 */
    int16_t *cost;              /* planes, one a label: mean around each pixel            */
    uint8_t *share;             /* the same: pixels of the label around each pixel        */
    int32_t *work;              /* a line of sums for each label                          */
    uint16_t *counted_around;   /* counted pixels within reach                            */
} txs_refiner;

/* Sums over a window of 2 reach + 1 pixels a side, clipped at the border. */
typedef struct txs_window_sums {
    int width, height, reach;
    int32_t *columns; /* width sums over the rows of the window */
} txs_window_sums;

static void txs_window_row(const txs_window_sums *b, int32_t *out) {
    int32_t sum = 0;
    for (int x = 0; x < b->reach && x < b->width; x++) sum += b->columns[x];
    for (int x = 0; x < b->width; x++) {
        if (x + b->reach < b->width) sum += b->columns[x + b->reach];
        out[x] = sum;
        if (x >= b->reach) sum -= b->columns[x - b->reach];
    }
}

/* -log p of the textons of each label, in TXS_COST_UNIT */
static void txs_texton_costs(txs_refiner *r) {
    const txs_scene *s = r->scene;
    memset(r->colour_cost, 0, sizeof(int32_t) * (size_t)r->count * TXS_COLOURS);
    memset(r->shape_cost, 0, sizeof(int32_t) * (size_t)r->count * TXS_GRAINS);
    for (size_t i = 0; i < s->pixels; i++) {
        if (!s->counted[i]) continue;
        r->colour_cost[r->label[i] * TXS_COLOURS + s->colour[i]]++;
        r->shape_cost[r->label[i] * TXS_GRAINS + s->shape[i]]++;
    }
    for (int k = 0; k < 2 * r->count; k++) {
        const int bins = k & 1 ? TXS_GRAINS : TXS_COLOURS;
        int32_t *bin = k & 1 ? r->shape_cost + (k >> 1) * bins : r->colour_cost + (k >> 1) * bins;
        double total = 0;
        for (int i = 0; i < bins; i++) total += bin[i];
        /* as if each texton had been seen a little more often than it was */
        const double more = total / (double)TXS_UNSEEN_SHARE + 1;
        for (int i = 0; i < bins; i++) {
            const double p = (total + more * bins) / ((double)bin[i] + more);
            bin[i] = (int32_t)(txm_log2(p) * TXS_LN2 * (double)TXS_COST_UNIT + 0.5);
        }
    }
}

static void txs_add_costs(const txs_refiner *r, int label, int y, int sign, int32_t *columns) {
    const txs_scene *s = r->scene;
    const size_t at = (size_t)y * (size_t)s->width;
    const int32_t *colour = r->colour_cost + label * TXS_COLOURS;
    const int32_t *shape = r->shape_cost + label * TXS_GRAINS;
    for (int x = 0; x < s->width; x++) {
        const size_t i = at + (size_t)x;
        if (s->counted[i]) columns[x] += sign * (colour[s->colour[i]] + shape[s->shape[i]]);
    }
}

/* The mean cost of a label around each pixel. */
static void txs_average_costs(void *context, int label) {
    const txs_refiner *r = (const txs_refiner *)context;
    const txs_scene *s = r->scene;
    const size_t line = 2 * (size_t)s->width;
    int32_t *columns = r->work + (size_t)label * line, *out = columns + s->width;
    const txs_window_sums box = {s->width, s->height, r->reach, columns};
    memset(columns, 0, sizeof *columns * (size_t)s->width);
    for (int y = 0; y < r->reach && y < s->height; y++) txs_add_costs(r, label, y, 1, columns);
    for (int y = 0; y < s->height; y++) {
        if (y + r->reach < s->height) txs_add_costs(r, label, y + r->reach, 1, columns);
        txs_window_row(&box, out);
        if (y >= r->reach) txs_add_costs(r, label, y - r->reach, -1, columns);
        int16_t *to = r->cost + (size_t)label * s->pixels + (size_t)y * (size_t)s->width;
        const uint16_t *n = r->counted_around + (size_t)y * (size_t)s->width;
        for (int x = 0; x < s->width; x++) to[x] = (int16_t)(n[x] ? out[x] / n[x] : 0);
    }
}

static void txs_count_around(const txs_refiner *r) {
    const txs_scene *s = r->scene;
    int32_t *columns = r->work, *out = columns + s->width;
    const txs_window_sums box = {s->width, s->height, r->reach, columns};
    memset(columns, 0, sizeof *columns * (size_t)s->width);
    for (int y = -r->reach; y < s->height; y++) {
        if (y + r->reach < s->height)
            for (int x = 0; x < s->width; x++)
                columns[x] += s->counted[(size_t)(y + r->reach) * (size_t)s->width + (size_t)x];
        if (y < 0) continue;
        txs_window_row(&box, out);
        for (int x = 0; x < s->width; x++) {
            r->counted_around[(size_t)y * (size_t)s->width + (size_t)x] = (uint16_t)out[x];
            if (y >= r->reach)
                columns[x] -= s->counted[(size_t)(y - r->reach) * (size_t)s->width + (size_t)x];
        }
    }
}

static void txs_add_label(const txs_refiner *r, int label, int y, int sign, int32_t *columns) {
    const txs_scene *s = r->scene;
    const uint8_t *row = r->label + (size_t)y * (size_t)s->width;
    const uint8_t *counted = s->counted + (size_t)y * (size_t)s->width;
    for (int x = 0; x < s->width; x++) columns[x] += sign * ((row[x] == label) & counted[x]);
}

/* How many pixels around each have the label. */
static void txs_share_label(void *context, int label) {
    const txs_refiner *r = (const txs_refiner *)context;
    const txs_scene *s = r->scene;
    const size_t line = 2 * (size_t)s->width;
    int32_t *columns = r->work + (size_t)label * line, *out = columns + s->width;
    const txs_window_sums box = {s->width, s->height, TXS_REACH, columns};
    memset(columns, 0, sizeof *columns * (size_t)s->width);
    for (int y = 0; y < TXS_REACH && y < s->height; y++) txs_add_label(r, label, y, 1, columns);
    for (int y = 0; y < s->height; y++) {
        if (y + TXS_REACH < s->height) txs_add_label(r, label, y + TXS_REACH, 1, columns);
        txs_window_row(&box, out);
        if (y >= TXS_REACH) txs_add_label(r, label, y - TXS_REACH, -1, columns);
        uint8_t *to = r->share + (size_t)label * s->pixels + (size_t)y * (size_t)s->width;
        for (int x = 0; x < s->width; x++) to[x] = (uint8_t)out[x];
    }
}

static void txs_choose_labels(void *context, int share) {
    const txs_refiner *r = (const txs_refiner *)context;
    const txs_scene *s = r->scene;
    const int window = (2 * TXS_REACH + 1) * (2 * TXS_REACH + 1);
    const int gain = (TXS_PATIENCE * TXS_FINER + window / 2) / window;
    const size_t from = s->pixels * (size_t)share / TXS_TASKS;
    const size_t to = s->pixels * ((size_t)share + 1) / TXS_TASKS;
    for (size_t i = from; i < to; i++) {
        int best = 0, least = INT_MAX;
        for (int k = 0; k < r->count; k++) {
            const size_t at = (size_t)k * s->pixels + i;
            const int cost = TXS_FINER * r->cost[at] - gain * r->share[at];
            if (cost >= least) continue;
            least = cost;
            best = k;
        }
        r->label[i] = (uint8_t)best;
    }
}

static const int txs_reaches[TXS_REFINEMENTS] = {12, 8, 5};

static txm_status txs_refine_labels(txs_refiner *r, txm_env *env, float from, float to) {
    for (int i = 0; i < TXS_REFINEMENTS; i++) {
        r->reach = txs_reaches[i];
        txs_texton_costs(r);
        txs_count_around(r);
        txm_parallel_for(env, r->count, txs_average_costs, r);
        for (int k = 0; k < TXS_SWEEPS; k++) {
            txm_parallel_for(env, r->count, txs_share_label, r);
            txm_parallel_for(env, TXS_TASKS, txs_choose_labels, r);
        }
        const float done = (float)(i + 1) / (float)TXS_REFINEMENTS;
        if (txm_progress(env, from + (to - from) * done, "refine"))
            return txm_fail(env, TXM_CANCELLED, "cancelled");
    }
    return TXM_OK;
}

/* ---- specks and thin parts ----------------------------------------------------------------- */

typedef struct txs_cleaner {
    int width, height;
    uint8_t *label;
    uint8_t *seen;
    uint32_t *part;    /* pixels of the connected part that is looked at */
} txs_cleaner;

/* The connected part at pixel i; its size. */
static size_t txs_find_part(const txs_cleaner *c, size_t i) {
    const size_t w = (size_t)c->width, pixels = w * (size_t)c->height;
    size_t count = 0;
    c->part[count++] = (uint32_t)i;
    c->seen[i] = 1;
    for (size_t k = 0; k < count; k++) {
        const size_t at = c->part[k], x = at % w;
        const size_t beside[4] = {x ? at - 1 : at, x + 1 < w ? at + 1 : at, at >= w ? at - w : at,
                                  at + w < pixels ? at + w : at};
        for (int n = 0; n < 4; n++) {
            if (c->seen[beside[n]] || c->label[beside[n]] != c->label[i]) continue;
            TEXSYN_ASSERT(count < pixels);
            c->seen[beside[n]] = 1;
            c->part[count++] = (uint32_t)beside[n];
        }
    }
    return count;
}

/* The label that most pixels beside the part have; its own if there are none. */
static int txs_label_around(const txs_cleaner *c, size_t count) {
    const size_t w = (size_t)c->width, pixels = w * (size_t)c->height;
    const int own = c->label[c->part[0]];
    size_t votes[256] = {0};
    int best = own;
    for (size_t k = 0; k < count; k++) {
        const size_t at = c->part[k], x = at % w;
        votes[c->label[x ? at - 1 : at]]++;
        votes[c->label[x + 1 < w ? at + 1 : at]]++;
        votes[c->label[at >= w ? at - w : at]]++;
        votes[c->label[at + w < pixels ? at + w : at]]++;
    }
    votes[own] = 0;
    for (int l = 0; l < 256; l++)
        if (votes[l] > votes[best]) best = l;
    return best;
}

/* Parts of fewer than `least` pixels take the label around them, or `transition` if that is not
   negative; but the largest part of each label stays. */
static void txs_clean_labels(const txs_cleaner *c, size_t least, int transition) {
    const size_t pixels = (size_t)c->width * (size_t)c->height;
    size_t largest[256] = {0}, keep[256] = {0};
    memset(c->seen, 0, pixels);
    for (size_t i = 0; i < pixels; i++) {
        if (c->seen[i]) continue;
        const size_t count = txs_find_part(c, i);
        if (count <= largest[c->label[i]]) continue;
        largest[c->label[i]] = count;
        keep[c->label[i]] = i;
    }
    memset(c->seen, 0, pixels);
    for (size_t i = 0; i < pixels; i++) {
        if (c->seen[i]) continue;
        const size_t count = txs_find_part(c, i);
        if (count >= least || keep[c->label[i]] == i) continue;
        const int label = transition >= 0 ? transition : txs_label_around(c, count);
        for (size_t k = 0; k < count; k++) c->label[c->part[k]] = (uint8_t)label;
    }
}

/* With a transition class: what no square of 2 TXS_REACH + 1 pixels of its label covers becomes a
   transition, unless nothing would be left of the label. share: a plane. */
static void txs_mark_thin(txs_refiner *r, int label, uint8_t transition) {
    const txs_scene *s = r->scene;
    size_t left = 0;
    r->reach = TXS_REACH;
    txs_share_label(r, label);
    uint8_t *share = r->share + (size_t)label * s->pixels;
    for (size_t i = 0; i < s->pixels; i++)
        share[i] = (uint8_t)(s->counted[i] && share[i] == r->counted_around[i]);
    /* the squares' centres, widened to the squares: in columns, then in rows */
    for (int pass = 0; pass < 2; pass++) {
        const int lines = pass ? s->height : s->width, length = pass ? s->width : s->height;
        const size_t by = pass ? 1 : (size_t)s->width, next = pass ? (size_t)s->width : 1;
        for (int k = 0; k < lines; k++) {
            uint8_t *line = share + (size_t)k * next;
            int last = -1;
            for (int i = 0; i < length; i++) {
                if (line[(size_t)i * by] & 1) last = i;
                if (last >= 0 && i - last <= TXS_REACH) line[(size_t)i * by] |= 2;
            }
            last = -1;
            for (int i = length - 1; i >= 0; i--) {
                if (line[(size_t)i * by] & 1) last = i;
                if (last >= 0 && last - i <= TXS_REACH) line[(size_t)i * by] |= 2;
            }
            for (int i = 0; i < length; i++) line[(size_t)i * by] >>= 1;
        }
    }
    for (size_t i = 0; i < s->pixels; i++) left += r->label[i] == label && share[i];
    for (size_t i = 0; i < s->pixels && left; i++)
        if (r->label[i] == label && !share[i]) r->label[i] = transition;
}

/* ---- labels of the picture ------------------------------------------------------------------ */

/* The label at a pixel of the picture: a vote of the nine pixels of the scene around it, with the
   weights of a quadratic spline, which makes smooth boundaries of steps. */
static uint8_t txs_vote(const txs_scene *s, const uint8_t *label, int x, int y) {
    const int f = s->factor, at[2] = {x / f, y / f};
    const int off[2] = {2 * (x % f) + 1 - f, 2 * (y % f) + 1 - f}; /* of 2 f */
    uint8_t found[9];
    int64_t weight[9];
    int best = 0, same = 1;
    for (int k = 0; k < 9; k++) {
        const int u = txm_clampi(at[0] + k % 3 - 1, 0, s->width - 1);
        const int v = txm_clampi(at[1] + k / 3 - 1, 0, s->height - 1);
        int64_t w = 1;
        for (int c = 0; c < 2; c++) {
            const int64_t side = (c ? k / 3 : k % 3) - 1, a = off[c];
            w *= side ? (f + side * a) * (f + side * a) : 6 * (int64_t)f * f - 2 * a * a;
        }
        found[k] = label[(size_t)v * (size_t)s->width + (size_t)u];
        weight[k] = w;
        same &= found[k] == found[0];
    }
    if (same) return found[0];
    for (int k = 0; k < 9; k++) {
        for (int j = 0; j < k; j++) {
            if (found[j] != found[k]) continue;
            weight[j] += weight[k]; /* the first of a label counts for all */
            weight[k] = 0;
            break;
        }
    }
    for (int k = 1; k < 9; k++)
        if (weight[k] > weight[best] || (weight[k] == weight[best] && found[k] < found[best]))
            best = k;
    return found[best];
}

/* ---- segmentation -------------------------------------------------------------------------

   See the picture, name its textons, find regions, decide which of them are one texture, draw the
   boundaries. */

enum {
    TXS_SMALL = 50,         /* a texture covers at least such a part of the picture    */
    TXS_LEAST_COUNTED = 256 /* pixels that must take part                              */
};

/* progress at the end of each stage, by the time it takes */
#define TXS_AT_TEXTONS 0.1f
#define TXS_AT_REGIONS 0.5f
#define TXS_AT_LABELS 0.65f
#define TXS_AT_END 0.95f

typedef struct txs_segmenter {
    const texsyn_segment_desc *desc;
    txm_env *env;
    txm_arena arena;
    txs_scene scene;
    txs_blocks blocks;
    txs_region_set regions;
    txs_partition partition;
    txs_refiner refiner;
    uint32_t *nearest; /* of each pixel of the scene the counted one nearest to it */
    uint8_t *mask;     /* of each pixel of the picture; NULL: all take part         */
} txs_segmenter;

/* Steps to the nearest counted pixel, by two passes; its index for each pixel. */
static void txs_find_nearest(const txs_scene *s, uint32_t *nearest, uint16_t *steps) {
    static const int before[4][2] = {{-1, 0}, {0, -1}, {-1, -1}, {1, -1}};
    const ptrdiff_t w = s->width;
    for (size_t i = 0; i < s->pixels; i++) {
        nearest[i] = (uint32_t)i;
        steps[i] = s->counted[i] ? 0 : UINT16_MAX;
    }
    for (int pass = 0; pass < 4; pass++) { /* the second pair for what lies in a shadow */
        const int sign = pass & 1 ? -1 : 1;
        for (size_t n = 0; n < s->pixels; n++) {
            const size_t i = pass & 1 ? s->pixels - 1 - n : n;
            const int x = (int)(i % (size_t)w), y = (int)(i / (size_t)w);
            for (int k = 0; k < 4; k++) {
                const int u = x + sign * before[k][0], v = y + sign * before[k][1];
                if (u < 0 || u >= s->width || v < 0 || v >= s->height) continue;
                const size_t j = (size_t)(v * w + u);
                if (steps[j] + 1 >= steps[i]) continue;
                steps[i] = (uint16_t)(steps[j] + 1);
                nearest[i] = nearest[j];
            }
        }
    }
}

static txm_status txs_no_memory_to_segment(txm_env *env) {
    return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the segmentation");
}

typedef struct txs_reducer {
    txs_scene *scene;
    txm_image image;
    const uint8_t *mask;
    const txs_colours *tables;
} txs_reducer;

static void txs_reduce_rows(void *context, int share) {
    const txs_reducer *r = (const txs_reducer *)context;
    txs_scene *s = r->scene;
    const int from = (int)((int64_t)s->height * share / TXS_TASKS);
    const int to = (int)((int64_t)s->height * (share + 1) / TXS_TASKS);
    for (int y = from; y < to; y++)
        for (int x = 0; x < s->width; x++) txs_reduce(s, &r->image, r->mask, r->tables, x, y);
}

/* Do enough pixels take part? */
static txm_status txs_check_counted(const txs_segmenter *g, txm_image image) {
    const txs_scene *s = &g->scene;
    size_t whole = 0, counted = 0;
    for (size_t i = 0; i < s->pixels; i++) whole += s->counted[i];
    for (int y = 0; y < image.height && counted < TXS_LEAST_COUNTED; y++)
        for (int x = 0; x < image.width; x++)
            counted += (size_t)txs_takes_part(&image, g->mask, x, y);
    if (counted >= TXS_LEAST_COUNTED && whole > 0) return TXM_OK;
    return txm_fail(g->env, TXM_TOO_SMALL,
                    "fewer than 256 pixels (16 x 16) take part, by mask and alpha");
}

static txm_status txs_see_scene(txs_segmenter *g) {
    txs_scene *s = &g->scene;
    const txm_image *im = &g->desc->image;
    txm_arena arena;
    txm_status status = TXM_OK;
    s->factor = 1;
    while (((int64_t)im->width + s->factor - 1) / s->factor *
               (((int64_t)im->height + s->factor - 1) / s->factor) >
           TXS_WORK)
        s->factor++;
    s->width = (im->width + s->factor - 1) / s->factor;
    s->height = (im->height + s->factor - 1) / s->factor;
    s->pixels = (size_t)s->width * (size_t)s->height;
    s->counted = (uint8_t *)txm_arena_alloc(&g->arena, s->pixels, 3);
    s->lab[0] = (int16_t *)txm_arena_alloc(&g->arena, s->pixels, 3 * sizeof(int16_t));
    g->nearest = (uint32_t *)txm_arena_alloc(&g->arena, s->pixels, sizeof(uint32_t));
    if (g->arena.failed) return txs_no_memory_to_segment(g->env);
    s->colour = s->counted + s->pixels;
    s->shape = s->colour + s->pixels;
    memset(s->colour, 0, 2 * s->pixels);
    s->lab[1] = s->lab[0] + s->pixels;
    s->lab[2] = s->lab[1] + s->pixels;

    txm_arena_init(&arena, g->env);
    txs_colours *tables = (txs_colours *)txm_arena_alloc(&arena, 1, sizeof *tables);
    uint16_t *steps = (uint16_t *)txm_arena_alloc(&arena, s->pixels, sizeof *steps);
    if (arena.failed) {
        status = txs_no_memory_to_segment(g->env);
    } else {
        txs_colour_tables(tables);
        txs_reducer r = {s, txm_image_resolve(*im), g->mask, tables};
        txm_parallel_for(g->env, TXS_TASKS, txs_reduce_rows, &r);
        status = txs_check_counted(g, r.image);
    }
    if (status == TXM_OK) {
        txs_find_nearest(s, g->nearest, steps);
        for (size_t i = 0; i < s->pixels; i++)
            for (int c = 0; c < 3; c++) s->lab[c][i] = s->lab[c][g->nearest[i]];
    }
    txm_arena_free(&arena);
    return status;
}

static txm_status txs_make_textons(txs_segmenter *g) {
    txs_scene *s = &g->scene;
    txm_arena arena;
    txs_features f;
    memset(&f, 0, sizeof f);
    f.scene = s;
    txm_arena_init(&arena, g->env);
    const int longest = s->width > s->height ? s->width : s->height;
    const int room = longest + 64 * (1 << (TXS_SCALES - 1));
    int16_t *lines = (int16_t *)txm_arena_alloc(&arena, (size_t)room, TXS_TASKS * sizeof *lines);
    int16_t *planes = (int16_t *)txm_arena_alloc(&arena, s->pixels, 5 * sizeof *planes);
    int8_t *answers = (int8_t *)txm_arena_alloc(&arena, s->pixels, TXS_FILTERS);
    int *samples = (int *)txm_arena_alloc(&arena, TXS_TRAINING, TXS_MOST_AXES * sizeof *samples);
    int64_t *far_ = (int64_t *)txm_arena_alloc(&arena, TXS_TRAINING, sizeof *far_);
    if (arena.failed) {
        txm_arena_free(&arena);
        return txs_no_memory_to_segment(g->env);
    }
    for (int c = 0; c < 3; c++) {
        f.smooth[c] = planes + (size_t)c * s->pixels;
        memcpy(f.smooth[c], s->lab[c], s->pixels * sizeof(int16_t));
        txs_blur_plane(s, f.smooth[c], 1, lines, room, g->env);
    }
    int16_t *light = planes + 3 * s->pixels, *raw = planes + 4 * s->pixels;
    memcpy(light, f.smooth[0], s->pixels * sizeof(int16_t));
    for (int k = 0; k < TXS_FILTERS; k++) {
        f.answers[k] = answers + (size_t)k * s->pixels;
        if (k && k % 3 == 0) txs_blur_plane(s, light, 1 << k / 3, lines, room, g->env);
        txs_run_filter(s, light, k % 3, 1 << k / 3, raw, f.answers[k], lines, room, g->env);
    }
    txs_find_textons(&f, samples, far_, g->desc->seed);
    txm_parallel_for(g->env, TXS_TASKS, txs_name_textons, &f);
    txm_arena_free(&arena);
    return TXM_OK;
}

static txm_status txs_make_regions(txs_segmenter *g) {
    const txs_scene *s = &g->scene;
    txs_blocks *b = &g->blocks;
    txs_region_set *r = &g->regions;
    const int side = s->width < s->height ? s->width : s->height;
    b->size = txm_clampi(side / TXS_BLOCKS_ACROSS, TXS_SMALLEST_BLOCK, TXS_BLOCK);
    for (;; b->size++) { /* a long strip has more of them */
        b->width = (s->width + b->size - 1) / b->size;
        b->height = (s->height + b->size - 1) / b->size;
        b->count = b->width * b->height;
        if (b->count <= TXS_MOST_BLOCKS) break;
    }
    const size_t n = (size_t)b->count;
    r->words = (b->count + 63) / 64;
    const size_t row = sizeof(uint16_t) * TXS_BINS_OF_BLOCK;
    b->sums = (uint16_t(*)[TXS_BINS_OF_BLOCK])txm_arena_zero(&g->arena, n, row);
    b->wide = (uint16_t(*)[TXS_BINS_OF_BLOCK])txm_arena_zero(&g->arena, n, row);
    b->clear = (uint16_t(*)[TXS_BINS_OF_BLOCK])txm_arena_zero(&g->arena, n, row);
    b->weight = (int *)txm_arena_zero(&g->arena, n, sizeof(int));
    b->log_table = (int32_t *)txm_arena_alloc(&g->arena, 2 * TXS_BLOCK_TOTAL + 1, sizeof(int32_t));
    r->of = (int *)txm_arena_alloc(&g->arena, n, sizeof(int));
    r->sum = (uint64_t(*)[TXS_BINS_OF_BLOCK])txm_arena_alloc(&g->arena, n, 4 * row);
    r->mean = (uint16_t(*)[TXS_BINS_OF_BLOCK])txm_arena_alloc(&g->arena, n, row);
    r->area = (int64_t *)txm_arena_alloc(&g->arena, n, sizeof(int64_t));
    r->touches = (uint64_t *)txm_arena_zero(&g->arena, n, sizeof(uint64_t) * (size_t)r->words);
    r->partner = (int *)txm_arena_alloc(&g->arena, n, sizeof(int));
    r->cost = (int64_t *)txm_arena_alloc(&g->arena, n, sizeof(int64_t));
    if (g->arena.failed) return txs_no_memory_to_segment(g->env);
    r->blocks = b;
    txs_log_table(b->log_table);
    txs_count_blocks(s, b);
    for (int y = 0; y < b->height; y++)
        for (int x = 0; x < b->width; x++) txs_widen(b, x, y);
    txs_clear_mixtures(b, r->partner);
    txs_first_regions(r);
    txs_join_neighbours(r, TXS_PIECES);
    return TXM_OK;
}

/* Every region a group of its own: raw histograms, distances, boundaries. */
static void txs_first_groups(txs_segmenter *g, uint64_t (*sum)[TXS_BINS_OF_BLOCK],
                             uint16_t (*mean)[TXS_BINS_OF_BLOCK]) {
    const txs_blocks *b = &g->blocks;
    const txs_region_set *r = &g->regions;
    txs_partition *p = &g->partition;
    const size_t square = (size_t)p->regions * (size_t)p->regions;
    p->count = p->regions;
    memset(p->border, 0, square * sizeof *p->border);
    memset(p->area, 0, (size_t)p->regions * sizeof *p->area);
    memset(sum, 0, (size_t)p->regions * sizeof *sum);
    for (int k = 0; k < b->count; k++) {
        const int a = r->of[k], beside[2] = {k % b->width ? k - 1 : -1, k - b->width};
        if (a < 0) continue;
        for (int i = 0; i < TXS_BINS_OF_BLOCK; i++) sum[a][i] += b->sums[k][i];
        p->area[a] += b->weight[k];
        for (int i = 0; i < 2; i++) {
            const int c = beside[i] < 0 ? -1 : r->of[beside[i]];
            if (c < 0 || c == a) continue;
            ++*txs_border_at(p, a, c);
            ++*txs_border_at(p, c, a);
        }
    }
    for (int a = 0; a < p->regions; a++) {
        txs_normalise_bins(sum[a], mean[a]);
        p->group[a] = a;
    }
    for (int a = 0; a < p->regions; a++)
        for (int c = 0; c < p->regions; c++)
            *txs_unlike_at(p, a, c) = txs_unlike(b->log_table, mean[a], mean[c]);
}

/* Regions are numbered in the order of their names. */
static void txs_number_regions(txs_region_set *r) {
    const int blocks = r->blocks->count;
    int *number = r->partner, next = 0; /* partners are not needed any more */
    for (int k = 0; k < blocks; k++)
        if (r->of[k] == k) number[k] = next++;
    TEXSYN_ASSERT(next == r->count);
    for (int k = 0; k < blocks; k++)
        if (r->of[k] >= 0) r->of[k] = number[r->of[k]];
}

/* Which regions are one texture? */
static txm_status txs_group_regions(txs_segmenter *g) {
    txs_partition *p = &g->partition;
    const size_t n = (size_t)g->regions.count;
    const int forced = g->desc->segments;
    p->regions = g->regions.count;
    p->block = g->blocks.size;
    p->unlike = (int *)txm_arena_alloc(&g->arena, n * n, 2 * sizeof(int));
    p->area = (int64_t *)txm_arena_alloc(&g->arena, n, sizeof(int64_t));
    p->group = (int *)txm_arena_alloc(&g->arena, n, sizeof(int));
    uint64_t(*sum)[TXS_BINS_OF_BLOCK] =
        (uint64_t(*)[TXS_BINS_OF_BLOCK])txm_arena_alloc(&g->arena, n, sizeof *sum);
    uint16_t(*mean)[TXS_BINS_OF_BLOCK] =
        (uint16_t(*)[TXS_BINS_OF_BLOCK])txm_arena_alloc(&g->arena, n, sizeof *mean);
    if (g->arena.failed) return txs_no_memory_to_segment(g->env);
    p->border = p->unlike + n * n;
    txs_number_regions(&g->regions);
    txs_first_groups(g, sum, mean);
    if (forced) {
        if (forced > p->count)
            return txm_fail_numbers(g->env, TXM_TOO_SMALL,
                                    "segments: the picture has only # regions; ask for fewer",
                                    (uint64_t)p->count, 0);
        txs_find_cliques(p, &txs_strict, forced, forced);
        return TXM_OK;
    }
    int64_t all = 0;
    for (int a = 0; a < p->regions; a++) all += p->area[a];
    txs_find_cliques(p, &txs_strict, 1, TXS_MOST_LABELS);
    txs_join_least(p, all / TXS_SMALL);
    if (p->count > 1) return TXM_OK;
    txs_first_groups(g, sum, mean); /* one texture; or several that are not very unlike? */
    txs_find_cliques(p, &txs_fine, 1, TXS_MOST_LABELS);
    txs_join_least(p, all / TXS_SMALL);
    return TXM_OK;
}

/* Each block's label to its pixels. */
static void txs_spread_labels(const txs_segmenter *g, uint8_t *label) {
    const txs_scene *s = &g->scene;
    const txs_blocks *b = &g->blocks;
    for (int y = 0; y < s->height; y++) {
        for (int x = 0; x < s->width; x++) {
            const int region = g->regions.of[y / b->size * b->width + x / b->size];
            label[(size_t)y * (size_t)s->width + (size_t)x] =
                (uint8_t)(region < 0 ? 0 : g->partition.group[region]);
        }
    }
}

/* Has each label a pixel that takes part? */
static int txs_all_labels_live(const txs_refiner *r) {
    const txs_scene *s = r->scene;
    size_t area[TXS_MOST_LABELS] = {0};
    for (size_t i = 0; i < s->pixels; i++) area[r->label[i]] += s->counted[i];
    for (int k = 0; k < r->count; k++)
        if (!area[k]) return 0;
    return 1;
}

static txm_status txs_find_labels(txs_segmenter *g) {
    const txs_scene *s = &g->scene;
    txs_refiner *r = &g->refiner;
    r->scene = s;
    r->count = g->partition.count;
    TEXSYN_ASSERT(r->count >= 1 && r->count <= TXS_MOST_LABELS);
    const size_t n = (size_t)r->count;
    r->label = (uint8_t *)txm_arena_alloc(&g->arena, s->pixels, 1);
    r->colour_cost = (int32_t *)txm_arena_alloc(&g->arena, n, TXS_COLOURS * sizeof(int32_t));
    r->shape_cost = (int32_t *)txm_arena_alloc(&g->arena, n, TXS_GRAINS * sizeof(int32_t));
    r->cost = (int16_t *)txm_arena_alloc(&g->arena, s->pixels, n * sizeof(int16_t));
    r->share = (uint8_t *)txm_arena_alloc(&g->arena, s->pixels, n);
    r->work = (int32_t *)txm_arena_alloc(&g->arena, (size_t)s->width, 2 * n * sizeof(int32_t));
    r->counted_around = (uint16_t *)txm_arena_alloc(&g->arena, s->pixels, sizeof(uint16_t));
    if (g->arena.failed) return txs_no_memory_to_segment(g->env);
    txs_spread_labels(g, r->label);
    if (r->count < 2) return TXM_OK;
    const txm_status status = txs_refine_labels(r, g->env, TXS_AT_LABELS, TXS_AT_END);
    if (status == TXM_OK && g->desc->segments && !txs_all_labels_live(r))
        txs_spread_labels(g, r->label); /* rather coarse boundaries than a label less */
    return status;
}

/* Specks and, if wanted, transitions; then labels also where nothing counts. */
static txm_status txs_tidy_labels(txs_segmenter *g) {
    const txs_scene *s = &g->scene;
    txs_refiner *r = &g->refiner;
    const int wants = g->desc->transition;
    const int transition = wants ? (int)TEXSYN_TRANSITION : -1;
    const txs_cleaner cleaner = {s->width, s->height, r->label, r->share,
                                 (uint32_t *)txm_arena_alloc(&g->arena, s->pixels, 4)};
    if (g->arena.failed) return txs_no_memory_to_segment(g->env);
    if (wants && r->count > 1) {
        r->reach = TXS_REACH;
        txs_count_around(r);
        for (int k = 0; k < r->count; k++) txs_mark_thin(r, k, TEXSYN_TRANSITION);
    }
    for (size_t i = 0; i < s->pixels; i++) r->label[i] = r->label[g->nearest[i]];
    txs_clean_labels(&cleaner, s->pixels / TXS_SPECK, transition);
    return TXM_OK;
}

/* Labels by area, the largest 0; without those that no pixel has. */
static int txs_order_labels(txs_segmenter *g) {
    const txs_scene *s = &g->scene;
    txs_refiner *r = &g->refiner;
    size_t area[256] = {0};
    uint8_t name[256] = {0};
    int count = 0;
    for (size_t i = 0; i < s->pixels; i++) area[r->label[i]] += s->counted[i];
    for (;; count++) {
        int best = -1;
        for (int c = 0; c < r->count; c++)
            if (area[c] && (best < 0 || area[c] > area[best])) best = c;
        if (best < 0) break;
        name[best] = (uint8_t)count;
        area[best] = 0;
    }
    name[TEXSYN_TRANSITION] = TEXSYN_TRANSITION;
    for (size_t i = 0; i < s->pixels; i++) r->label[i] = name[r->label[i]];
    return count;
}

typedef struct txs_writer {
    const txs_segmenter *job;
    const txm_image *out;
} txs_writer;

static void txs_write_labels(void *context, int share) {
    const txs_writer *w = (const txs_writer *)context;
    const txs_scene *s = &w->job->scene;
    const txm_image im = txm_image_resolve(w->job->desc->image), *out = w->out;
    const uint8_t *mask = w->job->mask;
    const int from = (int)((int64_t)out->height * share / TXS_TASKS);
    const int to = (int)((int64_t)out->height * (share + 1) / TXS_TASKS);
    for (int y = from; y < to; y++) {
        uint8_t *row = (uint8_t *)txm_image_row(out, y);
        for (int x = 0; x < out->width; x++)
            row[x] = txs_takes_part(&im, mask, x, y) ? txs_vote(s, w->job->refiner.label, x, y)
                                                      : (uint8_t)TEXSYN_NO_LABEL;
    }
}

/* ---- public: segmentation ------------------------------------------------------------------ */

static txm_status txs_segment_check(const texsyn_segment_desc *d, const txm_image *out,
                                    const int *count, txm_env *env) {
    txm_status status;
    if (!d || !count) return txm_fail(env, TXM_BAD_ARGUMENT, "segment: desc or count is NULL");
    if ((status = txm_image_check(&d->image, "image", TEXSYN_MAX_PIXELS, env)) != TXM_OK)
        return status;
    if (d->image.channels == 2)
        return txm_fail(env, TXM_BAD_ARGUMENT, "image: 2 channels; give 1, 3 or 4");
    if (d->image.width < 16 || d->image.height < 16)
        return txm_fail(env, TXM_TOO_SMALL, "image: both sides must be at least 16 pixels");
    if (!txs_image_is_moderate(&d->image))
        return txm_fail(env, TXM_BAD_ARGUMENT, "image: a sample is NaN or beyond a million");
    if ((status = txs_check_mask(&d->mask, &d->image, "mask", env)) != TXM_OK) return status;
    if (d->segments < 0 || d->segments > TEXSYN_MAX_SEGMENTS)
        return txm_fail(env, TXM_BAD_ARGUMENT, "segments must be 1 to 16, or 0");
    if ((status = txm_image_check(out, "out", 0, env)) != TXM_OK) return status;
    if (out->width != d->image.width || out->height != d->image.height)
        return txm_fail(env, TXM_BAD_ARGUMENT, "out: must be as large as the image");
    if (out->channels > 1 || out->sample != TXM_U8)
        return txm_fail(env, TXM_BAD_ARGUMENT, "out: must have one 8-bit channel");
    return TXM_OK;
}

static txm_status txs_report_stage(const txs_segmenter *g, float fraction, const char *stage) {
    return txm_progress(g->env, fraction, stage) ? txm_fail(g->env, TXM_CANCELLED, "cancelled")
                                                 : TXM_OK;
}

TEXSYN_API txm_status texsyn_segment(const texsyn_segment_desc *desc, txm_env *env, txm_image out,
                                     int *count) {
    txm_status status = txs_segment_check(desc, &out, count, env);
    if (status != TXM_OK) return status;
    txs_segmenter g;
    memset(&g, 0, sizeof g);
    g.desc = desc;
    g.env = env;
    txm_arena_init(&g.arena, env);
    status = txs_read_mask(&desc->mask, &g.arena, &g.mask, env);
    if (status == TXM_OK) status = txs_see_scene(&g);
    if (status == TXM_OK) status = txs_report_stage(&g, TXS_AT_TEXTONS, "textons");
    if (status == TXM_OK) status = txs_make_textons(&g);
    if (status == TXM_OK) status = txs_report_stage(&g, TXS_AT_REGIONS, "regions");
    if (status == TXM_OK) status = txs_make_regions(&g);
    if (status == TXM_OK) status = txs_group_regions(&g);
    if (status == TXM_OK) status = txs_report_stage(&g, TXS_AT_LABELS, "labels");
    if (status == TXM_OK) status = txs_find_labels(&g);
    if (status == TXM_OK) status = txs_tidy_labels(&g);
    if (status == TXM_OK) status = txs_report_stage(&g, TXS_AT_END, "labels");
    if (status == TXM_OK) {
        const txs_writer writer = {&g, &out};
        *count = txs_order_labels(&g);
        txm_parallel_for(env, TXS_TASKS, txs_write_labels, (void *)&writer);
    }
    txm_arena_free(&g.arena);
    return status;
}

/* ---- label maps as textures ---------------------------------------------------------------

   A label map is a texture whose values have no order, so its clique types are joint histograms of
   labels, not histograms of differences [1, section 4]:

     FIELD    band of the picture x label: what lies above stays above. One band = the shares alone.
     PAIR     label at p + d x label at p. Head and tail differ, so order is kept (Fig. 13).
     PARENT   label of the coarser level x label at p; d = (1, 0) is the coarse pixel beside p's own
              on the side that p is nearer to.
     RING     how many of the 8 pixels at a distance carry the label of p, x label: pairs fix how
              long borders are, rings how they bend, and whether there are specks.

   A histogram has a row for each value of the first and a column for each label of p.            */
enum {
    TXS_OUTSIDE = TXS_MAX_LABELS, /* label of what is unknown or outside     */
    TXS_BANDS_OF_FIELD = 16,      /* along the side of the picture           */
    TXS_LAY_AROUND = 8,           /* pixels of a ring                        */
    TXS_LAY_BINS =
        TXS_MAX_LABELS * TXS_MAX_LABELS,    /* of a histogram; rows of TXS_MAX_LABELS bins */
    TXS_LAY_ROWS = (int)TXS_MAX_LABELS + 1, /* of a table: TXS_OUTSIDE has no energy   */
    TXS_LAY_TYPES = 48,                     /* clique types of one level               */
    TXS_LAY_LEVELS = 6,
    TXS_LAY_TOP = 48,                        /* pixels: short side of the coarsest level */
    TXS_LAY_REACH = 20,                      /* pixels: longest pair on the coarsest level */
    TXS_LAY_NEAR = 5,                        /* the same on the others                  */
    TXS_LAY_MARGIN = 2 * (int)TXS_LAY_REACH, /* of a plane                              */
    TXS_LAY_RINGS = 3                        /* of distances 1, 2, 4                    */
};

enum { TXS_LAY_ROWS_FIELD = 1, TXS_LAY_COLUMNS = 2 }; /* along which a field changes */

enum { TXS_LAY_FIELD, TXS_LAY_PAIR, TXS_LAY_PARENT, TXS_LAY_RING };

typedef struct txs_lay_type {
    int kind, dx, dy; /* of a ring, dx is the distance */
    int32_t share[TXS_LAY_BINS];
    int16_t root[TXS_LAY_BINS]; /* as a file keeps it, see txs_lay_round */
} txs_lay_type;

typedef struct txs_lay_level {
    txs_lay_type *types; /* the first is the field */
    int type_count;
} txs_lay_level;

typedef struct txs_layout {
    int labels, levels;
    int field;                           /* 0 none, 1 bands are rows, 2 columns           */
    int width, height;                   /* of the example                                */
    txs_lay_level level[TXS_LAY_LEVELS]; /* 0 = full resolution                           */
} txs_layout;

/* A plane of labels with a margin: opposite sides repeated where an axis wraps, else outside. */
typedef struct txs_lay_plane {
    int width, height, wrap_x, wrap_y;
    ptrdiff_t stride;
    uint8_t *pixels; /* the margin's first corner */
} txs_lay_plane;

static uint8_t *txs_lay_at(const txs_lay_plane *p, int x, int y) {
    return p->pixels + (y + TXS_LAY_MARGIN) * p->stride + (x + TXS_LAY_MARGIN);
}

static size_t txs_lay_bytes(const txs_lay_plane *p) {
    return (size_t)p->stride * ((size_t)p->height + 2 * TXS_LAY_MARGIN);
}

/* All outside. 0 without memory. */
static int txs_lay_plane_make(txs_lay_plane *p, const txm_env *env, int width, int height,
                              int wrap_x, int wrap_y) {
    const size_t stride = (size_t)width + 2 * TXS_LAY_MARGIN;
    size_t bytes;
    p->width = width;
    p->height = height;
    p->wrap_x = wrap_x;
    p->wrap_y = wrap_y;
    p->stride = (ptrdiff_t)stride;
    p->pixels = NULL;
    if (!txm_mul(stride, (size_t)height + 2 * TXS_LAY_MARGIN, 1, &bytes)) return 0;
    p->pixels = (uint8_t *)txm_alloc(env, bytes);
    if (p->pixels) memset(p->pixels, TXS_OUTSIDE, bytes);
    return p->pixels != NULL;
}

static void txs_lay_plane_free(txs_lay_plane *p, const txm_env *env) {
    txm_free(env, p->pixels);
    p->pixels = NULL;
}

/* Set a pixel and its copies in the margin. */
static void txs_lay_set(const txs_lay_plane *p, int x, int y, uint8_t label) {
    const int m = TXS_LAY_MARGIN;
    *txs_lay_at(p, x, y) = label;
    if (x >= m && x < p->width - m && y >= m && y < p->height - m) return;
    const int left = p->wrap_x ? x - (x + m) / p->width * p->width : x;
    const int top = p->wrap_y ? y - (y + m) / p->height * p->height : y;
    const int right = p->wrap_x ? p->width + m : x + 1, bottom = p->wrap_y ? p->height + m : y + 1;
    for (int yy = top; yy < bottom; yy += p->height)
        for (int xx = left; xx < right; xx += p->width) *txs_lay_at(p, xx, yy) = label;
}

static const int txs_lay_around[TXS_LAY_AROUND][2] = {{1, 0},  {1, 1},   {0, 1},  {-1, 1},
                                                      {-1, 0}, {-1, -1}, {0, -1}, {1, -1}};

/* How many pixels of the ring carry the label of the middle; -1 if not all are known. */
static int txs_lay_alike(const txs_lay_plane *p, int x, int y, int distance) {
    const uint8_t *at = txs_lay_at(p, x, y);
    int alike = 0;
    for (int i = 0; i < TXS_LAY_AROUND; i++) {
        const uint8_t label =
            at[distance * (txs_lay_around[i][1] * p->stride + txs_lay_around[i][0])];
        if (label == TXS_OUTSIDE) return -1;
        alike += label == *at;
    }
    return alike;
}

/* ---- statistics of a label map ------------------------------------------------------------- */

/* A map, the one of the coarser level at this resolution, and which band a pixel lies in. */
typedef struct txs_lay_view {
    const txs_lay_plane *map, *parent; /* parent NULL on the coarsest level */
    int field;
} txs_lay_view;

static int txs_lay_band(const txs_lay_view *v, int x, int y) {
    if (v->field == 0) return 0;
    return v->field == 1 ? (int)((int64_t)y * TXS_BANDS_OF_FIELD / v->map->height)
                         : (int)((int64_t)x * TXS_BANDS_OF_FIELD / v->map->width);
}

/* the coarse pixel that a PARENT type looks at, at this resolution */
static ptrdiff_t txs_lay_parent(const txs_lay_type *t, const txs_lay_plane *parent, int x, int y) {
    const int sx = x & 1 ? 2 : -2, sy = y & 1 ? 2 : -2;
    return sy * t->dy * parent->stride + sx * t->dx;
}

/* The row that a type's histogram has for the pixel; TXS_OUTSIDE if it has none. */
static int txs_lay_row(const txs_lay_view *v, const txs_lay_type *t, int x, int y) {
    int alike;
    switch (t->kind) {
    case TXS_LAY_FIELD: return txs_lay_band(v, x, y);
    case TXS_LAY_PAIR: return txs_lay_at(v->map, x, y)[t->dy * v->map->stride + t->dx];
    case TXS_LAY_PARENT: return txs_lay_at(v->parent, x, y)[txs_lay_parent(t, v->parent, x, y)];
    default:
        alike = txs_lay_alike(v->map, x, y, t->dx);
        return alike < 0 ? (int)TXS_OUTSIDE : alike;
    }
}

/* Count the cliques of a type; returns how many there are. */
static int64_t txs_lay_count(const txs_lay_view *v, const txs_lay_type *t,
                             int32_t count[TXS_LAY_BINS]) {
    int64_t total = 0;
    memset(count, 0, TXS_LAY_BINS * sizeof *count);
    for (int y = 0; y < v->map->height; y++) {
        for (int x = 0; x < v->map->width; x++) {
            const int label = *txs_lay_at(v->map, x, y), row = txs_lay_row(v, t, x, y);
            if (label == TXS_OUTSIDE || row == TXS_OUTSIDE) continue;
            count[row * TXS_MAX_LABELS + label]++;
            total++;
        }
    }
    return total;
}

/* Normalise to a sum of about TXS_ONE. The bands of a field are normalised one by one and share
   that sum, so that a band of which little is known counts like the others. */
static void txs_lay_normalise(const txs_lay_view *v, const txs_lay_type *t, const int32_t *count,
                              int32_t *share) {
    const int parts = t->kind == TXS_LAY_FIELD && v->field ? (int)TXS_BANDS_OF_FIELD : 1;
    const int bins = TXS_LAY_BINS / parts;
    for (int part = 0; part < parts; part++) {
        int64_t total = 0;
        for (int i = 0; i < bins; i++) total += count[part * bins + i];
        for (int i = 0; i < bins; i++)
            share[part * bins + i] =
                total ? (int32_t)((int64_t)count[part * bins + i] * (TXS_ONE / parts) / total) : 0;
    }
}

/* How often two labels would lie d bands apart if the field alone decided, given the share of each
   label in each band: added to pairs, which has a row for the label at p + d, times `by`. */
static void txs_lay_field_pairs(const int32_t *field, int labels, double d, double by,
                                double pairs[TXS_LAY_BINS]) {
    const int last = TXS_BANDS_OF_FIELD - 1, steps = 8; /* of a band */
    double sum[TXS_LAY_BINS] = {0}, total = 0;
    for (int i = 0; i <= last * steps; i++) {
        const double t = (double)i / steps, u = t + d;
        if (u < 0 || u > last) continue;
        const int32_t *f = field + (int)t * TXS_MAX_LABELS, *g = field + (int)u * TXS_MAX_LABELS;
        const double wt = t - (int)t, wu = u - (int)u;
        const int nt = t < last ? (int)TXS_MAX_LABELS : 0, nu = u < last ? (int)TXS_MAX_LABELS : 0;
        for (int a = 0; a < labels; a++) {
            const double tail = f[a] * (1 - wt) + f[a + nt] * wt;
            for (int b = 0; b < labels; b++)
                sum[b * TXS_MAX_LABELS + a] += tail * (g[b] * (1 - wu) + g[b + nu] * wu);
        }
    }
    for (int i = 0; i < TXS_LAY_BINS; i++) total += sum[i];
    for (int i = 0; i < TXS_LAY_BINS && total > 0; i++) pairs[i] += by * sum[i] / total;
}

/* A pair's histogram for a picture of another size along the field. The field spreads with the
   picture, the pairs do not: there is one horizon, however high the picture is. So what the field
   explains is exchanged, and only what goes beyond it is kept; pairs
   that the example does not have stay away. bands_then, bands_now: how many
   bands of the field the displacement spans in the example and in the picture. */
static void txs_lay_fit_pair(txs_lay_type *t, const int32_t *field, int labels, double bands_then,
                             double bands_now) {
    double pairs[TXS_LAY_BINS], total = 0;
    for (int i = 0; i < TXS_LAY_BINS; i++) pairs[i] = t->share[i];
    txs_lay_field_pairs(field, labels, bands_then, -(double)TXS_ONE, pairs);
    txs_lay_field_pairs(field, labels, bands_now, (double)TXS_ONE, pairs);
    for (int i = 0; i < TXS_LAY_BINS; i++) {
        if (!(pairs[i] > 0.5) || t->share[i] == 0) pairs[i] = 0;
        total += pairs[i];
    }
    for (int i = 0; i < TXS_LAY_BINS && total > 0; i++)
        t->share[i] = (int32_t)floor(pairs[i] / total * (double)TXS_ONE + 0.5);
}

/* ---- what is kept of a label map's statistics ------------------------------------------------ */

enum { TXS_LAY_SCALE = 60 }; /* steps of the root of a share */

/* Rows of a layout's histogram. */
static int txs_lay_rows(const txs_layout *layout, int kind) {
    if (kind == TXS_LAY_FIELD) return layout->field ? (int)TXS_BANDS_OF_FIELD : 1;
    return kind == TXS_LAY_RING ? TXS_LAY_AROUND + 1 : layout->labels;
}

/* Round shares to what is kept: roots in steps, beside each other without the empty columns. */
static void txs_lay_round(const txs_layout *layout, txs_lay_type *t) {
    const int rows = txs_lay_rows(layout, t->kind);
    for (int i = 0; i < rows * layout->labels; i++) {
        const int32_t share = t->share[i / layout->labels * TXS_MAX_LABELS + i % layout->labels];
        t->root[i] =
            (int16_t)floor(sqrt((double)share / (double)TXS_ONE) * (double)TXS_LAY_SCALE + 0.5);
    }
}

/* The inverse, normalised as txs_lay_normalise has it; 0 for an empty histogram. */
static int txs_lay_unround(const txs_layout *layout, txs_lay_type *t) {
    const txs_lay_view view = {NULL, NULL, layout->field};
    const int rows = txs_lay_rows(layout, t->kind);
    int32_t square[TXS_LAY_BINS] = {0}, total = 0;
    for (int i = 0; i < rows * layout->labels; i++) {
        square[i / layout->labels * TXS_MAX_LABELS + i % layout->labels] = t->root[i] * t->root[i];
        total += t->root[i] * t->root[i];
    }
    txs_lay_normalise(&view, t, square, t->share);
    return total > 0;
}

/* ---- Gibbs sampling of labels ---------------------------------------------------------------

   As in the sampler of values the potentials are controlled (see potential.h), here with histograms
   that are exact: a pixel that changes its label takes its cliques out and puts them in again. */
enum {
    TXS_LAY_GRID = 8,           /* sub-lattices a side                                     */
    TXS_LAY_GROUP = 4,          /* of them are visited before potentials are set anew      */
    TXS_LAY_PROPORTIONAL = 100, /* gains, nats per unit of histogram error             */
    TXS_LAY_INTEGRAL = 20,
    TXS_LAY_STEEPEST = 8,             /* nats: the largest potential of a clique                 */
    TXS_LAY_NAT = TXS_NAT * TXS_FINE, /* steps of a potential per nat, as in the noise */
    TXS_LAY_UNSEEN = 3,               /* nats: where a pair has no clique in the example          */
    TXS_LAY_HOT = 16,                 /* noise of a draw from the Gibbs distribution            */
    TXS_LAY_FINE = 256,               /* steps of an integral per step of a potential            */
    TXS_LAY_NEVER = 40,               /* nats: where it has none although there would be many     */
    TXS_LAY_MUCH = TXS_ONE / 50,      /* share that is many                                  */
    TXS_LAY_TABLE = (int)TXS_LAY_ROWS * (int)TXS_MAX_LABELS
};

typedef struct txs_lay_sampler {
    const txs_lay_level *level;
    txs_lay_view view;
    int labels;
    const int16_t *noise;
    uint64_t seed;
    txs_lay_plane alike[TXS_LAY_RINGS]; /* of each ring: how many pixels are like their middle, or
                                           TXS_OUTSIDE                                   */
    uint8_t *plain;                     /* see txs_lay_find_plain; NULL on the coarsest level */
    int heat;                           /* of the noise, 0..TXS_LAY_HOT */
    int32_t (*count)[TXS_LAY_BINS];    /* of each type, now                                       */
    int32_t (*integral)[TXS_LAY_BINS]; /* steps / TXS_LAY_FINE                                    */
    int16_t (*table)[2][TXS_LAY_TABLE]; /* potentials by row: of the tail, of a pair's head       */
} txs_lay_sampler;

/* Set a type's potentials from its error; integrate as well if it is time. */
static void txs_lay_control(txs_lay_sampler *s, int k, int integrate) {
    const txs_lay_type *t = &s->level->types[k];
    const int32_t limit = TXS_LAY_STEEPEST * TXS_LAY_NAT * TXS_LAY_FINE;
    int32_t share[TXS_LAY_BINS];
    txs_lay_normalise(&s->view, t, s->count[k], share);
    for (int row = 0; row < TXS_MAX_LABELS; row++) {
        for (int label = 0; label < s->labels; label++) {
            const int i = row * TXS_MAX_LABELS + label;
            const int64_t pull =
                (int64_t)(share[i] - t->share[i]) * (TXS_LAY_NAT * TXS_LAY_FINE) / TXS_ONE;
            int32_t *sum = &s->integral[k][i];
            if (integrate && *sum <= limit)
                *sum = txm_clampi(*sum + (int32_t)(TXS_LAY_INTEGRAL * pull), -limit, limit);
            const int16_t v =
                (int16_t)((*sum > limit ? *sum
                                        : txm_clampi(*sum + (int32_t)(TXS_LAY_PROPORTIONAL * pull),
                                                     -limit, limit)) /
                          TXS_LAY_FINE);
            s->table[k][0][i] = v;
            if (row < s->labels) s->table[k][1][label * TXS_MAX_LABELS + row] = v;
        }
    }
}

static void txs_lay_add_row(int32_t *energy, const int16_t *row, int labels) {
    enum { HALF = TXS_MAX_LABELS / 2 }; /* loops of fixed length become a few vector instructions */
    for (int v = 0; v < HALF; v++) energy[v] += row[v];
    if (labels <= HALF) return;
    for (int v = HALF; v < TXS_MAX_LABELS; v++) energy[v] += row[v];
}

static const txs_lay_plane *txs_lay_ring(const txs_lay_sampler *s, const txs_lay_type *t) {
    return &s->alike[t->dx >> 1]; /* distances 1, 2, 4 */
}

/* What a ring says: p's own, and those of the 8 pixels that have p in theirs. */
static void txs_lay_add_ring(const txs_lay_sampler *s, int k, int x, int y, int32_t *energy) {
    const txs_lay_plane *map = s->view.map, *ring = txs_lay_ring(s, &s->level->types[k]);
    const uint8_t *at = txs_lay_at(map, x, y), *alike = txs_lay_at(ring, x, y);
    const int16_t *table = s->table[k][0];
    const int distance = s->level->types[k].dx, now = *at;
    int same[TXS_MAX_LABELS + 1] = {0};
    for (int i = 0; i < TXS_LAY_AROUND; i++) {
        const ptrdiff_t d = distance * (txs_lay_around[i][1] * map->stride + txs_lay_around[i][0]);
        const int label = at[d];
        same[label]++;
        if (alike[d] == TXS_OUTSIDE) continue;
        const int others = alike[d] - (label == now); /* without p */
        energy[label] +=
            table[(others + 1) * TXS_MAX_LABELS + label] - table[others * TXS_MAX_LABELS + label];
    }
    for (int v = 0; v < s->labels && *alike != TXS_OUTSIDE; v++)
        energy[v] += table[same[v] * TXS_MAX_LABELS + v];
}

/* Give a pixel another label, and the rings it lies in their counts. */
static void txs_lay_change(txs_lay_sampler *s, int x, int y, uint8_t label) {
    const txs_lay_plane *map = s->view.map;
    const int before = *txs_lay_at(map, x, y);
    txs_lay_set(map, x, y, label);
    for (int r = 0; r < TXS_LAY_RINGS; r++) {
        const txs_lay_plane *ring = &s->alike[r];
        const int distance = 1 << r;
        int same = 0;
        for (int i = 0; i < TXS_LAY_AROUND; i++) {
            int qx = x + distance * txs_lay_around[i][0], qy = y + distance * txs_lay_around[i][1];
            const int there = *txs_lay_at(map, qx, qy);
            same += there == label;
            if (there != before && there != label) continue;
            if (map->wrap_x) qx = txs_mod(qx, map->width);
            if (map->wrap_y) qy = txs_mod(qy, map->height);
            const int count = *txs_lay_at(ring, qx, qy);
            if (count != TXS_OUTSIDE)
                txs_lay_set(ring, qx, qy, (uint8_t)(count + (there == label ? 1 : -1)));
        }
        if (*txs_lay_at(ring, x, y) != TXS_OUTSIDE) txs_lay_set(ring, x, y, (uint8_t)same);
    }
}

static int txs_lay_sampler_row(const txs_lay_sampler *s, const txs_lay_type *t, int x, int y) {
    return t->kind == TXS_LAY_RING ? *txs_lay_at(txs_lay_ring(s, t), x, y)
                                   : txs_lay_row(&s->view, t, x, y);
}

/* Take the cliques of a pixel out of the histograms (by -1) or put them in (by 1). */
static void txs_lay_tally(txs_lay_sampler *s, int x, int y, int by) {
    const txs_lay_plane *map = s->view.map;
    const uint8_t *at = txs_lay_at(map, x, y);
    const int label = *at;
    for (int k = 0; k < s->level->type_count; k++) {
        const txs_lay_type *t = &s->level->types[k];
        const ptrdiff_t d = t->dy * map->stride + t->dx;
        const int row = txs_lay_sampler_row(s, t, x, y);
        if (row != TXS_OUTSIDE) s->count[k][row * TXS_MAX_LABELS + label] += by;
        if (t->kind == TXS_LAY_PAIR && at[-d] != TXS_OUTSIDE)
            s->count[k][label * TXS_MAX_LABELS + at[-d]] += by;
        for (int i = 0; i < TXS_LAY_AROUND && t->kind == TXS_LAY_RING; i++) {
            const txs_lay_plane *ring = txs_lay_ring(s, t);
            const ptrdiff_t q = t->dx * (txs_lay_around[i][1] * map->stride + txs_lay_around[i][0]);
            const int alike = txs_lay_at(ring, x, y)[q];
            if (alike != TXS_OUTSIDE) s->count[k][alike * TXS_MAX_LABELS + at[q]] += by;
        }
    }
}

/* Is the map of one label about the pixel, here and a level above? Then no other label is drawn: a
   border may move, but what has no border on either level stays as it is. */
static int txs_lay_is_plain(const txs_lay_sampler *s, int x, int y) {
    return s->plain && *txs_lay_at(&s->alike[0], x, y) == TXS_LAY_AROUND &&
           s->plain[(ptrdiff_t)y * s->view.map->width + x] == *txs_lay_at(s->view.map, x, y);
}

/* Labels of the pixels about which the parent has but one label, else TXS_OUTSIDE. */
static void txs_lay_find_plain(const txs_lay_plane *parent, uint8_t *plain) {
    for (int y = 0; y < parent->height; y++) {
        for (int x = 0; x < parent->width; x++) {
            const uint8_t label = *txs_lay_at(parent, x, y);
            const int alone = txs_lay_alike(parent, x, y, 2) == TXS_LAY_AROUND;
            *plain++ = (uint8_t)(alone ? label : (int)TXS_OUTSIDE);
        }
    }
}

/* Draw a new label for a pixel. */
static void txs_lay_visit(txs_lay_sampler *s, int x, int y, txm_rng *rng) {
    const txs_lay_plane *map = s->view.map;
    const uint8_t *at = txs_lay_at(map, x, y);
    const int16_t *noise = s->noise + (txm_rng_next(rng) & (TXS_NOISE - 1));
    int32_t energy[TXS_MAX_LABELS];
    if (txs_lay_is_plain(s, x, y)) return;
    for (int v = 0; v < TXS_MAX_LABELS; v++) energy[v] = noise[v] * s->heat / TXS_LAY_HOT;
    for (int k = 0; k < s->level->type_count; k++) {
        const txs_lay_type *t = &s->level->types[k];
        if (t->kind == TXS_LAY_RING) {
            txs_lay_add_ring(s, k, x, y, energy);
            continue;
        }
        txs_lay_add_row(energy, s->table[k][0] + txs_lay_row(&s->view, t, x, y) * TXS_MAX_LABELS,
                        s->labels);
        if (t->kind == TXS_LAY_PAIR)
            txs_lay_add_row(energy,
                            s->table[k][1] + at[-(t->dy * map->stride + t->dx)] * TXS_MAX_LABELS,
                            s->labels);
    }
    int best = 0;
    for (int v = 1; v < s->labels; v++)
        if (energy[v] < energy[best]) best = v;
    if (best == *at) return;
    txs_lay_tally(s, x, y, -1);
    txs_lay_change(s, x, y, (uint8_t)best);
    txs_lay_tally(s, x, y, 1);
}

/* Visit every pixel once. */
static void txs_lay_sweep(txs_lay_sampler *s, int sweep) {
    enum { ALL = TXS_LAY_GRID * TXS_LAY_GRID };
    int order[ALL];
    txm_rng rng = txm_rng_make(s->seed, (uint64_t)sweep);
    for (int i = 0; i < ALL; i++) order[i] = i;
    txm_shuffle(&rng, order, ALL);
    for (int i = 0; i < ALL; i += TXS_LAY_GROUP) {
        for (int top = 0; top < s->view.map->height; top += TXS_LAY_GRID) {
            for (int j = i; j < i + TXS_LAY_GROUP; j++) {
                const int y = top + order[j] / TXS_LAY_GRID;
                if (y >= s->view.map->height) continue;
                for (int x = order[j] % TXS_LAY_GRID; x < s->view.map->width; x += TXS_LAY_GRID)
                    txs_lay_visit(s, x, y, &rng);
            }
        }
        for (int k = 0; k < s->level->type_count; k++)
            txs_lay_control(s, k, i + TXS_LAY_GROUP == ALL);
    }
}

/* Count the map as it is; to be called whenever the level has got types. */
static void txs_lay_sampler_start(txs_lay_sampler *s) {
    for (int r = 0; r < TXS_LAY_RINGS; r++) {
        for (int y = 0; y < s->view.map->height; y++) {
            for (int x = 0; x < s->view.map->width; x++) {
                const int alike = txs_lay_alike(s->view.map, x, y, 1 << r);
                txs_lay_set(&s->alike[r], x, y, (uint8_t)(alike < 0 ? (int)TXS_OUTSIDE : alike));
            }
        }
    }
    for (int k = 0; k < s->level->type_count; k++) {
        txs_lay_count(&s->view, &s->level->types[k], s->count[k]);
        txs_lay_control(s, k, 0);
    }
}

/* Where the potentials of a type start. What the example does not have although there would be
   much of it by chance has a high potential that stays: a label in a band of the field in which it
   has no neighbour, two labels that never touch, or only one way round. So a sky stays above the
   ground. Shares alone would allow it a little, for the sake of other shares. */
static void txs_lay_forbid(const txs_lay_type *t, int labels, int field, int32_t *integral) {
    const int32_t nat = TXS_LAY_NAT * TXS_LAY_FINE;
    const int bands = field ? (int)TXS_BANDS_OF_FIELD : 1;
    const int touching = abs(t->dx) + abs(t->dy) == 1;
    int64_t in_row[TXS_MAX_LABELS] = {0}, in_column[TXS_MAX_LABELS] = {0};
    for (int i = 0; i < TXS_LAY_BINS; i++) {
        in_row[i / TXS_MAX_LABELS] += t->share[i];
        in_column[i % TXS_MAX_LABELS] += t->share[i];
    }
    for (int row = 0; row < TXS_MAX_LABELS; row++) {
        for (int label = 0; label < labels; label++) {
            const int i = row * TXS_MAX_LABELS + label;
            const int64_t by_chance = in_row[row] * in_column[label] / TXS_ONE;
            int32_t about = t->share[i];
            if (t->kind == TXS_LAY_PAIR && row < labels && about == 0)
                integral[i] = (touching && by_chance > TXS_LAY_MUCH ? (int)TXS_LAY_NEVER
                                                                    : (int)TXS_LAY_UNSEEN) *
                              nat;
            if (t->kind != TXS_LAY_FIELD || row >= bands) continue;
            if (row > 0) about += t->share[i - TXS_MAX_LABELS];
            if (row + 1 < bands) about += t->share[i + TXS_MAX_LABELS];
            if (about == 0) integral[i] = TXS_LAY_NEVER * nat;
        }
    }
}

static txs_lay_sampler *txs_lay_sampler_make(txm_arena *arena, const txs_lay_level *level,
                                             const txs_lay_view *view, int labels, int max_types,
                                             const int16_t *noise, uint64_t seed) {
    const size_t n = (size_t)max_types;
    txs_lay_sampler *s = (txs_lay_sampler *)txm_arena_zero(arena, 1, sizeof *s);
    if (!s) return NULL;
    s->level = level;
    s->view = *view;
    s->labels = labels;
    s->noise = noise;
    s->seed = seed;
    s->heat = TXS_LAY_HOT;
    s->count = (int32_t(*)[TXS_LAY_BINS])txm_arena_zero(arena, n, sizeof *s->count);
    s->integral = (int32_t(*)[TXS_LAY_BINS])txm_arena_zero(arena, n, sizeof *s->integral);
    s->table = (int16_t(*)[2][TXS_LAY_TABLE])txm_arena_zero(arena, n, sizeof *s->table);
    for (int k = 0; k < level->type_count && s->integral; k++)
        txs_lay_forbid(&level->types[k], labels, view->field, s->integral[k]);
    for (int r = 0; r < TXS_LAY_RINGS; r++) {
        txs_lay_plane *p = &s->alike[r];
        *p = *view->map;
        p->pixels = (uint8_t *)txm_arena_alloc(arena, txs_lay_bytes(p), 1);
        if (p->pixels) memset(p->pixels, TXS_OUTSIDE, txs_lay_bytes(p));
    }
    if (view->parent) {
        s->plain =
            (uint8_t *)txm_arena_alloc(arena, (size_t)view->map->width, (size_t)view->map->height);
        if (s->plain) txs_lay_find_plain(view->parent, s->plain);
    }
    return arena->failed ? NULL : s;
}

/* ---- learning and synthesising label maps ---------------------------------------------------

   As with values [1, section 3]: on every level of a pyramid a map is synthesised with the clique
   types so far, the types whose histograms differ most are added, and so on. */
enum {
    TXS_LAY_ADDED = 20,      /* types that are chosen on the coarsest level */
    TXS_LAY_ADDED_BELOW = 6, /* and on the others                           */
    TXS_LAY_BATCH = 4,       /* of them at once                             */
    TXS_LAY_SETTLE = 6,      /* sweeps before types are compared            */
    TXS_LAY_COOL = 5         /* heat of the last sweep */
};

#define TXS_LAY_DOUBT \
    0.2f /* distance of histograms that means nothing, with a single piece; ours */

/* Weights of labels that make the shares of a coarse map those of the whole: where each block
   takes its most frequent label alone, what is thin or scattered would be lost. */
typedef struct txs_lay_blocks {
    int width, height, labels;
    const float *share; /* of each label in each block */
    double bias[TXS_MAX_LABELS];
} txs_lay_blocks;

static int txs_lay_strongest(const txs_lay_blocks *b, size_t block) {
    const float *share = b->share + block * (size_t)b->labels;
    int best = 0;
    double most = -1e300;
    double known = 0;
    for (int v = 0; v < b->labels; v++) {
        const double weight = (double)share[v] + b->bias[v];
        known += (double)share[v];
        if (share[v] > 0 && weight > most) {
            most = weight;
            best = v;
        }
    }
    return known > 0 ? best : (int)TXS_OUTSIDE;
}

static void txs_lay_balance(txs_lay_blocks *b, const double *wanted) {
    enum { ROUNDS = 24 };
    const size_t blocks = (size_t)b->width * (size_t)b->height;
    double gain = 0.5;
    memset(b->bias, 0, sizeof b->bias);
    for (int round = 0; round < ROUNDS; round++, gain *= 0.85) {
        double count[TXS_MAX_LABELS] = {0}, known = 0;
        for (size_t i = 0; i < blocks; i++) {
            const int label = txs_lay_strongest(b, i);
            if (label == TXS_OUTSIDE) continue;
            count[label]++;
            known++;
        }
        for (int v = 0; v < b->labels && known > 0; v++) {
            /* a label with a small share reacts to a small error */
            const double off = wanted[v] - count[v] / known;
            b->bias[v] += gain * off / (wanted[v] + 0.1);
        }
    }
}

/* The map at 1 / 2^level of its size. */
static txm_status txs_lay_shrink(const txs_lay_plane *full, int labels, const double *wanted,
                                 int level, txs_lay_plane *out, txm_env *env) {
    const int side = 1 << level;
    txs_lay_blocks b;
    txm_arena arena;
    txm_arena_init(&arena, env);
    memset(&b, 0, sizeof b);
    b.width = (full->width + side - 1) / side;
    b.height = (full->height + side - 1) / side;
    b.labels = labels;
    const size_t blocks = (size_t)b.width * (size_t)b.height;
    float *share = (float *)txm_arena_zero(&arena, blocks, (size_t)labels * sizeof *share);
    if (!share || !txs_lay_plane_make(out, env, b.width, b.height, full->wrap_x, full->wrap_y)) {
        txm_arena_free(&arena);
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the label map");
    }
    for (int y = 0; y < full->height; y++) {
        for (int x = 0; x < full->width; x++) {
            const int label = *txs_lay_at(full, x, y);
            const size_t block = (size_t)(y / side) * (size_t)b.width + (size_t)(x / side);
            if (label != TXS_OUTSIDE)
                share[block * (size_t)labels + (size_t)label] += 1.0f / (float)(side * side);
        }
    }
    b.share = share;
    if (level > 0) txs_lay_balance(&b, wanted);
    for (int y = 0; y < b.height; y++)
        for (int x = 0; x < b.width; x++)
            txs_lay_set(out, x, y,
                        (uint8_t)txs_lay_strongest(&b, (size_t)y * (size_t)b.width + (size_t)x));
    txm_arena_free(&arena);
    return TXM_OK;
}

/* A coarse map at twice its size. */
static int txs_lay_double(const txs_lay_plane *coarse, int width, int height, txs_lay_plane *out,
                          const txm_env *env) {
    if (!txs_lay_plane_make(out, env, width, height, coarse->wrap_x, coarse->wrap_y)) return 0;
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) txs_lay_set(out, x, y, *txs_lay_at(coarse, x >> 1, y >> 1));
    return 1;
}

static txs_lay_type *txs_lay_add(txs_lay_level *l, int kind, int dx, int dy) {
    TEXSYN_ASSERT(l->type_count < TXS_LAY_TYPES);
    txs_lay_type *t = &l->types[l->type_count++];
    memset(t, 0, sizeof *t);
    t->kind = kind;
    t->dx = dx;
    t->dy = dy;
    return t;
}

/* The types that every level has. */
static void txs_lay_preselect(txs_lay_level *l, const txs_lay_view *source) {
    int32_t count[TXS_LAY_BINS];
    l->type_count = 0;
    txs_lay_add(l, TXS_LAY_FIELD, 0, 0);
    txs_lay_add(l, TXS_LAY_PAIR, 1, 0);
    txs_lay_add(l, TXS_LAY_PAIR, 0, 1);
    txs_lay_add(l, TXS_LAY_PAIR, 1, 1);
    txs_lay_add(l, TXS_LAY_PAIR, -1, 1);
    for (int i = 0; i < TXS_LAY_RINGS; i++) txs_lay_add(l, TXS_LAY_RING, 1 << i, 0);
    for (int i = 0; i < 4 && source->parent; i++) txs_lay_add(l, TXS_LAY_PARENT, i & 1, i >> 1);
    int kept = 0;
    for (int k = 0; k < l->type_count; k++) {
        const int64_t n = txs_lay_count(source, &l->types[k], count);
        txs_lay_normalise(source, &l->types[k], count, l->types[k].share);
        if (n > 0) l->types[kept++] = l->types[k]; /* a small map may have no such clique */
    }
    l->type_count = kept;
}

/* How many connected pieces of one label a map has; -1 without memory. */
static int txs_lay_pieces(const txs_lay_plane *map, txm_arena *arena) {
    const size_t pixels = (size_t)map->width * (size_t)map->height;
    uint8_t *seen = (uint8_t *)txm_arena_zero(arena, pixels, 1);
    int32_t *stack = (int32_t *)txm_arena_alloc(arena, pixels, sizeof *stack);
    int pieces = 0;
    if (arena->failed) return -1;
    for (int i = 0; i < map->width * map->height; i++) {
        int count = 1;
        if (seen[i] || *txs_lay_at(map, i % map->width, i / map->width) == TXS_OUTSIDE) continue;
        pieces++;
        seen[i] = 1;
        stack[0] = i;
        while (count) { /* a pixel is put on the stack once, so it cannot overflow */
            const int x = stack[--count] % map->width, y = stack[count] / map->width;
            for (int k = 0; k < 4; k++) {
                const int nx = x + (k == 0) - (k == 1), ny = y + (k == 2) - (k == 3);
                const int32_t at = ny * map->width + nx;
                if (nx < 0 || ny < 0 || nx >= map->width || ny >= map->height || seen[at] ||
                    *txs_lay_at(map, nx, ny) != *txs_lay_at(map, x, y))
                    continue;
                seen[at] = 1;
                TEXSYN_ASSERT((size_t)count < pixels);
                stack[count++] = at;
            }
        }
    }
    return pieces;
}

/* Does an axis wrap? A border lacks the pairs that lead across it, and so attracts some labels and
   repels others; a torus has none. Not along a field, whose ends differ, nor where pairs would reach
   round. side: of the coarsest level. */
static int txs_lay_wraps(int field, int axis, int side) {
    return field != axis && side > 2 * TXS_LAY_REACH;
}

/* Add the pairs whose histograms differ most from the source's, and by more than threshold; returns
   how many. */
static int txs_lay_add_worst(txs_lay_level *l, const txs_lay_view *source, const txs_lay_view *map,
                             txs_lay_type *candidates, float *distance, int count, int most,
                             float threshold) {
    int32_t counts[TXS_LAY_BINS], share[TXS_LAY_BINS];
    int added = 0;
    for (int i = 0; i < count; i++) {
        txs_lay_type *c = &candidates[i];
        if (txs_lay_count(source, c, counts) == 0) {
            distance[i] = 0;
            continue;
        }
        txs_lay_normalise(source, c, counts, c->share);
        txs_lay_count(map, c, counts);
        txs_lay_normalise(map, c, counts, share);
        double sum = 0;
        for (int k = 0; k < TXS_LAY_BINS; k++) {
            const double off = (double)(share[k] - c->share[k]) / (double)TXS_ONE;
            sum += off * off;
        }
        distance[i] = txm_float(sqrt(sum));
    }
    for (; added < most && l->type_count < TXS_LAY_TYPES; added++) {
        int worst = 0;
        for (int i = 1; i < count; i++)
            if (distance[i] > distance[worst]) worst = i;
        if (count == 0 || !(distance[worst] > threshold)) break;
        const txs_lay_type chosen = candidates[worst];
        TEXSYN_ASSERT(l->type_count < TXS_LAY_TYPES);
        l->types[l->type_count++] = chosen;
        for (int i = 0; i < count; i++) /* its neighbours say the same */
            if (abs(candidates[i].dx - chosen.dx) <= 1 && abs(candidates[i].dy - chosen.dy) <= 1)
                distance[i] = 0;
    }
    return added;
}

/* Start a level's map: from the coarser one, or at random by the field. */
static void txs_lay_start(const txs_lay_view *v, const txs_lay_level *l, int labels,
                          uint64_t seed) {
    txm_rng rng = txm_rng_make(seed, 5);
    for (int y = 0; y < v->map->height; y++) {
        for (int x = 0; x < v->map->width; x++) {
            if (v->parent) {
                txs_lay_set(v->map, x, y, *txs_lay_at(v->parent, x, y));
                continue;
            }
            const int32_t *share = l->types[0].share + txs_lay_band(v, x, y) * TXS_MAX_LABELS;
            int32_t total = 0;
            int label = 0;
            for (int k = 0; k < labels; k++) total += share[k];
            int32_t left = total > 0 ? (int32_t)txm_rng_below(&rng, (uint32_t)total) : 0;
            while (label < labels - 1 && left >= share[label]) left -= share[label++];
            txs_lay_set(v->map, x, y, (uint8_t)label);
        }
    }
}

/* Learn one level: source is the example's map, with the true coarser map as its parent. at: the
   fraction of the whole that is done. */
static txm_status txs_lay_learn_level(txs_lay_level *l, int labels, const txs_lay_view *source,
                                      const int16_t *noise, uint64_t seed, txm_env *env, float at) {
    const int side =
        source->map->width < source->map->height ? source->map->width : source->map->height;
    const int reach = source->parent ? (int)TXS_LAY_NEAR : txm_clampi(side / 3, 2, TXS_LAY_REACH);
    const int most = source->parent ? (int)TXS_LAY_ADDED_BELOW : (int)TXS_LAY_ADDED;
    const size_t capacity = (size_t)(2 * reach + 1) * (size_t)(reach + 1); /* half a square */
    txs_lay_plane map;
    txs_lay_view view = *source;
    txm_status status = TXM_OK;
    txm_arena arena;
    int candidate_count = 0, sweep = 0;
    txm_arena_init(&arena, env);
    txs_lay_type *candidates = (txs_lay_type *)txm_arena_zero(&arena, capacity, sizeof *candidates);
    float *distance = (float *)txm_arena_zero(&arena, capacity, sizeof *distance);
    const int pieces = txs_lay_pieces(source->map, &arena);
    /* a map of few pieces has little to say about where they lie */
    const float doubt = TXS_LAY_DOUBT / txm_float(sqrt((double)(pieces > 0 ? pieces : 1)));
    const float threshold = txm_maxf(doubt, TXS_THRESHOLD);
    const int wraps = !source->parent;
    const int room = txs_lay_plane_make(
        &map, env, source->map->width, source->map->height,
        wraps && txs_lay_wraps(source->field, TXS_LAY_COLUMNS, source->map->width),
        wraps && txs_lay_wraps(source->field, TXS_LAY_ROWS_FIELD, source->map->height));
    view.map = &map;
    txs_lay_sampler *s = txs_lay_sampler_make(&arena, l, &view, labels, TXS_LAY_TYPES, noise, seed);
    if (!room || !s || arena.failed) {
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to learn the label map");
        goto done;
    }
    txs_lay_preselect(l, source);
    for (int y = 0; y <= reach; y++) {
        for (int x = -reach; x <= reach; x++) {
            if ((y == 0 && x <= 0) || x * x + y * y > reach * reach || abs(x) + y <= 1) continue;
            TEXSYN_ASSERT((size_t)candidate_count < capacity);
            candidates[candidate_count].kind = TXS_LAY_PAIR;
            candidates[candidate_count].dx = x;
            candidates[candidate_count++].dy = y;
        }
    }
    txs_lay_start(&view, l, labels, seed);
    for (int left = most; left > 0;) {
        txs_lay_sampler_start(s);
        for (int i = 0; i < TXS_LAY_SETTLE; i++) {
            if (txm_progress(env, at, "layout")) {
                status = txm_fail(env, TXM_CANCELLED, "stopped by the progress callback");
                goto done;
            }
            txs_lay_sweep(s, sweep++);
        }
        const int added =
            txs_lay_add_worst(l, source, &view, candidates, distance, candidate_count,
                              left < TXS_LAY_BATCH ? left : (int)TXS_LAY_BATCH, threshold);
        if (added == 0) break;
        left -= added;
    }
done:
    txs_lay_plane_free(&map, env);
    txm_arena_free(&arena);
    return status;
}

/* How much the band tells about the label: mutual information over the labels' entropy. */
static double txs_lay_order(const txs_lay_plane *map, int field, int labels) {
    int32_t count[TXS_LAY_BINS];
    const txs_lay_view view = {map, NULL, field};
    const txs_lay_type type = {TXS_LAY_FIELD, 0, 0, {0}, {0}};
    const double total = (double)txs_lay_count(&view, &type, count);
    double mutual = 0, entropy = 0, share[TXS_MAX_LABELS] = {0};
    for (int i = 0; i < TXS_LAY_BINS; i++) share[i % TXS_MAX_LABELS] += count[i] / total;
    for (int v = 0; v < labels; v++)
        if (share[v] > 0) entropy -= share[v] * log(share[v]);
    for (int row = 0; row < TXS_MAX_LABELS; row++) {
        double band = 0;
        for (int v = 0; v < labels; v++) band += count[row * TXS_MAX_LABELS + v] / total;
        for (int v = 0; v < labels; v++) {
            const double joint = count[row * TXS_MAX_LABELS + v] / total;
            if (joint > 0) mutual += joint * log(joint / (band * share[v]));
        }
    }
    return entropy > 0 ? mutual / entropy : 0;
}

/* ---- synthesis of a label map ---------------------------------------------------------------- */

static int txs_lay_sweeps(int level, int quality) {
    static const int sweeps[5][3] = {
        {4, 6, 16}, {6, 8, 24}, {9, 12, 40}, {12, 18, 60}, {18, 24, 90}};
    return sweeps[quality + 2][level > 2 ? 2 : level];
}

/* The types of a level for a picture of this size. 0 without memory. */
static int txs_lay_fit(const txs_layout *layout, int index, int width, int height, txm_arena *arena,
                       txs_lay_level *fitted) {
    const txs_lay_level *l = &layout->level[index];
    const int side = layout->field == 1 ? height : width;
    const int side_then = (layout->field == 1 ? layout->height : layout->width) >> index;
    *fitted = *l;
    fitted->types = (txs_lay_type *)txm_arena_alloc(arena, (size_t)l->type_count, sizeof *l->types);
    if (!fitted->types) return 0;
    memcpy(fitted->types, l->types, sizeof *l->types * (size_t)l->type_count);
    if (!layout->field || side == side_then) return 1;
    for (int k = 0; k < l->type_count; k++) {
        txs_lay_type *t = &fitted->types[k];
        const int d = layout->field == 1 ? t->dy : t->dx;
        if (t->kind == TXS_LAY_PAIR && d != 0)
            txs_lay_fit_pair(t, l->types[0].share, layout->labels,
                             (double)(d * (int)TXS_BANDS_OF_FIELD) / side_then,
                             (double)(d * (int)TXS_BANDS_OF_FIELD) / side);
    }
    return 1;
}

/* Synthesise a map of any size into out, which the caller frees. Fraction from..to of the whole. */
static txm_status txs_layout_make(const txs_layout *layout, int width, int height, int quality,
                                  const int16_t *noise, uint64_t seed, txs_lay_plane *out,
                                  txm_env *env, float from, float to) {
    float work = 0, done = 0;
    for (int i = 0; i < layout->levels; i++) work += 1.0f / (float)(1 << 2 * i);
    txs_lay_plane coarse, parent;
    const int top_level = layout->levels - 1;
    const int wrap_x = txs_lay_wraps(layout->field, TXS_LAY_COLUMNS, width >> top_level);
    const int wrap_y = txs_lay_wraps(layout->field, TXS_LAY_ROWS_FIELD, height >> top_level);
    memset(&coarse, 0, sizeof coarse);
    memset(out, 0, sizeof *out);
    for (int i = layout->levels - 1; i >= 0; i--) {
        txs_lay_level fitted;
        const int w = (width + (1 << i) - 1) >> i, h = (height + (1 << i) - 1) >> i;
        const int top = i + 1 == layout->levels;
        txm_arena arena;
        txm_status status = TXM_OK;
        memset(&parent, 0, sizeof parent);
        txm_arena_init(&arena, env);
        int room = txs_lay_plane_make(out, env, w, h, wrap_x, wrap_y);
        if (room && !top) room = txs_lay_double(&coarse, w, h, &parent, env);
        const txs_lay_view view = {out, top ? NULL : &parent, layout->field};
        if (room) room = txs_lay_fit(layout, i, w, h, &arena, &fitted);
        txs_lay_sampler *s =
            room ? txs_lay_sampler_make(&arena, &fitted, &view, layout->labels, fitted.type_count,
                                        noise, txm_hash(seed + (uint64_t)i))
                 : NULL;
        if (!s) status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the label map");
        else {
            txs_lay_start(&view, &fitted, layout->labels, seed);
            txs_lay_sampler_start(s);
        }
        const int sweeps = txs_lay_sweeps(top ? 2 : i > 0, quality);
        for (int k = 0; k < sweeps && status == TXM_OK; k++) {
            const float part = (done + (float)k / (float)sweeps / (float)(1 << 2 * i)) / work;
            if (txm_progress(env, from + (to - from) * part, "layout"))
                status = txm_fail(env, TXM_CANCELLED, "stopped by the progress callback");
            else {
                if (k + 1 == sweeps) s->heat = TXS_LAY_COOL;
                txs_lay_sweep(s, k);
            }
        }
        txm_arena_free(&arena);
        txs_lay_plane_free(&parent, env);
        txs_lay_plane_free(&coarse, env);
        if (status != TXM_OK) {
            txs_lay_plane_free(out, env);
            return status;
        }
        coarse = *out;
        done += 1.0f / (float)(1 << 2 * i);
    }
    return TXM_OK;
}

/* Learn a label map; the layout's types lie in the arena. field: 0 to 2 as in the layout, or -1 to
   find it out. Fraction from..to of the whole. */
static txm_status txs_layout_learn(const txs_lay_plane *full, int labels, int field,
                                   const int16_t *noise, uint64_t seed, txm_arena *arena,
                                   txs_layout *layout, txm_env *env, float from, float to) {
    const double ordered = 0.25; /* of a label's entropy that its band explains */
    const int side = full->width < full->height ? full->width : full->height;
    txs_lay_plane map[TXS_LAY_LEVELS], parent;
    txm_status status = TXM_OK;
    double known = 0, share[TXS_MAX_LABELS] = {0};
    memset(layout, 0, sizeof *layout);
    memset(map, 0, sizeof map);
    memset(&parent, 0, sizeof parent);
    layout->labels = labels;
    layout->width = full->width;
    layout->height = full->height;
    layout->levels = 1;
    while (layout->levels < TXS_LAY_LEVELS && side >> layout->levels >= TXS_LAY_TOP)
        layout->levels++;
    for (int y = 0; y < full->height; y++) {
        for (int x = 0; x < full->width; x++) {
            const int label = *txs_lay_at(full, x, y);
            if (label == TXS_OUTSIDE) continue;
            share[label]++;
            known++;
        }
    }
    for (int v = 0; v < labels; v++) share[v] /= known;
    if (field < 0) {
        const double rows = txs_lay_order(full, 1, labels),
                     columns = txs_lay_order(full, 2, labels);
        layout->field = rows >= columns && rows > ordered ? 1 : columns > ordered ? 2 : 0;
    } else layout->field = field;

    for (int i = 0; i < layout->levels && status == TXM_OK; i++)
        status = txs_lay_shrink(full, labels, share, i, &map[i], env);
    for (int i = layout->levels - 1; i >= 0 && status == TXM_OK; i--) {
        const int top = i + 1 == layout->levels;
        const txs_lay_view source = {&map[i], top ? NULL : &parent, layout->field};
        layout->level[i].types =
            (txs_lay_type *)txm_arena_zero(arena, TXS_LAY_TYPES, sizeof(txs_lay_type));
        if (!layout->level[i].types ||
            (!top && !txs_lay_double(&map[i + 1], map[i].width, map[i].height, &parent, env)))
            status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to learn the label map");
        else
            status = txs_lay_learn_level(&layout->level[i], labels, &source, noise,
                                         txm_hash(seed + (uint64_t)i), env,
                                         from + (to - from) / (float)(1 << 2 * i));
        txs_lay_plane_free(&parent, env);
    }
    for (int i = 0; i < TXS_LAY_LEVELS; i++) txs_lay_plane_free(&map[i], env);
    return status;
}

/* ---- composite textures ----------------------------------------------------------------------

   A composite texture is a label map, itself a texture, and a texture for each label [1, section
   4]. All its textures are learned and synthesised in one run, as a mosaic, with crossing types for
   what happens where two of them meet. */
enum {
    TXS_COMPOSITE_TOP = 64,     /* pixels: short side of the coarsest level, about */
    TXS_COMPOSITE_FEW = 256,    /* pixels: a label with fewer cannot be learned    */
    TXS_COMPOSITE_SPARSE = 64,  /* pixels: with fewer a coarse level is left out   */
    TXS_COMPOSITE_CANVAS = 320, /* pixels: a side of what is synthesised to learn  */
    TXS_COMPOSITE_TYPES = 10,   /* clique types per label and level                */
    TXS_COMPOSITE_REFRESH = 4,  /* sub-lattices                                    */
    TXS_COMPOSITE_SOFT = 400,   /* pixels, see txs_soften                          */
    TXS_CROSS_SCALE = 20,       /* steps of the root of a share of a crossing type */
    TXS_CROSS_DOUBT = 2,        /* square steps, added to shares before they are compared */
    TXS_COMPOSITE_COOL = 30     /* percent: temperature of the last sweep          */
};

struct texsyn_composite {
    txm_arena arena; /* holds all of it */
    int channels, labels, levels;
    txs_layout layout;
    texsyn_model *model[TXS_MAX_LABELS];
    txs_crossing *crossing[TXS_MAX_LEVELS]; /* TXS_MAX_CROSSINGS at most */
    int crossings[TXS_MAX_LEVELS];
};

/* What learning works with. */
typedef struct txs_composer {
    const texsyn_composite_learn_desc *desc;
    texsyn_composite *composite;
    txm_image example;
    txs_ground source[TXS_MAX_LEVELS], canvas[TXS_MAX_LEVELS];
    txs_mosaic from, from_above, to, to_above; /* of the source, of the canvas */
    txs_raise_map *maps;
    int16_t *noise, *cool;
} txs_composer;

/* Room for a composite whose models have all their types. */
static texsyn_composite *txs_composite_make(txm_env *env, int channels, int labels) {
    txm_arena arena;
    txm_arena_init(&arena, env);
    texsyn_composite *c = (texsyn_composite *)txm_arena_zero(&arena, 1, sizeof *c);
    if (!c) return NULL;
    c->channels = channels;
    c->labels = labels;
    for (int k = 0; k < labels; k++) c->model[k] = txs_fill_model_make(&arena, channels);
    for (int i = 0; i < TXS_MAX_LEVELS; i++)
        c->crossing[i] =
            (txs_crossing *)txm_arena_zero(&arena, TXS_MAX_CROSSINGS, sizeof(txs_crossing));
    if (arena.failed) {
        txm_arena_free(&arena);
        return NULL;
    }
    c->arena = arena;
    return c;
}

/* ---- learning a composite: the example ------------------------------------------------------- */

/* A level on which a label has too few pixels: it is of one colour there, the mean. */
static void txs_composite_blank(texsyn_model *m, int index) {
    txs_level *l = &m->level[index];
    l->type_count = 0;
    for (int b = 0; b < m->bands; b++) {
        txs_type *t = txs_add_type(l, TEXSYN_SINGLE, b, b, 0, 0);
        l->values[b] = 1;
        l->low[b] = 0;
        l->step[b] = 1;
        t->share[0] = TXS_ONE;
        txs_make_classes(m, l, b);
    }
}

static size_t txs_composite_count(const txs_ground *g, int label) {
    const size_t pixels = (size_t)g->width * (size_t)g->height;
    size_t count = 0;
    for (size_t i = 0; i < pixels; i++) count += g->label[i] == label;
    return count;
}

/* The pyramid of the example, and how its bands are quantised. */
static txm_status txs_composite_prepare(txs_composer *w, txm_arena *arena, txm_env *env) {
    texsyn_composite *c = w->composite;
    txs_ground *g = w->source;
    const size_t pixels = (size_t)g->width * (size_t)g->height;
    const int side = g->width < g->height ? g->width : g->height;
    uint8_t *bytes = (uint8_t *)txm_arena_alloc(arena, pixels, (size_t)c->channels);
    float *values = (float *)txm_arena_alloc(arena, pixels, (size_t)c->channels * sizeof *values);
    if (arena->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the example");
    for (int k = 0; k < c->labels; k++)
        txs_ground_find_bands(&g[0], &w->example, k, c->model[k], bytes);
    txs_ground_split(&g[0], &w->example, c->model);
    if (!txs_ground_show(&g[0], c->model, c->labels, arena))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the example");
    c->levels = 1;
    while (c->levels < TXS_MAX_LEVELS && side >> c->levels >= TXS_COMPOSITE_TOP) {
        const txs_ground *fine = &g[c->levels - 1];
        if (!txs_ground_make(&g[c->levels], arena, (fine->width + 1) / 2, (fine->height + 1) / 2,
                             c->channels, 1))
            return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the example");
        txs_ground_halve(fine, &g[c->levels++]);
    }
    for (int k = 0; k < c->labels; k++) {
        texsyn_model *m = c->model[k];
        m->levels = c->levels;
        for (int i = 0; i < c->levels; i++) {
            if (txs_composite_count(&g[i], k) < TXS_COMPOSITE_SPARSE) txs_composite_blank(m, i);
            else
                txs_ground_quantise(&g[i], k, m->bands, &m->level[i], values, bytes,
                                    i ? NULL : m->dither);
        }
    }
    return TXM_OK;
}

/* ---- learning a composite: the levels -------------------------------------------------------- */

/* Labels of a ground from a map; all is to be synthesised. */
static int txs_composite_ground(txs_ground *g, txm_arena *arena, const txs_lay_plane *map,
                                int bands) {
    if (!txs_ground_make(g, arena, map->width, map->height, bands, 0)) return 0;
    for (int y = 0; y < g->height; y++) {
        for (int x = 0; x < g->width; x++) {
            const int label = *txs_lay_at(map, x, y);
            const size_t i = (size_t)y * (size_t)g->width + (size_t)x;
            g->label[i] = (uint8_t)(label == TXS_OUTSIDE ? (int)TXS_NO_LABEL : label);
            g->state[i] = TXS_FREE;
        }
    }
    return 1;
}

static int txs_composite_pyramid(txs_ground *g, txm_arena *arena, int levels) {
    for (int i = 1; i < levels; i++) {
        if (!txs_ground_make(&g[i], arena, (g[i - 1].width + 1) / 2, (g[i - 1].height + 1) / 2,
                             g[i - 1].bands, 0))
            return 0;
        txs_ground_halve(&g[i - 1], &g[i]);
    }
    return 1;
}

/* The textures of all labels on a level. */
static void txs_composite_textures(const texsyn_composite *c, int index, txs_texture *texture) {
    for (int k = 0; k < c->labels; k++) {
        texture[k].model = c->model[k];
        texture[k].level = &c->model[k]->level[index];
    }
}

/* The canvas of a level, started from the one above, which is freed. */
static txm_status txs_composite_enter(const texsyn_composite *c, int index, const txs_ground *g,
                                      txs_mosaic *m, txs_mosaic *above, txs_raise_map *maps,
                                      uint64_t seed, txm_env *env) {
    txs_texture texture[TXS_MAX_LABELS], coarser[TXS_MAX_LABELS];
    const int has_parents = above->canvas.pixels != NULL;
    int reach = TXS_NEAR;
    txs_composite_textures(c, index, texture);
    for (int k = 0; k < c->labels; k++)
        for (int i = 0; i < texture[k].level->type_count; i++)
            if (txs_reach(&texture[k].level->types[i]) > reach)
                reach = txs_reach(&texture[k].level->types[i]);
    if (!txs_mosaic_make(m, env, &g[index], c->labels, reach, has_parents))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the canvas");
    txs_mosaic_lay(m, &g[index], texture, seed);
    if (has_parents) {
        txs_composite_textures(c, index + 1, coarser);
        txs_mosaic_raise(m, above, coarser, texture, maps);
        txs_mosaic_free(above, env);
    }
    return TXM_OK;
}

static txm_status txs_composite_level(txs_composer *w, int index, txm_env *env, float from,
                                      float to) {
    texsyn_composite *c = w->composite;
    const uint64_t seed = txm_hash(w->desc->seed + (uint64_t)index);
    const int types = w->desc->max_types ? w->desc->max_types : (int)TXS_COMPOSITE_TYPES;
    const txs_study_plan plan = {6,
                                 3,
                                 10,
                                 types,
                                 6,
                                 TXS_NEAR,
                                 TXS_COMPOSITE_REFRESH,
                                 TXS_COMPOSITE_SOFT,
                                 c->labels > 1 && index < 2,
                                 seed,
                                 w->noise,
                                 NULL,
                                 NULL};
    txm_status status =
        txs_composite_enter(c, index, w->source, &w->from, &w->from_above, w->maps, seed, env);
    if (status == TXM_OK)
        status = txs_composite_enter(c, index, w->canvas, &w->to, &w->to_above, w->maps, seed, env);
    if (status == TXM_OK)
        status = txs_mosaic_learn(&plan, index, c->model, &w->from, &w->to, c->crossing[index],
                                  &c->crossings[index], env, from, to);
    w->from_above = w->from;
    w->to_above = w->to;
    memset(&w->from, 0, sizeof w->from);
    memset(&w->to, 0, sizeof w->to);
    return status;
}

/* What is kept of a crossing type: the roots of its shares, coarsely; no potentials, which the
   control finds again in a few sweeps. */
static void txs_cross_round(txs_type *t) {
    for (int i = 0; i < TXS_BINS; i++)
        t->root[i] = (int16_t)floor(
            sqrt((double)t->share[i] / (double)TXS_ONE) * (double)TXS_CROSS_SCALE + 0.5);
}

/* The inverse, and potentials to start from: half of what the log of a share over that by chance
   says, the rest being said by other types. 0 for an empty histogram. */
static int txs_cross_unround(txs_type *t) {
    const double doubt = TXS_CROSS_DOUBT;
    int32_t total = 0, tail[TXS_CLASSES] = {0}, head[TXS_CLASSES] = {0};
    for (int i = 0; i < TXS_BINS; i++) {
        const int32_t square = t->root[i] * t->root[i];
        total += square;
        tail[i / TXS_CLASSES] += square;
        head[i % TXS_CLASSES] += square;
    }
    for (int i = 0; i < TXS_BINS && total; i++) {
        const double square = t->root[i] * t->root[i];
        const int a = i / TXS_CLASSES, b = i % TXS_CLASSES;
        const double chance = (double)tail[a] * head[b] / total;
        t->share[i] = (int32_t)((int64_t)t->root[i] * t->root[i] * TXS_ONE / total);
        t->potential[i] =
            (int16_t)floor(-log((square + doubt) / (chance + doubt)) * (double)TXS_NAT / 2 + 0.5);
    }
    return total > 0;
}

/* Round what was measured to what a file keeps, and read that again, so that saving loses nothing. */
static txm_status txs_composite_settle(texsyn_composite *c, txm_env *env, texsyn_composite **out) {
    size_t size = 0;
    for (int i = 0; i < c->layout.levels; i++)
        for (int k = 0; k < c->layout.level[i].type_count; k++)
            txs_lay_round(&c->layout, &c->layout.level[i].types[k]);
    for (int i = 0; i < c->levels; i++) {
        for (int k = 0; k < c->labels; k++)
            for (int j = 0; j < c->model[k]->level[i].type_count; j++)
                txs_round_statistics(&c->model[k]->level[i].types[j], i);
        for (int j = 0; j < c->crossings[i]; j++) txs_cross_round(&c->crossing[i][j].type);
    }
    txm_status status = texsyn_composite_save(c, env, NULL, 0, &size);
    if (status != TXM_OK) return status;
    uint8_t *bytes = (uint8_t *)txm_alloc(env, size);
    if (!bytes) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the composite");
    status = texsyn_composite_save(c, env, bytes, size, &size);
    if (status == TXM_OK) status = texsyn_composite_load(bytes, size, env, out);
    txm_free(env, bytes);
    return status;
}

/* The labels of the example: as given, or found. */
static txm_status txs_composite_labels(const texsyn_composite_learn_desc *d, txs_lay_plane *map,
                                       int *labels, txm_env *env) {
    const txm_image given = txm_image_resolve(d->labels);
    int64_t count[TXS_MAX_LABELS] = {0};
    if (!txs_lay_plane_make(map, env, d->example.width, d->example.height, 0, 0))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the label map");
    *labels = 0;
    for (int y = 0; y < map->height; y++) {
        const uint8_t *row = (const uint8_t *)txm_image_row_const(&given, y);
        for (int x = 0; x < map->width; x++) {
            if (row[x] == TXS_NO_LABEL) continue;
            if (row[x] >= TXS_MAX_LABELS)
                return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                        "labels: # occurs; they must be 0 to 15, or 255 for none",
                                        row[x], 0);
            txs_lay_set(map, x, y, row[x]);
            count[row[x]]++;
            if (row[x] >= *labels) *labels = row[x] + 1;
        }
    }
    if (*labels == 0)
        return txm_fail(env, TXM_TOO_SMALL, "labels: 255 everywhere; nothing can be learned");
    for (int k = 0; k < *labels; k++)
        if (count[k] < TXS_COMPOSITE_FEW)
            return txm_fail_numbers(
                env, TXM_TOO_SMALL,
                "label #: has # pixels; at least 256 (16 x 16) are needed to learn from",
                (uint64_t)k, (uint64_t)count[k]);
    return TXM_OK;
}

static txm_status txs_composite_check(const texsyn_composite_learn_desc *d, txm_env *env) {
    txm_status status;
    if (!d) return txm_fail(env, TXM_BAD_ARGUMENT, "composite: desc is NULL");
    if ((status = txm_image_check(&d->example, "example", TEXSYN_MAX_PIXELS, env)) != TXM_OK)
        return status;
    if (d->example.channels == 2)
        return txm_fail(env, TXM_BAD_ARGUMENT, "example: 2 channels; give 1, 3 or 4");
    if (d->example.width < 32 || d->example.height < 32)
        return txm_fail(env, TXM_TOO_SMALL, "example: smaller than 32 x 32");
    if ((status = txm_image_check(&d->labels, "labels", TEXSYN_MAX_PIXELS, env)) != TXM_OK)
        return status;
    if (d->labels.width != d->example.width || d->labels.height != d->example.height ||
        d->labels.channels > 1 || d->labels.sample != TXM_U8)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "labels: must have 1 channel of 8 bits and the size of the example");
    if (d->max_types < 0 || d->max_types > (int)TXS_MAX_TYPES - (int)TXS_PRESELECTED)
        return txm_fail(env, TXM_BAD_ARGUMENT, "max_types must be 0 to 64");
    if (d->field < TEXSYN_FIELD_AUTO || d->field > TEXSYN_FIELD_COLUMNS)
        return txm_fail(env, TXM_BAD_ARGUMENT, "field is not one of texsyn_field");
    if (d->example.sample == TXM_F32 && !txm_image_is_finite(&d->example))
        return txm_fail(env, TXM_BAD_ARGUMENT, "example: a sample is not finite");
    return TXM_OK;
}

/* Learn everything once the label map is known. */
static txm_status txs_composite_run(txs_composer *w, const txs_lay_plane *map, txm_arena *arena,
                                    txm_env *env) {
    texsyn_composite *c = w->composite;
    const size_t entries = (size_t)TXS_NOISE + TXS_VALUES;
    const int width = txm_clampi(map->width, 1, TXS_COMPOSITE_CANVAS);
    const int height = txm_clampi(map->height, 1, TXS_COMPOSITE_CANVAS);
    txs_lay_plane drawn;
    float total = 0, from = 0.2f;
    w->noise = (int16_t *)txm_arena_alloc(arena, entries, sizeof *w->noise);
    w->maps = (txs_raise_map *)txm_arena_alloc(arena, (size_t)c->labels, sizeof *w->maps);
    if (arena->failed || !txs_composite_ground(&w->source[0], arena, map, c->channels))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the example");
    w->source[0].value = (float *)txm_arena_zero(arena, (size_t)map->width * (size_t)map->height,
                                                 sizeof(float) * (size_t)c->channels);
    if (arena->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the example");
    memset(w->source[0].state, TXS_SOURCE, (size_t)map->width * (size_t)map->height);
    txs_noise_table(w->noise);
    txm_status status = txs_composite_prepare(w, arena, env);
    if (status == TXM_OK)
        status = txs_layout_learn(map, c->labels, (int)w->desc->field - TEXSYN_FIELD_NONE, w->noise,
                                  w->desc->seed, &c->arena, &c->layout, env, 0, 0.15f);
    if (status == TXM_OK)
        status = txs_layout_make(&c->layout, width, height, 0, w->noise, w->desc->seed, &drawn, env,
                                 0.15f, 0.2f);
    if (status != TXM_OK) return status;
    const int room = txs_composite_ground(&w->canvas[0], arena, &drawn, c->channels) &&
                     txs_composite_pyramid(w->canvas, arena, c->levels);
    txs_lay_plane_free(&drawn, env);
    if (!room) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the canvas");
    for (int i = 0; i < c->levels; i++) total += 1.0f / (float)(1 << 2 * i);
    for (int i = c->levels - 1; i >= 0 && status == TXM_OK; i--) {
        const float next = from + 0.8f / (float)(1 << 2 * i) / total;
        status = txs_composite_level(w, i, env, from, i ? next : 1);
        from = next;
    }
    return status;
}

TEXSYN_API txm_status texsyn_composite_learn(const texsyn_composite_learn_desc *desc, txm_env *env,
                                             texsyn_composite **out) {
    if (out) *out = NULL;
    else return txm_fail(env, TXM_BAD_ARGUMENT, "composite: out is NULL");
    txs_lay_plane map;
    txs_composer w;
    txm_arena arena;
    int labels;
    txm_status status = txs_composite_check(desc, env);
    if (status != TXM_OK) return status;
    memset(&w, 0, sizeof w);
    txm_arena_init(&arena, env);
    w.desc = desc;
    w.example = txm_image_resolve(desc->example);
    status = txs_composite_labels(desc, &map, &labels, env);
    if (status == TXM_OK) {
        w.composite = txs_composite_make(env, w.example.channels, labels);
        if (!w.composite) status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the composite");
    }
    if (status == TXM_OK) status = txs_composite_run(&w, &map, &arena, env);
    txs_mosaic_free(&w.from, env);
    txs_mosaic_free(&w.from_above, env);
    txs_mosaic_free(&w.to, env);
    txs_mosaic_free(&w.to_above, env);
    txs_lay_plane_free(&map, env);
    txm_arena_free(&arena);
    if (status == TXM_OK) status = txs_composite_settle(w.composite, env, out);
    texsyn_composite_free(w.composite);
    return status;
}

TEXSYN_API void texsyn_composite_free(texsyn_composite *composite) {
    if (composite) txm_arena_free(&composite->arena);
}

TEXSYN_API int texsyn_composite_label_count(const texsyn_composite *composite) {
    return composite ? composite->labels : 0;
}

TEXSYN_API const texsyn_model *texsyn_composite_model(const texsyn_composite *composite,
                                                      int label) {
    return composite && label >= 0 && label < composite->labels ? composite->model[label] : NULL;
}

/* ---- synthesising a composite ---------------------------------------------------------------- */

static int txs_composite_sweeps(int level, int quality) {
    static const int sweeps[5][3] = {
        {3, 4, 10}, {5, 7, 16}, {9, 12, 24}, {13, 18, 32}, {20, 28, 44}};
    return sweeps[quality + 2][level > 2 ? 2 : level];
}

static txm_status txs_composite_check_desc(const texsyn_composite_desc *d, int channels,
                                           const txm_image *out, txm_env *env) {
    txm_status status;
    if (!d || !d->composite)
        return txm_fail(env, TXM_BAD_ARGUMENT, "composite: desc or composite is NULL");
    if (d->width < 1 || d->height < 1)
        return txm_fail(env, TXM_BAD_ARGUMENT, "width and height must be 1 or more");
    if (d->height > TEXSYN_MAX_PIXELS / d->width)
        return txm_fail(env, TXM_TOO_LARGE, "more than TEXSYN_MAX_PIXELS pixels; make tiles");
    if (d->quality < -2 || d->quality > 2)
        return txm_fail(env, TXM_BAD_ARGUMENT, "quality must be -2 to 2");
    if ((status = txm_image_check(out, "out", 0, env)) != TXM_OK) return status;
    const int has = out->channels ? out->channels : 1;
    if (out->width != d->width || out->height != d->height)
        return txm_fail(env, TXM_BAD_ARGUMENT, "out: must have the size of the synthesis");
    if (channels == 0 && (has != 1 || out->sample != TXM_U8))
        return txm_fail(env, TXM_BAD_ARGUMENT, "out: must have 1 channel of 8 bits");
    if (has == 2 || has < channels)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "out: must have the channels of the composite, or 3 or 4");
    if (!d->layout.pixels) return TXM_OK;
    if ((status = txm_image_check(&d->layout, "layout", TEXSYN_MAX_PIXELS, env)) != TXM_OK)
        return status;
    if (d->layout.width != d->width || d->layout.height != d->height || d->layout.channels > 1 ||
        d->layout.sample != TXM_U8)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "layout: must have 1 channel of 8 bits and the size of the synthesis");
    const txm_image layout = txm_image_resolve(d->layout);
    for (int y = 0; y < d->height; y++) {
        const uint8_t *row = (const uint8_t *)txm_image_row_const(&layout, y);
        for (int x = 0; x < d->width; x++)
            if (row[x] >= d->composite->labels)
                return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                        "layout: label # occurs; the composite has # of them",
                                        row[x], (uint64_t)d->composite->labels);
    }
    return TXM_OK;
}

/* The label map of a synthesis: as drawn, or synthesised. Fraction 0..to of the whole. */
static txm_status txs_composite_map(const texsyn_composite_desc *d, const int16_t *noise,
                                    txs_lay_plane *map, txm_env *env, float to) {
    if (!d->layout.pixels)
        return txs_layout_make(&d->composite->layout, d->width, d->height, d->quality, noise,
                               txm_hash(d->seed), map, env, 0, to);
    const txm_image layout = txm_image_resolve(d->layout);
    if (!txs_lay_plane_make(map, env, d->width, d->height, 0, 0))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the label map");
    for (int y = 0; y < d->height; y++)
        for (int x = 0; x < d->width; x++)
            txs_lay_set(map, x, y, ((const uint8_t *)txm_image_row_const(&layout, y))[x]);
    return TXM_OK;
}

/* The value of a pixel in steps: within its step it is placed by its neighbours where these are
   smooth, at random where they are not, as in synthesis.h. Neighbours of other labels are left out:
   their steps are others. noise: 16 random bits. */
static float txs_composite_value(const txs_mosaic *m, const uint8_t *p, int band, float spread,
                                 unsigned noise) {
    static const int weight[3][3] = {{1, 2, 1}, {2, 4, 2}, {1, 2, 1}};
    const ptrdiff_t plane = band * m->canvas.plane;
    const int label = p[m->label], value = p[plane];
    int smooth = 1, sum = 0, total = 0;
    for (int i = 0; i < 9; i++) {
        const uint8_t *q = p + (i / 3 - 1) * m->canvas.stride + i % 3 - 1;
        if (q[m->label] != label) continue;
        smooth &= abs(q[plane] - value) <= 1;
        sum += weight[i / 3][i % 3] * (q[plane] - value);
        total += weight[i / 3][i % 3];
    }
    const double off = smooth ? sum / (double)total : noise / 65536.0 - 0.5;
    return txm_float(value + txm_clampf(txm_float(off), -0.5f, 0.5f) * (double)spread);
}

typedef struct txs_composite_painter {
    const texsyn_composite_desc *desc;
    const txs_mosaic *mosaic;
    const txm_image *out;
} txs_composite_painter;

/* From the canvas to the picture: some rows of it. */
static void txs_composite_paint(void *context, int share) {
    const txs_composite_painter *w = (const txs_composite_painter *)context;
    const texsyn_composite *c = w->desc->composite;
    const int end = txm_clampi((share + 1) * TXS_PAINT_ROWS, 0, w->out->height);
    for (int y = share * TXS_PAINT_ROWS; y < end; y++) {
        for (int x = 0; x < w->out->width; x++) {
            const uint8_t *p = txs_pixel(w->mosaic, x, y);
            const texsyn_model *t = c->model[p[w->mosaic->label]];
            const txs_level *l = &t->level[0];
            uint64_t noise =
                txm_hash(((uint64_t)(unsigned)y << 32 | (unsigned)x) ^ txm_hash(w->desc->seed));
            double v[4] = {(double)t->mean[0], (double)t->mean[1], (double)t->mean[2],
                           (double)t->mean[3]};
            for (int b = 0; b < t->bands; b++, noise >>= 16) {
                const float at =
                    txs_composite_value(w->mosaic, p, b, t->dither[b], (unsigned)(noise & 0xffff));
                /* a product of two floats is exact in double, contracted or not */
                const float value = txm_float(txs_value(l, b, (double)at));
                for (int k = 0; k < t->channels; k++)
                    v[k] += (double)value * (double)t->basis[b][k];
            }
            for (int k = 0; k < w->out->channels; k++) {
                const double sample = k == 3 && t->channels < 4 ? 255 : v[t->channels == 1 ? 0 : k];
                txm_image_set(w->out, x, y, k, txm_float(sample / 255));
            }
        }
    }
}

/* All levels, coarse first; the finest stays in *m. */
static txm_status txs_composite_sweep(const texsyn_composite_desc *d, txs_ground *ground,
                                      txs_mosaic *m, const int16_t *noise, const int16_t *cool,
                                      txs_raise_map *maps, txm_env *env) {
    const texsyn_composite *c = d->composite;
    txs_texture texture[TXS_MAX_LABELS];
    txs_mosaic above;
    txm_status status = TXM_OK;
    double work = 0, done = 0;
    memset(&above, 0, sizeof above);
    for (int i = 0; i < c->levels; i++)
        work += (double)txs_composite_sweeps(i, d->quality) / (double)(1 << 2 * i);
    for (int i = c->levels - 1; i >= 0 && status == TXM_OK; i--) {
        const int sweeps = txs_composite_sweeps(i, d->quality);
        const double next = done + (double)sweeps / (double)(1 << 2 * i);
        const txs_brush_plan plan = {TXS_MAX_TYPES, TXS_MAX_CROSSINGS, TXS_COMPOSITE_REFRESH,
                                     TXS_COMPOSITE_SOFT, txm_hash(d->seed + (uint64_t)i)};
        status = txs_composite_enter(c, i, ground, m, &above, maps, txm_hash(d->seed) + (uint64_t)i,
                                     env);
        txs_composite_textures(c, i, texture);
        if (status == TXM_OK)
            status = txs_mosaic_run(m, texture, &plan, c->crossing[i], c->crossings[i], sweeps,
                                    noise, i ? NULL : cool, env, (float)(0.2 + 0.8 * done / work),
                                    (float)(0.2 + 0.8 * next / work));
        done = next;
        if (i == 0 || status != TXM_OK) continue;
        above = *m;
        memset(m, 0, sizeof *m);
    }
    txs_mosaic_free(&above, env);
    return status;
}

TEXSYN_API txm_status texsyn_composite_synthesize(const texsyn_composite_desc *desc, txm_env *env,
                                                  txm_image out) {
    txm_status status = txs_composite_check_desc(
        desc, desc && desc->composite ? desc->composite->channels : 1, &out, env);
    if (status != TXM_OK) return status;
    const texsyn_composite *c = desc->composite;
    const size_t entries = (size_t)TXS_NOISE + TXS_VALUES;
    txs_ground ground[TXS_MAX_LEVELS];
    txs_lay_plane map;
    txs_mosaic m;
    txm_arena arena;
    memset(&map, 0, sizeof map);
    memset(&m, 0, sizeof m);
    out = txm_image_resolve(out);
    txm_arena_init(&arena, env);
    int16_t *noise = (int16_t *)txm_arena_alloc(&arena, entries, sizeof *noise);
    int16_t *cool = (int16_t *)txm_arena_alloc(&arena, entries, sizeof *cool);
    txs_raise_map *maps = (txs_raise_map *)txm_arena_alloc(&arena, (size_t)c->labels, sizeof *maps);
    if (arena.failed) status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to synthesise");
    if (status == TXM_OK) {
        txs_noise_table(noise);
        txs_cool_noise(noise, TXS_COMPOSITE_COOL, cool);
        status = txs_composite_map(desc, noise, &map, env, 0.2f);
    }
    if (status == TXM_OK && (!txs_composite_ground(&ground[0], &arena, &map, c->channels) ||
                             !txs_composite_pyramid(ground, &arena, c->levels)))
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to synthesise");
    txs_lay_plane_free(&map, env);
    if (status == TXM_OK) status = txs_composite_sweep(desc, ground, &m, noise, cool, maps, env);
    if (status == TXM_OK) {
        txm_image to;
        status = txs_easel(&out, c->channels == TXS_MAX_BANDS, &arena, env, &to);
        if (status == TXM_OK) {
            txs_composite_painter painter = {desc, &m, &to};
            txm_parallel_for(env, (to.height + TXS_PAINT_ROWS - 1) / TXS_PAINT_ROWS,
                             txs_composite_paint, &painter);
            status = txs_hang(&to, &out, 0, env);
        }
    }
    txs_mosaic_free(&m, env);
    txm_arena_free(&arena);
    return status;
}

TEXSYN_API txm_status texsyn_composite_layout(const texsyn_composite_desc *desc, txm_env *env,
                                              txm_image out) {
    txs_lay_plane map;
    txm_arena arena;
    txm_status status = txs_composite_check_desc(desc, 0, &out, env);
    if (status != TXM_OK) return status;
    memset(&map, 0, sizeof map);
    out = txm_image_resolve(out);
    txm_arena_init(&arena, env);
    int16_t *noise = (int16_t *)txm_arena_alloc(&arena, TXS_NOISE + TXS_VALUES, sizeof *noise);
    if (!noise) status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the label map");
    else {
        txs_noise_table(noise);
        status = txs_composite_map(desc, noise, &map, env, 1);
    }
    for (int y = 0; y < out.height && status == TXM_OK; y++)
        memcpy(txm_image_row(&out, y), txs_lay_at(&map, 0, y), (size_t)out.width);
    txs_lay_plane_free(&map, env);
    txm_arena_free(&arena);
    return status;
}

/* ---- the composite as bytes ------------------------------------------------------------------

   The same code as that of a model (see file.h), over the layout, the models of the labels one
   after the other, and the crossing types. docs/model-format.md describes the bytes.          */

enum { TXS_LAY_SIDE_BITS = 24 };

/* Contexts: of displacements and histograms of the layout by kind, of those of crossing types. */
typedef struct txs_composite_codec {
    txs_context place[2], share[4][8];
    txs_context cross_place[2], cross_share[8];
    txs_codec model;
} txs_composite_codec;

/* Type k of a level. The histogram of the last one of its kind predicts its own. */
static void txs_code_lay_type(txs_coder *c, txs_composite_codec *z, const txs_layout *layout,
                              int level, int k) {
    const txs_lay_level *l = &layout->level[level];
    txs_lay_type *t = &l->types[k];
    int before = k - 1;
    t->kind = txs_limited(c, 2, TXS_LAY_FIELD, TXS_LAY_RING, t->kind);
    if ((t->kind == TXS_LAY_FIELD) != (k == 0)) c->bad = 1;
    if (t->kind == TXS_LAY_PARENT && level + 1 == layout->levels) c->bad = 1;
    if (t->kind != TXS_LAY_FIELD) {
        t->dx = txs_number(c, &z->place[0], t->dx);
        t->dy = txs_number(c, &z->place[1], t->dy);
    }
    if (t->kind == TXS_LAY_RING && ((t->dx != 1 && t->dx != 2 && t->dx != 4) || t->dy)) c->bad = 1;
    if (t->kind == TXS_LAY_PARENT && (t->dx & ~1 || t->dy & ~1)) c->bad = 1;
    if (t->kind == TXS_LAY_PAIR &&
        ((!t->dx && !t->dy) || abs(t->dx) > TXS_LAY_REACH || abs(t->dy) > TXS_LAY_REACH))
        c->bad = 1;
    if (c->bad) return;
    while (before >= 0 && l->types[before].kind != t->kind) before--;
    txs_sequence(c, z->share[t->kind], t->root, before >= 0 ? l->types[before].root : NULL,
                 txs_lay_rows(layout, t->kind) * layout->labels, 0, TXS_LAY_SCALE, TXS_NONE);
    if (!c->bad && !txs_lay_unround(layout, t)) c->bad = 1;
}

/* Returns 0 if there is no memory. */
static int txs_code_layout(txs_coder *c, txs_composite_codec *z, txs_layout *layout,
                           txm_arena *arena) {
    const int most = (1 << TXS_LAY_SIDE_BITS) - 1;
    layout->field = txs_limited(c, 2, 0, 2, layout->field);
    layout->width = txs_limited(c, TXS_LAY_SIDE_BITS, 1, most, layout->width);
    layout->height = txs_limited(c, TXS_LAY_SIDE_BITS, 1, most, layout->height);
    layout->levels = txs_limited(c, 3, 1, TXS_LAY_LEVELS, layout->levels);
    for (int i = layout->levels - 1; i >= 0 && !c->bad; i--) {
        txs_lay_level *l = &layout->level[i];
        if (layout->width >> i == 0 || layout->height >> i == 0) c->bad = 1;
        l->type_count = txs_limited(c, 6, 1, TXS_LAY_TYPES, l->type_count);
        if (c->bad) break;
        if (c->reading)
            l->types =
                (txs_lay_type *)txm_arena_zero(arena, (size_t)l->type_count, sizeof(txs_lay_type));
        if (!l->types) return 0;
        for (int k = 0; k < l->type_count && !c->bad; k++) txs_code_lay_type(c, z, layout, i, k);
    }
    return 1;
}

/* Crossing type k of a level; the last one of the same bands predicts its histogram. */
static void txs_code_crossing(txs_coder *c, txs_composite_codec *z, const texsyn_composite *m,
                              int level, int k) {
    txs_crossing *x = &m->crossing[level][k];
    txs_type *t = &x->type;
    int before = k - 1;
    x->tail = txs_limited(c, 4, 0, m->labels - 1, x->tail);
    x->head = txs_limited(c, 4, 0, m->labels - 1, x->head);
    if (c->bad || x->tail >= x->head) {
        c->bad = 1;
        return;
    }
    t->kind = TEXSYN_VALUES;
    t->band = txs_limited(c, 2, 0, m->model[x->tail]->bands - 1, t->band);
    t->other = txs_limited(c, 2, 0, m->model[x->head]->bands - 1, t->other);
    t->dx = txs_number(c, &z->cross_place[0], t->dx);
    t->dy = txs_number(c, &z->cross_place[1], t->dy);
    if (c->bad || (!t->dx && !t->dy) || abs(t->dx) > TXS_CROSS_REACH ||
        abs(t->dy) > TXS_CROSS_REACH) {
        c->bad = 1;
        return;
    }
    while (before >= 0) {
        const txs_crossing *o = &m->crossing[level][before];
        if (o->tail == x->tail && o->head == x->head && o->type.band == t->band &&
            o->type.other == t->other)
            break;
        before--;
    }
    txs_sequence(c, z->cross_share, t->root,
                 before >= 0 ? m->crossing[level][before].type.root : NULL, TXS_BINS, 0,
                 TXS_CROSS_SCALE, TXS_NONE);
    if (!c->bad && !txs_cross_unround(t)) c->bad = 1;
}

/* May the ends of a level's crossing types be added up at one pixel? */
static int txs_crossings_fit(const texsyn_composite *m, int level) {
    int ends[TXS_MAX_LABELS][TXS_MAX_BANDS] = {{0}};
    for (int i = 0; i < m->crossings[level]; i++) {
        const txs_crossing *x = &m->crossing[level][i];
        if (++ends[x->tail][x->type.band] > TXS_CROSS_ENDS ||
            ++ends[x->head][x->type.other] > TXS_CROSS_ENDS)
            return 0;
    }
    return 1;
}

/* The whole composite, to or from the coder; what reading allocates goes to its arena. Returns 0 if
   there is no memory. */
static int txs_code_composite(txs_coder *c, texsyn_composite *m, txs_composite_codec *z) {
    txs_contexts_init(z->place, 2);
    txs_contexts_init(&z->share[0][0], 4 * 8);
    txs_contexts_init(z->cross_place, 2);
    txs_contexts_init(z->cross_share, 8);
    m->labels = m->layout.labels = txs_limited(c, 5, 1, TXS_MAX_LABELS, m->labels);
    if (c->bad) return 1;
    if (!txs_code_layout(c, z, &m->layout, &m->arena)) return 0;
    for (int k = 0; k < m->labels && !c->bad; k++) {
        if (c->reading) {
            m->model[k] = (texsyn_model *)txm_arena_zero(&m->arena, 1, sizeof *m->model[k]);
            if (!m->model[k]) return 0;
            m->model[k]->arena = m->arena;
        }
        const int room = txs_code_model(c, m->model[k], &z->model);
        if (c->reading) m->arena = m->model[k]->arena;
        if (!room) return 0;
        if (m->model[k]->channels != m->model[0]->channels ||
            m->model[k]->levels != m->model[0]->levels)
            c->bad = 1;
    }
    if (c->bad) return 1;
    m->channels = m->model[0]->channels;
    m->levels = m->model[0]->levels;
    for (int i = 0; i < m->levels && !c->bad; i++) {
        m->crossings[i] = txs_limited(c, 9, 0, TXS_MAX_CROSSINGS, m->crossings[i]);
        if (c->bad) break;
        if (c->reading)
            m->crossing[i] = (txs_crossing *)txm_arena_zero(
                &m->arena, (size_t)(m->crossings[i] ? m->crossings[i] : 1), sizeof(txs_crossing));
        if (!m->crossing[i]) return 0;
        for (int k = 0; k < m->crossings[i] && !c->bad; k++) txs_code_crossing(c, z, m, i, k);
        if (!c->bad && !txs_crossings_fit(m, i)) c->bad = 1;
    }
    return 1;
}

/* ---- public: composites ---------------------------------------------------------------------- */

/* A copy that the coder may write to; NULL without memory. */
static texsyn_composite *txs_composite_copy(const texsyn_composite *from, txm_env *env) {
    texsyn_composite *c = txs_composite_make(env, from->channels, from->labels);
    if (!c) return NULL;
    c->levels = from->levels;
    c->layout = from->layout;
    for (int i = 0; i < from->layout.levels; i++) {
        txs_lay_level *l = &c->layout.level[i];
        const size_t count = (size_t)l->type_count;
        l->types = (txs_lay_type *)txm_arena_alloc(&c->arena, count, sizeof *l->types);
        if (!l->types) {
            texsyn_composite_free(c);
            return NULL;
        }
        memcpy(l->types, from->layout.level[i].types, count * sizeof *l->types);
    }
    for (int k = 0; k < from->labels; k++) {
        texsyn_model *m = c->model[k];
        const texsyn_model *old = from->model[k];
        for (int i = 0; i < TXS_MAX_LEVELS; i++) {
            txs_type *types = m->level[i].types;
            const size_t count = i < old->levels ? (size_t)old->level[i].type_count : 0;
            if (count) memcpy(types, old->level[i].types, count * sizeof *types);
            m->level[i] = old->level[i];
            m->level[i].types = types;
        }
        m->channels = old->channels;
        m->bands = old->bands;
        m->levels = old->levels;
        memcpy(m->mean, old->mean, sizeof m->mean);
        memcpy(m->basis, old->basis, sizeof m->basis);
        memcpy(m->dither, old->dither, sizeof m->dither);
    }
    for (int i = 0; i < from->levels; i++) {
        c->crossings[i] = from->crossings[i];
        memcpy(c->crossing[i], from->crossing[i], sizeof(txs_crossing) * (size_t)c->crossings[i]);
    }
    return c;
}

typedef struct txs_described_composite {
    texsyn_composite *composite;
    txs_composite_codec *codec;
} txs_described_composite;

static void txs_describe_composite(txs_coder *c, void *what) {
    txs_described_composite *m = (txs_described_composite *)what;
    txs_code_composite(c, m->composite, m->codec);
}

TEXSYN_API txm_status texsyn_composite_save(const texsyn_composite *composite, txm_env *env,
                                            void *buffer, size_t capacity, size_t *size) {
    if (!composite || !size)
        return txm_fail(env, TXM_BAD_ARGUMENT, "save: composite or size is NULL");
    txm_status status = TXM_OK;
    txs_composite_codec *z = (txs_composite_codec *)txm_alloc(env, sizeof *z);
    texsyn_composite *copy = z ? txs_composite_copy(composite, env) : NULL;
    if (!copy) status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to save the composite");
    txs_described_composite what = {copy, z};
    if (copy) /* version 1 is that of the labels' models too, which have no filters */
        status = txs_write("TXC", 1, txs_describe_composite, &what, env, buffer, capacity, size);
    texsyn_composite_free(copy);
    txm_free(env, z);
    return status;
}

TEXSYN_API txm_status texsyn_composite_load(const void *data, size_t size, txm_env *env,
                                            texsyn_composite **out) {
    const uint8_t *bytes = (const uint8_t *)data;
    if (out) *out = NULL;
    if (!data || !out) return txm_fail(env, TXM_BAD_ARGUMENT, "load: data or out is NULL");
    if (size < TXS_MAGIC_BYTES + TXS_CRC_BYTES || memcmp(bytes, "TXC1", TXS_MAGIC_BYTES) != 0)
        return txm_fail(env, TXM_BAD_DATA, "not a texsyn composite");
    if (!txs_is_intact(bytes, size))
        return txm_fail(env, TXM_BAD_DATA, "the composite is damaged or cut short");

    txm_arena arena;
    txm_arena_init(&arena, env);
    texsyn_composite *m = (texsyn_composite *)txm_arena_zero(&arena, 1, sizeof *m);
    txs_composite_codec *z = (txs_composite_codec *)txm_alloc(env, sizeof *z);
    txs_coder c = txs_reader(bytes, size);
    int enough = m && z;
    if (m) m->arena = arena;
    if (enough) {
        enough = txs_code_composite(&c, m, z);
        c.bad |= c.at != c.size; /* the coder reads just what was written */
    }
    txm_free(env, z);
    if (enough && !c.bad) {
        *out = m;
        return TXM_OK;
    }
    texsyn_composite_free(m);
    return enough ? txm_fail(env, TXM_BAD_DATA, "the composite's contents contradict each other")
                  : txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to load the composite");
}

/* ---- a change of light ------------------------------------------------------------------

   One curve for the brightness V, the largest of R, G and B, which is applied to all three, and a
   linear map of the chroma. The chroma of a colour is a vector that is 0 for grays and has the
   direction of the hue,

       c = (R - (G + B) / 2, sqrt(3)/2 (G - B)),   s = c / V,   s' = z s + cast * fade(|s|)

   with a complex z, that is, a gain and a rotation. The cast, what another colour of the light adds,
   fades to 0 for grays, so that R = G = B stays so exactly. */

enum { TXS_BINS_OF_LIGHT = 15 }; /* quantiles of brightness that are matched, without the extremes */
#define TXS_FLATTEST 0.25        /* slopes of the curve between two of them                     */
#define TXS_STEEPEST_CURVE 4.0
#define TXS_NEXT_KNOT 0.004      /* quantiles closer than a gray level of 255 become one        */
#define TXS_DIM 0.02             /* V that s is at least divided by                             */
#define TXS_FADE 0.02f           /* |s| from which on the whole cast is added                   */

typedef struct txs_chroma {
    double x, y;
} txs_chroma;

/* The curve at v: a cubic between two knots, straight beyond the ends. */
static double txs_curve_at(const texsyn_light *l, double v) {
    const int n = l->knots;
    if (v <= (double)l->from[0]) return (double)l->to[0] + (double)l->slope[0] * (v - (double)l->from[0]);
    if (v >= (double)l->from[n - 1])
        return (double)l->to[n - 1] + (double)l->slope[n - 1] * (v - (double)l->from[n - 1]);
    int k = 0;
    while (v >= (double)l->from[k + 1]) k++;
    const double h = (double)l->from[k + 1] - (double)l->from[k], t = (v - (double)l->from[k]) / h;
    const double rise = (double)l->to[k + 1] - (double)l->to[k];
    const double a = (double)l->slope[k] * h, b = (double)l->slope[k + 1] * h;
    return (double)l->to[k] + t * (a + t * (3 * rise - 2 * a - b + t * (a + b - 2 * rise)));
}

static double txs_brightest(const double rgb[3]) {
    const double v = rgb[0] > rgb[1] ? rgb[0] : rgb[1];
    return v > rgb[2] ? v : rgb[2];
}

/* s of a colour, and its V */
static txs_chroma txs_chroma_of(const double rgb[3], double *v) {
    txs_chroma c;
    *v = txs_brightest(rgb);
    const double divisor = *v > TXS_DIM ? *v : TXS_DIM;
    c.x = (rgb[0] - 0.5 * (rgb[1] + rgb[2])) / divisor;
    c.y = 0.86602540378443865 * (rgb[1] - rgb[2]) / divisor;
    return c;
}

/* The colour of brightness v and chroma s; too large a chroma is reduced until no channel is below 0. */
static void txs_colour_of(double v, txs_chroma s, double rgb[3]) {
    const double third = 1.0 / 3, root = 0.57735026918962576; /* 1 / sqrt(3) */
    const double size = v > TXS_DIM ? v : TXS_DIM;
    const double d[3] = {2 * third * s.x * size, (root * s.y - third * s.x) * size,
                         (-root * s.y - third * s.x) * size};
    const double high = txs_brightest(d);
    double low = d[0] < d[1] ? d[0] : d[1];
    low = low < d[2] ? low : d[2];
    const double scale = v <= 0 ? 0 : high - low > v ? v / (high - low) : 1;
    for (int c = 0; c < 3; c++) rgb[c] = v + scale * (d[c] - high);
}

/* What the light makes of a colour. */
static void txs_light_at(const texsyn_light *l, const double from[3], double to[3]) {
    double curved[3], v;
    for (int c = 0; c < 3; c++) {
        curved[c] = txs_curve_at(l, from[c]);
        if (curved[c] < 0) curved[c] = 0;
    }
    const txs_chroma s = txs_chroma_of(curved, &v);
    const double size = sqrt(s.x * s.x + s.y * s.y) / (double)l->fade;
    const double t = size < 1 ? size * size * (3 - 2 * size) : 1;
    txs_chroma lit;
    lit.x = (double)l->gain[0] * s.x - (double)l->gain[1] * s.y + t * (double)l->cast[0];
    lit.y = (double)l->gain[1] * s.x + (double)l->gain[0] * s.y + t * (double)l->cast[1];
    txs_colour_of(v, lit, to);
}

/* No change at all. */
static texsyn_light txs_no_light(void) {
    texsyn_light l;
    memset(&l, 0, sizeof l);
    l.knots = 2;
    l.from[1] = l.to[1] = 1;
    l.slope[0] = l.slope[1] = 1;
    l.gain[0] = 1;
    l.fade = TXS_FADE;
    return l;
}

/* ---- samples ---------------------------------------------------------------------------- */

enum {
    TXS_SWATCHES = 8192,    /* pixels of a picture that are looked at                        */
    TXS_LEAST_SWATCHES = 16 /* pixels: fewer say nothing of the light                        */
};

typedef struct txs_swatches {
    int count;
    double (*rgb)[3]; /* count each                                                       */
    double *weight;   /* of materials; see below                                          */
    double *value;    /* room for a quantity ...                                          */
    txm_pair *order;  /* ... and for its order, twice                                     */
} txs_swatches;

/* The weighted quantile p of value, whose order is known; sum: of all weights. */
static double txs_quantile(const txs_swatches *s, double sum, double p) {
    double seen = 0, before = 0, last = s->value[s->order[0].value];
    for (int i = 0; i < s->count; i++) {
        const uint32_t k = s->order[i].value;
        if (!(s->weight[k] > 0)) continue;
        const double at = (seen + 0.5 * s->weight[k]) / sum, v = s->value[k];
        if (at >= p) return before <= 0 || at <= before ? v : last + (v - last) * (p - before) / (at - before);
        before = at;
        last = v;
        seen += s->weight[k];
    }
    return last;
}

/* All quantiles of the brightness that the curve matches. */
static void txs_find_quantiles(txs_swatches *s, double quantile[TXS_BINS_OF_LIGHT + 2]) {
    double sum = 0;
    for (int i = 0; i < s->count; i++) {
        s->value[i] = txs_brightest(s->rgb[i]);
        s->order[i].key = txm_sort_key(txm_float(s->value[i]));
        s->order[i].value = (uint32_t)i;
        sum += s->weight[i];
    }
    txm_sort_pairs(s->order, s->order + s->count, (size_t)s->count);
    quantile[0] = txs_quantile(s, sum, 0.005);
    for (int k = 0; k < TXS_BINS_OF_LIGHT; k++)
        quantile[k + 1] = txs_quantile(s, sum, (k + 0.5) / (double)TXS_BINS_OF_LIGHT);
    quantile[TXS_BINS_OF_LIGHT + 1] = txs_quantile(s, sum, 0.995);
}

/* ---- fitting ---------------------------------------------------------------------------- */

static double txs_limit(double x, double low, double high) {
    return x < low ? low : x > high ? high : x;
}

static void txs_add_knot(texsyn_light *l, double from, double to) {
    TEXSYN_ASSERT(l->knots < (int)(sizeof l->from / sizeof *l->from));
    l->from[l->knots] = txm_float(from);
    l->to[l->knots++] = txm_float(to);
}

/* Slopes that keep the curve monotone: harmonic means of those on either side. */
static void txs_find_slopes(texsyn_light *l) {
    double steep[TEXSYN_LIGHT_KNOTS] = {0};
    const int n = l->knots;
    for (int k = 0; k + 1 < n; k++)
        steep[k] = ((double)l->to[k + 1] - (double)l->to[k]) /
                   ((double)l->from[k + 1] - (double)l->from[k]);
    l->slope[0] = txm_float(steep[0]);
    l->slope[n - 1] = txm_float(steep[n - 2]);
    for (int k = 1; k + 1 < n; k++) {
        const double sum = steep[k - 1] + steep[k]; /* 0 where knots round to one value */
        l->slope[k] = sum > 0 ? txm_float(2 * steep[k - 1] * steep[k] / sum) : 0;
    }
}

/* The curve: quantiles of the one become those of the other, within the limits of its slope. Below
   them it goes on as before or, where light is not `raised`, towards black: more exposure leaves
   black as it is, haze raises it. Above them it goes on as before. */
static void txs_fit_curve(txs_swatches *a, txs_swatches *b, int raised, texsyn_light *l) {
    double x[TXS_BINS_OF_LIGHT + 2], y[TXS_BINS_OF_LIGHT + 2], to;
    txs_find_quantiles(a, x);
    txs_find_quantiles(b, y);
    l->knots = 0;
    if (x[0] > TXS_NEXT_KNOT) {
        const double rise = raised && x[3] - x[0] > TXS_NEXT_KNOT ? (y[3] - y[0]) / (x[3] - x[0])
                                                                  : y[0] / x[0];
        const double slope = txs_limit(rise, TXS_FLATTEST, TXS_STEEPEST_CURVE);
        txs_add_knot(l, 0, y[0] > slope * x[0] ? y[0] - slope * x[0] : 0);
    }
    if (!l->knots || (double)l->to[0] + TXS_FLATTEST * x[0] < y[0]) txs_add_knot(l, x[0], y[0]);
    else txs_add_knot(l, x[0], (double)l->to[0] + TXS_FLATTEST * x[0]);
    to = (double)l->to[l->knots - 1];
    for (int k = 1; k < TXS_BINS_OF_LIGHT + 2; k++) {
        const double step = x[k] - (double)l->from[l->knots - 1];
        if (step <= TXS_NEXT_KNOT || !(txm_float(x[k]) > l->from[l->knots - 1])) continue;
        to = txs_limit(y[k], to + TXS_FLATTEST * step, to + TXS_STEEPEST_CURVE * step);
        txs_add_knot(l, x[k], to);
    }
    const int n = l->knots, back = n > 4 ? 4 : n;
    const double last = (double)l->from[n - 1], rise = to - (double)l->to[n - back];
    const double run = last - (double)l->from[n - back];
    const double slope = run > 0 ? txs_limit(rise / run, TXS_FLATTEST, TXS_STEEPEST_CURVE) : 1;
    if (n < 2 || last < 1 - TXS_NEXT_KNOT) {
        const double step = last < 1 - TXS_NEXT_KNOT ? 1 - last : 1;
        txs_add_knot(l, last + step, to + slope * step);
    }
    txs_find_slopes(l);
}

/* Mean of s, and its variance as a complex number and as a real one. */
typedef struct txs_moments {
    txs_chroma mean, square;
    double variance;
} txs_moments;

static txs_moments txs_find_moments(const txs_swatches *s, const texsyn_light *curve) {
    txs_moments m;
    double sum = 0, v;
    memset(&m, 0, sizeof m);
    for (int pass = 0; pass < 2; pass++) {
        for (int i = 0; i < s->count; i++) {
            double rgb[3];
            for (int c = 0; c < 3; c++) {
                rgb[c] = curve ? txs_curve_at(curve, s->rgb[i][c]) : s->rgb[i][c];
                if (rgb[c] < 0) rgb[c] = 0;
            }
            const txs_chroma t = txs_chroma_of(rgb, &v);
            const double w = s->weight[i], x = t.x - m.mean.x, y = t.y - m.mean.y;
            if (pass) {
                m.square.x += w * (x * x - y * y) / sum;
                m.square.y += w * 2 * x * y / sum;
                m.variance += w * (x * x + y * y) / sum;
            } else {
                m.square.x += w * t.x; /* the sums of the first pass, for now */
                m.square.y += w * t.y;
                m.variance += w;
            }
        }
        if (pass) break;
        sum = m.variance;
        m.mean.x = m.square.x / sum;
        m.mean.y = m.square.y / sum;
        m.square.x = m.square.y = m.variance = 0;
    }
    return m;
}

/* The rotation between the longer axes of two distributions of chroma, as a unit vector: half the
   angle between the complex variances, at most TXS_MOST_TURN, less where an axis is indistinct. */
static txs_chroma txs_find_turn(const txs_moments *a, const txs_moments *b, double noise) {
    const double most_cosine = 0.8253356149; /* of 0.6 rad */
    txs_chroma q, turn;
    q.x = a->square.x * b->square.x + a->square.y * b->square.y;
    q.y = a->square.x * b->square.y - a->square.y * b->square.x;
    const double size = sqrt(q.x * q.x + q.y * q.y);
    const double distinct = size / ((a->variance + noise) * (b->variance + noise));
    turn.x = 1;
    turn.y = 0;
    if (!(size > 0)) return turn;
    double cosine = sqrt((1 + txs_limit(q.x / size, -1, 1)) / 2);
    if (cosine < most_cosine) cosine = most_cosine;
    const double sine = sqrt(1 - cosine * cosine);
    const double x = 1 - distinct + distinct * cosine, y = distinct * (q.y < 0 ? -sine : sine);
    turn.x = x / sqrt(x * x + y * y);
    turn.y = y / sqrt(x * x + y * y);
    return turn;
}

/* The light that turns the distribution of a into that of b. */
static texsyn_light txs_fit_light(txs_swatches *a, txs_swatches *b, int raised) {
    const double noise = 0.01; /* of s, in either picture */
    texsyn_light l = txs_no_light();
    txs_fit_curve(a, b, raised, &l);
    const txs_moments p = txs_find_moments(a, &l), q = txs_find_moments(b, NULL);
    const double gain = txs_limit((sqrt(q.variance) + noise) / (sqrt(p.variance) + noise), 0.3, 3);
    const txs_chroma turn = txs_find_turn(&p, &q, noise * noise);
    l.gain[0] = txm_float(gain * turn.x);
    l.gain[1] = txm_float(gain * turn.y);
    l.cast[0] = txm_float(q.mean.x - gain * (turn.x * p.mean.x - turn.y * p.mean.y));
    l.cast[1] = txm_float(q.mean.y - gain * (turn.y * p.mean.x + turn.x * p.mean.y));
    return l;
}

/* ---- materials --------------------------------------------------------------------------

   Two pictures may show the same materials in unequal shares; matching their distributions would
   then turn one material into another. So clusters of colours are matched too, pixels are weighed
   until matched clusters have equal shares, and the light is fitted again. Clusters are matched
   after a first guess of the light, once that of the whole distributions and once no change. Of
   all these lights the one is kept under which most colours have a counterpart in the other
   picture, whatever their number. */

enum {
    TXS_MATERIALS = 3,      /* clusters a picture                                              */
    TXS_MEANS_ROUNDS = 10,  /* of k-means                                                      */
    TXS_MATCH_ROUNDS = 3,   /* matching, weighing, fitting                                     */
    TXS_COMPARED = 512      /* colours that are compared one by one                            */
};
#define TXS_CHROMA_WEIGHT 1.5 /* of s against V in distances of colours                        */
#define TXS_FEW 0.01          /* share of a cluster that is left out                           */
#define TXS_TOO_FAR 0.2       /* colours farther apart than this have no counterpart           */
#define TXS_WHOLE_BONUS 0.85  /* the light of the whole distributions is kept unless another is
                                 better by more than this factor                               */

typedef struct txs_point {
    double at[3];
} txs_point;

typedef struct txs_cloud { /* the colours of one picture, under some light */
    int count;
    txs_point *points;
    uint8_t *cluster;
    txs_point centre[TXS_MATERIALS];
    double share[TXS_MATERIALS];
} txs_cloud;

static double txs_apart(const txs_point *a, const txs_point *b) {
    double sum = 0;
    for (int k = 0; k < 3; k++) sum += (a->at[k] - b->at[k]) * (a->at[k] - b->at[k]);
    return sum;
}

static void txs_place_points(txs_cloud *cloud, const txs_swatches *s, const texsyn_light *light) {
    cloud->count = s->count;
    for (int i = 0; i < s->count; i++) {
        double rgb[3] = {s->rgb[i][0], s->rgb[i][1], s->rgb[i][2]}, v;
        if (light) txs_light_at(light, s->rgb[i], rgb);
        const txs_chroma c = txs_chroma_of(rgb, &v);
        cloud->points[i].at[0] = v;
        cloud->points[i].at[1] = TXS_CHROMA_WEIGHT * c.x;
        cloud->points[i].at[2] = TXS_CHROMA_WEIGHT * c.y;
    }
}

static void txs_assign_points(txs_cloud *c) {
    for (int i = 0; i < c->count; i++) {
        int best = 0;
        for (int k = 1; k < TXS_MATERIALS; k++)
            if (txs_apart(&c->points[i], &c->centre[k]) < txs_apart(&c->points[i], &c->centre[best]))
                best = k;
        c->cluster[i] = (uint8_t)best;
    }
}

/* k-means, from centres that are evenly spaced in the order of brightness. */
static void txs_find_clusters(txs_cloud *c, txm_pair *order) {
    for (int i = 0; i < c->count; i++) {
        order[i].key = txm_sort_key(txm_float(c->points[i].at[0]));
        order[i].value = (uint32_t)i;
    }
    txm_sort_pairs(order, order + c->count, (size_t)c->count);
    for (int k = 0; k < TXS_MATERIALS; k++)
        c->centre[k] = c->points[order[(2 * k + 1) * c->count / (2 * TXS_MATERIALS)].value];
    for (int round = 0; round < TXS_MEANS_ROUNDS; round++) {
        txs_point sum[TXS_MATERIALS];
        memset(sum, 0, sizeof sum);
        memset(c->share, 0, sizeof c->share);
        txs_assign_points(c);
        for (int i = 0; i < c->count; i++) {
            for (int k = 0; k < 3; k++) sum[c->cluster[i]].at[k] += c->points[i].at[k];
            c->share[c->cluster[i]]++;
        }
        for (int k = 0; k < TXS_MATERIALS; k++) {
            for (int d = 0; d < 3 && c->share[k] > 0; d++)
                c->centre[k].at[d] = sum[k].at[d] / c->share[k];
            c->share[k] /= c->count;
        }
    }
}

/* Go through all ways to match the clusters from `from` on; the best is kept. */
static void txs_match_from(const txs_cloud *a, const txs_cloud *b, int from, double sum,
                           int match[TXS_MATERIALS], double *least, int best[TXS_MATERIALS]) {
    if (sum >= *least) return;
    if (from == TXS_MATERIALS) {
        *least = sum;
        for (int k = 0; k < TXS_MATERIALS; k++) best[k] = match[k];
        return;
    }
    for (int k = from; k < TXS_MATERIALS; k++) {
        const int other = match[k];
        match[k] = match[from];
        match[from] = other;
        txs_match_from(a, b, from + 1, sum + txs_apart(&a->centre[from], &b->centre[other]), match,
                       least, best);
        match[from] = match[k];
        match[k] = other;
    }
}

/* Weigh the samples of both pictures so that matched clusters have equal shares. 0: nothing is left. */
static int txs_weigh_materials(const txs_cloud *a, const txs_cloud *b, txs_swatches *of_a,
                               txs_swatches *of_b) {
    int match[TXS_MATERIALS], best[TXS_MATERIALS];
    double least = 1e300, total = 0, to_a[TXS_MATERIALS], to_b[TXS_MATERIALS];
    for (int k = 0; k < TXS_MATERIALS; k++) match[k] = best[k] = k;
    txs_match_from(a, b, 0, 0, match, &least, best);
    for (int k = 0; k < TXS_MATERIALS; k++) {
        const double p = a->share[k], q = b->share[best[k]];
        const double share = p < TXS_FEW || q < TXS_FEW ? 0 : sqrt(p * q);
        to_a[k] = share > 0 ? share / p : 0;
        to_b[best[k]] = share > 0 ? share / q : 0;
        total += share;
    }
    for (int i = 0; i < of_a->count; i++) of_a->weight[i] = to_a[a->cluster[i]];
    for (int i = 0; i < of_b->count; i++) of_b->weight[i] = to_b[b->cluster[i]];
    return total > 0;
}

/* Mean distance from colours of a to the nearest of b. */
static double txs_one_way(const txs_cloud *a, const txs_cloud *b) {
    const int n = a->count < TXS_COMPARED ? a->count : TXS_COMPARED;
    const int m = b->count < TXS_COMPARED ? b->count : TXS_COMPARED;
    double sum = 0;
    for (int i = 0; i < n; i++) {
        const txs_point *p = &a->points[(int)((int64_t)i * a->count / n)];
        double least = TXS_TOO_FAR * TXS_TOO_FAR;
        for (int k = 0; k < m; k++) {
            const double d = txs_apart(p, &b->points[(int)((int64_t)k * b->count / m)]);
            if (d < least) least = d;
        }
        sum += sqrt(least);
    }
    return sum / n;
}

/* ---- learning a light ------------------------------------------------------------------- */

typedef struct txs_lighting {
    txs_swatches a, b;
    txs_cloud of_a, of_b;
} txs_lighting;

static double txs_light_cost(txs_lighting *w, const texsyn_light *light) {
    txs_place_points(&w->of_a, &w->a, light);
    return txs_one_way(&w->of_a, &w->of_b) + txs_one_way(&w->of_b, &w->of_a);
}

/* The light of matched materials, from a first guess. */
static texsyn_light txs_match_materials(txs_lighting *w, texsyn_light light, int raised) {
    for (int round = 0; round < TXS_MATCH_ROUNDS; round++) {
        txs_place_points(&w->of_a, &w->a, &light);
        txs_find_clusters(&w->of_a, w->a.order);
        if (!txs_weigh_materials(&w->of_a, &w->of_b, &w->a, &w->b)) break;
        light = txs_fit_light(&w->a, &w->b, raised);
    }
    return light;
}

static txm_status txs_choose_light(txs_lighting *w, txm_env *env, texsyn_light *out) {
    for (int i = 0; i < w->a.count; i++) w->a.weight[i] = 1;
    for (int i = 0; i < w->b.count; i++) w->b.weight[i] = 1;
    const texsyn_light whole[2] = {txs_fit_light(&w->a, &w->b, 0), txs_fit_light(&w->a, &w->b, 1)};
    txs_place_points(&w->of_b, &w->b, NULL);
    txs_find_clusters(&w->of_b, w->b.order);
    texsyn_light best = whole[0];
    double least = TXS_WHOLE_BONUS * txs_light_cost(w, &whole[0]);
    for (int k = 1; k < 6; k++) { /* even: black stays; then whole, matched, matched from no change */
        const int raised = k % 2;
        if (txm_progress(env, 0.15f * (float)k, "materials"))
            return txm_fail(env, TXM_CANCELLED, "cancelled");
        const texsyn_light light =
            k < 2 ? whole[1] : txs_match_materials(w, k < 4 ? whole[raised] : txs_no_light(), raised);
        const double cost = txs_light_cost(w, &light) * (k < 2 ? TXS_WHOLE_BONUS : 1);
        if (cost < least) {
            least = cost;
            best = light;
        }
    }
    *out = best;
    return TXM_OK;
}

static int txs_counts(const txm_image *im, const uint8_t *mask, int x, int y) {
    if (mask && !mask[(size_t)y * (size_t)im->width + (size_t)x]) return 0;
    return im->channels % 2 == 1 || txm_image_get(im, x, y, im->channels - 1) >= 0.5f;
}

/* Samples of the pixels that count, evenly spread over them but at random within each stretch. */
static txm_status txs_take_swatches(const txm_image *image, const txm_image *where, const char *name,
                                    txm_arena *arena, txs_swatches *s, txs_cloud *cloud,
                                    txm_env *env) {
    const txm_image im = txm_image_resolve(*image);
    int64_t total = 0, seen = 0;
    uint8_t *mask;
    const txm_status status = txs_read_mask(where, arena, &mask, env);
    if (status != TXM_OK) return status;
    for (int y = 0; y < im.height; y++)
        for (int x = 0; x < im.width; x++) total += txs_counts(&im, mask, x, y);
    if (total < TXS_LEAST_SWATCHES)
        return txm_fail_numbers_at(env, TXM_TOO_SMALL, name,
                                   "fewer than # opaque pixels in the mask", TXS_LEAST_SWATCHES, 0);
    s->count = 0;
    const int most = total < TXS_SWATCHES ? (int)total : TXS_SWATCHES;
    s->rgb = (double(*)[3])txm_arena_alloc(arena, (size_t)most, sizeof *s->rgb);
    s->weight = (double *)txm_arena_alloc(arena, (size_t)most, sizeof(double));
    s->value = (double *)txm_arena_alloc(arena, (size_t)most, sizeof(double));
    s->order = (txm_pair *)txm_arena_alloc(arena, (size_t)most, 2 * sizeof(txm_pair));
    cloud->points = (txs_point *)txm_arena_alloc(arena, (size_t)most, sizeof(txs_point));
    cloud->cluster = (uint8_t *)txm_arena_alloc(arena, (size_t)most, 1);
    if (arena->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for samples");
    txm_rng rng = txm_rng_make(0, 5);
    int64_t next = -1;
    for (int y = 0; y < im.height && s->count < most; y++) {
        for (int x = 0; x < im.width && s->count < most; x++) {
            if (!txs_counts(&im, mask, x, y)) continue;
            if (next < 0) {
                const int64_t from = s->count * total / most, to = (s->count + 1) * total / most;
                next = from + txm_rng_range(&rng, 0, (int)(to - from) - 1);
            }
            if (seen++ != next) continue;
            for (int c = 0; c < 3; c++)
                s->rgb[s->count][c] = (double)txm_image_get(&im, x, y, im.channels < 3 ? 0 : c);
            s->count++;
            next = -1;
        }
    }
    return TXM_OK;
}

static txm_status txs_check_relight(const texsyn_relight_desc *d, txm_env *env) {
    if (!d) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL");
    const txm_image *images[2] = {&d->image, &d->like}, *masks[2] = {&d->mask, &d->like_mask};
    static const char *const names[2] = {"image", "like"};
    static const char *const mask_names[2] = {"mask", "like_mask"};
    for (int k = 0; k < 2; k++) {
        txm_status status = txm_image_check(images[k], names[k], TEXSYN_MAX_PIXELS, env);
        if (status == TXM_OK) status = txs_check_mask(masks[k], images[k], mask_names[k], env);
        if (status != TXM_OK) return status;
        if (!txs_image_is_moderate(images[k]))
            return txm_fail_at(env, TXM_BAD_ARGUMENT, names[k],
                               "has samples that are not finite or beyond a million");
    }
    if (!(d->strength >= 0 && d->strength <= 1))
        return txm_fail(env, TXM_BAD_ARGUMENT, "strength must be 0 (default) to 1");
    return TXM_OK;
}

TEXSYN_API txm_status texsyn_light_learn(const texsyn_relight_desc *desc, txm_env *env,
                                         texsyn_light *out) {
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    txm_status status = txs_check_relight(desc, env);
    if (status != TXM_OK) return status;
    txs_lighting w;
    txm_arena arena;
    texsyn_light light = txs_no_light();
    txm_arena_init(&arena, env);
    if (txm_progress(env, 0, "colours")) status = txm_fail(env, TXM_CANCELLED, "cancelled");
    if (status == TXM_OK)
        status = txs_take_swatches(&desc->image, &desc->mask, "image", &arena, &w.a, &w.of_a, env);
    if (status == TXM_OK)
        status = txs_take_swatches(&desc->like, &desc->like_mask, "like", &arena, &w.b, &w.of_b, env);
    if (status == TXM_OK) status = txs_choose_light(&w, env, &light);
    txm_arena_free(&arena);
    if (status == TXM_OK) *out = light;
    return status;
}

/* ---- applying a light ------------------------------------------------------------------- */

enum { TXS_LIT_SHARES = 64 }; /* into which a picture is divided for threads */

typedef struct txs_lit {
    const texsyn_light *light;
    txm_image from, to;
    double strength;
} txs_lit;

/* Between -1/2 and 1/2, evenly distributed: noise of one step of 8 bits, so that no bands appear
   where a step becomes several, or several values one. */
static double txs_dither(int x, int y) {
    const uint64_t place = (uint64_t)(uint32_t)y << 32 | (uint32_t)x;
    return ((double)(txm_hash(place + 0x9e3779b97f4a7c15u) >> 40) + 0.5) / 16777216.0 - 0.5;
}

static void txs_light_pixel(const txs_lit *w, int x, int y) {
    const int channels = w->from.channels, colours = channels < 3 ? 1 : 3;
    const double noise = txs_dither(x, y) / 255;
    double from[3], to[3];
    for (int c = 0; c < 3; c++) {
        from[c] = (double)txm_image_get(&w->from, x, y, colours == 1 ? 0 : c);
        if (w->from.sample == TXM_U8) from[c] += noise;
    }
    txs_light_at(w->light, from, to);
    for (int c = 0; c < channels; c++) {
        if (c >= colours) { /* alpha */
            txm_image_set(&w->to, x, y, c, txm_image_get(&w->from, x, y, c));
            continue;
        }
        double v = from[c] + w->strength * (to[c] - from[c]);
        if (w->from.sample != TXM_U8 && w->to.sample == TXM_U8) v += noise;
        txm_image_set(&w->to, x, y, c, txm_float(v));
    }
}

static void txs_light_share(void *context, int share) {
    const txs_lit *w = (const txs_lit *)context;
    const int rows = (w->from.height - 1) / TXS_LIT_SHARES + 1;
    for (int y = share * rows; y < (share + 1) * rows && y < w->from.height; y++) {
        for (int x = 0; x < w->from.width; x++) txs_light_pixel(w, x, y);
    }
}

/* Is this a light that texsyn_light_learn can have made? */
static int txs_is_light(const texsyn_light *l) {
    if (l->knots < 2 || l->knots > TEXSYN_LIGHT_KNOTS || !(l->fade > 0 && l->fade <= 1e6f)) return 0;
    for (int k = 0; k < l->knots; k++) {
        if (!(fabsf(l->from[k]) <= 1e8f && fabsf(l->to[k]) <= 1e8f)) return 0;
        if (!(l->slope[k] >= 0 && l->slope[k] <= 1e6f)) return 0;
        if (k && !(l->from[k] > l->from[k - 1] && l->to[k] >= l->to[k - 1])) return 0;
    }
    for (int k = 0; k < 2; k++) {
        if (!(fabsf(l->gain[k]) <= 1e6f && fabsf(l->cast[k]) <= 1e6f)) return 0;
    }
    return 1;
}

static txm_status txs_check_lit(const txm_image *image, const txm_image *out, txm_env *env) {
    txm_status status = txm_image_check(image, "image", TEXSYN_MAX_PIXELS, env);
    if (status == TXM_OK) status = txm_image_check(out, "out", TEXSYN_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    const txm_image from = txm_image_resolve(*image), to = txm_image_resolve(*out);
    if (to.width != from.width || to.height != from.height || to.channels != from.channels)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "out",
                           "must have the size and the channels of the image");
    if (!txs_image_is_moderate(&from))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "image",
                           "has samples that are not finite or beyond a million");
    return TXM_OK;
}

TEXSYN_API txm_status texsyn_light_apply(const texsyn_light *light, float strength,
                                         const txm_image *image, txm_env *env, txm_image out) {
    if (!light) return txm_fail(env, TXM_BAD_ARGUMENT, "light is NULL");
    if (!txs_is_light(light))
        return txm_fail(env, TXM_BAD_ARGUMENT, "light was not made by texsyn_light_learn");
    if (!(strength >= 0 && strength <= 1))
        return txm_fail(env, TXM_BAD_ARGUMENT, "strength must be 0 to 1");
    txm_status status = txs_check_lit(image, &out, env);
    if (status != TXM_OK) return status;
    txs_lit w;
    txm_arena arena;
    txm_arena_init(&arena, env);
    status = txm_image_bled(image, 0, &arena, env, &w.from);
    w.light = light;
    w.to = txm_image_resolve(out);
    w.strength = (double)strength;
    if (status == TXM_OK) txm_parallel_for(env, TXS_LIT_SHARES, txs_light_share, &w);
    txm_arena_free(&arena);
    return status;
}

TEXSYN_API txm_status texsyn_relight(const texsyn_relight_desc *desc, txm_env *env, txm_image out) {
    texsyn_light light;
    txm_status status = txs_check_relight(desc, env);
    if (status == TXM_OK) status = txs_check_lit(&desc->image, &out, env); /* before the work */
    if (status == TXM_OK) status = texsyn_light_learn(desc, env, &light);
    if (status == TXM_OK && txm_progress(env, 0.9f, "apply"))
        status = txm_fail(env, TXM_CANCELLED, "cancelled");
    if (status != TXM_OK) return status;
    return texsyn_light_apply(&light, desc->strength > 0 ? desc->strength : 1.0f, &desc->image, env,
                              out);
}

/* ---- darkness ---------------------------------------------------------------------------

   What erosion sees in its exemplar. Cracks and pits are darker than their surroundings, and
   cracks are also long. So each pixel has a darkness, its difference from the local mean in units
   of the local deviation, and a strength, the darkness averaged along the best of a dozen
   directions. Averaging along a crack bridges its interruptions and removes single dark pixels,
   but does not widen it. */

enum {
    TXS_NEARBY = 11,         /* pixels: radius of the local mean, three box filters of it        */
    TXS_AROUND = 24,         /* of the local deviation                                           */
    TXS_STEADY = 4,          /* gray levels of 255 added to the deviation: even areas stay even  */
    TXS_DIRECTIONS = 12,     /* of line segments                                                 */
    TXS_HALF_LINE = 8,       /* pixels on either side of a segment's middle                      */
    TXS_LINE = 2 * TXS_HALF_LINE + 1,
    TXS_RATIO_ONE = 160      /* stored ratio of a pixel as light as its surroundings             */
};
#define TXS_LEAST_DARK (-1.0f) /* darkness is limited to this range before it is averaged: one */
#define TXS_MOST_DARK 3.0f     /* black pixel makes no line                                    */
#define TXS_ALONG 0.75         /* weight of the line in the strength; the rest is the pixel's  */
#define TXS_INTACT 0.5f        /* less dark pixels count as intact surroundings                */

typedef struct txs_stone {
    int width, height;
    float *dark;     /* limited to TXS_LEAST_DARK..TXS_MOST_DARK; 0 where unknown             */
    float *strength; /* the same along lines                                                 */
    uint8_t *ratio;  /* 3 per pixel: colour over that of the intact surroundings             */
    uint8_t *known;  /* non-zero: opaque and inside the mask                                 */
} txs_stone;

/* One box filter along a line of count values that are step apart; zero beyond its ends. */
static void txs_box(float *p, size_t count, size_t step, size_t radius, float *line) {
    double sum = 0;
    for (size_t i = 0; i < count; i++) line[i] = p[i * step];
    for (size_t i = 0; i < radius && i < count; i++) sum += (double)line[i];
    for (size_t i = 0; i < count; i++) {
        if (i + radius < count) sum += (double)line[i + radius];
        p[i * step] = txm_float(sum / (double)(2 * radius + 1));
        if (i >= radius) sum -= (double)line[i - radius];
    }
}

/* Three box filters each way, nearly a Gaussian of sigma sqrt(radius (radius + 1)); line has room
   for the longer side. */
static void txs_blur(float *plane, int width, int height, int radius, float *line) {
    for (int pass = 0; pass < 3; pass++) {
        for (size_t y = 0; y < (size_t)height; y++)
            txs_box(plane + y * (size_t)width, (size_t)width, 1, (size_t)radius, line);
        for (size_t x = 0; x < (size_t)width; x++)
            txs_box(plane + x, (size_t)height, (size_t)width, (size_t)radius, line);
    }
}

/* sum / weight where there is weight */
static double txs_mean_at(const float *sum, const float *weight, size_t i) {
    return weight[i] > 1e-4f ? (double)sum[i] / (double)weight[i] : 0;
}

/* What pixel i of an image looks like, in gray levels of 255. */
static double txs_colour_at(const txm_image *im, size_t i, int c) {
    const int x = (int)(i % (size_t)im->width), y = (int)(i / (size_t)im->width);
    return 255 * (double)txm_image_get(im, x, y, im->channels < 3 ? 0 : c);
}
static double txs_luma_at(const txm_image *im, size_t i) {
    return 0.299 * txs_colour_at(im, i, 0) + 0.587 * txs_colour_at(im, i, 1) +
           0.114 * txs_colour_at(im, i, 2);
}

/* Four planes for the filters, and a line. */
typedef struct txs_filter_room {
    float *weight, *mean, *wide, *square, *line;
} txs_filter_room;

/* Darkness: (local mean - luma) / (local deviation + TXS_STEADY). */
static void txs_find_dark(txs_stone *s, const txm_image *im, const txs_filter_room *r) {
    const size_t n = txs_pixels_of(s->width, s->height);
    for (size_t i = 0; i < n; i++) {
        r->weight[i] = r->wide[i] = s->known[i] ? 1.0f : 0.0f;
        r->mean[i] = s->known[i] ? txm_float(txs_luma_at(im, i)) : 0.0f;
    }
    txs_blur(r->weight, s->width, s->height, TXS_NEARBY, r->line);
    txs_blur(r->mean, s->width, s->height, TXS_NEARBY, r->line);
    for (size_t i = 0; i < n; i++) {
        const double off = txs_mean_at(r->mean, r->weight, i) - txs_luma_at(im, i);
        s->dark[i] = s->known[i] ? txm_float(off) : 0.0f;
        r->square[i] = s->known[i] ? txm_float(off * off) : 0.0f;
    }
    txs_blur(r->wide, s->width, s->height, TXS_AROUND, r->line);
    txs_blur(r->square, s->width, s->height, TXS_AROUND, r->line);
    for (size_t i = 0; i < n; i++) {
        const double deviation = sqrt(txs_mean_at(r->square, r->wide, i));
        s->dark[i] = txm_clampf(txm_float((double)s->dark[i] / (deviation + (double)TXS_STEADY)),
                                TXS_LEAST_DARK, TXS_MOST_DARK);
    }
}

/* The colour of each pixel over the mean colour of the intact pixels around it. */
static void txs_find_ratios(txs_stone *s, const txm_image *im, const txs_filter_room *r) {
    const size_t n = txs_pixels_of(s->width, s->height);
    for (size_t i = 0; i < n; i++)
        r->weight[i] = s->known[i] && s->dark[i] < TXS_INTACT ? 1.0f : 0.0f;
    for (int c = 0; c < 3; c++) {
        for (size_t i = 0; i < n; i++)
            r->mean[i] = r->weight[i] > 0.5f ? txm_float(txs_colour_at(im, i, c)) : 0.0f;
        for (size_t i = 0; i < n && c == 0; i++) r->wide[i] = r->weight[i];
        if (c == 0) txs_blur(r->wide, s->width, s->height, TXS_NEARBY, r->line);
        txs_blur(r->mean, s->width, s->height, TXS_NEARBY, r->line);
        for (size_t i = 0; i < n; i++) {
            const double around = txs_mean_at(r->mean, r->wide, i);
            const double ratio = s->known[i] && around > 0.5 ? txs_colour_at(im, i, c) / around : 1;
            const double stored = floor(ratio * (double)TXS_RATIO_ONE + 0.5);
            s->ratio[3 * i + (size_t)c] = (uint8_t)(stored > 255 ? 255 : stored < 0 ? 0 : stored);
        }
    }
}

/* ---- strength along lines -------------------------------------------------------------- */

typedef struct txs_line_filter {
    const float *dark;
    float *strength;
    int width, height;
    int first, rows; /* where this part of the work begins, and rows of one share of it */
    int dx[TXS_DIRECTIONS][TXS_LINE], dy[TXS_DIRECTIONS][TXS_LINE];
} txs_line_filter;

static void txs_make_lines(txs_line_filter *f) {
    for (int d = 0; d < TXS_DIRECTIONS; d++) {
        double sine, cosine;
        txm_sincos(TXM_PI * d / (double)TXS_DIRECTIONS, &sine, &cosine);
        for (int k = 0; k < TXS_LINE; k++) {
            f->dx[d][k] = (int)floor((k - TXS_HALF_LINE) * cosine + 0.5);
            f->dy[d][k] = (int)floor((k - TXS_HALF_LINE) * sine + 0.5);
        }
    }
}

/* The largest of the sums along the lines through a pixel; beyond the border the nearest pixel
   stands for what is not there. */
static float txs_best_line(const txs_line_filter *f, int x, int y) {
    const int inside = x >= TXS_HALF_LINE && x < f->width - TXS_HALF_LINE && y >= TXS_HALF_LINE &&
                       y < f->height - TXS_HALF_LINE;
    float best = (float)TXS_LINE * TXS_LEAST_DARK;
    for (int d = 0; d < TXS_DIRECTIONS; d++) {
        double sum = 0;
        for (int k = 0; k < TXS_LINE; k++) {
            int u = x + f->dx[d][k], v = y + f->dy[d][k];
            if (!inside) {
                u = txm_clampi(u, 0, f->width - 1);
                v = txm_clampi(v, 0, f->height - 1);
            }
            sum += (double)f->dark[(size_t)v * (size_t)f->width + (size_t)u];
        }
        best = txm_maxf(best, txm_float(sum));
    }
    return best;
}

static void txs_filter_rows(void *context, int share) {
    const txs_line_filter *f = (const txs_line_filter *)context;
    const int from = f->first + share * f->rows;
    for (int y = from; y < from + f->rows && y < f->height; y++) {
        for (int x = 0; x < f->width; x++) {
            const size_t i = (size_t)y * (size_t)f->width + (size_t)x;
            f->strength[i] = txm_float(TXS_ALONG * (double)txs_best_line(f, x, y) / (double)TXS_LINE +
                                       (1 - TXS_ALONG) * (double)f->dark[i]);
        }
    }
}

/* strength of a plane of darkness, on the threads of env; reports from..to */
static txm_status txs_find_strength(const float *dark, float *strength, int width, int height,
                                    txm_env *env, float from, float to) {
    enum { SHARES = 16, PARTS = 8 }; /* a report after each part */
    txs_line_filter f;
    f.width = width;
    f.height = height;
    f.rows = 1 + (height - 1) / (SHARES * PARTS);
    f.dark = dark;
    f.strength = strength;
    txs_make_lines(&f);
    for (f.first = 0; f.first < height; f.first += SHARES * f.rows) {
        const float done = (float)f.first / (float)height;
        if (txm_progress(env, txm_lerpf(from, to, done), "find cracks"))
            return txm_fail(env, TXM_CANCELLED, "cancelled");
        txm_parallel_for(env, SHARES, txs_filter_rows, &f);
    }
    return TXM_OK;
}

/* ---- the order of erosion ---------------------------------------------------------------

   Pixels erode one after the other, the strongest first, so that what is eroded at one level is
   part of what is at the next, and any number of pixels is a level. Erosion finds it easier to go
   on than to begin: a pixel beside an eroded one counts as stronger than it is, so cracks grow
   along their whole length before others begin. And a pixel waits until the cracked region it
   belongs to is long enough, which keeps single dark grains out. As regions only grow, waiting
   changes the order and nothing else; in terms of morphology, this is an attribute opening by the
   larger side of the bounding box, with a larger demand on the first regions than on later ones. */

enum {
    TXS_LONG_FIRST = 80, /* pixels: length of a region at the beginning ...                  */
    TXS_LONG_LAST = 12,  /* ... and from the full share on                                   */
    TXS_LONG_STEPS = 10, /* times at which the demand falls                                  */
    TXS_LONG_PART = 4,   /* and it is at most this part of the shorter side of the picture   */
    TXS_STRENGTHS = 4096, /* steps into which the range of strengths is divided              */
    TXS_ORDER_REPORT = 1 << 17 /* pixels between reports of progress, some hundredths of a second */
};
#define TXS_GO_ON 1.0f /* by how much a pixel beside an eroded one counts as stronger          */

/* A queue of pixels by strength: a list for each step. A pixel enters twice: with its own
   strength, and when it gets its first eroded neighbour. */
typedef struct txs_queue {
    int width, height;
    const float *strength;
    uint32_t *next;  /* 2 per pixel: the next entry in its list; entry / 2 is the pixel      */
    uint8_t *state;  /* of each pixel: TXS_BESIDE, TXS_ERODED                                 */
    uint32_t *first; /* of each list                                                         */
    int step;        /* no list above this one holds anything                                */
} txs_queue;

#define TXS_NO_PIXEL UINT32_MAX
enum { TXS_BESIDE = 1, TXS_ERODED = 2 };

static void txs_enter(txs_queue *q, uint32_t pixel, int is_beside) {
    const float range = TXS_MOST_DARK + TXS_GO_ON - TXS_LEAST_DARK;
    const float strength = q->strength[pixel] + (is_beside ? TXS_GO_ON : 0.0f);
    const float share = (strength - TXS_LEAST_DARK) / range;
    const int step = txm_clampi((int)((double)share * (double)TXS_STRENGTHS), 0, TXS_STRENGTHS - 1);
    const uint32_t entry = 2 * pixel + (uint32_t)is_beside;
    q->next[entry] = q->first[step];
    q->first[step] = entry;
    if (step > q->step) q->step = step;
}

/* the strongest pixel that is not taken yet; there must be one */
static uint32_t txs_take(txs_queue *q) {
    for (;;) {
        while (q->first[q->step] == TXS_NO_PIXEL) q->step--;
        const uint32_t entry = q->first[q->step], pixel = entry / 2;
        q->first[q->step] = q->next[entry];
        if (q->state[pixel] & TXS_ERODED) continue;
        q->state[pixel] |= TXS_ERODED;
        return pixel;
    }
}

/* Take all pixels; the values of order are these. 0: cancelled. */
static int txs_grow_cracks(txs_queue *q, uint32_t count, txm_pair *order, txm_env *env, float at) {
    memset(q->state, 0, count);
    memset(q->first, 0xff, TXS_STRENGTHS * sizeof *q->first);
    q->step = 0;
    for (uint32_t i = count; i-- > 0;) txs_enter(q, i, 0); /* of equal ones the first comes first */
    for (uint32_t k = 0; k < count; k++) {
        if (k % TXS_ORDER_REPORT == 0 && txm_progress(env, at, "order")) return 0;
        const uint32_t p = txs_take(q);
        const int x = (int)(p % (uint32_t)q->width), y = (int)(p / (uint32_t)q->width);
        order[k].value = p;
        for (int v = y > 0 ? y - 1 : y; v <= y + 1 && v < q->height; v++) {
            for (int u = x > 0 ? x - 1 : x; u <= x + 1 && u < q->width; u++) {
                const uint32_t beside = (uint32_t)v * (uint32_t)q->width + (uint32_t)u;
                if (q->state[beside]) continue;
                q->state[beside] = TXS_BESIDE;
                txs_enter(q, beside, 1);
            }
        }
    }
    return 1;
}

/* Regions of pixels that have been reached, as trees with their root as the name. Pixels of a
   region that waits are linked in a ring. */
typedef struct txs_regions {
    int width, height;
    uint32_t *parent;   /* of each pixel; itself at a root; none: not reached yet             */
    uint32_t *ring;     /* the next pixel of the same waiting region                         */
    int32_t *box;       /* 4 per pixel, valid at roots: least x, y, largest x, y; least x is
                           TXS_RELEASED once a region no longer waits                        */
    txm_pair *order;    /* key: when a pixel was released                                    */
    uint32_t *place;    /* of each pixel in order                                            */
} txs_regions;

enum { TXS_RELEASED = -1 };

static uint32_t txs_root_of(txs_regions *r, uint32_t p) {
    while (r->parent[p] != p) {
        r->parent[p] = r->parent[r->parent[p]];
        p = r->parent[p];
    }
    return p;
}

static int txs_region_waits(const txs_regions *r, uint32_t root) {
    return r->box[4 * (size_t)root] != TXS_RELEASED;
}

/* All pixels of a waiting region are released at a time. */
static void txs_release(txs_regions *r, uint32_t root, uint32_t time) {
    uint32_t p = root;
    do {
        r->order[r->place[p]].key = time;
        p = r->ring[p];
    } while (p != root);
    r->box[4 * (size_t)root] = TXS_RELEASED;
}

static int txs_region_length(const txs_regions *r, uint32_t root) {
    const int32_t *b = r->box + 4 * (size_t)root;
    return 1 + (b[2] - b[0] > b[3] - b[1] ? b[2] - b[0] : b[3] - b[1]);
}

/* Join two regions. If only one of them waits, its wait is over. */
static void txs_join_regions(txs_regions *r, uint32_t a, uint32_t b, uint32_t time) {
    a = txs_root_of(r, a);
    b = txs_root_of(r, b);
    if (a == b) return;
    const int a_waits = txs_region_waits(r, a), b_waits = txs_region_waits(r, b);
    if (a_waits && !b_waits) txs_release(r, a, time);
    if (b_waits && !a_waits) txs_release(r, b, time);
    if (a_waits && b_waits) {
        int32_t *to = r->box + 4 * (size_t)a;
        const int32_t *from = r->box + 4 * (size_t)b;
        for (int k = 0; k < 2; k++) {
            if (from[k] < to[k]) to[k] = from[k];
            if (from[2 + k] > to[2 + k]) to[2 + k] = from[2 + k];
        }
        const uint32_t next = r->ring[a];
        r->ring[a] = r->ring[b];
        r->ring[b] = next;
    }
    r->parent[b] = a;
}

/* Reach one more pixel. */
static void txs_reach_pixel(txs_regions *r, uint32_t p, uint32_t time) {
    const int x = (int)(p % (uint32_t)r->width), y = (int)(p / (uint32_t)r->width);
    int32_t *box = r->box + 4 * (size_t)p;
    r->parent[p] = r->ring[p] = p;
    box[0] = box[2] = x;
    box[1] = box[3] = y;
    for (int v = y > 0 ? y - 1 : y; v <= y + 1 && v < r->height; v++) {
        for (int u = x > 0 ? x - 1 : x; u <= x + 1 && u < r->width; u++) {
            const uint32_t q = (uint32_t)v * (uint32_t)r->width + (uint32_t)u;
            if (q != p && r->parent[q] != TXS_NO_PIXEL) txs_join_regions(r, q, p, time);
        }
    }
}

/* the length demanded of a region when `step` of TXS_LONG_STEPS are over */
static int txs_demand(const txs_regions *r, int step) {
    const int side = r->width < r->height ? r->width : r->height;
    const int length = TXS_LONG_FIRST -
                       (TXS_LONG_FIRST - TXS_LONG_LAST) * step / TXS_LONG_STEPS;
    return length < side / TXS_LONG_PART ? length : side / TXS_LONG_PART;
}

/* Reach all pixels in order and note when each is released. 0: cancelled. */
static int txs_reach_all(txs_regions *r, uint32_t count, double share, txm_env *env, float at) {
    const double span = share * (double)count / (double)TXS_LONG_STEPS;
    int step = 0, demand = txs_demand(r, 0);
    memset(r->parent, 0xff, (size_t)count * sizeof *r->parent);
    for (uint32_t k = 0; k < count; k++) r->place[r->order[k].value] = k;
    for (uint32_t k = 0; k < count; k++) {
        if (k % TXS_ORDER_REPORT == 0 && txm_progress(env, at, "order")) return 0;
        if (step < TXS_LONG_STEPS && (double)k >= span * (step + 1)) { /* the demand falls */
            demand = txs_demand(r, ++step);
            for (uint32_t i = 0; i < k; i++) {
                const uint32_t p = r->order[i].value;
                if (r->parent[p] == p && txs_region_waits(r, p) &&
                    txs_region_length(r, p) >= demand)
                    txs_release(r, p, k);
            }
        }
        const uint32_t p = r->order[k].value;
        r->order[k].key = count; /* for those that are never released */
        txs_reach_pixel(r, p, k);
        const uint32_t root = txs_root_of(r, p);
        if (txs_region_waits(r, root) && txs_region_length(r, root) >= demand)
            txs_release(r, root, k);
    }
    return 1;
}

/* rank receives for each pixel how many erode before it; memory for the work is taken from arena. */
static txm_status txs_find_ranks(const float *strength, int width, int height, double share,
                                 txm_arena *arena, uint32_t *rank, txm_env *env, float at) {
    const size_t n = txs_pixels_of(width, height);
    txs_regions r;
    txs_queue q;
    q.next = (uint32_t *)txm_arena_alloc(arena, n, 2 * sizeof(uint32_t));
    q.state = (uint8_t *)txm_arena_alloc(arena, n, 1);
    q.first = (uint32_t *)txm_arena_alloc(arena, TXS_STRENGTHS, sizeof(uint32_t));
    r.width = width;
    r.height = height;
    r.order = (txm_pair *)txm_arena_alloc(arena, n, 2 * sizeof(txm_pair));
    r.parent = (uint32_t *)txm_arena_alloc(arena, n, sizeof(uint32_t));
    r.ring = (uint32_t *)txm_arena_alloc(arena, n, sizeof(uint32_t));
    r.place = (uint32_t *)txm_arena_alloc(arena, n, sizeof(uint32_t));
    r.box = (int32_t *)txm_arena_alloc(arena, n, 4 * sizeof(int32_t));
    if (arena->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the order of erosion");
    q.width = width;
    q.height = height;
    q.strength = strength;
    if (!txs_grow_cracks(&q, (uint32_t)n, r.order, env, at) ||
        !txs_reach_all(&r, (uint32_t)n, share, env, at))
        return txm_fail(env, TXM_CANCELLED, "cancelled");
    txm_sort_pairs(r.order, r.order + n, n); /* stable: pixels of a region stay in order */
    for (size_t k = 0; k < n; k++) rank[r.order[k].value] = (uint32_t)k;
    return TXM_OK;
}

/* ---- laying pieces ----------------------------------------------------------------------

   The cracks of a picture of another size: square pieces of the exemplar's are laid in rows, each
   over the borders of its neighbours to the left and above, and joined to them along minimum-error
   cuts [5]. What is compared is the strength along lines, so that cracks meet. Clique statistics do
   not keep thin long lines; pieces do. They are mirrored and turned as far as the exemplar
   has no direction that this would change. A crack that is seen again and again, mirrored or not,
   is conspicuous, so a part of the exemplar costs more the more often it has been used and the
   nearer. Its cells count by their cracks: intact stone may recur. */

enum {
    TXS_PIECE = 192,       /* pixels: side of a piece                                           */
    TXS_PIECE_PARTS = 5,   /* and at most two fifths of the exemplar's shorter side             */
    TXS_OVERLAP_PART = 5,  /* of a piece lies over the one before                               */
    TXS_TRIES = 768,       /* random places that are compared for each piece                    */
    TXS_TRY_STEP = 3,      /* pixels between those of their overlaps that are compared          */
    TXS_FINALISTS = 8,     /* places that are moved a little and compared closely               */
    TXS_MOVES = 3,         /* pixels each way                                                   */
    TXS_MOVED = (2 * TXS_MOVES + 1) * (2 * TXS_MOVES + 1),
    TXS_TRY_SHARES = 16,   /* into which the comparisons are divided for threads                */
    TXS_CELL = 16,         /* pixels: side of a cell of the exemplar whose uses are counted     */
    TXS_NEAR_PIECES = 4,   /* pieces each way in which the same cracks would be noticed         */
    TXS_TURNS = 8          /* ways to lay a square: bit 0 mirrors x, 1 mirrors y, 2 swaps them  */
};
#define TXS_SAME_DIRECTION 0.2  /* the structure of an exemplar without direction is below this */
#define TXS_USED_WEIGHT 2.0     /* of the square of uses over the average, in the cost          */
#define TXS_NEAR_WEIGHT 32.0    /* of a piece all of whose cracks are laid beside it            */
#define TXS_INTACT_CONTENT 0.02 /* of an intact pixel, compared with a crack of strength 1      */
#define TXS_CRACK_WEIGHT 3.0    /* of a crack of strength 1 in the error, compared with 1        */

typedef struct txs_place_of { /* a piece of the exemplar */
    int x, y, turn;
} txs_place_of;

typedef struct txs_laying {
    const txs_stone *stone;
    int width, height;              /* of the picture                                           */
    int side, overlap;
    int32_t *source;                /* for each pixel of the picture one of the exemplar; -1    */
    uint32_t *used;                 /* per cell of the exemplar                                 */
    double *content;                /* of all cells to the left of and above each corner of one */
    int cells_x, cells_y;
    txs_place_of *laid;             /* the pieces laid so far, row by row                       */
    int rows, columns, row, column; /* of pieces, and of the one that is being laid             */
    int turns[TXS_TURNS], turn_count;
    int left, top;                  /* of the piece that is being laid, in the picture          */
    int piece_width, piece_height;  /* the part of it inside the picture                        */
    txs_place_of tries[TXS_TRIES];
    double costs[TXS_TRIES];
    int try_count, try_step;        /* of those that are being compared                         */
    float *error;                   /* of an overlap                                            */
    double *scratch;
    int *path[2];                   /* where the new piece begins: along the left, along the top */
} txs_laying;

/* The exemplar's pixel under pixel (u, v) of a piece. */
static size_t txs_under(const txs_laying *l, const txs_place_of *p, int u, int v) {
    int x = p->turn & 4 ? v : u, y = p->turn & 4 ? u : v;
    if (p->turn & 1) x = l->side - 1 - x;
    if (p->turn & 2) y = l->side - 1 - y;
    return (size_t)(p->y + y) * (size_t)l->stone->width + (size_t)(p->x + x);
}

/* Which turns keep the directions of the exemplar, by its structure tensor: the mirrored one differs
   in the sign of the mixed term, the one turned by a quarter in that of the difference. */
static void txs_find_turns(txs_laying *l) {
    const txs_stone *s = l->stone;
    double xx = 0, xy = 0, yy = 0;
    for (int y = 1; y < s->height; y++) {
        for (int x = 1; x < s->width; x++) {
            const float *p = s->strength + (size_t)y * (size_t)s->width + (size_t)x;
            const double gx = (double)p[0] - (double)p[-1];
            const double gy = (double)p[0] - (double)p[-s->width];
            xx += gx * gx;
            xy += gx * gy;
            yy += gy * gy;
        }
    }
    const double sum = xx + yy;
    const int mirror = 2 * fabs(xy) <= TXS_SAME_DIRECTION * sum;
    const int quarter = fabs(xx - yy) <= TXS_SAME_DIRECTION * sum;
    l->turn_count = 0;
    for (int t = 0; t < TXS_TURNS; t++) {
        const int mirrors = (t & 1) + (t >> 1 & 1), swaps = t >> 2 & 1;
        /* an odd number of reflections negates the mixed term; a swap, the difference */
        const int keeps_mixed = mirror || (mirrors % 2 == 0);
        const int keeps_difference = quarter || !swaps;
        if (keeps_mixed && keeps_difference) l->turns[l->turn_count++] = t;
    }
}

/* What cells from..to (not included) hold of cracks. */
static double txs_content_of(const txs_laying *l, int from_x, int from_y, int to_x, int to_y) {
    const size_t stride = (size_t)l->cells_x + 1;
    const double *above = l->content + (size_t)from_y * stride;
    const double *below = l->content + (size_t)to_y * stride;
    return below[to_x] - below[from_x] - above[to_x] + above[from_x];
}

static void txs_find_content(txs_laying *l) {
    const txs_stone *s = l->stone;
    const size_t stride = (size_t)l->cells_x + 1;
    for (int y = 0; y < s->height; y++) {
        for (int x = 0; x < s->width; x++) {
            const size_t i = (size_t)y * (size_t)s->width + (size_t)x;
            const double crack = s->strength[i] > 0 ? (double)s->strength[i] : 0;
            l->content[(size_t)(y / TXS_CELL + 1) * stride + (size_t)(x / TXS_CELL + 1)] +=
                TXS_INTACT_CONTENT + crack * crack;
        }
    }
    for (size_t y = 1; y <= (size_t)l->cells_y; y++) {
        for (size_t x = 1; x < stride; x++) {
            double *p = l->content + y * stride + x;
            *p += p[-1] + *(p - stride) - *(p - stride - 1);
        }
    }
}

/* The cell border nearest to coordinate x. */
static int txs_cell_border(int x) { return (x + TXS_CELL / 2) / TXS_CELL; }

/* What two pieces share, as a part of what the first one holds. */
static double txs_shared(const txs_laying *l, const txs_place_of *p, const txs_place_of *q) {
    const int left = txs_cell_border(p->x > q->x ? p->x : q->x);
    const int top = txs_cell_border(p->y > q->y ? p->y : q->y);
    const int right = txs_cell_border((p->x < q->x ? p->x : q->x) + l->side);
    const int bottom = txs_cell_border((p->y < q->y ? p->y : q->y) + l->side);
    if (left >= right || top >= bottom) return 0;
    const int end_x = txm_clampi(right, 0, l->cells_x), end_y = txm_clampi(bottom, 0, l->cells_y);
    if (left >= end_x || top >= end_y) return 0;
    const int most_x = txm_clampi(txs_cell_border(p->x + l->side), 0, l->cells_x);
    const int most_y = txm_clampi(txs_cell_border(p->y + l->side), 0, l->cells_y);
    return txs_content_of(l, left, top, end_x, end_y) /
           txs_content_of(l, txs_cell_border(p->x), txs_cell_border(p->y), most_x, most_y);
}

/* How much of a piece is laid near by already, the nearer the more. */
static double txs_seen_near(const txs_laying *l, const txs_place_of *p) {
    double sum = 0;
    for (int row = txm_clampi(l->row - TXS_NEAR_PIECES, 0, l->row); row <= l->row; row++) {
        const int from = l->column - TXS_NEAR_PIECES, to = l->column + TXS_NEAR_PIECES + 1;
        const int end = row == l->row ? l->column : to < l->columns ? to : l->columns;
        for (int column = from > 0 ? from : 0; column < end; column++) {
            const int across = column - l->column, down = row - l->row;
            const double nearness =
                1 - sqrt((double)(across * across + down * down)) / (TXS_NEAR_PIECES + 1);
            if (nearness <= 0) continue;
            sum += nearness * nearness * txs_shared(l, p, &l->laid[row * l->columns + column]);
        }
    }
    return sum;
}

/* Mean uses of the cells under a piece, by their contents, over what they would be if all cells were
   used alike. */
static double txs_uses_of(const txs_laying *l, const txs_place_of *p) {
    double sum = 0, content = 0;
    for (int y = p->y / TXS_CELL; y <= (p->y + l->side - 1) / TXS_CELL; y++) {
        for (int x = p->x / TXS_CELL; x <= (p->x + l->side - 1) / TXS_CELL; x++) {
            const double c = txs_content_of(l, x, y, x + 1, y + 1);
            sum += c * (double)l->used[(size_t)y * (size_t)l->cells_x + (size_t)x];
            content += c;
        }
    }
    const double per_piece = (double)(l->side + TXS_CELL) * (double)(l->side + TXS_CELL) /
                             ((double)l->stone->width * (double)l->stone->height);
    return sum / content / (1 + (double)(l->row * l->columns + l->column) * per_piece);
}

static void txs_count_use(txs_laying *l, const txs_place_of *p) {
    for (int y = p->y / TXS_CELL; y <= (p->y + l->side - 1) / TXS_CELL; y++) {
        for (int x = p->x / TXS_CELL; x <= (p->x + l->side - 1) / TXS_CELL; x++)
            l->used[(size_t)y * (size_t)l->cells_x + (size_t)x]++;
    }
    TEXSYN_ASSERT(l->row < l->rows && l->column < l->columns);
    l->laid[l->row * l->columns + l->column] = *p;
}

/* Squared difference of strengths where a piece lies on what is there; cracks count more than what is
   between them. */
static double txs_error_at(const txs_laying *l, const txs_place_of *p, int u, int v) {
    const size_t at = (size_t)(l->top + v) * (size_t)l->width + (size_t)(l->left + u);
    const double a = (double)l->stone->strength[txs_under(l, p, u, v)];
    const double b = (double)l->stone->strength[l->source[at]];
    const double crack = a > b ? a : b;
    return (a - b) * (a - b) * (crack > 0 ? 1 + TXS_CRACK_WEIGHT * crack : 1);
}

/* Mean error over every try_step-th row and column of the overlap; unknown pixels of the exemplar count as
   the largest error. */
static double txs_try_cost(const txs_laying *l, const txs_place_of *p) {
    double sum = 0, count = 1e-6, unknown = 0, seen = 0;
    for (int v = 0; v < l->piece_height; v += l->try_step) {
        for (int u = 0; u < l->piece_width; u += l->try_step) {
            seen++;
            unknown += !l->stone->known[txs_under(l, p, u, v)];
            if (!((l->left && u < l->overlap) || (l->top && v < l->overlap))) continue;
            sum += txs_error_at(l, p, u, v);
            count++;
        }
    }
    const double steep = (double)(TXS_MOST_DARK - TXS_LEAST_DARK);
    const double base = 0.02; /* so that uses count among places of equal error */
    const double uses = txs_uses_of(l, p);
    const double again = TXS_USED_WEIGHT * uses * uses + TXS_NEAR_WEIGHT * txs_seen_near(l, p);
    return (base + sum / count) * (1 + again) +
           steep * steep * unknown / seen;
}

static void txs_try_share(void *context, int share) {
    txs_laying *l = (txs_laying *)context;
    for (int i = share; i < l->try_count; i += TXS_TRY_SHARES)
        l->costs[i] = txs_try_cost(l, &l->tries[i]);
}

/* Compare the tries, every step-th pixel each way. Returns the best one. */
static int txs_compare_tries(txs_laying *l, int count, int step, txm_env *env) {
    int best = 0;
    l->try_count = count;
    l->try_step = step;
    txm_parallel_for(env, TXS_TRY_SHARES, txs_try_share, l);
    for (int i = 1; i < count; i++)
        if (l->costs[i] < l->costs[best]) best = i;
    return best;
}

/* Replace the tries by the best of them, each moved by up to TXS_MOVES pixels. Returns how many. */
static int txs_move_tries(txs_laying *l) {
    txs_place_of finalists[TXS_FINALISTS];
    int count = 0;
    for (int k = 0; k < TXS_FINALISTS; k++) {
        int best = 0;
        for (int i = 1; i < l->try_count; i++)
            if (l->costs[i] < l->costs[best]) best = i;
        finalists[k] = l->tries[best];
        l->costs[best] = 1e300;
    }
    for (int k = 0; k < TXS_FINALISTS; k++) {
        for (int i = 0; i < TXS_MOVED; i++) {
            TEXSYN_ASSERT(count < TXS_TRIES);
            txs_place_of *p = &l->tries[count++];
            const int side = 2 * TXS_MOVES + 1;
            *p = finalists[k];
            p->x = txm_clampi(p->x + i % side - TXS_MOVES, 0, l->stone->width - l->side);
            p->y = txm_clampi(p->y + i / side - TXS_MOVES, 0, l->stone->height - l->side);
        }
    }
    return count;
}

/* The best place for the piece at (left, top): of many random ones, then near the best of these. */
static const txs_place_of *txs_choose_place(txs_laying *l, txm_rng *rng, txm_env *env) {
    for (int i = 0; i < TXS_TRIES; i++) {
        txs_place_of *p = &l->tries[i];
        p->x = txm_rng_range(rng, 0, l->stone->width - l->side);
        p->y = txm_rng_range(rng, 0, l->stone->height - l->side);
        p->turn = l->turns[txm_rng_below(rng, (uint32_t)l->turn_count)];
    }
    txs_compare_tries(l, TXS_TRIES, TXS_TRY_STEP, env);
    return &l->tries[txs_compare_tries(l, txs_move_tries(l), 2, env)];
}

/* Where the piece begins in each row of its left overlap (top = 0) or column of its upper one. */
static void txs_cut_overlap(txs_laying *l, const txs_place_of *p, int top) {
    const int length = top ? l->piece_width : l->piece_height;
    const int across = top ? l->piece_height : l->piece_width;
    const int width = l->overlap < across ? l->overlap : across;
    for (int i = 0; i < length; i++) {
        for (int j = 0; j < width; j++)
            l->error[i * width + j] =
                txm_float(1e-3 + (top ? txs_error_at(l, p, i, j) : txs_error_at(l, p, j, i)));
    }
    txm_cut(l->error, length, width, width, 1, l->path[top], l->scratch);
}

static void txs_lay_piece(txs_laying *l, const txs_place_of *p) {
    if (l->left) txs_cut_overlap(l, p, 0);
    if (l->top) txs_cut_overlap(l, p, 1);
    for (int v = 0; v < l->piece_height; v++) {
        for (int u = 0; u < l->piece_width; u++) {
            if ((l->left && u < l->path[0][v]) || (l->top && v < l->path[1][u])) continue;
            l->source[(size_t)(l->top + v) * (size_t)l->width + (size_t)(l->left + u)] =
                (int32_t)txs_under(l, p, u, v);
        }
    }
}

/* Pieces that cover a length of the picture, each but the first `overlap` over the one before. */
static int txs_count_pieces(int length, int overlap, int step) {
    return length <= overlap ? 1 : (length - overlap - 1) / step + 1;
}

/* Fill source; memory for the work is taken from arena. Reports from..to. */
static txm_status txs_lay_all(const txs_stone *stone, int width, int height, uint64_t seed,
                              txm_arena *arena, int32_t *source, txm_env *env, float from,
                              float to) {
    const int shorter = stone->width < stone->height ? stone->width : stone->height;
    txs_laying *l = (txs_laying *)txm_arena_zero(arena, 1, sizeof *l);
    if (!l) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the cracks");
    l->stone = stone;
    l->width = width;
    l->height = height;
    l->source = source;
    l->side = 2 * shorter / TXS_PIECE_PARTS;
    if (l->side > TXS_PIECE) l->side = TXS_PIECE;
    l->overlap = l->side / TXS_OVERLAP_PART;
    l->cells_x = (stone->width - 1) / TXS_CELL + 1;
    l->cells_y = (stone->height - 1) / TXS_CELL + 1;
    l->used = (uint32_t *)txm_arena_zero(arena, txs_pixels_of(l->cells_x, l->cells_y),
                                         sizeof(uint32_t));
    l->content = (double *)txm_arena_zero(arena, txs_pixels_of(l->cells_x + 1, l->cells_y + 1),
                                          sizeof(double));
    const int step = l->side - l->overlap;
    l->rows = txs_count_pieces(height, l->overlap, step);
    l->columns = txs_count_pieces(width, l->overlap, step);
    l->laid = (txs_place_of *)txm_arena_alloc(arena, txs_pixels_of(l->columns, l->rows),
                                              sizeof(txs_place_of));
    const size_t strip = (size_t)l->side * (size_t)l->overlap;
    l->error = (float *)txm_arena_alloc(arena, strip, sizeof(float));
    l->scratch = (double *)txm_arena_alloc(arena, strip, sizeof(double));
    l->path[0] = (int *)txm_arena_alloc(arena, (size_t)l->side, sizeof(int));
    l->path[1] = (int *)txm_arena_alloc(arena, (size_t)l->side, sizeof(int));
    if (arena->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the cracks");
    txs_find_turns(l);
    txs_find_content(l);
    txm_rng rng = txm_rng_make(seed, 1);
    for (l->row = 0; l->row < l->rows; l->row++) {
        l->top = l->row * step;
        if (txm_progress(env, txm_lerpf(from, to, (float)l->top / (float)height), "lay cracks"))
            return txm_fail(env, TXM_CANCELLED, "cancelled");
        l->piece_height = l->side < height - l->top ? l->side : height - l->top;
        for (l->column = 0; l->column < l->columns; l->column++) {
            l->left = l->column * step;
            l->piece_width = l->side < width - l->left ? l->side : width - l->left;
            const txs_place_of *p = txs_choose_place(l, &rng, env);
            txs_lay_piece(l, p);
            txs_count_use(l, p);
        }
    }
    return TXM_OK;
}

/* ---- erosion: the exemplar -------------------------------------------------------------- */

enum {
    TXS_LEAST_STONE = 32, /* pixels: shorter exemplars have no cracks to speak of                */
    TXS_DEPTHS = 8,       /* parts of the order in which ratios are limited                      */
    TXS_INTACT_BORDER = 2 /* pixels around cracks that do not count as intact                    */
};
#define TXS_SHARE 0.1f       /* of the picture that is eroded at level 1                      */
#define TXS_MOST_SHARE 0.5f
#define TXS_LIGHTEST 0.75    /* the lightest quarter of each depth is limited to the rest        */

struct texsyn_erosion {
    txm_arena arena; /* holds all, this struct too                                        */
    int width, height;
    float share;
    uint32_t *rank; /* of each pixel: how many erode before it                           */
    uint8_t *ratio; /* 3 per pixel: what its colour is multiplied by, of TXS_RATIO_ONE   */
};

static txm_status txs_check_erosion(const texsyn_erosion_desc *d, txm_env *env) {
    if (!d) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL");
    txm_status status = txm_image_check(&d->weathered, "weathered", TEXSYN_MAX_PIXELS, env);
    if (status == TXM_OK) status = txs_check_mask(&d->mask, &d->weathered, "mask", env);
    if (status != TXM_OK) return status;
    if (!(d->share >= 0 && d->share <= TXS_MOST_SHARE))
        return txm_fail(env, TXM_BAD_ARGUMENT, "share must be 0 (default) to 0.5");
    if (!txs_image_is_moderate(&d->weathered))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "weathered",
                           "has samples that are not finite or beyond a million");
    if (d->weathered.width < TXS_LEAST_STONE || d->weathered.height < TXS_LEAST_STONE)
        return txm_fail_numbers_at(env, TXM_TOO_SMALL, "weathered", "must be at least # x #",
                                   TXS_LEAST_STONE, TXS_LEAST_STONE);
    return TXM_OK;
}

/* How many pixels are known: opaque and in the mask. */
static size_t txs_find_known(txs_stone *s, const txm_image *im, const txm_image *mask) {
    size_t count = 0;
    if (mask->pixels) txm_mask_read(mask, TXM_MASK_ALLOWS, s->known);
    for (int y = 0; y < s->height; y++) {
        for (int x = 0; x < s->width; x++) {
            uint8_t *known = &s->known[(size_t)y * (size_t)s->width + (size_t)x];
            int ok = !mask->pixels || *known;
            if (im->channels % 2 == 0)
                ok = ok && txm_image_get(im, x, y, im->channels - 1) >= 0.5f;
            *known = (uint8_t)ok;
            count += (size_t)ok;
        }
    }
    return count;
}

/* The planes of an exemplar, in arena; the room for the filters too. */
static txm_status txs_make_stone(const texsyn_erosion_desc *d, txm_arena *arena, txs_stone *s,
                                 txm_env *env, float from, float to) {
    const txm_image im = txm_image_resolve(d->weathered);
    const size_t n = txs_pixels_of(im.width, im.height);
    const size_t longer = (size_t)(im.width > im.height ? im.width : im.height);
    txs_filter_room room;
    s->width = im.width;
    s->height = im.height;
    s->dark = (float *)txm_arena_alloc(arena, n, sizeof(float));
    s->strength = (float *)txm_arena_alloc(arena, n, sizeof(float));
    s->ratio = (uint8_t *)txm_arena_alloc(arena, n, 3);
    s->known = (uint8_t *)txm_arena_alloc(arena, n, 1);
    room.weight = (float *)txm_arena_alloc(arena, n, sizeof(float));
    room.mean = (float *)txm_arena_alloc(arena, n, sizeof(float));
    room.wide = (float *)txm_arena_alloc(arena, n, sizeof(float));
    room.square = (float *)txm_arena_alloc(arena, n, sizeof(float));
    room.line = (float *)txm_arena_alloc(arena, longer, sizeof(float));
    if (arena->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the exemplar");
    if (txm_progress(env, from, "darkness")) return txm_fail(env, TXM_CANCELLED, "cancelled");
    if (txs_find_known(s, &im, &d->mask) < (size_t)TXS_LEAST_STONE * TXS_LEAST_STONE)
        return txm_fail_numbers_at(env, TXM_TOO_SMALL, "weathered",
                                   "fewer than # opaque pixels in the mask",
                                   (uint64_t)TXS_LEAST_STONE * TXS_LEAST_STONE, 0);
    txs_find_dark(s, &im, &room);
    txs_find_ratios(s, &im, &room);
    return txs_find_strength(s->dark, s->strength, s->width, s->height, env,
                             txm_lerpf(from, to, 0.3f), to);
}

/* The ratio of the luma, of TXS_RATIO_ONE. */
static int txs_gray_ratio(const uint8_t ratio[3]) {
    return (77 * ratio[0] + 150 * ratio[1] + 29 * ratio[2] + 128) >> 8;
}

/* which depth a rank is, TXS_DEPTHS for those beyond the share */
static int txs_depth_of(uint32_t rank, double most) {
    const double depth = (double)rank / most * (double)TXS_DEPTHS;
    return depth < (double)TXS_DEPTHS ? (int)depth : TXS_DEPTHS;
}

/* The largest gray ratio of each depth of the exemplar, but for the lightest quarter: bridges between
   the parts of a crack are as dark as the crack. */
static void txs_find_limits(const txs_stone *s, const uint32_t *rank, double most,
                            int limit[TXS_DEPTHS]) {
    uint32_t histogram[TXS_DEPTHS][256];
    const size_t n = txs_pixels_of(s->width, s->height);
    memset(histogram, 0, sizeof histogram);
    for (size_t i = 0; i < n; i++) {
        const int depth = txs_depth_of(rank[i], most);
        if (depth < TXS_DEPTHS && s->known[i])
            histogram[depth][txs_gray_ratio(s->ratio + 3 * i)]++;
    }
    for (int d = 0; d < TXS_DEPTHS; d++) {
        uint64_t count = 0, seen = 0;
        for (int v = 0; v < 256; v++) count += histogram[d][v];
        limit[d] = TXS_RATIO_ONE;
        for (int v = 0; v < TXS_RATIO_ONE && count; v++) {
            seen += histogram[d][v];
            if ((double)seen < TXS_LIGHTEST * (double)count) continue;
            limit[d] = v;
            break;
        }
    }
}

/* What the stone becomes at each pixel: the exemplar's ratios, limited by depth. */
static void txs_take_ratios(texsyn_erosion *e, const txs_stone *s, const int32_t *source,
                            const int limit[TXS_DEPTHS]) {
    const size_t n = txs_pixels_of(e->width, e->height);
    const double most = (double)e->share * (double)n;
    for (size_t i = 0; i < n; i++) {
        const uint8_t *from = s->ratio + 3 * (size_t)source[i];
        const int depth = txs_depth_of(e->rank[i], most), gray = txs_gray_ratio(from);
        const int most_gray = limit[depth < TXS_DEPTHS ? depth : TXS_DEPTHS - 1];
        for (size_t c = 0; c < 3; c++)
            e->ratio[3 * i + c] =
                gray <= most_gray ? from[c] : (uint8_t)((from[c] * most_gray + gray / 2) / gray);
    }
}

/* ---- erosion: making -------------------------------------------------------------------- */

/* Everything between the check and the object; planes that are no longer needed are in work. */
static txm_status txs_erode_exemplar(const texsyn_erosion_desc *d, texsyn_erosion *e,
                                     txm_arena *work, txm_env *env) {
    txs_stone stone;
    int limit[TXS_DEPTHS];
    const size_t n = txs_pixels_of(e->width, e->height);
    txm_status status = txs_make_stone(d, work, &stone, env, 0, 0.2f);
    if (status != TXM_OK) return status;
    const size_t size = txs_pixels_of(stone.width, stone.height);
    uint32_t *rank = (uint32_t *)txm_arena_alloc(work, size, sizeof(uint32_t));
    int32_t *source = (int32_t *)txm_arena_alloc(work, n, sizeof(int32_t));
    float *dark = (float *)txm_arena_alloc(work, n, sizeof(float));
    float *strength = (float *)txm_arena_alloc(work, n, sizeof(float));
    if (work->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the cracks");
    status = txs_find_ranks(stone.strength, stone.width, stone.height, (double)e->share, work, rank,
                            env, 0.2f);
    if (status == TXM_OK)
        status = txs_lay_all(&stone, e->width, e->height, d->seed, work, source, env, 0.25f, 0.6f);
    if (status != TXM_OK) return status;
    for (size_t i = 0; i < n; i++) dark[i] = stone.dark[source[i]];
    status = txs_find_strength(dark, strength, e->width, e->height, env, 0.6f, 0.85f);
    if (status == TXM_OK)
        status = txs_find_ranks(strength, e->width, e->height, (double)e->share, work, e->rank, env,
                                0.85f);
    if (status != TXM_OK) return status;
    txs_find_limits(&stone, rank, (double)e->share * (double)size, limit);
    txs_take_ratios(e, &stone, source, limit);
    return TXM_OK;
}

TEXSYN_API txm_status texsyn_erosion_make(const texsyn_erosion_desc *desc, txm_env *env,
                                          texsyn_erosion **out) {
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    txm_status status = txs_check_erosion(desc, env);
    if (status != TXM_OK) return status;
    if (desc->width < 1 || desc->height < 1)
        return txm_fail(env, TXM_BAD_ARGUMENT, "width and height must be 1 or more");
    if (desc->height > TEXSYN_MAX_PIXELS / desc->width)
        return txm_fail(env, TXM_TOO_LARGE, "more than TEXSYN_MAX_PIXELS pixels");

    txm_arena own, work;
    txm_arena_init(&own, env);
    txm_arena_init(&work, env);
    const size_t n = txs_pixels_of(desc->width, desc->height);
    texsyn_erosion *e = (texsyn_erosion *)txm_arena_alloc(&own, 1, sizeof *e);
    uint32_t *rank = (uint32_t *)txm_arena_alloc(&own, n, sizeof(uint32_t));
    uint8_t *ratio = (uint8_t *)txm_arena_alloc(&own, n, 3);
    if (own.failed) {
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the erosion");
    } else {
        e->width = desc->width;
        e->height = desc->height;
        e->share = desc->share > 0 ? desc->share : TXS_SHARE;
        e->rank = rank;
        e->ratio = ratio;
        status = txs_erode_exemplar(desc, e, &work, env);
    }
    txm_arena_free(&work);
    if (status == TXM_OK && txm_progress(env, 1, "done"))
        status = txm_fail(env, TXM_CANCELLED, "cancelled");
    if (status != TXM_OK) {
        txm_arena_free(&own);
        return status;
    }
    e->arena = own;
    *out = e;
    return TXM_OK;
}

TEXSYN_API void texsyn_erosion_free(texsyn_erosion *erosion) {
    if (!erosion) return;
    txm_arena arena = erosion->arena;
    txm_arena_free(&arena);
}

TEXSYN_API float texsyn_erosion_share(const texsyn_erosion *erosion) {
    return erosion ? erosion->share : 0;
}

/* ---- erosion: drawing ------------------------------------------------------------------- */

enum { TXS_COVERED = 16 }; /* weight of a pixel all of whose neighbours are eroded as well */

typedef struct txs_level_of { /* how far a pixel is eroded */
    const texsyn_erosion *erosion;
    float level;
    const txm_image *levels;
    double most;
} txs_level_of;

static int txs_is_eroded(const txs_level_of *l, int x, int y) {
    double level = (double)l->level;
    if (l->levels) {
        const int channels = l->levels->channels;
        level *= (double)txm_clampf(txm_image_get(l->levels, x, y, 0), 0, 1);
        if (channels == 2) level *= (double)txm_clampf(txm_image_get(l->levels, x, y, 1), 0, 1);
    }
    const size_t i = (size_t)y * (size_t)l->erosion->width + (size_t)x;
    return (double)l->erosion->rank[i] < floor(level * l->most + 0.5);
}

static txm_status txs_check_levels(const texsyn_erosion *e, float level, const txm_image *levels,
                                   txm_env *env) {
    if (!e) return txm_fail(env, TXM_BAD_ARGUMENT, "erosion is NULL");
    if (!(level >= 0 && level <= 1))
        return txm_fail(env, TXM_BAD_ARGUMENT, "level must be 0 to 1");
    if (!levels) return TXM_OK;
    const txm_status status = txm_image_check(levels, "levels", TEXSYN_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    if (levels->channels > 2)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "levels", "must be gray, with or without alpha");
    if (levels->width != e->width || levels->height != e->height)
        return txm_fail_numbers_at(env, TXM_BAD_ARGUMENT, "levels", "must be # x # like the erosion",
                                   (uint64_t)e->width, (uint64_t)e->height);
    if (!txm_image_is_finite(levels))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "levels", "has samples that are not finite");
    return TXM_OK;
}

static txs_level_of txs_level_make(const texsyn_erosion *e, float level, const txm_image *levels) {
    txs_level_of l;
    l.erosion = e;
    l.level = level;
    l.levels = levels;
    l.most = (double)e->share * (double)txs_pixels_of(e->width, e->height);
    return l;
}

TEXSYN_API txm_status texsyn_erosion_mask(const texsyn_erosion *erosion, float level,
                                          const txm_image *levels, txm_env *env, txm_image out) {
    txm_status status = txs_check_levels(erosion, level, levels, env);
    if (status == TXM_OK) status = txm_image_check(&out, "out", TEXSYN_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    if (out.width != erosion->width || out.height != erosion->height || out.channels > 1)
        return txm_fail_numbers_at(env, TXM_BAD_ARGUMENT, "out", "must be # x #, with one channel",
                                   (uint64_t)erosion->width, (uint64_t)erosion->height);
    const txs_level_of l = txs_level_make(erosion, level, levels);
    for (int y = 0; y < out.height; y++) {
        for (int x = 0; x < out.width; x++)
            txm_image_set(&out, x, y, 0, txs_is_eroded(&l, x, y) ? 1.0f : 0.0f);
    }
    return TXM_OK;
}

/* How much of a pixel is covered, 0..TXS_COVERED: a tent over its neighbours; an eroded pixel at least
   three quarters, another at most half, so that lines of one pixel are dark and rims are soft. */
static int txs_cover(const uint8_t *const rows[3], int x, int width) {
    static const int weight[3][3] = {{1, 2, 1}, {2, 4, 2}, {1, 2, 1}};
    int sum = 0;
    for (int v = 0; v < 3; v++) {
        for (int u = 0; u < 3; u++)
            sum += weight[v][u] * rows[v][txm_clampi(x + u - 1, 0, width - 1)];
    }
    const int least = TXS_COVERED * 3 / 4;
    if (rows[1][x]) return sum > least ? sum : least;
    return sum / 2;
}

/* One pixel of the picture; one that nothing covers is copied as it is. */
static void txs_erode_pixel(const texsyn_erosion *e, const txm_image *from, const txm_image *to, int x,
                            int y, int cover) {
    const uint8_t *ratio = e->ratio + 3 * ((size_t)y * (size_t)e->width + (size_t)x);
    const int colours = from->channels < 3 ? 1 : 3;
    for (int c = 0; c < from->channels; c++) {
        const float v = txm_image_get(from, x, y, c);
        const int one = TXS_RATIO_ONE, whole = one * (int)TXS_COVERED;
        const int r = colours == 1 ? txs_gray_ratio(ratio) : c < 3 ? ratio[c] : one;
        const double factor = (whole - cover * (one - r)) / (double)whole;
        txm_image_set(to, x, y, c, c < colours && cover ? txm_float((double)v * factor) : v);
    }
}

TEXSYN_API txm_status texsyn_erosion_draw(const texsyn_erosion *erosion, float level,
                                          const txm_image *levels, const txm_image *picture,
                                          txm_env *env, txm_image out) {
    txm_status status = txs_check_levels(erosion, level, levels, env);
    if (status == TXM_OK) status = txm_image_check(picture, "picture", TEXSYN_MAX_PIXELS, env);
    if (status == TXM_OK) status = txm_image_check(&out, "out", TEXSYN_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    txm_image from = txm_image_resolve(*picture);
    const txm_image to = txm_image_resolve(out);
    if (from.width != erosion->width || from.height != erosion->height)
        return txm_fail_numbers_at(env, TXM_BAD_ARGUMENT, "picture", "must be # x # like the erosion",
                                   (uint64_t)erosion->width, (uint64_t)erosion->height);
    if (to.width != from.width || to.height != from.height || to.channels != from.channels)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "out",
                           "must have the size and the channels of the picture");
    if (!txm_image_is_finite(&from))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "picture", "has samples that are not finite");

    /* three rows of the mask, those above and below the one that is drawn */
    const size_t width = (size_t)from.width;
    txm_arena arena;
    txm_arena_init(&arena, env);
    uint8_t *mask = (uint8_t *)txm_arena_alloc(&arena, 3, width);
    status = mask ? txm_image_bled(picture, 0, &arena, env, &from)
                  : txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for three rows");
    const txs_level_of l = txs_level_make(erosion, level, levels);
    for (int y = 0; y <= from.height && status == TXM_OK; y++) {
        uint8_t *next = mask + width * (size_t)(y % 3);
        for (int x = 0; x < from.width && y < from.height; x++)
            next[x] = (uint8_t)txs_is_eroded(&l, x, y);
        if (y == 0) continue;
        const uint8_t *const rows[3] = {mask + width * (size_t)((y > 1 ? y - 2 : 0) % 3),
                                        mask + width * (size_t)((y - 1) % 3),
                                        y < from.height ? next : mask + width * (size_t)((y - 1) % 3)};
        for (int x = 0; x < from.width; x++)
            txs_erode_pixel(erosion, &from, &to, x, y - 1, txs_cover(rows, x, from.width));
    }
    txm_arena_free(&arena);
    return status;
}

/* ---- the intact stone ------------------------------------------------------------------- */

/* Is there a crack within TXS_INTACT_BORDER pixels? */
static int txs_near_crack(const txs_stone *s, const uint32_t *rank, double most, int x, int y) {
    for (int v = y - TXS_INTACT_BORDER; v <= y + TXS_INTACT_BORDER; v++) {
        for (int u = x - TXS_INTACT_BORDER; u <= x + TXS_INTACT_BORDER; u++) {
            if (u < 0 || v < 0 || u >= s->width || v >= s->height) continue;
            if ((double)rank[(size_t)v * (size_t)s->width + (size_t)u] < most) return 1;
        }
    }
    return 0;
}

TEXSYN_API txm_status texsyn_erosion_intact(const texsyn_erosion_desc *desc, txm_env *env,
                                            txm_image out) {
    txm_status status = txs_check_erosion(desc, env);
    if (status == TXM_OK) status = txm_image_check(&out, "out", TEXSYN_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    if (out.width != desc->weathered.width || out.height != desc->weathered.height ||
        out.channels > 1)
        return txm_fail_numbers_at(env, TXM_BAD_ARGUMENT, "out", "must be # x #, with one channel",
                                   (uint64_t)desc->weathered.width,
                                   (uint64_t)desc->weathered.height);
    txm_arena work;
    txs_stone stone;
    const size_t n = txs_pixels_of(out.width, out.height);
    const double share = (double)(desc->share > 0 ? desc->share : TXS_SHARE);
    txm_arena_init(&work, env);
    status = txs_make_stone(desc, &work, &stone, env, 0, 0.7f);
    uint32_t *rank = status == TXM_OK ? (uint32_t *)txm_arena_alloc(&work, n, sizeof(uint32_t)) : NULL;
    if (status == TXM_OK && !rank) status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the order");
    if (status == TXM_OK)
        status = txs_find_ranks(stone.strength, out.width, out.height, share, &work, rank, env, 0.7f);
    if (status == TXM_OK && txm_progress(env, 1, "done"))
        status = txm_fail(env, TXM_CANCELLED, "cancelled");
    for (int y = 0; y < out.height && status == TXM_OK; y++) {
        for (int x = 0; x < out.width; x++) {
            const int intact = stone.known[(size_t)y * (size_t)out.width + (size_t)x] &&
                               !txs_near_crack(&stone, rank, floor(share * (double)n + 0.5), x, y);
            txm_image_set(&out, x, y, 0, intact ? 1.0f : 0.0f);
        }
    }
    txm_arena_free(&work);
    return status;
}


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
