/* texinpaint.h - v0.2.0 - complete the missing texture of a mesh, or a hole in a picture
   SPDX-License-Identifier: MIT OR Unlicense                   (full text: end of file)

   WHAT IT DOES
     Fills a hole in the texture of a mesh, across the seams of its atlas, or a hole in a plain
     picture: first the lines that end at the hole are continued through it, then the texture is
     completed along these lines, then everywhere else, from pieces of the surroundings [1]. Further
     maps (normals, roughness, labels) are completed from the same pieces. No known texel changes, but
     for the colour of transparent ones, which is bled from the visible ones near by.

   QUICK START                                 (tests build and run this very block)
     // Remove a disc from a striped picture. cc -std=c99 quick.c -lm
     #define TEXINPAINT_IMPLEMENTATION        // in exactly one .c or .cpp file
     #include "texinpaint.h"                  // texmath.h must lie beside it
     #include <stdio.h>

     enum { SIDE = 128 };
     static unsigned char photo[SIDE * SIDE], hole[SIDE * SIDE], whole[SIDE * SIDE];

     static txm_image image_of(unsigned char *pixels) {
         txm_image image = {pixels, SIDE, SIDE, 1, TXM_U8, 0};
         return image;
     }

     int main(void) {
         static texinpaint_desc desc;         // static: all zero, which means the defaults
         static txm_env env;                  // malloc, silent, serial; receives the message
         const txm_image out = image_of(whole);
         for (int i = 0; i < SIDE * SIDE; i++) {   // instead of a photograph: stripes
             const int x = i % SIDE - 64, y = i / SIDE - 64;
             photo[i] = (unsigned char)((i % SIDE + i / SIDE) / 16 % 2 ? 200 : 60);
             hole[i] = x * x + y * y < 400 ? 255 : 0;
         }
         desc.image = image_of(photo);
         desc.mask = image_of(hole);
         if (texinpaint_complete(&desc, &env, &out) != TXM_OK) {
             fprintf(stderr, "inpaint: %s\n", env.message);
             return 1;
         }
         printf("the centre is %d now\n", whole[SIDE * 64 + 64]);
         return 0;
     }

   WHICH CALL
     texinpaint_complete     a picture, or the texture of a mesh, and up to 15 maps in register
     texinpaint_begin, _step, _draw, _info_of, _free
                             the same step by step, to show a preview, to cancel, to try again
     texinpaint_harmonic     smooth colours only: quick, and right where nothing but shading is missing
     texinpaint_dilate       gutters only: the colours of charts spread around them, as far as wanted
     texinpaint_crest        the ridges and valleys of a mesh, as lines

   HOW IT WORKS
     The surface around a hole is laid out flat in a window, across the seams of the atlas, with as
     little distortion as possible [6] and pixels of the size of a texel; a hole that goes round a limb,
     or is large, takes several windows one after another. A plain picture is its own window. In a
     window, first, lines that end at the hole are found from the structure tensor, and all pairs of
     ends that may belong together get a curve. What a pair costs comes from how far the curve bends,
     from the colours on both sides and from tensor votes of the line ends [1, II.B; 4]; all joins are
     chosen together by annealing. Prior lines (drawn, or crest lines [1, II.C; 2]) take part. Along
     each joined line a strip of real texture is laid: square patches from the known parts of such
     lines, turned within 10 degrees, chosen by belief propagation [1, III.A; 5].
     Then the rest, from coarse to fine: 8 x 8 patches are matched with turned (pictures: little, and
     mirrored) copies of the known part, at first in rings from the rim inwards, and by annealing
     [1, III.B]; later by a randomised search [8]. A patch that has less detail than expected at its
     place costs more, so that grain does not fade, and so does one that is copied twice or from
     nearby, so that nothing is seen to repeat. At the finest level each pixel is a copy of one place;
     the pieces are joined along minimum cuts [7], and a Poisson equation takes away what steps of tone
     are left at seams and rim.
     This is done to half resolution without lines, with few lines (as in pictures of things) and with
     all ends joined (as in patterns); the one that goes on best at the rim and has the patches most
     like the surroundings wins and is completed.

   CONFIGURATION   (define before the include that has _IMPLEMENTATION)
     TEXINPAINT_STATIC       every function static to the including file (set it everywhere)
     TEXINPAINT_MAX_PIXELS   refuse larger pictures; default 2^28
     TEXINPAINT_NO_SIMD      plain C only. Else SSE2 where the compiler has it, with the same bytes.

   MEMORY
     A job copies its maps, and has 3 bytes for each pixel, with a mesh 8 and 80 for each triangle.
     A window takes some 300 bytes for each of its pixels while it is completed: 45 MB in all for a
     picture of 512 x 512 with a hole of 5 %, 80 to 100 MB for textures of 1024 x 1024. After an error
     nothing stays allocated; a job stays as it was and its step may be tried again.

   TIME   (one core of 2023; make bench measures yours)
     Holes of 5 %, RGB: 0.4 to 1.1 s in a picture of 512 x 512 (the more, the more lines there are), 2
     to 2.5 s in a texture of 1024 x 1024 on 7,000 triangles; 10 % take less than twice as long. The
     preview takes 0.1 to 0.3 s, texinpaint_harmonic 0.05 to 0.15 s. A hole with hardly anything known
     around it is slower, as no coarser level can be used.

   THREADS
     No global state: calls with different env, jobs and outputs may overlap. A job may be used by only
     one call at a time. The parallel-for hook runs bands of rows, rings of patches, strips and pixels.

   SAME BYTES
     Matches are compared in integers; all else is double, summed in a fixed order, with square roots,
     and exponentials and logarithms that are rounded to float once: the same bytes for any number of
     threads, with and without SIMD, and on any compiler that keeps to IEEE 754 (see texmath.h), built
     with -ffp-contract=off. The seed matters: where there is little to go by, try another.

   LIMITS
     It knows textures, not things: it will not finish a face, a word or the window of a house. Lines
     are continued as far as they can be seen to go on; what began and ended within the hole is lost.
     A hole that is wider than the texture around it repeats what there is. Perspective is not
     corrected. Where a surface cannot be laid out without cuts (a corner, a finger tip) the hole is
     cut, too, and lines may end at the cut.

   REFERENCES
     [1] K. Guo, X. Chen, Y. Liu, B. Zhou, Y. Guo. Geometric based structure propagation and texture
         matching for 3D texture completion. 2013.
     [2] S. Yoshizawa, A. Belyaev, H.-P. Seidel. Fast and robust detection of crest lines on meshes.
         ACM Symposium on Solid and Physical Modeling 2005.
     [3] Y. Notay. An aggregation-based algebraic multigrid method. Electronic Transactions on
         Numerical Analysis 37, 2010.
     [4] G. Medioni, M.-S. Lee, C.-K. Tang. A computational framework for segmentation and grouping.
         Elsevier, 2000.
     [5] N. Komodakis, G. Tziritas. Image completion using efficient belief propagation via priority
         scheduling and dynamic pruning. IEEE Transactions on Image Processing 16(11), 2007.
     [6] L. Liu, L. Zhang, Y. Xu, C. Gotsman, S. Gortler. A local/global approach to mesh
         parameterization. SGP 2008.
     [7] Y. Boykov, O. Veksler, R. Zabih. Fast approximate energy minimization via graph cuts. IEEE
         PAMI 23(11), 2001.
     [8] C. Barnes, E. Shechtman, A. Finkelstein, D. Goldman. PatchMatch. SIGGRAPH 2009.       */
#ifndef TEXINPAINT_H
#define TEXINPAINT_H

#include "texmath.h"

#define TEXINPAINT_VERSION "0.2.0"

#ifndef TEXINPAINT_MAX_PIXELS
#define TEXINPAINT_MAX_PIXELS (1 << 28) /* larger pictures are refused */
#endif

#if defined(TEXINPAINT_STATIC) && defined(__GNUC__)
#define TEXINPAINT_API __attribute__((unused)) static
#elif defined(TEXINPAINT_STATIC)
#define TEXINPAINT_API static
#else
#define TEXINPAINT_API extern
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* ---- what to complete --------------------------------------------------------------------- */

enum {
    TEXINPAINT_MAX_MAPS = 16,  /* pictures in register: albedo, normal, roughness, ...         */
    TEXINPAINT_MAX_SIDE = 32768 /* pixels of a picture                                          */
};

/* How one of the further maps is treated; all zero: a picture. */
typedef struct texinpaint_map {
    txm_image image; /* the size of desc.image, 1..4 channels, any sample type                  */
    int is_normal;   /* 3 or 4 channels, the first three a unit vector (txm_normal_decode) in the
                        tangent space of the texture: turned with the pieces, kept at unit length.
                        x to the right, y up (OpenGL); 2 = y down (DirectX)                     */
    int is_label;    /* values are labels, not quantities: never blended or interpolated; without
                        is_normal                                                               */
} texinpaint_map;

/* How lines are continued. */
enum {
    TEXINPAINT_AUTO = 0,  /* the hypotheses below are tried, the one that fits best wins        */
    TEXINPAINT_TEXTURE,   /* no lines: texture alone                                            */
    TEXINPAINT_PICTURE,   /* lines as in pictures of things: few, long, they may end            */
    TEXINPAINT_PATTERN    /* lines as in patterns: each line end is joined to another           */
};

/* Prior knowledge about where lines run [1, II.C]. */
enum { TEXINPAINT_PRIOR_NONE = 0, TEXINPAINT_PRIOR_CREST, TEXINPAINT_PRIOR_LINES };

/* A line on a mesh or in a picture. */
typedef struct texinpaint_line {
    const float *points; /* 3 per point on or near the surface of the mesh, in its units; for a
                            picture x, y in pixels (pixel centres at one half) and 0            */
    int count;           /* 2 or more                                                            */
} texinpaint_line;

/* What to complete, and how. All zero but image and mask is a good default. Pictures are not modified;
   they, the maps, the lines and the mesh must live as long as the job. */
typedef struct texinpaint_desc {
    txm_image image;  /* the picture, or the texture of the mesh: 1..4 channels, any sample type */
    txm_image mask;   /* same size: missing where it counts, a mask that replaces (txm_mask_use in
                         texmath.h): gray times alpha of at least half, and its soft rim         */
    txm_image source; /* same size: where texture may be taken from, a mask that allows; pixels NULL:
                         from all that is known                                                  */
    const texinpaint_map *maps; /* further maps in register, completed along with the picture    */
    int map_count;              /* 0..TEXINPAINT_MAX_MAPS - 1                                    */
    txm_mesh mesh;    /* triangles; face_count 0: the picture is a plain picture                 */
    const float *uv;  /* 2 per entry: u to the right, v downwards, 0..1 is the picture once; values
                         outside repeat it                                                       */
    size_t uv_count;  /* entries of uv                                                           */
    const uint32_t *uv_indices; /* 3 per triangle, which entry its corners have; NULL: the entry of
                         the corner's vertex                                                     */
    int gutter;       /* missing texels outside the charts are filled up to so many texels from
                         them, 1..TEXINPAINT_MAX_SIDE; 0 = 8; -1 = none                          */
    int structure;    /* TEXINPAINT_AUTO .. TEXINPAINT_PATTERN                                   */
    int prior;        /* TEXINPAINT_PRIOR_...                                                    */
    const texinpaint_line *lines; /* that the completed lines should follow, for
                         TEXINPAINT_PRIOR_LINES                                                  */
    int line_count;   /* 0 or more; 1 or more for TEXINPAINT_PRIOR_LINES                        */
    float alpha;      /* line ends farther apart than this are not joined, in texels along the
                         surface, 0..1e6; 0 = 1.5 times the diameter of the hole [1, II.B]      */
    int beta;         /* votes are propagated into the hole at most so often, 0..4096; 0 = 64
                         [1, II.B]                                                              */
    uint64_t seed;    /* another seed gives another completion                                   */
    /* Receives intermediate results as pictures: points, votes, lines, hypotheses, pieces; NULL = none.
       The picture belongs to the library and lives until the function returns.                 */
    void (*show)(void *user, const char *name, const txm_image *picture);
    void *show_user;
} texinpaint_desc;

/* Complete the picture and its maps in one call.

   env    NULL, or how to allocate, report, cancel and run in parallel
   out    1 + map_count pictures, size, channels and sample type of image and of each map: known
          texels are copied, missing ones completed. Untouched after an error. They may be the
          inputs themselves
   return TXM_OK; TXM_BAD_ARGUMENT for a field outside its range, pictures that do not match, samples
          or coordinates that are not finite, a mesh without texture coordinates; TXM_TOO_SMALL if
          nothing is known that may be copied from; TXM_TOO_LARGE; TXM_OUT_OF_MEMORY;
          TXM_CANCELLED                                                                        */
TEXINPAINT_API txm_status texinpaint_complete(const texinpaint_desc *desc, txm_env *env,
                                              const txm_image *out);

/* ---- step by step ------------------------------------------------------------------------ */

/* What was done, for curious callers. */
typedef struct texinpaint_info {
    int holes;           /* connected holes on the surface, or in the picture                    */
    int windows;         /* flat windows that were completed, or left smooth as there are no
                            8 x 8 texels around to copy                                          */
    int structure;       /* of the largest window: TEXINPAINT_TEXTURE .. TEXINPAINT_PATTERN; 0:
                            none has been completed, or all were left smooth                     */
    int line_ends;       /* line ends found at the border of the holes                           */
    int joins;           /* lines continued from border to border                                */
    size_t missing;      /* texels that were missing and lie in a chart                          */
    size_t written;      /* texels written, gutters included                                     */
} texinpaint_info;

/* A completion that is made step by step. It keeps a copy of the allocator. */
typedef struct texinpaint_job texinpaint_job;

/* Prepare a job.

   out    receives the job, or NULL on any error; release it with texinpaint_free
   return as texinpaint_complete
   cost   O(texels) and O(triangles); with TEXINPAINT_PRIOR_CREST that of texinpaint_crest      */
TEXINPAINT_API txm_status texinpaint_begin(const texinpaint_desc *desc, txm_env *env,
                                           texinpaint_job **out);

/* One step of the work. The first makes a preview: smooth colours in the holes, and the lines through
   the first hole. Then each window takes two: the first leaves a picture of half the resolution.
   After an error (cancelling included) the step may be tried again.
   env    its progress callback receives the fraction of all steps that is done
   more   receives 1, or 0 once nothing is left to do; NULL is allowed
   return TXM_OK, also if nothing is left to do; TXM_BAD_ARGUMENT: job is NULL; TXM_TOO_LARGE;
          TXM_OUT_OF_MEMORY; TXM_CANCELLED                                                    */
TEXINPAINT_API txm_status texinpaint_step(texinpaint_job *job, txm_env *env, int *more);

/* Copy the picture (map 0) or a further map (1..map_count) in its current state.

   env    receives the message of an error; NULL is allowed
   out    size, channels and sample type of the input; untouched after an error
   return TXM_OK; TXM_BAD_ARGUMENT before the first step, for a map that there is not, and for an
          out of another form; TXM_TOO_LARGE                                                  */
TEXINPAINT_API txm_status texinpaint_draw(const texinpaint_job *job, int map, txm_env *env,
                                          const txm_image *out);

/* What has been done so far; job is not NULL. */
TEXINPAINT_API texinpaint_info texinpaint_info_of(const texinpaint_job *job);

/* Release a job; NULL is allowed. */
TEXINPAINT_API void texinpaint_free(texinpaint_job *job);

/* ---- without texture: smooth fill, gutters -------------------------------------------------- */

/* Fill the holes smoothly: each colour is a harmonic function on the surface (in the picture, without
   a mesh), its values at the border of the hole those of the known texels, the seams of the atlas
   without effect. image, mask, maps, mesh, uv and gutter of the desc are used. Colours are averaged times
   their alpha; normals in space, then made unit; labels are those of the nearest known texel. Parts of the
   surface without any known texel get the mean colour of the known ones.
   return as texinpaint_complete; TXM_TOO_SMALL if nothing in the charts is known
   cost   about 3 us per missing texel of three channels of 8 bits, 200 bytes               */
TEXINPAINT_API txm_status texinpaint_harmonic(const texinpaint_desc *desc, txm_env *env,
                                              const txm_image *out);

/* Fill the gutters: every texel outside the charts, however far (or up to desc->gutter texels, measured
   from centre to centre), gets the values of the nearest texel in a chart, in all maps. The picture does
   not wrap. image, maps, mesh, uv, gutter (0 = without limit) are used; mask, if it has pixels, marks
   texels in charts that are not to be spread either. Without a mesh the masked pixels are filled, from
   the others; without mesh and mask those that are fully transparent get the colour of the nearest one
   that is not, and stay transparent.
   return as texinpaint_complete; TXM_TOO_SMALL if there is nothing to spread
   cost   O(pixels), about 20 ns and 6 bytes each                                           */
TEXINPAINT_API txm_status texinpaint_dilate(const texinpaint_desc *desc, txm_env *env,
                                            const txm_image *out);

/* ---- crest lines ------------------------------------------------------------------------- */

/* kinds of crest lines; add them up in a description */
enum { TEXINPAINT_RIDGE = 1, TEXINPAINT_VALLEY = 2 };

/* Which crest lines of a mesh to find. All zero but mesh is a good default. */
typedef struct texinpaint_crest_desc {
    txm_mesh mesh;    /* triangles, counter-clockwise from outside, of any connectivity; vertices in
                         equal places count as one                                              */
    float threshold;  /* weaker lines are left out, 0..1e6; the strength of a line is the integral of
                         its curvature along it, without unit: 1 for one as long as its radius of
                         curvature. 0 = 2, or 0.02 of the strongest line if that is more        */
    int kinds;        /* TEXINPAINT_RIDGE, TEXINPAINT_VALLEY, or their sum; 0 = both            */
    int rings;        /* rings of vertices around each that curvature is taken from, 1..8; more for
                         noisy meshes; 0 = 2                                                    */
} texinpaint_crest_desc;

/* Lines, the strongest first. Closed ones end with their first point. */
typedef struct texinpaint_crests {
    texinpaint_line *lines; /* points on the surface, about one per triangle                    */
    const float *strengths; /* 1 per line                                                       */
    const uint8_t *kinds;   /* 1 per line: TEXINPAINT_RIDGE or TEXINPAINT_VALLEY                */
    size_t line_count;
    txm_arena memory; /* private */
} texinpaint_crests;

/* The crest lines of a mesh: where the larger principal curvature has an extremum along its own line
   of curvature [2]. The estimate comes from a cubic fitted around each vertex. A mesh without faces has
   none.
   out    receives the lines, or NULL on any error; release it with texinpaint_crests_free
   return TXM_OK; TXM_BAD_ARGUMENT for a field outside its range, or a mesh that is not valid;
          TXM_TOO_LARGE; TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost   about 5 us per vertex with 2 rings                                                  */
TEXINPAINT_API txm_status texinpaint_crest(const texinpaint_crest_desc *desc, txm_env *env,
                                           texinpaint_crests **out);

/* Release lines; NULL is allowed. */
TEXINPAINT_API void texinpaint_crests_free(texinpaint_crests *crests);

#ifdef __cplusplus
}
#endif
#endif /* TEXINPAINT_H */

#if defined(TEXINPAINT_IMPLEMENTATION) && !defined(TEXINPAINT_IMPLEMENTED)
#define TEXINPAINT_IMPLEMENTED

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

/* ---- rasters: places -------------------------------------------------------------------- */

/* a (1 - t) + b t */
static inline txm_vec2 txi_between(txm_vec2 a, txm_vec2 b, double t) {
    return txm_v2(txm_float(a.x + t * ((double)b.x - a.x)),
                  txm_float(a.y + t * ((double)b.y - a.y)));
}

static inline double txi_distance(txm_vec2 a, txm_vec2 b) {
    const double x = (double)a.x - b.x, y = (double)a.y - b.y;
    return sqrt(x * x + y * y);
}

/* unit length in the same direction; (1, 0) for the zero vector */
static inline txm_vec2 txi_unit(double x, double y) {
    const double n = sqrt(x * x + y * y);
    return n > 0 ? txm_v2(txm_float(x / n), txm_float(y / n)) : txm_v2(1, 0);
}

/* The number of the pixel nearest to a place (pixel centres are whole numbers), -1 outside. */
static inline ptrdiff_t txi_pixel(int width, int height, double x, double y) {
    if (!(x > -0.5 && y > -0.5 && x < width - 0.5 && y < height - 0.5)) return -1;
    const int column = (int)floor(x + 0.5), row = (int)floor(y + 0.5);
    return (ptrdiff_t)row * width + column;
}

/* The weights of Catmull-Rom interpolation at t = 0..1 between the middle two of four samples. */
static void txi_cubic(double t, double weights[4]) {
    weights[0] = 0.5 * t * (t * (2 - t) - 1);
    weights[1] = 0.5 * (t * t * (3 * t - 5) + 2);
    weights[2] = 0.5 * t * (t * (4 - 3 * t) + 1);
    weights[3] = 0.5 * t * t * (t - 1);
}

/* ---- rasters: distances ---------------------------------------------------------------------- */

/* The nearest pixel with a mark, of equally near ones the first in its row, then the upper one.

   First the nearest mark in each column; then along each row the lower envelope of the parabolas
   (x - i)^2 + dy(i)^2 (Meijster, Roerdink, Hesselink 2000): those of the columns that are lowest
   somewhere are kept on a stack. Exact, in integers.

   scratch  3 * width numbers
   nearest  receives one pixel number for each, -1 without any marks
   cost     O(width * height)                                                                  */
static void txi_nearest_marks(const uint8_t *marks, int width, int height, int32_t *scratch,
                              int32_t *nearest) {
    const size_t w = (size_t)width;
    int32_t *row = scratch;      /* of the nearest mark in each column              */
    int32_t *stack = row + w;    /* columns                                         */
    int32_t *from = stack + w;   /* where each of these becomes the nearest          */
    for (int x = 0; x < width; x++) {
        int32_t last = -1;
        for (int y = 0; y < height; y++) {
            if (marks[(size_t)y * w + (size_t)x]) last = y;
            nearest[(size_t)y * w + (size_t)x] = last;
        }
        last = -1;
        for (int y = height - 1; y >= 0; y--) {
            int32_t *n = &nearest[(size_t)y * w + (size_t)x];
            if (marks[(size_t)y * w + (size_t)x]) last = y;
            if (last >= 0 && (*n < 0 || last - y < y - *n)) *n = last;
        }
    }
    for (int y = 0; y < height; y++) {
        int count = 0;
        memcpy(row, nearest + (size_t)y * w, w * sizeof *row);
        for (int x = 0; x < width; x++) {
            const int64_t dy = row[x] - y;
            if (row[x] < 0) continue;
            int begin = 0;
            while (count > 0) { /* first place at which x is nearer than the top of the stack */
                const int i = stack[count - 1];
                const int64_t di = row[i] - y;
                const int64_t sum = (int64_t)x * x + dy * dy - (int64_t)i * i - di * di;
                const int64_t place = sum < 0 ? 0 : sum / (2 * (int64_t)(x - i)) + 1;
                if (place > from[count - 1]) {
                    begin = place < width ? (int)place : width;
                    break;
                }
                count--;
            }
            if (begin >= width) continue;
            TXM_ASSERT(count < width);
            stack[count] = x;
            from[count++] = begin;
        }
        for (int x = 0, k = 0; x < width; x++) {
            while (k + 1 < count && from[k + 1] <= x) k++;
            nearest[(size_t)y * w + (size_t)x] =
                count ? (int32_t)((size_t)row[stack[k]] * w + (size_t)stack[k]) : -1;
        }
    }
}

/* The same, with scratch memory of its own. */
static txm_status txi_nearest(const uint8_t *marks, int width, int height, txm_env *env,
                              int32_t *nearest) {
    txm_arena arena;
    txm_arena_init(&arena, env);
    int32_t *scratch = (int32_t *)txm_arena_alloc(&arena, (size_t)width, 3 * sizeof(int32_t));
    if (scratch) txi_nearest_marks(marks, width, height, scratch, nearest);
    txm_arena_free(&arena);
    return scratch ? TXM_OK : txi_no_memory(env);
}

enum { TXI_FAR = 1 << 28 }; /* squared distance, in pixels, to nothing */

/* Squared Euclidean distances: out[i] = least |i - j|^2 over all pixels j with of[j] != 0, in
   integers; TXI_FAR if there is none, or if it is more.
   scratch  3 * width numbers                                                                  */
static void txi_distances(const uint8_t *of, int width, int height, int32_t *scratch,
                          int32_t *out) {
    txi_nearest_marks(of, width, height, scratch, out);
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            int32_t *at = &out[(size_t)y * (size_t)width + (size_t)x];
            const int64_t dx = *at % width - x, dy = *at / width - y;
            const int64_t most = TXI_FAR, d = *at < 0 ? most : dx * dx + dy * dy;
            *at = (int32_t)(d < most ? d : most);
        }
    }
}

/* ---- checks of what the caller gives ------------------------------------------------------- */

#define TXI_MAX_UV 4096.0f /* repeats of the texture; beyond, a float no longer tells its texels
                              apart                                                              */

static txm_status txi_check_size(const txm_image *im, const char *name, const txm_image *like,
                                 txm_env *env) {
    const txm_status status = txm_image_check(im, name, TEXINPAINT_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    if (im->width > TEXINPAINT_MAX_SIDE || im->height > TEXINPAINT_MAX_SIDE)
        return txm_fail_at(env, TXM_TOO_LARGE, name, "sides may have up to 32768 pixels");
    if (im->width != like->width || im->height != like->height)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name, "must have the size of image");
    return TXM_OK;
}

/* Are all samples finite, and not so large that sums of them are not? */
static int txi_is_moderate(const txm_image *image) {
    const txm_image im = txm_image_resolve(*image);
    const size_t row_count = (size_t)im.width * (size_t)im.channels;
    for (int y = 0; y < im.height && im.sample == TXM_F32; y++) {
        const float *row = (const float *)txm_image_row_const(&im, y);
        for (size_t i = 0; i < row_count; i++) {
            if (!(row[i] >= -TXI_MOST_SAMPLE && row[i] <= TXI_MOST_SAMPLE)) return 0;
        }
    }
    return 1;
}

static txm_status txi_check_picture(const txm_image *im, const char *name, const txm_image *like,
                                    txm_env *env) {
    const txm_status status = txi_check_size(im, name, like, env);
    if (status == TXM_OK && !txi_is_moderate(im))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name, "samples must be finite, and at most 1e30");
    return status;
}

static txm_status txi_check_mask(const txm_image *im, const char *name, const txm_image *like,
                                 txm_env *env) {
    return txm_mask_check(im, name, like->width, like->height, TEXINPAINT_MAX_PIXELS, env);
}

static txm_status txi_check_maps(const texinpaint_desc *d, txm_env *env) {
    if (d->map_count < 0 || d->map_count >= TEXINPAINT_MAX_MAPS || (d->map_count && !d->maps))
        return txm_fail(env, TXM_BAD_ARGUMENT, "map_count must be 0 to 15, and maps not NULL");
    for (int i = 0; i < d->map_count; i++) {
        const texinpaint_map *map = &d->maps[i];
        const txm_status status = txi_check_picture(&map->image, "maps", &d->image, env);
        if (status != TXM_OK) return status;
        if (map->is_normal < 0 || map->is_normal > 2 || (map->is_normal && map->image.channels < 3))
            return txm_fail(env, TXM_BAD_ARGUMENT,
                            "is_normal must be 0 to 2, for maps with 3 or 4 channels");
        if (map->is_normal && map->is_label)
            return txm_fail(env, TXM_BAD_ARGUMENT, "a map has is_normal or is_label, not both");
    }
    return TXM_OK;
}

static txm_status txi_check_surface(const texinpaint_desc *d, txm_env *env) {
    const txm_status status = txm_mesh_check(&d->mesh, "mesh", 3, 1, 0, env);
    if (status != TXM_OK) return status;
    if (d->mesh.face_count == 0) return TXM_OK;
    if (!d->uv || !d->uv_count)
        return txm_fail(env, TXM_BAD_ARGUMENT, "the mesh has no texture coordinates: set uv");
    if (d->uv_count > SIZE_MAX / 16) return txm_fail(env, TXM_TOO_LARGE, "uv_count is too large");
    if (!d->uv_indices && d->uv_count < d->mesh.vertex_count)
        return txm_fail(env, TXM_BAD_ARGUMENT, "without uv_indices each vertex needs an uv");
    for (size_t i = 0; d->uv_indices && i < 3 * d->mesh.face_count; i++) {
        if (d->uv_indices[i] >= d->uv_count)
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                    "face # names uv #, which is not below uv_count", i / 3,
                                    d->uv_indices[i]);
    }
    for (size_t i = 0; i < 2 * d->uv_count; i++) {
        if (!(d->uv[i] >= -TXI_MAX_UV && d->uv[i] <= TXI_MAX_UV))
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                    "uv # is not finite or farther than 4096 from 0", i / 2, 0);
    }
    return TXM_OK;
}

static txm_status txi_check_lines(const texinpaint_desc *d, txm_env *env) {
    if (d->line_count < 0 || (d->line_count && !d->lines))
        return txm_fail(env, TXM_BAD_ARGUMENT, "line_count must be 0 or more, and lines not NULL");
    for (int i = 0; i < d->line_count; i++) {
        const texinpaint_line *line = &d->lines[i];
        if (line->count < 2 || !line->points)
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT, "line # needs 2 points or more",
                                    (uint64_t)i, 0);
        for (size_t k = 0; k < 3 * (size_t)line->count; k++) {
            if (!txm_is_finite(line->points[k]))
                return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                        "line # has a point that is not finite", (uint64_t)i, 0);
        }
    }
    return TXM_OK;
}

/* Everything but the mask, which calls without a hole may leave out. */
static txm_status txi_check_common(const texinpaint_desc *d, txm_env *env) {
    txm_status status;
    if (!d) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL");
    status = txi_check_picture(&d->image, "image", &d->image, env);
    if (status == TXM_OK) status = txi_check_maps(d, env);
    if (status == TXM_OK) status = txi_check_surface(d, env);
    if (status == TXM_OK && (d->gutter < -1 || d->gutter > TEXINPAINT_MAX_SIDE))
        return txm_fail(env, TXM_BAD_ARGUMENT, "gutter must be -1 to 32768 texels");
    return status;
}

/* The whole description of a completion. */
static txm_status txi_check(const texinpaint_desc *d, txm_env *env) {
    txm_status status = txi_check_common(d, env);
    if (status == TXM_OK) status = txi_check_mask(&d->mask, "mask", &d->image, env);
    if (status == TXM_OK && d->source.pixels)
        status = txi_check_mask(&d->source, "source", &d->image, env);
    if (status == TXM_OK) status = txi_check_lines(d, env);
    if (status != TXM_OK) return status;
    if (d->structure < TEXINPAINT_AUTO || d->structure > TEXINPAINT_PATTERN)
        return txm_fail(env, TXM_BAD_ARGUMENT, "structure must be one of TEXINPAINT_AUTO ...");
    if (d->prior < TEXINPAINT_PRIOR_NONE || d->prior > TEXINPAINT_PRIOR_LINES)
        return txm_fail(env, TXM_BAD_ARGUMENT, "prior must be one of TEXINPAINT_PRIOR_NONE ...");
    if (d->prior == TEXINPAINT_PRIOR_CREST && d->mesh.face_count == 0)
        return txm_fail(env, TXM_BAD_ARGUMENT, "a picture has no crest lines; give lines");
    if (d->prior == TEXINPAINT_PRIOR_LINES && d->line_count == 0)
        return txm_fail(env, TXM_BAD_ARGUMENT, "TEXINPAINT_PRIOR_LINES needs lines");
    if (!(d->alpha >= 0 && d->alpha <= 1e6f) || d->beta < 0 || d->beta > 4096)
        return txm_fail(env, TXM_BAD_ARGUMENT, "alpha must be 0 to 1e6, beta 0 to 4096");
    return TXM_OK;
}

/* Are these pictures of the form of the inputs? */
static txm_status txi_check_outputs(const texinpaint_desc *d, const txm_image *out, int count,
                                    txm_env *env) {
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    for (int i = 0; i < count; i++) {
        const txm_image *in = i ? &d->maps[i - 1].image : &d->image;
        const txm_status status = txi_check_size(&out[i], "out", &d->image, env);
        if (status != TXM_OK) return status;
        if (txm_image_resolve(out[i]).channels != txm_image_resolve(*in).channels ||
            out[i].sample != in->sample)
            return txm_fail(env, TXM_BAD_ARGUMENT,
                            "out: channels and sample must be those of the input");
    }
    return TXM_OK;
}

/* ---- the domain ---------------------------------------------------------------------------- */

/* Copy samples between pictures of one form. */
static void txi_copy_picture(const txm_image *from, const txm_image *to) {
    const txm_image a = txm_image_resolve(*from), b = txm_image_resolve(*to);
    const size_t row = (size_t)a.width * (size_t)a.channels * txm_sample_bytes(a.sample);
    for (int y = 0; y < a.height; y++)
        memmove(txm_image_row(&b, y), txm_image_row_const(&a, y), row);
}

/* Copies of the maps in their given state, and which texels are missing and usable. Checked inputs;
   a mask without pixels: none is missing. txi_surface_make must follow, which sets covered. */
static txm_status txi_domain_make(txi_domain *domain, const texinpaint_desc *desc, txm_arena *arena,
                                  txm_env *env) {
    const size_t count = (size_t)desc->image.width * (size_t)desc->image.height;
    memset(domain, 0, sizeof *domain);
    domain->desc = desc;
    domain->width = desc->image.width;
    domain->height = desc->image.height;
    domain->map_count = 1 + desc->map_count;
    for (int i = 0; i < domain->map_count; i++) {
        const txm_image *in = i ? &desc->maps[i - 1].image : &desc->image;
        txm_image *map = &domain->maps[i];
        *map = *in;
        map->stride = 0;
        *map = txm_image_resolve(*map);
        map->pixels = txm_arena_alloc(arena, (size_t)map->height, (size_t)map->stride);
        if (!map->pixels) return txi_no_memory(env);
        txi_copy_picture(in, map);
    }
    domain->missing = (uint8_t *)txm_arena_zero(arena, count, 1);
    domain->usable = (uint8_t *)txm_arena_zero(arena, count, 1);
    if (arena->failed) return txi_no_memory(env);
    if (desc->mask.pixels) txm_mask_read(&desc->mask, TXM_MASK_REPLACES, domain->missing);
    if (desc->source.pixels) txm_mask_read(&desc->source, TXM_MASK_ALLOWS, domain->usable);
    for (size_t i = 0; i < count; i++) {
        domain->missing[i] = domain->missing[i] != 0;
        domain->usable[i] = !domain->missing[i] && (!desc->source.pixels || domain->usable[i]);
    }
    return TXM_OK;
}

/* Deliver an intermediate result to the caller, if wanted. */
static void txi_show(const txi_domain *domain, const char *name, uint8_t *pixels, int width,
                     int height, int channels) {
    txm_image picture;
    if (!domain->desc->show) return;
    memset(&picture, 0, sizeof picture);
    picture.pixels = pixels;
    picture.width = width;
    picture.height = height;
    picture.channels = channels;
    domain->desc->show(domain->desc->show_user, name, &picture);
}

/* ---- surface: a mesh across the seams of its atlas ------------------------------------------- */

#define TXI_NO_FACE 0xffffffffu

enum {
    TXI_REPEATS = 64, /* ours: pictures that a face may cover in u or v; others cover no texel    */
    TXI_TILE = 8,     /* ours: texels of a side                                                   */
    TXI_FINS = 16     /* ours: sides of an edge that are compared with one another, at most       */
};

/* The mesh as a surface. Faces that name a vertex twice are linked with nothing; the faces to both
   sides of such a one are linked with each other. */
struct txi_surface {
    size_t face_count, vertex_count; /* vertices: welded, those at equal positions are one      */
    txm_dvec3 *point;    /* 1 per vertex                                                       */
    uint32_t *vertex;    /* 3 per face: its vertices                                           */
    uint32_t *opposite;  /* 3 per face: the side beyond side k, which runs from corner k to the
                            next; TXM_NO_SIDE at borders                                         */
    txm_vec2 *uv;        /* 3 per face: its corners in texels, texel centres are whole numbers; not
                            wrapped                                                            */
    uint32_t *chart;     /* 1 per face: faces that are connected in the atlas, or that overlap
                            there, have the same number                                        */
    uint32_t *owner;     /* 1 per texel: the first face that covers its centre, or TXI_NO_FACE  */
    uint32_t *first, *corners; /* the corners of vertex v: corners[first[v]] .. [first[v + 1] -
                                  1]                                                             */
    uint32_t *hole_first, *hole; /* the texels of face f that were missing, in the same form     */
    uint32_t *tile;      /* 1 per TXI_TILE x TXI_TILE texels: the chart, if they all have the
                            same, or TXI_NO_FACE                                                 */
    size_t tile_stride;  /* tiles in a row                                                     */
    size_t cursor;       /* no texel before this one is missing and covered                    */
};

static uint32_t txi_next_corner(uint32_t c) {
    return c % 3 == 2 ? c - 2 : c + 1;
}

/* Does the face name a vertex twice? */
static int txi_is_flat_face(const txi_surface *s, uint32_t face) {
    const uint32_t *v = s->vertex + 3 * (size_t)face;
    return v[0] == v[1] || v[1] == v[2] || v[2] == v[0];
}

static txm_dvec3 txi_corner_point(const txi_surface *s, uint32_t corner) {
    return s->point[s->vertex[corner]];
}

/* twice the area of a face times its unit normal */
static txm_dvec3 txi_face_area2(const txi_surface *s, uint32_t face) {
    return txm_d3_area2(txi_corner_point(s, 3 * face), txi_corner_point(s, 3 * face + 1),
                        txi_corner_point(s, 3 * face + 2));
}

/* twice the signed area of a b c in the plane */
static double txi_cross2(txm_vec2 a, txm_vec2 b, txm_vec2 c) {
    return ((double)b.x - a.x) * ((double)c.y - a.y) - ((double)c.x - a.x) * ((double)b.y - a.y);
}

/* The three weights of p in the triangle t. 0: it has no area. */
static int txi_weights(const txm_vec2 t[3], double x, double y, double weight[3]) {
    const double area = txi_cross2(t[0], t[1], t[2]);
    if (!(fabs(area) > 1e-12)) return 0;
    weight[1] = ((x - t[0].x) * ((double)t[2].y - t[0].y) -
                 ((double)t[2].x - t[0].x) * (y - t[0].y)) / area;
    weight[2] = (((double)t[1].x - t[0].x) * (y - t[0].y) -
                 (x - t[0].x) * ((double)t[1].y - t[0].y)) / area;
    weight[0] = 1 - weight[1] - weight[2];
    return 1;
}

/* ---- surface: vertices and sides ------------------------------------------------------------- */

/* The bits of x, for -0 those of 0, so that equal numbers have equal bits. */
static uint32_t txi_float_bits(float x) {
    uint32_t bits;
    const float plain = x + 0.0f;
    memcpy(&bits, &plain, sizeof bits);
    return bits == 0x80000000u ? 0 : bits;
}

/* Give vertices at equal positions one number, in the order in which they come first. weld receives
   one number for each vertex of the mesh. */
static txm_status txi_weld(const txm_mesh *mesh, txi_surface *s, uint32_t *weld, txm_arena *arena,
                           txm_env *env) {
    size_t slots = 16;
    txm_arena scratch;
    while (slots < 2 * mesh->vertex_count) slots *= 2;
    txm_arena_init(&scratch, env);
    uint32_t *table = (uint32_t *)txm_arena_alloc(&scratch, slots, sizeof(uint32_t));
    s->point = (txm_dvec3 *)txm_arena_alloc(arena, mesh->vertex_count, sizeof(txm_dvec3));
    if (!table || !s->point) {
        txm_arena_free(&scratch);
        return txi_no_memory(env);
    }
    memset(table, 0xff, slots * sizeof *table);
    s->vertex_count = 0;
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        const float *p = mesh->positions + 3 * v;
        const uint64_t xy = (uint64_t)txi_float_bits(p[0]) << 32 | txi_float_bits(p[1]);
        size_t slot = (size_t)txm_hash(txm_hash(xy) + txi_float_bits(p[2])) & (slots - 1);
        for (; table[slot] != UINT32_MAX; slot = (slot + 1) & (slots - 1)) {
            const txm_dvec3 q = s->point[table[slot]];
            if (!(q.x < p[0] || q.x > p[0] || q.y < p[1] || q.y > p[1] || q.z < p[2] || q.z > p[2]))
                break;
        }
        if (table[slot] == UINT32_MAX) {
            table[slot] = (uint32_t)s->vertex_count;
            TXM_ASSERT(s->vertex_count < mesh->vertex_count);
            s->point[s->vertex_count++] = txm_d3_load(p);
        }
        weld[v] = table[slot];
    }
    txm_arena_free(&scratch);
    return TXM_OK;
}

/* Do two sides that run against one another also lie together in the atlas? */
static int txi_is_sewn(const txi_surface *s, uint32_t a, uint32_t b) {
    const txm_vec2 p = s->uv[a], q = s->uv[txi_next_corner(a)];
    const txm_vec2 r = s->uv[txi_next_corner(b)], t = s->uv[b];
    return fabs((double)p.x - r.x) + fabs((double)p.y - r.y) + fabs((double)q.x - t.x) +
               fabs((double)q.y - t.y) < 1e-2;
}

/* Link those of the sides of an edge that have no opposite yet: two that run against one
   another, or where there are more, pairs that also lie together in the atlas. */
static void txi_link_edge(txi_surface *s, const uint32_t *indices, const uint32_t *sides,
                          size_t count) {
    uint32_t open[TXI_FINS];
    int n = 0;
    for (size_t i = 0; i < count; i++) {
        const uint32_t side = sides[i];
        if (s->opposite[side] != TXM_NO_SIDE || txi_is_flat_face(s, side / 3)) continue;
        if (n == TXI_FINS) return;
        open[n++] = side;
    }
    for (int i = 0; i < n; i++) {
        for (int j = i + 1; j < n && s->opposite[open[i]] == TXM_NO_SIDE; j++) {
            if (indices[open[i]] == indices[open[j]] || s->opposite[open[j]] != TXM_NO_SIDE)
                continue;
            if (n > 2 && !txi_is_sewn(s, open[i], open[j])) continue;
            s->opposite[open[i]] = open[j];
            s->opposite[open[j]] = open[i];
        }
    }
}

/* Fill opposite: first by the vertices that the mesh names, then by those at equal positions, as
   files are often cut along seams. Sides of neighbours that run the same way stay unlinked. */
static txm_status txi_link_sides(const txm_mesh *mesh, txi_surface *s, txm_env *env) {
    const size_t sides = 3 * s->face_count;
    txm_arena scratch;
    txm_arena_init(&scratch, env);
    uint32_t *sorted = (uint32_t *)txm_arena_alloc(&scratch, sides, 2 * sizeof(uint32_t));
    if (!sorted) return txi_no_memory(env);
    for (size_t i = 0; i < sides; i++) s->opposite[i] = TXM_NO_SIDE;
    for (int pass = 0; pass < 2; pass++) {
        txm_mesh part = *mesh;
        if (pass) {
            part.indices = s->vertex;
            part.vertex_count = s->vertex_count;
        }
        txm_mesh_sort_sides(&part, sorted);
        for (size_t i = 0, end; i < sides; i = end) {
            end = txm_mesh_edge_end(&part, sorted, i);
            txi_link_edge(s, part.indices, sorted + i, end - i);
        }
    }
    txm_arena_free(&scratch);
    return TXM_OK;
}

/* ---- surface: texels ------------------------------------------------------------------------- */

/* The corners of all faces in texels. Those that lie repeats away from the picture are moved,
   face by face, near to it, where numbers are exact. */
static void txi_load_uv(const txi_domain *d, txi_surface *s) {
    const texinpaint_desc *desc = d->desc;
    for (size_t f = 0; f < s->face_count; f++) {
        double u[3], v[3], du = 0, dv = 0;
        for (size_t k = 0; k < 3; k++) {
            const size_t c = 3 * f + k;
            const size_t entry = desc->uv_indices ? desc->uv_indices[c] : desc->mesh.indices[c];
            u[k] = desc->uv[2 * entry];
            v[k] = desc->uv[2 * entry + 1];
        }
        if (fabs(u[0]) > (double)TXI_REPEATS) du = floor(u[0]);
        if (fabs(v[0]) > (double)TXI_REPEATS) dv = floor(v[0]);
        for (size_t k = 0; k < 3; k++)
            s->uv[3 * f + k] = txm_v2(txm_float((u[k] - du) * d->width - 0.5),
                                      txm_float((v[k] - dv) * d->height - 0.5));
    }
}

static int txi_wrap(int i, int n) {
    const int r = i % n;
    return r < 0 ? r + n : r;
}

/* The texel at the middle of a face: the only one that can be said to be its own where faces are
   smaller than texels. */
static size_t txi_face_texel(const txi_domain *d, const txi_surface *s, size_t face) {
    const txm_vec2 *t = s->uv + 3 * face;
    const double x = ((double)t[0].x + t[1].x + t[2].x) / 3,
                 y = ((double)t[0].y + t[1].y + t[2].y) / 3;
    const int px = txi_wrap((int)floor(x + 0.5), d->width),
              py = txi_wrap((int)floor(y + 0.5), d->height);
    return (size_t)py * (size_t)d->width + (size_t)px;
}

/* A face meets a texel: it owns it if none before it does; else, if both lie well over the
   texel, their charts overlap. */
static void txi_own(txi_surface *s, uint32_t *charts, uint32_t face, size_t texel, int x, int y,
                    int width, int height) {
    const uint32_t owner = s->owner[texel];
    double mine[3], theirs[3];
    if (owner == TXI_NO_FACE) {
        s->owner[texel] = face;
        return;
    }
    if (txi_root(charts, owner) == txi_root(charts, face)) return;
    if (!txi_weights(s->uv + 3 * (size_t)face, x, y, mine)) return;
    /* where the owner has this texel: shifted by whole pictures */
    const txm_vec2 *t = s->uv + 3 * (size_t)owner;
    const double cx = ((double)t[0].x + t[1].x + t[2].x) / 3,
                 cy = ((double)t[0].y + t[1].y + t[2].y) / 3;
    const double sx = floor((cx - x) / width + 0.5) * width,
                 sy = floor((cy - y) / height + 0.5) * height;
    if (!txi_weights(t, x + sx, y + sy, theirs)) return;
    for (int k = 0; k < 3; k++) {
        if (mine[k] < 0.02 || theirs[k] < 0.02) return;
    }
    txi_join_sets(charts, owner, face);
}

/* Give a face the texels whose centres it covers, its border included, row by row. */
static void txi_cover_face(const txi_domain *d, txi_surface *s, uint32_t *charts, uint32_t face) {
    const txm_vec2 *t = s->uv + 3 * (size_t)face;
    const double area = txi_cross2(t[0], t[1], t[2]), turn = area < 0 ? -1 : 1;
    double left = t[0].x, right = left, top = t[0].y, bottom = top;
    for (int k = 1; k < 3; k++) {
        left = fmin(left, t[k].x);
        right = fmax(right, t[k].x);
        top = fmin(top, t[k].y);
        bottom = fmax(bottom, t[k].y);
    }
    if (!(fabs(area) > 1e-9) || right - left > (double)TXI_REPEATS * d->width ||
        bottom - top > (double)TXI_REPEATS * d->height)
        return;
    for (int y = (int)ceil(top - 1e-6); y <= (int)floor(bottom + 1e-6); y++) {
        double from = left, to = right;
        for (int k = 0; k < 3; k++) { /* a x + b >= 0 inside of side k */
            const txm_vec2 p = t[k], q = t[(k + 1) % 3];
            const double a = turn * ((double)p.y - q.y);
            const double b = turn * (((double)q.x - p.x) * (y - (double)p.y) -
                                     (double)p.x * ((double)p.y - q.y)) + 1e-6 * fabs(area);
            if (a > 0) from = fmax(from, -b / a);
            else if (a < 0) to = fmin(to, -b / a);
            else if (b < 0) to = from - 2;
        }
        const size_t row = (size_t)txi_wrap(y, d->height) * (size_t)d->width;
        const int begin = (int)ceil(from - 1e-6);
        int end = (int)floor(to + 1e-6) + 1;
        if (end - begin > d->width) end = begin + d->width;
        for (int x = begin; x < end; x++)
            txi_own(s, charts, face, row + (size_t)txi_wrap(x, d->width), x, y, d->width,
                    d->height);
    }
}

/* Fill owner, chart and d->covered. */
static void txi_cover(txi_domain *d, txi_surface *s) {
    const size_t texels = (size_t)d->width * (size_t)d->height;
    for (size_t i = 0; i < texels; i++) s->owner[i] = TXI_NO_FACE;
    for (uint32_t f = 0; f < s->face_count; f++) s->chart[f] = f;
    for (uint32_t side = 0; side < 3 * s->face_count; side++) {
        const uint32_t other = s->opposite[side];
        if (other < side && txi_is_sewn(s, side, other))
            txi_join_sets(s->chart, side / 3, other / 3);
    }
    for (uint32_t f = 0; f < s->face_count; f++) txi_cover_face(d, s, s->chart, f);
    for (uint32_t f = 0; f < s->face_count; f++) s->chart[f] = txi_root(s->chart, f);
    for (size_t i = 0; i < texels; i++) d->covered[i] = s->owner[i] != TXI_NO_FACE;
}

/* Which tiles lie in one chart. */
static void txi_fill_tiles(const txi_domain *d, txi_surface *s) {
    const size_t w = (size_t)d->width, h = (size_t)d->height;
    for (size_t y = 0; y < h; y++) {
        for (size_t x = 0; x < w; x++) {
            uint32_t *tile = &s->tile[y / TXI_TILE * s->tile_stride + x / TXI_TILE];
            const uint32_t owner = s->owner[y * w + x];
            const uint32_t chart = owner == TXI_NO_FACE ? TXI_NO_FACE : s->chart[owner];
            if (x % TXI_TILE == 0 && y % TXI_TILE == 0) *tile = chart;
            else if (*tile != chart) *tile = TXI_NO_FACE;
        }
    }
}

/* Lists by key: items receives the numbers i of all keys[i] below count, those of key k at
   first[k] .. first[k + 1] - 1. Only those with a mark, if there are marks. first: room for
   count + 1. */
static void txi_bin(const uint32_t *keys, size_t key_count, const uint8_t *marks, size_t count,
                    uint32_t *first, uint32_t *items) {
    memset(first, 0, (count + 1) * sizeof *first);
    for (size_t i = 0; i < key_count; i++) {
        if (keys[i] < count && (!marks || marks[i])) first[keys[i] + 1]++;
    }
    for (size_t k = 1; k <= count; k++) first[k] += first[k - 1];
    const uint32_t total = first[count];
    for (size_t i = key_count; i-- > 0;) { /* backwards, which leaves in first[k + 1] where k
                                              begins                                             */
        if (keys[i] < count && (!marks || marks[i])) items[--first[keys[i] + 1]] = (uint32_t)i;
    }
    for (size_t k = 0; k < count; k++) first[k] = first[k + 1];
    first[count] = total;
}

/* Make d->surface, if desc has a mesh, and d->covered. d->missing must be set. A picture is covered
   everywhere.
   cost    O(faces + texels), faces * log of the corners of a vertex; 80 bytes per face, 5 per
           texel */
static txm_status txi_surface_make(txi_domain *d, txm_arena *arena, txm_env *env) {
    const txm_mesh *mesh = &d->desc->mesh;
    const size_t texels = (size_t)d->width * (size_t)d->height, faces = mesh->face_count;
    size_t holes = 0;
    d->surface = NULL;
    d->covered = (uint8_t *)txm_arena_alloc(arena, texels, 1);
    if (!d->covered) return txi_no_memory(env);
    memset(d->covered, 1, texels);
    if (faces == 0) return TXM_OK;

    txi_surface *s = (txi_surface *)txm_arena_zero(arena, 1, sizeof *s);
    uint32_t *weld = (uint32_t *)txm_arena_alloc(arena, mesh->vertex_count, sizeof(uint32_t));
    if (!s || !weld) return txi_no_memory(env);
    s->face_count = faces;
    s->vertex = (uint32_t *)txm_arena_alloc(arena, faces, 3 * sizeof(uint32_t));
    s->opposite = (uint32_t *)txm_arena_alloc(arena, faces, 3 * sizeof(uint32_t));
    s->corners = (uint32_t *)txm_arena_alloc(arena, faces, 3 * sizeof(uint32_t));
    s->uv = (txm_vec2 *)txm_arena_alloc(arena, faces, 3 * sizeof(txm_vec2));
    s->chart = (uint32_t *)txm_arena_alloc(arena, faces, sizeof(uint32_t));
    s->owner = (uint32_t *)txm_arena_alloc(arena, texels, sizeof(uint32_t));
    s->tile_stride = (size_t)(d->width - 1) / TXI_TILE + 1;
    s->tile = (uint32_t *)txm_arena_alloc(
        arena, s->tile_stride * ((size_t)(d->height - 1) / TXI_TILE + 1), sizeof(uint32_t));
    s->hole_first = (uint32_t *)txm_arena_alloc(arena, faces + 1, sizeof(uint32_t));
    s->first = (uint32_t *)txm_arena_alloc(arena, mesh->vertex_count + 1, sizeof(uint32_t));
    if (arena->failed) return txi_no_memory(env);

    txm_status status = txi_weld(mesh, s, weld, arena, env);
    if (status != TXM_OK) return status;
    for (size_t c = 0; c < 3 * faces; c++) s->vertex[c] = weld[mesh->indices[c]];
    txi_load_uv(d, s);
    status = txi_link_sides(mesh, s, env);
    if (status != TXM_OK) return status;
    txi_cover(d, s);
    txi_fill_tiles(d, s);
    txi_bin(s->vertex, 3 * faces, NULL, s->vertex_count, s->first, s->corners);
    for (size_t i = 0; i < texels; i++) holes += d->missing[i] && d->covered[i];
    s->hole = (uint32_t *)txm_arena_alloc(arena, holes + 1, sizeof(uint32_t));
    if (!s->hole) return txi_no_memory(env);
    txi_bin(s->owner, texels, d->missing, faces, s->hole_first, s->hole);
    d->surface = s;
    return TXM_OK;
}

/* ---- geodesic: distances along the surface --------------------------------------------------- */

#define TXI_UNREACHED 1e300 /* the distance of what has not been reached */

/* A vertex waits with the distance that it had when it was put in; the heap has the least on
   top. */
typedef struct txi_wait {
    double distance;
    uint32_t vertex;
} txi_wait;

typedef struct txi_heap {
    txi_wait *items;
    size_t count, room;
} txi_heap;

static int txi_wait_before(txi_wait a, txi_wait b) {
    if (a.distance < b.distance || b.distance < a.distance) return a.distance < b.distance;
    return a.vertex < b.vertex;
}

/* 0: no memory. */
static int txi_heap_push(txi_heap *heap, txm_arena *arena, double distance, uint32_t vertex) {
    const txi_wait item = {distance, vertex};
    size_t at = heap->count;
    if (heap->count == heap->room) {
        const size_t room = heap->room ? 2 * heap->room : 256;
        txi_wait *items = (txi_wait *)txm_arena_alloc(arena, room, sizeof(txi_wait));
        if (!items) return 0;
        if (heap->count) memcpy(items, heap->items, heap->count * sizeof(txi_wait));
        heap->items = items;
        heap->room = room;
    }
    for (heap->count++; at > 0; at = (at - 1) / 2) {
        const txi_wait parent = heap->items[(at - 1) / 2];
        if (!txi_wait_before(item, parent)) break;
        heap->items[at] = parent;
    }
    heap->items[at] = item;
    return 1;
}

static txi_wait txi_heap_pop(txi_heap *heap) {
    const txi_wait top = heap->items[0], last = heap->items[--heap->count];
    size_t at = 0;
    for (size_t child = 1; child < heap->count; child = 2 * at + 1) {
        if (child + 1 < heap->count && txi_wait_before(heap->items[child + 1], heap->items[child]))
            child++;
        if (!txi_wait_before(heap->items[child], last)) break;
        heap->items[at] = heap->items[child];
        at = child;
    }
    heap->items[at] = last;
    return top;
}

/* The distance of c from a source whose distances from a and b are known, along straight lines
   through the triangle a b c: unfolded into its plane, the source is where the circles about a and
   b with these radii meet beyond a b.

                c            With a at 0 and b at (l, 0), the source is at (x, -y):
               / \               x = (l^2 + da^2 - db^2) / 2l,  y^2 = da^2 - x^2.
              a---b          If its line to c misses a b, the way leads through a or b.
               \ ' |
                 ' s                                                                        */
static double txi_unfold_distance(txm_dvec3 a, txm_dvec3 b, txm_dvec3 c, double da, double db) {
    const txm_dvec3 ab = txm_d3_sub(b, a), ac = txm_d3_sub(c, a);
    const double l = txm_d3_len(ab), around = fmin(da + txm_d3_len(ac), db + txm_d3_dist(b, c));
    if (!(l > 0)) return around;
    const double cx = txm_d3_dot(ac, ab) / l;
    const double cy = sqrt(fmax(0, txm_d3_len2(ac) - cx * cx));
    if (da <= 0 && db <= 0) return cx >= 0 && cx <= l ? cy : around; /* the edge is the source */
    const double x = (l * l + da * da - db * db) / (2 * l), yy = da * da - x * x;
    if (!(yy >= 0)) return around;
    const double y = sqrt(yy), cross = y + cy > 0 ? x + (cx - x) * (y / (y + cy)) : x;
    if (!(cross >= 0 && cross <= l)) return around;
    return fmin(around, sqrt((cx - x) * (cx - x) + (cy + y) * (cy + y)));
}

/* Lower the distance of the third corner of the triangle after those of corners i and j. */
static int txi_geodesic_update(const txi_surface *s, txi_heap *heap, txm_arena *arena, double limit,
                               uint32_t i, uint32_t j, uint32_t k, double *distance) {
    const uint32_t a = s->vertex[i], b = s->vertex[j], c = s->vertex[k];
    const double da = distance[a], db = distance[b];
    const double d = db < TXI_UNREACHED
                         ? txi_unfold_distance(s->point[a], s->point[b], s->point[c], da, db)
                         : da + txm_d3_dist(s->point[a], s->point[c]);
    /* by more than rounding, or it might go on for ever */
    if (d > limit || d >= distance[c] * (1 - 1e-9)) return 1;
    distance[c] = d;
    return txi_heap_push(heap, arena, d, c);
}

/* Distances along the surface from sources, by label correcting in the order of a heap; each
   triangle unfolds the source that lies behind two of its corners into its plane, which is exact as
   long as the unfolded triangles are: on planes, however the triangles are shaped. Elsewhere
   distances are too long by a fraction of a percent. (Exact algorithms keep intervals of edges
   instead, which costs ten times as much.)

   This holds for distances from one place. Several sources are not told apart: a triangle whose two
   corners were reached from different ones unfolds them as if they were one. Distances from a line
   come out too short by up to 2 %.

   sources   vertices, start their distances (NULL = 0). For a place inside a triangle: its corners,
             with their distances from it. Two corners at 0 make their whole edge a source
   limit     vertices farther away are not reached
   distance  receives one for each vertex of the surface, TXI_UNREACHED beyond limit
   cost      O(n log n) for n vertices within limit                                       */
static txm_status txi_geodesic(const txi_surface *s, const uint32_t *sources, const double *start,
                               size_t source_count, double limit, txm_env *env, double *distance) {
    txm_arena scratch;
    txi_heap heap;
    int good = 1;
    memset(&heap, 0, sizeof heap);
    txm_arena_init(&scratch, env);
    for (size_t v = 0; v < s->vertex_count; v++) distance[v] = TXI_UNREACHED;
    for (size_t i = 0; i < source_count && good; i++) {
        const double d = start ? start[i] : 0;
        if (d > limit || d >= distance[sources[i]]) continue;
        distance[sources[i]] = d;
        good = txi_heap_push(&heap, &scratch, d, sources[i]);
    }
    while (heap.count && good) {
        const txi_wait next = txi_heap_pop(&heap);
        if (next.distance > distance[next.vertex]) continue;
        for (uint32_t i = s->first[next.vertex]; i < s->first[next.vertex + 1] && good; i++) {
            const uint32_t c = s->corners[i], p = txi_next_corner(c), q = txi_next_corner(p);
            if (txi_is_flat_face(s, c / 3)) continue;
            good = txi_geodesic_update(s, &heap, &scratch, limit, c, p, q, distance) &&
                   txi_geodesic_update(s, &heap, &scratch, limit, c, q, p, distance);
        }
    }
    txm_arena_free(&scratch);
    return good ? TXM_OK : txi_no_memory(env);
}

/* ---- factor: sparse linear systems of flattening --------------------------------------------- */

enum { TXI_LEAF = 48 /* ours: unknowns that are not divided further */ };

/* A symmetric positive definite matrix whose pattern is a graph: A = P^T L D L^T P. Rows that
   are solved early have few entries; see txi_dissect. */
typedef struct txi_factor {
    size_t count, edge_count;
    const uint32_t *low, *high; /* the two unknowns of each edge                                  */
    uint32_t *order;    /* row k of L is unknown order[k]                                      */
    uint32_t *up_first, *up_row, *up_edge; /* entries A(up_row, k) above the diagonal, by column */
    uint32_t *parent;   /* elimination tree                                                    */
    size_t *first;      /* columns of L                                                        */
    size_t *filled;     /* entries of a column so far                                          */
    uint32_t *row;
    double *value;
    double *diagonal;   /* D                                                                   */
    double *work;       /* 2 per unknown                                                       */
    uint32_t *flag, *stack, *path;
} txi_factor;

/* The order of elimination: nested dissection by coordinates. The points are divided at the median
   along the longest side of their bounding box; those beyond it that have neighbours before it
   separate the rest and come last; so on with both halves. On surfaces L has O(n log n) entries.

   first, next  the neighbours of point i: next[first[i]] .. next[first[i + 1] - 1]
   order        receives the points
   pairs        scratch, 2 per point; side: scratch, 1 per point                            */
static void txi_dissect(size_t count, const txm_dvec3 *point, const uint32_t *first,
                        const uint32_t *next, uint32_t *order, txm_pair *pairs, uint32_t *side) {
    size_t begins[128], ends[128];
    int depth = 1;
    uint32_t stamp = 0;
    for (size_t i = 0; i < count; i++) {
        order[i] = (uint32_t)i;
        side[i] = 0;
    }
    begins[0] = 0;
    ends[0] = count;
    while (depth > 0) {
        const size_t begin = begins[--depth], end = ends[depth], n = end - begin, half = n / 2;
        if (n <= TXI_LEAF || depth + 2 > 128) continue;
        txm_dvec3 least = point[order[begin]], most = least;
        for (size_t k = begin; k < end; k++) {
            const txm_dvec3 p = point[order[k]];
            least = txm_d3(fmin(least.x, p.x), fmin(least.y, p.y), fmin(least.z, p.z));
            most = txm_d3(fmax(most.x, p.x), fmax(most.y, p.y), fmax(most.z, p.z));
        }
        const txm_dvec3 size = txm_d3_sub(most, least);
        const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
        for (size_t k = 0; k < n; k++) {
            const txm_dvec3 p = point[order[begin + k]];
            const double at = axis == 0 ? p.x - least.x : axis == 1 ? p.y - least.y : p.z - least.z;
            pairs[k].key = txm_sort_key(txm_float(at));
            pairs[k].value = order[begin + k];
        }
        txm_sort_pairs(pairs, pairs + n, n);
        stamp++;
        for (size_t k = 0; k < half; k++) {
            order[begin + k] = pairs[k].value;
            side[pairs[k].value] = stamp;
        }
        size_t to = begin + half, last = 0; /* the separator is gathered in the scratch half of
                                               pairs                                             */
        for (size_t k = half; k < n; k++) {
            const uint32_t v = pairs[k].value;
            int divides = 0;
            for (uint32_t e = first[v]; e < first[v + 1] && !divides; e++)
                divides = side[next[e]] == stamp;
            if (divides) pairs[n + last++].value = v;
            else order[to++] = v;
        }
        for (size_t k = 0; k < last; k++) order[to + k] = pairs[n + k].value;
        begins[depth] = begin;
        ends[depth++] = begin + half;
        begins[depth] = begin + half;
        ends[depth++] = to;
    }
}

/* Entries of row k of L: the nodes on the paths of the elimination tree from the entries of A
   above the diagonal of column k towards k. Fills stack from top, in an order in which children
   come before their parents; returns where it begins. */
static size_t txi_row_pattern(const txi_factor *f, uint32_t k) {
    size_t top = f->count;
    f->flag[k] = k;
    for (uint32_t e = f->up_first[k]; e < f->up_first[k + 1]; e++) {
        size_t length = 0;
        for (uint32_t i = f->up_row[e]; f->flag[i] != k; i = f->parent[i]) {
            TXM_ASSERT(length < f->count);
            f->path[length++] = i;
            f->flag[i] = k;
        }
        while (length > 0) f->stack[--top] = f->path[--length];
    }
    return top;
}

/* Fill parent, the elimination tree, and first, from how long the columns of L become. filled:
   0. */
static void txi_factor_tree(txi_factor *f) {
    for (uint32_t k = 0; k < f->count; k++) {
        f->parent[k] = UINT32_MAX;
        f->flag[k] = k;
        for (uint32_t e = f->up_first[k]; e < f->up_first[k + 1]; e++) {
            for (uint32_t i = f->up_row[e]; f->flag[i] != k; i = f->parent[i]) {
                if (f->parent[i] == UINT32_MAX) f->parent[i] = k;
                f->filled[i]++;
                f->flag[i] = k;
            }
        }
    }
    f->first[0] = 0;
    for (size_t k = 0; k < f->count; k++) f->first[k + 1] = f->first[k] + f->filled[k];
}

/* Find the order and the pattern of L for a graph of count unknowns at these points. */
static txm_status txi_factor_plan(txi_factor *f, size_t count, const txm_dvec3 *point,
                                  size_t edge_count, const uint32_t *low, const uint32_t *high,
                                  txm_arena *arena, txm_env *env) {
    memset(f, 0, sizeof *f);
    f->count = count;
    f->edge_count = edge_count;
    f->low = low;
    f->high = high;
    uint32_t *first = (uint32_t *)txm_arena_zero(arena, count + 2, sizeof(uint32_t));
    uint32_t *next = (uint32_t *)txm_arena_alloc(arena, 2 * edge_count + 1, sizeof(uint32_t));
    uint32_t *place = (uint32_t *)txm_arena_alloc(arena, count, sizeof(uint32_t));
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(arena, count, 2 * sizeof(txm_pair));
    f->order = (uint32_t *)txm_arena_alloc(arena, count, sizeof(uint32_t));
    f->up_first = (uint32_t *)txm_arena_zero(arena, count + 2, sizeof(uint32_t));
    f->up_row = (uint32_t *)txm_arena_alloc(arena, edge_count + 1, sizeof(uint32_t));
    f->up_edge = (uint32_t *)txm_arena_alloc(arena, edge_count + 1, sizeof(uint32_t));
    f->parent = (uint32_t *)txm_arena_alloc(arena, count, sizeof(uint32_t));
    f->first = (size_t *)txm_arena_alloc(arena, count + 1, sizeof(size_t));
    f->filled = (size_t *)txm_arena_zero(arena, count, sizeof(size_t));
    f->diagonal = (double *)txm_arena_alloc(arena, count, sizeof(double));
    f->work = (double *)txm_arena_zero(arena, count, 2 * sizeof(double));
    f->flag = (uint32_t *)txm_arena_alloc(arena, count, sizeof(uint32_t));
    f->stack = (uint32_t *)txm_arena_alloc(arena, count, sizeof(uint32_t));
    f->path = (uint32_t *)txm_arena_alloc(arena, count, sizeof(uint32_t));
    if (arena->failed) return txi_no_memory(env);

    for (size_t e = 0; e < edge_count; e++) {
        first[low[e] + 2]++;
        first[high[e] + 2]++;
    }
    for (size_t i = 2; i < count + 2; i++) first[i] += first[i - 1];
    for (size_t e = 0; e < edge_count; e++) {
        next[first[low[e] + 1]++] = high[e];
        next[first[high[e] + 1]++] = low[e];
    }
    txi_dissect(count, point, first, next, f->order, pairs, f->flag);
    for (size_t k = 0; k < count; k++) place[f->order[k]] = (uint32_t)k;

    for (size_t e = 0; e < edge_count; e++) {
        const uint32_t a = place[low[e]], b = place[high[e]];
        f->up_first[(a > b ? a : b) + 2]++;
    }
    for (size_t k = 2; k < count + 2; k++) f->up_first[k] += f->up_first[k - 1];
    for (size_t e = 0; e < edge_count; e++) {
        const uint32_t a = place[low[e]], b = place[high[e]];
        const uint32_t at = f->up_first[(a > b ? a : b) + 1]++;
        f->up_row[at] = a > b ? b : a;
        f->up_edge[at] = (uint32_t)e;
    }
    txi_factor_tree(f);
    f->row = (uint32_t *)txm_arena_alloc(arena, f->first[count] + 1, sizeof(uint32_t));
    f->value = (double *)txm_arena_alloc(arena, f->first[count] + 1, sizeof(double));
    return arena->failed ? txi_no_memory(env) : TXM_OK;
}

/* Compute L and D, row by row, of the matrix with diagonal[i] and, for each edge, -weight[edge]
   in both its places. */
static void txi_factor_make(txi_factor *f, const double *weight, const double *diagonal) {
    double *y = f->work;
    memset(f->filled, 0, f->count * sizeof *f->filled);
    for (size_t i = 0; i < f->count; i++) {
        y[i] = 0;
        f->flag[i] = UINT32_MAX;
    }
    for (uint32_t k = 0; k < f->count; k++) {
        const size_t top = txi_row_pattern(f, k);
        double d = diagonal[f->order[k]];
        for (uint32_t e = f->up_first[k]; e < f->up_first[k + 1]; e++)
            y[f->up_row[e]] = -weight[f->up_edge[e]];
        for (size_t s = top; s < f->count; s++) {
            const uint32_t i = f->stack[s];
            const double yi = y[i];
            const size_t begin = f->first[i], end = begin + f->filled[i];
            y[i] = 0;
            for (size_t p = begin; p < end; p++) y[f->row[p]] -= f->value[p] * yi;
            const double l = yi / f->diagonal[i];
            d -= l * yi;
            f->row[end] = k;
            f->value[end] = l;
            f->filled[i]++;
        }
        f->diagonal[k] = d > 1e-30 ? d : 1e-30; /* positive but for rounding */
    }
}

/* Solve for two right sides at once: xy holds them, 2 numbers for each unknown, and receives the
   solutions. */
static void txi_factor_solve(const txi_factor *f, double *xy) {
    double *z = f->work;
    for (size_t k = 0; k < f->count; k++) {
        z[2 * k] = xy[2 * (size_t)f->order[k]];
        z[2 * k + 1] = xy[2 * (size_t)f->order[k] + 1];
    }
    for (size_t k = 0; k < f->count; k++) {
        const double x = z[2 * k], y = z[2 * k + 1];
        for (size_t p = f->first[k]; p < f->first[k + 1]; p++) {
            z[2 * (size_t)f->row[p]] -= f->value[p] * x;
            z[2 * (size_t)f->row[p] + 1] -= f->value[p] * y;
        }
    }
    for (size_t k = f->count; k-- > 0;) {
        double x = z[2 * k] / f->diagonal[k], y = z[2 * k + 1] / f->diagonal[k];
        for (size_t p = f->first[k]; p < f->first[k + 1]; p++) {
            x -= f->value[p] * z[2 * (size_t)f->row[p]];
            y -= f->value[p] * z[2 * (size_t)f->row[p] + 1];
        }
        z[2 * k] = x;
        z[2 * k + 1] = y;
    }
    for (size_t k = 0; k < f->count; k++) {
        xy[2 * (size_t)f->order[k]] = z[2 * k];
        xy[2 * (size_t)f->order[k] + 1] = z[2 * k + 1];
    }
}

/* ---- unfold: a disk of faces ----------------------------------------------------------------- */

/* ours, radians: a disk that has more curvature than this is slit, from there to its border */
#define TXI_BEND 0.8

/* Faces that form a topological disk, glued along their sides. A vertex of the surface that the
   disk meets from several parts of its border has a copy in each. */
typedef struct txi_disk {
    uint32_t *faces;        /* of the surface                                                    */
    size_t face_count, room;
    uint32_t *corner;       /* 3 per face: its vertices, of the disk; while it grows, to be resolved
                               by txi_root                                                       */
    uint32_t *grown_from;   /* 1 per face: the face that it was added to; the first: itself      */
    size_t vertex_count;
    uint32_t *parent;       /* while it grows: vertices that are one                             */
    uint32_t *next, *prev;  /* the loop of sides that are the border; side k of face i is 3 i + k */
    uint8_t *is_border;     /* 1 per side                                                        */
    size_t loop;            /* sides of the border                                               */
    uint32_t border;        /* one of them                                                       */
    uint32_t *slot;         /* 1 per face of the surface: its place in faces, or TXI_NO_FACE     */
    double bend;            /* curvature within the disk, in radians, since it was last slit      */
    const double *depth;    /* 1 per vertex of the surface: it may be slit where this is above
                               slit_from; NULL: nowhere                                          */
    double slit_from;
} txi_disk;

/* Room for so many faces. */
static txm_status txi_disk_init(txi_disk *disk, const txi_surface *s, size_t room, txm_arena *arena,
                                txm_env *env) {
    memset(disk, 0, sizeof *disk);
    disk->room = room;
    disk->faces = (uint32_t *)txm_arena_alloc(arena, room, sizeof(uint32_t));
    disk->corner = (uint32_t *)txm_arena_alloc(arena, room, 3 * sizeof(uint32_t));
    disk->grown_from = (uint32_t *)txm_arena_alloc(arena, room, sizeof(uint32_t));
    disk->parent = (uint32_t *)txm_arena_alloc(arena, room + 2, sizeof(uint32_t));
    disk->next = (uint32_t *)txm_arena_alloc(arena, room, 3 * sizeof(uint32_t));
    disk->prev = (uint32_t *)txm_arena_alloc(arena, room, 3 * sizeof(uint32_t));
    disk->is_border = (uint8_t *)txm_arena_zero(arena, room, 3);
    disk->slot = (uint32_t *)txm_arena_alloc(arena, s->face_count, sizeof(uint32_t));
    if (arena->failed) return txi_no_memory(env);
    for (size_t f = 0; f < s->face_count; f++) disk->slot[f] = TXI_NO_FACE;
    return TXM_OK;
}

static uint32_t txi_new_vertex(txi_disk *disk) {
    disk->parent[disk->vertex_count] = (uint32_t)disk->vertex_count;
    return (uint32_t)disk->vertex_count++;
}

/* the side of the disk that this side of the surface is, TXM_NO_SIDE if its face is not in the
   disk */
static uint32_t txi_disk_side(const txi_disk *disk, uint32_t side) {
    if (side == TXM_NO_SIDE || disk->slot[side / 3] == TXI_NO_FACE) return TXM_NO_SIDE;
    return 3 * disk->slot[side / 3] + side % 3;
}
/* the side of the surface that this side of the disk is */
static uint32_t txi_surface_side(const txi_disk *disk, uint32_t side) {
    return 3 * disk->faces[side / 3] + side % 3;
}

static void txi_disk_link(txi_disk *disk, uint32_t side, uint32_t next) {
    disk->next[side] = next;
    disk->prev[next] = side;
}

/* The first face. */
static void txi_disk_begin(txi_disk *disk, uint32_t face) {
    disk->faces[0] = face;
    disk->grown_from[0] = 0;
    disk->slot[face] = 0;
    disk->face_count = 1;
    disk->loop = 3;
    disk->border = 0;
    for (uint32_t k = 0; k < 3; k++) {
        disk->corner[k] = txi_new_vertex(disk);
        disk->is_border[k] = 1;
        txi_disk_link(disk, k, (k + 1) % 3);
    }
}

/* The angle of the vector (x, y), y at least 0: 0 to pi. With tan(a / 2) = y / (r + x), halved
   twice more, then Taylor; only operations that give the same bits everywhere. */
static double txi_angle(double x, double y) {
    const double r = sqrt(x * x + y * y);
    if (!(r > 0) || (x < 0 && y <= -x * 1e-9)) return r > 0 ? TXM_PI : 0;
    double t = y / (r + x), turns = 2;
    for (; turns < 16 || t > 0.2; turns *= 2) t /= 1 + sqrt(1 + t * t);
    const double tt = t * t;
    return turns * t *
           (1 - tt * (1.0 / 3 - tt * (1.0 / 5 - tt * (1.0 / 7 - tt * (1.0 / 9 - tt / 11)))));
}

/* The curvature at a vertex of the surface: what the angles of its faces lack to a full turn. */
static double txi_angle_lack(const txi_surface *s, uint32_t vertex) {
    double sum = 2 * TXM_PI;
    for (uint32_t i = s->first[vertex]; i < s->first[vertex + 1]; i++) {
        const uint32_t c = s->corners[i], p = txi_next_corner(c), q = txi_next_corner(p);
        const txm_dvec3 a = txm_d3_sub(txi_corner_point(s, p), txi_corner_point(s, c));
        const txm_dvec3 b = txm_d3_sub(txi_corner_point(s, q), txi_corner_point(s, c));
        if (txi_is_flat_face(s, c / 3)) continue;
        sum -= txi_angle(txm_d3_dot(a, b), txm_d3_len(txm_d3_cross(a, b)));
    }
    return sum;
}

/* A vertex is about to come to lie within the disk. Should the disk stay slit there, as it has
   become too curved to lie flat? */
static int txi_disk_slits(txi_disk *disk, const txi_surface *s, uint32_t vertex) {
    disk->bend += txi_angle_lack(s, vertex);
    if (!disk->depth || disk->depth[vertex] <= disk->slit_from || fabs(disk->bend) < TXI_BEND)
        return 0;
    disk->bend = 0;
    return 1;
}

/* Glue the border's side with the next one as long as they are the two sides of one edge, then the
   sides before and behind them, and so on. At least three sides stay. */
static void txi_disk_zip(txi_disk *disk, const txi_surface *s, uint32_t side) {
    while (disk->loop >= 5) {
        const uint32_t other = disk->next[side], before = disk->prev[side],
                       behind = disk->next[other];
        if (txi_disk_side(disk, s->opposite[txi_surface_side(disk, side)]) != other) return;
        if (txi_disk_slits(disk, s, s->vertex[txi_surface_side(disk, other)])) return;
        txi_join_sets(disk->parent, disk->corner[side], disk->corner[txi_next_corner(other)]);
        disk->is_border[side] = disk->is_border[other] = 0;
        txi_disk_link(disk, before, behind);
        disk->loop -= 2;
        disk->border = before;
        side = before;
    }
}

/* Add the face beyond a side of the border, which must not be in the disk yet:

           c              The border runs  p, a b, q  before,  p, a c, c b, q  after. Where p and a
                          c
       n1 / \ n2          are the two sides of one edge they are glued, and a lies within; so are c
                          b
         /   \            and q. Where an edge returns to another part of the border it is not: that
    p > a --> b > q       would make a ring. It stays a cut.                                      */
static void txi_disk_add(txi_disk *disk, const txi_surface *s, uint32_t side) {
    const uint32_t o = s->opposite[txi_surface_side(disk, side)];
    const uint32_t i = (uint32_t)disk->face_count++, before = disk->prev[side],
                   behind = disk->next[side];
    const uint32_t base = 3 * i + o % 3, n1 = txi_next_corner(base), n2 = txi_next_corner(n1);
    disk->faces[i] = o / 3;
    disk->grown_from[i] = side / 3;
    disk->slot[o / 3] = i;
    disk->corner[base] = disk->corner[txi_next_corner(side)];
    disk->corner[n1] = disk->corner[side];
    disk->corner[n2] = txi_new_vertex(disk);
    disk->is_border[side] = 0;
    disk->is_border[n1] = disk->is_border[n2] = 1;
    txi_disk_link(disk, before, n1);
    txi_disk_link(disk, n1, n2);
    txi_disk_link(disk, n2, behind);
    disk->loop++;
    disk->border = n1;
    txi_disk_zip(disk, s, n2);
    if (disk->is_border[n1] && disk->is_border[disk->prev[n1]])
        txi_disk_zip(disk, s, disk->prev[n1]);
}

/* Number the vertices from 0 and resolve the corners. point receives one for each. */
static void txi_disk_finish(txi_disk *disk, const txi_surface *s, uint32_t *number,
                            txm_dvec3 *point) {
    uint32_t count = 0;
    for (size_t v = 0; v < disk->vertex_count; v++) number[v] = TXI_NO_FACE;
    for (size_t c = 0; c < 3 * disk->face_count; c++) {
        const uint32_t v = txi_root(disk->parent, disk->corner[c]);
        if (number[v] == TXI_NO_FACE) {
            point[count] = txi_corner_point(s, txi_surface_side(disk, (uint32_t)c));
            number[v] = count++;
        }
        disk->corner[c] = number[v];
    }
    disk->vertex_count = count;
}

/* How far the disk grows. Keys of faces: what lies deeper is added first. */
typedef struct txi_growth {
    const double *key;     /* 1 per face of the surface; faces above stop are not added          */
    double stop;
    const double *size;    /* 1 per face: how much it counts                                     */
    double wanted;         /* beyond stop_least it stops once so much has been added             */
    double stop_least;
    double most;           /* of all faces: stop in any case                                     */
    const double *weight;  /* 1 per face: how much it counts for most                            */
} txi_growth;

/* Grow a disk from a face, always by the face with the least key that touches it. */
static txm_status txi_disk_grow(txi_disk *disk, const txi_surface *s, uint32_t seed,
                                const txi_growth *g, txm_env *env) {
    txm_arena scratch;
    txi_heap heap;
    int good = 1;
    double size = g->size[seed], weight = g->weight[seed];
    memset(&heap, 0, sizeof heap);
    txm_arena_init(&scratch, env);
    txi_disk_begin(disk, seed);
    for (uint32_t at = 0; good && disk->face_count < disk->room;) {
        for (uint32_t side = 3 * at; side < 3 * at + 3 && good; side++) {
            const uint32_t o = s->opposite[txi_surface_side(disk, side)];
            if (o != TXM_NO_SIDE && disk->slot[o / 3] == TXI_NO_FACE)
                good = txi_heap_push(&heap, &scratch, g->key[o / 3], side);
        }
        uint32_t side = TXM_NO_SIDE, face = 0;
        while (heap.count && side == TXM_NO_SIDE) {
            const txi_wait next = txi_heap_pop(&heap);
            face = s->opposite[txi_surface_side(disk, next.vertex)] / 3;
            if (disk->slot[face] == TXI_NO_FACE) side = next.vertex;
        }
        if (side == TXM_NO_SIDE || g->key[face] > g->stop || weight + g->weight[face] > g->most ||
            (g->key[face] > g->stop_least && size >= g->wanted))
            break;
        at = (uint32_t)disk->face_count;
        txi_disk_add(disk, s, side);
        size += g->size[face];
        weight += g->weight[face];
    }
    txm_arena_free(&scratch);
    return good ? TXM_OK : txi_no_memory(env);
}

/* ---- flatten: a disk of faces in the plane --------------------------------------------------- */

enum {
    TXI_ARAP_ROUNDS = 60 /* ours; it ends earlier when nothing moves any more */
};
#define TXI_COT_LEAST 0.05 /* ours: cotangents are limited to this range, as thin faces would */
#define TXI_COT_MOST 20.0  /* make the system ill-conditioned and negative ones turn faces over */

/* A disk laid out in the plane. */
typedef struct txi_flat {
    const txi_disk *disk;
    txm_dvec3 *point;       /* 1 per vertex                                                      */
    double *xy;             /* 2 per vertex, in the unit of the surface; faces counter-clockwise  */
    double *shape;          /* 3 per face: in its own plane the corners are (0, 0), (s0, 0),
                               (s1, s2)                                                          */
    double *cot;            /* 3 per face: the cotangent of the angle opposite of side k          */
    size_t edge_count;
    uint32_t *low, *high;   /* the vertices of each edge                                         */
    uint32_t *edge;         /* 3 per face: the edge of side k                                    */
} txi_flat;

/* Number the edges. */
static void txi_flat_edges(txi_flat *flat, uint32_t *first, uint32_t *sides, uint32_t *lows,
                           uint32_t *seen, uint32_t *seen_edge) {
    const txi_disk *disk = flat->disk;
    const size_t count = 3 * disk->face_count;
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t a = disk->corner[i], b = disk->corner[txi_next_corner(i)];
        lows[i] = a < b ? a : b;
    }
    txi_bin(lows, count, NULL, disk->vertex_count, first, sides);
    for (size_t v = 0; v < disk->vertex_count; v++) seen[v] = UINT32_MAX;
    flat->edge_count = 0;
    for (uint32_t v = 0; v < disk->vertex_count; v++) {
        for (uint32_t i = first[v]; i < first[v + 1]; i++) {
            const uint32_t a = disk->corner[sides[i]], b = disk->corner[txi_next_corner(sides[i])];
            const uint32_t other = a == v ? b : a;
            if (seen[other] != v) {
                seen[other] = v;
                seen_edge[other] = (uint32_t)flat->edge_count;
                TXM_ASSERT(flat->edge_count < count);
                flat->low[flat->edge_count] = v;
                flat->high[flat->edge_count++] = other;
            }
            flat->edge[sides[i]] = seen_edge[other];
        }
    }
}

/* The shapes of the faces and their cotangents, limited. */
static void txi_flat_shapes(txi_flat *flat, const txi_surface *s) {
    const txi_disk *disk = flat->disk;
    for (size_t i = 0; i < disk->face_count; i++) {
        txm_dvec3 p[3];
        double *shape = flat->shape + 3 * i;
        for (uint32_t k = 0; k < 3; k++) p[k] = txi_corner_point(s, 3 * disk->faces[i] + k);
        const txm_dvec3 ab = txm_d3_sub(p[1], p[0]), ac = txm_d3_sub(p[2], p[0]);
        const double l = txm_d3_len(ab), area = txm_d3_len(txm_d3_cross(ab, ac));
        shape[0] = l;
        shape[1] = l > 0 ? txm_d3_dot(ab, ac) / l : 0;
        shape[2] = l > 0 ? area / l : txm_d3_len(ac);
        for (int k = 0; k < 3; k++) {
            const txm_dvec3 at = p[(k + 2) % 3];
            const double dot = txm_d3_dot(txm_d3_sub(p[k], at), txm_d3_sub(p[(k + 1) % 3], at));
            const double c = area > 0 ? dot / area : TXI_COT_MOST;
            flat->cot[3 * i + (size_t)k] = fmin(fmax(c, TXI_COT_LEAST), TXI_COT_MOST);
        }
    }
}

static txm_status txi_flat_init(txi_flat *flat, const txi_surface *s, const txi_disk *disk,
                                const txm_dvec3 *point, txm_arena *arena, txm_env *env) {
    const size_t faces = disk->face_count, vertices = disk->vertex_count;
    txm_arena scratch;
    txm_arena_init(&scratch, env);
    memset(flat, 0, sizeof *flat);
    flat->disk = disk;
    flat->point = (txm_dvec3 *)txm_arena_alloc(arena, vertices, sizeof(txm_dvec3));
    flat->xy = (double *)txm_arena_zero(arena, vertices, 2 * sizeof(double));
    flat->shape = (double *)txm_arena_alloc(arena, faces, 3 * sizeof(double));
    flat->cot = (double *)txm_arena_alloc(arena, faces, 3 * sizeof(double));
    flat->low = (uint32_t *)txm_arena_alloc(arena, faces, 3 * sizeof(uint32_t));
    flat->high = (uint32_t *)txm_arena_alloc(arena, faces, 3 * sizeof(uint32_t));
    flat->edge = (uint32_t *)txm_arena_alloc(arena, faces, 3 * sizeof(uint32_t));
    uint32_t *first = (uint32_t *)txm_arena_alloc(&scratch, vertices + 1, sizeof(uint32_t));
    uint32_t *sides = (uint32_t *)txm_arena_alloc(&scratch, faces, 3 * sizeof(uint32_t));
    uint32_t *lows = (uint32_t *)txm_arena_alloc(&scratch, faces, 3 * sizeof(uint32_t));
    uint32_t *seen = (uint32_t *)txm_arena_alloc(&scratch, vertices, 2 * sizeof(uint32_t));
    const int good = !arena->failed && !scratch.failed;
    if (good) {
        memcpy(flat->point, point, vertices * sizeof *point);
        txi_flat_edges(flat, first, sides, lows, seen, seen + vertices);
        txi_flat_shapes(flat, s);
    }
    txm_arena_free(&scratch);
    return good ? TXM_OK : txi_no_memory(env);
}

/* The border on a circle, each vertex at its share of the length, the rest where each is the
   mean of its neighbours, weighted by positive cotangents: no face is turned over (Tutte). The
   circle has the area of the surface. weight and diagonal: scratch, 1 per edge and vertex. */
static void txi_tutte(txi_flat *flat, txi_factor *factor, double *weight, double *diagonal,
                      uint8_t *fixed) {
    const txi_disk *disk = flat->disk;
    const size_t vertices = disk->vertex_count;
    double length = 0, area = 0, at = 0;
    uint32_t side = disk->border;
    memset(weight, 0, flat->edge_count * sizeof *weight);
    memset(diagonal, 0, vertices * sizeof *diagonal);
    memset(fixed, 0, vertices);
    for (size_t i = 0; i < disk->face_count; i++)
        area += flat->shape[3 * i] * flat->shape[3 * i + 2] / 2;
    for (size_t k = 0; k < disk->loop; k++, side = disk->next[side])
        length += txm_d3_dist(flat->point[disk->corner[side]],
                              flat->point[disk->corner[txi_next_corner(side)]]) + 1e-12;
    const double radius = sqrt(area / TXM_PI);
    for (size_t k = 0; k < disk->loop; k++, side = disk->next[side]) {
        const uint32_t v = disk->corner[side], to = disk->corner[txi_next_corner(side)];
        double sine, cosine;
        txm_sincos(2 * TXM_PI * at / length, &sine, &cosine);
        at += txm_d3_dist(flat->point[v], flat->point[to]) + 1e-12;
        fixed[v] = 1;
        flat->xy[2 * (size_t)v] = radius * cosine;
        flat->xy[2 * (size_t)v + 1] = radius * sine;
    }
    for (size_t i = 0; i < 3 * disk->face_count; i++) weight[flat->edge[i]] += flat->cot[i];
    for (size_t v = 0; v < vertices; v++) {
        if (fixed[v]) diagonal[v] = 1;
        else flat->xy[2 * v] = flat->xy[2 * v + 1] = 0;
    }
    for (size_t e = 0; e < flat->edge_count; e++) {
        for (int turn = 0; turn < 2; turn++) {
            const size_t a = turn ? flat->high[e] : flat->low[e],
                         b = turn ? flat->low[e] : flat->high[e];
            if (fixed[a]) continue;
            diagonal[a] += weight[e];
            if (!fixed[b]) continue;
            flat->xy[2 * a] += weight[e] * flat->xy[2 * b];
            flat->xy[2 * a + 1] += weight[e] * flat->xy[2 * b + 1];
        }
        if (fixed[flat->low[e]] || fixed[flat->high[e]]) weight[e] = 0;
    }
    txi_factor_make(factor, weight, diagonal);
    txi_factor_solve(factor, flat->xy);
}

/* Corner k of face i in its own plane. */
static void txi_shape_corner(const double *shape, int k, double *x, double *y) {
    *x = k == 0 ? 0 : k == 1 ? shape[0] : shape[1];
    *y = k == 2 ? shape[2] : 0;
}

/* Turn face i as it lies best, a b being the cosine and sine of the angle, and add its part of the
   right sides. */
static void txi_arap_face(const txi_flat *flat, size_t i, double face_weight, double *right) {
    double qx[3], qy[3], a = 0, b = 0;
    size_t v[3];
    for (int k = 0; k < 3; k++) {
        txi_shape_corner(flat->shape + 3 * i, k, &qx[k], &qy[k]);
        v[k] = flat->disk->corner[3 * i + (size_t)k];
    }
    for (int k = 0; k < 3; k++) {
        const int j = (k + 1) % 3;
        const double c = flat->cot[3 * i + (size_t)k];
        const double px = flat->xy[2 * v[j]] - flat->xy[2 * v[k]];
        const double py = flat->xy[2 * v[j] + 1] - flat->xy[2 * v[k] + 1];
        a += c * (px * (qx[j] - qx[k]) + py * (qy[j] - qy[k]));
        b += c * (py * (qx[j] - qx[k]) - px * (qy[j] - qy[k]));
    }
    const double n = sqrt(a * a + b * b);
    a = n > 0 ? a / n : 1;
    b = n > 0 ? b / n : 0;
    for (int k = 0; k < 3; k++) {
        const int j = (k + 1) % 3;
        const double c = flat->cot[3 * i + (size_t)k] * face_weight;
        const double x = c * (a * (qx[j] - qx[k]) - b * (qy[j] - qy[k]));
        const double y = c * (b * (qx[j] - qx[k]) + a * (qy[j] - qy[k]));
        right[2 * v[j]] += x;
        right[2 * v[j] + 1] += y;
        right[2 * v[k]] -= x;
        right[2 * v[k] + 1] -= y;
    }
}

/* As rigid as possible: turn each face as it lies best, then move the vertices so that the sum over
   the sides of

       weight(face) cot(side) |p_i - p_j - R(face) (q_i - q_j)|^2

   is least, q being the face in its own plane; by turns (the local and the global step of [6]). The
   weights of faces are not in [6]: what is known may be distorted more than the hole.

   weight, diagonal, right  scratch, 1 per edge, 1 and 2 per vertex
   small_step  of vertices, in the unit of the surface: end when none moves farther        */
static void txi_arap(txi_flat *flat, txi_factor *factor, const double *face_weight, double *weight,
                     double *diagonal, double *right, double small_step) {
    const txi_disk *disk = flat->disk;
    const size_t vertices = disk->vertex_count;
    memset(weight, 0, flat->edge_count * sizeof *weight);
    memset(diagonal, 0, vertices * sizeof *diagonal);
    for (size_t i = 0; i < 3 * disk->face_count; i++)
        weight[flat->edge[i]] += flat->cot[i] * face_weight[i / 3];
    for (size_t e = 0; e < flat->edge_count; e++) {
        diagonal[flat->low[e]] += weight[e];
        diagonal[flat->high[e]] += weight[e];
    }
    /* one vertex is held weakly where it lies: the sum does not depend on where the whole lies */
    const double hold = diagonal[0] * 1e-3;
    diagonal[0] += hold;
    txi_factor_make(factor, weight, diagonal);
    for (int round = 0; round < TXI_ARAP_ROUNDS; round++) {
        memset(right, 0, vertices * 2 * sizeof *right);
        right[0] = hold * flat->xy[0];
        right[1] = hold * flat->xy[1];
        for (size_t i = 0; i < disk->face_count; i++)
            txi_arap_face(flat, i, face_weight[i], right);
        txi_factor_solve(factor, right);
        double moved = 0;
        for (size_t v = 0; v < 2 * vertices; v++) {
            moved = fmax(moved, fabs(right[v] - flat->xy[v]));
            flat->xy[v] = right[v];
        }
        if (moved < small_step) break;
    }
}

/* Lay the disk out. face_weight: 1 per face of the disk, how rigid it is to be, above 0. */
static txm_status txi_flatten(txi_flat *flat, const double *face_weight, double small_step,
                              txm_env *env) {
    const size_t vertices = flat->disk->vertex_count;
    txm_arena scratch;
    txi_factor factor;
    txm_arena_init(&scratch, env);
    double *weight = (double *)txm_arena_alloc(&scratch, flat->edge_count, sizeof(double));
    double *diagonal = (double *)txm_arena_alloc(&scratch, vertices, sizeof(double));
    double *right = (double *)txm_arena_alloc(&scratch, vertices, 2 * sizeof(double));
    uint8_t *fixed = (uint8_t *)txm_arena_alloc(&scratch, vertices, 1);
    txm_status status = scratch.failed ? txi_no_memory(env) : TXM_OK;
    if (status == TXM_OK)
        status = txi_factor_plan(&factor, vertices, flat->point, flat->edge_count, flat->low,
                                 flat->high, &scratch, env);
    if (status == TXM_OK) {
        txi_tutte(flat, &factor, weight, diagonal, fixed);
        txi_arap(flat, &factor, face_weight, weight, diagonal, right, small_step);
    }
    txm_arena_free(&scratch);
    return status;
}

/* ---- resample: between maps and windows ------------------------------------------------------ */

enum {
    TXI_NEAR = 3, /* texels; ours: how far a pixel between charts looks for a texel of its own   */
    TXI_NEAR_SOLID = 8, /* pixels; ours: how far a target in void looks for a pixel that is not */
    TXI_GUTTER_WIDTH = 8, /* texels; the default of desc.gutter                             */
    TXI_TAPS = 6, /* of the kernel, per axis                                                    */
    TXI_KERNEL_STEPS = 128 /* ours: places between two samples in the kernel's table            */
};

/* A window of this size from the arena: everything void. */
static txm_status txi_window_alloc(txi_window *w, int width, int height, txm_arena *arena,
                                   txm_env *env) {
    const size_t count = (size_t)width * (size_t)height;
    memset(w, 0, sizeof *w);
    w->width = width;
    w->height = height;
    w->state = (uint8_t *)txm_arena_zero(arena, count, 1);
    w->color = (uint8_t *)txm_arena_zero(arena, count, 4);
    w->share = (uint8_t *)txm_arena_zero(arena, count, 1);
    w->texel = (txm_vec2 *)txm_arena_zero(arena, count, sizeof(txm_vec2));
    w->place = (txm_vec3 *)txm_arena_zero(arena, count, sizeof(txm_vec3));
    w->normal = (txm_vec3 *)txm_arena_zero(arena, count, sizeof(txm_vec3));
    w->axis = (txm_vec2 *)txm_arena_zero(arena, count, sizeof(txm_vec2));
    w->mirrored = (uint8_t *)txm_arena_zero(arena, count, 1);
    w->face = (uint32_t *)txm_arena_alloc(arena, count, sizeof(uint32_t));
    if (arena->failed) return txi_no_memory(env);
    for (size_t i = 0; i < count; i++) w->face[i] = TXI_NO_FACE;
    return TXM_OK;
}

/* Interpolation is by the kernel of Lanczos with three lobes: from texels to pixels and back it
   keeps three quarters of the energy of fine detail, the spline of Catmull and Rom half of it. Its
   weights for samples at -2 .. 3, for a place t from 0 to below 1, which sum up to 1:

       w(x) = sinc(pi x) sinc(pi x / 3),   x = t + 2 .. t - 3                                   */
static void txi_lanczos(double t, double weight[TXI_TAPS]) {
    /* cosine and sine of i / 3 of a half turn, i = -2 .. 3 */
    static const double c[TXI_TAPS] = {-0.5, 0.5, 1, 0.5, -0.5, -1};
    static const double s[TXI_TAPS] = {-0.86602540378443865, -0.86602540378443865, 0,
                                       0.86602540378443865, 0.86602540378443865, 0};
    double whole, third, across, unused, sum = 0;
    txm_sincos(TXM_PI * t, &whole, &unused);
    txm_sincos(TXM_PI / 3 * t, &third, &across);
    for (int i = 0; i < TXI_TAPS; i++) {
        const double x = t - (i - 2);
        weight[i] = (i % 2 ? -whole : whole) * (third * c[i] - across * s[i]);
        weight[i] = fabs(x) < 1e-5 ? 1 : weight[i] * (3 / (TXM_PI * TXM_PI)) / (x * x);
        sum += weight[i];
    }
    for (int i = 0; i < TXI_TAPS; i++) weight[i] /= sum;
}

/* Its weights for t = 0, 1 / TXI_KERNEL_STEPS, .. 1, as they take longer to compute than to use. */
typedef struct txi_kernel {
    double weight[TXI_KERNEL_STEPS + 1][TXI_TAPS];
} txi_kernel;

static void txi_kernel_init(txi_kernel *kernel) {
    memset(kernel, 0, sizeof *kernel);
    for (int i = 0; i < TXI_KERNEL_STEPS; i++)
        txi_lanczos((double)i / (double)TXI_KERNEL_STEPS, kernel->weight[i]);
    for (int k = 0; k < TXI_TAPS; k++) kernel->weight[TXI_KERNEL_STEPS][k] = k == 3;
}

static void txi_kernel_at(const txi_kernel *kernel, double t, double weight[TXI_TAPS]) {
    const int i = (int)(t * (double)TXI_KERNEL_STEPS);
    const double part = t * (double)TXI_KERNEL_STEPS - i;
    const double *a = kernel->weight[i], *b = kernel->weight[i < TXI_KERNEL_STEPS ? i + 1 : i];
    for (int k = 0; k < TXI_TAPS; k++) weight[k] = a[k] + part * (b[k] - a[k]);
}

/* A value between the four samples around it, in excess of them by at most a quarter of their
   range: the kernel must not ring at hard edges. */
static double txi_limit(double value, double low, double high) {
    const double more = 0.25 * (high - low);
    return value < low - more ? low - more : value > high + more ? high + more : value;
}

/* May a pixel on this face take texel (x, y), not wrapped yet? Its number, or -1: there is none, or
   it belongs to another chart. */
static int64_t txi_tap(const txi_domain *d, uint32_t face, int x, int y) {
    if (!d->surface) {
        if (x < 0 || y < 0 || x >= d->width || y >= d->height) return -1;
        return (int64_t)y * d->width + x;
    }
    const int64_t i = (int64_t)txi_wrap(y, d->height) * d->width + txi_wrap(x, d->width);
    const uint32_t owner = d->surface->owner[i];
    if (owner == TXI_NO_FACE || face == TXI_NO_FACE) return -1;
    return d->surface->chart[owner] == d->surface->chart[face] ? i : -1;
}

/* The texel nearest to p that a pixel on this face may take, at most TXI_NEAR away, -1 if there is
   none. known: only texels that are not missing. */
static int64_t txi_nearest_tap(const txi_domain *d, uint32_t face, txm_vec2 p, int known) {
    const int cx = (int)floor((double)p.x + 0.5), cy = (int)floor((double)p.y + 0.5);
    int64_t best = -1;
    double least = 0;
    for (int y = cy - TXI_NEAR; y <= cy + TXI_NEAR; y++) {
        for (int x = cx - TXI_NEAR; x <= cx + TXI_NEAR; x++) {
            const int64_t i = txi_tap(d, face, x, y);
            const double dx = (double)x - p.x, dy = (double)y - p.y, apart = dx * dx + dy * dy;
            if (i < 0 || (known && d->missing[i]) || (best >= 0 && apart >= least)) continue;
            best = i;
            least = apart;
        }
    }
    return best;
}

/* Texels around a place and their weights, which sum up to 1. */
typedef struct txi_taps {
    int count, is_limited;  /* is_limited: by the inner four */
    int64_t texel[TXI_TAPS * TXI_TAPS], inner[4];
    double weight[TXI_TAPS * TXI_TAPS];
} txi_taps;

/* The known texels around p that a pixel on this face may take: those of the kernel, if the
   inner four are among them and little weight is lost; else those of the inner four, bilinear;
   else the nearest. */
static void txi_taps_at(const txi_domain *d, const txi_kernel *kernel, uint32_t face, txm_vec2 p,
                        int is_label, txi_taps *taps) {
    const double fx = floor((double)p.x), fy = floor((double)p.y), tx = p.x - fx, ty = p.y - fy;
    const int x = (int)fx, y = (int)fy;
    double wx[TXI_TAPS], wy[TXI_TAPS], part = 0, sum = 0;
    taps->count = taps->is_limited = 0;
    for (int k = 0; k < 4 && !is_label; k++) {
        const int64_t i = txi_tap(d, face, x + k % 2, y + k / 2);
        if (i < 0 || d->missing[i]) continue;
        taps->inner[taps->count] = taps->texel[taps->count] = i;
        taps->weight[taps->count] = (k % 2 ? tx : 1 - tx) * (k / 2 ? ty : 1 - ty);
        part += taps->weight[taps->count++];
    }
    if (taps->count == 4) {
        int count = 0;
        txi_kernel_at(kernel, tx, wx);
        txi_kernel_at(kernel, ty, wy);
        for (int k = 0; k < TXI_TAPS * TXI_TAPS; k++) {
            const int i = k % TXI_TAPS, j = k / TXI_TAPS;
            const int64_t texel = txi_tap(d, face, x - 2 + i, y - 2 + j);
            if (texel < 0 || d->missing[texel]) continue;
            taps->texel[count] = texel;
            taps->weight[count] = wx[i] * wy[j];
            sum += taps->weight[count++];
        }
        taps->count = count;
        taps->is_limited = 1;
        for (int k = 0; k < count; k++) taps->weight[k] /= sum;
        if (sum > 0.8) return;
        for (int k = 0; k < 4; k++) { /* too little is left of it */
            taps->texel[k] = taps->inner[k];
            taps->weight[k] = (k % 2 ? tx : 1 - tx) * (k / 2 ? ty : 1 - ty);
        }
        taps->count = 4;
        return;
    }
    for (int k = 0; k < taps->count; k++) taps->weight[k] /= part;
    if (part > 0.05) return;
    taps->texel[0] = txi_nearest_tap(d, face, p, 1);
    taps->weight[0] = 1;
    taps->count = taps->texel[0] >= 0;
}

/* Are the samples of a map labels? */
static int txi_is_label(const txi_domain *d, int map) {
    return map > 0 && d->desc->maps[map - 1].is_label;
}

/* Does a map have colours, which count times their alpha? */
static int txi_has_alpha(const txi_domain *d, int map) {
    const texinpaint_map *kind = map ? &d->desc->maps[map - 1] : NULL;
    return !(kind && (kind->is_normal || kind->is_label)) && d->maps[map].channels % 2 == 0;
}

/* Continue the visible colours of all maps into what is transparent in the hole. Known texels stay, to
   the byte. */
static txm_status txi_bleed(const txi_domain *d, txm_env *env) {
    const size_t count = (size_t)d->width * (size_t)d->height;
    txm_status status = TXM_OK;
    txm_arena arena;
    uint8_t *hole = NULL;
    txm_arena_init(&arena, env);
    for (int map = 0; map < d->map_count && status == TXM_OK; map++) {
        if (!txi_has_alpha(d, map)) continue;
        if (!hole) {
            hole = (uint8_t *)txm_arena_alloc(&arena, count, 1);
            if (!hole) status = txi_no_memory(env);
            else txm_mask_read(&d->desc->mask, TXM_MASK_REPLACES, hole);
        }
        if (status == TXM_OK) status = txm_image_bleed_part(&d->maps[map], hole, 0, 1, 1, env);
    }
    txm_arena_free(&arena);
    return status;
}

/* A channel of a texel; colours times their alpha, if has_alpha. */
static double txi_texel_value(const txm_image *image, int has_alpha, int64_t texel, int c) {
    const int x = (int)(texel % image->width), y = (int)(texel / image->width),
              last = image->channels - 1;
    const double value = txm_image_get(image, x, y, c);
    return has_alpha && c < last ? value * txm_clampf(txm_image_get(image, x, y, last), 0, 1)
                                 : value;
}

/* The samples of a row, as they are stored. */
static void txi_load_row(const txm_image *image, int x, int y, int count, double *out) {
    const void *row = (const char *)image->pixels + image->stride * y;
    const size_t first = (size_t)x * (size_t)image->channels;
    if (image->sample == TXM_U8) {
        for (int i = 0; i < count; i++) out[i] = ((const uint8_t *)row + first)[i];
    } else if (image->sample == TXM_U16) {
        for (int i = 0; i < count; i++) out[i] = ((const uint16_t *)row + first)[i];
    } else {
        for (int i = 0; i < count; i++) out[i] = ((const float *)row + first)[i];
    }
}

/* The channels of a map at a place all around which texels are known and of one chart. */
static void txi_read_inside(const txm_image *image, int has_alpha, const txi_kernel *kernel,
                            txm_vec2 p, float *out) {
    enum { N = TXI_TAPS, ROW = N * (int)TXI_MAX_CHANNELS };
    const double fx = floor((double)p.x), fy = floor((double)p.y);
    const int x = (int)fx - 2, y = (int)fy - 2, channels = image->channels;
    const double unit = image->sample == TXM_U8 ? 255 : image->sample == TXM_U16 ? 65535 : 1;
    double wx[N], wy[N], v[N * ROW];
    txi_kernel_at(kernel, p.x - fx, wx);
    txi_kernel_at(kernel, p.y - fy, wy);
    for (int j = 0; j < N; j++) {
        txi_load_row(image, x, y + j, N * channels, v + j * ROW);
        for (int i = 0; i < N * channels && has_alpha; i++) {
            const double alpha = v[j * ROW + i - i % channels + channels - 1] / unit;
            if (i % channels < channels - 1) v[j * ROW + i] *= fmin(fmax(alpha, 0), 1);
        }
    }
    for (int c = 0; c < channels; c++) {
        const double *a = v + 2 * ROW + 2 * channels + c, *b = a + ROW; /* the inner four */
        const double low = fmin(fmin(a[0], a[channels]), fmin(b[0], b[channels]));
        const double high = fmax(fmax(a[0], a[channels]), fmax(b[0], b[channels]));
        double sum = 0;
        for (int j = 0; j < N; j++) {
            const double *row = v + j * ROW + c;
            double line = 0;
            for (int i = 0; i < N; i++) line += wx[i] * row[i * channels];
            sum += wy[j] * line;
        }
        out[c] = txm_float(txi_limit(sum, low, high) / unit);
    }
}

/* Are all texels of the kernel at p known and of the chart of this face? Decided by tiles; 0
   also where that is not enough. */
static int txi_is_inside(const txi_domain *d, uint32_t face, txm_vec2 p) {
    const txi_surface *s = d->surface;
    const int x = (int)floor((double)p.x) - 2, y = (int)floor((double)p.y) - 2, side = TXI_TILE;
    if (x < 0 || y < 0 || x + TXI_TAPS > d->width || y + TXI_TAPS > d->height) return 0;
    for (int k = 0; k < 4; k++) {
        const size_t tx = (size_t)((x + k % 2 * (TXI_TAPS - 1)) / side);
        const size_t ty = (size_t)((y + k / 2 * (TXI_TAPS - 1)) / side);
        if (s->tile[ty * s->tile_stride + tx] != s->chart[face]) return 0;
    }
    for (int j = 0; j < TXI_TAPS; j++) {
        static const uint8_t none[TXI_TAPS] = {0};
        if (memcmp(d->missing + (size_t)(y + j) * (size_t)d->width + (size_t)x, none, TXI_TAPS) !=
            0)
            return 0;
    }
    return 1;
}

/* All channels of a map at pixel i of the window, which is not void; colours times their alpha. */
static void txi_read_pixel(const txi_domain *d, const txi_kernel *kernel, const txi_window *w,
                           int map, size_t i, float *out) {
    const txm_image *image = &d->maps[map];
    const int label = txi_is_label(d, map), has_alpha = txi_has_alpha(d, map);
    txi_taps taps;
    if (!d->surface) { /* pixels of a picture are its texels */
        const int x = (int)w->texel[i].x, y = (int)w->texel[i].y;
        const int64_t texel = (int64_t)y * d->width + x;
        for (int c = 0; c < image->channels; c++)
            out[c] = d->missing[texel] ? 0 : txm_float(txi_texel_value(image, has_alpha, texel, c));
        return;
    }
    if (!label && txi_is_inside(d, w->face[i], w->texel[i])) {
        txi_read_inside(image, has_alpha, kernel, w->texel[i], out);
        return;
    }
    txi_taps_at(d, kernel, w->face[i], w->texel[i], label, &taps);
    for (int c = 0; c < image->channels; c++) {
        double sum = 0, low = 0, high = 0;
        for (int k = 0; k < taps.count; k++)
            sum += taps.weight[k] * txi_texel_value(image, has_alpha, taps.texel[k], c);
        for (int k = 0; k < 4 && taps.is_limited; k++) {
            const double v = txi_texel_value(image, has_alpha, taps.inner[k], c);
            low = k ? fmin(low, v) : v;
            high = k ? fmax(high, v) : v;
        }
        out[c] = txm_float(taps.is_limited ? txi_limit(sum, low, high) : sum);
    }
}

/* ---- resample: values as they are blended ------------------------------------------------------
   Samples of colours are times their alpha, as a transparent texel has no colour. Normals are
   vectors in the directions of the window (x right, y down, z out of the surface), so that they
   keep their direction on the surface across charts of the atlas, and with pieces that are
   turned. */

/* A sample of the texture, its colours already times their alpha, as it is blended. */
static void txi_pack(const txi_domain *d, int map, txm_vec2 axis, int mirrored, float *v) {
    const texinpaint_map *kind = map ? &d->desc->maps[map - 1] : NULL;
    if (kind && kind->is_normal) {
        const txm_sample sample = kind->image.sample;
        const double x = txm_normal_decode((double)v[0], sample);
        const double y = txm_normal_decode((double)v[1], sample) * (kind->is_normal == 2 ? 1 : -1) *
                         (mirrored ? -1 : 1);
        v[0] = txm_float(x * (double)axis.x - y * (double)axis.y);
        v[1] = txm_float(x * (double)axis.y + y * (double)axis.x);
        v[2] = txm_float(txm_normal_decode((double)v[2], sample));
    }
}

/* The reverse; normals get unit length. */
static void txi_unpack(const txi_domain *d, int map, txm_vec2 axis, int mirrored, float *v) {
    const texinpaint_map *kind = map ? &d->desc->maps[map - 1] : NULL;
    const int channels = d->maps[map].channels;
    if (kind && kind->is_normal) {
        const txm_sample sample = kind->image.sample;
        double x = (double)v[0] * (double)axis.x + (double)v[1] * (double)axis.y;
        double y = (double)v[1] * (double)axis.x - (double)v[0] * (double)axis.y;
        const double length = sqrt(x * x + y * y + (double)v[2] * (double)v[2]);
        const double scale = length > 0 ? 1 / length : 0;
        y *= (kind->is_normal == 2 ? 1 : -1) * (mirrored ? -1 : 1);
        const double z = length > 0 ? (double)v[2] * scale : 1;
        v[0] = txm_float(txm_normal_encode(x * scale, sample));
        v[1] = txm_float(txm_normal_encode(y * scale, sample));
        v[2] = txm_float(txm_normal_encode(z, sample));
    } else if (txi_has_alpha(d, map)) {
        const float alpha = txm_minf(v[channels - 1], 1);
        for (int c = 0; c < channels - 1 && alpha > 1e-4f; c++) v[c] = v[c] / alpha;
    }
}

/* ---- resample: from maps to windows, from windows to maps ---- */

/* Every channel of a map at the window's pixels: values receives width * height * channels numbers,
   in the units of txm_image_get. Interpolated from known texels of the pixel's own chart; labels
   are those of the nearest texel. 0 where there is no known texel. */
static void txi_window_read(const txi_domain *d, const txi_window *w, int map, float *values) {
    const size_t count = (size_t)w->width * (size_t)w->height;
    const size_t channels = (size_t)d->maps[map].channels;
    txi_kernel kernel;
    txi_kernel_init(&kernel);
    for (size_t i = 0; i < count; i++) {
        float *v = values + i * channels;
        if (w->state[i] == TXI_VOID) {
            memset(v, 0, channels * sizeof *v);
        } else {
            txi_read_pixel(d, &kernel, w, map, i, v);
            txi_pack(d, map, w->axis[i], w->mirrored[i], v);
        }
    }
}

/* Is a pixel, that has a surface, known, missing or not to be copied from? A hole if its nearest
   texel is missing, or one that has more than 2 % of the bilinear weight; void without any. */
static uint8_t txi_pixel_state(const txi_domain *d, uint32_t face, txm_vec2 p) {
    const double fx = floor((double)p.x), fy = floor((double)p.y);
    double most = 0;
    int64_t nearest = -1;
    if (d->surface && txi_is_inside(d, face, p))
        return d->usable[(size_t)floor((double)p.y + 0.5) * (size_t)d->width +
                         (size_t)floor((double)p.x + 0.5)]
                   ? TXI_KNOWN
                   : TXI_FOREIGN;
    for (int k = 0; k < 4; k++) {
        const int64_t i = txi_tap(d, face, (int)fx + k % 2, (int)fy + k / 2);
        const double u = k % 2 ? p.x - fx : 1 - (p.x - fx), v = k / 2 ? p.y - fy : 1 - (p.y - fy);
        if (i < 0 || u * v < 0.02) continue;
        if (d->missing[i]) return TXI_HOLE;
        if (u * v <= most) continue;
        most = u * v;
        nearest = i;
    }
    if (nearest < 0) nearest = txi_nearest_tap(d, face, p, 0);
    if (nearest < 0) return TXI_VOID;
    if (d->missing[nearest]) return TXI_HOLE;
    return d->usable[nearest] ? TXI_KNOWN : TXI_FOREIGN;
}

static uint8_t txi_byte(double unit) {
    return (uint8_t)(unit >= 1 ? 255 : unit > 0 ? unit * 255 + 0.5 : 0.5);
}

/* The bilinear weight of the known texels around a place, 0..255. */
static uint8_t txi_known_share(const txi_domain *d, uint32_t face, txm_vec2 p) {
    const double fx = floor((double)p.x), fy = floor((double)p.y);
    double sum = 0;
    for (int k = 0; k < 4; k++) {
        const int64_t i = txi_tap(d, face, (int)fx + k % 2, (int)fy + k / 2);
        const double u = k % 2 ? p.x - fx : 1 - (p.x - fx), v = k / 2 ? p.y - fy : 1 - (p.y - fy);
        if (i >= 0 && !d->missing[i]) sum += u * v;
    }
    return (uint8_t)(255 * sum + 0.5);
}

/* Fill state, of pixels that are not void, share and color from the maps as they are now. */
static void txi_window_colors(const txi_domain *d, txi_window *w) {
    const int channels = d->maps[0].channels, has_alpha = txi_has_alpha(d, 0);
    const size_t count = (size_t)w->width * (size_t)w->height;
    txi_kernel kernel;
    txi_kernel_init(&kernel);
    for (size_t i = 0; i < count; i++) {
        float v[TXI_MAX_CHANNELS] = {0, 0, 0, 0};
        uint8_t *out = w->color + 4 * i;
        memset(out, 0, 4);
        if (w->state[i] != TXI_VOID) w->state[i] = txi_pixel_state(d, w->face[i], w->texel[i]);
        w->share[i] = w->state[i] == TXI_HOLE ? txi_known_share(d, w->face[i], w->texel[i]) : 0;
        if (w->state[i] == TXI_VOID) continue;
        txi_read_pixel(d, &kernel, w, 0, i, v);
        const double alpha = has_alpha ? (double)txm_clampf(v[channels - 1], 0, 1) : 1;
        for (int c = 0; c < 3; c++)
            out[c] = txi_byte(v[channels >= 3 ? c : 0] + (1 - alpha) * (128 / 255.0));
    }
}

/* The window's values at (x, y): by the kernel; where one of its pixels is void, bilinear from
   those of the four around that are not. 0: all four are void. */
static int txi_window_value(const txi_window *w, const txi_kernel *kernel, int channels,
                            int is_label, const float *values, double x, double y,
                            float out[TXI_MAX_CHANNELS]) {
    enum { N = TXI_TAPS };
    const double fx = floor(x), fy = floor(y);
    const int left = (int)fx - 2, up = (int)fy - 2;
    double wx[N], wy[N], bilinear[4], sum = 0, best = 0;
    size_t at[N * N];
    int solid[N * N], whole = 1, nearest = -1;
    for (int k = 0; k < N * N; k++) {
        const int px = left + k % N, py = up + k / N;
        solid[k] = px >= 0 && py >= 0 && px < w->width && py < w->height;
        at[k] = solid[k] ? (size_t)py * (size_t)w->width + (size_t)px : 0;
        solid[k] = solid[k] && w->state[at[k]] != TXI_VOID;
        whole &= solid[k];
        at[k] *= (size_t)channels;
    }
    for (int k = 0; k < 4; k++) {
        const int tap = (2 + k / 2) * N + 2 + k % 2;
        const double u = k % 2 ? x - fx : 1 - (x - fx), v = k / 2 ? y - fy : 1 - (y - fy);
        bilinear[k] = solid[tap] ? u * v : 0;
        sum += bilinear[k];
        if (!(bilinear[k] > best)) continue;
        best = bilinear[k];
        nearest = tap;
    }
    if (nearest < 0) return 0;
    txi_kernel_at(kernel, x - fx, wx);
    txi_kernel_at(kernel, y - fy, wy);
    for (int c = 0; c < channels; c++) {
        const float *value = values + c;
        double total = 0, low = value[at[nearest]], high = low;
        for (int k = 0; k < 4; k++) {
            const double v = value[at[(2 + k / 2) * N + 2 + k % 2]];
            if (bilinear[k] > 0) total += bilinear[k] / sum * v;
            if (bilinear[k] > 0 || whole) low = fmin(low, v);
            if (bilinear[k] > 0 || whole) high = fmax(high, v);
        }
        if (whole) {
            total = 0;
            for (int k = 0; k < N * N; k++) total += wx[k % N] * wy[k / N] * value[at[k]];
            total = txi_limit(total, low, high);
        }
        out[c] = is_label ? value[at[nearest]] : txm_float(total);
    }
    return 1;
}

/* The pixel nearest to (x, y) that is not void, -1 if there is none within TXI_NEAR_SOLID. */
static int64_t txi_solid_near(const txi_window *w, double x, double y) {
    const int cx = (int)floor(x + 0.5), cy = (int)floor(y + 0.5);
    int64_t best = -1;
    double least = 0;
    for (int py = cy - TXI_NEAR_SOLID; py <= cy + TXI_NEAR_SOLID; py++) {
        for (int px = cx - TXI_NEAR_SOLID; px <= cx + TXI_NEAR_SOLID; px++) {
            if (px < 0 || py < 0 || px >= w->width || py >= w->height) continue;
            const int64_t i = (int64_t)py * w->width + px;
            const double dx = px - x, dy = py - y, apart = dx * dx + dy * dy;
            if (w->state[i] == TXI_VOID || (best >= 0 && apart >= least)) continue;
            best = i;
            least = apart;
        }
    }
    return best;
}

/* Write values, laid out as txi_window_read gives them, to the window's targets in a map. No other
   texel changes. */
static void txi_window_write(txi_domain *d, const txi_window *w, int map, const float *values) {
    const txm_image *image = &d->maps[map];
    const int channels = image->channels, label = txi_is_label(d, map);
    txi_kernel kernel;
    txi_kernel_init(&kernel);
    for (size_t i = 0; i < w->target_count; i++) {
        const txi_target *t = &w->targets[i];
        const int x = (int)(t->texel % (uint32_t)d->width),
                  y = (int)(t->texel / (uint32_t)d->width);
        float value[TXI_MAX_CHANNELS] = {0, 0, 0, 0};
        if (!txi_window_value(w, &kernel, channels, label, values, t->x, t->y, value)) {
            const int64_t pixel = txi_solid_near(w, t->x, t->y);
            for (int c = 0; c < channels && pixel >= 0; c++)
                value[c] = values[pixel * channels + c];
        }
        txi_unpack(d, map, t->axis, t->mirrored, value);
        for (int c = 0; c < channels; c++) txm_image_set(image, x, y, c, value[c]);
    }
}

/* The targets are not missing any longer. They may be copied from unless the caller has said where
   texture may be taken from. */
static void txi_window_done(txi_domain *d, const txi_window *w) {
    for (size_t i = 0; i < w->target_count; i++) {
        d->missing[w->targets[i].texel] = 0;
        if (!d->desc->source.pixels) d->usable[w->targets[i].texel] = 1;
    }
}

/* ---- resample: gutters ----------------------------------------------------------------------- */

/* Copy all maps from one texel to another. */
static void txi_copy_texel(const txi_domain *d, size_t from, size_t to) {
    const size_t w = (size_t)d->width;
    for (int m = 0; m < d->map_count; m++) {
        const txm_image *image = &d->maps[m];
        const size_t bytes = (size_t)image->channels * txm_sample_bytes(image->sample);
        memcpy((uint8_t *)txm_image_row(image, (int)(to / w)) + to % w * bytes,
               (const uint8_t *)txm_image_row_const(image, (int)(from / w)) + from % w * bytes,
               bytes);
    }
}

/* Missing texels outside the charts, at most desc->gutter from a texel in a chart, get the
   values of the nearest one in all maps. They are not missing any longer. filled receives how
   many. */
static txm_status txi_gutter(txi_domain *d, txm_arena *arena, txm_env *env, size_t *filled) {
    const int gutter = d->desc->gutter == 0 ? TXI_GUTTER_WIDTH : d->desc->gutter;
    const size_t count = (size_t)d->width * (size_t)d->height;
    *filled = 0;
    if (!d->surface || gutter < 0) return TXM_OK;
    int32_t *nearest = (int32_t *)txm_arena_alloc(arena, count, sizeof(int32_t));
    uint8_t *known = (uint8_t *)txm_arena_alloc(arena, count, 1);
    if (arena->failed) return txi_no_memory(env);
    for (size_t i = 0; i < count; i++) known[i] = d->covered[i] && !d->missing[i];
    const txm_status status = txi_nearest(known, d->width, d->height, env, nearest);
    if (status != TXM_OK) return status;
    for (size_t i = 0; i < count; i++) {
        if (!d->missing[i] || d->covered[i] || nearest[i] < 0) continue;
        const int64_t dx = (int64_t)(i % (size_t)d->width) - nearest[i] % d->width;
        const int64_t dy = (int64_t)(i / (size_t)d->width) - nearest[i] / d->width;
        if (dx * dx + dy * dy > (int64_t)gutter * gutter) continue;
        txi_copy_texel(d, (size_t)nearest[i], i);
        d->missing[i] = 0;
        ++*filled;
    }
    return TXM_OK;
}

/* ---- window: parts of plain pictures --------------------------------------------------------- */

enum {
    TXI_BAND_LEAST = 48,       /* pixels around a hole; ours                                   */
    TXI_BAND_MOST = 240,
    TXI_SOURCE_LEAST = 20000,  /* pixels to copy from, if there are any; ours                  */
    TXI_SOURCE_RATIO = 4,      /* ... and times the hole                                       */
    TXI_WINDOW_MOST = 1 << 20, /* pixels of a window; larger holes take several                */
    TXI_WINDOW_GROUP = 400000, /* pixels up to which the windows of near holes are joined      */
    TXI_WINDOW_SIDE = 1000,    /* pixels: side of a window in a hole that is larger            */
    TXI_SIDE_MOST = 4000,      /* pixels: longest diagonal of a window: offsets between places in
                                  it, turned copies included, fit 13 bits (assemble.h), and their
                                  coordinates in 1/65536 pixels an int32_t (pose.h)              */
    TXI_MARGIN = 32            /* pixels: what lies nearer to a cut through a hole is left to the
                                  next window                                                  */
};

/* While a window is laid out, what is missing and has been looked at has one of these marks in
   d->missing, instead of 1. */
enum { TXI_MARK_OURS = 2, TXI_MARK_OTHER = 3 };

typedef struct txi_box {
    int left, top, right, bottom; /* pixels, the last two are one past the end */
} txi_box;

/* numbers of texels; grows */
typedef struct txi_list {
    uint32_t *items;
    size_t count, room;
} txi_list;

static int txi_push(txi_list *list, txm_arena *arena, uint32_t item) {
    if (list->count == list->room) {
        const size_t room = list->room ? 2 * list->room : 1024;
        uint32_t *items = (uint32_t *)txm_arena_alloc(arena, room, sizeof(uint32_t));
        if (!items) return 0;
        if (list->count) memcpy(items, list->items, list->count * sizeof(uint32_t));
        list->items = items;
        list->room = room;
    }
    list->items[list->count++] = item;
    return 1;
}

static size_t txi_box_area(txi_box b) {
    return (size_t)(b.right - b.left) * (size_t)(b.bottom - b.top);
}

/* May a window have these sides? */
static int txi_side_fits(double width, double height) {
    return width * width + height * height <= (double)TXI_SIDE_MOST * (double)TXI_SIDE_MOST;
}
static int txi_box_fits(txi_box b) {
    return txi_side_fits(b.right - b.left, b.bottom - b.top);
}

/* The box with a band around it, within the picture. */
static txi_box txi_box_grow(txi_box b, int band, const txi_domain *d) {
    b.left = b.left > band ? b.left - band : 0;
    b.top = b.top > band ? b.top - band : 0;
    b.right = b.right < d->width - band ? b.right + band : d->width;
    b.bottom = b.bottom < d->height - band ? b.bottom + band : d->height;
    return b;
}

static txi_box txi_box_union(txi_box a, txi_box b) {
    if (b.left < a.left) a.left = b.left;
    if (b.top < a.top) a.top = b.top;
    if (b.right > a.right) a.right = b.right;
    if (b.bottom > a.bottom) a.bottom = b.bottom;
    return a;
}

/* .9 times the diameter of a disk of this area, within limits: how much is laid out around a
   hole */
static int txi_band(size_t area) {
    return txm_clampi((int)(0.9 * 1.13 * sqrt((double)area)), TXI_BAND_LEAST, TXI_BAND_MOST);
}

/* The hole that texel `start` lies in, 8-connected: its texels are added to list and marked. box
   receives its bounding box. 0: no memory. */
static int txi_flood(txi_domain *d, uint32_t start, uint8_t mark, txi_list *list, txm_arena *arena,
                     txi_box *box) {
    const int w = d->width;
    size_t at = list->count;
    if (!txi_push(list, arena, start)) return 0;
    d->missing[start] = mark;
    box->left = box->right = (int)(start % (uint32_t)w);
    box->top = box->bottom = (int)(start / (uint32_t)w);
    for (; at < list->count; at++) {
        const int x = (int)(list->items[at] % (uint32_t)w),
                  y = (int)(list->items[at] / (uint32_t)w);
        const txi_box pixel = {x, y, x, y};
        *box = txi_box_union(*box, pixel);
        for (int k = 0; k < 9; k++) {
            const int nx = x - 1 + k % 3, ny = y - 1 + k / 3;
            const size_t i = (size_t)ny * (size_t)w + (size_t)nx;
            if (nx < 0 || ny < 0 || nx >= w || ny >= d->height || d->missing[i] != 1) continue;
            if (!txi_push(list, arena, (uint32_t)i)) return 0;
            d->missing[i] = mark;
        }
    }
    box->right++;
    box->bottom++;
    return 1;
}

/* The first texel of a hole, in the order of the picture, that has a known neighbour to its left,
   right, above or below; its very first texel if none has. */
static uint32_t txi_rim(const txi_domain *d, const txi_list *hole) {
    const int w = d->width, h = d->height;
    uint32_t first = hole->items[0], best = UINT32_MAX;
    for (size_t k = 0; k < hole->count; k++) {
        const uint32_t i = hole->items[k];
        const int x = (int)(i % (uint32_t)w), y = (int)(i / (uint32_t)w);
        if (i < first) first = i;
        if (i < best && ((x > 0 && !d->missing[i - 1]) || (x + 1 < w && !d->missing[i + 1]) ||
                         (y > 0 && !d->missing[i - (uint32_t)w]) ||
                         (y + 1 < h && !d->missing[i + (uint32_t)w])))
            best = i;
    }
    return best == UINT32_MAX ? first : best;
}

/* Add the holes in a window to ours as long as it does not become too large. box receives the
   bounding box of all. 0: no memory. */
static int txi_gather(txi_domain *d, txi_list *ours, txi_list *others, txm_arena *arena,
                      txi_box *box) {
    for (int grown = 1; grown;) {
        const txi_box window = txi_box_grow(*box, txi_band(ours->count), d);
        grown = 0;
        for (int y = window.top; y < window.bottom && !grown; y++) {
            const size_t row = (size_t)y * (size_t)d->width;
            const uint8_t *at = d->missing + row + window.left,
                          *end = d->missing + row + window.right;
            while (at < end && (at = (const uint8_t *)memchr(at, 1, (size_t)(end - at))) != NULL) {
                const uint32_t start = (uint32_t)(at - d->missing);
                const size_t before = others->count;
                txi_box hole;
                if (!txi_flood(d, start, TXI_MARK_OTHER, others, arena, &hole)) return 0;
                hole = txi_box_union(*box, hole);
                const size_t count = ours->count + others->count - before;
                const txi_box larger = txi_box_grow(hole, txi_band(count), d);
                if (txi_box_area(larger) > TXI_WINDOW_GROUP || !txi_box_fits(larger)) continue;
                for (size_t k = before; k < others->count; k++) {
                    d->missing[others->items[k]] = TXI_MARK_OURS;
                    if (!txi_push(ours, arena, others->items[k])) return 0;
                }
                others->count = before;
                *box = hole;
                grown = 1;
            }
        }
    }
    return 1;
}

/* The window around a hole: with its band, and so much more that there is enough to copy from. */
static txi_box txi_window_box(const txi_domain *d, txi_box hole, size_t area) {
    size_t wanted = area * TXI_SOURCE_RATIO;
    int band = txi_band(area);
    if (wanted < TXI_SOURCE_LEAST) wanted = TXI_SOURCE_LEAST;
    for (;;) {
        const txi_box box = txi_box_grow(hole, band, d);
        size_t usable = 0;
        for (int y = box.top; y < box.bottom; y++) {
            const uint8_t *row = d->usable + (size_t)y * (size_t)d->width;
            for (int x = box.left; x < box.right; x++) usable += row[x] == 1;
        }
        const int next = band + band / 4;
        const txi_box larger = txi_box_grow(hole, next, d);
        if (usable >= wanted || txi_box_area(larger) == txi_box_area(box)) return box;
        if (!txi_box_fits(larger)) return box;
        /* beyond the limit only if there is next to nothing */
        if (txi_box_area(larger) > TXI_WINDOW_MOST && usable >= TXI_SOURCE_LEAST / 64) return box;
        band = next;
    }
}

/* The part of the picture in the box as a window. Targets: the marked texels, but for those within
   margin of the box where it does not end with the picture. */
static txm_status txi_cut_out(const txi_domain *d, txi_box box, int margin, const txi_list *ours,
                              txm_arena *arena, txm_env *env, txi_window *w) {
    const txm_status status =
        txi_window_alloc(w, box.right - box.left, box.bottom - box.top, arena, env);
    if (status != TXM_OK) return status;
    w->spacing = 1;
    w->targets = (txi_target *)txm_arena_alloc(arena, ours->count, sizeof(txi_target));
    if (!w->targets) return txi_no_memory(env);
    for (int y = 0; y < w->height; y++) {
        for (int x = 0; x < w->width; x++) {
            const size_t i = (size_t)y * (size_t)w->width + (size_t)x;
            w->state[i] = TXI_KNOWN;
            w->texel[i] = txm_v2((float)(x + box.left), (float)(y + box.top));
            w->place[i] = txm_v3((float)(x + box.left), (float)(y + box.top), 0);
            w->normal[i] = txm_v3(0, 0, 1);
            w->axis[i] = txm_v2(1, 0);
        }
    }
    const int left = box.left > 0 ? box.left + margin : 0, top = box.top > 0 ? box.top + margin : 0;
    const int right = box.right < d->width ? box.right - margin : d->width;
    const int bottom = box.bottom < d->height ? box.bottom - margin : d->height;
    for (size_t k = 0; k < ours->count; k++) {
        const int x = (int)(ours->items[k] % (uint32_t)d->width);
        const int y = (int)(ours->items[k] / (uint32_t)d->width);
        if (x < left || x >= right || y < top || y >= bottom) continue;
        txi_target *t = &w->targets[w->target_count++];
        t->texel = ours->items[k];
        t->x = (float)(x - box.left);
        t->y = (float)(y - box.top);
        t->axis = txm_v2(1, 0);
        t->mirrored = 0;
    }
    return TXM_OK;
}

/* The next window of a plain picture: the first hole and those near it; of a hole that is too large
   for one window, a part at its rim. */
static txm_status txi_picture_window(txi_domain *d, txm_arena *arena, txm_env *env, txi_window *w,
                                     int *found) {
    const size_t count = (size_t)d->width * (size_t)d->height;
    const uint8_t *first = (const uint8_t *)memchr(d->missing, 1, count);
    txm_status status = TXM_OK;
    txm_arena scratch;
    txi_list ours, others;
    txi_box box = {0, 0, 0, 0}, window = box;
    int margin = 0;
    *found = first != NULL;
    if (!first) return TXM_OK;
    memset(&ours, 0, sizeof ours);
    memset(&others, 0, sizeof others);
    txm_arena_init(&scratch, env);
    if (!txi_flood(d, (uint32_t)(first - d->missing), TXI_MARK_OURS, &ours, &scratch, &box) ||
        !txi_gather(d, &ours, &others, &scratch, &box))
        status = txi_no_memory(env);
    if (status == TXM_OK &&
        (txi_box_area(txi_box_grow(box, TXI_BAND_LEAST, d)) > TXI_WINDOW_MOST ||
         !txi_box_fits(txi_box_grow(box, txi_band(ours.count), d)))) {
        const uint32_t rim = txi_rim(d, &ours);
        const int x = (int)(rim % (uint32_t)d->width), y = (int)(rim / (uint32_t)d->width);
        const txi_box pixel = {x, y, x + 1, y + 1};
        window = txi_box_grow(pixel, TXI_WINDOW_SIDE / 2, d);
        margin = TXI_MARGIN;
    } else if (status == TXM_OK) {
        window = txi_window_box(d, box, ours.count);
    }
    for (size_t k = 0; k < ours.count; k++) d->missing[ours.items[k]] = 1;
    for (size_t k = 0; k < others.count; k++) d->missing[others.items[k]] = 1;
    if (status == TXM_OK) status = txi_cut_out(d, window, margin, &ours, arena, env, w);
    if (status == TXM_OK) txi_window_colors(d, w);
    txm_arena_free(&scratch);
    return status;
}

/* ---- sheet: a hole and its surroundings, laid out flat --------------------------------------- */

enum {
    TXI_GAP = 24,              /* pixels: holes that are so near are laid out together; ours   */
    TXI_ROUNDS = 6,            /* ... and those near them, so many times                       */
    TXI_SPECKS = 4000,         /* texels: holes of less in all                                 */
    TXI_GROUP_MOST = 150000,   /* pixels of holes that are joined                              */
    TXI_WHOLE_MOST = 300000,   /* pixels of a hole that is tried in one window                 */
    TXI_DISK_MOST = 700000,    /* pixels of a disk                                             */
    TXI_REACH_MOST = 400,      /* pixels: radius of a window at the rim of a larger hole       */
    TXI_REACH_LEAST = 64,      /* ... the smallest that is tried                               */
    TXI_SEAM = 16,             /* pixels: what lies nearer to a cut through the hole is left to the
                                  next window                                                  */
    TXI_FLAT_SIDE = 512,       /* pixels: side of a window of a face that cannot be laid out   */
    TXI_SMALL_HOLE = 400       /* texels: however it is distorted, it is done at once          */
};

/* Faces whose scale differs from 1 by more in any direction are left to the next window. */
#define TXI_STRETCH 1.6

/* A window in the making. Per face or vertex of the surface, all of its memory is scratch. */
typedef struct txi_sheet {
    txi_domain *d;
    const txi_surface *s;
    txm_env *env;
    txm_arena *scratch;
    uint8_t *state;        /* by face: TXI_SHEET_...                                              */
    txi_list group;        /* the faces of the hole that is to be completed                       */
    size_t texels;         /* missing texels of the group                                         */
    double pixel;          /* side of a pixel, in the unit of the surface                         */
    uint32_t centre;       /* face that the disk grows from                                       */
    double *from_hole, *from_centre; /* by vertex: distances                                      */
    double *key, *size, *weight;     /* by face, for txi_growth                                   */
    txi_disk disk;
    txi_flat flat;
    double *rigid;         /* by face of the disk                                                 */
    txm_vec2 *at;          /* by vertex of the disk: where it lies in the window                  */
    uint8_t *shown;        /* by face of the disk: it is in the window                            */
    txm_vec3 *normal;      /* by vertex of the disk                                               */
    int width, height;     /* of the window                                                       */
    int slit;              /* the disk may be slit within the hole                                */
    int reach;             /* pixels around the centre that are laid out; 0: the whole hole       */
    int is_source;         /* not around a hole: only what may be copied from                     */
    txm_dvec3 origin;      /* places are relative to it                                           */
} txi_sheet;

/* what a face of the surface is found to be: known, of a hole, of the hole that is completed, of
   one that is completed along, of one that is left for later */
enum {
    TXI_SHEET_UNSEEN = 0,
    TXI_SHEET_KNOWN,
    TXI_SHEET_HOLE,
    TXI_SHEET_GROUP,
    TXI_SHEET_TAKEN,
    TXI_SHEET_REFUSED
};

/* the missing texels of a face are left[0] .. left[count - 1], among others that are not missing
   any longer */
static const uint32_t *txi_face_texels(const txi_surface *s, uint32_t face, size_t *count) {
    *count = s->hole_first[face + 1] - s->hole_first[face];
    return s->hole + s->hole_first[face];
}

/* Is something missing on a face? Small ones may own no texel: the one at their middle counts. */
static int txi_is_hole(txi_sheet *l, uint32_t face) {
    const txi_domain *d = l->d;
    size_t count;
    if (l->state[face] != TXI_SHEET_UNSEEN) return l->state[face] != TXI_SHEET_KNOWN;
    const uint32_t *texels = txi_face_texels(l->s, face, &count);
    int is_hole = 0;
    for (size_t i = 0; i < count && !is_hole; i++) is_hole = d->missing[texels[i]];
    if (!is_hole) {
        const size_t i = txi_face_texel(d, l->s, face);
        is_hole = d->missing[i] &&
                  (!d->covered[i] || l->s->chart[l->s->owner[i]] == l->s->chart[face]);
    }
    l->state[face] = (uint8_t)(is_hole ? TXI_SHEET_HOLE : TXI_SHEET_KNOWN);
    return is_hole;
}

/* Where texel i lies in a face that owns it, in texels that are not wrapped, and its weights
   there. */
static void txi_texel_weights(const txi_domain *d, uint32_t face, uint32_t texel,
                              double weight[3]) {
    const txm_vec2 *t = d->surface->uv + 3 * (size_t)face;
    const int x = (int)(texel % (uint32_t)d->width), y = (int)(texel / (uint32_t)d->width);
    double least_x = t[0].x, least_y = t[0].y, most_x = t[0].x, most_y = t[0].y, best = -1e300;
    weight[0] = weight[1] = weight[2] = 1.0 / 3;
    for (int k = 1; k < 3; k++) {
        least_x = fmin(least_x, t[k].x);
        least_y = fmin(least_y, t[k].y);
        most_x = fmax(most_x, t[k].x);
        most_y = fmax(most_y, t[k].y);
    }
    const int from_x = (int)ceil((least_x - x - 0.5) / d->width);
    const int from_y = (int)ceil((least_y - y - 0.5) / d->height);
    const int to_x = (int)floor((most_x - x + 0.5) / d->width);
    const int to_y = (int)floor((most_y - y + 0.5) / d->height);
    for (int j = from_y; j <= to_y && best < -1e-5; j++) {
        for (int i = from_x; i <= to_x && best < -1e-5; i++) {
            double w[3];
            if (!txi_weights(t, x + (double)i * d->width, y + (double)j * d->height, w)) return;
            const double least = fmin(w[0], fmin(w[1], w[2]));
            if (least <= best) continue;
            best = least;
            memcpy(weight, w, sizeof w);
        }
    }
}

/* where the texel lies on the surface */
static txm_dvec3 txi_texel_point(const txi_domain *d, uint32_t face, uint32_t texel) {
    double w[3];
    txm_dvec3 p = txm_d3(0, 0, 0);
    txi_texel_weights(d, face, texel, w);
    for (uint32_t k = 0; k < 3; k++)
        p = txm_d3_mad(p, txi_corner_point(d->surface, 3 * face + k), w[k]);
    return p;
}

static size_t txi_missing_count(const txi_domain *d, uint32_t face) {
    size_t count, missing = 0;
    const uint32_t *texels = txi_face_texels(d->surface, face, &count);
    for (size_t i = 0; i < count; i++) missing += d->missing[texels[i]] != 0;
    return missing;
}

/* ---- sheet: the hole ------------------------------------------------------------------------ */

/* Add to list the hole that a face belongs to, connected across sides; its faces get this state.
   Faces outside the disk, if there is one, end it: 0. -1: no memory. */
static int txi_flood_faces(txi_sheet *l, uint32_t face, uint8_t state, const txi_disk *disk,
                           txi_list *list) {
    size_t at = list->count;
    int inside = 1;
    if (!txi_push(list, l->scratch, face)) return -1;
    l->state[face] = state;
    for (; at < list->count; at++) {
        const uint32_t f = list->items[at];
        if (disk && disk->slot[f] == TXI_NO_FACE) inside = 0;
        for (uint32_t k = 0; k < 3 && inside; k++) {
            const uint32_t o = l->s->opposite[3 * f + k];
            if (o == TXM_NO_SIDE || !txi_is_hole(l, o / 3) || l->state[o / 3] != TXI_SHEET_HOLE)
                continue;
            if (!txi_push(list, l->scratch, o / 3)) return -1;
            l->state[o / 3] = state;
        }
    }
    return inside;
}

/* The side of a pixel: that of a texel in the hole, in the mean. 0 if it has no area. */
static void txi_measure(txi_sheet *l) {
    double area = 0;
    l->texels = 0;
    for (size_t i = 0; i < l->group.count; i++) {
        const uint32_t f = l->group.items[i];
        const size_t missing = txi_missing_count(l->d, f);
        const txm_vec2 *t = l->s->uv + 3 * (size_t)f;
        if (!missing) continue;
        area += (double)missing * txm_d3_len(txi_face_area2(l->s, f)) /
                fabs(txi_cross2(t[0], t[1], t[2]));
        l->texels += missing;
    }
    l->pixel = l->texels ? sqrt(area / (double)l->texels) : 0;
}

/* Distances of the vertices from the missing texels of the group. */
static txm_status txi_measure_from_hole(txi_sheet *l, double limit) {
    const size_t count = 3 * l->group.count;
    for (size_t v = 0; v < l->s->vertex_count; v++) l->from_hole[v] = TXI_UNREACHED;
    if (!count) return TXM_OK;
    uint32_t *sources = (uint32_t *)txm_arena_alloc(l->scratch, count, sizeof(uint32_t));
    double *start = (double *)txm_arena_alloc(l->scratch, count, sizeof(double));
    if (!sources || !start) return txi_no_memory(l->env);
    for (size_t i = 0; i < l->group.count; i++) {
        const uint32_t f = l->group.items[i];
        size_t texels;
        const uint32_t *texel = txi_face_texels(l->s, f, &texels);
        double *least = start + 3 * i;
        least[0] = least[1] = least[2] = TXI_UNREACHED;
        for (size_t k = 0; k < texels; k++) {
            if (!l->d->missing[texel[k]]) continue;
            const txm_dvec3 p = txi_texel_point(l->d, f, texel[k]);
            for (uint32_t c = 0; c < 3; c++)
                least[c] = fmin(least[c], txm_d3_dist(p, txi_corner_point(l->s, 3 * f + c)));
        }
        for (uint32_t c = 0; c < 3; c++) {
            sources[3 * i + c] = l->s->vertex[3 * f + c];
            if (least[c] >= TXI_UNREACHED) least[c] = 0; /* a face without texels */
        }
    }
    return txi_geodesic(l->s, sources, start, count, limit, l->env, l->from_hole);
}

/* The first hole, and those within TXI_GAP of it or of one another. */
static txm_status txi_find_group(txi_sheet *l, uint32_t seed) {
    txm_status status = TXM_OK;
    txi_is_hole(l, seed);
    if (txi_flood_faces(l, seed, TXI_SHEET_GROUP, NULL, &l->group) < 0)
        return txi_no_memory(l->env);
    txi_measure(l);
    for (int round = 0, grown = 1; round < TXI_ROUNDS && grown && l->pixel > 0; round++) {
        /* small groups are joined with holes that are twice as far away */
        const int gap = l->texels < TXI_SPECKS ? 2 * TXI_GAP : TXI_GAP;
        grown = 0;
        status = txi_measure_from_hole(l, gap * l->pixel);
        for (uint32_t v = 0; v < l->s->vertex_count && status == TXM_OK; v++) {
            if (l->from_hole[v] >= TXI_UNREACHED) continue;
            for (uint32_t i = l->s->first[v]; i < l->s->first[v + 1]; i++) {
                const uint32_t f = l->s->corners[i] / 3;
                const size_t before = l->group.count;
                if (!txi_is_hole(l, f) || l->state[f] != TXI_SHEET_HOLE) continue;
                if (txi_flood_faces(l, f, TXI_SHEET_GROUP, NULL, &l->group) < 0)
                    return txi_no_memory(l->env);
                size_t more = l->texels;
                for (size_t k = before; k < l->group.count; k++)
                    more += txi_missing_count(l->d, l->group.items[k]);
                if (more > TXI_GROUP_MOST) { /* too large: left to a later window */
                    for (size_t k = before; k < l->group.count; k++)
                        l->state[l->group.items[k]] = TXI_SHEET_REFUSED;
                    l->group.count = before;
                    continue;
                }
                l->texels = more;
                grown = 1;
            }
        }
        if (status != TXM_OK) return status;
        txi_measure(l);
    }
    return TXM_OK;
}

/* The face that the disk grows from: in the middle of the hole, or, if only a part of it is laid
   out, at its rim. */
static void txi_find_centre(txi_sheet *l) {
    txm_dvec3 middle = txm_d3(0, 0, 0);
    double count = 0, least = 0;
    int found = 0;
    for (size_t i = 0; i < l->group.count; i++) {
        const uint32_t f = l->group.items[i];
        const double n = (double)txi_missing_count(l->d, f);
        for (uint32_t k = 0; k < 3; k++)
            middle = txm_d3_mad(middle, txi_corner_point(l->s, 3 * f + k), n / 3);
        count += n;
    }
    middle = txm_d3_scale(middle, 1 / count);
    for (size_t i = 0; i < l->group.count; i++) {
        const uint32_t f = l->group.items[i];
        txm_dvec3 p = txm_d3(0, 0, 0);
        int is_rim = 0;
        if (!txi_missing_count(l->d, f)) continue;
        for (uint32_t k = 0; k < 3; k++) {
            const uint32_t o = l->s->opposite[3 * f + k];
            p = txm_d3_mad(p, txi_corner_point(l->s, 3 * f + k), 1.0 / 3);
            is_rim |= o != TXM_NO_SIDE && !txi_is_hole(l, o / 3);
        }
        const double apart = l->reach ? (is_rim ? 0 : 1) : txm_d3_dist2(p, middle);
        if (found && apart >= least) continue;
        found = 1;
        least = apart;
        l->centre = f;
    }
}

/* ---- sheet: the disk ------------------------------------------------------------------------ */

/* Is the middle of a face texture that may be copied? */
static int txi_is_usable_face(const txi_domain *d, uint32_t face) {
    return d->usable[txi_face_texel(d, d->surface, face)];
}

static double txi_mean_of(const txi_surface *s, uint32_t face, const double *value) {
    const uint32_t *v = s->vertex + 3 * (size_t)face;
    return (value[v[0]] + value[v[1]] + value[v[2]]) / 3;
}
static double txi_least_of(const txi_surface *s, uint32_t face, const double *value) {
    const uint32_t *v = s->vertex + 3 * (size_t)face;
    return fmin(value[v[0]], fmin(value[v[1]], value[v[2]]));
}

/* Grow the disk: the hole from its centre, then what is known around it; or everything around
   the centre up to l->reach. */
static txm_status txi_sheet_disk(txi_sheet *l) {
    const txi_surface *s = l->s;
    const double pixel = l->pixel, band = txi_band(l->texels) * pixel;
    txi_growth g;
    double start[3], extent = 0;
    const txm_dvec3 a = txi_corner_point(s, 3 * l->centre);
    const txm_dvec3 b = txi_corner_point(s, 3 * l->centre + 1),
                    c = txi_corner_point(s, 3 * l->centre + 2);
    const txm_dvec3 middle = txm_d3_scale(txm_d3_add(txm_d3_add(a, b), c), 1.0 / 3);
    start[0] = txm_d3_dist(a, middle);
    start[1] = txm_d3_dist(b, middle);
    start[2] = txm_d3_dist(c, middle);
    for (size_t i = 0; i < 3 * l->group.count; i++) {
        const uint32_t corner = 3 * l->group.items[i / 3] + (uint32_t)(i % 3);
        extent = fmax(extent, txm_d3_dist(middle, txi_corner_point(s, corner)));
    }
    const double limit = l->reach ? 1.5 * l->reach * pixel : 2 * extent + pixel;
    txm_status status = txi_geodesic(s, s->vertex + 3 * (size_t)l->centre, start, 3, limit, l->env,
                                     l->from_centre);
    if (status == TXM_OK) status = txi_measure_from_hole(l, 4 * band);
    if (status != TXM_OK) return status;
    for (size_t v = 0; v < s->vertex_count; v++) {
        if (l->from_centre[v] >= TXI_UNREACHED)
            l->from_centre[v] = limit + txm_d3_dist(s->point[v], middle);
        l->from_hole[v] = fmin(l->from_hole[v], 4 * band);
    }
    const double outside = 4 * (limit + extent); /* above all keys of the hole's faces */
    for (uint32_t f = 0; f < s->face_count; f++) {
        const int is_group = l->state[f] == TXI_SHEET_GROUP;
        l->weight[f] = txm_d3_len(txi_face_area2(s, f)) / (2 * pixel * pixel);
        l->size[f] = !is_group && txi_is_usable_face(l->d, f) ? l->weight[f] : 0;
        if (l->is_source && !txi_is_usable_face(l->d, f)) {
            l->key[f] = TXI_UNREACHED;
            continue;
        }
        l->key[f] = l->reach || is_group ? txi_mean_of(s, f, l->from_centre)
                                         : outside + txi_least_of(s, f, l->from_hole);
    }
    const double wanted = 1.5 * (double)l->texels;
    g.key = l->key;
    g.size = l->size;
    g.weight = l->weight;
    g.most = TXI_DISK_MOST;
    g.stop_least = l->reach ? l->reach * pixel : outside + band;
    g.stop = l->reach ? l->reach * pixel : outside + 3 * band;
    g.wanted = l->reach ? 1e300 : wanted > 8000 ? wanted : 8000;
    l->disk.depth = l->slit ? l->from_centre : l->from_hole;
    l->disk.slit_from = (double)(l->slit ? TXI_GAP : TXI_SEAM) * pixel;
    return txi_disk_grow(&l->disk, s, l->centre, &g, l->env);
}

/* Lay the disk out. The hole is kept rigid, what is known gives way the more the farther it is. */
static txm_status txi_sheet_flat(txi_sheet *l) {
    const size_t faces = l->disk.face_count;
    uint32_t *number =
        (uint32_t *)txm_arena_alloc(l->scratch, l->disk.vertex_count, sizeof(uint32_t));
    txm_dvec3 *point =
        (txm_dvec3 *)txm_arena_alloc(l->scratch, l->disk.vertex_count, sizeof(txm_dvec3));
    l->rigid = (double *)txm_arena_alloc(l->scratch, faces, sizeof(double));
    if (!number || !point || !l->rigid) return txi_no_memory(l->env);
    txi_disk_finish(&l->disk, l->s, number, point);
    for (size_t i = 0; i < faces; i++) {
        const uint32_t f = l->disk.faces[i];
        const double apart = txi_mean_of(l->s, f, l->from_hole) / (40 * l->pixel);
        l->rigid[i] = 1;
        if (!l->reach && l->state[f] != TXI_SHEET_GROUP)
            l->rigid[i] = 0.02 + 0.98 * txm_exp2(-fmin(apart * apart, 100) * TXI_LOG2_E);
    }
    txm_status status = txi_flat_init(&l->flat, l->s, &l->disk, point, l->scratch, l->env);
    if (status == TXM_OK) status = txi_flatten(&l->flat, l->rigid, 0.02 * l->pixel, l->env);
    return status;
}

/* The step in the window, y downwards, for a step of one texel to the right and one down, on
   face i of the disk. 0: the face has no area in the atlas. */
static int txi_texel_steps(const txi_sheet *l, size_t i, double right[2], double down[2]) {
    const txm_vec2 *t = l->s->uv + 3 * (size_t)l->disk.faces[i];
    const uint32_t *c = l->disk.corner + 3 * i;
    const double area = txi_cross2(t[0], t[1], t[2]);
    if (!(fabs(area) > 1e-12)) return 0;
    const double u1 = (double)t[1].x - t[0].x, v1 = (double)t[1].y - t[0].y;
    const double u2 = (double)t[2].x - t[0].x, v2 = (double)t[2].y - t[0].y;
    for (int axis = 0; axis < 2; axis++) {
        const double p0 = axis ? l->at[c[0]].y : l->at[c[0]].x;
        const double p1 = (axis ? l->at[c[1]].y : l->at[c[1]].x) - p0;
        const double p2 = (axis ? l->at[c[2]].y : l->at[c[2]].x) - p0;
        right[axis] = (p1 * v2 - p2 * v1) / area;
        down[axis] = (p2 * u1 - p1 * u2) / area;
    }
    return 1;
}

/* The chart that has most of the missing texels. */
static uint32_t txi_main_chart(const txi_sheet *l, uint32_t *counts) {
    uint32_t best = l->s->chart[l->centre];
    memset(counts, 0, l->s->face_count * sizeof *counts);
    for (size_t i = 0; i < l->group.count; i++)
        counts[l->s->chart[l->group.items[i]]] +=
            (uint32_t)txi_missing_count(l->d, l->group.items[i]);
    for (uint32_t c = 0; c < l->s->face_count; c++) {
        if (counts[c] > counts[best]) best = c;
    }
    return best;
}

/* A box of places in the window. */
typedef struct txi_bounds {
    double left, top, right, bottom;
} txi_bounds;

static void txi_bounds_add(txi_bounds *b, double x, double y) {
    b->left = fmin(b->left, x);
    b->top = fmin(b->top, y);
    b->right = fmax(b->right, x);
    b->bottom = fmax(b->bottom, y);
}

/* Where a texel lies in the window, on face i of the disk. */
static void txi_sheet_texel(const txi_sheet *l, size_t i, uint32_t texel, double *x, double *y) {
    double w[3];
    *x = *y = 0;
    txi_texel_weights(l->d, l->disk.faces[i], texel, w);
    for (size_t k = 0; k < 3; k++) {
        *x += w[k] * l->at[l->disk.corner[3 * i + k]].x;
        *y += w[k] * l->at[l->disk.corner[3 * i + k]].y;
    }
}

/* What the window should show: the disk, but not more than three bands around the missing
   texels, as faces may be much larger than the hole. */
static txi_bounds txi_sheet_bounds(const txi_sheet *l) {
    txi_bounds all = {1e300, 1e300, -1e300, -1e300}, hole = all;
    const double wide = 3 * txi_band(l->texels);
    for (size_t i = 0; i < l->disk.face_count; i++) {
        size_t count;
        const uint32_t *texels = txi_face_texels(l->s, l->disk.faces[i], &count);
        for (size_t k = 0; k < 3; k++) {
            const txm_vec2 p = l->at[l->disk.corner[3 * i + k]];
            txi_bounds_add(&all, p.x, p.y);
        }
        if (l->state[l->disk.faces[i]] != TXI_SHEET_GROUP) continue;
        for (size_t k = 0; k < count; k++) {
            double x, y;
            if (!l->d->missing[texels[k]]) continue;
            txi_sheet_texel(l, i, texels[k], &x, &y);
            txi_bounds_add(&hole, x, y);
        }
    }
    if (hole.left > hole.right) return all;
    all.left = fmax(all.left, hole.left - wide);
    all.top = fmax(all.top, hole.top - wide);
    all.right = fmin(all.right, hole.right + wide);
    all.bottom = fmin(all.bottom, hole.bottom + wide);
    return all;
}

/* Place the disk in the window: pixels as large as texels of the hole, turned and moved so that
   on the main chart texels and pixels coincide as well as they can, so that little is lost by
   interpolation. 0: it is not finite, or too large for a window. */
static int txi_sheet_place(txi_sheet *l, uint32_t *counts) {
    const txi_disk *disk = &l->disk;
    const uint32_t chart = txi_main_chart(l, counts);
    double c = 0, s = 0, off[2] = {0, 0};
    int64_t reference = -1;
    for (size_t v = 0; v < disk->vertex_count; v++) {
        const double x = l->flat.xy[2 * v] / l->pixel, y = -l->flat.xy[2 * v + 1] / l->pixel;
        if (!(fabs(x) < 1e6 && fabs(y) < 1e6)) return 0;
        l->at[v] = txm_v2(txm_float(x), txm_float(y));
    }
    for (size_t i = 0; i < disk->face_count; i++) {
        double u[2], v[2];
        const double n = l->is_source ? l->weight[disk->faces[i]]
                                      : (double)txi_missing_count(l->d, disk->faces[i]);
        if (l->s->chart[disk->faces[i]] != chart || !(n > 0) || !txi_texel_steps(l, i, u, v))
            continue;
        c += n * u[0];
        s += n * u[1];
        if (reference < 0 && !l->is_source) reference = (int64_t)i;
    }
    const double length = sqrt(c * c + s * s);
    c = length > 0 ? c / length : 1;
    s = length > 0 ? s / length : 0;
    for (size_t v = 0; v < disk->vertex_count; v++) {
        const double x = c * l->at[v].x + s * l->at[v].y, y = c * l->at[v].y - s * l->at[v].x;
        l->at[v] = txm_v2(txm_float(x), txm_float(y));
    }
    const txi_bounds box = txi_sheet_bounds(l);
    if (!txi_side_fits(box.right - box.left + 4, box.bottom - box.top + 4) ||
        (box.right - box.left + 4) * (box.bottom - box.top + 4) > (double)TXI_WINDOW_MOST)
        return 0;
    if (reference >= 0) { /* a missing texel of it comes to lie on a pixel */
        size_t count, k = 0;
        const uint32_t *texels = txi_face_texels(l->s, disk->faces[reference], &count);
        while (k + 1 < count && !l->d->missing[texels[k]]) k++;
        txi_sheet_texel(l, (size_t)reference, texels[k], &off[0], &off[1]);
    }
    off[0] += floor(box.left - off[0]) - 1;
    off[1] += floor(box.top - off[1]) - 1;
    for (size_t v = 0; v < disk->vertex_count; v++)
        l->at[v] = txm_v2(txm_float(l->at[v].x - off[0]), txm_float(l->at[v].y - off[1]));
    l->width = (int)(box.right - off[0]) + 3;
    l->height = (int)(box.bottom - off[1]) + 3;
    return 1;
}

/* ---- layout: pixels -------------------------------------------------------------------------- */

static void txi_sheet_normals(txi_sheet *l) {
    const txi_disk *disk = &l->disk;
    const double unit = 1 / (l->pixel * l->pixel);
    for (size_t v = 0; v < disk->vertex_count; v++) l->normal[v] = txm_v3(0, 0, 0);
    for (size_t i = 0; i < 3 * disk->face_count; i++) {
        const txm_dvec3 n = txm_d3_scale(txi_face_area2(l->s, disk->faces[i / 3]), unit);
        const txm_vec3 add = txm_v3(txm_float(n.x), txm_float(n.y), txm_float(n.z));
        l->normal[disk->corner[i]] = txm_vec3_add(l->normal[disk->corner[i]], add);
    }
    for (size_t v = 0; v < disk->vertex_count; v++) l->normal[v] = txm_vec3_normalize(l->normal[v]);
}

/* Fill a pixel that lies on face i of the disk. */
static void txi_sheet_pixel(const txi_sheet *l, txi_window *w, size_t pixel, size_t i,
                            const double weight[3], const double right[2], int mirrored) {
    const uint32_t face = l->disk.faces[i], *c = l->disk.corner + 3 * i;
    const txm_vec2 *t = l->s->uv + 3 * (size_t)face;
    double x = 0, y = 0;
    txm_dvec3 p = txm_d3(0, 0, 0);
    txm_vec3 n = txm_v3(0, 0, 0);
    for (int k = 0; k < 3; k++) {
        x += weight[k] * t[k].x;
        y += weight[k] * t[k].y;
        p = txm_d3_mad(p, txm_d3_sub(l->flat.point[c[k]], l->origin), weight[k] / l->pixel);
        n = txm_vec3_add(n, txm_vec3_scale(l->normal[c[k]], txm_float(weight[k])));
    }
    w->state[pixel] = TXI_KNOWN;
    w->face[pixel] = face;
    w->texel[pixel] = txm_v2(txm_float(x), txm_float(y));
    w->place[pixel] = txm_v3(txm_float(p.x), txm_float(p.y), txm_float(p.z));
    w->normal[pixel] = txm_vec3_normalize(n);
    w->axis[pixel] = txi_unit(right[0], right[1]);
    w->mirrored[pixel] = (uint8_t)mirrored;
}

/* Is face i of the disk the right way round in the window, where y runs downwards? */
static int txi_lies_right(const txi_sheet *l, size_t i) {
    const uint32_t *c = l->disk.corner + 3 * i;
    return txi_cross2(l->at[c[0]], l->at[c[1]], l->at[c[2]]) < -1e-9;
}

/* Is face i of the disk laid out with little distortion: its singular values between 1 /
   TXI_STRETCH and TXI_STRETCH? Those of the matrix (a b; c d) are Q + R and |Q - R|, with

       Q = |(a + d, c - b)| / 2,   R = |(a - d, c + b)| / 2.                                   */
static int txi_is_true(const txi_sheet *l, size_t i) {
    const double *shape = l->flat.shape + 3 * i;
    const uint32_t *v = l->disk.corner + 3 * i;
    const double *p = l->flat.xy + 2 * (size_t)v[0], *q = l->flat.xy + 2 * (size_t)v[1];
    const double *r = l->flat.xy + 2 * (size_t)v[2];
    if (!txi_lies_right(l, i)) return 0;
    if (!(shape[0] > 0 && shape[2] > 0)) return 1;
    const double a = (q[0] - p[0]) / shape[0], c = (q[1] - p[1]) / shape[0];
    const double b = (r[0] - p[0] - a * shape[1]) / shape[2],
                 d = (r[1] - p[1] - c * shape[1]) / shape[2];
    const double m = sqrt((a + d) * (a + d) + (c - b) * (c - b)) / 2;
    const double n = sqrt((a - d) * (a - d) + (c + b) * (c + b)) / 2;
    return m + n < TXI_STRETCH && fabs(m - n) > 1 / TXI_STRETCH;
}

/* Go through the pixels whose centres face i of the disk covers. With fill they are filled
   unless another face has been there first, the one nearer to the hole. Returns how many others
   cover within it. */
static size_t txi_sheet_face(const txi_sheet *l, txi_window *w, size_t i, int fill) {
    txm_vec2 t[3];
    double right[2] = {1, 0}, down[2] = {0, 1}, weight[3];
    size_t taken = 0;
    for (size_t k = 0; k < 3; k++) t[k] = l->at[l->disk.corner[3 * i + k]];
    txi_texel_steps(l, i, right, down);
    const int mirrored = right[0] * down[1] - right[1] * down[0] < 0;
    const float top = txm_minf(t[0].y, txm_minf(t[1].y, t[2].y));
    const float bottom = txm_maxf(t[0].y, txm_maxf(t[1].y, t[2].y));
    const float from = txm_minf(t[0].x, txm_minf(t[1].x, t[2].x));
    const float to = txm_maxf(t[0].x, txm_maxf(t[1].x, t[2].x));
    const int x0 = txm_clampi((int)ceil((double)from - 1e-4), 0, w->width - 1);
    const int x1 = txm_clampi((int)floor((double)to + 1e-4), 0, w->width - 1);
    const int y0 = txm_clampi((int)ceil((double)top - 1e-4), 0, w->height - 1);
    const int y1 = txm_clampi((int)floor((double)bottom + 1e-4), 0, w->height - 1);
    for (int y = y0; y <= y1; y++) {
        for (int x = x0; x <= x1; x++) {
            const size_t pixel = (size_t)y * (size_t)w->width + (size_t)x;
            if (!txi_weights(t, x, y, weight)) continue;
            const double least = fmin(weight[0], fmin(weight[1], weight[2]));
            if (least < -1e-6) continue;
            if (w->face[pixel] != TXI_NO_FACE) taken += least > 1e-3;
            else if (fill) txi_sheet_pixel(l, w, pixel, i, weight, right, mirrored);
        }
    }
    return taken;
}

/* Fill the pixels that the disk covers. Left out is what is known but lies badly: faces that are
   much distorted or lie over others, and those that were added behind them.
   shown  receives 1 per face of the disk                                                      */
static void txi_sheet_pixels(const txi_sheet *l, txi_window *w, uint8_t *shown) {
    w->spacing = l->pixel;
    w->origin = l->origin;
    for (size_t i = 0; i < l->disk.face_count; i++) {
        shown[i] = (uint8_t)txi_lies_right(l, i);
        if (shown[i] && l->state[l->disk.faces[i]] != TXI_SHEET_GROUP)
            shown[i] = txi_is_true(l, i) && (i == 0 || shown[l->disk.grown_from[i]]) &&
                       txi_sheet_face(l, w, i, 0) == 0;
        if (shown[i]) txi_sheet_face(l, w, i, 1);
    }
}

/* ---- layout: targets ------------------------------------------------------------------------- */

/* Mark the pixels along the border of the disk where the surface goes on: all of it, or only
   where it goes through the hole. Returns how many sides that were. */
static size_t txi_mark_cuts(txi_sheet *l, const txi_window *w, int only_holes, uint8_t *marks) {
    uint32_t side = l->disk.border;
    size_t count = 0;
    for (size_t k = 0; k < l->disk.loop; k++, side = l->disk.next[side]) {
        const uint32_t here = txi_surface_side(&l->disk, side), beyond = l->s->opposite[here];
        if (beyond == TXM_NO_SIDE) continue;
        if (only_holes && (!txi_is_hole(l, here / 3) || !txi_is_hole(l, beyond / 3))) continue;
        const txm_vec2 a = l->at[l->disk.corner[side]],
                       b = l->at[l->disk.corner[txi_next_corner(side)]];
        const double dx = (double)b.x - a.x, dy = (double)b.y - a.y;
        const int steps = (int)(2 * sqrt(dx * dx + dy * dy)) + 1;
        for (int i = 0; i <= steps; i++) {
            const int x = txm_clampi((int)(a.x + dx * i / steps + 0.5), 0, w->width - 1);
            const int y = txm_clampi((int)(a.y + dy * i / steps + 0.5), 0, w->height - 1);
            marks[(size_t)y * (size_t)w->width + (size_t)x] = 1;
        }
        count++;
    }
    return count;
}

/* The distance of a place in the window from the nearest mark. */
static double txi_from_marks(const txi_window *w, const int32_t *nearest, double x, double y) {
    const int px = txm_clampi((int)(x + 0.5), 0, w->width - 1);
    const int py = txm_clampi((int)(y + 0.5), 0, w->height - 1);
    const int32_t at = nearest[(size_t)py * (size_t)w->width + (size_t)px];
    const int column = at % w->width, row = at / w->width;
    const double dx = column - x, dy = row - y;
    return at < 0 ? 1e30 : sqrt(dx * dx + dy * dy);
}

/* The target for a texel on face i of the disk. */
static txi_target txi_make_target(const txi_sheet *l, size_t i, uint32_t texel) {
    txi_target t;
    double right[2] = {1, 0}, down[2] = {0, 1}, x, y;
    txi_sheet_texel(l, i, texel, &x, &y);
    txi_texel_steps(l, i, right, down);
    t.texel = texel;
    t.x = txm_float(x);
    t.y = txm_float(y);
    t.axis = txi_unit(right[0], right[1]);
    t.mirrored = right[0] * down[1] - right[1] * down[0] < 0;
    return t;
}

/* Does the window show the target where it is, and not another part of the disk that lies over
   it? */
static int txi_is_shown(const txi_sheet *l, const txi_window *w, size_t i, const txi_target *t) {
    const int x = txm_clampi((int)((double)t->x + 0.5), 0, w->width - 1);
    const int y = txm_clampi((int)((double)t->y + 0.5), 0, w->height - 1);
    const size_t pixel = (size_t)y * (size_t)w->width + (size_t)x;
    if (!l->shown[i] || t->x < 0 || t->y < 0 || t->x > (float)(w->width - 1) ||
        t->y > (float)(w->height - 1))
        return 0;
    if (w->face[pixel] == TXI_NO_FACE || w->face[pixel] == l->disk.faces[i]) return 1;
    const txm_dvec3 p = txm_d3_scale(txm_d3_sub(txi_texel_point(l->d, l->disk.faces[i], t->texel),
                                                l->origin), 1 / l->pixel);
    const txm_vec3 q = w->place[pixel];
    return txm_d3_dist(p, txm_d3(q.x, q.y, q.z)) < 4;
}

/* Collect the targets of the hole: those that lie well away from cuts through it, are hardly
   distorted and not covered; all if that is none. Returns 0 if that is too few and a smaller
   part of the hole should be tried. marks, nearest: scratch, 1 per pixel. */
static int txi_sheet_targets(txi_sheet *l, txi_window *w, uint8_t *marks, int32_t *nearest,
                           txm_status *status) {
    const size_t pixels = (size_t)w->width * (size_t)w->height;
    size_t total = 0, good = 0, bent = 0;
    double deepest = 0;
    memset(marks, 0, pixels);
    const size_t cuts = txi_mark_cuts(l, w, 1, marks);
    if (cuts) *status = txi_nearest(marks, w->width, w->height, l->env, nearest);
    if (*status != TXM_OK) return 1;
    for (size_t i = 0; i < l->disk.face_count; i++) {
        const uint32_t f = l->disk.faces[i];
        size_t count;
        const uint32_t *texels = txi_face_texels(l->s, f, &count);
        if (l->state[f] != TXI_SHEET_GROUP) continue;
        for (size_t k = 0; k < count; k++) {
            if (!l->d->missing[texels[k]]) continue;
            const txi_target t = txi_make_target(l, i, texels[k]);
            w->targets[total++] = t;
            if (cuts) deepest = fmax(deepest, txi_from_marks(w, nearest, t.x, t.y));
        }
    }
    const int margin = l->reach ? (int)TXI_MARGIN : (int)TXI_SEAM;
    const double seam = cuts ? fmin(margin, 0.4 * deepest) : 0;
    size_t at = 0;
    for (size_t i = 0; i < l->disk.face_count; i++) {
        const uint32_t f = l->disk.faces[i];
        if (l->state[f] != TXI_SHEET_GROUP) continue;
        const int is_true = txi_is_true(l, i);
        for (size_t n = txi_missing_count(l->d, f); n > 0; n--) {
            const txi_target t = w->targets[at++];
            const int is_away = !cuts || txi_from_marks(w, nearest, t.x, t.y) >= seam;
            const int is_fine = is_true && txi_is_shown(l, w, i, &t);
            bent += is_away && !is_fine;
            /* the refused ones are swapped behind the others */
            if (!is_away || !is_fine) continue;
            w->targets[at - 1] = w->targets[good];
            w->targets[good++] = t;
        }
    }
    w->target_count = good;
    if (!cuts && (total <= TXI_SMALL_HOLE || 10 * bent <= total)) w->target_count = total;
    if (5 * w->target_count >= 2 * total) return 1;
    if (l->reach != TXI_REACH_LEAST && total > TXI_SMALL_HOLE) return 0;
    if (2 * good < total) w->target_count = total;
    return 1;
}

/* Other holes that lie wholly in the disk, well away from its border, are completed along. */
static txm_status txi_sheet_others(txi_sheet *l, txi_window *w, uint8_t *marks, int32_t *nearest,
                                 size_t room) {
    txi_list hole;
    int ready = 0;
    txm_status status = TXM_OK;
    memset(&hole, 0, sizeof hole);
    for (size_t i = 0; i < l->disk.face_count && status == TXM_OK; i++) {
        const uint32_t f = l->disk.faces[i];
        const size_t before = w->target_count;
        if (!txi_is_hole(l, f) || l->state[f] != TXI_SHEET_HOLE) continue;
        if (!ready) {
            memset(marks, 0, (size_t)w->width * (size_t)w->height);
            txi_mark_cuts(l, w, 0, marks);
            status = txi_nearest(marks, w->width, w->height, l->env, nearest);
            if (status != TXM_OK) return status;
            ready = 1;
        }
        hole.count = 0;
        int good = txi_flood_faces(l, f, TXI_SHEET_TAKEN, &l->disk, &hole);
        if (good < 0) return txi_no_memory(l->env);
        for (size_t k = 0; k < hole.count && good; k++) {
            const uint32_t slot = l->disk.slot[hole.items[k]];
            size_t count;
            const uint32_t *texels = txi_face_texels(l->s, hole.items[k], &count);
            good = txi_is_true(l, slot);
            for (size_t n = 0; n < count && good; n++) {
                if (!l->d->missing[texels[n]]) continue;
                const txi_target t = txi_make_target(l, slot, texels[n]);
                good = w->target_count < room && txi_is_shown(l, w, slot, &t) &&
                       txi_from_marks(w, nearest, t.x, t.y) >= (double)TXI_GAP;
                if (good) w->targets[w->target_count++] = t;
            }
        }
        if (!good) w->target_count = before;
    }
    return status;
}

/* ---- layout: one window ---------------------------------------------------------------------- */

/* The window of a face that cannot be laid out, as neither it nor what is around it has an area:
   its part of the atlas. */
static txm_status txi_sheet_alone(txi_sheet *l, txm_arena *arena, txi_window *w) {
    const txm_vec2 *t = l->s->uv + 3 * (size_t)l->centre;
    size_t count, k = 0;
    double weight[3], x = 0, y = 0;
    const uint32_t *texels = txi_face_texels(l->s, l->centre, &count);
    while (k + 1 < count && !l->d->missing[texels[k]]) k++;
    txi_texel_weights(l->d, l->centre, texels[k], weight);
    for (int i = 0; i < 3; i++) {
        x += weight[i] * t[i].x;
        y += weight[i] * t[i].y;
    }
    /* the window's pixels are texels, the first of the missing ones lies within */
    const double half = 0.5 * (double)TXI_FLAT_SIDE;
    txi_bounds box = {x - half, y - half, x + half, y + half};
    box.left = fmax(box.left, (double)txm_minf(t[0].x, txm_minf(t[1].x, t[2].x)) - 1);
    box.top = fmax(box.top, (double)txm_minf(t[0].y, txm_minf(t[1].y, t[2].y)) - 1);
    box.right = fmin(box.right, (double)txm_maxf(t[0].x, txm_maxf(t[1].x, t[2].x)) + 1);
    box.bottom = fmin(box.bottom, (double)txm_maxf(t[0].y, txm_maxf(t[1].y, t[2].y)) + 1);
    const int left = (int)floor(box.left), top = (int)floor(box.top);
    const int width = (int)ceil(box.right) - left + 1, height = (int)ceil(box.bottom) - top + 1;
    txm_status status = txi_window_alloc(w, width, height, arena, l->env);
    if (status == TXM_OK)
        w->targets = (txi_target *)txm_arena_alloc(arena, count, sizeof(txi_target));
    if (!w->targets) return txi_no_memory(l->env);
    for (size_t i = 0; i < (size_t)width * (size_t)height; i++) {
        const int px = left + (int)(i % (size_t)width), py = top + (int)(i / (size_t)width);
        if (!txi_weights(t, px, py, weight)) continue;
        if (weight[0] < -1e-6 || weight[1] < -1e-6 || weight[2] < -1e-6) continue;
        w->state[i] = TXI_KNOWN;
        w->face[i] = l->centre;
        w->texel[i] = txm_v2((float)px, (float)py);
        w->place[i] = txm_v3((float)px, (float)py, 0);
        w->normal[i] = txm_v3(0, 0, 1);
        w->axis[i] = txm_v2(1, 0);
    }
    for (size_t n = 0; n < count; n++) {
        txi_target target;
        if (!l->d->missing[texels[n]]) continue;
        txi_texel_weights(l->d, l->centre, texels[n], weight);
        x = weight[0] * t[0].x + weight[1] * t[1].x + weight[2] * t[2].x - left;
        y = weight[0] * t[0].y + weight[1] * t[1].y + weight[2] * t[2].y - top;
        if (!(x >= 0 && y >= 0 && x <= width - 1 && y <= height - 1)) continue;
        target.texel = texels[n];
        target.x = txm_float(x);
        target.y = txm_float(y);
        target.axis = txm_v2(1, 0);
        target.mirrored = 0;
        TXM_ASSERT(w->target_count < count);
        w->targets[w->target_count++] = target;
    }
    return TXM_OK;
}

/* Lay the disk around l->centre out in the plane. *fits: it is small enough for a window. */
static txm_status txi_sheet_spread(txi_sheet *l, int *fits) {
    txm_status status = txi_disk_init(&l->disk, l->s, l->s->face_count, l->scratch, l->env);
    if (status == TXM_OK) status = txi_sheet_disk(l);
    if (status == TXM_OK) status = txi_sheet_flat(l);
    if (status != TXM_OK) return status;
    l->at = (txm_vec2 *)txm_arena_alloc(l->scratch, l->disk.vertex_count, sizeof(txm_vec2));
    l->normal = (txm_vec3 *)txm_arena_alloc(l->scratch, l->disk.vertex_count, sizeof(txm_vec3));
    uint32_t *counts = (uint32_t *)txm_arena_alloc(l->scratch, l->s->face_count, sizeof(uint32_t));
    l->shown = (uint8_t *)txm_arena_alloc(l->scratch, l->disk.face_count, 1);
    if (l->scratch->failed) return txi_no_memory(l->env);
    if (!l->is_source) l->origin = l->flat.point[0];
    *fits = txi_sheet_place(l, counts);
    return TXM_OK;
}

/* Lay out the hole with l->reach, in a window of scratch memory. *again: it should be tried
   otherwise. */
static txm_status txi_sheet_try(txi_sheet *l, txi_window *w, int *again) {
    int fits = 0;
    *again = 0;
    txi_find_centre(l);
    txm_status status = txi_sheet_spread(l, &fits);
    if (status != TXM_OK) return status;
    if (!fits) {
        if (l->reach == TXI_REACH_LEAST) return txi_sheet_alone(l, l->scratch, w);
        *again = 1;
        return TXM_OK;
    }
    const size_t pixels = (size_t)l->width * (size_t)l->height;
    size_t room = 0;
    for (size_t i = 0; i < l->disk.face_count; i++)
        room += txi_missing_count(l->d, l->disk.faces[i]);
    uint8_t *marks = (uint8_t *)txm_arena_alloc(l->scratch, pixels, 1);
    int32_t *nearest = (int32_t *)txm_arena_alloc(l->scratch, pixels, sizeof(int32_t));
    status = txi_window_alloc(w, l->width, l->height, l->scratch, l->env);
    if (status == TXM_OK)
        w->targets = (txi_target *)txm_arena_alloc(l->scratch, room, sizeof(txi_target));
    if (l->scratch->failed) return txi_no_memory(l->env);
    txi_sheet_normals(l);
    txi_sheet_pixels(l, w, l->shown);
    *again = !txi_sheet_targets(l, w, marks, nearest, &status);
    if (status == TXM_OK && !*again) status = txi_sheet_others(l, w, marks, nearest, room);
    return status;
}

/* Copy the pixels of one window to another, from column left on. */
static void txi_window_paste(txi_window *to, const txi_window *from, int left) {
    const size_t n = (size_t)from->width;
    for (int y = 0; y < from->height; y++) {
        const size_t a = (size_t)y * n, b = (size_t)y * (size_t)to->width + (size_t)left;
        memcpy(to->state + b, from->state + a, n);
        memcpy(to->color + 4 * b, from->color + 4 * a, 4 * n);
        memcpy(to->share + b, from->share + a, n);
        memcpy(to->texel + b, from->texel + a, n * sizeof *to->texel);
        memcpy(to->place + b, from->place + a, n * sizeof *to->place);
        memcpy(to->normal + b, from->normal + a, n * sizeof *to->normal);
        memcpy(to->axis + b, from->axis + a, n * sizeof *to->axis);
        memcpy(to->mirrored + b, from->mirrored + a, n);
        memcpy(to->face + b, from->face + a, n * sizeof *to->face);
    }
}

/* The window in memory of the arena: a copy, with another beside it unless that is NULL. */
static txm_status txi_window_join(txi_window *w, const txi_window *hole, const txi_window *source,
                                  txm_arena *arena, txm_env *env) {
    const int left = hole->width + TXI_GAP;
    const int width = source ? left + source->width : hole->width;
    const int height = source && source->height > hole->height ? source->height : hole->height;
    const txm_status status = txi_window_alloc(w, width, height, arena, env);
    if (status != TXM_OK) return status;
    w->targets = (txi_target *)txm_arena_alloc(arena, hole->target_count, sizeof(txi_target));
    if (!w->targets) return txi_no_memory(env);
    memcpy(w->targets, hole->targets, hole->target_count * sizeof(txi_target));
    w->target_count = hole->target_count;
    w->spacing = hole->spacing;
    w->origin = hole->origin;
    txi_window_paste(w, hole, 0);
    if (source) txi_window_paste(w, source, left);
    return TXM_OK;
}

/* The face that lies deepest in what may be copied from: farthest from all that may not. 0:
   there is none. */
static int txi_find_source(txi_sheet *l, txm_status *status) {
    const txi_surface *s = l->s;
    uint32_t *sources =
        (uint32_t *)txm_arena_alloc(l->scratch, s->face_count, 3 * sizeof(uint32_t));
    size_t count = 0;
    double deepest = -1;
    if (!sources) {
        *status = txi_no_memory(l->env);
        return 0;
    }
    for (uint32_t f = 0; f < s->face_count; f++) {
        for (uint32_t k = 0; k < 3 && !txi_is_usable_face(l->d, f); k++)
            sources[count++] = s->vertex[3 * f + k];
    }
    *status = txi_geodesic(s, sources, NULL, count, 0.5 * TXI_UNREACHED, l->env, l->from_centre);
    for (uint32_t f = 0; f < s->face_count && *status == TXM_OK; f++) {
        const double depth = txi_mean_of(s, f, l->from_centre);
        if (txi_is_flat_face(s, f) || !txi_is_usable_face(l->d, f) || depth <= deepest) continue;
        deepest = depth;
        l->centre = f;
    }
    return deepest >= 0;
}

/* Lay out a part of what may be copied from that is not around the hole. *found: there is one. */
static txm_status txi_sheet_source(txi_sheet *l, size_t wanted, txi_window *w, int *found) {
    txm_status status = TXM_OK;
    *found = 0;
    l->group.count = l->texels = 0;
    l->is_source = l->slit = 1;
    l->reach = txm_clampi((int)sqrt((double)wanted), TXI_REACH_LEAST, TXI_REACH_MOST);
    if (!txi_find_source(l, &status)) return status;
    for (; status == TXM_OK && !*found && l->reach >= TXI_REACH_LEAST / 2; l->reach /= 2)
        status = txi_sheet_spread(l, found);
    if (status != TXM_OK || !*found) return status;
    status = txi_window_alloc(w, l->width, l->height, l->scratch, l->env);
    if (status != TXM_OK) return status;
    txi_sheet_normals(l);
    txi_sheet_pixels(l, w, l->shown);
    txi_window_colors(l->d, w);
    return TXM_OK;
}

/* The window as the caller gets it: with something to copy from beside it, if around the hole
   there is next to nothing. */
static txm_status txi_sheet_finish(txi_sheet *l, txi_window *hole, txm_arena *arena,
                                   txi_window *w) {
    const size_t pixels = (size_t)hole->width * (size_t)hole->height;
    size_t usable = 0, wanted = TXI_SOURCE_RATIO * hole->target_count;
    txi_window source;
    txm_status status = TXM_OK;
    int found = 0;
    if (wanted < TXI_SOURCE_LEAST) wanted = TXI_SOURCE_LEAST;
    txi_window_colors(l->d, hole);
    for (size_t i = 0; i < pixels; i++) usable += hole->state[i] == TXI_KNOWN;
    if (10 * usable < wanted && l->pixel > 0) status = txi_sheet_source(l, wanted, &source, &found);
    if (status != TXM_OK) return status;
    if (found) { /* if both together are not too large for a window */
        const int height = source.height > hole->height ? source.height : hole->height;
        found = txi_side_fits(hole->width + TXI_GAP + source.width, height);
    }
    return txi_window_join(w, hole, found ? &source : NULL, arena, l->env);
}

/* Lay out the hole of a face: all of it in one window if that can be done; else with cuts
   through it; else a disk at its rim, smaller and smaller until it lies flat enough. */
static txm_status txi_sheet_window(txi_domain *d, uint32_t seed, txm_arena *scratch,
                                   txm_arena *arena, txm_env *env, txi_window *w) {
    const txi_surface *s = d->surface;
    txi_sheet l;
    txi_window hole;
    int again = 1;
    memset(&l, 0, sizeof l);
    l.d = d;
    l.s = s;
    l.env = env;
    l.scratch = scratch;
    l.state = (uint8_t *)txm_arena_zero(scratch, s->face_count, 1);
    l.from_hole = (double *)txm_arena_alloc(scratch, s->vertex_count, sizeof(double));
    l.from_centre = (double *)txm_arena_alloc(scratch, s->vertex_count, sizeof(double));
    l.key = (double *)txm_arena_alloc(scratch, s->face_count, sizeof(double));
    l.size = (double *)txm_arena_alloc(scratch, s->face_count, sizeof(double));
    l.weight = (double *)txm_arena_alloc(scratch, s->face_count, sizeof(double));
    if (scratch->failed) return txi_no_memory(env);
    txm_status status = txi_find_group(&l, seed);
    if (status == TXM_OK && l.texels > TXI_WHOLE_MOST) l.reach = TXI_REACH_MOST;
    while (status == TXM_OK && again) {
        txm_arena inner;
        txm_arena_init(&inner, env);
        l.scratch = &inner;
        if (l.pixel > 0) {
            status = txi_sheet_try(&l, &hole, &again);
        } else {
            again = 0;
            l.centre = seed;
            status = txi_sheet_alone(&l, &inner, &hole);
        }
        if (status == TXM_OK && !again) status = txi_sheet_finish(&l, &hole, arena, w);
        txm_arena_free(&inner);
        if (again && l.slit) {
            l.reach = l.reach ? l.reach / 2 : (int)(0.75 * sqrt((double)l.texels));
            l.reach = txm_clampi(l.reach, TXI_REACH_LEAST, TXI_REACH_MOST);
        }
        l.slit = 1;
    }
    return status;
}

/* Lay out the next window with missing texels: of the first hole, in the order of the texture,
   or of a part of it. found receives 0 if none are left; else the window has one target or more.
   Its memory is the arena's; states and colours are set. */
static txm_status txi_windows_next(txi_domain *d, txm_arena *arena, txm_env *env, txi_window *w,
                                   int *found) {
    txi_surface *s = d->surface;
    const size_t texels = (size_t)d->width * (size_t)d->height;
    txm_arena scratch;
    if (!s) return txi_picture_window(d, arena, env, w, found);
    while (s->cursor < texels && !(d->missing[s->cursor] && d->covered[s->cursor])) s->cursor++;
    *found = s->cursor < texels;
    if (!*found) return TXM_OK;
    txm_arena_init(&scratch, env);
    const txm_status status = txi_sheet_window(d, s->owner[s->cursor], &scratch, arena, env, w);
    txm_arena_free(&scratch);
    return status;
}

/* ---- graph of texels -------------------------------------------------------------------------
   The unknown texels of a map as nodes of a graph, with links to their neighbours on the surface,
   across the seams of the atlas too. Weights are such that

       sum over links  w (u_i - u_j)^2   approximates   integral over the surface of |grad u|^2

   so that its minimum is harmonic on the surface, however the atlas is stretched or sheared. With
   the metric G of a face (per texel) the integral over a texel is  grad u . D grad u,
   D = sqrt(det G) G^-1; D is written as a sum of  w_e e e^T  with weights w_e >= 0 and three whole
   offsets e, which are the links (Selling's reduction; for squares: right and down, both of weight
   1). No weight is negative, so that u never leaves the range of its boundary values.

   An offset that leaves the face of a texel is walked along the surface. Where the walk crosses
   a seam it ends between texels of another chart; the link is then shared out to the four
   around, bilinearly, so that functions that are linear on the surface pass seams unchanged. */

enum {
    TXI_WALK_MOST = 64,    /* faces that one walk may cross; ours                               */
    TXI_STENCIL = 3,       /* offsets                                                           */
    TXI_MERGE_MOST = 256,  /* links of a row that are merged; ours: the time is quadratic       */
    TXI_LINKS_MOST = 24    /* links made by one node: 3 offsets, to and fro, 4 texels each      */
};
#define TXI_SHEAR 64.0   /* ratio of the eigenvalues of D at most: offsets stay below 9 texels */

/* Nodes are unknown texels in the order of the picture. Links to other nodes lie in `to`, each
   in the rows of both its nodes; those to known texels in `rim`. */
typedef struct txi_texel_graph {
    size_t count;
    uint32_t *texel;       /* 1 per node                                                        */
    uint32_t *first, *to;  /* links of node i: to[first[i]] .. to[first[i + 1] - 1], nodes      */
    float *weight;         /* 1 per link                                                        */
    uint32_t *rim_first, *rim; /* the same for known neighbours, which are texels               */
    float *rim_weight;
} txi_texel_graph;

/* The links of a texel: offsets e and weights w_e. */
typedef struct txi_stencil {
    int x[TXI_STENCIL], y[TXI_STENCIL];
    double weight[TXI_STENCIL];
} txi_stencil;

/* D = (a b; b c), positive definite, as a sum of w e e^T. Starting with the superbase (1, 0),
   (0, 1), (-1, -1), two vectors u, v of it with u . D v > 0 are replaced by -u, v, and u - v,
   until no two are left; then  D = sum over pairs of  -(u . D v) (third vector, turned by 90
   degrees) (...)^T. */
static txi_stencil txi_stencil_of(double a, double b, double c) {
    txi_stencil s = {{1, 0, -1}, {0, 1, -1}, {0, 0, 0}};
    for (int round = 0, k = 0; round < 64 && k < 3; round++) {
        for (k = 0; k < 3; k++) {
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            const double dot = a * s.x[i] * s.x[j] + c * s.y[i] * s.y[j] +
                               b * (s.x[i] * s.y[j] + s.y[i] * s.x[j]);
            s.weight[k] = -dot;
            if (dot > 1e-12 * (a + c)) {
                s.x[k] = s.x[i] - s.x[j];
                s.y[k] = s.y[i] - s.y[j];
                s.x[i] = -s.x[i];
                s.y[i] = -s.y[i];
                break;
            }
        }
    }
    for (int k = 0; k < 3; k++) {
        const int x = s.x[k];
        s.x[k] = -s.y[k];
        s.y[k] = x;
        if (s.weight[k] < 0) s.weight[k] = 0;
    }
    return s;
}

/* The derivatives of the place on a face by u and v, per texel. 0: it has no area in the atlas. */
static int txi_face_axes(const txi_surface *s, uint32_t face, txm_dvec3 *pu, txm_dvec3 *pv) {
    const txm_vec2 *t = s->uv + 3 * (size_t)face;
    const double area = txi_cross2(t[0], t[1], t[2]);
    const txm_dvec3 p = txi_corner_point(s, 3 * face);
    const txm_dvec3 q = txm_d3_sub(txi_corner_point(s, 3 * face + 1), p);
    const txm_dvec3 r = txm_d3_sub(txi_corner_point(s, 3 * face + 2), p);
    if (!(fabs(area) > 1e-9)) return 0;
    *pu = txm_d3_scale(txm_d3_sub(txm_d3_scale(q, (double)t[2].y - t[0].y),
                                  txm_d3_scale(r, (double)t[1].y - t[0].y)), 1 / area);
    *pv = txm_d3_scale(txm_d3_sub(txm_d3_scale(r, (double)t[1].x - t[0].x),
                                  txm_d3_scale(q, (double)t[2].x - t[0].x)), 1 / area);
    return 1;
}

/* The links of the texels of a face; of a picture: its four neighbours. */
static txi_stencil txi_face_stencil(const txi_domain *d, uint32_t face) {
    txm_dvec3 pu, pv;
    if (!d->surface || !txi_face_axes(d->surface, face, &pu, &pv)) return txi_stencil_of(1, 0, 1);
    const double e = txm_d3_len2(pu), f = txm_d3_dot(pu, pv), g = txm_d3_len2(pv);
    const double det = e * g - f * f;
    if (!(e + g > 0)) return txi_stencil_of(1, 0, 1);
    /* ratio of the eigenvalues about (e + g)^2 / det: what is more is taken off the larger one */
    const double least = (e + g) * (e + g) / TXI_SHEAR;
    const double more = det < least ? (e + g) / TXI_SHEAR : 0;
    const double root = sqrt((e + more) * (g + more) - f * f);
    return txi_stencil_of((g + more) / root, -f / root, (e + more) / root);
}

/* ---- graph: walks ------------------------------------------------------------------------- */

/* The face on the other side of a side, and a place on the side, s of the way along it, and a
   step in the plane of the first face turned into the plane of the second: place and step in
   texels of that face. Sewn sides change neither. 0: the second face has no area. */
static int txi_cross_side(const txi_surface *s, uint32_t side, double along, double place[2],
                          double step[2]) {
    const uint32_t other = s->opposite[side], next = txi_next_corner(other);
    const txm_vec2 from = s->uv[next], to = s->uv[other]; /* the side as the first face runs
                                                             along it                            */
    txm_dvec3 pu, pv, qu, qv;
    if (txi_is_sewn(s, side, other)) return 1;
    if (!txi_face_axes(s, side / 3, &pu, &pv) || !txi_face_axes(s, other / 3, &qu, &qv)) return 0;
    const txm_dvec3 edge = txm_d3_unit(
        txm_d3_sub(txi_corner_point(s, txi_next_corner(side)), txi_corner_point(s, side)));
    const txm_dvec3 out = txm_d3_unit(txm_d3_cross(edge, txi_face_area2(s, side / 3)));
    const txm_dvec3 in = txm_d3_unit(txm_d3_cross(edge, txi_face_area2(s, other / 3)));
    const txm_dvec3 move = txm_d3_add(txm_d3_scale(pu, step[0]), txm_d3_scale(pv, step[1]));
    const txm_dvec3 turned = txm_d3_add(txm_d3_scale(edge, txm_d3_dot(move, edge)),
                                        txm_d3_scale(in, txm_d3_dot(move, out)));
    /* turned = x qu + y qv */
    const double e = txm_d3_len2(qu), f = txm_d3_dot(qu, qv), g = txm_d3_len2(qv);
    const double det = e * g - f * f, u = txm_d3_dot(turned, qu), v = txm_d3_dot(turned, qv);
    if (!(det > 1e-12 * e * g)) return 0;
    step[0] = (g * u - f * v) / det;
    step[1] = (e * v - f * u) / det;
    place[0] = from.x + ((double)to.x - from.x) * along;
    place[1] = from.y + ((double)to.y - from.y) * along;
    return 1;
}

/* Walk on the surface: from a place on a face, in its own texels, by a step. face and place receive
   where it ends. 0: at a border of the surface, or where a face has no area. */
static int txi_walk_surface(const txi_surface *s, uint32_t *face, double place[2],
                            const double by[2]) {
    double step[2] = {by[0], by[1]};
    uint32_t entry = TXM_NO_SIDE;
    for (int count = 0; count < TXI_WALK_MOST; count++) {
        const txm_vec2 *t = s->uv + 3 * (size_t)*face;
        double here[3], there[3], first = 1;
        int exit = -1;
        if (!txi_weights(t, place[0], place[1], here)) return 0;
        if (!txi_weights(t, place[0] + step[0], place[1] + step[1], there)) return 0;
        for (int k = 0; k < 3; k++) { /* side k is where the weight of corner k + 2 is 0 */
            const int c = (k + 2) % 3;
            if (3 * *face + (uint32_t)k == entry || there[c] >= -1e-9 || !(here[c] > there[c]))
                continue;
            const double at = here[c] > 0 ? here[c] / (here[c] - there[c]) : 0;
            if (exit >= 0 && at >= first) continue;
            first = at;
            exit = k;
        }
        if (exit < 0) {
            place[0] += step[0];
            place[1] += step[1];
            return 1;
        }
        const uint32_t side = 3 * *face + (uint32_t)exit;
        if (s->opposite[side] == TXM_NO_SIDE) return 0;
        const txm_vec2 a = t[exit], b = t[(exit + 1) % 3];
        const double dx = (double)b.x - a.x, dy = (double)b.y - a.y;
        place[0] += step[0] * first;
        place[1] += step[1] * first;
        const double along = ((place[0] - a.x) * dx + (place[1] - a.y) * dy) / (dx * dx + dy * dy);
        for (int k = 0; k < 2; k++) step[k] *= 1 - first;
        if (!txi_cross_side(s, side, fmin(fmax(along, 0), 1), place, step)) return 0;
        entry = s->opposite[side];
        *face = entry / 3;
    }
    return 0;
}

/* Where the texel lies on its face, in the texels of that. */
static void txi_texel_place(const txi_domain *d, uint32_t face, uint32_t texel, double place[2]) {
    const txm_vec2 *t = d->surface->uv + 3 * (size_t)face;
    double w[3];
    txi_texel_weights(d, face, texel, w);
    place[0] = w[0] * t[0].x + w[1] * t[1].x + w[2] * t[2].x;
    place[1] = w[0] * t[0].y + w[1] * t[1].y + w[2] * t[2].y;
}

/* ---- graph: links ------------------------------------------------------------------------- */

/* the links that one node makes */
typedef struct txi_links {
    uint32_t texel[TXI_LINKS_MOST];
    double weight[TXI_LINKS_MOST];
    int count;
} txi_links;

static void txi_links_add(txi_links *links, int64_t texel, double weight) {
    if (texel < 0 || !(weight > 0)) return;
    TXM_ASSERT(links->count < TXI_LINKS_MOST);
    links->texel[links->count] = (uint32_t)texel;
    links->weight[links->count++] = weight;
}

/* A link to a place between texels: to the four around it that exist, bilinearly, else to the
   nearest. */
static void txi_links_share(const txi_domain *d, uint32_t face, const double place[2],
                            double weight, txi_links *links) {
    const double fx = floor(place[0]), fy = floor(place[1]);
    double share[4], sum = 0;
    int64_t texel[4];
    for (int k = 0; k < 4; k++) {
        const double u = place[0] - fx, v = place[1] - fy;
        texel[k] = txi_tap(d, face, (int)fx + k % 2, (int)fy + k / 2);
        share[k] = (k % 2 ? u : 1 - u) * (k / 2 ? v : 1 - v);
        if (texel[k] >= 0 && share[k] > 0.01) sum += share[k];
    }
    if (sum > 0.05) {
        for (int k = 0; k < 4; k++) {
            if (share[k] > 0.01) txi_links_add(links, texel[k], weight * share[k] / sum);
        }
        return;
    }
    const txm_vec2 p = txm_v2(txm_float(place[0]), txm_float(place[1]));
    txi_links_add(links, txi_nearest_tap(d, face, p, 0), weight);
}

/* The link of a texel by an offset. */
static void txi_links_step(const txi_domain *d, uint32_t texel, uint32_t face, int x, int y,
                           double weight, txi_links *links) {
    const int tx = (int)(texel % (uint32_t)d->width) + x,
              ty = (int)(texel / (uint32_t)d->width) + y;
    if (!d->surface) {
        txi_links_add(links, txi_tap(d, face, tx, ty), weight);
        return;
    }
    const size_t direct = (size_t)txi_wrap(ty, d->height) * (size_t)d->width +
                          (size_t)txi_wrap(tx, d->width);
    if (d->surface->owner[direct] == face) {
        txi_links_add(links, (int64_t)direct, weight);
        return;
    }
    double place[2];
    const double by[2] = {(double)x, (double)y};
    txi_texel_place(d, face, texel, place);
    if (!txi_walk_surface(d->surface, &face, place, by)) return;
    const double rx = floor(place[0] + 0.5), ry = floor(place[1] + 0.5);
    if (fabs(place[0] - rx) < 1e-3 && fabs(place[1] - ry) < 1e-3) { /* within a chart: at a texel */
        const int64_t t = txi_tap(d, face, (int)rx, (int)ry);
        txi_links_add(links, t, weight);
        if (t >= 0) return;
    }
    txi_links_share(d, face, place, weight, links);
}

/* All links that a texel makes; `weight` counts half for each of two unknown texels, as both
   make the link between them, but in full where the other is known. */
static void txi_links_of(const txi_domain *d, uint32_t texel, txi_links *links) {
    const uint32_t face = d->surface ? d->surface->owner[texel] : TXI_NO_FACE;
    const txi_stencil s = txi_face_stencil(d, face);
    links->count = 0;
    for (int k = 0; k < 2 * TXI_STENCIL; k++) {
        const int sign = k % 2 ? -1 : 1;
        if (s.weight[k / 2] > 1e-6)
            txi_links_step(d, texel, face, sign * s.x[k / 2], sign * s.y[k / 2], s.weight[k / 2],
                           links);
    }
}

/* Merge the links of one row that go to the same node: sorted by node. Returns their number.
   Rows of very many links (where texels differ much in size) are left as they are. */
static uint32_t txi_merge_links(uint32_t *to, float *weight, uint32_t count) {
    uint32_t kept = 0;
    if (count > TXI_MERGE_MOST) return count;
    for (uint32_t i = 1; i < count; i++) {
        const uint32_t t = to[i];
        const float w = weight[i];
        uint32_t k = i;
        for (; k > 0 && to[k - 1] > t; k--) {
            to[k] = to[k - 1];
            weight[k] = weight[k - 1];
        }
        to[k] = t;
        weight[k] = w;
    }
    for (uint32_t i = 0; i < count; i++) {
        if (kept && to[kept - 1] == to[i]) {
            weight[kept - 1] += weight[i];
        } else {
            to[kept] = to[i];
            weight[kept++] = weight[i];
        }
    }
    return kept;
}

/* What a texel is to a graph. */
enum { TXI_NODE_NONE = 0, TXI_NODE_KNOWN = 1, TXI_NODE_UNKNOWN = 2 };

/* Count the links of all nodes, or (filling) store them. node: 1 per texel, the node of unknown
   ones. */
static void txi_graph_pass(const txi_domain *d, const uint8_t *marks, const uint32_t *node,
                           int filling, txi_texel_graph *g, size_t total[2]) {
    total[0] = total[1] = 0;
    for (size_t i = 0; i < g->count; i++) {
        txi_links links;
        txi_links_of(d, g->texel[i], &links);
        for (int k = 0; k < links.count; k++) {
            const uint32_t texel = links.texel[k];
            if (marks[texel] == TXI_NODE_NONE || texel == g->texel[i]) continue;
            if (marks[texel] == TXI_NODE_KNOWN) {
                total[1]++;
                if (!filling) {
                    g->rim_first[i + 1]++;
                    continue;
                }
                const uint32_t at = --g->rim_first[i + 1];
                g->rim[at] = texel;
                g->rim_weight[at] = txm_float(links.weight[k]);
                continue;
            }
            for (int end = 0; end < 2; end++) {
                const size_t row = end ? node[texel] : i;
                total[0]++;
                if (!filling) {
                    g->first[row + 1]++;
                    continue;
                }
                const uint32_t at = --g->first[row + 1];
                g->to[at] = end ? (uint32_t)i : node[texel];
                g->weight[at] = txm_float(links.weight[k] / 2);
            }
        }
    }
}

/* From ends of rows, as a filling pass leaves them, to merged rows. */
static void txi_graph_merge(size_t count, uint32_t total, uint32_t *first, uint32_t *to,
                            float *weight) {
    uint32_t kept = 0;
    for (size_t i = 0; i < count; i++) {
        const uint32_t begin = first[i + 1], end = i + 1 < count ? first[i + 2] : total;
        memmove(to + kept, to + begin, (end - begin) * sizeof *to);
        memmove(weight + kept, weight + begin, (end - begin) * sizeof *weight);
        first[i] = kept;
        kept += txi_merge_links(to + kept, weight + kept, end - begin);
    }
    first[count] = kept;
}

/* The graph of the unknown texels.
   marks   1 per texel: TXI_NODE_...
   return  TXM_OK, TXM_TOO_LARGE, TXM_OUT_OF_MEMORY, TXM_CANCELLED
   cost    about 0.3 us and 100 bytes per unknown texel, 4 bytes per texel                  */
static txm_status txi_graph_make(const txi_domain *d, const uint8_t *marks, txm_arena *arena,
                                 txm_env *env, txi_texel_graph *g) {
    const size_t texels = (size_t)d->width * (size_t)d->height;
    size_t total[2], count = 0;
    memset(g, 0, sizeof *g);
    for (size_t i = 0; i < texels; i++) g->count += marks[i] == TXI_NODE_UNKNOWN;
    g->texel = (uint32_t *)txm_arena_alloc(arena, g->count + 1, sizeof(uint32_t));
    g->first = (uint32_t *)txm_arena_zero(arena, g->count + 1, sizeof(uint32_t));
    g->rim_first = (uint32_t *)txm_arena_zero(arena, g->count + 1, sizeof(uint32_t));
    uint32_t *node = (uint32_t *)txm_arena_alloc(arena, texels, sizeof(uint32_t));
    if (arena->failed) return txi_no_memory(env);
    for (size_t i = 0; i < texels; i++) {
        node[i] = (uint32_t)count;
        if (marks[i] != TXI_NODE_UNKNOWN) continue;
        TXM_ASSERT(count < g->count);
        g->texel[count++] = (uint32_t)i;
    }
    txi_graph_pass(d, marks, node, 0, g, total);
    if (total[0] > UINT32_MAX || total[1] > UINT32_MAX)
        return txm_fail(env, TXM_TOO_LARGE, "too many missing texels for one system of equations");
    if (txm_progress(env, 0, "smooth fill")) return txi_stopped(env);
    for (size_t i = 0; i < g->count; i++) {
        g->first[i + 1] += g->first[i];
        g->rim_first[i + 1] += g->rim_first[i];
    }
    g->to = (uint32_t *)txm_arena_alloc(arena, total[0] + 1, sizeof(uint32_t));
    g->weight = (float *)txm_arena_alloc(arena, total[0] + 1, sizeof(float));
    g->rim = (uint32_t *)txm_arena_alloc(arena, total[1] + 1, sizeof(uint32_t));
    g->rim_weight = (float *)txm_arena_alloc(arena, total[1] + 1, sizeof(float));
    if (arena->failed) return txi_no_memory(env);
    txi_graph_pass(d, marks, node, 1, g, total);
    txi_graph_merge(g->count, (uint32_t)total[0], g->first, g->to, g->weight);
    txi_graph_merge(g->count, (uint32_t)total[1], g->rim_first, g->rim, g->rim_weight);
    return TXM_OK;
}

/* Set the marks of all nodes that links connect with the one given to 0. queue: room for 1 per
   node. */
static void txi_graph_spread(const txi_texel_graph *g, uint32_t from, uint32_t *queue,
                             uint8_t *mark) {
    size_t count = 1;
    queue[0] = from;
    mark[from] = 0;
    for (size_t k = 0; k < count; k++) {
        for (uint32_t l = g->first[queue[k]]; l < g->first[queue[k] + 1]; l++) {
            if (!mark[g->to[l]]) continue;
            mark[g->to[l]] = 0;
            TXM_ASSERT(count < g->count);
            queue[count++] = g->to[l];
        }
    }
}

/* Mark the nodes that no links connect with a known texel: 1 in `island`. queue: room for 1 per
   node. */
static void txi_graph_islands(const txi_texel_graph *g, uint32_t *queue, uint8_t *island) {
    memset(island, 1, g->count);
    for (size_t i = 0; i < g->count; i++) {
        if (island[i] && g->rim_first[i] < g->rim_first[i + 1])
            txi_graph_spread(g, (uint32_t)i, queue, island);
    }
}

/* ---- multigrid on graphs ---------------------------------------------------------------------
   Solves A x = b where A is the Laplacian of a weighted graph with some nodes tied to ground,

       (A x)_i = ground_i x_i + sum over links  w_ij (x_i - x_j),

   by conjugate gradients, preconditioned by a cycle over coarser graphs [3]. A coarser graph has
   one node for each group of about four nodes that strong links connect; the weights between
   groups are the sums of those between their members (Galerkin's product with piecewise constant
   interpolation). Each level is solved by two steps of conjugate gradients, preconditioned by
   the next level: this "K cycle" makes the number of iterations independent of the size, also
   for graphs without any regularity. */

enum {
    TXI_GRID_LEVELS = 24,
    TXI_GRID_DIRECT = 96,     /* nodes up to which a system is solved directly; ours            */
    TXI_GRID_ITERATIONS = 200 /* at most; then the result is taken as it is. 5 to 20 are usual  */
};

#define TXI_GRID_ENOUGH 0.0625 /* squared norm of the residual after one step of the two, relative,
                                  from which the second is left out: 1/4 in [3]                  */

typedef struct txi_grid_level {
    size_t count;
    const uint32_t *first, *to; /* links in rows, each in both                                  */
    const float *weight;
    double *inverse; /* 1 / diagonal of A                                                       */
    uint32_t *group; /* 1 per node: its node on the next level; NULL on the last                */
    double *r, *x;   /* the system of this level: right side, solution (not on the first)       */
    double *q;       /* scratch                                                                 */
    double *c, *v;   /* of the first of two steps: correction, A times it (not on the first)    */
} txi_grid_level;

typedef struct txi_grid {
    txi_grid_level level[TXI_GRID_LEVELS];
    int levels;
    double *direct; /* Cholesky factor of the last level, in rows; NULL: too large, it is
                       smoothed                                                                  */
} txi_grid;

/* Group the nodes of a level in pairs: each with the free neighbour of the strongest link.
   Returns the number of groups. */
static uint32_t txi_grid_pair(size_t count, const uint32_t *first, const uint32_t *to,
                              const float *weight, uint32_t *group) {
    uint32_t groups = 0;
    for (size_t i = 0; i < count; i++) group[i] = UINT32_MAX;
    for (size_t i = 0; i < count; i++) {
        uint32_t mate = UINT32_MAX;
        float most = 0;
        if (group[i] != UINT32_MAX) continue;
        for (uint32_t k = first[i]; k < first[i + 1]; k++) {
            if (to[k] == i || group[to[k]] != UINT32_MAX || !(weight[k] > most)) continue;
            most = weight[k];
            mate = to[k];
        }
        group[i] = groups;
        if (mate != UINT32_MAX) group[mate] = groups;
        groups++;
    }
    return groups;
}

/* The links between groups. members: the nodes in the order of their group, those of group g are
   members[start[g]] .. members[start[g + 1] - 1]; place: scratch, 1 per group. Returns their
   number. */
static uint32_t txi_grid_sum(const uint32_t *first, const uint32_t *to, const float *weight,
                             const uint32_t *group, uint32_t groups, const uint32_t *start,
                             const uint32_t *members, uint32_t *place, uint32_t *out_first,
                             uint32_t *out_to, float *out_weight) {
    uint32_t total = 0;
    for (uint32_t g = 0; g < groups; g++) place[g] = UINT32_MAX;
    for (uint32_t g = 0; g < groups; g++) {
        out_first[g] = total;
        for (uint32_t m = start[g]; m < start[g + 1]; m++) {
            for (uint32_t k = first[members[m]]; k < first[members[m] + 1]; k++) {
                const uint32_t other = group[to[k]];
                if (other == g) continue;
                if (place[other] == UINT32_MAX || place[other] < out_first[g]) {
                    place[other] = total;
                    out_to[total] = other;
                    out_weight[total++] = weight[k];
                } else {
                    out_weight[place[other]] += weight[k];
                }
            }
        }
    }
    out_first[groups] = total;
    return total;
}

/* Sort the nodes by group. */
static void txi_grid_members(size_t count, const uint32_t *group, uint32_t groups, uint32_t *start,
                             uint32_t *members) {
    memset(start, 0, ((size_t)groups + 1) * sizeof *start);
    for (size_t i = 0; i < count; i++) start[group[i] + 1]++;
    for (uint32_t g = 0; g < groups; g++) start[g + 1] += start[g];
    for (size_t i = count; i-- > 0;) members[--start[group[i] + 1]] = (uint32_t)i;
    for (uint32_t g = 0; g < groups; g++) start[g] = start[g + 1];
    start[groups] = (uint32_t)count;
}

/* One level from the one above it, whose links are replaced by those of the coarser graph: twice
   grouped in pairs. fine->group receives the groups. 0: no memory. */
static int txi_grid_coarsen(txi_grid_level *fine, txi_grid_level *coarse, txm_arena *arena,
                            txm_arena *scratch) {
    const size_t n = fine->count, links = fine->first[n];
    fine->group = (uint32_t *)txm_arena_alloc(arena, n, sizeof(uint32_t));
    uint32_t *group = (uint32_t *)txm_arena_alloc(scratch, n, 3 * sizeof(uint32_t));
    uint32_t *start = (uint32_t *)txm_arena_alloc(scratch, n + 1, sizeof(uint32_t));
    uint32_t *first = (uint32_t *)txm_arena_alloc(scratch, n + 1, sizeof(uint32_t));
    uint32_t *to = (uint32_t *)txm_arena_alloc(scratch, links + 1, sizeof(uint32_t));
    float *weight = (float *)txm_arena_alloc(scratch, links + 1, sizeof(float));
    if (!fine->group || scratch->failed) return 0;
    uint32_t *members = group + n, *place = members + n;
    const uint32_t pairs = txi_grid_pair(n, fine->first, fine->to, fine->weight, fine->group);
    txi_grid_members(n, fine->group, pairs, start, members);
    txi_grid_sum(fine->first, fine->to, fine->weight, fine->group, pairs, start, members, place,
                 first, to, weight);
    const uint32_t groups = txi_grid_pair(pairs, first, to, weight, group);
    for (size_t i = 0; i < n; i++) fine->group[i] = group[fine->group[i]];
    /* from the links of the fine graph again: those of the pairs are overwritten */
    txi_grid_members(n, fine->group, groups, start, members);
    const uint32_t total = txi_grid_sum(fine->first, fine->to, fine->weight, fine->group, groups,
                                        start, members, place, first, to, weight);
    uint32_t *kept = (uint32_t *)txm_arena_alloc(arena, (size_t)groups + 1, sizeof(uint32_t));
    uint32_t *kept_to = (uint32_t *)txm_arena_alloc(arena, (size_t)total + 1, sizeof(uint32_t));
    float *kept_weight = (float *)txm_arena_alloc(arena, (size_t)total + 1, sizeof(float));
    if (arena->failed) return 0;
    memcpy(kept, first, ((size_t)groups + 1) * sizeof *kept);
    memcpy(kept_to, to, total * sizeof *to);
    memcpy(kept_weight, weight, total * sizeof *weight);
    coarse->count = groups;
    coarse->first = kept;
    coarse->to = kept_to;
    coarse->weight = kept_weight;
    return 1;
}

/* y = A x */
static void txi_grid_apply(const txi_grid_level *l, const double *x, double *y) {
    for (size_t i = 0; i < l->count; i++) {
        double sum = 0;
        for (uint32_t k = l->first[i]; k < l->first[i + 1]; k++)
            sum += (double)l->weight[k] * x[l->to[k]];
        y[i] = x[i] / l->inverse[i] - sum;
    }
}

/* The Cholesky factor of the last level. */
static void txi_grid_factor(const txi_grid_level *l, double *a) {
    const size_t n = l->count;
    memset(a, 0, n * n * sizeof *a);
    for (size_t i = 0; i < n; i++) {
        a[i * n + i] += 1 / l->inverse[i];
        for (uint32_t k = l->first[i]; k < l->first[i + 1]; k++)
            a[i * n + l->to[k]] -= (double)l->weight[k];
    }
    for (size_t i = 0; i < n; i++) {
        const double whole = a[i * n + i];
        for (size_t j = 0; j <= i; j++) {
            double sum = a[i * n + j];
            for (size_t k = 0; k < j; k++) sum -= a[i * n + k] * a[j * n + k];
            if (j < i) a[i * n + j] = sum / a[j * n + j];
            else a[i * n + i] = sqrt(fmax(sum, 1e-14 * whole)); /* rounding may leave nothing */
        }
    }
}

static void txi_grid_direct(const txi_grid *g, const txi_grid_level *l, const double *r,
                            double *x) {
    const size_t n = l->count;
    const double *a = g->direct;
    for (size_t i = 0; i < n; i++) {
        double sum = r[i];
        for (size_t k = 0; k < i; k++) sum -= a[i * n + k] * x[k];
        x[i] = sum / a[i * n + i];
    }
    for (size_t i = n; i-- > 0;) {
        double sum = x[i];
        for (size_t k = i + 1; k < n; k++) sum -= a[k * n + i] * x[k];
        x[i] = sum / a[i * n + i];
    }
}

/* One sweep of Gauss and Seidel, up or down the nodes. */
static void txi_grid_sweep(const txi_grid_level *l, const double *r, double *x, int down) {
    for (size_t n = 0; n < l->count; n++) {
        const size_t i = down ? l->count - 1 - n : n;
        double sum = r[i];
        for (uint32_t k = l->first[i]; k < l->first[i + 1]; k++)
            sum += (double)l->weight[k] * x[l->to[k]];
        x[i] = sum * l->inverse[i];
    }
}

static double txi_grid_dot(const double *a, const double *b, size_t count) {
    double sum = 0;
    for (size_t i = 0; i < count; i++) sum += a[i] * b[i];
    return sum;
}

static void txi_grid_coarse(const txi_grid *g, int level);

/* x = about A^-1 r, by smoothing before and after a correction from the next level. */
static void txi_grid_cycle(const txi_grid *g, int level, const double *r, double *x) {
    const txi_grid_level *l = &g->level[level];
    const size_t n = l->count;
    memset(x, 0, n * sizeof *x);
    if (level + 1 == g->levels) {
        if (g->direct) {
            txi_grid_direct(g, l, r, x);
            return;
        }
        for (int k = 0; k < 4; k++) {
            txi_grid_sweep(l, r, x, 0);
            txi_grid_sweep(l, r, x, 1);
        }
        return;
    }
    const txi_grid_level *next = l + 1;
    txi_grid_sweep(l, r, x, 0);
    txi_grid_apply(l, x, l->q);
    memset(next->r, 0, next->count * sizeof *next->r);
    for (size_t i = 0; i < n; i++) next->r[l->group[i]] += r[i] - l->q[i];
    txi_grid_coarse(g, level + 1);
    for (size_t i = 0; i < n; i++) x[i] += next->x[l->group[i]];
    txi_grid_sweep(l, r, x, 1);
}

/* Solve the system of a level below the first, r, by two steps of conjugate gradients; one if that
   is good enough. r is lost. With c1, r1, v1 = A c1 of the first step, c2, r2, v2 of the second
   [3]:

       x = (a1 / p1 - f a2 / (p1 p2)) c1 + (a2 / p2) c2,
       p1 = c1.v1, a1 = c1.r1, f = c2.v1, p2 = c2.v2 - f^2 / p1, a2 = c2.r2                     */
static void txi_grid_coarse(const txi_grid *g, int level) {
    const txi_grid_level *l = &g->level[level];
    const size_t n = l->count;
    if (level + 1 == g->levels) {
        txi_grid_cycle(g, level, l->r, l->x);
        return;
    }
    const double norm = txi_grid_dot(l->r, l->r, n);
    txi_grid_cycle(g, level, l->r, l->c);
    txi_grid_apply(l, l->c, l->v);
    const double p1 = txi_grid_dot(l->c, l->v, n), a1 = txi_grid_dot(l->c, l->r, n);
    const double step = p1 > 0 ? a1 / p1 : 0;
    for (size_t i = 0; i < n; i++) l->r[i] -= step * l->v[i];
    if (!(p1 > 0) || txi_grid_dot(l->r, l->r, n) <= TXI_GRID_ENOUGH * norm) {
        for (size_t i = 0; i < n; i++) l->x[i] = step * l->c[i];
        return;
    }
    txi_grid_cycle(g, level, l->r, l->x);
    const double f = txi_grid_dot(l->x, l->v, n), a2 = txi_grid_dot(l->x, l->r, n);
    txi_grid_apply(l, l->x, l->q);
    const double p2 = txi_grid_dot(l->x, l->q, n) - f * f / p1;
    const double second = p2 > 0 ? a2 / p2 : 0;
    for (size_t i = 0; i < n; i++) l->x[i] = (step - f * second / p1) * l->c[i] + second * l->x[i];
}

/* The levels for a graph.
   first, to, weight  its links in rows; they are used as long as the grid is
   ground             1 per node, 0 or more; each connected part needs one that is not 0
   cost               about 0.2 us and 130 bytes per node                                   */
static txm_status txi_grid_make(size_t count, const uint32_t *first, const uint32_t *to,
                                const float *weight, const double *ground, txm_arena *arena,
                                txm_env *env, txi_grid *g) {
    txm_arena scratch;
    memset(g, 0, sizeof *g);
    g->level[0].count = count;
    g->level[0].first = first;
    g->level[0].to = to;
    g->level[0].weight = weight;
    const double *earth = ground;
    for (int k = 0; k < TXI_GRID_LEVELS; k++) {
        txi_grid_level *l = &g->level[k];
        const size_t n = l->count;
        g->levels = k + 1;
        l->inverse = (double *)txm_arena_alloc(arena, n, sizeof(double));
        l->q = (double *)txm_arena_alloc(arena, n, sizeof(double));
        if (k > 0) {
            l->r = (double *)txm_arena_alloc(arena, n, 4 * sizeof(double));
            if (l->r) {
                l->x = l->r + n;
                l->c = l->x + n;
                l->v = l->c + n;
            }
        }
        if (arena->failed) return txi_no_memory(env);
        for (size_t i = 0; i < n; i++) {
            double sum = earth[i];
            for (uint32_t j = l->first[i]; j < l->first[i + 1]; j++)
                sum += l->to[j] == i ? 0 : (double)l->weight[j];
            l->inverse[i] = sum > 0 ? 1 / sum : 1; /* 0: a node by itself, without ground */
        }
        if (n <= TXI_GRID_DIRECT || k + 1 == TXI_GRID_LEVELS) break;
        txm_arena_init(&scratch, env);
        const int ok = txi_grid_coarsen(l, l + 1, arena, &scratch);
        txm_arena_free(&scratch);
        double *sums = ok ? (double *)txm_arena_zero(arena, l[1].count, sizeof(double)) : NULL;
        if (!sums) return txi_no_memory(env);
        for (size_t i = 0; i < n; i++) sums[l->group[i]] += earth[i];
        earth = sums;
        if (l[1].count > n - n / 8) break; /* hardly any links: smoothing is enough */
    }
    const size_t n = g->level[g->levels - 1].count;
    if (n > TXI_GRID_DIRECT) return TXM_OK;
    g->direct = (double *)txm_arena_alloc(arena, n, n * sizeof(double));
    if (!g->direct) return txi_no_memory(env);
    txi_grid_factor(&g->level[g->levels - 1], g->direct);
    return TXM_OK;
}

/* Solve A x = b. x holds a guess and receives the solution; b is lost.
   tolerance  of the residual, relative to that of x = 0
   return     TXM_OK, TXM_OUT_OF_MEMORY, TXM_CANCELLED
   cost       some 10 iterations of about 0.15 us per node; 24 bytes per node               */
static txm_status txi_grid_solve(const txi_grid *g, double *b, double *x, double tolerance,
                                 const char *stage, txm_env *env) {
    const txi_grid_level *l = &g->level[0];
    const size_t n = l->count;
    txm_status status = TXM_OK;
    txm_arena arena;
    txm_arena_init(&arena, env);
    double *z = (double *)txm_arena_alloc(&arena, n, sizeof(double));
    double *p = (double *)txm_arena_alloc(&arena, n, sizeof(double));
    double *v = (double *)txm_arena_alloc(&arena, n, sizeof(double));
    if (arena.failed) {
        txm_arena_free(&arena);
        return txi_no_memory(env);
    }
    const double goal = txi_grid_dot(b, b, n) * tolerance * tolerance;
    double *r = b, first = 0, rest, curve = 0;
    txi_grid_apply(l, x, v);
    for (size_t i = 0; i < n; i++) r[i] -= v[i];
    rest = first = txi_grid_dot(r, r, n);
    float reached = 0;
    for (int k = 0; k < TXI_GRID_ITERATIONS && rest > goal; k++) {
        /* the digits gained, of those wanted */
        if (rest < first && goal > 0)
            reached = txm_maxf(reached, txm_float(log(first / rest) / log(first / goal)));
        if (txm_progress(env, txm_minf(reached, 1), stage)) {
            status = txi_stopped(env);
            break;
        }
        txi_grid_cycle(g, 0, r, z);
        /* the cycle is not the same linear map each time: z is made conjugate to the last p */
        const double back = curve > 0 ? -txi_grid_dot(z, v, n) / curve : 0;
        for (size_t i = 0; i < n; i++) p[i] = z[i] + (curve > 0 ? back * p[i] : 0);
        txi_grid_apply(l, p, v);
        curve = txi_grid_dot(p, v, n);
        if (!(curve > 0)) break; /* nothing left but rounding */
        const double step = txi_grid_dot(p, r, n) / curve;
        for (size_t i = 0; i < n; i++) {
            x[i] += step * p[i];
            r[i] -= step * v[i];
        }
        rest = txi_grid_dot(r, r, n);
    }
    txm_arena_free(&arena);
    return status;
}

/* ---- smooth fill ----------------------------------------------------------------------------
   Each map becomes a harmonic function on the missing part of the surface. Quantities are chosen so
   that they may be averaged: colours are multiplied by their alpha; the vectors of normal maps are
   turned from the axes of the texture, which differ from chart to chart, into space. Labels are not
   averaged: each texel gets that of the nearest known one.                                     */

enum { TXI_FILL_MOST = 5 }; /* quantities of a map */

/* How the samples of a map are treated. */
typedef struct txi_quantities {
    const txm_image *image;
    int count;     /* of quantities                                                            */
    int is_normal; /* 1 or 2, as in texinpaint_map                                             */
    int has_alpha; /* the last channel is alpha, and the others are multiplied by it           */
} txi_quantities;

static txi_quantities txi_quantities_of(const txi_domain *d, int map) {
    const texinpaint_map *m = map ? &d->desc->maps[map - 1] : NULL;
    txi_quantities q;
    q.image = &d->maps[map];
    q.is_normal = m ? m->is_normal : 0;
    q.has_alpha = txi_has_alpha(d, map);
    q.count = q.image->channels + (q.is_normal && d->surface ? 1 : 0);
    return q;
}

/* The directions in space of the x and y axes of a normal map at a texel: unit. */
static void txi_tangents(const txi_domain *d, uint32_t texel, int is_normal, txm_dvec3 axis[2]) {
    const uint32_t face = d->surface->owner[texel];
    txm_dvec3 pu, pv;
    axis[0] = txm_d3(1, 0, 0);
    axis[1] = txm_d3(0, 1, 0);
    if (face == TXI_NO_FACE || !txi_face_axes(d->surface, face, &pu, &pv)) return;
    const txm_dvec3 n = txm_d3_unit(txi_face_area2(d->surface, face));
    const txm_dvec3 y = txm_d3_cross(n, txm_d3_unit(pu));
    if (!(txm_d3_len2(y) > 0.5)) return;
    /* at a right angle to x, on the side of v, which runs downwards */
    const int down = txm_d3_dot(y, pv) > 0;
    axis[0] = txm_d3_unit(pu);
    axis[1] = txm_d3_scale(y, down == (is_normal == 2) ? 1 : -1);
}

/* The quantities of a texel. */
static void txi_quantities_get(const txi_domain *d, const txi_quantities *q, uint32_t texel,
                               double out[TXI_FILL_MOST]) {
    const int x = (int)(texel % (uint32_t)d->width), y = (int)(texel / (uint32_t)d->width);
    const int channels = q->image->channels;
    for (int c = 0; c < channels; c++) out[c] = (double)txm_image_get(q->image, x, y, c);
    for (int c = 0; c + 1 < channels && q->has_alpha; c++)
        out[c] *= fmin(fmax(out[channels - 1], 0), 1);
    for (int c = 0; c < 3 && q->is_normal; c++)
        out[c] = txm_normal_decode(out[c], q->image->sample);
    if (q->is_normal && d->surface) { /* the vector in the tangent plane, as one in space */
        txm_dvec3 axis[2];
        txi_tangents(d, texel, q->is_normal, axis);
        const txm_dvec3 v = txm_d3_mad(txm_d3_scale(axis[0], out[0]), axis[1], out[1]);
        const double height = out[2], rest = out[3];
        out[0] = v.x;
        out[1] = v.y;
        out[2] = v.z;
        out[3] = height;
        out[4] = rest;
    }
}

/* Store a texel by its quantities. */
static void txi_quantities_set(const txi_domain *d, const txi_quantities *q, uint32_t texel,
                               double in[TXI_FILL_MOST]) {
    const int x = (int)(texel % (uint32_t)d->width), y = (int)(texel / (uint32_t)d->width);
    const int channels = q->image->channels;
    if (q->is_normal) {
        if (d->surface) {
            txm_dvec3 axis[2];
            const txm_dvec3 v = txm_d3(in[0], in[1], in[2]);
            txi_tangents(d, texel, q->is_normal, axis);
            in[0] = txm_d3_dot(v, axis[0]);
            in[1] = txm_d3_dot(v, axis[1]);
            in[2] = in[3];
            in[3] = in[4];
        }
        const double n = sqrt(in[0] * in[0] + in[1] * in[1] + in[2] * in[2]);
        for (int c = 0; c < 3; c++)
            in[c] = txm_normal_encode(n > 1e-6 ? in[c] / n : c == 2, q->image->sample);
    }
    for (int c = 0; c + 1 < channels && q->has_alpha; c++)
        in[c] = in[channels - 1] > 1e-6 ? in[c] / fmin(in[channels - 1], 1) : 0;
    for (int c = 0; c < channels; c++) txm_image_set(q->image, x, y, c, txm_float(in[c]));
}

/* The mean quantities of all known texels, for holes without any around them. */
static void txi_quantities_mean(const txi_domain *d, const txi_quantities *q, const uint8_t *marks,
                                double mean[TXI_FILL_MOST]) {
    const size_t texels = (size_t)d->width * (size_t)d->height;
    size_t count = 0;
    memset(mean, 0, TXI_FILL_MOST * sizeof *mean);
    for (size_t i = 0; i < texels; i++) {
        double value[TXI_FILL_MOST];
        if (marks[i] != TXI_NODE_KNOWN) continue;
        txi_quantities_get(d, q, (uint32_t)i, value);
        for (int c = 0; c < q->count; c++) mean[c] += value[c];
        count++;
    }
    for (int c = 0; c < q->count && count; c++) mean[c] /= (double)count;
}

/* ---- Poisson equation on the surface --------------------------------------------------------- */

/* The equation for one graph; for any number of right sides. */
typedef struct txi_poisson_system {
    const txi_texel_graph *g;
    txi_grid grid;
    double screen;
    uint8_t *anchor; /* 1 per node: 1 for one node of each part that is not connected with the
                        rim                                                                      */
} txi_poisson_system;

/* What is given along the links of a graph, in the order of their rows. */
typedef struct txi_steps {
    const float *link; /* 1 per link of `to`: how much u rises from the node to its neighbour;
                          the other way round the same with the other sign. NULL: 0              */
    const float *rim;  /* 1 per link of `rim`, likewise. NULL: 0                                */
    const float *rim_value; /* 1 per link of `rim`: u there                                     */
} txi_steps;

/* screen: 0 or more, see txi_surface_poisson. */
static txm_status txi_poisson_make(const txi_texel_graph *g, double screen, txm_arena *arena,
                                   txm_env *env, txi_poisson_system *s) {
    const size_t n = g->count;
    txm_arena scratch;
    txm_arena_init(&scratch, env);
    s->g = g;
    s->screen = screen;
    s->anchor = (uint8_t *)txm_arena_alloc(arena, n, 1);
    double *ground = (double *)txm_arena_zero(&scratch, n, sizeof(double));
    uint32_t *queue = (uint32_t *)txm_arena_alloc(&scratch, n, sizeof(uint32_t));
    if (arena->failed || scratch.failed) {
        txm_arena_free(&scratch);
        return txi_no_memory(env);
    }
    txi_graph_islands(g, queue, s->anchor);
    for (size_t i = 0; i < n; i++) {
        if (s->anchor[i]) { /* the first of its island: the others need no ground */
            txi_graph_spread(g, (uint32_t)i, queue, s->anchor);
            s->anchor[i] = !(screen > 0);
        }
        ground[i] = screen + s->anchor[i];
        for (uint32_t k = g->rim_first[i]; k < g->rim_first[i + 1]; k++)
            ground[i] += (double)g->rim_weight[k];
    }
    const txm_status status =
        txi_grid_make(n, g->first, g->to, g->weight, ground, arena, env, &s->grid);
    txm_arena_free(&scratch);
    return status;
}

/* The u that has the given values at the rim and whose differences along the links come nearest to
   the given steps: the Poisson equation on the surface, across the seams of the atlas:

       minimise  sum over links  w (u_j - u_i - step)^2  +  screen sum (u_i - u0_i)^2

   Without steps and screen it is the harmonic function with these values.
   u          on entry u0, which is also the first guess; receives the solution. A part that is not
              connected with the rim (screen 0) keeps the u0 of one of its nodes as its level
   scratch    room for 1 per node
   tolerance  of the residual, relative
   return     TXM_OK, TXM_OUT_OF_MEMORY, TXM_CANCELLED: u is then of no use
   cost       some 10 iterations of about 0.15 us per node                                  */
static txm_status txi_surface_poisson(const txi_poisson_system *s, const txi_steps *steps,
                                      double *u, double *scratch, double tolerance, txm_env *env) {
    const txi_texel_graph *g = s->g;
    for (size_t i = 0; i < g->count; i++) {
        double sum = (s->screen + s->anchor[i]) * u[i];
        for (uint32_t k = g->first[i]; k < g->first[i + 1] && steps->link; k++)
            sum -= (double)g->weight[k] * steps->link[k];
        for (uint32_t k = g->rim_first[i]; k < g->rim_first[i + 1]; k++) {
            const double rise = steps->rim ? (double)steps->rim[k] : 0;
            sum += (double)g->rim_weight[k] * (steps->rim_value[k] - rise);
        }
        scratch[i] = sum;
    }
    return txi_grid_solve(&s->grid, scratch, u, tolerance, "smooth fill", env);
}

/* ---- smooth fill: labels -------------------------------------------------------------------- */

/* where a texel lies: in space, or in the picture */
static txm_dvec3 txi_fill_point(const txi_domain *d, uint32_t texel) {
    if (d->surface) return txi_texel_point(d, d->surface->owner[texel], texel);
    const int y = (int)(texel / (uint32_t)d->width);
    return txm_d3((int)(texel % (uint32_t)d->width), y, 0);
}

/* For each node the known texel that is nearest, of those at the rim that its neighbours have:
   distances in a straight line, spread from the rim along the links until nothing changes. It is
   nearest to within a texel. Nodes of islands get UINT32_MAX. */
static txm_status txi_nearest_known(const txi_domain *d, const txi_texel_graph *g, uint32_t *source,
                                    txm_env *env) {
    txm_arena scratch;
    size_t head = 0, waiting = 0;
    txm_arena_init(&scratch, env);
    txm_dvec3 *point = (txm_dvec3 *)txm_arena_alloc(&scratch, g->count, sizeof(txm_dvec3));
    double *least = (double *)txm_arena_alloc(&scratch, g->count, sizeof(double));
    /* a ring */
    uint32_t *queue = (uint32_t *)txm_arena_alloc(&scratch, g->count, sizeof(uint32_t));
    uint8_t *queued = (uint8_t *)txm_arena_zero(&scratch, g->count, 1);
    if (scratch.failed) {
        txm_arena_free(&scratch);
        return txi_no_memory(env);
    }
    for (size_t i = 0; i < g->count; i++) {
        point[i] = txi_fill_point(d, g->texel[i]);
        source[i] = UINT32_MAX;
        least[i] = 0;
        for (uint32_t k = g->rim_first[i]; k < g->rim_first[i + 1]; k++) {
            const double apart = txm_d3_dist2(point[i], txi_fill_point(d, g->rim[k]));
            if (source[i] != UINT32_MAX && !(apart < least[i])) continue;
            source[i] = g->rim[k];
            least[i] = apart;
        }
        if (source[i] == UINT32_MAX) continue;
        queue[waiting++] = (uint32_t)i;
        queued[i] = 1;
    }
    while (waiting > 0) {
        const uint32_t i = queue[head];
        head = head + 1 < g->count ? head + 1 : 0;
        waiting--;
        queued[i] = 0;
        const txm_dvec3 from = txi_fill_point(d, source[i]);
        for (uint32_t k = g->first[i]; k < g->first[i + 1]; k++) {
            const uint32_t j = g->to[k];
            const double apart = txm_d3_dist2(point[j], from);
            if (source[j] != UINT32_MAX && !(apart < least[j])) continue;
            source[j] = source[i];
            least[j] = apart;
            if (queued[j]) continue;
            queued[j] = 1;
            const size_t end = head + waiting;
            TXM_ASSERT(waiting < g->count);
            queue[end < g->count ? end : end - g->count] = j;
            waiting++;
        }
    }
    txm_arena_free(&scratch);
    return TXM_OK;
}

/* The label of the nearest known texel; the first known one of the map where there is none. */
static void txi_fill_labels(const txi_domain *d, const txi_texel_graph *g, int map,
                            const uint32_t *source, const uint8_t *marks) {
    const txm_image *image = &d->maps[map];
    const size_t bytes = (size_t)image->channels * txm_sample_bytes(image->sample);
    const size_t texels = (size_t)d->width * (size_t)d->height;
    uint8_t *pixels = (uint8_t *)image->pixels; /* packed rows */
    size_t any = 0;
    while (any + 1 < texels && marks[any] != TXI_NODE_KNOWN) any++;
    for (size_t i = 0; i < g->count; i++) {
        const size_t from = source[i] == UINT32_MAX ? any : source[i];
        memcpy(pixels + bytes * g->texel[i], pixels + bytes * from, bytes);
    }
}

/* ---- smooth fill: equations ------------------------------------------------------------------ */

/* The error that is left, relative to the right side: well below a step of the samples. */
static double txi_fill_tolerance(txm_sample sample) {
    return sample == TXM_U8 ? 1e-4 : sample == TXM_U16 ? 1e-6 : 1e-7;
}

/* Fill one map of the nodes: its quantities are known at the rim. */
static txm_status txi_fill_map(const txi_domain *d, const txi_poisson_system *s, int map,
                               const uint8_t *marks, txm_arena *arena, txm_env *env) {
    const txi_quantities q = txi_quantities_of(d, map);
    const txi_texel_graph *g = s->g;
    const size_t n = g->count, rims = g->rim_first[n];
    double mean[TXI_FILL_MOST], value[TXI_FILL_MOST];
    float *rim = (float *)txm_arena_alloc(arena, rims + 1, (size_t)q.count * sizeof(float));
    double *u = (double *)txm_arena_alloc(arena, n, (size_t)q.count * sizeof(double));
    double *scratch = (double *)txm_arena_alloc(arena, n, sizeof(double));
    if (arena->failed) return txi_no_memory(env);
    txi_quantities_mean(d, &q, marks, mean);
    for (size_t k = 0; k < rims; k++) {
        txi_quantities_get(d, &q, g->rim[k], value);
        for (int c = 0; c < q.count; c++) rim[(size_t)c * rims + k] = txm_float(value[c]);
    }
    for (int c = 0; c < q.count; c++) {
        const txi_steps steps = {NULL, NULL, rim + (size_t)c * rims};
        txi_stage stage;
        for (size_t i = 0; i < n; i++) u[(size_t)c * n + i] = mean[c]; /* stays so without a rim */
        txi_stage_begin(&stage, env, (float)c / (float)q.count, (float)(c + 1) / (float)q.count);
        const txm_status status =
            txi_surface_poisson(s, &steps, u + (size_t)c * n, scratch,
                                txi_fill_tolerance(q.image->sample), &stage.env);
        if (status != TXM_OK) return txi_stage_end(&stage, status);
    }
    for (size_t i = 0; i < n; i++) {
        for (int c = 0; c < q.count; c++) value[c] = u[(size_t)c * n + i];
        txi_quantities_set(d, &q, g->texel[i], value);
    }
    return TXM_OK;
}

/* Fill the label maps. */
static txm_status txi_fill_all_labels(const txi_domain *d, const txi_texel_graph *g,
                                      const uint8_t *marks, txm_arena *arena, txm_env *env) {
    uint32_t *source = (uint32_t *)txm_arena_alloc(arena, g->count, sizeof(uint32_t));
    if (!source) return txi_no_memory(env);
    const txm_status status = txi_nearest_known(d, g, source, env);
    for (int map = 0; map < d->map_count && status == TXM_OK; map++) {
        if (txi_is_label(d, map)) txi_fill_labels(d, g, map, source, marks);
    }
    return status;
}

/* Fill the unknown texels of all maps. */
static txm_status txi_fill_nodes(const txi_domain *d, const uint8_t *marks, txm_arena *arena,
                                 txm_env *env) {
    txi_texel_graph g;
    txi_poisson_system system;
    int labels = 0;
    txm_status status = txi_graph_make(d, marks, arena, env, &g);
    if (status != TXM_OK || g.count == 0) return status;
    for (int map = 0; map < d->map_count; map++) labels += txi_is_label(d, map);
    if (labels) status = txi_fill_all_labels(d, &g, marks, arena, env);
    if (status == TXM_OK) status = txi_poisson_make(&g, 0, arena, env, &system);
    for (int map = 0; map < d->map_count && status == TXM_OK; map++) {
        txi_stage stage;
        txm_arena scratch;
        if (txi_is_label(d, map)) continue;
        txm_arena_init(&scratch, env);
        txi_stage_begin(&stage, env, (float)map / (float)d->map_count,
                        (float)(map + 1) / (float)d->map_count);
        status = txi_stage_end(&stage,
                               txi_fill_map(d, &system, map, marks, &scratch, &stage.env));
        txm_arena_free(&scratch);
    }
    return status;
}

/* Fill the missing texels that a chart covers smoothly, in all maps. d->missing is not changed.
   return  TXM_OK, TXM_TOO_SMALL if nothing is known, TXM_TOO_LARGE, TXM_OUT_OF_MEMORY,
           TXM_CANCELLED; after these the missing texels of some maps may be filled
   cost    about 3 us per missing texel for three channels, 300 bytes                       */
static txm_status txi_harmonic_fill(const txi_domain *d, txm_env *env) {
    const size_t texels = (size_t)d->width * (size_t)d->height;
    size_t known = 0, unknown = 0;
    txm_arena arena;
    txm_arena_init(&arena, env);
    uint8_t *marks = (uint8_t *)txm_arena_alloc(&arena, texels, 1);
    if (!marks) return txi_no_memory(env);
    for (size_t i = 0; i < texels; i++) {
        marks[i] = (uint8_t)(!d->covered[i]    ? TXI_NODE_NONE
                             : !d->missing[i] ? TXI_NODE_KNOWN
                                              : TXI_NODE_UNKNOWN);
        known += marks[i] == TXI_NODE_KNOWN;
        unknown += marks[i] == TXI_NODE_UNKNOWN;
    }
    txm_status status = TXM_OK;
    if (unknown > 0 && known == 0)
        status = txm_fail(env, TXM_TOO_SMALL, "nothing in the charts is known");
    else if (unknown > 0)
        status = txi_fill_nodes(d, marks, &arena, env);
    txm_arena_free(&arena);
    return status;
}

/* ---- smooth fill: public calls --------------------------------------------------------------- */

/* Copy the maps out. */
static void txi_deliver(const txi_domain *d, const txm_image *out) {
    for (int map = 0; map < d->map_count; map++) txi_copy_picture(&d->maps[map], &out[map]);
}

TEXINPAINT_API txm_status texinpaint_harmonic(const texinpaint_desc *desc, txm_env *env,
                                              const txm_image *out) {
    txi_domain d;
    txi_stage stage;
    txm_arena arena;
    txm_status status = txi_check_common(desc, env);
    if (status == TXM_OK) status = txi_check_mask(&desc->mask, "mask", &desc->image, env);
    if (status == TXM_OK) status = txi_check_outputs(desc, out, 1 + desc->map_count, env);
    if (status != TXM_OK) return status;
    txm_arena_init(&arena, env);
    status = txi_domain_make(&d, desc, &arena, env);
    if (status == TXM_OK) status = txi_surface_make(&d, &arena, env);
    if (status == TXM_OK) {
        txi_stage_begin(&stage, env, 0, 0.95f);
        status = txi_stage_end(&stage, txi_harmonic_fill(&d, &stage.env));
    }
    if (status == TXM_OK && txm_progress(env, 0.95f, "gutters")) status = txi_stopped(env);
    if (status == TXM_OK) {
        const size_t texels = (size_t)d.width * (size_t)d.height;
        size_t filled;
        for (size_t i = 0; i < texels; i++) {
            if (d.covered[i]) d.missing[i] = 0;
        }
        status = txi_gutter(&d, &arena, env, &filled);
    }
    if (status == TXM_OK) status = txi_bleed(&d, env);
    if (status == TXM_OK) txi_deliver(&d, out);
    txm_arena_free(&arena);
    return status;
}

/* What is spread and what is filled. */
enum { TXI_SPREAD_NOT = 0, TXI_SPREAD_FROM = 1, TXI_SPREAD_TO = 2 };

/* Is the pixel fully transparent? */
static int txi_is_clear(const txm_image *image, int x, int y) {
    return image->channels % 2 == 0 && !(txm_image_get(image, x, y, image->channels - 1) > 0);
}

/* Mark the texels; returns how many there are to spread. is_solid: the picture's transparent pixels
   are filled with colour, and stay transparent. */
static size_t txi_spread_marks(const txi_domain *d, int is_solid, uint8_t *marks) {
    size_t known = 0;
    for (int y = 0; y < d->height; y++) {
        for (int x = 0; x < d->width; x++) {
            const size_t i = (size_t)y * (size_t)d->width + (size_t)x;
            const int missing = is_solid ? txi_is_clear(&d->maps[0], x, y) : d->missing[i];
            const int fills = d->surface ? !d->covered[i] : missing;
            marks[i] = fills ? TXI_SPREAD_TO : missing ? TXI_SPREAD_NOT : TXI_SPREAD_FROM;
            known += marks[i] == TXI_SPREAD_FROM;
        }
    }
    return known;
}

/* Give texels the values of the nearest one that is spread, at most `reach` away
   (0: any distance). */
static txm_status txi_spread(const txi_domain *d, uint8_t *marks, int is_solid, int reach,
                             txm_env *env) {
    const size_t texels = (size_t)d->width * (size_t)d->height;
    const txm_image *image = &d->maps[0];
    const size_t bytes = txm_sample_bytes(image->sample), pixel = (size_t)image->channels * bytes;
    txm_arena scratch;
    txm_arena_init(&scratch, env);
    int32_t *nearest = (int32_t *)txm_arena_alloc(&scratch, texels, sizeof(int32_t));
    uint8_t *from = (uint8_t *)txm_arena_alloc(&scratch, texels, 1);
    txm_status status = scratch.failed ? txi_no_memory(env) : TXM_OK;
    for (size_t i = 0; i < texels && status == TXM_OK; i++) from[i] = marks[i] == TXI_SPREAD_FROM;
    if (status == TXM_OK) status = txi_nearest(from, d->width, d->height, env, nearest);
    for (size_t i = 0; i < texels && status == TXM_OK; i++) {
        if (marks[i] != TXI_SPREAD_TO || nearest[i] < 0) continue;
        const int64_t dx = (int64_t)(i % (size_t)d->width) - nearest[i] % d->width;
        const int64_t dy = (int64_t)(i / (size_t)d->width) - nearest[i] / d->width;
        if (reach > 0 && dx * dx + dy * dy > (int64_t)reach * reach) continue;
        txi_copy_texel(d, (size_t)nearest[i], i);
        if (is_solid) memset((uint8_t *)image->pixels + (i + 1) * pixel - bytes, 0, bytes);
    }
    txm_arena_free(&scratch);
    return status;
}

TEXINPAINT_API txm_status texinpaint_dilate(const texinpaint_desc *desc, txm_env *env,
                                            const txm_image *out) {
    txi_domain d;
    txm_arena arena;
    uint8_t *marks = NULL;
    txm_status status = txi_check_common(desc, env);
    if (status == TXM_OK && desc->mask.pixels)
        status = txi_check_mask(&desc->mask, "mask", &desc->image, env);
    if (status == TXM_OK) status = txi_check_outputs(desc, out, 1 + desc->map_count, env);
    if (status != TXM_OK) return status;
    const int is_solid = !desc->mask.pixels && desc->mesh.face_count == 0;
    txm_arena_init(&arena, env);
    status = txi_domain_make(&d, desc, &arena, env);
    if (status == TXM_OK && txm_progress(env, 0, "gutters")) status = txi_stopped(env);
    if (status == TXM_OK) status = txi_surface_make(&d, &arena, env);
    if (status == TXM_OK) {
        marks = (uint8_t *)txm_arena_alloc(&arena, (size_t)d.width * (size_t)d.height, 1);
        if (!marks) status = txi_no_memory(env);
    }
    if (status == TXM_OK && txi_spread_marks(&d, is_solid, marks) == 0)
        status = txm_fail(env, TXM_TOO_SMALL, "no texel has a colour that could be spread");
    if (status == TXM_OK && txm_progress(env, 0.5f, "gutters")) status = txi_stopped(env);
    if (status == TXM_OK && desc->gutter >= 0)
        status = txi_spread(&d, marks, is_solid, desc->gutter, env);
    if (status == TXM_OK) txi_deliver(&d, out);
    txm_arena_free(&arena);
    return status;
}

/* ---- curvature ------------------------------------------------------------------------------
   Principal curvatures, their directions, and their derivatives along these, at the vertices of a
   mesh, from a local cubic [2, section 2]. In the frame (T, B, N) of a vertex, N its normal, the
   surface is the graph of a height below the tangent plane,

       h(x, y) = (b0 x^2 + 2 b1 x y + b2 y^2) / 2 + (c0 x^3 + 3 c1 x^2 y + 3 c2 x y^2 + c3 y^3) / 6

   fitted by least squares to the places and the normals of the neighbours (the normals give dh/dx
   and dh/dy). Not in [2]: the normals come from a fit of their own, of places alone and with linear
   terms. Mean normals of faces are off by so much where triangles are irregular that e gets a wrong
   sign. The eigenvalues and eigenvectors of (b0 b1; b1 b2) are the curvatures k and directions t,
   convex surfaces having positive k, and the derivative of k along its own t is

       e = dk/dt = c0 t1^3 + 3 c1 t1^2 t2 + 3 c2 t1 t2^2 + c3 t2^3                              */

enum {
    TXI_FIT_TERMS = 9,       /* coefficients of a cubic: b0 b1 b2 c0 c1 c2 c3, and linear ones  */
    TXI_FIT_CURVED = 7,      /* the same without linear ones                                   */
    TXI_FIT_RINGS = 2,       /* rings of neighbours in a fit; as in [2]                        */
    TXI_FIT_MOST_RINGS = 8,
    TXI_FIT_MOST = 96,       /* vertices in a fit; ours: bounds the time where many edges meet */
    TXI_FIT_STAR = 48,       /* edges of a vertex that are followed, evenly chosen; ours       */
    TXI_FIT_LEAST = 5,       /* vertices in a fit, each gives up to three equations; ours      */
    TXI_FIT_CHUNK = 512,     /* vertices per task                                              */
    TXI_FIT_BATCH = 32       /* tasks between two progress reports                             */
};

/* Of one vertex; [0] the larger, [1] the smaller curvature. */
typedef struct txi_curvature {
    double k[2], e[2]; /* in 1 / unit of the mesh, and 1 / unit^2                              */
    txm_dvec3 t[2];    /* unit                                                                 */
    int is_valid;      /* 0: too few neighbours, all else is 0                                 */
} txi_curvature;

/* A welded mesh with its edges. */
typedef struct txi_shape {
    txm_mesh mesh;
    size_t edge_count;
    uint32_t *ends;       /* 2 per edge: its vertices, the lower first                         */
    uint32_t *edge;       /* 1 per side of a face                                              */
    uint32_t *star_first; /* vertex_count + 1: where the neighbours of a vertex begin          */
    uint32_t *star;       /* 2 per edge: neighbours                                            */
    txm_dvec3 *normal;    /* 1 per vertex: unit, outwards; 0 where there is none               */
    txm_dvec3 *fitted;    /* 1 per vertex: the better normal                                   */
    txi_curvature *curvature; /* 1 per vertex                                                  */
    int rings;
} txi_shape;

/* A mesh of triangles as one whose vertices in equal places are one (files repeat them for each
   chart), without the faces of which two corners are in one place. The input is checked. */
static txm_status txi_welded_make(const txm_mesh *input, txm_arena *arena, txm_env *env,
                                  txm_mesh *welded) {
    txi_surface points;
    size_t count = 0;
    memset(&points, 0, sizeof points);
    memset(welded, 0, sizeof *welded);
    if (input->face_count == 0) return TXM_OK;
    uint32_t *number = (uint32_t *)txm_arena_alloc(arena, input->vertex_count, sizeof(uint32_t));
    uint32_t *indices = (uint32_t *)txm_arena_alloc(arena, input->face_count, 3 * sizeof(uint32_t));
    float *place = (float *)txm_arena_alloc(arena, input->vertex_count, 3 * sizeof(float));
    if (arena->failed) return txi_no_memory(env);
    const txm_status status = txi_weld(input, &points, number, arena, env);
    if (status != TXM_OK) return status;
    for (size_t v = 0; v < input->vertex_count; v++)
        memcpy(place + 3 * (size_t)number[v], input->positions + 3 * v, 3 * sizeof(float));
    for (size_t f = 0; f < input->face_count; f++) {
        uint32_t *t = indices + 3 * count;
        for (size_t k = 0; k < 3; k++) t[k] = number[input->indices[3 * f + k]];
        count += t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
    }
    welded->positions = place;
    welded->indices = indices;
    welded->vertex_count = points.vertex_count;
    welded->face_count = count;
    return TXM_OK;
}

/* Number the edges and collect the neighbours. sorted: room for 2 per side. */
static void txi_shape_edges(txi_shape *s, uint32_t *sorted) {
    const txm_mesh *mesh = &s->mesh;
    const size_t sides = txm_mesh_sides(mesh), n = mesh->vertex_count;
    txm_mesh_sort_sides(mesh, sorted);
    s->edge_count = 0;
    memset(s->star_first, 0, (n + 1) * sizeof *s->star_first);
    for (size_t i = 0, end; i < sides; i = end) {
        uint32_t *ends = s->ends + 2 * s->edge_count;
        end = txm_mesh_edge_end(mesh, sorted, i);
        ends[0] = txm_mesh_low(mesh, sorted[i]);
        ends[1] = txm_mesh_high(mesh, sorted[i]);
        for (size_t k = i; k < end; k++) s->edge[sorted[k]] = (uint32_t)s->edge_count;
        for (int k = 0; k < 2; k++) s->star_first[ends[k] + 1]++;
        s->edge_count++;
    }
    for (size_t v = 0; v < n; v++) s->star_first[v + 1] += s->star_first[v];
    for (size_t e = s->edge_count; e-- > 0;) { /* from the last place of each star to its first */
        const uint32_t a = s->ends[2 * e], b = s->ends[2 * e + 1];
        s->star[--s->star_first[a + 1]] = b;
        s->star[--s->star_first[b + 1]] = a;
    }
    for (size_t v = 0; v < n; v++) s->star_first[v] = s->star_first[v + 1];
    s->star_first[n] = (uint32_t)(2 * s->edge_count);
}

/* Which faces are to be turned over so that those of each connected part agree, as few as possible:
   flip receives 0 or 1 for each. Edges of other than two faces connect nothing; on surfaces that
   cannot be oriented some edge stays between faces that disagree.
   next    the rings of sides at an edge (txm_mesh_link)
   queue   room for 1 per face                                                              */
static void txi_shape_orient(const txm_mesh *mesh, const uint32_t *next, uint32_t *queue,
                             uint8_t *flip) {
    enum { UNSEEN = 2 };
    memset(flip, UNSEEN, mesh->face_count);
    for (size_t f = 0; f < mesh->face_count; f++) {
        size_t count = 0, turned = 0;
        if (flip[f] != UNSEEN) continue;
        flip[f] = 0;
        queue[count++] = (uint32_t)f;
        for (size_t i = 0; i < count; i++) {
            for (size_t side = 3 * (size_t)queue[i]; side < 3 * (size_t)queue[i] + 3; side++) {
                const size_t other = next[side], g = other / 3;
                if (other == side || next[other] != side || flip[g] != UNSEEN) continue;
                flip[g] = (uint8_t)(flip[queue[i]] ^ (txm_mesh_runs_down(mesh, side) ==
                                                      txm_mesh_runs_down(mesh, other)));
                turned += flip[g];
                TXM_ASSERT(count < mesh->face_count);
                queue[count++] = (uint32_t)g;
            }
        }
        for (size_t i = 0; i < count && 2 * turned > count; i++) flip[queue[i]] ^= 1;
    }
}

/* Normals of the vertices: the sum over their corners of a x b / (|a|^2 |b|^2), a and b the two
   sides there. It is exact on a sphere, whatever the triangles (N. Max, 1999). */
static void txi_shape_normals(txi_shape *s, const uint8_t *flip) {
    const size_t n = s->mesh.vertex_count;
    for (size_t v = 0; v < n; v++) s->normal[v] = txm_d3(0, 0, 0);
    for (size_t f = 0; f < s->mesh.face_count; f++) {
        txm_dvec3 p[3];
        txm_mesh_triangle(&s->mesh, f, p);
        for (size_t k = 0; k < 3; k++) {
            const txm_dvec3 a = txm_d3_sub(p[(k + 1) % 3], p[k]),
                            b = txm_d3_sub(p[(k + 2) % 3], p[k]);
            const double size = txm_d3_len2(a) * txm_d3_len2(b);
            txm_dvec3 *sum = &s->normal[s->mesh.indices[3 * f + k]];
            if (size > 0) *sum = txm_d3_mad(*sum, txm_d3_cross(a, b), (flip[f] ? -1 : 1) / size);
        }
    }
    for (size_t v = 0; v < n; v++) s->normal[v] = txm_d3_unit(s->normal[v]);
}

/* The vertices of up to so many rings around v, v first; returns their number. */
static int txi_fit_gather(const txi_shape *s, uint32_t v, uint32_t list[TXI_FIT_MOST]) {
    enum { SLOTS = 256 };
    uint32_t table[SLOTS]; /* vertex + 1; 0 = free */
    int count = 1, from = 0;
    memset(table, 0, sizeof table);
    table[txm_hash(v) % SLOTS] = v + 1;
    list[0] = v;
    for (int ring = 0; ring < s->rings; ring++) {
        const int end = count;
        for (; from < end; from++) {
            const uint32_t first = s->star_first[list[from]], last = s->star_first[list[from] + 1];
            const uint32_t step = 1 + (last - first - 1) / TXI_FIT_STAR;
            for (uint32_t i = first; i < last; i += step) {
                size_t slot = txm_hash(s->star[i]) % SLOTS;
                while (table[slot] && table[slot] != s->star[i] + 1) slot = (slot + 1) % SLOTS;
                if (table[slot]) continue;
                if (count == TXI_FIT_MOST) return count;
                table[slot] = s->star[i] + 1;
                list[count++] = s->star[i];
            }
        }
    }
    return count;
}

/* The normal equations of a least-squares fit: the lower half of A, and b. */
typedef struct txi_fit {
    double a[TXI_FIT_TERMS][TXI_FIT_TERMS], b[TXI_FIT_TERMS];
    int terms;
} txi_fit;

static void txi_fit_add(txi_fit *fit, const double row[TXI_FIT_TERMS], double value) {
    for (int i = 0; i < fit->terms; i++) {
        for (int j = 0; j <= i; j++) fit->a[i][j] += row[i] * row[j];
        fit->b[i] += row[i] * value;
    }
}

/* Solve by Cholesky factors, in place; b receives the solution; 0 if the equations do not determine
   it. */
static int txi_fit_solve(txi_fit *fit) {
    double(*a)[TXI_FIT_TERMS] = fit->a, *b = fit->b;
    for (int i = 0; i < fit->terms; i++) {
        const double whole = a[i][i];
        for (int j = 0; j <= i; j++) {
            double sum = a[i][j];
            for (int k = 0; k < j; k++) sum -= a[i][k] * a[j][k];
            if (j < i) a[i][j] = sum / a[j][j];
            else if (sum > 1e-9 * whole) a[i][i] = sqrt(sum);
            else return 0;
        }
    }
    for (int i = 0; i < fit->terms; i++) {
        for (int k = 0; k < i; k++) b[i] -= a[i][k] * b[k];
        b[i] /= a[i][i];
    }
    for (int i = fit->terms; i-- > 0;) {
        for (int k = i + 1; k < fit->terms; k++) b[i] -= a[k][i] * b[k];
        b[i] /= a[i][i];
    }
    return 1;
}

/* Curvatures from the coefficients b0 b1 b2 c0 c1 c2 c3, in a frame whose unit is `unit`. */
static void txi_curvature_set(txi_curvature *out, const double *c, txm_dvec3 frame[2],
                              double unit) {
    const double mean = (c[0] + c[2]) / 2, half = (c[0] - c[2]) / 2;
    const double root = sqrt(half * half + c[1] * c[1]);
    /* the eigenvector of the larger value, by the longer of two formulas */
    double x = half >= 0 ? half + root : c[1], y = half >= 0 ? c[1] : root - half;
    const double length = sqrt(x * x + y * y);
    x = length > 0 ? x / length : 1;
    y = length > 0 ? y / length : 0;
    for (int i = 0; i < 2; i++) {
        const double u = i ? -y : x, v = i ? x : y;
        out->k[i] = (i ? mean - root : mean + root) / unit;
        out->e[i] = (c[3] * u * u * u + 3 * c[4] * u * u * v + 3 * c[5] * u * v * v +
                     c[6] * v * v * v) / (unit * unit);
        out->t[i] = txm_d3_add(txm_d3_scale(frame[0], u), txm_d3_scale(frame[1], v));
    }
    out->is_valid = 1;
}

/* The neighbours of a vertex in its own frame: unit is their mean distance. */
typedef struct txi_patch {
    uint32_t list[TXI_FIT_MOST]; /* the vertex itself first                                    */
    int count;
    txm_dvec3 normal, frame[2];
    double unit;
} txi_patch;

/* 0 if there are too few neighbours. */
static int txi_patch_make(const txi_shape *s, uint32_t v, txi_patch *patch) {
    const txm_dvec3 n = s->normal[v], place = txm_d3_load(s->mesh.positions + 3 * (size_t)v);
    patch->count = txi_fit_gather(s, v, patch->list);
    if (!(txm_d3_len2(n) > 0) || patch->count <= TXI_FIT_LEAST) return 0;
    const txm_dvec3 axis = fabs(n.x) <= 0.6 ? txm_d3(1, 0, 0) : txm_d3(0, 1, 0);
    patch->normal = n;
    patch->frame[0] = txm_d3_unit(txm_d3_cross(n, axis));
    patch->frame[1] = txm_d3_cross(n, patch->frame[0]);
    patch->unit = 0;
    for (int i = 1; i < patch->count; i++) {
        const txm_dvec3 p = txm_d3_load(s->mesh.positions + 3 * (size_t)patch->list[i]);
        patch->unit += txm_d3_dist(place, p) / (patch->count - 1);
    }
    return 1;
}

/* Neighbour i in the frame: x, y and depth below the tangent plane; 0 where the surface is
   folded over or another sheet, so that it is no graph over the plane. */
static int txi_patch_place(const txi_shape *s, const txi_patch *patch, int i, double *x, double *y,
                           double *depth) {
    const float *p = s->mesh.positions;
    const txm_dvec3 d = txm_d3_scale(txm_d3_sub(txm_d3_load(p + 3 * (size_t)patch->list[i]),
                                                txm_d3_load(p + 3 * (size_t)patch->list[0])),
                                     1 / patch->unit);
    *x = txm_d3_dot(d, patch->frame[0]);
    *y = txm_d3_dot(d, patch->frame[1]);
    *depth = -txm_d3_dot(d, patch->normal);
    return txm_d3_dot(s->normal[patch->list[i]], patch->normal) > 0.1;
}

/* The normal of one vertex, from places. */
static void txi_fit_normal(const txi_shape *s, uint32_t v) {
    txi_patch patch;
    txi_fit fit;
    int used = 0;
    memset(&fit, 0, sizeof fit);
    fit.terms = TXI_FIT_TERMS;
    s->fitted[v] = s->normal[v];
    if (!txi_patch_make(s, v, &patch)) return;
    for (int i = 1; i < patch.count; i++) {
        double x, y, depth;
        if (!txi_patch_place(s, &patch, i, &x, &y, &depth)) continue;
        const double row[TXI_FIT_TERMS] = {x * x / 2,     x * y,         y * y / 2,
                                           x * x * x / 6, x * x * y / 2, x * y * y / 2,
                                           y * y * y / 6, x,             y};
        txi_fit_add(&fit, row, depth);
        used++;
    }
    if (used <= TXI_FIT_TERMS || !txi_fit_solve(&fit)) return;
    const txm_dvec3 better =
        txm_d3_unit(txm_d3_add(patch.normal, txm_d3_add(txm_d3_scale(patch.frame[0], fit.b[7]),
                                                        txm_d3_scale(patch.frame[1], fit.b[8]))));
    /* at sharp edges a cubic is no description, and the mean of the faces is */
    if (txm_d3_dot(better, patch.normal) > 0.9) s->fitted[v] = better;
}

/* The curvature of one vertex, from places and normals. */
static void txi_fit_curvature(const txi_shape *s, uint32_t v) {
    txi_patch patch;
    txi_fit fit;
    int used = 0;
    memset(&s->curvature[v], 0, sizeof s->curvature[v]);
    memset(&fit, 0, sizeof fit);
    fit.terms = TXI_FIT_CURVED;
    if (!txi_patch_make(s, v, &patch)) return;
    for (int i = 1; i < patch.count; i++) {
        const txm_dvec3 m = s->normal[patch.list[i]];
        const double up = txm_d3_dot(m, patch.normal);
        double x, y, depth;
        if (!txi_patch_place(s, &patch, i, &x, &y, &depth)) continue;
        const double row[3][TXI_FIT_TERMS] = {
            {x * x / 2, x * y, y * y / 2, x * x * x / 6, x * x * y / 2, x * y * y / 2,
             y * y * y / 6, 0, 0},
            {x, y, 0, x * x / 2, x * y, y * y / 2, 0, 0, 0},
            {0, x, y, 0, x * x / 2, x * y, y * y / 2, 0, 0}};
        txi_fit_add(&fit, row[0], depth);
        txi_fit_add(&fit, row[1], txm_d3_dot(m, patch.frame[0]) / up);
        txi_fit_add(&fit, row[2], txm_d3_dot(m, patch.frame[1]) / up);
        used++;
    }
    if (used >= TXI_FIT_LEAST && txi_fit_solve(&fit))
        txi_curvature_set(&s->curvature[v], fit.b, patch.frame, patch.unit);
}

/* One batch of fits, shared out in chunks. */
typedef struct txi_fit_batch {
    const txi_shape *shape;
    size_t first;
    void (*fit)(const txi_shape *s, uint32_t v);
} txi_fit_batch;

static void txi_fit_chunk(void *context, int index) {
    const txi_fit_batch *batch = (const txi_fit_batch *)context;
    const size_t from = batch->first + (size_t)index * TXI_FIT_CHUNK;
    for (size_t i = from; i < from + TXI_FIT_CHUNK && i < batch->shape->mesh.vertex_count; i++)
        batch->fit(batch->shape, (uint32_t)i);
}

/* Fit at all vertices; progress from..to. */
static txm_status txi_fit_all(const txi_shape *s, void (*fit)(const txi_shape *s, uint32_t v),
                              double from, double to, txm_env *env) {
    const size_t n = s->mesh.vertex_count;
    txi_fit_batch batch = {s, 0, fit};
    for (; batch.first < n; batch.first += (size_t)TXI_FIT_CHUNK * TXI_FIT_BATCH) {
        const size_t rest = (n - batch.first + TXI_FIT_CHUNK - 1) / TXI_FIT_CHUNK;
        const double part = (double)batch.first / (double)n;
        if (txm_progress(env, txm_float(from + (to - from) * part), "curvature"))
            return txi_stopped(env);
        txm_parallel_for(env, rest < TXI_FIT_BATCH ? (int)rest : TXI_FIT_BATCH, txi_fit_chunk,
                         &batch);
    }
    return TXM_OK;
}

/* Edges, normals and curvatures of a welded mesh. rings: 1 or more, 0 = TXI_FIT_RINGS.
   return  TXM_OK, TXM_OUT_OF_MEMORY, TXM_CANCELLED
   cost    about 5 us per vertex with 2 rings                                               */
static txm_status txi_shape_make(const txm_mesh *welded, int rings, txm_arena *arena, txm_env *env,
                                 txi_shape *s) {
    const size_t faces = welded->face_count, n = welded->vertex_count;
    txm_arena scratch;
    memset(s, 0, sizeof *s);
    s->mesh = *welded;
    s->rings = rings ? rings : TXI_FIT_RINGS;
    if (faces == 0) return TXM_OK;
    txm_arena_init(&scratch, env);
    s->ends = (uint32_t *)txm_arena_alloc(arena, 3 * faces, 2 * sizeof(uint32_t));
    s->edge = (uint32_t *)txm_arena_alloc(arena, 3 * faces, sizeof(uint32_t));
    s->star_first = (uint32_t *)txm_arena_alloc(arena, n + 1, sizeof(uint32_t));
    s->star = (uint32_t *)txm_arena_alloc(arena, 3 * faces, 2 * sizeof(uint32_t));
    s->normal = (txm_dvec3 *)txm_arena_alloc(arena, n, sizeof(txm_dvec3));
    s->fitted = (txm_dvec3 *)txm_arena_alloc(arena, n, sizeof(txm_dvec3));
    s->curvature = (txi_curvature *)txm_arena_alloc(arena, n, sizeof(txi_curvature));
    uint32_t *sorted = (uint32_t *)txm_arena_alloc(&scratch, 3 * faces, 2 * sizeof(uint32_t));
    uint32_t *queue = (uint32_t *)txm_arena_alloc(&scratch, faces, sizeof(uint32_t));
    uint8_t *flip = (uint8_t *)txm_arena_alloc(&scratch, faces, 1);
    if (arena->failed || scratch.failed) {
        txm_arena_free(&scratch);
        return txi_no_memory(env);
    }
    txi_shape_edges(s, sorted);
    txm_mesh_link(welded, sorted, 0, sorted + 3 * faces);
    txi_shape_orient(welded, sorted + 3 * faces, queue, flip);
    txi_shape_normals(s, flip);
    txm_arena_free(&scratch);
    txm_status status = txi_fit_all(s, txi_fit_normal, 0, 0.4, env);
    if (status != TXM_OK) return status;
    s->normal = s->fitted;
    return txi_fit_all(s, txi_fit_curvature, 0.4, 0.9, env);
}

/* ---- crest lines ----------------------------------------------------------------------------
   Ridges, where the larger curvature k_max has a maximum along its own direction [2, section 3]:

       e_max = 0,   de_max / dt_max < 0,   k_max > |k_min|

   and valleys, the ridges of the surface turned inside out. Both are traced through the triangles,
   from crossing to crossing of their edges.

   Not in [2]: lines are left out whose curvature hardly falls off to their sides, relative to
   its size (k'' / k^3 has no unit; across the tip of an ellipse of axes 1 and c it is 3
   (1 - c^2)). On a sphere, a cylinder or a torus, where k_max has no extremum, they are
   artefacts of the mesh. */

enum {
    TXI_CREST_PAIRED = 8,   /* links at a node that are paired; ours                           */
    TXI_CREST_ROUNDING = 8, /* how far rounded positions are assumed to move derivatives, in
                               units of 2^-24 coordinate / edge^3; ours                          */
    TXI_CREST_NONE = -1
};
#define TXI_CREST_STRENGTH 2.0  /* default threshold: a line twice as long as its radius of
                                   curvature; ours                                               */
#define TXI_CREST_SHARE 0.02    /* and this share of the strongest line; ours                   */

#define TXI_CREST_SHARP 0.3     /* least k'' / k^3, the mean along a line; ours: on spheres and
                                   tori of thousands of triangles it stays below 0.2, on the
                                   ridges of animals and figures above 0.55                      */
#define TXI_CREST_BESIDE 0.25   /* cosine between an edge and t below which it runs along a line;
                                   ours                                                          */

/* What counts at a vertex for ridges or for valleys. */
typedef struct txi_crest_value {
    double k, e; /* of the surface, or of the surface inside out                                */
    txm_dvec3 t;
    int is_candidate;
} txi_crest_value;

static txi_crest_value txi_crest_value_of(const txi_curvature *c, int is_valley) {
    txi_crest_value v;
    v.k = is_valley ? -c->k[1] : c->k[0];
    v.e = is_valley ? -c->e[1] : c->e[0];
    v.t = c->t[is_valley];
    v.is_candidate = c->is_valid && v.k > fabs(c->k[!is_valley]);
    return v;
}

/* The lines of one kind as a graph: nodes where they cross edges (and inside triangles where three
   meet), links between them. */
typedef struct txi_crest_net {
    txm_dvec3 *place; /* 1 per node                                                             */
    double *k;        /* 1 per node: the curvature                                              */
    double *sharp;    /* 1 per node: k'' / k^3                                                  */
    uint32_t *link;   /* 2 per link: its nodes                                                  */
    int64_t *mate;    /* 2 per link: the end of another link that continues the line here, as
                         2 * link + end, or TXI_CREST_NONE                                       */
    size_t node_count, link_count;
} txi_crest_net;

/* Where a line crosses an edge. */
typedef struct txi_crest_crossing {
    double at;       /* 0..1 from the first end                                                 */
    double k, sharp; /* curvature there, and k'' / k^3                                          */
} txi_crest_crossing;

/* Does a line cross the edge a b? The signs of t, and with it of e, are arbitrary: those of b
   are turned to agree with a. */
static int txi_crest_crosses(const txi_shape *s, size_t edge, int is_valley, double rounding,
                             txi_crest_crossing *crossing) {
    const uint32_t a = s->ends[2 * edge], b = s->ends[2 * edge + 1];
    const txi_crest_value p = txi_crest_value_of(&s->curvature[a], is_valley);
    const txi_crest_value q = txi_crest_value_of(&s->curvature[b], is_valley);
    if (!p.is_candidate || !q.is_candidate) return 0;
    const double turn = txm_d3_dot(p.t, q.t) < 0 ? -1 : 1, e = turn * q.e;
    if ((p.e < 0) == (e < 0)) return 0;
    const txm_dvec3 d = txm_d3_sub(txm_d3_load(s->mesh.positions + 3 * (size_t)b),
                                   txm_d3_load(s->mesh.positions + 3 * (size_t)a));
    const double length = txm_d3_len(d), jump = fabs(p.e) + fabs(e);
    const int is_rounding = !(jump * length * length * length > rounding);
    /* a maximum: from one of the two the curvature rises towards the other. Where a line runs
       along an edge that cannot be told, and the edges beside it decide */
    const double along = txm_d3_dot(p.t, d), back = -txm_d3_dot(q.t, d) * turn;
    const int is_beside = fmax(fabs(along), fabs(back)) < TXI_CREST_BESIDE * length;
    if (!is_rounding && !is_beside && !(p.e * along > 0) && !(e * back > 0)) return 0;
    crossing->at = jump > 0 ? fabs(p.e) / jump : 0.5;
    crossing->k = p.k + (q.k - p.k) * crossing->at;
    crossing->sharp = is_rounding ? 0 : jump / length / (crossing->k * crossing->k * crossing->k);
    return 1;
}

/* Find the crossings, node[edge] receives their nodes or UINT32_MAX, and count the links. */
static txm_status txi_crest_nodes(const txi_shape *s, int is_valley, txm_arena *arena,
                                  uint32_t *node, txi_crest_net *net, txm_env *env) {
    size_t crossings = 0, centres = 0;
    double rounding = 0;
    txi_crest_crossing crossing;
    for (size_t i = 0; i < 3 * s->mesh.face_count; i++) {
        const txm_dvec3 p = txm_mesh_point(&s->mesh, i);
        rounding = fmax(rounding, fmax(fabs(p.x), fmax(fabs(p.y), fabs(p.z))));
    }
    rounding *= (double)TXI_CREST_ROUNDING / 16777216.0;
    for (size_t i = 0; i < s->edge_count; i++) {
        const int crosses = txi_crest_crosses(s, i, is_valley, rounding, &crossing);
        node[i] = crosses ? (uint32_t)crossings++ : UINT32_MAX;
    }
    net->node_count = crossings;
    net->link_count = 0;
    for (size_t f = 0; f < s->mesh.face_count; f++) {
        int count = 0;
        for (int i = 0; i < 3; i++) count += node[s->edge[3 * f + (size_t)i]] != UINT32_MAX;
        net->link_count += count == 2 ? 1 : count == 3 ? 3 : 0;
        centres += count == 3;
    }
    net->node_count += centres;
    if (net->node_count == 0) return TXM_OK;
    net->place = (txm_dvec3 *)txm_arena_alloc(arena, net->node_count, sizeof(txm_dvec3));
    net->k = (double *)txm_arena_alloc(arena, net->node_count, sizeof(double));
    net->sharp = (double *)txm_arena_alloc(arena, net->node_count, sizeof(double));
    net->link = (uint32_t *)txm_arena_alloc(arena, net->link_count, 2 * sizeof(uint32_t));
    net->mate = (int64_t *)txm_arena_alloc(arena, net->link_count, 2 * sizeof(int64_t));
    if (arena->failed) return txi_no_memory(env);
    for (size_t i = 0; i < s->edge_count; i++) {
        if (node[i] == UINT32_MAX) continue;
        txi_crest_crosses(s, i, is_valley, rounding, &crossing);
        const txm_dvec3 p = txm_d3_load(s->mesh.positions + 3 * (size_t)s->ends[2 * i]);
        const txm_dvec3 q = txm_d3_load(s->mesh.positions + 3 * (size_t)s->ends[2 * i + 1]);
        net->place[node[i]] = txm_d3_mad(p, txm_d3_sub(q, p), crossing.at);
        net->k[node[i]] = crossing.k;
        net->sharp[node[i]] = crossing.sharp;
    }
    return TXM_OK;
}

/* Link the crossings of each triangle: two with each other, three with a node in their middle. */
static void txi_crest_links(const txi_shape *s, const uint32_t *node, txi_crest_net *net) {
    size_t links = 0, centre = 0;
    for (size_t i = 0; i < s->edge_count; i++) centre += node[i] != UINT32_MAX;
    for (size_t f = 0; f < s->mesh.face_count; f++) {
        uint32_t n[3];
        int count = 0;
        for (size_t i = 0; i < 3; i++) {
            if (node[s->edge[3 * f + i]] != UINT32_MAX) n[count++] = node[s->edge[3 * f + i]];
        }
        if (count == 2) {
            TXM_ASSERT(links < net->link_count);
            net->link[2 * links] = n[0];
            net->link[2 * links++ + 1] = n[1];
        } else if (count == 3) {
            txm_dvec3 sum = txm_d3(0, 0, 0);
            TXM_ASSERT(centre < net->node_count && links + 3 <= net->link_count);
            net->k[centre] = net->sharp[centre] = 0;
            for (int i = 0; i < 3; i++) {
                sum = txm_d3_add(sum, net->place[n[i]]);
                net->k[centre] += net->k[n[i]] / 3;
                net->sharp[centre] += net->sharp[n[i]] / 3;
                net->link[2 * links] = n[i];
                net->link[2 * links++ + 1] = (uint32_t)centre;
            }
            net->place[centre++] = txm_d3_scale(sum, 1.0 / 3);
        }
    }
}

/* the direction of the line that leaves a node by this end of a link */
static txm_dvec3 txi_crest_direction(const txi_crest_net *net, int64_t end) {
    return txm_d3_unit(
        txm_d3_sub(net->place[net->link[end ^ 1]], net->place[net->link[end]]));
}

/* Pair the ends of links at one node: again and again those two that continue each other best. */
static void txi_crest_pair(txi_crest_net *net, int64_t *ends, int count) {
    for (; count > 1; count -= 2) {
        int a = 0, b = 1;
        double best = 2;
        for (int i = 0; i < count && count > 2; i++) {
            for (int j = i + 1; j < count; j++) {
                const double turn = txm_d3_dot(txi_crest_direction(net, ends[i]),
                                               txi_crest_direction(net, ends[j]));
                if (turn >= best) continue;
                best = turn;
                a = i;
                b = j;
            }
        }
        net->mate[ends[a]] = ends[b];
        net->mate[ends[b]] = ends[a];
        ends[b] = ends[count - 1]; /* a < b: first the later one */
        ends[a] = ends[count - 2];
    }
}

/* Find which links continue each other. first: room for one more than nodes; ends: 2 per link. */
static void txi_crest_join(txi_crest_net *net, uint32_t *first, uint32_t *ends) {
    memset(first, 0, (net->node_count + 1) * sizeof *first);
    for (size_t i = 0; i < 2 * net->link_count; i++) {
        first[net->link[i] + 1]++;
        net->mate[i] = TXI_CREST_NONE;
    }
    for (size_t i = 0; i < net->node_count; i++) first[i + 1] += first[i];
    for (size_t i = 2 * net->link_count; i-- > 0;) ends[--first[net->link[i] + 1]] = (uint32_t)i;
    for (size_t i = 0; i < net->node_count; i++) first[i] = first[i + 1];
    first[net->node_count] = (uint32_t)(2 * net->link_count);
    for (size_t i = 0; i < net->node_count; i++) {
        int64_t list[TXI_CREST_PAIRED];
        int count = 0;
        for (size_t k = first[i]; k < first[i + 1] && count < TXI_CREST_PAIRED; k++)
            list[count++] = ends[k];
        txi_crest_pair(net, list, count);
    }
}

/* A line of a net, by the end of a link that it begins with. */
typedef struct txi_crest_run {
    int64_t begin;
    size_t count; /* points */
    double strength, length;
    double sharp; /* integral of k'' / k^3 */
    int net; /* 0 ridges, 1 valleys */
} txi_crest_run;

/* Follow a line to its end, or once round, and mark its links. Its strength is the integral of the
   curvature along it. */
static txi_crest_run txi_crest_follow(const txi_crest_net *net, int64_t begin, uint8_t *seen) {
    txi_crest_run run = {begin, 1, 0, 0, 0, 0};
    for (int64_t end = begin; end != TXI_CREST_NONE && !seen[end / 2]; end = net->mate[end ^ 1]) {
        const uint32_t a = net->link[end], b = net->link[end ^ 1];
        seen[end / 2] = 1;
        run.count++;
        const double length = txm_d3_dist(net->place[a], net->place[b]);
        run.length += length;
        run.strength += length * (net->k[a] + net->k[b]) / 2;
        run.sharp += length * (net->sharp[a] + net->sharp[b]) / 2;
    }
    return run;
}

/* All lines of a net that are sharp enough: first those that end somewhere, then the closed
   ones. runs: room for 1 per link; seen: 1 per link. Returns their number. */
static size_t txi_crest_collect(const txi_crest_net *net, int which, uint8_t *seen,
                                txi_crest_run *runs) {
    size_t count = 0;
    memset(seen, 0, net->link_count);
    for (size_t i = 0; i < 4 * net->link_count; i++) {
        const int64_t end = (int64_t)(i < 2 * net->link_count ? i : i - 2 * net->link_count);
        if (seen[end / 2] || (i < 2 * net->link_count && net->mate[end] != TXI_CREST_NONE))
            continue;
        runs[count] = txi_crest_follow(net, end, seen);
        runs[count].net = which;
        count += runs[count].sharp > TXI_CREST_SHARP * runs[count].length;
    }
    return count;
}

/* Find the lines of one kind. */
static txm_status txi_crest_trace(const txi_shape *s, int is_valley, txm_arena *arena,
                                  txi_crest_net *net, txi_crest_run **runs, size_t *count,
                                  txm_env *env) {
    uint32_t *node = (uint32_t *)txm_arena_alloc(arena, s->edge_count, sizeof(uint32_t));
    if (!node) return txi_no_memory(env);
    const txm_status status = txi_crest_nodes(s, is_valley, arena, node, net, env);
    if (status != TXM_OK || net->link_count == 0) return status;
    uint32_t *first = (uint32_t *)txm_arena_alloc(arena, net->node_count + 1, sizeof(uint32_t));
    uint32_t *ends = (uint32_t *)txm_arena_alloc(arena, net->link_count, 2 * sizeof(uint32_t));
    uint8_t *seen = (uint8_t *)txm_arena_alloc(arena, net->link_count, 1);
    *runs = (txi_crest_run *)txm_arena_alloc(arena, net->link_count, sizeof(txi_crest_run));
    if (arena->failed) return txi_no_memory(env);
    txi_crest_links(s, node, net);
    txi_crest_join(net, first, ends);
    *count = txi_crest_collect(net, is_valley, seen, *runs);
    return TXM_OK;
}

/* Choose the lines at or above the threshold, the strongest first. chosen receives indices into the
   runs of both nets, the valleys' after the ridges'; scratch: as many. Returns their number. */
static size_t txi_crest_choose(txi_crest_run *const runs[2], const size_t counts[2],
                               float threshold, txm_pair *chosen, txm_pair *scratch) {
    double least = (double)threshold, most = 0;
    size_t count = 0;
    for (size_t i = 0; i < counts[0] + counts[1]; i++)
        most = fmax(most, i < counts[0] ? runs[0][i].strength : runs[1][i - counts[0]].strength);
    if (!(threshold > 0)) least = fmax(TXI_CREST_STRENGTH, TXI_CREST_SHARE * most);
    for (size_t i = 0; i < counts[0] + counts[1]; i++) {
        const txi_crest_run *run = i < counts[0] ? &runs[0][i] : &runs[1][i - counts[0]];
        if (run->strength < least) continue;
        chosen[count].key = ~txm_sort_key(txm_float(run->strength));
        chosen[count++].value = (uint32_t)i;
    }
    txm_sort_pairs(chosen, scratch, count);
    return count;
}

/* Copy a line out. */
static void txi_crest_emit(const txi_crest_net *net, const txi_crest_run *run, float *out) {
    int64_t end = run->begin;
    for (size_t i = 0; i < run->count; i++) {
        const int is_last = i + 1 == run->count;
        const txm_dvec3 p = net->place[net->link[is_last ? end ^ 1 : end]];
        *out++ = txm_float(p.x);
        *out++ = txm_float(p.y);
        *out++ = txm_float(p.z);
        if (i + 2 < run->count) end = net->mate[end ^ 1];
    }
}

/* The chosen lines as the caller gets them. */
static txm_status txi_crest_deliver(const txi_crest_net nets[2], txi_crest_run *const runs[2],
                                    const size_t counts[2], const txm_pair *chosen, size_t count,
                                    txm_env *env, texinpaint_crests **out) {
    txm_arena memory;
    size_t points = 0, used = 0;
    txm_arena_init(&memory, env);
    for (size_t i = 0; i < count; i++) {
        const size_t n = chosen[i].value;
        points += n < counts[0] ? runs[0][n].count : runs[1][n - counts[0]].count;
    }
    texinpaint_crests *crests = (texinpaint_crests *)txm_arena_zero(&memory, 1, sizeof *crests);
    texinpaint_line *lines =
        (texinpaint_line *)txm_arena_alloc(&memory, count, sizeof(texinpaint_line));
    float *strengths = (float *)txm_arena_alloc(&memory, count, sizeof(float));
    uint8_t *kinds = (uint8_t *)txm_arena_alloc(&memory, count, 1);
    float *places = (float *)txm_arena_alloc(&memory, points, 3 * sizeof(float));
    if (memory.failed) {
        txm_arena_free(&memory);
        return txi_no_memory(env);
    }
    for (size_t i = 0; i < count; i++) {
        const size_t n = chosen[i].value;
        const txi_crest_run *run = n < counts[0] ? &runs[0][n] : &runs[1][n - counts[0]];
        txi_crest_emit(&nets[run->net], run, places + 3 * used);
        lines[i].points = places + 3 * used;
        lines[i].count = (int)run->count;
        strengths[i] = txm_float(run->strength);
        kinds[i] = run->net ? TEXINPAINT_VALLEY : TEXINPAINT_RIDGE;
        used += run->count;
    }
    crests->lines = lines;
    crests->strengths = strengths;
    crests->kinds = kinds;
    crests->line_count = count;
    crests->memory = memory;
    *out = crests;
    return TXM_OK;
}

/* Everything but the checks. */
static txm_status txi_crest_find(const texinpaint_crest_desc *desc, txm_arena *arena, txm_env *env,
                                 texinpaint_crests **out) {
    txm_mesh welded;
    txi_shape shape;
    txi_crest_net nets[2];
    txi_crest_run *runs[2] = {NULL, NULL};
    size_t counts[2] = {0, 0};
    memset(nets, 0, sizeof nets);
    txm_status status = txi_welded_make(&desc->mesh, arena, env, &welded);
    if (status == TXM_OK) status = txi_shape_make(&welded, desc->rings, arena, env, &shape);
    for (int i = 0; i < 2 && status == TXM_OK && shape.edge_count; i++) {
        if (desc->kinds && !(desc->kinds & (i ? TEXINPAINT_VALLEY : TEXINPAINT_RIDGE))) continue;
        if (txm_progress(env, i ? 0.95f : 0.9f, "crest lines")) return txi_stopped(env);
        status = txi_crest_trace(&shape, i, arena, &nets[i], &runs[i], &counts[i], env);
    }
    if (status != TXM_OK) return status;
    const size_t most = counts[0] + counts[1];
    txm_pair *chosen = (txm_pair *)txm_arena_alloc(arena, most, 2 * sizeof(txm_pair));
    if (arena->failed) return txi_no_memory(env);
    const size_t count =
        most ? txi_crest_choose(runs, counts, desc->threshold, chosen, chosen + most) : 0;
    return txi_crest_deliver(nets, runs, counts, chosen, count, env, out);
}

TEXINPAINT_API txm_status texinpaint_crest(const texinpaint_crest_desc *desc, txm_env *env,
                                           texinpaint_crests **out) {
    txm_arena arena;
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    if (!desc) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL");
    txm_status status = txm_mesh_check(&desc->mesh, "mesh", 3, 1, 1u << 29, env);
    if (status != TXM_OK) return status;
    if (!(desc->threshold >= 0 && desc->threshold <= 1e6f))
        return txm_fail(env, TXM_BAD_ARGUMENT, "threshold must be 0 to 1e6");
    if (desc->kinds < 0 || desc->kinds > (TEXINPAINT_RIDGE | TEXINPAINT_VALLEY))
        return txm_fail(env, TXM_BAD_ARGUMENT, "kinds must be 0 to 3");
    if (desc->rings < 0 || desc->rings > TXI_FIT_MOST_RINGS)
        return txm_fail(env, TXM_BAD_ARGUMENT, "rings must be 0 to 8");
    txm_arena_init(&arena, env);
    status = txi_crest_find(desc, &arena, env, out);
    txm_arena_free(&arena);
    return status;
}

TEXINPAINT_API void texinpaint_crests_free(texinpaint_crests *crests) {
    if (!crests) return;
    txm_arena memory = crests->memory;
    txm_arena_free(&memory);
}

/* ---- prior lines [1, II.C] --------------------------------------------------------------------
   Lines on the surface, crests or the caller's, as polylines in a window. To each belong up to two
   assistant lines on either side, at a constant distance: where the known texture has edges that
   run along the line, as a stripe that follows a crest has. [1] does not say how far away they
   are; here that is measured in the window. */

enum {
    TXI_PRIOR_REACH = 4,   /* window pixels: a line may be so far from the surface; ours        */
    TXI_PRIOR_JUMP = 4,    /* window pixels: farther apart in the window, the line was cut; ours */
    TXI_PRIOR_SHORT = 6,   /* points, about pixels: shorter pieces are left out; ours           */
    TXI_PRIOR_WIDTH = 40,  /* window pixels: the farthest assistant line; ours                  */
    TXI_PRIOR_LEAST = 32,  /* known pixels along a line that a distance is measured at; ours    */
    TXI_PRIOR_NEAR = 12,   /* window pixels: lines that stay farther from the hole are left out;
                              ours                                                               */
    TXI_PRIOR_BLUR = 5,    /* points: radius of the mean that smooths crest lines, thrice; ours:
                              they zigzag from triangle to triangle                             */
    TXI_PRIOR_CHORD = 6,   /* points to either side that give the direction of a line; ours     */
    TXI_PRIOR_STEP = 12,   /* levels of 8 bits: the mean step across an assistant line; ours    */
    TXI_PRIOR_AIDS = 2     /* assistant lines on each side; [1]                                 */
};
#define TXI_PRIOR_SURE 0.7 /* mean step over mean size of the steps: of one sign along the line;
                              ours                                                               */

/* The lines of a window while they are collected. */
typedef struct txi_prior_list {
    txm_vec2 *points;
    int *starts;
    size_t point_room, line_room;
    int count; /* lines                                                                         */
    int open;  /* points so far, those of the line that is being made included                  */
} txi_prior_list;

/* Room for more points in the open line; 0: no memory. */
static int txi_prior_reserve(txi_prior_list *list, size_t more, txm_arena *arena) {
    const size_t wanted = (size_t)list->open + more;
    if (wanted > INT32_MAX) return 0;
    if (wanted > list->point_room) {
        const size_t room = 2 * wanted + 1024;
        txm_vec2 *points = (txm_vec2 *)txm_arena_alloc(arena, room, sizeof(txm_vec2));
        if (!points) return 0;
        if (list->open) memcpy(points, list->points, (size_t)list->open * sizeof *points);
        list->points = points;
        list->point_room = room;
    }
    if ((size_t)list->count + 2 > list->line_room) {
        const size_t room = 2 * list->line_room + 64;
        int *starts = (int *)txm_arena_alloc(arena, room, sizeof(int));
        if (!starts) return 0;
        if (list->count) memcpy(starts, list->starts, (size_t)list->count * sizeof *starts);
        starts[list->count] = list->count ? list->starts[list->count] : 0;
        list->starts = starts;
        list->line_room = room;
    }
    return 1;
}

/* End the open line; it is dropped if it is short. There is room for the next. */
static void txi_prior_close(txi_prior_list *list) {
    const int first = list->starts[list->count];
    if (list->open - first < TXI_PRIOR_SHORT) list->open = first;
    else list->starts[++list->count] = list->open;
}

/* Add a point, at least .75 pixels from the last one; a jump ends the line. */
static int txi_prior_add(txi_prior_list *list, txm_vec2 p, txm_arena *arena) {
    if (!txi_prior_reserve(list, 1, arena)) return 0;
    if (list->open > list->starts[list->count]) {
        const txm_vec2 last = list->points[list->open - 1];
        const double dx = (double)p.x - last.x, dy = (double)p.y - last.y,
                     apart = dx * dx + dy * dy;
        if (apart < 0.5625) return 1;
        if (apart > TXI_PRIOR_JUMP * TXI_PRIOR_JUMP) {
            txi_prior_close(list);
            if (!txi_prior_reserve(list, 1, arena)) return 0;
        }
    }
    TXM_ASSERT((size_t)list->open < list->point_room);
    list->points[list->open++] = p;
    return 1;
}

/* ---- prior lines: from the surface into the window ------------------------------------------- */

/* The pixels of a window by their place on the surface: chains for cells of a grid. */
typedef struct txi_places {
    const txi_window *w;
    uint32_t *head, *next; /* pixels, UINT32_MAX ends a chain; head: 1 per slot, next: per pixel */
    size_t slots;          /* a power of two                                                    */
    double low[3], high[3]; /* a box around all places, with the reach, in window pixels        */
} txi_places;

static size_t txi_places_slot(const txi_places *s, int64_t x, int64_t y, int64_t z) {
    const uint64_t xy = ((uint64_t)x & 0xffffffffu) << 32 | ((uint64_t)y & 0xffffffffu);
    return (size_t)txm_hash(txm_hash(xy) + (uint64_t)z) & (s->slots - 1);
}

static int64_t txi_places_cell(double x) {
    return (int64_t)floor(x / (double)TXI_PRIOR_REACH);
}

/* 0: no memory. */
static int txi_places_make(const txi_window *w, txm_arena *arena, txi_places *s) {
    const size_t pixels = (size_t)w->width * (size_t)w->height;
    memset(s, 0, sizeof *s);
    s->w = w;
    for (s->slots = 64; s->slots < pixels / 4;) s->slots *= 2;
    s->head = (uint32_t *)txm_arena_alloc(arena, s->slots, sizeof(uint32_t));
    s->next = (uint32_t *)txm_arena_alloc(arena, pixels, sizeof(uint32_t));
    if (!s->head || !s->next) return 0;
    memset(s->head, 0xff, s->slots * sizeof *s->head);
    for (int k = 0; k < 3; k++) {
        s->low[k] = 1e30;
        s->high[k] = -1e30;
    }
    for (size_t i = pixels; i-- > 0;) { /* backwards, so that chains run forwards */
        if (w->state[i] == TXI_VOID) continue;
        const double p[3] = {(double)w->place[i].x, (double)w->place[i].y, (double)w->place[i].z};
        if (!(fabs(p[0]) < 1e9 && fabs(p[1]) < 1e9 && fabs(p[2]) < 1e9)) continue;
        const size_t slot = txi_places_slot(s, txi_places_cell(p[0]), txi_places_cell(p[1]),
                                            txi_places_cell(p[2]));
        s->next[i] = s->head[slot];
        s->head[slot] = (uint32_t)i;
        for (int k = 0; k < 3; k++) {
            s->low[k] = fmin(s->low[k], p[k] - (double)TXI_PRIOR_REACH);
            s->high[k] = fmax(s->high[k], p[k] + (double)TXI_PRIOR_REACH);
        }
    }
    return 1;
}

/* Is the place in the box? Clipped lines of huge numbers may end anywhere. */
static int txi_places_hold(const txi_places *s, txm_dvec3 p) {
    return p.x >= s->low[0] && p.x <= s->high[0] && p.y >= s->low[1] && p.y <= s->high[1] &&
           p.z >= s->low[2] && p.z <= s->high[2];
}

/* The pixel nearest to a place in the box, within reach; -1: none. */
static int64_t txi_places_nearest(const txi_places *s, txm_dvec3 p) {
    const int64_t x = txi_places_cell(p.x), y = txi_places_cell(p.y), z = txi_places_cell(p.z);
    double least = TXI_PRIOR_REACH * TXI_PRIOR_REACH;
    int64_t best = -1;
    for (int k = 0; k < 27; k++) {
        const size_t slot = txi_places_slot(s, x + k % 3 - 1, y + k / 3 % 3 - 1, z + k / 9 - 1);
        for (uint32_t i = s->head[slot]; i != UINT32_MAX; i = s->next[i]) {
            const txm_vec3 q = s->w->place[i];
            const double apart = txm_d3_dist2(p, txm_d3(q.x, q.y, q.z));
            if (apart > least || (best >= 0 && (apart >= least && (int64_t)i >= best))) continue;
            least = apart;
            best = i;
        }
    }
    return best;
}

/* The derivative of the place along x (axis 0) or y, from the neighbours that there are. */
static txm_dvec3 txi_places_slope(const txi_window *w, size_t i, int axis) {
    const size_t step = axis ? (size_t)w->width : 1;
    const size_t at = axis ? i / (size_t)w->width : i % (size_t)w->width;
    const size_t end = axis ? (size_t)w->height : (size_t)w->width;
    const int before = at > 0 && w->state[i - step] != TXI_VOID;
    const int after = at + 1 < end && w->state[i + step] != TXI_VOID;
    const txm_vec3 a = w->place[before ? i - step : i], b = w->place[after ? i + step : i];
    const txm_dvec3 d = txm_d3((double)b.x - a.x, (double)b.y - a.y, (double)b.z - a.z);
    return before && after ? txm_d3_scale(d, 0.5) : d;
}

/* Where a place of the surface lies in the window. 0: outside. */
static int txi_places_find(const txi_places *s, txm_dvec3 p, txm_vec2 *out) {
    const int64_t i = txi_places_hold(s, p) ? txi_places_nearest(s, p) : -1;
    if (i < 0) return 0;
    const txm_vec3 q = s->w->place[i];
    const txm_dvec3 u = txi_places_slope(s->w, (size_t)i, 0),
                    v = txi_places_slope(s->w, (size_t)i, 1);
    const txm_dvec3 d = txm_d3_sub(p, txm_d3(q.x, q.y, q.z));
    const double e = txm_d3_len2(u), f = txm_d3_dot(u, v), g = txm_d3_len2(v);
    const double det = e * g - f * f, a = txm_d3_dot(d, u), b = txm_d3_dot(d, v);
    double x = 0, y = 0;
    if (det > 0.01) {
        x = (g * a - f * b) / det;
        y = (e * b - f * a) / det;
    }
    if (fabs(x) > 1.5 || fabs(y) > 1.5) return 0; /* beyond the edge of what the window shows */
    const int column = (int)(i % s->w->width), row = (int)(i / s->w->width);
    *out = txm_v2(txm_float(column + x), txm_float(row + y));
    return 1;
}

/* The part of a segment, from..to of 0..1, in the box. 0: none. */
static int txi_places_clip(const txi_places *s, txm_dvec3 a, txm_dvec3 d, double *from,
                           double *to) {
    const double p[3] = {a.x, a.y, a.z}, q[3] = {d.x, d.y, d.z};
    *from = 0;
    *to = 1;
    for (int k = 0; k < 3; k++) {
        if (!(fabs(q[k]) > 1e-12)) {
            if (p[k] < s->low[k] || p[k] > s->high[k]) return 0;
            continue;
        }
        const double u = (s->low[k] - p[k]) / q[k], v = (s->high[k] - p[k]) / q[k];
        *from = fmax(*from, fmin(u, v));
        *to = fmin(*to, fmax(u, v));
    }
    return *from < *to;
}

/* Lay a line of the surface into the window, in steps of half a pixel. 0: no memory. */
static int txi_prior_lay(const txi_places *s, const texinpaint_line *line, txi_prior_list *list,
                         txm_arena *arena) {
    const double unit = 1 / s->w->spacing;
    if (!txi_prior_reserve(list, 1, arena)) return 0;
    for (int k = 0; k + 1 < line->count; k++) {
        const float *p = line->points + 3 * (size_t)k;
        const txm_dvec3 a = txm_d3_scale(txm_d3_sub(txm_d3_load(p), s->w->origin), unit);
        const txm_dvec3 b = txm_d3_scale(txm_d3_sub(txm_d3_load(p + 3), s->w->origin), unit);
        const txm_dvec3 d = txm_d3_sub(b, a);
        double from, to;
        if (!txi_places_clip(s, a, d, &from, &to)) {
            txi_prior_close(list);
            continue;
        }
        const int steps = 1 + (int)fmin(2 * (to - from) * txm_d3_len(d), 1e6);
        for (int i = 0; i <= steps; i++) {
            txm_vec2 at;
            if (!txi_places_find(s, txm_d3_mad(a, d, from + (to - from) * i / steps), &at)) {
                txi_prior_close(list);
            } else if (!txi_prior_add(list, at, arena)) {
                return 0;
            }
            if (!txi_prior_reserve(list, 1, arena)) return 0;
        }
    }
    txi_prior_close(list);
    return 1;
}

/* The same for a line of a plain picture, whose window is a part of it: points are x, y in
   pixels, pixel centres at one half. */
static int txi_prior_copy(const txi_window *w, const texinpaint_line *line, txi_prior_list *list,
                          txm_arena *arena) {
    const double left = (double)w->place[0].x + 0.5, top = (double)w->place[0].y + 0.5;
    txi_places box;
    memset(&box, 0, sizeof box);
    box.low[2] = -1;
    box.high[0] = w->width - 1;
    box.high[1] = w->height - 1;
    box.high[2] = 1;
    if (!txi_prior_reserve(list, 1, arena)) return 0;
    for (int k = 0; k + 1 < line->count; k++) {
        const float *p = line->points + 3 * (size_t)k;
        const txm_dvec3 a = txm_d3(p[0] - left, p[1] - top, 0);
        const txm_dvec3 d = txm_d3((double)p[3] - p[0], (double)p[4] - p[1], 0);
        double from, to;
        if (!txi_places_clip(&box, a, d, &from, &to)) {
            txi_prior_close(list);
            continue;
        }
        const int steps = 1 + (int)fmin((to - from) * txm_d3_len(d), 1e6);
        for (int i = 0; i <= steps; i++) {
            const txm_dvec3 q = txm_d3_mad(a, d, from + (to - from) * i / steps);
            if (!txi_places_hold(&box, q)) continue;
            if (!txi_prior_add(list, txm_v2(txm_float(q.x), txm_float(q.y)), arena)) return 0;
        }
    }
    txi_prior_close(list);
    return 1;
}

/* ---- prior lines: assistants ----------------------------------------------------------------- */

/* the unit vector to the left of a line at point k of n, as y runs downwards; 0, 0: it has no
   direction */
static txm_vec2 txi_prior_left(const txm_vec2 *points, int n, int k) {
    const txm_vec2 a = points[k > TXI_PRIOR_CHORD ? k - TXI_PRIOR_CHORD : 0];
    const txm_vec2 b = points[k + TXI_PRIOR_CHORD < n ? k + TXI_PRIOR_CHORD : n - 1];
    const double dx = (double)b.x - a.x, dy = (double)b.y - a.y, length = sqrt(dx * dx + dy * dy);
    return length > 0 ? txm_v2(txm_float(dy / length), txm_float(-dx / length)) : txm_v2(0, 0);
}

/* the known pixel at a place, or -1 */
static int64_t txi_prior_known(const txi_window *w, double x, double y) {
    const int px = (int)floor(x + 0.5), py = (int)floor(y + 0.5);
    if (px < 0 || py < 0 || px >= w->width || py >= w->height) return -1;
    const int64_t i = (int64_t)py * w->width + px;
    return w->state[i] == TXI_KNOWN || w->state[i] == TXI_FOREIGN ? i : -1;
}

/* How strong an edge runs along the line at a distance to its left (negative: right): the mean step
   across, summed over the colours, in levels; 0 where it is not of one sign. */
static double txi_prior_edge(const txi_window *w, const txm_vec2 *points, int n, int distance) {
    double sum[3] = {0, 0, 0}, size = 0;
    int count = 0;
    for (int k = 0; k < n; k++) {
        const txm_vec2 left = txi_prior_left(points, n, k);
        const double x = points[k].x + (double)left.x * distance;
        const double y = points[k].y + (double)left.y * distance;
        const int64_t a = txi_prior_known(w, x + 1.5 * (double)left.x, y + 1.5 * (double)left.y);
        const int64_t b = txi_prior_known(w, x - 1.5 * (double)left.x, y - 1.5 * (double)left.y);
        if (a < 0 || b < 0) continue;
        count++;
        for (int c = 0; c < 3; c++) {
            const int step = w->color[4 * a + c] - w->color[4 * b + c];
            sum[c] += step;
            size += step < 0 ? -step : step;
        }
    }
    const double mean = fabs(sum[0]) + fabs(sum[1]) + fabs(sum[2]);
    if (count < TXI_PRIOR_LEAST || mean < TXI_PRIOR_STEP * count || mean < TXI_PRIOR_SURE * size)
        return 0;
    return mean / count;
}

/* The line at a distance to the left of line k, where that lies in the window. 0: no memory. */
static int txi_prior_offset(const txi_window *w, txi_prior_list *list, int k, int distance,
                            txm_arena *arena) {
    const int first = list->starts[k], n = list->starts[k + 1] - first;
    if (!txi_prior_reserve(list, 1, arena)) return 0;
    for (int i = 0; i < n; i++) {
        const txm_vec2 p = list->points[first + i];
        const txm_vec2 left = txi_prior_left(list->points + first, n, i);
        const txm_vec2 q = txm_v2(txm_float(p.x + (double)left.x * distance),
                                  txm_float(p.y + (double)left.y * distance));
        const int x = (int)floor((double)q.x + 0.5), y = (int)floor((double)q.y + 0.5);
        const int inside = x >= 0 && y >= 0 && x < w->width && y < w->height &&
                           w->state[(size_t)y * (size_t)w->width + (size_t)x] != TXI_VOID;
        const int open = list->open > list->starts[list->count];
        if (!inside) {
            txi_prior_close(list);
            if (!txi_prior_reserve(list, 1, arena)) return 0;
            continue;
        }
        if (open) { /* where the line bends more than the distance allows, its parallel turns
                       back                                                                      */
            const txm_vec2 last = list->points[list->open - 1];
            if (((double)q.x - last.x) * -left.y + ((double)q.y - last.y) * left.x <= 0) continue;
        }
        if (!txi_prior_add(list, q, arena)) return 0;
    }
    txi_prior_close(list);
    return 1;
}

/* The assistant lines of line k on one side (1 left, -1 right): at the strongest edges. 0: no
   memory. */
static int txi_prior_assist(const txi_window *w, txi_prior_list *list, int k, int side,
                            txm_arena *arena) {
    enum { FIRST = 2, SLOTS = TXI_PRIOR_WIDTH - FIRST };
    double edge[SLOTS];
    const txm_vec2 *points = list->points + list->starts[k];
    const int n = list->starts[k + 1] - list->starts[k];
    for (int i = 0; i < SLOTS; i++) edge[i] = txi_prior_edge(w, points, n, side * (FIRST + i));
    for (int found = 0; found < TXI_PRIOR_AIDS; found++) {
        int best = 0, first, last;
        for (int i = 1; i < SLOTS; i++) {
            if (edge[i] > edge[best]) best = i;
        }
        if (!(edge[best] > 0)) return 1;
        /* an edge is some pixels wide: its middle */
        for (first = best; first > 0 && edge[first - 1] > 0.9 * edge[best];) first--;
        for (last = best; last + 1 < SLOTS && edge[last + 1] > 0.9 * edge[best];) last++;
        if (!txi_prior_offset(w, list, k, side * (FIRST + (first + last) / 2), arena)) return 0;
        for (; first > 0 && edge[first - 1] <= edge[first]; first--) edge[first] = 0;
        for (; last + 1 < SLOTS && edge[last + 1] <= edge[last]; last++) edge[last] = 0;
        for (int i = first; i <= last; i++) edge[i] = 0;
    }
    return 1;
}

/* Smooth a line; its ends stay where they are. scratch: room for n points. */
static void txi_prior_smooth(txm_vec2 *points, int n, txm_vec2 *scratch) {
    for (int pass = 0; pass < 3; pass++) {
        memcpy(scratch, points, (size_t)n * sizeof *points);
        for (int k = 1; k + 1 < n; k++) {
            const int most = k < n - 1 - k ? k : n - 1 - k;
            const int r = most < TXI_PRIOR_BLUR ? most : TXI_PRIOR_BLUR;
            double x = 0, y = 0;
            for (int i = k - r; i <= k + r; i++) {
                x += (double)scratch[i].x;
                y += (double)scratch[i].y;
            }
            points[k] = txm_v2(txm_float(x / (2 * r + 1)), txm_float(y / (2 * r + 1)));
        }
    }
}

/* Does a line come near the hole? */
static int txi_prior_is_near(const txi_window *w, const txm_vec2 *points, int n) {
    for (int k = 0; k < n; k++) {
        const int x = (int)floor((double)points[k].x + 0.5),
                  y = (int)floor((double)points[k].y + 0.5);
        for (int dy = -TXI_PRIOR_NEAR; dy <= TXI_PRIOR_NEAR; dy += 4) {
            for (int dx = -TXI_PRIOR_NEAR; dx <= TXI_PRIOR_NEAR; dx += 4) {
                const int u = x + dx, v = y + dy;
                if (u < 0 || v < 0 || u >= w->width || v >= w->height) continue;
                if (w->state[(size_t)v * (size_t)w->width + (size_t)u] == TXI_HOLE) return 1;
            }
        }
    }
    return 0;
}

/* Leave out the lines that stay away from the hole. */
static void txi_prior_filter(const txi_window *w, txi_prior_list *list) {
    int lines = 0, points = 0;
    for (int k = 0; k < list->count; k++) {
        const int first = list->starts[k], n = list->starts[k + 1] - first;
        if (!txi_prior_is_near(w, list->points + first, n)) continue;
        memmove(list->points + points, list->points + first, (size_t)n * sizeof *list->points);
        list->starts[lines++] = points;
        points += n;
    }
    list->count = lines;
    if (list->starts) list->starts[lines] = points;
}

/* The prior lines of a window that come near its hole: first all lines themselves, in pieces, then
   their assistants.
   crests  NULL: the lines of the description
   prior   lies in the arena
   return  TXM_OK, TXM_OUT_OF_MEMORY, TXM_CANCELLED
   cost    O(pixels of the window + length of the lines in it)                              */
static txm_status txi_prior_make(const txi_domain *d, const texinpaint_crests *crests,
                                 const txi_window *w, txm_arena *arena, txm_env *env,
                                 txi_prior *prior) {
    const texinpaint_line *lines = crests ? crests->lines : d->desc->lines;
    const size_t count = crests ? crests->line_count : (size_t)d->desc->line_count;
    txi_prior_list list;
    txi_places places;
    txm_arena scratch;
    int ok = 1;
    memset(prior, 0, sizeof *prior);
    memset(&list, 0, sizeof list);
    if (count == 0 || !(w->spacing > 0)) return TXM_OK;
    if (txm_progress(env, 0, "prior lines")) return txi_stopped(env);
    txm_arena_init(&scratch, env);
    if (d->surface) ok = txi_places_make(w, &scratch, &places);
    for (size_t i = 0; i < count && ok; i++) {
        if (d->surface) ok = txi_prior_lay(&places, &lines[i], &list, arena);
        else ok = txi_prior_copy(w, &lines[i], &list, arena);
    }
    const int own = list.count;
    if (own > 0 && crests && ok) {
        txm_vec2 *copy =
            (txm_vec2 *)txm_arena_alloc(&scratch, (size_t)list.open, sizeof(txm_vec2));
        ok = copy != NULL;
        for (int k = 0; k < own && ok; k++)
            txi_prior_smooth(list.points + list.starts[k], list.starts[k + 1] - list.starts[k],
                             copy);
    }
    for (int k = 0; k < own && ok; k++)
        ok = txi_prior_assist(w, &list, k, 1, arena) && txi_prior_assist(w, &list, k, -1, arena);
    txm_arena_free(&scratch);
    if (!ok) return txi_no_memory(env);
    txi_prior_filter(w, &list);
    prior->points = list.points;
    prior->starts = list.starts;
    prior->line_count = list.count;
    return TXM_OK;
}

/* ---- tensor voting ----------------------------------------------------------------------------
   C. Tang, G. Medioni. Inference of integrated surface, curve and junction descriptions from sparse
   3D data. PAMI 1998. Each token, a point of a line or surface, tells its neighbours which
   direction they would have if both were parts of one smooth line or surface. A symmetric tensor
   collects the votes:

       T = l1 e1 e1' + l2 e2 e2' + l3 e3 e3',  l1 >= l2 >= l3                             [1, (1)]
         = (l1 - l2) e1 e1' + (l2 - l3) (e1 e1' + e2 e2') + l3 I
            stick: a surface        plate: a line along e3    ball: a junction, or no
            with normal e1                                    preference

   Tensors are stored as xx xy xz yy yz zz.                                                       */

enum {
    TXI_VOTE_RADII = 40,  /* entries of the tables of the fields along the distance               */
    TXI_VOTE_ANGLES = 24, /* and along the angle, 0 to 90 degrees                                 */
    TXI_VOTE_STICKS = 32  /* sticks that are summed up for a plate, over a quarter turn           */
};

#define TXI_VOTE_BEND 3.733 /* c = -16 ln(0.1) (sigma - 1) / pi^2 [4]                             */

/* A token: where it is, and its tensor taken apart. */
typedef struct txi_token {
    txm_dvec3 place;
    txm_dvec3 normal;  /* e1                                                                     */
    txm_dvec3 tangent; /* e3                                                                     */
    double stick, plate, ball; /* l1 - l2, l2 - l3, l3                                            */
    int next;          /* next token in the same bucket, or -1                                    */
} txi_token;

/* The voting fields of one scale. */
typedef struct txi_fields {
    double sigma;     /* length unit: how far votes reach                                         */
    double c;         /* penalty of curvature                                                     */
    double reach;     /* no votes beyond                                                          */
    double ball[TXI_VOTE_RADII + 1][2];  /* along the connection, across it                       */
    double plate[TXI_VOTE_RADII + 1][TXI_VOTE_ANGLES + 1][4]; /* tt, tp, pp, qq, see below        */
} txi_fields;

/* Tokens in buckets, for the search of neighbours. */
typedef struct txi_tokens {
    txi_token *at;
    int count, room;
    int *bucket;      /* first token of each bucket, or -1                                        */
    uint32_t mask;    /* number of buckets less one                                               */
    double cell;      /* side of a cell of the grid                                               */
} txi_tokens;

/* theta / sin(theta) for s = sin(theta)^2 <= 1/2, by the series of the arc sine, to 1e-7. */
static double txi_arc(double s) {
    double sum = 1, term = 1;
    for (int k = 1; k <= 18; k++) {
        term *= s * (2 * k - 1) / (2 * k);
        sum += term / (2 * k + 1);
    }
    return sum;
}

/* The decay of a stick's vote over distance l at an angle theta between the connection and the
   tangent plane: along the arc of length s = l theta / sin(theta) and curvature k = 2 sin(theta) /
   l

       D = exp(-(s^2 + c k^2) / sigma^2)                                                          */
static double txi_decay(const txi_fields *f, double l, double sine) {
    const double s = l * txi_arc(sine * sine), k = 2 * sine / l;
    const double e = (s * s + f->c * k * k) / (f->sigma * f->sigma);
    return e < 600 ? txm_exp2(-e * TXI_LOG2_E) : 0;
}

static inline void txi_outer(double t[6], txm_dvec3 v, double weight) {
    t[0] += weight * v.x * v.x;
    t[1] += weight * v.x * v.y;
    t[2] += weight * v.x * v.z;
    t[3] += weight * v.y * v.y;
    t[4] += weight * v.y * v.z;
    t[5] += weight * v.z * v.z;
}

/* The vote of a stick with unit normal n at v from it: the normal of the circle that touches the
   stick's tangent plane and goes through v. Nothing beyond 45 degrees. */
static void txi_vote_stick(const txi_fields *f, txm_dvec3 n, txm_dvec3 v, double weight,
                           double t[6]) {
    const double l = txm_d3_len(v);
    if (!(l > 0) || l > f->reach) return;
    const txm_dvec3 u = txm_d3_scale(v, 1 / l);
    const double sine = txm_d3_dot(n, u);
    if (sine * sine > 0.5) return;
    /* the reflection of n in the plane at a right angle to the connection                        */
    txi_outer(t, txm_d3_mad(n, u, -2 * sine), weight * txi_decay(f, l, sine));
}

/* The tables. A ball's vote is the integral over the sphere of sticks; with s the sine of a stick's
   angle to the plane across the connection u it is, as sticks are reflected,

       3/2 int D s^2 ds  along u,  3/4 int D (1 - s^2) ds  across,  |s| <= sqrt(1/2)

   A plate's vote is the integral of sticks over the circle around its tangent t. In the frame t, p
   (across t in the plane of t and u), q = t x p it has the entries tt, tp, pp, qq.

   sigma   length unit: about half of the gap that votes can bridge
   plates  0: no plates will vote, which saves most of the time                                  */
static void txi_fields_make(txi_fields *f, double sigma, int plates) {
    f->sigma = sigma;
    f->c = sigma > 1 ? TXI_VOTE_BEND * (sigma - 1) : 0;
    f->reach = 2.5 * sigma;
    for (int i = 0; i <= TXI_VOTE_RADII; i++) {
        const double l = f->reach * (i > 0 ? i : 0.01) / (double)TXI_VOTE_RADII;
        f->ball[i][0] = f->ball[i][1] = 0;
        for (int k = 0; k < TXI_VOTE_STICKS; k++) { /* both signs of s                            */
            const double width = 0.70710678118654752 / (double)TXI_VOTE_STICKS,
                         s = width * (k + 0.5);
            const double d = 2 * width * txi_decay(f, l, s);
            f->ball[i][0] += 1.5 * d * s * s;
            f->ball[i][1] += 0.75 * d * (1 - s * s);
        }
        for (int j = 0; j <= TXI_VOTE_ANGLES && plates; j++) {
            double sine, cosine, *e = f->plate[i][j];
            /* u = cosine t + sine p */
            txm_sincos(0.5 * TXM_PI * j / (double)TXI_VOTE_ANGLES, &sine, &cosine);
            e[0] = e[1] = e[2] = e[3] = 0;
            for (int k = 0; k < TXI_VOTE_STICKS; k++) {
                double np, nq;
                txm_sincos(0.5 * TXM_PI * (k + 0.5) / (double)TXI_VOTE_STICKS, &nq, &np);
                const double s = np * sine;
                if (s * s > 0.5) continue;
                const double d = 2 * txi_decay(f, l, s) / (double)TXI_VOTE_STICKS;
                const double rt = -2 * s * cosine, rp = np - 2 * s * sine;
                e[0] += d * rt * rt;
                e[1] += d * rt * rp;
                e[2] += d * rp * rp;
                e[3] += d * nq * nq;
            }
        }
    }
}

/* The vote of a ball at v from it. */
static void txi_vote_ball(const txi_fields *f, txm_dvec3 v, double weight, double t[6]) {
    const double l = txm_d3_len(v), at = l * (double)TXI_VOTE_RADII / f->reach;
    if (!(l > 0) || l >= f->reach) return;
    const int i = (int)at;
    const double r = at - i;
    const double along = weight * (f->ball[i][0] * (1 - r) + f->ball[i + 1][0] * r);
    const double across = weight * (f->ball[i][1] * (1 - r) + f->ball[i + 1][1] * r);
    txi_outer(t, txm_d3_scale(v, 1 / l), along - across);
    t[0] += across;
    t[3] += across;
    t[5] += across;
}

/* The vote of a plate, a line in direction tangent (unit), at v from it. */
static void txi_vote_plate(const txi_fields *f, txm_dvec3 tangent, txm_dvec3 v, double weight,
                           double t[6]) {
    const double l = txm_d3_len(v), at = l * (double)TXI_VOTE_RADII / f->reach;
    double e[4], cosine = txm_d3_dot(tangent, v) / (l > 0 ? l : 1);
    if (!(l > 0) || l >= f->reach) return;
    if (cosine < 0) { /* the field is the same behind                                             */
        tangent = txm_d3_scale(tangent, -1);
        cosine = -cosine;
    }
    txm_dvec3 p = txm_d3_mad(v, tangent, -cosine * l);
    const double far_off = txm_d3_len(p);
    if (far_off > 1e-9 * l) {
        p = txm_d3_scale(p, 1 / far_off);
    } else {
        const txm_vec3 any = txm_vec3_perpendicular(txm_v3(
            txm_float(tangent.x), txm_float(tangent.y), txm_float(tangent.z)));
        p = txm_d3_unit(txm_d3(any.x, any.y, any.z));
    }
    const txm_dvec3 q = txm_d3_cross(tangent, p);
    /* the angle from its sine or cosine, whichever is less: theta = x * arc(x^2)                 */
    const double sine = far_off / l;
    const double angle =
        sine < cosine
            ? sine * txi_arc(sine * sine < 0.5 ? sine * sine : 0.5)
            : 0.5 * TXM_PI - cosine * txi_arc(cosine * cosine < 0.5 ? cosine * cosine : 0.5);
    const double across = angle * (double)TXI_VOTE_ANGLES / (0.5 * TXM_PI);
    const int i = (int)at, j = txm_clampi((int)across, 0, TXI_VOTE_ANGLES - 1);
    const double r = at - i, a = across - j;
    for (int k = 0; k < 4; k++) {
        e[k] = weight * ((f->plate[i][j][k] * (1 - a) + f->plate[i][j + 1][k] * a) * (1 - r) +
                         (f->plate[i + 1][j][k] * (1 - a) + f->plate[i + 1][j + 1][k] * a) * r);
    }
    txi_outer(t, tangent, e[0] - e[1]); /* e1 (tp' + pt') = e1 ((t + p)(t + p)' - tt' - pp')      */
    txi_outer(t, p, e[2] - e[1]);
    txi_outer(t, txm_d3_add(tangent, p), e[1]);
    txi_outer(t, q, e[3]);
}

/* All of a token's vote at a place. */
static void txi_token_vote(const txi_fields *f, const txi_token *k, txm_dvec3 place, double t[6]) {
    const txm_dvec3 v = txm_d3_sub(place, k->place);
    if (txm_d3_len2(v) >= f->reach * f->reach) return;
    if (k->stick > 0) txi_vote_stick(f, k->normal, v, k->stick, t);
    if (k->plate > 0) txi_vote_plate(f, k->tangent, v, k->plate, t);
    if (k->ball > 0) txi_vote_ball(f, v, k->ball, t);
}

/* ---- tensors ----------------------------------------------------------------------------- */

/* Take a tensor apart. */
static void txi_token_set(txi_token *k, const double t[6]) {
    double value[3], e[3][3];
    k->stick = k->plate = k->ball = 0;
    k->normal = txm_d3(0, 0, 1);
    k->tangent = txm_d3(1, 0, 0);
    if (txm_eigen3(t, value, e) != TXM_OK) return;
    k->normal = txm_d3(e[0][0], e[0][1], e[0][2]);
    k->tangent = txm_d3(e[2][0], e[2][1], e[2][2]);
    k->stick = value[0] - value[1];
    k->plate = value[1] - value[2];
    k->ball = value[2] > 0 ? value[2] : 0;
}

/* The surface as a constraint: lines lie in it, so that only the part of a tensor in the tangent
   plane counts, P T P with P = I - n n'. A line in direction d, which is a plate (I - d d'),
   becomes the stick m m' with m = n x d, which votes within the surface only. */
static void txi_onto_surface(double t[6], txm_dvec3 n) {
    const txm_dvec3 tn =
        txm_d3(t[0] * n.x + t[1] * n.y + t[2] * n.z, t[1] * n.x + t[3] * n.y + t[4] * n.z,
               t[2] * n.x + t[4] * n.y + t[5] * n.z);
    const double nn = txm_d3_dot(n, tn);
    /* T - n (Tn)' - (Tn) n' + (n'Tn) n n'                                                        */
    t[0] += -2 * n.x * tn.x + nn * n.x * n.x;
    t[1] += -n.x * tn.y - n.y * tn.x + nn * n.x * n.y;
    t[2] += -n.x * tn.z - n.z * tn.x + nn * n.x * n.z;
    t[3] += -2 * n.y * tn.y + nn * n.y * n.y;
    t[4] += -n.y * tn.z - n.z * tn.y + nn * n.y * n.z;
    t[5] += -2 * n.z * tn.z + nn * n.z * n.z;
}

/* ---- buckets ----------------------------------------------------------------------------- */

static uint32_t txi_bucket(const txi_tokens *k, int64_t x, int64_t y, int64_t z) {
    const uint64_t h = (uint64_t)x * 0x9e3779b97f4a7c15u + (uint64_t)y * 0xc2b2ae3d27d4eb4fu +
                       (uint64_t)z * 0x165667b19e3779f9u;
    return (uint32_t)(txm_hash(h) & k->mask);
}

static int64_t txi_cell(const txi_tokens *k, double x) {
    return (int64_t)floor((double)txm_clampf(txm_float(x / k->cell), -1e9f, 1e9f));
}

/* No tokens; room for that many. */
static txm_status txi_tokens_make(txi_tokens *k, int room, double reach, txm_arena *arena,
                                  txm_env *env) {
    uint32_t buckets = 16;
    while (buckets < (uint32_t)room) buckets *= 2;
    k->at = (txi_token *)txm_arena_alloc(arena, (size_t)(room > 0 ? room : 1), sizeof *k->at);
    k->bucket = (int *)txm_arena_alloc(arena, buckets, sizeof *k->bucket);
    if (arena->failed) return txi_no_memory(env);
    k->count = 0;
    k->room = room;
    k->mask = buckets - 1;
    k->cell = reach > 1e-9 ? reach : 1e-9;
    for (uint32_t i = 0; i < buckets; i++) k->bucket[i] = -1;
    return TXM_OK;
}

/* Add a token of tensor t; nothing happens if there is no room. */
static void txi_tokens_add(txi_tokens *k, txm_dvec3 place, const double t[6]) {
    if (k->count >= k->room) return;
    txi_token *token = &k->at[k->count];
    txi_token_set(token, t);
    token->place = place;
    const uint32_t b =
        txi_bucket(k, txi_cell(k, place.x), txi_cell(k, place.y), txi_cell(k, place.z));
    token->next = k->bucket[b];
    k->bucket[b] = k->count++;
}

/* The sum of all votes at a place, with balls: as if all tokens were unit balls. cost: O(tokens
   within reach) */
static void txi_votes_at(const txi_fields *f, const txi_tokens *k, txm_dvec3 place, int balls,
                         double t[6]) {
    const int64_t cx = txi_cell(k, place.x), cy = txi_cell(k, place.y), cz = txi_cell(k, place.z);
    for (int i = 0; i < 6; i++) t[i] = 0;
    for (int i = 0; i < 27; i++) {
        const int64_t x = cx + i % 3 - 1, y = cy + i / 3 % 3 - 1, z = cz + i / 9 - 1;
        for (int j = k->bucket[txi_bucket(k, x, y, z)]; j >= 0; j = k->at[j].next) {
            const txi_token *o = &k->at[j];
            /* another cell may share the bucket                                                  */
            if (txi_cell(k, o->place.x) != x || txi_cell(k, o->place.y) != y ||
                txi_cell(k, o->place.z) != z)
                continue;
            if (balls) txi_vote_ball(f, txm_d3_sub(place, o->place), 1, t);
            else txi_token_vote(f, o, place, t);
        }
    }
}

/* Sparse voting: each token receives the votes of the others, which replace its tensor. balls: the
   first round, in which only the places are known. normals: one per token, the surface on which
   lines lie, or NULL. scratch: 6 numbers per token. */
static void txi_vote_sparse(const txi_fields *f, txi_tokens *k, int balls, const txm_dvec3 *normals,
                            double *scratch) {
    for (int i = 0; i < k->count; i++) {
        double *t = scratch + 6 * (size_t)i;
        txi_votes_at(f, k, k->at[i].place, balls, t);
        if (normals) txi_onto_surface(t, normals[i]);
    }
    for (int i = 0; i < k->count; i++) txi_token_set(&k->at[i], scratch + 6 * (size_t)i);
}

/* ---- gradients --------------------------------------------------------------------------- */

enum {
    TXI_GRADIENT_UNIT = 64, /* stored gradients are in 1/64 of a level per pixel               */
    TXI_GRADIENT_TAPS = 3,  /* pixels; radius of the derivative of a Gaussian of sigma 1.2       */
    TXI_TENSOR_TAPS = 3,    /* pixels; radius of the Gaussian of sigma 1.5 over the tensor      */
    TXI_BAND_ROWS = 32,     /* rows that one call of a parallel loop computes                   */
    TXI_BANDS = 8,          /* calls of one loop                                                */
};

/* Gradients of a window. */
typedef struct txi_slopes {
    int width, height;
    const uint8_t *color; /* 4 per pixel                                                        */
    uint8_t *known;      /* 1: the colour counts                                                */
    int32_t *gap;        /* squared distance to the nearest pixel that is not known; this and tensor
                            only while lines are followed                                       */
    int16_t *gradient;   /* 6 per pixel: x and y of R, G, B; 0 where unknown                     */
    float *strength;     /* root of the sum of their squares, levels per pixel                  */
    int32_t *tensor;     /* sums of xx, xy, yy over RGB, smoothed, (1/16 level per pixel)^2       */
} txi_slopes;

/* 64 exp(-k^2 / 2 / 1.2^2): the derivative of a Gaussian is the slope of the plane that fits best
   with these weights. Next to pixels that are not known the plane is fitted to the known ones, so
   that the borders of the hole and of the surface are no edges. */
static const int txi_gradient_weight[TXI_GRADIENT_TAPS + 1] = {64, 45, 16, 3};

/* The slopes of the planes through the known pixels around (x, y): 6 numbers, levels per pixel. */
static void txi_slope(const txi_slopes *f, int x, int y, double slope[6]) {
    double m[6] = {0, 0, 0, 0, 0, 0}, v[3][3] = {{0}}; /* 1, x, y, xx, xy, yy; per channel 1, x,
                                                          y                                      */
    for (int j = -TXI_GRADIENT_TAPS; j <= TXI_GRADIENT_TAPS; j++) {
        for (int i = -TXI_GRADIENT_TAPS; i <= TXI_GRADIENT_TAPS; i++) {
            const int px = x + i, py = y + j;
            if (px < 0 || py < 0 || px >= f->width || py >= f->height) continue;
            const size_t at = (size_t)py * (size_t)f->width + (size_t)px;
            if (!f->known[at]) continue;
            const double w =
                txi_gradient_weight[i < 0 ? -i : i] * txi_gradient_weight[j < 0 ? -j : j];
            m[0] += w;
            m[1] += w * i;
            m[2] += w * j;
            m[3] += w * i * i;
            m[4] += w * i * j;
            m[5] += w * j * j;
            for (int c = 0; c < 3; c++) {
                const double value = w * f->color[4 * at + (size_t)c];
                v[c][0] += value;
                v[c][1] += value * i;
                v[c][2] += value * j;
            }
        }
    }
    for (int c = 0; c < 6; c++) slope[c] = 0;
    if (m[0] <= 0) return;
    const double xx = m[3] - m[1] * m[1] / m[0], xy = m[4] - m[1] * m[2] / m[0];
    const double yy = m[5] - m[2] * m[2] / m[0], det = xx * yy - xy * xy;
    if (det < 0.05 * m[0] * m[0]) return; /* pixels in one line, or too few: no slope             */
    for (int c = 0; c < 3; c++) {
        const double gx = v[c][1] - m[1] * v[c][0] / m[0], gy = v[c][2] - m[2] * v[c][0] / m[0];
        slope[2 * c] = (yy * gx - xy * gy) / det;
        slope[2 * c + 1] = (xx * gy - xy * gx) / det;
    }
}

static int16_t txi_gradient_round(double slope) {
    const double v = slope * (double)TXI_GRADIENT_UNIT;
    return (int16_t)(v < -32000 ? -32000 : v > 32000 ? 32000 : v < 0 ? v - 0.5 : v + 0.5);
}

/* The job of one band of rows. rows: scratch of this band, 6 * width * (TXI_BAND_ROWS + 6) ints */
typedef struct txi_slopes_job {
    txi_slopes *field;
    const int32_t *away; /* gradients are computed where this is at most reach; NULL: everywhere  */
    int32_t reach;
    int32_t *rows;
    int first;           /* band of index 0                                                     */
    int smooth;          /* 0: the gradients, 1: the tensor                                     */
} txi_slopes_job;

/* Horizontal sums of row y: smoothed and derived, RGB each. */
static void txi_gradient_row(const txi_slopes *f, int y, int32_t *out) {
    const uint8_t *c = f->color + 4 * (size_t)y * (size_t)f->width;
    for (int x = TXI_GRADIENT_TAPS; x < f->width - TXI_GRADIENT_TAPS; x++) {
        const uint8_t *p = c + 4 * x;
        for (int k = 0; k < 3; k++) {
            out[6 * x + k] = 64 * p[k] + 45 * (p[k - 4] + p[k + 4]) + 16 * (p[k - 8] + p[k + 8]) +
                             3 * (p[k - 12] + p[k + 12]);
            out[6 * x + 3 + k] = 45 * (p[k + 4] - p[k - 4]) + 32 * (p[k + 8] - p[k - 8]) +
                                 9 * (p[k + 12] - p[k - 12]);
        }
    }
}

static void txi_gradient_pixel(txi_slopes *f, int x, int y, const int32_t *row0, size_t pitch) {
    const size_t i = (size_t)y * (size_t)f->width + (size_t)x;
    const int taps = TXI_GRADIENT_TAPS;
    double slope[6], sum = 0;
    if (f->gap[i] > 2 * taps * taps && x >= taps && y >= taps && x < f->width - taps &&
        y < f->height - taps) {
        /* the sum of the weights is 192, that of weight * k^2 is 272                             */
        for (int c = 0; c < 3; c++) {
            int gx = 0, gy = 0;
            for (int k = -taps; k <= taps; k++) {
                const int32_t *r = row0 + (size_t)(k + taps) * pitch + 6 * (size_t)x;
                const int w = txi_gradient_weight[k < 0 ? -k : k];
                gx += w * r[3 + c];
                gy += w * k * r[c];
            }
            slope[2 * c] = gx / (192.0 * 272.0);
            slope[2 * c + 1] = gy / (192.0 * 272.0);
        }
    } else {
        txi_slope(f, x, y, slope);
    }
    for (int c = 0; c < 6; c++) {
        const int16_t g = txi_gradient_round(slope[c]);
        f->gradient[6 * i + (size_t)c] = g;
        sum += (double)g * g;
    }
    f->strength[i] = txm_float(sqrt(sum) / (double)TXI_GRADIENT_UNIT);
}

static void txi_gradient_band(const txi_slopes_job *job, int y0, int y1, int32_t *rows) {
    txi_slopes *f = job->field;
    const size_t pitch = 6 * (size_t)f->width;
    const int taps = TXI_GRADIENT_TAPS;
    for (int y = y0 - taps; y < y1 + taps; y++) {
        if (y >= 0 && y < f->height)
            txi_gradient_row(f, y, rows + (size_t)(y - y0 + taps) * pitch);
    }
    for (int y = y0; y < y1; y++) {
        for (int x = 0; x < f->width; x++) {
            const size_t i = (size_t)y * (size_t)f->width + (size_t)x;
            if (f->known[i] && (!job->away || job->away[i] <= job->reach))
                txi_gradient_pixel(f, x, y, rows + (size_t)(y - y0) * pitch, pitch);
        }
    }
}

/* xx, xy, yy of one row, smoothed horizontally by {18, 14, 7, 2} / 64. */
static void txi_tensor_row(const txi_slopes *f, int y, int32_t *out, int32_t *raw) {
    const int16_t *g = f->gradient + 6 * (size_t)y * (size_t)f->width;
    for (int x = 0; x < f->width; x++) {
        int32_t *t = raw + 3 * x;
        t[0] = t[1] = t[2] = 0;
        for (int c = 0; c < 3; c++) {
            const int gx = g[6 * x + 2 * c] / 4, gy = g[6 * x + 2 * c + 1] / 4;
            t[0] += gx * gx;
            t[1] += gx * gy;
            t[2] += gy * gy;
        }
        for (int k = 0; k < 3; k++) t[k] = t[k] > 16000000 ? 16000000 : t[k];
    }
    for (int x = 0; x < f->width; x++) {
        for (int k = 0; k < 3; k++) {
            int sum = 18 * raw[3 * x + k];
            if (x >= 1) sum += 14 * raw[3 * (x - 1) + k];
            if (x >= 2) sum += 7 * raw[3 * (x - 2) + k];
            if (x >= 3) sum += 2 * raw[3 * (x - 3) + k];
            if (x + 1 < f->width) sum += 14 * raw[3 * (x + 1) + k];
            if (x + 2 < f->width) sum += 7 * raw[3 * (x + 2) + k];
            if (x + 3 < f->width) sum += 2 * raw[3 * (x + 3) + k];
            out[3 * x + k] = sum / 64;
        }
    }
}

static void txi_tensor_band(const txi_slopes_job *job, int y0, int y1, int32_t *rows) {
    static const int weight[TXI_TENSOR_TAPS + 1] = {18, 14, 7, 2};
    txi_slopes *f = job->field;
    const size_t pitch = 3 * (size_t)f->width;
    const int taps = TXI_TENSOR_TAPS;
    int32_t *raw = rows + (size_t)(TXI_BAND_ROWS + 2 * taps) * pitch;
    for (int y = y0 - taps; y < y1 + taps; y++) {
        int32_t *out = rows + (size_t)(y - y0 + taps) * pitch;
        if (y >= 0 && y < f->height) txi_tensor_row(f, y, out, raw);
        else memset(out, 0, pitch * sizeof *out);
    }
    for (int y = y0; y < y1; y++) {
        int32_t *t = f->tensor + (size_t)y * pitch;
        for (size_t i = 0; i < pitch; i++) {
            int sum = 0;
            for (int k = -taps; k <= taps; k++)
                sum += weight[k < 0 ? -k : k] * rows[(size_t)(y - y0 + taps + k) * pitch + i];
            t[i] = sum / 64;
        }
    }
}

static void txi_slopes_body(void *context, int index) {
    const txi_slopes_job *job = (const txi_slopes_job *)context;
    const int y0 = (job->first + index) * TXI_BAND_ROWS;
    const int y1 =
        y0 + TXI_BAND_ROWS < job->field->height ? y0 + TXI_BAND_ROWS : job->field->height;
    int32_t *rows = job->rows + (size_t)index * 6 * (size_t)job->field->width * (TXI_BAND_ROWS + 6);
    if (job->smooth) txi_tensor_band(job, y0, y1, rows);
    else txi_gradient_band(job, y0, y1, rows);
}

/* The gradients of a picture where it is known; away and reach as in txi_slopes_job. The
   tensor's memory is that of brief, it is not needed once lines have been followed. */
static txm_status txi_slopes_make(txi_slopes *f, const int32_t *away, int32_t reach,
                                  txm_arena *arena, txm_arena *brief, txm_env *env) {
    const size_t count = (size_t)f->width * (size_t)f->height;
    const int bands = (f->height + TXI_BAND_ROWS - 1) / TXI_BAND_ROWS;
    const int most = bands < TXI_BANDS ? bands : TXI_BANDS;
    txi_slopes_job job;
    f->gradient = (int16_t *)txm_arena_zero(arena, count, 6 * sizeof *f->gradient);
    f->strength = (float *)txm_arena_zero(arena, count, sizeof *f->strength);
    f->tensor = (int32_t *)txm_arena_zero(brief, count, 3 * sizeof *f->tensor);
    job.rows = (int32_t *)txm_arena_zero(brief, (size_t)most * 6 * (size_t)f->width,
                                         (TXI_BAND_ROWS + 6) * sizeof *job.rows);
    if (arena->failed || brief->failed) return txi_no_memory(env);
    job.field = f;
    job.away = away;
    job.reach = reach;
    for (job.smooth = 0; job.smooth < 2; job.smooth++) {
        for (job.first = 0; job.first < bands; job.first += most)
            txm_parallel_for(env, bands - job.first < most ? bands - job.first : most,
                             txi_slopes_body, &job);
    }
    return TXM_OK;
}

/* The direction across the edge at a pixel, unit, and how clear it is, 0..1. */
static double txi_across(const txi_slopes *f, size_t i, double *nx, double *ny) {
    const double a = f->tensor[3 * i], b = f->tensor[3 * i + 1], c = f->tensor[3 * i + 2];
    const double half = 0.5 * (a - c), r = sqrt(half * half + b * b);
    double x = r + half, y = b;
    if (half < 0) {
        x = b;
        y = r - half;
    }
    const double n = sqrt(x * x + y * y);
    *nx = n > 0 ? x / n : 1;
    *ny = n > 0 ? y / n : 0;
    return a + c > 0 ? 2 * r / (a + c) : 0;
}

/* Bilinear gradient strength; 0 outside of the window. */
static double txi_strength_at(const txi_slopes *f, double x, double y) {
    if (!(x >= 0 && y >= 0 && x < f->width - 1 && y < f->height - 1)) return 0;
    const int ix = (int)x, iy = (int)y;
    const float *p = f->strength + (size_t)iy * (size_t)f->width + (size_t)ix;
    const double u = x - ix, v = y - iy;
    return (p[0] * (1 - u) + p[1] * u) * (1 - v) +
           (p[f->width] * (1 - u) + p[f->width + 1] * u) * v;
}

/* ---- lines near a hole ------------------------------------------------------------------------
   The structure of [1, II.A]: points of strong colour gradient near the hole, thinned to lines, and
   the ends of these lines at the border of the hole. A window is almost isometric to the
   surface, so the gradient in the window is the gradient on the surface. */

enum {
    TXI_PROFILE = 21,       /* samples of the colours across a line, half a pixel apart          */
    TXI_MAX_ENDS = 512,     /* the strongest ones are kept; ours                                */
    TXI_TRACE_LEAST = 24,   /* pixels; lines are followed outwards over 0.8 of the width of the */
    TXI_TRACE_MOST = 120,   /* hole, but within these limits; ours                              */
    TXI_INNER = 24,         /* steps towards the hole, from where an end was found; for flat
                               angles                                                            */
    TXI_END_REACHES = 30,   /* squared pixels; a line must come as near to the hole as that       */
    TXI_BENT_FIT = 40,      /* pixels; parabolas are fitted to as much of a line, or half of the
                               width of the hole; ours                                           */
    TXI_CORNER = 12,        /* points next to the hole that may have a direction of their own     */
    TXI_LOOK_AHEAD = 45     /* pixels beyond the hole in which lines are looked for; ours       */
};

/* A point of a thinned line. */
typedef struct txi_thin {
    txm_vec2 place;   /* window pixels                                                          */
    txm_vec2 along;   /* direction of the line, unit, either way                                */
    float strength;   /* gradient, levels per pixel                                             */
} txi_thin;

/* The end of a line at the border of the hole. */
typedef struct txi_end {
    txm_vec2 place;   /* where it enters the hole, window pixels                                */
    txm_vec2 heading; /* unit, into the hole                                                    */
    float curvature;  /* 1 / pixels, positive: it turns to the right (towards (-y, x) of heading) */
    float strength;   /* mean gradient along it, levels per pixel                               */
    float contrast;   /* difference of the colours of both sides, levels                        */
    float length;     /* pixels over which it was followed outwards                             */
    int is_long;      /* long enough to be a line and not grain                                 */
    int first, count; /* its points in txi_lines.points, from the border outwards, 1 pixel apart */
    float profile[TXI_PROFILE][3]; /* RGB across it from left to right, 5 pixels to each side   */
    float fit[6];     /* x = fit[0] + fit[1] s + fit[2] s^2, y with fit[3..5], s = pixels outwards
                         from place                                                             */
    float fit_length; /* over how many pixels that holds                                        */
} txi_end;

/* What is known about the lines of a window. */
typedef struct txi_lines {
    txi_end *ends;
    int end_count;
    txm_vec2 *points; /* of the ends                                                            */
    int point_count;
    txi_thin *thin;   /* all points of lines near the hole                                      */
    int thin_count;
    int32_t *thin_at; /* one per pixel: the point in it, or -1                                  */
    int32_t *away;    /* one per pixel: squared distance to the nearest pixel of the hole        */
    int32_t *depth;   /* one per pixel: squared distance to the nearest pixel outside of the hole */
    txi_slopes field;
    float threshold;  /* least gradient of a line, levels per pixel                             */
    float width;      /* of the hole: twice the radius of the largest disc in it, pixels        */
    float limit;      /* pixels over which lines were followed                                  */
    float share_long; /* share of ends that are long; 0.45 or more: there is structure          */
} txi_lines;

/* ---- following a line -------------------------------------------------------------------- */

/* A place on a line that is being followed. */
typedef struct txi_walk {
    double x, y, dx, dy; /* place, unit direction                                               */
    double change[3];    /* derivative of RGB to the right, levels per pixel, a running mean     */
} txi_walk;

/* Derivative of RGB in direction (rx, ry) at a pixel, levels per pixel. */
static void txi_change_at(const txi_slopes *f, size_t i, double rx, double ry, double change[3]) {
    const int16_t *g = f->gradient + 6 * i;
    for (int c = 0; c < 3; c++)
        change[c] = (g[2 * c] * rx + g[2 * c + 1] * ry) / (double)TXI_GRADIENT_UNIT;
}

/* Correlation of two colour changes, -1..1. */
static double txi_agree(const double a[3], const double b[3]) {
    const double aa = a[0] * a[0] + a[1] * a[1] + a[2] * a[2];
    const double bb = b[0] * b[0] + b[1] * b[1] + b[2] * b[2];
    const double ab = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    return aa > 0 && bb > 0 ? ab / sqrt(aa * bb) : 0;
}

/* Move a place across the direction (rx, ry), by at most 1 pixel, to where the gradient is largest:
   five samples and a parabola. Returns the gradient there. */
static double txi_centre(const txi_slopes *f, double rx, double ry, double *x, double *y) {
    double s[5], best = -1;
    int k = 2;
    static const int order[5] = {2, 1, 3, 0, 4}; /* ties: least movement                         */
    for (int i = 0; i < 5; i++) {
        const double o = 0.5 * (order[i] - 2);
        s[order[i]] = txi_strength_at(f, *x + o * rx, *y + o * ry);
        if (s[order[i]] > best) {
            best = s[order[i]];
            k = order[i];
        }
    }
    double o = 0.5 * (k - 2);
    if (k > 0 && k < 4) {
        const double bend = s[k - 1] + s[k + 1] - 2 * s[k];
        if (bend < 0) o += 0.25 * (s[k - 1] - s[k + 1]) / bend;
    }
    *x += o * rx;
    *y += o * ry;
    return best;
}

/* One step along a line; 0: it ends here. least: gradient below which it ends. */
static int txi_walk_on(const txi_slopes *f, txi_walk *k, double step, double least) {
    double x = k->x + step * k->dx, y = k->y + step * k->dy, nx, ny, change[3];
    const double strength = txi_centre(f, -k->dy, k->dx, &x, &y);
    const ptrdiff_t at = txi_pixel(f->width, f->height, x, y);
    if (strength < least || at < 0 || !f->known[at]) return 0;
    const double clear = txi_across(f, (size_t)at, &nx, &ny);
    double tx = -ny, ty = nx, turn = tx * k->dx + ty * k->dy;
    if (turn < 0) {
        tx = -tx;
        ty = -ty;
        turn = -turn;
    }
    if (clear < 0.3 || turn < 0.5) { /* a junction: straight on                                   */
        tx = k->dx;
        ty = k->dy;
    }
    const txm_vec2 d = txi_unit(tx + k->dx, ty + k->dy);
    txi_change_at(f, (size_t)at, -(double)d.y, d.x, change);
    if (txi_agree(change, k->change) < 0.5) return 0;
    for (int c = 0; c < 3; c++) k->change[c] = 0.85 * k->change[c] + 0.15 * change[c];
    /* it must get on, not slide back and forth                                                   */
    if ((x - k->x) * k->dx + (y - k->y) * k->dy < 0.5 * step) return 0;
    k->x = x;
    k->y = y;
    k->dx = d.x;
    k->dy = d.y;
    return 1;
}

/* ---- points of lines --------------------------------------------------------------------- */

/* The gradient that 98.5 % of the known pixels near the hole do not reach. */
static double txi_strong(const txi_slopes *f, const int32_t *away, int32_t reach) {
    enum { BINS = 4096 };  /* of a quarter level per pixel                                        */
    size_t bins[BINS] = {0}, total = 0, sum = 0;
    const size_t count = (size_t)f->width * (size_t)f->height;
    for (size_t i = 0; i < count; i++) {
        if (!f->known[i] || away[i] > reach) continue;
        bins[txm_clampi((int)(f->strength[i] * 4), 0, BINS - 1)]++;
        total++;
    }
    for (int k = BINS - 1; k > 0; k--) {
        sum += bins[k];
        if (sum * 200 >= total * 3) return 0.25 * k;
    }
    return 0;
}

/* Is pixel (x, y) a maximum of the gradient across the edge? Writes the point. */
static int txi_thin_pixel(const txi_slopes *f, int x, int y, double least, txi_thin *out) {
    const size_t i = (size_t)y * (size_t)f->width + (size_t)x;
    double nx, ny;
    if (f->strength[i] < least) return 0;
    const double clear = txi_across(f, i, &nx, &ny);
    const ptrdiff_t a = txi_pixel(f->width, f->height, x + nx, y + ny);
    const ptrdiff_t b = txi_pixel(f->width, f->height, x - nx, y - ny);
    if (clear < 0.3 || a < 0 || b < 0 || !f->known[a] || !f->known[b]) return 0;
    const double s = f->strength[i], before = txi_strength_at(f, x - nx, y - ny);
    const double after = txi_strength_at(f, x + nx, y + ny);
    if (before > s || after > s || (before >= s && after >= s)) return 0;
    const double bend = before + after - 2 * s, o = bend < 0 ? 0.5 * (before - after) / bend : 0;
    out->place = txm_v2(txm_float(x + o * nx), txm_float(y + o * ny));
    out->along = txm_v2(txm_float(-ny), txm_float(nx));
    out->strength = f->strength[i];
    return 1;
}

/* All points of lines near the hole, in raster order. */
static txm_status txi_thin_all(txi_lines *l, int32_t reach, txm_arena *arena, txm_env *env) {
    const txi_slopes *f = &l->field;
    const size_t count = (size_t)f->width * (size_t)f->height;
    l->thin_at = (int32_t *)txm_arena_alloc(arena, count, sizeof *l->thin_at);
    if (arena->failed) return txi_no_memory(env);
    for (int pass = 0; pass < 2; pass++) { /* count, then keep                                    */
        int n = 0;
        for (int y = 0; y < f->height; y++) {
            for (int x = 0; x < f->width; x++) {
                const size_t i = (size_t)y * (size_t)f->width + (size_t)x;
                txi_thin point;
                l->thin_at[i] = -1;
                if (!f->known[i] || l->away[i] > reach) continue;
                if (!txi_thin_pixel(f, x, y, l->threshold, &point)) continue;
                if (pass) {
                    l->thin[n] = point;
                    l->thin_at[i] = n;
                }
                n++;
            }
        }
        l->thin_count = n;
        if (pass || n == 0) continue;
        l->thin = (txi_thin *)txm_arena_alloc(arena, (size_t)n, sizeof *l->thin);
        if (arena->failed) return txi_no_memory(env);
    }
    return TXM_OK;
}

/* ---- ends of lines ----------------------------------------------------------------------- */

/* The direction into the hole at a place outside of it: against the gradient of the distance,
   averaged over some pixels. */
static txm_vec2 txi_inwards(const txi_lines *l, int x, int y) {
    const int w = l->field.width, h = l->field.height;
    double gx = 0, gy = 0;
    for (int j = -4; j <= 4; j++) {
        for (int i = -4; i <= 4; i++) {
            const int px = x + i, py = y + j;
            if (px < 0 || py < 0 || px >= w || py >= h) continue;
            const size_t at = (size_t)py * (size_t)w + (size_t)px;
            const double k = l->depth[at] > 0 ? 1 : 0;
            gx += k * i;
            gy += k * j;
        }
    }
    return txi_unit(gx, gy);
}

/* Follow a line from a point near the border both ways: points from the border outwards. Returns
   how many; walk receives the direction inwards at the first point. */
static int txi_follow(const txi_lines *l, const txi_thin *from, txm_vec2 inwards, txm_vec2 *points,
                      int capacity, double *strength) {
    const txi_slopes *f = &l->field;
    const double least = 0.5 * l->threshold > 0.25 * from->strength ? 0.5 * l->threshold
                                                                     : 0.25 * from->strength;
    txm_vec2 back[TXI_INNER];
    int n = 0, inner = 0, steps = 0;
    double sum = 0;
    for (int way = 0; way < 2; way++) {
        txi_walk k;
        const double side = (double)from->along.x * inwards.x + (double)from->along.y * inwards.y;
        const double sign = (side < 0) == (way == 0) ? -1 : 1; /* way 0: inwards                  */
        const ptrdiff_t at = txi_pixel(f->width, f->height, from->place.x, from->place.y);
        k.x = from->place.x;
        k.y = from->place.y;
        k.dx = sign * from->along.x;
        k.dy = sign * from->along.y;
        if (at < 0) return 0;
        txi_change_at(f, (size_t)at, -k.dy, k.dx, k.change);
        if (way == 1) {
            TXM_ASSERT(inner < capacity);
            while (inner > 0) points[n++] = back[--inner];
            points[n++] = from->place;
        }
        while (way == 0 ? inner < TXI_INNER : n < capacity) {
            if (!txi_walk_on(f, &k, 1, least)) break;
            const ptrdiff_t i = txi_pixel(f->width, f->height, k.x, k.y);
            if (way == 0) {
                if (l->away[i] < 2) break;
                if (l->away[i] > 36) return 0; /* it passes by                                    */
                back[inner++] = txm_v2(txm_float(k.x), txm_float(k.y));
            } else {
                /* back at the border of the hole: it does not lead away from it                  */
                if (l->away[i] < 4) break;
                points[n++] = txm_v2(txm_float(k.x), txm_float(k.y));
                sum += f->strength[i];
                steps++;
            }
        }
    }
    *strength = steps ? sum / steps : from->strength;
    return n;
}

/* Fit x = a + b s + c s^2 by weighted least squares to points 0..n-1, s their distances along the
   line from the first, weights 1 / (1 + s / 16); degree 1: c = 0. Returns the root mean square
   distance. */
static double txi_fit_line(const txm_vec2 *points, int n, int degree, double fit[6]) {
    double m[5] = {0}, v[2][3] = {{0}}, error = 0, s = 0, total = 0;
    const double scale = n > 1 ? n - 1 : 1; /* s / scale is about 0..1                            */
    for (int i = 0; i < n; i++) {
        if (i) s += txi_distance(points[i], points[i - 1]);
        const double t = s / scale, w = 1 / (1 + s / 16);
        const double p[2] = {points[i].x - (double)points[0].x, points[i].y - (double)points[0].y};
        double power = w;
        for (int k = 0; k < 5; k++, power *= t) {
            m[k] += power;
            if (k < 3) {
                v[0][k] += power * p[0];
                v[1][k] += power * p[1];
            }
        }
    }
    for (int d = 0; d < 2; d++) {
        const double *r = v[d];
        const double a = m[2] - m[1] * m[1] / m[0], b = m[3] - m[1] * m[2] / m[0];
        const double c = m[4] - m[2] * m[2] / m[0];
        const double q = r[1] - m[1] * r[0] / m[0], u = r[2] - m[2] * r[0] / m[0];
        const double det = a * c - b * b;
        const double c2 = degree > 1 && det > 1e-12 ? (a * u - b * q) / det : 0;
        const double c1 = a > 1e-12 ? (q - b * c2) / a : 0;
        fit[3 * d] = (r[0] - m[1] * c1 - m[2] * c2) / m[0] + (d ? points[0].y : points[0].x);
        fit[3 * d + 1] = c1 / scale;
        fit[3 * d + 2] = c2 / (scale * scale);
    }
    s = 0;
    for (int i = 0; i < n; i++) {
        if (i) s += txi_distance(points[i], points[i - 1]);
        const double w = 1 / (1 + s / 16);
        const double x = fit[0] + fit[1] * s + fit[2] * s * s - points[i].x;
        const double y = fit[3] + fit[4] * s + fit[5] * s * s - points[i].y;
        error += w * (x * x + y * y);
        total += w;
    }
    return sqrt(error / total);
}

/* How far a fitted line is from the first 8 points, root of the mean square. */
static double txi_fit_start(const txm_vec2 *points, int n, const double fit[6]) {
    double s = 0, error = 0;
    int i = 0;
    for (; i < n && i < 8; i++) {
        if (i) s += txi_distance(points[i], points[i - 1]);
        const double x = fit[0] + fit[1] * s + fit[2] * s * s - points[i].x;
        const double y = fit[3] + fit[4] * s + fit[5] * s * s - points[i].y;
        error += x * x + y * y;
    }
    return sqrt(error / i);
}

/* The curve of the first of count points, as in txi_end.fit with s = 0 at the first point. Returns
   to how many points it was fitted. */
static int txi_fit_points(const txi_lines *l, const txm_vec2 *points, int count, double fit[6]) {
    const int bent = l->width > 2 * TXI_BENT_FIT ? (int)(0.5f * l->width) : TXI_BENT_FIT;
    double line[6] = {0};
    int n = count;
    for (;;) {
        /* a straight line unless a bent one is clearly better: the direction is more exact. Over
           long pieces a parabola is no arc */
        const double straight = txi_fit_line(points, n, 1, line);
        const double rms = txi_fit_line(points, n, 2, fit);
        const int is_straight = n <= 8 || straight < 1.25 * rms + 0.03;
        if (is_straight) memcpy(fit, line, sizeof line);
        if (n <= 8) break;
        if ((is_straight ? straight : rms) < 0.5 && txi_fit_start(points, n, fit) < 0.3 &&
            (is_straight || n <= bent))
            break;
        n = n * 3 / 4;
    }
    /* a corner near the hole: the first points alone are straight, in another direction          */
    if (n > TXI_CORNER && txi_fit_line(points, TXI_CORNER, 1, line) < 0.12) {
        const txm_vec2 p = txi_unit(line[1], line[4]), q = txi_unit(fit[1], fit[4]);
        if (fabs((double)p.x * q.y - (double)p.y * q.x) > 0.15) {
            memcpy(fit, line, sizeof line);
            n = TXI_CORNER;
        }
    }
    return n;
}

/* Fit the line, find where it enters the hole, its direction and curvature there. 0: it does
   not. */
static int txi_fit_end(const txi_window *w, const txi_lines *l, const txm_vec2 *points,
                       txi_end *e) {
    double fit[6] = {0}, s = 0;
    int found = 0;
    const int n = txi_fit_points(l, points, e->count, fit);
    for (int i = 0; i < 80 && !found; i++) { /* out of the picture in quarter pixels, 20 pixels   */
        s = -0.25 * i;
        const ptrdiff_t at = txi_pixel(w->width, w->height, fit[0] + fit[1] * s + fit[2] * s * s,
                                       fit[3] + fit[4] * s + fit[5] * s * s);
        if (at < 0 || w->state[at] == TXI_VOID) return 0;
        found = w->state[at] == TXI_HOLE;
    }
    if (!found) return 0;
    const double dx = fit[1] + 2 * fit[2] * s, dy = fit[4] + 2 * fit[5] * s;
    const double speed = sqrt(dx * dx + dy * dy);
    if (speed < 0.1) return 0;
    for (int d = 0; d < 2; d++) { /* from now on s = 0 is the border                              */
        double *p = fit + 3 * d;
        p[0] += p[1] * s + p[2] * s * s;
        p[1] += 2 * p[2] * s;
    }
    for (int k = 0; k < 6; k++) e->fit[k] = txm_float(fit[k]);
    e->fit_length = txm_float(n - s);
    e->place = txm_v2(e->fit[0], e->fit[3]);
    e->heading = txi_unit(-dx, -dy);
    e->curvature = txm_float(-2 * (fit[1] * fit[5] - fit[4] * fit[2]) / (speed * speed * speed));
    return 1;
}

/* Colours across the line, a mean over its first pixels. Samples that fall into unknown pixels are
   left out; where there are none the next one towards the line counts. */
static void txi_profile(const txi_window *w, const txi_lines *l, txi_end *e) {
    const txm_vec2 *p = l->points + e->first;
    const int mid = TXI_PROFILE / 2;
    double sum[TXI_PROFILE][3] = {{0}}, side[2][3] = {{0}};
    int hits[TXI_PROFILE] = {0};
    for (int i = 0; i < e->count && i < 12; i++) {
        const int a = i > 2 ? i - 2 : 0, b = i + 2 < e->count ? i + 2 : e->count - 1;
        const txm_vec2 d = txi_unit((double)p[a].x - p[b].x, (double)p[a].y - p[b].y);
        for (int k = 0; k < TXI_PROFILE; k++) {
            const double o = 0.5 * (k - mid), x = p[i].x - o * d.y, y = p[i].y + o * d.x;
            const ptrdiff_t at = txi_pixel(w->width, w->height, x, y);
            if (at < 0 || !l->field.known[at]) continue;
            for (int c = 0; c < 3; c++) sum[k][c] += w->color[4 * at + c];
            hits[k]++;
        }
    }
    for (int o = 0; o <= mid; o++) {
        for (int s = -1; s < 2; s += 2) {
            const int k = mid + s * o, inner = o ? k - s : k;
            for (int c = 0; c < 3; c++) {
                const double outer = hits[k] ? sum[k][c] / hits[k] : o ? e->profile[inner][c] : 128;
                e->profile[k][c] = txm_float(outer);
                if (o >= 2 && o <= 6) side[s > 0][c] += outer / 5;
            }
        }
    }
    double difference = 0;
    for (int c = 0; c < 3; c++) difference += (side[0][c] - side[1][c]) * (side[0][c] - side[1][c]);
    e->contrast = txm_float(sqrt(difference / 3));
}

/* Is there an end already that is the same line? */
static int txi_end_exists(const txi_lines *l, const txi_end *e) {
    for (int i = 0; i < l->end_count; i++) {
        const txi_end *o = &l->ends[i];
        if (txi_distance(e->place, o->place) > 2.5) continue;
        const double d = (double)e->heading.x * o->heading.x + (double)e->heading.y * o->heading.y;
        double a[3], b[3];
        for (int c = 0; c < 3; c++) {
            a[c] = (double)e->profile[12][c] - e->profile[8][c];
            b[c] = (double)o->profile[12][c] - o->profile[8][c];
        }
        if (d > 0.5 && txi_agree(a, b) > 0.3) return 1;
        if (txi_distance(e->place, o->place) < 1 && d > 0.5) return 1;
    }
    return 0;
}

/* Try a point of a line as the end of that line. room: points of one end */
static void txi_try_end(const txi_window *w, txi_lines *l, const txi_thin *t, int room) {
    txi_end *e = &l->ends[l->end_count];
    const txm_vec2 in = txi_inwards(l, (int)(t->place.x + 0.5f), (int)(t->place.y + 0.5f));
    double strength;
    if (fabs((double)in.x * t->along.x + (double)in.y * t->along.y) < 0.12) return;
    e->first = l->point_count;
    e->count = txi_follow(l, t, in, l->points + e->first, room, &strength);
    if (e->count < 5) return;
    const txm_vec2 p = l->points[e->first];
    const ptrdiff_t at = txi_pixel(w->width, w->height, p.x, p.y);
    if (at < 0 || l->away[at] > TXI_END_REACHES || !txi_fit_end(w, l, l->points + e->first, e))
        return;
    e->strength = txm_float(strength);
    e->length = (float)e->count;
    e->is_long = e->length >= (float)TXI_TRACE_LEAST || e->length >= 0.8f * l->limit;
    txi_profile(w, l, e);
    if (txi_end_exists(l, e)) return;
    l->point_count += e->count;
    l->end_count++;
}

/* Ends from points near the hole: 2.6 to 4.2 pixels from it, then up to 6 pixels, for lines that
   are lost on their last pixels; the strongest first. */
static txm_status txi_find_ends(const txi_window *w, txi_lines *l, txm_arena *arena,
                                txm_arena *scratch, txm_env *env) {
    const int room = (int)l->limit + TXI_INNER;
    txm_pair *order =
        (txm_pair *)txm_arena_alloc(scratch, (size_t)l->thin_count, 2 * sizeof *order);
    if (l->thin_count == 0) return TXM_OK;
    l->ends = (txi_end *)txm_arena_zero(arena, TXI_MAX_ENDS, sizeof *l->ends);
    l->points = (txm_vec2 *)txm_arena_alloc(arena, TXI_MAX_ENDS * (size_t)room, sizeof *l->points);
    if (arena->failed || scratch->failed) return txi_no_memory(env);
    for (int pass = 0; pass < 2; pass++) {
        size_t count = 0;
        for (int i = 0; i < l->thin_count; i++) {
            const txm_vec2 p = l->thin[i].place;
            const ptrdiff_t at = txi_pixel(w->width, w->height, p.x, p.y);
            if (at < 0 || l->away[at] < (pass ? 18 : 7) || l->away[at] > (pass ? 36 : 17)) continue;
            order[count].key = ~txm_sort_key(l->thin[i].strength);
            order[count++].value = (uint32_t)i;
        }
        txm_sort_pairs(order, order + l->thin_count, count);
        for (size_t k = 0; k < count && l->end_count < TXI_MAX_ENDS; k++)
            txi_try_end(w, l, &l->thin[order[k].value], room);
    }
    return TXM_OK;
}

/* ---- all of it --------------------------------------------------------------------------- */

/* known pixels, distances, the width of the hole */
static txm_status txi_lines_begin(const txi_window *w, txm_arena *arena, txm_arena *scratch,
                                  txm_env *env, txi_lines *l) {
    const size_t count = (size_t)w->width * (size_t)w->height;
    const int longer = w->width > w->height ? w->width : w->height;
    int32_t deepest = 0;
    uint8_t *mark = (uint8_t *)txm_arena_alloc(scratch, count, 1);
    int32_t *row = (int32_t *)txm_arena_alloc(scratch, (size_t)longer, 3 * sizeof *row);
    l->field.width = w->width;
    l->field.height = w->height;
    l->field.color = w->color;
    l->field.known = (uint8_t *)txm_arena_alloc(arena, count, 1);
    l->field.gap = (int32_t *)txm_arena_alloc(scratch, count, sizeof *l->field.gap);
    l->away = (int32_t *)txm_arena_alloc(arena, count, sizeof *l->away);
    l->depth = (int32_t *)txm_arena_alloc(arena, count, sizeof *l->depth);
    if (arena->failed || scratch->failed) return txi_no_memory(env);
    for (size_t i = 0; i < count; i++) {
        l->field.known[i] = w->state[i] == TXI_KNOWN || w->state[i] == TXI_FOREIGN;
        mark[i] = !l->field.known[i];
    }
    txi_distances(mark, w->width, w->height, row, l->field.gap);
    for (size_t i = 0; i < count; i++) mark[i] = w->state[i] == TXI_HOLE;
    txi_distances(mark, w->width, w->height, row, l->away);
    for (size_t i = 0; i < count; i++) mark[i] = w->state[i] != TXI_HOLE;
    txi_distances(mark, w->width, w->height, row, l->depth);
    for (size_t i = 0; i < count; i++) {
        if (l->depth[i] > deepest && l->depth[i] < TXI_FAR) deepest = l->depth[i];
    }
    l->width = txm_float(2 * sqrt((double)deepest));
    l->limit = txm_clampf(0.8f * l->width, TXI_TRACE_LEAST, TXI_TRACE_MOST);
    return TXM_OK;
}

/* Find the lines that end at the hole of a window.

   arena  holds the results
   return TXM_OK, also if there are none; TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost   O(pixels) + O(length of lines); 46 bytes per pixel while it runs, 30 after              */
static txm_status txi_trace(const txi_window *w, txm_arena *arena, txm_env *env, txi_lines *lines) {
    txm_arena scratch;
    int longs = 0;
    txm_arena_init(&scratch, env);
    memset(lines, 0, sizeof *lines);
    txm_status status = txi_lines_begin(w, arena, &scratch, env, lines);
    const int reach = (int)lines->limit + TXI_LOOK_AHEAD;
    if (status == TXM_OK && txm_progress(env, 0, "lines")) status = txi_stopped(env);
    if (status == TXM_OK)
        status = txi_slopes_make(&lines->field, lines->away, reach * reach, arena, &scratch, env);
    if (status == TXM_OK && txm_progress(env, 0, "lines")) status = txi_stopped(env);
    if (status == TXM_OK) {
        const double strong = 0.3 * txi_strong(&lines->field, lines->away, reach * reach);
        lines->threshold = txm_float(strong > 6 ? strong : 6);
        status = txi_thin_all(lines, reach * reach, arena, env);
    }
    if (status == TXM_OK && txm_progress(env, 0, "lines")) status = txi_stopped(env);
    if (status == TXM_OK) status = txi_find_ends(w, lines, arena, &scratch, env);
    for (int i = 0; i < lines->end_count && status == TXM_OK; i++) longs += lines->ends[i].is_long;
    if (lines->end_count && status == TXM_OK)
        lines->share_long = (float)longs / (float)lines->end_count;
    lines->field.gap = lines->field.tensor = NULL; /* they were in scratch                        */
    txm_arena_free(&scratch);
    return status;
}

/* ---- lines grow into the hole -----------------------------------------------------------------
   [1, II.B]: the points of the lines around the hole vote; ball tensors first, as only their places
   are known. Then, round by round, each line takes the place of most saliency ahead of it as a new
   point, whose tensor is set anew, until it is as near to another line as alpha, leaves the hole,
   has no votes left, or beta rounds are over.

   The paper joins the two lines then. Here growth and the field of votes only say how well two ends
   go together: lines that grow drift where there is a gap to bridge, and which ones meet first is
   chance.                                                                                        */

enum {
    TXI_TOKEN_STEP = 3,     /* pixels between the points of a line that vote; ours                */
    TXI_TOKENS_OF_END = 14, /* points of each line                                                */
    TXI_GROW_ROUNDS = 64    /* at most, if beta is 0                                              */
};

/* The surface at a place: the point on it, the normal, and unit tangents along the window's
   axes. Pixels that are void count as flat. */
typedef struct txi_spot {
    txm_dvec3 place, normal, ex, ey;
    int used; /* of the dense map: votes are counted here                                         */
} txi_spot;

typedef struct txi_grown {
    const txi_window *window;
    txi_fields fields;
    txi_tokens tokens;
    int *owner;        /* one per token: the end of its line                                      */
    int step;          /* pixels between the places of the dense map; a line grows as far in a
                          round                                                                  */
    int width, height; /* of the dense map, which covers the hole                                 */
    int left, top;     /* pixel of its first place                                                */
    txi_spot *spots;   /* 1 per place of the dense map                                           */
    double *votes;     /* 6 per place                                                             */
    uint8_t *met;      /* end_count squared: 1: the lines of the two ends met                     */
    int end_count;
} txi_grown;

static txi_spot txi_spot_at(const txi_window *w, double x, double y) {
    txi_spot s;
    s.used = 0;
    const int ix = txm_clampi((int)floor(x + 0.5), 0, w->width - 1);
    const int iy = txm_clampi((int)floor(y + 0.5), 0, w->height - 1);
    const size_t i = (size_t)iy * (size_t)w->width + (size_t)ix;
    txm_dvec3 e[2];
    s.place = txm_d3(x, y, 0);
    s.normal = txm_d3(0, 0, 1);
    s.ex = txm_d3(1, 0, 0);
    s.ey = txm_d3(0, 1, 0);
    if (w->state[i] == TXI_VOID) return s;
    for (int d = 0; d < 2; d++) { /* differences to the neighbours that exist                     */
        const int at = d ? iy : ix, limit = d ? w->height : w->width;
        const size_t step = d ? (size_t)w->width : 1;
        const size_t low = at > 0 && w->state[i - step] != TXI_VOID ? i - step : i;
        const size_t high = at + 1 < limit && w->state[i + step] != TXI_VOID ? i + step : i;
        const txm_vec3 p = w->place[low], q = w->place[high];
        e[d] = txm_d3((double)q.x - p.x, (double)q.y - p.y, (double)q.z - p.z);
        if (low != i && high != i) e[d] = txm_d3_scale(e[d], 0.5);
        if (low == high || txm_d3_len2(e[d]) < 1e-4 || txm_d3_len2(e[d]) > 9) return s;
    }
    const txm_vec3 p = w->place[i], n = w->normal[i];
    s.place = txm_d3(p.x, p.y, p.z);
    s.place = txm_d3_mad(txm_d3_mad(s.place, e[0], x - ix), e[1], y - iy);
    s.normal = txm_d3_unit(txm_d3(n.x, n.y, n.z));
    s.ex = txm_d3_unit(txm_d3_mad(e[0], s.normal, -txm_d3_dot(e[0], s.normal)));
    s.ey = txm_d3_unit(txm_d3_mad(e[1], s.normal, -txm_d3_dot(e[1], s.normal)));
    return s;
}

static double txi_form(const double t[6], txm_dvec3 a, txm_dvec3 b) {
    return a.x * (t[0] * b.x + t[1] * b.y + t[2] * b.z) +
           a.y * (t[1] * b.x + t[3] * b.y + t[4] * b.z) +
           a.z * (t[2] * b.x + t[4] * b.y + t[5] * b.z);
}

/* Add a stick to the tokens, and its votes to the dense map. (x, y): its place in the window */
static void txi_grow_add(txi_grown *g, double x, double y, txm_dvec3 place, txm_dvec3 normal,
                         double weight, int owner) {
    const double reach = g->fields.reach / g->step, cx = (x - g->left) / g->step;
    const double cy = (y - g->top) / g->step;
    double t[6] = {0};
    if (g->tokens.count >= g->tokens.room) return;
    txi_outer(t, normal, weight);
    g->owner[g->tokens.count] = owner;
    txi_tokens_add(&g->tokens, place, t);
    /* a window is almost isometric: what is in reach on the surface is so in the window, nearly  */
    const int x0 = txm_clampi((int)(cx - reach), 0, g->width);
    const int x1 = txm_clampi((int)(cx + reach) + 2, 0, g->width);
    const int y0 = txm_clampi((int)(cy - reach), 0, g->height);
    const int y1 = txm_clampi((int)(cy + reach) + 2, 0, g->height);
    for (int j = y0; j < y1; j++) {
        for (int i = x0; i < x1; i++) {
            const size_t at = (size_t)j * (size_t)g->width + (size_t)i;
            if (g->spots[at].used)
                txi_vote_stick(&g->fields, normal, txm_d3_sub(g->spots[at].place, place), weight,
                               g->votes + 6 * at);
        }
    }
}

/* The votes at a place of the window, from the four places of the dense map around it: a tensor
   in the window's axes, xx xy yy. */
static void txi_votes_in_window(const txi_grown *g, double x, double y, double t[3]) {
    const double cx = (x - g->left) / g->step, cy = (y - g->top) / g->step;
    const int ix = txm_clampi((int)floor(cx), 0, g->width - 2);
    const int iy = txm_clampi((int)floor(cy), 0, g->height - 2);
    const double u = cx - ix < 0 ? 0 : cx - ix > 1 ? 1 : cx - ix;
    const double v = cy - iy < 0 ? 0 : cy - iy > 1 ? 1 : cy - iy;
    t[0] = t[1] = t[2] = 0;
    for (int k = 0; k < 4; k++) {
        const size_t at = (size_t)(iy + k / 2) * (size_t)g->width + (size_t)(ix + k % 2);
        const txi_spot *s = &g->spots[at];
        const double w = (k & 1 ? u : 1 - u) * (k & 2 ? v : 1 - v), *votes = g->votes + 6 * at;
        if (!s->used || w <= 0) continue;
        t[0] += w * txi_form(votes, s->ex, s->ex);
        t[1] += w * txi_form(votes, s->ex, s->ey);
        t[2] += w * txi_form(votes, s->ey, s->ey);
    }
}

/* The lines' points as tokens: balls vote, then sticks of length one in the directions found. */
static txm_status txi_grow_begin(txi_grown *g, const txi_lines *l, txm_arena *scratch,
                                 txm_env *env) {
    const int room = l->end_count * TXI_TOKENS_OF_END;
    static const double unit[6] = {1, 0, 0, 1, 0, 1};
    txi_fields balls;
    txi_tokens points;
    int *owner = (int *)txm_arena_alloc(scratch, (size_t)room, sizeof *owner);
    txm_dvec3 *normals = (txm_dvec3 *)txm_arena_alloc(scratch, (size_t)room, sizeof *normals);
    double *votes = (double *)txm_arena_alloc(scratch, (size_t)room, 6 * sizeof *votes);
    txm_vec2 *where = (txm_vec2 *)txm_arena_alloc(scratch, (size_t)room, sizeof *where);
    if (scratch->failed) return txi_no_memory(env);
    txi_fields_make(&balls, 4, 0);
    txm_status status = txi_tokens_make(&points, room, balls.reach, scratch, env);
    if (status != TXM_OK) return status;
    for (int e = 0; e < l->end_count; e++) {
        for (int i = 0; i < TXI_TOKENS_OF_END && i * TXI_TOKEN_STEP < l->ends[e].count; i++) {
            const txm_vec2 p = l->points[l->ends[e].first + i * TXI_TOKEN_STEP];
            const txi_spot s = txi_spot_at(g->window, p.x, p.y);
            normals[points.count] = s.normal;
            owner[points.count] = e;
            where[points.count] = p;
            txi_tokens_add(&points, s.place, unit);
        }
    }
    txi_vote_sparse(&balls, &points, 1, normals, votes);
    for (int i = 0; i < points.count; i++) {
        const txi_token *k = &points.at[i];
        if (k->stick <= 0) continue; /* it is alone                                               */
        txi_grow_add(g, where[i].x, where[i].y, k->place, k->normal, 1, owner[i]);
    }
    return TXM_OK;
}

/* The line of another end that has come within alpha of a place, or -1. */
static int txi_grow_meets(const txi_grown *g, int end, txm_dvec3 place, double alpha) {
    const txi_tokens *k = &g->tokens;
    const int64_t cx = txi_cell(k, place.x), cy = txi_cell(k, place.y), cz = txi_cell(k, place.z);
    int best = -1;
    double least = alpha * alpha;
    for (int i = 0; i < 27; i++) {
        const int64_t x = cx + i % 3 - 1, y = cy + i / 3 % 3 - 1, z = cz + i / 9 - 1;
        for (int j = k->bucket[txi_bucket(k, x, y, z)]; j >= 0; j = k->at[j].next) {
            const double d = txm_d3_dist2(k->at[j].place, place);
            if (g->owner[j] == end || d > least || (d >= least && j > best)) continue;
            least = d;
            best = j;
        }
    }
    return best < 0 ? -1 : g->owner[best];
}

/* One round of the line of an end: a step in that of seven directions, up to 45 degrees to
   either side, which has the most votes for a line in this direction. 0: it has stopped. */
static int txi_grow_step(txi_grown *g, int end, double least, txm_vec2 *tip, txm_vec2 *heading) {
    const txi_window *w = g->window;
    double best = least, bx = 0, by = 0, hx = 0, hy = 0;
    for (int i = 0; i < 7; i++) {
        const int k = i & 1 ? (i + 1) / 2 : -(i / 2); /* straight on first                        */
        double sine, cosine, t[3];
        txm_sincos(k * (TXM_PI / 12), &sine, &cosine);
        const double dx = heading->x * cosine - heading->y * sine;
        const double dy = heading->x * sine + heading->y * cosine;
        const double x = tip->x + g->step * dx, y = tip->y + g->step * dy;
        txi_votes_in_window(g, x, y, t);
        const double across = dy * dy * t[0] - 2 * dx * dy * t[1] + dx * dx * t[2];
        const double along = dx * dx * t[0] + 2 * dx * dy * t[1] + dy * dy * t[2];
        if (across - along <= best) continue;
        best = across - along;
        bx = x;
        by = y;
        hx = dx;
        hy = dy;
    }
    if (best <= least) return 0;
    const ptrdiff_t at = txi_pixel(w->width, w->height, bx, by);
    if (at < 0 || w->state[at] != TXI_HOLE) return 0;
    *tip = txm_v2(txm_float(bx), txm_float(by));
    *heading = txi_unit(heading->x + hx, heading->y + hy);
    const txi_spot s = txi_spot_at(w, bx, by);
    const txm_dvec3 across = txm_d3_mad(txm_d3_scale(s.ex, -(double)heading->y), s.ey, heading->x);
    txi_grow_add(g, bx, by, s.place, txm_d3_unit(across), 0.8, end);
    return 1;
}

/* The dense map: places in the hole and next to it, without votes. */
static txm_status txi_grow_map(txi_grown *g, const txi_lines *l, txm_arena *scratch, txm_env *env) {
    const txi_window *w = g->window;
    int x0 = w->width, x1 = -1, y0 = w->height, y1 = -1;
    for (int y = 0; y < w->height; y++) {
        for (int x = 0; x < w->width; x++) {
            if (w->state[(size_t)y * (size_t)w->width + (size_t)x] != TXI_HOLE) continue;
            x0 = x < x0 ? x : x0;
            x1 = x > x1 ? x : x1;
            y0 = y < y0 ? y : y0;
            y1 = y > y1 ? y : y1;
        }
    }
    if (x1 < 0) x0 = x1 = y0 = y1 = 0;
    g->left = x0;
    g->top = y0;
    g->width = (x1 - x0) / g->step + 2;
    g->height = (y1 - y0) / g->step + 2;
    const size_t count = (size_t)g->width * (size_t)g->height;
    g->spots = (txi_spot *)txm_arena_alloc(scratch, count, sizeof *g->spots);
    g->votes = (double *)txm_arena_zero(scratch, count, 6 * sizeof *g->votes);
    if (scratch->failed) return txi_no_memory(env);
    for (int j = 0; j < g->height; j++) {
        for (int i = 0; i < g->width; i++) {
            const int x = g->left + i * g->step, y = g->top + j * g->step;
            txi_spot *s = &g->spots[(size_t)j * (size_t)g->width + (size_t)i];
            *s = txi_spot_at(w, x, y);
            s->used = x < w->width && y < w->height &&
                      l->away[(size_t)y * (size_t)w->width + (size_t)x] <= 4 * g->step * g->step;
        }
    }
    return TXM_OK;
}

/* Let the lines grow.
   alpha  pixels; lines as near as that have met; at most, and with 0, a step
   beta   rounds at most; 0: 64
   cost   O(tokens * places of the map in reach)                                                */
static txm_status txi_grow(txi_grown *g, const txi_window *w, const txi_lines *l, float alpha,
                           int beta, txm_arena *scratch, txm_env *env) {
    const int ends = l->end_count;
    int rounds = beta > 0 ? beta : TXI_GROW_ROUNDS;
    memset(g, 0, sizeof *g);
    g->window = w;
    g->end_count = ends;
    /* far enough for votes to bridge the hole                                                    */
    txi_fields_make(&g->fields, txm_clampf(0.25f * l->width, 6, 30), 0);
    g->step = txm_clampi((int)(g->fields.sigma / 5), 2, 6);
    const double meet = alpha > 0 && alpha < (float)g->step ? (double)alpha : g->step;
    if (rounds > 1 + (int)(l->width / (float)g->step))
        rounds = 1 + (int)(l->width / (float)g->step);
    const int room = ends * (TXI_TOKENS_OF_END + rounds);
    txm_status status = txi_tokens_make(&g->tokens, room, g->step + 1.0, scratch, env);
    if (status == TXM_OK) status = txi_grow_map(g, l, scratch, env);
    if (status != TXM_OK) return status;
    g->owner = (int *)txm_arena_alloc(scratch, (size_t)room, sizeof *g->owner);
    g->met = (uint8_t *)txm_arena_zero(scratch, (size_t)ends, (size_t)ends);
    txm_vec2 *tips = (txm_vec2 *)txm_arena_alloc(scratch, (size_t)ends, 2 * sizeof *tips);
    uint8_t *going = (uint8_t *)txm_arena_alloc(scratch, (size_t)ends, 1);
    if (scratch->failed) return txi_no_memory(env);
    txm_vec2 *headings = tips + ends;
    status = txi_grow_begin(g, l, scratch, env);
    if (status != TXM_OK) return status;
    for (int e = 0; e < ends; e++) {
        tips[e] = l->ends[e].place;
        headings[e] = l->ends[e].heading;
        going[e] = 1;
    }
    for (int round = 0; round < rounds; round++) {
        for (int e = 0; e < ends; e++) {
            if (!going[e]) continue;
            going[e] = (uint8_t)txi_grow_step(g, e, 0.05, &tips[e], &headings[e]);
            if (!going[e] || round < 2) continue;
            const int other =
                txi_grow_meets(g, e, txi_spot_at(w, tips[e].x, tips[e].y).place, meet);
            if (other < 0) continue;
            g->met[(size_t)e * (size_t)ends + (size_t)other] = 1;
            g->met[(size_t)other * (size_t)ends + (size_t)e] = 1;
        }
    }
    return TXM_OK;
}

/* How far the votes agree with a line in direction (dx, dy) at a place, -1..1: (across - along)
   / sum; 0 where there are no votes. */
static double txi_votes_agree(const txi_grown *g, double x, double y, double dx, double dy) {
    double t[3];
    if (TXI_LEFT_OUT & TXI_VOTES) return 0;
    txi_votes_in_window(g, x, y, t);
    const double across = dy * dy * t[0] - 2 * dx * dy * t[1] + dx * dx * t[2];
    const double along = dx * dx * t[0] + 2 * dx * dy * t[1] + dy * dy * t[2];
    return t[0] + t[2] > 1e-3 ? (across - along) / (t[0] + t[2]) : 0;
}

/* ---- which ends belong together ---------------------------------------------------------------
   The structure of [1, II.B]: lines that end at the hole are continued through it and joined. The
   paper lets lines grow by tensor voting and joins those that come near each other; growth drifts, and
   the order of the joins matters. Here the votes are one of several costs of a pair of ends, and the
   pairs are chosen together, as the matching of least cost.                                         */

enum {
    TXI_STEPS = 24,        /* pieces of the curve of a candidate                                 */
    TXI_PER_END = 12,      /* candidates kept for each end, the best ones; ours                   */
    TXI_MAX_LINKS = 3000,  /* candidates in all; ours                                            */
    TXI_STARTS = 3,        /* of the annealing; one alone differs more between seeds; ours        */
    TXI_MOVES = 30000,     /* from each start; ours                                               */
    TXI_KNOWN_PART = 120   /* pixels of a curve outside of the hole, on each side                */
};

/* A candidate: two ends and the curve between them, or one end and a place where it leaves the hole. */
typedef struct txi_link {
    int a, b;          /* ends; b = -1: no end there                                             */
    int line;          /* the prior line that it follows, or -1                                   */
    float from, to;    /* where on that line, an index and fraction of its points                 */
    float cost, bend, length;
    txm_vec2 leave;    /* with b = -1: where it leaves the hole,                                  */
    txm_vec2 backwards; /* and the direction there, into the hole, unit                           */
    txm_vec2 low, high; /* bounding box                                                          */
    txm_vec2 points[TXI_STEPS + 1];
} txi_link;

/* What a way of joining costs. All without unit; ours, from experiments. */
typedef struct txi_rules {
    double unmatched; /* an end that is not joined                                               */
    double weak;      /* share of that for ends that are not long                                */
    double crossing;  /* two curves that cross                                                   */
    double bend;      /* factor of the bending energy                                            */
    double votes;     /* less for votes that agree with the curve                                */
    double prior;     /* less for lines that follow the same prior line                           */
    double met;       /* less for lines that met when they grew                                  */
    int look_ahead;   /* long ends may leave the hole without another end                        */
} txi_rules;

/* Where a prior line passes an end. */
typedef struct txi_near {
    float at;     /* index and fraction of the line's points; -1: it does not                     */
    float offset; /* of the end, pixels to the right of the line                                  */
} txi_near;

/* What pairs are made from. */
typedef struct txi_pairs {
    const txi_window *w;
    const txi_lines *l;
    const txi_prior *prior; /* or NULL                                                            */
    txi_near *passes;       /* one per end and prior line                                         */
    txi_rules rules;
    txi_grown growth;
    float alpha;
} txi_pairs;

static txi_rules txi_rules_of(int structure) {
    txi_rules picture = {3, 0.8, 0.3, 1, 1, 1.5, 0.25, 1}, pattern = {6, 0.45, 2, 0.6, 1, 1.5, 0.25, 0};
    return structure == TEXINPAINT_PATTERN ? pattern : picture;
}

#define TXI_SIDE_COST 0.015  /* per level of difference of the colours on one side; ours            */
#define TXI_ANGLE_ERROR 1 /* pixels: of a direction, times the length it was measured on; ours    */

/* ---- curves ------------------------------------------------------------------------------ */

/* The cubic from p in direction d to q, where it arrives against direction e (e points back into the
   hole). Speeds at both ends: chord * 2 / (1 + cos of the angle to the chord), which makes a good
   circle of a circle's ends. */
static void txi_hermite(txm_vec2 p, txm_vec2 d, txm_vec2 q, txm_vec2 e, int steps, txm_vec2 *out) {
    const double cx = (double)q.x - p.x, cy = (double)q.y - p.y, chord = sqrt(cx * cx + cy * cy);
    const double n = chord > 0 ? chord : 1;
    const double cd = (d.x * cx + d.y * cy) / n, ce = -(e.x * cx + e.y * cy) / n;
    const double sd = chord * 2 / (1 + (cd > 0 ? cd : 0)), se = chord * 2 / (1 + (ce > 0 ? ce : 0));
    for (int i = 0; i <= steps; i++) {
        const double t = (double)i / steps, u = 1 - t;
        const double h0 = u * u * (1 + 2 * t), h1 = t * u * u * sd, g0 = t * t * (3 - 2 * t);
        const double g1 = t * t * u * se;
        out[i] = txm_v2(txm_float(h0 * p.x + h1 * d.x + g0 * q.x + g1 * e.x),
                        txm_float(h0 * p.y + h1 * d.y + g0 * q.y + g1 * e.y));
    }
}

/* Directions are known to some degrees only, the less the shorter the piece is that they were measured
   on. Within that, turn both ends towards an arc, whose ends have opposite angles to the chord, and if
   that is nearly straight towards the chord. So two edges of a bar stay parallel. */
static void txi_straighten(const txi_end *a, const txi_end *b, txm_vec2 *d, txm_vec2 *e) {
    const txm_vec2 c = txi_unit((double)b->place.x - a->place.x, (double)b->place.y - a->place.y);
    const double fa = a->fit_length > 6 ? a->fit_length : 6, fb = b->fit_length > 6 ? b->fit_length : 6;
    const double va = TXI_ANGLE_ERROR / fa, vb = TXI_ANGLE_ERROR / fb; /* largest errors              */
    const double ca = (double)c.x * a->heading.x + (double)c.y * a->heading.y;
    const double cb = -((double)c.x * b->heading.x + (double)c.y * b->heading.y);
    *d = a->heading;
    *e = b->heading;
    if (ca < 0.7 || cb < 0.7) return;
    /* sines of the angles from the chord: of the start, and of the direction in which it arrives     */
    double sa = (double)c.x * a->heading.y - (double)c.y * a->heading.x;
    double sb = -((double)c.x * b->heading.y - (double)c.y * b->heading.x);
    const double excess = sa + sb, most = va + vb; /* 0 for an arc                                  */
    const double share = excess > most ? 1 : excess < -most ? -1 : excess / most;
    sa -= share * va;
    sb -= share * vb;
    const double mean = 0.5 * (sa - sb), least = va < vb ? va : vb;
    const double less = mean > least ? least : mean < -least ? -least : mean;
    sa -= less;
    sb += less;
    const double da = sqrt(1 - sa * sa), db = sqrt(1 - sb * sb);
    *d = txi_unit(c.x * da - c.y * sa, c.y * da + c.x * sa);
    *e = txi_unit(-(c.x * db - c.y * sb), -(c.y * db + c.x * sb));
}

/* Length of a line, and its bending energy: length times the integral of squared curvature, which is
   the squared angle for an arc, whatever its size. */
static void txi_bend(const txm_vec2 *p, int count, double *length, double *bend) {
    double sum = 0, energy = 0;
    for (int i = 1; i < count; i++) {
        const double step = txi_distance(p[i], p[i - 1]);
        sum += step;
        if (i < 2 || step <= 0) continue;
        const double before = txi_distance(p[i - 1], p[i - 2]);
        if (before <= 0) continue;
        const double dot = ((double)p[i].x - p[i - 1].x) * ((double)p[i - 1].x - p[i - 2].x) +
                           ((double)p[i].y - p[i - 1].y) * ((double)p[i - 1].y - p[i - 2].y);
        /* squared angle, to second order 2 (1 - cos); over a half turn it is 4, enough          */
        energy += 2 * (1 - dot / (step * before)) / (0.5 * (step + before));
    }
    *length = sum;
    *bend = energy > 0 ? sum * energy : 0;
}

/* How far a line runs outside of the hole, more than a pixel from it, as a share of its length. */
static double txi_outside(const txi_window *w, const txi_lines *l, const txm_vec2 *p, int count) {
    int out = 0;
    for (int i = 0; i < count; i++) {
        const ptrdiff_t at = txi_pixel(w->width, w->height, p[i].x, p[i].y);
        out += at < 0 || (w->state[at] != TXI_HOLE && l->away[at] > 4);
    }
    return (double)out / count;
}

/* ---- prior lines ------------------------------------------------------------------------- */

enum { TXI_PRIOR_CATCH = 12 }; /* pixels; ends as near as that to a prior line follow it; ours     */

static int txi_prior_points(const txi_prior *prior, int line, const txm_vec2 **points) {
    *points = prior->points + prior->starts[line];
    return prior->starts[line + 1] - prior->starts[line];
}

/* The point of a line at an index and fraction, and its direction there. */
static txm_vec2 txi_prior_at(const txm_vec2 *p, int count, double at, txm_vec2 *along) {
    const int i = txm_clampi((int)at, 0, count - 2);
    const int low = i > 2 ? i - 2 : 0, high = i + 3 < count ? i + 3 : count - 1;
    *along = txi_unit((double)p[high].x - p[low].x, (double)p[high].y - p[low].y);
    return txi_between(p[i], p[i + 1], at - i);
}

/* Where a line passes an end: within 12 pixels and 45 degrees. */
static txi_near txi_prior_near(const txi_prior *prior, int line, const txi_end *e) {
    const txm_vec2 *p;
    const int count = txi_prior_points(prior, line, &p);
    double best = TXI_PRIOR_CATCH * TXI_PRIOR_CATCH;
    txi_near near_end = {-1, 0};
    for (int i = 0; i + 1 < count; i++) {
        const double ux = (double)p[i + 1].x - p[i].x, uy = (double)p[i + 1].y - p[i].y;
        const double vx = (double)e->place.x - p[i].x, vy = (double)e->place.y - p[i].y;
        const double uu = ux * ux + uy * uy;
        double t = uu > 0 ? (ux * vx + uy * vy) / uu : 0;
        t = t < 0 ? 0 : t > 1 ? 1 : t;
        const double dx = vx - t * ux, dy = vy - t * uy, d = dx * dx + dy * dy;
        if (d >= best) continue;
        best = d;
        near_end.at = txm_float(i + t);
    }
    if (near_end.at < 0) return near_end;
    txm_vec2 along;
    const txm_vec2 foot = txi_prior_at(p, count, near_end.at, &along);
    const double x = (double)e->place.x - foot.x, y = (double)e->place.y - foot.y;
    near_end.offset = txm_float(y * along.x - x * along.y);
    if (fabs((double)along.x * e->heading.x + (double)along.y * e->heading.y) < 0.7) near_end.at = -1;
    return near_end;
}

/* The curve of a candidate that follows a prior line from place p, direction d, to place q, direction
   e (into the hole both): the line, moved by the distance of the ends from it, and the cubic near the
   ends. */
static void txi_prior_curve(const txi_prior *prior, const txi_link *k, txm_vec2 p, txm_vec2 d,
                            txm_vec2 q, txm_vec2 e, int steps, txm_vec2 *out) {
    const txm_vec2 *line;
    const int count = txi_prior_points(prior, k->line, &line);
    txm_vec2 along;
    txi_hermite(p, d, q, e, steps, out);
    const txm_vec2 a = txi_prior_at(line, count, k->from, &along);
    const double oa = ((double)p.y - a.y) * along.x - ((double)p.x - a.x) * along.y;
    const txm_vec2 b = txi_prior_at(line, count, k->to, &along);
    const double ob = ((double)q.y - b.y) * along.x - ((double)q.x - b.x) * along.y;
    const double chord = txi_distance(p, q), length = chord > 1 ? chord : 1;
    for (int i = 1; i < steps; i++) {
        const double t = (double)i / steps, offset = oa + (ob - oa) * t;
        txm_vec2 at = txi_prior_at(line, count, k->from + ((double)k->to - k->from) * t, &along);
        at = txm_v2(txm_float(at.x - offset * along.y), txm_float(at.y + offset * along.x));
        double s = (t < 0.5 ? t : 1 - t) * length / (double)TXI_PRIOR_CATCH; /* 1: the line alone          */
        s = s > 1 ? 1 : s * s * (3 - 2 * s);
        out[i] = txi_between(out[i], at, s);
    }
}

/* The curve of a candidate, steps + 1 points. */
static void txi_link_curve(const txi_pairs *pairs, const txi_link *k, int steps, txm_vec2 *out) {
    const txi_end *a = &pairs->l->ends[k->a], *b = k->b >= 0 ? &pairs->l->ends[k->b] : NULL;
    const txm_vec2 q = b ? b->place : k->leave;
    txm_vec2 d = a->heading, e = b ? b->heading : k->backwards;
    if (b) txi_straighten(a, b, &d, &e);
    if (k->line >= 0) txi_prior_curve(pairs->prior, k, a->place, d, q, e, steps, out);
    else txi_hermite(a->place, d, q, e, steps, out);
}

/* The prior line that passes both ends nearest, into the candidate; 0: none. b = -1: any line near a. */
static int txi_prior_choose(const txi_pairs *pairs, int a, int b, txi_link *k) {
    const int lines = pairs->prior ? pairs->prior->line_count : 0;
    double best = 1e9;
    k->line = -1;
    for (int i = 0; i < lines; i++) {
        const txi_near *p = &pairs->passes[(size_t)a * (size_t)lines + (size_t)i];
        const txi_near *q = b >= 0 ? &pairs->passes[(size_t)b * (size_t)lines + (size_t)i] : p;
        if (p->at < 0 || q->at < 0) continue;
        if (b >= 0 && fabs((double)p->at - q->at) < 2) continue;
        const double d = fabs((double)p->offset) + fabs((double)q->offset) + 2 * fabs((double)p->offset - q->offset);
        if (d >= best) continue;
        best = d;
        k->line = i;
        k->from = p->at;
        k->to = q->at;
    }
    return k->line >= 0;
}

/* ---- costs ------------------------------------------------------------------------------- */

/* How well the colours of two ends go together: one enters the hole where the other leaves it, so
   left is right. correlation -1..1; mismatch: difference over contrast; sides: difference of the
   colours left and right, levels. */
static void txi_compare(const txi_end *a, const txi_end *b, double *correlation, double *mismatch,
                        double sides[2]) {
    const int mid = TXI_PROFILE / 2;
    double mean[2][3] = {{0}}, aa = 0, bb = 0, ab = 0, difference = 0, total = 0;
    double side[2][3] = {{0}};
    for (int k = 0; k < TXI_PROFILE; k++) {
        const double o = 0.5 * (k - mid), w = 1 / (1 + o * o / 6); /* less far from the line       */
        total += w;
        for (int c = 0; c < 3; c++) {
            mean[0][c] += w * a->profile[k][c];
            mean[1][c] += w * b->profile[TXI_PROFILE - 1 - k][c];
        }
    }
    for (int k = 0; k < TXI_PROFILE; k++) {
        const double o = 0.5 * (k - mid), w = 1 / (1 + o * o / 6);
        for (int c = 0; c < 3; c++) {
            const double p = a->profile[k][c], q = b->profile[TXI_PROFILE - 1 - k][c];
            const double u = p - mean[0][c] / total, v = q - mean[1][c] / total;
            aa += w * u * u;
            bb += w * v * v;
            ab += w * u * v;
            difference += w * fabs(p - q);
            if (k < mid - 1 && k > mid - 8) side[0][c] += (p - q) / 6;
            if (k > mid + 1 && k < mid + 8) side[1][c] += (p - q) / 6;
        }
    }
    *correlation = aa > 0 && bb > 0 ? ab / sqrt(aa * bb) : 0;
    *mismatch = difference / (3 * total) / (0.5 * ((double)a->contrast + b->contrast) + 10);
    for (int s = 0; s < 2; s++)
        sides[s] = sqrt((side[s][0] * side[s][0] + side[s][1] * side[s][1] + side[s][2] * side[s][2]) / 3);
}

/* The mean curvature of an arc from a to b, to compare with the curvatures of the ends. */
static double txi_turn(const txi_link *k) {
    const txm_vec2 *p = k->points;
    double sum = 0;
    for (int i = 2; i <= TXI_STEPS; i++) {
        const double ax = (double)p[i - 1].x - p[i - 2].x, ay = (double)p[i - 1].y - p[i - 2].y;
        const double bx = (double)p[i].x - p[i - 1].x, by = (double)p[i].y - p[i - 1].y;
        const double n = sqrt((ax * ax + ay * ay) * (bx * bx + by * by));
        if (n > 0) sum += (ax * by - ay * bx) / n; /* sine of the angle                            */
    }
    return k->length > 0 ? sum / k->length : 0;
}

static void txi_link_box(txi_link *k) {
    k->low = k->high = k->points[0];
    for (int i = 1; i <= TXI_STEPS; i++) {
        k->low.x = txm_minf(k->low.x, k->points[i].x);
        k->low.y = txm_minf(k->low.y, k->points[i].y);
        k->high.x = txm_maxf(k->high.x, k->points[i].x);
        k->high.y = txm_maxf(k->high.y, k->points[i].y);
    }
}

/* Length and bending energy of a candidate whose ends are set, and its box. 0: it runs outside of the
   hole. */
static int txi_link_measure(const txi_pairs *pairs, txi_link *k) {
    double length, bend;
    txi_link_curve(pairs, k, TXI_STEPS, k->points);
    txi_bend(k->points, TXI_STEPS + 1, &length, &bend);
    k->length = txm_float(length);
    k->bend = txm_float(bend);
    txi_link_box(k);
    return length >= 2 && txi_outside(pairs->w, pairs->l, k->points, TXI_STEPS + 1) <= 0.12;
}

/* The candidate of ends a and b; 0 if they cannot belong together. */
static int txi_link_ends(const txi_pairs *pairs, int a, int b, txi_link *k) {
    const txi_lines *l = pairs->l;
    const txi_end *p = &l->ends[a], *q = &l->ends[b];
    double correlation, mismatch, sides[2], shape;
    txi_compare(p, q, &correlation, &mismatch, sides);
    if (correlation < 0.3 && sides[0] > 30 && sides[1] > 30) return 0;
    if (correlation < -0.2) return 0;
    k->a = a;
    k->b = b;
    if (txi_prior_choose(pairs, a, b, k) && !txi_link_measure(pairs, k)) k->line = -1;
    if (k->line < 0 && !txi_link_measure(pairs, k)) return 0;
    if (k->line < 0) {
        const double turn = txi_turn(k);
        const double misfit =
            (fabs(p->curvature - turn) + fabs(-q->curvature - turn)) * 0.5 * k->length;
        shape = pairs->rules.bend * k->bend + 0.3 * (misfit < 3 ? misfit : 3);
    } else { /* it bends as the prior line does                                                    */
        const int lines = pairs->prior->line_count;
        const txi_near *u = &pairs->passes[(size_t)a * (size_t)lines + (size_t)k->line];
        const txi_near *v = &pairs->passes[(size_t)b * (size_t)lines + (size_t)k->line];
        shape = 0.1 * fabs((double)u->offset - v->offset) - pairs->rules.prior;
    }
    const double u = (double)p->contrast + 2, v = (double)q->contrast + 2;
    k->cost = txm_float(shape + 3 * (1 - correlation) + 2 * (mismatch < 2 ? mismatch : 2) +
                        TXI_SIDE_COST * (sides[0] > sides[1] ? sides[0] : sides[1]) +
                        0.6 * fabs(u - v) / (u + v) + 0.6 * k->length / (l->width > 8 ? l->width : 8) +
                        0.3 * !p->is_long + 0.3 * !q->is_long);
    return 1;
}

/* What the votes say about a candidate, -1..1: how far they agree with its curve, on average. */
static double txi_affinity(const txi_grown *g, const txi_link *k) {
    double sum = 0;
    for (int i = 2; i <= TXI_STEPS - 2; i += 2) {
        const txm_vec2 p = k->points[i - 1], q = k->points[i + 1];
        const txm_vec2 d = txi_unit((double)q.x - p.x, (double)q.y - p.y);
        sum += txi_votes_agree(g, k->points[i].x, k->points[i].y, d.x, d.y);
    }
    return sum / ((TXI_STEPS - 2) * 0.5);
}

/* ---- looking ahead ----------------------------------------------------------------------- */

/* Does a line of the same colours end where end e would leave the hole? Then the two can be joined. */
static int txi_end_there(const txi_lines *l, const txi_end *e, const txi_link *k) {
    for (int i = 0; i < l->end_count; i++) {
        const txi_end *o = &l->ends[i];
        double correlation, mismatch, sides[2];
        const double d = (double)o->heading.x * k->backwards.x + (double)o->heading.y * k->backwards.y;
        if (o == e || d < 0.8 || txi_distance(o->place, k->leave) > 8) continue;
        txi_compare(e, o, &correlation, &mismatch, sides);
        if (correlation > 0.7 && mismatch < 0.3) return 1;
    }
    return 0;
}

/* Continue end a straight on (along its fitted curve) to the other side of the hole, and look for a
   line there that could be its continuation although it does not end at the hole, as other lines
   cross it there: at least 10 of 45 pixels on which a point lies within 6 pixels, in its direction and
   with the same polarity. 0: there is none. */
static int txi_look_ahead(const txi_pairs *pairs, int a, txi_link *k) {
    const txi_window *w = pairs->w;
    const txi_lines *l = pairs->l;
    const txi_end *e = &l->ends[a];
    const double turn = fabs((double)e->curvature) * l->width < 1.5 ? e->curvature : 0;
    double x = e->place.x, y = e->place.y, dx = e->heading.x, dy = e->heading.y, change[3];
    double offset = 0, offsets[TXI_LOOK_AHEAD];
    int inside = 0, beyond = 0, hits = 0, first = 0;
    txm_vec2 exit = e->place, direction = e->heading;
    for (int c = 0; c < 3; c++) change[c] = (double)e->profile[13][c] - e->profile[7][c];
    for (int i = 0; i < 4 * (w->width + w->height) && beyond < TXI_LOOK_AHEAD; i++) {
        x += dx;
        y += dy;
        const txm_vec2 d = txi_unit(dx - turn * dy, dy + turn * dx);
        dx = d.x;
        dy = d.y;
        const ptrdiff_t at = txi_pixel(w->width, w->height, x, y);
        if (at < 0 || w->state[at] == TXI_VOID) break;
        if (w->state[at] == TXI_HOLE) {
            if (beyond) break;
            inside++;
            exit = txm_v2(txm_float(x), txm_float(y));
            direction = d;
            continue;
        }
        if (inside < 4) {
            if (i > 4) return 0;
            continue;
        }
        double best = 6.5;
        for (int o = 0; o <= 12; o++) { /* the nearest fitting point to either side                 */
            const int s = o & 1 ? -(o + 1) / 2 : o / 2;
            const ptrdiff_t i2 = txi_pixel(w->width, w->height, x - s * dy, y + s * dx);
            if (i2 < 0 || l->thin_at[i2] < 0 || fabs(best) < 6.5) continue;
            const txi_thin *t = &l->thin[l->thin_at[i2]];
            double other[3];
            txi_change_at(&l->field, (size_t)i2, -dy, dx, other);
            if (fabs(t->along.x * dx + t->along.y * dy) < 0.94 || txi_agree(change, other) < 0.7) continue;
            best = (t->place.x - x) * -dy + (t->place.y - y) * dx;
        }
        if (fabs(best) < 6.5) {
            if (!hits) first = beyond;
            TXM_ASSERT(hits < TXI_LOOK_AHEAD);
            offsets[hits++] = best;
        }
        beyond++;
    }
    if (hits < 10 || first > 25 || inside < 6) return 0;
    for (int i = 0; i < hits; i++) offset += offsets[i] / hits;
    k->a = a;
    k->b = -1;
    k->leave = txm_v2(txm_float(exit.x - offset * direction.y), txm_float(exit.y + offset * direction.x));
    k->backwards = txm_v2(-direction.x, -direction.y);
    k->line = -1;
    if (txi_end_there(l, e, k) || !txi_link_measure(pairs, k)) return 0;
    k->cost = txm_float(pairs->rules.bend * k->bend + 0.6 * k->length / (l->width > 8 ? l->width : 8) +
                        0.75 - 0.02 * hits + 0.05 * fabs(offset));
    return 1;
}

/* Let end a follow a prior line to where it leaves the hole, without an end there. 0: there is none. */
static int txi_follow_prior(const txi_pairs *pairs, int a, txi_link *k) {
    const txi_window *w = pairs->w;
    const txi_end *e = &pairs->l->ends[a];
    const txm_vec2 *line;
    txm_vec2 along;
    int inside = 0;
    if (!txi_prior_choose(pairs, a, -1, k)) return 0;
    const int count = txi_prior_points(pairs->prior, k->line, &line);
    const double offset =
        pairs->passes[(size_t)a * (size_t)pairs->prior->line_count + (size_t)k->line].offset;
    txi_prior_at(line, count, k->from, &along);
    const int step = (double)along.x * e->heading.x + (double)along.y * e->heading.y > 0 ? 1 : -1;
    for (int i = (int)k->from + step; i >= 0 && i < count; i += step) {
        const txm_vec2 p = txi_prior_at(line, count, i, &along);
        const double x = p.x - offset * along.y, y = p.y + offset * along.x;
        const ptrdiff_t at = txi_pixel(w->width, w->height, x, y);
        if (at < 0 || w->state[at] != TXI_HOLE) {
            if (inside || at < 0 || abs(i - (int)k->from) > 8) break;
            continue;
        }
        inside++;
        k->to = (float)i;
        k->leave = txm_v2(txm_float(x), txm_float(y));
        k->backwards = txm_v2(-(float)step * along.x, -(float)step * along.y);
    }
    k->a = a;
    k->b = -1;
    if (inside < 6 || !txi_link_measure(pairs, k)) return 0;
    k->cost = txm_float(0.9 + 0.6 * k->length / (pairs->l->width > 8 ? pairs->l->width : 8) -
                        0.5 * pairs->rules.prior);
    return 1;
}

/* ---- candidates -------------------------------------------------------------------------- */

/* Let lines grow, and find out which prior lines pass which ends. */
static txm_status txi_pairs_make(txi_pairs *pairs, const txi_window *w, const txi_lines *l,
                                 const txi_prior *prior, int structure, float alpha, int beta,
                                 txm_arena *scratch, txm_env *env) {
    const int lines = prior ? prior->line_count : 0;
    memset(pairs, 0, sizeof *pairs);
    pairs->w = w;
    pairs->l = l;
    pairs->prior = lines > 0 ? prior : NULL;
    pairs->rules = txi_rules_of(structure);
    pairs->alpha = alpha;
    if (lines > 0) {
        pairs->passes = (txi_near *)txm_arena_alloc(scratch, (size_t)l->end_count * (size_t)lines,
                                                    sizeof *pairs->passes);
        if (!pairs->passes) return txi_no_memory(env);
        for (int i = 0; i < l->end_count * lines; i++)
            pairs->passes[i] = txi_prior_near(prior, i % lines, &l->ends[i / lines]);
    }
    return txi_grow(&pairs->growth, w, l, alpha, beta, scratch, env);
}

/* What is saved by a candidate, as its ends are no longer unmatched. */
static double txi_saved_by(const txi_lines *l, const txi_rules *rules, const txi_link *k) {
    double sum = l->ends[k->a].is_long ? 1 : rules->weak;
    if (k->b >= 0) sum += l->ends[k->b].is_long ? 1 : rules->weak;
    return rules->unmatched * sum;
}

/* Another candidate of an end, which has those from start on: the best TXI_PER_END are kept. */
static void txi_keep_link(const txi_pairs *pairs, const txi_link *k, txi_link *links, int start,
                          int *count) {
    if (k->cost >= txi_saved_by(pairs->l, &pairs->rules, k)) return;
    if (*count - start < TXI_PER_END) {
        if (*count < TXI_MAX_LINKS) links[(*count)++] = *k;
        return;
    }
    int worst = start;
    for (int i = start; i < *count; i++) {
        if (links[i].cost > links[worst].cost) worst = i;
    }
    if (k->cost < links[worst].cost) links[worst] = *k;
}

/* Candidates of all ends into links (room for TXI_MAX_LINKS), if they are better than no join. Returns
   how many. */
static int txi_candidates(const txi_pairs *pairs, txi_link *links) {
    const txi_lines *l = pairs->l;
    int count = 0;
    for (int a = 0; a < l->end_count; a++) {
        const int start = count;
        txi_link k;
        memset(&k, 0, sizeof k);
        for (int b = a + 1; b < l->end_count; b++) {
            const double d = txi_distance(l->ends[a].place, l->ends[b].place);
            if ((pairs->alpha > 0 && d > pairs->alpha) || !txi_link_ends(pairs, a, b, &k)) continue;
            const int met = pairs->growth.met[(size_t)a * (size_t)l->end_count + (size_t)b];
            k.cost = txm_float(k.cost - pairs->rules.votes * txi_affinity(&pairs->growth, &k) -
                               (met ? pairs->rules.met : 0));
            txi_keep_link(pairs, &k, links, start, &count);
        }
        if (pairs->rules.look_ahead && l->ends[a].is_long && txi_look_ahead(pairs, a, &k)) {
            k.cost = txm_float(k.cost - pairs->rules.votes * txi_affinity(&pairs->growth, &k));
            txi_keep_link(pairs, &k, links, start, &count);
        }
        if (pairs->prior && txi_follow_prior(pairs, a, &k))
            txi_keep_link(pairs, &k, links, start, &count);
    }
    return count;
}

/* ---- matching ---------------------------------------------------------------------------- */

/* The state of the search for the matching of least cost. */
typedef struct txi_pairing {
    const txi_link *links;
    int link_count, end_count;
    double crossing;
    float *saved;      /* one per link: what it saves, as its ends are no longer unmatched        */
    uint8_t *crosses;  /* link_count squared: 0 not known yet, 1 no, 2 yes                         */
    int *chosen;       /* one per end: its link, or -1                                           */
    int *active;       /* the chosen links                                                       */
    int *slot;         /* one per link: where it is in active, or -1                             */
    int active_count;
    int *of_end, *of_start; /* links of end i: of_end[of_start[i]] .. of_end[of_start[i + 1] - 1]    */
} txi_pairing;

static int txi_segments_cross(txm_vec2 a, txm_vec2 b, txm_vec2 c, txm_vec2 d) {
    const double ux = (double)b.x - a.x, uy = (double)b.y - a.y;
    const double vx = (double)d.x - c.x, vy = (double)d.y - c.y;
    const double s = ux * ((double)c.y - a.y) - uy * ((double)c.x - a.x);
    const double t = ux * ((double)d.y - a.y) - uy * ((double)d.x - a.x);
    const double p = vx * ((double)a.y - c.y) - vy * ((double)a.x - c.x);
    const double q = vx * ((double)b.y - c.y) - vy * ((double)b.x - c.x);
    return ((s < 0) != (t < 0)) && ((p < 0) != (q < 0));
}

static int txi_links_cross(const txi_link *a, const txi_link *b) {
    if (a->low.x > b->high.x || b->low.x > a->high.x || a->low.y > b->high.y || b->low.y > a->high.y)
        return 0;
    for (int i = 0; i < TXI_STEPS; i++) {
        const float x0 = txm_minf(a->points[i].x, a->points[i + 1].x);
        const float x1 = txm_maxf(a->points[i].x, a->points[i + 1].x);
        const float y0 = txm_minf(a->points[i].y, a->points[i + 1].y);
        const float y1 = txm_maxf(a->points[i].y, a->points[i + 1].y);
        if (x0 > b->high.x || x1 < b->low.x || y0 > b->high.y || y1 < b->low.y) continue;
        for (int j = 0; j < TXI_STEPS; j++) {
            if (txi_segments_cross(a->points[i], a->points[i + 1], b->points[j], b->points[j + 1]))
                return 1;
        }
    }
    return 0;
}

static int txi_crosses(txi_pairing *m, int a, int b) {
    const size_t n = (size_t)m->link_count;
    uint8_t *c = &m->crosses[(size_t)a * n + (size_t)b];
    if (!*c) {
        *c = txi_links_cross(&m->links[a], &m->links[b]) ? 2 : 1;
        m->crosses[(size_t)b * n + (size_t)a] = *c;
    }
    return *c == 2;
}

/* What link k costs beside the active ones, apart from being matched or not. */
static double txi_link_energy(txi_pairing *m, int k) {
    double sum = m->links[k].cost;
    for (int i = 0; i < m->active_count; i++) {
        if (m->active[i] != k && txi_crosses(m, k, m->active[i])) sum += m->crossing;
    }
    return sum;
}

static void txi_activate(txi_pairing *m, int k) {
    TXM_ASSERT(m->active_count < m->link_count);
    m->slot[k] = m->active_count;
    m->active[m->active_count++] = k;
    m->chosen[m->links[k].a] = k;
    if (m->links[k].b >= 0) m->chosen[m->links[k].b] = k;
}

static void txi_deactivate(txi_pairing *m, int k) {
    const int s = m->slot[k], last = m->active[--m->active_count];
    m->active[s] = last;
    m->slot[last] = s;
    m->slot[k] = -1;
    m->chosen[m->links[k].a] = -1;
    if (m->links[k].b >= 0) m->chosen[m->links[k].b] = -1;
}

static double txi_remove(txi_pairing *m, int k) {
    const double change = (double)m->saved[k] - txi_link_energy(m, k);
    txi_deactivate(m, k);
    return change;
}

static double txi_insert(txi_pairing *m, int k) {
    const double change = txi_link_energy(m, k) - (double)m->saved[k];
    txi_activate(m, k);
    return change;
}

/* Insert the link of a free end to another free end, or out of the hole, that lowers the energy most. The
   change; 0: there is none, *link is -1 then. */
static double txi_rejoin(txi_pairing *m, int end, int *link) {
    double least = -1e-9;
    *link = -1;
    for (int i = m->of_start[end]; i < m->of_start[end + 1]; i++) {
        const txi_link *k = &m->links[m->of_end[i]];
        const int other = k->a == end ? k->b : k->a;
        if (other >= 0 && m->chosen[other] >= 0) continue;
        const double change = txi_link_energy(m, m->of_end[i]) - (double)m->saved[m->of_end[i]];
        if (change >= least) continue;
        least = change;
        *link = m->of_end[i];
    }
    if (*link < 0) return 0;
    txi_activate(m, *link);
    return least;
}

/* Try link k: it goes if it is there; else it replaces the links of its two ends, and the two ends that
   become free are joined anew if they can be. Kept if the energy changes by less than allowed; returns
   the change, or 0 if it was not kept. */
static double txi_pairing_try(txi_pairing *m, int k, double allowed) {
    int gone[2] = {-1, -1}, free_end[2] = {-1, -1}, anew[2] = {-1, -1};
    double change = 0;
    if (m->slot[k] >= 0) {
        gone[0] = k;
        free_end[0] = m->links[k].a;
        free_end[1] = m->links[k].b;
        change = txi_remove(m, k);
    } else {
        for (int s = 0; s < 2; s++) {
            const int end = s ? m->links[k].b : m->links[k].a;
            const int old = end >= 0 ? m->chosen[end] : -1;
            if (old < 0) continue;
            gone[s] = old;
            free_end[s] = m->links[old].a == end ? m->links[old].b : m->links[old].a;
            change += txi_remove(m, old);
        }
        change += txi_insert(m, k);
    }
    for (int s = 0; s < 2; s++) {
        if (free_end[s] >= 0 && m->chosen[free_end[s]] < 0)
            change += txi_rejoin(m, free_end[s], &anew[s]);
    }
    if (change < allowed) return change;
    for (int s = 1; s >= 0; s--) {
        if (anew[s] >= 0) txi_deactivate(m, anew[s]);
    }
    if (m->slot[k] >= 0) txi_deactivate(m, k);
    for (int s = 0; s < 2; s++) {
        if (gone[s] >= 0) txi_activate(m, gone[s]);
    }
    return 0;
}

static txm_status txi_pairing_make(txi_pairing *m, const txi_pairs *pairs, const txi_link *links,
                                   int count, txm_arena *scratch, txm_env *env) {
    const int ends = pairs->l->end_count;
    const size_t n = (size_t)count, e = (size_t)ends;
    memset(m, 0, sizeof *m);
    m->links = links;
    m->link_count = count;
    m->end_count = ends;
    m->crossing = pairs->rules.crossing;
    m->crosses = (uint8_t *)txm_arena_zero(scratch, n, n);
    m->saved = (float *)txm_arena_alloc(scratch, n, sizeof *m->saved);
    m->chosen = (int *)txm_arena_alloc(scratch, e, sizeof(int));
    m->active = (int *)txm_arena_alloc(scratch, n, sizeof(int));
    m->slot = (int *)txm_arena_alloc(scratch, n, sizeof(int));
    m->of_end = (int *)txm_arena_alloc(scratch, n, 2 * sizeof(int));
    m->of_start = (int *)txm_arena_zero(scratch, e + 2, sizeof(int));
    if (scratch->failed) return txi_no_memory(env);
    for (int i = 0; i < ends; i++) m->chosen[i] = -1;
    for (int k = 0; k < count; k++) {
        m->slot[k] = -1;
        m->saved[k] = txm_float(txi_saved_by(pairs->l, &pairs->rules, &links[k]));
        m->of_start[links[k].a + 2]++;
        if (links[k].b >= 0) m->of_start[links[k].b + 2]++;
    }
    for (int i = 0; i < ends; i++) m->of_start[i + 2] += m->of_start[i + 1];
    for (int k = 0; k < count; k++) {
        m->of_end[m->of_start[links[k].a + 1]++] = k;
        if (links[k].b >= 0) m->of_end[m->of_start[links[k].b + 1]++] = k;
    }
    return TXM_OK;
}

/* -ln(u) for 0 < u <= 1, to 1 %: u = 2^-bits v, then a series in 1 - v. */
static double txi_minus_log(double u) {
    double bits = 0;
    while (u < 0.5) {
        u *= 2;
        bits += 1;
    }
    const double x = 1 - u;
    return bits * 0.6931471805599453 + x * (1 + x * (1 / 2.0 + x * (1 / 3.0 + x / 4)));
}

/* Simulated annealing, several times from no joins at all; then, from the best that was met, every link
   is tried until none improves.
   best  room for end_count numbers                                                             */
static void txi_anneal(txi_pairing *m, uint64_t seed, int *best) {
    const int starts = TXI_LEFT_OUT & TXI_MATCHING ? 0 : TXI_STARTS, rounds = starts ? 50 : 1;
    double least = 0;
    for (int i = 0; i < m->end_count; i++) best[i] = -1;
    for (int start = 0; start < starts; start++) {
        txm_rng rng = txm_rng_make(seed, 0x6a6f696e + (uint64_t)start);
        double energy = 0;
        while (m->active_count) txi_deactivate(m, m->active[m->active_count - 1]);
        for (int i = 0; i < TXI_MOVES; i++) {
            const double heat = 1.5 * txm_exp2(-7.0 * i / (double)TXI_MOVES);
            const int k = (int)txm_rng_below(&rng, (uint32_t)m->link_count);
            const double u = txm_rng_double(&rng);
            /* accepted with probability exp(-change / heat)                                      */
            energy += txi_pairing_try(m, k, heat * txi_minus_log(u > 1e-9 ? u : 1e-9));
            if (energy >= least - 1e-9) continue;
            least = energy;
            memcpy(best, m->chosen, (size_t)m->end_count * sizeof *best);
        }
    }
    while (m->active_count) txi_deactivate(m, m->active[m->active_count - 1]);
    for (int i = 0; i < m->end_count; i++) {
        if (best[i] >= 0 && m->slot[best[i]] < 0) txi_activate(m, best[i]);
    }
    for (int round = 0, better = 1; better && round < rounds; round++) {
        better = 0;
        for (int k = 0; k < m->link_count; k++) better |= txi_pairing_try(m, k, -1e-7) < 0;
    }
}

/* ---- the curves -------------------------------------------------------------------------- */

/* Points about a pixel apart along a line into out; returns how many, at most room. */
static int txi_resample(const txm_vec2 *p, int count, txm_vec2 *out, int room) {
    double length = 0, at = 0;
    for (int i = 1; i < count; i++) length += txi_distance(p[i], p[i - 1]);
    int n = (int)(length + 0.5) + 1;
    n = n < 2 ? 2 : n > room ? room : n;
    const double step = length / (n - 1);
    int k = 0;
    for (int i = 0; i < n; i++) {
        const double target = i * step;
        double piece = k + 1 < count ? txi_distance(p[k], p[k + 1]) : 0;
        while (k + 2 < count && at + piece < target) {
            at += piece;
            k++;
            piece = txi_distance(p[k], p[k + 1]);
        }
        const double t = piece > 0 ? (target - at) / piece : 0;
        out[i] = k + 1 < count ? txi_between(p[k], p[k + 1], t < 0 ? 0 : t > 1 ? 1 : t) : p[k];
    }
    return n;
}

/* The known part of the line of an end: point s pixels outwards from the border. First the fitted
   curve, so that it goes into the hole without a kink, further out the points as traced. */
static txm_vec2 txi_known_point(const txi_lines *l, const txi_end *e, int s) {
    const txm_vec2 *p = l->points + e->first;
    const double gap = txi_distance(p[0], e->place); /* the first traced point is that far out     */
    const double x = (double)e->fit[0] + e->fit[1] * (double)s + e->fit[2] * (double)s * s;
    const double y = (double)e->fit[3] + e->fit[4] * (double)s + e->fit[5] * (double)s * s;
    const double at = s - gap;
    int i = at > 0 ? (int)at : 0;
    if (i > e->count - 2) i = e->count - 2;
    const txm_vec2 traced = txi_between(p[i], p[i + 1], at - i < 0 ? 0 : at - i > 1 ? 1 : at - i);
    const double t = s < 4 ? 0 : s > 12 ? 1 : (s - 4) / 8.0;
    return txi_between(txm_v2(txm_float(x), txm_float(y)), traced, t * t * (3 - 2 * t));
}

static int txi_known_count(const txi_end *e) {
    const int n = e->count - 1;
    return n < TXI_KNOWN_PART ? n : TXI_KNOWN_PART;
}

/* A chosen link as a curve with its known parts. dense, fine: room for room points */
static txm_status txi_curve_make(const txi_pairs *pairs, const txi_link *k, txm_vec2 *dense,
                                 txm_vec2 *fine, int room, txm_arena *arena, txm_env *env,
                                 txi_curve *c) {
    const txi_window *w = pairs->w;
    const txi_lines *l = pairs->l;
    const txi_end *a = &l->ends[k->a], *b = k->b >= 0 ? &l->ends[k->b] : NULL;
    int n = 0, m;
    const int head = txi_known_count(a), tail = b ? txi_known_count(b) : 0;
    for (int s = head; s > 0; s--) dense[n++] = txi_known_point(l, a, s);
    txi_link_curve(pairs, k, 4 * TXI_STEPS, fine);
    m = txi_resample(fine, 4 * TXI_STEPS + 1, dense + n, room - n - TXI_KNOWN_PART);
    n += m;
    for (int s = 1; s <= tail; s++) dense[n++] = txi_known_point(l, b, s);
    c->points = (txm_vec2 *)txm_arena_alloc(arena, (size_t)n, sizeof *c->points);
    if (!c->points) return txi_no_memory(env);
    memcpy(c->points, dense, (size_t)n * sizeof *dense);
    c->count = n;
    c->first = -1;
    c->last = -1;
    for (int i = 0; i < n; i++) {
        const ptrdiff_t at = txi_pixel(w->width, w->height, dense[i].x, dense[i].y);
        if (at < 0 || w->state[at] != TXI_HOLE) continue;
        if (c->first < 0) c->first = i;
        c->last = i;
    }
    c->ends[0] = k->a;
    c->ends[1] = k->b;
    c->strength = b ? 0.5f * (a->contrast + b->contrast) : a->contrast;
    c->partner = -1;
    c->cost = k->cost;
    return TXM_OK;
}

/* ---- junctions --------------------------------------------------------------------------- */

/* Mean colour of a side of an end, 1 to 3 pixels from the line; side 0 left, 1 right. */
static void txi_end_side(const txi_end *e, int side, double color[3]) {
    const int mid = TXI_PROFILE / 2;
    for (int c = 0; c < 3; c++) {
        color[c] = 0;
        for (int k = 2; k <= 6; k++) color[c] += e->profile[side ? mid + k : mid - k][c] / 5.0;
    }
}

static double txi_end_color_distance(const double a[3], const double b[3]) {
    const double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return sqrt((x * x + y * y + z * z) / 3);
}

/* Continue an end that is not joined until it meets a curve: the end of a line at another, a
   T-junction. The colour of one of its sides must be that of the curve on the side where it arrives. 0:
   it meets none within most pixels. */
static int txi_meet_curve(const txi_lines *l, const txi_end *e, const txi_curve *curves, int count,
                          double most, txi_link *k) {
    const double turn = fabs((double)e->curvature) * most < 1 ? e->curvature : 0;
    double x = e->place.x, y = e->place.y, dx = e->heading.x, dy = e->heading.y;
    for (int i = 0; i < (int)most; i++) {
        x += dx;
        y += dy;
        const txm_vec2 d = txi_unit(dx - turn * dy, dy + turn * dx);
        dx = d.x;
        dy = d.y;
        for (int j = 0; j < count && i >= 2; j++) {
            const txi_curve *c = &curves[j];
            for (int n = c->first; n < c->last; n++) {
                const txm_vec2 p = c->points[n], q = c->points[n + 1];
                const double ox = x - p.x, oy = y - p.y;
                if (ox * ox + oy * oy > 1.2) continue;
                const txm_vec2 t = txi_unit((double)q.x - p.x, (double)q.y - p.y);
                const double cross = dx * t.y - dy * t.x; /* positive: it comes from the right       */
                if (fabs(cross) < 0.4) return 0;
                double arrived[3], left[3], right[3];
                txi_end_side(&l->ends[c->ends[0]], cross < 0, arrived);
                txi_end_side(e, 0, left);
                txi_end_side(e, 1, right);
                if (txi_end_color_distance(arrived, left) > 40 && txi_end_color_distance(arrived, right) > 40)
                    return 0;
                k->leave = txm_v2(txm_float(x), txm_float(y));
                k->backwards = txm_v2(txm_float(-dx), txm_float(-dy));
                return 1;
            }
        }
    }
    return 0;
}

/* ---- all of it --------------------------------------------------------------------------- */

/* The chosen candidates as curves, then the ends that meet one of them. */
static txm_status txi_join_curves(const txi_pairs *pairs, const txi_pairing *match, txm_arena *scratch,
                                  txm_arena *arena, txm_env *env, txi_curve *curves, int *count) {
    const txi_window *w = pairs->w;
    const txi_lines *l = pairs->l;
    const int room = 8 * (w->width + w->height) + 2 * TXI_KNOWN_PART + 8;
    txm_vec2 *dense = (txm_vec2 *)txm_arena_alloc(scratch, (size_t)room, 2 * sizeof *dense);
    if (scratch->failed) return txi_no_memory(env);
    for (int k = 0; k < match->link_count; k++) {
        txi_curve c;
        if (match->slot[k] < 0) continue;
        const txm_status status =
            txi_curve_make(pairs, &match->links[k], dense, dense + room, room, arena, env, &c);
        if (status != TXM_OK) return status;
        if (c.first < 0 || c.last <= c.first) continue;
        TXM_ASSERT(*count < l->end_count); /* an end has one curve at most */
        curves[(*count)++] = c;
    }
    const int whole = *count;
    for (int e = 0; e < l->end_count; e++) {
        txi_link k;
        txi_curve c;
        memset(&k, 0, sizeof k);
        k.a = e;
        k.b = k.line = -1;
        if (match->chosen[e] >= 0 || !l->ends[e].is_long) continue;
        if (!txi_meet_curve(l, &l->ends[e], curves, whole, 0.75 * l->width, &k)) continue;
        const txm_status status = txi_curve_make(pairs, &k, dense, dense + room, room, arena, env, &c);
        if (status != TXM_OK) return status;
        if (c.first < 0 || c.last <= c.first) continue;
        TXM_ASSERT(*count < l->end_count);
        curves[(*count)++] = c;
    }
    return TXM_OK;
}

/* Join the lines that end at the hole.

   prior      lines that attract, or NULL
   structure  TEXINPAINT_PICTURE or TEXINPAINT_PATTERN; TEXINPAINT_TEXTURE: no curves
   alpha      the largest distance of two ends that are joined, pixels; 0 = no limit
   beta       rounds over which lines grow by votes; 0 = as many as it takes
   curves     receives *count curves, in the arena
   return     TXM_OK; TXM_OUT_OF_MEMORY; TXM_CANCELLED                                         */
static txm_status txi_join(const txi_window *w, const txi_lines *l, const txi_prior *prior, int structure,
                           float alpha, int beta, uint64_t seed, txm_arena *arena, txm_env *env,
                           txi_curve **curves, int *count) {
    txm_arena scratch;
    txi_pairing match;
    txi_pairs pairs;
    int n = 0;
    *curves = NULL;
    *count = 0;
    if (structure == TEXINPAINT_TEXTURE || l->end_count == 0) return TXM_OK;
    txm_arena_init(&scratch, env);
    txm_status status = txi_pairs_make(&pairs, w, l, prior, structure, alpha, beta, &scratch, env);
    txi_link *links = (txi_link *)txm_arena_alloc(&scratch, TXI_MAX_LINKS, sizeof *links);
    int *best = (int *)txm_arena_alloc(&scratch, (size_t)l->end_count, sizeof *best);
    *curves = (txi_curve *)txm_arena_alloc(arena, (size_t)l->end_count, sizeof **curves);
    if (status == TXM_OK && (scratch.failed || arena->failed)) status = txi_no_memory(env);
    if (status == TXM_OK && txm_progress(env, 0, "lines")) status = txi_stopped(env);
    if (status == TXM_OK) n = txi_candidates(&pairs, links);
    if (n) status = txi_pairing_make(&match, &pairs, links, n, &scratch, env);
    if (status == TXM_OK && txm_progress(env, 0, "lines")) status = txi_stopped(env);
    if (n && status == TXM_OK) {
        txi_anneal(&match, seed, best);
        status = txi_join_curves(&pairs, &match, &scratch, arena, env, *curves, count);
    }
    txm_arena_free(&scratch);
    return status;
}

/* ---- what a result keeps of the lines ---------------------------------------------------- */

enum { TXI_GO_ON = 8 }; /* pixels inside of the hole over which a line should go on               */

/* Over how many of 8 pixels inside of the hole a line of the result follows the continuation of an
   end: no farther than 2.5 pixels, within 25 degrees, with the same polarity and 0.45 to 2.2 times
   the strength. */
static int txi_goes_on(const txi_window *w, const txi_slopes *f, const txi_end *e) {
    txi_walk k;
    int n = 0;
    k.x = (double)e->fit[0] + 2.0 * e->fit[1] + 4.0 * e->fit[2];
    k.y = (double)e->fit[3] + 2.0 * e->fit[4] + 4.0 * e->fit[5];
    const txm_vec2 d = txi_unit(-e->fit[1] - 4.0 * e->fit[2], -e->fit[4] - 4.0 * e->fit[5]);
    k.dx = d.x;
    k.dy = d.y;
    txi_centre(f, -k.dy, k.dx, &k.x, &k.y);
    const ptrdiff_t from = txi_pixel(w->width, w->height, k.x, k.y);
    if (from < 0) return 0;
    txi_change_at(f, (size_t)from, -k.dy, k.dx, k.change);
    for (int i = 0; i < 12 && n < TXI_GO_ON; i++) {
        if (!txi_walk_on(f, &k, 1, 0.45 * e->strength)) break;
        const ptrdiff_t at = txi_pixel(w->width, w->height, k.x, k.y);
        if (w->state[at] != TXI_HOLE) continue;
        const double s = -(n + 0.5), dx = -(e->fit[1] + 2 * e->fit[2] * s);
        const double dy = -(e->fit[4] + 2 * e->fit[5] * s), speed = sqrt(dx * dx + dy * dy);
        const double ox = k.x - (e->fit[0] + e->fit[1] * s + e->fit[2] * s * s);
        const double oy = k.y - (e->fit[3] + e->fit[4] * s + e->fit[5] * s * s);
        if (speed <= 0 || fabs(ox * dy - oy * dx) > 2.5 * speed) break;
        if (k.dx * dx + k.dy * dy < 0.906 * speed || f->strength[at] > 2.2f * e->strength) break;
        n++;
    }
    return n;
}

/* The mean share of 8 pixels over which the line ends go on in a picture of the window with its
   hole filled; 1 if there are no ends.
   color  4 per pixel
   share  receives 0..1
   cost   O(pixels)                                                                            */
static txm_status txi_continued(const txi_window *w, const txi_lines *l, const uint8_t *color,
                                txm_env *env, double *share) {
    const size_t count = (size_t)w->width * (size_t)w->height;
    const int longer = w->width > w->height ? w->width : w->height;
    txi_slopes f;
    txm_arena arena;
    double sum = 0;
    txm_arena_init(&arena, env);
    memset(&f, 0, sizeof f);
    f.width = w->width;
    f.height = w->height;
    f.color = color;
    f.known = (uint8_t *)txm_arena_alloc(&arena, count, 1);
    f.gap = (int32_t *)txm_arena_alloc(&arena, count, sizeof *f.gap);
    int32_t *from = (int32_t *)txm_arena_alloc(&arena, count, sizeof *from);
    int32_t *row = (int32_t *)txm_arena_alloc(&arena, (size_t)longer, 3 * sizeof *row);
    uint8_t *mark = (uint8_t *)txm_arena_alloc(&arena, count, 1);
    txm_status status = arena.failed ? txi_no_memory(env) : TXM_OK;
    if (status == TXM_OK) {
        for (size_t i = 0; i < count; i++) {
            f.known[i] = w->state[i] != TXI_VOID;
            mark[i] = !f.known[i];
            from[i] = w->state[i] == TXI_HOLE ? l->depth[i] : l->away[i];
        }
        txi_distances(mark, w->width, w->height, row, f.gap);
        status = txi_slopes_make(&f, from, 15 * 15, &arena, &arena, env);
    }
    for (int i = 0; i < l->end_count && status == TXM_OK; i++)
        sum += txi_goes_on(w, &f, &l->ends[i]) / (double)TXI_GO_ON;
    *share = l->end_count && status == TXM_OK ? sum / l->end_count : 1;
    txm_arena_free(&arena);
    return status;
}

/* The share of 8 pixels over which the known lines go on as a fit to the rest of them says, 8
   pixels farther out than the hole: what can be asked of a completion. About 1 for stripes, less
   for lines that meander; 1 if no line is long enough to tell. */
static double txi_foreseen(const txi_lines *l) {
    enum { SKIPPED = 2, FITTED = 12 }; /* points: near the hole, and to fit to at least          */
    double sum = 0;
    int count = 0;
    for (int i = 0; i < l->end_count; i++) {
        const txi_end *e = &l->ends[i];
        const txm_vec2 *p = l->points + e->first;
        const int from = (int)SKIPPED + TXI_GO_ON;
        double fit[6] = {0};
        int n = 0;
        if (e->count < from + FITTED) continue;
        txi_fit_points(l, p + from, e->count - from, fit);
        for (; n < TXI_GO_ON; n++) {
            const double s = -(n + 1);
            const double dx = -(fit[1] + 2 * fit[2] * s), dy = -(fit[4] + 2 * fit[5] * s);
            const txm_vec2 at = p[from - 1 - n], before = p[from - n], after = p[from - 2 - n];
            const txm_vec2 d = txi_unit((double)after.x - before.x, (double)after.y - before.y);
            const double ox = at.x - (fit[0] + fit[1] * s + fit[2] * s * s);
            const double oy = at.y - (fit[3] + fit[4] * s + fit[5] * s * s);
            const double speed = sqrt(dx * dx + dy * dy);
            if (speed <= 0 || fabs(ox * dy - oy * dx) > 2.5 * speed) break;
            if (d.x * dx + d.y * dy < 0.906 * speed) break;
        }
        sum += n / (double)TXI_GO_ON;
        count++;
    }
    return count ? sum / count : 1;
}

/* The bending energy of the part of a curve in the hole: the squared angle for an arc. */
static double txi_curve_bend(const txi_curve *c) {
    double length, bend;
    txm_vec2 coarse[TXI_STEPS + 1];
    const int n = c->last - c->first;
    if (n < 2) return 0;
    for (int i = 0; i <= TXI_STEPS; i++) /* coarse, so that steps of a pixel do not count         */
        coarse[i] = c->points[c->first + (n * i + TXI_STEPS / 2) / TXI_STEPS];
    if (n <= TXI_STEPS) txi_bend(c->points + c->first, n + 1, &length, &bend);
    else txi_bend(coarse, TXI_STEPS + 1, &length, &bend);
    return bend;
}

/* Share of the line ends on curves that are nearly straight (bending energy below 0.15); 0 without
   ends. */
static double txi_straight_share(const txi_lines *l, const txi_curve *curves, int count) {
    int ends = 0;
    for (int i = 0; i < count; i++) {
        if (txi_curve_bend(&curves[i]) < 0.15) ends += 1 + (curves[i].ends[1] >= 0);
    }
    return l->end_count ? (double)ends / l->end_count : 0;
}

/* The mean bending energy of the curves, each counted as at most 4; 0 without curves. */
static double txi_mean_bend(const txi_curve *curves, int count) {
    double sum = 0;
    for (int i = 0; i < count; i++) {
        const double b = txi_curve_bend(&curves[i]);
        sum += b < 4 ? b : 4;
    }
    return count ? sum / count : 0;
}

/* ---- pictures ---------------------------------------------------------------------------- */

static void txi_dot(const txi_window *w, int scale, double x, double y, const uint8_t ink[3],
                    uint8_t *rgb) {
    const double px = (x + 0.5) * scale, py = (y + 0.5) * scale;
    const int width = w->width * scale;
    if (!(px >= 0 && py >= 0 && px < width && py < w->height * scale)) return;
    memcpy(rgb + 3 * ((size_t)(int)py * (size_t)width + (size_t)(int)px), ink, 3);
}

/* Draw what was found over the colours of the window, enlarged scale times: points of lines in
   orange; the traced ends in cyan (long) or yellow; curves in green, in red where they end in the
   hole.
   rgb  3 * width * height * scale^2 bytes                                                      */
static void txi_draw_lines(const txi_window *w, const txi_lines *l, const txi_curve *curves,
                           int count, int scale, uint8_t *rgb) {
    static const uint8_t orange[3] = {255, 150, 0}, cyan[3] = {0, 220, 255};
    static const uint8_t yellow[3] = {255, 255, 0};
    static const uint8_t green[3] = {0, 255, 0}, red[3] = {255, 0, 0};
    for (int y = 0; y < w->height * scale; y++) {
        for (int x = 0; x < w->width * scale; x++) {
            const size_t i = (size_t)(y / scale) * (size_t)w->width + (size_t)(x / scale);
            uint8_t *p = rgb + 3 * ((size_t)y * (size_t)w->width * (size_t)scale + (size_t)x);
            for (int c = 0; c < 3; c++)
                p[c] = w->state[i] == TXI_VOID ? 0 : w->color[4 * i + (size_t)c];
        }
    }
    for (int i = 0; i < l->thin_count; i++)
        txi_dot(w, scale, l->thin[i].place.x, l->thin[i].place.y, orange, rgb);
    for (int i = 0; i < l->end_count; i++) {
        const txi_end *e = &l->ends[i];
        for (int k = 0; k < e->count; k++) {
            const txm_vec2 p = l->points[e->first + k];
            txi_dot(w, scale, p.x, p.y, e->is_long ? cyan : yellow, rgb);
        }
    }
    for (int i = 0; i < count; i++) {
        for (int k = curves[i].first; k < curves[i].last; k++) {
            for (int s = 0; s < 2 * scale; s++) {
                const txm_vec2 p = txi_between(curves[i].points[k], curves[i].points[k + 1],
                                               0.5 * s / scale);
                txi_dot(w, scale, p.x, p.y, curves[i].ends[1] < 0 ? red : green, rgb);
            }
        }
    }
}

/* ---- belief propagation ---------------------------------------------------------------------
   Labels x for the nodes of a graph that minimise

       E(x) = sum over nodes of unary(n, x_n) + sum over links of pair(l, x_a, x_b)   [1, eq. 2]

   by min-sum belief propagation. All costs are integers, so that every build decides alike.

   1. Pruning, as in priority belief propagation [5]: the nodes are visited in the order of how few
   of
      their labels are plausible, then in the opposite order. Each one sends its cheapest labels
      only, and keeps those that are cheapest by the messages from both visits.
   2. A graph without cycles: the exact minimum by dynamic programming.
   3. Else messages with damping, from which the labels are read node by node; then moves that fix
      some nodes, so that the others form a forest, and optimise all of these at once. The result
      is never worse than that of optimising one node at a time (ICM) from the cheapest labels. */

enum {
    TXI_COST_MOST = 1 << 30,     /* of one unary or pair cost; may be used as "forbidden"        */
    TXI_BELIEF_ROUNDS = 24,      /* of messages on a graph with cycles; ours                     */
    TXI_BELIEF_MOVES = 16        /* of forests on a graph with cycles; ours                      */
};

typedef struct txi_graph {
    int node_count, link_count;
    const int *counts;    /* labels per node, 1 or more                                        */
    const size_t *firsts; /* per node, where its costs begin in unary                          */
    const int32_t *unary; /* 0..TXI_COST_MOST                                                   */
    const int *ends;      /* 2 per link: different nodes                                        */
    const uint8_t *late;  /* per link, non-zero: too expensive for pruning, not used there; NULL:
                             0                                                                   */
    /* the cost of label a of the link's first node beside label b of its second,
       0..TXI_COST_MOST */
    int32_t (*pair)(const void *context, int link, int a, int b);
    const void *context;
} txi_graph;

/* What both steps need to know of the graph. */
typedef struct txi_beliefs {
    const txi_graph *graph;
    size_t *arms;        /* node_count + 1: where a node's links begin in arm                     */
    int *arm;            /* links, each twice                                                    */
    int *kept_counts;    /* labels kept per node                                                 */
    size_t *kept_firsts; /* node_count + 1: where they begin in kept and sums                    */
    int *kept;           /* labels, ascending for each node                                      */
    int64_t *unary;      /* of the kept labels                                                   */
    size_t *table_firsts; /* per link, where its table begins                                     */
    int32_t *tables;     /* pair costs of kept labels, rows are labels of the first node         */
    int *order, *parent; /* of the forest: nodes in the order of visits, link to the parent or -1 */
    uint32_t *group;     /* sets of free nodes that are connected, see txi_root                  */
    int *shuffled;       /* nodes in a random order                                              */
    uint8_t *is_free;    /* per node, 1: optimised in this move                                  */
    int64_t *sums;       /* per kept label                                                       */
    size_t *back_firsts; /* per node, where its labels begin in back                             */
    int *back;           /* for each label of the parent, the best label of the node             */
} txi_beliefs;

static int txi_other_end(const txi_graph *g, int link, int node) {
    return g->ends[2 * link] == node ? g->ends[2 * link + 1] : g->ends[2 * link];
}

/* Lists the links of each node. */
static void txi_belief_link(txi_beliefs *t, txm_arena *arena) {
    const txi_graph *g = t->graph;
    const size_t nodes = (size_t)g->node_count;
    t->arms = (size_t *)txm_arena_zero(arena, nodes + 1, sizeof *t->arms);
    t->arm = (int *)txm_arena_alloc(arena, 2 * (size_t)g->link_count + 1, sizeof *t->arm);
    if (arena->failed) return;
    for (int i = 0; i < 2 * g->link_count; i++) t->arms[g->ends[i]]++;
    for (size_t n = 0, sum = 0; n <= nodes; n++) { /* where they end, then moved to the front */
        sum += n < nodes ? t->arms[n] : 0;
        t->arms[n] = sum;
    }
    for (int i = 2 * g->link_count - 1; i >= 0; i--) t->arm[--t->arms[g->ends[i]]] = i / 2;
}

/* ---- pruning ---- */

/* A cost as a sort key. */
static uint32_t txi_cost_key(int64_t cost) {
    return cost < 0 ? 0 : cost > UINT32_MAX ? UINT32_MAX : (uint32_t)cost;
}

/* The `keep` cheapest of count costs, as pairs of key and index; of equal ones the first.
   Returns how many. scratch: count pairs. */
static int txi_cheapest(const int64_t *costs, int count, int keep, txm_pair *pairs,
                        txm_pair *scratch) {
    int64_t least = costs[0];
    for (int i = 1; i < count; i++) least = costs[i] < least ? costs[i] : least;
    for (int i = 0; i < count; i++) {
        pairs[i].key = txi_cost_key(costs[i] - least);
        pairs[i].value = (uint32_t)i;
    }
    txm_sort_pairs(pairs, scratch, (size_t)count);
    return count < keep ? count : keep;
}

/* How many labels of a node cost less than the least plus an eighth of the range: the fewer, the
   surer the node is of its label. */
static int txi_plausible(const int64_t *costs, int count) {
    int64_t least = costs[0], most = costs[0];
    int plausible = 0;
    for (int i = 1; i < count; i++) {
        least = costs[i] < least ? costs[i] : least;
        most = costs[i] > most ? costs[i] : most;
    }
    for (int i = 0; i < count; i++) plausible += costs[i] - least <= (most - least) / 8;
    return plausible;
}

/* Messages from the chosen labels of a node along its links to nodes not yet visited. */
static void txi_send_chosen(const txi_beliefs *t, int node, const txm_pair *chosen,
                            int chosen_count, const uint8_t *visited, int64_t *costs) {
    const txi_graph *g = t->graph;
    for (size_t i = t->arms[node]; i < t->arms[node + 1]; i++) {
        const int link = t->arm[i], other = txi_other_end(g, link, node);
        int64_t *to = costs + g->firsts[other];
        if (visited[other] || (g->late && g->late[link])) continue;
        for (int b = 0; b < g->counts[other]; b++) {
            int64_t least = INT64_MAX;
            for (int k = 0; k < chosen_count; k++) {
                const int a = (int)chosen[k].value;
                const int64_t pair = g->ends[2 * link] == node ? g->pair(g->context, link, a, b)
                                                               : g->pair(g->context, link, b, a);
                const int64_t sum = (int64_t)chosen[k].key + pair;
                least = sum < least ? sum : least;
            }
            to[b] += least;
        }
    }
}

/* Keep at most `keep` labels of each node. cost: O(links * keep * labels) calls of pair. */
static txm_status txi_belief_prune(txi_beliefs *t, int keep, txm_arena *arena, txm_env *env) {
    const txi_graph *g = t->graph;
    const int nodes = g->node_count;
    size_t labels = 0, kept = 0;
    int most = 1;
    for (int n = 0; n < nodes; n++) {
        labels += (size_t)g->counts[n];
        most = g->counts[n] > most ? g->counts[n] : most;
    }
    int64_t *costs = (int64_t *)txm_arena_alloc(arena, 2 * labels + 1, sizeof *costs);
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(arena, 2 * (size_t)most, sizeof *pairs);
    uint8_t *visited = (uint8_t *)txm_arena_zero(arena, (size_t)nodes + 1, 1);
    int *order = (int *)txm_arena_alloc(arena, (size_t)nodes + 1, sizeof *order);
    int *plausible = (int *)txm_arena_alloc(arena, (size_t)nodes + 1, sizeof *plausible);
    t->kept_counts = (int *)txm_arena_alloc(arena, (size_t)nodes + 1, sizeof *t->kept_counts);
    t->kept_firsts = (size_t *)txm_arena_alloc(arena, (size_t)nodes + 1, sizeof *t->kept_firsts);
    t->kept = (int *)txm_arena_alloc(arena, labels + 1, sizeof *t->kept);
    if (arena->failed) return txi_no_memory(env);

    for (int pass = 0; pass < 2; pass++) {
        for (int n = 0; n < nodes; n++) {
            for (int i = 0; i < g->counts[n]; i++)
                costs[(size_t)pass * labels + g->firsts[n] + (size_t)i] =
                    g->unary[g->firsts[n] + (size_t)i];
            visited[n] = 0;
            plausible[n] = -1;
        }
        for (int k = 0; k < nodes; k++) {
            int64_t *mine = costs + (size_t)pass * labels;
            int node = pass ? order[nodes - 1 - k] : -1;
            for (int n = 0; n < nodes && !pass; n++) {
                if (visited[n]) continue;
                if (plausible[n] < 0)
                    plausible[n] = txi_plausible(mine + g->firsts[n], g->counts[n]);
                if (node < 0 || plausible[n] < plausible[node]) node = n;
            }
            if (!pass) order[k] = node;
            visited[node] = 1;
            for (size_t i = t->arms[node]; i < t->arms[node + 1]; i++)
                plausible[txi_other_end(g, t->arm[i], node)] = -1; /* its costs change now */
            const int chosen =
                txi_cheapest(mine + g->firsts[node], g->counts[node], keep, pairs, pairs + most);
            txi_send_chosen(t, node, pairs, chosen, visited, mine);
        }
        if (txm_progress(env, 0, "strips")) return txi_stopped(env);
    }
    for (int n = 0; n < nodes; n++) {
        int64_t *a = costs + g->firsts[n], *b = a + labels;
        for (int i = 0; i < g->counts[n]; i++) a[i] += b[i] - g->unary[g->firsts[n] + (size_t)i];
        t->kept_firsts[n] = kept;
        t->kept_counts[n] = txi_cheapest(a, g->counts[n], keep, pairs, pairs + most);
        for (int i = 0; i < t->kept_counts[n]; i++) pairs[i].key = pairs[i].value;
        txm_sort_pairs(pairs, pairs + most, (size_t)t->kept_counts[n]);
        for (int i = 0; i < t->kept_counts[n]; i++) t->kept[kept++] = (int)pairs[i].value;
    }
    t->kept_firsts[nodes] = kept;
    return TXM_OK;
}

/* ---- one move: the free nodes form a forest, the others keep their labels ---- */

/* The cost of a kept label of `node` (index x) beside a kept label of the other end (index y). */
static int32_t txi_pair_of(const txi_beliefs *t, int link, int node, int x, int y) {
    const int *ends = t->graph->ends + 2 * link;
    const int row = ends[0] == node ? x : y, column = ends[0] == node ? y : x;
    return t->tables[t->table_firsts[link] + (size_t)row * (size_t)t->kept_counts[ends[1]] +
                     (size_t)column];
}

/* E(x), x as indices into the kept labels */
static int64_t txi_belief_energy(const txi_beliefs *t, const int *x) {
    const txi_graph *g = t->graph;
    int64_t sum = 0;
    for (int n = 0; n < g->node_count; n++) sum += t->unary[t->kept_firsts[n] + (size_t)x[n]];
    for (int l = 0; l < g->link_count; l++)
        sum += txi_pair_of(t, l, g->ends[2 * l], x[g->ends[2 * l]], x[g->ends[2 * l + 1]]);
    return sum;
}

/* Frees nodes in the order `shuffled` as long as no cycle arises among them. Returns how many. */
static int txi_belief_free(txi_beliefs *t) {
    const txi_graph *g = t->graph;
    int count = 0;
    for (int n = 0; n < g->node_count; n++) {
        t->group[n] = (uint32_t)n;
        t->is_free[n] = 0;
    }
    for (int k = 0; k < g->node_count; k++) {
        const int n = t->shuffled[k];
        int cycle = 0;
        for (size_t i = t->arms[n]; i < t->arms[n + 1] && !cycle; i++) {
            const int m = txi_other_end(g, t->arm[i], n);
            if (!t->is_free[m]) continue;
            for (size_t j = t->arms[n]; j < i && !cycle; j++) { /* two links to one tree */
                const int o = txi_other_end(g, t->arm[j], n);
                cycle = t->is_free[o] &&
                        txi_root(t->group, (uint32_t)o) == txi_root(t->group, (uint32_t)m);
            }
        }
        if (cycle) continue;
        t->is_free[n] = 1;
        count++;
        for (size_t i = t->arms[n]; i < t->arms[n + 1]; i++) {
            const int m = txi_other_end(g, t->arm[i], n);
            if (t->is_free[m]) txi_join_sets(t->group, (uint32_t)m, (uint32_t)n);
        }
    }
    return count;
}

/* Orders the free nodes so that each stands behind its parent. Returns how many. */
static int txi_belief_order(txi_beliefs *t) {
    const txi_graph *g = t->graph;
    int count = 0;
    for (int n = 0; n < g->node_count; n++) t->parent[n] = -2; /* not reached */
    for (int root = 0; root < g->node_count; root++) {
        if (!t->is_free[root] || t->parent[root] != -2) continue;
        t->parent[root] = -1;
        t->order[count++] = root;
        for (int k = count - 1; k < count; k++) {
            const int n = t->order[k];
            for (size_t i = t->arms[n]; i < t->arms[n + 1]; i++) {
                const int m = txi_other_end(g, t->arm[i], n);
                if (!t->is_free[m] || t->parent[m] != -2) continue;
                t->parent[m] = t->arm[i];
                TXM_ASSERT(count < g->node_count);
                t->order[count++] = m;
            }
        }
    }
    return count;
}

/* The best labels of all free nodes, the others' given: exact. */
static void txi_belief_move(txi_beliefs *t, int *x) {
    const txi_graph *g = t->graph;
    const int count = txi_belief_order(t);
    for (int k = 0; k < count; k++) {
        const int n = t->order[k];
        int64_t *sums = t->sums + t->kept_firsts[n];
        for (int a = 0; a < t->kept_counts[n]; a++)
            sums[a] = t->unary[t->kept_firsts[n] + (size_t)a];
        for (size_t i = t->arms[n]; i < t->arms[n + 1]; i++) {
            const int m = txi_other_end(g, t->arm[i], n);
            for (int a = 0; a < t->kept_counts[n] && !t->is_free[m]; a++)
                sums[a] += txi_pair_of(t, t->arm[i], n, a, x[m]);
        }
    }
    size_t back = 0;
    for (int k = count - 1; k >= 0; k--) { /* leaves first */
        const int n = t->order[k], link = t->parent[n];
        if (link < 0) continue;
        const int up = txi_other_end(g, link, n);
        const int64_t *sums = t->sums + t->kept_firsts[n];
        t->back_firsts[n] = back;
        for (int b = 0; b < t->kept_counts[up]; b++) {
            int64_t least = INT64_MAX;
            int best = 0;
            for (int a = 0; a < t->kept_counts[n]; a++) {
                const int64_t sum = sums[a] + txi_pair_of(t, link, n, a, b);
                if (sum < least) least = sum, best = a;
            }
            t->back[back++] = best;
            t->sums[t->kept_firsts[up] + (size_t)b] += least;
        }
    }
    for (int k = 0; k < count; k++) { /* roots first */
        const int n = t->order[k], link = t->parent[n];
        const int64_t *sums = t->sums + t->kept_firsts[n];
        if (link >= 0) {
            x[n] = t->back[t->back_firsts[n] + (size_t)x[txi_other_end(g, link, n)]];
            continue;
        }
        x[n] = 0;
        for (int a = 1; a < t->kept_counts[n]; a++)
            if (sums[a] < sums[x[n]]) x[n] = a;
    }
}

/* ---- graphs with cycles ---- */

/* One node at a time, until nothing changes (ICM). */
static void txi_belief_single(txi_beliefs *t, int *x) {
    const txi_graph *g = t->graph;
    int changed = 1;
    for (int round = 0; round < 100 && changed; round++) {
        changed = 0;
        for (int n = 0; n < g->node_count; n++) {
            int64_t *sums = t->sums + t->kept_firsts[n];
            int best = x[n];
            for (int a = 0; a < t->kept_counts[n]; a++) {
                sums[a] = t->unary[t->kept_firsts[n] + (size_t)a];
                for (size_t i = t->arms[n]; i < t->arms[n + 1]; i++)
                    sums[a] += txi_pair_of(t, t->arm[i], n, a,
                                           x[txi_other_end(g, t->arm[i], n)]);
            }
            for (int a = 0; a < t->kept_counts[n]; a++)
                if (sums[a] < sums[best]) best = a;
            changed |= best != x[n];
            x[n] = best;
        }
    }
}

/* Where a link's messages to its first (side 0) or second end lie. */
static int64_t *txi_message(int64_t *messages, const size_t *firsts, const txi_beliefs *t, int link,
                            int side) {
    const int *ends = t->graph->ends + 2 * link;
    return messages + firsts[link] + (side ? (size_t)t->kept_counts[ends[0]] : 0);
}

/* The unary costs of a node and all messages to it, into its place in sums. */
static int64_t *txi_belief_gather(txi_beliefs *t, int n, int64_t *messages, const size_t *firsts) {
    const txi_graph *g = t->graph;
    int64_t *sums = t->sums + t->kept_firsts[n];
    for (int a = 0; a < t->kept_counts[n]; a++) sums[a] = t->unary[t->kept_firsts[n] + (size_t)a];
    for (size_t i = t->arms[n]; i < t->arms[n + 1]; i++) {
        const int64_t *in =
            txi_message(messages, firsts, t, t->arm[i], g->ends[2 * t->arm[i] + 1] == n);
        for (int a = 0; a < t->kept_counts[n]; a++) sums[a] += in[a];
    }
    return sums;
}

/* New messages from a node along one link: half the old one, half the new one, the least of them
   0. */
static void txi_belief_send(txi_beliefs *t, int n, int link, int64_t *messages,
                            const size_t *firsts) {
    const txi_graph *g = t->graph;
    const int side = g->ends[2 * link] == n; /* of the receiver */
    const int m = txi_other_end(g, link, n);
    const int64_t *sums = t->sums + t->kept_firsts[n];
    const int64_t *in = txi_message(messages, firsts, t, link, !side);
    int64_t *out = txi_message(messages, firsts, t, link, side), base = INT64_MAX;
    for (int b = 0; b < t->kept_counts[m]; b++) {
        int64_t least = INT64_MAX;
        for (int a = 0; a < t->kept_counts[n]; a++) {
            const int64_t sum = sums[a] - in[a] + txi_pair_of(t, link, n, a, b);
            least = sum < least ? sum : least;
        }
        out[b] = (out[b] + least) / 2;
        base = out[b] < base ? out[b] : base;
    }
    for (int b = 0; b < t->kept_counts[m]; b++) out[b] -= base;
}

/* Reads labels node by node: the least sum of the unary cost, the pair costs with nodes already
   read and the messages from the others. */
static void txi_belief_read(txi_beliefs *t, int *x, int64_t *messages, const size_t *firsts) {
    const txi_graph *g = t->graph;
    for (int n = 0; n < g->node_count; n++) {
        int64_t *sums = txi_belief_gather(t, n, messages, firsts);
        x[n] = 0;
        for (size_t i = t->arms[n]; i < t->arms[n + 1]; i++) {
            const int link = t->arm[i], m = txi_other_end(g, link, n);
            const int64_t *in = txi_message(messages, firsts, t, link, g->ends[2 * link + 1] == n);
            for (int a = 0; a < t->kept_counts[n] && m < n; a++)
                sums[a] += txi_pair_of(t, link, n, a, x[m]) - in[a];
        }
        for (int a = 1; a < t->kept_counts[n]; a++)
            if (sums[a] < sums[x[n]]) x[n] = a;
    }
}

/* Messages for some rounds; x receives the best labels read after any of them. y: room for
   labels. */
static txm_status txi_belief_loopy(txi_beliefs *t, int *x, int *y, txm_arena *arena, txm_env *env) {
    const txi_graph *g = t->graph;
    size_t size = 0;
    size_t *firsts = (size_t *)txm_arena_alloc(arena, (size_t)g->link_count + 1, sizeof *firsts);
    for (int l = 0; l < g->link_count && firsts; l++) {
        firsts[l] = size;
        size += (size_t)(t->kept_counts[g->ends[2 * l]] + t->kept_counts[g->ends[2 * l + 1]]);
    }
    int64_t *messages = (int64_t *)txm_arena_zero(arena, size + 1, sizeof *messages);
    if (arena->failed) return txi_no_memory(env);
    int64_t best = txi_belief_energy(t, x);
    for (int round = 0; round < TXI_BELIEF_ROUNDS; round++) {
        for (int k = 0; k < g->node_count; k++) { /* forwards and backwards alternately */
            const int n = round & 1 ? g->node_count - 1 - k : k;
            txi_belief_gather(t, n, messages, firsts);
            for (size_t i = t->arms[n]; i < t->arms[n + 1]; i++)
                txi_belief_send(t, n, t->arm[i], messages, firsts);
        }
        txi_belief_read(t, y, messages, firsts);
        const int64_t energy = txi_belief_energy(t, y);
        if (energy < best) {
            best = energy;
            memcpy(x, y, (size_t)g->node_count * sizeof *x);
        }
        if (txm_progress(env, 0, "strips")) return txi_stopped(env);
    }
    return TXM_OK;
}

/* Moves on random forests from x; the energy never rises. */
static void txi_belief_improve(txi_beliefs *t, int *x, txm_rng *rng) {
    for (int move = 0; move < TXI_BELIEF_MOVES; move++) {
        txm_shuffle(rng, t->shuffled, t->graph->node_count);
        txi_belief_free(t);
        txi_belief_move(t, x);
    }
}

/* ---- the whole ---- */

/* The cheapest label of each node by itself. */
static void txi_belief_cheapest(const txi_beliefs *t, int *x) {
    for (int n = 0; n < t->graph->node_count; n++) {
        const int64_t *unary = t->unary + t->kept_firsts[n];
        x[n] = 0;
        for (int a = 1; a < t->kept_counts[n]; a++)
            if (unary[a] < unary[x[n]]) x[n] = a;
    }
}

/* Tables of the pair costs of kept labels, and room for moves. */
static txm_status txi_belief_tables(txi_beliefs *t, txm_arena *arena, txm_env *env) {
    const txi_graph *g = t->graph;
    const size_t nodes = (size_t)g->node_count, kept = t->kept_firsts[nodes];
    size_t cells = 0, backs = 0;
    t->table_firsts =
        (size_t *)txm_arena_alloc(arena, (size_t)g->link_count + 1, sizeof *t->table_firsts);
    for (int l = 0; l < g->link_count && t->table_firsts; l++) {
        const int a = t->kept_counts[g->ends[2 * l]], b = t->kept_counts[g->ends[2 * l + 1]];
        t->table_firsts[l] = cells;
        cells += (size_t)a * (size_t)b;
        backs += (size_t)(a > b ? a : b); /* one of the two is the parent */
    }
    t->tables = (int32_t *)txm_arena_alloc(arena, cells + 1, sizeof *t->tables);
    t->unary = (int64_t *)txm_arena_alloc(arena, kept + 1, sizeof *t->unary);
    t->sums = (int64_t *)txm_arena_alloc(arena, kept + 1, sizeof *t->sums);
    t->order = (int *)txm_arena_alloc(arena, nodes + 1, sizeof *t->order);
    t->parent = (int *)txm_arena_alloc(arena, nodes + 1, sizeof *t->parent);
    t->group = (uint32_t *)txm_arena_alloc(arena, nodes + 1, sizeof *t->group);
    t->shuffled = (int *)txm_arena_alloc(arena, nodes + 1, sizeof *t->shuffled);
    t->is_free = (uint8_t *)txm_arena_alloc(arena, nodes + 1, 1);
    t->back_firsts = (size_t *)txm_arena_alloc(arena, nodes + 1, sizeof *t->back_firsts);
    t->back = (int *)txm_arena_alloc(arena, backs + 1, sizeof *t->back);
    if (arena->failed) return txi_no_memory(env);
    for (size_t n = 0; n < nodes; n++) {
        t->shuffled[n] = (int)n;
        for (size_t i = t->kept_firsts[n]; i < t->kept_firsts[n + 1]; i++)
            t->unary[i] = g->unary[g->firsts[n] + (size_t)t->kept[i]];
    }
    for (int l = 0; l < g->link_count; l++) {
        const int a = g->ends[2 * l], b = g->ends[2 * l + 1];
        int32_t *cell = t->tables + t->table_firsts[l];
        for (int i = 0; i < t->kept_counts[a]; i++)
            for (int j = 0; j < t->kept_counts[b]; j++)
                *cell++ = g->pair(g->context, l, t->kept[t->kept_firsts[a] + (size_t)i],
                                  t->kept[t->kept_firsts[b] + (size_t)j]);
        if (l % 16 == 15 && txm_progress(env, 0, "strips")) return txi_stopped(env);
    }
    return TXM_OK;
}

/* Labels of low energy.

   keep    labels of a node that are left after pruning, 1 or more; those of late links are only
           found if they survive it
   labels  receives one label per node
   energy  receives E of them; may be NULL
   return  TXM_OK; TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost    O(links * keep * (labels + keep * rounds)); memory of the arena                      */
static txm_status txi_belief(const txi_graph *g, int keep, uint64_t seed, txm_arena *arena,
                             int *labels, int64_t *energy, txm_env *env) {
    const size_t nodes = (size_t)g->node_count;
    txi_beliefs t;
    memset(&t, 0, sizeof t);
    t.graph = g;
    txi_belief_link(&t, arena);
    if (arena->failed) return txi_no_memory(env);
    txm_status status = txi_belief_prune(&t, keep, arena, env);
    if (status == TXM_OK) status = txi_belief_tables(&t, arena, env);
    if (status != TXM_OK) return status;
    int *x = (int *)txm_arena_zero(arena, 3 * nodes + 1, sizeof *x);
    if (!x) return txi_no_memory(env);
    int *y = x + nodes;

    if (TXI_LEFT_OUT & TXI_BELIEF) {
        txi_belief_cheapest(&t, x);
    } else if (txi_belief_free(&t) == g->node_count) {
        txi_belief_move(&t, x);
    } else {
        txm_rng rng = txm_rng_make(seed, 0);
        txi_belief_cheapest(&t, y);
        txi_belief_single(&t, y);
        memcpy(x, y, nodes * sizeof *x);
        status = txi_belief_loopy(&t, x, y + nodes, arena, env);
        if (status != TXM_OK) return status;
        txi_belief_improve(&t, x, &rng);
        txi_belief_improve(&t, y, &rng);
        if (txi_belief_energy(&t, y) < txi_belief_energy(&t, x)) memcpy(x, y, nodes * sizeof *x);
    }
    for (size_t n = 0; n < nodes; n++) labels[n] = t.kept[t.kept_firsts[n] + (size_t)x[n]];
    if (energy) *energy = txi_belief_energy(&t, x);
    return TXM_OK;
}

/* ---- strokes -----------------------------------------------------------------------------------
   Two curves that run along each other with the same colour between them are the sides of one stroke:
   a bar, a stripe, a joint. A stroke is completed as a whole, and covers what it crosses.         */

enum {
    TXI_STROKE_WIDEST = 40, /* pixels; ours                                                       */
    TXI_STROKE_KNOWN = 24,  /* points of a curve's known part, next to the hole, that are looked at */
    TXI_STROKE_LEAST = 6    /* so many of them must lie beside the other curve                      */
};

/* The colours on both sides of a curve in its known part, at each end of the hole. */
typedef struct txi_sides {
    double color[2][2][3]; /* end (0 in front of the hole), side (0 left), RGB                     */
    int hits[2][2];
} txi_sides;

/* The direction of a curve at point i, over 5 points. */
static txm_vec2 txi_curve_along(const txi_curve *c, int i) {
    const txm_vec2 a = c->points[i > 2 ? i - 2 : 0];
    const txm_vec2 b = c->points[i + 2 < c->count ? i + 2 : c->count - 1];
    return txi_unit((double)b.x - a.x, (double)b.y - a.y);
}

/* The known points next to the hole: before it (end 0) or behind it; from > to: none. */
static void txi_curve_known(const txi_curve *c, int end, int *from, int *to) {
    *from = end ? c->last + 1 : c->first > TXI_STROKE_KNOWN ? c->first - TXI_STROKE_KNOWN : 0;
    *to = end ? c->last + TXI_STROKE_KNOWN : c->first - 1;
    if (*to > c->count - 1) *to = c->count - 1;
}

static void txi_sides_make(const txi_window *w, const txi_curve *c, double away, txi_sides *s) {
    memset(s, 0, sizeof *s);
    for (int end = 0; end < 2; end++) {
        int from, to;
        txi_curve_known(c, end, &from, &to);
        for (int i = from; i <= to; i++) {
            const txm_vec2 t = txi_curve_along(c, i), p = c->points[i];
            for (int side = 0; side < 2; side++) {
                const double u = side ? away : -away; /* right is (-t.y, t.x) */
                const ptrdiff_t at = txi_pixel(w->width, w->height, (double)p.x - u * (double)t.y,
                                               (double)p.y + u * (double)t.x);
                if (at < 0 || (w->state[at] != TXI_KNOWN && w->state[at] != TXI_FOREIGN)) continue;
                for (int k = 0; k < 3; k++) s->color[end][side][k] += w->color[4 * at + k];
                s->hits[end][side]++;
            }
        }
        for (int side = 0; side < 2; side++)
            for (int k = 0; k < 3 && s->hits[end][side]; k++)
                s->color[end][side][k] /= s->hits[end][side];
    }
}

static double txi_sides_distance(const double a[3], const double b[3]) {
    double sum = 0;
    for (int c = 0; c < 3; c++) sum += (a[c] - b[c]) * (a[c] - b[c]);
    return sqrt(sum);
}

/* Where curve b lies beside point i of curve a: signed distance to the right, and b's point; 0 if it has
   no point beside it. */
static int txi_beside(const txi_curve *a, int i, const txi_curve *b, double *across, int *point) {
    const txm_vec2 t = txi_curve_along(a, i), p = a->points[i];
    double best = 1e30, ahead = 1e30;
    for (int k = 0; k < b->count; k++) {
        const double x = (double)b->points[k].x - p.x, y = (double)b->points[k].y - p.y;
        const double square = x * x + y * y;
        if (square >= best) continue;
        best = square;
        ahead = x * (double)t.x + y * (double)t.y;
        *across = y * (double)t.x - x * (double)t.y;
        *point = k;
    }
    return ahead < 2 && ahead > -2;
}

/* The mean signed width between a and b at one end of a's hole, and which end of b that is. 0: they do
   not run along each other there. */
static int txi_stroke_end(const txi_curve *a, const txi_curve *b, int end, double *width, int *of_b) {
    double sum = 0, squares = 0;
    int n = 0, from, to, votes = 0;
    txi_curve_known(a, end, &from, &to);
    for (int i = from; i <= to; i += 2) {
        double across;
        int point;
        if (!txi_beside(a, i, b, &across, &point)) continue;
        sum += across;
        squares += across * across;
        votes += point < b->first ? -1 : point > b->last ? 1 : 0;
        n++;
    }
    if (2 * n < TXI_STROKE_LEAST) return 0;
    const double mean = sum / n, spread = squares / n - mean * mean, size = mean < 0 ? -mean : mean;
    *width = mean;
    *of_b = votes > 0;
    return size >= 2 && size <= (double)TXI_STROKE_WIDEST && spread <= 0.04 * size * size + 1;
}

/* The width of the stroke between two curves; 0: they are not its sides. Both must end alike. */
static double txi_stroke(const txi_window *w, const txi_curve *a, const txi_curve *b) {
    double width[2] = {0, 0};
    int of_b[2] = {0, 1}, ends = 0;
    for (int end = 0; end < 2; end++) {
        if (a->ends[end] < 0) continue;
        if (!txi_stroke_end(a, b, end, &width[end], &of_b[end])) return 0;
        if (b->ends[of_b[end]] < 0) return 0;
        ends++;
    }
    if (ends == 0 || (ends == 2 && of_b[0] == of_b[1])) return 0;
    if (ends != (b->ends[0] >= 0) + (b->ends[1] >= 0)) return 0;
    if (ends == 2 && (width[0] > 0) != (width[1] > 0)) return 0;
    const double known = width[0] + width[1], mean = (known < 0 ? -known : known) / ends;
    const int right = known > 0;
    for (int i = a->first; i <= a->last; i += 2) { /* through the hole, too */
        double across = 0;
        int point;
        if (!txi_beside(a, i, b, &across, &point)) continue;
        if (!right) across = -across;
        if (across < 0.4 * mean || across > 2.5 * mean) return 0;
    }
    txi_sides sa, sb;
    const double away = mean < 6 ? 0.5 * mean : 3;
    txi_sides_make(w, a, away, &sa);
    txi_sides_make(w, b, away, &sb);
    for (int end = 0; end < 2; end++) {
        const int e = of_b[end], same_way = of_b[0] == 0 && of_b[1] == 1;
        const int inside_a = right, inside_b = same_way ? !right : right;
        if (a->ends[end] < 0) continue;
        if (!sa.hits[end][0] || !sa.hits[end][1] || !sb.hits[e][0] || !sb.hits[e][1]) return 0;
        const double contrast_a = txi_sides_distance(sa.color[end][0], sa.color[end][1]);
        const double contrast_b = txi_sides_distance(sb.color[e][0], sb.color[e][1]);
        const double least = contrast_a < contrast_b ? contrast_a : contrast_b;
        if (txi_sides_distance(sa.color[end][inside_a], sb.color[e][inside_b]) > 0.35 * least + 4)
            return 0;
    }
    return mean;
}

/* Find the strokes among curves whose partner is not set yet. partners receives the other side of
   each, or -1: of all pairs the narrowest first. width: room for count * count floats.
   cost    O(pairs of curves near each other * points^2)                                          */
static void txi_find_strokes(const txi_window *w, const txi_curve *curves, int count, int *partners,
                             float *width) {
    const size_t n = (size_t)count;
    for (int i = 0; i < count; i++) {
        const int p = curves[i].partner;
        partners[i] = p >= 0 && p < count && p != i ? p : -1;
    }
    for (int i = 0; i < count; i++) {
        for (int j = 0; j < count; j++) {
            width[(size_t)i * n + (size_t)j] = 0;
            if (j == i || partners[i] >= 0 || partners[j] >= 0) continue;
            if (curves[i].count < 2 || curves[j].count < 2) continue;
            width[(size_t)i * n + (size_t)j] = txm_float(txi_stroke(w, &curves[i], &curves[j]));
        }
    }
    for (;;) {
        int a = -1, b = -1;
        float least = 0;
        for (int i = 0; i < count; i++) {
            for (int j = i + 1; j < count; j++) {
                const float u = width[(size_t)i * n + (size_t)j], v = width[(size_t)j * n + (size_t)i];
                if (partners[i] >= 0 || partners[j] >= 0 || u <= 0 || v <= 0) continue;
                if (a >= 0 && u + v >= least) continue;
                least = u + v;
                a = i;
                b = j;
            }
        }
        if (a < 0) return;
        partners[a] = b;
        partners[b] = a;
    }
}

/* ---- strips: lines made straight ---------------------------------------------------------------
   The texture along a line is treated in the line's own frame: column c is a place on the line, row
   j lies across it, along the normal [1, III.A: frame v, d, n]. Two lines with the same contrast
   close to each other, the sides of a stroke, are one strip; its rows between the lines are
   stretched to the width that the stroke has at each column:

       margin rows  |  inside + 1 rows from line to line (1 row: a single line)  |  margin rows

   In this frame the paper's rotated candidates (each source patch turned so that its line has the
   direction of the target's) need no search: every source is turned exactly, at each column, and
   laid with its line on the target's line. The paper's search over +-10 degrees makes up for lines
   that are known roughly; here they are registered to a fraction of a pixel against the mean
   profile of the line. And the costs of all pairs of candidates become sums along diagonals of one
   table. */

enum {
    TXI_STRIP_MARGIN = 10, /* rows on each side, pixels; ours                                  */
    TXI_STRIP_INSIDE = TXI_STROKE_WIDEST, /* most rows between the lines of a stroke              */
    TXI_STRIP_ROWS = 2 * TXI_STRIP_MARGIN + 1 + TXI_STRIP_INSIDE,
    TXI_STRIP_REACH = 8, /* columns of a patch on each side of its centre: radius r [1, III.A] */
    TXI_STRIP_HOP = 6,   /* columns between neighbouring patches, so that they overlap        */
    TXI_STRIP_REACH_LEAST = 3, /* of patches where little of a line is known                      */
    TXI_STRIP_COLUMNS = 448, /* most columns of sources for a strip                               */
    TXI_STRIP_COLUMNS_LEAST = 128, /* and so many at least, however many strips there are         */
    TXI_STRIP_CELLS = 4 << 20, /* of all tables of overlaps, 4 bytes each: 16 MB                  */
    TXI_STRIP_OTHERS = 3, /* most other lines a strip takes texture from                       */
    TXI_STRIP_KEEP = 24,  /* candidates of a patch after pruning                               */
    TXI_STRIP_CLEAN = 24, /* columns of a stroke that show all of it, from which on no others are
                             used                                                            */
    TXI_STRIP_ONWARD = 12,  /* pixels that lines without an end are continued behind the hole    */
    TXI_STRIP_PROFILE = 12, /* known columns on each side that profiles are means of             */
    TXI_STRIP_FEATURES = (3 * TXI_STRIP_ROWS + 15) / 16 * 16
};

/* Columns of a line. */
typedef struct txi_ribbon {
    int count;
    txm_vec2 *place; /* the middle between the two lines, or the line, window pixels              */
    txm_vec2 *along; /* unit tangent t; rows grow along (-t.y, t.x)                               */
    float *half;     /* half of the distance between the two lines, 0 for a single line          */
} txi_ribbon;

/* A column of texture to copy from. */
typedef struct txi_column {
    txm_vec2 place, along;
    float half;
    float side;        /* 1, or -1: mirrored, rows grow along (t.y, -t.x)                        */
    int run;           /* columns next to each other on the same line have the same number        */
    int before, after; /* columns of the run in front of and behind it; -1: not usable            */
} txi_column;

typedef struct txi_strip {
    int curve, partner; /* indices of the curves; partner -1: a single line                       */
    int inside, rows;
    int first, last;    /* columns with hole pixels                                              */
    int tail;           /* columns behind the hole are no known part of the line, or are missing  */
    int is_open;        /* the line ends in the hole                                             */
    int is_bare;        /* a stroke that crosses others: see cover.h                              */
    uint8_t *typical;   /* its usual colours, 3 per row; NULL: not known                          */
    float tolerance;   /* levels; colours farther from the usual ones are not those of the stroke */
    txi_ribbon line;
    uint8_t *color;     /* 3 per column and row                                                  */
    uint8_t *known;     /* 1 per column and row: the colour is known                             */
    txi_column *sources;
    int source_count, room; /* room: most of them                                                */
    uint8_t *source_color; /* 3 per source column and row                                         */
    int16_t *source_feature; /* features per source column: colours, weighted                     */
    int features;        /* 3 * rows, rounded up to a multiple of 16                              */
    int reach, hop;
    int *labels;         /* source columns that are centres of whole patches                      */
    int label_count;
    int32_t *overlap;    /* source_count^2: see txi_strip_overlaps                                */
    float *profile;  /* 2 * 3 * rows: mean colours in front of the hole and behind it; NULL: none */
    int node, node_count; /* its patches in the graph; patch k is centred at first + k * hop      */
    int *chosen;         /* per patch: the source column chosen                                   */
} txi_strip;

static txm_vec2 txi_normal_of(txm_vec2 along) {
    return txm_v2(-along.y, along.x);
}

/* RGB at a place, bilinear, at a place rounded to 1/256 of a pixel. Returns 0 if a pixel needed is
   not known, 1 if all are, 2 if all may be copied from; rgb is black for 0. */
static int txi_strip_pixel(const txi_window *w, double x, double y, int rgb[3]) {
    rgb[0] = rgb[1] = rgb[2] = 0;
    if (!(x >= 0 && y >= 0 && x <= w->width - 1 && y <= w->height - 1)) return 0;
    const int fx = (int)(x * 256 + 0.5), fy = (int)(y * 256 + 0.5);
    const int u = fx & 255, v = fy & 255;
    const size_t i = (size_t)(fy >> 8) * (size_t)w->width + (size_t)(fx >> 8);
    const size_t right = u ? 1 : 0, below = v ? (size_t)w->width : 0;
    const size_t at[4] = {i, i + right, i + below, i + below + right};
    const int weight[4] = {(256 - u) * (256 - v), u * (256 - v), (256 - u) * v, u * v};
    int best = 2;
    for (int k = 0; k < 4; k++) {
        const uint8_t s = w->state[at[k]];
        if (s == TXI_FOREIGN) best = 1;
        else if (s != TXI_KNOWN) return 0;
    }
    for (int c = 0; c < 3; c++) {
        int sum = 1 << 15;
        for (int k = 0; k < 4; k++) sum += weight[k] * w->color[4 * at[k] + (size_t)c];
        rgb[c] = sum >> 16;
    }
    return best;
}

/* Where a row, perhaps between two, lies: distance from the middle of a stroke of this half width,
   along the normal. */
static double txi_row_offset(double row, int inside, double half) {
    const double k = row - (double)TXI_STRIP_MARGIN;
    if (k <= 0) return k - half;
    if (k >= inside) return k - inside + half;
    return half * (2 * k / inside - 1);
}

/* The row, with fraction, at an offset from the middle: the inverse. */
static double txi_offset_row(double offset, int inside, double half) {
    if (offset <= -half) return (double)TXI_STRIP_MARGIN + offset + half;
    if (offset >= half) return TXI_STRIP_MARGIN + inside + offset - half;
    return (double)TXI_STRIP_MARGIN + inside * (0.5 * offset / half + 0.5);
}

/* ---- the frame of a line ---- */

/* Mean of values[i - radius .. i + radius], the window made smaller at the ends so that it stays
   symmetric; count values, `step` floats apart. */
static double txi_running_mean(const float *values, int count, int step, int i, int radius) {
    double sum = 0;
    if (i < radius) radius = i;
    if (count - 1 - i < radius) radius = count - 1 - i;
    for (int k = i - radius; k <= i + radius; k++) sum += (double)values[k * step];
    return sum / (2 * radius + 1);
}

/* Columns at points of a line about one pixel apart. */
static txm_status txi_ribbon_make(const txm_vec2 *points, int count, txm_arena *arena,
                                  txi_ribbon *r, txm_env *env) {
    r->count = count;
    r->place = (txm_vec2 *)txm_arena_alloc(arena, (size_t)count, sizeof *r->place);
    r->along = (txm_vec2 *)txm_arena_alloc(arena, (size_t)count, sizeof *r->along);
    r->half = (float *)txm_arena_zero(arena, (size_t)count, sizeof *r->half);
    if (arena->failed) return txi_no_memory(env);
    for (int i = 0; i < count; i++) {
        r->place[i].x = txm_float(txi_running_mean(&points[0].x, count, 2, i, 3));
        r->place[i].y = txm_float(txi_running_mean(&points[0].y, count, 2, i, 3));
    }
    for (int i = 0; i < count; i++) {
        const txm_vec2 a = r->place[i > 2 ? i - 2 : 0];
        const txm_vec2 b = r->place[i + 2 < count ? i + 2 : count - 1];
        r->along[i] = txi_unit((double)b.x - a.x, (double)b.y - a.y);
    }
    return TXM_OK;
}

/* The points of a curve. One that goes through the hole, but meets no line on the other side of it,
   is continued straight on there, so that its strip fits what is known; is_open receives 0 for it,
   1 for one that ends in the hole. points: room for TXI_STRIP_ONWARD more than the curve has.
   Returns how many. */
static int txi_curve_onward(const txi_window *w, const txi_curve *c, txm_vec2 *points,
                            int *is_open) {
    const int n = c->count;
    memcpy(points, c->points, (size_t)n * sizeof *points);
    *is_open = c->ends[1] < 0;
    if (c->ends[1] >= 0 || n < 4) return n;
    const txm_vec2 p = points[n - 1], t = txi_curve_along(c, n - 2);
    const ptrdiff_t beyond = txi_pixel(w->width, w->height, (double)p.x + 3 * (double)t.x,
                                       (double)p.y + 3 * (double)t.y);
    if (beyond < 0 || (w->state[beyond] != TXI_KNOWN && w->state[beyond] != TXI_FOREIGN)) return n;
    *is_open = 0;
    for (int i = 0; i < TXI_STRIP_ONWARD; i++)
        points[n + i] = txm_v2(txm_float((double)p.x + (i + 1) * (double)t.x),
                               txm_float((double)p.y + (i + 1) * (double)t.y));
    return n + TXI_STRIP_ONWARD;
}

enum {
    TXI_REGISTER_SIDE = 12,  /* samples on each side of a line, half a pixel apart                */
    TXI_REGISTER_TAPS = 2 * TXI_REGISTER_SIDE + 1,
    TXI_REGISTER_SHIFT = 3   /* most samples that a line is moved                                 */
};

/* The profile across column i, 3 per tap; 0 if part of it is not known. */
static int txi_register_profile(const txi_window *w, const txi_ribbon *r, int i, float *profile) {
    const txm_vec2 n = txi_normal_of(r->along[i]);
    for (int k = 0; k < TXI_REGISTER_TAPS; k++) {
        const double t = 0.5 * (k - TXI_REGISTER_SIDE);
        int rgb[3];
        if (!txi_strip_pixel(w, (double)r->place[i].x + t * (double)n.x,
                             (double)r->place[i].y + t * (double)n.y, rgb))
            return 0;
        for (int c = 0; c < 3; c++) profile[3 * k + c] = (float)rgb[c];
    }
    return 1;
}

/* By how many pixels a profile is displaced against the mean one: least squares over shifts of half
   pixels, then a parabola. */
static double txi_register_shift(const double *mean, const double *profile) {
    const int most = TXI_REGISTER_SHIFT;
    double cost[2 * TXI_REGISTER_SHIFT + 1];
    int best = most;
    for (int s = -most; s <= most; s++) {
        double sum = 0;
        for (int k = most; k < TXI_REGISTER_TAPS - most; k++) {
            for (int c = 0; c < 3; c++) {
                const double d = mean[3 * k + c] - profile[3 * (k + s) + c];
                sum += d * d;
            }
        }
        cost[s + most] = sum;
    }
    for (int s = 0; s <= 2 * most; s++)
        if (cost[s] < cost[best]) best = s;
    if (best == 0 || best == 2 * most) return 0; /* no minimum: not registered */
    const double bend = cost[best - 1] - 2 * cost[best] + cost[best + 1];
    const double off = bend > 0 ? 0.5 * (cost[best - 1] - cost[best + 1]) / bend : 0;
    return 0.5 * (best - most + off);
}

/* Shifts where they are not known, by linear interpolation between the nearest known ones. */
static void txi_register_fill(float *shift, const uint8_t *known, int count) {
    int before = -1;
    for (int i = 0; i <= count; i++) {
        if (i < count && !known[i]) continue;
        for (int k = before + 1; k < i; k++) {
            if (before < 0 && i == count) shift[k] = 0;
            else if (before < 0) shift[k] = shift[i];
            else if (i == count) shift[k] = shift[before];
            else
                shift[k] = txm_lerpf(shift[before], shift[i],
                                     (float)(k - before) / (float)(i - before));
        }
        before = i;
    }
}

/* Move the columns of a single line across it, so that its known part looks alike everywhere: each
   column is registered against the mean profile. Missing columns are moved as those at their
   ends. */
static txm_status txi_ribbon_register(const txi_window *w, txi_ribbon *r, txm_arena *scratch,
                                      txm_env *env) {
    enum { SIZE = 3 * TXI_REGISTER_TAPS };
    const int count = r->count;
    float *profiles = (float *)txm_arena_alloc(scratch, (size_t)count, SIZE * sizeof *profiles);
    float *shift = (float *)txm_arena_alloc(scratch, 2 * (size_t)count, sizeof *shift);
    uint8_t *known = (uint8_t *)txm_arena_alloc(scratch, (size_t)count, 1);
    if (scratch->failed) return txi_no_memory(env);
    for (int round = 0; round < 2; round++) {
        double mean[SIZE] = {0}, sum = 0;
        int n = 0;
        for (int i = 0; i < count; i++) {
            known[i] = (uint8_t)txi_register_profile(w, r, i, profiles + (size_t)i * SIZE);
            for (int k = 0; k < SIZE && known[i]; k++)
                mean[k] += (double)profiles[(size_t)i * SIZE + (size_t)k];
            n += known[i];
        }
        if (n < 8) return TXM_OK;
        for (int k = 0; k < SIZE; k++) mean[k] /= n;
        for (int i = 0; i < count; i++) {
            double profile[SIZE] = {0};
            int m = 0;
            shift[i] = 0;
            for (int j = i > 4 ? i - 4 : 0; j <= i + 4 && j < count && known[i]; j++) {
                for (int k = 0; k < SIZE && known[j]; k++)
                    profile[k] += (double)profiles[(size_t)j * SIZE + (size_t)k];
                m += known[j];
            }
            for (int k = 0; k < SIZE && m; k++) profile[k] /= m;
            if (m) shift[i] = txm_float(txi_register_shift(mean, profile));
            sum += (double)shift[i];
        }
        for (int i = 0; i < count; i++)
            if (known[i]) shift[i] = txm_float((double)shift[i] - sum / n);
        txi_register_fill(shift, known, count);
        for (int i = 0; i < count; i++) {
            const txm_vec2 across = txi_normal_of(r->along[i]);
            const double s = txi_running_mean(shift, count, 1, i, 4);
            r->place[i].x = txm_float((double)r->place[i].x + s * (double)across.x);
            r->place[i].y = txm_float((double)r->place[i].y + s * (double)across.y);
        }
    }
    return TXM_OK;
}

/* Keep the columns lo .. hi - 1 only. */
static void txi_ribbon_crop(txi_ribbon *r, int lo, int hi) {
    r->place += lo;
    r->along += lo;
    r->half += lo;
    r->count = hi - lo;
}

/* Make a stroke of columns lo..hi - 1 of a line, its other side `width` to the right, or all to the
   left; the other columns are cropped. 0: it would be narrower than a pixel or wider than
   TXI_STRIP_INSIDE. */
static int txi_ribbon_widen_by(txi_ribbon *r, int lo, int hi, const float *width) {
    const double sign = width[lo] > 0 ? 1 : -1;
    for (int i = lo; i < hi; i++) {
        const double d = sign * (double)width[i];
        if (!(d >= 1 && d <= (double)TXI_STRIP_INSIDE)) return 0;
    }
    for (int i = lo; i < hi; i++) {
        const txm_vec2 n = txi_normal_of(r->along[i]);
        const double half = 0.5 * txi_running_mean(width + lo, hi - lo, 1, i - lo, 4);
        r->place[i].x = txm_float((double)r->place[i].x + half * (double)n.x);
        r->place[i].y = txm_float((double)r->place[i].y + half * (double)n.y);
        r->half[i] = txm_float(half < 0 ? -half : half);
    }
    txi_ribbon_crop(r, lo, hi);
    return 1;
}

/* Widen a line to the stroke between it and its partner, where both run along each other. 0: they
   do not, within TXI_STRIP_INSIDE pixels, from column `first` to `last`; the line is then
   unchanged.
   width  room for a float per column                                                            */
static int txi_ribbon_widen(txi_ribbon *r, const txi_ribbon *partner, int first, int last,
                            float *width) {
    int lo = 0, hi = r->count;
    for (int i = 0; i < r->count; i++) {
        const txm_vec2 t = r->along[i], p = r->place[i];
        double best = 1e30, x = 0, y = 0;
        for (int k = 0; k < partner->count; k++) {
            const double d = txi_distance(partner->place[k], p);
            if (d >= best) continue;
            best = d;
            x = (double)partner->place[k].x - p.x;
            y = (double)partner->place[k].y - p.y;
        }
        const double ahead = x * t.x + y * t.y;
        width[i] = txm_float(y * t.x - x * t.y);
        if (ahead > 2 || ahead < -2) { /* the partner has no column beside this one */
            if (i <= first) lo = i + 1;
            else if (i < hi) hi = i;
        }
    }
    if (lo > first || hi <= last || hi - lo < 2) return 0;
    return txi_ribbon_widen_by(r, lo, hi, width);
}

/* The same for a partner that is the line itself, moved sideways: the points of both are paired. */
static int txi_ribbon_widen_even(txi_ribbon *r, const txm_vec2 *points, const txm_vec2 *moved,
                                 float *width) {
    for (int i = 0; i < r->count; i++) {
        const txm_vec2 t = r->along[i];
        const double x = (double)moved[i].x - points[i].x, y = (double)moved[i].y - points[i].y;
        width[i] = txm_float(y * (double)t.x - x * (double)t.y);
    }
    return txi_ribbon_widen_by(r, 0, r->count, width);
}

/* ---- the strip's own columns ---- */

/* Sample the columns of a strip: colours, what is known, and which columns touch the hole. */
static txm_status txi_strip_sample(const txi_window *w, txi_strip *s, txm_arena *arena,
                                   txm_env *env) {
    const size_t cells = (size_t)s->line.count * (size_t)s->rows;
    s->color = (uint8_t *)txm_arena_alloc(arena, cells, 3);
    s->known = (uint8_t *)txm_arena_alloc(arena, cells, 1);
    if (arena->failed) return txi_no_memory(env);
    s->first = s->line.count;
    s->last = -1;
    for (int i = 0; i < s->line.count; i++) {
        const txm_vec2 n = txi_normal_of(s->line.along[i]), p = s->line.place[i];
        int touches = 0;
        for (int j = 0; j < s->rows; j++) {
            const double t = txi_row_offset(j, s->inside, (double)s->line.half[i]);
            const double x = (double)p.x + t * (double)n.x, y = (double)p.y + t * (double)n.y;
            const size_t at = (size_t)i * (size_t)s->rows + (size_t)j;
            const ptrdiff_t pixel = txi_pixel(w->width, w->height, x, y);
            int rgb[3];
            s->known[at] = txi_strip_pixel(w, x, y, rgb) != 0;
            for (int c = 0; c < 3; c++) s->color[3 * at + (size_t)c] = (uint8_t)rgb[c];
            touches |= pixel >= 0 && w->state[pixel] == TXI_HOLE;
        }
        if (touches && s->first > i) s->first = i;
        if (touches) s->last = i;
    }
    return TXM_OK;
}

/* ---- sources ---- */

/* The column of a source at which a target's column is laid; c may have a fraction. */
static txi_column txi_column_at(const txi_strip *s, int column, double offset) {
    txi_column a = s->sources[column];
    int whole = (int)(offset + 1024) - 1024;
    if (whole > a.after) whole = a.after;
    if (whole < -a.before) whole = -a.before;
    a = s->sources[column + whole];
    const double rest = offset - whole;
    a.place.x = txm_float((double)a.place.x + rest * (double)a.along.x);
    a.place.y = txm_float((double)a.place.y + rest * (double)a.along.y);
    return a;
}

/* Where row offset t of a source's column lies. */
static txm_vec2 txi_column_place(const txi_column *a, double t) {
    const double u = t * (double)a->side;
    return txm_v2(txm_float((double)a->place.x - u * (double)a->along.y),
                  txm_float((double)a->place.y + u * (double)a->along.x));
}

/* Add columns from..to of a line to a strip's sources: forwards, or backwards (turned by half a
   turn), or mirrored (backwards, but with the rows as they are). */
static void txi_columns_add(txi_strip *s, const txi_ribbon *r, int from, int to, int backwards,
                           int mirrored) {
    const int room = s->room - s->source_count;
    const int count = to - from + 1 < room ? to - from + 1 : room;
    for (int k = 0; k < count; k++) {
        const int i = backwards || mirrored ? to - k : from + k;
        txi_column *a = &s->sources[s->source_count + k];
        a->place = r->place[i];
        a->along = r->along[i];
        if (backwards || mirrored) a->along = txm_v2(-a->along.x, -a->along.y);
        a->half = r->half[i];
        a->side = mirrored ? -1 : 1;
        a->run = s->source_count;
    }
    s->source_count += count > 0 ? count : 0;
}

/* Add the strip's own known columns: on each side of the hole at most room / 2, those next to it.
   Returns how many. */
static int txi_columns_own(txi_strip *s, int mirrored) {
    const int most = s->room / 2, before = s->source_count;
    const int from = s->first > most ? s->first - most : 0;
    const int to = s->line.count - 1 - s->last > most ? s->last + most : s->line.count - 1;
    if (s->first > 0) txi_columns_add(s, &s->line, from, s->first - 1, 0, mirrored);
    if (to > s->last && !s->tail) txi_columns_add(s, &s->line, s->last + 1, to, 0, mirrored);
    return s->source_count - before;
}

/* The weight of a row's colours in costs, in quarters: rows far from the lines count less, those
   beside a bare stroke hardly or not. */
static int txi_row_weight(const txi_strip *s, int j) {
    const int k = j - TXI_STRIP_MARGIN, out = k < 0 ? -k : k > s->inside ? k - s->inside : 0;
    if (s->is_bare) return out == 0 ? 4 : out == 1;
    return out <= 3 ? 4 : out <= 6 ? 3 : 2;
}

/* How far a colour is from the usual one of a row, levels. */
static double txi_typical_distance(const txi_strip *s, int j, const uint8_t *color) {
    int sum = 0;
    for (int c = 0; c < 3; c++) {
        const int d = color[c] - s->typical[3 * j + c];
        sum += d * d;
    }
    return sqrt(sum / 3.0);
}

/* How many rows of a column, from the edge or `beside` rows beside it, do not show the bare stroke,
   but something that covers it or lies beside it. */
static int txi_column_other(const txi_strip *s, const uint8_t *color, int beside) {
    int other = 0;
    for (int j = TXI_STRIP_MARGIN - beside; j <= TXI_STRIP_MARGIN + s->inside + beside; j++)
        other += txi_typical_distance(s, j, color + 3 * j) > (double)s->tolerance;
    return other;
}

/* Of the usable source columns of a bare stroke only those stay that show it: edges and all, if
   there are enough of them. */
static void txi_columns_bare(txi_strip *s) {
    int clean = 0;
    for (int i = 0; i < s->source_count; i++)
        clean += s->sources[i].before == 0 &&
                 !txi_column_other(s, s->source_color + 3 * i * s->rows, 1);
    for (int i = 0; i < s->source_count; i++) {
        const uint8_t *color = s->source_color + 3 * i * s->rows;
        const int other = txi_column_other(s, color, clean >= TXI_STRIP_CLEAN);
        if (clean >= TXI_STRIP_CLEAN ? other > 0 : 6 * other > s->inside) s->sources[i].before = -1;
    }
}

static void txi_strip_feature(const txi_strip *s, const uint8_t *color, int16_t *feature) {
    for (int j = 0; j < s->rows; j++)
        for (int c = 0; c < 3; c++)
            feature[3 * j + c] = (int16_t)(color[3 * j + c] * txi_row_weight(s, j) / 4);
}

/* Colours and features of the sources. Where a row is not known the nearest known one towards the
   line counts. A column whose middle is not known, or less than two thirds, breaks its run. */
static txm_status txi_columns_sample(const txi_window *w, txi_strip *s, txm_arena *arena,
                                    txm_env *env) {
    const size_t rows = (size_t)s->rows, count = (size_t)s->source_count;
    const int low = TXI_STRIP_MARGIN, high = TXI_STRIP_MARGIN + s->inside,
              beside = s->is_bare ? 1 : 2;
    s->features = (3 * s->rows + 15) / 16 * 16;
    s->source_color = (uint8_t *)txm_arena_alloc(arena, count * rows, 3);
    s->source_feature =
        (int16_t *)txm_arena_zero(arena, count * (size_t)s->features, sizeof(int16_t));
    if (arena->failed) return txi_no_memory(env);
    for (size_t i = 0; i < count; i++) {
        txi_column *a = &s->sources[i];
        uint8_t *color = s->source_color + 3 * i * rows;
        int known[TXI_STRIP_ROWS] = {0}, n = 0, whole = 1;
        for (int j = 0; j < s->rows; j++) {
            const txm_vec2 p =
                txi_column_place(a, txi_row_offset(j, s->inside, (double)a->half));
            int rgb[3];
            known[j] = txi_strip_pixel(w, (double)p.x, (double)p.y, rgb) == 2;
            n += known[j];
            if (j >= low - beside && j <= high + beside) whole &= known[j];
            for (int c = 0; c < 3; c++) color[3 * j + c] = (uint8_t)rgb[c];
        }
        for (int j = low - 1; j >= 0; j--)
            if (!known[j]) memcpy(color + 3 * j, color + 3 * (j + 1), 3);
        for (int j = high + 1; j < s->rows; j++)
            if (!known[j]) memcpy(color + 3 * j, color + 3 * (j - 1), 3);
        txi_strip_feature(s, color, s->source_feature + i * (size_t)s->features);
        a->before = whole && (s->is_bare || 3 * n >= 2 * s->rows) ? 0 : -1;
    }
    if (s->is_bare) txi_columns_bare(s);
    txi_column *a = s->sources;
    for (int i = 1; i < s->source_count; i++)
        if (a[i].before == 0 && a[i].run == a[i - 1].run) a[i].before = a[i - 1].before + 1;
    for (int i = s->source_count - 1; i >= 0; i--) {
        const int goes_on = i + 1 < s->source_count && a[i].run == a[i + 1].run;
        a[i].after = a[i].before < 0 ? -1 : goes_on ? a[i + 1].after + 1 : 0;
    }
    return TXM_OK;
}

/* Squared distance of two columns of features; mask: all bits set where they count. */
static int32_t txi_feature_ssd(const int16_t *a, const int16_t *b, const int16_t *mask, int count) {
    int32_t sum = 0;
    for (int i = 0; i < count; i += 16) {
        for (int k = 0; k < 16; k++) {
            const int d = (a[i + k] - b[i + k]) & mask[i + k];
            sum += d * d;
        }
    }
    return sum;
}

/* Eq. 4 for all pairs at once. With C(p, q) the squared distance of source columns p and q, a patch
   centred at source column a and the next one, at b, overlap in 2 reach - hop + 1 columns:

       E(a, b) = sum of C(a + k, b - hop + k), k = hop - reach .. reach
               = S(a + hop - reach, b - reach),
       S(p, q) = sum of C(p + m, q + m), m = 0 .. 2 reach - hop

   overlap receives S, by running sums along diagonals.
   values  room for source_count int32                                                           */
static void txi_strip_overlaps(txi_strip *s, const int16_t *mask, int32_t *values) {
    const int n = s->source_count, length = 2 * s->reach - s->hop + 1;
    const size_t width = (size_t)s->features;
    for (int d = 0; d < n; d++) { /* q = p + d */
        int64_t sum = 0;
        for (int p = 0; p + d < n; p++) {
            values[p] = d ? txi_feature_ssd(s->source_feature + (size_t)p * width,
                                            s->source_feature + (size_t)(p + d) * width, mask,
                                            s->features)
                          : 0;
            sum += values[p];
            if (p >= length) sum -= values[p - length];
            const int from = p - length + 1;
            if (from < 0) continue;
            const int32_t cost = (int32_t)(sum < TXI_COST_MOST ? sum : (int64_t)TXI_COST_MOST);
            s->overlap[(size_t)from * (size_t)n + (size_t)(from + d)] = cost;
            s->overlap[(size_t)(from + d) * (size_t)n + (size_t)from] = cost;
        }
    }
}

/* Which source columns can be centres of patches; reach and hop as the longest run allows. */
static void txi_strip_labels(txi_strip *s) {
    int longest = 0;
    for (int i = 0; i < s->source_count; i++) {
        const int run = s->sources[i].before + s->sources[i].after + 1;
        longest = run > longest ? run : longest;
    }
    s->reach = txm_clampi((longest - 1) / 4, TXI_STRIP_REACH_LEAST, TXI_STRIP_REACH);
    s->hop = s->reach * TXI_STRIP_HOP / TXI_STRIP_REACH;
    s->label_count = 0;
    for (int i = 0; i < s->source_count; i++)
        if (s->sources[i].before >= s->reach && s->sources[i].after >= s->reach)
            s->labels[s->label_count++] = i;
    s->node_count = s->label_count ? (s->last - s->first) / s->hop + 2 : 0;
}

/* Eq. 3: the squared distance of each label of a patch from the colours known in it. */
static void txi_strip_unary(const txi_strip *s, int patch, int16_t *feature, int16_t *mask,
                            int32_t *unary) {
    const int centre = s->first + patch * s->hop, width = s->features;
    for (int i = 0; i < s->label_count; i++) unary[i] = 0;
    for (int k = -s->reach; k <= s->reach; k++) {
        const int column = centre + k;
        int any = 0;
        if (column < 0 || column >= s->line.count) continue;
        const size_t at = (size_t)column * (size_t)s->rows;
        memset(mask, 0, (size_t)width * sizeof *mask);
        for (int j = 0; j < s->rows; j++) {
            if (!s->known[at + (size_t)j]) continue;
            any = 1;
            for (int c = 0; c < 3; c++) mask[3 * j + c] = -1;
        }
        if (!any) continue;
        memset(feature, 0, (size_t)width * sizeof *feature);
        txi_strip_feature(s, s->color + 3 * at, feature);
        for (int i = 0; i < s->label_count; i++) {
            const int64_t sum =
                (int64_t)unary[i] +
                txi_feature_ssd(feature,
                                s->source_feature + (size_t)(s->labels[i] + k) * (size_t)width,
                                mask, width);
            unary[i] = (int32_t)(sum < TXI_COST_MOST ? sum : (int64_t)TXI_COST_MOST);
        }
    }
}

/* ---- other lines as sources ---- */

/* Mean squared difference between the mean of a strip's known columns and the profile of an end of
   a line, read from left to right (turned 0) or from right to left. */
static double txi_strip_unlike(const double *mean, const txi_end *e, int turned) {
    double sum = 0;
    for (int t = -5; t <= 5; t++) {
        for (int c = 0; c < 3; c++) {
            const double d = mean[3 * (TXI_STRIP_MARGIN + t) + c] -
                             (double)e->profile[TXI_PROFILE / 2 + (turned ? -2 * t : 2 * t)][c];
            sum += d * d / 33;
        }
    }
    return sum;
}

/* The mean of the strip's own sources, 3 per row. */
static void txi_strip_mean(const txi_strip *s, double *mean) {
    int n = 0;
    for (int j = 0; j < 3 * s->rows; j++) mean[j] = 0;
    for (int i = 0; i < s->source_count; i++) {
        if (s->sources[i].before < 0) continue;
        n++;
        for (int j = 0; j < 3 * s->rows; j++)
            mean[j] += s->source_color[3 * i * s->rows + j];
    }
    for (int j = 0; j < 3 * s->rows && n; j++) mean[j] /= n;
}

/* The ends of other lines whose colours are most like those of a single line, best first, as
   2 * end + turned. Returns how many. */
static int txi_strip_others(const txi_strip *s, const txi_lines *lines, const int own[2],
                            int best[TXI_STRIP_OTHERS]) {
    double mean[3 * TXI_STRIP_ROWS], cost[TXI_STRIP_OTHERS];
    int n = 0;
    txi_strip_mean(s, mean);
    for (int i = 0; i < 2 * lines->end_count; i++) {
        const txi_end *e = &lines->ends[i / 2];
        if (i / 2 == own[0] || i / 2 == own[1] || e->count < 2 * TXI_STRIP_REACH + 1) continue;
        const double unlike = txi_strip_unlike(mean, e, i & 1);
        if (unlike > 15 * 15) continue; /* levels of 8 bits */
        int k = n < TXI_STRIP_OTHERS ? n++ : TXI_STRIP_OTHERS;
        for (; k > 0 && unlike < cost[k - 1]; k--) {
            if (k == TXI_STRIP_OTHERS) continue;
            cost[k] = cost[k - 1];
            best[k] = best[k - 1];
        }
        if (k == TXI_STRIP_OTHERS) continue;
        cost[k] = unlike;
        best[k] = i;
    }
    return n;
}

/* All sources of a strip: its own known columns; where these are few, columns of similar other
   lines, and its own mirrored. */
static txm_status txi_strip_sources(const txi_window *w, const txi_lines *lines,
                                    const txi_curve *curve, txi_strip *s, txm_arena *arena,
                                    txm_env *env) {
    int best[TXI_STRIP_OTHERS], others = 0;
    s->sources = (txi_column *)txm_arena_alloc(arena, (size_t)s->room, sizeof *s->sources);
    s->labels = (int *)txm_arena_alloc(arena, (size_t)s->room, sizeof *s->labels);
    if (arena->failed) return txi_no_memory(env);
    s->source_count = 0;
    const int own = txi_columns_own(s, 0);
    txm_status status = txi_columns_sample(w, s, arena, env);
    if (status != TXM_OK) return status;
    if (s->partner < 0 && lines && own > 0 && own < s->room / 4)
        others = txi_strip_others(s, lines, curve->ends, best);
    for (int k = 0; k < others; k++) {
        const txi_end *e = &lines->ends[best[k] / 2];
        txi_ribbon r;
        status = txi_ribbon_make(lines->points + e->first, e->count, arena, &r, env);
        if (status != TXM_OK) return status;
        /* points run outwards, the profile is that seen on the way inwards */
        txi_columns_add(s, &r, 0, r.count - 1, !(best[k] & 1), 0);
    }
    if (own < s->room / 8) txi_columns_own(s, 1);
    return s->source_count > own ? txi_columns_sample(w, s, arena, env) : TXM_OK;
}

/* ---- profiles ---- */

/* The mean colours of the known columns next to the hole, row by row, on one side of it. Rows of
   which nothing is known are like the next one towards the lines. 0: the rows of the lines are not
   known. */
static int txi_strip_profile_side(const txi_strip *s, int end, float *profile) {
    const int from = end                            ? s->last + 1
                     : s->first > TXI_STRIP_PROFILE ? s->first - TXI_STRIP_PROFILE
                                                    : 0;
    const int behind = end ? from + TXI_STRIP_PROFILE : s->first;
    const int to = behind < s->line.count ? behind : s->line.count;
    const int low = TXI_STRIP_MARGIN, high = TXI_STRIP_MARGIN + s->inside;
    int known[TXI_STRIP_ROWS] = {0};
    for (int j = 0; j < s->rows; j++) {
        int sum[3] = {0, 0, 0};
        known[j] = 0;
        for (int i = from; i < to; i++) {
            const size_t at = (size_t)i * (size_t)s->rows + (size_t)j;
            for (int c = 0; c < 3 && s->known[at]; c++) sum[c] += s->color[3 * at + (size_t)c];
            known[j] += s->known[at];
        }
        for (int c = 0; c < 3 && known[j]; c++)
            profile[3 * j + c] = (float)sum[c] / (float)known[j];
        if (!known[j] && j >= low && j <= high) return 0;
    }
    for (int j = low - 1; j >= 0; j--)
        if (!known[j]) memcpy(profile + 3 * j, profile + 3 * (j + 1), 3 * sizeof *profile);
    for (int j = high + 1; j < s->rows; j++)
        if (!known[j]) memcpy(profile + 3 * j, profile + 3 * (j - 1), 3 * sizeof *profile);
    return 1;
}

/* The profiles on both sides of the hole; where one is missing the other one counts for both. */
static txm_status txi_strip_profile(txi_strip *s, txm_arena *arena, txm_env *env) {
    const size_t half = 3 * (size_t)s->rows;
    float *both = (float *)txm_arena_alloc(arena, half, 2 * sizeof *both);
    if (!both) return txi_no_memory(env);
    const int before = txi_strip_profile_side(s, 0, both);
    const int behind = txi_strip_profile_side(s, 1, both + half);
    if (!before && !behind) return TXM_OK;
    if (!before) memcpy(both, both + half, half * sizeof *both);
    if (!behind) memcpy(both + half, both, half * sizeof *both);
    s->profile = both;
    return TXM_OK;
}

/* The colour at a place of the strip by its profiles, blended along the hole. */
static void txi_strip_profile_at(const txi_strip *s, double column, double row, double rgb[3]) {
    const double along = (column - s->first + 1) / (s->last - s->first + 2);
    const double t = along < 0 ? 0 : along > 1 ? 1 : along;
    const double r = row < 0 ? 0 : row > s->rows - 1 ? s->rows - 1 : row;
    const int j = (int)r < s->rows - 1 ? (int)r : s->rows - 2;
    for (int c = 0; c < 3; c++) {
        const float *p = s->profile + 3 * j + c, *q = p + 3 * s->rows;
        const double before = (double)p[0] + (r - j) * ((double)p[3] - (double)p[0]);
        const double behind = (double)q[0] + (r - j) * ((double)q[3] - (double)q[0]);
        rgb[c] = before + t * (behind - before);
    }
}

/* ---- whole strokes ------------------------------------------------------------------------------
   Where bars cross near the border of the hole, one of them hides an edge of the other, and that
   edge has no end to join. The other edge is enough: it is joined from border to border, and on
   both sides of the hole the bar has the same width and the same colour. So the hidden edge is the
   joined one, moved by the width. Curves that were found for its ends without that knowledge are
   taken away. */

enum {
    TXI_FLANK_KNOWN =
        64,              /* pixels of the known part of a curve that a width is measured on; ours */
    TXI_FLANK_SKIP = 1,  /* pixels next to the hole that are left out                           */
    TXI_FLANK_COLOR = 7, /* of these so many for the colour                                     */
    TXI_FLANK_LEAST = 7, /* so many of them must agree about the width; ours                    */
    TXI_CROSS_STEP = 3,  /* points of a curve from one to the next that is tested for crossings */
    TXI_FLANK_STEPS = 2 * (TXI_STROKE_WIDEST + 2)
};
#define TXI_FLANK_FROM 2.0    /* pixels from the curve at which the colour beside it is taken     */
#define TXI_FLANK_TONE 32.0   /* levels; colours that differ more are never the same one; ours    */
#define TXI_FLANK_CATCH 3.0  /* pixels; ends as near as that to the other edge belong to it; ours */
#define TXI_FLANK_DIFFER \
    0.25 /* share by which the widths on both sides of the hole may differ; ours */

/* What lies beside a curve in its known part on one side of the hole. */
typedef struct txi_flank {
    double width;    /* pixels to the opposite edge; 0: not known                                 */
    double color[3]; /* up to there, RGB                                                          */
} txi_flank;

/* RGB at a distance to the right of point i of a curve; 0: not known. */
static int txi_flank_pixel(const txi_window *w, const txi_curve *c, int i, double away,
                           int rgb[3]) {
    const txm_vec2 t = txi_curve_along(c, i), p = c->points[i];
    return txi_strip_pixel(w, (double)p.x - away * (double)t.y, (double)p.y + away * (double)t.x,
                           rgb);
}

static double txi_flank_distance(const double color[3], const int rgb[3]) {
    const double other[3] = {(double)rgb[0], (double)rgb[1], (double)rgb[2]};
    return txi_end_color_distance(color, other);
}

/* The point of a curve that lies i pixels outwards from one end of the hole; -1: there is none. */
static int txi_flank_point(const txi_curve *c, int end, int i) {
    const int k = end ? c->last + 1 + i : c->first - 1 - i;
    return k >= 0 && k < c->count ? k : -1;
}

/* The median of each channel beside the curve near the hole; side 1 right, -1 left. 0: too little
   is known. */
static int txi_flank_color(const txi_window *w, const txi_curve *c, int end, int side,
                           double color[3]) {
    int n = 0, values[3][TXI_FLANK_COLOR];
    for (int i = TXI_FLANK_SKIP; n < TXI_FLANK_COLOR; i++) {
        const int point = txi_flank_point(c, end, i);
        int rgb[3];
        if (point < 0 || i >= TXI_FLANK_KNOWN) break;
        if (!txi_flank_pixel(w, c, point, TXI_FLANK_FROM * side, rgb)) continue;
        for (int k = 0; k < 3; k++) {
            int at = n; /* insertion sort */
            for (; at > 0 && values[k][at - 1] > rgb[k]; at--) values[k][at] = values[k][at - 1];
            values[k][at] = rgb[k];
        }
        n++;
    }
    const int middle = n / 2;
    for (int k = 0; k < 3 && n; k++) color[k] = values[k][middle];
    return n >= 4;
}

/* How far the colour beside point i reaches: to where half of the step to the next colour is done.
   0: to something that is not known; -1: it is another colour. */
static double txi_flank_width(const txi_window *w, const txi_curve *c, int i, int side,
                              const double color[3], double differs) {
    int rgb[3];
    for (int k = 0; k < TXI_FLANK_STEPS; k++) {
        const double away = TXI_FLANK_FROM + 0.5 * k;
        if (!txi_flank_pixel(w, c, i, away * side, rgb)) return 0;
        if (txi_flank_distance(color, rgb) <= differs) continue;
        if (k == 0) return -1;
        if (!txi_flank_pixel(w, c, i, (away + 1.5) * side, rgb)) return 0;
        const double next = txi_flank_distance(color, rgb);
        for (int m = -1; m < 3; m++) {
            if (!txi_flank_pixel(w, c, i, (away + 0.5 * m) * side, rgb)) return 0;
            if (txi_flank_distance(color, rgb) > 0.5 * next) return away + 0.5 * m - 0.25;
        }
        return away;
    }
    return 0;
}

/* Measure what lies on one side of a curve (1 right, -1 left) at one end of the hole: its colour,
   and how far that reaches by most of the points, as far as the curve has it at its side. 0: not
   even the colour is known. */
static int txi_flank_make(const txi_window *w, const txi_curve *c, int end, int side,
                          txi_flank *f) {
    double widths[TXI_FLANK_KNOWN], across[3];
    int n = 0, most = 0, others = 0;
    f->width = 0;
    if (!txi_flank_color(w, c, end, side, f->color)) return 0;
    if (!txi_flank_color(w, c, end, -side, across)) return 0;
    const double contrast = txi_end_color_distance(f->color, across);
    if (contrast < 8) return 0;
    const double differs = contrast < 2 * TXI_FLANK_TONE ? 0.5 * contrast : TXI_FLANK_TONE;
    for (int i = TXI_FLANK_SKIP; i < TXI_FLANK_KNOWN && others < 4; i++) {
        const int point = txi_flank_point(c, end, i);
        if (point < 0) break;
        const double width = txi_flank_width(w, c, point, side, f->color, differs);
        TXM_ASSERT(n < TXI_FLANK_KNOWN);
        if (width > 0) widths[n++] = width;
        others = width < 0 ? others + 1 : 0;
    }
    for (int i = 0; i < n; i++) {
        double sum = 0;
        int agree = 0;
        for (int k = 0; k < n; k++) {
            if (fabs(widths[k] - widths[i]) > 0.06 * widths[i] + 0.75) continue;
            sum += widths[k];
            agree++;
        }
        if (agree <= most) continue;
        most = agree;
        f->width = sum / agree;
    }
    if (most < TXI_FLANK_LEAST || 5 * most < 3 * n || f->width > (double)TXI_STROKE_WIDEST)
        f->width = 0;
    return 1;
}

/* The other edge of a stroke of which c is one: its points moved by the width, which changes evenly
   from one side of the hole to the other. */
static txm_status txi_other_edge(const txi_window *w, const txi_curve *c, const txi_flank f[2],
                                 int side, txm_arena *arena, txm_env *env, txi_curve *other) {
    *other = *c;
    other->points = (txm_vec2 *)txm_arena_alloc(arena, (size_t)c->count, sizeof *other->points);
    if (!other->points) return txi_no_memory(env);
    other->first = other->last = -1;
    for (int i = 0; i < c->count; i++) {
        const double part = (double)(i - c->first) / (c->last - c->first);
        const double t = part < 0 ? 0 : part > 1 ? 1 : part;
        const double away = side * (f[0].width + t * (f[1].width - f[0].width));
        const txm_vec2 along = txi_curve_along(c, i), p = c->points[i];
        const double x = (double)p.x - away * (double)along.y,
                     y = (double)p.y + away * (double)along.x;
        const ptrdiff_t at = txi_pixel(w->width, w->height, x, y);
        other->points[i] = txm_v2(txm_float(x), txm_float(y));
        if (at < 0 || w->state[at] != TXI_HOLE) continue;
        if (other->first < 0) other->first = i;
        other->last = i;
    }
    return TXM_OK;
}

/* Does an end lie on a curve? 1: at its front, 2: at its back, 0: not. */
static int txi_end_on_curve(const txi_end *e, const txi_curve *c) {
    double best = TXI_FLANK_CATCH * TXI_FLANK_CATCH;
    int found = 0;
    for (int i = 0; i < c->count; i++) {
        const double x = (double)e->place.x - c->points[i].x,
                     y = (double)e->place.y - c->points[i].y;
        const txm_vec2 t = txi_curve_along(c, i);
        const double dot = (double)t.x * e->heading.x + (double)t.y * e->heading.y;
        if (x * x + y * y > best || (dot < 0.85 && dot > -0.85)) continue;
        best = x * x + y * y;
        found = dot > 0 ? 1 : 2;
    }
    return found;
}

/* Which curves give way to a new edge: those of its ends. Marks them in gone; 0: one of them is
   surer than the new one, or none of them was seen to go on behind the hole without an end
   there. */
static int txi_edge_replaces(const txi_lines *l, const txi_curve *curves, int count, int from,
                             const int *partners, txi_curve *edge, uint8_t *gone) {
    int found[2] = {-1, -1}, hidden = 0;
    for (int i = 0; i < l->end_count; i++) {
        const int on = txi_end_on_curve(&l->ends[i], edge);
        if (!on || i == curves[from].ends[0] || i == curves[from].ends[1]) continue;
        if (found[on - 1] < 0 || l->ends[i].length > l->ends[found[on - 1]].length)
            found[on - 1] = i;
    }
    if (found[0] < 0 && found[1] < 0) return 0;
    for (int k = 0; k < count; k++) {
        gone[k] = 0;
        for (int s = 0; s < 4; s++) {
            const int e = found[s / 2];
            if (e < 0 || curves[k].ends[s % 2] != e || k == from) continue;
            if (partners[k] >= 0) return 0;
            if (curves[k].ends[1] >= 0 && curves[k].cost < curves[from].cost) return 0;
            gone[k] = 1;
            hidden |= curves[k].ends[1] < 0;
        }
    }
    if (!hidden) return 0;
    edge->ends[0] = found[0] >= 0 ? found[0] : found[1];
    edge->ends[1] = found[0] >= 0 ? found[1] : -1;
    return 1;
}

/* What lies on one side of a curve at both ends of the hole. 0: it is not the same, or its width is
   not known. A width that is known at one end only counts for both. */
static int txi_stroke_flanks(const txi_window *w, const txi_curve *c, int side, txi_flank f[2]) {
    if (!txi_flank_make(w, c, 0, side, &f[0]) || !txi_flank_make(w, c, 1, side, &f[1])) return 0;
    if (f[0].width <= 0) f[0].width = f[1].width;
    if (f[1].width <= 0) f[1].width = f[0].width;
    if (f[0].width <= 0) return 0;
    const double mean = 0.5 * (f[0].width + f[1].width);
    if (fabs(f[0].width - f[1].width) > TXI_FLANK_DIFFER * mean) return 0;
    return txi_end_color_distance(f[0].color, f[1].color) <= 0.25 * (double)c->strength + 4;
}

/* Make a whole stroke of curve i, if it is one edge of it; *edge receives the other one. 0: it is
   not. */
static int txi_whole_stroke(const txi_window *w, const txi_lines *l, const txi_curve *curves,
                            int count, int i, const int *partners, txm_arena *arena, txm_env *env,
                            uint8_t *gone, txi_curve *edge, txm_status *status) {
    const txi_curve *c = &curves[i];
    txi_flank f[2][2]; /* left and right, both ends */
    int usable[2];
    for (int k = 0; k < 2; k++) usable[k] = txi_stroke_flanks(w, c, k ? 1 : -1, f[k]);
    const int first =
        usable[1] && (!usable[0] || f[1][0].width < f[0][0].width); /* the narrower one */
    for (int n = 0; n < 2; n++) {
        const int k = n ? !first : first;
        if (!usable[k]) continue;
        *status = txi_other_edge(w, c, f[k], k ? 1 : -1, arena, env, edge);
        if (*status != TXM_OK) return 0;
        if (edge->first >= 0 && txi_edge_replaces(l, curves, count, i, partners, edge, gone))
            return 1;
    }
    return 0;
}

/* Does curve i cross another one in the hole? Only then an edge can be hidden by a stroke. */
static int txi_curve_crosses(const txi_curve *curves, int count, int i) {
    const txi_curve *a = &curves[i];
    for (int k = 0; k < count; k++) {
        const txi_curve *b = &curves[k];
        if (k == i || b->count < 2) continue;
        for (int m = a->first; m + TXI_CROSS_STEP <= a->last; m += TXI_CROSS_STEP) {
            for (int n = b->first; n + TXI_CROSS_STEP <= b->last; n += TXI_CROSS_STEP) {
                if (txi_segments_cross(a->points[m], a->points[m + TXI_CROSS_STEP], b->points[n],
                                       b->points[n + TXI_CROSS_STEP]))
                    return 1;
            }
        }
    }
    return 0;
}

/* Complete strokes of which only one edge was joined.

   curves  *count curves in the arena, replaced by an array with the new edges, which are partners
   of the
           joined ones; curves that were found for their ends are gone
   cost    O(curves * ends * points)                                                            */
static txm_status txi_whole_strokes(const txi_window *w, const txi_lines *l, txm_arena *arena,
                                    txm_env *env, txi_curve **curves, int *count) {
    const int most = 2 * *count;
    int n = *count, kept = 0;
    txm_arena scratch;
    txm_status status = TXM_OK;
    if (n == 0) return TXM_OK;
    txm_arena_init(&scratch, env);
    txi_curve *c = (txi_curve *)txm_arena_alloc(arena, (size_t)most, sizeof *c);
    int *partners = (int *)txm_arena_alloc(&scratch, (size_t)most, sizeof *partners);
    int *place = (int *)txm_arena_alloc(&scratch, (size_t)most, sizeof *place);
    uint8_t *done = (uint8_t *)txm_arena_zero(&scratch, (size_t)most, 2);
    float *widths = (float *)txm_arena_alloc(&scratch, (size_t)n, (size_t)n * sizeof *widths);
    if (scratch.failed || arena->failed) status = txi_no_memory(env);
    if (status == TXM_OK) {
        memcpy(c, *curves, (size_t)n * sizeof *c);
        txi_find_strokes(w, c, n, partners, widths);
    }
    for (int round = 0; round < *count && status == TXM_OK; round++) {
        uint8_t *gone = done + most;
        int i = -1;
        for (int k = 0; k < *count; k++) {
            if (done[k] || partners[k] >= 0 || c[k].ends[1] < 0 || c[k].last <= c[k].first)
                continue;
            if (i < 0 || c[k].cost < c[i].cost) i = k;
        }
        if (i < 0) break;
        done[i] = 1;
        if (!txi_curve_crosses(c, n, i)) continue;
        if (!txi_whole_stroke(w, l, c, n, i, partners, arena, env, gone, &c[n], &status)) continue;
        for (int k = 0; k < n; k++) {
            if (!gone[k]) continue;
            c[k].count = 0;
            c[k].ends[0] = c[k].ends[1] = -1;
            done[k] = 1;
        }
        c[n].partner = partners[n] = i;
        c[i].partner = partners[i] = n;
        n++;
        if (txm_progress(env, 0, "lines")) status = txi_stopped(env);
    }
    for (int k = 0; k < n && status == TXM_OK; k++) place[k] = c[k].count ? kept++ : -1;
    for (int k = 0; k < n && status == TXM_OK; k++) {
        if (place[k] < 0) continue;
        c[place[k]] = c[k];
        if (c[k].partner >= 0) c[place[k]].partner = place[c[k].partner];
    }
    txm_arena_free(&scratch);
    if (status != TXM_OK) return status;
    *curves = c;
    *count = kept;
    return TXM_OK;
}

/* ---- strokes that cross -------------------------------------------------------------------------
   Where two strokes cross in the hole one covers the other, and what lies beside one of them is not
   its own. Such strokes are laid bare: as wide as they are and not with their surroundings. Which
   is on top is seen where they cross in the known part, near the hole; where they do not, the
   narrower and stronger one is: in pictures thin things lie before thick ones more often than
   behind them. */

enum {
    TXI_COVER_COLUMNS = 28, /* known columns on each side of the hole that are looked at; ours    */
    TXI_COVER_TONE = 32,  /* levels; colours that differ more are never those of one stroke; ours */
    TXI_COVER_BEYOND = 3,   /* pixels that a stroke reaches beyond its last column                */
    TXI_COVER_VOTES = 6     /* places of a known crossing that decide about it; ours              */
};

/* How far four of five colours inside of a stroke are from the usual ones at most, in columns
   from..to; texture, or something that covers it. 255: nothing is known. */
static int txi_cover_spread(const txi_strip *s, int from, int to) {
    int counts[256] = {0}, n = 0, value = 0;
    for (int i = from; i <= to; i++) {
        for (int j = TXI_STRIP_MARGIN + 1; j < TXI_STRIP_MARGIN + s->inside; j++) {
            const size_t at = (size_t)i * (size_t)s->rows + (size_t)j;
            if (!s->known[at]) continue;
            counts[txm_clampi((int)txi_typical_distance(s, j, s->color + 3 * at), 0, 255)]++;
            n++;
        }
    }
    if (n == 0) return 255;
    for (int sum = counts[0]; 5 * sum < 4 * n && value < 255; sum += counts[value]) value++;
    return value;
}

/* The usual colour of each row of a stroke: the median of its known columns near the hole. */
static txm_status txi_cover_typical(txi_strip *s, const txi_curve *curve, txm_arena *arena,
                                    txm_env *env) {
    const int from = s->first > TXI_COVER_COLUMNS ? s->first - TXI_COVER_COLUMNS : 0;
    const int behind = s->tail ? s->last : s->last + TXI_COVER_COLUMNS;
    const int to = behind < s->line.count - 1 ? behind : s->line.count - 1;
    s->typical = (uint8_t *)txm_arena_zero(arena, (size_t)s->rows, 3);
    if (!s->typical) return txi_no_memory(env);
    for (int k = 0; k < 3 * s->rows; k++) {
        int counts[256] = {0}, n = 0, value = 0;
        for (int i = from; i <= to; i++) {
            const size_t at = (size_t)i * (size_t)s->rows + (size_t)(k / 3);
            if ((i >= s->first && i <= s->last) || !s->known[at]) continue;
            counts[s->color[3 * at + (size_t)(k % 3)]]++;
            n++;
        }
        for (int sum = counts[0]; 2 * sum < n && value < 255; sum += counts[value]) value++;
        s->typical[k] = (uint8_t)value;
    }
    const int before = txi_cover_spread(s, from, s->first - 1),
              after = txi_cover_spread(s, s->last + 1, to);
    const float spread = 1.25f * (float)(before < after ? before : after);
    s->tolerance =
        txm_maxf(txm_clampf(0.5f * curve->strength, 12, TXI_COVER_TONE), spread < 255 ? spread : 0);
    return TXM_OK;
}

/* Where a place lies in a stroke: its distance from the middle in half widths (1 and more: beside
   it); a large number beyond its ends. */
static double txi_cover_across(const txi_strip *s, double x, double y) {
    double best = 1e30;
    int column = 0;
    for (int i = 0; i < s->line.count; i += 2) {
        const double dx = x - s->line.place[i].x, dy = y - s->line.place[i].y;
        if (dx * dx + dy * dy >= best) continue;
        best = dx * dx + dy * dy;
        column = i;
    }
    const txm_vec2 t = s->line.along[column], p = s->line.place[column];
    const double dx = x - p.x, dy = y - p.y, half = s->line.half[column];
    const double ahead = dx * t.x + dy * t.y, across = dy * t.x - dx * t.y;
    if (fabs(ahead) > (double)TXI_COVER_BEYOND || half <= 0) return 1e9;
    return (across < 0 ? -across : across) / half;
}

/* The box of a strip's columns and the width of its stroke: x0, y0, x1, y1, window pixels. */
static void txi_cover_box(const txi_strip *s, double box[4]) {
    box[0] = box[1] = 1e30;
    box[2] = box[3] = -1e30;
    for (int i = 0; i < s->line.count; i++) {
        const double x = s->line.place[i].x, y = s->line.place[i].y, half = s->line.half[i];
        box[0] = fmin(box[0], x - half);
        box[1] = fmin(box[1], y - half);
        box[2] = fmax(box[2], x + half);
        box[3] = fmax(box[3], y + half);
    }
}

/* Can two strokes cross: are their boxes no farther apart than a stroke reaches beyond its ends? */
static int txi_cover_near(const txi_strip *a, const txi_strip *b) {
    double p[4], q[4];
    const double reach = TXI_COVER_BEYOND;
    txi_cover_box(a, p);
    txi_cover_box(b, q);
    return p[0] <= q[2] + reach && q[0] <= p[2] + reach && p[1] <= q[3] + reach &&
           q[1] <= p[3] + reach;
}

/* How many places in the known part, near the hole, where a and b cross show the colour of a, less
   those that show the colour of b. *inside: how many lie in both in the hole. */
static int txi_cover_votes(const txi_window *w, const txi_strip *a, const txi_strip *b,
                           int *inside) {
    const int middle = TXI_STRIP_MARGIN + a->inside / 2, other = TXI_STRIP_MARGIN + b->inside / 2;
    int votes = 0;
    *inside = 0;
    for (int i = a->first - TXI_COVER_COLUMNS; i <= a->last + TXI_COVER_COLUMNS; i++) {
        if (i < 0 || i >= a->line.count) continue;
        const txm_vec2 n = txi_normal_of(a->line.along[i]), p = a->line.place[i];
        for (int k = -2; k <= 2; k++) {
            const double away = 0.4 * k * (double)a->line.half[i];
            const double x = (double)p.x + away * (double)n.x, y = (double)p.y + away * (double)n.y;
            const ptrdiff_t at = txi_pixel(w->width, w->height, x, y);
            int rgb[3];
            if (at < 0 || w->state[at] == TXI_VOID || txi_cover_across(b, x, y) > 0.8) continue;
            if (w->state[at] == TXI_HOLE) ++*inside;
            if (!txi_strip_pixel(w, x, y, rgb)) continue;
            double of_a = 0, of_b = 0;
            for (int c = 0; c < 3; c++) {
                const double u = rgb[c] - a->typical[3 * middle + c],
                             v = rgb[c] - b->typical[3 * other + c];
                of_a += u * u / 3;
                of_b += v * v / 3;
            }
            if (of_a < of_b && of_a < (double)(a->tolerance * a->tolerance)) votes++;
            if (of_b < of_a && of_b < (double)(b->tolerance * b->tolerance)) votes--;
        }
    }
    return votes;
}

/* Is a row of a bare stroke part of it? One row beside it is, too. */
static int txi_cover_row(const txi_strip *s, int j) {
    return j >= TXI_STRIP_MARGIN - 1 && j <= TXI_STRIP_MARGIN + s->inside + 1;
}

/* A stroke that crosses others: only what has its usual colours counts as known. */
static void txi_cover_bare(txi_strip *s) {
    s->is_bare = 1;
    for (int i = 0; i < s->line.count; i++) {
        for (int j = 0; j < s->rows; j++) {
            const size_t at = (size_t)i * (size_t)s->rows + (size_t)j;
            if (!txi_cover_row(s, j) ||
                txi_typical_distance(s, j, s->color + 3 * at) > (double)s->tolerance)
                s->known[at] = 0;
        }
    }
}

/* Find the strokes that cross in the hole, and what covers what.
   above  count^2: 1 where stroke i lies on stroke j, seen in the known part
   cost   O(strokes^2 * points^2), of those whose boxes overlap                                 */
static txm_status txi_cover_find(const txi_window *w, txi_strip *strips, const txi_curve *curves,
                                 int count, uint8_t *above, txm_arena *arena, txm_env *env) {
    for (int i = 0; i < count; i++) {
        if (strips[i].partner < 0) continue;
        const txm_status status =
            txi_cover_typical(&strips[i], &curves[strips[i].curve], arena, env);
        if (status != TXM_OK) return status;
    }
    for (int i = 0; i < count; i++) {
        for (int j = i + 1; j < count; j++) {
            int inside;
            if (strips[i].partner < 0 || strips[j].partner < 0) continue;
            if (!txi_cover_near(&strips[i], &strips[j])) continue;
            const int votes = txi_cover_votes(w, &strips[i], &strips[j], &inside);
            if (inside < 3) continue;
            strips[i].is_bare = strips[j].is_bare = 1;
            above[i * count + j] = votes >= TXI_COVER_VOTES;
            above[j * count + i] = votes <= -TXI_COVER_VOTES;
        }
        if (txm_progress(env, 0, "strips")) return txi_stopped(env);
    }
    for (int i = 0; i < count; i++)
        if (strips[i].is_bare) txi_cover_bare(&strips[i]);
    return TXM_OK;
}

/* ---- the graph of all patches -------------------------------------------------------------------
   The patches of a strip are a chain. Where strips meet or cross, patches of one are linked with
   those of the other. */

enum {
    TXI_MEETING_SAMPLES = 32, /* most places that two patches are compared at                     */
    TXI_MEETING_STEP = 2,     /* pixels between them                                              */
    TXI_MEETINGS_MOST = 4096
};

/* The strips of a window, and the graph of their patches. */
typedef struct txi_strips {
    const txi_window *w;
    txi_strip *strips;
    int count;
    int *order;        /* strips, the one that is on top first                                    */
    int node_count, link_count;
    int *counts, *ends; /* of the graph                                                          */
    size_t *firsts;
    int32_t *unary;
    int *link_strip;   /* which strip a link belongs to; -1 - k: it is meeting k                  */
    struct txi_meeting *meetings; /* where strips meet                                            */
    int meeting_count;
    uint8_t *late;     /* per link: a meeting                                                     */
    int *labels;       /* per node: the index of the label chosen                                 */
    int *cuts;         /* rows_most per node: the column from which on the next patch counts      */
    float *offsets;    /* 3 * TXI_STRIP_ROWS per node: added to its colours                       */
} txi_strips;

/* Strips of all curves; the sides of a stroke are one. */
static txm_status txi_strips_make(const txi_window *w, const txi_curve *curves, int count,
                                  txi_strips *all, txm_arena *arena, txm_env *env) {
    all->w = w;
    all->strips = (txi_strip *)txm_arena_zero(arena, (size_t)count, sizeof *all->strips);
    all->order = (int *)txm_arena_alloc(arena, (size_t)count, sizeof *all->order);
    txi_ribbon *lines = (txi_ribbon *)txm_arena_zero(arena, (size_t)count, sizeof *lines);
    uint8_t *done = (uint8_t *)txm_arena_zero(arena, (size_t)count, 1);
    int *partners = (int *)txm_arena_alloc(arena, (size_t)count, sizeof *partners);
    int *is_open = (int *)txm_arena_zero(arena, (size_t)count, sizeof *is_open);
    float *widths = (float *)txm_arena_alloc(arena, (size_t)count, (size_t)count * sizeof *widths);
    if (arena->failed) return txi_no_memory(env);
    int most = 1;
    txi_find_strokes(w, curves, count, partners, widths);
    for (int i = 0; i < count; i++) {
        if (curves[i].count < 2) continue;
        const size_t room = (size_t)curves[i].count + TXI_STRIP_ONWARD;
        most = (int)room > most ? (int)room : most;
        txm_vec2 *points = (txm_vec2 *)txm_arena_alloc(arena, room, sizeof *points);
        if (!points) return txi_no_memory(env);
        const int n = txi_curve_onward(w, &curves[i], points, &is_open[i]);
        txm_status status = txi_ribbon_make(points, n, arena, &lines[i], env);
        if (status == TXM_OK) status = txi_ribbon_register(w, &lines[i], arena, env);
        if (status != TXM_OK) return status;
        if (txm_progress(env, 0, "strips")) return txi_stopped(env);
    }
    float *width = (float *)txm_arena_alloc(arena, (size_t)most, sizeof *width);
    if (!width) return txi_no_memory(env);
    for (int i = 0; i < count; i++) {
        const int p = partners[i];
        txi_strip *s = &all->strips[all->count];
        if (done[i] || lines[i].count < 2) continue;
        s->curve = i;
        s->partner = -1;
        s->tail = curves[i].ends[1] < 0;
        s->is_open = is_open[i];
        s->line = lines[i];
        const int even = p >= 0 && curves[i].partner == p && lines[i].count == curves[i].count &&
                         curves[p].count == curves[i].count;
        if (p >= 0 && !done[p] && lines[p].count >= 2 &&
            (even
                 ? txi_ribbon_widen_even(&s->line, curves[i].points, curves[p].points, width)
                 : txi_ribbon_widen(&s->line, &lines[p], curves[i].first, curves[i].last, width))) {
            double sum = 0;
            for (int k = 0; k < s->line.count; k++) sum += 2 * (double)s->line.half[k];
            s->inside = txm_clampi((int)(sum / s->line.count + 0.5), 1, TXI_STRIP_INSIDE);
            s->partner = p;
            done[p] = 1;
        }
        done[i] = 1;
        s->rows = 2 * TXI_STRIP_MARGIN + 1 + s->inside;
        const txm_status status = txi_strip_sample(w, s, arena, env);
        if (status != TXM_OK) return status;
        if (s->last >= 0) all->count++; /* else there is nothing to complete */
        else memset(s, 0, sizeof *s);
    }
    return TXM_OK;
}

/* The order in which strips cover each other, as far as is not seen which lies on top: strokes that
   cross others first, of these the narrower and stronger ones; strokes over single lines, lines
   that go through over those that end in the hole, then the stronger ones. */
static uint32_t txi_strip_rank(const txi_strip *s, const txi_curve *c) {
    const uint32_t strength = (uint32_t)(txm_clampf(c->strength, 0, 1e6f) * 16.0f);
    const uint32_t through = c->ends[0] >= 0 && c->ends[1] >= 0 ? 1u << 28 : 0;
    if (s->is_bare) return (1u << 30) + through + strength / (uint32_t)(s->inside + 1);
    return (s->partner >= 0 ? 1u << 29 : 0) + through + strength;
}

/* The strips from top to bottom. Of those that nothing else that is left lies on (if there is none,
   of all) the one of the highest rank comes next. */
static txm_status txi_strips_order(txi_strips *all, const txi_curve *curves, txm_arena *arena,
                                   txm_env *env) {
    const size_t count = (size_t)all->count;
    uint8_t *above = (uint8_t *)txm_arena_zero(arena, count, count);
    uint8_t *placed = (uint8_t *)txm_arena_zero(arena, count, 1);
    if (arena->failed) return txi_no_memory(env);
    const txm_status status =
        txi_cover_find(all->w, all->strips, curves, all->count, above, arena, env);
    for (int n = 0; n < all->count; n++) {
        int best = -1, best_under = 0;
        uint32_t best_rank = 0;
        for (int i = 0; i < all->count; i++) {
            int under = 0;
            if (placed[i]) continue;
            for (int j = 0; j < all->count; j++)
                under |= !placed[j] && above[(size_t)j * count + (size_t)i];
            const uint32_t rank = txi_strip_rank(&all->strips[i], &curves[all->strips[i].curve]);
            if (best >= 0 && (under > best_under || (under == best_under && rank <= best_rank)))
                continue;
            best = i;
            best_under = under;
            best_rank = rank;
        }
        placed[best] = 1;
        all->order[n] = best;
    }
    return status;
}

/* ---- where strips meet ---- */

/* Two patches of different strips that overlap, and where their colours are compared: near the line
   on which one strip gives way to the other. */
typedef struct txi_meeting {
    int strip[2], patch[2], count;
    int8_t offset[TXI_MEETING_SAMPLES][2];  /* columns from the centre of each patch              */
    uint8_t row[TXI_MEETING_SAMPLES][2];
} txi_meeting;

/* The middle of a patch. */
static txm_vec2 txi_patch_centre(const txi_strip *s, int patch) {
    const int column = s->first + patch * s->hop;
    return s->line.place[column < s->line.count ? column : s->line.count - 1];
}

/* Where a place lies in a patch: column offset and row, and its distance from the stroke. 0:
   outside. */
static int txi_patch_locate(const txi_strip *s, int patch, double x, double y, int *offset,
                            int *row, double *away) {
    const int at = s->first + patch * s->hop;
    const int column = at < s->line.count ? at : s->line.count - 1;
    const txm_vec2 t = s->line.along[column], p = s->line.place[column];
    const double dx = x - (double)p.x, dy = y - (double)p.y, half = s->line.half[column];
    const double ahead = dx * t.x + dy * t.y + (column - at), across = dy * t.x - dx * t.y;
    *away = (across < 0 ? -across : across) - half;
    if (ahead < -s->reach || ahead > s->reach || *away > (double)TXI_STRIP_MARGIN) return 0;
    *offset = (int)(ahead + s->reach + 0.5) - s->reach;
    *row = txm_clampi((int)(txi_offset_row(across, s->inside, half) + 0.5), 0, s->rows - 1);
    return 1;
}

/* Fill in the places at which two patches are compared. */
static void txi_meeting_make(const txi_strips *all, txi_meeting *m) {
    const txi_strip *a = &all->strips[m->strip[0]], *b = &all->strips[m->strip[1]];
    const txm_vec2 p = txi_patch_centre(a, m->patch[0]), q = txi_patch_centre(b, m->patch[1]);
    const double mx = 0.5 * ((double)p.x + q.x), my = 0.5 * ((double)p.y + q.y);
    m->count = 0;
    for (int k = 0; k < 13 * 13 && m->count < TXI_MEETING_SAMPLES; k++) {
        const int right = k % 13 - 6, down = k / 13 - 6;
        const double x = mx + TXI_MEETING_STEP * right, y = my + TXI_MEETING_STEP * down;
        int offset[2], row[2];
        double away[2];
        if (!txi_patch_locate(a, m->patch[0], x, y, &offset[0], &row[0], &away[0]) ||
            !txi_patch_locate(b, m->patch[1], x, y, &offset[1], &row[1], &away[1]))
            continue;
        if (away[0] < 2 || away[1] < 2 || away[0] - away[1] > 3 || away[1] - away[0] > 3) continue;
        for (int e = 0; e < 2; e++) {
            m->offset[m->count][e] = (int8_t)offset[e];
            m->row[m->count][e] = (uint8_t)row[e];
        }
        m->count++;
    }
}

/* Eq. 4 for patches of two strips: squared differences at the places, as if at all pixels. */
static int32_t txi_meeting_cost(const txi_strips *all, const txi_meeting *m, int a, int b) {
    const txi_strip *s = &all->strips[m->strip[0]], *t = &all->strips[m->strip[1]];
    int32_t sum = 0;
    for (int k = 0; k < m->count; k++) {
        const int p = (s->labels[a] + m->offset[k][0]) * s->rows + m->row[k][0];
        const int q = (t->labels[b] + m->offset[k][1]) * t->rows + m->row[k][1];
        const uint8_t *u = s->source_color + 3 * p, *v = t->source_color + 3 * q;
        for (int c = 0; c < 3; c++) sum += (u[c] - v[c]) * (u[c] - v[c]);
    }
    return sum * TXI_MEETING_STEP * TXI_MEETING_STEP / 4; /* rows off the lines count a quarter */
}

/* All pairs of patches of different strips whose centres are close: of each patch the nearest one
   of each other strip. */
static txm_status txi_meetings_find(txi_strips *all, txm_arena *arena, txm_env *env) {
    all->meetings =
        (txi_meeting *)txm_arena_alloc(arena, TXI_MEETINGS_MOST, sizeof *all->meetings);
    if (!all->meetings) return txi_no_memory(env);
    for (int i = 0; i < all->count; i++) {
        const txi_strip *a = &all->strips[i];
        for (int j = i + 1; j < all->count; j++) {
            const txi_strip *b = &all->strips[j];
            for (int k = 0; k < a->node_count; k++) {
                const txm_vec2 p = txi_patch_centre(a, k);
                double least = a->reach + b->reach;
                txi_meeting *m = &all->meetings[all->meeting_count];
                if (all->meeting_count == TXI_MEETINGS_MOST) return TXM_OK;
                m->patch[1] = -1;
                for (int n = 0; n < b->node_count; n++) {
                    const double d = txi_distance(txi_patch_centre(b, n), p);
                    if (d < least) least = d, m->patch[1] = n;
                }
                if (m->patch[1] < 0) continue;
                m->strip[0] = i;
                m->strip[1] = j;
                m->patch[0] = k;
                txi_meeting_make(all, m);
                all->meeting_count += m->count > 0;
            }
        }
        if (txm_progress(env, 0, "strips")) return txi_stopped(env);
    }
    return TXM_OK;
}

/* ---- choosing patches ---- */

static int32_t txi_strips_pair(const void *context, int link, int a, int b) {
    const txi_strips *all = (const txi_strips *)context;
    const int of = all->link_strip[link];
    if (of < 0) return txi_meeting_cost(all, &all->meetings[-1 - of], a, b);
    const txi_strip *s = &all->strips[of];
    const int p = s->labels[a] + s->hop - s->reach, q = s->labels[b] - s->reach;
    return s->overlap[(size_t)p * (size_t)s->source_count + (size_t)q];
}

/* The costs of a strip: the table of overlaps and the unary costs of its patches. */
static void txi_strips_body(void *context, int index) {
    const txi_strips *all = (const txi_strips *)context;
    txi_strip *s = &all->strips[index];
    int16_t feature[TXI_STRIP_FEATURES], mask[TXI_STRIP_FEATURES];
    int32_t values[TXI_STRIP_COLUMNS];
    if (!s->node_count) return;
    for (int i = 0; i < s->features; i++) mask[i] = -1;
    txi_strip_overlaps(s, mask, values);
    for (int k = 0; k < s->node_count; k++)
        txi_strip_unary(s, k, feature, mask, all->unary + all->firsts[s->node + k]);
}

/* The sources of all strips, and the graph of all patches. profiles: there are to be none; strips
   without patches get profiles. */
static txm_status txi_strips_graph(txi_strips *all, int profiles, const txi_lines *lines,
                                   const txi_curve *curves, txm_arena *arena, txm_env *env) {
    size_t labels = 0;
    int room = TXI_STRIP_COLUMNS;
    while (room > TXI_STRIP_COLUMNS_LEAST && room * room > TXI_STRIP_CELLS / (all->count + 1))
        room -= 16;
    for (int i = 0; i < all->count; i++) {
        txi_strip *s = &all->strips[i];
        s->room = room;
        txm_status status =
            profiles ? TXM_OK : txi_strip_sources(all->w, lines, &curves[s->curve], s, arena, env);
        if (status == TXM_OK && !profiles) txi_strip_labels(s);
        if (status == TXM_OK && !s->node_count) status = txi_strip_profile(s, arena, env);
        if (status != TXM_OK) return status;
        s->node = all->node_count;
        all->node_count += s->node_count;
        all->link_count += s->node_count ? s->node_count - 1 : 0;
        labels += (size_t)s->node_count * (size_t)s->label_count;
        if (s->node_count)
            s->overlap = (int32_t *)txm_arena_alloc(arena, (size_t)s->source_count,
                                                    (size_t)s->source_count * sizeof *s->overlap);
        if (txm_progress(env, 0, "strips")) return txi_stopped(env);
    }
    const txm_status status = txi_meetings_find(all, arena, env);
    if (status != TXM_OK) return status;
    all->link_count += all->meeting_count;
    const size_t nodes = (size_t)all->node_count, links = (size_t)all->link_count;
    all->counts = (int *)txm_arena_alloc(arena, nodes + 1, sizeof *all->counts);
    all->firsts = (size_t *)txm_arena_alloc(arena, nodes + 1, sizeof *all->firsts);
    all->unary = (int32_t *)txm_arena_alloc(arena, labels + 1, sizeof *all->unary);
    all->ends = (int *)txm_arena_alloc(arena, links + 1, 2 * sizeof *all->ends);
    all->link_strip = (int *)txm_arena_alloc(arena, links + 1, sizeof *all->link_strip);
    all->late = (uint8_t *)txm_arena_zero(arena, links + 1, 1);
    all->labels = (int *)txm_arena_alloc(arena, nodes + 1, sizeof *all->labels);
    if (arena->failed) return txi_no_memory(env);
    size_t first = 0;
    int link = 0;
    for (int i = 0; i < all->count; i++) {
        const txi_strip *s = &all->strips[i];
        for (int k = 0; k < s->node_count; k++) {
            const int node = s->node + k;
            all->counts[node] = s->label_count;
            all->firsts[node] = first;
            first += (size_t)s->label_count;
            if (k == 0) continue;
            all->ends[2 * link] = node - 1;
            all->ends[2 * link + 1] = node;
            TXM_ASSERT(link < all->link_count);
            all->link_strip[link++] = i;
        }
    }
    for (int k = 0; k < all->meeting_count; k++, link++) {
        const txi_meeting *m = &all->meetings[k];
        for (int e = 0; e < 2; e++)
            all->ends[2 * link + e] = all->strips[m->strip[e]].node + m->patch[e];
        all->link_strip[link] = -1 - k;
        all->late[link] = 1;
    }
    txm_parallel_for(env, all->count, txi_strips_body, all);
    return TXM_OK;
}

static txm_status txi_strips_choose(txi_strips *all, uint64_t seed, txm_arena *arena,
                                    txm_env *env) {
    txi_graph g;
    memset(&g, 0, sizeof g);
    g.node_count = all->node_count;
    g.link_count = all->link_count;
    g.counts = all->counts;
    g.firsts = all->firsts;
    g.unary = all->unary;
    g.ends = all->ends;
    g.late = all->late;
    g.pair = txi_strips_pair;
    g.context = all;
    const txm_status status = txi_belief(&g, TXI_STRIP_KEEP, seed, arena, all->labels, NULL, env);
    for (int i = 0; i < all->count && status == TXM_OK; i++) {
        txi_strip *s = &all->strips[i];
        s->chosen = all->labels + s->node;
        for (int k = 0; k < s->node_count; k++) s->chosen[k] = s->labels[s->chosen[k]];
    }
    return status;
}

/* ---- laying the strips --------------------------------------------------------------------------
   Each hole pixel near a completed line belongs to the strip of the nearest line, or of the topmost
   stroke that it lies in; it is copied from the strip's source columns.                          */

enum {
    TXI_LAY_CORE = 3,        /* pixels from a line within which its strip counts fully            */
    TXI_LAY_FADE = 8,        /* columns before the end of a line that ends in the hole            */
    TXI_LAY_TONE = 24,       /* levels; larger differences are none of tone, and not evened out   */
    TXI_GUIDE_TOP = 100,     /* guide channel on a line                                          */
    TXI_GUIDE_RADIUS = 5,    /* pixels; beyond, the guide channel is 0                            */
    TXI_GUIDE_STEPS = 16     /* of its table per pixel                                            */
};
#define TXI_GUIDE_SIGMA 1.5 /* pixels                                                             */
#define TXI_LAY_BARE 1.0    /* the same for strokes that cross others: pixels from their edge     */
#define TXI_LAY_EDGE 1.5    /* pixels inside of such a stroke that its edge reaches               */
#define TXI_LAY_CLAIM 0.5   /* pixels from a line that belong to its strip in any case            */

/* ---- cuts and colours between patches ---- */

/* Colour of row j of the patch's source, `offset` columns from its centre. */
static const uint8_t *txi_patch_color(const txi_strip *s, int patch, int offset, int j) {
    const int column = s->chosen[patch] + offset;
    return s->source_color + 3 * ((size_t)column * (size_t)s->rows + (size_t)j);
}

/* Where patch k ends and the next one begins, row by row: a minimum-error cut through the columns
   between their centres. */
static void txi_patch_cut(const txi_strip *s, int k, int *cut) {
    float error[TXI_STRIP_ROWS * TXI_STRIP_HOP];
    double scratch[TXI_STRIP_ROWS * TXI_STRIP_HOP];
    const int width = s->hop > 1 ? s->hop - 1 : 1;
    for (int j = 0; j < s->rows; j++) {
        for (int m = 0; m < width; m++) {
            const uint8_t *a = txi_patch_color(s, k, m + 1, j);
            const uint8_t *b = txi_patch_color(s, k + 1, m + 1 - s->hop, j);
            int sum = 0;
            for (int c = 0; c < 3; c++) sum += (a[c] - b[c]) * (a[c] - b[c]);
            error[j * width + m] = (float)sum;
        }
    }
    txm_cut(error, s->rows, width, width, 1, cut, scratch);
    for (int j = 0; j < s->rows; j++) cut[j] += s->first + k * s->hop + 1;
}

/* What the colours of row j of a patch lack: against the known part (from = 0), or of the next
   patch against this one in their overlap (1). Mean RGB differences into d; returns a weight, 0..1:
   the share of the row that is compared, less for differences that are no matter of tone. */
static double txi_row_difference(const txi_strip *s, int k, int j, int from, double d[3]) {
    int sum[3] = {0, 0, 0}, hits = 0;
    for (int m = from ? s->hop - s->reach : -s->reach; m <= s->reach; m++) {
        const int column = s->first + k * s->hop + m;
        const uint8_t *mine = txi_patch_color(s, k, m, j), *other;
        if (from) {
            other = txi_patch_color(s, k + 1, m - s->hop, j);
        } else {
            if (column < 0 || column >= s->line.count) continue;
            const size_t at = (size_t)column * (size_t)s->rows + (size_t)j;
            if (!s->known[at]) continue;
            other = s->color + 3 * at;
        }
        for (int c = 0; c < 3; c++) sum[c] += from ? mine[c] - other[c] : other[c] - mine[c];
        hits++;
    }
    double square = 0;
    for (int c = 0; c < 3; c++) {
        d[c] = hits ? (double)sum[c] / hits : 0;
        square += d[c] * d[c] / 3;
    }
    const int whole = from ? 2 * s->reach - s->hop + 1 : 2 * s->reach + 1;
    const double tone = square / (TXI_LAY_TONE * TXI_LAY_TONE);
    return (double)hits / whole / (1 + tone * tone);
}

/* What is to be added to the colours of row j in each patch, so that patches meet without a step
   and the ends meet the known part: the offsets e minimise

       sum over k of v(k) (e(k+1) - e(k) - d(k))^2 + w(k) (e(k) - g(k))^2 + 0.001 e(k)^2

   d: mean difference of neighbours in their overlap, g: of the known part; v, w: their weights. The
   matrix has three diagonals and is solved by elimination. e: 4 doubles per patch, RGB and a
   factor. */
static void txi_row_offsets(const txi_strip *s, int j, double *e, float *offsets) {
    const int n = s->node_count;
    double before[3] = {0, 0, 0}, v_before = 0;
    for (int k = 0; k < n; k++) {
        double g[3], d[3] = {0, 0, 0}, v = 0;
        const double w = txi_row_difference(s, k, j, 0, g);
        if (k + 1 < n) v = txi_row_difference(s, k, j, 1, d);
        double diagonal = 0.001 + w + v + v_before;
        if (k) diagonal -= v_before * e[4 * (k - 1) + 3]; /* e(k-1) = e[k-1] + factor e(k) */
        for (int c = 0; c < 3; c++) {
            const double earlier = k ? e[4 * (k - 1) + c] : 0;
            e[4 * k + c] =
                (w * g[c] - v * d[c] + v_before * (before[c] + earlier)) / diagonal;
            before[c] = d[c];
        }
        e[4 * k + 3] = v / diagonal;
        v_before = v;
    }
    for (int k = n - 1; k >= 0; k--) {
        for (int c = 0; c < 3; c++) {
            if (k + 1 < n) e[4 * k + c] += e[4 * k + 3] * e[4 * (k + 1) + c];
            offsets[(size_t)k * 3 * TXI_STRIP_ROWS + (size_t)(3 * j + c)] = txm_float(e[4 * k + c]);
        }
    }
}

/* Cuts and offsets of all strips; the offsets are smoothed across the rows. */
static txm_status txi_strips_finish(txi_strips *all, txm_arena *arena, txm_env *env) {
    const size_t nodes = (size_t)all->node_count;
    all->cuts = (int *)txm_arena_zero(arena, nodes + 1, TXI_STRIP_ROWS * sizeof *all->cuts);
    all->offsets =
        (float *)txm_arena_zero(arena, nodes + 1, 3 * TXI_STRIP_ROWS * sizeof *all->offsets);
    double *e = (double *)txm_arena_alloc(arena, nodes + 1, 4 * sizeof *e);
    if (arena->failed) return txi_no_memory(env);
    for (int i = 0; i < all->count; i++) {
        const txi_strip *s = &all->strips[i];
        float *offsets = all->offsets + (size_t)s->node * 3 * TXI_STRIP_ROWS;
        for (int k = 0; k + 1 < s->node_count; k++)
            txi_patch_cut(s, k, all->cuts + (size_t)(s->node + k) * TXI_STRIP_ROWS);
        for (int j = 0; j < s->rows && s->node_count; j++) txi_row_offsets(s, j, e, offsets);
        for (int k = 0; k < s->node_count; k++) {
            float *row = offsets + (size_t)k * 3 * TXI_STRIP_ROWS;
            float smooth[3 * TXI_STRIP_ROWS] = {0};
            for (int j = 0; j < 3 * s->rows; j++)
                smooth[j] = txm_float(txi_running_mean(row + j % 3, s->rows, 3, j / 3, 2));
            memcpy(row, smooth, (size_t)(3 * s->rows) * sizeof *row);
        }
        if (txm_progress(env, 0, "strips")) return txi_stopped(env);
    }
    return TXM_OK;
}

/* ---- pixels ---- */

/* RGB at a place, Catmull-Rom, or bilinear where not all of its 16 pixels may be copied from; 0 if
   not even that is possible. */
static int txi_lay_pixel(const txi_window *w, double x, double y, double rgb[3]) {
    int coarse[3];
    double wx[4], wy[4];
    if (txi_strip_pixel(w, x, y, coarse) != 2) return 0;
    const int bx = (int)floor(x), by = (int)floor(y);
    for (int c = 0; c < 3; c++) rgb[c] = coarse[c];
    if (bx < 1 || by < 1 || bx + 2 >= w->width || by + 2 >= w->height) return 1;
    const size_t corner = (size_t)(by - 1) * (size_t)w->width + (size_t)(bx - 1);
    for (int k = 0; k < 16; k++) {
        if (w->state[corner + (size_t)(k / 4) * (size_t)w->width + (size_t)(k % 4)] != TXI_KNOWN)
            return 1;
    }
    txi_cubic(x - bx, wx);
    txi_cubic(y - by, wy);
    for (int c = 0; c < 3; c++) {
        rgb[c] = 0;
        for (int k = 0; k < 16; k++)
            rgb[c] += wx[k % 4] * wy[k / 4] *
                      w->color[4 * (corner + (size_t)(k / 4) * (size_t)w->width + (size_t)(k % 4)) +
                               (size_t)c];
    }
    return 1;
}

/* What a pixel on the edge of a bare stroke is where another stroke lies under it: a piece of its
   inside. */
typedef struct txi_lay_edge {
    float x, y;       /* where that is copied from                                               */
    uint8_t color[3];
    uint8_t is_used;
} txi_lay_edge;

/* Which columns of a strip the pixels near it belong to. Arrays of one item per window pixel. */
typedef struct txi_lay {
    txi_strips *all;
    txi_plan *plan;
    txi_pose *poses;
    float *squares;   /* squared distance to the nearest column of the current strip              */
    int32_t *columns; /* that column, or -1                                                      */
    txi_lay_edge *edges; /* NULL: no stroke is bare                                               */
    float *claims;    /* distance to the core of the strip that has the pixel; large: none        */
} txi_lay;

/* The pixels within `radius` of a place, clipped to the window: x0, y0, x1, y1, inclusive. */
static void txi_lay_around(const txi_window *w, txm_vec2 p, int radius, int box[4]) {
    box[0] = txm_clampi((int)p.x - radius, 0, w->width - 1);
    box[1] = txm_clampi((int)p.y - radius, 0, w->height - 1);
    box[2] = txm_clampi((int)p.x + radius + 1, 0, w->width - 1);
    box[3] = txm_clampi((int)p.y + radius + 1, 0, w->height - 1);
}

/* For each hole pixel near a strip its nearest column; -1 for all others in the box of the
   strip. */
static void txi_lay_nearest(txi_lay *lay, const txi_strip *s, int box[4]) {
    const txi_window *w = lay->all->w;
    float widest = 0;
    int b[4];
    box[0] = w->width, box[1] = w->height, box[2] = box[3] = -1;
    for (int i = 0; i < s->line.count; i++) widest = txm_maxf(widest, s->line.half[i]);
    const int radius = (int)widest + TXI_STRIP_MARGIN + 2;
    for (int i = s->first; i <= s->last; i++) {
        txi_lay_around(w, s->line.place[i], radius, b);
        for (int k = 0; k < 2; k++) {
            box[k] = b[k] < box[k] ? b[k] : box[k];
            box[k + 2] = b[k + 2] > box[k + 2] ? b[k + 2] : box[k + 2];
        }
    }
    for (int y = box[1]; y <= box[3]; y++)
        for (int x = box[0]; x <= box[2]; x++)
            lay->columns[(size_t)y * (size_t)w->width + (size_t)x] = -1;
    for (int i = s->first; i <= s->last; i++) {
        const txm_vec2 p = s->line.place[i];
        txi_lay_around(w, p, radius, b);
        for (int y = b[1]; y <= b[3]; y++) {
            for (int x = b[0]; x <= b[2]; x++) {
                const size_t at = (size_t)y * (size_t)w->width + (size_t)x;
                const double dx = x - (double)p.x, dy = y - (double)p.y;
                const float square = txm_float(dx * dx + dy * dy);
                if (w->state[at] != TXI_HOLE ||
                    (lay->columns[at] >= 0 && square >= lay->squares[at]))
                    continue;
                lay->squares[at] = square;
                lay->columns[at] = i;
            }
        }
    }
}

/* The patch that has a place of the strip. */
static int txi_lay_patch(const txi_lay *lay, const txi_strip *s, double column, int row) {
    const int k = txm_clampi((int)((column - s->first) / s->hop), 0, s->node_count - 1);
    if (k + 1 == s->node_count) return k;
    const int *cut = lay->all->cuts + (size_t)(s->node + k) * TXI_STRIP_ROWS;
    return column >= cut[row] ? k + 1 : k;
}

/* How much a strip's colours count, 0..255: fully within the core, not at all at the margin's end,
   and less towards the end of a line that ends in the hole. */
static int txi_lay_pull(const txi_strip *s, double away, int column) {
    const double core = s->is_bare ? TXI_LAY_BARE : (double)TXI_LAY_CORE;
    const double margin = s->is_bare ? TXI_LAY_BARE + 1 : (double)TXI_STRIP_MARGIN;
    double pull = away <= core ? 1 : (margin - away) / (margin - core);
    if (s->is_open && s->line.count - 1 - column < TXI_LAY_FADE)
        pull *= (double)(s->line.count - column) / (TXI_LAY_FADE + 1);
    return pull <= 0 ? 0 : (int)(255 * pull + 0.5);
}

/* Where a pixel lies in the strip, in the frame of its nearest column. 0: beyond the strip's ends
   or at its side. */
typedef struct txi_strip_spot {
    double column, row, across, away, half;
    float claim;
} txi_strip_spot;

static int txi_lay_spot(const txi_lay *lay, const txi_strip *s, int x, int y, size_t at,
                        txi_strip_spot *o) {
    const int i = lay->columns[at];
    const txm_vec2 t = s->line.along[i], p = s->line.place[i];
    const double dx = x - (double)p.x, dy = y - (double)p.y;
    const double ahead = dx * t.x + dy * t.y;
    o->half = s->line.half[i];
    o->across = dy * t.x - dx * t.y;
    o->away = (o->across < 0 ? -o->across : o->across) - o->half;
    o->column = i + ahead;
    o->row = txi_offset_row(o->across, s->inside, o->half);
    const double core = s->is_bare ? 0 : TXI_LAY_CLAIM;
    o->claim = o->away > core ? txm_float(o->away - core) : 0;
    return ahead <= 1.5 && ahead >= -1.5 && o->away < (double)TXI_STRIP_MARGIN;
}

static uint8_t txi_lay_round(double value) {
    return (uint8_t)(value < 0 ? 0 : value > 254.5 ? 255 : (int)(value + 0.5));
}

/* What a pixel of a bare stroke would be if another stroke lay under it: if it is on the edge, the
   nearest place inside.
   from    the source column that the pixel is copied from
   offset  what is added to its colours                                                        */
static void txi_lay_edge_at(txi_lay *lay, const txi_strip *s, const txi_strip_spot *o,
                            const txi_column *from, const float *offset, size_t at) {
    txi_lay_edge *edge = &lay->edges[at];
    double rgb[3];
    edge->is_used = 0;
    if (!s->is_bare || o->away <= -TXI_LAY_EDGE || o->half <= 2 * TXI_LAY_EDGE) return;
    const double across = o->half - TXI_LAY_EDGE;
    const double inner = txi_offset_row(o->across < 0 ? -across : across, s->inside, o->half);
    const txm_vec2 p =
        txi_column_place(from, txi_row_offset(inner, s->inside, (double)from->half));
    if (!txi_lay_pixel(lay->all->w, (double)p.x, (double)p.y, rgb)) return;
    edge->is_used = 1;
    for (int c = 0; c < 3; c++) edge->color[c] = txi_lay_round(rgb[c] + (double)offset[c]);
    edge->x = p.x;
    edge->y = p.y;
}

/* The colour of a pixel by the patch that has it, and where that is copied from. 0: the source is
   not known there. */
static int txi_lay_patch_at(txi_lay *lay, const txi_strip *s, const txi_strip_spot *o, size_t at) {
    const int j = txm_clampi((int)(o->row + 0.5), 0, s->rows - 1);
    const int k = txi_lay_patch(lay, s, o->column, j), centre = s->first + k * s->hop;
    const txi_column from = txi_column_at(s, s->chosen[k], o->column - centre);
    const txm_vec2 p =
        txi_column_place(&from, txi_row_offset(o->row, s->inside, (double)from.half));
    const float *offset = lay->all->offsets + (size_t)(s->node + k) * 3 * TXI_STRIP_ROWS + 3 * j;
    const int forward = o->column >= centre;
    const int next = forward ? (k + 1 < s->node_count ? 1 : 0) : k > 0 ? -1 : 0;
    const double mix = (forward ? o->column - centre : centre - o->column) / s->hop;
    double rgb[3];
    if (!txi_lay_pixel(lay->all->w, (double)p.x, (double)p.y, rgb)) return 0;
    if (s->is_bare &&
        o->away > 0) { /* what lies beside the source is not always the usual background */
        uint8_t beside[3];
        for (int c = 0; c < 3; c++) beside[c] = txi_lay_round(rgb[c]);
        if (txi_typical_distance(s, j, beside) > (double)s->tolerance) return 0;
    }
    for (int c = 0; c < 3; c++) { /* offsets run linearly from centre to centre */
        const double here = (double)offset[c],
                     there = (double)offset[c + next * 3 * TXI_STRIP_ROWS];
        lay->plan->color[4 * at + (size_t)c] = txi_lay_round(rgb[c] + here + (there - here) * mix);
    }
    if (lay->edges) txi_lay_edge_at(lay, s, o, &from, offset, at);
    lay->plan->copies[at].x = p.x;
    lay->plan->copies[at].y = p.y;
    lay->plan->copies[at].piece = lay->plan->copies[at].pose = s->node + k;
    lay->plan->copies[at].layer = s->is_bare ? s->node + 1 : 0;
    return 1;
}

/* A stroke lies under the one that has a pixel: at the edge of that there is no background to be
   seen. */
static void txi_lay_over(txi_lay *lay, size_t at) {
    txi_lay_edge *edge = &lay->edges[at];
    if (!edge->is_used) return;
    edge->is_used = 0;
    memcpy(lay->plan->color + 4 * at, edge->color, 3);
    lay->plan->copies[at].x = edge->x;
    lay->plan->copies[at].y = edge->y;
}

/* One pixel of a strip. */
static void txi_lay_at(txi_lay *lay, const txi_strip *s, int x, int y) {
    const size_t at = (size_t)y * (size_t)lay->all->w->width + (size_t)x;
    txi_strip_spot o;
    if (!txi_lay_spot(lay, s, x, y, at, &o)) return;
    if (o.claim >= lay->claims[at]) { /* it is another strip's */
        if (s->is_bare && o.away < 0) txi_lay_over(lay, at);
        return;
    }
    const int pull = txi_lay_pull(s, o.away, lay->columns[at]);
    if (!pull) return;
    if (s->node_count) {
        if (!txi_lay_patch_at(lay, s, &o, at)) return;
    } else {
        double rgb[3];
        txi_strip_profile_at(s, o.column, o.row, rgb);
        for (int c = 0; c < 3; c++) lay->plan->color[4 * at + (size_t)c] = txi_lay_round(rgb[c]);
        lay->plan->copies[at].piece = -1;
        lay->plan->copies[at].layer = 0;
    }
    lay->claims[at] = o.claim;
    lay->plan->pull[at] = (uint8_t)pull;
}

/* The pose of a patch: both frames at its centre. */
static txi_pose txi_lay_pose(const txi_strip *s, int k) {
    const int column = s->first + k * s->hop;
    const txm_vec2 t = s->line.along[column < s->line.count ? column : s->line.count - 1];
    const txi_column *from = &s->sources[s->chosen[k]];
    const txm_vec2 u = from->along;
    const txm_vec2 v = txm_v2(-u.y * from->side, u.x * from->side);
    txi_pose pose; /* to the right is t.x along the line and -t.y across it; down t.y and t.x */
    pose.a = txm_float((double)t.x * u.x - (double)t.y * v.x);
    pose.b = txm_float((double)t.x * u.y - (double)t.y * v.y);
    pose.c = txm_float((double)t.y * u.x + (double)t.x * v.x);
    pose.d = txm_float((double)t.y * u.y + (double)t.x * v.y);
    return pose;
}

static void txi_lay_all(txi_lay *lay) {
    for (int k = 0; k < lay->all->count; k++) {
        const txi_strip *s = &lay->all->strips[lay->all->order[k]];
        int box[4];
        if (!s->node_count && !s->profile) continue;
        for (int n = 0; n < s->node_count; n++) lay->poses[s->node + n] = txi_lay_pose(s, n);
        txi_lay_nearest(lay, s, box);
        for (int y = box[1]; y <= box[3]; y++) {
            for (int x = box[0]; x <= box[2]; x++) {
                const ptrdiff_t at = (ptrdiff_t)y * lay->all->w->width + x;
                if (lay->all->w->state[at] == TXI_HOLE && lay->columns[at] >= 0)
                    txi_lay_at(lay, s, x, y);
            }
        }
    }
}

/* ---- the guide channel ---- */

/* Raise the guide channel near a place on a line, in the hole or outside of it. */
static void txi_guide_at(const txi_window *w, txi_plan *plan, const uint8_t *table, double px,
                         double py, int in_hole) {
    const int r = TXI_GUIDE_RADIUS;
    if (!(px > -r && py > -r && px < w->width + r && py < w->height + r)) return;
    const int cx = (int)(px + 0.5 + r) - r, cy = (int)(py + 0.5 + r) - r;
    for (int y = cy > r ? cy - r : 0; y <= cy + r && y < w->height; y++) {
        for (int x = cx > r ? cx - r : 0; x <= cx + r && x < w->width; x++) {
            const size_t at = (size_t)y * (size_t)w->width + (size_t)x;
            const double dx = x - px, dy = y - py, distance = sqrt(dx * dx + dy * dy);
            if ((w->state[at] == TXI_HOLE) != in_hole || distance >= r) continue;
            const uint8_t value = table[(int)(distance * (double)TXI_GUIDE_STEPS + 0.5)];
            if (plan->color[4 * at + 3] < value) plan->color[4 * at + 3] = value;
        }
    }
}

/* 100 exp(-d^2 / (2 * 1.5^2)) near known lines, outside of the hole, and near the completed
   ones. */
static void txi_guide(const txi_strips *all, const txi_lines *lines, txi_plan *plan) {
    uint8_t table[TXI_GUIDE_RADIUS * TXI_GUIDE_STEPS + 1];
    const txi_window *w = all->w;
    for (int i = 0; i <= TXI_GUIDE_RADIUS * TXI_GUIDE_STEPS; i++) {
        const double d = (double)i / ((double)TXI_GUIDE_STEPS * (double)TXI_GUIDE_SIGMA);
        table[i] =
            (uint8_t)((double)TXI_GUIDE_TOP * txm_exp2(-0.5 * TXI_LOG2_E * d * d) + 0.5);
    }
    for (int i = 0; lines && i < lines->thin_count; i++)
        txi_guide_at(w, plan, table, (double)lines->thin[i].place.x, (double)lines->thin[i].place.y,
                     0);
    for (int k = 0; k < all->count; k++) {
        const txi_ribbon *r = &all->strips[k].line;
        for (int i = 0; i < r->count; i++) {
            const double half = r->half[i], nx = -r->along[i].y, ny = r->along[i].x;
            for (int side = half > 0 ? -1 : 1; side < 2; side += 2) {
                const double x = (double)r->place[i].x + side * half * nx;
                const double y = (double)r->place[i].y + side * half * ny;
                txi_guide_at(w, plan, table, x, y, 1);
                txi_guide_at(w, plan, table, x, y, 0);
            }
        }
    }
}

/* ---- the plan ---- */

/* Arrays of the plan, and what is needed to lay it. 0: no memory. */
static int txi_lay_make(txi_lay *lay, txi_strips *all, txi_plan *plan, txm_arena *arena,
                        txm_arena *scratch) {
    const size_t pixels = (size_t)all->w->width * (size_t)all->w->height;
    int bare = 0;
    for (int i = 0; i < all->count; i++) bare |= all->strips[i].is_bare;
    memset(lay, 0, sizeof *lay);
    lay->all = all;
    lay->plan = plan;
    lay->squares = (float *)txm_arena_alloc(scratch, pixels, sizeof *lay->squares);
    lay->columns = (int32_t *)txm_arena_alloc(scratch, pixels, sizeof *lay->columns);
    lay->claims = (float *)txm_arena_alloc(scratch, pixels, sizeof *lay->claims);
    if (bare) lay->edges = (txi_lay_edge *)txm_arena_zero(scratch, pixels, sizeof *lay->edges);
    lay->poses =
        (txi_pose *)txm_arena_alloc(arena, (size_t)all->node_count + 1, sizeof *lay->poses);
    plan->color = (uint8_t *)txm_arena_zero(arena, pixels, 4);
    plan->pull = (uint8_t *)txm_arena_zero(arena, pixels, 1);
    plan->copies = (txi_copy *)txm_arena_zero(arena, pixels, sizeof *plan->copies);
    if (arena->failed || scratch->failed) return 0;
    for (size_t i = 0; i < pixels; i++) {
        lay->claims[i] = TXI_STRIP_MARGIN;
        plan->copies[i].piece = -1;
    }
    plan->poses = lay->poses;
    plan->pose_count = all->node_count;
    return 1;
}

/* How the strips of a plan get their colours. */
enum { TXI_LAY_TEXTURE, TXI_LAY_PROFILES };

static txm_status txi_plan_strips(const txi_window *w, int way, const txi_lines *lines,
                                  const txi_curve *curves, int count, uint64_t seed,
                                  txm_arena *arena, txm_env *env, txi_plan *plan) {
    txi_strips all;
    txi_lay lay;
    txm_arena scratch;
    memset(&all, 0, sizeof all);
    memset(plan, 0, sizeof *plan);
    txm_arena_init(&scratch, env);
    txm_status status = txi_strips_make(w, curves, count, &all, &scratch, env);
    if (status == TXM_OK) status = txi_strips_order(&all, curves, &scratch, env);
    if (status == TXM_OK)
        status = txi_strips_graph(&all, way == TXI_LAY_PROFILES, lines, curves, &scratch, env);
    if (status == TXM_OK) status = txi_strips_choose(&all, seed, &scratch, env);
    if (status == TXM_OK) status = txi_strips_finish(&all, &scratch, env);
    if (status == TXM_OK && !txi_lay_make(&lay, &all, plan, arena, &scratch))
        status = txi_no_memory(env);
    if (status == TXM_OK) {
        txi_lay_all(&lay);
        txi_guide(&all, lines, plan);
        if (txm_progress(env, 0, "strips")) status = txi_stopped(env);
    }
    txm_arena_free(&scratch);
    if (status != TXM_OK) memset(plan, 0, sizeof *plan);
    return status;
}

/* Lay strips of texture along the completed lines of a window [1, III.A].

   lines   of the window: other lines to take texture from, and the known lines of the guide
           channel; NULL: none
   curves  the completed lines, count of them; may be none
   arena   holds the plan
   plan    receives the strips: color and pull in the hole, the guide channel near all lines.
           Copies have one piece and one pose per patch
   return  TXM_OK; TXM_OUT_OF_MEMORY; TXM_CANCELLED; after a failure the plan is all zero
   cost    per curve of n columns and m source columns O(m^2 + n m) times the rows, 32 to 61 */
static txm_status txi_plan_make(const txi_window *w, const txi_lines *lines,
                                const txi_curve *curves, int count, uint64_t seed, txm_arena *arena,
                                txm_env *env, txi_plan *plan) {
    return txi_plan_strips(w, TXI_LAY_TEXTURE, lines, curves, count, seed, arena, env, plan);
}

/* The same without texture: the colours across each line are the mean ones of its known ends,
   blended along it. plan->copies has no pieces. */
static txm_status txi_cartoon(const txi_window *w, const txi_lines *lines, const txi_curve *curves,
                              int count, txm_arena *arena, txm_env *env, txi_plan *plan) {
    return txi_plan_strips(w, TXI_LAY_PROFILES, lines, curves, count, 0, arena, env, plan);
}

/* Draw a plan over the colours of the window: strips, paler where they count less. rgb: 3 per
   pixel. */
static void txi_draw_strips(const txi_window *w, const txi_plan *plan, uint8_t *rgb) {
    for (size_t i = 0; i < (size_t)w->width * (size_t)w->height; i++) {
        for (size_t c = 0; c < 3; c++) {
            const int laid =
                (plan->color[4 * i + c] * plan->pull[i] + 90 * (255 - plan->pull[i])) / 255;
            rgb[3 * i + c] = w->state[i] == TXI_VOID ? 0
                             : w->state[i] == TXI_HOLE ? (uint8_t)laid
                                                       : w->color[4 * i + c];
        }
    }
}

/* ---- levels of a window -------------------------------------------------------------------- */

enum {
    TXI_PATCH = 8, /* pixels: side of the square patches that are compared               */
    TXI_PATCH_AREA = TXI_PATCH * TXI_PATCH,
    TXI_EDGE = 8, /* pixels of void around each level, so that all patches lie inside   */
    TXI_MAX_LEVELS = 8,
    TXI_MAX_POSES = 16,
    TXI_LEAST_PATCHES = 48, /* source patches that a coarse level must have; ours              */
    TXI_LEAST_FILLED = 24   /* pixels that are not void in a patch to be matched; ours         */
};

/* How a pixel may be copied: not; by itself; interpolated with its neighbour to the right, below
   and below right; by four pixels a direction. */
enum { TXI_TAP_NONE = 0, TXI_TAP_ONE, TXI_TAP_LINEAR, TXI_TAP_CUBIC };

/* A window at one level in one pose: what patches are copied from. Its pixel (i, j) is the level's
   pixel (x + a i + c j, y + b i + d j), in units of 2^-16 pixels, so that all of it is integers. */
typedef struct txi_source {
    int width, height;
    int32_t x, y, a, b, c, d;
    uint8_t *color;  /* 4 per pixel; NULL: not made                                            */
    uint8_t *usable; /* 1 where there is colour                                                */
    uint16_t *worth; /* of the patch whose upper left corner the pixel is: 0 = not all of it may be
                        copied, else 1 + its detail, see detail.h                              */
} txi_source;

/* A window at half, a quarter, ... of its resolution. Pixel (x, y) of level l has its centre at
   ((x + 1/2) 2^l - 1/2, ...) in the window. All arrays are rasters of width * height pixels with
   TXI_EDGE pixels of void on all sides, or lists of numbers of pixels in these. */
typedef struct txi_level {
    int width, height;
    uint8_t *state; /* TXI_VOID .. TXI_FOREIGN                                            */
    uint8_t *color; /* 4 per pixel; 0 where there is nothing known. The fourth is the guide */
    uint8_t *mask;  /* 4 per pixel: 255 where the pixel is not void                       */
    uint8_t *taps;  /* how the pixel and those right of and below it may be copied: TXI_TAP_ */
    uint8_t *guide; /* the plan's guide, strips and their pull, at this level; see fill.h  */
    uint8_t *strip, *pull;
    uint8_t *depth; /* of hole pixels: pixels to the nearest known one, at most 255       */
    int32_t *hole;  /* the hole's pixels                                                  */
    int hole_count;
    int32_t *hole_row; /* height + 1: the first of them in each row                          */
    int32_t *anchor;   /* upper left corners of the patches that touch the hole              */
    int anchor_count;
    int32_t *anchor_row; /* height + 1                                                         */
    int32_t *slot;       /* the pixel's number as an anchor, -1: it is none                    */
    uint8_t *filled;     /* of each anchor: pixels of its patch that are not void, 1..64       */
    uint32_t *want;      /* of each anchor: expected detail of its patch, as txi_source.worth - 1 */
    uint32_t clamp;      /* largest detail of a pixel that counts                              */
    double grain;        /* (median + 1/2) / (mean + 1/2) of the detail of known pixels        */
    txi_source source[TXI_MAX_POSES];
    int built[TXI_MAX_POSES]; /* numbers of the sources that are made                          */
    int built_count;
} txi_level;

/* Memory of a level with these inner sides. 0: there is none. */
static int txi_level_make(txi_level *l, int width, int height, txm_arena *arena) {
    memset(l, 0, sizeof *l);
    l->width = width + 2 * TXI_EDGE;
    l->height = height + 2 * TXI_EDGE;
    const size_t n = (size_t)l->width * (size_t)l->height;
    l->state = (uint8_t *)txm_arena_zero(arena, n, 1);
    l->color = (uint8_t *)txm_arena_zero(arena, n, 4);
    l->mask = (uint8_t *)txm_arena_zero(arena, n, 4);
    l->taps = (uint8_t *)txm_arena_zero(arena, n, 1);
    l->depth = (uint8_t *)txm_arena_zero(arena, n, 1);
    l->slot = (int32_t *)txm_arena_alloc(arena, n, sizeof(int32_t));
    l->hole_row = (int32_t *)txm_arena_zero(arena, (size_t)l->height + 1, sizeof(int32_t));
    l->anchor_row = (int32_t *)txm_arena_zero(arena, (size_t)l->height + 1, sizeof(int32_t));
    return !arena->failed;
}

/* The finest level: the window itself. */
static void txi_level_load(txi_level *l, const txi_window *w) {
    for (int y = 0; y < w->height; y++) {
        for (int x = 0; x < w->width; x++) {
            const size_t from = (size_t)y * (size_t)w->width + (size_t)x;
            const size_t to = (size_t)(y + TXI_EDGE) * (size_t)l->width + (size_t)(x + TXI_EDGE);
            l->state[to] = w->state[from];
            if (w->state[from] == TXI_KNOWN || w->state[from] == TXI_FOREIGN)
                memcpy(l->color + 4 * to, w->color + 4 * from, 3);
        }
    }
}

/* Half the resolution. A pixel is missing if one of the four that it covers is, foreign if one is
   foreign; its colour is the mean of those that are not void. */
static void txi_level_halve(const txi_level *f, txi_level *l) {
    for (int y = TXI_EDGE; y < l->height - TXI_EDGE; y++) {
        for (int x = TXI_EDGE; x < l->width - TXI_EDGE; x++) {
            const size_t to = (size_t)y * (size_t)l->width + (size_t)x;
            int count[4] = {0, 0, 0, 0}, sum[3] = {0, 0, 0};
            for (int k = 0; k < 4; k++) {
                const int fx = 2 * x - TXI_EDGE + (k & 1), fy = 2 * y - TXI_EDGE + (k >> 1);
                if (fx >= f->width || fy >= f->height) continue;
                const size_t from = (size_t)fy * (size_t)f->width + (size_t)fx;
                count[f->state[from]]++;
                for (int c = 0; c < 3; c++) sum[c] += f->color[4 * from + (size_t)c];
            }
            const int known = count[TXI_KNOWN] + count[TXI_FOREIGN];
            l->state[to] = count[TXI_HOLE]      ? TXI_HOLE
                           : count[TXI_FOREIGN] ? TXI_FOREIGN
                           : known              ? TXI_KNOWN
                                                : TXI_VOID;
            if (l->state[to] == TXI_HOLE || !known) continue;
            for (int c = 0; c < 3; c++)
                l->color[4 * to + (size_t)c] = (uint8_t)((sum[c] + known / 2) / known);
        }
    }
}

/* The colours of the hole at half resolution, from those of the finer level; the rest is not
   touched. */
static void txi_color_halve(const txi_level *f, const uint8_t *from, const txi_level *l,
                            uint8_t *to) {
    for (int i = 0; i < l->hole_count; i++) {
        const int x = l->hole[i] % l->width, y = l->hole[i] / l->width;
        int sum[4] = {0, 0, 0, 0}, count = 0;
        for (int k = 0; k < 4; k++) {
            const int fx = 2 * x - TXI_EDGE + (k & 1), fy = 2 * y - TXI_EDGE + (k >> 1);
            if (fx >= f->width || fy >= f->height) continue;
            const size_t p = (size_t)fy * (size_t)f->width + (size_t)fx;
            if (f->state[p] == TXI_VOID) continue;
            for (int c = 0; c < 4; c++) sum[c] += from[4 * p + (size_t)c];
            count++;
        }
        for (int c = 0; c < 4 && count; c++)
            to[4 * (size_t)l->hole[i] + (size_t)c] = (uint8_t)((sum[c] + count / 2) / count);
    }
}

/* How the pixels may be resampled. At the finest level a pixel may be copied only if its 3x3
   neighbours are known, so that the caller can interpolate there. */
static int txi_level_taps(txi_level *l, int finest, txm_arena *scratch) {
    const size_t n = (size_t)l->width * (size_t)l->height, w = (size_t)l->width;
    uint8_t *solid = (uint8_t *)txm_arena_zero(scratch, n, 1);
    if (!solid) return 0;
    for (size_t p = w + 1; p + w + 1 < n; p++) {
        int all = l->state[p] == TXI_KNOWN;
        for (size_t q = p - w; finest && all && q <= p + w; q += w)
            all = l->state[q - 1] == TXI_KNOWN && l->state[q] == TXI_KNOWN &&
                  l->state[q + 1] == TXI_KNOWN;
        solid[p] = (uint8_t)all;
    }
    for (size_t p = w + 1; p + 2 * w + 2 < n; p++) {
        if (!solid[p]) continue;
        l->taps[p] = TXI_TAP_ONE;
        if (!(solid[p + 1] && solid[p + w] && solid[p + w + 1])) continue;
        l->taps[p] = TXI_TAP_LINEAR;
        int all = 1;
        for (size_t q = p - w - 1; all && q <= p + 2 * w - 1; q += w)
            for (size_t k = 0; k < 4; k++) all &= l->state[q + k] == TXI_KNOWN;
        if (all) l->taps[p] = TXI_TAP_CUBIC;
    }
    return 1;
}

/* Distances of hole pixels to the known part in pixels, by two passes with steps of 5 and 7 fifths.
   Void counts as nothing, so a hole on the border of the window is deepest there. */
static int txi_level_depth(txi_level *l, txm_arena *scratch) {
    const int w = l->width, n = l->width * l->height;
    int32_t *far5 = (int32_t *)txm_arena_alloc(scratch, (size_t)n, sizeof(int32_t));
    if (!far5) return 0;
    for (int p = 0; p < n; p++)
        far5[p] = l->state[p] == TXI_KNOWN || l->state[p] == TXI_FOREIGN ? 0 : 1 << 20;
    for (int pass = 0; pass < 2; pass++) {
        const int s = pass ? -1 : 1;
        for (int i = w + 1; i < n - w - 1; i++) {
            const int p = pass ? n - 1 - i : i;
            const int side[4] = {p - s, p - s * w, p - s * (w + 1), p - s * (w - 1)};
            for (int k = 0; k < 4; k++) {
                const int32_t through = far5[side[k]] + (k < 2 ? 5 : 7);
                if (through < far5[p]) far5[p] = through;
            }
        }
    }
    for (int p = 0; p < n; p++) {
        const int d = (far5[p] + 2) / 5;
        l->depth[p] = (uint8_t)(l->state[p] != TXI_HOLE ? 0 : d > 255 ? 255 : d < 1 ? 1 : d);
    }
    return 1;
}

/* The lists of the hole's pixels and of the patches that touch it. */
static int txi_level_lists(txi_level *l, txm_arena *arena) {
    const int w = l->width, n = l->width * l->height;
    uint8_t *touch = (uint8_t *)txm_arena_zero(arena, (size_t)n, 1);
    if (!touch) return 0;
    for (int p = 0; p < n; p++) {
        l->slot[p] = -1;
        if (l->state[p] != TXI_VOID) memset(l->mask + 4 * (size_t)p, 255, 4);
        if (l->state[p] != TXI_HOLE) continue;
        l->hole_count++;
        for (int y = 0; y < TXI_PATCH; y++)
            for (int x = 0; x < TXI_PATCH; x++) touch[p - y * w - x] = 1;
    }
    for (int p = 0; p < n; p++) {
        if (!touch[p]) continue;
        int filled = 0;
        for (int y = 0; y < TXI_PATCH; y++)
            for (int x = 0; x < TXI_PATCH; x++) filled += l->state[p + y * w + x] != TXI_VOID;
        const int centre = p + (TXI_PATCH / 2) * (w + 1);
        touch[p] =
            (uint8_t)(filled >= TXI_LEAST_FILLED || l->state[centre] == TXI_HOLE ? filled : 0);
        l->anchor_count += touch[p] != 0;
    }
    l->hole = (int32_t *)txm_arena_alloc(arena, (size_t)l->hole_count, sizeof(int32_t));
    l->anchor = (int32_t *)txm_arena_alloc(arena, (size_t)l->anchor_count, sizeof(int32_t));
    l->filled = (uint8_t *)txm_arena_alloc(arena, (size_t)l->anchor_count, 1);
    l->want = (uint32_t *)txm_arena_zero(arena, (size_t)l->anchor_count, sizeof(uint32_t));
    if (arena->failed) return 0;
    int h = 0, a = 0;
    for (int p = 0; p < n; p++) {
        if (p % w == 0) {
            l->hole_row[p / w] = h;
            l->anchor_row[p / w] = a;
        }
        if (l->state[p] == TXI_HOLE) {
            TXM_ASSERT(h < l->hole_count);
            l->hole[h++] = p;
        }
        if (!touch[p]) continue;
        l->slot[p] = a;
        l->filled[a] = touch[p];
        TXM_ASSERT(a < l->anchor_count);
        l->anchor[a++] = p;
    }
    l->hole_row[l->height] = h;
    l->anchor_row[l->height] = a;
    return 1;
}

/* twice the largest depth: the width of the hole, in pixels */
static int txi_level_hole_width(const txi_level *l) {
    int deepest = 0;
    for (int i = 0; i < l->hole_count; i++) {
        const int d = l->depth[l->hole[i]];
        if (d > deepest) deepest = d;
    }
    return 2 * deepest;
}

/* ---- distances of patches -------------------------------------------------------------------- */

/* Sum of squared differences of the four bytes of the pixels of two patches; a and b point to their
   first bytes, mask to that of a's mask or NULL if all count. Stops once the sum exceeds limit. */
static uint32_t txi_ssd(const uint8_t *a, size_t a_pitch, const uint8_t *mask, const uint8_t *b,
                        size_t b_pitch, uint32_t limit) {
    uint32_t total = 0;
    for (int y = 0; y < TXI_PATCH; y++) {
#ifdef TXI_SSE2
        static const int step = 16;
        __m128i sum = _mm_setzero_si128();
        for (int i = 0; i < 4 * TXI_PATCH; i += step) {
            const __m128i zero = _mm_setzero_si128();
            const __m128i u = _mm_loadu_si128((const __m128i *)(const void *)(a + i));
            const __m128i v = _mm_loadu_si128((const __m128i *)(const void *)(b + i));
            __m128i d = _mm_or_si128(_mm_subs_epu8(u, v), _mm_subs_epu8(v, u));
            if (mask)
                d = _mm_and_si128(d, _mm_loadu_si128((const __m128i *)(const void *)(mask + i)));
            const __m128i low = _mm_unpacklo_epi8(d, zero), high = _mm_unpackhi_epi8(d, zero);
            sum = _mm_add_epi32(sum, _mm_madd_epi16(low, low));
            sum = _mm_add_epi32(sum, _mm_madd_epi16(high, high));
        }
        sum = _mm_add_epi32(sum, _mm_shuffle_epi32(sum, 0x4e));
        sum = _mm_add_epi32(sum, _mm_shuffle_epi32(sum, 0xb1));
        total += (uint32_t)_mm_cvtsi128_si32(sum);
#else
        for (int i = 0; i < 4 * TXI_PATCH; i++) {
            const int d = a[i] - b[i];
            if (!mask || mask[i]) total += (uint32_t)(d * d);
        }
#endif
        if (total > limit) return total;
        a += a_pitch;
        b += b_pitch;
        if (mask) mask += a_pitch;
    }
    return total;
}

/* ---- detail: how rough the texture is, and is expected to be ------------------------------------

   In noise of variance v, a patch differs from a smooth one by v per pixel and from another rough
   one by 2 v. So distances alone prefer smooth patches, and grain is smeared. Therefore patches
   with less detail than expected pay the difference. The detail of a pixel is

       e(p) = min(clamp, sum over RGB of (p - mean of the usable pixels of 5x5)^2),

   that of a patch the sum over its pixels. The expected one is the mean of its logarithm over the
   known patches around, less a multiple of the standard deviation.                             */

enum {
    TXI_DETAIL_RADIUS = 2,  /* pixels: of the mean                                             */
    TXI_DETAIL_BINS = 4096, /* of the histogram                                                */
    TXI_REACHES = 7,        /* radii that the expectation is collected in                      */
    TXI_WORTH_MOST = 65535, /* detail of a patch whose pixels all have the level's clamp        */
    TXI_WANT_FLOOR = 64     /* added to the detail of a patch under the logarithm              */
};

/* e of each usable pixel, 0 of others, not clamped.
   columns  room for 4 * width numbers                                                         */
static void txi_detail(const uint8_t *color, const uint8_t *usable, int width, int height,
                       int32_t *columns, uint32_t *e) {
    const int r = TXI_DETAIL_RADIUS;
    const size_t w = (size_t)width;
    memset(columns, 0, 4 * w * sizeof *columns);
    for (int y = -r; y < height; y++) {
        for (int side = 0; side < 2; side++) { /* a row enters the sums, another one leaves them */
            const int row = side ? y - r - 1 : y + r;
            if (row < 0 || row >= height) continue;
            const int sign = side ? -1 : 1;
            for (size_t x = 0; x < w; x++) {
                const size_t p = (size_t)row * w + x;
                if (!usable[p]) continue;
                for (size_t c = 0; c < 3; c++) columns[4 * x + c] += sign * color[4 * p + c];
                columns[4 * x + 3] += sign;
            }
        }
        if (y < 0) continue;
        int32_t sum[4] = {0, 0, 0, 0};
        for (int x = -r; x < width; x++) {
            for (int c = 0; c < 4; c++) {
                if (x + r < width) sum[c] += columns[4 * (x + r) + c];
                if (x - r - 1 >= 0) sum[c] -= columns[4 * (x - r - 1) + c];
            }
            if (x < 0) continue;
            const size_t p = (size_t)y * w + (size_t)x;
            e[p] = 0;
            if (!usable[p]) continue;
            const int32_t n = sum[3];
            uint32_t total = 0;
            for (size_t c = 0; c < 3; c++) {
                const int32_t d = color[4 * p + c] * n - sum[c];
                total += (uint32_t)(d * d);
            }
            e[p] = total / (uint32_t)(n * n);
        }
    }
}

/* Sums over the 8x8 pixels right of and below each pixel, those beyond the raster being 0.
   columns  room for width numbers                                                             */
static void txi_patch_sums(const uint32_t *value, int width, int height, uint32_t *columns,
                           uint32_t *sums) {
    const size_t w = (size_t)width;
    memset(columns, 0, w * sizeof *columns);
    for (int y = height - 1; y >= 0; y--) {
        uint32_t sum = 0;
        for (size_t x = 0; x < w; x++) {
            columns[x] += value[(size_t)y * w + x];
            if (y + TXI_PATCH < height) columns[x] -= value[(size_t)(y + TXI_PATCH) * w + x];
        }
        for (int x = width - 1; x >= 0; x--) {
            sum += columns[x];
            if (x + TXI_PATCH < width) sum -= columns[x + TXI_PATCH];
            sums[(size_t)y * w + (size_t)x] = sum;
        }
    }
}

/* Median and mean of the detail of the known pixels; sets grain and clamp of the level.
   strength  the clamp is its square times (median + 2)                                        */
static void txi_detail_clamp(txi_level *l, const uint32_t *e, float strength, uint32_t *bins) {
    const int n = l->width * l->height;
    uint32_t known = 0, below = 0, median = 0;
    double sum = 0;
    memset(bins, 0, TXI_DETAIL_BINS * sizeof *bins);
    for (int p = 0; p < n; p++) {
        if (l->state[p] != TXI_KNOWN) continue;
        known++;
        sum += e[p];
        bins[e[p] < TXI_DETAIL_BINS ? e[p] : TXI_DETAIL_BINS - 1]++;
    }
    while (median < TXI_DETAIL_BINS - 1 && (below += bins[median]) * 2 < known) median++;
    l->grain = known ? (median + 0.5) / (sum / known + 0.5) : 0;
    const double most = (double)strength * strength * (median + 2.0);
    l->clamp = (uint32_t)(most < 16 ? 16 : most > 195075 ? 195075 : most);
}

/* a box filter along one direction of a grid, of values step apart, in place */
static void txi_box_line(float *v, int count, size_t step, int radius, float *copy) {
    double sum = 0;
    for (int i = 0; i < count; i++) copy[i] = v[(size_t)i * step];
    for (int i = -radius; i < count; i++) {
        if (i + radius < count) sum += copy[i + radius];
        if (i - radius - 1 >= 0) sum -= copy[i - radius - 1];
        if (i >= 0) v[(size_t)i * step] = txm_float(sum / (2 * radius + 1));
    }
}

/* The expectation is collected on a coarser grid: weight, mean and mean square of the logarithms
   of known patches. */
typedef struct txi_wish {
    int width, height, step; /* cells; pixels per cell                                         */
    float *weight, *first, *second; /* of the known patches                                    */
    float *blur[3]; /* the same, filtered                                             */
    float *copy;
    float *result; /* expected detail; below 0: not yet                              */
} txi_wish;

static void txi_wish_reach(txi_wish *g, int radius, float offset) {
    const size_t w = (size_t)g->width, n = w * (size_t)g->height;
    float *from[3];
    from[0] = g->weight;
    from[1] = g->first;
    from[2] = g->second;
    for (int k = 0; k < 3; k++) {
        memcpy(g->blur[k], from[k], n * sizeof(float));
        for (int pass = 0; pass < 2; pass++) {
            for (int y = 0; y < g->height; y++)
                txi_box_line(g->blur[k] + (size_t)y * w, g->width, 1, radius, g->copy);
            for (int x = 0; x < g->width; x++)
                txi_box_line(g->blur[k] + x, g->height, w, radius, g->copy);
        }
    }
    for (size_t i = 0; i < n; i++) {
        if (g->result[i] >= 0 || g->blur[0][i] < 0.12f) continue;
        const double mean = (double)g->blur[1][i] / g->blur[0][i];
        const double square = (double)g->blur[2][i] / g->blur[0][i] - mean * mean;
        const double level = exp(mean - (double)offset * sqrt(square > 0 ? square : 0));
        g->result[i] =
            txm_float(level > (double)TXI_WANT_FLOOR ? level - (double)TXI_WANT_FLOOR : 0);
    }
}

/* The expected detail of all anchors. sums: detail of all patches (void and hole: 0).
   offset  standard deviations below the mean                                                  */
static int txi_level_want(txi_level *l, const uint32_t *sums, float offset, txm_arena *scratch) {
    txi_wish g;
    memset(&g, 0, sizeof g);
    g.step = l->width * l->height > 100000 ? 4 : 2;
    g.width = (l->width + g.step - 1) / g.step;
    g.height = (l->height + g.step - 1) / g.step;
    const size_t n = (size_t)g.width * (size_t)g.height;
    const int longer = g.width > g.height ? g.width : g.height;
    float *block = (float *)txm_arena_zero(scratch, n, 7 * sizeof(float));
    g.copy = (float *)txm_arena_alloc(scratch, (size_t)longer, sizeof(float));
    if (scratch->failed) return 0;
    g.weight = block;
    g.first = block + n;
    g.second = block + 2 * n;
    for (size_t k = 0; k < 3; k++) g.blur[k] = block + (3 + k) * n;
    g.result = block + 6 * n;
    for (size_t i = 0; i < n; i++) {
        const int x = (int)(i % (size_t)g.width) * g.step, y = (int)(i / (size_t)g.width) * g.step;
        const int p = y * l->width + x;
        g.result[i] = -1;
        if (x > l->width - TXI_PATCH || y > l->height - TXI_PATCH || l->slot[p] >= 0) continue;
        int known = 1;
        for (int k = 0; known && k < TXI_PATCH_AREA; k++)
            known = l->state[p + k / TXI_PATCH * l->width + k % TXI_PATCH] != TXI_VOID;
        if (!known) continue;
        const double value = log((double)sums[p] + (double)TXI_WANT_FLOOR);
        g.weight[i] = 1;
        g.first[i] = txm_float(value);
        g.second[i] = txm_float(value * value);
    }
    double radius = 4;
    for (int i = 0; i < TXI_REACHES; i++, radius *= 1.8)
        txi_wish_reach(&g, (int)(radius / g.step + 0.5), offset);
    for (int a = 0; a < l->anchor_count; a++) {
        const int x = l->anchor[a] % l->width / g.step, y = l->anchor[a] / l->width / g.step;
        const float r = g.result[(size_t)y * (size_t)g.width + (size_t)x];
        l->want[a] =
            r > 0
                ? (uint32_t)((double)r * (double)TXI_WORTH_MOST / (double)TXI_PATCH_AREA / l->clamp)
                : 0;
    }
    return 1;
}

/* Detail of a level: grain, clamp and the expectation of its anchors. want_it 0: the first two
   only. */
static int txi_level_detail(txi_level *l, float clamp, float offset, int want_it,
                            txm_arena *scratch) {
    const size_t n = (size_t)l->width * (size_t)l->height;
    uint8_t *usable = (uint8_t *)txm_arena_alloc(scratch, n, 1);
    uint32_t *e = (uint32_t *)txm_arena_alloc(scratch, n, 2 * sizeof(uint32_t));
    int32_t *columns = (int32_t *)txm_arena_alloc(scratch, (size_t)l->width, 4 * sizeof(int32_t));
    uint32_t *bins = (uint32_t *)txm_arena_alloc(scratch, TXI_DETAIL_BINS, sizeof(uint32_t));
    if (scratch->failed) return 0;
    for (size_t p = 0; p < n; p++)
        usable[p] = l->state[p] == TXI_KNOWN || l->state[p] == TXI_FOREIGN;
    txi_detail(l->color, usable, l->width, l->height, columns, e);
    txi_detail_clamp(l, e, clamp, bins);
    if (!want_it) return 1;
    for (size_t p = 0; p < n; p++) {
        if (e[p] > l->clamp) e[p] = l->clamp;
    }
    txi_patch_sums(e, l->width, l->height, (uint32_t *)(void *)columns, e + n);
    return txi_level_want(l, e + n, offset, scratch);
}

/* ---- sources: the window turned and mirrored --------------------------------------------------

   Patches are copied from turned copies of the window, too. They are made beforehand, as pictures
   of their own: then the neighbour of a copied patch is again one pixel further, and distances are
   taken between rows of bytes.                                                                */

enum {
    TXI_UNIT = 1 << 16,    /* of txi_source: one pixel                                         */
    TXI_PHASES = 64,       /* per pixel, of the interpolation                                  */
    TXI_MESH_POSES = 16,   /* angles over the full circle                                      */
    TXI_PICTURE_POSES = 14 /* 9 angles within +-20 degrees, 5 within +-10 degrees mirrored     */
};

/* The pose's axes. Pose 0 is the window as it is. */
static void txi_pose_axes(int is_picture, int pose, txi_source *s) {
    /* in 1/16 turns, or degrees; poses that are near pose 0 come first */
    static const int degrees[TXI_PICTURE_POSES] = {0,  5,   -5, 10, -10, 15, -15,
                                                   20, -20, 0,  5,  -5,  10, -10};
    static const int turns[TXI_MESH_POSES] = {0, 1, 15, 2, 14, 3, 13, 4, 12, 5, 11, 6, 10, 7, 9, 8};
    double sine, cosine;
    txm_sincos(is_picture ? degrees[pose] * (TXM_PI / 180) : turns[pose] * (TXM_PI / 8), &sine,
               &cosine);
    const int32_t u = (int32_t)floor(cosine * (double)TXI_UNIT + 0.5);
    const int32_t v = (int32_t)floor(sine * (double)TXI_UNIT + 0.5);
    const int mirrored = is_picture && pose >= 9;
    s->a = mirrored ? -u : u;
    s->b = mirrored ? -v : v;
    s->c = -v;
    s->d = u;
}

/* the place of the source's pixel (i, j) in its level, 1/65536 pixels */
static void txi_source_place(const txi_source *s, int i, int j, int32_t *x, int32_t *y) {
    *x = s->x + s->a * i + s->c * j;
    *y = s->y + s->b * i + s->d * j;
}

/* the source's pixel nearest to a place of its level; may lie outside */
static void txi_source_pixel(const txi_source *s, int32_t x, int32_t y, int *i, int *j) {
    const int64_t dx = (int64_t)x - s->x, dy = (int64_t)y - s->y, one = (int64_t)1 << 32;
    const int64_t u = s->a * dx + s->b * dy, v = s->c * dx + s->d * dy;
    *i = (int)((u + one / 2 + (one << 14)) / one - (1 << 14)); /* floor, also of negatives */
    *j = (int)((v + one / 2 + (one << 14)) / one - (1 << 14));
}

/* Size and place of a source of a level: the level's inner part lies in it. */
static void txi_source_size(txi_source *s, const txi_level *l) {
    int64_t low[2] = {INT64_MAX, INT64_MAX}, high[2] = {INT64_MIN, INT64_MIN};
    const int32_t cx = l->width / 2 * TXI_UNIT, cy = l->height / 2 * TXI_UNIT;
    for (int k = 0; k < 4; k++) {
        const int64_t dx = (int64_t)(k & 1 ? l->width - TXI_EDGE - 1 : TXI_EDGE) * TXI_UNIT - cx;
        const int64_t dy = (int64_t)(k & 2 ? l->height - TXI_EDGE - 1 : TXI_EDGE) * TXI_UNIT - cy;
        const int64_t at[2] = {s->a * dx + s->b * dy, s->c * dx + s->d * dy};
        for (int i = 0; i < 2; i++) {
            if (at[i] < low[i]) low[i] = at[i];
            if (at[i] > high[i]) high[i] = at[i];
        }
    }
    /* whole pixels from the centre, so that turns by right angles resample nothing */
    const int64_t one = (int64_t)1 << 32, bias = one << 14;
    const int i0 = (int)((low[0] + one - 1 + bias) / one - (1 << 14));
    const int j0 = (int)((low[1] + one - 1 + bias) / one - (1 << 14));
    s->width = (int)((high[0] + bias) / one - (1 << 14)) - i0 + 1;
    s->height = (int)((high[1] + bias) / one - (1 << 14)) - j0 + 1;
    s->x = cx + s->a * i0 + s->c * j0;
    s->y = cy + s->b * i0 + s->d * j0;
}

/* weights of the four taps of Catmull-Rom interpolation at k / 64, in 1/1024 */
static void txi_cubic_weights(int k, int *w) {
    /* (-t^3 + 2 t^2 - t) / 2, (3 t^3 - 5 t^2 + 2) / 2, ..., t = k / 64, in 1/2^19, then rounded */
    const int t = k, tt = t * t, ttt = tt * t;
    w[0] = (-ttt + 2 * 64 * tt - 4096 * t) / 512;
    w[2] = (-3 * ttt + 4 * 64 * tt + 4096 * t) / 512;
    w[3] = (ttt - 64 * tt) / 512;
    w[1] = 1024 - w[0] - w[2] - w[3];
}

/* The level's colour at a place, by taps taps a direction. */
static void txi_level_sample(const txi_level *l, size_t p, int fx, int fy, int taps, uint8_t *out) {
    int wx[4], wy[4];
    const size_t pitch = 4 * (size_t)l->width;
    if (taps == TXI_TAP_CUBIC) {
        txi_cubic_weights(fx, wx);
        txi_cubic_weights(fy, wy);
    } else {
        wx[0] = wx[3] = wy[0] = wy[3] = 0;
        wx[2] = fx * (1024 / TXI_PHASES);
        wy[2] = fy * (1024 / TXI_PHASES);
        wx[1] = 1024 - wx[2];
        wy[1] = 1024 - wy[2];
    }
    int sum[3] = {0, 0, 0};
    const uint8_t *row = l->color + 4 * p - pitch - 4;
    for (int y = 0; y < 4; y++, row += pitch) {
        for (int c = 0; c < 3; c++) {
            const int line =
                row[c] * wx[0] + row[4 + c] * wx[1] + row[8 + c] * wx[2] + row[12 + c] * wx[3];
            sum[c] += line / 16 * wy[y];
        }
    }
    for (int c = 0; c < 3; c++)
        out[c] = (uint8_t)txm_clampi((sum[c] + (1 << 15)) / (1 << 16), 0, 255);
}

/* Make the picture of a source. */
static void txi_source_draw(const txi_level *l, txi_source *s) {
    for (int j = 0; j < s->height; j++) {
        for (int i = 0; i < s->width; i++) {
            const size_t q = (size_t)j * (size_t)s->width + (size_t)i;
            int32_t x, y;
            txi_source_place(s, i, j, &x, &y);
            x += TXI_UNIT / TXI_PHASES / 2; /* rounded to a phase */
            y += TXI_UNIT / TXI_PHASES / 2;
            s->usable[q] = 0;
            memset(s->color + 4 * q, 0, 4);
            if (x < 0 || y < 0) continue;
            const int px = x / TXI_UNIT, py = y / TXI_UNIT;
            if (px < TXI_EDGE || py < TXI_EDGE || px >= l->width - TXI_EDGE ||
                py >= l->height - TXI_EDGE)
                continue;
            const size_t p = (size_t)py * (size_t)l->width + (size_t)px;
            const int fx = x % TXI_UNIT / (TXI_UNIT / TXI_PHASES);
            const int fy = y % TXI_UNIT / (TXI_UNIT / TXI_PHASES);
            const int taps = l->taps[p];
            if (taps == TXI_TAP_NONE || ((fx || fy) && taps == TXI_TAP_ONE)) continue;
            s->usable[q] = 1;
            if (fx || fy) txi_level_sample(l, p, fx, fy, taps, s->color + 4 * q);
            else memcpy(s->color + 4 * q, l->color + 4 * p, 3);
        }
    }
}

/* Detail of the source's patches, and which may be copied. numbers: 2 per pixel. */
static void txi_source_worth(const txi_level *l, txi_source *s, uint32_t *numbers,
                             int32_t *columns) {
    const size_t n = (size_t)s->width * (size_t)s->height;
    uint32_t *e = numbers, *sums = numbers + n;
    txi_detail(s->color, s->usable, s->width, s->height, columns, e);
    for (size_t q = 0; q < n; q++) { /* the number of usable pixels goes into the high bits */
        const uint64_t limited = e[q] < l->clamp ? e[q] : l->clamp;
        e[q] = (uint32_t)(limited * TXI_WORTH_MOST / l->clamp / TXI_PATCH_AREA);
        if (s->usable[q]) e[q] += 1u << 20;
    }
    txi_patch_sums(e, s->width, s->height, (uint32_t *)(void *)columns, sums);
    for (size_t q = 0; q < n; q++)
        s->worth[q] =
            (uint16_t)(sums[q] >> 20 == TXI_PATCH_AREA
                           ? 1 + ((sums[q] & 0xfffff) < 65534 ? (sums[q] & 0xfffff) : 65534)
                           : 0);
}

/* One source per call of the body. Each has its own scratch memory, allocated before. */
typedef struct txi_sources_task {
    txi_level *level;
    int pose[TXI_MAX_POSES];
    uint32_t *numbers[TXI_MAX_POSES];
    int32_t *columns[TXI_MAX_POSES];
} txi_sources_task;

static void txi_sources_body(void *context, int index) {
    const txi_sources_task *t = (const txi_sources_task *)context;
    txi_source *s = &t->level->source[t->pose[index]];
    txi_source_draw(t->level, s);
    txi_source_worth(t->level, s, t->numbers[index], t->columns[index]);
}

/* Make those sources of a level whose wanted[pose] is not 0 and that are not there yet. */
static int txi_level_sources(txi_level *l, int is_picture, int pose_count, const uint8_t *wanted,
                             txm_arena *arena, txm_env *env) {
    txi_sources_task task;
    txm_arena scratch;
    int count = 0;
    txm_arena_init(&scratch, env);
    memset(&task, 0, sizeof task);
    task.level = l;
    for (int pose = 0; pose < pose_count; pose++) {
        txi_source *s = &l->source[pose];
        if (!wanted[pose] || s->color) continue;
        txi_pose_axes(is_picture, pose, s);
        txi_source_size(s, l);
        const size_t n = (size_t)s->width * (size_t)s->height;
        s->color = (uint8_t *)txm_arena_alloc(arena, n, 4);
        s->usable = (uint8_t *)txm_arena_alloc(arena, n, 1);
        s->worth = (uint16_t *)txm_arena_alloc(arena, n, sizeof(uint16_t));
        TXM_ASSERT(count < TXI_MAX_POSES);
        task.pose[count] = pose;
        task.numbers[count] = (uint32_t *)txm_arena_alloc(&scratch, n, 2 * sizeof(uint32_t));
        task.columns[count++] =
            (int32_t *)txm_arena_alloc(&scratch, (size_t)s->width, 4 * sizeof(int32_t));
        l->built[l->built_count++] = pose;
    }
    const int ok = !arena->failed && !scratch.failed;
    if (ok) txm_parallel_for(env, count, txi_sources_body, &task);
    for (int k = 0; k < count && !ok; k++) { /* as before, for another try */
        l->source[task.pose[k]].color = NULL;
        l->built_count--;
    }
    txm_arena_free(&scratch);
    return ok;
}

/* patches that may be copied from a source */
static int txi_source_patches(const txi_source *s) {
    int count = 0;
    const size_t n = (size_t)s->width * (size_t)s->height;
    for (size_t q = 0; q < n; q++) count += s->worth[q] != 0;
    return count;
}

/* ---- matches --------------------------------------------------------------------------------- */

enum {
    TXI_BAND = 16,       /* rows of anchors or pixels that are worked on one after the other   */
    TXI_MEND = 4,        /* pixels: how far a match that cannot be copied may be moved; ours   */
    TXI_ANY_TRIES = 100, /* random patches, before all are gone through; ours                 */
    TXI_USE_ONE = 64,    /* of txi_canvas.use: copied once, on average                         */
    TXI_USE_MOST = 16 * TXI_USE_ONE, /* more counts as this                                    */
    TXI_RANDOM_TRIES = 4 /* per anchor and sweep, besides those at falling distances; ours */
};

#define TXI_REPEAT_WEIGHT 1.0 /* of the expected detail of a patch: what each use but the first costs;
                                 see docs/choices.md                                            */

/* Which source patch an anchor's patch is like. */
typedef struct txi_match {
    int16_t x, y; /* upper left corner in the source                                          */
    int16_t pose; /* number of the source; -1: none                                           */
    int16_t spare; /* 0                                                                        */
    uint32_t cost; /* squared differences of a full patch, and what missing detail costs       */
} txi_match;

/* The state of a completion at one level. */
typedef struct txi_canvas {
    const txi_level *level;
    uint8_t *color;   /* 4 per pixel: the level's, and in the hole the current guess         */
    txi_match *match; /* one per anchor                                                      */
    txi_match *old;   /* as it was before the sweep                                          */
    uint16_t *weight; /* of each anchor's vote                                               */
    uint32_t price;   /* of one unit of missing detail, in 1/65536                           */
    uint64_t seed;
    int sweep;  /* counts the sweeps                                                   */
    int fresh;  /* the costs are up to date                                            */
    int radius; /* pixels: where random tries begin                                    */
    uint16_t *use;   /* of each pixel of the level: how often the patch around it is copied, in
                        1/TXI_USE_ONE                                                        */
    int32_t *chosen; /* of each hole pixel: the anchor whose proposal it has, -1: none       */
    int reach;       /* pixels: sources nearer to their target are as if used up to once more */
    uint32_t toll;   /* for each further use of a patch, per unit of expected detail, in 1/65536 */
} txi_canvas;

/* What the missing detail of a source patch costs. */
static inline uint32_t txi_shortfall(const txi_canvas *t, int a, uint32_t worth) {
    const uint32_t want = t->level->want[a];
    return want >= worth ? (uint32_t)(((uint64_t)(want - worth + 1) * t->price) >> 16) : 0;
}

/* where the centre of a source patch lies in the level, in units */
static void txi_match_centre(const txi_source *s, int x, int y, int32_t *cx, int32_t *cy) {
    txi_source_place(s, x, y, cx, cy);
    *cx += (s->a + s->c) * (TXI_PATCH - 1) / 2;
    *cy += (s->b + s->d) * (TXI_PATCH - 1) / 2;
}

/* What a source patch costs because the eye sees that it repeats: for each use but the first, and for
   lying near the place that it is copied to. Relative to the expected detail, so that it counts as
   much in smooth texture as in rough one. */
static uint32_t txi_repeated(const txi_canvas *t, int a, const txi_source *s, int x, int y) {
    const int width = t->level->width, p = t->level->anchor[a], half = TXI_PATCH / 2;
    int32_t cx, cy;
    txi_match_centre(s, x, y, &cx, &cy);
    cx /= TXI_UNIT;
    cy /= TXI_UNIT;
    const int dx = cx - p % width - half, dy = cy - p / width - half;
    const int64_t square = (int64_t)dx * dx + (int64_t)dy * dy;
    const int64_t most = (int64_t)t->reach * t->reach;
    int64_t uses = t->use[cy * width + cx] - TXI_USE_ONE;
    if (uses < 0) uses = 0;
    if (square < most) uses += TXI_USE_ONE * (most - square) / most;
    return (uint32_t)((t->level->want[a] * (uint64_t)uses / TXI_USE_ONE * t->toll) >> 16);
}

/* Cost of the patch (x, y) of a source for anchor a, UINT32_MAX if it cannot be copied or costs
   limit or more. */
static uint32_t txi_cost(const txi_canvas *t, int a, int pose, int x, int y, uint32_t limit) {
    const txi_level *l = t->level;
    const txi_source *s = &l->source[pose];
    if (x < 0 || y < 0 || x > s->width - TXI_PATCH || y > s->height - TXI_PATCH) return UINT32_MAX;
    const size_t q = (size_t)y * (size_t)s->width + (size_t)x, p = (size_t)l->anchor[a];
    const uint32_t worth = s->worth[q];
    if (!worth) return UINT32_MAX;
    const uint32_t short_of = txi_shortfall(t, a, worth), filled = l->filled[a];
    if (short_of >= limit) return UINT32_MAX;
    const uint32_t rest = limit - short_of;
    uint32_t d;
    if (filled == TXI_PATCH_AREA) {
        d = txi_ssd(t->color + 4 * p, 4 * (size_t)l->width, NULL, s->color + 4 * q,
                    4 * (size_t)s->width, rest);
    } else { /* the void part is like the mean of the rest */
        const uint32_t part = txi_ssd(t->color + 4 * p, 4 * (size_t)l->width, l->mask + 4 * p,
                                      s->color + 4 * q, 4 * (size_t)s->width, rest);
        d = part * TXI_PATCH_AREA / filled;
    }
    if (d >= rest) return UINT32_MAX;
    d += short_of + txi_repeated(t, a, s, x, y);
    return d >= limit ? UINT32_MAX : d;
}

/* Take the patch if it is better. */
static inline void txi_try(const txi_canvas *t, int a, int pose, int x, int y, txi_match *best) {
    const uint32_t cost = txi_cost(t, a, pose, x, y, best->cost);
    if (cost >= best->cost) return;
    best->x = (int16_t)x;
    best->y = (int16_t)y;
    best->pose = (int16_t)pose;
    best->cost = cost;
}

/* the patch of a source whose centre is nearest to a place of its level */
static void txi_match_at(const txi_source *s, int32_t cx, int32_t cy, int *x, int *y) {
    txi_source_pixel(s, cx - (s->a + s->c) * (TXI_PATCH - 1) / 2,
                     cy - (s->b + s->d) * (TXI_PATCH - 1) / 2, x, y);
}

/* The same place in another pose. */
static void txi_try_pose(const txi_canvas *t, int a, int pose, txi_match *best) {
    const txi_level *l = t->level;
    int32_t cx, cy;
    int x, y;
    txi_match_centre(&l->source[best->pose], best->x, best->y, &cx, &cy);
    txi_match_at(&l->source[pose], cx, cy, &x, &y);
    txi_try(t, a, pose, x, y, best);
}

/* Some patch that may be copied: random ones, else the first one there is. */
static txi_match txi_match_any(const txi_level *l, txm_rng *rng) {
    txi_match m;
    memset(&m, 0, sizeof m);
    m.cost = UINT32_MAX;
    for (int k = 0; k < TXI_ANY_TRIES; k++) {
        const int pose = l->built[txm_rng_below(rng, (uint32_t)l->built_count)];
        const txi_source *s = &l->source[pose];
        m.pose = (int16_t)pose;
        m.x = (int16_t)txm_rng_below(rng, (uint32_t)s->width);
        m.y = (int16_t)txm_rng_below(rng, (uint32_t)s->height);
        if (s->worth[(size_t)m.y * (size_t)s->width + (size_t)m.x]) return m;
    }
    for (int k = 0; k < l->built_count; k++) {
        const txi_source *s = &l->source[l->built[k]];
        const size_t n = (size_t)s->width * (size_t)s->height;
        for (size_t q = 0; q < n; q++) {
            if (!s->worth[q]) continue;
            m.pose = (int16_t)l->built[k];
            m.x = (int16_t)(q % (size_t)s->width);
            m.y = (int16_t)(q / (size_t)s->width);
            return m;
        }
    }
    m.pose = -1;
    return m;
}

/* ---- search -------------------------------------------------------------------------------------

   One sweep over the anchors [8], forwards or backwards: each tries the matches of the neighbours
   that were there before it, shifted by one pixel, then random patches at falling distances from
   its match, then other poses of the same place and random places. Bands of rows are independent:
   what lies beyond the band is taken as it was before the sweep, so that the result does not
   depend on the threads; the bands are shifted from sweep to sweep.                           */

/* the match of the anchor at pixel p, shifted by (dx, dy), if there is one */
static inline void txi_try_neighbour(const txi_canvas *t, int a, int p, int dx, int dy, int first,
                                     int last, txi_match *best) {
    const int b = t->level->slot[p];
    if (b < 0) return;
    const txi_match *m = b >= first && b < last ? &t->match[b] : &t->old[b];
    if (m->pose >= 0) txi_try(t, a, m->pose, m->x + dx, m->y + dy, best);
}

static void txi_search_anchor(const txi_canvas *t, int a, int first, int last) {
    const txi_level *l = t->level;
    const int p = l->anchor[a], s = t->sweep & 1 ? -1 : 1;
    txi_match best = t->match[a];
    txm_rng rng = txm_rng_make(t->seed + (uint64_t)t->sweep, (uint64_t)a);
    if (best.pose < 0) best = txi_match_any(l, &rng);
    if (!t->fresh || best.cost == UINT32_MAX)
        best.cost = txi_cost(t, a, best.pose, best.x, best.y, UINT32_MAX);
    txi_try_neighbour(t, a, p - s, s, 0, first, last, &best);
    txi_try_neighbour(t, a, p - s * l->width, 0, s, first, last, &best);
    for (int r = t->radius; r >= 1; r /= 2) {
        const int x = best.x + txm_rng_range(&rng, -r, r), y = best.y + txm_rng_range(&rng, -r, r);
        txi_try(t, a, best.pose, x, y, &best);
    }
    for (int k = 0; k < TXI_RANDOM_TRIES; k++) {
        const int pose = l->built[txm_rng_below(&rng, (uint32_t)l->built_count)];
        if (k & 1) {
            if (pose != best.pose) txi_try_pose(t, a, pose, &best);
            continue;
        }
        const txi_source *source = &l->source[pose];
        const int x = (int)txm_rng_below(&rng, (uint32_t)source->width);
        const int y = (int)txm_rng_below(&rng, (uint32_t)source->height);
        txi_try(t, a, pose, x, y, &best);
    }
    t->match[a] = best;
}

static void txi_search_band(void *context, int index) {
    const txi_canvas *t = (const txi_canvas *)context;
    const txi_level *l = t->level;
    const int shift = t->sweep & 2 ? TXI_BAND / 2 : 0;
    const int from = txm_clampi(index * TXI_BAND - shift, 0, l->height);
    const int to = txm_clampi(index * TXI_BAND - shift + TXI_BAND, 0, l->height);
    const int first = l->anchor_row[from], last = l->anchor_row[to];
    for (int k = 0; k < last - first; k++)
        txi_search_anchor(t, t->sweep & 1 ? last - 1 - k : first + k, first, last);
}

static void txi_search(txi_canvas *t, txm_env *env) {
    memcpy(t->old, t->match, (size_t)t->level->anchor_count * sizeof *t->old);
    txm_parallel_for(env, t->level->height / TXI_BAND + 2, txi_search_band, t);
    t->sweep++;
    t->fresh = 1;
}

/* ---- from level to level -------------------------------------------------------------------- */

/* The match of anchor a that the coarser level's match m of the anchor at (cx, cy) means. All
   coordinates in the finer level's pixels are twice those in the coarser one's, plus one half. */
static txi_match txi_match_refine(const txi_level *coarse, const txi_level *fine, int a,
                                  const txi_match *m, int coarse_anchor) {
    txi_match out = *m;
    const txi_source *from = &coarse->source[m->pose];
    const int p = fine->anchor[a];
    /* from the coarse patch's corner to the fine one's centre, in quarters of coarse pixels */
    const int dx =
        2 * (p % fine->width - TXI_EDGE) + 7 - 1 - 4 * (coarse_anchor % coarse->width - TXI_EDGE);
    const int dy =
        2 * (p / fine->width - TXI_EDGE) + 7 - 1 - 4 * (coarse_anchor / coarse->width - TXI_EDGE);
    const int32_t edge = (int32_t)TXI_EDGE * TXI_UNIT;
    int32_t wx, wy;
    txi_source_place(from, m->x, m->y, &wx, &wy);
    wx += from->a / 4 * dx + from->c / 4 * dy;
    wy += from->b / 4 * dx + from->d / 4 * dy;
    wx = 2 * (wx - edge) + TXI_UNIT / 2 + edge;
    wy = 2 * (wy - edge) + TXI_UNIT / 2 + edge;
    int pose = m->pose, x, y;
    if (!fine->source[pose].color) { /* the pose that is turned least against it */
        int64_t most = INT64_MIN;
        for (int k = 0; k < fine->built_count; k++) {
            const txi_source *s = &fine->source[fine->built[k]];
            const int64_t like = (int64_t)s->a * from->a + (int64_t)s->b * from->b +
                                 (int64_t)s->c * from->c + (int64_t)s->d * from->d;
            if (like <= most) continue;
            most = like;
            pose = fine->built[k];
        }
    }
    txi_match_at(&fine->source[pose], wx, wy, &x, &y);
    out.pose = (int16_t)pose;
    out.x = (int16_t)x;
    out.y = (int16_t)y;
    return out;
}

/* is the match a patch that may be copied? */
static int txi_match_holds(const txi_level *l, const txi_match *m) {
    if (m->pose < 0 || !l->source[m->pose].color) return 0;
    const txi_source *s = &l->source[m->pose];
    return m->x >= 0 && m->y >= 0 && m->x < s->width && m->y < s->height &&
           s->worth[(size_t)m->y * (size_t)s->width + (size_t)m->x];
}

/* Move a match to the nearest patch that may be copied, at most TXI_MEND pixels away. */
static int txi_match_mend(const txi_level *l, txi_match *m) {
    for (int r = 0; r <= TXI_MEND; r++) {
        for (int y = -r; y <= r; y++) {
            for (int x = -r; x <= r; x++) {
                txi_match near_one = *m;
                if (x > -r && x < r && y > -r && y < r) continue;
                near_one.x = (int16_t)(m->x + x);
                near_one.y = (int16_t)(m->y + y);
                if (!txi_match_holds(l, &near_one)) continue;
                *m = near_one;
                return 1;
            }
        }
    }
    return 0;
}

/* Matches of a level from those of the next coarser one. */
static void txi_upsample(const txi_level *coarse, const txi_match *from, txi_canvas *t) {
    const txi_level *l = t->level;
    for (int a = 0; a < l->anchor_count; a++) {
        const int p = l->anchor[a];
        /* the coarse patch with the nearest centre, else one next to it: its corner is 2 pixels
           nearer to the centre; 16 / 2 - 8 rounds down where the difference is negative */
        const int x = (p % l->width - TXI_EDGE + 16) / 2 - 8 - 2 + TXI_EDGE;
        const int y = (p / l->width - TXI_EDGE + 16) / 2 - 8 - 2 + TXI_EDGE;
        txm_rng rng = txm_rng_make(t->seed - 1, (uint64_t)a);
        int found = -1;
        for (int r = 0; r <= 4 && found < 0; r++) {
            for (int k = 0; k < (2 * r + 1) * (2 * r + 1) && found < 0; k++) {
                const int qx = x + k % (2 * r + 1) - r, qy = y + k / (2 * r + 1) - r;
                if (qx < 0 || qy < 0 || qx >= coarse->width || qy >= coarse->height) continue;
                const int b = coarse->slot[qy * coarse->width + qx];
                if (b >= 0 && from[b].pose >= 0) found = b;
            }
        }
        txi_match m;
        memset(&m, 0, sizeof m);
        m.pose = -1;
        if (found >= 0) m = txi_match_refine(coarse, l, a, &from[found], coarse->anchor[found]);
        if (m.pose < 0 || !txi_match_mend(l, &m)) m = txi_match_any(l, &rng);
        if (found >= 0) m.cost = from[found].cost;
        t->match[a] = m;
    }
    t->fresh = 0;
}

/* ---- the coarsest level: ring by ring -----------------------------------------------------------

   Patches at the hole's border, of which enough is known, are compared with the source patches
   everywhere; their matches then fill the outermost ring of the hole, and so on. At this
   resolution this is affordable, and random candidates instead would cost the structure.      */

enum {
    TXI_ONION_SHARE = 55,     /* percent of a patch that must be known                           */
    TXI_ONION_FULL = 85,      /* percent from which patches off the lattice are compared, too    */
    TXI_ONION_RING = 2,       /* pixels filled a pass                                            */
    TXI_ONION_BEST = 8,       /* matches that are refined                                        */
    TXI_ONION_SPREAD = 400,   /* squared levels per pixel: at this cost a patch has weight 1 / e */
    TXI_ONION_REACH = 2,      /* pixels of the refinement                                        */
    TXI_ONION_WORK = 3000000, /* comparisons, about                                            */
    TXI_ONION_LEAST = 4000,   /* places compared at least, for up to three times that work       */
    TXI_ONION_FEWEST = 250    /* places compared for any amount of work                          */
};

typedef struct txi_onion {
    const txi_canvas *canvas;
    uint8_t *known;         /* 4 per pixel: 255 where it is known or filled                     */
    const txi_match *place; /* source patches to compare with                                  */
    int place_count;
    int32_t *todo;    /* anchors of this pass                                             */
    txi_match *found; /* of each anchor of the level; cost as of a full patch             */
    int todo_count;
} txi_onion;

/* As txi_cost, over the pixels known so far. */
static uint32_t txi_onion_cost(const txi_onion *o, int a, int known, int pose, int x, int y,
                               uint32_t limit) {
    const txi_canvas *t = o->canvas;
    const txi_level *l = t->level;
    const txi_source *s = &l->source[pose];
    if (x < 0 || y < 0 || x >= s->width || y >= s->height) return UINT32_MAX;
    const size_t q = (size_t)y * (size_t)s->width + (size_t)x, p = (size_t)l->anchor[a];
    if (!s->worth[q]) return UINT32_MAX;
    const uint32_t short_of = txi_shortfall(t, a, s->worth[q]);
    if (short_of >= limit) return UINT32_MAX;
    const uint32_t rest = limit - short_of;
    const uint32_t most = (uint32_t)((uint64_t)rest * (uint32_t)known / TXI_PATCH_AREA);
    const uint32_t d = txi_ssd(t->color + 4 * p, 4 * (size_t)l->width, o->known + 4 * p,
                               s->color + 4 * q, 4 * (size_t)s->width, most);
    if (d > most) return UINT32_MAX;
    const uint32_t full = d * TXI_PATCH_AREA / (uint32_t)known;
    return full >= rest ? UINT32_MAX : full + short_of;
}

static int txi_onion_known(const txi_onion *o, int p) {
    const int w = o->canvas->level->width;
    int known = 0;
    for (int k = 0; k < TXI_PATCH_AREA; k++)
        known += o->known[4 * (size_t)(p + k / TXI_PATCH * w + k % TXI_PATCH)] != 0;
    return known;
}

/* Keep the best few, the worst last. */
static void txi_onion_keep(txi_match *best, const txi_match *m, uint32_t cost) {
    int k = TXI_ONION_BEST - 1;
    for (; k > 0 && best[k - 1].cost > cost; k--) best[k] = best[k - 1];
    best[k] = *m;
    best[k].cost = cost;
}

/* Compare an anchor's patch with all places, then with the neighbours of the best in all poses. */
static void txi_onion_anchor(void *context, int index) {
    const txi_onion *o = (const txi_onion *)context;
    const txi_level *l = o->canvas->level;
    const int a = o->todo[index], known = txi_onion_known(o, l->anchor[a]);
    txi_match best[TXI_ONION_BEST], top;
    memset(best, 0, sizeof best);
    for (int k = 0; k < TXI_ONION_BEST; k++) {
        best[k].cost = UINT32_MAX;
        best[k].pose = -1;
    }
    for (int k = 0; k < o->place_count; k++) {
        const txi_match *m = &o->place[k];
        const uint32_t cost =
            txi_onion_cost(o, a, known, m->pose, m->x, m->y, best[TXI_ONION_BEST - 1].cost);
        if (cost < best[TXI_ONION_BEST - 1].cost) txi_onion_keep(best, m, cost);
    }
    top = best[0];
    for (int k = 0; k < TXI_ONION_BEST && best[k].pose >= 0; k++) {
        for (int i = 0; i < l->built_count; i++) {
            const txi_source *s = &l->source[l->built[i]];
            const int reach = l->built[i] == best[k].pose ? TXI_ONION_REACH : 0;
            int32_t cx, cy;
            int x0, y0;
            txi_match_centre(&l->source[best[k].pose], best[k].x, best[k].y, &cx, &cy);
            txi_match_at(s, cx, cy, &x0, &y0);
            for (int y = y0 - reach; y <= y0 + reach; y++) {
                for (int x = x0 - reach; x <= x0 + reach; x++) {
                    const uint32_t cost = txi_onion_cost(o, a, known, l->built[i], x, y, top.cost);
                    if (cost >= top.cost) continue;
                    top.cost = cost;
                    top.pose = (int16_t)l->built[i];
                    top.x = (int16_t)x;
                    top.y = (int16_t)y;
                }
            }
        }
    }
    o->found[a] = top;
}

/* Mark the next pixels to fill in ring: those at most TXI_ONION_RING from what is known. */
static int txi_onion_ring(const txi_onion *o, uint8_t *ring) {
    const txi_level *l = o->canvas->level;
    const int w = l->width;
    int count = 0;
    for (int i = 0; i < l->hole_count; i++) {
        const int p = l->hole[i];
        ring[p] = 0;
        if (o->known[4 * (size_t)p]) continue;
        for (int y = -TXI_ONION_RING; y <= TXI_ONION_RING && !ring[p]; y++)
            for (int x = -TXI_ONION_RING; x <= TXI_ONION_RING; x++)
                ring[p] |= o->known[4 * (size_t)(p + y * w + x)] != 0;
        count += ring[p];
    }
    return count;
}

/* The anchors of this pass: they cover a pixel of the ring, and enough of them is known. */
static void txi_onion_list(txi_onion *o, const uint8_t *ring, int share) {
    const txi_level *l = o->canvas->level;
    o->todo_count = 0;
    for (int a = 0; a < l->anchor_count; a++) {
        const int p = l->anchor[a], known = txi_onion_known(o, p);
        const int lattice = (p % l->width) % 2 == 0 && (p / l->width) % 2 == 0;
        const int most = known * 100 / l->filled[a];
        if (known == 0 || most < (lattice ? share : TXI_ONION_FULL)) continue;
        int covers = 0;
        for (int k = 0; !covers && k < TXI_PATCH_AREA; k++)
            covers = ring[p + k / TXI_PATCH * l->width + k % TXI_PATCH];
        if (!covers) continue;
        TXM_ASSERT(o->todo_count < l->anchor_count);
        o->todo[o->todo_count++] = a;
    }
}

/* Fill the ring's pixels that a patch of this pass covers; returns their number. */
static int txi_onion_fill(const txi_onion *o, const uint8_t *ring, uint8_t *current) {
    const txi_canvas *t = o->canvas;
    const txi_level *l = t->level;
    int filled = 0;
    memset(current, 0, (size_t)l->anchor_count);
    for (int k = 0; k < o->todo_count; k++) current[o->todo[k]] = o->found[o->todo[k]].pose >= 0;
    for (int i = 0; i < l->hole_count; i++) {
        const int p = l->hole[i];
        const uint8_t *color[TXI_PATCH_AREA];
        double weight[TXI_PATCH_AREA], sum[3] = {0, 0, 0}, total = 0;
        int n = 0;
        for (int k = 0; ring[p] && k < TXI_PATCH_AREA; k++) {
            const int y = k / TXI_PATCH, x = k % TXI_PATCH, a = l->slot[p - y * l->width - x];
            if (a < 0 || !current[a]) continue;
            const txi_match *m = &o->found[a];
            const txi_source *s = &l->source[m->pose];
            color[n] = s->color + 4 * ((size_t)(m->y + y) * (size_t)s->width + (size_t)(m->x + x));
            const double fit = m->cost / ((double)TXI_ONION_SPREAD * (double)TXI_PATCH_AREA);
            weight[n] = txm_exp2(-(fit < 500 ? fit : 500) * TXI_LOG2_E) + 1e-30;
            total += weight[n];
            for (int c = 0; c < 3; c++) sum[c] += weight[n] * color[n][c];
            n++;
        }
        double least = 1e30;
        for (int k = 0; k < n; k++) {
            double d = 0;
            for (int c = 0; c < 3; c++) {
                const double off = color[k][c] - sum[c] / total;
                d += off * off;
            }
            if (d >= least) continue;
            least = d;
            memcpy(t->color + 4 * (size_t)p, color[k], 3);
        }
        if (!n) continue;
        TXM_ASSERT(filled < l->hole_count);
        o->todo[l->anchor_count + filled++] = p;
    }
    for (int k = 0; k < filled; k++)
        memset(o->known + 4 * (size_t)o->todo[l->anchor_count + k], 255, 4);
    return filled;
}

/* The source patches to compare with: every step-th, so that the work is limited. */
static int txi_onion_places(const txi_level *l, txi_match *place, int most) {
    int total = 0, count = 0, at = 0;
    for (int k = 0; k < l->built_count; k++) total += txi_source_patches(&l->source[l->built[k]]);
    for (int k = 0; k < l->built_count; k++) {
        const txi_source *s = &l->source[l->built[k]];
        for (int q = 0; q < s->width * s->height; q++) {
            if (!s->worth[q]) continue;
            /* the i-th of total is taken if the whole part of i most / total grows */
            const int64_t i = at++;
            if (total > most && i * most / total == (i + 1) * most / total) continue;
            if (count == most) break;
            memset(&place[count], 0, sizeof place[count]);
            place[count].pose = (int16_t)l->built[k];
            place[count].x = (int16_t)(q % s->width);
            place[count++].y = (int16_t)(q / s->width);
        }
    }
    return count;
}

/* Matches of the anchors that had none: those of the nearest anchor that has one, shifted. */
static void txi_onion_rest(const txi_onion *o, txi_canvas *t) {
    const txi_level *l = t->level;
    for (int a = 0; a < l->anchor_count; a++) {
        const int p = l->anchor[a];
        txi_match best = o->found[a];
        for (int r = 1; best.pose < 0 && r <= 3; r++) {
            for (int k = 0; best.pose < 0 && k < (2 * r + 1) * (2 * r + 1); k++) {
                const int dx = k % (2 * r + 1) - r, dy = k / (2 * r + 1) - r;
                const int x = p % l->width + dx, y = p / l->width + dy;
                if (x < 0 || y < 0 || x >= l->width || y >= l->height) continue;
                const int b = l->slot[y * l->width + x];
                if (b < 0 || o->found[b].pose < 0) continue;
                txi_match m = o->found[b];
                m.x = (int16_t)(m.x - dx);
                m.y = (int16_t)(m.y - dy);
                if (txi_match_holds(l, &m)) best = m;
            }
        }
        t->match[a] = best;
    }
    t->fresh = 0;
}

/* Fill the hole of the coarsest level, and give its anchors matches. */
static txm_status txi_onion_peel(txi_canvas *t, txm_env *env) {
    const txi_level *l = t->level;
    const size_t n = (size_t)l->width * (size_t)l->height, anchors = (size_t)l->anchor_count;
    /* a hole that is long and thin has many anchors even at the coarsest level                   */
    const int share_of_work = TXI_ONION_WORK / (l->anchor_count / 2 + 1);
    int most = 3 * share_of_work;
    if (most > TXI_ONION_LEAST) most = TXI_ONION_LEAST;
    if (most < share_of_work) most = share_of_work;
    if (most < TXI_ONION_FEWEST) most = TXI_ONION_FEWEST;
    txm_arena scratch;
    txi_onion o;
    txm_status status = TXM_OK;
    txm_arena_init(&scratch, env);
    memset(&o, 0, sizeof o);
    o.canvas = t;
    o.known = (uint8_t *)txm_arena_zero(&scratch, n, 4);
    o.todo = (int32_t *)txm_arena_alloc(&scratch, anchors + (size_t)l->hole_count, sizeof(int32_t));
    o.found = (txi_match *)txm_arena_zero(&scratch, anchors, sizeof(txi_match));
    uint8_t *ring = (uint8_t *)txm_arena_zero(&scratch, n, 1);
    uint8_t *current = (uint8_t *)txm_arena_zero(&scratch, anchors, 1);
    txi_match *place = (txi_match *)txm_arena_alloc(&scratch, (size_t)most, sizeof(txi_match));
    if (scratch.failed) {
        txm_arena_free(&scratch);
        return txi_no_memory(env);
    }
    o.place = place;
    o.place_count = txi_onion_places(l, place, most);
    for (size_t a = 0; a < anchors; a++) o.found[a].pose = -1;
    for (size_t p = 0; p < n; p++) {
        if (l->state[p] == TXI_KNOWN || l->state[p] == TXI_FOREIGN) memset(o.known + 4 * p, 255, 4);
    }
    int share = TXI_ONION_SHARE;
    while (status == TXM_OK && txi_onion_ring(&o, ring) > 0) {
        txi_onion_list(&o, ring, share);
        txm_parallel_for(env, o.todo_count, txi_onion_anchor, &o);
        if (txi_onion_fill(&o, ring, current) == 0) {
            if (share <= 0) break; /* what is left is surrounded by void */
            share = share > 10 ? share - 10 : 0;
        }
        if (txm_progress(env, 0, "matching")) status = txi_stopped(env);
    }
    txi_onion_rest(&o, t);
    txm_arena_free(&scratch);
    return status;
}

/* ---- the coarsest level: annealed labelling -----------------------------------------------------

   Patches on a lattice of half their side cover the hole; each has a label, the source patch that
   it shows. The labelling of largest probability [1, III.B]

       P(Psi | W) P(W)                                                                      (5)
       P(Psi | W) ~ exp(- sum over patches: D(p(x), known part) / (2 sigma(x)^2))           (6)
       P(W) ~ exp(- sum over overlapping pairs: D(p(x), p(y)) / (2 sigma(x, y)^2))          (7)

   is sought by simulated annealing with Metropolis moves. sigma^2 is the context: the detail that
   is expected of a patch per pixel (detail.h), so that rough texture may differ more. Missing
   detail counts under (6), as everywhere else. The start is the onion's result, not a random
   labelling: from a random one the structure is not found in reasonable time. Moves propose a
   neighbour's label (shifted), the own one nearby, or any; they are not weighted for symmetry, as
   only the maximum is
   wanted.                                                                                     */

enum {
    TXI_ANNEAL_STEP = TXI_PATCH / 2, /* pixels between patches                                 */
    TXI_ANNEAL_MOVES = 600, /* per patch                                                       */
    TXI_ANNEAL_PAIRS = 8    /* patches that a patch overlaps                                   */
};
#define TXI_ANNEAL_HOT 6.0 /* the first temperature, in units of the exponents of (6) and (7)     */
#define TXI_ANNEAL_FALL (-2.9957322735539913) /* ln(0.3 / HOT): the last temperature is 0.3. Not
                               computed, as C libraries differ in the last bit                 */

typedef struct txi_site {
    int anchor;
    int pair[TXI_ANNEAL_PAIRS]; /* the site in each direction, -1: none                        */
    double precision;           /* 1 / (2 sigma^2)                                             */
    txi_match match;
} txi_site;

/* directions of neighbours: the step in x and in y */
static int txi_anneal_dx(int k) {
    return ((k < 4 ? k : k + 1) % 3 - 1) * TXI_ANNEAL_STEP;
}
static int txi_anneal_dy(int k) {
    return ((k < 4 ? k : k + 1) / 3 - 1) * TXI_ANNEAL_STEP;
}

/* D of (7): what two labels differ by where their patches, (dx, dy) apart, overlap. */
static uint32_t txi_anneal_overlap(const txi_level *l, const txi_match *a, const txi_match *b,
                                   int dx, int dy) {
    const txi_source *s = &l->source[a->pose], *t = &l->source[b->pose];
    const int x0 = dx > 0 ? dx : 0, y0 = dy > 0 ? dy : 0;
    const int w = TXI_PATCH - (dx > 0 ? dx : -dx), h = TXI_PATCH - (dy > 0 ? dy : -dy);
    uint32_t sum = 0;
    for (int y = y0; y < y0 + h; y++) {
        const uint8_t *u =
            s->color + 4 * ((size_t)(a->y + y) * (size_t)s->width + (size_t)(a->x + x0));
        const uint8_t *v =
            t->color + 4 * ((size_t)(b->y + y - dy) * (size_t)t->width + (size_t)(b->x + x0 - dx));
        for (int i = 0; i < 4 * w; i++) {
            const int d = u[i] - v[i];
            sum += (uint32_t)(d * d);
        }
    }
    return sum;
}

/* The exponents of a site with a label. known: mask of what the hole does not cover. */
static double txi_anneal_energy(const txi_canvas *t, const txi_site *sites, int i,
                                const txi_match *m, const uint8_t *known) {
    const txi_level *l = t->level;
    const txi_site *site = &sites[i];
    const txi_source *s = &l->source[m->pose];
    const size_t q = (size_t)m->y * (size_t)s->width + (size_t)m->x;
    const size_t p = (size_t)l->anchor[site->anchor];
    const double data = (double)txi_ssd(l->color + 4 * p, 4 * (size_t)l->width, known + 4 * p,
                                        s->color + 4 * q, 4 * (size_t)s->width, UINT32_MAX) +
                        txi_shortfall(t, site->anchor, s->worth[q]);
    double sum = data * site->precision;
    for (int k = 0; k < TXI_ANNEAL_PAIRS; k++) {
        if (site->pair[k] < 0) continue;
        const txi_site *other = &sites[site->pair[k]];
        const double d =
            txi_anneal_overlap(l, m, &other->match, txi_anneal_dx(k), txi_anneal_dy(k));
        sum += d * 0.5 * (site->precision + other->precision);
    }
    return sum;
}

/* A proposal for a site; 0: it cannot be copied. */
static int txi_anneal_propose(const txi_level *l, const txi_site *sites, int i, txm_rng *rng,
                              txi_match *m) {
    const uint32_t kind = txm_rng_below(rng, 4);
    *m = sites[i].match;
    if (kind < 2) {
        const int k = (int)txm_rng_below(rng, TXI_ANNEAL_PAIRS), j = sites[i].pair[k];
        if (j < 0) return 0;
        *m = sites[j].match;
        m->x = (int16_t)(m->x - txi_anneal_dx(k));
        m->y = (int16_t)(m->y - txi_anneal_dy(k));
    } else if (kind == 2) {
        m->x = (int16_t)(m->x + txm_rng_range(rng, -2, 2));
        m->y = (int16_t)(m->y + txm_rng_range(rng, -2, 2));
    } else {
        *m = txi_match_any(l, rng);
    }
    return txi_match_holds(l, m);
}

/* The lattice's sites, in the order of their anchors; returns their number. */
static int txi_anneal_sites(const txi_canvas *t, txi_site *sites, int32_t *at) {
    const txi_level *l = t->level;
    const double unit = (double)l->clamp * (double)TXI_PATCH_AREA / (double)TXI_WORTH_MOST;
    int count = 0;
    for (int p = 0; p < l->width * l->height; p++) {
        const int a = l->slot[p];
        at[p] = -1;
        if (a < 0 || p % l->width % TXI_ANNEAL_STEP || p / l->width % TXI_ANNEAL_STEP ||
            !txi_match_holds(l, &t->match[a]))
            continue;
        sites[count].anchor = a;
        sites[count].match = t->match[a];
        sites[count].precision = 0.5 / (l->want[a] * unit / (double)TXI_PATCH_AREA + 16);
        at[p] = count++;
    }
    for (int i = 0; i < count; i++) {
        const int p = l->anchor[sites[i].anchor];
        for (int k = 0; k < TXI_ANNEAL_PAIRS; k++) {
            const int x = p % l->width + txi_anneal_dx(k), y = p / l->width + txi_anneal_dy(k);
            sites[i].pair[k] =
                x < 0 || y < 0 || x >= l->width || y >= l->height ? -1 : at[y * l->width + x];
        }
    }
    return count;
}

/* The sites' labels become the matches of all anchors, and the colours of the hole. */
static void txi_anneal_apply(txi_canvas *t, const txi_site *sites, const int32_t *at) {
    const txi_level *l = t->level;
    for (int a = 0; a < l->anchor_count; a++) {
        const int p = l->anchor[a], half = TXI_ANNEAL_STEP / 2;
        const int x = p % l->width, y = p / l->width;
        const int sx = (x + half) / TXI_ANNEAL_STEP * TXI_ANNEAL_STEP;
        const int sy = (y + half) / TXI_ANNEAL_STEP * TXI_ANNEAL_STEP;
        const int i = sx < l->width && sy < l->height ? at[sy * l->width + sx] : -1;
        if (i < 0) continue;
        txi_match m = sites[i].match;
        const txi_source *s = &l->source[m.pose];
        m.x = (int16_t)(m.x + x - sx);
        m.y = (int16_t)(m.y + y - sy);
        if (txi_match_holds(l, &m)) t->match[a] = m;
        /* the pixel in the middle of the anchor's patch, as the site's patch shows it */
        const int u = x + TXI_PATCH / 2, v = y + TXI_PATCH / 2;
        const size_t q = (size_t)(sites[i].match.y + v - sy) * (size_t)s->width +
                         (size_t)(sites[i].match.x + u - sx);
        if (l->state[v * l->width + u] == TXI_HOLE)
            memcpy(t->color + 4 * (size_t)(v * l->width + u), s->color + 4 * q, 3);
    }
    t->fresh = 0;
}

/* Improve the onion's labelling of the coarsest level. */
static txm_status txi_anneal_labels(txi_canvas *t, txm_env *env) {
    const txi_level *l = t->level;
    const size_t n = (size_t)l->width * (size_t)l->height;
    txm_arena scratch;
    txm_arena_init(&scratch, env);
    txi_site *sites =
        (txi_site *)txm_arena_alloc(&scratch, (size_t)l->anchor_count, sizeof(txi_site));
    int32_t *at = (int32_t *)txm_arena_alloc(&scratch, n, sizeof(int32_t));
    uint8_t *known = (uint8_t *)txm_arena_zero(&scratch, n, 4);
    txm_status status = scratch.failed ? txi_no_memory(env) : TXM_OK;
    const int count = status == TXM_OK ? txi_anneal_sites(t, sites, at) : 0;
    for (size_t p = 0; p < n && count; p++) {
        if (l->state[p] == TXI_KNOWN || l->state[p] == TXI_FOREIGN) memset(known + 4 * p, 255, 4);
    }
    txm_rng rng = txm_rng_make(t->seed, 4242);
    const int moves = TXI_ANNEAL_MOVES;
    double heat = TXI_ANNEAL_HOT;
    const double cool = txm_exp2(TXI_ANNEAL_FALL / moves * TXI_LOG2_E);
    for (int round = 0; round < moves && count && status == TXM_OK; round++, heat *= cool) {
        for (int k = 0; k < count; k++) {
            const int i = (int)txm_rng_below(&rng, (uint32_t)count);
            txi_match m;
            if (!txi_anneal_propose(l, sites, i, &rng, &m)) continue;
            const double rise = txi_anneal_energy(t, sites, i, &m, known) -
                                txi_anneal_energy(t, sites, i, &sites[i].match, known);
            const double power = rise / heat * TXI_LOG2_E;
            if (rise > 0 && (power > 60 || txm_rng_double(&rng) >= txm_exp2(-power))) continue;
            sites[i].match = m;
        }
        if (round % 64 == 0 && txm_progress(env, 0, "annealing")) status = txi_stopped(env);
    }
    if (status == TXM_OK && count) txi_anneal_apply(t, sites, at);
    txm_arena_free(&scratch);
    return status;
}

/* ---- votes --------------------------------------------------------------------------------------

   Each hole pixel is covered by up to 64 patches, whose matches propose a colour. Their weighted
   mean is found, once more with smaller weights for those far from it, and then not the mean but
   the proposal nearest to it is taken, so that nothing is averaged.                           */

enum {
    TXI_WEIGHT_ONE = 4095, /* largest weight of a match                                       */
    TXI_OUTLIER_BINS = 2048,
    TXI_BALLOT_SCRATCH = 3
};

/* Weights exp(-cost / (2 s)) exp(-fade * depth), s = 0.2 times the 75th percentile of the costs. */
static void txi_weigh(txi_canvas *t, double fade, txm_pair *pairs, txm_pair *scratch) {
    const txi_level *l = t->level;
    const size_t n = (size_t)l->anchor_count;
    for (size_t a = 0; a < n; a++) {
        pairs[a].key = t->match[a].cost;
        pairs[a].value = (uint32_t)a;
    }
    txm_sort_pairs(pairs, scratch, n);
    const size_t percentile = n - 1 - (n - 1) / 4;
    const double s = 0.2 * pairs[percentile].key + 1;
    for (size_t a = 0; a < n; a++) {
        const int centre = l->anchor[a] + (TXI_PATCH / 2) * (l->width + 1);
        const double x = t->match[a].cost / (2 * s) + fade * l->depth[centre];
        const double w = x > 12 ? 0 : (double)TXI_WEIGHT_ONE * txm_exp2(-x * TXI_LOG2_E);
        t->weight[a] = (uint16_t)(1 + (int)w);
    }
}

/* What all pixels of a vote share. */
typedef struct txi_ballot {
    txi_canvas *canvas;
    int pull;        /* strength of the plan's strips, 0..256                         */
    uint32_t *scratch; /* TXI_BALLOT_SCRATCH per pixel of the level                         */
    const uint16_t *outlier; /* 4095 (d / 16 + 1)^-0.6 for d = 96 k, a squared distance       */
} txi_ballot;

static void txi_outlier_table(uint16_t *table) {
    for (int k = 0; k < TXI_OUTLIER_BINS; k++)
        table[k] = (uint16_t)(1 + (int)(4094 * pow(1 + 96.0 * k / 16, -0.6)));
}

/* A proposal for a pixel. */
typedef struct txi_proposal {
    const uint8_t *color;
    int anchor;
} txi_proposal;

/* the proposals for pixel p; returns their number */
static int txi_proposals(const txi_canvas *t, int p, txi_proposal *list) {
    const txi_level *l = t->level;
    int count = 0;
    for (int y = 0; y < TXI_PATCH; y++) {
        const int32_t *row = l->slot + p - y * l->width;
        for (int x = 0; x < TXI_PATCH; x++) {
            const int a = row[-x];
            if (a < 0 || t->match[a].pose < 0) continue;
            const txi_match *m = &t->match[a];
            const txi_source *s = &l->source[m->pose];
            list[count].color =
                s->color + 4 * ((size_t)(m->y + y) * (size_t)s->width + (size_t)(m->x + x));
            TXM_ASSERT(count < TXI_PATCH_AREA);
            list[count++].anchor = a;
        }
    }
    return count;
}

static int txi_color_distance(const uint8_t *a, const int *b) {
    const int r = a[0] - b[0], g = a[1] - b[1], u = a[2] - b[2];
    return r * r + g * g + u * u;
}

static int txi_vote_pixel(const txi_ballot *v, int p) {
    const txi_canvas *t = v->canvas;
    txi_proposal list[TXI_PATCH_AREA];
    const int n = txi_proposals(t, p, list);
    if (n <= 0) return -1;
    int mean[3] = {0, 0, 0};
    for (int pass = 0; pass < 2; pass++) {
        uint64_t sum[3] = {0, 0, 0}, total = 0;
        for (int k = 0; k < n; k++) {
            uint32_t w = t->weight[list[k].anchor];
            if (pass) {
                const int bin = txi_color_distance(list[k].color, mean) / 96;
                w *= v->outlier[bin < TXI_OUTLIER_BINS ? bin : TXI_OUTLIER_BINS - 1];
            }
            total += w;
            for (int c = 0; c < 3; c++) sum[c] += (uint64_t)w * list[k].color[c];
        }
        if (total == 0) return -1; /* not so: no weight is 0 */
        for (int c = 0; c < 3; c++) mean[c] = (int)((sum[c] + total / 2) / total);
    }
    const int pull = t->level->pull ? t->level->pull[p] * v->pull / 256 : 0;
    const uint8_t *strip = pull ? t->level->strip + 4 * (size_t)p : NULL;
    uint8_t *out = t->color + 4 * (size_t)p;
    for (int c = 0; c < 3 && pull; c++) mean[c] += (strip[c] - mean[c]) * pull / 255;
    int64_t best = INT64_MAX;
    int chosen = -1;
    for (int k = 0; k < n; k++) {
        /* in tenths: 10 d^2 + cost per pixel */
        const int64_t d = (int64_t)10 * txi_color_distance(list[k].color, mean) +
                          t->match[list[k].anchor].cost / TXI_PATCH_AREA;
        if (d >= best) continue;
        best = d;
        chosen = list[k].anchor;
        memcpy(out, list[k].color, 3);
    }
    if (pull >= 128) memcpy(out, strip, 3); /* the strip itself */
    return chosen;
}

static void txi_vote_band(void *context, int index) {
    const txi_ballot *v = (const txi_ballot *)context;
    const txi_level *l = v->canvas->level;
    const int from = txm_clampi(index * TXI_BAND, 0, l->height);
    const int to = txm_clampi(index * TXI_BAND + TXI_BAND, 0, l->height);
    for (int i = l->hole_row[from]; i < l->hole_row[to]; i++) {
        const int chosen = txi_vote_pixel(v, l->hole[i]);
        v->canvas->chosen[i] = chosen;
    }
}

/* Count how often what surrounds each pixel of the level is copied. */
static void txi_count_use(const txi_ballot *v) {
    const txi_canvas *t = v->canvas;
    const txi_level *l = t->level;
    const int w = l->width, half = TXI_PATCH / 2;
    const size_t n = (size_t)w * (size_t)l->height;
    uint32_t *count = v->scratch, *sums = count + n, *columns = sums + n;
    memset(count, 0, n * sizeof *count);
    for (int i = 0; i < l->hole_count; i++) {
        if (t->chosen[i] < 0) continue;
        const txi_match *m = &t->match[t->chosen[i]];
        const int corner = l->anchor[t->chosen[i]], p = l->hole[i];
        int32_t x, y;
        txi_source_place(&l->source[m->pose], m->x + p % w - corner % w, m->y + p / w - corner / w,
                         &x, &y);
        count[(y + TXI_UNIT / 2) / TXI_UNIT * w + (x + TXI_UNIT / 2) / TXI_UNIT] += TXI_USE_ONE;
    }
    txi_patch_sums(count, w, l->height, columns, sums);
    for (int y = half; y < l->height; y++) {
        for (int x = half; x < w; x++) {
            const uint32_t use = sums[(y - half) * w + x - half] / TXI_PATCH_AREA;
            t->use[y * w + x] = (uint16_t)(use < (uint32_t)TXI_USE_MOST ? use : (uint32_t)TXI_USE_MOST);
        }
    }
}

/* Replace the hole's colours by a vote. */
static void txi_vote(txi_ballot *v, txm_env *env) {
    txm_parallel_for(env, v->canvas->level->height / TXI_BAND + 1, txi_vote_band, v);
    txi_count_use(v);
    v->canvas->fresh = 0;
}

/* ---- pieces -----------------------------------------------------------------------------------

   Each hole pixel gets a label: the source, and the offset from the target to it. Pixels of equal
   labels are one piece, copied as it is. The labels minimise

       sum over pairs of neighbours p, q with labels A != B:
           |A(p) - B(p)|^2 + |A(q) - B(q)|^2 + joint
     + sum over pixels:  drift * |A(p) - color(p)|^2 + (difference of the guides)^2

   where A(p) is the colour that A copies to p. At the rim of the hole q is known, and the first
   term is rim * |A(q) - known(q)|^2; where a pixel is partly known, |A(p) - known(p)|^2 is added,
   share times. This is minimised by expansion moves [7]: one label at a time, a minimum cut finds
   the best set of pixels that change to it. */

enum {
    TXI_JOINT = 40,       /* ours                                                              */
    TXI_DRIFT = 5,        /* drift, in 1/256: from the vote's colours; ours                      */
    TXI_JOINT_RIM = 2,    /* weight of a joint with what is known; ours                        */
    TXI_JOINT_SHARE = 4,  /* ... and of what is known of the pixel itself; ours                */
    TXI_NOWHERE = 400000, /* what a neighbour costs that a label cannot copy; ours             */
    TXI_NEVER = 20000000, /* what a pixel costs that a label cannot copy; ours                 */
    TXI_LABEL_NONE = -1,  /* not in the hole                                                   */
    TXI_LABEL_STRIP = -2, /* copied by the plan                                                */
    TXI_LABEL_BITS = 13,  /* of an offset: TXI_SIDE_MOST and the edges of a level fit          */
    TXI_LABEL_BIAS = 1 << (TXI_LABEL_BITS - 1),
    TXI_LABEL_MASK = (1 << TXI_LABEL_BITS) - 1
};

/* Labels as numbers: pose * 2^26 + (x offset + bias) * 2^13 + y offset + bias. */
static inline int32_t txi_label(int pose, int dx, int dy) {
    return pose << 2 * TXI_LABEL_BITS | (dx + TXI_LABEL_BIAS) << TXI_LABEL_BITS |
           (dy + TXI_LABEL_BIAS);
}
static inline int txi_label_pose(int32_t label) {
    return label >> 2 * TXI_LABEL_BITS;
}
static inline int txi_label_dx(int32_t label) {
    return (label >> TXI_LABEL_BITS & TXI_LABEL_MASK) - TXI_LABEL_BIAS;
}
static inline int txi_label_dy(int32_t label) {
    return (label & TXI_LABEL_MASK) - TXI_LABEL_BIAS;
}

typedef struct txi_assembly {
    const txi_level *level;
    const uint8_t *color; /* of the canvas                                                     */
    const txi_window *window; /* of the level; NULL: no pixel is known in part                 */
    int32_t *label;       /* one per pixel of the level                                        */
    txm_flow flow;        /* room for all pixels of the hole's bounding box with a margin      */
    int32_t *node;        /* one per pixel of the level: its node in the flow, -1: not in it   */
    int32_t *region;      /* the pixels of the move                                            */
} txi_assembly;

/* the source pixel that a label copies to pixel (x, y), or NULL: it is not usable */
static inline const uint8_t *txi_label_color(const txi_level *l, int32_t label, int x, int y) {
    if (label < 0) {
        const size_t p = (size_t)y * (size_t)l->width + (size_t)x;
        return label == TXI_LABEL_STRIP && l->pull && l->pull[p] ? l->strip + 4 * p : NULL;
    }
    const txi_source *s = &l->source[txi_label_pose(label)];
    const int i = x + txi_label_dx(label), j = y + txi_label_dy(label);
    if (i < 0 || j < 0 || i >= s->width || j >= s->height) return NULL;
    const size_t q = (size_t)j * (size_t)s->width + (size_t)i;
    return s->usable[q] ? s->color + 4 * q : NULL;
}

static inline int txi_rgb_distance(const uint8_t *a, const uint8_t *b) {
    if (!a || !b) return TXI_NOWHERE;
    const int r = a[0] - b[0], g = a[1] - b[1], u = a[2] - b[2];
    return r * r + g * g + u * u;
}

/* What labels a at (x, y) and b at its neighbour (u, v) cost. */
static inline int txi_joint_cost(const txi_level *l, int32_t a, int32_t b, int x, int y, int u,
                                 int v) {
    if (a == b) return 0;
    return txi_rgb_distance(txi_label_color(l, a, x, y), txi_label_color(l, b, x, y)) +
           txi_rgb_distance(txi_label_color(l, a, u, v), txi_label_color(l, b, u, v)) + TXI_JOINT;
}

/* What a label costs at (x, y) whatever the neighbours in the hole have. */
static int txi_own_cost(const txi_assembly *t, int32_t label, int x, int y) {
    const txi_level *l = t->level;
    const size_t p = (size_t)y * (size_t)l->width + (size_t)x;
    const uint8_t *own = txi_label_color(l, label, x, y);
    if (!own) return TXI_NEVER;
    const int guide = label >= 0 ? own[3] - l->color[4 * p + 3] : 0;
    int cost = txi_rgb_distance(own, t->color + 4 * p) * TXI_DRIFT / 256 + guide * guide;
    if (t->window && t->window->share) {
        const size_t i = (size_t)(y - TXI_EDGE) * (size_t)t->window->width + (size_t)(x - TXI_EDGE);
        const int share = t->window->share[i] * TXI_JOINT_SHARE;
        if (share) cost += txi_rgb_distance(own, t->window->color + 4 * i) / 256 * share;
    }
    for (int k = 0; k < 4; k++) {
        const int u = x + (k == 0) - (k == 1), v = y + (k == 2) - (k == 3);
        const size_t q = (size_t)v * (size_t)l->width + (size_t)u;
        if (l->state[q] != TXI_KNOWN && l->state[q] != TXI_FOREIGN) continue;
        cost += TXI_JOINT_RIM * txi_rgb_distance(txi_label_color(l, label, u, v), l->color + 4 * q);
    }
    return cost;
}

/* The pixels within reach of those that have the label, reach < 0: all; sets their nodes, in a grid
   of the bounding box with a margin. Returns their number. */
static int txi_expansion_region(txi_assembly *t, int32_t alpha, int reach) {
    const txi_level *l = t->level;
    int low[2] = {INT_MAX, INT_MAX}, high[2] = {0, 0}, count = 0;
    for (int i = 0; i < l->hole_count; i++) {
        const int p = l->hole[i];
        if (reach >= 0 && t->label[p] != alpha) continue;
        const int x0 = p % l->width - (reach < 0 ? 0 : reach),
                  y0 = p / l->width - (reach < 0 ? 0 : reach);
        const int side = reach < 0 ? 1 : 2 * reach + 1;
        for (int y = y0 < 0 ? 0 : y0; y < y0 + side && y < l->height; y++) {
            for (int x = x0 < 0 ? 0 : x0; x < x0 + side && x < l->width; x++) {
                const int q = y * l->width + x;
                if (l->state[q] != TXI_HOLE || t->node[q] >= 0 || t->label[q] == TXI_LABEL_STRIP)
                    continue;
                t->node[q] = 0;
                TXM_ASSERT(count < l->hole_count);
                t->region[count++] = q;
                if (x < low[0]) low[0] = x;
                if (y < low[1]) low[1] = y;
                if (x > high[0]) high[0] = x;
                if (y > high[1]) high[1] = y;
            }
        }
    }
    if (!count) return 0;
    const int w = high[0] - low[0] + 3;
    t->flow.count = w * (high[1] - low[1] + 3);
    t->flow.step[0] = 1;
    t->flow.step[1] = w;
    t->flow.step[2] = -1;
    t->flow.step[3] = -w;
    for (int k = 0; k < count; k++) {
        const int p = t->region[k];
        t->node[p] = (p / l->width - low[1] + 1) * w + p % l->width - low[0] + 1;
    }
    return count;
}

/* Add the costs of a pair of pixels, p in the region: e00 if both keep their labels, e01 if q
   changes, e10 if p does; 0 if both do. */
static void txi_expansion_pair(txi_assembly *t, int32_t alpha, int p, int q, int d) {
    const txi_level *l = t->level;
    const int x = p % l->width, y = p / l->width, u = q % l->width, v = q / l->width;
    const int32_t a = t->label[p], b = t->label[q];
    const int e00 = txi_joint_cost(l, a, b, x, y, u, v),
              e10 = txi_joint_cost(l, alpha, b, x, y, u, v);
    const int np = t->node[p], nq = t->node[q];
    if (nq < 0) { /* q keeps its label */
        t->flow.excess[np] += e10 - e00;
        return;
    }
    const int e01 = txi_joint_cost(l, a, alpha, x, y, u, v);
    const int link = e01 + e10 - e00;
    t->flow.excess[np] += e10 - e00;
    t->flow.excess[nq] -= e10;
    if (link > 0) t->flow.arc[d][np] += link; /* else it is cut off: labels may get worse there */
}

/* Let the label grow where that costs less; returns how many pixels have changed. */
static int txi_expand(txi_assembly *t, int32_t alpha, int reach) {
    const txi_level *l = t->level;
    const int count = txi_expansion_region(t, alpha, reach), w = l->width;
    if (!count) return 0;
    const size_t bytes = (size_t)t->flow.count * sizeof(int32_t);
    for (int d = 0; d < 4; d++) memset(t->flow.arc[d], 0, bytes);
    memset(t->flow.excess, 0, bytes);
    for (int k = 0; k < count; k++) {
        const int p = t->region[k], x = p % w, y = p / w;
        t->flow.excess[t->node[p]] +=
            txi_own_cost(t, alpha, x, y) - txi_own_cost(t, t->label[p], x, y);
        if (l->state[p + 1] == TXI_HOLE) txi_expansion_pair(t, alpha, p, p + 1, 0);
        if (l->state[p + w] == TXI_HOLE) txi_expansion_pair(t, alpha, p, p + w, 1);
        if (l->state[p - 1] == TXI_HOLE && t->node[p - 1] < 0)
            txi_expansion_pair(t, alpha, p, p - 1, 0);
        if (l->state[p - w] == TXI_HOLE && t->node[p - w] < 0)
            txi_expansion_pair(t, alpha, p, p - w, 0);
    }
    txm_flow_solve(&t->flow);
    int changed = 0;
    for (int k = 0; k < count; k++) {
        const int p = t->region[k];
        if (t->flow.tree[t->node[p]] == TXM_FLOW_SINK && t->label[p] != alpha) {
            t->label[p] = alpha;
            changed++;
        }
        t->node[p] = -1;
    }
    return changed;
}

/* The labels in use, the most frequent first, no more than `most`; returns how many.
   labels  room for one per hole pixel
   pairs   room for 2 per hole pixel                                                           */
static int txi_labels_used(const txi_assembly *t, int32_t *labels, int most, txm_pair *pairs) {
    const txi_level *l = t->level;
    const size_t n = (size_t)l->hole_count;
    size_t kinds = 0;
    for (size_t i = 0; i < n; i++) {
        const int32_t label = t->label[l->hole[i]];
        pairs[i].key = label >= 0 ? (uint32_t)label : UINT32_MAX;
        pairs[i].value = 0;
    }
    txm_sort_pairs(pairs, pairs + n, n);
    for (size_t i = 0; i < n && pairs[i].key != UINT32_MAX;) {
        size_t j = i;
        while (j < n && pairs[j].key == pairs[i].key) j++;
        pairs[kinds].value = pairs[i].key;
        pairs[kinds++].key = UINT32_MAX - (uint32_t)(j - i);
        i = j;
    }
    txm_sort_pairs(pairs, pairs + n, kinds);
    const int count = kinds < (size_t)most ? (int)kinds : most;
    for (int k = 0; k < count; k++) labels[k] = (int32_t)pairs[k].value;
    return count;
}

/* Memory of an assembly on a level. 0: there is none. */
static int txi_assembly_make(txi_assembly *t, const txi_level *l, txm_arena *arena) {
    const size_t n = (size_t)l->width * (size_t)l->height;
    memset(t, 0, sizeof *t);
    t->level = l;
    t->label = (int32_t *)txm_arena_alloc(arena, n, sizeof(int32_t));
    t->node = (int32_t *)txm_arena_alloc(arena, n, sizeof(int32_t));
    t->region = (int32_t *)txm_arena_alloc(arena, (size_t)l->hole_count, sizeof(int32_t));
    if (!txm_flow_make(&t->flow, arena, 4, (int)n) || arena->failed) return 0;
    for (size_t p = 0; p < n; p++) t->label[p] = t->node[p] = -1;
    return 1;
}

/* Number the pieces: connected pixels of equal labels. queue: room for all hole pixels. Returns how
   many there are. */
static int txi_assembly_pieces(const txi_assembly *t, int32_t *piece, int32_t *queue) {
    const txi_level *l = t->level;
    const int w = l->width;
    const int side[4] = {-1, 1, -w, w};
    int count = 0;
    for (int p = 0; p < w * l->height; p++) piece[p] = -1;
    for (int i = 0; i < l->hole_count; i++) {
        int first = 0, last = 0;
        if (piece[l->hole[i]] >= 0) continue;
        queue[last++] = l->hole[i];
        piece[l->hole[i]] = count;
        while (first < last) {
            const int p = queue[first++];
            for (int k = 0; k < 4; k++) {
                const int q = p + side[k];
                if (l->state[q] != TXI_HOLE || piece[q] >= 0 || t->label[q] != t->label[p])
                    continue;
                piece[q] = count;
                queue[last++] = q;
            }
        }
        count++;
    }
    return count;
}

/* ---- texture completion of a window ---------------------------------------------------------- */

/* How the texture is treated, chosen from what it is like. */
typedef struct txi_style {
    float detail_weight; /* of missing detail in the costs of patches                          */
    float detail_clamp;  /* a pixel's detail counts up to its square times the median          */
    float detail_offset; /* expected detail: standard deviations below the mean of the known   */
    int start;           /* pixels: about the width of the hole at the coarsest level          */
    int starts;          /* at the coarsest level; 1: without annealing; 0 = 2                 */
    uint32_t poses; /* which sources, one bit each, the lowest for the window as it is; 0 = all */
    int is_picture; /* sources: 0 = turned over the full circle, 1 = little, and mirrored */
} txi_style;

enum {
    TXI_MOST_ROUNDS = 12, /* of searches and a vote, at the coarsest level                     */
    TXI_ANNEAL_MOST = 4000, /* anchors of the coarsest level; where there are more, in a long thin
                           hole, it is not annealed: the onion fills that well                 */
    TXI_LEAST_ROUNDS = 2, /* at the finest                                                     */
    TXI_GUIDE_MOST = 100, /* of the guide channel where there is a line                        */
    TXI_ASSEMBLY_LABELS = 1000,
    TXI_ASSEMBLY_REACH = 10, /* pixels that a piece may grow by in one move                    */
    TXI_ASSEMBLY_PASSES = 2,
    TXI_ASSEMBLY_REPORT = 64, /* moves from one report of progress to the next                 */
    TXI_FIRST_STARTS = 2, /* at the coarsest level: the onion's result, and annealed ones       */
    TXI_JUDGE_WIDTH = 10, /* pixels: least width of the hole where a field is judged           */
    TXI_JUDGE_SWEEPS = 8,
    TXI_REPEAT_REACH = 2, /* half widths of the hole: sources that near cost more               */
    TXI_POSE_SHARE = 20 /* the finest level has the poses of at least 1 / 20 of all anchors   */
};

/* What all hypotheses of a window share. */
typedef struct txi_filler {
    const txi_window *window;
    txi_style style;
    uint64_t seed;
    txm_arena *arena;
    int level_count, pose_count;
    const txi_plan *plan; /* whose guide the levels have                                       */
    txi_level level[TXI_MAX_LEVELS];
    txi_pose *pose; /* pose_count, then those of the last plan that was finished               */
    uint16_t outlier[TXI_OUTLIER_BINS];
} txi_filler;

/* A completion down to half resolution (the full one, if there is only one level). */
typedef struct txi_field {
    int level;
    txi_match *match; /* one per anchor                                                        */
    uint8_t *color;   /* 4 per pixel of the level                                              */
    double energy;    /* geometric mean over the levels of the mean cost of a patch            */
} txi_field;

/* Make a level: everything but its sources. */
static int txi_filler_level(txi_filler *f, int k, txm_env *env) {
    txi_level *l = &f->level[k];
    txm_arena scratch;
    const int scale = 1 << k;
    if (!txi_level_make(l, (f->window->width + scale - 1) / scale,
                        (f->window->height + scale - 1) / scale, f->arena))
        return 0;
    if (k) txi_level_halve(&f->level[k - 1], l);
    else txi_level_load(l, f->window);
    txm_arena_init(&scratch, env);
    const int ok = txi_level_taps(l, k == 0, &scratch) && txi_level_depth(l, &scratch) &&
                   txi_level_lists(l, f->arena) &&
                   txi_level_detail(l, f->style.detail_clamp, f->style.detail_offset, 1, &scratch);
    txm_arena_free(&scratch);
    return ok;
}

/* Grain of a window: (median + 1/2) / (mean + 1/2) of the detail of its known pixels, 0..1. Large
   in stochastic textures, small where there are edges between smooth parts. Below 0: no memory. */
static double txi_grain(const txi_window *w, txm_env *env) {
    txi_level l;
    txm_arena arena;
    txm_arena_init(&arena, env);
    double grain = -1;
    if (txi_level_make(&l, w->width, w->height, &arena)) {
        txi_level_load(&l, w);
        if (txi_level_detail(&l, 3, 0, 0, &arena)) grain = l.grain;
    }
    txm_arena_free(&arena);
    return grain;
}

/* Prepare the completion of a window's hole.
   w      outlives *out
   arena  receives all memory
   return TXM_OK; TXM_TOO_SMALL: no patch of 8x8 pixels may be copied, or no pixel is missing, as
          all missing texels lie between pixels; TXM_OUT_OF_MEMORY                              */
static txm_status txi_filler_make(const txi_window *w, const txi_style *style, uint64_t seed,
                                  txm_arena *arena, txm_env *env, txi_filler **out) {
    txi_filler *f = (txi_filler *)txm_arena_zero(arena, 1, sizeof *f);
    uint8_t all[TXI_MAX_POSES];
    if (!f) return txi_no_memory(env);
    f->window = w;
    f->style = *style;
    f->seed = seed;
    f->arena = arena;
    f->pose_count = style->is_picture ? TXI_PICTURE_POSES : TXI_MESH_POSES;
    txi_outlier_table(f->outlier);
    f->pose = (txi_pose *)txm_arena_alloc(arena, (size_t)f->pose_count, sizeof(txi_pose));
    if (!f->pose) return txi_no_memory(env);
    for (int k = 0; k < f->pose_count; k++) {
        txi_source s;
        txi_pose_axes(style->is_picture, k, &s);
        f->pose[k].a = (float)s.a / (float)TXI_UNIT;
        f->pose[k].b = (float)s.b / (float)TXI_UNIT;
        f->pose[k].c = (float)s.c / (float)TXI_UNIT;
        f->pose[k].d = (float)s.d / (float)TXI_UNIT;
    }
    for (int k = 0; k < TXI_MAX_POSES; k++) all[k] = style->poses == 0 || (style->poses >> k & 1);
    for (int k = 0; k < TXI_MAX_LEVELS; k++) {
        uint8_t wanted[TXI_MAX_POSES];
        txi_level *l = &f->level[k];
        int patches = 0;
        if (!txi_filler_level(f, k, env)) return txi_no_memory(env);
        const int is_last =
            k == TXI_MAX_LEVELS - 1 || txi_level_hole_width(l) * 10 < style->start * 14;
        memcpy(wanted, all, sizeof all);
        /* the finest level's others are made once it is known which are used */
        for (int i = 1; i < TXI_MAX_POSES && k == 0 && !is_last; i++) wanted[i] = 0;
        if (!txi_level_sources(l, style->is_picture, f->pose_count, wanted, arena, env))
            return txi_no_memory(env);
        for (int pose = 0; pose < f->pose_count; pose++)
            patches += l->source[pose].color ? txi_source_patches(&l->source[pose]) : 0;
        if (k == 0 && (patches == 0 || l->hole_count == 0))
            return txm_fail(env, TXM_TOO_SMALL,
                            "too little known texture around a hole: no 8x8 texels to copy");
        if (k && patches < TXI_LEAST_PATCHES) break;
        f->level_count = k + 1;
        if (is_last) break;
    }
    if (f->level_count == 1 &&
        !txi_level_sources(&f->level[0], style->is_picture, f->pose_count, all, arena, env))
        return txi_no_memory(env);
    *out = f;
    return TXM_OK;
}

/* ---- the plan ----------------------------------------------------------------------------- */

/* The plan at the finest level, from the window's raster. */
static void txi_plan_load(const txi_plan *plan, const txi_window *w, txi_level *l) {
    for (int y = 0; y < w->height; y++) {
        for (int x = 0; x < w->width; x++) {
            const size_t from = (size_t)y * (size_t)w->width + (size_t)x;
            const size_t to = (size_t)(y + TXI_EDGE) * (size_t)l->width + (size_t)(x + TXI_EDGE);
            if (plan->color)
                l->guide[to] = (uint8_t)(plan->color[4 * from + 3] * TXI_GUIDE_MOST / 255);
            if (!plan->pull || !plan->color || l->state[to] != TXI_HOLE) continue;
            l->pull[to] = plan->pull[from];
            memcpy(l->strip + 4 * to, plan->color + 4 * from, 3);
        }
    }
}

/* The plan at half resolution: the strongest guide, so that lines stay; the mean of the strips. */
static void txi_plan_halve(const txi_level *f, txi_level *l) {
    for (int y = TXI_EDGE; y < l->height - TXI_EDGE; y++) {
        for (int x = TXI_EDGE; x < l->width - TXI_EDGE; x++) {
            const size_t to = (size_t)y * (size_t)l->width + (size_t)x;
            int pull = 0, sum[3] = {0, 0, 0};
            for (int k = 0; k < 4; k++) {
                const int fx = 2 * x - TXI_EDGE + (k & 1), fy = 2 * y - TXI_EDGE + (k >> 1);
                if (fx >= f->width || fy >= f->height) continue;
                const size_t from = (size_t)fy * (size_t)f->width + (size_t)fx;
                if (f->guide[from] > l->guide[to]) l->guide[to] = f->guide[from];
                pull += f->pull[from];
                for (int c = 0; c < 3; c++)
                    sum[c] += f->pull[from] * f->strip[4 * from + (size_t)c];
            }
            if (l->state[to] != TXI_HOLE || !pull) continue;
            l->pull[to] = (uint8_t)(pull / 4);
            for (int c = 0; c < 3; c++)
                l->strip[4 * to + (size_t)c] = (uint8_t)((sum[c] + pull / 2) / pull);
        }
    }
}

/* The guide becomes the fourth byte of a source. */
static void txi_source_guide(const txi_level *l, txi_source *s) {
    for (int j = 0; j < s->height; j++) {
        for (int i = 0; i < s->width; i++) {
            const size_t q = (size_t)j * (size_t)s->width + (size_t)i;
            int32_t x, y;
            if (!s->usable[q]) continue;
            txi_source_place(s, i, j, &x, &y);
            const size_t p = (size_t)((y + TXI_UNIT / 2) / TXI_UNIT) * (size_t)l->width +
                             (size_t)((x + TXI_UNIT / 2) / TXI_UNIT);
            s->color[4 * q + 3] = l->guide[p];
        }
    }
}

/* Give the levels a plan's guide and strips, or take them away. */
static txm_status txi_filler_plan(txi_filler *f, const txi_plan *plan, txm_env *env) {
    if (plan == f->plan) return TXM_OK;
    for (int k = 0; k < f->level_count; k++) {
        txi_level *l = &f->level[k];
        const size_t n = (size_t)l->width * (size_t)l->height;
        if (!l->guide) {
            l->guide = (uint8_t *)txm_arena_alloc(f->arena, n, 6);
            if (!l->guide) return txi_no_memory(env);
            l->pull = l->guide + n;
            l->strip = l->guide + 2 * n;
        }
        memset(l->guide, 0, 6 * n);
        if (plan && k == 0) txi_plan_load(plan, f->window, l);
        if (plan && k) txi_plan_halve(&f->level[k - 1], l);
        for (size_t p = 0; p < n; p++) {
            if (l->state[p] != TXI_VOID) l->color[4 * p + 3] = l->guide[p];
        }
        for (int i = 0; i < l->built_count; i++) txi_source_guide(l, &l->source[l->built[i]]);
    }
    f->plan = plan;
    return TXM_OK;
}

/* ---- levels --------------------------------------------------------------------------------- */

/* Memory for the work on a level. */
static int txi_canvas_make(const txi_filler *f, int level, txi_canvas *t, txm_arena *arena) {
    const txi_level *l = &f->level[level];
    const size_t n = (size_t)l->width * (size_t)l->height, anchors = (size_t)l->anchor_count;
    memset(t, 0, sizeof *t);
    t->level = l;
    t->color = (uint8_t *)txm_arena_alloc(arena, n, 4);
    t->match = (txi_match *)txm_arena_zero(arena, anchors, sizeof(txi_match));
    t->old = (txi_match *)txm_arena_alloc(arena, anchors, sizeof(txi_match));
    t->weight = (uint16_t *)txm_arena_alloc(arena, anchors, sizeof(uint16_t));
    t->use = (uint16_t *)txm_arena_zero(arena, n, sizeof *t->use);
    t->chosen = (int32_t *)txm_arena_alloc(arena, (size_t)l->hole_count, sizeof *t->chosen);
    if (arena->failed) return 0;
    memcpy(t->color, l->color, 4 * n);
    t->price = (uint32_t)((double)f->style.detail_weight * l->clamp * (double)TXI_PATCH_AREA /
                          (double)TXI_WORTH_MOST * 65536);
    /* beside lines a copy from near by is what continues them */
    t->reach = f->plan ? 1 : 1 + txi_level_hole_width(l) * TXI_REPEAT_REACH / 2;
    t->toll = (uint32_t)(TXI_REPEAT_WEIGHT * l->clamp * (double)TXI_PATCH_AREA /
                         (double)TXI_WORTH_MOST * 65536);
    t->seed = txm_hash(f->seed * 16 + (uint64_t)level);
    t->radius = l->width < l->height ? l->width : l->height;
    if (level == 0 && f->level_count > 1) t->radius = 16;
    return 1;
}

/* How strongly the plan's strips pull, 0..256. They are real texture, so they pull at all levels;
   the strips of mere averages would have to fade. */
static int txi_pull_at(int level) {
    return level > 1 ? 230 : level ? 200 : 170;
}

static int txi_rounds(int level, int level_count) {
    if (level_count == 1) return TXI_MOST_ROUNDS;
    return TXI_LEAST_ROUNDS + (TXI_MOST_ROUNDS - TXI_LEAST_ROUNDS) * level / (level_count - 1);
}

/* A ballot on a level, and pairs for its weights. 0: there is no memory. */
static int txi_ballot_make(const txi_filler *f, int level, txi_canvas *t, txm_arena *arena,
                           txi_ballot *ballot, txm_pair **pairs) {
    const txi_level *l = t->level;
    const size_t n = (size_t)l->width * (size_t)l->height, anchors = (size_t)l->anchor_count;
    memset(ballot, 0, sizeof *ballot);
    ballot->canvas = t;
    ballot->outlier = f->outlier;
    ballot->pull = txi_pull_at(level);
    ballot->scratch =
        (uint32_t *)txm_arena_alloc(arena, n, TXI_BALLOT_SCRATCH * sizeof *ballot->scratch);
    *pairs = (txm_pair *)txm_arena_alloc(arena, anchors, 2 * sizeof **pairs);
    return !arena->failed;
}

/* Rounds of searches and votes at a level whose matches are given. */
static txm_status txi_refine(const txi_filler *f, int level, txi_canvas *t, txm_env *env) {
    const size_t anchors = (size_t)t->level->anchor_count;
    const int rounds = txi_rounds(level, f->level_count);
    txm_status status = TXM_OK;
    txm_arena scratch;
    txi_ballot ballot;
    txm_pair *pairs;
    txm_arena_init(&scratch, env);
    if (!txi_ballot_make(f, level, t, &scratch, &ballot, &pairs)) status = txi_no_memory(env);
    for (int round = 0; round < rounds && status == TXM_OK; round++) {
        const int sweeps = round == 0 ? 4 : 2;
        for (int k = 0; k < sweeps; k++) txi_search(t, env);
        txi_weigh(t, 0.08, pairs, pairs + anchors);
        txi_vote(&ballot, env);
        if (txm_progress(env, 0, "filling")) status = txi_stopped(env);
    }
    txm_arena_free(&scratch);
    return status;
}

/* Start a level from the next coarser one: its matches, and a first vote. */
static txm_status txi_descend(const txi_filler *f, int level, const txi_match *from, txi_canvas *t,
                              txm_env *env) {
    const size_t anchors = (size_t)t->level->anchor_count;
    txm_arena scratch;
    txi_ballot ballot;
    txm_pair *pairs;
    txm_status status = TXM_OK;
    txm_arena_init(&scratch, env);
    if (!txi_ballot_make(f, level, t, &scratch, &ballot, &pairs)) status = txi_no_memory(env);
    if (status == TXM_OK) {
        txi_upsample(&f->level[level + 1], from, t);
        txi_weigh(t, 0.08, pairs, pairs + anchors);
        txi_vote(&ballot, env);
    }
    txm_arena_free(&scratch);
    return status;
}

/* mean cost of the canvas' patches */
static double txi_mean_cost(const txi_canvas *t) {
    double sum = 0;
    int count = 0;
    for (int a = 0; a < t->level->anchor_count; a++) {
        if (t->match[a].cost == UINT32_MAX) continue;
        sum += t->match[a].cost;
        count++;
    }
    return count ? sum / count : 0;
}

/* The coarsest level: rounds from the onion as it is, and from labellings annealed from it; the one
   with the smallest costs is kept. */
static txm_status txi_first_level(const txi_filler *f, int level, txi_canvas *t, txm_env *env) {
    const txi_level *l = t->level;
    const size_t bytes = 4 * (size_t)l->width * (size_t)l->height;
    const size_t matches = (size_t)l->anchor_count * sizeof(txi_match);
    const uint64_t seed = t->seed;
    txm_arena scratch;
    txm_arena_init(&scratch, env);
    uint8_t *color = (uint8_t *)txm_arena_alloc(&scratch, bytes, 2);
    txi_match *match = (txi_match *)txm_arena_alloc(&scratch, matches, 2);
    txm_status status = scratch.failed ? txi_no_memory(env) : TXM_OK;
    double least = 0;
    if (status == TXM_OK) {
        memcpy(color, t->color, bytes);
        memcpy(match, t->match, matches);
    }
    const int wanted = f->style.starts ? f->style.starts : TXI_FIRST_STARTS;
    const int starts = l->anchor_count > TXI_ANNEAL_MOST ? 1 : wanted;
    for (int k = 0; k < starts && status == TXM_OK; k++) {
        memcpy(t->color, color, bytes);
        memcpy(t->match, match, matches);
        memset(t->use, 0, (size_t)l->width * (size_t)l->height * sizeof *t->use);
        t->fresh = 0;
        t->seed = seed + (uint64_t)k;
        if (k) status = txi_anneal_labels(t, env);
        if (status == TXM_OK) status = txi_refine(f, level, t, env);
        const double cost = txi_mean_cost(t);
        if (status != TXM_OK || (k && cost >= least)) continue;
        least = cost;
        memcpy(color + bytes, t->color, bytes);
        memcpy((uint8_t *)match + matches, t->match, matches);
    }
    if (status == TXM_OK) {
        memcpy(t->color, color + bytes, bytes);
        memcpy(t->match, (uint8_t *)match + matches, matches);
    }
    t->seed = seed;
    txm_arena_free(&scratch);
    return status;
}

/* ---- the calls ------------------------------------------------------------------------------ */

/* Memory for a field. 0: there is none. */
static int txi_field_make(const txi_filler *f, txm_arena *arena, txi_field *field) {
    field->level = f->level_count > 1 ? 1 : 0;
    const txi_level *l = &f->level[field->level];
    field->match = (txi_match *)txm_arena_zero(arena, (size_t)l->anchor_count, sizeof(txi_match));
    field->color = (uint8_t *)txm_arena_zero(arena, (size_t)l->width * (size_t)l->height, 4);
    return !arena->failed;
}

/* How like the known part a field is, at its own level and at the coarser ones, whose patches see
   larger parts of it. */
static txm_status txi_field_judge(const txi_filler *f, txi_field *field, txm_env *env) {
    double sum = 0;
    int count = 0;
    txm_arena memory[2];
    txi_canvas canvas[2];
    txm_status status = TXM_OK;
    txm_arena_init(&memory[0], env);
    txm_arena_init(&memory[1], env);
    for (int level = field->level; level < f->level_count && status == TXM_OK; level++) {
        txi_canvas *t = &canvas[level & 1], *fine = &canvas[!(level & 1)];
        const txi_level *l = &f->level[level];
        txm_arena_free(&memory[level & 1]);
        if (level > field->level && txi_level_hole_width(l) < TXI_JUDGE_WIDTH) break;
        if (!txi_canvas_make(f, level, t, &memory[level & 1])) {
            status = txi_no_memory(env);
            break;
        }
        if (level == field->level) {
            memcpy(t->color, field->color, 4 * (size_t)l->width * (size_t)l->height);
            memcpy(t->match, field->match, (size_t)l->anchor_count * sizeof *t->match);
        } else {
            txi_color_halve(&f->level[level - 1], fine->color, l, t->color);
            for (int a = 0; a < l->anchor_count; a++) t->match[a].pose = -1;
            for (int k = 0; k < TXI_JUDGE_SWEEPS; k++) txi_search(t, env);
        }
        sum += log(txi_mean_cost(t) + 64);
        count++;
        if (txm_progress(env, 0, "judging")) status = txi_stopped(env);
    }
    field->energy = txm_float(exp(sum / (count ? count : 1)));
    txm_arena_free(&memory[0]);
    txm_arena_free(&memory[1]);
    return status;
}

/* Complete the hole at all levels from the coarsest to that of the field.
   plan   lines to follow, or NULL
   field  from txi_field_make
   return TXM_OK, TXM_OUT_OF_MEMORY, TXM_CANCELLED                                              */
static txm_status txi_fill_coarse(txi_filler *f, const txi_plan *plan, txm_env *env,
                                  txi_field *field) {
    txm_arena memory[2];
    txi_canvas canvas[2];
    txm_status status = txi_filler_plan(f, plan, env);
    if (status != TXM_OK) return status;
    txm_arena_init(&memory[0], env);
    txm_arena_init(&memory[1], env);
    const int first = f->level_count - 1;
    for (int level = first; level >= field->level && status == TXM_OK; level--) {
        const int now = level & 1;
        txi_canvas *t = &canvas[now];
        txm_arena_free(&memory[now]);
        if (!txi_canvas_make(f, level, t, &memory[now])) status = txi_no_memory(env);
        else if (level == first) status = txi_onion_peel(t, env);
        else status = txi_descend(f, level, canvas[!now].match, t, env);
        if (status == TXM_OK && level == first) status = txi_first_level(f, level, t, env);
        else if (status == TXM_OK) status = txi_refine(f, level, t, env);
        if (status == TXM_OK && level == field->level) {
            const txi_level *l = t->level;
            memcpy(field->match, t->match, (size_t)l->anchor_count * sizeof *t->match);
            memcpy(field->color, t->color, 4 * (size_t)l->width * (size_t)l->height);
        }
    }
    txm_arena_free(&memory[0]);
    txm_arena_free(&memory[1]);
    return status == TXM_OK ? txi_field_judge(f, field, env) : status;
}

/* Make those sources of the finest level that enough of the field's matches use. */
static txm_status txi_finest_sources(txi_filler *f, const txi_field *field, txm_env *env) {
    txi_level *l = &f->level[0];
    int uses[TXI_MAX_POSES];
    uint8_t wanted[TXI_MAX_POSES];
    const int anchors = f->level[field->level].anchor_count, before = l->built_count;
    memset(uses, 0, sizeof uses);
    for (int a = 0; a < anchors; a++) {
        if (field->match[a].pose >= 0) uses[field->match[a].pose]++;
    }
    for (int k = 0; k < TXI_MAX_POSES; k++) wanted[k] = uses[k] * TXI_POSE_SHARE > anchors;
    if (!txi_level_sources(l, f->style.is_picture, f->pose_count, wanted, f->arena, env))
        return txi_no_memory(env);
    for (int k = before; k < l->built_count && f->plan; k++)
        txi_source_guide(l, &l->source[l->built[k]]);
    return TXM_OK;
}

/* the plan's copy for pixel p of the finest level, if it is to be kept */
static const txi_copy *txi_plan_copy(const txi_plan *plan, const txi_window *w, const txi_level *l,
                                     int p) {
    if (!plan || !plan->copies || !plan->pull || !plan->color) return NULL;
    const int x = p % l->width - TXI_EDGE, y = p / l->width - TXI_EDGE;
    const size_t at = (size_t)y * (size_t)w->width + (size_t)x;
    const int is_kept = plan->copies[at].piece >= 0 && plan->pull[at] >= TXI_PULL_KEPT;
    return is_kept ? &plan->copies[at] : NULL;
}

/* The filler's poses and those of the plan after them. */
static int txi_finish_poses(txi_filler *f, const txi_plan *plan) {
    const int more = plan && plan->copies ? plan->pose_count : 0;
    if (!more) return 1;
    txi_pose *all =
        (txi_pose *)txm_arena_alloc(f->arena, (size_t)(f->pose_count + more), sizeof *all);
    if (!all) return 0;
    memcpy(all, f->pose, (size_t)f->pose_count * sizeof *all);
    memcpy(all + f->pose_count, plan->poses, (size_t)more * sizeof *all);
    f->pose = all;
    return 1;
}

/* The labels of the vote's choices; TXI_LABEL_STRIP where the plan's strips are kept. */
static void txi_finish_labels(const txi_filler *f, const txi_canvas *t, const txi_plan *plan,
                              int32_t *label) {
    const int32_t *chosen = t->chosen;
    const txi_level *l = &f->level[0];
    for (int i = 0; i < l->hole_count; i++) {
        const int p = l->hole[i];
        if (txi_plan_copy(plan, f->window, l, p)) label[p] = TXI_LABEL_STRIP;
        if (chosen[i] < 0 || label[p] == TXI_LABEL_STRIP) continue;
        const txi_match *m = &t->match[chosen[i]];
        const int corner = l->anchor[chosen[i]];
        label[p] = txi_label(m->pose, m->x - corner % l->width, m->y - corner / l->width);
    }
}

/* Improve the labels by expansion moves.
   labels, pairs  room for one per hole pixel, and for two
   cost           O(labels in use * hole pixels)                                               */
static txm_status txi_finish_expand(txi_assembly *t, int32_t *labels, txm_pair *pairs,
                                    txm_env *env) {
    const int kinds = txi_labels_used(t, labels, TXI_ASSEMBLY_LABELS, pairs);
    const int passes = TXI_LEFT_OUT & TXI_PIECES ? 0 : TXI_ASSEMBLY_PASSES;
    for (int pass = 0, changed = 1; pass < passes && changed; pass++) {
        changed = 0;
        for (int k = 0; k < kinds; k++) {
            if (k % TXI_ASSEMBLY_REPORT == 0 && txm_progress(env, 0, "joining"))
                return txi_stopped(env);
            changed += txi_expand(t, labels[k], TXI_ASSEMBLY_REACH);
        }
    }
    return TXM_OK;
}

/* Where each pixel of the window is copied from, by the labels and their pieces. */
static void txi_finish_copies(const txi_filler *f, const txi_plan *plan, const int32_t *label,
                              const int32_t *piece, int pieces, txi_copy *copies) {
    const txi_level *l = &f->level[0];
    const txi_window *w = f->window;
    for (size_t k = 0; k < (size_t)w->width * (size_t)w->height; k++) {
        memset(&copies[k], 0, sizeof copies[k]);
        copies[k].piece = -1;
    }
    for (int i = 0; i < l->hole_count; i++) {
        const int p = l->hole[i], x = p % l->width, y = p / l->width;
        txi_copy *copy = &copies[(y - TXI_EDGE) * w->width + x - TXI_EDGE];
        const txi_copy *strip = txi_plan_copy(plan, w, l, p);
        if (strip) {
            *copy = *strip;
            copy->pose += f->pose_count;
            copy->piece += pieces;
        }
        if (label[p] < 0) continue;
        int32_t px, py;
        txi_source_place(&l->source[txi_label_pose(label[p])], x + txi_label_dx(label[p]),
                         y + txi_label_dy(label[p]), &px, &py);
        copy->x = (float)px / (float)TXI_UNIT - (float)TXI_EDGE;
        copy->y = (float)py / (float)TXI_UNIT - (float)TXI_EDGE;
        copy->pose = txi_label_pose(label[p]);
        copy->piece = piece[p];
    }
}

/* Labels from the vote's choices, improved; then where each pixel is copied from. Where the plan's
   strips pull by more than half they are kept. */
static txm_status txi_finish_pieces(const txi_filler *f, const txi_canvas *t, const txi_plan *plan,
                                    txi_copy *copies, txm_env *env) {
    const txi_level *l = &f->level[0];
    const size_t n = (size_t)l->width * (size_t)l->height, holes = (size_t)l->hole_count;
    txm_arena scratch;
    txi_assembly assembly;
    txm_arena_init(&scratch, env);
    int32_t *piece = (int32_t *)txm_arena_alloc(&scratch, n, sizeof(int32_t));
    int32_t *queue = (int32_t *)txm_arena_alloc(&scratch, holes, sizeof(int32_t));
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(&scratch, holes, 2 * sizeof(txm_pair));
    txm_status status = TXM_OK;
    if (!txi_assembly_make(&assembly, l, &scratch)) status = txi_no_memory(env);
    if (status == TXM_OK) {
        assembly.color = t->color;
        assembly.window = f->window;
        txi_finish_labels(f, t, plan, assembly.label);
        status = txi_finish_expand(&assembly, queue, pairs, env);
    }
    if (status == TXM_OK) {
        const int pieces = txi_assembly_pieces(&assembly, piece, queue);
        txi_finish_copies(f, plan, assembly.label, piece, pieces, copies);
    }
    txm_arena_free(&scratch);
    return status;
}

/* Complete the finest level, and say where each hole pixel is copied from.
   copies  one per pixel of the window
   poses   receives the filler's poses and after them the plan's, which copies[].pose counts; they
           live as long as the filler */
static txm_status txi_fill_finish(txi_filler *f, const txi_plan *plan, const txi_field *field,
                                  txi_copy *copies, const txi_pose **poses, int *pose_count,
                                  txm_env *env) {
    txi_canvas t;
    txm_arena memory;
    txm_arena_init(&memory, env);
    txm_status status = txi_filler_plan(f, plan, env);
    if (status == TXM_OK && field->level) status = txi_finest_sources(f, field, env);
    const txi_level *l = &f->level[0];
    if (status == TXM_OK && !txi_canvas_make(f, 0, &t, &memory)) status = txi_no_memory(env);
    if (status == TXM_OK && field->level) {
        status = txi_descend(f, 0, field->match, &t, env);
    } else if (status == TXM_OK) {
        memcpy(t.match, field->match, (size_t)l->anchor_count * sizeof *t.match);
        memcpy(t.color, field->color, 4 * (size_t)l->width * (size_t)l->height);
    }
    if (status == TXM_OK) status = txi_refine(f, 0, &t, env);
    if (status == TXM_OK) status = txi_finish_pieces(f, &t, plan, copies, env);
    if (status == TXM_OK && !txi_finish_poses(f, plan)) status = txi_no_memory(env);
    *poses = f->pose;
    *pose_count = f->pose_count + (plan && plan->copies ? plan->pose_count : 0);
    txm_arena_free(&memory);
    return status;
}

/* ---- a look at a completion ---------------------------------------------------------------------

   What a completion to half resolution will look like at the full one: its matches propose colours
   of the window itself, which are as sharp as the known part. Half the resolution enlarged would
   not do, as thin lines are lost on it.                                                         */

enum {
    TXI_LOOK_STEP = 2, /* pixels of the level between the patches that propose; ours            */
    TXI_LOOK_ROW = TXI_PATCH / TXI_LOOK_STEP, /* of them in a row over a pixel                  */
    TXI_LOOK_MOST = TXI_LOOK_ROW * TXI_LOOK_ROW
};

/* What is looked at. */
typedef struct txi_look {
    const txi_filler *filler;
    const txi_field *field;
    const txi_plan *plan; /* or NULL */
    uint8_t *color;       /* 4 per pixel of the window */
} txi_look;

/* Bilinear colour of the known pixels around (x, y), in units of 2^-8 pixels of the window. 0: none
   of them is known. */
static int txi_look_read(const txi_window *w, int64_t x, int64_t y, uint8_t *color) {
    const int fx = (int)(x & 255), fy = (int)(y & 255);
    int sum[3] = {0, 0, 0}, total = 0;
    for (int k = 0; k < 4; k++) {
        const int64_t px = x / 256 + (k & 1), py = y / 256 + (k >> 1);
        const int weight = (k & 1 ? fx : 256 - fx) * (k >> 1 ? fy : 256 - fy);
        if (px >= w->width || py >= w->height || weight == 0) continue;
        const size_t p = (size_t)py * (size_t)w->width + (size_t)px;
        if (w->state[p] != TXI_KNOWN) continue;
        total += weight;
        for (int c = 0; c < 3; c++) sum[c] += weight * w->color[4 * p + (size_t)c];
    }
    for (int c = 0; c < 3 && total; c++) color[c] = (uint8_t)((sum[c] + total / 2) / total);
    return total > 0;
}

/* What the match of an anchor proposes for pixel (x, y) of the window. 0: nothing. */
static int txi_look_propose(const txi_look *v, int anchor, int x, int y, uint8_t *color) {
    const txi_level *l = &v->filler->level[v->field->level];
    const txi_match *m = &v->field->match[anchor];
    if (m->pose < 0) return 0;
    const txi_source *s = &l->source[m->pose];
    const int n = 1 << v->field->level, corner = l->anchor[anchor];
    /* of the source, in 1 / 2n of its pixels                                                   */
    const int64_t i = 2 * n * (m->x - corner % l->width + TXI_EDGE) + 2 * x + 1 - n;
    const int64_t j = 2 * n * (m->y - corner / l->width + TXI_EDGE) + 2 * y + 1 - n;
    /* of the window, in 1 / 2 TXI_UNIT of its pixels                                           */
    const int64_t edge = (int64_t)TXI_UNIT * (n - 1 - 2 * n * TXI_EDGE);
    const int64_t px = 2 * n * (int64_t)s->x + s->a * i + s->c * j + edge;
    const int64_t py = 2 * n * (int64_t)s->y + s->b * i + s->d * j + edge;
    const int64_t unit = 2 * TXI_UNIT / 256;
    return txi_look_read(v->filler->window, px < 0 ? 0 : px / unit, py < 0 ? 0 : py / unit, color);
}

/* The colour of pixel (x, y): of the proposals the one nearest to their mean, as in a vote. */
static void txi_look_pixel(const txi_look *v, int x, int y) {
    const txi_level *l = &v->filler->level[v->field->level];
    const int scale = v->field->level;
    const size_t at = (size_t)y * (size_t)v->filler->window->width + (size_t)x;
    const int p = ((y >> scale) + TXI_EDGE) * l->width + (x >> scale) + TXI_EDGE;
    uint8_t list[TXI_LOOK_MOST][4], *out = v->color + 4 * at;
    int count = 0, best = INT_MAX, mean[3] = {0, 0, 0};
    if (v->plan && v->plan->pull && v->plan->pull[at] >= TXI_PULL_KEPT) { /* the strip itself */
        memcpy(out, v->plan->color + 4 * at, 3);
        return;
    }
    for (int k = 0; k < TXI_LOOK_MOST; k++) {
        const int dx = k % TXI_LOOK_ROW * TXI_LOOK_STEP + 1;
        const int dy = k / TXI_LOOK_ROW * TXI_LOOK_STEP + 1;
        const int anchor = l->slot[p - dy * l->width - dx];
        if (anchor >= 0) count += txi_look_propose(v, anchor, x, y, list[count]);
    }
    if (count == 0) memcpy(out, v->field->color + 4 * (size_t)p, 3);
    for (int pass = 0; pass < 2 && count; pass++) {
        double sum[3] = {0, 0, 0}, total = 0;
        for (int k = 0; k < count; k++) {
            const double weight = pass ? 1.0 / (txi_color_distance(list[k], mean) + 64) : 1;
            total += weight;
            for (int c = 0; c < 3; c++) sum[c] += weight * list[k][c];
        }
        for (int c = 0; c < 3; c++) mean[c] = (int)(sum[c] / total + 0.5);
    }
    for (int k = 0; k < count; k++) {
        const int d = txi_color_distance(list[k], mean);
        if (d >= best) continue;
        best = d;
        memcpy(out, list[k], 3);
    }
}

static void txi_look_row(void *context, int y) {
    const txi_look *v = (const txi_look *)context;
    const txi_window *w = v->filler->window;
    for (int x = 0; x < w->width; x++) {
        if (w->state[(size_t)y * (size_t)w->width + (size_t)x] == TXI_HOLE) txi_look_pixel(v, x, y);
    }
}

/* A picture of a field, and a measure of how good it is.
   plan    that it was completed with, or NULL
   color   4 per pixel of the window, whose hole pixels receive RGB
   return  mean of log(detail / expected detail) of the patches                                 */
static double txi_look_at(const txi_filler *f, const txi_field *field, const txi_plan *plan,
                          uint8_t *color, txm_env *env) {
    const txi_level *l = &f->level[field->level];
    const double unit = (double)l->clamp * (double)TXI_PATCH_AREA / (double)TXI_WORTH_MOST;
    txi_look v;
    double ratio = 0;
    int count = 0;
    for (int a = 0; a < l->anchor_count; a++) {
        const txi_match *m = &field->match[a];
        if (m->pose < 0) continue;
        const txi_source *s = &l->source[m->pose];
        const int worth = s->worth[(size_t)m->y * (size_t)s->width + (size_t)m->x] - 1;
        ratio += log((worth * unit + (double)TXI_WANT_FLOOR) /
                     (l->want[a] * unit + (double)TXI_WANT_FLOOR));
        count++;
    }
    v.filler = f;
    v.field = field;
    v.plan = plan;
    v.color = color;
    txm_parallel_for(env, f->window->height, txi_look_row, &v);
    return count ? ratio / count : 0;
}

/* ---- Poisson blending [1, III.B] -------------------------------------------------------------
   The pixels of a hole are copies; pieces of them meet at seams, and at the rim of the hole they
   meet the known pixels. With v the copied values, a correction c of low frequency makes the jumps
   at seams and rim vanish, and leaves the detail inside of the pieces as it is:

       minimise  sum w(p, q) (c(q) - c(p) + j(p, q))^2 + sum w(p) (v(p) + c(p) - known(p))^2
                 + lambda sum c(p)^2

   over neighbours p, q. Inside of a piece j = 0, w = 1. Across a seam j is what the step v(q) - v(p)
   is more than the mean of the steps at the same places in the two sources; at the rim, where
   c(q) = 0, more than the step in the source of p. A large j is no error of tone but an edge, which
   is not to be smeared (an occluding stroke): w falls with it, to 0 (Tukey's weight).

   Pixels of a window lie between texels. One with missing texels among those around it is a hole, though
   most of it may be known: then known(p) is the colour of that part, and w(p) grows with its share.
   Without this term, what is next to the rim would not be looked at, and the jump at the rim stays. */

enum {
    TXI_BLEND_SWEEPS = 80, /* of successive over-relaxation; see docs/choices.md                  */
    TXI_BLEND_CHUNK = 4096 /* unknowns of one call of the parallel loop                           */
};
#define TXI_BLEND_SCREEN 0.02 /* lambda: corrections fade out within some 7 pixels                */
#define TXI_BLEND_OMEGA 1.7   /* over-relaxation, 1..2                                            */
#define TXI_BLEND_JUMP 0.14   /* of the range of values: 0.8 of the weight across a seam; none from
                                 three times that on                                            */
#define TXI_RIM_JUMP 0.28     /* the same at the rim                                              */
#define TXI_RIM_WEIGHT 1.5    /* w(p, q) of a small jump at the rim; ours                         */
#define TXI_SHARE_LEAST 0.2   /* of a pixel that is known, from which on it counts; ours          */
#define TXI_SHARE_WEIGHT 8.0  /* w(p) of a pixel that is known but for next to nothing; ours      */
#define TXI_SHARE_JUMP 0.45   /* as TXI_RIM_JUMP, for v(p) - known(p)                             */
#define TXI_LAYER_JUMP 0.05   /* the same at the edges and ends of strokes that cross others, which known
                                 strokes may cover there                                         */

/* One map of a window while it is blended. */
typedef struct txi_blend {
    const txi_window *w;
    const txi_copy *copies;
    const txi_pose *poses;
    const float *known; /* channels per window pixel                                             */
    int channels, is_label;
    int is_normal;       /* the first two are a direction in the window                          */
    float low[TXI_MAX_CHANNELS], high[TXI_MAX_CHANNELS]; /* range of the known values            */
    size_t count, reds;  /* unknowns; the first `reds` of them lie on one colour of a chess board */
    int32_t *pixel;      /* window pixel of each unknown                                         */
    int32_t *unknown;    /* of each window pixel, or -1                                          */
    int32_t *side;       /* 4 per unknown: unknown to the right, left, below, above; -1          */
    float *weight;       /* 4 per unknown; 0: none                                               */
    double *diagonal;    /* lambda + sum of weights                                              */
    float *value;        /* channels per unknown: v                                              */
    double *load, *c;    /* channels per unknown                                                 */
    size_t first, last;  /* of a half sweep                                                      */
} txi_blend;

static int txi_is_known(const txi_window *w, int x, int y) {
    if (x < 0 || y < 0 || x >= w->width || y >= w->height) return 0;
    const uint8_t s = w->state[(size_t)y * (size_t)w->width + (size_t)x];
    return s == TXI_KNOWN || s == TXI_FOREIGN;
}

/* The value at a place of the window, from known pixels only. 0: none is known there. */
static int txi_sample(const txi_blend *b, double x, double y, double *values) {
    const double bx = floor(x), by = floor(y);
    double wx[4], wy[4], sum = 0;
    if (!(bx > -4 && by > -4 && bx < b->w->width + 4 && by < b->w->height + 4)) return 0;
    txi_cubic(x - bx, wx);
    txi_cubic(y - by, wy);
    if (b->is_label) { /* the nearest pixel */
        for (int k = 0; k < 4; k++) wx[k] = k == (x - bx < 0.5 ? 1 : 2);
        for (int k = 0; k < 4; k++) wy[k] = k == (y - by < 0.5 ? 1 : 2);
    }
    for (int c = 0; c < b->channels; c++) values[c] = 0;
    for (int k = 0; k < 16; k++) {
        const int px = (int)bx - 1 + k % 4, py = (int)by - 1 + k / 4;
        const double weight = wx[k % 4] * wy[k / 4];
        if (weight == 0 || !txi_is_known(b->w, px, py)) continue;
        const float *from = b->known + ((size_t)py * (size_t)b->w->width + (size_t)px) *
                                           (size_t)b->channels;
        for (int c = 0; c < b->channels; c++) values[c] += weight * (double)from[c];
        sum += weight;
    }
    if (sum < 0.2) return 0;
    for (int c = 0; c < b->channels; c++) values[c] /= sum;
    return 1;
}

/* The value that the source of pixel p has a step (dx, dy) of the target beyond p. */
static int txi_sample_step(const txi_blend *b, int32_t p, int dx, int dy, double *values) {
    const txi_copy *copy = &b->copies[p];
    const txi_pose *pose = &b->poses[copy->pose];
    if (!txi_sample(b, (double)copy->x + dx * (double)pose->a + dy * (double)pose->c,
                    (double)copy->y + dx * (double)pose->b + dy * (double)pose->d, values))
        return 0;
    if (b->is_normal) { /* the piece is turned, and the direction with it */
        const double vx = values[0], vy = values[1];
        values[0] = (double)pose->a * vx + (double)pose->b * vy;
        values[1] = (double)pose->c * vx + (double)pose->d * vy;
    }
    return 1;
}

/* What the step v(q) - v(p) is more than in the source of p (from = 0) or of q (1); q lies a step
   (dx, dy) from p. 0: that source does not go on there. */
static int txi_excess(const txi_blend *b, int32_t p, int32_t q, int dx, int dy, int from,
                      const float *vp, const float *vq, double *excess) {
    double there[TXI_MAX_CHANNELS];
    if (from == 0) {
        if (!txi_sample_step(b, p, dx, dy, there)) return 0;
        for (int c = 0; c < b->channels; c++) excess[c] = (double)vq[c] - there[c];
    } else {
        if (!txi_sample_step(b, q, -dx, -dy, there)) return 0;
        for (int c = 0; c < b->channels; c++) excess[c] = there[c] - (double)vp[c];
    }
    return 1;
}

/* The weight of a jump whose square is so many times that of the allowed one [Tukey]. */
static double txi_blend_weight(double square) {
    return square < 9 ? (1 - square / 9) * (1 - square / 9) : 0;
}

/* Couple unknown i with what is known of its pixel. */
static void txi_blend_share(txi_blend *b, size_t i) {
    const size_t n = (size_t)b->channels, p = (size_t)b->pixel[i];
    const double share = b->w->share ? b->w->share[p] / 255.0 : 0;
    double square = 0;
    if (!(share > TXI_SHARE_LEAST)) return;
    for (size_t c = 0; c < n; c++) {
        const double range = (double)b->high[c] - (double)b->low[c];
        const double jump = ((double)b->known[p * n + c] - (double)b->value[i * n + c]) / TXI_SHARE_JUMP;
        if (range > 0) square += jump * jump / (range * range);
    }
    const double weight = TXI_SHARE_WEIGHT * (share - TXI_SHARE_LEAST) / (1 - TXI_SHARE_LEAST) *
                          txi_blend_weight(square / b->channels);
    b->diagonal[i] += weight;
    for (size_t c = 0; c < n; c++)
        b->load[i * n + c] += weight * ((double)b->known[p * n + c] - (double)b->value[i * n + c]);
}

/* Couple unknown i with the pixel on its side k (right, left, below, above). */
static void txi_blend_link(txi_blend *b, size_t i, int k) {
    static const int dx[4] = {1, -1, 0, 0}, dy[4] = {0, 0, 1, -1};
    const int32_t p = b->pixel[i];
    const int x = p % b->w->width + dx[k], y = p / b->w->width + dy[k];
    double jump[TXI_MAX_CHANNELS] = {0}, other[TXI_MAX_CHANNELS], square = 0, scale;
    const float *vp = b->value + i * (size_t)b->channels, *vq;
    int both = 0;
    b->side[4 * i + (size_t)k] = -1;
    b->weight[4 * i + (size_t)k] = 0;
    if (x < 0 || y < 0 || x >= b->w->width || y >= b->w->height) return;
    const int32_t q = y * b->w->width + x;
    const int32_t j = b->unknown[q];
    if (j < 0 && !txi_is_known(b->w, x, y)) return;
    vq = j < 0 ? b->known + (size_t)q * (size_t)b->channels : b->value + (size_t)j * (size_t)b->channels;
    scale = j < 0 ? TXI_RIM_JUMP : TXI_BLEND_JUMP;
    const int32_t mine_layer = b->copies[p].layer, other_layer = j < 0 ? 0 : b->copies[q].layer;
    if (mine_layer != other_layer) {
        if (mine_layer && other_layer) return; /* one stroke covers the other */
        scale = TXI_LAYER_JUMP;
    }
    if (j < 0 || b->copies[p].piece != b->copies[q].piece) {
        const int mine = txi_excess(b, p, q, dx[k], dy[k], 0, vp, vq, jump);
        both = mine;
        if (j >= 0 && txi_excess(b, p, q, dx[k], dy[k], 1, vp, vq, other)) {
            for (int c = 0; c < b->channels; c++)
                jump[c] = mine ? 0.5 * (jump[c] + other[c]) : other[c];
            both = 1;
        }
        if (!both) { /* neither source goes on: no step at all */
            for (int c = 0; c < b->channels; c++) jump[c] = (double)vq[c] - (double)vp[c];
        }
        for (int c = 0; c < b->channels; c++) {
            const double range = (double)b->high[c] - (double)b->low[c];
            if (range > 0) square += jump[c] * jump[c] / (range * range * scale * scale);
        }
        square /= b->channels;
    }
    const double weight = (j < 0 ? TXI_RIM_WEIGHT : 1) * txi_blend_weight(square);
    b->side[4 * i + (size_t)k] = j;
    b->weight[4 * i + (size_t)k] = txm_float(weight);
    b->diagonal[i] += (double)b->weight[4 * i + (size_t)k];
    for (int c = 0; c < b->channels; c++)
        b->load[i * (size_t)b->channels + (size_t)c] += (double)b->weight[4 * i + (size_t)k] * jump[c];
}

/* body of the parallel loop: v of a chunk of unknowns */
static void txi_blend_values(void *context, int chunk) {
    txi_blend *b = (txi_blend *)context;
    size_t i = (size_t)chunk * TXI_BLEND_CHUNK;
    for (const size_t end = i + TXI_BLEND_CHUNK; i < end && i < b->count; i++) {
        double values[TXI_MAX_CHANNELS] = {0};
        if (!txi_sample_step(b, b->pixel[i], 0, 0, values)) {
            for (int c = 0; c < b->channels; c++)
                values[c] = 0.5 * ((double)b->low[c] + (double)b->high[c]);
        }
        for (int c = 0; c < b->channels; c++)
            b->value[i * (size_t)b->channels + (size_t)c] = txm_float(values[c]);
    }
}

/* body of the parallel loop: the links of a chunk of unknowns */
static void txi_blend_links(void *context, int chunk) {
    txi_blend *b = (txi_blend *)context;
    size_t i = (size_t)chunk * TXI_BLEND_CHUNK;
    for (const size_t end = i + TXI_BLEND_CHUNK; i < end && i < b->count; i++) {
        b->diagonal[i] = TXI_BLEND_SCREEN;
        for (int k = 0; k < 4; k++) txi_blend_link(b, i, k);
        txi_blend_share(b, i);
    }
}

/* body of the parallel loop: a chunk of a half sweep, over unknowns of one colour */
static void txi_blend_sweep(void *context, int chunk) {
    txi_blend *b = (txi_blend *)context;
    const size_t channels = (size_t)b->channels;
    size_t i = b->first + (size_t)chunk * TXI_BLEND_CHUNK;
    for (const size_t end = i + TXI_BLEND_CHUNK; i < end && i < b->last; i++) {
        double *c = b->c + i * channels;
        const double *load = b->load + i * channels;
        const int32_t *side = b->side + 4 * i;
        const float *weight = b->weight + 4 * i;
        for (size_t k = 0; k < channels; k++) {
            double sum = load[k];
            for (int s = 0; s < 4; s++) {
                if (side[s] >= 0)
                    sum += (double)weight[s] * b->c[(size_t)side[s] * channels + k];
            }
            c[k] += TXI_BLEND_OMEGA * (sum / b->diagonal[i] - c[k]);
        }
    }
}

static int txi_chunks(size_t count) {
    return (int)((count + TXI_BLEND_CHUNK - 1) / TXI_BLEND_CHUNK);
}

/* Number the unknowns, those of one colour of the chess board first, and find the range of what is
   known. */
static void txi_blend_number(txi_blend *b) {
    const txi_window *w = b->w;
    for (int c = 0; c < b->channels; c++) {
        b->low[c] = TXI_MOST_SAMPLE;
        b->high[c] = -TXI_MOST_SAMPLE;
    }
    b->count = 0;
    for (int color = 0; color < 2; color++) {
        for (int y = 0; y < w->height; y++) {
            for (int x = (y + color) % 2; x < w->width; x += 2) {
                const int32_t p = y * w->width + x;
                b->unknown[p] = -1;
                if (w->state[p] == TXI_HOLE && b->copies[p].piece >= 0) {
                    b->unknown[p] = (int32_t)b->count;
                    b->pixel[b->count++] = p;
                } else if (txi_is_known(w, x, y)) {
                    for (int c = 0; c < b->channels; c++) {
                        const float v = b->known[(size_t)p * (size_t)b->channels + (size_t)c];
                        b->low[c] = txm_minf(b->low[c], v);
                        b->high[c] = txm_maxf(b->high[c], v);
                    }
                }
            }
        }
        if (color == 0) b->reds = b->count;
    }
}

/* The values of the hole pixels of one map.

   values    channels per window pixel; in: what is known; out: the hole as well
   is_label  values are taken from the nearest source pixel and not corrected
   is_normal the first two channels are a direction in the window: turned with the pieces
   cost      O(hole pixels), some 2 us each                                                    */
static txm_status txi_blend_map(const txi_window *w, const txi_copy *copies, const txi_pose *poses,
                                float *values, int channels, int is_label, int is_normal,
                                txm_env *env) {
    const size_t pixels = (size_t)w->width * (size_t)w->height, n = (size_t)channels;
    size_t holes = 0;
    txi_blend b;
    txm_arena arena;
    txm_arena_init(&arena, env);
    memset(&b, 0, sizeof b);
    for (size_t i = 0; i < pixels; i++) holes += w->state[i] == TXI_HOLE;
    b.w = w;
    b.copies = copies;
    b.poses = poses;
    b.known = values;
    b.channels = channels;
    b.is_label = is_label;
    b.is_normal = is_normal;
    if (holes == 0) return TXM_OK;
    b.unknown = (int32_t *)txm_arena_alloc(&arena, pixels, sizeof *b.unknown);
    b.pixel = (int32_t *)txm_arena_alloc(&arena, holes, sizeof *b.pixel);
    b.side = (int32_t *)txm_arena_alloc(&arena, holes, 4 * sizeof *b.side);
    b.weight = (float *)txm_arena_alloc(&arena, holes, 4 * sizeof *b.weight);
    b.diagonal = (double *)txm_arena_alloc(&arena, holes, sizeof *b.diagonal);
    b.value = (float *)txm_arena_alloc(&arena, holes, n * sizeof *b.value);
    b.load = (double *)txm_arena_zero(&arena, holes, n * sizeof *b.load);
    b.c = (double *)txm_arena_zero(&arena, holes, n * sizeof *b.c);
    if (arena.failed) {
        txm_arena_free(&arena);
        return txi_no_memory(env);
    }
    txi_blend_number(&b);
    txm_parallel_for(env, txi_chunks(b.count), txi_blend_values, &b);
    if (!is_label) txm_parallel_for(env, txi_chunks(b.count), txi_blend_links, &b);
    const int sweeps = is_label || (TXI_LEFT_OUT & TXI_POISSON) != 0 ? 0 : TXI_BLEND_SWEEPS;
    for (int sweep = 0; sweep < sweeps; sweep++) {
        for (int color = 0; color < 2; color++) {
            b.first = color ? b.reds : 0;
            b.last = color ? b.count : b.reds;
            txm_parallel_for(env, txi_chunks(b.last - b.first), txi_blend_sweep, &b);
        }
    }
    for (size_t i = 0; i < b.count; i++) {
        for (size_t c = 0; c < n; c++) {
            const double v = (double)b.value[i * n + c] + b.c[i * n + c];
            values[(size_t)b.pixel[i] * n + c] =
                is_label ? b.value[i * n + c] : txm_clampf(txm_float(v), b.low[c], b.high[c]);
        }
    }
    txm_arena_free(&arena);
    return TXM_OK;
}

/* ---- hypotheses -------------------------------------------------------------------------------
   Whether the lines at a hole go on through it, and how, can be seen only in the result: lines
   rescue stripes and ruin labyrinths. So a window is completed to half its resolution without
   lines, with the lines of a picture and with those of a pattern, and the one that goes on best
   where the known texture ends wins. If it has lines, its strips of texture are compared with mean
   profiles of its lines. Only the winner is completed at full resolution.                       */

enum { TXI_HYPOTHESES = 4 };
#define TXI_SHARE_LONG 0.45     /* of line ends that are long, from which there are lines at all */
#define TXI_SHARE_SMOOTH 0.15   /* the same between smooth parts, where short ends are no grain   */
#define TXI_FORESEEN 0.7        /* share of the known lines that goes on as foreseen, below which
                                   it counts less that completed ones do; ours                   */
#define TXI_MEAN_BEHIND 0.012   /* what mean profiles must be better by: they are smoother; ours  */
#define TXI_ENERGY_WEIGHT 0.12  /* share of ends that must go on for patches that cost twice as
                                   much                                                          */
#define TXI_GRAIN_TEXTURE 0.08  /* grain without lines, above which a window is mere texture     */
#define TXI_GRAIN_NO_PATTERN 0.28 /* grain with lines, above which patterns are not tried        */

/* A hypothesis at half resolution. */
typedef struct txi_hypothesis {
    int structure;      /* TEXINPAINT_TEXTURE .. TEXINPAINT_PATTERN                              */
    int is_mean;        /* mean profiles along the lines instead of strips of texture             */
    txi_curve *curves;
    int curve_count;
    uint64_t hash;      /* of the curves                                                         */
    txi_plan plan;
    txi_field field;
    uint8_t *preview;   /* 4 per window pixel                                                    */
    double detail, score;
    txm_arena memory;   /* of all this; empty if a better one has been found                     */
} txi_hypothesis;

/* What is known about a window that is being completed. */
typedef struct txi_choice {
    const txi_window *w;
    const txi_domain *domain;
    const txi_prior *prior; /* or NULL */
    uint64_t seed;
    txi_lines lines;
    double foreseen;    /* share of the known lines that goes on as foreseen                      */
    txm_arena of_lines; /* memory of lines; empty at the end                                     */
    txi_style style;
    txi_filler *filler;
    txi_hypothesis tried[TXI_HYPOTHESES];
    int count, best;
    int can_be_mean;    /* mean profiles are tried, too                                          */
} txi_choice;

static void txi_choice_free(txi_choice *c) {
    for (int i = 0; i < TXI_HYPOTHESES; i++) txm_arena_free(&c->tried[i].memory);
    txm_arena_free(&c->of_lines);
}

/* Which hypotheses to try, and how strongly detail is asked for. */
static void txi_choose_style(txi_choice *c, double grain) {
    const double least = grain > TXI_GRAIN_TEXTURE ? TXI_SHARE_LONG : TXI_SHARE_SMOOTH;
    const int has_lines = c->lines.end_count > 0 && (double)c->lines.share_long >= least;
    const int forced = c->domain->desc->structure;
    memset(&c->style, 0, sizeof c->style);
    c->style.is_picture = c->domain->surface == NULL;
    if (!has_lines && grain > TXI_GRAIN_TEXTURE) {
        c->style.detail_offset = 0;
        c->style.detail_clamp = 6;
        c->style.detail_weight = 1.5f;
        c->style.start = 10;
        c->style.poses = c->style.is_picture ? 1 : 0; /* grain stays sharp if it is not turned */
    } else if (has_lines && grain > TXI_GRAIN_NO_PATTERN) {
        c->style.detail_offset = 0.35f;
        c->style.detail_clamp = 4;
        c->style.detail_weight = 1.2f;
        c->style.start = 14;
    } else {
        c->style.detail_offset = 0.7f;
        c->style.detail_clamp = 3;
        c->style.detail_weight = 1;
        c->style.start = 14;
    }
    if (TXI_LEFT_OUT & TXI_TURNS) c->style.poses = 1;
    if (TXI_LEFT_OUT & TXI_DETAIL) c->style.detail_weight = 0;
    /* means have no grain                                                                        */
    c->can_be_mean = grain <= TXI_GRAIN_TEXTURE && !(TXI_LEFT_OUT & TXI_STRIPS);
    c->count = 0;
    if (forced != TEXINPAINT_AUTO) {
        c->tried[c->count++].structure = forced;
        return;
    }
    c->tried[c->count++].structure = TEXINPAINT_TEXTURE;
    if (has_lines || c->prior) c->tried[c->count++].structure = TEXINPAINT_PICTURE;
    if (has_lines && grain <= TXI_GRAIN_NO_PATTERN)
        c->tried[c->count++].structure = TEXINPAINT_PATTERN;
}

/* A number that differs for curves that differ. */
static uint64_t txi_hash_curves(const txi_curve *curves, int count) {
    uint64_t hash = (uint64_t)count;
    for (int i = 0; i < count; i++) {
        for (int k = 0; k < curves[i].count; k++) {
            uint64_t bits = 0;
            memcpy(&bits, &curves[i].points[k], sizeof bits);
            hash = txm_hash(hash ^ bits);
        }
    }
    return hash;
}

/* Join the lines of a hypothesis. *known: an earlier one has the same. */
static txm_status txi_join_hypothesis(const txi_choice *c, txi_hypothesis *h, txm_env *env,
                                      int *known) {
    const texinpaint_desc *desc = c->domain->desc;
    *known = 0;
    if (h->structure == TEXINPAINT_TEXTURE || h->curves) return TXM_OK;
    txm_status status = txi_join(c->w, &c->lines, c->prior, h->structure, desc->alpha, desc->beta,
                                 c->seed, &h->memory, env, &h->curves, &h->curve_count);
    if (status == TXM_OK && h->structure == TEXINPAINT_PICTURE)
        status = txi_whole_strokes(c->w, &c->lines, &h->memory, env, &h->curves, &h->curve_count);
    if (status != TXM_OK) return status;
    h->hash = txi_hash_curves(h->curves, h->curve_count);
    for (const txi_hypothesis *o = c->tried; o < h; o++)
        *known |= o->curve_count == h->curve_count && o->hash == h->hash;
    return TXM_OK;
}

/* What the lines of a hypothesis say. */
static txm_status txi_plan_hypothesis(const txi_choice *c, txi_hypothesis *h, txm_env *env) {
    if (h->curve_count == 0) return TXM_OK;
    if (h->is_mean || (TXI_LEFT_OUT & TXI_STRIPS) != 0)
        return txi_cartoon(c->w, &c->lines, h->curves, h->curve_count, &h->memory, env, &h->plan);
    return txi_plan_make(c->w, &c->lines, h->curves, h->curve_count, c->seed, &h->memory, env,
                         &h->plan);
}

/* Complete one hypothesis to half resolution. */
static txm_status txi_fill_hypothesis(txi_choice *c, txi_hypothesis *h, txm_env *env) {
    const size_t pixels = (size_t)c->w->width * (size_t)c->w->height;
    txm_status status = txi_plan_hypothesis(c, h, env);
    const txi_plan *plan = h->curve_count ? &h->plan : NULL;
    h->preview = (uint8_t *)txm_arena_alloc(&h->memory, pixels, 4);
    if (!h->preview || !txi_field_make(c->filler, &h->memory, &h->field)) return txi_no_memory(env);
    if (status == TXM_OK) status = txi_fill_coarse(c->filler, plan, env, &h->field);
    if (status != TXM_OK) return status;
    memcpy(h->preview, c->w->color, 4 * pixels);
    h->detail = txi_look_at(c->filler, &h->field, plan, h->preview, env);
    return TXM_OK;
}

/* How well a hypothesis goes on; `plain` is the one without lines, or the first. */
static txm_status txi_judge(const txi_choice *c, const txi_hypothesis *plain, txi_hypothesis *h,
                            txm_env *env) {
    const int is_picture = c->style.is_picture;
    const double ratio = (h->field.energy + 1) / (plain->field.energy + 1);
    double score = 0;
    const txm_status status = txi_continued(c->w, &c->lines, h->preview, env, &score);
    /* labyrinths have lines, but it cannot be foreseen where they go                             */
    if (c->foreseen < TXI_FORESEEN) score *= c->foreseen / TXI_FORESEEN;
    if (h->structure == TEXINPAINT_TEXTURE) score += is_picture ? 0.03 : 0.01;
    /* relative to the detail that there is: where all is smooth all patches fit                  */
    score -= TXI_ENERGY_WEIGHT * (log(ratio) - (h->detail - plain->detail)) / log(2.0);
    if (h->is_mean) score -= TXI_MEAN_BEHIND;
    if (h->detail < -0.3) score -= 0.4 * (-h->detail - 0.3);
    if (is_picture && h->curve_count > 0) {
        score += 0.15 * txi_straight_share(&c->lines, h->curves, h->curve_count);
        score -= 0.08 * txi_mean_bend(h->curves, h->curve_count);
    }
    h->score = txm_float(score); /* rounded: the same choice with any C library */
    return status;
}

/* Show what was tried. */
static txm_status txi_show_hypothesis(const txi_choice *c, const txi_hypothesis *h, txm_env *env) {
    static const char *const lines[] = {"", "lines-texture", "lines-picture", "lines-pattern"};
    static const char *const strips[] = {"", "strips-texture", "strips-picture", "strips-pattern"};
    static const char *const names[] = {"", "half-texture", "half-picture", "half-pattern"};
    enum { SCALE = 3 };
    const txi_window *w = c->w;
    if (!c->domain->desc->show) return TXM_OK;
    uint8_t *rgb =
        (uint8_t *)txm_alloc(env, (size_t)w->width * (size_t)w->height * 3 * SCALE * SCALE);
    if (!rgb) return txi_no_memory(env);
    txi_draw_lines(w, &c->lines, h->curves, h->curve_count, SCALE, rgb);
    txi_show(c->domain, lines[h->structure], rgb, w->width * SCALE, w->height * SCALE, 3);
    if (h->plan.color) {
        txi_draw_strips(w, &h->plan, rgb);
        txi_show(c->domain, strips[h->structure], rgb, w->width, w->height, 3);
    }
    for (size_t p = 0; p < (size_t)w->width * (size_t)w->height; p++) {
        const uint8_t *from = (w->state[p] == TXI_HOLE ? h->preview : w->color) + 4 * p;
        for (int k = 0; k < 3; k++) rgb[3 * p + (size_t)k] = from[k];
    }
    txi_show(c->domain, names[h->structure], rgb, w->width, w->height, 3);
    txm_free(env, rgb);
    return TXM_OK;
}

/* Complete hypothesis i to half resolution; of it and the best so far keep the better one. */
static txm_status txi_try_one(txi_choice *c, int i, txm_env *env) {
    txi_hypothesis *h = &c->tried[i], *best = &c->tried[c->best];
    int known;
    txm_status status = txi_join_hypothesis(c, h, env, &known);
    if (status == TXM_OK && !known) status = txi_fill_hypothesis(c, h, env);
    if (status == TXM_OK && !known) status = txi_judge(c, &c->tried[0], h, env);
    if (status == TXM_OK && !known) status = txi_show_hypothesis(c, h, env);
    if (status != TXM_OK || i == c->best) return status;
    if (!known && h->score > best->score) c->best = i;
    else best = h;
    txm_arena_free(&best->memory);
    best->curves = NULL;
    if (h->is_mean) h->curves = NULL; /* they were those of the other one */
    return TXM_OK;
}

/* Complete all hypotheses to half resolution one after the other, and keep the best; then its lines
   with mean profiles instead of strips. */
static txm_status txi_try_all(txi_choice *c, txm_env *env) {
    txi_stage stage;
    txm_status status = TXM_OK;
    const float share = 0.9f / (float)(c->count + 1);
    for (int i = 0; i <= c->count && i < TXI_HYPOTHESES && status == TXM_OK; i++) {
        txi_hypothesis *h = &c->tried[i];
        if (i == c->count) {
            const txi_hypothesis *best = &c->tried[c->best];
            if (best->curve_count == 0 || !c->can_be_mean) break;
            h->structure = best->structure;
            h->is_mean = 1;
            h->curves = best->curves;
            h->curve_count = best->curve_count;
        }
        txi_stage_begin(&stage, env, 0.1f + share * (float)i, 0.1f + share * (float)(i + 1));
        status = txi_stage_end(&stage, txi_try_one(c, i, &stage.env));
    }
    return status;
}

/* Complete a window to half its resolution.
   c      w, domain, prior, seed and the lines with their memory are set, the rest is 0;
          txi_choice_free frees what is not the arena's                                        */
static txm_status txi_choose(txi_choice *c, txm_arena *arena, txm_env *env) {
    txi_stage stage;
    for (int i = 0; i < TXI_HYPOTHESES; i++) txm_arena_init(&c->tried[i].memory, env);
    c->foreseen = txi_foreseen(&c->lines);
    const double grain = txi_grain(c->w, env);
    if (grain < 0) return txi_no_memory(env);
    txi_choose_style(c, grain);
    txi_stage_begin(&stage, env, 0, 0.1f);
    txm_status status = txi_stage_end(
        &stage, txi_filler_make(c->w, &c->style, c->seed, arena, &stage.env, &c->filler));
    if (status == TXM_OK) status = txi_try_all(c, env);
    txm_arena_free(&c->of_lines);
    return status;
}

/* ---- preview ------------------------------------------------------------------------------------
   What a user sees first: smooth colours in the holes, and through the first hole its lines,
   drawn as the mean colours across them. The texels stay missing. */

/* Paint the targets of a window in the picture. Pictures with alpha keep what they have, as colours
   of a window lie over gray.
   color  4 per window pixel                                                                      */
static txm_status txi_paint(txi_domain *d, const txi_window *w, const uint8_t *color,
                            txm_env *env) {
    const size_t pixels = (size_t)w->width * (size_t)w->height;
    const size_t channels = (size_t)d->maps[0].channels;
    size_t bytes;
    if (channels == 2 || channels == 4) return TXM_OK;
    if (!txm_mul(pixels, channels, sizeof(float), &bytes)) return txi_no_memory(env);
    float *values = (float *)txm_alloc(env, bytes);
    if (!values) return txi_no_memory(env);
    for (size_t i = 0; i < pixels; i++) {
        for (size_t c = 0; c < channels; c++)
            values[i * channels + c] = (float)color[4 * i + c] / 255.0f;
    }
    txi_window_write(d, w, 0, values);
    txm_free(env, values);
    return TXM_OK;
}

/* Does a target lie on the lines of a plan? */
static int txi_is_on_line(const txi_window *w, const txi_plan *plan, const txi_target *t) {
    const int x = txm_clampi((int)floor((double)t->x + 0.5), 0, w->width - 1);
    const int y = txm_clampi((int)floor((double)t->y + 0.5), 0, w->height - 1);
    return plan->pull[(size_t)y * (size_t)w->width + (size_t)x] >= TXI_PULL_KEPT;
}

/* The lines through a window's hole, painted.
   on_lines  receives the window with those targets only that lie on the lines                 */
static txm_status txi_paint_lines(txi_domain *d, const txi_window *w, const txi_lines *lines,
                                  txm_arena *arena, txm_env *env, txi_window *on_lines) {
    txi_curve *curves = NULL;
    txi_plan plan;
    int count = 0;
    *on_lines = *w;
    on_lines->target_count = 0;
    txm_status status = txi_join(w, lines, NULL, TEXINPAINT_PICTURE, d->desc->alpha, d->desc->beta,
                                 d->desc->seed, arena, env, &curves, &count);
    if (status != TXM_OK || count == 0) return status;
    status = txi_cartoon(w, lines, curves, count, arena, env, &plan);
    if (status != TXM_OK) return status;
    on_lines->targets =
        (txi_target *)txm_arena_alloc(arena, w->target_count, sizeof *on_lines->targets);
    if (arena->failed) return txi_no_memory(env);
    for (size_t i = 0; i < w->target_count; i++) {
        if (txi_is_on_line(w, &plan, &w->targets[i]))
            on_lines->targets[on_lines->target_count++] = w->targets[i];
    }
    return txi_paint(d, on_lines, plan.color, env);
}

/* Fill all holes smoothly, around the lines of one window, which keep their colours.
   w      the window, whose texels are missing, and its lines; NULL: no lines                  */
static txm_status txi_preview(txi_domain *d, const txi_window *w, const txi_lines *lines,
                              txm_env *env) {
    txi_window painted;
    txm_arena arena;
    txi_stage stage;
    txm_status status = TXM_OK;
    txm_arena_init(&arena, env);
    memset(&painted, 0, sizeof painted);
    if (w) {
        txi_stage_begin(&stage, env, 0, 0.5f);
        status =
            txi_stage_end(&stage, txi_paint_lines(d, w, lines, &arena, &stage.env, &painted));
    }
    for (size_t i = 0; i < painted.target_count; i++) d->missing[painted.targets[i].texel] = 0;
    if (status == TXM_OK) {
        txi_stage_begin(&stage, env, 0.5f, 1);
        status = txi_stage_end(&stage, txi_harmonic_fill(d, &stage.env));
    }
    for (size_t i = 0; i < painted.target_count; i++) d->missing[painted.targets[i].texel] = 1;
    txm_arena_free(&arena);
    return status;
}

/* ---- counting holes -------------------------------------------------------------------------- */

/* How many parts of the missing texels are connected: on the surface face by face, in a picture by
   the sides and corners of pixels.
   cost  O(faces), for a picture O(pixels); 5 bytes each while it runs */
static txm_status txi_count_holes(const txi_domain *d, txm_env *env, int *holes) {
    const txi_surface *s = d->surface;
    const size_t count = s ? s->face_count : (size_t)d->width * (size_t)d->height;
    txm_arena arena;
    txm_arena_init(&arena, env);
    uint32_t *parent = (uint32_t *)txm_arena_alloc(&arena, count, sizeof *parent);
    uint8_t *is_hole = (uint8_t *)txm_arena_zero(&arena, count, 1);
    *holes = 0;
    if (!parent || !is_hole) {
        txm_arena_free(&arena);
        return txi_no_memory(env);
    }
    for (size_t i = 0; i < count; i++) {
        parent[i] = (uint32_t)i;
        is_hole[i] =
            s ? s->hole_first[i + 1] > s->hole_first[i] || d->missing[txi_face_texel(d, s, i)]
              : d->missing[i];
    }
    for (size_t i = 0; i < count; i++) {
        for (size_t k = 0; k < 3 && s && is_hole[i]; k++) {
            const uint32_t other = s->opposite[3 * i + k];
            if (other != TXM_NO_SIDE && is_hole[other / 3])
                txi_join_sets(parent, (uint32_t)i, other / 3);
        }
        if (s || !is_hole[i]) continue;
        const int x = (int)(i % (size_t)d->width), y = (int)(i / (size_t)d->width);
        static const int dx[4] = {-1, -1, 0, 1}, dy[4] = {0, -1, -1, -1};
        for (int k = 0; k < 4; k++) {
            if (x + dx[k] < 0 || x + dx[k] >= d->width || y + dy[k] < 0) continue;
            const size_t other = (size_t)(y + dy[k]) * (size_t)d->width + (size_t)(x + dx[k]);
            if (is_hole[other]) txi_join_sets(parent, (uint32_t)i, (uint32_t)other);
        }
    }
    for (size_t i = 0; i < count; i++) *holes += is_hole[i] && parent[i] == i;
    txm_arena_free(&arena);
    return TXM_OK;
}

/* ---- jobs ------------------------------------------------------------------------------------ */

enum { TXI_PREVIEW, TXI_COARSE, TXI_FINE, TXI_GUTTER, TXI_DONE }; /* what the next step does */

struct texinpaint_job {
    texinpaint_desc desc;
    txi_domain domain;
    texinpaint_crests *crests; /* with TEXINPAINT_PRIOR_CREST                                    */
    texinpaint_info info;
    int phase, steps;
    size_t left;         /* missing texels that are not completed yet                            */
    size_t largest;      /* targets of the largest window so far                                 */
    txm_arena memory;    /* holds the job                                                        */
    txm_arena of_window; /* what is known about the current window                              */
    txi_window window;
    int is_open;         /* the window is laid out and its lines are traced, but not used yet    */
    txi_prior prior;
    txi_choice choice;
};

/* texinpaint_begin for a description that has been checked. *out is NULL, and stays so after a
   failure. */
static txm_status txi_begin(const texinpaint_desc *desc, txm_env *env, texinpaint_job **out) {
    txm_arena memory;
    texinpaint_job *job;
    txm_status status;
    size_t count, known = 0;
    txm_arena_init(&memory, env);
    job = (texinpaint_job *)txm_arena_zero(&memory, 1, sizeof *job);
    if (!job) return txi_no_memory(env);
    job->desc = *desc;
    job->memory = memory;
    txm_arena_init(&job->of_window, env);
    status = txi_domain_make(&job->domain, &job->desc, &job->memory, env);
    if (status == TXM_OK) status = txi_surface_make(&job->domain, &job->memory, env);
    if (status == TXM_OK && desc->prior == TEXINPAINT_PRIOR_CREST) {
        texinpaint_crest_desc crest;
        txi_stage stage;
        memset(&crest, 0, sizeof crest);
        crest.mesh = desc->mesh;
        txi_stage_begin(&stage, env, 0, 0); /* the steps begin at 0 */
        status = txi_stage_end(&stage, texinpaint_crest(&crest, &stage.env, &job->crests));
    }
    count = (size_t)desc->image.width * (size_t)desc->image.height;
    for (size_t i = 0; i < count && status == TXM_OK; i++) {
        if (!job->domain.covered[i]) continue;
        if (job->domain.missing[i]) job->info.missing++;
        else if (job->domain.usable[i]) known++;
    }
    job->left = job->info.missing;
    if (status == TXM_OK) status = txi_count_holes(&job->domain, env, &job->info.holes);
    if (status == TXM_OK && job->left && !known)
        status = txm_fail(env, TXM_TOO_SMALL, "no known texel to copy from: all are missing");
    if (status != TXM_OK) {
        texinpaint_free(job);
        return status;
    }
    *out = job;
    return TXM_OK;
}

TEXINPAINT_API txm_status texinpaint_begin(const texinpaint_desc *desc, txm_env *env,
                                           texinpaint_job **out) {
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    const txm_status status = txi_check(desc, env);
    return status == TXM_OK ? txi_begin(desc, env, out) : status;
}

TEXINPAINT_API void texinpaint_free(texinpaint_job *job) {
    if (!job) return;
    txm_arena memory = job->memory;
    texinpaint_crests_free(job->crests);
    txi_choice_free(&job->choice);
    txm_arena_free(&job->of_window);
    txm_arena_free(&memory);
}

/* ---- steps ----------------------------------------------------------------------------------- */

/* The targets of the window are written. */
static void txi_count_window(texinpaint_job *job) {
    const size_t count = job->window.target_count;
    job->info.windows++;
    job->info.written += count;
    job->left -= count < job->left ? count : job->left;
}

/* Lay out the next window and trace the lines at its hole, unless that has been done; *found: there
   is one. */
static txm_status txi_open_window(texinpaint_job *job, txm_env *env, int *found) {
    txi_choice *choice = &job->choice;
    *found = job->is_open;
    if (job->is_open) return TXM_OK;
    txi_choice_free(choice);
    txm_arena_free(&job->of_window);
    memset(choice, 0, sizeof *choice);
    txm_arena_init(&choice->of_lines, env);
    txm_status status =
        txi_windows_next(&job->domain, &job->of_window, env, &job->window, found);
    if (status != TXM_OK || !*found) return status;
    status = txi_trace(&job->window, &choice->of_lines, env, &choice->lines);
    job->is_open = status == TXM_OK;
    return status;
}

/* Smooth colours in all holes, and the lines through the first one. */
static txm_status txi_step_preview(texinpaint_job *job, txm_env *env) {
    int found = 0;
    txm_status status = TXM_OK;
    if (job->desc.structure != TEXINPAINT_TEXTURE) status = txi_open_window(job, env, &found);
    if (status != TXM_OK) return status;
    return txi_preview(&job->domain, found ? &job->window : NULL, &job->choice.lines, env);
}

/* Complete the next window to half its resolution. */
static txm_status txi_step_coarse(texinpaint_job *job, txm_env *env) {
    txi_domain *domain = &job->domain;
    txi_window *w = &job->window;
    txi_choice *choice = &job->choice;
    int found;
    txm_status status = txi_open_window(job, env, &found);
    if (status != TXM_OK) return status;
    if (!found) {
        job->phase = TXI_GUTTER;
        return TXM_OK;
    }
    job->is_open = 0; /* another try begins anew */
    choice->w = w;
    choice->domain = domain;
    choice->seed = txm_hash(job->desc.seed + (uint64_t)job->info.windows);
    if (job->desc.prior != TEXINPAINT_PRIOR_NONE) {
        status = txi_prior_make(domain, job->crests, w, &job->of_window, env, &job->prior);
        if (status != TXM_OK) return status;
        if (job->prior.line_count) choice->prior = &job->prior;
    }
    status = txi_choose(choice, &job->of_window, env);
    if (status == TXM_OK) status = txi_paint(domain, w, choice->tried[choice->best].preview, env);
    if (status == TXM_TOO_SMALL) { /* nothing to copy from: it stays smooth */
        txi_window_done(domain, w);
        txi_count_window(job);
        return TXM_OK;
    }
    if (status == TXM_OK) job->phase = TXI_FINE;
    return status;
}

/* Read and blend one map of the current window. */
static txm_status txi_blend_window(texinpaint_job *job, int map, const txi_copy *copies,
                                   const txi_pose *poses, float *values, txm_env *env) {
    const texinpaint_map *kind = map ? &job->desc.maps[map - 1] : NULL;
    txi_window_read(&job->domain, &job->window, map, values);
    return txi_blend_map(&job->window, copies, poses, values, job->domain.maps[map].channels,
                         kind && kind->is_label, kind && kind->is_normal, env);
}

/* Complete the current window at full resolution and write it back: all maps or none. */
static txm_status txi_step_fine(texinpaint_job *job, txm_env *env) {
    const txi_window *w = &job->window;
    txi_choice *choice = &job->choice;
    txi_hypothesis *h = &choice->tried[choice->best];
    const size_t pixels = (size_t)w->width * (size_t)w->height;
    txm_arena arena;
    const txi_pose *poses = NULL;
    int pose_count = 0;
    float *values[TEXINPAINT_MAX_MAPS] = {NULL};
    txm_arena_init(&arena, env);
    txi_copy *copies = (txi_copy *)txm_arena_alloc(&arena, pixels, sizeof *copies);
    txm_status status = arena.failed ? txi_no_memory(env) : TXM_OK;
    if (status == TXM_OK)
        status = txi_fill_finish(choice->filler, h->curve_count ? &h->plan : NULL, &h->field,
                                 copies, &poses, &pose_count, env);
    for (int i = 0; i < job->domain.map_count && status == TXM_OK; i++)
        values[i] = (float *)txm_arena_alloc(&arena, pixels, (size_t)job->domain.maps[i].channels *
                                                                 sizeof(float));
    if (arena.failed) status = txi_no_memory(env);
    for (int i = 0; i < job->domain.map_count && status == TXM_OK; i++)
        status = txi_blend_window(job, i, copies, poses, values[i], env);
    if (status == TXM_OK) {
        for (int i = 0; i < job->domain.map_count; i++)
            txi_window_write(&job->domain, w, i, values[i]);
        txi_window_done(&job->domain, w);
        txi_count_window(job);
        job->info.line_ends += choice->lines.end_count;
        job->info.joins += h->curve_count;
        if (w->target_count >= job->largest) {
            job->largest = w->target_count;
            job->info.structure = h->structure;
        }
        job->phase = TXI_COARSE;
    }
    txm_arena_free(&arena);
    return status;
}

/* The share of the work that is done before the next step. */
static float txi_done(const texinpaint_job *job) {
    if (job->phase == TXI_PREVIEW) return 0;
    if (job->phase >= TXI_GUTTER || !job->info.missing) return 0.98f;
    const float window = (float)job->window.target_count / (float)job->info.missing;
    const float done = 1 - (float)job->left / (float)job->info.missing;
    return 0.04f + 0.94f * (done + (job->phase == TXI_FINE ? 0.6f * window : 0));
}

TEXINPAINT_API txm_status texinpaint_step(texinpaint_job *job, txm_env *env, int *more) {
    txm_status status = TXM_OK;
    txi_stage stage;
    size_t filled = 0;
    if (!job) return txm_fail(env, TXM_BAD_ARGUMENT, "job is NULL");
    const float from = txi_done(job);
    if (txm_progress(env, from, "complete")) return txi_stopped(env);
    job->of_window.failed = 0; /* when a step is tried again */
    txi_stage_begin(&stage, env, from, from);
    switch (job->phase) {
    case TXI_PREVIEW:
        status = txi_step_preview(job, &stage.env);
        if (status == TXM_OK) job->phase = TXI_COARSE;
        break;
    case TXI_COARSE: status = txi_step_coarse(job, &stage.env); break;
    case TXI_FINE: status = txi_step_fine(job, &stage.env); break;
    case TXI_GUTTER:
        txi_choice_free(&job->choice);
        txm_arena_free(&job->of_window);
        status = txi_gutter(&job->domain, &job->of_window, &stage.env, &filled);
        if (status == TXM_OK) job->info.written += filled; /* a second try fills no more */
        if (status == TXM_OK) status = txi_bleed(&job->domain, &stage.env);
        if (status != TXM_OK) break;
        txm_arena_free(&job->of_window);
        job->phase = TXI_DONE;
        break;
    default: break;
    }
    status = txi_stage_end(&stage, status);
    if (status == TXM_OK) job->steps++;
    if (status == TXM_OK && more) *more = job->phase != TXI_DONE;
    return status;
}

TEXINPAINT_API txm_status texinpaint_draw(const texinpaint_job *job, int map, txm_env *env,
                                          const txm_image *out) {
    if (!job || !out) return txm_fail(env, TXM_BAD_ARGUMENT, "job or out is NULL");
    if (job->steps == 0) return txm_fail(env, TXM_BAD_ARGUMENT, "no step has been done yet");
    if (map < 0 || map >= job->domain.map_count)
        return txm_fail(env, TXM_BAD_ARGUMENT, "map must be 0 to map_count");
    const txm_image *picture = &job->domain.maps[map];
    const txm_status status = txi_check_size(out, "out", picture, env);
    if (status != TXM_OK) return status;
    if (txm_image_resolve(*out).channels != picture->channels || out->sample != picture->sample)
        return txm_fail(env, TXM_BAD_ARGUMENT, "out: channels and sample must be those of the map");
    txi_copy_picture(picture, out);
    return TXM_OK;
}

TEXINPAINT_API texinpaint_info texinpaint_info_of(const texinpaint_job *job) {
    return job->info;
}

TEXINPAINT_API txm_status texinpaint_complete(const texinpaint_desc *desc, txm_env *env,
                                              const txm_image *out) {
    texinpaint_job *job = NULL;
    int more = 1;
    txm_status status = txi_check(desc, env);
    if (status == TXM_OK) status = txi_check_outputs(desc, out, 1 + desc->map_count, env);
    if (status == TXM_OK) status = txi_begin(desc, env, &job);
    while (status == TXM_OK && more) status = texinpaint_step(job, env, &more);
    for (int i = 0; status == TXM_OK && i <= desc->map_count; i++)
        status = texinpaint_draw(job, i, env, &out[i]);
    texinpaint_free(job);
    return status;
}

#endif /* TEXINPAINT_IMPLEMENTATION */

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
