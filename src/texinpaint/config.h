#ifndef TEXINPAINT_CONFIG_H
#define TEXINPAINT_CONFIG_H

#include "../texinpaint.h"

/* ---- windows --------------------------------------------------------------------------------
   All completion is done in windows: flat pictures of a part of the surface (or of the picture)
   with a hole in it. The surface is laid out almost without distortion, so that a window's
   pixels have about the same size, that of a texel in the hole. A pixel is TXI_HOLE if it is to
   be filled. */

enum {
    TXI_VOID = 0,    /* no surface here                                                        */
    TXI_KNOWN = 1,   /* may be copied from                                                     */
    TXI_HOLE = 2,    /* to be completed                                                        */
    TXI_FOREIGN = 3, /* known, but not to be copied from (desc.source)                         */
    TXI_MAX_CHANNELS = 4
};
#define TXI_MOST_SAMPLE 1e30f /* of a picture: squares of sums of samples are finite doubles    */

/* A missing texel of the texture and where it lies in the window. */
typedef struct txi_target {
    uint32_t texel;  /* y * width + x in the texture                                           */
    float x, y;      /* window pixels; pixel centres are whole numbers                         */
    txm_vec2 axis;   /* direction of the texture's u axis in the window, unit                  */
    int mirrored;    /* the texture is mirrored in the window: v axis = axis turned left, not
                        right                                                                    */
} txi_target;

typedef struct txi_window {
    int width, height;
    uint8_t *state;  /* TXI_VOID .. TXI_FOREIGN, one per pixel                                 */
    uint8_t *color;  /* 4 per pixel, RGB as matched (over mid gray where alpha is below 1), 0   */
    uint8_t *share;  /* of a hole pixel: how much of it is known, 0..255 = all, as it lies
                        between known and missing texels; its color is that of the known part.
                        NULL: nothing                                                            */
    txm_vec2 *texel; /* where each pixel that is not void lies in the texture, in texels, texel
                        centres are whole numbers                                              */
    txm_vec3 *place; /* on the surface, in units of window pixels; pictures: x, y, 0            */
    txm_vec3 *normal; /* unit; pictures: 0, 0, 1                                               */
    double spacing;  /* units of the mesh per window pixel: origin + place * spacing is a point of
                        the mesh; pictures: 1; 0: places are not on the mesh                   */
    txm_dvec3 origin;
    txm_vec2 *axis;  /* direction of the texture's u axis in the window, unit                   */
    uint8_t *mirrored; /* as in txi_target                                                     */
    uint32_t *face;  /* the triangle under each pixel, for txi_window_read; pictures: none      */
    txi_target *targets; /* the missing texels that this window completes                      */
    size_t target_count;
} txi_window;

/* How a copied piece is turned. Pixels come from the window itself and from turned copies of it. */
typedef struct txi_pose {
    float a, b, c, d; /* a step to the right in the target is a step (a, b) in the source, a step
                         down is (c, d): a rotation, perhaps mirrored                          */
} txi_pose;

/* Where a hole pixel is copied from: a place in the window (pixel centres are whole numbers). */
typedef struct txi_copy {
    float x, y;
    int32_t piece; /* pixels of one piece (same pose, continuous) have the same number; -1 = not
                      in the hole                                                             */
    int32_t pose;  /* index into the poses                                                    */
    int32_t layer; /* pixels of one stroke that crosses others have the same number; 0 = no such  */
} txi_copy;

/* A line through the hole, completed: points about one pixel apart, from the known side through the
   hole to the known side, or to where it ends. */
typedef struct txi_curve {
    txm_vec2 *points;  /* window pixels                                                        */
    int count;
    int first, last;   /* points[first..last] lie in the hole                                  */
    int ends[2];       /* the line ends that it joins; -1: it ends in the hole                 */
    float strength;    /* contrast of the line, in levels of 8 bits                            */
    int partner;       /* the curve along the other side of the same stroke, or -1             */
    float cost;        /* of the join, without unit: about 0.5 for a sure one, 3 for a doubtful
                          one                                                                    */
} txi_curve;

enum { TXI_PULL_KEPT = 128 };

/* What the lines say about a window, for txi_fill. NULL pointers: nothing. */
typedef struct txi_plan {
    uint8_t *color;  /* 4 per pixel: RGB of the strips of texture along the completed lines, and
                        in the fourth byte the guide channel: 255 on a line (known or completed),
                        falling with the distance                                                */
    uint8_t *pull;   /* how much color counts here, 0..255; 0 away from strips; from
                        TXI_PULL_KEPT on the strip itself is kept                              */
    txi_copy *copies; /* where the strips' pixels are copied from; piece -1 elsewhere          */
    const txi_pose *poses; /* that copies[].pose counts                                           */
    int pose_count;
} txi_plan;

