/* texsyn.h - v0.1.0 - learn a texture as a small table of statistics, synthesise any amount of it
   SPDX-License-Identifier: MIT                                (full text: end of file)

   (head comment to be completed)                                                        */
#ifndef TEXSYN_H
#define TEXSYN_H

#include "texmath.h"

#define TEXSYN_VERSION "0.1.0"

#ifndef TEXSYN_MAX_PIXELS
#define TEXSYN_MAX_PIXELS (1 << 28) /* larger images are refused */
#endif

#ifdef TEXSYN_STATIC
#define TEXSYN_API static
#else
#define TEXSYN_API extern
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* ---- learning --------------------------------------------------------------------------- */

/* A learned texture; a value of its own, never changed after it is made. */
typedef struct texsyn_model texsyn_model;

typedef struct texsyn_learn_desc {
    txm_image example; /* 1, 3 or 4 channels, both sides at least 16 px; not modified, need not
                          outlive the call                                                       */
    txm_image mask;    /* same size, 1 channel: learn where it is not 0; pixels NULL = everywhere */
    int max_distance;  /* longest clique in pixels of the example, 2..60; 0 = 40                  */
    int max_types;     /* clique types per pyramid level beyond the preselected, 1..60; 0 = 16    */
    int levels;        /* pyramid levels, 1..6; 0 = as many as leave the short side about 64 px   */
    float threshold;   /* stop adding types when no histogram differs by more, > 0; 0 = 0.02      */
    uint64_t seed;     /* of the random numbers; any value                                        */
} texsyn_learn_desc;

/* Learn a model. *out receives it, or NULL on any error; release it with texsyn_free.
   TXM_OK, TXM_BAD_ARGUMENT, TXM_TOO_SMALL, TXM_TOO_LARGE, TXM_OUT_OF_MEMORY, TXM_CANCELLED. */
TEXSYN_API txm_status texsyn_learn(const texsyn_learn_desc *desc, txm_env *env,
                                   texsyn_model **out);

/* Release a model by the allocator it was made with; NULL is allowed. */
TEXSYN_API void texsyn_free(texsyn_model *model);

/* ---- looking into a model --------------------------------------------------------------- */

typedef enum texsyn_kind {
    TEXSYN_SINGLE = 0, /* one pixel:  I_b(p)                                                     */
    TEXSYN_PAIR,       /* two pixels: I_c(p + d) - I_b(p), head minus tail                       */
    TEXSYN_PARENT,     /* a pixel and the coarser level above it: J_c(p) - I_b(p)                */
    TEXSYN_TRIPLE      /* three in a row: I_b(p - d) + I_b(p + d) - 2 I_b(p)                     */
} texsyn_kind;

/* One clique type of a model's neighbourhood system. */
typedef struct texsyn_clique {
    texsyn_kind kind;
    int level;       /* 0 = full resolution                                                      */
    int band, other; /* tail band b, head band c (equal within a band)                           */
    int dx, dy;      /* displacement d in pixels of that level                                   */
    float distance;  /* Euclidean distance of its histograms, example to the learning's synthesis */
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

/* Write the model as bytes. *size receives the number of bytes needed; with buffer NULL nothing
   else happens. TXM_TOO_SMALL if capacity < *size. */
TEXSYN_API txm_status texsyn_save(const texsyn_model *model, txm_env *env, void *buffer,
                                  size_t capacity, size_t *size);

/* Read a model back. Never trusts the bytes: TXM_BAD_DATA for anything but a whole, intact model. */
TEXSYN_API txm_status texsyn_load(const void *data, size_t size, txm_env *env, texsyn_model **out);

/* ---- synthesis -------------------------------------------------------------------------- */

typedef struct texsyn_synth_desc {
    const texsyn_model *model; /* must outlive the job                                          */
    int width, height;         /* of the output in pixels, 1 or more each                        */
    int tileable;              /* non-zero: the output continues across its own borders          */
    int quality;               /* -2 fast .. +2 best: fewer or more sweeps; 0 = default          */
    uint64_t seed;             /* another seed, another picture                                  */
} texsyn_synth_desc;

/* The simple way: one call. out is the caller's: desc->width x desc->height, texsyn_channels
   (or 3 where the model has 1, or 4 = opaque). Untouched after an error. */
TEXSYN_API txm_status texsyn_synthesize(const texsyn_synth_desc *desc, txm_env *env,
                                        txm_image out);

/* The stepping way, for progressive display. */
typedef struct texsyn_job texsyn_job;

TEXSYN_API txm_status texsyn_begin(const texsyn_synth_desc *desc, txm_env *env, texsyn_job **job);
/* Do one sweep. *done (0..1) reaches 1 when the last one is made. */
TEXSYN_API txm_status texsyn_step(texsyn_job *job, txm_env *env, float *done);
/* The picture so far at full size, at any time, a finished one at the end. */
TEXSYN_API txm_status texsyn_image(const texsyn_job *job, txm_env *env, txm_image out);
TEXSYN_API void texsyn_end(texsyn_job *job);

#ifdef __cplusplus
}
#endif
#endif /* TEXSYN_H */
