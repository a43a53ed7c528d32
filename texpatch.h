/* texpatch.h - v0.2.0 - more of a photographed texture, its layout kept, in a fraction of a second
   SPDX-License-Identifier: MIT OR Unlicense                   (full text: end of file)

   WHAT IT DOES
     Synthesises texture of any size from a photograph: bricks stay in their courses, tiles and
     woven patterns on their lattice, gravel becomes more gravel [1]. Several maps of a material
     (albedo, normals, height ...) are made in register. The result can be tileable, follow a
     painted guide (texedges.h makes one from drawn strokes) and keep given pixels, and parts of it
     can be synthesised again after an edit; or it is any window of an endless plane.

   QUICK START                                 (tests build and run this very block)
     // Twice as much of a texture. cc -std=c99 quick.c -lm
     #define TEXPATCH_IMPLEMENTATION          // in exactly one .c or .cpp file
     #include "texpatch.h"                    // texmath.h must lie beside it
     #include <stdio.h>

     int main(void) {
         static unsigned char photo[64 * 64], pixels[128 * 128];   // the caller owns all pixels
         static texpatch_desc desc;           // static: all zero, which means the defaults
         static texpatch_exemplar exemplar;
         static txm_env env;                  // malloc, silent, serial; receives the message
         static txm_image picture, out;
         for (int i = 0; i < 64 * 64; i++)    // instead of a photograph: bricks
             photo[i] = (unsigned char)(i / 64 % 16 < 2 || (i + i / 1024 % 2 * 16) % 32 < 2 ? 220
                                                                        : 90 + i * i % 31);
         picture.pixels = photo;
         picture.width = picture.height = 64;
         exemplar.maps = &picture;            // more maps in register may follow
         desc.exemplars = &exemplar;
         desc.exemplar_count = desc.map_count = 1;
         desc.width = desc.height = 128;
         desc.tileable = TEXPATCH_TILE_X | TEXPATCH_TILE_Y;
         out.pixels = pixels;
         out.width = out.height = 128;
         if (texpatch_make(&desc, &env, &out) != TXM_OK) {
             fprintf(stderr, "texture: %s\n", env.message);
             return 1;
         }
         printf("the middle pixel is %d\n", pixels[64 * 128 + 64]);
         return 0;
     }

   WHICH CALL
     texpatch_make        a picture, or several maps in register, in one call
     texpatch_begin ...   the same in steps, with a picture after each; texpatch_again synthesises
                          a part again, texpatch_source_at tells where each pixel comes from
     texpatch_plane_...   windows of an endless plane, which agree wherever they overlap
     texpatch_straight_   a photograph of a wall or floor, seen at an angle, as from straight in
                          front; what is synthesised from it keeps its courses
     texpatch_half        coarser levels of detail of a result
     texsyn.h makes stochastic texture from a model of a few kB instead of pieces of the photograph;
     textiles.h makes sets of tiles that are assembled when the picture is drawn.

   HOW IT WORKS
     Coordinates are synthesised, not colours [5]: each pixel of the output refers to a pixel of the
     exemplar. First pass [1, 3.4; 3], at the coarsest level of a pyramid: patches of N x N pixels,
     N / 2 apart, in scan order, each the best match of all positions, joined along minimum-error
     cuts. Positions off the exemplar's lattice, which is found in its autocorrelation, cost more
     (in courses of bricks and planks each course has its own phase), and so do those that were used more often than others. Second pass [1, 3.5; 2], coarse to fine:
     neighbourhoods of 16, then 8 pixels search for their best match among what their pixels already
     show, at random positions [4] and one lattice step away. Each pixel takes, of the candidates of
     all neighbourhoods that cover it, the one nearest to their mean with the adaptive weights
     w = P |x - z|^(r - 2), r = 0.8, where P is the share of well-matched neighbourhoods among those
     of high frequency nearby. As it takes one candidate and not the mean, nothing is blurred.
     Differences are sums of absolute differences of bytes. At the end pieces are bent by up to 4
     pixels so that lines meet at seams, and small steps of colour there are smoothed.
     Alpha, the last of 2 or 4 channels of a map that is neither data nor normals, says how much of
     a pixel shows: colours are compared, averaged and bent weighted by it, and the colours of fully
     transparent pixels never matter; those of the result are the visible neighbours'.
     A photograph is straightened before all that: the spectra of small windows are those of a few
     waves on a plane; the tilt, the lens and the waves that explain all windows are searched for and
     then fitted to the phases of the waves by least squares. What is left, if it is smooth, becomes
     a field of displacements. Edges tell which way is up.
     A part that is synthesised again and a cell of the plane are the same kind of job, with some
     pixels given.

   LIMITS
     Touching stones are sometimes merged; perspective is corrected by
     texpatch_straight_find alone; a lattice whose rows are not parallel (waves, fans) is not found. What is unique in the exemplar, such as a knot in
     wood, is repeated.

   CONFIGURATION   (define before the include that has _IMPLEMENTATION)
     TEXPATCH_STATIC       every function static to the including file (set it everywhere)
     TEXPATCH_MAX_PIXELS   refuse larger exemplars, outputs and windows; default 2^28
     TEXPATCH_NO_SIMD      plain C only. Else SSE2 where the compiler has it, with the same bytes.

   MEMORY
     RGB: some 24 bytes for each pixel of the output while it is made, and 40 for each pixel of at
     most 320 rows of it; a copy of each map that has transparent pixels; some 6 for each pixel of the
     exemplar and each of its turned and mirrored forms. The plane holds one cell at a time, and 20
     bytes for each pixel along the upper and lower sides of a row of cells.

   TIME   (one core of 2023; make bench measures yours)
     512 x 512 from 256 x 256 pixels, RGB: 0.3 s; without optimisation (passes = -1) 0.15 s. It is
     proportional to the pixels of the output; the exemplar's size matters only at the coarsest
     level. The parallel-for hook runs rows of neighbourhoods and bands of rows.

   THREADS
     No global state. Calls with different env and outputs may overlap; many threads may draw the
     same plane, but a job may be used by only one call at a time.

   SAME BYTES
     All decisions are made in integers, or in float and double rounded once: the same bytes on any
     number of threads, with and without SIMD and on any compiler that keeps to IEEE 754 (see
     texmath.h), built with -ffp-contract=off.

   REFERENCES
     [1] GPU-based interactive near-regular texture synthesis for digital human models.
         Technology and Health Care.
     [2] V. Kwatra, I. Essa, A. Bobick, N. Kwatra. Texture optimization for example-based synthesis.
         SIGGRAPH 2005.
     [3] A. Efros, W. Freeman. Image quilting for texture synthesis and transfer. SIGGRAPH 2001.
     [4] C. Barnes, E. Shechtman, A. Finkelstein, D. Goldman. PatchMatch. SIGGRAPH 2009.
     [5] S. Lefebvre, H. Hoppe. Parallel controllable texture synthesis. SIGGRAPH 2005.          */
#ifndef TEXPATCH_H
#define TEXPATCH_H

#include "texmath.h"

#define TEXPATCH_VERSION "0.2.0"

#ifndef TEXPATCH_MAX_PIXELS
#define TEXPATCH_MAX_PIXELS (1 << 28) /* larger exemplars and outputs are refused */
#endif

#if defined(TEXPATCH_STATIC) && defined(__GNUC__)
#define TEXPATCH_API __attribute__((unused)) static
#elif defined(TEXPATCH_STATIC)
#define TEXPATCH_API static
#else
#define TEXPATCH_API extern
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* ---- what to synthesise ------------------------------------------------------------------ */

enum {
    TEXPATCH_MAX_MAPS = 16,     /* pictures in register: albedo, normal, roughness, ...      */
    TEXPATCH_MAX_EXEMPLARS = 8,
    TEXPATCH_MAX_CHANNELS = 16, /* of all maps with a weight, and the guide, together        */
    TEXPATCH_MIN_SIDE = 32,     /* pixels, of an exemplar                                    */
    TEXPATCH_MAX_SIDE = 16384   /* of an exemplar                                            */
};

/* How one of the maps is treated; all zero: a picture that follows the others. */
typedef struct texpatch_map {
    float weight;  /* 0..16: how much differences in this map count when pieces are matched;
                      0 = it follows the others                                              */
    int is_normal; /* 3 or 4 channels, the first three a unit vector (txm_normal_decode): blended
                      as vectors, kept at unit length, turned with the piece. x to the right,
                      y up (OpenGL); 2 = y down (DirectX)                                     */
    int is_label;  /* values are labels, not quantities: never blended or interpolated       */
    int is_data;   /* quantities (height, roughness), not colours: averaged without decoding */
} texpatch_map;

/* One exemplar: a photograph, or several maps of one material in register. */
typedef struct texpatch_exemplar {
    const txm_image *maps; /* map_count pictures of one size; every exemplar has the same maps:
                              channels and sample type                                       */
    txm_image guide;       /* its guide, the size of the maps, 1..4 channels; pixels NULL: none */
    txm_image mask;        /* the size of the maps: a mask that allows (txm_mask_use in texmath.h):
                              pixels that do not count are never used; pixels NULL: use all      */
} texpatch_exemplar;

enum { TEXPATCH_TILE_X = 1, TEXPATCH_TILE_Y = 2 }; /* for texpatch_desc.tileable               */

/* What to make. All zero but exemplars, their count, map_count and the size is a good default. */
typedef struct texpatch_desc {
    const texpatch_exemplar *exemplars; /* not modified; must live as long as the job draws     */
    int exemplar_count;                 /* 1..TEXPATCH_MAX_EXEMPLARS                             */
    int map_count;                      /* 1..TEXPATCH_MAX_MAPS                                  */
    const texpatch_map *maps; /* map_count of them; NULL = only the first has weight, 1          */
    int width, height;        /* of the output, in pixels, 1 or more                             */
    int tileable;             /* TEXPATCH_TILE_X | TEXPATCH_TILE_Y: opposite sides fit            */
    int patch;  /* side N of the patches of the first pass, in pixels of the output; they are laid
                   N / 2 apart; 0 = chosen for the exemplar                                      */
    int passes; /* optimisation passes for each size of neighbourhood, 1..16; 0 = 3 (2 at full
                   size); -1 = none: patches, cuts and blending alone, in less than half the time */
    int turns;  /* 1, 2 or 4: pieces may be turned by half or quarter turns; 0 = 1               */
    int mirror; /* pieces may be mirrored left to right                                          */
    float novelty; /* 0..1: how strongly large verbatim pieces of the exemplar are avoided: at 1
                      no piece is larger than a neighbourhood, at the cost of detail and likeness */
    int lattice;   /* 0 = find the lattice of the exemplar, if it has one, and keep it; 1 = it has
                      the one given below; -1 = treat it as having none. A lattice is searched for
                      only in a single exemplar that is neither turned nor mirrored              */
    float lattice_vectors[4]; /* for lattice = 1: x and y of both steps, in pixels                */
    txm_image guide;    /* what the exemplars' guides should look like in the output: width x
                           height, with their channels and sample type; pixels NULL: none        */
    txm_image guide_mask; /* width x height: a mask that allows, of where the guide counts;
                           pixels NULL: everywhere                                               */
    float guide_weight; /* 0..16: how much differences in the guide count, relative to a map of
                           weight 1; 0 = 2                                                       */
    const txm_image *kept; /* map_count pictures of width x height, kept where keep counts;
                           NULL: none. They need not come from the exemplar                      */
    txm_image keep;        /* width x height: a mask that allows                                 */
    uint64_t seed;         /* another seed gives another texture                                 */
} texpatch_desc;

/* Make a texture in one call.

   env    NULL, or how to allocate, report, cancel and run in parallel
   out    map_count pictures of desc->width x desc->height, channels and sample of the maps;
          untouched after an error
   return TXM_OK; TXM_BAD_ARGUMENT for a field outside its range, maps or guides that do not match
          or samples that are not finite; TXM_TOO_SMALL for an exemplar under TEXPATCH_MIN_SIDE, or
          whose mask leaves no piece; TXM_TOO_LARGE; TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost   see TIME and MEMORY                                                                 */
TEXPATCH_API txm_status texpatch_make(const texpatch_desc *desc, txm_env *env,
                                      const txm_image *out);

/* ---- step by step ------------------------------------------------------------------------ */

/* A texture that is made step by step. It keeps a copy of the allocator, but not of the exemplars'
   pictures. */
typedef struct texpatch_job texpatch_job;

/* Prepare a job: pyramids, lattice. The statuses are those of texpatch_make. */
TEXPATCH_API txm_status texpatch_begin(const texpatch_desc *desc, txm_env *env,
                                       texpatch_job **out);

/* One step of the work, coarse first: at 512 x 512 some 5 to 60 ms. After an error (cancelling
   included) the job is as before the step and the step may be tried again.
   env    its progress callback receives the fraction of all steps that is done
   more   receives 0 once nothing is left to do; NULL is allowed                              */
TEXPATCH_API txm_status texpatch_step(texpatch_job *job, txm_env *env, int *more);

/* Draw a map in its current state, after one step or more (before the first, TXM_BAD_ARGUMENT). out
   may be a window of the output: its top left pixel is pixel (x, y) of the output, and the window
   must lie inside. Where it is transparent, colours are those of the exemplar's visible neighbours;
   txm_image_bleed on the finished picture fits them to its own, as texpatch_make does. */
TEXPATCH_API txm_status texpatch_draw(const texpatch_job *job, int map, int x, int y, txm_env *env,
                                      txm_image out);

/* Where a pixel of the output comes from. With it anything that is in register with the exemplars
   can be looked up later. */
typedef struct texpatch_source {
    float x, y;    /* pixel of the exemplar as given (turns undone); pixel centres are whole
                      numbers, fractions lie between them                                       */
    int exemplar;  /* -1: the pixel was kept                                                    */
    int turn;      /* quarter turns of the piece, counter-clockwise, 0..3; + 4: it is mirrored
                      (before turning)                                                          */
} texpatch_source;
TEXPATCH_API texpatch_source texpatch_source_at(const texpatch_job *job, int x, int y);

/* Synthesise a part again: the pixels of `again`, a mask that replaces, of the size of the output.
   Any remaining steps are done first. All other pixels are kept, and the part is fitted to
   them. The following steps do the work, in time proportional to the part's bounding box.
   guide, guide_mask   as in the desc, copied; the job follows them from now on. NULL = unchanged */
TEXPATCH_API txm_status texpatch_again(texpatch_job *job, const txm_image *again,
                                       const txm_image *guide, const txm_image *guide_mask,
                                       uint64_t seed, txm_env *env);

/* Release a job; NULL is allowed. */
TEXPATCH_API void texpatch_free(texpatch_job *job);

/* The lattice that a job keeps: x, y of both steps in pixels of the exemplar; 0: it has none. Where each
   course of bricks or planks begins somewhere else the first step is along the courses, from one brick to
   the next, and the second across; the first is 0, 0 if planks have any length. */
TEXPATCH_API int texpatch_lattice(const texpatch_job *job, float vectors[4]);

/* ---- straightening a photograph ---------------------------------------------------------- */

/* A wall or floor that was photographed at an angle, turned, or through a lens that bends lines, as
   it looks from straight in front. Its pattern must repeat in one direction at least: masonry, tiles,
   planks, roofs, cloth. */
typedef struct texpatch_straight_desc {
    txm_image photo; /* the pattern is looked for in it; not modified, need not live on             */
    txm_image mask;  /* the size of photo: looks only where it counts (txm_mask_at); pixels
                        NULL: look everywhere. Transparent pixels are not looked at either          */
    float focal;     /* focal length of the camera, in longer sides of the photograph as it was
                        taken, 0.1..100 (that for 35 mm film over 36); 0 = 0.85. It only
                        matters for the proportions of what was photographed from the side          */
    int whole;       /* 1: the largest rectangle of whole periods along each side along which the
                        pattern repeats, so that it can be tiled; 0: the largest rectangle          */
} texpatch_straight_desc;

typedef struct texpatch_straight texpatch_straight;

/* Find the pattern of a photograph, and how it was photographed.

   out    receives the result, or NULL on any error; release it with texpatch_straight_free
   return TXM_OK, also if there is no pattern; TXM_BAD_ARGUMENT, TXM_TOO_LARGE,
          TXM_OUT_OF_MEMORY, TXM_CANCELLED
   cost   some 0.1 to 1 s; some 30 bytes per pixel of a picture of at most 2600 x 2600        */
TEXPATCH_API txm_status texpatch_straight_find(const texpatch_straight_desc *desc, txm_env *env,
                                               texpatch_straight **out);

/* 1: a pattern was found; width, height (NULL is allowed) receive the size of the straight picture.
   0: there is none, or straight is NULL; the size is that of the photograph. The straight picture
   is the upright rectangle that shows most of the photograph and nothing beyond it, as fine as the
   photograph is anywhere in it, but of at most twice its pixels. */
TEXPATCH_API int texpatch_straight_found(const texpatch_straight *straight, int *width,
                                         int *height);

/* How well the pattern agrees with a plane, 0 to 1; 0 if there is none or straight is NULL. */
TEXPATCH_API double texpatch_straight_agreement(const texpatch_straight *straight);

/* Along which sides the straight picture is cut to whole periods: 1: x, 2: y, 3: both; 0: none,
   because desc.whole was 0, nothing was found or nothing repeats upright, or straight is NULL. */
TEXPATCH_API int texpatch_straight_whole(const texpatch_straight *straight);

/* Draw a picture in register with the photograph, straight; without a pattern: a copy.

   image  the size of the photograph: it itself, or another map of the same material
   map    what kind of map it is (its weight is ignored); NULL = colours. Normals turn with the
          picture, labels are never blended; colours are weighted by their alpha unless is_data
   out    of the size that was found, with the channels and samples of image
   return TXM_OK, TXM_BAD_ARGUMENT, TXM_TOO_LARGE, TXM_CANCELLED: then out is drawn in part    */
TEXPATCH_API txm_status texpatch_straight_draw(const texpatch_straight *straight,
                                               const txm_image *image, const texpatch_map *map,
                                               txm_env *env, const txm_image *out);

/* Where pixel (x, y) of the straight picture lies in the photograph, in pixels whose centres are
   whole numbers. 0: nowhere, or an argument is NULL or not finite. */
TEXPATCH_API int texpatch_straight_source(const texpatch_straight *straight, double x, double y,
                                          double source[2]);

/* Release a result; NULL is allowed. */
TEXPATCH_API void texpatch_straight_free(texpatch_straight *straight);

/* ---- levels of detail -------------------------------------------------------------------- */

/* The next coarser level of a finished map, max(1, width / 2) x max(1, height / 2) pixels, rounded
   down as graphics APIs want it: the mean of the 2 x 2 pixels that each pixel covers, of odd sides
   2 and a part, see txm_image_halve. Colours of 8 and 16 bits that are not data are averaged in
   linear light, weighted by alpha; normals are renormalised; of labels one is taken. So all levels
   agree with each other and with what a renderer makes of level 0. For cutouts see also
   txm_image_set_coverage.

   map       NULL: a picture
   tileable  TEXPATCH_TILE_X | TEXPATCH_TILE_Y, as the map was made
   half      untouched after an error: TXM_BAD_ARGUMENT, TXM_TOO_LARGE, TXM_OUT_OF_MEMORY     */
TEXPATCH_API txm_status texpatch_half(const txm_image *image, const texpatch_map *map,
                                      int tileable, txm_env *env, const txm_image *half);

/* ---- the endless plane ------------------------------------------------------------------- */

/* An endless texture without a period. Overlapping windows of it agree to the byte, even if they
   are made on different machines, so a large picture can be made tile by tile.

   The plane is divided into square cells. The areas around the cells' corners are made first,
   from the seed and their position alone; then strips along the sides between two corners; then the
   interiors. */
typedef struct texpatch_plane texpatch_plane;

/* desc as for a job; width, height, tileable, guide and kept are ignored. */
TEXPATCH_API txm_status texpatch_plane_make(const texpatch_desc *desc, txm_env *env,
                                            texpatch_plane **out);

/* Draw the window whose top left pixel is (x, y), |x|, |y| <= 2^40, for all maps: out holds
   map_count pictures of one size. Hidden colours continue what shows around them in the plane, so that
   windows agree in them, too. sources may be NULL, or width * height of them.
   cost   that of all cells that the window touches (texpatch_plane_cell pixels a side): windows
          of whole cells are cheapest                                                          */
TEXPATCH_API txm_status texpatch_plane_draw(const texpatch_plane *plane, int64_t x, int64_t y,
                                            txm_env *env, const txm_image *out,
                                            texpatch_source *sources);

/* The side of a cell, in pixels; 0 if plane is NULL. */
TEXPATCH_API int texpatch_plane_cell(const texpatch_plane *plane);

/* Release a plane; NULL is allowed. */
TEXPATCH_API void texpatch_plane_free(texpatch_plane *plane);

#ifdef __cplusplus
}
#endif
#endif /* TEXPATCH_H */

#if defined(TEXPATCH_IMPLEMENTATION) && !defined(TEXPATCH_IMPLEMENTED)
#define TEXPATCH_IMPLEMENTED

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

/* ---- sums of absolute differences -------------------------------------------------------- */

/* Sum of |a - b| over rows of bytes, bytes a multiple of 4. Once it exceeds limit, any value above
   limit may be returned. */
#ifdef TXP_SSE2
static inline uint32_t txp_sad_sum(__m128i sum) {
    return (uint32_t)_mm_cvtsi128_si32(sum) + (uint32_t)_mm_cvtsi128_si32(_mm_srli_si128(sum, 8));
}

static inline __m128i txp_sad16(const uint8_t *a, const uint8_t *b) {
    return _mm_sad_epu8(_mm_loadu_si128((const __m128i *)(const void *)a),
                        _mm_loadu_si128((const __m128i *)(const void *)b));
}

static inline __m128i txp_sad4(const uint8_t *a, const uint8_t *b) {
    int32_t u, v;
    memcpy(&u, a, 4);
    memcpy(&v, b, 4);
    return _mm_sad_epu8(_mm_cvtsi32_si128(u), _mm_cvtsi32_si128(v));
}

/* words: 16-byte pieces of a row, tails: 4-byte pieces after them; constants at the calls */
static inline uint32_t txp_sad_fixed(const uint8_t *a, size_t a_pitch, const uint8_t *b,
                                     size_t b_pitch, int words, int tails, int rows,
                                     uint32_t limit) {
    uint32_t total = 0;
    for (int y = 0; y < rows;) {
        __m128i sum = _mm_setzero_si128();
        const int stop = y + 4 < rows ? y + 4 : rows;
        for (; y < stop; y++, a += a_pitch, b += b_pitch) {
            for (int i = 0; i < words; i++)
                sum = _mm_add_epi32(sum, txp_sad16(a + 16 * i, b + 16 * i));
            for (int i = 0; i < tails; i++)
                sum = _mm_add_epi32(sum, txp_sad4(a + 16 * words + 4 * i, b + 16 * words + 4 * i));
        }
        total += txp_sad_sum(sum);
        if (total > limit) break;
    }
    return total;
}

static uint32_t txp_sad(const uint8_t *a, size_t a_pitch, const uint8_t *b, size_t b_pitch,
                        int bytes, int rows, uint32_t limit) {
    switch (bytes) { /* unrolled for RGB */
    case 64: return txp_sad_fixed(a, a_pitch, b, b_pitch, 4, 0, rows, limit);
    case 32: return txp_sad_fixed(a, a_pitch, b, b_pitch, 2, 0, rows, limit);
    case 20: return txp_sad_fixed(a, a_pitch, b, b_pitch, 1, 1, rows, limit);
    default: return txp_sad_fixed(a, a_pitch, b, b_pitch, bytes / 16, bytes % 16 / 4, rows, limit);
    }
}
#else
static uint32_t txp_sad(const uint8_t *a, size_t a_pitch, const uint8_t *b, size_t b_pitch,
                        int bytes, int rows, uint32_t limit) {
    uint32_t total = 0;
    for (int y = 0; y < rows && total <= limit; y++, a += a_pitch, b += b_pitch) {
        for (int i = 0; i < bytes; i++)
            total += (uint32_t)(a[i] > b[i] ? a[i] - b[i] : b[i] - a[i]);
    }
    return total;
}
#endif

/* ---- the canvas -------------------------------------------------------------------------- */

static inline const uint8_t *txp_stack_at(const txp_source *s, const txp_stack *k, int x, int y) {
    return k->pixels + (size_t)y * k->pitch + (size_t)x * (size_t)s->bytes;
}

static inline uint8_t *txp_canvas_at(const txp_source *s, const txp_canvas *c, int x, int y) {
    return c->pixels + (size_t)y * c->pitch + (size_t)x * (size_t)s->bytes;
}

static inline size_t txp_index(const txp_canvas *c, int x, int y) {
    return (size_t)y * (size_t)c->width + (size_t)x;
}

/* x in 0..n-1 for x in 0..2n-1 and beyond */
static inline int txp_wrap(int x, int n) {
    return x < n ? x : x % n;
}

/* Does a piece of wide x high pixels at (x, y) lie inside one sheet, on usable pixels? */
static inline int txp_fits(const txp_source *s, const txp_stack *k, int x, int y, int wide,
                           int high) {
    if (x < 0 || y < 0 || y >= k->height) return 0;
    const int n = s->sheets > 1 ? k->sheet[y] : 0;
    if (x + wide > k->wide[n] || y + high > k->first[n] + k->high[n]) return 0;
    if (k->bad) {
        const size_t w = (size_t)k->width + 1, top = (size_t)y * w, low = (size_t)(y + high) * w;
        const size_t l = (size_t)x, r = (size_t)(x + wide);
        if (k->bad[low + r] - k->bad[low + l] - k->bad[top + r] + k->bad[top + l]) return 0;
    }
    return 1;
}

/* Fill rows from..to-1 of the canvas with the compared bytes of their places. Fixed pixels keep
   their own bytes, and so does the guide where it counts. */
static void txp_canvas_fill(const txp_source *s, const txp_stack *k, const txp_canvas *c, int from,
                            int to) {
    const size_t n = (size_t)s->bytes, guide = (size_t)s->guide_at;
    for (int y = from; y < to; y++) {
        uint8_t *out = txp_canvas_at(s, c, 0, y);
        const size_t row = txp_index(c, 0, y);
        for (int x = 0; x < c->width; x++, out += n) {
            const txp_place at = c->at[row + (size_t)x];
            if (at.x < 0 || (c->fixed && c->fixed[row + (size_t)x])) continue;
            const uint8_t *in = txp_stack_at(s, k, at.x, at.y);
            if (n == 4 && guide == 4) memcpy(out, in, 4);
            else memcpy(out, in, c->free_guide && c->free_guide[row + (size_t)x] ? n : guide);
        }
    }
}

/* Repeat the first columns and rows beyond the ends of the axes that wrap. */
static void txp_canvas_repeat(const txp_source *s, const txp_canvas *c, uint8_t *pixels) {
    const size_t n = (size_t)s->bytes;
    if (c->wrap & TEXPATCH_TILE_X) {
        for (int y = 0; y < c->height; y++) {
            uint8_t *row = pixels + (size_t)y * c->pitch;
            for (int x = 0; x < TXP_PAD; x++)
                memcpy(row + (size_t)(c->width + x) * n, row + (size_t)x * n, n);
        }
    }
    if (c->wrap & TEXPATCH_TILE_Y) {
        for (int y = 0; y < TXP_PAD; y++)
            memcpy(pixels + (size_t)(c->height + y) * c->pitch, pixels + (size_t)y * c->pitch,
                   c->pitch);
    }
}

/* May any pixel of the size x size ones at (x, y) be changed? */
static int txp_has_free_pixel(const txp_canvas *c, int x, int y, int size) {
    if (!c->fixed) return 1;
    for (int v = 0; v < size; v++) {
        for (int u = 0; u < size; u++) {
            if (!c->fixed[txp_index(c, txp_wrap(x + u, c->width), txp_wrap(y + v, c->height))])
                return 1;
        }
    }
    return 0;
}

/* ---- the lattice ------------------------------------------------------------------------- */

/* From the nearest point of the lattice to the offset (x, y), in pixels. */
static inline void txp_from_lattice(const txp_stack *k, double x, double y, double *dx,
                                    double *dy) {
    double u = k->inverse[0] * x + k->inverse[1] * y, v = k->inverse[2] * x + k->inverse[3] * y;
    u -= floor(u + 0.5);
    v -= floor(v + 0.5);
    *dx = k->lattice[0] * u + k->lattice[2] * v;
    *dy = k->lattice[1] * u + k->lattice[3] * v;
}

/* The square of that distance. */
static inline double txp_off_lattice(const txp_stack *k, double x, double y) {
    double dx, dy;
    txp_from_lattice(k, x, y, &dx, &dy);
    return dx * dx + dy * dy;
}

/* ---- finding the lattice of an exemplar ------------------------------------------------- */

/* ours, see docs/choices.md; correlations lie in -1..1 */
enum { TXP_PEAKS = 40 };         /* highest peaks of the correlation that are looked at         */
#define TXP_LATTICE_CLEAR 0.25   /* least mean correlation at the points of a lattice           */
#define TXP_LATTICE_ALIKE 0.85   /* of the best lattice's: of those above this the smallest     */
#define TXP_STEP_CLEAR 0.3       /* least correlation at its two steps                          */
#define TXP_STEP_ALIKE 0.65      /* the same, of the strongest peak                             */
#define TXP_FAR_ALIKE 0.7        /* of the steps': least correlation at whole multiples of them */
#define TXP_RANDOM 0.26          /* strongest peak below which there is no long-range order     */

/* The autocorrelation of a picture for all lags |dx| <= reach_x, 0 <= dy <= reach_y. */
typedef struct txp_correlation {
    const int16_t *gray; /* -128..127 */
    int width, height, reach_x, reach_y;
    float *at; /* (2 reach_x + 1) x (reach_y + 1) */
} txp_correlation;

static inline double txp_correlated(const txp_correlation *k, int dx, int dy) {
    if (dy < 0) {
        dx = -dx;
        dy = -dy;
    }
    if (dx < -k->reach_x || dx > k->reach_x || dy > k->reach_y) return -2;
    return k->at[dy * (2 * k->reach_x + 1) + dx + k->reach_x];
}

/* One row of lags, normalised over the overlapping pixels. The sums are exact. */
static void txp_correlate_row(void *context, int dy) {
    const txp_correlation *k = (const txp_correlation *)context;
    for (int dx = -k->reach_x; dx <= k->reach_x; dx++) {
        const int x0 = dx < 0 ? -dx : 0, x1 = dx > 0 ? k->width - dx : k->width;
        const double n = (double)(x1 - x0) * (k->height - dy);
        int64_t a = 0, b = 0, aa = 0, bb = 0, ab = 0;
        for (int y = 0; y + dy < k->height; y++) {
            const int16_t *u = k->gray + (ptrdiff_t)y * k->width;
            const int16_t *v = u + (ptrdiff_t)dy * k->width + dx;
            int32_t ra = 0, rb = 0, raa = 0, rbb = 0, rab = 0;
            for (int x = x0; x < x1; x++) {
                ra += u[x];
                rb += v[x];
                raa += u[x] * u[x];
                rbb += v[x] * v[x];
                rab += u[x] * v[x];
            }
            a += ra;
            b += rb;
            aa += raa;
            bb += rbb;
            ab += rab;
        }
        const double va = (double)aa - (double)a * (double)a / n;
        const double vb = (double)bb - (double)b * (double)b / n;
        const double cov = (double)ab - (double)a * (double)b / n;
        k->at[dy * (2 * k->reach_x + 1) + dx + k->reach_x] =
            va > 0 && vb > 0 ? txm_float(cov / sqrt(va * vb)) : 0;
    }
}

/* mean correlation at all points of the lattice (a, b) within reach, each the best of 3 x 3 lags */
static double txp_lattice_score(const txp_correlation *k, const double a[2], const double b[2]) {
    double sum = 0;
    int count = 0;
    for (int i = -8; i <= 8; i++) {
        for (int j = -8; j <= 8; j++) {
            const int x = (int)floor(i * a[0] + j * b[0] + 0.5);
            const int y = (int)floor(i * a[1] + j * b[1] + 0.5);
            if (y < 0 || (y == 0 && x <= 0) || y > k->reach_y || x < -k->reach_x || x > k->reach_x)
                continue;
            double best = -2;
            for (int d = 0; d < 9; d++)
                best = fmax(best, txp_correlated(k, x + d % 3 - 1, y + d / 3 - 1));
            sum += best;
            count++;
        }
    }
    return count ? sum / count : 0;
}

/* The maximum of the correlation near p, with subpixel accuracy by parabolas. */
static void txp_refine_peak(const txp_correlation *k, double p[2]) {
    int x = (int)floor(p[0] + 0.5), y = (int)floor(p[1] + 0.5), bx = x, by = y;
    for (int d = 0; d < 9; d++) {
        const int u = x + d % 3 - 1, v = y + d / 3 - 1;
        if (txp_correlated(k, u, v) > txp_correlated(k, bx, by)) {
            bx = u;
            by = v;
        }
    }
    const double c = txp_correlated(k, bx, by);
    const double l = txp_correlated(k, bx - 1, by), r = txp_correlated(k, bx + 1, by);
    const double t = txp_correlated(k, bx, by - 1), d = txp_correlated(k, bx, by + 1);
    p[0] = bx;
    p[1] = by;
    if (l > -2 && r > -2 && l + r < 2 * c) p[0] += 0.5 * (l - r) / (l + r - 2 * c);
    if (t > -2 && d > -2 && t + d < 2 * c) p[1] += 0.5 * (t - d) / (t + d - 2 * c);
}

/* The shortest basis of the same lattice (Gauss). */
static void txp_reduce_basis(double a[2], double b[2]) {
    for (int i = 0; i < 100; i++) {
        const double aa = a[0] * a[0] + a[1] * a[1], bb = b[0] * b[0] + b[1] * b[1];
        if (bb < aa) {
            for (int c = 0; c < 2; c++) {
                const double t = a[c];
                a[c] = b[c];
                b[c] = t;
            }
            continue;
        }
        const double m = floor((a[0] * b[0] + a[1] * b[1]) / aa + 0.5);
        if (m > -0.5 && m < 0.5) return;
        b[0] -= m * a[0];
        b[1] -= m * a[1];
    }
}

/* Does what has this lattice repeat across its courses only? */
static inline int txp_is_free(const double v[4]) {
    return v[0] == 0 && v[1] == 0;
}

static double txp_det(const double *a, const double *b) {
    return a[0] * b[1] - a[1] * b[0];
}

/* Find the lattice in a correlation. 1: there is one. *strongest: the highest peak. */
static int txp_lattice_find(const txp_correlation *k, double out[4], double *strongest) {
    int px[TXP_PEAKS] = {0}, py[TXP_PEAKS] = {0}, count = 0;
    double pc[TXP_PEAKS] = {0}, mean = 0;
    const int wide = 2 * k->reach_x + 1;
    for (int i = 0; i < wide * (k->reach_y + 1); i++) mean += fabs((double)k->at[i]);
    mean /= wide * (k->reach_y + 1);
    for (int y = 0; y <= k->reach_y; y++) {
        for (int x = -k->reach_x; x <= k->reach_x; x++) {
            const double c = txp_correlated(k, x, y);
            int is_peak = x * x + y * y >= 16 && !(y == 0 && x < 0);
            for (int d = 0; d < 9 && is_peak; d++)
                is_peak = d == 4 || txp_correlated(k, x + d % 3 - 1, y + d / 3 - 1) <= c;
            if (!is_peak) continue;
            int at = count < TXP_PEAKS ? count++ : TXP_PEAKS;
            while (at > 0 && pc[at - 1] < c) {
                if (at < TXP_PEAKS) {
                    px[at] = px[at - 1];
                    py[at] = py[at - 1];
                    pc[at] = pc[at - 1];
                }
                at--;
            }
            if (at < TXP_PEAKS) {
                px[at] = x;
                py[at] = y;
                pc[at] = c;
            }
        }
    }
    *strongest = count ? pc[0] : 0;
    double best = 0, area = 1e30, scores[TXP_PEAKS][TXP_PEAKS];
    int bi = -1, bj = -1;
    for (int i = 0; i < count; i++) {
        for (int j = i + 1; j < count; j++) {
            double a[2] = {(double)px[i], (double)py[i]}, b[2] = {(double)px[j], (double)py[j]};
            scores[i][j] = -2;
            txp_reduce_basis(a, b);
            const double la = sqrt(a[0] * a[0] + a[1] * a[1]), lb = sqrt(b[0] * b[0] + b[1] * b[1]);
            if (la < 4 || fabs(txp_det(a, b)) < 0.5 * la * lb) continue;
            scores[i][j] = txp_lattice_score(k, a, b);
            if (scores[i][j] > best) best = scores[i][j];
        }
    }
    for (int i = 0; i < count; i++) {
        for (int j = i + 1; j < count; j++) {
            double a[2] = {(double)px[i], (double)py[i]}, b[2] = {(double)px[j], (double)py[j]};
            const double size = fabs(txp_det(a, b));
            if (scores[i][j] < TXP_LATTICE_ALIKE * best || size >= area) continue;
            area = size;
            bi = i;
            bj = j;
        }
    }
    if (bi < 0 || best <= TXP_LATTICE_CLEAR || best <= 2 * mean) return 0;
    double a[2] = {(double)px[bi], (double)py[bi]}, b[2] = {(double)px[bj], (double)py[bj]};
    txp_reduce_basis(a, b);
    txp_refine_peak(k, a);
    txp_refine_peak(k, b);
    const double ca = txp_correlated(k, (int)floor(a[0] + 0.5), (int)floor(a[1] + 0.5));
    const double cb = txp_correlated(k, (int)floor(b[0] + 0.5), (int)floor(b[1] + 0.5));
    if (fmin(ca, cb) < TXP_STEP_ALIKE * *strongest || fmin(ca, cb) <= TXP_STEP_CLEAR) return 0;
    /* farther points of the lattice determine the steps more exactly */
    for (int t = 2; t <= 8; t++) {
        for (int c = 0; c < 2; c++) {
            double *v = c ? b : a, far_peak[2] = {v[0] * t, v[1] * t};
            const double x = far_peak[0], y = far_peak[1];
            if (fabs(x) > k->reach_x - 1 || fabs(y) > k->reach_y - 1) continue;
            txp_refine_peak(k, far_peak);
            const double ex = far_peak[0] - x, ey = far_peak[1] - y;
            if (ex * ex + ey * ey > 1.5 * 1.5) continue;
            if (txp_correlated(k, (int)floor(far_peak[0] + 0.5), (int)floor(far_peak[1] + 0.5)) <
                TXP_FAR_ALIKE * fmin(ca, cb))
                continue;
            v[0] = far_peak[0] / t;
            v[1] = far_peak[1] / t;
        }
    }
    out[0] = a[0];
    out[1] = a[1];
    out[2] = b[0];
    out[3] = b[1];
    return 1;
}

/* Set the lattice of a level of the stack; v: its steps, in pixels of level 0. If the first is 0 all
   places along the courses are as good. */
static void txp_lattice_set(txp_stack *k, const double v[4], double scale) {
    for (int i = 0; i < 4; i++) k->lattice[i] = v[i] * scale;
    if (txp_is_free(v)) {
        const double square = k->lattice[2] * k->lattice[2] + k->lattice[3] * k->lattice[3];
        k->inverse[0] = k->inverse[1] = 0;
        k->inverse[2] = k->lattice[2] / square;
        k->inverse[3] = k->lattice[3] / square;
        return;
    }
    const double det = k->lattice[0] * k->lattice[3] - k->lattice[1] * k->lattice[2];
    k->inverse[0] = k->lattice[3] / det;
    k->inverse[1] = -k->lattice[2] / det;
    k->inverse[2] = -k->lattice[1] / det;
    k->inverse[3] = k->lattice[0] / det;
}

/* ---- courses ------------------------------------------------------------------------------- */

/* Bricks, planks and roof tiles lie in courses. Their joints cover so little of the picture that it
   is much like itself moved along the courses by any length: which length is that of a brick says
   only what is left of the correlation once its mean along the courses is subtracted. And a mason
   may begin each course where he likes. Then no lattice holds for all of them, but each course has
   its own phase:

       |      |      |      |        phase 0
       ----------------------------
         |      |      |      |      phase 0.3
       ----------------------------
           |      |      |           phase 0.6                                                    */

/* ours, see docs/choices.md */
enum {
    TXP_RIDGES = 360,       /* directions in which courses are looked for                           */
    TXP_RIDGE_FROM = 3,     /* pixels: nearer than that everything is like itself                   */
    TXP_PROFILE_SIDE = 512, /* pixels: the finest level whose longer side is at most this is measured */
    TXP_TURNS = 24,         /* steps to each side by which the direction is corrected               */
    TXP_SLOTS = 8,          /* across one course: where it may begin                                */
    TXP_PROFILE_BINS = 64,  /* along one brick                                                      */
    TXP_LEAST_COURSES = 3,
    TXP_COURSE_UNITS = 3,   /* so many courses at most are one: bonds of unlike courses take turns   */
    TXP_ALIGNINGS = 3       /* rounds in which courses are aligned with their mean                   */
};
#define TXP_TURN_STEP 0.0015  /* radians: half a pixel across 340                                   */
#define TXP_RIDGE_CLEAR 0.35  /* least mean correlation along courses                                */
#define TXP_RIDGE_WIDE 1.5    /* pixels by which a step of the lattice may leave its course          */
#define TXP_PITCH_CLEAR 0.5   /* least correlation of the profile across, one course on              */
#define TXP_BRICK_CLEAR 0.3   /* least correlation of the courses, one brick on                      */
#define TXP_BRICK_SEEN 0.7    /* of the picture's length: the longest brick that is looked for       */
#define TXP_BRICK_SAME 0.1    /* of a brick: a step of the lattice this near to whole bricks is right */
#define TXP_PEAK_DIP 0.5      /* of a peak's height: before it the correlation is lower than that    */
#define TXP_COURSE_ALIKE 0.6  /* least mean correlation of a course with their mean, aligned         */
#define TXP_UNIT_GAIN 0.1     /* by which it must grow for more courses to be one                    */
#define TXP_COURSE_WHOLE 0.5  /* of a course must be in the picture                                  */
#define TXP_COURSE_EVEN 0.03  /* of a brick: phases as regular as this are a lattice                 */
#define TXP_COURSE_SEEN 0.33  /* of a piece's size: so far from its middle its courses count         */
#define TXP_COURSE_BREAK 2.0  /* square of pixels: what a course costs at most that is not its middle's */

/* x in 0..n-1. */
static inline int txp_modulo(double x, int n) {
    return (int)(x - n * floor(x / n));
}

/* The course of the exemplar that course k of the canvas is like. */
static inline int txp_course_model(const txp_courses *c, double k) {
    if (c->around) k = txp_modulo(k, c->around);
    return c->first + txp_modulo(k, c->cycle);
}

/* Where a piece goes: a place of the canvas in the sheet's lattice; the courses there, of its middle
   and to both sides, and their phases. */
typedef struct txp_goal {
    double x, y, course[3], phase[3];
} txp_goal;

static txp_goal txp_goal_make(const txp_stack *k, const txp_courses *c, double x, double y, int size) {
    const double across = fabs(k->inverse[2]) + fabs(k->inverse[3]), half = 0.5 * size;
    txp_goal g;
    memset(&g, 0, sizeof g);
    g.x = x;
    g.y = y;
    for (int i = 0; i < 3 && c->count; i++) {
        const double beside = (i == 0 ? 0 : i == 1 ? -1 : 1) * TXP_COURSE_SEEN * across * size;
        g.course[i] = floor(k->inverse[2] * (x + half) + k->inverse[3] * (y + half) - c->origin + beside);
        g.phase[i] = (double)c->phase[txp_course_model(c, g.course[i])];
    }
    return g;
}

/* By how much of a brick course i of the goal is beside that of the exemplar `moved` courses on, if a
   piece is moved along by u; 0 if there is no such course. */
static inline int txp_course_off(const txp_courses *c, const txp_goal *g, int i, double u, double moved,
                                 double *off) {
    const double own = g->course[i] + moved;
    if (own < 0 || own >= c->count) return 0;
    u -= (double)c->phase[(int)own] - g->phase[i];
    *off = u - floor(u + 0.5);
    return 1;
}

/* Move a place of the sheet to the nearest that fits lattice and bond. */
static void txp_snap(const txp_stack *k, const txp_courses *c, const txp_goal *g, int *x, int *y) {
    const double px = *x - g->x, py = *y - g->y;
    double dx, dy, off;
    if (c->count) {
        const double v = k->inverse[2] * px + k->inverse[3] * py, moved = floor(v + 0.5);
        if (!txp_course_off(c, g, 0, k->inverse[0] * px + k->inverse[1] * py, moved, &off)) return;
        dx = k->lattice[0] * off + k->lattice[2] * (v - moved);
        dy = k->lattice[1] * off + k->lattice[3] * (v - moved);
    } else {
        txp_from_lattice(k, px, py, &dx, &dy);
    }
    *x -= (int)floor(dx + 0.5);
    *y -= (int)floor(dy + 0.5);
}

/* The square of the distance from the nearest place that fits lattice and bond, which is what a place
   costs. The course of a piece's middle decides; of those beside it a part is added. */
static inline double txp_off_bond(const txp_stack *k, const txp_courses *c, const txp_goal *g, double x,
                                  double y) {
    const double px = x - g->x, py = y - g->y, *l = k->lattice;
    if (!c->count) return txp_off_lattice(k, px, py);
    const double v = k->inverse[2] * px + k->inverse[3] * py, moved = floor(v + 0.5);
    const double across = (v - moved) * (v - moved) * (l[2] * l[2] + l[3] * l[3]);
    const double u = k->inverse[0] * px + k->inverse[1] * py, brick = l[0] * l[0] + l[1] * l[1];
    double off, most = 0;
    if (across > (double)TXP_OFF_LATTICE || !txp_course_off(c, g, 0, u, moved, &off))
        return 2.0 * (int)TXP_OFF_LATTICE;
    const double own = across + off * off * brick; /* the steps are normal to each other */
    if (own > (double)TXP_OFF_LATTICE) return own;
    for (int i = 1; i < 3; i++) {
        if (!txp_course_off(c, g, i, u, moved, &off)) off = 0.5;
        most = fmax(most, off * off * brick);
    }
    return own + fmin(most, TXP_COURSE_BREAK);
}

/* ---- finding courses --------------------------------------------------------------------------- */

/* The correlation at any lag, linear between pixels; -2: out of reach. */
static double txp_correlated_at(const txp_correlation *k, double x, double y) {
    const int i = (int)floor(x), j = (int)floor(y);
    const double u = x - i, v = y - j;
    const double a = txp_correlated(k, i, j), b = txp_correlated(k, i + 1, j);
    const double c = txp_correlated(k, i, j + 1), d = txp_correlated(k, i + 1, j + 1);
    if (a < -1.5 || b < -1.5 || c < -1.5 || d < -1.5) return -2;
    return (1 - v) * ((1 - u) * a + u * b) + v * ((1 - u) * c + u * d);
}

/* The direction in which a picture is most like itself, and how much on average. */
static double txp_ridge_find(const txp_correlation *k, double d[2]) {
    double best = -1;
    for (int i = 0; i < TXP_RIDGES; i++) {
        double sine, cosine, sum = 0;
        int count = 0;
        txm_sincos(TXM_PI * i / (int)TXP_RIDGES, &sine, &cosine);
        for (int t = TXP_RIDGE_FROM;; t++, count++) {
            const double c = txp_correlated_at(k, t * cosine, t * sine);
            if (c < -1.5) break;
            sum += c;
        }
        if (count < (int)TXP_RIDGE_FROM || sum <= best * count) continue;
        best = sum / count;
        d[0] = cosine;
        d[1] = sine;
    }
    return best;
}

/* The gray of a pixel of the stack, -128..127: of the first map that counts. */
static inline int txp_gray_of(const txp_source *s, const uint8_t *p) {
    int sum = p[0], n = 1; /* one map at least has a weight */
    for (; n < s->guide_at && n < 3; n++) sum += p[n];
    return sum / n - 128;
}

/* What is measured of the courses, in a gray picture. */
typedef struct txp_masonry {
    int width, height;
    float *gray;
    double along[2], normal[2]; /* directions along and across the courses                       */
    double lowest;              /* across, of the picture's pixels                               */
    int bins;                   /* across                                                        */
    double *mean;               /* of each                                                       */
    int *count;                 /* pixels of each                                                */
    double pitch;               /* pixels across                                                 */
} txp_masonry;

static inline double txp_across(const txp_masonry *m, int x, int y) {
    return m->normal[0] * x + m->normal[1] * y - m->lowest;
}

/* The means along the courses, if they go along a direction. Returns how much they vary. */
static double txp_masonry_profile(txp_masonry *m, double dx, double dy) {
    double energy = 0;
    m->normal[0] = -dy;
    m->normal[1] = dx;
    const double w = m->normal[0] * (m->width - 1), h = m->normal[1] * (m->height - 1);
    m->lowest = fmin(w, 0) + fmin(h, 0);
    m->bins = (int)(fabs(w) + fabs(h)) + 2;
    memset(m->mean, 0, (size_t)m->bins * sizeof *m->mean);
    memset(m->count, 0, (size_t)m->bins * sizeof *m->count);
    for (int y = 0; y < m->height; y++) {
        for (int x = 0; x < m->width; x++) {
            const int b = txm_clampi((int)(txp_across(m, x, y) + 0.5), 0, m->bins - 1);
            m->mean[b] += (double)m->gray[(size_t)y * (size_t)m->width + (size_t)x];
            m->count[b]++;
        }
    }
    for (int b = 0; b < m->bins; b++) {
        energy += m->count[b] ? m->mean[b] * m->mean[b] / m->count[b] : 0;
        m->mean[b] /= m->count[b] ? m->count[b] : 1;
    }
    return energy;
}

/* Correct the direction of the courses: along it the means vary most. */
static void txp_masonry_turn(txp_masonry *m) {
    double best = -1, dx = m->along[0], dy = m->along[1];
    for (int i = -TXP_TURNS; i <= TXP_TURNS; i++) {
        double sine, cosine;
        txm_sincos(TXP_TURN_STEP * i, &sine, &cosine);
        const double x = m->along[0] * cosine - m->along[1] * sine;
        const double y = m->along[0] * sine + m->along[1] * cosine;
        const double energy = txp_masonry_profile(m, x, y);
        if (energy <= best) continue;
        best = energy;
        dx = x;
        dy = y;
    }
    m->along[0] = dx;
    m->along[1] = dy;
    txp_masonry_profile(m, dx, dy);
}

/* Signals along the same axis, one after the other, of which some values are not known. */
typedef struct txp_signals {
    int count, length;
    const double *value; /* count * length */
    const int *known;    /* the same; 0: it is not */
} txp_signals;

/* The correlation of signals with themselves, moved; -2: out of reach. */
static double txp_signals_alike(const txp_signals *s, int by) {
    double n = 0, a = 0, b = 0, aa = 0, bb = 0, ab = 0;
    if (by < 0 || by + 2 > s->length) return -2;
    for (int k = 0; k < s->count; k++) {
        const double *p = s->value + (size_t)k * (size_t)s->length;
        const int *is_known = s->known + (size_t)k * (size_t)s->length;
        for (int i = 0; i + by < s->length; i++) {
            if (!is_known[i] || !is_known[i + by]) continue;
            n += 1;
            a += p[i];
            b += p[i + by];
            aa += p[i] * p[i];
            bb += p[i + by] * p[i + by];
            ab += p[i] * p[i + by];
        }
    }
    if (!(n > 1)) return 0;
    aa -= a * a / n;
    bb -= b * b / n;
    return aa > 0 && bb > 0 ? (ab - a * b / n) / sqrt(aa * bb) : 0;
}

/* The maximum within reach of a lag, with its fraction. */
static double txp_signals_peak(const txp_signals *s, double near_by, int reach, double *height) {
    const int middle = (int)(near_by + 0.5);
    int best = middle;
    for (int i = middle - reach; i <= middle + reach; i++)
        if (txp_signals_alike(s, i) > txp_signals_alike(s, best)) best = i;
    const double l = txp_signals_alike(s, best - 1), c = txp_signals_alike(s, best);
    const double r = txp_signals_alike(s, best + 1);
    *height = c;
    return best + (l > -2 && r > -2 && l + r < 2 * c ? 0.5 * (l - r) / (l + r - 2 * c) : 0);
}

/* The shortest period of signals up to `most`; 0: they have none as clear as that. */
static double txp_signals_period(const txp_signals *s, int most, double clear) {
    double best = 0, height;
    for (int turn = 0; turn < 2; turn++) {
        double before = 1, c = txp_signals_alike(s, 1), least = 1;
        for (int i = 1; i < most; i++) {
            const double after = txp_signals_alike(s, i + 1);
            least = fmin(least, c);
            const int is_peak = c >= before && c >= after && least < TXP_PEAK_DIP * c;
            if (is_peak && !turn) best = fmax(best, c);
            if (is_peak && turn && c >= TXP_LATTICE_ALIKE * best) {
                double period = txp_signals_peak(s, i, 1, &height);
                for (int k = 2; k * period < most; k++) { /* farther peaks tell more exactly */
                    const double far_peak = txp_signals_peak(s, k * period, 2, &height);
                    if (height < TXP_FAR_ALIKE * c) break;
                    period = far_peak / k;
                }
                return period;
            }
            before = c;
            c = after;
        }
        if (best < clear) return 0;
    }
    return 0;
}

/* What differs along the courses: sums over thin strips along them. */
typedef struct txp_strips {
    int count, length; /* strips; pixels along                                                    */
    double left;       /* along, of the first of them                                             */
    double *sum;
    int *pixels;       /* of each sum                                                             */
} txp_strips;

static int txp_strips_make(const txp_masonry *m, txm_arena *arena, txp_strips *s) {
    const double w = m->along[0] * (m->width - 1), h = m->along[1] * (m->height - 1);
    s->left = fmin(w, 0) + fmin(h, 0);
    s->length = (int)(fabs(w) + fabs(h)) + 2;
    s->count = (int)(m->bins / m->pitch * (int)TXP_SLOTS) + 1;
    s->sum = (double *)txm_arena_zero(arena, (size_t)s->count * (size_t)s->length, sizeof *s->sum);
    s->pixels =
        (int *)txm_arena_zero(arena, (size_t)s->count * (size_t)s->length, sizeof *s->pixels);
    if (arena->failed) return 0;
    for (int y = 0; y < m->height; y++) {
        for (int x = 0; x < m->width; x++) {
            const double v = txp_across(m, x, y), u = m->along[0] * x + m->along[1] * y - s->left;
            const int b = txm_clampi((int)(v + 0.5), 0, m->bins - 1);
            const int strip = txm_clampi((int)(v / m->pitch * (int)TXP_SLOTS), 0, s->count - 1);
            const size_t at = (size_t)strip * (size_t)s->length +
                              (size_t)txm_clampi((int)(u + 0.5), 0, s->length - 1);
            s->sum[at] += (double)m->gray[(size_t)y * (size_t)m->width + (size_t)x] - m->mean[b];
            s->pixels[at]++;
        }
    }
    return 1;
}

/* The mean of `strips` strips from one on, less its own mean over `wide` pixels to both sides: joints
   count, not the tones of bricks. Returns its pixels. */
static int txp_course_signal(const txp_strips *s, int from, int strips, int wide, double *value,
                             int *known, double *sums) {
    int all = 0;
    memset(value, 0, (size_t)s->length * sizeof *value);
    memset(known, 0, (size_t)s->length * sizeof *known);
    for (int k = from < 0 ? 0 : from; k < from + strips && k < s->count; k++) {
        for (int i = 0; i < s->length; i++) {
            value[i] += s->sum[(size_t)k * (size_t)s->length + (size_t)i];
            known[i] += s->pixels[(size_t)k * (size_t)s->length + (size_t)i];
        }
    }
    sums[0] = sums[s->length + 1] = 0; /* of values; of how many are known */
    for (int i = 0; i < s->length; i++) {
        if (known[i]) value[i] /= known[i];
        all += known[i];
        sums[i + 1] = sums[i] + value[i];
        sums[s->length + 2 + i] = sums[s->length + 1 + i] + (known[i] > 0);
    }
    for (int i = 0; i < s->length; i++) {
        const int l = i - wide < 0 ? 0 : i - wide, r = i + wide + 1 < s->length ? i + wide + 1 : s->length;
        if (known[i])
            value[i] -= (sums[r] - sums[l]) / (sums[s->length + 1 + r] - sums[s->length + 1 + l]);
    }
    return all;
}

/* The courses, units of some strips each. */
typedef struct txp_bond {
    int count;        /* of those that are whole                                                  */
    double origin;    /* of the first, in units                                                   */
    txp_signals signals;
    double *phase;    /* of each, in bins                                                         */
    double alike;     /* mean correlation with their mean, aligned                                */
} txp_bond;

/* Find where units of some strips begin, and their signals; bond->count is 0 if there are too few.
   0: no memory. */
static int txp_bond_units(const txp_masonry *m, const txp_strips *s, int strips, txm_arena *arena,
                          txp_bond *b) {
    const int units = s->count / strips + 2, wide = (int)m->pitch + 1;
    const size_t length = (size_t)s->length;
    double best = -1;
    int start = 0, most = 0, first = -1;
    memset(b, 0, sizeof *b);
    double *value = (double *)txm_arena_alloc(arena, (size_t)units * length, sizeof *value);
    int *known = (int *)txm_arena_alloc(arena, (size_t)units * length, sizeof *known);
    double *sums = (double *)txm_arena_alloc(arena, 2 * (length + 1), sizeof *sums);
    if (arena->failed) return 0;
    for (int from = 0; from < strips; from++) {
        double energy = 0;
        int whole = 0;
        for (int i = -1; i + 1 < units; i++) {
            const int all = txp_course_signal(s, from + i * strips, strips, wide, value, known, sums);
            if (all > whole) whole = all;
            for (size_t k = 0; k < length; k++) energy += value[k] * value[k] * known[k];
        }
        if (energy <= best) continue;
        best = energy;
        start = from;
        most = whole;
    }
    for (int i = -1; i + 1 < units; i++) { /* whole ones follow each other */
        const size_t at = (size_t)b->count * length;
        const int all = txp_course_signal(s, start + i * strips, strips, wide, value + at, known + at, sums);
        if (all >= TXP_COURSE_WHOLE * most) {
            if (first < 0) first = i;
            b->count++;
        } else if (first >= 0) {
            break;
        }
    }
    b->origin = first + (double)start / strips;
    if (b->count < (int)TXP_LEAST_COURSES) b->count = 0;
    b->signals.count = b->count;
    b->signals.length = s->length;
    b->signals.value = value;
    b->signals.known = known;
    return 1;
}

/* A signal folded to one brick. */
static void txp_bond_profile(const txp_signals *s, int k, double period, double *profile) {
    int count[TXP_PROFILE_BINS] = {0};
    double mean = 0;
    memset(profile, 0, TXP_PROFILE_BINS * sizeof *profile);
    for (int i = 0; i < s->length; i++) {
        const size_t at = (size_t)k * (size_t)s->length + (size_t)i;
        const double u = i / period - floor(i / period);
        const int bin = txm_clampi((int)(u * (int)TXP_PROFILE_BINS), 0, TXP_PROFILE_BINS - 1);
        if (!s->known[at]) continue;
        profile[bin] += s->value[at];
        count[bin]++;
    }
    for (int b = 0; b < TXP_PROFILE_BINS; b++) {
        if (count[b]) profile[b] /= count[b];
        mean += profile[b] / (int)TXP_PROFILE_BINS;
    }
    for (int b = 0; b < TXP_PROFILE_BINS; b++) profile[b] -= mean;
}

/* By how many bins a profile lies after a model, and how alike they are then. */
static double txp_profile_align(const double *profile, const double *model, double *alike) {
    double c[TXP_PROFILE_BINS], pp = 0, mm = 0;
    int best = 0;
    for (int i = 0; i < TXP_PROFILE_BINS; i++) {
        c[i] = 0;
        pp += profile[i] * profile[i];
        mm += model[i] * model[i];
        for (int b = 0; b < TXP_PROFILE_BINS; b++)
            c[i] += profile[(b + i) % TXP_PROFILE_BINS] * model[b];
        if (c[i] > c[best]) best = i;
    }
    const double l = c[(best + TXP_PROFILE_BINS - 1) % TXP_PROFILE_BINS];
    const double r = c[(best + 1) % TXP_PROFILE_BINS];
    *alike = pp > 0 && mm > 0 ? c[best] / sqrt(pp * mm) : 0;
    return best + (l + r < 2 * c[best] ? 0.5 * (l - r) / (l + r - 2 * c[best]) : 0);
}

/* Align all units with their mean. 0: no memory. */
static int txp_bond_align(txp_bond *b, double period, txm_arena *arena) {
    double model[TXP_PROFILE_BINS], most = -1;
    double(*profile)[TXP_PROFILE_BINS] = (double(*)[TXP_PROFILE_BINS])txm_arena_alloc(
        arena, (size_t)b->count, sizeof *profile);
    b->phase = (double *)txm_arena_alloc(arena, (size_t)b->count, sizeof *b->phase);
    if (arena->failed) return 0;
    for (int i = 0; i < b->count; i++) {
        double energy = 0;
        txp_bond_profile(&b->signals, i, period, profile[i]);
        for (int k = 0; k < TXP_PROFILE_BINS; k++) energy += profile[i][k] * profile[i][k];
        if (energy > most) memcpy(model, profile[i], sizeof model);
        most = fmax(most, energy);
    }
    for (int round = 0; round < TXP_ALIGNINGS; round++) {
        double sum[TXP_PROFILE_BINS] = {0};
        b->alike = 0;
        for (int i = 0; i < b->count; i++) {
            double alike;
            b->phase[i] = txp_profile_align(profile[i], model, &alike);
            b->alike += alike / b->count;
            const int by = (int)floor(b->phase[i] + 0.5) + TXP_PROFILE_BINS;
            for (int k = 0; k < TXP_PROFILE_BINS; k++)
                sum[k] += profile[i][(k + by) % TXP_PROFILE_BINS];
        }
        memcpy(model, sum, sizeof model);
    }
    return 1;
}

/* The shift from one course to the next with which the phases are nearly those of a lattice, in steps;
   *off: the largest difference from it. */
static double txp_bond_slope(const txp_bond *b, double *off) {
    double best = 0;
    *off = 1;
    for (int t = 0; t < 4 * (int)TXP_PROFILE_BINS; t++) {
        const double slope = (double)t / (4 * (int)TXP_PROFILE_BINS);
        double least = 0, most = 0;
        for (int i = 1; i < b->count; i++) {
            double d = (b->phase[i] - b->phase[0]) / (int)TXP_PROFILE_BINS - slope * i;
            d -= floor(d + 0.5);
            least = fmin(least, d);
            most = fmax(most, d);
        }
        if (0.5 * (most - least) >= *off) continue;
        *off = 0.5 * (most - least);
        best = slope;
    }
    return best;
}

/* How far the change from course i to course j is from any between two neighbours. */
static double txp_bond_break(const txp_courses *c, int i, int j) {
    double least = 1;
    for (int k = 0; k + 1 < c->count; k++) {
        double d = (double)c->phase[j] - (double)c->phase[i] -
                   ((double)c->phase[k + 1] - (double)c->phase[k]);
        d -= floor(d + 0.5);
        least = fmin(least, fabs(d));
    }
    return least;
}

/* Choose the courses that are repeated, so that where they begin again the bond looks like one that
   is there. around: see txp_courses. */
static void txp_courses_cycle(txp_courses *c, int around) {
    double best = 2;
    c->around = around;
    for (int cycle = c->count; cycle >= 2 && cycle > c->count / 2; cycle--) {
        for (int first = 0; first + cycle <= c->count; first++) {
            const int last = around ? (around - 1) % cycle : cycle - 1;
            double off = txp_bond_break(c, first + last, first);
            if (!around || around > cycle)
                off = fmax(off, txp_bond_break(c, first + cycle - 1, first));
            if (off >= best) continue;
            best = off;
            c->first = first;
            c->cycle = cycle;
        }
    }
}

/* The shortest step of a lattice along the courses; 0: it has none. v: in pixels of level top. */
static double txp_step_along(const double v[4], const double d[2]) {
    double shortest = 0;
    for (int i = -3; i <= 3; i++) {
        for (int j = -3; j <= 3; j++) {
            const double x = i * v[0] + j * v[2], y = i * v[1] + j * v[3];
            const double length = x * d[0] + y * d[1];
            if (length < (double)TXP_RIDGE_FROM || fabs(y * d[0] - x * d[1]) > TXP_RIDGE_WIDE) continue;
            if (!(shortest > 0) || length < shortest) shortest = length;
        }
    }
    return shortest;
}

/* Is a step along the courses one that shows in them? brick: as long as those are; 0: of any length. */
static int txp_step_shows(const txp_signals *s, double step, double brick) {
    double height;
    if (!(step > 0)) return 0;
    if (!(brick > 0)) {
        if (step >= TXP_BRICK_SEEN * s->length) return 1; /* too few are seen to tell */
        txp_signals_peak(s, step, 2, &height);
        return height >= 0.5 * TXP_BRICK_CLEAR;
    }
    const double bricks = step / brick;
    return bricks > 0.5 && fabs(bricks - floor(bricks + 0.5)) <= TXP_BRICK_SAME;
}

/* The gray picture of a level, in which courses are measured; d: their direction. 0: no memory. */
static int txp_masonry_make(const txp_source *s, int level, const double d[2], txm_arena *scratch,
                            txp_masonry *m) {
    const txp_stack *t = &s->stack[level];
    memset(m, 0, sizeof *m);
    m->width = t->wide[0];
    m->height = t->high[0];
    const size_t bins = (size_t)m->width + (size_t)m->height + 2; /* whatever the direction */
    m->gray = (float *)txm_arena_alloc(scratch, (size_t)m->width * (size_t)m->height, sizeof *m->gray);
    m->mean = (double *)txm_arena_alloc(scratch, bins, sizeof *m->mean);
    m->count = (int *)txm_arena_alloc(scratch, bins, sizeof *m->count);
    if (scratch->failed) return 0;
    for (int y = 0; y < m->height; y++)
        for (int x = 0; x < m->width; x++)
            m->gray[(size_t)y * (size_t)m->width + (size_t)x] =
                (float)txp_gray_of(s, txp_stack_at(s, t, x, y));
    memcpy(m->along, d, sizeof m->along);
    txp_masonry_turn(m);
    return 1;
}

/* The bond of units of one course or, if courses take turns, of more. 0: no memory. */
static int txp_bond_find(const txp_masonry *m, const txp_strips *s, double brick, txm_arena *scratch,
                         txp_bond *bond, int *courses) {
    memset(bond, 0, sizeof *bond);
    *courses = 1;
    for (int k = 1; k <= TXP_COURSE_UNITS; k++) {
        txp_bond more;
        if (!txp_bond_units(m, s, k * (int)TXP_SLOTS, scratch, &more)) return 0;
        if (!more.count) break;
        if (!txp_bond_align(&more, brick, scratch)) return 0;
        if (k > 1 && more.alike < bond->alike + TXP_UNIT_GAIN) continue;
        *bond = more;
        *courses = k;
    }
    return 1;
}

/* Look for courses where a correlation at level top is high in one direction; v, *has: the lattice
   found in it, which is replaced if it does not know how long a brick is. 0: no memory. */
static int txp_courses_find(const txp_source *s, const txp_correlation *k, int top, double v[4], int *has,
                            txp_courses *c, txm_arena *memory, txm_arena *scratch) {
    double d[2] = {1, 0}, off;
    txp_masonry m;
    txp_strips strips;
    txp_bond bond;
    int level = 0, courses;
    if (txp_ridge_find(k, d) < TXP_RIDGE_CLEAR) return 1;
    while (level < top && (s->stack[level].wide[0] > (int)TXP_PROFILE_SIDE ||
                           s->stack[level].high[0] > (int)TXP_PROFILE_SIDE))
        level++;
    if (!txp_masonry_make(s, level, d, scratch, &m)) return 0;
    txp_signals across = {1, m.bins, m.mean, m.count};
    m.pitch = txp_signals_period(&across, m.bins / (int)TXP_LEAST_COURSES, TXP_PITCH_CLEAR);
    if (!(m.pitch > 0)) return 1;
    if (!txp_strips_make(&m, scratch, &strips)) return 0;
    if (!txp_bond_units(&m, &strips, TXP_SLOTS, scratch, &bond)) return 0;
    if (!bond.count) return 1;
    const double brick =
        txp_signals_period(&bond.signals, (int)(TXP_BRICK_SEEN * strips.length), TXP_BRICK_CLEAR);
    const double part = (double)(1 << level) / (1 << top); /* pixels of level top */
    if (*has && txp_step_shows(&bond.signals, txp_step_along(v, m.along) / part, brick)) return 1;
    if (!(brick > 0)) { /* planks of any length */
        *has = 1;
        for (int i = 0; i < 2; i++) {
            v[i] = 0;
            v[2 + i] = m.normal[i] * m.pitch * part;
        }
        return 1;
    }
    if (!txp_bond_find(&m, &strips, brick, scratch, &bond, &courses)) return 0;
    if (bond.alike < TXP_COURSE_ALIKE) return 1;
    *has = 1;
    for (int i = 0; i < 2; i++) {
        v[i] = m.along[i] * brick * part;
        v[2 + i] = m.normal[i] * courses * m.pitch * part;
    }
    const double slope = txp_bond_slope(&bond, &off);
    if (off <= TXP_COURSE_EVEN) { /* each course is moved as much: a lattice */
        for (int i = 0; i < 2; i++) v[2 + i] += (slope > 0.5 ? slope - 1 : slope) * v[i];
        return 1;
    }
    c->phase = (float *)txm_arena_alloc(memory, (size_t)bond.count, sizeof *c->phase);
    if (!c->phase) return 0;
    c->count = bond.count;
    c->origin = bond.origin + m.lowest / (courses * m.pitch);
    for (int i = 0; i < c->count; i++) {
        const double p = bond.phase[i] / (int)TXP_PROFILE_BINS;
        c->phase[i] = txm_float(p - floor(p));
    }
    txp_courses_cycle(c, 0);
    return 1;
}

/* ---- the stack of sheets ------------------------------------------------------------------ */

/* Sample a map between its pixels: cubic convolution (Keys, a = -1/2), clamped at the border and to
   the range of the four nearest pixels, so that it does not overshoot; exact at whole numbers. */
static void txp_cubic(double t, double w[4]) {
    w[0] = ((-0.5 * t + 1) * t - 0.5) * t;
    w[1] = (1.5 * t - 2.5) * t * t + 1;
    w[2] = ((-1.5 * t + 2) * t + 0.5) * t;
    w[3] = (0.5 * t - 0.5) * t * t;
}

/* 4 x 4 pixels and their weights */
typedef struct txp_taps {
    double wx[4], wy[4];
    int x[4], y[4];
} txp_taps;

static txp_taps txp_taps_at(const txm_image *im, double x, double y) {
    const double fx = floor(x), fy = floor(y);
    const int ix = (int)fx, iy = (int)fy;
    txp_taps t;
    txp_cubic(x - fx, t.wx);
    txp_cubic(y - fy, t.wy);
    for (int k = 0; k < 4; k++) {
        t.x[k] = txm_clampi(ix + k - 1, 0, im->width - 1);
        t.y[k] = txm_clampi(iy + k - 1, 0, im->height - 1);
    }
    return t;
}

static inline float txp_limited(double sum, double low, double high) {
    return txm_float(sum < low ? low : sum > high ? high : sum);
}

/* A channel, as it is. */
static float txp_sample_channel(const txm_image *im, const txp_taps *t, int c) {
    double sum = 0, low = 1e30, high = -1e30;
    for (int j = 0; j < 4; j++) {
        double row = 0;
        for (int i = 0; i < 4; i++) {
            const double v = txm_image_get(im, t->x[i], t->y[j], c);
            row += t->wx[i] * v;
            if (i == 1 || i == 2) {
                if (j == 1 || j == 2) {
                    low = v < low ? v : low;
                    high = v > high ? v : high;
                }
            }
        }
        sum += t->wy[j] * row;
    }
    return txp_limited(sum, low, high);
}

/* The colours, weighted by alpha and within the range of the nearest visible pixels. 0: all alphas
   are equal, or no nearest pixel is visible; then they are as they are. */
static int txp_sample_shown(const txm_image *im, const txp_taps *t, float *out) {
    const int colours = im->channels - 1;
    double alpha[16], shown = 0, least = 1e30, most = -1e30;
    int nearest = 0;
    for (int k = 0; k < 16; k++) {
        const double a = (double)txm_image_get(im, t->x[k % 4], t->y[k / 4], colours);
        alpha[k] = a > 0 ? a : 0;
        least = alpha[k] < least ? alpha[k] : least;
        most = alpha[k] > most ? alpha[k] : most;
        shown += t->wx[k % 4] * t->wy[k / 4] * alpha[k];
    }
    for (int k = 5; k < 11; k += k == 6 ? 3 : 1) nearest |= alpha[k] > 0;
    if (least >= most || !nearest) return 0;
    for (int c = 0; c < colours; c++) {
        double sum = 0, low = 1e30, high = -1e30;
        for (int k = 0; k < 16; k++) {
            const double v = (double)txm_image_get(im, t->x[k % 4], t->y[k / 4], c);
            const int is_nearest = k == 5 || k == 6 || k == 9 || k == 10;
            sum += t->wx[k % 4] * t->wy[k / 4] * alpha[k] * v;
            if (!is_nearest || !(alpha[k] > 0)) continue;
            low = v < low ? v : low;
            high = v > high ? v : high;
        }
        /* beside what shows the negative weights may outweigh the others */
        const double mean = shown > most / 64 ? sum / shown : (double)txp_sample_channel(im, t, c);
        out[c] = txp_limited(mean, low, high);
    }
    return 1;
}

/* has_alpha: the last channel says how much of the others shows */
static void txp_sample(const txm_image *im, double x, double y, int is_label, int has_alpha,
                       float *out) {
    const int channels = im->channels;
    if (is_label) {
        const int ix = txm_clampi((int)floor(x + 0.5), 0, im->width - 1);
        const int iy = txm_clampi((int)floor(y + 0.5), 0, im->height - 1);
        for (int c = 0; c < channels; c++) out[c] = txm_image_get(im, ix, iy, c);
        return;
    }
    const txp_taps t = txp_taps_at(im, x, y);
    const int first = has_alpha && txp_sample_shown(im, &t, out) ? channels - 1 : 0;
    for (int c = first; c < channels; c++) out[c] = txp_sample_channel(im, &t, c);
}

/* The place in its exemplar of pixel (x, y) of a sheet. */
static inline void txp_sheet_place(const txp_sheet *s, double x, double y, double *ex, double *ey) {
    *ex = s->xx * x + s->xy * y + s->x0;
    *ey = s->yx * x + s->yy * y + s->y0;
}

/* A description after the checks, defaults filled in. */
typedef struct txp_setup {
    txm_image maps[TEXPATCH_MAX_EXEMPLARS][TEXPATCH_MAX_MAPS]; /* resolved                     */
    txm_image guides[TEXPATCH_MAX_EXEMPLARS], masks[TEXPATCH_MAX_EXEMPLARS];
    texpatch_map kinds[TEXPATCH_MAX_MAPS];
    txm_image kept[TEXPATCH_MAX_MAPS]; /* pixels NULL: nothing is kept                        */
    int exemplar_count, map_count, width, height, tileable, patch, passes, turns, mirror, lattice;
    int is_default; /* passes were not given                                                  */
    float most_weight; /* of maps and guide: the differences of that use all of a byte's range  */
    float novelty, guide_weight, low[TEXPATCH_MAX_MAPS], high[TEXPATCH_MAX_MAPS];
    float guide_low, guide_high;
    double lattice_vectors[4];
    uint64_t seed;
} txp_setup;

/* Is the last channel of a map alpha? Data and normals have none: their last channel is one of them. */
static inline int txp_has_alpha(const texpatch_map *kind, const txm_image *im) {
    return !kind->is_normal && !kind->is_data && txm_image_has_alpha(im);
}

/* The compared bytes of a pixel of one picture; returns how many. Colours are multiplied by alpha, so
   that they count as much as they show. */
static int txp_feature(const txm_image *im, double x, double y, int whole, int is_label,
                       int has_alpha, double low, double high, double weight, uint8_t *out) {
    float v[4];
    if (whole) {
        for (int c = 0; c < im->channels; c++) v[c] = txm_image_get(im, (int)x, (int)y, c);
    } else {
        txp_sample(im, x, y, is_label, has_alpha, v);
    }
    const int last = im->channels - 1;
    const double alpha = has_alpha ? (double)txm_clampf(v[last], 0, 1) : 1;
    const double scale = high > low ? 255 / (high - low) * weight : 0;
    for (int c = 0; c < im->channels; c++) {
        const double f = has_alpha && c == last ? 255 * weight * alpha + 0.5
                                                : ((double)v[c] - low) * scale * alpha + 0.5;
        out[c] = (uint8_t)(f < 0 ? 0 : f > 255 ? 255 : f);
    }
    return im->channels;
}

/* The compared bytes of a pixel: maps with weight, padding, guide last. guide may be NULL. */
static void txp_features(const txp_setup *u, const txp_source *s, const txm_image *maps,
                         const txm_image *guide, double x, double y, int whole, uint8_t *out) {
    const double most = (double)u->most_weight;
    int n = 0;
    memset(out, 0, (size_t)s->bytes);
    for (int m = 0; m < u->map_count && maps; m++) {
        if (!(u->kinds[m].weight > 0)) continue;
        n += txp_feature(&maps[m], x, y, whole, u->kinds[m].is_label,
                         txp_has_alpha(&u->kinds[m], &maps[m]), (double)u->low[m],
                         (double)u->high[m], (double)u->kinds[m].weight / most, out + n);
    }
    if (s->guide_bytes && guide)
        txp_feature(guide, x, y, whole, 1, txm_image_has_alpha(guide), (double)u->guide_low,
                    (double)u->guide_high, (double)u->guide_weight / most, out + s->guide_at);
}

/* Halve a level of the stack, sheet by sheet. */
static void txp_stack_halve(const txp_source *s, const txp_stack *from, txp_stack *to) {
    const size_t n = (size_t)s->bytes;
    for (int k = 0; k < s->sheets; k++) {
        for (int y = 0; y < to->high[k]; y++) {
            const uint8_t *a = txp_stack_at(s, from, 0, from->first[k] + 2 * y);
            const uint8_t *b = a + from->pitch;
            uint8_t *out = to->pixels + (size_t)(to->first[k] + y) * to->pitch;
            for (int x = 0; x < to->wide[k]; x++, a += 2 * n, b += 2 * n, out += n) {
                for (size_t c = 0; c < n; c++)
                    out[c] = (uint8_t)((a[c] + a[n + c] + b[c] + b[n + c] + 2) / 4);
            }
        }
    }
}

/* Room for one level: sheets one below the other. */
static txm_status txp_stack_make(const txp_source *s, txp_stack *k, txm_arena *arena, int has_mask,
                                 txm_env *env) {
    int y = 0;
    k->width = 0;
    for (int n = 0; n < s->sheets; n++) {
        k->first[n] = y;
        y += k->high[n];
        if (k->wide[n] > k->width) k->width = k->wide[n];
    }
    k->height = y;
    k->pitch = (size_t)k->width * (size_t)s->bytes;
    k->pixels = (uint8_t *)txm_arena_zero(arena, (size_t)k->height + 1, k->pitch);
    k->sheet = (uint8_t *)txm_arena_alloc(arena, (size_t)k->height, 1);
    k->bad = NULL;
    if (has_mask)
        k->bad = (uint32_t *)txm_arena_zero(arena, (size_t)(k->width + 1) * (size_t)(k->height + 1),
                                            sizeof *k->bad);
    if (arena->failed)
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the exemplars");
    for (int n = 0; n < s->sheets; n++) memset(k->sheet + k->first[n], n, (size_t)k->high[n]);
    return TXM_OK;
}

/* The summed-area table of unusable pixels; bad: one byte for each pixel. */
static void txp_stack_sum(txp_stack *k, const uint8_t *bad) {
    const size_t w = (size_t)k->width + 1;
    for (int y = 0; y < k->height; y++) {
        uint32_t row = 0;
        for (int x = 0; x < k->width; x++) {
            row += bad[(size_t)y * (size_t)k->width + (size_t)x];
            k->bad[(size_t)(y + 1) * w + (size_t)x + 1] =
                k->bad[(size_t)y * w + (size_t)x + 1] + row;
        }
    }
}

/* The turned (and stretched) sheets of all exemplars. stretch: the matrix from sheet to exemplar
   pixels, column by column, or NULL. */
static void txp_sheets(const txp_setup *u, txp_source *s, const double *stretch) {
    static const int turn_x[4][2] = {{1, 0}, {0, -1}, {-1, 0}, {0, 1}};
    s->sheets = 0;
    for (int e = 0; e < u->exemplar_count; e++) {
        const int w = u->maps[e][0].width, h = u->maps[e][0].height;
        for (int m = 0; m <= (u->mirror ? 1 : 0); m++) {
            for (int t = 0; t < 4; t += 4 / u->turns) {
                TXM_ASSERT(s->sheets < TXP_MAX_SHEETS);
                txp_sheet *k = &s->sheet[s->sheets++];
                k->exemplar = e;
                k->turn = t + 4 * m;
                k->width = t % 2 ? h : w;
                k->height = t % 2 ? w : h;
                k->plain = 1;
                /* The sheet shows the exemplar turned counter-clockwise t times; the inverse, from
                   sheet to exemplar, turns clockwise. y points down. */
                k->xx = turn_x[t][0];
                k->xy = turn_x[t][1];
                k->yx = -turn_x[t][1];
                k->yy = turn_x[t][0];
                k->x0 = k->xx + k->xy < 0 ? w - 1 : 0;
                k->y0 = k->yx + k->yy < 0 ? h - 1 : 0;
                if (m) { /* mirrored before turning */
                    k->xx = -k->xx;
                    k->xy = -k->xy;
                    k->x0 = w - 1 - k->x0;
                }
                if (stretch) { /* one sheet: (x, y) is the exemplar at stretch (x, y) */
                    k->plain = 0;
                    k->xx = stretch[0];
                    k->yx = stretch[1];
                    k->xy = stretch[2];
                    k->yy = stretch[3];
                    /* the largest centred sheet whose corners stay inside */
                    const double ax = fabs(k->xx), bx = fabs(k->xy), ay = fabs(k->yx),
                                 by = fabs(k->yy);
                    double sw = w / ax, sh = h / by;
                    for (int i = 0; i < 8; i++) {
                        const double ow = ax * (sw - 1) + bx * (sh - 1),
                                     oh = ay * (sw - 1) + by * (sh - 1);
                        const double f = fmin((w - 1) / ow, (h - 1) / oh);
                        sw = (sw - 1) * f + 1;
                        sh = (sh - 1) * f + 1;
                    }
                    k->width = (int)sw;
                    k->height = (int)sh;
                    k->x0 =
                        (w - 1) * 0.5 - (k->xx * (k->width - 1) + k->xy * (k->height - 1)) * 0.5;
                    k->y0 =
                        (h - 1) * 0.5 - (k->yx * (k->width - 1) + k->yy * (k->height - 1)) * 0.5;
                }
            }
        }
    }
}

/* The number of levels, and the sizes of the sheets at each. least: the smaller side of the output
   that wraps, else large. */
static void txp_source_sizes(txp_source *s, int least) {
    int side = least;
    for (int n = 0; n < s->sheets; n++) {
        const txp_sheet *k = &s->sheet[n];
        s->stack[0].wide[n] = k->width;
        s->stack[0].high[n] = k->height;
        if (k->width < side) side = k->width;
        if (k->height < side) side = k->height;
    }
    for (s->levels = 1; side >= TXP_COARSE && s->levels < TXP_MAX_LEVELS; s->levels++, side /= 2) {
        for (int n = 0; n < s->sheets; n++) {
            s->stack[s->levels].wide[n] = s->stack[s->levels - 1].wide[n] / 2;
            s->stack[s->levels].high[n] = s->stack[s->levels - 1].high[n] / 2;
        }
    }
}

typedef struct txp_rows {
    const txp_setup *setup;
    txp_source *source;
    uint8_t *bad;
    uint8_t *mask[TEXPATCH_MAX_EXEMPLARS]; /* 0: the pixel may not be used; NULL: all may be     */
} txp_rows;

#define TXP_WHOLE 0.001 /* pixels: so near to its centre nothing of its neighbours is seen */

/* The bytes of a mask; *bytes is NULL without one. */
static txm_status txp_read_mask(const txm_image *mask, txm_mask_use use, txm_arena *arena,
                                uint8_t **bytes, txm_env *env) {
    *bytes = NULL;
    if (!mask || !mask->pixels) return TXM_OK;
    *bytes = (uint8_t *)txm_arena_alloc(arena, (size_t)mask->width, (size_t)mask->height);
    if (!*bytes) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the masks");
    txm_mask_read(mask, use, *bytes);
    return TXM_OK;
}

/* Do the pixels between which (x, y) of the exemplar lies all count? */
static int txp_counts(const uint8_t *mask, const txm_image *im, double x, double y) {
    const int left = txm_clampi((int)floor(x + TXP_WHOLE), 0, im->width - 1);
    const int top = txm_clampi((int)floor(y + TXP_WHOLE), 0, im->height - 1);
    const int right = txm_clampi((int)ceil(x - TXP_WHOLE), 0, im->width - 1);
    const int bottom = txm_clampi((int)ceil(y - TXP_WHOLE), 0, im->height - 1);
    const uint8_t *upper = mask + (size_t)top * (size_t)im->width;
    const uint8_t *lower = mask + (size_t)bottom * (size_t)im->width;
    return upper[left] && upper[right] && lower[left] && lower[right];
}

/* One row of the stack at full size. */
static void txp_stack_row(void *context, int y) {
    const txp_rows *r = (const txp_rows *)context;
    const txp_source *s = r->source;
    const txp_stack *k = &s->stack[0];
    const int n = k->sheet[y];
    const txp_sheet *sheet = &s->sheet[n];
    const txm_image *im = &r->setup->maps[sheet->exemplar][0];
    const uint8_t *mask = r->mask[sheet->exemplar];
    for (int x = 0; x < k->wide[n]; x++) {
        double ex, ey;
        txp_sheet_place(sheet, x, y - k->first[n], &ex, &ey);
        txp_features(r->setup, s, r->setup->maps[sheet->exemplar],
                     &r->setup->guides[sheet->exemplar], ex, ey, sheet->plain,
                     k->pixels + (size_t)y * k->pitch + (size_t)x * (size_t)s->bytes);
        if (r->bad && mask) {
            r->bad[(size_t)y * (size_t)k->width + (size_t)x] = (uint8_t)!txp_counts(mask, im, ex, ey);
        }
    }
}

/* All levels of the stack. */
static txm_status txp_stacks(const txp_setup *u, txp_source *s, txm_arena *arena, txm_env *env) {
    txm_arena scratch;
    txp_rows rows;
    uint8_t *bad[TXP_MAX_LEVELS] = {NULL};
    int has_mask = 0;
    txm_status status = TXM_OK;
    memset(&rows, 0, sizeof rows);
    txm_arena_init(&scratch, env);
    for (int e = 0; e < u->exemplar_count && status == TXM_OK; e++) {
        has_mask |= u->masks[e].pixels != NULL;
        status = txp_read_mask(&u->masks[e], TXM_MASK_ALLOWS, &scratch, &rows.mask[e], env);
    }
    for (int l = 0; l < s->levels && status == TXM_OK; l++) {
        status = txp_stack_make(s, &s->stack[l], arena, has_mask, env);
        if (status != TXM_OK || !has_mask) continue;
        bad[l] = (uint8_t *)txm_arena_zero(
            &scratch, (size_t)s->stack[l].width * (size_t)s->stack[l].height, 1);
        if (!bad[l]) status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the masks");
    }
    rows.setup = u;
    rows.source = s;
    rows.bad = bad[0];
    if (status == TXM_OK) {
        txm_parallel_for(env, s->stack[0].height, txp_stack_row, &rows);
        for (int l = 1; l < s->levels; l++) txp_stack_halve(s, &s->stack[l - 1], &s->stack[l]);
        for (int l = 0; l < s->levels && has_mask; l++) {
            txp_stack *k = &s->stack[l];
            for (int n = 0; n < s->sheets && l > 0; n++) {
                const size_t w = (size_t)s->stack[l - 1].width;
                for (int y = 0; y < k->high[n]; y++) {
                    for (int x = 0; x < k->wide[n]; x++) {
                        const uint8_t *b = bad[l - 1] +
                                           (size_t)(s->stack[l - 1].first[n] + 2 * y) * w +
                                           2 * (size_t)x;
                        bad[l][(size_t)(k->first[n] + y) * (size_t)k->width + (size_t)x] =
                            (uint8_t)(b[0] | b[1] | b[w] | b[w + 1]);
                    }
                }
            }
            txp_stack_sum(k, bad[l]);
        }
    }
    txm_arena_free(&scratch);
    return status;
}

/* The contrast of the exemplars, from a few thousand random pairs of pixels. */
static void txp_find_contrast(txp_source *s) {
    const txp_stack *k = &s->stack[0];
    txm_rng rng = txm_rng_make(1, 2);
    uint64_t sum = 0;
    for (int i = 0; i < 4096; i++) {
        const uint8_t *p[2];
        for (int j = 0; j < 2; j++) {
            const int n = (int)txm_rng_below(&rng, (uint32_t)s->sheets);
            const int x = (int)txm_rng_below(&rng, (uint32_t)k->wide[n]);
            const int y = (int)txm_rng_below(&rng, (uint32_t)k->high[n]);
            p[j] = txp_stack_at(s, k, x, k->first[n] + y);
        }
        for (int b = 0; b < s->guide_at; b++) sum += (uint64_t)abs(p[0][b] - p[1][b]);
    }
    s->contrast = (double)sum / 4096;
}

enum { TXP_LATTICE_SIDE = 300 }; /* pixels: of a larger coarsest level only the middle is correlated, as
                                   time grows with the fourth power of this. It is larger only if the
                                   output is so small that no longer lattice fits                 */

/* Find the lattice at the coarsest level, unless the caller gives it, and set it for all levels; memory
   receives the phases of courses. */
static txm_status txp_lattice_search(const txp_setup *u, txp_source *s, txm_arena *memory,
                                     txm_env *env) {
    txm_arena scratch;
    txp_correlation k;
    double v[4] = {0, 0, 0, 0}, strongest = 0;
    s->has_lattice = s->is_random = 0;
    memset(&s->courses, 0, sizeof s->courses);
    if (u->lattice == 1) {
        memcpy(v, u->lattice_vectors, sizeof v);
        s->has_lattice = 1;
    } else if (s->sheets == 1) {
        const int top = s->levels - 1;
        const txp_stack *t = &s->stack[top];
        txm_arena_init(&scratch, env);
        k.width = t->wide[0];
        k.height = t->high[0];
        if ((double)k.width * k.height > (double)TXP_LATTICE_SIDE * (int)TXP_LATTICE_SIDE) {
            k.width = k.width < TXP_LATTICE_SIDE ? k.width : TXP_LATTICE_SIDE;
            k.height = k.height < TXP_LATTICE_SIDE ? k.height : TXP_LATTICE_SIDE;
        }
        const int left = (t->wide[0] - k.width) / 2, upper = (t->high[0] - k.height) / 2;
        k.reach_x = k.width * 5 / 8;
        k.reach_y = k.height * 5 / 8;
        int16_t *gray =
            (int16_t *)txm_arena_alloc(&scratch, (size_t)k.width * (size_t)k.height, sizeof *gray);
        k.at = (float *)txm_arena_alloc(
            &scratch, (size_t)(2 * k.reach_x + 1) * (size_t)(k.reach_y + 1), sizeof *k.at);
        if (scratch.failed) {
            txm_arena_free(&scratch);
            return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the lattice");
        }
        for (int y = 0; y < k.height; y++) {
            for (int x = 0; x < k.width; x++)
                gray[y * k.width + x] =
                    (int16_t)txp_gray_of(s, txp_stack_at(s, t, left + x, upper + y));
        }
        k.gray = gray;
        txm_parallel_for(env, k.reach_y + 1, txp_correlate_row, &k);
        int found = txp_lattice_find(&k, v, &strongest);
        if (u->lattice == 0 &&
            !txp_courses_find(s, &k, top, v, &found, &s->courses, memory, &scratch)) {
            txm_arena_free(&scratch);
            return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the lattice");
        }
        s->has_lattice = found && u->lattice != -1;
        s->is_random = !found && strongest < TXP_RANDOM;
        for (int i = 0; i < 4; i++) v[i] *= 1 << top;
        txm_arena_free(&scratch);
    }
    for (int l = 0; l < s->levels && s->has_lattice; l++)
        txp_lattice_set(&s->stack[l], v, 1.0 / (1 << l));
    return TXM_OK;
}

/* Fit a lattice to a torus: the steps nearest to `lattice` of which whole numbers add up to the
   sides that wrap. 0: there are none within a quarter of its length. */
static int txp_lattice_fit(const double lattice[4], int tileable, double width, double height,
                           double out[4]) {
    const double *a = lattice, *b = lattice + 2;
    const double det = txp_det(a, b), sides[2] = {width, height};
    double count[2][2], target[2][2];
    for (int d = 0; d < 2; d++) {
        /* whole steps to the end of this axis */
        const double x = d ? 0 : sides[0], y = d ? sides[1] : 0;
        const double u = (x * b[1] - y * b[0]) / det, v = (a[0] * y - a[1] * x) / det;
        count[d][0] = floor(u + 0.5);
        count[d][1] = floor(v + 0.5);
        target[d][0] = x;
        target[d][1] = y;
        if (!(tileable & (d ? TEXPATCH_TILE_Y : TEXPATCH_TILE_X))) { /* any length will do */
            target[d][0] = count[d][0] * a[0] + count[d][1] * b[0];
            target[d][1] = count[d][0] * a[1] + count[d][1] * b[1];
        }
    }
    const double m = count[0][0] * count[1][1] - count[0][1] * count[1][0];
    if (!(fabs(m) > 0.5)) return 0;
    for (int c = 0; c < 2; c++) { /* solve count (out a, out b) = target */
        out[c] = (count[1][1] * target[0][c] - count[0][1] * target[1][c]) / m;
        out[2 + c] = (count[0][0] * target[1][c] - count[1][0] * target[0][c]) / m;
    }
    for (int k = 0; k < 4; k += 2) {
        const double dx = out[k] - lattice[k], dy = out[k + 1] - lattice[k + 1];
        if (dx * dx + dy * dy >
            0.0625 * (lattice[k] * lattice[k] + lattice[k + 1] * lattice[k + 1]))
            return 0;
    }
    return fabs(txp_det(out, out + 2)) > 0.5 * fabs(det);
}

/* Close the bond of a canvas across its ends. Of a sheet that is not the exemplar itself the lattice
   counts from elsewhere; v: of the exemplar. 0: the torus is too small for it. */
static int txp_courses_close(const txp_setup *u, txp_source *s, const double v[4]) {
    const txp_sheet *k = &s->sheet[0];
    const double *i = s->stack[0].inverse;
    int around = 0;
    for (int d = 0; d < 2; d++) {
        if (!(u->tileable & (d ? TEXPATCH_TILE_Y : TEXPATCH_TILE_X))) continue;
        int n = abs((int)floor((d ? i[3] * u->height : i[2] * u->width) + 0.5));
        while (n) { /* the greatest common divisor */
            const int rest = around % n;
            around = n;
            n = rest;
        }
    }
    s->courses.origin -= (v[0] * k->y0 - v[1] * k->x0) / txp_det(v, v + 2);
    if (around == 1) return 0;
    txp_courses_cycle(&s->courses, around);
    return 1;
}

/* Sheets, stacks and lattice. If the output is a torus and the exemplar has a lattice, its sheet is
   stretched until whole steps of the lattice fit the sides.
   s       as the checks leave it; overwritten
   out     receives the source, which lies in memory, an arena that is made here             */
static txm_status txp_source_make(const txp_setup *u, txp_source *s, txp_source **out,
                                  txm_arena *memory, txm_env *env) {
    int least = INT_MAX;
    if (u->tileable & TEXPATCH_TILE_X) least = u->width;
    if (u->tileable & TEXPATCH_TILE_Y && u->height < least) least = u->height;
    txm_arena first, bond;
    double closed[4], stretch[4], det;
    double v[4];
    int is_free;
    txm_arena_init(&first, env);
    txm_arena_init(&bond, env);
    txp_sheets(u, s, NULL);
    txp_source_sizes(s, least);
    txm_status status = txp_stacks(u, s, &first, env);
    if (status == TXM_OK) status = txp_lattice_search(u, s, &bond, env);
    memcpy(v, s->stack[0].lattice, sizeof v);
    if (status != TXM_OK || !s->has_lattice || !u->tileable || s->sheets > 1) goto done;
    is_free = txp_is_free(v);
    if (is_free) { /* once along the output, whatever its length */
        const int is_upright = fabs(v[2]) > fabs(v[3]);
        const double length = (is_upright ? u->height / v[2] : u->width / v[3]);
        v[0] = length * v[3];
        v[1] = -length * v[2];
    }
    if (!txp_lattice_fit(v, u->tileable, u->width, u->height, closed)) {
        s->has_lattice = 0; /* the torus is too small for it */
        goto done;
    }
    /* the sheet shows at p the exemplar at stretch p: stretch maps closed to v */
    det = txp_det(closed, closed + 2);
    stretch[0] = (v[0] * closed[3] - v[2] * closed[1]) / det;
    stretch[1] = (v[1] * closed[3] - v[3] * closed[1]) / det;
    stretch[2] = (v[2] * closed[0] - v[0] * closed[2]) / det;
    stretch[3] = (v[3] * closed[0] - v[1] * closed[2]) / det;
    txm_arena_free(&first);
    txp_sheets(u, s, stretch);
    txp_source_sizes(s, least);
    status = txp_stacks(u, s, &first, env);
    if (is_free) closed[0] = closed[1] = 0;
    for (int l = 0; l < s->levels && status == TXM_OK; l++)
        txp_lattice_set(&s->stack[l], closed, 1.0 / (1 << l));
    if (s->courses.count && !txp_courses_close(u, s, v)) s->has_lattice = 0;
done:
    if (!s->has_lattice) s->courses.count = 0;
    if (status == TXM_OK && s->courses.count) {
        const float *phase = s->courses.phase;
        const size_t count = (size_t)s->courses.count;
        s->courses.phase = (float *)txm_arena_alloc(&first, count, sizeof *phase);
        if (s->courses.phase) memcpy(s->courses.phase, phase, count * sizeof *phase);
        else status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the lattice");
    }
    txm_arena_free(&bond);
    if (status == TXM_OK) {
        txp_find_contrast(s);
        *out = (txp_source *)txm_arena_alloc(&first, 1, sizeof **out);
        if (*out) **out = *s;
        else status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the exemplars");
    }
    if (status == TXM_OK) *memory = first;
    else txm_arena_free(&first);
    return status;
}

/* ---- checks of what the caller gives ---------------------------------------------------- */

static int txp_is_within(float x, float low, float high) {
    return x >= low && x <= high;
}

/* The smallest and largest sample of a map over all exemplars; 8- and 16-bit samples span 0..1.
   has_alpha: hidden colours do not count. */
static void txp_range(const txm_image *im, int has_alpha, float *low, float *high) {
    const size_t n = (size_t)im->channels;
    if (im->sample != TXM_F32) {
        *low = txm_minf(*low, 0);
        *high = txm_maxf(*high, 1);
        return;
    }
    for (int y = 0; y < im->height; y++) {
        const float *row = (const float *)txm_image_row_const(im, y);
        for (size_t i = 0; i < (size_t)im->width * n; i++) {
            if (has_alpha && !(row[i / n * n + n - 1] > 0)) continue;
            *low = txm_minf(*low, row[i]);
            *high = txm_maxf(*high, row[i]);
        }
    }
}

static txm_status txp_check_picture(const txm_image *im, const char *name, txm_env *env) {
    const txm_status status = txm_image_check(im, name, TEXPATCH_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    if (!txm_image_is_finite(im))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name, "samples must be finite");
    return TXM_OK;
}

/* Which of the compared bytes are alpha, and of which others. */
static void txp_find_alphas(const txp_setup *u, txp_source *s) {
    int n = 0;
    memset(s->alpha_at, -1, sizeof s->alpha_at);
    for (int m = 0; m < u->map_count; m++) {
        const txm_image *im = &u->maps[0][m];
        if (!(u->kinds[m].weight > 0)) continue;
        for (int c = 0; c < im->channels - 1 && txp_has_alpha(&u->kinds[m], im); c++) {
            const double weight = (double)u->kinds[m].weight / (double)u->most_weight;
            s->has_alpha = 1;
            s->alpha_at[n + c] = (int16_t)(n + im->channels - 1);
            s->opaque[n + c] = (uint8_t)(255 * weight + 0.5);
        }
        n += im->channels;
    }
}

/* A picture whose hidden colours are those of visible neighbours; of labels 0, for one label is not
   between others. The picture as it is if nothing is hidden, else a copy in memory. */
static txm_status txp_show(txm_image *im, int is_label, int wrap, txm_arena *memory, txm_env *env) {
    const txm_status status = txm_image_bled(im, wrap, memory, env, im);
    if (status != TXM_OK || !is_label || !txm_image_has_hidden(im)) return status;
    const size_t bytes = (size_t)im->channels * txm_sample_bytes(im->sample);
    for (int y = 0; y < im->height; y++) {
        char *pixel = (char *)txm_image_row(im, y);
        for (int x = 0; x < im->width; x++, pixel += bytes) {
            if (!(txm_image_get(im, x, y, im->channels - 1) > 0)) memset(pixel, 0, bytes);
        }
    }
    return status;
}

/* Replace all pictures of a setup in which colour is hidden. */
static txm_status txp_show_all(txp_setup *u, txm_arena *memory, txm_env *env) {
    txm_status status = TXM_OK;
    for (int e = 0; e < u->exemplar_count && status == TXM_OK; e++) {
        for (int m = 0; m < u->map_count && status == TXM_OK; m++) {
            if (txp_has_alpha(&u->kinds[m], &u->maps[e][m]))
                status = txp_show(&u->maps[e][m], u->kinds[m].is_label, 0, memory, env);
        }
        if (status == TXM_OK && u->guides[e].pixels)
            status = txp_show(&u->guides[e], 0, 0, memory, env);
    }
    for (int m = 0; m < u->map_count && status == TXM_OK; m++) {
        if (u->kept[m].pixels && txp_has_alpha(&u->kinds[m], &u->kept[m]))
            status = txp_show(&u->kept[m], u->kinds[m].is_label, u->tileable, memory, env);
    }
    return status;
}

/* The fields about exemplars and how they are treated; u and s are set. */
static txm_status txp_check_exemplars(const texpatch_desc *d, txp_setup *u, txp_source *s,
                                      txm_env *env) {
    txm_status status = TXM_OK;
    int bytes = 0;
    memset(u, 0, sizeof *u);
    memset(s, 0, sizeof *s);
    if (!d->exemplars || d->exemplar_count < 1 || d->exemplar_count > TEXPATCH_MAX_EXEMPLARS)
        return txm_fail(env, TXM_BAD_ARGUMENT, "exemplar_count must be 1 to 8, exemplars not NULL");
    if (d->map_count < 1 || d->map_count > TEXPATCH_MAX_MAPS)
        return txm_fail(env, TXM_BAD_ARGUMENT, "map_count must be 1 to 16");
    if (d->turns != 0 && d->turns != 1 && d->turns != 2 && d->turns != 4)
        return txm_fail(env, TXM_BAD_ARGUMENT, "turns must be 1, 2 or 4 (0 means 1)");
    if (d->patch < 0 || d->patch > TEXPATCH_MAX_SIDE)
        return txm_fail(env, TXM_BAD_ARGUMENT, "patch must be 0 to 16384 pixels");
    if (d->passes < -1 || d->passes > 16)
        return txm_fail(env, TXM_BAD_ARGUMENT, "passes must be 1 to 16, 0 for 3, or -1 for none");
    if (!txp_is_within(d->novelty, 0, 1))
        return txm_fail(env, TXM_BAD_ARGUMENT, "novelty must be 0 to 1");
    if (!txp_is_within(d->guide_weight, 0, 16))
        return txm_fail(env, TXM_BAD_ARGUMENT, "guide_weight must be 0 to 16");
    if (d->lattice < -1 || d->lattice > 1)
        return txm_fail(env, TXM_BAD_ARGUMENT, "lattice must be -1, 0 or 1");
    u->exemplar_count = d->exemplar_count;
    u->map_count = d->map_count;
    u->turns = d->turns ? d->turns : 1;
    u->mirror = d->mirror != 0;
    u->patch = d->patch;
    u->passes = d->passes < 0 ? 0 : d->passes ? d->passes : 3;
    u->is_default = d->passes == 0;
    u->novelty = d->novelty;
    u->guide_weight = d->guide_weight > 0 ? d->guide_weight : 2;
    u->lattice = d->lattice;
    u->seed = d->seed;
    for (int i = 0; i < 4 && d->lattice == 1; i++) {
        if (!txm_is_finite((double)d->lattice_vectors[i]))
            return txm_fail(env, TXM_BAD_ARGUMENT, "lattice_vectors must be finite");
        if (fabs((double)d->lattice_vectors[i]) > (double)TEXPATCH_MAX_SIDE)
            return txm_fail(env, TXM_BAD_ARGUMENT, "lattice_vectors must be 16384 pixels at most");
        u->lattice_vectors[i] = (double)d->lattice_vectors[i];
    }
    if (d->lattice == 1 && !(fabs(txp_det(u->lattice_vectors, u->lattice_vectors + 2)) >= 16))
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "lattice_vectors must span 16 pixels or more; use lattice 0 to find them");
    for (int m = 0; m < d->map_count; m++) {
        if (d->maps) u->kinds[m] = d->maps[m];
        else u->kinds[m].weight = m ? 0.0f : 1.0f;
        if (!txp_is_within(u->kinds[m].weight, 0, 16))
            return txm_fail(env, TXM_BAD_ARGUMENT, "the weight of a map must be 0 to 16");
        u->low[m] = 0;
        u->high[m] = 0;
    }
    for (int e = 0; e < d->exemplar_count && status == TXM_OK; e++) {
        const texpatch_exemplar *x = &d->exemplars[e];
        if (!x->maps) return txm_fail(env, TXM_BAD_ARGUMENT, "the maps of an exemplar are NULL");
        for (int m = 0; m < d->map_count && status == TXM_OK; m++) {
            status = txp_check_picture(&x->maps[m], "exemplar", env);
            if (status != TXM_OK) return status;
            u->maps[e][m] = txm_image_resolve(x->maps[m]);
            const txm_image *im = &u->maps[e][m], *first = &u->maps[0][m];
            if (im->width != u->maps[e][0].width || im->height != u->maps[e][0].height ||
                im->channels != first->channels || im->sample != first->sample)
                return txm_fail(env, TXM_BAD_ARGUMENT,
                                "maps of an exemplar must have one size, and "
                                "all exemplars the same channels and samples");
            if (u->kinds[m].is_normal && im->channels < 3)
                return txm_fail(env, TXM_BAD_ARGUMENT, "a normal map has 3 or 4 channels");
            txp_range(im, txp_has_alpha(&u->kinds[m], im), &u->low[m], &u->high[m]);
            if (e == 0 && u->kinds[m].weight > 0) bytes += im->channels;
        }
        const int w = u->maps[e][0].width, h = u->maps[e][0].height;
        if (w < TEXPATCH_MIN_SIDE || h < TEXPATCH_MIN_SIDE)
            return txm_fail(env, TXM_TOO_SMALL, "an exemplar must be 32 x 32 pixels or more");
        if (w > TEXPATCH_MAX_SIDE || h > TEXPATCH_MAX_SIDE)
            return txm_fail(env, TXM_TOO_LARGE, "an exemplar may be 16384 x 16384 pixels at most");
        if ((x->guide.pixels != NULL) != (d->exemplars[0].guide.pixels != NULL))
            return txm_fail(env, TXM_BAD_ARGUMENT, "give all exemplars a guide, or none");
        if (x->guide.pixels) {
            status = txp_check_picture(&x->guide, "guide", env);
            if (status != TXM_OK) return status;
            u->guides[e] = txm_image_resolve(x->guide);
            if (u->guides[e].width != w || u->guides[e].height != h ||
                u->guides[e].channels != u->guides[0].channels ||
                u->guides[e].sample != u->guides[0].sample)
                return txm_fail(env, TXM_BAD_ARGUMENT,
                                "a guide has the size of its exemplar, and "
                                "all have the same channels and samples");
            txp_range(&u->guides[e], txm_image_has_alpha(&u->guides[e]), &u->guide_low,
                      &u->guide_high);
        }
        if (x->mask.pixels) {
            status = txm_mask_check(&x->mask, "mask", w, h, TEXPATCH_MAX_PIXELS, env);
            u->masks[e] = x->mask;
        }
    }
    if (status != TXM_OK) return status;
    if (!bytes) return txm_fail(env, TXM_BAD_ARGUMENT, "one map at least must have a weight");
    s->guide_bytes = u->guides[0].pixels ? u->guides[0].channels : 0;
    if (bytes + s->guide_bytes > TEXPATCH_MAX_CHANNELS)
        return txm_fail(env, TXM_TOO_LARGE,
                        "maps with a weight and the guide may have 16 channels "
                        "together; give some maps weight 0");
    u->most_weight = s->guide_bytes ? u->guide_weight : 0;
    for (int m = 0; m < u->map_count; m++)
        u->most_weight = txm_maxf(u->most_weight, u->kinds[m].weight);
    s->tones = bytes;
    s->bytes = (bytes + s->guide_bytes + 3) / 4 * 4;
    s->guide_at = s->guide_bytes ? bytes : s->bytes;
    txp_find_alphas(u, s);
    return TXM_OK;
}

/* The guide of the output and its mask, which may be NULL or without pixels. */
static txm_status txp_check_guide(const txm_image *guide, const txm_image *mask,
                                  const txp_setup *u, int width, int height, txm_env *env) {
    const txm_status status = txp_check_picture(guide, "guide", env);
    if (status != TXM_OK) return status;
    const txm_image im = txm_image_resolve(*guide);
    if (im.width != width || im.height != height || im.channels != u->guides[0].channels ||
        im.sample != u->guides[0].sample)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "guide",
                           "must have the size of the output and "
                           "the format of the exemplars' guides");
    if (!mask || !mask->pixels) return TXM_OK;
    return txm_mask_check(mask, "guide_mask", width, height, TEXPATCH_MAX_PIXELS, env);
}

/* The fields about the output. */
static txm_status txp_check_output(const texpatch_desc *d, txp_setup *u, const txp_source *s,
                                   txm_env *env) {
    txm_status status = TXM_OK;
    if (d->width < 1 || d->height < 1)
        return txm_fail(env, TXM_BAD_ARGUMENT, "width and height must be 1 or more");
    if (d->height > TEXPATCH_MAX_PIXELS / d->width)
        return txm_fail(env, TXM_TOO_LARGE,
                        "more than TEXPATCH_MAX_PIXELS pixels; use windows of a plane");
    if (d->tileable < 0 || d->tileable > 3)
        return txm_fail(env, TXM_BAD_ARGUMENT, "tileable must be a sum of TEXPATCH_TILE_X and _Y");
    if ((d->tileable & TEXPATCH_TILE_X && d->width < TXP_PAD) ||
        (d->tileable & TEXPATCH_TILE_Y && d->height < TXP_PAD))
        return txm_fail(env, TXM_TOO_SMALL, "a tileable side must be 32 pixels or more");
    u->width = d->width;
    u->height = d->height;
    u->tileable = d->tileable;
    if ((d->guide.pixels != NULL) != (s->guide_bytes > 0))
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "a guide is given of the exemplars and of the output, "
                        "or of neither");
    if (d->guide.pixels)
        status = txp_check_guide(&d->guide, &d->guide_mask, u, d->width, d->height, env);
    if (status != TXM_OK || !d->kept) return status;
    if (!d->keep.pixels) return txm_fail(env, TXM_BAD_ARGUMENT, "kept needs the mask keep");
    status = txm_mask_check(&d->keep, "keep", d->width, d->height, TEXPATCH_MAX_PIXELS, env);
    for (int m = 0; m < d->map_count && status == TXM_OK; m++) {
        status = txp_check_picture(&d->kept[m], "kept", env);
        if (status != TXM_OK) return status;
        u->kept[m] = txm_image_resolve(d->kept[m]);
        if (u->kept[m].width != d->width || u->kept[m].height != d->height ||
            u->kept[m].channels != u->maps[0][m].channels ||
            u->kept[m].sample != u->maps[0][m].sample)
            return txm_fail_at(env, TXM_BAD_ARGUMENT, "kept",
                               "must have the size of the output and the format of its map");
    }
    return status;
}

/* ---- first pass: patches and cuts -------------------------------------------------------- */

/* How often the exemplar is used: pixels of the canvas that come from each cell of the stack. */
typedef struct txp_use {
    int columns, rows;
    uint32_t *count;
    uint32_t *sums; /* (columns + 1) x (rows + 1): of all cells above and left                  */
    /* for each number of cells: 1 / (their mean sum once the canvas is full) */
    double share[(4 * TXP_BLOCK / TXP_CELL + 2) * (4 * TXP_BLOCK / TXP_CELL + 2)];
} txp_use;

typedef struct txp_quilt {
    const txp_source *source;
    const txp_stack *stack;
    txp_canvas canvas;
    uint8_t *known; /* as canvas.pixels: 255 where a byte is to be compared              */
    uint8_t *done;  /* of each pixel of the canvas                                       */
    txp_use use;
    int block, overlap;
    double shift_x, shift_y; /* the lattice offset of the canvas                                */
    double use_weight, lattice_weight;
    txm_rng rng;
    double cost;            /* of all cuts                                                      */
    int failed;             /* no piece of the exemplar fits                                    */
    float *error;           /* block^2                                                          */
    double *scratch;        /* block * overlap                                                  */
    txp_place *near_places; /* candidates within the tolerance                                 */
    float *near_costs;
} txp_quilt;

enum { TXP_CANDIDATES = 256 };

/* Sum of |canvas - stack| over the known bytes of a block; span: first and last 16 bytes of each
   row that hold any. */
static uint32_t txp_sad_known(const txp_quilt *q, const uint8_t *a, const uint8_t *known,
                              const uint8_t *b, const int (*span)[2], uint32_t limit) {
    uint32_t total = 0;
    for (int y = 0; y < q->block && total <= limit; y++) {
#ifdef TXP_SSE2
        __m128i sum = _mm_setzero_si128();
        for (int i = span[y][0]; i < span[y][1]; i += 16) {
            const __m128i m = _mm_loadu_si128((const __m128i *)(const void *)(known + i));
            const __m128i u = _mm_loadu_si128((const __m128i *)(const void *)(a + i));
            const __m128i v = _mm_loadu_si128((const __m128i *)(const void *)(b + i));
            sum = _mm_add_epi32(sum, _mm_sad_epu8(_mm_and_si128(u, m), _mm_and_si128(v, m)));
        }
        total += txp_sad_sum(sum);
#else
        for (int i = span[y][0]; i < span[y][1]; i++) {
            const int d = (a[i] & known[i]) - (b[i] & known[i]);
            total += (uint32_t)(d < 0 ? -d : d);
        }
#endif
        a += q->canvas.pitch;
        known += q->canvas.pitch;
        b += q->stack->pitch;
    }
    return total;
}

/* Store a pixel, and its copies beyond the ends of a torus. */
static void txp_quilt_put(txp_quilt *q, int x, int y, txp_place at) {
    const txp_canvas *c = &q->canvas;
    const size_t n = (size_t)q->source->bytes, i = txp_index(c, x, y);
    const size_t guide = (size_t)q->source->guide_at;
    const int bind = !(c->free_guide && c->free_guide[i]);
    const uint8_t *in = txp_stack_at(q->source, q->stack, at.x, at.y);
    c->at[i] = at;
    q->done[i] = 1;
    for (int yy = y; yy < c->height + (c->wrap & TEXPATCH_TILE_Y ? TXP_PAD : 0); yy += c->height) {
        for (int xx = x; xx < c->width + (c->wrap & TEXPATCH_TILE_X ? TXP_PAD : 0);
             xx += c->width) {
            const size_t k = (size_t)yy * c->pitch + (size_t)xx * n;
            memcpy(c->pixels + k, in, bind ? guide : n);
            memset(q->known + k, 255, guide);
        }
    }
}

/* total: pixels of the full canvas */
static void txp_use_mean(txp_use *u, double total) {
    const double mean = total / (u->columns * u->rows);
    for (size_t i = 1; i < sizeof u->share / sizeof *u->share; i++)
        u->share[i] = 1 / (mean * (double)i);
}

/* Update the summed-area table. */
static void txp_use_integrate(const txp_use *u) {
    const int w = u->columns + 1;
    for (int j = 0; j < u->rows; j++) {
        uint32_t row = 0;
        for (int i = 0; i < u->columns; i++) {
            row += u->count[j * u->columns + i];
            u->sums[(j + 1) * w + i + 1] = u->sums[j * w + i + 1] + row;
        }
    }
}

/* Mean use of the cells that a piece of size x size pixels at (x, y) covers; 1 is the average. */
static inline double txp_use_at(const txp_use *u, int x, int y, int size) {
    const int x0 = x / TXP_CELL, y0 = y / TXP_CELL, w = u->columns + 1;
    const int x1 = (x + size - 1) / TXP_CELL + 1, y1 = (y + size - 1) / TXP_CELL + 1;
    const uint32_t sum =
        u->sums[y1 * w + x1] - u->sums[y1 * w + x0] - u->sums[y0 * w + x1] + u->sums[y0 * w + x0];
    return sum * u->share[(x1 - x0) * (y1 - y0)];
}

/* The piece for the block at (bx, by). */
static int txp_quilt_find(txp_quilt *q, int bx, int by, txp_place *found) {
    const txp_source *s = q->source;
    const txp_stack *k = q->stack;
    const txp_canvas *c = &q->canvas;
    const int size = q->block, bytes = size * s->bytes;
    int span[4 * TXP_BLOCK][2], count = 0;
    uint32_t known = 0;
    const txp_goal goal = txp_goal_make(k, &s->courses, bx + q->shift_x, by + q->shift_y, size);
    txp_use_integrate(&q->use);
    const uint8_t *a = txp_canvas_at(s, c, bx, by), *m = q->known + (a - c->pixels);
    for (int y = 0; y < size; y++) {
        const uint8_t *row = m + (size_t)y * c->pitch;
        span[y][0] = bytes;
        span[y][1] = 0;
        for (int i = 0; i < bytes; i++) {
            if (!row[i]) continue;
            known++;
            if (span[y][0] == bytes) span[y][0] = i / 16 * 16;
            span[y][1] = i / 16 * 16 + 16;
        }
    }
    /* costs are gray levels summed over known bytes; the first block has no such bytes */
    const double unit = known ? (double)known : 1;
    double best = 1e30;
    const double tolerance = 1.02; /* ours: candidates of costs this near the least are as good */
    const uint32_t start = txm_rng_next(&q->rng);
    /* once more without the lattice, if no place of the exemplar lies on it */
    for (int n = 0, strict = s->has_lattice; n < s->sheets || (strict && !count); n++) {
        if (n == s->sheets) n = strict = 0;
        const int rows = k->high[n] - size + 1, columns = k->wide[n] - size + 1;
        for (int j = 0; j < rows; j++) {
            for (int i = 0; i < columns; i++) {
                const int x = i, y = k->first[n] + j;
                double extra = 0;
                if (s->has_lattice) {
                    const double d = txp_off_bond(k, &s->courses, &goal, x, y);
                    if (d > (double)TXP_OFF_LATTICE && strict) continue;
                    extra += q->lattice_weight * fmin(d, TXP_OFF_LATTICE);
                }
                if (k->bad && !txp_fits(s, k, x, y, size, size)) continue;
                if (!known)
                    extra += (double)(txm_hash(start + (uint64_t)(y * k->width + x)) >> 40) * 1e-5;
                extra = (extra + q->use_weight * txp_use_at(&q->use, x, y, size)) * unit;
                const double limit = best * tolerance - extra;
                if (limit < 0) continue;
                const uint32_t sad =
                    known ? txp_sad_known(q, a, m, txp_stack_at(s, k, x, y), (const int(*)[2])span,
                                          limit < 4e9 ? (uint32_t)limit : 4000000000u)
                          : 0;
                const double cost = sad + extra;
                if (cost > best * tolerance) continue;
                if (cost < best) {
                    best = cost;
                    int kept = 0;
                    for (int t = 0; t < count; t++) {
                        if (q->near_costs[t] > best * tolerance) continue;
                        q->near_costs[kept] = q->near_costs[t];
                        q->near_places[kept++] = q->near_places[t];
                    }
                    count = kept;
                }
                if (count < TXP_CANDIDATES) {
                    q->near_costs[count] = txm_float(cost);
                    q->near_places[count].x = x;
                    q->near_places[count++].y = y;
                }
            }
        }
    }
    if (!count) return 0;
    *found = q->near_places[txm_rng_below(&q->rng, (uint32_t)count)];
    return 1;
}

/* Copy the piece into the block, along minimum-error cuts through the overlaps. */
static void txp_quilt_lay(txp_quilt *q, int bx, int by, txp_place at) {
    const txp_source *s = q->source;
    const txp_canvas *c = &q->canvas;
    const int size = q->block, o = q->overlap, n = s->guide_at;
    int cut[4][4 * TXP_BLOCK], is_cut[4], seen[4] = {0, 0, 0, 0};
    for (int y = 0; y < size; y++) {
        const uint8_t *a = txp_canvas_at(s, c, bx, by + y);
        const uint8_t *b = txp_stack_at(s, q->stack, at.x, at.y + y);
        for (int x = 0; x < size; x++, a += s->bytes, b += s->bytes) {
            const size_t i = txp_index(c, txp_wrap(bx + x, c->width), txp_wrap(by + y, c->height));
            int e = 0;
            if (q->done[i]) {
                for (int b1 = 0; b1 < n; b1++) e += (a[b1] - b[b1]) * (a[b1] - b[b1]);
                if (x < o) seen[0]++;
                if (y < o) seen[1]++;
                if (x >= size - o) seen[2]++;
                if (y >= size - o) seen[3]++;
            }
            q->error[y * size + x] = (float)e;
        }
    }
    /* sides: left, top, right, bottom; cut[][line] is the first pixel of the new piece, or the
       last */
    for (int k = 0; k < 4; k++) {
        is_cut[k] = seen[k] * 4 > 3 * size * o;
        if (!is_cut[k]) continue;
        const float *e = q->error + (k == 2 ? size - o : k == 3 ? (size - o) * size : 0);
        q->cost += txm_cut(e, size, o, k % 2 ? 1 : size, k % 2 ? size : 1, cut[k], q->scratch);
    }
    for (int y = 0; y < size; y++) {
        for (int x = 0; x < size; x++) {
            const int cx = txp_wrap(bx + x, c->width), cy = txp_wrap(by + y, c->height);
            const size_t i = txp_index(c, cx, cy);
            if (c->fixed && c->fixed[i]) continue;
            if (q->done[i] && ((is_cut[0] && x < cut[0][y]) || (is_cut[1] && y < cut[1][x]) ||
                               (is_cut[2] && x - (size - o) > cut[2][y]) ||
                               (is_cut[3] && y - (size - o) > cut[3][x])))
                continue;
            txp_place p;
            p.x = at.x + x;
            p.y = at.y + y;
            uint32_t *use = q->use.count + p.y / TXP_CELL * q->use.columns + p.x / TXP_CELL;
            if (q->done[i]) {
                const txp_place old = c->at[i];
                if (old.x >= 0)
                    q->use.count[old.y / TXP_CELL * q->use.columns + old.x / TXP_CELL]--;
            }
            ++*use;
            txp_quilt_put(q, cx, cy, p);
        }
    }
}

/* The whole canvas in scan order (section 3.4 of [1], N = 2 D). */
static void txp_quilt_run(txp_quilt *q) {
    const txp_canvas *c = &q->canvas;
    const int size = q->block, step = size - q->overlap;
    const int wx = c->wrap & TEXPATCH_TILE_X, wy = c->wrap & TEXPATCH_TILE_Y;
    const int columns = wx ? (c->width + step - 1) / step : 1 + (c->width - size + step - 1) / step;
    const int rows = wy ? (c->height + step - 1) / step : 1 + (c->height - size + step - 1) / step;
    for (int j = 0; j < rows && !q->failed; j++) {
        int y = wy ? j * c->height / rows : j * step;
        if (!wy && y > c->height - size) y = c->height - size;
        for (int i = 0; i < columns && !q->failed; i++) {
            int x = wx ? i * c->width / columns : i * step;
            txp_place at;
            if (!wx && x > c->width - size) x = c->width - size;
            if (!txp_has_free_pixel(c, x, y, size)) continue;
            if (!txp_quilt_find(q, x, y, &at)) q->failed = 1;
            else txp_quilt_lay(q, x, y, at);
        }
    }
}

/* ---- second pass: optimisation ----------------------------------------------------------- */

/* Room for a band of rows, per pixel. */
typedef struct txp_band {
    int32_t *sums, *total; /* of the bytes of all candidates, weighted; of the weights          */
    int32_t *nearest;      /* squared distance of the best candidate from the mean             */
    uint8_t *mean;
} txp_band;

/* The windows of one pass: those of a row lie side by side, `columns` of them, at xs[], ys[]. */
typedef struct txp_pass {
    const txp_source *source;
    const txp_stack *stack;
    const txp_canvas *canvas;
    int size, step; /* of the neighbourhoods; distance from one to the next                */
    int columns, rows;
    int *xs, *ys;
    txp_place *match; /* of each window                                                     */
    uint32_t *sad;    /* of its match, in gray levels; UINT32_MAX: no match                  */
    uint32_t *grain;  /* sum of differences of neighbouring pixels: its high frequencies     */
    int32_t *weight;  /* of each window in the mean                                         */
    txp_use use;
    double shift_x, shift_y, use_weight, lattice_weight;
    int most_same; /* see txp_search */
    int skip;      /* pixels from one place to the next in an exhaustive search                   */
    uint64_t seed;
    int exhaustive, first_row;
    int32_t bell[TXP_WINDOW * TXP_WINDOW]; /* 1..256 over a neighbourhood                       */
    int first_band;
    txp_band bands[TXP_LANES]; /* as many as the canvas has, at most                          */
} txp_pass;

/* A search for the match of one window. */
typedef struct txp_search {
    const txp_pass *pass;
    const uint8_t *target;
    int x, y;
    txp_goal goal;
    txp_place best;
    double cost;
    uint32_t sad;
    txp_place seen[16];
    int seen_count;
    int most_same; /* how many of 8 surrounding pixels may come from the same piece at most     */
    txp_place around[8];
} txp_search;

/* The pieces of 8 pixels around the window: where the window would lie in each of them. */
static void txp_find_surroundings(txp_search *f) {
    const txp_canvas *c = f->pass->canvas;
    const int r = f->pass->size / 2 + 2, mid = f->pass->size / 2;
    for (int d = 0, n = 0; d < 9; d++) {
        const int dx = mid + (d % 3 - 1) * r, dy = mid + (d / 3 - 1) * r;
        int cx = f->x + dx, cy = f->y + dy;
        if (d == 4) continue;
        if (c->wrap & TEXPATCH_TILE_X) cx = (cx + c->width) % c->width;
        if (c->wrap & TEXPATCH_TILE_Y) cy = (cy + c->height) % c->height;
        f->around[n].x = f->around[n].y = -1;
        if (cx >= 0 && cy >= 0 && cx < c->width && cy < c->height) {
            const txp_place at = c->at[txp_index(c, cx, cy)];
            f->around[n].x = at.x - dx;
            f->around[n].y = at.y - dy;
        }
        n++;
    }
}

/* Would (x, y) continue a piece that surrounds the window too much already? */
static int txp_continues(const txp_search *f, int x, int y) {
    int same = 0;
    for (int n = 0; n < 8; n++) same += f->around[n].x == x && f->around[n].y == y;
    return same > f->most_same;
}

static void txp_try(txp_search *f, int x, int y) {
    const txp_pass *p = f->pass;
    const txp_source *s = p->source;
    const int size = p->size;
    if (!txp_fits(s, p->stack, x, y, size, size)) return;
    for (int i = 0; i < 16 && i < f->seen_count; i++) {
        if (f->seen[i].x == x && f->seen[i].y == y) return;
    }
    f->seen[f->seen_count % 16].x = x;
    f->seen[f->seen_count++ % 16].y = y;
    double extra = 0;
    if (s->has_lattice) {
        const double d = txp_off_bond(p->stack, &s->courses, &f->goal, x, y);
        extra += p->lattice_weight * fmin(d, TXP_OFF_LATTICE);
    }
    extra += p->use_weight * txp_use_at(&p->use, x, y, size);
    if (f->most_same < 8 && txp_continues(f, x, y)) return;
    extra *= size * size;
    if (extra >= f->cost) return;
    const double limit = f->cost - extra;
    const uint32_t sad =
        txp_sad(f->target, p->canvas->pitch, txp_stack_at(s, p->stack, x, y), p->stack->pitch,
                size * s->bytes, size, limit < 4e9 ? (uint32_t)limit : 4000000000u);
    if (sad + extra >= f->cost) return;
    f->cost = sad + extra;
    f->sad = sad;
    f->best.x = x;
    f->best.y = y;
}

/* Try the place of the lattice that is nearest to a place. */
static void txp_try_snapped(txp_search *f, int x, int y) {
    const txp_pass *p = f->pass;
    if (p->source->has_lattice) txp_snap(p->stack, &p->source->courses, &f->goal, &x, &y);
    txp_try(f, x, y);
}

/* Try a random place of the sheet within radius of the best one so far. */
static void txp_try_near(txp_search *f, txm_rng *rng, int radius) {
    const txp_pass *p = f->pass;
    const txp_stack *k = p->stack;
    const int n = p->source->sheets > 1 ? k->sheet[f->best.y] : 0;
    const int x0 = f->best.x - radius < 0 ? 0 : f->best.x - radius;
    const int y0 = f->best.y - radius < k->first[n] ? k->first[n] : f->best.y - radius;
    int x1 = f->best.x + radius, y1 = f->best.y + radius;
    if (x1 > k->wide[n] - p->size) x1 = k->wide[n] - p->size;
    if (y1 > k->first[n] + k->high[n] - p->size) y1 = k->first[n] + k->high[n] - p->size;
    int x = txm_rng_range(rng, x0, x1 > x0 ? x1 : x0);
    int y = txm_rng_range(rng, y0, y1 > y0 ? y1 : y0);
    txp_try_snapped(f, x, y);
}

/* Try the pieces that pixels of the window come from now. */
static void txp_try_current(txp_search *f) {
    const txp_canvas *c = f->pass->canvas;
    const int size = f->pass->size;
    for (int v = 0; v < 5; v++) {
        for (int u = 0; u < 5; u++) {
            const int dx = u * (size - 1) / 4, dy = v * (size - 1) / 4;
            const txp_place at =
                c->at[txp_index(c, txp_wrap(f->x + dx, c->width), txp_wrap(f->y + dy, c->height))];
            if (at.x >= 0) txp_try(f, at.x - dx, at.y - dy);
        }
    }
}

/* The match of window w. */
static void txp_match(txp_pass *p, int i, int j) {
    const txp_source *s = p->source;
    const txp_stack *k = p->stack;
    const txp_canvas *c = p->canvas;
    const int size = p->size, w = j * p->columns + i;
    txp_search f;
    f.pass = p;
    f.x = p->xs[i];
    f.y = p->ys[j];
    f.goal = txp_goal_make(k, &s->courses, f.x + p->shift_x, f.y + p->shift_y, size);
    f.target = txp_canvas_at(s, c, f.x, f.y);
    f.cost = 1e30;
    f.sad = UINT32_MAX;
    f.best.x = f.best.y = -1;
    f.seen_count = 0;
    f.most_same = p->most_same;
    if (f.most_same < 8) txp_find_surroundings(&f);
    if (!txp_has_free_pixel(c, f.x, f.y, size)) {
        p->sad[w] = UINT32_MAX;
        return;
    }
    p->grain[w] = txp_sad(f.target, c->pitch, f.target + s->bytes, c->pitch, size * s->bytes, size,
                          UINT32_MAX);
    txp_try_current(&f);
    if (f.sad == 0) {
        p->match[w] = f.best;
        p->sad[w] = 0;
        return;
    }
    if (f.best.x < 0 && f.most_same < 8 && !p->exhaustive) { /* start near its own piece */
        const txp_place at = c->at[txp_index(c, txp_wrap(f.x + size / 2, c->width),
                                             txp_wrap(f.y + size / 2, c->height))];
        if (at.x >= 0) f.best = at;
    }
    if (p->exhaustive || f.best.x < 0) {
        for (int n = 0; n < s->sheets; n++) {
            for (int y = k->first[n]; y + size <= k->first[n] + k->high[n]; y += p->skip) {
                for (int x = 0; x + size <= k->wide[n]; x += p->skip) txp_try(&f, x, y);
            }
        }
    } else {
        txm_rng rng = txm_rng_make(p->seed, (uint64_t)w);
        for (int radius = k->width / 2; radius >= 2; radius /= 2) {
            txp_try_near(&f, &rng, radius);
        }
        if (s->has_lattice) {
            for (int d = 0; d < 8; d++) {
                static const int jump[8][2] = {{1, 0}, {-1, 0},  {0, 1},  {0, -1},
                                               {1, 1}, {-1, -1}, {1, -1}, {-1, 1}};
                const double x = k->lattice[0] * jump[d][0] + k->lattice[2] * jump[d][1];
                const double y = k->lattice[1] * jump[d][0] + k->lattice[3] * jump[d][1];
                const int to_x = f.best.x + (int)floor(x + 0.5), to_y = f.best.y + (int)floor(y + 0.5);
                if (s->courses.count) txp_try_snapped(&f, to_x, to_y);
                else txp_try(&f, to_x, to_y);
            }
        }
    }
    for (int round = 0; round < 3 && !(p->exhaustive && p->skip == 1); round++) {
        const txp_place at = f.best;
        for (int d = 0; d < 9; d++) {
            if (d != 4) txp_try(&f, at.x + d % 3 - 1, at.y + d / 3 - 1);
        }
        if (at.x == f.best.x && at.y == f.best.y) break;
    }
    if (f.sad == UINT32_MAX) { /* nothing else is near: continue the piece */
        f.most_same = 8;
        f.seen_count = 0;
        txp_try_current(&f);
    }
    p->match[w] = f.best;
    p->sad[w] = f.sad;
}

static void txp_match_row(void *context, int index) {
    txp_pass *p = (txp_pass *)context;
    for (int i = 0; i < p->columns; i++) txp_match(p, i, p->first_row + index);
}

static double txp_power(double x) {
    /* x^(r - 2) for r = 0.8 and x >= 1, to 1 %: powers of two from a table, the rest a parabola */
    static const double fifth[5] = {1.0, 0.870550563296124, 0.757858283255199, 0.659753955386447,
                                    0.574349177498518};
    int e = 0;
    while (x >= 2) {
        x *= 0.5;
        e++;
    }
    const double t = x - 1, m = 1 - t * (1.1233 - t * 0.5586);
    double f = fifth[e % 5] * m;
    for (int i = 0; i < e / 5; i++) f *= 0.5;
    for (int i = 0; i < e; i++) f *= 0.5;
    return f;
}

/* The adaptive weights (section 3.5 of [1]): w = P |x - z|^(r - 2), r = 0.8, where |x - z|^2 is the
   energy of the match; P is the share of well-matched windows among those of high frequency nearby
   (itself included), so that good structure wins over bad. */
static void txp_set_weights(txp_pass *p) {
    const double floor_sad = p->size * p->size * 1.5;
    double mean = 0, grain = 0;
    size_t count = 0;
    const int n = p->columns * p->rows;
    for (int w = 0; w < n; w++) {
        if (p->sad[w] == UINT32_MAX) continue;
        mean += p->sad[w];
        grain += p->grain[w];
        count++;
    }
    if (count) mean /= (double)count;
    if (count) grain /= (double)count;
    for (int j = 0; j < p->rows; j++) {
        for (int i = 0; i < p->columns; i++) {
            const int w = j * p->columns + i;
            int tries = 1, hits = 1;
            p->weight[w] = 0;
            if (p->sad[w] == UINT32_MAX) continue;
            for (int v = j > 0 ? j - 1 : 0; v <= j + 1 && v < p->rows; v++) {
                for (int u = i > 0 ? i - 1 : 0; u <= i + 1 && u < p->columns; u++) {
                    const int o = v * p->columns + u;
                    if (p->sad[o] == UINT32_MAX || p->grain[o] < grain) continue;
                    tries++;
                    hits += p->sad[o] <= mean;
                }
            }
            const double e = p->sad[w] / floor_sad;
            const double f = 2000 * (e > 1 ? txp_power(e) : 1) * hits / tries;
            p->weight[w] = f > 1 ? (int32_t)f : 1;
        }
    }
}

/* A bell-shaped weight over a neighbourhood, 1..256. */
static void txp_bell(int size, int32_t *bell) {
    for (int v = 0; v < size; v++) {
        for (int u = 0; u < size; u++) {
            const double a = (2 * v + 1 - size) / (double)size,
                         b = (2 * u + 1 - size) / (double)size;
            const double f = (1 - a * a) * (1 - a * a) * (1 - b * b) * (1 - b * b);
            bell[v * size + u] = 1 + (int32_t)(255 * f);
        }
    }
}

/* Add a window's match to the sums of a band: its weighted bytes, and the weights. */
static void txp_sum_window(const txp_pass *p, int w, int x0, int y0, int top, int bottom,
                           const txp_band *band) {
    const txp_source *s = p->source;
    const txp_canvas *c = p->canvas;
    const int n = s->bytes, size = p->size;
    const txp_place m = p->match[w];
    for (int v = 0; v < size; v++) {
        const int y = txp_wrap(y0 + v, c->height);
        if (y < top || y >= bottom) continue;
        const uint8_t *in = txp_stack_at(s, p->stack, m.x, m.y + v);
        const size_t line = (size_t)(y - top) * (size_t)c->width;
        int32_t weight[TXP_WINDOW];
        for (int u = 0; u < size; u++)
            weight[u] = ((p->weight[w] * p->bell[v * size + u]) >> 8) + 1;
        int u = 0;
#ifdef TXP_SSE2
        if (n == 4 && x0 + size <= c->width) {
            const __m128i zero = _mm_setzero_si128();
            int32_t *total = band->total + line + (size_t)x0;
            int32_t *sums = band->sums + (line + (size_t)x0) * 4;
            for (; u < size; u += 4, total += 4, sums += 16, in += 16) {
                const __m128i pixels = _mm_loadu_si128((const __m128i *)(const void *)in);
                const __m128i low = _mm_unpacklo_epi8(pixels, zero);
                const __m128i high = _mm_unpackhi_epi8(pixels, zero);
                const __m128i f = _mm_loadu_si128((const __m128i *)(const void *)(weight + u));
                __m128i *t = (__m128i *)(void *)total, *o = (__m128i *)(void *)sums;
                _mm_storeu_si128(t, _mm_add_epi32(_mm_loadu_si128(t), f));
                _mm_storeu_si128(o, _mm_add_epi32(_mm_loadu_si128(o),
                                                  _mm_madd_epi16(_mm_unpacklo_epi16(low, zero),
                                                                 _mm_shuffle_epi32(f, 0x00))));
                _mm_storeu_si128(o + 1, _mm_add_epi32(_mm_loadu_si128(o + 1),
                                                      _mm_madd_epi16(_mm_unpackhi_epi16(low, zero),
                                                                     _mm_shuffle_epi32(f, 0x55))));
                _mm_storeu_si128(o + 2, _mm_add_epi32(_mm_loadu_si128(o + 2),
                                                      _mm_madd_epi16(_mm_unpacklo_epi16(high, zero),
                                                                     _mm_shuffle_epi32(f, 0xaa))));
                _mm_storeu_si128(o + 3, _mm_add_epi32(_mm_loadu_si128(o + 3),
                                                      _mm_madd_epi16(_mm_unpackhi_epi16(high, zero),
                                                                     _mm_shuffle_epi32(f, 0xff))));
            }
        }
#endif
        for (; u < size; u++, in += n) {
            const size_t x = line + (size_t)txp_wrap(x0 + u, c->width);
            int32_t *to = band->sums + x * (size_t)n;
            for (int b = 0; b < n; b++) to[b] += weight[u] * in[b];
            band->total[x] += weight[u];
        }
    }
}

/* Take a window's match for those pixels of a band where it is the nearest to the mean so far. */
static void txp_pick_window(const txp_pass *p, int w, int x0, int y0, int top, int bottom,
                            const txp_band *band) {
    const txp_source *s = p->source;
    const txp_canvas *c = p->canvas;
    const int n = s->bytes, size = p->size;
    const txp_place m = p->match[w];
    for (int v = 0; v < size; v++) {
        const int y = txp_wrap(y0 + v, c->height);
        if (y < top || y >= bottom) continue;
        const uint8_t *in = txp_stack_at(s, p->stack, m.x, m.y + v);
        const size_t line = (size_t)(y - top) * (size_t)c->width;
        int u = 0;
#ifdef TXP_SSE2
        if (n == 4 && x0 + size <= c->width) {
            const __m128i zero = _mm_setzero_si128(), four = _mm_set_epi32(0, 4, 0, 4);
            const uint8_t *mean = band->mean + (line + (size_t)x0) * 4;
            int32_t *nearest = band->nearest + line + (size_t)x0;
            txp_place *next = c->next + txp_index(c, x0, y), first[4];
            for (int i = 0; i < 4; i++) {
                first[i].x = m.x + i;
                first[i].y = m.y + v;
            }
            /* two places in each */
            __m128i place = _mm_loadu_si128((const __m128i *)(const void *)first);
            __m128i other = _mm_loadu_si128((const __m128i *)(const void *)(first + 2));
            for (; u < size; u += 4, mean += 16, in += 16, nearest += 4, next += 4) {
                const __m128i a = _mm_loadu_si128((const __m128i *)(const void *)mean);
                const __m128i b = _mm_loadu_si128((const __m128i *)(const void *)in);
                const __m128i d = _mm_or_si128(_mm_subs_epu8(a, b), _mm_subs_epu8(b, a));
                __m128i low = _mm_unpacklo_epi8(d, zero), high = _mm_unpackhi_epi8(d, zero);
                low = _mm_madd_epi16(low, low);
                high = _mm_madd_epi16(high, high);
                /* two sums for each pixel */
                const __m128i even = _mm_castps_si128(_mm_shuffle_ps(
                    _mm_castsi128_ps(low), _mm_castsi128_ps(high), _MM_SHUFFLE(2, 0, 2, 0)));
                const __m128i odd = _mm_castps_si128(_mm_shuffle_ps(
                    _mm_castsi128_ps(low), _mm_castsi128_ps(high), _MM_SHUFFLE(3, 1, 3, 1)));
                const __m128i square = _mm_add_epi32(even, odd);
                __m128i *o = (__m128i *)(void *)nearest, *at = (__m128i *)(void *)next;
                __m128i *after = (__m128i *)(void *)(next + 2);
                const __m128i best = _mm_loadu_si128(o), less = _mm_cmplt_epi32(square, best);
                _mm_storeu_si128(
                    o, _mm_or_si128(_mm_and_si128(less, square), _mm_andnot_si128(less, best)));
                const __m128i here = _mm_unpacklo_epi32(less, less);
                const __m128i there = _mm_unpackhi_epi32(less, less);
                _mm_storeu_si128(at, _mm_or_si128(_mm_and_si128(here, place),
                                                  _mm_andnot_si128(here, _mm_loadu_si128(at))));
                _mm_storeu_si128(after, _mm_or_si128(_mm_and_si128(there, other),
                                                     _mm_andnot_si128(there, _mm_loadu_si128(after))));
                place = _mm_add_epi32(place, four);
                other = _mm_add_epi32(other, four);
            }
        }
#endif
        for (; u < size; u++, in += n) {
            const int x = txp_wrap(x0 + u, c->width);
            const uint8_t *to = band->mean + (line + (size_t)x) * (size_t)n;
            int32_t d = 0;
            for (int b = 0; b < n; b++) d += (to[b] - in[b]) * (to[b] - in[b]);
            if (d >= band->nearest[line + (size_t)x]) continue;
            band->nearest[line + (size_t)x] = d;
            txp_place *at = c->next + txp_index(c, x, y);
            at->x = m.x + u;
            at->y = m.y + v;
        }
    }
}

/* One band of rows: the mean of all windows at each pixel, then the candidate nearest to it. */
static void txp_choose_band(void *context, int lane) {
    txp_pass *p = (txp_pass *)context;
    const txp_canvas *c = p->canvas;
    const int top = (p->first_band + lane) * TXP_BAND, n = p->source->bytes;
    const int bottom = top + TXP_BAND < c->height ? top + TXP_BAND : c->height;
    const size_t pixels = (size_t)(bottom - top) * (size_t)c->width;
    const txp_band *band = &p->bands[lane];
    memset(band->sums, 0, pixels * (size_t)n * sizeof *band->sums);
    memset(band->total, 0, pixels * sizeof *band->total);
    for (int turn = 0; turn < 2; turn++) {
        for (int j = 0; j < p->rows; j++) {
            const int y = p->ys[j], end = y + p->size;
            if (!((y < bottom && end > top) || (end > c->height && end - c->height > top)))
                continue;
            for (int i = 0; i < p->columns; i++) {
                const int w = j * p->columns + i;
                if (p->sad[w] == UINT32_MAX) continue;
                if (turn) txp_pick_window(p, w, p->xs[i], y, top, bottom, band);
                else txp_sum_window(p, w, p->xs[i], y, top, bottom, band);
            }
        }
        for (size_t i = 0; i < pixels && !turn; i++) {
            const int32_t *sum = band->sums + i * (size_t)n;
            const float part = band->total[i] ? txm_float(1.0f / (float)band->total[i]) : 0;
            for (int b = 0; b < n; b++)
                band->mean[i * (size_t)n + (size_t)b] =
                    (uint8_t)txm_float(txm_float((float)sum[b] * part) + 0.5f);
            band->nearest[i] = INT32_MAX;
        }
    }
    for (int y = top; y < bottom && c->fixed; y++) {
        for (int x = 0; x < c->width; x++) {
            const size_t i = txp_index(c, x, y);
            if (c->fixed[i]) c->next[i] = c->at[i];
        }
    }
}

static void txp_count_use(const txp_canvas *c, txp_use *u) {
    uint32_t total = 0;
    memset(u->count, 0, (size_t)u->columns * (size_t)u->rows * sizeof *u->count);
    for (size_t i = 0; i < (size_t)c->width * (size_t)c->height; i++) {
        if (c->at[i].x < 0) continue;
        u->count[c->at[i].y / TXP_CELL * u->columns + c->at[i].x / TXP_CELL]++;
        total++;
    }
    txp_use_mean(u, (double)(total ? total : 1));
    txp_use_integrate(u);
}

/* ---- single pixels at seams ------------------------------------------------------------- */

typedef struct txp_polish {
    const txp_source *source;
    const txp_stack *stack;
    const txp_canvas *canvas;
    int first_band;
} txp_polish;

/* For each pixel whose neighbours belong to other pieces: of all pieces around it, the one whose
   5 x 5 pixels fit best (k-coherence with k = 1; pixels inside a piece do not change). */
static void txp_polish_band(void *context, int index) {
    const txp_polish *p = (const txp_polish *)context;
    const txp_canvas *c = p->canvas;
    const txp_source *s = p->source;
    const txp_stack *k = p->stack;
    const int top = (p->first_band + index) * TXP_BAND;
    const int bottom = top + TXP_BAND < c->height ? top + TXP_BAND : c->height;
    const int wx = c->wrap & TEXPATCH_TILE_X, wy = c->wrap & TEXPATCH_TILE_Y;
    for (int y = top; y < bottom; y++) {
        for (int x = 0; x < c->width; x++) {
            const size_t i = txp_index(c, x, y);
            const txp_place own = c->at[i];
            txp_place tried[9], best = own;
            int count = 0;
            c->next[i] = own;
            if (own.x < 0 || (c->fixed && c->fixed[i])) continue;
            tried[count++] = own;
            for (int d = 0; d < 9; d++) {
                int qx = x + d % 3 - 1, qy = y + d / 3 - 1;
                if (d == 4) continue;
                if (wx) qx = qx < 0 ? qx + c->width : txp_wrap(qx, c->width);
                if (wy) qy = qy < 0 ? qy + c->height : txp_wrap(qy, c->height);
                if (qx < 0 || qy < 0 || qx >= c->width || qy >= c->height) continue;
                txp_place at = c->at[txp_index(c, qx, qy)];
                if (at.x < 0) continue;
                at.x -= d % 3 - 1;
                at.y -= d / 3 - 1;
                int known = 0;
                for (int t = 0; t < count && !known; t++)
                    known = tried[t].x == at.x && tried[t].y == at.y;
                if (known) continue;
                TXM_ASSERT(count < 9); /* the own one and those of 8 neighbours */
                tried[count++] = at;
            }
            if (count == 1) continue;
            /* the 5 x 5 pixels around it, moved inwards at borders that do not wrap */
            int x0 = x - 2, y0 = y - 2;
            if (wx) x0 = x0 < 0 ? x0 + c->width : x0;
            else x0 = txm_clampi(x0, 0, c->width - 5);
            if (wy) y0 = y0 < 0 ? y0 + c->height : y0;
            else y0 = txm_clampi(y0, 0, c->height - 5);
            int dx = x - x0, dy = y - y0;
            if (dx < 0) dx += c->width;
            if (dy < 0) dy += c->height;
            const uint8_t *target = txp_canvas_at(s, c, x0, y0);
            uint32_t least = UINT32_MAX;
            for (int t = 0; t < count; t++) {
                const int sx = tried[t].x - dx, sy = tried[t].y - dy;
                if (!txp_fits(s, k, sx, sy, 5, 5)) continue;
                const uint32_t sad = txp_sad(target, c->pitch, txp_stack_at(s, k, sx, sy), k->pitch,
                                             5 * s->bytes, 5, least);
                if (sad >= least) continue;
                least = sad;
                best = tried[t];
            }
            c->next[i] = best;
        }
    }
}

/* ---- fields that jump at seams ------------------------------------------------------------ */

enum {
    TXP_SWEEPS = 12,     /* of the relaxation                                                    */
    TXP_TILE = 16,       /* pixels: width of the tiles that are relaxed or skipped               */
    TXP_TILE_ROWS = 8,   /* their height                                                         */
    TXP_FADE = 2 * TXP_SWEEPS, /* pixels beyond which a jump is not felt: one for each colour of a
                            sweep                                                                */
    TXP_JUMP_UNIT = 64   /* jumps are stored in 1 / 64                                           */
};

/* A field over some rows of the canvas with given jumps between neighbouring pixels: the minimum of

       sum over neighbours of pull |u(q) - u(p) - jump|^2 + screen |u|^2,

   which jumps at seams and fades within 1 / sqrt(screen) pixels. Row 0 is row `top` of the canvas; of
   a canvas that wraps, rows before the first and behind the last are those at the other end.     */
typedef struct txp_field {
    const txp_canvas *canvas;
    int top, height, lanes; /* lanes: values per pixel, 2 or a multiple of 4                   */
    int closed;       /* these are all rows of the canvas, and the last is followed by the first */
    float *value;
    int16_t *jump;    /* lanes per pixel: pull times jump, in 1 / TXP_JUMP_UNIT; a row more      */
    uint8_t *pull[2]; /* to the right neighbour, to the lower one, in 1 / 255; 255 inside a piece */
    float scale[4 * 255 + 1]; /* by the sum of the four pulls: 1 / (sum + screen)               */
    uint8_t *active; /* of each tile: 2 = it has jumps, 1 = near one; a row of tiles more      */
    int tiles;       /* in a row                                                                */
    int from, to;    /* rows that are relaxed now                                               */
    int colour;      /* of their pixels, on a checkerboard                                      */
} txp_field;

/* The row of the canvas that row y of the field is; -1: none. */
static inline int txp_field_row(const txp_field *f, int y) {
    const int height = f->canvas->height;
    const int row = f->top + y;
    if (row >= 0 && row < height) return row;
    return f->canvas->wrap & TEXPATCH_TILE_Y ? (row % height + height) % height : -1;
}

static inline void txp_field_mark(const txp_field *f, int x, int y) {
    f->active[(size_t)(y / TXP_TILE_ROWS) * (size_t)f->tiles + (size_t)(x / TXP_TILE)] = 2;
}

/* Activate the tiles within TXP_FADE of marked ones. */
static void txp_field_spread(const txp_field *f) {
    const int rows = (f->height + TXP_TILE_ROWS - 1) / TXP_TILE_ROWS;
    const int across = (TXP_FADE + TXP_TILE - 1) / TXP_TILE;
    const int along = (TXP_FADE + TXP_TILE_ROWS - 1) / TXP_TILE_ROWS;
    for (int j = 0; j < rows; j++) {
        for (int i = 0; i < f->tiles; i++) {
            if (f->active[j * f->tiles + i] != 2) continue;
            for (int v = -along; v <= along; v++) {
                int y = j + v;
                if (f->closed) y = (y + 2 * rows) % rows;
                if (y < 0 || y >= rows) continue;
                for (int u = -across; u <= across; u++) {
                    int x = i + u;
                    if (f->canvas->wrap & TEXPATCH_TILE_X) x = (x + 2 * f->tiles) % f->tiles;
                    if (x < 0 || x >= f->tiles) continue;
                    if (!f->active[y * f->tiles + x]) f->active[y * f->tiles + x] = 1;
                }
            }
        }
    }
}

static inline void txp_relax_pixel(const txp_field *f, size_t i, const size_t *next,
                                   const uint8_t *pull, int lanes) {
    float *own = f->value + i * (size_t)lanes;
    const int16_t *jump = f->jump + i * (size_t)lanes;
    const float scale = f->scale[pull[0] + pull[1] + pull[2] + pull[3]];
    const float l = pull[0], r = pull[1], u = pull[2], d = pull[3];
    const float unit = 255.0f / (float)TXP_JUMP_UNIT;
    const float beyond = 1.6f; /* a variable: where floats are computed in double, so are constants */
    const float *a = f->value + next[0] * (size_t)lanes, *b = f->value + next[1] * (size_t)lanes;
    const float *c = f->value + next[2] * (size_t)lanes, *e = f->value + next[3] * (size_t)lanes;
    for (int k = 0; k < lanes; k++) {
        const float across = txm_float(txm_float(l * a[k]) + txm_float(r * b[k]));
        const float along = txm_float(txm_float(u * c[k]) + txm_float(d * e[k]));
        const float all = txm_float(txm_float(across + along) + txm_float(unit * (float)jump[k]));
        own[k] = txm_float(own[k] + txm_float(beyond * txm_float(txm_float(all * scale) - own[k])));
    }
}

/* The pixels of one colour in a row of tiles: successive over-relaxation. */
static void txp_relax_rows(void *context, int index) {
    const txp_field *f = (const txp_field *)context;
    const int w = f->canvas->width, h = f->height, lanes = f->lanes;
    const int wraps = f->canvas->wrap & TEXPATCH_TILE_X, part = f->from / TXP_TILE_ROWS + index;
    const int first = part * TXP_TILE_ROWS, end = first + TXP_TILE_ROWS;
    const uint8_t *active = f->active + (size_t)part * (size_t)f->tiles;
    for (int y = first < f->from ? f->from : first; y < end && y < f->to; y++) {
        const int row = txp_field_row(f, y);
        if (row < 0) continue;
        const int is_open = !f->closed, last = h - 1;
        int up = y > 0 ? y - 1 : is_open ? -1 : last, down = y < last ? y + 1 : is_open ? -1 : 0;
        if (up >= 0 && txp_field_row(f, up) < 0) up = -1;
        if (down >= 0 && txp_field_row(f, down) < 0) down = -1;
        const uint8_t *fixed = f->canvas->fixed ? f->canvas->fixed + txp_index(f->canvas, 0, row) : NULL;
        for (int x = (y + f->colour) % 2; x < w; x += 2) {
            const size_t i = (size_t)y * (size_t)w + (size_t)x;
            if (!active[x / TXP_TILE]) {
                x += TXP_TILE - 2; /* the next tile */
                continue;
            }
            if (fixed && fixed[x]) continue;
            const int left = x > 0 ? x - 1 : wraps ? w - 1 : -1;
            const int right = x + 1 < w ? x + 1 : wraps ? 0 : -1;
            size_t next[4];
            uint8_t pull[4];
            next[0] = left < 0 ? i : (size_t)y * (size_t)w + (size_t)left;
            next[1] = right < 0 ? i : (size_t)y * (size_t)w + (size_t)right;
            next[2] = up < 0 ? i : (size_t)up * (size_t)w + (size_t)x;
            next[3] = down < 0 ? i : (size_t)down * (size_t)w + (size_t)x;
            pull[0] = left < 0 ? 0 : f->pull[0][next[0]];
            pull[1] = right < 0 ? 0 : f->pull[0][i];
            pull[2] = up < 0 ? 0 : f->pull[1][next[2]];
            pull[3] = down < 0 ? 0 : f->pull[1][i];
            if (lanes == 4) txp_relax_pixel(f, i, next, pull, 4);
            else if (lanes == 2) txp_relax_pixel(f, i, next, pull, 2);
            else txp_relax_pixel(f, i, next, pull, lanes);
        }
    }
}

/* One sweep over the pixels of one colour in rows from..to-1. Where a torus has an odd number of rows,
   the first and the last have one colour: not at a time. */
static void txp_relax_field(txp_field *f, int from, int to, int colour, txm_env *env) {
    const int tile = TXP_TILE_ROWS, parts = (to + tile - 1) / tile - from / tile;
    const int alone = f->closed && f->height % 2;
    f->from = from;
    f->to = to;
    f->colour = colour;
    txm_parallel_for(env, parts - alone, txp_relax_rows, f);
    if (alone) txp_relax_rows(f, parts - 1);
}

/* Allocate a field over so many rows of a canvas. arena->failed: no memory. */
static void txp_field_make(txp_field *f, const txp_canvas *c, int height, int lanes, double screen,
                           txm_arena *arena) {
    const size_t width = (size_t)c->width, pixels = width * (size_t)height;
    const size_t rows = (size_t)(height + TXP_TILE_ROWS - 1) / TXP_TILE_ROWS;
    f->canvas = c;
    f->height = height;
    f->closed = height == c->height && c->wrap & TEXPATCH_TILE_Y;
    f->lanes = lanes;
    for (int i = 0; i <= 4 * 255; i++) f->scale[i] = txm_float(1 / (i + 255 * screen));
    f->value = (float *)txm_arena_zero(arena, pixels, (size_t)lanes * sizeof(float));
    f->jump = (int16_t *)txm_arena_zero(arena, pixels + width, (size_t)lanes * sizeof(int16_t));
    f->pull[0] = (uint8_t *)txm_arena_zero(arena, pixels, 1);
    f->pull[1] = (uint8_t *)txm_arena_zero(arena, pixels, 1);
    f->tiles = (c->width + TXP_TILE - 1) / TXP_TILE;
    f->active = (uint8_t *)txm_arena_zero(arena, (size_t)f->tiles, rows + 1);
}

/* Go on to later rows: what is known of the last rows becomes that of the first, the rest is none. */
static void txp_field_move(txp_field *f, int rows) {
    const size_t width = (size_t)f->canvas->width, tiles = (size_t)f->tiles;
    const size_t stay = (size_t)(f->height - rows), gone = (size_t)rows;
    const size_t jumps = width * (size_t)f->lanes, tile_rows = (size_t)(f->height / TXP_TILE_ROWS);
    const size_t tiles_gone = gone / TXP_TILE_ROWS, tiles_stay = tile_rows - tiles_gone;
    TXM_ASSERT(rows % TXP_TILE_ROWS == 0 && f->height % TXP_TILE_ROWS == 0 && rows <= f->height);
    f->top += rows;
    for (int d = 0; d < 2; d++) {
        memmove(f->pull[d], f->pull[d] + width * gone, width * stay);
        memset(f->pull[d] + width * stay, 0, width * gone);
    }
    memmove(f->jump, f->jump + jumps * gone, jumps * (stay + 1) * sizeof *f->jump);
    memset(f->jump + jumps * (stay + 1), 0, jumps * gone * sizeof *f->jump);
    memmove(f->active, f->active + tiles * tiles_gone, tiles * (tiles_stay + 1));
    memset(f->active + tiles * (tiles_stay + 1), 0, tiles * tiles_gone);
    for (size_t i = 0; i < tiles * (tile_rows + 1); i++) f->active[i] &= 2;
    memset(f->value, 0, width * (size_t)f->height * (size_t)f->lanes * sizeof *f->value);
}

/* ---- seams: where lines should meet, and steps of colour ----------------------------------- */

enum {
    TXP_MAX_BEND = 4,    /* pixels by which a piece is bent at most                              */
    TXP_PROBE = 8,       /* pixels a side that are compared at a seam                            */
    TXP_SEAM_CACHE = 64, /* measured seams that are remembered                                   */

    TXP_PULL_SEAM = 13,  /* of 255: pull between two pieces                                      */
    TXP_PULL_FITS = 77,  /* the same if no shift would make them fit better                      */
    TXP_SMALL_STEP = 12, /* gray levels: a step of tone up to here is spread fully               */
    TXP_LARGE_STEP = 32  /* from here on it is an edge of something and not spread               */
};
#define TXP_FAINT 0.125 /* share of alpha below which the colour of a seam says too little     */

/* A measured seam between two pieces. Its key is the difference of their offsets. */
typedef struct txp_seam {
    int x, y, dx, dy, found, shift[2];
} txp_seam;

/* The shift of the second piece, up to TXP_MAX_BEND pixels, with which it continues the first best
   around a pixel. 0: none is clearly better than no shift. */
static int txp_seam_shift(const txp_source *s, txp_place a, txp_place b, int shift[2]) {
    const txp_stack *k = &s->stack[0];
    const int ax = a.x - TXP_PROBE / 2, ay = a.y - TXP_PROBE / 2;
    const int bx = b.x - TXP_PROBE / 2, by = b.y - TXP_PROBE / 2;
    shift[0] = shift[1] = 0;
    if (!txp_fits(s, k, ax, ay, TXP_PROBE, TXP_PROBE) ||
        !txp_fits(s, k, bx, by, TXP_PROBE, TXP_PROBE))
        return 0;
    const uint8_t *target = txp_stack_at(s, k, ax, ay);
    const uint32_t now = txp_sad(target, k->pitch, txp_stack_at(s, k, bx, by), k->pitch,
                                 TXP_PROBE * s->bytes, TXP_PROBE, UINT32_MAX);
    uint32_t best = now / 10 * 7;
    int found = 0;
    if (now < TXP_PROBE * TXP_PROBE * 4) return 0;
    for (int dy = -TXP_MAX_BEND; dy <= TXP_MAX_BEND; dy++) {
        for (int dx = -TXP_MAX_BEND; dx <= TXP_MAX_BEND; dx++) {
            if (!txp_fits(s, k, bx + dx, by + dy, TXP_PROBE, TXP_PROBE)) continue;
            const uint32_t sad = txp_sad(target, k->pitch, txp_stack_at(s, k, bx + dx, by + dy),
                                         k->pitch, TXP_PROBE * s->bytes, TXP_PROBE, best);
            if (sad >= best) continue;
            best = sad;
            shift[0] = dx;
            shift[1] = dy;
            found = 1;
        }
    }
    return found;
}

/* The same, from the cache for the next pixels of a seam between the same two pieces. */
static int txp_seam_cached(const txp_source *s, txp_seam *seams, int x, int y, txp_place a,
                           txp_place b, int shift[2]) {
    const int dx = a.x - b.x, dy = a.y - b.y;
    txp_seam *m = &seams[(unsigned)(dx * 31 + dy) % TXP_SEAM_CACHE];
    if (m->dx != dx || m->dy != dy || abs(m->x - x) + abs(m->y - y) > 3) {
        m->x = x;
        m->y = y;
        m->dx = dx;
        m->dy = dy;
        m->found = txp_seam_shift(s, a, b, m->shift);
    }
    shift[0] = m->shift[0];
    shift[1] = m->shift[1];
    return m->found;
}

/* The step of colour between 5 x 5 pixels of two pieces, summed over them, for each compared byte.
   That of a colour is between the means of what shows of both; none where next to nothing shows. */
static void txp_seam_step(const txp_source *s, const txp_stack *k, txp_place a, txp_place b,
                          int sum[TEXPATCH_MAX_CHANNELS]) {
    int of_a[TEXPATCH_MAX_CHANNELS] = {0};
    for (int v = 0; v < 5; v++) {
        const uint8_t *pa = txp_stack_at(s, k, a.x, a.y + v);
        const uint8_t *pb = txp_stack_at(s, k, b.x, b.y + v);
        for (int u = 0; u < 5; u++, pa += s->bytes, pb += s->bytes) {
            for (int c = 0; c < s->guide_at; c++) {
                sum[c] += pa[c] - pb[c];
                of_a[c] += pa[c];
            }
        }
    }
    for (int c = 0; c < s->guide_at && s->has_alpha; c++) {
        const int alpha = s->alpha_at[c];
        if (alpha < 0) continue;
        const double all = 25 * s->opaque[c], of_b = of_a[c] - sum[c];
        const double shown_a = of_a[alpha], shown_b = of_a[alpha] - sum[alpha];
        if (shown_a >= all && shown_b >= all) continue;
        if (shown_a < TXP_FAINT * all || shown_b < TXP_FAINT * all) sum[c] = 0;
        else sum[c] = (int)floor(of_a[c] * all / shown_a - of_b * all / shown_b + 0.5);
    }
}

/* Pixel j shall be `jump` above i. */
static inline void txp_add_jump(const txp_field *f, size_t i, size_t j, size_t lane, int jump) {
    int16_t *a = f->jump + i * (size_t)f->lanes + lane,
            *b = f->jump + j * (size_t)f->lanes + lane;
    *a = (int16_t)(*a - jump);
    *b = (int16_t)(*b + jump);
}

typedef struct txp_seams {
    const txp_source *source;
    txp_field *bend, *tone; /* over the same rows                                             */
    int first_row;          /* of the first band, a multiple of TXP_BAND                       */
} txp_seams;

/* Measure the seam between pixel (x, y) of the fields and its right (d = 0) or lower neighbour (qx, qy),
   and set the jumps of the two fields: bend (x, y) and tone (compared bytes). a, q: what both show. */
static void txp_measure_seam(const txp_seams *m, txp_seam *seams, int x, int y, int qx, int qy, int d,
                             txp_place a, txp_place q) {
    const txp_source *s = m->source;
    const txp_stack *k = &s->stack[0];
    const size_t w = (size_t)m->bend->canvas->width;
    const size_t i = (size_t)y * w + (size_t)x, j = (size_t)qy * w + (size_t)qx;
    const int low = TXP_SMALL_STEP * 25, high = TXP_LARGE_STEP * 25; /* summed over 5 x 5 pixels */
    uint8_t *bend = &m->bend->pull[d][i], *tone = &m->tone->pull[d][i];
    int shift[2];
    *bend = *tone = 255;
    if (a.x < 0 || q.x < 0) {
        *bend = *tone = TXP_PULL_SEAM;
        return;
    }
    a.x += !d;
    a.y += d;
    if (a.x == q.x && a.y == q.y) return;
    *bend = txp_seam_cached(s, seams, x, m->bend->top + y, a, q, shift) ? 255 : TXP_PULL_FITS;
    *tone = TXP_PULL_SEAM;
    const int ax = a.x - 2, ay = a.y - 2, bx = q.x + shift[0] - 2, by = q.y + shift[1] - 2;
    int sum[TEXPATCH_MAX_CHANNELS] = {0}, most = 0;
    if (txp_fits(s, k, ax, ay, 5, 5) && txp_fits(s, k, bx, by, 5, 5)) {
        const txp_place from_a = {ax, ay};
        const txp_place from_b = {bx, by};
        txp_seam_step(s, k, from_a, from_b, sum);
        for (int b = 0; b < s->guide_at; b++) most = abs(sum[b]) > most ? abs(sum[b]) : most;
        if (most < low) *tone = 255;
        else if (most < high)
            *tone = (uint8_t)(TXP_PULL_SEAM + (255 - TXP_PULL_SEAM) * (high - most) / (high - low));
    }
    if (shift[0] || shift[1]) {
        txp_field_mark(m->bend, x, y);
        txp_field_mark(m->bend, qx, qy);
    }
    if (most > 0 && most < high) {
        txp_field_mark(m->tone, x, y);
        txp_field_mark(m->tone, qx, qy);
    }
    /* u(q) - u(i) = jump: added to q, subtracted from i */
    for (size_t b = 0; b < 2; b++)
        txp_add_jump(m->bend, i, j, b, *bend * shift[b] * TXP_JUMP_UNIT / 255);
    for (size_t b = 0; b < (size_t)s->guide_at && most < high; b++)
        txp_add_jump(m->tone, i, j, b, *tone * sum[b] * TXP_JUMP_UNIT / (25 * 255));
}

/* Measure the seams to the right of and below the pixels of a band. The step of colour at a seam is the
   difference of both pieces in the 5 x 5 pixels around it; small steps are differences of tone, large
   ones are edges of something. Pulls are stored with the first of the two pixels. */
static void txp_measure_band(void *context, int lane) {
    const txp_seams *m = (const txp_seams *)context;
    const txp_field *f = m->bend;
    const txp_canvas *c = f->canvas;
    const int top = m->first_row + 2 * lane * TXP_BAND;
    const int bottom = top + TXP_BAND < f->height ? top + TXP_BAND : f->height;
    txp_seam seams[TXP_SEAM_CACHE];
    memset(seams, 0, sizeof seams);
    for (int y = top; y < bottom; y++) {
        const int below = f->closed && y + 1 == f->height ? 0 : y + 1;
        const int row = txp_field_row(f, y), next = txp_field_row(f, below);
        if (row < 0) continue;
        for (int x = 0; x < c->width; x++) {
            const txp_place a = c->at[txp_index(c, x, row)];
            const int right = x + 1 < c->width ? x + 1 : c->wrap & TEXPATCH_TILE_X ? 0 : -1;
            if (right >= 0)
                txp_measure_seam(m, seams, x, y, right, y, 0, a, c->at[txp_index(c, right, row)]);
            if (next >= 0)
                txp_measure_seam(m, seams, x, y, x, below, 1, a, c->at[txp_index(c, x, next)]);
        }
    }
}

/* ---- jobs --------------------------------------------------------------------------------- */

/* cost of the squared distance from the lattice, in gray levels per pixel */
#define TXP_LATTICE 20.0

enum { TXP_MAX_STEPS = 2 * TXP_MAX_LEVELS * 16 + 8 };
typedef enum txp_kind { TXP_STEP_QUILT, TXP_STEP_PASS, TXP_STEP_POLISH, TXP_STEP_FINISH } txp_kind;
typedef struct txp_step {
    txp_kind kind;
    int level, size, stride, round, rounds;
    float cost; /* approximate, relative to other steps */
} txp_step;

/* Where pixels come from, and what is done to them. */
typedef struct txp_origins {
    txp_place *at;
    int16_t *bend; /* x, y by which each pixel's place is moved, times TXP_BEND_UNIT             */
    int16_t *tone; /* what is added to each of the tones of a source, times TXP_TONE_UNIT         */
} txp_origins;
#define TXP_BEND_UNIT 2048.0f /* of a pixel; pieces are bent by some pixels                        */
#define TXP_TONE_UNIT 256.0f  /* of a gray level; tones change by up to TXP_LARGE_STEP             */

/* What is known of a canvas before the work begins, per pixel of its full size; NULL: nothing. */
typedef struct txp_given {
    uint8_t *pixels;     /* compared bytes: of fixed pixels, and the guide of all                */
    uint8_t *fixed;      /* 1 = it does not change                                               */
    uint8_t *free_guide; /* 1 = the guide does not count                                         */
    txp_origins from;    /* of fixed pixels                                                      */
} txp_given;

struct texpatch_job {
    txm_arena memory;        /* of the job, which lies in it                                      */
    txm_arena source_memory; /* of the source; empty if another job or a plane owns that         */
    txp_setup setup;
    txp_source *source;
    int width, height;       /* of the canvas at full size, margin included                       */
    int margin_x, margin_y;  /* where pixel (0, 0) of the output lies on it                       */
    double shift_x, shift_y; /* lattice offset at full size                                      */
    txp_step steps[TXP_MAX_STEPS];
    int step_count, next_step;
    int level; /* that the canvas has now; -1: none yet                             */
    txm_arena canvas_memory, finish_memory; /* of the canvas; of bend and tone                   */
    txp_canvas canvas;
    int16_t *bend, *tone; /* as in txp_origins; NULL: not yet                          */
    txp_given given;
    uint64_t seed;
    /* a part that is being made again lies at (part_x, part_y) of the canvas */
    texpatch_job *part;
    int part_x, part_y;
};

/* of a finished job */
static inline txp_origins txp_origins_of(const texpatch_job *job) {
    txp_origins from;
    from.at = job->canvas.at;
    from.bend = job->bend;
    from.tone = job->tone;
    return from;
}

/* Copy count pixels, from pixel k of `from` to pixel i of `to`. */
static inline void txp_copy_origins(const txp_origins *to, size_t i, const txp_origins *from,
                                    size_t k, size_t count, int tones) {
    const size_t n = (size_t)tones;
    memcpy(to->at + i, from->at + k, count * sizeof *to->at);
    memcpy(to->bend + 2 * i, from->bend + 2 * k, count * 2 * sizeof *to->bend);
    memcpy(to->tone + n * i, from->tone + n * k, count * n * sizeof *to->tone);
}

/* The next step; there is room for two windows on all levels, 16 passes each, the quilt, polishing twice
   and the finish. */
static txp_step *txp_add_step(texpatch_job *job) {
    TXM_ASSERT(job->step_count < TXP_MAX_STEPS);
    return &job->steps[job->step_count++];
}

static void txp_setup_steps(texpatch_job *job) {
    const txp_source *s = job->source;
    const int top = s->levels - 1, passes = job->setup.passes;
    job->step_count = job->next_step = 0;
    txp_step *t = txp_add_step(job);
    t->kind = TXP_STEP_QUILT;
    t->level = top;
    t->cost = 1;
    for (int l = top; l >= 0 && passes > 0; l--) {
        for (int half = 0; half < 2; half++) {
            const int count = l == 0 && job->setup.is_default ? 2 : passes;
            for (int i = 0; i < count; i++) {
                t = txp_add_step(job);
                t->kind = TXP_STEP_PASS;
                t->level = l;
                t->round = i;
                t->rounds = count;
                t->size = TXP_WINDOW >> half;
                t->stride = half && l < top ? 2 : 4;
                t->cost = txm_float(1.0 / (double)(1 << 2 * l));
            }
        }
    }
    for (int i = 0; i < 2 && passes > 0; i++) {
        t = txp_add_step(job);
        t->kind = TXP_STEP_POLISH;
        t->level = 0;
        t->round = i;
        t->cost = 0.2f;
    }
    t = txp_add_step(job);
    t->kind = TXP_STEP_FINISH;
    t->level = 0;
    t->cost = 0.5f;
}

/* How much of a job's steps is done, 0..1: reported before each stage of a step. */
static txm_status txp_report(const texpatch_job *job, txm_env *env, const char *stage) {
    double all = 0, done = 0;
    for (int i = 0; i < job->step_count; i++) {
        all += (double)job->steps[i].cost;
        if (i < job->next_step) done += (double)job->steps[i].cost;
    }
    return txm_progress(env, txm_float(done / all), stage)
               ? txm_fail(env, TXM_CANCELLED, "cancelled")
               : TXM_OK;
}

/* a size at full resolution, at a level, rounded up */
static inline int txp_level_size(int x, int level) {
    return (x + (1 << level) - 1) >> level;
}

/* A place one level finer: of the four pixels the one with this parity. */
static inline txp_place txp_refine_place(const txp_source *s, int level, txp_place p, int px,
                                         int py) {
    const txp_stack *c = &s->stack[level], *f = &s->stack[level - 1];
    const int n = s->sheets > 1 && p.x >= 0 ? c->sheet[p.y] : 0;
    txp_place q = p;
    if (p.x < 0) return q;
    q.x = 2 * p.x + px;
    q.y = f->first[n] + 2 * (p.y - c->first[n]) + py;
    return q;
}

/* The empty canvas of a level, with what is kept and the guide in place. */
static txm_status txp_canvas_make(const texpatch_job *job, int level, txm_arena *arena,
                                  txp_canvas *c, txm_env *env) {
    const txp_source *s = job->source;
    const size_t n = (size_t)s->bytes;
    const int side = 1 << level;
    memset(c, 0, sizeof *c);
    c->width = txp_level_size(job->width, level);
    c->height = txp_level_size(job->height, level);
    c->wrap = job->setup.tileable;
    c->pitch = (size_t)(c->width + TXP_PAD) * n;
    const size_t pixels = (size_t)c->width * (size_t)c->height;
    c->pixels = (uint8_t *)txm_arena_zero(arena, (size_t)(c->height + TXP_PAD) + 1, c->pitch);
    c->at = (txp_place *)txm_arena_alloc(arena, pixels, sizeof *c->at);
    if (job->given.fixed) c->fixed = (uint8_t *)txm_arena_zero(arena, pixels, 1);
    if (job->given.free_guide) c->free_guide = (uint8_t *)txm_arena_zero(arena, pixels, 1);
    if (arena->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the canvas");
    memset(c->at, 255, pixels * sizeof *c->at);
    if (!job->given.pixels) return TXM_OK;
    for (int y = 0; y < c->height; y++) {
        for (int x = 0; x < c->width; x++) {
            const size_t i = txp_index(c, x, y);
            uint32_t sum[TEXPATCH_MAX_CHANNELS] = {0};
            int count = 0, kept = 0, unbound = 0;
            for (int v = y * side; v < (y + 1) * side && v < job->height; v++) {
                for (int u = x * side; u < (x + 1) * side && u < job->width; u++) {
                    const size_t k = (size_t)v * (size_t)job->width + (size_t)u;
                    count++;
                    if (job->given.fixed) kept += job->given.fixed[k];
                    if (job->given.free_guide) unbound += job->given.free_guide[k];
                    for (size_t b = 0; b < n; b++) sum[b] += job->given.pixels[k * n + b];
                }
            }
            uint8_t *out = txp_canvas_at(s, c, x, y);
            for (size_t b = 0; b < n && count > 0; b++)
                out[b] = (uint8_t)((sum[b] + (uint32_t)count / 2) / (uint32_t)count);
            if (c->free_guide) c->free_guide[i] = unbound * 2 > count;
            if (c->fixed && kept == count) {
                const size_t k = (size_t)(y * side) * (size_t)job->width + (size_t)(x * side);
                c->fixed[i] = 1;
                if (job->given.from.at) {
                    txp_place p = job->given.from.at[k];
                    const int sheet = s->sheets > 1 && p.x >= 0 ? s->stack[0].sheet[p.y] : 0;
                    if (p.x >= 0) {
                        const txp_stack *t = &s->stack[level];
                        p.x = txm_clampi(p.x >> level, 0, t->wide[sheet] - 1);
                        p.y = t->first[sheet] + txm_clampi((p.y - s->stack[0].first[sheet]) >> level,
                                                           0, t->high[sheet] - 1);
                    }
                    c->at[i] = p;
                }
            }
        }
    }
    return TXM_OK;
}

/* The cost of the average use of a place in the first pass, in gray levels per pixel: half the
   contrast. It is lower for a torus, whose ends must fit as well. */
static double txp_use_weight(const texpatch_job *job) {
    return fmin(0.5 * job->source->contrast, job->setup.tileable ? 16 : 32);
}

/* The counts of use, all 0. */
static void txp_use_make(const txp_stack *k, txp_use *u, txm_arena *arena) {
    u->columns = (k->width + TXP_CELL - 1) / TXP_CELL;
    u->rows = (k->height + TXP_CELL - 1) / TXP_CELL;
    u->count =
        (uint32_t *)txm_arena_zero(arena, (size_t)u->columns * (size_t)u->rows, sizeof *u->count);
    u->sums = (uint32_t *)txm_arena_zero(arena, (size_t)(u->columns + 1) * (size_t)(u->rows + 1),
                                         sizeof *u->sums);
}

static void txp_quilt_one(void *context, int index) {
    txp_quilt *q = (txp_quilt *)context + index;
    txp_quilt_run(q);
}

/* The side of a patch on the coarsest canvas: the caller's or the default for the exemplar, limited
   by the sizes of sheets and canvas; a multiple of 4, 8 or more. */
static int txp_patch_side(const texpatch_job *job, const txp_canvas *c, int level) {
    const txp_source *s = job->source;
    const txp_stack *k = &s->stack[level];
    const int wanted = job->setup.patch ? ((job->setup.patch >> level) + 2) / 4 * 4
                       : s->is_random   ? TXP_SMALL_BLOCK
                                        : TXP_BLOCK;
    int most = c->width < c->height ? c->width : c->height;
    if (c->wrap) most = most * 2 / 3 < TXP_PAD ? most * 2 / 3 : TXP_PAD;
    for (int n = 0; n < s->sheets; n++) {
        const int side = k->wide[n] < k->high[n] ? k->wide[n] : k->high[n];
        if (most > side * 2 / 3) most = side * 2 / 3;
    }
    return txm_clampi(wanted < most ? wanted : most / 4 * 4, 8, 4 * TXP_BLOCK);
}

/* The first pass. On a small canvas it is run several times, and the result with the cheapest cuts
   is kept. */
static txm_status txp_step_quilt(texpatch_job *job, txm_arena *memory, txp_canvas *out,
                                 txm_env *env) {
    txp_source *s = job->source;
    const int level = s->levels - 1;
    const txp_stack *k = &s->stack[level];
    txm_arena scratch;
    txp_quilt q[TXP_STARTS];
    txm_status status = TXM_OK;
    int starts = s->is_random || s->bytes > 4 ? 1 : TXP_STARTS, best = -1;
    memset(q, 0, sizeof q);
    status = txp_canvas_make(job, level, memory, out, env);
    if (status != TXM_OK) return status;
    const size_t pixels = (size_t)out->width * (size_t)out->height;
    const size_t bytes = out->pitch * ((size_t)(out->height + TXP_PAD) + 1);
    const int block = txp_patch_side(job, out, level);
    txm_arena_init(&scratch, env);
    if (pixels > 300 * 300 || job->given.from.at) starts = 1;
    for (int i = 0; i < starts; i++) {
        txp_quilt *t = &q[i];
        t->source = s;
        t->stack = k;
        t->canvas = *out;
        t->block = block;
        t->overlap = t->block / 2;
        t->use_weight = txp_use_weight(job);
        t->lattice_weight = TXP_LATTICE;
        t->rng = txm_rng_make(job->seed, (uint64_t)(1000 + i));
        t->shift_x = job->shift_x / (1 << level);
        t->shift_y = job->shift_y / (1 << level);
        t->canvas.pixels = (uint8_t *)txm_arena_alloc(&scratch, bytes, 1);
        t->canvas.at = (txp_place *)txm_arena_alloc(&scratch, pixels, sizeof(txp_place));
        t->known = (uint8_t *)txm_arena_zero(&scratch, bytes, 1);
        t->done = (uint8_t *)txm_arena_zero(&scratch, pixels, 1);
        t->error = (float *)txm_arena_alloc(&scratch, (size_t)(t->block * t->block), sizeof(float));
        t->scratch =
            (double *)txm_arena_alloc(&scratch, (size_t)(t->block * t->overlap), sizeof(double));
        t->near_places = (txp_place *)txm_arena_alloc(&scratch, TXP_CANDIDATES, sizeof(txp_place));
        t->near_costs = (float *)txm_arena_alloc(&scratch, TXP_CANDIDATES, sizeof(float));
        txp_use_make(k, &t->use, &scratch);
        if (scratch.failed) {
            status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the first pass");
            goto done;
        }
        txp_use_mean(&t->use, (double)pixels);
        memcpy(t->canvas.pixels, out->pixels, bytes);
        memcpy(t->canvas.at, out->at, pixels * sizeof(txp_place));
        const size_t n = (size_t)s->bytes, guide = (size_t)s->guide_at;
        for (int y = 0; y < out->height; y++) {
            for (int x = 0; x < out->width; x++) {
                const size_t p = txp_index(out, x, y);
                uint8_t *known = t->known + (size_t)y * out->pitch + (size_t)x * n;
                if (out->fixed && out->fixed[p]) {
                    t->done[p] = 1;
                    memset(known, 255, guide);
                }
                if (guide < n && !(out->free_guide && out->free_guide[p]))
                    memset(known + guide, 255, n - guide);
            }
        }
        txp_canvas_repeat(s, &t->canvas, t->known);
        txp_canvas_repeat(s, &t->canvas, t->canvas.pixels);
    }
    status = txp_report(job, env, "patches");
    if (status != TXM_OK) goto done;
    txm_parallel_for(env, starts, txp_quilt_one, q);
    for (int i = 0; i < starts; i++) {
        if (q[i].failed) {
            status = txm_fail(env, TXM_TOO_SMALL,
                              "no piece of the exemplar is free of masked pixels; "
                              "mask less, or make smaller patches");
            goto done;
        }
        if (best < 0 || q[i].cost < q[best].cost) best = i;
    }
    memcpy(out->at, q[best].canvas.at, pixels * sizeof(txp_place));
    txp_canvas_fill(s, k, out, 0, out->height);
done:
    txm_arena_free(&scratch);
    return status;
}

/* The canvas one level finer. */
static txm_status txp_refine(const texpatch_job *job, const txp_canvas *from, int level,
                             txm_arena *memory, txp_canvas *c, txm_env *env) {
    const txp_source *s = job->source;
    txm_status status = txp_canvas_make(job, level, memory, c, env);
    if (status != TXM_OK) return status;
    for (int y = 0; y < c->height; y++) {
        for (int x = 0; x < c->width; x++) {
            const size_t i = txp_index(c, x, y);
            if (c->fixed && c->fixed[i]) continue;
            txp_place p = from->at[txp_index(from, x / 2, y / 2)];
            if (p.x < 0) { /* next to kept pixels: take another neighbour */
                const int tx[4] = {x / 2 + 1, x / 2 - 1, x / 2, x / 2},
                          ty[4] = {y / 2, y / 2, y / 2 + 1, y / 2 - 1};
                for (int d = 0; d < 4 && p.x < 0; d++) {
                    if (tx[d] >= 0 && ty[d] >= 0 && tx[d] < from->width && ty[d] < from->height)
                        p = from->at[txp_index(from, tx[d], ty[d])];
                }
            }
            c->at[i] = txp_refine_place(s, level + 1, p, x & 1, y & 1);
        }
    }
    txp_canvas_fill(s, &s->stack[level], c, 0, c->height);
    return TXM_OK;
}

static int txp_grid(int extent, int size, int step, int wraps, int *at) {
    int n = 0;
    if (wraps) {
        for (int x = 0; x < extent; x += step) at[n++] = x;
        return n;
    }
    for (int x = 0; x < extent - size; x += step) at[n++] = x;
    at[n++] = extent - size;
    return n;
}

/* Allocate what a pass over c needs; scratch->failed: no memory. */
static void txp_pass_make(txp_pass *p, const txp_canvas *c, txm_arena *scratch) {
    p->xs = (int *)txm_arena_alloc(scratch, (size_t)(c->width / p->step + 2), sizeof(int));
    p->ys = (int *)txm_arena_alloc(scratch, (size_t)(c->height / p->step + 2), sizeof(int));
    if (scratch->failed) return;
    p->columns = txp_grid(c->width, p->size, p->step, c->wrap & TEXPATCH_TILE_X, p->xs);
    p->rows = txp_grid(c->height, p->size, p->step, c->wrap & TEXPATCH_TILE_Y, p->ys);
    const size_t windows = (size_t)p->columns * (size_t)p->rows;
    p->match = (txp_place *)txm_arena_alloc(scratch, windows, sizeof *p->match);
    p->sad = (uint32_t *)txm_arena_alloc(scratch, windows, sizeof *p->sad);
    p->weight = (int32_t *)txm_arena_alloc(scratch, windows, sizeof *p->weight);
    p->grain = (uint32_t *)txm_arena_zero(scratch, windows, sizeof *p->grain);
    txp_use_make(p->stack, &p->use, scratch);
    const size_t n = (size_t)p->source->bytes, band = (size_t)c->width * TXP_BAND;
    for (int i = 0; i < TXP_LANES && i * TXP_BAND < c->height; i++) {
        txp_band *b = &p->bands[i];
        b->sums = (int32_t *)txm_arena_alloc(scratch, band, (n + 2) * sizeof(int32_t));
        b->mean = (uint8_t *)txm_arena_alloc(scratch, band, n);
        if (scratch->failed) return;
        b->total = b->sums + band * n;
        b->nearest = b->total + band;
    }
}

/* One pass of the optimisation over c; the places it chooses go into c->next. */
static txm_status txp_run_pass(const texpatch_job *job, const txp_step *t, const txp_canvas *c,
                               txm_env *env) {
    const txp_source *s = job->source;
    const int bands = (c->height + TXP_BAND - 1) / TXP_BAND;
    txm_arena scratch;
    txp_pass p;
    txm_status status = TXM_OK;
    memset(&p, 0, sizeof p);
    txm_arena_init(&scratch, env);
    p.source = s;
    p.stack = &s->stack[t->level];
    p.canvas = c;
    p.size = t->size;
    p.step = t->stride;
    p.shift_x = job->shift_x / (1 << t->level);
    p.shift_y = job->shift_y / (1 << t->level);
    p.use_weight = txp_use_weight(job) / 2;
    p.lattice_weight = TXP_LATTICE / 5;
    p.exhaustive = t->level == s->levels - 1 && t->round == 0 && p.size == TXP_WINDOW;
    p.most_same = 8;
    p.skip = p.exhaustive ? 2 : 1;
    if (job->setup.novelty > 0 && t->level == (s->levels > 1 ? 1 : 0) && p.size < TXP_WINDOW &&
        t->round == t->rounds - 1) {
        p.most_same = (int)(7.5f - 3.5f * job->setup.novelty);
        p.exhaustive = 1;
        p.skip = 2;
    }
    p.seed = txm_hash(job->seed + (uint64_t)(job->next_step + 1) * 7919);
    txp_bell(p.size, p.bell);
    txp_pass_make(&p, c, &scratch);
    if (scratch.failed) {
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a pass");
        goto done;
    }
    txp_count_use(c, &p.use);
    txp_canvas_repeat(s, c, c->pixels);
    for (p.first_row = 0; p.first_row < p.rows; p.first_row += 32) {
        status = txp_report(job, env, "optimising");
        if (status != TXM_OK) goto done;
        txm_parallel_for(env, p.rows - p.first_row < 32 ? p.rows - p.first_row : 32, txp_match_row,
                         &p);
    }
    txp_set_weights(&p);
    memcpy(c->next, c->at, (size_t)c->width * (size_t)c->height * sizeof *c->next);
    for (p.first_band = 0; p.first_band < bands; p.first_band += TXP_LANES) {
        status = txp_report(job, env, "optimising");
        if (status != TXM_OK) goto done;
        txm_parallel_for(env, bands - p.first_band < TXP_LANES ? bands - p.first_band : TXP_LANES,
                         txp_choose_band, &p);
    }
done:
    txm_arena_free(&scratch);
    return status;
}

static txm_status txp_run_polish(const texpatch_job *job, const txp_canvas *c, txm_env *env) {
    txp_polish p;
    p.source = job->source;
    p.stack = &job->source->stack[0];
    p.canvas = c;
    txp_canvas_repeat(p.source, c, c->pixels);
    const int bands = (c->height + TXP_BAND - 1) / TXP_BAND;
    for (p.first_band = 0; p.first_band < bands; p.first_band += TXP_LANES) {
        const txm_status status = txp_report(job, env, "polishing");
        if (status != TXM_OK) return status;
        txm_parallel_for(env, bands - p.first_band < TXP_LANES ? bands - p.first_band : TXP_LANES,
                         txp_polish_band, &p);
    }
    return TXM_OK;
}

/* ---- pieces warped until lines meet, steps of colour spread ----------------------------- */

enum {
    TXP_FINISH_ROWS = 256, /* rows of a large canvas that are finished at a time ...               */
    TXP_FINISH_REACH = TXP_BAND /* ... with so many before and behind them, TXP_FADE at least       */
};
#define TXP_BEND_SCREEN 0.02  /* bends fade within 7 pixels                                       */
#define TXP_TONE_SCREEN 0.004 /* tones within 16                                                  */
#define TXP_BENT 0.05f        /* pixels and gray levels: kept pixels that are bent or toned more  */
#define TXP_TONED 0.25f       /* act on their surroundings                                        */

/* The two fields over some rows. */
typedef struct txp_fields {
    txp_field bend, tone;
    int tones; /* of the lanes of tone so many are used                                            */
    int measured; /* rows from here on have no seams yet                                          */
} txp_fields;

/* A stored value, and back. */
static inline int16_t txp_code(float value, float unit) {
    return (int16_t)floorf(txm_float(txm_clampf(txm_float(value * unit), -32767, 32767) + 0.5f));
}

/* Set the values of fixed pixels. */
static void txp_fields_fix(const txp_origins *given, txp_fields *f) {
    const txp_canvas *c = f->bend.canvas;
    const size_t lanes = (size_t)f->tone.lanes, tones = (size_t)f->tones;
    if (!given->bend) return;
    for (int y = 0; y < f->bend.height; y++) {
        const int row = txp_field_row(&f->bend, y);
        for (int x = 0; x < c->width && row >= 0; x++) {
            const size_t i = txp_index(c, x, row), at = (size_t)y * (size_t)c->width + (size_t)x;
            const int16_t *b = given->bend + 2 * i, *v = given->tone + tones * i;
            float *bent = f->bend.value + 2 * at, *toned = f->tone.value + lanes * at, most = 0;
            if (!c->fixed[i]) continue;
            for (size_t k = 0; k < 2; k++) bent[k] = txm_float((float)b[k] / TXP_BEND_UNIT);
            for (size_t k = 0; k < tones; k++) {
                toned[k] = txm_float((float)v[k] / TXP_TONE_UNIT);
                most = txm_maxf(most, fabsf(toned[k]));
            }
            if (fabsf(bent[0]) + fabsf(bent[1]) > TXP_BENT) txp_field_mark(&f->bend, x, y);
            if (most > TXP_TONED) txp_field_mark(&f->tone, x, y);
        }
    }
}

/* Measure the seams of the rows that have none yet. A band also writes to the first row of the next
   one: so every second band at a time, and the last one, which may be followed by the first, alone. */
static txm_status txp_fields_measure(const texpatch_job *job, txp_fields *f, txm_env *env) {
    txp_seams seams;
    const int bands = (f->bend.height - f->measured + TXP_BAND - 1) / TXP_BAND;
    seams.source = job->source;
    seams.bend = &f->bend;
    seams.tone = &f->tone;
    for (int turn = 0; turn < 3; turn++) {
        const int end = turn < 2 ? bands - 1 : bands;
        for (int band = turn < 2 ? turn : bands - 1; band < end; band += 2 * TXP_LANES) {
            const int count = (end - band + 1) / 2;
            const txm_status status = txp_report(job, env, "blending");
            if (status != TXM_OK) return status;
            seams.first_row = f->measured + band * TXP_BAND;
            txm_parallel_for(env, count < TXP_LANES ? count : TXP_LANES, txp_measure_band, &seams);
        }
    }
    f->measured = f->bend.height;
    return TXM_OK;
}

/* Relax rows from..to-1. Of other rows only those that still act on them in the sweeps to come. */
static txm_status txp_fields_relax(const texpatch_job *job, txp_fields *f, int from, int to,
                                   txm_env *env) {
    const int height = f->bend.height;
    txp_field_spread(&f->bend);
    txp_field_spread(&f->tone);
    for (int left = 2 * TXP_SWEEPS - 1; left >= 0; left--) {
        const int first = from - left > 0 ? from - left : 0;
        const int end = to + left < height ? to + left : height;
        const int is_all = f->bend.closed, colour = (left + 1) % 2;
        const txm_status status = colour ? TXM_OK : txp_report(job, env, "blending");
        if (status != TXM_OK) return status;
        txp_relax_field(&f->bend, is_all ? 0 : first, is_all ? height : end, colour, env);
        txp_relax_field(&f->tone, is_all ? 0 : first, is_all ? height : end, colour, env);
    }
    return TXM_OK;
}

/* Store rows from..to-1 of the fields. */
static void txp_fields_store(const txp_fields *f, int from, int to, int16_t *bend, int16_t *tone) {
    const txp_canvas *c = f->bend.canvas;
    const size_t width = (size_t)c->width, lanes = (size_t)f->tone.lanes, tones = (size_t)f->tones;
    const size_t first = (size_t)(f->bend.top + from) * width, at = (size_t)from * width;
    const size_t count = (size_t)(to - from) * width;
    TXM_ASSERT(f->bend.top + from >= 0 && f->bend.top + to <= c->height);
    for (size_t i = 0; i < 2 * count; i++)
        bend[2 * first + i] = txp_code(f->bend.value[2 * at + i], TXP_BEND_UNIT);
    for (size_t i = 0; i < count; i++) {
        const float *value = f->tone.value + lanes * (at + i);
        for (size_t k = 0; k < tones; k++) tone[tones * (first + i) + k] = txp_code(value[k], TXP_TONE_UNIT);
    }
}

/* Compute how the pieces of a canvas are bent and toned. A large one is done `step` rows at a time, a
   multiple of TXP_BAND: the fields take 40 bytes a pixel of RGB, what is stored of them 10. */
static txm_status txp_finish(const texpatch_job *job, const txp_canvas *c, int step, txm_arena *memory,
                             txp_origins *out, txm_env *env) {
    const int lanes = (job->source->tones + 3) / 4 * 4, reach = TXP_FINISH_REACH;
    const int is_whole = c->height <= step + 2 * reach, rows = is_whole ? c->height : step + 2 * reach;
    const size_t pixels = (size_t)c->width * (size_t)c->height;
    txm_arena scratch;
    txp_fields f;
    txm_status status = TXM_OK;
    TXM_ASSERT(reach >= TXP_FADE && step % TXP_BAND == 0);
    memset(&f, 0, sizeof f);
    f.tones = job->source->tones;
    txm_arena_init(&scratch, env);
    txp_field_make(&f.bend, c, rows, 2, TXP_BEND_SCREEN, &scratch);
    txp_field_make(&f.tone, c, rows, lanes, TXP_TONE_SCREEN, &scratch);
    out->bend = (int16_t *)txm_arena_alloc(memory, pixels, 2 * sizeof *out->bend);
    out->tone = (int16_t *)txm_arena_alloc(memory, pixels, (size_t)f.tones * sizeof *out->tone);
    if (memory->failed || scratch.failed)
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to finish the picture");
    if (!is_whole) f.bend.top = f.tone.top = -reach;
    for (int y = 0; y < c->height && status == TXM_OK; y += step) {
        const int from = is_whole ? 0 : reach, left = c->height - y;
        const int to = is_whole ? rows : from + (left < step ? left : step);
        txp_fields_fix(&job->given.from, &f);
        status = txp_fields_measure(job, &f, env);
        if (status == TXM_OK) status = txp_fields_relax(job, &f, from, to, env);
        if (status != TXM_OK) break;
        txp_fields_store(&f, from, to, out->bend, out->tone);
        if (is_whole) break;
        txp_field_move(&f.bend, step);
        txp_field_move(&f.tone, step);
        f.measured = rows - step;
    }
    txm_arena_free(&scratch);
    return status;
}

/* ---- beginning, stepping, releasing a job ----------------------------------------------- */

/* A random offset of the lattice. */
static void txp_lattice_start(const txp_source *s, uint64_t seed, double *x, double *y) {
    txm_rng rng = txm_rng_make(seed, 5);
    *x = txm_rng_below(&rng, (uint32_t)s->stack[0].wide[0]);
    *y = txm_rng_below(&rng, (uint32_t)s->stack[0].high[0]);
}

/* A job on a source, with nothing given yet, in `memory`, which it owns in the end. */
static texpatch_job *txp_job_make(const txp_setup *u, txp_source *s, int width, int height,
                                  uint64_t seed, txm_arena *memory, txm_env *env) {
    texpatch_job *job = (texpatch_job *)txm_arena_zero(memory, 1, sizeof *job);
    if (!job) return NULL;
    job->setup = *u;
    job->source = s;
    job->seed = seed;
    job->level = -1;
    job->width = width;
    job->height = height;
    txp_setup_steps(job);
    txm_arena_init(&job->canvas_memory, env);
    txm_arena_init(&job->finish_memory, env);
    txm_arena_init(&job->source_memory, env);
    return job;
}

/* Allocate what is given of a canvas; what is 0 here is not needed. memory->failed tells whether
   there was no memory. */
static void txp_given_make(txp_given *g, const txp_source *s, size_t pixels, int fixed,
                           int free_guide, int places, txm_arena *memory) {
    g->pixels = (uint8_t *)txm_arena_zero(memory, pixels, (size_t)s->bytes);
    if (fixed) g->fixed = (uint8_t *)txm_arena_zero(memory, pixels, 1);
    if (free_guide) g->free_guide = (uint8_t *)txm_arena_zero(memory, pixels, 1);
    if (places) {
        txp_origins *o = &g->from;
        o->at = (txp_place *)txm_arena_alloc(memory, pixels, sizeof *o->at);
        o->bend = (int16_t *)txm_arena_zero(memory, pixels, 2 * sizeof *o->bend);
        o->tone = (int16_t *)txm_arena_zero(memory, pixels, (size_t)s->tones * sizeof *o->tone);
    }
}

/* Copy the guide and its mask to the canvas; the margin repeats the border. mask: a byte for each
   pixel, 0 where the guide does not count; NULL: it counts everywhere. */
static void txp_guide_load(const texpatch_job *job, const txm_image *guide, const uint8_t *mask,
                           const txp_given *g) {
    const txp_source *s = job->source;
    const txp_setup *u = &job->setup;
    uint8_t bytes[TEXPATCH_MAX_CHANNELS];
    for (int y = 0; y < job->height; y++) {
        const int gy = txm_clampi(y - job->margin_y, 0, u->height - 1);
        for (int x = 0; x < job->width; x++) {
            const int gx = txm_clampi(x - job->margin_x, 0, u->width - 1);
            const size_t i = (size_t)y * (size_t)job->width + (size_t)x;
            const size_t tail = (size_t)(s->bytes - s->guide_at);
            txp_features(u, s, NULL, guide, gx, gy, 1, bytes);
            memcpy(g->pixels + i * (size_t)s->bytes + s->guide_at, bytes + s->guide_at, tail);
            if (g->free_guide)
                g->free_guide[i] = mask && !mask[(size_t)gy * (size_t)u->width + (size_t)gx];
        }
    }
}

TEXPATCH_API void texpatch_free(texpatch_job *job) {
    if (!job) return;
    texpatch_free(job->part);
    txm_arena_free(&job->canvas_memory);
    txm_arena_free(&job->finish_memory);
    txm_arena_free(&job->source_memory);
    txm_arena_free(&job->memory); /* the job lies in it */
}

TEXPATCH_API txm_status texpatch_begin(const texpatch_desc *desc, txm_env *env,
                                       texpatch_job **out) {
    txp_setup setup;
    txp_source source, *s;
    txm_arena memory, source_memory, masks;
    uint8_t *keep = NULL, *counts = NULL;
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    if (!desc) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL; pass a texpatch_desc");
    txm_status status = txp_check_exemplars(desc, &setup, &source, env);
    if (status == TXM_OK) status = txp_check_output(desc, &setup, &source, env);
    if (status != TXM_OK) return status;
    txm_arena_init(&memory, env);
    txm_image guide = txm_image_resolve(desc->guide);
    status = txp_show_all(&setup, &memory, env);
    if (status == TXM_OK && guide.pixels) status = txp_show(&guide, 0, desc->tileable, &memory, env);
    if (status == TXM_OK) status = txp_source_make(&setup, &source, &s, &source_memory, env);
    if (status != TXM_OK) {
        txm_arena_free(&memory);
        return status;
    }

    const int wx = desc->tileable & TEXPATCH_TILE_X, wy = desc->tileable & TEXPATCH_TILE_Y;
    const int room = 2 * TXP_WINDOW << (s->levels - 1); /* for a few patches */
    int width = desc->width + (wx ? 0 : 2 * TXP_MARGIN);
    int height = desc->height + (wy ? 0 : 2 * TXP_MARGIN);
    if (!wx && width < room) width = room;
    if (!wy && height < room) height = room;
    const size_t pixels = (size_t)width * (size_t)height;
    txm_arena_init(&masks, env);
    texpatch_job *job = txp_job_make(&setup, s, width, height, desc->seed, &memory, env);
    if (!job) goto no_memory;
    job->margin_x = wx ? 0 : TXP_MARGIN;
    job->margin_y = wy ? 0 : TXP_MARGIN;
    txp_lattice_start(s, desc->seed, &job->shift_x, &job->shift_y);
    if (s->guide_bytes || desc->kept) {
        txp_given_make(&job->given, s, pixels, desc->kept != NULL, s->guide_bytes > 0, 0, &memory);
        if (memory.failed ||
            (desc->kept &&
             txp_read_mask(&desc->keep, TXM_MASK_ALLOWS, &masks, &keep, env) != TXM_OK) ||
            (s->guide_bytes &&
             txp_read_mask(&desc->guide_mask, TXM_MASK_ALLOWS, &masks, &counts, env) != TXM_OK))
            goto no_memory;
        for (int y = 0; y < desc->height && desc->kept; y++) {
            for (int x = 0; x < desc->width; x++) {
                const size_t i =
                    (size_t)(y + job->margin_y) * (size_t)width + (size_t)(x + job->margin_x);
                if (!keep[(size_t)y * (size_t)desc->width + (size_t)x]) continue;
                job->given.fixed[i] = 1;
                txp_features(&setup, s, setup.kept, NULL, x, y, 1,
                             job->given.pixels + i * (size_t)s->bytes);
            }
        }
        if (s->guide_bytes) {
            txp_guide_load(job, &guide, counts, &job->given);
        }
    }
    txm_arena_free(&masks);
    job->memory = memory;
    job->source_memory = source_memory;
    *out = job;
    return TXM_OK;
no_memory:
    txm_arena_free(&masks);
    txm_arena_free(&memory);
    txm_arena_free(&source_memory);
    return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a job");
}

/* Every pixel of the canvas may take another place; all at a time, at the end. */
static txm_status txp_step_choose(const texpatch_job *job, const txp_step *t, const txp_canvas *c,
                                  txm_env *env) {
    const size_t pixels = (size_t)c->width * (size_t)c->height;
    txp_canvas with = *c;
    txm_arena scratch;
    txm_status status;
    txm_arena_init(&scratch, env);
    with.next = (txp_place *)txm_arena_alloc(&scratch, pixels, sizeof *with.next);
    if (scratch.failed) status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a pass");
    else if (t->kind == TXP_STEP_PASS) status = txp_run_pass(job, t, &with, env);
    else status = txp_run_polish(job, &with, env);
    if (status == TXM_OK) {
        memcpy(c->at, with.next, pixels * sizeof *c->at);
        txp_canvas_fill(job->source, &job->source->stack[t->level], c, 0, c->height);
    }
    txm_arena_free(&scratch);
    return status;
}

/* Bring the canvas to the level of a step: each level takes the place of the one before. */
static txm_status txp_step_reach(texpatch_job *job, const txp_step *t, txm_env *env) {
    while (job->level < 0 || job->level > t->level) {
        const int level = job->level < 0 ? t->level : job->level - 1;
        txm_arena memory;
        txp_canvas canvas;
        txm_arena_init(&memory, env);
        const txm_status status = job->level < 0
                                      ? txp_step_quilt(job, &memory, &canvas, env)
                                      : txp_refine(job, &job->canvas, level, &memory, &canvas, env);
        if (status != TXM_OK) {
            txm_arena_free(&memory);
            return status;
        }
        txm_arena_free(&job->canvas_memory);
        job->canvas_memory = memory;
        job->canvas = canvas;
        job->level = level;
    }
    return TXM_OK;
}

static txm_status txp_step_finish(texpatch_job *job, txm_env *env) {
    txm_arena stored;
    txp_origins made;
    txm_arena_init(&stored, env);
    const txm_status status = txp_finish(job, &job->canvas, TXP_FINISH_ROWS, &stored, &made, env);
    if (status != TXM_OK) {
        txm_arena_free(&stored);
        return status;
    }
    job->finish_memory = stored;
    job->bend = made.bend;
    job->tone = made.tone;
    return TXM_OK;
}

/* A step of a job without a part. The first one, the quilt, is done once its level is reached. */
static txm_status txp_step_run(texpatch_job *job, txm_env *env) {
    const txp_step *t = &job->steps[job->next_step];
    txm_status status = txp_step_reach(job, t, env);
    if (status == TXM_OK && (t->kind == TXP_STEP_PASS || t->kind == TXP_STEP_POLISH))
        status = txp_step_choose(job, t, &job->canvas, env);
    if (status == TXM_OK && t->kind == TXP_STEP_FINISH) status = txp_step_finish(job, env);
    if (status == TXM_OK) job->next_step++;
    return status;
}

/* Copy the part that was made again into the whole. */
static void txp_part_join(texpatch_job *job) {
    texpatch_job *part = job->part;
    const txp_source *s = job->source;
    const size_t n = (size_t)s->bytes;
    const txp_origins from = txp_origins_of(part), to = txp_origins_of(job);
    for (int y = 0; y < part->height; y++) {
        for (int x = 0; x < part->width; x++) {
            const size_t i = txp_index(&part->canvas, x, y);
            const size_t k = txp_index(&job->canvas, job->part_x + x, job->part_y + y);
            if (part->given.fixed[i]) continue;
            txp_copy_origins(&to, k, &from, i, 1, s->tones);
            memcpy(txp_canvas_at(s, &job->canvas, job->part_x + x, job->part_y + y),
                   txp_canvas_at(s, &part->canvas, x, y), n);
        }
    }
    texpatch_free(part);
    job->part = NULL;
}

TEXPATCH_API txm_status texpatch_step(texpatch_job *job, txm_env *env, int *more) {
    txm_status status = TXM_OK;
    if (!job) return txm_fail(env, TXM_BAD_ARGUMENT, "job is NULL");
    texpatch_job *at = job->part ? job->part : job;
    if (at->next_step < at->step_count) status = txp_step_run(at, env);
    if (status == TXM_OK && job->part && at->next_step == at->step_count) txp_part_join(job);
    if (more) *more = job->part || job->next_step < job->step_count;
    return status;
}

TEXPATCH_API int texpatch_lattice(const texpatch_job *job, float vectors[4]) {
    for (int i = 0; i < 4 && vectors; i++) vectors[i] = 0;
    if (!job || !job->source->has_lattice) return 0;
    for (int i = 0; i < 4 && vectors; i++) vectors[i] = txm_float(job->source->stack[0].lattice[i]);
    return 1;
}

/* ---- what a pixel shows ----------------------------------------------------------------- */

#define TXP_LEAST_BEND 0.05 /* pixels: less is none */
enum { TXP_LEAST_TONE = 5 };  /* 1 / TXP_TONE_UNIT of a gray level */

/* What a pixel of the output shows: place (x, y) of sheet `sheet`; sheet -1: a kept pixel. */
typedef struct txp_pixel {
    int sheet, is_whole;
    double x, y;
    const int16_t *tone; /* as in txp_origins; NULL: none */
} txp_pixel;

/* May all the pixels be used between which (x, y) of a sheet lies? */
static int txp_is_usable(const txp_source *s, int sheet, double x, double y) {
    const txp_stack *k = &s->stack[0];
    if (!k->bad) return 1;
    const int left = txm_clampi((int)floor(x), 0, k->wide[sheet] - 1);
    const int top = txm_clampi((int)floor(y), 0, k->high[sheet] - 1);
    const int right = txm_clampi(left + 1, 0, k->wide[sheet] - 1);
    const int bottom = txm_clampi(top + 1, 0, k->high[sheet] - 1);
    const size_t w = (size_t)k->width + 1;
    const uint32_t *upper = k->bad + (size_t)(k->first[sheet] + top) * w;
    const uint32_t *lower = k->bad + (size_t)(k->first[sheet] + bottom + 1) * w;
    return lower[right + 1] - lower[left] == upper[right + 1] - upper[left];
}

static txp_pixel txp_pixel_at(const texpatch_job *job, int x, int y) {
    txp_pixel out = {-1, 1, 0, 0, NULL};
    const txp_source *s = job->source;
    x += job->margin_x;
    y += job->margin_y;
    const texpatch_job *part = job->part;
    if (part && part->level >= 0 && x >= job->part_x && y >= job->part_y &&
        x < job->part_x + part->width && y < job->part_y + part->height &&
        !part->given
             .fixed[(size_t)(y - job->part_y) * (size_t)part->width + (size_t)(x - job->part_x)]) {
        x -= job->part_x;
        y -= job->part_y;
        job = part;
    }
    const size_t i = txp_index(&job->canvas, x >> job->level, y >> job->level);
    txp_place p = job->canvas.at[i];
    if (p.x < 0) return out;
    for (int l = job->level; l > 0; l--)
        p = txp_refine_place(s, l, p, (x >> (l - 1)) & 1, (y >> (l - 1)) & 1);
    out.sheet = s->sheets > 1 ? s->stack[0].sheet[p.y] : 0;
    out.x = p.x;
    out.y = p.y - s->stack[0].first[out.sheet];
    if (!job->bend) return out;
    double bx = job->bend[2 * i] / (double)TXP_BEND_UNIT, by = job->bend[2 * i + 1] / (double)TXP_BEND_UNIT;
    while (bx * bx + by * by >= TXP_LEAST_BEND * TXP_LEAST_BEND &&
           !txp_is_usable(s, out.sheet, out.x + bx, out.y + by)) {
        bx /= 2; /* towards the place itself, which may be used */
        by /= 2;
    }
    if (bx * bx + by * by >= TXP_LEAST_BEND * TXP_LEAST_BEND) {
        out.is_whole = 0;
        out.x += bx;
        out.y += by;
    }
    out.tone = job->tone + i * (size_t)s->tones;
    return out;
}

TEXPATCH_API texpatch_source texpatch_source_at(const texpatch_job *job, int x, int y) {
    texpatch_source from = {0, 0, -1, 0};
    double ex, ey;
    if (!job || job->level < 0 || x < 0 || y < 0 || x >= job->setup.width || y >= job->setup.height)
        return from;
    const txp_pixel p = txp_pixel_at(job, x, y);
    if (p.sheet < 0) return from;
    const txp_sheet *sheet = &job->source->sheet[p.sheet];
    const txm_image *im = &job->setup.maps[sheet->exemplar][0];
    txp_sheet_place(sheet, p.x, p.y, &ex, &ey);
    from.x = txm_float(ex < 0 ? 0 : ex > im->width - 1 ? im->width - 1 : ex);
    from.y = txm_float(ey < 0 ? 0 : ey > im->height - 1 ? im->height - 1 : ey);
    from.exemplar = sheet->exemplar;
    from.turn = sheet->turn;
    return from;
}

/* Turn the vector of a normal map with its piece and give it unit length. */
static void txp_normal(const txp_setup *u, int map, const txp_sheet *sheet, float *v) {
    const double axes[4] = {sheet->xx, sheet->yx, sheet->xy, sheet->yy};
    txm_normal_turn(axes, u->kinds[map].is_normal == 2, u->maps[0][map].sample, v);
}

typedef struct txp_draw {
    const texpatch_job *job;
    int map, x, y;
    int tone_at; /* first compared byte of the map; -1: it has no tone                        */
    double tone_scale;
    int has_alpha;
    txm_image out;
} txp_draw;

/* What is opaque stays opaque and what is transparent stays transparent; alphas between may change
   their tone: 1 at a half, 0 at both ends. */
static inline double txp_half_shown(float alpha) {
    const double a = (double)txm_clampf(alpha, 0, 1);
    return 4 * a * (1 - a);
}

static void txp_draw_row(void *context, int row) {
    const txp_draw *d = (const txp_draw *)context;
    const texpatch_job *job = d->job;
    const txp_setup *u = &job->setup;
    const int channels = d->out.channels;
    const size_t sample = txm_sample_bytes(d->out.sample) * (size_t)channels;
    const float low = u->low[d->map], high = u->high[d->map];
    uint8_t *to = (uint8_t *)txm_image_row(&d->out, row);
    for (int x = 0; x < d->out.width; x++, to += sample) {
        const txp_pixel p = txp_pixel_at(job, d->x + x, d->y + row);
        if (p.sheet < 0) {
            const txm_image *kept = &u->kept[d->map];
            if (!kept->pixels) continue;
            memcpy(to,
                   (const uint8_t *)txm_image_row_const(kept, d->y + row) +
                       (size_t)(d->x + x) * sample,
                   sample);
            continue;
        }
        const txp_sheet *sheet = &job->source->sheet[p.sheet];
        const txm_image *im = &u->maps[sheet->exemplar][d->map];
        double ex, ey;
        float v[4];
        int is_copy = p.is_whole && sheet->plain && !(u->kinds[d->map].is_normal && sheet->turn);
        txp_sheet_place(sheet, p.x, p.y, &ex, &ey);
        for (int c = 0; c < channels && p.tone && d->tone_at >= 0 && is_copy; c++)
            is_copy = abs(p.tone[d->tone_at + c]) < TXP_LEAST_TONE;
        if (is_copy) {
            memcpy(to, (const uint8_t *)txm_image_row_const(im, (int)ey) + (size_t)(int)ex * sample,
                   sample);
            continue;
        }
        if (p.is_whole && sheet->plain) {
            for (int c = 0; c < channels; c++) v[c] = txm_image_get(im, (int)ex, (int)ey, c);
        } else {
            txp_sample(im, ex, ey, u->kinds[d->map].is_label, d->has_alpha, v);
        }
        if (p.tone && d->tone_at >= 0) {
            for (int c = 0; c < channels; c++) {
                double scale = d->tone_scale;
                if (d->has_alpha && c == channels - 1) scale *= txp_half_shown(v[c]);
                v[c] = txm_clampf(txm_float(v[c] + scale * p.tone[d->tone_at + c]), low,
                                  high);
            }
        }
        if (u->kinds[d->map].is_normal) txp_normal(u, d->map, sheet, v);
        for (int c = 0; c < channels; c++) txm_image_set(&d->out, x, row, c, v[c]);
    }
}

/* Check an output, and find where the tone of its map is stored. */
static txm_status txp_draw_begin(const txp_setup *u, int map, txm_env *env, txm_image out,
                                 txp_draw *d) {
    const txm_status status = txm_image_check(&out, "out", TEXPATCH_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    d->map = map;
    d->out = txm_image_resolve(out);
    d->has_alpha = txp_has_alpha(&u->kinds[map], &d->out);
    if (d->out.channels != u->maps[0][map].channels || d->out.sample != u->maps[0][map].sample)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "out",
                           "must have the channels and samples of its map");
    d->tone_at = 0;
    for (int m = 0; m < u->map_count; m++) {
        if (m < map && u->kinds[m].weight > 0) d->tone_at += u->maps[0][m].channels;
    }
    if (!(u->kinds[map].weight > 0) || u->kinds[map].is_normal || u->kinds[map].is_label)
        d->tone_at = -1;
    else
        d->tone_scale = (double)(u->high[map] - u->low[map]) / 255 / (double)TXP_TONE_UNIT *
                        (double)u->most_weight / (double)u->kinds[map].weight;
    return TXM_OK;
}

/* Draw all rows of out, some at a time; progress runs from `from` to 1. */
static txm_status txp_draw_rows(const txp_draw *d, float from, txm_env *env) {
    txp_draw some = *d;
    for (int y = 0; y < d->out.height; y += 64) {
        if (txm_progress(env, txm_lerpf(from, 1, (float)y / (float)d->out.height), "drawing"))
            return txm_fail(env, TXM_CANCELLED, "cancelled");
        some.y = d->y + y;
        some.out = d->out;
        some.out.height = d->out.height - y < 64 ? d->out.height - y : 64;
        some.out.pixels = txm_image_row(&d->out, y);
        txm_parallel_for(env, some.out.height, txp_draw_row, &some);
    }
    return TXM_OK;
}

TEXPATCH_API txm_status texpatch_draw(const texpatch_job *job, int map, int x, int y, txm_env *env,
                                      txm_image out) {
    txp_draw d;
    if (!job) return txm_fail(env, TXM_BAD_ARGUMENT, "job is NULL");
    if (job->level < 0) return txm_fail(env, TXM_BAD_ARGUMENT, "take a step before drawing");
    if (map < 0 || map >= job->setup.map_count)
        return txm_fail(env, TXM_BAD_ARGUMENT, "there is no such map");
    const txm_status status = txp_draw_begin(&job->setup, map, env, out, &d);
    if (status != TXM_OK) return status;
    d.job = job;
    d.x = x;
    d.y = y;
    if (x < 0 || y < 0 || x > job->setup.width - d.out.width ||
        y > job->setup.height - d.out.height)
        return txm_fail(env, TXM_BAD_ARGUMENT, "the window reaches beyond the output");
    return txp_draw_rows(&d, 0, env);
}

/* Run all steps that are left. */
static txm_status txp_run(texpatch_job *job, txm_env *env) {
    txm_status status = TXM_OK;
    for (int more = 1; more && status == TXM_OK;) status = texpatch_step(job, env, &more);
    return status;
}

TEXPATCH_API txm_status texpatch_make(const texpatch_desc *desc, txm_env *env,
                                      const txm_image *out) {
    texpatch_job *job = NULL;
    txp_draw draws[TEXPATCH_MAX_MAPS];
    txm_arena scratch;
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    txm_status status = texpatch_begin(desc, env, &job);
    if (status != TXM_OK) return status;
    const int maps = job->setup.map_count;
    txm_arena_init(&scratch, env);
    memset(draws, 0, sizeof draws);
    for (int m = 0; m < maps && status == TXM_OK; m++) {
        status = txp_draw_begin(&job->setup, m, env, out[m], &draws[m]);
        draws[m].job = job;
        if (status == TXM_OK && (out[m].width != desc->width || out[m].height != desc->height))
            status = txm_fail_at(env, TXM_BAD_ARGUMENT, "out", "must be width x height pixels");
    }
    if (status == TXM_OK) status = txp_run(job, env);
    /* drawn into scratch pictures, so that out is untouched if the caller cancels */
    for (int m = 0; m < maps && status == TXM_OK; m++) {
        const size_t row = txm_sample_bytes(out[m].sample) * (size_t)draws[m].out.channels;
        draws[m].out.stride = (ptrdiff_t)((size_t)desc->width * row);
        draws[m].out.pixels =
            txm_arena_alloc(&scratch, (size_t)desc->height, (size_t)desc->width * row);
        if (!draws[m].out.pixels)
            status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the picture");
        else status = txp_draw_rows(&draws[m], 1, env);
        if (status == TXM_OK && draws[m].has_alpha && !job->setup.kinds[m].is_label)
            status = txm_image_bleed(&draws[m].out, job->setup.tileable, env);
    }
    for (int m = 0; m < maps && status == TXM_OK; m++) {
        const txm_image to = txm_image_resolve(out[m]);
        for (int y = 0; y < desc->height; y++)
            memcpy(txm_image_row(&to, y), txm_image_row_const(&draws[m].out, y),
                   (size_t)draws[m].out.stride);
    }
    txm_arena_free(&scratch);
    texpatch_free(job);
    return status;
}

/* ---- a part made again ------------------------------------------------------------------ */

/* Is pixel (x, y) of the canvas in the part? The margin is where the border is. */
static inline int txp_is_in_part(const texpatch_job *job, const uint8_t *again, int x, int y) {
    x = txm_clampi(x - job->margin_x, 0, job->setup.width - 1);
    y = txm_clampi(y - job->margin_y, 0, job->setup.height - 1);
    return again[(size_t)y * (size_t)job->setup.width + (size_t)x] != 0;
}

/* One axis of the box around a part: with context, large enough for the coarsest level and in steps
   of its pixels; all of an axis that wraps if the context reaches over its end. */
static void txp_part_extent(int low, int high, int extent, int wraps, int level, int *from,
                            int *size) {
    const int context = 2 * TXP_WINDOW, room = 2 * TXP_WINDOW << level, unit = 1 << level;
    int a = low - context, b = high + context;
    if (wraps && (a < 0 || b > extent)) {
        *from = 0;
        *size = extent;
        return;
    }
    if (b - a < room) {
        a -= (room - (b - a)) / 2;
        b = a + room;
    }
    if (a < 0) {
        b = b - a < extent ? b - a : extent;
        a = 0;
    }
    if (b > extent) {
        a = a - (b - extent) > 0 ? a - (b - extent) : 0;
        b = extent;
    }
    a = a / unit * unit;
    *from = a;
    *size = b - a;
}

TEXPATCH_API txm_status texpatch_again(texpatch_job *job, const txm_image *again,
                                       const txm_image *guide, const txm_image *guide_mask,
                                       uint64_t seed, txm_env *env) {
    txm_status status;
    txm_arena memory, masks;
    uint8_t *mask, *counts;
    txp_given new_guide;
    txp_origins from;
    int low_x, low_y, high_x = -1, high_y = -1;
    int x0 = 0, y0 = 0, wide = 0, high = 0;
    if (!job || !again) return txm_fail(env, TXM_BAD_ARGUMENT, "job or again is NULL");
    const txp_source *s = job->source;
    const txp_setup *u = &job->setup;
    const size_t n = (size_t)s->bytes, all = (size_t)job->width * (size_t)job->height;
    const size_t tail = n - (size_t)s->guide_at;
    status = txm_mask_check(again, "again", u->width, u->height, TEXPATCH_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    if (guide) {
        if (!s->guide_bytes)
            return txm_fail(env, TXM_BAD_ARGUMENT, "the job was begun without a guide");
        status = txp_check_guide(guide, guide_mask, u, u->width, u->height, env);
        if (status != TXM_OK) return status;
    }
    status = txp_run(job, env);
    if (status != TXM_OK) return status;
    memset(&new_guide, 0, sizeof new_guide);
    txm_arena_init(&memory, env);
    txm_arena_init(&masks, env);
    texpatch_job *part = NULL;
    if (txp_read_mask(again, TXM_MASK_REPLACES, &masks, &mask, env) != TXM_OK ||
        txp_read_mask(guide ? guide_mask : NULL, TXM_MASK_ALLOWS, &masks, &counts, env) != TXM_OK)
        goto no_memory;

    low_x = job->width;
    low_y = job->height;
    for (int y = 0; y < job->height; y++) {
        for (int x = 0; x < job->width; x++) {
            if (!txp_is_in_part(job, mask, x, y)) continue;
            low_x = x < low_x ? x : low_x;
            high_x = x > high_x ? x : high_x;
            low_y = y < low_y ? y : low_y;
            high_y = y;
        }
    }
    if (guide) {
        txp_given_make(&new_guide, s, all, 0, 1, 0, &memory);
        if (memory.failed) goto no_memory;
        txm_image to = txm_image_resolve(*guide);
        status = txp_show(&to, 0, u->tileable, &memory, env);
        if (status != TXM_OK) {
            txm_arena_free(&memory);
            txm_arena_free(&masks);
            return status;
        }
        txp_guide_load(job, &to, counts, &new_guide);
    }
    if (high_x >= 0) {
        const int top = s->levels - 1;
        txm_arena own;
        txm_arena_init(&own, env);
        txp_part_extent(low_x, high_x + 1, job->width, u->tileable & TEXPATCH_TILE_X, top, &x0,
                        &wide);
        txp_part_extent(low_y, high_y + 1, job->height, u->tileable & TEXPATCH_TILE_Y, top, &y0,
                        &high);
        part =
            txp_job_make(u, job->source, wide, high, txm_hash(seed ^ (job->seed + 1)), &own, env);
        if (part)
            txp_given_make(&part->given, s, (size_t)wide * (size_t)high, 1, s->guide_bytes > 0, 1,
                           &own);
        if (own.failed) {
            txm_arena_free(&own);
            goto no_memory;
        }
        part->memory = own;
    }

    /* from here on nothing can fail */
    for (size_t i = 0; i < all && guide; i++) {
        uint8_t *shown = job->canvas.pixels + i / (size_t)job->width * job->canvas.pitch +
                         i % (size_t)job->width * n;
        const txp_place at = job->canvas.at[i];
        memcpy(job->given.pixels + i * n + s->guide_at, new_guide.pixels + i * n + s->guide_at,
               tail);
        job->given.free_guide[i] = new_guide.free_guide[i];
        job->canvas.free_guide[i] = new_guide.free_guide[i];
        if (!new_guide.free_guide[i])
            memcpy(shown + s->guide_at, new_guide.pixels + i * n + s->guide_at, tail);
        else if (at.x >= 0)
            memcpy(shown + s->guide_at, txp_stack_at(s, &s->stack[0], at.x, at.y) + s->guide_at,
                   tail);
    }
    txm_arena_free(&memory);
    if (!part) {
        txm_arena_free(&masks);
        return TXM_OK;
    }
    part->setup.tileable = 0;
    if (wide == job->width) part->setup.tileable |= u->tileable & TEXPATCH_TILE_X;
    if (high == job->height) part->setup.tileable |= u->tileable & TEXPATCH_TILE_Y;
    part->shift_x = job->shift_x + x0;
    part->shift_y = job->shift_y + y0;
    from = txp_origins_of(job);
    for (int y = 0; y < high; y++) {
        for (int x = 0; x < wide; x++) {
            const size_t i = (size_t)y * (size_t)wide + (size_t)x;
            const size_t k = txp_index(&job->canvas, x0 + x, y0 + y);
            part->given.fixed[i] = !txp_is_in_part(job, mask, x0 + x, y0 + y) ||
                                   (job->given.fixed && job->given.fixed[k]);
            memcpy(part->given.pixels + i * n, txp_canvas_at(s, &job->canvas, x0 + x, y0 + y), n);
            if (part->given.free_guide) part->given.free_guide[i] = job->given.free_guide[k];
            txp_copy_origins(&part->given.from, i, &from, k, 1, s->tones);
        }
    }
    job->part = part;
    job->part_x = x0;
    job->part_y = y0;
    txm_arena_free(&masks);
    return TXM_OK;
no_memory:
    txm_arena_free(&masks);
    txm_arena_free(&memory);
    return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a part");
}

/* ---- the unbounded plane ---------------------------------------------------------------- */

/* An environment for calls that do one piece of the work each: they report the progress of the
   whole, in pieces. */
typedef struct txp_nested {
    txm_env *env;
    float done, total; /* pieces */
} txp_nested;

static int txp_nested_progress(void *user, float fraction, const char *stage) {
    const txp_nested *q = (const txp_nested *)user;
    (void)fraction;
    return txm_progress(q->env, q->done / q->total, stage);
}

static txm_env txp_nested_env(txp_nested *q) {
    txm_env env;
    memset(&env, 0, sizeof env);
    if (q->env) env = *q->env;
    env.progress = txp_nested_progress;
    env.progress_user = q;
    return env;
}

struct texpatch_plane {
    txm_arena memory; /* of the plane, which lies in it */
    txm_arena source_memory;
    txp_setup setup;
    txp_source *source;
    int cell,
        half; /* pixels: side of a cell; half the width of the strips along its sides */
    double shift_x, shift_y;
    uint64_t seed;
};

/* A finished rectangle of the plane: a corner or a side of cells. */
typedef struct txp_piece {
    int width, height; /* 0: not made yet */
    txp_origins from;
    txm_arena memory;
} txp_piece;

static void txp_piece_free(txp_piece *p) {
    txm_arena_free(&p->memory);
    p->width = p->height = 0;
}

/* A job for the width x height pixels of the plane at (x, y). */
static txm_status txp_plane_job(const texpatch_plane *plane, int64_t x, int64_t y, int width,
                                int height, uint64_t seed, txm_env *env, texpatch_job **out) {
    txm_arena memory;
    const txp_source *s = plane->source;
    double sx = (double)x + plane->shift_x, sy = (double)y + plane->shift_y;
    txm_arena_init(&memory, env);
    texpatch_job *job =
        txp_job_make(&plane->setup, plane->source, width, height, seed, &memory, env);
    if (job) txp_given_make(&job->given, s, (size_t)width * (size_t)height, 1, 0, 1, &memory);
    if (memory.failed) {
        txm_arena_free(&memory);
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a piece of the plane");
    }
    job->memory = memory;
    job->setup.width = width;
    job->setup.height = height;
    if (s->has_lattice) { /* less whole steps of the lattice */
        const double *i = s->stack[0].inverse, *l = s->stack[0].lattice;
        const double u = i[0] * sx + i[1] * sy, v = i[2] * sx + i[3] * sy;
        const int courses = s->courses.count ? s->courses.cycle : 1;
        const double part = v - courses * floor(v / courses);
        sx = l[0] * (u - floor(u)) + l[2] * part;
        sy = l[1] * (u - floor(u)) + l[3] * part;
    }
    job->shift_x = sx;
    job->shift_y = sy;
    *out = job;
    return TXM_OK;
}

/* Fix a piece on the canvas of a job, its top left pixel at (x, y); it may reach beyond that. */
static void txp_plane_fix(texpatch_job *job, const txp_piece *p, int x, int y) {
    const txp_source *s = job->source;
    const size_t n = (size_t)s->bytes;
    for (int v = 0; v < p->height; v++) {
        for (int u = 0; u < p->width; u++) {
            const int cx = x + u, cy = y + v;
            if (cx < 0 || cy < 0 || cx >= job->width || cy >= job->height) continue;
            const size_t i = (size_t)cy * (size_t)job->width + (size_t)cx;
            const size_t k = (size_t)v * (size_t)p->width + (size_t)u;
            job->given.fixed[i] = 1;
            txp_copy_origins(&job->given.from, i, &p->from, k, 1, s->tones);
            const txp_place at = p->from.at[k];
            memcpy(job->given.pixels + i * n, txp_stack_at(s, &s->stack[0], at.x, at.y), n);
        }
    }
}

/* Run a job and keep the width x height pixels at (x, y) of it as a piece. Frees the job. */
static txm_status txp_plane_run(texpatch_job *job, int x, int y, int width, int height,
                                txp_piece *p, txm_env *env) {
    const int tones = job->source->tones;
    const size_t pixels = (size_t)width * (size_t)height;
    txm_status status = txp_run(job, env);
    txm_arena_init(&p->memory, env);
    if (status == TXM_OK) {
        txp_origins *o = &p->from;
        o->at = (txp_place *)txm_arena_alloc(&p->memory, pixels, sizeof *o->at);
        o->bend = (int16_t *)txm_arena_alloc(&p->memory, pixels, 2 * sizeof *o->bend);
        o->tone = (int16_t *)txm_arena_alloc(&p->memory, pixels, (size_t)tones * sizeof *o->tone);
        if (p->memory.failed)
            status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a piece of the plane");
    }
    const txp_origins from = txp_origins_of(job);
    for (int v = 0; v < height && status == TXM_OK; v++)
        txp_copy_origins(&p->from, (size_t)v * (size_t)width, &from,
                         txp_index(&job->canvas, x, y + v), (size_t)width, tones);
    texpatch_free(job);
    if (status != TXM_OK) {
        txp_piece_free(p);
        return status;
    }
    p->width = width;
    p->height = height;
    return TXM_OK;
}

/* The pieces on the corners and sides of a row of cells, of all columns that a window touches. */
typedef struct txp_cells {
    const texpatch_plane *plane;
    int64_t first; /* column                                                   */
    int columns;
    txp_piece *corner[2], *side[2]; /* columns + 1 corners, columns sides: above, below          */
    txp_piece *vertical;             /* columns + 1 sides between above and below                 */
} txp_cells;

static uint64_t txp_plane_seed(const texpatch_plane *plane, int64_t column, int64_t row, int kind) {
    return txm_hash(txm_hash(txm_hash(plane->seed + (uint64_t)kind) ^ (uint64_t)column) +
                    (uint64_t)row * 0x9e3779b97f4a7c15u);
}

/* The corner (column, row): made with a margin around it that is discarded. */
static txm_status txp_plane_corner(const texpatch_plane *plane, int64_t column, int64_t row,
                                   txp_piece *p, txm_env *env) {
    const int h = plane->half, c = plane->cell;
    texpatch_job *job;
    txm_status status = txp_plane_job(plane, column * c - 2 * h, row * c - 2 * h, 4 * h, 4 * h,
                                      txp_plane_seed(plane, column, row, 1), env, &job);
    return status == TXM_OK ? txp_plane_run(job, h, h, 2 * h, 2 * h, p, env) : status;
}

/* The side from corner a to corner b, to the right or down. */
static txm_status txp_plane_side(const texpatch_plane *plane, int64_t column, int64_t row, int down,
                                 const txp_piece *a, const txp_piece *b, txp_piece *p,
                                 txm_env *env) {
    const int h = plane->half, c = plane->cell;
    texpatch_job *job;
    txm_status status =
        txp_plane_job(plane, column * c - (down ? 2 * h : h), row * c - (down ? h : 2 * h),
                      down ? 4 * h : c + 2 * h, down ? c + 2 * h : 4 * h,
                      txp_plane_seed(plane, column, row, 2 + down), env, &job);
    if (status != TXM_OK) return status;
    txp_plane_fix(job, a, down ? h : 0, down ? 0 : h);
    txp_plane_fix(job, b, down ? h : c, down ? c : h);
    return txp_plane_run(job, h, h, down ? 2 * h : c, down ? c : 2 * h, p, env);
}

/* The finished job of a cell: its pixel (0, 0) lies at (half, half) of the canvas. */
static txm_status txp_plane_cell_job(const txp_cells *cells, int column, int64_t row, txm_env *env,
                                     texpatch_job **out) {
    const texpatch_plane *plane = cells->plane;
    const int h = plane->half, c = plane->cell;
    const int64_t at = cells->first + column;
    texpatch_job *job;
    txm_status status = txp_plane_job(plane, at * c - h, row * c - h, c + 2 * h, c + 2 * h,
                                      txp_plane_seed(plane, at, row, 4), env, &job);
    if (status != TXM_OK) return status;
    for (int k = 0; k < 2; k++) {
        txp_plane_fix(job, &cells->side[k][column], h, k * c);
        txp_plane_fix(job, &cells->vertical[column + k], k * c, h);
        for (int d = 0; d < 2; d++)
            txp_plane_fix(job, &cells->corner[k][column + d], d * c, k * c);
    }
    status = txp_run(job, env);
    if (status == TXM_OK) *out = job;
    else texpatch_free(job);
    return status;
}

/* Make the corners and sides of a row of cells that are not there yet. */
static txm_status txp_plane_row(const txp_cells *cells, int64_t row, txm_env *env) {
    const texpatch_plane *plane = cells->plane;
    txm_status status = TXM_OK;
    for (int below = 0; below < 2; below++) {
        for (int i = 0; i <= cells->columns && status == TXM_OK; i++) {
            if (!cells->corner[below][i].width)
                status = txp_plane_corner(plane, cells->first + i, row + below,
                                          &cells->corner[below][i], env);
        }
        for (int i = 0; i < cells->columns && status == TXM_OK; i++) {
            if (!cells->side[below][i].width)
                status = txp_plane_side(plane, cells->first + i, row + below, 0,
                                        &cells->corner[below][i], &cells->corner[below][i + 1],
                                        &cells->side[below][i], env);
        }
    }
    for (int i = 0; i <= cells->columns && status == TXM_OK; i++)
        status = txp_plane_side(plane, cells->first + i, row, 1, &cells->corner[0][i],
                                &cells->corner[1][i], &cells->vertical[i], env);
    return status;
}

/* Go to the next row of cells: what is below this row is above that. */
static void txp_plane_next_row(const txp_cells *cells) {
    for (int i = 0; i <= cells->columns; i++) {
        txp_piece_free(&cells->vertical[i]);
        txp_piece_free(&cells->corner[0][i]);
        cells->corner[0][i] = cells->corner[1][i];
        memset(&cells->corner[1][i], 0, sizeof(txp_piece));
        if (i == cells->columns) continue;
        txp_piece_free(&cells->side[0][i]);
        cells->side[0][i] = cells->side[1][i];
        memset(&cells->side[1][i], 0, sizeof(txp_piece));
    }
}

static int64_t txp_floor_div(int64_t a, int64_t b) {
    return a >= 0 ? a / b : -((b - 1 - a) / b);
}

TEXPATCH_API txm_status texpatch_plane_make(const texpatch_desc *desc, txm_env *env,
                                            texpatch_plane **out) {
    txp_setup setup;
    txp_source source, *s;
    txm_arena memory, source_memory;
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    if (!desc) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL; pass a texpatch_desc");
    texpatch_desc plain = *desc;
    texpatch_exemplar exemplars[TEXPATCH_MAX_EXEMPLARS];
    if (desc->exemplars && desc->exemplar_count > 0 &&
        desc->exemplar_count <= TEXPATCH_MAX_EXEMPLARS) {
        for (int i = 0; i < desc->exemplar_count; i++) {
            exemplars[i] = desc->exemplars[i];
            memset(&exemplars[i].guide, 0, sizeof exemplars[i].guide);
        }
        plain.exemplars = exemplars;
    }
    txm_status status = txp_check_exemplars(&plain, &setup, &source, env);
    if (status != TXM_OK) return status;
    txm_arena_init(&memory, env);
    status = txp_show_all(&setup, &memory, env);
    if (status == TXM_OK) status = txp_source_make(&setup, &source, &s, &source_memory, env);
    if (status != TXM_OK) {
        txm_arena_free(&memory);
        return status;
    }
    texpatch_plane *plane = (texpatch_plane *)txm_arena_zero(&memory, 1, sizeof *plane);
    if (!plane) {
        txm_arena_free(&source_memory);
        txm_arena_free(&memory);
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a plane");
    }
    plane->setup = setup;
    plane->source = s;
    plane->half = TXP_WINDOW / 2 << (s->levels - 1);
    plane->cell = 16 * plane->half;
    plane->seed = desc->seed;
    txp_lattice_start(s, desc->seed, &plane->shift_x, &plane->shift_y);
    plane->memory = memory;
    plane->source_memory = source_memory;
    *out = plane;
    return TXM_OK;
}

TEXPATCH_API int texpatch_plane_cell(const texpatch_plane *plane) {
    return plane ? plane->cell : 0;
}

TEXPATCH_API void texpatch_plane_free(texpatch_plane *plane) {
    if (!plane) return;
    txm_arena_free(&plane->source_memory);
    txm_arena_free(&plane->memory); /* the plane lies in it */
}

/* Draw a part of a map of a finished cell. What is hidden in it is bled from the whole canvas of the
   cell, so that all windows show the same.
   d     the map, with the part's place on the canvas
   to    the part, in the window                                                              */
static txm_status txp_plane_draw_map(const txp_draw *d, const txm_image *to, txm_env *env) {
    const texpatch_job *job = d->job;
    txp_draw part = *d, all = *d;
    txm_arena scratch;
    part.out = *to;
    txm_status status = txp_draw_rows(&part, 1, env);
    if (status != TXM_OK || !d->has_alpha || job->setup.kinds[d->map].is_label ||
        !txm_image_has_hidden(to))
        return status;
    txm_arena_init(&scratch, env);
    const size_t pixel = (size_t)to->channels * txm_sample_bytes(to->sample);
    all.x = all.y = 0;
    all.out.width = job->width;
    all.out.height = job->height;
    all.out.stride = (ptrdiff_t)((size_t)job->width * pixel);
    all.out.pixels = txm_arena_alloc(&scratch, (size_t)job->height, (size_t)job->width * pixel);
    if (!all.out.pixels) status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a cell of the plane");
    if (status == TXM_OK) status = txp_draw_rows(&all, 1, env);
    if (status == TXM_OK) status = txm_image_bleed(&all.out, 0, env);
    for (int y = 0; y < to->height && status == TXM_OK; y++)
        memcpy(txm_image_row(to, y),
               (const char *)txm_image_row_const(&all.out, d->y + y) + (size_t)d->x * pixel,
               (size_t)to->width * pixel);
    txm_arena_free(&scratch);
    return status;
}

/* Draw the part of a window on a finished cell, whose pixel (0, 0) is at (cx, cy) of the window. */
static txm_status txp_plane_draw_cell(const texpatch_job *job, int half, int cell, int64_t cx,
                                      int64_t cy, int width, int height, const txm_image *out,
                                      texpatch_source *sources, txm_env *env) {
    const int x0 = cx < 0 ? 0 : (int)cx, y0 = cy < 0 ? 0 : (int)cy;
    const int x1 = cx + cell < width ? (int)(cx + cell) : width;
    const int y1 = cy + cell < height ? (int)(cy + cell) : height;
    const int sx = x0 - (int)cx + half, sy = y0 - (int)cy + half;
    for (int m = 0; m < job->setup.map_count; m++) {
        txp_draw d;
        txm_image to = txm_image_resolve(out[m]);
        to.pixels = (uint8_t *)txm_image_row(&to, y0) +
                    (size_t)x0 * (size_t)to.channels * txm_sample_bytes(to.sample);
        to.width = x1 - x0;
        to.height = y1 - y0;
        txm_status status = txp_draw_begin(&job->setup, m, env, to, &d);
        d.job = job;
        d.x = sx;
        d.y = sy;
        if (status == TXM_OK) status = txp_plane_draw_map(&d, &to, env);
        if (status != TXM_OK) return status;
    }
    for (int y = y0; y < y1 && sources; y++) {
        for (int x = x0; x < x1; x++)
            sources[(size_t)y * (size_t)width + (size_t)x] =
                texpatch_source_at(job, sx + x - x0, sy + y - y0);
    }
    return TXM_OK;
}

TEXPATCH_API txm_status texpatch_plane_draw(const texpatch_plane *plane, int64_t x, int64_t y,
                                            txm_env *env, const txm_image *out,
                                            texpatch_source *sources) {
    const int64_t far_away = (int64_t)1 << 40;
    txm_status status = TXM_OK;
    txm_arena scratch;
    txp_cells cells;
    txp_draw d;
    if (!plane || !out) return txm_fail(env, TXM_BAD_ARGUMENT, "plane or out is NULL");
    if (x < -far_away || y < -far_away || x > far_away || y > far_away)
        return txm_fail(env, TXM_BAD_ARGUMENT, "x and y must be -2^40 to 2^40");
    for (int m = 0; m < plane->setup.map_count; m++) {
        status = txp_draw_begin(&plane->setup, m, env, out[m], &d);
        if (status != TXM_OK) return status;
        if (out[m].width != out[0].width || out[m].height != out[0].height)
            return txm_fail_at(env, TXM_BAD_ARGUMENT, "out", "must be pictures of one size");
    }
    const int width = out[0].width, height = out[0].height, cell = plane->cell;
    const int64_t top = txp_floor_div(y, cell), bottom = txp_floor_div(y + height - 1, cell);
    memset(&cells, 0, sizeof cells);
    cells.plane = plane;
    cells.first = txp_floor_div(x, cell);
    cells.columns = (int)(txp_floor_div(x + width - 1, cell) - cells.first) + 1;
    txm_arena_init(&scratch, env);
    txp_piece *pieces =
        (txp_piece *)txm_arena_zero(&scratch, (size_t)cells.columns + 1, 5 * sizeof *pieces);
    if (!pieces) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a window of the plane");
    for (int k = 0; k < 2; k++) {
        cells.corner[k] = pieces + k * (cells.columns + 1);
        cells.side[k] = pieces + (2 + k) * (cells.columns + 1);
    }
    cells.vertical = pieces + 4 * (cells.columns + 1);
    txm_env nested; /* reports progress in cells, not in the steps of each */
    txp_nested cells_done;
    cells_done.env = env;
    cells_done.total = (float)(bottom - top + 1) * (float)cells.columns;
    cells_done.done = 0;
    nested = txp_nested_env(&cells_done);
    for (int64_t row = top; row <= bottom && status == TXM_OK; row++) {
        status = txp_plane_row(&cells, row, &nested);
        for (int i = 0; i < cells.columns && status == TXM_OK; i++) {
            texpatch_job *job = NULL;
            status = txp_plane_cell_job(&cells, i, row, &nested, &job);
            if (status == TXM_OK)
                status = txp_plane_draw_cell(job, plane->half, cell, (cells.first + i) * cell - x,
                                             row * cell - y, width, height, out, sources, &nested);
            texpatch_free(job);
            cells_done.done += 1;
        }
        if (status == TXM_OK) txp_plane_next_row(&cells);
    }
    for (int i = 0; i < 5 * (cells.columns + 1); i++) txp_piece_free(&pieces[i]);
    txm_arena_free(&scratch);
    if (status != TXM_OK && env) memcpy(env->message, nested.message, sizeof nested.message);
    return status;
}

/* ---- levels of detail ------------------------------------------------------------------- */

TEXPATCH_API txm_status texpatch_half(const txm_image *image, const texpatch_map *map, int tileable,
                                      txm_env *env, const txm_image *half) {
    txm_content content = TXM_COLOR;
    if (!image || !half) return txm_fail(env, TXM_BAD_ARGUMENT, "image or half is NULL");
    txm_status status = txm_image_check(image, "image", TEXPATCH_MAX_PIXELS, env);
    if (status == TXM_OK) status = txm_image_check(half, "half", TEXPATCH_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    if (tileable < 0 || tileable > 3)
        return txm_fail(env, TXM_BAD_ARGUMENT, "tileable must be a sum of TEXPATCH_TILE_X and _Y");
    if (map && map->is_label) content = TXM_LABELS;
    else if (map && map->is_normal) content = TXM_NORMALS;
    else if (map && map->is_data) content = TXM_DATA;
    return txm_image_halve(image, content, tileable, half, env);
}

/* ---- evened pictures ----------------------------------------------------------------------- */

/* In uneven light the slow part of a photograph is louder than its pattern. A pattern is looked for
   in gray pictures of which at each place the mean of the surroundings is 0 and the deviation 1. */

/* ours, see docs/choices.md */
enum {
    TXP_FINEST = 2600,  /* pixels of the longer side of the largest picture that is searched */
    TXP_COARSEST = 200, /* the same of the smallest one                                      */
    TXP_SIZES = 5,      /* pictures, each half as large as the one before, at most           */
    TXP_EVEN_PART = 8,  /* surroundings reach this part of the longer side ...               */
    TXP_EVEN_MOST = 64  /* ... but not more pixels than this                                 */
};
#define TXP_EVEN_FAINT 0.3 /* of the mean deviation: fainter surroundings are not raised further  */

/* A gray picture. */
typedef struct txp_gray {
    int width, height;
    float *at;    /* evened: 0 where nothing is known                          */
    float *known; /* 0..1: how much of the pixel is visible and not masked     */
} txp_gray;

/* How a photograph is reduced to its first gray picture. */
typedef struct txp_graying {
    const txm_image *image, *mask; /* mask without pixels: none */
    txp_gray *gray;
    int shrink; /* blocks of shrink x shrink pixels become one */
} txp_graying;

/* How much a pixel counts, 0..1. */
static inline double txp_visible(const txm_image *im, const txm_image *mask, int x, int y) {
    if (mask->pixels && !txm_mask_at(mask, x, y)) return 0;
    if (im->channels == 2 || im->channels == 4)
        return (double)txm_clampf(txm_image_get(im, x, y, im->channels - 1), 0, 1);
    return 1;
}

static void txp_gray_row(void *context, int row) {
    const txp_graying *g = (const txp_graying *)context;
    const txm_image *im = g->image;
    const int colours = im->channels < 3 ? 1 : 3, n = g->shrink;
    for (int column = 0; column < g->gray->width; column++) {
        double sum = 0, known = 0;
        int count = 0;
        for (int y = row * n; y < row * n + n && y < im->height; y++) {
            for (int x = column * n; x < column * n + n && x < im->width; x++, count++) {
                const double weight = txp_visible(im, g->mask, x, y);
                double value = 0;
                for (int c = 0; c < colours; c++) value += (double)txm_image_get(im, x, y, c);
                sum += weight * value;
                known += weight;
            }
        }
        const size_t at = (size_t)row * (size_t)g->gray->width + (size_t)column;
        g->gray->at[at] = known > 0 ? txm_float(sum / known) : 0;
        g->gray->known[at] = txm_float(known / count);
    }
}

static int txp_gray_new(txp_gray *g, int width, int height, txm_arena *arena) {
    const size_t count = (size_t)width * (size_t)height;
    g->width = width;
    g->height = height;
    g->at = (float *)txm_arena_alloc(arena, count, sizeof *g->at);
    g->known = (float *)txm_arena_alloc(arena, count, sizeof *g->known);
    return !arena->failed;
}

/* The next smaller picture; to: (width + 1) / 2 x (height + 1) / 2. */
static void txp_gray_halve(const txp_gray *from, txp_gray *to) {
    for (int y = 0; y < to->height; y++) {
        for (int x = 0; x < to->width; x++) {
            double sum = 0, known = 0;
            int count = 0;
            for (int v = 2 * y; v < 2 * y + 2 && v < from->height; v++) {
                for (int u = 2 * x; u < 2 * x + 2 && u < from->width; u++, count++) {
                    const size_t at = (size_t)v * (size_t)from->width + (size_t)u;
                    sum += (double)from->known[at] * (double)from->at[at];
                    known += (double)from->known[at];
                }
            }
            const size_t at = (size_t)y * (size_t)to->width + (size_t)x;
            to->at[at] = known > 0 ? txm_float(sum / known) : 0;
            to->known[at] = txm_float(known / count);
        }
    }
}

/* ---- means of surroundings ----------------------------------------------------------------- */

/* Sums over (2 reach + 1) x (2 reach + 1) pixels, cut off at the border, in place; sums: room for
   width numbers, copy: for width * height. */
static void txp_box_sums(float *at, int width, int height, int reach, double *sums, float *copy) {
    const size_t w = (size_t)width;
    for (int y = 0; y < height; y++) {
        const float *row = at + (size_t)y * w;
        double sum = 0;
        for (int x = 0; x < reach && x < width; x++) sum += (double)row[x];
        for (int x = 0; x < width; x++) {
            if (x + reach < width) sum += (double)row[x + reach];
            if (x - reach - 1 >= 0) sum -= (double)row[x - reach - 1];
            copy[(size_t)y * w + (size_t)x] = txm_float(sum);
        }
    }
    for (size_t x = 0; x < w; x++) sums[x] = 0;
    for (int y = 0; y < reach && y < height; y++)
        for (size_t x = 0; x < w; x++) sums[x] += (double)copy[(size_t)y * w + x];
    for (int y = 0; y < height; y++) {
        if (y + reach < height)
            for (size_t x = 0; x < w; x++) sums[x] += (double)copy[(size_t)(y + reach) * w + x];
        if (y - reach - 1 >= 0)
            for (size_t x = 0; x < w; x++) sums[x] -= (double)copy[(size_t)(y - reach - 1) * w + x];
        for (size_t x = 0; x < w; x++) at[(size_t)y * w + x] = txm_float(sums[x]);
    }
}

/* An evened copy of a gray picture: means over 2 reach + 1 pixels taken out. 0: no memory. */
static int txp_even(const txp_gray *from, int reach, txm_arena *arena, txm_env *env, txp_gray *to) {
    const size_t count = (size_t)from->width * (size_t)from->height;
    txm_arena scratch;
    txm_arena_init(&scratch, env);
    float *copy = (float *)txm_arena_alloc(&scratch, count, sizeof *copy);
    float *weight = (float *)txm_arena_alloc(&scratch, count, sizeof *weight);
    float *square = (float *)txm_arena_alloc(&scratch, count, sizeof *square);
    double *sums = (double *)txm_arena_alloc(&scratch, (size_t)from->width, sizeof *sums);
    if (!txp_gray_new(to, from->width, from->height, arena) || scratch.failed) {
        txm_arena_free(&scratch);
        return 0;
    }
    memcpy(to->known, from->known, count * sizeof *to->known);
    memcpy(weight, from->known, count * sizeof *weight);
    for (size_t i = 0; i < count; i++) to->at[i] = from->at[i] * from->known[i];
    txp_box_sums(weight, from->width, from->height, reach, sums, copy);
    txp_box_sums(to->at, from->width, from->height, reach, sums, copy);
    double all = 0, seen = 0;
    for (size_t i = 0; i < count; i++) {
        const double mean = weight[i] > 1e-3f ? (double)to->at[i] / (double)weight[i] : 0;
        to->at[i] = txm_float((double)from->known[i] * ((double)from->at[i] - mean));
        square[i] = txm_float((double)to->at[i] * (double)to->at[i]);
        all += (double)square[i];
        seen += (double)from->known[i];
    }
    txp_box_sums(square, from->width, from->height, reach, sums, copy);
    const double faint = seen > 0 ? TXP_EVEN_FAINT * sqrt(all / seen) : 0;
    for (size_t i = 0; i < count; i++) {
        const double mean = weight[i] > 1e-3f ? (double)square[i] / (double)weight[i] : 0;
        const double deviation = sqrt(mean > 0 ? mean : 0) + faint;
        to->at[i] = deviation > 0 ? txm_float((double)to->at[i] / deviation) : 0;
    }
    txm_arena_free(&scratch);
    return 1;
}

/* The evened pictures of a photograph, largest first. Returns their number; 0: no memory. */
static int txp_evened_sizes(const txm_image *image, const txm_image *mask, txm_arena *arena,
                            txm_env *env, txp_gray *sizes) {
    txp_graying g;
    txp_gray gray[TXP_SIZES];
    txm_arena scratch;
    const int longer = image->width > image->height ? image->width : image->height;
    int count = 0;
    txm_arena_init(&scratch, env);
    g.image = image;
    g.mask = mask;
    g.gray = &gray[0];
    g.shrink = (longer + TXP_FINEST - 1) / TXP_FINEST;
    int w = (image->width + g.shrink - 1) / g.shrink, h = (image->height + g.shrink - 1) / g.shrink;
    while (count < TXP_SIZES && (!count || (w > h ? w : h) >= TXP_COARSEST)) {
        if (!txp_gray_new(&gray[count], w, h, &scratch)) break;
        if (count) txp_gray_halve(&gray[count - 1], &gray[count]);
        else txm_parallel_for(env, h, txp_gray_row, &g);
        const int reach = (w > h ? w : h) / TXP_EVEN_PART;
        if (!txp_even(&gray[count], txm_clampi(reach, 4, TXP_EVEN_MOST), arena, env, &sizes[count]))
            break;
        count++;
        w = (w + 1) / 2;
        h = (h + 1) / 2;
    }
    if (scratch.failed || arena->failed) count = 0;
    txm_arena_free(&scratch);
    return count;
}

/* ---- local spectra of a photograph -------------------------------------------------------- */

/* A photographed lattice has, seen through a small window, a spectrum of a few peaks, whose places
   change slowly from window to window. What this part makes of a photograph: gray pictures of
   several sizes, evened, and of each the spectra of windows spread over it. */

/* ours, see docs/choices.md */
enum {
    TXP_WINDOWS = 9,      /* windows side by side, at most; half of each lies in the next one     */
    TXP_WINDOW_SIDE = 128, /* pixels; 64 where the picture is smaller                             */
    TXP_TIPS = 6          /* peaks of a spectrum that are looked at                               */
};
#define TXP_WEAK 0.1        /* of the strongest frequency: weaker ones are not raised further     */
#define TXP_LEAST_WAVES 2.5 /* in a window: the lowest frequency that is looked at                */

/* A place in a photograph: pixels from its middle, in halves of its longer side. */
typedef struct txp_spot {
    double x, y;
} txp_spot;

/* The spectra of the windows of one gray picture, as magnitudes over the mean of their frequency:
   side x (side / 2 + 1) of each, kx from -side / 2, ky from 0. */
typedef struct txp_spectra {
    const txp_gray *gray;
    int side, across, down;
    double half;       /* half of the longer side of the gray picture, in its pixels              */
    float *at;         /* across * down spectra                                                   */
    txp_spot *middles; /* of the windows                                                          */
    double (*tips)[TXP_TIPS][2]; /* the highest peaks: cycles per half side; 0, 0: none           */
} txp_spectra;

static inline size_t txp_spectrum_size(int side) {
    return (size_t)side * (size_t)(side / 2 + 1);
}

/* ---- the Fourier transform ----------------------------------------------------------------- */

typedef struct txp_complex {
    double re, im;
} txp_complex;

/* In place, count a power of two; turns: the first half of the unit circle, clockwise; step: from
   one value to the next. */
static void txp_fourier(txp_complex *v, int count, int step, const txp_complex *turns) {
    for (int i = 1, j = 0; i < count; i++) {
        int bit = count / 2;
        for (; j & bit; bit /= 2) j ^= bit;
        j ^= bit;
        if (i < j) {
            const txp_complex t = v[i * step];
            v[i * step] = v[j * step];
            v[j * step] = t;
        }
    }
    for (int size = 2; size <= count; size *= 2) {
        for (int first = 0; first < count; first += size) {
            for (int k = 0; k < size / 2; k++) {
                const txp_complex w = turns[k * (count / size)];
                txp_complex *a = v + (first + k) * step, *b = v + (first + k + size / 2) * step;
                const double re = b->re * w.re - b->im * w.im, im = b->re * w.im + b->im * w.re;
                b->re = a->re - re;
                b->im = a->im - im;
                a->re += re;
                a->im += im;
            }
        }
    }
}

/* What the windows of a picture need, prepared once. */
typedef struct txp_spectra_work {
    txp_spectra *spectra;
    txp_complex turns[TXP_WINDOW_SIDE / 2];
    double bell[TXP_WINDOW_SIDE]; /* Hann's window                                               */
    txp_complex *room;            /* side * side for each pair of windows                        */
} txp_spectra_work;

/* The first pixel of window i of count over length pixels. */
static int txp_window_start(int length, int side, int count, int i) {
    return count > 1 ? (int)((int64_t)(length - side) * i / (count - 1)) : (length - side) / 2;
}

/* Two windows at once: one is the real part, the other the imaginary one. */
static void txp_window_pair(void *context, int pair) {
    txp_spectra_work *w = (txp_spectra_work *)context;
    txp_spectra *s = w->spectra;
    const int n = s->side, count = s->across * s->down;
    txp_complex *v = w->room + (size_t)pair * (size_t)n * (size_t)n;
    memset(v, 0, (size_t)n * (size_t)n * sizeof *v);
    for (int part = 0; part < 2 && 2 * pair + part < count; part++) {
        const int i = 2 * pair + part;
        const int x0 = txp_window_start(s->gray->width, n, s->across, i % s->across);
        const int y0 = txp_window_start(s->gray->height, n, s->down, i / s->across);
        s->middles[i].x = (x0 + 0.5 * n - 0.5 * s->gray->width) / s->half;
        s->middles[i].y = (y0 + 0.5 * n - 0.5 * s->gray->height) / s->half;
        for (int y = 0; y < n; y++) {
            const float *row = s->gray->at + (size_t)(y0 + y) * (size_t)s->gray->width + x0;
            for (int x = 0; x < n; x++) {
                const double value = (double)row[x] * w->bell[x] * w->bell[y];
                if (part) v[y * n + x].im = value;
                else v[y * n + x].re = value;
            }
        }
    }
    for (int y = 0; y < n; y++) txp_fourier(v + y * n, n, 1, w->turns);
    for (int x = 0; x < n; x++) txp_fourier(v + x, n, n, w->turns);
    for (int part = 0; part < 2 && 2 * pair + part < count; part++) {
        float *to = s->at + (size_t)(2 * pair + part) * txp_spectrum_size(n);
        for (int ky = 0; ky <= n / 2; ky++) {
            for (int kx = -n / 2; kx < n / 2; kx++) {
                const txp_complex a = v[(ky & (n - 1)) * n + (kx & (n - 1))];
                const txp_complex b = v[(-ky & (n - 1)) * n + (-kx & (n - 1))];
                const double re = part ? a.im + b.im : a.re + b.re;
                const double im = part ? b.re - a.re : a.im - b.im;
                to[ky * n + kx + n / 2] = txm_float(0.5 * sqrt(re * re + im * im));
            }
        }
    }
}

/* Divide all spectra by the mean of their frequency over all windows, so that noise of every colour
   is about 1 where there is much of it. */
static void txp_whiten(txp_spectra *s) {
    double mean[TXP_WINDOW_SIDE] = {0}, most = 0;
    int64_t count[TXP_WINDOW_SIDE] = {0};
    const int n = s->side, windows = s->across * s->down;
    for (int pass = 0; pass < 2; pass++) {
        float *at = s->at;
        for (int i = 0; i < windows; i++) {
            for (int ky = 0; ky <= n / 2; ky++) {
                for (int kx = -n / 2; kx < n / 2; kx++, at++) {
                    const int r = (int)(sqrt((double)(kx * kx + ky * ky)) + 0.5);
                    if (pass) {
                        *at = r && most > 0 ? txm_float((double)*at / mean[r]) : 0;
                    } else {
                        mean[r] += (double)*at;
                        count[r]++;
                    }
                }
            }
        }
        for (int r = 1; r < n && !pass; r++) {
            if (count[r]) mean[r] /= (double)count[r];
            most = fmax(most, mean[r]);
        }
        for (int r = 1; r < n && !pass; r++) mean[r] += TXP_WEAK * most;
    }
}

/* Magnitude of window i at a frequency in cycles per half side; 0 beyond what it can show. */
static inline double txp_spectrum_at(const txp_spectra *s, int i, double wx, double wy) {
    const int n = s->side;
    const double bins = n / s->half;
    double kx = wx * bins, ky = wy * bins;
    if (ky < 0) {
        kx = -kx;
        ky = -ky;
    }
    kx += 0.5 * n;
    if (!(kx >= 0 && kx < n - 1.001 && ky < 0.5 * n - 0.001)) return 0;
    const int x = (int)kx, y = (int)ky;
    const double u = kx - x, v = ky - y;
    const float *p = s->at + (size_t)i * txp_spectrum_size(n) + y * n + x;
    return ((double)p[0] * (1 - u) + (double)p[1] * u) * (1 - v) +
           ((double)p[n] * (1 - u) + (double)p[n + 1] * u) * v;
}

/* The highest peaks of a window. */
static void txp_find_tips(void *context, int i) {
    txp_spectra *s = ((txp_spectra_work *)context)->spectra;
    const int n = s->side;
    const float *at = s->at + (size_t)i * txp_spectrum_size(n);
    double height[TXP_TIPS] = {0};
    memset(s->tips[i], 0, sizeof s->tips[i]);
    for (int ky = 0; ky < n / 2; ky++) {
        for (int kx = 1 - n / 2; kx < n / 2 - 1; kx++) {
            const float *p = at + ky * n + kx + n / 2;
            if (kx * kx + ky * ky < TXP_LEAST_WAVES * TXP_LEAST_WAVES || (ky == 0 && kx < 0)) continue;
            if (!((double)*p > height[TXP_TIPS - 1]) || p[-1] > *p || p[1] >= *p) continue;
            if (p[n] >= *p || (ky > 0 && p[-n] > *p)) continue;
            int k = TXP_TIPS - 1;
            for (; k > 0 && height[k - 1] < (double)*p; k--) {
                height[k] = height[k - 1];
                memcpy(s->tips[i][k], s->tips[i][k - 1], sizeof s->tips[i][k]);
            }
            const double l = (double)p[-1], r = (double)p[1], c = (double)*p;
            const double d = (double)p[n], t = ky > 0 ? (double)p[-n] : d;
            height[k] = c;
            s->tips[i][k][0] = (kx + 0.5 * (l - r) / (l + r - 2 * c)) * s->half / n;
            s->tips[i][k][1] = (ky + (t + d < 2 * c ? 0.5 * (t - d) / (t + d - 2 * c) : 0)) * s->half / n;
        }
    }
}

/* The spectra of all windows of a gray picture. 0: no memory. */
static int txp_spectra_make(const txp_gray *gray, int side, txm_arena *arena, txm_env *env,
                            txp_spectra *s) {
    txp_spectra_work w;
    txm_arena scratch;
    const int step = side / 2;
    memset(s, 0, sizeof *s);
    s->gray = gray;
    s->side = side;
    s->half = 0.5 * (gray->width > gray->height ? gray->width : gray->height);
    s->across = txm_clampi((gray->width - side + step - 1) / step + 1, 1, TXP_WINDOWS);
    s->down = txm_clampi((gray->height - side + step - 1) / step + 1, 1, TXP_WINDOWS);
    const size_t windows = (size_t)s->across * (size_t)s->down, pairs = (windows + 1) / 2;
    s->at = (float *)txm_arena_alloc(arena, windows * txp_spectrum_size(side), sizeof *s->at);
    s->middles = (txp_spot *)txm_arena_alloc(arena, windows, sizeof *s->middles);
    s->tips = (double(*)[TXP_TIPS][2])txm_arena_alloc(arena, windows, sizeof *s->tips);
    txm_arena_init(&scratch, env);
    w.room = (txp_complex *)txm_arena_alloc(&scratch, pairs * (size_t)side * (size_t)side,
                                            sizeof *w.room);
    if (arena->failed || scratch.failed) {
        txm_arena_free(&scratch);
        return 0;
    }
    w.spectra = s;
    for (int i = 0; i < side; i++) {
        double sine, cosine;
        txm_sincos(2 * TXM_PI * i / side, &sine, &cosine);
        if (i < side / 2) {
            w.turns[i].re = cosine;
            w.turns[i].im = -sine;
        }
        txm_sincos(2 * TXM_PI * (i + 0.5) / side, &sine, &cosine);
        w.bell[i] = 0.5 - 0.5 * cosine;
    }
    txm_parallel_for(env, (int)pairs, txp_window_pair, &w);
    txm_arena_free(&scratch);
    txp_whiten(s);
    txm_parallel_for(env, (int)windows, txp_find_tips, &w);
    return 1;
}

/* ---- a smooth field of displacements -------------------------------------------------------- */

/* What tilt and lens leave over: walls that bulge, photographs that were put together from several.
   The displacement on the plane at a place of the photograph, as a cubic B-spline of few cells. */

/* ours, see docs/choices.md */
enum {
    TXP_CELLS_ALONG = 7,                   /* of the spline, along the longer side of the photograph */
    TXP_KNOTS = TXP_CELLS_ALONG + 3,       /* numbers along it                                       */
    TXP_FIELD_MOST = TXP_KNOTS * TXP_KNOTS /* numbers of one component, at most                      */
};

typedef struct txp_swell {
    int across, down;        /* numbers along the sides */
    double reach_x, reach_y; /* the photograph goes from -reach to reach */
    double cell_x, cell_y;
    double at[TXP_FIELD_MOST][2];
} txp_swell;

/* A field of zeros over a photograph. */
static void txp_swell_make(int width, int height, txp_swell *f) {
    const int longer = width > height ? width : height, most = TXP_CELLS_ALONG;
    const int cells_x = txm_clampi((int)((int64_t)most * width / longer), 1, most);
    const int cells_y = txm_clampi((int)((int64_t)most * height / longer), 1, most);
    memset(f, 0, sizeof *f);
    f->across = cells_x + 3;
    f->down = cells_y + 3;
    f->reach_x = (double)width / longer;
    f->reach_y = (double)height / longer;
    f->cell_x = 2 * f->reach_x / cells_x;
    f->cell_y = 2 * f->reach_y / cells_y;
}

/* The four weights of a cubic B-spline at t, in cells, and their slopes; returns the first number. */
static int txp_spline_weights(double t, int numbers, double w[4], double slope[4]) {
    const int first = txm_clampi((int)floor(t), 0, numbers - 4);
    const double u = fmin(fmax(t - first, 0), 1), v = 1 - u;
    w[0] = v * v * v / 6;
    w[1] = (3 * u * u * u - 6 * u * u + 4) / 6;
    w[2] = (3 * v * v * v - 6 * v * v + 4) / 6;
    w[3] = u * u * u / 6;
    slope[0] = -0.5 * v * v;
    slope[1] = 1.5 * u * u - 2 * u;
    slope[2] = 2 * v - 1.5 * v * v;
    slope[3] = 0.5 * u * u;
    return first;
}

/* The displacement at a place; m: its derivatives, as in txp_view_place. */
static void txp_swell_at(const txp_swell *f, double x, double y, double moved[2], double m[4]) {
    double wx[4], wy[4], sx[4], sy[4];
    const int i0 = txp_spline_weights((x + f->reach_x) / f->cell_x, f->across, wx, sx);
    const int j0 = txp_spline_weights((y + f->reach_y) / f->cell_y, f->down, wy, sy);
    moved[0] = moved[1] = m[0] = m[1] = m[2] = m[3] = 0;
    for (int j = 0; j < 4; j++) {
        for (int i = 0; i < 4; i++) {
            const double *at = f->at[(j0 + j) * f->across + i0 + i];
            for (int d = 0; d < 2; d++) {
                moved[d] += wx[i] * wy[j] * at[d];
                m[2 * d] += sx[i] * wy[j] / f->cell_x * at[d];
                m[2 * d + 1] += wx[i] * sy[j] / f->cell_y * at[d];
            }
        }
    }
}

/* ---- how a plane was photographed ---------------------------------------------------------- */

/* From a place (x, y) of the photograph to the plane, both centred on the middle and equal there
   to first order: the lens is undone, q = (x, y) (1 + bend r^2 + curl r^4), then the perspective,
   (X, Y) = q / (1 + tilt_x q_x + tilt_y q_y), then what the field adds, if there is one. A periodic
   wall is a sum of plane waves in (X, Y). */
typedef struct txp_view {
    double tilt_x, tilt_y, bend, curl;
    const txp_swell *field; /* NULL: none */
} txp_view;

/* A wave on the plane: phase = a X + b Y + shift, in turns; clear: how well it is seen, in the
   measure of the stage; contrast: how much of the contrast it is, 0..1. */
typedef struct txp_wave {
    double a, b, shift, clear, contrast;
} txp_wave;

/* The place on the plane, and the derivatives m = (dX/dx, dX/dy, dY/dx, dY/dy). 0: the place lies
   beyond the horizon, or where the lens folds. */
static int txp_view_place(const txp_view *v, double x, double y, double place[2], double m[4]) {
    const double rr = x * x + y * y, lens = 1 + rr * (v->bend + rr * v->curl);
    const double slope = 2 * v->bend + 4 * rr * v->curl; /* of the lens, by r, over r */
    const double qx = x * lens, qy = y * lens, depth = 1 + v->tilt_x * qx + v->tilt_y * qy;
    const double lxx = lens + slope * x * x, lxy = slope * x * y, lyy = lens + slope * y * y;
    if (!(depth > 0.05) || !(lxx * lyy - lxy * lxy > 0.02) || !(lxx > 0)) return 0;
    const double px = qx / depth, py = qy / depth;
    const double xx = (1 - px * v->tilt_x) / depth, xy = -px * v->tilt_y / depth;
    const double yx = -py * v->tilt_x / depth, yy = (1 - py * v->tilt_y) / depth;
    place[0] = px;
    place[1] = py;
    m[0] = xx * lxx + xy * lxy;
    m[1] = xx * lxy + xy * lyy;
    m[2] = yx * lxx + yy * lxy;
    m[3] = yx * lxy + yy * lyy;
    if (v->field) {
        double moved[2], slopes[4];
        txp_swell_at(v->field, x, y, moved, slopes);
        for (int d = 0; d < 2; d++) place[d] += moved[d];
        for (int i = 0; i < 4; i++) m[i] += slopes[i];
    }
    return 1;
}

/* ---- the search: which view makes the spectra of all windows agree? ------------------------ */

/* ours, see docs/choices.md */
enum {
    TXP_TILT_STEPS = 8,    /* to each side of 0                                                   */
    TXP_BEND_STEPS = 2,    /* the same                                                            */
    TXP_ASKED_WINDOWS = 4, /* across and down: windows whose peaks are tried as waves             */
    TXP_ASKED_TIPS = 4,    /* of the peaks of each of them                                        */
    TXP_GUESSES = 12,      /* of each tilt_x the best guesses are kept                            */
    TXP_OFFERS = 4,        /* of each scale, with different waves, the phases are looked at        */
    TXP_REFINED = 24,      /* of all guesses, the best, are refined                               */
    TXP_MOST_WINDOWS = TXP_WINDOWS * TXP_WINDOWS
};
#define TXP_TILT_STEP 0.1
#define TXP_TILT_MOST 0.85  /* |tilt_x| + |tilt_y| in the corners of the picture                  */
#define TXP_BEND_STEP 0.09
#define TXP_PEAK_MOST 24.0  /* the limit of what a magnitude counts, so that no window decides alone */
#define TXP_ALIKE 0.15      /* difference of one wave, of its length                               */
#define TXP_APART 0.34      /* least sine of the angle between two waves                          */

typedef struct txp_guess {
    txp_view view;
    txp_wave wave[2];
    double score;
} txp_guess;

/* A view, prepared for the windows: from (a, b) to the local frequency of each. */
typedef struct txp_prepared {
    double m[TXP_MOST_WINDOWS][4];
    int good[TXP_MOST_WINDOWS];
} txp_prepared;

/* The distortion (1 + k r^2) has an inverse that begins 1 - k r^2 + 3 k^2 r^4. */
static double txp_usual_curl(double bend) {
    return 3 * bend * bend;
}

static void txp_prepare(const txp_spectra *s, const txp_view *v, txp_prepared *p) {
    double place[2];
    memset(p->good, 0, sizeof p->good);
    for (int i = 0; i < s->across * s->down; i++)
        p->good[i] = txp_view_place(v, s->middles[i].x, s->middles[i].y, place, p->m[i]);
}

/* How clearly all windows show a wave: the mean of the magnitudes, over those that can show it. */
static double txp_wave_clear(const txp_spectra *s, const txp_prepared *p, double a, double b) {
    const int count = s->across * s->down;
    const double lowest = TXP_LEAST_WAVES * s->half / s->side;
    double sum = 0;
    int seen = 0;
    for (int i = 0; i < count; i++) {
        if (!p->good[i]) continue;
        const double *m = p->m[i];
        const double wx = m[0] * a + m[2] * b, wy = m[1] * a + m[3] * b;
        if (wx * wx + wy * wy < lowest * lowest) continue;
        const double z = txp_spectrum_at(s, i, wx, wy);
        if (!(z > 0)) continue;
        sum += z * TXP_PEAK_MOST / (z + TXP_PEAK_MOST);
        seen++;
    }
    return 2 * seen > count ? sum / sqrt((double)count * seen) : 0;
}

/* Small: of two views that are as good the flatter one is taken. */
static double txp_view_penalty(const txp_view *v) {
    return 1 - 0.06 * (v->tilt_x * v->tilt_x + v->tilt_y * v->tilt_y) - 0.6 * v->bend * v->bend;
}

static double txp_guess_score(const txp_spectra *s, const txp_guess *g, int waves) {
    txp_prepared p;
    double sum = 0;
    txp_prepare(s, &g->view, &p);
    for (int k = 0; k < waves; k++) sum += txp_wave_clear(s, &p, g->wave[k].a, g->wave[k].b);
    return sum * txp_view_penalty(&g->view);
}

/* The wave on the plane that window i sees with the frequency w. */
static int txp_wave_from(const double m[4], const double w[2], txp_wave *wave) {
    const double det = m[0] * m[3] - m[1] * m[2];
    if (!(fabs(det) > 1e-6) || !(w[0] * w[0] + w[1] * w[1] > 0)) return 0;
    wave->a = (m[3] * w[0] - m[2] * w[1]) / det;
    wave->b = (m[0] * w[1] - m[1] * w[0]) / det;
    return 1;
}

typedef struct txp_hunt {
    const txp_spectra *spectra;
    double reach_x, reach_y; /* of the picture, in half sides                                    */
    txp_guess (*best)[TXP_GUESSES];
} txp_hunt;

/* Put a guess into a list sorted by score, unless a like one is there that is better. */
static void txp_keep_guess(txp_guess *list, int count, const txp_guess *g) {
    int k = count - 1;
    if (!(g->score > list[k].score)) return;
    for (; k > 0 && list[k - 1].score < g->score; k--) list[k] = list[k - 1];
    list[k] = *g;
}

static int txp_asked(int count, int i) {
    return count <= TXP_ASKED_WINDOWS ? i : i * (count - 1) / (TXP_ASKED_WINDOWS - 1);
}

/* All guesses of one view. */
static void txp_try_view(const txp_hunt *q, const txp_view *v, txp_guess *list) {
    const txp_spectra *s = q->spectra;
    const int across = s->across < TXP_ASKED_WINDOWS ? s->across : TXP_ASKED_WINDOWS;
    const int down = s->down < TXP_ASKED_WINDOWS ? s->down : TXP_ASKED_WINDOWS;
    const double penalty = txp_view_penalty(v);
    txp_prepared p;
    txp_guess best;
    memset(&best, 0, sizeof best);
    best.view = *v;
    txp_prepare(s, v, &p);
    for (int i = 0; i < across * down; i++) {
        const int at =
            txp_asked(s->down, i / across) * s->across + txp_asked(s->across, i % across);
        if (!p.good[at]) continue;
        for (int t = 0; t < TXP_ASKED_TIPS; t++) {
            txp_wave wave = {0, 0, 0, 0, 0};
            if (!txp_wave_from(p.m[at], s->tips[at][t], &wave)) continue;
            const double score = txp_wave_clear(s, &p, wave.a, wave.b) * penalty;
            if (!(score > best.score)) continue;
            best.score = score;
            best.wave[0] = wave;
        }
    }
    txp_keep_guess(list, TXP_GUESSES, &best);
}

static void txp_try_column(void *context, int column) {
    const txp_hunt *q = (const txp_hunt *)context;
    txp_guess *list = q->best[column];
    txp_view v;
    memset(list, 0, TXP_GUESSES * sizeof *list);
    v.field = NULL;
    v.tilt_x = (column - TXP_TILT_STEPS) * TXP_TILT_STEP;
    for (int row = -TXP_TILT_STEPS; row <= TXP_TILT_STEPS; row++) {
        v.tilt_y = row * TXP_TILT_STEP;
        if (fabs(v.tilt_x) * q->reach_x + fabs(v.tilt_y) * q->reach_y > TXP_TILT_MOST) continue;
        for (int k = -TXP_BEND_STEPS; k <= TXP_BEND_STEPS; k++) {
            v.bend = k * TXP_BEND_STEP;
            v.curl = txp_usual_curl(v.bend);
            txp_try_view(q, &v, list);
        }
    }
}

/* Climb to the nearest maximum: each number in turn up or down, by steps that are halved. */
static void txp_climb(const txp_spectra *s, txp_guess *g, int waves) {
    double step[7] = {0.05, 0.05, 0.04, 0, 0, 0, 0};
    double *number[7] = {&g->view.tilt_x, &g->view.tilt_y, &g->view.bend, &g->wave[0].a,
                         &g->wave[0].b,   &g->wave[1].a,   &g->wave[1].b};
    for (int k = 3; k < 7; k++) step[k] = 0.5 * s->half / s->side;
    g->score = txp_guess_score(s, g, waves);
    for (int round = 0, halvings = 0; round < 60 && halvings < 6; round++) {
        int better = 0;
        for (int k = 0; k < 3 + 2 * waves; k++) {
            for (int sign = -1; sign <= 1; sign += 2) {
                const double old = *number[k];
                *number[k] += sign * step[k];
                g->view.curl = txp_usual_curl(g->view.bend);
                const double score = txp_guess_score(s, g, waves);
                if (score > g->score) {
                    g->score = score;
                    better = 1;
                    break;
                }
                *number[k] = old;
                g->view.curl = txp_usual_curl(g->view.bend);
            }
        }
        if (better) continue;
        halvings++;
        for (int k = 0; k < 7; k++) step[k] *= 0.5;
    }
}

/* The clearest wave that is not along the first one. */
static void txp_second_wave(const txp_spectra *s, txp_guess *g) {
    const txp_wave *first = &g->wave[0];
    txp_prepared p;
    txp_prepare(s, &g->view, &p);
    memset(&g->wave[1], 0, sizeof g->wave[1]);
    for (int i = 0; i < s->across * s->down; i++) {
        for (int t = 0; t < TXP_TIPS && p.good[i]; t++) {
            txp_wave w = {0, 0, 0, 0, 0};
            if (!txp_wave_from(p.m[i], s->tips[i][t], &w)) continue;
            const double cross = first->a * w.b - first->b * w.a;
            if (cross * cross < TXP_APART * TXP_APART * (w.a * w.a + w.b * w.b) *
                                    (first->a * first->a + first->b * first->b))
                continue;
            w.clear = txp_wave_clear(s, &p, w.a, w.b);
            if (w.clear > g->wave[1].clear) g->wave[1] = w;
        }
    }
}

typedef struct txp_climbers {
    const txp_spectra *spectra;
    txp_guess *list;
} txp_climbers;

static void txp_climb_one(void *context, int i) {
    const txp_climbers *c = (const txp_climbers *)context;
    if (c->list[i].score > 0) txp_climb(c->spectra, &c->list[i], 1);
}

/* Are these two waves one wave, or nearly? */
static int txp_same_wave(const txp_wave *p, const txp_wave *q) {
    const double pp = p->a * p->a + p->b * p->b, qq = q->a * q->a + q->b * q->b;
    const double sign = p->a * q->a + p->b * q->b < 0 ? -1 : 1;
    const double a = p->a - sign * q->a, b = p->b - sign * q->b;
    return a * a + b * b < TXP_ALIKE * TXP_ALIKE * fmin(pp, qq);
}

/* The best views and waves of one scale, the best first; score 0: none. */
static void txp_search_view(const txp_spectra *s, txm_env *env, txp_guess out[TXP_OFFERS]) {
    enum { COLUMNS = 2 * TXP_TILT_STEPS + 1 };
    txp_guess best[COLUMNS][TXP_GUESSES], list[TXP_REFINED];
    txp_hunt q;
    txp_climbers climbers;
    txp_prepared p;
    q.spectra = s;
    q.reach_x = 0.5 * s->gray->width / s->half;
    q.reach_y = 0.5 * s->gray->height / s->half;
    q.best = best;
    memset(list, 0, sizeof list);
    txm_parallel_for(env, COLUMNS, txp_try_column, &q);
    for (int i = 0; i < COLUMNS * (int)TXP_GUESSES; i++)
        txp_keep_guess(list, TXP_REFINED, &best[i / TXP_GUESSES][i % TXP_GUESSES]);
    climbers.spectra = s;
    climbers.list = list;
    txm_parallel_for(env, TXP_REFINED, txp_climb_one, &climbers);
    memset(out, 0, TXP_OFFERS * sizeof *out);
    for (int k = 0; k < TXP_OFFERS; k++) {
        for (int i = 0; i < TXP_REFINED; i++) {
            int is_new = list[i].score > out[k].score;
            for (int j = 0; j < k && is_new; j++)
                is_new = !txp_same_wave(&out[j].wave[0], &list[i].wave[0]);
            if (is_new) out[k] = list[i];
        }
    }
    for (int k = 0; k < TXP_OFFERS; k++) {
        if (!(out[k].score > 0)) continue;
        txp_second_wave(s, &out[k]);
        txp_climb(s, &out[k], 2);
        txp_prepare(s, &out[k].view, &p);
        for (int i = 0; i < 2; i++)
            out[k].wave[i].clear = txp_wave_clear(s, &p, out[k].wave[i].a, out[k].wave[i].b);
    }
}

/* ---- phases: where exactly the waves of a view lie in a photograph ------------------------- */

/* At each node of a grid over the photograph the gray picture is multiplied by the wave that the
   view predicts there: the angle of the sum is by how much the wave lies beside its prediction.
   The view and its waves are fitted to these angles by least squares: first to the differences of
   neighbouring nodes, which do not mind errors of whole turns, then to the angles themselves. */

/* ours, see docs/choices.md */
enum {
    TXP_NODES = 16,    /* along the longer side                                                  */
    TXP_VIEWS = 4,     /* numbers of a view                                                       */
    TXP_NUMBERS = 10,  /* and three of each wave                                     */
    TXP_FIT_ROUNDS = 7 /* the first half with differences                                        */
};
#define TXP_LISTENING 1.25   /* periods: from the middle of a node to the rim of its window       */
#define TXP_LISTENING_LEAST 0.12 /* half sides: the same, at least                              */
#define TXP_HOPELESS 0.25      /* agreement after the first half: no more is tried             */
#define TXP_OUTLIER 0.08     /* turns: residuals above count less and less                       */

/* One wave at one node. */
typedef struct txp_sight {
    double beside; /* turns, -0.5..0.5                                            */
    double weight; /* 0..1: how much of the contrast there is this wave; 0: none  */
} txp_sight;

typedef struct txp_nodes {
    const txp_gray *gray;
    int across, down, waves;
    double half;
    txp_spot *at;            /* across * down  */
    txp_sight (*sight)[2];
} txp_nodes;

/* The angle of (x, y) in turns, -0.5..0.5: atan2 of the same bits everywhere. */
static double txp_turns(double x, double y) {
    const double ax = fabs(x), ay = fabs(y), most = ax > ay ? ax : ay, least = ax > ay ? ay : ax;
    if (!(most > 0)) return 0;
    double t = least / most;
    for (int i = 0; i < 2; i++) t = t / (1 + sqrt(1 + t * t)); /* the tangent of half the angle */
    const double tt = t * t;
    double sum = 0;
    for (int k = 15; k > 0; k -= 2) sum = 1.0 / k - tt * sum;
    double angle = 4 * t * sum / (2 * TXM_PI);
    if (ay > ax) angle = 0.25 - angle;
    if (x < 0) angle = 0.5 - angle;
    return y < 0 ? -angle : angle;
}

/* The phase of a wave at a place of the photograph, and the local frequency there. */
static int txp_wave_phase(const txp_view *v, const txp_wave *w, double x, double y, double *phase,
                          double frequency[2]) {
    double place[2], m[4];
    if (!txp_view_place(v, x, y, place, m)) return 0;
    *phase = w->a * place[0] + w->b * place[1] + w->shift;
    frequency[0] = m[0] * w->a + m[2] * w->b;
    frequency[1] = m[1] * w->a + m[3] * w->b;
    return 1;
}

/* Nodes over a gray picture. 0: no memory. */
static int txp_nodes_make(const txp_gray *gray, txm_arena *arena, txp_nodes *n) {
    const int w = gray->width, h = gray->height, longer = w > h ? w : h;
    n->gray = gray;
    n->half = 0.5 * longer;
    n->across = txm_clampi((int)((int64_t)TXP_NODES * w / longer), 4, TXP_NODES);
    n->down = txm_clampi((int)((int64_t)TXP_NODES * h / longer), 4, TXP_NODES);
    const size_t count = (size_t)n->across * (size_t)n->down;
    n->at = (txp_spot *)txm_arena_alloc(arena, count, sizeof *n->at);
    n->sight = (txp_sight(*)[2])txm_arena_zero(arena, count, sizeof *n->sight);
    if (arena->failed) return 0;
    for (int i = 0; i < n->across * n->down; i++) {
        const int column = i % n->across, row = i / n->across;
        n->at[i].x = ((column + 0.5) / n->across - 0.5) * w / n->half;
        n->at[i].y = ((row + 0.5) / n->down - 0.5) * h / n->half;
    }
    return 1;
}

/* How a wave lies at a place (pixels of the gray picture): its phase in turns, its local frequency in
   cycles per pixel. */
static int txp_lies(const txp_nodes *n, const txp_view *v, const txp_wave *w, double x, double y,
                    double *phase, double frequency[2]) {
    const txp_gray *g = n->gray;
    if (!txp_wave_phase(v, w, (x + 0.5 - 0.5 * g->width) / n->half,
                        (y + 0.5 - 0.5 * g->height) / n->half, phase, frequency))
        return 0;
    frequency[0] /= n->half;
    frequency[1] /= n->half;
    return 1;
}

/* What a node sees of a wave. */
static txp_sight txp_see(const txp_nodes *n, const txp_view *v, const txp_wave *w, txp_spot at) {
    txp_sight sight = {0, 0};
    const txp_gray *g = n->gray;
    const double cx = at.x * n->half + 0.5 * g->width - 0.5;
    const double cy = at.y * n->half + 0.5 * g->height - 0.5;
    double phase, f[2], sine, cosine, re = 0, im = 0, bells = 0, energy = 0;
    if (!txp_lies(n, v, w, cx, cy, &phase, f)) return sight;
    const double speed = sqrt(f[0] * f[0] + f[1] * f[1]);
    if (!(speed > 1e-4) || fabs(f[0]) > 0.45 || fabs(f[1]) > 0.45) return sight;
    const double reach =
        fmin(fmax(TXP_LISTENING / speed, fmax(5, TXP_LISTENING_LEAST * n->half)), 0.25 * n->half);
    const int x0 = (int)fmax(ceil(cx - reach), 0), x1 = (int)fmin(floor(cx + reach), g->width - 1);
    const int y0 = (int)fmax(ceil(cy - reach), 0), y1 = (int)fmin(floor(cy + reach), g->height - 1);
    for (int y = y0; y <= y1; y++) {
        const double q = (y - cy) / reach, by = (1 - q * q) * (1 - q * q);
        const float *row = g->at + (size_t)y * (size_t)g->width;
        if (!txp_lies(n, v, w, cx, y, &phase, f)) continue;
        phase += f[0] * (x0 - cx);
        phase -= floor(phase);
        txm_sincos(2 * TXM_PI * f[0], &sine, &cosine);
        const double turn_re = cosine, turn_im = sine;
        txm_sincos(2 * TXM_PI * phase, &sine, &cosine);
        double c = cosine, s = sine;
        for (int x = x0; x <= x1; x++) {
            const double u = (x - cx) / reach, bell = by * (1 - u * u) * (1 - u * u);
            const double value = (double)row[x], next = c * turn_re - s * turn_im;
            re += bell * value * c;
            im -= bell * value * s;
            bells += bell;
            energy += bell * value * value;
            s = c * turn_im + s * turn_re;
            c = next;
        }
    }
    if (!(energy > 0)) return sight;
    /* the value is like cos(2 pi (phase + beside)) */
    sight.beside = txp_turns(re, im);
    sight.weight = sqrt((re * re + im * im) / (bells * energy));
    return sight;
}

typedef struct txp_seeing {
    txp_nodes *nodes;
    const txp_guess *guess;
} txp_seeing;

static void txp_see_node(void *context, int i) {
    const txp_seeing *q = (const txp_seeing *)context;
    const txp_nodes *n = q->nodes;
    for (int k = 0; k < 2; k++) {
        txp_sight none = {0, 0};
        n->sight[i][k] =
            k < n->waves ? txp_see(n, &q->guess->view, &q->guess->wave[k], n->at[i]) : none;
    }
}

/* ---- least squares -------------------------------------------------------------------------- */

static double txp_rest(double turns) {
    return turns - floor(turns + 0.5);
}

/* Solve A x = b for a symmetric positive A of size n, which is overwritten; b becomes x. */
static void txp_solve(double a[TXP_NUMBERS][TXP_NUMBERS], double *b, int n) {
    for (int i = 0; i < n; i++) {
        for (int j = 0; j <= i; j++) {
            double sum = a[i][j];
            for (int k = 0; k < j; k++) sum -= a[i][k] * a[j][k];
            a[i][j] = i == j ? sqrt(fmax(sum, 1e-12)) : sum / a[j][j];
        }
    }
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < i; k++) b[i] -= a[i][k] * b[k];
        b[i] /= a[i][i];
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int k = i + 1; k < n; k++) b[i] -= a[k][i] * b[k];
        b[i] /= a[i][i];
    }
}

static double *txp_number_of(txp_guess *g, int k) {
    txp_view *v = &g->view;
    if (k < TXP_VIEWS) return k < 2 ? (k ? &v->tilt_y : &v->tilt_x) : k > 2 ? &v->curl : &v->bend;
    txp_wave *w = &g->wave[(k - TXP_VIEWS) / 3];
    const int part = (k - TXP_VIEWS) % 3;
    return part == 0 ? &w->a : part == 1 ? &w->b : &w->shift;
}

/* The derivatives of the phase of a wave at a place by all numbers. */
static int txp_phase_slopes(const txp_guess *g, int wave, txp_spot at, double slopes[TXP_NUMBERS]) {
    const double little = 1e-4;
    double place[2], m[4], frequency[2];
    if (!txp_view_place(&g->view, at.x, at.y, place, m)) return 0;
    for (int k = 0; k < TXP_NUMBERS; k++) slopes[k] = 0;
    slopes[TXP_VIEWS + 3 * wave] = place[0];
    slopes[TXP_VIEWS + 3 * wave + 1] = place[1];
    slopes[TXP_VIEWS + 3 * wave + 2] = 1;
    for (int k = 0; k < TXP_VIEWS; k++) {
        txp_guess other = *g;
        double above, below;
        *txp_number_of(&other, k) += little;
        if (!txp_wave_phase(&other.view, &g->wave[wave], at.x, at.y, &above, frequency)) return 0;
        *txp_number_of(&other, k) -= 2 * little;
        if (!txp_wave_phase(&other.view, &g->wave[wave], at.x, at.y, &below, frequency)) return 0;
        slopes[k] = (above - below) / (2 * little);
    }
    return 1;
}

/* One equation: slopes . x = beside. */
typedef struct txp_equations {
    double a[TXP_NUMBERS][TXP_NUMBERS], b[TXP_NUMBERS];
} txp_equations;

static void txp_add_equation(txp_equations *q, const double *slopes, double beside, double weight) {
    for (int i = 0; i < TXP_NUMBERS; i++) {
        q->b[i] += weight * slopes[i] * beside;
        for (int j = 0; j <= i; j++) q->a[i][j] += weight * slopes[i] * slopes[j];
    }
}

/* A number that stays as it is. */
static void txp_hold(txp_equations *q, int k) {
    for (int i = 0; i < TXP_NUMBERS; i++) q->a[i > k ? i : k][i > k ? k : i] = 0;
    q->a[k][k] = 1;
    q->b[k] = 0;
}

/* Equations of all nodes, or of all pairs of neighbours. */
static void txp_collect(const txp_nodes *n, const txp_guess *g, int differences, txp_equations *q) {
    memset(q, 0, sizeof *q);
    for (int i = 0; i < n->across * n->down; i++) {
        for (int k = 0; k < n->waves; k++) {
            const txp_sight *s = &n->sight[i][k];
            double slopes[TXP_NUMBERS], other[TXP_NUMBERS];
            if (!(s->weight > 0) || !txp_phase_slopes(g, k, n->at[i], slopes)) continue;
            if (!differences) {
                const double r = s->beside / TXP_OUTLIER;
                txp_add_equation(q, slopes, s->beside, s->weight * s->weight / (1 + r * r));
                continue;
            }
            for (int d = 0; d < 2; d++) {
                const int j = d ? i + n->across : i + 1;
                if (d ? j >= n->across * n->down : j % n->across == 0) continue;
                const txp_sight *t = &n->sight[j][k];
                if (!(t->weight > 0) || !txp_phase_slopes(g, k, n->at[j], other)) continue;
                for (int c = 0; c < TXP_NUMBERS; c++) other[c] -= slopes[c];
                const double step = txp_rest(t->beside - s->beside), r = step / (2 * TXP_OUTLIER);
                txp_add_equation(q, other, step, s->weight * t->weight / (1 + r * r));
            }
        }
    }
}

/* By how much the phases of a wave agree with it over the picture, -1..1. */
static double txp_agreement(const txp_nodes *n, int k) {
    double re = 0, sum = 0, sine, cosine;
    for (int i = 0; i < n->across * n->down; i++) {
        const txp_sight *s = &n->sight[i][k];
        txm_sincos(2 * TXM_PI * s->beside, &sine, &cosine);
        re += s->weight * cosine;
        sum += s->weight;
    }
    return sum > 0 ? re / sum : 0;
}

static double txp_mean_weight(const txp_nodes *n, int k) {
    double sum = 0;
    for (int i = 0; i < n->across * n->down; i++) sum += n->sight[i][k].weight;
    return sum / (n->across * n->down);
}

/* Turn each wave so that the mean of its residuals is 0. */
static void txp_set_shifts(const txp_nodes *n, txp_guess *g) {
    for (int k = 0; k < n->waves; k++) {
        double re = 0, im = 0, sine, cosine;
        for (int i = 0; i < n->across * n->down; i++) {
            const txp_sight *s = &n->sight[i][k];
            txm_sincos(2 * TXM_PI * s->beside, &sine, &cosine);
            re += s->weight * cosine;
            im += s->weight * sine;
        }
        g->wave[k].shift = txp_rest(g->wave[k].shift + txp_turns(re, im));
    }
}

static void txp_clearer_first(txp_guess *g) {
    const txp_wave first = g->wave[0];
    if (!(g->wave[1].clear > first.clear)) return;
    g->wave[0] = g->wave[1];
    g->wave[1] = first;
}

/* How well the waves agree with what the nodes see, and how much of the contrast they are. */
static void txp_measure(const txp_nodes *n, txp_guess *g) {
    for (int k = 0; k < 2; k++) {
        g->wave[k].clear = k < n->waves ? txp_agreement(n, k) : 0;
        g->wave[k].contrast = k < n->waves ? txp_mean_weight(n, k) : 0;
    }
}

/* Fit the view and its waves to the phases; clear of each wave receives how well they agree.
   has_lens 0: the lens stays as it is. */
static void txp_fit_phases(txp_nodes *n, txm_env *env, int has_lens, txp_guess *g) {
    txp_seeing seeing;
    txp_equations q;
    seeing.nodes = n;
    seeing.guess = g;
    n->waves = g->wave[1].clear > 0 ? 2 : 1;
    for (int round = 0; round < TXP_FIT_ROUNDS; round++) {
        const int differences = round < TXP_FIT_ROUNDS / 2;
        txm_parallel_for(env, n->across * n->down, txp_see_node, &seeing);
        if (round == TXP_FIT_ROUNDS / 2) {
            txp_set_shifts(n, g);
            txm_parallel_for(env, n->across * n->down, txp_see_node, &seeing);
            double most = 0;
            for (int k = 0; k < n->waves; k++) most = fmax(most, txp_agreement(n, k));
            if (most < TXP_HOPELESS) break;
        }
        txp_collect(n, g, differences, &q);
        for (int k = 0; k < TXP_NUMBERS; k++) q.a[k][k] += (k < TXP_VIEWS ? 1e-2 : 1e-6) + 1e-4 * q.a[k][k];
        for (int k = 2; k < TXP_VIEWS && !has_lens; k++) txp_hold(&q, k);
        txp_solve(q.a, q.b, TXP_NUMBERS);
        for (int k = 0; k < TXP_NUMBERS; k++) *txp_number_of(g, k) += q.b[k];
    }
    txm_parallel_for(env, n->across * n->down, txp_see_node, &seeing);
    txp_measure(n, g);
}

/* ---- fitting the field to the phases -------------------------------------------------------- */

/* By how much the waves lie beside their prediction is a smooth function of the place where a wall is
   wavy, and noise where bricks are laid unevenly. What the field predicts for nodes that it has not
   seen tells which: blocks of nodes are left out in turn, for several stiffnesses of the field. */

/* ours, see docs/choices.md */
enum {
    TXP_FOLD = 2,         /* nodes along the sides of the blocks that are left out in turn           */
    TXP_STIFFNESSES = 4,  /* that are tried, each a quarter as stiff as the one before               */
    TXP_FIELD_FITS = 6,   /* rounds of one fit, the first half with differences                      */
    TXP_FIELD_LOOKS = 4,  /* at the photograph, with the field as it is by then                      */
    TXP_FIELD_TERMS = 32  /* numbers of both components that matter at a place                       */
};
#define TXP_STIFFEST 2.56    /* weight of second differences, in turns of weight 1                */
#define TXP_HELPS 0.7        /* of the disagreement of unseen nodes: if more is left, it is no help */
#define TXP_SOFTER 0.85      /* the same from one stiffness to the next softer one               */
#define TXP_FORESIGHT 0.88   /* agreement of unseen nodes, for each wave                         */
#define TXP_HELPS_LEAST 0.02 /* a disagreement that is smaller than this is none                 */
#define TXP_STEEPEST 0.3     /* displacement of a field from place to place                      */

/* One linear form in the numbers of a field. */
typedef struct txp_form {
    int count, at[2 * TXP_FIELD_TERMS];
    double value[2 * TXP_FIELD_TERMS];
} txp_form;

typedef struct txp_waving {
    const txp_nodes *nodes;
    const txp_guess *guess; /* its view has the field that the nodes were seen with, or none */
    txp_swell field;        /* what is fitted                                                */
    int parts;              /* components: 2, or 1 if only one wave is seen                  */
    double toward[2][2];    /* the directions of the components                              */
    double shift[2];        /* of the waves, in turns                                        */
    int unknowns;
    double *a, *b; /* unknowns * unknowns, unknowns */
} txp_waving;

/* Prepare a fit of the field to what the nodes see. 0: no memory. */
static int txp_waving_make(const txp_nodes *n, const txp_guess *g, txm_arena *arena, txp_waving *q) {
    memset(q, 0, sizeof *q);
    q->nodes = n;
    q->guess = g;
    txp_swell_make(n->gray->width, n->gray->height, &q->field);
    q->parts = n->waves;
    q->toward[0][0] = q->toward[1][1] = 1;
    if (q->parts == 1) {
        const txp_wave *w = &g->wave[0];
        const double length = sqrt(w->a * w->a + w->b * w->b);
        if (!(length > 0)) return 1;
        q->toward[0][0] = w->a / length;
        q->toward[0][1] = w->b / length;
    }
    q->unknowns = q->parts * q->field.across * q->field.down;
    const size_t count = (size_t)q->unknowns;
    q->a = (double *)txm_arena_alloc(arena, count * count, sizeof *q->a);
    q->b = (double *)txm_arena_alloc(arena, count, sizeof *q->b);
    return !arena->failed;
}

/* Add how the phase of a wave at a place depends on the field. */
static void txp_form_phase(const txp_waving *q, const txp_wave *w, txp_spot at, double sign,
                           txp_form *form) {
    const txp_swell *f = &q->field;
    double wx[4], wy[4], slope[4];
    const int i0 = txp_spline_weights((at.x + f->reach_x) / f->cell_x, f->across, wx, slope);
    const int j0 = txp_spline_weights((at.y + f->reach_y) / f->cell_y, f->down, wy, slope);
    for (int j = 0; j < 4; j++) {
        for (int i = 0; i < 4; i++) {
            for (int p = 0; p < q->parts; p++) {
                const double along = w->a * q->toward[p][0] + w->b * q->toward[p][1];
                form->at[form->count] = ((j0 + j) * f->across + i0 + i) * q->parts + p;
                form->value[form->count++] = sign * wx[i] * wy[j] * along;
            }
        }
    }
}

/* The equation form = value. */
static void txp_form_add(txp_waving *q, const txp_form *form, double value, double weight) {
    for (int i = 0; i < form->count; i++) {
        const double wi = weight * form->value[i];
        double *row = q->a + (size_t)form->at[i] * (size_t)q->unknowns;
        q->b[form->at[i]] += wi * value;
        for (int j = 0; j < form->count; j++)
            if (form->at[j] <= form->at[i]) row[form->at[j]] += wi * form->value[j];
    }
}

/* Second differences of the numbers of a field are small. */
static void txp_stiffen(txp_waving *q, double weight) {
    static const int steps[3][3][2] = {
        {{0, 0}, {1, 0}, {2, 0}}, {{0, 0}, {0, 1}, {0, 2}}, {{0, 0}, {1, 1}, {0, 0}}};
    const txp_swell *f = &q->field;
    for (int y = 0; y < f->down; y++) {
        for (int x = 0; x < f->across; x++) {
            for (int k = 0; k < 3 * q->parts; k++) {
                const int kind = k / q->parts, part = k % q->parts;
                const int(*s)[2] = steps[kind];
                const int wide = kind == 0 ? 2 : kind == 2, high = kind == 1 ? 2 : kind == 2;
                txp_form form;
                if (x + wide >= f->across || y + high >= f->down) continue;
                form.count = kind == 2 ? 4 : 3;
                for (int i = 0; i < 3; i++) {
                    form.at[i] = ((y + s[i][1]) * f->across + x + s[i][0]) * q->parts + part;
                    form.value[i] = i == 1 ? -2 : 1;
                }
                if (kind == 2) {
                    form.at[2] = (y * f->across + x + 1) * q->parts + part;
                    form.at[3] = ((y + 1) * f->across + x) * q->parts + part;
                    form.value[0] = form.value[1] = 1;
                    form.value[2] = form.value[3] = -1;
                }
                txp_form_add(q, &form, 0, kind == 2 ? 2 * weight : weight);
            }
        }
    }
    for (int i = 0; i < q->unknowns; i++)
        q->a[(size_t)i * (size_t)q->unknowns + (size_t)i] += 1e-3 * weight + 1e-9;
}

/* Solve: a is overwritten, b becomes the solution. */
static void txp_waving_solve(txp_waving *q) {
    const int n = q->unknowns;
    double *b = q->b;
    for (int i = 0; i < n; i++) {
        double *row = q->a + (size_t)i * (size_t)n;
        for (int j = 0; j <= i; j++) {
            const double *other = q->a + (size_t)j * (size_t)n;
            double sum = row[j];
            for (int k = 0; k < j; k++) sum -= row[k] * other[k];
            row[j] = i == j ? sqrt(fmax(sum, 1e-12)) : sum / other[j];
        }
    }
    for (int i = 0; i < n; i++) {
        const double *row = q->a + (size_t)i * (size_t)n;
        for (int k = 0; k < i; k++) b[i] -= row[k] * b[k];
        b[i] /= row[i];
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int k = i + 1; k < n; k++) b[i] -= q->a[(size_t)k * (size_t)n + (size_t)i] * b[k];
        b[i] /= q->a[(size_t)i * (size_t)n + (size_t)i];
    }
}

/* By how many turns the fitted field moves a wave at a place. */
static double txp_moves(const txp_waving *q, const txp_wave *w, txp_spot at) {
    double moved[2], m[4];
    txp_swell_at(&q->field, at.x, at.y, moved, m);
    return w->a * moved[0] + w->b * moved[1];
}

/* By how much a wave at a node lies beside tilt, lens and wave; the fitted field is left out, or in. */
static double txp_still_beside(const txp_waving *q, int node, int k, int with_field) {
    const txp_wave *w = &q->guess->wave[k];
    const txp_spot at = q->nodes->at[node];
    double moved[2], m[4], beside = q->nodes->sight[node][k].beside - q->shift[k];
    if (q->guess->view.field) {
        txp_swell_at(q->guess->view.field, at.x, at.y, moved, m);
        beside += w->a * moved[0] + w->b * moved[1];
    }
    return with_field ? beside - txp_moves(q, w, at) : beside;
}

/* In which of the two parts of the nodes a node is. */
static int txp_fold_of(const txp_nodes *n, int node) {
    return (node % n->across / (int)TXP_FOLD + node / n->across / (int)TXP_FOLD) & 1;
}

/* Equations of the nodes, or of pairs of neighbours; those of one part left out (-1: none). */
static void txp_waving_collect(txp_waving *q, int left_out, int differences) {
    const txp_nodes *n = q->nodes;
    const size_t count = (size_t)q->unknowns;
    memset(q->a, 0, count * count * sizeof *q->a);
    memset(q->b, 0, count * sizeof *q->b);
    for (int i = 0; i < n->across * n->down; i++) {
        for (int k = 0; k < n->waves && txp_fold_of(n, i) != left_out; k++) {
            const txp_wave *w = &q->guess->wave[k];
            const txp_sight *s = &n->sight[i][k];
            txp_form form;
            if (!(s->weight > 0)) continue;
            for (int d = 0; d < 2 && differences; d++) {
                const int j = d ? i + n->across : i + 1;
                if (d ? j >= n->across * n->down : j % n->across == 0) continue;
                const txp_sight *t = &n->sight[j][k];
                if (!(t->weight > 0) || txp_fold_of(n, j) == left_out) continue;
                form.count = 0;
                txp_form_phase(q, w, n->at[j], 1, &form);
                txp_form_phase(q, w, n->at[i], -1, &form);
                const double rest =
                    txp_rest(txp_still_beside(q, j, k, 1) - txp_still_beside(q, i, k, 1));
                const double r = rest / (2 * TXP_OUTLIER);
                txp_form_add(q, &form,
                             rest + txp_moves(q, w, n->at[j]) - txp_moves(q, w, n->at[i]),
                             s->weight * t->weight / (1 + r * r));
            }
            if (differences) continue;
            form.count = 0;
            txp_form_phase(q, w, n->at[i], 1, &form);
            const double rest = txp_rest(txp_still_beside(q, i, k, 1)), r = rest / TXP_OUTLIER;
            txp_form_add(q, &form, rest + txp_moves(q, w, n->at[i]),
                         s->weight * s->weight / (1 + r * r));
        }
    }
}

/* By how much each wave agrees, at the nodes of one part (-1: all), with what is fitted: sums of what
   agrees and of what there is are added. */
static void txp_waving_agree(const txp_waving *q, int part, int with_field, double sums[2][2]) {
    const txp_nodes *n = q->nodes;
    double sine, cosine;
    for (int i = 0; i < n->across * n->down; i++) {
        for (int k = 0; k < n->waves; k++) {
            if (part >= 0 && txp_fold_of(n, i) != part) continue;
            txm_sincos(2 * TXM_PI * txp_still_beside(q, i, k, with_field), &sine, &cosine);
            sums[k][0] += n->sight[i][k].weight * cosine;
            sums[k][1] += n->sight[i][k].weight;
        }
    }
}

/* The agreement of the wave that agrees least. */
static double txp_least_agreement(const txp_waving *q, double sums[2][2]) {
    double least = 1;
    for (int k = 0; k < q->nodes->waves; k++)
        least = fmin(least, sums[k][1] > 0 ? sums[k][0] / sums[k][1] : 0);
    return least;
}

/* Turn each wave so that what is left has the mean 0. */
static void txp_waving_turn(txp_waving *q, int left_out) {
    const txp_nodes *n = q->nodes;
    for (int k = 0; k < n->waves; k++) {
        double re = 0, im = 0, sine, cosine;
        for (int i = 0; i < n->across * n->down; i++) {
            if (txp_fold_of(n, i) == left_out) continue;
            txm_sincos(2 * TXM_PI * txp_still_beside(q, i, k, 1), &sine, &cosine);
            re += n->sight[i][k].weight * cosine;
            im += n->sight[i][k].weight * sine;
        }
        q->shift[k] += txp_turns(re, im);
    }
}

/* Fit the field; the nodes of one part are left out (-1: none). */
static void txp_waving_fit(txp_waving *q, double stiffness, int left_out) {
    memset(q->field.at, 0, sizeof q->field.at);
    q->shift[0] = q->shift[1] = 0;
    for (int round = 0; round < TXP_FIELD_FITS; round++) {
        txp_waving_collect(q, left_out, round < TXP_FIELD_FITS / 2);
        txp_stiffen(q, stiffness);
        txp_waving_solve(q);
        for (int i = 0; i < q->unknowns; i++) {
            double *at = q->field.at[i / q->parts];
            const double *toward = q->toward[i % q->parts];
            if (i % q->parts == 0) at[0] = at[1] = 0;
            for (int d = 0; d < 2; d++) at[d] += q->b[i] * toward[d];
        }
        txp_waving_turn(q, left_out);
    }
}

/* How well the parts agree that were left out in turn. */
static double txp_foresight(txp_waving *q, double stiffness) {
    double sums[2][2] = {{0, 0}, {0, 0}};
    for (int part = 0; part < 2; part++) {
        txp_waving_fit(q, stiffness, part);
        txp_waving_agree(q, part, 1, sums);
    }
    return txp_least_agreement(q, sums);
}

/* Is the field gentle all over the photograph? */
static int txp_is_gentle(const txp_swell *f) {
    enum { STEPS = 24 };
    for (int i = 0; i <= STEPS; i++) {
        for (int j = 0; j <= STEPS; j++) {
            double moved[2], m[4];
            txp_swell_at(f, (2.0 * i / (int)STEPS - 1) * f->reach_x,
                         (2.0 * j / (int)STEPS - 1) * f->reach_y, moved, m);
            for (int k = 0; k < 4; k++)
                if (!(fabs(m[k]) < TXP_STEEPEST)) return 0;
        }
    }
    return 1;
}

/* The stiffness with which a field predicts unseen nodes clearly better than none does, the stiffest
   unless a softer one is clearly better; 0: none. */
static double txp_best_stiffness(txp_waving *q) {
    double sums[2][2] = {{0, 0}, {0, 0}}, best = 0, stiffness = 0, tried = TXP_STIFFEST;
    txp_waving_agree(q, -1, 0, sums);
    const double before = txp_least_agreement(q, sums);
    if (1 - before < TXP_HELPS_LEAST) return 0;
    for (int i = 0; i < TXP_STIFFNESSES; i++, tried /= 4) {
        const double agreement = txp_foresight(q, tried);
        if (!(1 - agreement < TXP_SOFTER * (1 - best))) continue;
        best = agreement;
        stiffness = tried;
    }
    return best > TXP_FORESIGHT && 1 - best < TXP_HELPS * (1 - before) ? stiffness : 0;
}

/* Look for a field that helps; the guess was fitted without one. Then *field is it, the guess's view
   points to it and its waves are turned; if the second wave does not agree it is left out. *helps: is
   there one? 0: no memory. */
static int txp_find_field(txp_nodes *n, txm_env *env, txp_guess *g, txp_swell *field, int *helps) {
    txm_arena scratch;
    txp_waving q;
    txp_seeing seeing;
    double stiffness = 0;
    *helps = 0;
    seeing.nodes = n;
    seeing.guess = g;
    txp_clearer_first(g);
    txm_parallel_for(env, n->across * n->down, txp_see_node, &seeing);
    txm_arena_init(&scratch, env);
    for (; n->waves > 0; n->waves--) {
        if (!txp_waving_make(n, g, &scratch, &q)) {
            txm_arena_free(&scratch);
            return 0;
        }
        if (q.unknowns) stiffness = txp_best_stiffness(&q);
        if (stiffness > 0 || n->waves == 1) break;
    }
    for (int look = 0; look < TXP_FIELD_LOOKS && stiffness > 0; look++) {
        txp_waving_fit(&q, stiffness, -1);
        *field = q.field;
        g->view.field = field;
        for (int k = 0; k < n->waves; k++)
            g->wave[k].shift = txp_rest(g->wave[k].shift + q.shift[k]);
        txm_parallel_for(env, n->across * n->down, txp_see_node, &seeing);
    }
    *helps = stiffness > 0 && txp_is_gentle(field);
    txm_arena_free(&scratch);
    return 1;
}

/* ---- finding the pattern of a photograph --------------------------------------------------- */

/* ours, see docs/choices.md */
#define TXP_CLEAR_LEAST 0.72 /* agreement of the phases of the first wave, 0..1: else no pattern  */
#define TXP_SECOND_LEAST 0.6 /* the same of the second one: else it is left out                   */
#define TXP_CONTRAST 0.03    /* of a wave, 0..1, that counts half                                 */
#define TXP_CONVINCING 1.3   /* score from which on nothing else is tried                         */
#define TXP_LEAST_PERIODS 1.5 /* of a wave in half of the longer side                             */
#define TXP_FIELD_FROM 0.4   /* agreement from which on a field is looked for                    */
#define TXP_BEND_MOST 0.5    /* of a lens, |bend| and |curl|                                      */
#define TXP_LENS_HELPS 0.8   /* of the disagreement without a lens: if more is left, there is none */
#define TXP_FREQUENCY 0.2    /* cycles per pixel, at most, in the picture the phases are read from */

/* What is found: score 0: no pattern. */
typedef struct txp_sighting {
    txp_guess guess;
    int size;        /* the picture the phases are read from      */
    txp_swell field; /* that of the guess, if its view points to it */
} txp_sighting;

/* The smallest picture that shows all waves of a guess well. */
static int txp_size_for(const txp_gray *sizes, int count, const txp_guess *g) {
    double most = 0;
    for (int k = 0; k < 2; k++) {
        const txp_wave *w = &g->wave[k];
        if (w->clear > 0) most = fmax(most, w->a * w->a + w->b * w->b);
    }
    for (int i = count - 1; i > 0; i--) {
        const int longer = sizes[i].width > sizes[i].height ? sizes[i].width : sizes[i].height;
        if (most <= (TXP_FREQUENCY * longer / 2) * (TXP_FREQUENCY * longer / 2)) return i;
    }
    return 0;
}

/* How much a fitted guess is worth: agreement of its waves, weak ones less. 0: it is no pattern. */
static double txp_worth(const txp_nodes *n, txp_guess *g) {
    const txp_view *v = &g->view;
    double sum = 0;
    const double reach_x = 0.5 * n->gray->width / n->half, reach_y = 0.5 * n->gray->height / n->half;
    if (fabs(v->bend) > TXP_BEND_MOST || fabs(v->curl) > TXP_BEND_MOST) return 0;
    if (!(fabs(v->tilt_x) * reach_x + fabs(v->tilt_y) * reach_y < 0.95)) return 0;
    txp_clearer_first(g);
    const txp_wave *a = &g->wave[0], *b = &g->wave[1];
    const double cross = a->a * b->b - a->b * b->a;
    const double aa = a->a * a->a + a->b * a->b, bb = b->a * b->a + b->b * b->b;
    const double least = TXP_LEAST_PERIODS * TXP_LEAST_PERIODS;
    if (b->clear < TXP_SECOND_LEAST || bb < least ||
        cross * cross < TXP_APART * TXP_APART * aa * bb)
        g->wave[1].clear = 0;
    if (a->clear < TXP_CLEAR_LEAST || aa < least) return 0;
    for (int k = 0; k < 2; k++)
        sum += g->wave[k].clear * g->wave[k].clear * g->wave[k].contrast /
               (g->wave[k].contrast + TXP_CONTRAST);
    return sum;
}

/* Fit a guess, with a field where that helps, and judge it. 0: no memory. */
static int txp_fit_guess(txp_nodes *n, txm_env *env, txp_guess *g, txp_swell *field) {
    txp_guess wavy;
    int helps = 0;
    txp_fit_phases(n, env, 1, g);
    wavy = *g;
    g->score = txp_worth(n, g);
    if (!(fmax(wavy.wave[0].clear, wavy.wave[1].clear) >= TXP_FIELD_FROM)) return 1;
    if (!txp_find_field(n, env, &wavy, field, &helps)) return 0;
    if (!helps) return 1;
    txp_measure(n, &wavy);
    wavy.score = txp_worth(n, &wavy);
    if (wavy.score > g->score) *g = wavy;
    return 1;
}

/* Try the guesses of one scale. 0: no memory. */
static int txp_try_scale(const txp_gray *sizes, int count, int at, int side, txm_env *env,
                         txp_sighting *best) {
    txm_arena scratch;
    txp_spectra spectra;
    txp_guess offers[TXP_OFFERS];
    txm_arena_init(&scratch, env);
    int done = txp_spectra_make(&sizes[at], side, &scratch, env, &spectra);
    if (done) txp_search_view(&spectra, env, offers);
    for (int k = 0; k < TXP_OFFERS && done; k++) {
        txp_nodes nodes;
        txp_swell field;
        txp_guess g = offers[k];
        if (!(g.score > 0) || best->guess.score >= TXP_CONVINCING) break;
        const int size = txp_size_for(sizes, count, &g);
        done = txp_nodes_make(&sizes[size], &scratch, &nodes) &&
               txp_fit_guess(&nodes, env, &g, &field);
        if (!done) break;
        if (g.score > best->guess.score) {
            best->guess = g;
            best->size = size;
            if (g.view.field) best->field = field;
        }
    }
    txm_arena_free(&scratch);
    return done;
}

/* Where stones are laid unevenly a lens always explains some of it: without need there is none.
   0: no memory. */
static int txp_doubt_lens(const txp_gray *sizes, txm_env *env, txp_sighting *found) {
    txm_arena scratch;
    txp_nodes nodes;
    txp_guess flat = found->guess;
    txm_arena_init(&scratch, env);
    const int done = txp_nodes_make(&sizes[found->size], &scratch, &nodes);
    if (done) {
        double with = 0, without = 0;
        flat.view.bend = flat.view.curl = 0;
        txp_fit_phases(&nodes, env, 0, &flat);
        for (int k = 0; k < nodes.waves; k++) {
            with += 1 - found->guess.wave[k].clear;
            without += 1 - flat.wave[k].clear;
        }
        const double score = txp_worth(&nodes, &flat);
        if (score > 0 && with > TXP_LENS_HELPS * without) {
            found->guess = flat;
            found->guess.score = score;
        }
    }
    txm_arena_free(&scratch);
    return done;
}

/* The view and the waves of a photograph; sizes: its evened pictures. The view's field is that of
   *found. */
static txm_status txp_find_pattern(const txp_gray *sizes, int count, txm_env *env,
                                   txp_sighting *found) {
    memset(found, 0, sizeof *found);
    for (int at = count - 1; at >= 0; at--) {
        const txp_gray *g = &sizes[at];
        const int least = g->width < g->height ? g->width : g->height;
        for (int side = TXP_WINDOW_SIDE; side >= TXP_WINDOW_SIDE / 4; side /= 2) {
            /* small windows only where large ones would be too few */
            if (least < side || (side < TXP_WINDOW_SIDE && least > 4 * side)) continue;
            if (found->guess.score >= TXP_CONVINCING) break;
            if (txm_progress(env, 0.5f * (float)(count - at) / (float)(count + 1), "lattice"))
                return txm_fail(env, TXM_CANCELLED, "cancelled");
            if (!txp_try_scale(sizes, count, at, side, env, found))
                return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the lattice");
        }
    }
    if (found->guess.view.field) found->guess.view.field = &found->field;
    else if (found->guess.score > 0 && !txp_doubt_lens(sizes, env, found))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the lattice");
    return TXM_OK;
}

/* ---- the upright frame of a pattern -------------------------------------------------------- */

/* Which way is up, how wide a brick is and where the picture ends. The plane (X, Y) of a view still
   lacks an affine map: its stretch follows from the tilt and the focal length, its turn and shear
   from the edges in the picture, which in masonry, tiles, planks and cloth have two directions. */

/* ours, see docs/choices.md */
enum {
    TXP_DIRECTIONS = 360, /* of edges: half a degree each                                        */
    TXP_BLURRED = 4,      /* of them to each side are one direction                              */
    TXP_BLURS = 2,        /* of 3 x 3 pixels before edges are looked for                         */
    TXP_SNAP = 2,         /* an edge is along a wave within so many                              */
    TXP_SQUARE_LEAST = 2, /* the second axis is within so many of the normal of the first ...    */
    TXP_SQUARE_MOST = 40, /* ... or, in a tilted view, so many                                   */
    TXP_FIELD_ROUNDS = 6, /* of the search for the place that a field moves                       */
    TXP_CELLS = 72,       /* cells along the sides of the plane when the frame is chosen         */
    TXP_EDGES_FROM = 300  /* pixels: longer side of the picture whose edges are looked at        */
};
#define TXP_FOCAL 0.85      /* longer sides: of a camera of which nothing is known               */
#define TXP_SQUARE_TILTED 80 /* directions for each unit by which the stretch is uncertain        */
#define TXP_FOCAL_RANGE 1.7 /* it is between this part and so many times as long                  */
#define TXP_WAVE_EDGES 0.6  /* of the most edges: with so many along it a wave is an axis         */
#define TXP_UPRIGHT 0.8     /* edges of this part do not count if they lie at 45 degrees          */
#define TXP_SIMPLE 0.25     /* what each wave in a sum costs, of its edges                        */
#define TXP_CLEAR_EDGES 1.4 /* of the mean: a direction with so many edges is one               */
#define TXP_FAR_SIDE 0.3    /* of the scale in the middle: what is smaller is cut off           */

/* From the plane (X, Y) to the frame, x = xx X + xy Y + x0, and back to the photograph. */
typedef struct txp_frame {
    txp_view view;
    double xx, xy, yx, yy;  /* to the frame, in half sides of the photograph                     */
    double left, top, scale; /* of the output: pixels = (x - left) scale                         */
    int width, height;
    double half, middle_x, middle_y; /* of the photograph, in its pixels                          */
} txp_frame;

/* A blurred copy of a gray picture, in which noise and the blocks of JPEG have fewer edges. 0: no
   memory. */
static int txp_blur(const txp_gray *from, txm_arena *arena, txp_gray *to) {
    const size_t count = (size_t)from->width * (size_t)from->height;
    float *copy = (float *)txm_arena_alloc(arena, count, sizeof *copy);
    double *sums = (double *)txm_arena_alloc(arena, (size_t)from->width, sizeof *sums);
    if (!txp_gray_new(to, from->width, from->height, arena)) return 0;
    memcpy(to->at, from->at, count * sizeof *to->at);
    memcpy(to->known, from->known, count * sizeof *to->known);
    for (int i = 0; i < TXP_BLURS; i++)
        txp_box_sums(to->at, from->width, from->height, 1, sums, copy);
    return 1;
}

/* The histogram of the directions of edges on the plane, as bins of half turns; s: the stretch. */
static void txp_edge_directions(const txp_gray *g, const txp_view *v, const double s[4],
                                double *bins) {
    double sums[TXP_DIRECTIONS] = {0};
    const double half = 0.5 * (g->width > g->height ? g->width : g->height);
    const double det_s = s[0] * s[3] - s[1] * s[2];
    for (int y = 1; y + 1 < g->height; y++) {
        const float *row = g->at + (size_t)y * (size_t)g->width;
        const float *known = g->known + (size_t)y * (size_t)g->width;
        for (int x = 1; x + 1 < g->width; x++) {
            double place[2], m[4];
            if (known[x] < 1) continue;
            /* Scharr's derivatives, whose direction is right */
            const float *t = row + x - g->width, *b = row + x + g->width;
            const double gx = 3 * ((double)t[1] - (double)t[-1] + (double)b[1] - (double)b[-1]) +
                              10 * ((double)row[x + 1] - (double)row[x - 1]);
            const double gy = 3 * ((double)b[1] - (double)t[1] + (double)b[-1] - (double)t[-1]) +
                              10 * ((double)b[0] - (double)t[0]);
            if (!txp_view_place(v, (x + 0.5 - 0.5 * g->width) / half,
                                (y + 0.5 - 0.5 * g->height) / half, place, m))
                continue;
            const double det = m[0] * m[3] - m[1] * m[2];
            const double px = (m[3] * gx - m[2] * gy) / det, py = (m[0] * gy - m[1] * gx) / det;
            const double qx = (s[3] * px - s[2] * py) / det_s;
            const double qy = (s[0] * py - s[1] * px) / det_s;
            double turn = 2 * txp_turns(qx, qy); /* opposite directions are one */
            turn -= floor(turn);
            /* squared once more, so that noise counts less than lines */
            const double strength = gx * gx + gy * gy;
            sums[(int)(turn * (int)TXP_DIRECTIONS) % TXP_DIRECTIONS] += strength * strength;
        }
    }
    for (int i = 0; i < TXP_DIRECTIONS; i++) {
        bins[i] = 0;
        for (int d = -TXP_BLURRED; d <= TXP_BLURRED; d++)
            bins[i] += (TXP_BLURRED + 1 - abs(d)) *
                       sums[(i + d + TXP_DIRECTIONS) % TXP_DIRECTIONS];
    }
}

/* The bin of most edges within reach of a bin, with the fraction by a parabola. */
static double txp_edge_peak(const double *bins, int middle, int reach, double *height) {
    int best = middle;
    for (int d = -reach; d <= reach; d++) {
        const int i = (middle + d + 2 * TXP_DIRECTIONS) % TXP_DIRECTIONS;
        if (bins[i] > bins[best]) best = i;
    }
    const double l = bins[(best + TXP_DIRECTIONS - 1) % TXP_DIRECTIONS];
    const double r = bins[(best + 1) % TXP_DIRECTIONS], c = bins[best];
    *height = c;
    return best + 0.5 + (l + r < 2 * c ? 0.5 * (l - r) / (l + r - 2 * c) : 0);
}

/* The direction of a vector as a bin. */
static double txp_direction_of(double x, double y) {
    const double turn = 2 * txp_turns(x, y);
    return (turn - floor(turn)) * (int)TXP_DIRECTIONS;
}

static double txp_bins_apart(double a, double b) {
    const double d = fabs(a - b);
    return fmin(d, (int)TXP_DIRECTIONS - d);
}

/* The plane's stretch by which distances become those of the wall: it was seen from the side. */
static void txp_stretch(const txp_view *v, double focal, double s[4], double *stretch) {
    const double tt = v->tilt_x * v->tilt_x + v->tilt_y * v->tilt_y;
    *stretch = sqrt(1 + 4 * focal * focal * tt);
    const double part = tt > 0 ? (*stretch - 1) / tt : 0;
    s[0] = 1 + part * v->tilt_x * v->tilt_x;
    s[1] = s[2] = part * v->tilt_x * v->tilt_y;
    s[3] = 1 + part * v->tilt_y * v->tilt_y;
}

/* Among the waves and simple sums of both: the one within reach of a direction along which most
   edges lie, simple ones first. Returns how many edges; *direction is left alone if there is none. */
static double txp_wave_direction(const txp_guess *g, const double s[4], const double *bins,
                                 double reach, double *direction) {
    const double det = s[0] * s[3] - s[1] * s[2], middle = *direction;
    const txp_wave *w = g->wave;
    double most = 0, edges = 0;
    const int last = w[1].clear > 0 ? 2 : 0;
    for (int i = 0; i <= 2; i++) {
        for (int j = -last; j <= last; j++) {
            const double a = i * w[0].a + j * w[1].a, b = i * w[0].b + j * w[1].b;
            const int terms = i + abs(j);
            if (!(a * a + b * b > 0) || terms > 3) continue;
            const double to =
                txp_direction_of((s[3] * a - s[2] * b) / det, (s[0] * b - s[1] * a) / det);
            if (txp_bins_apart(to, middle) > reach) continue;
            const double height = bins[(int)to % TXP_DIRECTIONS];
            if (!(height * (1 - TXP_SIMPLE * terms) > most)) continue;
            most = height * (1 - TXP_SIMPLE * terms);
            edges = height;
            *direction = to;
        }
    }
    return edges;
}

/* The two axes of a pattern, as directions across its edges; s: the stretch. */
static void txp_find_axes(const txp_gray *g, const txp_guess *guess, double focal, double s[4],
                          double axes[2]) {
    double bins[TXP_DIRECTIONS], mean = 0, height, unused[4], shorter, longer, stretch;
    txp_stretch(&guess->view, focal / TXP_FOCAL_RANGE, unused, &shorter);
    txp_stretch(&guess->view, focal * TXP_FOCAL_RANGE, unused, &longer);
    txp_stretch(&guess->view, focal, s, &stretch);
    txp_edge_directions(g, &guess->view, s, bins);
    for (int i = 0; i < TXP_DIRECTIONS; i++) {
        /* who photographs a wall holds the camera nearly upright */
        const double off = fmin(fmin(i, TXP_DIRECTIONS - i), abs(i - TXP_DIRECTIONS / 2));
        bins[i] *= 1 - TXP_UPRIGHT * off / (0.25 * (int)TXP_DIRECTIONS);
        mean += bins[i] / (int)TXP_DIRECTIONS;
    }
    axes[0] = txp_edge_peak(bins, 0, TXP_DIRECTIONS / 2, &height);
    double wave = axes[0];
    const double edges = txp_wave_direction(guess, s, bins, TXP_DIRECTIONS, &wave);
    if (edges > TXP_WAVE_EDGES * height || height < TXP_CLEAR_EDGES * mean) axes[0] = wave;
    /* the focal length is a guess: in a tilted view the other axis need not be the normal */
    double normal = axes[0] + 0.5 * (int)TXP_DIRECTIONS;
    if (normal >= (int)TXP_DIRECTIONS) normal -= (int)TXP_DIRECTIONS;
    const int reach =
        (int)fmin((int)TXP_SQUARE_LEAST + TXP_SQUARE_TILTED * (longer / shorter - 1),
                  TXP_SQUARE_MOST);
    axes[1] = txp_edge_peak(bins, (int)normal, reach, &height);
    if (height < TXP_CLEAR_EDGES * mean) axes[1] = normal;
    wave = normal;
    if (txp_wave_direction(guess, s, bins, reach + TXP_SNAP, &wave) > TXP_WAVE_EDGES * height)
        axes[1] = wave;
}

/* The frame whose axes these are: x is the one that is nearer to the rows of the photograph. */
static void txp_set_axes(const double s[4], const double axes[2], txp_frame *f) {
    double rows[2][2];
    for (int k = 0; k < 2; k++) {
        double sine, cosine;
        txm_sincos(TXM_PI * axes[k] / (int)TXP_DIRECTIONS, &sine, &cosine);
        rows[k][0] = cosine * s[0] + sine * s[2];
        rows[k][1] = cosine * s[1] + sine * s[3];
    }
    const double as_they_are = fabs(rows[0][0] * rows[1][1]);
    const int first = as_they_are >= fabs(rows[0][1] * rows[1][0]) ? 0 : 1;
    const double sx = rows[first][0] < 0 ? -1 : 1, sy = rows[1 - first][1] < 0 ? -1 : 1;
    f->xx = sx * rows[first][0];
    f->xy = sx * rows[first][1];
    f->yx = sy * rows[1 - first][0];
    f->yy = sy * rows[1 - first][1];
}

/* ---- from the frame to the photograph ------------------------------------------------------ */

/* Undo the lens: the radius of which lens(radius) is r. */
static double txp_undo_lens(const txp_view *v, double r) {
    double p = r;
    for (int i = 0; i < 12; i++) {
        const double pp = p * p, value = p * (1 + pp * (v->bend + pp * v->curl)) - r;
        const double slope = 1 + pp * (3 * v->bend + 5 * pp * v->curl);
        if (!(slope > 0.02)) return -1;
        p -= value / slope;
    }
    return p;
}

/* The place of the photograph at (ux, uy) of the plane, by tilt and lens alone. 0: there is none. */
static int txp_seen_at(const txp_view *v, double ux, double uy, double *px, double *py) {
    const double depth = 1 - v->tilt_x * ux - v->tilt_y * uy;
    if (!(depth > 0.05)) return 0;
    const double qx = ux / depth, qy = uy / depth, r = sqrt(qx * qx + qy * qy);
    if (r > 3) return 0;
    const double p = txp_undo_lens(v, r);
    if (!(p >= 0) || !(p < 3)) return 0;
    *px = r > 0 ? qx * p / r : 0;
    *py = r > 0 ? qy * p / r : 0;
    return 1;
}

/* The place of the photograph, in half sides from its middle, at (x, y) of the frame; m: its
   derivatives by x and y. 0: there is none. */
static int txp_frame_place(const txp_frame *f, double x, double y, double *px, double *py,
                           double m[4]) {
    const txp_view *v = &f->view;
    const double det = f->xx * f->yy - f->xy * f->yx;
    const double ux = (f->yy * x - f->xy * y) / det, uy = (f->xx * y - f->yx * x) / det;
    double place[2], k[4];
    if (!txp_seen_at(v, ux, uy, px, py)) return 0;
    /* a field changes slowly: from here its displacement is nearly the one that is meant */
    for (int i = 0; i < TXP_FIELD_ROUNDS && v->field; i++) {
        txp_swell_at(v->field, *px, *py, place, k);
        if (!txp_seen_at(v, ux - place[0], uy - place[1], px, py)) return 0;
    }
    if (!txp_view_place(v, *px, *py, place, k)) return 0;
    /* frame by photograph, inverted */
    const double a = f->xx * k[0] + f->xy * k[2], b = f->xx * k[1] + f->xy * k[3];
    const double c = f->yx * k[0] + f->yy * k[2], d = f->yx * k[1] + f->yy * k[3];
    const double whole = a * d - b * c;
    if (!(fabs(whole) > 1e-9)) return 0;
    m[0] = d / whole;
    m[1] = -b / whole;
    m[2] = -c / whole;
    m[3] = a / whole;
    return 1;
}

/* ---- the rectangle -------------------------------------------------------------------------- */

/* Sums over all cells above and to the left. */
typedef struct txp_survey {
    double inside[TXP_CELLS + 1][TXP_CELLS + 1];
    int outside[TXP_CELLS + 1][TXP_CELLS + 1];
    double scale[TXP_CELLS][TXP_CELLS];
} txp_survey;

/* The box of the frame that holds the photograph. */
static void txp_frame_box(const txp_frame *f, double reach_x, double reach_y, double box[4]) {
    enum { STEPS = 48 };
    box[0] = box[1] = 1e30;
    box[2] = box[3] = -1e30;
    for (int i = 0; i <= STEPS; i++) {
        for (int j = 0; j <= STEPS; j++) {
            double place[2], m[4];
            if (!txp_view_place(&f->view, (2.0 * i / (int)STEPS - 1) * reach_x,
                                (2.0 * j / (int)STEPS - 1) * reach_y, place, m))
                continue;
            /* what is too far away to be seen well is cut off */
            const double size = m[0] * m[3] - m[1] * m[2];
            if (!(size * TXP_FAR_SIDE * TXP_FAR_SIDE < 1)) continue;
            const double x = f->xx * place[0] + f->xy * place[1];
            const double y = f->yx * place[0] + f->yy * place[1];
            box[0] = fmin(box[0], x);
            box[1] = fmin(box[1], y);
            box[2] = fmax(box[2], x);
            box[3] = fmax(box[3], y);
        }
    }
}

/* The upright rectangle that shows most of the photograph and nothing beyond it: part of the box. */
static int txp_frame_rectangle(const txp_frame *f, double reach_x, double reach_y,
                               const double box[4], txp_survey *c, int best[4]) {
    double most = 0;
    memset(c, 0, sizeof *c);
    for (int y = 0; y < TXP_CELLS; y++) {
        for (int x = 0; x < TXP_CELLS; x++) {
            double px = 0, py = 0, m[4] = {0, 0, 0, 0};
            const double fx = box[0] + (box[2] - box[0]) * (x + 0.5) / (int)TXP_CELLS;
            const double fy = box[1] + (box[3] - box[1]) * (y + 0.5) / (int)TXP_CELLS;
            const int is_in = txp_frame_place(f, fx, fy, &px, &py, m) && fabs(px) <= reach_x &&
                              fabs(py) <= reach_y;
            const double size = is_in ? fabs(m[0] * m[3] - m[1] * m[2]) : 0;
            c->scale[y][x] = sqrt(size);
            c->inside[y + 1][x + 1] =
                size + c->inside[y][x + 1] + c->inside[y + 1][x] - c->inside[y][x];
            c->outside[y + 1][x + 1] =
                !is_in + c->outside[y][x + 1] + c->outside[y + 1][x] - c->outside[y][x];
        }
    }
    for (int y0 = 0; y0 < TXP_CELLS; y0++) {
        for (int y1 = y0 + 1; y1 <= TXP_CELLS; y1++) {
            for (int x0 = 0; x0 < TXP_CELLS; x0++) {
                for (int x1 = x0 + 1; x1 <= TXP_CELLS; x1++) {
                    if (c->outside[y1][x1] - c->outside[y0][x1] - c->outside[y1][x0] +
                        c->outside[y0][x0])
                        break;
                    const double sum = c->inside[y1][x1] - c->inside[y0][x1] - c->inside[y1][x0] +
                                       c->inside[y0][x0];
                    if (sum <= most) continue;
                    most = sum;
                    best[0] = x0;
                    best[1] = y0;
                    best[2] = x1;
                    best[3] = y1;
                }
            }
        }
    }
    return most > 0;
}

/* Choose rectangle and resolution: as fine as the photograph is anywhere in the rectangle, but not
   more than twice its pixels. 0: nothing is left. */
static int txp_frame_choose(txp_frame *f, int width, int height, txp_survey *c) {
    double box[4], finest = 0;
    int best[4] = {0, 0, 0, 0};
    f->half = 0.5 * (width > height ? width : height);
    f->middle_x = 0.5 * width;
    f->middle_y = 0.5 * height;
    const double reach_x = (f->middle_x - 0.5) / f->half, reach_y = (f->middle_y - 0.5) / f->half;
    txp_frame_box(f, reach_x, reach_y, box);
    if (!(box[2] > box[0] && box[3] > box[1]) ||
        !txp_frame_rectangle(f, reach_x, reach_y, box, c, best))
        return 0;
    for (int y = best[1]; y < best[3]; y++)
        for (int x = best[0]; x < best[2]; x++) finest = fmax(finest, c->scale[y][x]);
    const double step_x = (box[2] - box[0]) / (int)TXP_CELLS, step_y = (box[3] - box[1]) / (int)TXP_CELLS;
    /* middles of the outermost cells are inside for certain */
    const double w = (best[2] - best[0] - 1) * step_x, h = (best[3] - best[1] - 1) * step_y;
    f->left = box[0] + (best[0] + 0.5) * step_x;
    f->top = box[1] + (best[1] + 0.5) * step_y;
    f->scale = finest * f->half;
    const double most = 2.0 * width * height;
    if (w * h * f->scale * f->scale > most) f->scale = sqrt(most / (w * h));
    f->width = (int)floor(w * f->scale);
    f->height = (int)floor(h * f->scale);
    return f->width >= 1 && f->height >= 1;
}

/* ---- a rectangle of whole periods ----------------------------------------------------------- */

/* Along a side that is a whole number of periods long the phases of all waves come back, and what
   lies there shows the same pattern again. Waves may be harmonics, so phases alone do not tell. */

/* ours, see docs/choices.md */
enum {
    TXP_LOOK_SIDE = 256, /* pixels of the longer side of the picture that is compared with itself */
    TXP_LOOK_LEAST = 3,  /* the result is at least this part of a side ...                        */
    TXP_LOOK_BOTH = 6    /* ... and at least this part of it lies beyond the result               */
};
#define TXP_ALIKE_PART 0.8   /* of the range of likeness, and ...                                     */
#define TXP_ALIKE_MOST 0.87  /* ... of the most: a side where it is more may be whole                 */
#define TXP_PHASE_BACK 0.08  /* turns by which the phase of a wave may differ after a whole side      */
#define TXP_WHOLE_WAVES 3.0  /* of one wave along a side, at least: fewer say nothing                 */
#define TXP_ALIKE_ALONE 0.5  /* likeness, and its range, at least, where no wave tells of a period    */

typedef struct txp_look {
    int width, height;
    double step; /* of the frame, from one pixel to the next */
    float at[TXP_LOOK_SIDE * TXP_LOOK_SIDE];
    double alike[TXP_LOOK_SIDE + 1];
} txp_look;

/* The gray picture at a place of the photograph, between its pixels. */
static double txp_gray_at(const txp_gray *g, double x, double y) {
    const double half = 0.5 * (g->width > g->height ? g->width : g->height);
    const double px = fmin(fmax(x * half + 0.5 * g->width - 0.5, 0), g->width - 1);
    const double py = fmin(fmax(y * half + 0.5 * g->height - 0.5, 0), g->height - 1);
    const int i = txm_clampi((int)px, 0, g->width > 1 ? g->width - 2 : 0);
    const int j = txm_clampi((int)py, 0, g->height > 1 ? g->height - 2 : 0);
    const float *a = g->at + (size_t)j * (size_t)g->width + i;
    const float *b = g->height > 1 ? a + g->width : a;
    const int right = g->width > 1;
    const double u = px - i, v = py - j;
    return (1 - v) * ((1 - u) * (double)a[0] + u * (double)a[right]) +
           v * ((1 - u) * (double)b[0] + u * (double)b[right]);
}

/* The straight picture, small. */
static void txp_look_make(const txp_frame *f, const txp_gray *g, txp_look *k) {
    const int longer = f->width > f->height ? f->width : f->height;
    const double wide = f->width / f->scale, high = f->height / f->scale;
    k->step = longer / f->scale / (int)TXP_LOOK_SIDE;
    k->width = txm_clampi((int)(wide / k->step), 1, TXP_LOOK_SIDE);
    k->height = txm_clampi((int)(high / k->step), 1, TXP_LOOK_SIDE);
    for (int y = 0; y < k->height; y++) {
        for (int x = 0; x < k->width; x++) {
            double px = 0, py = 0, m[4];
            const int is_seen = txp_frame_place(f, f->left + (x + 0.5) * k->step,
                                                f->top + (y + 0.5) * k->step, &px, &py, m);
            k->at[y * k->width + x] = is_seen ? txm_float(txp_gray_at(g, px, py)) : 0;
        }
    }
}

/* How much the picture is like itself, moved along a side: -1..1. */
static double txp_look_alike(const txp_look *k, int is_down, int by) {
    const int dx = is_down ? 0 : by, dy = is_down ? by : 0;
    double ab = 0, aa = 0, bb = 0;
    for (int y = 0; y + dy < k->height; y++) {
        for (int x = 0; x + dx < k->width; x++) {
            const double a = (double)k->at[y * k->width + x];
            const double b = (double)k->at[(y + dy) * k->width + x + dx];
            ab += a * b;
            aa += a * a;
            bb += b * b;
        }
    }
    return aa > 0 && bb > 0 ? ab / sqrt(aa * bb) : 0;
}

/* A length near `length` after which the phases of all waves come back; 0: there is none.
   turns: of each wave, per unit of the frame. */
static double txp_phases_back(const double turns[2], double length) {
    const double squares = turns[0] * turns[0] + turns[1] * turns[1];
    double off = 0;
    for (int k = 0; k < 2; k++) off += turns[k] * txp_rest(turns[k] * length);
    length -= off / squares;
    for (int k = 0; k < 2; k++)
        if (fabs(txp_rest(turns[k] * length)) > TXP_PHASE_BACK) return 0;
    return length;
}

/* The longest side of whole periods, in the frame; 0: nothing repeats along it. */
static double txp_whole_side(const txp_guess *g, const txp_frame *f, txp_look *k, int is_down) {
    const int side = is_down ? k->height : k->width;
    const int from = side / TXP_LOOK_LEAST, to = side - side / TXP_LOOK_BOTH;
    const double det = f->xx * f->yy - f->xy * f->yx;
    double turns[2] = {0, 0}, waves = 0, most = -1, least = 1;
    for (int i = 0; i < 2; i++) {
        const txp_wave *w = &g->wave[i];
        if (!(w->clear > 0)) continue;
        turns[i] = is_down ? (f->xx * w->b - f->xy * w->a) / det : (f->yy * w->a - f->yx * w->b) / det;
        waves = fmax(waves, fabs(turns[i]) * side * k->step);
    }
    const int is_alone = waves < TXP_WHOLE_WAVES;
    for (int i = from - 1; i <= to + 1; i++) {
        if (i < 0 || i > side) return 0;
        k->alike[i] = txp_look_alike(k, is_down, i);
        most = fmax(most, k->alike[i]);
        least = fmin(least, k->alike[i]);
    }
    if (is_alone && (most < TXP_ALIKE_ALONE || most - least < TXP_ALIKE_ALONE)) return 0;
    for (int i = to; i >= from; i--) {
        const double l = k->alike[i - 1], c = k->alike[i], r = k->alike[i + 1];
        if (c < l || c < r || c < TXP_ALIKE_MOST * most) continue;
        if (c < least + TXP_ALIKE_PART * (most - least)) continue;
        const double top = l + r < 2 * c ? 0.5 * (l - r) / (l + r - 2 * c) : 0;
        const double by = (i + top) * k->step;
        const double length = is_alone ? by : txp_phases_back(turns, by);
        if (length > 0) return length;
    }
    return 0;
}

/* Cut the rectangle to whole periods. Returns 1 if along x, 2 if along y, 3 if along both. */
static int txp_frame_whole(const txp_guess *g, const txp_gray *gray, txp_frame *f, txp_look *k) {
    int which = 0;
    txp_look_make(f, gray, k);
    const double wide = txp_whole_side(g, f, k, 0), high = txp_whole_side(g, f, k, 1);
    /* stretched a little, so that the side is whole pixels, too */
    if (wide * f->scale >= 1) {
        which |= 1;
        f->width = (int)floor(wide * f->scale + 0.5);
        const double stretch = f->width / (wide * f->scale);
        f->xx *= stretch;
        f->xy *= stretch;
        f->left *= stretch;
    }
    if (high * f->scale >= 1) {
        which |= 2;
        f->height = (int)floor(high * f->scale + 0.5);
        const double stretch = f->height / (high * f->scale);
        f->yx *= stretch;
        f->yy *= stretch;
        f->top *= stretch;
    }
    return which;
}

/* ---- drawing a photograph from straight in front ------------------------------------------- */

struct texpatch_straight {
    txm_arena memory; /* holds this block, too */
    int found, whole;
    int photo_width, photo_height;
    txp_frame frame;
    txp_swell field; /* that of the frame's view, if it points to it */
    double clear;
};

/* ours, see docs/choices.md */
enum {
    TXP_ROWS = 32,       /* of the result, drawn between two reports of progress                 */
    TXP_STRIDE = 16,     /* pixels of a row from one exact position to the next; linear between  */
    TXP_MOST_SAMPLES = 4 /* across and down, of one pixel, where the picture shrinks             */
};
#define TXP_SHRINKING 1.3 /* pixels of the photograph per pixel, from which on more are taken     */

/* Where a pixel of the result lies in the photograph; m: pixels per pixel. */
static int txp_straight_at(const txp_frame *f, double x, double y, double *px, double *py,
                           double m[4]) {
    if (!txp_frame_place(f, f->left + (x + 0.5) / f->scale, f->top + (y + 0.5) / f->scale, px, py, m))
        return 0;
    *px = *px * f->half + f->middle_x - 0.5;
    *py = *py * f->half + f->middle_y - 0.5;
    for (int i = 0; i < 4; i++) m[i] *= f->half / f->scale;
    return 1;
}

typedef struct txp_rectifying {
    const txp_frame *frame;
    const txm_image *image, *out;
    texpatch_map kind;
    int first; /* row */
} txp_rectifying;

/* 4 x 4 pixels of a picture, from where they begin in its rows, and their weights. */
typedef struct txp_patch {
    const void *row[4];
    size_t at[4];
    double wx[4], wy[4];
} txp_patch;

/* Add them to sum: all channels, weighted by the last if it is alpha. sample, n and has_alpha are
   constants where it is called, so that each kind of picture has its own loop. */
static inline void txp_add_patch(const txp_patch *p, txm_sample sample, int n, int has_alpha, double *sum) {
    double total[4];
    for (int c = 0; c < n; c++) total[c] = sum[c];
    for (int j = 0; j < 4; j++) {
        for (int i = 0; i < 4; i++) {
            const double w = p->wx[i] * p->wy[j];
            const size_t at = p->at[i];
            if (has_alpha) {
                const double alpha =
                    w * (double)txm_sample_code(p->row[j], sample, at + (size_t)n - 1);
                for (int c = 0; c < n - 1; c++)
                    total[c] += alpha * (double)txm_sample_code(p->row[j], sample, at + (size_t)c);
                total[n - 1] += alpha;
            } else {
                for (int c = 0; c < n; c++)
                    total[c] += w * (double)txm_sample_code(p->row[j], sample, at + (size_t)c);
            }
        }
    }
    for (int c = 0; c < n; c++) sum[c] = total[c];
}

/* The same for a type of samples. */
static inline void txp_add_kind(const txp_patch *p, txm_sample sample, int n, int has_alpha, double *sum) {
    if (n == 3) txp_add_patch(p, sample, 3, 0, sum);
    else if (n == 4 && has_alpha) txp_add_patch(p, sample, 4, 1, sum);
    else if (n == 1) txp_add_patch(p, sample, 1, 0, sum);
    else txp_add_patch(p, sample, n, has_alpha, sum);
}

/* Add a sample at (x, y), between pixels, to sum. */
static void txp_add_cubic(const txm_image *im, double x, double y, int has_alpha, double *sum) {
    const double fx = floor(x), fy = floor(y);
    const int x0 = (int)fx - 1, y0 = (int)fy - 1, n = im->channels;
    txp_patch p;
    txp_cubic(x - fx, p.wx);
    txp_cubic(y - fy, p.wy);
    for (int i = 0; i < 4; i++) {
        p.at[i] = (size_t)txm_clampi(x0 + i, 0, im->width - 1) * (size_t)n;
        p.row[i] = (const char *)im->pixels +
                   im->stride * (ptrdiff_t)txm_clampi(y0 + i, 0, im->height - 1);
    }
    if (im->sample == TXM_U8) txp_add_kind(&p, TXM_U8, n, has_alpha, sum);
    else if (im->sample == TXM_U16) txp_add_kind(&p, TXM_U16, n, has_alpha, sum);
    else txp_add_kind(&p, TXM_F32, n, has_alpha, sum);
}

/* Turn a normal with the picture: by the rotation that is nearest to the map m. */
static void txp_rectify_normal(const txp_rectifying *q, const double m[4], float *v) {
    const double a = m[0] + m[3], b = m[2] - m[1], axes[4] = {a, b, -b, a};
    if (a != 0 || b != 0) txm_normal_turn(axes, q->kind.is_normal == 2, q->image->sample, v);
}

/* One pixel of the result, whose middle lies at (px, py) of the photograph. */
static void txp_rectify_pixel(const txp_rectifying *q, double px, double py, const double m[4],
                              int samples, float *v) {
    const txm_image *im = q->image;
    const int n = im->channels, has_alpha = !q->kind.is_data && (n == 2 || n == 4);
    const double unit = im->sample == TXM_U8 ? 255 : im->sample == TXM_U16 ? 65535 : 1;
    double sum[4] = {0, 0, 0, 0};
    if (q->kind.is_label) {
        const int x = txm_clampi((int)floor(px + 0.5), 0, im->width - 1);
        const int y = txm_clampi((int)floor(py + 0.5), 0, im->height - 1);
        for (int c = 0; c < n; c++) v[c] = txm_image_get(im, x, y, c);
        return;
    }
    for (int j = 0; j < samples; j++) {
        for (int i = 0; i < samples; i++) {
            const double u = (i + 0.5) / samples - 0.5, t = (j + 0.5) / samples - 0.5;
            txp_add_cubic(im, px + m[0] * u + m[1] * t, py + m[2] * u + m[3] * t, has_alpha, sum);
        }
    }
    if (has_alpha) {
        const double alpha = sum[n - 1];
        for (int c = 0; c < n - 1; c++)
            v[c] = alpha > 0 ? txm_float(sum[c] / alpha / unit) : 0;
        v[n - 1] = txm_float(alpha / (samples * samples * unit));
    } else {
        for (int c = 0; c < n; c++) v[c] = txm_float(sum[c] / (samples * samples * unit));
    }
    if (q->kind.is_normal) txp_rectify_normal(q, m, v);
}

static void txp_rectify_row(void *context, int row) {
    const txp_rectifying *q = (const txp_rectifying *)context;
    const txm_image *out = q->out;
    const int y = q->first + row;
    double x0 = 0, y0 = 0, x1 = 0, y1 = 0, m[4] = {1, 0, 0, 1}, ahead[4] = {1, 0, 0, 1};
    int samples = 1;
    txp_straight_at(q->frame, 0, y, &x1, &y1, ahead);
    for (int x = 0; x < out->width; x++) {
        float v[4] = {0, 0, 0, 0};
        const int part = x % TXP_STRIDE;
        if (part == 0) {
            x0 = x1;
            y0 = y1;
            memcpy(m, ahead, sizeof m);
            txp_straight_at(q->frame, x + TXP_STRIDE, y, &x1, &y1, ahead);
            const double wide = sqrt(m[0] * m[0] + m[2] * m[2]);
            const double high = sqrt(m[1] * m[1] + m[3] * m[3]), most = fmax(wide, high);
            samples = most < TXP_SHRINKING ? 1 : txm_clampi((int)ceil(most), 1, TXP_MOST_SAMPLES);
        }
        const double t = (double)part / (int)TXP_STRIDE;
        txp_rectify_pixel(q, x0 + (x1 - x0) * t, y0 + (y1 - y0) * t, m, samples, v);
        for (int c = 0; c < out->channels; c++) txm_image_set(out, x, y, c, v[c]);
    }
}

/* All rows, some at a time. */
static txm_status txp_rectify_rows(const txp_rectifying *all, txm_env *env) {
    txp_rectifying some = *all;
    const int height = all->out->height;
    for (int y = 0; y < height; y += TXP_ROWS) {
        if (txm_progress(env, (float)y / (float)height, "drawing"))
            return txm_fail(env, TXM_CANCELLED, "cancelled");
        some.first = y;
        txm_parallel_for(env, height - y < TXP_ROWS ? height - y : TXP_ROWS, txp_rectify_row, &some);
    }
    return TXM_OK;
}

/* ---- the calls ------------------------------------------------------------------------------ */

static txm_status txp_straight_check(const texpatch_straight_desc *d, txm_env *env) {
    if (!d) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL");
    txm_status status = txp_check_picture(&d->photo, "photo", env);
    if (status == TXM_OK && d->mask.pixels)
        status = txm_mask_check(&d->mask, "mask", d->photo.width, d->photo.height,
                                TEXPATCH_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    if (d->whole != 0 && d->whole != 1)
        return txm_fail(env, TXM_BAD_ARGUMENT, "whole must be 0 or 1");
    if (!txp_is_within(d->focal, 0, 100) || (d->focal > 0 && d->focal < 0.1f))
        return txm_fail(env, TXM_BAD_ARGUMENT, "focal must be 0.1 to 100 longer sides, or 0");
    return TXM_OK;
}

/* Find pattern and frame; scratch holds what is only needed here. */
static txm_status txp_straight_search(const texpatch_straight_desc *d, txm_arena *scratch,
                                      txm_env *env, texpatch_straight *s) {
    txp_gray sizes[TXP_SIZES];
    txp_sighting found;
    const txm_image photo = txm_image_resolve(d->photo);
    txp_survey *cells = (txp_survey *)txm_arena_alloc(scratch, 1, sizeof *cells);
    if (txm_progress(env, 0, "lattice")) return txm_fail(env, TXM_CANCELLED, "cancelled");
    const int count = txp_evened_sizes(&photo, &d->mask, scratch, env, sizes);
    if (!count || !cells) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the lattice");
    const txm_status status = txp_find_pattern(sizes, count, env, &found);
    if (status != TXM_OK || !(found.guess.score > 0)) return status;
    int at = 0;
    while (at + 1 < count && (sizes[at + 1].width > sizes[at + 1].height
                                  ? sizes[at + 1].width
                                  : sizes[at + 1].height) >= TXP_EDGES_FROM)
        at++;
    s->frame.view = found.guess.view;
    s->field = found.field;
    if (s->frame.view.field) s->frame.view.field = &s->field;
    s->clear = found.guess.wave[0].clear;
    double stretch[4], axes[2];
    txp_gray blurred;
    if (!txp_blur(&sizes[at], scratch, &blurred))
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the lattice");
    txp_find_axes(&blurred, &found.guess, d->focal > 0 ? (double)d->focal : TXP_FOCAL, stretch,
                  axes);
    txp_set_axes(stretch, axes, &s->frame);
    s->found = txp_frame_choose(&s->frame, photo.width, photo.height, cells);
    if (s->found && d->whole) {
        txp_look *look = (txp_look *)txm_arena_alloc(scratch, 1, sizeof *look);
        if (!look) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the lattice");
        s->whole = txp_frame_whole(&found.guess, &sizes[found.size], &s->frame, look);
    }
    return TXM_OK;
}

TEXPATCH_API txm_status texpatch_straight_find(const texpatch_straight_desc *desc, txm_env *env,
                                               texpatch_straight **out) {
    txm_arena memory, scratch;
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    txm_status status = txp_straight_check(desc, env);
    if (status != TXM_OK) return status;
    txm_arena_init(&memory, env);
    txm_arena_init(&scratch, env);
    texpatch_straight *s = (texpatch_straight *)txm_arena_zero(&memory, 1, sizeof *s);
    if (!s) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the lattice");
    s->photo_width = s->frame.width = desc->photo.width;
    s->photo_height = s->frame.height = desc->photo.height;
    status = txp_straight_search(desc, &scratch, env, s);
    if (!s->found) {
        s->frame.width = desc->photo.width;
        s->frame.height = desc->photo.height;
    }
    txm_arena_free(&scratch);
    if (status == TXM_OK && txm_progress(env, 1, "lattice"))
        status = txm_fail(env, TXM_CANCELLED, "cancelled");
    if (status != TXM_OK) {
        txm_arena_free(&memory);
        return status;
    }
    s->memory = memory;
    *out = s;
    return TXM_OK;
}

TEXPATCH_API int texpatch_straight_found(const texpatch_straight *straight, int *width,
                                         int *height) {
    if (width) *width = straight ? straight->frame.width : 0;
    if (height) *height = straight ? straight->frame.height : 0;
    return straight ? straight->found : 0;
}

TEXPATCH_API int texpatch_straight_whole(const texpatch_straight *straight) {
    return straight && straight->found ? straight->whole : 0;
}

TEXPATCH_API double texpatch_straight_agreement(const texpatch_straight *straight) {
    return straight && straight->found ? straight->clear : 0;
}

TEXPATCH_API int texpatch_straight_source(const texpatch_straight *straight, double x, double y,
                                          double source[2]) {
    double m[4];
    if (!straight || !source || !txm_is_finite(x) || !txm_is_finite(y)) return 0;
    source[0] = x;
    source[1] = y;
    if (!straight->found) return 1;
    return txp_straight_at(&straight->frame, x, y, &source[0], &source[1], m);
}

TEXPATCH_API txm_status texpatch_straight_draw(const texpatch_straight *straight,
                                               const txm_image *image, const texpatch_map *map,
                                               txm_env *env, const txm_image *out) {
    static const texpatch_map plain = {1, 0, 0, 0};
    txp_rectifying q;
    if (!straight || !image || !out)
        return txm_fail(env, TXM_BAD_ARGUMENT, "straight, image or out is NULL");
    txm_status status = txp_check_picture(image, "image", env);
    if (status == TXM_OK) status = txm_image_check(out, "out", TEXPATCH_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    const txm_image from = txm_image_resolve(*image), to = txm_image_resolve(*out);
    if (from.width != straight->photo_width || from.height != straight->photo_height)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "image", "must have the size of the photograph");
    if (to.width != straight->frame.width || to.height != straight->frame.height ||
        to.channels != from.channels || to.sample != from.sample)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "out",
                           "must have the size that was found and the format of image");
    q.kind = map ? *map : plain;
    if (q.kind.is_normal && from.channels < 3)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "image", "a normal map has 3 or 4 channels");
    q.frame = &straight->frame;
    q.image = &from;
    q.out = &to;
    q.first = 0;
    const size_t row = (size_t)to.width * (size_t)to.channels * txm_sample_bytes(to.sample);
    for (int y = 0; y < to.height && !straight->found; y++)
        memcpy(txm_image_row(&to, y), txm_image_row_const(&from, y), row);
    return straight->found ? txp_rectify_rows(&q, env) : TXM_OK;
}

TEXPATCH_API void texpatch_straight_free(texpatch_straight *straight) {
    if (!straight) return;
    txm_arena memory = straight->memory;
    txm_arena_free(&memory);
}

#endif /* TEXPATCH_IMPLEMENTATION */

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