/* Prior knowledge about where lines run [1, II.C], in a window: polylines, clipped to the
   window. Line k has the points starts[k] .. starts[k + 1] - 1, two or more. line_count 0: no
   prior; the pointers may be NULL then. */
typedef struct txi_prior {
    txm_vec2 *points; /* window pixels; pixel centres are whole numbers                        */
    int *starts;      /* line_count + 1                                                        */
    int line_count;
} txi_prior;

/* ---- the domain ----------------------------------------------------------------------------- */

/* What all windows share: the maps in their current state, and what is still missing. */
typedef struct txi_surface txi_surface;
typedef struct txi_domain {
    const texinpaint_desc *desc;
    int width, height, map_count;             /* map_count: 1 + desc->map_count              */
    txm_image maps[TEXINPAINT_MAX_MAPS];      /* copies, resolved; 0 is the picture          */
    uint8_t *missing;                         /* one per texel: 1 = missing, still           */
    uint8_t *usable;                          /* one per texel: 1 = may be copied from       */
    uint8_t *covered;                         /* one per texel: 1 = a chart covers its centre */
    txi_surface *surface;                     /* NULL for pictures                           */
} txi_domain;

/* ---- progress ------------------------------------------------------------------------------- */

/* A stage of a call: its env fills the part from..to of the caller's progress. */
typedef struct txi_stage {
    txm_env env; /* to pass to the stage                                                       */
    txm_env *whole;
    float from, to;
} txi_stage;

static int txi_stage_report(void *user, float fraction, const char *name) {
    const txi_stage *stage = (const txi_stage *)user;
    const float part = txm_clampf(fraction, 0, 1);
    return txm_progress(stage->whole, stage->from + (stage->to - stage->from) * part, name);
}

static void txi_stage_begin(txi_stage *stage, txm_env *whole, float from, float to) {
    memset(stage, 0, sizeof *stage);
    if (whole) stage->env = *whole;
    stage->whole = whole;
    stage->from = from;
    stage->to = to;
    stage->env.progress = txi_stage_report;
    stage->env.progress_user = stage;
}

/* The status of the stage, its message passed on. */
static txm_status txi_stage_end(const txi_stage *stage, txm_status status) {
    return status == TXM_OK ? status : txm_fail(stage->whole, status, stage->env.message);
}

/* ---- ablation -------------------------------------------------------------------------------
   Steps that bench/bench_inpaint.c leaves out one by one, to measure what each contributes: it
   defines TXI_LEFT_OUT as a variable of its own. Everywhere else nothing is left out. */

enum {
    TXI_VOTES = 1,    /* tensor votes for or against a join                                      */
    TXI_MATCHING = 2, /* annealing of all joins together; instead: each in turn, if it pays      */
    TXI_STRIPS = 4,   /* strips of real texture along lines; instead: their mean profile         */
    TXI_BELIEF = 8,   /* belief propagation; instead: the best candidate of each patch by itself */
    TXI_TURNS = 16,   /* turned and mirrored copies                                              */
    TXI_DETAIL = 32,  /* the preference for as much detail as around the hole                    */
    TXI_PIECES = 64,  /* minimum cuts between pieces                                             */
    TXI_POISSON = 128 /* blending                                                                */
};
#ifndef TXI_LEFT_OUT
#define TXI_LEFT_OUT 0
#endif

#define TXI_LOG2_E 1.4426950408889634 /* exp(x) = txm_exp2(x TXI_LOG2_E) */

static txm_status txi_no_memory(txm_env *env) {
    return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the completion");
}

static txm_status txi_stopped(txm_env *env) {
    return txm_fail(env, TXM_CANCELLED, "cancelled");
}

/* ---- sets ------------------------------------------------------------------------------------
   Disjoint sets of numbers: parent[i] = i to begin with; a set is known by its root.            */

/* the root of the set that i is in; halves the path to it */
static uint32_t txi_root(uint32_t *parent, uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}

/* Unite two sets; the smaller root remains. */
static void txi_join_sets(uint32_t *parent, uint32_t a, uint32_t b) {
    a = txi_root(parent, a);
    b = txi_root(parent, b);
    if (a < b) parent[b] = a;
    else parent[a] = b;
}

#endif /* TEXINPAINT_CONFIG_H */
